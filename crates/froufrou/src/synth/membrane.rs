//! A sheet that is stretched, blown at and whipped: the modes of a membrane whose tension changes.
//!
//! | control | | default |
//! | --- | --- | --- |
//! | `tension` | N/m, along both directions | 0 |
//! | `speed` | of the air across it, m/s | 0 |
//!
//! | parameter | default | from, to | |
//! | --- | --- | --- | --- |
//! | `width`, `height` | 1 | 0.01, 100 | a, b: of the sheet, metres |
//! | `density` | 0.15 | 0.001, 100 | σ: kg/m² |
//! | `damping` | 0.05 | 0.0001, 1 | ζ: of every mode, as a part of the critical one |
//! | `stir` | 0.1 | 0, 10 | the fluctuation of the pressure of the air, as a part of ½ ρ v² |
//! | `modes` | 24 | 1, 200 | how many are heard, from the lowest on |
//!
//! A sample of 1 is a pascal at 1 m. The model, with tension T:
//!
//! - a mode (m, n) sounds at f = ½ √(T/σ) √((m/a)² + (n/b)²) and moves as sin(mπx/a) sin(nπy/b); its mass is σab/4
//!   and it dies away as e^(−(ζω + [`SLACK_PER_S`]) t), so that what goes slack falls silent;
//! - the modes of odd m and n alone displace air as a whole: 4ab/(π² m n) times their own movement. The sheet is a
//!   part of a larger one, which is its baffle, and small against the wave: the pressure is ρ/(2π) times the
//!   acceleration of that volume;
//! - a blow of an impulse J at x/a = y/b = `place` gives a mode the velocity J sin(mπx/a) sin(nπy/b) / (σab/4);
//! - the air presses by a fluctuation of `stir` · ½ ρ v², with a one-sided spectrum 2/(π f₀ (1 + (f/f₀)²)) about
//!   f₀ = 0.2 v/L, that is alike over an area of (L/10)², for L = √(ab).
//!
//! A mode keeps its amplitude as its tension changes, and is not heard near half the sample rate.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use super::gate::{control, finite, smooth_step};
use super::instrument::{Control, Generator, Instrument, Parameters, Stretch, Strike};
use super::modal::contact_spectrum;
use super::voice::first_frame;
use crate::Result;
use crate::random::Random;

/// The decay of all modes beyond their own.
pub const SLACK_PER_S: f64 = 30.0;

/// Of air, in kg/m³.
const AIR_DENSITY: f64 = 1.2;

/// Strouhal's number of blunt bodies.
const STROUHAL: f64 = 0.2;

/// The edge of the area over which the air presses alike, as a part of the sheet's.
const ALIKE: f64 = 0.1;

/// Modes are heard up to this part of the sample rate, and fade above [`FADES`] of it.
const HEARD: f64 = 0.45;
const FADES: f64 = 0.4;

/// The greatest state of a mode: sums of them fit single precision.
const GREATEST: f64 = 1e30;

/// A state below which a mode is at rest.
const LEAST: f64 = 1e-24;

/// A stretched sheet.
#[derive(Debug)]
pub struct Membrane {
    sheet: Arc<Sheet>,
    controls: [Control; 2],
}

/// What does not change of a sheet.
#[derive(Debug)]
struct Sheet {
    modes: Vec<Mode>,
    damping: f64,
    size_m: f64,
    /// Pressure at 1 m for a unit of impulse and of angular frequency, but for a mode's own share.
    struck: f64,
    /// The mean square of the pressure at 1 m, for a unit of the spectrum of pressure, angular frequency squared and
    /// decay, but for a mode's own share.
    blown: f64,
    stir: f64,
}

/// What does not change of a mode.
#[derive(Debug, Clone, Copy)]
struct Mode {
    m: f64,
    n: f64,
    /// The frequency at a tension of 1 N/m.
    frequency_hz: f64,
}

impl Membrane {
    /// A sheet with these parameters.
    ///
    /// # Errors
    /// A parameter that there is not, or one outside of its range.
    pub fn new(given: &[(String, f64)]) -> Result<Self> {
        let mut parameters = Parameters::new(given);
        let width_m = parameters.take("width", 1.0, 0.01..=100.0)?;
        let height_m = parameters.take("height", 1.0, 0.01..=100.0)?;
        let density = parameters.take("density", 0.15, 0.001..=100.0)?;
        let damping = parameters.take("damping", 0.05, 0.0001..=1.0)?;
        let stir = parameters.take("stir", 0.1, 0.0..=10.0)?;
        let count = parameters.take("modes", 24.0, 1.0..=200.0)?.round() as usize;
        parameters.finish()?;
        let area_m2 = width_m * height_m;
        let mass_kg = density * area_m2 / 4.0;
        // Of a mode's movement to pressure at 1 m, but for 1/(m n).
        let radiated = AIR_DENSITY / TAU * 4.0 * area_m2 / (PI * PI);
        let alike_m2 = ALIKE * ALIKE * area_m2;
        let sheet = Sheet {
            modes: lowest(width_m, height_m, density, count),
            damping,
            size_m: area_m2.sqrt(),
            struck: radiated / mass_kg,
            // A force of one-sided spectrum S moves it at a mean square velocity of S / (8 α mass²); the mean square of
            // its shape is 1/4.
            blown: radiated * radiated * alike_m2 * area_m2 / 4.0 / (8.0 * mass_kg * mass_kg),
            stir,
        };
        let controls = ["tension", "speed"].map(|name| Control { name: name.to_owned(), default: 0.0 });
        Ok(Self { sheet: Arc::new(sheet), controls })
    }
}

impl Sheet {
    /// The mean square of the pressure of the air against the sheet in a hertz at a frequency.
    fn pressure_spectrum(&self, speed_mps: f64, frequency_hz: f64) -> f64 {
        let middle_hz = STROUHAL * speed_mps / self.size_m;
        if middle_hz == 0.0 {
            return 0.0;
        }
        let pressure_pa = self.stir * 0.5 * AIR_DENSITY * speed_mps * speed_mps;
        let shape = 1.0 + (frequency_hz / middle_hz).powi(2);
        pressure_pa * pressure_pa * 2.0 / (PI * middle_hz * shape)
    }
}

/// The lowest modes of odd numbers, in order of frequency.
fn lowest(width_m: f64, height_m: f64, density: f64, count: usize) -> Vec<Mode> {
    let mode = |m: f64, n: f64| Mode {
        m,
        n,
        frequency_hz: 0.5 * ((m / width_m).powi(2) + (n / height_m).powi(2)).sqrt() / density.sqrt(),
    };
    let odd = || (0..count).map(|k| (2 * k + 1) as f64);
    let mut modes: Vec<Mode> = odd().flat_map(|m| odd().map(move |n| mode(m, n))).collect();
    modes.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    modes.truncate(count);
    modes
}

impl Instrument for Membrane {
    fn controls(&self) -> &[Control] {
        &self.controls
    }

    fn ring_s(&self) -> Option<f64> {
        None
    }

    fn generator(&self, _: f64, random: Random) -> Result<Box<dyn Generator>> {
        let states = vec![[0.0; 2]; self.sheet.modes.len()];
        Ok(Box::new(Sounding { sheet: self.sheet.clone(), states, random }))
    }
}

/// One thread of a sheet.
struct Sounding {
    sheet: Arc<Sheet>,
    /// Of every mode: the pressure that is heard and the same a quarter of a period later.
    states: Vec<[f64; 2]>,
    random: Random,
}

/// What a mode does over a stretch.
struct Course {
    /// Turns and shrinks the state from one sample to the next, and itself: its logarithm changes evenly.
    turn: [f64; 2],
    change: [f64; 2],
    /// How strongly noise drives it and how loud it is heard, at the beginning and the end.
    drive: [f64; 2],
    heard: [f64; 2],
}

fn product(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

/// e to the power of a complex number.
fn exponential(real: f64, imaginary: f64) -> [f64; 2] {
    let (sin, cos) = imaginary.sin_cos();
    [real.exp() * cos, real.exp() * sin]
}

impl Sounding {
    fn course(&self, mode: &Mode, tension: [f64; 2], speed: [f64; 2], rate_hz: f64, count: f64) -> Course {
        let sheet = &self.sheet;
        let heard_hz = |tension: f64| (mode.frequency_hz * tension.sqrt()).min(rate_hz / 2.0);
        let frequency = tension.map(heard_hz);
        let decay = |f: f64| sheet.damping * TAU * f + SLACK_PER_S;
        let [from, to] = frequency.map(|f| [-decay(f) / rate_hz, TAU * f / rate_hz]);
        let drive = [0, 1].map(|k| {
            let (f, decay) = (frequency[k], decay(frequency[k]));
            let share = (mode.m * mode.n).powi(-2);
            let square =
                share * sheet.blown * (TAU * f).powi(2) * sheet.pressure_spectrum(speed[k], f) / decay;
            // Noise from −1 to 1 has a variance of 1/3, and half of what drives the state is in its first part.
            (square.min(GREATEST) * 6.0 * (1.0 - (-2.0 * decay / rate_hz).exp())).sqrt()
        });
        let heard = frequency.map(|f| smooth_step((HEARD - f / rate_hz) / (HEARD - FADES)));
        Course {
            turn: exponential(from[0], from[1]),
            change: exponential((to[0] - from[0]) / count, (to[1] - from[1]) / count),
            drive,
            heard,
        }
    }

    /// Gives a mode a blow, whose first sample is `late_s` after it.
    fn strike(&mut self, strike: &Strike, tension: f64, late_s: f64) {
        let sheet = &self.sheet;
        for (mode, state) in sheet.modes.iter().zip(&mut self.states) {
            let frequency_hz = mode.frequency_hz * tension.sqrt();
            let shape = (mode.m * PI * strike.place).sin() * (mode.n * PI * strike.place).sin();
            let soft = contact_spectrum(frequency_hz, strike.contact_s);
            let omega = TAU * frequency_hz;
            let pressure = sheet.struck * omega * strike.impulse_ns * shape * soft / (mode.m * mode.n);
            if !pressure.is_finite() {
                continue;
            }
            // The velocity leaps, and its derivative begins at 0.
            let decay = sheet.damping * omega + SLACK_PER_S;
            let at = exponential(-decay * late_s, omega * late_s);
            state[0] = (state[0] - pressure * at[1]).clamp(-GREATEST, GREATEST);
            state[1] = (state[1] + pressure * at[0]).clamp(-GREATEST, GREATEST);
        }
    }
}

impl Generator for Sounding {
    fn generate(&mut self, stretch: &Stretch<'_>, out: &mut [f32]) -> Result<()> {
        let (count, rate_hz) = (out.len(), stretch.rate_hz);
        let [tension, speed] = [0, 1].map(|index| control(stretch, index, 0.0));
        let sheet = self.sheet.clone();
        let modes = &sheet.modes;
        let mut courses: Vec<Course> = modes
            .iter()
            .map(|mode| {
                self.course(mode, [tension.from, tension.to], [speed.from, speed.to], rate_hz, count as f64)
            })
            .collect();
        let is_blown = courses.iter().any(|course| course.drive != [0.0; 2]);
        let mut strikes = stretch.strikes.iter().peekable();
        for (n, out) in out.iter_mut().enumerate() {
            let frame = stretch.first + n as u64;
            let due = |strike: &&Strike| first_frame(strike.time_s, rate_hz) <= frame;
            while let Some(strike) = strikes.next_if(due) {
                let late_s = frame as f64 / rate_hz - strike.time_s;
                self.strike(strike, tension.at(n, count), late_s);
            }
            let part = n as f64 / count as f64;
            let mut sum = 0.0;
            for (k, (state, course)) in self.states.iter_mut().zip(&mut courses).enumerate() {
                let between = |values: [f64; 2]| values[0] + (values[1] - values[0]) * part;
                sum += state[0] * between(course.heard);
                *state = product(*state, course.turn);
                course.turn = product(course.turn, course.change);
                if is_blown {
                    let noise = self.random.uniform(frame * modes.len() as u64 + k as u64);
                    state[0] += (2.0 * noise - 1.0) * between(course.drive);
                }
            }
            *out = finite(sum);
        }
        for state in &mut self.states {
            if state[0].abs().max(state[1].abs()) < LEAST {
                *state = [0.0; 2];
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
