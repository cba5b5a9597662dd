//! One path of a thread in one channel: a signal read along its way.

use std::ops::Range;
use std::sync::Arc;

use super::path::{Course, Fades, Segment};
use super::sinc::{self, Kernel, Samples};

/// A sampled prototype sound: what a thread plays.
#[derive(Debug, Clone)]
pub struct Prototype {
    /// One channel of samples; one period where it is looped.
    pub samples: Arc<[f32]>,
    /// Their rate.
    pub rate_hz: f64,
    /// True where the samples repeat without end.
    pub looped: bool,
}

impl Prototype {
    /// Length in seconds at speed 1; infinite for a loop, 0 for an empty one.
    pub fn duration_s(&self) -> f64 {
        match (self.samples.is_empty(), self.looped) {
            (true, _) => 0.0,
            (false, true) => f64::INFINITY,
            (false, false) => self.samples.len() as f64 / self.rate_hz,
        }
    }
}

/// The samples that a voice reads.
#[derive(Debug, Clone, Copy)]
pub struct Signal<'a> {
    /// The samples.
    pub samples: Samples<'a>,
    /// The number of the first of them: a whole number, 0 for those of a recording.
    pub base: f64,
    /// Their rate.
    pub rate_hz: f64,
    /// How well they are read.
    pub kernel: Kernel,
}

impl Prototype {
    /// Its samples.
    pub fn signal(&self) -> Signal<'_> {
        let samples = Samples { samples: &self.samples, looped: self.looped };
        Signal { samples, base: 0.0, rate_hz: self.rate_hz, kernel: Kernel::Long }
    }
}

/// How a thread plays its prototype.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Playback {
    /// Emission time at which it starts.
    pub start_s: f64,
    /// Seconds of the recording played in a second.
    pub speed: f64,
    /// Where in the recording it begins, in seconds.
    pub offset_s: f64,
}

impl Playback {
    /// True where playing begins within the sound, not at its onset, so that it must fade in.
    pub fn fades_in(&self, prototype: &Prototype) -> bool {
        prototype.looped && prototype.rate_hz > 0.0 || self.offset_s > 0.0
    }

    /// Seconds before the start at which the resampled onset begins: the half width of the kernel.
    /// `source_rate_hz` is the rate of the samples that are played.
    pub fn lead_s(&self, source_rate_hz: f64, rate_hz: f64) -> f64 {
        let ratio = self.speed * source_rate_hz / rate_hz;
        sinc::half_width(ratio) as f64 / (self.speed * source_rate_hz)
    }
}

/// The last frame that is counted: up to here every whole number has a double of its own.
pub const LAST_FRAME: u64 = 1 << 53;

/// The first output frame that lies at or after a time, 0 for times before the beginning and
/// [`LAST_FRAME`] for those after it.
pub fn first_frame(time_s: f64, rate_hz: f64) -> u64 {
    // The product may be rounded across a whole number; the division below is the law.
    let mut frame = (time_s * rate_hz).ceil().clamp(0.0, LAST_FRAME as f64) as u64;
    while frame > 0 && (frame - 1) as f64 / rate_hz >= time_s {
        frame -= 1;
    }
    while frame < LAST_FRAME && (frame as f64 / rate_hz) < time_s {
        frame += 1;
    }
    frame
}

/// Distance from a whole sample, in samples, below which a position is taken to be one: well above
/// what rounding leaves after a day of sound, far below what could be heard.
const WHOLE_SAMPLE: f64 = 1e-6;

/// Adds a segment of a voice to a block of output.
///
/// `block` holds the frames from `block_frame` on at `rate_hz`; frames outside the segment are left
/// alone. Each sample depends on its frame number alone, not on the block it is rendered in. Returns
/// the range of the block that was touched. Scratch memory is `window`.
///
/// Where a path stands still, the rates agree and the delay is a whole number of samples, the
/// recording's samples pass unchanged but for the gain.
pub fn add_segment(
    signal: Signal<'_>,
    playback: &Playback,
    segment: &Segment,
    rate_hz: f64,
    block_frame: u64,
    block: &mut [f64],
    window: &mut Vec<f32>,
) -> Range<usize> {
    Passage::new(*segment, playback, signal.rate_hz, rate_hz).add(
        signal,
        playback,
        block_frame,
        block,
        window,
    )
}

/// A segment made ready to be read in many short blocks: what does not depend on the block is found once.
#[derive(Debug, Clone)]
pub(super) struct Passage {
    pub segment: Segment,
    course: Course,
    /// The frames that lie in it.
    frames: Range<u64>,
    rate_hz: f64,
    /// Samples of the prototype in a frame of its source's time.
    step: f64,
    /// Whether the delay stands still.
    is_still: bool,
    /// Whether so sample follows sample at the rate at which they were recorded; then by which frame it is known what lies
    /// between two of them, whatever part of the way this segment is.
    is_even: bool,
    origin: u64,
    fades: bool,
}

impl Passage {
    /// That of a segment, along which a recording of a rate is played.
    pub fn new(segment: Segment, playback: &Playback, source_rate_hz: f64, rate_hz: f64) -> Self {
        let frames = first_frame(segment.begin_s, rate_hz)..first_frame(segment.end_s, rate_hz);
        let step = playback.speed * source_rate_hz / rate_hz;
        let is_still = segment.is_still();
        let (is_even, fades) = (is_still && step == 1.0, segment.fades != Fades::NONE);
        let origin = if is_even { first_frame(playback.start_s + segment.delay_s[0], rate_hz) } else { 0 };
        Self { course: segment.course(), segment, frames, rate_hz, step, is_still, is_even, origin, fades }
    }

    /// How it goes on.
    pub fn course(&self) -> &Course {
        &self.course
    }

    /// Whether anything of it falls into so many frames from one on.
    pub fn touches(&self, frame: u64, count: usize) -> bool {
        self.frames.start < frame + count as u64 && self.frames.end > frame
    }

    /// Adds what falls into a block, as [`add_segment`] does.
    #[inline]
    pub fn add(
        &self,
        signal: Signal<'_>,
        playback: &Playback,
        block_frame: u64,
        block: &mut [f64],
        window: &mut Vec<f32>,
    ) -> Range<usize> {
        let first = self.frames.start.max(block_frame);
        let end = self.frames.end.min(block_frame + block.len() as u64);
        if first >= end {
            return 0..0;
        }
        let range = (first - block_frame) as usize..(end - block_frame) as usize;
        // The vector unit of the machine is chosen here; the sums inside are made in one fixed order.
        pulp::Arch::new().dispatch(Reading {
            passage: self,
            samples: signal.samples,
            base: signal.base,
            kernel: signal.kernel,
            playback,
            source_rate_hz: playback.speed * signal.rate_hz,
            offset: playback.offset_s * signal.rate_hz,
            first,
            out: &mut block[range.clone()],
            window,
        });
        range
    }
}

/// The inner loop of [`Passage::add`].
struct Reading<'a> {
    passage: &'a Passage,
    samples: Samples<'a>,
    base: f64,
    kernel: Kernel,
    playback: &'a Playback,
    /// Samples of the prototype in a second of its source's time.
    source_rate_hz: f64,
    /// Where in the prototype it begins, in samples.
    offset: f64,
    first: u64,
    out: &'a mut [f64],
    window: &'a mut Vec<f32>,
}

/// Frames whose positions are found before any of them is read: few enough to stay near.
const CHUNK: usize = 64;

/// So many are found in one go, for the processor does several at a time.
const GROUP: usize = 16;

/// What is so in each of some frames, by their numbers, and in some more to a whole group.
#[inline(always)]
fn each(out: &mut [f64; CHUNK], count: usize, of: impl Fn(f64) -> f64) {
    let groups = out.as_chunks_mut::<GROUP>().0.iter_mut().zip((0u32..).step_by(GROUP));
    for (group, first) in groups.take(count.div_ceil(GROUP)) {
        group.iter_mut().zip(first..).for_each(|(out, n)| *out = of(n.into()));
    }
}

/// Adds samples with a gain each.
#[inline(always)]
fn add(out: &mut [f64], samples: &[f32], gains: &[f64]) {
    for (out, (sample, gain)) in out.iter_mut().zip(samples.iter().zip(gains)) {
        *out += f64::from(*sample) * gain;
    }
}

impl pulp::WithSimd for Reading<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let &Passage { ref segment, ref course, rate_hz, step, is_still, is_even, origin, fades, .. } =
            self.passage;
        // The base is taken off last: whole numbers do not change how a position is rounded, so that
        // it does not matter how much of a signal is held.
        let place = |emission_s: f64| {
            (emission_s - self.playback.start_s) * self.source_rate_hz + self.offset - self.base
        };
        // Where nothing moves, all positions are as far from a whole sample but for rounding. One
        // speaks for all: else it would depend on the block how they are read.
        let whole = |position: f64| (position - position.round()).abs() < WHOLE_SAMPLE;
        let begin = if is_even { place(origin as f64 / rate_hz - segment.delay_s[0]) } else { 0.0 };
        let unchanged = is_even && whole(begin);
        // What leaves later arrives later, so that the first frame and the last speak for all.
        let fades = fades && {
            let last = self.first + (self.out.len() as u64).saturating_sub(1);
            let [from_s, to_s] = [self.first, last].map(|frame| segment.emission_s(frame as f64 / rate_hz));
            !segment.fades.are_over(from_s, to_s)
        };
        if unchanged && !fades && segment.gain[0] == segment.gain[1] {
            let index = (begin.round() as i64).saturating_add(self.first as i64 - origin as i64);
            return self.samples.add(index, segment.gain[0], self.out);
        }
        let (mut positions, mut ratios, mut gains) = ([0.0f64; CHUNK], [0.0f64; CHUNK], [0.0f64; CHUNK]);
        let mut read = [0.0f32; CHUNK];
        let frame_s = 1.0 / rate_hz;
        for (chunk, out) in self.out.chunks_mut(CHUNK).enumerate() {
            let first = (self.first + (chunk * CHUNK) as u64) as f64;
            let count = out.len();
            let arrival_s = |n: f64| (first + n) * frame_s;
            match is_still {
                true => each(&mut positions, count, |n| place(arrival_s(n) - segment.delay_s[0])),
                false => each(&mut positions, count, |n| place(arrival_s(n) - course.delay_s(arrival_s(n)))),
            }
            // Lines are the same at all rates.
            match is_still || self.kernel == Kernel::Line {
                true => ratios = [step; CHUNK],
                false => each(&mut ratios, count, |n| course.rate(arrival_s(n)) * step),
            }
            match segment.gain[0] == segment.gain[1] {
                true => gains = [segment.gain[0]; CHUNK],
                false => each(&mut gains, count, |n| course.gain(arrival_s(n))),
            }
            if fades {
                for (gain, n) in gains[..count].iter_mut().zip(0u32..) {
                    let arrival_s = arrival_s(n.into());
                    *gain *= segment.fades.gain(arrival_s - course.delay_s(arrival_s));
                }
            }
            if unchanged {
                for (read, position) in read.iter_mut().zip(&positions[..count]) {
                    *read = self.samples.at(position.round() as i64);
                }
            } else {
                let (positions, ratios, read) = (&positions[..count], &ratios[..count], &mut read[..count]);
                match self.kernel {
                    Kernel::Long if is_even => {
                        self.samples.read_still(simd, begin, positions, read, self.window);
                    }
                    Kernel::Long => self.samples.read(simd, positions, ratios, read, self.window),
                    Kernel::Short => self.samples.read_short(simd, positions, ratios, read, self.window),
                    Kernel::Line => self.samples.read_line(positions, read),
                }
            }
            // Whole groups, and what is left.
            let (groups, rest) = out.as_chunks_mut::<GROUP>();
            let heard = read.as_chunks::<GROUP>().0.iter().zip(gains.as_chunks::<GROUP>().0);
            let at = groups.len() * GROUP;
            for (out, (samples, gains)) in groups.iter_mut().zip(heard) {
                add(out, samples, gains);
            }
            add(rest, &read[at..count], &gains[at..count]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::path::{UNFILTERED, UNSPREAD};
    use super::*;

    fn still(begin_s: f64, end_s: f64, delay_s: f64, gain: f64) -> Segment {
        Segment {
            begin_s,
            end_s,
            delay_s: [delay_s; 2],
            slope: [0.0; 2],
            gain: [gain; 2],
            filter: [UNFILTERED; 2],
            spread: [UNSPREAD; 2],
            fades: Fades::NONE,
        }
    }

    fn noise(length: usize) -> Arc<[f32]> {
        let random = crate::random::Random::new(1, 1);
        (0..length as u64).map(|i| (random.uniform(i) * 2.0 - 1.0) as f32).collect()
    }

    #[test]
    fn frames_are_counted_exactly() {
        for rate in [8_000.0, 44_100.0, 48_000.0, 96_000.0, 192_000.0] {
            for frame in [0u64, 1, 2, 3, 47_999, 48_001, 1_000_003, 172_800_000, 16_588_800_007] {
                let time = frame as f64 / rate;
                assert_eq!(first_frame(time, rate), frame);
                assert_eq!(first_frame(time.next_up(), rate), frame + 1);
            }
        }
        assert_eq!(first_frame(-3.0, 48_000.0), 0);
        for time in [1e12, 1e30, f64::MAX, f64::INFINITY] {
            assert_eq!(first_frame(time, 192_000.0), LAST_FRAME);
        }
    }

    #[test]
    fn a_whole_sample_delay_passes_the_recording_unchanged() {
        let prototype = Prototype { samples: noise(3000), rate_hz: 48_000.0, looped: false };
        for (start, delay) in [(0u64, 0u64), (7, 100), (48_000 * 3600, 31), (48_000 * 86_400 + 1, 4801)] {
            let (start_s, delay_s) = (start as f64 / 48_000.0, delay as f64 / 48_000.0);
            let playback = Playback { start_s, speed: 1.0, offset_s: 0.0 };
            let segment = still(start_s + delay_s, start_s + delay_s + 1.0, delay_s, 1.0);
            let mut block = vec![0.0; 4000];
            add_segment(
                prototype.signal(),
                &playback,
                &segment,
                48_000.0,
                start + delay,
                &mut block,
                &mut Vec::new(),
            );
            for (out, &sample) in block.iter().zip(prototype.samples.iter()) {
                assert_eq!(*out, f64::from(sample), "start {start} delay {delay}");
            }
            assert!(block[3000..].iter().all(|&out| out == 0.0));
        }
    }

    #[test]
    fn nearly_whole_samples_are_read_alike_in_every_block() {
        let prototype = Prototype { samples: noise(3000), rate_hz: 48_000.0, looped: false };
        let start_s = 1000.0 / 3.0;
        let playback = Playback { start_s, speed: 1.0, offset_s: 0.0 };
        // At the very threshold rounding takes some positions for whole ones and some not.
        for part in (-60..60).map(|step| 1.0 + f64::from(step) * 1e-4) {
            let delay_s = (5.0 / 3.0 + WHOLE_SAMPLE * part) / 48_000.0 - 2.0 / 3.0 / 48_000.0;
            let segment = still(start_s, start_s + 0.05, delay_s, 1.0);
            let first = first_frame(start_s, 48_000.0);
            let mut whole = vec![0.0; 300];
            let window = &mut Vec::new();
            add_segment(prototype.signal(), &playback, &segment, 48_000.0, first, &mut whole, window);
            for (n, piece) in whole.chunks(3).enumerate() {
                let mut block = vec![0.0; piece.len()];
                let at = first + 3 * n as u64;
                add_segment(prototype.signal(), &playback, &segment, 48_000.0, at, &mut block, window);
                assert_eq!(block, piece);
            }
        }
    }

    #[test]
    fn what_is_copied_is_each_sample_with_its_gain() {
        let samples = noise(37);
        for (looped, offset) in [(true, 0), (true, 30), (false, 0), (false, 30)] {
            let prototype = Prototype { samples: samples.clone(), rate_hz: 48_000.0, looped };
            let (start, delay) = (1000u64, 11);
            let start_s = start as f64 / 48_000.0;
            let playback = Playback { start_s, speed: 1.0, offset_s: f64::from(offset) / 48_000.0 };
            // It begins before its time, and fades at both ends: that is over in between, where samples are copied.
            let fades = Fades { in_s: start_s, out_s: start_s + 0.05 };
            let delay_s = f64::from(delay) / 48_000.0;
            let segment = Segment { fades, ..still(start_s - 0.001, start_s + 0.07, delay_s, 0.37) };
            let expected: Vec<f64> = (0..5000u64)
                .map(|frame| {
                    let arrival_s = frame as f64 / 48_000.0;
                    if !(segment.begin_s..segment.end_s).contains(&arrival_s) {
                        return 0.0;
                    }
                    let index = frame as i64 - start as i64 - i64::from(delay) + i64::from(offset);
                    let sample = prototype.signal().samples.at(index);
                    f64::from(sample) * (0.37 * fades.gain(segment.emission_s(arrival_s)))
                })
                .collect();
            assert!(expected.iter().filter(|&&sample| sample != 0.0).count() > 5);
            let mut whole = None;
            for length in [1usize, 7, 128, 5000] {
                let mut found = Vec::new();
                while found.len() < 5000 {
                    let mut block = vec![0.0; length.min(5000 - found.len())];
                    let at = found.len() as u64;
                    let window = &mut Vec::new();
                    add_segment(prototype.signal(), &playback, &segment, 48_000.0, at, &mut block, window);
                    found.extend(block);
                }
                for (found, expected) in found.iter().zip(&expected) {
                    let what = format!("looped {looped}, {offset} samples into it, blocks of {length}");
                    assert!((found - expected).abs() < 1e-12, "{what}: {found}, not {expected}");
                }
                assert!(*whole.get_or_insert(found.clone()) == found, "blocks of {length}");
            }
        }
    }

    #[test]
    fn a_sample_does_not_depend_on_its_block() {
        let prototype = Prototype { samples: noise(900), rate_hz: 44_100.0, looped: true };
        let playback = Playback { start_s: 0.1, speed: 1.3, offset_s: 0.004 };
        let segment = Segment {
            begin_s: 0.2,
            end_s: 0.31,
            delay_s: [0.09, 0.12],
            slope: [0.2, 0.4],
            gain: [0.3, 0.9],
            filter: [UNFILTERED; 2],
            spread: [UNSPREAD; 2],
            fades: Fades { in_s: 0.12, out_s: 0.18 },
        };
        let mut whole = vec![0.0; 20_000];
        add_segment(prototype.signal(), &playback, &segment, 48_000.0, 0, &mut whole, &mut Vec::new());
        assert!(whole.iter().any(|&out| out != 0.0));
        for length in [1usize, 7, 256, 4096] {
            let mut pieces = Vec::new();
            while pieces.len() < whole.len() {
                let mut block = vec![0.0; length];
                add_segment(
                    prototype.signal(),
                    &playback,
                    &segment,
                    48_000.0,
                    pieces.len() as u64,
                    &mut block,
                    &mut Vec::new(),
                );
                pieces.extend(block);
            }
            assert_eq!(pieces[..whole.len()], whole);
        }
    }
}
