//! Sound that spreads over many moving points, as the sliding vertices of a cloth: what arrives is gathered by direction
//! before any signal is made, so that the cost of the signals does not grow with the points.
//!
//! The points sound independently, so that their energies add (and not their pressures). A point with energy E (its
//! mean square pressure at 1 m) at the distance d arrives with E / d². Its energy is shared by the three bins about its
//! direction: with bins in the directions l and g₁ l₁ + g₂ l₂ + g₃ l₃ = p (as in vector base amplitude panning, Pulkki
//! 1997), bin i gets gᵢ / Σ g of it. So all of the energy is kept, and a point that moves goes from bin to bin
//! without a step.
//!
//! The bins lie still in the world: who turns their head hears them from elsewhere, and no bin changes. They
//! are spread nearly evenly over the sphere.
//!
//! ```
//! use froufrou::space::extended::Gathering;
//! let mut gathering = Gathering::new(32)?;
//! // A row of points 2 m ahead, seen from the origin.
//! let row = (-10..=10).map(|i| ([0.02 * f64::from(i), 0.0, -2.0], 1.0));
//! let bins = gathering.gather([0.0; 3], row);
//! let energy: f64 = bins.iter().map(|bin| bin.energy).sum();
//! assert!((energy - 21.0 / 4.0).abs() < 0.1);
//! // Most of the bins are silent: only these need a signal.
//! assert!(bins.iter().filter(|bin| bin.energy > 0.0).count() < 8);
//! # Ok::<(), froufrou::Error>(())
//! ```

use super::microphone::NEAR_M;
use super::sphere::{Triangulation, dot, even_directions, hull, minus, unit};
use crate::{Error, Result};

/// The usual number of bins: about 36° from one to the next.
pub const USUAL_BINS: usize = 32;

/// The numbers of bins that are possible.
const POSSIBLE: std::ops::RangeInclusive<usize> = 6..=1024;

/// What arrives from about one direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bin {
    /// The energy that arrives: Σ E / d².
    pub energy: f64,
    /// The mean distance of it in metres, weighted with energy; 0 where nothing arrives. Over the speed of sound it
    /// is the mean delay.
    pub distance_m: f64,
    /// The unit vector of the mean direction of it in the world, weighted with energy; that of the bin where nothing
    /// arrives.
    pub direction: [f64; 3],
}

/// Gathers the energy of many points by direction.
#[derive(Debug, Clone)]
pub struct Gathering {
    directions: Vec<[f64; 3]>,
    triangles: Triangulation,
    sums: Vec<Sum>,
    bins: Vec<Bin>,
}

/// Energy, and distance and direction weighted with it.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    energy: f64,
    distance: f64,
    direction: [f64; 3],
}

impl Sum {
    #[inline]
    fn add(&mut self, energy: f64, distance_m: f64, direction: [f64; 3]) {
        self.energy += energy;
        self.distance += energy * distance_m;
        (0..3).for_each(|k| self.direction[k] += energy * direction[k]);
    }
}

impl Gathering {
    /// Room for so many bins; [`USUAL_BINS`] do for most.
    ///
    /// # Errors
    /// Fewer than 6 or more than 1024.
    pub fn new(bins: usize) -> Result<Self> {
        if !POSSIBLE.contains(&bins) {
            return Err(Error::new(format!("{bins} directions to gather sound by, expected 6 to 1024")));
        }
        let directions: Vec<[f64; 3]> = even_directions(bins).collect();
        // Faces with more than three corners are cut from their first.
        let faces = hull(&directions);
        let fan = |corners: &[usize]| {
            let pairs = corners[1..].windows(2);
            pairs.map(|pair| [corners[0], pair[0], pair[1]]).collect::<Vec<_>>()
        };
        let triangles = Triangulation::new(&directions, faces.iter().flat_map(|face| fan(&face.corners)));
        let silent = |&direction: &[f64; 3]| Bin { energy: 0.0, distance_m: 0.0, direction };
        Ok(Self {
            sums: vec![Sum::default(); bins],
            bins: directions.iter().map(silent).collect(),
            triangles,
            directions,
        })
    }

    /// The directions of the bins in the world, unit vectors.
    pub fn directions(&self) -> &[[f64; 3]] {
        &self.directions
    }

    /// What arrives at a listener from points, each with its position in the world in metres and its energy, the mean
    /// square of its pressure at 1 m. The bins stand in the order of [`Gathering::directions`].
    ///
    /// Within [`NEAR_M`] a point grows no louder, and is heard more and more from all around, so that it may pass
    /// through the listener. Points that are nowhere, or without an energy above 0, are left out.
    ///
    /// The points are summed in the order in which they come: the same points in the same order have the same bits, in
    /// another order they differ by rounding. Nothing is left over from an earlier call.
    pub fn gather(
        &mut self,
        listener_m: [f64; 3],
        points: impl IntoIterator<Item = ([f64; 3], f64)>,
    ) -> &[Bin] {
        self.sums.fill(Sum::default());
        // What is heard from all around: energy, and distance weighted with it.
        let (mut around, mut around_distance) = (0.0, 0.0);
        for (position_m, energy) in points {
            let way = minus(position_m, listener_m);
            let square = dot(way, way);
            // Also false for what is no number.
            if !(energy > 0.0 && energy < f64::INFINITY && square < f64::INFINITY) {
                continue;
            }
            let distance_m = square.sqrt();
            let arriving = energy / square.max(NEAR_M * NEAR_M);
            let directed = (distance_m / NEAR_M).min(1.0);
            if directed < 1.0 {
                around += arriving * (1.0 - directed);
                around_distance += arriving * (1.0 - directed) * distance_m;
            }
            if distance_m > f64::MIN_POSITIVE {
                let direction = way.map(|c| c / distance_m);
                let (corners, weights) = self.triangles.find(direction);
                let share = arriving * directed / (weights[0] + weights[1] + weights[2]);
                for (corner, weight) in corners.into_iter().zip(weights) {
                    self.sums[corner].add(share * weight, distance_m, direction);
                }
            }
        }
        let count = self.sums.len() as f64;
        for ((bin, sum), &own) in self.bins.iter_mut().zip(&mut self.sums).zip(&self.directions) {
            if around > 0.0 {
                sum.add(around / count, around_distance / around, own);
            }
            let mean = unit(sum.direction);
            *bin = Bin {
                energy: sum.energy,
                distance_m: if sum.energy > 0.0 { sum.distance / sum.energy } else { 0.0 },
                direction: if dot(mean, mean) > 0.5 { mean } else { own },
            };
        }
        &self.bins
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use crate::space::direction::from_angles_deg;

    fn total(bins: &[Bin]) -> f64 {
        bins.iter().map(|bin| bin.energy).sum()
    }

    fn apart(a: [f64; 3], b: [f64; 3]) -> f64 {
        dot(minus(a, b), minus(a, b)).sqrt()
    }

    fn cloud(seed: u64, count: u64, size_m: f64) -> Vec<([f64; 3], f64)> {
        let random = Random::new(seed, 0);
        let place = |i| [0, 1, 2].map(|k| size_m * (2.0 * random.uniform(4 * i + k) - 1.0));
        (0..count).map(|i| (place(i), random.uniform(4 * i + 3))).collect()
    }

    #[test]
    fn energy_is_kept() {
        for bins in [6, 12, 32, 100, 1024] {
            let mut gathering = Gathering::new(bins).unwrap();
            for (seed, size_m) in [(1, 0.01), (2, 0.15), (3, 3.0), (4, 1e6)] {
                let points = cloud(seed, 2000, size_m);
                let listener = [0.01, -0.02, 0.003];
                let expected: f64 =
                    points.iter().map(|&(at, energy)| energy / apart(at, listener).max(NEAR_M).powi(2)).sum();
                let found = gathering.gather(listener, points);
                assert!((total(found) / expected - 1.0).abs() < 1e-12, "{bins} {size_m}");
                assert!(found.iter().all(|bin| bin.energy >= 0.0));
            }
            assert_eq!(total(gathering.gather([0.0; 3], [])), 0.0);
        }
    }

    #[test]
    fn one_point_has_its_own_direction_and_distance() {
        let mut gathering = Gathering::new(USUAL_BINS).unwrap();
        let listener = [3.0, 1.0, -2.0];
        for (offset, energy) in cloud(5, 500, 4.0) {
            let distance = dot(offset, offset).sqrt();
            let point = [0, 1, 2].map(|k| listener[k] + offset[k]);
            let bins = gathering.gather(listener, [(point, energy)]);
            let heard: Vec<&Bin> = bins.iter().filter(|bin| bin.energy > 0.0).collect();
            if distance < NEAR_M {
                continue;
            }
            assert!((1..=3).contains(&heard.len()));
            // The bins it is shared by, weighted, point there too.
            let sum: [f64; 3] = std::array::from_fn(|k| {
                bins.iter().zip(even_directions(USUAL_BINS)).map(|(bin, own)| bin.energy * own[k]).sum()
            });
            assert!(apart(unit(sum), unit(offset)) < 1e-9);
            for bin in heard {
                assert!(apart(bin.direction, unit(offset)) < 1e-9);
                assert!((bin.distance_m - distance).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn a_moving_point_makes_no_steps() {
        let mut gathering = Gathering::new(USUAL_BINS).unwrap();
        let mut most = |steps: u32, way: &dyn Fn(f64) -> [f64; 3]| {
            let mut before: Option<Vec<f64>> = None;
            let mut most: f64 = 0.0;
            for step in 0..=steps {
                let point = (way(f64::from(step) / f64::from(steps)), 1.0);
                let now: Vec<f64> =
                    gathering.gather([0.0; 3], [point]).iter().map(|bin| bin.energy).collect();
                let changes = before.iter().flatten().zip(&now).map(|(a, b)| (a - b).abs());
                most = changes.fold(most, f64::max);
                before = Some(now);
            }
            most
        };
        for circle in 0..8 {
            let random = Random::new(6, circle);
            let tilt = 180.0 * random.uniform(0);
            let around = |t: f64| {
                let [x, y, z] = from_angles_deg(360.0 * t, 0.0);
                let (sin, cos) = f64::to_radians(tilt).sin_cos();
                [cos * x - sin * y, sin * x + cos * y, z]
            };
            let (coarse, fine) = (most(2000, &around), most(20_000, &around));
            assert!(coarse < 0.02 && fine < 0.12 * coarse, "{coarse} {fine}");
        }
        // Through the listener, from side to side, and past their nose.
        for aside in [0.0, 1e-9, 0.02] {
            let through = |t: f64| [2.0 * t - 1.0, aside, -0.3 * aside];
            let (coarse, fine) = (most(4000, &through), most(40_000, &through));
            assert!(fine < 0.12 * coarse, "{aside}: {coarse} {fine}");
        }
    }

    /// ∫ dA / d² over a disk with radius R, from a height h over it and ρ beside its axis:
    /// π ln((s + √(s² + 4 ρ² h²)) / 2h²), s = h² + R² − ρ².
    #[test]
    fn a_disk_is_as_loud_as_its_integral() {
        let mut gathering = Gathering::new(USUAL_BINS).unwrap();
        let radius: f64 = 0.8;
        for (height, beside) in [(0.5f64, 0.0f64), (0.3, 0.0), (2.0, 1.0), (0.4, 0.7), (0.5, 3.0)] {
            let (rings, per_area) = (300, 0.7);
            let points = (0..rings).flat_map(|ring| {
                let r = radius * (f64::from(ring) + 0.5) / f64::from(rings);
                let count = 4 * ring + 4;
                let area = std::f64::consts::TAU * r * radius / f64::from(rings);
                (0..count).map(move |i| {
                    let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / f64::from(count)).sin_cos();
                    ([r * cos, 1.0, r * sin], per_area * area / f64::from(count))
                })
            });
            let found = total(gathering.gather([beside, 1.0 + height, 0.0], points));
            let s = height * height + radius * radius - beside * beside;
            let root = (s * s + 4.0 * beside * beside * height * height).sqrt();
            let expected = per_area * std::f64::consts::PI * ((s + root) / (2.0 * height * height)).ln();
            let off_db = 10.0 * (found / expected).log10();
            assert!(off_db.abs() < 0.001, "{height} {beside}: {off_db} dB");
        }
    }

    #[test]
    fn the_fineness_of_a_mesh_does_not_matter() {
        // A wavy sheet as a grid of points that share its energy.
        let sheet = |rows: u32| {
            let all = (0..rows).flat_map(move |i| (0..rows).map(move |k| (i, k)));
            all.map(move |(i, k)| {
                let [u, v] = [i, k].map(|i| (f64::from(i) + 0.5) / f64::from(rows));
                ([2.0 * u - 1.0, 1.0 + 0.1 * (9.0 * u).sin(), -0.5 - v], 1.0 / f64::from(rows * rows))
            })
        };
        let mut coarse = Gathering::new(USUAL_BINS).unwrap();
        let mut fine = coarse.clone();
        for listener in [[0.0, 1.7, 0.0], [0.4, 0.2, -1.0], [-3.0, 1.0, 2.0]] {
            let coarse = coarse.gather(listener, sheet(32));
            let fine = fine.gather(listener, sheet(64));
            let all = total(fine);
            assert!((10.0 * (total(coarse) / all).log10()).abs() < 0.02);
            for (a, b) in coarse.iter().zip(fine) {
                assert!((a.energy - b.energy).abs() < 0.002 * all, "{a:?} {b:?}");
                if b.energy > 0.01 * all {
                    assert!((a.distance_m - b.distance_m).abs() < 0.01 * b.distance_m);
                    assert!(apart(a.direction, b.direction) < 0.02);
                }
            }
        }
    }

    #[test]
    fn the_order_of_points_matters_to_rounding_only() {
        let points = cloud(8, 3000, 2.0);
        let mut one = Gathering::new(USUAL_BINS).unwrap();
        let mut other = one.clone();
        let forward = one.gather([0.0; 3], points.iter().copied()).to_vec();
        assert_eq!(forward, one.gather([0.0; 3], points.iter().copied()), "the same order, the same bits");
        let backward = other.gather([0.0; 3], points.iter().rev().copied());
        for (a, b) in forward.iter().zip(backward) {
            assert!((a.energy / b.energy - 1.0).abs() < 1e-12 && apart(a.direction, b.direction) < 1e-12);
        }
    }

    #[test]
    fn what_is_no_sound_is_left_out() {
        let mut gathering = Gathering::new(6).unwrap();
        let sound = [([1.0, 0.0, 0.0], 1.0), ([0.0; 3], 1e-3)];
        let odd = [
            ([f64::NAN, 0.0, 0.0], 1.0),
            ([f64::INFINITY, 0.0, 0.0], 1.0),
            ([1e200, 0.0, 0.0], 1.0),
            ([1.0, 1.0, 1.0], f64::NAN),
            ([1.0, 1.0, 1.0], -1.0),
            ([1.0, 1.0, 1.0], f64::INFINITY),
        ];
        let expected = gathering.gather([0.0; 3], sound).to_vec();
        let found = gathering.gather([0.0; 3], sound.into_iter().chain(odd));
        assert_eq!(found, expected);
        assert!((total(found) - 1.1).abs() < 1e-12);
        assert!(found.iter().all(|bin| bin.direction.iter().all(|c| c.is_finite())));
        assert_eq!(total(gathering.gather([f64::NAN; 3], sound)), 0.0);
        for bins in [0, 5, 1025, usize::MAX] {
            assert!(Gathering::new(bins).unwrap_err().to_string().contains("expected 6 to 1024"));
        }
    }
}
