//! Splits a recording of crumpling into clips, and guesses what each is, so that a person need only correct it.
//!
//! 1. The energy over 20 ms ([`pops`]) is held against what half of the recording is quieter than: a piece begins where it
//!    rises 10 dB above that, and lasts until it is within 3 dB of it, or until the next piece begins.
//! 2. A piece that follows a flap at once, with less than a sixth of its energy, is what still buckles of that, and joins it; the
//!    later it follows, the less energy it may have.
//! 3. A piece of whose energy the middle 90 % last less than [`CLAC_S`] is a *clac*, which is constrained; any other is a *flap*.
//! 4. The size of a flap is that of the model's flaps that sound most like it, by the quadratic-chi distance of their spectra
//!    ([`quadratic_chi`](super::quadratic_chi)), as far up as the recording reaches. It is a guess: pieces of unlike
//!    proportions may sound alike.

use std::ops::Range;

use rayon::prelude::*;
use realfft::RealFftPlanner;

use super::measure::lasts_s;
use super::plate::Shape;
use super::quadratic_chi::{BANDS, NORMALISATION, OCTAVES, REACH, edge_hz, histogram, quadratic_chi};
use super::synthetic::{FLAPS, LENGTHS_M, Paper};
use crate::corpus::cloth::pops;
use crate::corpus::spectral::check_sound;
use crate::corpus::units::high_pass::HighPass;
use crate::error::{Error, Place, Result};

/// Clips in which the middle 90 % of the energy last less than this are clacs.
pub const CLAC_S: f64 = 0.012;

/// A piece ends where its energy falls to so many times what half of the recording is quieter than: 3 dB.
const ENDS: f64 = 2.0;

/// How far the threshold of an automatic harvest lies above what half of the recording is quieter than: 10 dB.
const ABOVE: f64 = 10.0;

/// What follows a flap at once belongs to it where it has no more than such a part of its energy; what follows later by this, 1/e of that.
const FOLLOWS: f64 = 1.0 / 6.0;
const FOLLOWS_S: f64 = 0.025;

/// Pieces shorter than this are no sounds of paper.
const SHORTEST_S: f64 = 0.003;

/// The longest piece: what goes on is cut there.
const LONGEST_S: f64 = 1.5;

/// Below this there is the rumble of the room.
const HIGH_PASS_HZ: f64 = 60.0;

/// The rate at which the model's flaps are made for comparison.
const MODEL_HZ: f64 = 44_100.0;

/// A piece of a recording of crumpling.
#[derive(Debug, Clone, PartialEq)]
pub struct Piece {
    /// Where in the recording it lies, in samples.
    pub range: Range<usize>,
    /// l_r, as it is guessed; 0 for a clac.
    pub ruling_m: f64,
    /// l_c, as it is guessed; 0 for a clac.
    pub border_m: f64,
    /// How unlike the model's flaps of that size it sounds; 0 for a clac.
    pub distance: f64,
    /// The sum of squares over its samples, divided by the rate: squares of full scale times seconds.
    pub energy: f64,
}

impl Piece {
    /// Whether it is a clac; else it is a flap.
    pub fn is_clac(&self) -> bool {
        self.border_m == 0.0
    }
}

/// Finds the pieces of a recording, in order. They do not overlap. A threshold of energy over 20 ms, as that of pops, may be given;
/// sizes are those of a model.
///
/// # Errors
/// A rate that is not one of sound, or a threshold that is no number above 0.
pub fn harvest(samples: &[f32], rate_hz: u32, like: &Paper, threshold: Option<f64>) -> Result<Vec<Piece>> {
    check_sound(samples, rate_hz)?;
    if let Some(bad) = threshold.filter(|threshold| !(*threshold > 0.0 && threshold.is_finite())) {
        return Err(Error::new(format!("the threshold is {bad}, expected a number above 0"))
            .at(Place::Part("threshold".to_owned())));
    }
    let mut sound = samples.to_vec();
    HighPass::new(HIGH_PASS_HZ, rate_hz)?.process(&mut sound);
    let whole_hz = f64::from(rate_hz);
    let runs = joined(runs(&sound, whole_hz, threshold), &sound, whole_hz);
    let sizes = Sizes::new(like, whole_hz);
    runs.into_par_iter()
        .map(|range| {
            let inside = &sound[range.clone()];
            let energy = squares(inside) / whole_hz;
            let (ruling_m, border_m, distance) = if lasts_s(inside, whole_hz) < CLAC_S {
                (0.0, 0.0, 0.0)
            } else {
                sizes.nearest(inside, whole_hz)?
            };
            Ok(Piece { range, ruling_m, border_m, distance, energy })
        })
        .collect()
}

/// Where it is loud, from the beginning of each rise to where it has died away.
fn runs(sound: &[f32], rate_hz: f64, threshold: Option<f64>) -> Vec<Range<usize>> {
    let energy = pops::smooth_energy(sound, rate_hz);
    let median = {
        let mut sorted = energy.clone();
        let middle = sorted.len() / 2;
        if sorted.is_empty() { 0.0 } else { *sorted.select_nth_unstable_by(middle, f64::total_cmp).1 }
    };
    let loudest = energy.iter().copied().fold(0.0, f64::max);
    // What is digitally silent for more than half of the time has no floor of its own: there it lies 60 dB below the loudest.
    let floor = median.max(1e-6 * loudest);
    let begins = threshold.unwrap_or(ABOVE * floor);
    let ends = (begins * ENDS / ABOVE).min(begins);
    let mut runs: Vec<Range<usize>> = Vec::new();
    if loudest <= 0.0 {
        return runs;
    }
    let half = (0.5 * pops::BOX_S * rate_hz) as usize;
    let (shortest, longest) = ((SHORTEST_S * rate_hz) as usize, (LONGEST_S * rate_hz) as usize);
    let mut from = 0;
    while let Some(begin) = (from..energy.len()).find(|&n| energy[n] > begins) {
        let last = (begin..energy.len()).find(|&n| energy[n] <= ends).unwrap_or(energy.len());
        let mut begin_piece = begin;
        // What is told apart by a rise of its own within a run begins a piece of its own.
        for at in rises(&energy[begin..last]).into_iter().map(|n| begin + n).chain([last]) {
            if at > begin_piece {
                // The box is as wide as 20 ms, so it sees a piece half of that before its sound.
                let early = (begin_piece + half).min(at).saturating_sub(half / 4);
                let end = at.min(early + longest).max(early);
                let piece = early.min(end)..end;
                if piece.len() >= shortest {
                    runs.push(piece);
                }
            }
            begin_piece = at;
        }
        from = last.max(begin + 1);
    }
    runs
}

fn squares(samples: &[f32]) -> f64 {
    samples.iter().map(|v| f64::from(*v).powi(2)).sum()
}

/// Puts what still buckles of a flap to it.
fn joined(runs: Vec<Range<usize>>, sound: &[f32], rate_hz: f64) -> Vec<Range<usize>> {
    let mut joined: Vec<Range<usize>> = Vec::new();
    // The energy of the last one before others joined it.
    let mut main = 0.0;
    for run in runs {
        let own = squares(&sound[run.clone()]);
        match joined.last_mut() {
            Some(last)
                if own
                    < FOLLOWS * main * (-((run.start - last.end) as f64) / (FOLLOWS_S * rate_hz)).exp()
                    && ((run.end - last.start) as f64) < LONGEST_S * rate_hz
                    && lasts_s(&sound[last.clone()], rate_hz) >= CLAC_S =>
            {
                last.end = run.end;
            }
            _ => {
                main = own;
                joined.push(run);
            }
        }
    }
    joined
}

/// Where within a run the energy rises 10 dB above what it had fallen to.
fn rises(energy: &[f64]) -> Vec<usize> {
    let (mut lowest, mut at_lowest, mut highest) = (f64::INFINITY, 0, 0.0f64);
    let mut rises = Vec::new();
    let mut has_fallen = false;
    for (n, &value) in energy.iter().enumerate() {
        if !has_fallen {
            highest = highest.max(value);
            if value < highest / ABOVE {
                has_fallen = true;
                (lowest, at_lowest) = (value, n);
            }
        } else if value < lowest {
            (lowest, at_lowest) = (value, n);
        } else if value > ABOVE * lowest {
            rises.push(at_lowest);
            has_fallen = false;
            highest = value;
        }
    }
    rises
}

/// What a model's flaps sound like at each size.
struct Sizes {
    /// l_r, l_c and a histogram.
    places: Vec<(f64, f64, Vec<f64>)>,
    /// How many bands of it the recording reaches.
    bands: usize,
}

impl Sizes {
    fn new(like: &Paper, rate_hz: f64) -> Self {
        let sizes = LENGTHS_M.iter().flat_map(|&ruling_m| LENGTHS_M.map(|border_m| (ruling_m, border_m)));
        let sizes: Vec<(f64, f64)> = sizes.collect();
        // Bands above half of the recording's rate are empty, whatever it is.
        let bands = (0..BANDS * OCTAVES).take_while(|band| edge_hz(*band + 1) < 0.45 * rate_hz).count();
        let place = |&(ruling_m, border_m): &(f64, f64)| {
            let shape = Shape::rectangle(ruling_m, border_m);
            let mut mean = vec![0.0; bands];
            for number in 0..FLAPS as u64 {
                let own = spectrum(&like.flap(&shape, number, MODEL_HZ), MODEL_HZ, bands);
                mean.iter_mut().zip(&own).for_each(|(mean, own)| *mean += own / FLAPS as f64);
            }
            (ruling_m, border_m, mean)
        };
        Self { places: sizes.par_iter().map(place).collect(), bands }
    }

    /// The size of what sounds most like a piece, and how unlike it is.
    fn nearest(&self, samples: &[f32], rate_hz: f64) -> Result<(f64, f64, f64)> {
        let own = spectrum(samples, rate_hz, self.bands);
        let mut best = (0.0, 0.0, f64::INFINITY);
        for (ruling_m, border_m, histogram) in &self.places {
            let distance = quadratic_chi(&own, histogram, REACH, NORMALISATION)?;
            if distance < best.2 {
                best = (*ruling_m, *border_m, distance);
            }
        }
        Ok(best)
    }
}

/// The histogram of a piece's magnitude spectrum, of its first bands.
fn spectrum(samples: &[f32], rate_hz: f64, bands: usize) -> Vec<f64> {
    let length = samples.len().max(1 << 12).next_power_of_two();
    let forward = RealFftPlanner::<f32>::new().plan_fft_forward(length);
    let (mut input, mut output) = (forward.make_input_vec(), forward.make_output_vec());
    input[..samples.len()].copy_from_slice(samples);
    // The lengths are those that the transform asked for.
    if forward.process(&mut input, &mut output).is_err() {
        return vec![0.0; bands];
    }
    let magnitudes: Vec<f64> = output.iter().skip(1).map(|bin| f64::from(bin.norm())).collect();
    let mut histogram = histogram(&magnitudes, rate_hz / length as f64);
    histogram.truncate(bands);
    let sum: f64 = histogram.iter().sum();
    if sum > 0.0 {
        histogram.iter_mut().for_each(|band| *band /= sum);
    }
    histogram
}

#[cfg(test)]
mod tests;
