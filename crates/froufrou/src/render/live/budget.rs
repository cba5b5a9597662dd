//! How much of a block's time rendering may take, and how many voices fit into that.
//!
//! What a reading takes is measured while the sound plays: so much that only one block in ten of the last second took more
//! of it. A block during which the thread had to wait for others says nothing and does not count. A slice says how much
//! work its readings are, and so it is known before a block is rendered whether it would be late.

use std::time::Instant;

use crate::synth::mixer::Room;

/// What tells an audio thread how late it is.
pub trait Clock: Send {
    /// The time in seconds, from any beginning. It never goes back.
    fn now_s(&mut self) -> f64;

    /// So much work was done for so many frames. A clock that is made up for a test goes on by that; others pay no heed.
    fn rendered(&mut self, work: f64, frames: usize) {
        let _ = (work, frames);
    }
}

/// The clock of the system.
pub(super) struct SystemClock(Instant);

impl SystemClock {
    pub fn new() -> Self {
        Self(Instant::now())
    }
}

impl Clock for SystemClock {
    fn now_s(&mut self) -> f64 {
        self.0.elapsed().as_secs_f64()
    }
}

/// Released voices come back when they fit into this part of the room, and have done so for [`SURE_S`] at least.
const SURE: f64 = 0.85;

/// In seconds.
const SURE_S: f64 = 0.5;

/// So many of them come back in a second at most, and so many at once.
const BACK_PER_S: f64 = 400.0;
const BACK_AT_ONCE: f64 = 4.0;

/// However long all else takes, readings have this part of the budget.
const LEAST: f64 = 0.1;

/// Keeps a block's time.
pub(super) struct Budget {
    /// The part of a block's time that rendering may take; infinite: nothing is ever released.
    part: f64,
    frame_s: f64,
    clock: Box<dyn Clock>,
    /// Seconds for a unit of work and frame, and for all else in a frame.
    per_work_s: Cost,
    rest_s: Cost,
    /// What has been spent on readings in this block, in seconds, and the work of them.
    read_s: f64,
    read_work: f64,
    /// The least room since [`SURE_S`] has passed last, and in the [`SURE_S`] before; and how long it has been.
    least: [f64; 2],
    since_s: f64,
    /// So many voices may come back now.
    back: f64,
}

impl Budget {
    pub fn new(part: f32, rate_hz: f64) -> Self {
        Self {
            part: part.into(),
            frame_s: 1.0 / rate_hz,
            clock: Box::new(SystemClock::new()),
            per_work_s: Cost::new(WAITED),
            rest_s: Cost::new(f64::INFINITY),
            read_s: 0.0,
            read_work: 0.0,
            least: [f64::INFINITY; 2],
            since_s: 0.0,
            back: 0.0,
        }
    }

    pub fn set_clock(&mut self, clock: Box<dyn Clock>) {
        self.clock = clock;
    }

    /// Whether anything may ever be released.
    pub fn is_limited(&self) -> bool {
        self.part.is_finite()
    }

    pub fn now_s(&mut self) -> f64 {
        self.clock.now_s()
    }

    /// When readings begin to be made, where that is of interest.
    pub fn begin(&mut self) -> f64 {
        if self.is_limited() { self.clock.now_s() } else { 0.0 }
    }

    /// Readings have been made since then: so much work a frame.
    pub fn end(&mut self, begun_s: f64, work: f64, frames: usize) {
        self.clock.rendered(work, frames);
        if self.is_limited() {
            self.read_s += self.clock.now_s() - begun_s;
            self.read_work += work * frames as f64;
        }
    }

    /// A block of so many frames has been rendered in so many seconds.
    pub fn block(&mut self, took_s: f64, frames: usize) {
        let (read_s, work) = (std::mem::take(&mut self.read_s), std::mem::take(&mut self.read_work));
        if self.is_limited() && frames > 0 {
            let lasts_s = frames as f64 * self.frame_s;
            self.rest_s.push((took_s - read_s).max(0.0) / frames as f64, lasts_s);
            if work > 0.0 {
                self.per_work_s.push(read_s / work, lasts_s);
            }
        }
    }

    /// How much work a frame there is time for in the next frames, beside what is done anyway.
    pub fn room(&mut self, anyway: f64, frames: usize) -> Room {
        let Some(per_work_s) = self.per_work_s.estimate().filter(|per_work_s| *per_work_s > 0.0) else {
            return Room { now: f64::INFINITY, sure: f64::INFINITY, back: 0 };
        };
        let all_s = self.part * self.frame_s;
        let rest_s = self.rest_s.estimate().unwrap_or(0.0);
        let room = (all_s - rest_s).max(LEAST * all_s) / per_work_s;
        let lasts_s = frames as f64 * self.frame_s;
        self.since_s += lasts_s;
        if self.since_s >= SURE_S {
            (self.since_s, self.least) = (0.0, [f64::INFINITY, self.least[0]]);
        }
        self.least[0] = self.least[0].min(room);
        self.back = (self.back + BACK_PER_S * lasts_s).min(BACK_AT_ONCE);
        let sure = SURE * self.least[0].min(self.least[1]);
        Room { now: room - anyway, sure: sure - anyway, back: self.back as usize }
    }

    /// So many voices have come back.
    pub fn came_back(&mut self, voices: usize) {
        self.back -= voices as f64;
    }
}

/// What took more than so many times the median had to wait for something else.
const WAITED: f64 = 3.0;

/// Of what is measured every so many seconds this part takes no more than is reckoned with.
const EVERY_S: f64 = 0.008;
const QUANTILE: f64 = 0.9;

/// So much is kept: that of about a second.
const KEPT: usize = 125;

/// Half of the last few taking so many times as much as is reckoned with is no chance.
const CLEARLY: f64 = 1.5;
const FEW: usize = 9;

/// What something takes, measured block by block.
struct Cost {
    /// Of the last second, and how many there have been.
    kept: [f64; KEPT],
    count: usize,
    /// So long it is since then, in seconds.
    since_s: f64,
    /// The last few of all.
    last: [f64; FEW],
    all: usize,
    /// More than so many times the median does not count.
    most: f64,
    /// What is reckoned with by those of the last second.
    reckoned: f64,
}

impl Cost {
    fn new(most: f64) -> Self {
        let (kept, last) = ([0.0; KEPT], [0.0; FEW]);
        Self { kept, count: 0, since_s: EVERY_S, last, all: 0, most, reckoned: 0.0 }
    }

    /// A block that lasts so long took so much.
    fn push(&mut self, cost: f64, lasts_s: f64) {
        self.last[self.all % FEW] = cost;
        self.all += 1;
        self.since_s += lasts_s;
        if self.since_s < EVERY_S {
            return;
        }
        self.since_s = 0.0;
        self.kept[self.count % KEPT] = cost;
        self.count += 1;
        // Long blocks are fewer in a second.
        let within = (1.0 / lasts_s.max(EVERY_S)) as usize;
        let count = self.count.min(within.clamp(FEW, KEPT));
        let mut sorted = [0.0; KEPT];
        for (n, sorted) in sorted[..count].iter_mut().enumerate() {
            *sorted = self.kept[(self.count - 1 - n) % KEPT];
        }
        let sorted = &mut sorted[..count];
        sorted.sort_unstable_by(f64::total_cmp);
        let median = sorted[count / 2];
        // Infinitely often nothing is no number.
        let counts = |cost: &f64| self.most.is_infinite() || *cost <= self.most * median;
        let counting = sorted.partition_point(counts).max(1);
        self.reckoned = sorted[(QUANTILE * counting as f64) as usize];
    }

    /// What it will take, once that is known.
    fn estimate(&self) -> Option<f64> {
        let count = self.all.min(FEW);
        let mut sorted = self.last;
        sorted[..count].sort_unstable_by(f64::total_cmp);
        let median = (count >= 3).then(|| sorted[count / 2])?;
        let is_known = self.count >= FEW && median <= CLEARLY * self.reckoned;
        Some(if is_known { self.reckoned } else { median })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_waits_change_nothing() {
        let mut cost = Cost::new(WAITED);
        assert_eq!(cost.estimate(), None);
        for n in 0..1000 {
            cost.push(if n % 5 == 0 { 1e3 } else { 1.0 }, 0.001);
            assert!(n < 2 || cost.estimate() == Some(1.0), "{n}");
        }
        // What is slower for good is so after a few blocks; what is faster for good, after a second.
        (0..5).for_each(|_| cost.push(2.0, 0.001));
        assert_eq!(cost.estimate(), Some(2.0));
        (0..1000).for_each(|_| cost.push(2.0, 0.001));
        (0..400).for_each(|_| cost.push(0.5, 0.001));
        assert_eq!(cost.estimate(), Some(2.0));
        (0..1000).for_each(|_| cost.push(0.5, 0.001));
        assert_eq!(cost.estimate(), Some(0.5));
        // One in ten takes more.
        (0..1000).for_each(|n| cost.push(f64::from((n * 377) % 1000), 0.01));
        let estimate = cost.estimate().unwrap();
        assert!((870.0..930.0).contains(&estimate), "{estimate}");
    }

    /// Every unit of work takes so many seconds, and every block so many more.
    struct Made(f64, f64);

    impl Clock for Made {
        fn now_s(&mut self) -> f64 {
            self.1
        }

        fn rendered(&mut self, work: f64, frames: usize) {
            self.1 += self.0 * work * frames as f64;
        }
    }

    #[test]
    fn room_is_what_the_rest_leaves() {
        let mut budget = Budget::new(0.5, 1000.0);
        budget.set_clock(Box::new(Made(1e-6, 0.0)));
        assert_eq!(budget.room(0.0, 10).now, f64::INFINITY);
        for _ in 0..5 {
            let begun_s = budget.begin();
            budget.end(begun_s, 100.0, 10);
            // Reading took 1 ms of it.
            budget.block(0.002, 10);
        }
        // Of 0.5 ms a frame, 0.1 ms go to the rest.
        let Room { now: room, sure, .. } = budget.room(0.0, 10);
        assert!((room - 400.0).abs() < 1e-6 && (sure - 340.0).abs() < 1e-6, "{room} {sure}");
        assert!((budget.room(30.0, 10).now - 370.0).abs() < 1e-6);
        // However long the rest takes, something is heard.
        (0..9).for_each(|_| budget.block(1.0, 10));
        assert!((budget.room(0.0, 10).now - 50.0).abs() < 1e-6);
        // There is sure to be no more until that has been so for a while, and then a few come back at a time.
        (0..200).for_each(|_| budget.block(0.001, 10));
        for n in 0..200 {
            let Room { now, sure, back } = budget.room(0.0, 10);
            assert!((now - 400.0).abs() < 1e-6 && back <= 4, "{now} {back}");
            let expected = if n < 90 { 42.5 } else { 340.0 };
            assert!((90..105).contains(&n) || (sure - expected).abs() < 1e-6, "{n}: {sure}");
            budget.came_back(back);
        }
    }
}
