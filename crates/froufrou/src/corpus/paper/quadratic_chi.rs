//! How unlike two spectra are: the quadratic-chi distance of histograms (Pele & Werman 2010).
//!
//! ```text
//! QC(P, Q) = √ Σ_ij (P_i − Q_i) / (Σ_c (P_c + Q_c) A_ci)^m · (P_j − Q_j) / (Σ_c (P_c + Q_c) A_cj)^m · A_ij
//! ```
//!
//! A tells which bins are alike: here A_ij = max(0, 1 − |i − j| / reach), so that what moves by a bin counts less than what moves
//! far. With m = 0 and A = 1 it is the Euclidean distance, with m = ½ and A = 1 the square root of twice the χ² distance.

use crate::error::{Error, Result};

/// The normalisation m of [`distance`]: that of the χ² distance.
pub const NORMALISATION: f64 = 0.5;

/// The distance of two histograms with as many bins.
///
/// # Errors
/// Histograms of different lengths, values that are negative or not finite, a reach below 1 or m outside of 0 to below 1.
pub fn quadratic_chi(p: &[f64], q: &[f64], reach: usize, m: f64) -> Result<f64> {
    if p.len() != q.len() {
        return Err(Error::new(format!("two histograms have {} and {} bins", p.len(), q.len())));
    }
    if let Some(bad) = p.iter().chain(q).find(|v| !(v.is_finite() && **v >= 0.0)) {
        return Err(Error::new(format!("a bin of a histogram is {bad}, expected 0 or more")));
    }
    if reach == 0 || !(0.0..1.0).contains(&m) {
        return Err(Error::new(format!(
            "the reach is {reach} bins and m is {m}, expected 1 or more and 0 to 1"
        )));
    }
    let count = p.len();
    let near = |i: usize| i.saturating_sub(reach - 1)..(i + reach).min(count);
    let alike = |i: usize, j: usize| 1.0 - i.abs_diff(j) as f64 / reach as f64;
    let scaled: Vec<f64> = (0..count)
        .map(|i| {
            let whole: f64 = near(i).map(|c| (p[c] + q[c]) * alike(c, i)).sum();
            // Where both are empty all about, there is no difference either: 0 / 0 counts as 0.
            if whole > 0.0 { (p[i] - q[i]) / whole.powf(m) } else { 0.0 }
        })
        .collect();
    let sum: f64 =
        (0..count).map(|i| scaled[i] * near(i).map(|j| scaled[j] * alike(i, j)).sum::<f64>()).sum();
    // Not below 0 but for rounding, as A is positive semidefinite.
    Ok(sum.max(0.0).sqrt())
}

/// Bands of a spectrum's histogram to an octave, and from which frequency on.
pub const BANDS: usize = 12;
const FROM_HZ: f64 = 80.0;

/// How many octaves it has.
pub const OCTAVES: usize = 8;

/// Bins that are alike reach so far: an octave.
pub const REACH: usize = 12;

/// The lower edge of a band of a histogram.
pub fn edge_hz(band: usize) -> f64 {
    FROM_HZ * 2.0f64.powf(band as f64 / BANDS as f64)
}

/// The histogram of a magnitude spectrum: its magnitudes in twelfths of an octave from 80 Hz to 20 kHz, whose sum is 1. Silence
/// gives zeros.
pub fn histogram(magnitudes: &[f64], spacing_hz: f64) -> Vec<f64> {
    let mut below = vec![0.0];
    for value in magnitudes {
        below.push(below[below.len() - 1] + value);
    }
    // Value k lies at k + 1 and is as wide as the spacing; of a band that is narrower a part of it is taken.
    let integral = |place: f64| {
        let at = (place - 0.5).clamp(0.0, magnitudes.len() as f64);
        let whole = at as usize;
        below[whole] + magnitudes.get(whole).map_or(0.0, |value| value * (at - whole as f64))
    };
    let edge = |band: usize| integral(edge_hz(band) / spacing_hz);
    let mut bands: Vec<f64> = (0..BANDS * OCTAVES).map(|band| edge(band + 1) - edge(band)).collect();
    let sum: f64 = bands.iter().sum();
    if sum > 0.0 {
        bands.iter_mut().for_each(|band| *band /= sum);
    }
    bands
}

/// How unlike two magnitude spectra are, each with values at multiples of its spacing. Levels do not matter.
///
/// # Errors
/// Magnitudes that are negative or not finite.
pub fn distance(a: (&[f64], f64), b: (&[f64], f64)) -> Result<f64> {
    quadratic_chi(&histogram(a.0, a.1), &histogram(b.0, b.1), REACH, NORMALISATION)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(serde::Deserialize)]
    struct Case {
        p: Vec<f64>,
        q: Vec<f64>,
        reach: usize,
        m: f64,
        distance: f64,
    }

    #[derive(serde::Deserialize)]
    struct Golden {
        cases: Vec<Case>,
        magnitudes: Vec<f64>,
        spacing_hz: f64,
        histogram: Vec<f64>,
    }

    fn golden() -> Golden {
        let text = std::fs::read_to_string("tests/fixtures/paper/quadratic_chi.json").unwrap();
        serde_json::from_str(&text).unwrap()
    }

    #[test]
    fn agrees_with_numpy() {
        let golden = golden();
        assert_eq!(golden.cases.len(), 5);
        for case in &golden.cases {
            let found = quadratic_chi(&case.p, &case.q, case.reach, case.m).unwrap();
            assert!((found / case.distance - 1.0).abs() < 1e-8, "{found} {}", case.distance);
        }
        let found = histogram(&golden.magnitudes, golden.spacing_hz);
        assert_eq!(found.len(), golden.histogram.len());
        for (found, wanted) in found.iter().zip(&golden.histogram) {
            assert!((found - wanted).abs() < 1e-9, "{found} {wanted}");
        }
    }

    #[test]
    fn it_is_a_distance_and_grows_with_how_far_bins_move() {
        let Case { p, q, .. } = golden().cases.swap_remove(1);
        assert_eq!(quadratic_chi(&p, &p, 5, 0.5).unwrap(), 0.0);
        assert_eq!(quadratic_chi(&p, &q, 5, 0.5).unwrap(), quadratic_chi(&q, &p, 5, 0.5).unwrap());
        let peak = |at: usize| (0..40).map(|k| f64::from(u8::from(k == at))).collect::<Vec<f64>>();
        let moved = |by: usize| quadratic_chi(&peak(10), &peak(10 + by), 12, 0.5).unwrap();
        assert!((1..12).all(|by| moved(by) < moved(by + 1)));
        // Beyond its reach all is as far.
        assert!((moved(24) - moved(29)).abs() < 1e-12);
        // With no reach and m = 0 it is Euclid's.
        assert!((quadratic_chi(&peak(1), &peak(5), 1, 0.0).unwrap() - 2.0f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn what_is_no_histogram_is_refused() {
        assert!(quadratic_chi(&[1.0], &[1.0, 2.0], 1, 0.5).is_err());
        assert!(quadratic_chi(&[1.0], &[-1.0], 1, 0.5).is_err());
        assert!(quadratic_chi(&[1.0], &[f64::NAN], 1, 0.5).is_err());
        assert!(quadratic_chi(&[1.0], &[1.0], 0, 0.5).is_err());
        assert!(quadratic_chi(&[1.0], &[1.0], 1, 1.0).is_err());
        assert_eq!(distance((&[0.0; 9], 10.0), (&[], 10.0)).unwrap(), 0.0);
    }
}
