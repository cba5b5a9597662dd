//! A tree of all units of the recordings.
//!
//! A unit's window, the features of it and of the L units after it, is summed up by its *outline*: the unit's own
//! features, and the means of a few segments of the rest. For a segment of h units Σ ‖a_k‖ ≥ h ‖mean a_k‖, so distances
//! of outlines are never more than those of windows; and as features are smooth, not much less. The tree halves units by
//! the number of the outline that spreads widest. Each of its nodes has a box around its outlines, and each leaf has the
//! outlines of up to [`LANES`] units side by side.

use rayon::prelude::*;

use super::search::Search;
use crate::corpus::units::features::Features;
use crate::error::{Error, Result};

/// The most units of a leaf, whose outlines fill vector units.
pub(super) const LANES: usize = 16;

/// How many numbers an outline should have at most, and how many units a segment.
const OUTLINE: usize = 16;
const SEGMENT: usize = 5;

/// How many of many units tell which number spreads widest.
const SAMPLE: usize = 512;

/// All units of the recordings, ready to be asked for near ones.
pub struct Index {
    pub(super) dimensions: usize,
    pub(super) look_ahead: usize,
    /// Features row by row; each stream is followed by its last row L times.
    pub(super) rows: Vec<f32>,
    /// The number of each stream's first unit, and of all units.
    starts: Vec<usize>,
    /// First row of a window and how many.
    pub(super) segments: Vec<(usize, usize)>,
    /// Rows in the order of leaves.
    pub(super) order: Vec<u32>,
    /// Where each leaf begins in that order, and where the last ends.
    pub(super) leaf_starts: Vec<u32>,
    /// Outlines of each leaf: for each number, that of all units of the leaf.
    pub(super) outlines: Vec<f32>,
    /// Of each node the lowest of each number, then the highest; the children of node n are 2n + 1 and 2n + 2.
    pub(super) boxes: Vec<f32>,
    /// Whether all units of a node have the same window.
    alike: Vec<bool>,
    /// The largest number of all, regardless of its sign.
    pub(super) largest: f32,
}

impl Index {
    /// Makes the index of units that come in streams of these lengths.
    ///
    /// # Errors
    /// Lengths that do not add up to the units, no units, more than 2³² − 1, or features that are not finite.
    pub fn new(features: &Features, streams: &[usize], look_ahead: usize) -> Result<Self> {
        let dimensions = features.dimensions();
        let mut starts = vec![0usize];
        for length in streams {
            starts.push(starts[starts.len() - 1].saturating_add(*length));
        }
        let units = features.len();
        if starts[streams.len()] != units {
            let total = starts[streams.len()];
            return Err(Error::new(format!(
                "streams of {total} units do not make the {units} units there are"
            )));
        }
        if units == 0 || dimensions == 0 {
            return Err(Error::new("there are no units to choose from"));
        }
        let padded = units + streams.len() * look_ahead;
        if u32::try_from(padded).is_err() {
            return Err(Error::new(format!("{units} units are more than can be numbered"))
                .help("make the corpus of fewer recordings, or of longer units"));
        }
        if let Some(place) = features.values().iter().position(|value| !value.is_finite()) {
            return Err(Error::new(format!("a feature of unit {} is not finite", place / dimensions)));
        }
        let mut rows = Vec::with_capacity(padded * dimensions);
        for (stream, &length) in streams.iter().enumerate().filter(|(_, length)| **length > 0) {
            let from = starts[stream];
            rows.extend_from_slice(&features.values()[from * dimensions..(from + length) * dimensions]);
            for _ in 0..look_ahead {
                rows.extend_from_slice(features.row(from + length - 1));
            }
        }
        starts.dedup();
        let segments = segments(dimensions, look_ahead);
        let largest = rows.iter().fold(0.0f32, |most, value| most.max(value.abs()));
        let mut index = Self {
            dimensions,
            look_ahead,
            rows,
            starts,
            segments,
            order: Vec::new(),
            leaf_starts: Vec::new(),
            outlines: Vec::new(),
            boxes: Vec::new(),
            alike: Vec::new(),
            largest,
        };
        index.grow();
        Ok(index)
    }

    /// How many units there are.
    pub fn units(&self) -> usize {
        self.starts[self.starts.len() - 1]
    }

    /// How many numbers a unit has.
    pub fn dimensions(&self) -> usize {
        self.dimensions
    }

    /// How many units after each are compared as well.
    pub fn look_ahead(&self) -> usize {
        self.look_ahead
    }

    /// The features of a unit, and of those after it.
    ///
    /// # Panics
    /// Where there is no such unit.
    pub fn window(&self, unit: usize) -> &[f32] {
        &self.rows[self.row_of(unit) * self.dimensions..][..(self.look_ahead + 1) * self.dimensions]
    }

    /// True where the second of two units comes right after the first in the same stream.
    pub fn follows(&self, first: usize, second: usize) -> bool {
        second == first + 1 && self.starts.binary_search(&second).is_err()
    }

    /// A search, which many threads may have at once.
    pub fn search(&self) -> Search<'_> {
        Search::new(self)
    }

    /// The row of a unit, of which streams before it have added some.
    pub(super) fn row_of(&self, unit: usize) -> usize {
        unit + self.look_ahead * (self.starts.partition_point(|start| *start <= unit) - 1)
    }

    /// The unit of a row.
    pub(super) fn unit_of(&self, row: usize) -> usize {
        let (mut low, mut high) = (0, self.starts.len() - 1);
        // The last stream whose first row is not after it.
        while low + 1 < high {
            let middle = (low + high) / 2;
            match self.starts[middle] + middle * self.look_ahead <= row {
                true => low = middle,
                false => high = middle,
            }
        }
        row - low * self.look_ahead
    }

    /// How many numbers an outline has.
    pub(super) fn outline_numbers(&self) -> usize {
        self.segments.len() * self.dimensions
    }

    /// How many leaves there are: a power of two.
    pub(super) fn leaves(&self) -> usize {
        self.leaf_starts.len() - 1
    }

    /// Where all units of a node have the same window: where they begin and end in the order of leaves, in which they come
    /// as they are numbered. So it is with silence, of which there may be much.
    pub(super) fn alike(&self, node: usize) -> Option<std::ops::Range<usize>> {
        if !self.alike[node] {
            return None;
        }
        Some(self.range(node))
    }

    /// Where the units of a node begin and end in the order of leaves.
    fn range(&self, node: usize) -> std::ops::Range<usize> {
        let (mut first, mut last) = (node, node);
        while first < self.leaves() - 1 {
            (first, last) = (2 * first + 1, 2 * last + 2);
        }
        let leaf = |node: usize| node + 1 - self.leaves();
        self.leaf_starts[leaf(first)] as usize..self.leaf_starts[leaf(last) + 1] as usize
    }

    fn grow(&mut self) {
        let (units, numbers) = (self.units(), self.outline_numbers());
        let levels = units.div_ceil(LANES).next_power_of_two().trailing_zeros();
        let leaves = 1usize << levels;
        let outlines = self.all_outlines();
        let weights: Vec<f32> =
            self.segments.iter().flat_map(|(_, length)| vec![*length as f32; self.dimensions]).collect();
        let mut order: Vec<u32> = (0..units as u32).collect();
        halve(&mut order, &outlines, &weights, levels);
        let mut leaf_starts = vec![0u32];
        leaf_lengths(units, levels, &mut leaf_starts);
        let mut rest = order.as_mut_slice();
        for pair in leaf_starts.windows(2) {
            let (leaf, after) = rest.split_at_mut((pair[1] - pair[0]) as usize);
            leaf.sort_unstable();
            rest = after;
        }
        self.outlines = vec![0.0; leaves * numbers * LANES];
        self.boxes = vec![0.0; (2 * leaves - 1) * 2 * numbers];
        let (_, leaf_boxes) = self.boxes.split_at_mut((leaves - 1) * 2 * numbers);
        self.outlines
            .par_chunks_mut(numbers * LANES)
            .zip(leaf_boxes.par_chunks_mut(2 * numbers))
            .zip(leaf_starts.par_windows(2))
            .for_each(|((lanes, bounds), range)| {
                bounds[..numbers].fill(f32::INFINITY);
                bounds[numbers..].fill(f32::NEG_INFINITY);
                for (lane, &unit) in order[range[0] as usize..range[1] as usize].iter().enumerate() {
                    for (n, value) in outlines[unit as usize * numbers..][..numbers].iter().enumerate() {
                        lanes[n * LANES + lane] = *value;
                        bounds[n] = bounds[n].min(*value);
                        bounds[numbers + n] = bounds[numbers + n].max(*value);
                    }
                }
            });
        for node in (0..leaves - 1).rev() {
            let (parents, children) = self.boxes.split_at_mut((2 * node + 1) * 2 * numbers);
            let parent = &mut parents[node * 2 * numbers..][..2 * numbers];
            let (left, right) = children[..4 * numbers].split_at(2 * numbers);
            for n in 0..numbers {
                parent[n] = left[n].min(right[n]);
                parent[numbers + n] = left[numbers + n].max(right[numbers + n]);
            }
        }
        order.par_iter_mut().for_each(|unit| *unit = self.row_of(*unit as usize) as u32);
        (self.order, self.leaf_starts) = (order, leaf_starts);
        self.alike = self.find_alike();
    }

    fn find_alike(&self) -> Vec<bool> {
        let (leaves, d) = (self.leaves(), self.dimensions);
        let window = |row: u32| &self.rows[row as usize * d..][..(self.look_ahead + 1) * d];
        let in_leaf = |leaf: usize| {
            let rows = &self.order[self.range(leaf + leaves - 1)];
            rows.len() > 1 && rows.iter().all(|row| window(*row) == window(rows[0]))
        };
        let leaf: Vec<bool> = (0..leaves).into_par_iter().map(in_leaf).collect();
        let mut alike = vec![false; leaves - 1];
        alike.extend(leaf);
        for node in (0..leaves - 1).rev() {
            let first = |child: usize| window(self.order[self.range(child).start]);
            let (left, right) = (2 * node + 1, 2 * node + 2);
            alike[node] = alike[left] && alike[right] && first(left) == first(right);
        }
        alike
    }

    fn all_outlines(&self) -> Vec<f32> {
        let numbers = self.outline_numbers();
        let mut all = vec![0.0f32; self.units() * numbers];
        all.par_chunks_mut(numbers).enumerate().for_each(|(unit, outline)| {
            let window = self.window(unit);
            for (part, &(from, length)) in outline.chunks_exact_mut(self.dimensions).zip(&self.segments) {
                for (d, mean) in part.iter_mut().enumerate() {
                    let value = |k: usize| f64::from(window[k * self.dimensions + d]);
                    *mean = ((from..from + length).map(value).sum::<f64>() / length as f64) as f32;
                }
            }
        });
        all
    }
}

/// The unit itself, then the others in segments of about equal length.
fn segments(dimensions: usize, look_ahead: usize) -> Vec<(usize, usize)> {
    let most = (OUTLINE / dimensions).saturating_sub(1).max(1);
    let count = look_ahead.div_ceil(SEGMENT).max(look_ahead.min(2)).min(most);
    let edge = |i: usize| 1 + i * look_ahead / count.max(1);
    let rest = (0..count).map(|i| (edge(i), edge(i + 1) - edge(i))).filter(|(_, length)| *length > 0);
    std::iter::once((0, 1)).chain(rest).collect()
}

/// Puts the half that is lower in the number that spreads widest first, and so on in each half.
fn halve(order: &mut [u32], outlines: &[f32], weights: &[f32], levels: u32) {
    if levels == 0 || order.len() < 2 {
        return;
    }
    let numbers = weights.len();
    let step = order.len().div_ceil(SAMPLE);
    let (mut sums, mut squares, mut count) = (vec![0.0f64; numbers], vec![0.0f64; numbers], 0.0);
    for unit in order.iter().step_by(step) {
        for (n, value) in outlines[*unit as usize * numbers..][..numbers].iter().enumerate() {
            let value = f64::from(value * weights[n]);
            sums[n] += value;
            squares[n] += value * value;
        }
        count += 1.0;
    }
    let spread = |n: &usize| squares[*n] - sums[*n] * sums[*n] / count;
    let widest = (0..numbers).max_by(|a, b| spread(a).total_cmp(&spread(b))).unwrap_or(0);
    let middle = order.len() / 2;
    let value = |unit: u32| outlines[unit as usize * numbers + widest];
    order.select_nth_unstable_by(middle, |a, b| value(*a).total_cmp(&value(*b)).then(a.cmp(b)));
    let (low, high) = order.split_at_mut(middle);
    let halves = |part: &mut [u32]| halve(part, outlines, weights, levels - 1);
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

/// Where leaves end that halving makes.
fn leaf_lengths(units: usize, levels: u32, ends: &mut Vec<u32>) {
    match levels {
        0 => ends.push(ends[ends.len() - 1] + units as u32),
        _ => {
            leaf_lengths(units / 2, levels - 1, ends);
            leaf_lengths(units - units / 2, levels - 1, ends);
        }
    }
}
