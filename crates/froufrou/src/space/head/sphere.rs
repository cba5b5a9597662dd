//! A head as a sphere: the way of sound about it, and its shadow.
//!
//! Brown & Duda (1998), "A structural model for binaural sound synthesis": sound reaches an ear straight, or
//! along the surface where the head is in the way; and a filter with one pole and one zero makes high frequencies louder on the near side and softer on the far side. With θ the angle between the
//! source and the ear's own axis, ω₀ = c / a:
//!
//! H(ω, θ) = (1 + jα(θ) ω / 2ω₀) / (1 + jω / 2ω₀),  α(θ) = 1 + α₀/2 + (1 − α₀/2) cos(180° θ / 150°), α₀ = 0.1

use realfft::RealFftPlanner;
use realfft::num_complex::Complex;

/// The radius of a head in metres.
pub(super) const RADIUS_M: f64 = 0.0875;

/// The speed of sound that delays about a head are made with, in metres a second.
pub(super) const SPEED_OF_SOUND_MPS: f64 = 343.0;

/// The α at the angle where the shadow is deepest.
const ALPHA_LEAST: f64 = 0.1;

/// The angle where the shadow is deepest; right behind the head it is brighter.
const DARKEST_DEG: f64 = 150.0;

/// By how much the way to an ear is longer than that to the head's centre, in metres, for a source at a
/// distance from the centre in the direction whose angle to the ear's axis has this cosine.
pub(super) fn detour_m(distance_m: f64, cosine: f64, radius_m: f64) -> f64 {
    let cosine = cosine.clamp(-1.0, 1.0);
    if distance_m == f64::INFINITY {
        return if cosine >= 0.0 { -radius_m * cosine } else { radius_m * (-cosine).asin() };
    }
    let distance_m = distance_m.max(radius_m);
    if distance_m * cosine >= radius_m {
        let square = radius_m * radius_m - 2.0 * distance_m * radius_m * cosine;
        return square / ((distance_m * distance_m + square).sqrt() + distance_m);
    }
    // Along a tangent, and then along the surface.
    let tangent = (distance_m * distance_m - radius_m * radius_m).sqrt();
    let straight = -radius_m * radius_m / (tangent + distance_m);
    straight + radius_m * (cosine.acos() - (radius_m / distance_m).acos())
}

/// The α of the shadow for the cosine of the angle between source and ear.
pub(super) fn alpha(cosine: f64) -> f64 {
    let angle_deg = cosine.clamp(-1.0, 1.0).acos().to_degrees();
    let half = ALPHA_LEAST / 2.0;
    (1.0 + half) + (1.0 - half) * (angle_deg / DARKEST_DEG * std::f64::consts::PI).cos()
}

/// The low-pass filter of the shadow, 1 / (1 + jω/2ω₀), as taps: H is α times a unit impulse at the tap
/// `lead`, and 1 − α times this.
#[derive(Debug)]
pub(super) struct Shadow {
    pub(super) taps: Vec<f32>,
    pub(super) lead: usize,
}

/// Before the impulse, in seconds: a band-limited filter begins a little before its time.
const LEAD_S: f64 = 0.000_75;

/// Behind the impulse, in seconds; the low-pass has fallen by 100 dB.
const TAIL_S: f64 = 0.0015;

impl Shadow {
    pub(super) fn new(rate_hz: f64) -> Self {
        let lead = (LEAD_S * rate_hz).ceil() as usize;
        let count = lead + 1 + (TAIL_S * rate_hz).ceil() as usize;
        let size = (16 * count).next_power_of_two();
        let corner_hz = SPEED_OF_SOUND_MPS / RADIUS_M / std::f64::consts::PI;
        let mut planner = RealFftPlanner::new();
        let inverse = planner.plan_fft_inverse(size);
        let mut spectrum = inverse.make_input_vec();
        for (k, value) in spectrum.iter_mut().enumerate() {
            let part = 2.0 * k as f64 / size as f64;
            // Fades out over the top sixth of the band, so that it rings but shortly.
            let fade = (1.0 - ((part - 5.0 / 6.0) * 6.0).clamp(0.0, 1.0)) * std::f64::consts::FRAC_PI_2;
            let low_pass = Complex::new(1.0, 0.0) / Complex::new(1.0, part * rate_hz / 2.0 / corner_hz);
            let turn = Complex::from_polar(1.0, -std::f64::consts::PI * part * lead as f64);
            *value = low_pass * turn * fade.sin().powi(2) / size as f64;
        }
        if let (Some(last), true) = (spectrum.last_mut(), size > 1) {
            last.im = 0.0;
        }
        let mut time = inverse.make_output_vec();
        // Sizes agree and both ends are real: nothing else can fail.
        let taps = match inverse.process(&mut spectrum, &mut time) {
            Ok(()) => time[..count].iter().map(|tap| *tap as f32).collect(),
            Err(_) => vec![0.0; count],
        };
        Self { taps, lead }
    }

    /// The taps of an ear whose shadow has this α.
    pub(super) fn fill(&self, alpha: f64, taps: &mut [f32]) {
        let low = (1.0 - alpha) as f32;
        for (tap, shadow) in taps.iter_mut().zip(&self.taps) {
            *tap = low * shadow;
        }
        if let Some(tap) = taps.get_mut(self.lead) {
            *tap += alpha as f32;
        }
    }
}
