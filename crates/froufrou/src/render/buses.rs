//! The buses of a soundtrack on their way to its channels, on all cores: those of the mix, and those of each
//! object that has a stem.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::offline::BLOCK_FRAMES;
use crate::Result;
use crate::synth::bus::{Bus, LaneBlock, Ringing, RingingLane};
use crate::synth::mixer::{Block, Voices};

/// All buses of a soundtrack, in the order of their receivers.
pub(super) struct Buses {
    all: Vec<Running>,
    with_stems: bool,
}

struct Running {
    bus: Bus,
    mix: Ringing,
    /// What is under way of each object; those of which nothing is are left out.
    stems: BTreeMap<usize, Ringing>,
}

impl Buses {
    /// Those of some voices, for channels that are heard from a frame on.
    pub fn new(voices: &Voices, from: u64, with_stems: bool) -> Self {
        let running = |bus: &Bus| {
            let mix = Ringing::new(bus, bus.mixed_from(from));
            Running { bus: bus.clone(), mix, stems: BTreeMap::new() }
        };
        Self { all: voices.buses().map(running).collect(), with_stems }
    }

    /// The frame from which on something is needed of what arrives at them; that of the channels, where nothing is
    /// needed before.
    pub fn mixed_from(&self, from: u64) -> u64 {
        self.all.iter().map(|running| running.mix.frame()).fold(from, u64::min)
    }

    /// Mixes and convolves what the channels hear up to a frame. What they hear before the frame `heard` is left
    /// aside.
    pub fn feed(&mut self, voices: &Voices, to: u64, heard: u64) -> Result<()> {
        for (index, Running { bus, mix, stems }) in self.all.iter_mut().enumerate() {
            let begin = mix.frame();
            let end = (to + bus.lead() as u64).max(begin);
            let skipped = (heard + bus.lead() as u64).saturating_sub(begin) as usize;
            let starts: Vec<u64> = (begin..end).step_by(BLOCK_FRAMES).collect();
            let blocks: Vec<LaneBlock> = starts
                .into_par_iter()
                .map(|start| {
                    let frames = (end - start).min(BLOCK_FRAMES as u64) as usize;
                    voices.render_lanes(index, start, frames, self.with_stems)
                })
                .collect();
            for object in blocks.iter().flat_map(|block| block.stems.keys()) {
                stems.entry(*object).or_insert_with(|| Ringing::new(bus, begin));
            }
            let mut work: Vec<(Option<usize>, usize, &mut RingingLane)> = Vec::new();
            for (object, ringing) in
                [(None, &mut *mix)].into_iter().chain(stems.iter_mut().map(|(object, r)| (Some(*object), r)))
            {
                ringing.fed(end - begin);
                work.extend(ringing.lanes_mut().iter_mut().enumerate().map(|(n, lane)| (object, n, lane)));
            }
            work.into_par_iter().try_for_each(|(object, number, lane)| {
                let parts = blocks.iter().map(|block| {
                    let samples = match object {
                        None => Some(&block.mix),
                        Some(object) => block.stems.get(&object),
                    };
                    (block.frames, samples.map_or(&[][..], Vec::as_slice))
                });
                lane.feed(number, bus.lanes(), parts, skipped)
            })?;
        }
        Ok(())
    }

    /// Adds what was fed last to the blocks of the channels, the first of which begins at the frame that was heard
    /// first.
    pub fn add(&mut self, blocks: &mut [Block], channels: usize) -> Result<()> {
        if self.all.is_empty() {
            return Ok(());
        }
        blocks.par_iter_mut().enumerate().try_for_each(|(index, block)| {
            let (from, frames) = (index * BLOCK_FRAMES, block.mix.len() / channels.max(1));
            for running in &self.all {
                running.mix.add(from, &mut block.mix, frames)?;
                for (object, ringing) in running.stems.iter().filter(|(_, ringing)| ringing.sounds()) {
                    let stem = block.stems.entry(*object).or_insert_with(|| vec![0.0; frames * channels]);
                    ringing.add(from, stem, frames)?;
                }
            }
            Ok(())
        })?;
        for running in &mut self.all {
            running.stems.retain(|_, ringing| !ringing.is_silent());
        }
        Ok(())
    }
}
