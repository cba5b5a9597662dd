//! The way of a thread's sound into one channel: from arrival time back to emission time.
//!
//! A score gives the delay of a path at emission times. An image-space renderer (Takala & Hahn 1992,
//! §6.2) needs the inverse: for each output sample, when the sound that arrives there left its
//! source. So the keys are mapped through t' = t + delay(t), and the delay is interpolated over t'.
//!
//! The delay is interpolated by cubic Hermite segments whose slopes come from the parabola through
//! three neighbouring keys, so that its rate of change, which is the pitch, is continuous. Where
//! keys would make time stand still or run backwards between them, the slopes are limited (Fritsch
//! & Carlson 1980). The gain is linear between keys, to which the ear is indifferent.
//!
//! Where keys come as things happen nobody can wait for the one behind: slopes are then those of the parabola through a
//! key and the two before it ([`Foresight::None`]), and a segment is known with the key that ends it.

use crate::hermite;

/// Seconds over which a path fades out where it is cut off, and in where it begins within a sound.
pub const FADE_S: f64 = 0.010;

/// Emission seconds an arrival second may hold, and its inverse: beyond, two keys are not joined by
/// any motion that a sound could follow, and the source is taken to have jumped between them.
const RATE_LIMIT: f64 = 8.0;

/// Two keys this near to each other, in seconds, are one.
const SAME_S: f64 = 1e-9;

/// One key of a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathKey {
    /// When the sound leaves, in seconds.
    pub emission_s: f64,
    /// How long it is under way.
    pub delay_s: f64,
    /// Pressure gain.
    pub gain: f64,
    /// The number of the filter that it passes, or [`UNFILTERED`].
    pub filter: u32,
    /// The number of the gains with which it goes to the lanes of a bus, or [`UNSPREAD`].
    pub spread: u32,
}

/// Stands for no filter.
pub const UNFILTERED: u32 = u32::MAX;

/// Stands for no spread: what goes to a channel, or to all lanes of a bus alike.
pub const UNSPREAD: u32 = u32::MAX;

impl PathKey {
    /// When the sound arrives, in seconds.
    pub fn arrival_s(&self) -> f64 {
        self.emission_s + self.delay_s
    }
}

/// Where a stretch of a path fades, in emission time; infinite where it does not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fades {
    /// The fade in begins here and takes [`FADE_S`].
    pub in_s: f64,
    /// The fade out begins here and takes [`FADE_S`].
    pub out_s: f64,
}

impl Fades {
    /// No fade at all.
    pub const NONE: Fades = Fades { in_s: f64::NEG_INFINITY, out_s: f64::INFINITY };

    /// The fades that are heard of what leaves from one time to another.
    fn within(self, from_s: f64, to_s: f64) -> Self {
        Self {
            in_s: if from_s < self.in_s + FADE_S { self.in_s } else { Self::NONE.in_s },
            out_s: if to_s > self.out_s { self.out_s } else { Self::NONE.out_s },
        }
    }

    /// Whether nothing fades between two emission times.
    pub fn are_over(&self, from_s: f64, to_s: f64) -> bool {
        from_s >= self.in_s + FADE_S && to_s <= self.out_s
    }

    /// The gain at an emission time. A fade out and a fade in at one time sum to 1.
    pub fn gain(&self, emission_s: f64) -> f64 {
        let rise = |begin_s: f64| {
            let x = ((emission_s - begin_s) / FADE_S).clamp(0.0, 1.0);
            0.5 - 0.5 * (std::f64::consts::PI * x).cos()
        };
        let faded_in = if emission_s < self.in_s + FADE_S { rise(self.in_s) } else { 1.0 };
        let faded_out = if emission_s > self.out_s { 1.0 - rise(self.out_s) } else { 1.0 };
        faded_in * faded_out
    }
}

/// A path between two keys.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// First arrival time, inclusive.
    pub begin_s: f64,
    /// Last arrival time, exclusive.
    pub end_s: f64,
    /// Delay at the beginning and at the end.
    pub delay_s: [f64; 2],
    /// Rate of change of the delay over arrival time at the beginning and at the end.
    pub slope: [f64; 2],
    /// Gain at the beginning and at the end.
    pub gain: [f64; 2],
    /// Numbers of the filters at the beginning and at the end.
    pub filter: [u32; 2],
    /// Numbers of the spreads at the beginning and at the end.
    pub spread: [u32; 2],
    /// Where it fades.
    pub fades: Fades,
}

/// A path at one arrival time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// How long the sound that arrives has been under way.
    pub delay_s: f64,
    /// Seconds of the source heard in a second: the Doppler factor.
    pub rate: f64,
    /// Pressure gain, fades left out.
    pub gain: f64,
}

impl Segment {
    /// True where the delay stands still, so that the sound arrives as it left.
    pub fn is_still(&self) -> bool {
        self.slope == [0.0; 2] && self.delay_s[0] == self.delay_s[1]
    }

    /// True where another segment is the same but that it comes right behind: both stand still, in gain too.
    pub fn goes_on_in(&self, next: &Segment) -> bool {
        let is_plain = |segment: &Segment| {
            segment.is_still()
                && segment.gain[0] == segment.gain[1]
                && segment.filter == [UNFILTERED; 2]
                && segment.spread[0] == segment.spread[1]
                && segment.fades == Fades::NONE
        };
        let is_same = self.delay_s == next.delay_s && self.gain == next.gain && self.spread == next.spread;
        self.end_s == next.begin_s && is_same && is_plain(self) && is_plain(next)
    }

    /// When what arrives at a time left its source; the time may lie a little outside the segment.
    pub fn emission_s(&self, arrival_s: f64) -> f64 {
        arrival_s - self.at(arrival_s).delay_s
    }

    /// The greatest rate within it, emission seconds an arrival second.
    pub fn fastest(&self) -> f64 {
        let Course { slope: [s0, s1, s2], .. } = self.course();
        let rate = |u: f64| 1.0 - (s0 + u * (s1 + u * s2));
        // The rate is a parabola, which may turn in between.
        let turn = if s2 == 0.0 { 0.0 } else { (-s1 / (2.0 * s2)).clamp(0.0, 1.0) };
        [0.0, 1.0, turn].map(rate).into_iter().fold(0.0, f64::max)
    }

    /// The path at an arrival time within the segment.
    #[inline(always)]
    pub fn at(&self, arrival_s: f64) -> Moment {
        let length = self.end_s - self.begin_s;
        let x = arrival_s - self.begin_s;
        let (delay_s, slope) = hermite::cubic(x, length, self.delay_s, self.slope);
        let gain = self.gain[0] + x / length * (self.gain[1] - self.gain[0]);
        Moment { delay_s, rate: 1.0 - slope, gain }
    }
}

/// A segment made ready to be asked often: the same but for rounding, without divisions.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Course {
    begin_s: f64,
    /// One over its length.
    per_s: f64,
    delay_s: [f64; 4],
    slope: [f64; 3],
    gain: [f64; 2],
}

impl Segment {
    pub(crate) fn course(&self) -> Course {
        let length_s = self.end_s - self.begin_s;
        let per_s = 1.0 / length_s;
        let rise = self.delay_s[1] - self.delay_s[0];
        let [m0, m1] = self.slope.map(|slope| slope * length_s);
        let (c2, c3) = (3.0 * rise - 2.0 * m0 - m1, m0 + m1 - 2.0 * rise);
        Course {
            begin_s: self.begin_s,
            per_s,
            delay_s: [self.delay_s[0], m0, c2, c3],
            slope: [m0 * per_s, 2.0 * c2 * per_s, 3.0 * c3 * per_s],
            gain: [self.gain[0], self.gain[1] - self.gain[0]],
        }
    }
}

impl Course {
    /// How much of it lies behind an arrival time, from 0 to 1.
    #[inline(always)]
    pub fn along(&self, arrival_s: f64) -> f64 {
        ((arrival_s - self.begin_s) * self.per_s).clamp(0.0, 1.0)
    }

    /// As [`Segment::at`] has the delay.
    #[inline(always)]
    pub fn delay_s(&self, arrival_s: f64) -> f64 {
        let (u, [d0, d1, d2, d3]) = ((arrival_s - self.begin_s) * self.per_s, self.delay_s);
        d0 + u * (d1 + u * (d2 + u * d3))
    }

    /// As [`Segment::at`] has the rate.
    #[inline(always)]
    pub fn rate(&self, arrival_s: f64) -> f64 {
        let (u, [s0, s1, s2]) = ((arrival_s - self.begin_s) * self.per_s, self.slope);
        1.0 - (s0 + u * (s1 + u * s2))
    }

    /// As [`Segment::at`] has the gain.
    #[inline(always)]
    pub fn gain(&self, arrival_s: f64) -> f64 {
        self.gain[0] + (arrival_s - self.begin_s) * self.per_s * self.gain[1]
    }
}

/// What a path knows of what follows a key.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Foresight {
    /// The slope at a key is that of the parabola through it and its neighbours: a segment is known once the key behind its
    /// end is.
    #[default]
    NextKey,
    /// The slope at a key is that of the parabola that ends with it: a segment is known with its end.
    None,
}

/// Makes segments from keys as they come. When a segment is known is its [`Foresight`].
#[derive(Debug, Clone)]
pub struct PathBuilder {
    foresight: Foresight,
    /// The keys since the path began or jumped, the last three at most.
    keys: [PathKey; 3],
    count: usize,
    /// Slope at the second-last key.
    slope: f64,
    fades: Fades,
    /// Seconds by which the first segment reaches back before the first key.
    lead_s: f64,
}

impl PathBuilder {
    /// A path that begins at a key. `lead_s` is how far before it the sound already has something to
    /// say (the resampling kernel looks ahead of a sharp onset).
    pub fn new(key: PathKey, fades_in: bool, lead_s: f64) -> Self {
        let in_s = if fades_in { key.emission_s } else { f64::NEG_INFINITY };
        Self {
            foresight: Foresight::NextKey,
            keys: [key; 3],
            count: 1,
            slope: 0.0,
            fades: Fades { in_s, out_s: f64::INFINITY },
            lead_s: if fades_in { 0.0 } else { lead_s },
        }
    }

    /// The same with another foresight.
    #[must_use]
    pub fn with(self, foresight: Foresight) -> Self {
        Self { foresight, ..self }
    }

    /// The keys that segments to come depend on.
    pub fn keys(&self) -> &[PathKey] {
        &self.keys[..self.count.min(3)]
    }

    /// The last key.
    pub fn last(&self) -> PathKey {
        self.keys[(self.count - 1).min(2)]
    }

    /// The arrival time up to which the path is known, whatever keys may follow.
    pub fn known_s(&self) -> f64 {
        match (self.foresight, self.count) {
            (_, 1) | (Foresight::NextKey, 2) => self.keys[0].arrival_s() - self.lead_s,
            (Foresight::NextKey, _) => self.keys[1].arrival_s(),
            (Foresight::None, _) => self.last().arrival_s(),
        }
    }

    /// The emission time from which on segments are still to come.
    pub fn coming_s(&self) -> f64 {
        match (self.foresight, self.count) {
            // The slope of the lead may be up to the limit.
            (_, 1) | (Foresight::NextKey, _) => self.keys[0].emission_s - RATE_LIMIT * self.lead_s,
            (Foresight::None, _) => self.last().emission_s,
        }
    }

    /// The path goes on through a key. Segments that have become known are given to `emit`.
    pub fn key(&mut self, key: PathKey, emit: &mut impl FnMut(Segment)) {
        let last = self.last();
        let (emission, arrival) = (key.emission_s - last.emission_s, key.arrival_s() - last.arrival_s());
        if emission <= SAME_S && arrival.abs() <= SAME_S {
            return;
        }
        // Written so that a rate that is not a number is also out of limits.
        if arrival > 0.0 && emission > 0.0 && (1.0 / RATE_LIMIT..=RATE_LIMIT).contains(&(emission / arrival))
        {
            self.push(key, emit);
        } else {
            self.jump(key, emit);
        }
    }

    /// The path is suddenly at a key: what led here, held since the last key, fades out while what
    /// follows fades in.
    pub fn jump(&mut self, key: PathKey, emit: &mut impl FnMut(Segment)) {
        self.end(PathKey { emission_s: key.emission_s, ..self.last() }, emit);
        *self = Self::new(key, true, 0.0).with(self.foresight);
    }

    /// The path ends at a key: it goes on as it does there for as long as the sound fades out.
    pub fn end(&mut self, key: PathKey, emit: &mut impl FnMut(Segment)) {
        if key.emission_s > self.last().emission_s {
            self.key(key, emit);
        }
        let slope = match (self.count, self.keys) {
            (1, _) => {
                self.lead(emit);
                0.0
            }
            // What led here is known already.
            _ if self.foresight == Foresight::None => self.slope,
            (2, [a, b, _]) => {
                self.slope = secant(a, b);
                self.lead(emit);
                emit(self.segment(a, b, [self.slope; 2]));
                self.slope
            }
            (_, [a, b, c]) => {
                let slope = end_slope(c, b, a);
                emit(self.segment(b, c, [self.slope, slope]));
                slope
            }
        };
        let last = self.last();
        let length_s = FADE_S / (1.0 - slope).max(1.0 / RATE_LIMIT);
        emit(Segment {
            begin_s: last.arrival_s(),
            end_s: last.arrival_s() + length_s,
            delay_s: [last.delay_s, last.delay_s + slope * length_s],
            slope: [slope; 2],
            gain: [last.gain; 2],
            filter: [last.filter; 2],
            spread: [last.spread; 2],
            fades: Fades { out_s: last.emission_s, ..self.fades },
        });
    }

    fn push(&mut self, key: PathKey, emit: &mut impl FnMut(Segment)) {
        if self.count >= 3 {
            self.keys.rotate_left(1);
        }
        self.keys[self.count.min(2)] = key;
        self.count += 1;
        match (self.foresight, self.count) {
            (Foresight::None, _) => self.know(emit),
            (Foresight::NextKey, 1 | 2) => {}
            (Foresight::NextKey, _) => {
                let [a, b, c] = self.keys;
                if self.count == 3 {
                    self.slope = end_slope(a, b, c);
                    self.lead(emit);
                }
                let slope = middle_slope(a, b, c);
                emit(self.segment(a, b, [self.slope, slope]));
                self.slope = slope;
            }
        }
    }

    /// Gives the segment that the last key ends, by that key and those before it alone.
    fn know(&mut self, emit: &mut impl FnMut(Segment)) {
        let (a, b, slope) = match (self.count, self.keys) {
            (1, _) => return,
            (2, [a, b, _]) => {
                self.slope = secant(a, b);
                self.lead(emit);
                (a, b, self.slope)
            }
            (_, [a, b, c]) => (b, c, end_slope(c, b, a)),
        };
        // The slope at its beginning was found before anybody knew how steep it would be.
        emit(self.segment(a, b, [limit(self.slope, secant(a, b)), slope]));
        self.slope = slope;
    }

    /// What comes before the first key: the path went on as it does there.
    fn lead(&self, emit: &mut impl FnMut(Segment)) {
        if self.lead_s > 0.0 {
            let first = self.keys[0];
            let end_s = first.arrival_s();
            emit(Segment {
                begin_s: end_s - self.lead_s,
                end_s,
                delay_s: [first.delay_s - self.slope * self.lead_s, first.delay_s],
                slope: [self.slope; 2],
                gain: [first.gain; 2],
                filter: [first.filter; 2],
                spread: [first.spread; 2],
                fades: self.fades,
            });
        }
    }

    fn segment(&self, a: PathKey, b: PathKey, slope: [f64; 2]) -> Segment {
        Segment {
            begin_s: a.arrival_s(),
            end_s: b.arrival_s(),
            delay_s: [a.delay_s, b.delay_s],
            slope,
            gain: [a.gain, b.gain],
            filter: [a.filter, b.filter],
            spread: [a.spread, b.spread],
            fades: self.fades.within(a.emission_s, b.emission_s),
        }
    }
}

fn secant(a: PathKey, b: PathKey) -> f64 {
    (b.delay_s - a.delay_s) / (b.arrival_s() - a.arrival_s())
}

/// Slope at the middle of three keys, of the parabola through them.
fn middle_slope(a: PathKey, b: PathKey, c: PathKey) -> f64 {
    let (left, right) = (b.arrival_s() - a.arrival_s(), c.arrival_s() - b.arrival_s());
    let (before, after) = (secant(a, b), secant(b, c));
    limit(hermite::middle_slope(left, right, before, after), before.max(after))
}

/// Slope at the first of three keys, of the parabola through them.
fn end_slope(a: PathKey, b: PathKey, c: PathKey) -> f64 {
    let (near, far) = (b.arrival_s() - a.arrival_s(), c.arrival_s() - b.arrival_s());
    let (first, second) = (secant(a, b), secant(b, c));
    limit(hermite::end_slope(near, far, first, second), first)
}

/// Keeps emission time rising: its slope, 1 − `slope`, stays between 0 and three times that of the
/// slower neighbouring secant (Fritsch & Carlson 1980).
fn limit(slope: f64, steepest: f64) -> f64 {
    1.0 - (1.0 - slope).clamp(0.0, 3.0 * (1.0 - steepest).max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segments(keys: &[PathKey]) -> Vec<Segment> {
        let mut found = Vec::new();
        let mut path = PathBuilder::new(keys[0], false, 0.0);
        for &key in &keys[1..keys.len() - 1] {
            path.key(key, &mut |s| found.push(s));
        }
        path.end(keys[keys.len() - 1], &mut |s| found.push(s));
        found
    }

    fn key(emission_s: f64, delay_s: f64) -> PathKey {
        PathKey { emission_s, delay_s, gain: 1.0, filter: UNFILTERED, spread: UNSPREAD }
    }

    #[test]
    fn segments_join_and_are_smooth() {
        let keys: Vec<_> =
            (0..40).map(|i| f64::from(i) * 0.02).map(|t| key(t, 0.1 + 0.02 * (7.0 * t).sin())).collect();
        let segments = segments(&keys);
        assert_eq!(segments.len(), 40);
        for pair in segments.windows(2) {
            assert_eq!(pair[0].end_s, pair[1].begin_s);
            let (left, right) = (pair[0].at(pair[0].end_s), pair[1].at(pair[1].begin_s));
            assert!((left.delay_s - right.delay_s).abs() < 1e-15);
            assert!((left.rate - right.rate).abs() < 1e-12);
        }
        // The keys are met: what arrives at t + delay left at t.
        for key in &keys {
            let segment = segments.iter().find(|s| (s.begin_s..s.end_s).contains(&key.arrival_s())).unwrap();
            assert!((segment.at(key.arrival_s()).delay_s - key.delay_s).abs() < 1e-15);
        }
    }

    #[test]
    fn a_delay_that_grows_steadily_is_met_exactly() {
        // delay = 0.1 + t/10: a source that recedes at a tenth of the speed of sound, f' = f / 1.1.
        let keys: Vec<_> = [0.0, 0.3, 0.35, 1.0].map(|t| key(t, 0.1 + 0.1 * t)).to_vec();
        for segment in &segments(&keys) {
            for part in [0.0, 0.3, 0.9] {
                let moment = segment.at(segment.begin_s + part * (segment.end_s - segment.begin_s));
                assert!((moment.rate - 1.0 / 1.1).abs() < 1e-12, "{moment:?}");
            }
        }
    }

    #[test]
    fn a_still_path_is_exactly_still() {
        let keys: Vec<_> = [0.0, 0.1, 0.3, 2.0].map(|t| key(t, 0.017)).to_vec();
        assert!(segments(&keys).iter().all(|s| s.is_still() && s.at(s.begin_s + 0.01).rate == 1.0));
    }

    #[test]
    fn time_never_runs_backwards() {
        // An abrupt change from receding near the limit to approaching near it.
        let keys = [key(0.0, 0.1), key(0.1, 0.4), key(0.2, 0.32), key(0.3, 0.9), key(0.4, 0.9)];
        for segment in segments(&keys) {
            for step in 0..100 {
                let moment =
                    segment.at(segment.begin_s + f64::from(step) / 100.0 * (segment.end_s - segment.begin_s));
                assert!(moment.rate >= -1e-9, "{segment:?} {moment:?}");
            }
        }
    }

    #[test]
    fn what_no_motion_joins_is_a_jump_and_cross_fades() {
        let keys = [key(0.0, 0.2), key(0.1, 0.2), key(0.2, 0.01), key(0.3, 0.01)];
        let segments = segments(&keys);
        let weight = |emission: f64| {
            // Each emission instant arrives along the old way and the new; the gains sum to 1.
            segments
                .iter()
                .filter(|s| {
                    s.is_still() && s.begin_s - s.delay_s[0] <= emission && emission < s.end_s - s.delay_s[0]
                })
                .map(|s| s.fades.gain(emission))
                .sum::<f64>()
        };
        for emission in [0.05, 0.15, 0.201, 0.205, 0.209, 0.25] {
            assert!((weight(emission) - 1.0).abs() < 1e-12, "{emission}: {}", weight(emission));
        }
        assert!(weight(0.305) < 0.6 && weight(0.311) == 0.0);
    }

    #[test]
    fn the_greatest_rate_of_a_segment_is_found() {
        for (rise, slopes) in [(0.0, [0.0; 2]), (0.02, [0.3, -0.4]), (-0.05, [-0.9, 0.5]), (0.01, [0.1; 2])] {
            let [begin_s, end_s] = [2.0, 2.1];
            let segment = Segment {
                begin_s,
                end_s,
                delay_s: [0.1, 0.1 + rise],
                slope: slopes,
                gain: [1.0; 2],
                filter: [UNFILTERED; 2],
                spread: [UNSPREAD; 2],
                fades: Fades::NONE,
            };
            let rates = (0..=1000).map(|step| segment.at(begin_s + f64::from(step) * 1e-4).rate);
            let greatest = rates.fold(0.0, f64::max);
            assert!((segment.fastest() - greatest).abs() < 1e-5 * greatest, "{rise} {slopes:?}");
        }
    }

    #[test]
    fn one_moment_of_sound_is_a_fade() {
        let mut found = Vec::new();
        PathBuilder::new(key(1.0, 0.5), false, 0.001).end(key(1.0, 0.5), &mut |s| found.push(s));
        assert_eq!(found.len(), 2);
        assert!((found[0].begin_s - 1.499).abs() < 1e-12 && (found[1].end_s - 1.51).abs() < 1e-12);
    }
}
