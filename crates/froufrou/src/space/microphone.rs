//! What a microphone hears of a source at some place.

use crate::score::MicrophoneShape;

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

/// Euclidean length.
pub(crate) fn length([x, y, z]: [f64; 3]) -> f64 {
    (x * x + y * y + z * z).sqrt()
}
