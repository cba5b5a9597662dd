use super::*;
use crate::motion::cloth::geodesic::{Ways, holds};
use crate::motion::cloth::shapes;
use crate::motion::cloth::triangle::nearest;
use crate::random::Random;
use crate::scene::animation::Mesh;

struct Thing {
    surface: Triangulation,
    touchable: Touchable,
    positions: Vec<[f32; 3]>,
}

fn thing(mesh: &Mesh) -> Thing {
    let surface = Triangulation::new(mesh).expect("a sound mesh");
    let touchable = Touchable::new(&surface, &mesh.positions);
    Thing { surface, touchable, positions: mesh.positions.clone() }
}

/// Asks every triangle of every object.
fn brute(proximity: &Proximity, things: &[Thing]) -> Vec<Option<Contact>> {
    let own = &things[proximity.own as usize];
    let ask = |&vertex: &u32| {
        let point = DVec3::from(own.positions[vertex as usize].map(f64::from));
        let mut best: Option<(f64, Contact)> = None;
        for (number, thing) in things.iter().enumerate() {
            for (t, corners) in thing.surface.triangles().iter().enumerate() {
                let slot = thing.touchable.tree.slots()[t];
                let left_out = holds(proximity.surroundings.of(vertex), slot, slot + 1);
                if number as u32 == proximity.own && left_out {
                    continue;
                }
                let corners = corners.map(|c| DVec3::from(thing.positions[c as usize].map(f64::from)));
                let found = nearest(point, corners);
                let squared_m2 = found.squared_m2;
                let nearer = best.is_none_or(|(best_m2, _)| squared_m2 < best_m2);
                if squared_m2 <= proximity.radius_m * proximity.radius_m && nearer {
                    let (object, triangle) = (number as u32, t as u32);
                    let distance_m = squared_m2.sqrt();
                    let contact = Contact { object, triangle, barycentric: found.weights, distance_m };
                    best = Some((squared_m2, contact));
                }
            }
        }
        best.map(|(_, contact)| contact)
    };
    proximity.vertices().iter().map(ask).collect()
}

/// A cloth that is rolled up, laid over a ball, with a ragged mesh beside it, at a time.
fn scene(time: f64) -> Vec<Mesh> {
    let spiral = move |u: f64, v: f64| {
        let angle = 2.0 + 9.0 * u + time;
        let out = 0.12 + 0.004 * angle;
        [out * angle.cos(), 0.3 * v + 0.1 * time, out * angle.sin()]
    };
    let random = Random::new(7, 3);
    let ragged = shapes::sheet(9, 9, |u, v| {
        let at = ((u * 9.0).round() * 10.0 + (v * 9.0).round()) as u64;
        [0.4 * u - 0.1, 0.35 * v, 0.3 * random.uniform(at) - 0.3 * time]
    });
    vec![shapes::sphere(0.1, 3), shapes::sheet(40, 12, spiral), ragged]
}

#[test]
fn the_answers_are_those_of_asking_every_triangle() {
    for radius_m in [0.02, 0.05, 2.0] {
        let mut things: Vec<Thing> = scene(0.0).iter().map(thing).collect();
        let own = &things[1];
        let mut proximity =
            Proximity::new(1, &own.surface, &own.positions, &own.touchable, radius_m, 2.0 * radius_m.min(0.05));
        let (mut touching, mut itself) = (0, 0);
        for frame in 0..6 {
            for (thing, mesh) in things.iter_mut().zip(scene(0.07 * f64::from(frame))) {
                thing.touchable.follow(&thing.surface, &mesh.positions);
                thing.positions = mesh.positions;
            }
            let expected = brute(&proximity, &things);
            let objects: Vec<&Touchable> = things.iter().map(|thing| &thing.touchable).collect();
            let found = proximity.contacts(&objects);
            for (found, expected) in found.iter().zip(&expected) {
                assert_eq!(found, expected, "frame {frame}");
            }
            touching += found.iter().flatten().count();
            itself += found.iter().flatten().filter(|contact| contact.object == 1).count();
        }
        println!("{radius_m}: {touching} contacts, {itself} with itself");
        assert!(touching > 500 && itself > 100, "{radius_m}: {touching} {itself}");
    }
}

#[test]
fn neither_threads_nor_the_past_change_an_answer() -> Result<(), rayon::ThreadPoolBuildError> {
    let run = |frames: &[f64]| {
        let mut things: Vec<Thing> = scene(0.0).iter().map(thing).collect();
        let own = &things[1];
        let mut proximity = Proximity::new(1, &own.surface, &own.positions, &own.touchable, 0.05, 0.1);
        let mut last = Vec::new();
        for &time in frames {
            for (thing, mesh) in things.iter_mut().zip(scene(time)) {
                thing.touchable.follow(&thing.surface, &mesh.positions);
            }
            let objects: Vec<&Touchable> = things.iter().map(|thing| &thing.touchable).collect();
            last = proximity.contacts(&objects).to_vec();
        }
        last
    };
    let alone = run(&[0.3]);
    for threads in [1, 2, 5] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
        assert!(pool.install(|| run(&[0.0, 0.1, 0.2, 0.3])) == alone);
    }
    Ok(())
}

#[test]
fn a_cloth_does_not_touch_its_own_surroundings() {
    // A flat sheet and a sheet that is bent as far as a half turn touch nothing.
    let bend = |most: f64| {
        move |u: f64, v: f64| {
            let angle = most * (u - 0.5);
            [angle.sin() / most, angle.cos() / most, v]
        }
    };
    for most in [1e-3, 1.0, 3.0] {
        let flat = thing(&shapes::sheet(60, 60, bend(most)));
        let mut proximity = Proximity::new(0, &flat.surface, &flat.positions, &flat.touchable, 0.05, 0.1);
        assert!(proximity.contacts(&[&flat.touchable]).iter().all(Option::is_none), "{most}");
    }
    // Folded in two layers 2 cm apart it does, but for the fold.
    let folded = |u: f64, v: f64| {
        let along = u - 0.5;
        let round = 0.01 * std::f64::consts::PI / 2.0;
        if along.abs() > round {
            [along.abs() - round, 0.01 * along.signum(), v]
        } else {
            let angle = along / 0.01;
            [-0.01 * angle.cos(), 0.01 * angle.sin(), v]
        }
    };
    let folded = thing(&shapes::sheet(120, 40, folded));
    let mut proximity = Proximity::new(0, &folded.surface, &folded.positions, &folded.touchable, 0.05, 0.1);
    let vertices = proximity.vertices().to_vec();
    let contacts = proximity.contacts(&[&folded.touchable]);
    for (&vertex, contact) in vertices.iter().zip(contacts) {
        let [x, ..] = folded.positions[vertex as usize].map(f64::from);
        if x > 0.1 {
            let distance_m = contact.map_or(f64::NAN, |contact| contact.distance_m);
            assert!((distance_m - 0.02).abs() < 1e-6, "{x}: {contact:?}");
        }
        // The ways of both layers meet in the fold: so far from it nobody is within the radius.
        if x < 0.005 {
            assert_eq!(*contact, None, "{x}");
        }
    }
}

#[test]
fn ways_are_along_the_cloth_not_through_the_air() {
    let rolled = thing(&scene(0.0)[1]);
    let mut ways = Ways::new(&rolled.surface, &rolled.positions);
    // One turn further the cloth is 2.5 cm away through the air, and some 80 cm along itself.
    assert!(ways.within(0, 0.1).len() < 60);
}

#[test]
fn nothing_touches_what_is_empty() {
    let (empty, sheet) = (thing(&Mesh::default()), thing(&shapes::sheet(4, 4, |u, v| [u, v, 0.0])));
    let mut proximity = Proximity::new(1, &sheet.surface, &sheet.positions, &sheet.touchable, 1.0, 5.0);
    assert!(proximity.contacts(&[&empty.touchable, &sheet.touchable]).iter().all(Option::is_none));
    let mut proximity = Proximity::new(0, &empty.surface, &empty.positions, &empty.touchable, 1.0, 5.0);
    assert!(proximity.contacts(&[&empty.touchable, &sheet.touchable]).is_empty());
}
