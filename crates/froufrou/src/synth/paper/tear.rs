//! Tears: fibres that break one after the other, at random (a Poisson process), as many a metre as the paper has.

use std::sync::Arc;

use crate::corpus::paper::synthetic::{FIBRES, Paper};
use crate::random::Random;
use crate::synth::instrument::Ramp;

/// The most fibres that break at one sample; what is faster is louder instead.
const MOST_A_SAMPLE: f64 = 0.5;

/// The clicks of fibres at a rate.
pub struct Fibres {
    clicks: Vec<Vec<f32>>,
    per_m: f64,
    longest: usize,
}

impl Fibres {
    /// Those of a paper.
    pub fn new(paper: &Paper, rate_hz: f64) -> Self {
        let clicks: Vec<Vec<f32>> = (0..FIBRES as u64).map(|n| paper.fibre(n, rate_hz)).collect();
        let longest = clicks.iter().map(Vec::len).max().unwrap_or(0);
        Self { clicks, per_m: paper.fibres_per_m(), longest }
    }
}

/// The tears of a thread.
pub struct Tear {
    fibres: Arc<Fibres>,
    random: Random,
    /// How many fibres have broken.
    broken: u64,
    /// How far it is to the next, in mean distances.
    left: f64,
    /// What clicks still sound like, from the present sample on, as a ring.
    ring: Vec<f32>,
    at: usize,
    /// Samples until all have died away.
    sounds: usize,
}

impl Tear {
    /// A whole sheet. All that is random in it comes from `random`.
    pub fn new(fibres: Arc<Fibres>, random: Random) -> Self {
        let ring = vec![0.0; fibres.longest.max(1)];
        let left = distance(random, 0);
        Self { fibres, random, broken: 0, left, ring, at: 0, sounds: 0 }
    }

    /// Adds the stretch that follows the one before, at a speed in m/s.
    pub fn add(&mut self, speed: Ramp, level: f64, rate_hz: f64, out: &mut [f32]) {
        if speed == Ramp::still(0.0) && self.sounds == 0 {
            return;
        }
        let count = out.len();
        for (n, out) in out.iter_mut().enumerate() {
            let wanted = speed.at(n, count) * self.fibres.per_m / rate_hz;
            let step = wanted.min(MOST_A_SAMPLE);
            self.left -= step;
            // Powers of clicks add.
            let louder = if step > 0.0 { (wanted / step).sqrt().min(1e3) } else { 1.0 };
            while self.left < 0.0 {
                self.snap(level * louder);
                self.left += distance(self.random, self.broken);
            }
            *out += std::mem::take(&mut self.ring[self.at]);
            self.at = (self.at + 1) % self.ring.len();
            self.sounds = self.sounds.saturating_sub(1);
        }
    }

    /// A fibre breaks at the present sample.
    fn snap(&mut self, level: f64) {
        self.broken += 1;
        let which = self.random.below(2 * self.broken + 1, self.fibres.clicks.len());
        let Some(click) = self.fibres.clicks.get(which) else { return };
        let length = self.ring.len();
        let (before, after) = self.ring.split_at_mut(self.at);
        for (sum, sample) in after.iter_mut().chain(before).zip(click) {
            *sum += level as f32 * sample;
        }
        self.sounds = length;
    }
}

/// From one fibre to the next, in mean distances.
fn distance(random: Random, number: u64) -> f64 {
    -(1.0 - random.uniform(2 * number)).ln()
}
