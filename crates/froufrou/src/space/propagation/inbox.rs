//! The lines of a score as they come in.

use std::collections::{BTreeMap, VecDeque};

use super::super::microphone::length;
use super::Due;
use super::ear::Ear;
use crate::score::{
    Cue, LATEST_S, LONGEST_DELAY_S, ObjectLine, Placement, Pose, Statement, Verb, Whereabouts,
};
use crate::synth::path::Foresight;
use crate::{Error, Result};

/// A source that covers more than this part of the speed of sound between two keys has jumped: no
/// pitch could follow it.
const JUMP_SPEED: f64 = 0.5;

/// What is told as it happens is under way for no longer, in seconds: all of its way has to be remembered so long.
const LONGEST_TOLD_S: f64 = 10.0;

/// Nothing is further from the origin than this in any direction, in metres; a double tells a tenth
/// of a metre apart there.
const FARTHEST_M: f64 = 1e15;

/// The lines as they come in: those of the microphones become their ways, those of threads wait for
/// their time.
pub(super) struct Inbox<L> {
    pub(super) lines: L,
    pub(super) next: Option<ObjectLine>,
    pub(super) speed_of_sound_mps: f64,
    pub(super) ears: Vec<Ear>,
    pub(super) waiting: BTreeMap<u64, Waiting>,
    /// What the threads are told, until its time has come.
    pub(super) cues: BTreeMap<u64, VecDeque<Cue>>,
    pub(super) begun: Vec<(f64, u64, Due)>,
    /// What it may read of what comes later.
    pub(super) foresight: Foresight,
}

/// What a thread has still to do.
pub(super) struct Waiting {
    pub(super) lines: VecDeque<Statement<Placement>>,
    /// Time and place of the last line read.
    pub(super) last: (f64, Whereabouts),
    /// True once that line is the end.
    pub(super) ended: bool,
}

impl<L: Iterator<Item = Result<ObjectLine>>> Inbox<L> {
    /// The time of the next line that has not been taken in.
    pub(super) fn peek_s(&mut self) -> Result<Option<f64>> {
        if self.next.is_none() {
            self.next = self.lines.next().transpose()?;
            if self.next.is_none() {
                self.ears.iter_mut().flat_map(|ear| &mut ear.takes).for_each(|take| take.closed = true);
            }
        }
        Ok(self.next.as_ref().map(|line| match line {
            ObjectLine::Thread(statement) => statement.time_s,
            ObjectLine::Cue(cue) => cue.time_s,
            ObjectLine::Microphone(key) => key.time_s,
        }))
    }

    /// Takes a line in; false where there is none.
    pub(super) fn read(&mut self) -> Result<bool> {
        self.peek_s()?;
        match self.next.take() {
            None => return Ok(false),
            Some(ObjectLine::Microphone(key)) => {
                check(key.time_s, key.pose.position_m)
                    .map_err(|what| Error::new(format!("microphone {} {what}", key.microphone + 1)))?;
                self.ears
                    .get_mut(key.microphone)
                    .filter(|ear| ear.moves)
                    .into_iter()
                    .for_each(|ear| ear.hear(&key));
            }
            Some(ObjectLine::Cue(cue)) => {
                check(cue.time_s, [0.0; 3])
                    .map_err(|what| Error::new(format!("thread {} {what}", cue.thread)))?;
                self.begun.push((cue.time_s, cue.thread, Due::Cue));
                self.cues.entry(cue.thread).or_default().push_back(cue);
            }
            Some(ObjectLine::Thread(line)) => {
                let position_m = match line.value.whereabouts {
                    Whereabouts::At(position_m) => position_m,
                    Whereabouts::Around(ear) if ear < self.ears.len() => [0.0; 3],
                    Whereabouts::Around(ear) => {
                        let what = format!("thread {} is around microphone {}", line.thread, ear + 1);
                        return Err(Error::new(format!("{what}; there are {}", self.ears.len())));
                    }
                };
                check(line.time_s, position_m)
                    .map_err(|what| Error::new(format!("thread {} {what}", line.thread)))?;
                self.wait(line)?;
            }
        }
        Ok(true)
    }

    pub(super) fn wait(&mut self, mut line: Statement<Placement>) -> Result<()> {
        let (id, here) = (line.thread, (line.time_s, line.value.whereabouts));
        if matches!(line.verb, Verb::Start(_)) {
            self.begun.push((line.time_s, id, Due::Line));
            self.waiting.insert(id, Waiting { lines: VecDeque::from([line]), last: here, ended: false });
            return Ok(());
        }
        let Some(waiting) = self.waiting.get_mut(&id) else {
            return Err(Error::new(format!(
                "thread {id} has a line at {} s but has not started",
                line.time_s
            )));
        };
        let (time_s, before) = waiting.last;
        let reach_m = JUMP_SPEED * self.speed_of_sound_mps * (line.time_s - time_s);
        match (before, line.value.whereabouts) {
            (Whereabouts::At(from_m), Whereabouts::At(to_m)) => {
                if line.verb == Verb::Key && distance(from_m, to_m) > reach_m {
                    line.verb = Verb::Jump;
                }
            }
            (before, here) if before == here => {}
            _ => {
                return Err(Error::new(format!("thread {id} is around a microphone and elsewhere"))
                    .help("end it and start another"));
            }
        }
        waiting.last = here;
        waiting.ended = line.verb == Verb::End;
        waiting.lines.push_back(line);
        Ok(())
    }

    /// The line of a thread that comes `ahead` lines after the one last passed, read if need be.
    pub(super) fn ahead(&mut self, id: u64, ahead: usize) -> Result<Option<&Statement<Placement>>> {
        // Behind an end there is nothing: to look for it would be to read the whole score.
        while self.waiting.get(&id).is_some_and(|w| w.lines.len() <= ahead && !w.ended) && self.read()? {}
        Ok(self.waiting.get(&id).and_then(|w| w.lines.get(ahead)))
    }

    /// Where a microphone is at a time in a take, and how fast it moves.
    pub(super) fn pose(&mut self, ear: usize, take: usize, time_s: f64) -> Result<(Pose, [f64; 3])> {
        self.motion(ear, take, time_s).map(|(pose, velocity, _)| (pose, velocity))
    }

    /// The same, and how fast it turns, in radians a second or a little more.
    pub(super) fn motion(&mut self, ear: usize, take: usize, time_s: f64) -> Result<(Pose, [f64; 3], f64)> {
        let goes_on = self.foresight == Foresight::None;
        loop {
            if let Some(track) = self.ears[ear].take(take).filter(|track| goes_on || track.is_known(time_s)) {
                let at = if goes_on { track.going_on(time_s) } else { track.at(time_s) };
                let ([x, y, z, fx, fy, fz, ux, uy, uz], [vx, vy, vz, fvx, fvy, fvz, uvx, uvy, uvz]) = at;
                let pose = Pose { position_m: [x, y, z], facing: [fx, fy, fz], up: [ux, uy, uz] };
                let turning = |value: [f64; 3], rate: [f64; 3]| match length(value) {
                    long if long > 0.0 => length(rate) / long,
                    _ => 0.0,
                };
                let turns = turning(pose.facing, [fvx, fvy, fvz]) + turning(pose.up, [uvx, uvy, uvz]);
                return Ok((pose, [vx, vy, vz], turns));
            }
            if !self.read()? && self.ears[ear].take(take).is_none() {
                return Err(Error::new(format!("microphone {} of the score has no place", ear + 1))
                    .help("give it `at X Y Z` where it is declared, or a `hear` line"));
            }
        }
    }

    /// How long sound takes for a distance. What is very far is heard no later than what is far:
    /// where a microphone will be then would have to be known, and it is next to silent.
    pub(super) fn delay_s(&self, distance_m: f64) -> f64 {
        let longest_s = match self.foresight {
            Foresight::NextKey => LONGEST_DELAY_S,
            Foresight::None => LONGEST_TOLD_S,
        };
        (distance_m / self.speed_of_sound_mps).min(longest_s)
    }

    /// When what leaves a place now arrives at a microphone: |s − m(a)| = c (a − t).
    pub(super) fn arrival_s(
        &mut self,
        ear: usize,
        take: usize,
        position_m: [f64; 3],
        time_s: f64,
    ) -> Result<f64> {
        if self.foresight == Foresight::None {
            // Where it will be then nobody knows.
            let (pose, _) = self.pose(ear, take, time_s)?;
            return Ok(time_s + self.delay_s(distance(position_m, pose.position_m)));
        }
        let mut arrival_s = time_s;
        // Each pass shrinks the error by the microphone's speed over that of sound.
        for _ in 0..60 {
            let (pose, _) = self.pose(ear, take, arrival_s)?;
            let next_s = time_s + self.delay_s(distance(position_m, pose.position_m));
            let error_s = (next_s - arrival_s).abs();
            arrival_s = next_s;
            if error_s < 1e-13 * arrival_s.abs().max(1.0) || !self.ears[ear].moves {
                break;
            }
        }
        Ok(arrival_s)
    }

    /// How what leaves a place now reaches a microphone at a take: where that is then, and how late it is.
    pub(super) fn meeting(
        &mut self,
        ear: usize,
        take: usize,
        position_m: [f64; 3],
        time_s: f64,
    ) -> Result<(Pose, f64)> {
        let arrival_s = self.arrival_s(ear, take, position_m, time_s)?;
        let meets_s = if self.foresight == Foresight::None { time_s } else { arrival_s };
        let (pose, _) = self.pose(ear, take, meets_s)?;
        // Where nothing moves the delay is d / c to the last bit, not a difference of times.
        let delay_s = if self.ears[ear].moves && meets_s == arrival_s {
            (arrival_s - time_s).clamp(0.0, LONGEST_DELAY_S)
        } else {
            self.delay_s(distance(position_m, pose.position_m))
        };
        Ok((pose, delay_s))
    }
}

/// Says what is wrong with a time and place.
pub(super) fn check(time_s: f64, position_m: [f64; 3]) -> Result<(), String> {
    if !(0.0..=LATEST_S).contains(&time_s) {
        return Err(format!("has a line at {time_s} s; a soundtrack can have times from 0 to {LATEST_S} s"));
    }
    if position_m.iter().all(|c| c.abs() <= FARTHEST_M) {
        return Ok(());
    }
    let [x, y, z] = position_m;
    Err(format!("is at {x} {y} {z} at {time_s} s; places must lie within {FARTHEST_M:e} m of the origin"))
}

pub(super) fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    length(std::array::from_fn(|i| a[i] - b[i]))
}
