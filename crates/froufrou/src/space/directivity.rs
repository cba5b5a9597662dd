//! How loud a source is towards each side: real spherical harmonics up to order 3 (Takala & Hahn
//! 1992, §5.2).
//!
//! Coefficients are in the convention of AmbiX files: channels in ACN order (index n² + n + m),
//! harmonics in SN3D (∫ Y² over the sphere is 4π / (2n + 1), none exceeds 1), first axis ahead, second to
//! the left, third up. In the local frame of an object ahead is −Z, left −X and up +Y. So
//! `[0.5, 0, 0, 0.5]` is a cardioid that faces ahead.

use super::microphone::{NEAR_M, length};
use crate::scene::animation::Transform;

/// The number of harmonics up to order 3.
pub const HARMONICS: usize = 16;

/// The orders of the harmonics, in their order.
pub(crate) const ORDERS: [usize; HARMONICS] = [0, 1, 1, 1, 2, 2, 2, 2, 2, 3, 3, 3, 3, 3, 3, 3];

/// The real spherical harmonics in a direction, a unit vector (ahead, left, up): ACN order, SN3D.
///
/// ```
/// use froufrou::space::directivity::harmonics;
/// assert_eq!(harmonics([1.0, 0.0, 0.0])[..4], [1.0, 0.0, 0.0, 1.0]);
/// ```
pub fn harmonics([x, y, z]: [f64; 3]) -> [f64; HARMONICS] {
    let (root3, root15) = (3.0f64.sqrt(), 15.0f64.sqrt());
    let (root3_8, root5_8) = (0.375f64.sqrt(), 0.625f64.sqrt());
    let (xx, yy, zz) = (x * x, y * y, z * z);
    [
        1.0,
        y,
        z,
        x,
        root3 * x * y,
        root3 * y * z,
        0.5 * (3.0 * zz - 1.0),
        root3 * x * z,
        0.5 * root3 * (xx - yy),
        root5_8 * y * (3.0 * xx - yy),
        root15 * x * y * z,
        root3_8 * y * (5.0 * zz - 1.0),
        0.5 * z * (5.0 * zz - 3.0),
        root3_8 * x * (5.0 * zz - 1.0),
        0.5 * root15 * z * (xx - yy),
        root5_8 * x * (xx - 3.0 * yy),
    ]
}

/// The directivity of a source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Directivity {
    /// The weights of the harmonics, ACN order, SN3D.
    pub coefficients: [f64; HARMONICS],
}

impl Default for Directivity {
    fn default() -> Self {
        Self::OMNI
    }
}

impl Directivity {
    /// Equally loud all around.
    pub const OMNI: Self = Self::of([1.0, 0.0, 0.0, 0.0]);
    /// Loudest ahead, silent behind.
    pub const CARDIOID: Self = Self::of([0.5, 0.0, 0.0, 0.5]);
    /// As loud behind as ahead, silent at right angles: a plate that swings freely.
    pub const DIPOLE: Self = Self::of([0.0, 0.0, 0.0, 1.0]);

    const fn of(first: [f64; 4]) -> Self {
        let mut coefficients = [0.0; HARMONICS];
        let mut i = 0;
        while i < 4 {
            coefficients[i] = first[i];
            i += 1;
        }
        Self { coefficients }
    }

    /// A lobe ahead, ((1 + cos μ) / 2)^k, as near as order 3 comes to it (least squares over the
    /// sphere), scaled to 1 ahead. It is exact for k = 0, 1, 2 and 3; sharper ones grow small lobes at
    /// the sides. A `sharpness` k below 0, or one that is not a number, counts as 0.
    pub fn lobe(sharpness: f64) -> Self {
        let k = sharpness.clamp(0.0, 1e6).max(0.0);
        let ahead = harmonics([1.0, 0.0, 0.0]);
        // The Legendre series of the lobe: a_n = (2n + 1) k (k−1) … (k−n+1) / ((k+1) … (k+n+1)).
        let weight = |n: usize| {
            let falling: f64 = (0..n).map(|i| k - i as f64).product();
            let rising: f64 = (1..=n + 1).map(|i| k + i as f64).product();
            (2 * n + 1) as f64 * falling / rising
        };
        let weights = [weight(0), weight(1), weight(2), weight(3)];
        let total: f64 = weights.iter().sum();
        Self { coefficients: std::array::from_fn(|i| weights[ORDERS[i]] * ahead[i] / total) }
    }

    /// The sum of the harmonics in a direction (ahead, left, up); below 0 where the pressure has the
    /// opposite sign.
    pub fn pressure(&self, direction: [f64; 3]) -> f64 {
        harmonics(direction).iter().zip(&self.coefficients).map(|(y, c)| y * c).sum()
    }

    /// The gain towards all sides together: the root of the mean of its square over the sphere. Real harmonics of order
    /// n in SN3D scaling have a mean square of 1 / (2 n + 1).
    pub fn diffuse(&self) -> f64 {
        let parts = self.coefficients.iter().enumerate();
        parts.map(|(n, weight)| weight * weight / (2 * n.isqrt() + 1) as f64).sum::<f64>().sqrt()
    }

    /// The gain towards what lies `toward_m` from the source, in metres in the world, where the
    /// source has a local-to-world transform.
    ///
    /// It is below 0 where the pressure has the opposite sign, as behind a dipole. Within [`NEAR_M`] the direction fades away as it does for a
    /// microphone, so that a source may pass through one. Scale in the transform counts for nothing; a transform
    /// without directions (scaled to nothing, not finite) leaves what is heard all around.
    pub fn gain(&self, frame: &Transform, toward_m: [f64; 3]) -> f64 {
        let along = |axis: usize| {
            let column: [f64; 3] = std::array::from_fn(|row| frame[row][axis]);
            let dot: f64 = (0..3).map(|i| column[i] * toward_m[i]).sum();
            dot / length(column)
        };
        let local = [-along(2), -along(0), along(1)];
        let distance = length(local);
        if !distance.is_finite() || distance == 0.0 {
            return self.coefficients[0];
        }
        let values = harmonics(local.map(|c| c / distance));
        // Solid harmonics r^n Y are smooth through the centre.
        let near = (distance / NEAR_M).min(1.0);
        let fade = [1.0, near, near * near, near * near * near];
        (0..HARMONICS).map(|i| fade[ORDERS[i]] * values[i] * self.coefficients[i]).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use crate::scene::track::facing_frame;

    fn unit(random: Random, index: u64) -> [f64; 3] {
        let z = 2.0 * random.uniform(2 * index) - 1.0;
        let (angle, r) = (std::f64::consts::TAU * random.uniform(2 * index + 1), (1.0 - z * z).sqrt());
        [r * angle.cos(), r * angle.sin(), z]
    }

    /// Nodes and weights that integrate polynomials of degree 7 over [−1, 1] exactly.
    const GAUSS: [(f64, f64); 4] = [
        (-0.861_136_311_594_052_6, 0.347_854_845_137_453_86),
        (-0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
        (0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
        (0.861_136_311_594_052_6, 0.347_854_845_137_453_86),
    ];

    #[test]
    fn the_harmonics_are_orthogonal_with_the_norm_of_sn3d() {
        let mut gram = [[0.0; HARMONICS]; HARMONICS];
        for (z, weight) in GAUSS {
            for step in 0..8 {
                let angle = std::f64::consts::TAU * f64::from(step) / 8.0;
                let r = (1.0 - z * z).sqrt();
                let y = harmonics([r * angle.cos(), r * angle.sin(), z]);
                for (row, a) in gram.iter_mut().zip(y) {
                    for (sum, b) in row.iter_mut().zip(y) {
                        *sum += 0.5 * weight / 8.0 * a * b;
                    }
                }
            }
        }
        for (i, row) in gram.iter().enumerate() {
            for (j, found) in row.iter().enumerate() {
                let expected = if i == j { 1.0 / (2 * ORDERS[i] + 1) as f64 } else { 0.0 };
                assert!((found - expected).abs() < 1e-12, "{i} {j} {found}");
            }
        }
    }

    #[test]
    fn the_harmonics_are_those_of_scipy() {
        let text = include_str!("../../tests/fixtures/harmonics.tsv");
        let rows: Vec<Vec<f64>> = text
            .lines()
            .filter(|line| !line.starts_with('#'))
            .map(|line| line.split('\t').map(|n| n.parse().unwrap()).collect())
            .collect();
        assert!(rows.len() >= 20);
        for row in rows {
            let found = harmonics([row[0], row[1], row[2]]);
            for (i, (a, b)) in found.iter().zip(&row[3..]).enumerate() {
                assert!((a - b).abs() < 1e-12, "harmonic {i} at {:?}: {a} {b}", &row[..3]);
            }
            assert_eq!(row.len(), 3 + HARMONICS);
        }
    }

    #[test]
    fn the_gain_turns_with_the_source() {
        let random = Random::new(1, 2);
        let coefficients = std::array::from_fn(|i| random.uniform(1000 + i as u64) - 0.5);
        let directivity = Directivity { coefficients };
        let still = facing_frame([0.0; 3], [0.0, 0.0, -1.0]);
        let apply = |m: &Transform, v: [f64; 3]| -> [f64; 3] {
            std::array::from_fn(|i| (0..3).map(|k| m[i][k] * v[k]).sum())
        };
        for i in 0..50 {
            let toward = unit(random, i).map(|c| 3.0 * c);
            let mut frame = facing_frame([7.0, 8.0, 9.0], unit(random, 100 + i));
            let turned = apply(&frame, toward);
            // Scale counts for nothing, not even where axes differ.
            for row in &mut frame[..3] {
                row[0] *= 2.0;
                row[1] *= 0.1;
            }
            let (a, b) = (directivity.gain(&still, toward), directivity.gain(&frame, turned));
            assert!((a - b).abs() < 1e-12, "{a} {b}");
            let local = directivity.pressure([-toward[2] / 3.0, -toward[0] / 3.0, toward[1] / 3.0]);
            assert!((a - local).abs() < 1e-12);
        }
    }

    #[test]
    fn presets_have_their_closed_forms() {
        for step in 0..=20 {
            let mu: f64 = f64::from(step) / 10.0 - 1.0;
            let direction = [mu, 0.6 * (1.0 - mu * mu).sqrt(), -0.8 * (1.0 - mu * mu).sqrt()];
            let half = 0.5 * (1.0 + mu);
            for k in 0..=3 {
                let found = Directivity::lobe(f64::from(k)).pressure(direction);
                assert!((found - half.powi(k)).abs() < 1e-12, "k {k}, {mu}: {found}");
            }
            assert!((Directivity::CARDIOID.pressure(direction) - half).abs() < 1e-12);
            assert!((Directivity::DIPOLE.pressure(direction) - mu).abs() < 1e-12);
            assert_eq!(Directivity::OMNI.pressure(direction), 1.0);
        }
        // A sharp lobe is the projection of ((1 + μ) / 2)^k: no nearer series of order 3 exists, so
        // that its coefficients are those of quadrature, up to its scale.
        let (k, n) = (7.5, 20_000);
        let sharp = Directivity::lobe(k);
        let legendre = |order: usize, m: f64| match order {
            0 => 1.0,
            1 => m,
            2 => 0.5 * (3.0 * m * m - 1.0),
            _ => 0.5 * m * (5.0 * m * m - 3.0),
        };
        let a: Vec<f64> = (0..4)
            .map(|order| {
                let nodes = (0..n).map(|i| 2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0);
                let sum: f64 = nodes.map(|m| (0.5 * (1.0 + m)).powf(k) * legendre(order, m)).sum();
                (2 * order + 1) as f64 * sum / f64::from(n)
            })
            .collect();
        let total: f64 = a.iter().sum();
        for mu in [-0.9, -0.2, 0.3, 1.0] {
            let expected: f64 = (0..4).map(|order| a[order] * legendre(order, mu)).sum::<f64>() / total;
            let found = sharp.pressure([mu, (1.0f64 - mu * mu).sqrt(), 0.0]);
            assert!((found - expected).abs() < 1e-6, "{mu}: {found} {expected}");
        }
    }

    #[test]
    fn odd_input_leaves_a_number() {
        for k in [f64::NAN, f64::INFINITY, -3.0, 1e300] {
            assert!(Directivity::lobe(k).coefficients.iter().all(|c| c.is_finite()), "{k}");
        }
        let frame = facing_frame([0.0; 3], [0.0, 0.0, -1.0]);
        let cardioid = Directivity::CARDIOID;
        assert_eq!(cardioid.gain(&[[0.0; 4]; 4], [1.0, 2.0, 3.0]), 0.5);
        assert_eq!(cardioid.gain(&frame, [f64::NAN; 3]), 0.5);
        assert_eq!(cardioid.gain(&frame, [0.0; 3]), 0.5);
        // A source passes through a microphone without a step.
        let gains: Vec<f64> =
            (-400..=400).map(|i| cardioid.gain(&frame, [0.0, 0.0, f64::from(i) * 1e-3])).collect();
        assert!(gains.windows(2).all(|w| (w[1] - w[0]).abs() < 0.006));
        assert_eq!((gains[0], gains[800]), (1.0, 0.0));
    }
}
