//! Spectral modelling: a recording as sinusoids that come and go, and what is left when they are taken away.
//!
//! Picard, Tsingos & Faure (2009, section 3.1) split continuous contacts this way, after Serra & Smith (1990): the
//! sinusoids are the ringing of the bodies, the residual is the roughness of their surfaces.
//!
//! | step | what is done |
//! | --- | --- |
//! | `peaks` | each frame under a window, zero-padded; peaks of its magnitude, interpolated by a parabola through decibels |
//! | `tracking` | peaks of neighbouring frames become partials that are born and die |
//! | `peaks` again | where peaks overlap, amplitudes and phases are corrected by what the residual still holds at their frequencies |
//! | `additive` | partials become sound, with phases that follow a cubic between frames (McAulay & Quatieri 1986) |
//!
//! The residual is the difference in time. So sinusoids and residual add up to the recording, to the rounding of 32
//! bits, whatever the settings.
//!
//! A frame costs an FFT and a partial costs a sine an output sample; frames and stretches of output share all cores.
//! Every stretch adds its partials in the same order, so that the bytes do not depend on the number of threads.

mod additive;
mod peaks;
#[cfg(test)]
mod tests;
mod tracking;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Place, Result};

/// The rates that sound may have.
pub(super) const RATES_HZ: std::ops::RangeInclusive<u32> = 1_000..=768_000;

/// How to look for sinusoids. Times are in seconds, so that one setting serves all rates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SpectralModel {
    /// Length of the window. Partials nearer to one another than 4 periods of it (87 Hz for 46 ms) are not told apart.
    pub window_s: f64,
    /// From frame to frame.
    pub hop_s: f64,
    /// Peaks lower than this below the recording's highest are left to the residual; negative.
    pub threshold_db: f64,
    /// The most partials that sound at once.
    pub most_partials: usize,
    /// Partials that last less are left to the residual.
    pub shortest_s: f64,
    /// How far a partial may move from frame to frame at 0 Hz ...
    pub deviation_hz: f64,
    /// ... and how much further for each hertz of its frequency.
    pub deviation_slope: f64,
    /// How often the residual is looked at for what the partials lack; each time costs as much as the first look and
    /// leaves 0.5 to 1.5 dB less in the residual.
    pub corrections: usize,
}

impl Default for SpectralModel {
    fn default() -> Self {
        Self {
            window_s: 0.046,
            hop_s: 0.0029,
            threshold_db: -80.0,
            most_partials: 150,
            shortest_s: 0.02,
            deviation_hz: 20.0,
            deviation_slope: 0.01,
            corrections: 2,
        }
    }
}

/// A sinusoid at the centre of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Key {
    /// Frequency.
    pub frequency_hz: f64,
    /// Amplitude: a full-scale sine has 1.
    pub amplitude: f64,
    /// Phase of the cosine, in radians.
    pub phase: f64,
}

/// A sinusoid from its birth to its death.
#[derive(Debug, Clone, PartialEq)]
pub struct Partial {
    /// The frame of its first key.
    pub first_frame: usize,
    /// One key a frame.
    pub keys: Vec<Key>,
}

/// All sinusoids of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Partials {
    /// Frames (samples) a second.
    pub rate_hz: u32,
    /// Samples from one key to the next; key 0 of frame 0 is at sample 0.
    pub hop: usize,
    /// The recording's length in samples.
    pub length: usize,
    /// In the order of their birth.
    pub partials: Vec<Partial>,
}

/// A recording in two parts that add up to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Split {
    /// What rings.
    pub sinusoids: Vec<f32>,
    /// What rustles: the recording less the sinusoids.
    pub residual: Vec<f32>,
}

impl SpectralModel {
    /// Finds the partials of one channel.
    ///
    /// # Errors
    /// Where there is no sample, one is not a finite number, the rate is not one of sound (1 kHz to 768 kHz) or a
    /// setting makes no sense.
    pub fn analyse(&self, samples: &[f32], rate_hz: u32) -> Result<Partials> {
        check_sound(samples, rate_hz)?;
        self.check()?;
        let rate = f64::from(rate_hz);
        let hop = ((self.hop_s * rate).round() as usize).max(1);
        let frames = peaks::find(self, samples, rate_hz, hop);
        let partials = tracking::follow(self, &frames, hop as f64 / rate);
        let mut partials = Partials { rate_hz, hop, length: samples.len(), partials };
        for _ in 0..self.corrections {
            peaks::correct(self, &partials.residual(samples), &mut partials);
        }
        Ok(partials)
    }

    /// Splits one channel into sinusoids and residual.
    ///
    /// ```
    /// use froufrou::corpus::spectral::SpectralModel;
    /// let hum: Vec<f32> = (0..8000).map(|i| 0.5 * (i as f32 * 0.3).sin()).collect();
    /// let split = SpectralModel::default().split(&hum, 8000)?;
    /// let left: f32 = split.residual.iter().map(|v| v * v).sum();
    /// assert!(left < 1.0);
    /// # Ok::<(), froufrou::Error>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`SpectralModel::analyse`].
    pub fn split(&self, samples: &[f32], rate_hz: u32) -> Result<Split> {
        let sinusoids = self.analyse(samples, rate_hz)?.render();
        let residual = difference(samples, &sinusoids);
        Ok(Split { sinusoids, residual })
    }

    pub(super) fn check(&self) -> Result<()> {
        let positive = [("window_s", self.window_s), ("hop_s", self.hop_s)];
        if let Some((name, value)) = positive.into_iter().find(|(_, v)| !(1e-5..=10.0).contains(v)) {
            return Err(Error::new(format!("{name} is {value}, expected 0.00001 to 10 seconds")));
        }
        let others = [
            ("shortest_s", self.shortest_s),
            ("deviation_hz", self.deviation_hz),
            ("deviation_slope", self.deviation_slope),
            ("threshold_db, its sign turned,", -self.threshold_db),
        ];
        match others.into_iter().find(|(_, v)| !(v.is_finite() && *v >= 0.0)) {
            Some((name, value)) => Err(Error::new(format!("{name} is {value}, expected 0 or more"))),
            None => Ok(()),
        }
    }
}

impl Partials {
    /// The sound of all partials, as long as the recording.
    pub fn render(&self) -> Vec<f32> {
        additive::render(self)
    }

    /// A sound less all partials.
    fn residual(&self, samples: &[f32]) -> Vec<f32> {
        difference(samples, &self.render())
    }
}

fn difference(whole: &[f32], part: &[f32]) -> Vec<f32> {
    whole.iter().zip(part).map(|(whole, part)| whole - part).collect()
}

/// What every analysis of one channel asks of it.
pub(super) fn check_sound(samples: &[f32], rate_hz: u32) -> Result<()> {
    if !RATES_HZ.contains(&rate_hz) {
        return Err(Error::new(format!("the rate is {rate_hz} Hz, expected 1000 to 768000 Hz")));
    }
    if samples.is_empty() {
        return Err(Error::new("expected sound, found 0 samples"));
    }
    match samples.iter().position(|v| !v.is_finite()) {
        Some(at) => Err(Error::new(format!("the sample is {}, expected a finite number", samples[at]))
            .at(Place::Part(format!("sample {at}")))),
        None => Ok(()),
    }
}
