//! The two samples that a time lies between, and how far it is on the way.

/// This near to a sample, as a share of the distance between two, a time is that sample's: times
/// come back from sums and text slightly off, and must not fall to the sample before.
const NEARLY: f64 = 1e-6;

/// The samples around a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bracket {
    /// The sample at or before the time.
    pub(crate) floor: u32,
    /// The sample after it, or the same one where there is none.
    pub(crate) ceiling: u32,
    /// Where the time lies between them, from 0 to below 1.
    pub(crate) fraction: f64,
}

impl Bracket {
    /// Exactly at a sample.
    pub(crate) fn at(index: u32) -> Self {
        Self { floor: index, ceiling: index, fraction: 0.0 }
    }

    /// The samples around a time; before the first and after the last, that one. There are `samples`
    /// of them, and `time_of` gives their ascending times.
    pub(crate) fn around(time_s: f64, samples: u32, time_of: impl Fn(u32) -> f64) -> Self {
        let last = samples.saturating_sub(1);
        if time_s <= time_of(0) {
            return Bracket::at(0);
        }
        if time_s >= time_of(last) {
            return Bracket::at(last);
        }
        // Invariant: time_of(floor) <= time < time_of(ceiling).
        let (mut floor, mut ceiling) = (0, last);
        while ceiling - floor > 1 {
            let middle = floor + (ceiling - floor) / 2;
            if time_of(middle) <= time_s { floor = middle } else { ceiling = middle }
        }
        let (before_s, after_s) = (time_of(floor), time_of(ceiling));
        let fraction = (time_s - before_s) / (after_s - before_s);
        if fraction < NEARLY {
            Bracket::at(floor)
        } else if fraction > 1.0 - NEARLY {
            Bracket::at(ceiling)
        } else {
            Bracket { floor, ceiling, fraction }
        }
    }
}
