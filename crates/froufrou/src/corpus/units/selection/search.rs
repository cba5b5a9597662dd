//! The units whose windows are nearest.

use super::index::Index;
use super::tree::{CHILDREN, LANES, Node};

/// What rounding of 32-bit bounds may come to, as a share of numbers and of the bound.
const ROUNDING: f64 = 1e-6;

/// How many children a mean may leave over before segments are asked.
const MANY: u32 = 3;

/// A unit and its distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// Its number, over all streams.
    pub unit: usize,
    /// D2, of as many terms as were asked for.
    pub distance: f64,
}

/// Asks an index.
pub struct Search<'a> {
    index: &'a Index,
    /// Nodes to be looked at, with what their units are at least away.
    stack: Vec<(f32, Node)>,
    /// The largest bound of what may be near enough.
    limit: f32,
    /// The outline that is asked for.
    outline: Vec<f32>,
    /// The mean of its window.
    mean: Vec<f32>,
    barred: Vec<u32>,
    /// Rows and distances, the nearest first.
    nearest: Vec<(f64, u32)>,
    found: Vec<Found>,
}

/// What is asked for.
struct Query<'a> {
    /// Features of the target's unit and those after it.
    window: &'a [f64],
    d_max: f64,
    count: usize,
    /// How many segments of the outline it has.
    segments: usize,
    /// What a bound in 32 bits may be too large by.
    slack: f64,
    /// The largest bound of D1 that may be within `d_max`.
    first_limit: f32,
    /// True for a window with all of its terms, and how many they are.
    is_whole: bool,
    terms: f32,
}

impl Query<'_> {
    /// The largest bound of what may be no more than a distance, finite in any case.
    fn limit(slack: f64, distance: f64) -> f32 {
        // Rounding to the nearest is less than what is given beyond.
        ((distance + slack) * (1.0 + 20.0 * ROUNDING)).min(f64::from(f32::MAX)) as f32
    }
}

impl<'a> Search<'a> {
    pub(super) fn new(index: &'a Index) -> Self {
        let numbers = index.outline_numbers();
        Self {
            index,
            stack: Vec::new(),
            limit: f32::MAX,
            outline: vec![0.0; numbers],
            mean: vec![0.0; index.dimensions],
            barred: Vec::new(),
            nearest: Vec::new(),
            found: Vec::new(),
        }
    }

    /// The units with the smallest Σ_k ‖f_{j+k} − w_k‖ over the rows w of a window, at most so many, the nearest first and
    /// of equally near ones the first first. Left out are those with ‖f_j − w_0‖ > `d_max` and those that are barred. A hint
    /// is a unit that is likely near; it changes nothing but the time it takes.
    pub fn nearest(
        &mut self,
        window: &[f64],
        d_max: f64,
        count: usize,
        barred: &[usize],
        hint: Option<usize>,
    ) -> &[Found] {
        let index = self.index;
        let d = index.dimensions;
        let terms = (window.len() / d).min(index.look_ahead + 1);
        let window = &window[..terms * d];
        self.barred.clear();
        self.barred.extend(barred.iter().map(|unit| index.row_of(*unit) as u32));
        self.nearest.clear();
        self.found.clear();
        let segments = index.segments.iter().take_while(|(from, length)| from + length <= terms).count();
        let mut largest = f64::from(index.largest);
        for (part, &(from, length)) in self.outline.chunks_exact_mut(d).zip(&index.segments[..segments]) {
            for (k, mean) in part.iter_mut().enumerate() {
                let sum: f64 = window[from * d..(from + length) * d].iter().skip(k).step_by(d).sum();
                *mean = (sum / length as f64) as f32;
                largest = largest.max(f64::from(mean.abs()));
            }
        }
        let slack = ROUNDING * terms as f64 * (d as f64).sqrt() * largest;
        let first_limit = Query::limit(slack, d_max);
        let is_whole = terms == index.look_ahead + 1;
        for (k, mean) in self.mean.iter_mut().enumerate() {
            *mean = (window.iter().skip(k).step_by(d).sum::<f64>() / terms as f64) as f32;
        }
        let query =
            Query { window, d_max, count, segments, slack, first_limit, is_whole, terms: terms as f32 };
        self.limit = f32::MAX;
        if count > 0 {
            if let Some(unit) = hint.filter(|unit| *unit < index.units()) {
                self.weigh(&query, index.row_of(unit) as u32);
            }
            pulp::Arch::new().dispatch(Descent { search: self, query: &query });
        }
        let found = self.nearest.iter();
        self.found
            .extend(found.map(|&(distance, row)| Found { unit: index.unit_of(row as usize), distance }));
        &self.found
    }

    #[inline(always)]
    fn descend(&mut self, query: &Query, d: usize) {
        let tree = &self.index.tree;
        self.stack.clear();
        self.stack.push((0.0, Node::ROOT));
        while let Some((least, node)) = self.stack.pop() {
            if least > self.limit {
                continue;
            }
            if let Some(rows) = tree.alike(node) {
                for row in rows {
                    if !self.weigh(query, *row) {
                        break;
                    }
                }
            } else if node.level == tree.depth() {
                self.leaf(query, d, node.place);
            } else {
                self.children(query, d, node);
            }
        }
    }

    /// Remembers the children of a node that may have near units, the nearest last.
    #[inline(always)]
    fn children(&mut self, query: &Query, d: usize, node: Node) {
        let tree = &self.index.tree;
        let mut least = [0.0f32; CHILDREN];
        if query.is_whole {
            let (frame, boxes) = tree.mean_boxes(node);
            least = frame.outside(boxes, &self.mean[..d]);
            for least in &mut least {
                *least *= query.terms;
            }
        }
        // Segments tell more than the mean where that leaves over much, and D1 is one of them.
        let left_over = least.iter().fold(0, |count, least| count + u32::from(*least <= self.limit));
        if !query.is_whole || left_over > MANY || self.limit > query.first_limit {
            let mut sums = [0.0f32; CHILDREN];
            let mut most = query.first_limit;
            for (segment, &(_, length)) in self.index.segments.iter().enumerate().take(query.segments) {
                let (frame, boxes) = tree.segment_boxes(segment, node);
                let distances =
                    frame.outside::<CHILDREN>(boxes, &self.outline[segment * d..(segment + 1) * d]);
                for c in 0..CHILDREN {
                    sums[c] += if distances[c] > most { f32::INFINITY } else { length as f32 * distances[c] };
                }
                most = f32::INFINITY;
            }
            for c in 0..CHILDREN {
                least[c] = if sums[c] > least[c] { sums[c] } else { least[c] };
            }
        }
        let from = self.stack.len();
        let (first, count) = tree.children(node);
        for (c, least) in least.into_iter().enumerate().take(count) {
            if least <= self.limit {
                let node = Node { level: first.level, place: first.place + c as u32 };
                let mut at = self.stack.len();
                self.stack.push((least, node));
                while at > from && self.stack[at - 1].0 < least {
                    self.stack.swap(at - 1, at);
                    at -= 1;
                }
            }
        }
    }

    /// Compares the units of a leaf that are near by their means, and then by their outlines.
    #[inline(always)]
    fn leaf(&mut self, query: &Query, d: usize, leaf: u32) {
        let tree = &self.index.tree;
        let (frame, means) = tree.means(leaf);
        for (block, rows) in tree.blocks(leaf).enumerate() {
            let part = block * d * LANES..(block + 1) * d * LANES;
            if query.is_whole {
                let squares = frame.squares::<LANES>(&means[part.clone()], &self.mean[..d]);
                if !any_within(&squares, frame.square(self.limit / query.terms, d)) {
                    continue;
                }
            }
            let mut sums = [0.0f32; LANES];
            let mut most = query.first_limit;
            for (segment, &(_, length)) in self.index.segments.iter().enumerate().take(query.segments) {
                let (frame, bytes) = tree.segment(segment, leaf);
                let wanted = &self.outline[segment * d..(segment + 1) * d];
                let least = frame.beside::<LANES>(&bytes[part.clone()], wanted);
                for i in 0..LANES {
                    sums[i] += if least[i] > most { f32::INFINITY } else { length as f32 * least[i] };
                }
                most = f32::INFINITY;
            }
            if any_within(&sums, self.limit) {
                for (row, sum) in rows.iter().zip(sums) {
                    if sum <= self.limit {
                        self.weigh(query, *row);
                    }
                }
            }
        }
    }

    /// Compares the whole window of a row; false where it is too far, and so are later rows that are alike.
    fn weigh(&mut self, query: &Query, row: u32) -> bool {
        let d = self.index.dimensions;
        let rows = &self.index.rows[row as usize * d..][..query.window.len()];
        let is_full = self.nearest.len() >= query.count;
        let farthest = self.nearest.last().filter(|_| is_full).copied();
        let mut sum = 0.0f64;
        for (k, (row, wanted)) in rows.chunks_exact(d).zip(query.window.chunks_exact(d)).enumerate() {
            let distance = distance(row, wanted);
            if k == 0 && distance > query.d_max {
                return false;
            }
            sum += distance;
            if farthest.is_some_and(|(farthest, _)| sum > farthest) {
                return false;
            }
        }
        if farthest.is_some_and(|farthest| (sum, row) > farthest) {
            return false;
        }
        if self.barred.contains(&row) {
            return true;
        }
        let at = self.nearest.partition_point(|nearer| *nearer < (sum, row));
        // What was hinted at comes along again.
        if self.nearest.get(at) == Some(&(sum, row)) {
            return true;
        }
        if is_full {
            self.nearest.pop();
        }
        self.nearest.insert(at, (sum, row));
        if let Some((farthest, _)) = self.nearest.get(query.count - 1) {
            self.limit = Query::limit(query.slack, *farthest);
        }
        true
    }
}

/// What a search does, for vector units as wide as there are.
struct Descent<'s, 'a, 'q> {
    search: &'s mut Search<'a>,
    query: &'s Query<'q>,
}

impl pulp::WithSimd for Descent<'_, '_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        // The number is known where most code is made of it.
        match self.search.index.dimensions {
            3 => self.search.descend(self.query, 3),
            dimensions => self.search.descend(self.query, dimensions),
        }
    }
}

/// Whether any is no more than a limit, all at once.
#[inline(always)]
fn any_within(distances: &[f32; LANES], limit: f32) -> bool {
    let mut any = false;
    for distance in distances {
        any |= *distance <= limit;
    }
    any
}

/// ‖f − w‖.
pub(in crate::corpus::units) fn distance(row: &[f32], wanted: &[f64]) -> f64 {
    let squares = row.iter().zip(wanted).map(|(f, w)| (f64::from(*f) - w) * (f64::from(*f) - w));
    squares.sum::<f64>().sqrt()
}
