use glam::DAffine3;

use super::meshes::{Moved, ball, cuboid, wall};
use super::*;
use crate::scene::animation::{Mesh, Topology};

fn still() -> Moved {
    Moved { topology: Topology::None, ..Moved::rigid(Mesh::default(), |_| DAffine3::IDENTITY) }
}

/// A body that reflects and hides, with 8 patches.
fn body(surface: Moved, shape: Shape) -> Body {
    Body {
        surface: Arc::new(surface),
        shape,
        material: Material::default(),
        sides: Sides::Auto,
        patches: 8,
        occludes: true,
        thing: None,
    }
}

fn hung(shape: Shape, frame: impl Fn(f64) -> DAffine3 + Send + Sync + 'static) -> Body {
    body(Moved { frame: Box::new(frame), ..still() }, shape)
}

fn occluder(of: Body) -> Body {
    Body { patches: 0, ..of }
}

fn about(bodies: Vec<Body>) -> Surroundings {
    Surroundings::new(Settings::default(), bodies).unwrap()
}

fn ask(surroundings: &mut Surroundings, time_s: f64, source: DVec3, microphone: DVec3) -> Paths {
    let end = |p: DVec3| End { position_m: p.to_array(), thing: None };
    let mut paths = Paths::default();
    surroundings.paths(time_s, end(source), end(microphone), &mut paths).unwrap();
    paths
}

fn db(ratio: f64) -> f64 {
    20.0 * ratio.log10()
}

const WALL: Shape = Shape::Rectangle { width_m: 8.0, height_m: 4.0 };

#[test]
fn the_shape_of_a_size_is_that_of_its_mesh() {
    let (s, m) = (DVec3::new(-2.0, 0.3, -3.0), DVec3::new(2.5, 0.0, -5.0));
    let turned = || DAffine3::from_rotation_y(std::f64::consts::PI);
    let by_size = ask(&mut about(vec![hung(WALL, |_| DAffine3::IDENTITY)]), 0.0, s, m);
    // A mesh that faces +Z, turned to −Z.
    let mesh = Moved::rigid(wall(8.0, 4.0, 5, 3), move |_| turned());
    let by_mesh = ask(&mut about(vec![body(mesh, Shape::Mesh)]), 0.0, s, m);
    let (a, b) = (by_size.bounces[0], by_mesh.bounces[0]);
    assert!(
        (a.heard() / b.heard() - 1.0).abs() < 1e-5 && (a.length_m - b.length_m).abs() < 1e-6,
        "{a:?} {b:?}"
    );
    // And a box by its size is that of a mesh, seen from any side.
    for s in [s, -s, DVec3::new(4.0, 4.0, 1.0)] {
        let by_size = ask(
            &mut about(vec![hung(Shape::Box { size_m: [1.0, 2.0, 3.0] }, |_| DAffine3::IDENTITY)]),
            0.0,
            s,
            m,
        );
        let mesh = Moved::rigid(cuboid([1.0, 2.0, 3.0], 3), |_| DAffine3::IDENTITY);
        let by_mesh = ask(&mut about(vec![body(mesh, Shape::Mesh)]), 0.0, s, m);
        let total = |p: &Paths| p.bounces.iter().map(|b| b.heard().powi(2)).sum::<f64>();
        assert_eq!((by_size.bounces.len(), by_mesh.bounces.len()), (6, 6));
        assert!((total(&by_size) / total(&by_mesh) - 1.0).abs() < 1e-4);
        assert!((by_size.direct - by_mesh.direct).abs() < 0.005, "{} {}", by_size.direct, by_mesh.direct);
    }
}

/// The paper's scene: a standing car, a wall that turns, another that moves by.
struct PaperScene {
    car: DVec3,
    listener: DVec3,
    bodies: Surroundings,
}

/// The wall turns once in 20 s about an upright axis 12 m before the two, from facing away.
fn paper_scene(passing: bool) -> PaperScene {
    let turn = |t: f64| {
        DAffine3::from_translation(DVec3::new(0.0, 1.5, -12.0))
            * DAffine3::from_rotation_y(t * std::f64::consts::TAU / 20.0)
    };
    let mut bodies = vec![Body { sides: Sides::Front, ..hung(WALL, turn) }];
    if passing {
        // 3 m of wall across the line of sight at 10 m/s.
        let pass = |t: f64| {
            DAffine3::from_translation(DVec3::new(0.0, 1.5, 20.0 - 10.0 * t))
                * DAffine3::from_rotation_y(std::f64::consts::FRAC_PI_2)
        };
        bodies.push(occluder(hung(Shape::Rectangle { width_m: 3.0, height_m: 6.0 }, pass)));
    }
    PaperScene { car: DVec3::new(-6.0, 1.0, 0.0), listener: DVec3::new(6.0, 1.7, 0.0), bodies: about(bodies) }
}

#[test]
fn the_echo_of_a_turning_wall_is_loudest_as_a_mirror() {
    let PaperScene { car, listener, mut bodies } = paper_scene(false);
    let mut best = (0.0, 0.0);
    let mut last: Option<Bounce> = None;
    let mut steepest = 0.0f64;
    for step in 0..=20_000 {
        let time_s = f64::from(step) * 1e-3;
        let paths = ask(&mut bodies, time_s, car, listener);
        assert!(paths.direct > 0.999, "the wall is out of the way");
        let bounce = paths.bounces[0];
        if bounce.heard() > best.0 {
            best = (bounce.heard(), time_s);
        }
        // The front faces along −Z turned: seen from both only while both lie before its plane.
        let angle = time_s * std::f64::consts::TAU / 20.0;
        let front = DVec3::new(-angle.sin(), 0.0, -angle.cos());
        let before = |p: DVec3| (p - DVec3::new(0.0, 1.5, -12.0)).dot(front) > 0.0;
        assert_eq!(bounce.heard() > 0.0, before(car) && before(listener), "at {time_s}");
        if let Some(last) = last {
            // Nothing steps: the length never changes faster than the wall's rim moves, 2 × 4 m × ω.
            assert!((bounce.length_m - last.length_m).abs() < 8.0 * 0.3142 * 1e-3 + 1e-9);
            assert!((bounce.heard() - last.gain).abs() < 2e-4, "{last:?} {bounce:?}");
            // In decibels, where it is no further than 40 dB below its loudest.
            if last.gain > 1e-2 * 0.04 && bounce.heard() > 1e-2 * 0.04 {
                steepest = steepest.max(db(bounce.heard() / last.gain).abs());
            }
        }
        last = Some(bounce);
    }
    // It mirrors when its normal halves the angle, at 10 s by symmetry; there the delay is the image's.
    assert!((best.1 - 10.0).abs() < 0.05, "loudest at {}", best.1);
    let paths = ask(&mut bodies, 10.0, car, listener);
    let image = DVec3::new(-6.0, 1.0, -24.0);
    let error_samples = (paths.bounces[0].length_m - image.distance(listener)).abs() / 343.0 * 48000.0;
    assert!(error_samples < 1e-6, "{error_samples}");
    println!(
        "loudest {:.3} s, {:.2} dB below the image; steepest {steepest:.3} dB/ms; {error_samples:e} samples",
        best.1,
        -db(best.0 * image.distance(listener))
    );
}

#[test]
fn a_passing_wall_dampens_smoothly_first_the_car_and_then_its_echo() {
    let PaperScene { car, listener, mut bodies } = paper_scene(true);
    let mut steepest = 0.0f64;
    let mut last: Option<f64> = None;
    let (mut covered, mut clear) = (1.0f64, 0.0f64);
    for step in 0..=8000 {
        let time_s = f64::from(step) * 5e-4;
        let direct = ask(&mut bodies, time_s, car, listener).direct;
        (covered, clear) = (covered.min(direct), clear.max(direct));
        if let Some(last) = last {
            steepest = steepest.max(db(direct / last).abs() / 0.5);
        }
        last = Some(direct);
    }
    assert!(steepest < 0.5, "{steepest} dB a millisecond");
    // The path is 12 m long: a Fresnel zone of 1.43 m radius, so that 3 m of wall hide all of it.
    assert!((covered - 0.1).abs() < 0.005 && clear > 0.9999, "{covered} {clear}");
    println!("direct: steepest {steepest:.3} dB/ms, least {:.2} dB", db(covered));
    // Its echo is hidden later, on the ways to the wall and back, when the wall is there at z = −6.
    // (The mirror is at its place at 10 s only; so the same wall passes a still mirror here.)
    let pass = |t: f64| {
        DAffine3::from_translation(DVec3::new(-3.0, 1.5, 20.0 - 10.0 * t))
            * DAffine3::from_rotation_y(std::f64::consts::FRAC_PI_2)
    };
    let mirror = hung(WALL, |_| {
        DAffine3::from_translation(DVec3::new(0.0, 1.5, -12.0))
            * DAffine3::from_rotation_y(std::f64::consts::PI)
    });
    let passing = occluder(hung(Shape::Rectangle { width_m: 3.0, height_m: 6.0 }, pass));
    let mut both = about(vec![mirror, passing]);
    let at = |both: &mut Surroundings, t| ask(both, t, car, listener);
    let open = at(&mut both, 0.0).bounces[0].heard();
    let (first, then) = (at(&mut both, 2.0), at(&mut both, 2.6));
    assert!(first.direct < 0.11 && first.bounces[0].heard() > 0.999 * open, "{first:?}");
    // There it stands aslant: of the zone of 1.52 m radius it hides the middle 1.34 m, a share of 0.54.
    let left = then.bounces[0].heard() / open;
    assert!(then.direct > 0.999 && (left - (1.0 - 0.9 * 0.54)).abs() < 0.06, "{left}");
}

#[test]
fn how_steep_a_passing_wall_is_follows_from_the_width_of_the_path() {
    // Of a half-plane at p radii the covered share changes by 2 √(1 − p²) / π a radius; with −20 dB behind it
    // the gain so falls by 21 dB a radius at most: at 10 m/s by 0.21 dB / ms over the radius in metres.
    for (length, at) in [(4.0, 2.0), (12.0, 6.0), (12.0, 1.0), (40.0, 20.0f64)] {
        let pass = move |t: f64| {
            DAffine3::from_translation(DVec3::new(at, 0.0, 56.0 - 10.0 * t))
                * DAffine3::from_rotation_y(std::f64::consts::FRAC_PI_2)
        };
        let mut one = about(vec![occluder(hung(Shape::Rectangle { width_m: 100.0, height_m: 100.0 }, pass))]);
        let radius = (at * (length - at) * 0.686 / length).sqrt();
        let mut last = 1.0;
        let mut steepest = 0.0f64;
        for step in 0..=2000 {
            // Its edge passes the axis at 0.6 s.
            let direct = ask(&mut one, f64::from(step) * 5e-4, DVec3::ZERO, DVec3::X * length).direct;
            steepest = steepest.max(db(direct / last).abs() / 0.5);
            last = direct;
        }
        assert!((last - 0.1).abs() < 1e-3);
        println!("{length} m at {at} m: radius {radius:.3} m, {steepest:.3} dB/ms");
        assert!(steepest < 1.06 * 0.21 / radius, "{length}: {steepest} dB/ms, radius {radius}");
    }
}

#[test]
fn bricks_side_by_side_hide_as_one_wall_and_walls_behind_each_other_hide_twice() {
    let (s, m) = (DVec3::new(0.05, 0.1, -3.0), DVec3::new(0.0, 0.0, 3.0));
    let at = |x: f64, y: f64, z: f64| move |_: f64| DAffine3::from_translation(DVec3::new(x, y, z));
    let brick = Shape::Box { size_m: [0.5, 0.25, 0.2] };
    let mut bricks = Vec::new();
    for column in -5..=5 {
        for row in -10..=10 {
            let place = at(0.5 * f64::from(column), 0.25 * f64::from(row), 0.0);
            bricks.push(occluder(hung(brick, place)));
        }
    }
    let wall = ask(&mut about(bricks), 0.0, s, m).direct;
    // Rays that slip through the seams aslant meet two of them.
    assert!(db(wall / 0.1).abs() < 1.5, "{wall}");
    let screen = |z| occluder(hung(Shape::Rectangle { width_m: 9.0, height_m: 9.0 }, at(0.0, 0.0, z)));
    let two = ask(&mut about(vec![screen(0.0), screen(1.0)]), 0.0, s, m).direct;
    assert!((two - 0.01).abs() < 1e-4, "{two}");
}

#[test]
fn a_fine_mesh_hides_what_a_coarse_one_does() {
    for (z, y) in [(0.0, 0.0), (0.4, 1.2), (-0.9, 0.5), (0.0, 1.6)] {
        let place = move |_| DAffine3::from_translation(DVec3::new(4.0, y, z));
        let hidden = |rows| {
            let ball = occluder(body(Moved::rigid(ball(1.0, rows), place), Shape::Mesh));
            ask(&mut about(vec![ball]), 0.0, DVec3::ZERO, DVec3::X * 9.0).direct
        };
        let (coarse, fine) = (hidden(32), hidden(200));
        println!("{z} {y}: coarse {coarse:.4}, fine {fine:.4}");
        assert!((coarse - fine).abs() < 0.03, "{coarse} {fine}");
    }
}

#[test]
fn what_carries_a_sound_is_not_in_its_way() {
    let around = Body { thing: Some(7), ..hung(Shape::Box { size_m: [1.0; 3] }, |_| DAffine3::IDENTITY) };
    let mut about = about(vec![around]);
    let end = |z: f64, thing| End { position_m: [0.0, 0.0, z], thing };
    let mut paths = Paths::default();
    about.paths(0.0, end(0.0, Some(7)), end(5.0, None), &mut paths).unwrap();
    assert!(paths.direct == 1.0 && paths.bounces.iter().all(|b| b.heard() == 0.0));
    about.paths(0.0, end(5.0, None), end(0.0, Some(7)), &mut paths).unwrap();
    assert_eq!(paths.direct, 1.0);
    about.paths(0.0, end(0.0, Some(8)), end(5.0, None), &mut paths).unwrap();
    assert!(paths.direct < 0.6);
}

#[test]
fn ways_of_a_body_are_the_same_however_its_file_tells_them() {
    // The same turning, bending-free wall as a moved mesh, as a bending one and as one cut anew at each key.
    let frame = |t: f64| {
        DAffine3::from_translation(DVec3::new(0.0, 0.0, -4.0)) * DAffine3::from_rotation_y(0.5 * t - 0.5)
    };
    let (s, m) = (DVec3::new(-2.0, 0.0, 0.0), DVec3::new(2.0, 0.5, 0.5));
    let rigid = Moved::rigid(wall(4.0, 3.0, 4, 3), frame);
    let bends = Moved { topology: Topology::Homogeneous, ..Moved::rigid(wall(4.0, 3.0, 4, 3), frame) };
    let cut = Moved {
        topology: Topology::Heterogeneous,
        mesh: Box::new(|t| wall(4.0, 3.0, 3 + (t * 10.0).floor() as u32 % 4, 3)),
        ..Moved::rigid(Mesh::default(), frame)
    };
    let mut three = [rigid, bends, cut].map(|surface| about(vec![body(surface, Shape::Mesh)]));
    let mut last = None;
    for step in 0..200 {
        let time_s = f64::from(step) * 0.01;
        let [a, b, c] = three.each_mut().map(|one| ask(one, time_s, s, m).bounces[0]);
        assert!((a.heard() / b.heard() - 1.0).abs() < 1e-4 && (a.length_m - b.length_m).abs() < 1e-5);
        // Between keys the third goes straight.
        assert!(
            (a.heard() / c.gain - 1.0).abs() < 3e-3 && (a.length_m - c.length_m).abs() < 3e-3,
            "{a:?} {c:?}"
        );
        if let Some(last) = last {
            assert!(f64::abs(c.length_m - last) < 0.05);
        }
        last = Some(c.length_m);
    }
    // Asked again for an earlier time, and for it alone, the answer is the same.
    let again = ask(&mut three[2], 0.73, s, m);
    let cut = Moved {
        topology: Topology::Heterogeneous,
        mesh: Box::new(|t| wall(4.0, 3.0, 3 + (t * 10.0).floor() as u32 % 4, 3)),
        ..Moved::rigid(Mesh::default(), frame)
    };
    assert_eq!(ask(&mut about(vec![body(cut, Shape::Mesh)]), 0.73, s, m), again);
}

#[test]
fn the_largest_patches_are_taken_and_keys_and_speeds_are_known() {
    let slide = |t: f64| DAffine3::from_translation(DVec3::X * 3.0 * t);
    let bodies = vec![
        hung(Shape::Box { size_m: [0.2; 3] }, |_| DAffine3::IDENTITY),
        body(Moved::rigid(cuboid([2.0, 3.0, 4.0], 1), slide), Shape::Mesh),
    ];
    let settings = Settings { patches: 7, ..Settings::default() };
    let mut some = Surroundings::new(settings, bodies).unwrap();
    assert_eq!(some.patches(), 7);
    let far = ask(&mut some, 0.0, DVec3::new(9.0, 9.0, 9.0), DVec3::new(9.0, 9.0, 8.0));
    assert_eq!(far.bounces.len(), 7);
    assert!((some.next_key_s(0.05).unwrap() - 0.1).abs() < 1e-9);
    assert!((some.speed_mps(0.4).unwrap() - 3.0).abs() < 1e-6);
    assert_eq!(about(vec![]).next_key_s(0.0), None);
}

#[test]
fn impossible_bodies_are_errors_that_say_so() {
    let said = |body: Body| match Surroundings::new(Settings::default(), vec![body]) {
        Ok(_) => panic!("it was taken"),
        Err(error) => error.to_string(),
    };
    assert!(said(hung(Shape::Mesh, |_| DAffine3::IDENTITY)).contains("has no mesh"));
    let flat = Shape::Rectangle { width_m: 0.0, height_m: 1.0 };
    assert!(said(hung(flat, |_| DAffine3::IDENTITY)).contains("a side of 0 m"));
    let nan = Shape::Box { size_m: [1.0, f64::NAN, 1.0] };
    assert!(said(hung(nan, |_| DAffine3::IDENTITY)).contains("a side of NaN m"));
    let of = |material| Body { material, ..hung(WALL, |_| DAffine3::IDENTITY) };
    let good = Material::default();
    assert!(said(of(Material { absorption: 1.5, ..good })).contains("absorption is 1.5"));
    assert!(said(of(Material { transmission: f64::NAN, ..good })).contains("transmission is NaN"));
    assert!(said(of(Material { sharpness: 0.0, ..good })).contains("sharpness is 0"));
}

#[test]
fn odd_places_and_meshes_leave_numbers() {
    let mut broken = ball(1.0, 8);
    broken.positions[20] = [f32::NAN; 3];
    let mut meshes = vec![Mesh::default(), broken, wall(1.0, 1.0, 1, 1)];
    meshes[2].positions.iter_mut().for_each(|p| *p = [0.5; 3]);
    let frames: [fn(f64) -> DAffine3; 3] = [
        |_| DAffine3::IDENTITY,
        |_| DAffine3::from_scale(DVec3::ZERO),
        |t| DAffine3::from_translation(DVec3::X / (t - 1.0)),
    ];
    for mesh in &meshes {
        for frame in frames {
            for topology in [Topology::Constant, Topology::Homogeneous, Topology::Heterogeneous] {
                let surface = Moved { topology, ..Moved::rigid(mesh.clone(), frame) };
                let mut one = about(vec![body(surface, Shape::Mesh)]);
                let p = DVec3::new(0.5, 0.2, 3.0);
                for (s, m) in [(p, -p), (p, p), (DVec3::ZERO, p), (p * 1e12, -p)] {
                    for time_s in [0.0, 1.0, 0.5] {
                        let paths = ask(&mut one, time_s, s, m);
                        assert!((0.0..=1.0).contains(&paths.direct), "{}", paths.direct);
                        for bounce in &paths.bounces {
                            assert!(
                                bounce.heard() >= 0.0
                                    && bounce.heard().is_finite()
                                    && bounce.length_m.is_finite()
                            );
                        }
                    }
                }
            }
        }
    }
}
