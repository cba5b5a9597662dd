//! Features smoothed as they come.

use super::{kernel, reach, under};
use crate::error::{Error, Result};

/// Smooths features unit by unit, some units behind: what [`smooth`](super::smooth) gives for all of them, to the bit,
/// whatever is still to come.
///
/// So a selection can be live. A unit's features are known when it has sounded; the smoother is [`Smoother::delay`] units
/// behind that, the selection L units behind the smoother, and sound is joined when the choice after it is known:
///
/// ```
/// use froufrou::corpus::units::{FeatureSettings, SelectionSettings};
/// use froufrou::corpus::units::features::Extractor;
/// use froufrou::corpus::units::selection::{Greedy, Index};
/// use froufrou::corpus::units::smoothing::{Smoother, smooth};
/// let extractor = Extractor::new(&FeatureSettings::default(), 48_000)?;
/// let source: Vec<f32> = (0..48_000).map(|i| (0.3 * i as f32).sin() * (1e-4 * i as f32).cos()).collect();
/// let widths = [20.0, 50.0, 10.0];
/// let features = smooth(&extractor.features(&source), &widths);
/// let index = Index::new(&features, &[features.len()], 5)?;
///
/// let mut analysis = extractor.stream();
/// let mut smoother = Smoother::new(3, &widths);
/// let mut greedy = Greedy::new(&index, &SelectionSettings::default())?;
/// let mut chosen = Vec::new();
/// for block in source.chunks(480) {
///     for row in analysis.push(block).rows() {
///         if let Some(row) = smoother.push(row)? {
///             chosen.extend(greedy.push(&row)?);
///         }
///     }
/// }
/// // Of 237 units that are whole, the last 50 and 5 are still waited with.
/// assert_eq!((smoother.delay(), chosen.len()), (50, 182));
/// assert!(chosen.iter().enumerate().all(|(i, choice)| choice.unit == i));
/// # Ok::<(), froufrou::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Smoother {
    /// For each dimension its Gaussian, and what lies under it and ahead of that, oldest first.
    lines: Vec<(Vec<f64>, Vec<f64>)>,
    /// What is no longer needed of each line.
    done: usize,
    delay: usize,
    /// How many units have come, and have been given.
    come: usize,
    given: usize,
}

impl Smoother {
    /// For features of so many dimensions, under Gaussians of these widths, as [`smooth`](super::smooth) takes them.
    pub fn new(dimensions: usize, widths: &[f64]) -> Self {
        let width = |dimension: usize| match widths.is_empty() {
            true => 0.0,
            false => widths[dimension % widths.len()],
        };
        let delay = (0..dimensions).map(|dimension| reach(width(dimension))).max().unwrap_or(0);
        let line = |dimension: usize| (kernel(width(dimension) / 4.0), Vec::new());
        Self { lines: (0..dimensions).map(line).collect(), done: 0, delay, come: 0, given: 0 }
    }

    /// How many units it is behind: as many as the widest Gaussian reaches, its width.
    pub fn delay(&self) -> usize {
        self.delay
    }

    /// The next unit's features; gives the smoothed ones of the unit that lies the delay before it, if there is one.
    ///
    /// # Errors
    /// Features of other dimensions.
    pub fn push(&mut self, row: &[f32]) -> Result<Option<Vec<f64>>> {
        if row.len() != self.lines.len() {
            let (expected, found) = (self.lines.len(), row.len());
            return Err(Error::new(format!("expected {expected} features of a unit, found {found}")));
        }
        for ((kernel, line), value) in self.lines.iter_mut().zip(row) {
            // Before the first unit, features are as it has them.
            let count = if self.come == 0 { kernel.len() / 2 + 1 } else { 1 };
            line.extend(std::iter::repeat_n(f64::from(*value), count));
        }
        self.come += 1;
        Ok((self.come > self.delay).then(|| self.give()))
    }

    /// The smoothed features of the last units, when no more come.
    pub fn finish(mut self) -> Vec<Vec<f64>> {
        if self.come > 0 {
            for (_, line) in &mut self.lines {
                let last = line.last().copied().unwrap_or_default();
                line.extend(std::iter::repeat_n(last, self.delay));
            }
        }
        (self.given..self.come).map(|_| self.give()).collect()
    }

    fn give(&mut self) -> Vec<f64> {
        let at = self.given - self.done;
        let smoothed =
            |(kernel, line): &(Vec<f64>, Vec<f64>)| f64::from(under(kernel, &line[at..at + kernel.len()]));
        let row = self.lines.iter().map(smoothed).collect();
        self.given += 1;
        // Now and then, so that little is moved.
        if at > 2 * self.delay + 64 {
            self.lines.iter_mut().for_each(|(_, line)| drop(line.drain(..=at)));
            self.done = self.given;
        }
        row
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::smooth;
    use super::*;
    use crate::corpus::units::features::Features;
    use crate::random::Random;

    proptest! {
        #[test]
        fn equals_what_has_all_at_once(
            units in 0usize..600,
            dimensions in 1usize..5,
            widths in proptest::collection::vec(0.0f64..60.0, 0..4),
        ) {
            let random = Random::new(units as u64, 0);
            let values = (0..(units * dimensions) as u64).map(|i| random.normal(i) as f32).collect();
            let plain = Features::new(dimensions, values);
            let mut smoother = Smoother::new(dimensions, &widths);
            let delay = smoother.delay();
            let mut rows = Vec::new();
            for (i, row) in plain.rows().enumerate() {
                let given = smoother.push(row).unwrap();
                prop_assert_eq!(given.is_some(), i >= delay);
                rows.extend(given);
            }
            rows.extend(smoother.finish());
            let wanted: Vec<f64> = smooth(&plain, &widths).values().iter().map(|v| f64::from(*v)).collect();
            prop_assert_eq!(rows.concat(), wanted);
        }
    }

    #[test]
    fn it_holds_no_more_than_it_needs() {
        let mut smoother = Smoother::new(2, &[40.0, 8.0]);
        for i in 0..20_000 {
            smoother.push(&[i as f32, 0.0]).unwrap();
            assert!(smoother.lines[0].1.len() < 300 && smoother.lines[1].1.len() < 300);
        }
        assert!(smoother.push(&[1.0]).is_err());
    }
}
