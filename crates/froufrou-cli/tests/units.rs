//! Runs `froufrou features`, `warp` and `concatenate` on small recordings.

mod common;

use std::path::Path;

use common::{froufrou, good, message, told, wav};
use froufrou::corpus::recording::Recording;
use froufrou::corpus::units::warp::WarpFile;
use froufrou::random::Random;

/// Noise that swells and fades, of a colour and a loudness.
fn rustle(seed: u64, frames: usize, gain: f64, bright: f64) -> Vec<f32> {
    let random = Random::new(seed, 0);
    let mut low = 0.0;
    (0..frames)
        .map(|i| {
            let t = i as f64 / 48_000.0;
            let swell = (0.3 + (5.0 * t + seed as f64).sin().powi(2)) * (0.2 + (17.0 * t).cos().powi(2));
            low += bright * (random.uniform(i as u64) - 0.5 - low);
            (gain * swell * low) as f32
        })
        .collect()
}

#[test]
fn a_target_is_made_again_of_a_corpus() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    std::fs::create_dir_all(at("takes")).expect("a folder");
    wav(Path::new(&at("takes/one.wav")), 48_000, 1, &rustle(1, 150_000, 0.5, 0.5));
    wav(Path::new(&at("takes/two.wav")), 48_000, 1, &rustle(2, 90_000, 0.5, 0.5));
    wav(Path::new(&at("target.wav")), 48_000, 1, &rustle(3, 60_000, 0.05, 0.2));
    let (takes, corpus, target) = (at("takes"), at("corpus"), at("target.wav"));

    let built = told(&["features", "build", &takes, "-o", &corpus, "--preset", "cotton"]);
    assert_eq!((&built["unit_samples"], &built["computed"]), (&202.into(), &2.into()));
    let again = told(&["features", "build", &takes, "-o", &corpus]);
    assert_eq!((&again["computed"], &again["settings"]), (&0.into(), &built["settings"]));

    // What `info` counts without computing any is what was computed.
    for file in [corpus.clone(), at("corpus/corpus.toml")] {
        let info = told(&["info", &file]);
        assert_eq!((&info["kind"], &info["units"]), (&"units".into(), &built["units"]), "{info}");
        assert_eq!((&info["rate_hz"], &info["settings"]), (&48_000.into(), &built["settings"]));
        let seconds: Vec<f64> = (0..2).filter_map(|i| info["recordings"][i]["duration_s"].as_f64()).collect();
        assert_eq!((seconds, info["duration_s"].as_f64()), (vec![3.125, 1.875], Some(5.0)));
    }
    let sheet = froufrou(["info", &corpus]);
    good(&sheet);
    let sheet = String::from_utf8_lossy(&sheet.stdout).into_owned();
    assert!(sheet.contains("1189 of 202 samples") && sheet.contains("5.00 s"), "{sheet}");

    let csv = froufrou(["features", "write", &target, &corpus]);
    good(&csv);
    let csv = String::from_utf8_lossy(&csv.stdout).into_owned();
    assert!(csv.starts_with("channel,time_s,c0,c1,c2\n1,0,"), "{csv}");
    assert_eq!(csv.lines().count(), 1 + 60_000usize.div_ceil(202));

    // Named correspondences, as they are suggested.
    let (pairs, warp) = (at("pairs.csv"), at("warp.toml"));
    let suggested = told(&["warp", "suggest", &target, &corpus, "-o", &pairs, "--count", "5"]);
    assert_eq!(suggested["pairs"].as_array().map(Vec::len), Some(5));
    let fit = told(&["warp", "fit", &target, &corpus, "--pairs", &pairs, "-o", &warp, "--lambda", "10"]);
    assert!(fit["distance_after"].as_f64() < fit["distance_before"].as_f64(), "{fit}");
    assert_eq!((&fit["clips"], &fit["lambda"]), (&5.into(), &10.0.into()));
    assert_eq!(WarpFile::open(Path::new(&warp)).expect("a warp").clips.len(), 5);
    let auto = at("auto.toml");
    told(&["warp", "suggest", &target, &corpus, "--auto", "-o", &auto]);
    for warp in [&warp, &auto] {
        let picture = at("warp.png");
        good(&froufrou(["warp", "plot", warp, &corpus, "-o", &picture, "--width", "800", "--height", "500"]));
        assert!(std::fs::read(&picture).expect("a picture").starts_with(b"\x89PNG"));
    }

    let (out, units) = (at("out.wav"), at("units.csv"));
    let plain = told(&["concatenate", &target, &corpus, "-o", &out]);
    let warped = told(&["concatenate", &target, &corpus, "--warp", &auto, "-o", &out, "--units", &units]);
    let made = Recording::open(&out).expect("a sound");
    assert_eq!((made.rate_hz, made.frames()), (48_000, 60_000));
    let rows = std::fs::read_to_string(&units).expect("a table");
    assert_eq!(rows.lines().count(), 1 + 298, "{rows}");
    assert!(rows.contains("\"../takes/one.wav\",1,"), "{rows}");
    // The warp brings the quiet target among the loud recordings.
    assert!(warped["beyond"].as_u64() < plain["beyond"].as_u64(), "{plain} {warped}");
    let best = told(&["concatenate", &target, &corpus, "--warp", &auto, "--optimal", "-o", &out]);
    assert!(best["beyond"].as_u64() <= warped["beyond"].as_u64());
    if best["beyond"] == warped["beyond"] {
        assert!(best["cost"].as_f64() <= best["greedy_cost"].as_f64());
    }
    // The greedy selection proves nothing, and of many units few are candidates.
    assert_eq!((&warped["is_best"], &warped["is_best_of_candidates"]), (&false.into(), &false.into()));
    assert_eq!(best["is_best"], false);
    let text = froufrou(["concatenate", &target, &corpus, "--warp", &auto, "--optimal", "-o", &out]);
    good(&text);
    assert!(String::from_utf8_lossy(&text.stdout).contains("proved"), "{text:?}");
    let fitted = told(&["concatenate", &target, &corpus, "--pairs", &pairs, "-o", &at("fitted.flac")]);
    assert_eq!(fitted["units"], 298);
}

#[test]
fn faults_are_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    std::fs::create_dir_all(at("takes")).expect("a folder");
    wav(Path::new(&at("takes/one.wav")), 48_000, 1, &rustle(1, 60_000, 0.5, 0.5));
    let (takes, corpus, take) = (at("takes"), at("corpus"), at("takes/one.wav"));
    let fails = |arguments: &[&str], part: &str| {
        let output = froufrou(arguments);
        assert!(!output.status.success() && message(&output).contains(part), "{}", message(&output));
    };
    fails(&["features", "build", &takes, "-o", &corpus, "--preset", "tweed"], "no preset `tweed`");
    fails(&["concatenate", &take, &corpus, "-o", &at("out.wav")], "features build");
    good(&froufrou(["features", "build", &takes, "-o", &corpus]));
    let pairs = at("pairs.csv");
    std::fs::write(&pairs, "target_s,recording,source_s,duration_s\n0.1,one,9,0.1\n").expect("a file");
    fails(
        &["warp", "fit", &take, &corpus, "--pairs", &pairs, "-o", &at("w.toml")],
        "pairs.csv:2: the clip from 9",
    );
    fails(&["concatenate", &take, &corpus, "-o", &at("out.mp3")], ".wav");
    let other = at("other");
    good(&froufrou(["features", "build", &takes, "-o", &other, "--preset", "corduroy"]));
    let warp = at("warp.toml");
    good(&froufrou(["warp", "suggest", &take, &corpus, "--auto", "-o", &warp]));
    fails(
        &["concatenate", &take, &other, "--warp", &warp, "-o", &at("out.wav")],
        "fit it again with this corpus",
    );
    let text = std::fs::read_to_string(&warp).expect("a warp").replace("version = 1", "version = 9");
    std::fs::write(&warp, text).expect("a file");
    fails(&["warp", "plot", &warp, &corpus], "version: is 9, expected 1");
}

/// Where all units are candidates and may come again at once, nothing has to be left out.
#[test]
fn what_is_proved_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    std::fs::create_dir_all(at("corpus/takes")).expect("a folder");
    wav(Path::new(&at("corpus/takes/one.wav")), 48_000, 1, &rustle(1, 8_000, 0.5, 0.5));
    wav(Path::new(&at("target.wav")), 48_000, 1, &rustle(2, 6_000, 0.5, 0.5));
    let text = "version = 1\n[units]\nrecordings = [\"takes\"]\nwidths = []\nlambda = 1\n\
                [units.selection]\ncool_off = 0\ncandidates = 1000\n";
    std::fs::write(at("corpus/corpus.toml"), text).expect("a corpus");
    let (target, corpus, out) = (at("target.wav"), at("corpus"), at("out.wav"));
    let best = told(&["concatenate", &target, &corpus, "--optimal", "-o", &out]);
    assert_eq!((&best["is_best"], &best["is_best_of_candidates"]), (&true.into(), &true.into()), "{best}");
    let text = froufrou(["concatenate", &target, &corpus, "--optimal", "-o", &out]);
    good(&text);
    assert!(String::from_utf8_lossy(&text.stdout).contains("nothing costs less"), "{text:?}");
}
