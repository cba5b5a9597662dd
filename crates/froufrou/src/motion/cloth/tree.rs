//! A bounding volume hierarchy over the triangles of a mesh that moves: built once, refitted from frame to frame.

use glam::DVec3;

use super::geodesic::holds;
use super::triangle::{Nearest, nearest};
use super::triangulation::Triangulation;

/// Triangles in a leaf at most.
const LEAF: usize = 4;
/// Boxes are measured in single precision. What is further than the best by this part may be left out.
const MARGIN: f32 = 1.0 - 1e-5;

#[derive(Debug, Clone, Copy)]
struct Node {
    low: [f32; 3],
    high: [f32; 3],
    /// The triangles within, as they lie in the order of the tree: the first, and behind the last.
    first: u32,
    end: u32,
    /// The first of its two children, which lie side by side; 0 for a leaf.
    child: u32,
}

/// The tree.
#[derive(Debug, Clone, Default)]
pub(super) struct Tree {
    nodes: Vec<Node>,
    /// The triangles in its order.
    order: Vec<u32>,
    /// The place of each triangle in its order.
    slots: Vec<u32>,
    /// The corners of the triangles, in its order.
    corners: Vec<[[f32; 3]; 3]>,
}

/// The closest triangle that was found so far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Best {
    pub object: u32,
    pub triangle: u32,
    pub nearest: Nearest,
}

impl Best {
    /// Nothing yet, and nothing beyond a distance.
    pub fn within(radius_m: f64) -> Self {
        let nearest = Nearest { weights: [0.0; 3], squared_m2: radius_m * radius_m };
        Self { object: u32::MAX, triangle: u32::MAX, nearest }
    }

    /// Takes a triangle that is nearer; of those that are as near the first of the first object.
    #[inline]
    pub fn offer(&mut self, object: u32, triangle: u32, nearest: Nearest) {
        let (new, old) = (nearest.squared_m2, self.nearest.squared_m2);
        if new < old || (new == old && (object, triangle) < (self.object, self.triangle)) {
            *self = Self { object, triangle, nearest };
        }
    }

    pub fn found(self) -> Option<Self> {
        (self.object != u32::MAX).then_some(self)
    }
}

impl Tree {
    /// Builds the tree over triangles as they lie, halving them along their longest side until four are left.
    pub fn build(surface: &Triangulation, positions: &[[f32; 3]]) -> Self {
        let triangles = surface.triangles();
        let centre = |&[a, b, c]: &[u32; 3]| -> [f32; 3] {
            let [a, b, c] = [a, b, c].map(|vertex| positions[vertex as usize]);
            std::array::from_fn(|axis| a[axis] + b[axis] + c[axis])
        };
        let centres: Vec<[f32; 3]> = triangles.iter().map(centre).collect();
        let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
        let node = |first: usize, end: usize| Node {
            low: [f32::INFINITY; 3],
            high: [f32::NEG_INFINITY; 3],
            first: first as u32,
            end: end as u32,
            child: 0,
        };
        let mut nodes = vec![node(0, order.len())];
        let mut at = 0;
        while let Some(&Node { first, end, .. }) = nodes.get(at) {
            let (first, end) = (first as usize, end as usize);
            if end - first > LEAF {
                let part = &mut order[first..end];
                let mut lengths = [0.0_f32; 3];
                for (axis, length) in lengths.iter_mut().enumerate() {
                    let places = part.iter().map(|&i| centres[i as usize][axis]);
                    let (low, high) = places
                        .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), c| (low.min(c), high.max(c)));
                    *length = high - low;
                }
                let longest = |a: usize, b: usize| if lengths[b] > lengths[a] { b } else { a };
                let axis = longest(longest(0, 1), 2);
                let key = |i: u32| centres[i as usize][axis];
                let half = part.len() / 2;
                part.select_nth_unstable_by(half, |&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
                nodes[at].child = nodes.len() as u32;
                nodes.push(node(first, first + half));
                nodes.push(node(first + half, end));
            }
            at += 1;
        }
        let mut slots = vec![0; order.len()];
        for (slot, &triangle) in order.iter().enumerate() {
            slots[triangle as usize] = slot as u32;
        }
        let mut tree = Self { nodes, order, slots, corners: Vec::new() };
        tree.refit(surface, positions);
        tree
    }

    /// The place of each triangle in the order of the tree.
    pub fn slots(&self) -> &[u32] {
        &self.slots
    }

    /// Takes up where the same triangles are now.
    pub fn refit(&mut self, surface: &Triangulation, positions: &[[f32; 3]]) {
        let triangles = surface.triangles();
        self.corners.clear();
        let corners = |&t: &u32| triangles[t as usize].map(|vertex| positions[vertex as usize]);
        self.corners.extend(self.order.iter().map(corners));
        for at in (0..self.nodes.len()).rev() {
            let Node { first, end, child, .. } = self.nodes[at];
            let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
            let mut hold = |from: &[f32; 3], to: &[f32; 3]| {
                for axis in 0..3 {
                    low[axis] = low[axis].min(from[axis]);
                    high[axis] = high[axis].max(to[axis]);
                }
            };
            if child == 0 {
                let corners = self.corners[first as usize..end as usize].as_flattened();
                corners.iter().for_each(|corner| hold(corner, corner));
            } else {
                let children = &self.nodes[child as usize..child as usize + 2];
                children.iter().for_each(|child| hold(&child.low, &child.high));
            }
            (self.nodes[at].low, self.nodes[at].high) = (low, high);
        }
    }

    /// The corners of a triangle.
    #[inline]
    fn corners(&self, slot: u32) -> [DVec3; 3] {
        self.corners[slot as usize].map(|corner| DVec3::from(corner.map(f64::from)))
    }

    /// The point of one triangle that is closest to a point.
    pub fn nearest_of(&self, triangle: u32, point: DVec3) -> Option<Nearest> {
        let slot = *self.slots.get(triangle as usize)?;
        Some(nearest(point, self.corners(slot)))
    }

    /// The triangles of this tree that are nearer to a point than the best so far. Those whose slots lie in the
    /// intervals `left_out` are left out.
    pub fn nearest(&self, object: u32, point: [f32; 3], left_out: &[[u32; 2]], best: &mut Best) {
        if self.order.is_empty() {
            return;
        }
        let wide = DVec3::from(point.map(f64::from));
        // The halves are even, so that a stack of 64 holds any tree.
        let mut stack = [(0u32, 0.0_f32); 64];
        let mut height = 1;
        stack[0] = (0, self.nodes[0].squared_m2(point));
        while height > 0 {
            height -= 1;
            let (at, squared) = stack[height];
            let node = &self.nodes[at as usize];
            if f64::from(squared * MARGIN) > best.nearest.squared_m2
                || (!left_out.is_empty() && holds(left_out, node.first, node.end))
            {
                continue;
            }
            if node.child == 0 {
                for slot in node.first..node.end {
                    if left_out.is_empty() || !holds(left_out, slot, slot + 1) {
                        let found = nearest(wide, self.corners(slot));
                        best.offer(object, self.order[slot as usize], found);
                    }
                }
                continue;
            }
            let children = [node.child, node.child + 1];
            let squares = children.map(|child| self.nodes[child as usize].squared_m2(point));
            let nearer = usize::from(squares[1] < squares[0]);
            for which in [1 - nearer, nearer] {
                if f64::from(squares[which] * MARGIN) <= best.nearest.squared_m2 {
                    stack[height] = (children[which], squares[which]);
                    height += 1;
                }
            }
        }
    }
}

impl Node {
    /// How far its box is from a point, squared.
    #[inline]
    fn squared_m2(&self, point: [f32; 3]) -> f32 {
        let mut sum = 0.0;
        for axis in 0..3 {
            let away = (self.low[axis] - point[axis]).max(point[axis] - self.high[axis]).max(0.0);
            sum += away * away;
        }
        sum
    }
}
