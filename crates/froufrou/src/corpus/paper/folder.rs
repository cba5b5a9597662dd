//! A database of paper on disk: a folder of ordinary recordings with one `corpus.toml`.
//!
//! All that is computed of the recordings is kept in one file of its folder `cache`, whose name says what it was computed from.
//! It may be deleted at any time: what is not there is computed anew.

use std::path::Path;
use std::sync::Arc;

use serde::Serialize;

use super::manifest::{Entry, Manifest, Section};
use super::{ClipEntry, Clips, PaperSound, SpectrumEntry, measure};
use crate::corpus::dictionary::manifest::FILE_NAME;
use crate::corpus::dictionary::packed::{self, Reader, Writer};
use crate::corpus::dictionary::sinusoids::write;
use crate::corpus::files::{Files, cached, copy_all, double, read_double, toml_of};
use crate::corpus::units::high_pass::HighPass;
use crate::error::{Error, Place, Result};

/// What the first line of the cache says. Another way to compute what is in it asks for another number.
const KIND: &str = "froufrou paper 1";

/// What a build did.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Built {
    /// Files that were copied into the corpus.
    pub copied: Vec<String>,
    /// Whether clips and spectra were computed, and not found in the cache.
    pub computed: bool,
}

/// What is computed of the recordings.
#[derive(Debug, Clone, PartialEq)]
struct Made {
    clips: Vec<MadeClip>,
    densities: Vec<Vec<f64>>,
}

#[derive(Debug, Clone, PartialEq)]
struct MadeClip {
    rate_hz: u32,
    begin_s: f64,
    lead_s: f64,
    samples: Vec<f32>,
}

/// Makes a database of a folder with a `corpus.toml`: copies what that names, and computes what is not in the cache. Where
/// both are one folder, nothing is copied.
///
/// # Errors
/// A folder without such a file, recordings that cannot be read or are silent, or a database that cannot be written.
pub fn build(folder: &Path, corpus: &Path) -> Result<(PaperSound, Built)> {
    let manifest = Manifest::open(folder)?;
    let copied = copy_all(folder, corpus, &manifest.files())?;
    let mut files = Files::new(corpus);
    let path = cached(corpus, &key(&manifest.paper, &mut files)?);
    let (made, computed) = match read(&path, &manifest.paper) {
        Some(made) => (made, false),
        None => {
            let made = compute(&manifest.paper, &mut files)?;
            write(&path, &bytes(&made)?)?;
            (made, true)
        }
    };
    Ok((assembled(corpus, &manifest, made)?, Built { copied, computed }))
}

impl PaperSound {
    /// Opens a database. What is not in its cache is computed; nothing is written.
    ///
    /// # Errors
    /// Where there is no database, a file of it is missing or damaged, or a part of a recording is silent.
    pub fn open(corpus: &Path) -> Result<Self> {
        let manifest = Manifest::open(corpus)?;
        let mut files = Files::new(corpus);
        let key = key(&manifest.paper, &mut files)?;
        let made = match read(&cached(corpus, &key), &manifest.paper) {
            Some(made) => made,
            None => compute(&manifest.paper, &mut files)?,
        };
        assembled(corpus, &manifest, made)
    }
}

fn assembled(corpus: &Path, manifest: &Manifest, made: Made) -> Result<PaperSound> {
    let own = corpus.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let name = manifest.name.clone().unwrap_or(own);
    let (mut clips, mut samples) = (Vec::new(), Vec::new());
    for (entry, made) in manifest.paper.clip.iter().zip(made.clips) {
        let (ruling_m, border_m) = entry.get_ref().size_m();
        clips.push(ClipEntry {
            ruling_m,
            border_m,
            from: entry.get_ref().recording.clone(),
            begin_s: made.begin_s,
            length_s: made.samples.len() as f64 / f64::from(made.rate_hz),
            lead_s: made.lead_s,
        });
        samples.push((made.rate_hz, Arc::from(made.samples)));
    }
    let spectra = manifest.paper.friction.iter().zip(made.densities).map(|(entry, density)| {
        let (ruling_m, border_m) = entry.get_ref().size_m();
        SpectrumEntry { ruling_m, border_m, from: entry.get_ref().recording.clone(), density }
    });
    let spectra = spectra.collect();
    Ok(PaperSound::new(name, clips, spectra, Clips::Recorded(samples), manifest.paper.tears()?))
}

/// The name of the file that has what was computed.
fn key(section: &Section, files: &mut Files<'_>) -> Result<String> {
    let mut hashes = vec![KIND.to_owned(), format!("{:?}", section.high_pass_hz)];
    for (list, entries) in [("clip", &section.clip), ("friction", &section.friction)] {
        hashes.push(list.to_owned());
        for entry in entries {
            let entry = entry.get_ref();
            // Its size does not change what it sounds like.
            let heard = Entry { ruling_m: None, border_m: None, constrained: true, ..entry.clone() };
            hashes.push(toml_of(&heard)?);
            hashes.push(packed::hash(&[files.bytes(&entry.recording)?]));
        }
    }
    let pieces: Vec<&[u8]> = hashes.iter().map(String::as_bytes).collect();
    Ok(format!("{}.paper", packed::hash(&pieces)))
}

fn compute(section: &Section, files: &mut Files<'_>) -> Result<Made> {
    let mut made = Made { clips: Vec::new(), densities: Vec::new() };
    let mut last = Heard::default();
    for entry in &section.clip {
        let entry = entry.get_ref();
        let part = last.part(entry, section.high_pass_hz, files)?;
        let rate_hz = last.rate_hz;
        let cut = measure::trimmed(&last.samples[part.clone()], f64::from(rate_hz))
            .map_err(|e| in_entry(e, entry, files.corpus))?;
        made.clips.push(MadeClip {
            rate_hz,
            begin_s: (part.start + cut.first) as f64 / f64::from(rate_hz),
            lead_s: cut.lead_s,
            samples: cut.samples,
        });
    }
    for entry in &section.friction {
        let entry = entry.get_ref();
        let part = last.part(entry, section.high_pass_hz, files)?;
        let rate_hz = f64::from(last.rate_hz);
        let density = measure::density(&last.samples[part], rate_hz, entry.speed_mps.unwrap_or(1.0))
            .map_err(|e| in_entry(e, entry, files.corpus))?;
        made.densities.push(density);
    }
    Ok(made)
}

/// Says which part of which recording a fault is of.
fn in_entry(fault: Error, entry: &Entry, corpus: &Path) -> Error {
    let from_s = entry.from_s.unwrap_or(0.0);
    fault.in_file(corpus.join(&entry.recording)).at(Place::Part(format!("from {from_s} s")))
}

/// The channel of a recording that was heard last, after the high-pass: many clips are cut from one.
#[derive(Default)]
struct Heard {
    of: Option<(String, Option<usize>)>,
    samples: Vec<f32>,
    rate_hz: u32,
}

impl Heard {
    /// The samples of a part of a recording.
    fn part(
        &mut self,
        entry: &Entry,
        high_pass_hz: f64,
        files: &mut Files<'_>,
    ) -> Result<std::ops::Range<usize>> {
        let of = Some((entry.recording.clone(), entry.channel));
        if self.of != of {
            (self.samples, self.rate_hz) = files.heard(&entry.recording, entry.channel, None)?;
            HighPass::new(high_pass_hz, self.rate_hz)?.process(&mut self.samples);
            self.of = of;
        }
        let rate_hz = f64::from(self.rate_hz);
        let at = |s: f64| ((s * rate_hz).round() as usize).min(self.samples.len());
        let part = at(entry.from_s.unwrap_or(0.0))..at(entry.to_s.unwrap_or(f64::INFINITY));
        if part.is_empty() {
            let length_s = self.samples.len() as f64 / rate_hz;
            let fault = Error::new(format!("the part is empty: the recording is {length_s:.3} s long"));
            return Err(in_entry(fault, entry, files.corpus)
                .help(format!("see from_s and to_s in {}", files.corpus.join(FILE_NAME).display())));
        }
        Ok(part)
    }
}

fn bytes(made: &Made) -> Result<Vec<u8>> {
    let mut writer = Writer::default();
    writer.number(made.clips.len() as u64);
    for clip in &made.clips {
        writer.number(u64::from(clip.rate_hz));
        double(&mut writer, clip.begin_s);
        double(&mut writer, clip.lead_s);
        writer.number(clip.samples.len() as u64);
        clip.samples.iter().for_each(|sample| writer.float(*sample));
    }
    writer.number(made.densities.len() as u64);
    for density in &made.densities {
        writer.number(density.len() as u64);
        density.iter().for_each(|value| double(&mut writer, *value));
    }
    packed::seal(KIND, &writer.bytes, false)
}

/// What is in the cache, unless it is missing or damaged.
fn read(path: &Path, section: &Section) -> Option<Made> {
    let made = parse(&std::fs::read(path).ok()?).ok()?;
    let fits = made.clips.len() == section.clip.len() && made.densities.len() == section.friction.len();
    fits.then_some(made)
}

fn parse(bytes: &[u8]) -> Result<Made> {
    let content = packed::open(KIND, bytes, false)?;
    let mut reader = Reader::new(&content);
    let mut made = Made { clips: Vec::new(), densities: Vec::new() };
    for _ in 0..reader.count(18)? {
        let rate_hz = u32::try_from(reader.number()?).map_err(|_| reader.fault("a rate is too high"))?;
        let (begin_s, lead_s) = (read_double(&mut reader)?, read_double(&mut reader)?);
        let count = reader.count(4)?;
        let samples = (0..count).map(|_| reader.float()).collect::<Result<_>>()?;
        made.clips.push(MadeClip { rate_hz, begin_s, lead_s, samples });
    }
    for _ in 0..reader.count(1)? {
        let count = reader.count(8)?;
        made.densities.push((0..count).map(|_| read_double(&mut reader)).collect::<Result<_>>()?);
    }
    reader.end()?;
    Ok(made)
}

#[cfg(test)]
mod tests;
