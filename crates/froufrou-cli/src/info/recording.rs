//! What is in an audio file: rate, channels, length and levels.

use std::path::Path;

use froufrou::Result;
use froufrou::corpus::recording::Recording;
use froufrou::render::meter::{Meter, Report};
use serde::Serialize;

use super::Findings;
use super::sheet::{Sheet, number};
use crate::plot::length;

/// Frames that are measured at a time.
const BLOCK_FRAMES: usize = 4096;

#[derive(Serialize)]
pub struct RecordingFindings {
    format: &'static str,
    rate_hz: u32,
    channels: usize,
    duration_s: f64,
    #[serde(flatten)]
    levels: Report,
}

pub fn read(file: &Path, format: &'static str) -> Result<RecordingFindings> {
    let recording = Recording::open(file)?;
    let channels = recording.channels.len();
    let mut meter = Meter::new(recording.rate_hz, channels).map_err(|fault| fault.in_file(file))?;
    let mut block = Vec::with_capacity(BLOCK_FRAMES * channels);
    for start in (0..recording.frames()).step_by(BLOCK_FRAMES) {
        block.clear();
        for frame in start..(start + BLOCK_FRAMES).min(recording.frames()) {
            block.extend(recording.channels.iter().map(|channel| channel[frame]));
        }
        meter.add(&block).map_err(|fault| fault.in_file(file))?;
    }
    Ok(RecordingFindings {
        format,
        rate_hz: recording.rate_hz,
        channels,
        duration_s: recording.duration_s(),
        levels: meter.finish(),
    })
}

impl Findings for RecordingFindings {
    const KIND: &'static str = "recording";

    fn sheet(&self) -> Sheet {
        let mut sheet = Sheet::default();
        let level = |db: Option<f64>, unit: &str| db.map(|db| format!("{db:.1} {unit}"));
        let silent = || "digital silence".to_owned();
        sheet
            .fact("kind", format!("recording, {}", self.format))
            .fact("rate", format!("{} Hz", self.rate_hz))
            .fact("channels", self.channels)
            .fact("length", format!("{}, {} frames", length(self.duration_s), self.levels.frames))
            .fact("peak", level(self.levels.peak_dbfs, "dBFS").unwrap_or_else(silent))
            .fact_if("true peak", level(self.levels.true_peak_dbtp, "dBTP"))
            .fact_if("loudness", level(self.levels.loudness_lufs, "LUFS"));
        if self.levels.clipped_samples > 0 {
            let clipped = number(self.levels.clipped_samples as f64);
            sheet.fact("beyond full scale", format!("{clipped} samples"));
        }
        sheet
    }
}
