//! glTF 2.0 (`.gltf`, `.glb`): moving nodes, skinned characters and morphed meshes, as game engines and
//! the web use them.
//!
//! [`Gltf::open`] reads the JSON and the keys of one clip. Vertices are fetched by positioned reads
//! when a mesh is asked for; what was read last is kept, up to a limit, so that a file with a morph
//! target for every frame is read in bounded memory. An opened file can be shared between threads.
//!
//! ```no_run
//! use froufrou::scene::animation::{Animation, Mesh, ObjectKind};
//! use froufrou::scene::gltf::Gltf;
//!
//! # fn main() -> froufrou::Result<()> {
//! let animation = Gltf::open_clip("fox.glb", Some("Run"))?;
//! let mut mesh = Mesh::default();
//! for (index, object) in animation.objects().iter().enumerate() {
//!     if object.kind == ObjectKind::Mesh {
//!         animation.mesh(index, 0.4, &mut mesh)?;
//!         println!("{}: {:?}", object.path, mesh.positions.first());
//!     }
//! }
//! # Ok(())
//! # }
//! ```
//!
//! # What is read
//! - Every node of the scene that the file opens with (without one, of the first; without any, all
//!   nodes) is an object. Its path is made of the names of nodes; one without a name is `node3` by
//!   its number, siblings of one name are `Box`, `Box.2`, `Box.3`, and a `/` in a name becomes `_`.
//! - One clip: the first, or the one that [`Gltf::open_clip`] names. Translations, rotations, scales
//!   and weights of morph targets, in steps, linear and as cubic splines.
//! - Meshes: triangles, strips and fans of all primitives are one mesh of triangles, in the order of
//!   the file; primitives with the same vertices share them. Of points and lines the vertices are
//!   there and no faces. Triangles without area that stitch strips together are left out.
//! - Morph targets, then skins with any number of joints a vertex. Weights count as parts of their sum;
//!   a vertex without any follows its first joint. A skinned mesh hangs on its joints alone, as the
//!   standard has it, and [`transform`](super::animation::Animation::transform) still tells where its
//!   node is: a sound that rides on a character rides better on a joint or a vertex.
//! - All component types, normalised and quantised, interleaved and sparse; data in the file, in text
//!   within it and in files beside it.
//! - Faces are counter-clockwise seen from outside, under a mirroring node too; a skinned mesh counts
//!   as mirrored where most of its joints mirror.
//!
//! # What is deliberately not read
//! - Compressed data (Draco, meshopt) that the file cannot do without: an error says so. So does any
//!   extension that the file requires, unless it changes nothing about where things are.
//! - What `KHR_animation_pointer` animates, instances on the graphics card, levels of detail.
//! - Buffers outside of the file's folder or on the web.
//! - Materials, textures, lights, normals, the lenses of cameras, visibility.
//! - Units: glTF is in metres with +Y up, and that is taken as it is.
//!
//! # Between samples
//! Each track is interpolated as the file says: linear with rotations on the shorter arc, in steps, or
//! by cubic splines whose rotations are brought back to length 1. Before its first key and after its
//! last a track stands still. Nodes that the clip does not move stand as they are written.
//!
//! Values are given as they are: a NaN in the file is a NaN in what it moves.
//!
//! # Damaged files
//! Every range is held against its buffer, and every count against the size of all buffers, before
//! memory is taken. Vertices and joints that are not there, nodes that contain themselves, keys that
//! go back in time are an [`Error`] that names the part of the JSON.

mod accessor;
mod buffer;
mod cache;
mod container;
mod document;
mod fault;
mod node;
mod objects;
mod shape;
mod skin;
mod track;

use std::path::{Path, PathBuf};

use glam::DMat4;

use self::accessor::Data;
use self::container::{Container, MAGIC};
use self::document::{Animation as WrittenClip, Document};
use self::fault::{Budget, damage};
use self::node::Nodes;
use self::objects::Object;
use self::shape::{Caches, Shape};
use self::skin::Skin;
use self::track::Keys;
use super::animation::{Animation, Mesh, ObjectInfo, Transform};
use super::positioned_file::PositionedFile;
use crate::{Error, Place, Result};

/// What even a small file may take.
const SMALL: u64 = 16 << 20;

/// The most that is kept of vertices, of faces and of joints between frames, each.
const MOST_KEPT: u64 = 64 << 20;

/// How much of a file is looked at to tell what it is.
const HEAD: u64 = 4096;

/// A clip of a file: an animation by its name.
#[derive(Debug, Clone, PartialEq)]
pub struct Clip {
    /// Its name; `animation3` by its number where it has none.
    pub name: String,
    /// Time of its first key in seconds.
    pub start_s: f64,
    /// Time of its last key in seconds.
    pub end_s: f64,
}

impl Clip {
    /// Seconds from its first to its last key.
    pub fn duration_s(&self) -> f64 {
        self.end_s - self.start_s
    }
}

/// An open glTF file with one of its clips.
#[derive(Debug)]
pub struct Gltf {
    path: PathBuf,
    generator: Option<String>,
    copyright: Option<String>,
    clips: Vec<Clip>,
    clip: Option<usize>,
    data: Data,
    nodes: Nodes,
    shapes: Vec<Shape>,
    skins: Vec<Skin>,
    objects: Vec<Object>,
    infos: Vec<ObjectInfo>,
    caches: Caches,
}

impl Gltf {
    /// Opens a file with its first clip, if it has any.
    ///
    /// # Errors
    /// A file that cannot be read, is not glTF 2.0, needs what is not known here, or is damaged; the
    /// error says where and what to do.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        Self::open_clip(path, None)
    }

    /// Opens a file with the clip of a name, or of a number from 0; with the first where none is named.
    ///
    /// # Errors
    /// As [`Gltf::open`]; a clip that is not there, with those that are.
    pub fn open_clip(path: impl AsRef<Path>, clip: Option<&str>) -> Result<Self> {
        let path = path.as_ref();
        Self::read(path, clip).map_err(|error| error.in_file(path))
    }

    /// Whether bytes from the beginning of a file are those of glTF: the mark of a `.glb`, or JSON
    /// whose first key is one of glTF's.
    pub fn recognises(head: &[u8]) -> bool {
        head.starts_with(MAGIC) || document::begins_like_gltf(head)
    }

    /// Whether a file begins as [`Gltf::recognises`]; false for one that cannot be read.
    pub fn is_at(path: impl AsRef<Path>) -> bool {
        let Ok(file) = PositionedFile::open(path.as_ref()) else { return false };
        let mut head = vec![0; file.length().min(HEAD) as usize];
        file.read_exact_at(&mut head, 0).is_ok() && Self::recognises(&head)
    }

    fn read(path: &Path, clip: Option<&str>) -> Result<Self> {
        let Container { mut document, file, binary } = Container::open(path)?;
        let buffers = buffer::open(path, &mut document, &file, binary)?;
        let compression = document.compression().map(str::to_owned);
        let data = Data {
            accessors: std::mem::take(&mut document.accessors),
            views: std::mem::take(&mut document.buffer_views),
            buffers,
            compression,
        };
        let size = file.length().saturating_add(data.backed());
        let mut budget = Budget::new(size.saturating_mul(16).saturating_add(SMALL));

        let mut nodes = Nodes::new(&document.nodes)?;
        let meshes = document.meshes.iter().enumerate();
        let shapes: Vec<Shape> =
            meshes.map(|(number, mesh)| Shape::new(number, mesh, &data)).collect::<Result<_>>()?;
        let skins = std::mem::take(&mut document.skins).into_iter().enumerate();
        let skins: Vec<Skin> = skins
            .map(|(number, skin)| Skin::new(number, skin, nodes.all.len(), &data, &mut budget))
            .collect::<Result<_>>()?;

        let mut keys = Keys::new(&data);
        let clips = clips(&document.animations, &mut keys, &mut budget)?;
        let clip = find_clip(&clips, clip)?;
        if let Some(number) = clip {
            let targets = |node: usize| {
                let mesh = document.nodes.get(node).and_then(|node| node.mesh);
                mesh.and_then(|mesh| shapes.get(mesh)).map_or(0, |shape| shape.targets)
            };
            nodes.animate(number, &document.animations[number], targets, &mut keys, &mut budget)?;
        }
        drop(keys);

        let (objects, infos) = objects::read(&mut document, &nodes, &shapes, &skins, &mut budget)?;
        let Document { asset, .. } = document;
        let (generator, copyright) = asset.map_or((None, None), |asset| (asset.generator, asset.copyright));
        let caches = Caches::new(size.saturating_mul(4).saturating_add(SMALL).min(MOST_KEPT));
        let path = path.to_owned();
        Ok(Self {
            path,
            generator,
            copyright,
            clips,
            clip,
            data,
            nodes,
            shapes,
            skins,
            objects,
            infos,
            caches,
        })
    }

    /// The path it was opened by.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The program that wrote it, where it says so.
    pub fn generator(&self) -> Option<&str> {
        self.generator.as_deref()
    }

    /// Whose it is, where it says so.
    pub fn copyright(&self) -> Option<&str> {
        self.copyright.as_deref()
    }

    /// The clips of the file, in its order.
    pub fn clips(&self) -> &[Clip] {
        &self.clips
    }

    /// The clip that is read.
    pub fn clip(&self) -> Option<&Clip> {
        self.clip.and_then(|clip| self.clips.get(clip))
    }

    fn object(&self, object: usize, time_s: f64) -> Result<&Object> {
        let Some(found) = self.objects.get(object) else {
            let count = self.objects.len();
            return Err(
                Error::new(format!("there is no object {object}; there are {count}")).in_file(&self.path)
            );
        };
        if time_s.is_nan() {
            return Err(self.fault(object, "the time asked for is not a number", "give seconds"));
        }
        Ok(found)
    }

    fn fault(&self, object: usize, what: &str, help: &str) -> Error {
        let path = self.infos.get(object).map_or("", |info| info.path.as_str());
        Error::new(what).in_file(&self.path).at(Place::Part(path.to_owned())).help(help)
    }
}

impl Animation for Gltf {
    fn objects(&self) -> &[ObjectInfo] {
        &self.infos
    }

    fn transform(&self, object: usize, time_s: f64) -> Result<Transform> {
        let found = self.object(object, time_s)?;
        let world = DMat4::from(self.nodes.world(found.node, time_s));
        Ok(world.transpose().to_cols_array_2d())
    }

    fn mesh(&self, object: usize, time_s: f64, mesh: &mut Mesh) -> Result<()> {
        let found = self.object(object, time_s)?;
        let Some(shape) = found.mesh.and_then(|number| self.shapes.get(number)) else {
            return Err(self.fault(
                object,
                "the object has no mesh",
                "ask for a mesh object, or for the transform",
            ));
        };
        let mut weights: Vec<f64> = Vec::new();
        match self.nodes.all.get(found.node).and_then(|node| node.weights.as_ref()) {
            Some(track) => track.weights(time_s, &mut weights),
            None => {
                let own = found.weights.as_ref().unwrap_or(&shape.weights);
                weights.extend(own.iter().copied().map(f64::from));
            }
        }
        let world = self.nodes.world(found.node, time_s);
        let skin = found.skin.and_then(|number| self.skins.get(number));
        let skinned = skin.map(|skin| skin.at(time_s, &self.nodes));
        shape
            .read(&weights, world, skinned.as_ref(), &self.data, &self.caches, mesh)
            .map_err(|error| error.in_file(&self.path))
    }
}

/// The names and times of all clips.
fn clips(written: &[WrittenClip], keys: &mut Keys, budget: &mut Budget) -> Result<Vec<Clip>> {
    let mut clips = Vec::with_capacity(written.len());
    for (number, clip) in written.iter().enumerate() {
        let (mut start_s, mut end_s) = (f64::INFINITY, f64::NEG_INFINITY);
        for (index, sampler) in clip.samplers.iter().enumerate() {
            let of = || format!("animations[{number}].samplers[{index}]");
            let times = keys.times(sampler.input, budget, &of)?;
            start_s = times.first().copied().map_or(start_s, |first| start_s.min(first));
            end_s = times.last().copied().map_or(end_s, |last| end_s.max(last));
        }
        if start_s > end_s {
            (start_s, end_s) = (0.0, 0.0);
        }
        let name = clip.name.clone().filter(|name| !name.is_empty());
        clips.push(Clip { name: name.unwrap_or_else(|| format!("animation{number}")), start_s, end_s });
    }
    Ok(clips)
}

/// The number of the clip that is meant.
fn find_clip(clips: &[Clip], wanted: Option<&str>) -> Result<Option<usize>> {
    let Some(wanted) = wanted else { return Ok((!clips.is_empty()).then_some(0)) };
    let by_number = || wanted.parse::<usize>().ok().filter(|&number| number < clips.len());
    let found = clips.iter().position(|clip| clip.name == wanted).or_else(by_number);
    if found.is_some() {
        return Ok(found);
    }
    // A file may have thousands.
    let names: Vec<&str> = clips.iter().take(50).map(|clip| clip.name.as_str()).collect();
    let help = match names.len() {
        0 => "the file has no clips".to_owned(),
        count if count < clips.len() => {
            format!("the first of its {} clips: {}", clips.len(), names.join(", "))
        }
        _ => format!("its clips: {}", names.join(", ")),
    };
    Err(damage("animations", format!("there is no clip {wanted:?}")).help(help))
}
