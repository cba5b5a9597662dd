//! How something went that comes from below 0 and gets above it.

/// Rates are those on the way to zero, over so many seconds.
const RATE_S: f64 = 1.0 / 15.0;
/// Within so many seconds what flips goes on to be on the other side.
const BEYOND_S: f64 = 0.05;
/// What flips has come from this part of the greatest that it could be.
const SWING: f64 = 0.6;

/// Times in seconds, and what it was.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Course {
    at: Vec<(f64, f64)>,
}

impl Course {
    /// From the frames before and the one that is now.
    pub fn new(before: impl Iterator<Item = (f64, f64)>, now: (f64, f64)) -> Self {
        Self { at: before.chain([now]).collect() }
    }

    /// When it was 0 on its way to the last frame, and at what rate it got there.
    pub fn crossing(&self) -> (f64, f64) {
        let [.., (last_s, last), (now_s, now)] = self.at[..] else { return (0.0, 0.0) };
        let part = if now > last { (-last / (now - last)).clamp(0.0, 1.0) } else { 1.0 };
        let zero_s = last_s + part * (now_s - last_s);
        let zero = last + part * (now - last);
        (zero_s, (zero - self.value(zero_s - RATE_S)) / RATE_S)
    }

    /// The rate at which it came to where it is now.
    pub fn rate(&self) -> f64 {
        self.at.last().map_or(0.0, |&(now_s, now)| (now - self.value(now_s - RATE_S)) / RATE_S)
    }

    /// What it was at a time; before the first frame it was as it is there.
    fn value(&self, time_s: f64) -> f64 {
        let next = self.at.partition_point(|&(at_s, _)| at_s < time_s);
        match (next.checked_sub(1).and_then(|before| self.at.get(before)), self.at.get(next)) {
            (Some(&(from_s, from)), Some(&(to_s, to))) => {
                from + (to - from) * (time_s - from_s) / (to_s - from_s)
            }
            (_, Some(&(_, value))) | (Some(&(_, value)), None) => value,
            (None, None) => 0.0,
        }
    }

    /// Whether it will be beyond something soon, if it goes on as it does.
    pub fn goes_on(&self, beyond: f64) -> bool {
        self.crossing().1 * BEYOND_S >= beyond
    }

    /// Whether it comes from well below 0, where it was for more than a frame.
    pub fn swings(&self, greatest: f64) -> bool {
        let before = self.at.split_last().map_or(&[][..], |(_, before)| before);
        before.iter().filter(|&&(_, value)| value <= -SWING * greatest).count() >= 2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crossing_has_the_time_and_rate_of_a_straight_line() {
        for rate_hz in [24.0, 60.0, 500.0] {
            let at = |frame: i32| (f64::from(frame) / rate_hz, 3.0 * (f64::from(frame) / rate_hz - 0.313));
            let last = (0.313 * rate_hz) as i32;
            let course = Course::new((0..=last).map(at), at(last + 1));
            let (zero_s, rate) = course.crossing();
            assert!((course.rate() - 3.0).abs() < 1e-9);
            assert!((zero_s - 0.313).abs() < 1e-12 && (rate - 3.0).abs() < 1e-9, "{rate_hz} {zero_s} {rate}");
            assert!(course.goes_on(0.149) && !course.goes_on(0.151));
            assert!(course.swings(1.0) && !course.swings(2.0));
        }
    }

    #[test]
    fn what_jumps_has_the_same_rate_at_any_frame_rate() {
        for rate_hz in [30.0, 60.0, 500.0] {
            let before = (0..20).map(|frame| (f64::from(frame) / rate_hz, -1.0));
            let (zero_s, rate) = Course::new(before, (20.0 / rate_hz, 1.0)).crossing();
            assert!((zero_s - 19.5 / rate_hz).abs() < 1e-12 && (rate - 1.0 / RATE_S).abs() < 1e-9);
        }
    }

    #[test]
    fn one_frame_is_not_enough() {
        let course = Course::new([(0.0, -1.0)].into_iter(), (0.1, 1.0));
        assert!(!course.swings(1.0));
        assert!(Course::new([(0.0, -1.0), (0.1, -1.0)].into_iter(), (0.2, 1.0)).swings(1.0));
        assert_eq!(Course::new(std::iter::empty(), (0.0, 1.0)).crossing(), (0.0, 0.0));
    }
}
