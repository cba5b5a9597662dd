//! Where something that moves is between its keys.

use std::collections::VecDeque;

use crate::hermite;

/// A value of `N` numbers over time, known by its keys as they come; smooth between them.
#[derive(Debug, Clone)]
pub(crate) struct Track<const N: usize> {
    keys: VecDeque<(f64, [f64; N])>,
    /// True once the last key is known to be the last.
    pub closed: bool,
}

impl<const N: usize> Track<N> {
    pub fn new(time_s: f64, value: [f64; N]) -> Self {
        Self { keys: VecDeque::from([(time_s, value)]), closed: false }
    }

    /// A value that never changes.
    pub fn still(value: [f64; N]) -> Self {
        Self { closed: true, ..Self::new(0.0, value) }
    }

    /// Adds a key; one that does not come after the last is left out.
    pub fn push(&mut self, time_s: f64, value: [f64; N]) {
        if time_s > self.last_s() {
            self.keys.push_back((time_s, value));
        }
    }

    /// Time of the first key that is still held.
    pub fn first_s(&self) -> f64 {
        self.keys[0].0
    }

    /// Time of the last key known so far.
    pub fn last_s(&self) -> f64 {
        self.keys[self.keys.len() - 1].0
    }

    /// Value of the last key known so far.
    pub fn last(&self) -> [f64; N] {
        self.keys[self.keys.len() - 1].1
    }

    /// True where the value up to `time_s` no longer depends on keys to come: the cubic needs the
    /// key behind the segment that holds it.
    pub fn is_known(&self, time_s: f64) -> bool {
        self.closed || self.keys.len() >= 2 && self.keys[self.keys.len() - 2].0 > time_s
    }

    /// Forgets keys that values from `time_s` on do not depend on.
    pub fn forget(&mut self, time_s: f64) {
        while self.keys.len() > 3 && self.keys[2].0 <= time_s {
            self.keys.pop_front();
        }
    }

    /// The first key after a time.
    pub fn next_s(&self, time_s: f64) -> Option<f64> {
        let at = self.keys.partition_point(|&(t, _)| t <= time_s);
        self.keys.get(at).map(|&(t, _)| t)
    }

    /// The value and its rate of change at a time; before the first key and after the last it stands
    /// still.
    pub fn at(&self, time_s: f64) -> ([f64; N], [f64; N]) {
        let after = self.keys.partition_point(|&(t, _)| t <= time_s);
        if after == 0 || after == self.keys.len() {
            return (self.keys[after.saturating_sub(1)].1, [0.0; N]);
        }
        let ((t0, from), (t1, to)) = (self.keys[after - 1], self.keys[after]);
        if from == to && self.is_still_about(after) {
            return (from, [0.0; N]);
        }
        let length = t1 - t0;
        let before = (after >= 2).then(|| self.keys[after - 2]);
        let behind = self.keys.get(after + 1).copied();
        let (mut value, mut rate) = ([0.0; N], [0.0; N]);
        for i in 0..N {
            let secant = (to[i] - from[i]) / length;
            let left = before.map(|(t, v)| (t0 - t, (from[i] - v[i]) / (t0 - t)));
            let right = behind.map(|(t, v)| (t - t1, (v[i] - to[i]) / (t - t1)));
            let slopes = match (left, right) {
                (Some((l, sl)), Some((r, sr))) => [
                    hermite::middle_slope(l, length, sl, secant),
                    hermite::middle_slope(length, r, secant, sr),
                ],
                (Some((l, sl)), None) => {
                    [hermite::middle_slope(l, length, sl, secant), hermite::end_slope(length, l, secant, sl)]
                }
                (None, Some((r, sr))) => {
                    [hermite::end_slope(length, r, secant, sr), hermite::middle_slope(length, r, secant, sr)]
                }
                (None, None) => [secant; 2],
            };
            (value[i], rate[i]) = hermite::cubic(time_s - t0, length, [from[i], to[i]], slopes);
        }
        (value, rate)
    }

    /// The value at a time no earlier than the key before the last one, evenly on from these two, and its rate of change;
    /// with one key it stands still.
    pub fn going_on(&self, time_s: f64) -> ([f64; N], [f64; N]) {
        let last = self.keys.len() - 1;
        let (last_s, value) = self.keys[last];
        let Some((before_s, before)) = last.checked_sub(1).map(|before| self.keys[before]) else {
            return (value, [0.0; N]);
        };
        let rate: [f64; N] = std::array::from_fn(|i| (value[i] - before[i]) / (last_s - before_s));
        (std::array::from_fn(|i| value[i] + rate[i] * (time_s - last_s)), rate)
    }

    /// True where the keys about the segment that ends at `after` have its value too, so that the
    /// cubic is constant; said apart so that it is so to the last bit.
    fn is_still_about(&self, after: usize) -> bool {
        let value = self.keys[after].1;
        (after < 2 || self.keys[after - 2].1 == value)
            && self.keys.get(after + 1).is_none_or(|k| k.1 == value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabolic_flight_is_met_exactly() {
        let height = |t: f64| 2.0 + 3.0 * t - 4.905 * t * t;
        let mut track = Track::new(0.0, [height(0.0)]);
        for time in [0.1, 0.15, 0.4, 0.41, 0.9] {
            track.push(time, [height(time)]);
        }
        track.closed = true;
        for step in 0..=90 {
            let time = f64::from(step) * 0.01;
            let (value, rate) = track.at(time);
            assert!((value[0] - height(time)).abs() < 1e-12);
            if time < 0.9 {
                assert!((rate[0] - (3.0 - 9.81 * time)).abs() < 1e-9);
            }
        }
        assert_eq!(track.at(-1.0), ([height(0.0)], [0.0]));
        assert_eq!(track.at(5.0), ([height(0.9)], [0.0]));
    }

    #[test]
    fn without_foresight_it_goes_on_evenly() {
        let mut track = Track::new(1.0, [3.0, -1.0]);
        assert_eq!(track.going_on(5.0), ([3.0, -1.0], [0.0; 2]));
        track.push(1.5, [4.0, -1.0]);
        assert_eq!(track.going_on(1.5), ([4.0, -1.0], [2.0, 0.0]));
        assert_eq!(track.going_on(1.75), ([4.5, -1.0], [2.0, 0.0]));
    }

    #[test]
    fn what_is_known_no_longer_changes() {
        let times: Vec<f64> =
            (0..30).map(|i| f64::from(i) * 0.1 + 0.03 * f64::from(i * i % 7) / 7.0).collect();
        let key = |t: f64| [(5.0 * t).sin(), t];
        let mut whole = Track::new(times[0], key(times[0]));
        times[1..].iter().for_each(|&t| whole.push(t, key(t)));
        whole.closed = true;
        let mut growing = Track::new(times[0], key(times[0]));
        let mut asked = 0.0;
        for &time in &times[1..] {
            growing.push(time, key(time));
            while growing.is_known(asked) {
                assert_eq!(growing.at(asked), whole.at(asked), "at {asked}");
                asked += 0.013;
            }
            growing.forget(asked);
            assert!(growing.keys.len() < 6);
        }
        assert!(asked > 2.5);
    }
}
