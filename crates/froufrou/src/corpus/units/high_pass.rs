//! A Butterworth high-pass of 5th order, so that zero crossings are never far apart.

use crate::error::{Error, Place, Result};

/// A section of second order, or of first where its last coefficients are 0, in transposed direct form II.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Section {
    numerator: [f64; 3],
    denominator: [f64; 2],
    state: [f64; 2],
}

impl Section {
    fn next(&mut self, input: f64) -> f64 {
        let [b0, b1, b2] = self.numerator;
        let [a1, a2] = self.denominator;
        let output = b0 * input + self.state[0];
        self.state = [b1 * input - a1 * output + self.state[1], b2 * input - a2 * output];
        output
    }
}

/// The filter of one channel: its state goes from block to block.
#[derive(Debug, Clone, PartialEq)]
pub struct HighPass {
    sections: Vec<Section>,
}

impl HighPass {
    /// A filter that is 3 dB down at a frequency; at 0 Hz one that changes nothing.
    ///
    /// # Errors
    /// A frequency that is not below half the rate.
    pub fn new(frequency_hz: f64, rate_hz: u32) -> Result<Self> {
        if frequency_hz == 0.0 {
            return Ok(Self { sections: Vec::new() });
        }
        let half_hz = f64::from(rate_hz) / 2.0;
        if !(frequency_hz > 0.0 && frequency_hz < half_hz) {
            return Err(Error::new(format!(
                "a high-pass at {frequency_hz} Hz is not below {half_hz} Hz, half the rate"
            ))
            .at(Place::Part("units: high_pass_hz".to_owned())));
        }
        let k = (std::f64::consts::PI * frequency_hz / f64::from(rate_hz)).tan();
        let first = Section {
            numerator: [1.0 / (1.0 + k), -1.0 / (1.0 + k), 0.0],
            denominator: [(k - 1.0) / (k + 1.0), 0.0],
            state: [0.0; 2],
        };
        let second = |angle: f64| {
            // 1 / Q of a pair of poles at an angle from the negative real axis.
            let damping = 2.0 * angle.cos();
            let norm = 1.0 / (1.0 + k * damping + k * k);
            Section {
                numerator: [norm, -2.0 * norm, norm],
                denominator: [2.0 * (k * k - 1.0) * norm, (1.0 - k * damping + k * k) * norm],
                state: [0.0; 2],
            }
        };
        let fifth = std::f64::consts::PI / 5.0;
        Ok(Self { sections: vec![first, second(fifth), second(2.0 * fifth)] })
    }

    /// Filters the next samples in place.
    pub fn process(&mut self, samples: &mut [f32]) {
        if self.sections.is_empty() {
            return;
        }
        for sample in samples {
            let value =
                self.sections.iter_mut().fold(f64::from(*sample), |value, section| section.next(value));
            *sample = value as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::corpus::units::features::tests::fixture;

    /// Equals SciPy's `sosfilt(butter(5, 100, "highpass", fs=96000, output="sos"), ...)`.
    #[test]
    fn equals_scipy() {
        let mut sound: Vec<f32> = fixture("high_pass_in").iter().map(|v| *v as f32).collect();
        let wanted = fixture("high_pass_out");
        let mut filter = HighPass::new(100.0, 96_000).unwrap();
        let (a, b) = sound.split_at_mut(77);
        filter.process(a);
        filter.process(b);
        assert_eq!(sound.len(), wanted.len());
        for (ours, theirs) in sound.iter().zip(&wanted) {
            assert!((f64::from(*ours) - theirs).abs() < 2e-7, "{ours} {theirs}");
        }
    }

    #[test]
    fn a_frequency_is_below_half_the_rate_or_0() {
        assert!(HighPass::new(24_000.0, 48_000).is_err() && HighPass::new(f64::NAN, 48_000).is_err());
        let mut sound = [0.5, -0.25];
        HighPass::new(0.0, 48_000).unwrap().process(&mut sound);
        assert_eq!(sound, [0.5, -0.25]);
    }
}
