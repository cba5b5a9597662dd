//! What a microphone hears of a source at some place.

use crate::score::{MicrophoneShape, Pose};

/// Distance in metres below which a source grows no louder, and its direction fades away: within it
/// a microphone hears all around, so that a source may pass through.
pub const NEAR_M: f64 = 0.1;

/// The pressure gain of a microphone's directivity, `s(μ) = c + ((1 + cos μ) / 2)^k` scaled to 1 at
/// μ = 0 (Takala & Hahn 1992, §5.3).
///
/// ```
/// use froufrou::score::MicrophoneShape;
/// use froufrou::space::microphone::directivity;
/// let cardioid = MicrophoneShape { c: 0.0, k: 1.0 };
/// assert_eq!(directivity(cardioid, 1.0), 1.0);
/// assert_eq!(directivity(cardioid, -1.0), 0.0);
/// // Two of them back to back hear evenly all around.
/// assert_eq!(directivity(cardioid, 0.3) + directivity(cardioid, -0.3), 1.0);
/// ```
pub fn directivity(shape: MicrophoneShape, cos_mu: f64) -> f64 {
    let lobe = ((1.0 + cos_mu.clamp(-1.0, 1.0)) / 2.0).powf(shape.k);
    (shape.c + lobe) / (shape.c + 1.0)
}

/// The gain from a source with pressure 1 at 1 m to a microphone, and their distance in metres.
///
/// Pressure falls as 1 / distance (Takala & Hahn 1992, §5.1: intensity as its square).
pub fn gain_and_distance(shape: MicrophoneShape, microphone: &Pose, source_m: [f64; 3]) -> (f64, f64) {
    let to_source: [f64; 3] = std::array::from_fn(|i| source_m[i] - microphone.position_m[i]);
    let distance = length(to_source);
    let reach = distance.max(NEAR_M);
    let facing = length(microphone.facing);
    let along: f64 = (0..3).map(|i| to_source[i] * microphone.facing[i]).sum();
    let cos_mu = if facing > 0.0 { along / (facing * reach) } else { 0.0 };
    (directivity(shape, cos_mu) / reach, distance)
}

/// Euclidean length.
pub(crate) fn length([x, y, z]: [f64; 3]) -> f64 {
    (x * x + y * y + z * z).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gain_is_the_product_of_distance_and_direction() {
        let microphone = Pose { position_m: [1.0, 2.0, 3.0], facing: [0.0, 0.0, -7.0] };
        let omni = MicrophoneShape { c: 0.0, k: 0.0 };
        assert_eq!(gain_and_distance(omni, &microphone, [1.0, 2.0, 8.0]), (0.2, 5.0));
        let cardioid = MicrophoneShape { c: 0.0, k: 1.0 };
        assert_eq!(gain_and_distance(cardioid, &microphone, [1.0, 2.0, 8.0]), (0.0, 5.0));
        assert_eq!(gain_and_distance(cardioid, &microphone, [1.0, 2.0, -1.0]), (0.25, 4.0));
        let (gain, _) = gain_and_distance(MicrophoneShape { c: 1.0, k: 2.0 }, &microphone, [5.0, 2.0, 3.0]);
        assert!((gain - 0.25 * (1.0 + 0.25) / 2.0).abs() < 1e-15);
    }

    #[test]
    fn a_source_passes_through_a_microphone_smoothly() {
        let microphone = Pose { position_m: [0.0; 3], facing: [1.0, 0.0, 0.0] };
        let cardioid = MicrophoneShape { c: 0.0, k: 1.0 };
        let gains: Vec<f64> = (-1000..=1000)
            .map(|i| gain_and_distance(cardioid, &microphone, [f64::from(i) * 1e-3, 0.0, 0.0]).0)
            .collect();
        assert!(gains.iter().all(|g| g.is_finite() && (0.0..=10.0).contains(g)));
        assert!(gains.windows(2).all(|w| (w[1] - w[0]).abs() < 0.11), "no step of more than 1 %");
    }
}
