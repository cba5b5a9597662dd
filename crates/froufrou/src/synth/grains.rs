//! Grains of real recordings, played one after the other or together (Picard, Tsingos & Faure 2009, section 4).
//!
//! A thread is told which grain begins when, at which gain and speed. Grains that are played at their own speed pass
//! unchanged but for their gain; others are read as recordings are.
//!
//! | quantity | value |
//! | --- | --- |
//! | a grain at its own speed | begins on the nearest sample; one multiplication and addition a sample |
//! | at another speed | that and a reading of [`sinc`] |
//! | spread | the logarithm of the speed follows straight lines between random values, normally distributed, every [`SPREAD_STEP_S`] |
//!
//! A corpus of another rate than the soundtrack is resampled once, when the first thread of that rate begins.

use std::sync::{Arc, Mutex, PoisonError};

use super::instrument::{Control, Generator, GrainStart, Instrument, Stretch};
use super::sinc::{self, Samples};
use crate::Result;
use crate::corpus::dictionary::{Dictionary, Entry};
use crate::random::Random;

/// How far the values are apart that the speed of a spread grain goes through.
pub const SPREAD_STEP_S: f64 = 0.004;

/// Grains are played at most this many times as fast or slow.
pub const SPEEDS: std::ops::RangeInclusive<f64> = 0.05..=20.0;

/// Of two samples that are as near, to within this, a grain begins on the later one: so the grains of one recording all
/// do the same, whatever is lost in rounding.
const AS_NEAR: f64 = 1e-5;

/// The grains of a corpus.
pub struct Grains {
    dictionary: Arc<Dictionary>,
    /// The grains at the rates that have been asked for.
    banks: Mutex<Vec<Arc<Bank>>>,
}

impl std::fmt::Debug for Grains {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Grains").field("grains", &self.dictionary.grains().len()).finish_non_exhaustive()
    }
}

impl Grains {
    /// All grains of a corpus.
    pub fn new(dictionary: Arc<Dictionary>) -> Self {
        Self { dictionary, banks: Mutex::default() }
    }

    /// All grains at a rate.
    fn bank(&self, rate_hz: f64) -> Result<Arc<Bank>> {
        let rate_hz = rate_hz.round() as u32;
        let mut banks = self.banks.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(bank) = banks.iter().find(|bank| bank.dictionary.rate_hz() == rate_hz) {
            return Ok(bank.clone());
        }
        let own = &self.dictionary;
        let bank = if rate_hz == own.rate_hz() {
            Bank { dictionary: own.clone(), phases: vec![0.0; own.grains().len()] }
        } else {
            let dictionary = own.at_rate(rate_hz)?;
            let ratio = f64::from(rate_hz) / f64::from(own.rate_hz());
            let phase = |(before, now): (&Entry, &Entry)| before.start as f64 * ratio - now.start as f64;
            let phases = own.grains().iter().zip(dictionary.grains()).map(phase).collect();
            Bank { dictionary: Arc::new(dictionary), phases }
        };
        let bank = Arc::new(bank);
        banks.push(bank.clone());
        Ok(bank)
    }
}

/// Pieces of sound at one rate that a [`Player`] can play by their numbers.
pub(super) trait Clips: Send + Sync {
    /// How many there are.
    fn count(&self) -> usize;

    /// The samples of one; none where there is no such piece.
    fn samples(&self, number: usize) -> &[f32];

    /// By how many samples one begins before the place that it should have.
    fn phase(&self, number: usize) -> f64;
}

impl Clips for Bank {
    fn count(&self) -> usize {
        self.phases.len()
    }

    fn samples(&self, number: usize) -> &[f32] {
        self.dictionary.samples(number)
    }

    fn phase(&self, number: usize) -> f64 {
        self.phases.get(number).copied().unwrap_or(0.0)
    }
}

/// All grains of a corpus at one rate.
struct Bank {
    dictionary: Arc<Dictionary>,
    /// By how many samples each begins before the place that it should have.
    phases: Vec<f64>,
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
        Ok(Box::new(Player::new(self.bank(rate_hz)?, random)))
    }
}

/// The grains of one thread.
pub(super) struct Player {
    bank: Arc<dyn Clips>,
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
    /// It is played as it is.
    is_plain: bool,
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
    /// Of one thread, with pieces at its rate. All that is random in it comes from `random`.
    pub fn new(bank: Arc<dyn Clips>, random: Random) -> Self {
        sinc::prepare(2.0);
        Self {
            bank,
            random,
            begun: 0,
            playing: Vec::new(),
            positions: Vec::new(),
            ratios: Vec::new(),
            read: Vec::new(),
            window: Vec::new(),
        }
    }

    fn begin(&mut self, start: &GrainStart, first: u64, rate_hz: f64) {
        let number = start.grain.number as usize;
        if number >= self.bank.count() {
            return;
        }
        let phase = self.bank.phase(number);
        // Where its first sample lies, which is a whole one for a grain that is played as it is.
        let mut at = start.time_s * rate_hz - phase;
        let is_plain = start.grain.speed == 1.0 && start.grain.spread == 0.0;
        if is_plain {
            at = (at + AS_NEAR).round();
        }
        // The age at the first sample of the stretch: none or below, as it begins within it.
        let age = first as f64 - at;
        self.playing.push(Playing {
            number,
            is_plain,
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
            let samples = bank.samples(grain.number);
            let length = samples.len() as f64;
            // The first sample of the stretch that lies in the grain.
            let skip = ((-grain.age).ceil().max(0.0) as usize).min(count);
            if skip < count && grain.is_plain {
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
