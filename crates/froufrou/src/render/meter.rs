//! How loud a soundtrack is: peaks, loudness, and what went wrong.

use std::collections::VecDeque;
use std::fmt;

use ebur128::{Channel, EbuR128, Mode};
use serde::Serialize;

use crate::error::{Error, Result};

/// Zeros that push the last samples through the interpolation filter of the true peak.
const TAIL_FRAMES: usize = 64;

/// The most samples handed on at a time: bounds the memory of the copy.
const CHUNK_SAMPLES: usize = 1 << 14;

/// Steps of 100 ms in the window of the momentary and of the short-term loudness.
const MOMENTARY_STEPS: usize = 4;
const SHORT_TERM_STEPS: usize = 30;

/// What a power of 1 has in LUFS (ITU-R BS.1770).
const OFFSET_LUFS: f64 = -0.691;

/// Measures a soundtrack block by block, in memory that grows by 88 bytes a second, 8 MB a day.
///
/// The powers of all gating blocks are kept. A histogram of them, which takes less, puts a block that
/// lies within 0.1 dB of the gate on its wrong side: of a short impact with three blocks above it,
/// that once made a difference of 1.7 LU.
///
/// The channels are taken in the order of WAV files: 1, mono; 2, left and right; 4, with a left and
/// right surround; 5, with a centre after the front ones; 6, 5.1; 8, 7.1. For the loudness, surround
/// channels count 1.5 dB more and the low-frequency one of 5.1 and 7.1 does not count (ITU-R BS.1770).
/// Of any other number of channels all count alike. Mono counts once.
///
/// ```
/// use froufrou::render::meter::Meter;
/// // EBU Tech 3341, case 1: a sine of 1 kHz at −23 dBFS in both channels has −23 LUFS.
/// let amplitude = 10f64.powf(-23.0 / 20.0);
/// let mut meter = Meter::new(48_000, 2)?;
/// for i in 0..20 * 48_000 {
///     let sample = (amplitude * (std::f64::consts::TAU * 1000.0 * i as f64 / 48_000.0).sin()) as f32;
///     meter.add(&[sample, sample])?;
/// }
/// let report = meter.finish();
/// assert!((report.loudness_lufs.unwrap() + 23.0).abs() < 0.1);
/// assert_eq!(report.to_string(), "peak −23.0 dBFS, true peak −23.0 dBTP, −23.0 LUFS");
/// # Ok::<(), froufrou::Error>(())
/// ```
pub struct Meter {
    channels: usize,
    loudness: EbuR128,
    true_peak: EbuR128,
    clean: Vec<f32>,
    /// Frames of 100 ms, and those that are still to come of the present ones.
    step_frames: usize,
    step_left: usize,
    /// The power of each of the last steps, the latest last.
    steps: VecDeque<f64>,
    max_momentary: f64,
    max_short_term: f64,
    frames: u64,
    peak: f32,
    clipped_samples: u64,
    first_non_finite: Option<NonFinite>,
}

/// A sample that is not a finite number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct NonFinite {
    /// Its frame, counted from the first one added.
    pub frame: u64,
    /// Its channel, from 0.
    pub channel: usize,
}

/// What a [`Meter`] has measured. Its `Display` is a line for a person:
/// "peak −3.1 dBFS, true peak −2.9 dBTP, −23.0 LUFS".
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Frames measured.
    pub frames: u64,
    /// The largest sample in dB of full scale; `None`: digital silence.
    pub peak_dbfs: Option<f64>,
    /// The largest value of the waveform between the samples too, in dB of full scale, as ITU-R
    /// BS.1770 estimates it: interpolated 4 times below 96 kHz, twice below 192 kHz, not at all from
    /// there on. `None`: digital silence.
    pub true_peak_dbtp: Option<f64>,
    /// Integrated loudness, gated, in LUFS; `None`: nothing above −70 LUFS, or shorter than 400 ms.
    pub loudness_lufs: Option<f64>,
    /// Loudness range of EBU Tech 3342 in LU; `None`: shorter than 3 s, or silent.
    pub loudness_range_lu: Option<f64>,
    /// The highest loudness of any 400 ms, in steps of 100 ms, in LUFS; `None`: shorter, or silent.
    pub max_momentary_lufs: Option<f64>,
    /// The highest loudness of any 3 s, in steps of 100 ms, in LUFS; `None`: shorter, or silent.
    pub max_short_term_lufs: Option<f64>,
    /// Samples that integers cannot hold: outside of [−1, 1).
    pub clipped_samples: u64,
    /// The first sample that is not a finite number; they are all measured as silence.
    pub first_non_finite: Option<NonFinite>,
}

impl Meter {
    /// A meter of interleaved blocks.
    ///
    /// # Errors
    /// Where the channels are not 1 to 64 or the rate is not 1 kHz to 768 kHz.
    pub fn new(rate_hz: u32, channels: usize) -> Result<Self> {
        if !(1_000..=768_000).contains(&rate_hz) || !(1..=64).contains(&channels) {
            return Err(Error::new(format!(
                "cannot measure {channels} channels at {rate_hz} Hz, expected 1 to 64 at 1000 to 768000 Hz"
            )));
        }
        let new = |mode| {
            EbuR128::new(channels as u32, rate_hz, mode).map_err(|e| {
                Error::new(format!("cannot measure {channels} channels at {rate_hz} Hz: {e}")).because(e)
            })
        };
        let mut loudness = new(Mode::I | Mode::LRA)?;
        loudness
            .set_channel_map(&channel_map(channels))
            .map_err(|e| Error::new(format!("cannot measure {channels} channels: {e}")).because(e))?;
        Ok(Self {
            channels,
            loudness,
            true_peak: new(Mode::TRUE_PEAK)?,
            clean: Vec::new(),
            step_frames: rate_hz as usize / 10,
            step_left: rate_hz as usize / 10,
            steps: VecDeque::with_capacity(SHORT_TERM_STEPS),
            max_momentary: 0.0,
            max_short_term: 0.0,
            frames: 0,
            peak: 0.0,
            clipped_samples: 0,
            first_non_finite: None,
        })
    }

    /// Adds the next frames, their channels interleaved.
    ///
    /// # Errors
    /// Where the length is not a multiple of the channels; then nothing is added.
    pub fn add(&mut self, interleaved: &[f32]) -> Result<()> {
        if !interleaved.len().is_multiple_of(self.channels) {
            return Err(Error::new(format!(
                "a block of {} samples was given, expected a multiple of the {} channels",
                interleaved.len(),
                self.channels
            )));
        }
        for block in interleaved.chunks((CHUNK_SAMPLES / self.channels).max(1) * self.channels) {
            self.clean.clear();
            for (index, &sample) in block.iter().enumerate() {
                if !sample.is_finite() {
                    self.first_non_finite.get_or_insert(NonFinite {
                        frame: self.frames + (index / self.channels) as u64,
                        channel: index % self.channels,
                    });
                }
                self.clipped_samples += u64::from(!(-1.0..1.0).contains(&sample) && sample.is_finite());
                let sample = if sample.is_finite() { sample } else { 0.0 };
                self.peak = self.peak.max(sample.abs());
                self.clean.push(sample);
            }
            self.frames += (block.len() / self.channels) as u64;
            let failed = |e| Error::new(format!("cannot measure the sound: {e}")).because(e);
            self.true_peak.add_frames_f32(&self.clean).map_err(failed)?;
            let mut rest = self.clean.as_slice();
            while !rest.is_empty() {
                let (part, after) = rest.split_at(rest.len().min(self.step_left * self.channels));
                self.loudness.add_frames_f32(part).map_err(failed)?;
                self.step_left -= part.len() / self.channels;
                if self.step_left == 0 {
                    self.step_left = self.step_frames;
                    let lufs = self.loudness.loudness_window(100).map_err(failed)?;
                    if self.steps.len() == SHORT_TERM_STEPS {
                        self.steps.pop_front();
                    }
                    self.steps.push_back(10f64.powf((lufs - OFFSET_LUFS) / 10.0));
                    let mean = |steps: usize| {
                        let begin = self.steps.len().checked_sub(steps)?;
                        Some(self.steps.range(begin..).sum::<f64>() / steps as f64)
                    };
                    self.max_momentary = self.max_momentary.max(mean(MOMENTARY_STEPS).unwrap_or(0.0));
                    self.max_short_term = self.max_short_term.max(mean(SHORT_TERM_STEPS).unwrap_or(0.0));
                }
                rest = after;
            }
        }
        Ok(())
    }

    /// Ends the measurement.
    pub fn finish(mut self) -> Report {
        // What the filter still holds counts for the peak but not for the loudness. The meter takes
        // whole frames of any number, so it cannot fail; if it did, the peak would be a little low.
        let tail = vec![0.0f32; TAIL_FRAMES * self.channels];
        let _ = self.true_peak.add_frames_f32(&tail);
        let peak = f64::from(self.peak);
        let true_peak = (0..self.channels as u32)
            .filter_map(|channel| self.true_peak.true_peak(channel).ok())
            .fold(peak, f64::max);
        let in_db = |peak: f64| (peak > 0.0).then(|| 20.0 * peak.log10());
        let in_lufs = |power: f64| (power > 0.0).then(|| OFFSET_LUFS + 10.0 * power.log10());
        let loudness_lufs = self.loudness.loudness_global().ok().filter(|lufs| lufs.is_finite());
        let is_long = self.frames >= (SHORT_TERM_STEPS * self.step_frames) as u64;
        let range = || self.loudness.loudness_range().ok().filter(|lu| lu.is_finite());
        Report {
            frames: self.frames,
            peak_dbfs: in_db(peak),
            true_peak_dbtp: in_db(true_peak),
            loudness_lufs,
            loudness_range_lu: loudness_lufs.filter(|_| is_long).and_then(|_| range()),
            max_momentary_lufs: in_lufs(self.max_momentary),
            max_short_term_lufs: in_lufs(self.max_short_term),
            clipped_samples: self.clipped_samples,
            first_non_finite: self.first_non_finite,
        }
    }
}

/// Where the channels of a WAV file stand, for their weight in the loudness.
fn channel_map(channels: usize) -> Vec<Channel> {
    use Channel::{Center, Left, LeftSurround, Mm090, Mm135, Mp090, Mp135, Right, RightSurround, Unused};
    match channels {
        2 => vec![Left, Right],
        4 => vec![Left, Right, LeftSurround, RightSurround],
        5 => vec![Left, Right, Center, LeftSurround, RightSurround],
        6 => vec![Left, Right, Center, Unused, LeftSurround, RightSurround],
        8 => vec![Left, Right, Center, Unused, Mp135, Mm135, Mp090, Mm090],
        other => vec![Center; other],
    }
}

/// A level with its sign as typographers write it.
struct Level(Option<f64>, &'static str);

impl fmt::Display for Level {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            None => write!(f, "−∞ {}", self.1),
            Some(level) => {
                let tenths = (level * 10.0).round() / 10.0;
                let sign = if tenths < 0.0 { "−" } else { "" };
                write!(f, "{sign}{:.1} {}", tenths.abs(), self.1)
            }
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.peak_dbfs.is_none() {
            write!(f, "silence")?;
        } else {
            write!(
                f,
                "peak {}, true peak {}",
                Level(self.peak_dbfs, "dBFS"),
                Level(self.true_peak_dbtp, "dBTP")
            )?;
            if self.loudness_lufs.is_some() {
                write!(f, ", {}", Level(self.loudness_lufs, "LUFS"))?;
            }
        }
        match self.clipped_samples {
            0 => {}
            1 => write!(f, ", 1 sample beyond full scale")?,
            count => write!(f, ", {count} samples beyond full scale")?,
        }
        if let Some(NonFinite { frame, channel }) = self.first_non_finite {
            write!(f, ", not a number from frame {frame}, channel {channel} on")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_4, TAU};

    use super::*;

    /// A sine at a level in dBFS (of its peak), in some of the channels.
    fn sine(rate_hz: u32, seconds: f64, frequency_hz: f64, levels_dbfs: &[Option<f64>]) -> Vec<f32> {
        let frames = (seconds * f64::from(rate_hz)).round() as usize;
        let step = TAU * frequency_hz / f64::from(rate_hz);
        (0..frames)
            .flat_map(|i| {
                levels_dbfs.iter().map(move |level| {
                    level.map_or(0.0, |db| (10f64.powf(db / 20.0) * (step * i as f64).sin()) as f32)
                })
            })
            .collect()
    }

    fn measure(rate_hz: u32, channels: usize, sound: &[f32]) -> Report {
        let mut meter = Meter::new(rate_hz, channels).unwrap();
        // Blocks of an odd size.
        for block in sound.chunks(channels * 997) {
            meter.add(block).unwrap();
        }
        meter.finish()
    }

    fn assert_loudness(report: &Report, expected_lufs: f64) {
        let lufs = report.loudness_lufs.unwrap();
        assert!((lufs - expected_lufs).abs() < 0.1, "{lufs} LUFS, expected {expected_lufs}");
    }

    #[test]
    fn the_loudness_is_that_of_ebu_tech_3341() {
        let stereo = |seconds, db| sine(48_000, seconds, 1000.0, &[Some(db), Some(db)]);
        // Cases 1 and 2.
        assert_loudness(&measure(48_000, 2, &stereo(20.0, -23.0)), -23.0);
        assert_loudness(&measure(48_000, 2, &stereo(20.0, -33.0)), -33.0);
        // Case 3: the relative gate. Case 4: the absolute one too.
        let case_3 = [stereo(10.0, -36.0), stereo(60.0, -23.0), stereo(10.0, -36.0)].concat();
        assert_loudness(&measure(48_000, 2, &case_3), -23.0);
        let case_4 = [stereo(10.0, -72.0), case_3, stereo(10.0, -72.0)].concat();
        assert_loudness(&measure(48_000, 2, &case_4), -23.0);
        // Case 5.
        let case_5 = [stereo(20.0, -26.0), stereo(20.1, -20.0), stereo(20.0, -26.0)].concat();
        assert_loudness(&measure(48_000, 2, &case_5), -23.0);
        // Case 6: 5.0, here with a silent low-frequency channel.
        let levels = [Some(-28.0), Some(-28.0), Some(-24.0), None, Some(-30.0), Some(-30.0)];
        assert_loudness(&measure(48_000, 6, &sine(48_000, 20.0, 1000.0, &levels)), -23.0);
    }

    #[test]
    fn the_loudness_range_is_that_of_ebu_tech_3342() {
        // Cases 1 to 4: 20 s each at some levels, and the range within 1 LU.
        for (levels, range) in [
            (&[-20.0, -30.0][..], 10.0),
            (&[-20.0, -15.0], 5.0),
            (&[-40.0, -20.0], 20.0),
            (&[-50.0, -35.0, -20.0, -35.0, -50.0], 15.0),
        ] {
            let parts: Vec<Vec<f32>> =
                levels.iter().map(|db| sine(48_000, 20.0, 1000.0, &[Some(*db), Some(*db)])).collect();
            let found = measure(48_000, 2, &parts.concat()).loudness_range_lu.unwrap();
            assert!((found - range).abs() < 1.0, "{levels:?}: {found} LU");
        }
    }

    #[test]
    fn the_highest_momentary_and_short_term_loudness_are_of_their_windows() {
        let report = |parts: &[(f64, Option<f64>)]| {
            let parts: Vec<Vec<f32>> =
                parts.iter().map(|(s, level)| sine(48_000, *s, 1000.0, &[*level, *level])).collect();
            measure(48_000, 2, &parts.concat())
        };
        let near = |found: Option<f64>, expected: f64| {
            let found = found.unwrap();
            assert!((found - expected).abs() < 0.1, "{found} LUFS, expected {expected}");
        };
        // EBU Tech 3341, case 9: parts of 1.34 s and 1.66 s make every 3 s equally loud.
        let case_9: Vec<(f64, Option<f64>)> = [(1.34, Some(-20.0)), (1.66, Some(-30.0))].repeat(5);
        near(report(&case_9).max_short_term_lufs, -23.0);
        // Case 12: the same of 400 ms.
        let case_12: Vec<(f64, Option<f64>)> = [(0.18, Some(-20.0)), (0.22, Some(-30.0))].repeat(25);
        near(report(&case_12).max_momentary_lufs, -23.0);
        // A burst of 400 ms fills the one window and 2/15 of the other.
        let burst = report(&[(2.0, None), (0.4, Some(-20.0)), (2.0, None)]);
        near(burst.max_momentary_lufs, -20.0);
        near(burst.max_short_term_lufs, -20.0 + 10.0 * (2f64 / 15.0).log10());
        let short = report(&[(0.39, Some(-20.0))]);
        assert_eq!((short.max_momentary_lufs, short.max_short_term_lufs), (None, None));
        assert_eq!(report(&[(2.9, Some(-20.0))]).loudness_range_lu, None);
    }

    #[test]
    fn loudness_and_true_peak_are_those_of_other_programs() {
        // Columns: rate, channels, LUFS by pyloudnorm, LUFS and true peak by ffmpeg, of the sound that
        // oracles/recording_fixtures.py makes by the same formula.
        let table = include_str!("../../tests/fixtures/loudness.tsv");
        let mut cases = 0;
        for line in table.lines().skip(1) {
            let fields: Vec<f64> = line.split('\t').map(|field| field.parse().unwrap()).collect();
            let (rate_hz, channels) = (fields[0] as u32, fields[1] as usize);
            let sound: Vec<f32> = (0..8 * rate_hz)
                .flat_map(|i| {
                    let t = f64::from(i) / f64::from(rate_hz);
                    (0..channels).map(move |channel| {
                        let c = channel as f64;
                        let swell = 0.3 * (1.0 + 0.9 * (TAU * 0.7 * t + c).sin());
                        let low = 0.5 * (TAU * (180.0 + 130.0 * c) * t).sin();
                        let high = 0.3 * (TAU * (2900.0 + 410.0 * c) * t + 0.5).sin();
                        (swell * (low + high)) as f32
                    })
                })
                .collect();
            let report = measure(rate_hz, channels, &sound);
            let (lufs, true_peak) = (report.loudness_lufs.unwrap(), report.true_peak_dbtp.unwrap());
            // At 8 kHz the filters of the two differ from each other, as the standard is for 48 kHz.
            let tolerance = if rate_hz == 8_000 { 0.3 } else { 0.05 };
            assert!((lufs - fields[2]).abs() < tolerance, "{line}: {lufs} LUFS");
            assert!((lufs - fields[3]).abs() < tolerance + 0.05, "{line}: {lufs} LUFS");
            assert!((true_peak - fields[4]).abs() < 0.1, "{line}: {true_peak} dBTP");
            cases += 1;
        }
        assert_eq!(cases, 6);
    }

    #[test]
    fn the_loudness_holds_at_every_rate_and_channel_count() {
        for rate_hz in [8_000, 22_050, 44_100, 96_000, 192_000] {
            let sound = sine(rate_hz, 5.0, 1000.0, &[Some(-23.0), Some(-23.0)]);
            assert_loudness(&measure(rate_hz, 2, &sound), -23.0);
        }
        // Each channel of weight 1 adds its power: mono at −20 dBFS has −23 LUFS.
        let all = |channels: usize, db: f64| {
            measure(48_000, channels, &sine(48_000, 5.0, 1000.0, &vec![Some(db); channels]))
        };
        assert_loudness(&all(1, -20.0), -23.0);
        assert_loudness(&all(3, -20.0), -23.0 + 10.0 * 3f64.log10());
        assert_loudness(&all(16, -40.0), -43.0 + 10.0 * 16f64.log10());
        // 7.1: five channels of weight 1, two at the sides of 1.41, none of low frequencies.
        assert_loudness(&all(8, -30.0), -33.0 + 10.0 * (5.0 + 2.0 * 1.41f64).log10());
    }

    #[test]
    fn the_true_peak_lies_between_the_samples() {
        // A sine at a quarter of the rate, 45° off: every sample is 3.01 dB below the crest.
        let sound: Vec<f32> =
            (0..48_000).map(|i| (0.5 * (TAU * 0.25 * f64::from(i) + FRAC_PI_4).sin()) as f32).collect();
        let report = measure(48_000, 1, &sound);
        let (peak, true_peak) = (report.peak_dbfs.unwrap(), report.true_peak_dbtp.unwrap());
        assert!((peak + 9.03).abs() < 0.01, "{peak}");
        // EBU Tech 3341 allows +0.2 and −0.4 dB.
        assert!((-6.42..=-5.82).contains(&true_peak), "{true_peak}");
        assert!((true_peak - peak - 3.01).abs() < 0.4, "{true_peak}");
    }

    #[test]
    fn a_peak_at_the_very_end_counts() {
        let mut sound = vec![0.0f32; 1000];
        sound[998..].copy_from_slice(&[0.7, 0.7]);
        let report = measure(48_000, 1, &sound);
        let over = report.true_peak_dbtp.unwrap() - report.peak_dbfs.unwrap();
        // Two equal samples in silence: the waveform swells between them to 4/π of their value.
        assert!((1.6..2.3).contains(&over), "{over}");
    }

    #[test]
    fn silence_and_very_short_sounds_have_no_loudness() {
        let silence = measure(48_000, 2, &[0.0; 96_000]);
        assert_eq!((silence.peak_dbfs, silence.true_peak_dbtp, silence.loudness_lufs), (None, None, None));
        assert_eq!(silence.to_string(), "silence");
        assert_eq!(measure(48_000, 2, &[]).frames, 0);
        for channels in [1, 8] {
            let click = measure(8_000, channels, &vec![0.5; channels]);
            assert_eq!(click.frames, 1);
            assert!((click.peak_dbfs.unwrap() + 6.02).abs() < 0.01);
            assert_eq!(click.loudness_lufs, None);
            assert_eq!(click.to_string(), "peak −6.0 dBFS, true peak −6.0 dBTP");
        }
    }

    #[test]
    fn what_went_wrong_is_counted_and_does_not_spoil_the_rest() {
        let mut sound = sine(48_000, 5.0, 1000.0, &[Some(-23.0), Some(-23.0)]);
        sound[2 * 40_000 + 1] = f32::NAN;
        sound[2 * 50_000] = f32::INFINITY;
        sound[10] = 1.0;
        sound[12] = -1.0;
        sound[14] = -1.5;
        let report = measure(48_000, 2, &sound);
        assert_eq!(report.first_non_finite, Some(NonFinite { frame: 40_000, channel: 1 }));
        assert_eq!(report.clipped_samples, 2);
        assert_loudness(&report, -23.0);
        let words = report.to_string();
        assert!(words.contains("2 samples beyond full scale"), "{words}");
        assert!(words.ends_with("not a number from frame 40000, channel 1 on"), "{words}");
        assert!(words.starts_with("peak 3.5 dBFS"), "{words}");
    }

    #[test]
    fn what_cannot_be_measured_is_an_error() {
        assert!(Meter::new(48_000, 0).is_err() && Meter::new(48_000, 65).is_err());
        assert!(Meter::new(0, 2).is_err());
        let mut meter = Meter::new(48_000, 2).unwrap();
        assert!(meter.add(&[0.0; 3]).unwrap_err().to_string().contains("multiple of the 2 channels"));
    }

    #[test]
    fn a_report_is_data_too() {
        let json = serde_json::to_string(&measure(48_000, 1, &[0.5])).unwrap();
        assert!(json.contains("\"loudness_lufs\":null") && json.contains("\"frames\":1"), "{json}");
    }
}
