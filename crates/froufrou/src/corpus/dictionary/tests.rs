use super::*;
use crate::random::Random;
use std::f64::consts::PI;

const RATE_HZ: u32 = 44_100;

/// A few hits of a body with three modes, each a little different.
pub(super) fn hits(seed: u64, seconds: f64) -> Vec<f32> {
    let random = Random::new(seed, 1);
    let length = (seconds * f64::from(RATE_HZ)) as usize;
    let mut sound = vec![0.0f32; length];
    let mut at = 800;
    let mut hit = 0;
    while at < length {
        let strength = 0.2 + 0.4 * random.uniform(10 * hit);
        let modes: Vec<f64> = [620.0, 1730.0, 4100.0]
            .iter()
            .enumerate()
            .map(|(m, hz)| hz * (0.97 + 0.06 * random.uniform(10 * hit + 1 + m as u64)))
            .collect();
        for (i, to) in sound.iter_mut().enumerate().skip(at).take(12_000) {
            let t = (i - at) as f64 / f64::from(RATE_HZ);
            let ring: f64 = modes
                .iter()
                .enumerate()
                .map(|(m, hz)| {
                    (-t * (30.0 + 25.0 * m as f64)).exp() * (std::f64::consts::TAU * hz * t).sin() / 3.0
                })
                .sum();
            let click = (-t * 900.0).exp() * (2.0 * random.uniform(i as u64 + 7919 * hit) - 1.0);
            *to += (strength * (ring + 0.4 * click)) as f32;
        }
        at += 6000 + random.below(10 * hit + 5, 9000);
        hit += 1;
    }
    sound
}

/// Something rough that slides: noise that swells, over a whistle.
pub(super) fn slide(seed: u64, seconds: f64) -> Vec<f32> {
    let random = Random::new(seed, 2);
    let length = (seconds * f64::from(RATE_HZ)) as u64;
    (0..length)
        .map(|i| {
            let t = i as f64 / f64::from(RATE_HZ);
            let swell = 0.15 + 0.1 * (5.0 * t + seed as f64).sin();
            let whistle = 0.2 * (std::f64::consts::TAU * (900.0 + 40.0 * seed as f64) * t).sin();
            (swell * (random.uniform(i) - 0.5) + whistle) as f32
        })
        .collect()
}

pub(super) fn examples() -> Vec<Example> {
    let example = |name: &str, samples: Vec<f32>, action: Action| Example {
        name: name.into(),
        samples,
        rate_hz: RATE_HZ,
        contact: action.contact(),
        action,
    };
    vec![
        example("hits a", hits(1, 0.8), Action::Hit),
        example("slide a", slide(1, 0.6), Action::Slide),
        example("hits b", hits(2, 0.7), Action::Hit),
        example("slide b", slide(2, 0.5), Action::Slide),
    ]
}

fn built() -> Dictionary {
    Dictionary::build(examples(), None, &Settings::default()).unwrap()
}

fn power(samples: &[f32]) -> f64 {
    samples.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / samples.len() as f64
}

#[test]
fn grains_are_numbered_by_recording_part_and_time() {
    let dictionary = built();
    assert_eq!(dictionary.rate_hz(), RATE_HZ);
    let mut next = 0;
    for (number, recording) in dictionary.recordings().iter().enumerate() {
        assert_eq!(recording.grains.start, next);
        next = recording.grains.end;
        let entries = &dictionary.grains()[recording.grains.clone()];
        assert!(entries.len() > 5, "{}", recording.name);
        assert!(entries.iter().all(|entry| entry.recording == number));
        let order: Vec<(bool, usize)> =
            entries.iter().map(|e| (e.kind == GrainKind::Transient, e.start)).collect();
        assert!(order.is_sorted());
        let is_impulsive = entries.iter().all(|e| e.kind == GrainKind::Impulsive);
        assert_eq!(is_impulsive, recording.contact == Contact::Impulsive);
    }
    assert_eq!(next, dictionary.grains().len());
    assert!(dictionary.samples(next).is_empty());
}

#[test]
fn a_grain_is_its_piece_and_the_windows_of_neighbours_add_up_to_one() {
    let dictionary = built();
    for (number, recording) in dictionary.recordings().iter().enumerate() {
        for part in &dictionary.parts[number] {
            let mut sum = vec![0.0f64; recording.length];
            for grain in recording.grains.clone() {
                let entry = dictionary.grains()[grain];
                if entry.kind != part.kind {
                    continue;
                }
                let samples = dictionary.samples(grain);
                assert_eq!(samples.len(), entry.length);
                for (i, value) in samples.iter().enumerate() {
                    sum[entry.start + i] += f64::from(*value);
                }
            }
            let off: Vec<f32> =
                sum.iter().zip(&part.samples).map(|(s, x)| (s - f64::from(*x)) as f32).collect();
            let error_db = 10.0 * (power(&off) / power(&part.samples)).log10();
            assert!(error_db < -28.0, "{} {:?}: {error_db} dB", recording.name, part.kind);
        }
    }
}

#[test]
fn a_pattern_is_in_order_and_has_the_power_of_its_recording() {
    let dictionary = built();
    for (number, recording) in dictionary.recordings().iter().enumerate() {
        assert!(recording.pattern.is_sorted_by_key(|placed| placed.start));
        let own = recording.pattern.iter().filter(|p| {
            let grain = p.grain as usize;
            recording.grains.contains(&grain) && dictionary.grains()[grain].start as u64 == p.start
        });
        assert_eq!(own.clone().count(), recording.grains.len());
        assert!(own.clone().all(|p| p.correlation > 0.9 && (0.8..1.25).contains(&p.gain)));
        let others = recording.pattern.len() - recording.grains.len();
        assert!(others > 10, "{others}");
        for placed in &recording.pattern {
            let entry = dictionary.grains()[placed.grain as usize];
            let part = dictionary.parts[number].iter().find(|part| fits(entry.kind, part.kind)).unwrap();
            let there = &part.samples[placed.start as usize..][..entry.length];
            let grain = dictionary.samples(placed.grain as usize);
            let scaled: Vec<f32> = grain.iter().map(|v| v * placed.gain).collect();
            // Raised cosines over the tapers.
            let [left, right] = entry.tapers;
            let rise = |n: usize, taper: usize| {
                if n < taper { (PI * (n as f64 + 0.5) / taper as f64 / 2.0).sin().powi(2) } else { 1.0 }
            };
            let window = |i: usize| (rise(i, left) * rise(entry.length - 1 - i, right)) as f32;
            let wanted: Vec<f32> = there.iter().enumerate().map(|(i, v)| window(i) * v).collect();
            assert!((power(&scaled) / power(&wanted) - 1.0).abs() < 1e-3);
            if recording.grains.contains(&(placed.grain as usize)) && entry.start as u64 == placed.start {
                let off: Vec<f32> = scaled.iter().zip(&wanted).map(|(a, b)| a - b).collect();
                assert!(power(&off) < 1e-9 * power(&wanted), "its own grains add up to it");
            }
            let product: f64 = there.iter().zip(grain).map(|(a, b)| f64::from(a * b)).sum();
            let expected = product / (power(there) * power(grain)).sqrt() / entry.length as f64;
            assert!((expected - f64::from(placed.correlation)).abs() < 0.0021);
        }
    }
}

#[test]
fn a_slot_keeps_no_more_than_it_should() {
    let settings = Settings { candidates: 3, ..Settings::default() };
    let dictionary = Dictionary::build(examples(), None, &settings).unwrap();
    for recording in dictionary.recordings() {
        let mut counts = std::collections::BTreeMap::new();
        for placed in &recording.pattern {
            let entry = dictionary.grains()[placed.grain as usize];
            let is_own = recording.grains.contains(&(placed.grain as usize));
            if !(is_own && entry.start as u64 == placed.start) {
                let key = (placed.start / 441, entry.kind == GrainKind::Sinusoidal, is_own);
                *counts.entry(key).or_insert(0) += 1;
            }
        }
        assert!(counts.iter().all(|((.., is_own), n)| *n <= if *is_own { 2 } else { 3 }));
    }
}

#[test]
fn sounds_of_other_rates_come_to_the_commonest() {
    let mut all = examples();
    let tone = |rate: f64| (0..rate as usize / 2).map(|i| (i as f64 * 3000.0 / rate).sin() as f32).collect();
    all.push(Example {
        name: "fast".into(),
        samples: tone(96_000.0),
        rate_hz: 96_000,
        contact: Contact::Impulsive,
        action: Action::Hit,
    });
    let dictionary = Dictionary::build(all, None, &Settings::default()).unwrap();
    assert_eq!(dictionary.rate_hz(), 44_100);
    let last = dictionary.recordings().last().unwrap();
    assert_eq!(last.length, 22_050);
    let (sound, wanted): (_, Vec<f32>) = (dictionary.sound(4), tone(44_100.0));
    let off: Vec<f32> = sound[100..21_900].iter().zip(&wanted[100..]).map(|(a, b)| a - b).collect();
    assert!(power(&off) < 1e-7, "{}", power(&off));
    assert_eq!(Dictionary::build(examples(), Some(22_050), &Settings::default()).unwrap().rate_hz(), 22_050);
}

#[test]
fn nothing_makes_an_empty_dictionary_and_bad_sounds_are_named() {
    let empty = Dictionary::build([], None, &Settings::default()).unwrap();
    assert!(empty.recordings().is_empty() && empty.grains().is_empty());
    let mut all = examples();
    all[1].samples[7] = f32::NAN;
    let message = Dictionary::build(all, None, &Settings::default()).unwrap_err().to_string();
    assert!(message.starts_with("slide a: ") && message.contains("sample 7"), "{message}");
    let silent = Example { samples: vec![0.0; 5000], ..examples().remove(0) };
    let dictionary = Dictionary::build([silent], None, &Settings::default()).unwrap();
    assert!(dictionary.grains().is_empty() && dictionary.recordings()[0].pattern.is_empty());
    let settings = Settings { slot_s: 0.0, ..Settings::default() };
    assert!(Dictionary::build(examples(), None, &settings).unwrap_err().to_string().contains("slot_s"));
}

#[test]
fn the_dictionary_does_not_depend_on_the_number_of_threads() {
    let built = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(built)
    };
    assert!(built(1) == built(3));
}
