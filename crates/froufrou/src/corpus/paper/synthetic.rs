//! Papers that sound with no recordings: a [plate](super::plate) whose modes follow (l_r, l_c). They are **synthetic**: no paper
//! was recorded for them, and `docs/paper-sounds.md` says what each number assumes.
//!
//! **Friction.** Rough surfaces drive the paper by a noise that falls above a corner. What is free to vibrate answers by its
//! modes; beside it the contact itself is heard, whatever the shape. What is constrained has the contact alone: nearly white, and quieter.
//!
//! **Flaps.** A curved piece snaps through, dents a little and rings its modes, from some small buckles shortly before to others that follow
//! more and more rarely. **Clacs** are the same of dents that are held all around: a few strongly damped modes, for a few milliseconds.
//!
//! **Tears** are fibres that break, one after the other.

use std::f64::consts::{PI, TAU};

use super::plate::{PlateMode, Shape, Sheet, dipole};
use crate::error::{Error, Result};
use crate::random::Random;

/// What names of models begin with.
pub const PREFIX: &str = "synthetic/";

/// The lengths at which l_r and l_c are sampled.
pub const LENGTHS_M: [f64; 9] = [0.025, 0.05, 0.075, 0.1, 0.125, 0.15, 0.2, 0.25, 0.3];

/// Clips of an entry.
pub const FLAPS: usize = 3;

/// Clips of what is constrained.
pub const CLACS: usize = 9;

/// Spectra of what is constrained.
pub const FLAT_SPECTRA: usize = 3;

/// Clicks of fibres that break.
pub const FIBRES: usize = 48;

/// From the beginning of a flap to the moment at which it snaps.
pub const FLAP_LEAD_S: f64 = 0.010;

/// The same of a clac.
pub const CLAC_LEAD_S: f64 = 0.0005;

/// How long a clac and the click of a fibre are.
pub const CLAC_S: f64 = 0.012;
const FIBRE_S: f64 = 0.003;

/// The energy that dents have in a flap, as a part of that of its modes.
const DENTS: f64 = 0.1;

/// The disk whose levels are said below: a square of some 14 cm.
const REFERENCE_DISK_M: f64 = 0.08;

/// Below and above this there are no modes.
const BAND_HZ: [f64; 2] = [30.0, 18_000.0];

/// The seed of all that is random in models: they always sound the same.
const SEED: u64 = 0x1ea_f1e7;

/// A paper of this project's own making.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Paper {
    name: &'static str,
    /// What it is made of.
    pub sheet: Sheet,
    /// Above this the noise of roughness falls.
    roughness_hz: f64,
    /// The part of friction's power that is the contact's own.
    contact: f64,
    /// The root mean square of friction at 1 m/s, in full scale, of a piece of the reference's size.
    level: f64,
    /// By how much what is constrained is quieter.
    constrained: f64,
    /// The energy of a flap of the reference's size and of a clac, in squares of full scale times seconds.
    energies: [f64; 2],
    /// Fibres that break along a metre of a tear.
    fibres_per_m: f64,
    /// Where the clicks of fibres lie.
    fibre_hz: f64,
}

/// All models.
const PAPERS: [Paper; 3] = [
    Paper {
        name: "printer",
        sheet: Sheet { young_pa: 4e9, thickness_m: 100e-6, grammage_kgpm2: 0.080, poisson: 0.3, loss: 0.04 },
        roughness_hz: 6_000.0,
        contact: 0.35,
        level: 0.020,
        constrained: 0.30,
        energies: [2e-4, 4e-6],
        fibres_per_m: 9_000.0,
        fibre_hz: 4_500.0,
    },
    Paper {
        name: "tracing",
        sheet: Sheet { young_pa: 8e9, thickness_m: 62e-6, grammage_kgpm2: 0.070, poisson: 0.3, loss: 0.022 },
        roughness_hz: 10_000.0,
        contact: 0.28,
        level: 0.018,
        constrained: 0.28,
        energies: [2.6e-4, 6e-6],
        fibres_per_m: 14_000.0,
        fibre_hz: 6_500.0,
    },
    Paper {
        name: "banknote",
        sheet: Sheet { young_pa: 3e9, thickness_m: 115e-6, grammage_kgpm2: 0.090, poisson: 0.3, loss: 0.075 },
        roughness_hz: 4_000.0,
        contact: 0.42,
        level: 0.014,
        constrained: 0.32,
        energies: [1.2e-4, 2.5e-6],
        fibres_per_m: 5_000.0,
        fibre_hz: 3_200.0,
    },
];

/// What rings for a while: how it decays and by what it was set ringing.
struct Ring {
    frequency_hz: f64,
    decay_per_s: f64,
    amplitude: f64,
}

/// A blow: when, and how hard. Each sets every mode ringing in its own way.
struct Blow {
    time_s: f64,
    amplitude: f64,
}

impl Paper {
    /// The model of a name that begins with `synthetic/`; nothing for other names.
    pub fn named(name: &str) -> Option<Result<Self>> {
        let wanted = name.strip_prefix(PREFIX)?;
        let found = PAPERS.into_iter().find(|paper| paper.name == wanted);
        Some(found.ok_or_else(|| {
            let names: Vec<String> = Self::names().collect();
            Error::new(format!("there is no synthetic paper `{wanted}`"))
                .help(format!("there are {}", names.join(", ")))
        }))
    }

    /// The names of all models.
    pub fn names() -> impl Iterator<Item = String> {
        PAPERS.iter().map(|paper| format!("{PREFIX}{}", paper.name))
    }

    /// Whether there is such a model.
    pub fn is_model(name: &str) -> bool {
        Self::names().any(|model| model == name)
    }

    /// The printing paper, which tears of recorded papers are like.
    pub fn printer() -> Self {
        PAPERS[0]
    }

    /// What it is called.
    pub fn name(&self) -> String {
        format!("{PREFIX}{}", self.name)
    }

    /// The random numbers of one thing of it.
    fn random(&self, what: u64) -> Random {
        let own =
            self.name.bytes().fold(SEED, |sum: u64, byte| sum.wrapping_mul(31).wrapping_add(u64::from(byte)));
        Random::new(own, what)
    }

    /// The amplitude density of its friction at 1 m/s, in full scale by √Hz, at `count` multiples of a spacing: of a free
    /// piece, or of what is constrained where there is none. The number tells those of one shape apart.
    pub fn density(&self, shape: Option<&Shape>, number: u64, spacing_hz: f64, count: usize) -> Vec<f64> {
        let frequency = |k: usize| (k + 1) as f64 * spacing_hz;
        let rough = |f: f64| 1.0 / (1.0 + (f / self.roughness_hz).powi(2));
        // Seen from the table the contact is small, but what lies flat is as wide as a sheet.
        let random = self.random(number.wrapping_add(1 << 20));
        let tilt_hz = 9_000.0 * (0.8 + 0.4 * random.uniform(0));
        let contact: Vec<f64> = (0..count)
            .map(|k| dipole(frequency(k), 250.0).powi(2) / (1.0 + (frequency(k) / (2.0 * tilt_hz)).powi(2)))
            .collect();
        let contact = evened(contact, spacing_hz);
        let Some(shape) = shape else {
            let level = self.level * self.constrained * (0.9 + 0.2 * random.uniform(1));
            return contact.iter().map(|power| level * power.sqrt()).collect();
        };
        let mut answer = self.sheet.response(shape, spacing_hz, count);
        answer.iter_mut().enumerate().for_each(|(k, power)| *power *= rough(frequency(k)));
        let answer = evened(answer, spacing_hz);
        let level = self.level * (shape.disk_m() / REFERENCE_DISK_M).sqrt();
        let mixed = answer.iter().zip(&contact);
        mixed
            .map(|(answer, contact)| level * (answer * (1.0 - self.contact) + contact * self.contact).sqrt())
            .collect()
    }

    /// How long a flap of a shape is.
    pub fn flap_s(shape: &Shape) -> f64 {
        0.2 + 0.6 * ((shape.disk_m() - 0.01) / 0.11).clamp(0.0, 1.0)
    }

    /// A flap of a shape, at a rate. The number tells those of one shape apart.
    pub fn flap(&self, shape: &Shape, number: u64, rate_hz: f64) -> Vec<f32> {
        let random = self.random(number);
        let length_s = Self::flap_s(shape);
        // A larger piece snaps more slowly.
        let snap_hz = 2_500.0 * (REFERENCE_DISK_M / shape.disk_m()).sqrt();
        let ring = |mode: &PlateMode| Ring {
            frequency_hz: mode.frequency_hz,
            decay_per_s: PI * mode.frequency_hz * mode.loss,
            amplitude: mode.weight / (1.0 + mode.frequency_hz / snap_hz),
        };
        let mut rings: Vec<Ring> = self.sheet.modes(shape).iter().map(ring).collect();
        // No two pieces are cut alike.
        for (index, ring) in (0u64..).zip(rings.iter_mut()) {
            ring.frequency_hz *= 0.97 + 0.06 * random.uniform(index);
        }
        // Each blow also dents the paper where it falls, whatever the size of the whole.
        let mut dents = self.dents(random, 1 << 12);
        let held = |rings: &[Ring]| {
            let heard = rings.iter().filter(|ring| (BAND_HZ[0]..BAND_HZ[1]).contains(&ring.frequency_hz));
            heard.map(|ring| ring.amplitude * ring.amplitude / ring.decay_per_s).sum::<f64>()
        };
        let gain = (DENTS * held(&rings) / held(&dents)).sqrt();
        dents.iter_mut().for_each(|ring| ring.amplitude *= gain);
        rings.extend(dents);
        let uniform = |index: u64| random.uniform((1 << 10) + index);
        let mut blows = vec![Blow { time_s: FLAP_LEAD_S, amplitude: 1.0 }];
        for k in 0..4 {
            let time_s = FLAP_LEAD_S * (0.2 + 0.75 * uniform(4 * k));
            blows.push(Blow { time_s, amplitude: 0.05 + 0.15 * uniform(4 * k + 1) });
        }
        // What buckles afterwards: energies follow a power law, as those of crumpled sheets do.
        let lasts_s = 0.22 * length_s;
        for k in 0..18 + (24.0 * length_s) as u64 {
            let later_s = -lasts_s * (1.0 - uniform(4 * k + 2)).ln();
            let energy = (1.0 - 0.995 * uniform(4 * k + 3)).powf(-1.0 / 1.6) / 28.0;
            let amplitude = 0.55 * energy.sqrt() * (-0.6 * later_s / lasts_s).exp();
            blows.push(Blow { time_s: FLAP_LEAD_S + later_s, amplitude });
        }
        let energy = self.energies[0] * (shape.disk_m() / REFERENCE_DISK_M).powf(1.4);
        ringing(&rings, &blows, random, length_s, rate_hz, energy)
    }

    /// The modes of a dent that is held all around. `index` is the first of 32 addresses of what is random in it.
    fn dents(&self, random: Random, index: u64) -> Vec<Ring> {
        let stiffness = (self.sheet.young_pa / 4e9).powf(0.35) * (0.04 / self.sheet.loss).powf(0.2);
        let lowest_hz = stiffness * 1_500.0 * 3.0f64.powf(random.uniform(index));
        let ring = |k: u64| {
            let frequency_hz =
                lowest_hz * (1.0 + 0.62 * k as f64) * (0.9 + 0.2 * random.uniform(index + 10 + k));
            // Held on all sides, so that it loses energy to what is about it.
            Ring {
                frequency_hz,
                decay_per_s: PI * frequency_hz * (0.12 + 2.0 * self.sheet.loss),
                amplitude: 1.0 / (1.0 + 0.4 * k as f64),
            }
        };
        (0..8).map(ring).collect()
    }

    /// A clac, at a rate.
    pub fn clac(&self, number: u64, rate_hz: f64) -> Vec<f32> {
        let random = self.random(number.wrapping_add(1 << 21));
        let rings = self.dents(random, 0);
        let mut blows = vec![Blow { time_s: CLAC_LEAD_S, amplitude: 1.0 }];
        for k in 0..2 + random.below(1, 3) as u64 {
            let time_s = CLAC_LEAD_S + 0.0025 * random.uniform(30 + k);
            blows.push(Blow { time_s, amplitude: 0.15 + 0.35 * random.uniform(40 + k) });
        }
        let energy = self.energies[1] * 4.0f64.powf(2.0 * random.uniform(2) - 1.0);
        ringing(&rings, &blows, random, CLAC_S, rate_hz, energy)
    }

    /// Fibres that break along a metre of a tear.
    pub fn fibres_per_m(&self) -> f64 {
        self.fibres_per_m
    }

    /// The click of one fibre, at a rate.
    pub fn fibre(&self, number: u64, rate_hz: f64) -> Vec<f32> {
        let random = self.random(number.wrapping_add(1 << 22));
        let ring = |k: u64| {
            let frequency_hz = self.fibre_hz * 3.0f64.powf(random.uniform(2 * k) - 0.5);
            Ring {
                frequency_hz,
                decay_per_s: PI * frequency_hz * 0.25,
                amplitude: 0.3 + random.uniform(2 * k + 1),
            }
        };
        let rings: Vec<Ring> = (0..4).map(ring).collect();
        let blows = [Blow { time_s: 0.0, amplitude: 1.0 }];
        // Fibres that pull out of one another break with very different energies.
        let energy = 0.01 * self.energies[1] * (1.0 - 0.99 * random.uniform(20)).powf(-1.0 / 1.5);
        ringing(&rings, &blows, random, FIBRE_S, rate_hz, energy)
    }
}

/// Power densities whose sum over frequency is 1.
fn evened(mut power: Vec<f64>, spacing_hz: f64) -> Vec<f64> {
    let whole = power.iter().sum::<f64>() * spacing_hz;
    if whole > 0.0 {
        power.iter_mut().for_each(|value| *value /= whole);
    }
    power
}

/// Modes that are computed side by side.
const LANES: usize = 8;

/// What modes sound like that blows set ringing, with an energy in all. It begins and ends in silence.
fn ringing(
    rings: &[Ring],
    blows: &[Blow],
    random: Random,
    length_s: f64,
    rate_hz: f64,
    energy: f64,
) -> Vec<f32> {
    let count = (length_s * rate_hz).round() as usize;
    let mut order: Vec<(usize, usize)> = blows
        .iter()
        .enumerate()
        .map(|(index, blow)| (((blow.time_s * rate_hz).round() as usize).min(count), index))
        .collect();
    order.sort_unstable();
    let [lowest_hz, highest_hz] = BAND_HZ;
    let top_hz = highest_hz.min(0.45 * rate_hz);
    let heard: Vec<(u64, &Ring)> =
        (0u64..).zip(rings).filter(|(_, ring)| (lowest_hz..top_hz).contains(&ring.frequency_hz)).collect();
    let mut out = vec![0.0f64; count];
    for group in heard.chunks(LANES) {
        // e^(−δ t) sin(ω t), by its recursion.
        let (mut first, mut second, mut gain) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for (lane, (_, ring)) in group.iter().enumerate() {
            let radius = (-ring.decay_per_s / rate_hz).exp();
            let angle = TAU * ring.frequency_hz / rate_hz;
            first[lane] = 2.0 * radius * angle.cos();
            second[lane] = -radius * radius;
            gain[lane] = ring.amplitude * radius * angle.sin();
        }
        let (mut one, mut two) = ([0.0; LANES], [0.0; LANES]);
        for (place, &(begin, blow)) in order.iter().enumerate() {
            let end = order.get(place + 1).map_or(count, |next| next.0);
            // Where on the sheet it was hit tells how far each mode answers.
            for (lane, (mode, _)) in group.iter().enumerate() {
                let answers = random.normal((1 << 24) + blow as u64 * 4096 + mode);
                one[lane] += gain[lane] * blows[blow].amplitude * answers;
            }
            for out in &mut out[begin..end] {
                let mut sum = 0.0;
                for lane in 0..LANES {
                    sum += one[lane];
                    let next = first[lane] * one[lane] + second[lane] * two[lane];
                    two[lane] = one[lane];
                    one[lane] = next;
                }
                *out += sum;
            }
        }
    }
    let fall = (0.15 * count as f64).max(1.0);
    let mut whole = 0.0;
    for (n, out) in out.iter_mut().enumerate() {
        let left = ((count - n) as f64 / fall).min(1.0);
        *out *= left * left * (3.0 - 2.0 * left);
        whole += *out * *out;
    }
    let gain = if whole > 0.0 { (energy * rate_hz / whole).sqrt() } else { 0.0 };
    out.iter().map(|value| (value * gain) as f32).collect()
}

#[cfg(test)]
mod tests;
