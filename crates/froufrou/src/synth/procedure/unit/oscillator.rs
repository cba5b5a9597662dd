//! Oscillators: a waveform read over and over, at a pitch that may change from sample to sample.

use std::sync::Arc;

use super::{Around, Signal};
use crate::random::Random;
use crate::synth::instrument::Ramp;
use crate::synth::procedure::wave::Wave;

#[derive(Debug)]
pub(in crate::synth::procedure) struct Oscillator {
    name: &'static str,
    wave: Arc<Wave>,
    random: Random,
    /// Where in its period it is, from 0 to 1.
    phase: f64,
    /// Periods begun.
    period: u64,
    /// How much faster than its pitch this period passes.
    haste: f64,
    /// The level of harmonics at the end of the last stretch.
    level: Option<f64>,
}

impl Oscillator {
    pub(super) fn new(name: &'static str, wave: Arc<Wave>, random: Random) -> Self {
        Self { name, wave, random, phase: 0.0, period: 0, haste: 1.0, level: None }
    }

    pub(super) fn name(&self) -> &'static str {
        self.name
    }

    pub(super) fn run(
        &mut self,
        frequency: Signal<'_>,
        jitter: Signal<'_>,
        around: Around<'_>,
        out: &mut [f64],
    ) {
        let [pitches, jitters, _] = around.rooms;
        let (pitches, jitters) = (&mut pitches[..out.len()], &mut jitters[..out.len()]);
        match frequency {
            // The pitch in the middle between two samples takes the phase from one to the other.
            Signal::Ramp(Ramp { from, to }) => {
                let half = 0.5 * (to - from) / pitches.len() as f64;
                super::fill(Ramp { from: from + half, to: to + half }, pitches);
            }
            Signal::Samples(_) => frequency.fill(pitches),
        }
        jitter.map(jitters, |jitter| jitter.clamp(0.0, 0.5));
        let highest = match frequency {
            Signal::Ramp(Ramp { to, .. }) => to.abs(),
            Signal::Samples(samples) => samples.iter().fold(0.0, |most: f64, value| most.max(value.abs())),
        };
        let first = match frequency {
            Signal::Ramp(Ramp { from, .. }) => from.abs(),
            Signal::Samples(_) => highest,
        };
        let to = Wave::level(highest, around.rate_hz);
        let from = self.level.unwrap_or_else(|| Wave::level(first, around.rate_hz));
        self.level = Some(to);
        let (step, per_sample) = ((to - from) / out.len() as f64, 1.0 / around.rate_hz);
        if self.period == 0 {
            self.begin_period(jitters[0]);
        }
        for (index, sample) in out.iter_mut().enumerate() {
            *sample = self.wave.at(self.phase, from + step * index as f64);
            self.phase += pitches[index] * per_sample * self.haste;
            if !(0.0..1.0).contains(&self.phase) {
                self.wrap(jitters[index]);
            }
        }
    }

    #[inline(never)]
    fn wrap(&mut self, jitter: f64) {
        let before = self.haste;
        self.begin_period(jitter);
        // What has passed of the new period passed at its own pace.
        let (over, base) = if self.phase >= 1.0 { (self.phase - 1.0, 0.0) } else { (self.phase, 1.0) };
        self.phase = (base + over * self.haste / before).rem_euclid(1.0);
        if self.phase >= 1.0 {
            self.phase = 0.0;
        }
    }

    /// Draws the length of the next period: evenly spread about its mean, with the jitter as its
    /// standard deviation in parts of the mean.
    fn begin_period(&mut self, jitter: f64) {
        self.period += 1;
        let spread = (self.random.uniform(self.period) * 2.0 - 1.0) * 3.0_f64.sqrt();
        self.haste = 1.0 / (1.0 + jitter * spread);
    }
}
