//! From cut sounds to grains, and from peaks of correlation to patterns.

use rayon::prelude::*;
use realfft::RealFftPlanner;

use super::{Action, Dictionary, Entry, Part, Placed, Recording, Settings, fits};
use crate::corpus::grains::patterns::Peak;
use crate::corpus::grains::{Contact, GrainKind, Segment, centroid_hz, energy};

/// A recording whose cuts are known.
#[derive(Debug)]
pub(super) struct Sound {
    pub name: String,
    pub contact: Contact,
    pub action: Action,
    pub parts: Vec<Part>,
    /// In order of parts and of time, each within its part.
    pub segments: Vec<Segment>,
}

/// A dictionary that has no patterns yet.
pub(super) struct Cut(Dictionary);

impl Cut {
    /// Windows all grains.
    pub fn new(rate_hz: u32, settings: &Settings, sounds: Vec<Sound>) -> Self {
        let mut dictionary = Dictionary {
            rate_hz,
            settings: settings.clone(),
            recordings: Vec::with_capacity(sounds.len()),
            parts: Vec::with_capacity(sounds.len()),
            grains: Vec::new(),
            samples: Vec::new(),
            begins: vec![0],
        };
        let taper = settings.extraction.taper;
        for (number, sound) in sounds.into_iter().enumerate() {
            let from = dictionary.grains.len();
            let windows = windows(&sound.segments, taper);
            let grains: Vec<(Entry, Vec<f32>)> = sound
                .segments
                .par_iter()
                .zip(&windows)
                .map_init(RealFftPlanner::new, |planner, (segment, (window, tapers))| {
                    let piece = piece(&sound.parts, segment.kind, segment.start, segment.length);
                    let samples: Vec<f32> =
                        piece.iter().zip(window).map(|(v, w)| (f64::from(*v) * w) as f32).collect();
                    let entry = Entry {
                        recording: number,
                        kind: segment.kind,
                        start: segment.start,
                        length: samples.len(),
                        tapers: *tapers,
                        energy: energy(piece),
                        centroid_hz: centroid_hz(&samples, rate_hz, planner),
                    };
                    (entry, samples)
                })
                .collect();
            for (entry, samples) in grains {
                dictionary.grains.push(entry);
                dictionary.samples.extend_from_slice(&samples);
                dictionary.begins.push(dictionary.samples.len());
            }
            dictionary.recordings.push(Recording {
                name: sound.name,
                contact: sound.contact,
                action: sound.action,
                length: sound.parts.first().map_or(0, |part| part.samples.len()),
                pattern: Vec::new(),
                grains: from..dictionary.grains.len(),
            });
            dictionary.parts.push(sound.parts);
        }
        Self(dictionary)
    }

    /// What is known so far.
    pub fn dictionary(&self) -> &Dictionary {
        &self.0
    }

    /// What is known so far, for good.
    pub fn into_dictionary(self) -> Dictionary {
        self.0
    }

    /// The parts of a recording.
    pub fn parts(&self, recording: usize) -> &[Part] {
        &self.0.parts[recording]
    }

    /// Adds the patterns: of each recording the peaks that were kept, in any order, without its own grains in their own
    /// places, which are added here.
    pub fn assemble(self, peaks: &[Vec<Peak>]) -> Dictionary {
        let Self(mut dictionary) = self;
        let patterns: Vec<Vec<Placed>> = peaks
            .par_iter()
            .enumerate()
            .map(|(recording, peaks)| pattern(&dictionary, recording, peaks))
            .collect();
        for (recording, pattern) in dictionary.recordings.iter_mut().zip(patterns) {
            recording.pattern = pattern;
        }
        dictionary
    }
}

/// A stretch of the part that a grain is cut from or matched with; empty where it is not all there.
pub(super) fn piece(parts: &[Part], kind: GrainKind, start: usize, length: usize) -> &[f32] {
    let part = parts.iter().find(|part| fits(kind, part.kind));
    part.and_then(|part| part.samples.get(start..start.checked_add(length)?)).unwrap_or_default()
}

/// The window of each segment, whose mean square is 1, and its tapers: flat but for tapers, each as long as it overlaps with its neighbour, so that
/// both add up to 1 there, or where there is none r/2 of its length. A recording of a hit that begins with the attack has no
/// taper there, which would take the attack away.
fn windows(segments: &[Segment], taper: f64) -> Vec<(Vec<f64>, [usize; 2])> {
    let overlap = |from: Option<&Segment>, to: Option<&Segment>| {
        let (from, to) = (from?, to?);
        let overlap = (from.start + from.length).checked_sub(to.start)?;
        (from.kind == to.kind && overlap > 0 && overlap <= from.length.min(to.length)).then_some(overlap)
    };
    let before = |index: usize| index.checked_sub(1).and_then(|before| segments.get(before));
    let window = |(index, segment): (usize, &Segment)| {
        let free = ((0.5 * taper * segment.length as f64).round() as usize).min(segment.length / 2);
        let attacks = segment.start == 0 && segment.kind == GrainKind::Impulsive;
        let left = if attacks { 0 } else { overlap(before(index), Some(segment)).unwrap_or(free) };
        let right = overlap(Some(segment), segments.get(index + 1)).unwrap_or(free);
        let plain: Vec<f64> = tapered(segment.length, [left, right]).collect();
        let mean_square = plain.iter().map(|w| w * w).sum::<f64>() / plain.len().max(1) as f64;
        let scale = if mean_square > 0.0 { mean_square.sqrt().recip() } else { 1.0 };
        (plain.into_iter().map(|w| w * scale).collect(), [left, right])
    };
    segments.iter().enumerate().map(window).collect()
}

/// A window that is 1 between its tapers.
fn tapered(length: usize, [left, right]: [usize; 2]) -> impl Iterator<Item = f64> {
    let rise = |from_end: usize, taper: usize| {
        // The mirrored taper of the neighbour is what is missing to 1.
        let part = (from_end as f64 + 0.5) / taper as f64;
        if from_end < taper { 0.5 - 0.5 * (std::f64::consts::PI * part).cos() } else { 1.0 }
    };
    (0..length).map(move |i| rise(i, left) * rise(length - 1 - i, right))
}

fn pattern(dictionary: &Dictionary, recording: usize, peaks: &[Peak]) -> Vec<Placed> {
    let parts = &dictionary.parts[recording];
    let place = |grain: usize, start: usize, correlation: Option<f32>| {
        let entry = &dictionary.grains[grain];
        let samples = dictionary.samples(grain);
        let there = piece(parts, entry.kind, start, entry.length);
        let (is, wanted) = (energy(samples), energy(there));
        // What it has to be as loud as is what its window leaves: a recording's own grains add up to itself.
        let left: f64 = there
            .iter()
            .zip(tapered(entry.length, entry.tapers))
            .map(|(v, w)| (f64::from(*v) * w).powi(2))
            .sum();
        let exact = || {
            let product: f64 = there.iter().zip(samples).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum();
            if is > 0.0 && wanted > 0.0 { (product / (is * wanted).sqrt()) as f32 } else { 0.0 }
        };
        Placed {
            // The number of grains was held against 32 bits.
            grain: grain as u32,
            start: start as u64,
            correlation: correlation.unwrap_or_else(exact),
            gain: if is > 0.0 { (left / is).sqrt() as f32 } else { 0.0 },
        }
    };
    let own = dictionary.recordings[recording].grains.clone();
    let mut placed: Vec<Placed> =
        own.map(|grain| place(grain, dictionary.grains[grain].start, None)).collect();
    let others =
        peaks.iter().map(|peak| place(peak.grain as usize, peak.start as usize, Some(peak.correlation)));
    placed.extend(others);
    placed.sort_by_key(|placed| (placed.start, placed.grain));
    placed
}
