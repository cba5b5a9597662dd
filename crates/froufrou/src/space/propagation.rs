//! From object space to channel space: what each microphone hears of each thread, as a gain and a
//! delay over time (Takala & Hahn 1992, §5).
//!
//! The distance between source and microphone gives the delay d / c and the gain 1 / d; Doppler is
//! not modelled, it follows from the changing delay. A microphone that moves is met where it is when
//! the sound arrives, not when it leaves.
//!
//! Bodies in the surroundings hide a part of it and reflect it: by way of each of their patches goes a path of
//! the thread of its own. Sources may radiate unevenly.
//!
//! Keys are set where the score has keys, and between them as densely as the geometry needs: a
//! tenth of the time in which source and microphone would pass each other; among surroundings also as
//! densely as their edges ask for.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap, VecDeque};

use super::directivity::{Directivity, HARMONICS};
use super::microphone::{NEAR_M, length};
use super::pickup::{Receiving, Toward};
use super::surroundings::{End, Paths};
use super::tracing::Tracing;
use super::track::Track;
use crate::score::{
    Arrival, ChannelHeader, ChannelLine, Cue, LATEST_S, LONGEST_DELAY_S, Microphone, MicrophoneKey,
    ObjectHeader, ObjectLine, Order, Output, Pickup, Placement, Pose, Start, Statement, Verb, Whereabouts,
};
use crate::synth::path::FADE_S;
use crate::{Error, Result};

/// Keys are this part of the time in which source and microphone would pass each other apart.
const STEP: f64 = 0.1;

/// Among surroundings nothing moves further than this between two keys, in metres: a small part of the width
/// of a path, over which a shadow falls.
const TRACED_M: f64 = 0.04;

/// A path by way of a patch is silent below this gain.
const SILENT: f64 = 1e-6;

/// By no more than this the direction changes in which a head, a sound field or loudspeakers hear a source
/// between two keys, in radians: less than can be told by ear.
const TURN: f64 = 0.025;

/// Keys are never closer than this, in seconds.
const MIN_STEP_S: f64 = 0.0005;

/// A source that covers more than this part of the speed of sound between two keys has jumped: no
/// pitch could follow it.
const JUMP_SPEED: f64 = 0.5;

/// Nothing is further from the origin than this in any direction, in metres; a double tells a tenth
/// of a metre apart there.
const FARTHEST_M: f64 = 1e15;

/// The header of the channel-space score that a header in object space leads to.
pub fn channel_header(header: &ObjectHeader) -> ChannelHeader {
    ChannelHeader {
        speed_of_sound_mps: header.speed_of_sound_mps,
        duration_s: header.duration_s,
        seed: header.seed,
        surroundings: None,
        patterns: Vec::new(),
        order: Order::Time,
        sounds: header.sounds.clone(),
        receivers: outputs(&header.receivers),
    }
}

/// Where what microphones pick up goes. One alone gives its channels their usual names; several put their own
/// name before them.
fn outputs(microphones: &[Microphone]) -> Vec<Output> {
    let mut all = Vec::new();
    for microphone in microphones {
        let name = |channel: &str| match microphones.len() {
            1 => channel.to_owned(),
            _ => format!("{} {channel}", microphone.name),
        };
        match &microphone.pickup {
            Pickup::Shape(_) => all.push(Output::Channel(microphone.name.clone())),
            Pickup::Binaural { head, shared } => {
                let ears = ["left", "right"].map(name);
                all.push(Output::Head { ears, head: head.clone(), shared: *shared });
            }
            pickup => all.extend(pickup.channels().iter().map(|channel| Output::Channel(name(channel)))),
        }
    }
    all
}

/// Turns the lines of an object-space score, in time order, into those of a channel-space score, in
/// time order. It reads just so far ahead as the smooth motion between keys asks for.
pub struct Propagation<L> {
    inbox: Inbox<L>,
    patterns: BTreeMap<String, Directivity>,
    tracing: Option<Tracing>,
    /// Scratch memory.
    paths: Paths,
    sources: BTreeMap<u64, Source>,
    /// When each thread has its next line to give, and each cue is passed on.
    due: BinaryHeap<Reverse<(Time, u64, Due)>>,
    ready: VecDeque<ChannelLine>,
    failed: bool,
}

/// What a thread is due for. At one time its line comes before what it is told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Due {
    Line,
    Cue,
}

/// A time that can be ordered.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Time(f64);

impl Eq for Time {}

impl PartialOrd for Time {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Time {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

/// A microphone and its ways, one after each cut.
struct Ear {
    receiving: Receiving,
    /// Position, facing and up; a new take begins at each cut.
    takes: VecDeque<Track<9>>,
    /// The number of the first take that is still held.
    first_take: usize,
    moves: bool,
}

impl Ear {
    fn new(microphone: &Microphone) -> Result<Self> {
        let fixed = microphone.fixed.map(|pose| Track::still(pose_values(&pose)));
        Ok(Self {
            receiving: Receiving::new(&microphone.pickup)?,
            moves: fixed.is_none(),
            takes: fixed.into_iter().collect(),
            first_take: 0,
        })
    }

    fn take(&self, take: usize) -> Option<&Track<9>> {
        self.takes.get(take.saturating_sub(self.first_take))
    }

    /// When the take after this one begins.
    fn cut_s(&self, take: usize) -> Option<f64> {
        self.takes.get((take + 1).saturating_sub(self.first_take)).map(Track::first_s)
    }

    fn hear(&mut self, key: &MicrophoneKey) {
        let values = pose_values(&key.pose);
        match self.takes.back_mut() {
            Some(take) if !key.cut => take.push(key.time_s, values),
            before => {
                before.into_iter().for_each(|take| take.closed = true);
                self.takes.push_back(Track::new(key.time_s, values));
            }
        }
    }

    fn forget(&mut self, time_s: f64) {
        while self.takes.get(1).is_some_and(|take| take.first_s() + 2.0 * FADE_S < time_s) {
            self.takes.pop_front();
            self.first_take += 1;
        }
        if let Some(take) = self.takes.front_mut() {
            take.forget(time_s);
        }
    }
}

fn pose_values(pose: &Pose) -> [f64; 9] {
    let ([x, y, z], [fx, fy, fz], [ux, uy, uz]) = (pose.position_m, pose.facing, pose.up);
    [x, y, z, fx, fy, fz, ux, uy, uz]
}

/// The lines as they come in: those of the microphones become their ways, those of threads wait for
/// their time.
struct Inbox<L> {
    lines: L,
    next: Option<ObjectLine>,
    speed_of_sound_mps: f64,
    ears: Vec<Ear>,
    waiting: BTreeMap<u64, Waiting>,
    /// What the threads are told, until its time has come.
    cues: BTreeMap<u64, VecDeque<Cue>>,
    begun: Vec<(f64, u64, Due)>,
}

/// What a thread has still to do.
struct Waiting {
    lines: VecDeque<Statement<Placement>>,
    /// Time and place of the last line read.
    last: (f64, Whereabouts),
    /// True once that line is the end.
    ended: bool,
}

impl<L: Iterator<Item = Result<ObjectLine>>> Inbox<L> {
    /// The time of the next line that has not been taken in.
    fn peek_s(&mut self) -> Result<Option<f64>> {
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
    fn read(&mut self) -> Result<bool> {
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

    fn wait(&mut self, mut line: Statement<Placement>) -> Result<()> {
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
    fn ahead(&mut self, id: u64, ahead: usize) -> Result<Option<&Statement<Placement>>> {
        // Behind an end there is nothing: to look for it would be to read the whole score.
        while self.waiting.get(&id).is_some_and(|w| w.lines.len() <= ahead && !w.ended) && self.read()? {}
        Ok(self.waiting.get(&id).and_then(|w| w.lines.get(ahead)))
    }

    /// Where a microphone is at a time in a take, and how fast it moves.
    fn pose(&mut self, ear: usize, take: usize, time_s: f64) -> Result<(Pose, [f64; 3])> {
        self.motion(ear, take, time_s).map(|(pose, velocity, _)| (pose, velocity))
    }

    /// The same, and how fast it turns, in radians a second or a little more.
    fn motion(&mut self, ear: usize, take: usize, time_s: f64) -> Result<(Pose, [f64; 3], f64)> {
        loop {
            if let Some(track) = self.ears[ear].take(take).filter(|track| track.is_known(time_s)) {
                let ([x, y, z, fx, fy, fz, ux, uy, uz], [vx, vy, vz, fvx, fvy, fvz, uvx, uvy, uvz]) =
                    track.at(time_s);
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
    fn delay_s(&self, distance_m: f64) -> f64 {
        (distance_m / self.speed_of_sound_mps).min(LONGEST_DELAY_S)
    }

    /// When what leaves a place now arrives at a microphone: |s − m(a)| = c (a − t).
    fn arrival_s(&mut self, ear: usize, take: usize, position_m: [f64; 3], time_s: f64) -> Result<f64> {
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
    fn meeting(&mut self, ear: usize, take: usize, position_m: [f64; 3], time_s: f64) -> Result<(Pose, f64)> {
        let arrival_s = self.arrival_s(ear, take, position_m, time_s)?;
        let (pose, _) = self.pose(ear, take, arrival_s)?;
        // Where nothing moves the delay is d / c to the last bit, not a difference of times.
        let delay_s = if self.ears[ear].moves {
            (arrival_s - time_s).clamp(0.0, LONGEST_DELAY_S)
        } else {
            self.delay_s(distance(position_m, pose.position_m))
        };
        Ok((pose, delay_s))
    }
}

/// Says what is wrong with a time and place.
fn check(time_s: f64, position_m: [f64; 3]) -> Result<(), String> {
    if !(0.0..=LATEST_S).contains(&time_s) {
        return Err(format!("has a line at {time_s} s; a soundtrack can have times from 0 to {LATEST_S} s"));
    }
    if position_m.iter().all(|c| c.abs() <= FARTHEST_M) {
        return Ok(());
    }
    let [x, y, z] = position_m;
    Err(format!("is at {x} {y} {z} at {time_s} s; places must lie within {FARTHEST_M:e} m of the origin"))
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    length(std::array::from_fn(|i| a[i] - b[i]))
}

/// A thread on its way.
struct Source {
    /// The microphone that it is all around, if it is.
    around: Option<usize>,
    /// How it radiates, if not evenly, and how it is turned.
    pattern: Option<(Directivity, Track<4>)>,
    /// The thing of the surroundings that it belongs to.
    thing: Option<u64>,
    /// Which of its further paths are heard, by their number.
    heard: BTreeSet<u32>,
    /// Its motion since the start or the last jump.
    track: Track<3>,
    /// Time and gain of the line last passed.
    passed: (f64, f64),
    /// The take of each microphone that the sound reaches.
    takes: Vec<usize>,
    /// When it leaves what meets a microphone just as it cuts, if that is what it is due for.
    cut_s: Option<f64>,
}

impl<L: Iterator<Item = Result<ObjectLine>>> Propagation<L> {
    /// What the microphones of a score hear of its lines.
    ///
    /// # Errors
    /// Loudspeakers over which no sound can be spread.
    pub fn new(header: &ObjectHeader, lines: L) -> Result<Self> {
        Ok(Self {
            inbox: Inbox {
                lines,
                next: None,
                speed_of_sound_mps: header.speed_of_sound_mps,
                ears: header.receivers.iter().map(Ear::new).collect::<Result<_>>()?,
                waiting: BTreeMap::new(),
                cues: BTreeMap::new(),
                begun: Vec::new(),
            },
            patterns: header
                .patterns
                .iter()
                .map(|pattern| (pattern.name.clone(), weights(&pattern.harmonics)))
                .collect(),
            tracing: None,
            paths: Paths::default(),
            sources: BTreeMap::new(),
            due: BinaryHeap::new(),
            ready: VecDeque::new(),
            failed: false,
        })
    }

    /// The same among surroundings that reflect and hide.
    #[must_use]
    pub fn among(self, tracing: Option<Tracing>) -> Self {
        Self { tracing, ..self }
    }

    fn step(&mut self) -> Result<Option<ChannelLine>> {
        loop {
            if let Some(line) = self.ready.pop_front() {
                return Ok(Some(line));
            }
            for (time_s, id, due) in std::mem::take(&mut self.inbox.begun) {
                self.due.push(Reverse((Time(time_s), id, due)));
            }
            let due_s = self.due.peek().map(|Reverse((time, ..))| time.0);
            match (due_s, self.inbox.peek_s()?) {
                (None, None) => return Ok(None),
                // Every line up to the time due must be in, or a thread could begin before it.
                (Some(due_s), next_s) if next_s.is_none_or(|next_s| next_s > due_s) => {
                    if let Some(Reverse((Time(time_s), id, due))) = self.due.pop() {
                        if due == Due::Cue {
                            self.pass_cue(id);
                            continue;
                        }
                        self.inbox.ears.iter_mut().filter(|ear| ear.moves).for_each(|ear| ear.forget(time_s));
                        if let Some(next_s) = self.advance(id, time_s)? {
                            self.due.push(Reverse((Time(next_s), id, Due::Line)));
                        } else {
                            self.sources.remove(&id);
                            self.inbox.waiting.remove(&id);
                        }
                    }
                }
                _ => {
                    self.inbox.read()?;
                }
            }
        }
    }

    /// Passes the next thing on that a thread is told.
    fn pass_cue(&mut self, id: u64) {
        let Some(cues) = self.inbox.cues.get_mut(&id) else { return };
        self.ready.extend(cues.pop_front().map(ChannelLine::Cue));
        if cues.is_empty() {
            self.inbox.cues.remove(&id);
        }
    }

    /// Gives a thread's lines at the time due and finds when it is due next.
    fn advance(&mut self, id: u64, time_s: f64) -> Result<Option<f64>> {
        let mut passed_any = false;
        while let Some(line) = self.pass(id, time_s) {
            passed_any = true;
            let ends = line.verb == Verb::End;
            self.through(id, line)?;
            if ends {
                return Ok(None);
            }
        }
        if !passed_any {
            self.between(id, time_s)?;
        }
        self.next_due(id, time_s)
    }

    /// The next line of a thread, if its time has come.
    fn pass(&mut self, id: u64, time_s: f64) -> Option<Statement<Placement>> {
        let lines = &mut self.inbox.waiting.get_mut(&id)?.lines;
        if lines.front()?.time_s <= time_s { lines.pop_front() } else { None }
    }

    /// Gives a line of the score.
    fn through(&mut self, id: u64, line: Statement<Placement>) -> Result<()> {
        let (time_s, Placement { whereabouts, gain, .. }) = (line.time_s, line.value);
        let (position_m, around) = match whereabouts {
            Whereabouts::At(position_m) => (position_m, None),
            Whereabouts::Around(ear) => ([0.0; 3], Some(ear)),
        };
        let turn = line.value.turn;
        match &line.verb {
            Verb::Start(start) => {
                let pattern = match self.patterns.get(&start.pattern) {
                    Some(&pattern) if around.is_none() => {
                        Some((pattern, Track::new(time_s, turn.map_or(UNTURNED, unit))))
                    }
                    _ => None,
                };
                let thing = self.tracing.as_ref().and_then(|tracing| tracing.thing(&start.object));
                let mut takes = Vec::with_capacity(self.inbox.ears.len());
                for ear in (0..self.inbox.ears.len()).filter(|_| around.is_none()) {
                    let mut take = self.inbox.ears[ear].first_take;
                    let mut arrival_s = self.inbox.arrival_s(ear, take, position_m, time_s)?;
                    while self.inbox.ears[ear].cut_s(take).is_some_and(|cut_s| arrival_s >= cut_s) {
                        take += 1;
                        arrival_s = self.inbox.arrival_s(ear, take, position_m, time_s)?;
                    }
                    takes.push(take);
                }
                let source = Source {
                    around,
                    pattern,
                    thing,
                    heard: BTreeSet::new(),
                    track: Track::new(time_s, position_m),
                    passed: (time_s, gain),
                    takes,
                    cut_s: None,
                };
                self.sources.insert(id, source);
            }
            Verb::Jump => {
                // What led here stood still since the last key.
                let held = self.sources.get(&id).map_or(0.0, |source| source.passed.1);
                self.give(id, time_s, Verb::Key, held)?;
                if let Some(source) = self.sources.get_mut(&id) {
                    source.track = Track::new(time_s, position_m);
                    if let (Some((_, turned)), Some(turn)) = (&mut source.pattern, turn) {
                        *turned = Track::new(time_s, unit(turn));
                    }
                }
            }
            // Object space has no paths: a reader refuses them.
            Verb::Key | Verb::Path | Verb::End => {}
        }
        let Some(source) = self.sources.get_mut(&id) else { return Ok(()) };
        source.passed = (time_s, gain);
        source.track.push(time_s, position_m);
        source.track.forget(time_s);
        source.turn(time_s, turn);
        // The keys that the motion to the next line depends on: that line and the one behind it.
        for ahead in 0..2 {
            match self.inbox.ahead(id, ahead)? {
                Some(Statement { time_s, verb: Verb::Key | Verb::End, value, .. }) => {
                    if let Whereabouts::At(position_m) = value.whereabouts {
                        source.track.push(*time_s, position_m);
                    }
                    source.turn(*time_s, value.turn);
                }
                _ => break,
            }
        }
        self.give(id, time_s, line.verb, gain)
    }

    /// Gives a key between the lines of the score, or the jump where a microphone cuts.
    fn between(&mut self, id: u64, time_s: f64) -> Result<()> {
        let next =
            self.inbox.ahead(id, 0)?.map(|line| (line.time_s, line.value.gain, line.verb == Verb::Jump));
        let Some(source) = self.sources.get_mut(&id) else { return Ok(()) };
        let (passed_s, from) = source.passed;
        let gain = match next {
            Some((next_s, to, false)) => from + (to - from) * ((time_s - passed_s) / (next_s - passed_s)),
            _ => from,
        };
        let cuts = source.cut_s.take().is_some();
        self.give(id, time_s, Verb::Key, gain)?;
        if cuts {
            self.next_takes(id, time_s)?;
            self.give(id, time_s, Verb::Jump, gain)?;
        }
        Ok(())
    }

    /// The next time at which a thread has something to say, if it goes on.
    fn next_due(&mut self, id: u64, time_s: f64) -> Result<Option<f64>> {
        let Some(line_s) = self.inbox.ahead(id, 0)?.map(|line| line.time_s) else {
            // The score leaves the thread open: it ends with its last key.
            return Ok(None);
        };
        let Some(source) = self.sources.get_mut(&id) else { return Ok(None) };
        let (position, velocity) = source.track.at(time_s);
        let (mut step_s, mut bound_s) = (f64::INFINITY, line_s);
        for (ear, &take) in source.takes.iter().enumerate() {
            let (pose, ear_velocity, turns) = self.inbox.motion(ear, take, time_s)?;
            let apart_m = distance(position, pose.position_m).max(NEAR_M);
            let passing = distance(velocity, ear_velocity) / apart_m;
            step_s = step_s.min((STEP / passing).max(MIN_STEP_S));
            if self.inbox.ears[ear].receiving.is_turned() {
                step_s = step_s.min((TURN / (passing + turns)).max(MIN_STEP_S));
            }
            let ear = &self.inbox.ears[ear];
            if let Some(key_s) = ear.take(take).filter(|_| ear.moves).and_then(|track| track.next_s(time_s)) {
                bound_s = bound_s.min(key_s.max(time_s + MIN_STEP_S));
            }
        }
        if let Some(tracing) = self.tracing.as_mut().filter(|_| source.around.is_none()) {
            let bodies_mps = tracing.surroundings.speed_mps(time_s)?;
            let mut speed_mps = length(velocity) + bodies_mps;
            for (ear, &take) in source.takes.iter().enumerate() {
                speed_mps = speed_mps
                    .max(length(velocity) + bodies_mps + length(self.inbox.pose(ear, take, time_s)?.1));
            }
            step_s = step_s.min((TRACED_M / speed_mps).max(MIN_STEP_S));
            if let Some(key_s) = tracing.surroundings.next_key_s(time_s) {
                bound_s = bound_s.min(key_s.max(time_s + MIN_STEP_S));
            }
        }
        // Even steps to the bound, so that no sliver is left before it.
        let steps = ((bound_s - time_s) / step_s).ceil();
        let next_s = if steps > 1.0 { time_s + (bound_s - time_s) / steps } else { bound_s };
        let cut_s = self.cut(id, time_s, next_s)?;
        if let Some(source) = self.sources.get_mut(&id) {
            source.cut_s = cut_s;
        }
        Ok(Some(cut_s.unwrap_or(next_s)))
    }

    /// When the sound leaves that meets a microphone just as it cuts, if that is within an interval.
    fn cut(&mut self, id: u64, from_s: f64, to_s: f64) -> Result<Option<f64>> {
        let Some(source) = self.sources.get(&id) else { return Ok(None) };
        let mut first: Option<f64> = None;
        for (ear, &take) in source.takes.iter().enumerate() {
            if !self.inbox.ears[ear].moves {
                continue;
            }
            let arrival_s = self.inbox.arrival_s(ear, take, source.track.at(to_s).0, to_s)?;
            let Some(cut_s) = self.inbox.ears[ear].cut_s(take).filter(|&cut_s| arrival_s >= cut_s) else {
                continue;
            };
            let (mut early, mut late) = (from_s, to_s);
            for _ in 0..40 {
                let middle = 0.5 * (early + late);
                let meets = self.inbox.arrival_s(ear, take, source.track.at(middle).0, middle)? >= cut_s;
                if meets { late = middle } else { early = middle }
            }
            first = Some(first.map_or(late, |f| f.min(late)));
        }
        Ok(first)
    }

    /// Moves every microphone that cuts now, or all but now, on to its next take.
    fn next_takes(&mut self, id: u64, time_s: f64) -> Result<()> {
        let Some(source) = self.sources.get_mut(&id) else { return Ok(()) };
        let position = source.track.at(time_s).0;
        for (ear, take) in source.takes.iter_mut().enumerate() {
            let arrival_s = self.inbox.arrival_s(ear, *take, position, time_s)?;
            if self.inbox.ears[ear].cut_s(*take).is_some_and(|cut_s| arrival_s + FADE_S >= cut_s) {
                *take += 1;
            }
        }
        Ok(())
    }

    /// Gives a line of a thread, and of its further paths.
    fn give(&mut self, id: u64, time_s: f64, verb: Verb, gain: f64) -> Result<()> {
        let Self { inbox, tracing, paths, sources, ready, .. } = self;
        let Some(source) = sources.get_mut(&id) else { return Ok(()) };
        let ears = inbox.ears.len();
        // How it radiates is in the gains from here on.
        let verb = match verb {
            Verb::Start(start) => Verb::Start(Start { pattern: String::new(), ..start }),
            verb => verb,
        };
        let line =
            |path, verb, value| ChannelLine::Thread(Statement { thread: id, path, time_s, verb, value });
        if let Some(around) = source.around {
            let mut value = Vec::with_capacity(ears);
            for (ear, microphone) in inbox.ears.iter().enumerate() {
                microphone.receiving.around(if ear == around { gain } else { 0.0 }, &mut value);
            }
            ready.push_back(line(0, verb, value));
            return Ok(());
        }
        let position_m = source.track.at(time_s).0;
        let radiated = source.radiation(time_s);
        let mut direct = Vec::with_capacity(ears);
        // One value an ear, for every patch.
        let mut bounced: Vec<Vec<Arrival>> = Vec::new();
        for (ear, &take) in source.takes.iter().enumerate() {
            let (pose, delay_s) = inbox.meeting(ear, take, position_m, time_s)?;
            let toward = |m: [f64; 3]| radiated(std::array::from_fn(|i| m[i] - position_m[i]));
            let mut share = 1.0;
            if let Some(tracing) = tracing {
                let from = End { position_m, thing: source.thing };
                let to = End { position_m: pose.position_m, thing: None };
                tracing.surroundings.paths(time_s, from, to, paths)?;
                bounced.resize_with(paths.bounces.len(), || Vec::with_capacity(ears));
                for (bounce, values) in paths.bounces.iter().zip(&mut bounced) {
                    // A microphone that moves is met a little later by way of a patch.
                    let (late, _) = inbox.pose(ear, take, time_s + inbox.delay_s(bounce.length_m))?;
                    let apart = |m: [f64; 3]| distance(m, bounce.point_m);
                    let length_m = bounce.length_m + apart(late.position_m) - apart(pose.position_m);
                    let gain = bounce.gain * toward(bounce.point_m) * gain;
                    let delay_s = inbox.delay_s(length_m.max(0.0));
                    let from = Toward::new(&late, bounce.point_m);
                    inbox.ears[ear].receiving.hear(from, length_m, gain, delay_s, values);
                }
                share = paths.direct;
            }
            let from = Toward::new(&pose, position_m);
            let gain = share * gain * toward(pose.position_m) / from.distance_m.max(NEAR_M);
            inbox.ears[ear].receiving.hear(from, from.distance_m, gain, delay_s, &mut direct);
        }
        ready.push_back(line(0, verb.clone(), direct));
        for (number, value) in bounced.into_iter().enumerate() {
            let path = number as u32 + 1;
            let sounds = value.iter().any(|arrival| arrival.gain.abs() > SILENT);
            let begun = source.heard.contains(&path);
            let verb = match (&verb, begun, sounds) {
                (_, false, false) | (Verb::End, false, _) => continue,
                (_, false, true) => Verb::Path,
                (Verb::End, true, _) | (_, true, false) => Verb::End,
                (verb, true, true) => verb.clone(),
            };
            if verb == Verb::End {
                source.heard.remove(&path);
            } else {
                source.heard.insert(path);
            }
            ready.push_back(line(path, verb, value));
        }
        Ok(())
    }
}

/// A source that is not turned.
const UNTURNED: [f64; 4] = [0.0, 0.0, 0.0, 1.0];

/// A turn of length 1.
fn unit(turn: [f64; 4]) -> [f64; 4] {
    let length = turn.iter().map(|part| part * part).sum::<f64>().sqrt();
    turn.map(|part| part / length)
}

/// The weights of a pattern; what it leaves out is 0.
fn weights(harmonics: &[f64]) -> Directivity {
    let mut coefficients = [0.0; HARMONICS];
    coefficients.iter_mut().zip(harmonics).for_each(|(weight, harmonic)| *weight = *harmonic);
    Directivity { coefficients }
}

impl Source {
    /// Takes in how it is turned, by the shorter way from how it was before.
    fn turn(&mut self, time_s: f64, turn: Option<[f64; 4]>) {
        let (Some((_, turned)), Some(turn)) = (&mut self.pattern, turn.map(unit)) else { return };
        let before = turned.last();
        let same: f64 = before.iter().zip(turn).map(|(a, b)| a * b).sum();
        turned.push(time_s, if same < 0.0 { turn.map(|part| -part) } else { turn });
        turned.forget(self.passed.0);
    }

    /// Its gain towards what lies in a direction, in metres from it.
    fn radiation(&self, time_s: f64) -> impl Fn([f64; 3]) -> f64 + use<> {
        let pattern = self.pattern.as_ref().map(|(pattern, turned)| {
            let [x, y, z, w] = unit(turned.at(time_s).0);
            let columns = glam::DMat3::from_quat(glam::DQuat::from_xyzw(x, y, z, w)).to_cols_array_2d();
            let mut frame = [[0.0; 4]; 4];
            (0..3).for_each(|row| (0..3).for_each(|column| frame[row][column] = columns[column][row]));
            frame[3][3] = 1.0;
            (*pattern, frame)
        });
        move |toward_m| pattern.as_ref().map_or(1.0, |(pattern, frame)| pattern.gain(frame, toward_m))
    }
}

impl<L: Iterator<Item = Result<ObjectLine>>> Iterator for Propagation<L> {
    type Item = Result<ChannelLine>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.failed {
            return None;
        }
        let step = self.step().transpose();
        self.failed = matches!(step, Some(Err(_)));
        step
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::{Header, MicrophoneShape, Start};

    const OMNI: MicrophoneShape = MicrophoneShape { c: 0.0, k: 0.0 };

    fn header(fixed: Option<[f64; 3]>) -> ObjectHeader {
        let pose = |position_m| Pose::upright(position_m, [0.0, 0.0, -1.0]);
        let microphone = Microphone { name: "m".into(), pickup: Pickup::Shape(OMNI), fixed: fixed.map(pose) };
        Header { speed_of_sound_mps: 340.0, ..Header::new(Order::Time, vec![microphone]) }
    }

    fn line(thread: u64, time_s: f64, verb: Verb, position_m: [f64; 3]) -> Result<ObjectLine> {
        let value = Placement::at(position_m, 2.0);
        Ok(ObjectLine::Thread(Statement { thread, path: 0, time_s, verb, value }))
    }

    fn start() -> Verb {
        let (sound, object, cause) = ("s".into(), String::new(), String::new());
        Verb::Start(Start { sound, speed: 1.0, offset_s: 0.0, object, cause, pattern: String::new() })
    }

    fn hear(time_s: f64, position_m: [f64; 3], cut: bool) -> Result<ObjectLine> {
        let pose = Pose::upright(position_m, [1.0, 0.0, 0.0]);
        Ok(ObjectLine::Microphone(MicrophoneKey { microphone: 0, time_s, pose, cut }))
    }

    fn propagate(header: &ObjectHeader, lines: Vec<Result<ObjectLine>>) -> Vec<Statement<Vec<Arrival>>> {
        let lines = Propagation::new(header, lines.into_iter()).unwrap().map(|line| line.unwrap());
        let lines: Vec<_> = lines.filter_map(|line| line.statement().cloned()).collect();
        assert!(lines.windows(2).all(|w| w[0].time_s <= w[1].time_s), "in time order");
        lines
    }

    #[test]
    fn a_source_at_rest_has_its_delay_and_gain_to_the_bit() {
        let lines = propagate(
            &header(Some([0.0, 3.0, 0.0])),
            vec![line(1, 0.5, start(), [4.0, 0.0, 0.0]), line(1, 7.0, Verb::End, [4.0, 0.0, 0.0])],
        );
        assert_eq!(lines.len(), 2);
        for line in &lines {
            assert_eq!(line.value, [Arrival::new(0.4, 5.0 / 340.0)]);
        }
    }

    #[test]
    fn a_passing_source_meets_the_closed_form_between_keys() {
        // A straight pass at 40 m/s, 2 m away, from two keys; and the path that the mixer makes of it.
        let lines = propagate(
            &header(Some([0.0; 3])),
            vec![line(1, 0.0, start(), [-40.0, 0.0, 2.0]), line(1, 2.0, Verb::End, [40.0, 0.0, 2.0])],
        );
        let key = |l: &Statement<Vec<Arrival>>| crate::synth::path::PathKey {
            emission_s: l.time_s,
            delay_s: l.value[0].delay_s,
            gain: l.value[0].gain,
            filter: crate::synth::path::UNFILTERED,
            spread: crate::synth::path::UNSPREAD,
        };
        let mut segments = Vec::new();
        let mut path = crate::synth::path::PathBuilder::new(key(&lines[0]), false, 0.0);
        for l in &lines[1..] {
            path.key(key(l), &mut |s| segments.push(s));
        }
        let mut worst = (0.0f64, 0.0f64, 0.0f64);
        for segment in &segments {
            for part in [0.05, 0.3, 0.5, 0.8] {
                let arrival = segment.begin_s + part * (segment.end_s - segment.begin_s);
                let moment = segment.at(arrival);
                // |x(t)| = c (a - t) solved for the emission time t, x = (-40 + 40 t, 2).
                let (c2, v) = (340.0f64 * 340.0, 40.0f64);
                let (a2, b2, c0) =
                    (c2 - v * v, -2.0 * (c2 * arrival - v * 40.0), c2 * arrival * arrival - 1604.0);
                let t = (-b2 - (b2 * b2 - 4.0 * a2 * c0).sqrt()) / (2.0 * a2);
                let x = -40.0 + 40.0 * t;
                let d = x.hypot(2.0);
                let rate = 1.0 / (1.0 + v * x / d / 340.0);
                worst.0 = worst.0.max((moment.delay_s - (arrival - t)).abs());
                worst.1 = worst.1.max((moment.rate / rate - 1.0).abs());
                worst.2 = worst.2.max((20.0 * (moment.gain * d / 2.0).log10()).abs());
            }
        }
        assert!(worst.0 < 1e-6 && worst.1 < 5e-4 && worst.2 < 0.03, "{worst:?}");
        assert!(lines.len() < 150, "{} keys", lines.len());
    }

    #[test]
    fn a_microphone_is_met_where_it_is_when_the_sound_arrives() {
        // The microphone recedes at 34 m/s from 34 m: d = 34 + 34 a, a = d / 340, so a = 1/9 s.
        let mut lines: Vec<_> = (0..=40)
            .map(|i| hear(f64::from(i) * 0.1, [34.0 + 3.4 * f64::from(i), 0.0, 0.0], false))
            .collect();
        lines.insert(1, line(1, 0.0, start(), [0.0; 3]));
        lines.insert(12, line(1, 1.0, Verb::End, [0.0; 3]));
        let lines = propagate(&header(None), lines);
        assert!((lines[0].value[0].delay_s - 1.0 / 9.0).abs() < 1e-9, "{:?}", lines[0]);
        let end = lines.last().unwrap();
        // From t = 1 s: 340 (a - 1) = 34 + 34 a.
        assert!((end.value[0].delay_s - (374.0 / 306.0 - 1.0)).abs() < 1e-9, "{end:?}");
    }

    #[test]
    fn a_cut_is_heard_when_it_is_seen() {
        // The camera cuts at 2 s from 34 m to 68 m away: what leaves at 1.9 s meets it.
        let mut lines = vec![hear(0.0, [34.0, 0.0, 0.0], false), line(1, 0.0, start(), [0.0; 3])];
        lines.extend((1..20).map(|i| hear(f64::from(i) * 0.1, [34.0, 0.0, 0.0], false)));
        lines.push(hear(2.0, [68.0, 0.0, 0.0], true));
        lines.extend((1..20).map(|i| hear(2.0 + f64::from(i) * 0.1, [68.0, 0.0, 0.0], false)));
        lines.insert(35, line(1, 3.0, Verb::End, [0.0; 3]));
        lines.sort_by(|a, b| line_s(a).total_cmp(&line_s(b)));
        let lines = propagate(&header(None), lines);
        let jumps: Vec<_> = lines.iter().filter(|l| l.verb == Verb::Jump).collect();
        assert_eq!(jumps.len(), 1);
        assert!((jumps[0].time_s - 1.9).abs() < 1e-9, "{jumps:?}");
        assert!((jumps[0].value[0].delay_s - 0.2).abs() < 1e-9);
        for line in &lines {
            let expected = if line.time_s < jumps[0].time_s
                || line.verb == Verb::Key && line.time_s == jumps[0].time_s
            {
                0.1
            } else {
                0.2
            };
            assert!((line.value[0].delay_s - expected).abs() < 1e-9, "{line:?}");
        }
    }

    fn line_s(line: &Result<ObjectLine>) -> f64 {
        match line.as_ref().unwrap() {
            ObjectLine::Thread(statement) => statement.time_s,
            ObjectLine::Cue(cue) => cue.time_s,
            ObjectLine::Microphone(key) => key.time_s,
        }
    }

    #[test]
    fn what_is_faster_than_sound_could_follow_has_jumped() {
        let lines = propagate(
            &header(Some([0.0; 3])),
            vec![
                line(1, 0.0, start(), [10.0, 0.0, 0.0]),
                line(1, 0.1, Verb::Key, [10.0, 0.0, 0.0]),
                line(1, 0.2, Verb::Key, [60.0, 0.0, 0.0]),
                line(1, 0.3, Verb::End, [60.0, 0.0, 0.0]),
            ],
        );
        let jump = lines.iter().position(|l| l.verb == Verb::Jump).unwrap();
        assert_eq!((lines[jump].time_s, lines[jump].value[0].delay_s), (0.2, 60.0 / 340.0));
        assert_eq!((lines[jump - 1].time_s, lines[jump - 1].value[0].delay_s), (0.2, 10.0 / 340.0));
        assert_eq!(lines.len(), 5);
    }

    #[test]
    fn a_microphone_without_a_place_is_an_error() {
        let lines = vec![line(1, 0.0, start(), [1.0; 3]), line(1, 1.0, Verb::End, [1.0; 3])];
        let error =
            Propagation::new(&header(None), lines.into_iter()).unwrap().find_map(Result::err).unwrap();
        assert!(error.to_string().contains("microphone 1 of the score has no place"), "{error}");
    }
}
