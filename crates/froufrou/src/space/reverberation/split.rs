//! White noise in octave bands.

use super::super::bands::BANDS_HZ;
use super::super::convolution::Convolver;
use crate::Result;
use crate::random::Random;
use crate::synth::kernel::{kaiser, sinc};

/// The transition between two bands of noise is this part of its frequency wide, and no wider than so many Hz.
const TRANSITION: (f64, f64) = (0.2, 100.0);

/// Shape of Kaiser's window for 80 dB, and its product of time and bandwidth.
const KAISER: (f64, f64) = (7.86, 5.0);

/// A band of white noise.
pub(super) struct Split {
    pub(super) band: usize,
    pub(super) width_hz: f64,
    /// A symmetric response.
    taps: Vec<f32>,
}

/// Frames that are filtered at once.
const CHUNK: usize = 4096;

impl Split {
    /// The bands that are heard, with the frequencies below the lowest apart: so a band that is measured is one
    /// that is made. Their responses add up to an impulse.
    pub(super) fn all(rate_hz: f64, heard: usize) -> Vec<Self> {
        let root = 10f64.powf(0.15);
        let edges_hz: Vec<f64> =
            std::iter::once(BANDS_HZ[0] / root).chain((1..heard).map(|band| BANDS_HZ[band] / root)).collect();
        let low_passes: Vec<Vec<f64>> = edges_hz
            .iter()
            .map(|edge_hz| {
                let (beta, time_bandwidth) = KAISER;
                let width_hz = (TRANSITION.0 * edge_hz).min(TRANSITION.1);
                let half = (0.5 * time_bandwidth / width_hz * rate_hz) as usize;
                let cutoff = 2.0 * edge_hz / rate_hz;
                let at = |tap: usize| tap as f64 - half as f64;
                let window = |tap: usize| kaiser(at(tap) / (half + 1) as f64, beta);
                (0..=2 * half).map(|tap| window(tap) * cutoff * sinc(cutoff * at(tap))).collect()
            })
            .collect();
        (0..=edges_hz.len())
            .map(|index| {
                // What passes below the upper edge but not below the lower one.
                let below = index.checked_sub(1).and_then(|index| low_passes.get(index));
                let upper = low_passes.get(index);
                let mut taps = below.or(upper).map_or(Vec::new(), |longest| vec![0.0; longest.len()]);
                let centre = taps.len() / 2;
                match upper {
                    None => taps[centre] = 1.0,
                    Some(upper) => {
                        let first = centre - upper.len() / 2;
                        taps[first..].iter_mut().zip(upper).for_each(|(sum, tap)| *sum += tap);
                    }
                }
                if let Some(below) = below {
                    taps.iter_mut().zip(below).for_each(|(sum, tap)| *sum -= tap);
                }
                let band = index.saturating_sub(1);
                let upper_hz = edges_hz.get(index).copied().unwrap_or(0.5 * rate_hz);
                let width_hz = upper_hz - index.checked_sub(1).map_or(0.0, |below| edges_hz[below]);
                Self { band, width_hz, taps: taps.into_iter().map(|tap| tap as f32).collect() }
            })
            .collect()
    }

    /// The mean energy of a frame of this band of noise.
    pub(super) fn energy(&self) -> f64 {
        self.taps.iter().map(|tap| f64::from(*tap).powi(2)).sum()
    }

    /// Fills in noise that would have a variance of 1 if all bands were added.
    pub(super) fn noise(&self, random: Random, out: &mut [f32]) -> Result<()> {
        let mut filter = Convolver::new(&[&self.taps])?;
        let half = self.taps.len() / 2;
        // Every band hears the same noise at the same time.
        let white = |frame: i64| 3f64.sqrt() * (2.0 * random.uniform(frame as u64) - 1.0);
        let mut input = [0.0f32; CHUNK];
        let mut frame = -(half as i64);
        let mut fill = |input: &mut [f32]| {
            for value in input {
                *value = white(frame) as f32;
                frame += 1;
            }
        };
        let mut before = 2 * half;
        while before > 0 {
            let input = &mut input[..before.min(CHUNK)];
            fill(input);
            filter.skip(input)?;
            before -= input.len();
        }
        for out in out.chunks_mut(CHUNK) {
            let input = &mut input[..out.len()];
            fill(input);
            filter.process(input, out)?;
        }
        Ok(())
    }
}
