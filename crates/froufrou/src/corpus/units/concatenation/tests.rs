use proptest::prelude::*;

use super::*;
use crate::corpus::units::features::Extractor;
use crate::corpus::units::high_pass::HighPass;
use crate::corpus::units::selection::{Index, greedy};
use crate::corpus::units::warp::Warp;
use crate::corpus::units::{FeatureSettings, SelectionSettings};
use crate::random::Random;

const RATE_HZ: u32 = 48_000;
const UNIT: usize = 202;

/// Rustling that swells and fades, high-passed: noise under a low-pass, louder and brighter by turns.
fn rustle(seed: u64, samples: usize) -> Vec<f32> {
    let random = Random::new(seed, 0);
    let (mut a, mut b) = (0.0f64, 0.0f64);
    let mut sound: Vec<f32> = (0..samples)
        .map(|i| {
            let t = i as f64 / f64::from(RATE_HZ);
            let slow = (PI * 2.3 * t + seed as f64).sin() * (PI * 0.7 * t).cos();
            let quick = (PI * 17.0 * t + 2.0 * seed as f64).sin() + (PI * 27.0 * t).cos();
            let loud = (-3.0 + 2.0 * slow + quick).exp();
            let bright = 0.1 + 0.1 * (PI * 3.1 * t).sin().powi(2);
            a += bright * (random.normal(i as u64) - a);
            b += bright * (a - b);
            (loud * b) as f32
        })
        .collect();
    HighPass::new(100.0, RATE_HZ).unwrap().process(&mut sound);
    sound
}

#[test]
fn a_recording_in_order_is_the_recording() {
    let sound = rustle(1, 20_000);
    let memory = InMemory::new(vec![sound.clone()], UNIT);
    let chosen: Vec<usize> = (0..memory.units()[0]).collect();
    let concatenation = Concatenation::new(&memory, UNIT, RATE_HZ);
    assert_eq!(concatenation.render(&chosen, 0, sound.len(), 0..sound.len()).unwrap(), sound);
}

#[test]
fn any_range_alone_is_that_part_of_the_whole() {
    let memory = InMemory::new(vec![rustle(2, 30_000), rustle(3, 9_999)], UNIT);
    let random = Random::new(4, 0);
    let units: usize = memory.units().iter().sum();
    let chosen: Vec<usize> = (0..90).map(|i| random.below(i, units)).collect();
    let frames = 90 * UNIT - 77;
    let concatenation = Concatenation::new(&memory, UNIT, RATE_HZ);
    let whole = concatenation.render(&chosen, 0, frames, 0..frames).unwrap();
    assert_eq!(whole.len(), frames);
    for range in [0..1, 0..UNIT, 100..5000, UNIT * 7..UNIT * 8, frames - 300..frames, 17_000..99_999] {
        let part = concatenation.render(&chosen, 0, frames, range.clone()).unwrap();
        assert_eq!(part, whole[range.start..range.end.min(frames)], "{range:?}");
    }
    // Block by block.
    let blocks: Vec<f32> = (0..frames)
        .step_by(1000)
        .flat_map(|at| concatenation.render(&chosen, 0, frames, at..at + 1000).unwrap())
        .collect();
    assert_eq!(blocks, whole);
}

/// Any units in any order make no step larger than the recordings have, while without joins they do.
#[test]
fn no_step_is_larger_than_those_of_the_recordings() {
    for seed in 0..6 {
        // Even noise: every unit is as loud as the recording.
        let random = Random::new(seed, 1);
        let mut value = [0.0f64; 3];
        let mut sound: Vec<f32> = (0..100_000)
            .map(|i| {
                value[0] += 0.25 * (random.normal(i) - value[0]);
                value[1] += 0.25 * (value[0] - value[1]);
                value[2] += 0.25 * (value[1] - value[2]);
                value[2] as f32
            })
            .collect();
        HighPass::new(100.0, RATE_HZ).unwrap().process(&mut sound);
        let memory = InMemory::new(vec![sound.clone()], UNIT);
        let chosen: Vec<usize> =
            (0..290).map(|i| random.below(1_000_000 + i, memory.units()[0] - 1)).collect();
        let concatenation = Concatenation::new(&memory, UNIT, RATE_HZ);
        let frames = chosen.len() * UNIT;
        let made = concatenation.render(&chosen, 0, frames, 0..frames).unwrap();
        let butted: Vec<f32> = chosen.iter().flat_map(|u| sound[u * UNIT..(u + 1) * UNIT].to_vec()).collect();
        assert!(
            largest_step(&made) <= largest_step(&sound),
            "{} {}",
            largest_step(&made),
            largest_step(&sound)
        );
        assert!(largest_step(&butted) > 1.5 * largest_step(&sound));
        // Cross-fades keep the energy: within a third of a decibel of that of the units.
        let energy = |v: &[f32]| v.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
        let ratio_db = 10.0 * (energy(&made) / energy(&butted)).log10();
        assert!(ratio_db.abs() < 0.33, "{ratio_db} dB");
    }
}

#[test]
fn it_begins_and_ends_softly_away_from_the_ends_of_recordings() {
    let sound: Vec<f32> = (0..10 * UNIT).map(|i| (0.05 * i as f32).cos()).collect();
    let memory = InMemory::new(vec![sound], UNIT);
    let concatenation = Concatenation::new(&memory, UNIT, RATE_HZ);
    let made = concatenation.render(&[3, 4, 5], 0, 3 * UNIT - 50, 0..9999).unwrap();
    assert_eq!(made.len(), 3 * UNIT - 50);
    assert!(made[0].abs() < 0.02 && made[made.len() - 1].abs() < 0.02);
}

fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut ranks = vec![0.0; values.len()];
    order.iter().enumerate().for_each(|(rank, i)| ranks[*i] = rank as f64);
    ranks
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (ma, mb) = (mean(a), mean(b));
    let sum = |f: &dyn Fn(f64, f64) -> f64| a.iter().zip(b).map(|(a, b)| f(a - ma, b - mb)).sum::<f64>();
    sum(&|a, b| a * b) / (sum(&|a, _| a * a) * sum(&|_, b| b * b)).sqrt()
}

fn unit_energies(sound: &[f32]) -> Vec<f64> {
    sound.chunks(UNIT).map(|unit| unit.iter().map(|v| f64::from(*v).powi(2)).sum()).collect()
}

/// Another recording of the same kind follows a target: its loudness unit for unit, without lag.
#[test]
fn loudness_follows_the_target_without_lag() {
    let (target, source) = (rustle(10, 4 * 48_000), rustle(11, 40 * 48_000));
    let extractor = Extractor::new(&FeatureSettings::default(), RATE_HZ).unwrap();
    assert_eq!(extractor.unit_samples(), UNIT);
    let memory = InMemory::new(vec![source.clone()], UNIT);
    let settings = SelectionSettings::default();
    let index = Index::new(&extractor.features(&source), &memory.units(), settings.look_ahead).unwrap();
    let warped = Warp::identity(3).apply_all(&extractor.features(&target)).unwrap();
    let chosen: Vec<usize> = greedy(&index, &warped, &settings).unwrap().iter().map(|c| c.unit).collect();
    for (i, unit) in chosen.iter().enumerate() {
        assert!(!chosen[i + 1..].iter().take(settings.cool_off).any(|later| later == unit), "{i}");
    }
    let made =
        Concatenation::new(&memory, UNIT, RATE_HZ).render(&chosen, 0, target.len(), 0..target.len()).unwrap();
    assert_eq!(made.len(), target.len());
    let (wanted, ours) = (unit_energies(&target), unit_energies(&made));
    let rank = correlation(&ranks(&wanted), &ranks(&ours));
    assert!(rank > 0.9, "rank correlation {rank}");
    // The envelopes fit best where neither is moved by a unit or more.
    let envelope = |sound: &[f32]| -> Vec<f64> {
        let mut level = 0.0;
        let mut out: Vec<f64> = sound
            .iter()
            .map(|v| {
                level += 0.002 * (f64::from(v.abs()) - level);
                level
            })
            .collect();
        out.iter_mut().for_each(|v| *v = v.max(1e-9).ln());
        out
    };
    let (wanted, ours) = (envelope(&target), envelope(&made));
    let fit = |lag: i64| {
        let from = |v: &[f64], by: i64| v[by.max(0) as usize..][..v.len() - 2000].to_vec();
        correlation(&from(&wanted, 1000), &from(&ours, 1000 + lag))
    };
    let best = (-500..=500i64).step_by(20).max_by(|a, b| fit(*a).total_cmp(&fit(*b))).unwrap();
    assert!(best.unsigned_abs() < UNIT as u64, "lag {best}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Tones, noise and clicks, loud and quiet, of units of any length: no step is larger than one of the recordings has.
    #[test]
    fn no_step_is_ever_larger(
        seed in 0u64..1_000_000,
        unit in 1usize..500,
        hz in 120.0f64..20_000.0,
        noise in prop_oneof![Just(0.0), 0.0f64..1.0],
        clicks in 0usize..20,
        cut in 0usize..500,
        offset in prop_oneof![Just(0.0f64), -0.1f64..0.1],
    ) {
        let random = Random::new(seed, 3);
        let stream = |gain: f64, phase: f64| -> Vec<f32> {
            let mut sound: Vec<f32> = (0..20 * unit + 7)
                .map(|i| {
                    let tone = (2.0 * PI * hz * i as f64 / f64::from(RATE_HZ) + phase).sin();
                    (gain * (offset + tone + noise * random.normal(i as u64))) as f32
                })
                .collect();
            for click in 0..clicks as u64 {
                let at = random.below(900_000 + click, sound.len());
                sound[at] += gain as f32;
            }
            sound
        };
        let streams = vec![stream(1.0, 0.0), stream(0.1, 2.0), stream(1.0, 3.0)];
        let largest = streams.iter().map(|stream| largest_step(stream)).fold(0.0, f32::max);
        let gains = [1.0, 0.1, 1.0];
        let relative = |of: &dyn Fn(&[f32]) -> f32| {
            streams.iter().zip(gains).map(|(stream, gain)| of(stream) / gain).collect::<Vec<f32>>()
        };
        let slowest = relative(&largest_step).into_iter().fold(f32::INFINITY, f32::min);
        let loudest = |stream: &[f32]| stream.iter().fold(0.0f32, |peak, v| peak.max(v.abs()));
        let peak = relative(&loudest).into_iter().fold(0.0, f32::max);
        let memory = InMemory::new(streams, unit);
        let units: usize = memory.units().iter().sum();
        let chosen: Vec<usize> = (0..40).map(|i| random.below(800_000 + i, units)).collect();
        let concatenation = Concatenation::new(&memory, unit, RATE_HZ);
        let frames = (40 * unit).saturating_sub(cut);
        let made = concatenation.render(&chosen, 0, frames, 0..frames).unwrap();
        prop_assert_eq!(made.len(), frames);
        // Where a fade has room for it.
        let fade = 2 * ((unit - 1) / 2).min(RATE_HZ as usize / 200) + 1;
        if fade as f32 * slowest >= 2.0 * peak {
            prop_assert!(largest_step(&made) <= largest, "{} {}", largest_step(&made), largest);
        }
    }
}

/// Where nothing can be as even as the recordings are, all steps of a fade are alike.
#[test]
fn what_cannot_be_reached_is_reached_evenly() {
    let mut samples = [9.0, -9.0, 3.0];
    hold(&mut samples, 1.0, -1.0, 0.1);
    assert_eq!(samples, [0.5, 0.0, -0.5]);
}
