//! Correlation by FFT, block by block: overlap-save.

use std::collections::BTreeMap;
use std::sync::Arc;

use rayon::prelude::*;
use realfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};

use super::energy::Energies;
use super::picker::{Candidate, Picker};
use super::{Matching, Peak};

/// A block is at least so many times as long as its grains. Longer ones waste less on the overlap, but leave the
/// caches of the processor.
const BLOCK: usize = 4;

/// The shortest block.
const FINEST: usize = 256;

/// How many spectral values of a recording are held at a time: 64 MiB.
const HELD: usize = 1 << 23;

/// How many correlations are compared at a time.
const LANES: usize = 8;
const CHUNK: usize = 4 * LANES;

/// A peak that stands out less is sought again in double precision.
const UNSURE: f64 = 2e-4;

/// Two grains that are correlated at once.
struct Pair {
    grains: [Option<Track>; 2],
}

/// One grain and what was found of it.
struct Track {
    number: usize,
    length: usize,
    /// The least energy that counts as sound.
    floor: f64,
    picker: Picker,
}

/// What a thread works in.
struct Room {
    /// The spectra of two grains, the second one turned by i.
    pair: Vec<Complex<f32>>,
    block: Vec<Complex<f32>>,
    scratch: Vec<Complex<f32>>,
}

/// The size of the blocks in which a grain is matched with a recording, both lengths in samples.
fn block(length: usize, recording: usize) -> usize {
    (BLOCK * length).min(recording + length + 2).next_power_of_two().max(FINEST)
}

/// Grains of different groups are never correlated at once, and blocks do not depend on which grains there are. So what
/// is found of a grain depends on its group alone, to the last bit.
pub(super) fn pattern(
    matching: &Matching,
    grains: &[&[f32]],
    groups: &[usize],
    rate_hz: u32,
    recording: &[f32],
) -> Vec<Peak> {
    let energies = Energies::new(recording);
    let spacing = (matching.spacing_s * f64::from(rate_hz)).round() as usize;
    let mut classes: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (number, grain) in grains.iter().enumerate().filter(|(_, grain)| grain.len() <= recording.len()) {
        classes.entry(block(grain.len(), recording.len())).or_default().push(number);
    }
    // The highest energy over a length is asked once a length.
    let mut lengths: Vec<usize> = classes.values().flatten().map(|&number| grains[number].len()).collect();
    lengths.sort_unstable();
    lengths.dedup();
    let share = 10f64.powf(matching.quietest_db / 10.0);
    let floors: BTreeMap<usize, f64> =
        lengths.into_par_iter().map(|length| (length, share * energies.highest(length))).collect();
    let mut planner = FftPlanner::new();
    let mut peaks: Vec<Peak> = Vec::new();
    for (size, mut numbers) in classes {
        let group = |number: usize| groups.get(number).copied().unwrap_or(0);
        numbers.sort_by_key(|&number| (group(number), grains[number].len(), number));
        let longest = longest(size, recording.len());
        let track = |&number: &usize| {
            let length = grains[number].len();
            let picker = Picker::new(matching.peaks_per_grain, matching.least_correlation, spacing);
            Track { number, length, floor: floors[&length], picker }
        };
        let pairs = numbers
            .chunk_by(|&a, &b| group(a) == group(b))
            .flat_map(|numbers| numbers.chunks(2))
            .map(|two| Pair { grains: [two.first().map(track), two.get(1).map(track)] });
        let class = Class {
            recording,
            grains,
            energies: &energies,
            size,
            // A block knows its neighbours' outermost lags, so that each can tell its own peaks.
            step: size - longest - 1,
            forward: planner.plan_fft_forward(size),
            inverse: planner.plan_fft_inverse(size),
        };
        peaks.extend(class.correlate(pairs.collect(), matching));
    }
    peaks.sort_by_key(|peak| peak.grain);
    peaks
}

/// The longest grain that is matched in blocks of a size.
fn longest(size: usize, recording: usize) -> usize {
    let (mut fits, mut too_long) = (1, recording + 1);
    while too_long - fits > 1 {
        let length = fits + (too_long - fits) / 2;
        if block(length, recording) <= size { fits = length } else { too_long = length }
    }
    fits
}

/// All grains that share a size of block.
struct Class<'a> {
    recording: &'a [f32],
    grains: &'a [&'a [f32]],
    energies: &'a Energies,
    size: usize,
    step: usize,
    forward: Arc<dyn Fft<f32>>,
    inverse: Arc<dyn Fft<f32>>,
}

impl Class<'_> {
    fn correlate(&self, mut pairs: Vec<Pair>, matching: &Matching) -> Vec<Peak> {
        let blocks = self.recording.len().div_ceil(self.step);
        let at_once = (HELD / self.size).max(1);
        for first in (0..blocks).step_by(at_once) {
            let count = at_once.min(blocks - first);
            let mut spectra = vec![Complex::default(); count * self.size];
            spectra.par_chunks_mut(self.size).enumerate().for_each_init(
                || vec![Complex::default(); self.forward.get_inplace_scratch_len()],
                |scratch, (index, spectrum)| self.transform(first + index, spectrum, scratch),
            );
            pairs.par_iter_mut().for_each_init(
                || self.room(),
                |room, pair| {
                    self.load(pair, room);
                    for (index, spectrum) in spectra.chunks_exact(self.size).enumerate() {
                        self.search(first + index, spectrum, pair, room);
                    }
                },
            );
        }
        let tracks: Vec<Track> = pairs.into_iter().flat_map(|pair| pair.grains).flatten().collect();
        let peaks: Vec<Vec<Peak>> =
            tracks.into_par_iter().map(|track| self.finish(track, matching)).collect();
        peaks.concat()
    }

    fn room(&self) -> Room {
        let scratch = self.forward.get_inplace_scratch_len().max(self.inverse.get_inplace_scratch_len());
        Room {
            pair: vec![Complex::default(); self.size],
            block: vec![Complex::default(); self.size],
            scratch: vec![Complex::default(); scratch],
        }
    }

    /// The spectrum of a block of the recording, whose index 0 is a sample before the block's first.
    fn transform(&self, block: usize, spectrum: &mut [Complex<f32>], scratch: &mut [Complex<f32>]) {
        let first = block * self.step;
        let (skipped, from) = if first == 0 { (1, 0) } else { (0, first - 1) };
        let to = (from + self.size - skipped).min(self.recording.len());
        for (bin, sample) in spectrum[skipped..].iter_mut().zip(&self.recording[from..to]) {
            *bin = Complex::new(*sample, 0.0);
        }
        self.forward.process_with_scratch(spectrum, scratch);
    }

    /// The spectra of two grains of energy 1, reversed in time: their product with a recording's is a correlation.
    fn load(&self, pair: &Pair, room: &mut Room) {
        room.pair.fill(Complex::default());
        for (part, track) in pair.grains.iter().enumerate() {
            let Some(track) = track else { continue };
            let grain = self.grains[track.number];
            let norm = grain.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>().sqrt();
            let scale = if norm > 0.0 { 1.0 / (norm * self.size as f64) } else { 0.0 };
            for (i, &sample) in grain.iter().enumerate() {
                let to = &mut room.pair[(self.size - i) % self.size];
                let value = (f64::from(sample) * scale) as f32;
                if part == 0 { to.re = value } else { to.im = value }
            }
        }
        self.forward.process_with_scratch(&mut room.pair, &mut room.scratch);
    }

    /// Looks for peaks of two grains in one block.
    fn search(&self, block: usize, spectrum: &[Complex<f32>], pair: &mut Pair, room: &mut Room) {
        let first = block * self.step;
        let is_silent = |track: &Option<Track>| {
            track.as_ref().is_none_or(|track| {
                let to = (first + self.step + track.length).min(self.recording.len());
                self.energies.of(first, to.saturating_sub(first)) < track.floor || track.floor <= 0.0
            })
        };
        if pair.grains.iter().all(is_silent) {
            return;
        }
        pulp::Arch::new().dispatch(Product { a: spectrum, b: &room.pair, product: &mut room.block });
        self.inverse.process_with_scratch(&mut room.block, &mut room.scratch);
        let owned = self.step.min(self.recording.len() - first);
        for chunk in (0..owned).step_by(CHUNK) {
            let count = CHUNK.min(owned - chunk);
            let lags = &room.block[1 + chunk..][..count];
            let highest = pulp::Arch::new().dispatch(Highest { lags });
            for (part, track) in pair.grains.iter_mut().enumerate() {
                let Some(track) = track else { continue };
                let last_lag = self.recording.len() - track.length;
                let from = first + chunk;
                if from > last_lag {
                    continue;
                }
                let to = (from + count - 1).min(last_lag);
                let energy = self.energies.least(from, to, track.length).max(track.floor);
                let value = f64::from(highest[part]).max(0.0);
                let least = track.picker.least();
                if energy > 0.0 && value > 0.0 && value * value >= least * least * energy {
                    self.look(first, from, to, part, &room.block, track);
                }
            }
        }
    }

    /// Offers the peaks of one grain from one lag to another.
    fn look(
        &self,
        first: usize,
        from: usize,
        to: usize,
        part: usize,
        block: &[Complex<f32>],
        track: &mut Track,
    ) {
        let last_lag = self.recording.len() - track.length;
        // The correlation at a lag, counted from one before.
        let value = |lag_and_1: usize| -> f64 {
            if lag_and_1 == 0 || lag_and_1 > last_lag + 1 {
                return 0.0;
            }
            let energy = self.energies.of(lag_and_1 - 1, track.length);
            let bin = block[lag_and_1 - first];
            let product = f64::from(if part == 0 { bin.re } else { bin.im });
            if energy < track.floor || energy <= 0.0 { 0.0 } else { product / energy.sqrt() }
        };
        let (mut before, mut here) = (value(from), value(from + 1));
        for lag in from..=to {
            let after = value(lag + 2);
            if here > before && here >= after && here > 0.0 && here >= track.picker.least() {
                let margin = (here - before).min(here - after);
                track.picker.offer(Candidate { at: lag, value: here, margin });
            }
            (before, here) = (here, after);
        }
    }

    /// The peaks of one grain, with their values in double precision.
    fn finish(&self, track: Track, matching: &Matching) -> Vec<Peak> {
        let grain = self.grains[track.number];
        let norm = dot(grain, grain).sqrt();
        let last_lag = self.recording.len() - track.length;
        let exact = |lag: usize| -> f64 {
            let piece = &self.recording[lag..][..track.length];
            let energy = dot(piece, piece);
            if energy <= 0.0 || norm <= 0.0 { 0.0 } else { dot(piece, grain) / (energy.sqrt() * norm) }
        };
        let mut found: Vec<(f64, usize)> = Vec::new();
        for candidate in track.picker.finish() {
            let mut best = (exact(candidate.at), candidate.at);
            if candidate.margin < UNSURE {
                best = climbed(best, last_lag, exact);
            }
            found.push(best);
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        found.dedup_by_key(|&mut (_, lag)| lag);
        found.retain(|(value, _)| *value > 0.0 && *value >= matching.least_correlation);
        found.truncate(matching.peaks_per_grain);
        let peak = |(value, lag): (f64, usize)| Peak {
            // The number of grains was held against 32 bits.
            grain: track.number as u32,
            start: lag as u64,
            correlation: value as f32,
        };
        found.into_iter().map(peak).collect()
    }
}

/// The top of the hill on which a value and its lag are: what single precision could not tell from its neighbours may
/// be one of them.
fn climbed(mut best: (f64, usize), last_lag: usize, exact: impl Fn(usize) -> f64) -> (f64, usize) {
    loop {
        let aside = [best.1.checked_sub(1), Some(best.1 + 1).filter(|&lag| lag <= last_lag)];
        let values = aside.into_iter().flatten().map(|lag| (exact(lag), lag));
        match values.max_by(|a, b| a.0.total_cmp(&b.0)) {
            Some(higher) if higher.0 > best.0 => best = higher,
            _ => return best,
        }
    }
}

/// The sum of products, in eight lanes, so that it is the same on every machine.
fn dot(a: &[f32], b: &[f32]) -> f64 {
    let mut lanes = [0.0f64; LANES];
    let (a, a_rest) = a.as_chunks::<LANES>();
    let (b, b_rest) = b.as_chunks::<LANES>();
    for (a, b) in a.iter().zip(b) {
        for i in 0..LANES {
            lanes[i] += f64::from(a[i]) * f64::from(b[i]);
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum();
    lanes.iter().sum::<f64>() + rest
}

struct Product<'a> {
    a: &'a [Complex<f32>],
    b: &'a [Complex<f32>],
    product: &'a mut [Complex<f32>],
}

impl pulp::WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let (a, a_rest) = S::as_simd_c32s(self.a);
        let (b, b_rest) = S::as_simd_c32s(self.b);
        let (product, rest) = S::as_mut_simd_c32s(self.product);
        for ((product, a), b) in product.iter_mut().zip(a).zip(b) {
            *product = simd.mul_c32s(*a, *b);
        }
        for ((product, a), b) in rest.iter_mut().zip(a_rest).zip(b_rest) {
            *product = a * b;
        }
    }
}

/// The highest real and the highest imaginary part.
struct Highest<'a> {
    lags: &'a [Complex<f32>],
}

impl pulp::WithSimd for Highest<'_> {
    type Output = [f32; 2];

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> [f32; 2] {
        let values: &[f32] = pulp::bytemuck::cast_slice(self.lags);
        let mut highest = [f32::NEG_INFINITY; 2 * LANES];
        let (chunks, rest) = values.as_chunks::<{ 2 * LANES }>();
        for chunk in chunks {
            for i in 0..2 * LANES {
                highest[i] = if chunk[i] > highest[i] { chunk[i] } else { highest[i] };
            }
        }
        for (i, &value) in rest.iter().enumerate() {
            highest[i] = if value > highest[i] { value } else { highest[i] };
        }
        let pick =
            |part: usize| highest.iter().skip(part).step_by(2).copied().fold(f32::NEG_INFINITY, f32::max);
        [pick(0), pick(1)]
    }
}
