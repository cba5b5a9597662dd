//! What plays at an impact: an onset of an impulsive recording, and what rings after it.

use super::Play;
use crate::corpus::dictionary::{Dictionary, Entry};
use crate::corpus::grains::GrainKind;
use crate::score::Grain;

/// A grain whose power is this many times that of the one before begins a new hit.
const RISE: f64 = 4.0;

/// What is quieter than the loudest grain of its recording by this is no hit, in decibels.
const FAINTEST_DB: f64 = -30.0;

/// The onset is where the sound first reaches this part of its peak.
const ONSET: f32 = 0.1;

/// A hit has no more than this before its onset, in seconds.
pub const LONGEST_LEAD_S: f64 = 0.1;

/// How strong a hit is follows from its energy over this time after the onset, in seconds.
const STRENGTH_S: f64 = 0.1;

/// The end of a tail is no louder than this, in decibels of its strongest grain: what the next hit of the recording
/// would cut off fades before it.
const TAIL_DB: f64 = -40.0;

/// An onset of an impulsive recording and all that follows it, up to the next.
#[derive(Debug, Clone, PartialEq)]
pub struct Hit {
    /// The recording.
    pub recording: usize,
    /// Its grains, the first of which holds the onset; times are since the onset.
    pub plays: Vec<Play>,
    /// Its energy in its first tenth of a second, in decibels of one sample of 1.
    pub level_db: f64,
    /// The mean frequency of its first grain, weighted by magnitude.
    pub centroid_hz: f64,
    /// From the beginning of its first grain to the end of its last.
    pub length_s: f64,
}

impl Hit {
    /// How long before the onset its first grain begins, in seconds.
    pub fn lead_s(&self) -> f64 {
        self.plays.first().map_or(0.0, |play| -play.time_s)
    }
}

/// All hits of a recording.
pub(super) fn of_recording(dictionary: &Dictionary, recording: usize) -> Vec<Hit> {
    let Some(about) = dictionary.recordings().get(recording) else { return Vec::new() };
    let numbers: Vec<usize> =
        about.grains.clone().filter(|&n| dictionary.grains()[n].kind == GrainKind::Impulsive).collect();
    let power = |n: usize| {
        let entry = &dictionary.grains()[n];
        entry.energy / entry.length.max(1) as f64
    };
    let loudest = numbers.iter().map(|&n| power(n)).fold(0.0, f64::max);
    let faintest = loudest * 10f64.powf(FAINTEST_DB / 10.0);
    let begins: Vec<usize> = (0..numbers.len())
        .filter(|&i| {
            let before = i.checked_sub(1).map_or(0.0, |before| power(numbers[before]));
            power(numbers[i]) > faintest && power(numbers[i]) >= RISE * before
        })
        .collect();
    let sound = dictionary.sound(recording);
    // What rises for several grains is one hit: its strongest grain is that of the last rise.
    let is_next = |i: &usize| !begins.contains(&(i + 1));
    let peaks: Vec<usize> = begins.iter().copied().filter(is_next).collect();
    let ends = peaks.iter().skip(1).copied().chain([numbers.len()]);
    let mut hits: Vec<Hit> = Vec::new();
    let mut from = 0;
    for (&peak, end) in peaks.iter().zip(ends) {
        let onset = onset(&sound, &dictionary.grains()[numbers[peak]], dictionary.rate_hz());
        // The first grain is the one in which the onset lies.
        let reaches = |i: &usize| dictionary.grains()[numbers[*i]].start > onset;
        let first = (from..=peak).rev().find(|i| !reaches(i)).unwrap_or(peak);
        from = first + 1;
        // The next hit's own first grain is not known yet: the tail ends where its rise begins.
        let end = (first + 1..end).find(|i| begins.contains(i) && *i > peak).unwrap_or(end);
        hits.push(hit(dictionary, recording, &sound, &numbers[first..end], onset));
    }
    hits
}

/// The first sample about the beginning of a grain at which the sound reaches a part of its peak there.
fn onset(sound: &[f32], grain: &Entry, rate_hz: u32) -> usize {
    let end = (grain.start + grain.length).min(sound.len());
    let from = grain.start.saturating_sub(rate_hz as usize / 100).min(end);
    let piece = &sound[from..end];
    let peak = piece.iter().fold(0.0f32, |peak, sample| peak.max(sample.abs()));
    from + piece.iter().position(|sample| sample.abs() >= ONSET * peak).unwrap_or(0)
}

fn hit(dictionary: &Dictionary, recording: usize, sound: &[f32], numbers: &[usize], onset: usize) -> Hit {
    let rate_hz = f64::from(dictionary.rate_hz());
    let entries: Vec<&Entry> = numbers.iter().map(|&n| &dictionary.grains()[n]).collect();
    let last = numbers.len().saturating_sub(1);
    // What the next hit of the recording would cut off, or what is left of it below the threshold, dies away.
    let power = |entry: &Entry| entry.energy / entry.length.max(1) as f64;
    let loudest = entries.iter().map(|entry| power(entry)).fold(0.0, f64::max);
    let end_db =
        10.0 * (entries.last().map_or(0.0, |entry| power(entry)) / loudest.max(f64::MIN_POSITIVE)).log10();
    let slope_db = (TAIL_DB - end_db).min(0.0) / last.max(1) as f64;
    let plays = numbers.iter().zip(&entries).enumerate().map(|(i, (&number, entry))| {
        let gain = 10f64.powf(slope_db * i as f64 / 20.0);
        let time_s = (entry.start as f64 - onset as f64) / rate_hz;
        Play { time_s, grain: Grain { number: number as u32, gain, speed: 1.0, spread: 0.0 } }
    });
    let plays: Vec<Play> = plays.collect();
    let heard = onset..(onset + (STRENGTH_S * rate_hz) as usize).min(sound.len());
    let energy: f64 = sound[heard].iter().map(|&sample| f64::from(sample).powi(2)).sum();
    let first = entries.first().map_or(0, |entry| entry.start);
    let end = entries.iter().map(|entry| entry.start + entry.length).max().unwrap_or(first);
    Hit {
        recording,
        plays,
        level_db: 10.0 * energy.max(1e-30).log10(),
        centroid_hz: entries.first().map_or(0.0, |entry| entry.centroid_hz),
        length_s: (end - first) as f64 / rate_hz,
    }
}
