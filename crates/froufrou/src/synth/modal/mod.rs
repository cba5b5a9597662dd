//! Bodies that ring when struck: a sum of modes, each a damped sine.
//!
//! A strike at time t₀ adds to each mode
//!
//! ```text
//! impulse · gain · shape(place) · W(frequency) · sin(2πf (t − t₀)) · e^(−d (t − t₀)),  t ≥ t₀
//! ```
//!
//! to what still rings of those before, exactly, also between two samples. W is the spectrum of the
//! contact ([`contact_spectrum`]). [`bank`] makes the signal. [`string`] and [`bar`] have the modes of
//! Takala & Hahn's closed forms, [`table`] reads those of measured or computed bodies.

pub mod bank;
pub mod bar;
pub mod string;
pub mod table;

use std::sync::{Arc, Mutex, PoisonError};

use self::bank::{Bank, Rotations};
use super::instrument::{Control, Generator, Instrument};
use crate::random::Random;
use crate::{Error, Place, Result};

/// The most modes that a body may have.
pub const MOST_MODES: usize = 100_000;

/// How strongly a mode is excited, depending on where the body is struck.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// Everywhere alike.
    Everywhere,
    /// The gain at each numbered point, from 0; even between two points, and beyond the last as there.
    Points(Vec<f64>),
    /// A partial of a string, from 1: see [`string`].
    String {
        /// The number of its half waves.
        partial: u32,
        /// 1 plucked, 0 struck, and between the two what lies between.
        pluck: f64,
    },
    /// A mode of a bar: see [`bar`].
    Bar {
        /// How the bar is held.
        ends: bar::Ends,
        /// Its wave number times its length.
        wave_number: f64,
    },
}

impl Shape {
    /// The gain where the body is struck.
    pub fn at(&self, place: f64) -> f64 {
        let place = if place.is_nan() { 0.0 } else { place };
        match self {
            Shape::Everywhere => 1.0,
            Shape::Points(gains) => {
                let Some(last) = gains.len().checked_sub(1) else { return 1.0 };
                let place = place.clamp(0.0, last as f64);
                let before = (place as usize).min(last);
                let behind = (before + 1).min(last);
                let part = place - before as f64;
                gains[before] * (1.0 - part) + gains[behind] * part
            }
            &Shape::String { partial, pluck } => string::gain(partial, pluck, place.clamp(0.0, 1.0)),
            &Shape::Bar { ends, wave_number } => ends.shape(wave_number, place.clamp(0.0, 1.0)),
        }
    }

    /// The greatest gain there is, wherever it is struck; of a closed form, as closely as a hundred
    /// places tell.
    fn greatest(&self) -> f64 {
        let greatest = |gains: &mut dyn Iterator<Item = f64>| gains.fold(0.0, |a: f64, b| a.max(b.abs()));
        match self {
            Shape::Everywhere => 1.0,
            Shape::Points(gains) if gains.is_empty() => 1.0,
            Shape::Points(gains) => greatest(&mut gains.iter().copied()),
            shape => greatest(&mut (0..=100).map(|n| shape.at(f64::from(n) / 100.0))),
        }
    }
}

/// One mode of vibration.
#[derive(Debug, Clone, PartialEq)]
pub struct Mode {
    /// Its frequency in hertz, above 0.
    pub frequency_hz: f64,
    /// How fast it dies away: its amplitude falls as e^(−decay · t). Above 0.
    pub decay_per_s: f64,
    /// Its amplitude after a hard strike of 1 N s where its shape is 1.
    pub gain: f64,
    /// Where it can be struck.
    pub shape: Shape,
}

/// The decay in 1/s of an amplitude that takes this many seconds to fall by 60 dB.
pub fn decay_of_rt60(rt60_s: f64) -> f64 {
    1000.0f64.ln() / rt60_s
}

impl Mode {
    /// Refuses what no body has.
    fn check(&self) -> Result<()> {
        let above_zero = |name: &str, value: f64| {
            if value > 0.0 && value.is_finite() {
                return Ok(());
            }
            Err(Error::new(format!("the {name} is {value}: expected a number above 0")))
        };
        above_zero("frequency in hertz", self.frequency_hz)?;
        above_zero("decay per second", self.decay_per_s)?;
        let gains = if let Shape::Points(gains) = &self.shape { gains.as_slice() } else { &[] };
        match gains.iter().chain([&self.gain]).find(|gain| !gain.is_finite()) {
            Some(gain) => Err(Error::new(format!("a gain is {gain}: expected a finite number"))),
            None => Ok(()),
        }
    }
}

/// The spectrum of a contact that lasts `contact_s` seconds, at a frequency, as a part of that of the
/// hardest strike of the same impulse.
///
/// The force is half a sine, so it is |cos(πfτ) / (1 − (2fτ)²)|. Its zeros (fτ = 3/2, 5/2, …) are kept:
/// they are what such a contact leaves out, and a smooth envelope would be too bright at every one of
/// them. The strike's time is the middle of the contact.
pub fn contact_spectrum(frequency_hz: f64, contact_s: f64) -> f64 {
    let x = frequency_hz * contact_s.max(0.0);
    let below = 1.0 - 2.0 * x;
    if below.abs() < 1e-4 {
        // The limit π/4 at x = 1/2, with its slope: cos(πx) = sin(π below / 2).
        return std::f64::consts::FRAC_PI_4 * (1.0 + below / 2.0);
    }
    if x > 1e12 {
        return 0.0;
    }
    ((std::f64::consts::PI * x).cos() / (below * (1.0 + 2.0 * x))).abs()
}

/// A body made of modes: an instrument that strikes set ringing.
///
/// ```
/// use froufrou::random::Random;
/// use froufrou::synth::instrument::{Instrument, Strike, Stretch, stretch_samples};
/// use froufrou::synth::modal::{Mode, Modes, Shape};
/// let bell = Modes::new(vec![
///     Mode { frequency_hz: 440.0, decay_per_s: 2.0, gain: 1.0, shape: Shape::Everywhere },
///     Mode { frequency_hz: 1212.0, decay_per_s: 5.0, gain: 0.5, shape: Shape::Points(vec![0.0, 1.0]) },
/// ])?;
/// let mut generator = bell.generator(48_000.0, Random::new(0, 0))?;
/// let strike = Strike { time_s: 0.001, impulse_ns: 1.0, place: 0.5, contact_s: 0.0 };
/// let stretch = Stretch { first: 0, rate_hz: 48_000.0, controls: &[], strikes: &[strike], grains: &[] };
/// let mut out = vec![0.0; stretch_samples(48_000.0)];
/// generator.generate(&stretch, &mut out)?;
/// assert!(out[..48].iter().all(|&sample| sample == 0.0) && out[60] != 0.0);
/// # Ok::<(), froufrou::Error>(())
/// ```
#[derive(Debug)]
pub struct Modes {
    modes: Arc<[Mode]>,
    ring_s: f64,
    /// What all generators of one rate share; of the last rate asked for.
    rotations: Mutex<Option<Arc<Rotations>>>,
}

impl Modes {
    /// A body of these modes.
    ///
    /// # Errors
    /// No mode, more than [`MOST_MODES`], or one with a frequency or decay that is not above 0 or a
    /// gain that is not finite; the error's place is its number, counted from 1.
    pub fn new(modes: Vec<Mode>) -> Result<Self> {
        if modes.is_empty() {
            return Err(Error::new("there is no mode: expected one at least"));
        }
        if modes.len() > MOST_MODES {
            return Err(Error::new(format!("there are {} modes, more than {MOST_MODES}", modes.len())));
        }
        for (index, mode) in modes.iter().enumerate() {
            mode.check().map_err(|fault| fault.at(Place::Part(format!("mode {}", index + 1))))?;
        }
        let ring_s = ring_s(&modes);
        Ok(Self { modes: modes.into(), ring_s, rotations: Mutex::new(None) })
    }

    /// The modes, as they were given.
    pub fn modes(&self) -> &[Mode] {
        &self.modes
    }
}

/// Seconds until every mode lies 120 dB below the beginning of the loudest.
fn ring_s(modes: &[Mode]) -> f64 {
    let gains: Vec<f64> = modes.iter().map(|mode| mode.gain.abs() * mode.shape.greatest()).collect();
    let end = gains.iter().fold(0.0f64, |a, &b| a.max(b)) * 1e-6;
    let time =
        |(mode, &gain): (&Mode, &f64)| if gain > end { (gain / end).ln() / mode.decay_per_s } else { 0.0 };
    modes.iter().zip(&gains).map(time).fold(0.0, f64::max)
}

impl Instrument for Modes {
    fn controls(&self) -> &[Control] {
        &[]
    }

    fn ring_s(&self) -> Option<f64> {
        Some(self.ring_s)
    }

    fn generator(&self, rate_hz: f64, _: Random) -> Result<Box<dyn Generator>> {
        let mut shared = self.rotations.lock().unwrap_or_else(PoisonError::into_inner);
        let rotations = match &*shared {
            Some(rotations) if rotations.rate_hz() == rate_hz => rotations.clone(),
            _ => {
                let rotations = Arc::new(Rotations::new(&self.modes, rate_hz));
                *shared = Some(rotations.clone());
                rotations
            }
        };
        Ok(Box::new(Bank::new(self.modes.clone(), rotations)))
    }
}
