//! What the kernels that read sounds are made of: windowed sincs, tables of them by ratio, and sums whose order no machine
//! changes.

use pulp::{Simd, bytemuck};

use super::sinc::Samples;

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
    // One after the other: together they become no vectors.
    [best(ratios, f64::INFINITY, |a, b| a < b), best(ratios, f64::NEG_INFINITY, |a, b| a > b)]
}

/// The one that is better than all others, or the worst.
#[inline(always)]
fn best(ratios: &[f64], worst: f64, is_better: impl Fn(f64, f64) -> bool) -> f64 {
    const SIDE_BY_SIDE: usize = 8;
    let better = |a: f64, b: f64| if is_better(a, b) { a } else { b };
    let mut best = [worst; SIDE_BY_SIDE];
    let (whole, rest) = ratios.as_chunks::<SIDE_BY_SIDE>();
    for ratios in whole {
        best.iter_mut().zip(ratios).for_each(|(best, ratio)| *best = better(*ratio, *best));
    }
    best.iter().chain(rest).fold(worst, |best, ratio| better(*ratio, best))
}

/// Readings whose places are found before any of them is made.
pub(super) const CHUNK: usize = 64;

/// So many samples are copied at most, where those that are read together reach beyond an end.
pub const MOST_COPIED: usize = 160 * MAX_RATIO as usize;

/// Places within a chunk are no farther apart, in samples.
const FARTHEST: f64 = 1e9;

/// Where some readings lie, found for all of them at once, for the processor does several at a time.
struct Places {
    /// The sample before the first of them.
    origin: f64,
    /// The sample before each of them, from there on.
    wholes: [i32; CHUNK],
    /// The row of taps before each.
    phases: [i32; CHUNK],
    /// How far it lies behind that, as a part of the way to the next.
    along: [f32; CHUNK],
}

impl Places {
    /// Those of [`CHUNK`] positions at most, where so many rows lie between two samples.
    #[inline(always)]
    fn find(positions: &[f64], rows: usize) -> Self {
        let origin = positions.first().map_or(0.0, |position| position.floor());
        let (mut wholes, mut phases, mut along) = ([0i32; CHUNK], [0i32; CHUNK], [0.0f32; CHUNK]);
        let all = wholes.iter_mut().zip(&mut phases).zip(&mut along);
        for (position, ((to, phase), along)) in positions.iter().zip(all) {
            let whole = position.floor();
            *to = integer((whole - origin).clamp(-FARTHEST, FARTHEST));
            let at = (position - whole) * rows as f64;
            *phase = integer(at.floor()).clamp(0, rows as i32 - 1);
            *along = (at - f64::from(*phase)) as f32;
        }
        Self { origin, wholes, phases, along }
    }
}

/// A kernel for one ratio: for each place between two samples `ROWS` rows of taps, which are weighed for what lies between
/// this place and the next. At ratio 1 a row has `WIDTH` taps.
pub(super) trait Table<const ROWS: usize, const WIDTH: usize>: Sized + 'static {
    /// The ratios of all tables.
    const SPACING: Spacing;
    /// Places between two samples.
    const PHASES: usize;

    /// The table with an index.
    fn get(index: usize) -> &'static Self;

    /// How many taps a row has: a multiple of [`LANES`].
    fn width(&self) -> usize;

    /// The rows of a place, end to end.
    fn rows(&self, phase: usize) -> &[f32];

    /// Their weights some part of the way to the next place.
    fn weights(along: f32) -> [f32; ROWS];
}

/// Reads samples at many positions: see [`Samples::read`].
#[inline(always)]
pub(super) fn read<T: Table<ROWS, WIDTH>, S: Simd, const ROWS: usize, const WIDTH: usize>(
    simd: S,
    samples: &Samples<'_>,
    [positions, ratios]: [&[f64]; 2],
    out: &mut [f32],
    window: &mut Vec<f32>,
) {
    let chunks = positions.chunks(CHUNK).zip(ratios.chunks(CHUNK)).zip(out.chunks_mut(CHUNK));
    for ((positions, ratios), out) in chunks {
        let Places { origin, wholes, phases, along } = Places::find(positions, T::PHASES);
        let mut weights = [[0.0f32; CHUNK]; ROWS];
        for (n, along) in along.iter().enumerate() {
            weights.iter_mut().zip(T::weights(*along)).for_each(|(all, weight)| all[n] = weight);
        }
        let weights = |n: usize| std::array::from_fn(|row| weights[row][n]);
        let origin = samples.within(origin as i64);
        // Most often one table does for all.
        let [slowest, fastest] = extent(ratios);
        let mut current = T::SPACING.index(slowest);
        let mut table = T::get(current);
        let wholes = &wholes[..positions.len()];
        let rises = wholes
            .iter()
            .zip(&wholes[1..])
            .fold(wholes.first() == Some(&0), |rises, (a, b)| rises & (a <= b));
        // From the first tap of the first to the last one of the last, where that is behind it.
        let span = wholes.last().map_or(0, |last| last.unsigned_abs() as usize) + table.width();
        let one_for_all = current == T::SPACING.index(fastest) && rises;
        if one_for_all && let Some(input) = samples.about(origin, table.width(), span, window) {
            let readings = out.iter_mut().zip(wholes).zip(&phases).enumerate();
            if table.width() == WIDTH {
                for (n, ((out, whole), phase)) in readings {
                    let rows = &table.rows(*phase as usize)[..ROWS * WIDTH];
                    *out = dot_rows::<S, ROWS>(simd, &input[*whole as usize..][..WIDTH], rows, weights(n));
                }
            } else {
                for (n, ((out, whole), phase)) in readings {
                    let input = &input[*whole as usize..][..table.width()];
                    *out = dot_rows::<S, ROWS>(simd, input, table.rows(*phase as usize), weights(n));
                }
            }
            continue;
        }
        for (n, ((out, whole), ratio)) in out.iter_mut().zip(wholes).zip(ratios).enumerate() {
            let index = T::SPACING.index(*ratio);
            if index != current {
                (current, table) = (index, T::get(index));
            }
            let rows = table.rows(phases[n] as usize);
            // A closure would be compiled apart, for no vector unit.
            let (at, width) = (origin.saturating_add((*whole).into()), table.width());
            *out = match samples.about(at, width, width, window) {
                Some(input) => dot_rows::<S, ROWS>(simd, input, rows, weights(n)),
                None => 0.0,
            };
        }
    }
}

/// The weighted sum of the dot products of an input with rows of its length, a multiple of [`LANES`].
#[inline(always)]
fn dot_rows<S: Simd, const ROWS: usize>(simd: S, input: &[f32], rows: &[f32], weights: [f32; ROWS]) -> f32 {
    // As many vectors as make up the lanes; what a wide unit leaves unused costs nothing.
    let vectors = const { LANES / S::F32_LANES };
    let mut sums = [[simd.splat_f32s(0.0); LANES]; ROWS];
    let (x, _) = S::as_simd_f32s(input);
    let taps: [&[S::f32s]; ROWS] = std::array::from_fn(|row| {
        &S::as_simd_f32s(&rows[row * input.len()..(row + 1) * input.len()]).0[..x.len()]
    });
    for (n, x) in x.chunks_exact(vectors).enumerate() {
        for (sums, taps) in sums.iter_mut().zip(taps) {
            let taps = &taps[n * vectors..][..vectors];
            for ((sum, x), tap) in sums.iter_mut().zip(x).zip(taps) {
                // Not fused: a fused multiply-add rounds otherwise, and not every machine has it.
                *sum = simd.add_f32s(*sum, simd.mul_f32s(*x, *tap));
            }
        }
    }
    let mut all = [simd.splat_f32s(0.0); LANES];
    for (sum, weight) in sums.iter().zip(weights) {
        for v in 0..vectors {
            all[v] = simd.add_f32s(all[v], simd.mul_f32s(sum[v], simd.splat_f32s(weight)));
        }
    }
    total::<S>(&all[..vectors])
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

/// Kaiser's window of a shape β, for many taps: that is a power series of what its square root is taken of, and so a polynomial.
pub(super) struct Window {
    coefficients: [f64; TERMS],
}

/// Terms of the power series: what is left out is below 1e-16 of it up to β = 12.
const TERMS: usize = 32;

impl Window {
    pub fn new(beta: f64) -> Self {
        let quarter = beta * beta / 4.0;
        let mut term = 1.0 / bessel_i0(beta);
        let coefficients = std::array::from_fn(|k| {
            if k > 0 {
                term *= quarter / (k * k) as f64;
            }
            term
        });
        Self { coefficients }
    }

    /// Its value at a place from −1 to 1.
    #[inline(always)]
    fn at(&self, x: f64) -> f64 {
        let inside = 1.0 - x * x;
        let sum = self.coefficients.iter().rev().fold(0.0, |sum, term| sum * inside + term);
        if inside > 0.0 { sum } else { 0.0 }
    }
}

/// The taps that read a fraction of a sample behind the middle of 2 `half_width` samples, with a cut-off in cycles a sample.
/// They pass a constant unchanged.
pub(super) fn row(half_width: usize, fraction: f64, cutoff: f64, window: &Window) -> Vec<f64> {
    let half = half_width as f64;
    let place = |k: usize| k as f64 + 1.0 - half - fraction;
    // The sine of each tap turns on from that of the one before.
    let (turn_sin, turn_cos) = (std::f64::consts::TAU * cutoff).sin_cos();
    let (mut sin, mut cos) = (std::f64::consts::TAU * cutoff * place(0)).sin_cos();
    let mut row: Vec<f64> = Vec::with_capacity(2 * half_width);
    for k in 0..2 * half_width {
        let x = place(k);
        row.push(if x.abs() < 1e-6 { 2.0 * cutoff } else { sin / (std::f64::consts::PI * x) });
        (sin, cos) = (sin * turn_cos + cos * turn_sin, cos * turn_cos - sin * turn_sin);
    }
    row.iter_mut().enumerate().for_each(|(k, tap)| *tap *= window.at(place(k) / half));
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
        for (half_width, beta) in [(16usize, 7.0), (40, 10.4), (2560, 10.4), (16, 12.0)] {
            let cutoff = 0.43 * 16.0 / half_width as f64;
            for fraction in [0.0, 0.25, 0.99] {
                let found = row(half_width, fraction, cutoff, &Window::new(beta));
                assert!((found.iter().sum::<f64>() - 1.0).abs() < 1e-14);
                // By their definitions, tap for tap.
                let tap = |k: usize| {
                    let x = k as f64 + 1.0 - half_width as f64 - fraction;
                    2.0 * cutoff * sinc(2.0 * cutoff * x) * kaiser(x / half_width as f64, beta)
                };
                let expected: Vec<f64> = (0..2 * half_width).map(tap).collect();
                let sum: f64 = expected.iter().sum();
                for (found, expected) in found.iter().zip(expected) {
                    assert!((found - expected / sum).abs() < 1e-12, "{found}, not {}", expected / sum);
                }
            }
        }
        assert_eq!((kaiser(0.0, 8.0), kaiser(1.0, 8.0), kaiser(-2.0, 8.0)), (1.0, 0.0, 0.0));
        assert_eq!((sinc(0.0), sinc(2.0).abs() < 1e-15), (1.0, true));
    }
}
