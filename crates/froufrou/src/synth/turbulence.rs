//! Turbulence: white noise, as loud as the speed through the air times the air that is disturbed
//! (Takala & Hahn 1992).
//!
//! The control is `speed` in m/s; its sign does not matter.
//!
//! | parameter | default | from, to | |
//! | --- | --- | --- | --- |
//! | `air` | 0.1 | 0, 1000 | the amount of air that the body disturbs |
//! | `size` | 0: none | 0, 1000 | metres across: gives the noise a colour |
//!
//! Where speed times air is 1 m/s, the noise below 24 kHz has a root mean square of 1/4; its spectral
//! density in power a hertz is the same at every sample rate. With a `size`, a first-order low-pass
//! darkens it above the frequency at which a body of this size sheds vortices, 0.2 · speed / size
//! (Strouhal's number): a rope sings, a sheet booms.

use std::f64::consts::TAU;

use super::gate::{control, finite};
use super::instrument::{Control, Generator, Instrument, Parameters, Stretch};
use crate::Result;
use crate::random::Random;

/// Root mean square, at speed times air 1, of what lies below [`BAND_HZ`].
const LEVEL: f64 = 0.25;

/// The band in which [`LEVEL`] is measured.
const BAND_HZ: f64 = 24_000.0;

/// Strouhal's number of blunt bodies over a wide range of speeds.
const STROUHAL: f64 = 0.2;

/// The sound of moving air.
#[derive(Debug)]
pub struct Turbulence {
    air: f64,
    size_m: f64,
    controls: [Control; 1],
}

impl Turbulence {
    /// Moving air with these parameters.
    ///
    /// # Errors
    /// A parameter that there is not, or one outside of its range.
    pub fn new(given: &[(String, f64)]) -> Result<Self> {
        let mut parameters = Parameters::new(given);
        let air = parameters.take("air", 0.1, 0.0..=1000.0)?;
        let size_m = parameters.take("size", 0.0, 0.0..=1000.0)?;
        parameters.finish()?;
        Ok(Self { air, size_m, controls: [Control { name: "speed".to_owned(), default: 0.0 }] })
    }
}

impl Instrument for Turbulence {
    fn controls(&self) -> &[Control] {
        &self.controls
    }

    fn ring_s(&self) -> Option<f64> {
        None
    }

    fn generator(&self, rate_hz: f64, random: Random) -> Result<Box<dyn Generator>> {
        // White noise from −1 to 1 has a variance of 1/3, spread over half the rate.
        let scale = LEVEL * (3.0 * rate_hz / (2.0 * BAND_HZ)).sqrt();
        Ok(Box::new(Air { gain: self.air * scale, size_m: self.size_m, random, before: [0.0; 2] }))
    }
}

struct Air {
    gain: f64,
    size_m: f64,
    random: Random,
    /// The filter's last input and output.
    before: [f64; 2],
}

impl Generator for Air {
    fn generate(&mut self, stretch: &Stretch<'_>, out: &mut [f32]) -> Result<()> {
        let speed = control(stretch, 0, 0.0);
        let speeds = [speed.from, speed.to];
        let count = out.len() as f64;
        let filters = speeds.map(|v| low_pass(STROUHAL * v / self.size_m, stretch.rate_hz));
        for (n, out) in out.iter_mut().enumerate() {
            let part = n as f64 / count;
            let between = |values: [f64; 2]| values[0] + (values[1] - values[0]) * part;
            let mut noise = 2.0 * self.random.uniform(stretch.first + n as u64) - 1.0;
            if self.size_m > 0.0 {
                let [now, last, feedback] = std::array::from_fn(|k| between([filters[0][k], filters[1][k]]));
                let filtered = now * noise + last * self.before[0] + feedback * self.before[1];
                self.before = [noise, filtered];
                noise = filtered;
            }
            *out = finite(noise * between(speeds) * self.gain);
        }
        Ok(())
    }
}

/// The coefficients of a first-order low-pass (of the input, of the input before, of the output
/// before) that is right at 0, at the Nyquist frequency and in its decay, so that it is the same at
/// every sample rate within a decibel.
fn low_pass(corner_hz: f64, rate_hz: f64) -> [f64; 3] {
    if corner_hz.is_nan() || corner_hz > 1e3 * rate_hz {
        return [1.0, 0.0, 0.0];
    }
    let pole = (-TAU * corner_hz / rate_hz).exp();
    let top = if corner_hz > 0.0 { 1.0 / (1.0 + (rate_hz / 2.0 / corner_hz).powi(2)).sqrt() } else { 0.0 };
    let (sum, difference) = (1.0 - pole, top * (1.0 + pole));
    [(sum + difference) / 2.0, (sum - difference) / 2.0, pole]
}
