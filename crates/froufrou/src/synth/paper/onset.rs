//! The stick–slip that is heard while paper begins to slide, and no longer when it slides smoothly. Schreck et al. (2016) name it
//! as what their spectra lack.

use crate::Result;
use crate::random::Random;
use crate::synth::instrument::{Generator, Instrument, Ramp, Stretch};
use crate::synth::stick_slip::StickSlip;

/// What slid before has come to rest after so many seconds without friction.
pub const REST_S: f64 = 0.05;

/// How long slips are heard, fading.
pub const FADES_S: f64 = 0.12;

/// How far lengths of slips differ.
const VARIATION: f64 = 0.4;

/// Below this a small piece of paper radiates little, so that of each slip a click is heard.
const CORNER_HZ: f64 = 1_500.0;

/// The force of slips against the level of friction. Clicks are short, so they are higher than the noise is.
const FORCE: f64 = 4.0;

/// The slips of a thread.
pub struct Onset {
    slips: Box<dyn Generator>,
    slip: f64,
    /// How long nothing has slid, and for how long something has.
    rested_s: f64,
    slid_s: f64,
    /// Of the high-pass: its part, the input that it follows.
    part: f32,
    low: f32,
    /// Samples that are still to be made after slips have faded, until the gate of the sawtooth is shut.
    is_running: bool,
    scratch: Vec<f32>,
}

impl Onset {
    /// At rest. All that is random in it comes from `random`.
    pub fn new(slip: f64, spacing_m: f64, rate_hz: f64, random: Random) -> Result<Self> {
        let given = [("spacing".to_owned(), spacing_m), ("variation".to_owned(), VARIATION)];
        Ok(Self {
            slips: StickSlip::new(&given)?.generator(rate_hz, random)?,
            slip,
            rested_s: f64::INFINITY,
            slid_s: f64::INFINITY,
            part: (1.0 - (-std::f64::consts::TAU * CORNER_HZ / rate_hz).exp()) as f32,
            low: 0.0,
            is_running: false,
            scratch: Vec::new(),
        })
    }

    /// Adds the stretch that follows the one before: friction of a speed and a level.
    pub fn add(&mut self, speed: Ramp, level: Ramp, stretch: &Stretch<'_>, out: &mut [f32]) -> Result<()> {
        let length_s = out.len() as f64 / stretch.rate_hz;
        if speed == Ramp::still(0.0) {
            self.rested_s += length_s;
        } else {
            if self.rested_s >= REST_S {
                self.slid_s = 0.0;
            }
            self.rested_s = 0.0;
        }
        let fades = |s: f64| (1.0 - (s / FADES_S).min(1.0)).powi(2);
        let heard = [fades(self.slid_s), fades(self.slid_s + length_s)].map(|part| part * FORCE * self.slip);
        self.slid_s += length_s;
        let force = Ramp { from: level.from * heard[0], to: level.to * heard[1] };
        let is_heard = force.from.max(force.to) > 0.0;
        if !is_heard && !self.is_running {
            return Ok(());
        }
        let controls = if is_heard { [speed, force] } else { [Ramp::still(0.0); 2] };
        self.scratch.resize(out.len(), 0.0);
        let told = Stretch { controls: &controls, strikes: &[], grains: &[], ..*stretch };
        self.slips.generate(&told, &mut self.scratch)?;
        for (out, sample) in out.iter_mut().zip(&self.scratch) {
            self.low += self.part * (sample - self.low);
            *out += sample - self.low;
        }
        if !is_heard && self.low.abs() < 1e-9 && self.scratch.iter().all(|sample| *sample == 0.0) {
            self.low = 0.0;
        }
        self.is_running = is_heard || self.low != 0.0;
        Ok(())
    }
}
