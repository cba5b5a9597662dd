//! The signal of many modes at once.
//!
//! Each mode is a complex number z that turns and shrinks by r = e^((−d + 2πif) / rate) a sample; its
//! sound is the imaginary part. It is kept in double precision, and moved on sixteen samples at once.
//! The sixteen samples themselves are sums of products: the imaginary part of z·rᵏ is
//! Re z · Im rᵏ + Im z · Re rᵏ, where the powers of r are in a table. So the lanes of the vector unit
//! are moments of time, nothing waits for the sample before, no error grows with time, and the order of
//! every sum is the same on every machine.
//!
//! | quantity | value |
//! | --- | --- |
//! | error | below −120 dB of the sum of the damped sines, however long it rings |
//! | cost | two multiplications and additions a mode and sample, sixteen at a time |
//! | cost of a strike | an exponential, a sine and a cosine for each mode |
//! | memory | 160 bytes a mode for all threads of a sound, 24 for each thread |
//!
//! Modes at or above the Nyquist frequency are left out. A mode that has fallen 160 dB below the
//! loudest of the softest strike is at rest until it is struck again, and a group of them at rest
//! costs nothing.

use std::f64::consts::TAU;
use std::sync::Arc;

use pulp::{Simd, bytemuck};

use super::{Mode, contact_spectrum};
use crate::Result;
use crate::synth::instrument::{Generator, Stretch, Strike};
use crate::synth::voice::first_frame;

/// Samples that are made at once of a mode.
const BLOCK: usize = 16;

/// Blocks that are summed in registers.
const TILE: usize = 2;

/// Modes that are summed before the sum is added to a more precise one, and that rest together.
const GROUP: usize = 32;

/// The part of the loudest mode of a strike below which a mode is at rest: −160 dB, so that ten
/// thousand of them together stay out of hearing.
const SILENCE: f64 = 1e-8;

/// The least amplitude that is kept at all, well above where single precision becomes slow.
const LEAST: f64 = 1e-24;

/// The greatest amplitude that a strike gives to a mode.
const GREATEST: f64 = 1e30;

/// The greatest that is handed on to single precision: a group of them is still finite.
const GREATEST_STATE: f64 = 1e33;

/// How the modes of a body turn and shrink at a rate: what all its threads share.
#[derive(Debug)]
pub struct Rotations {
    rate_hz: f64,
    /// The number of each mode in the body's list; the slowest to die away come first, so that a
    /// group comes to rest as one. Filled up to whole groups with modes that never sound.
    modes: Vec<Option<u32>>,
    /// r and r¹⁶ of each mode, real and imaginary.
    one: [Vec<f64>; 2],
    block: [Vec<f64>; 2],
    /// For each mode the imaginary parts of r⁰ to r¹⁵, then the real ones.
    powers: Vec<f32>,
}

impl Rotations {
    /// Those of the modes below the Nyquist frequency.
    pub fn new(modes: &[Mode], rate_hz: f64) -> Self {
        let mut order: Vec<u32> =
            (0..modes.len() as u32).filter(|&n| modes[n as usize].frequency_hz < rate_hz / 2.0).collect();
        order.sort_by(|&a, &b| modes[a as usize].decay_per_s.total_cmp(&modes[b as usize].decay_per_s));
        let mut order: Vec<Option<u32>> = order.into_iter().map(Some).collect();
        order.resize(order.len().next_multiple_of(GROUP), None);
        let power = |mode: &Mode, samples: f64| {
            let (sin, cos) = (TAU * (mode.frequency_hz / rate_hz * samples)).sin_cos();
            let size = (-mode.decay_per_s / rate_hz * samples).exp();
            [size * cos, size * sin]
        };
        // What lies far below hearing is nothing: products with it would be slow.
        let keep = |part: f64| if part.abs() < 1e-12 { 0.0 } else { part as f32 };
        let mut rotations = Self {
            rate_hz,
            one: [vec![0.0; order.len()], vec![0.0; order.len()]],
            block: [vec![0.0; order.len()], vec![0.0; order.len()]],
            powers: vec![0.0; order.len() * 2 * BLOCK],
            modes: order,
        };
        for (slot, mode) in rotations.modes.iter().enumerate() {
            let Some(mode) = mode.map(|mode| &modes[mode as usize]) else { continue };
            for part in 0..2 {
                rotations.one[part][slot] = power(mode, 1.0)[part];
                rotations.block[part][slot] = power(mode, BLOCK as f64)[part];
            }
            for k in 0..BLOCK {
                let [re, im] = power(mode, k as f64);
                rotations.powers[slot * 2 * BLOCK + k] = keep(im);
                rotations.powers[slot * 2 * BLOCK + BLOCK + k] = keep(re);
            }
        }
        rotations
    }

    /// The rate that they are for.
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }
}

/// One ringing body.
#[derive(Debug)]
pub struct Bank {
    modes: Arc<[Mode]>,
    rotations: Arc<Rotations>,
    /// z of each mode, real and imaginary.
    state: [Vec<f64>; 2],
    /// Which groups ring.
    ringing: Vec<bool>,
    /// The amplitude below which a mode is at rest.
    floor: f64,
    /// The gains of the last strike, by place and contact: most strikes are like the one before.
    gains: Option<([u64; 2], Vec<f64>)>,
    sum: Vec<f64>,
}

impl Bank {
    /// A body at rest.
    pub fn new(modes: Arc<[Mode]>, rotations: Arc<Rotations>) -> Self {
        let count = rotations.modes.len();
        Self {
            modes,
            state: [vec![0.0; count], vec![0.0; count]],
            ringing: vec![false; count / GROUP],
            rotations,
            floor: f64::INFINITY,
            gains: None,
            sum: Vec::new(),
        }
    }

    /// Sets the modes ringing; `late_s` seconds have passed since.
    fn strike(&mut self, strike: &Strike, late_s: f64) {
        if !(strike.impulse_ns.is_finite() && strike.impulse_ns != 0.0) {
            return;
        }
        let key = [strike.place.to_bits(), strike.contact_s.to_bits()];
        if self.gains.as_ref().is_none_or(|(of, _)| *of != key) {
            let gain = |mode: &Option<u32>| {
                mode.map_or(0.0, |mode| {
                    let mode = &self.modes[mode as usize];
                    let soft = contact_spectrum(mode.frequency_hz, strike.contact_s);
                    mode.gain * mode.shape.at(strike.place) * soft
                })
            };
            self.gains = Some((key, self.rotations.modes.iter().map(gain).collect()));
        }
        let Some((_, gains)) = &self.gains else { return };
        let mut loudest = 0.0f64;
        for (slot, gain) in gains.iter().enumerate() {
            let amplitude = (strike.impulse_ns * gain).clamp(-GREATEST, GREATEST);
            let Some(mode) = self.rotations.modes[slot] else { continue };
            if amplitude == 0.0 || amplitude.is_nan() {
                continue;
            }
            loudest = loudest.max(amplitude.abs());
            let mode = &self.modes[mode as usize];
            let (sin, cos) = (TAU * mode.frequency_hz * late_s).sin_cos();
            let size = amplitude * (-mode.decay_per_s * late_s).exp();
            self.state[0][slot] += size * cos;
            self.state[1][slot] += size * sin;
            self.ringing[slot / GROUP] = true;
        }
        if loudest > 0.0 {
            self.floor = self.floor.min(loudest * SILENCE).max(LEAST);
        }
    }

    /// Adds samples of the stretch to the sum, and moves all modes on.
    fn ring(&mut self, range: std::ops::Range<usize>) {
        if range.is_empty() {
            return;
        }
        let sum = &mut self.sum[range];
        for group in (0..self.ringing.len()).filter(|&group| self.ringing[group]) {
            let slots = group * GROUP..(group + 1) * GROUP;
            let [re, im] = &mut self.state;
            pulp::Arch::new().dispatch(Group {
                state: [&mut re[slots.clone()], &mut im[slots.clone()]],
                one: [&self.rotations.one[0][slots.clone()], &self.rotations.one[1][slots.clone()]],
                block: [&self.rotations.block[0][slots.clone()], &self.rotations.block[1][slots.clone()]],
                powers: &self.rotations.powers[slots.start * 2 * BLOCK..slots.end * 2 * BLOCK],
                sum,
            });
        }
    }

    /// Puts to rest what has died away.
    fn rest(&mut self) {
        let silent = self.floor * self.floor;
        let [re, im] = &mut self.state;
        for (group, ringing) in self.ringing.iter_mut().enumerate().filter(|(_, ringing)| **ringing) {
            let slots = group * GROUP..(group + 1) * GROUP;
            *ringing = false;
            for (re, im) in re[slots.clone()].iter_mut().zip(&mut im[slots]) {
                if *re * *re + *im * *im < silent {
                    (*re, *im) = (0.0, 0.0);
                } else {
                    *ringing = true;
                }
            }
        }
        if !self.ringing.contains(&true) {
            self.floor = f64::INFINITY;
        }
    }
}

impl Generator for Bank {
    fn generate(&mut self, stretch: &Stretch<'_>, out: &mut [f32]) -> Result<()> {
        if stretch.strikes.is_empty() && !self.ringing.contains(&true) {
            out.fill(0.0);
            return Ok(());
        }
        self.sum.clear();
        self.sum.resize(out.len(), 0.0);
        let mut done = 0;
        for strike in stretch.strikes {
            let frame = first_frame(strike.time_s, stretch.rate_hz);
            let index = (frame.saturating_sub(stretch.first).min(out.len() as u64) as usize).max(done);
            self.ring(done..index);
            done = index;
            let now_s = (stretch.first + index as u64) as f64 / stretch.rate_hz;
            self.strike(strike, (now_s - strike.time_s).clamp(0.0, 1.0));
        }
        self.ring(done..out.len());
        self.rest();
        for (out, sum) in out.iter_mut().zip(&self.sum) {
            *out = sum.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32;
        }
        Ok(())
    }
}

/// The inner loop: a group of modes.
struct Group<'a> {
    state: [&'a mut [f64]; 2],
    one: [&'a [f64]; 2],
    block: [&'a [f64]; 2],
    powers: &'a [f32],
    sum: &'a mut [f64],
}

/// Complex numbers, real and imaginary.
type Turns = [[f64; GROUP]; 2];

#[inline(always)]
fn product(a: &Turns, b: &Turns) -> Turns {
    let mut product = [[0.0; GROUP]; 2];
    for n in 0..GROUP {
        product[0][n] = a[0][n] * b[0][n] - a[1][n] * b[1][n];
        product[1][n] = a[0][n] * b[1][n] + a[1][n] * b[0][n];
    }
    product
}

#[inline(always)]
fn turns(of: [&[f64]; 2]) -> Turns {
    let mut turns = [[0.0; GROUP]; 2];
    turns[0].copy_from_slice(of[0]);
    turns[1].copy_from_slice(of[1]);
    turns
}

/// As single precision can hold them.
#[inline(always)]
fn single(state: &Turns) -> [[f32; GROUP]; 2] {
    let mut single = [[0.0; GROUP]; 2];
    for n in 0..GROUP {
        single[0][n] = state[0][n].clamp(-GREATEST_STATE, GREATEST_STATE) as f32;
        single[1][n] = state[1][n].clamp(-GREATEST_STATE, GREATEST_STATE) as f32;
    }
    single
}

impl pulp::WithSimd for Group<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let [re, im] = self.state;
        let mut state = turns([&*re, &*im]);
        let block = turns(self.block);
        for tile in self.sum.chunks_mut(TILE * BLOCK) {
            let mut starts = [[[0.0f32; GROUP]; 2]; TILE];
            for (start, samples) in starts.iter_mut().zip(tile.chunks(BLOCK)) {
                *start = single(&state);
                if samples.len() == BLOCK {
                    state = product(&state, &block);
                } else {
                    state = advance(state, turns(self.one), samples.len());
                }
            }
            let mut samples = [0.0f32; TILE * BLOCK];
            sum_tile(simd, self.powers, &starts, &mut samples);
            for (sum, &sample) in tile.iter_mut().zip(&samples) {
                *sum += f64::from(sample);
            }
        }
        re.copy_from_slice(&state[0]);
        im.copy_from_slice(&state[1]);
    }
}

/// Turns by a few samples, by squaring.
#[inline(always)]
fn advance(mut state: Turns, mut power: Turns, mut samples: usize) -> Turns {
    while samples > 0 {
        if samples % 2 == 1 {
            state = product(&state, &power);
        }
        samples /= 2;
        if samples > 0 {
            power = product(&power, &power);
        }
    }
    state
}

/// The samples of a tile, whose blocks begin with these states.
#[inline(always)]
fn sum_tile<S: Simd>(
    simd: S,
    powers: &[f32],
    starts: &[[[f32; GROUP]; 2]; TILE],
    samples: &mut [f32; TILE * BLOCK],
) {
    // As many vectors as make up a block.
    let vectors = const { BLOCK / S::F32_LANES };
    // The products with the real and with the imaginary parts are summed apart: each sum waits for
    // fewer additions.
    let mut sums = [[[simd.splat_f32s(0.0); BLOCK]; 2]; TILE];
    let (powers, _) = S::as_simd_f32s(powers);
    for (n, powers) in powers.chunks_exact(2 * vectors).enumerate() {
        let (imaginary, real) = powers.split_at(vectors);
        for (sums, start) in sums.iter_mut().zip(starts) {
            let (re, im) = (simd.splat_f32s(start[0][n]), simd.splat_f32s(start[1][n]));
            for v in 0..vectors {
                // Not fused: a fused multiply-add rounds otherwise, and not every machine has it.
                sums[0][v] = simd.add_f32s(sums[0][v], simd.mul_f32s(imaginary[v], re));
                sums[1][v] = simd.add_f32s(sums[1][v], simd.mul_f32s(real[v], im));
            }
        }
    }
    for (sums, samples) in sums.iter().zip(samples.chunks_exact_mut(BLOCK)) {
        let mut total = [simd.splat_f32s(0.0); BLOCK];
        for v in 0..vectors {
            total[v] = simd.add_f32s(sums[0][v], sums[1][v]);
        }
        samples.copy_from_slice(bytemuck::cast_slice(&total[..vectors]));
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Mode, Shape};
    use super::*;

    #[test]
    fn every_vector_unit_gives_the_same_bits() {
        let mode = |n: u32| Mode {
            frequency_hz: 97.3 * f64::from(n),
            decay_per_s: 3.1 * f64::from(n),
            gain: 1.0,
            shape: Shape::Everywhere,
        };
        let modes: Vec<Mode> = (1..=GROUP as u32).map(mode).collect();
        let rotations = Rotations::new(&modes, 48_000.0);
        let render = |widest: bool| {
            let (mut re, mut im, mut sum) = (vec![1.0; GROUP], vec![-0.3; GROUP], vec![0.0; 407]);
            for sum in sum.chunks_mut(89) {
                let group = Group {
                    state: [&mut re, &mut im],
                    one: [&rotations.one[0], &rotations.one[1]],
                    block: [&rotations.block[0], &rotations.block[1]],
                    powers: &rotations.powers,
                    sum,
                };
                if widest {
                    pulp::Arch::new().dispatch(group);
                } else {
                    pulp::WithSimd::with_simd(group, pulp::Scalar);
                }
            }
            (re, im, sum)
        };
        assert_eq!(render(true), render(false));
    }
}
