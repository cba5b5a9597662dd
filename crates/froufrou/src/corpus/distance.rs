//! How far a sound is from another.

use std::f64::consts::TAU;

use rayon::prelude::*;
use realfft::RealFftPlanner;

/// Length of the Hann window under which spectra are compared, and from one to the next, in samples.
const FRAME: usize = 1024;
const HOP: usize = 256;

/// What lies further below the highest bin of the wanted sound is taken to lie there, in decibels.
const FLOOR_DB: f64 = -60.0;

/// Frames whose power is further below that of the strongest are not compared, in decibels.
const SILENT_DB: f64 = -50.0;

/// The ratio of a sound's energy to that of what another differs from it by, in decibels; none where they are the same
/// or nothing is wanted. What is longer than the other differs by all it has.
pub fn signal_to_noise_db(sound: &[f32], wanted: &[f32]) -> Option<f64> {
    let at = |samples: &[f32], i: usize| f64::from(samples.get(i).copied().unwrap_or(0.0));
    let length = sound.len().max(wanted.len());
    let energy: f64 = (0..wanted.len()).map(|i| at(wanted, i).powi(2)).sum();
    let lost: f64 = (0..length).map(|i| (at(sound, i) - at(wanted, i)).powi(2)).sum();
    (energy > 0.0 && lost > 0.0).then(|| 10.0 * (energy / lost).log10())
}

/// The log-spectral distance in decibels: the mean over frames of the root mean square over bins of the difference of
/// levels. Frames in which the wanted sound is silent are left out, and levels more than 60 dB below its highest count
/// as that; none where all of it is silent.
///
/// ```
/// use froufrou::corpus::distance::log_spectral_distance_db;
/// let random = froufrou::random::Random::new(1, 0);
/// let hiss: Vec<f32> = (0..9000).map(|i| random.uniform(i) as f32 - 0.5).collect();
/// let softer: Vec<f32> = hiss.iter().map(|v| 0.5 * v).collect();
/// let distance = log_spectral_distance_db(&softer, &hiss).unwrap_or(0.0);
/// assert!((distance - 6.02).abs() < 0.1);
/// ```
pub fn log_spectral_distance_db(sound: &[f32], wanted: &[f32]) -> Option<f64> {
    let [is, should] = [sound, wanted].map(|samples| spectra(samples, wanted.len()));
    let highest = should.iter().flatten().copied().fold(0.0, f64::max);
    let power = |frame: &[f64]| frame.iter().sum::<f64>();
    let strongest = should.iter().map(|frame| power(frame)).fold(0.0, f64::max);
    if highest <= 0.0 {
        return None;
    }
    let floor = highest * 10f64.powf(FLOOR_DB / 10.0);
    let least = strongest * 10f64.powf(SILENT_DB / 10.0);
    let distance = |(is, should): (&Vec<f64>, &Vec<f64>)| {
        let square: f64 =
            is.iter().zip(should).map(|(a, b)| (10.0 * (a.max(floor) / b.max(floor)).log10()).powi(2)).sum();
        (square / should.len() as f64).sqrt()
    };
    let compared: Vec<f64> =
        is.iter().zip(&should).filter(|(_, should)| power(should) >= least).map(distance).collect();
    Some(compared.iter().sum::<f64>() / compared.len() as f64)
}

/// The powers of the bins of each frame of a length.
fn spectra(samples: &[f32], length: usize) -> Vec<Vec<f64>> {
    let window: Vec<f64> =
        (0..FRAME).map(|i| 0.5 - 0.5 * (TAU * (i as f64 + 0.5) / FRAME as f64).cos()).collect();
    let fft = RealFftPlanner::<f64>::new().plan_fft_forward(FRAME);
    (0..length.div_ceil(HOP))
        .into_par_iter()
        .map(|frame| {
            let mut input = fft.make_input_vec();
            for (i, (to, w)) in input.iter_mut().zip(&window).enumerate() {
                let at = (frame * HOP + i).checked_sub(FRAME / 2);
                let sample = at.and_then(|at| samples.get(at)).copied().unwrap_or(0.0);
                *to = w * f64::from(sample);
            }
            let mut bins = fft.make_output_vec();
            // The transform fails for wrong lengths alone, and these are the plan's own.
            let done = fft.process(&mut input, &mut bins);
            debug_assert!(done.is_ok());
            bins.iter().map(|bin| bin.norm_sqr()).collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn noise(seed: u64) -> Vec<f32> {
        let random = Random::new(seed, 0);
        (0..20_000).map(|i| random.uniform(i) as f32 - 0.5).collect()
    }

    #[test]
    fn the_same_sound_is_at_no_distance_and_others_are() {
        let (a, b) = (noise(1), noise(2));
        assert_eq!(log_spectral_distance_db(&a, &a), Some(0.0));
        assert_eq!(signal_to_noise_db(&a, &a), None);
        assert_eq!(log_spectral_distance_db(&a, &[0.0; 500]), None);
        // Levels of two white noises differ by 7.8 dB: π √2 / √6 · 10 / ln 10, each being exponential in power.
        let off = log_spectral_distance_db(&b, &a).unwrap();
        assert!((off - 7.87).abs() < 0.2, "{off}");
        assert!(log_spectral_distance_db(&[], &a).unwrap() > 30.0);
    }

    #[test]
    fn noise_counts_in_decibels() {
        let a = noise(1);
        let off: Vec<f32> = a.iter().zip(noise(2)).map(|(a, b)| a + 0.1 * b).collect();
        let ratio = signal_to_noise_db(&off, &a).unwrap();
        assert!((ratio - 20.0).abs() < 0.2, "{ratio}");
        let longer = [a.clone(), a.clone()].concat();
        assert!(signal_to_noise_db(&longer, &a).unwrap().abs() < 1e-9);
    }
}
