//! Stick–slip friction, after Takala & Hahn (1992): what slides sticks until the force that has built
//! up breaks it loose, again and again: a sawtooth whose rate follows the speed.
//!
//! The coefficient of friction varies at random from one slip to the next, and with it both how far the
//! body goes before it slips and how much force is let go: the length and the height of each tooth. The
//! mean rate is speed / spacing whatever the variation.
//!
//! | control | default | |
//! | --- | --- | --- |
//! | `speed` | 0 | m/s; its sign does not matter |
//! | `force` | 1 | how hard the surfaces press: the sound is proportional to it |
//!
//! | parameter | default | from, to | |
//! | --- | --- | --- | --- |
//! | `spacing` | 0.001 | 1e-6, 10 | metres from one slip to the next |
//! | `variation` | 0.1 | 0, 0.95 | how far teeth differ from the mean, as a part of it, at most |
//!
//! Without variation the sawtooth goes from −`force` to `force`. It is band-limited: each slip is a
//! step through a windowed sinc, so that aliases are below −90 dB; the pass band ends at 0.4 of the
//! sample rate. That filter makes the sound [`HALF`] samples late (0.7 ms at 48 kHz).
//!
//! Slips slower than one in two seconds fade: standing still is silent. Faster than 0.4 of the sample
//! rate they fade too; from half of it there is nothing left to be heard.

use std::sync::OnceLock;

use super::gate::{Gate, control, finite, smooth_step};
use super::instrument::{Control, Generator, Instrument, Parameters, Ramp, Stretch};
use super::kernel::sinc;
use super::sinc::kaiser;
use crate::Result;
use crate::random::Random;

/// Half the length in samples of the band-limited step, and how late the sound is.
pub const HALF: usize = 32;

/// Positions between two samples at which the step is tabulated.
const PHASES: usize = 512;

/// Where the step's pass band ends in the middle of its slope, in cycles a sample: half a transition
/// (by Kaiser's formula, see [`sinc`](super::sinc)) below the Nyquist frequency.
const CUTOFF: f64 = 0.448;

/// Slips a second below which nothing is heard of them.
const SLOWEST_HZ: f64 = 0.5;

/// Slips a sample between which the sound fades.
const FASTEST: [f64; 2] = [0.4, 0.5];

/// A body that sticks and slips.
#[derive(Debug)]
pub struct StickSlip {
    spacing_m: f64,
    variation: f64,
    controls: [Control; 2],
}

impl StickSlip {
    /// A body with these parameters.
    ///
    /// # Errors
    /// A parameter that there is not, or one outside of its range.
    pub fn new(given: &[(String, f64)]) -> Result<Self> {
        let mut parameters = Parameters::new(given);
        let spacing_m = parameters.take("spacing", 1e-3, 1e-6..=10.0)?;
        let variation = parameters.take("variation", 0.1, 0.0..=0.95)?;
        parameters.finish()?;
        let control = |name: &str, default| Control { name: name.to_owned(), default };
        Ok(Self { spacing_m, variation, controls: [control("speed", 0.0), control("force", 1.0)] })
    }
}

impl Instrument for StickSlip {
    fn controls(&self) -> &[Control] {
        &self.controls
    }

    fn ring_s(&self) -> Option<f64> {
        None
    }

    fn generator(&self, rate_hz: f64, random: Random) -> Result<Box<dyn Generator>> {
        let mut sawtooth = Sawtooth {
            spacing_m: self.spacing_m,
            variation: self.variation,
            random,
            slips: 0,
            length: 0.0,
            place: 0.0,
            ring: [0.0; RING],
            frame: 0,
            gate: Gate::new(rate_hz),
        };
        sawtooth.length = sawtooth.tooth(0);
        // In the middle of a tooth, where the force is none.
        sawtooth.place = sawtooth.length / 2.0;
        Ok(Box::new(sawtooth))
    }
}

/// Samples under way: the past and the future that a step reaches.
const RING: usize = (2 * HALF + 2).next_power_of_two();

/// For each phase, what a band-limited step upwards differs by from a step at once, at the samples about
/// it; number HALF is the first after it.
fn residuals() -> &'static [[f64; 2 * HALF]] {
    static TABLE: OnceLock<Vec<[f64; 2 * HALF]>> = OnceLock::new();
    TABLE.get_or_init(|| {
        // The integral of the kernel by Simpson's rule, at every phase of every sample.
        let kernel = |x: f64| 2.0 * CUTOFF * sinc(2.0 * CUTOFF * x) * kaiser(x / HALF as f64);
        let step = 1.0 / PHASES as f64;
        let mut integral = Vec::with_capacity(2 * HALF * PHASES + 1);
        let mut sum = 0.0;
        for n in 0..2 * HALF * PHASES {
            integral.push(sum);
            let x = n as f64 * step - HALF as f64;
            sum += step / 6.0 * (kernel(x) + 4.0 * kernel(x + step / 2.0) + kernel(x + step));
        }
        integral.push(sum);
        let residual = |phase: usize, k: usize| {
            // This far from the beginning of the kernel.
            let at = (k + 1) * PHASES - phase;
            let done = if k >= HALF { 1.0 } else { 0.0 };
            integral[at] / sum - done
        };
        (0..=PHASES).map(|phase| std::array::from_fn(|k| residual(phase, k))).collect()
    })
}

struct Sawtooth {
    spacing_m: f64,
    variation: f64,
    random: Random,
    slips: u64,
    /// Length of the present tooth and the place in it, in mean lengths.
    length: f64,
    place: f64,
    ring: [f64; RING],
    frame: usize,
    gate: Gate,
}

impl Sawtooth {
    fn tooth(&self, index: u64) -> f64 {
        1.0 + self.variation * (2.0 * self.random.uniform(index) - 1.0)
    }

    /// Moves on by a step, from one sample to the next, and adds what the slips on the way give.
    fn advance(&mut self, step: f64) {
        let start = self.place;
        self.place += step;
        let mut gone = 0.0;
        while self.place >= self.length {
            gone += self.length;
            self.slips += 1;
            let next = self.tooth(self.slips);
            // From the top of one tooth to the bottom of the next.
            let drop = self.length + next;
            self.place -= self.length;
            self.length = next;
            let part = ((gone - start) / step).clamp(0.0, 1.0);
            self.slip(part, drop);
        }
    }

    /// Adds the difference of a band-limited step downwards from a step at once. The step lies `part` of
    /// the way from the sample before to the present one.
    fn slip(&mut self, part: f64, drop: f64) {
        let at = part * PHASES as f64;
        let phase = (at as usize).min(PHASES - 1);
        let part = at - phase as f64;
        let table = residuals();
        // The present sample is number HALF of the table.
        let first = self.frame + RING - HALF;
        for (k, (a, b)) in table[phase].iter().zip(&table[phase + 1]).enumerate() {
            self.ring[(first + k) % RING] -= (a + (b - a) * part) * drop;
        }
    }
}

impl Generator for Sawtooth {
    fn generate(&mut self, stretch: &Stretch<'_>, out: &mut [f32]) -> Result<()> {
        let (speed, force) = (control(stretch, 0, 0.0), control(stretch, 1, 1.0));
        if speed == Ramp::still(0.0) && self.gate.is_shut() {
            // Nothing moves: time stands still, so nothing jumps when it goes on.
            out.fill(0.0);
            return Ok(());
        }
        let count = out.len();
        let per_sample = 1.0 / (self.spacing_m * stretch.rate_hz);
        let [fast, too_fast] = FASTEST;
        for (n, out) in out.iter_mut().enumerate() {
            let step = speed.at(n, count) * per_sample;
            self.ring[self.frame % RING] += 2.0 * self.place - self.length;
            // What was HALF samples ago has had all its slips.
            let late = (self.frame + RING - HALF) % RING;
            let sample = std::mem::take(&mut self.ring[late]);
            self.frame = (self.frame + 1) % RING;
            let slow = smooth_step(step * stretch.rate_hz / SLOWEST_HZ);
            let gain = self.gate.next(slow * smooth_step((too_fast - step) / (too_fast - fast)));
            *out = finite(sample * gain * force.at(n, count));
            // The step to the next sample: what the speed is half way there.
            let step = 0.5 * (step + speed.at(n + 1, count) * per_sample);
            if step > 0.0 && step < too_fast {
                self.advance(step);
            }
        }
        Ok(())
    }
}
