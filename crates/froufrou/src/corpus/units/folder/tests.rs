use super::*;
use crate::corpus::units::concatenation::Concatenation;
use crate::corpus::units::correspondences;
use crate::corpus::units::selection::greedy;
use crate::corpus::units::warp::Warp;
use crate::random::Random;
use crate::render::wav::{SampleFormat, WavFormat, WavWriter};

const RATE_HZ: u32 = 48_000;

fn noise(seed: u64, samples: usize) -> Vec<f32> {
    let random = Random::new(seed, 0);
    let loud = |i: usize| 0.05 + 0.3 * (i as f64 / 5000.0).sin().powi(2);
    (0..samples).map(|i| (loud(i) * (random.uniform(i as u64) - 0.5)) as f32).collect()
}

fn wav(path: &Path, channels: usize, samples: &[f32]) {
    let format =
        WavFormat { rate_hz: RATE_HZ, channels, samples: SampleFormat::Float32, seed: 0, first_frame: 0 };
    let mut writer = WavWriter::create(path, format).unwrap();
    writer.write(samples).unwrap();
    writer.finish().unwrap();
}

fn corpus(change: &dyn Fn(&mut Settings)) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("takes")).unwrap();
    wav(&folder.path().join("takes/one.wav"), 1, &noise(1, 60_000));
    wav(&folder.path().join("takes/two.wav"), 1, &noise(2, 33_333));
    let mut settings = Settings::preset("cotton").unwrap();
    settings.recordings = vec!["takes".to_owned()];
    change(&mut settings);
    create(folder.path(), &settings).unwrap();
    folder
}

fn open(folder: &Path) -> (Corpus, Vec<bool>) {
    let mut anew = Vec::new();
    let corpus = Corpus::open(folder, &mut |progress| anew.push(progress.is_new)).unwrap();
    (corpus, anew)
}

#[test]
fn a_corpus_is_computed_once_and_read_again() {
    let folder = corpus(&|_| {});
    let (first, anew) = open(folder.path());
    assert_eq!(anew, [true, true]);
    let (again, anew) = open(folder.path());
    assert_eq!(anew, [false, false]);
    assert_eq!(first.features(), again.features());
    assert_eq!(again.stream_units(), [60_000usize.div_ceil(202), 33_333usize.div_ceil(202)]);
    assert_eq!(
        again.recordings().map(|(name, _)| name).collect::<Vec<_>>(),
        ["takes/one.wav", "takes/two.wav"]
    );
    assert_eq!(again.at(298).0, "takes/two.wav");
    // Other features are computed anew, the sound is not.
    let mut settings = settings(folder.path()).unwrap();
    settings.selection.d_max = 7.0;
    create(folder.path(), &settings).unwrap();
    assert_eq!(open(folder.path()).1, [false, false]);
    // One that changes is read again.
    wav(&folder.path().join("takes/two.wav"), 1, &noise(3, 20_000));
    assert_eq!(open(folder.path()).1, [false, true]);
}

#[test]
fn a_damaged_cache_is_made_again() {
    let folder = corpus(&|_| {});
    let (whole, _) = open(folder.path());
    for ending in ["units", "filtered"] {
        for cut in [0usize, 10, 1000] {
            for file in std::fs::read_dir(folder.path().join("cache")).unwrap().flatten() {
                if file.path().extension().is_some_and(|e| e == ending) {
                    let mut bytes = std::fs::read(file.path()).unwrap();
                    bytes.truncate(cut);
                    std::fs::write(file.path(), bytes).unwrap();
                }
            }
            let (again, anew) = open(folder.path());
            assert_eq!((anew, again.features()), (vec![true, true], whole.features()));
        }
    }
    std::fs::write(folder.path().join("cache/units.json"), b"{").unwrap();
    assert_eq!(open(folder.path()).1, [false, false]);
}

#[test]
fn a_target_that_is_a_recording_is_made_of_it() {
    let folder = corpus(&|_| {});
    let (corpus, _) = open(folder.path());
    let sound = noise(2, 33_333);
    let target = corpus.target(Recording { rate_hz: RATE_HZ, channels: vec![sound.clone()] }).unwrap();
    let index = corpus.index().unwrap();
    let warped = Warp::identity(3).apply_all(&target.lanes[0]).unwrap();
    let chosen = greedy(&index, &warped, &corpus.settings().selection).unwrap();
    let units: Vec<usize> = chosen.iter().map(|c| c.unit).collect();
    assert_eq!(units, (298..298 + target.lanes[0].len()).collect::<Vec<_>>());
    let concatenation = Concatenation::new(&corpus, corpus.unit_samples(), corpus.rate_hz());
    let made = concatenation.render(&units, 0, target.frames, 0..target.frames).unwrap();
    let wanted = prepared(sound, RATE_HZ, RATE_HZ, 100.0).unwrap();
    assert_eq!(made, wanted);
}

#[test]
fn channels_that_belong_together_are_one_stream() {
    let folder = tempfile::tempdir().unwrap();
    let stereo: Vec<f32> =
        noise(1, 20_000).into_iter().zip(noise(2, 20_000)).flat_map(|(a, b)| [a, b]).collect();
    wav(&folder.path().join("both.wav"), 2, &stereo);
    let mut settings = Settings::preset("windbreaker first-person").unwrap();
    create(folder.path(), &settings).unwrap();
    let (joint, _) = open(folder.path());
    assert_eq!((joint.features().dimensions(), joint.stream_units().len()), (6, 1));
    let mono = Recording { rate_hz: RATE_HZ, channels: vec![noise(3, 1000)] };
    assert!(joint.target(mono).unwrap_err().to_string().contains("has 1 channels"));
    let mut right = vec![0.0; 100];
    joint.read(0, 1, 0, &mut right).unwrap();
    assert_eq!(right, prepared(noise(2, 20_000), RATE_HZ, RATE_HZ, 100.0).unwrap()[..100]);
    settings.features.channels = Channels::Separate;
    create(folder.path(), &settings).unwrap();
    let (separate, _) = open(folder.path());
    assert_eq!((separate.features().dimensions(), separate.stream_units().len()), (3, 2));
    // A recording of one channel does not belong to those of two.
    settings.features.channels = Channels::Joint;
    create(folder.path(), &settings).unwrap();
    wav(&folder.path().join("mono.wav"), 1, &noise(3, 1000));
    let told = Corpus::open(folder.path(), &mut |_| {}).err().unwrap().to_string();
    assert!(told.contains("mono.wav") && told.contains("1 channels, expected 2"), "{told}");
}

#[test]
fn clips_are_found_and_faults_told_by_line() {
    let folder = corpus(&|_| {});
    let (corpus, _) = open(folder.path());
    let target = corpus.target(Recording { rate_hz: RATE_HZ, channels: vec![noise(5, 48_000)] }).unwrap();
    let clips = |row: &str| {
        let text = format!("target_s,recording,source_s,duration_s,source_channel,target_channel\n{row}\n");
        corpus.clips(&target, &correspondences::parse(text.as_bytes()).unwrap())
    };
    let found = clips("0.5,one,0.25,0.1,,").unwrap();
    assert_eq!((found[0].recording.as_str(), found[0].from.len()), ("takes/one.wav", 24));
    let unit = (0.25 / corpus.unit_s()).round() as usize;
    assert_eq!(found[0].to[0][0], f64::from(corpus.features().row(unit)[0]));
    for (row, wanted) in [
        ("0.95,one,0.25,0.1,,", "2: the clip from 0.95"),
        ("0.5,one,1.2,0.1,,", "is not within one"),
        ("0.5,three,0.25,0.1,,", "2: the corpus has no recording `three`"),
        ("0.5,takes,0.25,0.1,,", "in the names of 2 recordings"),
        ("0.5,one,0.25,0.1,2,", "source_channel is 2"),
        ("0.5,one,0.25,0.1,,2", "target_channel is 2"),
    ] {
        let told = clips(row).unwrap_err().to_string();
        assert!(told.contains(wanted), "{told}");
    }
}

#[test]
fn other_tables_stay_and_faults_are_told_by_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("corpus.toml");
    std::fs::write(&path, "# By hand.\nversion = 1\n[friction]\narea_m2 = 0.5\n").unwrap();
    let told = settings(folder.path()).unwrap_err().to_string();
    assert!(told.contains("no table [units]"), "{told}");
    create(folder.path(), &Settings::preset("corduroy").unwrap()).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.starts_with("# By hand.\n") && text.contains("area_m2 = 0.5"), "{text}");
    assert_eq!(settings(folder.path()).unwrap(), Settings::preset("corduroy").unwrap());
    for (text, wanted) in [
        ("version = 1\n[units]\nwidth = [1]\n", "corpus.toml:3:1: unknown field `width`"),
        ("version = 2\n[units]\n", "version is 2"),
        ("version = 1\n[units]\nwidths = [1]\n", "widths"),
        ("version = 1\n[units.selection]\nd_max = \"far\"\n", "corpus.toml:3"),
        ("version = ", "corpus.toml:1"),
        ("version = 1\n[units]\nrecordings = [\"/etc\"]\n", "not a path from the corpus"),
        ("version = 1\n[units]\nrecordings = [\"gone.wav\"]\n", "gone.wav"),
    ] {
        std::fs::write(&path, text).unwrap();
        let told = Corpus::open(folder.path(), &mut |_| {}).err().unwrap().to_string();
        assert!(told.contains(wanted), "{told}");
    }
}
