//! A sound that comes from all over the surface of an object: where its points are, and what each of them gives.
//!
//! All of the surface sounds alike, so that each piece of it has its part of the energy by its area. Large triangles are
//! cut into smaller ones, so that a coarse mesh is heard as a fine one of the same shape is.

use std::sync::Arc;

use glam::DVec3;

use super::extended::{Bin, Gathering, USUAL_BINS};
use super::surroundings::{Shape, Surface, affine, simple};
use crate::Result;
use crate::scene::animation::Mesh;

/// A surface is cut into about as many pieces as this, if it has fewer triangles.
const PIECES: f64 = 256.0;

/// The sides of a triangle are cut into this many parts at most.
const MOST_PARTS: usize = 16;

/// The surface of an object.
#[derive(Clone)]
pub struct SoundingSurface {
    /// Where it is, and its mesh.
    pub surface: Arc<dyn Surface>,
    /// Its shape.
    pub shape: Shape,
}

/// A surface that sounds, as it is heard at one time.
pub(super) struct Spread {
    of: SoundingSurface,
    gathering: Gathering,
    mesh: Mesh,
    /// Where its pieces are, and their parts of the energy, which sum to 1.
    pieces: Vec<([f64; 3], f64)>,
    time_s: Option<f64>,
}

impl Spread {
    /// Gathers the sound of a surface by [`USUAL_BINS`] directions.
    pub fn new(of: SoundingSurface) -> Result<Self> {
        let gathering = Gathering::new(USUAL_BINS)?;
        Ok(Self { of, gathering, mesh: Mesh::default(), pieces: Vec::new(), time_s: None })
    }

    /// What arrives at a listener from each direction, of an energy of 1 at 1 m in all.
    ///
    /// # Errors
    /// A sample of its motion that cannot be read.
    pub fn heard(&mut self, time_s: f64, listener_m: [f64; 3]) -> Result<&[Bin]> {
        if self.time_s != Some(time_s) {
            self.time_s = None;
            match simple(self.of.shape) {
                None => self.of.surface.mesh(time_s, &mut self.mesh)?,
                Some(mesh) => {
                    let to_world = affine(&self.of.surface.frame(time_s)?);
                    self.mesh = mesh;
                    for position in &mut self.mesh.positions {
                        let local = DVec3::from(position.map(f64::from));
                        *position = to_world.transform_point3(local).as_vec3().into();
                    }
                }
            }
            cut(&self.mesh, &mut self.pieces);
            self.time_s = Some(time_s);
        }
        Ok(self.gathering.gather(listener_m, self.pieces.iter().copied()))
    }
}

/// The pieces of a mesh: where each is and which part of the area it has. Of a mesh without an area, each vertex is one.
fn cut(mesh: &Mesh, pieces: &mut Vec<([f64; 3], f64)>) {
    pieces.clear();
    let place = |vertex: u32| {
        let position = mesh.positions.get(vertex as usize)?;
        let place = DVec3::from(position.map(f64::from));
        place.is_finite().then_some(place)
    };
    let mut first = 0;
    let mut triangles: Vec<([DVec3; 3], f64)> = Vec::with_capacity(mesh.face_vertices.len() / 2);
    for &size in &mesh.face_sizes {
        let face = mesh.face_vertices.get(first..first + size as usize).unwrap_or_default();
        first += size as usize;
        for pair in face.get(1..).unwrap_or_default().windows(2) {
            let [Some(a), Some(b), Some(c)] = [face[0], pair[0], pair[1]].map(place) else { continue };
            triangles.push(([a, b, c], 0.5 * (b - a).cross(c - a).length()));
        }
    }
    let total: f64 = triangles.iter().map(|(_, area_m2)| area_m2).sum();
    if !(total > 0.0 && total.is_finite()) {
        let places: Vec<DVec3> = (0..mesh.positions.len() as u32).filter_map(place).collect();
        let part = 1.0 / places.len() as f64;
        pieces.extend(places.into_iter().map(|place| (place.to_array(), part)));
        return;
    }
    for ([a, b, c], area_m2) in triangles {
        let parts = ((area_m2 / total * PIECES).sqrt().ceil() as usize).clamp(1, MOST_PARTS);
        let part = area_m2 / total / (parts * parts) as f64;
        let (u, v) = ((b - a) / parts as f64, (c - a) / parts as f64);
        for row in 0..parts {
            for column in 0..parts - row {
                let corner = a + u * row as f64 + v * column as f64;
                pieces.push(((corner + (u + v) / 3.0).to_array(), part));
                if column + 1 < parts - row {
                    pieces.push(((corner + (u + v) * (2.0 / 3.0)).to_array(), part));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::surroundings::meshes::{Moved, ball, wall};
    use super::*;
    use crate::scene::animation::Topology;
    use glam::DAffine3;

    fn pieces(mesh: &Mesh) -> Vec<([f64; 3], f64)> {
        let mut pieces = Vec::new();
        cut(mesh, &mut pieces);
        pieces
    }

    fn moments(pieces: &[([f64; 3], f64)]) -> [f64; 7] {
        let mut sums = [0.0; 7];
        for ([x, y, z], part) in pieces {
            for (sum, term) in sums.iter_mut().zip([1.0, *x, *y, *z, x * x, y * y, z * z]) {
                *sum += part * term;
            }
        }
        sums
    }

    #[test]
    fn a_surface_is_heard_alike_however_fine_its_mesh_is() {
        let mut spreads: Vec<Spread> = [(1, 1), (7, 3), (60, 60)]
            .map(|(columns, rows)| {
                let mesh = wall(4.0, 2.0, columns, rows);
                let surface = Arc::new(Moved::rigid(mesh, |_| DAffine3::from_translation(DVec3::Z * -2.0)));
                Spread::new(SoundingSurface { surface, shape: Shape::Mesh }).unwrap()
            })
            .into();
        let still = Moved {
            topology: Topology::None,
            ..Moved::rigid(Mesh::default(), |_| DAffine3::from_translation(DVec3::Z * -2.0))
        };
        let shape = Shape::Rectangle { width_m: 4.0, height_m: 2.0 };
        spreads.push(Spread::new(SoundingSurface { surface: Arc::new(still), shape }).unwrap());
        for listener in [[0.0; 3], [1.5, 0.5, 1.0], [-6.0, 0.0, -2.2]] {
            let bins: Vec<Vec<Bin>> =
                spreads.iter_mut().map(|spread| spread.heard(0.0, listener).unwrap().to_vec()).collect();
            let total = |bins: &[Bin]| bins.iter().map(|bin| bin.energy).sum::<f64>();
            for other in &bins[1..] {
                assert!((total(other) / total(&bins[0]) - 1.0).abs() < 0.01, "{listener:?}");
                for (a, b) in bins[0].iter().zip(other) {
                    assert!((a.energy - b.energy).abs() < 0.02 * total(&bins[0]), "{a:?} {b:?}");
                }
            }
        }
        // ∫∫ 1 / (x² + y² + 4) over 4 m by 2 m, by its area, from 2 m in front of the middle.
        let (n, mut integral) = (400, 0.0);
        for i in 0..n {
            for j in 0..n {
                let at = |k: i32, size: f64| ((f64::from(k) + 0.5) / f64::from(n) - 0.5) * size;
                integral += 1.0 / (at(i, 4.0).powi(2) + at(j, 2.0).powi(2) + 4.0) / f64::from(n * n);
            }
        }
        let heard: f64 = spreads[0].heard(0.0, [0.0; 3]).unwrap().iter().map(|bin| bin.energy).sum();
        assert!((heard / integral - 1.0).abs() < 0.005, "{heard} {integral}");
    }

    #[test]
    fn pieces_have_the_area_and_the_middle_of_the_mesh() {
        for (mesh, second) in
            [(wall(4.0, 2.0, 1, 1), [16.0 / 12.0, 4.0 / 12.0, 0.0]), (ball(1.5, 24), [0.75; 3])]
        {
            let [sum, x, y, z, xx, yy, zz] = moments(&pieces(&mesh));
            assert!((sum - 1.0).abs() < 1e-9 && [x, y, z].iter().all(|m| m.abs() < 1e-6));
            for (found, expected) in [xx, yy, zz].iter().zip(second) {
                assert!((found - expected).abs() < 0.02 * 1.4, "{found} {expected}");
            }
        }
    }

    #[test]
    fn odd_meshes_leave_numbers() {
        let mut mesh = wall(1.0, 1.0, 2, 2);
        mesh.positions[4] = [f32::NAN; 3];
        assert!(pieces(&mesh).iter().all(|(place, part)| place.iter().all(|c| c.is_finite()) && *part > 0.0));
        // A line has no area, and nothing at all has no pieces.
        mesh.positions.iter_mut().enumerate().for_each(|(n, p)| *p = [n as f32, 0.0, 0.0]);
        assert!((moments(&pieces(&mesh))[0] - 1.0).abs() < 1e-9);
        assert!(pieces(&Mesh::default()).is_empty());
        mesh.face_vertices.iter_mut().for_each(|vertex| *vertex += 1000);
        assert!((moments(&pieces(&mesh))[0] - 1.0).abs() < 1e-9);
    }
}
