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

mod ear;
mod inbox;
mod shadow;
mod source;
mod ways;

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap, VecDeque};

use super::microphone::{NEAR_M, length};
use super::pickup::diffuse;
use super::spread::Spread;
use super::tracing::Tracing;
use super::track::Track;
use crate::random::Random;
use crate::score::{
    Arrival, ChannelHeader, ChannelLine, Cue, Make, Microphone, ObjectHeader, ObjectLine, Order, Output,
    Pickup, Placement, Radiation, Start, Statement, Verb, Whereabouts,
};
use crate::synth::path::{FADE_S, Foresight};
use crate::time::Time;
use crate::{Error, Result};
use ear::Ear;
use inbox::{Inbox, distance};
use shadow::{CATCHING_UP_S, Shadows};
use source::{Source, UNTURNED, unit, weights};
use ways::{Scratch, Way};

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

/// Voices of one source play a loop from places of it that are as far apart as this at most, in seconds.
const LONGEST_LOOP_S: f64 = 600.0;

/// Keeps the random numbers of voices apart from others of the same seed.
const VOICES: u64 = 0x7370_7265_6164_0000;

/// Keys of a sound that comes from all over a surface are no further apart than this, in seconds.
const SPREAD_S: f64 = 0.02;

/// The number of the second voice of thread 0, and by how much more each further one has.
const VOICE: u64 = 1 << 40;

/// The thread of channel space that is a voice of one in object space.
fn voice_of(id: u64, voice: usize) -> u64 {
    id + voice as u64 * VOICE
}

/// Keys are never closer than this, in seconds.
const MIN_STEP_S: f64 = 0.0005;

/// The header of the channel-space score that a header in object space leads to. In a room that reverberates each
/// microphone has a tail.
pub fn channel_header(header: &ObjectHeader, reverberates: bool) -> ChannelHeader {
    ChannelHeader {
        speed_of_sound_mps: header.speed_of_sound_mps,
        duration_s: header.duration_s,
        seed: header.seed,
        surroundings: None,
        patterns: Vec::new(),
        order: Order::Time,
        sounds: header.sounds.clone(),
        receivers: outputs(&header.receivers, header.surroundings.as_ref().filter(|_| reverberates)),
    }
}

/// Where what microphones pick up goes. One alone gives its channels their usual names; several put their own
/// name before them.
fn outputs(microphones: &[Microphone], room: Option<&String>) -> Vec<Output> {
    let mut all = Vec::new();
    for microphone in microphones {
        let first = all.len();
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
        if let Some(scene) = room {
            let names = all[first..].iter().flat_map(Output::channels).cloned();
            let channels = names.zip(diffuse(&microphone.pickup)).filter(|(_, level)| *level > 0.0).collect();
            all.push(Output::Tail { scene: scene.clone(), channels });
        }
    }
    all
}

/// Turns the lines of an object-space score, in time order, into those of a channel-space score, in
/// time order. It reads just so far ahead as the smooth motion between keys asks for.
pub struct Propagation<L> {
    inbox: Inbox<L>,
    patterns: BTreeMap<String, Radiation>,
    /// Of each sound, whether it is a recording: then each voice of a source that is spread plays it from elsewhere.
    recordings: BTreeMap<String, bool>,
    seed: u64,
    tracing: Option<Tracing>,
    /// Memory that is used again and again.
    scratch: Scratch,
    ways: Vec<Way>,
    sources: BTreeMap<u64, Source>,
    /// When each thread has its next line to give, and each cue is passed on.
    due: BinaryHeap<Reverse<(Time, u64, Due)>>,
    ready: VecDeque<ChannelLine>,
    /// Lines of further voices, whose numbers are above all others: they come last of those of one time.
    held: Vec<ChannelLine>,
    failed: bool,
}

/// What a thread is due for. At one time its line comes before what it is told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Due {
    Line,
    Cue,
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
                foresight: Foresight::NextKey,
            },
            patterns: header
                .patterns
                .iter()
                .map(|pattern| (pattern.name.clone(), pattern.radiation.clone()))
                .collect(),
            recordings: header
                .sounds
                .iter()
                .map(|sound| (sound.name.clone(), matches!(sound.make, Make::Recording { .. })))
                .collect(),
            seed: header.seed,
            tracing: None,
            scratch: Scratch::default(),
            ways: Vec::new(),
            sources: BTreeMap::new(),
            due: BinaryHeap::new(),
            ready: VecDeque::new(),
            held: Vec::new(),
            failed: false,
        })
    }

    /// The same among surroundings that reflect and hide.
    #[must_use]
    pub fn among(self, tracing: Option<Tracing>) -> Self {
        Self { tracing, ..self }
    }

    /// The same with another foresight. Without one every line is passed on as it comes, and there are no keys between
    /// lines, which have to be dense; a microphone is met where it is when the sound leaves, by keys that come before
    /// those of threads.
    #[must_use]
    pub fn with_foresight(mut self, foresight: Foresight) -> Self {
        self.inbox.foresight = foresight;
        self
    }

    /// Passes the next line on, as it comes.
    fn pass_on(&mut self) -> Result<Option<ChannelLine>> {
        loop {
            if let Some(line) = self.ready.pop_front() {
                return Ok(Some(line));
            }
            let next_s = self.inbox.peek_s()?;
            if self.held.first().is_some_and(|held| next_s.is_none_or(|next_s| next_s > held.time_s())) {
                self.held.sort_by_key(ChannelLine::thread);
                self.ready.extend(self.held.drain(..));
                continue;
            }
            let Some(thread) = self.inbox.next.as_ref().map(|line| match line {
                ObjectLine::Thread(line) => Some((line.thread, line.time_s)),
                ObjectLine::Cue(cue) => Some((cue.thread, cue.time_s)),
                ObjectLine::Microphone(_) => None,
            }) else {
                return Ok(None);
            };
            self.inbox.read()?;
            self.inbox.begun.clear();
            let Some((id, time_s)) = thread else { continue };
            self.inbox.ears.iter_mut().filter(|ear| ear.moves).for_each(|ear| ear.forget(time_s));
            match self.pass(id, time_s) {
                Some(line) => {
                    let ends = line.verb == Verb::End;
                    self.after_cuts(id, &line)?;
                    self.through(id, line)?;
                    if ends {
                        self.sources.remove(&id);
                        self.inbox.waiting.remove(&id);
                    }
                }
                None => self.pass_cue(id),
            }
        }
    }

    /// Where a microphone has cut since the line before this one, the thread is heard at its old place until now, and
    /// jumps to the new one.
    fn after_cuts(&mut self, id: u64, line: &Statement<Placement>) -> Result<()> {
        let ears = &self.inbox.ears;
        let newest = || ears.iter().map(|ear| ear.first_take + ear.takes.len().saturating_sub(1));
        let Some(source) =
            self.sources.get_mut(&id).filter(|source| !newest().eq(source.takes.iter().copied()))
        else {
            return Ok(());
        };
        if source.around.is_some() {
            return Ok(());
        }
        let takes = newest().collect();
        let passed = source.passed.1;
        // One that cut long ago is not remembered where it was.
        let are_there = source.takes.iter().zip(ears).all(|(take, ear)| ear.take(*take).is_some());
        if are_there {
            let held = Statement { verb: Verb::Key, ..line.clone() };
            match line.verb {
                // What jumps by itself stood still until now.
                Verb::Jump => self.give(id, line.time_s, Verb::Key, passed)?,
                _ => self.through(id, held)?,
            }
        }
        if let Some(source) = self.sources.get_mut(&id) {
            source.takes = takes;
        }
        self.give(id, line.time_s, Verb::Jump, line.value.gain)
    }

    fn step(&mut self) -> Result<Option<ChannelLine>> {
        if self.inbox.foresight == Foresight::None {
            return self.pass_on();
        }
        loop {
            if let Some(line) = self.ready.pop_front() {
                return Ok(Some(line));
            }
            for (time_s, id, due) in std::mem::take(&mut self.inbox.begun) {
                self.due.push(Reverse((Time(time_s), id, due)));
            }
            let due_s = self.due.peek().map(|Reverse((time, ..))| time.0);
            if let Some(held_s) = self.held.first().map(ChannelLine::time_s) {
                let is_over = |next_s: Option<f64>| next_s.is_none_or(|next_s| next_s > held_s);
                if is_over(due_s) && is_over(self.inbox.peek_s()?) && self.inbox.begun.is_empty() {
                    self.held.sort_by_key(ChannelLine::thread);
                    self.ready.extend(self.held.drain(..));
                    continue;
                }
            }
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
        let cue = cues.pop_front();
        let voices = self.sources.get(&id).map_or(1, Source::voices);
        for (voice, cue) in (1..voices).zip(std::iter::repeat(&cue)) {
            self.held
                .extend(cue.clone().map(|cue| ChannelLine::Cue(Cue { thread: voice_of(id, voice), ..cue })));
        }
        self.ready.extend(cue.map(ChannelLine::Cue));
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
                let (mut pattern, mut spread) = (None, None);
                match self.patterns.get(&start.pattern).filter(|_| around.is_none()) {
                    Some(Radiation::Harmonics(harmonics)) => {
                        let turned = Track::new(time_s, turn.map_or(UNTURNED, unit));
                        pattern = Some((weights(harmonics), turned));
                    }
                    Some(Radiation::Surface) => spread = Some(self.spread(id, start)?),
                    None => {}
                }
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
                    spread,
                    thing,
                    heard: BTreeSet::new(),
                    track: Track::new(time_s, position_m),
                    passed: (time_s, gain),
                    takes,
                    cut_s: None,
                    shadows: Shadows::default(),
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
        let foreseen = if self.inbox.foresight == Foresight::None { 0 } else { 2 };
        for ahead in 0..foreseen {
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

    /// The surface from all over which a thread sounds.
    fn spread(&self, id: u64, start: &Start) -> Result<Spread> {
        let what =
            |why: &str| format!("thread {id} sounds from all over the surface of `{}`, {why}", start.object);
        if id >= VOICE {
            return Err(
                Error::new(what("and its number is too high")).help(format!("number it below {VOICE}"))
            );
        }
        let surface = self.tracing.as_ref().and_then(|tracing| tracing.surface(&start.object));
        let surface = surface.ok_or_else(|| {
            Error::new(what("of which nothing is known"))
                .help("name the scene of the object as `surroundings` in the header of the score")
        })?;
        Spread::new(surface.clone())
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
        let tracing = self.tracing.as_mut().filter(|_| source.around.is_none());
        if let Some(Tracing { enclosure: Some(enclosure), .. }) = &tracing {
            // An image moves as fast as its source, and with the walls twice as fast as they; it is never nearer.
            for (ear, &take) in source.takes.iter().enumerate() {
                let (pose, ear_velocity, turns) = self.inbox.motion(ear, take, time_s)?;
                let walls_mps =
                    enclosure.speed_mps(time_s, position)?.max(enclosure.speed_mps(time_s, pose.position_m)?);
                let speed_mps = length(velocity) + length(ear_velocity) + 2.0 * walls_mps;
                let passing = speed_mps / distance(position, pose.position_m).max(NEAR_M);
                step_s = step_s.min((STEP / passing).max(MIN_STEP_S));
                if self.inbox.ears[ear].receiving.is_turned() {
                    step_s = step_s.min((TURN / (passing + turns)).max(MIN_STEP_S));
                }
            }
            if let Some(key_s) = enclosure.next_key_s(time_s) {
                bound_s = bound_s.min(key_s.max(time_s + MIN_STEP_S));
            }
        }
        if source.spread.is_some() {
            step_s = step_s.min(SPREAD_S);
        }
        if let Some(tracing) = tracing.filter(|tracing| !tracing.surroundings.is_empty()) {
            let bodies_mps = tracing.surroundings.speed_mps(time_s)?;
            let mut speed_mps = length(velocity) + bodies_mps;
            for (ear, &take) in source.takes.iter().enumerate() {
                speed_mps = speed_mps
                    .max(length(velocity) + bodies_mps + length(self.inbox.pose(ear, take, time_s)?.1));
            }
            step_s = step_s.min((TRACED_M / speed_mps).max(MIN_STEP_S));
            if source.shadows.are_behind() {
                step_s = step_s.min(CATCHING_UP_S);
            }
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
        let Self { inbox, tracing, scratch, ways, sources, ready, held, recordings, seed, .. } = self;
        let Some(source) = sources.get_mut(&id) else { return Ok(()) };
        let ears = inbox.ears.len();
        let reverberates = tracing.as_ref().is_some_and(|tracing| tracing.reverberates);
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
                // It comes from nowhere in the room.
                value.extend(reverberates.then_some(Arrival::new(0.0, 0.0)));
            }
            ready.push_back(line(0, verb, value));
            return Ok(());
        }
        source.shadows.begin();
        if verb == Verb::Jump {
            source.shadows.forget_all();
        }
        let absorption = tracing.as_ref().and_then(|tracing| tracing.absorption_db_per_m);
        // One value a way, for every microphone.
        let mut values: Vec<Vec<Arrival>> = Vec::new();
        for (ear, take) in source.takes.clone().into_iter().enumerate() {
            let key = (time_s, gain);
            ways::find(inbox, tracing.as_mut(), source, (ear, take), key, scratch, ways)?;
            values.resize_with(ways.len(), || Vec::with_capacity(ears));
            for (value, way) in values.iter_mut().zip(&*ways) {
                way.hear(&inbox.ears[ear].receiving, absorption.as_ref(), value);
                value.extend(reverberates.then_some(Arrival::new(way.into_tail, 0.0)));
            }
        }
        let voices = source.voices();
        for (number, mut value) in values.into_iter().enumerate() {
            ways::plain(&mut value);
            if (1..voices).contains(&number) {
                let verb = match verb.clone() {
                    Verb::Start(start) => {
                        let is_recording = recordings.get(&start.sound) == Some(&true);
                        let random = Random::new(*seed ^ VOICES, id);
                        // A loop goes on from its beginning where it ends.
                        let later_s =
                            if is_recording { LONGEST_LOOP_S * random.uniform(number as u64) } else { 0.0 };
                        Verb::Start(Start { offset_s: start.offset_s + later_s, ..start })
                    }
                    verb => verb,
                };
                let thread = voice_of(id, number);
                held.push(ChannelLine::Thread(Statement { thread, path: 0, time_s, verb, value }));
                continue;
            }
            let path = (number + 1).saturating_sub(voices) as u32;
            let sounds = path == 0 || value.iter().any(|arrival| arrival.gain.abs() > SILENT);
            let begun = path == 0 || source.heard.contains(&path);
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
mod tests;
