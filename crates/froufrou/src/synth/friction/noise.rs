//! Noise of a spectrum that changes: frames of random phase, overlapped and added.
//!
//! A frame of cloth is 50 ms long, the next begins 25 ms later. Phases of two frames have nothing to do with one another, so what
//! overlaps adds in power, and a window whose *square* adds to 1 keeps the level: half a sine. A triangular one, as An, James &
//! Marschner (2012) had, adds to 1 itself; its power falls to a half between two frames, 3 dB forty times a second.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use realfft::num_complex::Complex;
use realfft::{ComplexToReal, RealFftPlanner};

use crate::random::Random;

/// From the beginning of one frame to that of the next.
pub const HOP_S: f64 = 0.025;

/// Numbers of random phases that one frame may take.
const PHASES: u64 = 1 << 20;

/// Makes noise frame by frame.
pub struct Noise {
    hop: usize,
    inverse: Arc<dyn ComplexToReal<f32>>,
    window: Vec<f32>,
    random: Random,
    bins: Vec<Complex<f32>>,
    frame: Vec<f32>,
    scratch: Vec<Complex<f32>>,
    /// What sounds until the next frame begins, and what is left of this one then.
    now: Vec<f32>,
    rest: Vec<f32>,
    rests: bool,
}

impl Noise {
    /// A frame begins every `hop` samples, and is twice as long.
    pub fn new(hop: usize, random: Random) -> Self {
        let inverse = RealFftPlanner::new().plan_fft_inverse(2 * hop);
        let window = (0..2 * hop).map(|n| (PI * (n as f64 + 0.5) / (2 * hop) as f64).sin() as f32).collect();
        Self {
            hop,
            window,
            random,
            bins: inverse.make_input_vec(),
            frame: inverse.make_output_vec(),
            scratch: inverse.make_scratch_vec(),
            inverse,
            now: vec![0.0; hop],
            rest: vec![0.0; hop],
            rests: true,
        }
    }

    /// Samples from one frame to the next.
    pub fn hop(&self) -> usize {
        self.hop
    }

    /// Whether nothing sounds.
    pub fn rests(&self) -> bool {
        self.rests
    }

    /// The frame of a number begins. `amplitudes` are those of its cosines, from the first bin on; an empty one is silent.
    pub fn begin(&mut self, number: u64, amplitudes: &[f32]) {
        if amplitudes.is_empty() {
            std::mem::swap(&mut self.now, &mut self.rest);
            self.rest.fill(0.0);
            self.rests = self.now.iter().all(|sample| *sample == 0.0);
            return;
        }
        self.bins.fill(Complex::default());
        // That of half the rate has no phase to choose, and is left out.
        let last = self.bins.len() - 1;
        for ((bin, amplitude), index) in self.bins[1..last].iter_mut().zip(amplitudes).zip(0u64..) {
            if *amplitude > 0.0 {
                let phase = TAU * self.random.uniform(number.wrapping_mul(PHASES).wrapping_add(index));
                *bin = Complex::from_polar(amplitude / 2.0, phase as f32);
            }
        }
        // The lengths are those that it asked for.
        if self.inverse.process_with_scratch(&mut self.bins, &mut self.frame, &mut self.scratch).is_err() {
            self.frame.fill(0.0);
        }
        let (rises, falls) = self.window.split_at(self.hop);
        let (first, second) = self.frame.split_at(self.hop);
        for (n, now) in self.now.iter_mut().enumerate() {
            *now = self.rest[n] + rises[n] * first[n];
            self.rest[n] = falls[n] * second[n];
        }
        self.rests = false;
    }

    /// What sounds, from one frame to the next.
    pub fn samples(&self) -> &[f32] {
        &self.now
    }
}

/// Samples from one frame to the next at a rate.
pub fn hop_samples(rate_hz: f64) -> usize {
    ((rate_hz * HOP_S).round() as usize).max(2)
}
