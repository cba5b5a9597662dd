//! Corpora on disk: built, built again, killed, damaged, opened.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use froufrou::corpus::dictionary::builder::{Built, Options, Stage, build};
use froufrou::corpus::dictionary::manifest::{LabelledBy, Manifest, Storage};
use froufrou::corpus::dictionary::{Action, Dictionary, Settings};
use froufrou::corpus::grains::Contact;
#[cfg(feature = "vorbis")]
use froufrou::corpus::grains::GrainKind;
use froufrou::random::Random;
use froufrou::render::wav::{SampleFormat, WavFormat, WavWriter};

const RATE_HZ: u32 = 22_050;

/// Hits of a body with three modes, each a little different.
fn hits(seed: u64) -> Vec<f32> {
    let random = Random::new(seed, 1);
    let mut sound = vec![0.0f32; 11_000];
    for hit in 0..3 {
        let at = 300 + 3500 * hit as usize;
        let pitch = 0.95 + 0.1 * random.uniform(hit);
        for i in at..sound.len().min(at + 4000) {
            let t = (i - at) as f64 / f64::from(RATE_HZ);
            let ring: f64 = [620.0, 1730.0, 4100.0]
                .iter()
                .enumerate()
                .map(|(m, hz)| (-t * (40.0 + 30.0 * m as f64)).exp() * (TAU * hz * pitch * t).sin() / 3.0)
                .sum();
            let click = (-t * 900.0).exp() * (2.0 * random.uniform(i as u64 + 7919 * hit) - 1.0);
            sound[i] += (0.6 * (ring + 0.4 * click)) as f32;
        }
    }
    sound
}

/// Something rough that slides: noise that swells, over a whistle.
fn slide(seed: u64) -> Vec<f32> {
    let random = Random::new(seed, 2);
    (0..9000)
        .map(|i| {
            let t = i as f64 / f64::from(RATE_HZ);
            let swell = 0.2 + 0.1 * (5.0 * t + seed as f64).sin();
            (swell * (random.uniform(i) - 0.5) + 0.2 * (TAU * (900.0 + 40.0 * seed as f64) * t).sin()) as f32
        })
        .collect()
}

fn wav(path: &Path, rate_hz: u32, samples: &[f32]) {
    wav_of(SampleFormat::Int16, path, rate_hz, samples);
}

fn wav_of(kind: SampleFormat, path: &Path, rate_hz: u32, samples: &[f32]) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    let format = WavFormat { rate_hz, channels: 1, samples: kind, seed: 0, first_frame: 0 };
    let mut writer = WavWriter::create(path, format).unwrap();
    writer.write(samples).unwrap();
    writer.finish().unwrap();
}

/// A folder of five recordings, and room for corpora.
fn studio() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let sounds = folder.path().join("sounds");
    wav(&sounds.join("hits/a.wav"), RATE_HZ, &hits(1));
    wav(&sounds.join("hits/b.wav"), RATE_HZ, &hits(2));
    wav(&sounds.join("slides/a.wav"), RATE_HZ, &slide(1));
    wav(&sounds.join("slides/b.wav"), RATE_HZ, &slide(2));
    wav(&sounds.join("other.wav"), RATE_HZ, &hits(3));
    folder
}

fn built(folder: &Path, corpus: &str, options: &Options) -> Built {
    build(&folder.join("sounds"), &folder.join(corpus), options, &mut |_| ()).unwrap()
}

/// What a corpus ships: its files by name, but for the cache.
fn shipped(corpus: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files =
        BTreeMap::from([("corpus.toml".into(), std::fs::read(corpus.join("corpus.toml")).unwrap())]);
    for file in std::fs::read_dir(corpus.join("store")).unwrap() {
        let file = file.unwrap();
        files.insert(file.file_name().into_string().unwrap(), std::fs::read(file.path()).unwrap());
    }
    files
}

fn power(samples: &[f32]) -> f64 {
    samples.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / samples.len() as f64
}

fn error_db(sound: &[f32], wanted: &[f32]) -> f64 {
    let off: Vec<f32> = sound.iter().zip(wanted).map(|(a, b)| a - b).collect();
    10.0 * (power(&off) / power(wanted)).log10()
}

#[test]
fn a_corpus_holds_what_was_recorded() {
    let folder = studio();
    let built = built(folder.path(), "corpus", &Options::default());
    assert_eq!((built.cut, built.matched), (5, 25));
    let dictionary = Dictionary::open(&folder.path().join("corpus")).unwrap();
    assert_eq!(dictionary.rate_hz(), RATE_HZ);
    let names: Vec<&str> = dictionary.recordings().iter().map(|r| &*r.name).collect();
    assert_eq!(names, ["hits/a.wav", "hits/b.wav", "other.wav", "slides/a.wav", "slides/b.wav"]);
    for (number, wanted) in [hits(1), hits(2), hits(3), slide(1), slide(2)].iter().enumerate() {
        let recording = &dictionary.recordings()[number];
        let error = error_db(&dictionary.sound(number), wanted);
        assert!(recording.length == wanted.len() && error < -45.0, "{}: {error} dB", recording.name);
        let is_own = |placed: &&froufrou::corpus::dictionary::Placed| {
            recording.grains.contains(&(placed.grain as usize))
        };
        assert!(recording.grains.len() > 5);
        assert!(recording.pattern.iter().filter(is_own).count() >= recording.grains.len());
        assert!(recording.pattern.iter().any(|placed| !is_own(&placed)));
    }
    let labels: Vec<_> =
        built.manifest.recording.iter().map(|l| (l.action, l.contact, l.labelled_by)).collect();
    assert_eq!(labels[0], (Action::Hit, Contact::Impulsive, LabelledBy::Folder));
    assert_eq!(labels[2], (Action::Hit, Contact::Impulsive, LabelledBy::Guess));
    assert_eq!(labels[4], (Action::Slide, Contact::Continuous, LabelledBy::Folder));
    let weight = built.manifest.weight;
    assert_eq!((weight.originals_bytes, weight.mono_bytes), (102_000, 102_000));
    assert!(weight.error_db.is_none_or(|db| db < -45.0) && weight.grains == dictionary.grains().len());
    let files: u64 = shipped(&folder.path().join("corpus")).values().map(|bytes| bytes.len() as u64).sum();
    let toml = std::fs::metadata(folder.path().join("corpus/corpus.toml")).unwrap().len();
    assert_eq!(weight.audio_bytes + weight.patterns_bytes, files - toml);
    // It needs neither its recordings nor its cache.
    std::fs::remove_dir_all(folder.path().join("sounds")).unwrap();
    std::fs::remove_dir_all(folder.path().join("corpus/cache")).unwrap();
    assert!(Dictionary::open(&folder.path().join("corpus")).unwrap() == dictionary);
}

#[test]
fn only_what_is_new_is_computed_and_the_bytes_are_those_of_a_fresh_build() {
    let folder = studio();
    let path = folder.path();
    type Step<'a> = (&'a dyn Fn(&Path), usize, usize);
    let steps: [Step<'_>; 5] = [
        (&|_| (), 5, 25),
        (&|_| (), 0, 0),
        // One more: its row and its column.
        (&|sounds| wav(&sounds.join("hits/c.wav"), RATE_HZ, &hits(4)), 1, 11),
        (&|sounds| wav(&sounds.join("hits/a.wav"), RATE_HZ, &hits(5)), 1, 11),
        (&|sounds| std::fs::remove_file(sounds.join("slides/b.wav")).unwrap(), 0, 0),
    ];
    for (number, (change, cut, matched)) in steps.into_iter().enumerate() {
        change(&path.join("sounds"));
        let again = built(path, "corpus", &Options::default());
        assert_eq!((again.cut, again.matched), (cut, matched), "step {number}");
        assert_eq!(again.removed.len(), usize::from(number == 4));
        let fresh = format!("fresh {number}");
        built(path, &fresh, &Options::default());
        let [ours, theirs] = ["corpus", &fresh].map(|c| shipped(&path.join(c)));
        let names: Vec<&String> = ours.keys().filter(|n| ours.get(*n) != theirs.get(*n)).collect();
        assert!(ours == theirs, "step {number}: {names:?}");
    }
    let settings = Settings { candidates: 2, ..Settings::default() };
    let fewer = built(path, "corpus", &Options { settings: Some(settings), ..Options::default() });
    assert_eq!((fewer.cut, fewer.matched), (0, 0));
    // What is not said stays as it is.
    assert_eq!(built(path, "corpus", &Options::default()).manifest, fewer.manifest);
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let folder = studio();
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| built(folder.path(), &format!("corpus {threads}"), &Options::default()));
    }
    assert!(shipped(&folder.path().join("corpus 1")) == shipped(&folder.path().join("corpus 3")));
}

#[test]
fn a_build_that_was_killed_is_gone_on_with() {
    let folder = studio();
    let path = folder.path();
    built(path, "whole", &Options::default());
    for (stage, name) in [
        (Stage::Cutting, "slides/a.wav"),
        (Stage::Matching, "slides/a.wav"),
        (Stage::Storing, "slides/b.wav"),
    ] {
        let corpus = path.join(format!("{stage:?}"));
        let killed = catch_unwind(AssertUnwindSafe(|| {
            build(&path.join("sounds"), &corpus, &Options::default(), &mut |progress| {
                assert!(progress.stage != stage || progress.name != name, "killed");
            })
        }));
        assert!(killed.is_err());
        let error = Dictionary::open(&corpus).unwrap_err().to_string();
        assert!(error.contains("corpus.toml") && error.contains("froufrou grains build"), "{error}");
        let rest = build(&path.join("sounds"), &corpus, &Options::default(), &mut |_| ()).unwrap();
        let expected = match stage {
            Stage::Cutting => (2, 25),
            Stage::Matching => (0, 10),
            _ => (0, 0),
        };
        assert_eq!((rest.cut, rest.matched), expected);
        assert!(shipped(&corpus) == shipped(&path.join("whole")));
    }
    // A killed rebuild leaves the corpus as it was.
    let before = Dictionary::open(&path.join("whole")).unwrap();
    wav(&path.join("sounds/hits/d.wav"), RATE_HZ, &hits(9));
    let killed = catch_unwind(AssertUnwindSafe(|| {
        build(&path.join("sounds"), &path.join("whole"), &Options::default(), &mut |progress| {
            assert!(progress.stage != Stage::Storing || progress.done < 4, "killed");
        })
    }));
    assert!(killed.is_err());
    assert!(Dictionary::open(&path.join("whole")).unwrap() == before);
}

#[test]
fn a_damaged_cache_is_computed_again() {
    let folder = studio();
    let path = folder.path();
    built(path, "corpus", &Options::default());
    let whole = shipped(&path.join("corpus"));
    for (number, file) in std::fs::read_dir(path.join("corpus/cache")).unwrap().enumerate() {
        let file = file.unwrap().path();
        let mut bytes = std::fs::read(&file).unwrap();
        let middle = bytes.len() / 2;
        bytes[middle] ^= 0x10;
        bytes.truncate(if number % 2 == 0 { bytes.len() } else { middle });
        std::fs::write(&file, bytes).unwrap();
    }
    assert!(Dictionary::open(&path.join("corpus")).is_ok());
    // Something changes, so that the cache is asked.
    wav(&path.join("sounds/hits/c.wav"), RATE_HZ, &hits(4));
    built(path, "corpus", &Options::default());
    std::fs::remove_file(path.join("sounds/hits/c.wav")).unwrap();
    built(path, "corpus", &Options::default());
    assert!(shipped(&path.join("corpus")) == whole);
    // Lost files of the store are written again.
    std::fs::remove_dir_all(path.join("corpus/store")).unwrap();
    built(path, "corpus", &Options::default());
    assert!(shipped(&path.join("corpus")) == whole);
}

#[test]
fn a_damaged_corpus_says_which_file_and_what_to_do() {
    let folder = studio();
    for storage in [Storage::Flac, Storage::Vorbis] {
        if storage == Storage::Vorbis && !cfg!(feature = "vorbis") {
            continue;
        }
        let corpus = folder.path().join(format!("{storage:?}"));
        built(
            folder.path(),
            &format!("{storage:?}"),
            &Options { storage: Some(storage), ..Options::default() },
        );
        let whole = Dictionary::open(&corpus).unwrap();
        for (name, bytes) in shipped(&corpus) {
            let place = match name.as_str() {
                "corpus.toml" => corpus.join(&name),
                _ => corpus.join("store").join(&name),
            };
            let checked = |damaged: Option<&[u8]>, must_fail: bool| {
                match damaged {
                    Some(damaged) => std::fs::write(&place, damaged).unwrap(),
                    None => std::fs::remove_file(&place).unwrap(),
                }
                match Dictionary::open(&corpus) {
                    Ok(_) => assert!(!must_fail, "{name}"),
                    Err(error) => {
                        let text = error.to_string();
                        assert!(error.file().is_some() && text.contains("froufrou grains build"), "{text}");
                    }
                }
            };
            checked(None, true);
            checked(Some(&[]), true);
            for part in 1..8 {
                // A shorter manifest may still be one.
                checked(Some(&bytes[..bytes.len() * part / 8]), name != "corpus.toml");
            }
            let random = Random::new(5, bytes.len() as u64);
            for flip in 0..24 {
                let mut damaged = bytes.clone();
                damaged[random.below(2 * flip, bytes.len())] ^= 1 << random.below(2 * flip + 1, 8);
                checked(Some(&damaged), false);
            }
            std::fs::write(&place, &bytes).unwrap();
        }
        assert!(Dictionary::open(&corpus).unwrap() == whole);
    }
}

#[test]
fn files_that_do_not_belong_together_are_refused() {
    let folder = studio();
    built(folder.path(), "corpus", &Options::default());
    let corpus = folder.path().join("corpus");
    let path = corpus.join("corpus.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let manifest = Manifest::open(&corpus).unwrap();
    let error = |changed: String| {
        std::fs::write(&path, changed).unwrap();
        Dictionary::open(&corpus).unwrap_err().to_string()
    };
    let [a, b] = [0, 1].map(|n| manifest.recording[n].audio.clone());
    let swapped = text.replace(&a, "x").replace(&b, &a).replace("\"x\"", &format!("{b:?}"));
    assert!(error(swapped).contains("are those of other sound"));
    let outside = error(text.replace(&format!("audio = {a:?}"), "audio = \"../../../../../etc/passwd\""));
    assert!(outside.contains("32 hexadecimal digits"), "{outside}");
    assert!(error(text.replace("version = 1", "version = 2")).contains("version is 2, expected 1"));
    assert!(error(text.replace("taper = 0.02", "taper = 7.0")).contains("taper is 7"));
    assert!(error(text.replace("rate_hz = 22050", "rate_hz = 44100")).contains("at 22050 Hz"));
    let unknown = error(text.replace("candidates", "candidate"));
    assert!(unknown.contains("corpus.toml:") && unknown.contains("candidate"), "{unknown}");
}

#[test]
fn labels_are_said_by_a_file_and_stay_when_set_by_hand() {
    let folder = studio();
    let sounds = folder.path().join("sounds");
    std::fs::write(sounds.join("labels.toml"), "\"oth*\" = \"break\"\n\"**/a.wav\" = \"roll\"\n").unwrap();
    let labels = |built: &Built| -> Vec<(Action, LabelledBy)> {
        built.manifest.recording.iter().map(|l| (l.action, l.labelled_by)).collect()
    };
    let first = built(folder.path(), "corpus", &Options::default());
    let roll = (Action::Roll, LabelledBy::Manifest);
    let (hit, slide) = ((Action::Hit, LabelledBy::Folder), (Action::Slide, LabelledBy::Folder));
    assert_eq!(labels(&first), [roll, hit, (Action::Break, LabelledBy::Manifest), roll, slide]);
    let path = folder.path().join("corpus/corpus.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let text = text.replacen("labelled_by = \"folder\"", "labelled_by = \"hand\"", 1);
    std::fs::write(&path, text.replacen("action = \"hit\"", "action = \"break\"", 1)).unwrap();
    let second = built(folder.path(), "corpus", &Options::default());
    assert_eq!(labels(&second)[1], (Action::Break, LabelledBy::Hand));
    std::fs::write(sounds.join("labels.toml"), "\"oth*\" = \"brake\"\n").unwrap();
    let fault = build(&sounds, &folder.path().join("corpus"), &Options::default(), &mut |_| ());
    let message = fault.unwrap_err().to_string();
    assert!(message.contains("labels.toml:1:10: ") && message.contains("hit"), "{message}");
}

#[test]
fn bad_folders_and_recordings_are_named() {
    let folder = studio();
    let error = |sounds: &str, options: Options| {
        let corpus = folder.path().join("corpus");
        build(&folder.path().join(sounds), &corpus, &options, &mut |_| ()).unwrap_err().to_string()
    };
    assert!(error("nowhere", Options::default()).contains("nowhere"));
    assert!(error("sounds/other.wav", Options::default()).contains("expected a folder"));
    std::fs::create_dir(folder.path().join("empty")).unwrap();
    assert!(error("empty", Options::default()).contains("no recordings"));
    assert!(error("sounds", Options { quality: Some(7.0), ..Options::default() }).contains("quality is 7"));
    std::fs::write(folder.path().join("sounds/broken.wav"), "RIFF").unwrap();
    assert!(error("sounds", Options::default()).contains("broken.wav"));
    assert!(!folder.path().join("corpus/corpus.toml").exists());
}

#[test]
fn sound_is_brought_to_one_rate_and_read_from_recordings_where_none_is_stored() {
    let folder = studio();
    let path = folder.path();
    // What shares another's sound where sound is stored would be its own where none is.
    let settings = Some(Settings { share_from: 2.0, ..Settings::default() });
    let options = Options { rate_hz: Some(16_000), settings, ..Options::default() };
    let stored = built(path, "stored", &options);
    assert_eq!(stored.manifest.rate_hz, 16_000);
    let options = Options { storage: Some(Storage::None), ..options };
    built(path, "bare", &options);
    let [stored, bare] = ["stored", "bare"].map(|c| Dictionary::open(&path.join(c)).unwrap());
    assert!(stored == bare);
    assert_eq!(stored.recordings()[0].length, 11_000 * 320 / 441 + 1);
    assert!(stored.sound(3).iter().all(|v| v.abs() < 1.0));
    wav(&path.join("sounds/other.wav"), RATE_HZ, &hits(8));
    let error = Dictionary::open(&path.join("bare")).unwrap_err().to_string();
    assert!(error.contains("other.wav") && error.contains("not what the corpus was built from"), "{error}");
}

#[test]
fn grains_that_are_alike_share_their_sound() {
    let folder = studio();
    let path = folder.path();
    built(path, "before", &Options::default());
    let again: Vec<f32> = std::iter::repeat_n(0.0, 777).chain(hits(1)).map(|v| 0.6 * v).collect();
    wav(&path.join("sounds/hits/softer.wav"), RATE_HZ, &again);
    let shared = built(path, "corpus", &Options::default());
    let [before, after] = ["before", "corpus"].map(|c| Manifest::open(&path.join(c)).unwrap().weight);
    assert_eq!(before.shared_grains, 0);
    let dictionary = Dictionary::open(&path.join("corpus")).unwrap();
    let number = dictionary.recordings().iter().position(|r| r.name == "hits/softer.wav").unwrap();
    let own = dictionary.recordings()[number].grains.len();
    assert!(after.shared_grains * 10 > own * 8, "{} of {own}", after.shared_grains);
    assert!(after.audio_bytes < before.audio_bytes + 3000, "{after:?} {before:?}");
    let error = error_db(&dictionary.sound(number), &again);
    assert!(error < -35.0, "{error} dB");
    assert!(shared.manifest.weight.error_db.unwrap() < -45.0);
    let settings = Some(Settings { share_from: 1.5, ..Settings::default() });
    let apart = built(path, "apart", &Options { settings, ..Options::default() });
    assert_eq!(apart.manifest.weight.shared_grains, 0);
}

#[test]
fn what_reaches_beyond_full_scale_is_whole_and_may_be_shared() {
    let folder = studio();
    let path = folder.path();
    let louder: Vec<f32> = hits(1).iter().map(|v| 7.0 * v).collect();
    assert!(louder.iter().fold(0.0f32, |peak, v| peak.max(v.abs())) > 2.0);
    wav_of(SampleFormat::Float32, &path.join("sounds/hits/louder.wav"), RATE_HZ, &louder);
    let storages = [
        Storage::Flac,
        Storage::None,
        #[cfg(feature = "vorbis")]
        Storage::Vorbis,
    ];
    for storage in storages {
        let corpus = format!("{storage:?}");
        let built = built(path, &corpus, &Options { storage: Some(storage), ..Options::default() });
        let dictionary = Dictionary::open(&path.join(&corpus)).unwrap();
        let number = dictionary.recordings().iter().position(|r| r.name == "hits/louder.wav").unwrap();
        assert!(built.manifest.recording[number].halvings > 0);
        assert!(built.manifest.weight.shared_grains > 0 || storage == Storage::None);
        let error = error_db(&dictionary.sound(number), &louder);
        println!("{storage:?}: {error:.1} dB");
        assert!(error < if storage == Storage::Vorbis { -8.0 } else { -35.0 }, "{storage:?}: {error} dB");
    }
}

#[cfg(feature = "vorbis")]
#[test]
fn vorbis_takes_a_fraction_and_grains_stay_in_place() {
    let folder = studio();
    let path = folder.path();
    let options =
        |quality| Options { storage: Some(Storage::Vorbis), quality: Some(quality), ..Options::default() };
    let flac = built(path, "flac", &Options::default()).manifest.weight;
    let low = built(path, "low", &options(0.0)).manifest.weight;
    let high = built(path, "high", &options(0.9)).manifest.weight;
    assert!(low.audio_bytes < high.audio_bytes && high.audio_bytes < flac.audio_bytes);
    assert!(high.error_db < low.error_db && flac.error_db < high.error_db, "{high:?} {low:?}");
    let [exact, near] = ["flac", "high"].map(|c| Dictionary::open(&path.join(c)).unwrap());
    assert_eq!(exact.grains().len(), near.grains().len());
    for (number, recording) in exact.recordings().iter().enumerate() {
        assert_eq!(recording.length, near.recordings()[number].length);
        let (a, b) = (exact.sound(number), near.sound(number));
        let product = |lag: i64| -> f64 {
            (100..a.len() - 100).map(|i| f64::from(a[i] * b[(i as i64 + lag) as usize])).sum()
        };
        let best = (-60..=60).max_by(|x, y| product(*x).total_cmp(&product(*y)));
        assert_eq!(best, Some(0), "{}", recording.name);
        assert!(error_db(&b, &a) < -15.0, "{}: {} dB", recording.name, error_db(&b, &a));
    }
    let moved =
        exact.grains().iter().zip(near.grains()).filter(|(a, b)| (a.start, a.length) != (b.start, b.length));
    assert_eq!(moved.count(), 0);
    let kinds: Vec<GrainKind> = near.grains().iter().map(|g| g.kind).collect();
    assert!(kinds.contains(&GrainKind::Sinusoidal) && kinds.contains(&GrainKind::Transient));
}
