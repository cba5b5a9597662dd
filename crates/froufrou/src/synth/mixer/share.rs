//! Which threads are heard where there is no time for all: the least audible are let go, and come back once there is room.
//!
//! A slice has its threads in the order of how loud they are, found as it is cut. So who fits is found in one pass, without
//! memory. A thread that is let go fades over [`FADE_S`] and is then not read; one that comes back rises
//! likewise. What has been decided goes on from slice to slice.

use super::Sounding;
use super::slice::Slice;
use super::voices::Voices;
use crate::synth::voice::Prototype;

/// A thread fades over so long, in seconds.
pub(super) const FADE_S: f64 = 0.008;

/// How loud recordings are is known for blocks of so many samples.
const LEVEL_BLOCK: usize = 1024;

/// What is loud is taken to be so for a while longer, by this part a second, so that beats and short rests change no order.
const DECAY_PER_S: f64 = 1e-3;

/// How much work a frame there is time for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Room {
    /// No more than this is done.
    pub now: f64,
    /// There is room for so much for sure: who is released comes back only into this.
    pub sure: f64,
    /// So many of them at most.
    pub back: usize,
}

/// How far a thread has been let go.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Share {
    /// So many frames of the fade have passed.
    faded: u32,
    is_released: bool,
}

impl Share {
    /// Whether nothing is heard of it, where the fade is so long.
    pub fn is_silent(self, fade: &[f64]) -> bool {
        self.is_released && self.faded as usize + 1 >= fade.len()
    }

    /// Whether it becomes louder or softer.
    fn moves(self, last: u32) -> bool {
        self.faded != if self.is_released { last } else { 0 }
    }

    /// Its place in the fade so many frames later.
    fn after(self, frames: usize, last: u32) -> u32 {
        let frames = u32::try_from(frames).unwrap_or(u32::MAX);
        if self.is_released {
            self.faded.saturating_add(frames).min(last)
        } else {
            self.faded.saturating_sub(frames)
        }
    }

    /// Makes samples softer, of which the first is this one from here.
    pub fn fade(self, fade: &[f64], first: usize, samples: &mut [f64]) {
        let last = fade.len().saturating_sub(1) as u32;
        if !self.moves(last) && !self.is_released {
            return;
        }
        for (sample, n) in samples.iter_mut().zip(first + 1..) {
            *sample *= fade.get(self.after(n, last) as usize).copied().unwrap_or(0.0);
        }
    }
}

/// The gains of a fade, from 1 to 0.
pub(super) fn fade(rate_hz: f64) -> Box<[f64]> {
    let frames = ((FADE_S * rate_hz) as usize).max(1);
    let gain = |n: usize| 0.5 + 0.5 * (std::f64::consts::PI * n as f64 / frames as f64).cos();
    (0..=frames).map(|n| if n == frames { 0.0 } else { gain(n) }).collect()
}

/// The shares of the threads of a slice, and in what order they are let go.
#[derive(Default)]
pub(super) struct Shares {
    of: Vec<Share>,
    /// What each thread takes, the number it had in the slice before, and how loud it is.
    voices: Vec<Voice>,
    /// The numbers of the threads, the loudest first.
    order: Vec<u32>,
    /// Memory for putting them in order.
    keys: Vec<u64>,
    /// What all take, and what those take that are read.
    work: f64,
    read_work: f64,
    released: usize,
    moves: bool,
    /// Whether nothing of it has been played, and whether it goes on from a slice before.
    is_fresh: bool,
    follows: bool,
}

/// What is known of a thread in a slice.
#[derive(Debug, Clone, Copy)]
struct Voice {
    work: f32,
    power: f32,
    before: u32,
}

/// Stands for no number in the slice before.
const NEW: u32 = u32::MAX;

impl Shares {
    pub fn clear(&mut self) {
        self.of.clear();
        self.voices.clear();
        self.order.clear();
    }

    /// Adds a thread, which had a number in the slice before or is new.
    pub fn push(&mut self, before: Option<usize>) {
        let before = before.and_then(|before| u32::try_from(before).ok()).unwrap_or(NEW);
        self.voices.push(Voice { work: 0.0, power: 0.0, before });
    }

    /// A thread has one more reading: with so much work a frame and a gain.
    pub fn add(&mut self, thread: usize, work: f64, power: f64) {
        if let Some(voice) = self.voices.get_mut(thread) {
            voice.work += work as f32;
            voice.power += power as f32;
        }
    }

    /// Takes in how loud a thread's signal is, and how loud it was at the end of the slice before; gives how loud it is taken
    /// to be.
    pub fn weigh(&mut self, thread: usize, level: f32, before: f32) -> f32 {
        let Some(voice) = self.voices.get_mut(thread) else { return 0.0 };
        voice.power = (voice.power * level * level).max(before);
        voice.power
    }

    /// Puts the threads in order; all are heard.
    pub fn sort(&mut self) {
        let Self { of, voices, order, keys, .. } = self;
        of.resize(voices.len(), Share::default());
        // The bits of what is not negative are in its order.
        let key = |(thread, voice): (u32, &Voice)| u64::from(!voice.power.to_bits()) << 32 | u64::from(thread);
        keys.extend((0..).zip(&*voices).map(key));
        keys.sort_unstable();
        order.extend(keys.drain(..).map(|key| key as u32));
        self.work = voices.iter().map(|voice| f64::from(voice.work)).sum();
        (self.read_work, self.released, self.moves) = (self.work, 0, false);
        (self.is_fresh, self.follows) = (true, false);
    }

    /// The share of a thread.
    pub fn of(&self, thread: usize) -> Share {
        self.of.get(thread).copied().unwrap_or_default()
    }

    /// Counts anew what is read.
    fn count(&mut self, last: u32) {
        (self.read_work, self.released, self.moves) = (0.0, 0, false);
        for (share, voice) in self.of.iter().zip(&self.voices) {
            self.released += usize::from(share.is_released);
            self.moves |= share.moves(last);
            if !(share.is_released && share.faded >= last) {
                self.read_work += f64::from(voice.work);
            }
        }
    }
}

impl Slice {
    /// Goes on from the slice before: what is released there stays so.
    pub fn follow(&mut self, before: &Slice, fade: &[f64]) {
        if before.frames().end != self.frames().start {
            return;
        }
        let last = fade.len().saturating_sub(1) as u32;
        let (shares, old) = (&mut self.shares, &before.shares);
        shares.follows = true;
        if old.released == 0 && !old.moves {
            return;
        }
        for (share, voice) in shares.of.iter_mut().zip(&shares.voices) {
            *share = old.of(voice.before as usize);
        }
        shares.count(last);
    }

    /// Takes threads back for which there is room, the loudest first, and releases the softest where there is not enough; gives
    /// how many have been released by this and how many have come back.
    pub fn fit(&mut self, room: Room, fade: &[f64]) -> [usize; 2] {
        let last = fade.len().saturating_sub(1) as u32;
        let shares = &mut self.shares;
        let is_fresh = std::mem::replace(&mut shares.is_fresh, false);
        if shares.released == 0 && shares.work <= room.now {
            return [0; 2];
        }
        let Shares { of, voices, order, follows, .. } = shares;
        let (mut sum, mut heard, mut stolen, mut back) = (0.0, 0.0, 0, 0);
        for &thread in &*order {
            let thread = thread as usize;
            let (Some(share), Some(voice)) = (of.get_mut(thread), voices.get(thread)) else { continue };
            sum += f64::from(voice.work);
            if share.is_released && sum <= room.sure && back < room.back {
                share.is_released = false;
                back += 1;
            }
            if !share.is_released {
                heard += f64::from(voice.work);
            }
        }
        for &thread in order.iter().rev() {
            if heard <= room.now {
                break;
            }
            let thread = thread as usize;
            let (Some(share), Some(voice)) = (of.get_mut(thread), voices.get(thread)) else { continue };
            if share.is_released {
                continue;
            }
            share.is_released = true;
            heard -= f64::from(voice.work);
            stolen += 1;
            if is_fresh && (!*follows || voice.before == NEW) {
                // Nothing of it has been heard yet.
                share.faded = last;
            }
        }
        if stolen + back > 0 {
            shares.count(last);
        }
        [stolen, back]
    }

    /// So many frames of it have been played.
    pub fn advance(&mut self, frames: usize, fade: &[f64]) {
        let last = fade.len().saturating_sub(1) as u32;
        let shares = &mut self.shares;
        shares.is_fresh = false;
        if shares.moves {
            for share in &mut shares.of {
                share.faded = share.after(frames, last);
            }
            shares.count(last);
        }
    }

    /// The work a frame of what is read of it now.
    pub fn read_work(&self) -> f64 {
        self.shares.read_work
    }

    /// How many threads are released.
    pub fn released(&self) -> usize {
        self.shares.released
    }
}

fn levels(prototype: &Prototype) -> Vec<f32> {
    prototype.samples.chunks(LEVEL_BLOCK).map(level).collect()
}

/// How loud recordings are, block by block.
pub(super) struct Levels {
    of: Vec<Vec<f32>>,
    decay: f64,
}

impl Levels {
    /// Those of all that a mixer plays.
    pub fn new(voices: &Voices) -> Self {
        let of = voices.sounds.iter().map(|sound| match sound {
            Sounding::Recording(prototype) => levels(prototype),
            Sounding::Instrument(_) => Vec::new(),
        });
        Self { of: of.collect(), decay: DECAY_PER_S.ln() / voices.rate_hz }
    }

    /// How much is left of a power after so many frames.
    pub fn left(&self, frames: u64) -> f32 {
        (self.decay * frames as f64).exp() as f32
    }

    /// The level of a recording between two of its samples: the greatest of the blocks that these touch, and of the one behind.
    pub fn recording(&mut self, sound: usize, prototype: &Prototype, [from, to]: [f64; 2]) -> f32 {
        if let Some(of) = self.of.get_mut(sound).filter(|of| of.is_empty()) {
            // It was not there when others were looked at.
            *of = levels(prototype);
        }
        let Some(levels) = self.of.get(sound).filter(|levels| !levels.is_empty()) else { return 0.0 };
        let count = levels.len() as i64;
        let block = |sample: f64| (sample / LEVEL_BLOCK as f64).floor() as i64;
        let (first, last) = (block(from), block(to).saturating_add(1));
        if !prototype.looped {
            let (first, end) = (first.clamp(0, count), last.saturating_add(1).clamp(0, count));
            return levels
                .get(first as usize..end as usize)
                .unwrap_or_default()
                .iter()
                .copied()
                .fold(0.0, f32::max);
        }
        // The last block of a loop may be short.
        let first = block(from.rem_euclid(prototype.samples.len() as f64));
        let blocks = (block(to) - block(from)).saturating_add(3).clamp(1, count) as usize;
        let from_first = levels.iter().cycle().skip(first.clamp(0, count - 1) as usize);
        from_first.take(blocks).copied().fold(0.0, f32::max)
    }
}

/// The root of the mean square of samples.
pub(super) fn level(samples: &[f32]) -> f32 {
    let sum: f64 = samples.iter().map(|sample| f64::from(*sample).powi(2)).sum();
    (sum / samples.len().max(1) as f64).sqrt() as f32
}
