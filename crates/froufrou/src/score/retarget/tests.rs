use std::collections::HashSet;
use std::sync::Arc;

use super::*;
use crate::Result;
use crate::corpus::dictionary::{Action, Dictionary, Example, Settings};
use crate::corpus::grains::{Contact, GrainKind};
use crate::random::Random;

const RATE_HZ: u32 = 44_100;

/// Knocks that ring: (when, how loud, how high).
fn knocks(name: &str, seconds: f64, all: &[(f64, f64, f64)]) -> Example {
    let random = Random::new(5, all.len() as u64);
    let samples = (0..(seconds * f64::from(RATE_HZ)) as usize).map(|n| {
        let time_s = n as f64 / f64::from(RATE_HZ);
        let hiss = 1e-4 * (random.uniform(n as u64) - 0.5);
        let sum: f64 = all
            .iter()
            .filter(|(at_s, ..)| time_s >= *at_s)
            .map(|&(at_s, loud, high_hz)| {
                let age_s = time_s - at_s;
                let ring = (std::f64::consts::TAU * high_hz * age_s).sin() * (-age_s * 30.0).exp();
                let clack = (random.uniform(1 << 40 | n as u64) - 0.5) * (-age_s * 800.0).exp();
                loud * (ring + clack)
            })
            .sum();
        (sum + hiss) as f32
    });
    Example {
        name: name.into(),
        samples: samples.collect(),
        rate_hz: RATE_HZ,
        contact: Contact::Impulsive,
        action: Action::Hit,
    }
}

/// Rough noise with a hum.
fn rumble(name: &str, seconds: f64, action: Action, seed: u64) -> Example {
    let random = Random::new(seed, 77);
    let (mut low, mut swell) = (0.0, 0.0);
    let samples = (0..(seconds * f64::from(RATE_HZ)) as usize).map(|n| {
        let white = random.normal(n as u64);
        low += 0.1 * (white - low);
        swell += 0.001 * (random.normal(1 << 40 | n as u64) - swell);
        let hum = (std::f64::consts::TAU * 740.0 * n as f64 / f64::from(RATE_HZ)).sin();
        ((low * (1.0 + 20.0 * swell) + 0.05 * hum) * 0.2) as f32
    });
    Example {
        name: name.into(),
        samples: samples.collect(),
        rate_hz: RATE_HZ,
        contact: Contact::Continuous,
        action,
    }
}

fn repertoire(examples: Vec<Example>) -> Arc<Repertoire> {
    Arc::new(Repertoire::new(Arc::new(Dictionary::build(examples, None, &Settings::default()).unwrap())))
}

#[test]
fn each_onset_of_a_recording_is_a_hit_that_begins_there_and_rings_out() {
    let all = [(0.2, 0.5, 900.0), (0.6, 0.1, 1400.0), (0.9, 0.25, 700.0)];
    let repertoire = repertoire(vec![knocks("knocks", 1.4, &all)]);
    let mut hits: Vec<&Hit> = repertoire.hits().iter().collect();
    assert_eq!(hits.len(), 3, "{:?}", hits.iter().map(|hit| hit.level_db).collect::<Vec<_>>());
    let levels: Vec<f64> = hits.iter().map(|hit| hit.level_db).collect();
    for (found, expected) in [(levels[2] - levels[0], 5.0f64), (levels[1] - levels[0], 2.5)] {
        assert!((found - 20.0 * expected.log10()).abs() < 1.0, "{found} dB");
    }
    let grains = repertoire.dictionary().grains();
    let onset_s = |hit: &Hit| {
        let first = hit.plays[0];
        grains[first.grain.number as usize].start as f64 / f64::from(RATE_HZ) - first.time_s
    };
    hits.sort_by(|a, b| onset_s(a).total_cmp(&onset_s(b)));
    for (hit, (at_s, ..)) in hits.iter().zip(all) {
        assert!((onset_s(hit) - at_s).abs() < 0.001, "{} instead of {at_s}", onset_s(hit));
        assert!(hit.lead_s() >= 0.0 && hit.lead_s() < LONGEST_LEAD_S);
        // Its end is silence: its own, or it is faded before the next one.
        let last = hit.plays.last().unwrap();
        let level = |play: &Play| {
            let entry = &grains[play.grain.number as usize];
            play.grain.gain.powi(2) * entry.energy / entry.length as f64
        };
        let loudest = hit.plays.iter().map(level).fold(0.0, f64::max);
        let end_db = 10.0 * (level(last) / loudest).log10();
        assert!(end_db < -35.0, "the tail of the hit at {at_s} s ends at {end_db} dB");
        // Grains stand where they stood in the recording.
        for play in &hit.plays {
            let start = grains[play.grain.number as usize].start as f64 / f64::from(RATE_HZ);
            assert!((play.time_s - (start - onset_s(hit))).abs() < 1e-9);
        }
    }
}

#[test]
fn strong_impacts_get_strong_hits_and_no_hit_comes_twice_running() {
    let examples = (0..10).map(|n| {
        let loud = 0.5 * 10f64.powf(-f64::from(n) * 4.0 / 20.0);
        knocks(&format!("knock {n}"), 0.5, &[(0.05, loud, 600.0 + 50.0 * f64::from(n))])
    });
    let repertoire = repertoire(examples.collect());
    assert_eq!(repertoire.hits().len(), 10);
    let random = Random::new(1, 1);
    let mut means = Vec::new();
    for strength_db in [0.0, -12.0, -24.0, -36.0] {
        let mut last = None;
        let mut chosen = Vec::new();
        for n in 0..300 {
            let hit = repertoire.hit(strength_db, random, n, last).unwrap();
            assert_ne!(Some(hit), last);
            last = Some(hit);
            let off_db = repertoire.hits()[hit].level_db - repertoire.hits()[9].level_db - strength_db;
            assert!(off_db.abs() < 9.0, "{off_db} dB");
            // What comes out is as strong as it is asked to be.
            let level_db = repertoire.hits()[hit].level_db + 20.0 * repertoire.gain(hit).log10();
            assert!((level_db - repertoire.hits()[9].level_db).abs() < 1e-9);
            chosen.push(hit);
        }
        assert!(chosen.iter().collect::<HashSet<_>>().len() >= 3);
        means.push(chosen.iter().sum::<usize>() as f64 / chosen.len() as f64);
    }
    assert!(means.is_sorted_by(|a, b| a > b), "{means:?}");
    // A single one is played all the same.
    let one = self::repertoire(vec![knocks("one", 0.5, &[(0.1, 0.5, 800.0)])]);
    assert_eq!(one.hit(-3.0, random, 1, Some(0)), Some(0));
}

const COURSE: Course = Course { pitch: 1.0, spread: 0.0, force_n: 10.0, speed_mps: 1.0 };

/// The sum of what a stream plays and the sum of its windows' powers, for seconds of one part.
fn render(
    repertoire: &Arc<Repertoire>,
    stream: &mut Stream,
    seconds: f64,
    step_s: f64,
) -> (Vec<Play>, Vec<f64>) {
    let mut plays = Vec::new();
    let mut time_s = 0.0;
    while time_s < seconds {
        time_s += step_s;
        plays.extend(stream.until(time_s, COURSE, repertoire, None).unwrap());
    }
    let dictionary = repertoire.dictionary();
    let mut sound = vec![0.0; ((seconds + 0.2) * f64::from(RATE_HZ)) as usize];
    for play in &plays {
        let begin = (play.time_s * f64::from(RATE_HZ)).round() as usize;
        for (n, &sample) in dictionary.samples(play.grain.number as usize).iter().enumerate() {
            if let Some(to) = sound.get_mut(begin + n) {
                *to += play.grain.gain * f64::from(sample);
            }
        }
    }
    sound.truncate((seconds * f64::from(RATE_HZ)) as usize);
    (plays, sound)
}

#[test]
fn a_stream_has_no_gap_and_does_not_depend_on_the_rate_of_physics() {
    let examples = vec![
        rumble("a", 3.0, Action::Roll, 1),
        rumble("b", 2.0, Action::Roll, 2),
        rumble("c", 2.0, Action::Slide, 3),
    ];
    let repertoire = repertoire(examples);
    assert_eq!(repertoire.lasting(Action::Roll).len(), 2);
    let stream = || Stream::new(&repertoire, Action::Roll, Random::new(3, 3));
    let (plays, sound) = render(&repertoire, &mut stream(), 10.0, 0.001);
    // What begins before the end is the same however often it is asked for.
    let early = |plays: &[Play]| plays.iter().copied().filter(|play| play.time_s < 9.9).collect::<Vec<_>>();
    for step_s in [1.0 / 30.0, 1.0 / 60.0, 0.7] {
        let (other, _) = render(&repertoire, &mut stream(), 10.0, step_s);
        assert!(early(&other) == early(&plays), "asked every {step_s} s");
    }
    // Each part is a chain: a grain begins where the one before it ends, but for the taper.
    let grains = repertoire.dictionary().grains();
    for is_tone in [true, false] {
        let of_part =
            |play: &&Play| (grains[play.grain.number as usize].kind == GrainKind::Sinusoidal) == is_tone;
        let part: Vec<&Play> = plays.iter().filter(of_part).collect();
        assert!(part.len() > 100, "{}", part.len());
        for pair in part.windows(2) {
            let entry = &grains[pair[0].grain.number as usize];
            let end_s = pair[0].time_s + entry.length as f64 / f64::from(RATE_HZ);
            let overlap = (end_s - pair[1].time_s) * f64::from(RATE_HZ) / entry.length as f64;
            assert!((0.005..0.015).contains(&overlap), "{overlap}");
            assert_ne!(pair[0].grain.number, pair[1].grain.number, "no grain comes twice running");
        }
    }
    // No hundredth of a second is much softer than the softest of the recordings.
    let softest = |sound: &[f64]| {
        let powers = sound.chunks_exact(441).map(|piece| piece.iter().map(|v| v * v).sum::<f64>());
        powers.fold(f64::INFINITY, f64::min)
    };
    let recorded = (0..2).map(|n| {
        let sound: Vec<f64> = repertoire.dictionary().sound(n).iter().map(|&v| f64::from(v)).collect();
        softest(&sound)
    });
    let recorded = recorded.fold(f64::INFINITY, f64::min);
    assert!(softest(&sound) > recorded / 4.0, "{} {recorded}", softest(&sound));
}

fn shader(script: &str) -> Result<Shader> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("shader.rhai");
    std::fs::write(&file, script).unwrap();
    Shader::open(&file)
}

#[test]
fn a_shader_decides_what_an_impact_plays() {
    let repertoire =
        repertoire(vec![knocks("a", 0.6, &[(0.05, 0.5, 700.0)]), knocks("b", 0.6, &[(0.05, 0.1, 900.0)])]);
    let struck =
        Struck { impulse_ns: 0.5, speed_mps: 2.0, slip_mps: 0.0, reference_impulse_ns: 1.0, time_s: 3.0 };
    // What is done without a shader.
    let plain =
        shader("fn impact(impulse, speed, slip) { play(pick(strength()), 0.0, strength(), 1.0); }").unwrap();
    let (plays, last) = plain.impact(&struck, &repertoire, Random::new(1, 1), Some(1)).unwrap();
    let hit = &repertoire.hits()[0];
    assert_eq!((last, plays.len()), (Some(0), hit.plays.len()));
    for (found, own) in plays.iter().zip(&hit.plays) {
        assert_eq!(
            (found.time_s, found.grain.number, found.grain.speed),
            (own.time_s, own.grain.number, 1.0)
        );
        assert!((found.grain.gain / (own.grain.gain * 0.5 * repertoire.gain(0)) - 1.0).abs() < 1e-12);
    }
    // Every word, and the contact's own numbers.
    let words = shader(
        "fn impact(impulse, speed, slip) {
             let brightest = 0;
             for h in 0..hits() { if brightness(h) > brightness(brightest) { brightest = h; } }
             if level(hits() - 1) != 0.0 || length(0) <= 0.0 { throw \"levels\"; }
             play(brightest, 0.25, impulse * speed, 2.0);
         }",
    );
    let (plays, _) = words.unwrap().impact(&struck, &repertoire, Random::new(1, 1), None).unwrap();
    let hit = repertoire.hits().iter().max_by(|a, b| a.centroid_hz.total_cmp(&b.centroid_hz)).unwrap();
    assert!((plays[0].time_s - (0.25 + hit.plays[0].time_s / 2.0)).abs() < 1e-12);
    assert_eq!(plays[0].grain.speed, 2.0);
    assert_eq!(plays[0].grain.number, hit.plays[0].grain.number);
    let silent = shader("fn impact(impulse, speed, slip) { }").unwrap();
    assert!(silent.impact(&struck, &repertoire, Random::new(1, 1), None).unwrap().0.is_empty());
}

#[test]
fn a_shader_decides_how_a_stream_goes_on() {
    let repertoire = repertoire(vec![rumble("a", 2.0, Action::Slide, 1), rumble("b", 2.0, Action::Slide, 2)]);
    let flow = |script: &str| {
        let shader = shader(script).unwrap();
        let mut stream = Stream::new(&repertoire, Action::Slide, Random::new(3, 3));
        stream.until(2.0, COURSE, &repertoire, Some(&shader)).unwrap()
    };
    let plain = Stream::new(&repertoire, Action::Slide, Random::new(3, 3))
        .until(2.0, COURSE, &repertoire, None)
        .unwrap();
    // Another kind of contact is left alone.
    assert_eq!(flow("fn roll(force, speed) { gain(0.0); }"), plain);
    let shaded =
        flow("fn slide(force, speed) { gain(force / 20.0); pitch(1.0 + speed); spread(0.03); wait(0.1); }");
    let grains = repertoire.dictionary().grains();
    for play in &shaded {
        let is_tone = grains[play.grain.number as usize].kind == GrainKind::Sinusoidal;
        let expected = if is_tone { (2.0, 0.03) } else { (1.0, 0.0) };
        assert_eq!((play.grain.speed, play.grain.spread), expected);
    }
    assert!(shaded.len() < plain.len() && shaded[0].time_s >= 0.09, "it waits");
    let best = flow(
        "fn slide(force, speed) {
             let best = 0;
             for c in 0..choices() { if fit(c) > fit(best) || brightness(c) < 0.0 { best = c; } }
             choose(best);
         }",
    );
    assert_ne!(best, plain);
}

#[test]
fn faults_of_shaders_are_told_with_their_line() {
    let repertoire = repertoire(vec![knocks("a", 0.6, &[(0.05, 0.5, 700.0)])]);
    let struck =
        Struck { impulse_ns: 0.5, speed_mps: 2.0, slip_mps: 0.0, reference_impulse_ns: 1.0, time_s: 3.0 };
    for (script, expected) in [
        ("fn strike(a, b, c) { }", "none of the functions of a shader (write one of `fn impact"),
        ("fn impact(impulse) { }", "`impact` takes 3 arguments"),
        ("let x = hits();", "ask within `impact`"),
    ] {
        let error = shader(script).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
    for (script, expected) in [
        (
            "\nfn impact(i, s, t) {\n  play(7, 0.0, 1.0, 1.0); }",
            "shader.rhai:3:3: there is no hit 7: the corpus has 1",
        ),
        ("fn impact(i, s, t) { play(0, -1.0, 1.0, 1.0); }", "a delay is -1, not from 0 to 10"),
        ("fn impact(i, s, t) { play(0, 0.0, 0.0 / 0.0, 1.0); }", "a number is NaN"),
        ("fn impact(i, s, t) { pitch(2.0); }", "for `slide` and `roll` alone"),
        ("fn impact(i, s, t) { loop { } }", "the script is stopped"),
        ("fn impact(i, s, t) { for n in 0..100 { play(0, 0.0, 1.0, 1.0); } }", "more than 64 hits"),
    ] {
        let shader = shader(script).unwrap();
        let error = shader.impact(&struck, &repertoire, Random::new(1, 1), None).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

/// One of the shaders that come with froufrou.
fn shipped(name: &str) -> Shader {
    Shader::open(format!("{}/../../examples/shaders/{name}.rhai", env!("CARGO_MANIFEST_DIR"))).unwrap()
}

#[test]
fn the_shaders_that_come_along_do_what_they_say() {
    let mut examples: Vec<Example> = (0..12)
        .map(|n| {
            let loud = 0.5 * 10f64.powf(-f64::from(n % 5) * 5.0 / 20.0);
            knocks(&format!("knock {n}"), 0.5, &[(0.05, loud, 300.0 * 1.2f64.powi(n))])
        })
        .collect();
    examples.push(rumble("a", 2.0, Action::Slide, 1));
    examples.push(rumble("b", 2.0, Action::Roll, 2));
    let repertoire = repertoire(examples);
    let grains = repertoire.dictionary().grains();
    let impact = |shader: &Shader, impulse_ns: f64, seed: u64| {
        let struck =
            Struck { impulse_ns, speed_mps: 1.0, slip_mps: 0.2, reference_impulse_ns: 1.0, time_s: 1.0 };
        shader.impact(&struck, &repertoire, Random::new(seed, 1), None).unwrap().0
    };
    let bright = shipped("bright");
    let mean_hz = |impulse_ns: f64| {
        let firsts = (0..50).map(|seed| impact(&bright, impulse_ns, seed)[0].grain.number);
        firsts.map(|number| grains[number as usize].centroid_hz).sum::<f64>() / 50.0
    };
    let means = [0.01, 0.1, 0.4, 1.0].map(mean_hz);
    assert!(means.is_sorted_by(|a, b| a < b), "{means:?}");

    let rattle = shipped("rattle");
    for seed in 0..50 {
        // Hits begin with their onset's grain: those at which time goes on and gain falls.
        let plays = impact(&rattle, 0.5, seed);
        let hits = repertoire.hits().iter().map(|hit| hit.plays[0].grain.number).collect::<HashSet<_>>();
        let knocks: Vec<f64> =
            plays.iter().filter(|play| hits.contains(&play.grain.number)).map(|play| play.time_s).collect();
        assert!((3..20).contains(&knocks.len()), "{knocks:?}");
    }
    let stream = |shader: &Shader, action, force_n: f64, speed_mps: f64| {
        let course = Course { force_n, speed_mps, ..COURSE };
        let mut stream = Stream::new(&repertoire, action, Random::new(3, 3));
        stream.until(4.0, course, &repertoire, Some(shader)).unwrap()
    };
    let stutters = stream(&rattle, Action::Roll, 10.0, 0.2);
    let smooth = stream(&bright, Action::Roll, 10.0, 0.2);
    assert!(stutters.len() < smooth.len());

    let squeal = shipped("squeal");
    let pitch = |force_n: f64, speed_mps: f64| {
        let plays = stream(&squeal, Action::Slide, force_n, speed_mps);
        plays.iter().map(|play| play.grain.speed).fold(0.0, f64::max)
    };
    assert_eq!((pitch(1.0, 2.0), pitch(10.0, 0.5), pitch(20.0, 2.0)), (1.0, 1.5, 3.0));
}
