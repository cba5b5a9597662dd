//! When samples are: Alembic's three kinds of time sampling.

use std::sync::Arc;

use super::fault::{Allowance, Fault, Outcome};
use crate::scene::animation::KeyTimes;
use crate::scene::bracket::Bracket;

/// The time per cycle by which Alembic marks acyclic sampling.
const ACYCLIC_TIME_PER_CYCLE: f64 = f64::MAX / 32.0;

/// How sample indices relate to seconds.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum TimeSampling {
    /// Equally spaced.
    Uniform { start_s: f64, step_s: f64 },
    /// A pattern of times that repeats, such as the moments of an opening and closing shutter.
    Cyclic { times_s: Arc<[f64]>, period_s: f64 },
    /// Any ascending times.
    Acyclic { times_s: Arc<[f64]> },
}

impl TimeSampling {
    /// From what the archive stores: the time per cycle, and the times of one cycle.
    ///
    /// # Errors
    /// Times that are not finite or do not ascend.
    pub(super) fn new(time_per_cycle: f64, times_s: &[f64], offset: u64) -> Outcome<Self> {
        let fault = |what: &str| Err(Fault::damage(offset, format!("a time sampling {what}")));
        let (Some(&first), Some(&last)) = (times_s.first(), times_s.last()) else {
            return fault("has no times");
        };
        if !times_s.iter().all(|time| time.is_finite()) || times_s.windows(2).any(|pair| pair[0] >= pair[1]) {
            return fault("has times that do not ascend");
        }
        if time_per_cycle == ACYCLIC_TIME_PER_CYCLE {
            return Ok(Self::Acyclic { times_s: times_s.into() });
        }
        // The last index there can be must still have a finite time.
        if time_per_cycle <= 0.0 || !(first + time_per_cycle * f64::from(u32::MAX)).is_finite() {
            return fault(&format!("has {time_per_cycle} seconds per cycle"));
        }
        if last - first > time_per_cycle {
            return fault("has a cycle shorter than the times within it");
        }
        Ok(if times_s.len() == 1 {
            Self::Uniform { start_s: first, step_s: time_per_cycle }
        } else {
            Self::Cyclic { times_s: times_s.into(), period_s: time_per_cycle }
        })
    }

    /// The time of a sample in seconds; beyond the stored times of acyclic sampling, the last.
    pub(super) fn time_s(&self, index: u32) -> f64 {
        match self {
            Self::Uniform { start_s, step_s } => start_s + step_s * f64::from(index),
            Self::Cyclic { times_s, period_s } => {
                let (cycle, within) = (index as usize / times_s.len(), index as usize % times_s.len());
                times_s[within] + period_s * cycle as f64
            }
            Self::Acyclic { times_s } => {
                times_s.get(index as usize).or(times_s.last()).copied().unwrap_or_default()
            }
        }
    }

    /// The most samples there can be times for.
    pub(super) fn most_samples(&self) -> u64 {
        match self {
            Self::Uniform { .. } | Self::Cyclic { .. } => u64::from(u32::MAX),
            Self::Acyclic { times_s } => times_s.len() as u64,
        }
    }

    /// The samples around a time; before the first and after the last, that one.
    pub(super) fn bracket(&self, time_s: f64, samples: u32) -> Bracket {
        Bracket::around(time_s, samples, |index| self.time_s(index))
    }

    /// The times of the first `samples` samples, paid for where they must be listed.
    ///
    /// # Errors
    /// A list that the allowance does not cover.
    pub(super) fn key_times(&self, samples: u32, allowance: &mut Allowance) -> Outcome<KeyTimes> {
        if samples < 2 {
            return Ok(KeyTimes::Static);
        }
        match self {
            Self::Uniform { start_s, step_s } => {
                Ok(KeyTimes::Uniform { start_s: *start_s, step_s: *step_s, count: samples as usize })
            }
            Self::Acyclic { times_s } if times_s.len() == samples as usize => {
                Ok(KeyTimes::Listed(Arc::clone(times_s)))
            }
            Self::Cyclic { .. } | Self::Acyclic { .. } => {
                allowance.charge(8 * u64::from(samples))?;
                let mut times_s: Vec<f64> = (0..samples).map(|index| self.time_s(index)).collect();
                // A cycle that is as long as its period ends where the next begins.
                times_s.dedup();
                Ok(KeyTimes::Listed(times_s.into()))
            }
        }
    }
}

/// The times of two things together.
///
/// # Errors
/// A list that the allowance does not cover.
pub(super) fn union(a: &KeyTimes, b: &KeyTimes, allowance: &mut Allowance) -> Outcome<KeyTimes> {
    match (a, b) {
        (KeyTimes::Static, other) | (other, KeyTimes::Static) => Ok(other.clone()),
        (KeyTimes::Listed(a), KeyTimes::Listed(b)) if a == b => Ok(KeyTimes::Listed(Arc::clone(a))),
        (
            &KeyTimes::Uniform { start_s, step_s, count },
            &KeyTimes::Uniform { start_s: other_start_s, step_s: other_step_s, count: other_count },
        ) if start_s == other_start_s && step_s == other_step_s => {
            Ok(KeyTimes::Uniform { start_s, step_s, count: count.max(other_count) })
        }
        _ => {
            let total = a.len().saturating_add(b.len());
            allowance.charge(8 * total as u64)?;
            let mut times_s = Vec::with_capacity(total);
            times_s.extend((0..a.len()).filter_map(|index| a.get(index)));
            times_s.extend((0..b.len()).filter_map(|index| b.get(index)));
            times_s.sort_by(f64::total_cmp);
            // The same moment reached by two sums differs in its last digits.
            times_s.dedup_by(|later, earlier| *later - *earlier <= 1e-9);
            Ok(KeyTimes::Listed(times_s.into()))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn allowance() -> Allowance {
        Allowance::new(1 << 20, "memory")
    }

    #[test]
    fn a_bracket_agrees_with_a_search_through_all_times() {
        let samplings = [
            TimeSampling::new(0.04, &[0.5], 0),
            TimeSampling::new(1.0, &[0.0, 0.25, 0.3], 0),
            TimeSampling::new(ACYCLIC_TIME_PER_CYCLE, &[-1.0, 0.0, 0.1, 0.7, 2.0, 2.5, 9.0], 0),
        ];
        for sampling in samplings {
            let sampling = sampling.expect("a good sampling");
            for tick in -300..1000 {
                let time_s = f64::from(tick) * 0.0137;
                let bracket = sampling.bracket(time_s, 7);
                let floor = (0..7).rev().find(|&index| sampling.time_s(index) <= time_s).unwrap_or(0);
                let ceiling = if time_s < sampling.time_s(0) { 0 } else { (floor + 1).min(6) };
                let time_of_bracket = sampling.time_s(bracket.floor)
                    + bracket.fraction * (sampling.time_s(bracket.ceiling) - sampling.time_s(bracket.floor));
                let clamped = time_s.clamp(sampling.time_s(0), sampling.time_s(6));
                assert!((time_of_bracket - clamped).abs() < 2e-6, "{sampling:?} at {time_s}");
                assert!(
                    bracket.floor == floor || bracket == Bracket::at(ceiling),
                    "{sampling:?} at {time_s}"
                );
            }
        }
    }

    #[test]
    fn a_time_that_is_off_by_rounding_is_the_samples_own() {
        let sampling = TimeSampling::new(1.0 / 24.0, &[1.0 / 24.0], 0).expect("a good sampling");
        for index in 0..5000 {
            let time_s = sampling.time_s(index);
            for shift in [-1e-12, 0.0, 1e-12] {
                assert_eq!(sampling.bracket(time_s + shift, 5000), Bracket::at(index));
            }
        }
    }

    #[test]
    fn times_that_cannot_be_are_refused() {
        for (cycle, times) in [
            (0.0, &[0.0][..]),
            (-1.0, &[0.0]),
            (f64::NAN, &[0.0]),
            (f64::INFINITY, &[0.0]),
            (1.0, &[]),
            (1.0, &[f64::NAN]),
            (1.0, &[0.0, 0.0]),
            (1.0, &[0.0, -1.0]),
            (1.0, &[0.0, 1.5]),
        ] {
            assert!(TimeSampling::new(cycle, times, 0).is_err(), "{cycle} {times:?}");
        }
    }

    #[test]
    fn a_union_keeps_what_is_alike_and_lists_what_is_not() {
        let film = KeyTimes::Uniform { start_s: 0.0, step_s: 0.25, count: 5 };
        let longer = KeyTimes::Uniform { start_s: 0.0, step_s: 0.25, count: 9 };
        let faster = KeyTimes::Uniform { start_s: 0.0, step_s: 0.125, count: 3 };
        let union = |a, b| union(a, b, &mut allowance()).expect("a short list");
        assert_eq!(union(&KeyTimes::Static, &KeyTimes::Static), KeyTimes::Static);
        assert_eq!(union(&film, &KeyTimes::Static), film);
        assert_eq!(union(&KeyTimes::Static, &film), film);
        assert_eq!(union(&film, &longer), longer);
        assert_eq!(union(&film, &faster), KeyTimes::Listed([0.0, 0.125, 0.25, 0.5, 0.75, 1.0].into()));
    }

    #[test]
    fn a_list_too_long_for_the_file_is_refused() {
        let sampling = TimeSampling::new(1.0, &[0.0, 0.5], 0).expect("a good sampling");
        assert!(sampling.key_times(u32::MAX, &mut allowance()).is_err());
        let long = KeyTimes::Uniform { start_s: 0.0, step_s: 1.0, count: u32::MAX as usize };
        let other = KeyTimes::Uniform { start_s: 0.5, step_s: 1.0, count: u32::MAX as usize };
        assert!(union(&long, &other, &mut allowance()).is_err());
    }
}
