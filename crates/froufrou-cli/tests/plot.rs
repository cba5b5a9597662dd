//! Runs `froufrou plot` and looks at the pictures.

mod common;

use std::fs::{self, File};
use std::io::BufReader;
use std::path::Path;

use common::{froufrou, good, impact, message, sine, wav};

/// A decoded picture.
struct Picture {
    width: usize,
    height: usize,
    pixels: Vec<[u8; 3]>,
}

impl Picture {
    fn open(path: &Path) -> Self {
        let decoder = png::Decoder::new(BufReader::new(File::open(path).expect("a picture")));
        let mut reader = decoder.read_info().expect("a PNG file");
        let mut bytes = vec![0; reader.output_buffer_size().expect("a size")];
        let info = reader.next_frame(&mut bytes).expect("whole");
        assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Rgb, png::BitDepth::Eight));
        let pixels = bytes.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
        Self { width: info.width as usize, height: info.height as usize, pixels }
    }

    fn pixel(&self, x: usize, y: usize) -> [u8; 3] {
        self.pixels[y * self.width + x]
    }

    /// The first and last row of the spectrogram of silence: the longest run of black in a column.
    fn black_rows(&self, x: usize) -> (usize, usize) {
        let black = |y: usize| self.pixel(x, y).iter().all(|c| *c < 8);
        let rows: Vec<usize> = (0..self.height).filter(|&y| black(y)).collect();
        let (first, last) = (rows[0], rows[rows.len() - 1]);
        assert_eq!(last - first + 1, rows.len(), "one block");
        (first, last)
    }

    /// The middle of the brightest rows of a column between two others.
    fn brightest_row(&self, x: usize, from: usize, to: usize) -> f64 {
        let light = |y: usize| self.pixel(x, y).iter().map(|c| u32::from(*c)).sum::<u32>();
        let most = (from..=to).map(light).max().expect("rows");
        let rows: Vec<usize> = (from..=to).filter(|&y| light(y) == most).collect();
        rows.iter().sum::<usize>() as f64 / rows.len() as f64
    }

    /// How many different colours there are.
    fn colours(&self) -> usize {
        self.pixels.iter().collect::<std::collections::HashSet<_>>().len()
    }
}

#[test]
fn a_tone_is_a_bright_line_at_its_frequency() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let draw = |name: &str, samples: &[f32]| {
        wav(&at("tone.wav"), 48_000, 1, samples);
        let arguments = ["plot", "tone.wav", "-o", name, "--width", "800", "--height", "600"];
        let arguments = arguments.map(|a| if a.contains('.') { at(a) } else { a.into() });
        good(&froufrou(arguments));
        let picture = Picture::open(&at(name));
        assert_eq!((picture.width, picture.height), (800, 600));
        picture
    };
    // Silence shows where the spectrogram is: 20 Hz at its foot, 24 kHz at its head.
    let (head, foot) = draw("silence.png", &[0.0; 48_000]).black_rows(300);
    assert!(foot - head > 200);
    for tone_hz in [125.0, 1000.0, 8000.0] {
        let picture = draw("tone.png", &sine(48_000, tone_hz, 0.5, 48_000));
        let row = picture.brightest_row(300, head, foot);
        let place = (tone_hz / 20.0).ln() / (24_000.0f64 / 20.0).ln();
        let expected = foot as f64 + 0.5 - place * (foot - head + 1) as f64;
        // In the bass a bin of the transform is a few rows high.
        let tolerance = if tone_hz < 200.0 { 4.0 } else { 1.5 };
        assert!((row + 0.5 - expected).abs() <= tolerance, "{tone_hz} Hz: row {row}, expected {expected}");
    }
}

#[test]
fn sounds_of_every_kind_are_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("sound.wav");
    for (rate_hz, channels, frames) in
        [(8000, 1, 1), (8000, 2, 7), (192_000, 1, 50_000), (48_000, 8, 20_000), (44_100, 3, 44_100 * 300)]
    {
        wav(&file, rate_hz, channels, &sine(rate_hz, 440.0, 0.3, channels * frames));
        good(&froufrou([Path::new("plot"), &file]));
        let picture = Picture::open(&file.with_extension("png"));
        assert_eq!((picture.width, picture.height), (1600, 1000));
        assert!(picture.colours() > 20, "{rate_hz} {channels} {frames}");
    }
}

#[test]
fn a_part_of_a_sound_and_its_events_are_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    // A tone in the second half only.
    let mut samples = vec![0.0; 48_000];
    samples.extend(sine(48_000, 1000.0, 0.5, 48_000));
    wav(Path::new(&at("a.wav")), 48_000, 1, &samples);
    let draw = |extra: &[&str]| {
        let (file, picture) = (at("a.wav"), at("a.png"));
        let mut arguments = vec!["plot", &file, "-o", &picture];
        arguments.extend(extra);
        let output = froufrou(arguments);
        good(&output);
        Picture::open(Path::new(&picture))
    };
    let bright =
        |picture: &Picture| picture.pixels.iter().filter(|[r, g, b]| *r > 180 && *g > 60 && *b < 90).count();
    let (first, second) = (draw(&["--to", "0.9"]), draw(&["--from", "1.1"]));
    assert!(bright(&second) > bright(&first) + 500, "{} {}", bright(&first), bright(&second));

    fs::write(at("e.jsonl"), impact(0.25, "ball", "floor", 0.1) + impact(9.0, "x", "y", 0.1).as_str())
        .unwrap();
    let (plain, marked) = (draw(&[]), draw(&["--events", &at("e.jsonl")]));
    let red = |picture: &Picture| picture.pixels.iter().filter(|p| **p == [0xc8, 0x40, 0x1e]).count();
    assert_eq!(red(&plain), 0);
    assert!(red(&marked) > 5);
}

#[test]
fn events_are_drawn_by_their_impulse() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("events.jsonl");
    let text = impact(1.0, "ball", "floor", 0.01) + impact(2.0, "ball", "floor", 1.0).as_str();
    fs::write(&file, text).unwrap();
    good(&froufrou([Path::new("plot"), &file]));
    let picture = Picture::open(&file.with_extension("png"));
    // The dots, apart from that of the legend, which lies to the right: the later one is higher.
    let blue = |[r, g, b]: [u8; 3]| b > g && g > r && b > 150 && r < 70;
    let dots = |from: usize, to: usize| {
        let rows = (0..picture.height).filter(|&y| (from..to).any(|x| blue(picture.pixel(x, y))));
        rows.collect::<Vec<_>>()
    };
    let (early, late) = (dots(130, 850), dots(850, 1290));
    assert!(!early.is_empty() && !late.is_empty());
    assert!(late[late.len() - 1] + 100 < early[0], "{late:?} {early:?}");

    fs::write(&file, "").unwrap();
    good(&froufrou([Path::new("plot"), &file]));
}

#[test]
fn extreme_events_are_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("events.jsonl");
    for times in [[-1e308, 1e308], [0.0, 1e-300], [1e300, 1e300], [-5.0, -4.0], [0.0, 1e9]] {
        for impulses in [[1e-308, 1e308], [0.0, -1.0], [5e-324, 5e-324]] {
            let text = impact(times[0], "", "\u{1F98A}", impulses[0])
                + impact(times[1], "a", "b", impulses[1]).as_str();
            fs::write(&file, text).unwrap();
            let output = froufrou([Path::new("plot"), &file]);
            assert!(output.status.success(), "{times:?} {impulses:?} {}", message(&output));
            Picture::open(&file.with_extension("png"));
        }
    }
}

const OBJECT_SCORE: &str = "froufrou-score 1 object\nduration 4\nmicrophone left cardioid at -1 0 0\n\
    microphone moving omni\nsound hum \"hum.wav\" loop\nsound hit \"hit.wav\"\nhear moving 0 at 0 1 2\n\
    hear moving 3 at 2 1 2\nstart 1 0 hum at -5 0 -1 object bee\nkey 1 2 at 0 0 -3 gain 0.2\n\
    jump 1 3 at 4 0 0\nend 1 4\nstart 2 1 hit at 1 0 1 object cup\n";

#[test]
fn scores_in_both_spaces_are_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let channel = "froufrou-score 1 channel\nchannels main\nsound hit \"hit.wav\"\nstart 7 0.5 hit 1 0\n";
    let empty = "froufrou-score 1 object\nmicrophone main omni\n";
    wav(&folder.path().join("hit.wav"), 8000, 1, &[0.5; 4000]);
    for (name, text) in [("object", OBJECT_SCORE), ("channel", channel), ("empty", empty)] {
        let file = folder.path().join(name);
        fs::write(&file, text).unwrap();
        let sizes: [&[&str]; 3] = [&[], &["--width", "240", "--height", "240"], &["--to", "0.6"]];
        for extra in sizes {
            let mut arguments = vec!["plot", file.to_str().unwrap()];
            arguments.extend(extra);
            good(&froufrou(arguments));
            let picture = Picture::open(&file.with_extension("png"));
            let coloured = picture.pixels.iter().any(|[r, _, b]| r.abs_diff(*b) > 100);
            assert_eq!(coloured, name != "empty", "{name} {extra:?}");
        }
    }
}

#[test]
fn bad_input_is_told_and_leaves_no_picture() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    fs::write(at("letter.txt"), "Dear all, hello\n").unwrap();
    fs::write(at("scene.toml"), "rate = 48000\n").unwrap();
    fs::write(at("bad.jsonl"), "{\"kind\":\"crash\"}\n").unwrap();
    fs::write(at("cut.wav"), &common_wav(&at("whole.wav"))[..60]).unwrap();
    wav(Path::new(&at("good.wav")), 8000, 1, &[0.5; 8000]);
    let cases: [(&[&str], &str); 7] = [
        (&["letter.txt"], "letter.txt: the file is of no known kind"),
        (&["missing.wav"], "missing.wav: cannot open the file"),
        (&["scene.toml"], "a scene cannot be drawn"),
        (&["bad.jsonl"], "bad.jsonl:1:"),
        (&["cut.wav"], "cut.wav:byte 60: the file is cut short"),
        (&["good.wav", "--from", "5"], "good.wav: nothing to show: it lasts from 0 s to 1 s"),
        (&["good.wav", "--from", "0.5", "--to", "0.5"], "--from 0.5 is not before --to 0.5"),
    ];
    for (arguments, expected) in cases {
        let mut all = vec!["plot".to_owned(), at(arguments[0])];
        all.extend(arguments[1..].iter().map(|a| (*a).to_owned()));
        let output = froufrou(&all);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}");
        assert!(message(&output).contains(expected), "{}", message(&output));
    }
    assert!(fs::read_dir(folder.path()).unwrap().all(|e| e.unwrap().path().extension().unwrap() != "png"));
    let output = froufrou(["plot", &at("good.wav"), "-o", &at("good.wav")]);
    assert_eq!(output.status.code(), Some(1));
    assert!(message(&output).contains("would replace the file"), "{}", message(&output));
    // A folder that is not there.
    let output = froufrou(["plot", &at("good.wav"), "-o", &at("nowhere/a.png")]);
    assert_eq!(output.status.code(), Some(1));
    assert!(message(&output).contains("a.png: cannot create"), "{}", message(&output));
}

fn common_wav(path: &str) -> Vec<u8> {
    wav(Path::new(path), 8000, 1, &[0.5; 100]);
    fs::read(path).unwrap()
}

#[test]
fn a_bad_command_line_is_another_error() {
    for arguments in [
        &["plot"][..],
        &["plot", "a.wav", "--colour", "red"],
        &["plot", "a.wav", "--width", "1"],
        &["plot", "a.wav", "--from", "soon"],
        &["plot", "a.wav", "--from", "nan"],
    ] {
        assert_eq!(froufrou(arguments).status.code(), Some(2), "{arguments:?}");
    }
}
