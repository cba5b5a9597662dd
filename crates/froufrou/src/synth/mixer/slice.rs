//! A slice of time, with all that is needed to render it: what a mixer hands to another thread.
//!
//! Every output sample is a function of its frame number, so it does not matter in which blocks a slice is rendered,
//! nor by whom. A [`Cutter`] copies out of a mixer's [`Voices`] what is heard between two frames: the segments of
//! all paths, and of synthesised sounds the stretch of signal that is read. Recordings are shared. What passes filters
//! of its own is rendered as it is cut, for its pieces are whole FFTs. A [`Desk`] then renders any frames of the slice,
//! in the same order of sums as [`Voices::render`], and so with the same bits. That takes no memory, no lock and no
//! system call, and nothing in it can fail.

use std::ops::Range;

use rustc_hash::FxHashMap;

use super::super::bus::{Bus, Spreading};
use super::super::path::{Segment, UNFILTERED};
use super::super::sinc::{self, Kernel, Samples};
use super::super::stretch::Stretch;
use super::super::voice::{Passage, Playback, Prototype, Signal};
use super::Sounding;
use super::share::{self, Levels, Shares};
use super::voices::{Place, Scratch, Thread, Voices};

/// What is heard of all threads between two frames.
#[derive(Default)]
pub struct Slice {
    frames: Range<u64>,
    /// Which frames of each bus's lanes.
    lanes: Vec<Range<u64>>,
    heard: Vec<Heard>,
    readings: Vec<Kept>,
    arrivals: Vec<KeptArrival>,
    /// What the readings of channels have as gains, one after the other.
    gains: Vec<[f64; 2]>,
    /// The same of the lanes: for each arrival those at its beginning, then by how much they change.
    spreads: Vec<f32>,
    /// The signals of synthesised sounds.
    samples: Vec<f32>,
    /// What passed filters.
    filtered: Vec<f64>,
    /// Which threads are heard where time is short.
    pub(super) shares: Shares,
}

/// A thread's signal.
struct Heard {
    id: u64,
    sound: usize,
    signal: Held,
    rate_hz: f64,
    playback: Playback,
    /// Which samples of its signal are read, while it is cut.
    needed: [f64; 2],
}

impl Heard {
    /// One of its segments, made ready to be read.
    fn passage(&self, segment: Segment, rate_hz: f64) -> Passage {
        Passage::new(segment, &self.playback, self.rate_hz, rate_hz)
    }
}

enum Held {
    Recording(Prototype),
    /// These of the slice's samples, and the number of the first.
    Made(Range<usize>, f64),
}

/// A reading of a channel or several.
struct Kept {
    heard: usize,
    /// With the gain with which it is read.
    passage: Passage,
    first_channel: usize,
    gains: Range<usize>,
    /// Where it passed filters.
    filtered: Option<Filtered>,
}

/// A reading of a bus.
struct KeptArrival {
    bus: usize,
    heard: usize,
    /// Without gain: its spreads have that.
    passage: Passage,
    /// Its spreads.
    spread: Range<usize>,
    filtered: Option<Filtered>,
}

/// What came out of filters: for these frames, and where the samples are.
struct Filtered {
    frames: Range<u64>,
    at: usize,
    /// Whether more would come.
    goes_on: bool,
}

impl Filtered {
    /// Adds what falls into the frames from one on; the range that was touched.
    fn add(&self, slice: &Slice, frame: u64, voice: &mut [f64]) -> Range<usize> {
        let Self { frames, at, goes_on } = self;
        let Some(samples) = slice.filtered.get(*at..at + (frames.end - frames.start) as usize) else {
            return 0..0;
        };
        if frame >= frames.end && *goes_on {
            // What was goes back and comes to rest.
            let behind = (frame - frames.end) as usize;
            let count = samples.len().min(TAIL);
            let back = samples.iter().rev().take(count).enumerate().skip(behind);
            let rest = back.map(|(n, sample)| sample * (1.0 - n as f64 / count as f64));
            return 0..voice.iter_mut().zip(rest).map(|(to, from)| *to += from).count();
        }
        let end = frame + voice.len() as u64;
        let [begin, stop] = [frames.start, frames.end].map(|f| f.clamp(frame, end));
        if begin >= stop {
            return 0..0;
        }
        let touched = (begin - frame) as usize..(stop - frame) as usize;
        let from = &samples[(begin - frames.start) as usize..];
        voice[touched.clone()].iter_mut().zip(from).for_each(|(to, from)| *to += from);
        touched
    }
}

impl Slice {
    /// Its frames.
    pub fn frames(&self) -> Range<u64> {
        self.frames.clone()
    }

    /// How many readings there are in it, of channels and of buses.
    pub fn readings(&self) -> usize {
        self.readings.len() + self.arrivals.len()
    }

    /// How many threads are heard in it.
    pub fn threads(&self) -> usize {
        self.heard.len()
    }

    /// Empties it; its memory stays for the next.
    fn clear(&mut self) {
        self.heard.clear();
        self.readings.clear();
        self.arrivals.clear();
        self.gains.clear();
        self.spreads.clear();
        self.samples.clear();
        self.filtered.clear();
        self.lanes.clear();
        self.shares.clear();
    }

    fn signal<'a>(&'a self, heard: &'a Heard, kernel: Kernel) -> Signal<'a> {
        match &heard.signal {
            Held::Recording(prototype) => Signal { kernel, ..prototype.signal() },
            Held::Made(at, base) => Signal {
                samples: Samples { samples: &self.samples[at.clone()], looped: false },
                base: *base,
                rate_hz: heard.rate_hz,
                kernel,
            },
        }
    }

    /// Lets all that sounds at its end go on from there as it does then, for so many seconds, for nothing is known of what
    /// comes. Recordings are read on; of a synthesised sound there is a short tail.
    pub fn hold(&mut self, rate_hz: f64, for_s: f64) {
        let Self { frames, lanes, heard, readings, arrivals, gains, spreads, .. } = self;
        let frame_s = 1.0 / rate_hz;
        let end_s = frames.end as f64 * frame_s;
        for kept in readings {
            let Passage { segment, .. } = kept.passage;
            if let Some((held, along)) = held(&segment, end_s, frame_s, for_s) {
                let mut own = segment.gain;
                for gain in [&mut own].into_iter().chain(&mut gains[kept.gains.clone()]) {
                    *gain = [gain[0] + along * (gain[1] - gain[0]); 2];
                }
                let held = Segment { gain: own, ..held };
                kept.passage = heard[kept.heard].passage(held, rate_hz);
            }
        }
        for kept in arrivals {
            let Some(frames) = lanes.get(kept.bus) else { continue };
            let end_s = frames.end as f64 * frame_s;
            if let Some((held, along)) = held(&kept.passage.segment, end_s, frame_s, for_s) {
                let (begin, change) = spreads[kept.spread.clone()].split_at_mut(kept.spread.len() / 2);
                for (begin, change) in begin.iter_mut().zip(change) {
                    *begin += along as f32 * *change;
                    *change = 0.0;
                }
                kept.passage = heard[kept.heard].passage(held, rate_hz);
            }
        }
    }
}

/// A segment that goes on from a time, if it lasts until then, as it does then; and how far along it that is.
fn held(segment: &Segment, time_s: f64, frame_s: f64, for_s: f64) -> Option<(Segment, f64)> {
    if segment.end_s < time_s - frame_s {
        return None;
    }
    let from_s = time_s.clamp(segment.begin_s, segment.end_s);
    let at = segment.at(from_s);
    // No steeper than any path may be.
    let (slope, length_s) = ((1.0 - at.rate).clamp(-8.0, 1.0 - SLOWEST), for_s + time_s - from_s);
    let held = Segment {
        begin_s: from_s,
        end_s: from_s + length_s,
        delay_s: [at.delay_s, at.delay_s + slope * length_s],
        slope: [slope; 2],
        gain: [at.gain; 2],
        ..*segment
    };
    Some((held, (from_s - segment.begin_s) / (segment.end_s - segment.begin_s)))
}

/// The least rate at which what is held goes on.
const SLOWEST: f64 = 0.125;

/// So many samples at most lie behind what is needed of a synthesised sound, in which it comes to rest.
const TAIL: usize = 480;

/// Cuts what a mixer knows into slices, one after the other.
pub struct Cutter {
    /// The next frame, and the next of each bus's lanes.
    frame: u64,
    lanes: Vec<u64>,
    /// Kernels are made for ratios up to this.
    prepared: f64,
    /// Where each thread's signal is in the slice and in the one before, and how loud it is taken to be.
    indices: FxHashMap<u64, (usize, f32)>,
    before: FxHashMap<u64, (usize, f32)>,
    levels: Levels,
    spread: [Vec<f32>; 2],
    scratch: Scratch,
}

impl Cutter {
    /// A cutter that begins with a frame.
    pub fn new(voices: &Voices, frame: u64) -> Self {
        sinc::prepare(1.0);
        Self {
            frame,
            lanes: vec![frame; voices.buses.len()],
            prepared: 1.0,
            indices: FxHashMap::default(),
            before: FxHashMap::default(),
            levels: Levels::new(voices),
            spread: [Vec::new(), Vec::new()],
            scratch: Scratch::default(),
        }
    }

    /// The next frame.
    pub fn frame(&self) -> u64 {
        self.frame
    }

    /// Fills a slice with what is heard from where the last one ended up to a frame, which must have been read
    /// ([`Mixer::read_to`](super::Mixer::read_to)) and not released.
    pub fn cut(&mut self, voices: &Voices, end: u64, slice: &mut Slice) {
        slice.clear();
        std::mem::swap(&mut self.indices, &mut self.before);
        self.indices.clear();
        slice.frames = self.frame..end.max(self.frame);
        let frames = slice.frames.clone();
        self.scratch.voice.resize((frames.end - frames.start) as usize, 0.0);
        for reading in voices.readings(frames.clone()) {
            let (segment, gain) = (reading.stretch.segment, reading.gain());
            let Some(heard) = self.hear(voices, reading.id, reading.thread, &segment, &frames, slice) else {
                continue;
            };
            let filtered = self.filter(
                voices,
                reading.thread,
                reading.signal,
                reading.stretch,
                gain,
                frames.start,
                slice,
            );
            let begin = slice.gains.len();
            slice.gains.extend(reading.gains());
            let channels = slice.gains.len() - begin;
            let power = slice.gains[begin..].iter().map(power_of).sum();
            let work = match &filtered {
                Some(_) => 0.0,
                None => {
                    work::of(reading.signal.kernel) * ratio_of(voices, &slice.heard[heard], &segment).max(1.0)
                }
            };
            slice.shares.add(heard, work::READING + work + work::CHANNEL * channels as f64, power);
            let passage = slice.heard[heard].passage(Segment { gain, ..segment }, voices.rate_hz);
            slice.readings.push(Kept {
                heard,
                passage,
                first_channel: reading.first_channel,
                gains: begin..slice.gains.len(),
                filtered,
            });
        }
        for (bus, way) in voices.buses().enumerate() {
            let frames = self.lanes[bus]..(frames.end + way.lead() as u64).max(self.lanes[bus]);
            self.scratch.voice.resize((frames.end - frames.start) as usize, 0.0);
            for (id, thread, signal, stretch) in voices.arrivals(bus, frames.clone()) {
                let Some(heard) = self.hear(voices, id, thread, &stretch.segment, &frames, slice) else {
                    continue;
                };
                let filtered = self.filter(voices, thread, signal, stretch, [1.0; 2], frames.start, slice);
                let begin = slice.spreads.len();
                way.gains(&stretch.segment, &thread.filters, &mut self.spread);
                self.spread.iter().for_each(|gains| slice.spreads.extend(gains));
                let spread = begin..slice.spreads.len();
                let work = match &filtered {
                    Some(_) => 0.0,
                    None => work::of(signal.kernel),
                } * ratio_of(voices, &slice.heard[heard], &stretch.segment).max(1.0);
                let lanes = work::LANE * way.lanes() as f64;
                slice.shares.add(heard, work::READING + work + lanes, power_of(&stretch.segment.gain));
                let segment = Segment { gain: [1.0; 2], ..stretch.segment };
                let passage = slice.heard[heard].passage(segment, voices.rate_hz);
                slice.arrivals.push(KeptArrival { bus, heard, passage, spread, filtered });
            }
            self.lanes[bus] = frames.end;
            slice.lanes.push(frames);
        }
        self.take_signals(voices, slice);
        self.weigh(&frames, slice);
        self.frame = frames.end;
    }

    /// The signal of a thread in the slice, of which a segment is read in some frames.
    fn hear(
        &mut self,
        voices: &Voices,
        id: u64,
        thread: &Thread,
        segment: &Segment,
        frames: &Range<u64>,
        slice: &mut Slice,
    ) -> Option<usize> {
        let (signal, rate_hz) = match voices.sounds.get(thread.sound)? {
            Sounding::Recording(prototype) => (Held::Recording(prototype.clone()), prototype.rate_hz),
            Sounding::Instrument(_) => (Held::Made(0..0, 0.0), voices.rate_hz),
        };
        // Held, it goes on no slower than that.
        let ratio = segment.fastest().max(SLOWEST) * thread.playback.speed * rate_hz / voices.rate_hz;
        if ratio > self.prepared && self.prepared < sinc::MAX_RATIO {
            sinc::prepare(ratio);
            self.prepared = ratio;
        }
        let (at, _) = *self.indices.entry(id).or_insert_with(|| {
            let needed = [f64::INFINITY, f64::NEG_INFINITY];
            let (sound, playback) = (thread.sound, thread.playback);
            slice.heard.push(Heard { id, sound, signal, rate_hz, playback, needed });
            slice.shares.push(self.before.get(&id).map(|(at, _)| *at));
            (slice.heard.len() - 1, 0.0)
        });
        let [begin_s, end_s] = [frames.start, frames.end].map(|frame| {
            let arrival_s = (frame as f64 / voices.rate_hz).clamp(segment.begin_s, segment.end_s);
            segment.emission_s(arrival_s)
        });
        let around = sinc::half_width(ratio.max(1.0)) as f64 + 2.0;
        let [from, to] = [begin_s.min(end_s), begin_s.max(end_s)]
            .map(|emission_s| (emission_s - thread.playback.start_s) * rate_hz);
        let heard = &mut slice.heard[at];
        heard.needed = [heard.needed[0].min(from - around), heard.needed[1].max(to + around)];
        Some(at)
    }

    /// Renders what passes filters.
    #[allow(clippy::too_many_arguments)]
    fn filter(
        &mut self,
        voices: &Voices,
        thread: &Thread,
        signal: Signal<'_>,
        stretch: &Stretch,
        gain: [f64; 2],
        frame: u64,
        slice: &mut Slice,
    ) -> Option<Filtered> {
        if stretch.segment.filter == [UNFILTERED; 2] {
            return None;
        }
        let touched = voices.add_stretch(thread, signal, stretch, gain, frame, &mut self.scratch);
        let part = &mut self.scratch.voice[touched.clone()];
        let at = slice.filtered.len();
        slice.filtered.extend_from_slice(part);
        part.fill(0.0);
        let frames = frame + touched.start as u64..frame + touched.end as u64;
        let goes_on = touched.end == self.scratch.voice.len() && !touched.is_empty();
        Some(Filtered { frames, at, goes_on })
    }

    /// Finds how loud each thread is.
    fn weigh(&mut self, frames: &Range<u64>, slice: &mut Slice) {
        let left = self.levels.left(frames.end - frames.start);
        let Slice { heard, samples, shares, .. } = slice;
        for (index, Heard { id, sound, signal, rate_hz, playback, needed }) in heard.iter().enumerate() {
            let level = match signal {
                Held::Recording(prototype) => {
                    let within = needed.map(|at| at * playback.speed + playback.offset_s * rate_hz);
                    self.levels.recording(*sound, prototype, within)
                }
                Held::Made(at, _) => share::level(&samples[at.clone()]),
            };
            let before = self.before.get(id).map_or(0.0, |(_, power)| left * power);
            let power = shares.weigh(index, level, before);
            self.indices.insert(*id, (index, power));
        }
        shares.sort();
    }

    /// Copies what is read of synthesised sounds.
    fn take_signals(&self, voices: &Voices, slice: &mut Slice) {
        let Slice { heard, samples, .. } = slice;
        for Heard { id, signal, needed: [from, to], .. } in heard {
            let (Held::Made(at, base), Some(source)) = (signal, voices.sources.get(id)) else { continue };
            let Signal { samples: Samples { samples: made, .. }, base: first, .. } = source.signal();
            let index = |number: f64| (number - first).clamp(0.0, made.len() as f64) as usize;
            let kept = index(from.floor())..index(to.ceil());
            let begin = samples.len();
            *base = first + kept.start as f64;
            samples.extend_from_slice(&made[kept.clone()]);
            // What comes is not known: should it be late, what was goes back and comes to rest.
            let count = kept.len().min(TAIL);
            let back = made[kept].iter().rev().take(count);
            samples.extend(back.enumerate().map(|(n, sample)| sample * (1.0 - n as f32 / count as f32)));
            *at = begin..samples.len();
        }
    }
}

/// What is the same for all slices, and memory for rendering them.
pub struct Desk {
    rate_hz: f64,
    kernel: Kernel,
    buses: Vec<Bus>,
    voice: Vec<f64>,
    window: Vec<f32>,
    /// How what is let go fades.
    fade: Box<[f64]>,
}

/// What a reading takes in a frame, in multiplications of its kernel, as far as is needed to tell threads from one another.
mod work {
    use super::Kernel;

    pub const READING: f64 = 60.0;
    pub const CHANNEL: f64 = 10.0;
    pub const LANE: f64 = 2.0;

    pub fn of(kernel: Kernel) -> f64 {
        match kernel {
            Kernel::Long => 320.0,
            Kernel::Short => 96.0,
            Kernel::Line => 8.0,
        }
    }
}

/// The power with a gain that goes from one to another.
fn power_of([begin, end]: &[f64; 2]) -> f64 {
    (begin * begin).max(end * end)
}

/// At what ratio a thread is read along a segment at most.
fn ratio_of(voices: &Voices, heard: &Heard, segment: &Segment) -> f64 {
    segment.fastest() * heard.playback.speed * heard.rate_hz / voices.rate_hz
}

impl Desk {
    /// That of a mixer, for blocks of so many frames at most.
    pub fn new(voices: &Voices, most_frames: usize) -> Self {
        let window = Vec::with_capacity(sinc::MOST_COPIED);
        let buses = voices.buses().cloned().collect();
        let (rate_hz, kernel, voice) = (voices.rate_hz, voices.kernel, vec![0.0; most_frames]);
        Self { rate_hz, kernel, buses, voice, window, fade: share::fade(rate_hz) }
    }

    /// The gains with which a thread is let go, frame by frame.
    pub fn fade(&self) -> &[f64] {
        &self.fade
    }

    /// Adds what channels hear directly in some frames of a slice, or behind it once it is held. Of each channel
    /// `stride` frames lie side by side, and the first goes to `offset` of them.
    pub fn add(
        &mut self,
        slice: &Slice,
        frames: Range<u64>,
        channels: &mut [f64],
        (stride, offset): (usize, usize),
    ) {
        let count = (frames.end.saturating_sub(frames.start) as usize).min(self.voice.len());
        for kept in &slice.readings {
            let share = slice.shares.of(kept.heard);
            if share.is_silent(&self.fade) {
                continue;
            }
            let touched =
                self.read(slice, kept.heard, &kept.passage, &kept.filtered, self.kernel, frames.start, count);
            let part = &mut self.voice[touched.clone()];
            share.fade(&self.fade, touched.start, part);
            let place = Place {
                first_channel: kept.first_channel,
                stride,
                offset: offset + touched.start,
                frame: frames.start + touched.start as u64,
                rate_hz: self.rate_hz,
            };
            let gains = slice.gains[kept.gains.clone()].iter().copied();
            place.add(part, &kept.passage.segment, gains, channels);
            part.fill(0.0);
        }
    }

    /// Adds what arrives at the lanes of a bus in some frames of these, likewise. True where anything did.
    pub fn add_lanes(
        &mut self,
        slice: &Slice,
        bus: usize,
        frames: Range<u64>,
        lanes: &mut [f32],
        (stride, offset): (usize, usize),
    ) -> bool {
        let Some(kernel) = self.buses.get(bus).map(Bus::kernel) else { return false };
        let count = (frames.end.saturating_sub(frames.start) as usize).min(self.voice.len());
        let mut arrived = false;
        for kept in slice.arrivals.iter().filter(|kept| kept.bus == bus) {
            let share = slice.shares.of(kept.heard);
            if share.is_silent(&self.fade) {
                continue;
            }
            let KeptArrival { heard, passage, filtered, .. } = kept;
            let touched = self.read(slice, *heard, passage, filtered, kernel, frames.start, count);
            if touched.is_empty() {
                continue;
            }
            arrived = true;
            let part = &mut self.voice[touched.clone()];
            share.fade(&self.fade, touched.start, part);
            let (begin, change) = slice.spreads[kept.spread.clone()].split_at(kept.spread.len() / 2);
            pulp::Arch::new().dispatch(Spreading {
                samples: part,
                course: passage.course(),
                rate_hz: self.rate_hz,
                first: frames.start + touched.start as u64,
                gains: [begin, change],
                out: lanes,
                frames: stride,
                offset: offset + touched.start,
            });
            part.fill(0.0);
        }
        arrived
    }

    /// Reads a segment into the memory for one voice; the range that was touched.
    #[allow(clippy::too_many_arguments)]
    fn read(
        &mut self,
        slice: &Slice,
        heard: usize,
        passage: &Passage,
        filtered: &Option<Filtered>,
        kernel: Kernel,
        frame: u64,
        count: usize,
    ) -> Range<usize> {
        let voice = &mut self.voice[..count];
        if let Some(filtered) = filtered {
            return filtered.add(slice, frame, voice);
        }
        if !passage.touches(frame, count) {
            return 0..0;
        }
        let heard = &slice.heard[heard];
        let signal = slice.signal(heard, kernel);
        passage.add(signal, &heard.playback, frame, voice, &mut self.window)
    }
}
