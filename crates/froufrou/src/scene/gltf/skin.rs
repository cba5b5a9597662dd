//! Skins: which joints pull at each vertex, and where they pull it.

use glam::{DAffine3, DMat4, DVec3};

use super::accessor::{Data, Integers};
use super::document::{self, Kind};
use super::fault::{Budget, damage};
use super::node::Nodes;
use crate::Result;

/// A skin of the document.
#[derive(Debug)]
pub(super) struct Skin {
    /// The nodes that are its joints.
    pub(super) joints: Vec<usize>,
    /// From the space of the mesh into that of each joint.
    inverse_bind: Vec<DAffine3>,
}

impl Skin {
    /// From the document.
    ///
    /// # Errors
    /// Joints that are not there; matrices that cannot be read or are too few.
    pub(super) fn new(
        number: usize,
        written: document::Skin,
        nodes: usize,
        data: &Data,
        budget: &mut Budget,
    ) -> Result<Self> {
        let part = || format!("skins[{number}]");
        if let Some(joint) = written.joints.iter().find(|&&joint| joint >= nodes) {
            return Err(damage(part(), format!("there is no node {joint} for a joint; there are {nodes}")));
        }
        let mut inverse_bind = Vec::new();
        budget.charge((size_of::<DAffine3>() * written.joints.len()) as u64, part)?;
        match written.inverse_bind_matrices {
            None => inverse_bind.resize(written.joints.len(), DAffine3::IDENTITY),
            Some(accessor) => {
                budget.charge((data.count(accessor, &part)? as u64).saturating_mul(64), part)?;
                let matrices = data.floats(accessor, Kind::Mat4, Integers::Refused, &part)?;
                let matrices = matrices.as_chunks::<16>().0;
                if matrices.len() < written.joints.len() {
                    return Err(damage(
                        part(),
                        format!("{} joints have {} matrices", written.joints.len(), matrices.len()),
                    ));
                }
                let matrix =
                    |matrix: &[f32; 16]| DAffine3::from_mat4(DMat4::from_cols_array(&matrix.map(f64::from)));
                inverse_bind.extend(matrices.iter().take(written.joints.len()).map(matrix));
            }
        }
        Ok(Self { joints: written.joints, inverse_bind })
    }

    /// Where its joints are at a time.
    pub(super) fn at(&self, time_s: f64, nodes: &Nodes) -> Skinned {
        let worlds = nodes.worlds(&self.joints, time_s);
        Skinned(worlds.into_iter().zip(&self.inverse_bind).map(|(world, bind)| world * *bind).collect())
    }
}

/// The matrices by which the joints of a skin move what they pull at, from the space of the mesh
/// into the world.
#[derive(Debug)]
pub(super) struct Skinned(Vec<DAffine3>);

impl Skinned {
    pub(super) fn joint_count(&self) -> usize {
        self.0.len()
    }

    /// Whether most joints turn the mesh's inside out.
    pub(super) fn mirrors(&self) -> bool {
        let mirroring = self.0.iter().filter(|matrix| matrix.matrix3.determinant() < 0.0).count();
        2 * mirroring > self.0.len()
    }

    /// Linear blend skinning: Σ wᵢ Mᵢ p / Σ wᵢ, for joints that are there.
    pub(super) fn transform(&self, influences: &[(u32, f32)], point: DVec3) -> DVec3 {
        let (mut moved, mut sum) = (DVec3::ZERO, 0.0);
        for &(joint, weight) in influences {
            let weight = f64::from(weight);
            moved += weight * self.0[joint as usize].transform_point3(point);
            sum += weight;
        }
        moved * (1.0 / sum)
    }
}

/// The joints that pull at each vertex and how much, as parts of their sum.
#[derive(Debug)]
pub(super) struct Influences {
    /// Where the influences of each vertex end.
    ends: Vec<u32>,
    influences: Vec<(u32, f32)>,
    /// The greatest joint.
    greatest: Option<u32>,
}

impl Influences {
    /// From accessors of joints and weights, four of each a vertex.
    ///
    /// # Errors
    /// Arrays that cannot be read or are too long to be numbered.
    pub(super) fn read(
        sets: &[(usize, usize)],
        vertices: usize,
        joints: usize,
        data: &Data,
        part: &dyn Fn() -> String,
    ) -> Result<Self> {
        let mut lists = Vec::with_capacity(sets.len());
        for &(joints, weights) in sets {
            let joints = data.indices(joints, Kind::Vec4, part)?;
            lists.push((joints, data.floats(weights, Kind::Vec4, Integers::Normalized, part)?));
        }
        let mut ends = Vec::with_capacity(vertices);
        let mut influences: Vec<(u32, f32)> = Vec::new();
        let mut greatest = None;
        for vertex in 0..vertices {
            let first = influences.len();
            let own = lists.iter().flat_map(|(joints, weights)| {
                let at = |component: usize| 4 * vertex + component;
                (0..4).map(move |component| (joints[at(component)], weights[at(component)]))
            });
            influences.extend(own.filter(|(_, weight)| *weight != 0.0));
            let sum: f64 = influences[first..].iter().map(|(_, weight)| f64::from(*weight)).sum();
            if sum == 0.0 {
                // Nothing pulls at it: it follows its first joint.
                influences.truncate(first);
                influences.push((lists.first().map_or(0, |(joints, _)| joints[4 * vertex]), 1.0));
            }
            greatest = influences[first..].iter().map(|(joint, _)| *joint).max().max(greatest);
            let end = u32::try_from(influences.len());
            ends.push(end.map_err(|_| damage(part(), "more than 4294967295 influences"))?);
        }
        let all = Self { ends, influences, greatest };
        all.check(joints).map_err(|what| damage(part(), what))?;
        Ok(all)
    }

    /// Whether a skin of so many joints has all that are named here.
    pub(super) fn check(&self, joints: usize) -> Result<(), String> {
        match self.greatest {
            Some(greatest) if greatest as usize >= joints => {
                Err(format!("a vertex hangs on joint {greatest}, but the skin has {joints}"))
            }
            _ => Ok(()),
        }
    }

    /// What it takes in memory.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.ends.as_slice()) + size_of_val(self.influences.as_slice())
    }

    /// The joints that pull at a vertex, with their weights.
    pub(super) fn of(&self, vertex: usize) -> &[(u32, f32)] {
        let end = |vertex: usize| self.ends.get(vertex).map_or(0, |&end| end as usize);
        let first = vertex.checked_sub(1).map_or(0, end);
        self.influences.get(first..end(vertex)).unwrap_or_default()
    }
}
