//! A stretch of a path that may pass filters, rendered piece by piece for all blocks that hear it.
//!
//! What passes a filter is heard after its time, and before it where the filter has a lead, so several blocks hear
//! one sample. And an FFT rounds as all of its input says. So a stretch is cut into pieces of its own, whatever the
//! blocks: each is read once, whole, and rendered by the first block that asks, and every block adds its part. A
//! piece is forgotten as soon as blocks have heard all of it; it would be rendered again with the same bits.

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::filter::{self, Filter, convolve};
use super::path::Segment;
use super::voice::{self, Playback, Signal, first_frame};

/// A segment, and what of it has been rendered and not yet heard.
pub(super) struct Stretch {
    pub segment: Segment,
    pieces: Mutex<Vec<Arc<Piece>>>,
}

/// What came out of the filters for some frames of a segment.
struct Piece {
    /// Which it is: its place in the segment, and the gain with which it was read.
    index: u64,
    gain: [f64; 2],
    /// The frames that hear it.
    heard: Range<i64>,
    /// Its samples; none where all are 0.
    samples: OnceLock<Vec<f32>>,
    /// In how many frames blocks have heard it.
    done: AtomicUsize,
}

/// What a stretch reads and through what it passes.
pub(super) struct Passing<'a> {
    pub signal: Signal<'a>,
    pub playback: &'a Playback,
    pub rate_hz: f64,
    /// At its beginning and at its end.
    pub filters: [&'a Filter; 2],
}

/// Memory that rendering uses again and again.
#[derive(Default)]
pub(super) struct Memory {
    arriving: Vec<f64>,
    weighted: [Vec<f32>; 2],
    filter: filter::Memory,
}

impl From<Segment> for Stretch {
    fn from(segment: Segment) -> Self {
        Self { segment, pieces: Mutex::default() }
    }
}

impl Stretch {
    /// Adds what is heard of it in the block of frames from `frame` on, with another gain than its own; the range
    /// that was touched. Scratch memory are `window` and `memory`.
    pub fn add(
        &self,
        passing: &Passing<'_>,
        gain: [f64; 2],
        frame: u64,
        block: &mut [f64],
        window: &mut Vec<f32>,
        memory: &mut Memory,
    ) -> Range<usize> {
        let frames = [self.segment.begin_s, self.segment.end_s].map(|s| first_frame(s, passing.rate_hz));
        let [first, end] = frames;
        let [lead, tail] = filter::reach(passing.filters.into_iter());
        let mut touched = 0..0;
        if first >= end {
            return touched;
        }
        let length = filter::piece(end - first, lead + tail) as u64;
        let block_end = frame + block.len() as u64;
        // The first piece whose end may be heard.
        let mut index = frame.saturating_sub(first + tail as u64) / length;
        while first + index * length < end.min(block_end + lead as u64) {
            let from = first + index * length;
            let to = (from + length).min(end);
            let heard = from as i64 - lead as i64..(to + tail as u64) as i64 - 1;
            let (begin, stop) = (heard.start.max(frame as i64), heard.end.min(block_end as i64));
            if begin < stop {
                let piece = self.piece(index, gain, heard);
                let read = Segment { gain, ..self.segment };
                let samples = piece.samples.get_or_init(|| passing.render(&read, from..to, window, memory));
                let at = (begin - frame as i64) as usize..(stop - frame as i64) as usize;
                let offset = (begin - piece.heard.start) as usize;
                if let Some(samples) = samples.get(offset..offset + at.len()) {
                    touched = if touched.is_empty() { at.clone() } else { touched.start..at.end };
                    let added = block[at.clone()].iter_mut().zip(samples);
                    added.for_each(|(to, from)| *to += f64::from(*from));
                }
                self.count(&piece, at.len());
            }
            index += 1;
        }
        touched
    }

    /// A piece that has been asked for, or a new one.
    fn piece(&self, index: u64, gain: [f64; 2], heard: Range<i64>) -> Arc<Piece> {
        let mut pieces = self.pieces.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(piece) = pieces.iter().find(|piece| (piece.index, piece.gain) == (index, gain)) {
            return piece.clone();
        }
        let piece =
            Arc::new(Piece { index, gain, heard, samples: OnceLock::new(), done: AtomicUsize::new(0) });
        pieces.push(piece.clone());
        piece
    }

    /// Some more frames have heard a piece; after the last it is forgotten.
    fn count(&self, piece: &Arc<Piece>, frames: usize) {
        let done = piece.done.fetch_add(frames, Ordering::Relaxed) + frames;
        if done as u64 >= (piece.heard.end - piece.heard.start) as u64 {
            let mut pieces = self.pieces.lock().unwrap_or_else(PoisonError::into_inner);
            pieces.retain(|kept| !Arc::ptr_eq(kept, piece));
        }
    }

    /// Forgets what has been heard before a frame.
    pub fn release(&mut self, frame: u64) {
        let pieces = self.pieces.get_mut().unwrap_or_else(PoisonError::into_inner);
        pieces.retain(|piece| piece.heard.end > frame as i64);
    }
}

impl Passing<'_> {
    /// All that is heard of some frames of a segment; nothing where all is silence.
    fn render(
        &self,
        segment: &Segment,
        frames: Range<u64>,
        window: &mut Vec<f32>,
        memory: &mut Memory,
    ) -> Vec<f32> {
        let Self { signal, playback, rate_hz, filters: [from, to] } = self;
        let Memory { arriving, weighted: [fading, rising], filter } = memory;
        arriving.clear();
        arriving.resize((frames.end - frames.start) as usize, 0.0);
        voice::add_segment(*signal, playback, segment, *rate_hz, frames.start, arriving, window);
        if arriving.iter().all(|sample| *sample == 0.0) {
            return Vec::new();
        }
        fading.clear();
        if std::ptr::eq(*from, *to) {
            fading.extend(arriving.iter().map(|sample| *sample as f32));
            return convolve(&[(fading, from)], filter);
        }
        rising.clear();
        fading.resize(arriving.len(), 0.0);
        rising.resize(arriving.len(), 0.0);
        pulp::Arch::new().dispatch(Fading { arriving, segment, rate_hz: *rate_hz, frames, fading, rising });
        convolve(&[(fading, from), (rising, to)], filter)
    }
}

/// Shares samples out between the filter that a segment leaves and the one that it comes to.
struct Fading<'a> {
    arriving: &'a [f64],
    segment: &'a Segment,
    rate_hz: f64,
    frames: Range<u64>,
    fading: &'a mut [f32],
    rising: &'a mut [f32],
}

impl pulp::WithSimd for Fading<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { arriving, segment, rate_hz, frames, fading, rising } = self;
        let (begin_s, first) = (segment.begin_s, frames.start as f64);
        let per_s = 1.0 / (segment.end_s - begin_s);
        for (n, ((fading, rising), sample)) in (0u32..).zip(fading.iter_mut().zip(rising).zip(arriving)) {
            let along = (((first + f64::from(n)) / rate_hz - begin_s) * per_s).clamp(0.0, 1.0);
            *fading = (sample * (1.0 - along)) as f32;
            *rising = (sample * along) as f32;
        }
    }
}
