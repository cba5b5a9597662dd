//! The last thing before a device: nothing is louder than full scale, and nothing is no number.
//!
//! A look-ahead limiter, linked over all channels so that directions stay. What needs a gain below 1 is known
//! [`Limiter::latency`] frames before it is given out. The least gain needed in so many frames is held, let go slowly,
//! and averaged over as many: the average has come down to what is needed when that is due. Gains are whole numbers
//! of 2⁻³⁰, so that the running sum is exact, what needs no limiting passes with a gain of exactly 1 and no bit is
//! changed, and there are no denormals.

/// A gain of 1.
const ONE: u64 = 1 << 30;

/// How far ahead it looks, in seconds.
const AHEAD_S: f64 = 0.0015;

/// The time constant with which it lets go, in seconds.
const RELEASE_S: f64 = 0.08;

/// A limiter of interleaved frames.
pub struct Limiter {
    channels: usize,
    /// The last frames, in a ring.
    delayed: Vec<f64>,
    /// Gains that are still to be averaged over, in a ring of as many.
    gains: Vec<u64>,
    sum: u64,
    /// The gains needed in the last frames that no later one undercuts, with the numbers of their frames, in a ring.
    least: Vec<(u64, u64)>,
    first: usize,
    count: usize,
    gain: u64,
    /// The part of what is missing from 1 that it lets go in a frame, of 2³².
    release: u64,
    frame: u64,
    /// Where in the rings it goes.
    slot: usize,
    limited: u64,
    not_numbers: u64,
}

impl Limiter {
    /// One for so many channels.
    pub fn new(channels: usize, rate_hz: f64) -> Self {
        let length = ((AHEAD_S * rate_hz) as usize).max(1);
        let release = (1.0 - (-1.0 / (RELEASE_S * rate_hz)).exp()) * 2f64.powi(32);
        Self {
            channels,
            delayed: vec![0.0; length * channels],
            gains: vec![ONE; length],
            sum: length as u64 * ONE,
            least: vec![(0, 0); length + 1],
            first: 0,
            count: 0,
            gain: ONE,
            release: release as u64,
            frame: 0,
            slot: 0,
            limited: 0,
            not_numbers: 0,
        }
    }

    /// By how many frames what comes out is late.
    pub fn latency(&self) -> usize {
        self.gains.len() - 1
    }

    /// How many frames have been made softer, and how many samples were no finite number.
    pub fn counts(&self) -> [u64; 2] {
        [self.limited, self.not_numbers]
    }

    /// Takes the next frame in and gives the one that is due.
    #[inline]
    pub fn next(&mut self, frame: impl Iterator<Item = f64>, out: &mut [f32]) {
        let length = self.gains.len();
        let slot = self.slot;
        let mut peak = 0.0f64;
        for (to, sample) in self.delayed[slot * self.channels..].iter_mut().zip(frame.take(self.channels)) {
            *to = if sample.is_finite() {
                sample
            } else {
                self.not_numbers += 1;
                0.0
            };
            peak = peak.max(to.abs());
        }
        self.slot = after(slot, length);
        let all = length as u64 * ONE;
        let gain = if peak <= 1.0 && self.gain == ONE && self.sum == all {
            // Nothing is to be made softer, nor has been of late: all gains in the rings are 1.
            (self.least[0], self.first, self.count) = ((self.frame, ONE), 0, 1);
            1.0
        } else {
            let needed = if peak <= 1.0 { ONE } else { (ONE as f64 / peak) as u64 };
            let held = self.hold(needed);
            let risen = self.gain + ((((ONE - self.gain) * self.release) >> 32) + 1).min(ONE - self.gain);
            self.gain = held.min(risen);
            self.sum = self.sum + self.gain - std::mem::replace(&mut self.gains[slot], self.gain);
            self.limited += u64::from(self.sum < all);
            self.sum as f64 / all as f64
        };
        self.frame += 1;
        let due = &self.delayed[self.slot * self.channels..][..self.channels];
        for (out, sample) in out.iter_mut().zip(due) {
            *out = ((sample * gain) as f32).clamp(-1.0, 1.0);
        }
    }

    /// The least gain that is needed in the last frames, this one among them.
    fn hold(&mut self, needed: u64) -> u64 {
        let (room, length) = (self.least.len(), self.gains.len() as u64);
        if self.count > 0 && self.least[self.first].0 + length <= self.frame {
            self.first = after(self.first, room);
            self.count -= 1;
        }
        while self.count > 0 && self.least[(self.first + self.count - 1) % room].1 >= needed {
            self.count -= 1;
        }
        self.least[(self.first + self.count) % room] = (self.frame, needed);
        self.count += 1;
        self.least[self.first].1
    }
}

/// The next place in a ring.
fn after(place: usize, length: usize) -> usize {
    if place + 1 == length { 0 } else { place + 1 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn limited(limiter: &mut Limiter, input: &[f64]) -> Vec<f32> {
        let frames = input.chunks_exact(limiter.channels);
        let mut out = vec![0.0; input.len()];
        let channels = limiter.channels;
        for (frame, out) in frames.zip(out.chunks_exact_mut(channels)) {
            limiter.next(frame.iter().copied(), out);
        }
        out
    }

    #[test]
    fn what_is_not_too_loud_passes_to_the_last_bit() {
        let mut limiter = Limiter::new(2, 48_000.0);
        let random = Random::new(1, 1);
        let input: Vec<f64> =
            (0..20_000).map(|n| 2.0 * random.uniform(n) - 1.0).chain([1.0, -1.0, 1e-310, 0.0]).collect();
        let late = 2 * limiter.latency();
        let mut padded = input.clone();
        padded.resize(input.len() + late, 0.0);
        let out = limited(&mut limiter, &padded);
        assert!(out[..late].iter().all(|sample| *sample == 0.0));
        assert!(out[late..].iter().zip(&input).all(|(out, input)| *out == *input as f32));
        assert_eq!((limiter.latency(), limiter.counts()), (71, [0, 0]));
    }

    #[test]
    fn a_step_beyond_full_scale_is_met_by_a_straight_ramp() {
        let mut limiter = Limiter::new(1, 48_000.0);
        let (length, at) = (limiter.latency() + 1, 200);
        let level = |n: usize| if n < at { 0.25 } else { 2.0 };
        let input: Vec<f64> = (0..2000).map(level).collect();
        let out = limited(&mut limiter, &input);
        for (n, out) in out.iter().enumerate().skip(length) {
            let given = n + 1 - length;
            // Of the last gains so many are ½.
            let halves = (n + 1).saturating_sub(at).min(length) as f64 / length as f64;
            let expected = level(given) * (1.0 - 0.5 * halves);
            assert!((f64::from(*out) - expected).abs() < 1e-6, "{n}: {out}, not {expected}");
        }
        // It lets go with its time constant, and altogether in the end.
        let mut soft = vec![0.5; (RELEASE_S * 48_000.0) as usize];
        let out = limited(&mut limiter, &soft);
        let gain = f64::from(*out.last().unwrap()) / 0.5;
        let waited = (soft.len() - 1) as f64 - 1.5 * length as f64;
        let expected = 1.0 - 0.5 * (-waited / (RELEASE_S * 48_000.0)).exp();
        assert!((gain - expected).abs() < 1e-3, "{gain}, not {expected}");
        soft.resize(120_000, 0.5);
        assert_eq!(limited(&mut limiter, &soft).last(), Some(&0.5));
    }

    #[test]
    fn nothing_gets_beyond_full_scale() {
        let random = Random::new(7, 3);
        let hostile = |n: u64| match random.below(2 * n, 12) {
            0 => f64::NAN,
            1 => f64::INFINITY,
            2 => f64::NEG_INFINITY,
            3 => f64::MAX,
            4 => f64::MIN_POSITIVE / 8.0,
            5 => 1.0f64.next_up(),
            _ => 60.0 * (random.uniform(2 * n + 1) - 0.5),
        };
        for channels in [1, 2, 6] {
            let mut limiter = Limiter::new(channels, 44_100.0);
            let input: Vec<f64> = (0..60_000).map(hostile).collect();
            let out = limited(&mut limiter, &input);
            assert!(out.iter().all(|sample| sample.abs() <= 1.0));
            let bad = input[..input.len() / channels * channels].iter().filter(|sample| !sample.is_finite());
            assert_eq!(limiter.counts()[1], bad.count() as u64);
        }
    }

    #[test]
    fn all_channels_have_one_gain() {
        let mut limiter = Limiter::new(2, 48_000.0);
        let input: Vec<f64> = (0..4000).flat_map(|n| [3.0 * (f64::from(n) * 0.05).sin(), 0.1]).collect();
        let out = limited(&mut limiter, &input);
        let late = limiter.latency();
        for n in late..4000 {
            let (loud, soft) = (input[2 * (n - late)], input[2 * (n - late) + 1]);
            let gain = f64::from(out[2 * n + 1]) / soft;
            assert!((f64::from(out[2 * n]) - loud * gain).abs() < 1e-6);
        }
    }
}
