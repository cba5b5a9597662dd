//! The regions of a sheet, and its tears, where whatever animates it knows them: a file of one JSON object a line and
//! frame.
//!
//! ```text
//! {"time_s":0.5,"regions":[{"faces":[0,1],"kind":"flat"},
//!  {"faces":[2,3],"kind":"curved","rulings":[[[0,0,0],[0,0.2,0]]]}],"held":[0,4],"touching":[],"torn":[[1,5]]}
//! ```
//!
//! on one line. Faces and vertices are those of the mesh, from 0. Every face is in one region, every curved region has
//! rulings. `regions`, `held` and `touching` may be left out, and are found from motion then. `torn` are the edges along
//! which the sheet tears in that frame; with it the mesh is not looked at for that.

use std::io::BufRead;
use std::path::Path;

use glam::DVec3;
use serde::Deserialize;

use super::sheet::{Lie, NONE, Sheet};
use crate::json_lines::JsonLines;
use crate::motion::cloth::triangulation::Triangulation;
use crate::scene::animation::Mesh;
use crate::{Error, Result};

/// The longest line that is read, in bytes.
pub const LONGEST_LINE_BYTES: usize = 64 << 20;

/// What whatever animates a sheet knows of it in one frame.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Partition {
    /// The time of the frame, in seconds.
    pub time_s: f64,
    /// The regions; without them they are found.
    #[serde(default)]
    pub regions: Option<Vec<Part>>,
    /// The vertices that are held; without it they are found.
    #[serde(default)]
    pub held: Option<Vec<u32>>,
    /// The vertices that touch something; without it they are found.
    #[serde(default)]
    pub touching: Option<Vec<u32>>,
    /// The edges that tear in this frame, each by the two vertices at its ends.
    #[serde(default)]
    pub torn: Vec<[u32; 2]>,
}

/// One region.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    /// Its faces, by their numbers in the mesh.
    pub faces: Vec<u32>,
    /// Whether it is flat or curved.
    pub kind: Kind,
    /// The ends of its rulings, in metres, where the mesh is.
    #[serde(default)]
    pub rulings: Vec<[[f64; 3]; 2]>,
}

/// What a region is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// It is flat.
    Flat,
    /// It is curved along rulings.
    Curved,
}

/// What is known of the triangles of a sheet.
#[derive(Debug, Clone, Default)]
pub(super) struct Given {
    pub of: Vec<u32>,
    pub is_curved: Vec<bool>,
    pub rulings: Vec<DVec3>,
}

impl Partition {
    /// Brings its regions, if it has any, to the triangles of a mesh of so many faces.
    ///
    /// # Errors
    /// A face or vertex that is not there, a face in two regions or in none, a curved region without rulings.
    pub(super) fn given(
        &self,
        faces: usize,
        sheet: &Sheet,
        surface: &Triangulation,
        lie: &Lie,
    ) -> Result<Option<Given>> {
        self.check_counts(faces, surface.vertex_count())?;
        let Some(regions) = &self.regions else { return Ok(None) };
        let mut region_of = vec![NONE; faces];
        for (number, region) in regions.iter().enumerate() {
            region.faces.iter().for_each(|&face| region_of[face as usize] = number as u32);
        }
        let of: Vec<u32> = surface.faces().iter().map(|&face| region_of[face as usize]).collect();
        let is_curved: Vec<bool> = regions.iter().map(|region| region.kind == Kind::Curved).collect();
        let ruling = |(triangle, &region): (usize, &u32)| {
            let middle = lie.middle(sheet, triangle);
            let away = |ends: &&[[f64; 3]; 2]| {
                let [a, b] = ends.map(DVec3::from);
                let along = b - a;
                let part =
                    ((middle - a).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
                middle.distance_squared(a + part * along)
            };
            let rulings = regions[region as usize].rulings.iter();
            let nearest = rulings.min_by(|a, b| away(a).total_cmp(&away(b)));
            nearest
                .map_or(DVec3::ZERO, |ends| (DVec3::from(ends[1]) - DVec3::from(ends[0])).normalize_or_zero())
        };
        let rulings = of.iter().enumerate().map(ruling).collect();
        Ok(Some(Given { of, is_curved, rulings }))
    }

    /// Whether it is that of a mesh.
    ///
    /// # Errors
    /// A face or vertex that is not there, a face in two regions or in none, a curved region without rulings, an edge that
    /// has one end.
    pub fn check(&self, mesh: &Mesh) -> Result<()> {
        self.check_counts(mesh.face_sizes.len(), mesh.positions.len())
    }

    fn check_counts(&self, faces: usize, vertices: usize) -> Result<()> {
        if let Some(regions) = &self.regions {
            check_regions(regions, faces)?;
        }
        if let Some([vertex, _]) = self.torn.iter().find(|ends| ends[0] == ends[1]) {
            return Err(Error::new(format!("what is torn goes from vertex {vertex} to itself"))
                .help("name both ends of each edge that tears"));
        }
        let named = self.held.iter().chain(&self.touching).flatten().chain(self.torn.as_flattened());
        match named.copied().find(|&vertex| vertex as usize >= vertices) {
            Some(vertex) => Err(Error::new(format!("vertex {vertex} is named, but the mesh has {vertices}"))
                .help("vertices are counted from 0")),
            None => Ok(()),
        }
    }
}

fn check_regions(regions: &[Part], faces: usize) -> Result<()> {
    let mut region_of = vec![NONE; faces];
    for (number, region) in regions.iter().enumerate() {
        if region.kind == Kind::Curved && region.rulings.is_empty() {
            return Err(Error::new(format!("region {number} is curved and has no rulings"))
                .help("give the ends of at least one, or say that it is flat"));
        }
        for &face in &region.faces {
            match region_of.get_mut(face as usize) {
                None => {
                    let what = format!("region {number} has face {face}, but the mesh has {faces}");
                    return Err(Error::new(what).help("faces are counted from 0"));
                }
                Some(of) if *of != NONE => {
                    return Err(Error::new(format!("face {face} is in region {of} and in region {number}")));
                }
                Some(of) => *of = number as u32,
            }
        }
    }
    match region_of.iter().position(|&of| of == NONE) {
        Some(face) => Err(Error::new(format!("face {face} is in no region")).help("every face is in one")),
        None => Ok(()),
    }
}

/// Reads partitions line by line, in the memory of one line. It ends after its first error.
///
/// ```
/// use froufrou::motion::paper::ready_made::{Kind, Reader};
/// let text = r#"{"time_s":0,"regions":[{"faces":[0],"kind":"flat"}],"held":[1]}"#;
/// let mut reader = Reader::new(text.as_bytes(), "sheet.jsonl");
/// let Some(first) = reader.next().transpose()? else { panic!("a frame") };
/// let kind = first.regions.as_deref().map(|regions| regions[0].kind);
/// assert_eq!((kind, first.held), (Some(Kind::Flat), Some(vec![1])));
/// # Ok::<(), froufrou::Error>(())
/// ```
#[derive(Debug)]
pub struct Reader<R> {
    lines: JsonLines<R, Partition>,
    last_s: Option<f64>,
}

impl<R: BufRead> Reader<R> {
    /// Reads from anywhere; `file` is the name in messages.
    pub fn new(inner: R, file: impl AsRef<Path>) -> Self {
        let lines = JsonLines::new(inner, file.as_ref(), "the regions of a sheet", LONGEST_LINE_BYTES);
        Self { lines, last_s: None }
    }

    /// The line that was read last, from 1.
    pub fn line(&self) -> usize {
        self.lines.line()
    }
}

impl<R: BufRead> Iterator for Reader<R> {
    type Item = Result<Partition>;

    fn next(&mut self) -> Option<Self::Item> {
        let read = match self.lines.next()? {
            Ok(read) => read,
            Err(fault) => return Some(Err(fault)),
        };
        if let Some(last_s) = self.last_s.filter(|last_s| read.time_s <= *last_s) {
            let what = format!("regions at {} s after those at {last_s} s", read.time_s);
            return Some(Err(self.lines.refuse(Error::new(what).help("frames come in order of time"))));
        }
        self.last_s = Some(read.time_s);
        Some(Ok(read))
    }
}
