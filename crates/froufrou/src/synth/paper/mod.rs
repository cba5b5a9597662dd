//! Paper: friction of a database's spectra, clips that begin as they are told, tears, and the stick–slip at the onset of a slide
//! (Schreck et al. 2016).
//!
//! | control | default | |
//! | --- | --- | --- |
//! | `friction-0`, `friction-1` … | 0 | how loud each spectrum of the database is: a speed in m/s, times a gain |
//! | `tear` | 0 | how fast it tears, in m/s |
//!
//! | parameter | default | from, to | |
//! | --- | --- | --- | --- |
//! | `coherence` | 1 | 0, 1 | 1: magnitudes of spectra add, as in the paper; 0: their powers add, as those of independent noises do |
//! | `slip` | 1 | 0, 100 | how loud stick–slip is in the first tenth of a second of a slide |
//! | `slip-spacing` | 0.0006 | 1e-5, 1 | metres from one slip to the next |
//! | `tearing` | 1 | 0, 1000 | how loud tears are |
//!
//! A `grain` line plays a clip by its number, to its end. All friction of a thread is one inverse FFT, however many spectra it has;
//! a spectrum whose control is 0 costs nothing, and neither does what rests. With all amplitudes g_i A_i(f) the noise has the density
//! √((1 − c) Σ (g_i A_i)² + c (Σ g_i A_i)²), where c is the coherence.
//!
//! A slide begins after [`onset::REST_S`] without friction. Its slips are a sawtooth of [`stick_slip`](super::stick_slip) that is
//! radiated as a small piece of paper does; their rate follows the greatest control, and they fade within [`onset::FADES_S`].

pub mod onset;
mod spectra;
mod tear;

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use self::onset::Onset;
use self::spectra::{RateSpectra, hop_samples};
use self::tear::{Fibres, Tear};
use super::friction::noise::Noise;
use super::gate::control;
use super::grains::{Clips, Player};
use super::instrument::{Control, Generator, Instrument, Parameters, Ramp, Stretch, stretch_samples};
use crate::Result;
use crate::corpus::paper::PaperSound;
use crate::random::Random;

/// From the beginning of one frame of friction to that of the next: 1024 samples at 44.1 kHz.
pub const HOP_S: f64 = 1024.0 / 44_100.0;

/// The greatest gain of a spectrum.
const MOST_GAIN: f64 = 1e6;

/// What tells the random numbers of friction, slips and tears from those of clips.
const FRICTION: u64 = 0x7066;
const SLIPS: u64 = 0x7073;
const FIBRES: u64 = 0x7074;

/// The name of the control of a spectrum of the database.
pub fn friction_control(spectrum: usize) -> String {
    format!("friction-{spectrum}")
}

/// The sound of a paper.
pub struct Paper {
    sound: Arc<PaperSound>,
    coherence: f64,
    slip: f64,
    slip_spacing_m: f64,
    tearing: f64,
    controls: Vec<Control>,
    /// What has been made ready for rates.
    ready: Mutex<Vec<Arc<Ready>>>,
}

/// A paper at a rate.
struct Ready {
    rate_hz: u32,
    spectra: Arc<RateSpectra>,
    clips: Arc<Bank>,
    fibres: Arc<Fibres>,
}

/// Clips at a rate, each made when it is first played.
struct Bank {
    sound: Arc<PaperSound>,
    rate_hz: u32,
    samples: Vec<OnceLock<Vec<f32>>>,
}

impl Clips for Bank {
    fn count(&self) -> usize {
        self.samples.len()
    }

    fn samples(&self, number: usize) -> &[f32] {
        let Some(cell) = self.samples.get(number) else { return &[] };
        // That the rate is one of sound was seen when the bank was made.
        cell.get_or_init(|| self.sound.clip_samples(number, self.rate_hz).unwrap_or_default())
    }

    fn phase(&self, _: usize) -> f64 {
        0.0
    }
}

impl std::fmt::Debug for Paper {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Paper").field("name", &self.sound.name()).finish_non_exhaustive()
    }
}

impl Paper {
    /// A paper with these parameters.
    ///
    /// # Errors
    /// A parameter that there is not, or one outside of its range.
    pub fn new(sound: Arc<PaperSound>, given: &[(String, f64)]) -> Result<Self> {
        let mut parameters = Parameters::new(given);
        let coherence = parameters.take("coherence", 1.0, 0.0..=1.0)?;
        let slip = parameters.take("slip", 1.0, 0.0..=100.0)?;
        let slip_spacing_m = parameters.take("slip-spacing", 6e-4, 1e-5..=1.0)?;
        let tearing = parameters.take("tearing", 1.0, 0.0..=1000.0)?;
        parameters.finish()?;
        let names = (0..sound.spectra().len()).map(friction_control).chain(["tear".to_owned()]);
        let controls = names.map(|name| Control { name, default: 0.0 }).collect();
        Ok(Self { sound, coherence, slip, slip_spacing_m, tearing, controls, ready: Mutex::default() })
    }

    fn ready(&self, rate_hz: f64) -> Result<Arc<Ready>> {
        let whole_hz = rate_hz.round() as u32;
        let mut all = self.ready.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(ready) = all.iter().find(|ready| ready.rate_hz == whole_hz) {
            return Ok(ready.clone());
        }
        // Refuses a rate that is not one of sound.
        self.sound.clip_samples(usize::MAX, whole_hz)?;
        let samples = (0..self.sound.clips().len()).map(|_| OnceLock::new()).collect();
        let ready = Arc::new(Ready {
            rate_hz: whole_hz,
            spectra: Arc::new(RateSpectra::new(&self.sound, rate_hz, self.coherence)),
            clips: Arc::new(Bank { sound: self.sound.clone(), rate_hz: whole_hz, samples }),
            fibres: Arc::new(Fibres::new(self.sound.paper(), rate_hz)),
        });
        all.push(ready.clone());
        Ok(ready)
    }
}

impl Instrument for Paper {
    fn controls(&self) -> &[Control] {
        &self.controls
    }

    fn ring_s(&self) -> Option<f64> {
        None
    }

    fn paper(&self) -> Option<Arc<PaperSound>> {
        Some(self.sound.clone())
    }

    fn clips(&self) -> usize {
        self.sound.clips().len()
    }

    fn ahead_s(&self) -> f64 {
        HOP_S
    }

    fn generator(&self, rate_hz: f64, random: Random) -> Result<Box<dyn Generator>> {
        let ready = self.ready(rate_hz)?;
        let own = |what: u64| Random::new(random.bits(what), what);
        let behind = (HOP_S * rate_hz / stretch_samples(rate_hz) as f64).round() as usize;
        Ok(Box::new(Playing {
            noise: Noise::new(hop_samples(rate_hz), own(FRICTION)),
            amplitudes: Vec::new(),
            squares: Vec::new(),
            gains: vec![0.0; self.sound.spectra().len()],
            onset: Onset::new(self.slip, self.slip_spacing_m, rate_hz, own(SLIPS))?,
            tear: Tear::new(ready.fibres.clone(), own(FIBRES)),
            tearing: self.tearing,
            clips: Player::new(ready.clips.clone(), random),
            told: VecDeque::with_capacity(behind + 1),
            behind,
            ready,
        }))
    }
}

/// What a stretch says of slips and tears.
#[derive(Debug, Clone, Copy)]
struct Told {
    /// The greatest control of friction, in m/s.
    speed: Ramp,
    /// The root mean square of friction, as magnitudes add.
    level: Ramp,
    tear: Ramp,
}

/// A thread of paper.
struct Playing {
    ready: Arc<Ready>,
    noise: Noise,
    amplitudes: Vec<f32>,
    squares: Vec<f32>,
    gains: Vec<f64>,
    onset: Onset,
    tear: Tear,
    tearing: f64,
    clips: Player,
    /// Friction is told its controls ahead, slips and tears are not: they wait so many stretches.
    told: VecDeque<Told>,
    behind: usize,
}

impl Generator for Playing {
    fn generate(&mut self, stretch: &Stretch<'_>, out: &mut [f32]) -> Result<()> {
        self.clips.generate(stretch, out)?;
        self.rub(stretch, out);
        let told = self.told(stretch);
        while self.told.len() <= self.behind {
            // What was before the thread is as it begins.
            self.told.push_back(told);
        }
        self.told.push_back(told);
        if let Some(now) = self.told.pop_front() {
            self.onset.add(now.speed, now.level, stretch, out)?;
            self.tear.add(now.tear, self.tearing, stretch.rate_hz, out);
        }
        Ok(())
    }
}

impl Playing {
    /// Adds friction.
    fn rub(&mut self, stretch: &Stretch<'_>, out: &mut [f32]) {
        let (hop, count) = (self.noise.hop(), out.len());
        let mut index = 0;
        while index < count {
            let number = stretch.first + index as u64;
            let within = (number % hop as u64) as usize;
            if within == 0 {
                for (spectrum, gain) in self.gains.iter_mut().enumerate() {
                    *gain = control(stretch, spectrum, 0.0).at(index, count).min(MOST_GAIN);
                }
                self.ready.spectra.mix(&self.gains, &mut self.squares, &mut self.amplitudes);
                self.noise.begin(number / hop as u64, &self.amplitudes);
            }
            let length = (hop - within).min(count - index);
            if !self.noise.rests() {
                let samples = &self.noise.samples()[within..within + length];
                out[index..index + length].iter_mut().zip(samples).for_each(|(out, sample)| *out += sample);
            }
            index += length;
        }
    }

    fn told(&self, stretch: &Stretch<'_>) -> Told {
        let still = Ramp::still(0.0);
        let (mut speed, mut level) = (still, still);
        for (spectrum, wholes) in self.ready.spectra.levels().iter().enumerate() {
            let gain = control(stretch, spectrum, 0.0);
            if gain == still {
                continue;
            }
            let [from, to] = [gain.from, gain.to].map(|gain| gain.min(MOST_GAIN));
            speed = Ramp { from: speed.from.max(from), to: speed.to.max(to) };
            level = Ramp { from: level.from + from * wholes, to: level.to + to * wholes };
        }
        Told { speed, level, tear: control(stretch, self.gains.len(), 0.0) }
    }
}

#[cfg(test)]
mod tests;
