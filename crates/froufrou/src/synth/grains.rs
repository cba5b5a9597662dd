//! Grains of real recordings, played one after the other or together (Picard, Tsingos & Faure 2009, section 4).
//!
//! A thread is told which grain begins when, at which gain and speed. Grains of the rate of the soundtrack that are
//! played at their own speed pass unchanged but for their gain; others are read as recordings are.
//!
//! | quantity | value |
//! | --- | --- |
//! | a grain unchanged | one multiplication and addition a sample |
//! | at another speed | that and a reading of [`sinc`](super::sinc) |
//! | spread | the logarithm of the speed follows straight lines between random values, normally distributed, every [`SPREAD_STEP_S`] |
//!
//! A corpus of another rate than the soundtrack is resampled once, when the first thread of that rate begins.

use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;

use super::instrument::{Control, Generator, GrainStart, Instrument, Stretch};
use super::sinc::{self, Samples};
use crate::Result;
use crate::corpus::dictionary::Dictionary;
use crate::random::Random;

/// How far the values are apart that the speed of a spread grain goes through.
pub const SPREAD_STEP_S: f64 = 0.004;

/// Grains are played at most this many times as fast or slow.
pub const SPEEDS: std::ops::RangeInclusive<f64> = 0.05..=20.0;

/// Nearer than this to a whole sample, in samples, a grain begins on it.
const WHOLE_SAMPLE: f64 = 1e-4;

/// A grain as it is played: its samples, and the sample of them on which it begins.
type Bank = Arc<[Arc<[f32]>]>;

/// The grains of a corpus.
pub struct Grains {
    dictionary: Arc<Dictionary>,
    /// The grains at the rates that have been asked for.
    banks: Mutex<Vec<(f64, Bank)>>,
}

impl std::fmt::Debug for Grains {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Grains").field("grains", &self.dictionary.grains().len()).finish_non_exhaustive()
    }
}

impl Grains {
    /// All grains of a corpus.
    pub fn new(dictionary: Arc<Dictionary>) -> Self {
        Self { dictionary, banks: Mutex::new(Vec::new()) }
    }

    /// All grains at a rate.
    fn bank(&self, rate_hz: f64) -> Bank {
        let mut banks = self.banks.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, bank)) = banks.iter().find(|(known_hz, _)| *known_hz == rate_hz) {
            return bank.clone();
        }
        let own_hz = f64::from(self.dictionary.rate_hz());
        let bank: Bank = (0..self.dictionary.grains().len())
            .into_par_iter()
            .map(|grain| resampled(self.dictionary.samples(grain), own_hz / rate_hz))
            .collect();
        banks.push((rate_hz, bank.clone()));
        bank
    }
}

/// A grain at another rate; `ratio` is its own over that.
fn resampled(samples: &[f32], ratio: f64) -> Arc<[f32]> {
    if ratio == 1.0 {
        return samples.into();
    }
    let count = (samples.len() as f64 / ratio).ceil() as usize;
    let positions: Vec<f64> = (0..count).map(|n| n as f64 * ratio).collect();
    let mut out = vec![0.0; count];
    let samples = Samples { samples, looped: false };
    pulp::Arch::new().dispatch(Read {
        samples,
        positions: &positions,
        ratios: &vec![ratio; count],
        out: &mut out,
        window: &mut Vec::new(),
    });
    out.into()
}

/// Reads a grain where it is neither at a whole sample nor at its own speed.
struct Read<'a> {
    samples: Samples<'a>,
    positions: &'a [f64],
    ratios: &'a [f64],
    out: &'a mut [f32],
    window: &'a mut Vec<f32>,
}

impl pulp::WithSimd for Read<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        self.samples.read(simd, self.positions, self.ratios, self.out, self.window);
    }
}

impl Instrument for Grains {
    fn controls(&self) -> &[Control] {
        &[]
    }

    fn ring_s(&self) -> Option<f64> {
        None
    }

    fn corpus(&self) -> Option<Arc<Dictionary>> {
        Some(self.dictionary.clone())
    }

    fn generator(&self, rate_hz: f64, random: Random) -> Result<Box<dyn Generator>> {
        sinc::prepare(2.0);
        Ok(Box::new(Player {
            bank: self.bank(rate_hz),
            random,
            begun: 0,
            playing: Vec::new(),
            positions: Vec::new(),
            ratios: Vec::new(),
            read: Vec::new(),
            window: Vec::new(),
        }))
    }
}

/// The grains of one thread.
struct Player {
    bank: Bank,
    random: Random,
    /// How many grains have begun.
    begun: u64,
    playing: Vec<Playing>,
    positions: Vec<f64>,
    ratios: Vec<f64>,
    read: Vec<f32>,
    window: Vec<f32>,
}

/// A grain that sounds.
struct Playing {
    number: usize,
    gain: f32,
    speed: f64,
    spread: f64,
    /// Which it is of all grains of its thread.
    count: u64,
    /// Samples of the thread since it began, at the first sample of the stretch.
    age: f64,
    /// Where it is read at the next sample.
    position: f64,
}

impl Player {
    fn begin(&mut self, start: &GrainStart, first: u64, rate_hz: f64) {
        let at = start.time_s * rate_hz;
        let whole = at.round();
        let at = if (at - whole).abs() < WHOLE_SAMPLE { whole } else { at };
        // The age at the first sample of the stretch: none or below, as it begins within it.
        let age = first as f64 - at;
        self.playing.push(Playing {
            number: start.grain.number as usize,
            gain: start.grain.gain as f32,
            speed: start.grain.speed.clamp(*SPEEDS.start(), *SPEEDS.end()),
            spread: start.grain.spread,
            count: self.begun,
            age,
            position: 0.0,
        });
        self.begun += 1;
    }
}

/// The logarithm of a spread grain's speed, in standard deviations, `age_s` after it began.
fn strays(random: Random, count: u64, age_s: f64) -> f64 {
    let place = age_s / SPREAD_STEP_S;
    let step = place.floor();
    // A grain has far fewer than 2³² values.
    let value = |step: f64| random.normal((count << 32) + step as u64);
    // A straight line between two values varies less than they do: by 2/3 on average.
    let along = place - step;
    (value(step) * (1.0 - along) + value(step + 1.0) * along) * 1.5f64.sqrt()
}

impl Generator for Player {
    fn generate(&mut self, stretch: &Stretch<'_>, out: &mut [f32]) -> Result<()> {
        out.fill(0.0);
        for start in stretch.grains {
            self.begin(start, stretch.first, stretch.rate_hz);
        }
        let count = out.len();
        let Self { bank, random, playing, positions, ratios, read, window, .. } = self;
        playing.retain_mut(|grain| {
            let Some(samples) = bank.get(grain.number) else { return false };
            let length = samples.len() as f64;
            // The first sample of the stretch that lies in the grain.
            let skip = ((-grain.age).ceil().max(0.0) as usize).min(count);
            let is_plain = grain.speed == 1.0 && grain.spread == 0.0;
            if skip < count && is_plain && grain.age.fract() == 0.0 {
                let from = (grain.age + skip as f64) as usize;
                for (out, sample) in out[skip..].iter_mut().zip(samples.get(from..).unwrap_or(&[])) {
                    *out += grain.gain * sample;
                }
                grain.position = grain.age + count as f64;
            } else if skip < count {
                positions.clear();
                ratios.clear();
                if grain.age < 0.0 {
                    grain.position = (grain.age + skip as f64) * grain.speed;
                }
                for n in skip..count {
                    let ratio = if grain.spread > 0.0 {
                        let age_s = (grain.age + n as f64) / stretch.rate_hz;
                        let strays = strays(*random, grain.count, age_s).clamp(-4.0, 4.0);
                        (grain.speed * (grain.spread * strays).exp()).clamp(*SPEEDS.start(), *SPEEDS.end())
                    } else {
                        grain.speed
                    };
                    positions.push(grain.position);
                    ratios.push(ratio);
                    grain.position += ratio;
                }
                read.clear();
                read.resize(positions.len(), 0.0);
                let samples = Samples { samples, looped: false };
                pulp::Arch::new().dispatch(Read {
                    samples,
                    positions: &*positions,
                    ratios: &*ratios,
                    out: read,
                    window: &mut *window,
                });
                for ((out, read), position) in out[skip..].iter_mut().zip(&*read).zip(&*positions) {
                    // What the reading rings with beyond the ends is left out, as grains end in silence.
                    if *position < length {
                        *out += grain.gain * *read;
                    }
                }
            }
            grain.age += count as f64;
            grain.position < length
        });
        Ok(())
    }
}

#[cfg(test)]
mod tests;
