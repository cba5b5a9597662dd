//! A string, by Takala & Hahn's closed form.
//!
//! Partial n has the frequency f_n = n f₀ √(1 + B n²) (B = 0 without stiffness) and dies away as
//! e^(−β f_n t): damping is proportional to frequency. Plucked or struck at D, from 0 to 1 along it:
//!
//! ```text
//! plucked  w_n = 2 sin(nπD) / (n²π² D (1 − D))   displaced to a triangle and let go
//! struck   w_n = sin(nπD) / n                     a velocity given to one point
//! ```
//!
//! A pluck of 1 N s peaks at exactly 1 wherever it is done, but for damping: the sum of its partials
//! runs through the triangle itself. A strike of 1 N s in the middle gives the lowest partial the
//! amplitude 1; all together peak near 2.7, as a blow is sharper than a pluck.
//!
//! | parameter | default | from, to | |
//! | --- | --- | --- | --- |
//! | `frequency` | 220 | 1, 20 000 | f₀ in hertz |
//! | `damping` | 0.005 | 1e-6, 1 | β |
//! | `stiffness` | 0 | 0, 1 | B: about 0.0001 for a low piano string |
//! | `modes` | all below 20 kHz, 1000 at most | 1, 10 000 | number of partials |
//! | `pluck` | 1 | 0, 1 | 1 plucked, 0 struck, between the two a mixture |

use std::f64::consts::PI;

use super::{Mode, Modes, Shape};
use crate::synth::instrument::Parameters;
use crate::{Error, Place, Result};

/// Where the hearing of the young ends: what a body of closed form has above is left out.
pub(super) const HIGHEST_HZ: f64 = 20_000.0;

/// The most modes that a body of closed form has unless it is told.
pub(super) const MANY: usize = 1000;

/// The most that it can be told.
pub(super) const MOST: f64 = 10_000.0;

/// The modes of a string with these parameters.
///
/// # Errors
/// A parameter that there is not, or one outside of its range.
pub fn modes(given: &[(String, f64)]) -> Result<Modes> {
    let mut parameters = Parameters::new(given);
    let frequency_hz = parameters.take("frequency", 220.0, 1.0..=20_000.0)?;
    let damping = parameters.take("damping", 0.005, 1e-6..=1.0)?;
    let stiffness = parameters.take("stiffness", 0.0, 0.0..=1.0)?;
    let pluck = parameters.take("pluck", 1.0, 0.0..=1.0)?;
    let count = mode_count(&mut parameters)?;
    parameters.finish()?;
    let frequency = |n: f64| n * frequency_hz * (1.0 + stiffness * n * n).sqrt();
    let modes = closed_form(count, |n| {
        let shape = Shape::String { partial: n as u32, pluck };
        let frequency_hz = frequency(n as f64);
        Mode { frequency_hz, decay_per_s: damping * frequency_hz, gain: 1.0, shape }
    });
    Modes::new(modes)
}

/// How many modes are wanted, where it is said.
pub(super) fn mode_count(parameters: &mut Parameters<'_>) -> Result<Option<usize>> {
    let count = parameters.take("modes", 0.0, 1.0..=MOST)?;
    if count.fract() != 0.0 {
        let fault = Error::new(format!("`modes` is {count}, not a whole number"));
        return Err(fault.at(Place::Part("modes".to_owned())));
    }
    Ok((count > 0.0).then_some(count as usize))
}

/// The modes from 1 on: as many as wanted, else those that can be heard, but one at least.
pub(super) fn closed_form(count: Option<usize>, mode: impl Fn(usize) -> Mode) -> Vec<Mode> {
    let audible = |mode: &Mode| count.is_some() || mode.frequency_hz < HIGHEST_HZ;
    let first = mode(1);
    let others = (2..=count.unwrap_or(MANY)).map(mode).take_while(audible);
    std::iter::once(first).chain(others).collect()
}

/// The weight of a partial, plucked (1) or struck (0) at a place from 0 to 1.
pub(super) fn gain(partial: u32, pluck: f64, place: f64) -> f64 {
    let n = f64::from(partial);
    let sin = (n * PI * place).sin();
    // At an end the triangle becomes a ramp: the limits of the form.
    let plucked = if place < 1e-9 {
        2.0 / (n * PI)
    } else if place > 1.0 - 1e-9 {
        if partial % 2 == 1 { 2.0 / (n * PI) } else { -2.0 / (n * PI) }
    } else {
        2.0 * sin / (n * n * PI * PI * place * (1.0 - place))
    };
    pluck * plucked + (1.0 - pluck) * sin / n
}
