//! Grains: recordings cut where their spectrum changes, as Picard, Tsingos & Faure (2009, section 3) cut them.
//!
//! | step | what is done |
//! | --- | --- |
//! | [`Contact::guess`] | hits and breaks are impulsive, rolling and sliding continuous; the user's word counts for more |
//! | [`spectral`](super::spectral) | a continuous recording becomes sinusoids and residual, which are cut each by itself |
//! | [`Extraction::flux`] | how much the spectrum changes from frame to frame |
//! | [`Extraction::cuts`] | the places where the flux bends over, at least a shortest grain apart |
//! | [`Extraction::extract`] | what lies between two cuts, windowed and normalised for power, unless it is too quiet |
//! | [`patterns`] | where in which recording a grain fits |
//!
//! Segments do not overlap. So no two grains hold the same sound. A recording costs an FFT a hop and one a grain.

mod flux;
pub mod patterns;
#[cfg(test)]
mod tests;

use std::collections::BTreeSet;

use rayon::prelude::*;
use realfft::RealFftPlanner;
use serde::{Deserialize, Serialize};

use super::spectral::{SpectralModel, check_sound};
use crate::error::{Error, Result};

/// How bodies touch in a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Contact {
    /// They hit or break.
    Impulsive,
    /// They roll or slide.
    Continuous,
}

/// What a grain was cut from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum GrainKind {
    /// An impulsive recording.
    Impulsive,
    /// The sinusoids of a continuous recording.
    Sinusoidal,
    /// The residual of a continuous recording.
    Transient,
}

/// What lies between two cuts of one part of a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// What it was cut from.
    pub kind: GrainKind,
    /// Its first sample in that.
    pub start: usize,
    /// In samples.
    pub length: usize,
    /// The sum of squares.
    pub energy: f64,
}

/// A short piece of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Grain {
    /// What it was cut from.
    pub kind: GrainKind,
    /// Its first sample in that.
    pub start: usize,
    /// The piece under a Tukey window whose mean square is 1.
    pub samples: Vec<f32>,
    /// The sum of squares of the piece, without the window.
    pub energy: f64,
    /// The mean frequency of the windowed piece, weighted by magnitude.
    pub centroid_hz: f64,
}

/// How to cut recordings. Times are in seconds, so that one setting serves all rates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Extraction {
    /// Length of the Hann window under which spectra are compared.
    pub frame_s: f64,
    /// From spectrum to spectrum.
    pub hop_s: f64,
    /// Standard deviation of the Gaussian by which the flux is smoothed: more makes longer grains.
    pub smoothing_s: f64,
    /// No grain is shorter (unless its recording is).
    pub shortest_s: f64,
    /// No grain is longer; at least twice the shortest.
    pub longest_s: f64,
    /// The share of a grain that lies under the tapers of its window: r of the paper.
    pub taper: f64,
    /// Grains whose power is lower than this below that of the recording's strongest are dropped; negative.
    pub threshold_db: f64,
}

impl Default for Extraction {
    /// The paper's figures: grains of 300 to 3000 samples at 44.1 kHz, r = 0.02.
    fn default() -> Self {
        Self {
            frame_s: 512.0 / 44_100.0,
            hop_s: 128.0 / 44_100.0,
            smoothing_s: 0.006,
            shortest_s: 300.0 / 44_100.0,
            longest_s: 3000.0 / 44_100.0,
            taper: 0.02,
            threshold_db: -50.0,
        }
    }
}

impl Contact {
    /// A guess of the contact from how long the sound goes on: the strongest hundredths of a second that hold nine
    /// tenths of its energy last more or less than [a fifth of a second](CONTINUOUS_S).
    ///
    /// # Errors
    /// Where there is no sample, one is not a finite number or the rate is not one of sound.
    pub fn guess(samples: &[f32], rate_hz: u32) -> Result<Self> {
        check_sound(samples, rate_hz)?;
        let mut energies: Vec<f64> = samples.chunks((rate_hz / 100) as usize).map(energy).collect();
        energies.sort_by(|a, b| b.total_cmp(a));
        let wanted = 0.9 * energies.iter().sum::<f64>();
        let mut sum = 0.0;
        let needed = energies
            .iter()
            .take_while(|&&energy| {
                let goes_on = sum < wanted;
                sum += energy;
                goes_on
            })
            .count();
        Ok(if needed as f64 * 0.01 < CONTINUOUS_S { Self::Impulsive } else { Self::Continuous })
    }
}

/// What lasts longer is guessed to be continuous, in seconds.
pub const CONTINUOUS_S: f64 = 0.2;

impl Extraction {
    /// The grains of one channel of a recording; a continuous one is split by the model first.
    ///
    /// # Errors
    /// Where there is no sample, one is not a finite number, the rate is not one of sound or a setting makes no sense.
    pub fn extract_recording(
        &self,
        samples: &[f32],
        rate_hz: u32,
        contact: Contact,
        model: &SpectralModel,
    ) -> Result<Vec<Grain>> {
        match contact {
            Contact::Impulsive => self.extract(&[(samples, GrainKind::Impulsive)], rate_hz),
            Contact::Continuous => {
                let split = model.split(samples, rate_hz)?;
                let parts =
                    [(&*split.sinusoids, GrainKind::Sinusoidal), (&*split.residual, GrainKind::Transient)];
                self.extract(&parts, rate_hz)
            }
        }
    }

    /// The grains of the parts of one recording, in order of the parts and of time. The threshold is held against the
    /// strongest grain of all parts.
    ///
    /// # Errors
    /// Those of [`Extraction::extract_recording`].
    pub fn extract(&self, parts: &[(&[f32], GrainKind)], rate_hz: u32) -> Result<Vec<Grain>> {
        let segments = self.segments(parts, rate_hz)?;
        let part_of = |segment: &Segment| parts.iter().find(|(_, kind)| *kind == segment.kind);
        Ok(segments
            .par_iter()
            .map_init(RealFftPlanner::new, |planner, segment| {
                let samples = part_of(segment).map_or(&[][..], |(samples, _)| samples);
                let piece = samples.get(segment.start..segment.start + segment.length).unwrap_or_default();
                let window = tukey(piece.len(), self.taper);
                let samples: Vec<f32> =
                    piece.iter().zip(&window).map(|(v, w)| (f64::from(*v) * w) as f32).collect();
                let centroid_hz = centroid_hz(&samples, rate_hz, planner);
                Grain {
                    kind: segment.kind,
                    start: segment.start,
                    samples,
                    energy: segment.energy,
                    centroid_hz,
                }
            })
            .collect())
    }

    /// What lies between the cuts of the parts of one recording, unless it is too quiet; parts are of different kinds.
    /// In order of the parts and of time. The threshold is held against the strongest segment of all parts.
    ///
    /// # Errors
    /// Those of [`Extraction::extract_recording`].
    pub fn segments(&self, parts: &[(&[f32], GrainKind)], rate_hz: u32) -> Result<Vec<Segment>> {
        let mut segments = Vec::new();
        for &(samples, kind) in parts {
            let cuts = self.cuts(samples, rate_hz)?;
            segments.extend(cuts.windows(2).map(|pair| {
                let (start, length) = (pair[0], pair[1] - pair[0]);
                Segment { kind, start, length, energy: energy(&samples[start..pair[1]]) }
            }));
        }
        let power = |segment: &Segment| segment.energy / segment.length as f64;
        let loudest = segments.iter().map(power).fold(0.0, f64::max);
        let least = loudest * 10f64.powf(self.threshold_db / 10.0);
        segments.retain(|segment| segment.energy > 0.0 && power(segment) >= least);
        Ok(segments)
    }

    /// The places where a sound is cut into segments, from 0 to its length: the inflection points of the smoothed
    /// flux. Of those too near to one another the steepest stays; segments that are too long are cut evenly.
    ///
    /// # Errors
    /// Those of [`Extraction::extract_recording`].
    pub fn cuts(&self, samples: &[f32], rate_hz: u32) -> Result<Vec<usize>> {
        let flux = self.flux(samples, rate_hz)?;
        let rate = f64::from(rate_hz);
        let hop = self.hop(rate_hz);
        let smooth = flux::smoothed(&flux, self.smoothing_s * rate / hop as f64);
        let mut found = flux::inflections(&smooth);
        found.sort_by(|a, b| b.slope.total_cmp(&a.slope).then(a.place.total_cmp(&b.place)));
        let length = samples.len();
        let shortest = ((self.shortest_s * rate).round() as usize).max(1);
        let longest = ((self.longest_s * rate).round() as usize).max(2 * shortest);
        let mut kept = BTreeSet::from([0, length]);
        for inflection in found {
            // The change from one frame to the next is between their centres.
            let at = ((inflection.place - 0.5) * hop as f64).round().max(0.0) as usize;
            let before = kept.range(..=at).next_back();
            let after = kept.range(at..).next();
            let is_free =
                before.is_some_and(|b| at - b >= shortest) && after.is_some_and(|a| a - at >= shortest);
            if is_free {
                kept.insert(at);
            }
        }
        let kept: Vec<usize> = kept.into_iter().collect();
        let mut cuts = vec![0];
        for pair in kept.windows(2) {
            let span = pair[1] - pair[0];
            let parts = span.div_ceil(longest);
            cuts.extend((1..=parts).map(|part| pair[0] + span * part / parts));
        }
        Ok(cuts)
    }

    /// The spectral flux: for each frame the Euclidean distance of its magnitude spectrum from that of the frame before,
    /// both of Euclidean length 1; 0 for the first. Frame m is centred on sample m · hop. A frame that is 100 dB
    /// quieter than the loudest has a spectrum of zeros.
    ///
    /// # Errors
    /// Those of [`Extraction::extract_recording`].
    pub fn flux(&self, samples: &[f32], rate_hz: u32) -> Result<Vec<f64>> {
        check_sound(samples, rate_hz)?;
        self.check()?;
        let frame = ((self.frame_s * f64::from(rate_hz)).round() as usize).max(4);
        Ok(flux::flux(samples, frame, self.hop(rate_hz)))
    }

    fn hop(&self, rate_hz: u32) -> usize {
        ((self.hop_s * f64::from(rate_hz)).round() as usize).max(1)
    }

    pub(super) fn check(&self) -> Result<()> {
        let times = [("frame_s", self.frame_s), ("hop_s", self.hop_s), ("shortest_s", self.shortest_s)];
        if let Some((name, value)) = times.into_iter().find(|(_, v)| !(1e-5..=10.0).contains(v)) {
            return Err(Error::new(format!("{name} is {value}, expected 0.00001 to 10 seconds")));
        }
        if !(0.0..=10.0).contains(&self.smoothing_s) {
            return Err(Error::new(format!("smoothing_s is {}, expected 0 to 10 seconds", self.smoothing_s)));
        }
        if !(self.longest_s >= 2.0 * self.shortest_s && self.longest_s <= 100.0) {
            return Err(Error::new(format!(
                "longest_s is {}, expected at least twice shortest_s, which is {}, and at most 100 seconds",
                self.longest_s, self.shortest_s
            )));
        }
        if !(0.0..=1.0).contains(&self.taper) {
            return Err(Error::new(format!("taper is {}, expected 0 to 1", self.taper)));
        }
        if self.threshold_db.is_nan() || self.threshold_db > 0.0 {
            return Err(Error::new(format!("threshold_db is {}, expected 0 or less", self.threshold_db)));
        }
        Ok(())
    }
}

pub(super) fn energy(samples: &[f32]) -> f64 {
    samples.iter().map(|&v| f64::from(v).powi(2)).sum()
}

/// A Tukey window whose mean square is 1: cosine tapers over a share of it, half at each end, and flat between.
pub fn tukey(length: usize, taper: f64) -> Vec<f64> {
    let last = length.saturating_sub(1) as f64;
    let edge = taper * last / 2.0;
    let plain: Vec<f64> = (0..length)
        .map(|i| {
            let from_end = (i as f64).min(last - i as f64);
            if from_end < edge { 0.5 * (1.0 - (std::f64::consts::PI * from_end / edge).cos()) } else { 1.0 }
        })
        .collect();
    let mean_square = plain.iter().map(|w| w * w).sum::<f64>() / length.max(1) as f64;
    if mean_square <= 0.0 {
        return plain;
    }
    let scale = mean_square.sqrt().recip();
    plain.into_iter().map(|w| w * scale).collect()
}

/// The mean frequency of a sound, weighted by the magnitudes of its spectrum; 0 for silence.
pub(super) fn centroid_hz(samples: &[f32], rate_hz: u32, planner: &mut RealFftPlanner<f64>) -> f64 {
    let size = samples.len().next_power_of_two().max(2);
    let fft = planner.plan_fft_forward(size);
    let mut input = fft.make_input_vec();
    input.iter_mut().zip(samples).for_each(|(to, from)| *to = f64::from(*from));
    let mut bins = fft.make_output_vec();
    // The transform fails for wrong lengths alone, and these are the plan's own.
    let done = fft.process(&mut input, &mut bins);
    debug_assert!(done.is_ok());
    let (mut sum, mut moment) = (0.0, 0.0);
    for (k, bin) in bins.iter().enumerate() {
        let magnitude = bin.norm();
        sum += magnitude;
        moment += k as f64 * magnitude;
    }
    if sum > 0.0 { moment / sum * f64::from(rate_hz) / size as f64 } else { 0.0 }
}
