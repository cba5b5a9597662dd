//! Loops without a seam: a recording in, a buffer out that is read round and round.

use realfft::RealFftPlanner;
use realfft::num_complex::Complex;

use crate::score::Repeat;

/// The longest cross-fade, and the widest search for the place to cut, in seconds.
const FADE_S: f64 = 0.05;

/// Below this correlation the fade lets the power dip, for to hold it the gains would have to rise
/// above 1 / √(1 − ρ²) = 1.155.
const LEAST_CORRELATION: f64 = -0.5;

/// Makes a buffer to be read modulo its length, from one channel of samples.
///
/// `Repeat::ExactLoop` and `Repeat::Once` give the samples as they are. `Repeat::Loop` cross-fades the
/// end into the beginning:
///
/// 1. The cross-fade takes F frames: 50 ms, or a quarter of the recording where that is shorter. The
///    length L of the loop is sought within another F frames, so that the loop is shorter than the
///    recording by F to 2F frames.
/// 2. Where the loop ends, the recording goes on for F frames more: the *tail* x[L..L+F]. It fades
///    out over the *head* x[0..F] that fades in. L is where the normalised cross-correlation ρ of the
///    two is greatest; of lengths that are equally good, the longest.
/// 3. The gains a of the tail and b of the head hold the power of the sum, whatever ρ is:
///    a² + b² + 2ρab = 1. They are raised cosines cos²(πu/2) and sin²(πu/2), u from 0 to 1, divided
///    by the root of what that sum is for them. For equal segments (ρ = 1) they add up to 1, for
///    unrelated ones (ρ = 0) their squares do.
///
/// The end of the buffer is followed by its beginning as in the recording: sample L − 1 by sample L.
/// Recordings too short for a fade of one sample (below 4 frames) are given as they are.
///
/// ```
/// use froufrou::corpus::looping::seamless_loop;
/// use froufrou::score::Repeat;
/// let hum: Vec<f32> = (0..10_000).map(|i| (i as f32 * 0.1).sin()).collect();
/// let looped = seamless_loop(&hum, 48_000, Repeat::Loop);
/// let wrap = (looped[0] - looped[looped.len() - 1]).abs();
/// assert!(wrap < 0.1, "{wrap}");
/// ```
pub fn seamless_loop(samples: &[f32], rate_hz: u32, repeat: Repeat) -> Vec<f32> {
    let longest = (FADE_S * f64::from(rate_hz)).round() as usize;
    let fade = longest.min(samples.len() / 4);
    if repeat != Repeat::Loop || fade == 0 {
        return samples.to_vec();
    }
    let (length, correlation) = best_length(samples, fade);
    let (head, tail) = (&samples[..fade], &samples[length..length + fade]);
    let mut looped = samples[..length].to_vec();
    for (i, ((sample, head), tail)) in looped.iter_mut().zip(head).zip(tail).enumerate() {
        let (tail_gain, head_gain) = gains(i as f64 / fade as f64, correlation);
        *sample = (tail_gain * f64::from(*tail) + head_gain * f64::from(*head)) as f32;
    }
    looped
}

/// The gains of what fades out and what fades in, u of the way from one to the other, such that
/// a² + b² + 2ρab = 1.
fn gains(u: f64, correlation: f64) -> (f64, f64) {
    let (b, a) = (u * std::f64::consts::FRAC_PI_2).sin_cos();
    let (a, b) = (a * a, b * b);
    let rho = correlation.clamp(LEAST_CORRELATION, 1.0);
    let scale = (a * a + b * b + 2.0 * rho * a * b).sqrt().recip();
    (a * scale, b * scale)
}

/// The length of the loop at which tail and head agree best, and their correlation there.
fn best_length(samples: &[f32], fade: usize) -> (usize, f64) {
    let first = samples.len() - 2 * fade;
    let head: Vec<f64> = samples[..fade].iter().map(|&v| f64::from(v)).collect();
    let end: Vec<f64> = samples[first..].iter().map(|&v| f64::from(v)).collect();
    let products = correlate(&head, &end);
    let head_energy: f64 = head.iter().map(|v| v * v).sum();
    let mut before = Vec::with_capacity(end.len() + 1);
    before.push(0.0);
    before.extend(end.iter().scan(0.0, |sum, v| {
        *sum += v * v;
        Some(*sum)
    }));
    let total = before[end.len()];
    let mut best = (samples.len() - fade, 0.0);
    let mut best_value = f64::NEG_INFINITY;
    for (shift, product) in products.into_iter().enumerate() {
        let tail_energy = before[shift + fade] - before[shift];
        // Silence agrees with nothing; nor does what is only the rounding of the running sum.
        let is_silent = head_energy <= 0.0 || tail_energy <= 1e-12 * total || tail_energy <= 0.0;
        let value = if is_silent { 0.0 } else { product / (head_energy * tail_energy).sqrt() };
        // A later cut is worth as much as a correlation better by rounding errors.
        if value >= best_value - 1e-9 {
            best_value = value.max(best_value);
            best = (first + shift, value.clamp(-1.0, 1.0));
        }
    }
    best
}

/// The sum over i of head[i] · end[shift + i], for every shift at which the head fits in.
fn correlate(head: &[f64], end: &[f64]) -> Vec<f64> {
    let shifts = end.len() - head.len() + 1;
    let size = (head.len() + end.len()).next_power_of_two();
    let mut planner = RealFftPlanner::<f64>::new();
    let forward = planner.plan_fft_forward(size);
    let inverse = planner.plan_fft_inverse(size);
    // Convolution with the head reversed; shift s comes out at s + head.len() − 1.
    let mut reversed = vec![0.0; size];
    reversed.iter_mut().zip(head.iter().rev()).for_each(|(to, from)| *to = *from);
    let mut padded = vec![0.0; size];
    padded[..end.len()].copy_from_slice(end);
    let mut spectra = [forward.make_output_vec(), forward.make_output_vec()];
    let mut sums = vec![0.0; size];
    let [head_spectrum, end_spectrum] = &mut spectra;
    // The transforms fail for wrong lengths alone, and these are the plan's own.
    let done = forward
        .process(&mut reversed, head_spectrum)
        .and_then(|()| forward.process(&mut padded, end_spectrum))
        .and_then(|()| {
            for (a, b) in end_spectrum.iter_mut().zip(head_spectrum.iter()) {
                *a *= b;
            }
            // The first and the last bin of a real signal are real; rounding may say otherwise.
            for edge in [0, size / 2] {
                end_spectrum[edge] = Complex::new(end_spectrum[edge].re, 0.0);
            }
            inverse.process(end_spectrum, &mut sums)
        });
    debug_assert!(done.is_ok());
    let scale = 1.0 / size as f64;
    sums[head.len() - 1..][..shifts].iter().map(|sum| sum * scale).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::random::Random;

    fn sine(frequency_hz: f64, rate_hz: u32, frames: usize) -> Vec<f32> {
        let step = std::f64::consts::TAU * frequency_hz / f64::from(rate_hz);
        (0..frames).map(|i| (0.5 * (step * i as f64).sin()) as f32).collect()
    }

    fn noise(seed: u64, frames: usize) -> Vec<f32> {
        let random = Random::new(seed, 0);
        (0..frames as u64).map(|i| (random.uniform(i) - 0.5) as f32).collect()
    }

    fn power_db(samples: impl ExactSizeIterator<Item = f32>) -> f64 {
        let count = samples.len() as f64;
        10.0 * (samples.map(|v| f64::from(v).powi(2)).sum::<f64>() / count).log10()
    }

    /// The buffer read twice around.
    fn twice(looped: &[f32]) -> Vec<f32> {
        [looped, looped].concat()
    }

    #[test]
    fn the_transform_correlates_as_the_sum_does() {
        let (head, end) = (noise(1, 37), noise(2, 90));
        let wide = |samples: &[f32]| samples.iter().map(|&v| f64::from(v)).collect::<Vec<f64>>();
        let (head, end) = (wide(&head), wide(&end));
        let naive = |shift: usize| -> f64 { head.iter().zip(&end[shift..]).map(|(a, b)| a * b).sum() };
        let fast = correlate(&head, &end);
        assert_eq!(fast.len(), 90 - 37 + 1);
        for (shift, value) in fast.iter().enumerate() {
            assert!((value - naive(shift)).abs() < 1e-12, "{shift}");
        }
    }

    #[test]
    fn the_gains_hold_the_power() {
        for rho in [-0.5, -0.2, 0.0, 0.3, 0.9, 1.0] {
            for step in 0..=20 {
                let (a, b) = gains(f64::from(step) / 20.0, rho);
                assert!((a * a + b * b + 2.0 * rho * a * b - 1.0).abs() < 1e-12);
                assert!(a < 1.1548 && b < 1.1548);
            }
            assert_eq!(gains(0.0, rho), (1.0, 0.0));
        }
        let (a, b) = gains(0.3, 1.0);
        assert!((a + b - 1.0).abs() < 1e-12, "equal segments: gains that add up to 1");
    }

    #[test]
    fn a_loop_of_noise_keeps_its_power_around_the_splice() {
        // Averaged over loops, so that what is left is the fade's doing and not chance.
        let (rate_hz, loops, window) = (48_000, 100, 480);
        let mut sums = vec![0.0f64; 3 * 2400 / window];
        let mut plain = 0.0f64;
        for seed in 0..loops {
            let looped = seamless_loop(&noise(seed, 24_000), rate_hz, Repeat::Loop);
            let around = looped.iter().cycle().skip(looped.len() - 1200).take(3 * 2400);
            let squares: Vec<f64> = around.map(|&v| f64::from(v).powi(2)).collect();
            for (sum, part) in sums.iter_mut().zip(squares.chunks_exact(window)) {
                *sum += part.iter().sum::<f64>() / (window as f64 * loops as f64);
            }
            plain +=
                looped[5000..15_000].iter().map(|&v| f64::from(v).powi(2)).sum::<f64>() / 1e4 / loops as f64;
        }
        for (part, sum) in sums.iter().enumerate() {
            let change_db = 10.0 * (sum / plain).log10();
            assert!(change_db.abs() < 0.15, "{part}: {change_db} dB");
        }
    }

    #[test]
    fn one_loop_of_noise_keeps_its_short_time_power() {
        for seed in 0..10 {
            let looped = seamless_loop(&noise(seed, 48_000), 48_000, Repeat::Loop);
            let level_db = power_db(looped[5000..40_000].iter().copied());
            let again = twice(&looped);
            for start in (looped.len() - 2400..=looped.len() + 2400).step_by(300) {
                let change_db = power_db(again[start..start + 2400].iter().copied()) - level_db;
                assert!(change_db.abs() < 0.5, "seed {seed}, {start}: {change_db} dB");
            }
        }
    }

    #[test]
    fn a_loop_of_a_sine_has_neither_click_nor_dip() {
        for (frequency_hz, rate_hz, frames) in [
            (441.3, 48_000, 30_011),
            (57.7, 44_100, 20_000),
            (1234.5, 8_000, 5_000),
            (9_876.5, 48_000, 12_345),
            (12_000.3, 96_000, 40_000),
        ] {
            let looped = seamless_loop(&sine(frequency_hz, rate_hz, frames), rate_hz, Repeat::Loop);
            let again = twice(&looped);
            let fade = (frames / 4).min((0.05 * f64::from(rate_hz)) as usize);
            let bend = |i: usize| (again[i - 1] - 2.0 * again[i] + again[i + 1]).abs();
            // The second difference of a sampled sine is at most a(2 − 2 cos ω), and what rounding adds.
            let usual =
                (1.0 - (std::f64::consts::TAU * frequency_hz / f64::from(rate_hz)).cos()) as f32 + 2e-7;
            assert!((fade + 2..looped.len() - 1).map(bend).all(|b| b <= usual));
            let seam = (looped.len() - 2..looped.len() + fade + 2).map(bend).fold(0.0, f32::max);
            assert!(seam <= 1.002 * usual, "{frequency_hz} Hz: {seam} after {usual}");
            // The power of whole periods, as the window slides over the splice.
            let period = f64::from(rate_hz) / frequency_hz;
            let periods = (looped.len() as f64 / 3.0 / period).floor().min(30.0);
            let window = (periods * period).round() as usize;
            let level_db = 20.0 * (0.5 / 2f64.sqrt()).log10();
            for start in (looped.len() - window..looped.len() + fade).step_by(7) {
                let change_db = power_db(again[start..start + window].iter().copied()) - level_db;
                assert!(change_db.abs() < 0.1, "{frequency_hz} Hz at {start}: {change_db} dB");
            }
        }
    }

    #[test]
    fn an_exact_loop_and_a_single_play_are_left_alone() {
        let samples = noise(3, 1000);
        assert_eq!(seamless_loop(&samples, 48_000, Repeat::ExactLoop), samples);
        assert_eq!(seamless_loop(&samples, 48_000, Repeat::Once), samples);
        assert!(seamless_loop(&samples, 48_000, Repeat::Loop).len() < samples.len());
    }

    #[test]
    fn silence_loops_as_silence() {
        let looped = seamless_loop(&[0.0; 10_000], 48_000, Repeat::Loop);
        assert_eq!(looped, vec![0.0; 10_000 - 2400]);
    }

    proptest! {
        #[test]
        fn any_loop_is_finite_and_nearly_as_long_as_its_recording(
            samples in prop::collection::vec(-1e30f32..1e30, 0..300),
            rate_hz in 1_000u32..200_000,
        ) {
            let looped = seamless_loop(&samples, rate_hz, Repeat::Loop);
            prop_assert!(looped.iter().all(|v| v.is_finite()));
            prop_assert!(looped.len() <= samples.len());
            prop_assert!(looped.len() >= samples.len() / 2);
            prop_assert!(!looped.is_empty() || samples.is_empty());
        }
    }
}
