//! The best selection for a whole target.
//!
//! With the distances of [`selection`], a sequence J costs
//!
//! ```text
//! the number of i with D1(i, J(i)) > d_max,
//! then, among those that are alike in that,
//! Σ_i T(i, J(i)) + c · #{ i > 0 : J(i) does not follow J(i − 1) in its stream },
//! ```
//!
//! where T is D2 for a unit within d_max and D1 for one that is not, and c the jump cost; and no unit may come again
//! within L_c. Because of that condition the best sequence can in general be found only by trying all: what may be chosen
//! depends on all of the last L_c choices. So this is what is done:
//!
//! 1. Each unit of the target has candidates: the K with the least T, what the greedy selection took, and what follows the
//!    candidates of the unit before, as far as that is among their 2 K best.
//! 2. Dynamic programming from unit to unit keeps, for each candidate, the cheapest few ways to it. Each way knows its last
//!    L_c choices, and goes on to what they do not bar.
//! 3. The greedy selection's own way is kept whatever it costs, and wins where nothing is cheaper.
//!
//! So the result never costs more than the greedy selection. It is the optimum over the candidates unless ways were left
//! out, and over all units where all units are candidates; [`Optimum`] says which it is.

use rayon::prelude::*;

use super::selection::{self, Chosen, Index, greedy};
use super::settings::SelectionSettings;
use crate::error::Result;

/// How many ways to each candidate are kept.
const WAYS: usize = 8;

/// What a selection costs. Less is better, and units beyond d_max count first.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default)]
pub struct Cost {
    /// Units beyond d_max.
    pub beyond: usize,
    /// Distances, and what jumps cost.
    pub sum: f64,
}

/// The best selection that was found, and how good it is known to be.
#[derive(Debug, Clone, PartialEq)]
pub struct Optimum {
    /// A unit for each of the target.
    pub chosen: Vec<Chosen>,
    /// What it costs.
    pub cost: Cost,
    /// What the greedy selection costs.
    pub greedy_cost: Cost,
    /// True where no cheaper way along the candidates was left out.
    pub is_best_of_candidates: bool,
    /// True where besides all units were candidates: then nothing is cheaper.
    pub is_best: bool,
}

/// What a selection costs.
pub fn cost(index: &Index, chosen: &[Chosen], settings: &SelectionSettings) -> Cost {
    let mut cost = Cost::default();
    for (i, one) in chosen.iter().enumerate() {
        let jumps = i > 0 && !index.follows(chosen[i - 1].unit, one.unit);
        cost = cost.plus(one, jumps, settings);
    }
    cost
}

impl Cost {
    fn plus(self, chosen: &Chosen, jumps: bool, settings: &SelectionSettings) -> Self {
        let jump = if jumps { settings.jump_cost } else { 0.0 };
        let beyond = self.beyond + usize::from(!chosen.is_within);
        Self { beyond, sum: self.sum + chosen.distance + jump }
    }

    fn compare(&self, other: &Self) -> std::cmp::Ordering {
        self.beyond.cmp(&other.beyond).then(self.sum.total_cmp(&other.sum))
    }
}

/// The cheapest selection for a target, its warped features row by row.
///
/// # Errors
/// Those of the greedy selection.
pub fn optimal(index: &Index, warped: &[f64], settings: &SelectionSettings) -> Result<Optimum> {
    optimal_with(index, warped, settings, WAYS)
}

/// The same, with so many ways kept to each candidate.
///
/// # Errors
/// Those of [`optimal`].
pub fn optimal_with(
    index: &Index,
    warped: &[f64],
    settings: &SelectionSettings,
    ways: usize,
) -> Result<Optimum> {
    let greedy = greedy(index, warped, settings)?;
    let greedy_cost = cost(index, &greedy, settings);
    let candidates = candidates(index, warped, settings, &greedy);
    let mut program = Program { index, settings, ways: ways.max(1), steps: Vec::new(), is_whole: true };
    for row in &candidates {
        program.step(row);
    }
    let is_best_of_candidates = program.is_whole;
    let is_best = is_best_of_candidates && candidates.iter().all(|row| row.len() == index.units());
    let (chosen, cost) = match program.best().map(|best| (cost(index, &best, settings), best)) {
        Some((found, best)) if found.compare(&greedy_cost).is_lt() => (best, found),
        _ => (greedy, greedy_cost),
    };
    Ok(Optimum { chosen, cost, greedy_cost, is_best_of_candidates, is_best })
}

/// T of a unit of the recordings for a unit of the target, whose window is given.
fn weigh(index: &Index, window: &[f64], unit: usize, d_max: f64) -> Chosen {
    let d = index.dimensions();
    let mut terms = index.window(unit).chunks_exact(d).zip(window.chunks_exact(d));
    let distance = |(row, wanted): (&[f32], &[f64])| selection::distance(row, wanted);
    let first = terms.next().map_or(0.0, distance);
    match first <= d_max {
        true => {
            Chosen { unit, distance: terms.fold(first, |sum, pair| sum + distance(pair)), is_within: true }
        }
        false => Chosen { unit, distance: first, is_within: false },
    }
}

/// The candidates of each unit of the target, in order of their units.
fn candidates(
    index: &Index,
    warped: &[f64],
    settings: &SelectionSettings,
    greedy: &[Chosen],
) -> Vec<Vec<Chosen>> {
    let d = index.dimensions();
    let count = settings.candidates.min(index.units());
    let window = |i: usize| &warped[i * d..((i + settings.look_ahead + 1) * d).min(warped.len())];
    let nearest: Vec<Vec<Chosen>> = (0..greedy.len())
        .into_par_iter()
        .map_init(
            || index.search(),
            |search, i| {
                let (window, hint) = (window(i), Some(greedy[i].unit));
                let within =
                    |f: &selection::Found| Chosen { unit: f.unit, distance: f.distance, is_within: true };
                let found = search.nearest(window, settings.d_max, count, &[], hint);
                let mut row: Vec<Chosen> = found.iter().map(within).collect();
                if row.len() < count {
                    // All that are within are there already, and have the smallest D1.
                    let all = search.nearest(&window[..d], f64::INFINITY, count, &[], hint);
                    let beyond = all.iter().map(|f| weigh(index, window, f.unit, settings.d_max));
                    row.extend(beyond.filter(|chosen| !chosen.is_within));
                }
                row
            },
        )
        .collect();
    let mut rows: Vec<Vec<Chosen>> = Vec::with_capacity(nearest.len());
    for (i, mut row) in nearest.into_iter().enumerate() {
        row.push(greedy[i]);
        if let Some(before) = rows.last() {
            let next = |chosen: &Chosen| {
                let unit = chosen.unit + 1;
                let is_next = unit < index.units() && index.follows(chosen.unit, unit);
                is_next.then(|| weigh(index, window(i), unit, settings.d_max))
            };
            row.extend(before.iter().filter_map(next));
        }
        row.sort_by_key(|chosen| chosen.unit);
        row.dedup_by_key(|chosen| chosen.unit);
        if row.len() > 2 * count + 1 {
            row.sort_by(|a, b| {
                b.is_within
                    .cmp(&a.is_within)
                    .then(a.distance.total_cmp(&b.distance))
                    .then(a.unit.cmp(&b.unit))
            });
            row.truncate(2 * count);
            if !row.iter().any(|chosen| chosen.unit == greedy[i].unit) {
                row.push(greedy[i]);
            }
            row.sort_by_key(|chosen| chosen.unit);
        }
        rows.push(row);
    }
    rows
}

/// A way to a candidate.
#[derive(Debug, Clone, Copy)]
struct Way {
    chosen: Chosen,
    cost: Cost,
    /// The way to the unit before.
    before: u32,
}

struct Program<'a> {
    index: &'a Index,
    settings: &'a SelectionSettings,
    ways: usize,
    /// The ways to each unit of the target, the cheapest first.
    steps: Vec<Vec<Way>>,
    /// False when a way was left out.
    is_whole: bool,
}

impl Program<'_> {
    fn step(&mut self, candidates: &[Chosen]) {
        let mut ways = Vec::new();
        let number = self.steps.len();
        let Some(last) = self.steps.last() else {
            ways.extend(candidates.iter().map(|&chosen| Way {
                chosen,
                cost: Cost::default().plus(&chosen, false, self.settings),
                before: 0,
            }));
            return self.keep(ways);
        };
        for &chosen in candidates {
            // Ways are in order of their costs, so that the first that may go on are the cheapest, but for those that the
            // unit follows: they save a jump.
            let mut jumping: Vec<usize> = Vec::new();
            for (at, way) in last.iter().enumerate() {
                let follows = self.index.follows(way.chosen.unit, chosen.unit);
                if !follows && jumping.len() >= self.ways {
                    // Nothing is lost by one that may not go on, or that costs more and bars the same.
                    let alike = |kept: &usize| self.bar_alike(number, *kept as u32, at as u32);
                    self.is_whole =
                        self.is_whole && (self.bars(number, at, chosen.unit) || jumping.iter().any(alike));
                    continue;
                }
                if self.bars(number, at, chosen.unit) {
                    continue;
                }
                if !follows {
                    jumping.push(at);
                }
                let cost = way.cost.plus(&chosen, !follows, self.settings);
                ways.push(Way { chosen, cost, before: at as u32 });
            }
        }
        self.keep(ways);
    }

    /// Keeps the cheapest ways to each candidate.
    fn keep(&mut self, mut ways: Vec<Way>) {
        ways.sort_by(|a, b| {
            a.cost.compare(&b.cost).then(a.chosen.unit.cmp(&b.chosen.unit)).then(a.before.cmp(&b.before))
        });
        let number = self.steps.len();
        let mut counts: std::collections::HashMap<usize, Vec<u32>> = std::collections::HashMap::new();
        let mut kept: Vec<Way> = Vec::new();
        for way in ways {
            let others = counts.entry(way.chosen.unit).or_default();
            // One that bars the same and costs more is never better.
            if others.iter().any(|&other| self.bar_alike(number, kept[other as usize].before, way.before)) {
                continue;
            }
            if others.len() >= self.ways {
                self.is_whole = false;
                continue;
            }
            others.push(kept.len() as u32);
            kept.push(way);
        }
        self.steps.push(kept);
    }

    /// True where a way to the unit before `number` has chosen a unit too lately.
    fn bars(&self, number: usize, way: usize, unit: usize) -> bool {
        self.last(number, way as u32).any(|chosen| chosen == unit)
    }

    /// The last choices along a way to the unit before `number`, as many as are barred, the latest first.
    fn last(&self, number: usize, way: u32) -> impl Iterator<Item = usize> + '_ {
        let mut at = way;
        (0..number).rev().take(self.settings.cool_off).map(move |step| {
            let way = &self.steps[step][at as usize];
            at = way.before;
            way.chosen.unit
        })
    }

    /// True where two ways to the unit before `number` bar the same for as long, once one more was chosen.
    fn bar_alike(&self, number: usize, a: u32, b: u32) -> bool {
        let most = self.settings.cool_off.saturating_sub(1);
        self.last(number, a).take(most).eq(self.last(number, b).take(most))
    }

    /// The cheapest way.
    fn best(&self) -> Option<Vec<Chosen>> {
        let mut at = 0usize;
        let mut chosen = Vec::with_capacity(self.steps.len());
        for step in self.steps.iter().rev() {
            let way = step.get(at)?;
            chosen.push(way.chosen);
            at = way.before as usize;
        }
        chosen.reverse();
        Some(chosen)
    }
}

#[cfg(test)]
mod tests;
