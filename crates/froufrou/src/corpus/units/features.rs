//! What a unit sounds like, as a few numbers: f(x) = DCT(log(mel(|STFT|²))).
//!
//! These are the conventions of librosa's `mfcc`: Slaney's mel scale (not HTK's), triangles of equal area, power, an
//! orthonormal cosine transform of type II, power below 10⁻¹⁰ taken as that. Unlike there, the logarithm is natural
//! unless decibels are asked for, and nothing depends on the loudest unit.
//!
//! Unit m has the samples from m U on, U of them; its window has the same middle. What a window reaches beyond the ends
//! of the sound is silence, and so is what the last unit lacks.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use rayon::prelude::*;
use realfft::num_complex::Complex;
use realfft::{RealFftPlanner, RealToComplex};

use super::settings::{FeatureSettings, Logarithm, Window};
use crate::error::{Error, Place, Result};

/// Power that is taken for what is less.
const FLOOR: f64 = 1e-10;

/// How many units a thread does at a time.
const STRETCH: usize = 512;

/// The features of many units, one row each.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Features {
    dimensions: usize,
    values: Vec<f32>,
}

impl Features {
    /// Rows of so many numbers, one after another. What is left over at the end is left out.
    pub fn new(dimensions: usize, mut values: Vec<f32>) -> Self {
        values.truncate(values.len() / dimensions.max(1) * dimensions);
        Self { dimensions, values }
    }

    /// How many numbers a unit has.
    pub fn dimensions(&self) -> usize {
        self.dimensions
    }

    /// How many units there are.
    pub fn len(&self) -> usize {
        self.values.len() / self.dimensions.max(1)
    }

    /// True where there are none.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// The features of a unit.
    ///
    /// # Panics
    /// Where there is no such unit.
    pub fn row(&self, unit: usize) -> &[f32] {
        &self.values[unit * self.dimensions..][..self.dimensions]
    }

    /// All rows.
    pub fn rows(&self) -> std::slice::ChunksExact<'_, f32> {
        self.values.chunks_exact(self.dimensions.max(1))
    }

    /// All numbers, row by row.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Several side by side, as those of two ears. The shortest ends all.
    pub fn side_by_side(parts: &[Self]) -> Self {
        let dimensions = parts.iter().map(|part| part.dimensions).sum();
        let units = parts.iter().map(Self::len).min().unwrap_or(0);
        let mut values = Vec::with_capacity(units * dimensions);
        for unit in 0..units {
            parts.iter().for_each(|part| values.extend_from_slice(part.row(unit)));
        }
        Self { dimensions, values }
    }
}

/// A band of the mel scale: weights from a bin on.
#[derive(Debug, Clone, PartialEq)]
struct Band {
    first: usize,
    weights: Vec<f64>,
}

/// Makes features of sound at one rate.
///
/// ```
/// use froufrou::corpus::units::FeatureSettings;
/// use froufrou::corpus::units::features::Extractor;
/// let extractor = Extractor::new(&FeatureSettings::default(), 48_000)?;
/// let sound: Vec<f32> = (0..4800).map(|i| (0.3 * i as f32).sin()).collect();
/// let features = extractor.features(&sound);
/// // 4.2 ms are 202 samples at 48 kHz; the last unit is not full.
/// assert_eq!((features.len(), features.dimensions()), (24, 3));
/// # Ok::<(), froufrou::Error>(())
/// ```
pub struct Extractor {
    unit: usize,
    window: Vec<f64>,
    fft: Arc<dyn RealToComplex<f64>>,
    bands: Vec<Band>,
    /// Rows of the cosine transform, one a coefficient.
    cosines: Vec<Vec<f64>>,
    logarithm: Logarithm,
}

impl Extractor {
    /// # Errors
    /// Settings that make no sense, at this rate or at all.
    pub fn new(settings: &FeatureSettings, rate_hz: u32) -> Result<Self> {
        settings.check()?;
        if !super::super::spectral::RATES_HZ.contains(&rate_hz) {
            return Err(Error::new(format!("the rate is {rate_hz} Hz, expected 1000 to 768000 Hz")));
        }
        let half_hz = f64::from(rate_hz) / 2.0;
        let highest_hz = settings.highest_hz.unwrap_or(half_hz);
        if highest_hz > half_hz || settings.lowest_hz >= highest_hz {
            let (lowest_hz, part) = (settings.lowest_hz, Place::Part("units: highest_hz".to_owned()));
            return Err(Error::new(format!(
                "mel bands from {lowest_hz} to {highest_hz} Hz do not fit below {half_hz} Hz, half the rate"
            ))
            .at(part));
        }
        let length = settings.window_samples(rate_hz);
        let window = match settings.window {
            Window::Hann => (0..length).map(|i| 0.5 - 0.5 * (TAU * i as f64 / length as f64).cos()).collect(),
            Window::Rectangular => vec![1.0; length],
        };
        let size = length.next_power_of_two().max(2);
        let bands = mel_bands(settings.mel_bands, settings.lowest_hz, highest_hz, size, rate_hz);
        let n = settings.mel_bands as f64;
        let cosines = (0..settings.coefficients).map(|k| {
            let scale = if k == 0 { 1.0 / n } else { 2.0 / n }.sqrt();
            let cosine = |b: usize| scale * (PI * k as f64 * (b as f64 + 0.5) / n).cos();
            (0..settings.mel_bands).map(cosine).collect()
        });
        Ok(Self {
            unit: settings.unit_samples(rate_hz),
            window,
            fft: RealFftPlanner::new().plan_fft_forward(size),
            bands,
            cosines: cosines.collect(),
            logarithm: settings.logarithm,
        })
    }

    /// Samples of a unit.
    pub fn unit_samples(&self) -> usize {
        self.unit
    }

    /// How many numbers a unit has.
    pub fn dimensions(&self) -> usize {
        self.cosines.len()
    }

    /// How many units so many samples make; the last may not be full.
    pub fn units(&self, samples: usize) -> usize {
        samples.div_ceil(self.unit)
    }

    /// The features of all units of one channel, on all cores.
    pub fn features(&self, samples: &[f32]) -> Features {
        let dimensions = self.dimensions();
        let mut values = vec![0.0f32; self.units(samples.len()) * dimensions];
        values.par_chunks_mut(STRETCH * dimensions).enumerate().for_each(|(stretch, values)| {
            let mut room = Room::new(self);
            for (m, row) in values.chunks_exact_mut(dimensions).enumerate() {
                let first = self.first(stretch * STRETCH + m);
                room.load(&self.window, samples, first);
                room.features(self, row);
            }
        });
        Features { dimensions, values }
    }

    /// Features of a sound that comes block by block.
    pub fn stream(&self) -> FeatureStream<'_> {
        FeatureStream {
            extractor: self,
            room: Room::new(self),
            held: Vec::new(),
            held_from: 0,
            unit: 0,
            end: 0,
        }
    }

    /// Where a unit's window begins.
    fn first(&self, unit: usize) -> i64 {
        (unit * self.unit) as i64 + (self.unit as i64 - self.window.len() as i64).div_euclid(2)
    }
}

/// What a thread needs.
struct Room {
    input: Vec<f64>,
    bins: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
    power: Vec<f64>,
    levels: Vec<f64>,
}

impl Room {
    fn new(extractor: &Extractor) -> Self {
        Self {
            input: extractor.fft.make_input_vec(),
            bins: extractor.fft.make_output_vec(),
            scratch: extractor.fft.make_scratch_vec(),
            power: vec![0.0; extractor.fft.len() / 2 + 1],
            levels: vec![0.0; extractor.bands.len()],
        }
    }

    /// Samples from a place on, under the window.
    fn load(&mut self, window: &[f64], samples: &[f32], first: i64) {
        self.input.fill(0.0);
        let skipped = usize::try_from(-first).unwrap_or(0).min(window.len());
        let from = usize::try_from(first).unwrap_or(0);
        let part = samples.get(from..).unwrap_or_default();
        let into = self.input[skipped..window.len()].iter_mut();
        for ((into, weight), sample) in into.zip(&window[skipped..]).zip(part) {
            *into = weight * f64::from(*sample);
        }
    }

    fn features(&mut self, extractor: &Extractor, row: &mut [f32]) {
        // The lengths are those that the plan asked for.
        let transformed =
            extractor.fft.process_with_scratch(&mut self.input, &mut self.bins, &mut self.scratch);
        if transformed.is_err() {
            return;
        }
        for (power, bin) in self.power.iter_mut().zip(&self.bins) {
            *power = bin.norm_sqr();
        }
        for (level, band) in self.levels.iter_mut().zip(&extractor.bands) {
            let bins = &self.power[band.first..];
            let sum: f64 = band.weights.iter().zip(bins).map(|(weight, power)| weight * power).sum();
            *level = match extractor.logarithm {
                Logarithm::Natural => sum.max(FLOOR).ln(),
                Logarithm::Decibels => 10.0 * sum.max(FLOOR).log10(),
            };
        }
        for (value, cosines) in row.iter_mut().zip(&extractor.cosines) {
            *value = cosines.iter().zip(&self.levels).map(|(c, level)| c * level).sum::<f64>() as f32;
        }
    }
}

/// Features of a sound that comes block by block, with no more of it in memory than a window.
pub struct FeatureStream<'a> {
    extractor: &'a Extractor,
    room: Room,
    held: Vec<f32>,
    /// The number of the first sample that is held, and one past the last.
    held_from: usize,
    end: usize,
    unit: usize,
}

impl FeatureStream<'_> {
    /// The next samples; gives the features of units that are known by them, row by row. The bits are those of
    /// [`Extractor::features`], however the sound is cut into blocks.
    pub fn push(&mut self, block: &[f32]) -> Features {
        self.held.extend_from_slice(block);
        self.end += block.len();
        let window = self.extractor.window.len() as i64;
        let mut values = Vec::new();
        loop {
            let last = self.extractor.first(self.unit) + window;
            if last > self.end as i64 || (self.unit + 1) * self.extractor.unit > self.end {
                break;
            }
            self.add(&mut values);
        }
        let needed = usize::try_from(self.extractor.first(self.unit)).unwrap_or(0).min(self.end);
        if needed > self.held_from {
            self.held.drain(..needed - self.held_from);
            self.held_from = needed;
        }
        Features { dimensions: self.extractor.dimensions(), values }
    }

    /// The features of what is left when the sound is over.
    pub fn finish(mut self) -> Features {
        let mut values = Vec::new();
        while self.unit < self.extractor.units(self.end) {
            self.add(&mut values);
        }
        Features { dimensions: self.extractor.dimensions(), values }
    }

    fn add(&mut self, values: &mut Vec<f32>) {
        let first = self.extractor.first(self.unit) - self.held_from as i64;
        self.room.load(&self.extractor.window, &self.held, first);
        let at = values.len();
        values.resize(at + self.extractor.dimensions(), 0.0);
        self.room.features(self.extractor, &mut values[at..]);
        self.unit += 1;
    }
}

/// Slaney's mel scale: straight up to 1 kHz, logarithmic above.
fn mel(hz: f64) -> f64 {
    if hz < 1000.0 { hz * 3.0 / 200.0 } else { 15.0 + (hz / 1000.0).ln() * 27.0 / 6.4f64.ln() }
}

/// The inverse of [`mel`].
fn hertz(mel: f64) -> f64 {
    if mel < 15.0 { mel * 200.0 / 3.0 } else { 1000.0 * ((mel - 15.0) * 6.4f64.ln() / 27.0).exp() }
}

/// Triangles of equal area whose corners are even on the mel scale.
fn mel_bands(count: usize, lowest_hz: f64, highest_hz: f64, size: usize, rate_hz: u32) -> Vec<Band> {
    let (low, high) = (mel(lowest_hz), mel(highest_hz));
    let corners: Vec<f64> =
        (0..count + 2).map(|i| hertz(low + (high - low) * i as f64 / (count + 1) as f64)).collect();
    let bin_hz = f64::from(rate_hz) / size as f64;
    let band = |corners: &[f64]| {
        let (from, peak, to) = (corners[0], corners[1], corners[2]);
        let weight = |bin: usize| {
            let hz = bin as f64 * bin_hz;
            let side = ((hz - from) / (peak - from)).min((to - hz) / (to - peak));
            side.max(0.0) * 2.0 / (to - from)
        };
        let first = ((from / bin_hz) as usize).min(size / 2);
        let end = ((to / bin_hz).ceil() as usize + 1).clamp(first, size / 2 + 1);
        Band { first, weights: (first..end).map(weight).collect() }
    };
    corners.windows(3).map(band).collect()
}

#[cfg(test)]
pub(super) mod tests;
