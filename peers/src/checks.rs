//! Whether a peer renders what it is said to: all voices, where they are, and by which means.
//!
//! Each check listens to what comes out; nothing is taken from documentation.

use std::f64::consts::TAU;

use crate::drive::Drive;
use crate::peers::{Kind, Peer, Result};
use crate::world::{AMPLITUDE, Motion, RATE_HZ, SPEED_OF_SOUND, TICK_FRAMES, Voice, World, noise, tone};

/// What was heard of a peer.
#[derive(Debug, Clone, Copy)]
pub struct Heard {
    /// How many of as many voices were heard.
    pub voices: [usize; 2],
    /// How far the near ear was louder, in decibels, on the average of a turn: where the voice was to the right, and
    /// where it was to the left.
    pub sides_db: [f64; 2],
    /// From the right: how much earlier the right ear hears it, in microseconds.
    pub earlier_us: f64,
    /// From the right: how much louder the right ear hears it, in decibels, at 300 to 800 Hz and at 5 to 10 kHz.
    pub louder_db: [f64; 2],
    /// How many hertz higher a tone of 1 kHz is heard that comes nearer by 20 m/s.
    pub doppler_hz: f64,
    /// By how much later it is heard from 17.15 m than from 1.715 m away, in milliseconds; the way takes 45 ms.
    pub delay_ms: f64,
}

/// By how much higher a voice of 1 kHz may be heard that comes nearer by 20 m/s: not at all, to the first order in
/// its speed, or as it is.
const DOPPLER_HZ: [f64; 3] = [0.0, 1000.0 * 20.0 / SPEED_OF_SOUND, 1000.0 * 20.0 / (SPEED_OF_SOUND - 20.0)];

/// Listens to a peer, with so many voices at once.
pub fn listen(peer: &dyn Peer, voices: usize, block: usize) -> Result<Heard> {
    let (earlier_us, louder_db) = from_the_right(peer, block)?;
    Ok(Heard {
        voices: [audible(peer, voices, block)?, voices],
        sides_db: sides(peer, block)?,
        earlier_us,
        louder_db,
        doppler_hz: doppler(peer, block)?,
        delay_ms: delay(peer, block)?,
    })
}

impl Heard {
    /// What is wrong with it for what it is compared with.
    pub fn faults(&self, kind: Kind) -> Vec<String> {
        let mut faults = Vec::new();
        let mut expect = |holds: bool, what: &str| {
            if !holds {
                faults.push(what.to_string());
            }
        };
        expect(self.voices[0] == self.voices[1], "not all voices are heard");
        expect(self.sides_db.iter().all(|db| *db > 3.0), "the near ear is not the louder one");
        let doppler = DOPPLER_HZ.iter().any(|hz| (self.doppler_hz - hz).abs() < 0.5);
        expect(doppler, "what comes nearer is neither as high as Doppler says nor as it is");
        let delay = self.delay_ms.abs() < 1.0 || (self.delay_ms - 45.0).abs() < 1.0;
        expect(delay, "the way takes neither its time nor none");
        if kind == Kind::Binaural {
            expect((450.0..1000.0).contains(&self.earlier_us), "the ears are not a head apart in time");
            let shadow = self.louder_db[1] - self.louder_db[0];
            expect(shadow > 6.0, "the head casts no shadow that grows with frequency");
        }
        faults
    }
}

/// How many of so many voices are heard at once. Each stands still and plays a sine of its own that fits a window
/// of 4000 frames, so that none leaks into another's place in the spectrum.
fn audible(peer: &dyn Peer, voices: usize, block: usize) -> Result<usize> {
    const WINDOW: usize = 4000;
    const LOWEST: usize = 20;
    let voice = |i: usize| {
        let (sin, cos) = (TAU * i as f64 / voices as f64).sin_cos();
        let motion = Motion::still([2.0 * sin, 0.0, -2.0 * cos]);
        Voice { motion, sound: i, offset: 0 }
    };
    let sounds = (0..voices).map(|i| tone(LOWEST + i, WINDOW)).collect();
    let world = World { sounds, voices: (0..voices).map(voice).collect(), block };
    let ears = Drive::start(peer, &world)?.hear(RATE_HZ as usize)?;
    let ears = ears.map(|ear| ear[ear.len() - WINDOW..].to_vec());
    let loud = |i: &usize| {
        let amplitude = |ear: &Vec<f64>| 2.0 / WINDOW as f64 * bin(ear, LOWEST + i, WINDOW).sqrt();
        ears.iter().map(amplitude).fold(0.0, f64::max) > 0.05 * AMPLITUDE
    };
    Ok((0..voices).filter(loud).count())
}

/// A noise goes around twice.
fn sides(peer: &dyn Peer, block: usize) -> Result<[f64; 2]> {
    let motion = Motion::Circle { centre: [0.0; 3], radius: 2.0, turns_per_s: 0.5, phase: 0.0 };
    let seconds = 4 * RATE_HZ as usize;
    let ears = Drive::start(peer, &World::single(motion, noise(), block))?.hear(seconds)?;
    let mut energy = [[0.0; 2]; 2];
    let pieces = ears[0].chunks_exact(TICK_FRAMES as usize).zip(ears[1].chunks_exact(TICK_FRAMES as usize));
    for (tick, (left, right)) in pieces.enumerate() {
        let [x, _, _] = motion.position(tick as f64 * TICK_FRAMES as f64 / f64::from(RATE_HZ));
        // Clearly at a side.
        if x.abs() > 1.4 {
            let [near, far] = if x > 0.0 { [right, left] } else { [left, right] };
            let side = &mut energy[usize::from(x < 0.0)];
            side[0] += near.iter().map(|s| s * s).sum::<f64>();
            side[1] += far.iter().map(|s| s * s).sum::<f64>();
        }
    }
    Ok(energy.map(|[near, far]| decibels(near, far)))
}

/// A noise stands at the right: how much earlier (µs) and louder (dB, low and high) the right ear hears it.
fn from_the_right(peer: &dyn Peer, block: usize) -> Result<(f64, [f64; 2])> {
    const WINDOW: usize = 8000;
    let world = World::single(Motion::still([2.0, 0.0, 0.0]), noise(), block);
    let ears = Drive::start(peer, &world)?.hear(RATE_HZ as usize)?;
    let [left, right] = ears.map(|ear| ear[ear.len() - 2 * WINDOW..].to_vec());
    let product = |lag: i64| -> f64 {
        let of = WINDOW as i64 / 2;
        (0..WINDOW as i64).map(|n| left[(n + of + lag) as usize] * right[(n + of) as usize]).sum()
    };
    let lag = (-100..=100).max_by(|&a, &b| product(a).total_cmp(&product(b))).unwrap_or(0);
    let band = |ear: &[f64], low_hz: usize, high_hz: usize| -> f64 {
        let width_hz = RATE_HZ as usize / WINDOW;
        (low_hz / width_hz..high_hz / width_hz).map(|k| bin(ear, k, WINDOW)).sum()
    };
    let louder = |low_hz, high_hz| decibels(band(&right, low_hz, high_hz), band(&left, low_hz, high_hz));
    Ok((lag as f64 * 1e6 / f64::from(RATE_HZ), [louder(300, 800), louder(5000, 10_000)]))
}

/// How much higher than 1 kHz it is what comes nearer from ahead by 20 m/s, between 1.5 and 2 s.
fn doppler(peer: &dyn Peer, block: usize) -> Result<f64> {
    let motion = Motion::Line { from: [0.0, 0.0, -100.0], velocity: [0.0, 0.0, 20.0] };
    let world = World::single(motion, tone(1000, RATE_HZ as usize), block);
    let [left, _] = Drive::start(peer, &world)?.hear(2 * RATE_HZ as usize)?;
    let heard = &left[3 * RATE_HZ as usize / 2..];
    let upward = |n: &usize| heard[*n] < 0.0 && heard[n + 1] >= 0.0;
    let crossings: Vec<usize> = (0..heard.len() - 1).filter(upward).collect();
    let [Some(first), Some(last)] = [crossings.first(), crossings.last()] else {
        return Err("nothing is heard of what comes nearer".into());
    };
    let moment = |n: usize| n as f64 + heard[n] / (heard[n] - heard[n + 1]);
    let periods = (crossings.len() - 1) as f64;
    Ok(periods * f64::from(RATE_HZ) / (moment(*last) - moment(*first)) - 1000.0)
}

/// How much later a noise is heard from far away.
fn delay(peer: &dyn Peer, block: usize) -> Result<f64> {
    let sound = noise();
    let length = sound.len();
    let lag = |distance: f64| -> Result<i64> {
        let world = World::single(Motion::still([0.0, 0.0, -distance]), sound.clone(), block);
        let [left, _] = Drive::start(peer, &world)?.hear(length + 4000)?;
        let heard = &left[length..];
        let product = |lag: i64| -> f64 {
            // The loop has gone around once.
            let at = |n: usize| (n as i64 - lag).rem_euclid(length as i64) as usize;
            heard.iter().enumerate().map(|(n, s)| s * f64::from(sound[at(n)])).sum::<f64>().abs()
        };
        Ok((-200..3200).max_by(|&a, &b| product(a).total_cmp(&product(b))).unwrap_or(0))
    };
    Ok((lag(17.15)? - lag(1.715)?) as f64 * 1000.0 / f64::from(RATE_HZ))
}

/// The energy at so many turns in a window.
fn bin(samples: &[f64], turns: usize, window: usize) -> f64 {
    let mut sum = [0.0; 2];
    for (n, sample) in samples[samples.len() - window..].iter().enumerate() {
        let (sin, cos) = (TAU * (turns * n % window) as f64 / window as f64).sin_cos();
        sum = [sum[0] + sample * cos, sum[1] + sample * sin];
    }
    sum[0] * sum[0] + sum[1] * sum[1]
}

fn decibels(energy: f64, beside: f64) -> f64 {
    10.0 * (energy / beside).log10()
}
