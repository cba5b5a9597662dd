//! What of a mesh is a vertex's own surroundings, by the way along its edges.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

use glam::DVec3;
use rayon::prelude::*;

use super::triangulation::Triangulation;

/// Vertices that lie together share their surroundings, if they are within this part of them.
const PATCH: f64 = 0.125;

/// The surroundings of every vertex of a mesh, as intervals of numbers that its triangles are given in some order.
///
/// A patch is a vertex and others within an eighth of the radius of it. A triangle belongs to the surroundings of all
/// vertices of a patch if a corner of it is within 9/8 of the radius of that vertex. So all that is within the radius
/// of a vertex belongs to its surroundings, and nothing that is further than 5/4 of it. The way is along edges, which
/// is some per cent longer than the straightest.
#[derive(Debug, Clone, Default)]
pub(super) struct Surroundings {
    patches: Vec<u32>,
    starts: Vec<u32>,
    /// First and behind the last, ascending, apart from each other.
    intervals: Vec<[u32; 2]>,
}

/// A vertex that may be near, and the way to it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Reached {
    way: f64,
    vertex: u32,
}

impl Eq for Reached {}

impl Ord for Reached {
    fn cmp(&self, other: &Self) -> Ordering {
        self.way.total_cmp(&other.way).then(self.vertex.cmp(&other.vertex))
    }
}

impl PartialOrd for Reached {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Dijkstra's algorithm within a radius, over and over on the same mesh.
pub(in crate::motion) struct Ways<'a> {
    surface: &'a Triangulation,
    positions: &'a [[f32; 3]],
    /// The shortest known way to each vertex; without bounds where none is.
    way_m: Vec<f64>,
    met: Vec<u32>,
    heap: BinaryHeap<Reverse<Reached>>,
}

impl<'a> Ways<'a> {
    pub fn new(surface: &'a Triangulation, positions: &'a [[f32; 3]]) -> Self {
        let way_m = vec![f64::INFINITY; surface.vertex_count()];
        Self { surface, positions, way_m, met: Vec::new(), heap: BinaryHeap::new() }
    }

    /// The vertices within a distance along the edges of the nearest of some, and how far they are, nearest first.
    pub fn within(&mut self, seeds: &[u32], radius_m: f64) -> Vec<(u32, f64)> {
        let place = |vertex: u32| DVec3::from(self.positions[vertex as usize].map(f64::from));
        let mut found = Vec::new();
        for &seed in seeds {
            self.way_m[seed as usize] = 0.0;
            self.met.push(seed);
            self.heap.push(Reverse(Reached { way: 0.0, vertex: seed }));
        }
        while let Some(Reverse(Reached { way, vertex })) = self.heap.pop() {
            if way > self.way_m[vertex as usize] {
                continue;
            }
            found.push((vertex, way));
            for &next in self.surface.ring(vertex) {
                let longer = way + place(vertex).distance(place(next));
                let known = &mut self.way_m[next as usize];
                if longer <= radius_m && longer < *known {
                    if *known == f64::INFINITY {
                        self.met.push(next);
                    }
                    *known = longer;
                    self.heap.push(Reverse(Reached { way: longer, vertex: next }));
                }
            }
        }
        for vertex in self.met.drain(..) {
            self.way_m[vertex as usize] = f64::INFINITY;
        }
        found
    }
}

impl Surroundings {
    /// The surroundings of all vertices; `number` is what each triangle is called in the order of which intervals are
    /// made.
    pub fn new(surface: &Triangulation, positions: &[[f32; 3]], radius_m: f64, number: &[u32]) -> Self {
        let mut patches = vec![u32::MAX; surface.vertex_count()];
        let mut seeds = Vec::new();
        let mut ways = Ways::new(surface, positions);
        for seed in 0..surface.vertex_count() as u32 {
            if patches[seed as usize] != u32::MAX || surface.fan(seed).is_empty() {
                continue;
            }
            for (vertex, _) in ways.within(&[seed], PATCH * radius_m) {
                if patches[vertex as usize] == u32::MAX {
                    patches[vertex as usize] = seeds.len() as u32;
                }
            }
            seeds.push(seed);
        }
        let near = |ways: &mut Ways<'_>, seed: u32| {
            let vertices = ways.within(&[seed], (1.0 + PATCH) * radius_m);
            let triangles = vertices.iter().flat_map(|&(vertex, _)| surface.fan(vertex));
            let mut numbers: Vec<u32> = triangles.map(|&triangle| number[triangle as usize]).collect();
            numbers.sort_unstable();
            numbers.dedup();
            let runs = numbers.chunk_by(|a, b| a + 1 == *b);
            runs.filter_map(|run| Some([*run.first()?, run.last()? + 1])).collect::<Vec<_>>()
        };
        let lists: Vec<Vec<[u32; 2]>> = seeds
            .par_iter()
            .with_min_len(64)
            .map_init(|| Ways::new(surface, positions), |ways, &seed| near(ways, seed))
            .collect();
        let mut starts = Vec::with_capacity(lists.len() + 1);
        let mut intervals = Vec::new();
        for list in lists {
            starts.push(intervals.len() as u32);
            intervals.extend(list);
        }
        starts.push(intervals.len() as u32);
        Self { patches, starts, intervals }
    }

    /// The intervals of the triangles that are in the surroundings of a vertex; none for one that is in no triangle.
    pub fn of(&self, vertex: u32) -> &[[u32; 2]] {
        match self.patches.get(vertex as usize) {
            Some(&patch) if patch != u32::MAX => {
                let [start, end] = [patch, patch + 1].map(|patch| self.starts[patch as usize] as usize);
                &self.intervals[start..end]
            }
            _ => &[],
        }
    }
}

/// Whether one of some intervals holds all numbers from `first` until before `end`.
pub(super) fn holds(intervals: &[[u32; 2]], first: u32, end: u32) -> bool {
    let next = intervals.partition_point(|interval| interval[1] <= first);
    intervals.get(next).is_some_and(|interval| interval[0] <= first && end <= interval[1])
}

#[cfg(test)]
mod tests;
