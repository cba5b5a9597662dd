//! A tree of all units of the recordings.
//!
//! A unit's window, the features of it and of the L units after it, is summed up by means: that of all, and its *outline*,
//! the unit's own features and the means of a few segments of the rest. For h units Σ ‖a_k‖ ≥ h ‖mean a_k‖, so distances
//! of means are never more than those of windows, nor are those of outlines, added up; and as features are smooth, not
//! much less. The tree is one of means, which are few numbers; outlines tell more of what it leaves over.

use rayon::prelude::*;

use super::paged::Paged;
use super::search::Search;
use super::tree::{Outlines, Tree};
use crate::corpus::units::features::Features;
use crate::error::{Error, Result};

/// How many numbers an outline should have at most, and how many units a segment.
const OUTLINE: usize = 16;
const SEGMENT: usize = 5;

/// The largest feature, whose square is far from what 32 bits end at.
pub(super) const LARGEST: f64 = 1e15;

/// True for a number that features may have.
pub(super) fn is_usable(value: f64) -> bool {
    value.abs() <= LARGEST
}

/// All units of the recordings, ready to be asked for near ones.
pub struct Index {
    pub(super) dimensions: usize,
    pub(super) look_ahead: usize,
    /// Features row by row; each stream is followed by its last row L times.
    pub(super) rows: Paged<f32>,
    /// The number of each stream's first unit, and of all units.
    starts: Vec<usize>,
    /// First row of a window and how many.
    pub(super) segments: Vec<(usize, usize)>,
    /// Rows by their outlines.
    pub(super) tree: Tree,
    /// The largest number of all, regardless of its sign.
    pub(super) largest: f32,
}

impl Index {
    /// Makes the index of units that come in streams of these lengths.
    ///
    /// # Errors
    /// Lengths that do not add up to the units, no units, more than 2³² − 1, or features that are not finite or beyond 10¹⁵.
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
        if let Some(place) = features.values().iter().position(|value| !is_usable(f64::from(*value))) {
            let (unit, value) = (place / dimensions, features.values()[place]);
            return Err(Error::new(format!(
                "a feature of unit {unit} is {value}, expected one within ±{LARGEST:e}"
            )));
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
        let row_of = |unit: usize| row_of(&starts, look_ahead, unit);
        let numbers = (look_ahead + 1) * dimensions;
        let window = |row: usize| &rows[row * dimensions..][..numbers];
        let means = |from: usize, length: usize| {
            let part = from * dimensions..(from + length) * dimensions;
            means(dimensions, units, |unit| &window(row_of(unit))[part.clone()])
        };
        let outlines = Outlines {
            dimensions,
            means: means(0, look_ahead + 1),
            segments: segments.iter().map(|(from, length)| means(*from, *length)).collect(),
        };
        let are_alike = |a: u32, b: u32| window(a as usize) == window(b as usize);
        let tree = Tree::new(&outlines, |unit| row_of(unit) as u32, are_alike);
        Ok(Self { dimensions, look_ahead, rows: Paged::new(rows), starts, segments, tree, largest })
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
        row_of(&self.starts, self.look_ahead, unit)
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
}

/// The row of a unit, of streams with these first units that are followed by so many rows more.
fn row_of(starts: &[usize], look_ahead: usize, unit: usize) -> usize {
    unit + look_ahead * (starts.partition_point(|start| *start <= unit) - 1)
}

/// The means of some rows of each unit, one after another.
fn means<'a>(dimensions: usize, units: usize, rows: impl Fn(usize) -> &'a [f32] + Sync) -> Vec<f32> {
    let mut all = vec![0.0f32; units * dimensions];
    all.par_chunks_mut(dimensions).enumerate().for_each(|(unit, mean)| {
        let rows = rows(unit);
        for (d, mean) in mean.iter_mut().enumerate() {
            let sum: f64 = rows.iter().skip(d).step_by(dimensions).map(|value| f64::from(*value)).sum();
            *mean = (sum / (rows.len() / dimensions) as f64) as f32;
        }
    });
    all
}

/// The unit itself, then the others in segments of about equal length.
fn segments(dimensions: usize, look_ahead: usize) -> Vec<(usize, usize)> {
    let most = (OUTLINE / dimensions).saturating_sub(1).max(1);
    let count = look_ahead.div_ceil(SEGMENT).max(look_ahead.min(2)).min(most);
    let edge = |i: usize| 1 + i * look_ahead / count.max(1);
    let rest = (0..count).map(|i| (edge(i), edge(i + 1) - edge(i))).filter(|(_, length)| *length > 0);
    std::iter::once((0, 1)).chain(rest).collect()
}
