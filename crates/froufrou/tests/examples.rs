//! The example scenes sound as their READMEs say.

use std::collections::BTreeMap;
use std::path::PathBuf;

use froufrou::motion::event::Event;
use froufrou::render::production::Production;
use froufrou::scene::Scene;
use froufrou::score::{ObjectLine, Start, Verb};

fn open(name: &str) -> Production {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name).join("scene.toml");
    Production::open(Scene::open(path, false).unwrap()).unwrap()
}

/// Every start of a scene's score: when, what and how loud at 1 m.
fn starts(production: &Production) -> Vec<(f64, Start, f64)> {
    let lines: Vec<ObjectLine> = production.object_lines().unwrap().map(|line| line.unwrap()).collect();
    let mut last_s = 0.0;
    let mut found = Vec::new();
    for line in lines {
        if let ObjectLine::Thread(line) = line {
            assert!(line.time_s >= last_s, "in time order");
            last_s = line.time_s;
            if let Verb::Start(start) = line.verb {
                found.push((line.time_s, start, line.value.gain));
            }
        }
    }
    found
}

fn count_by_object(production: &Production) -> BTreeMap<String, usize> {
    let mut counts = BTreeMap::new();
    for (_, start, _) in starts(production) {
        *counts.entry(start.object).or_default() += 1;
    }
    counts
}

#[test]
fn the_ball_bounces_as_it_was_keyed() {
    let production = open("bounce");
    let all = starts(&production);
    let hits: Vec<_> = all.iter().filter(|(_, start, _)| start.object == "ball").collect();
    let knocks: Vec<f64> = all.iter().filter(|(_, s, _)| s.object == "knuckles").map(|h| h.0).collect();
    assert_eq!(hits.len(), 10);
    assert_eq!(knocks, [3.80, 4.02, 4.24]);
    assert!(hits.windows(2).all(|w| w[0].1.sound != w[1].1.sound), "never the same twice running");
    for pair in hits.windows(2) {
        let fall_db = 20.0 * (pair[0].2 / pair[1].2).log10();
        assert!((fall_db - 2.5).abs() < 0.11, "{fall_db} dB");
    }
    // Each flight lasts three quarters of the one before.
    for triple in hits.windows(3) {
        let ratio = (triple[2].0 - triple[1].0) / (triple[1].0 - triple[0].0);
        assert!((ratio - 0.75).abs() < 0.01, "{ratio}");
    }
}

#[test]
fn the_ambulance_comes_from_five_times_as_far() {
    let production = open("ambulance");
    let lines = production.channel_lines().unwrap().map(|line| line.unwrap());
    let delays: Vec<f64> =
        lines.filter(|l| l.thread() == 1).filter_map(|l| Some(l.statement()?.value[0].delay_s)).collect();
    let (least, most) = (delays.iter().copied().fold(f64::MAX, f64::min), delays[0]);
    assert!((most / least - 5.0).abs() < 0.02, "{least} {most}");
    assert_eq!(count_by_object(&production), BTreeMap::from([("engine".into(), 1), ("siren".into(), 1)]));
}

#[test]
fn the_log_of_the_physics_engine_holds_what_the_readme_says() {
    let production = open("collisions");
    let events: Vec<_> = production.events().unwrap().map(|event| event.unwrap()).collect();
    let at = |a: &str, b: &str| -> Vec<f64> {
        let of = |event: &Event| match event {
            Event::Impact(i) => (i.a.starts_with(a) && i.b.starts_with(b)).then_some(i.time_s),
            Event::Slide(_) => None,
        };
        events.iter().filter_map(of).collect()
    };
    let near = |times: &[f64], time: f64| times.iter().any(|t| (t - time).abs() < 0.01);
    assert!(near(&at("ball", "ramp"), 0.14) && near(&at("ball", "ramp"), 0.18));
    assert!(near(&at("block", "ramp"), 0.14) && near(&at("coin", "ground"), 0.24));
    assert!(near(&at("ball", "ground"), 1.52) && near(&at("block", "ground"), 1.52));
    assert!(near(&at("ball", "brick0"), 1.91));
    assert!(at("brick", "brick").iter().all(|&t| t < 0.035) && events.len() < 40, "{}", events.len());
    let counts = count_by_object(&production);
    assert_eq!(counts.keys().collect::<Vec<_>>(), ["ball", "block", "brick", "coin", "ramp"]);
}

#[test]
fn the_tower_sounds_where_its_boxes_go() {
    let production = open("tower");
    let counts = count_by_object(&production);
    let boxes: usize = counts.iter().filter(|(name, _)| name.starts_with("Box/Box")).map(|(_, n)| n).sum();
    assert!(boxes >= 6 && counts["Ball"] >= 5 && counts["Ground"] == 1 && counts["Ramp"] == 1, "{counts:?}");
    let low: Vec<f64> = starts(&production)
        .iter()
        .filter(|(_, start, _)| {
            start.cause.starts_with("Box0 struck") || start.cause.starts_with("Box1 struck")
        })
        .map(|(time_s, ..)| *time_s)
        .collect();
    assert!(low.len() >= 2 && low.iter().all(|t| (1.37..1.42).contains(t)), "{low:?}");
}

#[test]
fn the_demo_shows_all_it_promises() {
    let counts = count_by_object(&open("demo"));
    assert_eq!((counts["ambulance"], counts["ball"]), (1, 7));
    assert!(counts["box"] >= 6 && counts["coin"] >= 10, "{counts:?}");
}
