//! The statements of an OBJ file: vertices, faces, and whose they are.

use std::collections::HashMap;
use std::path::Path;

use super::lines::Lines;
use crate::scene::animation::Mesh;
use crate::{Error, Place, Result};

/// Everything of one file.
#[derive(Debug)]
pub(super) struct Text {
    /// All vertices and faces, in the order of the file.
    pub(super) mesh: Mesh,
    /// Names that follow an `o`, and names that follow a `g`, in the order in which they first come.
    objects: Names,
    groups: Names,
    /// What stands under which names, in the order of the file; the first from its beginning.
    runs: Vec<Run>,
}

/// Numbers for names.
#[derive(Debug, Default)]
struct Names {
    numbers: HashMap<String, usize>,
}

impl Names {
    fn number(&mut self, name: String) -> usize {
        let next = self.numbers.len();
        *self.numbers.entry(name).or_insert(next)
    }
}

/// A stretch of the file.
#[derive(Debug, Clone, Copy, Default)]
struct Run {
    object: Option<usize>,
    group: Option<usize>,
    /// Its first vertex, face, and corner of a face.
    vertex: usize,
    face: usize,
    corner: usize,
}

/// Statements that are known and passed over.
const PASSED_OVER: &[&[u8]] = &[
    b"vn",
    b"vt",
    b"vp",
    b"s",
    b"l",
    b"p",
    b"usemtl",
    b"mtllib",
    b"usemap",
    b"maplib",
    b"mg",
    b"deg",
    b"bmat",
    b"step",
    b"cstype",
    b"curv",
    b"curv2",
    b"surf",
    b"parm",
    b"trim",
    b"hole",
    b"scrv",
    b"sp",
    b"end",
    b"con",
    b"bevel",
    b"c_interp",
    b"d_interp",
    b"lod",
    b"shadow_obj",
    b"trace_obj",
    b"ctech",
    b"stech",
];

impl Text {
    /// Reads a file.
    ///
    /// # Errors
    /// A file that cannot be read, and statements that cannot be understood, by their line.
    pub(super) fn read(path: &Path) -> Result<Self> {
        let mut text = Self {
            mesh: Mesh::default(),
            objects: Names::default(),
            groups: Names::default(),
            runs: vec![Run::default()],
        };
        let mut lines = Lines::open(path)?;
        // The highest vertex that a face names, which may come after it, and the line of that face.
        let mut highest = (0, 0);
        let mut unknown = None;
        while let Some((number, line)) = lines.next()? {
            match text.statement(line) {
                Ok(Statement::Face(top)) if top >= highest.0 => highest = (top + 1, number),
                Ok(Statement::Unknown) => {
                    unknown.get_or_insert(number);
                }
                Ok(_) => {}
                Err(what) => return Err(fault(path, number, what)),
            }
        }
        let count = text.mesh.positions.len();
        if highest.0 > count {
            return Err(fault(
                path,
                highest.1,
                format!("a face names vertex {}, but there are {count}", highest.0),
            ));
        }
        if let Some(number) = unknown
            && count == 0
        {
            return Err(fault(path, number, "no statement of an OBJ file, and there are no vertices"));
        }
        Ok(text)
    }

    fn statement(&mut self, line: &[u8]) -> Result<Statement, String> {
        let line = line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(line).trim_ascii();
        let (keyword, rest) = match line.iter().position(u8::is_ascii_whitespace) {
            Some(end) => (&line[..end], &line[end..]),
            None => (line, &line[line.len()..]),
        };
        match keyword {
            b"v" => self.vertex(rest).map(|()| Statement::Other),
            // `fo` is what faces with outlines were called long ago.
            b"f" | b"fo" => self.face(rest).map(Statement::Face),
            b"o" | b"g" => {
                self.name(keyword, rest);
                Ok(Statement::Other)
            }
            _ if keyword.is_empty() || keyword.starts_with(b"#") || PASSED_OVER.contains(&keyword) => {
                Ok(Statement::Other)
            }
            _ if keyword.contains(&0) => Err("binary data where a statement of text should be".to_owned()),
            _ => Ok(Statement::Unknown),
        }
    }

    fn vertex(&mut self, rest: &[u8]) -> Result<(), String> {
        if self.mesh.positions.len() == u32::MAX as usize {
            return Err(format!("more than {} vertices", u32::MAX));
        }
        let mut position = [0.0; 3];
        let mut words = words(rest);
        for (axis, coordinate) in position.iter_mut().enumerate() {
            let Some(word) = words.next() else {
                return Err(format!("a vertex has 3 coordinates, found {axis}"));
            };
            *coordinate =
                number(word).ok_or_else(|| format!("a coordinate is a number, found {}", told(word)))?;
        }
        self.mesh.positions.push(position);
        Ok(())
    }

    /// Reads a face; the highest vertex that it names, from 0.
    fn face(&mut self, rest: &[u8]) -> Result<usize, String> {
        let (mut corners, mut highest) = (0_u32, 0);
        for word in words(rest) {
            let digits = word.split(|byte| *byte == b'/').next().unwrap_or_default();
            let index = std::str::from_utf8(digits).ok().and_then(|digits| digits.parse::<i64>().ok());
            let count = self.mesh.positions.len();
            let vertex = match index {
                Some(index) if index > 0 => usize::try_from(index - 1).ok(),
                Some(index) if index < 0 => {
                    let back = usize::try_from(index.unsigned_abs()).ok();
                    Some(back.and_then(|back| count.checked_sub(back)).ok_or_else(|| {
                        format!("a face names vertex {index}, counted back from here, but there are {count} before it")
                    })?)
                }
                Some(_) => return Err("a face names vertex 0, but they are counted from 1".to_owned()),
                None => {
                    return Err(format!("a corner of a face is a number or v/vt/vn, found {}", told(word)));
                }
            };
            let Some(number) = vertex.and_then(|vertex| u32::try_from(vertex).ok()) else {
                return Err(format!("a face names vertex {}, beyond all that there can be", told(word)));
            };
            self.mesh.face_vertices.push(number);
            highest = highest.max(number as usize);
            corners += 1;
        }
        if corners < 3 {
            return Err(format!("a face has at least 3 corners, found {corners}"));
        }
        self.mesh.face_sizes.push(corners);
        Ok(highest)
    }

    /// Begins what stands under another name.
    fn name(&mut self, keyword: &[u8], rest: &[u8]) {
        let name = String::from_utf8_lossy(rest.trim_ascii()).into_owned();
        let last = self.runs.last().copied().unwrap_or_default();
        let mut run = Run {
            vertex: self.mesh.positions.len(),
            face: self.mesh.face_sizes.len(),
            corner: self.mesh.face_vertices.len(),
            ..last
        };
        if keyword == b"o" {
            run.object = (!name.is_empty()).then(|| self.objects.number(name));
        } else {
            // A group without a name is the one that the format calls `default`.
            let name = if name.is_empty() { "default".to_owned() } else { name };
            run.group = Some(self.groups.number(name));
        }
        self.runs.push(run);
    }

    /// The objects in the order in which they first come, each with its name where it has one.
    pub(super) fn into_parts(self) -> Vec<(Option<String>, Mesh)> {
        let by_object = !self.objects.numbers.is_empty();
        let names = if by_object { self.objects } else { self.groups };
        if names.numbers.is_empty() {
            return vec![(None, self.mesh)];
        }
        // Part 0 is what has no name.
        let mut parts: Vec<(Option<String>, Mesh)> = Vec::new();
        parts.resize_with(names.numbers.len() + 1, Default::default);
        for (name, number) in names.numbers {
            parts[number + 1].0 = Some(name);
        }
        let part_of = |run: &Run| (if by_object { run.object } else { run.group }).map_or(0, |n| n + 1);
        let mesh = &self.mesh;
        let mut used = vec![false; mesh.positions.len()];
        for vertex in &mesh.face_vertices {
            used[*vertex as usize] = true;
        }
        // For each part the vertices it has, in the numbers of the file.
        let mut vertices: Vec<Vec<u32>> = vec![Vec::new(); parts.len()];
        for (index, run) in self.runs.iter().enumerate() {
            let end =
                self.runs.get(index + 1).map_or(
                    (mesh.positions.len(), mesh.face_sizes.len(), mesh.face_vertices.len()),
                    |next| (next.vertex, next.face, next.corner),
                );
            let part = part_of(run);
            let (own, faces) = (&mut vertices[part], &mut parts[part].1);
            // What stands here fits 32 bits, as every vertex does.
            own.extend((run.vertex..end.0).filter(|v| !used[*v]).map(|v| v as u32));
            own.extend_from_slice(&mesh.face_vertices[run.corner..end.2]);
            faces.face_vertices.extend_from_slice(&mesh.face_vertices[run.corner..end.2]);
            faces.face_sizes.extend_from_slice(&mesh.face_sizes[run.face..end.1]);
        }
        // From the number in the file to the number in the part; what another part left is never read.
        let mut number = vec![0; mesh.positions.len()];
        for (own, (_, part)) in vertices.iter_mut().zip(&mut parts) {
            own.sort_unstable();
            own.dedup();
            for (new, old) in own.iter().enumerate() {
                number[*old as usize] = new as u32;
                part.positions.push(mesh.positions[*old as usize]);
            }
            for vertex in &mut part.face_vertices {
                *vertex = number[*vertex as usize];
            }
        }
        // Under `o` even nothing is an object: in a later frame it may be something.
        let keeps = |(name, mesh): &(Option<String>, Mesh)| {
            !mesh.positions.is_empty() || (by_object && name.is_some())
        };
        let some = parts.iter().any(keeps);
        parts.retain(|part| if some { keeps(part) } else { part.0.is_some() });
        parts
    }
}

/// What a line was.
enum Statement {
    /// A face, and the highest vertex it names, from 0.
    Face(usize),
    /// Something that was understood.
    Other,
    /// Something that was not.
    Unknown,
}

/// The words of a line, up to a comment.
fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).take_while(|word| word[0] != b'#')
}

/// A number, or what C libraries write for none: `nan`, `-nan(ind)`.
fn number(word: &[u8]) -> Option<f32> {
    let text = std::str::from_utf8(word).ok()?;
    text.parse().ok().or_else(|| {
        let unsigned = text.trim_start_matches(['-', '+']);
        unsigned.get(..4).is_some_and(|start| start.eq_ignore_ascii_case("nan(")).then_some(f32::NAN)
    })
}

/// A word for an error, which may be long or no text.
fn told(word: &[u8]) -> String {
    format!("{:?}", String::from_utf8_lossy(word).chars().take(40).collect::<String>())
}

fn fault(path: &Path, line: usize, what: impl Into<String>) -> Error {
    Error::new(what)
        .in_file(path)
        .at(Place::Line { line, column: 0 })
        .help("the file is damaged or no OBJ file: export it again")
}
