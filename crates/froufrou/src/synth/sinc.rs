//! Band-limited reading of a sampled sound at any position and speed.
//!
//! Takala & Hahn (1992, §6.2) note that the aliasing of texture mapping comes back when sounds are
//! resampled. As a texture is read through a filter as wide as a pixel's footprint, a sound is read
//! here through a windowed sinc whose cut-off follows the local compression: reading at `ratio`
//! input samples an output sample, it lies below the Nyquist frequency of whichever of the two
//! rates is lower.
//!
//! | quantity | value |
//! | --- | --- |
//! | pass band | flat within 0.05 dB up to 5/6 of the lower Nyquist frequency (20 kHz at 48 kHz) |
//! | stop band | from the lower Nyquist frequency on, below −100 dB; so are images and aliases |
//! | latency | none: the kernel is symmetric and reads [`half_width`] input samples to either side |
//! | cost a sample | two dot products of 96 taps up to ratio 1; four of 96 × ratio above |
//!
//! The kernel is tabulated at [`PHASES`] positions between two samples for cut-offs about a
//! hundredth apart, each table made when it is first needed. A reading blends the two nearest phases
//! and, above ratio 1, the two nearest cut-offs, so it is continuous in both position and ratio.

use std::sync::OnceLock;

/// Positions between two input samples at which the kernel of ratio 1 is tabulated. Blending
/// neighbours errs by (ω / PHASES)² / 8, −109 dB for 20 kHz at 48 kHz.
pub const PHASES: usize = 512;

/// Half the kernel's length in input samples at ratio 1. See [`KAISER_BETA`].
const HALF_WIDTH: usize = 48;

/// Shape of the Kaiser window. By β = 0.1102 (A − 8.7) (Kaiser 1974) it attenuates by A = 106 dB;
/// 2 · 48 taps then make a transition 0.071 of the sampling rate wide.
const KAISER_BETA: f64 = 10.7;

/// Tables an octave of compression, spaced evenly in ratio.
const TABLES_PER_OCTAVE: usize = 96;

/// Where the pass band must end at the earliest, as a part of the lower Nyquist frequency.
#[cfg(test)]
const PASS_EDGE: f64 = 20.0 / 24.0;

/// The largest ratio whose cut-off is followed; beyond it, the cut-off stays.
pub const MAX_RATIO: f64 = 64.0;

const TABLE_COUNT: usize = TABLES_PER_OCTAVE * 6 + 3;

/// Lanes of the dot products; sums are made in this fixed order on every machine, so that a sound
/// is the same to the bit whatever the width of its vector unit.
const LANES: usize = 16;

/// One cut-off: a row of taps for each phase from 0 to 1 inclusive.
struct Table {
    half_width: usize,
    phases: usize,
    taps: Vec<f32>,
}

impl Table {
    /// The table for a stop band that begins at `scale` of the input's Nyquist frequency.
    fn new(scale: f64) -> Self {
        let lanes = LANES as f64;
        let half_width = ((HALF_WIDTH as f64 / scale) / (lanes / 2.0)).ceil() as usize * (LANES / 2);
        let phases = ((PHASES as f64 * scale).ceil() as usize).max(8);
        // The window's transition lies evenly about the cut-off; its upper end is the stop edge.
        let half_transition = transition(half_width) / 2.0;
        let cutoff = 0.5 * scale - half_transition;
        let mut taps = Vec::with_capacity((phases + 1) * 2 * half_width);
        let mut row = vec![0.0f64; 2 * half_width];
        for phase in 0..=phases {
            let fraction = phase as f64 / phases as f64;
            for (k, tap) in row.iter_mut().enumerate() {
                let x = k as f64 + 1.0 - half_width as f64 - fraction;
                *tap = 2.0 * cutoff * sinc(2.0 * cutoff * x) * kaiser(x / half_width as f64);
            }
            // Every phase passes a constant unchanged.
            let sum: f64 = row.iter().sum();
            taps.extend(row.iter().map(|tap| (tap / sum) as f32));
        }
        Self { half_width, phases, taps }
    }

    /// The rows on either side of a fraction and the weight of the second.
    #[inline(always)]
    fn rows(&self, fraction: f64) -> (&[f32], &[f32], f32) {
        let at = fraction * self.phases as f64;
        let phase = (at as usize).min(self.phases - 1);
        let width = 2 * self.half_width;
        let (first, rest) = self.taps[phase * width..].split_at(width);
        (first, &rest[..width], (at - phase as f64) as f32)
    }
}

/// Width of the transition band, in cycles a sample, of a Kaiser window of this half width
/// (Kaiser 1974: N = (A − 7.95) / (14.36 Δf)).
fn transition(half_width: usize) -> f64 {
    let attenuation_db = KAISER_BETA / 0.1102 + 8.7;
    (attenuation_db - 7.95) / (14.36 * (2 * half_width) as f64)
}

fn sinc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { (std::f64::consts::PI * x).sin() / (std::f64::consts::PI * x) }
}

fn kaiser(x: f64) -> f64 {
    let inside = 1.0 - x * x;
    if inside <= 0.0 { 0.0 } else { bessel_i0(KAISER_BETA * inside.sqrt()) / bessel_i0(KAISER_BETA) }
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

fn table(index: usize) -> &'static Table {
    static TABLES: [OnceLock<Table>; TABLE_COUNT] = [const { OnceLock::new() }; TABLE_COUNT];
    let index = index.min(TABLE_COUNT - 1);
    TABLES[index].get_or_init(|| Table::new(table_scale(index)))
}

/// The stop edge of a table as a part of the input's Nyquist frequency.
fn table_scale(index: usize) -> f64 {
    let (octave, step) = (index / TABLES_PER_OCTAVE, index % TABLES_PER_OCTAVE);
    1.0 / ((1u64 << octave) as f64 * (1.0 + step as f64 / TABLES_PER_OCTAVE as f64))
}

/// The number of input samples that a reading at `ratio` needs to either side of its position.
pub fn half_width(ratio: f64) -> usize {
    let (index, _) = table_index(ratio);
    // The narrower of the two cut-offs blended has the longer kernel.
    (HALF_WIDTH as f64 / table_scale(index + 1)).ceil() as usize + LANES
}

/// Makes the tables that readings up to a ratio need, so that no later reading allocates.
pub fn prepare(ratio: f64) {
    let (last, _) = table_index(ratio);
    for index in 0..=last + 1 {
        table(index);
    }
}

/// The table of the wider of the two cut-offs to blend, and the weight of the narrower one. Both
/// have their stop band below the output's Nyquist frequency; index 0 alone serves ratios up to 1.
#[inline(always)]
fn table_index(ratio: f64) -> (usize, f32) {
    if ratio <= 1.0 {
        return (0, 0.0);
    }
    let mut mantissa = ratio.min(MAX_RATIO);
    let mut octave = 0;
    while mantissa >= 2.0 {
        mantissa *= 0.5;
        octave += 1;
    }
    let at = (mantissa - 1.0) * TABLES_PER_OCTAVE as f64;
    let step = at as usize;
    // Just above table `step` its own stop edge lies too high, that of the next never.
    (octave * TABLES_PER_OCTAVE + step + 1, (at - step as f64) as f32)
}

/// A sound as it can be read: its samples, and what lies beyond them.
#[derive(Debug, Clone, Copy)]
pub struct Samples<'a> {
    /// One period of a loop, or all of a sound.
    pub samples: &'a [f32],
    /// True where the samples repeat for ever; else silence lies before and after.
    pub looped: bool,
}

impl Samples<'_> {
    /// The sample at an index, which may lie beyond either end.
    #[inline]
    pub fn at(&self, index: i64) -> f32 {
        let length = self.samples.len() as i64;
        if (0..length).contains(&index) {
            self.samples[index as usize]
        } else if self.looped && length > 0 {
            self.samples[index.rem_euclid(length) as usize]
        } else {
            0.0
        }
    }

    /// Reads at a position in input samples, while moving on by `ratio` input samples an output
    /// sample. `window` is scratch memory, used near the ends; it grows to twice [`half_width`].
    #[inline(always)]
    pub fn read(&self, position: f64, ratio: f64, window: &mut Vec<f32>) -> f32 {
        let floor = position.floor();
        let fraction = position - floor;
        let index = floor as i64;
        let (first, blend) = table_index(ratio);
        let near = self.convolve(table(first), index, fraction, window);
        if first == 0 {
            return near;
        }
        let far = self.convolve(table(first + 1), index, fraction, window);
        near + blend * (far - near)
    }

    #[inline(always)]
    fn convolve(&self, table: &Table, index: i64, fraction: f64, window: &mut Vec<f32>) -> f32 {
        let width = 2 * table.half_width;
        let begin = index + 1 - table.half_width as i64;
        let end = begin + width as i64;
        let input = if begin >= 0 && end <= self.samples.len() as i64 {
            &self.samples[begin as usize..end as usize]
        } else {
            if !self.looped && (end <= 0 || begin >= self.samples.len() as i64) {
                return 0.0;
            }
            window.clear();
            window.extend((begin..end).map(|i| self.at(i)));
            &window[..]
        };
        let (row, next, weight) = table.rows(fraction);
        let (a, b) = dot_pair(input, row, next);
        a + weight * (b - a)
    }
}

/// The dot products of one input with two rows, all of one length, a multiple of [`LANES`].
#[inline(always)]
fn dot_pair(input: &[f32], first: &[f32], second: &[f32]) -> (f32, f32) {
    let (mut a, mut b) = ([0.0f32; LANES], [0.0f32; LANES]);
    let chunks = input.chunks_exact(LANES).zip(first.chunks_exact(LANES)).zip(second.chunks_exact(LANES));
    for ((x, p), q) in chunks {
        for lane in 0..LANES {
            a[lane] += x[lane] * p[lane];
            b[lane] += x[lane] * q[lane];
        }
    }
    (sum(a), sum(b))
}

/// Adds the lanes pairwise.
#[inline(always)]
fn sum(mut lanes: [f32; LANES]) -> f32 {
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
    use std::f64::consts::PI;

    fn tone(frequency: f64, length: usize) -> Vec<f32> {
        (0..length).map(|n| (2.0 * PI * frequency * n as f64).sin() as f32).collect()
    }

    /// Level in decibels of a tone in a signal, and of all that is left without it, both relative to
    /// a full-scale sine; by least squares on sine and cosine.
    fn fit(signal: &[f64], frequency: f64) -> (f64, f64) {
        let (mut ss, mut sc, mut cc, mut sy, mut cy) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (n, y) in signal.iter().enumerate() {
            let (s, c) = (2.0 * PI * frequency * n as f64).sin_cos();
            ss += s * s;
            sc += s * c;
            cc += c * c;
            sy += s * y;
            cy += c * y;
        }
        let det = ss * cc - sc * sc;
        let (a, b) = ((cc * sy - sc * cy) / det, (ss * cy - sc * sy) / det);
        let rest: f64 = signal
            .iter()
            .enumerate()
            .map(|(n, y)| {
                let (s, c) = (2.0 * PI * frequency * n as f64).sin_cos();
                (y - a * s - b * c).powi(2)
            })
            .sum();
        (20.0 * a.hypot(b).log10(), 10.0 * (2.0 * rest / signal.len() as f64).max(1e-30).log10())
    }

    fn resample(input: &[f32], ratio: f64, count: usize) -> Vec<f64> {
        let samples = Samples { samples: input, looped: false };
        let mut window = Vec::new();
        (0..count).map(|n| f64::from(samples.read(400.37 + n as f64 * ratio, ratio, &mut window))).collect()
    }

    const RATIOS: [f64; 13] =
        [0.5, 0.61, 0.75, 0.918_75, 0.97, 0.999, 1.0, 1.003, 1.08, 1.25, 1.4142, 1.77, 2.0];

    #[test]
    fn pass_band_is_flat_and_images_are_below_minus_100_db() {
        let input_length = 6000;
        for ratio in RATIOS {
            let edge = 0.5 * PASS_EDGE / ratio.max(1.0);
            for part in [0.003, 0.1, 0.25, 0.5, 0.75, 0.9, 0.97, 1.0] {
                let frequency = edge * part;
                let output = resample(&tone(frequency, input_length), ratio, (5000.0 / ratio) as usize);
                let (level, rest) = fit(&output, frequency * ratio);
                assert!(level.abs() < 0.05, "ratio {ratio}, {part} of the edge: level {level} dB");
                assert!(rest < -100.0, "ratio {ratio}, {part} of the edge: rest {rest} dB");
            }
        }
    }

    #[test]
    fn what_the_output_cannot_hold_is_below_minus_100_db() {
        for ratio in RATIOS.into_iter().filter(|&r| r > 1.0) {
            for part in [1.0005, 1.02, 1.1, 1.3, 1.6, 2.0] {
                let frequency = 0.5 * part / ratio;
                if frequency >= 0.5 {
                    continue;
                }
                let output = resample(&tone(frequency, 6000), ratio, (5000.0 / ratio) as usize);
                let power = output.iter().map(|y| y * y).sum::<f64>() / output.len() as f64;
                let level = 10.0 * (2.0 * power).log10();
                assert!(level < -100.0, "ratio {ratio}, {part} of Nyquist: {level} dB");
            }
        }
    }

    #[test]
    fn images_of_the_topmost_band_are_below_minus_100_db() {
        // Tones between the pass edge and Nyquist may be weakened, but must not come back mirrored.
        for ratio in [0.5, 0.61, 0.75, 0.999, 1.0] {
            for part in [0.87, 0.93, 0.99] {
                let frequency = 0.5 * part;
                let output = resample(&tone(frequency, 6000), ratio, (5000.0 / ratio) as usize);
                let (_, rest) = fit(&output, frequency * ratio);
                assert!(rest < -100.0, "ratio {ratio}, {part} of Nyquist: {rest} dB");
            }
        }
    }

    #[test]
    fn reading_is_the_windowed_sinc_sum() {
        // The reference evaluates the kernel itself, without tables, blending or lanes.
        let input = tone(0.137, 600);
        let samples = Samples { samples: &input, looped: false };
        let half = table(0).half_width as f64;
        let cutoff = 0.5 - transition(table(0).half_width) / 2.0;
        for position in [300.0, 300.25, 300.501, 255.999] {
            let kernel = |x: f64| {
                if x.abs() < half { 2.0 * cutoff * sinc(2.0 * cutoff * x) * kaiser(x / half) } else { 0.0 }
            };
            let (mut value, mut weight) = (0.0, 0.0);
            for (k, &x) in input.iter().enumerate() {
                let tap = kernel(k as f64 - position);
                value += tap * f64::from(x);
                weight += tap;
            }
            let read = f64::from(samples.read(position, 1.0, &mut Vec::new()));
            assert!((read - value / weight).abs() < 3e-6, "{position}: {read} {}", value / weight);
        }
    }

    #[test]
    fn reading_is_continuous_in_ratio_and_position() {
        let input = tone(0.21, 2000);
        let samples = Samples { samples: &input, looped: false };
        let mut window = Vec::new();
        let mut last = samples.read(700.3, 0.9, &mut window);
        for step in 1..12_000 {
            let read = samples.read(700.3, 0.9 + step as f64 * 1e-4, &mut window);
            assert!((read - last).abs() < 2e-3, "ratio {}: {last} {read}", 0.9 + step as f64 * 1e-4);
            last = read;
        }
        let mut last = samples.read(700.0, 1.3, &mut window);
        for step in 1..20_000 {
            let read = samples.read(700.0 + step as f64 * 1e-4, 1.3, &mut window);
            assert!((read - last).abs() < 2e-4, "position {}", 700.0 + step as f64 * 1e-4);
            last = read;
        }
    }

    #[test]
    fn a_loop_reads_as_its_samples_repeated() {
        let period = tone(0.25, 37);
        let repeated: Vec<f32> = period.iter().copied().cycle().take(37 * 60).collect();
        let looped = Samples { samples: &period, looped: true };
        let flat = Samples { samples: &repeated, looped: false };
        let mut window = Vec::new();
        for step in 0..500 {
            let position = 37.0 * 25.0 + step as f64 * 0.731;
            let expected = flat.read(position, 1.2, &mut window);
            assert_eq!(looped.read(position, 1.2, &mut window), expected);
            assert_eq!(
                looped.read(position - 37.0 * 25.0, 1.2, &mut window),
                looped.read(position - 37.0 * 25.0, 1.2, &mut window)
            );
        }
    }

    #[test]
    fn beyond_the_ends_is_silence() {
        let samples = Samples { samples: &[1.0; 100], looped: false };
        let mut window = Vec::new();
        assert_eq!(samples.read(-1e6, 1.0, &mut window), 0.0);
        assert_eq!(samples.read(1e6, 1.0, &mut window), 0.0);
        assert_eq!(Samples { samples: &[], looped: true }.read(3.0, 1.0, &mut window), 0.0);
        assert!((samples.read(50.0, 1.0, &mut window) - 1.0).abs() < 0.05);
    }
}
