//! Universal Scene Description (`.usda`, `.usdc`, `.usd`, `.usdz`).
//!
//! [`Usd::open`] composes the stage (sublayers, references, payloads, variants, inherits) with the
//! crate `openusd` and takes from it what is needed. From then on nothing is read any more, and an
//! opened file can be shared between threads.
//!
//! ```no_run
//! use froufrou::scene::animation::{Animation, Mesh};
//! use froufrou::scene::usd::Usd;
//!
//! # fn main() -> froufrou::Result<()> {
//! let animation = Usd::open("dance.usdc")?;
//! let mut mesh = Mesh::default();
//! let body = animation.objects().iter().position(|object| object.path == "/root/Body/Body");
//! animation.mesh(body.expect("a body"), 0.5, &mut mesh)?;
//! println!("{} vertices", mesh.positions.len());
//! # Ok(())
//! # }
//! ```
//!
//! # What is read
//! - Text and binary layers (from version 0.4 on) and packages, whose first part is the root.
//! - Other layers that the file refers to, from its own folder and below, never from elsewhere and
//!   never over a network. A layer that is missing is an error.
//! - Every prim that can have a transform, under its path on the stage: all operations of
//!   `xformOpOrder`, inverted ones and `!resetXformStack!`.
//! - `Mesh`: points and faces, changing or not, of either handedness; of subdivision surfaces the
//!   cage. Skeletons with linear skinning and blend shapes with shapes in between (UsdSkel).
//! - `Camera`: its transform.
//! - `upAxis`, `metersPerUnit`, and `timeCodesPerSecond` or `framesPerSecond`. A file that does not
//!   say so is Y up, in centimetres, at 24 time codes a second: that is USD's rule.
//!
//! # Spaces
//! Positions are in metres, Y up. [`transform`](super::animation::Animation::transform) turns the
//! object's own space into the world, and that space too is taken as metres, Y up: what is 10 cm
//! above an object is `[0, 0.1, 0]` whatever the file's units are, as it is in the Alembic file of
//! the same Blender scene. A camera's own space is always that of a camera: it looks along −Z.
//!
//! # What is deliberately not read
//! - Visibility, purpose, normals, materials, lights' colours, extents: none is where a thing is.
//! - Instancers of points: their prototypes appear once, where they stand.
//! - Skinning by dual quaternions is done linearly.
//! - Packages within packages, packages that other files refer to, custom data on references.
//! - Values that are blocked: the sample before holds.
//!
//! # Between samples
//! As in Alembic files: positions are interpolated linearly where the faces are the same before and
//! after, else the sample before holds; transforms are taken apart. Only where a rotation moves by
//! half a turn or more between two samples is each operation interpolated for itself, as USD does.
//! Joints of skeletons are interpolated, not the points that hang on them.
//!
//! # Memory
//! All layers are in memory while the file is opened, and afterwards all samples of what is used. It
//! is no more than 64 times the layers' length and 32 MiB; a binary file of 24 MB (27 556 points,
//! 121 samples) takes 108 MB while it is opened. Nothing is streamed: a cache of many gigabytes is
//! better read as Alembic. A stage may
//! have 8192 prims and one more for every 32 bytes of its layers; while it is composed each takes about
//! 8 kB.
//!
//! # Damaged files
//! Every count and offset of a binary layer is held against its length before the library decodes
//! it, and brackets in text must not nest absurdly. The library runs in a thread of its own, where a
//! panic ends nothing but the reading (its message is printed; a program built to abort on panics
//! ends there).

mod crate_check;
mod fault;
mod layers;
mod mesh;
mod package;
mod samples;
mod skeleton;
mod stage;
mod value;
mod xform;

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DMat4, DVec3, DVec4};

use self::fault::{DAMAGED, Damage};
use self::layers::{Layers, Log};
use self::stage::{Node, Objects};
use super::animation::{Animation, Mesh, MeshSize, ObjectInfo, ObjectKind, Stated, Transform};
use super::conventions::UpAxis;
use crate::{Error, Place, Result};

/// The stack of the thread in which the library runs; it calls itself for what lies in each other.
const STACK_BYTES: usize = 256 << 20;

/// What a file says about all of its stage.
#[derive(Debug, Clone, PartialEq)]
pub struct Facts {
    /// Up is +Z in the file; else it is +Y.
    pub z_up: bool,
    /// The file's unit in metres.
    pub metres_per_unit: f64,
    /// The file itself says what its unit is; else it is USD's rule.
    pub unit_is_written: bool,
    /// Time codes in a second.
    pub codes_per_second: f64,
    /// Frames in a second, where the file says so.
    pub frames_per_second: Option<f64>,
    /// What the file says about itself, such as the program that wrote it.
    pub comment: Option<String>,
}

/// An open USD file.
#[derive(Debug)]
pub struct Usd {
    path: PathBuf,
    objects: Vec<ObjectInfo>,
    nodes: Vec<Node>,
    facts: Facts,
    /// From the stage's world to metres, Y up.
    world: DMat4,
}

/// True for a file that begins like a USD file: text, binary, or a package.
///
/// # Errors
/// A file that cannot be read.
pub fn is_usd(path: &Path) -> Result<bool> {
    let mut head = Vec::new();
    let file = File::open(path).map_err(|fault| Error::io("open", path, fault))?;
    file.take(8).read_to_end(&mut head).map_err(|fault| Error::io("read", path, fault))?;
    Ok(head.starts_with(b"PXR-USDC") || head.starts_with(b"#usda") || is_package(&head))
}

fn is_package(head: &[u8]) -> bool {
    head.starts_with(b"PK\x03\x04")
}

impl Usd {
    /// Opens a file and reads what is in it.
    ///
    /// # Errors
    /// A file that cannot be read, is no USD file, refers to layers that cannot or must not be read,
    /// or is damaged.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        if !is_usd(path)? {
            let text =
                "not a USD file: it begins neither with `#usda` nor with `PXR-USDC`, nor is it a package";
            let error = Error::new(text).in_file(path).at(Place::Byte(0));
            return Err(error.help("it may be of another format, or damaged"));
        }
        let owned = path.to_owned();
        let reading = std::thread::Builder::new().name("usd".into()).stack_size(STACK_BYTES);
        let reading = reading.spawn(move || read(&owned)).map_err(|fault| Error::io("read", path, fault))?;
        let Objects { infos, nodes, facts } = reading.join().unwrap_or_else(|_| {
            let error = Error::new("the file is corrupt: its layers do not decode").in_file(path);
            Err(error.at(Place::Part("the whole stage".into())).help(DAMAGED))
        })?;
        let mut world = DMat4::from_scale(DVec3::splat(facts.metres_per_unit));
        if facts.z_up {
            // y goes to −z and z to y.
            world *= DMat4::from_cols(DVec4::X, -DVec4::Z, DVec4::Y, DVec4::W);
        }
        Ok(Self { path: path.to_owned(), objects: infos, nodes, facts, world })
    }

    /// The path it was opened by.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What the file says about all of its stage.
    pub fn facts(&self) -> &Facts {
        &self.facts
    }

    fn node(&self, object: usize, time_s: f64) -> Result<&Node> {
        let node = self.nodes.get(object).ok_or_else(|| {
            Error::new(format!("there is no object {object}; there are {}", self.nodes.len()))
                .in_file(&self.path)
        })?;
        if time_s.is_nan() {
            return Err(self.error(Damage::plain("the time asked for is not a number"), object));
        }
        Ok(node)
    }

    fn error(&self, damage: Damage, object: usize) -> Error {
        let path = self.objects.get(object).map_or("", |object| object.path.as_str());
        damage.in_prim(&self.path, path)
    }

    /// Local to the stage's world, in the file's units.
    fn staged(&self, object: usize, time_s: f64) -> DMat4 {
        let mut world = DMat4::IDENTITY;
        let mut current = self.nodes.get(object);
        while let Some(node) = current {
            world = node.xform.at(time_s) * world;
            let parent = node.parent.filter(|_| !node.xform.resets);
            current = parent.and_then(|parent| self.nodes.get(parent));
        }
        world
    }
}

/// Composes the stage and takes from it what is needed.
fn read(path: &Path) -> Result<Objects> {
    let mut head = [0; 4];
    let file = File::open(path).map_err(|fault| Error::io("open", path, fault))?;
    let is_package = file.take(4).read(&mut head).is_ok() && is_package(&head);
    let log = Arc::new(Log::default());
    let (layers, root) = Layers::new(path, is_package, Arc::clone(&log))?;
    // What was found while looking for layers says more than what the library makes of it.
    let fault = |fault: &dyn std::fmt::Display| {
        log.first_fault().unwrap_or_else(|| {
            Error::new(format!("the file is damaged: {fault:#}"))
                .in_file(path)
                .at(Place::Part("the whole stage".into()))
                .help(DAMAGED)
        })
    };
    let stage = openusd::usd::Stage::builder().resolver(layers).open(&root);
    let stage = stage.map_err(|error| fault(&error))?;
    let objects = stage::read(&stage, path, &log);
    if let Some(error) = log.first_fault() {
        return Err(error);
    }
    let objects = objects?;
    match stage.composition_errors().first() {
        Some(error) => Err(fault(error)),
        None => Ok(objects),
    }
}

impl Animation for Usd {
    fn objects(&self) -> &[ObjectInfo] {
        &self.objects
    }

    fn transform(&self, object: usize, time_s: f64) -> Result<Transform> {
        self.node(object, time_s)?;
        let is_camera = self.objects.get(object).is_some_and(|object| object.kind == ObjectKind::Camera);
        let local = match is_camera {
            true => DMat4::from_scale(DVec3::splat(1.0 / self.facts.metres_per_unit)),
            false => self.world.inverse(),
        };
        Ok((self.world * self.staged(object, time_s) * local).transpose().to_cols_array_2d())
    }

    fn mesh(&self, object: usize, time_s: f64, mesh: &mut Mesh) -> Result<()> {
        let node = self.node(object, time_s)?;
        let Some(polygons) = &node.polygons else {
            let damage = Damage::plain("the object has no mesh: ask for a mesh object, or for the transform");
            return Err(self.error(damage, object));
        };
        let world = self.world * self.staged(object, time_s);
        let skeleton =
            polygons.skin.as_ref().map(|skin| self.world * self.staged(skin.skeleton.object, time_s));
        let read = polygons.read(time_s, world, skeleton.unwrap_or(world), mesh);
        read.map_err(|damage| self.error(damage, object))
    }

    fn mesh_size(&self, object: usize) -> Result<Option<MeshSize>> {
        Ok(self.node(object, 0.0)?.polygons.as_ref().map(|polygons| polygons.first_size()))
    }

    fn stated(&self) -> Stated {
        let up = if self.facts.z_up { UpAxis::Z } else { UpAxis::Y };
        Stated { up, unit_m: self.facts.metres_per_unit }
    }
}
