//! What corpora on disk share: their files, each read once, and what their caches are made of.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use serde::Serialize;

use super::dictionary::manifest::FILE_NAME;
use super::dictionary::packed::{Reader, Writer};
use super::dictionary::sinusoids::{CACHE, write};
use super::recording::Recording;
use crate::error::{Error, Place, Result};

/// The most bytes of a `corpus.toml`.
pub const MOST_BYTES: u64 = 64 << 20;

/// The text of a corpus's `corpus.toml`.
///
/// # Errors
/// Where there is no corpus, or the file is too large or no text.
pub fn manifest_text(corpus: &Path, help: &str) -> Result<String> {
    let path = corpus.join(FILE_NAME);
    let metadata = std::fs::metadata(&path).map_err(|e| Error::io("open", &path, e).help(help))?;
    if metadata.len() > MOST_BYTES {
        return Err(Error::new(format!("the file has more than {MOST_BYTES} bytes")).in_file(path));
    }
    let bytes = std::fs::read(&path).map_err(|e| Error::io("read", &path, e))?;
    String::from_utf8(bytes).map_err(|e| {
        let at = Place::Byte(e.utf8_error().valid_up_to() as u64);
        Error::new("expected text in UTF-8").in_file(&path).at(at)
    })
}

/// Whether the `corpus.toml` of a folder has one of some sections.
pub fn has_section(corpus: &Path, sections: &[&str]) -> bool {
    let path = corpus.join(FILE_NAME);
    let is_small = std::fs::metadata(&path).is_ok_and(|metadata| metadata.len() <= MOST_BYTES);
    let text = if is_small { std::fs::read_to_string(path).unwrap_or_default() } else { String::new() };
    let table: toml::Table = text.parse().unwrap_or_default();
    sections.iter().any(|section| table.contains_key(*section))
}

/// Refuses a name of a file that does not lie within a corpus.
///
/// # Errors
/// Such a name.
pub fn check_inside(file: &str) -> Result<()> {
    if file.is_empty() || !Path::new(file).components().all(|part| matches!(part, Component::Normal(_))) {
        return Err(Error::new(format!("{file:?} is not the name of a file within the corpus")));
    }
    Ok(())
}

/// Copies the files of a corpus and then its `corpus.toml`, unless both are one folder, and makes its cache; the names of
/// those that were not there.
///
/// # Errors
/// Files that cannot be read or written.
pub fn copy_all(folder: &Path, corpus: &Path, files: &[&str]) -> Result<Vec<String>> {
    let mut copied = Vec::new();
    std::fs::create_dir_all(corpus).map_err(|e| Error::io("make", corpus, e))?;
    let is_one = matches!((folder.canonicalize(), corpus.canonicalize()), (Ok(a), Ok(b)) if a == b);
    if !is_one {
        for name in files {
            if copy(&folder.join(name), &corpus.join(name))? {
                copied.push((*name).to_owned());
            }
        }
        // Last, so that a corpus that is there is whole.
        copy(&folder.join(FILE_NAME), &corpus.join(FILE_NAME))?;
    }
    std::fs::create_dir_all(corpus.join(CACHE)).map_err(|e| Error::io("make", corpus.join(CACHE), e))?;
    Ok(copied)
}

/// Copies a file whole or not at all, unless it is there already; whether it was not.
fn copy(from: &Path, to: &Path) -> Result<bool> {
    let bytes = std::fs::read(from).map_err(|e| Error::io("read", from, e))?;
    if std::fs::metadata(to).is_ok_and(|m| m.len() == bytes.len() as u64)
        && std::fs::read(to).is_ok_and(|there| there == bytes)
    {
        return Ok(false);
    }
    if let Some(folder) = to.parent() {
        std::fs::create_dir_all(folder).map_err(|e| Error::io("make", folder, e))?;
    }
    write(to, &bytes)?;
    Ok(true)
}

/// The files of a corpus, each read once.
pub struct Files<'a> {
    pub corpus: &'a Path,
    bytes: BTreeMap<String, Vec<u8>>,
}

impl<'a> Files<'a> {
    /// None has been read yet.
    pub fn new(corpus: &'a Path) -> Self {
        Self { corpus, bytes: BTreeMap::new() }
    }

    /// The content of one.
    pub fn bytes(&mut self, name: &str) -> Result<&[u8]> {
        if !self.bytes.contains_key(name) {
            let path = self.corpus.join(name);
            let metadata = std::fs::metadata(&path).map_err(|e| Error::io("open", &path, e))?;
            if !metadata.is_file() {
                return Err(Error::new("expected a file").in_file(path));
            }
            let bytes = std::fs::read(&path).map_err(|e| Error::io("read", &path, e))?;
            self.bytes.insert(name.to_owned(), bytes);
        }
        Ok(self.bytes.get(name).map_or(&[], Vec::as_slice))
    }

    /// One as a recording.
    pub fn decoded(&mut self, name: &str) -> Result<Recording> {
        let path = self.corpus.join(name);
        Recording::decode(self.bytes(name)?, &path.to_string_lossy())
    }

    /// What is heard of a recording: one channel, or the average of all but one.
    pub fn heard(
        &mut self,
        name: &str,
        channel: Option<usize>,
        but: Option<usize>,
    ) -> Result<(Vec<f32>, u32)> {
        let path = self.corpus.join(name);
        let recording = self.decoded(name)?;
        let heard = match (channel, but) {
            (Some(channel), _) => of_channel(&recording, channel, &path)?,
            (None, None) => recording.mono(),
            (None, Some(but)) => {
                let others = recording.channels.into_iter().enumerate().filter(|(n, _)| *n != but);
                let channels: Vec<Vec<f32>> = others.map(|(_, channel)| channel).collect();
                if channels.is_empty() {
                    return Err(Error::new("the recording has no channel but the encoder's").in_file(path));
                }
                let rate_hz = recording.rate_hz;
                return Ok((Recording { rate_hz, channels }.mono(), rate_hz));
            }
        };
        Ok((heard, recording.rate_hz))
    }
}

/// One channel of a recording.
pub fn of_channel(recording: &Recording, channel: usize, path: &Path) -> Result<Vec<f32>> {
    recording.channel(channel).map(<[f32]>::to_vec).ok_or_else(|| {
        let count = recording.channels.len();
        Error::new(format!("there is no channel {channel}: the recording has {count}"))
            .in_file(path)
            .help("channels are counted from 0")
    })
}

/// A file of a corpus's cache.
pub fn cached(corpus: &Path, key: &str) -> PathBuf {
    corpus.join(CACHE).join(key)
}

/// A value as TOML, to tell whether it changed.
pub fn toml_of(value: &impl Serialize) -> Result<String> {
    toml::to_string(value).map_err(|e| Error::new(format!("cannot write TOML: {e}")).because(e))
}

/// Writes a number to its last bit.
pub fn double(writer: &mut Writer, value: f64) {
    writer.bytes.extend_from_slice(&value.to_bits().to_le_bytes());
}

/// Reads one.
pub fn read_double(reader: &mut Reader<'_>) -> Result<f64> {
    let bits = reader.take(8)?.iter().rev().fold(0, |bits, byte| bits << 8 | u64::from(*byte));
    Ok(f64::from_bits(bits))
}
