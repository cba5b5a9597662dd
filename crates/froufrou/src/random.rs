//! Randomness is addressed, not drawn: every random number is a function of where it is used.
//!
//! A generator with a hidden state would make a sound depend on how many numbers were drawn before
//! it, and so on the number of threads and on the range rendered. Here a number depends on
//! (seed, thread, index) alone.

/// A number generator for one thread of sound.
///
/// ```
/// use froufrou::random::Random;
/// let random = Random::new(7, 3);
/// assert_eq!(random.bits(5), Random::new(7, 3).bits(5));
/// assert_ne!(random.bits(5), random.bits(6));
/// assert!((0.0..1.0).contains(&random.uniform(5)));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Random {
    key: u64,
}

/// The finaliser of SplitMix64 (Steele, Lea & Flood 2014): a bijection of 64 bits that passes
/// BigCrush on counters.
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The odd increment of SplitMix64, 2⁶⁴ divided by the golden ratio.
const STEP: u64 = 0x9e37_79b9_7f4a_7c15;

impl Random {
    /// The generator of one thread (or of any other numbered thing) under a scene's seed.
    pub fn new(seed: u64, thread: u64) -> Self {
        Self { key: mix(mix(seed.wrapping_add(STEP)).wrapping_add(thread.wrapping_mul(STEP))) }
    }

    /// 64 random bits at an index.
    pub fn bits(self, index: u64) -> u64 {
        mix(self.key.wrapping_add(index.wrapping_add(1).wrapping_mul(STEP)))
    }

    /// A number in [0, 1), uniform, at an index.
    pub fn uniform(self, index: u64) -> f64 {
        (self.bits(index) >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// A number at an index that is normally distributed, with mean 0 and variance 1.
    pub fn normal(self, index: u64) -> f64 {
        // Box and Muller's transform of two halves of a generator of its own.
        let pair = Self { key: self.bits(index) };
        let length = (-2.0 * (1.0 - pair.uniform(0)).ln()).sqrt();
        length * (std::f64::consts::TAU * pair.uniform(1)).cos()
    }

    /// A number in 0..n at an index; 0 where n is 0.
    pub fn below(self, index: u64, n: usize) -> usize {
        // Multiply-shift: bias below n / 2⁶⁴.
        ((u128::from(self.bits(index)) * n as u128) >> 64) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_has_the_moments_of_a_normal_distribution() {
        let n = 100_000;
        let random = Random::new(3, 9);
        let moment = |power: i32| (0..n).map(|i| random.normal(i).powi(power)).sum::<f64>() / n as f64;
        for (power, expected, error) in [(1, 0.0, 0.01), (2, 1.0, 0.02), (3, 0.0, 0.05), (4, 3.0, 0.1)] {
            assert!((moment(power) - expected).abs() < error, "{power}: {}", moment(power));
        }
        let serial = (0..n).map(|i| random.normal(i) * random.normal(i + 1)).sum::<f64>() / n as f64;
        assert!(serial.abs() < 0.01, "{serial}");
    }

    #[test]
    fn uniform_has_the_moments_of_a_uniform_distribution() {
        let n = 100_000;
        for (seed, thread) in [(0, 0), (0, 1), (1, 0), (u64::MAX, u64::MAX)] {
            let random = Random::new(seed, thread);
            let values: Vec<f64> = (0..n).map(|i| random.uniform(i)).collect();
            let mean = values.iter().sum::<f64>() / n as f64;
            let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n as f64;
            assert!((mean - 0.5).abs() < 0.005, "{mean}");
            assert!((variance - 1.0 / 12.0).abs() < 0.001, "{variance}");
            let serial = values.windows(2).map(|w| (w[0] - mean) * (w[1] - mean)).sum::<f64>() / n as f64;
            assert!(serial.abs() < 0.001, "{serial}");
        }
    }

    #[test]
    fn below_reaches_every_number_equally() {
        let random = Random::new(3, 4);
        let mut counts = [0usize; 7];
        for i in 0..70_000 {
            counts[random.below(i, 7)] += 1;
        }
        assert!(counts.iter().all(|&c| (9_500..10_500).contains(&c)), "{counts:?}");
        assert_eq!(random.below(0, 0), 0);
    }
}
