//! From numbers to the integers of a file: dither, rounding, and a count of what did not fit.

use std::path::Path;

use super::format::{SampleFormat, SoundFormat, Written};
use crate::error::{Error, Result};
use crate::random::Random;

/// Makes the samples of one file, whatever container they go to.
pub(super) struct Quantizer {
    format: SoundFormat,
    dither: Vec<Random>,
    written: Written,
}

impl Quantizer {
    pub(super) fn new(format: SoundFormat) -> Self {
        let dither = (0..format.channels as u64).map(|channel| Random::new(format.seed, channel)).collect();
        Self { format, dither, written: Written::default() }
    }

    /// What has passed so far.
    pub(super) fn written(&self) -> Written {
        self.written
    }

    /// Refuses what is not made of whole frames.
    pub(super) fn check(&self, interleaved: &[f32], path: &Path) -> Result<()> {
        if interleaved.len().is_multiple_of(self.format.channels) {
            return Ok(());
        }
        Err(Error::new(format!(
            "a block of {} samples was given, expected a multiple of the {} channels",
            interleaved.len(),
            self.format.channels
        ))
        .in_file(path))
    }

    /// Hands on each sample of whole frames as its integer; not for floats.
    pub(super) fn integers(&mut self, interleaved: &[f32], mut each: impl FnMut(i32)) {
        for frame in interleaved.chunks_exact(self.format.channels) {
            let index = self.format.first_frame.wrapping_add(self.written.frames);
            for (sample, dither) in frame.iter().zip(&self.dither) {
                self.written.not_a_number += u64::from(sample.is_nan());
                let (bits, noise) = match self.format.samples {
                    // Silence stays silence.
                    SampleFormat::Int16 if *sample != 0.0 => (16, triangular(*dither, index)),
                    SampleFormat::Int16 => (16, 0.0),
                    SampleFormat::Int24 | SampleFormat::Float32 => (24, 0.0),
                };
                let steps = f64::from(*sample) * f64::from(1u32 << (bits - 1));
                each(round(steps + noise, bits, &mut self.written.clipped));
            }
            self.written.frames += 1;
        }
    }

    /// Counts whole frames that are written as they are.
    pub(super) fn floats(&mut self, interleaved: &[f32]) {
        self.written.not_a_number += interleaved.iter().filter(|sample| sample.is_nan()).count() as u64;
        self.written.frames += (interleaved.len() / self.format.channels) as u64;
    }
}

/// The nearest step that so many bits hold; counts those beyond. Not a number gives 0.
fn round(steps: f64, bits: u32, clipped: &mut u64) -> i32 {
    let limit = f64::from(1u32 << (bits - 1));
    let rounded = steps.round();
    *clipped += u64::from(rounded < -limit || rounded >= limit);
    rounded.clamp(-limit, limit - 1.0) as i32
}

/// A number in (−1, 1) of triangular density: the difference of two uniform ones.
fn triangular(random: Random, index: u64) -> f64 {
    let bits = random.bits(index);
    ((bits >> 32) as f64 - (bits & 0xffff_ffff) as f64) / 4_294_967_296.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_have_dither_of_their_own() {
        let [a, b] = [0, 1].map(|channel| triangular(Random::new(7, channel), 5));
        assert_ne!(a, b);
    }
}
