//! What there is to choose from: the hits of a corpus and its recordings of what goes on.

use std::sync::Arc;

use super::hit::{self, Hit, LONGEST_LEAD_S};
use crate::corpus::dictionary::{Action, Dictionary};
use crate::corpus::grains::{Contact, GrainKind};
use crate::random::Random;

/// An impact chooses among at least so many hits, if there are.
const LEAST_CHOICE: usize = 3;

/// Hits this much stronger or weaker than what is asked for are as good, in decibels.
const AS_GOOD_DB: f64 = 3.0;

/// What contacts may sound like, from one corpus.
#[derive(Debug, Clone)]
pub struct Repertoire {
    dictionary: Arc<Dictionary>,
    /// By rising level.
    hits: Vec<Hit>,
    /// Recordings of sliding and of rolling, with their root mean squares.
    slides: Vec<(usize, f64)>,
    rolls: Vec<(usize, f64)>,
    /// The median lengths of grains of sinusoids and of all others, in samples.
    median_lengths: [f64; 2],
}

impl Repertoire {
    /// What a corpus has. Breaks are hits where there are no others; where there are no recordings of rolling those of
    /// sliding do, and the other way round.
    pub fn new(dictionary: Arc<Dictionary>) -> Self {
        let of = |action: Action| {
            let all = dictionary.recordings().iter().enumerate();
            all.filter(move |(_, recording)| recording.action == action).map(|(index, _)| index)
        };
        let hits_of = |action: Action| -> Vec<Hit> {
            let hits = of(action).flat_map(|recording| hit::of_recording(&dictionary, recording));
            hits.filter(|hit| hit.lead_s() <= LONGEST_LEAD_S).collect()
        };
        let mut hits = hits_of(Action::Hit);
        if hits.is_empty() {
            hits = hits_of(Action::Break);
        }
        hits.sort_by(|a, b| a.level_db.total_cmp(&b.level_db));
        let lasting = |action: Action| -> Vec<(usize, f64)> {
            of(action)
                .filter(|&index| dictionary.recordings()[index].contact == Contact::Continuous)
                .map(|index| (index, root_mean_square(&dictionary.sound(index))))
                .filter(|&(_, level)| level > 0.0)
                .collect()
        };
        let (mut slides, mut rolls) = (lasting(Action::Slide), lasting(Action::Roll));
        if slides.is_empty() {
            slides.clone_from(&rolls);
        } else if rolls.is_empty() {
            rolls.clone_from(&slides);
        }
        let median = |is_sinusoidal: bool| {
            let of_kind = |kind| (kind == GrainKind::Sinusoidal) == is_sinusoidal;
            let grains = dictionary.grains().iter().filter(|grain| of_kind(grain.kind));
            let mut lengths: Vec<usize> = grains.map(|grain| grain.length).collect();
            lengths.sort_unstable();
            lengths.get(lengths.len() / 2).map_or(1.0, |&length| length as f64)
        };
        let median_lengths = [true, false].map(median);
        Self { dictionary, hits, slides, rolls, median_lengths }
    }

    /// The corpus.
    pub fn dictionary(&self) -> &Arc<Dictionary> {
        &self.dictionary
    }

    /// All hits, by rising level.
    pub fn hits(&self) -> &[Hit] {
        &self.hits
    }

    /// The recordings along whose patterns bodies slide or roll, each with its root mean square.
    pub fn lasting(&self, action: Action) -> &[(usize, f64)] {
        match action {
            Action::Roll => &self.rolls,
            _ => &self.slides,
        }
    }

    /// The median length of grains of a kind, in samples; those of impulsive recordings and of residuals are one.
    pub fn median_length(&self, kind: GrainKind) -> f64 {
        self.median_lengths[usize::from(kind != GrainKind::Sinusoidal)]
    }

    /// The root mean square of the loudest of those.
    pub fn loudest(&self, action: Action) -> f64 {
        self.lasting(action).iter().map(|&(_, level)| level).fold(0.0, f64::max)
    }

    /// A hit for an impact that is so many decibels weaker than what the strongest hit is for, by a random number at
    /// an index; another than the last one, unless there is only one. None where there are no hits.
    ///
    /// It chooses among those within 3 dB of what is asked for, or the nearest three.
    pub fn hit(&self, strength_db: f64, random: Random, index: u64, last: Option<usize>) -> Option<usize> {
        let strongest_db = self.hits.last()?.level_db;
        let off = |hit: usize| (self.hits[hit].level_db - strongest_db - strength_db.min(0.0)).abs();
        let mut near: Vec<usize> = (0..self.hits.len()).collect();
        near.sort_by(|&a, &b| off(a).total_cmp(&off(b)).then(a.cmp(&b)));
        let as_good = near.iter().take_while(|&&hit| off(hit) <= AS_GOOD_DB).count();
        near.truncate(as_good.max(LEAST_CHOICE));
        if near.len() > 1 {
            near.retain(|&hit| Some(hit) != last);
        }
        near.get(random.below(index, near.len())).copied()
    }

    /// The gain that brings a hit to the level of the strongest.
    pub fn gain(&self, hit: usize) -> f64 {
        match (self.hits.get(hit), self.hits.last()) {
            (Some(hit), Some(strongest)) => 10f64.powf((strongest.level_db - hit.level_db) / 20.0),
            _ => 0.0,
        }
    }
}

fn root_mean_square(samples: &[f32]) -> f64 {
    let sum: f64 = samples.iter().map(|&sample| f64::from(sample).powi(2)).sum();
    (sum / samples.len().max(1) as f64).sqrt()
}
