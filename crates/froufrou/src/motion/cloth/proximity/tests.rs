use super::*;
use crate::motion::cloth::geodesic::{Ways, holds};
use crate::motion::cloth::shapes;
use crate::motion::cloth::triangle::nearest;
use crate::random::Random;
use crate::scene::animation::Mesh;

fn things(meshes: &[Mesh]) -> Vec<Touchable> {
    meshes.iter().map(|mesh| Touchable::new(mesh).expect("a sound mesh")).collect()
}

fn follow(things: &mut [Touchable], time: f64) {
    for (thing, mesh) in things.iter_mut().zip(scene(time)) {
        thing.follow(&mesh.positions).expect("as many vertices");
    }
}

/// Asks every triangle of every object.
fn brute(proximity: &Proximity, things: &[Touchable]) -> Vec<Option<Contact>> {
    let own = &things[proximity.own as usize];
    let ask = |&vertex: &u32| {
        let point = DVec3::from(own.positions[vertex as usize].map(f64::from));
        let mut best: Option<(f64, Contact)> = None;
        for (number, thing) in things.iter().enumerate() {
            for (t, corners) in thing.surface.triangles().iter().enumerate() {
                let slot = thing.tree.slots()[t];
                let surroundings = proximity.surroundings.as_ref().map_or(&[][..], |all| all.of(vertex));
                let left_out = holds(surroundings, slot, slot + 1);
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
        let out = 0.12 + 0.0025 * angle;
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
        let mut things = things(&scene(0.0));
        let mut proximity = Proximity::new(1, &things[1], radius_m, 2.0 * radius_m.min(0.05));
        let (mut touching, mut itself) = (0, 0);
        for frame in 0..6 {
            follow(&mut things, 0.07 * f64::from(frame));
            let expected = brute(&proximity, &things);
            let found = proximity.contacts(&things);
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
        let mut things = things(&scene(0.0));
        let mut proximity = Proximity::new(1, &things[1], 0.05, 0.1);
        let mut last = Vec::new();
        for &time in frames {
            follow(&mut things, time);
            last = proximity.contacts(&things).to_vec();
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
        let flat = things(&[shapes::sheet(60, 60, bend(most))]);
        let mut proximity = Proximity::new(0, &flat[0], 0.05, 0.1);
        assert!(proximity.contacts(&flat).iter().all(Option::is_none), "{most}");
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
    let folded = things(&[shapes::sheet(120, 40, folded)]);
    let mut proximity = Proximity::new(0, &folded[0], 0.05, 0.1);
    let vertices = proximity.vertices().to_vec();
    let contacts = proximity.contacts(&folded);
    for (&vertex, contact) in vertices.iter().zip(contacts) {
        let [x, ..] = folded[0].positions[vertex as usize].map(f64::from);
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
fn what_is_told_not_to_touches_others_alone() {
    let things = things(&scene(0.0));
    let mut proximity = Proximity::new(1, &things[1], 0.5, f64::INFINITY);
    let contacts = proximity.contacts(&things);
    assert!(contacts.iter().flatten().all(|contact| contact.object != 1));
    assert!(contacts.iter().flatten().count() > 100);
}

#[test]
fn ways_are_along_the_cloth_not_through_the_air() {
    let rolled = Touchable::new(&scene(0.0)[1]).expect("a sound mesh");
    let mut ways = Ways::new(&rolled.surface, &rolled.positions);
    // One turn further the cloth is 1.6 cm away through the air, and some 80 cm along itself.
    assert!(ways.within(&[0], 0.1).len() < 60);
}

#[test]
fn nothing_touches_what_is_empty() {
    let both = things(&[Mesh::default(), shapes::sheet(4, 4, |u, v| [u, v, 0.0])]);
    assert!(Proximity::new(1, &both[1], 1.0, 5.0).contacts(&both).iter().all(Option::is_none));
    assert!(Proximity::new(0, &both[0], 1.0, 5.0).contacts(&both).is_empty());
}
