//! Convolution of real samples by complex FFTs of half their number.
//!
//! Samples are the coefficients of a polynomial, and convolution is the product of two. It is taken modulo xᴺ + 1,
//! whose roots are conjugate in pairs: one of each pair is enough, and these are the roots of x^(N/2) = i. There the
//! polynomial is that of the N/2 complex numbers whose real parts are the first half of the samples and whose imaginary
//! parts the second. With a turn of each they have an ordinary FFT, and unlike the usual FFT of real samples it needs
//! nothing to be unpacked (Nussbaumer 1982, "Fast Fourier transform and convolution algorithms", right-angle circular
//! convolution). What goes beyond N samples comes back at the other end with its sign changed.

use std::sync::{Arc, OnceLock};

use rustfft::num_complex::Complex32;
use rustfft::{Fft, FftPlanner};

/// The shortest transform.
const SHORTEST: usize = 256;

/// How many sizes there are: far more than what fits into memory.
const SIZES: usize = 64;

/// The number of samples of a transform: powers of two, and those and a half.
fn samples(size: usize) -> usize {
    let half = (SHORTEST / 2) << (size / 2);
    2 * half + size % 2 * half
}

/// The sizes whose transforms have at least so many samples and no more than so many, with their samples.
pub(super) fn sizes(least: usize, most: usize) -> impl Iterator<Item = (usize, usize)> {
    let all = (0..SIZES).map(|size| (size, samples(size)));
    all.skip_while(move |&(_, samples)| samples < least).take_while(move |&(_, samples)| samples <= most)
}

/// What is needed to transform samples of one size.
pub(super) struct Transform {
    forward: Arc<dyn Fft<f32>>,
    inverse: Arc<dyn Fft<f32>>,
    turns: Box<[Complex32]>,
}

/// Memory that transforms use again and again.
#[derive(Default)]
pub(super) struct Memory {
    fft: Vec<Complex32>,
}

impl Transform {
    /// The transform of a size. It is prepared once.
    pub fn of(size: usize) -> &'static Self {
        static PREPARED: [OnceLock<Transform>; SIZES] = [const { OnceLock::new() }; SIZES];
        PREPARED[size].get_or_init(|| {
            let half = samples(size) / 2;
            let mut planner = FftPlanner::new();
            let turn = |n: usize| {
                let angle = std::f64::consts::FRAC_PI_2 * n as f64 / half as f64;
                Complex32::new(angle.cos() as f32, angle.sin() as f32)
            };
            Self {
                forward: planner.plan_fft_forward(half),
                inverse: planner.plan_fft_inverse(half),
                turns: (0..half).map(turn).collect(),
            }
        })
    }

    /// How many samples it has.
    pub fn samples(&self) -> usize {
        2 * self.turns.len()
    }

    /// Writes the spectrum of samples, which are followed by silence.
    pub fn forward(&self, input: &[f32], bins: &mut Vec<Complex32>, memory: &mut Memory) {
        let half = self.turns.len();
        let (first, second) = input.split_at(input.len().min(half));
        bins.clear();
        bins.resize(half, Complex32::new(0.0, 0.0));
        pulp::Arch::new().dispatch(|| {
            for ((bin, turn), sample) in bins.iter_mut().zip(&self.turns).zip(first) {
                *bin = Complex32::new(sample * turn.re, sample * turn.im);
            }
            for ((bin, turn), sample) in bins.iter_mut().zip(&self.turns).zip(second) {
                *bin += Complex32::new(-sample * turn.im, sample * turn.re);
            }
        });
        run(&*self.forward, bins, memory);
    }

    /// Writes the samples of a spectrum, times half their number. The spectrum is lost.
    pub fn inverse(&self, bins: &mut [Complex32], out: &mut Vec<f32>, memory: &mut Memory) {
        run(&*self.inverse, bins, memory);
        out.clear();
        out.resize(2 * bins.len(), 0.0);
        let (first, second) = out.split_at_mut(bins.len());
        pulp::Arch::new().dispatch(|| {
            for (((bin, turn), first), second) in bins.iter().zip(&self.turns).zip(first).zip(second) {
                *first = bin.re * turn.re + bin.im * turn.im;
                *second = bin.im * turn.re - bin.re * turn.im;
            }
        });
    }
}

fn run(fft: &dyn Fft<f32>, bins: &mut [Complex32], memory: &mut Memory) {
    let needed = fft.get_inplace_scratch_len();
    if memory.fft.len() < needed {
        memory.fft.resize(needed, Complex32::new(0.0, 0.0));
    }
    fft.process_with_scratch(bins, &mut memory.fft[..needed]);
}

/// Adds the product of two spectra to a third.
pub(super) fn add_product(sum: &mut [Complex32], a: &[Complex32], b: &[Complex32]) {
    pulp::Arch::new().dispatch(|| {
        for ((sum, a), b) in sum.iter_mut().zip(a).zip(b) {
            *sum = Complex32::new(sum.re + (a.re * b.re - a.im * b.im), sum.im + (a.re * b.im + a.im * b.re));
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_grow_by_halves_and_thirds() {
        assert_eq!((0..6).map(samples).collect::<Vec<_>>(), [256, 384, 512, 768, 1024, 1536]);
        assert_eq!(sizes(385, 800).collect::<Vec<_>>(), [(2, 512), (3, 768)]);
        assert_eq!(sizes(0, 256).collect::<Vec<_>>(), [(0, 256)]);
    }

    #[test]
    fn a_product_beyond_the_end_comes_back_with_its_sign_changed() {
        for size in 0..8 {
            let transform = Transform::of(size);
            let (count, mut memory) = (transform.samples(), Memory::default());
            for (a, b) in
                [(0, 0), (3, 5), (count / 2, 7), (count - 1, 0), (count - 1, 1), (count / 2 + 1, count - 2)]
            {
                let impulse =
                    |at: usize| (0..count).map(|n| if n == at { 1.0 } else { 0.0 }).collect::<Vec<f32>>();
                let (mut first, mut second) = (Vec::new(), Vec::new());
                transform.forward(&impulse(a)[..a + 1], &mut first, &mut memory);
                transform.forward(&impulse(b), &mut second, &mut memory);
                let mut product = vec![Complex32::new(0.0, 0.0); count / 2];
                add_product(&mut product, &first, &second);
                let mut out = Vec::new();
                transform.inverse(&mut product, &mut out, &mut memory);
                let sign = if a + b < count { 1.0 } else { -1.0 };
                for (n, found) in out.iter().enumerate() {
                    let expected = if n == (a + b) % count { sign } else { 0.0 };
                    assert!((found / (count / 2) as f32 - expected).abs() < 2e-6, "{count} {a} {b} {n}");
                }
            }
        }
    }
}
