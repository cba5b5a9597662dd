//! Partials become sound.

use std::f64::consts::TAU;

use rayon::prelude::*;

use super::{Key, Partials};

/// How many hops one thread renders at a time.
const STRETCH: usize = 64;

/// Two keys whose phases disagree with their frequencies by more than this, in radians, are not one sinusoid's: a path
/// through both would leave both frequencies.
const COHERENT: f64 = 1.0;

/// The sum of all partials. Between two keys the amplitude moves along a line and the phase along the cubic that has
/// both keys' phases and frequencies and bends least (McAulay & Quatieri 1986); keys that do not agree cross-fade. A partial swells in the
/// hop before its first key and fades in that after its last.
pub(super) fn render(partials: &Partials) -> Vec<f32> {
    let hop = partials.hop.max(1);
    let rate_hz = partials.rate_hz;
    let mut out = vec![0.0f32; partials.length];
    out.par_chunks_mut(STRETCH * hop).enumerate().for_each(|(stretch, chunk)| {
        let mut sum = vec![0.0f64; chunk.len()];
        let first = stretch * STRETCH;
        let last = first + chunk.len().div_ceil(hop);
        for partial in &partials.partials {
            let end = partial.first_frame + partial.keys.len();
            // Segment m goes from frame m to m + 1.
            let from = partial.first_frame.saturating_sub(1).max(first);
            for segment in from..end.min(last) {
                let key = |frame: usize| {
                    frame.checked_sub(partial.first_frame).and_then(|i| partial.keys.get(i)).copied()
                };
                let at = (segment - first) * hop;
                let until = (at + hop).min(sum.len());
                let piece = &mut sum[at..until];
                let (start, stop) = (key(segment), key(segment + 1));
                if let (Some(start), Some(stop)) = (start, stop) {
                    let glide = Glide::between(start, stop, hop, rate_hz);
                    if glide.surprise <= COHERENT {
                        glide.add(piece);
                        continue;
                    }
                }
                if let Some(start) = start {
                    Glide::between(start, beyond(start, hop, rate_hz, 1.0), hop, rate_hz).add(piece);
                }
                if let Some(stop) = stop {
                    Glide::between(beyond(stop, hop, rate_hz, -1.0), stop, hop, rate_hz).add(piece);
                }
            }
        }
        for (to, from) in chunk.iter_mut().zip(&sum) {
            *to = *from as f32;
        }
    });
    out
}

/// The silent key a hop after (or before) a key.
fn beyond(key: Key, hop: usize, rate_hz: u32, direction: f64) -> Key {
    let advance = TAU * key.frequency_hz * hop as f64 / f64::from(rate_hz);
    Key { amplitude: 0.0, phase: key.phase + direction * advance, ..key }
}

/// The sinusoid from one key to the next.
struct Glide {
    amplitude: f64,
    slope: f64,
    /// Of the phase, by rising power.
    cubic: [f64; 4],
    /// How far the second key's phase is from where the two frequencies would lead, in radians, at most π.
    surprise: f64,
}

impl Glide {
    fn between(start: Key, stop: Key, hop: usize, rate_hz: u32) -> Self {
        let span = hop as f64;
        let step = TAU / f64::from(rate_hz);
        let (w0, w1) = (step * start.frequency_hz, step * stop.frequency_hz);
        // The number of whole turns that makes the phase's path straightest, and the cubic's upper coefficients.
        let expected = start.phase + (w0 + w1) * span / 2.0 - stop.phase;
        let turns = (expected / TAU).round();
        let gap = stop.phase - start.phase - w0 * span + TAU * turns;
        let square = 3.0 * gap / (span * span) - (w1 - w0) / span;
        let cube = -2.0 * gap / (span * span * span) + (w1 - w0) / (span * span);
        Self {
            amplitude: start.amplitude,
            slope: (stop.amplitude - start.amplitude) / span,
            cubic: [start.phase, w0, square, cube],
            surprise: (expected - TAU * turns).abs(),
        }
    }

    fn add(&self, out: &mut [f64]) {
        let [a, b, c, d] = self.cubic;
        for (i, to) in out.iter_mut().enumerate() {
            let t = i as f64;
            *to += (self.amplitude + self.slope * t) * (a + t * (b + t * (c + t * d))).cos();
        }
    }
}
