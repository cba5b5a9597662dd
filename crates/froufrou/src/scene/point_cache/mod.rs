//! Point caches, PC2 and MDD: where each vertex of one mesh is in each frame, and nothing else.
//!
//! # What is read
//! - PC2, version 1: little-endian. Its samples are counted in frames, so that seconds need a frame
//!   rate: sample *i* is at (start + *i* · step) / rate.
//! - MDD: big-endian. It has a time in seconds for every frame; of frames at the same time the last
//!   counts.
//!
//! The one object is named `/` and the name of the file without its ending, is a mesh, and has no
//! transform: positions are as they are stored, which in most programs is in the mesh's own frame.
//!
//! # Faces
//! Neither format has faces. They come from another file with a mesh of as many vertices: the one
//! that [`Conventions::faces`] names, or else the OBJ file of the same name in the same folder. Of an
//! OBJ file all vertices count, in the order of the file. Without any such file the mesh has
//! vertices alone.
//!
//! # Between samples
//! Positions are interpolated linearly. Samples are fetched by positioned reads as times are asked
//! for, and the last two are kept. A NaN in the file is a NaN in the mesh.
//!
//! # Damaged files
//! What the header claims must be the length of the file to the byte, before anything is read.

mod mdd;
mod pc2;

use std::path::{Path, PathBuf};

use super::animation::{
    Animation, KeyTimes, Mesh, MeshSize, ObjectInfo, ObjectKind, Topology, Transform, mix_positions,
};
use super::conventions::Conventions;
use super::format::AnimationFormat;
use super::obj;
use super::positioned_file::PositionedFile;
use super::sample_cache::{Ledger, SampleCache};
use super::world::open_animation;
use crate::{Error, Place, Result};

/// The advice for every kind of damage.
const DAMAGED: &str = "the file is damaged or was cut short: copy it again or export it again";

/// What is read of a file in one go.
const CHUNK_BYTES: usize = 12 << 13;

/// An open point cache.
#[derive(Debug)]
pub struct PointCache {
    path: PathBuf,
    file: PositionedFile,
    layout: Layout,
    /// The one object.
    objects: [ObjectInfo; 1],
    faces: Faces,
    samples: SampleCache<u32, Vec<[f32; 3]>>,
}

/// Where a file has what.
#[derive(Debug)]
struct Layout {
    /// Vertices of every frame.
    points: u32,
    /// When there are samples.
    key_times: KeyTimes,
    /// The frame of each sample, where that is not simply its number.
    frames: Option<Vec<u32>>,
    /// Where the first frame begins.
    data_at: u64,
    /// A number from its bytes.
    decode: fn([u8; 4]) -> f32,
}

/// The faces of a mesh, and the file they are from.
#[derive(Debug, Default)]
struct Faces {
    vertices: Vec<u32>,
    sizes: Vec<u32>,
    file: Option<PathBuf>,
}

impl PointCache {
    /// Opens a point cache: a PC2 file, or else an MDD file. Of the conventions its frame rate and
    /// its faces are used; units and axes are none of a reader's business.
    ///
    /// # Errors
    /// A file that cannot be read or whose length is not what its header claims; a file of faces
    /// that cannot be read or has no mesh of as many vertices.
    pub fn open(path: impl AsRef<Path>, conventions: &Conventions) -> Result<Self> {
        let path = path.as_ref();
        let file = PositionedFile::open(path).map_err(|fault| Error::io("open", path, fault))?;
        let mut head = [0; pc2::SIGNATURE.len()];
        let is_pc2 = file.length() >= head.len() as u64
            && read(path, &file, &mut head, 0).map(|()| head == *pc2::SIGNATURE)?;
        if !is_pc2 && path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("pc2")) {
            return Err(damage(path, 0, "the signature of PC2 is missing"));
        }
        let layout = if is_pc2 {
            pc2::layout(path, &file, conventions.frame_rate_hz())?
        } else {
            mdd::layout(path, &file)?
        };
        let faces = match &conventions.faces {
            Some(named) => read_faces(path, layout.points, named)?,
            None => match beside(path)? {
                Some(beside) => read_faces(path, layout.points, &beside)?,
                None => Faces::default(),
            },
        };
        let moves = !layout.key_times.is_empty();
        let info = ObjectInfo {
            path: format!("/{}", path.file_stem().unwrap_or_default().to_string_lossy()),
            kind: ObjectKind::Mesh,
            topology: if moves { Topology::Homogeneous } else { Topology::Constant },
            key_times: layout.key_times.clone(),
        };
        // Two samples of one mesh: never more than the file is long.
        let samples = SampleCache::new(&Ledger::new(u64::MAX));
        Ok(Self { path: path.to_owned(), file, layout, objects: [info], faces, samples })
    }

    /// The path it was opened by.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The file that the faces are from, where there is one.
    pub fn faces_file(&self) -> Option<&Path> {
        self.faces.file.as_deref()
    }

    fn check(&self, object: usize, time_s: f64) -> Result<()> {
        if object != 0 {
            return Err(Error::new(format!("there is no object {object}; there is 1")).in_file(&self.path));
        }
        if time_s.is_nan() {
            return Err(Error::new("the time asked for is not a number")
                .in_file(&self.path)
                .help("give seconds"));
        }
        Ok(())
    }

    fn sample(&self, index: u32) -> Result<std::sync::Arc<Vec<[f32; 3]>>> {
        let bytes = |points: &Vec<[f32; 3]>| size_of_val(points.as_slice()) as u64;
        self.samples.get(index, || self.read_sample(index), bytes)
    }

    fn read_sample(&self, index: u32) -> Result<Vec<[f32; 3]>> {
        let frame = match &self.layout.frames {
            Some(frames) => frames.get(index as usize).copied().unwrap_or(index),
            None => index,
        };
        // Held against the length of the file when it was opened.
        let size = 12 * u64::from(self.layout.points);
        let (mut at, mut left) = (self.layout.data_at + size * u64::from(frame), size as usize);
        let mut points = Vec::with_capacity(self.layout.points as usize);
        let mut chunk = vec![0; CHUNK_BYTES.min(left)];
        let number = self.layout.decode;
        while left > 0 {
            let part = &mut chunk[..CHUNK_BYTES.min(left)];
            read(&self.path, &self.file, part, at)?;
            let (vertices, _) = part.as_chunks::<12>();
            points.extend(vertices.iter().map(|&[a, b, c, d, e, f, g, h, i, j, k, l]| {
                [number([a, b, c, d]), number([e, f, g, h]), number([i, j, k, l])]
            }));
            at += part.len() as u64;
            left -= part.len();
        }
        Ok(points)
    }
}

impl Animation for PointCache {
    fn objects(&self) -> &[ObjectInfo] {
        &self.objects
    }

    fn transform(&self, object: usize, time_s: f64) -> Result<Transform> {
        self.check(object, time_s)?;
        Ok(super::animation::IDENTITY)
    }

    fn mesh(&self, object: usize, time_s: f64, mesh: &mut Mesh) -> Result<()> {
        self.check(object, time_s)?;
        let bracket = self.layout.key_times.bracket(time_s);
        let before = self.sample(bracket.floor)?;
        mesh.positions.clear();
        if bracket.fraction > 0.0 {
            let after = self.sample(bracket.ceiling)?;
            mix_positions(&before, &after, bracket.fraction, &mut mesh.positions);
        } else {
            mesh.positions.extend_from_slice(&before);
        }
        mesh.face_vertices.clone_from(&self.faces.vertices);
        mesh.face_sizes.clone_from(&self.faces.sizes);
        Ok(())
    }

    fn mesh_size(&self, object: usize) -> Result<Option<MeshSize>> {
        self.check(object, 0.0)?;
        Ok(Some(MeshSize { vertices: self.layout.points as usize, faces: self.faces.sizes.len() }))
    }
}

/// Bytes of a file, which must be there.
fn read(path: &Path, file: &PositionedFile, buffer: &mut [u8], at: u64) -> Result<()> {
    file.read_exact_at(buffer, at).map_err(|fault| match fault.kind() {
        std::io::ErrorKind::UnexpectedEof => {
            damage(path, at, format!("the file ends before {} bytes that belong here", buffer.len()))
        }
        _ => Error::io("read", path, fault).at(Place::Byte(at)).help("check the disk the file is on"),
    })
}

/// Bytes that cannot be what a sound file has there.
fn damage(path: &Path, at: u64, what: impl Into<String>) -> Error {
    Error::new(what).in_file(path).at(Place::Byte(at)).help(DAMAGED)
}

/// Holds what a header claims against the length of the file.
fn check_length(
    path: &Path,
    file: &PositionedFile,
    what: &str,
    frames: u32,
    points: u32,
    head: u64,
) -> Result<()> {
    // Both counts are below 2³²: nothing here overflows 128 bits.
    let expected = u128::from(head) + 12 * u128::from(frames) * u128::from(points);
    if expected == u128::from(file.length()) {
        return Ok(());
    }
    Err(damage(
        path,
        0,
        format!(
            "{frames} {what} of {points} vertices make a file of {expected} bytes, but this one has {}",
            file.length()
        ),
    ))
}

/// The OBJ file of the same name in the same folder, if there is one.
///
/// # Errors
/// A link that leads elsewhere: what was not named is not looked for in other folders.
fn beside(path: &Path) -> Result<Option<PathBuf>> {
    let beside = path.with_extension("obj");
    if !beside.is_file() || beside == path {
        return Ok(None);
    }
    let parent = |path: &Path| std::fs::canonicalize(path).ok().and_then(|p| p.parent().map(Path::to_owned));
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if parent(&beside) != std::fs::canonicalize(folder).ok() {
        return Err(Error::new("the file of faces beside the point cache is a link to another folder")
            .in_file(&beside)
            .help("name the file that has the faces with `faces`"));
    }
    Ok(Some(beside))
}

/// The faces of the mesh of a file that has as many vertices as the point cache.
fn read_faces(cache: &Path, points: u32, file: &Path) -> Result<Faces> {
    let faces = |mesh: Mesh| Faces {
        vertices: mesh.face_vertices,
        sizes: mesh.face_sizes,
        file: Some(file.to_owned()),
    };
    let points = points as usize;
    let mut counts = Vec::new();
    if AnimationFormat::of(file)? == AnimationFormat::Obj {
        let whole = obj::whole_mesh(file)?;
        if whole.positions.len() == points {
            return Ok(faces(whole));
        }
        counts.push(whole.positions.len());
    }
    let animation = open_animation(file)?;
    let mut fitting = Vec::new();
    for (index, object) in animation.objects().iter().enumerate() {
        if let Some(size) = animation.mesh_size(index)? {
            if size.vertices == points {
                fitting.push((index, object));
            } else if !counts.contains(&size.vertices) {
                counts.push(size.vertices);
            }
        }
    }
    if let [(index, object)] = fitting[..] {
        let mut mesh = Mesh::default();
        animation.mesh(index, object.key_times.get(0).unwrap_or_default(), &mut mesh)?;
        return Ok(faces(mesh));
    }
    let error = if fitting.is_empty() {
        let some: Vec<String> = counts.iter().take(5).map(ToString::to_string).collect();
        let found = match some.as_slice() {
            [] => "no mesh".to_owned(),
            _ if counts.len() > some.len() => format!("meshes of {}, …", some.join(", ")),
            [one] => format!("a mesh of {one}"),
            _ => format!("meshes of {}", some.join(", ")),
        };
        Error::new(format!("{points} vertices in each frame, but {} has {found}", file.display()))
            .help("faces must be those of the mesh as it was cached: name another file with `faces`")
    } else {
        let names: Vec<&str> = fitting.iter().take(5).map(|(_, object)| object.path.as_str()).collect();
        let names = names.join(", ");
        Error::new(format!("{} has several meshes of {points} vertices: {names}", file.display()))
            .help("give the cached mesh a file of its own and name that with `faces`")
    };
    Err(error.in_file(cache).at(Place::Part("faces".to_owned())))
}
