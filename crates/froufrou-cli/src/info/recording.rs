//! What is in an audio file: rate, channels, length and levels.

use std::path::Path;

use froufrou::Result;
use froufrou::corpus::recording::Recording;
use froufrou::render::labels::{self, Found};
use froufrou::render::meter::{Meter, Report};
use froufrou::render::speakers;
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
    /// What the file says of itself, where it is WAV or FLAC.
    #[serde(flatten)]
    labels: Option<Found>,
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
        labels: labels::read(file)?,
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
        sheet
            .fact_if("loudness range", level(self.levels.loudness_range_lu, "LU"))
            .fact_if("highest momentary", level(self.levels.max_momentary_lufs, "LUFS"))
            .fact_if("highest short-term", level(self.levels.max_short_term_lufs, "LUFS"));
        if self.levels.clipped_samples > 0 {
            let clipped = number(self.levels.clipped_samples as f64);
            sheet.fact("beyond full scale", format!("{clipped} samples"));
        }
        if let Some(labels) = &self.labels {
            label(labels, self.rate_hz, &mut sheet);
        }
        sheet
    }
}

/// Adds what a file says of itself.
fn label(found: &Found, rate_hz: u32, sheet: &mut Sheet) {
    sheet.fact("samples", format!("{} bits{}", found.bits, if found.is_float { ", float" } else { "" }));
    sheet.fact_if(
        "loudspeakers",
        found.channel_mask.map(|mask| match mask {
            0 => "none named (mask 0)".to_owned(),
            _ => format!("{} (mask {mask:#x})", speakers::names(mask).join(", ")),
        }),
    );
    if let Some(broadcast) = &found.broadcast {
        let told = |text: &str| Some(text.to_owned()).filter(|text| !text.is_empty());
        let date = format!("{} {}", broadcast.origination_date, broadcast.origination_time);
        let samples = broadcast.time_reference;
        let clock = clock(samples, rate_hz);
        let level = |db: Option<f64>, unit: &str| db.map(|db| format!("{db:.2} {unit}"));
        sheet
            .fact_if("description", told(&broadcast.description))
            .fact_if("originator", told(&broadcast.originator))
            .fact_if("reference", told(&broadcast.originator_reference))
            .fact_if("origination", told(date.trim()))
            .fact("time reference", format!("{samples} samples, {clock}"))
            .fact_if("told loudness", level(broadcast.loudness_lufs, "LUFS"))
            .fact_if("told range", level(broadcast.loudness_range_lu, "LU"))
            .fact_if("told true peak", level(broadcast.max_true_peak_dbtp, "dBTP"))
            .fact_if("told momentary", level(broadcast.max_momentary_lufs, "LUFS"))
            .fact_if("told short-term", level(broadcast.max_short_term_lufs, "LUFS"))
            .fact_if("coding history", told(&broadcast.coding_history));
    }
    sheet.table(&["tag", "value"], found.tags.iter().map(|(name, value)| vec![name.clone(), value.clone()]));
}

/// A count of samples as hours, minutes and seconds.
fn clock(samples: u64, rate_hz: u32) -> String {
    let milliseconds = (u128::from(samples) * 1000 + u128::from(rate_hz) / 2) / u128::from(rate_hz.max(1));
    let (seconds, rest) = (milliseconds / 1000, milliseconds % 1000);
    format!("{:02}:{:02}:{:02}.{rest:03}", seconds / 3600, seconds / 60 % 60, seconds % 60)
}
