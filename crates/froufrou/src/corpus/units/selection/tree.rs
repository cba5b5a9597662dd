//! The tree of an index: which windows are near one another, by their means.
//!
//! Windows are halved again and again by the number of their means that spreads widest, until leaves have few enough.
//! Three halvings make a level, so that a node has eight children; only the root may have fewer. A node knows the boxes of
//! its children, of their windows' means and of their units' own features; a leaf knows the means and the outlines, of
//! blocks into which it is halved further.

use std::ops::Range;

use rayon::prelude::*;

use super::packed::{Frame, Packed};

/// How many children a node has.
pub(super) const CHILDREN: usize = 8;

/// How many units of a leaf lie side by side, in one of its blocks.
pub(super) const LANES: usize = 16;

/// How often a leaf is halved to make its blocks, and how many they are.
const BLOCK_HALVINGS: u32 = 2;
const BLOCKS: usize = 1 << BLOCK_HALVINGS;

/// The most units of a leaf.
const LEAF: usize = BLOCKS * LANES;

/// How many of many units tell which number spreads widest.
const SAMPLE: usize = 512;

/// A node, by how far it is from the root, and its number among those that are as far.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Node {
    pub level: u32,
    pub place: u32,
}

impl Node {
    pub const ROOT: Self = Self { level: 0, place: 0 };
}

/// What a tree is made of: for each unit, the same so many numbers of each kind, unit by unit.
pub(super) struct Outlines {
    pub dimensions: usize,
    /// The mean of the whole window.
    pub means: Vec<f32>,
    /// The means of its segments, of which the first is the unit itself.
    pub segments: Vec<Vec<f32>>,
}

/// See the module.
pub(super) struct Tree {
    /// How often units were halved, and in how many levels.
    halvings: u32,
    depth: u32,
    /// The first node of each level, when all are counted; the last level is that of the leaves.
    levels: Vec<usize>,
    /// Units in the order of leaves; in a block they come as they are numbered.
    order: Vec<u32>,
    /// Where each block of the leaves begins in that order, and where the last ends.
    block_starts: Vec<u32>,
    /// Boxes of each node's children: around means, and around each segment; the latter are asked for seldom.
    mean_boxes: Packed,
    segment_boxes: Packed,
    /// Means and then segments of each leaf's units, block by block.
    outlines: Packed,
    /// Whether all units of a node have the same window.
    alike: Vec<bool>,
}

impl Tree {
    /// The tree of outlines. It has units by what `name` makes of their numbers, and asks whether the windows of two that
    /// are named so are the same.
    pub fn new(
        outlines: &Outlines,
        name: impl Fn(usize) -> u32 + Sync,
        are_alike: impl Fn(u32, u32) -> bool + Sync,
    ) -> Self {
        let d = outlines.dimensions;
        let units = outlines.means.len() / d;
        let halvings = units.div_ceil(LEAF).next_power_of_two().trailing_zeros();
        let mut order: Vec<u32> = (0..units as u32).collect();
        halve(&mut order, &outlines.means, d, halvings + BLOCK_HALVINGS);
        let mut block_starts = vec![0u32];
        block_lengths(units, halvings + BLOCK_HALVINGS, &mut block_starts);
        let mut rest = order.as_mut_slice();
        for pair in block_starts.windows(2) {
            let (block, after) = rest.split_at_mut((pair[1] - pair[0]) as usize);
            block.sort_unstable();
            rest = after;
        }
        let depth = halvings.div_ceil(CHILDREN.trailing_zeros());
        let nothing = || Packed::new((0, 1), d, 0, |_, _, _| (), |_, _, _, _| ());
        let mut tree = Self {
            halvings,
            depth,
            levels: vec![0],
            order,
            block_starts,
            mean_boxes: nothing(),
            segment_boxes: nothing(),
            outlines: nothing(),
            alike: Vec::new(),
        };
        for level in 0..depth {
            tree.levels.push(tree.levels[level as usize] + tree.nodes(level));
        }
        let segments: Vec<&[f32]> = outlines.segments.iter().map(|segment| &**segment).collect();
        tree.mean_boxes = tree.boxes(d, &[&outlines.means]);
        tree.segment_boxes = tree.boxes(d, &segments);
        tree.outlines = tree.lanes(outlines);
        tree.order.par_iter_mut().for_each(|unit| *unit = name(*unit as usize));
        tree.find_alike(are_alike);
        tree
    }

    /// The level of the leaves.
    pub fn depth(&self) -> u32 {
        self.depth
    }

    /// The children of a node that is no leaf: the first, which the others follow, and how many.
    #[inline(always)]
    pub fn children(&self, node: Node) -> (Node, usize) {
        let first = Node { level: node.level + 1, place: node.place * CHILDREN as u32 };
        (first, if node.level == 0 { self.nodes(1) } else { CHILDREN })
    }

    /// The boxes of a node's children around the means of their windows.
    #[inline(always)]
    pub fn mean_boxes(&self, node: Node) -> (Frame<'_>, &[u8]) {
        self.mean_boxes.get(self.number(node), 0)
    }

    /// The boxes of a node's children around a segment.
    #[inline(always)]
    pub fn segment_boxes(&self, segment: usize, node: Node) -> (Frame<'_>, &[u8]) {
        self.segment_boxes.get(self.number(node), segment)
    }

    /// The units of a leaf.
    #[inline(always)]
    pub fn leaf(&self, leaf: u32) -> &[u32] {
        &self.order[self.range(Node { level: self.depth, place: leaf })]
    }

    /// The blocks of a leaf's units; some may be empty where there are few.
    #[inline(always)]
    pub fn blocks(&self, leaf: u32) -> impl Iterator<Item = &[u32]> {
        let starts = &self.block_starts[leaf as usize * BLOCKS..][..=BLOCKS];
        starts.windows(2).map(|pair| &self.order[pair[0] as usize..pair[1] as usize])
    }

    /// The means of a leaf's windows.
    #[inline(always)]
    pub fn means(&self, leaf: u32) -> (Frame<'_>, &[u8]) {
        self.outlines.get(leaf as usize, 0)
    }

    /// A segment of a leaf's windows.
    #[inline(always)]
    pub fn segment(&self, segment: usize, leaf: u32) -> (Frame<'_>, &[u8]) {
        self.outlines.get(leaf as usize, 1 + segment)
    }

    /// The units of a node where all have the same window, in the order of their numbers. So it is with silence, of which
    /// there may be much.
    #[inline(always)]
    pub fn alike(&self, node: Node) -> Option<&[u32]> {
        self.alike[self.number(node)].then(|| &self.order[self.range(node)])
    }

    #[inline(always)]
    fn number(&self, node: Node) -> usize {
        self.levels[node.level as usize] + node.place as usize
    }

    /// How many nodes a level has.
    #[inline(always)]
    fn nodes(&self, level: u32) -> usize {
        1 << (self.halvings - self.below(level))
    }

    /// How many halvings lie below a level.
    #[inline(always)]
    fn below(&self, level: u32) -> u32 {
        ((self.depth - level) * CHILDREN.trailing_zeros()).min(self.halvings)
    }

    /// Where the units of a node begin and end in the order of leaves.
    #[inline(always)]
    fn range(&self, node: Node) -> Range<usize> {
        let (below, place) = (self.below(node.level), node.place as usize);
        let start = |place: usize| self.block_starts[(place << below) * BLOCKS] as usize;
        start(place)..start(place + 1)
    }

    /// Packs the boxes of all nodes' children around vectors of units, of several kinds.
    fn boxes(&self, dimensions: usize, kinds: &[&[f32]]) -> Packed {
        let d = dimensions;
        let all: Vec<Vec<f32>> = kinds.iter().map(|vectors| self.plain_boxes(d, vectors)).collect();
        let bounds = |node: usize, kind: usize, bounds: &mut [f32]| {
            bounds.copy_from_slice(&all[kind][node * 2 * d..][..2 * d]);
        };
        let nodes = self.levels[self.depth as usize];
        let bytes = 2 * d * CHILDREN;
        Packed::new((nodes, kinds.len()), d, bytes, bounds, |number, kind, (lowest, step), bytes| {
            let level = self.levels.partition_point(|first| *first <= number) - 1;
            let place = (number - self.levels[level]) as u32;
            let (first, count) = self.children(Node { level: level as u32, place });
            let children = all[kind][self.number(first) * 2 * d..].chunks_exact(2 * d).take(count);
            for (c, (low, high)) in children.map(|child| child.split_at(d)).enumerate() {
                for (n, sides) in bytes.chunks_exact_mut(2 * CHILDREN).enumerate() {
                    sides[c] = ((low[n] - lowest[n]) / step).floor() as u8;
                    sides[CHILDREN + c] = ((high[n] - lowest[n]) / step).ceil() as u8;
                }
            }
        })
    }

    /// The boxes of all nodes and leaves around vectors of units: the lowest of each number, and then the highest.
    fn plain_boxes(&self, dimensions: usize, vectors: &[f32]) -> Vec<f32> {
        let d = dimensions;
        let last = self.levels[self.depth as usize];
        let mut all = vec![0.0f32; (last + self.nodes(self.depth)) * 2 * d];
        let (mut rest, leaves) = all.split_at_mut(last * 2 * d);
        leaves.par_chunks_mut(2 * d).enumerate().for_each(|(leaf, bounds)| {
            let units = self.leaf(leaf as u32).iter();
            let vector = |unit: &u32| &vectors[*unit as usize * d..][..d];
            enclose(bounds, units.map(|unit| (vector(unit), vector(unit))));
        });
        let mut below: &[f32] = leaves;
        for level in (0..self.depth).rev() {
            let (above, own) = rest.split_at_mut(self.levels[level as usize] * 2 * d);
            let (_, children) = self.children(Node { level, place: 0 });
            own.par_chunks_mut(2 * d).zip(below.par_chunks(children * 2 * d)).for_each(
                |(bounds, children)| {
                    enclose(bounds, children.chunks_exact(2 * d).map(|child| child.split_at(d)));
                },
            );
            (below, rest) = (own, above);
        }
        all
    }

    /// Packs the outlines of all units, leaf by leaf.
    fn lanes(&self, outlines: &Outlines) -> Packed {
        let d = outlines.dimensions;
        let kinds: Vec<&[f32]> =
            std::iter::once(&outlines.means).chain(&outlines.segments).map(|kind| &**kind).collect();
        let vector = |kind: usize, unit: u32| &kinds[kind][unit as usize * d..][..d];
        let leaves = self.nodes(self.depth);
        let bounds = |leaf: usize, kind: usize, bounds: &mut [f32]| {
            let units = self.leaf(leaf as u32).iter();
            enclose(bounds, units.map(|unit| (vector(kind, *unit), vector(kind, *unit))));
        };
        let bytes = LEAF * d;
        Packed::new((leaves, kinds.len()), d, bytes, bounds, |leaf, kind, (lowest, step), bytes| {
            for (units, bytes) in self.blocks(leaf as u32).zip(bytes.chunks_exact_mut(d * LANES)) {
                for (lane, unit) in units.iter().enumerate() {
                    for (n, value) in vector(kind, *unit).iter().enumerate() {
                        bytes[n * LANES + lane] = ((value - lowest[n]) / step).round() as u8;
                    }
                }
            }
        })
    }

    fn find_alike(&mut self, are_alike: impl Fn(u32, u32) -> bool + Sync) {
        let first = |node: Node| self.order[self.range(node).start];
        let leaf = |leaf: u32| {
            let units = self.leaf(leaf);
            units.len() > 1 && units.iter().all(|unit| are_alike(*unit, units[0]))
        };
        let mut alike = vec![false; self.levels[self.depth as usize]];
        let leaves = self.nodes(self.depth) as u32;
        alike.extend((0..leaves).into_par_iter().map(leaf).collect::<Vec<bool>>());
        for level in (0..self.depth).rev() {
            for place in 0..self.nodes(level) as u32 {
                let node = Node { level, place };
                let (child, count) = self.children(node);
                let mut children =
                    (child.place..child.place + count as u32).map(|place| Node { level: child.level, place });
                let is_alike =
                    |child: Node| alike[self.number(child)] && are_alike(first(child), first(node));
                alike[self.number(node)] = children.all(is_alike);
            }
        }
        self.alike = alike;
    }
}

/// The box around boxes.
fn enclose<'a>(bounds: &mut [f32], boxes: impl Iterator<Item = (&'a [f32], &'a [f32])>) {
    let (lowest, highest) = bounds.split_at_mut(bounds.len() / 2);
    lowest.fill(f32::INFINITY);
    highest.fill(f32::NEG_INFINITY);
    for (low, high) in boxes {
        lowest.iter_mut().zip(low).for_each(|(lowest, low)| *lowest = lowest.min(*low));
        highest.iter_mut().zip(high).for_each(|(highest, high)| *highest = highest.max(*high));
    }
}

/// Puts the half that is lower in the number that spreads widest first, and so on in each half.
fn halve(order: &mut [u32], vectors: &[f32], dimensions: usize, levels: u32) {
    if levels == 0 || order.len() < 2 {
        return;
    }
    let d = dimensions;
    let step = order.len().div_ceil(SAMPLE);
    let (mut sums, mut squares, mut count) = (vec![0.0f64; d], vec![0.0f64; d], 0.0);
    for unit in order.iter().step_by(step) {
        for (n, value) in vectors[*unit as usize * d..][..d].iter().enumerate() {
            let value = f64::from(*value);
            sums[n] += value;
            squares[n] += value * value;
        }
        count += 1.0;
    }
    let spread = |n: &usize| squares[*n] - sums[*n] * sums[*n] / count;
    let widest = (0..d).max_by(|a, b| spread(a).total_cmp(&spread(b))).unwrap_or(0);
    let middle = order.len() / 2;
    let value = |unit: u32| vectors[unit as usize * d + widest];
    order.select_nth_unstable_by(middle, |a, b| value(*a).total_cmp(&value(*b)).then(a.cmp(b)));
    let (low, high) = order.split_at_mut(middle);
    let halves = |part: &mut [u32]| halve(part, vectors, d, levels - 1);
    match middle > 4096 {
        true => {
            rayon::join(|| halves(low), || halves(high));
        }
        false => {
            halves(low);
            halves(high);
        }
    }
}

/// Where blocks end that halving makes.
fn block_lengths(units: usize, levels: u32, ends: &mut Vec<u32>) {
    match levels {
        0 => ends.push(ends[ends.len() - 1] + units as u32),
        _ => {
            block_lengths(units / 2, levels - 1, ends);
            block_lengths(units - units / 2, levels - 1, ends);
        }
    }
}
