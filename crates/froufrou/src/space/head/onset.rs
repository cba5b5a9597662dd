//! When a response begins.
//!
//! A response is its minimum-phase version, delayed, and something of an all-pass filter. The delay is found
//! where the response resembles that version most (Nam, Abel & Smith 2008, "A method for estimating
//! interaural time difference for binaural synthesis"). Only what lies below 3 kHz is compared: there the
//! delay changes smoothly from direction to direction, as no pinna is in its way, and it is what is heard.

use std::sync::Arc;

use realfft::num_complex::Complex;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};

/// Above this, a response and its minimum-phase version are not compared.
const COMPARED_HZ: f64 = 3000.0;

/// The minimum-phase version is that of magnitudes not below this part of the largest.
const FLOOR: f64 = 1e-6;

/// Finds the onsets of responses of one length and rate.
pub(super) struct Onsets {
    forward: Arc<dyn RealToComplex<f64>>,
    inverse: Arc<dyn ComplexToReal<f64>>,
    /// By frequency, how much it counts; beyond the last, nothing does.
    weights: Vec<f64>,
}

impl Onsets {
    pub(super) fn new(samples: usize, rate_hz: f64) -> Self {
        let size = (4 * samples).next_power_of_two().max(512);
        let mut planner = RealFftPlanner::new();
        let weight = |k: usize| {
            let frequency_hz = k as f64 * rate_hz / size as f64;
            1.0 / (1.0 + (frequency_hz / COMPARED_HZ).powi(8))
        };
        let weights = (0..=size / 2).map(weight).take_while(|weight| *weight > 1e-6).collect();
        Self { forward: planner.plan_fft_forward(size), inverse: planner.plan_fft_inverse(size), weights }
    }

    /// The onset of a response in samples, which need not be whole; none where it is silent.
    pub(super) fn find(&self, response: &[f64]) -> Option<f64> {
        let size = self.forward.len();
        let mut time = self.forward.make_input_vec();
        let mut spectrum = self.forward.make_output_vec();
        let peak = response.iter().fold(0.0_f64, |peak, x| peak.max(x.abs()));
        if !(peak > 0.0 && peak.is_finite()) {
            return None;
        }
        for (time, x) in time.iter_mut().zip(response) {
            *time = x / peak;
        }
        self.forward.process(&mut time, &mut spectrum).ok()?;
        // The minimum phase is the Hilbert transform of the logarithm of the magnitude, by way of the cepstrum.
        let most = spectrum.iter().map(|x| x.norm()).fold(0.0, f64::max);
        let mut logarithm: Vec<Complex<f64>> =
            spectrum.iter().map(|x| Complex::new((x.norm() / most).max(FLOOR).ln(), 0.0)).collect();
        self.inverse.process(&mut logarithm, &mut time).ok()?;
        for (n, x) in time.iter_mut().enumerate() {
            *x *= match n {
                0 => 1.0,
                n if n == size / 2 => 1.0,
                n if n < size / 2 => 2.0,
                _ => 0.0,
            } / size as f64;
        }
        let mut folded = self.forward.make_output_vec();
        self.forward.process(&mut time, &mut folded).ok()?;
        let mut likeness = self.inverse.make_input_vec();
        for ((likeness, (x, folded)), weight) in
            likeness.iter_mut().zip(spectrum.iter().zip(&folded)).zip(&self.weights)
        {
            *likeness = x * folded.exp().conj() * weight;
        }
        if let Some(first) = likeness.first_mut() {
            first.im = 0.0;
        }
        let kept: Vec<Complex<f64>> = likeness[..self.weights.len().min(size / 2)].to_vec();
        if self.weights.len() > size / 2 {
            likeness[size / 2] = Complex::ZERO;
        }
        self.inverse.process(&mut likeness, &mut time).ok()?;
        let at = (0..response.len().min(size)).max_by(|a, b| time[*a].total_cmp(&time[*b]))?;
        Some(top(&kept, at as f64, size).max(0.0))
    }
}

/// The top near a sample of what a spectrum says, by Newton's method.
fn top(spectrum: &[Complex<f64>], mut at: f64, size: usize) -> f64 {
    let begin = at;
    for _ in 0..6 {
        let (mut slope, mut bend) = (0.0, 0.0);
        for (k, value) in spectrum.iter().enumerate() {
            let omega = std::f64::consts::TAU * k as f64 / size as f64;
            let turned = value * Complex::from_polar(1.0, omega * at);
            slope -= omega * turned.im;
            bend -= omega * omega * turned.re;
        }
        if bend >= 0.0 {
            break;
        }
        let step = (slope / bend).clamp(-0.5, 0.5);
        at -= step;
        if step.abs() < 1e-7 {
            break;
        }
    }
    at.clamp(begin - 1.0, begin + 1.0)
}
