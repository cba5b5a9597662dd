//! Polygon meshes: points that move, faces that mostly do not, and what bends them.

use std::sync::Arc;

use glam::{DAffine3, DMat4, DVec3};

use super::fault::Damage;
use super::samples::{Samples, merged};
use super::skeleton::Skin;
use crate::scene::animation::{Mesh, MeshSize, Topology};

/// The faces at one time, counter-clockwise, sound in themselves.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Faces {
    vertices: Vec<u32>,
    sizes: Vec<u32>,
    /// How many vertices there must be.
    vertices_needed: usize,
}

impl Faces {
    /// # Errors
    /// Counts that do not add up to the corners that are listed.
    pub(super) fn new(mut vertices: Vec<u32>, sizes: Vec<u32>, left_handed: bool) -> Result<Self, Damage> {
        let total: u64 = sizes.iter().map(|size| u64::from(*size)).sum();
        if total != vertices.len() as u64 {
            return Err(Damage::plain(format!(
                "the faces count {total} corners, but {} are listed",
                vertices.len()
            )));
        }
        let vertices_needed = vertices.iter().max().map_or(0, |index| *index as usize + 1);
        if left_handed {
            turn_round(&mut vertices, &sizes);
        }
        Ok(Self { vertices, sizes, vertices_needed })
    }
}

/// A mesh that may change.
#[derive(Debug)]
pub(super) struct Polygons {
    pub(super) points: Samples<Vec<[f32; 3]>>,
    pub(super) faces: Samples<Faces>,
    pub(super) skin: Option<Skin>,
}

impl Polygons {
    /// How it changes, its transforms aside.
    pub(super) fn topology(&self) -> Topology {
        if !self.faces.is_constant() {
            Topology::Heterogeneous
        } else if !self.points.is_constant() || self.skin.as_ref().is_some_and(Skin::moves) {
            Topology::Homogeneous
        } else {
            Topology::Constant
        }
    }

    /// When it changes, its transforms aside.
    pub(super) fn times_s(&self) -> Vec<f64> {
        let skin = self.skin.as_ref().map(Skin::times_s).unwrap_or_default();
        merged([self.points.times_s(), self.faces.times_s(), &skin])
    }

    pub(super) fn first_size(&self) -> MeshSize {
        MeshSize { vertices: self.points.first().len(), faces: self.faces.first().sizes.len() }
    }

    /// The mesh at a time, put into the world by `world`, or by `skeleton_world` where bones move it.
    ///
    /// # Errors
    /// Faces or weights that do not fit the points.
    pub(super) fn read(
        &self,
        time_s: f64,
        world: DMat4,
        skeleton_world: DMat4,
        mesh: &mut Mesh,
    ) -> Result<(), Damage> {
        mesh.positions.clear();
        mesh.face_vertices.clear();
        mesh.face_sizes.clear();
        let bracket = self.points.bracket(time_s);
        // The faces that belong to a sample of points are those of its time.
        let time_of = |index: usize| self.points.times_s().get(index).copied().unwrap_or(time_s);
        let faces = self.faces.held(time_of(bracket.floor));
        let faces_after = self.faces.held(time_of(bracket.ceiling));
        let (before, after, fraction) = self.points.around(time_s);
        let of = |point: &[f32; 3]| DVec3::from(point.map(f64::from));
        let alike = before.len() == after.len() && (Arc::ptr_eq(faces, faces_after) || faces == faces_after);
        let mut points: Vec<DVec3> = if alike && fraction > 0.0 {
            before.iter().zip(after.iter()).map(|(a, b)| of(a).lerp(of(b), fraction)).collect()
        } else {
            before.iter().map(of).collect()
        };
        if faces.vertices_needed > points.len() {
            return Err(Damage::plain(format!(
                "the faces name vertex {}, but there are {}",
                faces.vertices_needed - 1,
                points.len()
            )));
        }
        let by_bones = match &self.skin {
            Some(skin) => skin.bend(time_s, &mut points)?,
            None => false,
        };
        let world = DAffine3::from_mat4(if by_bones { skeleton_world } else { world });
        mesh.positions.extend(points.iter().map(|point| world.transform_point3(*point).as_vec3().to_array()));
        mesh.face_sizes.extend_from_slice(&faces.sizes);
        mesh.face_vertices.extend_from_slice(&faces.vertices);
        // A mirror turns the faces round.
        if world.matrix3.determinant() < 0.0 {
            turn_round(&mut mesh.face_vertices, &faces.sizes);
        }
        Ok(())
    }
}

/// Gives each face the other side; `sizes` add up to the number of vertices.
fn turn_round(vertices: &mut [u32], sizes: &[u32]) {
    let mut rest = vertices;
    for &size in sizes {
        let Some((face, others)) = rest.split_at_mut_checked(size as usize) else { return };
        face.reverse();
        rest = others;
    }
}
