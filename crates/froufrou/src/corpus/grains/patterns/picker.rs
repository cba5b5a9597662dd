//! The highest peaks of one grain, as candidates come by in order of time.

use std::collections::VecDeque;

/// How many more are kept than are asked for: single precision may have swapped those about the last.
const SPARE: usize = 2;

/// A peak that single precision saw.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidate {
    pub at: usize,
    pub value: f64,
    /// How far it stands out from the higher of its neighbours.
    pub margin: f64,
}

/// Keeps the highest peaks that no higher one is near.
pub(super) struct Picker {
    most: usize,
    least: f64,
    spacing: usize,
    /// Those that something may still be near, by falling value; each with whether an earlier one is near and higher.
    recent: VecDeque<(Candidate, bool)>,
    /// By falling value.
    kept: Vec<Candidate>,
}

impl Picker {
    pub fn new(most: usize, least: f64, spacing: usize) -> Self {
        let most = most.saturating_add(SPARE);
        Self { most, least, spacing, recent: VecDeque::new(), kept: Vec::new() }
    }

    /// Candidates lower than this will not be kept. It only rises, so that a candidate that was not offered would
    /// not have kept another from being kept.
    pub fn least(&self) -> f64 {
        if self.kept.len() < self.most { self.least } else { self.kept[self.most - 1].value.max(self.least) }
    }

    /// The next candidate in time.
    pub fn offer(&mut self, candidate: Candidate) {
        while let Some(&(first, is_dominated)) = self.recent.front() {
            if candidate.at - first.at < self.spacing {
                break;
            }
            self.recent.pop_front();
            self.settle(first, is_dominated);
        }
        while self.recent.back().is_some_and(|(last, _)| last.value < candidate.value) {
            self.recent.pop_back();
        }
        let is_dominated = !self.recent.is_empty();
        self.recent.push_back((candidate, is_dominated));
    }

    /// Those that were kept, by falling value.
    pub fn finish(mut self) -> Vec<Candidate> {
        while let Some((first, is_dominated)) = self.recent.pop_front() {
            self.settle(first, is_dominated);
        }
        self.kept
    }

    fn settle(&mut self, candidate: Candidate, is_dominated: bool) {
        if is_dominated || candidate.value < self.least() {
            return;
        }
        // Among equals the earlier goes first.
        let place = self.kept.partition_point(|kept| kept.value >= candidate.value);
        self.kept.insert(place, candidate);
        self.kept.truncate(self.most);
    }
}
