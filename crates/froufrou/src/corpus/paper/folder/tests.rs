use super::*;
use crate::corpus::dictionary::sinusoids::CACHE;
use crate::corpus::paper::plate::Shape;
use crate::corpus::paper::synthetic::Paper;
use crate::corpus::paper::{BINS, SPACING_HZ};
use crate::random::Random;

const RATE_HZ: u32 = 48_000;

fn wav(path: &Path, samples: &[f32]) {
    let sample_format = hound::SampleFormat::Float;
    let spec = hound::WavSpec { channels: 1, sample_rate: RATE_HZ, bits_per_sample: 32, sample_format };
    let mut writer = hound::WavWriter::create(path, spec).unwrap();
    samples.iter().for_each(|sample| writer.write_sample(*sample).unwrap());
    writer.finalize().unwrap();
}

/// A folder with a flap of the model at 0.5 s, a clac alone and white noise that slid at half a metre a second.
fn recordings() -> (tempfile::TempDir, Vec<f32>) {
    let folder = tempfile::tempdir().unwrap();
    let flap = Paper::printer().flap(&Shape::rectangle(0.1, 0.2), 1, f64::from(RATE_HZ));
    let mut long = vec![0.0f32; 24_000];
    long.extend_from_slice(&flap);
    long.resize(96_000, 0.0);
    wav(&folder.path().join("flaps.wav"), &long);
    wav(&folder.path().join("clac.wav"), &Paper::printer().clac(0, f64::from(RATE_HZ)));
    let random = Random::new(1, 1);
    let noise: Vec<f32> = (0..96_000).map(|n| 0.05 * random.normal(n) as f32).collect();
    wav(&folder.path().join("table.wav"), &noise);
    let text = "version = 1\nname = \"kraft\"\n[paper]\n[[paper.clip]]\nrecording = \"flaps.wav\"\nfrom_s = 0.4\n\
                to_s = 1.9\nruling_m = 0.1\nborder_m = 0.2\n[[paper.clip]]\nrecording = \"clac.wav\"\n\
                constrained = true\n[[paper.friction]]\nrecording = \"table.wav\"\nruling_m = 0.1\n\
                border_m = 0.2\nspeed_mps = 0.5\n";
    std::fs::write(folder.path().join("corpus.toml"), text).unwrap();
    (folder, flap)
}

#[test]
fn a_database_is_built_opened_and_kept() {
    let (folder, flap) = recordings();
    let corpus = folder.path().join("corpus");
    let (sound, built) = build(folder.path(), &corpus).unwrap();
    assert_eq!((built.copied.len(), built.computed), (3, true));
    assert_eq!((sound.name(), sound.places().len()), ("kraft", 2));
    let entry = &sound.clips()[0];
    // It begins some milliseconds before it snaps, and is as loud as it was.
    assert!((0.49..0.512).contains(&entry.begin_s), "{entry:?}");
    assert!((entry.begin_s + entry.lead_s - 0.511).abs() < 0.008, "{entry:?}");
    let clip = sound.clip_samples(0, RATE_HZ).unwrap();
    let energy = |samples: &[f32]| samples.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>();
    assert!((energy(&clip) / energy(&flap) - 1.0).abs() < 0.05, "{}", energy(&clip) / energy(&flap));
    assert!(clip.len() < flap.len() + 500 && clip[0].abs() < 1e-4);
    assert_eq!(sound.clips()[1].border_m, 0.0);
    // White noise of 0.05 at 0.5 m/s: a density of 0.05 √(2 / rate) / 0.5.
    let density = &sound.spectra()[0].density;
    let wanted = 0.05 * (2.0 / f64::from(RATE_HZ)).sqrt() / 0.5;
    let band = &density[20..2000];
    let found = (band.iter().map(|v| v * v).sum::<f64>() / band.len() as f64).sqrt();
    assert_eq!(density.len(), BINS);
    assert!((found / wanted - 1.0).abs() < 0.02, "{found} {wanted}");
    assert!(density[(20.0 / SPACING_HZ) as usize] < 0.2 * wanted);
    // Again, nothing is computed, and it is the same.
    let (again, built) = build(folder.path(), &corpus).unwrap();
    assert_eq!((built.copied.len(), built.computed), (0, false));
    assert_eq!(again, sound);
    assert_eq!(PaperSound::open(&corpus).unwrap(), sound);
    // Another size is no other sound.
    let path = corpus.join("corpus.toml");
    let text = std::fs::read_to_string(&path).unwrap().replace("ruling_m = 0.1", "ruling_m = 0.15");
    std::fs::write(&path, text.clone()).unwrap();
    let (other, built) = build(&corpus, &corpus).unwrap();
    assert!(!built.computed && other.clips()[0].ruling_m == 0.15);
    std::fs::write(&path, text.replace("speed_mps = 0.5", "speed_mps = 1")).unwrap();
    let (other, built) = build(&corpus, &corpus).unwrap();
    assert!(built.computed);
    assert!((other.spectra()[0].density[500] * 2.0 / density[500] - 1.0).abs() < 1e-9);
}

#[test]
fn a_damaged_cache_is_made_anew() {
    let (folder, _) = recordings();
    let (sound, _) = build(folder.path(), folder.path()).unwrap();
    let cache = std::fs::read_dir(folder.path().join(CACHE)).unwrap().next().unwrap().unwrap().path();
    let whole = std::fs::read(&cache).unwrap();
    for at in [0, 10, 17, 40, whole.len() / 2, whole.len() - 1] {
        let mut damaged = whole.clone();
        damaged[at] ^= 0x40;
        for bytes in [&damaged[..], &whole[..at]] {
            assert!(parse(bytes).is_err());
            std::fs::write(&cache, bytes).unwrap();
            assert_eq!(PaperSound::open(folder.path()).unwrap(), sound);
        }
    }
    // Absurd counts under a good checksum.
    for count in [1u64 << 20, u64::MAX] {
        let mut writer = Writer::default();
        writer.number(count);
        assert!(parse(&packed::seal(KIND, &writer.bytes, false).unwrap()).is_err());
    }
}

#[test]
fn what_cannot_be_used_is_told_with_its_place() {
    let (folder, _) = recordings();
    let path = folder.path().join("corpus.toml");
    let whole = std::fs::read_to_string(&path).unwrap();
    for (from, to, what) in [
        ("to_s = 1.9", "to_s = 0.45", "flaps.wav:from 0.4 s: the clip is silent"),
        ("from_s = 0.4\nto_s = 1.9", "from_s = 7", "flaps.wav:from 7 s: the part is empty"),
        ("\"table.wav\"", "\"clac.wav\"", "clac.wav:from 0 s: the take is 0.012 s long"),
        ("\"clac.wav\"", "\"clack.wav\"", "clack.wav"),
        ("constrained", "channel = 3\nconstrained", "there is no channel 3"),
    ] {
        assert!(whole.contains(from), "{from}");
        std::fs::write(&path, whole.replacen(from, to, 1)).unwrap();
        let error = PaperSound::open(folder.path()).unwrap_err().to_string();
        assert!(error.contains(what), "{to}: {error}");
    }
}
