//! Finds impacts in the contacts of a rigid-body simulation.
//!
//! An impact is a blow between two bodies: either they come together after having been apart, or
//! the force between them rises far above what they carry at rest. What is left over is silent
//! here: stacks, rolling balls and sliding blocks, also where the contact flickers on and off, as
//! the contacts of simulations do.
//!
//! For every pair of bodies, whichever is named first, and every time step the contact points are
//! taken together: J = Σ F·Δt. Three things are kept per pair.
//!
//! - The *resting force*, the mean force since the last blow, over the last tenth of a second at
//!   most, the flickers' gaps included. A body that rolls and touches only every other step pushes
//!   twice as hard when it does; the mean is its weight all the same.
//! - The *window* of a blow that goes on. It opens with a step that follows at least
//!   [`Settings::gap_s`] without contact, or whose mean force since the step before is above
//!   [`Settings::peak_ratio`] resting forces. It holds what begins within
//!   [`Settings::window_s`]; of unbroken contact also the first three steps, or six that rise all
//!   the time, so that a blow that a slow log has spread over two is whole, and what follows while the force rises or falls by a
//!   tenth a step, up to [`Settings::longest_s`], so that a soft blow is whole.
//! - The *last blow*: within a gap's time after it only one half as strong again is a new one and
//!   not its aftermath.
//!
//! When the window closes, the impulse of the blow is J over the window less what resting takes in
//! that time: the resting force from before it, or after an onset the least force after the peak,
//! which is none where the bodies parted. It is an impact where this is more than resting gives in
//! [`Settings::floor_rest_s`], 5 ms, which is a fall of about 5 cm/s whatever the mass, or in one
//! step of a log with longer ones.
//!
//! Impacts come out in order of time, as soon as nothing earlier can follow: no later than the
//! longer of [`Settings::longest_s`] and six steps after they happened, and two steps more. The
//! memory goes with the bodies that have touched of late, not with the length of the log.

use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashMap};

use super::body::BodyState;
use crate::scene::contact_log::{ContactRow, Push};
use crate::{Error, Result};

/// The length of a simulation's time step, by which forces become impulses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Step {
    /// Every step is this long, in seconds.
    Fixed(f64),
    /// A step lasts from one time stamp to the next; this long, in seconds, where that is more than
    /// half as long again, for then nothing touched in between.
    Stamped(f64),
}

impl Step {
    fn typical_s(self) -> f64 {
        match self {
            Step::Fixed(s) | Step::Stamped(s) => s,
        }
    }
}

/// What counts as an impact; see the module for how it is used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// The simulation's step.
    pub step: Step,
    /// How long a blow is listened to at least, in seconds.
    pub window_s: f64,
    /// How long at most, in seconds; three to six steps at least.
    pub longest_s: f64,
    /// Seconds without contact after which touching is a blow; two and a half steps at least.
    pub gap_s: f64,
    /// How many resting forces make a blow of bodies in contact.
    pub peak_ratio: f64,
    /// Seconds over which the resting force is averaged.
    pub rest_s: f64,
    /// A blow has more impulse than resting gives in this many seconds; one step at least.
    pub floor_rest_s: f64,
    /// Whether a blow is told with the step that it begins in, by the impulse of that step. What follows is its aftermath,
    /// unless it is [`PROMPT_RATIO`] times as strong. So works who cannot wait: most engines deliver a blow in one step.
    pub prompt: bool,
}

/// So many times as strong as a blow that was told at once is another one soon after it.
pub const PROMPT_RATIO: f64 = 3.0;

impl Settings {
    /// The usual settings: windows of 5 to 20 ms, gaps of 20 ms, peaks of 3 resting forces averaged over 100 ms.
    pub fn new(step: Step) -> Self {
        Self {
            step,
            window_s: 0.005,
            longest_s: 0.02,
            gap_s: 0.02,
            peak_ratio: 3.0,
            rest_s: 0.1,
            floor_rest_s: 0.005,
            prompt: false,
        }
    }

    /// The same for who cannot wait.
    pub fn prompt(step: Step) -> Self {
        Self { prompt: true, ..Self::new(step) }
    }

    /// So long after it happened an impact is told at the latest, in seconds.
    pub fn behind_s(&self) -> f64 {
        let step_s = self.step.typical_s();
        if self.prompt {
            return step_s;
        }
        self.longest_s.max(6.0 * step_s) + 2.0 * step_s
    }

    fn gap(&self) -> f64 {
        self.gap_s.max(2.5 * self.step.typical_s())
    }

    fn floor(&self) -> f64 {
        self.floor_rest_s.max(self.step.typical_s())
    }
}

/// A blow between two bodies that are known by number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blow {
    /// When, in seconds: the middle of its steps, or when in them it acts where that is known, each weighted by its
    /// impulse.
    pub time_s: f64,
    /// The bodies, the smaller number first.
    pub bodies: [u32; 2],
    /// Where, in metres: the mean of its contact points, each weighted by its impulse.
    pub position_m: [f64; 3],
    /// The impulse beyond resting, in newton seconds.
    pub impulse_ns: f64,
    /// The mean normal, of length 1, for the bodies in this order.
    pub normal: Option<[f64; 3]>,
    /// The same place on each of them, in its own frame, where the motion of one at least is known.
    pub on_m: Option<[[f64; 3]; 2]>,
    /// From the origin of each to that place, in the axes of the world.
    pub arms_m: Option<[[f64; 3]; 2]>,
    /// The greatest relative speed along the normal in metres a second.
    pub speed_mps: Option<f64>,
    /// The greatest speed at which they slide along each other, in metres a second; where the log has it.
    pub sliding_mps: Option<f64>,
    /// The lines of the log that tell of it, first and last.
    pub lines: [u64; 2],
}

/// By time first; what else there is makes the order of blows at one time a fixed one.
fn order(a: &Blow, b: &Blow) -> Ordering {
    let key = |x: &Blow| [x.time_s, -x.impulse_ns, x.position_m[0], x.position_m[1], x.position_m[2]];
    let (a, b) = (key(a), key(b));
    a.iter().zip(&b).map(|(a, b)| a.total_cmp(b)).find(|o| o.is_ne()).unwrap_or(Ordering::Equal)
}

/// A blow in a heap that gives the earliest first.
#[derive(Debug, Clone)]
struct Found(Blow);

impl PartialEq for Found {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}
impl Eq for Found {}
impl PartialOrd for Found {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Found {
    fn cmp(&self, other: &Self) -> Ordering {
        order(&other.0, &self.0)
    }
}

/// A contact point of the step that is being read.
#[derive(Debug, Clone)]
struct Touch {
    bodies: [u32; 2],
    position_m: [f64; 3],
    push: Push<f64>,
    normal: Option<[f64; 3]>,
    speed_mps: Option<f64>,
    sliding_mps: Option<f64>,
    on_m: Option<[[f64; 3]; 2]>,
    arms_m: Option<[[f64; 3]; 2]>,
    at_s: Option<f64>,
    line: u64,
}

/// What is summed over contact points and steps.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    /// Σ J in newton seconds.
    impulse_ns: f64,
    /// Σ J·t, each within its step.
    timed: f64,
    /// Σ J·p.
    moment: [f64; 3],
    /// Σ J·n.
    normal: Option<[f64; 3]>,
    /// The greatest |v| along the normal and across it.
    speed_mps: Option<f64>,
    sliding_mps: Option<f64>,
    /// Σ J·p in the frame of either body.
    on: Option<[[f64; 3]; 2]>,
    /// Σ J·r from the origin of either.
    arms: Option<[[f64; 3]; 2]>,
    /// True where it is known when in its step it acts.
    is_timed: bool,
    /// The first and last line.
    lines: Option<[u64; 2]>,
}

fn plus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// One of two things that are both optional, or both together.
fn both<T>(a: Option<T>, b: Option<T>, join: impl FnOnce(T, T) -> T) -> Option<T> {
    match (a, b) {
        (Some(a), Some(b)) => Some(join(a, b)),
        (a, b) => a.or(b),
    }
}

impl Sum {
    fn add(&mut self, other: &Sum) {
        self.impulse_ns += other.impulse_ns;
        self.timed += other.timed;
        self.moment = plus(self.moment, other.moment);
        self.normal = both(self.normal, other.normal, plus);
        self.speed_mps = both(self.speed_mps, other.speed_mps, f64::max);
        self.sliding_mps = both(self.sliding_mps, other.sliding_mps, f64::max);
        let sums = |a: [[f64; 3]; 2], b: [[f64; 3]; 2]| [plus(a[0], b[0]), plus(a[1], b[1])];
        self.on = both(self.on, other.on, sums);
        self.arms = both(self.arms, other.arms, sums);
        self.is_timed |= other.is_timed;
        self.lines = both(self.lines, other.lines, |a, b| [a[0].min(b[0]), a[1].max(b[1])]);
    }
}

/// A step in which a pair touched.
#[derive(Debug, Clone, Copy)]
struct Contact {
    sum: Sum,
    start_s: f64,
    end_s: f64,
    /// The length by which its impulse becomes a force.
    step_s: f64,
}

/// A blow that goes on.
#[derive(Debug, Clone, Copy)]
struct Window {
    start_s: f64,
    onset: bool,
    steps: usize,
    sum: Sum,
    /// Σ J·t with t the middle of the step.
    time_moment: f64,
    /// Σ Δt and Σ Δt·t of the steps with contact, for taking the resting force away.
    touching_s: f64,
    touching_moment: f64,
    /// From the end of the contact before it to its own last one.
    span_s: f64,
    peak_n: f64,
    /// The force of its first step.
    first_n: f64,
    /// The force of its last step, and whether it still rose or fell by a tenth there.
    last_n: f64,
    changes: bool,
    /// The least force after the peak; none before there was a step.
    least_n: Option<f64>,
}

/// What is known of a pair of bodies.
#[derive(Debug, Clone, Copy)]
struct Pair {
    last_end_s: f64,
    rest_n: f64,
    /// Seconds that the resting force is the mean of.
    rest_age_s: f64,
    window: Option<Window>,
    /// End and impulse of the last blow.
    last_blow: Option<(f64, f64)>,
}

impl Pair {
    /// Takes a mean force over some time into the resting force.
    fn rest(&mut self, force_n: f64, span_s: f64, settings: &Settings) {
        if span_s <= 0.0 {
            return;
        }
        self.rest_age_s += span_s;
        // The plain mean at first, an exponential one later.
        let share = (1.0 - (-span_s / settings.rest_s).exp()).max(span_s / self.rest_age_s);
        self.rest_n += share * (force_n - self.rest_n);
    }
}

/// Rows of contacts in, blows out.
///
/// ```
/// use froufrou::motion::impact::{Analyser, Settings, Step};
/// use froufrou::scene::contact_log::{ContactRow, Push};
/// let mut analyser = Analyser::new(Settings::new(Step::Fixed(0.001)));
/// analyser.feed(&ContactRow {
///     time_s: 0.5, a: 0, b: 1, position_m: [0.0; 3], push: Push::Force(300.0),
///     normal: None, normal_velocity_mps: None, sliding_mps: None, line: 2,
/// }, [None; 2])?;
/// analyser.finish();
/// let blow = analyser.next_blow().unwrap();
/// assert!((blow.impulse_ns - 0.3).abs() < 1e-12);
/// # Ok::<(), froufrou::Error>(())
/// ```
#[derive(Debug)]
pub struct Analyser {
    settings: Settings,
    /// The time stamp being read and the one before it.
    now_s: Option<f64>,
    before_s: Option<f64>,
    touches: Vec<Touch>,
    pairs: HashMap<[u32; 2], Pair>,
    open: Vec<[u32; 2]>,
    /// The number of pairs at which those long apart are forgotten.
    sweep_at: usize,
    found: BinaryHeap<Found>,
    /// What happens before this time has all been found.
    settled_s: f64,
}

impl Analyser {
    /// Begins with nothing known.
    pub fn new(settings: Settings) -> Self {
        Self {
            settings,
            now_s: None,
            before_s: None,
            touches: Vec::new(),
            pairs: HashMap::new(),
            open: Vec::new(),
            sweep_at: 1024,
            found: BinaryHeap::new(),
            settled_s: f64::NEG_INFINITY,
        }
    }

    /// Takes the next row, and where its two bodies are, as far as that is known: who is not known stands still in the
    /// world, if the other one is. Pushes of 0 and below are no contact.
    ///
    /// # Errors
    /// A row that is earlier than the one before it.
    pub fn feed(&mut self, row: &ContactRow, states: [Option<BodyState>; 2]) -> Result<()> {
        self.feed_at(row, states, None)
    }

    /// Takes the next row as [`Analyser::feed`] does, of which is known when in its step it acts; its middle where
    /// that is not known.
    ///
    /// # Errors
    /// As there.
    pub fn feed_at(
        &mut self,
        row: &ContactRow,
        states: [Option<BodyState>; 2],
        at_s: Option<f64>,
    ) -> Result<()> {
        self.advance(row.time_s)?;
        let (Push::Force(push) | Push::Impulse(push)) = row.push;
        if push > 0.0 {
            let swapped = row.a > row.b;
            let (bodies, sign) = if swapped { ([row.b, row.a], -1.0) } else { ([row.a, row.b], 1.0) };
            let known = states != [None; 2];
            let states = states.map(|state| state.unwrap_or(BodyState::STILL));
            let states = if swapped { [states[1], states[0]] } else { states };
            let on_m = known.then(|| states.map(|state| state.local_m(row.position_m)));
            let arm = |state: BodyState| std::array::from_fn(|i| row.position_m[i] - state.position_m[i]);
            let arms_m = known.then(|| states.map(arm));
            self.touches.push(Touch {
                bodies,
                position_m: row.position_m,
                push: row.push,
                normal: row.normal.map(|n| n.map(|c| c * sign)),
                speed_mps: row.normal_velocity_mps.map(f64::abs),
                sliding_mps: row.sliding_mps,
                on_m,
                arms_m,
                at_s,
                line: row.line,
            });
        }
        Ok(())
    }

    /// Says that time has come this far, for worlds in which nothing may touch for long.
    ///
    /// # Errors
    /// A time that is earlier than the one before it.
    pub fn advance(&mut self, time_s: f64) -> Result<()> {
        match self.now_s {
            Some(now_s) if time_s < now_s => {
                return Err(Error::new(format!("time goes backwards: {time_s} follows {now_s}")));
            }
            Some(now_s) if time_s == now_s => return Ok(()),
            Some(now_s) => {
                self.step(now_s);
                self.before_s = Some(now_s);
            }
            None => {}
        }
        self.now_s = Some(time_s);
        self.settle(time_s - self.step_at(time_s).0);
        Ok(())
    }

    /// Says that time has come this far, and that all rows up to then, and of then, were told: rows of that time may not
    /// follow.
    ///
    /// # Errors
    /// As [`Analyser::advance`].
    pub fn complete(&mut self, time_s: f64) -> Result<()> {
        self.advance(time_s)?;
        self.step(time_s);
        self.settle(time_s);
        Ok(())
    }

    /// Says that no more rows follow; all blows can then be taken.
    pub fn finish(&mut self) {
        if let Some(now_s) = self.now_s.take() {
            self.step(now_s);
        }
        self.settle(f64::INFINITY);
    }

    /// What counts as an impact here.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// No blow is still to come that is as early as this.
    pub(super) fn settled_s(&self) -> f64 {
        self.settled_s
    }

    /// The next blow in order of time, once nothing can come before it any more.
    pub fn next_blow(&mut self) -> Option<Blow> {
        if self.found.peek()?.0.time_s > self.settled_s {
            return None;
        }
        self.found.pop().map(|found| found.0)
    }

    /// The time that the step of a stamp takes up, and the length by which its forces count.
    fn step_at(&self, now_s: f64) -> (f64, f64) {
        let typical_s = self.settings.step.typical_s();
        let since_s = self.before_s.map_or(f64::INFINITY, |before_s| now_s - before_s);
        match self.settings.step {
            // Next to no step at all would make a force without bounds of an impulse.
            Step::Stamped(_) if since_s <= 1.5 * typical_s => (since_s, since_s.max(1e-3 * typical_s)),
            // A fixed step and times rounded to few digits may overlap the step before.
            _ => (typical_s.min(since_s), typical_s),
        }
    }

    /// Closes the windows that take nothing that begins as late as this.
    fn settle(&mut self, start_s: f64) {
        let (mut open, settings) = (std::mem::take(&mut self.open), self.settings);
        open.retain(|bodies| {
            let Some(pair) = self.pairs.get(bodies) else { return false };
            let goes_on = pair.window.is_some_and(|w| w.takes(start_s, pair.last_end_s, &settings));
            if !goes_on {
                self.close(*bodies, start_s);
            }
            goes_on
        });
        let starts = open.iter().filter_map(|bodies| self.pairs.get(bodies)?.window.map(|w| w.start_s));
        self.settled_s = starts.fold(start_s, f64::min);
        self.open = open;
        self.sweep(start_s);
    }

    /// Takes the contacts of one time stamp.
    fn step(&mut self, now_s: f64) {
        let (length_s, step_s) = self.step_at(now_s);
        let start_s = now_s - length_s;
        let mut touches = std::mem::take(&mut self.touches);
        // Sums in floating point depend on their order; this one does not depend on the log's.
        touches.sort_unstable_by(|a, b| {
            let push = |t: &Touch| match t.push {
                Push::Force(push) | Push::Impulse(push) => push,
            };
            let by_position =
                || (0..3).map(|n| a.position_m[n].total_cmp(&b.position_m[n])).find(|o| o.is_ne());
            a.bodies
                .cmp(&b.bodies)
                .then_with(|| by_position().unwrap_or(Ordering::Equal))
                .then_with(|| push(a).total_cmp(&push(b)))
        });
        for points in touches.chunk_by(|a, b| a.bodies == b.bodies) {
            let mut sum = Sum::default();
            for point in points {
                let impulse_ns = match point.push {
                    Push::Force(force) => force * step_s,
                    Push::Impulse(impulse) => impulse,
                };
                sum.add(&Sum {
                    impulse_ns,
                    timed: impulse_ns
                        * point.at_s.map_or((start_s + now_s) / 2.0, |at_s| at_s.clamp(start_s, now_s)),
                    moment: point.position_m.map(|c| c * impulse_ns),
                    normal: point.normal.map(|n| n.map(|c| c * impulse_ns)),
                    speed_mps: point.speed_mps,
                    sliding_mps: point.sliding_mps,
                    on: point.on_m.map(|on| on.map(|p| p.map(|c| c * impulse_ns))),
                    arms: point.arms_m.map(|arms| arms.map(|p| p.map(|c| c * impulse_ns))),
                    is_timed: point.at_s.is_some(),
                    lines: Some([point.line; 2]),
                });
            }
            self.contact(points[0].bodies, &Contact { sum, start_s, end_s: now_s, step_s });
        }
        touches.clear();
        self.touches = touches;
    }

    /// Forgets pairs that have been apart so long that nothing of them matters.
    fn sweep(&mut self, now_s: f64) {
        if self.pairs.len() < self.sweep_at {
            return;
        }
        let gap_s = self.settings.gap();
        self.pairs.retain(|_, pair| {
            let blow_matters = pair.last_blow.is_some_and(|(end_s, _)| now_s - end_s < gap_s);
            pair.window.is_some() || now_s - pair.last_end_s < gap_s || blow_matters
        });
        self.sweep_at = 1024.max(2 * self.pairs.len());
    }

    /// Takes all that touched of one pair in one step.
    fn contact(&mut self, bodies: [u32; 2], contact: &Contact) {
        let settings = self.settings;
        let fresh = Pair {
            last_end_s: f64::NEG_INFINITY,
            rest_n: 0.0,
            rest_age_s: 0.0,
            window: None,
            last_blow: None,
        };
        let pair = self.pairs.entry(bodies).or_insert(fresh);
        let apart_s = (contact.start_s - pair.last_end_s).max(0.0);
        pair.last_end_s = contact.end_s;
        if let Some(window) = &mut pair.window {
            window.take(contact, apart_s);
            return;
        }
        let onset = apart_s >= settings.gap();
        if onset {
            (pair.rest_n, pair.rest_age_s) = (0.0, 0.0);
        }
        let span_s = apart_s + contact.step_s;
        let mean_n = contact.sum.impulse_ns / span_s;
        if onset || mean_n > settings.peak_ratio * pair.rest_n {
            let mut window = Window {
                start_s: contact.start_s,
                onset,
                steps: 0,
                sum: Sum::default(),
                time_moment: 0.0,
                touching_s: 0.0,
                touching_moment: 0.0,
                span_s: 0.0,
                peak_n: 0.0,
                first_n: contact.sum.impulse_ns / contact.step_s,
                last_n: 0.0,
                changes: true,
                least_n: None,
            };
            // Having been apart before an onset is flight, not a flicker of resting.
            window.take(contact, if onset { 0.0 } else { apart_s });
            pair.window = Some(window);
            self.open.push(bodies);
        } else {
            pair.rest(mean_n, span_s, &settings);
        }
    }

    /// Ends a window when what comes next begins at a time.
    fn close(&mut self, bodies: [u32; 2], start_s: f64) {
        let settings = self.settings;
        let Some(pair) = self.pairs.get_mut(&bodies) else { return };
        let Some(window) = pair.window.take() else { return };
        let parted = start_s - pair.last_end_s > 0.5 * settings.step.typical_s();
        // What has risen all the time is a growing load, on top of what it began with.
        let least_n = if parted || settings.prompt { 0.0 } else { window.least_n.unwrap_or(window.first_n) };
        let rest_n = if window.onset { least_n } else { pair.rest_n };
        // Flickers on the way to a blow are resting too, so that their time counts.
        let impulse_ns = window.sum.impulse_ns - rest_n * window.span_s;
        let aftermath = pair.last_blow.is_some_and(|(end_s, last_ns)| {
            let stronger = if settings.prompt { PROMPT_RATIO } else { 1.5 };
            window.start_s - end_s < settings.gap() && impulse_ns <= stronger * last_ns
        });
        let floor_ns = settings.floor() * rest_n.max(pair.rest_n);
        // Sums of absurd numbers may overflow: what is not a finite impulse is none.
        if impulse_ns <= floor_ns || !impulse_ns.is_finite() || aftermath {
            pair.rest(window.sum.impulse_ns / window.span_s, window.span_s, &settings);
            return;
        }
        pair.last_blow = Some((pair.last_end_s, impulse_ns));
        if window.onset {
            (pair.rest_n, pair.rest_age_s) = (least_n, window.touching_s);
        }
        let Sum { moment, normal, speed_mps, sliding_mps, on, arms, lines, impulse_ns: all_ns, .. } =
            window.sum;
        let middle_s =
            (window.time_moment - rest_n * window.touching_moment) / (all_ns - rest_n * window.touching_s);
        let end_s = window.start_s.max(pair.last_end_s);
        let length = normal.map(|n| n.iter().map(|c| c * c).sum::<f64>().sqrt());
        self.found.push(Found(Blow {
            time_s: middle_s.clamp(window.start_s, end_s),
            bodies,
            position_m: moment.map(|c| c / all_ns),
            impulse_ns,
            normal: normal.zip(length).filter(|(_, l)| *l > 0.0).map(|(n, l)| n.map(|c| c / l)),
            on_m: on.map(|on| on.map(|p| p.map(|c| c / all_ns))),
            arms_m: arms.map(|arms| arms.map(|p| p.map(|c| c / all_ns))),
            speed_mps,
            sliding_mps,
            lines: lines.unwrap_or_default(),
        }));
    }
}

impl Window {
    /// Adds a step.
    fn take(&mut self, contact: &Contact, apart_s: f64) {
        let middle_s = (contact.start_s + contact.end_s) / 2.0;
        let force_n = contact.sum.impulse_ns / contact.step_s;
        let flicker = apart_s > 0.5 * contact.step_s;
        self.least_n = if self.steps == 0 || force_n > self.peak_n {
            self.peak_n = force_n;
            None
        } else if flicker {
            Some(0.0)
        } else {
            Some(self.least_n.map_or(force_n, |least| least.min(force_n)))
        };
        self.changes = self.least_n.is_none() || force_n < 0.9 * self.last_n;
        self.last_n = force_n;
        // Bodies that come together carry nothing before they do.
        let touching_s = if self.onset && self.steps == 0 && contact.sum.is_timed {
            (contact.end_s - contact.sum.timed / contact.sum.impulse_ns).clamp(0.0, contact.step_s)
        } else {
            contact.step_s
        };
        self.steps += 1;
        self.sum.add(&contact.sum);
        self.time_moment += contact.sum.timed;
        self.touching_s += touching_s;
        self.touching_moment += touching_s * middle_s;
        self.span_s += touching_s + apart_s;
    }

    /// Whether a step that begins at a time would still be part of it.
    fn takes(&self, start_s: f64, last_end_s: f64, settings: &Settings) -> bool {
        if settings.prompt {
            return false;
        }
        let typical_s = settings.step.typical_s();
        let age_s = start_s - self.start_s + 1e-3 * typical_s;
        let unbroken = start_s - last_end_s < 0.5 * typical_s;
        let rising = self.least_n.is_none();
        let goes_on = self.steps < if rising { 6 } else { 3 } || (self.changes && age_s < settings.longest_s);
        age_s < settings.window_s || (unbroken && goes_on)
    }
}

#[cfg(test)]
mod tests;
