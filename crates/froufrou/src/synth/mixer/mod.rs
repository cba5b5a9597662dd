//! Threads in, blocks out: a score in channel space becomes samples.
//!
//! The mixer reads the lines of a score in time order, just far enough ahead to know the paths of
//! the block that is asked for, and forgets what has sounded. Its memory follows the number of
//! threads that sound at once and the distance between their keys, not the length of the score.

mod share;
mod slice;
mod voices;
mod ways;

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::ops::Range;
use std::sync::{Arc, OnceLock};

use rayon::prelude::*;

use super::bus::Bus;
use super::filter::{Filter, Filters};
use super::instrument::Instrument;
use super::path::{Foresight, PathBuilder, PathKey, Segment};
use super::receivers::Receiver;
use super::sinc::{self, Kernel};
use super::source::Source;
use super::stretch::Stretch;
use super::tiny;
use super::voice::{Playback, Prototype};
use crate::random::Random;
use crate::score::{Action, Arrival, ChannelLine, Cue, LATEST_S, Start, Statement, Verb};
use crate::space::bands::BandFilters;
use crate::{Error, Place, Result};
pub use share::Room;
pub use slice::{Cutter, Desk, Slice};
use voices::Thread;
pub use voices::{Block, Voices};
use ways::{Ways, check_arrival};

/// What a thread can play.
#[derive(Clone)]
pub enum Sounding {
    /// A recording.
    Recording(Prototype),
    /// A synthesised sound.
    Instrument(Arc<dyn Instrument>),
}

/// Something that can be played once it is loaded.
#[derive(Clone, Default)]
pub struct Later(Arc<OnceLock<Sounding>>);

impl Later {
    /// It is loaded.
    pub fn set(&self, sounding: Sounding) {
        // One that is there already stays.
        let _ = self.0.set(sounding.flushed());
    }
}

impl Sounding {
    /// The same without numbers that are too small to be heard.
    fn flushed(self) -> Self {
        match self {
            Sounding::Recording(prototype) => {
                let samples = tiny::without(prototype.samples);
                Sounding::Recording(Prototype { samples, ..prototype })
            }
            instrument => instrument,
        }
    }

    /// Length in seconds at speed 1; infinite for what does not end by itself.
    pub fn duration_s(&self) -> f64 {
        match self {
            Sounding::Recording(prototype) => prototype.duration_s(),
            Sounding::Instrument(_) => f64::INFINITY,
        }
    }
}

impl From<Prototype> for Sounding {
    fn from(prototype: Prototype) -> Self {
        Sounding::Recording(prototype)
    }
}

/// Nothing arrives before it leaves, but a resampled onset rings before it. It does so for this long
/// at most, unless a mixer [looks ahead](Mixer::looking_ahead) for less; what is read so slowly that it would ring
/// for longer begins with less of it.
const ONSET_S: f64 = 1.0;

/// Playback speeds outside of this make positions in the recording that no number can tell apart.
const SPEEDS: std::ops::RangeInclusive<f64> = 1e-6..=1e6;

/// Emission seconds that an arrival second may hold at most within a segment: three times what two
/// keys may be apart.
const FASTEST: f64 = 24.0;

/// A sound that has begun, for the log: a thread, or what one is told for a cause of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct Begun {
    /// The number of the thread.
    pub thread: u64,
    /// When it leaves its source.
    pub time_s: f64,
    /// When it is first heard in any channel.
    pub arrival_s: f64,
    /// Its first gain in the channel where it is loudest.
    pub gain: f64,
    /// What it plays and why.
    pub start: Start,
}

/// Mixes the lines of a channel-space score, which come in time order.
pub struct Mixer<L> {
    lines: L,
    next: Option<ChannelLine>,
    /// Whether the line behind the last one that was taken in has been asked for.
    is_asked: bool,
    names: BTreeMap<String, usize>,
    voices: Voices,
    objects: Vec<String>,
    object_indices: HashMap<String, usize>,
    begun: Vec<Begun>,
    last_arrival_s: f64,
    /// For how long what arrives by each path sounds on, in seconds, where that leads to a bus.
    rings: Vec<Option<f64>>,
    seed: u64,
    /// For so long an onset may ring before its time, in seconds.
    onset_s: f64,
    foresight: Foresight,
    /// Sounds that are not there before somebody needs them.
    later: HashMap<usize, Later>,
    /// What has arrived before this frame has been released.
    released: u64,
    keeps_going: bool,
    silenced: u64,
    faults: Vec<Error>,
}

impl<L: Iterator<Item = Result<ChannelLine>>> Mixer<L> {
    /// A mixer at `rate_hz`, for the lines of a score, its receivers in their order and the sounds that its
    /// `start` lines name.
    ///
    /// # Errors
    /// The first line, where it cannot be read.
    pub fn new(
        rate_hz: u32,
        receivers: Vec<Receiver>,
        sounds: impl IntoIterator<Item = (String, Sounding)>,
        lines: L,
    ) -> Result<Self> {
        let mut mixer = Self::idle(rate_hz, receivers, sounds, lines)?;
        mixer.ask()?;
        Ok(mixer)
    }

    /// The same, which asks for no line before it reads: for lines that are still to be waited for.
    ///
    /// # Errors
    /// A bus that plays into channels that there are not.
    pub fn idle(
        rate_hz: u32,
        receivers: Vec<Receiver>,
        sounds: impl IntoIterator<Item = (String, Sounding)>,
        lines: L,
    ) -> Result<Self> {
        let (mut names, mut soundings) = (BTreeMap::new(), Vec::new());
        for (name, sounding) in sounds {
            names.insert(name, soundings.len());
            soundings.push(sounding.flushed());
        }
        let colours = BandFilters::new(f64::from(rate_hz)).ok();
        let (mut paths, mut channels) = (0, 0);
        let mut runs: Vec<(Range<usize>, usize)> = Vec::new();
        let mut buses: Vec<(usize, Bus)> = Vec::new();
        for receiver in &receivers {
            let range = paths..paths + receiver.paths();
            match (receiver, runs.last_mut()) {
                (Receiver::Bus(bus), _) => buses.push((paths, bus.clone())),
                (_, Some((before, first))) if before.end == paths && *first + before.len() == channels => {
                    before.end = range.end;
                }
                _ => runs.push((range.clone(), channels)),
            }
            (paths, channels) = (range.end, channels + receiver.channels());
        }
        if let Some((_, bus)) = buses.iter().find(|(_, bus)| bus.reaches() > channels) {
            let what = format!("a bus plays into channel {}", bus.reaches());
            return Err(Error::new(format!("{what}; there are {channels}")));
        }
        let mut rings = vec![None; paths];
        for (path, bus) in &buses {
            rings[*path] = Some(bus.tail() as f64 / f64::from(rate_hz));
        }
        let mut voices = Voices {
            rate_hz: f64::from(rate_hz),
            channels,
            paths,
            runs,
            ahead: buses.iter().map(|(_, bus)| bus.lead()).max().unwrap_or(0),
            buses,
            lead: 0,
            tail: 0,
            piece: 0,
            receivers,
            colours,
            identity: Filter::identity(),
            kernel: Kernel::Long,
            sounds: soundings,
            threads: BTreeMap::new(),
            sources: BTreeMap::new(),
        };
        voices.reach();
        Ok(Self {
            lines,
            next: None,
            is_asked: false,
            names,
            voices,
            objects: Vec::new(),
            object_indices: HashMap::new(),
            begun: Vec::new(),
            last_arrival_s: 0.0,
            rings,
            seed: 0,
            onset_s: ONSET_S,
            foresight: Foresight::NextKey,
            later: HashMap::new(),
            released: 0,
            keeps_going: false,
            silenced: 0,
            faults: Vec::new(),
        })
    }

    /// Asks for the next line, if nobody has; true where there is one.
    fn ask(&mut self) -> Result<bool> {
        if !std::mem::replace(&mut self.is_asked, true) {
            self.next = self.lines.next().transpose()?;
        }
        Ok(self.next.is_some())
    }

    /// The same mixer, with the seed of all that is random in synthesised sounds.
    #[must_use]
    pub fn with_seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    /// The same mixer; where it keeps going, a synthesised sound that fails falls silent, and its fault
    /// is told by [`take_faults`](Self::take_faults).
    #[must_use]
    pub fn keeping_going(self, keeps_going: bool) -> Self {
        Self { keeps_going, ..self }
    }

    /// The same mixer, which looks no further ahead than so many seconds, 1 s at most, for onsets that ring before
    /// their time and for what synthesised sounds are told. What is played so slowly that it rings for longer
    /// begins with less of it.
    #[must_use]
    pub fn looking_ahead(self, onset_s: f64) -> Self {
        Self { onset_s: onset_s.clamp(0.0, ONSET_S), ..self }
    }

    /// The same mixer, and sounds that are still being loaded: a line may start one once it is there.
    #[must_use]
    pub fn with_later(mut self, sounds: impl IntoIterator<Item = (String, Later)>) -> Self {
        for (name, later) in sounds {
            let index = self.voices.sounds.len();
            let silent = Prototype { samples: Arc::new([]), rate_hz: self.voices.rate_hz, looped: false };
            self.voices.sounds.push(silent.into());
            self.names.insert(name, index);
            self.later.insert(index, later);
        }
        self
    }

    /// The same mixer, whose channels read sounds by a kernel: the [short](Kernel::Short) one is for many voices at once. Buses
    /// have their own.
    #[must_use]
    pub fn with_kernel(mut self, kernel: Kernel) -> Self {
        self.voices.kernel = kernel;
        self
    }

    /// The same mixer with another foresight: where it has none, what is known of a way ends with its last key, and so it
    /// need not wait for the next one.
    #[must_use]
    pub fn with_foresight(self, foresight: Foresight) -> Self {
        Self { foresight, ..self }
    }

    /// The same mixer, for lines without gains of octave bands: it looks less far ahead, and refuses such gains.
    #[must_use]
    pub fn uncoloured(mut self) -> Self {
        self.voices.colours = None;
        self.voices.reach();
        self
    }

    /// By how many frames what is rendered must be known ahead of its time, beside the ways of the threads.
    pub fn look_ahead(&self) -> u64 {
        let Voices { lead, piece, ahead, rate_hz, .. } = &self.voices;
        (lead + piece + ahead) as u64 + (self.onset_s * rate_hz).ceil() as u64
    }

    /// How many synthesised sounds have failed and fallen silent since this was last asked, and the
    /// faults of the first of them.
    pub fn take_faults(&mut self) -> (u64, Vec<Error>) {
        (std::mem::take(&mut self.silenced), std::mem::take(&mut self.faults))
    }

    /// The objects whose threads have begun so far; stems are numbered by this list.
    pub fn objects(&self) -> &[String] {
        &self.objects
    }

    /// The threads that have begun since this was last asked, in the order of the score.
    pub fn take_begun(&mut self) -> Vec<Begun> {
        std::mem::take(&mut self.begun)
    }

    /// The time of the next line to be read, in seconds, where there is one.
    pub fn next_s(&self) -> Option<f64> {
        self.next.as_ref().map(ChannelLine::time_s)
    }

    /// True where every line has been read; then the latest arrival is known.
    pub fn is_read(&self) -> bool {
        self.is_asked && self.next.is_none()
    }

    /// The time at which the last thread read so far falls silent, in seconds.
    pub fn last_arrival_s(&self) -> f64 {
        self.last_arrival_s
    }

    /// The number of threads in memory.
    pub fn threads(&self) -> usize {
        self.voices.threads.len()
    }

    /// What is needed to render what has been read.
    pub fn voices(&self) -> &Voices {
        &self.voices
    }

    /// Reads on until all that arrives before `end_frame` is known, and synthesises it: at buses, before the frame
    /// that lies their [lead](Bus::lead) behind it.
    ///
    /// # Errors
    /// A line that cannot be read, or one that does not fit those before it; a synthesised sound that
    /// fails, unless the mixer keeps going.
    pub fn read_to(&mut self, end_frame: u64) -> Result<()> {
        let end_frame = end_frame + (self.voices.lead + self.voices.piece + self.voices.ahead) as u64;
        self.read_lines(end_frame)?;
        self.synthesise(self.released, end_frame)
    }

    /// Reads on to a frame and releases what arrives before it, which will not be rendered.
    ///
    /// # Errors
    /// As [`Mixer::read_to`].
    pub fn skip_to(&mut self, frame: u64) -> Result<()> {
        self.read_lines(frame + (self.voices.lead + self.voices.piece) as u64)?;
        let still_heard = frame.saturating_sub((self.voices.tail + self.voices.piece) as u64);
        self.synthesise(still_heard, still_heard)?;
        self.release(frame);
        Ok(())
    }

    fn read_lines(&mut self, end_frame: u64) -> Result<()> {
        let end_s = end_frame as f64 / self.voices.rate_hz;
        while self.ask()? && self.next_s().is_some_and(|next_s| next_s <= end_s + self.onset_s) {
            self.read_line()?;
        }
        let onset_s = self.onset_s;
        let is_open = move |voices: &Voices, id: u64| {
            let mut paths = voices.threads.range((id, 0)..=(id, u32::MAX)).map(|(_, path)| path);
            // What has ended is told nothing more.
            let told = voices
                .sources
                .get(&id)
                .filter(|_| voices.threads.get(&(id, 0)).is_some_and(|direct| !direct.ended));
            let start_s = |direct: &Thread| direct.playback.start_s;
            let told_s = told
                .and_then(|source| Some(source.known_s() + start_s(voices.threads.get(&(id, 0))?)))
                .unwrap_or(f64::INFINITY);
            // A little more than is heard is synthesised.
            paths.any(|path| path.known_s() < end_s) || told_s < end_s + onset_s
        };
        let Voices { threads, sources, .. } = &self.voices;
        let unknown = threads.iter().filter(|(_, path)| path.known_s() < end_s).map(|(&(id, _), _)| id);
        let untold = sources.keys().copied().filter(|&id| is_open(&self.voices, id));
        let mut open: BTreeSet<u64> = unknown.chain(untold).collect();
        while !open.is_empty() && self.ask()? {
            let id = self.read_line()?;
            if !is_open(&self.voices, id) {
                open.remove(&id);
            }
        }
        if self.is_read() {
            // A thread that the score leaves open sounds no longer than its last key.
            let open: Vec<(u64, u32)> =
                self.voices.threads.iter().filter(|(_, t)| !t.ended).map(|(&of, _)| of).collect();
            for of in open {
                self.end(of, None);
            }
        }
        Ok(())
    }

    /// Makes the signals of synthesised threads, as far as they are heard between two frames.
    fn synthesise(&mut self, begin_frame: u64, end_frame: u64) -> Result<()> {
        let Voices { rate_hz, threads, sources, .. } = &mut self.voices;
        let rate_hz = *rate_hz;
        let (begin_s, end_s) = (begin_frame as f64 / rate_hz, end_frame as f64 / rate_hz);
        let around = |ratio: f64| sinc::half_width(ratio) as f64 + 2.0;
        let mut work: Vec<(u64, &mut Source, [u64; 2])> = Vec::new();
        for (&id, source) in sources {
            let paths = || threads.range((id, 0)..=(id, u32::MAX)).map(|(_, path)| path);
            let Some(start_s) = paths().next().map(|path| path.playback.start_s) else { continue };
            let Some(to_s) = paths().filter_map(|path| path.emitted_before_s(end_s)).max_by(f64::total_cmp)
            else {
                continue;
            };
            let from_s = paths().map(|path| path.emitted_from_s(begin_s)).fold(f64::INFINITY, f64::min);
            // What is still to come may be faster than what is known.
            let fastest = paths().map(|path| path.fastest_before(end_s)).fold(1.0, f64::max);
            let from = ((from_s.min(to_s) - start_s) * rate_hz - around(FASTEST)).max(0.0) as u64;
            let to = ((to_s - start_s) * rate_hz + around(fastest)).max(0.0) as u64;
            work.push((id, source, [from, to]));
        }
        let made = work.into_par_iter().map(|(id, source, [from, to])| (id, source.make(from, to)));
        let made: Vec<(u64, Result<()>)> = made.collect();
        let failed = made.into_iter().filter_map(|(id, made)| Some((id, made.err()?)));
        let sound = |id: u64| threads.get(&(id, 0)).map(|thread| thread.sound);
        let faults: Vec<Error> =
            failed.map(|(id, fault)| in_thread(fault, id, sound(id), &self.names)).collect();
        if faults.is_empty() {
            return Ok(());
        }
        if self.keeps_going {
            self.silenced += faults.len() as u64;
            let room = MOST_FAULTS.saturating_sub(self.faults.len());
            self.faults.extend(faults.into_iter().take(room));
            // What has failed is silent from there on and does not fail again.
            return self.synthesise(begin_frame, end_frame);
        }
        faults.into_iter().next().map_or(Ok(()), Err)
    }

    /// Forgets what has been heard before `frame`.
    pub fn release(&mut self, frame: u64) {
        let still_heard = frame.saturating_sub(self.voices.tail as u64);
        self.released = self.released.max(still_heard.saturating_sub(self.voices.piece as u64));
        let time_s = still_heard as f64 / self.voices.rate_hz;
        self.voices.threads.retain(|_, thread| {
            for stretches in &mut thread.stretches {
                stretches.retain(|stretch| stretch.segment.end_s > time_s);
                stretches.iter_mut().for_each(|stretch| stretch.release(frame));
            }
            if !thread.filters.is_empty() {
                let ends = |Stretch { segment, .. }: &Stretch| {
                    [0, 1].map(|side| [segment.filter[side], segment.spread[side]])
                };
                let known = thread.stretches.iter().flatten().flat_map(ends);
                let coming = thread.builders.iter().flat_map(PathBuilder::keys);
                let coming = coming.map(|key| [key.filter, key.spread]);
                thread.filters.release(known.chain(coming));
            }
            !(thread.ended && thread.stretches.iter().all(Vec::is_empty))
        });
        let Voices { threads, sources, .. } = &mut self.voices;
        sources.retain(|&id, _| threads.range((id, 0)..=(id, u32::MAX)).next().is_some());
    }

    /// Takes the next line in; gives its thread.
    fn read_line(&mut self) -> Result<u64> {
        let Some(line) = self.next.take() else {
            return Err(Error::new("the score has no more lines"));
        };
        self.is_asked = false;
        if self.foresight == Foresight::NextKey {
            self.ask()?;
        }
        let id = line.thread();
        if !(0.0..=LATEST_S).contains(&line.time_s()) {
            return Err(Error::new(format!("thread {id} has a line at {} s", line.time_s()))
                .help(format!("a soundtrack can have times from 0 to {LATEST_S} s")));
        }
        match line {
            ChannelLine::Cue(cue) => self.cue(&cue)?,
            ChannelLine::Thread(statement) => self.follow(statement)?,
        }
        Ok(id)
    }

    /// Takes a line of a path in.
    fn follow(&mut self, line: Statement<Vec<Arrival>>) -> Result<()> {
        let id = line.thread;
        if line.value.len() != self.voices.receivers.len() {
            return Err(Error::new(format!(
                "thread {id} has {} pairs of gain and delay at {} s; there are {} outputs",
                line.value.len(),
                line.time_s,
                self.voices.receivers.len()
            )));
        }
        for (index, (arrival, receiver)) in line.value.iter().zip(&self.voices.receivers).enumerate() {
            check_arrival(arrival, receiver).map_err(|what| {
                let output = index + 1;
                Error::new(format!("thread {id} has {what} in output {output} at {} s", line.time_s))
            })?;
        }
        if self.voices.colours.is_none() && line.value.iter().any(|arrival| arrival.bands.is_some()) {
            let what = format!(
                "thread {id} has octave bands, which cannot be told apart at {}",
                self.voices.rate_hz
            );
            return Err(Error::new(format!("{what} Hz"))
                .help("render at 8000 to 192000 Hz, by a mixer that is not uncoloured"));
        }
        let of = (id, line.path);
        match line.verb {
            Verb::Start(start) => self.start(id, line.time_s, start, &line.value)?,
            Verb::Path => self.path(of, line.time_s, &line.value)?,
            Verb::Key => self.through(of, line.time_s, &line.value, false)?,
            Verb::Jump => self.through(of, line.time_s, &line.value, true)?,
            Verb::End => {
                self.thread(of)?;
                self.end(of, Some((line.time_s, &line.value)));
            }
        }
        Ok(())
    }

    /// What begins in a thread as it is told something.
    fn begun_by(&self, cue: &Cue, thread: &Thread) -> Begun {
        let heard = thread.builders.iter().zip(&self.voices.receivers);
        let direct =
            || heard.clone().filter(|(_, receiver)| receiver.channels() > 0).map(|(path, _)| path.last());
        let sound = self.names.iter().find(|&(_, &index)| index == thread.sound);
        let louder = match &cue.action {
            Action::Grain(grain) => grain.gain,
            Action::Set(_) | Action::Strike(_) => 1.0,
        };
        Begun {
            thread: cue.thread,
            time_s: cue.time_s,
            arrival_s: cue.time_s + direct().map(|key| key.delay_s).fold(f64::INFINITY, f64::min),
            gain: louder * direct().map(|key| key.gain.abs()).fold(0.0, f64::max),
            start: Start {
                object: self.objects[thread.object].clone(),
                cause: cue.cause.clone(),
                ..Start::new(sound.map_or("", |(name, _)| name))
            },
        }
    }

    /// Tells a synthesised sound what is said to it.
    fn cue(&mut self, cue: &Cue) -> Result<()> {
        let id = cue.thread;
        let direct = self.thread((id, 0))?;
        let (start_s, sound) = (direct.playback.start_s, direct.sound);
        if !cue.cause.is_empty() {
            let begun = self.voices.threads.get(&(id, 0)).map(|thread| self.begun_by(cue, thread));
            self.begun.extend(begun);
        }
        let Some(source) = self.voices.sources.get_mut(&id) else {
            return Err(Error::new(format!("thread {id} plays a recording, which can be told nothing")));
        };
        let told = source.cue((cue.time_s - start_s).max(0.0), &cue.action);
        told.map_err(|fault| in_thread(fault, id, Some(sound), &self.names))
    }

    fn thread(&mut self, of: (u64, u32)) -> Result<&mut Thread> {
        let named = |(id, path): (u64, u32)| if path == 0 { format!("{id}") } else { format!("{id}/{path}") };
        self.voices
            .threads
            .get_mut(&of)
            .filter(|t| !t.ended)
            .ok_or_else(|| Error::new(format!("thread {} has not started, or has ended", named(of))))
    }

    /// Another path of a thread begins.
    fn path(&mut self, of: (u64, u32), time_s: f64, value: &[Arrival]) -> Result<()> {
        let direct = self.thread((of.0, 0))?;
        let (sound, playback, object) = (direct.sound, direct.playback, direct.object);
        // It begins within the sound, but for one that begins with it.
        let fades_in = direct.fades_in || time_s > playback.start_s;
        let (lead_s, foresight) = (direct.lead_s, self.foresight);
        let Voices { threads, receivers, colours, paths, .. } = &mut self.voices;
        let ways = Ways { receivers, colours: colours.as_ref() };
        match threads.entry(of) {
            Entry::Occupied(mut before) if before.get().ended => {
                // What is still under way from before goes on.
                let path = before.get_mut();
                let keys = ways.keys(&mut path.filters, time_s, value);
                path.builders = keys
                    .into_iter()
                    .map(|key| PathBuilder::new(key, fades_in, lead_s).with(foresight))
                    .collect();
                path.ended = false;
            }
            Entry::Occupied(_) => {
                return Err(Error::new(format!("path {}/{} begins twice", of.0, of.1)));
            }
            Entry::Vacant(place) => {
                let mut filters = Filters::default();
                let keys = ways.keys(&mut filters, time_s, value);
                let builders = keys
                    .into_iter()
                    .map(|key| PathBuilder::new(key, fades_in, lead_s).with(foresight))
                    .collect();
                place.insert(Thread {
                    sound,
                    playback,
                    object,
                    builders,
                    stretches: unheard(*paths),
                    filters,
                    ended: false,
                    fades_in,
                    lead_s,
                });
            }
        }
        Ok(())
    }

    fn start(&mut self, id: u64, time_s: f64, start: Start, value: &[Arrival]) -> Result<()> {
        let Some(&sound) = self.names.get(&start.sound) else {
            return Err(Error::new(format!("thread {id} plays an unknown sound `{}`", start.sound)));
        };
        if let Some(later) = self.later.get(&sound) {
            let Some(there) = later.0.get() else {
                return Err(Error::new(format!(
                    "thread {id} plays `{}`, which is not loaded yet",
                    start.sound
                )));
            };
            self.voices.sounds[sound] = there.clone();
            self.later.remove(&sound);
        }
        if !SPEEDS.contains(&start.speed) {
            return Err(Error::new(format!("thread {id} plays at speed {}", start.speed)).help(format!(
                "speeds from {:e} to {:e} can be mixed",
                SPEEDS.start(),
                SPEEDS.end()
            )));
        }
        if !(0.0..=LATEST_S).contains(&start.offset_s) {
            return Err(Error::new(format!("thread {id} begins {} s into its recording", start.offset_s)));
        }
        let playback = Playback { start_s: time_s, speed: start.speed, offset_s: start.offset_s };
        let rate_hz = self.voices.rate_hz;
        let (fades_in, sound_rate_hz) = match &self.voices.sounds[sound] {
            Sounding::Recording(prototype) => (playback.fades_in(prototype), prototype.rate_hz),
            Sounding::Instrument(instrument) => {
                if start.speed != 1.0 || start.offset_s != 0.0 {
                    let what = format!("thread {id} plays a synthesised sound with a speed or an offset");
                    return Err(Error::new(what).help("only a recording can have one"));
                }
                let random = Random::new(self.seed ^ SOURCES, id);
                let source = Source::new(instrument.as_ref(), rate_hz, random)
                    .map_err(|fault| in_thread(fault, id, Some(sound), &self.names))?;
                self.voices.sources.insert(id, source.with(self.foresight));
                // What is struck is silent before; all else sounds already.
                (instrument.ring_s().is_none(), rate_hz)
            }
        };
        let lead_s = playback.lead_s(sound_rate_hz, rate_hz).min(self.onset_s);
        let foresight = self.foresight;
        let mut filters = Filters::default();
        let Voices { receivers, colours, .. } = &self.voices;
        let ways = Ways { receivers, colours: colours.as_ref() };
        let keys = ways.keys(&mut filters, time_s, value);
        let builders =
            keys.into_iter().map(|key| PathBuilder::new(key, fades_in, lead_s).with(foresight)).collect();
        let object = match self.object_indices.get(&start.object) {
            Some(&object) => object,
            None => {
                self.object_indices.insert(start.object.clone(), self.objects.len());
                self.objects.push(start.object.clone());
                self.objects.len() - 1
            }
        };
        let stretches = unheard(self.voices.paths);
        // What goes into a tail is heard later, and softer.
        let heard = value.iter().zip(&self.voices.receivers);
        let direct = || heard.clone().filter(|(_, receiver)| receiver.channels() > 0).map(|(value, _)| value);
        self.begun.push(Begun {
            thread: id,
            time_s,
            arrival_s: time_s + direct().map(|v| v.delay_s).fold(f64::INFINITY, f64::min),
            gain: direct().map(|v| v.gain.abs()).fold(0.0, f64::max),
            start,
        });
        let ended = false;
        let thread =
            Thread { sound, playback, object, builders, stretches, filters, ended, fades_in, lead_s };
        if self.voices.threads.insert((id, 0), thread).is_some() {
            return Err(Error::new(format!("thread {id} starts twice")));
        }
        Ok(())
    }

    fn through(&mut self, of: (u64, u32), time_s: f64, value: &[Arrival], jump: bool) -> Result<()> {
        self.thread(of)?;
        let Voices { threads, receivers, colours, .. } = &mut self.voices;
        let Some(thread) = threads.get_mut(&of) else { return Ok(()) };
        let ways = Ways { receivers, colours: colours.as_ref() };
        let keys = ways.keys(&mut thread.filters, time_s, value);
        let paths = thread.builders.iter_mut().zip(&mut thread.stretches);
        let mut echoes = self.rings.iter();
        for ((builder, stretches), key) in paths.zip(keys) {
            let ring_s = echoes.next().copied().flatten();
            let goes_on = self.foresight == Foresight::None;
            let mut emit = |segment: Segment| {
                hear_out(&mut self.last_arrival_s, &segment, ring_s);
                // Keys are dense where nobody knows what comes: what stands still is one all the same.
                match stretches.last_mut().filter(|last| goes_on && last.segment.goes_on_in(&segment)) {
                    Some(last) => last.segment.end_s = segment.end_s,
                    None => stretches.push(segment.into()),
                }
            };
            if jump { builder.jump(key, &mut emit) } else { builder.key(key, &mut emit) }
        }
        Ok(())
    }

    /// Ends a thread at a key, or at its last one.
    fn end(&mut self, of: (u64, u32), at: Option<(f64, &[Arrival])>) {
        let Voices { threads, receivers, colours, rate_hz, .. } = &mut self.voices;
        let Some(thread) = threads.get_mut(&of) else { return };
        let ways = Ways { receivers, colours: colours.as_ref() };
        let keys: Vec<PathKey> = match at {
            Some((time_s, value)) => ways.keys(&mut thread.filters, time_s, value),
            None => thread.builders.iter().map(PathBuilder::last).collect(),
        };
        let paths = thread.builders.iter_mut().zip(&mut thread.stretches);
        let mut echoes = self.rings.iter();
        for ((builder, stretches), key) in paths.zip(keys) {
            let ring_s = echoes.next().copied().flatten();
            builder.end(key, &mut |segment| {
                hear_out(&mut self.last_arrival_s, &segment, ring_s);
                stretches.push(segment.into());
            });
            // What left before a jump may arrive after what left behind it.
            for Stretch { segment, .. } in &*stretches {
                let tails = segment.filter.iter().filter_map(|&number| thread.filters.get(number));
                let tail = tails.map(|filter| filter.reach()[1]).max().unwrap_or(0);
                self.last_arrival_s = self.last_arrival_s.max(segment.end_s + tail as f64 / *rate_hz);
            }
        }
        thread.ended = true;
    }
}

/// What goes to a bus, which sounds on for so long, is heard as long as that goes on behind the last of it.
fn hear_out(last_arrival_s: &mut f64, segment: &Segment, ring_s: Option<f64>) {
    if let Some(ring_s) = ring_s.filter(|_| segment.gain != [0.0; 2]) {
        *last_arrival_s = last_arrival_s.max(segment.end_s + ring_s);
    }
}

/// So many faults are kept to be told.
const MOST_FAULTS: usize = 16;

/// Keeps the random numbers of synthesised sounds apart from others of the same seed.
const SOURCES: u64 = 0x5eed_0f50_0d5e_1f01;

/// Names the thread and the sound of a fault.
fn in_thread(fault: Error, thread: u64, sound: Option<usize>, names: &BTreeMap<String, usize>) -> Error {
    let name = names.iter().find(|&(_, &index)| Some(index) == sound).map_or("", |(name, _)| name);
    // A script's fault has a file and a line, which say more.
    if fault.file().is_some() {
        fault
    } else {
        fault.at(Place::Part(format!("thread {thread}, sound {name}")))
    }
}

/// The paths of a thread of which nothing is known yet.
fn unheard(paths: usize) -> Vec<Vec<Stretch>> {
    std::iter::repeat_with(Vec::new).take(paths).collect()
}
