//! From a scene and what happens in it to a score: which sound starts when, where it rides and how
//! loud it is.
//!
//! Lines come out in time order as they are asked for, so that a score of any length is made in the
//! memory of the threads that sound at once.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap, HashMap, VecDeque};
use std::iter::Peekable;

use super::{
    Header, Make, Microphone, MicrophoneKey, ObjectHeader, ObjectLine, Order, Placement, Repeat, Sound,
    Start, Statement, Verb,
};
use crate::motion::event::{Event, Impact};
use crate::motion::impact::LogImpacts;
use crate::random::Random;
use crate::scene::asset::Asset;
use crate::scene::file::{Emitter, ImpactSound, Scene, SceneSound, StartKey, Timing};
use crate::scene::world::{Carrier, World};
use crate::{Error, Place, Result};

/// Where nothing moves, a line comes this often all the same, so that a score can be mixed as it is
/// read, however long a sound lasts.
const HEARTBEAT_S: f64 = 1.0;

/// So many pairs of bodies are never too many to remember.
const LEAST_QUIET: usize = 256;

/// Microphones move on for this long after the last thread ends: the sound of a kilometre away.
const LISTEN_ON_S: f64 = 3.0;

/// What a scene plays and to whom: the header of its score. Recordings are named relative to the
/// scene's folder.
pub fn header(scene: &Scene, world: &World) -> Result<ObjectHeader> {
    let mut sounds = Palette::default();
    for sound in &scene.sounds {
        sound.recordings.iter().for_each(|asset| sounds.add(asset, sound.repeat, sound.channel));
    }
    for impact in scene.materials.iter().filter_map(|m| m.impact.as_ref()) {
        impact.recordings.iter().for_each(|asset| sounds.add(asset, Repeat::Once, None));
    }
    let mut receivers = Vec::with_capacity(scene.microphones.len());
    for (microphone, ear) in scene.microphones.iter().zip(&world.ears) {
        let moves = ear.carrier().next_key_s(f64::MIN).is_some();
        let fixed = if moves { None } else { Some(ear.pose(0.0)?) };
        receivers.push(Microphone { name: microphone.name.clone(), shape: microphone.shape, fixed });
    }
    Ok(Header {
        speed_of_sound_mps: scene.speed_of_sound_mps,
        duration_s: scene.duration_s,
        seed: scene.seed,
        surroundings: None,
        patterns: Vec::new(),
        order: Order::Time,
        sounds: sounds.sounds,
        receivers,
    })
}

/// The sounds of a score, each with a name of its own.
#[derive(Default)]
struct Palette {
    sounds: Vec<Sound>,
}

impl Palette {
    fn add(&mut self, asset: &Asset, repeat: Repeat, channel: Option<usize>) {
        if self.sounds.iter().any(|s| is(s, asset, repeat, channel)) {
            return;
        }
        let stem = asset.name.rsplit('/').next().unwrap_or_default();
        let stem = stem.rsplit_once('.').map_or(stem, |(stem, _)| stem);
        let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
        let mut base: String = stem.chars().map(plain).collect();
        if !base.starts_with(|c: char| c.is_ascii_alphabetic()) {
            base.insert(0, '_');
        }
        let taken = |name: &str| self.sounds.iter().any(|s| s.name == name);
        let numbered = (2..).map(|n| format!("{base}-{n}"));
        let name = std::iter::once(base.clone()).chain(numbered).find(|name| !taken(name)).unwrap_or(base);
        self.sounds.push(Sound::recording(name, asset.name.clone(), repeat, channel));
    }
}

fn is(sound: &Sound, asset: &Asset, repeat: Repeat, channel: Option<usize>) -> bool {
    sound.make == Make::Recording { path: asset.name.clone(), repeat, channel }
}

/// What happens in a scene by itself, told by its contact logs, in time order.
pub struct Events {
    logs: Vec<Peekable<LogImpacts>>,
}

impl Events {
    /// Opens the contact logs of a scene.
    ///
    /// # Errors
    /// A log that cannot be read.
    pub fn open(scene: &Scene) -> Result<Self> {
        let logs = scene.contacts.iter().map(|contacts| Ok(LogImpacts::open(contacts)?.peekable()));
        Ok(Self { logs: logs.collect::<Result<_>>()? })
    }
}

impl Iterator for Events {
    type Item = Result<Event>;

    fn next(&mut self) -> Option<Self::Item> {
        let mut first: Option<(usize, f64)> = None;
        for (index, log) in self.logs.iter_mut().enumerate() {
            let time_s = match log.peek() {
                None => continue,
                Some(Err(_)) => f64::NEG_INFINITY,
                Some(Ok(event)) => event.time_s(),
            };
            if first.is_none_or(|(_, earliest_s)| time_s < earliest_s) {
                first = Some((index, time_s));
            }
        }
        self.logs[first?.0].next()
    }
}

/// Makes the lines of a scene's score. An iterator; it ends after its first error.
pub struct Composer<'a, E> {
    scene: &'a Scene,
    world: &'a World,
    header: &'a ObjectHeader,
    /// Seconds each sound of the header lasts at speed 1, by name.
    lengths_s: BTreeMap<String, f64>,
    end_s: f64,
    events: E,
    next_event: Option<Event>,
    /// Starts set by hand, in time order.
    starts: VecDeque<Planned>,
    voices: BTreeMap<u64, Voice>,
    next_thread: u64,
    /// When the last thread to end so far did.
    last_end_s: f64,
    due: BinaryHeap<Reverse<Due>>,
    ears: Vec<EarState>,
    picks: HashMap<Group, Picks>,
    /// Until when a pair of bodies is quiet in an object: the dead time of its material.
    quiet_until_s: HashMap<(String, String, usize), f64>,
    /// How many of those there may be before the ones that are over are forgotten.
    most_quiet: usize,
    ready: VecDeque<ObjectLine>,
    state: State,
}

#[derive(Clone, Copy, PartialEq)]
enum State {
    New,
    Running,
    Over,
}

/// A start set by hand.
struct Planned {
    time_s: f64,
    sound: usize,
    body: usize,
    key: Option<StartKey>,
}

/// What recordings are picked for: a sound of the scene, or the impacts of an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Group {
    Sound(usize, usize),
    Impact(usize),
}

impl Group {
    /// Its number among all groups, for the addresses of random numbers.
    fn number(self) -> u64 {
        match self {
            Group::Sound(sound, body) => ((sound as u64) << 32) + ((body as u64) << 1),
            Group::Impact(object) => ((object as u64) << 1) + 1,
        }
    }
}

/// How often a group has picked, and what it picked last.
#[derive(Default)]
struct Picks {
    count: u64,
    last: Option<usize>,
}

/// A thread that sounds.
struct Voice {
    /// What it starts with, until it has.
    start: Option<Start>,
    carrier: Carrier,
    /// Gain at 1 m over time: breakpoints, linear between.
    gain: Vec<(f64, f64)>,
    end_s: f64,
    passed_s: f64,
}

struct EarState {
    moves: bool,
    passed_s: f64,
}

/// When something has its next line: in order of time, microphones before threads.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Due {
    time_s: f64,
    thread: bool,
    id: u64,
}

impl Eq for Due {}

impl PartialOrd for Due {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Due {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.time_s.total_cmp(&other.time_s).then((self.thread, self.id).cmp(&(other.thread, other.id)))
    }
}

impl<'a, E: Iterator<Item = Result<Event>>> Composer<'a, E> {
    /// A composer for a scene.
    ///
    /// `lengths_s` gives the seconds each sound of the header lasts at speed 1, infinite for loops;
    /// `events` come in time order; `end_s` is when the scene is over for sounds that run through it.
    ///
    /// # Errors
    /// A scene with sounds that run through it and nothing that says how long it is.
    pub fn new(
        scene: &'a Scene,
        world: &'a World,
        header: &'a ObjectHeader,
        lengths_s: impl IntoIterator<Item = (String, f64)>,
        end_s: f64,
        events: E,
    ) -> Result<Self> {
        let mut starts = Vec::new();
        for (index, sound) in scene.sounds.iter().enumerate() {
            let bodies = match sound.emitter {
                Emitter::Object(object) => world.objects[object].len(),
                Emitter::Position(_) => 1,
            };
            for body in 0..bodies {
                match &sound.timing {
                    Timing::Starts(keys) => starts.extend(keys.iter().map(|&key| Planned {
                        time_s: key.time_s,
                        sound: index,
                        body,
                        key: Some(key),
                    })),
                    Timing::Span { from_s, to_s } => {
                        if sound.repeat != Repeat::Once && to_s.is_none() && end_s <= *from_s {
                            return Err(Error::new(
                                "a loop runs through the scene, and nothing says how long it is",
                            )
                            .in_file(&scene.file)
                            .help("give the scene a `duration`, or the sound a `to`"));
                        }
                        starts.push(Planned { time_s: *from_s, sound: index, body, key: None });
                    }
                }
            }
        }
        starts.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        let moves = |microphone: &Microphone| microphone.fixed.is_none();
        Ok(Self {
            scene,
            world,
            header,
            lengths_s: lengths_s.into_iter().collect(),
            end_s,
            events,
            next_event: None,
            starts: starts.into(),
            voices: BTreeMap::new(),
            next_thread: 1,
            last_end_s: 0.0,
            due: BinaryHeap::new(),
            ears: header.receivers.iter().map(|m| EarState { moves: moves(m), passed_s: 0.0 }).collect(),
            picks: HashMap::new(),
            quiet_until_s: HashMap::new(),
            most_quiet: LEAST_QUIET,
            ready: VecDeque::new(),
            state: State::New,
        })
    }

    fn step(&mut self) -> Result<Option<ObjectLine>> {
        if self.state == State::New {
            self.state = State::Running;
            self.next_event = self.events.next().transpose()?;
            for index in (0..self.ears.len()).filter(|&i| self.ears[i].moves) {
                self.due.push(Reverse(Due { time_s: 0.0, thread: false, id: index as u64 }));
            }
        }
        loop {
            if let Some(line) = self.ready.pop_front() {
                return Ok(Some(line));
            }
            let start_s = self.starts.front().map_or(f64::INFINITY, |start| start.time_s);
            let event_s = self.next_event.as_ref().map_or(f64::INFINITY, Event::time_s);
            let due_s = self.due.peek().map_or(f64::INFINITY, |Reverse(due)| due.time_s);
            if due_s < start_s.min(event_s) {
                // Microphones go on for as long as anything sounds, is under way or still to come.
                let silent = self.voices.is_empty() && start_s.min(event_s) == f64::INFINITY;
                let idle = silent && due_s > self.last_end_s + LISTEN_ON_S;
                match self.due.pop() {
                    Some(Reverse(due)) if due.thread => self.sound(due.id, due.time_s)?,
                    Some(Reverse(due)) if !idle => self.hear(due.id as usize, due.time_s)?,
                    _ => {}
                }
            } else if start_s == f64::INFINITY && event_s == f64::INFINITY {
                return Ok(None);
            } else if start_s <= event_s {
                if let Some(planned) = self.starts.pop_front() {
                    self.start(&planned)?;
                }
            } else if let Some(event) = self.next_event.take() {
                self.next_event = self.events.next().transpose()?;
                let Event::Impact(impact) = &event;
                self.strike(impact)?;
            }
        }
    }

    /// Gives a microphone's line.
    fn hear(&mut self, index: usize, time_s: f64) -> Result<()> {
        let ear = &self.world.ears[index];
        let before_s = std::mem::replace(&mut self.ears[index].passed_s, time_s);
        let cut = time_s > 0.0 && ear.carrier().jumps_at(time_s, before_s)?;
        let key = |pose, cut| ObjectLine::Microphone(MicrophoneKey { microphone: index, time_s, pose, cut });
        if cut {
            self.ready.push_back(key(ear.pose(before_s)?, false));
        }
        self.ready.push_back(key(ear.pose(time_s)?, cut));
        let next_s = ear.carrier().next_key_s(time_s).unwrap_or(f64::INFINITY).min(time_s + HEARTBEAT_S);
        self.due.push(Reverse(Due { time_s: next_s, thread: false, id: index as u64 }));
        Ok(())
    }

    /// Gives a sounding thread's line.
    fn sound(&mut self, id: u64, time_s: f64) -> Result<()> {
        let Some(voice) = self.voices.get_mut(&id) else { return Ok(()) };
        let gain = gain_at(&voice.gain, time_s);
        let before_s = std::mem::replace(&mut voice.passed_s, time_s);
        let line = |verb, position_m| {
            let value = Placement::at(position_m, gain);
            ObjectLine::Thread(Statement { thread: id, path: 0, time_s, verb, value })
        };
        let jumps = voice.start.is_none() && voice.carrier.jumps_at(time_s, before_s)?;
        let ends = time_s >= voice.end_s;
        if let Some(start) = voice.start.take() {
            self.ready.push_back(line(Verb::Start(start), voice.carrier.position_m(time_s)?));
            // A sound without length ends as it starts; its end needs a time of its own.
            voice.end_s = voice.end_s.max(time_s.next_up());
            self.schedule(id, time_s);
            return Ok(());
        }
        if ends && jumps {
            self.ready.push_back(line(Verb::End, voice.carrier.position_m(before_s)?));
        } else {
            let verb = if ends {
                Verb::End
            } else if jumps {
                Verb::Jump
            } else {
                Verb::Key
            };
            self.ready.push_back(line(verb, voice.carrier.position_m(time_s)?));
        }
        if ends {
            self.voices.remove(&id);
            self.last_end_s = self.last_end_s.max(time_s);
        } else {
            self.schedule(id, time_s);
        }
        Ok(())
    }

    fn schedule(&mut self, id: u64, time_s: f64) {
        let Some(voice) = self.voices.get(&id) else { return };
        let mut next_s = voice.end_s.min(time_s + HEARTBEAT_S);
        if let Some(key_s) = voice.carrier.next_key_s(time_s) {
            next_s = next_s.min(key_s);
        }
        if let Some(&(point_s, _)) = voice.gain.iter().find(|&&(point_s, _)| point_s > time_s) {
            next_s = next_s.min(point_s);
        }
        self.due.push(Reverse(Due { time_s: next_s, thread: true, id }));
    }

    /// Begins a thread.
    fn begin(&mut self, time_s: f64, carrier: Carrier, gain: Vec<(f64, f64)>, end_s: f64, start: Start) {
        let id = self.next_thread;
        self.next_thread += 1;
        self.voices.insert(id, Voice { start: Some(start), carrier, gain, end_s, passed_s: time_s });
        self.due.push(Reverse(Due { time_s, thread: true, id }));
    }

    /// Starts a sound that the scene sets by hand.
    fn start(&mut self, planned: &Planned) -> Result<()> {
        let sound: &SceneSound = &self.scene.sounds[planned.sound];
        let (carrier, object) = match sound.emitter {
            Emitter::Position(position_m) => (Carrier::still(position_m), String::new()),
            Emitter::Object(object) => {
                let body = &self.world.objects[object][planned.body];
                let Some(carrier) = &body.carrier else { return Ok(()) };
                (carrier.clone(), body.name.clone())
            }
        };
        let group = Group::Sound(planned.sound, planned.body);
        let (name, variation) =
            self.pick(group, &sound.recordings, sound.repeat, sound.channel, sound.speed_variation)?;
        let key = planned.key.unwrap_or(StartKey { time_s: planned.time_s, gain_db: 0.0, speed: 1.0 });
        let speed = sound.speed * key.speed * variation;
        let natural_end_s = planned.time_s + self.length_s(&name) / speed;
        let end_s = match &sound.timing {
            Timing::Span { to_s: Some(to_s), .. } => natural_end_s.min(*to_s),
            _ if sound.repeat == Repeat::Once => natural_end_s,
            _ => self.end_s,
        };
        let loudest = from_db(sound.gain_db + key.gain_db) * sound.reference_distance_m;
        let gain = faded(loudest, planned.time_s, end_s, sound.fade_in_s, sound.fade_out_s);
        let cause = if planned.key.is_some() { "set by hand" } else { "runs through the scene" };
        let start =
            Start { sound: name, speed, offset_s: 0.0, object, cause: cause.into(), pattern: String::new() };
        self.begin(planned.time_s, carrier, gain, end_s, start);
        Ok(())
    }

    /// Lets both bodies of an impact sound, as their materials have it.
    fn strike(&mut self, impact: &Impact) -> Result<()> {
        if impact.time_s < 0.0 {
            return Ok(());
        }
        for (body, other) in [(&impact.a, &impact.b), (&impact.b, &impact.a)] {
            let Some(index) = self.scene.objects.iter().position(|object| object.body.matches(body)) else {
                continue;
            };
            let material = self.scene.objects[index].material.and_then(|m| self.scene.materials.get(m));
            let Some(sound) = material.and_then(|m| m.impact.as_ref()) else { continue };
            let pair = (body.clone(), other.clone(), index);
            let quiet = self.quiet_until_s.get(&pair).is_some_and(|&until_s| impact.time_s < until_s);
            if impact.impulse_ns >= sound.floor_impulse_ns && !quiet {
                if self.quiet_until_s.len() >= self.most_quiet {
                    self.quiet_until_s.retain(|_, &mut until_s| until_s > impact.time_s);
                    self.most_quiet = LEAST_QUIET.max(2 * self.quiet_until_s.len());
                }
                self.quiet_until_s.insert(pair, impact.time_s + sound.retrigger_s);
                self.strike_one(impact, body, other, index, sound)?;
            }
        }
        Ok(())
    }

    fn strike_one(
        &mut self,
        impact: &Impact,
        body: &str,
        other: &str,
        index: usize,
        sound: &ImpactSound,
    ) -> Result<()> {
        let bodies = &self.world.objects[index];
        let named = bodies.iter().find(|b| b.name.rsplit('/').next() == Some(body)).or(bodies.first());
        let carrier = match named.and_then(|b| b.carrier.as_ref()) {
            Some(carrier) => carrier.holding(impact.position_m, impact.time_s)?,
            None => Carrier::still(impact.position_m),
        };
        let object = named
            .filter(|_| bodies.len() > 1)
            .map_or_else(|| self.scene.objects[index].name.clone(), |b| b.name.clone());
        let (name, speed) =
            self.pick(Group::Impact(index), &sound.recordings, Repeat::Once, None, sound.speed_variation)?;
        // Pressure is proportional to impulse.
        let level = impact.impulse_ns / sound.reference_impulse_ns;
        let gain = from_db(sound.gain_db) * level * sound.reference_distance_m;
        let end_s = impact.time_s + self.length_s(&name) / speed;
        let cause = format!(
            "{body} struck by {other}, {:.4} N s, {}:{}-{}",
            impact.impulse_ns, impact.cause.log, impact.cause.first_line, impact.cause.last_line
        );
        let start = Start { sound: name, speed, offset_s: 0.0, object, cause, pattern: String::new() };
        self.begin(impact.time_s, carrier, vec![(impact.time_s, gain)], end_s, start);
        Ok(())
    }

    fn length_s(&self, sound: &str) -> f64 {
        self.lengths_s.get(sound).copied().unwrap_or(0.0)
    }

    /// Picks one of several recordings, never the same twice running, and a variation of its speed.
    fn pick(
        &mut self,
        group: Group,
        recordings: &[Asset],
        repeat: Repeat,
        channel: Option<usize>,
        variation: f64,
    ) -> Result<(String, f64)> {
        let random = Random::new(self.scene.seed, group.number());
        let picks = self.picks.entry(group).or_default();
        let index = match picks.last {
            Some(last) if recordings.len() > 1 => {
                let other = random.below(2 * picks.count, recordings.len() - 1);
                other + usize::from(other >= last)
            }
            _ => random.below(2 * picks.count, recordings.len()),
        };
        let speed = 1.0 + variation * (2.0 * random.uniform(2 * picks.count + 1) - 1.0);
        picks.count += 1;
        picks.last = Some(index);
        let sound =
            recordings.get(index).and_then(|a| self.header.sounds.iter().find(|s| is(s, a, repeat, channel)));
        match sound {
            Some(sound) => Ok((sound.name.clone(), speed)),
            None => Err(Error::new("a sound of the scene is not among those of its score")
                .in_file(&self.scene.file)
                .at(Place::Part(recordings.get(index).map_or("", |a| &a.name).to_owned()))),
        }
    }
}

impl<E: Iterator<Item = Result<Event>>> Iterator for Composer<'_, E> {
    type Item = Result<ObjectLine>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.state == State::Over {
            return None;
        }
        let step = self.step().transpose();
        if !matches!(step, Some(Ok(_))) {
            self.state = State::Over;
        }
        step
    }
}

/// Decibels of pressure to a factor.
fn from_db(db: f64) -> f64 {
    10f64.powf(db / 20.0)
}

/// The gain over time of a sound that fades in and out.
fn faded(gain: f64, start_s: f64, end_s: f64, fade_in_s: f64, fade_out_s: f64) -> Vec<(f64, f64)> {
    let fades_s = fade_in_s + fade_out_s;
    // Where the sound is shorter than its fades they share it.
    let share = if fades_s > 0.0 { ((end_s - start_s) / fades_s).min(1.0) } else { 1.0 };
    let mut points = Vec::new();
    if fade_in_s > 0.0 {
        points.push((start_s, 0.0));
    }
    points.push((start_s + fade_in_s * share, gain));
    if fade_out_s > 0.0 {
        points.push((end_s - fade_out_s * share, gain));
        points.push((end_s, 0.0));
    }
    points
}

fn gain_at(points: &[(f64, f64)], time_s: f64) -> f64 {
    let after = points.partition_point(|&(t, _)| t <= time_s);
    match (after.checked_sub(1).map(|i| points[i]), points.get(after)) {
        (Some((t0, g0)), Some(&(t1, g1))) => g0 + (g1 - g0) * (time_s - t0) / (t1 - t0),
        (Some((_, g)), None) | (None, Some(&(_, g))) => g,
        (None, None) => 0.0,
    }
}
