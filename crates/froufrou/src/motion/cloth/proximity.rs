//! Which triangle each vertex of a cloth is closest to: of other objects, or of the same cloth where it comes back to
//! itself.

use glam::DVec3;
use rayon::prelude::*;

use super::geodesic::Surroundings;
use super::tree::{Best, Tree};
use super::triangulation::Triangulation;
use crate::scene::animation::Mesh;
use crate::{Error, Result};

/// Vertices that one thread takes at a time.
const PORTION: usize = 256;

/// What a vertex touches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// The object, by its number among those of a frame.
    pub object: u32,
    /// The triangle, by its number in the object's triangulation.
    pub triangle: u32,
    /// The point of it that is closest, as weights of the triangle's corners.
    pub barycentric: [f64; 3],
    /// How far it is, in metres.
    pub distance_m: f64,
}

/// A mesh that may be touched, as it lies now.
#[derive(Debug, Clone, Default)]
pub struct Touchable {
    surface: Triangulation,
    tree: Tree,
    /// Where its vertices are, and where they were before.
    positions: Vec<[f32; 3]>,
    before: Vec<[f32; 3]>,
}

impl Touchable {
    /// Takes a mesh up; the work is that of sorting its triangles.
    ///
    /// # Errors
    /// As [`Triangulation::new`].
    pub fn new(mesh: &Mesh) -> Result<Self> {
        let surface = Triangulation::new(mesh)?;
        let tree = Tree::build(&surface, &mesh.positions);
        Ok(Self { surface, tree, positions: mesh.positions.clone(), before: mesh.positions.clone() })
    }

    /// Its triangles.
    pub fn surface(&self) -> &Triangulation {
        &self.surface
    }

    /// Where its vertices are, in metres.
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    /// Takes up where its vertices are now.
    ///
    /// # Errors
    /// Another number of positions than before.
    pub fn follow(&mut self, positions: &[[f32; 3]]) -> Result<()> {
        if positions.len() != self.positions.len() {
            let (given, expected) = (positions.len(), self.positions.len());
            return Err(Error::new(format!("{given} positions for a mesh of {expected} vertices")));
        }
        let moves = self.positions != positions;
        if moves || self.before != positions {
            std::mem::swap(&mut self.before, &mut self.positions);
            self.positions.clear();
            self.positions.extend_from_slice(positions);
        }
        if moves {
            self.tree.refit(&self.surface, positions);
        }
        Ok(())
    }

    /// A point of a triangle with its normal, which has no length of its own, before and now.
    pub(in crate::motion) fn carried(&self, triangle: u32, weights: [f64; 3]) -> Option<[(DVec3, DVec3); 2]> {
        let corners = self.surface.triangles().get(triangle as usize)?;
        let at = |positions: &[[f32; 3]]| {
            let [a, b, c] = corners.map(|vertex| DVec3::from(positions[vertex as usize].map(f64::from)));
            (weights[0] * a + weights[1] * b + weights[2] * c, (b - a).cross(c - a))
        };
        Some([at(&self.before), at(&self.positions)])
    }

    /// Where a vertex was before and is now.
    pub(in crate::motion) fn vertex(&self, vertex: u32) -> Option<[DVec3; 2]> {
        let at = |positions: &[[f32; 3]]| Some(DVec3::from(positions.get(vertex as usize)?.map(f64::from)));
        Some([at(&self.before)?, at(&self.positions)?])
    }
}

/// Finds what the vertices of one cloth touch, frame after frame.
#[derive(Debug, Clone)]
pub struct Proximity {
    radius_m: f64,
    /// The number of the cloth's own mesh among the objects, and what of it its vertices leave out; nothing where they
    /// leave out all of it.
    own: u32,
    surroundings: Option<Surroundings>,
    /// The vertices that are asked for.
    vertices: Vec<u32>,
    /// What each of them touched in the last frame.
    last: Vec<Option<Contact>>,
}

impl Proximity {
    /// Begins with a cloth as it lies now.
    ///
    /// `radius_m` is how near is touching. What of the cloth is within `surroundings_m` along its edges from a vertex
    /// that vertex does not touch; nor what is up to a quarter further, so that vertices beside each other can share
    /// the work. Twice the radius leaves out what is near since a fold is round. With an infinite one the cloth never
    /// touches itself.
    pub fn new(own: u32, cloth: &Touchable, radius_m: f64, surroundings_m: f64) -> Self {
        let Touchable { surface, tree, positions, .. } = cloth;
        let surroundings = surroundings_m
            .is_finite()
            .then(|| Surroundings::new(surface, positions, surroundings_m, tree.slots()));
        let vertices: Vec<u32> =
            (0..surface.vertex_count() as u32).filter(|&vertex| !surface.fan(vertex).is_empty()).collect();
        let last = vec![None; vertices.len()];
        Self { radius_m, own, surroundings, vertices, last }
    }

    /// The vertices that are asked for: all that are in a triangle, ascending.
    pub fn vertices(&self) -> &[u32] {
        &self.vertices
    }

    /// What each of [`Proximity::vertices`] touches now: the closest triangle within the radius; of those that are as
    /// close the first of the first object. The answers do not depend on the number of threads, nor on what was asked
    /// before.
    ///
    /// `objects` are all that can be touched, and the cloth itself in its place.
    pub fn contacts(&mut self, objects: &[Touchable]) -> &[Option<Contact>] {
        if self.radius_m <= 0.0 {
            return &self.last;
        }
        let positions = objects.get(self.own as usize).map_or(&[][..], |own| &own.positions);
        let (radius_m, own, surroundings) = (self.radius_m, self.own, self.surroundings.as_ref());
        let portions = self.vertices.par_chunks(PORTION).zip(self.last.par_chunks_mut(PORTION));
        portions.for_each(|(vertices, last)| {
            let portion = Portion { radius_m, own, surroundings, objects, positions, vertices, last };
            pulp::Arch::new().dispatch(portion);
        });
        &self.last
    }

    /// Forgets what was touched, where triangles are numbered anew.
    pub fn forget(&mut self) {
        self.last.fill(None);
    }
}

/// Some vertices of the cloth, and what they touched last, on the vector units that there are.
struct Portion<'a> {
    radius_m: f64,
    own: u32,
    surroundings: Option<&'a Surroundings>,
    objects: &'a [Touchable],
    positions: &'a [[f32; 3]],
    vertices: &'a [u32],
    last: &'a mut [Option<Contact>],
}

impl pulp::WithSimd for Portion<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { radius_m, own, surroundings, objects, positions, vertices, last } = self;
        for (&vertex, last) in vertices.iter().zip(last) {
            let Some(&point) = positions.get(vertex as usize) else { continue };
            let mut best = Best::within(radius_m);
            // What it touched before is likely near: nothing that is further away has to be looked at.
            if let Some(before) = last
                && let Some(object) = objects.get(before.object as usize)
                && let Some(found) =
                    object.tree.nearest_of(before.triangle, DVec3::from(point.map(f64::from)))
            {
                best.offer(before.object, before.triangle, found);
            }
            for (number, object) in objects.iter().enumerate() {
                if number as u32 != own {
                    object.tree.nearest(number as u32, point, &[], &mut best);
                }
            }
            // Most of what is near of itself does not count: it is cheaper to ask for less.
            if let (Some(surroundings), Some(object)) = (surroundings, objects.get(own as usize)) {
                object.tree.nearest(own, point, surroundings.of(vertex), &mut best);
            }
            *last = best.found().map(|best| Contact {
                object: best.object,
                triangle: best.triangle,
                barycentric: best.nearest.weights,
                distance_m: best.nearest.squared_m2.sqrt(),
            });
        }
    }
}

#[cfg(test)]
mod tests;
