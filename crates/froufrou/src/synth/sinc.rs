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
//! | cost a sample | four dot products of 80 taps up to ratio 1, of 80 × ratio above |
//!
//! The kernel is tabulated at [`PHASES`] positions between two samples, small enough for the
//! processor's nearest cache, and read between them by cubic interpolation; there is a table for
//! every five-hundredth of the first octave of compression and for half as many of each octave
//! further up, made when it is first needed. A step from one cut-off to the next moves only what
//! lies above the pass band, in the first octave by less than 1 %.

use std::sync::OnceLock;

use pulp::Simd;

use super::kernel::{self, LANES, Spacing, Table as _, Taps};
pub use super::kernel::{MAX_RATIO, MOST_COPIED};
use super::tiny;

/// Positions between two input samples at which the kernel is tabulated. Cubic interpolation errs by
/// about 3/128 (ω / PHASES)⁴, −120 dB for 20 kHz at 48 kHz.
pub const PHASES: usize = 32;

/// Half the kernel's length in input samples at ratio 1.
const HALF_WIDTH: usize = 40;

/// The kernel's whole length there.
const STILL_WIDTH: usize = 2 * HALF_WIDTH;

/// Shape of the Kaiser window. By β = 0.1102 (A − 8.7) (Kaiser 1974) it attenuates by A = 103 dB;
/// 2 · 40 taps then make a transition 0.083 of the sampling rate wide.
const KAISER_BETA: f64 = 10.4;

/// 512 tables in the first octave of compression: 9 MB at most in each.
const SPACING: Spacing = Spacing::new(512);

/// Where the pass band must end at the earliest, as a part of the lower Nyquist frequency.
#[cfg(test)]
const PASS_EDGE: f64 = 20.0 / 24.0;

/// One cut-off: a row of taps for each phase, from the one before 0 to the one behind 1.
struct Table {
    half_width: usize,
    taps: Taps,
}

impl Table {
    /// The table for a stop band that begins at `scale` of the input's Nyquist frequency.
    fn new(scale: f64) -> Self {
        let lanes = LANES as f64;
        let half_width = ((HALF_WIDTH as f64 / scale) / (lanes / 2.0)).ceil() as usize * (LANES / 2);
        // The window's transition lies evenly about the cut-off; its upper end is the stop edge.
        let half_transition = kernel::transition(half_width, KAISER_BETA / 0.1102 + 8.7) / 2.0;
        let cutoff = 0.5 * scale - half_transition;
        let fractions = (0..PHASES + 3).map(|phase| (phase as f64 - 1.0) / PHASES as f64);
        let window = kernel::Window::new(KAISER_BETA);
        let taps = fractions.flat_map(|fraction| kernel::row(half_width, fraction, cutoff, &window));
        let taps: Vec<f32> = taps.map(|tap| tiny::flushed(tap as f32)).collect();
        Self { half_width, taps: Taps::new(&taps) }
    }
}

impl kernel::Table<4, STILL_WIDTH> for Table {
    const SPACING: Spacing = SPACING;
    const PHASES: usize = PHASES;

    fn get(index: usize) -> &'static Self {
        static TABLES: [OnceLock<Table>; SPACING.count()] = [const { OnceLock::new() }; SPACING.count()];
        let index = index.min(SPACING.count() - 1);
        TABLES[index].get_or_init(|| Table::new(1.0 / SPACING.ratio(index)))
    }

    #[inline(always)]
    fn width(&self) -> usize {
        2 * self.half_width
    }

    /// The four rows about a phase, end to end.
    #[inline(always)]
    fn rows(&self, phase: usize) -> &[f32] {
        let width = 2 * self.half_width;
        self.taps.of(phase * width, 4 * width)
    }

    /// Lagrange's cubic through rows at −1, 0, 1 and 2: their weights at a place between the middle ones.
    #[inline(always)]
    fn weights(along: f32) -> [f32; 4] {
        let (before, behind, far) = (along + 1.0, 1.0 - along, 2.0 - along);
        [
            -along * behind * far * (1.0 / 6.0),
            before * behind * far * 0.5,
            before * along * far * 0.5,
            -before * along * behind * (1.0 / 6.0),
        ]
    }
}

/// The window of the filters that resample, from −1 to 1.
pub(super) fn kaiser(x: f64) -> f64 {
    kernel::kaiser(x, KAISER_BETA)
}

/// The number of input samples that a reading at `ratio` needs to either side of its position.
pub fn half_width(ratio: f64) -> usize {
    (HALF_WIDTH as f64 * SPACING.ratio(SPACING.index(ratio))).ceil() as usize + LANES
}

/// Makes the tables that readings up to a ratio need, so that no later reading allocates.
pub fn prepare(ratio: f64) {
    for index in 0..=SPACING.index(ratio) {
        <Table as kernel::Table<4, STILL_WIDTH>>::get(index);
    }
    super::short::prepare(ratio);
}

/// How well a sound is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Kernel {
    /// As this module has it: nothing is lost that could be heard.
    #[default]
    Long,
    /// Some five times as fast, for many voices at once: the topmost band fades, and images and aliases lie below
    /// −70 dB.
    Short,
    /// Along straight lines from sample to sample, as most engines of games read: the least that a voice can cost. High
    /// tones are softer, and of what is not read at the rate at which it was recorded images and aliases are heard.
    Line,
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

    /// Adds the samples from an index on, as they are but for a gain.
    #[inline(always)]
    pub(super) fn add(&self, index: i64, gain: f64, out: &mut [f64]) {
        let length = self.samples.len();
        let (mut out, mut index) = (out, index);
        while !out.is_empty() && length > 0 {
            if self.looped {
                index = index.rem_euclid(length as i64);
            } else if index < 0 {
                // Silence lies before it.
                let silent = out.len().min(usize::try_from(index.unsigned_abs()).unwrap_or(usize::MAX));
                out = &mut out[silent..];
                index = index.saturating_add(silent as i64);
                continue;
            }
            let Some(samples) = usize::try_from(index).ok().and_then(|at| self.samples.get(at..)) else {
                return;
            };
            let count = samples.len().min(out.len());
            if count == 0 {
                return;
            }
            let (these, behind) = out.split_at_mut(count);
            for (out, sample) in these.iter_mut().zip(samples) {
                *out += f64::from(*sample) * gain;
            }
            (out, index) = (behind, index.saturating_add(count as i64));
        }
    }

    /// Reads at many positions, given in input samples, each while moving on by its `ratio` of input
    /// samples an output sample, with the vector unit `simd`. `window` is scratch memory, used near
    /// the ends; it grows to [`MOST_COPIED`].
    #[inline(always)]
    pub fn read<S: Simd>(
        &self,
        simd: S,
        positions: &[f64],
        ratios: &[f64],
        out: &mut [f32],
        window: &mut Vec<f32>,
    ) {
        kernel::read::<Table, S, 4, STILL_WIDTH>(simd, self, [positions, ratios], out, window);
    }

    /// Reads from a position on, sample by sample at a ratio of 1, each of these places behind the one before: what lies
    /// between two samples is the same for all, so that one row of taps does for all of them.
    #[inline(always)]
    pub(super) fn read_still<S: Simd>(
        &self,
        simd: S,
        position: f64,
        places: &[f64],
        out: &mut [f32],
        window: &mut Vec<f32>,
    ) {
        let fraction = position - position.floor();
        let at = fraction * PHASES as f64;
        let phase = kernel::integer(at.floor()).clamp(0, PHASES as i32 - 1);
        let rows = Table::get(0).rows(phase as usize);
        let weights = Table::weights((at - f64::from(phase)) as f32);
        let mut row = [0.0f32; STILL_WIDTH];
        for (weight, taps) in weights.into_iter().zip(rows.chunks_exact(STILL_WIDTH)) {
            row.iter_mut().zip(taps).for_each(|(sum, tap)| *sum += weight * tap);
        }
        let Some(first) = places.first() else { return };
        let first = self.within((first - fraction).round() as i64);
        match self.about(first, STILL_WIDTH, STILL_WIDTH + places.len() - 1, window) {
            Some(input) => {
                for (out, input) in out.iter_mut().zip(input.windows(STILL_WIDTH)) {
                    *out = match input.first_chunk() {
                        Some(input) => dot(simd, input, &row),
                        None => 0.0,
                    };
                }
            }
            None => out.fill(0.0),
        }
    }

    /// An index of a loop within its first period.
    #[inline(always)]
    pub(super) fn within(&self, index: i64) -> i64 {
        let length = self.samples.len() as i64;
        let is_beyond = self.looped && !(0..length).contains(&index);
        if is_beyond { index.checked_rem_euclid(length).unwrap_or(0) } else { index }
    }

    /// So many samples from the first of a row of taps on that lie about the place behind an index; none where all of them
    /// are silent, or more than are copied at once.
    #[inline(always)]
    pub(super) fn about<'a>(
        &'a self,
        index: i64,
        width: usize,
        count: usize,
        window: &'a mut Vec<f32>,
    ) -> Option<&'a [f32]> {
        let length = self.samples.len() as i64;
        let begin = self.within(index).saturating_add(1 - (width / 2) as i64);
        let end = begin.saturating_add(count as i64);
        if begin >= 0 && end <= length {
            return Some(&self.samples[begin as usize..end as usize]);
        }
        let is_silent = length == 0 || !self.looped && (end <= 0 || begin >= length);
        if is_silent || count > MOST_COPIED {
            return None;
        }
        self.fill(begin, count, window);
        Some(&window[..])
    }

    /// The samples from an index on, where they reach beyond an end.
    #[inline(never)]
    fn fill(&self, begin: i64, count: usize, window: &mut Vec<f32>) {
        window.clear();
        let length = self.samples.len() as i64;
        while window.len() < count {
            let at = begin + window.len() as i64;
            let left = (count - window.len()) as i64;
            let at = if self.looped { at.rem_euclid(length) } else { at };
            if at < 0 {
                window.resize(window.len() + left.min(-at) as usize, 0.0);
            } else if at >= length {
                window.resize(count, 0.0);
            } else {
                window.extend_from_slice(&self.samples[at as usize..(at + left).min(length) as usize]);
            }
        }
    }
}

/// Reads a sound from a position on at a ratio of rates: input samples an output sample. Silence lies about it.
pub(crate) fn resample(samples: &[f32], begin: f64, ratio: f64, out: &mut [f32]) {
    let positions: Vec<f64> = (0..out.len()).map(|n| begin + n as f64 * ratio).collect();
    let ratios = vec![ratio; out.len()];
    pulp::Arch::new().dispatch(Resampling { samples, positions: &positions, ratios: &ratios, out });
}

struct Resampling<'a> {
    samples: &'a [f32],
    positions: &'a [f64],
    ratios: &'a [f64],
    out: &'a mut [f32],
}

impl pulp::WithSimd for Resampling<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let samples = Samples { samples: self.samples, looped: false };
        samples.read(simd, self.positions, self.ratios, self.out, &mut Vec::new());
    }
}

/// The dot product of an input with one row.
#[inline(always)]
fn dot<S: Simd>(simd: S, input: &[f32; STILL_WIDTH], row: &[f32; STILL_WIDTH]) -> f32 {
    let vectors = const { LANES / S::F32_LANES };
    let mut sums = [simd.splat_f32s(0.0); LANES];
    let (x, p) = (S::as_simd_f32s(input).0, S::as_simd_f32s(row).0);
    for (x, p) in x.chunks_exact(vectors).zip(p.chunks_exact(vectors)) {
        for v in 0..vectors {
            sums[v] = simd.add_f32s(sums[v], simd.mul_f32s(x[v], p[v]));
        }
    }
    kernel::total::<S>(&sums[..vectors])
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn read(samples: Samples, position: f64, ratio: f64, window: &mut Vec<f32>) -> f32 {
        let mut out = [0.0];
        samples.read(pulp::Scalar, &[position], &[ratio], &mut out, window);
        out[0]
    }

    #[test]
    fn near_its_ends_a_sound_is_read_as_if_silence_were_written_out() {
        const LENGTH: usize = 700;
        const BEFORE: usize = 30_000;
        let sound = tone(0.037, LENGTH);
        let [mut silent, mut repeated] = [vec![0.0f32; 2 * BEFORE + LENGTH], Vec::new()];
        silent[BEFORE..BEFORE + LENGTH].copy_from_slice(&sound);
        repeated.extend(sound.iter().copied().cycle().skip(LENGTH - BEFORE % LENGTH).take(silent.len()));
        for (looped, written) in [(false, &silent), (true, &repeated)] {
            let found = Samples { samples: &sound, looped };
            let expected = Samples { samples: written, looped: false };
            for (step, begin) in [
                (0.3, -90.3),
                (1.0, -40.5),
                (1.0, 690.5),
                (1.7, -700.1),
                (-0.7, 720.2),
                (9.0, -900.7),
                (63.0, -5000.2),
            ] {
                // The positions of both are rounded alike.
                let begin: f64 = (begin * 64.0f64).round() / 64.0;
                let step: f64 = (step * 64.0f64).round() / 64.0;
                let positions: Vec<f64> = (0..300).map(|n| begin + f64::from(n) * step).collect();
                let moved: Vec<f64> = positions.iter().map(|position| position + BEFORE as f64).collect();
                // One table for all, and one after the other.
                for bend in [0.0, 1e-3] {
                    let ratios: Vec<f64> =
                        (0..300).map(|n| step.abs() * (1.0 + bend * f64::from(n))).collect();
                    let (mut out, window) = ([vec![0.0; 300], vec![f32::NAN; 300]], &mut Vec::new());
                    found.read(pulp::Scalar, &positions, &ratios, &mut out[0], window);
                    expected.read(pulp::Scalar, &moved, &ratios, &mut out[1], window);
                    assert_eq!(out[0], out[1], "{looped}, {step}");
                    found.read_short(pulp::Scalar, &positions, &ratios, &mut out[0], window);
                    expected.read_short(pulp::Scalar, &moved, &ratios, &mut out[1], window);
                    assert_eq!(out[0], out[1], "short, {looped}, {step}");
                }
                if step == 1.0 {
                    let (mut out, window) = ([vec![0.0; 300], vec![f32::NAN; 300]], &mut Vec::new());
                    found.read_still(pulp::Scalar, begin, &positions, &mut out[0], window);
                    expected.read_still(pulp::Scalar, moved[0], &moved, &mut out[1], window);
                    assert_eq!(out[0], out[1], "still, {looped}");
                }
            }
        }
    }

    pub fn tone(frequency: f64, length: usize) -> Vec<f32> {
        (0..length).map(|n| (2.0 * PI * frequency * n as f64).sin() as f32).collect()
    }

    /// Level in decibels of a tone in a signal, and of all that is left without it, both relative to
    /// a full-scale sine; by least squares on sine and cosine.
    pub fn fit(signal: &[f64], frequency: f64) -> (f64, f64) {
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

    fn resampled(input: &[f32], ratio: f64, count: usize) -> Vec<f64> {
        let samples = Samples { samples: input, looped: false };
        let mut window = Vec::new();
        (0..count).map(|n| f64::from(read(samples, 400.37 + n as f64 * ratio, ratio, &mut window))).collect()
    }

    pub const RATIOS: [f64; 13] =
        [0.5, 0.61, 0.75, 0.918_75, 0.97, 0.999, 1.0, 1.003, 1.08, 1.25, 1.41, 1.77, 2.0];

    #[test]
    fn pass_band_is_flat_and_images_are_below_minus_100_db() {
        let input_length = 6000;
        for ratio in RATIOS {
            let edge = 0.5 * PASS_EDGE / ratio.max(1.0);
            for part in [0.003, 0.1, 0.25, 0.5, 0.75, 0.9, 0.97, 1.0] {
                let frequency = edge * part;
                let output = resampled(&tone(frequency, input_length), ratio, (5000.0 / ratio) as usize);
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
                let output = resampled(&tone(frequency, 6000), ratio, (5000.0 / ratio) as usize);
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
                let output = resampled(&tone(frequency, 6000), ratio, (5000.0 / ratio) as usize);
                let (_, rest) = fit(&output, frequency * ratio);
                assert!(rest < -100.0, "ratio {ratio}, {part} of Nyquist: {rest} dB");
            }
        }
    }

    #[test]
    fn reading_is_the_windowed_sinc_sum() {
        // The reference evaluates the kernel itself, without tables, interpolation or lanes.
        let input = tone(0.137, 600);
        let samples = Samples { samples: &input, looped: false };
        let half = Table::get(0).half_width as f64;
        let cutoff = 0.5 - kernel::transition(Table::get(0).half_width, 103.08) / 2.0;
        for position in [300.0, 300.25, 300.501, 255.999] {
            let kernel = |x: f64| {
                if x.abs() < half {
                    2.0 * cutoff * kernel::sinc(2.0 * cutoff * x) * kaiser(x / half)
                } else {
                    0.0
                }
            };
            let (mut value, mut weight) = (0.0, 0.0);
            for (k, &x) in input.iter().enumerate() {
                let tap = kernel(k as f64 - position);
                value += tap * f64::from(x);
                weight += tap;
            }
            let read = f64::from(read(samples, position, 1.0, &mut Vec::new()));
            assert!((read - value / weight).abs() < 3e-6, "{position}: {read} {}", value / weight);
        }
    }

    #[test]
    fn reading_is_continuous_in_ratio_and_position() {
        let input = tone(0.21, 2000);
        let samples = Samples { samples: &input, looped: false };
        let mut window = Vec::new();
        let mut last = read(samples, 700.3, 0.9, &mut window);
        for step in 1..12_000 {
            let read = read(samples, 700.3, 0.9 + step as f64 * 1e-4, &mut window);
            assert!((read - last).abs() < 1e-2, "ratio {}: {last} {read}", 0.9 + step as f64 * 1e-4);
            last = read;
        }
        let mut last = read(samples, 700.0, 1.3, &mut window);
        for step in 1..20_000 {
            let read = read(samples, 700.0 + step as f64 * 1e-4, 1.3, &mut window);
            assert!((read - last).abs() < 2e-4, "position {}", 700.0 + step as f64 * 1e-4);
            last = read;
        }
    }

    #[test]
    fn what_stands_still_is_read_as_ever() {
        struct Read<'a>(Samples<'a>, &'a [f64]);
        impl pulp::WithSimd for Read<'_> {
            type Output = Vec<f32>;
            fn with_simd<S: Simd>(self, simd: S) -> Vec<f32> {
                let mut out = vec![0.0; self.1.len()];
                self.0.read_still(simd, self.1[0], self.1, &mut out, &mut Vec::new());
                out
            }
        }
        let input = tone(0.3137, 400);
        for looped in [false, true] {
            let samples = Samples { samples: &input, looped };
            for begin in [-60.0, 0.013, 17.5, 103.999_999, 350.25] {
                let places: Vec<f64> = (0..100).map(|n| begin + f64::from(n)).collect();
                let found = pulp::Arch::new().dispatch(Read(samples, &places));
                assert_eq!(found, pulp::WithSimd::with_simd(Read(samples, &places), pulp::Scalar));
                for (place, found) in places.iter().zip(found) {
                    let expected = read(samples, *place, 1.0, &mut Vec::new());
                    assert!((found - expected).abs() < 2e-6, "{place}: {found}, not {expected}");
                }
            }
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
            let expected = read(flat, position, 1.2, &mut window);
            assert_eq!(read(looped, position, 1.2, &mut window), expected);
            assert_eq!(
                read(looped, position - 37.0 * 25.0, 1.2, &mut window),
                read(looped, position - 37.0 * 25.0, 1.2, &mut window)
            );
        }
    }

    #[test]
    fn every_vector_unit_gives_the_same_bits() {
        struct Read<'a>(Samples<'a>, f64, f64);
        impl pulp::WithSimd for Read<'_> {
            type Output = f32;
            fn with_simd<S: Simd>(self, simd: S) -> f32 {
                let mut out = [0.0];
                self.0.read(simd, &[self.1], &[self.2], &mut out, &mut Vec::new());
                out[0]
            }
        }
        let input = tone(0.0317, 3000);
        let samples = Samples { samples: &input, looped: true };
        for step in 0..300 {
            let (position, ratio) = (f64::from(step) * 7.77, 0.7 + f64::from(step) * 0.005);
            let widest = pulp::Arch::new().dispatch(Read(samples, position, ratio));
            assert_eq!(widest, read(samples, position, ratio, &mut Vec::new()));
        }
    }

    #[test]
    fn beyond_the_ends_is_silence() {
        let samples = Samples { samples: &[1.0; 100], looped: false };
        let mut window = Vec::new();
        assert_eq!(read(samples, -1e6, 1.0, &mut window), 0.0);
        assert_eq!(read(samples, 1e6, 1.0, &mut window), 0.0);
        assert_eq!(read(Samples { samples: &[], looped: true }, 3.0, 1.0, &mut window), 0.0);
        assert!((read(samples, 50.0, 1.0, &mut window) - 1.0).abs() < 0.05);
    }
}
