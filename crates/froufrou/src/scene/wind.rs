//! The wind that blows through a scene: one direction, with gusts.

use super::file::Wind;
use super::wander::Wander;
use crate::random::Random;

/// The wind at every moment.
#[derive(Debug, Clone)]
pub struct WindField {
    wind: Wind,
    gusts: Wander,
}

/// Keeps the random numbers of the wind apart from others of the same seed.
const GUSTS: u64 = u64::MAX - 1;

impl WindField {
    /// The wind of a scene with a seed.
    pub fn new(wind: Wind, seed: u64) -> Self {
        // From gust to gust is a wave of its mean frequency.
        let rate = std::f64::consts::TAU / wind.gust_period_s;
        Self { wind, gusts: Wander::new(Random::new(seed, GUSTS), 0, rate) }
    }

    /// Its velocity at a time, in metres a second. It may fall calm, but does not turn.
    pub fn velocity_mps(&self, time_s: f64) -> [f64; 3] {
        let strength = (1.0 + self.wind.gusts * self.gusts.at(time_s)).max(0.0);
        self.wind.velocity_mps.map(|c| c * strength)
    }

    /// Whether it changes.
    pub fn changes(&self) -> bool {
        self.wind.gusts > 0.0 && self.wind.velocity_mps != [0.0; 3]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gusts_vary_the_speed_about_its_mean() {
        let wind = Wind { velocity_mps: [6.0, 0.0, -8.0], gusts: 0.2, gust_period_s: 3.0 };
        let field = WindField::new(wind, 1);
        let speeds: Vec<f64> = (0..20_000)
            .map(|step| field.velocity_mps(f64::from(step) * 0.1))
            .map(|[x, y, z]| (x * x + y * y + z * z).sqrt())
            .collect();
        let mean = speeds.iter().sum::<f64>() / speeds.len() as f64;
        let deviation = (speeds.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / speeds.len() as f64).sqrt();
        assert!((mean - 10.0).abs() < 0.1, "{mean}");
        assert!((deviation - 2.0).abs() < 0.1, "{deviation}");
        assert!(field.changes() && !WindField::new(Wind { gusts: 0.0, ..wind }, 1).changes());
    }
}
