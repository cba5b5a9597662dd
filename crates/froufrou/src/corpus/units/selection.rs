//! Which unit of the recordings stands for each unit of the target.
//!
//! With f_j the features of unit j of the recordings, W f_i the warped ones of unit i of the target, and L units looked
//! ahead, algorithm 1 of the paper has
//!
//! ```text
//! D1(i, j) = ‖f_j − W f_i‖
//! D2(i, j) = Σ_{k=0..L} D1(i + k, j + k)
//! D3(i, j) = D2(i, j) where D1(i, j) ≤ d_max, else ∞
//! ```
//!
//! and takes for each unit in turn the j of the smallest D3 among those that are not barred; where that is infinite, the
//! smallest D1. A unit that was taken is barred for the next L_c units of the target. Where the paper leaves a choice:
//!
//! - of units that are equally near, the one that comes first is taken;
//! - beyond the end of its stream, a unit's last features stand for those that are missing, so that ends are neither
//!   better nor worse than what comes before;
//! - beyond the end of the target, nothing is compared: D2 has fewer terms for the last L units;
//! - where all units that are near enough are barred, a unit is taken by D1 as well.
//!
//! Distances are sums in double precision, in order of k and of dimensions.
//!
//! [`Greedy`] is fed with the target's units one by one and is L units behind. It asks an [`Index`] for each, a tree in
//! which most units are never looked at; what it gives is exact.

mod index;
mod packed;
mod paged;
mod search;
mod tree;

use std::collections::VecDeque;

use super::settings::SelectionSettings;
use crate::error::{Error, Result};

pub use index::Index;
use index::{LARGEST, is_usable};
pub(super) use search::distance;
pub use search::{Found, Search};

/// A unit of the recordings that stands for one of the target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chosen {
    /// Its number, over all streams.
    pub unit: usize,
    /// D3 where it is within d_max, else D1.
    pub distance: f64,
    /// Whether its D1 is at most d_max.
    pub is_within: bool,
}

/// The greedy selection, unit by unit.
pub struct Greedy<'a> {
    index: &'a Index,
    search: Search<'a>,
    settings: SelectionSettings,
    /// Features of the units that are waited with, row by row.
    ahead: VecDeque<f64>,
    barred: VecDeque<usize>,
}

impl<'a> Greedy<'a> {
    /// # Errors
    /// Settings that make no sense or are not those that the index was made for, or recordings of fewer units than a
    /// unit is barred for.
    pub fn new(index: &'a Index, settings: &SelectionSettings) -> Result<Self> {
        check(index, settings)?;
        Ok(Self {
            index,
            search: index.search(),
            settings: settings.clone(),
            ahead: VecDeque::new(),
            barred: VecDeque::new(),
        })
    }

    /// The next unit of the target, warped; gives the choice for the one that lies L before it.
    ///
    /// # Errors
    /// Features that have other dimensions than those of the recordings, are not finite or beyond 10¹⁵.
    pub fn push(&mut self, warped: &[f64]) -> Result<Option<Chosen>> {
        if warped.len() != self.index.dimensions() || !warped.iter().all(|value| is_usable(*value)) {
            return Err(Error::new(format!(
                "expected {} features of a unit within ±{LARGEST:e}, found {warped:?}",
                self.index.dimensions()
            )));
        }
        self.ahead.extend(warped);
        let window = (self.settings.look_ahead + 1) * warped.len();
        Ok((self.ahead.len() >= window).then(|| self.choose()))
    }

    /// The choices for the last units of the target.
    pub fn finish(mut self) -> Vec<Chosen> {
        std::iter::from_fn(|| (!self.ahead.is_empty()).then(|| self.choose())).collect()
    }

    fn choose(&mut self) -> Chosen {
        let barred = self.barred.make_contiguous();
        let window = self.ahead.make_contiguous();
        // Most units follow the one before: then little else is worth a look.
        let hint = barred.last().map(|unit| unit + 1);
        let dimensions = self.index.dimensions();
        let within = self.search.nearest(window, self.settings.d_max, 1, barred, hint).first().copied();
        let chosen = match within {
            Some(found) => Chosen { unit: found.unit, distance: found.distance, is_within: true },
            None => {
                let first = &window[..dimensions];
                let nearest = self.search.nearest(first, f64::INFINITY, 1, barred, hint).first().copied();
                // There are more units than are ever barred.
                let found = nearest.unwrap_or(Found { unit: 0, distance: f64::INFINITY });
                Chosen { unit: found.unit, distance: found.distance, is_within: false }
            }
        };
        self.ahead.drain(..dimensions);
        self.barred.push_back(chosen.unit);
        if self.barred.len() > self.settings.cool_off {
            self.barred.pop_front();
        }
        chosen
    }
}

/// The greedy selection for all units of a target, row by row.
///
/// # Errors
/// Those of [`Greedy::new`] and [`Greedy::push`].
pub fn greedy(index: &Index, warped: &[f64], settings: &SelectionSettings) -> Result<Vec<Chosen>> {
    let mut greedy = Greedy::new(index, settings)?;
    let mut chosen = Vec::with_capacity(warped.len() / index.dimensions());
    for row in warped.chunks(index.dimensions()) {
        chosen.extend(greedy.push(row)?);
    }
    chosen.extend(greedy.finish());
    Ok(chosen)
}

/// What every selection asks for.
pub(super) fn check(index: &Index, settings: &SelectionSettings) -> Result<()> {
    settings.check()?;
    if settings.look_ahead != index.look_ahead() {
        return Err(Error::new(format!(
            "the index looks {} units ahead, the selection {}",
            index.look_ahead(),
            settings.look_ahead
        )));
    }
    if index.units() <= settings.cool_off {
        return Err(Error::new(format!(
            "the recordings have {} units, and each is barred for {} when it has been chosen",
            index.units(),
            settings.cool_off
        ))
        .help("add recordings, or give [units.selection] a smaller cool_off"));
    }
    Ok(())
}

#[cfg(test)]
pub(super) mod tests;
