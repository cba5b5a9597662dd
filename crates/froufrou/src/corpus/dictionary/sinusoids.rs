//! Splits of continuous recordings, kept beside a corpus so that it opens at once.
//!
//! What rings in a noisy recording takes more bytes as partials than as samples: some hundred of them, 345 times a
//! second, three numbers each. So a corpus ships the sound alone, from which the split follows, and whoever opens it
//! may keep the split in the cache.

use std::path::{Path, PathBuf};

use super::packed;
use super::{Part, Settings, prepare};
use crate::WholeFile;
use crate::corpus::grains::{Contact, GrainKind};
use crate::error::{Error, Result};

/// The folder of what can be computed again.
pub(in crate::corpus) const CACHE: &str = "cache";

/// What the first line of a file says.
const KIND: &str = "froufrou sinusoids 1";

/// The name of the file that has the split of a sound.
pub(super) fn name(samples: &[f32], rate_hz: u32, settings: &Settings) -> Result<String> {
    let model = toml::to_string(&settings.spectral);
    let model = model.map_err(|e| Error::new(format!("cannot write TOML: {e}")).because(e))?;
    let bytes: Vec<u8> = samples.iter().flat_map(|v| v.to_le_bytes()).collect();
    let hash = packed::hash(&[KIND.as_bytes(), &bytes, &rate_hz.to_le_bytes(), model.as_bytes()]);
    Ok(format!("{hash}.sinusoids"))
}

/// The parts of a sound. Those of a continuous one come from the cache of a corpus, if they are there.
pub(super) fn parts(
    corpus: &Path,
    samples: Vec<f32>,
    rate_hz: u32,
    contact: Contact,
    settings: &Settings,
) -> Result<Vec<Part>> {
    if contact == Contact::Impulsive {
        return prepare::parts(samples, rate_hz, contact, settings);
    }
    let path = corpus.join(CACHE).join(name(&samples, rate_hz, settings)?);
    match cached(&path, samples.len()) {
        Some(sinusoids) => {
            let residual = samples.iter().zip(&sinusoids).map(|(whole, part)| whole - part).collect();
            Ok(vec![
                Part { kind: GrainKind::Sinusoidal, samples: sinusoids },
                Part { kind: GrainKind::Transient, samples: residual },
            ])
        }
        None => prepare::parts(samples, rate_hz, contact, settings),
    }
}

/// As [`parts`], and the cache has them afterwards; also the name of its file.
pub(super) fn kept_parts(
    corpus: &Path,
    samples: Vec<f32>,
    rate_hz: u32,
    contact: Contact,
    settings: &Settings,
) -> Result<(Vec<Part>, Option<String>)> {
    if contact == Contact::Impulsive {
        return Ok((prepare::parts(samples, rate_hz, contact, settings)?, None));
    }
    let name = name(&samples, rate_hz, settings)?;
    let path = corpus.join(CACHE).join(&name);
    let is_cached = path.exists();
    let length = samples.len();
    let parts = parts(corpus, samples, rate_hz, contact, settings)?;
    if !is_cached || cached(&path, length).is_none() {
        let bytes: Vec<u8> = parts[0].samples.iter().flat_map(|v| v.to_le_bytes()).collect();
        write(&path, &packed::seal(KIND, &bytes, false)?)?;
    }
    Ok((parts, Some(name)))
}

/// The sinusoids in a file of the cache, unless it is missing or damaged.
fn cached(path: &PathBuf, length: usize) -> Option<Vec<f32>> {
    let wanted = 4 * length as u64 + 64;
    if std::fs::metadata(path).ok()?.len() > wanted {
        return None;
    }
    let content = packed::open(KIND, &std::fs::read(path).ok()?, false).ok()?;
    let samples: Vec<f32> = content.as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b)).collect();
    (samples.len() == length && samples.iter().all(|v| v.is_finite())).then_some(samples)
}

/// Writes a file whole.
pub(in crate::corpus) fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    use std::io::Write;
    let mut file = WholeFile::create(path)?;
    file.write_all(bytes).map_err(|e| Error::io("write", path, e))?;
    file.finish()
}
