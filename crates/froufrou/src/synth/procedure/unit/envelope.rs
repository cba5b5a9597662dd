//! Shapes in time that a script sets off: envelopes, decays, lines.

use super::{Around, Event, Signal, settle};

/// The factor by which a sample falls, for −60 dB in some seconds.
fn fall(seconds: f64, rate_hz: f64) -> f64 {
    if seconds <= 0.0 { 0.0 } else { 0.001_f64.powf(1.0 / (seconds * rate_hz)) }
}

/// The events that are due at a sample: those at or before it.
fn due(events: &mut &[(f64, Event)], index: usize) -> Option<(f64, Event)> {
    let (&(at, event), rest) = events.split_first()?;
    if at > index as f64 {
        return None;
    }
    *events = rest;
    // How long ago it was, in samples.
    Some((index as f64 - at, event))
}

#[derive(Debug, Clone, Copy, PartialEq, Default)]
enum Phase {
    #[default]
    Released,
    Rising,
    Held,
}

/// Rises evenly, falls towards its sustained level, and falls to nothing when released.
#[derive(Debug, Default)]
pub(in crate::synth::procedure) struct Envelope {
    phase: Phase,
    level: f64,
    value: f64,
}

impl Envelope {
    pub(super) fn run(&mut self, inputs: [Signal<'_>; 4], around: Around<'_>, out: &mut [f64]) {
        // Its times are read once a stretch: they say how a slope goes on, not where it is.
        let [attack, decay, sustain, release] = inputs.map(|input| match input {
            Signal::Ramp(ramp) => ramp.to,
            Signal::Samples(samples) => samples.first().copied().unwrap_or(0.0),
        });
        let mut events = around.events;
        let rise = 1.0 / (attack * around.rate_hz).max(1.0);
        let (to_held, to_nothing) = (fall(decay, around.rate_hz), fall(release, around.rate_hz));
        for (index, sample) in out.iter_mut().enumerate() {
            while let Some((_, event)) = due(&mut events, index) {
                match event {
                    Event::On(level) => (self.phase, self.level) = (Phase::Rising, level),
                    _ => self.phase = Phase::Released,
                }
            }
            *sample = self.value;
            match self.phase {
                Phase::Rising => {
                    let step = self.level * rise;
                    self.value += step;
                    if (self.value - self.level) * step >= 0.0 {
                        (self.value, self.phase) = (self.level, Phase::Held);
                    }
                }
                Phase::Held => {
                    let held = self.level * sustain.clamp(0.0, 1.0);
                    self.value = held + (self.value - held) * to_held;
                }
                Phase::Released => self.value *= to_nothing,
            }
        }
        settle(&mut self.value);
    }
}

/// Jumps up by each blow and dies away.
#[derive(Debug, Default)]
pub(in crate::synth::procedure) struct Decay {
    value: f64,
}

impl Decay {
    pub(super) fn run(&mut self, decay: Signal<'_>, around: Around<'_>, out: &mut [f64]) {
        let falls = &mut around.rooms[0][..out.len()];
        let rate_hz = around.rate_hz;
        decay.map(falls, |seconds| fall(seconds, rate_hz));
        let mut events = around.events;
        for (index, (sample, &fall)) in out.iter_mut().zip(&*falls).enumerate() {
            while let Some((ago, event)) = due(&mut events, index) {
                if let Event::Hit(level, _) = event {
                    self.value += level * fall.powf(ago);
                }
            }
            *sample = self.value;
            self.value *= fall;
        }
        settle(&mut self.value);
    }
}

/// Goes evenly from where it is to where it is sent.
#[derive(Debug)]
pub(in crate::synth::procedure) struct Line {
    value: f64,
    target: f64,
    /// What it gains a sample, and for how many samples more.
    slope: f64,
    left: f64,
}

impl Line {
    pub(super) fn new(value: f64) -> Self {
        Self { value, target: value, slope: 0.0, left: 0.0 }
    }

    pub(super) fn run(&mut self, around: Around<'_>, out: &mut [f64]) {
        let mut events = around.events;
        for (index, sample) in out.iter_mut().enumerate() {
            while let Some((ago, event)) = due(&mut events, index) {
                if let Event::To(target, seconds) = event {
                    let samples = seconds * around.rate_hz;
                    // It set out a part of a sample ago, from where it was then.
                    self.value -= if self.left > 0.0 { self.slope * ago } else { 0.0 };
                    self.target = target;
                    self.slope = (target - self.value) / samples.max(f64::MIN_POSITIVE);
                    self.left = samples;
                    self.advance(ago);
                }
            }
            *sample = self.value;
            self.advance(1.0);
        }
    }

    fn advance(&mut self, samples: f64) {
        if self.left <= samples {
            (self.value, self.left) = (self.target, 0.0);
        } else {
            self.value += self.slope * samples;
            self.left -= samples;
        }
    }
}
