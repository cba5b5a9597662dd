//! Reading along straight lines between samples, as most engines of games do: what [`sinc`](super::sinc) does for the least
//! that it can cost.
//!
//! | quantity | value |
//! | --- | --- |
//! | pass band | falls as sinc²(f / rate): 0.4 dB at 5 kHz and 1.5 dB at 10 kHz of a recording at 44.1 kHz |
//! | images | sinc²(k ± f / rate), the nearest and loudest: 65 dB below a tone of 1 kHz, 36 dB below one of 5 kHz, 21 dB below one of 10 kHz |
//! | aliases | none is kept away: what is read faster than it was recorded folds |
//! | cost a sample | two samples and one multiplication |

use super::kernel::{self, CHUNK};
use super::sinc::Samples;

/// Samples that a chunk reads lie in so many and the one behind, unless it is read four times as fast as recorded.
const NEAR: usize = 256;

/// So many readings are made in one go.
const GROUP: usize = 8;

impl Samples<'_> {
    /// Reads as [`Samples::read`] does, along straight lines between samples.
    #[inline(always)]
    pub(super) fn read_line(&self, positions: &[f64], out: &mut [f32]) {
        for (positions, out) in positions.chunks(CHUNK).zip(out.chunks_mut(CHUNK)) {
            let (mut wholes, mut along) = ([0i32; CHUNK], [0.0f32; CHUNK]);
            let origin = positions[0].floor();
            let mut is_near = origin.abs() < FARTHEST;
            for ((position, to), along) in positions.iter().zip(&mut wholes).zip(&mut along) {
                let whole = position.floor();
                let from = whole - origin;
                // What is no number is far.
                is_near &= (0.0..NEAR as f64).contains(&from);
                *to = kernel::integer(from);
                *along = (position - whole) as f32;
            }
            if !is_near {
                for (position, out) in positions.iter().zip(out) {
                    *out = self.on_line(*position);
                }
                continue;
            }
            let mut copied = [0.0f32; NEAR + 1];
            let near = self.near(origin as i64, &mut copied);
            let mut read = [0.0f32; CHUNK];
            let groups = read.as_chunks_mut().0.iter_mut().zip(wholes.as_chunks().0).zip(along.as_chunks().0);
            for ((read, wholes), along) in groups.take(positions.len().div_ceil(GROUP)) {
                group(near, wholes, along, read);
            }
            out.copy_from_slice(&read[..out.len()]);
        }
    }

    /// The samples from an index on: as they lie there, or copied where they reach beyond an end.
    #[inline(always)]
    fn near<'a>(&'a self, mut origin: i64, copied: &'a mut [f32; NEAR + 1]) -> &'a [f32; NEAR + 1] {
        let length = self.samples.len() as i64;
        if self.looped && length > 0 && !(0..length).contains(&origin) {
            origin = origin.rem_euclid(length);
        }
        let there = usize::try_from(origin).ok().and_then(|at| self.samples.get(at..)?.first_chunk());
        there.unwrap_or_else(|| {
            self.copy(origin, copied);
            copied
        })
    }

    #[cold]
    #[inline(never)]
    fn copy(&self, origin: i64, copied: &mut [f32; NEAR + 1]) {
        copied.iter_mut().zip(origin..).for_each(|(to, index)| *to = self.at(index));
    }

    /// What lies at one position.
    fn on_line(&self, position: f64) -> f32 {
        let whole = position.floor();
        if whole.is_nan() || whole.abs() >= FARTHEST {
            return 0.0;
        }
        let [from, to] = [0, 1].map(|next| self.at(whole as i64 + next));
        from + (to - from) * (position - whole) as f32
    }
}

/// Some readings along lines, so far behind these of the near samples.
#[inline(always)]
fn group(near: &[f32; NEAR + 1], wholes: &[i32; GROUP], along: &[f32; GROUP], out: &mut [f32; GROUP]) {
    let (mut from, mut to) = ([0.0f32; GROUP], [0.0f32; GROUP]);
    for ((from, to), whole) in from.iter_mut().zip(&mut to).zip(wholes) {
        let at = *whole as usize % NEAR;
        (*from, *to) = (near[at], near[at + 1]);
    }
    for (((out, from), to), along) in out.iter_mut().zip(from).zip(to).zip(along) {
        *out = from + (to - from) * along;
    }
}

/// No sound is as long, in samples: what lies farther away is silent.
const FARTHEST: f64 = (1u64 << 53) as f64;

#[cfg(test)]
mod tests {
    use super::super::kernel::sinc;
    use super::*;
    use std::f64::consts::{PI, TAU};

    struct Read<'a>(Samples<'a>, &'a [f64]);

    impl pulp::WithSimd for Read<'_> {
        type Output = Vec<f32>;
        fn with_simd<S: pulp::Simd>(self, _: S) -> Vec<f32> {
            let mut out = vec![f32::NAN; self.1.len()];
            self.0.read_line(self.1, &mut out);
            out
        }
    }

    fn read(samples: Samples, positions: &[f64]) -> Vec<f32> {
        let found = pulp::Arch::new().dispatch(Read(samples, positions));
        let scalar = pulp::WithSimd::with_simd(Read(samples, positions), pulp::Scalar);
        assert_eq!(found, scalar, "every vector unit gives the same bits");
        found
    }

    #[test]
    fn lines_are_straight_at_every_speed_and_both_ways() {
        let ramp: Vec<f32> = (0..5000).map(|n| n as f32).collect();
        let samples = Samples { samples: &ramp, looped: false };
        for step in [0.0, 0.3, 1.0, 1.7, 3.9, 4.1, 30.0, -0.4] {
            let positions: Vec<f64> = (0..150).map(|n| 100.25 + f64::from(n) * step).collect();
            for (position, found) in positions.iter().zip(read(samples, &positions)) {
                assert!((f64::from(found) - position).abs() < 1e-3, "{step}: {found} at {position}");
            }
            // One by one, as in one go.
            let single: Vec<f32> =
                positions.iter().flat_map(|position| read(samples, &[*position])).collect();
            assert_eq!(single, read(samples, &positions));
        }
    }

    #[test]
    fn a_tone_and_its_images_are_as_the_closed_form_has_them() {
        // Read at twenty times the rate there is room for ten images, which lie where they were.
        const TIMES: usize = 20;
        for part in [1.0 / 44.1, 5.0 / 44.1, 10.0 / 44.1] {
            let length = 4410;
            let input: Vec<f32> = (0..length).map(|n| (TAU * part * f64::from(n)).sin() as f32).collect();
            let samples = Samples { samples: &input, looped: true };
            let count = length as usize * TIMES;
            let positions: Vec<f64> = (0..count).map(|n| n as f64 / TIMES as f64).collect();
            let output = read(samples, &positions);
            let level = |frequency: f64| {
                let (mut re, mut im) = (0.0, 0.0);
                for (position, sample) in positions.iter().zip(&output) {
                    let (s, c) = (TAU * frequency * position).sin_cos();
                    (re, im) = (re + f64::from(*sample) * c, im + f64::from(*sample) * s);
                }
                2.0 * f64::hypot(re, im) / count as f64
            };
            for frequency in [part, 1.0 - part, 1.0 + part, 2.0 - part] {
                // In samples of the reading, what is a triangle is a sum: sin² over TIMES² sin².
                let fine = (PI * frequency / TIMES as f64).sin() * TIMES as f64;
                let expected = ((PI * frequency).sin() / fine).powi(2);
                let found = level(frequency);
                assert!((found - expected).abs() < 1e-5, "{frequency}: {found}, not {expected}");
                assert!((expected - sinc(frequency).powi(2)).abs() < 0.05 * expected, "about sinc²");
            }
        }
    }

    #[test]
    fn loops_repeat_and_beyond_the_ends_is_silence() {
        let period: Vec<f32> = (0..37).map(|n| (n as f32 * 0.7).sin()).collect();
        let repeated: Vec<f32> = period.iter().copied().cycle().take(37 * 60).collect();
        let looped = Samples { samples: &period, looped: true };
        let positions: Vec<f64> = (0..1500).map(|n| 40.0 + f64::from(n) * 1.371).collect();
        let expected = read(Samples { samples: &repeated, looped: false }, &positions);
        assert_eq!(read(looped, &positions), expected);
        let back: Vec<f64> = positions.iter().map(|position| position - 3700.0).collect();
        // A position further on is a little coarser.
        assert!(read(looped, &back).iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-5));

        let ones = Samples { samples: &[1.0; 3], looped: false };
        assert_eq!(read(ones, &[-1.25, -0.25, 0.0, 1.5, 2.5, 3.0]), [0.0, 0.75, 1.0, 1.0, 0.5, 0.0]);
        let strange = [-1e6, 1e9, f64::INFINITY, f64::NAN, -1e300, 1.0];
        assert_eq!(read(ones, &strange), [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        assert_eq!(read(Samples { samples: &[], looped: true }, &[3.0]), [0.0]);
    }
}
