//! Band-limited waveforms, read at any phase and pitch.
//!
//! A waveform is kept as tables of ever more harmonics, three to the octave. A reader takes the two
//! tables that stay below half the sample rate and blends between them as the pitch moves, so that
//! harmonics fade in and out without aliasing and without steps. The tables know nothing of the sample
//! rate, so one set serves all.

use std::sync::{Arc, LazyLock};

use realfft::RealFftPlanner;
use realfft::num_complex::Complex;

/// Tables to the octave.
const TO_THE_OCTAVE: f64 = 3.0;

/// Most harmonics of any table: down to 23 Hz all that can be heard at 48 kHz.
const MOST_HARMONICS: usize = 1024;

/// Samples of a table for each of its harmonics: with cubic interpolation the highest harmonic is read
/// to −65 dB of itself, and all below it better.
const OVERSAMPLING: usize = 16;

/// Samples of the shortest table.
const SHORTEST: usize = 512;

/// One period, with its neighbours: a sample before and two behind.
#[derive(Debug)]
struct Table {
    length: f64,
    samples: Vec<f32>,
}

impl Table {
    fn new(harmonics: &[f64], planner: &mut RealFftPlanner<f64>) -> Self {
        let length = (harmonics.len() * OVERSAMPLING).next_power_of_two().max(SHORTEST);
        let inverse = planner.plan_fft_inverse(length);
        let mut spectrum = inverse.make_input_vec();
        for (bin, &amplitude) in spectrum[1..].iter_mut().zip(harmonics) {
            *bin = Complex::new(0.0, -0.5 * amplitude);
        }
        let mut period = inverse.make_output_vec();
        // The lengths are the plan's own, and the first and last bin are real: it cannot fail.
        let _ = inverse.process(&mut spectrum, &mut period);
        let at = |index: usize| period[index % length] as f32;
        let samples = (0..length + 3).map(|index| at(index + length - 1)).collect();
        Self { length: length as f64, samples }
    }

    /// The value at a phase from 0 to 1, by the cubic through four neighbours.
    #[inline(always)]
    fn at(&self, phase: f64) -> f64 {
        let position = phase * self.length;
        let index = (position as usize).min(self.samples.len() - 4);
        let x = position - index as f64;
        let [a, b, c, d] = [0, 1, 2, 3].map(|step| f64::from(self.samples[index + step]));
        let (rise, bend) = (c - b, a - 2.0 * b + c);
        let twist = d - a - 3.0 * rise;
        // Newton's form on the points −1, 0, 1, 2.
        b + x * (rise + (x - 1.0) * (0.5 * bend + (x + 1.0) / 6.0 * twist))
    }
}

/// A waveform in all its tables.
#[derive(Debug)]
pub(super) struct Wave {
    tables: Vec<Table>,
}

impl Wave {
    /// A waveform of sines: the amplitude of each harmonic, from the first.
    pub(super) fn new(harmonics: &[f64]) -> Self {
        let mut planner = RealFftPlanner::new();
        let harmonics = &harmonics[..harmonics.len().min(MOST_HARMONICS)];
        let mut tables = Vec::new();
        loop {
            let count = 2.0_f64.powf(tables.len() as f64 / TO_THE_OCTAVE) + 1e-9;
            let count = (count as usize).min(harmonics.len());
            tables.push(Table::new(&harmonics[..count], &mut planner));
            if count == harmonics.len() {
                return Self { tables };
            }
        }
    }

    pub(super) fn sine() -> Arc<Self> {
        static SINE: LazyLock<Arc<Wave>> = LazyLock::new(|| Arc::new(Wave::new(&[1.0])));
        SINE.clone()
    }

    /// Rises from −1 to 1 over a period.
    pub(super) fn saw() -> Arc<Self> {
        static SAW: LazyLock<Arc<Wave>> =
            LazyLock::new(|| by_harmonic(|n| -2.0 / (std::f64::consts::PI * n)));
        SAW.clone()
    }

    /// 1 for half a period, then −1.
    pub(super) fn square() -> Arc<Self> {
        static SQUARE: LazyLock<Arc<Wave>> =
            LazyLock::new(|| by_harmonic(|n| (n % 2.0) * 4.0 / (std::f64::consts::PI * n)));
        SQUARE.clone()
    }

    /// From 0 up to 1, down to −1 and back to 0.
    pub(super) fn triangle() -> Arc<Self> {
        static TRIANGLE: LazyLock<Arc<Wave>> = LazyLock::new(|| {
            by_harmonic(|n| {
                let sign = if n % 4.0 == 1.0 { 1.0 } else { -1.0 };
                sign * (n % 2.0) * 8.0 / (std::f64::consts::PI * n).powi(2)
            })
        });
        TRIANGLE.clone()
    }

    /// How many tables can be read at a frequency: a whole number and what fades in of the next.
    pub(super) fn level(frequency_hz: f64, rate_hz: f64) -> f64 {
        let harmonics = 0.5 * rate_hz / frequency_hz.abs().max(1e-3);
        TO_THE_OCTAVE * harmonics.log2()
    }

    /// The value at a phase from 0 to 1, with as many harmonics as the level allows.
    #[inline(always)]
    pub(super) fn at(&self, phase: f64, level: f64) -> f64 {
        if level < 0.0 {
            return 0.0;
        }
        let (index, last) = (level as usize, self.tables.len() - 1);
        if index == 0 {
            // The fundamental alone; it fades out over the last fortieth below half the sample rate.
            return self.tables[0].at(phase) * (level * 10.0).min(1.0);
        }
        if index > last {
            return self.tables[last].at(phase);
        }
        let (fewer, more) = (self.tables[index - 1].at(phase), self.tables[index].at(phase));
        fewer + (more - fewer) * (level - index as f64)
    }
}

fn by_harmonic(amplitude: impl Fn(f64) -> f64) -> Arc<Wave> {
    let harmonics: Vec<f64> = (1..=MOST_HARMONICS).map(|n| amplitude(n as f64)).collect();
    Arc::new(Wave::new(&harmonics))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn a_wave_is_the_sum_of_its_sines() {
        let harmonics = [0.5, 0.0, -0.25, 0.1, 0.0, 0.0, 0.05];
        let wave = Wave::new(&harmonics);
        for step in 0..1000 {
            let phase = (f64::from(step) + 0.37) / 1000.0;
            let sum: f64 = (1..).zip(harmonics).map(|(n, a)| a * (TAU * f64::from(n) * phase).sin()).sum();
            assert!((wave.at(phase, 100.0) - sum).abs() < 1e-6, "{phase}");
        }
    }

    #[test]
    fn no_harmonic_lies_above_half_the_rate() {
        for frequency in [20.0, 440.0, 1000.0, 7900.0, 12_001.0, 23_999.0] {
            let level = Wave::level(frequency, 48_000.0);
            let harmonics = 2.0_f64.powf(level.floor() / TO_THE_OCTAVE) as usize;
            assert!(harmonics as f64 * frequency <= 24_000.0, "{frequency}: {harmonics}");
            assert!((harmonics + 1) as f64 * frequency > 24_000.0 * 0.75, "{frequency}: {harmonics}");
        }
        assert_eq!(Wave::sine().at(0.25, Wave::level(24_001.0, 48_000.0)), 0.0);
    }

    #[test]
    fn the_classical_shapes() {
        // Far from the edges, where the sum of harmonics has settled.
        for (phase, saw, square, triangle) in
            [(0.25, -0.5, 1.0, 1.0), (0.1, -0.8, 1.0, 0.4), (0.7, 0.4, -1.0, -0.8), (0.4, -0.2, 1.0, 0.4)]
        {
            assert!((Wave::saw().at(phase, 1e3) - saw).abs() < 2e-3);
            assert!((Wave::square().at(phase, 1e3) - square).abs() < 2e-3);
            assert!((Wave::triangle().at(phase, 1e3) - triangle).abs() < 1e-3);
        }
    }
}
