//! Where a sheet tears: edges that had the sheet on both sides have it on one.
//!
//! Simulators tear by vertices that become two. Faces stay as many and in their order then, and so every vertex of the
//! new mesh is known in the old one by the corners of its faces; this also holds for welded seams that open. Where a
//! mesh is made anew, its borders are looked at instead: what is far from every old border was torn. Simulators that know
//! may say which edges tear.

use std::collections::{BTreeMap, HashMap, HashSet};

use glam::DVec3;

use super::sheet::Sheet;
use crate::motion::cloth::triangulation::Triangulation;
use crate::scene::animation::Mesh;

/// If more than this part of all borders is new, it is another sheet.
const ANOTHER: f64 = 0.8;

/// A part that was torn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Torn {
    pub position: DVec3,
    pub length_m: f64,
}

/// A sheet in one frame.
#[derive(Clone, Copy)]
pub(super) struct Known<'a> {
    pub sheet: &'a Sheet,
    pub surface: &'a Triangulation,
    pub positions: &'a [[f32; 3]],
    pub face_vertices: &'a [u32],
    pub face_sizes: &'a [u32],
}

impl<'a> Known<'a> {
    pub fn of(sheet: &'a Sheet, surface: &'a Triangulation, mesh: &'a Mesh) -> Self {
        let Mesh { positions, face_vertices, face_sizes } = mesh;
        Self { sheet, surface, positions, face_vertices, face_sizes }
    }

    fn place(&self, vertex: u32) -> DVec3 {
        DVec3::from(self.positions[vertex as usize].map(f64::from))
    }
}

/// What was torn between two frames.
pub(super) fn torn(old: Known<'_>, new: Known<'_>) -> Vec<Torn> {
    match correspondence(old, new) {
        Some(old_of) => by_corners(old, new, &old_of),
        None => by_borders(old, new),
    }
}

/// What is torn along edges of a mesh that are told.
pub(super) fn told(edges: &[[u32; 2]], surface: &Triangulation, positions: &[[f32; 3]]) -> Vec<Torn> {
    let welded = |vertex: u32| surface.welded(vertex).unwrap_or(vertex);
    let key = |[a, b]: [u32; 2]| [welded(a).min(welded(b)), welded(a).max(welded(b))];
    let mut edges: Vec<[u32; 2]> = edges.iter().copied().map(key).collect();
    edges.sort_unstable();
    edges.dedup();
    along(&edges, |vertex| DVec3::from(positions[vertex as usize].map(f64::from)))
}

/// The old vertex of every new one, where faces are the same.
fn correspondence(old: Known<'_>, new: Known<'_>) -> Option<HashMap<u32, u32>> {
    if old.face_sizes != new.face_sizes {
        return None;
    }
    let mut old_of = HashMap::with_capacity(new.positions.len());
    let (mut differing, mut count) = (0usize, 0usize);
    for (&before, &now) in old.face_vertices.iter().zip(new.face_vertices) {
        let (before, now) = (old.surface.welded(before)?, new.surface.welded(now)?);
        count += 1;
        differing += usize::from(*old_of.entry(now).or_insert(before) != before);
    }
    (20 * differing <= count).then_some(old_of)
}

fn by_corners(old: Known<'_>, new: Known<'_>, old_of: &HashMap<u32, u32>) -> Vec<Torn> {
    let key = |[a, b]: [u32; 2]| [a.min(b), a.max(b)];
    let inner: HashSet<[u32; 2]> =
        old.sheet.edges.iter().filter(|edge| edge.inner().is_some()).map(|edge| key(edge.ends)).collect();
    let borders = new.sheet.edges.iter().filter(|edge| edge.is_border);
    let ends = borders.filter_map(|edge| {
        let [a, b] = edge.ends.map(|v| old_of.get(&v).copied());
        Some(key([a?, b?]))
    });
    // Either side of a tear is a border; by the old edge it counts once.
    let mut edges: Vec<[u32; 2]> = ends.filter(|ends| inner.contains(ends)).collect();
    edges.sort_unstable();
    edges.dedup();
    along(&edges, |vertex| old.place(vertex))
}

/// The tears along some edges: what hangs together is one.
fn along(edges: &[[u32; 2]], place: impl Fn(u32) -> DVec3) -> Vec<Torn> {
    let mut at: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (index, ends) in edges.iter().enumerate() {
        ends.iter().for_each(|&v| at.entry(v).or_default().push(index));
    }
    let mut is_seen = vec![false; edges.len()];
    let mut found = Vec::new();
    for seed in 0..edges.len() {
        if std::mem::replace(&mut is_seen[seed], true) {
            continue;
        }
        let (mut stack, mut middle, mut length) = (vec![seed], DVec3::ZERO, 0.0);
        while let Some(index) = stack.pop() {
            let [a, b] = edges[index].map(&place);
            let own = a.distance(b);
            middle += own * 0.5 * (a + b);
            length += own;
            for next in edges[index].iter().filter_map(|v| at.get(v)).flatten() {
                if !std::mem::replace(&mut is_seen[*next], true) {
                    stack.push(*next);
                }
            }
        }
        if length > 0.0 {
            found.push(Torn { position: middle / length, length_m: length });
        }
    }
    found
}

fn by_borders(old: Known<'_>, new: Known<'_>) -> Vec<Torn> {
    let mean_edge_m = old.surface.mean_edge_m(old.positions).max(new.surface.mean_edge_m(new.positions));
    if mean_edge_m <= 0.0 {
        return Vec::new();
    }
    let cell = |p: DVec3| (p / mean_edge_m).floor().to_array().map(|c| c as i64);
    let mut near: HashSet<[i64; 3]> = HashSet::new();
    for edge in old.sheet.edges.iter().filter(|edge| edge.is_border) {
        let [a, b] = edge.ends.map(|v| old.place(v));
        // Not more often than the whole border is long: an edge may be as long as a mesh is wide.
        let parts = (a.distance(b) / (0.5 * mean_edge_m)).ceil().clamp(1.0, 4096.0);
        for part in 0..=parts as u32 {
            let [x, y, z] = cell(a.lerp(b, f64::from(part) / parts));
            for offset in 0..27 {
                near.insert([x + offset % 3 - 1, y + offset / 3 % 3 - 1, z + offset / 9 - 1]);
            }
        }
    }
    let (mut middle, mut length, mut all) = (DVec3::ZERO, 0.0, 0.0);
    for edge in new.sheet.edges.iter().filter(|edge| edge.is_border) {
        let [a, b] = edge.ends.map(|v| new.place(v));
        all += a.distance(b);
        if !near.contains(&cell(0.5 * (a + b))) {
            middle += a.distance(b) * 0.5 * (a + b);
            length += a.distance(b);
        }
    }
    // A tear has two sides.
    let is_torn = length > 0.0 && length < ANOTHER * all;
    is_torn.then(|| Torn { position: middle / length, length_m: 0.5 * length }).into_iter().collect()
}
