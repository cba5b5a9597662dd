use std::f64::consts::TAU;

use proptest::prelude::*;

use super::*;
use crate::random::Random;

fn tones(rate_hz: u32, length: usize, tones: &[(f64, f64, f64)]) -> Vec<f32> {
    let turn = |hz: f64, i: usize| TAU * hz * i as f64 / f64::from(rate_hz);
    (0..length)
        .map(|i| tones.iter().map(|&(hz, a, p)| a * (turn(hz, i) + p).cos()).sum::<f64>() as f32)
        .collect()
}

fn noise(seed: u64, length: usize) -> Vec<f32> {
    let random = Random::new(seed, 0);
    (0..length as u64).map(|i| 2.0 * random.uniform(i) as f32 - 1.0).collect()
}

fn energy(samples: &[f32]) -> f64 {
    samples.iter().map(|&v| f64::from(v).powi(2)).sum()
}

fn db(ratio: f64) -> f64 {
    10.0 * ratio.log10()
}

#[test]
fn partials_are_recovered_at_any_rate() {
    for rate_hz in [8_000, 22_050, 44_100, 48_000, 96_000, 192_000] {
        let wanted = [(211.3, 0.3, 0.4), (523.7, 0.1, -2.0), (1987.6, 0.03, 1.0), (3501.9, 0.004, 3.0)];
        let sound = tones(rate_hz, rate_hz as usize / 2, &wanted);
        let partials = SpectralModel::default().analyse(&sound, rate_hz).unwrap();
        let middle = rate_hz as usize / 4 / partials.hop;
        for (hz, amplitude, phase) in wanted {
            let keys: Vec<Key> = partials
                .partials
                .iter()
                .filter_map(|p| p.keys.get(middle.checked_sub(p.first_frame)?))
                .filter(|key| (key.frequency_hz - hz).abs() < 20.0)
                .copied()
                .collect();
            let [key] = keys.as_slice() else { panic!("{rate_hz} Hz: {} near {hz} Hz", keys.len()) };
            assert!((key.frequency_hz / hz - 1.0).abs() < 0.001, "{rate_hz}, {hz}: {}", key.frequency_hz);
            let off_db = 2.0 * db(key.amplitude / amplitude);
            assert!(off_db.abs() < 0.1, "{rate_hz}, {hz}: {off_db} dB");
            let at_s = (middle * partials.hop) as f64 / f64::from(rate_hz);
            let off = (key.phase - phase - TAU * hz * at_s).rem_euclid(TAU);
            assert!(off.min(TAU - off) < 0.02, "{rate_hz}, {hz}: {off} rad");
        }
        let residual = partials.residual(&sound);
        let left_db = db(energy(&residual) / energy(&sound));
        assert!(left_db < -40.0, "{rate_hz}: {left_db} dB");
    }
}

#[test]
fn a_glide_is_followed() {
    let rate = 44_100.0;
    // 500 Hz to 1500 Hz in two seconds.
    let sound: Vec<f32> =
        (0..88_200).map(|i| i as f64 / rate).map(|t| (TAU * (500.0 + 250.0 * t) * t).cos() as f32).collect();
    let partials = SpectralModel::default().analyse(&sound, 44_100).unwrap();
    let longest = partials.partials.iter().max_by_key(|p| p.keys.len()).unwrap();
    assert!(longest.keys.len() > 650, "{}", longest.keys.len());
    for (i, key) in longest.keys.iter().enumerate().skip(20).take(600) {
        let t = ((longest.first_frame + i) * partials.hop) as f64 / rate;
        assert!((key.frequency_hz - 500.0 - 500.0 * t).abs() < 1.5, "{t}: {}", key.frequency_hz);
    }
    assert!(db(energy(&partials.residual(&sound)) / energy(&sound)) < -30.0);
}

#[test]
fn a_partial_is_born_and_dies() {
    let mut sound = vec![0.0; 44_100];
    sound[15_000..30_000].copy_from_slice(&tones(44_100, 15_000, &[(1000.0, 0.5, 0.0)]));
    let partials = SpectralModel::default().analyse(&sound, 44_100).unwrap();
    let longest = partials.partials.iter().max_by_key(|p| p.keys.len()).unwrap();
    let [birth, death] =
        [longest.first_frame, longest.first_frame + longest.keys.len()].map(|f| f * partials.hop);
    // A window sees what is up to half its length away.
    assert!(birth.abs_diff(15_000) < 1200 && death.abs_diff(30_000) < 1200, "{birth} {death}");
    let rendered = partials.render();
    assert!(energy(&rendered[..13_500]) == 0.0 && energy(&rendered[31_500..]) == 0.0);
}

#[test]
fn what_is_added_is_the_cubic_of_mcaulay_and_quatieri() {
    // Two keys of a sinusoid whose phase is a cubic anyway: the path between them is that cubic.
    let (a, b, c, d) = (0.3, 0.11, 2e-5, -1e-7);
    let phase = |t: f64| a + t * (b + t * (c + t * d));
    let speed = |t: f64| b + t * (2.0 * c + t * 3.0 * d);
    let hop = 100;
    let keys = (0..4)
        .map(|m| {
            let t = (m * hop) as f64;
            Key { frequency_hz: speed(t) * 44_100.0 / TAU, amplitude: 0.5 + 0.001 * t, phase: phase(t) }
        })
        .collect();
    let partials =
        Partials { rate_hz: 44_100, hop, length: 301, partials: vec![Partial { first_frame: 0, keys }] };
    for (i, value) in partials.render().iter().enumerate() {
        let t = i as f64;
        assert!((f64::from(*value) - (0.5 + 0.001 * t) * phase(t).cos()).abs() < 1e-6, "{i}");
    }
}

#[test]
fn noise_stays_in_the_residual_and_a_tone_leaves_it() {
    let hiss: Vec<f32> = noise(1, 44_100).iter().map(|v| 0.01 * v).collect();
    let tone = tones(44_100, 44_100, &[(880.0, 0.5, 0.0)]);
    let sound: Vec<f32> = hiss.iter().zip(&tone).map(|(a, b)| a + b).collect();
    let model = SpectralModel { threshold_db: -40.0, ..SpectralModel::default() };
    let split = model.split(&sound, 44_100).unwrap();
    let off: Vec<f32> = split.residual.iter().zip(&hiss).map(|(a, b)| a - b).collect();
    assert!(db(energy(&off) / energy(&tone)) < -40.0);
}

#[test]
fn a_gain_changes_levels_alone() {
    let sound = noise(2, 8000);
    let quiet: Vec<f32> = sound.iter().map(|v| v / 64.0).collect();
    let [a, b] = [sound, quiet].map(|s| SpectralModel::default().analyse(&s, 16_000).unwrap());
    assert_eq!(a.partials.len(), b.partials.len());
    let keys = |p: &Partials| p.partials.iter().flat_map(|p| p.keys.clone()).collect::<Vec<_>>();
    for (a, b) in keys(&a).iter().zip(keys(&b)) {
        assert!((a.frequency_hz - b.frequency_hz).abs() < 1e-6);
        assert!((a.amplitude / b.amplitude / 64.0 - 1.0).abs() < 1e-4);
    }
}

#[test]
fn a_shift_by_hops_shifts_the_partials() {
    let sound = tones(8000, 4000, &[(700.0, 0.4, 0.0), (1900.0, 0.2, 1.0)]);
    let model = SpectralModel { hop_s: 0.004, corrections: 0, ..SpectralModel::default() };
    let longer = [vec![0.0; 3200], sound.clone(), vec![0.0; 3200]].concat();
    let shifted = model.analyse(&[vec![0.0; 1600], sound, vec![0.0; 4800]].concat(), 8000).unwrap();
    let plain = model.analyse(&longer, 8000).unwrap();
    let moved: Vec<Partial> = shifted
        .partials
        .iter()
        .map(|p| Partial { first_frame: p.first_frame + 1600 / 32, keys: p.keys.clone() })
        .collect();
    assert_eq!(plain.partials, moved);
}

#[test]
fn silence_and_a_constant_have_no_partials_in_them() {
    let model = SpectralModel::default();
    let silence = model.split(&[0.0; 5000], 44_100).unwrap();
    assert_eq!(silence, Split { sinusoids: vec![0.0; 5000], residual: vec![0.0; 5000] });
    let constant = vec![0.25; 20_000];
    let split = model.split(&constant, 44_100).unwrap();
    // The edges are steps, which sound; the middle does not.
    assert!(split.sinusoids[4000..16_000].iter().all(|v| v.abs() < 1e-3));
}

#[test]
fn bad_sound_and_bad_settings_are_errors() {
    let model = SpectralModel::default();
    let message = |r: Result<Partials>| r.unwrap_err().to_string();
    assert_eq!(message(model.analyse(&[], 44_100)), "expected sound, found 0 samples");
    assert_eq!(
        message(model.analyse(&[0.0, 1.0, f32::NAN], 44_100)),
        "sample 2: the sample is NaN, expected a finite number"
    );
    assert!(message(model.analyse(&[0.0], 0)).contains("the rate is 0 Hz"));
    for bad in [
        SpectralModel { window_s: f64::NAN, ..model.clone() },
        SpectralModel { hop_s: 0.0, ..model.clone() },
        SpectralModel { threshold_db: 3.0, ..model.clone() },
        SpectralModel { deviation_hz: f64::INFINITY, ..model.clone() },
    ] {
        assert!(message(bad.analyse(&[0.0; 10], 44_100)).contains("expected"));
    }
}

#[test]
fn the_bytes_do_not_depend_on_the_number_of_threads() {
    let sound = noise(3, 30_000);
    let split = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| SpectralModel::default().split(&sound, 44_100).unwrap())
    };
    assert_eq!(split(1), split(5));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn the_parts_add_up_to_the_whole(
        length in 1usize..6000,
        seed in any::<u64>(),
        rate_hz in 8_000u32..=192_000,
        hop_s in 0.0005f64..0.02,
        scale in prop::sample::select(vec![1.0f32, 1e-3, 0.3]),
    ) {
        let hiss = noise(seed, length);
        let tone = tones(rate_hz, length, &[(1000.0, 0.5, 0.0)]);
        let sound: Vec<f32> = hiss.iter().zip(&tone).map(|(a, b)| scale * (0.5 * a + b)).collect();
        let split = SpectralModel { hop_s, ..SpectralModel::default() }.split(&sound, rate_hz).unwrap();
        prop_assert_eq!(split.sinusoids.len(), length);
        for ((whole, a), b) in sound.iter().zip(&split.sinusoids).zip(&split.residual) {
            prop_assert!((whole - (a + b)).abs() <= 1e-6);
        }
        // Taking away what was found leaves less, not more.
        prop_assert!(energy(&split.residual) <= 1.0001 * energy(&sound) + 1e-12);
    }
}
