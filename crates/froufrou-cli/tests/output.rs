//! What a soundtrack is written to: WAV and FLAC, what they say of themselves, projects, help pages.

// Other tests use more of it.
mod common;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use common::{froufrou, good, sine, wav};
use froufrou::corpus::recording::Recording;
use serde_json::Value;
use tempfile::TempDir;

/// A folder with a scene of three sounds.
struct Studio {
    folder: TempDir,
}

impl Studio {
    fn new(listener: &str) -> Self {
        let studio = Self { folder: tempfile::tempdir().unwrap() };
        wav(&studio.path("hum.wav"), 48_000, 1, &sine(48_000, 440.0, 0.5, 48_000));
        let scene = format!(
            "duration = 4\nseed = 3\n{listener}\n\
             [[object]]\nname = \"the \\\"car\\\"\"\nposition = [0, 0, -2]\n\
             sound = {{ recording = \"hum.wav\", at = [0.5, 2.5], gain_db = -6 }}\n\
             [[object]]\nname = \"bee\"\nposition = [1, 0, -1]\n\
             sound = {{ recording = \"hum.wav\", at = [1.25], gain_db = -12 }}\n"
        );
        std::fs::write(studio.path("scene.toml"), scene).unwrap();
        studio
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn render(&self, to: &str, options: &[&str]) {
        let (scene, to) = (self.path("scene.toml"), self.path(to));
        let mut arguments = vec!["render".into(), scene.into_os_string(), "-o".into(), to.into_os_string()];
        arguments.extend(options.iter().map(Into::into));
        good(&froufrou(arguments));
    }

    fn info(&self, name: &str) -> Value {
        let output = froufrou([Path::new("info"), &self.path(name), Path::new("--json")]);
        good(&output);
        serde_json::from_slice(&output.stdout).unwrap()
    }

    fn recording(&self, name: &str) -> Recording {
        Recording::open(self.path(name)).unwrap()
    }
}

#[test]
fn flac_holds_the_samples_of_wav_in_fewer_bytes() {
    let studio = Studio::new("");
    let folder = |name: &str| studio.path(name).to_string_lossy().into_owned();
    for format in ["16", "24"] {
        studio.render("x.wav", &["--format", format, "--stems", &folder("plain")]);
        studio.render("x.flac", &["--format", format, "--stems", &folder("packed")]);
        assert!(studio.recording("x.wav") == studio.recording("x.flac"));
        for stem in ["bee", "the__car_"] {
            let [plain, packed] = [format!("plain/{stem}.wav"), format!("packed/{stem}.flac")];
            assert!(studio.recording(&plain) == studio.recording(&packed));
        }
        let bytes = |name: &str| std::fs::metadata(studio.path(name)).unwrap().len();
        assert!(bytes("x.flac") < bytes("x.wav") * 6 / 10, "{} {}", bytes("x.flac"), bytes("x.wav"));
        // Normalised, it is measured as it is written.
        studio.render("loud.flac", &["--format", format, "--normalize=-3"]);
        assert!((studio.info("loud.flac")["true_peak_dbtp"].as_f64().unwrap() + 3.0).abs() < 0.1);
    }
}

#[test]
fn files_say_what_they_are() {
    let studio = Studio::new("");
    let options = [
        "--from",
        "1",
        "--description",
        "a car, a bee",
        "--time-reference",
        "10:00:00:12@25",
        "--origination",
        "2026-11-22",
    ];
    let samples = (36_000 * 25 + 12) * 1920 + 48_000;
    studio.render("x.wav", &options);
    let told = studio.info("x.wav");
    let broadcast = &told["broadcast"];
    assert_eq!((&told["bits"], &told["channel_mask"]), (&24.into(), &3.into()));
    assert_eq!(
        (&broadcast["description"], &broadcast["originator"]),
        (&"a car, a bee".into(), &"froufrou".into())
    );
    assert_eq!(
        (&broadcast["origination_date"], &broadcast["origination_time"]),
        (&"2026-11-22".into(), &"00:00:00".into())
    );
    assert_eq!(broadcast["time_reference"], samples);
    for (told, measured) in [
        ("loudness_lufs", "loudness_lufs"),
        ("max_true_peak_dbtp", "true_peak_dbtp"),
        ("max_momentary_lufs", "max_momentary_lufs"),
    ] {
        let difference = broadcast[told].as_f64().unwrap() - studio.info("x.wav")[measured].as_f64().unwrap();
        assert!(difference.abs() < 0.02, "{told}: {difference}");
    }
    studio.render("x.flac", &options);
    let tags = studio.info("x.flac")["tags"].clone();
    let tag = |name: &str| {
        let tags = tags.as_array().unwrap();
        tags.iter().find(|tag| tag[0] == name).map(|tag| tag[1].as_str().unwrap().to_owned())
    };
    assert_eq!(tag("DESCRIPTION").as_deref(), Some("a car, a bee"));
    assert_eq!(tag("TIMEREFERENCE"), Some(samples.to_string()));
    assert_eq!(tag("LOUDNESSVALUE").map(|text| text.parse().unwrap()), broadcast["loudness_lufs"].as_f64());
    assert_eq!(tag("WAVEFORMATEXTENSIBLE_CHANNEL_MASK"), None);
    // Without a date there is none, and the same scene gives the same bytes.
    for name in ["a.wav", "a.flac"] {
        studio.render(name, &[]);
        let first = std::fs::read(studio.path(name)).unwrap();
        studio.render(name, &["--threads", "1"]);
        assert!(std::fs::read(studio.path(name)).unwrap() == first);
    }
    assert_eq!(studio.info("a.wav")["broadcast"]["origination_date"], "");
}

#[test]
fn microphones_named_as_loudspeakers_have_their_mask() {
    let microphones = |names: &[&str]| {
        let microphone = |name: &&str| format!("[[microphone]]\nname = \"{name}\"\n");
        names.iter().map(microphone).collect::<String>()
    };
    for (names, mask) in [
        (&["left", "right", "centre", "lfe", "back left", "back right"][..], 0x3f),
        (&["side-left", "side-right"], 0x600),
        (&["north", "south", "left"], 0),
        (&["camera"], 0x4),
    ] {
        let studio = Studio::new(&microphones(names));
        for file in ["x.wav", "x.flac"] {
            studio.render(file, &["--to", "0.1"]);
            assert_eq!(studio.info(file)["channel_mask"], mask, "{file} {names:?}");
        }
        // A score keeps the names.
        let score = studio.path("x.score");
        good(&froufrou([
            "score".as_ref(),
            studio.path("scene.toml").as_os_str(),
            "-o".as_ref(),
            score.as_os_str(),
        ]));
        good(&froufrou([
            "mix".as_ref(),
            score.as_os_str(),
            "-o".as_ref(),
            studio.path("m.wav").as_os_str(),
            "--to".as_ref(),
            "0.1".as_ref(),
        ]));
        assert_eq!(studio.info("m.wav")["channel_mask"], mask);
    }
}

#[test]
fn a_project_has_a_track_for_each_stem_and_a_marker_for_each_sound() {
    let studio = Studio::new("");
    let project = studio.path("cut 1.rpp");
    studio.render(
        "x.wav",
        &["--reaper", project.to_str().unwrap(), "--from", "1", "--time-reference", "01:00:00"],
    );
    let text = std::fs::read_to_string(&project).unwrap();
    let lines = |key: &str| -> Vec<&str> {
        text.lines().filter_map(|line| line.trim().strip_prefix(key)).map(str::trim).collect()
    };
    assert_eq!((lines("SAMPLERATE "), lines("PROJOFFS ")), (vec!["48000 1 0"], vec!["3601 0 0"]));
    let files: BTreeSet<&str> = lines("FILE ").into_iter().collect();
    assert_eq!(
        files,
        BTreeSet::from(["\"x.wav\"", "\"cut 1 stems/bee.wav\"", "\"cut 1 stems/the__car_.wav\""])
    );
    for file in files {
        assert!(studio.path(file.trim_matches('"')).exists());
    }
    assert_eq!(lines("MUTESOLO "), ["1 0 0", "0 0 0", "0 0 0"]);
    assert!(
        lines("NAME ").contains(&"'the \"car\"'") && lines("LENGTH ").iter().all(|length| *length == "3")
    );
    // The first sound began before; the others are heard after their way through the air.
    let times: Vec<f64> =
        lines("MARKER ").iter().map(|line| line.split(' ').nth(1).unwrap().parse().unwrap()).collect();
    let expected = [0.25 + 2f64.sqrt() / 343.0, 1.5 + 2.0 / 343.0];
    assert_eq!(times.len(), 2, "{text}");
    for (time, expected) in times.iter().zip(expected) {
        assert!((time - expected).abs() < 1e-3, "{time} {expected}");
    }
    assert!(lines("MARKER ")[0].contains("\"bee: "));
}

#[test]
fn shells_and_readers_are_helped_with_every_command() {
    let commands = [
        "demo",
        "render",
        "events",
        "score",
        "mix",
        "play",
        "grains",
        "corpus",
        "features",
        "warp",
        "concatenate",
        "info",
        "plot",
        "completions",
        "man",
    ];
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let output = froufrou(["completions", shell]);
        good(&output);
        let script = String::from_utf8(output.stdout).unwrap();
        assert!(
            commands.iter().all(|command| script.contains(command)) && script.contains("time-reference"),
            "{shell}"
        );
    }
    let folder = tempfile::tempdir().unwrap();
    let pages = folder.path().join("man1");
    good(&froufrou(["man".as_ref(), pages.as_os_str()]));
    let page = |name: &str| std::fs::read_to_string(pages.join(name)).unwrap();
    let main = page("froufrou.1");
    for command in commands {
        assert!(main.contains(&format!("froufrou\\-{command}")), "{command}");
        let page = page(&format!("froufrou-{command}.1"));
        assert!(page.contains(".TH") && page.contains("SYNOPSIS") && page.contains("Example"), "{command}");
    }
    assert_eq!(std::fs::read_dir(&pages).unwrap().count(), commands.len() + 1);
}
