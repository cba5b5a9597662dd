//! A bar that bends (Euler–Bernoulli), struck.
//!
//! Mode n has the frequency f_n = f₁ (k_n / k₁)², where k_n is its wave number times the bar's length,
//! and dies away as e^(−β f_n t). Struck at D, its amplitude is φ_n(D) · f₁ / f_n: the shape of the mode
//! there, whose greatest value is 1, and as a given velocity moves a slow mode further. So 1 N s at the
//! best place gives the lowest mode the amplitude 1; all together peak between 1 and 2.
//!
//! | held | k_n | shape | sounds like |
//! | --- | --- | --- | --- |
//! | [`Ends::Supported`] | nπ | sin(nπx) | Takala & Hahn's bar: f_n = n² f₁ |
//! | [`Ends::Free`] | cos k cosh k = 1 | cosh + cos − σ (sinh + sin) | a glockenspiel: 1, 2.76, 5.40, … |
//! | [`Ends::Clamped`] | cos k cosh k = −1 | cosh − cos − σ (sinh − sin) | a ruler held at 0: 1, 6.27, 17.5, … |
//!
//! | parameter | default | from, to | |
//! | --- | --- | --- | --- |
//! | `frequency` | 440 | 1, 20 000 | f₁ in hertz |
//! | `damping` | 0.01 | 1e-6, 1 | β |
//! | `modes` | all below 20 kHz, 1000 at most | 1, 10 000 | number of modes |

use std::f64::consts::PI;

use super::string::{closed_form, mode_count};
use super::{Mode, Modes, Shape};
use crate::Result;
use crate::synth::instrument::Parameters;

/// How a bar is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ends {
    /// Both ends lie on something and can tilt.
    Supported,
    /// Neither end is held.
    Free,
    /// One end, at place 0, is held fast; the other is free.
    Clamped,
}

/// The modes of a bar with these parameters.
///
/// # Errors
/// A parameter that there is not, or one outside of its range.
pub fn modes(ends: Ends, given: &[(String, f64)]) -> Result<Modes> {
    let mut parameters = Parameters::new(given);
    let frequency_hz = parameters.take("frequency", 440.0, 1.0..=20_000.0)?;
    let damping = parameters.take("damping", 0.01, 1e-6..=1.0)?;
    let count = mode_count(&mut parameters)?;
    parameters.finish()?;
    let first = ends.wave_number(1);
    let modes = closed_form(count, |n| {
        let wave_number = ends.wave_number(n);
        let ratio = (wave_number / first).powi(2);
        Mode {
            frequency_hz: frequency_hz * ratio,
            decay_per_s: damping * frequency_hz * ratio,
            gain: 1.0 / ratio,
            shape: Shape::Bar { ends, wave_number },
        }
    });
    Modes::new(modes)
}

impl Ends {
    /// The wave number of mode `n`, from 1, times the length of the bar.
    pub fn wave_number(self, n: usize) -> f64 {
        let n = n as f64;
        let (guess, sign) = match self {
            Ends::Supported => return n * PI,
            Ends::Free => ((n + 0.5) * PI, 1.0),
            Ends::Clamped => ((n - 0.5) * PI, -1.0),
        };
        // cos k − sign / cosh k = 0 by Newton's method: the guess is close, and the closer the higher.
        let mut k = guess;
        for _ in 0..20 {
            let value = k.cos() - sign / k.cosh();
            let slope = -k.sin() + sign * k.sinh() / (k.cosh() * k.cosh());
            let step = value / if slope.is_finite() { slope } else { -k.sin() };
            k -= step;
            if step.abs() < 1e-15 * k {
                break;
            }
        }
        k
    }

    /// The shape of the mode of wave number `k` at a place from 0 to 1; its greatest value is 1.
    pub fn shape(self, k: f64, place: f64) -> f64 {
        let (sin, cos) = (k * place).sin_cos();
        let (sin_k, cos_k) = k.sin_cos();
        // cosh − σ sinh, where the two nearly cancel, is e^(−kx) + (1 − σ) sinh, and 1 − σ is a small
        // number over (sinh k ∓ …). Everything is divided by e^k, so that nothing grows.
        let (decay, decay_k) = ((-k * place).exp(), (-k).exp());
        let rise = 0.5 * ((k * (place - 1.0)).exp() - decay * decay_k);
        match self {
            Ends::Supported => sin,
            Ends::Free => {
                let over = 0.5 * (1.0 - decay_k * decay_k) - sin_k * decay_k;
                let rest = (cos_k - sin_k - decay_k) / over;
                let sigma = 1.0 - rest * decay_k;
                0.5 * (decay + rest * rise + cos - sigma * sin)
            }
            Ends::Clamped => {
                let over = 0.5 * (1.0 + decay_k * decay_k) + cos_k * decay_k;
                let rest = (cos_k + sin_k + decay_k) / over;
                let sigma = 1.0 - rest * decay_k;
                0.5 * (decay + rest * rise - cos + sigma * sin)
            }
        }
    }
}
