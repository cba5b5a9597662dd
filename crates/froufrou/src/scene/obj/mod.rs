//! Wavefront OBJ (`.obj`): one mesh or several as text, and sequences of such files, one a frame.
//!
//! # What is read
//! - `v` and `f`: positions and polygons of any size, with indices from 1 or, negative, from the end.
//!   Normals, texture coordinates, colours and weights are passed over, as are materials, lines,
//!   points and free-form surfaces.
//! - `o` and `g`: where a file has `o`, each names an object; else each `g` does. What stands before
//!   the first of them is named as the file is. A name that comes again continues its object.
//!
//! An object has the vertices that its faces use, and those used by no faces at all that stand under
//! its name, in the order of the file. So the one mesh of a file has all its vertices, with the numbers
//! they have in the program that wrote it, and so has each object that Blender writes.
//!
//! Nothing in the format is a transform: every object's is that of the origin.
//!
//! # Sequences
//! A pattern such as `sim/cloth_*.obj` is a sequence of the files that it matches. The last number in
//! a file's name is its frame, and its time is that number over the frame rate. Frames may be
//! missing; between two files of the same faces positions are interpolated linearly, else the earlier
//! one holds. The objects are those of the first file; where another file lacks one its mesh is empty
//! there. If every file has one object alone, its name may differ. Only the names of the files are held,
//! and the last two files that were read.
//!
//! # Damaged files
//! An error names the line. Memory follows the length of the file that is read.

mod lines;
mod parse;
mod sequence;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use self::parse::Text;
use super::animation::{
    Animation, IDENTITY, KeyTimes, Mesh, ObjectInfo, ObjectKind, Topology, Transform, mix_positions,
};
use super::conventions::Conventions;
use super::sample_cache::{Ledger, SampleCache};
use crate::{Error, Result};

pub(crate) use self::sequence::{is_in_one_folder, is_pattern};

/// An open OBJ file, or a sequence of them.
#[derive(Debug)]
pub struct Obj {
    /// The file, or the pattern that all match.
    path: PathBuf,
    files: Vec<PathBuf>,
    key_times: KeyTimes,
    objects: Vec<ObjectInfo>,
    /// The name of each object in the file.
    names: Vec<String>,
    frames: SampleCache<u32, Vec<Part>>,
}

/// One object of one file.
#[derive(Debug)]
struct Part {
    /// What it is called; by the name of the file where it has none of its own.
    name: String,
    mesh: Mesh,
}

impl Obj {
    /// Opens one file, whose mesh stands still, and reads it.
    ///
    /// # Errors
    /// A file that cannot be read, or that is no sound OBJ file.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        Self::new(path, vec![path.to_owned()], KeyTimes::Static)
    }

    /// Opens the files that a pattern in the last part of a path matches, and reads the first.
    /// Of the conventions the frame rate is used.
    ///
    /// # Errors
    /// No files that match; one that is no OBJ file; one without a number in its name, or with the
    /// number of another; a first file that cannot be read.
    pub fn open_sequence(pattern: impl AsRef<Path>, conventions: &Conventions) -> Result<Self> {
        let pattern = pattern.as_ref();
        let (files, key_times) = sequence::find(pattern, conventions.frame_rate_hz())?;
        Self::new(pattern, files, key_times)
    }

    fn new(path: &Path, files: Vec<PathBuf>, key_times: KeyTimes) -> Result<Self> {
        let mut obj = Self {
            path: path.to_owned(),
            files,
            key_times,
            objects: Vec::new(),
            names: Vec::new(),
            // Two files as they are read: of the size of their text.
            frames: SampleCache::new(&Ledger::new(u64::MAX)),
        };
        let sequence = !obj.key_times.is_empty();
        for part in obj.frame(0)?.iter() {
            obj.names.push(part.name.clone());
            obj.objects.push(ObjectInfo {
                path: format!("/{}", part.name),
                kind: ObjectKind::Mesh,
                topology: if sequence { Topology::Heterogeneous } else { Topology::Constant },
                key_times: obj.key_times.clone(),
            });
        }
        Ok(obj)
    }

    /// The file or pattern it was opened by.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The files, in the order of their frames.
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    fn frame(&self, index: u32) -> Result<Arc<Vec<Part>>> {
        let read = || {
            let Some(file) = self.files.get(index as usize) else { return Ok(Vec::new()) };
            // In a sequence the number is no part of the name of what is seen.
            let stem = file.file_stem().unwrap_or_default().to_string_lossy();
            let numbered = !self.key_times.is_empty() || self.path != *file;
            let name = if numbered { sequence::without_number(&stem) } else { &stem };
            let parts = Text::read(file)?.into_parts();
            Ok(parts
                .into_iter()
                .map(|(own, mesh)| Part { name: own.unwrap_or_else(|| name.to_owned()), mesh })
                .collect())
        };
        self.frames.get(index, read, |parts: &Vec<Part>| {
            let of = |part: &Part| {
                let mesh = &part.mesh;
                12 * mesh.positions.len() + 4 * (mesh.face_vertices.len() + mesh.face_sizes.len())
            };
            parts.iter().map(of).sum::<usize>() as u64
        })
    }

    fn check(&self, object: usize, time_s: f64) -> Result<()> {
        if object >= self.objects.len() {
            let count = self.objects.len();
            return Err(
                Error::new(format!("there is no object {object}; there are {count}")).in_file(&self.path)
            );
        }
        if time_s.is_nan() {
            return Err(Error::new("the time asked for is not a number")
                .in_file(&self.path)
                .help("give seconds"));
        }
        Ok(())
    }

    /// An object's mesh in a frame, where it is in it.
    fn find<'f>(&self, object: usize, frame: &'f [Part]) -> Option<&'f Mesh> {
        let part = match frame {
            [only] if self.names.len() == 1 => Some(only),
            _ => {
                let name = self.names.get(object)?;
                // Files of a sequence mostly have the same objects in the same order.
                frame
                    .get(object)
                    .filter(|p| p.name == *name)
                    .or_else(|| frame.iter().find(|p| p.name == *name))
            }
        };
        part.map(|part| &part.mesh)
    }
}

impl Animation for Obj {
    fn objects(&self) -> &[ObjectInfo] {
        &self.objects
    }

    fn transform(&self, object: usize, time_s: f64) -> Result<Transform> {
        self.check(object, time_s)?;
        Ok(IDENTITY)
    }

    fn mesh(&self, object: usize, time_s: f64, mesh: &mut Mesh) -> Result<()> {
        self.check(object, time_s)?;
        let bracket = self.key_times.bracket(time_s);
        let before = self.frame(bracket.floor)?;
        let Some(a) = self.find(object, &before) else {
            *mesh = Mesh::default();
            return Ok(());
        };
        mesh.face_vertices.clone_from(&a.face_vertices);
        mesh.face_sizes.clone_from(&a.face_sizes);
        mesh.positions.clear();
        if bracket.fraction > 0.0 {
            let after = self.frame(bracket.ceiling)?;
            if let Some(b) = self.find(object, &after)
                && a.positions.len() == b.positions.len()
                && a.face_sizes == b.face_sizes
                && a.face_vertices == b.face_vertices
            {
                mix_positions(&a.positions, &b.positions, bracket.fraction, &mut mesh.positions);
                return Ok(());
            }
        }
        mesh.positions.extend_from_slice(&a.positions);
        Ok(())
    }
}

/// All vertices and faces of a file as one mesh, in the order of the file.
pub(crate) fn whole_mesh(file: &Path) -> Result<Mesh> {
    Ok(Text::read(file)?.mesh)
}

#[cfg(test)]
mod tests;
