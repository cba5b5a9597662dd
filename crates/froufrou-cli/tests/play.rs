//! `froufrou play --feed`: what another program tells, into a file.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use tempfile::TempDir;

struct Studio {
    folder: TempDir,
}

const SCENE: &str = "seed = 5\nduration = 2\n[listener]\nposition = [0, 1, 2]\nlayout = 'stereo'\n\
    [material.stone]\nimpact = { recordings = ['[ab].wav'], speed_variation = 0.2, gain_db = -6 }\n\
    [[object]]\nname = 'ball'\nmaterial = 'stone'\n";
const CAR: &str =
    "[[object]]\nname = 'car'\nposition = [1, 0, 0]\nsound = { recording = 'a.wav', loop = true }\n";

impl Studio {
    fn new() -> Self {
        let studio = Self { folder: tempfile::tempdir().unwrap() };
        let spec = |sample_rate| hound::WavSpec {
            channels: 1,
            sample_rate,
            bits_per_sample: 32,
            sample_format: hound::SampleFormat::Float,
        };
        for (name, pitch) in [("a.wav", 0.05), ("b.wav", 0.31)] {
            let mut writer = hound::WavWriter::create(studio.path(name), spec(48_000)).unwrap();
            for n in 0..5_000 {
                let wave = (pitch * f64::from(n)).sin() * (-f64::from(n) / 3000.0).exp();
                writer.write_sample((0.4 * wave) as f32).unwrap();
            }
            writer.finalize().unwrap();
        }
        studio.file("scene.toml", SCENE);
        studio.file("car.toml", &format!("{SCENE}{CAR}"));
        studio
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn file(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    /// Runs the command, with a text on its standard input.
    fn run(&self, line: &str, input: &str) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_froufrou"));
        command.current_dir(self.folder.path()).args(line.split_whitespace());
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let mut stdin = child.stdin.take().unwrap();
        let input = input.to_owned();
        // A command that ends early does not read it all.
        let told = std::thread::spawn(move || stdin.write_all(input.as_bytes()).is_ok());
        let output = child.wait_with_output().unwrap();
        let _ = told.join();
        output
    }

    /// Runs what must succeed; gives what it says on standard error.
    fn said(&self, line: &str, input: &str) -> String {
        let output = self.run(line, input);
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{line}: {said}");
        said
    }

    fn sound(&self, name: &str) -> Vec<f32> {
        let mut reader = hound::WavReader::open(self.path(name)).unwrap();
        reader.samples().map(|sample| sample.unwrap()).collect()
    }
}

/// Blows of a ball, 60 steps a second, and the log that tells of the same.
fn blows() -> (String, String) {
    let (mut feed, mut log) = (String::new(), String::from("t,a,b,x,y,z,J\n"));
    for step in 1..=120 {
        let time = f64::from(step) / 60.0;
        if step % 13 == 0 {
            let impulse = 0.1 + 0.01 * f64::from(step % 7);
            writeln!(
                feed,
                "{{\"t\":{time},\"contact\":[\"ball\",\"floor\"],\"position\":[{time},0,0],\"impulse\":{impulse}}}"
            )
            .unwrap();
            writeln!(log, "{time},ball,floor,{time},0,0,{impulse}").unwrap();
        }
        writeln!(feed, "{{\"advance\":{time}}}").unwrap();
    }
    (feed, log)
}

const FILE: &str = "--format 32f --output";

#[test]
fn what_is_told_sounds_as_what_is_logged() {
    let studio = Studio::new();
    let (feed, log) = blows();
    studio.file("feed.jsonl", &feed);
    studio.file("log.csv", &log);
    let logged = "[[contacts]]\nlog = 'log.csv'\nstep = 0.016666666666666666\n\
                  columns = { t = 't', a = 'a', b = 'b', position = ['x', 'y', 'z'], normal_impulse = 'J' }\n";
    studio.file("logged.toml", &format!("{SCENE}{logged}"));
    assert_eq!(studio.said(&format!("play scene.toml --feed feed.jsonl {FILE} told.wav"), ""), "");
    studio.said("render logged.toml -o logged.wav --format 32f", "");
    let (told, logged) = (studio.sound("told.wav"), studio.sound("logged.wav"));
    let peak = logged.iter().fold(0.0f32, |peak, sample| sample.abs().max(peak));
    assert!(peak > 0.005 && told.len() >= logged.len(), "{peak}, {} of {}", told.len(), logged.len());
    let far = told.iter().zip(&logged).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(far < 1e-5 * peak, "{far} beside {peak}");
    // The last hit rings out, and then it ends: neither at once, nor as late as it may.
    let seconds = told.len() as f64 / 96_000.0;
    assert!((2.3..4.0).contains(&seconds), "{seconds} s");
    // From standard input it is the same, to the byte.
    assert_eq!(studio.said(&format!("play scene.toml --feed - {FILE} piped.wav"), &feed), "");
    assert_eq!(
        std::fs::read(studio.path("told.wav")).unwrap(),
        std::fs::read(studio.path("piped.wav")).unwrap()
    );
}

#[test]
fn a_bad_line_is_told_and_changes_nothing() {
    let studio = Studio::new();
    let (feed, _) = blows();
    studio.said(&format!("play scene.toml --feed - {FILE} good.wav"), &feed);
    let bad = [
        "{\"advance\":0.5,\"at\":1}",
        "nonsense",
        "{\"t\":1,\"object\":\"cart\",\"position\":[0,0,0]}",
        "{\"advance\":0.001}",
        "{\"t\":2,\"contact\":[\"ball\",\"floor\"],\"position\":[1e300,0,0],\"impulse\":1}",
    ];
    // Each behind the 40th line and later.
    let mut lines: Vec<&str> = feed.lines().collect();
    bad.iter().enumerate().for_each(|(n, bad)| lines.insert(40 + 5 * n, bad));
    let said = studio.said(&format!("play scene.toml --feed - {FILE} bad.wav"), &lines.join("\n"));
    for expected in [
        "<stdin>:41:19: not a line of what happens: unknown field `at`, expected one of `contact`",
        "<stdin>:46:2: not a line of what happens: expected",
        "<stdin>:51: no object `cart` was said to be moved",
        "<stdin>:56: it is earlier than what was told before",
        "<stdin>:61: `position_m` is no finite number, or beyond all bounds",
        "5 lines were left out: 1 with numbers that are none, 1 earlier than what was told before, 1 of what is not \
         there, 2 that could not be read",
    ] {
        assert!(said.contains(expected), "{expected}:\n{said}");
    }
    assert_eq!(
        std::fs::read(studio.path("good.wav")).unwrap(),
        std::fs::read(studio.path("bad.wav")).unwrap()
    );
    // Many are counted.
    let many = format!("{}{feed}", "nonsense\n".repeat(1000));
    let said = studio.said(&format!("play scene.toml --feed - {FILE} many.wav"), &many);
    assert!(said.contains("1000 lines were left out: 1000 that could not be read"), "{said}");
    assert!(said.lines().count() < 15, "{said}");
    assert_eq!(
        std::fs::read(studio.path("good.wav")).unwrap(),
        std::fs::read(studio.path("many.wav")).unwrap()
    );
}

#[test]
fn what_moves_is_found_before_time_goes_on() {
    let studio = Studio::new();
    let drive = |from: u32| {
        let mut feed = String::new();
        for step in 0..=60 {
            let time = f64::from(step) / 60.0;
            if step >= from {
                writeln!(feed, "{{\"t\":{time},\"object\":\"car\",\"position\":[{},0,0]}}", 1.0 - 8.0 * time)
                    .unwrap();
            }
            writeln!(feed, "{{\"advance\":{time}}}").unwrap();
        }
        feed
    };
    let play = |feed: &str, more: &str, name: &str| {
        studio.said(&format!("play car.toml --feed - --rest 0.1 {more} {FILE} {name}"), feed)
    };
    assert_eq!(play(&drive(0), "", "told.wav"), "");
    assert_eq!(play(&drive(0), "--moves car", "named.wav"), "");
    assert_eq!(studio.sound("told.wav"), studio.sound("named.wav"));
    // What it does not say at the beginning has to be named.
    assert!(play(&drive(1), "", "late.wav").contains("no object `car` was said to be moved"));
    assert_eq!(play(&drive(1), "--moves car", "late.wav"), "");
    // It goes by: to the right at first, then to the left; and what does not end is faded out.
    let energy = |sound: &[f32], channel: usize| -> f32 {
        sound.iter().skip(channel).step_by(2).map(|sample| sample * sample).sum()
    };
    let sound = studio.sound("told.wav");
    let (first, last) = (&sound[..20_000], &sound[sound.len() - 30_000..]);
    assert!(energy(first, 1) > 1.1 * energy(first, 0), "{} {}", energy(first, 0), energy(first, 1));
    assert!(energy(last, 0) > 1.1 * energy(last, 1));
    assert!(sound[sound.len() - 2..].iter().all(|sample| *sample == 0.0));
}

#[test]
fn what_appears_sounds_where_it_is_until_it_vanishes() {
    let studio = Studio::new();
    let mut feed = String::new();
    for step in 0..=90 {
        let time = f64::from(step) / 60.0;
        match step {
            30 => writeln!(feed, "{{\"t\":{time},\"vanish\":\"car\"}}").unwrap(),
            60 => {
                let place = "\"position\":[-1,0,0]";
                writeln!(feed, "{{\"t\":{time},\"appear\":\"car 2\",\"as\":\"car\",{place}}}").unwrap();
            }
            _ => {}
        }
        writeln!(feed, "{{\"advance\":{time}}}").unwrap();
    }
    let play = |feed: &str| {
        let said = studio.said(&format!("play car.toml --feed - --rest 0.1 {FILE} told.wav"), feed);
        (said, studio.sound("told.wav"))
    };
    let (said, sound) = play(&feed);
    assert_eq!(said, "");
    let energy = |from_s: f64, to_s: f64, channel: usize| -> f32 {
        let frames = (from_s * 48_000.0) as usize..(to_s * 48_000.0) as usize;
        frames.map(|frame| sound[2 * frame + channel].powi(2)).sum()
    };
    let [right, left] =
        [[0.05, 0.45], [1.1, 1.5]].map(|[from_s, to_s]| [0, 1].map(|channel| energy(from_s, to_s, channel)));
    assert!(right[1] > 1.1 * right[0] && right[0] > 0.0, "the car is to the right: {right:?}");
    assert!(left[0] > 1.1 * left[1] && left[1] > 0.0, "the other is to the left: {left:?}");
    // Its fade and its way are over in a twentieth of a second.
    assert!(energy(0.56, 0.99, 0) + energy(0.56, 0.99, 1) < 1e-6 * right[1], "in between is nothing");
    let strange = "{\"t\":0,\"appear\":\"b\",\"as\":\"boat\",\"position\":[0,0,0]}\n{\"t\":0,\"vanish\":\"b\"}\n\
        {\"t\":0,\"material\":\"ice\",\"of\":\"car\"}\n{\"t\":0,\"mesh\":\"b\",\"positions\":[]}\n";
    let (said, unchanged) = play(&format!("{strange}{feed}"));
    assert!(said.contains("4 of what is not there"), "{said}");
    assert!(unchanged == sound, "what is left out changes nothing");
}

#[test]
fn a_leap_in_time_is_written_up_to_an_hour() {
    let studio = Studio::new();
    let (feed, _) = blows();
    assert_eq!(studio.said(&format!("play scene.toml --feed - {FILE} good.wav"), &feed), "");
    // The date of a clock, milliseconds, and what happens at such a time.
    let hit = |time: &str| {
        format!("{{\"t\":{time},\"contact\":[\"ball\",\"floor\"],\"position\":[0,0,0],\"impulse\":1}}\n")
    };
    let strange =
        format!("{{\"advance\":1732370000}}\n{}{{\"advance\":16667}}\n{}", hit("1732370000.5"), hit("5e8"));
    let said = studio.said(&format!("play scene.toml --feed - {FILE} strange.wav"), &(strange + &feed));
    for expected in [
        "<stdin>:1: 1732370000 s is too late, 1000000000 s is the latest (times are seconds since",
        "<stdin>:2: 1732370000.5 s is too late",
        "<stdin>:3: 16667 s is more than 3600 s ahead of the last `advance`, at 0 s",
        "<stdin>:4: 500000000 s is more than 3600 s ahead",
        "4 lines were left out: 4 at times that cannot be\n",
    ] {
        assert!(said.contains(expected), "{expected}:\n{said}");
    }
    assert!(studio.sound("strange.wav") == studio.sound("good.wav"), "what is left out changes nothing");
    // Nor does what happens before time has gone on to it.
    let said = studio.said(&format!("play scene.toml --feed - {FILE} early.wav"), &(hit("100") + &feed));
    assert!(
        said.contains("<stdin>:1: it is more than a second ahead of the time that was told last"),
        "{said}"
    );
    assert!(studio.sound("early.wav") == studio.sound("good.wav"));
    // What can be is written in full.
    let leap = format!(
        "{}{{\"advance\":0.2}}\n{{\"advance\":20}}\n{}{{\"advance\":20.2}}\n",
        hit("0.1"),
        hit("20.1")
    );
    assert_eq!(studio.said(&format!("play scene.toml --feed - {FILE} leap.wav"), &leap), "");
    let sound = studio.sound("leap.wav");
    let peak = |from_s: f64, to_s: f64| {
        let samples = (from_s * 96_000.0) as usize..(to_s * 96_000.0) as usize;
        sound[samples].iter().fold(0.0f32, |peak, sample| sample.abs().max(peak))
    };
    assert!(peak(0.1, 0.3) > 0.005 && peak(20.1, 20.3) > 0.005 && peak(1.0, 20.0) < 1e-4);
}

#[test]
fn what_cannot_be_moved_is_named_with_its_line() {
    let studio = Studio::new();
    let flies = "[[object]]\nname = 'flies'\nposition = [0, 0, 0]\nswarm = { count = 3 }\n";
    studio.file("scene.toml", &format!("{SCENE}{CAR}{flies}"));
    let fails = |options: &str, feed: &str, expected: &str| {
        let output = studio.run(&format!("play scene.toml --feed - {options} -o out.wav"), feed);
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(!output.status.success() && said.contains(expected), "{expected}: {said}");
    };
    let flies = "{\"t\":0,\"listener\":true,\"position\":[0,1,2]}\n{\"t\":0,\"object\":\"flies\",\"position\":[0,0,0]}\n";
    fails("", flies, "<stdin>:2: object `flies`: an object of 3 bodies is to be moved (move one body)");
    fails("--moves flies", "", "froufrou: object `flies`: an object of 3 bodies");
    let mesh =
        "{\"t\":0,\"object\":\"car\",\"position\":[0,0,0]}\n{\"t\":0,\"mesh\":\"car\",\"positions\":[]}\n";
    fails("", mesh, "<stdin>:2: object `car`: ");
    // What is told too late to be found says where it is looked for.
    let late = "\n{\"advance\":0}\n{\"t\":0.1,\"object\":\"car\",\"position\":[0,0,0]}\n\
        {\"t\":0.1,\"mesh\":\"car\",\"positions\":[]}\n{\"t\":0.1,\"listener\":true,\"position\":[0,0,0]}\n";
    let said = studio.said("play scene.toml --rest 0 --feed - -o out.wav", late);
    for expected in [
        "<stdin>:3: no object `car` was said to be moved when it began, and none appeared (what moves is told within the \
         first 4096 lines and before the first `advance`, or named by `--moves`)",
        "<stdin>:4: no object `car` was said to be moved when it began, and none appeared (what moves is told within the \
         first 4096 lines and before the first `advance`)",
        "<stdin>:5: the listener was not said to be moved when it began (what moves is told within the first 4096 lines \
         and before the first `advance`, or said by `--moves-listener`)",
    ] {
        assert!(said.contains(expected), "{expected}:\n{said}");
    }
    let car = "{\"t\":0,\"object\":\"car\",\"position\":[0,0,0]}\n";
    let hit = "{\"t\":0,\"contact\":[\"a\",\"b\"],\"position\":[0,0,0],\"impulse\":1}\n";
    for (before, is_found) in [(4095, true), (4096, false)] {
        let feed = format!("{}{car}{{\"advance\":0.1}}\n", hit.repeat(before));
        let said = studio.said("play scene.toml --rest 0 --feed - -o out.wav", &feed);
        assert_eq!(said.contains("within the first 4096 lines"), !is_found, "{before}: {said}");
    }
}

#[test]
fn a_mesh_that_is_none_is_told_of_when_it_comes() {
    let studio = Studio::new();
    studio.file("scene.toml", &format!("{SCENE}[[object]]\nname = 'sheet'\n"));
    let mut feed = String::from("{\"t\":0,\"mesh\":\"sheet\",\"positions\":[]}\n");
    for step in 1..=60 {
        let (time_s, vertex) = (f64::from(step) / 60.0, if step < 30 { 70 } else { 80 });
        let mesh = format!("\"positions\":[[0,0,0],[1,0,0],[0,0,1]],\"faces\":[[0,1,{vertex}]]");
        writeln!(feed, "{{\"t\":{time_s},\"mesh\":\"sheet\",{mesh}}}\n{{\"advance\":{time_s}}}").unwrap();
    }
    let said = studio.said("play scene.toml --feed - --rest 0 -o out.wav", &feed);
    assert!(said.contains("70") && said.contains("80") && said.contains("60 "), "{said}");
    assert!(said.lines().count() < 15, "{said}");
}

#[test]
fn an_option_that_would_do_nothing_is_refused() {
    let studio = Studio::new();
    let says = |line: &str, expected: &[&str]| {
        let output = studio.run(line, "");
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{line}: {said}");
        expected.iter().for_each(|expected| assert!(said.contains(expected), "{line}: {said}"));
    };
    for option in ["--step 0.01", "--rest 1", "--moves ball", "--moves-listener", "--output out.wav"] {
        says(&format!("play scene.toml {option}"), &["not provided", "--feed"]);
    }
    says("play scene.toml --feed - --format 16", &["not provided", "--output"]);
    says("play scene.toml --feed - --ahead 0.1 --output out.wav", &["--ahead"]);
    let help = String::from_utf8(studio.run("play --help", "").stdout).unwrap();
    let of_devices = ["space pauses", "--from", "--loop", "--block", "--ahead", "through the sound device"];
    for text in of_devices {
        assert_eq!(help.contains(text), cfg!(feature = "device"), "{text}:\n{help}");
    }
}

#[test]
fn what_cannot_be_is_said() {
    let studio = Studio::new();
    let fails = |line: &str, expected: &str| {
        let output = studio.run(line, "");
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(!output.status.success() && said.contains(expected), "{line}: {said}");
    };
    fails("play scene.toml --feed away.jsonl -o out.wav", "away.jsonl: cannot open");
    fails("play scene.toml --feed - -o out.mp3", "not as `.mp3`");
    fails("play away.toml --feed - -o out.wav", "away.toml");
    fails("play scene.toml --feed - --moves cart -o out.wav", "no object `cart`");
    fails("play scene.toml --moves ball", "--feed");
    #[cfg(not(feature = "device"))]
    fails("play scene.toml", "build it with `--features device`");
    // Nothing at all is told: silence, and not for long.
    assert_eq!(studio.said("play scene.toml --feed - --output out.wav", ""), "");
}
