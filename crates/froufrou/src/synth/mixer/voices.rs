//! The threads that sound, and blocks of what is heard of them.

use std::collections::BTreeMap;
use std::ops::Range;

use super::super::bus::{Bus, LaneBlock, Spreading};
use super::super::filter::{Filter, Filters};
use super::super::path::{PathBuilder, Segment, UNFILTERED};
use super::super::receivers::Receiver;
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
    pub(super) sounds: Vec<Sounding>,
    pub(super) threads: BTreeMap<(u64, u32), Thread>,
    /// The signals of the threads that are synthesised.
    pub(super) sources: BTreeMap<u64, Source>,
}

impl Voices {
    fn signal(&self, thread: u64, sound: usize) -> Option<Signal<'_>> {
        match &self.sounds[sound] {
            Sounding::Recording(prototype) => Some(prototype.signal()),
            Sounding::Instrument(_) => self.sources.get(&thread).map(Source::signal),
        }
    }

    /// Renders the frames from `frame` on. They must have been read (`Mixer::read_to`) and not
    /// released (`Mixer::release`). Blocks may be rendered in any order and at the same time.
    pub fn render(&self, frame: u64, frames: usize, with_stems: bool) -> Block {
        let mut block = Block { mix: vec![0.0; frames * self.channels], stems: BTreeMap::new() };
        let mut scratch = Scratch { voice: vec![0.0; frames], ..Scratch::default() };
        let begin_s = frame.saturating_sub(self.tail as u64) as f64 / self.rate_hz;
        let end_s = (frame + (frames + self.lead) as u64) as f64 / self.rate_hz;
        for (&(id, _), thread) in &self.threads {
            let Some(signal) = self.signal(id, thread.sound) else { continue };
            let groups = self.runs.iter().flat_map(|(paths, first)| {
                let all = &thread.stretches[paths.clone()];
                // Channels that differ in their gains alone hear one reading.
                let groups = all.chunk_by(|a, b| are_alike(a, b));
                groups.map(move |group| (first + offset_of(all, group), group))
            });
            for (first_channel, group) in groups {
                for (index, stretch) in group[0].iter().enumerate() {
                    let segment = &stretch.segment;
                    let gains = || group.iter().map(|stretches| stretches[index].segment.gain);
                    if segment.begin_s >= end_s || segment.end_s <= begin_s || gains().all(|g| g == [0.0; 2])
                    {
                        continue;
                    }
                    let gain = if group.len() == 1 { segment.gain } else { [1.0; 2] };
                    let touched = self.add_stretch(thread, signal, stretch, gain, frame, &mut scratch);
                    let part = &mut scratch.voice[touched.clone()];
                    for (channel, gain) in gains().enumerate().filter(|&(_, gain)| gain != [0.0; 2]) {
                        let begin = (first_channel + channel) * frames;
                        let at = begin + touched.start..begin + touched.end;
                        let first = frame + touched.start as u64;
                        let into = |to: &mut [f64]| match group.len() {
                            1 => add(to, part),
                            _ => add_faded(to, part, &Segment { gain, ..*segment }, first, self.rate_hz),
                        };
                        into(&mut block.mix[at.clone()]);
                        if with_stems {
                            let stem = block.stems.entry(thread.object);
                            into(&mut stem.or_insert_with(|| vec![0.0; frames * self.channels])[at]);
                        }
                    }
                    part.fill(0.0);
                }
            }
        }
        block
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
        let Some((path, bus)) = self.buses.get(bus) else { return block };
        let mut scratch = Scratch { voice: vec![0.0; frames], ..Scratch::default() };
        let mut gains = [Vec::new(), Vec::new()];
        let begin_s = frame.saturating_sub(self.tail as u64) as f64 / self.rate_hz;
        let end_s = (frame + (frames + self.lead) as u64) as f64 / self.rate_hz;
        for (&(id, _), thread) in &self.threads {
            let Some(signal) = self.signal(id, thread.sound) else { continue };
            let signal = Signal { kernel: bus.kernel(), ..signal };
            for stretch in &thread.stretches[*path] {
                let segment = &stretch.segment;
                if segment.begin_s >= end_s || segment.end_s <= begin_s || segment.gain == [0.0; 2] {
                    continue;
                }
                let touched = self.add_stretch(thread, signal, stretch, [1.0; 2], frame, &mut scratch);
                if touched.is_empty() {
                    continue;
                }
                bus.gains(segment, &thread.filters, &mut gains);
                let part = &mut scratch.voice[touched.clone()];
                let into = |out: &mut Vec<f32>| {
                    out.resize(frames * bus.lanes(), 0.0);
                    pulp::Arch::new().dispatch(Spreading {
                        samples: part,
                        segment,
                        rate_hz: self.rate_hz,
                        first: frame + touched.start as u64,
                        gains: &gains,
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
        }
        block
    }

    /// Renders a stretch with a gain of its path or another; the range of the block that was touched.
    fn add_stretch(
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

/// Memory that rendering uses again and again.
#[derive(Default)]
struct Scratch {
    voice: Vec<f64>,
    window: Vec<f32>,
    memory: stretch::Memory,
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
