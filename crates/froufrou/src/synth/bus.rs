//! Buses: lanes that threads are mixed into, and the long responses that the mix of each lane passes on its
//! way to the output channels.
//!
//! What a thousand threads have in common - a head, a room's tail - is done once, to their mix. A thread's
//! arrival at a [`Bus`] is read once and goes to every lane with a gain of its own ([`Feed`]); each lane has a
//! response for each of some output channels; and what comes out is added to these. The lanes of one sum, which
//! is the mix or the stem of one object, are under way in a [`Ringing`].
//!
//! A response may begin before its time by the bus's [`lead`](Bus::lead); so that the output is not late, lanes
//! are read ahead by as much: frame f of the channels hears all taps h\[k\] of a response by
//! Σ h\[k\] x\[f + lead − k\].
//!
//! | quantity | value |
//! | --- | --- |
//! | cost a voice and sample | one reading, and two multiplications and additions a lane |
//! | cost a sample, whatever the voices | a convolution a lane: see [`convolution`](crate::space::convolution) |
//! | precision | lanes are sums in single precision, each in the order of the threads' numbers |
//!
//! Samples of several lanes lie side by side, in *banks* of [`BANK`] lanes: all frames of the first bank, then
//! those of the next. The last bank is as wide as there are lanes left.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use super::filter::Filters;
use super::path::{Course, PathKey, Segment, UNSPREAD};
use super::sinc::Kernel;
use super::tiny;
use crate::space::convolution::Convolver;
use crate::space::direction::ahead_left_up;
use crate::space::directivity::{HARMONICS, harmonics};
use crate::space::microphone::{NEAR_M, length};
use crate::{Error, Result};

/// How many lanes lie side by side.
pub const BANK: usize = 16;

/// No bus has more lanes.
pub const MOST_LANES: usize = 64;

/// The lanes of a [`Feed::Field`].
pub const FIELD_LANES: usize = HARMONICS + 1;

/// With what gains an arrival goes to the lanes of a bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Feed {
    /// With its own, to all of them alike.
    Even,
    /// As a sound field of order 3 about a point in that point's frame, by the place from which it comes, on
    /// [`FIELD_LANES`] lanes: [`HARMONICS`] in ACN order and SN3D scaling, and one for what sounds at the very
    /// point, into which all fades within [`NEAR_M`].
    Field,
}

/// What a lane does to an output channel, by its number among all channels of the soundtrack.
pub type Response = (usize, Vec<f32>);

/// Lanes that threads are mixed into, and their responses. Copies share them.
#[derive(Clone)]
pub struct Bus {
    lanes: Arc<[Lane]>,
    feed: Feed,
    lead: usize,
    taps: usize,
    channels: usize,
    kernel: Kernel,
}

struct Lane {
    /// Where each response goes.
    channels: Vec<usize>,
    /// What has been fed nothing.
    convolver: Convolver,
}

impl Bus {
    /// A bus whose lanes have some responses each, at the output rate. Their first `lead` taps come before their
    /// time.
    ///
    /// ```
    /// use froufrou::synth::bus::{Bus, Feed};
    /// // A mono tail of a second for two channels: one lane, two responses.
    /// let tail = |channel: usize| (channel, vec![0.01; 48_000]);
    /// let bus = Bus::new(Feed::Even, &[vec![tail(0), tail(1)]], 0)?;
    /// assert_eq!((bus.lanes(), bus.taps()), (1, 48_000));
    /// # Ok::<(), froufrou::Error>(())
    /// ```
    ///
    /// # Errors
    /// No lanes, more than [`MOST_LANES`] or not as many as the feed has; responses that are too long together
    /// or not finite.
    pub fn new(feed: Feed, lanes: &[Vec<Response>], lead: usize) -> Result<Self> {
        let expected = match feed {
            Feed::Even => 1..=MOST_LANES,
            Feed::Field => FIELD_LANES..=FIELD_LANES,
        };
        if !expected.contains(&lanes.len()) {
            return Err(Error::new(format!(
                "a bus has {} lanes, expected {} to {}",
                lanes.len(),
                expected.start(),
                expected.end()
            )));
        }
        let lane = |responses: &Vec<Response>| {
            let taps: Vec<&[f32]> = responses.iter().map(|(_, taps)| taps.as_slice()).collect();
            let channels = responses.iter().map(|(channel, _)| *channel).collect();
            Ok(Lane { channels, convolver: Convolver::new(&taps)? })
        };
        let lanes: Arc<[Lane]> = lanes.iter().map(lane).collect::<Result<_>>()?;
        let taps = lanes.iter().map(|lane| lane.convolver.taps()).max().unwrap_or(0);
        Ok(Self { lanes, feed, lead: lead.min(taps), taps, channels: 0, kernel: Kernel::Long })
    }

    /// The same bus, with so many output channels of its own, which nothing else plays into directly.
    #[must_use]
    pub fn with_channels(self, channels: usize) -> Self {
        Self { channels, ..self }
    }

    /// The same bus, to which threads are read by another kernel.
    #[must_use]
    pub fn with_kernel(self, kernel: Kernel) -> Self {
        Self { kernel, ..self }
    }

    /// The kernel that threads are read by.
    pub fn kernel(&self) -> Kernel {
        self.kernel
    }

    /// How many output channels are its own.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// With what gains arrivals go to its lanes.
    pub fn feed(&self) -> Feed {
        self.feed
    }

    /// The number of its lanes.
    pub fn lanes(&self) -> usize {
        self.lanes.len()
    }

    /// By how many frames its lanes are read ahead.
    pub fn lead(&self) -> usize {
        self.lead
    }

    /// The length of its longest response.
    pub fn taps(&self) -> usize {
        self.taps
    }

    /// For how many frames it sounds on behind the last that arrives.
    pub fn tail(&self) -> usize {
        self.taps - self.lead
    }

    /// One more than the highest output channel that it plays into.
    pub(crate) fn reaches(&self) -> usize {
        self.lanes.iter().flat_map(|lane| &lane.channels).max().map_or(0, |channel| channel + 1)
    }

    /// The frame of its lanes from which on they must be mixed, so that the channels are right from a frame on.
    pub fn mixed_from(&self, frame: u64) -> u64 {
        let ahead = frame.saturating_add(self.lead as u64).min(i64::MAX as u64) as i64;
        let from = self.lanes.iter().map(|lane| lane.convolver.fed_from(ahead)).min().unwrap_or(ahead);
        from.max(0) as u64
    }

    /// The key of what arrives by `plain`, and for a field from a place.
    pub(crate) fn key(&self, plain: PathKey, from_m: Option<[f64; 3]>, filters: &mut Filters) -> PathKey {
        match (self.feed, from_m) {
            (Feed::Field, Some(from_m)) => {
                PathKey { spread: filters.push_spread(Box::new(field(from_m))), ..plain }
            }
            _ => plain,
        }
    }

    /// The gains of a segment in all lanes, at its beginning and by how much they are greater at its end.
    pub(crate) fn gains(&self, segment: &Segment, filters: &Filters, gains: &mut [Vec<f32>; 2]) {
        let [begin, change] = gains;
        let fill = |gains: &mut Vec<f32>, side: usize| {
            gains.clear();
            let gain = segment.gain[side] as f32;
            match segment.spread[side] {
                UNSPREAD => gains.resize(self.lanes(), gain),
                number => gains.extend(filters.spread(number).unwrap_or_default().iter().map(|g| gain * g)),
            }
            gains.resize(self.lanes(), 0.0);
        };
        fill(begin, 0);
        fill(change, 1);
        for (end, begin) in change.iter_mut().zip(begin) {
            *begin = tiny::flushed(*begin);
            *end = tiny::flushed(*end - *begin);
        }
    }
}

/// The gains of the lanes of a field for what comes from a place.
fn field(from_m: [f64; 3]) -> [f32; FIELD_LANES] {
    let distance_m = length(from_m);
    let near = (distance_m / NEAR_M).min(1.0);
    let mut gains = [0.0; FIELD_LANES];
    gains[HARMONICS] = (1.0 - near) as f32;
    if distance_m > 0.0 {
        let all = harmonics(ahead_left_up(from_m.map(|c| c / distance_m)));
        for (n, (gain, harmonic)) in gains.iter_mut().zip(all).enumerate() {
            // Solid harmonics r^n Y are smooth through the centre.
            *gain = (near.powi(n.isqrt().max(1) as i32) * harmonic) as f32;
        }
    }
    gains
}

/// Where the samples of a bank lie among those of all lanes.
fn bank(lanes: usize, frames: usize, bank: usize) -> Range<usize> {
    let first = bank * BANK;
    first * frames..(first + BANK).min(lanes) * frames
}

/// All lanes of one of some frames.
pub(crate) fn frame_mut(samples: &mut [f32], lanes: usize, frame: usize) -> impl Iterator<Item = &mut f32> {
    let frames = samples.len() / lanes.max(1);
    samples.chunks_mut((BANK * frames).max(1)).flat_map(move |bank| {
        let width = bank.len() / frames.max(1);
        bank[frame * width..(frame + 1) * width].iter_mut()
    })
}

/// Frames whose places along a segment are found at once.
const CHUNK: usize = 64;

/// Adds samples from a frame on to all lanes, with the gains of a segment.
///
/// `out` holds `frames` frames of all lanes; the first sample goes to `offset` of them.
pub(crate) struct Spreading<'a> {
    pub samples: &'a [f64],
    pub course: &'a Course,
    pub rate_hz: f64,
    pub first: u64,
    /// As [`Bus::gains`] has them.
    pub gains: [&'a [f32]; 2],
    pub out: &'a mut [f32],
    pub frames: usize,
    pub offset: usize,
}

impl pulp::WithSimd for Spreading<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let lanes = self.gains[0].len();
        let frame_s = 1.0 / self.rate_hz;
        let (mut along, mut read) = ([0.0f32; CHUNK], [0.0f32; CHUNK]);
        for (chunk, samples) in self.samples.chunks(CHUNK).enumerate() {
            let done = chunk * CHUNK;
            let first = (self.first + done as u64) as f64;
            for ((n, along), (read, sample)) in along.iter_mut().enumerate().zip(read.iter_mut().zip(samples))
            {
                let arrival_s = (first + n as u32 as f64) * frame_s;
                *along = self.course.along(arrival_s) as f32;
                *read = tiny::flushed(*sample as f32);
            }
            let (along, read) = (&along[..samples.len()], &read[..samples.len()]);
            for number in 0..lanes.div_ceil(BANK) {
                let own = number * BANK..((number + 1) * BANK).min(lanes);
                let [begin, change] = [&self.gains[0][own.clone()], &self.gains[1][own.clone()]];
                // What goes on at one point has no share in the other lanes, and the other way round.
                if begin.iter().chain(change).all(|gain| *gain == 0.0) {
                    continue;
                }
                let out = &mut self.out[bank(lanes, self.frames, number)];
                let at = (self.offset + done) * own.len();
                let out = &mut out[at..at + samples.len() * own.len()];
                if own.len() == BANK {
                    add_bank(simd, read, along, begin, change, out);
                    continue;
                }
                for ((out, sample), along) in out.chunks_exact_mut(own.len()).zip(read).zip(along) {
                    for ((out, begin), change) in out.iter_mut().zip(begin).zip(change) {
                        *out += sample * (begin + along * change);
                    }
                }
            }
        }
    }
}

/// A whole bank at once.
#[inline(always)]
fn add_bank<S: pulp::Simd>(
    simd: S,
    samples: &[f32],
    along: &[f32],
    begin: &[f32],
    change: &[f32],
    out: &mut [f32],
) {
    let vectors = const { BANK / S::F32_LANES };
    let mut gains = [[simd.splat_f32s(0.0); 2]; BANK];
    let (begin, change) = (S::as_simd_f32s(begin).0, S::as_simd_f32s(change).0);
    for (gain, (begin, change)) in gains.iter_mut().zip(begin.iter().zip(change)) {
        *gain = [*begin, *change];
    }
    let (out, _) = S::as_mut_simd_f32s(out);
    for ((out, sample), along) in out.chunks_exact_mut(vectors).zip(samples).zip(along) {
        let (sample, along) = (simd.splat_f32s(*sample), simd.splat_f32s(*along));
        for v in 0..vectors {
            // Not fused: a fused multiply-add rounds otherwise, and not every machine has it.
            let gain = simd.add_f32s(gains[v][0], simd.mul_f32s(along, gains[v][1]));
            out[v] = simd.add_f32s(out[v], simd.mul_f32s(sample, gain));
        }
    }
}

/// Some frames of all lanes of a bus. No samples at all where nothing arrives in them.
#[derive(Debug, Clone, Default)]
pub struct LaneBlock {
    /// How many frames these are.
    pub frames: usize,
    /// The mix, bank after bank.
    pub mix: Vec<f32>,
    /// The part of each object that sounds in the block, by its index; only where stems are asked for.
    pub stems: BTreeMap<usize, Vec<f32>>,
}

/// What is under way through the responses of a bus, of one sum: the mix, or the stem of one object.
pub struct Ringing {
    lanes: Vec<RingingLane>,
    /// The frame of the lanes that is fed next.
    frame: u64,
}

/// One lane of it.
pub(crate) struct RingingLane {
    channels: Vec<usize>,
    convolver: Convolver,
    /// Scratch memory.
    input: Vec<f32>,
    /// What came out last, one response after the other.
    out: Vec<f32>,
    /// Whether that is more than silence.
    sounds: bool,
}

impl Ringing {
    /// Nothing is under way yet; the next frame of the lanes to be fed is `frame`. What comes before it is
    /// silence.
    pub fn new(bus: &Bus, frame: u64) -> Self {
        let lane = |lane: &Lane| {
            let mut convolver = lane.convolver.another();
            convolver.start(frame as i64);
            let channels = lane.channels.clone();
            RingingLane { channels, convolver, input: Vec::new(), out: Vec::new(), sounds: false }
        };
        Self { lanes: bus.lanes.iter().map(lane).collect(), frame }
    }

    /// The same, with room for so many frames at a time: feeding no more of them allocates nothing.
    #[must_use]
    pub fn with_room(mut self, frames: usize) -> Self {
        for lane in &mut self.lanes {
            lane.input.reserve(frames);
            lane.out.reserve(frames * lane.channels.len());
        }
        self
    }

    /// The frame of the lanes that is fed next: the channels' next frame and the bus's lead.
    pub fn frame(&self) -> u64 {
        self.frame
    }

    /// True where from silence nothing but silence will come.
    pub fn is_silent(&self) -> bool {
        self.lanes.iter().all(|lane| lane.convolver.is_silent())
    }

    /// Feeds the next frames of all lanes, bank after bank (no samples: silence), and adds what comes out to the
    /// channels, `frames` of the first and then as many of each other. Where the number of frames does not grow
    /// nothing is allocated.
    ///
    /// # Errors
    /// Room for something else than the frames of whole channels, or fewer channels than the bus plays into.
    pub fn process(&mut self, input: &[f32], frames: usize, channels: &mut [f64]) -> Result<()> {
        let lanes = self.lanes.len();
        for (index, lane) in self.lanes.iter_mut().enumerate() {
            lane.feed(index, lanes, [(frames, input)].into_iter(), 0)?;
        }
        self.frame += frames as u64;
        self.add(0, channels, frames)
    }

    /// All lanes, to be fed side by side with the same blocks; then [`Ringing::fed`] says how much that was.
    pub(crate) fn lanes_mut(&mut self) -> &mut [RingingLane] {
        &mut self.lanes
    }

    pub(crate) fn fed(&mut self, frames: u64) {
        self.frame += frames;
    }

    /// Adds what came out last, from one of its frames on, to `frames` frames of all channels, lane by lane.
    pub(crate) fn add(&self, from: usize, channels: &mut [f64], frames: usize) -> Result<()> {
        for lane in self.lanes.iter().filter(|lane| lane.sounds) {
            let count = lane.out.len() / lane.channels.len().max(1);
            for (&channel, out) in lane.channels.iter().zip(lane.out.chunks_exact(count.max(1))) {
                let room = channels.get_mut(channel * frames..(channel + 1) * frames);
                let (Some(room), Some(out)) = (room, out.get(from..from + frames)) else {
                    return Err(Error::new(format!(
                        "a bus plays into channel {channel}, which is not there"
                    )));
                };
                room.iter_mut().zip(out).for_each(|(to, from)| *to += f64::from(*from));
            }
        }
        Ok(())
    }

    /// Whether anything came out last.
    pub(crate) fn sounds(&self) -> bool {
        self.lanes.iter().any(|lane| lane.sounds)
    }
}

impl RingingLane {
    /// Feeds what one lane has in blocks of all lanes: the number of frames of each, and its samples, if it is
    /// not silent. What comes out of the first `skipped` frames is left aside.
    pub(crate) fn feed<'a>(
        &mut self,
        lane: usize,
        lanes: usize,
        blocks: impl Iterator<Item = (usize, &'a [f32])>,
        skipped: usize,
    ) -> Result<()> {
        self.input.clear();
        let mut is_silent = true;
        for (frames, samples) in blocks {
            let begin = self.input.len();
            self.input.resize(begin + frames, 0.0);
            if let Some(own) = samples.get(bank(lanes, frames, lane / BANK)) {
                let width = (lanes - lane / BANK * BANK).min(BANK);
                let own = own.iter().skip(lane % BANK).step_by(width);
                self.input[begin..].iter_mut().zip(own).for_each(|(to, from)| *to = *from);
                is_silent = false;
            }
        }
        let skipped = skipped.min(self.input.len());
        let count = self.input.len() - skipped;
        self.out.clear();
        self.out.resize(count * self.channels.len(), 0.0);
        is_silent =
            (is_silent || self.input.iter().all(|sample| *sample == 0.0)) && self.convolver.is_silent();
        self.sounds = !is_silent;
        if is_silent {
            // What comes is what the convolver would give.
            self.convolver.start(self.convolver.frame() + self.input.len() as i64);
            return Ok(());
        }
        let (before, heard) = self.input.split_at(skipped);
        self.convolver.skip(before)?;
        self.convolver.process(heard, &mut self.out)
    }
}
