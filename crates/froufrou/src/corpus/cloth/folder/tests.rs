use super::*;
use std::path::PathBuf;

use crate::corpus::dictionary::sinusoids::CACHE;
use crate::random::Random;

const RATE_HZ: u32 = 16_000;

/// A WAV file of 16 bits.
fn wav(path: &Path, channels: &[Vec<f32>]) {
    let spec = hound::WavSpec {
        channels: channels.len() as u16,
        sample_rate: RATE_HZ,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut writer = hound::WavWriter::create(path, spec).unwrap();
    for n in 0..channels[0].len() {
        for channel in channels {
            writer.write_sample((channel[n] * 32767.0).round() as i16).unwrap();
        }
    }
    writer.finalize().unwrap();
}

fn noise(seconds: f64, level: f64, thread: u64) -> Vec<f32> {
    let random = Random::new(3, thread);
    (0..(f64::from(RATE_HZ) * seconds) as u64).map(|n| (level * random.normal(n)) as f32).collect()
}

/// A folder with two steady takes, one with an encoder, one with a track, and pops.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    wav(&at("slow.wav"), &[noise(3.0, 0.01, 1)]);
    wav(&at("fast.wav"), &[noise(3.0, 0.04, 2)]);
    let pulses =
        (0..48_000u32).map(|n| if (f64::from(n) / 160.0).fract() < 0.5 { 0.0 } else { 0.5 }).collect();
    wav(&at("drum.wav"), &[noise(3.0, 0.02, 3), pulses]);
    wav(&at("ramp.wav"), &[noise(3.0, 0.03, 4)]);
    std::fs::write(at("ramp.csv"), "time_s,speed_mps\n0,0.3\n3,0.6\n").unwrap();
    let mut crumple = noise(2.0, 0.001, 5);
    for (begin, level) in [(8000, 0.5), (16_000, 0.25), (24_000, 0.7)] {
        for n in 0..400u16 {
            let t = f64::from(n) / f64::from(RATE_HZ);
            crumple[begin + usize::from(n)] += (level * (-300.0 * t).exp() * (5000.0 * t).sin()) as f32;
        }
    }
    wav(&at("crumple.wav"), &[crumple]);
    let text = r#"
version = 1
name = "test cloth"
[friction]
bins = 2
[[friction.take]]
recording = "slow.wav"
speed_mps = 0.1
[[friction.take]]
recording = "fast.wav"
speed_mps = 0.8
[[friction.take]]
recording = "drum.wav"
encoder = { channel = 1, pulses_per_m = 500 }
[[friction.take]]
recording = "ramp.wav"
speeds = "ramp.csv"
[pops]
recordings = ["crumple.wav"]
"#;
    std::fs::write(at(FILE_NAME), text).unwrap();
    folder
}

#[test]
fn a_folder_becomes_a_corpus_and_opens_as_the_same_with_and_without_its_cache() {
    let folder = folder();
    let corpus = tempfile::tempdir().unwrap();
    let (built, told) = build(folder.path(), corpus.path()).unwrap();
    assert_eq!(told.copied.len(), 6);
    assert_eq!(told.computed, ["friction", "pops"]);
    assert_eq!(told.takes.len(), 4);
    assert!(told.takes.iter().all(|(_, counts)| counts.clips > 90), "{told:?}");
    assert_eq!(built.name(), "test cloth");
    let speeds: Vec<f64> =
        built.friction().unwrap().spectra.measured().iter().map(|s| (s.speed_mps * 100.0).round()).collect();
    // The drum turns at 100 pulses a second, which are 0.2 m/s; the ramp is in the upper bin.
    assert_eq!(speeds.len(), 4);
    assert_eq!((speeds[0], speeds[1], speeds[3]), (10.0, 20.0, 80.0));
    assert_eq!(built.pops().len(), 3);
    let at: Vec<f64> = built.pops().iter().map(|pop| pop.begin_s + pop.lead_s).collect();
    for (found, expected) in at.iter().zip([0.5, 1.0, 1.5]) {
        assert!((found - expected).abs() < 0.01, "{at:?}");
    }

    let (again, told) = build(folder.path(), corpus.path()).unwrap();
    assert!(told.copied.is_empty() && told.computed.is_empty(), "{told:?}");
    assert_eq!(told.takes.len(), 4);
    assert_eq!(again, built);
    std::fs::remove_dir_all(corpus.path().join(CACHE)).unwrap();
    assert_eq!(ClothSound::open(corpus.path()).unwrap(), built);
    assert!(!corpus.path().join(CACHE).exists(), "opening writes nothing");

    // In its own folder, nothing is copied.
    let (own, told) = build(folder.path(), folder.path()).unwrap();
    assert!(told.copied.is_empty());
    assert_eq!(own, built);
    // A changed recording is measured anew.
    wav(&corpus.path().join("slow.wav"), &[noise(3.0, 0.02, 9)]);
    assert_ne!(ClothSound::open(corpus.path()).unwrap(), built);
}

#[test]
fn a_damaged_cache_is_computed_anew() {
    let folder = folder();
    let (built, _) = build(folder.path(), folder.path()).unwrap();
    let cache = folder.path().join(CACHE);
    let files: Vec<PathBuf> = std::fs::read_dir(&cache).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert_eq!(files.len(), 2);
    for path in files {
        let whole = std::fs::read(&path).unwrap();
        for damage in 0..6usize {
            let mut bytes = whole.clone();
            match damage {
                0 => bytes.clear(),
                1 => bytes.truncate(whole.len() / 2),
                2 => bytes[whole.len() - 1] ^= 1,
                3 => bytes[0] ^= 1,
                4 => bytes.push(0),
                _ => bytes[whole.len() / 2] ^= 0x10,
            }
            std::fs::write(&path, bytes).unwrap();
            assert_eq!(ClothSound::open(folder.path()).unwrap(), built, "{damage}");
        }
        std::fs::write(&path, &whole).unwrap();
    }
    // Content that is sealed rightly and says what cannot be.
    let mut huge = Writer::default();
    huge.number(u64::MAX);
    for bytes in
        [packed::seal(FRICTION, &huge.bytes, false).unwrap(), packed::seal(FRICTION, &[0], false).unwrap()]
    {
        assert!(parse_friction(&bytes).is_err());
    }
    assert!(parse_pops(&packed::seal(POPS, &huge.bytes, false).unwrap()).is_err());
}

#[test]
fn missing_and_wrong_files_are_told() {
    let folder = folder();
    let fails = |what: &str| {
        let error = ClothSound::open(folder.path()).unwrap_err().to_string();
        assert!(error.contains(what), "{error}");
    };
    let at = |name: &str| folder.path().join(name);
    let text = std::fs::read_to_string(at(FILE_NAME)).unwrap();
    let edit = |from: &str, to: &str| std::fs::write(at(FILE_NAME), text.replace(from, to)).unwrap();
    edit("slow.wav", "gone.wav");
    fails("gone.wav");
    edit("channel = 1,", "channel = 5,");
    fails("there is no channel 5");
    edit("channel = 1,", "channel = 0,");
    // Noise is no encoder, but has edges: what comes of it is a corpus of odd speeds or an error, never a panic.
    let _ = ClothSound::open(folder.path());
    edit("[\"crumple.wav\"]", "[\"crumple.wav\"]\nthreshold = 1e9");
    fails("no pops");
    edit("", "");
    std::fs::write(at("ramp.csv"), "time_s,speed_mps\n0,0.3\n").unwrap();
    fails("at least 2 rows");
    std::fs::write(at("fast.wav"), b"RIFF").unwrap();
    fails("fast.wav");
    assert!(ClothSound::open(&at("nowhere")).is_err());
}
