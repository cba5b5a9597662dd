//! A thin-plate spline that carries features of a target to where recordings have theirs.
//!
//! W(f) = f + Δf(f), and in each dimension l
//!
//! ```text
//! Δf_l(f) = A₀l + Σ_k A_kl f_k + Σ_n w_nl U(‖f − f_n‖),   U(r) = r² log r²,
//! ```
//!
//! over the points f_n of correspondences. With K_mn = U(‖f_m − f_n‖), P the rows (1, f_n) and v what Δf should be at the
//! points, (K + λ' I) w + P a = v and Pᵀ w = 0 (Belongie et al. 2002, eq. 10), where λ' is λ times the mean squared
//! distance of two points: so λ means the same however features are scaled. λ = 0 goes through all points.
//!
//! | points | what the warp is |
//! | --- | --- |
//! | none | the identity |
//! | one, or all at one place | a translation |
//! | on a line, a plane ... | affine along it besides the bending, and constant across it |
//! | several at one place | one at their mean displacement, which weighs as many (for λ = 0: which is gone through) |
//!
//! U is conditionally positive definite of order 2 whatever the dimension: across the space of P, K is positive definite.
//! So the system is solved by reflecting P into its first rows and a Cholesky decomposition of the rest, n³/3
//! multiplications for n places.

mod file;
mod solve;

use rayon::prelude::*;

use self::solve::{Cholesky, Reflections, principal};
use super::features::Features;
use super::settings::{FeatureSettings, Settings};
use crate::error::{Error, Result};

pub use file::{Clip, WarpFile};

/// The most places of a warp: their matrix takes 8 bytes for each pair.
pub const MOST_PLACES: usize = 8192;

/// A direction in which points spread less than this share of their widest spread is none.
const LEAST_SPREAD: f64 = 1e-9;

/// A fitted warp.
#[derive(Debug, Clone, PartialEq)]
pub struct Warp {
    dimensions: usize,
    /// Places, row by row.
    places: Vec<f64>,
    /// What bends at each place, row by row; as many as places, or none.
    weights: Vec<f64>,
    /// A₀.
    offset: Vec<f64>,
    /// A, a row for each dimension of the displacement.
    linear: Vec<f64>,
}

/// U(r), of r².
fn bend(squared: f64) -> f64 {
    if squared > 0.0 { squared * squared.ln() } else { 0.0 }
}

fn squared_distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

impl Warp {
    /// The warp that moves nothing.
    pub fn identity(dimensions: usize) -> Self {
        Self {
            dimensions,
            places: Vec::new(),
            weights: Vec::new(),
            offset: vec![0.0; dimensions],
            linear: vec![0.0; dimensions * dimensions],
        }
    }

    /// Fits a warp to points and what they should be moved to, both row by row.
    ///
    /// # Errors
    /// Numbers that are not finite, lists that are not equally long, too many places, or a system that is singular to
    /// rounding, as where λ is 0 and places nearly fall together.
    pub fn fit(dimensions: usize, points: &[f64], targets: &[f64], lambda: f64) -> Result<Self> {
        let d = dimensions;
        if d == 0 || points.len() != targets.len() || !points.len().is_multiple_of(d) {
            return Err(Error::new(format!(
                "{} coordinates of points and {} of where they go do not make pairs of {d} dimensions",
                points.len(),
                targets.len()
            )));
        }
        if !(lambda >= 0.0 && lambda.is_finite()) {
            return Err(Error::new(format!("lambda is {lambda}, expected 0 or more")));
        }
        if let Some(value) = points.iter().chain(targets).find(|value| !value.is_finite()) {
            return Err(Error::new(format!("a coordinate of a correspondence is {value}")));
        }
        if points.is_empty() {
            return Ok(Self::identity(d));
        }
        let Merged { places, displacements, counts, mean_squared } = merge(d, points, targets);
        let n = counts.len();
        if n > MOST_PLACES {
            return Err(Error::new(format!("{n} places are more than {MOST_PLACES}"))
                .help("name fewer or shorter correspondences"));
        }
        let (centre, axes) = principal(d, &places, LEAST_SPREAD);
        let rank = axes.len();
        let m = rank + 1;
        // P in coordinates in which it has full rank.
        let along = |place: &[f64], axis: &[f64]| -> f64 {
            place.iter().zip(&centre).zip(axis).map(|((p, c), a)| (p - c) * a).sum()
        };
        let mut columns = vec![vec![1.0; n]];
        columns
            .extend(axes.iter().map(|axis| places.chunks_exact(d).map(|place| along(place, axis)).collect()));
        let reflections = Reflections::new(columns);
        let mut kernel: Vec<f64> = vec![0.0; n * n];
        let stiffness = lambda * mean_squared;
        kernel.par_chunks_mut(n).enumerate().for_each(|(i, row)| {
            let here = &places[i * d..][..d];
            for (value, there) in row.iter_mut().zip(places.chunks_exact(d)) {
                *value = bend(squared_distance(here, there));
            }
            row[i] += stiffness / counts[i];
        });
        let mut turned = kernel.clone();
        reflections.both_sides(&mut turned, n);
        let cholesky = Cholesky::new(&turned, n, m).map_err(|e| {
            e.help("some correspondences nearly fall together: leave some out, or give the warp a lambda above 0")
        })?;
        drop(turned);
        let mut warp = Self::identity(d);
        let mut weights = vec![0.0; n * d];
        for l in 0..d {
            let wanted: Vec<f64> = displacements.chunks_exact(d).map(|row| row[l]).collect();
            let mut w = wanted.clone();
            reflections.apply(&mut w);
            cholesky.solve(&mut w[m..]);
            w[..m].fill(0.0);
            reflections.apply_back(&mut w);
            let mut rest: Vec<f64> = kernel
                .par_chunks(n)
                .zip(&wanted)
                .map(|(row, wanted)| wanted - row.iter().zip(&w).map(|(k, w)| k * w).sum::<f64>())
                .collect();
            reflections.apply(&mut rest);
            let affine = reflections.back_substitute(&rest[..m]);
            for (slope, axis) in affine[1..].iter().zip(&axes) {
                for (k, a) in axis.iter().enumerate() {
                    warp.linear[l * d + k] += slope * a;
                }
            }
            let moved: f64 = warp.linear[l * d..][..d].iter().zip(&centre).map(|(a, c)| a * c).sum();
            warp.offset[l] = affine[0] - moved;
            weights.iter_mut().skip(l).step_by(d).zip(&w).for_each(|(to, from)| *to = *from);
        }
        // As many places as the affine part has freedoms leave nothing to bend.
        if n > m {
            (warp.places, warp.weights) = (places, weights);
        }
        if warp.weights.iter().chain(&warp.offset).chain(&warp.linear).any(|value| !value.is_finite()) {
            return Err(Error::new("the warp cannot be told from rounding")
                .help("leave some correspondences out, or give the warp a lambda above 0"));
        }
        Ok(warp)
    }

    /// How many numbers a unit has.
    pub fn dimensions(&self) -> usize {
        self.dimensions
    }

    /// How many places bend it.
    pub fn places(&self) -> usize {
        self.places.len() / self.dimensions.max(1)
    }

    /// Where a unit's features go. All three have the warp's dimensions.
    pub fn apply(&self, from: &[f64], to: &mut [f64]) {
        let d = self.dimensions;
        for (l, to) in to.iter_mut().enumerate() {
            let straight: f64 = self.linear[l * d..][..d].iter().zip(from).map(|(a, f)| a * f).sum();
            *to = from[l] + self.offset[l] + straight;
        }
        for (place, weights) in self.places.chunks_exact(d).zip(self.weights.chunks_exact(d)) {
            let bend = bend(squared_distance(from, place));
            for (to, weight) in to.iter_mut().zip(weights) {
                *to += weight * bend;
            }
        }
    }

    /// Where the features of all units go, row by row, on all cores.
    ///
    /// # Errors
    /// Features that have other dimensions, or go beyond what numbers hold.
    pub fn apply_all(&self, features: &Features) -> Result<Vec<f64>> {
        let d = self.dimensions;
        if features.dimensions() != d {
            return Err(Error::new(format!(
                "the warp is of {d} dimensions, the features have {}",
                features.dimensions()
            )));
        }
        let mut out = vec![0.0; features.len() * d];
        out.par_chunks_mut(d).zip(features.values().par_chunks(d)).for_each(|(to, row)| {
            let from: Vec<f64> = row.iter().map(|v| f64::from(*v)).collect();
            self.apply(&from, to);
        });
        match out.iter().any(|value| !value.is_finite()) {
            true => Err(Error::new("the warp carries features beyond all numbers")),
            false => Ok(out),
        }
    }
}

/// Points of which no two are at one place.
struct Merged {
    places: Vec<f64>,
    displacements: Vec<f64>,
    /// How many points each place stands for.
    counts: Vec<f64>,
    /// Of two different points, coincident or not.
    mean_squared: f64,
}

fn merge(d: usize, points: &[f64], targets: &[f64]) -> Merged {
    let n = points.len() / d;
    let row = |i: usize| &points[i * d..][..d];
    let compare = |a: &usize, b: &usize| {
        let mut pairs = row(*a).iter().zip(row(*b));
        pairs.find_map(|(a, b)| Some(a.total_cmp(b)).filter(|o| o.is_ne())).unwrap_or(a.cmp(b))
    };
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(compare);
    let mut first_of = vec![0; n];
    for (at, &i) in order.iter().enumerate() {
        let same = at.checked_sub(1).map(|before| order[before]).filter(|&before| row(before) == row(i));
        first_of[i] = same.map_or(i, |before| first_of[before]);
    }
    let mut place_of = vec![usize::MAX; n];
    let mut merged =
        Merged { places: Vec::new(), displacements: Vec::new(), counts: Vec::new(), mean_squared: 0.0 };
    for i in 0..n {
        let first = first_of[i];
        if place_of[first] == usize::MAX {
            place_of[first] = merged.counts.len();
            merged.places.extend_from_slice(row(i));
            merged.displacements.extend(std::iter::repeat_n(0.0, d));
            merged.counts.push(0.0);
        }
        let place = place_of[first];
        merged.counts[place] += 1.0;
        let sums = &mut merged.displacements[place * d..][..d];
        for ((sum, to), from) in sums.iter_mut().zip(&targets[i * d..][..d]).zip(row(i)) {
            *sum += to - from;
        }
    }
    for (row, count) in merged.displacements.chunks_exact_mut(d).zip(&merged.counts) {
        row.iter_mut().for_each(|value| *value /= count);
    }
    // Σ over pairs of ‖a − b‖² = n Σ ‖a − mean‖².
    let mean: Vec<f64> = (0..d).map(|k| points.iter().skip(k).step_by(d).sum::<f64>() / n as f64).collect();
    let spread: f64 = points.chunks_exact(d).map(|point| squared_distance(point, &mean)).sum();
    merged.mean_squared = if n > 1 { 2.0 * spread / (n - 1) as f64 } else { 0.0 };
    merged
}

/// What features a warp is of: those that a corpus must have for it to make sense there.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Basis {
    /// Samples a second.
    pub rate_hz: u32,
    /// Widths of the Gaussians that smooth.
    pub widths: Vec<f64>,
    /// How units become features.
    pub features: FeatureSettings,
}

impl Basis {
    /// That of a corpus.
    pub fn of(settings: &Settings, rate_hz: u32) -> Self {
        Self { rate_hz, widths: settings.widths.clone(), features: settings.features.clone() }
    }
}

#[cfg(test)]
mod tests;
