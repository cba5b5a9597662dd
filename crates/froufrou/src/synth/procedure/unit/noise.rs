//! Noise: white, with as much in every hertz, and pink, with as much in every octave.

use std::f64::consts::PI;

use crate::random::Random;

/// Evenly spread from −1 to 1. Each sample is a function of its number.
pub(super) fn white(random: Random, first: u64, out: &mut [f64]) {
    for (index, sample) in (first..).zip(out) {
        *sample = random.uniform(index) * 2.0 - 1.0;
    }
}

/// Where the fall by 3 dB an octave begins, in hertz.
const FROM_HZ: f64 = 10.0;

/// White noise through a chain of poles and zeros an octave apart, which falls by 10 dB a decade from
/// 10 Hz on: within 0.1 dB for most of the way, within 1.5 dB up to 0.45 of the sample rate. It is as
/// strong in all as white noise is.
#[derive(Debug)]
pub(in crate::synth::procedure) struct Pink {
    random: Random,
    gain: f64,
    sections: Vec<Section>,
}

#[derive(Debug)]
struct Section {
    pole: f64,
    zero: f64,
    before: [f64; 2],
}

impl Pink {
    pub(super) fn new(random: Random, rate_hz: f64) -> Self {
        // The bilinear transform. What it squeezes together near half the rate makes up for the zeros that
        // would lie beyond.
        let corner = |hz: f64| {
            let g = PI * hz / rate_hz;
            (1.0 - g) / (1.0 + g)
        };
        let sections: Vec<Section> = (0..)
            .map(|double_octaves| FROM_HZ * 4.0_f64.powi(double_octaves))
            .take_while(|pole_hz| *pole_hz < 0.45 * rate_hz)
            .map(|pole_hz| Section {
                pole: corner(pole_hz),
                zero: corner((2.0 * pole_hz).min(0.49 * rate_hz)),
                before: [0.0; 2],
            })
            .collect();
        // The power that the chain lets through, by the midpoint rule over the logarithm of frequency.
        let (steps, lowest) = (4000, 1e-6_f64);
        let power: f64 = (0..steps)
            .map(|step| {
                let nyquists = lowest.powf(1.0 - (f64::from(step) + 0.5) / f64::from(steps));
                let cosine = (nyquists * PI).cos();
                let part = |c: f64| 1.0 + c * c - 2.0 * c * cosine;
                let through: f64 = sections.iter().map(|s| part(s.zero) / part(s.pole)).product();
                through * nyquists * -lowest.ln() / f64::from(steps)
            })
            .sum();
        Self { random, gain: power.sqrt().recip(), sections }
    }

    pub(super) fn run(&mut self, first: u64, out: &mut [f64]) {
        white(self.random, first, out);
        for section in &mut self.sections {
            let [mut input, mut output] = section.before;
            for sample in out.iter_mut() {
                let next = *sample - section.zero * input + section.pole * output;
                (input, output) = (*sample, next);
                *sample = next;
            }
            section.before = [input, output];
        }
        out.iter_mut().for_each(|sample| *sample *= self.gain);
    }
}
