//! Finds in the contacts of a rigid-body simulation where bodies slide and roll along each other: how fast and
//! how hard pressed.
//!
//! Time is cut into moments of [`MOMENT_S`], or of a step of the simulation where that is longer. For
//! every pair of bodies and every moment all contact points are taken together, each weighted by its
//! impulse J = F·Δt: the speed is Σ J·v / Σ J, the place Σ J·p / Σ J, and the force the impulse of the
//! moment over the length of its steps, so that a contact that flickers presses as hard as its weight is.
//!
//! What a moment is, [`rub`](super::rub) says from two speeds.
//!
//! - The *slip* is that of the log, or else follows from how the bodies move.
//! - The rolling speed is how far the points have come over both bodies since the steps before, each found again as the
//!   nearest one, and none where that is no steady way but a jitter. Bodies that press on each other flat have
//!   points that wander and do not roll: two surfaces roll as fast as they turn against each other, and a way is not
//!   believed beyond [`MOST_REACH`] times that turn about the nearer body's centre.
//!
//! Where nobody knows how the bodies move, one of them is taken to stand still: a contact that travels and does not slip
//! rolls, where it is a single point that goes on the same way in moment after moment. So a log without poses takes a load that rests on a moving car for one that rolls.
//!
//! A pair keeps to what it does: from sliding to rolling, to rest and back it changes with the second moment in
//! a row, and that is told from the first one on; but what begins to slide faster than [`SURELY_MPS`] does so at once,
//! and nothing begins to roll more slowly than that.
//! Rest is not told. Moments come out in order of time, no later than one moment after they are over.
//!
//! It needs the log's sliding velocities or the bodies' motion. The memory goes with the pairs that touch within
//! a few moments.

use std::cmp::Ordering;
use std::collections::{BTreeMap, HashMap};

use glam::{DQuat, DVec3};

use super::body::BodyState;
use super::impact::Step;
use super::rub::{Rubbing, Surface, classify};
use crate::scene::contact_log::{ContactRow, Push};

/// How long a moment is at least, in seconds.
pub const MOMENT_S: f64 = 0.01;

/// Bodies that slide more slowly than this, in metres a second, are at rest.
pub const LEAST_MPS: f64 = 0.001;

/// What slides so fast, in metres a second, has begun to slide, however short it does so; what begins to roll is as
/// fast.
pub const SURELY_MPS: f64 = 0.005;

/// How many times as fast as a body's centre goes about the contact the contact may travel: a coin that
/// wobbles down has its contact run around its rim, the faster the flatter it lies.
pub const MOST_REACH: f64 = 10.0;

/// For so long, in seconds, or three steps, a contact point is remembered.
const TRACK_S: f64 = 0.05;
/// Of so many contact points at most of a pair the way is followed.
const MOST_TRACKS: usize = 16;
/// Logs are rounded: so far, in metres, a point that stands still may seem to go.
const ROUNDING_M: f64 = 1e-4;
/// Moments after which a pair that does not touch is forgotten.
const FORGET: i64 = 8;

/// Two bodies that are known by number slide or roll along each other for a moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rubbed {
    /// Whether they slide or roll; never rest.
    pub how: Rubbing,
    /// The middle of the moment, in seconds.
    pub time_s: f64,
    /// How long it is, in seconds.
    pub lasts_s: f64,
    /// The bodies, the smaller number first.
    pub bodies: [u32; 2],
    /// Where they touch, in metres.
    pub position_m: [f64; 3],
    /// The same on each of them, in its own frame, where the motion of one at least is known.
    pub on_m: Option<[[f64; 3]; 2]>,
    /// How fast they slide, or how fast the contact rolls along both, in metres a second.
    pub speed_mps: f64,
    /// How hard they press, in newtons.
    pub force_n: f64,
    /// The lines of the log that tell of it, first and last.
    pub lines: [u64; 2],
}

/// What the motion of two bodies says of a contact point.
#[derive(Debug, Clone, Copy)]
struct Motion {
    /// The velocity of the material of each.
    surfaces_mps: [DVec3; 2],
    on_m: [DVec3; 2],
    turns: [DQuat; 2],
    /// How fast the contact may travel by rolling.
    reach_mps: f64,
}

impl Motion {
    fn of(states: [BodyState; 2], known: [bool; 2], point_m: [f64; 3], normal: Option<DVec3>) -> Self {
        let [a, b] = states.map(|state| DVec3::from(state.angular_velocity_rps));
        let turn = match normal {
            Some(normal) => (a - b).reject_from(normal),
            None => a - b,
        };
        let point = DVec3::from(point_m);
        let arms = states.iter().zip(known).filter(|(_, known)| *known);
        let arm_m =
            arms.map(|(state, _)| point.distance(state.position_m.into())).fold(f64::INFINITY, f64::min);
        let reach_mps = MOST_REACH * turn.length() * arm_m;
        Self {
            surfaces_mps: states.map(|state| DVec3::from(state.velocity_at(point_m))),
            on_m: states.map(|state| DVec3::from(state.local_m(point_m))),
            turns: states.map(|state| DQuat::from_array(state.rotation)),
            reach_mps: if reach_mps.is_finite() { reach_mps } else { 0.0 },
        }
    }
}

/// A contact point of the step that is being read.
#[derive(Debug, Clone)]
struct Touch {
    bodies: [u32; 2],
    position: DVec3,
    impulse_ns: f64,
    normal: Option<DVec3>,
    slip_mps: f64,
    motion: Option<Motion>,
    line: u64,
}

/// What is summed over the contact points of a pair in a moment, each times its impulse.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    impulse_ns: f64,
    slid: f64,
    position: DVec3,
    normal: DVec3,
    /// With the impulse of the points whose motion is known.
    moved_ns: f64,
    on: [DVec3; 2],
    reach: f64,
    /// How far the contact points have come, over both bodies or in the world, by what way, and in what time.
    travel: DVec3,
    way: f64,
    travelled_s: f64,
    lines: Option<[u64; 2]>,
}

/// What a pair did in a moment.
#[derive(Debug, Clone, Copy)]
struct Moment {
    index: i64,
    raw: Option<Rubbing>,
    slip_mps: f64,
    rolling_mps: f64,
    position_m: [f64; 3],
    on_m: Option<[[f64; 3]; 2]>,
    force_n: f64,
    /// Where nobody knows how the bodies move: how fast the contact travels, in metres a second.
    travels_mps: Option<DVec3>,
    lines: [u64; 2],
}

/// A contact point that is followed.
#[derive(Debug, Clone, Copy)]
struct Track {
    time_s: f64,
    position: DVec3,
    /// The same on both bodies, where their motion is known.
    on_m: Option<([DVec3; 2], [DQuat; 2])>,
}

/// What is known of a pair.
#[derive(Debug, Clone, Default)]
struct Life {
    sum: Option<Sum>,
    tracks: Vec<Track>,
    held: Option<Rubbing>,
    /// A moment that may be the first of something else.
    pending: Option<Moment>,
    /// How fast the contact travelled in the last moment, where that is all that is known.
    travelled_mps: Option<DVec3>,
    last: i64,
}

/// Is fed the rows of a contact log in order of time.
#[derive(Debug, Clone)]
pub struct Analyser {
    step: Step,
    typical_s: f64,
    moment_s: f64,
    /// The moment that is summed, counted from time 0.
    now: i64,
    touches: Vec<Touch>,
    pairs: HashMap<[u32; 2], Life>,
    /// The pairs that touch in this moment or have something pending, and room for the next such list.
    awake: Vec<[u32; 2]>,
    asleep: Vec<[u32; 2]>,
    found: BTreeMap<(i64, [u32; 2]), Rubbed>,
    /// Moments before this one are settled.
    settled: i64,
    time_s: Option<f64>,
    /// The last time stamp of the moment before.
    before_s: Option<f64>,
    /// The length of the step of the last time stamp.
    step_s: f64,
}

impl Analyser {
    /// Begins with nothing known.
    pub fn new(step: Step) -> Self {
        let (Step::Fixed(typical_s) | Step::Stamped(typical_s)) = step;
        Self {
            step,
            typical_s,
            moment_s: MOMENT_S.max(typical_s),
            now: i64::MIN,
            touches: Vec::new(),
            pairs: HashMap::new(),
            awake: Vec::new(),
            asleep: Vec::new(),
            found: BTreeMap::new(),
            settled: i64::MIN,
            time_s: None,
            before_s: None,
            step_s: typical_s,
        }
    }

    /// Takes the next row, and how its two bodies move, as far as that is known: who is not known stands still if the
    /// other one is. A row without a sliding velocity, of bodies of which nothing is known, tells nothing.
    pub fn feed(&mut self, row: &ContactRow, states: [Option<BodyState>; 2]) {
        self.advance(row.time_s);
        let impulse_ns = match row.push {
            Push::Force(force_n) => force_n * self.step_s,
            Push::Impulse(impulse_ns) => impulse_ns,
        };
        if impulse_ns <= 0.0 || !impulse_ns.is_finite() {
            return;
        }
        let swapped = row.a > row.b;
        let (bodies, states) =
            if swapped { ([row.b, row.a], [states[1], states[0]]) } else { ([row.a, row.b], states) };
        let sign = if swapped { -1.0 } else { 1.0 };
        let normal = row.normal.and_then(|n| DVec3::from(n).try_normalize()).map(|n| n * sign);
        let known = states.map(|state| state.is_some());
        let motion = known.contains(&true).then(|| {
            let states = states.map(|state| state.unwrap_or(BodyState::STILL));
            Motion::of(states, known, row.position_m, normal)
        });
        let slip_mps = row.sliding_mps.or_else(|| {
            let [a, b] = motion?.surfaces_mps;
            Some(normal.map_or(a - b, |normal| (a - b).reject_from(normal)).length())
        });
        let Some(slip_mps) = slip_mps else { return };
        let position = row.position_m.into();
        self.touches.push(Touch { bodies, position, impulse_ns, normal, slip_mps, motion, line: row.line });
    }

    /// Says that time has come this far, for worlds in which nothing may touch for long.
    pub fn advance(&mut self, time_s: f64) {
        if self.time_s.is_some_and(|now_s| time_s <= now_s) {
            return;
        }
        self.take_step();
        if let (Step::Stamped(typical_s), Some(last_s)) = (self.step, self.time_s) {
            let since_s = time_s - last_s;
            self.step_s = if since_s <= 1.5 * typical_s { since_s } else { typical_s };
        }
        let last_s = self.time_s.replace(time_s);
        // A time stamp is the end of its step.
        let now = ((time_s / self.moment_s) - 1e-6).floor() as i64;
        if now > self.now {
            self.turn_to(now, last_s);
        }
    }

    /// Says that time has come this far, and that all rows up to then, and of then, were told: a moment that ends there is
    /// over.
    pub fn complete(&mut self, time_s: f64) {
        self.advance(time_s);
        self.take_step();
        let next = ((time_s / self.moment_s) + 1e-6).floor() as i64;
        if self.time_s == Some(time_s) && next > self.now {
            self.turn_to(next, Some(time_s));
        }
    }

    /// How long a moment is, in seconds.
    pub fn moment_s(&self) -> f64 {
        self.moment_s
    }

    /// Says that no more rows follow.
    pub fn finish(&mut self) {
        self.take_step();
        self.turn_to(i64::MAX, self.time_s);
    }

    /// The time of the next moment that is settled.
    pub fn next_s(&self) -> Option<f64> {
        let ((index, _), found) = self.found.first_key_value()?;
        (*index < self.settled).then_some(found.time_s)
    }

    /// The next moment that is settled, in order of time.
    pub fn pop(&mut self) -> Option<Rubbed> {
        self.next_s()?;
        self.found.pop_first().map(|(_, found)| found)
    }

    /// No moment is still to be told whose middle is before this.
    pub fn settled_s(&self) -> f64 {
        match self.settled {
            i64::MAX => f64::INFINITY,
            i64::MIN => f64::NEG_INFINITY,
            settled => settled as f64 * self.moment_s,
        }
    }

    /// Takes the contacts of one time stamp.
    fn take_step(&mut self) {
        let Some(time_s) = self.time_s else { return };
        let mut touches = std::mem::take(&mut self.touches);
        // Sums in floating point depend on their order; this one does not depend on the log's.
        touches.sort_unstable_by(|a, b| {
            let axes = || (0..3).map(|n| a.position[n].total_cmp(&b.position[n])).find(|o| o.is_ne());
            let place = |_| axes().unwrap_or(Ordering::Equal);
            let weight = |_| a.impulse_ns.total_cmp(&b.impulse_ns);
            a.bodies.cmp(&b.bodies).then_with(|| place(())).then_with(|| weight(()))
        });
        let remembered_s = TRACK_S.max(3.0 * self.typical_s);
        for points in touches.chunk_by(|a, b| a.bodies == b.bodies) {
            let life = self.pairs.entry(points[0].bodies).or_default();
            if life.sum.is_none() && life.pending.is_none() {
                self.awake.push(points[0].bodies);
            }
            let sum = life.sum.get_or_insert_default();
            points.iter().for_each(|touch| sum.add(touch));
            life.tracks.retain(|track| time_s - track.time_s <= remembered_s);
            follow(&mut life.tracks, points, time_s, sum);
        }
        touches.clear();
        self.touches = touches;
    }

    /// Ends the moment that was summed, whose last time stamp is this, and goes on to another.
    fn turn_to(&mut self, now: i64, last_s: Option<f64>) {
        let ended = std::mem::replace(&mut self.now, now);
        // Of steps that do not divide a moment now one more falls into it, now one less.
        let before_s = std::mem::replace(&mut self.before_s, last_s);
        let covered_s = last_s.zip(before_s).map(|(last_s, before_s)| last_s - before_s);
        let usual = 0.5 * self.moment_s..=1.5 * self.moment_s;
        let covered_s = covered_s.filter(|covered_s| usual.contains(covered_s)).unwrap_or(self.moment_s);
        self.asleep.clear();
        std::mem::swap(&mut self.awake, &mut self.asleep);
        let mut left_pending = false;
        for index in 0..self.asleep.len() {
            let bodies = self.asleep[index];
            let Some(life) = self.pairs.get_mut(&bodies) else { continue };
            let mut told = |index: i64, rubbed: Option<Rubbed>| {
                if let Some(rubbed) = rubbed {
                    self.found.insert((index, bodies), rubbed);
                }
            };
            let mut moment = life.sum.take().and_then(|sum| sum.moment(ended, covered_s));
            if let Some(moment) = &mut moment {
                moment.doubt(&mut life.travelled_mps);
            }
            if moment.is_some() {
                life.last = ended;
            }
            if let Some(before) = life.pending.take() {
                let goes_on = moment.as_ref().is_some_and(|moment| {
                    // A slow way is a wandering of pressure as likely as not.
                    let both_mps = moment.rolling_mps.min(before.rolling_mps);
                    let next = moment.raw == before.raw && moment.index == before.index + 1;
                    next && (moment.raw != Some(Rubbing::Roll) || both_mps >= SURELY_MPS)
                });
                if goes_on {
                    life.held = before.raw;
                }
                told(before.index, before.told(life.held, bodies, self.moment_s));
            }
            let Some(moment) = moment else { continue };
            let slides = moment.raw == Some(Rubbing::Slide);
            let surely = life.held.is_none() && slides && moment.slip_mps >= SURELY_MPS;
            if surely {
                life.held = moment.raw;
            }
            if moment.raw == life.held {
                told(moment.index, moment.told(life.held, bodies, self.moment_s));
            } else if now == ended.saturating_add(1) {
                life.pending = Some(moment);
                left_pending = true;
                self.awake.push(bodies);
            } else {
                told(moment.index, moment.told(life.held, bodies, self.moment_s));
            }
        }
        self.settled = if left_pending { ended } else { now };
        self.pairs.retain(|_, life| {
            life.sum.is_some() || life.pending.is_some() || now.saturating_sub(life.last) <= FORGET
        });
    }
}

/// Finds points again among those that are followed, and adds how far they have come.
fn follow(tracks: &mut Vec<Track>, points: &[Touch], time_s: f64, sum: &mut Sum) {
    let nearest = |position: DVec3, of: &mut dyn Iterator<Item = DVec3>| {
        of.map(|other| other.distance_squared(position)).enumerate().min_by(|a, b| a.1.total_cmp(&b.1))
    };
    let of = |point: &Touch| Track {
        time_s,
        position: point.position,
        on_m: point.motion.map(|motion| (motion.on_m, motion.turns)),
    };
    let old = tracks.len();
    // Where nobody knows how the bodies move, a way between several points may be pressure that changes hands.
    let is_alone = points.len() == 1 && old <= 1;
    for (number, point) in points.iter().enumerate().take(MOST_TRACKS) {
        let before = &tracks[..old];
        let found = nearest(point.position, &mut before.iter().map(|track| track.position));
        // Each must be the nearest of the other, or a corner that comes down seems to have come from another.
        let mutual = found.filter(|(track, _)| {
            let back = nearest(before[*track].position, &mut points.iter().map(|point| point.position));
            back.is_some_and(|(nearest, _)| nearest == number)
        });
        let Some((index, _)) = mutual else {
            if tracks.len() < MOST_TRACKS {
                tracks.push(of(point));
            }
            continue;
        };
        let track = &mut tracks[index];
        let before = std::mem::replace(track, of(point));
        let span_s = time_s - before.time_s;
        let in_world = point.position - before.position;
        let way = match (point.motion, before.on_m) {
            // The mean of the ways over both, in the axes of the world.
            (Some(motion), Some((on_m, turns))) => {
                let over = |body: usize| {
                    let way = motion.on_m[body] - on_m[body];
                    0.5 * (motion.turns[body] * way + turns[body] * way)
                };
                0.5 * (over(0) + over(1))
            }
            _ => in_world,
        };
        let length = way.length();
        let most_m = point.motion.map_or(f64::INFINITY, |motion| {
            let [a, b] = motion.surfaces_mps.map(DVec3::length);
            2.0 * (a.max(b) + motion.reach_mps) * span_s + ROUNDING_M
        });
        if in_world.length() <= most_m && (is_alone || point.motion.is_some()) {
            sum.travel += way * point.impulse_ns;
            sum.way += length * point.impulse_ns;
            sum.travelled_s += span_s * point.impulse_ns;
        }
    }
}

impl Sum {
    fn add(&mut self, touch: &Touch) {
        let j = touch.impulse_ns;
        self.impulse_ns += j;
        self.slid += j * touch.slip_mps;
        self.position += j * touch.position;
        self.normal += touch.normal.map_or(DVec3::ZERO, |normal| j * normal);
        if let Some(motion) = touch.motion {
            self.moved_ns += j;
            (0..2).for_each(|body| {
                self.on[body] += j * motion.on_m[body];
            });
            self.reach += j * motion.reach_mps;
        }
        let [first, last] = self.lines.unwrap_or([touch.line; 2]);
        self.lines = Some([first.min(touch.line), last.max(touch.line)]);
    }

    /// What the pair did, if numbers say anything.
    fn moment(&self, index: i64, covered_s: f64) -> Option<Moment> {
        let slip_mps = self.slid / self.impulse_ns;
        let position_m = (self.position / self.impulse_ns).to_array();
        let force_n = self.impulse_ns / covered_s;
        // What goes to and fro stays where it is.
        let steady = self.travelled_s > 0.0 && self.travel.length() >= 0.5 * self.way;
        let point_mps = steady.then(|| self.travel / self.travelled_s);
        let moved = self.moved_ns > 0.0;
        let rolling_mps = match point_mps {
            // As of a block that carries the point along.
            None => slip_mps / 2.0,
            Some(point) if moved => {
                let normal = self.normal.try_normalize();
                let along = normal.map_or(point, |normal| point.reject_from_normalized(normal));
                along.length().min(self.reach / self.moved_ns + slip_mps / 2.0)
            }
            // One of them stands still, and the other goes the way of the point.
            Some(point) => (point.length() - slip_mps / 2.0).abs(),
        };
        let finite = [slip_mps, rolling_mps, force_n].into_iter().chain(position_m).all(f64::is_finite);
        let on_m = moved.then(|| self.on.map(|on| (on / self.moved_ns).to_array()));
        finite.then(|| Moment {
            index,
            raw: classify(Surface { slip_mps, rolling_mps }),
            slip_mps,
            rolling_mps,
            position_m,
            on_m: on_m.filter(|on| on.iter().flatten().all(|c| c.is_finite())),
            force_n,
            travels_mps: point_mps.filter(|_| !moved),
            lines: self.lines.unwrap_or_default(),
        })
    }
}

impl Moment {
    /// Where only the points' ways tell of rolling, they do so as they go on the same way as in the moment before: those of
    /// a pressure that wanders do not.
    fn doubt(&mut self, before_mps: &mut Option<DVec3>) {
        let before_mps = std::mem::replace(before_mps, self.travels_mps);
        let Some(now_mps) = self.travels_mps.filter(|_| self.raw == Some(Rubbing::Roll)) else { return };
        let goes_on = before_mps.is_some_and(|before_mps| {
            let (before, now) = (before_mps.length(), now_mps.length());
            before_mps.dot(now_mps) > 0.8 * before * now && before < 1.5 * now && now < 1.5 * before
        });
        if !goes_on {
            self.raw = (self.slip_mps >= LEAST_MPS).then_some(Rubbing::Slide);
        }
    }

    /// The moment as one of what the pair is held to do; nothing at rest.
    fn told(&self, held: Option<Rubbing>, bodies: [u32; 2], moment_s: f64) -> Option<Rubbed> {
        let how = held?;
        let speed_mps = match how {
            Rubbing::Slide => self.slip_mps,
            Rubbing::Roll => self.rolling_mps,
        };
        (speed_mps >= LEAST_MPS).then_some(Rubbed {
            how,
            time_s: (self.index as f64 + 0.5) * moment_s,
            lasts_s: moment_s,
            bodies,
            position_m: self.position_m,
            on_m: self.on_m,
            speed_mps,
            force_n: self.force_n,
            lines: self.lines,
        })
    }
}

#[cfg(test)]
mod tests;
