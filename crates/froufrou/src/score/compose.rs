//! From a scene and what happens in it to a score: which sound starts when, where it rides and how
//! loud it is.
//!
//! Lines come out in time order as they are asked for, so that a score of any length is made in the
//! memory of the threads that sound at once.

mod cloth;
mod contacts;
mod events;
mod going;
mod grains;
mod learning;
mod palette;
mod paper;
mod presence;
mod voice;

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap, HashMap, VecDeque};
use std::sync::Arc;
use std::sync::mpsc::Receiver;

use self::cloth::Wardrobe;
use self::contacts::LEAST_QUIET;
pub use self::events::Events;
use self::going::Going;
use self::grains::Flow;
use self::paper::Papers;
use self::voice::{Follows, Place, Telling, Voice, faded};
use super::retarget::{self, Repertoire, Shader};
use super::{
    Action, Cue, Header, Microphone, MicrophoneKey, ObjectHeader, ObjectLine, Order, Pattern, Radiation,
    Sound, Start, Statement, Verb,
};
use crate::corpus::cloth::ClothSound;
use crate::corpus::dictionary::Dictionary;
use crate::corpus::paper::PaperSound;
use crate::motion::event::{Event, Friction};
use crate::motion::moving_cloth::buckle_energies;
use crate::motion::rub::Rubbing;
use crate::random::Random;
use crate::scene::carrier::Carrier;
use crate::scene::file::{Acoustics, Emitter, Material, Played, Scene, SceneSound, StartKey, Timing};
use crate::scene::presence::Presence;
use crate::scene::world::World;
use crate::time::Time;
use crate::{Error, Result};

/// Where nothing moves, a line comes this often all the same, so that a score can be mixed as it is
/// read, however long a sound lasts.
const HEARTBEAT_S: f64 = 1.0;

/// The name of what plays nothing, whose keys let time go on where lines come as things happen. It is thread 0.
pub const PULSE: &str = "";

/// So often a thread is told how the wind blows.
const WIND_STEP_S: f64 = 0.1;

/// Where lines are further apart than [`WIND_STEP_S`], the speed changes within this time of them alone: what has
/// come to rest is silent at once, and what rests until the next line does not swell towards it.
const BEND_S: f64 = 0.02;

/// Microphones move on for this long after the last thread ends: the sound of a kilometre away.
const LISTEN_ON_S: f64 = 3.0;

/// What a scene plays and to whom: the header of its score. Files are named relative to the scene's
/// folder.
pub fn header(scene: &Scene, world: &World) -> Result<ObjectHeader> {
    let mut receivers = Vec::with_capacity(scene.microphones.len());
    for (microphone, ear) in scene.microphones.iter().zip(&world.ears) {
        let moves = ear.carrier().next_key_s(f64::MIN).is_some();
        let fixed = if moves { None } else { Some(ear.pose(0.0)?) };
        let (name, pickup) = (microphone.name.clone(), microphone.pickup.clone());
        receivers.push(Microphone { name, pickup, fixed });
    }
    let mut patterns: Vec<Pattern> = Vec::new();
    let has_paper = scene.materials.iter().any(|material| material.paper.is_some());
    let disk = has_paper.then(paper::radiation);
    for radiation in scene.sounds.iter().filter_map(|sound| sound.pattern.as_ref()).chain(&disk) {
        if patterns.iter().all(|pattern| pattern.radiation != *radiation) {
            let name = format!("pattern-{}", patterns.len() + 1);
            patterns.push(Pattern { name, radiation: radiation.clone() });
        }
    }
    Ok(Header {
        speed_of_sound_mps: scene.speed_of_sound_mps,
        duration_s: scene.duration_s,
        seed: scene.seed,
        patterns,
        surroundings: surroundings(scene),
        sounds: palette::sounds(scene),
        ..Header::new(Order::Time, receivers)
    })
}

/// Finds out whether what a sound of a scene plays can do what the scene wants of it.
///
/// # Errors
/// A control that it does not have; strikes for what does not ring.
pub(crate) fn check_use(scene: &Scene, sound: &SceneSound, facts: &SoundFacts) -> Result<()> {
    let fault = |what: &str| Error::new(what).in_file(&scene.file);
    let mut set = sound.set.iter().flat_map(|key| &key.values).map(|(name, _)| name);
    if let Some(unknown) = set.find(|name| !facts.controls.contains(name)) {
        let what = format!("`set` names `{unknown}`, which its instrument has no control for");
        return Err(fault(&what).help(match facts.controls.as_slice() {
            [] => "it has none".into(),
            known => format!("it has {}", known.join(", ")),
        }));
    }
    if matches!(sound.timing, Timing::Strikes(_)) && facts.ring_s.is_none() {
        return Err(fault("an instrument is struck by `at`, and it does not ring")
            .help("give it `from` and `to` instead"));
    }
    Ok(())
}

/// Which sounds of a scene play a sound of its score's header, by its name.
pub(crate) fn uses(scene: &Scene, header: &ObjectHeader) -> BTreeMap<String, Vec<usize>> {
    let mut uses: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (index, sound) in scene.sounds.iter().enumerate() {
        let wanted = palette::sound_of(&sound.played, 0, &scene.instruments);
        if let Some(played) = header.sounds.iter().find(|sound| palette::same(sound, &wanted)) {
            uses.entry(played.name.clone()).or_default().push(index);
        }
    }
    uses
}

/// The scene itself, where its bodies, its walls or its air do something to sound.
fn surroundings(scene: &Scene) -> Option<String> {
    let name = scene.file.file_name()?.to_string_lossy();
    let acts = |material: &Material| material.acoustics != Acoustics::default();
    let spreads = scene.sounds.iter().any(|sound| sound.pattern == Some(Radiation::Surface));
    let is_enclosed = scene.enclosing.is_some() || scene.air.is_some();
    let is_heard = scene.materials.iter().any(acts) || is_enclosed || spreads;
    is_heard.then(|| name.into_owned())
}

/// What has to be known of a sound to say when it starts and ends.
#[derive(Debug, Clone, PartialEq)]
pub struct SoundFacts {
    /// Seconds it lasts at speed 1; infinite where it does not end by itself.
    pub length_s: f64,
    /// Of a recording that repeats: seconds of one period.
    pub period_s: Option<f64>,
    /// Of an instrument that is struck: seconds until it is silent again.
    pub ring_s: Option<f64>,
    /// The controls of an instrument.
    pub controls: Vec<String>,
    /// Of grains: their corpus.
    pub grains: Option<Arc<Dictionary>>,
    /// Of cloth: how it sounds.
    pub cloth: Option<Arc<ClothSound>>,
    /// Of paper: its database.
    pub paper: Option<Arc<PaperSound>>,
}

/// Where a composer learns of sounds that are still being loaded, by their names.
pub type Learning = Receiver<(String, SoundFacts)>;

/// Makes the lines of a scene's score. An iterator; it ends after its first error.
pub struct Composer<'a, E> {
    scene: &'a Scene,
    world: &'a World,
    header: &'a ObjectHeader,
    /// What is known of each sound of the header, by name.
    facts: BTreeMap<String, SoundFacts>,
    end_s: f64,
    events: E,
    next_event: Option<Event>,
    /// Starts set by hand, in time order.
    starts: VecDeque<Planned>,
    voices: BTreeMap<u64, Voice>,
    next_thread: u64,
    /// When the last thread to end so far did.
    last_end_s: f64,
    due: BinaryHeap<DueAt>,
    ears: Vec<EarState>,
    picks: HashMap<Group, Picks>,
    /// Until when a pair of bodies is quiet in an object: the dead time of its material.
    quiet_until_s: HashMap<(String, String, usize), f64>,
    /// How many of those there may be before the ones that are over are forgotten.
    most_quiet: usize,
    /// The threads of bodies that ring after a strike, by object and body.
    ringing: HashMap<(usize, String), u64>,
    /// The threads of pairs of bodies that slide or roll along each other, by their names, the object and how.
    rubbing: HashMap<(String, String, usize, Rubbing), u64>,
    /// The grains of those threads that have them.
    streams: HashMap<u64, Flow>,
    /// What the grains of materials are chosen from, by the name of the sound.
    repertoires: HashMap<String, Arc<Repertoire>>,
    /// The scripts that say what grains play, by their names.
    shaders: HashMap<String, Shader>,
    /// What its cloths sound like.
    wardrobe: Wardrobe,
    /// What its papers sound like.
    papers: Papers,
    /// The threads of what goes on in cloths and papers.
    going: BTreeMap<Going, u64>,
    /// Events that have been foreseen and are still to come.
    foreseen: VecDeque<Event>,
    /// By how much events are foreseen, in seconds: for what begins before them.
    foresight_s: f64,
    /// Where nothing moves, lines are no further apart, in seconds.
    beat_s: f64,
    pulses: bool,
    /// What was told last to be known.
    told_s: f64,
    presence: Presence,
    /// Where it learns of sounds that are still being loaded, and starts that wait for them.
    learning: Option<Learning>,
    /// Whether there may be sounds of which nothing is known.
    learns: bool,
    waiting: Vec<Planned>,
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
#[derive(Clone)]
struct Planned {
    time_s: f64,
    sound: usize,
    body: usize,
    key: Option<StartKey>,
    /// What it is of, where that appeared, and when that was.
    of: Option<String>,
    origin_s: f64,
}

/// What recordings are picked for: a sound of the scene, or the impacts, slides or rolls of an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Group {
    Sound(usize, usize),
    Impact(usize),
    Rub(Rubbing, usize),
}

impl Group {
    /// Its number among all groups, for the addresses of random numbers.
    fn number(self) -> u64 {
        match self {
            Group::Sound(sound, body) => ((sound as u64) << 32) + ((body as u64) << 1),
            Group::Impact(object) => ((object as u64) << 1) + 1,
            Group::Rub(Rubbing::Slide, object) => (1 << 62) + object as u64,
            Group::Rub(Rubbing::Roll, object) => (3 << 61) + object as u64,
        }
    }
}

/// How often a group has picked, and what it picked last.
#[derive(Default)]
struct Picks {
    count: u64,
    last: Option<usize>,
}

struct EarState {
    moves: bool,
    passed_s: f64,
}

/// What has something to say: at one time microphones before threads, and what a thread is told after its line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Due {
    Microphone(usize),
    Thread(u64, Says),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Says {
    Line,
    Cue,
}

/// What is due first comes first out of a heap.
type DueAt = Reverse<(Time, Due)>;

/// A microphone has a line at a time.
fn hears_at(time_s: f64, microphone: usize) -> DueAt {
    Reverse((Time(time_s), Due::Microphone(microphone)))
}

/// A thread has a line at a time.
fn line_at(time_s: f64, thread: u64) -> DueAt {
    Reverse((Time(time_s), Due::Thread(thread, Says::Line)))
}

/// A thread is told something at a time.
fn cue_at(time_s: f64, thread: u64) -> DueAt {
    Reverse((Time(time_s), Due::Thread(thread, Says::Cue)))
}

impl<'a, E: Iterator<Item = Result<Event>>> Composer<'a, E> {
    /// A composer for a scene.
    ///
    /// `facts` tells of each sound of the header, by name; `events` come in time order; `end_s` is when
    /// the scene is over for sounds that run through it.
    ///
    /// # Errors
    /// A scene with sounds that run through it and nothing that says how long it is; an instrument that
    /// is struck and does not ring, or is told what it has no control for.
    pub fn new(
        scene: &'a Scene,
        world: &'a World,
        header: &'a ObjectHeader,
        facts: impl IntoIterator<Item = (String, SoundFacts)>,
        end_s: f64,
        events: E,
    ) -> Result<Self> {
        let moves = |microphone: &Microphone| microphone.fixed.is_none();
        let mut composer = Self {
            scene,
            world,
            header,
            facts: facts.into_iter().collect(),
            end_s,
            events,
            next_event: None,
            starts: VecDeque::new(),
            voices: BTreeMap::new(),
            next_thread: 1,
            last_end_s: 0.0,
            due: BinaryHeap::new(),
            ears: header.receivers.iter().map(|m| EarState { moves: moves(m), passed_s: 0.0 }).collect(),
            picks: HashMap::new(),
            quiet_until_s: HashMap::new(),
            most_quiet: LEAST_QUIET,
            ringing: HashMap::new(),
            rubbing: HashMap::new(),
            streams: HashMap::new(),
            repertoires: HashMap::new(),
            shaders: HashMap::new(),
            wardrobe: Wardrobe::default(),
            papers: Papers::default(),
            going: BTreeMap::new(),
            foreseen: VecDeque::new(),
            foresight_s: 0.0,
            beat_s: HEARTBEAT_S,
            pulses: false,
            told_s: 0.0,
            presence: Presence::default(),
            learning: None,
            learns: false,
            waiting: Vec::new(),
            ready: VecDeque::new(),
            state: State::New,
        };
        for (name, facts) in &composer.facts {
            if let Some(dictionary) = &facts.grains {
                composer.repertoires.insert(name.clone(), Arc::new(Repertoire::new(dictionary.clone())));
                composer.foresight_s = retarget::LONGEST_LEAD_S;
            }
        }
        let mut cloths = composer.facts.values().filter_map(|facts| facts.cloth.as_ref());
        let pops = cloths.any(|cloth| !cloth.pops().is_empty());
        let energies = if pops { buckle_energies(scene, world)? } else { BTreeMap::new() };
        composer.wardrobe = Wardrobe::new(&composer, &energies)?;
        composer.papers = Papers::new(&composer);
        let leads_s = composer.wardrobe.longest_lead_s().max(composer.papers.longest_lead_s());
        composer.foresight_s = composer.foresight_s.max(leads_s);
        let grains = scene.materials.iter().filter_map(|material| material.grains.as_ref());
        for shader in grains.filter_map(|grains| grains.shader.as_ref()) {
            if !composer.shaders.contains_key(&shader.name) {
                composer.shaders.insert(shader.name.clone(), Shader::open(&shader.path)?);
            }
        }
        composer.starts = composer.planned()?;
        Ok(composer)
    }

    /// The same for what is told as it happens. Lines are no more than `step_s` seconds apart, and there is always a next
    /// one: one of a thread that plays [`PULSE`], where nothing else sounds; such a score has no end. Nothing is foreseen:
    /// what would begin before its event begins with it, and what goes on goes from moment to moment evenly, a moment late.
    #[must_use]
    pub fn pulsing(self, step_s: f64) -> Self {
        Self { beat_s: step_s.min(HEARTBEAT_S), foresight_s: 0.0, pulses: true, ..self }
    }

    /// The starts that are set by hand, in order of time.
    fn planned(&self) -> Result<VecDeque<Planned>> {
        let mut starts = Vec::new();
        for (index, sound) in self.scene.sounds.iter().enumerate() {
            let name = self.name_of(&sound.played, 0);
            if let Some(facts) = name.and_then(|name| self.facts.get(&name)) {
                check_use(self.scene, sound, facts)?;
            }
            let bodies = match sound.emitter {
                Emitter::Object(object) => self.world.objects[object].len(),
                Emitter::Around(None) => self.header.receivers.len(),
                Emitter::Position(_) | Emitter::Around(Some(_)) => 1,
            };
            for body in 0..bodies {
                starts.extend(self.starts_of(index, body, None)?);
            }
        }
        starts.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        Ok(starts.into())
    }

    /// The starts of one sound of a body, or of something that appeared at a time.
    fn starts_of(&self, index: usize, body: usize, appeared: Option<(&str, f64)>) -> Result<Vec<Planned>> {
        let fault = |what: &str| Error::new(what).in_file(&self.scene.file);
        let sound = &self.scene.sounds[index];
        let origin_s = appeared.map_or(0.0, |(_, time_s)| time_s);
        let start = |time_s, key| {
            let of = appeared.map(|(name, _)| name.to_owned());
            Planned { time_s: origin_s + time_s, sound: index, body, key, of, origin_s }
        };
        Ok(match &sound.timing {
            Timing::Starts(keys) => keys.iter().map(|&key| start(key.time_s, Some(key))).collect(),
            Timing::Strikes(strikes) => {
                strikes.first().map(|&(time_s, _)| start(time_s, None)).into_iter().collect()
            }
            Timing::Span { from_s, to_s } => {
                if sound.played.is_endless() && to_s.is_none() && self.end_s <= *from_s {
                    return Err(fault("a sound runs through the scene, and nothing says how long it is")
                        .help("give the scene a `duration`, or the sound a `to`"));
                }
                vec![start(*from_s, None)]
            }
        })
    }

    fn step(&mut self) -> Result<Option<ObjectLine>> {
        if self.state == State::New {
            self.state = State::Running;
            if self.pulses {
                self.due.push(line_at(0.0, 0));
                self.voices.insert(0, Voice::pulse(Start::new(PULSE)));
            }
            self.next_event = self.events.next().transpose()?;
            for index in (0..self.ears.len()).filter(|&i| self.ears[i].moves) {
                self.due.push(hears_at(0.0, index));
            }
        }
        loop {
            if let Some(line) = self.ready.pop_front() {
                return Ok(Some(line));
            }
            if self.pulses && self.next_event.is_none() {
                self.close();
            }
            let start_s = self.starts.front().map_or(f64::INFINITY, |start| start.time_s);
            let event_s = self.foreseen.front().map_or(f64::INFINITY, Event::time_s);
            let seen_s = self.next_event.as_ref().map_or(f64::INFINITY, Event::time_s) - self.foresight_s;
            let due_s = self.due.peek().map_or(f64::INFINITY, |Reverse((time, _))| time.0);
            let next_s = start_s.min(event_s).min(seen_s);
            if due_s < next_s {
                // Microphones go on for as long as anything sounds, is under way or still to come.
                let silent = self.voices.is_empty() && next_s == f64::INFINITY;
                let idle = silent && due_s > self.last_end_s + LISTEN_ON_S;
                match self.due.pop() {
                    Some(Reverse((time, Due::Thread(id, Says::Line)))) => self.sound(id, time.0)?,
                    Some(Reverse((time, Due::Thread(id, Says::Cue)))) => self.cue(id, time.0),
                    Some(Reverse((time, Due::Microphone(index)))) if !idle => self.hear(index, time.0)?,
                    _ => {}
                }
            } else if next_s == f64::INFINITY {
                return Ok(None);
            } else if start_s <= event_s.min(seen_s) {
                if let Some(planned) = self.starts.pop_front() {
                    self.start(&planned)?;
                }
            } else if seen_s <= event_s {
                if let Some(event) = self.next_event.take() {
                    self.next_event = self.events.next().transpose()?;
                    // What an impact sounds like may begin before it; what slides and rolls is told as it does.
                    match event {
                        Event::Impact(impact) => self.strike(&impact)?,
                        Event::Buckle(buckle) => match self.paper_of(&buckle.cloth) {
                            Some(paper) => self.crumple_paper(&buckle, paper)?,
                            None => self.crumple(&buckle)?,
                        },
                        Event::Change(change) => self.change(&change)?,
                        Event::Quiet(time_s) => {
                            self.told_s = time_s;
                            self.learn();
                        }
                        event => self.foreseen.push_back(event),
                    }
                }
            } else {
                match self.foreseen.pop_front() {
                    Some(Event::Friction(friction)) => match self.paper_of(&friction.cloth) {
                        Some(paper) => {
                            let all = self.as_well(friction);
                            self.rub_paper(&all, paper)?;
                        }
                        None => self.rustle(&friction)?,
                    },
                    Some(Event::Tear(tear)) => self.tear_paper(&tear)?,
                    Some(Event::Flap(flap)) => self.flap(&flap)?,
                    Some(event) => {
                        if let Some((how, rub)) = event.rub() {
                            self.rub(rub, how)?;
                        }
                    }
                    None => {}
                }
            }
        }
    }

    /// A moment of friction, and those that are foreseen of the same sheet at the same time.
    fn as_well(&mut self, friction: Friction) -> Vec<Friction> {
        let mut all = vec![friction];
        let same = self.foreseen.iter().take_while(|event| event.time_s() == all[0].time_s).count();
        let rest = self.foreseen.split_off(same);
        for event in std::mem::replace(&mut self.foreseen, rest).into_iter().rev() {
            match event {
                Event::Friction(other) if other.cloth == all[0].cloth => all.push(other),
                other => self.foreseen.push_front(other),
            }
        }
        // They were taken from the last on.
        all[1..].reverse();
        all
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
        let next_s = ear.carrier().next_key_s(time_s).unwrap_or(f64::INFINITY).min(time_s + self.beat_s);
        self.due.push(hears_at(next_s, index));
        Ok(())
    }

    /// Gives a sounding thread's line.
    fn sound(&mut self, id: u64, time_s: f64) -> Result<()> {
        let Some(voice) = self.voices.get_mut(&id).filter(|voice| voice.due_s == time_s) else {
            return Ok(());
        };
        let gain = voice.gain_at(time_s);
        let before_s = std::mem::replace(&mut voice.passed_s, time_s);
        let jumps = voice.start.is_none() && voice.jumps_at(time_s, before_s)?;
        let ends = time_s >= voice.end_s && voice.start.is_none();
        let verb = match voice.start.take() {
            Some(start) => {
                // A sound without length ends as it starts; its end needs a time of its own.
                voice.end_s = voice.end_s.max(time_s.next_up());
                Verb::Start(start)
            }
            None if ends => Verb::End,
            None if jumps => Verb::Jump,
            None => Verb::Key,
        };
        let placed_s = if ends && jumps { before_s } else { time_s };
        let value = voice.placement(placed_s, gain)?;
        let speed = if ends { None } else { voice.speed_mps(time_s, self.world.wind.as_ref())? };
        self.ready.push_back(ObjectLine::Thread(Statement { thread: id, path: 0, time_s, verb, value }));
        if let Some(speed) = speed {
            let action = Action::Set(vec![("speed".to_owned(), tidy(speed))]);
            self.ready.push_back(ObjectLine::Cue(Cue { thread: id, time_s, action, cause: String::new() }));
        }
        if ends {
            self.voices.remove(&id);
            self.last_end_s = self.last_end_s.max(time_s);
        } else {
            self.schedule(id, time_s)?;
        }
        Ok(())
    }

    /// Tells a thread what it is to be told by now.
    fn cue(&mut self, id: u64, time_s: f64) {
        let Some(voice) = self.voices.get_mut(&id) else { return };
        while let Some(Telling { action, cause, .. }) = voice.cues.pop_front_if(|told| told.time_s <= time_s)
        {
            self.ready.push_back(ObjectLine::Cue(Cue { thread: id, time_s, action, cause }));
        }
        // A voice may yet be told to last longer; one that is over by then is told nothing.
        if let Some(next_s) = voice.cues.front().map(|next| next.time_s) {
            self.due.push(cue_at(next_s, id));
        }
    }

    fn schedule(&mut self, id: u64, time_s: f64) -> Result<()> {
        let changes = self.world.wind.as_ref().is_some_and(|wind| wind.changes());
        let Some(voice) = self.voices.get_mut(&id) else { return Ok(()) };
        let beat_s =
            if voice.speed.is_some() && changes { WIND_STEP_S.min(self.beat_s) } else { self.beat_s };
        let mut next_s = voice.end_s.min(time_s + beat_s.max(voice.beat_s));
        if let Some(key_s) = voice.next_key_s(time_s) {
            next_s = next_s.min(key_s);
        }
        if let Some(&(point_s, _)) = voice.gain.iter().find(|&&(point_s, _)| point_s > time_s) {
            next_s = next_s.min(point_s);
        }
        if voice.speed.is_some() && next_s - time_s > WIND_STEP_S + BEND_S {
            let wind = self.world.wind.as_ref();
            let settled = voice.speed_mps(time_s, wind)? == voice.speed_mps(time_s + BEND_S, wind)?;
            next_s = if settled { next_s - BEND_S } else { time_s + BEND_S };
        }
        voice.due_s = next_s;
        self.due.push(line_at(next_s, id));
        Ok(())
    }

    /// Begins a thread; gives its number.
    fn begin(&mut self, time_s: f64, voice: Voice) -> u64 {
        let id = self.next_thread;
        self.next_thread += 1;
        self.due.push(line_at(time_s, id));
        if let Some(cue_s) = voice.cues.front().map(|first| first.time_s) {
            self.due.push(cue_at(cue_s.max(time_s), id));
        }
        self.voices.insert(id, voice);
        id
    }

    /// Starts a sound that the scene sets by hand.
    fn start(&mut self, planned: &Planned) -> Result<()> {
        let sound: &SceneSound = &self.scene.sounds[planned.sound];
        let (place, object) = match sound.emitter {
            Emitter::Position(position_m) => (Place::Carrier(Carrier::still(position_m)), String::new()),
            Emitter::Around(Some(microphone)) => (Place::Around(microphone), String::new()),
            Emitter::Around(None) => (Place::Around(planned.body), String::new()),
            Emitter::Object(object) => match &planned.of {
                Some(name) => {
                    let Some(carrier) = self.carrier_of(name) else { return Ok(()) };
                    (Place::Carrier(carrier), name.clone())
                }
                None => {
                    let body = &self.world.objects[object][planned.body];
                    let Some(carrier) = body.carrier.as_ref().filter(|_| !self.presence.is_gone(&body.name))
                    else {
                        return Ok(());
                    };
                    (Place::Carrier(carrier.clone()), body.name.clone())
                }
            },
        };
        let group = Group::Sound(planned.sound, planned.body);
        let (name, variation) = self.pick(group, &sound.played, sound.speed_variation)?;
        let facts = self.facts.get(&name);
        if facts.is_none() && self.learns {
            self.waiting.push(planned.clone());
            return Ok(());
        }
        let key = planned.key.unwrap_or(StartKey { time_s: planned.time_s, gain_db: 0.0, speed: 1.0 });
        let speed = sound.speed * key.speed * variation;
        let natural_end_s = planned.time_s + facts.map_or(0.0, |facts| facts.length_s) / speed;
        let mut cues: VecDeque<Telling> = VecDeque::new();
        let end_s = match &sound.timing {
            Timing::Strikes(strikes) => {
                let strike = |&(time_s, blow): &(f64, _)| {
                    Telling::from((planned.origin_s + time_s, Action::Strike(blow)))
                };
                cues.extend(strikes.iter().map(strike));
                let last_s = strikes.last().map_or(planned.time_s, |&(time_s, _)| planned.origin_s + time_s);
                last_s + facts.and_then(|facts| facts.ring_s).unwrap_or(0.0)
            }
            Timing::Span { to_s: Some(to_s), .. } => natural_end_s.min(planned.origin_s + *to_s),
            _ if !sound.played.is_endless() => natural_end_s,
            _ => self.end_s,
        };
        let sets = sound.set.iter().map(|key| {
            let time_s = (planned.origin_s + key.time_s).max(planned.time_s);
            (time_s, Action::Set(key.values.clone()))
        });
        cues.extend(sets.map(Telling::from));
        cues.make_contiguous().sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        // A control of the name is told by the motion, where the author says nothing.
        let told = sound.set.iter().flat_map(|key| &key.values).any(|(name, _)| name == "speed");
        let has_speed = facts.is_some_and(|facts| facts.controls.iter().any(|name| name == "speed"));
        let follows = match place {
            Place::Carrier(_) => Follows::Air,
            Place::Around(_) => Follows::Wind,
        };
        // The same loop around several microphones is heard from several places of it.
        let offset_s = match (sound.emitter, facts.and_then(|facts| facts.period_s)) {
            (Emitter::Around(None), Some(period_s)) => {
                period_s * Random::new(self.scene.seed, group.number()).uniform(u64::MAX)
            }
            _ => 0.0,
        };
        let loudest = from_db(sound.gain_db + key.gain_db)
            * if matches!(place, Place::Around(_)) { 1.0 } else { sound.reference_distance_m };
        let cause = match (&planned.key, &sound.timing) {
            (None, Timing::Span { .. }) => "runs through the scene",
            _ => "set by hand",
        };
        let radiation = sound.pattern.as_ref();
        let pattern = self.header.patterns.iter().find(|pattern| Some(&pattern.radiation) == radiation);
        let pattern = pattern.map_or(String::new(), |pattern| pattern.name.clone());
        let turns = matches!(radiation, Some(Radiation::Harmonics(_)));
        let of = object.clone();
        let start = Start { sound: name, speed, offset_s, object, cause: cause.into(), pattern };
        let gain = faded(loudest, planned.time_s, end_s, sound.fade_in_s, sound.fade_out_s);
        let speed = (has_speed && !told).then_some(follows);
        let time_s = planned.time_s;
        let voice = Voice {
            start: Some(start),
            of,
            place,
            turns,
            gain,
            end_s,
            passed_s: time_s,
            due_s: time_s,
            beat_s: 0.0,
            cues,
            speed,
        };
        self.begin(time_s, voice);
        Ok(())
    }

    /// The name in the header of one of the sounds of what plays.
    fn name_of(&self, played: &Played, index: usize) -> Option<String> {
        self.name_of_sound(&palette::sound_of(played, index, &self.scene.instruments))
    }

    fn name_of_sound(&self, wanted: &Sound) -> Option<String> {
        self.header.sounds.iter().find(|sound| palette::same(sound, wanted)).map(|sound| sound.name.clone())
    }

    /// Picks one of several recordings, never the same twice running, and a variation of its speed.
    fn pick(&mut self, group: Group, played: &Played, variation: f64) -> Result<(String, f64)> {
        let count = match played {
            Played::Recordings { recordings, .. } => recordings.len(),
            Played::Instrument(_) => 1,
        };
        let random = Random::new(self.scene.seed, group.number());
        let picks = self.picks.entry(group).or_default();
        let index = match picks.last {
            Some(last) if count > 1 => {
                let other = random.below(2 * picks.count, count - 1);
                other + usize::from(other >= last)
            }
            _ => random.below(2 * picks.count, count),
        };
        let speed = 1.0 + variation * (2.0 * random.uniform(2 * picks.count + 1) - 1.0);
        picks.count += 1;
        picks.last = Some(index);
        match self.name_of(played, index) {
            Some(name) => Ok((name, speed)),
            None => {
                Err(Error::new("a sound of the scene is not among those of its score")
                    .in_file(&self.scene.file))
            }
        }
    }
}

/// A number rounded far below what is heard, so that a score is good to read.
fn tidy(value: f64) -> f64 {
    (value * 1e9).round() / 1e9 + 0.0
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
