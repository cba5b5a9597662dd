//! Alembic archives (`.abc`): baked animation as nearly every 3D program exports it.
//!
//! [`Alembic::open`] reads an index of the file: its objects, what they are and when they change.
//! Samples are fetched by positioned reads as times are asked for, and the last two of each mesh
//! and transform are kept, so that a file of any length is read in the memory of a few frames. An
//! opened archive can be shared between threads.
//!
//! ```no_run
//! use froufrou::scene::alembic::Alembic;
//! use froufrou::scene::animation::{Animation, Mesh, ObjectKind};
//!
//! # fn main() -> froufrou::Result<()> {
//! let animation = Alembic::open("dance.abc")?;
//! let mut mesh = Mesh::default();
//! for (index, object) in animation.objects().iter().enumerate() {
//!     if object.kind != ObjectKind::Mesh {
//!         continue;
//!     }
//!     for frame in 0..object.key_times.len() {
//!         let time_s = object.key_times.get(frame).unwrap_or_default();
//!         animation.mesh(index, time_s, &mut mesh)?;
//!         println!("{} at {time_s} s: {:?}", object.path, mesh.positions.first());
//!     }
//! }
//! # Ok(())
//! # }
//! ```
//!
//! # What is read
//! - The container Ogawa, version 1. The older HDF5 kind is refused with advice.
//! - `Xform`: all seven operations and the flag by which an object ignores what is above it.
//! - `PolyMesh` with constant, homogeneous and heterogeneous topology; of `SubD` the control cage.
//! - `Camera`: its transform, focal length and aperture.
//! - Uniform, cyclic and acyclic time sampling; samples that repeat and are stored once.
//! - Instances: an object with the metadata `isInstance=1` appears with everything that is at and
//!   below the object its `.instanceSource` names.
//!
//! Everything else (curves, points, NURBS, lights, unknown schemas) is there as
//! [`ObjectKind::Other`](super::animation::ObjectKind::Other) with its transform.
//!
//! # What is deliberately not read
//! - Visibility: a hidden object sounds if the scene says so.
//! - Normals, texture coordinates, velocities, face sets, bounds and user properties.
//! - Units: Alembic has none. A number is taken as a metre, as Blender and Houdini write it; a file
//!   in centimetres, as from Maya, is a hundred times too big. Up is +Y by convention.
//! - The dimensions of arrays: they say no more than the size of their values does.
//!
//! # Between samples
//! Positions are interpolated linearly where the faces are the same before and after, else the
//! sample before holds. Transforms are taken apart: translation and scale are interpolated linearly,
//! rotation spherically by the shorter way.
//!
//! Values are given as they are: a NaN in the file is a NaN in the transform or in the vertex, of
//! which the transform then spreads it to all three coordinates.
//!
//! # Damaged files
//! Every count and size is held against the file's length before memory is taken for it, the work
//! and the memory of the index are bounded by the file's size, and the tree is walked without
//! recursion. What does not fit is an [`Error`] that names the file, the object or the byte.

mod archive;
mod camera;
mod fault;
mod hierarchy;
mod ogawa;
mod polymesh;
mod property;
mod time_sampling;
mod xform;

use std::path::{Path, PathBuf};

use glam::{DAffine3, DMat4};

use self::archive::Archive;
pub use self::camera::Lens;
use self::fault::{Allowance, Fault, Outcome};
use self::hierarchy::{Hierarchy, Node, Schema};
use super::animation::{Animation, Mesh, MeshSize, ObjectInfo, Transform};
use super::sample_cache::Ledger;
use crate::{Error, Result};

/// What even a small file may take: room for some ten thousand instances.
const SMALL: u64 = 16 << 20;

/// An open Alembic archive.
#[derive(Debug)]
pub struct Alembic {
    path: PathBuf,
    archive: Archive,
    objects: Vec<ObjectInfo>,
    nodes: Vec<Node>,
}

impl Alembic {
    /// Opens an archive and reads its index.
    ///
    /// # Errors
    /// A file that cannot be read, is no Alembic archive, is of the HDF5 kind, was never finished
    /// by its writer, or is damaged; the error says where and what to do.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        // A sound file is read once. Its length is not known yet, but nothing before the tree of
        // objects can be read twice.
        let mut reading = Allowance::new(u64::MAX, "reading");
        let archive = Archive::open(path, &mut reading)?;
        let length = archive.ogawa.length();
        let ledger = Ledger::new(length.saturating_mul(4).saturating_add(SMALL));
        let mut reading = Allowance::new(length.saturating_mul(4).saturating_add(SMALL), "reading");
        let mut memory = Allowance::new(length.saturating_mul(16).saturating_add(SMALL), "memory");
        let Hierarchy { objects, nodes } =
            hierarchy::read(path, &archive, &ledger, &mut reading, &mut memory)?;
        Ok(Self { path: path.to_owned(), archive, objects, nodes })
    }

    /// The path it was opened by.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A value of the archive's own metadata, such as `_ai_Application` (the program that wrote
    /// it), `_ai_DateWritten`, `_ai_AlembicVersion` or `FramesPerTimeUnit`.
    pub fn metadata(&self, key: &str) -> Option<&str> {
        self.archive.metadata.get(key)
    }

    /// A camera's lens at a time; nothing for objects that are no cameras or never had a sample.
    ///
    /// # Errors
    /// An object that is not there, or a sample that cannot be read.
    pub fn lens(&self, object: usize, time_s: f64) -> Result<Option<Lens>> {
        let node = self.node(object, time_s)?;
        let Schema::Camera(camera) = &node.schema else { return Ok(None) };
        camera.lens(time_s, &self.archive.ogawa).map_err(|fault| self.error(fault, object))
    }

    fn node(&self, object: usize, time_s: f64) -> Result<&Node> {
        let node = self.nodes.get(object).ok_or_else(|| {
            Error::new(format!("there is no object {object}; there are {}", self.nodes.len()))
                .in_file(&self.path)
        })?;
        if time_s.is_nan() {
            return Err(self.error(Fault::new("the time asked for is not a number", "give seconds"), object));
        }
        Ok(node)
    }

    fn error(&self, fault: Fault, object: usize) -> Error {
        fault.in_object(&self.path, self.objects.get(object).map_or("", |object| object.path.as_str()))
    }

    /// Local to world.
    fn world(&self, object: usize, time_s: f64) -> Outcome<DMat4> {
        let mut world = DMat4::IDENTITY;
        let mut current = self.nodes.get(object);
        while let Some(node) = current {
            if let Schema::Xform(xform) = &node.schema {
                world = xform.local(time_s, &self.archive.ogawa)? * world;
                if !xform.inherits(time_s, &self.archive.ogawa)? {
                    break;
                }
            }
            current = node.parent.and_then(|parent| self.nodes.get(parent));
        }
        Ok(world)
    }
}

impl Animation for Alembic {
    fn objects(&self) -> &[ObjectInfo] {
        &self.objects
    }

    fn transform(&self, object: usize, time_s: f64) -> Result<Transform> {
        self.node(object, time_s)?;
        let world = self.world(object, time_s).map_err(|fault| self.error(fault, object))?;
        Ok(world.transpose().to_cols_array_2d())
    }

    fn mesh(&self, object: usize, time_s: f64, mesh: &mut Mesh) -> Result<()> {
        let node = self.node(object, time_s)?;
        let mut read = || {
            let Schema::Mesh(polymesh) = &node.schema else {
                return Err(Fault::new(
                    "the object has no mesh",
                    "ask for a mesh object, or for the transform",
                ));
            };
            let world = DAffine3::from_mat4(self.world(object, time_s)?);
            polymesh.read(time_s, world, &self.archive.ogawa, mesh)
        };
        read().map_err(|fault| self.error(fault, object))
    }

    fn vertex_values(&self, object: usize, name: &str, time_s: f64, values: &mut Vec<f32>) -> Result<()> {
        let node = self.node(object, time_s)?;
        let Schema::Mesh(polymesh) = &node.schema else {
            let fault = Fault::new("the object has no mesh", "ask for a mesh object");
            return Err(self.error(fault, object));
        };
        polymesh.vertex_values(name, time_s, &self.archive, values).map_err(|fault| self.error(fault, object))
    }

    fn mesh_size(&self, object: usize) -> Result<Option<MeshSize>> {
        Ok(self.node(object, 0.0)?.first_size)
    }
}
