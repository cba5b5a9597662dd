use super::*;
use crate::random::Random;

/// A hump of a width about a frequency, on a floor that is nowhere 0.
fn hump(speed_mps: f64, centre_hz: f64, width_hz: f64, level: f64) -> Spectrum {
    let density = (1..=600).map(|k| {
        let f = f64::from(k) * SPACING_HZ;
        level * ((-0.5 * ((f - centre_hz) / width_hz).powi(2)).exp() + 1e-4)
    });
    Spectrum { speed_mps, density: density.collect() }
}

fn three() -> FrictionSpectra {
    let spectra =
        vec![hump(0.4, 5000.0, 700.0, 0.03), hump(0.1, 1000.0, 300.0, 0.01), hump(0.2, 2500.0, 400.0, 0.015)];
    FrictionSpectra::new(SPACING_HZ, spectra).unwrap()
}

#[test]
fn agrees_with_numpy() {
    #[derive(serde::Deserialize)]
    struct Case {
        speed_mps: f64,
        density: Vec<f64>,
    }
    #[derive(serde::Deserialize)]
    struct Golden {
        spacing_hz: f64,
        speeds_mps: Vec<f64>,
        measured: Vec<Vec<f64>>,
        expected: Vec<Case>,
    }
    let text = std::fs::read_to_string("tests/fixtures/cloth/friction.json").unwrap();
    let golden: Golden = serde_json::from_str(&text).unwrap();
    let measured = golden.speeds_mps.iter().zip(golden.measured);
    let spectra = measured.map(|(&speed_mps, density)| Spectrum { speed_mps, density }).collect();
    let spectra = FrictionSpectra::new(golden.spacing_hz, spectra).unwrap();
    assert!(golden.expected.len() >= 10);
    for case in golden.expected {
        let found = spectra.at(case.speed_mps);
        assert_eq!(found.len(), case.density.len());
        let loudest = case.density.iter().fold(0.0f64, |a, b| a.max(*b));
        for (k, (found, expected)) in found.iter().zip(&case.density).enumerate() {
            let off = (found - expected).abs() / loudest;
            assert!(off < 1e-9, "at {} m/s, value {k}: {found}, expected {expected}", case.speed_mps);
        }
    }
}

#[test]
fn measured_speeds_give_what_was_measured_and_their_neighbourhood_nearly_so() {
    let spectra = three();
    for spectrum in spectra.measured() {
        assert_eq!(spectra.at(spectrum.speed_mps), spectrum.density);
        for near in [spectrum.speed_mps * (1.0 - 1e-7), spectrum.speed_mps * (1.0 + 1e-7)] {
            for (found, expected) in spectra.at(near).iter().zip(&spectrum.density) {
                assert!((found - expected).abs() < 1e-6 * 0.03, "{near}: {found}, {expected}");
            }
        }
    }
}

#[test]
fn the_pitch_slides_and_does_not_cross_fade() {
    let spectra = three();
    let mut before = 0.0;
    for step in 0..=300 {
        let speed = 0.1 + 0.001 * f64::from(step);
        let found = spectra.at(speed);
        let centroid = centroid_hz(&found, SPACING_HZ);
        assert!(centroid >= before, "{speed}: {centroid} Hz after {before} Hz");
        before = centroid;
        // One hump alone: rising to its top, falling from there, but for a floor.
        let top = found.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).unwrap().0;
        let floor = found[top] * 0.02;
        let rises = found[..top].windows(2).all(|pair| pair[1] >= pair[0] * 0.98 || pair[0] < floor);
        let falls = found[top..].windows(2).all(|pair| pair[1] <= pair[0] * 1.02 || pair[1] < floor);
        assert!(rises && falls, "{speed} m/s has more than one hump");
    }
}

#[test]
fn totals_are_interpolated_and_means_of_quantiles_too() {
    let spectra = three();
    let [a, b, _] = [0, 1, 2].map(|k| &spectra.measured()[k]);
    for along in [0.1, 0.37, 0.5, 0.9] {
        let found = spectra.at(0.1 + 0.1 * along);
        let total = found.iter().sum::<f64>() * SPACING_HZ;
        let expected = a.total(SPACING_HZ) * (1.0 - along) + b.total(SPACING_HZ) * along;
        assert!((total / expected - 1.0).abs() < 1e-12, "{total}, {expected}");
        // The centroid is the mean of c⁻¹, and so interpolated itself, but for the width of bands.
        let [low, high] = [a, b].map(|spectrum| centroid_hz(&spectrum.density, SPACING_HZ));
        let expected = low * (1.0 - along) + high * along;
        assert!((centroid_hz(&found, SPACING_HZ) - expected).abs() < 1.0);
    }
}

#[test]
fn slow_sounds_die_with_the_square_of_speed_and_fast_ones_stay() {
    let spectra = three();
    let slowest = &spectra.measured()[0];
    for part in [1e-3, 0.25, 0.5, 1.0 - 1e-9] {
        for (found, measured) in spectra.at(0.1 * part).iter().zip(&slowest.density) {
            assert!((found - measured * part * part).abs() <= 1e-12 * measured);
        }
    }
    assert_eq!(spectra.at(0.0), vec![0.0; 600]);
    assert_eq!(spectra.at(f64::NAN), vec![0.0; 600]);
    assert_eq!(spectra.at(-0.2), spectra.at(0.2));
    assert_eq!(spectra.at(1e300), spectra.measured()[2].density);
}

#[test]
fn spectra_with_gaps_and_of_silence_are_interpolated() {
    let random = Random::new(1, 2);
    let sparse = |seed: u64, speed_mps: f64| {
        let density = (0..200).map(|k| {
            let value = random.uniform(seed * 1000 + k);
            if value < 0.8 { 0.0 } else { value }
        });
        Spectrum { speed_mps, density: density.collect() }
    };
    let silent = Spectrum { speed_mps: 0.5, density: vec![0.0; 200] };
    let all = vec![sparse(1, 0.1), sparse(2, 0.2), silent];
    let spectra = FrictionSpectra::new(SPACING_HZ, all).unwrap();
    for step in 0..=400 {
        let speed = 0.1 + 0.001 * f64::from(step);
        let found = spectra.at(speed);
        assert!(found.iter().all(|a| a.is_finite() && *a >= 0.0));
        let total = found.iter().sum::<f64>();
        let totals = spectra.measured().iter().map(|s| s.density.iter().sum::<f64>()).collect::<Vec<_>>();
        let expected = if speed <= 0.2 {
            totals[0] + (totals[1] - totals[0]) * (speed - 0.1) / 0.1
        } else {
            totals[1] * (0.5 - speed) / 0.3
        };
        assert!((total - expected.max(0.0)).abs() < 1e-9 * totals[1], "{speed}: {total}, {expected}");
    }
}

#[test]
fn what_are_no_spectra_is_refused() {
    let one = |speed_mps, density: Vec<f64>| Spectrum { speed_mps, density };
    for (bad, what) in [
        (vec![], "no spectrum"),
        (vec![one(0.1, vec![])], "values"),
        (vec![one(0.1, vec![1.0]), one(0.1, vec![1.0])], "two spectra"),
        (vec![one(0.1, vec![1.0]), one(0.2, vec![1.0, 2.0])], "another"),
        (vec![one(0.0, vec![1.0])], "more than 0"),
        (vec![one(f64::NAN, vec![1.0])], "NaN"),
        (vec![one(0.1, vec![-1.0])], "-1"),
        (vec![one(0.1, vec![f64::INFINITY])], "inf"),
    ] {
        let error = FrictionSpectra::new(20.0, bad).unwrap_err().to_string();
        assert!(error.contains(what), "{error}");
    }
    assert!(FrictionSpectra::new(0.0, vec![one(0.1, vec![1.0])]).is_err());
}
