//! A corpus of cloth on disk: a folder of ordinary recordings with one `corpus.toml`.
//!
//! What is computed of the recordings is kept in its folder `cache`, in files whose names say what they were computed
//! from. They may be deleted at any time: what is not there is computed anew.

use std::path::Path;

use serde::Serialize;

use super::clips::{self, Counts, Take};
use super::manifest::{FrictionSection, Manifest, PopsSection};
use super::motion::Motion;
use super::pops::{self, Pop};
use super::spectra::{FrictionSpectra, Spectrum};
use super::{ClothSound, Friction, PopEntry, PopSource};
use crate::corpus::dictionary::manifest::FILE_NAME;
use crate::corpus::dictionary::packed::{self, Reader, Writer};
use crate::corpus::dictionary::sinusoids::write;
use crate::corpus::files::{Files, cached, copy_all, double, of_channel, read_double, toml_of};
use crate::error::{Error, Place, Result};

/// What the first lines of files say. Another way to compute what is in them asks for another number.
const FRICTION: &str = "froufrou friction 1";
const POPS: &str = "froufrou pops 1";

/// What a build did.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Built {
    /// Files that were copied into the corpus.
    pub copied: Vec<String>,
    /// Sections that were computed, not found in the cache.
    pub computed: Vec<&'static str>,
    /// What each take of friction came to.
    pub takes: Vec<(String, Counts)>,
}

/// Makes a corpus of a folder with a `corpus.toml`: copies what that names, and computes what is not in the cache. Where both are
/// one folder, nothing is copied.
///
/// # Errors
/// A folder without a `corpus.toml`, recordings that cannot be read or give no friction or pops, or a corpus that cannot be written.
pub fn build(folder: &Path, corpus: &Path) -> Result<(ClothSound, Built)> {
    let manifest = Manifest::open(folder)?;
    let copied = copy_all(folder, corpus, &manifest.files())?;
    let mut built = Built { copied, computed: Vec::new(), takes: Vec::new() };
    let mut files = Files::new(corpus);
    if let Some(section) = &manifest.friction {
        let key = friction_key(section, &mut files)?;
        let made = match read_friction(&cached(corpus, &key)) {
            Some((_, counts)) => counts,
            None => {
                let (spectra, counts) = measure(section, &mut files)?;
                write(&cached(corpus, &key), &friction_bytes(&spectra, &counts)?)?;
                built.computed.push("friction");
                counts
            }
        };
        let names = section.take.iter().map(|take| take.recording.clone());
        built.takes = names.zip(made).collect();
    }
    if let Some(section) = &manifest.pops {
        let key = pops_key(section, &mut files)?;
        if read_pops(&cached(corpus, &key)).is_none() {
            let found = find_pops(section, &mut files)?;
            write(&cached(corpus, &key), &pops_bytes(&found)?)?;
            built.computed.push("pops");
        }
    }
    Ok((ClothSound::of(corpus, &manifest)?, built))
}

impl ClothSound {
    /// Opens a corpus. What is not in its cache is computed; nothing is written.
    ///
    /// # Errors
    /// Where there is no corpus, a file of it is missing or damaged, or it gives no friction or pops.
    pub fn open(corpus: &Path) -> Result<Self> {
        Self::of(corpus, &Manifest::open(corpus)?)
    }

    /// Opens a corpus whose `corpus.toml` is known.
    ///
    /// # Errors
    /// Those of [`ClothSound::open`].
    pub fn of(corpus: &Path, manifest: &Manifest) -> Result<Self> {
        let mut files = Files::new(corpus);
        let friction = match &manifest.friction {
            None => None,
            Some(section) => {
                let key = friction_key(section, &mut files)?;
                let spectra = match read_friction(&cached(corpus, &key)) {
                    Some((spectra, _)) => spectra,
                    None => measure(section, &mut files)?.0,
                };
                Some(Friction { spectra, area_m2: section.area_m2 })
            }
        };
        let (mut entries, mut samples) = (Vec::new(), Vec::new());
        if let Some(section) = &manifest.pops {
            let key = pops_key(section, &mut files)?;
            let found = match read_pops(&cached(corpus, &key)) {
                Some(found) if found.len() == section.recordings.len() => found,
                _ => find_pops(section, &mut files)?,
            };
            for (name, found) in section.recordings.iter().zip(found) {
                let (sound, rate_hz) = files.heard(name, section.channel, None)?;
                for pop in found {
                    let Some(inside) = sound.get(pop.range.clone()) else {
                        return Err(Error::new("a pop lies beyond the end of its recording")
                            .in_file(corpus.join(name))
                            .help("delete the folder `cache` of the corpus"));
                    };
                    let seconds = |n: usize| n as f64 / f64::from(rate_hz);
                    entries.push(PopEntry {
                        from: name.clone(),
                        begin_s: seconds(pop.range.start),
                        length_s: seconds(pop.range.len()),
                        energy: pop.energy,
                        lead_s: pop.lead_s,
                    });
                    samples.push((rate_hz, inside.to_vec()));
                }
            }
        }
        let own = corpus.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let name = manifest.name.clone().unwrap_or(own);
        Ok(Self { name, friction, pops: entries, source: PopSource::Recorded(samples) })
    }
}

/// The name of the file that has the spectra of a section.
fn friction_key(section: &FrictionSection, files: &mut Files<'_>) -> Result<String> {
    // How much cloth rubbed does not change what was measured.
    let section = FrictionSection { area_m2: 0.0, ..section.clone() };
    let mut hashes = vec![FRICTION.to_owned(), toml_of(&section)?];
    for take in &section.take {
        hashes.push(packed::hash(&[files.bytes(&take.recording)?]));
        if let Some(speeds) = &take.speeds {
            hashes.push(packed::hash(&[files.bytes(speeds)?]));
        }
    }
    let pieces: Vec<&[u8]> = hashes.iter().map(String::as_bytes).collect();
    Ok(format!("{}.friction", packed::hash(&pieces)))
}

fn pops_key(section: &PopsSection, files: &mut Files<'_>) -> Result<String> {
    let mut hashes = vec![POPS.to_owned(), toml_of(section)?];
    for name in &section.recordings {
        hashes.push(packed::hash(&[files.bytes(name)?]));
    }
    let pieces: Vec<&[u8]> = hashes.iter().map(String::as_bytes).collect();
    Ok(format!("{}.pops", packed::hash(&pieces)))
}

/// Measures the friction of a section.
fn measure(section: &FrictionSection, files: &mut Files<'_>) -> Result<(FrictionSpectra, Vec<Counts>)> {
    let mut takes = Vec::with_capacity(section.take.len());
    for entry in &section.take {
        let path = files.corpus.join(&entry.recording);
        let but = entry.encoder.map(|encoder| encoder.channel);
        let (samples, rate_hz) = files.heard(&entry.recording, entry.channel, but)?;
        let motion = if let Some(encoder) = entry.encoder {
            let pulses = of_channel(&files.decoded(&entry.recording)?, encoder.channel, &path)?;
            Motion::from_pulses(&pulses, f64::from(rate_hz), encoder.pulses_per_m)
                .map_err(|e| e.in_file(&path))?
        } else if let Some(speeds) = &entry.speeds {
            let track = files.corpus.join(speeds);
            Motion::parse(files.bytes(speeds)?).map_err(|e| e.in_file(track))?
        } else {
            Motion::Steady(entry.speed_mps.unwrap_or(0.0))
        };
        let name = entry.recording.clone();
        takes.push(Take { name, samples, rate_hz: f64::from(rate_hz), motion, seams: entry.seams() });
    }
    clips::measure(&takes, &section.gathering()).map_err(|e| e.in_file(files.corpus.join(FILE_NAME)))
}

/// Finds the pops of each recording of a section.
fn find_pops(section: &PopsSection, files: &mut Files<'_>) -> Result<Vec<Vec<Pop>>> {
    let energy = section.energy()?;
    let mut all = Vec::with_capacity(section.recordings.len());
    for name in &section.recordings {
        let (samples, rate_hz) = files.heard(name, section.channel, None)?;
        let rate_hz = f64::from(rate_hz);
        let threshold = energy.unwrap_or_else(|| pops::automatic_threshold(&samples, rate_hz));
        // A silent recording has none.
        let found = if threshold > 0.0 { pops::find(&samples, rate_hz, threshold)? } else { Vec::new() };
        all.push(found);
    }
    if all.iter().all(Vec::is_empty) {
        return Err(Error::new("the recordings have no pops")
            .in_file(files.corpus.join(FILE_NAME))
            .at(Place::Part("pops".to_owned()))
            .help("a lower `threshold` finds fainter ones; left out, it follows from each recording"));
    }
    Ok(all)
}

fn friction_bytes(spectra: &FrictionSpectra, counts: &[Counts]) -> Result<Vec<u8>> {
    let mut writer = Writer::default();
    writer.number(counts.len() as u64);
    for count in counts {
        [count.clips, count.seams, count.unknown].iter().for_each(|n| writer.number(*n as u64));
    }
    double(&mut writer, spectra.spacing_hz());
    writer.number(spectra.measured().len() as u64);
    for spectrum in spectra.measured() {
        double(&mut writer, spectrum.speed_mps);
        writer.number(spectrum.density.len() as u64);
        spectrum.density.iter().for_each(|value| double(&mut writer, *value));
    }
    packed::seal(FRICTION, &writer.bytes, false)
}

/// What is in the cache, unless it is missing or damaged.
fn read_friction(path: &Path) -> Option<(FrictionSpectra, Vec<Counts>)> {
    parse_friction(&std::fs::read(path).ok()?).ok()
}

fn parse_friction(bytes: &[u8]) -> Result<(FrictionSpectra, Vec<Counts>)> {
    let content = packed::open(FRICTION, bytes, false)?;
    let mut reader = Reader::new(&content);
    let mut counts = Vec::new();
    for _ in 0..reader.count(3)? {
        let mut number = || Ok::<_, Error>(reader.number()? as usize);
        counts.push(Counts { clips: number()?, seams: number()?, unknown: number()? });
    }
    let spacing_hz = read_double(&mut reader)?;
    let mut spectra = Vec::new();
    for _ in 0..reader.count(9)? {
        let speed_mps = read_double(&mut reader)?;
        let count = reader.count(8)?;
        let density = (0..count).map(|_| read_double(&mut reader)).collect::<Result<_>>()?;
        spectra.push(Spectrum { speed_mps, density });
    }
    reader.end()?;
    Ok((FrictionSpectra::new(spacing_hz, spectra)?, counts))
}

fn pops_bytes(all: &[Vec<Pop>]) -> Result<Vec<u8>> {
    let mut writer = Writer::default();
    writer.number(all.len() as u64);
    for found in all {
        writer.number(found.len() as u64);
        for pop in found {
            writer.number(pop.range.start as u64);
            writer.number(pop.range.len() as u64);
            double(&mut writer, pop.energy);
            double(&mut writer, pop.lead_s);
        }
    }
    packed::seal(POPS, &writer.bytes, false)
}

fn read_pops(path: &Path) -> Option<Vec<Vec<Pop>>> {
    parse_pops(&std::fs::read(path).ok()?).ok()
}

fn parse_pops(bytes: &[u8]) -> Result<Vec<Vec<Pop>>> {
    let content = packed::open(POPS, bytes, false)?;
    let mut reader = Reader::new(&content);
    let mut all = Vec::new();
    for _ in 0..reader.count(1)? {
        let mut found = Vec::new();
        for _ in 0..reader.count(18)? {
            let (start, length) = (reader.number()? as usize, reader.number()? as usize);
            let end = start.checked_add(length).ok_or_else(|| reader.fault("a pop has no end"))?;
            let (energy, lead_s) = (read_double(&mut reader)?, read_double(&mut reader)?);
            found.push(Pop { range: start..end, energy, lead_s });
        }
        all.push(found);
    }
    reader.end()?;
    Ok(all)
}

#[cfg(test)]
mod tests;
