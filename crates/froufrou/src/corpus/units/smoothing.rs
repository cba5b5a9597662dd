//! Features smoothed over time, each dimension under a Gaussian of its own.
//!
//! A width is four standard deviations, after the paper; the Gaussian is cut off at four standard deviations either side.
//! Before the first unit and after the last, the features are taken to stay as they are there.
//!
//! [`smooth`] has all of a sound, a [`Smoother`] unit by unit as it comes, with the same bits.

mod stream;

use rayon::prelude::*;

use super::features::Features;

pub use stream::Smoother;

/// How many units a thread does at a time.
const STRETCH: usize = 4096;

/// Where a Gaussian is cut off, in standard deviations.
const TRUNCATE: f64 = 4.0;

/// Features under Gaussians of these widths, in units. Dimension n has width n, counted round where there are more
/// dimensions than widths, as where channels stand side by side. A width of 0 changes nothing, and so do no widths.
pub fn smooth(features: &Features, widths: &[f64]) -> Features {
    let (dimensions, units) = (features.dimensions(), features.len());
    if widths.iter().all(|width| *width <= 0.0) || units == 0 {
        return features.clone();
    }
    let kernels: Vec<Vec<f64>> = widths.iter().map(|width| kernel(width / 4.0)).collect();
    let mut values = vec![0.0f32; features.values().len()];
    values.par_chunks_mut(STRETCH * dimensions).enumerate().for_each(|(stretch, values)| {
        let from = stretch * STRETCH;
        let to = (from + STRETCH).min(units);
        let mut line = Vec::new();
        for dimension in 0..dimensions {
            let kernel = &kernels[dimension % kernels.len()];
            let reach = kernel.len() / 2;
            line.clear();
            let within = |i: usize| (from + i).saturating_sub(reach).min(units - 1);
            line.extend(
                (0..to - from + 2 * reach)
                    .map(|i| f64::from(features.values()[within(i) * dimensions + dimension])),
            );
            for (row, around) in values.chunks_exact_mut(dimensions).zip(line.windows(kernel.len())) {
                row[dimension] = under(kernel, around);
            }
        }
    });
    Features::new(dimensions, values)
}

/// What lies under a kernel.
fn under(kernel: &[f64], around: &[f64]) -> f32 {
    around.iter().zip(kernel).map(|(v, k)| v * k).sum::<f64>() as f32
}

/// How many units a Gaussian of a width reaches either side.
pub fn reach(width: f64) -> usize {
    (TRUNCATE * width.max(0.0) / 4.0 + 0.5) as usize
}

fn kernel(deviation: f64) -> Vec<f64> {
    let reach = reach(4.0 * deviation) as i64;
    if reach == 0 {
        return vec![1.0];
    }
    let value = |i: i64| (-0.5 * (i as f64 / deviation).powi(2)).exp();
    let sum: f64 = (-reach..=reach).map(value).sum();
    (-reach..=reach).map(|i| value(i) / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::corpus::units::features::tests::fixture;

    /// Equals SciPy's `gaussian_filter1d` with `mode="nearest", truncate=4`, from `oracles/mfcc_golden.py`.
    #[test]
    fn equals_scipy() {
        let input = fixture("smooth_in");
        let plain = Features::new(3, input.iter().map(|v| *v as f32).collect());
        let smooth = smooth(&plain, &[20.0, 50.0, 10.0]);
        let wanted = fixture("smooth_out");
        assert_eq!((wanted.len(), wanted.len() / 3), (smooth.values().len(), 120));
        for (ours, theirs) in smooth.values().iter().zip(&wanted) {
            assert!((f64::from(*ours) - theirs).abs() < 2e-6, "{ours} {theirs}");
        }
    }

    #[test]
    fn what_is_even_stays_and_time_does_not_matter() {
        let even = Features::new(2, vec![3.5; 2 * 9000]);
        assert!(smooth(&even, &[40.0, 12.0]).values().iter().all(|v| (v - 3.5).abs() < 1e-6));
        // A pulse is smoothed alike wherever stretches end.
        let pulse = |at: usize| {
            let mut values = vec![0.0; 9000];
            values[at] = 1.0;
            smooth(&Features::new(1, values), &[30.0])
        };
        let (here, there) = (pulse(4000), pulse(4100));
        for i in 3900..4100 {
            assert_eq!(here.row(i), there.row(i + 100));
        }
        let sum: f32 = here.values().iter().sum();
        assert!((sum - 1.0).abs() < 1e-5);
        assert_eq!(smooth(&even, &[]), even);
        assert_eq!(smooth(&Features::new(2, Vec::new()), &[4.0, 4.0]).len(), 0);
    }

    #[test]
    fn channels_side_by_side_are_smoothed_alike() {
        let random = crate::random::Random::new(1, 0);
        let one = Features::new(2, (0..200).map(|i| random.uniform(i) as f32).collect());
        let both = Features::side_by_side(&[one.clone(), one.clone()]);
        let smoothed = smooth(&one, &[8.0, 16.0]);
        assert_eq!(smooth(&both, &[8.0, 16.0]), Features::side_by_side(&[smoothed.clone(), smoothed]));
    }
}
