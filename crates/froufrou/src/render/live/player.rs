//! The audio thread's half: from slices of time to blocks of any size.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};

use rtrb::{Consumer, Producer};

use super::budget::{Budget, Clock};
use super::counters::{Counters, Statistics};
use super::limiter::Limiter;
use crate::synth::bus::{self, Ringing};
use crate::synth::mixer::{Desk, Slice};

/// Blocks are rendered in pieces of at most so many frames.
pub(super) const PIECE_FRAMES: usize = 256;

/// For so long sounds go on as they were where what comes next is late, in seconds. Then they fade.
pub(super) const HOLD_S: f64 = 0.2;

/// Before anything is played so much of what was told is left out at most, in seconds, because the worker is behind it.
const LONGEST_WAIT_S: f64 = 5.0;

/// Over so long what went on and what comes next are faded into each other, in seconds.
pub(super) const JOIN_S: f64 = 0.01;

/// What an audio thread plays from. Nothing in it takes memory, a lock or time beyond that of the sound.
pub struct Player {
    pub(super) channels: usize,
    pub(super) rate_hz: f64,
    pub(super) desk: Desk,
    pub(super) slices: Consumer<Box<Slice>>,
    pub(super) used: Producer<Box<Slice>>,
    /// What is played, and the next frame of it.
    pub(super) current: Option<Box<Slice>>,
    pub(super) frame: u64,
    pub(super) held: Option<Held>,
    /// How many frames of what comes next have been faded in, where it is.
    pub(super) joined: Option<usize>,
    /// Whether anything has been played yet.
    pub(super) has_begun: bool,
    /// How many slices were passed over before that.
    pub(super) passed_over: usize,
    /// The length of a slice; the last one may be shorter.
    pub(super) slice_frames: usize,
    /// So many slices are there before it begins, or begins again.
    pub(super) slices_before: usize,
    /// Where more than so many are there, some are left out.
    pub(super) most_slices: usize,
    /// Whether more than there have to be are left out where it begins, or begins again.
    pub(super) catches_up: bool,
    /// Whether the worker has handed over all that it knows, where somebody knows that.
    pub(super) rests: Option<Arc<AtomicBool>>,
    pub(super) buses: Vec<Running>,
    /// What channels hear, [`PIECE_FRAMES`] each, and the same of what is held.
    pub(super) mix: Vec<f64>,
    pub(super) held_mix: Vec<f64>,
    /// How loud what comes next is while it is faded in.
    pub(super) rise: Box<[f64]>,
    pub(super) limiter: Limiter,
    pub(super) budget: Budget,
    pub(super) load: f32,
    /// Samples on their way to buses that were no finite number.
    pub(super) not_numbers: u64,
    pub(super) counters: Arc<Counters>,
}

/// A bus, and what is fed to its lanes.
pub(super) struct Running {
    pub ringing: Ringing,
    pub lead: u64,
    pub lanes: usize,
    pub input: Vec<f32>,
    pub held_input: Vec<f32>,
}

/// Sounds that go on as they were.
pub(super) struct Held {
    slice: Box<Slice>,
    /// For how many frames they have, behind its end.
    frames: u64,
}

impl Player {
    /// The same, whose time is told by another clock: a test has one that is made up.
    #[must_use]
    pub fn with_clock(mut self, clock: Box<dyn Clock>) -> Self {
        self.budget.set_clock(clock);
        self
    }

    /// How many channels there are.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// The rate of frames.
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// By how many frames the limiter makes it all later.
    pub fn limiter_latency(&self) -> usize {
        self.limiter.latency()
    }

    /// How many frames must be there before it begins.
    pub fn ahead_frames(&self) -> usize {
        self.slices_before * self.slice_frames
    }

    /// What has happened so far.
    pub fn statistics(&self) -> Statistics {
        self.counters.statistics()
    }

    /// How many frames can be played at once, of those that are there; before it begins, or begins again, as many as there
    /// must be for that or none.
    pub fn ready_frames(&self) -> usize {
        let there = self.slices.slots();
        let current = self.current.as_ref().map(|current| (current.frames().end - self.frame) as usize);
        match current {
            None if there < self.slices_before => 0,
            current => current.unwrap_or(0) + there * self.slice_frames,
        }
    }

    /// Whether the last of it has been played.
    pub fn is_over(&self) -> bool {
        self.counters.is_over.load(Relaxed)
    }

    /// Fills a block of any length with interleaved frames. Samples behind the last whole frame are silent.
    pub fn fill(&mut self, block: &mut [f32]) {
        let begun_s = self.budget.now_s();
        let frames = block.len() / self.channels.max(1);
        let (whole, rest) = block.split_at_mut(frames * self.channels);
        rest.fill(0.0);
        for piece in whole.chunks_mut(PIECE_FRAMES * self.channels.max(1)) {
            let count = piece.len() / self.channels.max(1);
            self.mix(count);
            for (n, out) in piece.chunks_exact_mut(self.channels).enumerate() {
                let mix = &self.mix;
                self.limiter.next((0..out.len()).map(|channel| mix[channel * count + n]), out);
            }
        }
        let peak = block.iter().fold(0.0f32, |peak, sample| peak.max(sample.abs()));
        self.counters.peak.store(peak.to_bits(), Relaxed);
        self.tell(begun_s, frames);
    }

    fn tell(&mut self, begun_s: f64, frames: usize) {
        let took_s = self.budget.now_s() - begun_s;
        self.budget.block(took_s, frames);
        let Counters { blocks, late_blocks, load, peak_load, limited_frames, not_numbers, .. } =
            &*self.counters;
        blocks.fetch_add(1, Relaxed);
        if frames > 0 {
            let part = (took_s * self.rate_hz / frames as f64) as f32;
            late_blocks.fetch_add(u64::from(part > 1.0), Relaxed);
            self.load += 0.05 * (part - self.load);
            load.store((self.load * 1000.0) as u32, Relaxed);
            peak_load.fetch_max((part * 1000.0) as u32, Relaxed);
        }
        let [limited, strange] = self.limiter.counts();
        limited_frames.store(limited, Relaxed);
        not_numbers.store(strange + self.not_numbers, Relaxed);
    }

    /// Renders some frames into the mix, channel after channel.
    fn mix(&mut self, count: usize) {
        self.mix[..count * self.channels].fill(0.0);
        for bus in &mut self.buses {
            bus.input[..count * bus.lanes].fill(0.0);
        }
        let mut done = 0;
        while done < count {
            self.take_next();
            done += self.part(done, count);
        }
        for bus in &mut self.buses {
            for sample in &mut bus.input[..count * bus.lanes] {
                if !sample.is_finite() {
                    *sample = 0.0;
                    self.not_numbers += 1;
                }
            }
            // It plays into channels that there are: the mixer has seen to that.
            let _ = bus.ringing.process(
                &bus.input[..count * bus.lanes],
                count,
                &mut self.mix[..count * self.channels],
            );
        }
        self.counters.played.store(self.frame, Release);
    }

    /// Goes on to the next slice where this one is over, if there is one.
    fn take_next(&mut self) {
        let there = self.slices.slots();
        if self.current.as_ref().is_some_and(|current| current.frames().end > self.frame) {
            return;
        }
        let end = self.counters.end.load(Acquire);
        if let Some(mut last) = self.current.take() {
            if there == 0 && end != 0 && self.frame + 1 >= end {
                self.give_back(last);
                self.counters.is_over.store(true, Relaxed);
            } else if (1..=self.most_slices).contains(&there) || there > 0 && self.joined.is_some() {
                self.begin(Some(&last));
                self.give_back(last);
            } else {
                last.hold(self.rate_hz, HOLD_S + 4.0 * JOIN_S);
                if let Some(before) = self.held.replace(Held { slice: last, frames: 0 }) {
                    self.give_back(before.slice);
                }
                self.joined = None;
                if there == 0 {
                    self.counters.held.fetch_add(1, Relaxed);
                } else {
                    self.skip(there - self.slices_before);
                    self.joined = Some(0);
                    self.begin_again();
                }
            }
        } else if self.has_to_wait(there) {
            self.passed_over += there - self.slices_before;
            self.skip(there - self.slices_before);
        } else if there >= self.slices_before && (self.is_all() || there > self.most_slices)
            || there > 0 && end != 0
        {
            let more = there.saturating_sub(self.slices_before);
            let leaves_out = more > 0 && (self.catches_up || there > self.most_slices);
            if leaves_out {
                self.skip(more);
            }
            self.joined = (self.has_begun || leaves_out).then_some(0);
            self.begin_again();
        } else if there == 0 && end != 0 && self.frame + 1 >= end {
            self.counters.is_over.store(true, Relaxed);
        }
    }

    /// Whether the worker is still behind what was told before anything is played, with so many slices there: who begins now has
    /// to leave some out again and again until it is not. But it may have more to do than it can.
    fn has_to_wait(&self, there: usize) -> bool {
        let longest = (LONGEST_WAIT_S * self.rate_hz) as usize / self.slice_frames;
        !self.has_begun && there > self.most_slices && !self.is_all() && self.passed_over < longest
    }

    /// Whether more comes only with what is told next: who begins in the midst of what comes would be later than it need be.
    fn is_all(&self) -> bool {
        self.rests.as_ref().is_none_or(|rests| rests.load(Acquire))
    }

    /// Leaves slices out.
    fn skip(&mut self, slices: usize) {
        for _ in 0..slices {
            if let Ok(slice) = self.slices.pop() {
                let frames = slice.frames();
                // Who has heard nothing yet misses nothing.
                if !self.has_begun {
                    self.give_back(slice);
                    continue;
                }
                self.counters.skipped_frames.fetch_add(frames.end - frames.start, Relaxed);
                self.give_back(slice);
            }
        }
    }

    /// Begins with the next slice, behind what goes on meanwhile.
    fn begin_again(&mut self) {
        let held = self.held.take();
        self.begin(held.as_ref().map(|held| &*held.slice));
        self.held = held;
    }

    /// Begins with the next slice, behind another.
    fn begin(&mut self, before: Option<&Slice>) {
        let Ok(mut slice) = self.slices.pop() else { return };
        if let Some(before) = before {
            slice.follow(before, self.desk.fade());
        }
        self.frame = slice.frames().start;
        self.counters.threads.store(slice.threads() as u32, Relaxed);
        self.counters.readings.store(slice.readings() as u32, Relaxed);
        if !std::mem::replace(&mut self.has_begun, true) {
            self.feed_ahead(&slice);
        }
        self.current = Some(slice);
    }

    /// Buses whose responses begin before their time are fed ahead of the channels by as much.
    fn feed_ahead(&mut self, slice: &Slice) {
        for (number, bus) in self.buses.iter_mut().enumerate() {
            let until = slice.frames().start + bus.lead;
            while bus.ringing.frame() < until {
                let from = bus.ringing.frame();
                let count = ((until - from) as usize).min(PIECE_FRAMES);
                let input = &mut bus.input[..count * bus.lanes];
                input.fill(0.0);
                let frames = from..from + count as u64;
                self.desk.add_lanes(slice, number, frames, input, (count, 0));
                let unheard = &mut self.held_mix[..count * self.channels];
                let _ = bus.ringing.process(input, count, unheard);
                input.fill(0.0);
            }
        }
    }

    /// Renders what there is from a frame of the mix on; gives how many frames that were.
    fn part(&mut self, offset: usize, count: usize) -> usize {
        let mut frames = count - offset;
        if let Some(joined) = self.joined {
            frames = frames.min(self.rise.len() - joined);
        }
        if let Some(current) = &mut self.current {
            frames = frames.min((current.frames().end - self.frame) as usize);
            if self.budget.is_limited() {
                let anyway = self.held.as_ref().map_or(0.0, |held| held.slice.read_work());
                let room = self.budget.room(anyway, frames);
                let [stolen, back] = current.fit(room, self.desk.fade());
                self.budget.came_back(back);
                self.counters.stolen.fetch_add(stolen as u64, Relaxed);
                self.counters.released.store(current.released() as u32, Relaxed);
            }
            let (begun_s, work) = (self.budget.begin(), current.read_work());
            let at = self.frame..self.frame + frames as u64;
            self.desk.add(current, at.clone(), &mut self.mix[..count * self.channels], (count, offset));
            for (number, bus) in self.buses.iter_mut().enumerate() {
                let at = at.start + bus.lead..at.end + bus.lead;
                self.desk.add_lanes(
                    current,
                    number,
                    at,
                    &mut bus.input[..count * bus.lanes],
                    (count, offset),
                );
            }
            self.budget.end(begun_s, work, frames);
            current.advance(frames, self.desk.fade());
            self.frame = at.end;
        }
        if self.current.is_none() || self.joined.is_some() {
            self.fade(frames, offset, count);
        }
        frames
    }

    /// Lets what comes next rise, and adds what goes on until then.
    fn fade(&mut self, frames: usize, offset: usize, count: usize) {
        let Self { rise, channels, mix, held_mix, buses, counters, budget, .. } = self;
        let rise = |n: usize| rise.get(n).copied().unwrap_or(1.0);
        let places = || (0..*channels).map(|channel| channel * count + offset).map(|at| at..at + frames);
        if let Some(joined) = self.joined {
            for place in places() {
                mix[place].iter_mut().enumerate().for_each(|(n, sample)| *sample *= rise(joined + n));
            }
            for bus in &mut *buses {
                let input = &mut bus.input[..count * bus.lanes];
                scale_lanes(input, bus.lanes, offset..offset + frames, |n| rise(joined + n) as f32);
            }
        }
        if let Some(Held { slice, frames: since }) = &mut self.held {
            let hold = (HOLD_S * self.rate_hz) as u64;
            let falling = |n: usize| {
                let behind = (*since + n as u64).checked_sub(hold);
                let left = behind.map_or(1.0, |behind| 1.0 - rise(behind as usize));
                left * self.joined.map_or(1.0, |joined| 1.0 - rise(joined + n))
            };
            let from = slice.frames().end + *since;
            let at = from..from + frames as u64;
            let (begun_s, work) = (budget.begin(), slice.read_work());
            held_mix[..count * *channels].fill(0.0);
            self.desk.add(slice, at.clone(), &mut held_mix[..count * *channels], (count, offset));
            for place in places() {
                let held = held_mix[place.clone()].iter().enumerate();
                mix[place].iter_mut().zip(held).for_each(|(to, (n, held))| *to += falling(n) * held);
            }
            for (number, bus) in buses.iter_mut().enumerate() {
                let at = at.start + bus.lead..at.end + bus.lead;
                let held = &mut bus.held_input[..count * bus.lanes];
                held.fill(0.0);
                self.desk.add_lanes(slice, number, at, held, (count, offset));
                scale_lanes(held, bus.lanes, offset..offset + frames, |n| falling(n) as f32);
                bus.input.iter_mut().zip(held).for_each(|(to, held)| *to += *held);
            }
            budget.end(begun_s, work, frames);
            slice.advance(frames, self.desk.fade());
            *since += frames as u64;
            counters.held_frames.fetch_add(frames as u64, Relaxed);
            let is_silent = *since >= hold + self.rise.len() as u64;
            let is_joined = self.joined.is_some_and(|joined| joined + frames >= self.rise.len());
            if is_silent || is_joined {
                let held = self.held.take();
                held.into_iter().for_each(|held| self.give_back(held.slice));
            }
        } else if self.current.is_none() {
            counters.silent_frames.fetch_add(frames as u64, Relaxed);
        }
        let joined = self.joined.map(|joined| joined + frames);
        self.joined = joined.filter(|joined| *joined < self.rise.len());
    }

    /// Lets the worker have a slice back.
    fn give_back(&mut self, slice: Box<Slice>) {
        if let Err(rtrb::PushError::Full(slice)) = self.used.push(slice) {
            // There is room for all slices that there are. Were there none, it would rather be lost than freed here.
            std::mem::forget(slice);
        }
    }
}

/// Makes some frames of all lanes of a bus softer, by a gain each.
fn scale_lanes(lanes: &mut [f32], count: usize, frames: std::ops::Range<usize>, gain: impl Fn(usize) -> f32) {
    for (frame, n) in frames.zip(0..) {
        bus::frame_mut(lanes, count, frame).for_each(|sample| *sample *= gain(n));
    }
}
