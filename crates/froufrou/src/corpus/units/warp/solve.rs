//! The linear algebra of warps.

use crate::error::{Error, Result};

/// A pivot smaller than this share of the largest is rounding.
const LEAST_PIVOT: f64 = 1e-13;

/// The mean of points and the orthonormal directions in which they spread, the widest first.
pub(super) fn principal(d: usize, points: &[f64], least_spread: f64) -> (Vec<f64>, Vec<Vec<f64>>) {
    let n = (points.len() / d).max(1) as f64;
    let mean: Vec<f64> = (0..d).map(|k| points.iter().skip(k).step_by(d).sum::<f64>() / n).collect();
    let mut covariance = vec![0.0; d * d];
    for point in points.chunks_exact(d) {
        for i in 0..d {
            for j in 0..d {
                covariance[i * d + j] += (point[i] - mean[i]) * (point[j] - mean[j]);
            }
        }
    }
    let (values, vectors) = eigen(d, covariance);
    let largest = values.iter().copied().fold(0.0, f64::max);
    // What rounding of the coordinates alone would spread.
    let size = points.iter().fold(0.0f64, |size, value| size.max(value.abs()));
    let rounding = n * (4.0 * f64::EPSILON * size).powi(2);
    let least = (largest * least_spread * least_spread).max(rounding);
    let mut order: Vec<usize> = (0..d).filter(|&i| values[i] > least).collect();
    order.sort_by(|&a, &b| values[b].total_cmp(&values[a]).then(a.cmp(&b)));
    let axes = order.into_iter().map(|i| (0..d).map(|k| vectors[k * d + i]).collect()).collect();
    (mean, axes)
}

/// Eigenvalues and eigenvectors (columns) of a symmetric matrix, by Jacobi's rotations.
fn eigen(d: usize, mut a: Vec<f64>) -> (Vec<f64>, Vec<f64>) {
    let mut v = vec![0.0; d * d];
    (0..d).for_each(|i| v[i * d + i] = 1.0);
    for _ in 0..64 {
        let off: f64 =
            (0..d).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| a[i * d + j].powi(2)).sum();
        let all: f64 = a.iter().map(|x| x * x).sum();
        if off <= all * 1e-32 {
            break;
        }
        for p in 0..d {
            for q in p + 1..d {
                let apq = a[p * d + q];
                if apq == 0.0 {
                    continue;
                }
                let theta = (a[q * d + q] - a[p * d + p]) / (2.0 * apq);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let t = if theta == 0.0 { 1.0 } else { t };
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for k in 0..d {
                    let (x, y) = (a[k * d + p], a[k * d + q]);
                    (a[k * d + p], a[k * d + q]) = (c * x - s * y, s * x + c * y);
                }
                for k in 0..d {
                    let (x, y) = (a[p * d + k], a[q * d + k]);
                    (a[p * d + k], a[q * d + k]) = (c * x - s * y, s * x + c * y);
                }
                for k in 0..d {
                    let (x, y) = (v[k * d + p], v[k * d + q]);
                    (v[k * d + p], v[k * d + q]) = (c * x - s * y, s * x + c * y);
                }
            }
        }
    }
    ((0..d).map(|i| a[i * d + i]).collect(), v)
}

/// Householder's reflections that turn a few columns of full rank into an upper triangle.
pub(super) struct Reflections {
    /// The vector of each, zero above its own row, with 2 / ‖v‖².
    vectors: Vec<(Vec<f64>, f64)>,
    /// The triangle, by columns.
    triangle: Vec<Vec<f64>>,
}

impl Reflections {
    pub fn new(mut columns: Vec<Vec<f64>>) -> Self {
        let mut reflections = Self { vectors: Vec::new(), triangle: Vec::new() };
        for k in 0..columns.len() {
            let mut v = columns[k].clone();
            v[..k].fill(0.0);
            let norm = dot(&v, &v).sqrt();
            v[k] += if v[k] < 0.0 { -norm } else { norm };
            let squared = dot(&v, &v);
            let scale = if squared > 0.0 { 2.0 / squared } else { 0.0 };
            for column in &mut columns[k..] {
                reflect(&v, scale, column);
            }
            reflections.vectors.push((v, scale));
            reflections.triangle.push(columns[k][..=k].to_vec());
        }
        reflections
    }

    /// Qᵀ x.
    pub fn apply(&self, x: &mut [f64]) {
        self.vectors.iter().for_each(|(v, scale)| reflect(v, *scale, x));
    }

    /// Q x.
    pub fn apply_back(&self, x: &mut [f64]) {
        self.vectors.iter().rev().for_each(|(v, scale)| reflect(v, *scale, x));
    }

    /// Qᵀ A Q of a symmetric matrix.
    pub fn both_sides(&self, a: &mut [f64], n: usize) {
        for (v, scale) in &self.vectors {
            // With u = s A v: A − v uᵀ − u vᵀ + s (vᵀ u) v vᵀ.
            let mut u: Vec<f64> = a.chunks_exact(n).map(|row| scale * dot(row, v)).collect();
            let half = 0.5 * scale * dot(v, &u);
            u.iter_mut().zip(v).for_each(|(u, v)| *u -= half * v);
            for ((row, vi), ui) in a.chunks_exact_mut(n).zip(v).zip(&u) {
                for ((value, vj), uj) in row.iter_mut().zip(v).zip(&u) {
                    *value -= vi * uj + ui * vj;
                }
            }
        }
    }

    /// Solves the triangle.
    pub fn back_substitute(&self, right: &[f64]) -> Vec<f64> {
        let mut x = right.to_vec();
        for k in (0..x.len()).rev() {
            x[k] /= self.triangle[k][k];
            let value = x[k];
            for (x, r) in x[..k].iter_mut().zip(&self.triangle[k]) {
                *x -= r * value;
            }
        }
        x
    }
}

fn reflect(v: &[f64], scale: f64, x: &mut [f64]) {
    let factor = scale * dot(v, x);
    x.iter_mut().zip(v).for_each(|(x, v)| *x -= factor * v);
}

/// A sum in eight lanes, which fill vector units.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0f64; 8];
    let (a8, a_rest) = a.as_chunks::<8>();
    let (b8, b_rest) = b.as_chunks::<8>();
    for (a, b) in a8.iter().zip(b8) {
        for ((lane, a), b) in lanes.iter_mut().zip(a).zip(b) {
            *lane += a * b;
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    lanes.iter().sum::<f64>() + rest
}

/// The lower triangle whose square is a positive definite matrix.
pub(super) struct Cholesky {
    size: usize,
    /// Row by row, each as long as the matrix is wide.
    lower: Vec<f64>,
}

impl Cholesky {
    /// Of the part of a matrix of n rows that lies beyond the first `skip` rows and columns.
    pub fn new(matrix: &[f64], n: usize, skip: usize) -> Result<Self> {
        let size = n.saturating_sub(skip);
        let mut lower = vec![0.0; size * size];
        for i in 0..size {
            lower[i * size..][..=i].copy_from_slice(&matrix[(i + skip) * n + skip..][..=i]);
        }
        let largest = (0..size).fold(0.0f64, |most, i| most.max(lower[i * size + i].abs()));
        for i in 0..size {
            let (above, row) = lower.split_at_mut(i * size);
            for j in 0..i {
                let other = &above[j * size..][..=j];
                row[j] = (row[j] - dot(&row[..j], &other[..j])) / other[j];
            }
            let pivot = row[i] - dot(&row[..i], &row[..i]);
            if pivot.is_nan() || pivot <= LEAST_PIVOT * largest {
                return Err(Error::new("the warp has no solution that could be told from rounding"));
            }
            row[i] = pivot.sqrt();
        }
        Ok(Self { size, lower })
    }

    /// Solves in place.
    pub fn solve(&self, x: &mut [f64]) {
        let n = self.size;
        for i in 0..n {
            let row = &self.lower[i * n..][..=i];
            x[i] = (x[i] - dot(&row[..i], &x[..i])) / row[i];
        }
        for i in (0..n).rev() {
            let row = &self.lower[i * n..][..=i];
            x[i] /= row[i];
            let value = x[i];
            x[..i].iter_mut().zip(row).for_each(|(x, l)| *x -= l * value);
        }
    }
}
