//! The work that is the same for all: voices, what they play, and how they move about one listener.
//!
//! The listener stands at the origin, looks to −Z and has its right ear at +X; metres and seconds.

use std::f64::consts::TAU;
use std::sync::Arc;

use froufrou::random::Random;

pub const RATE_HZ: u32 = 48_000;

/// How often each voice is told where it is.
pub const TICKS_HZ: u32 = 60;

/// Frames from one tick to the next.
pub const TICK_FRAMES: u64 = (RATE_HZ / TICKS_HZ) as u64;

/// Metres a second, for all that ask.
pub const SPEED_OF_SOUND: f64 = 343.0;

/// So soft that a thousand voices do not reach full scale, where kira clips.
pub const AMPLITUDE: f64 = 1e-3;

/// How a voice moves.
#[derive(Debug, Clone, Copy)]
pub enum Motion {
    /// Along a level circle; an angle of 0 is ahead of its centre, a quarter turn is to its right.
    Circle { centre: [f64; 3], radius: f64, turns_per_s: f64, phase: f64 },
    /// Along a line.
    Line { from: [f64; 3], velocity: [f64; 3] },
}

impl Motion {
    pub fn still(at: [f64; 3]) -> Self {
        Motion::Line { from: at, velocity: [0.0; 3] }
    }

    pub fn position(&self, time_s: f64) -> [f64; 3] {
        match *self {
            Motion::Circle { centre: [x, y, z], radius, turns_per_s, phase } => {
                let (sin, cos) = (TAU * (phase + turns_per_s * time_s)).sin_cos();
                [x + radius * sin, y, z - radius * cos]
            }
            Motion::Line { from, velocity } => std::array::from_fn(|i| from[i] + velocity[i] * time_s),
        }
    }

    pub fn velocity(&self, time_s: f64) -> [f64; 3] {
        match *self {
            Motion::Circle { radius, turns_per_s, phase, .. } => {
                let speed = radius * TAU * turns_per_s;
                let (sin, cos) = (TAU * (phase + turns_per_s * time_s)).sin_cos();
                [speed * cos, 0.0, speed * sin]
            }
            Motion::Line { velocity, .. } => velocity,
        }
    }
}

/// A mono recording that repeats without end.
pub type Sound = Arc<[f32]>;

/// One second of white noise.
pub fn noise() -> Sound {
    let random = Random::new(1, 0);
    (0..u64::from(RATE_HZ)).map(|i| ((random.uniform(i) * 2.0 - 1.0) * AMPLITUDE) as f32).collect()
}

/// A sine that goes so many times into so many frames.
pub fn tone(cycles: usize, frames: usize) -> Sound {
    let at = |i: usize| (TAU * (cycles * i % frames) as f64 / frames as f64).sin();
    (0..frames).map(|i| (at(i) * AMPLITUDE) as f32).collect()
}

#[derive(Debug, Clone)]
pub struct Voice {
    pub motion: Motion,
    /// Which of the world's sounds it plays.
    pub sound: usize,
    /// The frame of the sound at which it begins.
    pub offset: usize,
}

/// What is asked of every peer.
#[derive(Debug, Clone)]
pub struct World {
    /// Each is kept once, however many voices play it.
    pub sounds: Vec<Sound>,
    pub voices: Vec<Voice>,
    /// Frames that are rendered at a time.
    pub block: usize,
}

impl World {
    /// The voices that are measured: one noise, begun anywhere, on circles that lead once about the listener in two
    /// to five seconds and pass it at 1.5 to 6.5 m. The centres lie beside the listener, so that all come nearer
    /// and go away again.
    pub fn circling(voices: usize, block: usize) -> Self {
        let random = Random::new(2, 0);
        let voice = |i: usize| {
            let mut drawn = (0..8).map(|k| random.uniform(8 * i as u64 + k));
            let mut next = || drawn.next().unwrap_or(0.0);
            let direction = if i.is_multiple_of(2) { 1.0 } else { -1.0 };
            Voice {
                motion: Motion::Circle {
                    centre: [next() - 0.5, 2.0 * next() - 1.0, next() - 0.5],
                    radius: 2.5 + 3.0 * next(),
                    turns_per_s: direction * (0.2 + 0.3 * next()),
                    phase: next(),
                },
                sound: 0,
                offset: (next() * f64::from(RATE_HZ)) as usize,
            }
        };
        Self { sounds: vec![noise()], voices: (0..voices).map(voice).collect(), block }
    }

    /// One voice.
    pub fn single(motion: Motion, sound: Sound, block: usize) -> Self {
        Self { sounds: vec![sound], voices: vec![Voice { motion, sound: 0, offset: 0 }], block }
    }
}
