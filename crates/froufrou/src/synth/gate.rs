//! What the sounds of sliding share: how they follow their controls, and that they are silent while
//! nothing slides.

use super::instrument::{Ramp, Stretch};

/// Opens and shuts without a click: follows its target through two first-order low-passes, so that
/// even its slope does not jump.
#[derive(Debug, Clone)]
pub(super) struct Gate {
    part: f64,
    values: [f64; 2],
}

/// The time constant of each of the two low-passes in seconds.
const TIME_S: f64 = 0.004;

/// The opening below which the gate is shut: −120 dB.
const SHUT: f64 = 1e-6;

impl Gate {
    /// A shut gate.
    pub fn new(rate_hz: f64) -> Self {
        Self { part: 1.0 - (-1.0 / (TIME_S * rate_hz)).exp(), values: [0.0; 2] }
    }

    /// The opening at the next sample, towards a target from 0 to 1.
    pub fn next(&mut self, target: f64) -> f64 {
        self.values[0] += self.part * (target - self.values[0]);
        self.values[1] += self.part * (self.values[0] - self.values[1]);
        if target == 0.0 && self.values[0].max(self.values[1]) < SHUT {
            self.values = [0.0; 2];
        }
        self.values[1]
    }

    /// True while nothing gets through.
    pub fn is_shut(&self) -> bool {
        self.values == [0.0; 2]
    }
}

/// 0 up to 0, 1 from 1 on, smooth between.
pub(super) fn smooth_step(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// The size of a control over a stretch; its default where the stretch has none.
pub(super) fn control(stretch: &Stretch<'_>, index: usize, default: f64) -> Ramp {
    let ramp = stretch.controls.get(index).copied().unwrap_or(Ramp::still(default));
    Ramp { from: size(ramp.from), to: size(ramp.to) }
}

/// The size of a speed or force, from 0 to 1e30; what is no number is 0.
fn size(value: f64) -> f64 {
    if value.is_nan() { 0.0 } else { value.abs().min(1e30) }
}

/// As single precision can hold it. The value must be a number.
pub(super) fn finite(value: f64) -> f32 {
    value.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32
}
