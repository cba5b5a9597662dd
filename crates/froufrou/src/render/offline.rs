//! From a mixer to files: pulls blocks on all cores and hands them on in order.

use std::ops::Range;

use rayon::prelude::*;

use super::buses::Buses;
use crate::score::ChannelLine;
use crate::synth::mixer::{Begun, Block, Mixer, Voices};
use crate::synth::voice::{LAST_FRAME, first_frame};
use crate::{Error, Result};

/// Frames that one core renders at a time.
pub(super) const BLOCK_FRAMES: usize = 1024;

/// Blocks between two looks at the score, at most. Memory grows with this, not with the soundtrack.
const BLOCKS: usize = 64;

/// And so many, times the paths that sound: what each passes is kept for all of them.
const PATH_BLOCKS: usize = 4096;

/// What part of a soundtrack to render.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    /// Frames a second.
    pub rate_hz: u32,
    /// Where it begins, in seconds.
    pub from_s: f64,
    /// Where it ends, in seconds; `None`: with the score.
    pub to_s: Option<f64>,
    /// The length that the score gives itself, in seconds; `None`: until all has arrived.
    pub duration_s: Option<f64>,
}

impl Extent {
    /// The frames asked for; the end is open where only the score's last line tells it.
    pub fn frames(&self) -> (u64, Option<u64>) {
        let frame = |time_s: f64| first_frame(time_s, f64::from(self.rate_hz));
        let end_s = match (self.to_s, self.duration_s) {
            (Some(to_s), Some(duration_s)) => Some(to_s.min(duration_s)),
            (to_s, duration_s) => to_s.or(duration_s),
        };
        (frame(self.from_s), end_s.map(frame))
    }
}

/// A piece of a soundtrack, as it comes.
pub struct Piece<'a> {
    /// Its frames, counted from the soundtrack's beginning.
    pub frames: Range<u64>,
    /// Interleaved samples of the mix.
    pub mix: &'a [f32],
    /// Interleaved samples of each object that sounds in the piece, by its index in `objects`.
    pub stems: &'a [(usize, Vec<f32>)],
    /// The objects that have sounded so far.
    pub objects: &'a [String],
    /// The threads that have begun since the last piece.
    pub begun: &'a [Begun],
    /// The frame that the soundtrack is known to reach at least, by what has been read of it.
    pub reaches: u64,
}

/// Renders what a mixer reads, piece by piece, on the threads of the surrounding rayon pool. The
/// samples do not depend on how many those are, nor on the extent.
///
/// # Errors
/// A line of the score that cannot be read; whatever `each` returns.
pub fn render<L>(
    mixer: &mut Mixer<L>,
    channels: usize,
    extent: &Extent,
    with_stems: bool,
    mut each: impl FnMut(Piece<'_>) -> Result<()>,
) -> Result<()>
where
    L: Iterator<Item = Result<ChannelLine>>,
{
    let rate_hz = f64::from(extent.rate_hz);
    let (from, end) = extent.frames();
    let mut buses = Buses::new(mixer.voices(), from, with_stems);
    let mixed_from = buses.mixed_from(from);
    let mut at = 0;
    loop {
        let mut to = at + (BLOCKS * BLOCK_FRAMES) as u64;
        if at < from {
            to = to.min(from);
        }
        if at < mixed_from {
            to = skip(mixer, rate_hz, to, mixed_from)?;
        } else {
            mixer.read_to(to.min(at + BLOCK_FRAMES as u64))?;
            // Enough for all cores to have something to do.
            let least = (2 * rayon::current_num_threads()).min(BLOCKS);
            let blocks = (PATH_BLOCKS / mixer.threads().max(1)).clamp(least, BLOCKS);
            to = to.min(at + (blocks * BLOCK_FRAMES) as u64);
            mixer.read_to(to)?
        }
        let arrived = mixer.is_read().then(|| first_frame(mixer.last_arrival_s(), rate_hz));
        let limit = match (end, arrived) {
            (None, arrived) => arrived,
            (end, _) => end,
        };
        to = limit.map_or(to, |limit| to.min(limit));
        let known_s = mixer.next_s().unwrap_or(0.0).max(mixer.last_arrival_s());
        let reaches = limit.unwrap_or_else(|| first_frame(known_s, rate_hz));
        let begun = mixer.take_begun();
        if to <= at || at < from {
            if to > at && at >= mixed_from {
                // Not heard, but on its way through a bus.
                buses.feed(mixer.voices(), to, from)?;
            }
            let objects = mixer.objects();
            each(Piece { frames: at..at, mix: &[], stems: &[], objects, begun: &begun, reaches })?;
            if to <= at {
                return Ok(());
            }
        } else {
            let mut blocks = blocks(mixer.voices(), at..to, with_stems);
            buses.feed(mixer.voices(), to, at)?;
            buses.add(&mut blocks, channels)?;
            let mix: Vec<f32> = blocks.iter().flat_map(|b| interleave(&b.mix, channels)).collect();
            let mut sounding: Vec<usize> = blocks.iter().flat_map(|b| b.stems.keys().copied()).collect();
            sounding.sort_unstable();
            sounding.dedup();
            let silent = vec![0.0; BLOCK_FRAMES * channels];
            let stem = |object: usize| -> Vec<f32> {
                let part = |b: &Block| match b.stems.get(&object) {
                    Some(samples) => interleave(samples, channels),
                    None => interleave(&silent[..b.mix.len()], channels),
                };
                blocks.iter().flat_map(part).collect()
            };
            let stems: Vec<(usize, Vec<f32>)> =
                sounding.into_iter().map(|object| (object, stem(object))).collect();
            if let Some(index) = mix.iter().position(|sample| !sample.is_finite()) {
                let time_s = (at + (index / channels) as u64) as f64 / rate_hz;
                return Err(Error::new(format!("the mix is beyond all numbers at {time_s} s"))
                    .help("a gain in the score is too large"));
            }
            each(Piece {
                frames: at..to,
                mix: &mix,
                stems: &stems,
                objects: mixer.objects(),
                begun: &begun,
                reaches,
            })?;
        }
        mixer.release(to);
        at = to;
    }
}

/// Reads on to where something is to be rendered or, if nothing is to be read before, at least to a frame; gives where.
/// What comes before is read, for its threads may sound on, but not rendered.
fn skip<L>(mixer: &mut Mixer<L>, rate_hz: f64, to: u64, from: u64) -> Result<u64>
where
    L: Iterator<Item = Result<ChannelLine>>,
{
    // Where nothing is to be read there is nothing to be passed piece by piece.
    let next = mixer.next_s().map_or(LAST_FRAME, |next_s| first_frame(next_s, rate_hz));
    let to = to.max(next).min(from);
    mixer.skip_to(to)?;
    Ok(to)
}

/// Reads all that comes before a frame, in pieces.
pub(super) fn skip_to<L>(mixer: &mut Mixer<L>, rate_hz: f64, frame: u64) -> Result<()>
where
    L: Iterator<Item = Result<ChannelLine>>,
{
    let mut at = 0;
    while at < frame {
        at = skip(mixer, rate_hz, at + (BLOCKS * BLOCK_FRAMES) as u64, frame)?;
    }
    Ok(())
}

fn blocks(voices: &Voices, frames: Range<u64>, with_stems: bool) -> Vec<Block> {
    let starts: Vec<u64> = frames.clone().step_by(BLOCK_FRAMES).collect();
    let length = |start: u64| (frames.end - start).min(BLOCK_FRAMES as u64) as usize;
    starts.into_par_iter().map(|start| voices.render(start, length(start), with_stems)).collect()
}

/// From channel after channel to frame after frame.
fn interleave(planar: &[f64], channels: usize) -> Vec<f32> {
    let frames = planar.len() / channels;
    (0..planar.len()).map(|i| planar[(i % channels) * frames + i / channels] as f32).collect()
}
