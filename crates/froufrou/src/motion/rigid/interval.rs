//! The way through one interval between two frames: which bodies hit each other, in the order in which they do.
//!
//! Every body goes on as it came. Where two that are near would enter each other, the earliest such hit is taken: what
//! the frames behind tell of the gap says how it opens again, the impulse is the change of the closing speed times the
//! mass that the two set against it there, and both bodies go on from it along the normal. Then the next hit is sought,
//! until there is none before the next frame, where all are again where they are seen.

use std::cmp::Ordering;

use glam::DVec3;

use super::body::{Hit, Mover, held};
use super::proximity::{Touch, Two, pairs};
use super::rebound::{STAYS, Seen};
use super::{Analyser, LEAST_IMPACT_MPS};
use crate::motion::event::{Cause, Event, Impact, Moved};
use crate::motion::rub::Rubbing;

/// Bodies nearer than this touch, in metres, ...
const TOUCH_M: f64 = 1e-3;
/// ... and this part of the smaller's size more, up to [`MOST_TOUCH_M`].
const TOUCH_PART: f64 = 0.01;
const MOST_TOUCH_M: f64 = 5e-3;
/// Bodies that are deeper in each other than this, and that part of the smaller's size, do not touch: they were
/// animated as one.
const DEEP_M: f64 = 2e-3;
const DEEP_PART: f64 = 0.05;
/// What comes and goes faster than this, in metres a second, does not rest.
const QUIET_MPS: f64 = 0.1;
/// Two bodies enter each other where the gap is so far below what it was, in metres.
const ENTERED_M: f64 = 2e-5;
/// Of a hull that rolls on its corners, this part of its size as well.
const CORNERS: f64 = 0.015;
/// Hits of one pair in one interval.
const MOST_HITS: u32 = 32;
/// How long it is remembered how two bodies bounced, in seconds.
const REMEMBERS_S: f64 = 3.0;
/// What flies comes to where it was told to, but for this part of what gravity does on the way.
const FLIES: f64 = 0.3;
/// A gap must have closed at this part of the speed at which it is told to.
const CAME: f64 = 0.3;

/// Two bodies that are near each other.
#[derive(Debug, Clone)]
pub(super) struct Pair {
    /// Where they touch at the last frame.
    pub last: Option<Touch>,
    /// The same at the frame before.
    pub before: Option<Touch>,
    /// Whether they touch between these frames.
    pub touches: bool,
    /// Within the interval: from when on they do.
    pub since_s: f64,
    /// Hits within the interval.
    hits: u32,
    /// Not asked again within the interval.
    settled: bool,
    /// How hard they press.
    pub force_n: f64,
    /// How they rub at each other.
    pub rubbing: Option<Rubbing>,
}

/// How two bodies bounced when it was seen last.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bounce {
    /// What part of their closing speed they open with, where it was told.
    restitution: Option<f64>,
    /// The frame before their last hit.
    frame: usize,
    /// When it is forgotten.
    pub until_s: f64,
}

/// Where and when two bodies hit.
#[derive(Debug, Clone, Copy)]
struct Meeting {
    time_s: f64,
    touch: Touch,
    /// How fast they close.
    closing_mps: f64,
}

/// Two bodies out of many.
pub(super) fn two<T>(all: &[T], [a, b]: [u32; 2]) -> [&T; 2] {
    [&all[a as usize], &all[b as usize]]
}

/// The size of the smaller of two bodies.
fn smaller_m(movers: [&Mover; 2]) -> f64 {
    movers[0].body.shape.reach_m().min(movers[1].body.shape.reach_m())
}

fn touch_m(movers: [&Mover; 2]) -> f64 {
    (TOUCH_M + TOUCH_PART * smaller_m(movers)).min(MOST_TOUCH_M)
}

fn deep_m(movers: [&Mover; 2]) -> f64 {
    DEEP_M + DEEP_PART * smaller_m(movers)
}

fn shapes<'a>(movers: [&'a Mover; 2], poses: [&'a super::pose::Pose; 2]) -> Two<'a> {
    Two { shapes: movers.map(|mover| &mover.body.shape), poses }
}

impl Analyser {
    /// Goes through the next interval.
    pub(super) fn interval(&mut self) {
        let frame = self.next;
        self.next += 1;
        let (Some(from_s), Some(to_s)) = (self.time_s(frame), self.time_s(frame + 1)) else { return };
        for mover in &mut self.movers {
            mover.begin(frame, from_s, self.gravity);
        }
        self.bounces.retain(|_, bounce| bounce.until_s > from_s);
        self.meet(frame, to_s);
        let mut events = self.hits(frame, from_s, to_s);
        self.hold(frame, from_s, to_s);
        self.press(frame);
        self.rubs(frame, from_s, to_s, &mut events);
        events.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
        self.found.extend(events);
        for mover in &mut self.movers {
            mover.leave(frame, to_s);
        }
    }

    /// Finds who is near whom in an interval, and where they touch at its end.
    fn meet(&mut self, frame: usize, to_s: f64) {
        let bounds: Vec<[DVec3; 2]> = self.movers.iter().map(|mover| mover.swept(frame, to_s)).collect();
        let moves: Vec<bool> = self.movers.iter().map(|mover| mover.body.moves).collect();
        let near = pairs(&bounds, &moves);
        let mut old = std::mem::take(&mut self.pairs);
        for bodies in near {
            let movers = two(&self.movers, bodies);
            let within_m = 2.0 * touch_m(movers);
            let prober = &mut self.prober;
            let mut at = |frame: usize| {
                let poses = [movers[0].pose(frame)?, movers[1].pose(frame)?];
                prober.touch(shapes(movers, poses), within_m)
            };
            let now = at(frame + 1);
            let pair = match old.remove(&bodies) {
                Some(pair) => Pair { before: pair.last, last: now, hits: 0, settled: false, ..pair },
                None => Pair {
                    before: at(frame),
                    last: now,
                    touches: false,
                    since_s: 0.0,
                    hits: 0,
                    settled: false,
                    force_n: 0.0,
                    rubbing: None,
                },
            };
            self.pairs.insert(bodies, pair);
        }
    }

    /// Goes from hit to hit.
    fn hits(&mut self, frame: usize, from_s: f64, to_s: f64) -> Vec<Event> {
        let mut events = Vec::new();
        let keys: Vec<[u32; 2]> = self.pairs.keys().copied().collect();
        let mut meetings: Vec<Option<Meeting>> = Vec::with_capacity(keys.len());
        for bodies in &keys {
            meetings.push(self.meeting(*bodies, frame, from_s, to_s));
        }
        // Whose meetings have to be sought anew, by body.
        loop {
            let earlier = |a: &(usize, Meeting), b: &(usize, Meeting)| -> Ordering {
                a.1.time_s.total_cmp(&b.1.time_s).then(a.0.cmp(&b.0))
            };
            let all = meetings.iter().enumerate().filter_map(|(index, m)| Some((index, (*m)?)));
            let Some((index, meeting)) = all.min_by(earlier) else { return events };
            let bodies = keys[index];
            let came_of_it = self.collide(bodies, meeting, frame, to_s);
            meetings[index] = None;
            if let Some(impact) = came_of_it {
                events.extend(impact.map(Event::Impact));
                for (other, keyed) in keys.iter().enumerate() {
                    let shares = keyed
                        .iter()
                        .any(|body| bodies.contains(body) && self.movers[*body as usize].inverse_mass > 0.0);
                    if shares {
                        meetings[other] = self.meeting(*keyed, frame, meeting.time_s, to_s);
                    }
                }
            }
        }
    }

    /// Where two bodies enter each other first, if they do, as they go on from a moment.
    fn meeting(&mut self, bodies: [u32; 2], frame: usize, from_s: f64, to_s: f64) -> Option<Meeting> {
        let pair = self.pairs.get(&bodies)?;
        let movers = two(&self.movers, bodies);
        if pair.settled || pair.hits >= MOST_HITS || movers.iter().any(|mover| !mover.is_known) {
            return None;
        }
        if pair.before.is_some_and(|touch| touch.gap_m < -deep_m(movers)) {
            return None;
        }
        let prober = &mut self.prober;
        let mut near = |time_s: f64, within_m: f64| {
            let poses = movers.map(|mover| mover.piece.pose(time_s));
            prober.nearest(shapes(movers, [&poses[0], &poses[1]]), within_m)
        };
        let lasts_s = to_s - from_s;
        if lasts_s <= 0.0 {
            return None;
        }
        let speed = |time_s: f64| {
            (movers[0].piece.velocity(time_s) - movers[1].piece.velocity(time_s)).length()
                + movers
                    .iter()
                    .map(|mover| mover.piece.spin.length() * mover.body.shape.reach_m())
                    .sum::<f64>()
        };
        let way_m = speed(from_s).max(speed(to_s)) * lasts_s;
        if !way_m.is_finite() {
            return None;
        }
        let here = near(from_s, way_m + 1e-3)?;
        let corners = if pair.touches
            && movers.iter().any(|m| m.body.shape.is_round() && m.body.shape.radius_m().is_none())
        {
            CORNERS * smaller_m(movers)
        } else {
            0.0
        };
        let deepest_m = here.gap_m.min(0.0) - ENTERED_M - corners;
        // So densely that nothing goes through a floor unseen.
        let moving = movers.iter().filter(|mover| mover.body.moves).map(|mover| mover.body.shape.reach_m());
        let least_m = moving.fold(f64::INFINITY, f64::min).max(1e-4);
        let steps = (2.0 * way_m / least_m).ceil().clamp(1.0, 32.0) as u32;
        let mut outside_s = from_s;
        let mut inside = None;
        for step in 1..=steps {
            let time_s = from_s + lasts_s * f64::from(step) / f64::from(steps);
            match near(time_s, 1e-3) {
                Some(touch) if touch.gap_m < deepest_m => {
                    inside = Some((time_s, touch));
                    break;
                }
                _ => outside_s = time_s,
            }
        }
        let (mut inside_s, mut touch) = inside?;
        while inside_s - outside_s > 1e-8 {
            let time_s = 0.5 * (inside_s + outside_s);
            match near(time_s, 1e-3) {
                Some(there) if there.gap_m < deepest_m => (inside_s, touch) = (time_s, there),
                _ => outside_s = time_s,
            }
        }
        let [a, b] = movers.map(|mover| mover.piece.velocity_of(touch.point, inside_s));
        let entering_mps = (a - b).dot(touch.normal);
        if entering_mps <= 0.0 {
            return None;
        }
        // Back to where they touched.
        let time_s = (inside_s + touch.gap_m.min(0.0) / entering_mps).max(from_s);
        // The place has gone on meanwhile.
        let then = near(time_s, 1e-3).filter(|then| then.normal.dot(touch.normal) > 0.9);
        let touch = Touch { point: then.map_or(touch.point, |then| then.point), ..touch };
        let pull = (movers[0].piece.acceleration - movers[1].piece.acceleration).dot(touch.normal);
        let closing_mps = entering_mps - pull * (inside_s - time_s);
        // What bounces until it is no more heard has to come to rest; what rests already does not matter.
        if closing_mps < LEAST_IMPACT_MPS && (closing_mps <= 0.0 || !self.has_just_hit(bodies, frame)) {
            return None;
        }
        let meeting = Meeting { time_s, touch, closing_mps };
        self.came(bodies, frame, &meeting).then_some(meeting)
    }

    /// Whether two bodies have hit in one of the last intervals.
    fn has_just_hit(&self, bodies: [u32; 2], frame: usize) -> bool {
        self.bounces.get(&bodies).is_some_and(|bounce| bounce.frame + 3 >= frame)
    }

    /// Whether the frames before show that two bodies came towards each other where they are told to meet: what rests
    /// on each other does not, whatever is made of its accelerations.
    fn came(&self, bodies: [u32; 2], frame: usize, meeting: &Meeting) -> bool {
        let movers = two(&self.movers, bodies);
        if self.has_just_hit(bodies, frame) {
            return true;
        }
        let Some(before) = frame.checked_sub(1) else { return false };
        let (Some(then_s), Some(poses)) =
            (self.time_s(before), movers[0].pose(before).zip(movers[1].pose(before)))
        else {
            return false;
        };
        let feature = Feature::new(movers, meeting);
        feature.gap_m([poses.0, poses.1]) >= CAME * meeting.closing_mps * (meeting.time_s - then_s)
    }

    /// Lets two bodies hit; nothing where the frames say that they do not, and no impact where it is not heard.
    fn collide(
        &mut self,
        bodies: [u32; 2],
        meeting: Meeting,
        frame: usize,
        to_s: f64,
    ) -> Option<Option<Impact>> {
        let movers = two(&self.movers, bodies);
        let Meeting { time_s, touch, closing_mps } = meeting;
        let feature = Feature::new(movers, &meeting);
        let seen_at = |frame: usize, time_s: f64| {
            let poses = [movers[0].pose(frame)?, movers[1].pose(frame)?];
            Some(((time_s - meeting.time_s).max(1e-9), feature.gap_m(poses)))
        };
        let next = seen_at(frame + 1, to_s)?;
        let jumps = movers.iter().any(|mover| mover.body.moves && mover.track.step(frame + 1).is_none());
        let then_s = self.time_s(frame + 2).filter(|_| !jumps);
        let then = then_s.and_then(|then_s| seen_at(frame + 2, then_s));
        let both_round =
            movers.iter().all(|mover| mover.body.shape.radius_m().is_some() || !mover.body.moves);
        let seen = Seen {
            closing_mps,
            acceleration: (movers[1].piece.acceleration - movers[0].piece.acceleration).dot(touch.normal),
            next,
            then,
            restitution: self.bounces.get(&bodies).and_then(|bounce| bounce.restitution),
            repeats: both_round,
        };
        let is_heard = closing_mps >= LEAST_IMPACT_MPS;
        let rebound = if is_heard { seen.rebound() } else { STAYS };
        let inverse: f64 = movers
            .iter()
            .map(|mover| {
                let arm = touch.point - mover.piece.pose(time_s).at;
                let spin = mover.turned_by(touch.normal, touch.point, time_s);
                mover.inverse_mass + spin.cross(arm).dot(touch.normal)
            })
            .sum();
        // They went on into each other: animated so.
        let (after_s, width_m) = next;
        let passes = width_m < -(0.5 * closing_mps * after_s).max(DEEP_M)
            && then.is_none_or(|(_, then_m)| then_m < width_m);
        // Faster than they came: something else moves them.
        let gains = rebound.opening_mps > 1.1 * closing_mps + LEAST_IMPACT_MPS;
        let known = movers.map(|mover| mover.inverse_mass);
        let pair = self.pairs.get_mut(&bodies)?;
        if passes || gains || inverse <= 0.0 {
            pair.settled = true;
            return None;
        }
        let impulse_ns = (closing_mps + rebound.opening_mps) / inverse;
        pair.hits += 1;
        if is_heard {
            let height_m = rebound.opening_mps.powi(2) / 20.0;
            let tells = rebound.is_measured && both_round && rebound.misfit_m < 1e-5 + 0.02 * height_m;
            let until_s = time_s + REMEMBERS_S;
            let bounce = self.bounces.entry(bodies).or_insert(Bounce { restitution: None, frame, until_s });
            (bounce.frame, bounce.until_s) = (frame, until_s);
            if tells {
                bounce.restitution = Some(rebound.opening_mps / closing_mps);
            }
        }
        let stays = rebound.opening_mps <= 0.0;
        if stays {
            (pair.settled, pair.touches, pair.since_s) = (true, true, time_s);
        } else {
            pair.touches = false;
        }
        let [va, vb] = movers.map(|mover| mover.piece.velocity_of(touch.point, time_s));
        let across = va - vb - touch.normal * (va - vb).dot(touch.normal);
        let impact = is_heard.then(|| self.told(bodies, &meeting, impulse_ns, across.length(), frame));
        for (side, body) in bodies.into_iter().enumerate().filter(|(side, _)| known[*side] > 0.0) {
            let mover = &mut self.movers[body as usize];
            let push = touch.normal * if side == 0 { -impulse_ns } else { impulse_ns };
            let spin = mover.turned_by(push, touch.point, time_s);
            let before = mover.piece;
            mover.piece = before.from(time_s);
            mover.piece.velocity += push * mover.inverse_mass;
            mover.piece.spin += spin;
            if stays {
                mover.piece.acceleration = held(mover.piece.acceleration, &[push.normalize_or_zero()]);
            }
            let first = mover.hit.map_or((time_s, before), |hit| (hit.first_s, hit.before));
            mover.hit = Some(Hit { first_s: first.0, last_s: time_s, before: first.1, normal: touch.normal });
            mover.track.break_at(frame, time_s);
        }
        Some(impact)
    }

    /// An impact as it is told: the bodies in the order of their names.
    fn told(
        &self,
        bodies: [u32; 2],
        meeting: &Meeting,
        impulse_ns: f64,
        tangential_mps: f64,
        frame: usize,
    ) -> Impact {
        let movers = two(&self.movers, bodies);
        let place = meeting.touch.point;
        let on = movers.map(|mover| mover.on(place, &mover.piece.pose(meeting.time_s)));
        let swap = movers[0].body.name > movers[1].body.name;
        let ([a, b], on_m, sign) =
            if swap { ([1, 0], [on[1], on[0]], -1.0) } else { ([0, 1], [on[0], on[1]], 1.0) };
        Impact {
            time_s: meeting.time_s,
            a: movers[a].body.name.clone(),
            b: movers[b].body.name.clone(),
            position_m: place.to_array(),
            on_m: Some(on_m),
            impulse_ns,
            normal: Some((meeting.touch.normal * sign).to_array()),
            speed_mps: Some(meeting.closing_mps),
            tangential_mps: Some(tangential_mps),
            cause: self.cause(frame),
        }
    }

    /// The interval that begins with a frame.
    pub(super) fn cause(&self, frame: usize) -> Cause {
        let at = |frame| self.time_s(frame).unwrap_or_default();
        Cause::Motion(Moved { from_s: at(frame), to_s: at(frame + 1) })
    }

    /// Says which pairs touch until the end of the interval, and what bodies rest on.
    fn hold(&mut self, frame: usize, from_s: f64, to_s: f64) {
        for mover in &mut self.movers {
            mover.supports.rotate_right(1);
            mover.supports[0].clear();
        }
        for (bodies, pair) in &mut self.pairs {
            let movers = two(&self.movers, *bodies);
            let (near_m, deep_m) = (touch_m(movers), deep_m(movers));
            let is_at = |touch: &Touch| touch.gap_m <= near_m && touch.gap_m >= -deep_m;
            let jumps = movers.iter().any(|mover| mover.track.jumps(frame));
            let landed = pair.settled && pair.touches && pair.hits > 0;
            let stays = match (pair.before.filter(is_at), pair.last.filter(is_at)) {
                _ if jumps => false,
                (_, Some(_)) if landed => true,
                (Some(before), Some(last)) if pair.hits == 0 => {
                    pair.since_s = from_s;
                    let lasts_s = to_s - from_s;
                    let went_m = last.gap_m - before.gap_m;
                    // What is so near may still be flying.
                    let [va, vb] = movers.map(|mover| mover.piece.velocity_of(before.point, from_s));
                    let pull =
                        (movers[1].piece.acceleration - movers[0].piece.acceleration).dot(before.normal);
                    let falls_m = 0.5 * pull * lasts_s * lasts_s;
                    let told_m = (vb - va).dot(before.normal) * lasts_s + falls_m;
                    let is_known = movers.iter().all(|mover| mover.is_known);
                    let flies = is_known && !pair.touches && (went_m - told_m).abs() <= FLIES * falls_m.abs();
                    !flies && went_m.abs() <= QUIET_MPS * lasts_s
                }
                _ => false,
            };
            pair.touches = stays;
            if let Some(touch) = pair.last.filter(|_| stays) {
                let [a, b] = bodies.map(|body| body as usize);
                self.movers[a].supports[0].push(-touch.normal);
                self.movers[b].supports[0].push(touch.normal);
            } else {
                (pair.force_n, pair.rubbing) = (0.0, None);
            }
        }
    }
}

/// The two places that meet in a hit, of which the frames before and behind tell how far they are apart.
struct Feature {
    normal: DVec3,
    /// Of each body: the place in its frame, or its radius if it is a ball.
    places: [Result<DVec3, f64>; 2],
    /// What they are apart when they touch, which is nothing but for small errors.
    zero_m: f64,
}

impl Feature {
    fn new(movers: [&Mover; 2], meeting: &Meeting) -> Self {
        let Meeting { time_s, touch, .. } = *meeting;
        let poses = movers.map(|mover| mover.piece.pose(time_s));
        let place = |side: usize| {
            movers[side].body.shape.radius_m().map_or_else(|| Ok(poses[side].local(touch.point)), Err)
        };
        let mut feature = Self { normal: touch.normal, places: [place(0), place(1)], zero_m: 0.0 };
        feature.zero_m = feature.gap_m([&poses[0], &poses[1]]);
        feature
    }

    fn gap_m(&self, poses: [&super::pose::Pose; 2]) -> f64 {
        if let [Err(one_m), Err(other_m)] = self.places {
            return poses[0].at.distance(poses[1].at) - one_m - other_m - self.zero_m;
        }
        let at = |side: usize| match self.places[side] {
            Ok(local) => poses[side].out(local),
            Err(radius_m) => poses[side].at + self.normal * if side == 0 { radius_m } else { -radius_m },
        };
        (at(1) - at(0)).dot(self.normal) - self.zero_m
    }
}

impl Mover {
    /// A place of the world in the frame of the body, in metres.
    pub fn on(&self, place: DVec3, centre: &super::pose::Pose) -> [f64; 3] {
        (centre.local(place) + self.body.shape.centre()).to_array()
    }

    /// A box that holds it throughout an interval, as it is seen and as it would go on.
    fn swept(&self, frame: usize, to_s: f64) -> [DVec3; 2] {
        let shape = &self.body.shape;
        let first = self.pose(frame).map(|pose| shape.bounds(pose));
        if !self.body.moves {
            return first.unwrap_or([DVec3::ZERO; 2]);
        }
        let poses = [self.pose(frame + 1).copied(), self.is_known.then(|| self.piece.pose(to_s))];
        let all = poses.iter().flatten().map(|pose| shape.bounds(pose)).chain(first);
        let swept = all.reduce(|[low, high], [l, h]| [low.min(l), high.max(h)]).unwrap_or([DVec3::ZERO; 2]);
        [swept[0] - 2.0 * MOST_TOUCH_M, swept[1] + 2.0 * MOST_TOUCH_M]
    }

    /// Ends an interval: where it goes on to if it was hit.
    fn leave(&mut self, frame: usize, to_s: f64) {
        self.leaves = None;
        let (Some(hit), Some(end)) = (self.hit, self.pose(frame + 1).copied()) else { return };
        let after_s = to_s - hit.last_s;
        let goes_on = (self.piece.velocity(to_s), self.piece.spin);
        let acceleration = self.piece.acceleration;
        let start = self.piece.pose(hit.last_s);
        let mut here = None;
        let lasts_s = self.track.step(frame).map_or(f64::INFINITY, |step| step.lasts_s);
        if after_s > 0.3 * lasts_s {
            let velocity = (end.at - start.at) / after_s + acceleration * (0.5 * after_s);
            here = Some((velocity, super::pose::turned(start.turn, end.turn) / after_s));
        }
        let next = self
            .track
            .step(frame + 1)
            .map(|step| (step.velocity - acceleration * (0.5 * step.lasts_s), step.spin));
        let agrees = |one: DVec3, other: DVec3| (one - other).length() < 0.05 + 0.05 * other.length();
        let along = |v: DVec3| v.dot(hit.normal);
        // Where it comes to where it was told to along the normal, it is as fast there as it was told to be.
        let off_m = along(self.piece.pose(to_s).at - end.at).abs();
        let is_told = off_m < 5e-5 + 0.01 * along(end.at - start.at).abs();
        let seen = match (next, here) {
            (Some(next), Some(here)) if agrees(next.0, here.0) => next,
            (Some(next), None) => next,
            (_, Some(here)) => here,
            _ => goes_on,
        };
        let velocity = if is_told { seen.0 + hit.normal * along(goes_on.0 - seen.0) } else { seen.0 };
        self.leaves = Some((velocity, seen.1));
    }
}
