//! Recordings made again of grains: as they were, stretched, varied, in another's rhythm (Picard, Tsingos & Faure 2009,
//! sections 4 and 6).
//!
//! The paper walks along a pattern and takes, at the end of each grain, that of the next places with the largest
//! correlation. Such a walk cannot know that a grain which fits fairly well lies in the way of one that fits much
//! better, such as an attack. Here the best of all ways is found: that by which the least is lost. Of the energy under a
//! grain the part 1 − ρ² is lost, and more than all where there is none.
//!
//! The sinusoids and the residual of a continuous recording are walked along each by itself.

mod walk;

#[cfg(test)]
mod tests;

use std::collections::BTreeSet;

use self::walk::{Place, Trail};
use super::dictionary::{Dictionary, Entry};
use super::grains::{Contact, GrainKind};
use crate::error::{Error, Result};
use crate::random::Random;

/// A grain that sounds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chosen {
    /// Its number in the dictionary.
    pub grain: usize,
    /// The sample at which it begins.
    pub start: usize,
    /// Its gain.
    pub gain: f32,
}

/// Grains that sound one after another.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Sequence {
    /// In samples.
    pub length: usize,
    /// In order of start, those of sinusoids after all others.
    pub chosen: Vec<Chosen>,
}

/// Which grains may be chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Own {
    /// All.
    With,
    /// Those of other recordings.
    Without,
}

/// How unlike what fits best a variation may be: by chance some places seem to lose less than others, by up to so many
/// powers of e. None seems to lose more than it does, or silence would do as well.
const VARIETY: f64 = 3.0;

impl Sequence {
    /// What it sounds like: the grains, overlapped and added.
    pub fn render(&self, dictionary: &Dictionary) -> Vec<f32> {
        let mut sum = vec![0.0f64; self.length];
        for chosen in &self.chosen {
            let to = sum.get_mut(chosen.start..).unwrap_or_default();
            for (to, from) in to.iter_mut().zip(dictionary.samples(chosen.grain)) {
                *to += f64::from(chosen.gain) * f64::from(*from);
            }
        }
        sum.into_iter().map(|v| v as f32).collect()
    }
}

/// A recording of grains that fit best.
///
/// # Errors
/// Where there is no such recording.
pub fn resynthesise(dictionary: &Dictionary, recording: usize, own: Own) -> Result<Sequence> {
    let trails = trails(dictionary, recording, own, true)?;
    let chosen = trails.iter().flat_map(|trail| {
        let way = trail.way(|_| 1.0);
        // Its own grains leave nothing out but what is too quiet to be one.
        if own == Own::With { way } else { trail.filled(dictionary, recording, way) }
    });
    Ok(Sequence { length: dictionary.recordings()[recording].length, chosen: chosen.collect() })
}

/// A recording of others' grains chosen by their power alone, one after another: what correlation is measured against.
///
/// # Errors
/// Where there is no such recording.
pub fn by_power(dictionary: &Dictionary, recording: usize) -> Result<Sequence> {
    let trails = trails(dictionary, recording, Own::Without, false)?;
    let chosen = trails.iter().flat_map(|trail| trail.by_power(dictionary, recording));
    Ok(Sequence { length: dictionary.recordings()[recording].length, chosen: chosen.collect() })
}

/// A recording that is similar, but another: places at which grains fit are made more or less welcome by chance, and
/// no grain stays where it was recorded.
///
/// # Errors
/// Where there is no such recording.
pub fn vary(dictionary: &Dictionary, recording: usize, own: Own, seed: u64) -> Result<Sequence> {
    let trails = trails(dictionary, recording, own, false)?;
    let weight = |place: &Place| {
        let random = Random::new(seed, place.grain as u64);
        (VARIETY * (random.uniform(place.start as u64) - 1.0)).exp()
    };
    let chosen = trails.iter().flat_map(|trail| trail.way(weight));
    Ok(Sequence { length: dictionary.recordings()[recording].length, chosen: chosen.collect() })
}

/// A recording that takes longer (above 1) or shorter, at the pitch it has. Grains of hits and breaks move apart, and
/// what opens between them is filled with grains that fit there; where they move together the strongest stay. What
/// slides or rolls is walked along more slowly or faster.
///
/// # Errors
/// Where there is no such recording or the factor is not 0.05 to 50.
pub fn stretch(dictionary: &Dictionary, recording: usize, own: Own, factor: f64) -> Result<Sequence> {
    if !(0.05..=50.0).contains(&factor) {
        return Err(Error::new(format!("the factor is {factor}, expected 0.05 to 50")));
    }
    let trails = trails(dictionary, recording, own, true)?;
    let is_impulsive = dictionary.recordings()[recording].contact == Contact::Impulsive;
    let length = (dictionary.recordings()[recording].length as f64 * factor).round() as usize;
    let chosen = trails.iter().flat_map(|trail| {
        if is_impulsive {
            let anchors = trail.way(|_| 1.0);
            trail.spread(dictionary, &anchors, factor)
        } else {
            trail.scan(length, factor)
        }
    });
    let mut chosen: Vec<Chosen> = chosen.collect();
    chosen.retain(|chosen| chosen.start < length);
    Ok(Sequence { length, chosen })
}

/// The grains of one recording in the rhythm of another: each grain of that is replaced by the one that is among its
/// own kind as loud, as bright and as long, with the power of what it replaces.
///
/// # Errors
/// Where there is no such recording, or that whose grains are asked for has none.
pub fn rhythm(dictionary: &Dictionary, grains_of: usize, rhythm_of: usize) -> Result<Sequence> {
    for number in [grains_of, rhythm_of] {
        check(dictionary, number)?;
    }
    let recordings = dictionary.recordings();
    let source: Vec<(usize, Traits)> = traits(dictionary, recordings[grains_of].grains.clone());
    if source.is_empty() {
        return Err(Error::new(format!("{} has no grains", recordings[grains_of].name)));
    }
    let mut chosen = Vec::new();
    let mut last = None;
    for (wanted, wanted_traits) in traits(dictionary, recordings[rhythm_of].grains.clone()) {
        let entry = dictionary.grains()[wanted];
        // Among grains of its kind, if there are any.
        let is_sinusoidal = entry.kind == GrainKind::Sinusoidal;
        let of_kind =
            |grain: usize| (dictionary.grains()[grain].kind == GrainKind::Sinusoidal) == is_sinusoidal;
        let has_kind = source.iter().any(|(grain, _)| of_kind(*grain));
        let cost = |(grain, traits): &(usize, Traits)| {
            traits.distance(&wanted_traits) + if last == Some(*grain) { 1.0 } else { 0.0 }
        };
        let nearest = source
            .iter()
            .filter(|(grain, _)| !has_kind || of_kind(*grain))
            .min_by(|a, b| cost(a).total_cmp(&cost(b)));
        let Some((grain, _)) = nearest else { continue };
        last = Some(*grain);
        let power = |samples: &[f32]| {
            samples.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / samples.len().max(1) as f64
        };
        let is = power(dictionary.samples(*grain));
        let gain = if is > 0.0 { (power(dictionary.samples(wanted)) / is).sqrt() as f32 } else { 0.0 };
        chosen.push(Chosen { grain: *grain, start: entry.start, gain });
    }
    Ok(Sequence { length: recordings[rhythm_of].length, chosen })
}

fn check(dictionary: &Dictionary, recording: usize) -> Result<()> {
    let count = dictionary.recordings().len();
    if recording < count {
        return Ok(());
    }
    Err(Error::new(format!("there is no recording {recording}: the dictionary has {count}")))
}

/// The ways through a recording: one along its sinusoids, one along the rest. `in_place` grains lie where they were
/// recorded.
fn trails(dictionary: &Dictionary, recording: usize, own: Own, in_place: bool) -> Result<Vec<Trail>> {
    check(dictionary, recording)?;
    let here = &dictionary.recordings()[recording];
    let may = |entry: &Entry, start: usize| {
        entry.recording != recording || own == Own::With && (in_place || entry.start != start)
    };
    let of_kind = |is_sinusoidal: bool| {
        let places = here.pattern.iter().filter_map(|placed| {
            let entry = dictionary.grains().get(placed.grain as usize)?;
            let fits = (entry.kind == GrainKind::Sinusoidal) == is_sinusoidal;
            let start = placed.start as usize;
            (fits && may(entry, start)).then_some(Place {
                tapers: entry.tapers,
                grain: placed.grain as usize,
                start,
                end: start + entry.length,
                correlation: f64::from(placed.correlation),
                gain: placed.gain,
            })
        });
        Trail::new(dictionary, recording, is_sinusoidal, places.collect())
    };
    Ok(match here.contact {
        Contact::Impulsive => vec![of_kind(false)],
        Contact::Continuous => vec![of_kind(false), of_kind(true)],
    })
}

/// What a grain is like among those of its recording: how many standard deviations its level and its brightness are
/// from the mean, and how long it is.
struct Traits {
    level: f64,
    brightness: f64,
    length: f64,
}

impl Traits {
    fn distance(&self, other: &Self) -> f64 {
        (self.level - other.level).abs()
            + (self.brightness - other.brightness).abs()
            + 2.0 * (self.length / other.length).ln().abs()
    }
}

fn traits(dictionary: &Dictionary, grains: std::ops::Range<usize>) -> Vec<(usize, Traits)> {
    let entries = &dictionary.grains()[grains.clone()];
    let kinds: BTreeSet<bool> = entries.iter().map(|e| e.kind == GrainKind::Sinusoidal).collect();
    let mut all = Vec::with_capacity(entries.len());
    for is_sinusoidal in kinds {
        let numbers: Vec<usize> = grains
            .clone()
            .filter(|&g| (dictionary.grains()[g].kind == GrainKind::Sinusoidal) == is_sinusoidal)
            .collect();
        let column = |of: &dyn Fn(&Entry) -> f64| -> Vec<f64> {
            let values: Vec<f64> = numbers.iter().map(|&g| of(&dictionary.grains()[g])).collect();
            let count = values.len() as f64;
            let mean = values.iter().sum::<f64>() / count;
            let deviation = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt();
            values.iter().map(|v| (v - mean) / deviation.max(1e-9)).collect()
        };
        let levels = column(&|entry| (entry.energy / entry.length as f64 + 1e-20).ln());
        let brightness = column(&|entry| (entry.centroid_hz + 1.0).ln());
        for ((&grain, level), brightness) in numbers.iter().zip(levels).zip(brightness) {
            let length = dictionary.grains()[grain].length as f64;
            all.push((grain, Traits { level, brightness, length }));
        }
    }
    all
}
