use super::super::directivity::Directivity;
use super::*;
use crate::random::Random;
use crate::scene::track::facing_frame;

fn close(a: [f64; 3], b: [f64; 3]) -> bool {
    (0..3).all(|i| (a[i] - b[i]).abs() < 1e-9)
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

#[derive(serde::Deserialize)]
struct Fixture {
    size: [f64; 3],
    absorption: [Bands; WALLS],
    source: [f64; 3],
    listener: [f64; 3],
    order: usize,
    speed_of_sound: f64,
    images: Vec<Seen>,
    response: Option<Vec<f64>>,
}

#[derive(serde::Deserialize)]
struct Seen {
    position: [f64; 3],
    order: usize,
    gains: Vec<f64>,
}

/// Rooms as pyroomacoustics has them.
fn fixtures() -> Vec<Fixture> {
    [
        include_str!("../../../tests/fixtures/room/cube.json"),
        include_str!("../../../tests/fixtures/room/corridor.json"),
        include_str!("../../../tests/fixtures/room/corner.json"),
    ]
    .map(|text| serde_json::from_str(text).unwrap())
    .into()
}

fn walls([left, right, floor, ceiling, front, back]: [Bands; WALLS]) -> Walls {
    Walls { left, right, floor, ceiling, front, back }
}

#[test]
fn the_images_are_those_of_pyroomacoustics_one_by_one() {
    for fixture in fixtures() {
        let room = Room::new([0.0; 3], fixture.size, 0.0, &walls(fixture.absorption)).unwrap();
        let images = room.images(fixture.order).unwrap();
        assert_eq!(images.len(), fixture.images.len());
        let mut taken = vec![false; images.len()];
        for seen in &fixture.images {
            let (number, image) = images
                .iter()
                .enumerate()
                .find(|(_, image)| distance(image.position_m(fixture.source), seen.position) < 1e-4)
                .unwrap();
            assert!(!std::mem::replace(&mut taken[number], true));
            assert_eq!(image.order(), seen.order);
            for (band, gain) in image.gains.iter().enumerate() {
                let expected = seen.gains[band.min(seen.gains.len() - 1)];
                let error_db = 20.0 * (gain / expected).log10();
                assert!(error_db.abs() < 1e-4, "{seen:?} band {band}: {error_db} dB", seen = seen.position);
            }
        }
    }
}

#[test]
fn the_impulse_response_is_that_of_pyroomacoustics() {
    let mut compared = 0;
    for fixture in fixtures() {
        let Some(expected) = &fixture.response else { continue };
        let room = Room::new([0.0; 3], fixture.size, 0.0, &walls(fixture.absorption)).unwrap();
        let mut found = vec![0.0; expected.len()];
        for image in room.images(fixture.order).unwrap() {
            let distance_m = distance(image.position_m(fixture.source), fixture.listener);
            // Its responses begin 40 taps before the sound.
            let at = distance_m / fixture.speed_of_sound * 16_000.0 + 40.0;
            for (tap, found) in found.iter_mut().enumerate() {
                let x = tap as f64 - at;
                let window =
                    if x.abs() <= 40.5 { 0.5 + 0.5 * (std::f64::consts::PI * x / 40.5).cos() } else { 0.0 };
                *found += image.gains[0] / distance_m * window * crate::synth::kernel::sinc(x);
            }
        }
        let power = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>();
        let errors: Vec<f64> = found.iter().zip(expected).map(|(a, b)| a - b).collect();
        // Its table of sincs is read linearly between twentieths of a sample.
        let error_db = 10.0 * (power(&errors) / power(expected)).log10();
        assert!(error_db < -45.0, "{error_db}");
        compared += 1;
    }
    assert_eq!(compared, 2);
}

#[test]
fn images_keep_their_numbers() {
    let room = Room::new([1.0, 2.0, 3.0], [4.0, 3.0, 5.0], 25.0, &Walls::all([0.3; 8])).unwrap();
    let most = room.images(19).unwrap();
    assert_eq!(most.len(), 9919);
    for order in 0..19 {
        let fewer = room.images(order).unwrap();
        assert_eq!(fewer, most[..fewer.len()], "order {order}");
        assert!(fewer.iter().all(|image| image.order() <= order));
        assert!(most[fewer.len()..].iter().all(|image| image.order() > order));
    }
    assert!(close(most[0].position_m([2.0, 3.0, 4.0]), [2.0, 3.0, 4.0]) && most[0].gains == [1.0; 8]);
    // By way of one wall in the order of the lattice: low and high ends of X, Y, Z.
    let first: Vec<usize> =
        most[1..7].iter().map(|image| image.walls.iter().position(|hits| *hits == 1).unwrap()).collect();
    assert_eq!(first, [0, 2, 4, 5, 3, 1]);
}

#[test]
fn a_path_by_way_of_the_walls_is_as_long_as_to_the_image() {
    // A turned room: the points where the straight line to the image crosses the walls, folded back into the room,
    // are those of a path whose legs obey the mirror. Checked for single walls by their definition.
    let random = Random::new(8, 8);
    for turn in [0.0, 90.0, -37.0, 180.0, 270.0] {
        let room = Room::new([1.0, -2.0, 3.0], [4.0, 3.0, 5.0], turn, &Walls::all([0.0; 8])).unwrap();
        let world = |local: [f64; 3]| -> [f64; 3] {
            let angle = f64::to_radians(turn);
            let (sin, cos) = angle.sin_cos();
            // Counter-clockwise seen from above: ahead (−Z) turns to the left (−X).
            [1.0 + cos * local[0] + sin * local[2], -2.0 + local[1], 3.0 - sin * local[0] + cos * local[2]]
        };
        for trial in 0..20 {
            let local: [f64; 3] =
                std::array::from_fn(|i| [4.0, 3.0, 5.0][i] * random.uniform(3 * trial + i as u64));
            let source = world(local);
            assert!(room.contains(source));
            for image in &room.images(1).unwrap()[1..] {
                let wall = image.walls.iter().position(|hits| *hits == 1).unwrap();
                let (axis, far) = (wall / 2, wall % 2 == 1);
                let mut mirrored = local;
                mirrored[axis] = if far { 2.0 * [4.0, 3.0, 5.0][axis] } else { 0.0 } - local[axis];
                assert!(close(image.position_m(source), world(mirrored)));
                assert!(!room.contains(image.position_m(source)));
            }
            // All lengths are kept, and what leaves an image leaves the source.
            for image in room.images(3).unwrap() {
                let v: [f64; 3] = std::array::from_fn(|i| random.uniform(100 + 3 * trial + i as u64) - 0.5);
                let w = image.turned(v);
                assert!((distance(v, [0.0; 3]) - distance(w, [0.0; 3])).abs() < 1e-12);
                assert!(close(image.leaves(w), v));
                let moved: [f64; 3] = std::array::from_fn(|i| source[i] + v[i]);
                let (a, b) = (image.position_m(source), image.position_m(moved));
                assert!(close(std::array::from_fn(|i| b[i] - a[i]), w));
            }
        }
    }
}

#[test]
fn a_dipole_is_heard_by_way_of_the_walls_as_its_sides_are() {
    // A dipole that faces the back wall is silent to its sides, so that the left and right walls, floor and ceiling
    // give it back only aslant; the paths by the front and back walls are its front and rear.
    let room = Room::new([-2.0, -2.0, -2.0], [4.0, 4.0, 4.0], 0.0, &Walls::all([0.0; 8])).unwrap();
    let frame = facing_frame([0.0; 3], [0.3, 0.1, 1.0]);
    let facing = [0.3, 0.1, 1.0f64].map(|c| c / (0.09f64 + 0.01 + 1.0).sqrt());
    let (source, listener) = ([0.0, 0.0, 0.0], [0.7, 0.4, 0.2]);
    for image in room.images(2).unwrap() {
        let place = image.position_m(source);
        let toward: [f64; 3] = std::array::from_fn(|i| listener[i] - place[i]);
        let found = Directivity::DIPOLE.gain(&frame, image.leaves(toward));
        // The mirrored dipole, by its own axis.
        let axis = image.turned(facing);
        let cosine = (0..3).map(|i| axis[i] * toward[i]).sum::<f64>() / distance(toward, [0.0; 3]);
        assert!((found - cosine).abs() < 1e-12, "{image:?}");
    }
    // And by hand: facing the right wall, listener right of it. Directly and by the right wall it is heard in full,
    // by the left wall its rear is, by the floor it is aslant.
    let frame = facing_frame([0.0; 3], [1.0, 0.0, 0.0]);
    let gain = |wall: usize, listener: [f64; 3]| {
        let images = room.images(1).unwrap();
        let image = images.iter().find(|image| image.walls[wall] == 1).unwrap();
        let place = image.position_m([0.0; 3]);
        let toward = std::array::from_fn(|i| listener[i] - place[i]);
        (
            Directivity::DIPOLE.gain(&frame, image.leaves(toward)),
            Directivity::CARDIOID.gain(&frame, image.leaves(toward)),
        )
    };
    let near = |(a, b): (f64, f64), (c, d): (f64, f64)| (a - c).abs() < 1e-12 && (b - d).abs() < 1e-12;
    assert!(near(gain(1, [1.0, 0.0, 0.0]), (1.0, 1.0)));
    assert!(near(gain(0, [1.0, 0.0, 0.0]), (-1.0, 0.0)), "the left wall gives back the rear");
    let slant = 0.1f64.sqrt();
    // The image in the floor is 4 m below: a listener 1 m right and 1 m down of the source is 3 m above and 1 m right of it.
    assert!(near(gain(2, [1.0, -1.0, 0.0]), (slant, 0.5 + 0.5 * slant)));
}

#[test]
fn a_room_knows_its_inside_volume_and_areas() {
    let room = Room::new([1.0, 0.0, 0.0], [2.0, 3.0, 4.0], 90.0, &Walls::all([0.1; 8])).unwrap();
    assert_eq!(room.volume_m3(), 24.0);
    assert_eq!(room.areas_m2().iter().sum::<f64>(), 52.0);
    // Turned to the left: its width goes to −Z, its depth to +X.
    assert!(room.contains([1.1, 0.1, -0.1]) && room.contains([4.9, 2.9, -1.9]));
    assert!(
        !room.contains([0.9, 0.1, -0.1])
            && !room.contains([1.1, 0.1, 0.1])
            && !room.contains([5.1, 1.0, -1.0])
    );
    assert!(!room.contains([f64::NAN; 3]));
    let mut uneven = Walls::all([0.0; 8]);
    uneven.floor = [0.5; 8];
    let room = Room::new([0.0; 3], [2.0, 3.0, 4.0], 0.0, &uneven).unwrap();
    assert!(mean_absorption(&room).iter().all(|mean| (mean - 4.0 / 52.0).abs() < 1e-12));
}

#[test]
fn odd_rooms_and_orders_are_refused() {
    let walls = Walls::all([0.1; 8]);
    let refused =
        |corner, size, turn, walls: &Walls| Room::new(corner, size, turn, walls).unwrap_err().to_string();
    for size in
        [[0.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, f64::NAN, 1.0], [1.0, 1.0, f64::INFINITY], [1.0, 1.0, 2e4]]
    {
        assert!(refused([0.0; 3], size, 0.0, &walls).starts_with("the size of the room is"));
    }
    assert!(refused([f64::NAN, 0.0, 0.0], [1.0; 3], 0.0, &walls).starts_with("the corner of the room"));
    assert!(refused([0.0; 3], [1.0; 3], f64::NAN, &walls).starts_with("the room is turned by"));
    for absorbed in [-0.1, 1.1, f64::NAN] {
        let mut walls = walls;
        walls.ceiling[4] = absorbed;
        let error = refused([0.0; 3], [1.0; 3], 0.0, &walls);
        assert!(
            error.starts_with(&format!("the ceiling absorbs {absorbed} of the energy at 1 kHz")),
            "{error}"
        );
    }
    let room = Room::new([0.0; 3], [1.0; 3], 0.0, &walls).unwrap();
    for order in [20, 1000, usize::MAX / 2, usize::MAX] {
        let error = room.images(order).unwrap_err().to_string();
        assert!(error.contains("more than 10000 images"), "{error}");
    }
}
