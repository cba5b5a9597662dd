//! What a corpus of units has, without computing any.

use std::path::Path;

use serde::Serialize;

use super::manifest::{names, settings};
use super::path_of;
use crate::corpus::dictionary::prepare;
use crate::corpus::recording::Recording;
use crate::corpus::units::settings::{Channels, Settings};
use crate::error::{Error, Result};

/// What a corpus has.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Survey {
    /// Samples a second.
    pub rate_hz: u32,
    /// Samples of a unit.
    pub unit_samples: usize,
    /// Units of all recordings.
    pub units: usize,
    /// How long its recordings last together, in seconds.
    pub duration_s: f64,
    /// Its table `[units]`.
    pub settings: Settings,
    /// Its recordings, by their names.
    pub recordings: Vec<Surveyed>,
}

/// A recording of a corpus.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Surveyed {
    /// Its path from the corpus's folder.
    pub name: String,
    /// Samples a second, in its file.
    pub rate_hz: u32,
    /// How many channels it has.
    pub channels: usize,
    /// Its length in seconds.
    pub duration_s: f64,
    /// How many units it has, in all channels unless these belong together.
    pub units: usize,
}

/// Looks at a corpus and its recordings, and writes nothing.
///
/// # Errors
/// Those of [`settings`], no recordings, or one that cannot be read.
pub fn survey(folder: &Path) -> Result<Survey> {
    let settings = settings(folder)?;
    let mut recordings = Vec::new();
    let mut frames = Vec::new();
    for name in names(folder, &settings)? {
        let recording = Recording::open(path_of(folder, &name))?;
        frames.push(recording.frames());
        recordings.push(Surveyed {
            name,
            rate_hz: recording.rate_hz,
            channels: recording.channels.len(),
            duration_s: recording.duration_s(),
            units: 0,
        });
    }
    let commonest = || prepare::commonest(recordings.iter().map(|recording| recording.rate_hz));
    let rate_hz = settings
        .rate_hz
        .or_else(commonest)
        .ok_or_else(|| Error::new("the corpus has no recordings").in_file(folder))?;
    let unit_samples = settings.features.unit_samples(rate_hz);
    for (recording, frames) in recordings.iter_mut().zip(frames) {
        let streams = if settings.features.channels == Channels::Joint { 1 } else { recording.channels };
        let length = prepare::length_at_rate(frames, recording.rate_hz, rate_hz);
        recording.units = streams * length.div_ceil(unit_samples.max(1));
    }
    Ok(Survey {
        rate_hz,
        unit_samples,
        units: recordings.iter().map(|recording| recording.units).sum(),
        duration_s: recordings.iter().map(|recording| recording.duration_s).sum(),
        settings,
        recordings,
    })
}
