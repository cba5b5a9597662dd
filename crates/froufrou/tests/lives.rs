//! The life of contacts in a simulated scene: a ball that rolls down a ramp and hits a stack of bricks, a block that
//! slides, a coin that spins down. What is found is held against the poses, and thinned logs against the whole one.

mod data;

use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;

use data::data;
use froufrou::motion::Event;
use froufrou::motion::event::{Impact, Rub};
use froufrou::motion::rub::Rubbing;
use froufrou::scene::Scene;
use froufrou::scene::world::World;
use froufrou::score::compose::Events;

fn text_of(path: &Path) -> String {
    let mut text = String::new();
    let file = std::fs::File::open(path).expect("a log");
    flate2::read::MultiGzDecoder::new(file).read_to_string(&mut text).expect("text");
    text
}

/// The log and its poses with every n-th step alone.
fn thin(text: &str, every: u64) -> String {
    let step = |line: &str| line.split(',').next().and_then(|t| t.parse::<f64>().ok());
    let kept = |line: &&str| {
        step(line).is_none_or(|t| ((t * 1000.0).round() as u64).wrapping_sub(1).is_multiple_of(every))
    };
    text.lines().filter(kept).map(|line| format!("{line}\n")).collect()
}

const SCENE: &str = r#"
[[object]]
name = "bodies"
body = "*"
source = "poses.csv#*"
up = "z"

[[contacts]]
log = "contacts.csv"
up = "z"

[contacts.columns]
t = "t"
a = "bodyA"
b = "bodyB"
position = ["px", "py", "pz"]
normal = ["nx", "ny", "nz"]
normal_force = "Fn"
normal_velocity = "vrel_n"
sliding_velocity = ["vrel_t1", "vrel_t2"]
"#;

/// What happens in the scene with every n-th step of its logs.
fn events(data: &Path, every: u64, scene: &str) -> Vec<Event> {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, log) in [("contacts", "contacts"), ("poses", "poses")] {
        let text = text_of(&data.join(format!("pybullet_mixed_1kHz_{log}.csv.gz")));
        std::fs::write(folder.path().join(format!("{name}.csv")), thin(&text, every)).expect("a log");
    }
    let scene = Scene::parse(scene, folder.path().join("s.toml"), false).expect("a scene");
    let world = World::open(&scene).expect("a world");
    let events: Vec<Event> =
        Events::open(&scene, &world).expect("logs").map(|e| e.expect("an event")).collect();
    assert!(events.is_sorted_by(|a, b| a.time_s() <= b.time_s()));
    events
}

/// Time and velocity of each pose of a body; Z up.
fn velocities(data: &Path, body: &str) -> Vec<(f64, [f64; 3])> {
    let text = text_of(&data.join("pybullet_mixed_1kHz_poses.csv.gz"));
    let fields = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let number = |field: &str| field.parse::<f64>().expect("a number");
    fields.filter(|f| f[1] == body).map(|f| (number(f[0]), [9, 10, 11].map(|i| number(f[i])))).collect()
}

fn speed_at(velocities: &[(f64, [f64; 3])], time_s: f64) -> f64 {
    let near = velocities.iter().min_by(|a, b| (a.0 - time_s).abs().total_cmp(&(b.0 - time_s).abs()));
    near.map_or(0.0, |(_, v)| v.iter().map(|c| c * c).sum::<f64>().sqrt())
}

type Rubs<'e> = BTreeMap<(&'e str, &'e str), Vec<(bool, &'e Rub)>>;

/// The moments of each pair; true where they roll.
fn rubs(events: &[Event]) -> Rubs<'_> {
    let mut found = Rubs::new();
    for event in events {
        let Some((how, rub)) = event.rub() else { continue };
        found.entry((&rub.a, &rub.b)).or_default().push((how == Rubbing::Roll, rub));
    }
    found
}

fn impacts(events: &[Event]) -> Vec<&Impact> {
    events.iter().filter_map(Event::impact).collect()
}

#[test]
fn a_ball_rolls_a_block_slides_and_bricks_rest() {
    let Some(data) = data("contacts") else { return };
    let events = events(&data, 1, SCENE);
    let rubs = rubs(&events);
    let ball = velocities(&data, "ball");
    let block = velocities(&data, "block_slide");
    // Down the ramp, from 0.2 s on, until it drops off its end at 1.4 s.
    for (pair, from_s, to_s) in [(("ball", "ramp"), 0.2, 1.4), (("ball", "ground"), 1.57, 1.9)] {
        let moments: Vec<_> =
            rubs[&pair].iter().filter(|(_, rub)| (from_s..to_s).contains(&rub.time_s)).collect();
        let rolls = moments.iter().filter(|(rolls, _)| *rolls).count();
        assert!(rolls as f64 >= 0.95 * (to_s - from_s) / 0.01, "{pair:?}: {rolls} of {}", moments.len());
        for (rolls, rub) in moments {
            let speed = speed_at(&ball, rub.time_s);
            assert!(!rolls || (rub.speed_mps / speed - 1.0).abs() < 0.05, "{rub:?} {speed}");
            // Its own surface is 6 cm away from its centre.
            let on = rub.on_m.expect("poses")[0];
            assert!((on.iter().map(|c| c * c).sum::<f64>().sqrt() - 0.06).abs() < 0.02, "{on:?}");
        }
    }
    let slides: Vec<_> =
        rubs[&("block_slide", "ramp")].iter().filter(|(_, rub)| (0.3..1.2).contains(&rub.time_s)).collect();
    assert_eq!(slides.len(), 90);
    for (rolls, rub) in slides {
        let speed = speed_at(&block, rub.time_s);
        assert!(!rolls && (rub.speed_mps / speed - 1.0).abs() < 0.03, "{rub:?} {speed}");
        // m g cos α.
        assert!((rub.force_n - 9.37).abs() < 0.5, "{rub:?}");
    }
}

/// Moments in which the bricks, which stand on each other, rub, but for the time in which they are hit.
fn in_the_stack(events: &[Event]) -> usize {
    let at_rest = |rub: &&Rub| !(1.9..2.1).contains(&rub.time_s) && rub.time_s > 0.1;
    let bricks = |(a, b): &(&str, &str)| a.starts_with("brick") && (b.starts_with("brick") || *b == "ground");
    let all = rubs(events);
    all.iter()
        .filter(|(pair, _)| bricks(pair))
        .flat_map(|(_, all)| all.iter().map(|(_, rub)| *rub))
        .filter(at_rest)
        .count()
}

#[test]
fn a_stack_rests_in_silence_and_a_coin_comes_to_rest() {
    let Some(data) = data("contacts") else { return };
    for every in [1, 16, 32] {
        let events = events(&data, every, SCENE);
        assert_eq!(in_the_stack(&events), 0);
        let late = events.iter().filter(|event| event.time_s() > 2.1);
        // Only the block still slides.
        assert!(late.clone().count() > 10);
        for event in late {
            assert!(matches!(event, Event::Slide(rub) if rub.a == "block_slide"), "{event:?}");
        }
        let coin = rubs(&events).remove(&("coin", "ground")).unwrap_or_default();
        assert!(coin.len() > 20 && coin.iter().all(|(_, rub)| rub.time_s < 1.2), "{}", coin.len());
        assert!(
            coin.iter().filter(|(rolls, _)| *rolls).count() * 2 > coin.len(),
            "it wobbles around its rim"
        );
    }
}

#[test]
fn impacts_know_their_speeds_and_places_on_both() {
    let Some(data) = data("contacts") else { return };
    let events = events(&data, 1, SCENE);
    let hits = impacts(&events);
    let hit = hits.iter().find(|hit| hit.a == "ball" && hit.b == "ramp").expect("a hit");
    // It has fallen from rest for 0.143 s onto a slope of 0.3 rad.
    let fall_mps = 9.81 * 0.1435;
    assert!((hit.speed_mps.expect("speed") / (fall_mps * 0.3_f64.cos()) - 1.0).abs() < 0.03, "{hit:?}");
    assert!((hit.tangential_mps.expect("speed") / (fall_mps * 0.3_f64.sin()) - 1.0).abs() < 0.03, "{hit:?}");
    let [on_ball, on_ramp] = hit.on_m.expect("poses");
    assert_eq!(on_ramp, hit.position_m, "what stands still has no frame of its own");
    assert!((on_ball.iter().map(|c| c * c).sum::<f64>().sqrt() - 0.06).abs() < 0.002, "{on_ball:?}");
}

/// What "the same events" means of a log with every n-th step alone: blows above a floor, which goes with the frames,
/// whose pair has no other one within three frames are found, so near in time and with that impulse, and nothing else is
/// that loud.
#[test]
fn thinned_logs_tell_the_same_events() {
    let Some(data) = data("contacts") else { return };
    let whole = events(&data, 1, SCENE);
    let whole = impacts(&whole);
    for (every, floor_ns, time_s, share) in [(16, 0.1, 0.001, 0.13), (32, 0.25, 0.004, 0.13)] {
        let thinned = events(&data, every, SCENE);
        let thinned = impacts(&thinned);
        let near_s = 3.0 * every as f64 / 1000.0;
        let pair = |a: &Impact, b: &Impact| a.a == b.a && a.b == b.b;
        // The bricks settle in the first frames, from 1 mm above each other.
        let loud = |hit: &&&Impact| hit.impulse_ns > floor_ns && hit.time_s > near_s.max(0.05);
        let mut alone = 0;
        for hit in whole.iter().filter(loud) {
            let others = whole.iter().filter(|other| pair(other, hit) && other.time_s != hit.time_s);
            let others: Vec<_> = others.filter(|other| (other.time_s - hit.time_s).abs() < near_s).collect();
            // The echo of a bounce is a tenth of it.
            let is_alone = others.iter().all(|other| other.impulse_ns < 0.15 * hit.impulse_ns);
            let found =
                thinned.iter().find(|other| pair(other, hit) && (other.time_s - hit.time_s).abs() < near_s);
            let Some(found) = found else { panic!("missed: {hit:?}") };
            if is_alone {
                let ratio = found.impulse_ns / hit.impulse_ns;
                println!(
                    "{every}: {} on {}: {:+.2} ms, {:+.1} %",
                    hit.a,
                    hit.b,
                    1000.0 * (found.time_s - hit.time_s),
                    100.0 * (ratio - 1.0)
                );
                assert!((found.time_s - hit.time_s).abs() < time_s, "{found:?} {hit:?}");
                assert!((ratio - 1.0).abs() < share, "{found:?} {hit:?}");
                alone += 1;
            }
        }
        assert!(alone >= 4, "{alone}");
        for found in thinned.iter().filter(loud) {
            let told = whole.iter().any(|hit| pair(hit, found) && (hit.time_s - found.time_s).abs() < near_s);
            assert!(told, "invented: {found:?}");
        }
        // Those of the bricks come as they settle, and nothing rattles at rest.
        assert!(thinned.iter().all(|hit| hit.time_s < 2.1));
    }
}

#[test]
fn a_thinned_log_without_poses_is_read_as_before() {
    let Some(data) = data("contacts") else { return };
    let without = SCENE.replace("source = \"poses.csv#*\"\nup = \"z\"", "");
    let events = events(&data, 16, &without);
    // Of the slides of a log that has sliding velocities nothing is lost.
    let slides = rubs(&events);
    assert!(slides[&("block_slide", "ramp")].len() > 75);
    assert!(slides[&("ball", "ramp")].iter().filter(|(rolls, _)| *rolls).count() > 70);
    assert_eq!(in_the_stack(&events), 0);
}
