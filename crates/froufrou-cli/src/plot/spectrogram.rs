//! Spectrograms: the levels of a sound over time and frequency, by the short-time Fourier transform
//! (STFT), in as many columns and rows as a picture has pixels.

use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;
use realfft::num_complex::Complex;
use realfft::{RealFftPlanner, RealToComplex};

use super::axis::Scale;

/// What is drawn for silence, in dB.
pub const SILENCE_DB: f32 = -200.0;

/// A short-time Fourier transform with a Hann window, scaled so that a sine of amplitude 1 has 0 dB.
pub struct Stft {
    fft: Arc<dyn RealToComplex<f32>>,
    window: Vec<f32>,
}

/// What one thread needs to compute with an [`Stft`].
pub struct Workspace {
    frame: Vec<f32>,
    spectrum: Vec<Complex<f32>>,
    scratch: Vec<Complex<f32>>,
}

impl Stft {
    /// A transform of `length` samples, an even number.
    pub fn new(length: usize) -> Self {
        let length = length.max(2) & !1;
        let fft = RealFftPlanner::new().plan_fft_forward(length);
        // The periodic Hann window; its sum is length / 2.
        let hann = |i: usize| 0.5 - 0.5 * (TAU * i as f64 / length as f64).cos();
        let scale = 2.0 / (length as f64 / 2.0);
        Self { fft, window: (0..length).map(|i| (hann(i) * scale) as f32).collect() }
    }

    /// Samples in a frame.
    pub fn length(&self) -> usize {
        self.window.len()
    }

    /// Frequencies, from 0 to half the sample rate.
    pub fn bins(&self) -> usize {
        self.length() / 2 + 1
    }

    /// Room to compute in.
    pub fn workspace(&self) -> Workspace {
        Workspace {
            frame: self.fft.make_input_vec(),
            spectrum: self.fft.make_output_vec(),
            scratch: self.fft.make_scratch_vec(),
        }
    }

    /// Raises the power of every bin to that of the frame around a sample. Beyond its ends the sound
    /// is silent.
    pub fn hold_power(&self, sound: &Mix, centre: usize, room: &mut Workspace, power: &mut [f32]) {
        sound.read(centre as i64 - (self.length() / 2) as i64, &mut room.frame);
        for (sample, weight) in room.frame.iter_mut().zip(&self.window) {
            *sample *= weight;
        }
        // It fails only for buffers of a wrong length, and these come from the transform itself.
        if self.fft.process_with_scratch(&mut room.frame, &mut room.spectrum, &mut room.scratch).is_err() {
            return;
        }
        let last = room.spectrum.len() - 1;
        for (bin, (held, value)) in power.iter_mut().zip(&room.spectrum).enumerate() {
            // The two ends stand for themselves, all others for their mirror image, too.
            let once = if bin == 0 || bin == last { 0.25 } else { 1.0 };
            *held = held.max(once * value.norm_sqr());
        }
    }
}

/// One channel, or the average of several.
pub struct Mix<'a> {
    channels: Vec<&'a [f32]>,
}

impl<'a> Mix<'a> {
    /// The average of channels that are equally long.
    pub fn new(channels: impl IntoIterator<Item = &'a [f32]>) -> Self {
        Self { channels: channels.into_iter().collect() }
    }

    /// Number of samples.
    pub fn frames(&self) -> usize {
        self.channels.iter().map(|channel| channel.len()).min().unwrap_or(0)
    }

    /// Reads samples from a place on; beyond the ends they are 0.
    fn read(&self, start: i64, to: &mut [f32]) {
        to.fill(0.0);
        let frames = self.frames() as i64;
        let first = start.clamp(0, frames);
        let last = (start + to.len() as i64).clamp(first, frames);
        let Some(into) = to.get_mut((first - start).max(0) as usize..) else { return };
        let scale = 1.0 / self.channels.len().max(1) as f32;
        for channel in &self.channels {
            for (to, sample) in into.iter_mut().zip(&channel[first as usize..last as usize]) {
                *to += sample * scale;
            }
        }
    }
}

/// How a row of the picture comes from the bins of a transform.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Row {
    /// The row is narrower than a bin: between this bin and the next, at this part of the way.
    Between(usize, f32),
    /// The loudest of several bins.
    Loudest(usize, usize),
}

/// The levels of a sound, row by row from the lowest frequency, in dB of a full-scale sine.
pub struct Spectrogram {
    /// Levels of all columns, each from the lowest row to the highest.
    levels_db: Vec<f32>,
    rows: usize,
    /// Length of the transform's window in seconds.
    pub window_s: f64,
}

impl Spectrogram {
    /// Computes the picture of a range of samples.
    ///
    /// A column shows the loudest of the spectra that lie in it, so that a click is seen in an hour.
    /// The window goes with the width of a column: 45 ms for what is short, to 170 ms for what is
    /// long. Memory goes with the columns and rows, not with the sound.
    pub fn new(
        sound: &Mix,
        rate_hz: u32,
        range: Range<usize>,
        columns: usize,
        rows: usize,
        frequencies: Scale,
    ) -> Self {
        let rate = f64::from(rate_hz);
        let samples_per_column = range.len() as f64 / columns.max(1) as f64;
        let window_s = (4.0 * samples_per_column / rate).clamp(0.045, 0.17);
        // The power of two that is nearest by ratio.
        let length = 1usize << (window_s * rate).max(16.0).log2().round() as u32;
        let stft = Stft::new(length);
        let rows_of: Vec<Row> = (0..rows)
            .map(|row| row_of_bins(row, rows, frequencies, rate / length as f64, stft.bins()))
            .collect();
        // Four frames a window: of what lies between two of them less than 2 dB is lost.
        let hop = (length / 4) as f64;
        let frames = (samples_per_column / hop).ceil().max(1.0);
        let mut levels_db = vec![SILENCE_DB; columns * rows];
        levels_db.par_chunks_mut(rows.max(1)).enumerate().for_each_init(
            || (stft.workspace(), vec![0.0f32; stft.bins()]),
            |(room, power), (column, levels)| {
                power.fill(0.0);
                for frame in 0..frames as usize {
                    let place = column as f64 + (frame as f64 + 0.5) / frames;
                    let centre = range.start + (place * samples_per_column) as usize;
                    stft.hold_power(sound, centre, room, power);
                }
                for (level, row) in levels.iter_mut().zip(&rows_of) {
                    let power = match *row {
                        Row::Between(bin, u) => power[bin] * (1.0 - u) + power[bin + 1] * u,
                        Row::Loudest(first, last) => power[first..=last].iter().copied().fold(0.0, f32::max),
                    };
                    *level = if power > 1e-20 { 10.0 * power.log10() } else { SILENCE_DB };
                }
            },
        );
        Self { levels_db, rows, window_s: length as f64 / rate }
    }

    /// The levels of a column, from the lowest frequency to the highest.
    pub fn column_db(&self, column: usize) -> &[f32] {
        self.levels_db.get(column * self.rows..(column + 1) * self.rows).unwrap_or_default()
    }

    /// The highest level.
    pub fn loudest_db(&self) -> f32 {
        self.levels_db.iter().copied().fold(SILENCE_DB, f32::max)
    }
}

/// The bins that a row of the picture shows.
fn row_of_bins(row: usize, rows: usize, frequencies: Scale, bin_hz: f64, bins: usize) -> Row {
    let bin_at = |row: f64| (frequencies.value(row / rows as f64) / bin_hz).clamp(0.0, (bins - 1) as f64);
    let (low, high) = (bin_at(row as f64), bin_at(row as f64 + 1.0));
    let (first, last) = (low.ceil() as usize, high.floor() as usize);
    if last > first {
        return Row::Loudest(first, last);
    }
    let middle = bin_at(row as f64 + 0.5);
    let bin = (middle as usize).min(bins - 2);
    Row::Between(bin, (middle - bin as f64) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sine(rate_hz: u32, hz: f64, amplitude: f64, frames: usize) -> Vec<f32> {
        let step = TAU * hz / f64::from(rate_hz);
        (0..frames).map(|i| (amplitude * (step * i as f64).sin()) as f32).collect()
    }

    #[test]
    fn a_sine_on_a_bin_has_the_spectrum_of_the_hann_window() {
        // A·sin at bin k through a Hann window: A at k, A/2 at k ± 1, nothing elsewhere.
        let (length, bin, amplitude) = (256, 20, 0.5);
        let sound = sine(256, bin as f64, amplitude, 1024);
        let stft = Stft::new(length);
        let mut power = vec![0.0; stft.bins()];
        stft.hold_power(&Mix::new([sound.as_slice()]), 512, &mut stft.workspace(), &mut power);
        for (k, power) in power.into_iter().enumerate() {
            let expected = match k.abs_diff(bin) {
                0 => amplitude,
                1 => amplitude / 2.0,
                _ => 0.0,
            };
            assert!((f64::from(power.sqrt()) - expected).abs() < 1e-6, "bin {k}: {}", power.sqrt());
        }
    }

    #[test]
    fn a_constant_has_its_own_level_and_a_click_that_of_the_window() {
        let stft = Stft::new(64);
        let mut power = vec![0.0; stft.bins()];
        let constant = vec![0.25f32; 200];
        stft.hold_power(&Mix::new([constant.as_slice()]), 100, &mut stft.workspace(), &mut power);
        assert!((power[0].sqrt() - 0.25).abs() < 1e-6);
        // A click of height 1 in the middle of the window: 2 · w(N/2) / Σw = 4 / N in every bin.
        let mut click = vec![0.0f32; 200];
        click[100] = 1.0;
        power.fill(0.0);
        stft.hold_power(&Mix::new([click.as_slice()]), 100, &mut stft.workspace(), &mut power);
        assert!(power[1..32].iter().all(|p| (p.sqrt() - 4.0 / 64.0).abs() < 1e-6));
    }

    #[test]
    fn it_is_the_naive_transform() {
        let sound: Vec<f32> = (0..96u32).map(|i| ((i * i * 7 % 101) as f32) / 101.0 - 0.5).collect();
        let (length, centre) = (32, 40);
        let stft = Stft::new(length);
        let mut power = vec![0.0; stft.bins()];
        stft.hold_power(&Mix::new([sound.as_slice()]), centre, &mut stft.workspace(), &mut power);
        for (k, power) in power.into_iter().enumerate() {
            let (mut re, mut im, mut weights) = (0.0, 0.0, 0.0);
            for n in 0..length {
                let turn = TAU * n as f64 / length as f64;
                let window = 0.5 - 0.5 * turn.cos();
                let sample = f64::from(sound[centre - length / 2 + n]) * window;
                re += sample * (k as f64 * turn).cos();
                im -= sample * (k as f64 * turn).sin();
                weights += window;
            }
            let sides = if k == 0 || k == length / 2 { 1.0 } else { 2.0 };
            let expected = sides * re.hypot(im) / weights;
            assert!((f64::from(power.sqrt()) - expected).abs() < 1e-6, "bin {k}");
        }
    }

    #[test]
    fn a_tone_lies_in_its_row_at_every_rate() {
        for (rate_hz, tone_hz) in [(8000, 1000.0), (48_000, 1000.0), (48_000, 97.0), (192_000, 30_000.0)] {
            let sound = sine(rate_hz, tone_hz, 0.5, rate_hz as usize);
            let scale = Scale::Logarithmic { from: 20.0, to: f64::from(rate_hz) / 2.0 };
            let rows = 400;
            let picture =
                Spectrogram::new(&Mix::new([sound.as_slice()]), rate_hz, 0..sound.len(), 50, rows, scale);
            let levels = picture.column_db(25);
            let loudest = (0..rows).max_by(|&a, &b| levels[a].total_cmp(&levels[b]));
            let expected = scale.place(tone_hz) * rows as f64;
            // In the bass a bin is wider than a row.
            let bin_rows = scale.place(tone_hz + 0.5 / picture.window_s) * rows as f64 - expected;
            let loudest = loudest.map_or(f64::NAN, |row| row as f64 + 0.5);
            assert!(
                (loudest - expected).abs() <= bin_rows + 1.0,
                "{rate_hz} {tone_hz}: {loudest}, {expected}"
            );
            // Between two bins at most 1.4 dB are lost.
            let level = picture.loudest_db();
            assert!((-7.5..=-6.0).contains(&level), "{rate_hz} {tone_hz}: {level} dB");
        }
    }

    #[test]
    fn a_click_is_seen_wherever_it_lies_in_a_long_sound() {
        let scale = Scale::Logarithmic { from: 20.0, to: 4000.0 };
        for place in [0, 1, 12_345, 99_999, 199_999] {
            let mut sound = vec![0.0f32; 200_000];
            sound[place] = 1.0;
            let mix = Mix::new([sound.as_slice()]);
            let picture = Spectrogram::new(&mix, 8000, 0..sound.len(), 20, 30, scale);
            let column = place * 20 / sound.len();
            let level = picture.column_db(column)[25];
            // 4 / N of a window of 1024 samples is −48 dB.
            assert!(level > -52.0, "{place}: {level} dB");
        }
    }

    #[test]
    fn channels_are_averaged_and_silence_is_silent() {
        let (a, b) = (sine(8000, 500.0, 1.0, 4000), sine(8000, 500.0, -1.0, 4000));
        let scale = Scale::Logarithmic { from: 20.0, to: 4000.0 };
        let mix = Mix::new([a.as_slice(), b.as_slice()]);
        let picture = Spectrogram::new(&mix, 8000, 0..4000, 7, 9, scale);
        assert_eq!(picture.loudest_db(), SILENCE_DB);
        let one = [0.0f32];
        let picture = Spectrogram::new(&Mix::new([one.as_slice()]), 8000, 0..1, 7, 9, scale);
        assert_eq!(picture.column_db(6), [SILENCE_DB; 9]);
    }
}
