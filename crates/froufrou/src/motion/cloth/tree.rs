//! A bounding volume hierarchy over the triangles of a mesh that moves: built once, refitted from frame to frame.
//!
//! Each node has up to eight children, whose boxes are measured at once; those of the lowest nodes are triangles.

use glam::DVec3;

use super::geodesic::holds;
use super::leaf::{Leaf, greater, lesser};
use super::triangle::{Nearest, nearest};
use super::triangulation::Triangulation;

/// Children of a node at most.
pub(super) const WIDTH: usize = 8;
/// Boxes are measured in single precision, as is the best against them. What is further by this part may be left out.
const MARGIN: f32 = 1.0 - 1e-5;

/// A number for each child.
pub(super) type Lanes = [f32; WIDTH];

#[derive(Debug, Clone, Copy)]
struct Node {
    /// The boxes of the children; that of one that is not there is nowhere.
    low: [Lanes; 3],
    high: [Lanes; 3],
    /// The triangles within, as they lie in the order of the tree: the first, and behind the last.
    first: u32,
    end: u32,
    /// The first of its children, which lie side by side, or its leaf.
    child: u32,
    children: u32,
    /// Whether its children are triangles, from `first` on.
    is_leaf: bool,
}

/// The tree.
#[derive(Debug, Clone, Default)]
pub(super) struct Tree {
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
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

    /// What is nearer than this, squared, may be the closest.
    #[inline(always)]
    fn bound(&self) -> f32 {
        self.nearest.squared_m2 as f32
    }

    pub fn found(self) -> Option<Self> {
        (self.object != u32::MAX).then_some(self)
    }
}

/// Cuts some triangles into parts of about one size, each time across their longest side, and gives where they end.
fn cut(part: &mut [u32], parts: usize, centres: &[[f32; 3]], from: usize, ends: &mut Vec<usize>) {
    if parts <= 1 {
        ends.push(from + part.len());
        return;
    }
    let mut lengths = [0.0_f32; 3];
    for (axis, length) in lengths.iter_mut().enumerate() {
        let places = part.iter().map(|&i| centres[i as usize][axis]);
        let (low, high) =
            places.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), c| (low.min(c), high.max(c)));
        *length = high - low;
    }
    let longest = |a: usize, b: usize| if lengths[b] > lengths[a] { b } else { a };
    let axis = longest(longest(0, 1), 2);
    let key = |i: u32| centres[i as usize][axis];
    let fewer = parts / 2;
    let half = part.len() * fewer / parts;
    part.select_nth_unstable_by(half, |&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
    let (before, after) = part.split_at_mut(half);
    cut(before, fewer, centres, from, ends);
    cut(after, parts - fewer, centres, from + half, ends);
}

impl Tree {
    /// Builds the tree over triangles as they lie.
    pub fn build(surface: &Triangulation, positions: &[[f32; 3]]) -> Self {
        let triangles = surface.triangles();
        let centre = |&[a, b, c]: &[u32; 3]| -> [f32; 3] {
            let [a, b, c] = [a, b, c].map(|vertex| positions[vertex as usize]);
            std::array::from_fn(|axis| a[axis] + b[axis] + c[axis])
        };
        let centres: Vec<[f32; 3]> = triangles.iter().map(centre).collect();
        let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
        let node = |first: usize, end: usize| Node {
            low: [[f32::INFINITY; WIDTH]; 3],
            high: [[f32::NEG_INFINITY; WIDTH]; 3],
            first: first as u32,
            end: end as u32,
            child: 0,
            children: (end - first) as u32,
            is_leaf: true,
        };
        let mut nodes = vec![node(0, order.len())];
        let (mut ends, mut leaves) = (Vec::new(), 0);
        let mut at = 0;
        while let Some(&Node { first, end, .. }) = nodes.get(at) {
            let (mut first, end) = (first as usize, end as usize);
            let count = end - first;
            if count > WIDTH {
                // Few triangles go to as few nodes as can hold them.
                let parts = count.div_ceil(WIDTH).min(WIDTH);
                ends.clear();
                cut(&mut order[first..end], parts, &centres, first, &mut ends);
                nodes[at] =
                    Node { child: nodes.len() as u32, children: parts as u32, is_leaf: false, ..nodes[at] };
                for &end in &ends {
                    nodes.push(node(first, end));
                    first = end;
                }
            } else {
                nodes[at].child = leaves as u32;
                leaves += 1;
            }
            at += 1;
        }
        let mut slots = vec![0; order.len()];
        for (slot, &triangle) in order.iter().enumerate() {
            slots[triangle as usize] = slot as u32;
        }
        let leaves = vec![Leaf::default(); leaves];
        let mut tree = Self { nodes, leaves, order, slots, corners: Vec::new() };
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
            let Node { first, child, children, is_leaf, .. } = self.nodes[at];
            for lane in 0..children as usize {
                let (low, high) = if is_leaf {
                    let [a, b, c] = self.corners[first as usize + lane];
                    self.leaves[child as usize].set(lane, [a, b, c]);
                    let by = |less: fn(f32, f32) -> f32| {
                        std::array::from_fn(|axis| less(less(a[axis], b[axis]), c[axis]))
                    };
                    (by(lesser), by(greater))
                } else {
                    let inner = &self.nodes[child as usize + lane];
                    (
                        inner.low.map(|lanes| fold(&lanes, lesser)),
                        inner.high.map(|lanes| fold(&lanes, greater)),
                    )
                };
                let node = &mut self.nodes[at];
                for axis in 0..3 {
                    (node.low[axis][lane], node.high[axis][lane]) = (low[axis], high[axis]);
                }
            }
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
    #[inline(always)]
    pub fn nearest(&self, object: u32, point: [f32; 3], left_out: &[[u32; 2]], best: &mut Best) {
        if self.order.is_empty() {
            return;
        }
        let wide = DVec3::from(point.map(f64::from));
        // A node has eight children at most, and even halves make ten levels hold more than can be numbered.
        let mut stack = [(0u32, 0.0_f32); 10 * WIDTH];
        let (mut height, mut bound) = (1, best.bound());
        while height > 0 {
            height -= 1;
            let (at, squared) = stack[height];
            if squared > bound {
                continue;
            }
            let node = &self.nodes[at as usize];
            let squares = node.squared_m2(point);
            let mut near = 0u32;
            for (lane, &squared) in squares.iter().enumerate() {
                near |= u32::from(squared <= bound) << lane;
            }
            near &= (1 << node.children) - 1;
            if node.is_leaf && near != 0 {
                near &= self.leaves[node.child as usize].may_be_within(point, bound);
            }
            let bottom = height;
            while near != 0 {
                let lane = near.trailing_zeros();
                near &= near - 1;
                if node.is_leaf {
                    let slot = node.first + lane;
                    if squares[lane as usize] <= bound
                        && (object, self.order[slot as usize]) != (best.object, best.triangle)
                        && (left_out.is_empty() || !holds(left_out, slot, slot + 1))
                    {
                        let found = nearest(wide, self.corners(slot));
                        best.offer(object, self.order[slot as usize], found);
                        bound = best.bound();
                    }
                    continue;
                }
                let inner = node.child + lane;
                if !left_out.is_empty() {
                    let Node { first, end, .. } = self.nodes[inner as usize];
                    if holds(left_out, first, end) {
                        continue;
                    }
                }
                // The nearest comes last, to be looked at first.
                let (squared, mut place) = (squares[lane as usize], height);
                while place > bottom && stack[place - 1].1 < squared {
                    stack[place] = stack[place - 1];
                    place -= 1;
                }
                stack[place] = (inner, squared);
                height += 1;
            }
        }
    }
}

fn fold(lanes: &Lanes, by: fn(f32, f32) -> f32) -> f32 {
    lanes.iter().copied().reduce(by).unwrap_or_default()
}

impl Node {
    /// How far the boxes of its children are from a point, squared, and a little less, lest rounding hides one.
    #[inline(always)]
    fn squared_m2(&self, point: [f32; 3]) -> Lanes {
        let mut sums = [0.0; WIDTH];
        for ((low, high), at) in self.low.iter().zip(&self.high).zip(point) {
            for lane in 0..WIDTH {
                let away = greater(greater(low[lane] - at, at - high[lane]), 0.0);
                sums[lane] += away * away;
            }
        }
        sums.map(|sum| sum * MARGIN)
    }
}
