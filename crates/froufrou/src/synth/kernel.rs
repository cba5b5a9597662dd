//! What the kernels that read sounds are made of: windowed sincs, tables of them by ratio, and sums whose order no machine
//! changes.

use pulp::{Simd, bytemuck};

/// How many octaves of compression have tables.
const OCTAVES: usize = 6;

/// The largest ratio whose cut-off is followed; beyond it, the cut-off stays.
pub const MAX_RATIO: f64 = (1u64 << OCTAVES) as f64;

/// Lanes of the dot products; sums are made in this fixed order on every machine, so that a sound is the same to the bit
/// whatever the width of its vector unit.
pub(super) const LANES: usize = 16;

/// A whole number as an integer, where it fits: unlike a cast, vector units do several at a time.
#[inline(always)]
pub(super) fn integer(whole: f64) -> i32 {
    // Added to this, its bits are the last ones.
    (whole + 6_755_399_441_055_744.0).to_bits() as i32
}

/// The least and the greatest of some ratios.
#[inline(always)]
pub(super) fn extent(ratios: &[f64]) -> [f64; 2] {
    const SIDE_BY_SIDE: usize = 8;
    let (mut least, mut greatest) = ([f64::INFINITY; SIDE_BY_SIDE], [f64::NEG_INFINITY; SIDE_BY_SIDE]);
    let (whole, rest) = ratios.as_chunks::<SIDE_BY_SIDE>();
    for ratios in whole {
        for ((least, greatest), ratio) in least.iter_mut().zip(&mut greatest).zip(ratios) {
            *least = if ratio < least { *ratio } else { *least };
            *greatest = if ratio > greatest { *ratio } else { *greatest };
        }
    }
    let all = |first: [f64; SIDE_BY_SIDE]| first.into_iter().chain(rest.iter().copied());
    [all(least).fold(f64::INFINITY, f64::min), all(greatest).fold(f64::NEG_INFINITY, f64::max)]
}

/// sin(π x) / (π x).
pub(crate) fn sinc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { (std::f64::consts::PI * x).sin() / (std::f64::consts::PI * x) }
}

/// Kaiser's window of a shape β, from −1 to 1.
pub(crate) fn kaiser(x: f64, beta: f64) -> f64 {
    let inside = 1.0 - x * x;
    if inside <= 0.0 { 0.0 } else { bessel_i0(beta * inside.sqrt()) / bessel_i0(beta) }
}

/// The modified Bessel function of order 0 by its power series, which converges for every argument
/// that a window has.
fn bessel_i0(x: f64) -> f64 {
    let quarter = x * x / 4.0;
    let (mut term, mut sum, mut k) = (1.0, 1.0, 1.0);
    while term > sum * 1e-17 {
        term *= quarter / (k * k);
        sum += term;
        k += 1.0;
    }
    sum
}

/// Width of the transition band, in cycles a sample, of a Kaiser window of a half width and attenuation
/// (Kaiser 1974: N = (A − 7.95) / (14.36 Δf)).
pub(super) fn transition(half_width: usize, attenuation_db: f64) -> f64 {
    (attenuation_db - 7.95) / (14.36 * (2 * half_width) as f64)
}

/// The taps that read a fraction of a sample behind the middle of 2 `half_width` samples, with a cut-off in cycles a sample.
/// They pass a constant unchanged.
pub(super) fn row(half_width: usize, fraction: f64, cutoff: f64, beta: f64) -> Vec<f64> {
    let half = half_width as f64;
    let tap = |k: usize| {
        let x = k as f64 + 1.0 - half - fraction;
        2.0 * cutoff * sinc(2.0 * cutoff * x) * kaiser(x / half, beta)
    };
    let mut row: Vec<f64> = (0..2 * half_width).map(tap).collect();
    let sum: f64 = row.iter().sum();
    row.iter_mut().for_each(|tap| *tap /= sum);
    row
}

/// A table's taps. They begin where a line of the processor's cache does, so that no vector of a row whose length is a
/// multiple of [`LANES`] lies in two.
pub(super) struct Taps {
    all: Vec<f32>,
    first: usize,
}

impl Taps {
    pub fn new(taps: &[f32]) -> Self {
        let mut all = vec![0.0; taps.len() + LANES];
        let first = all.as_ptr().align_offset(LANES * size_of::<f32>()).min(LANES);
        all[first..first + taps.len()].copy_from_slice(taps);
        Self { all, first }
    }

    /// So many of them, from one on.
    #[inline(always)]
    pub fn of(&self, begin: usize, count: usize) -> &[f32] {
        &self.all[self.first + begin..][..count]
    }
}

/// Tables of kernels by the ratio that they are for: so many in the first octave of compression, spaced evenly in ratio, and
/// in each octave half as many as in the one before, whose tables are half as long. So each octave takes the same
/// memory.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spacing {
    per_octave: usize,
}

impl Spacing {
    pub const fn new(per_octave: usize) -> Self {
        Self { per_octave }
    }

    /// Index of the first table of an octave.
    const fn first(self, octave: usize) -> usize {
        2 * self.per_octave - ((2 * self.per_octave) >> octave)
    }

    /// How many tables there are.
    pub const fn count(self) -> usize {
        self.first(OCTAVES) + 1
    }

    /// The table for a ratio: the widest whose stop edge lies below the output's Nyquist frequency.
    #[inline(always)]
    pub fn index(self, ratio: f64) -> usize {
        if ratio <= 1.0 {
            return 0;
        }
        let mut mantissa = ratio.min(MAX_RATIO);
        let mut octave = 0;
        while mantissa > 2.0 {
            mantissa *= 0.5;
            octave += 1;
        }
        self.first(octave) + ((mantissa - 1.0) * (self.per_octave >> octave) as f64).ceil() as usize
    }

    /// The ratio that a table is for: its stop edge is that part of the input's Nyquist frequency which is 1 / ratio.
    pub fn ratio(self, index: usize) -> f64 {
        let octave = (0..=OCTAVES).rfind(|&octave| self.first(octave) <= index).unwrap_or(0);
        let step = (index - self.first(octave)) as f64 / (self.per_octave >> octave) as f64;
        (1u64 << octave) as f64 * (1.0 + step)
    }
}

/// The sum of all lanes, pairwise, in an order that does not depend on the vectors that hold them.
#[inline(always)]
pub(super) fn total<S: Simd>(vectors: &[S::f32s]) -> f32 {
    let mut lanes = [0.0f32; LANES];
    lanes.copy_from_slice(bytemuck::cast_slice(vectors));
    let mut width = LANES / 2;
    while width > 0 {
        for lane in 0..width {
            lanes[lane] += lanes[lane + width];
        }
        width /= 2;
    }
    lanes[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_lie_by_their_ratios() {
        for per_octave in [256, 512] {
            let spacing = Spacing::new(per_octave);
            assert_eq!(spacing.ratio(spacing.count() - 1), MAX_RATIO);
            for index in 0..spacing.count() {
                let ratio = spacing.ratio(index);
                assert_eq!(spacing.index(ratio), index, "{ratio}");
                assert_eq!(spacing.index(ratio * (1.0 - 1e-9)), index, "what is slower has the same table");
            }
            assert_eq!((spacing.index(0.3), spacing.index(1e9)), (0, spacing.count() - 1));
        }
    }

    #[test]
    fn whole_numbers_become_integers() {
        for whole in [0, 1, -1, 63, -2_000_000_000, 2_000_000_000] {
            assert_eq!(integer(f64::from(whole)), whole);
        }
        for count in 0..20 {
            let ratios: Vec<f64> = (0..count).map(|n| 1.0 + 0.1 * f64::from((n * 7) % 20)).collect();
            let expected = [f64::INFINITY, f64::NEG_INFINITY];
            let expected = ratios.iter().fold(expected, |[a, b], ratio| [a.min(*ratio), b.max(*ratio)]);
            assert_eq!(extent(&ratios), expected);
        }
    }

    #[test]
    fn taps_begin_with_a_line() {
        for count in [0, 16, 48, 4096] {
            let given: Vec<f32> = (0..count as u16).map(f32::from).collect();
            let taps = Taps::new(&given);
            assert_eq!(taps.of(0, count), given);
            assert_eq!(taps.of(0, count).as_ptr().align_offset(64), 0);
            assert_eq!(taps.of(count / 2, count / 2), &given[count / 2..]);
        }
    }

    #[test]
    fn rows_pass_constants_and_windows_end_in_nothing() {
        for fraction in [0.0, 0.25, 0.99] {
            assert!((row(16, fraction, 0.43, 7.0).iter().sum::<f64>() - 1.0).abs() < 1e-14);
        }
        assert_eq!((kaiser(0.0, 8.0), kaiser(1.0, 8.0), kaiser(-2.0, 8.0)), (1.0, 0.0, 0.0));
        assert_eq!((sinc(0.0), sinc(2.0).abs() < 1e-15), (1.0, true));
    }
}
