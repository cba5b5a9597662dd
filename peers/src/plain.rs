//! The plainest work: recordings in loops, with a gain and a pan each, and nothing that moves.

use std::f64::consts::TAU;
use std::sync::Arc;

use froufrou::random::Random;
use froufrou::synth::sinc::Kernel;

use crate::measure::{self, Cost};
use crate::options::Options;
use crate::peers::froufrou::Worker;
use crate::peers::{self, Rendering, Result, kira, oddio};
use crate::world::{AMPLITUDE, RATE_HZ, Sound};

/// So long is listened to at once at most, in seconds.
const LISTENED_S: f64 = 1.5;

/// How long a recording is, in seconds.
const SECONDS: usize = 3;

/// Frames rendered at a time: as many as a device asks for that is quick.
pub const BLOCK: usize = 128;

/// What a voice plays and how.
#[derive(Debug, Clone, Copy)]
pub struct PlainVoice {
    /// The sample of the recording at which it begins.
    pub offset: usize,
    pub gain: f64,
    /// From the left, −1, to the right, 1.
    pub pan: f64,
}

impl PlainVoice {
    /// What is heard of it on the left and on the right: by the square roots of their parts.
    pub fn gains(&self) -> [f64; 2] {
        [0.5 - 0.5 * self.pan, 0.5 + 0.5 * self.pan].map(|part| self.gain * part.sqrt())
    }
}

/// What is asked of every peer.
#[derive(Debug, Clone)]
pub struct Plain {
    pub sound: Sound,
    /// Its rate.
    pub rate_hz: u32,
    pub speed: f64,
    pub voices: Vec<PlainVoice>,
    /// How long they are rendered between two preparations, in seconds.
    pub lasts_s: f64,
}

/// The ways a recording is read: its rate, the speed, and what that is.
const READINGS: [(u32, f64, &str); 3] = [
    (RATE_HZ, 1.0, "48 kHz at speed 1: nothing to interpolate"),
    (44_100, 1.0, "44.1 kHz at speed 1"),
    (RATE_HZ, 1.1, "48 kHz at speed 1.1"),
];

impl Plain {
    fn noise(voices: usize, rate_hz: u32, speed: f64) -> Self {
        let random = Random::new(3, 0);
        let samples = SECONDS as u64 * u64::from(rate_hz);
        let sound = (0..samples).map(|i| ((random.uniform(i) * 2.0 - 1.0) * AMPLITUDE) as f32).collect();
        let random = Random::new(4, 0);
        let voice = |i: u64| PlainVoice {
            offset: (random.uniform(3 * i) * samples as f64) as usize,
            gain: 0.2 + 0.8 * random.uniform(3 * i + 1),
            pan: 1.8 * random.uniform(3 * i + 2) - 0.9,
        };
        let voices = (0..voices as u64).map(voice).collect();
        Self { sound, rate_hz, speed, voices, lasts_s: LISTENED_S }
    }

    /// One voice plays a sine whose periods fit into the loop.
    fn tone(rate_hz: u32, speed: f64, tone_hz: usize) -> Self {
        let length = rate_hz as usize;
        let at = |i: usize| (TAU * (tone_hz * i % length) as f64 / length as f64).sin();
        let sound: Arc<[f32]> = (0..length).map(|i| (at(i) * AMPLITUDE) as f32).collect();
        let voices = vec![PlainVoice { offset: 0, gain: 1.0, pan: 0.0 }];
        Self { sound, rate_hz, speed, voices, lasts_s: LISTENED_S }
    }
}

/// Who plays plain voices.
struct Row {
    name: &'static str,
    /// Whether it reads otherwise than the rows before it.
    reads: bool,
    start: fn(&Plain) -> Result<Box<dyn Rendering>>,
}

const ROWS: [Row; 9] = [
    Row {
        name: "froufrou",
        reads: true,
        start: |plain| peers::froufrou::plain(plain, Kernel::Long, Worker::Beside(128)),
    },
    Row {
        name: "froufrou, slices of 512",
        reads: false,
        start: |plain| peers::froufrou::plain(plain, Kernel::Long, Worker::Beside(512)),
    },
    Row {
        name: "froufrou, audio thread",
        reads: false,
        start: |plain| peers::froufrou::plain(plain, Kernel::Long, Worker::Before),
    },
    Row {
        name: "froufrou-short, slices of 512",
        reads: true,
        start: |plain| peers::froufrou::plain(plain, Kernel::Short, Worker::Beside(512)),
    },
    Row {
        name: "froufrou-short, audio thread",
        reads: false,
        start: |plain| peers::froufrou::plain(plain, Kernel::Short, Worker::Before),
    },
    Row {
        name: "froufrou-line, slices of 512",
        reads: true,
        start: |plain| peers::froufrou::plain(plain, Kernel::Line, Worker::Beside(512)),
    },
    Row {
        name: "froufrou-line, audio thread",
        reads: false,
        start: |plain| peers::froufrou::plain(plain, Kernel::Line, Worker::Before),
    },
    Row { name: "oddio", reads: true, start: oddio::plain },
    Row { name: "kira", reads: true, start: kira::plain },
];

/// Prints what plain voices cost, and how well each peer reads them.
pub fn compare(options: &Options) -> Result<()> {
    let plan = options.plan;
    let numbers: Vec<String> = options.voices.iter().map(|n| format!("{n} voices")).collect();
    for (rate_hz, speed, what) in READINGS {
        let mut costs: Vec<Vec<Cost>> = ROWS.iter().map(|_| Vec::new()).collect();
        for &voices in &options.voices {
            let plain = Plain { lasts_s: plan.seconds, ..Plain::noise(voices, rate_hz, speed) };
            let renderings = ROWS.iter().map(|row| (row.start)(&plain)).collect::<Result<Vec<_>>>()?;
            for (row, cost) in costs.iter_mut().zip(measure::plain(renderings, voices, plan)?) {
                row.push(cost);
            }
        }
        println!("| ns per voice and frame: {what} | {} |", numbers.join(" | "));
        println!("| --- |{}", " --- |".repeat(numbers.len()));
        for (row, costs) in ROWS.iter().zip(&costs) {
            let cells: Vec<String> = costs.iter().map(|cost| format!("{:.2}", cost.median_ns)).collect();
            println!("| {} | {} |", row.name, cells.join(" | "));
        }
        println!();
    }
    let tones_hz = [100, 1000, 5000, 10_000, 15_000];
    let titles: Vec<String> = tones_hz.iter().map(|hz| format!("{hz} Hz")).collect();
    println!("| level / what is not the tone, in dB: 44.1 kHz at speed 1 | {} |", titles.join(" | "));
    println!("| --- |{}", " --- |".repeat(titles.len()));
    for row in ROWS.iter().filter(|row| row.reads) {
        let cell = |hz: &usize| {
            let [level_db, rest_db] = purity(&mut *(row.start)(&Plain::tone(44_100, 1.0, *hz))?, *hz as f64)?;
            Ok(format!("{level_db:+.1} / {rest_db:.0}"))
        };
        let cells = tones_hz.iter().map(cell).collect::<Result<Vec<_>>>()?;
        println!("| {} | {} |", row.name, cells.join(" | "));
    }
    println!();
    Ok(())
}

/// How loud a tone comes out that went in at full level, and all that is not this tone beside it, in decibels: by least
/// squares on sine and cosine, over half a second.
pub fn purity(rendering: &mut dyn Rendering, tone_hz: f64) -> Result<[f64; 2]> {
    const WINDOW: usize = RATE_HZ as usize / 2;
    let mut heard = Vec::new();
    rendering.prepare()?;
    let mut block = [[0.0; 2]; BLOCK];
    while heard.len() < 2 * WINDOW {
        rendering.render(&mut block)?;
        heard.extend(block.iter().map(|frame| f64::from(frame[0])));
    }
    let (mut ss, mut sc, mut cc, mut sy, mut cy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    let turn = |n: usize| (TAU * tone_hz * n as f64 / f64::from(RATE_HZ)).sin_cos();
    let window = &heard[WINDOW..2 * WINDOW];
    for (n, y) in window.iter().enumerate() {
        let (s, c) = turn(n);
        (ss, sc, cc, sy, cy) = (ss + s * s, sc + s * c, cc + c * c, sy + s * y, cy + c * y);
    }
    let det = ss * cc - sc * sc;
    let (a, b) = ((cc * sy - sc * cy) / det, (ss * cy - sc * sy) / det);
    let rest = |(n, y): (usize, &f64)| {
        let (s, c) = turn(n);
        (y - a * s - b * c).powi(2)
    };
    let rest: f64 = window.iter().enumerate().map(rest).sum::<f64>() / WINDOW as f64;
    let power = 0.5 * (a * a + b * b);
    let expected = 0.5 * (AMPLITUDE * 0.5f64.sqrt()).powi(2);
    Ok([10.0 * (power / expected).log10(), 10.0 * (rest / power).log10()])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_play_the_same_voices() {
        for row in ROWS.iter().filter(|row| row.reads) {
            for (rate_hz, speed, what) in READINGS {
                let mut plain = Plain::tone(rate_hz, speed, 1000);
                let [_, rest_db] = purity(&mut *(row.start)(&plain).unwrap(), 1000.0 * speed).unwrap();
                assert!(rest_db < -50.0, "{}, {what}: {rest_db} dB", row.name);
                plain.voices[0].pan = 0.6;
                let mut rendering = (row.start)(&plain).unwrap();
                rendering.prepare().unwrap();
                let (mut block, mut energy) = ([[0.0f32; 2]; BLOCK], [0.0; 2]);
                for _ in 0..200 {
                    rendering.render(&mut block).unwrap();
                    for (energy, n) in energy.iter_mut().zip(0..) {
                        *energy += block.iter().map(|frame| f64::from(frame[n]).powi(2)).sum::<f64>();
                    }
                }
                let louder = energy[1] / energy[0];
                assert!((3.96..4.04).contains(&louder), "{}, {what}: {louder}", row.name);
            }
        }
    }
}
