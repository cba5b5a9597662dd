//! Peaks of the short-time spectrum, frame by frame.

use std::f64::consts::TAU;

use rayon::prelude::*;
use realfft::num_complex::Complex;
use realfft::{RealFftPlanner, RealToComplex};

use super::{Key, Partials, SpectralModel};

/// How many times the spectrum is finer than the window's own, at least. The parabola's error falls with its fourth
/// power or so.
const ZERO_PADDING: usize = 2;

/// The share of what is missing that one correction adds; all of it might overshoot, as neighbours overlap.
const STEP: f64 = 0.7;

/// The four-term Blackman–Harris window: side lobes of −92 dB, so that no side lobe passes for a partial.
const BLACKMAN_HARRIS: [f64; 4] = [0.35875, -0.48829, 0.14128, -0.01168];

/// The window at an odd number of places, its centre the middle one.
fn window(length: usize) -> Vec<f64> {
    let half = (length / 2) as f64;
    (0..length)
        .map(|i| {
            let turn = TAU * (i as f64 / (2.0 * half + 1.0) + 0.5 / (2.0 * half + 1.0));
            BLACKMAN_HARRIS.iter().enumerate().map(|(n, a)| a * (n as f64 * turn).cos()).sum()
        })
        .collect()
}

/// Looks at the residual under the same windows for what the partials there have too little or too much of: where
/// peaks overlap, each has read some of its neighbours' sound as its own.
pub(super) fn correct(model: &SpectralModel, residual: &[f32], partials: &mut Partials) {
    let spectrum = Spectrum::new(model, residual, partials.rate_hz);
    let frames = residual.len().div_ceil(partials.hop) + 1;
    let mut at: Vec<Vec<(usize, usize)>> = vec![Vec::new(); frames + 1];
    for (number, partial) in partials.partials.iter().enumerate() {
        for index in 0..partial.keys.len() {
            at[partial.first_frame + index].push((number, index));
        }
    }
    let known: &Partials = partials;
    let corrected: Vec<Vec<Key>> = at
        .par_iter()
        .enumerate()
        .map_init(
            || spectrum.room(),
            |room, (frame, keys)| {
                let Some(scale) = spectrum.transform(frame * known.hop, room) else {
                    return keys.iter().map(|&(number, index)| known.partials[number].keys[index]).collect();
                };
                keys.iter()
                    .map(|&(number, index)| {
                        let key = known.partials[number].keys[index];
                        let missing = interpolated(&room.bins, key.frequency_hz / spectrum.bin_hz) * scale;
                        let sum = Complex::from_polar(key.amplitude, key.phase) + missing * STEP;
                        Key { amplitude: sum.norm(), phase: sum.arg(), ..key }
                    })
                    .collect()
            },
        )
        .collect();
    for (keys, places) in corrected.iter().zip(&at) {
        for (key, &(number, index)) in keys.iter().zip(places) {
            partials.partials[number].keys[index] = *key;
        }
    }
}

/// The spectrum between two bins.
fn interpolated(bins: &[Complex<f64>], place: f64) -> Complex<f64> {
    let below = (place as usize).min(bins.len() - 2);
    let share = place - below as f64;
    bins[below] * (1.0 - share) + bins[below + 1] * share
}

/// The peaks of each frame, by falling amplitude; frame m is centred on sample m · hop, and the last is at the end or
/// beyond it.
pub(super) fn find(model: &SpectralModel, samples: &[f32], rate_hz: u32, hop: usize) -> Vec<Vec<Key>> {
    let spectrum = Spectrum::new(model, samples, rate_hz);
    let frames = (samples.len() - 1).div_ceil(hop) + 1;
    let mut found: Vec<Vec<Key>> = (0..frames)
        .into_par_iter()
        .map_init(|| spectrum.room(), |room, frame| spectrum.peaks(frame * hop, model.most_partials, room))
        .collect();
    let loudest = found.iter().flatten().map(|key| key.amplitude).fold(0.0, f64::max);
    let least = loudest * 10f64.powf(model.threshold_db / 20.0);
    for keys in &mut found {
        keys.retain(|key| key.amplitude >= least && key.amplitude > 0.0);
    }
    found
}

struct Spectrum<'a> {
    samples: &'a [f32],
    window: Vec<f64>,
    fft: std::sync::Arc<dyn RealToComplex<f64>>,
    half: usize,
    bin_hz: f64,
}

/// What a thread works in.
struct Room {
    input: Vec<f64>,
    bins: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
    decibels: Vec<f64>,
}

impl<'a> Spectrum<'a> {
    fn new(model: &SpectralModel, samples: &'a [f32], rate_hz: u32) -> Self {
        let half = ((model.window_s * f64::from(rate_hz) / 2.0) as usize).max(4);
        let window = window(2 * half + 1);
        let size = (ZERO_PADDING * window.len()).next_power_of_two();
        let fft = RealFftPlanner::<f64>::new().plan_fft_forward(size);
        Self { samples, window, fft, half, bin_hz: f64::from(rate_hz) / size as f64 }
    }

    fn room(&self) -> Room {
        let bins = self.fft.make_output_vec();
        Room {
            input: self.fft.make_input_vec(),
            scratch: self.fft.make_scratch_vec(),
            decibels: vec![0.0; bins.len()],
            bins,
        }
    }

    /// The spectrum about a sample, and what makes a bin's value an amplitude.
    fn transform(&self, centre: usize, room: &mut Room) -> Option<f64> {
        let size = room.input.len();
        room.input.fill(0.0);
        // The centre of the window at index 0, so that the phase is that at the centre. What lies beyond the
        // recording's ends has no weight.
        let mut weight = 0.0;
        let first = centre as i64 - self.half as i64;
        for (i, gain) in self.window.iter().enumerate() {
            let Ok(at) = usize::try_from(first + i as i64) else { continue };
            let Some(sample) = self.samples.get(at) else { break };
            weight += gain;
            room.input[(i + size - self.half) % size] = gain * f64::from(*sample);
        }
        if weight <= 0.0 {
            return None;
        }
        // The transform fails for wrong lengths alone, and these are the plan's own.
        let done = self.fft.process_with_scratch(&mut room.input, &mut room.bins, &mut room.scratch);
        debug_assert!(done.is_ok());
        Some(2.0 / weight)
    }

    /// The highest peaks about a sample.
    fn peaks(&self, centre: usize, most: usize, room: &mut Room) -> Vec<Key> {
        let Some(scale) = self.transform(centre, room) else { return Vec::new() };
        for (level, bin) in room.decibels.iter_mut().zip(&room.bins) {
            *level = 0.5 * (bin.norm_sqr() + f64::MIN_POSITIVE).ln();
        }
        let mut found: Vec<Key> = (1..room.decibels.len() - 1)
            .filter(|&k| {
                let [before, here, after] = [room.decibels[k - 1], room.decibels[k], room.decibels[k + 1]];
                here > before && here >= after && here > -300.0
            })
            .map(|k| {
                let [a, b, c] = [room.decibels[k - 1], room.decibels[k], room.decibels[k + 1]];
                // The vertex of the parabola through three levels, within half a bin of the middle.
                let offset = 0.5 * (a - c) / (a - 2.0 * b + c);
                let level = b - 0.25 * (a - c) * offset;
                let aside = if offset < 0.0 { room.bins[k - 1] } else { room.bins[k + 1] };
                // The phase is nearly constant over the lobe: that of the sum weighted by nearness.
                let share = offset.abs();
                let mixed = room.bins[k] * (1.0 - share) + aside * share;
                Key {
                    frequency_hz: (k as f64 + offset) * self.bin_hz,
                    amplitude: scale * level.exp(),
                    phase: mixed.arg(),
                }
            })
            .collect();
        found.sort_by(|a, b| b.amplitude.total_cmp(&a.amplitude));
        found.truncate(most);
        found
    }
}
