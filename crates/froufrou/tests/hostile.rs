//! Scores that no one would write, but that are scores: they give finite samples or a clear error, in
//! little time and memory.

mod studio;

use std::fmt::Write;
use std::time::Instant;

use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;
use studio::{Sound, Studio, Take, noise};

/// Numbers from the smallest to the largest that can be mixed, and now and then ones beyond.
fn extreme(largest: f64) -> BoxedStrategy<f64> {
    let signed = |(exponent, minus): (f64, bool)| 10f64.powf(exponent) * if minus { -1.0 } else { 1.0 };
    prop_oneof![
        20 => Just(0.0),
        40 => (-12.0..largest.log10(), any::<bool>()).prop_map(signed),
        20 => Just(largest),
        20 => Just(5e-324),
        1 => Just(1e300),
        1 => Just(f64::MAX),
    ]
    .boxed()
}

/// The time from one line to the next.
fn step() -> BoxedStrategy<f64> {
    prop_oneof![
        20 => 0.001..0.3f64,
        10 => Just(1e-9),
        10 => Just(1e-12),
        10 => Just(0.5),
        5 => Just(1e6),
        1 => Just(1e12),
    ]
    .boxed()
}

fn place() -> BoxedStrategy<[f64; 3]> {
    let near = || -5.0..5.0f64;
    prop_oneof![
        3 => [near(), near(), near()].boxed(),
        1 => Just([0.0; 3]).boxed(),
        1 => [extreme(1e12), extreme(1e12), extreme(1e12)].boxed(),
    ]
    .boxed()
}

#[derive(Debug, Clone)]
struct Thread {
    start_s: f64,
    looped: bool,
    speed: f64,
    offset_s: f64,
    /// Step, verb, place and gain of each line after the start, the start's own first.
    lines: Vec<(f64, u8, [f64; 3], f64)>,
    ends: bool,
}

fn thread() -> impl Strategy<Value = Thread> {
    let gain = prop_oneof![3 => 0.0..2.0f64, 1 => extreme(1e20).prop_map(f64::abs)];
    let line = (step(), 0u8..4, place(), gain);
    let speed =
        prop_oneof![2 => Just(1.0), 2 => 0.1..10.0f64, 1 => (-6.0..6.0f64).prop_map(|e| 10f64.powf(e))];
    let offset = prop_oneof![3 => Just(0.0), 1 => extreme(1e9).prop_map(f64::abs)];
    (0.0..0.5f64, any::<bool>(), speed, offset, prop::collection::vec(line, 1..8), any::<bool>()).prop_map(
        |(start_s, looped, speed, offset_s, lines, ends)| Thread {
            start_s,
            looped,
            speed,
            offset_s,
            lines,
            ends,
        },
    )
}

/// The text of a score in object space, or in channel space with places taken for gain and delay.
fn text(threads: &[Thread], head: &[(f64, bool, [f64; 3])], object: bool, speed_of_sound: f64) -> String {
    let mut text = if object {
        format!(
            "froufrou-score 1 object\nspeed-of-sound {speed_of_sound}\nduration 1\n\
             microphone still cardioid at 0 0 0\nmicrophone head shape 0.2 3\n"
        )
    } else {
        "froufrou-score 1 channel\nduration 1\nchannels main\n".to_string()
    };
    text += "sound once \"x.wav\"\nsound loop \"x.wav\" loop\nsound exact \"x.wav\" loop exact\n";
    if object {
        let mut time_s = 0.0;
        text += "hear head 0 at 0 0 1\n";
        for (step_s, cut, [x, y, z]) in head {
            time_s += step_s;
            writeln!(text, "{} head {time_s:e} at {x:e} {y:e} {z:e}", if *cut { "cut" } else { "hear" })
                .unwrap();
        }
    }
    for (number, thread) in threads.iter().enumerate() {
        let mut time_s = thread.start_s;
        for (index, (step_s, verb, [x, y, z], gain)) in thread.lines.iter().enumerate() {
            let last = index + 1 == thread.lines.len() && thread.ends;
            let verb = match verb {
                _ if index == 0 => "start",
                _ if last => "end",
                0 => "jump",
                _ => "key",
            };
            let (sound, about) = match index {
                0 => {
                    let about = format!(" speed {:e} offset {:e}", thread.speed, thread.offset_s);
                    (if thread.looped { "loop" } else { "once" }, about)
                }
                _ => ("", String::new()),
            };
            let value = if object {
                format!("at {x:e} {y:e} {z:e} gain {gain:e}")
            } else {
                // A delay of an hour is the longest; what is beyond all bounds stays so.
                let delay_s = if x.abs() > 1e12 { x.abs() } else { x.abs() % 3600.0 };
                format!("{gain:e} {delay_s:e}")
            };
            writeln!(text, "{verb} {number} {time_s:e} {sound} {value}{about}").unwrap();
            let before = time_s;
            time_s += step_s;
            if time_s == before {
                time_s = before.next_up();
            }
        }
    }
    text
}

fn studio() -> Studio {
    let studio = Studio::new();
    studio.recording("x.wav", 48_000, &noise(4_800, 1));
    studio
}

/// Samples that are all finite, or an error that says something; in time that a person would wait.
fn survives(studio: &Studio, score: &str) -> Option<Sound> {
    let begin = Instant::now();
    let result = studio.score(score, Take { to_s: Some(1.0), ..Take::at(8_000) });
    let taken_s = begin.elapsed().as_secs_f64();
    assert!(taken_s < 20.0, "{taken_s} s for\n{score}");
    match result {
        Ok(sound) => {
            assert_eq!(sound.frames(), 8_000);
            assert!(sound.mix.iter().all(|sample| sample.is_finite()), "{score}");
            Some(sound)
        }
        Err(error) => {
            let message = error.to_string();
            // No number that came out of a sum in here: what is at fault stands in the score.
            assert!(!message.contains("NaN") && message.len() > 20, "{message}\n{score}");
            None
        }
    }
}

#[test]
fn any_score_gives_finite_samples_or_a_clear_error() {
    let studio = studio();
    let threads = prop::collection::vec(thread(), 1..6);
    let head = prop::collection::vec((step(), any::<bool>(), place()), 0..6);
    let speed_of_sound = prop_oneof![4 => Just(343.0), 1 => (-12.0..12.0f64).prop_map(|e| 10f64.powf(e))];
    let (mut rendered, mut heard) = (0, 0);
    let mut runner =
        TestRunner::new(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() });
    for _ in 0..400 {
        let strategy = (&threads, &head, any::<bool>(), &speed_of_sound);
        let (threads, head, object, speed) = strategy.new_tree(&mut runner).unwrap().current();
        if let Some(sound) = survives(&studio, &text(&threads, &head, object, speed)) {
            rendered += 1;
            heard += u32::from(sound.mix.iter().any(|&sample| sample != 0.0));
        }
    }
    println!("{rendered} of 400 are rendered, {heard} are heard");
    assert!(rendered > 130 && heard > 80, "{rendered} are rendered, {heard} are heard");
}

const HEAD: &str =
    "froufrou-score 1 object\nduration 1\nmicrophone main omni at 0 0 0\nsound x \"x.wav\" loop exact\n";

#[test]
fn what_is_beyond_all_bounds_is_refused_by_name() {
    let studio = studio();
    for (lines, expected) in [
        ("start 7 0 x at 1e200 0 0\nend 7 1\n", "thread 7"),
        ("start 7 1e10 x at 1 0 0\nend 7 1e11\n", "thread 7"),
        ("start 7 0 x at 1 0 0 speed 1e200\nend 7 1\n", "thread 7"),
        ("start 7 0 x at 1 0 0 speed 1e-200\nend 7 1\n", "thread 7"),
        ("start 7 0 x at 1 0 0 offset 1e200\nend 7 1\n", "thread 7"),
        ("start 7 0 x at 1 0 0 gain 1e200\nend 7 1\n", "beyond all numbers"),
    ] {
        let result = studio.score(&format!("{HEAD}{lines}"), Take::at(48_000));
        let message = result.err().unwrap_or_else(|| panic!("{lines}")).to_string();
        assert!(message.contains(expected), "{message}");
    }
    let far = "froufrou-score 1 channel\nchannels main\nsound x \"x.wav\"\nstart 7 0 x 1 4000\nend 7 1\n";
    let message = studio.score(far, Take::at(48_000)).err().unwrap().to_string();
    assert!(message.contains("thread 7 has a delay of 4000 s"), "{message}");
}

#[test]
fn what_is_very_far_or_very_fast_is_rendered_all_the_same() {
    let studio = studio();
    for lines in [
        // A terametre away, there and back.
        "start 1 0 x at 1e12 0 0\nkey 1 0.5 at -1e12 0 0\nend 1 1 at 1e12 0 0\n",
        // On the microphone, and round and round it.
        "start 1 0 x at 0 0 0\nend 1 1 at 0 0 0\n",
        "start 1 0 x at 1e-9 0 0\nkey 1 0.1 at -1e-9 0 0\nkey 1 0.2 at 0 0 0\nend 1 1 at 1e-300 0 0\n",
        // Through it, faster than sound and a little slower.
        "start 1 0 x at -500 0 0\nend 1 1 at 500 0 0\n",
        "start 1 0 x at -80 0 0\nend 1 1 at 80 0 0\n",
        // Lines a nanosecond apart.
        "start 1 0 x at 1 0 0\nkey 1 0.5 at 1 0 0\nkey 1 0.500000001 at 9 0 0\nkey 1 0.500000002 at 1 0 0\nend 1 1\n",
    ] {
        let sound = survives(&studio, &format!("{HEAD}{lines}")).unwrap_or_else(|| panic!("{lines}"));
        let loudest = sound.mix.iter().fold(0.0f32, |a, b| a.max(b.abs()));
        assert!(loudest < 12.0, "as near as can be is 10 times as loud as 1 m away: {loudest} for {lines}");
    }
}

#[test]
fn thousands_of_short_threads_are_a_matter_of_moments() {
    let studio = studio();
    let mut score =
        "froufrou-score 1 object\norder time\nduration 1\nmicrophone main omni at 0 0 0\nsound x \"x.wav\"\n"
            .to_string();
    for thread in 0..5_000u32 {
        let time_s = f64::from(thread) / 5_000.0;
        writeln!(score, "start {thread} {time_s} x at {} 1 0 object o{thread}", thread % 50).unwrap();
        writeln!(score, "end {thread} {}", time_s + 1e-4).unwrap();
    }
    let begin = Instant::now();
    let sorted = score.replacen("order time\n", "", 1);
    let sound = studio.score(&sorted, Take { to_s: Some(0.3), ..Take::at(8_000) }).unwrap();
    assert!(sound.begun.len() >= 1_500 && sound.mix.iter().any(|&sample| sample != 0.0));
    assert!(begin.elapsed().as_secs_f64() < 60.0);
}

#[test]
fn what_begins_late_is_reached_at_once() {
    let studio = studio();
    let score = "froufrou-score 1 channel\nchannels main\nsound x \"x.wav\"\nstart 1 0 x 1 0\nend 1 0.1\n\
                 start 2 500000000 x 1 0\nend 2 500000000.1\n";
    let begin = Instant::now();
    let take = Take { from_s: 500_000_000.0, to_s: Some(500_000_001.0), ..Take::at(48_000) };
    let sound = studio.score(score, take).unwrap();
    assert!(begin.elapsed().as_secs_f64() < 5.0);
    assert_eq!(sound.frames(), 48_000);
    let heard = sound.mix.iter().filter(|&&sample| sample != 0.0).count();
    assert!((4_700..5_400).contains(&heard), "{heard}");
}
