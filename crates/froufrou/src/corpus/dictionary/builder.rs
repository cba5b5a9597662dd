//! Making a corpus of a folder of recordings, and making it again when they change.
//!
//! | step | what is kept in the cache |
//! | --- | --- |
//! | `scan`: the recordings, in order of their names | |
//! | `labels`: what bodies do in them | |
//! | `prepare`: one channel, one rate, 16 bits, silence where nothing is loud enough; cuts | a file a recording |
//! | `sinusoids` of continuous ones | a file a recording |
//! | `matching`: each recording with all grains | a file a recording, with the peaks of each other recording's grains |
//! | `share`: what sounds as something before | |
//! | `audio`: encoded sound, and the file of grains and patterns | |
//! | `corpus.toml`, which names all files that belong to it | |
//!
//! Files in the cache are named by what they were computed from: the content of recordings, labels and settings. So a
//! build does what no build did before, and one that is killed is gone on with. Files of the store are named by their
//! content, and `corpus.toml` comes last: until then the corpus is what it was.

mod cache;
mod labels;
pub(crate) mod scan;
mod share;

use std::collections::BTreeSet;
use std::path::Path;

use self::cache::{Analysis, Pairs};
use self::scan::Found;
use super::assemble::{Cut, Sound};
use super::index::{self, Item};
use super::manifest::{FILE_NAME, Listed, Manifest, Storage, Weight};
use super::{Settings, audio, folder, matching, packed, prepare, sinusoids};
use crate::corpus::grains::Contact;
use crate::corpus::grains::patterns::Peak;
use crate::corpus::recording::Recording;
use crate::error::{Error, Result};

pub use labels::FILE_NAME as LABELS_FILE_NAME;

/// How to make a corpus. What is not said stays as it is in a corpus that is there already.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Options {
    /// Samples a second; else that of most recordings.
    pub rate_hz: Option<u32>,
    /// How sound is kept; else as FLAC.
    pub storage: Option<Storage>,
    /// Of Vorbis, −0.2 to 1; else 0.2.
    pub quality: Option<f64>,
    /// How recordings become grains.
    pub settings: Option<Settings>,
}

/// The quality of Vorbis where nobody asks for another.
const QUALITY: f64 = 0.2;

/// What a build is busy with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Reading recordings; counted in recordings.
    Reading,
    /// Splitting and cutting them; counted in recordings.
    Cutting,
    /// Correlating; counted in samples times grains.
    Matching,
    /// Encoding and writing; counted in recordings.
    Storing,
}

/// How far a build is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress<'a> {
    /// What it is busy with.
    pub stage: Stage,
    /// The recording.
    pub name: &'a str,
    /// What is done of this stage.
    pub done: u64,
    /// What there is to do.
    pub total: u64,
}

/// What was done.
#[derive(Debug, Clone, PartialEq)]
pub struct Built {
    /// What the corpus is now.
    pub manifest: Manifest,
    /// Recordings that were cut anew.
    pub cut: usize,
    /// Pairs of a recording and the grains of a recording that were matched anew.
    pub matched: usize,
    /// Recordings that are no longer there.
    pub removed: Vec<String>,
}

/// Makes a corpus of all recordings in a folder and those within it.
///
/// # Errors
/// Where there are no recordings, one of them cannot be read, the corpus that is there is damaged, a setting makes no
/// sense, or nothing can be written.
pub fn build(
    recordings: &Path,
    corpus: &Path,
    options: &Options,
    progress: &mut dyn FnMut(Progress),
) -> Result<Built> {
    let before = match corpus.join(FILE_NAME).exists() {
        true => Some(Manifest::open(corpus)?),
        false => None,
    };
    let settings = options.settings.clone().or_else(|| before.as_ref().map(|b| b.settings.clone()));
    let settings = settings.unwrap_or_default();
    settings.check()?;
    let storage = options.storage.or(before.as_ref().map(|b| b.storage)).unwrap_or(Storage::Flac);
    let quality = options.quality.or(before.as_ref().and_then(|b| b.quality)).unwrap_or(QUALITY);
    if !(-0.2..=1.0).contains(&quality) {
        return Err(Error::new(format!("the quality is {quality}, expected −0.2 to 1")));
    }
    let found = scan::scan(recordings, corpus, &mut *progress)?;
    let rate_hz = match options.rate_hz.or(before.as_ref().map(|b| b.rate_hz)) {
        Some(rate_hz) => rate_hz,
        None => commonest_rate(&found)?,
    };
    let labelled = labels::label(recordings, &found, before.as_ref())?;
    let removed = before.iter().flat_map(|b| &b.recording).map(|listed| &listed.name);
    let removed = removed.filter(|name| found.iter().all(|found| found.name != **name)).cloned().collect();
    let wanted = Manifest {
        version: Manifest::VERSION,
        recordings: scan::relative(recordings, corpus)?,
        rate_hz,
        storage,
        quality: (storage == Storage::Vorbis).then_some(quality),
        patterns: String::new(),
        settings,
        weight: Weight::default(),
        recording: labelled,
        units: before.as_ref().and_then(|b| b.units.clone()),
    };
    if let Some(before) = before.filter(|before| is_up_to_date(corpus, before, &wanted)) {
        return Ok(Built { manifest: before, cut: 0, matched: 0, removed });
    }
    for folder in [audio::STORE, sinusoids::CACHE] {
        let path = corpus.join(folder);
        std::fs::create_dir_all(&path).map_err(|e| Error::io("create", path, e))?;
    }
    let mut work = Work { corpus, manifest: wanted, used: BTreeSet::new(), progress };
    let (cut, keys, prepared, cut_count) = work.cut(&found)?;
    let (peaks, candidates, matched) = work.matched(&cut, &keys)?;
    work.store(&cut, &prepared, peaks, &candidates)?;
    work.clean();
    Ok(Built { manifest: work.manifest, cut: cut_count, matched, removed })
}

/// The rate of most recordings.
fn commonest_rate(found: &[Found]) -> Result<u32> {
    let mut rates = Vec::with_capacity(found.len());
    for found in found {
        rates.push(Recording::open(&found.path)?.rate_hz);
    }
    prepare::commonest(rates).ok_or_else(|| Error::new("there are no recordings"))
}

/// True where nothing would change.
fn is_up_to_date(corpus: &Path, before: &Manifest, wanted: &Manifest) -> bool {
    let mut like = wanted.clone();
    like.patterns.clone_from(&before.patterns);
    like.weight = before.weight;
    if like.recording.len() != before.recording.len() {
        return false;
    }
    for (to, from) in like.recording.iter_mut().zip(&before.recording) {
        to.audio.clone_from(&from.audio);
    }
    let has_sound = |listed: &Listed| {
        audio::name(&listed.audio, before.storage)
            .is_none_or(|_| audio::decode(corpus, &listed.audio, before.storage, before.rate_hz).is_ok())
    };
    like == *before && folder::items(corpus, before).is_ok() && before.recording.iter().all(has_sound)
}

/// What a build carries along.
struct Work<'a> {
    corpus: &'a Path,
    manifest: Manifest,
    /// Files of the store and of the cache that belong to the corpus.
    used: BTreeSet<String>,
    progress: &'a mut dyn FnMut(Progress),
}

/// Where in the dictionary a grain sounds nearly as something before it.
type Candidates = Vec<share::Candidate>;

impl Work<'_> {
    /// Cuts all recordings; gives what names what they were computed from, and how many were cut anew.
    fn cut(&mut self, found: &[Found]) -> Result<(Cut, Vec<String>, Vec<Analysis>, usize)> {
        let Manifest { rate_hz, settings, .. } = self.manifest.clone();
        let (mut sounds, mut keys, mut all, mut anew) = (Vec::new(), Vec::new(), Vec::new(), 0);
        let listed = self.manifest.recording.clone();
        for (number, (found, listed)) in found.iter().zip(listed).enumerate() {
            self.report(Stage::Cutting, &listed.name, number as u64, found_total(&self.manifest));
            let key = cache::key(&listed, rate_hz, &settings)?;
            let analysis = match Analysis::read(self.corpus, &key, listed.contact) {
                Some(analysis) => analysis,
                None => {
                    anew += 1;
                    let bytes = std::fs::read(&found.path).map_err(|e| Error::io("read", &found.path, e))?;
                    let prepared = prepare::recording(&bytes, &found.path, rate_hz, &settings)?;
                    Analysis { prepared, segments: None }
                }
            };
            let samples = analysis.prepared.sound();
            let split = sinusoids::kept_parts(self.corpus, samples, rate_hz, listed.contact, &settings);
            let (parts, file) = split.map_err(|e| e.in_file(&found.path))?;
            self.used.extend(file);
            let is_new = analysis.segments.is_none();
            let segments = match analysis.segments {
                Some(segments) => segments,
                None => prepare::segments(&parts, rate_hz, &settings).map_err(|e| e.in_file(&found.path))?,
            };
            let analysis = Analysis { prepared: analysis.prepared, segments: Some(segments.clone()) };
            if is_new {
                analysis.write(self.corpus, &key, rate_hz, listed.contact)?;
            }
            self.used.insert(Analysis::name(&key));
            let Listed { name, contact, action, .. } = listed;
            sounds.push(Sound { name, contact, action, parts, segments });
            keys.push(key);
            all.push(analysis);
        }
        Ok((Cut::new(rate_hz, &settings, sounds), keys, all, anew))
    }

    /// Matches each recording with all grains; gives the peaks that are kept, grains that may be shared, and how many
    /// pairs were matched anew.
    fn matched(&mut self, cut: &Cut, keys: &[String]) -> Result<(Vec<Vec<Peak>>, Candidates, usize)> {
        let dictionary = cut.dictionary();
        let settings = self.manifest.settings.clone();
        let recordings = dictionary.recordings();
        let known: Vec<Pairs> =
            keys.iter().map(|key| Pairs::read(self.corpus, key, &settings)).collect::<Result<_>>()?;
        let work_of = |row: usize, column: usize| {
            recordings[row].length as u64 * recordings[column].grains.len() as u64
        };
        let missing = |pairs: &Pairs| -> Vec<usize> {
            (0..keys.len()).filter(|&column| !pairs.has(&keys[column])).collect()
        };
        let work = |(row, pairs)| missing(pairs).iter().map(|&c| work_of(row, c)).sum::<u64>();
        let total = known.iter().enumerate().map(work).sum();
        let (mut kept, mut candidates, mut matched, mut done) = (Vec::new(), Vec::new(), 0, 0);
        for (row, (key, mut pairs)) in keys.iter().zip(known).enumerate() {
            self.report(Stage::Matching, &recordings[row].name, done, total);
            let columns = missing(&pairs);
            if !columns.is_empty() {
                let grains: Vec<usize> =
                    columns.iter().flat_map(|&column| recordings[column].grains.clone()).collect();
                let found = matching::peaks(dictionary, cut.parts(row), &grains, &settings)?;
                for &column in &columns {
                    let range = recordings[column].grains.clone();
                    let of_column = found.iter().filter(|peak| range.contains(&(peak.grain as usize)));
                    let local = of_column.map(|p| Peak { grain: p.grain - range.start as u32, ..*p });
                    pairs.add(&keys[column], local.collect());
                    matched += 1;
                    done += work_of(row, column);
                }
                pairs.keep(keys);
                pairs.write(self.corpus, key, &settings)?;
            }
            self.used.insert(Pairs::name(key, &settings)?);
            let mut peaks: Vec<Peak> = Vec::new();
            for (column, recording) in recordings.iter().enumerate() {
                // Numbers were held against 32 bits when grains were matched.
                let first = recording.grains.start as u32;
                let length = recordings[row].length;
                let of_column = pairs.of(&keys[column]).iter().filter_map(|peak| {
                    let entry = dictionary.grains().get(recording.grains.start + peak.grain as usize)?;
                    let is_inside = (peak.grain as usize) < recording.grains.len()
                        && (peak.start as usize).checked_add(entry.length)? <= length;
                    is_inside.then_some(Peak { grain: first + peak.grain, ..*peak })
                });
                peaks.extend(of_column);
            }
            candidates.extend(share::candidates(dictionary, row, &peaks, settings.share_from));
            kept.push(matching::kept(dictionary, row, peaks, &settings));
        }
        Ok((kept, candidates, matched))
    }

    /// Encodes the sound, writes grains and patterns, weighs everything and puts `corpus.toml` in its place.
    fn store(
        &mut self,
        cut: &Cut,
        analyses: &[Analysis],
        peaks: Vec<Vec<Peak>>,
        candidates: &Candidates,
    ) -> Result<()> {
        let Manifest { rate_hz, settings, storage, quality, .. } = self.manifest.clone();
        let heard: Vec<Vec<f32>> = analyses.iter().map(|analysis| analysis.prepared.sound()).collect();
        // Without sound of its own there is nothing that a corpus could share.
        let shares = match storage {
            Storage::None => vec![Vec::new(); heard.len()],
            _ => share::shares(cut.dictionary(), &heard, candidates, settings.share_from),
        };
        let mut weight = Weight { grains: cut.dictionary().grains().len(), ..Weight::default() };
        weight.shared_grains = shares.iter().map(Vec::len).sum();
        let mut items = Vec::with_capacity(heard.len());
        let mut sounds: Vec<Vec<f32>> = Vec::with_capacity(heard.len());
        let (mut energy, mut lost) = (0.0, 0.0);
        let mut files = BTreeSet::new();
        for (number, ((analysis, shares), peaks)) in analyses.iter().zip(shares).zip(peaks).enumerate() {
            let name = self.manifest.recording[number].name.clone();
            self.report(Stage::Storing, &name, number as u64, found_total(&self.manifest));
            let mut samples = analysis.prepared.samples.clone();
            shares.iter().for_each(|share| samples[share.start..][..share.length].fill(0));
            let stored = audio::encode(&samples, rate_hz, storage, quality.unwrap_or(QUALITY))
                .map_err(|e| e.in_file(&name))?;
            for file in stored.files {
                let path = audio::path(self.corpus, &file.name);
                if files.insert(file.name.clone()) {
                    weight.audio_bytes += file.bytes.len() as u64;
                    if std::fs::read(&path).map_or(true, |there| there != file.bytes) {
                        sinusoids::write(&path, &file.bytes)?;
                    }
                }
            }
            let halvings = analysis.prepared.halvings;
            sounds.push(match storage {
                Storage::None => heard[number].clone(),
                _ => {
                    let mut sound = audio::decode(self.corpus, &stored.hash, storage, rate_hz)?;
                    prepare::double(&mut sound, halvings);
                    sound
                }
            });
            let segments = analysis.segments.clone().unwrap_or_default();
            let item = Item { audio: stored.hash.clone(), length: samples.len(), segments, shares, peaks };
            folder::fill(number, &item, &mut sounds)?;
            let off = |(a, b): (&f32, &f32)| f64::from(a - b).powi(2);
            energy += analysis.prepared.energy;
            lost += analysis.prepared.lost + heard[number].iter().zip(&sounds[number]).map(off).sum::<f64>();
            weight.originals_bytes += analysis.prepared.original_bytes;
            weight.mono_bytes += 2 * samples.len() as u64;
            let listed = &mut self.manifest.recording[number];
            listed.audio = stored.hash;
            listed.halvings = halvings;
            if listed.contact == Contact::Continuous {
                let samples = sounds[number].clone();
                let (_, file) =
                    sinusoids::kept_parts(self.corpus, samples, rate_hz, listed.contact, &settings)?;
                self.used.extend(file);
            }
            items.push(item);
        }
        weight.error_db = (lost > 0.0 && energy > 0.0).then(|| 10.0 * (lost / energy).log10());
        let contacts: Vec<Contact> = self.manifest.recording.iter().map(|listed| listed.contact).collect();
        let bytes = index::write(&items, &contacts)?;
        weight.patterns_bytes = bytes.len() as u64;
        self.manifest.patterns = packed::hash(&[&bytes]);
        let name = format!("{}.grains", self.manifest.patterns);
        sinusoids::write(&audio::path(self.corpus, &name), &bytes)?;
        files.insert(name);
        self.used.extend(files);
        self.manifest.weight = weight;
        sinusoids::write(&self.corpus.join(FILE_NAME), self.manifest.text()?.as_bytes())
    }

    /// Removes files of former builds from the store and the cache. What cannot be removed stays.
    fn clean(&self) {
        for folder in [audio::STORE, sinusoids::CACHE] {
            let Ok(files) = std::fs::read_dir(self.corpus.join(folder)) else { continue };
            for file in files.flatten() {
                let name = file.file_name().to_string_lossy().into_owned();
                if is_ours(&name) && !self.used.contains(&name) {
                    let _ = std::fs::remove_file(file.path());
                }
            }
        }
    }

    fn report(&mut self, stage: Stage, name: &str, done: u64, total: u64) {
        (self.progress)(Progress { stage, name, done, total });
    }
}

fn found_total(manifest: &Manifest) -> u64 {
    manifest.recording.len() as u64
}

/// True for names that a build gives: a hash and one of some endings.
fn is_ours(name: &str) -> bool {
    const ENDINGS: [&str; 7] = ["flac", "vorbis", "headers", "grains", "sinusoids", "cut", "pairs"];
    name.split_once('.').is_some_and(|(hash, ending)| {
        hash.len() == 32 && hash.bytes().all(|b| b.is_ascii_hexdigit()) && ENDINGS.contains(&ending)
    })
}
