//! Files of modes: what is in them, what is wrong with them, and what is left of them when damaged.

mod data;

use data::data;
use froufrou::synth::modal::{MOST_MODES, Shape, table};
use proptest::prelude::*;

fn read(text: &str) -> froufrou::Result<froufrou::synth::modal::Modes> {
    table::read(text.as_bytes())
}

fn fault(text: &str) -> String {
    read(text).unwrap_err().to_string()
}

const JSON: &str = r#"[
  {"frequency_hz": 440.0, "rt60_s": 1.5, "gain": 0.8, "points": [0.0, 0.7, 1]},
  {"frequency": 1213.5, "decay_per_s": 9.1, "gain_db": -20},
  {"frequency": 2000, "decay_per_s": 10}
]"#;

const CSV: &str = "frequency_hz, rt60_s, decay_per_s, gain, gain_db, point_1, point_0\n\
    # a comment\n\
    440, 1.5, , 0.8, , 0.7, 0.0\n\
    1213.5, , 9.1, , -20, ,\n\
    2000, , 10, , , ,\n";

#[test]
fn json_and_csv_say_the_same() {
    for (text, points) in [(JSON, vec![0.0, 0.7, 1.0]), (CSV, vec![0.0, 0.7])] {
        let modes = read(text).unwrap();
        let [a, b, c] = modes.modes() else { panic!("three modes") };
        // 60 dB in 1.5 s: a factor of a thousand.
        assert!(((-a.decay_per_s * 1.5).exp() - 1e-3).abs() < 1e-12);
        assert_eq!((a.frequency_hz, a.gain, &a.shape), (440.0, 0.8, &Shape::Points(points)));
        assert_eq!((b.frequency_hz, b.decay_per_s, &b.shape), (1213.5, 9.1, &Shape::Everywhere));
        assert!((b.gain - 0.1).abs() < 1e-12);
        assert_eq!((c.frequency_hz, c.decay_per_s, c.gain), (2000.0, 10.0, 1.0));
        assert!(
            (a.shape.at(0.5) - 0.35).abs() < 1e-12 && a.shape.at(-3.0) == 0.0 && a.shape.at(f64::NAN) == 0.0
        );
    }
}

#[test]
fn materials_of_tdw_are_read() {
    let modes =
        read(r#"{"synthMethod": "matchedMode", "cf": [937.4, 11001.5], "op": [-20.0, -6], "rt": [0.1, 2]}"#);
    let modes = modes.unwrap();
    let [a, b] = modes.modes() else { panic!("two modes") };
    assert!((a.gain - 0.1).abs() < 1e-12 && (b.gain - 0.501_187).abs() < 1e-6);
    assert!(((-a.decay_per_s * 0.1).exp() - 1e-3).abs() < 1e-12 && a.frequency_hz == 937.4);
    for (text, what) in [
        (r#"{"cf": [1, 2], "op": [1], "rt": [1, 2]}"#, "`cf` has 2 values, `op` 1 and `rt` 2"),
        (r#"{"cf": [1, 2], "op": [1, 1], "rt": [1, -2]}"#, "mode 2: `rt` is -2"),
        (r#"{"cf": [1, 0], "op": [1, 1], "rt": [1, 2]}"#, "mode 2: the frequency"),
        (r#"{"cf": [1], "op": [1e300], "rt": [1]}"#, "mode 1: a gain is inf"),
        (r#"{"cf": [1], "op": [1]}"#, "missing field `rt`"),
        (r#"{"cf": [], "op": [], "rt": []}"#, "no mode"),
    ] {
        assert!(fault(text).contains(what), "{text}: {}", fault(text));
    }
}

/// Every material there is, where the real ones are at hand.
#[test]
fn all_measured_materials_are_read() {
    let Some(folder) = data("modal/material_data") else { return };
    let mut count = 0;
    for file in folder.read_dir().unwrap() {
        let path = file.unwrap().path();
        let modes = table::open(&path).unwrap();
        assert!(modes.modes().len() >= 10, "{}", path.display());
        assert!(modes.modes().iter().all(|mode| (20.0..20_000.0).contains(&mode.frequency_hz)));
        count += 1;
    }
    assert!(count > 50, "{count}");
}

#[test]
fn faults_say_where_and_what() {
    let hz = r#""frequency_hz": 440, "#;
    for (text, what) in [
        ("", "the file is empty"),
        (" \n", "the file is empty"),
        ("[]", "there is no mode"),
        ("[{}]", "mode 1: neither `frequency_hz` nor `frequency`"),
        (&format!("[{{{hz} \"decay_per_s\": 1, \"rt60_s\": 1}}]"), "mode 1: both `decay_per_s` and `rt60_s`"),
        (&format!("[{{{hz} \"decay_per_s\": 0}}]"), "mode 1: the decay per second is 0"),
        (&format!("[{{{hz} \"rt60_s\": -1}}]"), "mode 1: `rt60_s` is -1"),
        (&format!("[{{{hz} \"rt60_s\": 1, \"points\": []}}]"), "mode 1: `points` is empty"),
        (&format!("[\n{{{hz} \"rt60_s\": 1e999}}]"), "2:"),
        (&format!("[\n\n{{{hz} \"decay\": 1}}]"), "3:"),
        ("[{\"frequency_hz\": \"x\"}]", "1:"),
        ("frequency_hz,decay\n1,2\n", "1: unknown column `decay`"),
        ("frequency_hz,frequency,rt60_s\n1,1,2\n", "1: the column `frequency` is there twice"),
        ("frequency_hz,rt60_s,point_1\n1,1,2\n", "1: the column `point_0` is missing"),
        ("frequency_hz,rt60_s\n1,1\n1,x\n", "3: expected a number, found \"x\""),
        ("frequency_hz,rt60_s\n1,1\n\n1\n", "4: the record has 1 fields, the header 2"),
        ("# bars\n\r\nfrequency_hz,rt60_s\n1,1\n# bad\n1,nan\n", "6: `rt60_s` is NaN"),
        ("frequency_hz,rt60_s\n1,1\ninf,1\n", "3: the frequency in hertz is inf"),
        ("frequency_hz,rt60_s,point_0,point_1\n1,1,1,\n", "2: `point_1` is empty"),
        ("frequency_hz,rt60_s\n", "there is no mode"),
    ] {
        assert!(fault(text).contains(what), "{text:?}: {}", fault(text));
    }
    let missing = table::open("no/such/file.json").unwrap_err().to_string();
    assert!(missing.starts_with("no/such/file.json:"), "{missing}");
}

#[test]
fn too_many_modes_are_refused() {
    let mode = r#"{"frequency":1,"rt60_s":1}"#;
    let list = |count: usize| format!("[{}]", vec![mode; count].join(","));
    assert_eq!(read(&list(MOST_MODES)).unwrap().modes().len(), MOST_MODES);
    assert!(fault(&list(MOST_MODES + 1)).contains("longer than 100000"));
    let csv = format!("frequency,rt60_s\n{}", "1,1\n".repeat(MOST_MODES + 1));
    assert!(fault(&csv).contains("100002: there are more than 100000 modes"), "{}", fault(&csv));
    // Deep nesting and endless text are neither a crash nor a hang.
    read(&"[".repeat(1_000_000)).unwrap_err();
    read(&"{\"cf\":".repeat(1_000_000)).unwrap_err();
    table::read(&vec![b'1'; (table::LONGEST_FILE_BYTES + 1) as usize]).unwrap_err();
}

proptest! {
    #[test]
    fn damaged_files_are_read_or_refused(
        text in prop::sample::select(vec![
            JSON, CSV, r#"{"cf": [937.4, 11001.5], "op": [-20.0, -6], "rt": [0.1, 2]}"#,
        ]),
        cut in 0.0..1.0f64,
        flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..4),
    ) {
        let mut bytes = text.as_bytes().to_vec();
        for (at, byte) in flips {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        bytes.truncate(((bytes.len() as f64) * (0.5 + cut)) as usize);
        if let Ok(modes) = table::read(&bytes) {
            prop_assert!(!modes.modes().is_empty());
        }
    }
}
