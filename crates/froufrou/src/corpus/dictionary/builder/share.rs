//! Grains that sound as something before them: they need no sound of their own.

use std::collections::BTreeMap;

use crate::corpus::dictionary::Dictionary;
use crate::corpus::dictionary::index::Share;
use crate::corpus::grains::GrainKind;
use crate::corpus::grains::patterns::Peak;

/// How much less a grain correlates under its window than without it, at most.
const WINDOWED: f64 = 0.05;

/// A place at which a grain's sound may be found again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Candidate {
    pub grain: usize,
    pub recording: usize,
    pub start: usize,
}

/// Of the peaks in one recording those at which a grain may find its own sound, earlier than it is itself.
pub(super) fn candidates(
    dictionary: &Dictionary,
    recording: usize,
    peaks: &[Peak],
    share_from: f64,
) -> Vec<Candidate> {
    let is_impulsive = dictionary.parts[recording].iter().all(|part| part.kind == GrainKind::Impulsive);
    let candidate = |peak: &Peak| {
        let entry = dictionary.grains().get(peak.grain as usize)?;
        let start = peak.start as usize;
        let is_earlier = recording < entry.recording
            || recording == entry.recording && start + entry.length <= entry.start;
        let is_alike = f64::from(peak.correlation) >= share_from - WINDOWED;
        let found = Candidate { grain: peak.grain as usize, recording, start };
        (is_earlier && is_alike && entry.kind == GrainKind::Impulsive).then_some(found)
    };
    if is_impulsive { peaks.iter().filter_map(candidate).collect() } else { Vec::new() }
}

/// The stretches of each recording that are others', in order of time. They do not overlap, and each is taken from
/// where its grain correlates best, without its window.
pub(super) fn shares(
    dictionary: &Dictionary,
    sounds: &[Vec<f32>],
    candidates: &[Candidate],
    share_from: f64,
) -> Vec<Vec<Share>> {
    let mut by_grain: BTreeMap<usize, Vec<Candidate>> = BTreeMap::new();
    candidates.iter().for_each(|candidate| by_grain.entry(candidate.grain).or_default().push(*candidate));
    let mut shares: Vec<Vec<Share>> = vec![Vec::new(); sounds.len()];
    // Grains are numbered in order of recordings and of time.
    for (grain, places) in by_grain {
        let entry = dictionary.grains()[grain];
        let of_recording = &mut shares[entry.recording];
        // Windows reach into one another by their tapers.
        let end = entry.start + entry.length;
        let start = of_recording.last().map_or(entry.start, |s| entry.start.max(s.start + s.length));
        let length = end.saturating_sub(start);
        let here = &sounds[entry.recording][start..start + length];
        let best = places.iter().filter_map(|place| {
            let from = place.start + (start - entry.start);
            let there = sounds[place.recording].get(from..from + length)?;
            let (product, power) = (product(here, there), product(there, there));
            let correlation = product / (power * self::product(here, here)).sqrt();
            let gain = (product / power) as f32;
            let share = Share { start, length, recording: place.recording, from, gain };
            (correlation >= share_from).then_some((correlation, share))
        });
        // Of places that are as good, the first.
        let best = best.reduce(|a, b| if b.0 > a.0 { b } else { a });
        of_recording.extend(best.map(|(_, share)| share));
    }
    shares
}

fn product(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
}
