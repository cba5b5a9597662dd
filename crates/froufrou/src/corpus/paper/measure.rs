//! Clips and spectra out of recordings.

use realfft::RealFftPlanner;

use super::{BINS, SPACING_HZ};
use crate::error::{Error, Result};

/// What is so far below the loudest 2 ms of a clip, 50 dB, is cut off its ends.
const FLOOR: f64 = 1e-5;

/// The time over which loudness is taken.
const LOUD_S: f64 = 0.002;

/// How a clip fades in and out.
const FADES_S: [f64; 2] = [0.001, 0.005];

/// A clip as it is played.
#[derive(Debug, Clone, PartialEq)]
pub struct Cut {
    /// The first sample that was kept.
    pub first: usize,
    /// What was kept, faded at both ends, as loud as it was.
    pub samples: Vec<f32>,
    /// From its beginning to the middle of its loudest 2 ms.
    pub lead_s: f64,
}

/// Cuts the silence off a clip.
///
/// # Errors
/// A clip that is silent.
pub fn trimmed(samples: &[f32], rate_hz: f64) -> Result<Cut> {
    let half = ((0.5 * LOUD_S * rate_hz) as usize).max(1);
    let mut sums = vec![0.0f64];
    for sample in samples {
        sums.push(sums[sums.len() - 1] + f64::from(*sample).powi(2));
    }
    let loud = |n: usize| {
        let (from, to) = (n.saturating_sub(half), (n + half).min(samples.len()));
        (sums[to] - sums[from]).max(0.0)
    };
    let loudest = (0..samples.len()).map(loud).fold(0.0, f64::max);
    if loudest <= 0.0 {
        return Err(Error::new("the clip is silent"));
    }
    let kept = |n: &usize| loud(*n) >= FLOOR * loudest;
    let first = (0..samples.len()).find(kept).unwrap_or(0);
    let last = (0..samples.len()).rev().find(kept).unwrap_or(0);
    let [rise, fall] = FADES_S.map(|s| (s * rate_hz).ceil());
    let first = first.saturating_sub(rise as usize);
    let end = (last + 1 + fall as usize).min(samples.len());
    let mut kept = samples[first..end].to_vec();
    let count = kept.len() as f64;
    // A clip that is shorter than its fades fades by as much of each as there is room for.
    let (rise, fall) = (rise.min(0.25 * count).max(1.0), fall.min(0.5 * count).max(1.0));
    for (n, sample) in kept.iter_mut().enumerate() {
        let smooth = |x: f64| x.min(1.0).powi(2) * (3.0 - 2.0 * x.min(1.0));
        let (before, after) = ((n as f64 + 0.5) / rise, (count - n as f64 - 0.5) / fall);
        *sample = (f64::from(*sample) * smooth(before) * smooth(after)) as f32;
    }
    let peak = (first..end).max_by(|a, b| loud(*a).total_cmp(&loud(*b)).then(b.cmp(a))).unwrap_or(first);
    Ok(Cut { first, samples: kept, lead_s: (peak - first) as f64 / rate_hz })
}

/// The mean amplitude density of a take of friction, in full scale by √Hz for each m/s, at [`BINS`] multiples of [`SPACING_HZ`]. It is
/// that of the mean power, so that its level is the take's.
///
/// # Errors
/// A take shorter than a frame (0.1 s), or a silent one.
pub fn density(samples: &[f32], rate_hz: f64, speed_mps: f64) -> Result<Vec<f64>> {
    let length = (rate_hz / SPACING_HZ).round() as usize;
    if samples.len() < length {
        let found_s = samples.len() as f64 / rate_hz;
        return Err(Error::new(format!(
            "the take is {found_s:.3} s long, expected at least {:.3} s",
            length as f64 / rate_hz
        )));
    }
    let forward = RealFftPlanner::<f64>::new().plan_fft_forward(length);
    let (mut input, mut output) = (forward.make_input_vec(), forward.make_output_vec());
    let window: Vec<f64> = (0..length)
        .map(|n| (std::f64::consts::PI * (n as f64 + 0.5) / length as f64).sin().powi(2))
        .collect();
    let squares: f64 = window.iter().map(|w| w * w).sum();
    let mut mean = vec![0.0f64; length / 2 + 2];
    let mut frames = 0.0;
    for frame in (0..=samples.len() - length).step_by((length / 2).max(1)) {
        for ((input, window), sample) in input.iter_mut().zip(&window).zip(&samples[frame..]) {
            *input = window * f64::from(*sample);
        }
        // The lengths are those that the transform asked for.
        if forward.process(&mut input, &mut output).is_ok() {
            mean.iter_mut().zip(&output).for_each(|(mean, bin)| *mean += bin.norm_sqr());
            frames += 1.0;
        }
    }
    let scale = 2.0 / (rate_hz * squares * frames);
    let own_hz = rate_hz / length as f64;
    let density: Vec<f64> = (1..=BINS)
        .map(|k| {
            // A frame of a whole number of samples hardly ever has exactly the spacing.
            let place = k as f64 * SPACING_HZ / own_hz;
            let low = (place + 1e-9).floor();
            let along = (place - low).max(0.0);
            let power = |bin: f64| mean.get(bin as usize).copied().unwrap_or(0.0);
            (scale * (power(low) * (1.0 - along) + power(low + 1.0) * along)).sqrt() / speed_mps
        })
        .collect();
    if density.iter().all(|value| *value == 0.0) {
        return Err(Error::new("the take is silent"));
    }
    Ok(density)
}

/// How long the middle 90 % of a sound's energy last, in seconds.
pub fn lasts_s(samples: &[f32], rate_hz: f64) -> f64 {
    let whole: f64 = samples.iter().map(|v| f64::from(*v).powi(2)).sum();
    let place = |share: f64| {
        let mut sum = 0.0;
        let reached = samples.iter().position(|v| {
            sum += f64::from(*v).powi(2);
            sum >= share * whole
        });
        reached.unwrap_or(samples.len()) as f64 / rate_hz
    };
    place(0.95) - place(0.05)
}
