//! Friction, after Takala & Hahn (1992): a needle that slides over a rough surface reads its profile.
//!
//! The profile has a power spectrum that falls evenly with frequency (1/f unless told otherwise) between
//! two wavelengths. It never repeats. What is heard is the profile at the needle's place, so the speed
//! shifts the whole spectrum: at twice the speed the same profile is read twice as fast.
//!
//! The profile is kept as textures are: in octaves of resolution, each the one above, twice as finely
//! sampled, plus an octave of detail from white noise at numbered places. The needle reads the octave
//! whose sampling fits its speed through the windowed sinc of [`sinc`](super::sinc), which leaves out what
//! the sample rate cannot hold; towards the next octave the two are blended.
//!
//! The control is `speed` in m/s; its sign does not matter. Standing still is silent: below the speed at
//! which even the finest detail passes too slowly to be heard (20 Hz) the sound fades without a
//! click, by 60 dB in 40 ms, whatever height the needle rests on.
//!
//! | parameter | default | from, to | |
//! | --- | --- | --- | --- |
//! | `slope` | −3 | −12, 6 | decibels an octave of the power spectrum |
//! | `finest` | 0.00002 | 1e-7, 1 | shortest wavelength of the profile in metres |
//! | `coarsest` | 0.01 | 1e-7, 1000 | longest one; the band is a whole number of octaves from `finest` up |
//!
//! The whole profile has a root mean square of 1/4, so peaks rarely reach 1. What of it moves too fast
//! for the sample rate is left out; the rest is as loud at every rate.
//!
//! Measured by the tests: the spectrum lies within 0.5 dB of its law from the coarsest wavelength to 5/6
//! of the Nyquist frequency or of the finest detail, and at 48 kHz up to 19 kHz the sound is that at
//! 192 kHz within −100 dB: nothing folds back.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::Range;
use std::sync::Arc;

use super::gate::{Gate, control, finite, smooth_step};
use super::instrument::{Control, Generator, Instrument, Parameters, Ramp, Stretch};
use super::sinc::{Samples, half_width, kaiser};
use crate::random::Random;
use crate::{Error, Place, Result};

/// Root mean square of the whole profile.
const LEVEL: f64 = 0.25;

/// Half the length of the filters between octaves.
const HALF: usize = 40;

/// Taps of the filters between octaves.
const TAPS: usize = 2 * HALF + 1;

/// Where an octave hands over to the next, in cycles a sample of the finer one.
const CROSSOVER: [f64; 2] = [0.2, 0.3];

/// Samples of an octave made at once, at least.
const CHUNK: i64 = 64;

/// Samples of the past that are kept before they are thrown away together.
const PAST: i64 = 1024;

/// The lowest ratio at which any octave but the finest is read. Near its own Nyquist frequency an octave
/// differs from the finer ones; from this ratio on, that lies beyond the reader's pass band.
const LOWEST_RATIO: f64 = 1.04;

/// By what factor of speed one octave is blended into the next.
const BLEND: f64 = 1.1;

/// The highest ratio at which an octave is read.
const HIGHEST_RATIO: f64 = 2.0 * LOWEST_RATIO * BLEND;

/// The frequency below which nothing is heard.
const AUDIBLE_HZ: f64 = 20.0;

/// A rough surface, and a needle on it.
#[derive(Debug)]
pub struct Needle {
    filters: Arc<Filters>,
    finest_m: f64,
    controls: [Control; 1],
}

impl Needle {
    /// A surface with these parameters.
    ///
    /// # Errors
    /// A parameter that there is not, one outside of its range, or `coarsest` below `finest`.
    pub fn new(given: &[(String, f64)]) -> Result<Self> {
        let mut parameters = Parameters::new(given);
        let slope_db = parameters.take("slope", -3.0, -12.0..=6.0)?;
        let finest_m = parameters.take("finest", 2e-5, 1e-7..=1.0)?;
        let coarsest_m = parameters.take("coarsest", 1e-2, 1e-7..=1000.0)?;
        parameters.finish()?;
        if coarsest_m < finest_m {
            return Err(Error::new(format!("`coarsest` is {coarsest_m} m, below `finest`, {finest_m} m"))
                .at(Place::Part("coarsest".to_owned()))
                .help("they are wavelengths: the coarsest is the longest"));
        }
        let octaves = (coarsest_m / finest_m).log2().round().max(1.0) as usize;
        // −3 dB an octave is meant as 1/f, which is −3.01.
        let exponent = -slope_db / 3.0;
        Ok(Self {
            filters: Arc::new(Filters::new(exponent, octaves)),
            finest_m,
            controls: [Control { name: "speed".to_owned(), default: 0.0 }],
        })
    }
}

impl Instrument for Needle {
    fn controls(&self) -> &[Control] {
        &self.controls
    }

    fn ring_s(&self) -> Option<f64> {
        None
    }

    fn generator(&self, rate_hz: f64, random: Random) -> Result<Box<dyn Generator>> {
        let octaves = self.filters.gains.len();
        Ok(Box::new(Sliding {
            profile: Profile::new(self.filters.clone(), random),
            spacing_m: self.finest_m / 2.0,
            cell: 0,
            fraction: 0.0,
            gate: Gate::new(rate_hz),
            steps: Vec::new(),
            places: Vec::new(),
            reading: Reading::default(),
            sum: Vec::new(),
            silent_step: 2.0f64.powi(octaves as i32),
        }))
    }
}

/// What makes the octaves of a profile, each sampled twice as finely as the next.
#[derive(Debug)]
struct Filters {
    /// Makes an octave of detail from white noise.
    detail: [f32; TAPS],
    /// Interpolates the coarser octave at its own places and between them, with its gain.
    even: Vec<f32>,
    odd: Vec<f32>,
    /// Gain of each octave, so that they agree where they overlap.
    gains: Vec<f64>,
}

impl Filters {
    /// For a power spectrum as frequency to the minus `exponent`.
    fn new(exponent: f64, octaves: usize) -> Self {
        let [low, high] = CROSSOVER;
        // A quarter turn from one octave to the other, as smooth as the filters are long.
        let turn = |f: f64| {
            let x = ((f - low) / (high - low)).clamp(0.0, 1.0);
            FRAC_PI_2 * x * x * x * (x * (6.0 * x - 15.0) + 10.0)
        };
        let mut between = filter(|f| turn(f).cos());
        let sum: f64 = between.iter().sum();
        between.iter_mut().for_each(|tap| *tap /= sum);
        let detail = filter(|f| {
            if f < low {
                return 0.0;
            }
            // What the coarser octave leaves to be filled; above its Nyquist frequency it is mirrored.
            let mirrored = (0.5 - f).max(1e-9).min(f);
            let given = mirrored.powf(-exponent) * response(&between, f).powi(2);
            (f.powf(-exponent) - given).max(0.0).sqrt()
        });
        // By the power an octave more adds: the spectrum scales by 2^(exponent − 1) from one to the next.
        let scale = 2.0f64.powf((exponent - 1.0) / 2.0);
        let power: f64 = detail.iter().map(|tap| tap * tap).sum();
        let total: f64 = (0..octaves).map(|k| power * scale.powi(2 * k as i32)).sum();
        let norm = LEVEL / total.sqrt();
        // White noise from −1 to 1 has a variance of 1/3.
        let detail: [f32; TAPS] = std::array::from_fn(|k| (detail[k] * 3.0f64.sqrt()) as f32);
        let part = |first: usize| {
            between.iter().skip(first).step_by(2).map(|tap| (2.0 * scale * tap) as f32).collect()
        };
        let gains = (0..octaves).map(|k| norm * scale.powi(k as i32)).collect();
        Self { detail, even: part(0), odd: part(1), gains }
    }
}

/// A symmetrical filter with a response given from 0 to half a cycle a sample.
fn filter(response: impl Fn(f64) -> f64) -> [f64; TAPS] {
    const POINTS: usize = 1024;
    let values: Vec<f64> = (0..=POINTS).map(|n| response(n as f64 / (2 * POINTS) as f64)).collect();
    std::array::from_fn(|k| {
        let x = k as f64 - HALF as f64;
        let ends = 0.5 * (values[0] + values[POINTS] * (TAU * 0.5 * x).cos());
        let inner: f64 =
            (1..POINTS).map(|n| values[n] * (TAU * n as f64 / (2 * POINTS) as f64 * x).cos()).sum();
        (ends + inner) / POINTS as f64 * kaiser(x / (HALF + 1) as f64)
    })
}

/// The response of a symmetrical filter.
fn response(taps: &[f64; TAPS], f: f64) -> f64 {
    taps.iter().enumerate().map(|(k, tap)| tap * (TAU * f * (k as f64 - HALF as f64)).cos()).sum()
}

/// Samples of one octave about the needle.
#[derive(Debug, Default)]
struct Octave {
    begin: i64,
    values: Vec<f32>,
}

impl Octave {
    fn end(&self) -> i64 {
        self.begin + self.values.len() as i64
    }
}

/// A profile, made where it is read.
#[derive(Debug)]
struct Profile {
    filters: Arc<Filters>,
    octaves: Vec<Octave>,
    white: Vec<Random>,
    noise: Vec<f32>,
    made: [Vec<f32>; 2],
}

impl Profile {
    fn new(filters: Arc<Filters>, random: Random) -> Self {
        let count = filters.gains.len();
        Self {
            filters,
            octaves: (0..count).map(|_| Octave::default()).collect(),
            white: (0..count as u64).map(|octave| Random::new(random.bits(octave), octave)).collect(),
            noise: Vec::new(),
            made: Default::default(),
        }
    }

    /// Makes the samples of an octave, whose values do not depend on what else was made.
    fn make(&mut self, index: usize, range: Range<i64>) {
        let octave = &mut self.octaves[index];
        if range.start < octave.begin || range.start > octave.end() {
            octave.values.clear();
            octave.begin = range.start;
        }
        if range.start - octave.begin > PAST {
            // The finer octave reaches further ahead than the needle: some of the past stays for it.
            let begin = range.start - PAST / 2;
            octave.values.drain(..(begin - octave.begin) as usize);
            octave.begin = begin;
        }
        let from = octave.end();
        if range.end <= from {
            return;
        }
        // Whole pairs, so that places of the coarser octave and those between them alternate.
        let to = range.end.max(from + CHUNK);
        let first = from & !1;
        let pairs = ((to - first + 1) / 2) as usize;
        let reach = HALF as i64 / 2;
        let coarser = first / 2 - reach..first / 2 + pairs as i64 + reach + 1;
        let is_last = index + 1 == self.octaves.len();
        if !is_last {
            self.make(index + 1, coarser.clone());
        }
        let white = self.white[index];
        self.noise.clear();
        let places = first - HALF as i64..first + 2 * pairs as i64 + HALF as i64;
        self.noise.extend(places.map(|place| (2.0 * white.uniform(place as u64) - 1.0) as f32));
        let filters = &self.filters;
        for made in &mut self.made {
            made.clear();
        }
        let [detail, between] = &mut self.made;
        detail.resize(2 * pairs, 0.0);
        convolve(&filters.detail, &self.noise, detail);
        if !is_last {
            let source = &self.octaves[index + 1];
            let source = &source.values[(coarser.start - source.begin) as usize..];
            // Tap k of the whole filter lies k − HALF fine places from the middle: even taps reach the
            // coarser octave's places from one of them, odd taps from between two.
            between.resize(pairs, 0.0);
            convolve(&filters.even, source, between);
            add_every_other(between, &mut detail[..]);
            between.fill(0.0);
            convolve(&filters.odd, &source[1..], between);
            add_every_other(between, &mut detail[1..]);
        }
        let octave = &mut self.octaves[index];
        octave.values.extend_from_slice(&detail[(from - first) as usize..]);
    }
}

/// Adds the products of a filter with what lies from each place of the input on. Written so that
/// neighbouring sums are made side by side, each in the same order.
fn convolve(taps: &[f32], input: &[f32], sums: &mut [f32]) {
    for (k, tap) in taps.iter().enumerate() {
        for (sum, x) in sums.iter_mut().zip(&input[k..]) {
            *sum += tap * x;
        }
    }
}

fn add_every_other(values: &[f32], to: &mut [f32]) {
    for (to, value) in to.iter_mut().step_by(2).zip(values) {
        *to += value;
    }
}

/// Scratch memory of a reading.
#[derive(Debug, Default)]
struct Reading {
    positions: Vec<f64>,
    ratios: Vec<f64>,
    out: Vec<f32>,
    window: Vec<f32>,
}

struct Sliding {
    profile: Profile,
    /// Between two samples of the finest octave.
    spacing_m: f64,
    /// Where the needle is, in samples of the finest octave.
    cell: i64,
    fraction: f64,
    gate: Gate,
    /// How far the needle moves in a sample, and has moved since the stretch began, likewise.
    steps: Vec<f64>,
    places: Vec<f64>,
    reading: Reading,
    sum: Vec<f64>,
    /// The step from which even the coarsest octave is too fast.
    silent_step: f64,
}

/// The coarsest octave that is heard at a step, and how much of it: the rest is of the one before.
fn fit(step: f64) -> (usize, f64) {
    let step = step / LOWEST_RATIO;
    if step < 2.0 {
        return (0, 1.0);
    }
    // The exponent of the number itself: no rounding, the same on every machine.
    let octave = ((step.to_bits() >> 52) & 0x7ff) as usize - 1023;
    (octave, smooth_step((step / 2.0f64.powi(octave as i32) - 1.0) / (BLEND - 1.0)))
}

/// How much of an octave is heard at a step.
fn share(octave: usize, step: f64) -> f64 {
    let (coarsest, part) = fit(step);
    match coarsest.checked_sub(octave) {
        Some(0) => part,
        Some(1) => 1.0 - part,
        _ => 0.0,
    }
}

impl Sliding {
    /// Adds what an octave gives to the samples of a stretch.
    fn read(&mut self, octave: usize) {
        let heard = |&step: &f64| share(octave, step) > 0.0;
        let Some(first) = self.steps.iter().position(heard) else { return };
        let end = self.steps.iter().rposition(heard).map_or(first, |last| last + 1);
        let scale = 2.0f64.powi(octave as i32);
        let base = self.cell >> octave;
        let offset = (self.cell - (base << octave)) as f64 + self.fraction;
        let place = |n: usize| (offset + self.places[n]) / scale;
        // As wide for every speed at which this octave is read: the range never moves back.
        let margin = half_width(HIGHEST_RATIO) as i64;
        let begin = base + place(first) as i64 - margin;
        self.profile.make(octave, begin..base + place(end - 1) as i64 + margin + 1);
        let source = &self.profile.octaves[octave];
        let shift = (base - source.begin) as f64;
        let reading = &mut self.reading;
        reading.positions.clear();
        reading.positions.extend((first..end).map(|n| shift + place(n)));
        reading.ratios.clear();
        reading.ratios.extend(self.steps[first..end].iter().map(|step| (step / scale).min(HIGHEST_RATIO)));
        reading.out.clear();
        reading.out.resize(end - first, 0.0);
        pulp::Arch::new().dispatch(Sinc { samples: &source.values, reading });
        let gain = self.profile.filters.gains[octave];
        for (n, &value) in (first..end).zip(&self.reading.out) {
            self.sum[n] += f64::from(value) * gain * share(octave, self.steps[n]);
        }
    }
}

struct Sinc<'a> {
    samples: &'a [f32],
    reading: &'a mut Reading,
}

impl pulp::WithSimd for Sinc<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let samples = Samples { samples: self.samples, looped: false };
        let Reading { positions, ratios, out, window } = self.reading;
        samples.read(simd, positions, ratios, out, window);
    }
}

impl Generator for Sliding {
    fn generate(&mut self, stretch: &Stretch<'_>, out: &mut [f32]) -> Result<()> {
        let speeds = control(stretch, 0, 0.0);
        if speeds == Ramp::still(0.0) && self.gate.is_shut() {
            out.fill(0.0);
            return Ok(());
        }
        // Faster than the coarsest octave all is silence, and there is no need to go further.
        let limit = 2.0 * self.silent_step;
        let step = |speed: f64| (speed / (self.spacing_m * stretch.rate_hz)).min(limit);
        let steps = Ramp { from: step(speeds.from), to: step(speeds.to) };
        let count = out.len();
        self.steps.clear();
        self.steps.extend((0..count).map(|n| steps.at(n, count)));
        self.places.clear();
        // The ramp's integral.
        let place =
            |n: usize| n as f64 * (steps.from + (steps.to - steps.from) * (n as f64 / (2 * count) as f64));
        self.places.extend((0..count).map(place));
        self.sum.clear();
        self.sum.resize(count, 0.0);
        let (slowest, fastest) = (steps.from.min(steps.to), steps.from.max(steps.to));
        let last = self.profile.octaves.len() - 1;
        for octave in fit(slowest).0.saturating_sub(1)..=fit(fastest).0.min(last) {
            self.read(octave);
        }
        for (n, (out, value)) in out.iter_mut().zip(&self.sum).enumerate() {
            // The finest wavelength is two samples of the finest octave.
            let finest_hz = self.steps[n] * stretch.rate_hz / 2.0;
            *out = finite(value * self.gate.next(smooth_step(finest_hz / AUDIBLE_HZ)));
        }
        let end = self.fraction + place(count);
        self.cell = self.cell.wrapping_add(end.floor() as i64);
        self.fraction = end - end.floor();
        Ok(())
    }
}
