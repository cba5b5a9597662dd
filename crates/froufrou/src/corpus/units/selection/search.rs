//! The units whose windows are nearest.

use super::index::{Index, LANES};

/// What rounding of 32-bit bounds may come to, as a share of numbers and of the bound.
const ROUNDING: f64 = 1e-6;

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
    stack: Vec<(f32, u32)>,
    /// The outline that is asked for.
    outline: Vec<f32>,
    squares: Vec<f32>,
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
}

impl<'a> Search<'a> {
    pub(super) fn new(index: &'a Index) -> Self {
        let numbers = index.outline_numbers();
        Self {
            index,
            stack: Vec::new(),
            outline: vec![0.0; numbers],
            squares: vec![0.0; numbers],
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
        let query = Query { window, d_max, count, segments, slack };
        if let Some(unit) = hint.filter(|unit| *unit < index.units()) {
            self.weigh(&query, index.row_of(unit) as u32);
        }
        self.stack.clear();
        self.stack.push((0.0, 0));
        let inner = index.leaves() - 1;
        while let Some((least, node)) = self.stack.pop() {
            if self.is_beyond(&query, least) {
                continue;
            }
            let node = node as usize;
            if let Some(range) = index.alike(node) {
                for row in &index.order[range] {
                    if !self.weigh(&query, *row) {
                        break;
                    }
                }
                continue;
            }
            if node >= inner {
                self.leaf(&query, node - inner);
                continue;
            }
            let mut children = [(self.bound(&query, 2 * node + 1), 2 * node + 1); 2];
            children[1] = (self.bound(&query, 2 * node + 2), 2 * node + 2);
            if children[0].0 < children[1].0 {
                children.swap(0, 1);
            }
            for (least, node) in children {
                if !self.is_beyond(&query, least) {
                    self.stack.push((least, node as u32));
                }
            }
        }
        let found = self.nearest.iter();
        self.found
            .extend(found.map(|&(distance, row)| Found { unit: index.unit_of(row as usize), distance }));
        &self.found
    }

    /// True where nothing at least so far away is asked for.
    fn is_beyond(&self, query: &Query, least: f32) -> bool {
        let farthest = match self.nearest.len() < query.count {
            true => f64::INFINITY,
            false => self.nearest.last().map_or(f64::NEG_INFINITY, |(distance, _)| *distance),
        };
        f64::from(least) * (1.0 - 10.0 * ROUNDING) - query.slack > farthest
    }

    /// True where a unit at least so far away is farther than it may be.
    fn is_too_far(query: &Query, first: f32) -> bool {
        f64::from(first) * (1.0 - 10.0 * ROUNDING) - query.slack > query.d_max
    }

    /// What the windows below a node are at least away; infinity where they are all farther than they may be.
    fn bound(&mut self, query: &Query, node: usize) -> f32 {
        let (d, numbers) = (self.index.dimensions, self.squares.len());
        let (lowest, highest) = self.index.boxes[node * 2 * numbers..][..2 * numbers].split_at(numbers);
        for (((square, q), low), high) in self.squares.iter_mut().zip(&self.outline).zip(lowest).zip(highest)
        {
            let outside = (low - q).max(q - high).max(0.0);
            *square = outside * outside;
        }
        let mut sum = 0.0f32;
        let parts = self.squares.chunks_exact(d).zip(&self.index.segments).take(query.segments);
        for (number, (part, &(_, length))) in parts.enumerate() {
            let distance = part.iter().sum::<f32>().sqrt();
            if number == 0 && Self::is_too_far(query, distance) {
                return f32::INFINITY;
            }
            sum += length as f32 * distance;
        }
        sum
    }

    fn leaf(&mut self, query: &Query, leaf: usize) {
        let index = self.index;
        let (d, numbers) = (index.dimensions, index.outline_numbers());
        let outlines = &index.outlines[leaf * numbers * LANES..][..numbers * LANES];
        let mut sums = [0.0f32; LANES];
        let mut firsts = [0.0f32; LANES];
        for (segment, &(_, length)) in index.segments.iter().enumerate().take(query.segments) {
            let mut squares = [0.0f32; LANES];
            for k in segment * d..(segment + 1) * d {
                let (lanes, _) = outlines[k * LANES..][..LANES].as_chunks::<LANES>();
                for (square, value) in squares.iter_mut().zip(&lanes[0]) {
                    let difference = value - self.outline[k];
                    *square += difference * difference;
                }
            }
            for (sum, square) in sums.iter_mut().zip(&squares) {
                *sum += length as f32 * square.sqrt();
            }
            if segment == 0 {
                firsts = sums;
            }
        }
        let range = index.leaf_starts[leaf] as usize..index.leaf_starts[leaf + 1] as usize;
        for ((row, sum), first) in index.order[range].iter().zip(sums).zip(firsts) {
            if !self.is_beyond(query, sum) && !Self::is_too_far(query, first) {
                self.weigh(query, *row);
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
        true
    }
}

/// ‖f − w‖.
pub(in crate::corpus::units) fn distance(row: &[f32], wanted: &[f64]) -> f64 {
    let squares = row.iter().zip(wanted).map(|(f, w)| (f64::from(*f) - w) * (f64::from(*f) - w));
    squares.sum::<f64>().sqrt()
}
