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
    let times: Vec<f64> = (0..hop).map(|t| t as f64).collect();
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
                        glide.add(piece, &times);
                        continue;
                    }
                }
                if let Some(start) = start {
                    Glide::between(start, beyond(start, hop, rate_hz, 1.0), hop, rate_hz).add(piece, &times);
                }
                if let Some(stop) = stop {
                    Glide::between(beyond(stop, hop, rate_hz, -1.0), stop, hop, rate_hz).add(piece, &times);
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

    fn add(&self, out: &mut [f64], times: &[f64]) {
        let turns = self.cubic.map(|c| c / TAU);
        pulp::Arch::new().dispatch(Adding { glide: self, turns, times, out });
    }
}

/// Samples are independent of one another, so that the bytes do not depend on the width of vectors.
struct Adding<'a> {
    glide: &'a Glide,
    /// The phase's cubic, in turns.
    turns: [f64; 4],
    /// 0, 1, 2 …
    times: &'a [f64],
    out: &'a mut [f64],
}

impl pulp::WithSimd for Adding<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let [a, b, c, d] = self.turns;
        let (amplitude, slope) = (self.glide.amplitude, self.glide.slope);
        for (to, &t) in self.out.iter_mut().zip(self.times) {
            *to += (amplitude + slope * t) * cosine(a + t * (b + t * (c + t * d)));
        }
    }
}

/// What is added to round to whole numbers: beyond it a double has no fraction.
const WHOLE: f64 = 6_755_399_441_055_744.0;

/// The cosine of a phase in turns, of up to a million of them, to 1e-10.
#[inline(always)]
fn cosine(turns: f64) -> f64 {
    // Within half a turn, then as a sine within a quarter, whose Taylor series to the 15th power errs by 6e-12.
    let rest = turns - ((turns + WHOLE) - WHOLE);
    let x = (0.25 - rest.abs()) * TAU;
    let y = x * x;
    let series = -1.0 / 1_307_674_368_000.0;
    let series = 1.0 / 6_227_020_800.0 + y * series;
    let series = -1.0 / 39_916_800.0 + y * series;
    let series = 1.0 / 362_880.0 + y * series;
    let series = -1.0 / 5_040.0 + y * series;
    let series = 1.0 / 120.0 + y * series;
    let series = -1.0 / 6.0 + y * series;
    x + x * y * series
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cosine_is_that_of_the_library() {
        let random = crate::random::Random::new(1, 0);
        for i in 0..100_000 {
            let turns = (random.uniform(i) - 0.5) * [1.0, 8.0, 1e3, 1e6][i as usize % 4];
            let off = cosine(turns) - (TAU * turns.fract()).cos();
            assert!(off.abs() < 1e-9, "{turns}: {off}");
        }
        for turns in [0.0, 0.25, 0.5, -0.5, 0.75, 1.5, -2.25] {
            assert!((cosine(turns) - (TAU * turns).cos()).abs() < 1e-10);
        }
    }
}
