//! Finds in the contacts of a rigid-body simulation where bodies slide along each other: how fast and
//! how hard pressed.
//!
//! Time is cut into moments of [`MOMENT_S`], or of a step of the simulation where that is longer. For
//! every pair of bodies and every moment all contact points are taken together, each weighted by its
//! impulse J = F·Δt: the speed is Σ J·v / Σ J, the place Σ J·p / Σ J, and the force the impulse of the
//! moment over its length, so that a contact that flickers presses as hard as its weight is. What is
//! slower than [`LEAST_MPS`] rests.
//!
//! It needs the log's sliding velocities. The memory goes with the pairs that touch within a moment.

use std::collections::{BTreeMap, VecDeque};

use super::impact::Step;
use crate::scene::contact_log::{ContactRow, Push};

/// How long a moment is at least, in seconds.
pub const MOMENT_S: f64 = 0.01;

/// Bodies that slide more slowly than this, in metres a second, are at rest.
pub const LEAST_MPS: f64 = 0.001;

/// Two bodies that are known by number slide along each other for a moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sliding {
    /// The middle of the moment, in seconds.
    pub time_s: f64,
    /// How long it is, in seconds.
    pub lasts_s: f64,
    /// The bodies, the smaller number first.
    pub bodies: [u32; 2],
    /// Where they touch, in metres.
    pub position_m: [f64; 3],
    /// How fast they slide, in metres a second.
    pub speed_mps: f64,
    /// How hard they press, in newtons.
    pub force_n: f64,
    /// The lines of the log that tell of it, first and last.
    pub lines: [u64; 2],
}

/// What is summed over the contact points of a pair in a moment.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    impulse_ns: f64,
    /// Σ J·v.
    slid: f64,
    /// Σ J·p.
    moment: [f64; 3],
    lines: Option<[u64; 2]>,
}

/// Is fed the rows of a contact log in order of time.
#[derive(Debug, Clone)]
pub struct Analyser {
    step: Step,
    moment_s: f64,
    /// The moment that is summed, counted from time 0, and its pairs.
    now: i64,
    pairs: BTreeMap<[u32; 2], Sum>,
    found: VecDeque<Sliding>,
    last_s: Option<f64>,
    /// The length of the step of the last time stamp.
    step_s: f64,
}

impl Analyser {
    /// Begins with nothing known.
    pub fn new(step: Step) -> Self {
        let (Step::Fixed(typical_s) | Step::Stamped(typical_s)) = step;
        Self {
            step,
            moment_s: MOMENT_S.max(typical_s),
            now: i64::MIN,
            pairs: BTreeMap::new(),
            found: VecDeque::new(),
            last_s: None,
            step_s: typical_s,
        }
    }

    /// Takes the next row; one without a sliding velocity tells nothing.
    pub fn feed(&mut self, row: &ContactRow) {
        let Some(speed_mps) = row.sliding_mps else { return };
        // A time stamp is the end of its step.
        let now = ((row.time_s / self.moment_s) - 1e-6).floor() as i64;
        if now > self.now {
            self.tell();
            self.now = now;
        }
        if let (Step::Stamped(typical_s), Some(last_s)) = (self.step, self.last_s)
            && row.time_s > last_s
        {
            let since_s = row.time_s - last_s;
            self.step_s = if since_s <= 1.5 * typical_s { since_s } else { typical_s };
        }
        self.last_s = Some(row.time_s);
        let impulse_ns = match row.push {
            Push::Force(force_n) => force_n * self.step_s,
            Push::Impulse(impulse_ns) => impulse_ns,
        };
        if impulse_ns > 0.0 {
            let bodies = if row.a <= row.b { [row.a, row.b] } else { [row.b, row.a] };
            let sum = self.pairs.entry(bodies).or_default();
            sum.impulse_ns += impulse_ns;
            sum.slid += impulse_ns * speed_mps;
            (0..3).for_each(|i| sum.moment[i] += impulse_ns * row.position_m[i]);
            let [first, last] = sum.lines.unwrap_or([row.line; 2]);
            sum.lines = Some([first.min(row.line), last.max(row.line)]);
        }
    }

    /// Says that no more rows follow.
    pub fn finish(&mut self) {
        self.tell();
        self.now = i64::MAX;
    }

    /// The time of the next moment that is over.
    pub fn next_s(&self) -> Option<f64> {
        self.found.front().map(|found| found.time_s)
    }

    /// The next moment that is over, in order of time.
    pub fn pop(&mut self) -> Option<Sliding> {
        self.found.pop_front()
    }

    /// No moment is still to be told whose middle is before this.
    pub fn settled_s(&self) -> f64 {
        match self.now {
            i64::MAX => f64::INFINITY,
            // Of a log without sliding velocities nothing is ever to come.
            i64::MIN => f64::INFINITY,
            now => now as f64 * self.moment_s,
        }
    }

    fn tell(&mut self) {
        let middle_s = (self.now as f64 + 0.5) * self.moment_s;
        for (bodies, sum) in std::mem::take(&mut self.pairs) {
            let speed_mps = sum.slid / sum.impulse_ns;
            let position_m = sum.moment.map(|c| c / sum.impulse_ns);
            let force_n = sum.impulse_ns / self.moment_s;
            let finite = [speed_mps, force_n].into_iter().chain(position_m).all(f64::is_finite);
            if finite && speed_mps >= LEAST_MPS {
                self.found.push_back(Sliding {
                    time_s: middle_s,
                    lasts_s: self.moment_s,
                    bodies,
                    position_m,
                    speed_mps,
                    force_n,
                    lines: sum.lines.unwrap_or_default(),
                });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(time_s: f64, a: u32, b: u32, force_n: f64, sliding_mps: f64) -> ContactRow {
        ContactRow {
            time_s,
            a,
            b,
            position_m: [time_s, 0.0, 0.0],
            push: Push::Force(force_n),
            normal: None,
            normal_velocity_mps: None,
            sliding_mps: Some(sliding_mps),
            line: 2,
        }
    }

    fn slides(rows: &[ContactRow]) -> Vec<Sliding> {
        let mut analyser = Analyser::new(Step::Fixed(0.001));
        rows.iter().for_each(|row| analyser.feed(row));
        analyser.finish();
        std::iter::from_fn(|| analyser.pop()).collect()
    }

    #[test]
    fn a_block_that_slides_steadily_is_told_as_such() {
        // Two points, one bearing three times as much; 20 N in all at 0.5 m/s.
        let rows: Vec<_> = (1..=200)
            .flat_map(|step| {
                let time = f64::from(step) * 0.001;
                [row(time, 3, 1, 15.0, 0.5), row(time, 1, 3, 5.0, 0.5)]
            })
            .collect();
        let found = slides(&rows);
        assert_eq!(found.len(), 20);
        for (index, slide) in found.iter().enumerate() {
            assert!((slide.time_s - (index as f64 + 0.5) * 0.01).abs() < 1e-12);
            assert!((slide.force_n - 20.0).abs() < 1e-9 && (slide.speed_mps - 0.5).abs() < 1e-12);
            assert!((slide.position_m[0] - slide.time_s).abs() < 0.001);
            assert_eq!(slide.bodies, [1, 3]);
        }
    }

    #[test]
    fn flickering_presses_as_hard_as_the_weight_and_rest_is_silent() {
        // In contact every other step, twice as hard.
        let rows: Vec<_> = (1..=50).map(|step| row(f64::from(2 * step) * 0.001, 0, 1, 40.0, 0.2)).collect();
        assert!(slides(&rows).iter().all(|slide| (slide.force_n - 20.0).abs() < 1e-9));
        let rows: Vec<_> = (1..=50).map(|step| row(f64::from(step) * 0.001, 0, 1, 40.0, 0.0005)).collect();
        assert!(slides(&rows).is_empty());
        // Nothing pressed, nothing finite.
        assert!(slides(&[row(0.1, 0, 1, 0.0, 1.0), row(0.2, 0, 1, f64::MAX, f64::MAX)]).is_empty());
    }
}
