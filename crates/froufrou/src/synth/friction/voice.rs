//! The friction of one thread: a noise whose spectrum follows the parts that it is told.
//!
//! | control | default | |
//! | --- | --- | --- |
//! | `speed` | 0 | m/s; its sign does not matter |
//! | `level` | 1 | amplitude: 1 is as loud as the recording was |
//! | `spread` | 0 | how far speeds stray: the standard deviation of their natural logarithm |
//! | `speed-2`, `level-2`, `spread-2` | 0 | a second part of what rubs; so on to 4 |
//!
//! A frame takes its speeds where it is loudest, in its middle: the thread is told its controls that much ahead. The first frame
//! rises in 25 ms.

use std::sync::Arc;

use super::noise::{HOP_S, Noise, hop_samples};
use super::{FrictionTable, PARTS, Part, SpeedHistogram};
use crate::random::Random;
use crate::synth::gate::control;
use crate::synth::instrument::{Control, Stretch};

/// How far ahead of its sound a thread has to be told its controls.
pub const AHEAD_S: f64 = HOP_S;

/// The names of controls, part by part.
const NAMES: [[&str; 3]; PARTS] = [
    ["speed", "level", "spread"],
    ["speed-2", "level-2", "spread-2"],
    ["speed-3", "level-3", "spread-3"],
    ["speed-4", "level-4", "spread-4"],
];

/// The controls of friction, in their order.
pub fn controls() -> Vec<Control> {
    let default = |part: usize, index: usize| f64::from(part == 0 && index == 1);
    let all = (0..PARTS).flat_map(|part| (0..3).map(move |index| (part, index)));
    all.map(|(part, index)| Control { name: NAMES[part][index].to_owned(), default: default(part, index) })
        .collect()
}

/// What controls say of some parts of what rubs, by name, for a `set` line of a score; those that are not there are set to
/// a level of 0, and their speeds are left alone.
pub fn settings(parts: &[Part]) -> Vec<(String, f64)> {
    let mut values = Vec::new();
    for (index, [speed, level, spread]) in NAMES.iter().enumerate() {
        match parts.get(index) {
            Some(part) => values.extend([
                ((*speed).to_owned(), part.speed_mps),
                ((*level).to_owned(), part.level),
                ((*spread).to_owned(), part.spread),
            ]),
            None => values.push(((*level).to_owned(), 0.0)),
        }
    }
    values
}

/// A table whose spectra are those of the bins of a frame at a rate.
#[derive(Debug)]
pub struct RateTable {
    table: Arc<FrictionTable>,
    bins: usize,
    /// Squares of amplitudes of cosines, entry by entry.
    squares: Vec<f32>,
}

impl RateTable {
    /// A table at a rate. What lies at or above half the rate is left out.
    pub fn new(table: Arc<FrictionTable>, rate_hz: f64) -> Self {
        let length = 2 * hop_samples(rate_hz);
        let bin_hz = rate_hz / length as f64;
        let top_hz = (table.values() + 1) as f64 * table.spacing_hz();
        let bins = ((top_hz / bin_hz).ceil() as usize).min(length / 2 - 1);
        let mut squares = Vec::with_capacity(bins * table.speeds_mps().len());
        for entry in 0..table.speeds_mps().len() {
            let power = table.power(entry);
            for bin in 1..=bins {
                let place = bin as f64 * bin_hz / table.spacing_hz();
                let low = (place + 1e-9).floor();
                let along = (place - low).max(0.0);
                // Values begin at 1 times the spacing, and there is nothing at 0 Hz.
                let value = |at: f64| (at as usize).checked_sub(1).and_then(|at| power.get(at)).copied();
                let density =
                    value(low).unwrap_or(0.0) * (1.0 - along) + value(low + 1.0).unwrap_or(0.0) * along;
                // A cosine of amplitude a has the power a²/2 in its bin.
                squares.push((2.0 * density * bin_hz) as f32);
            }
        }
        Self { table, bins, squares }
    }

    /// Fills `out` with the amplitudes of cosines of all that moves.
    fn amplitudes(&self, histogram: &SpeedHistogram, out: &mut Vec<f32>) {
        out.clear();
        if histogram.weights().iter().all(|weight| *weight <= 0.0) {
            return;
        }
        out.resize(self.bins, 0.0);
        let entries = self.squares.chunks(self.bins.max(1)).zip(histogram.weights());
        for (squares, weight) in entries.filter(|(_, weight)| **weight > 0.0) {
            let weight = *weight as f32;
            out.iter_mut().zip(squares).for_each(|(sum, square)| *sum += weight * square);
        }
        for amplitude in out.iter_mut() {
            *amplitude = amplitude.sqrt().min(1e15);
        }
    }
}

/// The running friction of a thread.
pub struct Voice {
    table: Arc<RateTable>,
    noise: Noise,
    histogram: SpeedHistogram,
    amplitudes: Vec<f32>,
}

impl Voice {
    /// A voice that begins at rest. All that is random in it comes from `random`.
    pub fn new(table: Arc<RateTable>, rate_hz: f64, random: Random) -> Self {
        let histogram = SpeedHistogram::new(&table.table);
        Self { noise: Noise::new(hop_samples(rate_hz), random), histogram, amplitudes: Vec::new(), table }
    }

    /// Adds the stretch that follows the one before to `out`. The first `3 · PARTS` controls are those of [`controls`].
    pub fn add(&mut self, stretch: &Stretch<'_>, out: &mut [f32]) {
        let (hop, count) = (self.noise.hop(), out.len());
        let mut index = 0;
        while index < count {
            let number = stretch.first + index as u64;
            let within = (number % hop as u64) as usize;
            if within == 0 {
                self.begin(number / hop as u64, stretch, index, count);
            }
            let length = (hop - within).min(count - index);
            if !self.noise.rests() {
                let samples = &self.noise.samples()[within..within + length];
                out[index..index + length].iter_mut().zip(samples).for_each(|(out, sample)| *out += sample);
            }
            index += length;
        }
    }

    fn begin(&mut self, number: u64, stretch: &Stretch<'_>, index: usize, count: usize) {
        self.histogram.clear();
        let table = &self.table.table;
        for part in 0..PARTS {
            let value = |of: usize| control(stretch, 3 * part + of, 0.0).at(index, count);
            let [speed_mps, level, spread] = [value(0), value(1).min(1e6), value(2)];
            if speed_mps > 0.0 && level > 0.0 {
                self.histogram.add_part(table, &Part { speed_mps, level, spread });
            }
        }
        self.table.amplitudes(&self.histogram, &mut self.amplitudes);
        self.noise.begin(number, &self.amplitudes);
    }
}
