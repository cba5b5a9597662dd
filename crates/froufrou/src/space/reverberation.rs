//! How long a room reverberates, and the tail of its reverberation behind the first images.
//!
//! Images of a source tell the first reflections one by one ([`super::room`]). Their number grows with the cube of
//! their order, and soon nobody hears them apart. What follows is noise that decays in each octave band as
//! Eyring's formula says, at the level of the images that it continues.
//!
//! Of a source that has a pressure of 1 at 1 m, 4π (c t)² c dt / V images arrive in a time dt, each of a pressure of
//! 1 / (c t) and what walls and air leave of it; so the energy that arrives in a second is 4π c / V at first, and decays
//! from there. What part of it is told by images up to an order is found by averaging over all places of source and
//! listener. The tail has the rest: it rises as these images thin out, so that both together go on evenly.
//!
//! | quantity | value |
//! | --- | --- |
//! | reverberation time of a tail | within 5 % of Eyring's, measured in any band whose width times that time is 40 or more; noise of the band of 63 Hz tells a time below 1 s less well |
//! | length | until each band has fallen by 90 dB |
//! | cost | about 1 µs a sample, once for each room and channel |

mod images;
mod split;

use std::f64::consts::PI;

use super::air::Medium;
use super::bands::{BAND_COUNT, BANDS_HZ, Bands};
use super::room::{Room, mean_absorption};
use crate::random::Random;
use crate::{Error, Result};
use images::Images;
use split::Split;

/// A room that reverberates longer has no tail, in seconds.
pub const LONGEST_S: f64 = 30.0;

/// The images that a tail continues have this order at most.
const HIGHEST_ORDER: usize = 1000;

/// Energy falls by 60 dB in the reverberation time: by e to this power.
const SIXTY_DB: f64 = 13.815_510_557_964_274;

/// A tail ends when it has fallen by 60 dB times this: 90 dB.
const END: f64 = 1.5;

/// The part of a band's tail over which it fades at its end.
const FADE: f64 = 0.05;

/// Tails of reverberation have random numbers of their own: those of channel c are those of this thread + c.
const THREADS: u64 = 0x7461_696c_0000_0000;

/// Steps of time over which the images thin out.
const STEPS: usize = 256;

/// A band that reverberates for a shorter time than this is silent, in seconds.
const SHORTEST_S: f64 = 1e-3;

/// The reverberation times of Sabine's formula in each octave band, in seconds: 24 ln 10 V / (c (α S + 4 m V)).
/// Infinite where nothing absorbs.
pub fn sabine_s(room: &Room, air: &Medium) -> Bands {
    times_s(room, air, |absorption| absorption)
}

/// The reverberation times of Eyring's formula in each octave band, in seconds: 24 ln 10 V / (c (−ln(1 − α) S + 4 m V)).
/// Infinite where nothing absorbs, 0 where walls absorb everything.
pub fn eyring_s(room: &Room, air: &Medium) -> Bands {
    times_s(room, air, |absorption| -(-absorption).ln_1p())
}

fn times_s(room: &Room, air: &Medium, exponent: impl Fn(f64) -> f64) -> Bands {
    let (volume, area) = (room.volume_m3(), room.areas_m2().iter().sum::<f64>());
    let (absorption, air_per_m) = (mean_absorption(room), energy_per_m(air));
    std::array::from_fn(|band| {
        let lost = area * exponent(absorption[band]) + 4.0 * air_per_m[band] * volume;
        4.0 * SIXTY_DB * volume / (air.speed_of_sound_mps() * lost)
    })
}

/// What part of the energy of each band air takes in each metre.
fn energy_per_m(air: &Medium) -> Bands {
    air.band_absorption_db_per_m().map(|db| db * std::f64::consts::LN_10 / 10.0)
}

/// The reverberation of a room behind the images up to some order.
#[derive(Debug, Clone)]
pub struct Reverberation {
    times_s: Bands,
    /// When half of the energy is no longer told by images.
    joints_s: Bands,
    step_s: f64,
    /// The energy that arrives in a second and is not told by images, at each step of time until none is.
    rise: Vec<Bands>,
}

impl Reverberation {
    /// The reverberation behind images up to `order`, for the average place of source and listener.
    ///
    /// A room in which a band reverberates for longer than [`LONGEST_S`] is refused: walls that absorb nothing
    /// would let it do so for minutes.
    pub fn new(room: &Room, air: &Medium, order: usize) -> Result<Self> {
        let times_s = eyring_s(room, air);
        if let Some(band) = times_s.iter().position(|time_s| !(0.0..=LONGEST_S).contains(time_s)) {
            let (time_s, name) = (times_s[band], BANDS_HZ[band].round());
            return Err(Error::new(format!(
                "the room reverberates for {time_s:.0} s at {name} Hz; {LONGEST_S} s is the most"
            ))
            .help("let its walls absorb more, or make it smaller"));
        }
        if order > HIGHEST_ORDER {
            return Err(Error::new(format!(
                "a tail behind images of order {order}; {HIGHEST_ORDER} is the most"
            )));
        }
        let mut sides = room.size_m();
        sides.sort_by(f64::total_cmp);
        let [x, y, z] = sides;
        // No image of the order is further away, wherever source and listener are.
        let farthest_m = ((order + 1) as f64 * z).hypot(x.hypot(y));
        let speed = air.speed_of_sound_mps();
        let step_s = farthest_m / speed / STEPS as f64;
        let images = Images::new(room, air, order);
        let steps: Vec<(Bands, Bands)> =
            (0..=STEPS).map(|step| images.energies(step as f64 * step_s * speed)).collect();
        let share = |step: usize, band: usize| {
            let (early, all) = (steps[step].0[band], steps[step].1[band]);
            if all > 0.0 { (1.0 - early / all).clamp(0.0, 1.0) } else { 1.0 }
        };
        let joints: [usize; BAND_COUNT] =
            std::array::from_fn(|band| (0..=STEPS).find(|step| share(*step, band) >= 0.5).unwrap_or(STEPS));
        let rise = (0..=STEPS).map(|step| {
            std::array::from_fn(|band| {
                if times_s[band] < SHORTEST_S {
                    return 0.0;
                }
                // From the joint on all images together would decay by Eyring's formula.
                let joint = joints[band].min(step);
                let decay = SIXTY_DB * (step - joint) as f64 * step_s / times_s[band];
                let all = steps[joint].1[band] * (-decay).exp();
                share(step, band) * all * 4.0 * PI * speed / room.volume_m3()
            })
        });
        Ok(Self {
            times_s,
            joints_s: joints.map(|joint| joint as f64 * step_s),
            step_s,
            rise: rise.collect(),
        })
    }

    /// The reverberation time of each band, in seconds, by Eyring's formula.
    pub fn times_s(&self) -> &Bands {
        &self.times_s
    }

    /// The energy of the tail that arrives in a second about a time after it left the source, in each band, where a
    /// source has a pressure of 1 at 1 m.
    pub fn energy_per_s(&self, time_s: f64) -> Bands {
        std::array::from_fn(|band| self.band_energy_per_s(band, time_s))
    }

    fn band_energy_per_s(&self, band: usize, time_s: f64) -> f64 {
        let place = time_s.max(0.0) / self.step_s;
        let (step, part) = (place as usize, place.fract());
        match (self.rise.get(step), self.rise.get(step + 1)) {
            (Some(from), Some(to)) => from[band] + part * (to[band] - from[band]),
            _ => {
                let late_s = time_s - (self.rise.len() - 1) as f64 * self.step_s;
                let left = (-SIXTY_DB * late_s / self.times_s[band].max(SHORTEST_S)).exp();
                self.rise.last().map_or(0.0, |last| last[band] * left)
            }
        }
    }

    /// When a band's tail ends, in seconds.
    fn end_s(&self, band: usize) -> f64 {
        if self.times_s[band] < SHORTEST_S { 0.0 } else { self.joints_s[band] + END * self.times_s[band] }
    }

    /// The response of the tail from the moment at which sound leaves the source, at a sampling rate of 8 to 192
    /// kHz. Channels are as loud as each other and independent; a channel is the same for the same seed, at
    /// any time. Convolved with a source's signal of pressure at 1 m it gives what arrives from all around.
    ///
    /// ```
    /// use froufrou::space::air::Medium;
    /// use froufrou::space::reverberation::Reverberation;
    /// use froufrou::space::room::{Room, Walls};
    /// let room = Room::new([0.0; 3], [5.0, 3.0, 4.0], 0.0, &Walls::all([0.3; 8]))?;
    /// let reverberation = Reverberation::new(&room, &Medium::default(), 3)?;
    /// let left = reverberation.tail(48_000.0, 1, 0)?;
    /// let right = reverberation.tail(48_000.0, 1, 1)?;
    /// # assert_eq!(left.len(), right.len());
    /// # Ok::<(), froufrou::Error>(())
    /// ```
    pub fn tail(&self, rate_hz: f64, seed: u64, channel: u64) -> Result<Vec<f32>> {
        if !(8000.0..=192_000.0).contains(&rate_hz) {
            return Err(Error::new(format!(
                "a sampling rate of {rate_hz} Hz; reverberation is made at 8000 to 192000 Hz"
            )));
        }
        let heard = BANDS_HZ.iter().filter(|middle_hz| **middle_hz < 0.5 * rate_hz).count();
        let frames = (0..heard).map(|band| (self.end_s(band) * rate_hz) as usize).max().unwrap_or(0);
        let mut tail = vec![0.0f32; frames];
        let random = Random::new(seed, THREADS.wrapping_add(channel));
        let mut noise = vec![0.0f32; frames];
        for split in Split::all(rate_hz, heard) {
            let frames = (self.end_s(split.band) * rate_hz) as usize;
            let noise = &mut noise[..frames];
            split.noise(random, noise)?;
            let envelope = |frame: usize| {
                let end = 1.0 - frame as f64 / frames as f64;
                let fade = if end < FADE { 0.5 - 0.5 * (PI * end / FADE).cos() } else { 1.0 };
                fade * (self.band_energy_per_s(split.band, frame as f64 / rate_hz) / rate_hz).sqrt()
            };
            self.settle(&split, rate_hz, envelope, noise);
            tail.iter_mut().zip(noise).for_each(|(sum, value)| *sum += *value);
        }
        Ok(tail)
    }

    /// Gives noise its envelope, and sees to it that its decay and energy are those of the envelope: noise of a low
    /// band has but few ups and downs, which would tilt it by chance.
    fn settle(&self, split: &Split, rate_hz: f64, envelope: impl Fn(usize) -> f64, noise: &mut [f32]) {
        let bin = (rate_hz / 1000.0).round() as usize;
        let energy = split.energy();
        let mut expected = vec![0.0f64; noise.len().div_ceil(bin)];
        for (frame, value) in noise.iter_mut().enumerate() {
            let envelope = envelope(frame);
            *value *= envelope as f32;
            expected[frame / bin] += energy * envelope * envelope;
        }
        let found: Vec<f64> =
            noise.chunks(bin).map(|bin| bin.iter().map(|v| f64::from(*v).powi(2)).sum()).collect();
        // No finer than noise of this width has ups and downs at all.
        let evened_s = (self.times_s[split.band] * EVENED).max(2.0 / split.width_hz);
        let gains = evened(&expected, found, ((0.5e3 * evened_s) as usize).max(1));
        for (frame, value) in noise.iter_mut().enumerate() {
            let place = (frame as f64 / bin as f64 - 0.5).max(0.0);
            let (index, part) = (place as usize, place.fract());
            let from = gains[index];
            let to = gains.get(index + 1).copied().unwrap_or(from);
            *value *= (from + part * (to - from)) as f32;
        }
    }
}

/// The gains that give bins of some energies others, smoothly over stretches of two `hop`s, and the same total.
fn evened(expected: &[f64], mut found: Vec<f64>, hop: usize) -> Vec<f64> {
    let mut gains = vec![1.0; found.len()];
    let total: f64 = expected.iter().sum();
    let nodes = found.len() / hop + 2;
    for _ in 0..TURNS {
        let mut ratios = vec![(0.0, 0.0); nodes];
        for (index, (expected, found)) in expected.iter().zip(&found).enumerate() {
            let (node, part) = (index / hop, (index % hop) as f64 / hop as f64);
            for (node, weight) in [(node, 1.0 - part), (node + 1, part)] {
                ratios[node].0 += weight * expected;
                ratios[node].1 += weight * found;
            }
        }
        let ratios: Vec<f64> = ratios
            .into_iter()
            .map(|(expected, found)| if found > 0.0 { (expected / found).clamp(0.25, 4.0) } else { 1.0 })
            .collect();
        let mut sum = 0.0;
        for (index, (gain, found)) in gains.iter_mut().zip(&mut found).enumerate() {
            let (node, part) = (index / hop, (index % hop) as f64 / hop as f64);
            let ratio = ratios[node] + part * (ratios[node + 1] - ratios[node]);
            *gain *= ratio;
            *found *= ratio;
            sum += *found;
        }
        if sum > 0.0 {
            gains.iter_mut().chain(&mut found).for_each(|value| *value *= total / sum);
        }
    }
    gains.into_iter().map(f64::sqrt).collect()
}

/// Noise is evened out over this part of the reverberation time, in which it falls by 5 dB.
const EVENED: f64 = 1.0 / 12.0;

/// How often the energies are measured and evened out.
const TURNS: usize = 6;

#[cfg(test)]
mod tests;
