//! How bodies that touch move along each other, moment by moment, and how hard they press.

use glam::DVec3;

use super::Analyser;
use super::body::{Mover, held};
use super::interval::two;
use super::load::{Joint, Need, share};
use crate::motion::event::{Event, Rub};
use crate::motion::rub::{Rubbing, Surface, classify};
use crate::motion::slide::MOMENT_S;

/// What moves along each other more slowly, in metres a second, rests; frames tell no more of it than their noise.
const LEAST_RUB_MPS: f64 = 0.005;
/// What rubs already goes on until it is slower than this part of that.
const GOES_ON: f64 = 0.6;
/// By how much slip must differ to be taken for the other way of rubbing.
const KEEPS: f64 = 0.75;

/// What moves more slowly than this, in metres a second, stands still until it is hit.
const STANDS_MPS: f64 = 0.02;

/// How a body moves within an interval.
struct Moving {
    at: DVec3,
    velocity: DVec3,
    spin: DVec3,
}

impl Mover {
    /// How it moves at a time within the interval from a frame, as it is seen at both ends.
    fn moving(&self, frame: usize, from_s: f64, to_s: f64, time_s: f64) -> Moving {
        let (Some(start), Some(end)) = (self.pose(frame), self.pose(frame + 1)) else {
            return Moving { at: self.piece.at, velocity: DVec3::ZERO, spin: DVec3::ZERO };
        };
        if !self.body.moves {
            return Moving { at: start.at, velocity: DVec3::ZERO, spin: DVec3::ZERO };
        }
        if let Some(hit) = self.hit {
            if time_s < hit.first_s {
                let piece = &hit.before;
                return Moving {
                    at: piece.pose(time_s).at,
                    velocity: piece.velocity(time_s),
                    spin: piece.spin,
                };
            }
            let after_s = to_s - hit.last_s;
            let there = self.piece.pose(hit.last_s);
            if after_s > 0.25 * (to_s - from_s) {
                let velocity = (end.at - there.at) / after_s;
                let spin = super::pose::turned(there.turn, end.turn) / after_s;
                return Moving { at: there.at + velocity * (time_s - hit.last_s), velocity, spin };
            }
            let next = self.track.step(frame + 1);
            let velocity = next.map_or(self.piece.velocity, |step| step.velocity);
            let spin = next.map_or(self.piece.spin, |step| step.spin);
            return Moving { at: end.at - velocity * (to_s - time_s), velocity, spin };
        }
        let Some(step) = self.track.step(frame) else {
            return Moving { at: end.at, velocity: DVec3::ZERO, spin: DVec3::ZERO };
        };
        // What was still until something hit what it stands on did not move before.
        if let Some(wakes_s) = self.wakes_s.filter(|wakes_s| to_s - wakes_s > 0.1 * step.lasts_s) {
            if time_s < wakes_s {
                return Moving { at: start.at, velocity: DVec3::ZERO, spin: DVec3::ZERO };
            }
            let more = step.lasts_s / (to_s - wakes_s);
            let velocity = step.velocity * more;
            return Moving { at: end.at - velocity * (to_s - time_s), velocity, spin: step.spin * more };
        }
        let from_middle_s = time_s - 0.5 * (from_s + to_s);
        let acceleration = self.track.smooth_acceleration(frame).unwrap_or(DVec3::ZERO);
        let twist = match frame.checked_sub(1).and_then(|before| self.track.step(before)) {
            Some(before) if before.broke_s.is_none() => {
                (step.spin - before.spin) * (2.0 / (step.lasts_s + before.lasts_s))
            }
            _ => DVec3::ZERO,
        };
        let s = time_s - from_s;
        Moving {
            at: start.at
                + (step.velocity - acceleration * (0.5 * step.lasts_s)) * s
                + acceleration * (0.5 * s * s),
            velocity: step.velocity + acceleration * from_middle_s,
            spin: step.spin + twist * from_middle_s,
        }
    }
}

impl Analyser {
    /// Finds how hard all that touch press on each other.
    pub(super) fn press(&mut self, frame: usize) {
        let touching = || self.pairs.iter().filter(|(_, pair)| pair.touches);
        let mut joints: Vec<Joint> = touching()
            .filter_map(|(bodies, pair)| {
                let bodies = bodies.map(|body| body as usize);
                Some(Joint { bodies, normal: pair.last?.normal, force_n: pair.force_n })
            })
            .collect();
        if joints.is_empty() {
            return;
        }
        let mut needs: Vec<Need> = self
            .movers
            .iter()
            .map(|mover| {
                if mover.inverse_mass <= 0.0 {
                    return Need::default();
                }
                let smooth = mover.track.smooth_acceleration(frame);
                let acceleration = smooth.unwrap_or_else(|| held(self.gravity, &mover.supports[0]));
                Need {
                    inverse_mass: mover.inverse_mass,
                    force: (acceleration - self.gravity) / mover.inverse_mass,
                }
            })
            .collect();
        share(&mut joints, &mut needs);
        let pairs = self.pairs.values_mut().filter(|pair| pair.touches && pair.last.is_some());
        for (pair, joint) in pairs.zip(&joints) {
            pair.force_n = joint.force_n;
        }
    }

    /// Finds when bodies that stood still were woken by a hit, through whatever they touch.
    fn wake(&mut self) {
        let stands = |mover: &Mover| {
            let turning_mps = mover.piece.spin.length() * mover.body.shape.reach_m();
            mover.body.moves && mover.piece.velocity.length() + turning_mps < STANDS_MPS
        };
        loop {
            let mut changes = false;
            for (bodies, _) in self.pairs.iter().filter(|(_, pair)| pair.touches) {
                for [one, other] in
                    [*bodies, [bodies[1], bodies[0]]].map(|pair| pair.map(|body| body as usize))
                {
                    let cause = &self.movers[one];
                    let since_s = cause.hit.map(|hit| hit.first_s).or(cause.wakes_s);
                    let mover = &self.movers[other];
                    let Some(since_s) = since_s.filter(|_| mover.hit.is_none() && stands(mover)) else {
                        continue;
                    };
                    if mover.wakes_s.is_none_or(|wakes_s| since_s < wakes_s) {
                        self.movers[other].wakes_s = Some(since_s);
                        changes = true;
                    }
                }
            }
            if !changes {
                return;
            }
        }
    }

    /// Tells of every moment of an interval in which bodies slide or roll along each other.
    pub(super) fn rubs(&mut self, frame: usize, from_s: f64, to_s: f64, events: &mut Vec<Event>) {
        let touching: Vec<[u32; 2]> =
            self.pairs.iter().filter(|(_, pair)| pair.touches).map(|(bodies, _)| *bodies).collect();
        self.wake();
        // Moments lie where they do whatever the frames are; the first that ends in this interval.
        let first = (from_s / MOMENT_S - 0.5).floor() as i64;
        for bodies in touching {
            for moment in first.. {
                let time_s = (moment as f64 + 0.5) * MOMENT_S;
                if time_s > to_s {
                    break;
                }
                if time_s > from_s {
                    events.extend(self.rub(bodies, frame, from_s, to_s, time_s));
                }
            }
        }
    }

    fn rub(&mut self, bodies: [u32; 2], frame: usize, from_s: f64, to_s: f64, time_s: f64) -> Option<Event> {
        let movers = two(&self.movers, bodies);
        let pair = self.pairs.get(&bodies)?;
        if time_s < pair.since_s {
            return None;
        }
        let last = pair.last?;
        let moving = movers.map(|mover| mover.moving(frame, from_s, to_s, time_s));
        // The place is followed in the company of the smaller body that moves.
        let size = |side: usize| {
            if movers[side].body.moves { movers[side].body.shape.reach_m() } else { f64::INFINITY }
        };
        let lead = usize::from(size(1) < size(0));
        let arm =
            |touch: super::proximity::Touch, frame: usize| Some(touch.point - movers[lead].pose(frame)?.at);
        let end = arm(last, frame + 1)?;
        let start = pair.before.filter(|_| pair.since_s <= from_s).and_then(|touch| arm(touch, frame));
        let start = start.unwrap_or(end);
        let part = (time_s - from_s) / (to_s - from_s);
        let place = moving[lead].at + start.lerp(end, part);
        let place_mps = moving[lead].velocity + (end - start) / (to_s - from_s);
        let normal = pair
            .before
            .map_or(last.normal, |touch| touch.normal.lerp(last.normal, part))
            .normalize_or(last.normal);
        let [va, vb] =
            [0, 1].map(|side| moving[side].velocity + moving[side].spin.cross(place - moving[side].at));
        let mut surface = Surface::new(va.to_array(), vb.to_array(), place_mps.to_array(), normal.to_array());
        // A place moves along both only as fast as they turn against each other, and over corners it leaps.
        let round =
            movers.iter().filter(|mover| mover.body.shape.is_round()).map(|mover| mover.body.shape.reach_m());
        let turning = (moving[0].spin - moving[1].spin).reject_from_normalized(normal).length();
        surface.rolling_mps = surface.rolling_mps.min(1.5 * turning * round.fold(0.0, f64::max));
        let goes_on = pair.rubbing.is_some();
        let least_mps = LEAST_RUB_MPS * if goes_on { GOES_ON } else { 1.0 };
        let asked = match pair.rubbing {
            Some(Rubbing::Roll) => Surface { slip_mps: surface.slip_mps * KEEPS, ..surface },
            Some(Rubbing::Slide) => Surface { slip_mps: surface.slip_mps / KEEPS, ..surface },
            None => surface,
        };
        let speed_mps = |how| match how {
            Rubbing::Slide => surface.slip_mps,
            Rubbing::Roll => surface.rolling_mps,
        };
        let rubbing = classify(asked).filter(|&how| speed_mps(how) >= least_mps);
        let force_n = pair.force_n;
        let on = [0, 1].map(|side| {
            // Within a frame the turn goes evenly.
            let (start, end) = (movers[side].pose(frame), movers[side].pose(frame + 1));
            let turn =
                start.zip(end).map_or(glam::DQuat::IDENTITY, |(start, end)| start.turn.slerp(end.turn, part));
            movers[side].on(place, &super::pose::Pose { at: moving[side].at, turn })
        });
        let names = movers.map(|mover| mover.body.name.clone());
        let cause = self.cause(frame);
        self.pairs.get_mut(&bodies)?.rubbing = rubbing;
        let how = rubbing?;
        let swap = names[0] > names[1];
        let [one, other] = names;
        let (a, b, on_m) = if swap { (other, one, [on[1], on[0]]) } else { (one, other, on) };
        let rub = Rub {
            time_s,
            lasts_s: MOMENT_S,
            a,
            b,
            position_m: place.to_array(),
            on_m: Some(on_m),
            speed_mps: speed_mps(how),
            force_n,
            cause,
        };
        Some(Event::rubbing(how, rub))
    }
}
