//! Filters that stay stable while their parameters move: topology-preserving transforms (Zavalishin
//! 2012) of the analogue one- and two-pole filters, and a resonator that turns in the complex plane.

use std::f64::consts::{PI, TAU};

use super::{Around, Signal, settle};

/// Highest cut-off, in parts of the sample rate.
const HIGHEST: f64 = 0.49;

/// What a filter lets pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::synth::procedure) enum Pass {
    Low,
    High,
    Band,
}

/// The bilinear transform's integrator gain of a cut-off.
fn gain(cutoff_hz: f64, rate_hz: f64) -> f64 {
    (PI * (cutoff_hz / rate_hz).clamp(0.0, HIGHEST)).tan()
}

/// 6 dB an octave.
#[derive(Debug)]
pub(in crate::synth::procedure) struct OnePole {
    pass: Pass,
    state: f64,
}

impl OnePole {
    pub(super) fn new(pass: Pass) -> Self {
        Self { pass, state: 0.0 }
    }

    pub(super) fn name(&self) -> &'static str {
        if self.pass == Pass::Low { "lowpass1" } else { "highpass1" }
    }

    pub(super) fn run(&mut self, input: Signal<'_>, cutoff: Signal<'_>, around: Around<'_>, out: &mut [f64]) {
        let gains = &mut around.rooms[0][..out.len()];
        input.fill(out);
        cutoff.map(gains, |hz| {
            let g = gain(hz, around.rate_hz);
            g / (1.0 + g)
        });
        for (sample, &g) in out.iter_mut().zip(&*gains) {
            let step = (*sample - self.state) * g;
            let low = self.state + step;
            self.state = low + step;
            *sample = if self.pass == Pass::Low { low } else { *sample - low };
        }
        settle(&mut self.state);
    }
}

/// 12 dB an octave, with a quality; the band-pass has gain 1 at its middle.
#[derive(Debug)]
pub(in crate::synth::procedure) struct TwoPole {
    pass: Pass,
    state: [f64; 2],
}

impl TwoPole {
    pub(super) fn new(pass: Pass) -> Self {
        Self { pass, state: [0.0; 2] }
    }

    pub(super) fn name(&self) -> &'static str {
        match self.pass {
            Pass::Low => "lowpass",
            Pass::High => "highpass",
            Pass::Band => "bandpass",
        }
    }

    pub(super) fn run(&mut self, [input, cutoff, q]: [Signal<'_>; 3], around: Around<'_>, out: &mut [f64]) {
        let [gains, dampings, _] = around.rooms;
        let (gains, dampings) = (&mut gains[..out.len()], &mut dampings[..out.len()]);
        input.fill(out);
        cutoff.map(gains, |hz| gain(hz, around.rate_hz));
        q.map(dampings, |q| 1.0 / q.max(0.01));
        let [mut first, mut second] = self.state;
        for ((sample, &g), &k) in out.iter_mut().zip(&*gains).zip(&*dampings) {
            let band = (first + g * (*sample - second)) / (1.0 + g * (g + k));
            let low = second + g * band;
            (first, second) = (2.0 * band - first, 2.0 * low - second);
            *sample = match self.pass {
                Pass::Low => low,
                Pass::Band => k * band,
                Pass::High => *sample - k * band - low,
            };
        }
        self.state = [first, second];
        self.state.iter_mut().for_each(settle);
    }
}

/// A blow makes it ring: its answer to a single sample of 1 is a sine of amplitude 1 that dies away by
/// 60 dB in its decay time.
#[derive(Debug, Default)]
pub(in crate::synth::procedure) struct Resonator {
    state: [f64; 2],
}

impl Resonator {
    pub(super) fn run(
        &mut self,
        [input, frequency, decay]: [Signal<'_>; 3],
        around: Around<'_>,
        out: &mut [f64],
    ) {
        let rate_hz = around.rate_hz;
        let [turns, radii, _] = around.rooms;
        let (turns, radii) = (&mut turns[..out.len()], &mut radii[..out.len()]);
        input.fill(out);
        frequency.map(turns, |hz| TAU * (hz / rate_hz).clamp(0.0, 0.5));
        decay.map(radii, |seconds| 0.001_f64.powf(1.0 / (seconds.max(1e-5) * rate_hz)));
        let still = |signal: Signal<'_>| matches!(signal, Signal::Ramp(ramp) if ramp.from == ramp.to);
        let still = still(frequency) && still(decay);
        let step = |turn: f64, radius: f64| {
            let (sine, cosine) = turn.sin_cos();
            (cosine * radius, sine * radius)
        };
        let (mut cosine, mut sine) = step(turns[0], radii[0]);
        let [mut real, mut imaginary] = self.state;
        for (index, sample) in out.iter_mut().enumerate() {
            if !still {
                (cosine, sine) = step(turns[index], radii[index]);
            }
            (real, imaginary) =
                (real * cosine - imaginary * sine + *sample, real * sine + imaginary * cosine);
            *sample = imaginary;
        }
        self.state = [real, imaginary];
        self.state.iter_mut().for_each(settle);
    }
}
