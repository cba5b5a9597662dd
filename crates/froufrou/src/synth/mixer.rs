//! Threads in, blocks out: a score in channel space becomes samples.
//!
//! The mixer reads the lines of a score in time order, just far enough ahead to know the paths of
//! the block that is asked for, and forgets what has sounded. Its memory follows the number of
//! threads that sound at once and the distance between their keys, not the length of the score.

use std::collections::{BTreeMap, HashMap};

use super::path::{PathBuilder, PathKey, Segment};
use super::voice::{self, Playback, Prototype};
use crate::score::{Arrival, ChannelLine, LATEST_S, LONGEST_DELAY_S, Start, Verb};
use crate::{Error, Result};

/// Nothing arrives before it leaves, but a resampled onset rings before it. It does so for this long
/// at most; what is read so slowly that it would ring for longer begins with less of it.
const ONSET_S: f64 = 1.0;

/// Playback speeds outside of this make positions in the recording that no number can tell apart.
const SPEEDS: std::ops::RangeInclusive<f64> = 1e-6..=1e6;

/// A thread that sounds or will.
struct Thread {
    prototype: usize,
    playback: Playback,
    /// The index of its object in [`Mixer::objects`].
    object: usize,
    /// One path a channel.
    builders: Vec<PathBuilder>,
    segments: Vec<Vec<Segment>>,
    ended: bool,
}

impl Thread {
    /// The arrival time up to which every channel's path is known.
    fn known_s(&self) -> f64 {
        if self.ended {
            return f64::INFINITY;
        }
        self.builders.iter().map(PathBuilder::known_s).fold(f64::INFINITY, f64::min)
    }
}

/// The samples of one block.
#[derive(Debug, Clone, Default)]
pub struct Block {
    /// The mix: all frames of the first channel, then those of the second and so on.
    pub mix: Vec<f64>,
    /// The part of each object that sounds in the block, by its index, laid out like the mix; only
    /// where stems are asked for.
    pub stems: BTreeMap<usize, Vec<f64>>,
}

/// A thread that has begun, for the log.
#[derive(Debug, Clone, PartialEq)]
pub struct Begun {
    /// Its number.
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

/// The threads that sound, as they are known so far: what is needed to render, and may be shared
/// between cores.
pub struct Voices {
    rate_hz: f64,
    channels: usize,
    prototypes: Vec<Prototype>,
    threads: BTreeMap<u64, Thread>,
}

impl Voices {
    /// Renders the frames from `frame` on. They must have been read ([`Mixer::read_to`]) and not
    /// released ([`Mixer::release`]). Blocks may be rendered in any order and at the same time.
    pub fn render(&self, frame: u64, frames: usize, with_stems: bool) -> Block {
        let mut block = Block { mix: vec![0.0; frames * self.channels], stems: BTreeMap::new() };
        let (mut voice, mut window) = (vec![0.0; frames], Vec::new());
        let (begin_s, end_s) = (frame as f64 / self.rate_hz, (frame + frames as u64) as f64 / self.rate_hz);
        for thread in self.threads.values() {
            let prototype = &self.prototypes[thread.prototype];
            for (channel, segments) in thread.segments.iter().enumerate() {
                let sounding = |s: &&Segment| s.begin_s < end_s && s.end_s > begin_s && s.gain != [0.0; 2];
                for segment in segments.iter().filter(sounding) {
                    let touched = voice::add_segment(
                        prototype,
                        &thread.playback,
                        segment,
                        self.rate_hz,
                        frame,
                        &mut voice,
                        &mut window,
                    );
                    let at = channel * frames + touched.start..channel * frames + touched.end;
                    let part = &mut voice[touched];
                    add(&mut block.mix[at.clone()], part);
                    if with_stems {
                        let stem = block.stems.entry(thread.object);
                        add(&mut stem.or_insert_with(|| vec![0.0; frames * self.channels])[at], part);
                    }
                    part.fill(0.0);
                }
            }
        }
        block
    }
}

/// Mixes the lines of a channel-space score, which come in time order.
pub struct Mixer<L> {
    lines: L,
    next: Option<ChannelLine>,
    names: BTreeMap<String, usize>,
    voices: Voices,
    objects: Vec<String>,
    object_indices: HashMap<String, usize>,
    begun: Vec<Begun>,
    last_arrival_s: f64,
}

impl<L: Iterator<Item = Result<ChannelLine>>> Mixer<L> {
    /// A mixer of `channels` channels at `rate_hz`, for the lines of a score and the sounds that its
    /// `start` lines name.
    ///
    /// # Errors
    /// The first line, where it cannot be read.
    pub fn new(
        rate_hz: u32,
        channels: usize,
        sounds: impl IntoIterator<Item = (String, Prototype)>,
        lines: L,
    ) -> Result<Self> {
        let (mut names, mut prototypes) = (BTreeMap::new(), Vec::new());
        for (name, prototype) in sounds {
            names.insert(name, prototypes.len());
            prototypes.push(prototype);
        }
        let mut mixer = Self {
            lines,
            next: None,
            names,
            voices: Voices { rate_hz: f64::from(rate_hz), channels, prototypes, threads: BTreeMap::new() },
            objects: Vec::new(),
            object_indices: HashMap::new(),
            begun: Vec::new(),
            last_arrival_s: 0.0,
        };
        mixer.next = mixer.lines.next().transpose()?;
        Ok(mixer)
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
        self.next.as_ref().map(|line| line.time_s)
    }

    /// True where every line has been read; then the latest arrival is known.
    pub fn is_read(&self) -> bool {
        self.next.is_none()
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

    /// Reads on until all that arrives before `end_frame` is known.
    ///
    /// # Errors
    /// A line that cannot be read, or one that does not fit those before it.
    pub fn read_to(&mut self, end_frame: u64) -> Result<()> {
        let end_s = end_frame as f64 / self.voices.rate_hz;
        while self.next.as_ref().is_some_and(|line| line.time_s <= end_s + ONSET_S) {
            self.read_line()?;
        }
        let mut open: Vec<u64> =
            self.voices.threads.iter().filter(|(_, t)| t.known_s() < end_s).map(|(&id, _)| id).collect();
        while !open.is_empty() && self.next.is_some() {
            let id = self.read_line()?;
            if self.voices.threads.get(&id).is_none_or(|t| t.known_s() >= end_s) {
                open.retain(|&o| o != id);
            }
        }
        if self.next.is_none() {
            // A thread that the score leaves open sounds no longer than its last key.
            let open: Vec<u64> =
                self.voices.threads.iter().filter(|(_, t)| !t.ended).map(|(&id, _)| id).collect();
            for id in open {
                self.end(id, None);
            }
        }
        Ok(())
    }

    /// Forgets what has arrived before `frame`.
    pub fn release(&mut self, frame: u64) {
        let time_s = frame as f64 / self.voices.rate_hz;
        self.voices.threads.retain(|_, thread| {
            for segments in &mut thread.segments {
                segments.retain(|s| s.end_s > time_s);
            }
            !(thread.ended && thread.segments.iter().all(Vec::is_empty))
        });
    }

    /// Takes the next line in; gives its thread.
    fn read_line(&mut self) -> Result<u64> {
        let following = self.lines.next().transpose()?;
        let Some(line) = std::mem::replace(&mut self.next, following) else {
            return Err(Error::new("the score has no more lines"));
        };
        let id = line.thread;
        if line.value.len() != self.voices.channels {
            return Err(Error::new(format!(
                "thread {id} has {} pairs of gain and delay at {} s; there are {} channels",
                line.value.len(),
                line.time_s,
                self.voices.channels
            )));
        }
        if !(0.0..=LATEST_S).contains(&line.time_s) {
            return Err(Error::new(format!("thread {id} has a line at {} s", line.time_s))
                .help(format!("a soundtrack can have times from 0 to {LATEST_S} s")));
        }
        for (channel, arrival) in line.value.iter().enumerate() {
            check_arrival(arrival).map_err(|what| {
                let channel = channel + 1;
                Error::new(format!("thread {id} has {what} in channel {channel} at {} s", line.time_s))
            })?;
        }
        match line.verb {
            Verb::Start(start) => self.start(id, line.time_s, start, &line.value)?,
            Verb::Key => self.through(id, line.time_s, &line.value, false)?,
            Verb::Jump => self.through(id, line.time_s, &line.value, true)?,
            Verb::End => {
                self.thread(id)?;
                self.end(id, Some((line.time_s, &line.value)));
            }
        }
        Ok(id)
    }

    fn thread(&mut self, id: u64) -> Result<&mut Thread> {
        self.voices
            .threads
            .get_mut(&id)
            .filter(|t| !t.ended)
            .ok_or_else(|| Error::new(format!("thread {id} has not started, or has ended")))
    }

    fn start(&mut self, id: u64, time_s: f64, start: Start, value: &[Arrival]) -> Result<()> {
        let Some(&prototype) = self.names.get(&start.sound) else {
            return Err(Error::new(format!("thread {id} plays an unknown sound `{}`", start.sound)));
        };
        let sound = &self.voices.prototypes[prototype];
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
        let fades_in = playback.fades_in(sound);
        let lead_s = playback.lead_s(sound, self.voices.rate_hz).min(ONSET_S);
        let builders: Vec<_> =
            path_keys(time_s, value).map(|k| PathBuilder::new(k, fades_in, lead_s)).collect();
        let object = match self.object_indices.get(&start.object) {
            Some(&object) => object,
            None => {
                self.object_indices.insert(start.object.clone(), self.objects.len());
                self.objects.push(start.object.clone());
                self.objects.len() - 1
            }
        };
        let segments = vec![Vec::new(); self.voices.channels];
        self.begun.push(Begun {
            thread: id,
            time_s,
            arrival_s: time_s + value.iter().map(|v| v.delay_s).fold(f64::INFINITY, f64::min),
            gain: value.iter().map(|v| v.gain).fold(0.0, f64::max),
            start,
        });
        let thread = Thread { prototype, playback, object, builders, segments, ended: false };
        if self.voices.threads.insert(id, thread).is_some() {
            return Err(Error::new(format!("thread {id} starts twice")));
        }
        Ok(())
    }

    fn through(&mut self, id: u64, time_s: f64, value: &[Arrival], jump: bool) -> Result<()> {
        let thread = self.thread(id)?;
        let paths = thread.builders.iter_mut().zip(&mut thread.segments);
        for ((builder, segments), key) in paths.zip(path_keys(time_s, value)) {
            let mut emit = |segment| segments.push(segment);
            if jump { builder.jump(key, &mut emit) } else { builder.key(key, &mut emit) }
        }
        Ok(())
    }

    /// Ends a thread at a key, or at its last one.
    fn end(&mut self, id: u64, at: Option<(f64, &[Arrival])>) {
        let Some(thread) = self.voices.threads.get_mut(&id) else { return };
        for (channel, (builder, segments)) in thread.builders.iter_mut().zip(&mut thread.segments).enumerate()
        {
            let key = match at {
                Some((time_s, value)) => path_key(time_s, &value[channel]),
                None => builder.last(),
            };
            builder.end(key, &mut |segment| segments.push(segment));
            // What left before a jump may arrive after what left behind it.
            let end_s = segments.iter().map(|s| s.end_s).fold(0.0, f64::max);
            self.last_arrival_s = self.last_arrival_s.max(end_s);
        }
        thread.ended = true;
    }
}

/// Says what an arrival has that cannot be mixed.
fn check_arrival(arrival: &Arrival) -> Result<(), String> {
    if !arrival.gain.is_finite() || arrival.gain < 0.0 {
        return Err(format!("a gain of {}", arrival.gain));
    }
    if !(0.0..=LONGEST_DELAY_S).contains(&arrival.delay_s) {
        return Err(format!("a delay of {} s, not 0 to {LONGEST_DELAY_S} s,", arrival.delay_s));
    }
    Ok(())
}

fn path_key(emission_s: f64, arrival: &Arrival) -> PathKey {
    PathKey { emission_s, delay_s: arrival.delay_s, gain: arrival.gain }
}

fn path_keys(emission_s: f64, value: &[Arrival]) -> impl Iterator<Item = PathKey> {
    value.iter().map(move |arrival| path_key(emission_s, arrival))
}

fn add(to: &mut [f64], from: &[f64]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to += from;
    }
}
