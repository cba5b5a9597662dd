//! What images tell of a room's energy, averaged over all places of source and listener.

use std::f64::consts::TAU;

use super::super::air::Medium;
use super::super::bands::{BAND_COUNT, Bands};
use super::super::room::Room;
use super::energy_per_m;

/// Directions along each side of an octant over which images are averaged.
const DIRECTIONS: usize = 16;

/// After as many reflections along an axis nothing is left, whatever the walls.
const MOST_REFLECTIONS: usize = 100_000;

/// The energy of images, averaged over all places of source and listener.
pub(super) struct Images {
    order: usize,
    /// How many walls a metre is in each direction, along each axis.
    directions: Vec<[f64; 3]>,
    /// What is left of the energy after so many reflections along each axis, averaged over both sides.
    left: [Vec<Bands>; 3],
    air_per_m: Bands,
}

impl Images {
    pub(super) fn new(room: &Room, air: &Medium, order: usize) -> Self {
        let size = room.size_m();
        let directions = (0..DIRECTIONS * DIRECTIONS)
            .map(|index| {
                let part = |i: usize| (i as f64 + 0.5) / DIRECTIONS as f64;
                let (up, angle) = (part(index / DIRECTIONS), part(index % DIRECTIONS) * TAU / 4.0);
                let flat = (1.0 - up * up).sqrt();
                [flat * angle.cos() / size[0], up / size[1], flat * angle.sin() / size[2]]
            })
            .collect();
        // Further than the images of the order reach, along any axis.
        let shortest = size.iter().copied().fold(f64::INFINITY, f64::min);
        let longest = size.iter().copied().fold(0.0, f64::max);
        let most = ((order + 3) as f64 * longest / shortest) as usize;
        let walls = room.absorption();
        let left = std::array::from_fn(|axis| {
            let (low, high) = (&walls[2 * axis], &walls[2 * axis + 1]);
            (0..=most.min(MOST_REFLECTIONS) as i32)
                .map(|hits| {
                    std::array::from_fn(|band| {
                        let (low, high) = (1.0 - low[band], 1.0 - high[band]);
                        let pairs = (low * high).powi(hits / 2);
                        if hits % 2 == 0 { pairs } else { pairs * 0.5 * (low + high) }
                    })
                })
                .collect()
        });
        Self { order, directions, left, air_per_m: energy_per_m(air) }
    }

    /// What walls and air leave of the energy of a source at a distance: of images up to the order, and of all.
    pub(super) fn energies(&self, distance_m: f64) -> (Bands, Bands) {
        let (mut early, mut all) = ([0.0; BAND_COUNT], [0.0; BAND_COUNT]);
        for walls_per_m in &self.directions {
            let walls = walls_per_m.map(|w| w * distance_m);
            // Along an axis n + f walls away, an image has met n of them for 1 − f of all places and n + 1 for f.
            for corner in 0..8 {
                let (mut weight, mut order, mut reflected) = (1.0, 0, [1.0; BAND_COUNT]);
                for (axis, (walls, left)) in walls.iter().zip(&self.left).enumerate() {
                    let further = corner >> axis & 1;
                    weight *= if further == 1 { walls.fract() } else { 1.0 - walls.fract() };
                    let hits = *walls as usize + further;
                    order += hits;
                    let left = left.get(hits).unwrap_or(&[0.0; BAND_COUNT]);
                    reflected.iter_mut().zip(left).for_each(|(product, left)| *product *= left);
                }
                for band in 0..BAND_COUNT {
                    all[band] += weight * reflected[band];
                    if order <= self.order {
                        early[band] += weight * reflected[band];
                    }
                }
            }
        }
        let share = |band: usize| (-self.air_per_m[band] * distance_m).exp() / self.directions.len() as f64;
        let scaled = |sums: Bands| std::array::from_fn(|band| sums[band] * share(band));
        (scaled(early), scaled(all))
    }
}
