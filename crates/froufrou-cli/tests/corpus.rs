//! Runs `froufrou corpus` on small recordings, and on cloths that need none.

mod common;

use std::path::Path;

use common::{froufrou, good, message, told, wav};
use froufrou::random::Random;

#[test]
fn a_corpus_of_cloth_is_built_told_of_drawn_and_played() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    std::fs::create_dir_all(at("takes")).expect("a folder");
    let random = Random::new(1, 1);
    for (name, level) in [("slow", 0.01), ("fast", 0.03)] {
        let noise: Vec<f32> = (0..32_000).map(|n| level * random.normal(n) as f32).collect();
        wav(Path::new(&at(&format!("takes/{name}.wav"))), 16_000, 1, &noise);
    }
    let mut pops = vec![0.0f32; 32_000];
    for begin in [4000, 14_000, 25_000] {
        for n in 0..300 {
            pops[begin + n] = 0.5 * (-0.02 * n as f32).exp() * (0.4 * n as f32).sin();
        }
    }
    // What is between them is not digital silence.
    pops.iter_mut().enumerate().for_each(|(n, v)| *v += 0.001 * random.normal(n as u64) as f32);
    wav(Path::new(&at("takes/crumple.wav")), 16_000, 1, &pops);
    let manifest = "version = 1\nname = \"test\"\n[friction]\n[[friction.take]]\nrecording = \"slow.wav\"\n\
                    speed_mps = 0.1\n[[friction.take]]\nrecording = \"fast.wav\"\nspeed_mps = 0.5\n\
                    [pops]\nrecordings = [\"crumple.wav\"]\n";
    std::fs::write(at("takes/corpus.toml"), manifest).expect("a file");
    let (takes, corpus, png) = (at("takes"), at("corpus"), at("picture.png"));
    let built = told(&["corpus", "build", &takes, "-o", &corpus]);
    assert_eq!(built["computed"], serde_json::json!(["friction", "pops"]));
    assert_eq!((&built["name"], built["copied"].as_array().map(Vec::len)), (&"test".into(), Some(3)));
    let again = told(&["corpus", "build", &takes, "-o", &corpus]);
    assert_eq!(again["computed"], serde_json::json!([]));

    let info = told(&["corpus", "info", &corpus, "--plot", &png]);
    assert_eq!(info["pops"]["count"], 3);
    let spectra = info["friction"]["spectra"].as_array().expect("spectra");
    // White noise of these levels, but for what is above the last value.
    for (spectrum, (speed, level)) in spectra.iter().zip([(0.1, 0.01f64), (0.5, 0.03)]) {
        assert_eq!(spectrum["speed_mps"], speed);
        let db = spectrum["level_db"].as_f64().expect("a level");
        assert!((db - 20.0 * level.log10()).abs() < 0.3, "{db}");
    }
    let picture = std::fs::read(&png).expect("a picture");
    assert!(picture.starts_with(b"\x89PNG") && picture.len() > 10_000);
    assert_eq!(told(&["info", &corpus])["kind"], "cloth");
    let text = froufrou(["corpus", "info", &corpus]);
    assert!(String::from_utf8_lossy(&text.stdout).contains("2 speeds, up to"));

    let score = "froufrou-score 1 channel\nduration 1\nchannels m\nsound s cloth \"corpus\"\nstart 1 0 s 1 0\n\
                 set 1 0 speed 0.3\ngrain 1 0.5 2\nend 1 0.9\n";
    std::fs::write(at("a.score"), score).expect("a file");
    good(&froufrou(["mix", &at("a.score"), "-o", &at("a.wav")]));

    let fails = |arguments: &[&str], what: &str| {
        let error = message(&froufrou(arguments.iter().copied()));
        assert!(error.contains(what), "{error}");
    };
    fails(&["corpus", "info", &takes.replace("takes", "nowhere")], "corpus.toml");
    fails(&["corpus", "build", folder.path().to_str().expect("a name"), "-o", &corpus], "corpus.toml");
    fails(&["corpus", "info", "synthetic/silk"], "there are synthetic/cotton");
}

#[test]
fn synthetic_cloths_are_told_to_be_so_and_drawn() {
    let folder = tempfile::tempdir().expect("a folder");
    let png = folder.path().join("picture.png").to_string_lossy().into_owned();
    for name in ["cotton", "polyester", "windbreaker", "corduroy"] {
        let info = told(&[
            "corpus",
            "info",
            &format!("synthetic/{name}"),
            "--plot",
            &png,
            "--width",
            "640",
            "--height",
            "480",
        ]);
        assert_eq!(info["is_synthetic"], true);
        assert_eq!(info["pops"].is_null(), name == "corduroy");
        assert!(std::fs::read(&png).expect("a picture").starts_with(b"\x89PNG"));
    }
}
