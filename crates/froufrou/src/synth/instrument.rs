//! What every synthesised sound gives: an [`Instrument`] is made once for each sound of a score, and
//! makes a [`Generator`] for each thread that plays it.
//!
//! A generator makes the signal at its source, one stretch after another, from the start of its
//! thread on: what happens to the sound on its way is not its concern. It is told the values of its
//! controls over each stretch and the strikes that fall into it. Stretches have one fixed length, so
//! that the signal is a function of the score alone, and not of the blocks that somebody renders.

use std::sync::Arc;

use crate::corpus::cloth::ClothSound;
use crate::corpus::dictionary::Dictionary;
use crate::corpus::paper::PaperSound;
use crate::random::Random;
use crate::score::Grain;
use crate::{Error, Place, Result};

/// How long a stretch is at most, in seconds: generators follow their controls this closely.
pub const STRETCH_S: f64 = 0.002;

/// Samples of a stretch at a rate.
pub fn stretch_samples(rate_hz: f64) -> usize {
    ((rate_hz * STRETCH_S) as usize).max(1)
}

/// Something that sets a body ringing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strike {
    /// When, in seconds since the thread started.
    pub time_s: f64,
    /// How hard, in newton seconds; amplitudes are proportional to it.
    pub impulse_ns: f64,
    /// Where: along a string or bar from 0 to 1; else the number of a point of the body, and between
    /// two points what lies between.
    pub place: f64,
    /// How hard the striker is: the time in seconds that it touches. A soft one touches longer and
    /// leaves high partials alone. 0: as hard as can be.
    pub contact_s: f64,
}

/// A grain that begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GrainStart {
    /// When, in seconds since the thread started.
    pub time_s: f64,
    /// Which, and how it is played.
    pub grain: Grain,
}

/// The value of a control over a stretch, which changes evenly from its beginning to its end (where
/// the next stretch begins).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ramp {
    /// Value at the first sample.
    pub from: f64,
    /// Value at the first sample of the next stretch.
    pub to: f64,
}

impl Ramp {
    /// A value that stays.
    pub fn still(value: f64) -> Self {
        Self { from: value, to: value }
    }

    /// The value at sample `index` of a stretch of `count` samples.
    pub fn at(self, index: usize, count: usize) -> f64 {
        self.from + (self.to - self.from) * (index as f64 / count as f64)
    }
}

/// What a generator is told of a stretch.
#[derive(Debug, Clone, Copy)]
pub struct Stretch<'a> {
    /// Number of its first sample since the thread started.
    pub first: u64,
    /// Samples a second, of every stretch of a thread the same.
    pub rate_hz: f64,
    /// The value of each of the instrument's controls, in its order.
    pub controls: &'a [Ramp],
    /// The strikes from its first sample (inclusive) to the first of the next stretch (exclusive), in
    /// order of time.
    pub strikes: &'a [Strike],
    /// The grains that begin in it, likewise.
    pub grains: &'a [GrainStart],
}

/// A value of an instrument that changes while it sounds.
#[derive(Debug, Clone, PartialEq)]
pub struct Control {
    /// Its name.
    pub name: String,
    /// Its value until something is said.
    pub default: f64,
}

/// A synthesised sound.
pub trait Instrument: Send + Sync {
    /// The values that threads may set while they sound.
    fn controls(&self) -> &[Control];

    /// Seconds until the loudest strike there is has died away to −120 dB of itself; `None` for what
    /// sounds by itself, without being struck, for as long as its thread lasts.
    fn ring_s(&self) -> Option<f64>;

    /// The corpus whose grains it can be told to play; none for most.
    fn corpus(&self) -> Option<Arc<Dictionary>> {
        None
    }

    /// The cloth that it sounds like; none for most.
    fn cloth(&self) -> Option<Arc<ClothSound>> {
        None
    }

    /// The paper that it sounds like; none for most.
    fn paper(&self) -> Option<Arc<PaperSound>> {
        None
    }

    /// How many pieces of sound there are that a `grain` may begin.
    fn clips(&self) -> usize {
        self.corpus().map_or(0, |corpus| corpus.grains().len())
    }

    /// How far ahead of its sound it is told its controls, in seconds, for one that makes its sound in longer pieces and has to
    /// know what is in their middle.
    fn ahead_s(&self) -> f64 {
        0.0
    }

    /// A generator for one thread. All that is random in it comes from `random`.
    ///
    /// # Errors
    /// A rate at which it cannot sound, or a script that fails.
    fn generator(&self, rate_hz: f64, random: Random) -> Result<Box<dyn Generator>>;
}

/// The source of one thread's signal.
pub trait Generator: Send {
    /// Fills `out` with the stretch that follows the one before, or with the first. It is
    /// [`stretch_samples`] long.
    ///
    /// # Errors
    /// A script that fails. After an error it is asked for nothing more.
    fn generate(&mut self, stretch: &Stretch<'_>, out: &mut [f32]) -> Result<()>;
}

/// Named numbers that a sound is made with, as a score or scene gives them.
///
/// ```
/// use froufrou::synth::instrument::Parameters;
/// let given = [("frequency".to_string(), 440.0)];
/// let mut parameters = Parameters::new(&given);
/// assert_eq!(parameters.take("frequency", 220.0, 1.0..=20_000.0)?, 440.0);
/// assert_eq!(parameters.take("damping", 0.001, 0.0..=1.0)?, 0.001);
/// parameters.finish()?;
/// # Ok::<(), froufrou::Error>(())
/// ```
#[derive(Debug)]
pub struct Parameters<'a> {
    given: &'a [(String, f64)],
    known: Vec<&'static str>,
}

impl<'a> Parameters<'a> {
    /// Parameters that were given, to be taken one by one.
    pub fn new(given: &'a [(String, f64)]) -> Self {
        Self { given, known: Vec::new() }
    }

    /// The value of a parameter, or its default where it was not given.
    ///
    /// # Errors
    /// A value outside of what is allowed, or one given twice.
    pub fn take(
        &mut self,
        name: &'static str,
        default: f64,
        allowed: std::ops::RangeInclusive<f64>,
    ) -> Result<f64> {
        self.known.push(name);
        let mut values = self.given.iter().filter(|(given, _)| given == name).map(|&(_, value)| value);
        let Some(value) = values.next() else { return Ok(default) };
        let fault = |what: String| Error::new(what).at(Place::Part(name.to_owned()));
        if values.next().is_some() {
            return Err(fault(format!("`{name}` is given twice")));
        }
        if allowed.contains(&value) {
            return Ok(value);
        }
        Err(fault(format!("`{name}` is {value}, not from {:?} to {:?}", allowed.start(), allowed.end())))
    }

    /// Refuses what was given and never taken.
    ///
    /// # Errors
    /// A parameter that there is not.
    pub fn finish(self) -> Result<()> {
        let Some((name, _)) = self.given.iter().find(|(name, _)| !self.known.contains(&name.as_str())) else {
            return Ok(());
        };
        let fault = Error::new(format!("there is no parameter `{name}`")).at(Place::Part(name.clone()));
        Err(match self.known.as_slice() {
            [] => fault.help("it has none"),
            known => fault.help(format!("there are {}", known.join(", "))),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_are_known_single_and_in_range() {
        let given = |names: &[(&str, f64)]| -> Vec<(String, f64)> {
            names.iter().map(|&(name, value)| (name.to_owned(), value)).collect()
        };
        let read = |given: &[(String, f64)]| -> Result<f64> {
            let mut parameters = Parameters::new(given);
            let value = parameters.take("size", 2.0, 1.0..=3.0)?;
            parameters.finish()?;
            Ok(value)
        };
        assert_eq!(read(&[]).unwrap(), 2.0);
        assert_eq!(read(&given(&[("size", 1.5)])).unwrap(), 1.5);
        for (bad, what) in [
            (given(&[("size", 4.0)]), "not from 1.0 to 3.0"),
            (given(&[("size", f64::NAN)]), "`size` is NaN"),
            (given(&[("size", 1.0), ("size", 1.0)]), "given twice"),
            (given(&[("sise", 1.0)]), "there are size"),
        ] {
            let error = read(&bad).unwrap_err().to_string();
            assert!(error.contains(what), "{error}");
        }
    }

    #[test]
    fn ramps_join() {
        let ramp = Ramp { from: 1.0, to: 3.0 };
        assert_eq!([ramp.at(0, 4), ramp.at(2, 4), ramp.at(4, 4)], [1.0, 2.0, 3.0]);
        assert_eq!((stretch_samples(48_000.0), stretch_samples(44_100.0), stretch_samples(1.0)), (96, 88, 1));
    }
}
