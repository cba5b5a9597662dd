//! How much the spectrum changes, and where that bends over.

use std::f64::consts::TAU;

use rayon::prelude::*;
use realfft::RealFftPlanner;

/// Frames whose power is lower than this share of the loudest frame's are silent.
const SILENT: f64 = 1e-10;

/// The least slope of the flux, a frame, at which it is said to bend: less is rounding.
const LEAST_SLOPE: f64 = 1e-6;

/// How many frames a thread does at a time; it begins with one more, which the first is compared with.
const STRETCH: usize = 256;

/// A place where the flux has its steepest slope.
pub(super) struct Inflection {
    /// In frames.
    pub place: f64,
    /// How steep, a frame.
    pub slope: f64,
}

/// The distance of each frame's normalised magnitude spectrum from that before.
pub(super) fn flux(samples: &[f32], frame: usize, hop: usize) -> Vec<f64> {
    let window: Vec<f64> =
        (0..frame).map(|i| 0.5 - 0.5 * (TAU * (i as f64 + 0.5) / frame as f64).cos()).collect();
    let fft = RealFftPlanner::<f64>::new().plan_fft_forward(frame.next_power_of_two());
    let frames = (samples.len() - 1).div_ceil(hop) + 1;
    let first_of = |m: usize| (m * hop) as i64 - (frame / 2) as i64;
    let power = |m: usize| {
        let first = first_of(m);
        let from = first.max(0) as usize;
        let to = ((first + frame as i64) as usize).min(samples.len());
        let part = samples.get(from..to).unwrap_or_default();
        part.iter()
            .zip(&window[(from as i64 - first) as usize..])
            .map(|(v, w)| (f64::from(*v) * w).powi(2))
            .sum()
    };
    let powers: Vec<f64> = (0..frames).into_par_iter().map(power).collect();
    let silent = SILENT * powers.iter().copied().fold(0.0, f64::max);
    let stretches: Vec<Vec<f64>> = (0..frames.div_ceil(STRETCH))
        .into_par_iter()
        .map(|stretch| {
            let mut input = fft.make_input_vec();
            let mut bins = fft.make_output_vec();
            let mut scratch = fft.make_scratch_vec();
            let mut before: Vec<f64> = Vec::new();
            let mut here = vec![0.0; bins.len()];
            let from = (stretch * STRETCH).saturating_sub(1);
            let to = ((stretch + 1) * STRETCH).min(frames);
            let mut distances = Vec::with_capacity(to - from);
            for (m, &power) in powers.iter().enumerate().take(to).skip(from) {
                input.fill(0.0);
                let first = first_of(m);
                for (i, w) in window.iter().enumerate() {
                    if let Some(v) = usize::try_from(first + i as i64).ok().and_then(|at| samples.get(at)) {
                        input[i] = f64::from(*v) * w;
                    }
                }
                // The transform fails for wrong lengths alone, and these are the plan's own.
                let done = fft.process_with_scratch(&mut input, &mut bins, &mut scratch);
                debug_assert!(done.is_ok());
                let norm = bins.iter().map(|b| b.norm_sqr()).sum::<f64>().sqrt();
                let scale = if power > silent && norm > 0.0 { norm.recip() } else { 0.0 };
                here.iter_mut().zip(&bins).for_each(|(to, bin)| *to = scale * bin.norm());
                if before.is_empty() {
                    before.clone_from(&here);
                    if from > 0 {
                        continue;
                    }
                }
                let square: f64 = here.iter().zip(&before).map(|(a, b)| (a - b).powi(2)).sum();
                distances.push(square.sqrt());
                std::mem::swap(&mut before, &mut here);
            }
            distances
        })
        .collect();
    stretches.concat()
}

/// The flux under a Gaussian that is cut off at four standard deviations and normalised at the edges.
pub(super) fn smoothed(flux: &[f64], deviation: f64) -> Vec<f64> {
    if deviation <= 0.0 {
        return flux.to_vec();
    }
    let reach = (4.0 * deviation).ceil() as usize;
    let kernel: Vec<f64> = (0..=reach).map(|i| (-0.5 * (i as f64 / deviation).powi(2)).exp()).collect();
    (0..flux.len())
        .map(|m| {
            let (from, to) = (m.saturating_sub(reach), (m + reach + 1).min(flux.len()));
            let (mut sum, mut weight) = (0.0, 0.0);
            for (i, value) in flux[from..to].iter().enumerate() {
                let w = kernel[(from + i).abs_diff(m)];
                sum += w * value;
                weight += w;
            }
            sum / weight
        })
        .collect()
}

/// Where the second difference changes its sign, between two frames.
pub(super) fn inflections(flux: &[f64]) -> Vec<Inflection> {
    let bend = |m: usize| flux[m + 1] - 2.0 * flux[m] + flux[m - 1];
    (1..flux.len().saturating_sub(2))
        .filter_map(|m| {
            let (here, next) = (bend(m), bend(m + 1));
            let slope = (flux[m + 1] - flux[m]).abs();
            let changes = (here > 0.0 && next <= 0.0) || (here < 0.0 && next >= 0.0);
            (changes && slope > LEAST_SLOPE)
                .then(|| Inflection { place: m as f64 + here / (here - next), slope })
        })
        .collect()
}
