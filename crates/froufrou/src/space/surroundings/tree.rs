//! A bounding volume hierarchy over triangles that move: built once, refitted as they do.

use glam::DVec3;

/// An axis-aligned box; one that holds nothing has its low above its high.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bounds {
    pub low: DVec3,
    pub high: DVec3,
}

impl Bounds {
    pub const EMPTY: Self = Self { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };

    pub fn is_empty(&self) -> bool {
        !self.low.cmple(self.high).all()
    }

    fn join(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// The bounds of points; a triangle with a corner that is no number has none.
    pub fn of(points: &[DVec3]) -> Self {
        if !points.iter().all(|p| p.is_finite()) {
            return Self::EMPTY;
        }
        let hold = |bounds: Self, &p: &DVec3| bounds.join(Self { low: p, high: p });
        points.iter().fold(Self::EMPTY, hold)
    }
}

#[derive(Debug, Clone, Copy)]
struct Node {
    bounds: Bounds,
    /// Of a leaf the first of its triangles in `order`, else the first of its two children.
    first: u32,
    /// How many triangles a leaf has; 0 for what has children.
    count: u32,
}

/// What to do at a box of the tree.
pub(crate) enum Go {
    Past,
    Down,
}

/// Triangles in a leaf at most.
const LEAF: usize = 4;

/// The tree.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tree {
    nodes: Vec<Node>,
    order: Vec<u32>,
}

impl Tree {
    /// Builds the tree over `count` triangles, halving them along their longest side until four are left.
    pub fn build(count: usize, corners: impl Fn(usize) -> [DVec3; 3]) -> Self {
        let centres: Vec<DVec3> = (0..count)
            .map(|i| {
                let [a, b, c] = corners(i);
                let centre = (a + b + c) / 3.0;
                if centre.is_finite() { centre } else { DVec3::ZERO }
            })
            .collect();
        let mut order: Vec<u32> = (0..count as u32).collect();
        let node = |first: usize, count: usize| Node {
            bounds: Bounds::EMPTY,
            first: first as u32,
            count: count as u32,
        };
        let mut nodes = vec![node(0, count)];
        let mut at = 0;
        while at < nodes.len() {
            let (first, count) = (nodes[at].first as usize, nodes[at].count as usize);
            if count > LEAF {
                let part = &mut order[first..first + count];
                let hold = |(low, high): (DVec3, DVec3), &i: &u32| {
                    (low.min(centres[i as usize]), high.max(centres[i as usize]))
                };
                let (low, high) = part.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), hold);
                let axis = (high - low).max_position();
                let key = |i: u32| centres[i as usize][axis];
                part.select_nth_unstable_by(count / 2, |&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
                nodes[at] = node(nodes.len(), 0);
                nodes.push(node(first, count / 2));
                nodes.push(node(first + count / 2, count - count / 2));
            }
            at += 1;
        }
        let mut tree = Self { nodes, order };
        tree.refit(corners);
        tree
    }

    /// Takes up where the same triangles are now.
    pub fn refit(&mut self, corners: impl Fn(usize) -> [DVec3; 3]) {
        for at in (0..self.nodes.len()).rev() {
            let Node { first, count, .. } = self.nodes[at];
            let first = first as usize;
            self.nodes[at].bounds = if count > 0 {
                let triangles = &self.order[first..first + count as usize];
                let bounds = triangles.iter().map(|&i| Bounds::of(&corners(i as usize)));
                bounds.fold(Bounds::EMPTY, Bounds::join)
            } else if let Some([a, b]) = self.nodes.get(first..first + 2) {
                a.bounds.join(b.bounds)
            } else {
                Bounds::EMPTY
            };
        }
    }

    /// The bounds of all triangles.
    pub fn bounds(&self) -> Bounds {
        self.nodes.first().map_or(Bounds::EMPTY, |node| node.bounds)
    }

    /// Walks down: `enter` says at each box whether to go on, `triangle` is given those of the leaves. `leaf` is
    /// true for the boxes of leaves.
    pub fn walk<T>(
        &self,
        state: &mut T,
        mut enter: impl FnMut(&mut T, &Bounds, bool) -> Go,
        mut triangle: impl FnMut(&mut T, usize),
    ) {
        // The halves are even, so that a stack of 64 holds any tree.
        let mut stack = [0u32; 64];
        let mut height = usize::from(!self.nodes.is_empty() && !self.order.is_empty());
        while height > 0 {
            height -= 1;
            let node = self.nodes[stack[height] as usize];
            if matches!(enter(state, &node.bounds, node.count > 0), Go::Past) {
                continue;
            }
            let first = node.first as usize;
            if node.count > 0 {
                for &i in &self.order[first..first + node.count as usize] {
                    triangle(state, i as usize);
                }
            } else {
                stack[height] = node.first + 1;
                stack[height + 1] = node.first;
                height += 2;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn cloud(count: usize, time: f64) -> Vec<[DVec3; 3]> {
        let random = Random::new(1, 1);
        let value = |i: usize| random.uniform(i as u64) * 10.0;
        (0..count)
            .map(|t| {
                let centre = DVec3::new(value(12 * t), value(12 * t + 1), value(12 * t + 2));
                std::array::from_fn(|k| {
                    let k = 12 * t + 3 * (k + 1);
                    centre
                        + 0.1 * DVec3::new(value(k), value(k + 1), value(k + 2))
                        + DVec3::X * time * value(k)
                })
            })
            .collect()
    }

    fn within(tree: &Tree, query: Bounds) -> Vec<usize> {
        let overlaps = |b: &Bounds| b.low.cmple(query.high).all() && query.low.cmple(b.high).all();
        let mut found = Vec::new();
        let enter = |_: &mut Vec<usize>, b: &Bounds, _| if overlaps(b) { Go::Down } else { Go::Past };
        tree.walk(&mut found, enter, |found, i| found.push(i));
        found.sort_unstable();
        found
    }

    #[test]
    fn every_triangle_is_found_once_also_after_it_moved() {
        for count in [0, 1, 4, 5, 333] {
            let mut triangles = cloud(count, 0.0);
            let mut tree = Tree::build(count, |i| triangles[i]);
            let everything = Bounds { low: DVec3::splat(-1e9), high: DVec3::splat(1e9) };
            assert_eq!(within(&tree, everything), (0..count).collect::<Vec<_>>());
            triangles = cloud(count, 3.0);
            tree.refit(|i| triangles[i]);
            let query = Bounds { low: DVec3::new(8.0, 2.0, 2.0), high: DVec3::new(14.0, 6.0, 6.0) };
            let found = within(&tree, query);
            for (i, t) in triangles.iter().enumerate() {
                let bounds = Bounds::of(t);
                let meets = bounds.low.cmple(query.high).all() && query.low.cmple(bounds.high).all();
                assert!(!meets || found.contains(&i), "{i} of {count}");
            }
        }
    }

    #[test]
    fn triangles_that_are_no_numbers_take_no_room() {
        let mut triangles = cloud(40, 0.0);
        let whole = Tree::build(40, |i| triangles[i]).bounds();
        triangles.push([DVec3::NAN; 3]);
        triangles.push([DVec3::ZERO, DVec3::X * 1e300 * 1e300, DVec3::Y]);
        assert_eq!(Tree::build(42, |i| triangles[i]).bounds(), whole);
    }
}
