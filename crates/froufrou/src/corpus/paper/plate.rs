//! How a curved piece of paper vibrates: a shallow cylindrical shell with free edges.
//!
//! A resonator of Schreck et al. (2016) is a piece whose straight edges are as long as its rulings, l_r, and whose two curved
//! edges are half of its free border, w = l_c / 2. A wave of the numbers k_y along the curve and k_x along the rulings has
//!
//! ```text
//! ω² = (D / σ) (k_x² + k_y²)² + (E h / (σ R²)) (k_x² / (k_x² + k_y²))²
//! ```
//!
//! (Donnell, Mushtari and Vlasov), where D = E h³ / 12 (1 − ν²) is the bending stiffness, σ the mass of an area, h the thickness and
//! R the radius. What only rolls the sheet (Rayleigh) or twists it (Love) stretches nothing, so the second term is left
//! out for the first two orders along the rulings. Free edges have k_y ≈ (m + ½) π / w.
//!
//! The radius follows from how far the chord of the curve is compressed. Schreck et al. measured that this moves the spectrum of
//! friction much less than such a shell says, as paper does not bend evenly, so the model takes the radius only to a small power;
//! [`Shape::compression`] and the outline are what it has for such secondary effects.

use std::f64::consts::PI;

/// The speed of sound, in m/s.
const AIR_MPS: f64 = 343.0;

/// Orders along the rulings, from 0, and along the curve, from 1. Higher ones have many parts that cancel in the air.
const ORDERS: [usize; 2] = [8, 12];

/// The power of the curvature's change that the model takes over.
const CURVING: f64 = 0.17;

/// The compression at which a database is recorded, and from which others are taken to change.
pub const COMPRESSION: f64 = 0.3;

/// By how much of its frequency a mode is spread, for each unit of a trapezoid's taper.
const TAPERING: f64 = 0.6;

/// A kind of paper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sheet {
    /// Young's modulus E, the mean of both directions.
    pub young_pa: f64,
    /// h.
    pub thickness_m: f64,
    /// σ, the mass of an area.
    pub grammage_kgpm2: f64,
    /// Poisson's ratio ν.
    pub poisson: f64,
    /// The loss factor η: what is lost within the paper.
    pub loss: f64,
}

/// The form of a resonator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shape {
    /// l_r, the mean length of rulings.
    pub ruling_m: f64,
    /// l_c, the length of all free curved borders.
    pub border_m: f64,
    /// By which part the chord of the curve is shorter than the curve, from 0 to 1.
    pub compression: f64,
    /// How unlike its two curved borders are: their difference over their sum.
    pub border_taper: f64,
    /// The same of its straight borders.
    pub ruling_taper: f64,
}

/// A way in which a piece of paper vibrates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlateMode {
    /// In hertz.
    pub frequency_hz: f64,
    /// Its loss factor: that of the paper and that of sound which leaves.
    pub loss: f64,
    /// How far it is heard, as an amplitude.
    pub weight: f64,
    /// The part of its bending that is across the rulings, from 0 to 1; the rest is along them.
    pub across: f64,
}

impl Shape {
    /// A rectangle of an entry (l_r, l_c) of a database, as compressed as others.
    pub fn rectangle(ruling_m: f64, border_m: f64) -> Self {
        Self { ruling_m, border_m, compression: COMPRESSION, border_taper: 0.0, ruling_taper: 0.0 }
    }

    /// The length of one curved border, w.
    pub fn width_m(&self) -> f64 {
        self.border_m / 2.0
    }

    /// The radius of a disk as large as it.
    pub fn disk_m(&self) -> f64 {
        (self.ruling_m * self.width_m() / PI).sqrt()
    }

    /// Half of the angle of its arc, in radians, as sin θ / θ = 1 − compression.
    fn half_angle(compression: f64) -> f64 {
        let wanted = 1.0 - compression.clamp(0.01, 0.99);
        let (mut low, mut high) = (0.0, PI);
        for _ in 0..48 {
            let middle = 0.5 * (low + high);
            if middle.sin() / middle > wanted { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }

    /// 1 / R, in 1/m, as far as the model follows it.
    fn curvature(&self) -> f64 {
        let usual = Self::half_angle(COMPRESSION);
        let change = Self::half_angle(self.compression) / usual;
        2.0 * usual / self.width_m() * change.powf(CURVING)
    }
}

impl Sheet {
    /// √(D / σ), in m²/s: a free wave of bending has ω = k² times this.
    fn bending(&self) -> f64 {
        let stiffness =
            self.young_pa * self.thickness_m.powi(3) / (12.0 * (1.0 - self.poisson * self.poisson));
        (stiffness / self.grammage_kgpm2).sqrt()
    }

    /// The speed of waves of stretching, √(E h / σ), in m/s.
    fn stretching_mps(&self) -> f64 {
        (self.young_pa * self.thickness_m / self.grammage_kgpm2).sqrt()
    }

    /// The modes of a piece, order by order.
    pub fn modes(&self, shape: &Shape) -> Vec<PlateMode> {
        let (length, width) = (shape.ruling_m, shape.width_m());
        let bending = self.bending();
        let ring = self.stretching_mps() * shape.curvature();
        let [along, across] = ORDERS;
        let mut modes = Vec::with_capacity(along * across);
        for n in 0..along {
            for m in 1..=across {
                let ky = (m as f64 + 0.5) * PI / width;
                let kx = (n as f64 - 0.5).max(0.0) * PI / length;
                let squared = match n {
                    // Rayleigh's: it rolls.
                    0 => (bending * ky * ky).powi(2),
                    // Love's: it twists, so that only the mixed curvature is added.
                    1 => {
                        let twist = 24.0 * (1.0 - self.poisson) / (length * length);
                        bending * bending * ky * ky * (ky * ky + twist)
                    }
                    _ => {
                        let whole = kx * kx + ky * ky;
                        (bending * whole).powi(2) + (ring * kx * kx / whole).powi(2)
                    }
                };
                let frequency_hz = squared.sqrt() / (2.0 * PI);
                // A dipole as large as the piece radiates little below where its size is that of a wave.
                let corner_hz = dipole_corner_hz(shape);
                let radiation = dipole(frequency_hz, corner_hz);
                // Parts of opposite sign cancel, the more the more there are.
                let cancelling = ((1.0 + 0.5 * n as f64) * (1.0 + 0.35 * (m - 1) as f64)).powf(-0.5);
                let air = 1.2 * AIR_MPS / (self.grammage_kgpm2 * 2.0 * PI * frequency_hz.max(1.0));
                let loss = self.loss + 0.05 * (air * radiation * radiation).min(2.0);
                let across = ky * ky / (kx * kx + ky * ky);
                modes.push(PlateMode { frequency_hz, loss, weight: radiation * cancelling, across });
            }
        }
        modes
    }

    /// The power by which a piece colours what drives it at a place somewhere on it, for frequencies at multiples of a spacing.
    pub fn response(&self, shape: &Shape, spacing_hz: f64, count: usize) -> Vec<f64> {
        let mut power = vec![0.0; count];
        for mode in self.modes(shape) {
            let centre = mode.frequency_hz;
            if centre > 2.0 * spacing_hz * count as f64 {
                continue;
            }
            // A trapezoid's modes are spread over what its narrow and wide parts have.
            let tapers = shape.border_taper * mode.across + shape.ruling_taper * (1.0 - mode.across);
            let loss = mode.loss.hypot(TAPERING * tapers);
            // Of the width of the resonance, so that each mode has a power that does not depend on it.
            let scale = mode.weight.powi(2) * self.loss * centre;
            let half = 0.5 * loss * centre;
            for (k, power) in power.iter_mut().enumerate() {
                let off = (k + 1) as f64 * spacing_hz - centre;
                *power += scale * half / (off * off + half * half);
            }
        }
        power
    }
}

/// Below this frequency a piece radiates as a dipole that is small, less and less.
pub fn dipole_corner_hz(shape: &Shape) -> f64 {
    AIR_MPS / (2.0 * PI * shape.disk_m())
}

/// The amplitude that a dipole radiates with against one that is large.
pub fn dipole(frequency_hz: f64, corner_hz: f64) -> f64 {
    let x = frequency_hz / corner_hz;
    x / (1.0 + x * x).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHEET: Sheet =
        Sheet { young_pa: 4e9, thickness_m: 1e-4, grammage_kgpm2: 0.08, poisson: 0.3, loss: 0.04 };

    #[test]
    fn what_rolls_is_a_free_beam() {
        // Euler's beam with free ends, by the roots of cos x cosh x = 1, where D takes the place of E I.
        let shape = Shape::rectangle(0.07, 0.1);
        let modes = SHEET.modes(&shape);
        let stiffness: f64 = 4e9 * 1e-12 / (12.0 * 0.91);
        for (mode, root) in modes.iter().zip([4.730_041f64, 7.853_205, 10.995_608]) {
            let exact_hz = (root / 0.05).powi(2) * (stiffness / 0.08).sqrt() / (2.0 * PI);
            assert!((mode.frequency_hz / exact_hz - 1.0).abs() < 0.01, "{} {exact_hz}", mode.frequency_hz);
        }
    }

    #[test]
    fn modes_follow_the_sizes_as_shells_do() {
        let modes = |ruling_m, border_m| SHEET.modes(&Shape::rectangle(ruling_m, border_m));
        // All lengths twice as long: what bends four times as low, what stretches half as low, others between.
        for (small, large) in modes(0.06, 0.1).iter().zip(modes(0.12, 0.2)) {
            let ratio = small.frequency_hz / large.frequency_hz;
            assert!((1.99..4.01).contains(&ratio), "{ratio}");
            assert!(small.loss >= SHEET.loss && (0.0..=1.0).contains(&small.across));
        }
        // Longer rulings leave what rolls alone, and lower what stretches.
        let [short, long] = [0.05, 0.2].map(|ruling_m| modes(ruling_m, 0.1));
        for (n, (short, long)) in short.iter().zip(&long).enumerate() {
            if n < ORDERS[1] {
                assert_eq!(short.frequency_hz, long.frequency_hz);
            } else {
                assert!(short.frequency_hz > long.frequency_hz);
            }
        }
    }

    #[test]
    fn curves_are_compressed_as_arcs_are() {
        for compression in [0.05f64, 0.2, 0.4, 0.8] {
            let half = Shape::half_angle(compression);
            assert!((half.sin() / half - (1.0 - compression)).abs() < 1e-9);
        }
        let curvature = |compression| Shape { compression, ..Shape::rectangle(0.1, 0.2) }.curvature();
        assert!(curvature(0.2) < curvature(0.4) && curvature(0.4) < curvature(0.8));
        assert!(curvature(0.8) / curvature(0.2) < 1.2);
    }

    #[test]
    fn a_small_dipole_falls_by_6_db_an_octave_and_a_large_one_does_not() {
        let level = |f: f64| 20.0 * dipole(f, 1000.0).log10();
        assert!((level(20.0) - level(10.0) - 6.02).abs() < 0.01);
        assert!((level(1000.0) + 3.01).abs() < 0.01 && level(50_000.0) > -0.01);
    }
}
