//! Cloths that sound with no recordings: models of yarns that rub and of patches that buckle. They are **synthetic**: no cloth
//! was measured for them, and `docs/cloth.md` says what each number assumes.
//!
//! **Friction.** Yarns of a spacing d pass an edge s/d times a second. Each passing is a burst of fibres that catch and let go,
//! as long as it takes to move a length ℓ, so the power spectrum is that of bursts that decay exponentially,
//! 1 / (1 + (2π f ℓ/s)²), times what of it is regular: humps at k·s/d that are the broader the less even the weave is. The cloth
//! radiates as a thin sheet, hardly below a corner, and its nap dulls the highest frequencies. Amplitudes grow as
//! s to the power of `growth`.
//!
//! **Pops.** A patch that buckles rings in some damped modes. A larger one rings lower: f ∝ E^−pitch. Energies follow the power
//! law of crumpled sheets, P(E) ∝ E^−slope, between two bounds.

use std::f64::consts::TAU;

use rayon::prelude::*;

use super::pops::centre_s;
use super::spectra::{FrictionSpectra, SPACING_HZ, Spectrum};
use super::{ClothSound, Friction, PopEntry, PopSource};
use crate::error::{Error, Result};
use crate::random::Random;

/// What names of models begin with.
pub const PREFIX: &str = "synthetic/";

/// The highest frequency of a model's friction.
const TOP_HZ: f64 = 40_000.0;

/// The slowest speed for which a spectrum is made, in m/s.
const SLOWEST_MPS: f64 = 0.025;

/// How many speeds there are to an octave, and in all: up to 6.4 m/s. Fewer would blur the humps between them.
const AN_OCTAVE: usize = 4;
const SPEEDS: usize = 8 * AN_OCTAVE + 1;

/// The speed at which levels are said.
const REFERENCE_MPS: f64 = 0.2;

/// How many pops a cloth has.
const POPS: usize = 96;

/// How much cloth the levels are those of.
const AREA_M2: f64 = 0.01;

/// Modes of one pop.
const MODES: u64 = 7;

/// The seed of all that is random in models: they always sound the same.
const SEED: u64 = 0x00c1_07e5;

/// What a model's friction is made of.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Yarns {
    /// From yarn to yarn, or from ridge to ridge.
    spacing_m: f64,
    /// How long fibres catch, as a way.
    catch_m: f64,
    /// The power of the first hump above what is between them.
    regularity: f64,
    /// By what power of their number humps fall.
    falls: f64,
    /// Their width as a part of the rate of yarns, as a standard deviation.
    unevenness: f64,
    /// Below this the sheet hardly radiates.
    sheet_hz: f64,
    /// Above this the nap dulls it.
    nap_hz: f64,
    /// The root mean square at 0.2 m/s, in full scale.
    level: f64,
    /// The power of speed by which amplitudes grow.
    growth: f64,
}

/// What a model's pops are made of.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Buckles {
    /// Bounds of energy, in squares of full scale times seconds.
    energies: [f64; 2],
    /// Of the power law of energies.
    slope: f64,
    /// The lowest mode of a pop of the least energy.
    highest_hz: f64,
    /// By what power of energy it falls.
    pitch: f64,
    /// Cycles until a mode has fallen to 1/e.
    cycles: f64,
    /// How much of its energy is a crackle of its edge, from 0 to 1.
    crackle: f64,
}

/// A cloth of this project's own making.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cloth {
    name: &'static str,
    yarns: Yarns,
    buckles: Option<Buckles>,
}

/// All models.
const CLOTHS: [Cloth; 4] = [
    Cloth {
        name: "cotton",
        yarns: Yarns {
            spacing_m: 0.4e-3,
            catch_m: 16e-6,
            regularity: 1.5,
            falls: 1.5,
            unevenness: 0.35,
            sheet_hz: 350.0,
            nap_hz: 9_000.0,
            level: 0.004,
            growth: 0.9,
        },
        buckles: Some(Buckles {
            energies: [2e-8, 1e-5],
            slope: 1.5,
            highest_hz: 2_200.0,
            pitch: 0.18,
            cycles: 1.5,
            crackle: 0.15,
        }),
    },
    Cloth {
        name: "polyester",
        yarns: Yarns {
            spacing_m: 0.3e-3,
            catch_m: 10e-6,
            regularity: 1.2,
            falls: 1.3,
            unevenness: 0.25,
            sheet_hz: 450.0,
            nap_hz: 13_000.0,
            level: 0.005,
            growth: 0.9,
        },
        buckles: Some(Buckles {
            energies: [2e-8, 3e-5],
            slope: 1.45,
            highest_hz: 3_200.0,
            pitch: 0.17,
            cycles: 2.5,
            crackle: 0.25,
        }),
    },
    Cloth {
        name: "windbreaker",
        yarns: Yarns {
            spacing_m: 0.2e-3,
            catch_m: 5e-6,
            regularity: 0.8,
            falls: 1.2,
            unevenness: 0.2,
            sheet_hz: 700.0,
            nap_hz: 20_000.0,
            level: 0.012,
            growth: 1.0,
        },
        buckles: Some(Buckles {
            energies: [3e-8, 2e-4],
            slope: 1.35,
            highest_hz: 5_000.0,
            pitch: 0.16,
            cycles: 4.0,
            crackle: 0.4,
        }),
    },
    Cloth {
        name: "corduroy",
        yarns: Yarns {
            // 3.5 wales a centimetre.
            spacing_m: 2.86e-3,
            catch_m: 24e-6,
            regularity: 12.0,
            falls: 0.9,
            unevenness: 0.12,
            sheet_hz: 180.0,
            nap_hz: 7_000.0,
            level: 0.010,
            growth: 1.0,
        },
        buckles: None,
    },
];

impl Yarns {
    /// The power density at a frequency and a speed, without a level.
    fn shape(&self, f: f64, speed_mps: f64) -> f64 {
        let rate_hz = speed_mps / self.spacing_m;
        let burst = 1.0 / (1.0 + (TAU * f * self.catch_m / speed_mps).powi(2));
        // Humps merge where they are wider than apart; those that count are near.
        let nearest = (f / rate_hz).round();
        let near = (-3..=3).map(|k| nearest + f64::from(k)).filter(|k| *k >= 1.0);
        let humps: f64 = near
            .map(|k| {
                // The unevenness of single yarns adds up along the weave, so that higher humps are wider.
                let width = self.unevenness * rate_hz * k.sqrt();
                let off = (f - k * rate_hz) / width;
                k.powf(-self.falls) * (-0.5 * off * off).exp()
            })
            .sum();
        let sheet = { (f / self.sheet_hz).powi(4) / (1.0 + (f / self.sheet_hz).powi(4)) };
        let nap = 1.0 / (1.0 + (f / self.nap_hz).powi(4));
        sheet * nap * burst * (1.0 + self.regularity * humps)
    }

    fn density(&self, speed_mps: f64) -> Vec<f64> {
        let values = (TOP_HZ / SPACING_HZ) as u32;
        // Each value is that of its band, so that humps narrower than it are not missed.
        let band = |k: u32, speed: f64| {
            let parts = (0..4).map(|part| f64::from(k) - 0.375 + 0.25 * f64::from(part));
            parts.map(|place| self.shape(place * SPACING_HZ, speed)).sum::<f64>() / 4.0
        };
        let power: Vec<f64> = (1..=values).map(|k| band(k, speed_mps)).collect();
        let whole = power.iter().sum::<f64>() * SPACING_HZ;
        let level = self.level * (speed_mps / REFERENCE_MPS).powf(self.growth);
        power.iter().map(|p| level * (p / whole).sqrt()).collect()
    }
}

impl Buckles {
    /// The energy of a pop: evenly spread over its distribution.
    fn energy(&self, number: usize) -> f64 {
        let share = (number as f64 + 0.5) / POPS as f64;
        let [least, greatest] = self.energies.map(|e| e.powf(1.0 - self.slope));
        (least + (greatest - least) * share).powf(1.0 / (1.0 - self.slope))
    }

    /// The samples of a pop at a rate.
    fn samples(&self, number: usize, random: Random, rate_hz: f64) -> Vec<f32> {
        let energy = self.energy(number);
        let lowest_hz = self.highest_hz * (energy / self.energies[0]).powf(-self.pitch);
        let uniform = |index: u64| random.uniform(64 * number as u64 + index);
        // Until the lowest mode has fallen by 60 dB, and a rise of half its first cycle.
        let length_s = 7.0 * self.cycles / lowest_hz;
        let rise_s = (0.25 / lowest_hz).min(4e-4);
        let mut out = vec![0.0f64; (length_s * rate_hz).ceil() as usize];
        for mode in 0..MODES {
            let detune = 0.8 + 0.4 * uniform(4 * mode);
            let hz = lowest_hz * (1.0 + 0.83 * mode as f64) * detune;
            let amplitude = (0.5 + uniform(4 * mode + 1)) / (1.0 + 0.5 * mode as f64);
            let phase = TAU * uniform(4 * mode + 2);
            if hz > 0.45 * rate_hz {
                continue;
            }
            let decay = hz.sqrt() * lowest_hz.sqrt() / self.cycles;
            for (n, out) in out.iter_mut().enumerate() {
                let t = n as f64 / rate_hz;
                *out += amplitude * (TAU * hz * t + phase).sin() * (-decay * t).exp();
            }
        }
        // The crackle: tones of random frequencies that die within a millisecond, the same at every rate.
        let ringing: f64 = out.iter().map(|v| v * v).sum::<f64>() / rate_hz;
        let mut crackle = vec![0.0f64; out.len()];
        let noises = Random::new(SEED ^ 0xff, number as u64);
        for tone in 0..48 {
            let hz = 1_500.0 * 10.0f64.powf(noises.uniform(2 * tone));
            let phase = TAU * noises.uniform(2 * tone + 1);
            if hz > 0.45 * rate_hz {
                continue;
            }
            for (n, out) in crackle.iter_mut().enumerate().take((0.006 * rate_hz) as usize) {
                let t = n as f64 / rate_hz;
                *out += (TAU * hz * t + phase).sin() * (-1200.0 * t).exp();
            }
        }
        let crackling: f64 = crackle.iter().map(|v| v * v).sum::<f64>() / rate_hz;
        let part = if crackling > 0.0 { (self.crackle * ringing / crackling).sqrt() } else { 0.0 };
        let count = out.len() as f64;
        for (n, (out, crackle)) in out.iter_mut().zip(&crackle).enumerate() {
            // From and to silence without a step.
            let rise = (n as f64 / (rise_s * rate_hz)).min(1.0);
            let fall = ((count - n as f64) / (0.1 * count)).min(1.0);
            let smooth = |x: f64| x * x * (3.0 - 2.0 * x);
            *out = (*out + part * crackle) * smooth(rise) * smooth(fall);
        }
        let whole = out.iter().map(|v| v * v).sum::<f64>() / rate_hz;
        let gain = if whole > 0.0 { (energy / whole).sqrt() } else { 0.0 };
        out.iter().map(|v| (v * gain) as f32).collect()
    }
}

impl Cloth {
    /// The model of a name that begins with `synthetic/`; nothing for other names.
    pub fn named(name: &str) -> Option<Result<Self>> {
        let wanted = name.strip_prefix(PREFIX)?;
        let found = CLOTHS.into_iter().find(|cloth| cloth.name == wanted);
        Some(found.ok_or_else(|| {
            let names: Vec<String> = Self::names().collect();
            Error::new(format!("there is no synthetic cloth `{wanted}`"))
                .help(format!("there are {}", names.join(", ")))
        }))
    }

    /// The names of all models.
    pub fn names() -> impl Iterator<Item = String> {
        CLOTHS.iter().map(|cloth| format!("{PREFIX}{}", cloth.name))
    }

    /// What it sounds like.
    pub fn sound(self) -> ClothSound {
        let spectrum = |number: usize| {
            let speed_mps = SLOWEST_MPS * 2.0f64.powf(number as f64 / AN_OCTAVE as f64);
            Spectrum { speed_mps, density: self.yarns.density(speed_mps) }
        };
        let spectra: Vec<Spectrum> = (0..SPEEDS).into_par_iter().map(spectrum).collect();
        let spectra = FrictionSpectra::new(SPACING_HZ, spectra);
        let from = format!("{PREFIX}{}", self.name);
        // What is told of a pop does not depend on a rate but for rounding.
        let rate_hz = 96_000.0;
        let entry = |samples: &Vec<f32>| PopEntry {
            from: from.clone(),
            begin_s: 0.0,
            length_s: samples.len() as f64 / rate_hz,
            energy: samples.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / rate_hz,
            lead_s: centre_s(samples, rate_hz),
        };
        ClothSound {
            // The spectra of models are what spectra have to be.
            friction: spectra.ok().map(|spectra| Friction { spectra, area_m2: AREA_M2 }),
            pops: self.pops(rate_hz).iter().map(entry).collect(),
            source: PopSource::Synthetic(self),
            name: from.clone(),
        }
    }

    /// The samples of its pops, from faint to loud.
    pub(super) fn pops(&self, rate_hz: f64) -> Vec<Vec<f32>> {
        let Some(buckles) = self.buckles else { return Vec::new() };
        let thread =
            self.name.bytes().fold(0, |sum: u64, byte| sum.wrapping_mul(31).wrapping_add(u64::from(byte)));
        let random = Random::new(SEED, thread);
        (0..POPS).map(|number| buckles.samples(number, random, rate_hz)).collect()
    }
}

#[cfg(test)]
mod tests;
