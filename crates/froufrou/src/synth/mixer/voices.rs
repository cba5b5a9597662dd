//! The threads that sound, and blocks of what is heard of them.

use std::collections::BTreeMap;
use std::ops::Range;

use super::super::bus::{Bus, LaneBlock, Spreading};
use super::super::filter::{self, Filter, Filters};
use super::super::path::{PathBuilder, Segment, UNFILTERED};
use super::super::receivers::Receiver;
use super::super::sinc::Kernel;
use super::super::source::Source;
use super::super::stretch::{self, Passing, Stretch};
use super::super::voice::{self, Playback, Signal};
use super::Sounding;
use crate::space::bands::BandFilters;

/// A path of a thread that sounds or will.
pub(super) struct Thread {
    pub(super) sound: usize,
    pub(super) playback: Playback,
    /// The index of its object in [`Mixer::objects`].
    pub(super) object: usize,
    /// One path a channel or bus: see [`Receiver::paths`].
    pub(super) builders: Vec<PathBuilder>,
    pub(super) stretches: Vec<Vec<Stretch>>,
    /// What its segments pass.
    pub(super) filters: Filters,
    pub(super) ended: bool,
    /// Whether it begins within the sound, and else how far before its first key it may ring.
    pub(super) fades_in: bool,
    pub(super) lead_s: f64,
}

impl Thread {
    /// What is known of all its paths.
    pub(super) fn segments(&self) -> impl Iterator<Item = &Segment> {
        self.stretches.iter().flatten().map(|stretch| &stretch.segment)
    }

    /// The arrival time up to which every channel's path is known.
    pub(super) fn known_s(&self) -> f64 {
        if self.ended {
            return f64::INFINITY;
        }
        self.builders.iter().map(PathBuilder::known_s).fold(f64::INFINITY, f64::min)
    }

    /// The latest emission time that is heard before an arrival time, as far as the paths are known.
    pub(super) fn emitted_before_s(&self, arrival_s: f64) -> Option<f64> {
        let heard = self.segments().filter(|segment| segment.begin_s < arrival_s);
        let latest = heard.map(|segment| segment.emission_s(segment.end_s.min(arrival_s)));
        latest.max_by(f64::total_cmp)
    }

    /// The greatest ratio at which anything is read that is heard before an arrival time.
    pub(super) fn fastest_before(&self, arrival_s: f64) -> f64 {
        let heard = self.segments().filter(|segment| segment.begin_s < arrival_s);
        heard.map(|segment| segment.fastest() * self.playback.speed).fold(0.0, f64::max)
    }

    /// The earliest emission time that is heard from an arrival time on.
    pub(super) fn emitted_from_s(&self, arrival_s: f64) -> f64 {
        let known = self.segments().filter(|segment| segment.end_s > arrival_s);
        let known = known.map(|segment| segment.emission_s(segment.begin_s.max(arrival_s)));
        let coming = self.builders.iter().filter(|_| !self.ended).map(PathBuilder::coming_s);
        known.chain(coming).fold(f64::INFINITY, f64::min)
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

/// The threads that sound, as they are known so far: what is needed to render, and may be shared
/// between cores.
pub struct Voices {
    pub(super) rate_hz: f64,
    pub(super) channels: usize,
    pub(super) receivers: Vec<Receiver>,
    /// What makes the filter of some gains of octave bands; none at a rate that has no such filters.
    pub(super) colours: Option<BandFilters>,
    pub(super) identity: Filter,
    /// How many paths a thread takes to all receivers.
    pub(super) paths: usize,
    /// Those among them that lead to channels which follow one another, and the first of these channels.
    pub(super) runs: Vec<(Range<usize>, usize)>,
    /// The buses, each with the path that leads to it.
    pub(super) buses: Vec<(usize, Bus)>,
    /// By how many frames the bus that is read furthest ahead is.
    pub(super) ahead: usize,
    /// For so many frames a filter makes what arrives heard before and after its time.
    pub(super) lead: usize,
    pub(super) tail: usize,
    /// What passes filters is read in pieces of at most so many frames, each whole.
    pub(super) piece: usize,
    /// How well channels read.
    pub(super) kernel: Kernel,
    pub(super) sounds: Vec<Sounding>,
    pub(super) threads: BTreeMap<(u64, u32), Thread>,
    /// The signals of the threads that are synthesised.
    pub(super) sources: BTreeMap<u64, Source>,
}

impl Voices {
    /// Finds how far filters reach.
    pub(super) fn reach(&mut self) {
        let coloured = self.colours.as_ref().map_or([0; 2], |c| [c.centre(), c.taps() - c.centre()]);
        [self.lead, self.tail] = [0, 1].map(|side| {
            let reaches = self.receivers.iter().map(|receiver| receiver.reach()[side]);
            reaches.max().unwrap_or(0) + coloured[side]
        });
        let reach = self.lead + self.tail;
        self.piece = if reach == 0 { 0 } else { filter::longest(reach) };
    }

    fn signal(&self, thread: u64, sound: usize) -> Option<Signal<'_>> {
        let signal = match &self.sounds[sound] {
            Sounding::Recording(prototype) => prototype.signal(),
            Sounding::Instrument(_) => self.sources.get(&thread)?.signal(),
        };
        Some(Signal { kernel: self.kernel, ..signal })
    }

    /// What channels hear of all threads between two frames, reading by reading, in the order in which they are
    /// added up.
    pub(super) fn readings(&self, frames: Range<u64>) -> impl Iterator<Item = Reading<'_>> {
        let [begin_s, end_s] = self.heard_s(&frames);
        self.threads.iter().flat_map(move |(&(id, _), thread)| {
            let signal = self.signal(id, thread.sound);
            signal.into_iter().flat_map(move |signal| {
                let groups = self.runs.iter().flat_map(move |(paths, first)| {
                    let all = &thread.stretches[paths.clone()];
                    // Channels that differ in their gains alone hear one reading.
                    let groups = all.chunk_by(|a, b| are_alike(a, b));
                    groups.map(move |group| (first + offset_of(all, group), group))
                });
                groups.flat_map(move |(first_channel, group)| {
                    let heard = group[0].iter().enumerate().filter(move |(_, Stretch { segment, .. })| {
                        segment.begin_s < end_s && segment.end_s > begin_s
                    });
                    let readings = heard.map(move |(index, stretch)| Reading {
                        id,
                        thread,
                        signal,
                        stretch,
                        first_channel,
                        group,
                        index,
                    });
                    readings.filter(|reading| reading.gains().any(|gain| gain != [0.0; 2]))
                })
            })
        })
    }

    /// Between which times what arrives is heard in some frames, filters included.
    fn heard_s(&self, frames: &Range<u64>) -> [f64; 2] {
        [frames.start.saturating_sub(self.tail as u64), frames.end + self.lead as u64]
            .map(|frame| frame as f64 / self.rate_hz)
    }

    /// Renders the frames from `frame` on. They must have been read (`Mixer::read_to`) and not
    /// released (`Mixer::release`). Blocks may be rendered in any order and at the same time.
    pub fn render(&self, frame: u64, frames: usize, with_stems: bool) -> Block {
        let mut block = Block { mix: vec![0.0; frames * self.channels], stems: BTreeMap::new() };
        let mut scratch = Scratch { voice: vec![0.0; frames], ..Scratch::default() };
        for reading in self.readings(frame..frame + frames as u64) {
            let Reading { thread, signal, stretch, .. } = reading;
            let touched = self.add_stretch(thread, signal, stretch, reading.gain(), frame, &mut scratch);
            let part = &mut scratch.voice[touched.clone()];
            let place = Place {
                first_channel: reading.first_channel,
                stride: frames,
                offset: touched.start,
                frame: frame + touched.start as u64,
                rate_hz: self.rate_hz,
            };
            place.add(part, &stretch.segment, reading.gains(), &mut block.mix);
            if with_stems {
                let stem = block.stems.entry(thread.object);
                let stem = stem.or_insert_with(|| vec![0.0; frames * self.channels]);
                place.add(part, &stretch.segment, reading.gains(), stem);
            }
            part.fill(0.0);
        }
        block
    }

    /// Frames a second.
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// How many channels there are.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// The buses, in the order of their receivers.
    pub fn buses(&self) -> impl Iterator<Item = &Bus> {
        self.buses.iter().map(|(_, bus)| bus)
    }

    /// Renders the frames of a bus's lanes from `frame` on, as [`Voices::render`] does those of the channels: what
    /// arrives at the bus, before its responses. They must have been read as far as the bus is read
    /// [ahead](Bus::lead) of the channels, which `Mixer::read_to` sees to.
    pub fn render_lanes(&self, bus: usize, frame: u64, frames: usize, with_stems: bool) -> LaneBlock {
        let mut block = LaneBlock { frames, ..LaneBlock::default() };
        let Some((_, way)) = self.buses.get(bus) else { return block };
        let mut scratch = Scratch { voice: vec![0.0; frames], ..Scratch::default() };
        let mut gains = [Vec::new(), Vec::new()];
        for (_, thread, signal, stretch) in self.arrivals(bus, frame..frame + frames as u64) {
            let segment = &stretch.segment;
            let touched = self.add_stretch(thread, signal, stretch, [1.0; 2], frame, &mut scratch);
            if touched.is_empty() {
                continue;
            }
            way.gains(segment, &thread.filters, &mut gains);
            let course = segment.course();
            let part = &mut scratch.voice[touched.clone()];
            let into = |out: &mut Vec<f32>| {
                out.resize(frames * way.lanes(), 0.0);
                pulp::Arch::new().dispatch(Spreading {
                    samples: part,
                    course: &course,
                    rate_hz: self.rate_hz,
                    first: frame + touched.start as u64,
                    gains: [&gains[0], &gains[1]],
                    out,
                    frames,
                    offset: touched.start,
                });
            };
            into(&mut block.mix);
            if with_stems {
                into(block.stems.entry(thread.object).or_default());
            }
            part.fill(0.0);
        }
        block
    }

    /// What arrives at a bus between two frames of its lanes, in the order in which it is added up.
    pub(super) fn arrivals(
        &self,
        bus: usize,
        frames: Range<u64>,
    ) -> impl Iterator<Item = (u64, &Thread, Signal<'_>, &Stretch)> {
        let [begin_s, end_s] = self.heard_s(&frames);
        let bus = self.buses.get(bus);
        bus.into_iter().flat_map(move |(path, bus)| {
            self.threads.iter().flat_map(move |(&(id, _), thread)| {
                let signal = self.signal(id, thread.sound).map(|s| Signal { kernel: bus.kernel(), ..s });
                let heard = thread.stretches[*path].iter().filter(move |Stretch { segment, .. }| {
                    segment.begin_s < end_s && segment.end_s > begin_s && segment.gain != [0.0; 2]
                });
                signal
                    .into_iter()
                    .flat_map(move |signal| heard.clone().map(move |stretch| (id, thread, signal, stretch)))
            })
        })
    }

    /// Renders a stretch with a gain of its path or another; the range of the block that was touched.
    pub(super) fn add_stretch(
        &self,
        thread: &Thread,
        signal: Signal<'_>,
        stretch: &Stretch,
        gain: [f64; 2],
        frame: u64,
        scratch: &mut Scratch,
    ) -> Range<usize> {
        let Scratch { voice, window, memory } = scratch;
        let (playback, rate_hz) = (&thread.playback, self.rate_hz);
        if stretch.segment.filter == [UNFILTERED; 2] {
            let segment = Segment { gain, ..stretch.segment };
            return voice::add_segment(signal, playback, &segment, rate_hz, frame, voice, window);
        }
        let filter = |number: u32| match number {
            UNFILTERED => Some(&self.identity),
            number => thread.filters.get(number),
        };
        let [Some(from), Some(to)] = stretch.segment.filter.map(filter) else { return 0..0 };
        let passing = Passing { signal, playback, rate_hz, filters: [from, to] };
        stretch.add(&passing, gain, frame, voice, window, memory)
    }
}

/// What some channels that follow one another hear of a thread in one reading.
pub(super) struct Reading<'a> {
    pub(super) id: u64,
    pub(super) thread: &'a Thread,
    pub(super) signal: Signal<'a>,
    /// What is read.
    pub(super) stretch: &'a Stretch,
    /// The first of the channels.
    pub(super) first_channel: usize,
    /// The stretches of each of them, and which of these is read.
    group: &'a [Vec<Stretch>],
    index: usize,
}

impl<'a> Reading<'a> {
    /// The gain of each channel.
    pub(super) fn gains(&self) -> impl ExactSizeIterator<Item = [f64; 2]> + use<'a> {
        let index = self.index;
        self.group.iter().map(move |stretches| stretches[index].segment.gain)
    }

    /// The gain with which it is read: that of one channel; several have theirs behind it.
    pub(super) fn gain(&self) -> [f64; 2] {
        if self.group.len() == 1 { self.stretch.segment.gain } else { [1.0; 2] }
    }
}

/// Where some frames of a reading go.
pub(super) struct Place {
    pub(super) first_channel: usize,
    /// So many frames of each channel lie side by side.
    pub(super) stride: usize,
    /// The first of the reading is this one of them.
    pub(super) offset: usize,
    /// And this one of all.
    pub(super) frame: u64,
    pub(super) rate_hz: f64,
}

impl Place {
    /// Adds what was read to each channel with its gain.
    pub(super) fn add(
        &self,
        part: &[f64],
        segment: &Segment,
        gains: impl ExactSizeIterator<Item = [f64; 2]>,
        channels: &mut [f64],
    ) {
        let is_single = gains.len() == 1;
        for (channel, gain) in gains.enumerate().filter(|&(_, gain)| gain != [0.0; 2]) {
            let begin = (self.first_channel + channel) * self.stride + self.offset;
            let to = &mut channels[begin..begin + part.len()];
            if is_single {
                add(to, part);
            } else {
                add_faded(to, part, &Segment { gain, ..*segment }, self.frame, self.rate_hz);
            }
        }
    }
}

/// Memory that rendering uses again and again.
#[derive(Default)]
pub(super) struct Scratch {
    pub(super) voice: Vec<f64>,
    pub(super) window: Vec<f32>,
    pub(super) memory: stretch::Memory,
}

/// Whether two channels hear a thread with other gains at most.
fn are_alike(a: &[Stretch], b: &[Stretch]) -> bool {
    let same = |(a, b): (&Stretch, &Stretch)| Segment { gain: b.segment.gain, ..a.segment } == b.segment;
    a.len() == b.len() && a.iter().zip(b).all(same)
}

/// Which of all elements the first of a part of them is.
fn offset_of<T>(all: &[T], part: &[T]) -> usize {
    all.element_offset(&part[0]).unwrap_or(0)
}

/// Adds samples from a frame on with the gain of a segment.
fn add_faded(to: &mut [f64], from: &[f64], segment: &Segment, first: u64, rate_hz: f64) {
    let [begin, end] = segment.gain;
    if begin == end {
        let add = || to.iter_mut().zip(from).for_each(|(to, from)| *to += from * begin);
        return pulp::Arch::new().dispatch(add);
    }
    let slope = (end - begin) / (segment.end_s - segment.begin_s);
    for ((to, from), index) in to.iter_mut().zip(from).zip(0..) {
        let arrival_s = (first + index) as f64 / rate_hz;
        // What rings on in a filter keeps the gain that it had at the end.
        let arrival_s = arrival_s.clamp(segment.begin_s, segment.end_s);
        *to += from * (begin + slope * (arrival_s - segment.begin_s));
    }
}

fn add(to: &mut [f64], from: &[f64]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to += from;
    }
}
