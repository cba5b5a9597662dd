use super::*;
use crate::random::Random;

/// White noise of a variance.
fn noise(rate_hz: f64, seconds: f64, deviation: f64, thread: u64) -> Vec<f32> {
    let random = Random::new(8, thread);
    (0..(rate_hz * seconds) as u64).map(|n| (deviation * random.normal(n)) as f32).collect()
}

fn take(samples: Vec<f32>, rate_hz: f64, motion: Motion) -> Take {
    Take { name: "take".into(), samples, rate_hz, motion, seams: Seams::default() }
}

#[test]
fn white_noise_has_its_density_at_every_rate() {
    for rate_hz in [8_000.0, 44_100.0, 96_000.0] {
        let samples = noise(rate_hz, 10.0, 0.1, 1);
        let (spectra, counts) =
            measure(&[take(samples, rate_hz, Motion::Steady(0.3))], &Gathering::default()).unwrap();
        assert_eq!((spectra.measured().len(), spectra.measured()[0].speed_mps), (1, 0.3));
        assert_eq!(counts[0].clips, 399);
        let density = &spectra.measured()[0].density;
        let expected = 0.1 * (2.0 / rate_hz).sqrt();
        let power = density.iter().map(|a| a * a).sum::<f64>() / density.len() as f64;
        assert!((power.sqrt() / expected - 1.0).abs() < 0.02, "{rate_hz}: {} {expected}", power.sqrt());
        // By thirds of octaves, and every value within what 399 clips allow.
        assert!(density[5..density.len() - 5].iter().all(|a| (a / expected - 1.0).abs() < 0.25));
    }
}

#[test]
fn a_tone_is_where_it_is_with_its_power() {
    let tone = |n: u32| (0.2 * (std::f64::consts::TAU * 1000.0 * f64::from(n) / 44_100.0).sin()) as f32;
    let samples = (0..44_100).map(tone).collect();
    let (spectra, _) =
        measure(&[take(samples, 44_100.0, Motion::Steady(1.0))], &Gathering::default()).unwrap();
    let density = &spectra.measured()[0].density;
    let loudest = (0..density.len()).max_by(|a, b| density[*a].total_cmp(&density[*b])).unwrap();
    assert_eq!(loudest, 49);
    let power = super::super::spectra::power(density, SPACING_HZ);
    assert!((power / 0.02 - 1.0).abs() < 0.02, "{power}");
}

#[test]
fn takes_of_changing_speed_fall_into_bins() {
    // Faster and faster, and as much louder: its density is proportional to the speed.
    let rate_hz = 16_000.0;
    let speed = |t: f64| 0.1 * 8.0f64.powf(t / 20.0);
    let samples = noise(rate_hz, 20.0, 1.0, 3);
    let louder =
        samples.iter().enumerate().map(|(n, v)| (speed(n as f64 / rate_hz) * 0.1 * f64::from(*v)) as f32);
    let rows: Vec<[f64; 2]> = (0..=2000).map(|n| [0.01 * f64::from(n), speed(0.01 * f64::from(n))]).collect();
    let motion = Motion::from_speeds(&rows).unwrap();
    let gathering = Gathering { bins: 6, ..Gathering::default() };
    let (spectra, counts) = measure(&[take(louder.collect(), rate_hz, motion)], &gathering).unwrap();
    assert_eq!(spectra.measured().len(), 6);
    assert_eq!(counts[0].clips, 799);
    for spectrum in spectra.measured() {
        let power = spectrum.density.iter().map(|a| a * a).sum::<f64>() / spectrum.density.len() as f64;
        let expected = 0.1 * spectrum.speed_mps * (2.0 / rate_hz).sqrt();
        assert!((power.sqrt() / expected - 1.0).abs() < 0.05, "{} m/s", spectrum.speed_mps);
    }
}

#[test]
fn seams_are_left_out_and_noise_is_taken_off() {
    let rate_hz = 48_000.0;
    let mut samples = noise(rate_hz, 8.0, 0.05, 1);
    // A seam every half second, at 1 m/s every half metre.
    for (n, sample) in samples.iter_mut().enumerate() {
        if (n as f64 / rate_hz + 0.01).rem_euclid(0.5) < 0.02 {
            *sample += 0.8;
        }
    }
    let seams = Seams { places_m: vec![[0.48, 0.52]], round_m: 0.5, ..Seams::default() };
    let gated = Take { seams, ..take(samples.clone(), rate_hz, Motion::Steady(1.0)) };
    let (spectra, counts) = measure(&[gated], &Gathering::default()).unwrap();
    assert!(counts[0].seams > 30 && counts[0].clips > 200, "{counts:?}");
    let level =
        |spectra: &FrictionSpectra| super::super::spectra::power(&spectra.measured()[0].density, SPACING_HZ);
    assert!((level(&spectra) / 0.0025 - 1.0).abs() < 0.03, "{}", level(&spectra));
    let (with, _) = measure(&[take(samples, rate_hz, Motion::Steady(1.0))], &Gathering::default()).unwrap();
    assert!(level(&with) > 1.5 * level(&spectra));

    let loud: Vec<f32> =
        noise(rate_hz, 8.0, 0.05, 1).iter().zip(noise(rate_hz, 8.0, 0.05, 2)).map(|(a, b)| a + b).collect();
    let takes = [
        take(loud, rate_hz, Motion::Steady(0.2)),
        take(noise(rate_hz, 8.0, 0.05, 5), rate_hz, Motion::Steady(0.0)),
    ];
    let (cleaned, _) = measure(&takes, &Gathering::default()).unwrap();
    assert_eq!(cleaned.measured().len(), 1);
    assert!((level(&cleaned) / 0.0025 - 1.0).abs() < 0.05, "{}", level(&cleaned));
}

#[test]
fn what_gives_no_spectrum_is_refused() {
    let short = take(vec![0.0; 100], 48_000.0, Motion::Steady(1.0));
    assert!(
        measure(&[short], &Gathering::default()).unwrap_err().to_string().contains("shorter than a clip")
    );
    let still = take(vec![0.0; 48_000], 48_000.0, Motion::Steady(0.0));
    assert!(measure(&[still], &Gathering::default()).unwrap_err().to_string().contains("fast enough"));
    assert!(measure(&[], &Gathering::default()).is_err());
    let slow = take(vec![0.0; 4800], 1_000.0, Motion::Steady(1.0));
    assert!(measure(&[slow], &Gathering::default()).is_err());
    let bad = Gathering { bins: 0, ..Gathering::default() };
    assert!(measure(&[], &bad).unwrap_err().to_string().contains("bins"));
}
