use std::sync::Arc;

use realfft::RealFftPlanner;

use super::noise::hop_samples;
use super::voice::{RateTable, Voice, controls, settings};
use super::*;
use crate::corpus::cloth::spectra::{FrictionSpectra, SPACING_HZ, Spectrum};
use crate::random::Random;
use crate::synth::instrument::{Ramp, Stretch, stretch_samples};

/// Falling spectra with a hump that rises with speed, as far as 20 kHz.
fn spectra() -> FrictionSpectra {
    let spectrum = |speed_mps: f64, level: f64| {
        let centre = 600.0 + 9000.0 * speed_mps;
        let density = (1..1000).map(|k| {
            let f = f64::from(k) * SPACING_HZ;
            level * ((-0.5 * ((f - centre) / (0.3 * centre)).powi(2)).exp() + 0.03) / (1.0 + f / 8000.0)
        });
        Spectrum { speed_mps, density: density.collect() }
    };
    let all = vec![spectrum(0.05, 1e-3), spectrum(0.2, 3e-3), spectrum(0.5, 5e-3)];
    FrictionSpectra::new(SPACING_HZ, all).unwrap()
}

/// Some seconds of a voice, whose controls are those of `told` at any time.
fn sound(rate_hz: f64, seconds: f64, seed: u64, told: impl Fn(f64) -> Vec<Part>) -> Vec<f32> {
    let table = Arc::new(FrictionTable::new(&spectra()));
    let table = Arc::new(RateTable::new(table, rate_hz));
    let mut voice = Voice::new(table, rate_hz, Random::new(seed, 1));
    let names = controls();
    let values = |time_s: f64| -> Vec<f64> {
        let mut values: Vec<f64> = names.iter().map(|control| control.default).collect();
        for (name, value) in settings(&told(time_s)) {
            values[names.iter().position(|control| control.name == name).unwrap()] = value;
        }
        values
    };
    let count = stretch_samples(rate_hz);
    let mut out = Vec::new();
    while (out.len() as f64) < seconds * rate_hz {
        let first = out.len() as u64;
        let [from, to] = [first, first + count as u64].map(|n| values(n as f64 / rate_hz + voice::AHEAD_S));
        let ramps: Vec<Ramp> = from.iter().zip(&to).map(|(&from, &to)| Ramp { from, to }).collect();
        let stretch = Stretch { first, rate_hz, controls: &ramps, strikes: &[], grains: &[] };
        let begin = out.len();
        out.resize(begin + count, 0.0);
        voice.add(&stretch, &mut out[begin..]);
    }
    out
}

fn steady(speed_mps: f64) -> impl Fn(f64) -> Vec<Part> {
    move |_| vec![Part { speed_mps, level: 1.0, spread: 0.0 }]
}

/// Power a hertz by Welch's method, with a Hann window of 0.1 s: at multiples of the returned spacing.
fn measured(samples: &[f32], rate_hz: f64) -> (f64, Vec<f64>) {
    let length = (rate_hz * 0.1) as usize;
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(length);
    let window: Vec<f64> =
        (0..length).map(|n| 0.5 - 0.5 * (std::f64::consts::TAU * n as f64 / length as f64).cos()).collect();
    let squares: f64 = window.iter().map(|w| w * w).sum();
    let mut sum = vec![0.0; length / 2 + 1];
    let mut clips = 0;
    for clip in samples[length..].windows(length).step_by(length / 2) {
        let mut input: Vec<f64> = clip.iter().zip(&window).map(|(v, w)| f64::from(*v) * w).collect();
        let mut output = transform.make_output_vec();
        transform.process(&mut input, &mut output).unwrap();
        sum.iter_mut().zip(&output).for_each(|(sum, value)| *sum += value.norm_sqr());
        clips += 1;
    }
    let scale = 2.0 / (squares * rate_hz * f64::from(clips));
    (rate_hz / length as f64, sum.iter().map(|v| v * scale).collect())
}

/// Powers of thirds of octaves from 200 Hz up to a frequency, of a power density at multiples of a spacing from 0 on.
fn thirds(spacing_hz: f64, power: &[f64], to_hz: f64) -> Vec<f64> {
    let mut bands = Vec::new();
    let mut low = 200.0;
    while low * 2.0f64.powf(1.0 / 3.0) <= to_hz {
        let high = low * 2.0f64.powf(1.0 / 3.0);
        let inside = power.iter().enumerate().map(|(k, p)| {
            // The part of the value's band that lies within.
            let [from, to] = [k as f64 - 0.5, k as f64 + 0.5].map(|place| place * spacing_hz);
            p * (to.min(high) - from.max(low)).max(0.0)
        });
        bands.push(inside.sum());
        low = high;
    }
    bands
}

fn decibels(ratio: f64) -> f64 {
    10.0 * ratio.log10()
}

#[test]
fn the_spectrum_follows_the_table_within_a_decibel_at_every_speed_and_rate() {
    let spectra = spectra();
    for (rate_hz, speeds) in [
        (48_000.0, &[0.02, 0.05, 0.08, 0.125, 0.2, 0.3, 0.5, 2.0][..]),
        (44_100.0, &[0.03, 0.125, 0.35]),
        (96_000.0, &[0.125, 0.5]),
        (192_000.0, &[0.08, 0.35]),
    ] {
        for &speed in speeds {
            let (spacing, power) = measured(&sound(rate_hz, 12.0, 5, steady(speed)), rate_hz);
            let found = thirds(spacing, &power, 18_000.0);
            let density = spectra.at(speed);
            let expected: Vec<f64> = std::iter::once(0.0).chain(density.iter().map(|a| a * a)).collect();
            let expected = thirds(SPACING_HZ, &expected, 18_000.0);
            assert_eq!((found.len(), expected.len()), (19, 19));
            for (third, (found, expected)) in found.iter().zip(&expected).enumerate() {
                let off = decibels(found / expected);
                assert!(off.abs() < 1.0, "{rate_hz} Hz, {speed} m/s, third {third}: {off} dB");
            }
            let whole = |bands: &[f64]| bands.iter().sum::<f64>();
            assert!(decibels(whole(&found) / whole(&expected)).abs() < 0.25);
        }
    }
}

#[test]
fn the_centroid_rises_and_the_level_is_continuous_from_rest_on() {
    let mut before: Option<(f64, f64)> = None;
    for step in 0..24 {
        let speed = 0.02 * 1.15f64.powi(step);
        let (spacing, power) = measured(&sound(48_000.0, 6.0, 3, steady(speed)), 48_000.0);
        let whole: f64 = power.iter().sum();
        let centroid = power.iter().enumerate().map(|(k, p)| k as f64 * p).sum::<f64>() / whole * spacing;
        if let Some((centroid_before, whole_before)) = before {
            // Below the slowest measured speed and above the fastest the pitch stays, but for the noise of measuring.
            let moves = (0.05 * 1.15..0.5).contains(&speed);
            let least = if moves { centroid_before } else { 0.98 * centroid_before };
            assert!(centroid > least, "{speed} m/s: {centroid} Hz after {centroid_before} Hz");
            // Below the slowest the level rises with the fourth power of speed: 2.43 dB a step.
            let rise = decibels(whole / whole_before);
            assert!((-0.3..2.9).contains(&rise), "{speed} m/s: {rise} dB");
        }
        before = Some((centroid, whole));
    }
}

#[test]
fn the_level_does_not_ripple() {
    // The mean power at each place of a frame, over many seeds.
    let rate_hz = 8_000.0;
    let hop = hop_samples(rate_hz);
    let mut power = vec![0.0; hop];
    for seed in 0..60 {
        let samples = sound(rate_hz, 3.0, seed, steady(0.3));
        for (n, sample) in samples.iter().enumerate().skip(2 * hop) {
            power[n % hop] += f64::from(*sample).powi(2);
        }
    }
    // In tenths of a hop.
    let tenths: Vec<f64> = power.chunks(hop / 10).map(|part| part.iter().sum()).collect();
    let mean = tenths.iter().sum::<f64>() / tenths.len() as f64;
    for tenth in &tenths {
        assert!(
            decibels(tenth / mean).abs() < 0.2,
            "{:?}",
            tenths.iter().map(|t| decibels(t / mean)).collect::<Vec<_>>()
        );
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_others_do_not() {
    let glide = |time_s: f64| vec![Part { speed_mps: 0.4 * time_s, level: 0.5, spread: 0.2 }];
    let samples = sound(48_000.0, 1.0, 9, glide);
    assert_eq!(samples, sound(48_000.0, 1.0, 9, glide));
    assert_ne!(samples, sound(48_000.0, 1.0, 10, glide));
    assert!(samples.iter().all(|v| v.is_finite()));
    // At rest there is silence, also after something moved.
    let stops =
        |time_s: f64| vec![Part { speed_mps: if time_s < 0.5 { 0.3 } else { 0.0 }, level: 1.0, spread: 0.0 }];
    let samples = sound(48_000.0, 1.0, 9, stops);
    assert!(samples[..20_000].iter().any(|v| *v != 0.0));
    assert!(samples[28_000..].iter().all(|v| *v == 0.0));
    for odd in [f64::NAN, f64::INFINITY, -0.2] {
        let odd = sound(48_000.0, 0.2, 9, |_| vec![Part { speed_mps: odd, level: odd.abs(), spread: odd }]);
        assert!(odd.iter().all(|v| v.is_finite()));
    }
}

#[test]
fn points_gathered_sound_as_the_sum_of_their_powers() {
    let spectra = spectra();
    let table = FrictionTable::new(&spectra);
    let random = Random::new(6, 6);
    let points: Vec<(f64, f64)> =
        (0..2000).map(|n| (0.01 * 80.0f64.powf(random.uniform(2 * n)), random.uniform(2 * n + 1))).collect();
    let mut histogram = SpeedHistogram::new(&table);
    let mut exact = vec![0.0; spectra.values()];
    for &(speed, weight) in &points {
        histogram.add(&table, speed, weight);
        exact.iter_mut().zip(spectra.at(speed)).for_each(|(sum, a)| *sum += weight * a * a);
    }
    let mut gathered = Vec::new();
    histogram.spectrum(&table, &mut gathered);
    for (k, (gathered, exact)) in gathered.iter().zip(&exact).enumerate() {
        assert!(decibels(gathered / exact).abs() < 0.1, "{k}: {} dB", decibels(gathered / exact));
    }
    // What a thread is told of it: the same power, and nearly the same spectrum.
    for (count, most_db) in [(4, 1.0), (2, 2.0), (1, 4.0)] {
        let parts = histogram.parts(&table, count);
        assert_eq!(parts.len(), count);
        assert!(parts.windows(2).all(|pair| pair[0].speed_mps < pair[1].speed_mps));
        let mut told = SpeedHistogram::new(&table);
        parts.iter().for_each(|part| told.add_part(&table, part));
        assert!((told.power(&table) / histogram.power(&table) - 1.0).abs() < 1e-9);
        let mut spectrum = Vec::new();
        told.spectrum(&table, &mut spectrum);
        let [told, exact] = [&spectrum, &exact].map(|power| thirds(SPACING_HZ, power, 18_000.0));
        let worst = told.iter().zip(&exact).map(|(a, b)| decibels(a / b).abs()).fold(0.0, f64::max);
        assert!(worst < most_db, "{count} parts: {worst} dB");
    }
}

#[test]
fn the_table_holds_each_spectrum_and_knows_rest() {
    let spectra = spectra();
    let table = FrictionTable::new(&spectra);
    for step in 0..400 {
        let speed = 0.001 * 1.02f64.powi(step);
        let exact = crate::corpus::cloth::spectra::power(&spectra.at(speed), SPACING_HZ);
        let off = decibels(table.whole(speed) / exact);
        assert!(off.abs() < 0.1, "{speed}: {off} dB");
    }
    assert_eq!(table.whole(0.0), 0.0);
    assert_eq!(table.whole(f64::NAN), 0.0);
    let mut histogram = SpeedHistogram::new(&table);
    histogram.add(&table, f64::NAN, 1.0);
    histogram.add(&table, 0.1, f64::NAN);
    histogram.add(&table, 0.1, -1.0);
    assert!(histogram.parts(&table, 4).is_empty());
    histogram.add(&table, f64::INFINITY, 1.0);
    assert_eq!(histogram.weights().last(), Some(&1.0));
    // One spectrum alone is a table too.
    let one = FrictionSpectra::new(20.0, vec![spectra.measured()[1].clone()]).unwrap();
    let table = FrictionTable::new(&one);
    assert_eq!(table.speeds_mps(), [0.2]);
    assert!((table.whole(0.1) / table.whole(7.0) - 1.0 / 16.0).abs() < 1e-12);
}
