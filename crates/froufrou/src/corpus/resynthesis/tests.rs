use super::*;
use crate::corpus::dictionary::{Action, Example, Settings};
use crate::corpus::distance::{log_spectral_distance_db, signal_to_noise_db};

const RATE_HZ: u32 = 44_100;

/// Hits of one body, at times and strengths of their own.
fn hits(seed: u64, count: u64) -> Vec<f32> {
    let random = Random::new(seed, 1);
    let mut sound = vec![0.0f32; 12_000 * count as usize];
    for hit in 0..count {
        let at = 12_000 * hit as usize + 500 + random.below(hit, 3000);
        let strength = 0.2 + 0.5 * random.uniform(100 + hit);
        for i in at..sound.len().min(at + 9000) {
            let t = (i - at) as f64 / f64::from(RATE_HZ);
            let ring: f64 = [620.0, 1730.0, 4100.0]
                .iter()
                .map(|hz| (-t * hz / 25.0).exp() * (std::f64::consts::TAU * hz * t).sin() / 3.0)
                .sum();
            let click = (-t * 900.0).exp() * (2.0 * random.uniform(1000 + i as u64) - 1.0);
            sound[i] += (strength * (ring + 0.3 * click)) as f32;
        }
    }
    sound
}

fn slide(seed: u64) -> Vec<f32> {
    let random = Random::new(seed, 2);
    let mut low = 0.0;
    (0..40_000u64)
        .map(|i| {
            let t = i as f64 / f64::from(RATE_HZ);
            low += 0.3 * (random.uniform(i) - 0.5 - low);
            (low * (0.6 + 0.3 * (9.0 * t).sin()) + 0.1 * (5000.0 * t).sin()) as f32
        })
        .collect()
}

fn dictionary() -> Dictionary {
    let example = |name: &str, samples, action: Action| Example {
        name: name.into(),
        samples,
        rate_hz: RATE_HZ,
        contact: action.contact(),
        action,
    };
    let all = [
        example("hits a", hits(1, 4), Action::Hit),
        example("hits b", hits(2, 4), Action::Hit),
        example("hits c", hits(3, 4), Action::Hit),
        example("slide a", slide(1), Action::Slide),
        example("slide b", slide(2), Action::Slide),
    ];
    Dictionary::build(all, None, &Settings::default()).unwrap()
}

fn energy(samples: &[f32]) -> f64 {
    samples.iter().map(|v| f64::from(*v).powi(2)).sum()
}

#[test]
fn a_recording_comes_back_from_its_own_grains() {
    let dictionary = dictionary();
    for (number, recording) in dictionary.recordings().iter().enumerate() {
        let sequence = resynthesise(&dictionary, number, Own::With).unwrap();
        let ratio = signal_to_noise_db(&sequence.render(&dictionary), &dictionary.sound(number)).unwrap();
        println!("{}: {ratio} dB with its own", recording.name);
        assert!(ratio > 25.0, "{}: {ratio} dB", recording.name);
    }
}

#[test]
fn without_its_own_grains_it_is_nearer_than_by_power_alone() {
    let dictionary = dictionary();
    for (number, recording) in dictionary.recordings().iter().enumerate() {
        let sound = dictionary.sound(number);
        let sequence = resynthesise(&dictionary, number, Own::Without).unwrap();
        assert!(sequence.chosen.iter().all(|c| dictionary.grains()[c.grain].recording != number));
        let [ours, theirs] = [sequence, by_power(&dictionary, number).unwrap()]
            .map(|sequence| log_spectral_distance_db(&sequence.render(&dictionary), &sound).unwrap());
        println!("{}: {ours} dB, by power {theirs} dB", recording.name);
        assert!(ours < theirs, "{}: {ours} dB, by power {theirs} dB", recording.name);
    }
}

#[test]
fn stretched_hits_are_as_far_apart_as_asked_for() {
    let dictionary = dictionary();
    for factor in [0.5, 1.7, 3.0] {
        let sequence = stretch(&dictionary, 0, Own::With, factor).unwrap();
        let sound = sequence.render(&dictionary);
        assert_eq!(sound.len(), (48_000.0 * factor).round() as usize);
        // Each attack is where it was, times the factor.
        let original = dictionary.sound(0);
        for hit in 0..4 {
            let piece = &original[12_000 * hit..12_000 * (hit + 1)];
            let attack = piece.iter().position(|v| v.abs() > 0.1).unwrap() + 12_000 * hit;
            let wanted = (attack as f64 * factor) as usize;
            let found = sound[wanted.saturating_sub(700)..(wanted + 700).min(sound.len())]
                .iter()
                .fold(0.0f32, |most, v| most.max(v.abs()));
            assert!(found > 0.1, "{factor}: hit {hit} at {wanted}");
        }
    }
    assert!(stretch(&dictionary, 0, Own::With, f64::NAN).is_err());
    assert!(stretch(&dictionary, 9, Own::With, 1.0).is_err());
}

#[test]
fn a_stretched_slide_has_no_gaps_and_keeps_its_power() {
    let dictionary = dictionary();
    let original = dictionary.sound(3);
    let power = |samples: &[f32]| energy(samples) / samples.len() as f64;
    for factor in [0.4, 1.0, 2.5] {
        let sound = stretch(&dictionary, 3, Own::With, factor).unwrap().render(&dictionary);
        let ratio = power(&sound) / power(&original);
        assert!((0.7..1.4).contains(&ratio), "{factor}: {ratio}");
        let quiet = sound.chunks(500).filter(|chunk| power(chunk) < 0.01 * power(&original)).count();
        assert!(quiet * 20 < sound.len() / 500, "{factor}: {quiet}");
    }
}

#[test]
fn variations_are_alike_and_not_the_same() {
    let dictionary = dictionary();
    let original = dictionary.sound(0);
    let variations: Vec<Vec<f32>> =
        (0..3).map(|seed| vary(&dictionary, 0, Own::With, seed).unwrap().render(&dictionary)).collect();
    assert_eq!(variations[1], vary(&dictionary, 0, Own::With, 1).unwrap().render(&dictionary));
    for (seed, sound) in variations.iter().enumerate() {
        assert!(*sound != variations[(seed + 1) % 3]);
        let alike_db = signal_to_noise_db(sound, &original).unwrap();
        println!("seed {seed}: {alike_db} dB");
        assert!(alike_db < 25.0, "{alike_db} dB");
        let near = log_spectral_distance_db(sound, &original).unwrap();
        let far = log_spectral_distance_db(&dictionary.sound(1), &original).unwrap();
        assert!(near < far, "{seed}: {near} dB, another recording {far} dB");
        assert!((0.4..2.0).contains(&(energy(sound) / energy(&original))));
    }
}

#[test]
fn a_rhythm_is_taken_over_with_its_levels() {
    let dictionary = dictionary();
    let sequence = rhythm(&dictionary, 1, 2).unwrap();
    assert!(sequence.chosen.iter().all(|c| dictionary.grains()[c.grain].recording == 1));
    let (sound, wanted) = (sequence.render(&dictionary), dictionary.sound(2));
    assert_eq!(sound.len(), wanted.len());
    let levels = |samples: &[f32]| -> Vec<f64> {
        samples.chunks(1000).map(|c| (energy(c) / c.len() as f64 + 1e-8).ln()).collect()
    };
    let (a, b) = (levels(&sound), levels(&wanted));
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (ma, mb) = (mean(&a), mean(&b));
    let product = |x: &[f64], mx: f64, y: &[f64], my: f64| -> f64 {
        x.iter().zip(y).map(|(x, y)| (x - mx) * (y - my)).sum()
    };
    let correlation = product(&a, ma, &b, mb) / (product(&a, ma, &a, ma) * product(&b, mb, &b, mb)).sqrt();
    assert!(correlation > 0.85, "{correlation}");
    // A slide in the rhythm of hits: of other kinds.
    assert!(!rhythm(&dictionary, 3, 0).unwrap().chosen.is_empty());
    assert!(rhythm(&dictionary, 0, 17).is_err());
}

#[test]
fn a_dictionary_of_one_recording_and_silence_has_nothing_to_choose() {
    let silent = Example {
        name: "silence".into(),
        samples: vec![0.0; 9000],
        rate_hz: RATE_HZ,
        contact: Contact::Impulsive,
        action: Action::Hit,
    };
    let dictionary = Dictionary::build([silent], None, &Settings::default()).unwrap();
    for sequence in [
        resynthesise(&dictionary, 0, Own::With),
        resynthesise(&dictionary, 0, Own::Without),
        by_power(&dictionary, 0),
        vary(&dictionary, 0, Own::With, 1),
        stretch(&dictionary, 0, Own::With, 2.0),
    ] {
        let sequence = sequence.unwrap();
        assert!(sequence.chosen.is_empty() && sequence.render(&dictionary).iter().all(|v| *v == 0.0));
    }
    assert!(rhythm(&dictionary, 0, 0).unwrap_err().to_string().contains("silence has no grains"));
}
