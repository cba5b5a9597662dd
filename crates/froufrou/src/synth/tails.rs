//! The reverberation of a room as a bus: what is sent into it sounds on in the channels of a soundtrack.
//!
//! Plain channels have tails of their own, as loud as they hear what comes from all around, and independent of each
//! other. To both ears of a head the same sounds come from directions that are spread evenly over the sphere,
//! so that they are alike at low frequencies, as in a real room.

use super::bus::{Bus, Feed, Response};
use super::filter::{Filter, Memory, convolve};
use crate::Result;
use crate::space::head::Head;
use crate::space::reverberation::Reverberation;
use crate::space::sphere::even_directions;

/// From so many directions a tail comes to a head.
const DIRECTIONS: usize = 12;

/// From so far away, in metres: where a head's filters change no more.
const FAR_M: f64 = 1000.0;

/// Random numbers of tails to heads lie behind those of plain channels.
const HEADS: u64 = 1 << 32;

/// What hears a tail.
pub(crate) enum Hearing<'a> {
    /// A channel, by its number, that hears it so loud.
    Channel(usize, f64),
    /// A head whose ears are two channels, by their numbers, and how loud it is there.
    Head([usize; 2], [f64; 2], &'a Head),
}

/// A bus of one lane into which sources go with the pressure that they have 1 m away.
pub(crate) fn bus(
    reverberation: &Reverberation,
    rate_hz: f64,
    seed: u64,
    all: &[Hearing<'_>],
) -> Result<Bus> {
    let mut responses: Vec<Response> = Vec::new();
    for hearing in all {
        match hearing {
            Hearing::Channel(channel, level) => {
                let mut tail = reverberation.tail(rate_hz, seed, *channel as u64)?;
                tail.iter_mut().for_each(|value| *value *= *level as f32);
                responses.push((*channel, tail));
            }
            Hearing::Head(channels, levels, head) => {
                let first = HEADS + (channels[0] * DIRECTIONS) as u64;
                let ears = at_ears(reverberation, rate_hz, (seed, first), head)?;
                for ((channel, level), mut ear) in channels.iter().zip(levels).zip(ears) {
                    ear.iter_mut().for_each(|value| *value *= *level as f32);
                    responses.push((*channel, ear));
                }
            }
        }
    }
    Bus::new(Feed::Even, &[responses], 0)
}

fn at_ears(
    reverberation: &Reverberation,
    rate_hz: f64,
    (seed, first): (u64, u64),
    head: &Head,
) -> Result<[Vec<f32>; 2]> {
    let mut ears = [Vec::new(), Vec::new()];
    let part = (1.0 / DIRECTIONS as f64).sqrt();
    let mut memory = Memory::default();
    let (mut left, mut right) = (vec![0.0; head.taps()], vec![0.0; head.taps()]);
    for (number, direction) in (0..).zip(even_directions(DIRECTIONS)) {
        let mut tail = reverberation.tail(rate_hz, seed, first + number)?;
        tail.iter_mut().for_each(|value| *value *= part as f32);
        let from_m = direction.map(|c| c * FAR_M);
        let arrivals = head.hear(from_m, [&mut left, &mut right]);
        for ((ear, arrival), taps) in ears.iter_mut().zip(arrivals).zip([&left, &right]) {
            let taps: Box<[f32]> = taps.iter().map(|tap| tap * arrival.gain as f32).collect();
            ear.resize(tail.len() + taps.len(), 0.0);
            // Nothing is lost before the beginning: a tail begins with silence. Whole samples do for noise.
            let late = (arrival.delay_s * rate_hz).round() as i64;
            let filter = Filter::new(taps, 0);
            let heard = convolve(&[(&tail, &filter)], &mut memory);
            let begin = late - head.lead() as i64;
            let heard = heard.iter().skip((-begin).max(0) as usize);
            ear.iter_mut().skip(begin.max(0) as usize).zip(heard).for_each(|(ear, heard)| *ear += heard);
        }
    }
    Ok(ears)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::air::Medium;
    use crate::space::room::{Room, Walls};

    fn energy(samples: &[f32]) -> f64 {
        samples.iter().map(|s| f64::from(*s).powi(2)).sum()
    }

    #[test]
    fn ears_hear_a_tail_as_loud_as_it_is_and_alike_at_low_frequencies() {
        let room = Room::new([0.0; 3], [7.0, 3.0, 5.0], 0.0, &Walls::all([0.2; 8])).unwrap();
        let reverberation = Reverberation::new(&room, &Medium::default(), 2).unwrap();
        let rate_hz = 48_000.0;
        let plain = energy(&reverberation.tail(rate_hz, 1, 0).unwrap());
        let head = Head::spherical(rate_hz);
        let [left, right] = at_ears(&reverberation, rate_hz, (1, HEADS), &head).unwrap();
        // A sphere is heard louder by what is at its ear's side and softer by what is not: within a few decibels.
        for ear in [&left, &right] {
            let level_db = 10.0 * (energy(ear) / plain).log10();
            assert!(level_db.abs() < 3.0, "{level_db}");
        }
        // Below 200 Hz waves are longer than a head: a moving mean of 2.5 ms is a low pass.
        let low = |samples: &[f32]| -> Vec<f32> {
            samples.chunks(120).map(|chunk| chunk.iter().sum::<f32>() / 120.0).collect()
        };
        let alike = |a: &[f32], b: &[f32]| {
            let product: f64 = a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum();
            product / (energy(a) * energy(b)).sqrt()
        };
        let (at_low, at_all) = (alike(&low(&left), &low(&right)), alike(&left, &right));
        assert!(at_low > 0.7 && at_all.abs() < 0.45, "{at_low} {at_all}");
        let other = reverberation.tail(rate_hz, 1, 1).unwrap();
        assert!(alike(&reverberation.tail(rate_hz, 1, 0).unwrap(), &other).abs() < 0.1);
    }
}
