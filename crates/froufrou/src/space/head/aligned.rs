//! Responses brought to one onset and to the output's rate, and how they are mixed between directions.
//!
//! Mixed as they are, two responses whose onsets differ would be a comb filter. So onsets are mixed apart from
//! responses, which are moved to a common onset first. What is left of their phases still differs at high
//! frequencies, where a mixture is softer than what it is made of. So every response is kept as two bands that
//! add up to it, and of the mixture the upper band is brought to the energy that the mixture of energies asks
//! for. The lower band needs nothing of the kind, and must not be made louder on account of the upper.

use std::f64::consts::PI;
use std::sync::Arc;

use rayon::prelude::*;

use super::grid::Vector;
use super::measured::{Corners, Measured};
use crate::synth::sinc::{half_width, resample};

/// Where the bands meet, in hertz.
const CROSSOVER_HZ: f64 = 4000.0;

/// Half the length of the filter that parts them, in seconds.
const CROSSOVER_S: f64 = 0.000_75;

/// What both ends of all responses have less of than this part of their energy is left out.
const NEGLIGIBLE: f64 = 1e-9;

/// A mixture is never made louder than by this factor: responses that are each other's opposite have no sum.
const LOUDEST: f32 = 4.0;

/// Lanes of sums, which are made in this order on every machine.
const LANES: usize = 16;

/// A measured head at one output rate.
#[derive(Debug)]
pub(super) struct Aligned {
    pub(super) corners: Arc<Corners>,
    pub(super) taps: usize,
    /// The tap at the onset.
    pub(super) lead: usize,
    /// For each corner and ear the lower band and the upper band.
    bands: Vec<f32>,
    /// The energy of each upper band.
    energies: Vec<[f32; 2]>,
}

impl Aligned {
    pub(super) fn new(measured: &Measured, rate_hz: f64) -> Self {
        let corners = measured.corners.clone();
        let ratio = measured.rate_hz / rate_hz;
        let (before, count) = room(measured, ratio);
        // All responses in full length, one ear after the other.
        let mut full = vec![0.0_f32; 2 * corners.measured * count];
        full.par_chunks_exact_mut(count).enumerate().for_each(|(n, full)| {
            let onset = measured.onsets[n / 2][n % 2];
            // The sum over taps stands for an integral: fewer taps a second must each be larger.
            let samples: Vec<f32> =
                measured.response(n / 2, n % 2).iter().map(|x| (x * ratio) as f32).collect();
            resample(&samples, onset - before as f64 * ratio, ratio, full);
        });
        let (begin, end) = audible(&full, count);
        let taps = end - begin;
        let mut aligned = Self {
            lead: before - begin.min(before),
            taps,
            bands: vec![0.0; 4 * corners.count() * taps],
            energies: vec![[0.0; 2]; corners.count()],
            corners,
        };
        let crossover = crossover(rate_hz);
        aligned.bands[..4 * aligned.corners.measured * taps]
            .par_chunks_exact_mut(2 * taps)
            .zip(full.par_chunks_exact(count))
            .for_each(|(bands, full)| split(&full[begin..end], &crossover, bands));
        for corner in 0..aligned.corners.count() {
            if corner >= aligned.corners.measured {
                aligned.make_up(corner);
            }
            aligned.energies[corner] = [0, 1].map(|ear| energy(aligned.band(corner, ear, 1)));
        }
        aligned
    }

    fn band(&self, corner: usize, ear: usize, band: usize) -> &[f32] {
        let begin = ((2 * corner + ear) * 2 + band) * self.taps;
        &self.bands[begin..begin + self.taps]
    }

    /// The responses of a direction that is not measured, or of the centre.
    fn make_up(&mut self, corner: usize) {
        let mixture = self.corners.mixtures[corner - self.corners.measured].clone();
        for ear in 0..2 {
            let mut bands = [vec![0.0_f64; self.taps], vec![0.0_f64; self.taps]];
            for (band, sums) in bands.iter_mut().enumerate() {
                for (from, weight) in &mixture {
                    for (sum, tap) in sums.iter_mut().zip(self.band(*from, ear, band)) {
                        *sum += weight * f64::from(*tap);
                    }
                }
            }
            let aim: f64 = mixture.iter().map(|(n, weight)| weight * f64::from(self.energies[*n][ear])).sum();
            let is: f64 = bands[1].iter().map(|x| x * x).sum();
            let louder = if is > 0.0 { (aim / is).sqrt().min(f64::from(LOUDEST)) } else { 1.0 };
            bands[1].iter_mut().for_each(|x| *x *= louder);
            let begin = (2 * corner + ear) * 2 * self.taps;
            for (tap, value) in self.bands[begin..begin + 2 * self.taps].iter_mut().zip(bands.concat()) {
                *tap = value as f32;
            }
        }
    }

    /// Fills both ears' taps for a direction, and gives both ears' delays in seconds. A `share` below 1 is mixed
    /// with what is heard at the centre.
    pub(super) fn mix(&self, towards: Vector, share: f64, taps: [&mut [f32]; 2]) -> [f64; 2] {
        let (corners, weights) = self.corners.grid.weights(towards);
        let centre = self.corners.count() - 1;
        let parts = [
            (corners[0], weights[0] * share),
            (corners[1], weights[1] * share),
            (corners[2], weights[2] * share),
            (centre, 1.0 - share),
        ];
        let mut delays_s = [0.0; 2];
        for (ear, taps) in taps.into_iter().enumerate() {
            let fitting = taps.len().min(self.taps);
            let (taps, rest) = taps.split_at_mut(fitting);
            rest.fill(0.0);
            taps.fill(0.0);
            let mut aim = 0.0;
            for &(corner, weight) in parts.iter().filter(|(_, weight)| *weight > 0.0) {
                delays_s[ear] += weight * self.corners.delays_s[corner][ear];
                aim += weight as f32 * self.energies[corner][ear];
                add(taps, self.band(corner, ear, 1), weight as f32);
            }
            let is = energy(taps);
            if is > 0.0 && is < aim {
                let louder = (aim / is).sqrt().min(LOUDEST);
                taps.iter_mut().for_each(|tap| *tap *= louder);
            }
            for &(corner, weight) in parts.iter().filter(|(_, weight)| *weight > 0.0) {
                add(taps, self.band(corner, ear, 0), weight as f32);
            }
        }
        delays_s
    }
}

fn add(taps: &mut [f32], band: &[f32], weight: f32) {
    for (tap, value) in taps.iter_mut().zip(band) {
        *tap += weight * value;
    }
}

fn energy(taps: &[f32]) -> f32 {
    let mut lanes = [0.0_f32; LANES];
    let chunks = taps.chunks_exact(LANES);
    for (lane, tap) in lanes.iter_mut().zip(chunks.remainder()) {
        *lane += tap * tap;
    }
    for chunk in chunks {
        for (lane, tap) in lanes.iter_mut().zip(chunk) {
            *lane += tap * tap;
        }
    }
    lanes.iter().sum()
}

/// How many taps lie before the onset at most, and how many there are at most.
fn room(measured: &Measured, ratio: f64) -> (usize, usize) {
    let onsets = measured.onsets.as_flattened();
    let first = onsets.iter().fold(f64::INFINITY, |first, onset| first.min(*onset));
    let last = onsets.iter().fold(0.0_f64, |last, onset| last.max(*onset));
    let reach = half_width(ratio) as f64;
    let before = ((last + reach) / ratio).ceil() as usize;
    let behind = ((measured.samples as f64 + reach - first) / ratio).ceil() as usize;
    (before, before + behind + 1)
}

/// The first tap and the one behind the last between which all responses lie, but for a negligible part.
fn audible(full: &[f32], count: usize) -> (usize, usize) {
    let (mut begin, mut end) = (count, 0);
    for response in full.chunks_exact(count) {
        let energy: f64 = response.iter().map(|x| f64::from(x * x)).sum();
        let reached = |mut sum: f64, x: &f32| {
            sum += f64::from(x * x);
            sum
        };
        let mut sum = 0.0;
        let audible = |x: &f32| {
            sum = reached(sum, x);
            sum > NEGLIGIBLE * energy
        };
        if let Some(first) = response.iter().position(audible) {
            begin = begin.min(first);
        }
        let mut sum = 0.0;
        let audible = |x: &f32| {
            sum = reached(sum, x);
            sum > NEGLIGIBLE * energy
        };
        if let Some(last) = response.iter().rposition(audible) {
            end = end.max(last + 1);
        }
    }
    if begin < end { (begin, end) } else { (0, 1) }
}

/// The symmetric low-pass filter that parts the bands.
fn crossover(rate_hz: f64) -> Vec<f64> {
    let length = CROSSOVER_S * rate_hz;
    let half = length.floor() as i64;
    let tap = |n: i64| {
        let x = 2.0 * CROSSOVER_HZ / rate_hz * n as f64;
        let sinc = if n == 0 { 1.0 } else { (PI * x).sin() / (PI * x) };
        sinc * (0.5 + 0.5 * (PI * n as f64 / length).cos())
    };
    let taps: Vec<f64> = (-half..=half).map(tap).collect();
    let sum: f64 = taps.iter().sum();
    taps.into_iter().map(|tap| tap / sum).collect()
}

/// Parts a response into its lower band and its upper band, which together are as long as both.
fn split(response: &[f32], crossover: &[f64], bands: &mut [f32]) {
    let (low, high) = bands.split_at_mut(response.len());
    let half = crossover.len() / 2;
    for n in 0..response.len() {
        // The filter's tap k lies upon the sample n + half − k.
        let from = (n + half + 1).saturating_sub(response.len());
        let to = (n + half).min(crossover.len() - 1);
        let sum: f64 = (from..=to).map(|k| crossover[k] * f64::from(response[n + half - k])).sum();
        low[n] = sum as f32;
        high[n] = response[n] - low[n];
    }
}
