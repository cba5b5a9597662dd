//! Band-limited reading by a short kernel: what [`sinc`](super::sinc) does, for a fraction of its cost and with
//! less of the topmost band.
//!
//! | quantity | value, against the long kernel |
//! | --- | --- |
//! | pass band | flat within 0.05 dB up to 0.7 of the lower Nyquist frequency (16.8 kHz at 48 kHz); there the long one ends at 20 kHz |
//! | stop band | from the lower Nyquist frequency on, images and aliases below −70 dB; the long one's are below −100 dB |
//! | cost a sample | two dot products of 32 taps up to ratio 1.25, of 32 × ratio above; the long one's are four of 80 |
//!
//! The kernel is tabulated at [`PHASES`] positions between two samples and read between them along straight lines;
//! as for the long one there are tables by ratio. In the first quarter of an octave of compression its length is
//! that of ratio 1 and its transition band as wide.

use std::sync::OnceLock;

use pulp::Simd;

use super::kernel::{self, LANES, Spacing, Taps};
use super::sinc::Samples;
use super::tiny;

/// Positions between two input samples at which the kernel is tabulated. Straight lines between them err by
/// (ω / PHASES)² / 8: −77 dB for 16.8 kHz at 48 kHz, −126 dB for 1 kHz.
const PHASES: usize = 64;

/// Half the kernel's length in input samples at ratio 1.
const HALF_WIDTH: usize = 16;

/// The kernel's length at ratio 1.
const LEAST_WIDTH: usize = 2 * HALF_WIDTH;

/// Shape of the Kaiser window: β = 0.1102 (A − 8.7) (Kaiser 1974).
const KAISER_BETA: f64 = 0.1102 * (ATTENUATION_DB - 8.7);

/// By how much it attenuates.
const ATTENUATION_DB: f64 = 72.0;

/// 256 tables in the first octave of compression: 4 MB at most in each.
const SPACING: Spacing = Spacing::new(256);

/// One cut-off: for each phase a row of taps, and one of what they change by up to the next.
struct Table {
    width: usize,
    taps: Taps,
}

impl Table {
    /// The table for a ratio.
    fn new(ratio: f64) -> Self {
        let unit = LANES as f64 / 2.0;
        let half_width = ((HALF_WIDTH as f64 * ratio / unit).round() * unit) as usize;
        // The upper end of the transition is the stop edge.
        let cutoff = 0.5 / ratio - kernel::transition(half_width, ATTENUATION_DB) / 2.0;
        let width = 2 * half_width;
        let window = kernel::Window::new(KAISER_BETA);
        let row = |phase: usize| kernel::row(half_width, phase as f64 / PHASES as f64, cutoff, &window);
        let mut taps = Vec::with_capacity(2 * PHASES * width);
        let mut this = row(0);
        for phase in 0..PHASES {
            let next = row(phase + 1);
            taps.extend(this.iter().map(|tap| tiny::flushed(*tap as f32)));
            taps.extend(next.iter().zip(&this).map(|(next, this)| tiny::flushed((next - this) as f32)));
            this = next;
        }
        Self { width, taps: Taps::new(&taps) }
    }
}

impl kernel::Table<2, LEAST_WIDTH> for Table {
    const SPACING: Spacing = SPACING;
    const PHASES: usize = PHASES;

    fn get(index: usize) -> &'static Self {
        static TABLES: [OnceLock<Table>; SPACING.count()] = [const { OnceLock::new() }; SPACING.count()];
        let index = index.min(SPACING.count() - 1);
        TABLES[index].get_or_init(|| Table::new(SPACING.ratio(index)))
    }

    #[inline(always)]
    fn width(&self) -> usize {
        self.width
    }

    /// The row of a phase and that of its change.
    #[inline(always)]
    fn rows(&self, phase: usize) -> &[f32] {
        self.taps.of(2 * phase * self.width, 2 * self.width)
    }

    #[inline(always)]
    fn weights(along: f32) -> [f32; 2] {
        [1.0, along]
    }
}

/// Makes the tables that readings up to a ratio need.
pub(super) fn prepare(ratio: f64) {
    for index in 0..=SPACING.index(ratio) {
        <Table as kernel::Table<2, LEAST_WIDTH>>::get(index);
    }
}

impl Samples<'_> {
    /// Reads as [`Samples::read`] does, by the short kernel.
    #[inline(always)]
    pub fn read_short<S: Simd>(
        &self,
        simd: S,
        positions: &[f64],
        ratios: &[f64],
        out: &mut [f32],
        window: &mut Vec<f32>,
    ) {
        kernel::read::<Table, S, 2, LEAST_WIDTH>(simd, self, [positions, ratios], out, window);
    }
}

#[cfg(test)]
mod tests {
    use super::super::sinc::tests::{RATIOS, fit, tone};
    use super::*;

    fn resample(input: &[f32], ratio: f64, count: usize) -> Vec<f64> {
        let samples = Samples { samples: input, looped: false };
        let positions: Vec<f64> = (0..count).map(|n| 400.37 + n as f64 * ratio).collect();
        let mut out = vec![0.0; count];
        samples.read_short(pulp::Scalar, &positions, &vec![ratio; count], &mut out, &mut Vec::new());
        out.into_iter().map(f64::from).collect()
    }

    /// Level and rest, in decibels, of a tone at a part of the lower Nyquist frequency.
    fn read_tone(ratio: f64, part: f64) -> (f64, f64) {
        let frequency = 0.5 * part / ratio.max(1.0);
        fit(&resample(&tone(frequency, 6000), ratio, (5000.0 / ratio) as usize), frequency * ratio)
    }

    #[test]
    fn pass_band_images_and_aliases_are_as_they_are_told() {
        let mut worst = [(0.0f64, f64::NEG_INFINITY); 5];
        let parts = [0.02, 0.1, 0.4, 0.7, 20.0 / 24.0];
        for ratio in RATIOS {
            for (part, worst) in parts.into_iter().zip(&mut worst) {
                let (level, rest) = read_tone(ratio, part);
                *worst = (worst.0.max(level.abs()), worst.1.max(rest));
            }
        }
        for (part, (level, rest)) in parts.into_iter().zip(worst) {
            eprintln!("{:.0} Hz at 48 kHz: level within {level:.3} dB, images {rest:.1} dB", part * 24e3);
            assert!(rest < -70.0, "{part}: {rest} dB");
            assert!(level < if part <= 0.7 { 0.05 } else { 6.0 }, "{part}: {level} dB");
        }
        let mut above = f64::NEG_INFINITY;
        for ratio in RATIOS.into_iter().filter(|ratio| *ratio > 1.0) {
            for part in [1.0005, 1.02, 1.1, 1.3, 1.6, 2.0].into_iter().filter(|part| part / ratio < 1.0) {
                let output = resample(&tone(0.5 * part / ratio, 6000), ratio, (5000.0 / ratio) as usize);
                let power = output.iter().map(|y| y * y).sum::<f64>() / output.len() as f64;
                above = above.max(10.0 * (2.0 * power).log10());
            }
        }
        eprintln!("what the output cannot hold: {above:.1} dB");
        assert!(above < -70.0, "{above} dB");
    }

    #[test]
    fn every_vector_unit_gives_the_same_bits_and_loops_repeat() {
        struct Read<'a>(Samples<'a>, &'a [f64], &'a [f64]);
        impl pulp::WithSimd for Read<'_> {
            type Output = Vec<f32>;
            fn with_simd<S: Simd>(self, simd: S) -> Vec<f32> {
                let mut out = vec![0.0; self.1.len()];
                self.0.read_short(simd, self.1, self.2, &mut out, &mut Vec::new());
                out
            }
        }
        let input = tone(0.0317, 300);
        let repeated: Vec<f32> = input.iter().copied().cycle().take(300 * 20).collect();
        let samples = Samples { samples: &input, looped: true };
        let flat = Samples { samples: &repeated, looped: false };
        let positions: Vec<f64> = (0..700).map(|n| 700.25 + f64::from(n) * 3.5).collect();
        let ratios: Vec<f64> = (0..700).map(|n| 0.7 + f64::from(n) * 0.005).collect();
        let widest = pulp::Arch::new().dispatch(Read(samples, &positions, &ratios));
        let read = |samples, positions: &[f64], ratios: &[f64]| {
            pulp::WithSimd::with_simd(Read(samples, positions, ratios), pulp::Scalar)
        };
        assert_eq!(widest, read(samples, &positions, &ratios));
        assert_eq!(widest, read(flat, &positions, &ratios));
        let back: Vec<f64> = positions.iter().map(|position| position - 3000.0).collect();
        assert_eq!(widest, read(samples, &back, &ratios));
        // One by one, as in one go.
        for n in (0..700).step_by(7) {
            assert_eq!(read(samples, &positions[n..=n], &ratios[n..=n]), widest[n..=n]);
        }
        let silent = read(flat, &[-1e6, 1e9, f64::INFINITY, f64::NAN, -1e300], &[1.0; 5]);
        assert_eq!(silent[..2], [0.0; 2]);
        assert_eq!(read(Samples { samples: &[], looped: true }, &[3.0], &[1.0]), [0.0]);
    }
}
