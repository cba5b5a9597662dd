//! How much of a block's time rendering may take, and how many voices fit into that.
//!
//! What a reading takes is measured while the sound plays: of the last pieces the median counts, so that a piece during
//! which the thread had to wait for others changes nothing. A slice says how much work its readings are, and so it is known
//! before a block is rendered whether it would be late.

use std::time::Instant;

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

/// Released voices come back when they fit into this part of the room, and have done so for [`SURE_S`].
const SURE: f64 = 0.85;

/// The room that there is for sure grows no faster than by this time constant, in seconds.
const SURE_S: f64 = 0.25;

/// However long all else takes, readings have this part of the budget.
const LEAST: f64 = 0.1;

/// Keeps a block's time.
pub(super) struct Budget {
    /// The part of a block's time that rendering may take; infinite: nothing is ever released.
    part: f64,
    frame_s: f64,
    clock: Box<dyn Clock>,
    /// Seconds for a unit of work and frame, and for all else in a frame.
    per_work_s: Recent,
    rest_s: Recent,
    /// What has been spent on readings in this block, in seconds.
    read_s: f64,
    sure_room: f64,
}

impl Budget {
    pub fn new(part: f32, rate_hz: f64) -> Self {
        Self {
            part: part.into(),
            frame_s: 1.0 / rate_hz,
            clock: Box::new(SystemClock::new()),
            per_work_s: Recent::default(),
            rest_s: Recent::default(),
            read_s: 0.0,
            sure_room: f64::INFINITY,
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
            let took_s = self.clock.now_s() - begun_s;
            self.read_s += took_s;
            let all = work * frames as f64;
            if all > 0.0 {
                self.per_work_s.push(took_s / all);
            }
        }
    }

    /// A block of so many frames has been rendered in so many seconds.
    pub fn block(&mut self, took_s: f64, frames: usize) {
        let read_s = std::mem::take(&mut self.read_s);
        if self.is_limited() && frames > 0 {
            self.rest_s.push((took_s - read_s).max(0.0) / frames as f64);
        }
    }

    /// How much work a frame there is time for in the next frames, beside what is done anyway; and how much there has been for a
    /// while.
    pub fn room(&mut self, anyway: f64, frames: usize) -> [f64; 2] {
        let Some(per_work_s) = self.per_work_s.median().filter(|per_work_s| *per_work_s > 0.0) else {
            return [f64::INFINITY; 2];
        };
        let all_s = self.part * self.frame_s;
        let rest_s = self.rest_s.median().unwrap_or(0.0);
        let room = (all_s - rest_s).max(LEAST * all_s) / per_work_s;
        if room < self.sure_room {
            self.sure_room = room;
        } else {
            let along = (frames as f64 * self.frame_s / SURE_S).min(1.0);
            self.sure_room += along * (room - self.sure_room);
        }
        [room, SURE * self.sure_room].map(|room| room - anyway)
    }
}

/// The last numbers of something that is measured.
#[derive(Default)]
struct Recent {
    last: [f64; 9],
    count: usize,
}

impl Recent {
    fn push(&mut self, number: f64) {
        self.last[self.count % self.last.len()] = number;
        self.count += 1;
    }

    /// Their median, once there are some.
    fn median(&self) -> Option<f64> {
        let count = self.count.min(self.last.len());
        let mut sorted = self.last;
        sorted[..count].sort_unstable_by(f64::total_cmp);
        (count >= 3).then(|| sorted[count / 2])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_long_wait_changes_nothing() {
        let mut recent = Recent::default();
        assert_eq!(recent.median(), None);
        for n in 0..100 {
            recent.push(if n % 5 == 0 { 1e3 } else { 1.0 });
            assert!(n < 2 || recent.median() == Some(1.0), "{n}");
        }
        (0..9).for_each(|_| recent.push(2.0));
        assert_eq!(recent.median(), Some(2.0));
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
        assert_eq!(budget.room(0.0, 10), [f64::INFINITY; 2]);
        for _ in 0..5 {
            let begun_s = budget.begin();
            budget.end(begun_s, 100.0, 10);
            // Reading took 1 ms of it.
            budget.block(0.002, 10);
        }
        // Of 0.5 ms a frame, 0.1 ms go to the rest.
        let [room, sure] = budget.room(0.0, 10);
        assert!((room - 400.0).abs() < 1e-6 && (sure - 340.0).abs() < 1e-6, "{room} {sure}");
        assert!((budget.room(30.0, 10)[0] - 370.0).abs() < 1e-6);
        // However long the rest takes, something is heard.
        (0..9).for_each(|_| budget.block(1.0, 10));
        assert!((budget.room(0.0, 10)[0] - 50.0).abs() < 1e-6);
    }
}
