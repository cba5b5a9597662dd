//! What is in a corpus of grains: its recordings, what they are, and what it weighs.

use std::path::{Path, PathBuf};

use froufrou::Result;
use froufrou::corpus::dictionary::manifest::{FILE_NAME, Manifest, Storage};
use froufrou::corpus::dictionary::{Dictionary, Recording};
use serde::Serialize;

use super::Findings;
use super::sheet::Sheet;

#[derive(Serialize)]
pub struct CorpusFindings {
    #[serde(flatten)]
    manifest: Manifest,
    lengths: Vec<Length>,
}

/// What a recording came to.
#[derive(Serialize)]
struct Length {
    name: String,
    duration_s: f64,
    grains: usize,
    places: usize,
}

/// The folder of a corpus, where a file or folder is one.
pub fn folder(file: &Path) -> Option<PathBuf> {
    if file.is_dir() && file.join(FILE_NAME).exists() {
        return Some(file.to_owned());
    }
    let is_manifest = file.file_name().is_some_and(|name| name == FILE_NAME) && file.is_file();
    is_manifest.then(|| file.parent().map_or_else(PathBuf::new, Path::to_owned))
}

/// Reads all of it.
pub fn read(folder: &Path) -> Result<CorpusFindings> {
    let manifest = Manifest::open(folder)?;
    let dictionary = Dictionary::of(folder, &manifest)?;
    let length = |recording: &Recording| Length {
        name: recording.name.clone(),
        duration_s: recording.length as f64 / f64::from(manifest.rate_hz),
        grains: recording.grains.len(),
        places: recording.pattern.len(),
    };
    let lengths = dictionary.recordings().iter().map(length).collect();
    Ok(CorpusFindings { manifest, lengths })
}

/// What a corpus is and weighs.
pub fn facts(manifest: &Manifest, sheet: &mut Sheet) {
    let weight = manifest.weight;
    let bytes = |bytes: u64| match bytes {
        0..100_000 => format!("{:.1} kB", bytes as f64 / 1e3),
        _ => format!("{:.2} MB", bytes as f64 / 1e6),
    };
    let whole = weight.audio_bytes + weight.patterns_bytes;
    let share = |of: u64| 100.0 * (1.0 - whole as f64 / of.max(1) as f64);
    let times = |of: u64| of as f64 / whole.max(1) as f64;
    sheet
        .fact("kind", "corpus of grains")
        .fact("rate", format!("{} Hz", manifest.rate_hz))
        .fact("recordings", manifest.recording.len())
        .fact("grains", format!("{}, {} of which share another's sound", weight.grains, weight.shared_grains))
        .fact(
            "originals",
            format!(
                "{} in 16 bits, {} in one channel at this rate",
                bytes(weight.originals_bytes),
                bytes(weight.mono_bytes)
            ),
        );
    if manifest.storage != Storage::None {
        sheet
            .fact(
                "stored",
                format!("{} of sound, {} of patterns", bytes(weight.audio_bytes), bytes(weight.patterns_bytes)),
            )
            .fact(
                "smaller",
                format!(
                    "by {:.0} % ({:.1} times) than in one channel, by {:.0} % ({:.1} times) than the originals",
                    share(weight.mono_bytes),
                    times(weight.mono_bytes),
                    share(weight.originals_bytes),
                    times(weight.originals_bytes)
                ),
            );
    }
    sheet.fact_if("what is lost", weight.error_db.map(|db| format!("{db:.1} dB below the sound")));
}

impl Findings for CorpusFindings {
    const KIND: &'static str = "corpus";

    fn sheet(&self) -> Sheet {
        let mut sheet = Sheet::default();
        facts(&self.manifest, &mut sheet);
        let word = |value: &dyn std::fmt::Debug| format!("{value:?}").to_lowercase();
        let row = |(listed, length): (&froufrou::corpus::dictionary::manifest::Listed, &Length)| {
            vec![
                listed.name.clone(),
                word(&listed.action),
                word(&listed.labelled_by),
                format!("{:.2} s", length.duration_s),
                length.grains.to_string(),
                length.places.to_string(),
            ]
        };
        let rows = self.manifest.recording.iter().zip(&self.lengths).map(row);
        sheet.table(&["recording", "action", "said by", "length", "grains", "places"], rows);
        sheet
    }
}
