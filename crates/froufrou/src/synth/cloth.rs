//! Cloth: friction that follows the speeds it is told, and pops that begin as it is told.
//!
//! Controls are those of [friction](super::friction::voice). A `grain` line plays a pop by its number in the corpus, as it
//! was recorded or at another speed. Both may sound in one thread; friction at rest costs nothing.
//!
//! | parameter | default | from, to | |
//! | --- | --- | --- | --- |
//! | `slope` | 1 | 0.05, 20 | speeds are raised to this power |
//! | `unit` | 1 | 1e-6, 1e6 | after they are divided by this, in m/s |
//!
//! So an animation that is too fast for its cloth can be made slower: s̃ = (s / unit)^slope, in m/s. (For their windbreaker An, James &
//! Marschner had (s / 4)^p.)

use std::sync::{Arc, Mutex, PoisonError};

use super::friction::voice::{self, RateTable, Voice};
use super::friction::{FrictionTable, PARTS};
use super::grains::{Clips, Player};
use super::instrument::{Control, Generator, Instrument, Parameters, Ramp, Stretch};
use crate::Result;
use crate::corpus::cloth::ClothSound;
use crate::random::Random;

/// What tells the random numbers of friction from those of pops.
const FRICTION: u64 = 0x6672;

/// The sound of a cloth.
pub struct Cloth {
    sound: Arc<ClothSound>,
    table: Option<Arc<FrictionTable>>,
    slope: f64,
    unit_mps: f64,
    controls: Vec<Control>,
    /// What has been made ready for rates.
    ready: Mutex<Vec<Arc<Ready>>>,
}

/// A cloth at a rate.
struct Ready {
    rate_hz: u32,
    table: Option<Arc<RateTable>>,
    pops: Arc<Pops>,
}

struct Pops(Vec<Vec<f32>>);

impl Clips for Pops {
    fn count(&self) -> usize {
        self.0.len()
    }

    fn samples(&self, number: usize) -> &[f32] {
        self.0.get(number).map_or(&[], Vec::as_slice)
    }

    fn phase(&self, _: usize) -> f64 {
        0.0
    }
}

impl std::fmt::Debug for Cloth {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Cloth").field("name", &self.sound.name()).finish_non_exhaustive()
    }
}

impl Cloth {
    /// A cloth with these parameters.
    ///
    /// # Errors
    /// A parameter that there is not, or one outside of its range.
    pub fn new(sound: Arc<ClothSound>, given: &[(String, f64)]) -> Result<Self> {
        let mut parameters = Parameters::new(given);
        let slope = parameters.take("slope", 1.0, 0.05..=20.0)?;
        let unit_mps = parameters.take("unit", 1.0, 1e-6..=1e6)?;
        parameters.finish()?;
        let table = sound.friction().map(|friction| Arc::new(FrictionTable::new(&friction.spectra)));
        Ok(Self { sound, table, slope, unit_mps, controls: voice::controls(), ready: Mutex::default() })
    }

    fn ready(&self, rate_hz: f64) -> Result<Arc<Ready>> {
        let whole_hz = rate_hz.round() as u32;
        let mut all = self.ready.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(ready) = all.iter().find(|ready| ready.rate_hz == whole_hz) {
            return Ok(ready.clone());
        }
        let table = self.table.as_ref().map(|table| Arc::new(RateTable::new(table.clone(), rate_hz)));
        let pops = Arc::new(Pops(self.sound.pop_samples(whole_hz)?));
        let ready = Arc::new(Ready { rate_hz: whole_hz, table, pops });
        all.push(ready.clone());
        Ok(ready)
    }
}

impl Instrument for Cloth {
    fn controls(&self) -> &[Control] {
        &self.controls
    }

    fn ring_s(&self) -> Option<f64> {
        None
    }

    fn cloth(&self) -> Option<Arc<ClothSound>> {
        Some(self.sound.clone())
    }

    fn clips(&self) -> usize {
        self.sound.pops().len()
    }

    fn ahead_s(&self) -> f64 {
        voice::AHEAD_S
    }

    fn generator(&self, rate_hz: f64, random: Random) -> Result<Box<dyn Generator>> {
        let ready = self.ready(rate_hz)?;
        let own = Random::new(random.bits(FRICTION), FRICTION);
        Ok(Box::new(Playing {
            friction: ready.table.clone().map(|table| Voice::new(table, rate_hz, own)),
            pops: Player::new(ready.pops.clone(), random),
            slope: self.slope,
            unit_mps: self.unit_mps,
            controls: Vec::new(),
        }))
    }
}

/// A thread of cloth.
struct Playing {
    friction: Option<Voice>,
    pops: Player,
    slope: f64,
    unit_mps: f64,
    controls: Vec<Ramp>,
}

impl Generator for Playing {
    fn generate(&mut self, stretch: &Stretch<'_>, out: &mut [f32]) -> Result<()> {
        self.pops.generate(stretch, out)?;
        let Some(friction) = &mut self.friction else { return Ok(()) };
        self.controls.clear();
        self.controls.extend_from_slice(stretch.controls);
        if self.slope != 1.0 || self.unit_mps != 1.0 {
            let remapped = |speed: f64| (speed.abs() / self.unit_mps).powf(self.slope);
            for part in 0..PARTS {
                if let Some(speed) = self.controls.get_mut(3 * part) {
                    *speed = Ramp { from: remapped(speed.from), to: remapped(speed.to) };
                }
                // As speeds are raised to a power, so their logarithms stray by so many times as much.
                if let Some(spread) = self.controls.get_mut(3 * part + 2) {
                    *spread = Ramp { from: spread.from * self.slope, to: spread.to * self.slope };
                }
            }
        }
        friction.add(&Stretch { controls: &self.controls, ..*stretch }, out);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::Grain;
    use crate::synth::instrument::{GrainStart, stretch_samples};

    const RATE_HZ: f64 = 48_000.0;

    fn cloth(given: &[(&str, f64)]) -> Cloth {
        let given: Vec<(String, f64)> = given.iter().map(|&(name, value)| (name.to_owned(), value)).collect();
        let sound = ClothSound::named("synthetic/cotton", std::path::Path::new("")).unwrap();
        Cloth::new(Arc::new(sound), &given).unwrap()
    }

    fn play(cloth: &Cloth, speed_mps: f64, pops: &[(f64, u32)], seconds: f64) -> Vec<f32> {
        let mut generator = cloth.generator(RATE_HZ, Random::new(1, 7)).unwrap();
        let mut controls: Vec<Ramp> = cloth.controls().iter().map(|c| Ramp::still(c.default)).collect();
        controls[0] = Ramp::still(speed_mps);
        let count = stretch_samples(RATE_HZ);
        let mut out = Vec::new();
        while (out.len() as f64) < seconds * RATE_HZ {
            let first = out.len() as u64;
            let times = first as f64 / RATE_HZ..(first + count as u64) as f64 / RATE_HZ;
            let due = pops.iter().filter(|(time_s, _)| times.contains(time_s)).map(|&(time_s, number)| {
                GrainStart { time_s, grain: Grain { number, gain: 1.0, speed: 1.0, spread: 0.0 } }
            });
            let due: Vec<GrainStart> = due.collect();
            let stretch =
                Stretch { first, rate_hz: RATE_HZ, controls: &controls, strikes: &[], grains: &due };
            let begin = out.len();
            out.resize(begin + count, 0.0);
            generator.generate(&stretch, &mut out[begin..]).unwrap();
        }
        out
    }

    #[test]
    fn pops_play_as_they_are_and_rub_beside() {
        let cloth = cloth(&[]);
        let pop = cloth.sound.pop_samples(48_000).unwrap().swap_remove(40);
        let alone = play(&cloth, 0.0, &[(0.1, 40)], 0.3);
        assert!(alone[..4800].iter().all(|v| *v == 0.0));
        let heard = pop.len().min(alone.len() - 4800);
        assert_eq!(&alone[4800..4800 + heard], &pop[..heard]);
        let rubbing = play(&cloth, 0.3, &[], 0.3);
        let both = play(&cloth, 0.3, &[(0.1, 40)], 0.3);
        for ((both, alone), rubbing) in both.iter().zip(&alone).zip(&rubbing) {
            assert!((both - alone - rubbing).abs() < 1e-6);
        }
        assert!(rubbing.iter().any(|v| v.abs() > 1e-3));
        assert_eq!(cloth.clips(), cloth.sound.pops().len());
    }

    #[test]
    fn speeds_are_remapped() {
        // (0.8 / 4)^0.5 = 0.447 m/s.
        let mapped = play(&cloth(&[("unit", 4.0), ("slope", 0.5)]), 0.8, &[], 0.2);
        let plain = play(&cloth(&[]), (0.8f64 / 4.0).sqrt(), &[], 0.2);
        for (mapped, plain) in mapped.iter().zip(&plain) {
            assert!((mapped - plain).abs() < 1e-6);
        }
        let sound = cloth(&[]).sound;
        assert!(Cloth::new(sound.clone(), &[("slope".into(), 0.0)]).is_err());
        assert!(Cloth::new(sound, &[("slop".into(), 1.0)]).is_err());
    }
}
