//! What a build computed, by what it was computed from.

use std::collections::BTreeMap;
use std::path::Path;

use crate::corpus::dictionary::manifest::Listed;
use crate::corpus::dictionary::packed::{self, Reader, Writer};
use crate::corpus::dictionary::prepare::Prepared;
use crate::corpus::dictionary::sinusoids::{CACHE, write};
use crate::corpus::dictionary::{Settings, index};
use crate::corpus::grains::patterns::Peak;
use crate::corpus::grains::{Contact, Segment};
use crate::corpus::recording::Recording;
use crate::error::{Error, Result};
use crate::render::flac;

/// What the first lines of files say. Another way to compute what is in them asks for another number.
const CUT: &str = "froufrou cut 2";
const PAIRS: &str = "froufrou pairs 1";

fn toml_of(value: &impl serde::Serialize) -> Result<String> {
    toml::to_string(value).map_err(|e| Error::new(format!("cannot write TOML: {e}")).because(e))
}

/// What names all that cutting a recording depends on.
pub(super) fn key(listed: &Listed, rate_hz: u32, settings: &Settings) -> Result<String> {
    let (extraction, spectral) = (toml_of(&settings.extraction)?, toml_of(&settings.spectral)?);
    let contact = format!("{:?}", listed.contact);
    let rate = rate_hz.to_string();
    Ok(packed::hash(&[CUT, &listed.hash, &rate, &extraction, &spectral, &contact].map(str::as_bytes)))
}

/// A recording as it was prepared and cut.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Analysis {
    pub prepared: Prepared,
    /// None before it is cut.
    pub segments: Option<Vec<Segment>>,
}

impl Analysis {
    pub fn name(key: &str) -> String {
        format!("{key}.cut")
    }

    /// What is in the cache, unless it is missing or damaged.
    pub fn read(corpus: &Path, key: &str, contact: Contact) -> Option<Self> {
        let path = corpus.join(CACHE).join(Self::name(key));
        Self::parse(&std::fs::read(path).ok()?, contact).ok()
    }

    fn parse(bytes: &[u8], contact: Contact) -> Result<Self> {
        let content = packed::open(CUT, bytes, false)?;
        let mut reader = Reader::new(&content);
        let halvings = reader.number()?;
        let halvings = u32::try_from(halvings).ok().filter(|times| *times <= f32::MAX_EXP as u32);
        let halvings = halvings.ok_or_else(|| Error::new("sound is not halved so often"))?;
        let original_bytes = reader.number()?;
        let mut double = || {
            let bits = reader.take(8)?.iter().rev().fold(0, |bits, byte| bits << 8 | u64::from(*byte));
            Ok::<f64, Error>(f64::from_bits(bits))
        };
        let (energy, lost) = (double()?, double()?);
        let size = reader.count(1)?;
        let flac = Recording::decode(reader.take(size)?, "the cache")?;
        let samples = flac
            .channels
            .first()
            .map_or_else(Vec::new, |channel| channel.iter().map(|v| (v * 32_768.0).round() as i16).collect());
        let size = reader.count(1)?;
        let items = index::read(reader.take(size)?, &[contact])?;
        reader.end()?;
        let item = items.into_iter().next().filter(|item| item.length == samples.len());
        let segments = item.map(|item| item.segments);
        Ok(Self { prepared: Prepared { samples, halvings, original_bytes, energy, lost }, segments })
    }

    pub fn write(&self, corpus: &Path, key: &str, rate_hz: u32, contact: Contact) -> Result<()> {
        let prepared = &self.prepared;
        let mut writer = Writer::default();
        writer.number(u64::from(prepared.halvings));
        writer.number(prepared.original_bytes);
        for value in [prepared.energy, prepared.lost] {
            writer.bytes.extend_from_slice(&value.to_bits().to_le_bytes());
        }
        let flac = flac::encode_mono(&prepared.samples, rate_hz)?;
        let segments = self.segments.clone().unwrap_or_default();
        let item = index::Item { length: prepared.samples.len(), segments, ..index::Item::default() };
        for piece in [flac, index::write(&[item], &[contact])?] {
            writer.number(piece.len() as u64);
            writer.bytes.extend_from_slice(&piece);
        }
        write(&corpus.join(CACHE).join(Self::name(key)), &packed::seal(CUT, &writer.bytes, false)?)
    }
}

/// Peaks in one recording, of the grains of each recording, numbered from its first.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Pairs(BTreeMap<String, Vec<Peak>>);

impl Pairs {
    pub fn name(key: &str, settings: &Settings) -> Result<String> {
        let matching = toml_of(&settings.matching)?;
        Ok(format!("{}.pairs", packed::hash(&[PAIRS.as_bytes(), key.as_bytes(), matching.as_bytes()])))
    }

    /// What is in the cache; nothing where it is missing or damaged.
    pub fn read(corpus: &Path, key: &str, settings: &Settings) -> Result<Self> {
        let path = corpus.join(CACHE).join(Self::name(key, settings)?);
        let parsed = std::fs::read(path).ok().and_then(|bytes| Self::parse(&bytes).ok());
        Ok(parsed.unwrap_or_default())
    }

    fn parse(bytes: &[u8]) -> Result<Self> {
        let content = packed::open(PAIRS, bytes, false)?;
        let mut reader = Reader::new(&content);
        let count = reader.count(33)?;
        let mut all = BTreeMap::new();
        for _ in 0..count {
            let key = String::from_utf8_lossy(reader.take(32)?).into_owned();
            let number = reader.count(6)?;
            let mut peaks = Vec::with_capacity(number);
            for _ in 0..number {
                let grain = reader.below(u32::MAX as usize, "the number of a grain")? as u32;
                peaks.push(Peak { grain, start: reader.number()?, correlation: reader.float()? });
            }
            all.insert(key, peaks);
        }
        reader.end()?;
        Ok(Self(all))
    }

    pub fn write(&self, corpus: &Path, key: &str, settings: &Settings) -> Result<()> {
        let mut writer = Writer::default();
        writer.number(self.0.len() as u64);
        for (key, peaks) in &self.0 {
            writer.bytes.extend_from_slice(key.as_bytes());
            writer.number(peaks.len() as u64);
            for peak in peaks {
                writer.number(u64::from(peak.grain));
                writer.number(peak.start);
                writer.float(peak.correlation);
            }
        }
        let path = corpus.join(CACHE).join(Self::name(key, settings)?);
        write(&path, &packed::seal(PAIRS, &writer.bytes, false)?)
    }

    /// True where the grains of a recording are matched.
    pub fn has(&self, key: &str) -> bool {
        self.0.contains_key(key)
    }

    pub fn add(&mut self, key: &str, peaks: Vec<Peak>) {
        self.0.insert(key.to_owned(), peaks);
    }

    /// Forgets all recordings but these.
    pub fn keep(&mut self, keys: &[String]) {
        self.0.retain(|key, _| keys.contains(key));
    }

    pub fn of(&self, key: &str) -> &[Peak] {
        self.0.get(key).map_or(&[], Vec::as_slice)
    }
}
