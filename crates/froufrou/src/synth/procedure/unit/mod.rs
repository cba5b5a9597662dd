//! The unit generators that a script plugs together: each makes a stretch of samples from its inputs.

mod envelope;
mod filter;
mod noise;
mod oscillator;
mod pulse;
mod time;

use std::sync::Arc;

use super::wave::Wave;
use crate::random::Random;
use crate::synth::instrument::Ramp;

/// Most inputs of a unit.
pub(super) const INPUTS: usize = 4;

/// What drives an input over a stretch.
#[derive(Debug, Clone, Copy)]
pub(super) enum Signal<'a> {
    /// A number that changes evenly.
    Ramp(Ramp),
    /// The samples of another unit.
    Samples(&'a [f64]),
}

impl Signal<'_> {
    /// Writes each sample's value into `out`, put through a function. Of a ramp only the ends go through
    /// it, and between them it stays a ramp.
    fn map(self, out: &mut [f64], through: impl Fn(f64) -> f64) {
        match self {
            Signal::Ramp(Ramp { from, to }) => {
                let ramp = if from == to {
                    Ramp::still(through(from))
                } else {
                    Ramp { from: through(from), to: through(to) }
                };
                fill(ramp, out);
            }
            Signal::Samples(samples) => {
                out.iter_mut().zip(samples).for_each(|(out, &value)| *out = through(value));
            }
        }
    }

    fn fill(self, out: &mut [f64]) {
        match self {
            Signal::Ramp(ramp) => fill(ramp, out),
            Signal::Samples(samples) => out.copy_from_slice(&samples[..out.len()]),
        }
    }
}

fn fill(ramp: Ramp, out: &mut [f64]) {
    let step = (ramp.to - ramp.from) / out.len() as f64;
    out.iter_mut().enumerate().for_each(|(index, out)| *out = ramp.from + step * index as f64);
}

/// Something that happens to a unit at a moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Event {
    /// An envelope opens to a level.
    On(f64),
    /// An envelope closes.
    Off,
    /// A blow: how hard, and for how many seconds the striker touches.
    Hit(f64, f64),
    /// A line heads for a value, to be there after some seconds.
    To(f64, f64),
}

/// What is around a unit while it makes a stretch.
pub(super) struct Around<'a> {
    /// Number of the first sample.
    pub first: u64,
    pub rate_hz: f64,
    /// What happens to the unit in this stretch: at which of its samples, which need not be whole.
    pub events: &'a [(f64, Event)],
    /// The controls of the stretch.
    pub controls: &'a [Ramp],
    /// What `fn sample` gave.
    pub sampled: &'a [f64],
    /// Room for what is worked out from the inputs, each as long as the stretch.
    pub rooms: &'a mut [Vec<f64>; 3],
}

/// A unit's kind, and what it remembers from stretch to stretch.
#[derive(Debug)]
pub(super) enum Kind {
    Oscillator(oscillator::Oscillator),
    White(Random),
    Pink(noise::Pink),
    OnePole(filter::OnePole),
    TwoPole(filter::TwoPole),
    Resonator(filter::Resonator),
    Envelope(envelope::Envelope),
    Decay(envelope::Decay),
    Line(envelope::Line),
    Pulse(pulse::Pulse),
    Delay(time::Delay),
    Value,
    Follow(usize),
    Sampled,
    Sum,
    Difference,
    Product,
    Tanh,
    Abs,
}

pub(super) use filter::Pass;

impl Kind {
    pub(super) fn oscillator(name: &'static str, wave: Arc<Wave>, random: Random) -> Self {
        Kind::Oscillator(oscillator::Oscillator::new(name, wave, random))
    }

    pub(super) fn pink(random: Random, rate_hz: f64) -> Self {
        Kind::Pink(noise::Pink::new(random, rate_hz))
    }

    pub(super) fn one_pole(pass: Pass) -> Self {
        Kind::OnePole(filter::OnePole::new(pass))
    }

    pub(super) fn two_pole(pass: Pass) -> Self {
        Kind::TwoPole(filter::TwoPole::new(pass))
    }

    pub(super) fn resonator() -> Self {
        Kind::Resonator(filter::Resonator::default())
    }

    pub(super) fn envelope() -> Self {
        Kind::Envelope(envelope::Envelope::default())
    }

    pub(super) fn decay() -> Self {
        Kind::Decay(envelope::Decay::default())
    }

    pub(super) fn line(value: f64) -> Self {
        Kind::Line(envelope::Line::new(value))
    }

    pub(super) fn pulse() -> Self {
        Kind::Pulse(pulse::Pulse::default())
    }

    pub(super) fn delay(longest_samples: f64) -> Self {
        Kind::Delay(time::Delay::new(longest_samples))
    }

    /// What it is called in messages.
    pub(super) fn name(&self) -> &'static str {
        match self {
            Kind::Oscillator(oscillator) => oscillator.name(),
            Kind::White(_) => "white",
            Kind::Pink(_) => "pink",
            Kind::OnePole(filter) => filter.name(),
            Kind::TwoPole(filter) => filter.name(),
            Kind::Resonator(_) => "resonator",
            Kind::Envelope(_) => "envelope",
            Kind::Decay(_) => "decay",
            Kind::Line(_) => "line",
            Kind::Pulse(_) => "pulse",
            Kind::Delay(_) => "delay",
            Kind::Value => "value",
            Kind::Follow(_) => "follow",
            Kind::Sampled => "sampled",
            Kind::Sum => "sum",
            Kind::Difference => "difference",
            Kind::Product => "product",
            Kind::Tanh => "tanh",
            Kind::Abs => "abs",
        }
    }

    /// The names of its inputs, in order, and what numbers they may be.
    pub(super) fn inputs(&self) -> &'static [(&'static str, f64, f64)] {
        const HZ: f64 = 1e6;
        const ANY: f64 = 1e9;
        match self {
            Kind::Oscillator(_) => &[("frequency", -HZ, HZ), ("jitter", 0.0, 0.5)],
            Kind::OnePole(_) => &[("input", -ANY, ANY), ("cutoff", 0.0, HZ)],
            Kind::TwoPole(_) => &[("input", -ANY, ANY), ("cutoff", 0.0, HZ), ("q", 0.01, 1e4)],
            Kind::Resonator(_) => &[("input", -ANY, ANY), ("frequency", 0.0, HZ), ("decay", 1e-5, 1e3)],
            Kind::Envelope(_) => {
                &[("attack", 0.0, 1e3), ("decay", 0.0, 1e3), ("sustain", 0.0, 1.0), ("release", 0.0, 1e3)]
            }
            Kind::Decay(_) => &[("decay", 1e-5, 1e3)],
            Kind::Delay(_) => &[("input", -ANY, ANY), ("seconds", 0.0, 1e3), ("feedback", -1.0, 1.0)],
            Kind::Value => &[("value", -ANY, ANY)],
            Kind::Sum | Kind::Difference | Kind::Product => &[("a", -ANY, ANY), ("b", -ANY, ANY)],
            Kind::Tanh | Kind::Abs => &[("input", -ANY, ANY)],
            Kind::White(_)
            | Kind::Pink(_)
            | Kind::Line(_)
            | Kind::Pulse(_)
            | Kind::Follow(_)
            | Kind::Sampled => &[],
        }
    }

    /// Does it know what to do with such an event?
    pub(super) fn takes(&self, event: Event) -> bool {
        match event {
            Event::On(_) | Event::Off => matches!(self, Kind::Envelope(_)),
            Event::Hit(..) => matches!(self, Kind::Decay(_) | Kind::Pulse(_)),
            Event::To(..) => matches!(self, Kind::Line(_)),
        }
    }

    /// Makes a stretch.
    pub(super) fn run(&mut self, inputs: [Signal<'_>; INPUTS], around: Around<'_>, out: &mut [f64]) {
        let [a, b, c, d] = inputs;
        match self {
            Kind::Oscillator(oscillator) => oscillator.run(a, b, around, out),
            Kind::White(random) => noise::white(*random, around.first, out),
            Kind::Pink(pink) => pink.run(around.first, out),
            Kind::OnePole(filter) => filter.run(a, b, around, out),
            Kind::TwoPole(filter) => filter.run([a, b, c], around, out),
            Kind::Resonator(resonator) => resonator.run([a, b, c], around, out),
            Kind::Envelope(envelope) => envelope.run([a, b, c, d], around, out),
            Kind::Decay(decay) => decay.run(a, around, out),
            Kind::Line(line) => line.run(around, out),
            Kind::Pulse(pulse) => pulse.run(around, out),
            Kind::Delay(delay) => delay.run([a, b, c], around, out),
            Kind::Value => a.fill(out),
            Kind::Follow(index) => {
                fill(around.controls.get(*index).copied().unwrap_or(Ramp::still(0.0)), out);
            }
            Kind::Sampled => out.copy_from_slice(&around.sampled[..out.len()]),
            Kind::Sum => both(a, b, around, out, |a, b| a + b),
            Kind::Difference => both(a, b, around, out, |a, b| a - b),
            Kind::Product => both(a, b, around, out, |a, b| a * b),
            Kind::Tanh => each(a, out, f64::tanh),
            Kind::Abs => each(a, out, f64::abs),
        }
    }
}

fn each(input: Signal<'_>, out: &mut [f64], through: impl Fn(f64) -> f64) {
    input.fill(out);
    out.iter_mut().for_each(|value| *value = through(*value));
}

fn both(a: Signal<'_>, b: Signal<'_>, around: Around<'_>, out: &mut [f64], with: impl Fn(f64, f64) -> f64) {
    let room = &mut around.rooms[0][..out.len()];
    a.fill(out);
    b.fill(room);
    out.iter_mut().zip(room).for_each(|(out, other)| *out = with(*out, *other));
}

/// Makes what is too quiet to be heard, and slow to reckon with, nothing.
fn settle(state: &mut f64) {
    if state.abs() < 1e-30 {
        *state = 0.0;
    }
}
