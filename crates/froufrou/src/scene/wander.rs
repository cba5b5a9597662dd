//! Smooth random motion that is a function of time: how swarms fly and wind blows. It can be asked
//! for any time in any order, and never repeats.

use crate::random::Random;

/// Waves of a wander. Five with frequencies that have nothing in common look aimless.
const WAVES: usize = 5;

/// A number that wanders about 0 with a standard deviation of 1.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Wander {
    /// Angular frequency in radians a second, and phase.
    waves: [(f64, f64); WAVES],
}

impl Wander {
    /// A wander whose rate of change has a standard deviation of `rate` a second. `index` tells apart
    /// the wanders that follow from one generator.
    pub(crate) fn new(random: Random, index: u64, rate: f64) -> Self {
        let draw = |wave: usize, part: u64| random.uniform((index * WAVES as u64 + wave as u64) * 2 + part);
        let frequencies: [f64; WAVES] = std::array::from_fn(|wave| 0.4 + 1.2 * draw(wave, 0));
        let mean_square = frequencies.iter().map(|f| f * f).sum::<f64>() / WAVES as f64;
        let scale = rate / mean_square.sqrt();
        let waves =
            std::array::from_fn(|wave| (frequencies[wave] * scale, std::f64::consts::TAU * draw(wave, 1)));
        Self { waves }
    }

    /// Its value at a time.
    pub(crate) fn at(&self, time_s: f64) -> f64 {
        let sum: f64 = self.waves.iter().map(|&(omega, phase)| (omega * time_s + phase).cos()).sum();
        sum * (2.0 / WAVES as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_wanders_as_far_and_as_fast_as_it_was_told() {
        for rate in [0.1, 1.0, 7.0] {
            let (mut square, mut speed, mut count) = (0.0, 0.0, 0.0);
            for index in 0..40 {
                let wander = Wander::new(Random::new(3, 9), index, rate);
                for step in 0..2000 {
                    let time = f64::from(step) * 0.37 / rate;
                    let h = 1e-4 / rate;
                    square += wander.at(time).powi(2);
                    speed += ((wander.at(time + h) - wander.at(time - h)) / (2.0 * h)).powi(2);
                    count += 1.0;
                }
            }
            assert!((square / count - 1.0).abs() < 0.05, "{}", square / count);
            assert!(((speed / count).sqrt() / rate - 1.0).abs() < 0.05, "{}", (speed / count).sqrt());
        }
    }
}
