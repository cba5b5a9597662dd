//! What was computed from recordings, by what it was computed from.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{path_of, prepared};
use crate::WholeFile;
use crate::corpus::dictionary::packed::{self, Reader, Writer};
use crate::corpus::recording::Recording;
use crate::corpus::units::concatenation::largest_step;
use crate::corpus::units::features::{Extractor, Features};
use crate::corpus::units::settings::Settings;
use crate::error::{Error, Place, Result};
use crate::scene::positioned_file::PositionedFile;

/// The folder of what can be computed again.
const CACHE: &str = "cache";

/// What the first lines of files say. Another way to compute what is in them asks for another number.
const FEATURES: &str = "froufrou units 1";
const SOUND: &str = "froufrou filtered 2";

/// The file that tells which recordings are known.
const STAMPS: &str = "units.json";

/// What a recording was when it was last looked at.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Stamp {
    bytes: u64,
    modified_ns: u64,
    pub hash: String,
    pub rate_hz: u32,
}

/// What recordings were, so that those that did not change are not read again.
#[derive(Debug, Default)]
pub(super) struct Stamps {
    known: BTreeMap<String, Stamp>,
    used: BTreeMap<String, Stamp>,
}

impl Stamps {
    pub fn open(folder: &Path) -> Self {
        let read = std::fs::read(folder.join(CACHE).join(STAMPS)).ok();
        let known = read.and_then(|bytes| serde_json::from_slice(&bytes).ok());
        Self { known: known.unwrap_or_default(), used: BTreeMap::new() }
    }

    /// That of a recording, which is read if it has changed.
    pub fn of(&mut self, folder: &Path, name: &str) -> Result<Stamp> {
        let path = path_of(folder, name);
        let metadata = std::fs::metadata(&path).map_err(|e| Error::io("open", &path, e))?;
        let since = metadata.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
        let modified_ns = since.map_or(0, |since| since.as_nanos() as u64);
        let is_same = |stamp: &&Stamp| stamp.bytes == metadata.len() && stamp.modified_ns == modified_ns;
        let stamp = match self.known.get(name).filter(is_same) {
            Some(stamp) => stamp.clone(),
            None => {
                let recording = Recording::open(&path)?;
                let bytes = std::fs::read(&path).map_err(|e| Error::io("read", &path, e))?;
                let hash = packed::hash(&[&bytes]);
                Stamp { bytes: metadata.len(), modified_ns, hash, rate_hz: recording.rate_hz }
            }
        };
        self.used.insert(name.to_owned(), stamp.clone());
        Ok(stamp)
    }

    pub fn write(&self, folder: &Path) -> Result<()> {
        if self.used == self.known {
            return Ok(());
        }
        let text = serde_json::to_vec_pretty(&self.used);
        let text = text.map_err(|e| Error::new(format!("cannot write JSON: {e}")).because(e))?;
        write(&folder.join(CACHE).join(STAMPS), &text)
    }
}

/// A recording whose sound lies in the cache.
#[derive(Debug)]
pub(super) struct Cached {
    pub name: String,
    pub path: PathBuf,
    pub channels: usize,
    pub frames: usize,
    file: PositionedFile,
    file_path: PathBuf,
    /// The byte of the first sample.
    first: u64,
    /// The largest step of each channel.
    steps: Vec<f32>,
}

impl Cached {
    /// Reads one channel from a place on; silence before its beginning and after its end.
    pub fn read(&self, channel: usize, from: i64, samples: &mut [f32]) -> Result<()> {
        samples.fill(0.0);
        let skipped = usize::try_from(-from).unwrap_or(0).min(samples.len());
        let start = usize::try_from(from).unwrap_or(0).min(self.frames);
        let count = (samples.len() - skipped).min(self.frames - start);
        let mut bytes = vec![0; 4 * count];
        let place = self.first + 4 * (channel.min(self.channels - 1) * self.frames + start) as u64;
        let failed = |e| Error::io("read", &self.file_path, e);
        self.file.read_exact_at(&mut bytes, place).map_err(failed)?;
        for (sample, bytes) in samples[skipped..].iter_mut().zip(bytes.as_chunks::<4>().0) {
            *sample = f32::from_le_bytes(*bytes);
            if !sample.is_finite() {
                return Err(Error::new(format!("a sample is {sample}: the file is damaged"))
                    .in_file(&self.file_path)
                    .at(Place::Byte(place))
                    .help("delete the corpus's cache"));
            }
        }
        Ok(())
    }

    /// The farthest that two samples of a channel are apart that follow one another.
    pub fn largest_step(&self, channel: usize) -> f32 {
        self.steps[channel.min(self.steps.len() - 1)]
    }

    /// Opens the sound in the cache, unless it is missing or damaged.
    fn open(folder: &Path, name: &str, file_path: PathBuf) -> Option<Self> {
        let file = PositionedFile::open(&file_path).ok()?;
        let mut head = vec![0; SOUND.len() + 17];
        file.read_exact_at(&mut head, 0).ok()?;
        let numbers = head.strip_prefix(SOUND.as_bytes())?.strip_prefix(b"\n")?;
        let (numbers, _) = numbers.as_chunks::<8>();
        let channels = usize::try_from(u64::from_le_bytes(numbers[0])).ok()?;
        let frames = usize::try_from(u64::from_le_bytes(numbers[1])).ok()?;
        let numbers = (channels as u64).checked_mul((frames as u64).checked_add(1)?)?;
        let bytes = numbers.checked_mul(4)?.checked_add(head.len() as u64)?;
        if channels == 0 || bytes != file.length() {
            return None;
        }
        let mut steps = vec![0; 4 * channels];
        file.read_exact_at(&mut steps, head.len() as u64).ok()?;
        let steps: Vec<f32> =
            steps.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
        let (path, first) = (path_of(folder, name), (head.len() + 4 * channels) as u64);
        let is_whole = steps.iter().all(|step| step.is_finite() && *step >= 0.0);
        is_whole.then_some(Self {
            name: name.to_owned(),
            path,
            channels,
            frames,
            file,
            file_path,
            first,
            steps,
        })
    }
}

/// A recording's sound and the features of each of its channels, from the cache or computed anew.
pub(super) fn load(
    folder: &Path,
    name: &str,
    stamp: &Stamp,
    settings: &Settings,
    rate_hz: u32,
    extractor: &Extractor,
    told: &mut dyn FnMut(bool),
) -> Result<(Cached, Vec<Features>)> {
    let text = toml::to_string(&settings.features);
    let text = text.map_err(|e| Error::new(format!("cannot write TOML: {e}")).because(e))?;
    let (rate, high_pass) = (rate_hz.to_string(), settings.features.high_pass_hz.to_string());
    let key =
        |pieces: &[&str]| packed::hash(&pieces.iter().map(|piece| piece.as_bytes()).collect::<Vec<_>>());
    let in_cache = |name: String| folder.join(CACHE).join(name);
    let sound_path = in_cache(format!("{}.filtered", key(&[SOUND, &stamp.hash, &rate, &high_pass])));
    let features_path = in_cache(format!("{}.units", key(&[FEATURES, &stamp.hash, &rate, &text])));
    let sound = Cached::open(folder, name, sound_path.clone());
    let features = std::fs::read(&features_path).ok().and_then(|bytes| parse(&bytes).ok());
    if let (Some(sound), Some(features)) = (sound, features) {
        let units = extractor.units(sound.frames);
        let fits = |lane: &Features| lane.len() == units && lane.dimensions() == extractor.dimensions();
        if features.len() == sound.channels && features.iter().all(fits) {
            told(false);
            return Ok((sound, features));
        }
    }
    told(true);
    let path = path_of(folder, name);
    let recording = Recording::open(&path)?;
    let high_pass_hz = settings.features.high_pass_hz;
    let from_hz = recording.rate_hz;
    let channels = recording.channels.into_par_iter();
    let sounds: Vec<Result<Vec<f32>>> =
        channels.map(|channel| prepared(channel, from_hz, rate_hz, high_pass_hz)).collect();
    let sounds = sounds.into_iter().collect::<Result<Vec<_>>>().map_err(|e| e.in_file(&path))?;
    let features: Vec<Features> = sounds.iter().map(|sound| extractor.features(sound)).collect();
    let create = folder.join(CACHE);
    std::fs::create_dir_all(&create).map_err(|e| Error::io("create", create, e))?;
    write_sound(&sound_path, &sounds)?;
    write(&features_path, &text_of(&features)?)?;
    let damaged = || Error::new("what was written cannot be read again").in_file(&sound_path);
    let sound = Cached::open(folder, name, sound_path.clone()).ok_or_else(damaged)?;
    Ok((sound, features))
}

fn text_of(features: &[Features]) -> Result<Vec<u8>> {
    let mut writer = Writer::default();
    writer.number(features.len() as u64);
    for lane in features {
        writer.number(lane.dimensions() as u64);
        writer.number(lane.values().len() as u64);
        lane.values().iter().for_each(|value| writer.float(*value));
    }
    packed::seal(FEATURES, &writer.bytes, false)
}

fn parse(bytes: &[u8]) -> Result<Vec<Features>> {
    let content = packed::open(FEATURES, bytes, false)?;
    let mut reader = Reader::new(&content);
    let count = reader.count(2)?;
    let mut lanes = Vec::with_capacity(count);
    for _ in 0..count {
        let dimensions = reader.below(1 << 16, "the number of dimensions")?;
        let numbers = reader.count(4)?;
        let mut values = Vec::with_capacity(numbers);
        for _ in 0..numbers {
            values.push(reader.float()?);
        }
        lanes.push(Features::new(dimensions, values));
    }
    reader.end()?;
    Ok(lanes)
}

fn write_sound(path: &Path, sounds: &[Vec<f32>]) -> Result<()> {
    let failed = |e| Error::io("write", path, e);
    let mut file = std::io::BufWriter::with_capacity(1 << 20, WholeFile::create(path)?);
    let frames = sounds.first().map_or(0, Vec::len);
    file.write_all(format!("{SOUND}\n").as_bytes()).map_err(failed)?;
    for number in [sounds.len(), frames] {
        file.write_all(&(number as u64).to_le_bytes()).map_err(failed)?;
    }
    for sound in sounds {
        file.write_all(&largest_step(sound).to_le_bytes()).map_err(failed)?;
    }
    for sample in sounds.iter().flatten() {
        file.write_all(&sample.to_le_bytes()).map_err(failed)?;
    }
    file.into_inner().map_err(|e| failed(e.into_error()))?.finish()
}

/// Writes a file whole.
pub(super) fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut file = WholeFile::create(path)?;
    file.write_all(bytes).map_err(|e| Error::io("write", path, e))?;
    file.finish()
}
