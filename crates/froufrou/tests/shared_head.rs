//! A head that all voices share: it hears nearly what a head with filters for each voice hears, at the same time,
//! at any rate, and its samples do not depend on how they are rendered.

mod studio;

use std::f64::consts::TAU;

use studio::{Sound, Studio, Take, noise};

const RATE_HZ: u32 = 48_000;

/// Both ears of a head, shared or not, and beside it an ordinary microphone.
fn score(shared: bool, rest: &str) -> String {
    let word = if shared { " shared" } else { "" };
    format!(
        "froufrou-score 1 object\nmicrophone plain omni at 0 0 0\nmicrophone ears binaural{word} at 0 0 0\n\
         sound s \"s.wav\"\nsound l \"s.wav\" loop exact\n{rest}"
    )
}

/// Gain and phase in turns of a tone in a channel, over a stretch.
fn tone(sound: &Sound, channel: usize, frequency_hz: f64, range: std::ops::Range<usize>) -> (f64, f64) {
    let samples = sound.channel(channel);
    let (mut re, mut im) = (0.0, 0.0);
    for (n, sample) in samples.iter().enumerate().take(range.end).skip(range.start) {
        let (sine, cosine) = (TAU * frequency_hz * n as f64 / sound.rate_hz).sin_cos();
        (re, im) = (re + sample * cosine, im - sample * sine);
    }
    let count = range.len() as f64 / 2.0;
    (re.hypot(im) / count, im.atan2(re) / TAU)
}

#[test]
fn it_hears_what_the_head_hears_at_the_same_time_and_at_any_rate() {
    let studio = Studio::new();
    for rate_hz in [8000, 44_100, 48_000, 96_000, 192_000] {
        for frequency_hz in [200.0, 500.0, 1000.0] {
            studio.recording("s.wav", rate_hz, &studio::tone(rate_hz, frequency_hz, rate_hz as usize, 0.0));
            for place in ["0 0 -3", "3 0 0", "-2 1 1.5", "0.5 -2 2"] {
                let text = |shared| score(shared, &format!("start 1 0 s at {place}\nend 1 0.5\n"));
                let [full, shared] =
                    [false, true].map(|s| studio.score(&text(s), Take::at(rate_hz)).unwrap());
                let [beside, also] = [&full, &shared].map(|sound| sound.channel(0));
                assert!(
                    beside.iter().zip(&also).all(|(a, b)| a == b),
                    "the microphone beside hears the same"
                );
                let range = rate_hz as usize / 10..rate_hz as usize * 4 / 10;
                for ear in [1, 2] {
                    let (level, phase) = tone(&full, ear, frequency_hz, range.clone());
                    let (found, later) = tone(&shared, ear, frequency_hz, range.clone());
                    let level_db = 20.0 * (found / level).log10();
                    let late_us = ((phase - later + 0.5).rem_euclid(1.0) - 0.5) / frequency_hz * 1e6;
                    let what = format!("{rate_hz} Hz, {frequency_hz} Hz from {place}, ear {ear}");
                    assert!(level_db.abs() < 1.0, "{what}: {level_db:.2} dB");
                    assert!(late_us.abs() < 60.0, "{what}: {late_us:.0} us");
                }
            }
        }
    }
}

const MOVING: &str = "start 1 0 l at -3 0.5 -2 object a\nkey 1 0.6 at 0.02 0.03 0\nend 1 1.1 at 3 1 2\n\
                      start 2 0.1 s at 2 2 2 gain 0.4 object b speed 1.3\nend 2 0.9 at -2 1 -2\n\
                      start 3 0.2 s around ears gain 0.3 object a\nend 3 0.5\n";

#[test]
fn sounds_add_up_and_stems_sum_to_the_mix() {
    let studio = Studio::new();
    studio.recording("s.wav", RATE_HZ, &noise(40_000, 3));
    let whole = studio.score(&score(true, MOVING), Take::at(RATE_HZ)).unwrap();
    assert_eq!(whole.stems.len(), 2);
    for (index, mix) in whole.mix.iter().enumerate() {
        let sum: f64 = whole.stems.iter().map(|(_, stem)| f64::from(stem[index])).sum();
        assert!((sum - f64::from(*mix)).abs() < 1e-5, "{index}: {sum} {mix}");
    }
    let mut sum = vec![0.0; whole.mix.len()];
    for thread in ["1", "2", "3"] {
        let own = |line: &&str| line.split(' ').nth(1) == Some(thread);
        let lines: Vec<&str> = MOVING.lines().filter(own).collect();
        let alone = studio.score(&score(true, &(lines.join("\n") + "\n")), Take::at(RATE_HZ)).unwrap();
        sum.iter_mut().zip(&alone.mix).for_each(|(sum, sample)| *sum += f64::from(*sample));
    }
    for (sum, mix) in sum.iter().zip(&whole.mix) {
        assert!((sum - f64::from(*mix)).abs() < 1e-5, "{sum} {mix}");
    }
}

#[test]
fn any_range_on_any_number_of_cores_is_that_part_of_the_whole() {
    let studio = Studio::new();
    studio.recording("s.wav", 44_100, &noise(40_000, 3));
    let text = score(true, MOVING);
    let whole = studio.score(&text, Take { cores: 1, ..Take::at(RATE_HZ) }).unwrap();
    let again = studio.score(&text, Take { cores: 4, ..Take::at(RATE_HZ) }).unwrap();
    assert!(whole.mix == again.mix && whole.stems == again.stems);
    for (from_s, to_s) in [(0.0, 0.001), (0.001, 0.5), (0.4321, 0.4322), (0.7, 1.1), (1.09, 1.2)] {
        let part = studio.score(&text, Take { from_s, to_s: Some(to_s), ..Take::at(RATE_HZ) }).unwrap();
        let begin = (from_s * f64::from(RATE_HZ) - 1e-6).ceil() as usize * 3;
        assert!(!part.mix.is_empty() && begin + part.mix.len() <= whole.mix.len() + 3 * 4800);
        for (index, sample) in part.mix.iter().enumerate() {
            let expected = whole.mix.get(begin + index).copied();
            // Behind the end there is nothing but what FFTs leave.
            assert!(expected.map_or(sample.abs() < 1e-6, |e| e == *sample), "{from_s}: {index}");
        }
    }
}

#[test]
fn it_rings_out_and_is_silent_before_and_behind() {
    let studio = Studio::new();
    studio.recording("s.wav", RATE_HZ, &[0.5; 100]);
    let sound =
        studio.score(&score(true, "start 1 0.5 s at 0 0 -3.43\nend 1 0.51\n"), Take::at(RATE_HZ)).unwrap();
    for ear in [1, 2] {
        let samples = sound.channel(ear);
        // It arrives 10 ms later; the filters ring for 1.3 ms before and the kernel for 1 ms.
        let first = samples.iter().position(|s| s.abs() > 1e-7).unwrap();
        assert!((24_300..24_490).contains(&first), "{first}");
        let loudest =
            (0..samples.len()).max_by(|a, b| samples[*a].abs().total_cmp(&samples[*b].abs())).unwrap();
        assert!((24_480..24_590).contains(&loudest), "{loudest}");
        assert!(samples[samples.len() - 20].abs() < 1e-4, "it has rung out");
    }
    let silent = studio.score(&score(true, "duration 0.1\n"), Take::at(RATE_HZ)).unwrap();
    assert!(silent.mix.len() == 3 * 4800 && silent.mix.iter().all(|s| *s == 0.0));
}

#[test]
fn a_scene_shares_its_head_where_it_says_so() {
    let studio = Studio::new();
    studio.recording("s.wav", RATE_HZ, &noise(9000, 3));
    let scene = |layout: &str, shared: &str| {
        format!(
            "[listener]\nlayout = '{layout}'\n{shared}\n[[sound]]\nposition = [1, 0, -2]\nrecording = 's.wav'\nat = [0]\n"
        )
    };
    let render = |shared: &str| studio.scene(&scene("binaural", shared), Take::at(RATE_HZ)).unwrap().mix;
    assert_eq!(render(""), render("shared = false"));
    assert_ne!(render(""), render("shared = true"));
    for (layout, shared, expected) in [
        (
            "stereo",
            "shared = true",
            "3:10: `listener.shared`: `shared` is for a listener whose layout is `binaural`",
        ),
        (
            "binaural",
            "shared = 1",
            "3:10: `listener.shared`: expected true or false, found the whole number 1",
        ),
    ] {
        let error = studio.production(&scene(layout, shared)).err().unwrap().to_string();
        assert!(error.ends_with(expected), "{error}");
    }
}
