use super::*;
use crate::random::Random;

/// The numbers of one line of the fixture.
pub fn fixture(what: &str) -> Vec<f64> {
    let text = include_str!("../../../../tests/fixtures/units_features.tsv");
    let line = text.lines().find_map(|line| line.strip_prefix(what)?.strip_prefix('\t'));
    line.unwrap_or_else(|| panic!("no {what}")).split('\t').map(|v| v.parse().unwrap()).collect()
}

/// The sound that `oracles/mfcc_golden.py` makes by the same formula.
fn sound(rate_hz: f64, samples: usize) -> Vec<f32> {
    let value = |i: usize| {
        let t = i as f64 / rate_hz;
        let chirp = (TAU * (300.0 + 20_000.0 * t) * t).sin();
        let click = (-400.0 * (t % 0.03)).exp() * (TAU * 3100.0 * t).sin();
        (0.2 * chirp * (1.0 - t * 6.0).max(0.0) + 0.5 * click) as f32
    };
    (0..samples).map(value).collect()
}

fn cases() -> Vec<(&'static str, FeatureSettings, u32)> {
    let plain = FeatureSettings::default();
    vec![
        ("plain", plain.clone(), 96_000),
        ("corduroy", FeatureSettings { unit_s: 0.0167, ..plain.clone() }, 96_000),
        (
            "many",
            FeatureSettings {
                mel_bands: 26,
                coefficients: 13,
                unit_s: 0.01,
                window_s: Some(0.02),
                ..plain.clone()
            },
            44_100,
        ),
        (
            "decibels",
            FeatureSettings {
                logarithm: Logarithm::Decibels,
                window: Window::Rectangular,
                mel_bands: 8,
                coefficients: 5,
                lowest_hz: 200.0,
                highest_hz: Some(16_000.0),
                ..plain
            },
            48_000,
        ),
    ]
}

/// Equals librosa's `mfcc`, from `oracles/mfcc_golden.py`.
#[test]
fn equals_librosa() {
    for (name, settings, rate_hz) in cases() {
        let extractor = Extractor::new(&settings, rate_hz).unwrap();
        let features = extractor.features(&sound(f64::from(rate_hz), rate_hz as usize / 8));
        let wanted = fixture(name);
        assert!(wanted.len() >= 5 * extractor.dimensions(), "{name}: {}", wanted.len());
        assert!(wanted.len() <= features.values().len());
        for (i, (ours, theirs)) in features.values().iter().zip(&wanted).enumerate() {
            assert!((f64::from(*ours) - theirs).abs() < 1e-4, "{name} {i}: {ours} {theirs}");
        }
    }
}

#[test]
fn blocks_do_not_matter() {
    for (name, settings, rate_hz) in cases() {
        let extractor = Extractor::new(&settings, rate_hz).unwrap();
        let sound = sound(f64::from(rate_hz), 9001);
        let whole = extractor.features(&sound);
        for block in [1, 100, 4096, 9001] {
            let mut stream = extractor.stream();
            let mut values = Vec::new();
            for block in sound.chunks(block) {
                values.extend_from_slice(stream.push(block).values());
                assert!(stream.held.len() <= block.len() + extractor.window.len() + extractor.unit);
            }
            values.extend_from_slice(stream.finish().values());
            assert_eq!(values, whole.values(), "{name} {block}");
        }
    }
}

/// f(g x) differs from f(x) by ln g² in every band, which is all in coefficient 0.
#[test]
fn louder_sound_moves_the_first_coefficient_alone() {
    let random = Random::new(3, 0);
    let quiet: Vec<f32> = (0..20_000).map(|i| 0.1 * random.normal(i) as f32).collect();
    let loud: Vec<f32> = quiet.iter().map(|v| 4.0 * v).collect();
    let extractor = Extractor::new(&FeatureSettings::default(), 96_000).unwrap();
    let (quiet, loud) = (extractor.features(&quiet), extractor.features(&loud));
    for (a, b) in quiet.rows().zip(loud.rows()) {
        let moved = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
        assert!((f64::from(moved[0]) - 16f64.ln() * 3f64.sqrt()).abs() < 1e-4, "{moved:?}");
        assert!(moved[1].abs() < 1e-4 && moved[2].abs() < 1e-4);
    }
}

#[test]
fn silence_and_nothing_are_features_too() {
    let extractor = Extractor::new(&FeatureSettings::default(), 48_000).unwrap();
    assert!(extractor.features(&[]).is_empty());
    let silent = extractor.features(&[0.0; 500]);
    assert_eq!(silent.len(), 3);
    assert!(silent.rows().all(|row| f64::from(row[0]) == (3f64.sqrt() * 1e-10f64.ln()) as f32 as f64
        || (f64::from(row[0]) - 3f64.sqrt() * 1e-10f64.ln()).abs() < 1e-4));
}

#[test]
fn settings_that_do_not_fit_a_rate_are_errors() {
    let high = FeatureSettings { highest_hz: Some(20_000.0), ..FeatureSettings::default() };
    assert!(Extractor::new(&high, 48_000).is_ok());
    let told = Extractor::new(&high, 22_050).err().map(|e| e.to_string()).unwrap_or_default();
    assert!(told.contains("half the rate"), "{told}");
    assert!(Extractor::new(&high, 3).is_err());
}
