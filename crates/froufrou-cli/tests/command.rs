//! The command as a person or a script meets it: files, messages, exit codes.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use tempfile::TempDir;

/// A folder with a scene in it that has moving sounds, picks, impacts and a turning listener.
struct Studio {
    folder: TempDir,
}

impl Studio {
    fn new() -> Self {
        let studio = Self { folder: tempfile::tempdir().unwrap() };
        studio.recording("hum.wav", 44_100, 9_000);
        studio.recording("a.wav", 48_000, 4_000);
        studio.recording("b.wav", 48_000, 5_000);
        let mut log = "t,a,b,x,y,z,J\n".to_string();
        for blow in 0..12 {
            writeln!(log, "{:.3},ball,floor,{},0,1,{}", 0.1 + 0.07 * f64::from(blow), blow, 1 + blow % 3)
                .unwrap();
        }
        studio.file("log.csv", &log);
        studio.file(
            "scene.toml",
            "seed = 5\nduration = 1.2\n\
             [listener]\nspacing = 0.2\n\
             track = [{ t = 0, position = [0, 1, 3], facing = [0, 0, -1] }, { t = 1, position = [1, 1, 2], facing = [1, 0, 0] }]\n\
             [material.stone]\nimpact = { recordings = ['[ab].wav'], speed_variation = 0.2, gain_db = -20 }\n\
             [[object]]\nname = 'ball'\nmaterial = 'stone'\n\
             [[object]]\nname = 'the car'\ntrack = [{ t = 0, position = [-30, 0, 4] }, { t = 1, position = [20, 0, 5] }]\n\
             sound = { recording = 'hum.wav', loop = true, gain_db = -6 }\n\
             [[contacts]]\nlog = 'log.csv'\nstep = 0.001\n\
             columns = { t = 't', a = 'a', b = 'b', position = ['x', 'y', 'z'], normal_impulse = 'J' }\n",
        );
        studio
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn file(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap_or_else(|fault| panic!("{name}: {fault}"))
    }

    fn recording(&self, name: &str, rate_hz: u32, frames: u32) {
        let (bits_per_sample, sample_format) = (32, hound::SampleFormat::Float);
        let spec = hound::WavSpec { channels: 1, sample_rate: rate_hz, bits_per_sample, sample_format };
        let mut writer = hound::WavWriter::create(self.path(name), spec).unwrap();
        for n in 0..frames {
            let wave = (0.05 * f64::from(n)).sin() + (0.31 * f64::from(n)).cos();
            writer.write_sample((0.4 * wave * (-f64::from(n) / 3000.0).exp()) as f32).unwrap();
        }
        writer.finalize().unwrap();
    }

    fn command(&self, line: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_froufrou"));
        command.current_dir(self.folder.path()).args(line.split_whitespace());
        command
    }

    fn run(&self, line: &str) -> Output {
        self.command(line).output().unwrap()
    }

    /// Runs what must succeed, without a word on standard error; gives standard output.
    fn succeed(&self, line: &str) -> String {
        let output = self.run(line);
        let complaint = String::from_utf8(output.stderr).unwrap();
        assert_eq!((output.status.code(), complaint.as_str()), (Some(0), ""), "{line}");
        String::from_utf8(output.stdout).unwrap()
    }

    /// Runs what must fail with an exit code; gives what it says.
    fn fail(&self, code: i32, line: &str) -> String {
        let output = self.run(line);
        let complaint = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{line}: {complaint}");
        assert!(!complaint.contains("panicked"), "{complaint}");
        complaint
    }

    /// The names of all files.
    fn names(&self) -> BTreeSet<PathBuf> {
        let entries = std::fs::read_dir(self.folder.path()).unwrap();
        entries.map(|entry| entry.unwrap().path()).collect()
    }
}

/// Frames of a WAV file, as the bits of their samples.
fn frames(path: &Path) -> Vec<Vec<u32>> {
    let mut reader =
        hound::WavReader::open(path).unwrap_or_else(|fault| panic!("{}: {fault}", path.display()));
    let channels = usize::from(reader.spec().channels);
    let samples: Vec<u32> = match reader.spec().sample_format {
        hound::SampleFormat::Float => reader.samples::<f32>().map(|s| s.unwrap().to_bits()).collect(),
        hound::SampleFormat::Int => reader.samples::<i32>().map(|s| s.unwrap() as u32).collect(),
    };
    samples.chunks_exact(channels).map(<[u32]>::to_vec).collect()
}

#[test]
fn a_range_is_that_part_of_the_whole_in_every_format() {
    let studio = Studio::new();
    for format in ["16", "24", "32f"] {
        studio.succeed(&format!("render scene.toml -o whole.wav --format {format} --stems whole"));
        let whole = frames(&studio.path("whole.wav"));
        assert_eq!(whole.len(), 57_600);
        let heard = whole.iter().flatten().collect::<BTreeSet<_>>();
        assert!(heard.len() > 1000, "{format}: {} different samples", heard.len());
        for (from, to, range) in
            [("0.25", "0.75", 12_000..36_000), ("0.5", "9", 24_000..57_600), ("0", "0.001", 0..48)]
        {
            let options = format!("--format {format} --from {from} --to {to}");
            studio.succeed(&format!("render scene.toml -o part.wav --stems part {options}"));
            assert!(frames(&studio.path("part.wav")) == whole[range.clone()], "{options}");
            for stem in std::fs::read_dir(studio.path("part")).unwrap() {
                let stem = stem.unwrap();
                let all = frames(&studio.path("whole").join(stem.file_name()));
                assert!(frames(&stem.path()) == all[range.clone()], "{options}: {stem:?}");
            }
        }
        assert!(studio.path("whole/ball.wav").exists() && studio.path("whole/the_car.wav").exists());
    }
}

#[test]
fn the_number_of_threads_is_not_heard() {
    let studio = Studio::new();
    let mut found = Vec::new();
    for threads in [1, 2, 5] {
        let report = studio.succeed(&format!(
            "render scene.toml -o out.wav --format 16 --stems stems --log log.jsonl --json --threads {threads}"
        ));
        let files = ["out.wav", "log.jsonl", "stems/ball.wav", "stems/the_car.wav"];
        found.push((report, files.map(|name| studio.bytes(name))));
    }
    assert!(found.iter().all(|other| *other == found[0]));
}

#[test]
fn stage_by_stage_is_the_same_as_at_once() {
    let studio = Studio::new();
    for format in ["16", "32f"] {
        studio.succeed(&format!("render scene.toml -o once.wav --format {format} --stems once"));
        studio.succeed("score scene.toml -o object.score");
        studio.succeed("score scene.toml --space channel -o channel.score");
        studio.succeed("score object.score --sort thread -o sorted.score");
        for score in ["object", "channel", "sorted"] {
            studio.succeed(&format!(
                "mix {score}.score -o staged.wav --seed 5 --format {format} --stems staged"
            ));
            assert!(studio.bytes("staged.wav") == studio.bytes("once.wav"), "{score}");
            for stem in ["ball.wav", "the_car.wav"] {
                assert!(
                    studio.bytes(&format!("staged/{stem}")) == studio.bytes(&format!("once/{stem}")),
                    "{score}"
                );
            }
        }
        studio.succeed("score sorted.score --sort time -o back.score");
        assert!(studio.bytes("back.score") == studio.bytes("object.score"));
    }
    // In another folder, recordings are named from there.
    std::fs::create_dir(studio.path("elsewhere")).unwrap();
    studio.succeed("score scene.toml -o elsewhere/far.score");
    studio.succeed("mix elsewhere/far.score -o far.wav --seed 5 --format 32f");
    assert!(studio.bytes("far.wav") == studio.bytes("once.wav"));
}

#[test]
fn a_seed_gives_the_same_bytes_and_another_does_not() {
    let studio = Studio::new();
    let render = |options: &str| {
        studio.succeed(&format!("render scene.toml -o out.wav --format 16 {options}"));
        studio.bytes("out.wav")
    };
    let first = render("");
    assert!(render("") == first && render("--seed 5") == first && render("--seed 6") != first);
}

#[test]
fn the_report_is_json_and_true() {
    let studio = Studio::new();
    let report =
        studio.succeed("render scene.toml -o out.wav --json --rate 44100 --stems stems --log log.jsonl");
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert_eq!((&report["rate_hz"], &report["channels"]), (&44_100.into(), &2.into()));
    assert_eq!(report["duration_s"], 1.2);
    assert_eq!(report["clipped_samples"], 0);
    assert_eq!(report["stems"].as_array().unwrap().len(), 2);
    assert_eq!(frames(&studio.path("out.wav")).len(), 52_920);
    let log = String::from_utf8(studio.bytes("log.jsonl")).unwrap();
    let lines: Vec<serde_json::Value> = log.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(report["sounds"], lines.len());
    assert!(lines.iter().all(|line| line["cause"].as_str().is_some_and(|cause| !cause.is_empty())));
    assert!(lines.windows(2).all(|pair| pair[0]["time_s"].as_f64() <= pair[1]["time_s"].as_f64()));
    let events = studio.succeed("events scene.toml");
    assert_eq!(events.lines().count(), 12);
    assert!(events.lines().all(|line| serde_json::from_str::<serde_json::Value>(line).is_ok()));
}

#[test]
fn a_bad_command_line_is_2_and_bad_input_is_1() {
    let studio = Studio::new();
    studio.file("broken.toml", "seed = 1\nrat = 44100\n");
    studio.file("odd.score", "froufrou-score 1 channel\nchannels main\nstart 1 0 drum 1 0\n");
    let before = studio.names();
    for line in [
        "",
        "sing",
        "render",
        "render scene.toml",
        "render scene.toml -o out.wav --rate 7999",
        "render scene.toml -o out.wav --rate 192001",
        "render scene.toml -o out.wav --format 20",
        "render scene.toml -o out.wav --from -1",
        "render scene.toml -o out.wav --to nan",
        "render scene.toml -o out.wav --from 1 --to 1",
        "render scene.toml -o out.wav --threads 0",
        "render scene.toml -o out.wav --layout seven",
        "render scene.toml -o out.wav --time-reference 25:00:00",
        "render scene.toml -o out.wav --origination yesterday",
        "completions tcsh",
        "man",
        "mix odd.score -o out.wav --gain 1e9",
        "score scene.toml --sort thread",
        "score odd.score --space channel",
    ] {
        let output = studio.run(line);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "`{line}`: {said}");
        assert!(!said.is_empty() && output.stdout.is_empty(), "`{line}`");
    }
    for (line, expected) in [
        ("render broken.toml -o out.wav", "broken.toml:2:1: unknown key `rat` (did you mean `rate`?)"),
        ("render missing.toml -o out.wav", "missing.toml"),
        ("mix missing.score -o out.wav", "missing.score"),
        ("mix odd.score -o out.wav", "odd.score:3:11: unknown sound `drum`"),
        ("mix scene.toml -o out.wav", "scene.toml:1"),
        ("render scene.toml -o missing/out.wav", "missing/out.wav"),
        ("render scene.toml -o .", "found a folder"),
        ("render scene.toml -o out.mp3", "sound is written as `.wav` or `.flac`, not as `.mp3`"),
        ("render scene.toml -o out", "ends in `.wav` or `.flac`"),
        ("render scene.toml -o out.flac --format 32f", "out.flac: FLAC has no float samples"),
        ("render scene.toml -o out.wav --description é", "can only have ASCII characters"),
        ("render scene.toml -o out.wav --reaper out.txt", "out.txt: expected the name of a Reaper project"),
    ] {
        let said = studio.fail(1, line);
        assert!(said.starts_with("froufrou: ") && said.contains(expected), "`{line}`: {said}");
        assert_eq!(said.lines().count(), 1, "{said}");
    }
    assert_eq!(studio.names(), before, "nothing was written");
    assert!(
        studio.succeed("--help").contains("render") && studio.succeed("--version").starts_with("froufrou ")
    );
}

#[test]
fn what_fails_midway_leaves_nothing_behind_and_all_as_it_was() {
    let studio = Studio::new();
    studio.succeed("score scene.toml --space channel -o good.score");
    let good = String::from_utf8(studio.bytes("good.score")).unwrap();
    // Faults at the end of a score that is read as it is mixed.
    studio.file("late.score", &format!("{good}key 999999 77 1 0 1 0\n"));
    studio.file("cut.score", &good[..good.trim_end().rfind(' ').unwrap()]);
    studio.file("loud.score", &good.replace("end 1 ", "key 1 1.1 1e300 0.1 1e300 0.1\nend 1 "));
    studio.file("not.wav", "this is no sound");
    let scene = String::from_utf8(studio.bytes("scene.toml")).unwrap();
    studio.file("deaf.toml", &scene.replace("hum.wav", "not.wav"));
    let log = String::from_utf8(studio.bytes("log.csv")).unwrap();
    studio.file("bad.csv", &format!("{log}1.15,ball,floor,1,0,here,1\n"));
    studio.file("lied.toml", &scene.replace("log.csv", "bad.csv"));
    for existing in [true, false] {
        for name in ["out.wav", "out.jsonl", "out.score"] {
            if existing {
                studio.file(name, "precious");
            } else {
                std::fs::remove_file(studio.path(name)).unwrap();
            }
        }
        let before = studio.names();
        for (line, expected) in [
            ("mix late.score -o out.wav --log out.jsonl", "late.score:"),
            ("mix late.score -o out.wav --normalize", "late.score:"),
            ("mix cut.score -o out.wav", "cut.score:"),
            ("mix loud.score -o out.wav", "beyond all numbers"),
            ("render deaf.toml -o out.wav", "not.wav"),
            ("render lied.toml -o out.wav --log out.jsonl", "bad.csv:14:"),
            ("events lied.toml -o out.jsonl", "bad.csv:14:"),
            ("score lied.toml -o out.score", "bad.csv:14:"),
            ("score late.score -o out.score", "late.score:"),
        ] {
            let said = studio.fail(1, line);
            assert!(said.contains(expected), "`{line}`: {said}");
            assert_eq!(studio.names(), before, "{line}");
            for name in ["out.wav", "out.jsonl", "out.score"] {
                assert!(!existing || studio.bytes(name) == b"precious", "{line}: {name}");
            }
        }
    }
}

#[test]
fn a_scene_reaches_outside_its_folder_only_with_leave() {
    let studio = Studio::new();
    std::fs::create_dir(studio.path("inner")).unwrap();
    studio.file("inner/scene.toml", "[[sound]]\nposition = [0, 0, 1]\nrecording = '../a.wav'\n");
    let said = studio.fail(1, "render inner/scene.toml -o out.wav");
    assert!(said.contains("scene.toml:3:") && said.contains("--allow-outside"), "{said}");
    assert!(!studio.path("out.wav").exists());
    studio.succeed("render inner/scene.toml -o out.wav --allow-outside");
    assert!(studio.path("out.wav").exists());
}

#[test]
fn whoever_reads_the_output_may_stop() {
    let studio = Studio::new();
    // More than a pipe holds.
    let scene = String::from_utf8(studio.bytes("scene.toml")).unwrap();
    studio.file("long.toml", &scene.replace("duration = 1.2", "duration = 1.2\nframe_rate = 10000"));
    assert!(studio.succeed("score long.toml --space channel").len() > 200_000);
    for line in [
        "score long.toml --space channel",
        "render scene.toml -o out.wav --json",
        "render scene.toml -o out.wav",
    ] {
        let mut child = studio.command(line).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!((output.status.code(), said.as_ref()), (Some(0), ""), "{line}");
    }
    assert!(studio.path("out.wav").exists());
}

#[test]
fn what_no_disk_can_hold_is_refused_at_once() {
    let studio = Studio::new();
    studio.file(
        "long.score",
        "froufrou-score 1 channel\nduration 1e8\nchannels main\nsound a \"a.wav\"\nstart 1 0 a 1 0\n",
    );
    studio.file("late.score", "froufrou-score 1 channel\nchannels main\nsound a \"a.wav\"\nstart 1 0 a 1 0\nend 1 0.1\nstart 2 9e8 a 1 0\nend 2 9.1e8\n");
    for score in ["long", "late"] {
        let begin = std::time::Instant::now();
        let said = studio.fail(1, &format!("mix {score}.score -o out.wav"));
        assert!(said.contains("the disk has room for"), "{said}");
        let said = studio.fail(1, &format!("mix {score}.score -o out.flac"));
        assert!(said.contains("longer than a FLAC file can be"), "{said}");
        let said = studio.fail(1, &format!("mix {score}.score -o out.wav --normalize"));
        assert!(said.contains("the disk has room for"), "{said}");
        assert!(begin.elapsed().as_secs_f64() < 20.0);
        // But any part of it may be had, however late.
        studio.succeed(&format!("mix {score}.score -o out.wav --from 90000000 --to 90000001"));
        assert_eq!(frames(&studio.path("out.wav")).len(), 48_000);
    }
}
