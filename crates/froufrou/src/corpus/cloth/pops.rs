//! Pops: the single bursts of energy by which a crumpled cloth sounds, cut out of recordings.
//!
//! The energy, which is the square of the pressure, is convolved with a box of 20 ms. Each run of it above a
//! threshold is a pop, whose ends are moved outwards to the next crossings of zero, so that it begins and ends
//! without a click.
//!
//! Thresholds are those of An, James & Marschner (2012): sums of squares of full scale over the box, of samples at 96 kHz. At
//! other rates sums are scaled to those of 96 kHz. Their polyester, cotton and windbreaker had 0.25, 0.5 and 0.025. They hold for a recording
//! of a certain gain; [`automatic_threshold`] suits any.

use std::ops::Range;

use crate::error::{Error, Place, Result};

/// The length of the box.
pub const BOX_S: f64 = 0.02;

/// The rate that thresholds are meant at.
const THRESHOLD_RATE_HZ: f64 = 96_000.0;

/// By how much pops stand above what is between them, where no threshold is given: 10 dB.
const ABOVE: f64 = 10.0;

/// A pop in a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Pop {
    /// Where in the recording it lies, in samples.
    pub range: Range<usize>,
    /// The sum of squares over its samples, divided by the rate: squares of full scale times seconds.
    pub energy: f64,
    /// From its first sample to the middle of its energy, in seconds.
    pub lead_s: f64,
}

/// The energy of a recording over 20 ms about each sample, as a sum of squares at 96 kHz.
pub fn smooth_energy(samples: &[f32], rate_hz: f64) -> Vec<f64> {
    // An odd number of samples has a middle.
    let half = ((BOX_S * rate_hz).round() as usize) / 2;
    let mut sums = Vec::with_capacity(samples.len() + 1);
    sums.push(0.0f64);
    let mut sum = 0.0f64;
    for sample in samples {
        sum += f64::from(*sample).powi(2);
        sums.push(sum);
    }
    let scale = THRESHOLD_RATE_HZ / rate_hz;
    let energy = (0..samples.len()).map(|n| {
        let (from, to) = (n.saturating_sub(half), (n + half + 1).min(samples.len()));
        // A difference of large sums may round below 0.
        (sums[to] - sums[from]).max(0.0) * scale
    });
    energy.collect()
}

/// A threshold 10 dB above what half of a recording is quieter than; 0 for silence.
pub fn automatic_threshold(samples: &[f32], rate_hz: f64) -> f64 {
    let mut energy = smooth_energy(samples, rate_hz);
    let middle = energy.len() / 2;
    if energy.is_empty() {
        return 0.0;
    }
    let (_, median, _) = energy.select_nth_unstable_by(middle, f64::total_cmp);
    *median * ABOVE
}

/// Finds the pops of a recording, in order. They do not overlap.
///
/// ```
/// use froufrou::corpus::cloth::pops;
/// // A tenth of a second of silence, a click of 1 ms, and silence.
/// let mut samples = vec![0.0f32; 9600];
/// samples[4800..4848].iter_mut().enumerate().for_each(|(n, v)| *v = if n % 2 == 0 { 0.5 } else { -0.5 });
/// let found = pops::find(&samples, 48_000.0, 0.25)?;
/// assert_eq!(found.len(), 1);
/// assert!((found[0].energy - 48.0 * 0.25 / 48_000.0).abs() < 1e-9);
/// # Ok::<(), froufrou::Error>(())
/// ```
///
/// # Errors
/// A threshold that is no number above 0, or a rate below 1 kHz.
pub fn find(samples: &[f32], rate_hz: f64, threshold: f64) -> Result<Vec<Pop>> {
    if !(threshold > 0.0 && threshold.is_finite()) {
        return Err(Error::new(format!("the threshold of pops is {threshold}, expected a number above 0"))
            .at(Place::Part("threshold".to_owned()))
            .help("left out, it follows from the recording; a silent one has no pops"));
    }
    if !(1e3..=1e6).contains(&rate_hz) {
        return Err(Error::new(format!("the rate is {rate_hz} Hz, expected 1000 to 1000000 Hz")));
    }
    let energy = smooth_energy(samples, rate_hz);
    let mut pops: Vec<Pop> = Vec::new();
    let mut from = 0;
    while let Some(begin) = (from..energy.len()).find(|&n| energy[n] > threshold) {
        let end = (begin..energy.len()).find(|&n| energy[n] <= threshold).unwrap_or(energy.len());
        from = end;
        let least = pops.last().map_or(0, |pop| pop.range.end);
        // What reaches into the one before is part of it already.
        let begin = before(samples, begin).max(least);
        let end = after(samples, end);
        if begin < end {
            pops.push(pop(samples, begin..end, rate_hz));
            from = from.max(end);
        }
    }
    Ok(pops)
}

/// Whether the pressure crosses zero between a sample and the one before it.
fn crosses(samples: &[f32], n: usize) -> bool {
    match n.checked_sub(1).map(|before| (samples.get(before), samples.get(n))) {
        Some((Some(a), Some(b))) => a.is_sign_negative() != b.is_sign_negative(),
        _ => true,
    }
}

fn before(samples: &[f32], mut n: usize) -> usize {
    while !crosses(samples, n) {
        n -= 1;
    }
    n
}

fn after(samples: &[f32], mut n: usize) -> usize {
    while !crosses(samples, n) {
        n += 1;
    }
    n
}

/// The middle of the energy of a sound, in seconds from its beginning; 0 for silence.
pub fn centre_s(samples: &[f32], rate_hz: f64) -> f64 {
    let (mut energy, mut moment) = (0.0f64, 0.0f64);
    for (n, sample) in samples.iter().enumerate() {
        let square = f64::from(*sample).powi(2);
        energy += square;
        moment += square * n as f64;
    }
    if energy > 0.0 { moment / energy / rate_hz } else { 0.0 }
}

fn pop(samples: &[f32], range: Range<usize>, rate_hz: f64) -> Pop {
    let inside = &samples[range.clone()];
    let energy: f64 = inside.iter().map(|sample| f64::from(*sample).powi(2)).sum();
    Pop { energy: energy / rate_hz, lead_s: centre_s(inside, rate_hz), range }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    #[derive(serde::Deserialize)]
    struct Found {
        begin: usize,
        end: usize,
        energy: f64,
    }

    #[derive(serde::Deserialize)]
    struct Golden {
        rate_hz: f64,
        samples_16_bit: Vec<i32>,
        threshold: f64,
        pops: Vec<Found>,
    }

    #[test]
    fn agrees_with_numpy() {
        let text = std::fs::read_to_string("tests/fixtures/cloth/pops.json").unwrap();
        let golden: Golden = serde_json::from_str(&text).unwrap();
        let samples: Vec<f32> = golden.samples_16_bit.iter().map(|v| *v as f32 / 32768.0).collect();
        let found = find(&samples, golden.rate_hz, golden.threshold).unwrap();
        assert!(golden.pops.len() >= 3);
        assert_eq!(found.len(), golden.pops.len());
        for (found, expected) in found.iter().zip(&golden.pops) {
            assert_eq!(found.range, expected.begin..expected.end);
            assert!((found.energy / expected.energy - 1.0).abs() < 1e-6);
        }
    }

    /// Bursts of noise with decays, well apart.
    fn bursts(rate_hz: f64) -> Vec<f32> {
        let random = Random::new(4, 4);
        let count = (rate_hz * 2.0) as usize;
        let mut samples = vec![0.0f32; count];
        for (burst, at_s) in [0.2, 0.6, 0.9, 1.4].iter().enumerate() {
            let first = (at_s * rate_hz) as usize;
            for n in 0..(0.1 * rate_hz) as usize {
                let later_s = n as f64 / rate_hz;
                let phase = std::f64::consts::TAU * (400.0 + 150.0 * burst as f64) * later_s;
                samples[first + n] += (0.4 * (-200.0 * later_s).exp() * phase.sin()) as f32;
            }
        }
        let noise = |n: usize| 0.001 * (2.0 * random.uniform(n as u64) - 1.0) as f32;
        samples.iter_mut().enumerate().for_each(|(n, sample)| *sample += noise(n));
        samples
    }

    #[test]
    fn pops_are_apart_and_loud_and_begin_and_end_at_crossings() {
        let samples = bursts(48_000.0);
        let pops = find(&samples, 48_000.0, 0.5).unwrap();
        assert_eq!(pops.len(), 4);
        assert!(pops.windows(2).all(|pair| pair[0].range.end <= pair[1].range.start));
        for pop in &pops {
            assert!(crosses(&samples, pop.range.start) && crosses(&samples, pop.range.end));
            let length_s = pop.range.len() as f64 / 48_000.0;
            assert!((0.0..length_s).contains(&pop.lead_s));
        }
        // All energy above the floor is in one of them.
        let whole: f64 = samples.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / 48_000.0;
        let inside: f64 = pops.iter().map(|pop| pop.energy).sum();
        assert!(inside / whole > 0.99, "{inside}, {whole}");
    }

    #[test]
    fn pops_do_not_depend_on_the_rate_and_move_with_the_sound() {
        let [low, high] = [48_000.0, 96_000.0].map(|rate| find(&bursts(rate), rate, 0.5).unwrap());
        assert_eq!(low.len(), high.len());
        for (a, b) in low.iter().zip(&high) {
            assert!((a.energy / b.energy - 1.0).abs() < 0.02, "{a:?} {b:?}");
            assert!((2.0 * a.range.start as f64 - b.range.start as f64).abs() < 96.0);
        }
        let mut later = vec![0.0; 1000];
        later.extend(bursts(48_000.0));
        let later = find(&later, 48_000.0, 0.5).unwrap();
        for (a, b) in low.iter().zip(&later) {
            assert_eq!(a.range.start + 1000, b.range.start);
        }
    }

    #[test]
    fn an_automatic_threshold_follows_the_gain() {
        let samples = bursts(44_100.0);
        let louder: Vec<f32> = samples.iter().map(|v| v * 1.7).collect();
        let [a, b] = [&samples, &louder]
            .map(|samples| find(samples, 44_100.0, automatic_threshold(samples, 44_100.0)).unwrap().len());
        assert_eq!((a, b), (4, 4));
        assert_eq!(automatic_threshold(&[], 48_000.0), 0.0);
        assert!(find(&[0.0; 100], 48_000.0, 0.0).is_err());
        assert!(find(&[], 48_000.0, 1.0).unwrap().is_empty());
        // Loud from beginning to end: one pop, all of it.
        assert_eq!(find(&[0.5; 4800], 48_000.0, 0.01).unwrap()[0].range, 0..4800);
    }
}
