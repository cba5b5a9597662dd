//! Meshes: primitives joined into one, morphed, then moved by their node or by the joints of a skin.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DAffine3, DVec3};

use super::accessor::{Data, Integers};
use super::cache::Cache;
use super::document::{self, Kind, Primitive};
use super::fault::damage;
use super::skin::{Influences, Skinned};
use crate::Result;
use crate::scene::animation::Mesh;

/// Vertices and corners that even a small file may have.
const SMALL: u64 = 1 << 20;

/// A mesh of the document.
#[derive(Debug)]
pub(super) struct Shape {
    number: usize,
    blocks: Vec<Block>,
    faces: Vec<FaceList>,
    pub(super) vertices: usize,
    /// How many morph targets it has.
    pub(super) targets: usize,
    /// The weights of its targets unless its node has others.
    pub(super) weights: Vec<f32>,
}

/// Vertices that primitives share.
#[derive(Debug)]
struct Block {
    /// The primitive that names them first.
    primitive: usize,
    /// The number of its first vertex in the mesh.
    first: usize,
    count: usize,
    arrays: Arrays,
}

/// The accessors of a block.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
struct Arrays {
    positions: usize,
    targets: Vec<Option<usize>>,
    /// Joints and weights, four of each a vertex.
    influences: Vec<(usize, usize)>,
}

/// The faces of one primitive.
#[derive(Debug)]
struct FaceList {
    primitive: usize,
    block: usize,
    indices: Option<usize>,
    mode: u32,
}

/// What is kept of meshes between frames.
#[derive(Debug)]
pub(super) struct Caches {
    vectors: Cache<usize, Vec<f32>>,
    faces: Cache<usize, Vec<u32>>,
    influences: Cache<(usize, usize), Influences>,
}

impl Caches {
    /// Caches of so many bytes each.
    pub(super) fn new(limit: u64) -> Self {
        Self { vectors: Cache::new(limit), faces: Cache::new(limit), influences: Cache::new(limit) }
    }
}

impl Shape {
    /// From the document, without reading arrays.
    ///
    /// # Errors
    /// Accessors that are not there or are of differing length; more than the file's size allows.
    pub(super) fn new(number: usize, mesh: &document::Mesh, data: &Data) -> Result<Self> {
        let mut shape = Self {
            number,
            blocks: Vec::new(),
            faces: Vec::new(),
            vertices: 0,
            targets: 0,
            weights: mesh.weights.clone().unwrap_or_default(),
        };
        let mut known: HashMap<Arrays, usize> = HashMap::new();
        for (index, primitive) in mesh.primitives.iter().enumerate() {
            let part = || format!("meshes[{number}].primitives[{index}]");
            shape.targets = shape.targets.max(primitive.targets.len());
            let Some(arrays) = Arrays::new(primitive, &part)? else { continue };
            let block = match known.get(&arrays) {
                Some(block) => *block,
                None => {
                    let count = arrays.count(data, &part)?;
                    let block =
                        Block { primitive: index, first: shape.vertices, count, arrays: arrays.clone() };
                    shape.vertices = shape.vertices.saturating_add(count);
                    shape.blocks.push(block);
                    *known.entry(arrays).or_insert(shape.blocks.len() - 1)
                }
            };
            let mode = primitive.mode.unwrap_or(4);
            match mode {
                0..=3 => {}
                4..=6 => {
                    let indices = primitive.indices;
                    shape.faces.push(FaceList { primitive: index, block, indices, mode });
                }
                _ => return Err(damage(part(), format!("there is no mode {mode}"))),
            }
        }
        shape.check_size(data)?;
        Ok(shape)
    }

    /// A small file can name one array again and again.
    fn check_size(&self, data: &Data) -> Result<()> {
        let (mut corners, mut pulls, mut deltas) = (0_u64, 0_u64, 0_u64);
        for block in &self.blocks {
            let times = |lists: usize| (block.count as u64).saturating_mul(lists as u64);
            pulls = pulls.saturating_add(times(block.arrays.influences.len()));
            deltas = deltas.saturating_add(times(block.arrays.targets.len()));
        }
        for list in &self.faces {
            let part = || self.part(list.primitive);
            let count = match list.indices {
                Some(accessor) => data.count(accessor, &part)?,
                None => self.blocks[list.block].count,
            };
            corners =
                corners.saturating_add((count as u64).saturating_mul(if list.mode == 4 { 1 } else { 3 }));
        }
        let most = data.backed().saturating_mul(3).saturating_add(SMALL);
        // Sparse targets have few bytes for many vertices.
        let most_deltas = data.backed().saturating_mul(64).saturating_add(16 * SMALL);
        if self.vertices as u64 > most || corners > most || pulls > most || deltas > most_deltas {
            return Err(damage(
                format!("meshes[{}]", self.number),
                format!(
                    "{} vertices, {corners} corners, {pulls} sets of joints and {deltas} morphed vertices are \
                     too many for the file's size",
                    self.vertices
                ),
            ));
        }
        u32::try_from(self.vertices).map(|_| ()).map_err(|_| {
            damage(format!("meshes[{}]", self.number), format!("{} vertices are too many", self.vertices))
        })
    }

    fn part(&self, primitive: usize) -> String {
        format!("meshes[{}].primitives[{primitive}]", self.number)
    }

    /// The mesh in world space, with these weights of its targets. `world` moves what has no joints.
    ///
    /// # Errors
    /// Arrays that cannot be read; faces of vertices that are not there; joints the skin lacks.
    pub(super) fn read(
        &self,
        weights: &[f64],
        world: DAffine3,
        skinned: Option<&Skinned>,
        data: &Data,
        caches: &Caches,
        mesh: &mut Mesh,
    ) -> Result<()> {
        mesh.positions.clear();
        mesh.face_vertices.clear();
        mesh.face_sizes.clear();
        mesh.positions.reserve(self.vertices);
        for (index, block) in self.blocks.iter().enumerate() {
            let part = || self.part(block.primitive);
            let base = block.vectors(block.arrays.positions, data, caches, &part)?;
            let base = base.as_chunks::<3>().0;
            match block.morphed(base, weights, data, caches, &part)? {
                Some(morphed) => {
                    self.place(index, morphed.iter().copied(), world, skinned, data, caches, mesh)?;
                }
                None => {
                    let base = base.iter().map(|point| DVec3::from_array(point.map(f64::from)));
                    self.place(index, base, world, skinned, data, caches, mesh)?;
                }
            }
        }
        let faces = caches.faces.get(self.number, || self.read_faces(data), |faces| 4 * faces.len())?;
        mesh.face_vertices.extend_from_slice(&faces);
        mesh.face_sizes.resize(faces.len() / 3, 3);
        let mirrored = match skinned {
            Some(skinned) => skinned.mirrors(),
            None => world.matrix3.determinant() < 0.0,
        };
        if mirrored {
            for face in mesh.face_vertices.as_chunks_mut::<3>().0 {
                face.swap(1, 2);
            }
        }
        Ok(())
    }

    /// Moves the points of a block into the world.
    #[expect(clippy::too_many_arguments, reason = "they are what a mesh is made from")]
    fn place(
        &self,
        block: usize,
        points: impl Iterator<Item = DVec3>,
        world: DAffine3,
        skinned: Option<&Skinned>,
        data: &Data,
        caches: &Caches,
        mesh: &mut Mesh,
    ) -> Result<()> {
        let own = &self.blocks[block];
        match skinned.filter(|_| !own.arrays.influences.is_empty()) {
            None => {
                let moved = |point| world.transform_point3(point).as_vec3().to_array();
                mesh.positions.extend(points.map(moved));
            }
            Some(skinned) => {
                let part = || self.part(own.primitive);
                let read = || {
                    Influences::read(&own.arrays.influences, own.count, skinned.joint_count(), data, &part)
                };
                let key = (self.number, block);
                let influences = caches.influences.get(key, read, Influences::bytes)?;
                influences.check(skinned.joint_count()).map_err(|what| damage(part(), what))?;
                let moved =
                    |(vertex, point)| skinned.transform(influences.of(vertex), point).as_vec3().to_array();
                mesh.positions.extend(points.enumerate().map(moved));
            }
        }
        Ok(())
    }

    /// The corners of all triangles, as their primitives wind them.
    fn read_faces(&self, data: &Data) -> Result<Vec<u32>> {
        let mut corners = Vec::new();
        for list in &self.faces {
            let Some(block) = self.blocks.get(list.block) else { continue };
            let part = || self.part(list.primitive);
            let indices = match list.indices {
                Some(accessor) => data.indices(accessor, Kind::Scalar, &part)?,
                None => (0..block.count as u32).collect(),
            };
            if let Some(&beyond) = indices.iter().find(|&&index| index as usize >= block.count) {
                return Err(damage(
                    part(),
                    format!("its faces name vertex {beyond}, but there are {}", block.count),
                ));
            }
            let first = block.first as u32;
            let mut add = |a: u32, b: u32, c: u32| corners.extend([a + first, b + first, c + first]);
            match list.mode {
                4 => {
                    let (triangles, rest) = indices.as_chunks::<3>();
                    if !rest.is_empty() {
                        return Err(damage(part(), format!("{} corners make no triangles", indices.len())));
                    }
                    triangles.iter().for_each(|&[a, b, c]| add(a, b, c));
                }
                5 => {
                    for (place, corner) in indices.windows(3).enumerate() {
                        let [a, b, c] = [corner[0], corner[1], corner[2]];
                        // Exporters stitch strips together by triangles without area.
                        if a != b && b != c && a != c {
                            if place % 2 == 0 { add(a, b, c) } else { add(a, c, b) }
                        }
                    }
                }
                _ => {
                    if let Some((&centre, rim)) = indices.split_first() {
                        rim.windows(2).for_each(|edge| add(edge[0], edge[1], centre));
                    }
                }
            }
        }
        Ok(corners)
    }
}

impl Arrays {
    /// The accessors of a primitive; nothing without positions.
    fn new(primitive: &Primitive, part: &dyn Fn() -> String) -> Result<Option<Self>> {
        let attribute = |name: &str| primitive.attributes.get(name).copied();
        let Some(positions) = attribute("POSITION") else { return Ok(None) };
        let mut influences = Vec::new();
        while let Some(joints) = attribute(&format!("JOINTS_{}", influences.len())) {
            let name = format!("WEIGHTS_{}", influences.len());
            let Some(weights) = attribute(&name) else {
                return Err(damage(part(), format!("it has JOINTS_{} but no {name}", influences.len())));
            };
            influences.push((joints, weights));
        }
        let targets = primitive.targets.iter().map(|target| target.position).collect();
        Ok(Some(Self { positions, targets, influences }))
    }

    /// How many vertices all of them have.
    fn count(&self, data: &Data, part: &dyn Fn() -> String) -> Result<usize> {
        let count = data.count(self.positions, part)?;
        let others = self.targets.iter().copied().flatten();
        for other in others.chain(self.influences.iter().flat_map(|&(joints, weights)| [joints, weights])) {
            let found = data.count(other, part)?;
            if found != count {
                let what = format!("it has {count} positions, but the accessor {other} has {found} elements");
                return Err(damage(part(), what));
            }
        }
        Ok(count)
    }
}

impl Block {
    fn vectors(
        &self,
        accessor: usize,
        data: &Data,
        caches: &Caches,
        part: &dyn Fn() -> String,
    ) -> Result<Arc<Vec<f32>>> {
        let read = || data.floats(accessor, Kind::Vec3, Integers::AsWritten, part);
        caches.vectors.get(accessor, read, |vectors| size_of_val(vectors.as_slice()))
    }

    /// The points moved by their morph targets; nothing where none has a weight. One target is in
    /// memory at a time, beside those that the cache holds.
    fn morphed(
        &self,
        base: &[[f32; 3]],
        weights: &[f64],
        data: &Data,
        caches: &Caches,
        part: &dyn Fn() -> String,
    ) -> Result<Option<Vec<DVec3>>> {
        let mut morphed: Option<Vec<DVec3>> = None;
        for (target, &weight) in self.arrays.targets.iter().zip(weights) {
            let Some(target) = target.filter(|_| weight != 0.0) else { continue };
            let deltas = self.vectors(target, data, caches, part)?;
            let point = |point: &[f32; 3]| DVec3::from_array(point.map(f64::from));
            let points = morphed.get_or_insert_with(|| base.iter().map(point).collect());
            for (moved, delta) in points.iter_mut().zip(deltas.as_chunks::<3>().0) {
                *moved += weight * point(delta);
            }
        }
        Ok(morphed)
    }
}
