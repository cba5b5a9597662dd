//! The triangles of a polygon mesh, with vertices welded and neighbours known.

use std::collections::HashMap;

use glam::DVec3;

use crate::scene::animation::Mesh;
use crate::{Error, Result};

/// No triangle lies there.
const NONE: u32 = u32::MAX;

/// What stays of a mesh while it moves: its triangles and who is whose neighbour.
///
/// Vertices keep the numbers that the mesh gives them. Those that lie in one place when this is made (at the seams of
/// textures and panels) are one: the first of them stands for all, and the others are in no triangle. Quadrangles are
/// cut along their shorter diagonal, larger polygons into fans from their first vertex. Faces of fewer than three
/// vertices, and triangles two of whose corners are one, are left out. Triangles are turned so that neighbours wind
/// alike, as most of each connected part do; where that cannot be (as on a Möbius strip) they stay as they are.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Triangulation {
    /// For each vertex of the mesh the one that stands for it.
    welded: Vec<u32>,
    triangles: Vec<[u32; 3]>,
    /// The face of the mesh that each triangle was cut from.
    faces: Vec<u32>,
    /// The vertices around each, one after another, ascending.
    rings: Lists,
    /// The triangles at each vertex, ascending.
    fans: Lists,
    /// Where the surface goes on all around.
    inner: Vec<bool>,
    boundary_edges: usize,
    odd_edges: usize,
}

/// Lists one behind the other in one array.
#[derive(Debug, Clone, Default, PartialEq)]
pub(in crate::motion) struct Lists {
    /// Where each begins, and where the last ends.
    starts: Vec<u32>,
    items: Vec<u32>,
}

impl Lists {
    /// From pairs of a list's number and an item, in the order of the pairs.
    pub fn from_pairs(count: usize, pairs: impl Iterator<Item = (u32, u32)> + Clone) -> Self {
        let mut starts = vec![0u32; count + 1];
        for (list, _) in pairs.clone() {
            starts[list as usize + 1] += 1;
        }
        for i in 0..count {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut items = vec![0; starts[count] as usize];
        for (list, item) in pairs {
            items[next[list as usize] as usize] = item;
            next[list as usize] += 1;
        }
        Self { starts, items }
    }

    /// One of the lists.
    pub fn get(&self, list: u32) -> &[u32] {
        let list = list as usize;
        &self.items[self.starts[list] as usize..self.starts[list + 1] as usize]
    }
}

/// One side of a triangle.
#[derive(Debug, Clone, Copy)]
struct Side {
    low: u32,
    high: u32,
    triangle: u32,
    /// Which of the triangle's sides: that from this corner to the next.
    side: u8,
}

impl Triangulation {
    /// The triangles of a mesh, its vertices welded where they lie now.
    ///
    /// # Errors
    /// Faces whose sizes do not add up, and vertices that are not there.
    pub fn new(mesh: &Mesh) -> Result<Self> {
        check(mesh)?;
        let welded = weld(&mesh.positions);
        let (mut triangles, faces) = cut(mesh, &welded);
        let sides = sides(&triangles);
        let (mut across, odd_edges, boundary_edges) = across(&sides, triangles.len());
        let count = mesh.positions.len();
        let torn = orient(&mut triangles, &mut across, count);
        let mut edges: Vec<[u32; 2]> = sides.iter().map(|side| [side.low, side.high]).collect();
        edges.dedup();
        let both = edges.iter().flat_map(|&[a, b]| [(a, b), (b, a)]);
        let mut rings = Lists::from_pairs(count, both);
        for vertex in 0..count {
            let range = rings.starts[vertex] as usize..rings.starts[vertex + 1] as usize;
            rings.items[range].sort_unstable();
        }
        let corners = triangles.iter().enumerate().flat_map(|(t, corners)| corners.map(|v| (v, t as u32)));
        let fans = Lists::from_pairs(count, corners);
        let mut made =
            Self { welded, triangles, faces, rings, fans, inner: Vec::new(), boundary_edges, odd_edges };
        made.inner = (0..count as u32).map(|vertex| made.closes(vertex, &across, &torn)).collect();
        Ok(made)
    }

    /// The number of vertices that the mesh has, welded ones too.
    pub fn vertex_count(&self) -> usize {
        self.welded.len()
    }

    /// The vertex that stands for a vertex of the mesh.
    pub fn welded(&self, vertex: u32) -> Option<u32> {
        self.welded.get(vertex as usize).copied()
    }

    /// The corners of the triangles, counter-clockwise seen from outside as far as the mesh has an outside.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// For each triangle the face of the mesh that it was cut from, ascending.
    pub fn faces(&self) -> &[u32] {
        &self.faces
    }

    /// The vertices that share an edge with a vertex, ascending. A vertex that is in no triangle has none.
    ///
    /// # Panics
    /// A vertex that is not there.
    pub fn ring(&self, vertex: u32) -> &[u32] {
        self.rings.get(vertex)
    }

    /// The triangles at a vertex, ascending.
    ///
    /// # Panics
    /// A vertex that is not there.
    pub fn fan(&self, vertex: u32) -> &[u32] {
        self.fans.get(vertex)
    }

    /// For each vertex whether the surface goes on all around it: it is in one closed fan of triangles that wind
    /// alike. Others have no curvature.
    pub fn inner(&self) -> &[bool] {
        &self.inner
    }

    /// How many edges belong to one triangle alone.
    pub fn boundary_edges(&self) -> usize {
        self.boundary_edges
    }

    /// How many edges belong to three triangles or more.
    pub fn non_manifold_edges(&self) -> usize {
        self.odd_edges
    }

    /// The first two vertices that were one and are further apart than a distance in metres: a seam that has opened.
    pub fn torn(&self, positions: &[[f32; 3]], most_m: f64) -> Option<[u32; 2]> {
        let all = self.welded.iter().enumerate().filter(|&(vertex, &stands)| vertex as u32 != stands);
        let place = |vertex: u32| {
            DVec3::from(positions.get(vertex as usize).map_or([f64::NAN; 3], |p| p.map(f64::from)))
        };
        all.map(|(vertex, &stands)| [vertex as u32, stands])
            .find(|&[a, b]| place(a).distance(place(b)) > most_m)
    }

    /// The mean length of the edges in metres; 0 where there are none.
    pub fn mean_edge_m(&self, positions: &[[f32; 3]]) -> f64 {
        let place = |vertex: u32| DVec3::from(positions[vertex as usize].map(f64::from));
        let edges = (0..self.vertex_count() as u32)
            .flat_map(|a| self.ring(a).iter().filter(move |&&b| a < b).map(move |&b| (a, b)));
        let (sum, count) = edges
            .map(|(a, b)| place(a).distance(place(b)))
            .fold((0.0, 0usize), |(sum, count), length| (sum + length, count + 1));
        if count == 0 { 0.0 } else { sum / count as f64 }
    }

    /// Whether the triangles at a vertex close around it.
    fn closes(&self, vertex: u32, across: &[[u32; 3]], torn: &[bool]) -> bool {
        let fan = self.fan(vertex);
        let (Some(&first), false) = (fan.first(), torn[vertex as usize]) else { return false };
        let mut at = first;
        for walked in 1..=fan.len() {
            // The side that leads away from the vertex.
            let corners = self.triangles[at as usize];
            let Some(corner) = corners.iter().position(|&v| v == vertex) else { return false };
            at = across[at as usize][corner];
            if at == NONE {
                return false;
            }
            if at == first {
                return walked == fan.len();
            }
        }
        false
    }
}

fn check(mesh: &Mesh) -> Result<()> {
    let total = mesh.face_sizes.iter().map(|&size| u64::from(size)).sum::<u64>();
    if total != mesh.face_vertices.len() as u64 {
        return Err(Error::new(format!(
            "the faces have {total} vertices by their sizes, but {} are listed",
            mesh.face_vertices.len()
        )));
    }
    if mesh.positions.len() >= NONE as usize || mesh.face_vertices.len() >= NONE as usize / 3 {
        return Err(Error::new(format!(
            "a mesh of {} vertices and {} face corners is larger than cloth is followed",
            mesh.positions.len(),
            mesh.face_vertices.len()
        )));
    }
    let count = mesh.positions.len();
    match mesh.face_vertices.iter().find(|&&vertex| vertex as usize >= count) {
        Some(vertex) => Err(Error::new(format!("a face has vertex {vertex}, but the mesh has {count}"))),
        None => Ok(()),
    }
}

/// For each vertex the first that lies where it does.
fn weld(positions: &[[f32; 3]]) -> Vec<u32> {
    let mut first: HashMap<[u32; 3], u32> = HashMap::with_capacity(positions.len());
    let weld = |(vertex, position): (usize, &[f32; 3])| {
        // −0 lies where 0 does.
        let key = position.map(|c| (c + 0.0).to_bits());
        *first.entry(key).or_insert(vertex as u32)
    };
    positions.iter().enumerate().map(weld).collect()
}

/// Cuts polygons into triangles, each with the number of its polygon.
fn cut(mesh: &Mesh, welded: &[u32]) -> (Vec<[u32; 3]>, Vec<u32>) {
    let place = |vertex: u32| DVec3::from(mesh.positions[vertex as usize].map(f64::from));
    let mut triangles = Vec::with_capacity(2 * mesh.face_sizes.len());
    let mut faces = Vec::with_capacity(2 * mesh.face_sizes.len());
    let mut push = |corners: [u32; 3], number: usize| {
        let [a, b, c] = corners.map(|vertex| welded[vertex as usize]);
        if a != b && b != c && c != a {
            triangles.push([a, b, c]);
            faces.push(number as u32);
        }
    };
    let mut start = 0;
    for (number, &size) in mesh.face_sizes.iter().enumerate() {
        let face = &mesh.face_vertices[start..start + size as usize];
        start += size as usize;
        if let &[a, b, c, d] = face
            && place(b).distance_squared(place(d)) < place(a).distance_squared(place(c))
        {
            push([a, b, d], number);
            push([b, c, d], number);
            continue;
        }
        for pair in face.get(1..).unwrap_or_default().windows(2) {
            push([face[0], pair[0], pair[1]], number);
        }
    }
    (triangles, faces)
}

/// The sides of all triangles, those of one edge side by side.
fn sides(triangles: &[[u32; 3]]) -> Vec<Side> {
    let mut sides = Vec::with_capacity(3 * triangles.len());
    for (triangle, corners) in triangles.iter().enumerate() {
        for side in 0..3 {
            let (a, b) = (corners[side], corners[(side + 1) % 3]);
            sides.push(Side { low: a.min(b), high: a.max(b), triangle: triangle as u32, side: side as u8 });
        }
    }
    sides.sort_unstable_by_key(|side| (side.low, side.high, side.triangle, side.side));
    sides
}

/// For each side of each triangle the triangle beyond it, where there is exactly one; how many edges have more, and how
/// many have none.
fn across(sides: &[Side], count: usize) -> (Vec<[u32; 3]>, usize, usize) {
    let mut across = vec![[NONE; 3]; count];
    let (mut odd, mut boundary) = (0, 0);
    for edge in sides.chunk_by(|a, b| (a.low, a.high) == (b.low, b.high)) {
        match edge {
            [_] => boundary += 1,
            [a, b] => {
                across[a.triangle as usize][a.side as usize] = b.triangle;
                across[b.triangle as usize][b.side as usize] = a.triangle;
            }
            _ => odd += 1,
        }
    }
    (across, odd, boundary)
}

/// Turns triangles so that neighbours wind alike. Tells for each vertex whether it is at an edge where they still do not.
fn orient(triangles: &mut [[u32; 3]], across: &mut [[u32; 3]], vertices: usize) -> Vec<bool> {
    let ascends = |triangles: &[[u32; 3]], t: u32, a: u32, b: u32| {
        let corners = triangles[t as usize];
        (0..3).any(|side| corners[side] == a && corners[(side + 1) % 3] == b)
    };
    let mut turned: Vec<Option<bool>> = vec![None; triangles.len()];
    let mut part = Vec::new();
    for seed in 0..triangles.len() as u32 {
        if turned[seed as usize].is_some() {
            continue;
        }
        turned[seed as usize] = Some(false);
        part.clear();
        part.push(seed);
        let mut next = 0;
        while let Some(&t) = part.get(next) {
            next += 1;
            let corners = triangles[t as usize];
            for side in 0..3 {
                let other = across[t as usize][side];
                if other == NONE || turned[other as usize].is_some() {
                    continue;
                }
                // Neighbours that wind alike pass their edge in opposite directions.
                let differs = ascends(triangles, other, corners[side], corners[(side + 1) % 3]);
                turned[other as usize] = turned[t as usize].map(|turned| turned ^ differs);
                part.push(other);
            }
        }
        let turns = part.iter().filter(|&&t| turned[t as usize] == Some(true)).count();
        if 2 * turns > part.len() {
            for &t in &part {
                turned[t as usize] = turned[t as usize].map(|turned| !turned);
            }
        }
    }
    let mut torn = vec![false; vertices];
    for t in 0..triangles.len() {
        let corners = triangles[t];
        for side in 0..3 {
            let (a, b, other) = (corners[side], corners[(side + 1) % 3], across[t][side]);
            if other != NONE {
                let differs = ascends(triangles, other, a, b);
                let turns = turned[t].unwrap_or_default() ^ turned[other as usize].unwrap_or_default();
                if differs != turns {
                    torn[a as usize] = true;
                    torn[b as usize] = true;
                }
            }
        }
    }
    for ((corners, beyond), turned) in triangles.iter_mut().zip(across).zip(&turned) {
        if *turned == Some(true) {
            corners.swap(1, 2);
            beyond.swap(0, 2);
        }
    }
    torn
}

#[cfg(test)]
mod tests;
