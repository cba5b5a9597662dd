//! The edges of a sheet of triangles, and how it lies in one frame.

use glam::DVec3;

use super::super::cloth::triangulation::{Lists, Triangulation};

/// No face lies there.
pub(super) const NONE: u32 = u32::MAX;

/// A triangle that is lower than this part of its longest side has no normal to speak of.
const FLATTEST: f64 = 1e-6;

/// An edge of the sheet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Edge {
    /// Its vertices, as the first of its faces winds.
    pub ends: [u32; 2],
    /// The faces beside it; the second is [`NONE`] where there is no other, or more than one.
    pub faces: [u32; 2],
    /// Whether the sheet ends there.
    pub is_border: bool,
}

impl Edge {
    /// The faces on either side, where the sheet goes on across it.
    pub fn inner(&self) -> Option<[usize; 2]> {
        (self.faces[1] != NONE).then(|| self.faces.map(|face| face as usize))
    }
}

/// What stays of a sheet while it moves.
#[derive(Debug, Clone, Default)]
pub(super) struct Sheet {
    pub triangles: Vec<[u32; 3]>,
    pub edges: Vec<Edge>,
    /// The edges of each face: from its first corner to its second, and so on.
    pub face_edges: Vec<[u32; 3]>,
    /// The edges at each vertex.
    vertex_edges: Lists,
    /// The faces at each vertex.
    vertex_faces: Lists,
    pub vertex_count: usize,
}

impl Sheet {
    pub fn new(surface: &Triangulation) -> Self {
        let triangles = surface.triangles().to_vec();
        let mut sides: Vec<([u32; 2], u32, u8)> = Vec::with_capacity(3 * triangles.len());
        for (face, corners) in triangles.iter().enumerate() {
            for side in 0..3 {
                let (a, b) = (corners[side], corners[(side + 1) % 3]);
                sides.push(([a.min(b), a.max(b)], face as u32, side as u8));
            }
        }
        sides.sort_unstable();
        let mut edges = Vec::with_capacity(sides.len() / 2 + 1);
        let mut face_edges = vec![[NONE; 3]; triangles.len()];
        for group in sides.chunk_by(|a, b| a.0 == b.0) {
            // Where three faces meet or more, each has an edge of its own, across which nothing goes on.
            let is_pair = matches!(group, [_, _]);
            for (index, &(_, face, side)) in group.iter().enumerate() {
                if is_pair && index == 1 {
                    if let Some(edge) = edges.last_mut() {
                        let edge: &mut Edge = edge;
                        edge.faces[1] = face;
                    }
                } else {
                    let corners = triangles[face as usize];
                    let ends = [corners[side as usize], corners[(side as usize + 1) % 3]];
                    edges.push(Edge { ends, faces: [face, NONE], is_border: group.len() == 1 });
                }
                face_edges[face as usize][side as usize] = edges.len() as u32 - 1;
            }
        }
        let vertex_count = surface.vertex_count();
        let at_ends = edges.iter().enumerate().flat_map(|(e, edge)| edge.ends.map(|v| (v, e as u32)));
        let vertex_edges = Lists::from_pairs(vertex_count, at_ends);
        let corners = triangles.iter().enumerate().flat_map(|(f, corners)| corners.map(|v| (v, f as u32)));
        let vertex_faces = Lists::from_pairs(vertex_count, corners);
        Self { triangles, edges, face_edges, vertex_edges, vertex_faces, vertex_count }
    }

    /// The edges at a vertex.
    pub fn edges_at(&self, vertex: u32) -> &[u32] {
        self.vertex_edges.get(vertex)
    }

    /// The faces at a vertex.
    pub fn faces_at(&self, vertex: u32) -> &[u32] {
        self.vertex_faces.get(vertex)
    }

    /// The face across an edge of a face, where there is one.
    pub fn across(&self, face: usize, edge: u32) -> Option<usize> {
        let [a, b] = self.edges[edge as usize].inner()?;
        Some(if a == face { b } else { a })
    }

    /// Numbers the parts into which faces fall that are joined across some edges; gives how many there are.
    pub fn parts(&self, joined: impl Fn(usize, &Edge) -> bool, of: &mut Vec<u32>) -> usize {
        of.clear();
        of.resize(self.triangles.len(), NONE);
        let mut stack = Vec::new();
        let mut count = 0;
        for seed in 0..self.triangles.len() {
            if of[seed] != NONE {
                continue;
            }
            of[seed] = count;
            stack.push(seed);
            while let Some(face) = stack.pop() {
                for edge in self.face_edges[face] {
                    let Some(next) = self.across(face, edge) else { continue };
                    if of[next] == NONE && joined(edge as usize, &self.edges[edge as usize]) {
                        of[next] = count;
                        stack.push(next);
                    }
                }
            }
            count += 1;
        }
        count as usize
    }
}

/// How a sheet lies in one frame.
#[derive(Debug, Clone, Default)]
pub(super) struct Lie {
    pub points: Vec<DVec3>,
    /// Of each face: its normal, of length 1 or 0, and its area in m².
    pub normals: Vec<DVec3>,
    pub areas: Vec<f64>,
    /// Of each edge: its length in metres, and by how much the sheet turns across it, in radians: above 0 where it is
    /// convex, 0 where it ends.
    pub lengths: Vec<f64>,
    pub angles: Vec<f64>,
    /// Of each vertex: a third of the faces about it, in m².
    pub vertex_areas: Vec<f64>,
    pub area_m2: f64,
}

impl Lie {
    /// Takes up where the vertices are now; the work is linear in the faces.
    pub fn measure(&mut self, sheet: &Sheet, positions: &[[f32; 3]]) {
        self.points.clear();
        self.points.extend(positions.iter().map(|p| DVec3::from(p.map(f64::from))));
        let points = &self.points;
        self.normals.clear();
        self.areas.clear();
        self.vertex_areas.clear();
        self.vertex_areas.resize(sheet.vertex_count, 0.0);
        self.area_m2 = 0.0;
        for corners in &sheet.triangles {
            let [a, b, c] = corners.map(|v| points[v as usize]);
            let cross = (b - a).cross(c - a);
            let doubled = cross.length();
            let longest =
                (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
            self.normals.push(if doubled > FLATTEST * longest { cross / doubled } else { DVec3::ZERO });
            let area = 0.5 * doubled;
            self.areas.push(area);
            self.area_m2 += area;
            for v in corners {
                self.vertex_areas[*v as usize] += area / 3.0;
            }
        }
        self.lengths.clear();
        self.angles.clear();
        for edge in &sheet.edges {
            let along = points[edge.ends[1] as usize] - points[edge.ends[0] as usize];
            let length = along.length();
            self.lengths.push(length);
            let angle = edge.inner().map_or(0.0, |faces| {
                let [m, n] = faces.map(|face| self.normals[face]);
                let cosine = m.dot(n);
                let sine = if length > 0.0 { m.cross(n).dot(along) / length } else { 0.0 };
                if m == DVec3::ZERO || n == DVec3::ZERO { 0.0 } else { sine.atan2(cosine) }
            });
            self.angles.push(angle);
        }
    }

    /// The middle of a face.
    pub fn middle(&self, sheet: &Sheet, face: usize) -> DVec3 {
        sheet.triangles[face].map(|v| self.points[v as usize]).into_iter().sum::<DVec3>() / 3.0
    }

    /// The integral over some vertices of what each has.
    pub fn integral(&self, vertices: &[u32], of: &[f64]) -> f64 {
        vertices.iter().map(|&v| self.vertex_areas[v as usize] * of[v as usize]).sum()
    }

    /// A length that goes with the size of the sheet: the root of its area, in metres.
    pub fn size_m(&self) -> f64 {
        self.area_m2.sqrt()
    }
}
