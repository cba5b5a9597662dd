//! Runs `froufrou grains` on small recordings.

mod common;

use std::path::Path;

use common::{froufrou, good, message, told, wav};
use froufrou::corpus::recording::Recording;
use froufrou::random::Random;

/// Knocks that fade, twice.
fn knocks(seed: u64) -> Vec<f32> {
    let random = Random::new(seed, 0);
    (0..16_000u64)
        .map(|i| {
            let t = (i % 8000) as f32 / 16_000.0;
            let ring = (t * (3000.0 + 200.0 * seed as f32)).sin() + 0.3 * (random.uniform(i) as f32 - 0.5);
            0.5 * (-30.0 * t).exp() * ring
        })
        .collect()
}

#[test]
fn a_corpus_is_built_told_of_and_played() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    std::fs::create_dir_all(at("sounds/hits")).expect("a folder");
    for seed in 0..3 {
        wav(Path::new(&at(&format!("sounds/hits/knock_{seed}.wav"))), 16_000, 1, &knocks(seed));
    }
    wav(Path::new(&at("sounds/thing.wav")), 16_000, 1, &knocks(7));
    let (sounds, corpus) = (at("sounds"), at("corpus"));
    let built = froufrou(["grains", "build", &sounds, "-o", &corpus]);
    good(&built);
    let text = String::from_utf8_lossy(&built.stdout).into_owned();
    assert!(text.contains("4 recordings cut, 16 matched") && text.contains("thing.wav"), "{text}");
    let again = told(&["grains", "build", &sounds, "-o", &corpus]);
    assert_eq!((&again["cut"], &again["matched"]), (&0.into(), &0.into()));

    let info = told(&["info", &corpus]);
    assert_eq!((&info["kind"], &info["rate_hz"]), (&"corpus".into(), &16_000.into()));
    assert_eq!(info["recording"][3]["labelled_by"], "guess");
    assert!(info["lengths"][0]["grains"].as_u64() > Some(3));
    assert_eq!(told(&["info", &at("corpus/corpus.toml")])["lengths"], info["lengths"]);
    let sheet = froufrou(["info", &corpus]);
    assert!(String::from_utf8_lossy(&sheet.stdout).contains("hits/knock_2.wav"));

    let all = told(&["grains", "resynth", &corpus]);
    assert_eq!(all.as_array().map(Vec::len), Some(4));
    assert!(
        all.as_array().into_iter().flatten().all(|near| near["signal_to_noise_db"].as_f64() > Some(20.0))
    );
    let out = at("out.wav");
    let one = told(&["grains", "resynth", &corpus, "knock_1", "--without-own", "-o", &out]);
    assert!(one[0]["signal_to_noise_db"].as_f64() < Some(20.0));
    assert_eq!(Recording::open(&out).expect("sound").frames(), 16_000);
    told(&["grains", "stretch", &corpus, "knock_1", "--factor", "1.5", "-o", &out]);
    assert_eq!(Recording::open(&out).expect("sound").frames(), 24_000);
    let [a, b, c] = ["1", "1", "2"].map(|seed| {
        told(&["grains", "vary", &corpus, "knock_1.wav", "--seed", seed, "-o", &out]);
        Recording::open(&out).expect("sound")
    });
    assert!(a == b && a != c);
    let flac = at("out.flac");
    told(&["grains", "rhythm", &corpus, "knock_0", "thing", "-o", &flac]);
    assert_eq!(Recording::open(&flac).expect("sound").frames(), 16_000);

    let fails = |arguments: &[&str], words: &str| {
        let output = froufrou(arguments);
        assert!(!output.status.success() && message(&output).contains(words), "{}", message(&output));
    };
    fails(&["grains", "vary", &corpus, "knock", "-o", &out], "`knock` is in the names of 3 recordings");
    fails(&["grains", "vary", &corpus, "bell", "-o", &out], "no recording `bell`");
    fails(&["grains", "stretch", &corpus, "thing", "--factor", "99", "-o", &out], "expected 0.05 to 50");
    fails(&["grains", "resynth", &sounds], "corpus.toml");
    fails(&["info", &sounds], "found a folder");
}
