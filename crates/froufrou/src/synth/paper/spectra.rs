//! The spectra of a paper as amplitudes of the bins of a frame.

use super::HOP_S;
use crate::corpus::paper::{PaperSound, SPACING_HZ};

/// Samples from one frame to the next at a rate: 1024 at 44.1 kHz. A multiple of 32, so that its FFT is a fast one.
pub fn hop_samples(rate_hz: f64) -> usize {
    ((rate_hz * HOP_S / 32.0).round() as usize).max(1) * 32
}

/// All spectra at a rate.
#[derive(Debug)]
pub struct RateSpectra {
    bins: usize,
    /// Amplitudes of cosines at 1 m/s, spectrum by spectrum, from the first bin on.
    amplitudes: Vec<f32>,
    /// The root mean square of each spectrum at 1 m/s.
    levels: Vec<f64>,
    coherence: f32,
}

impl RateSpectra {
    /// What lies at or above half the rate is left out.
    pub fn new(sound: &PaperSound, rate_hz: f64, coherence: f64) -> Self {
        let length = 2 * hop_samples(rate_hz);
        let bin_hz = rate_hz / length as f64;
        let most = sound.spectra().iter().map(|spectrum| spectrum.density.len()).max().unwrap_or(0);
        let top_hz = (most as f64 + 0.5) * SPACING_HZ;
        let bins = ((top_hz / bin_hz + 0.5).ceil() as usize).min(length / 2 - 1);
        let (mut amplitudes, mut levels) = (Vec::with_capacity(bins * sound.spectra().len()), Vec::new());
        for spectrum in sound.spectra() {
            // The power below each edge between two values, so that none is lost between bins.
            let mut below = vec![0.0f64];
            for value in &spectrum.density {
                below.push(below[below.len() - 1] + value * value * SPACING_HZ);
            }
            let power_below = |frequency_hz: f64| {
                let place = (frequency_hz / SPACING_HZ - 0.5).max(0.0);
                let low = (place as usize).min(below.len() - 1);
                let high = (low + 1).min(below.len() - 1);
                below[low] + (below[high] - below[low]) * (place - low as f64).min(1.0)
            };
            let mut whole = 0.0;
            for bin in 1..=bins {
                let power =
                    power_below((bin as f64 + 0.5) * bin_hz) - power_below((bin as f64 - 0.5) * bin_hz);
                whole += power;
                // A cosine of amplitude a has the power a² / 2.
                amplitudes.push((2.0 * power).sqrt() as f32);
            }
            levels.push(whole.sqrt());
        }
        Self { bins, amplitudes, levels, coherence: coherence as f32 }
    }

    /// The root mean square of each spectrum at 1 m/s.
    pub fn levels(&self) -> &[f64] {
        &self.levels
    }

    /// Fills `out` with the amplitudes of cosines of all that sounds; with none where nothing does. `room` is room to work in.
    pub fn mix(&self, gains: &[f64], room: &mut Vec<f32>, out: &mut Vec<f32>) {
        out.clear();
        let heard = || self.amplitudes.chunks(self.bins.max(1)).zip(gains).filter(|(_, gain)| **gain > 0.0);
        match heard().count() {
            0 => return,
            // One alone is itself, whatever the coherence.
            1 => {}
            _ if self.coherence < 1.0 => return self.mix_partly(heard(), room, out),
            _ => {}
        }
        out.resize(self.bins, 0.0);
        for (amplitudes, gain) in heard() {
            let gain = *gain as f32;
            out.iter_mut().zip(amplitudes).for_each(|(out, amplitude)| *out += gain * amplitude);
        }
    }

    fn mix_partly<'a>(
        &self,
        heard: impl Iterator<Item = (&'a [f32], &'a f64)>,
        squares: &mut Vec<f32>,
        out: &mut Vec<f32>,
    ) {
        squares.clear();
        squares.resize(self.bins, 0.0);
        out.resize(self.bins, 0.0);
        for (amplitudes, gain) in heard {
            let gain = *gain as f32;
            for ((out, square), amplitude) in out.iter_mut().zip(&mut *squares).zip(amplitudes) {
                let heard = gain * amplitude;
                *out += heard;
                *square += heard * heard;
            }
        }
        for (out, square) in out.iter_mut().zip(&*squares) {
            *out = ((1.0 - self.coherence) * square + self.coherence * *out * *out).sqrt();
        }
    }
}
