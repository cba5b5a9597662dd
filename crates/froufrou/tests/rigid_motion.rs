//! Contacts that are found from motion alone, in what simulations made: a ball that rolls down a ramp into a tower of
//! boxes (Blender, 24 frames a second), and PyBullet's poses against PyBullet's own contact log.

mod data;

use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;

use data::data;
use froufrou::Result;
use froufrou::motion::event::{Event, Impact, Rub};
use froufrou::motion::rigid::{Analyser, Body, Kind, Shape};
use froufrou::motion::{contacts::LogEvents, moving::MovingBodies};
use froufrou::scene::Scene;
use froufrou::scene::animation::Transform;
use froufrou::scene::world::{RigidBodies, World};
use froufrou::score::compose::Events;

const TOWER: &str = "
[material.wood]
density = 50

[[object]]
name = 'ball'
source = 'tower.abc#/Ball'
mass = 2

[[object]]
name = 'box'
source = 'tower.abc#/Box*'
material = 'wood'

[[object]]
name = 'ramp'
source = 'tower.abc#/Ramp'

[[object]]
name = 'ground'
source = 'tower.abc#/Ground'

[[contacts]]
bodies = ['*']
";

fn scene(text: &str) -> Option<(Scene, World)> {
    let path = data("anim/tower.abc")?;
    let scene = Scene::parse(text, path.with_file_name("scene.toml"), false).expect("a sound scene");
    let world = World::open(&scene).expect("a sound archive");
    Some((scene, world))
}

fn impacts(events: &[Event]) -> Vec<&Impact> {
    events.iter().filter_map(Event::impact).collect()
}

fn of<'a>(events: &'a [Event], a: &str, b: &str) -> Vec<&'a Event> {
    let is_of = |event: &&Event| {
        let (one, other) = match event {
            Event::Impact(impact) => (&impact.a, &impact.b),
            Event::Slide(rub) | Event::Roll(rub) => (&rub.a, &rub.b),
        };
        one == a && other == b
    };
    events.iter().filter(is_of).collect()
}

fn rolls<'a>(events: &[&'a Event]) -> Vec<&'a Rub> {
    let roll = |event: &&'a Event| match *event {
        Event::Roll(rub) => Some(rub),
        _ => None,
    };
    events.iter().filter_map(roll).collect()
}

#[test]
fn the_tower_lives_as_it_was_simulated() {
    let Some((scene, world)) = scene(TOWER) else { return };
    let bodies = MovingBodies::open(&scene, &world, &scene.touching[0]).unwrap();
    for body in bodies.bodies() {
        match (body.name(), body.shape().kind()) {
            ("ball", Kind::Sphere(radius)) => assert!((radius - 0.12).abs() < 1e-4),
            ("ball", other) => panic!("the ball is {other:?}"),
            (name, Kind::Box(half)) if name.starts_with("box/") => {
                assert!(half.iter().all(|half| (half - 0.1).abs() < 1e-5));
                assert!((body.mass_kg() - 0.4).abs() < 1e-3);
            }
            (_, Kind::Box(_)) => assert!(!body.moves()),
            (name, other) => panic!("{name} is {other:?}"),
        }
    }
    let events: Vec<Event> = Events::open(&scene, &world).unwrap().collect::<Result<_>>().unwrap();
    assert!(events.is_sorted_by(|a, b| a.time_s() <= b.time_s()));
    // The soundtrack begins with the first frame, at 1/24 s of the file.
    let hit_s = 1.4306 - 1.0 / 24.0;
    // The ball falls on the ramp, rolls down it without a sound of hitting, falls off its end onto the ground.
    let ramp = of(&events, "ball", "ramp");
    let down = rolls(&ramp);
    assert!(down.len() > 85, "{}", down.len());
    assert_eq!(ramp.len() - down.len(), 1, "one impact");
    for roll in down.iter().filter(|roll| roll.time_s > 0.3 && roll.time_s < 0.9) {
        // The weight of 2 kg on a slope of 25°.
        assert!((roll.force_n - 2.0 * 9.81 * 25f64.to_radians().cos()).abs() < 0.1, "{roll:?}");
    }
    assert!(down.windows(2).all(|two| two[1].speed_mps > two[0].speed_mps - 0.02), "ever faster");
    let ground = of(&events, "ball", "ground");
    let along = rolls(&ground);
    assert!(along.len() > 350 && ground.len() - along.len() <= 2, "{} {}", along.len(), ground.len());
    assert!(along.iter().filter(|roll| roll.time_s > 2.2).all(|roll| (roll.speed_mps - 0.85).abs() < 0.1));
    // It hits the two lowest boxes at once, as its front comes to their faces.
    let struck: Vec<_> = impacts(&events)
        .into_iter()
        .filter(|i| {
            (i.a == "ball") ^ (i.b == "ball")
                && i.a.starts_with("b")
                && (i.a.starts_with("box") || i.b.starts_with("box"))
        })
        .collect();
    assert!((struck[0].time_s - hit_s).abs() < 1e-3, "{:?}", struck[0]);
    assert!(
        struck
            .iter()
            .take(2)
            .all(|impact| (impact.time_s - hit_s).abs() < 1e-3 && impact.speed_mps.unwrap() > 2.0)
    );
    assert!(struck.iter().all(|impact| impact.time_s < hit_s + 0.2), "in close succession");
    assert!(struck.len() <= 12, "{}", struck.len());
    // What stands is silent until then, and when it stands again.
    let stands = |event: &&Event| {
        of(std::slice::from_ref(*event), "ball", "ground").is_empty()
            && of(std::slice::from_ref(*event), "ball", "ramp").is_empty()
    };
    let about: Vec<f64> = events.iter().filter(stands).map(Event::time_s).collect();
    assert!(about.iter().all(|time_s| *time_s > hit_s - 1e-3 && *time_s < 2.1), "{about:?}");
    // The tower is pushed apart: the lowest boxes slide under the load of those above them.
    let pushed = of(&events, "box/Box0", "ground");
    assert!(pushed.len() > 20);
    let forces = pushed.iter().map(|event| match event {
        Event::Slide(slide) => slide.force_n,
        other => panic!("{other:?}"),
    });
    let mean_n = forces.sum::<f64>() / pushed.len() as f64;
    assert!((mean_n - 5.0 * 0.4 * 9.81).abs() < 2.0, "{mean_n}");
}

#[test]
fn names_that_are_none_are_refused_and_patterns_choose() {
    let Some((scene, world)) = scene(&TOWER.replace("['*']", "['ball', 'gro*']")) else { return };
    let bodies = MovingBodies::open(&scene, &world, &scene.touching[0]).unwrap();
    assert_eq!(bodies.bodies().map(Body::name).collect::<Vec<_>>(), ["ball", "ground"]);
    let Some((scene, world)) = self::scene(&TOWER.replace("['*']", "['bal']")) else { return };
    let fault = MovingBodies::open(&scene, &world, &scene.touching[0]).err().unwrap().to_string();
    assert!(fault.contains("\"bal\"") && fault.contains("ball, box, ramp, ground"), "{fault}");
}

/// PyBullet's bodies, as it was told them, and their poses.
struct PyBullet {
    bodies: Vec<Body>,
    times: Vec<f64>,
    poses: Vec<Vec<Transform>>,
}

fn transform(at: [f64; 3], turn: [f64; 4]) -> Transform {
    let [x, y, z, w] = turn;
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w), at[0]],
        [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w), at[1]],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y), at[2]],
        [0.0, 0.0, 0.0, 1.0],
    ]
}

fn pybullet(path: &Path) -> PyBullet {
    let mut text = String::new();
    flate2::read::GzDecoder::new(std::fs::File::open(path).unwrap()).read_to_string(&mut text).unwrap();
    let mut ways: BTreeMap<String, Vec<Transform>> = BTreeMap::new();
    let mut times = Vec::new();
    for line in text.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |i: usize| cells[i].parse::<f64>().unwrap();
        if times.last() != Some(&number(0)) {
            times.push(number(0));
        }
        let turn = [5, 6, 7, 8].map(number);
        let length = turn.iter().map(|c| c * c).sum::<f64>().sqrt();
        let way = ways.entry(cells[1].to_owned()).or_default();
        way.push(transform([2, 3, 4].map(number), turn.map(|c| c / length)));
    }
    let (mut bodies, mut poses) = (Vec::new(), Vec::new());
    for (name, way) in ways {
        let shape = match name.as_str() {
            "ball" => Shape::sphere(0.06),
            "block_slide" => Shape::cuboid([0.08, 0.05, 0.03]),
            "coin" => continue,
            _ => Shape::cuboid([0.1, 0.05, 0.05]),
        };
        bodies.push(Body::new(&name, shape, 1000.0));
        poses.push(way);
    }
    let stands = |at, turn| vec![transform(at, turn); times.len()];
    bodies.push(Body::new("ground", Shape::cuboid([10.0, 10.0, 0.5]), 1000.0).fixed());
    poses.push(stands([0.0, 0.0, -0.5], [0.0, 0.0, 0.0, 1.0]));
    // Tilted by 0.3 rad; its upper face ends where the log's last contact with it is.
    let (sine, cosine) = 0.3f64.sin_cos();
    let end = [-1.0388, (-0.2367 + sine * 1.0388) / cosine];
    let centre = [end[0] - cosine - 0.02 * sine, 0.0, end[1] + sine - 0.02 * cosine];
    bodies.push(Body::new("ramp", Shape::cuboid([1.0, 0.6, 0.02]), 1000.0).fixed());
    poses.push(stands(centre, [0.0, 0.15f64.sin(), 0.0, 0.15f64.cos()]));
    PyBullet { bodies, times, poses }
}

#[test]
fn loud_impacts_of_the_log_are_in_the_poses_at_62_and_31_hertz() {
    let (Some(poses), Some(log)) = (
        data("contacts/pybullet_mixed_1kHz_poses.csv.gz"),
        data("contacts/pybullet_mixed_1kHz_contacts.csv.gz"),
    ) else {
        return;
    };
    let text = "[[contacts]]\nlog = 'pybullet_mixed_1kHz_contacts.csv.gz'\ncolumns = { t = 't', a = 'bodyA', \
                b = 'bodyB', position = ['px', 'py', 'pz'], normal_force = 'Fn' }";
    let scene = Scene::parse(text, log.with_file_name("scene.toml"), false).unwrap();
    let logged: Vec<Event> =
        LogEvents::open(&scene.contacts[0], RigidBodies::default()).unwrap().collect::<Result<_>>().unwrap();
    // Those of the ball and the block of half a newton second and more.
    let loud: Vec<&Impact> = impacts(&logged)
        .into_iter()
        .filter(|impact| {
            impact.impulse_ns > 0.5 && !(impact.a.starts_with("brick") && impact.b.starts_with("brick"))
        })
        .filter(|impact| impact.a != "coin" && !(impact.a == "brick0" && impact.b == "ground"))
        .collect();
    assert!(loud.len() >= 4, "{loud:?}");
    let all = pybullet(&poses);
    for every in [4, 8] {
        let mut analyser = Analyser::new(all.bodies.clone(), [0.0, 0.0, -9.81]);
        let mut events = Vec::new();
        for frame in (0..all.times.len()).step_by(every) {
            let now: Vec<Transform> = all.poses.iter().map(|way| way[frame]).collect();
            analyser.feed(all.times[frame], &now).unwrap();
        }
        analyser.finish();
        events.extend(std::iter::from_fn(|| analyser.next_event()));
        let found = impacts(&events);
        for impact in &loud {
            let near = found
                .iter()
                .filter(|other| (&other.a, &other.b) == (&impact.a, &impact.b))
                .map(|other| (other.time_s - impact.time_s).abs())
                .fold(f64::INFINITY, f64::min);
            eprintln!(
                "every {every}: {} and {} at {:.4} s, {:.2} N s: off by {:.1} ms",
                impact.a,
                impact.b,
                impact.time_s,
                impact.impulse_ns,
                near * 1e3
            );
            assert!(near < 0.006, "every {every}: {impact:?} is {near} s from the nearest");
        }
        // Nothing is made of what rolls and slides.
        let times = |a: &str, b: &str, from_s: f64, to_s: f64| {
            let is = |i: &&&Impact| i.a == a && i.b == b && i.time_s > from_s && i.time_s < to_s;
            found.iter().filter(is).count()
        };
        assert_eq!(times("ball", "ramp", 0.25, 1.4), 0);
        assert_eq!(times("ball", "ground", 1.6, 1.9), 0);
        assert_eq!(times("block_slide", "ramp", 0.25, 1.4), 0);
        assert_eq!(times("block_slide", "ground", 1.7, 3.0), 0);
        let ramp = of(&events, "ball", "ramp");
        assert!(rolls(&ramp).len() > 110 && ramp.len() < rolls(&ramp).len() + 8);
        let slides = of(&events, "block_slide", "ground");
        assert!(rolls(&slides).is_empty() && slides.len() > 120);
    }
}
