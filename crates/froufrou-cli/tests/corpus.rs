//! Runs `froufrou corpus` on small recordings, and on cloths that need none.

mod common;

use std::path::Path;

use common::{froufrou, good, message, told, wav};
use froufrou::corpus::paper::plate::Shape;
use froufrou::corpus::paper::synthetic::Paper;
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

#[test]
fn paper_is_told_of_drawn_and_played() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let info = told(&["corpus", "info", "synthetic/printer", "--plot", &at("matrix.png")]);
    assert_eq!(
        (&info["is_synthetic"], &info["clips"], &info["spectra"]),
        (&true.into(), &252.into(), &84.into())
    );
    assert_eq!(info["places"].as_array().map(Vec::len), Some(82));
    let text = froufrou(["corpus", "info", "synthetic/banknote"]);
    let text = String::from_utf8_lossy(&text.stdout).into_owned();
    assert!(
        text.contains("12.5 cm") && text.contains("3+1") && text.contains("9 clips, 3 spectra"),
        "{text}"
    );
    good(&froufrou([
        "plot",
        "synthetic/tracing",
        "-o",
        &at("tracing.png"),
        "--width",
        "640",
        "--height",
        "480",
    ]));
    for picture in ["matrix.png", "tracing.png"] {
        let picture = std::fs::read(at(picture)).expect("a picture");
        assert!(picture.starts_with(b"\x89PNG") && picture.len() > 10_000);
    }
    let error = message(&froufrou(["plot", "synthetic/tracing", "--from", "1"]));
    assert!(error.contains("a corpus has no times"), "{error}");
}

#[test]
fn a_recording_of_crumpling_is_harvested_corrected_and_built() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let rate_hz = 44_100;
    let paper = Paper::named("synthetic/printer").expect("a model").expect("a model");
    let flap = paper.flap(&Shape::rectangle(0.1, 0.2), 99, f64::from(rate_hz));
    let clac = paper.clac(3, f64::from(rate_hz));
    let random = Random::new(2, 2);
    let mut sound: Vec<f32> = (0..5 * u64::from(rate_hz)).map(|n| 2e-4 * random.normal(n) as f32).collect();
    for (clip, begins) in [(&flap, [20_000, 120_000]), (&clac, [80_000, 180_000])] {
        for begin in begins {
            sound[begin..].iter_mut().zip(clip).for_each(|(sum, sample)| *sum += sample);
        }
    }
    wav(Path::new(&at("crumple.wav")), rate_hz, 1, &sound);
    let (recording, corpus) = (at("crumple.wav"), at("kraft"));
    let harvest = told(&["corpus", "harvest", &recording, "-o", &corpus]);
    assert_eq!((&harvest["flaps"], &harvest["clacs"]), (&2.into(), &2.into()));
    let manifest = std::fs::read_to_string(at("kraft/corpus.toml")).expect("a manifest");
    assert_eq!(manifest.matches("[[paper.clip]]").count(), 4);
    // What was corrected is not lost.
    let error = message(&froufrou(["corpus", "harvest", &recording, "-o", &corpus]));
    assert!(error.contains("there is a corpus already"), "{error}");
    std::fs::copy(&recording, at("kraft/table.wav")).expect("a copy");
    let friction =
        "[[paper.friction]]\nrecording = \"table.wav\"\nspeed_mps = 0.3\nruling_m = 0.1\nborder_m = 0.2\n";
    std::fs::write(at("kraft/corpus.toml"), manifest + friction).expect("a file");
    let built = told(&["corpus", "build", &corpus]);
    assert_eq!(
        (&built["computed"], &built["clips"], &built["spectra"]),
        (&true.into(), &4.into(), &1.into())
    );
    assert_eq!(told(&["corpus", "build", &corpus])["computed"], false);
    assert_eq!(told(&["info", &corpus])["kind"], "paper");
    let text = froufrou(["corpus", "info", &corpus]);
    assert!(String::from_utf8_lossy(&text.stdout).contains("2 clips, 0 spectra"));
    let score = "froufrou-score 1 channel\nduration 1\nchannels m\nsound s paper \"kraft\"\nstart 1 0 s 1 0\n\
                 set 1 0 friction-0 0.3\ngrain 1 0.5 2\nend 1 0.9\n";
    std::fs::write(at("a.score"), score).expect("a file");
    good(&froufrou(["mix", &at("a.score"), "-o", &at("a.wav")]));
    for (arguments, what) in [
        (
            vec!["corpus", "harvest", &recording, "-o", &corpus, "--like", "silk"],
            "there are synthetic/printer",
        ),
        (vec!["corpus", "harvest", &at("gone.wav"), "-o", &at("new")], "gone.wav"),
        (vec!["corpus", "harvest", &recording, "-o", &at("new"), "--channel", "4"], "there is no channel 4"),
    ] {
        let error = message(&froufrou(arguments));
        assert!(error.contains(what), "{error}");
    }
}
