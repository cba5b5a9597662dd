//! Values at times.

use std::sync::Arc;

use crate::scene::animation::KeyTimes;

/// Times closer than this are one: they were reached by two ways of counting.
const SAME_S: f64 = 1e-9;

/// The values of something that may change. There is always at least one.
#[derive(Debug, Clone)]
pub(super) struct Samples<T> {
    /// Ascending; empty for what never changes.
    times_s: Vec<f64>,
    /// One per time, or just one. Equal neighbours are one value.
    values: Vec<Arc<T>>,
}

/// Where a time falls among times.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bracket {
    pub(super) floor: usize,
    pub(super) ceiling: usize,
    pub(super) fraction: f64,
}

impl Bracket {
    /// Before the first and after the last time it is these; a time that is off by rounding is the
    /// sample's own.
    pub(super) fn of(times_s: &[f64], time_s: f64) -> Self {
        let at = |index| Self { floor: index, ceiling: index, fraction: 0.0 };
        let above = times_s.partition_point(|&time| time <= time_s + SAME_S);
        let Some(floor) = above.checked_sub(1) else { return at(0) };
        let (Some(&before), Some(&after)) = (times_s.get(floor), times_s.get(above)) else {
            return at(floor);
        };
        if time_s <= before + SAME_S {
            return at(floor);
        }
        Self { floor, ceiling: above, fraction: (time_s - before) / (after - before) }
    }
}

impl<T: PartialEq> Samples<T> {
    pub(super) fn constant(value: T) -> Self {
        Self { times_s: Vec::new(), values: vec![Arc::new(value)] }
    }

    /// From samples in order of time; nothing where there are none. Values that are all alike never
    /// change.
    pub(super) fn new(samples: Vec<(f64, T)>) -> Option<Self> {
        let (mut times_s, mut values) = (Vec::<f64>::new(), Vec::<Arc<T>>::new());
        for (time_s, value) in samples {
            if times_s.last().is_some_and(|last| time_s - last <= SAME_S) {
                continue;
            }
            times_s.push(time_s);
            let same = values.last().filter(|last| ***last == value).map(Arc::clone);
            values.push(same.unwrap_or_else(|| Arc::new(value)));
        }
        let first = Arc::clone(values.first()?);
        if values.iter().all(|value| Arc::ptr_eq(value, &first)) {
            return Some(Self { times_s: Vec::new(), values: vec![first] });
        }
        Some(Self { times_s, values })
    }
}

impl<T> Samples<T> {
    pub(super) fn times_s(&self) -> &[f64] {
        &self.times_s
    }

    pub(super) fn is_constant(&self) -> bool {
        self.times_s.is_empty()
    }

    pub(super) fn bracket(&self, time_s: f64) -> Bracket {
        Bracket::of(&self.times_s, time_s)
    }

    /// The values around a time, and how far it is from the first to the second.
    pub(super) fn around(&self, time_s: f64) -> (&Arc<T>, &Arc<T>, f64) {
        let Bracket { floor, ceiling, fraction } = self.bracket(time_s);
        (&self.values[floor], &self.values[ceiling], fraction)
    }

    /// The value that holds at a time: the last one before it.
    pub(super) fn held(&self, time_s: f64) -> &Arc<T> {
        self.around(time_s).0
    }

    pub(super) fn first(&self) -> &Arc<T> {
        &self.values[0]
    }
}

/// All of some times in order, each once.
pub(super) fn merged<'a>(lists: impl IntoIterator<Item = &'a [f64]>) -> Vec<f64> {
    let mut lists = lists.into_iter().filter(|list| !list.is_empty());
    let mut times_s = lists.next().map(<[f64]>::to_vec).unwrap_or_default();
    for list in lists {
        if times_s == list {
            continue;
        }
        times_s.extend_from_slice(list);
        times_s.sort_by(f64::total_cmp);
        times_s.dedup_by(|later, earlier| *later - *earlier <= SAME_S);
    }
    times_s
}

/// The times as others see them: as a rate, where they have one.
pub(super) fn key_times(times_s: &[f64]) -> KeyTimes {
    let [start_s, .., last_s] = times_s else { return KeyTimes::Static };
    let count = times_s.len();
    let step_s = (last_s - start_s) / (count - 1) as f64;
    let on_grid = |(index, time_s): (usize, &f64)| (start_s + index as f64 * step_s - time_s).abs() <= SAME_S;
    if times_s.iter().enumerate().all(on_grid) {
        return KeyTimes::Uniform { start_s: *start_s, step_s, count };
    }
    KeyTimes::Listed(times_s.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_is_found_between_samples_and_held_at_the_ends() {
        let samples = Samples::new(vec![(1.0, 10), (2.0, 20), (4.0, 20), (5.0, 0)]).expect("some");
        for (time_s, before, after, fraction) in [
            (-3.0, 10, 10, 0.0),
            (1.0, 10, 10, 0.0),
            (1.25, 10, 20, 0.25),
            (2.0 - 1e-12, 20, 20, 0.0),
            (3.0, 20, 20, 0.5),
            (4.5, 20, 0, 0.5),
            (9.0, 0, 0, 0.0),
        ] {
            let (a, b, found) = samples.around(time_s);
            assert_eq!((**a, **b), (before, after), "{time_s}");
            assert!((found - fraction).abs() < 1e-12, "{time_s}");
        }
        assert!(Samples::new(vec![(1.0, 3), (2.0, 3)]).expect("some").is_constant());
        assert!(Samples::<u8>::new(vec![]).is_none());
    }

    #[test]
    fn times_on_a_grid_are_a_rate() {
        let grid: Vec<f64> = (1..=25).map(|frame| f64::from(frame) / 24.0).collect();
        assert!(
            matches!(key_times(&grid), KeyTimes::Uniform { count: 25, step_s, .. } if (step_s - 1.0 / 24.0).abs() < 1e-12)
        );
        assert!(matches!(key_times(&[0.0, 1.0, 3.0]), KeyTimes::Listed(_)));
        assert_eq!(key_times(&[1.0]), KeyTimes::Static);
        assert_eq!(merged([&[0.0, 2.0][..], &[], &[1.0, 2.0 + 1e-12]]), [0.0, 1.0, 2.0]);
    }
}
