use std::f64::consts::TAU;

use proptest::prelude::*;

use super::*;
use crate::random::Random;

const RATE_HZ: u32 = 44_100;

fn noise(seed: u64, length: usize) -> Vec<f32> {
    let random = Random::new(seed, 0);
    (0..length as u64).map(|i| 2.0 * random.uniform(i) as f32 - 1.0).collect()
}

/// Noise under hits that fade: loud and quiet, high and low.
fn rattle(seed: u64, length: usize) -> Vec<f32> {
    let random = Random::new(seed, 1);
    let mut last = 0.0;
    noise(seed, length)
        .iter()
        .enumerate()
        .map(|(i, v)| {
            let hit = random.uniform(i as u64 / 700);
            let fade = (-((i % 700) as f64) / (40.0 + 300.0 * hit)).exp();
            last = 0.7 * last + f64::from(*v) * hit * fade;
            last as f32
        })
        .collect()
}

fn pattern(matching: &Matching, grains: &[&[f32]], recording: &[f32]) -> Vec<Peak> {
    Matcher::new(matching.clone(), grains.to_vec(), RATE_HZ).unwrap().pattern(recording).unwrap()
}

/// The definition, word for word.
fn by_definition(matching: &Matching, grains: &[&[f32]], recording: &[f32]) -> Vec<(u32, u64, f64)> {
    let mut found = Vec::new();
    let spacing = (matching.spacing_s * f64::from(RATE_HZ)).round() as usize;
    for (number, grain) in grains.iter().enumerate().filter(|(_, g)| g.len() <= recording.len()) {
        let energy = |s: &[f32]| s.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>();
        let energies: Vec<f64> = recording.windows(grain.len()).map(energy).collect();
        let floor = energies.iter().copied().fold(0.0, f64::max) * 10f64.powf(matching.quietest_db / 10.0);
        let product =
            |w: &[f32]| w.iter().zip(*grain).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum::<f64>();
        let mut values = vec![0.0];
        values.extend(recording.windows(grain.len()).zip(&energies).map(|(window, &e)| {
            if e < floor || e <= 0.0 || energy(grain) <= 0.0 {
                0.0
            } else {
                product(window) / (e * energy(grain)).sqrt()
            }
        }));
        values.push(0.0);
        let peaks: Vec<(usize, f64)> = (1..values.len() - 1)
            .filter(|&i| values[i] > values[i - 1] && values[i] >= values[i + 1])
            .map(|i| (i - 1, values[i]))
            .collect();
        let mut of_grain: Vec<(usize, f64)> = peaks
            .iter()
            .filter(|(at, value)| {
                let is_near = |other: usize| other.abs_diff(*at) < spacing.max(1) && other != *at;
                !peaks.iter().any(|&(o, v)| is_near(o) && (v > *value || (v == *value && o < *at)))
            })
            .filter(|(_, value)| *value > 0.0 && *value >= matching.least_correlation)
            .copied()
            .collect();
        of_grain.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        of_grain.truncate(matching.peaks_per_grain);
        found.extend(of_grain.into_iter().map(|(at, value)| (number as u32, at as u64, value)));
    }
    found
}

fn check(matching: &Matching, grains: &[&[f32]], recording: &[f32]) -> usize {
    let wanted = by_definition(matching, grains, recording);
    let ours = pattern(matching, grains, recording);
    let places = |p: &[Peak]| p.iter().map(|p| (p.grain, p.start)).collect::<Vec<_>>();
    assert_eq!(places(&ours), wanted.iter().map(|w| (w.0, w.1)).collect::<Vec<_>>());
    for (peak, (_, _, value)) in ours.iter().zip(&wanted) {
        assert!((f64::from(peak.correlation) - value).abs() < 1e-6, "{peak:?} {value}");
    }
    wanted.len()
}

#[test]
fn the_peaks_are_those_of_the_definition() {
    let recording = rattle(1, 9000);
    let other = rattle(2, 5000);
    let grains: Vec<&[f32]> = vec![
        &recording[0..300],
        &recording[2000..3100],
        &other[700..1500],
        &recording[8500..9000],
        &other[0..4321],
        &other[1000..1064],
        &recording[..],
    ];
    for (peaks_per_grain, least_correlation, spacing_s) in
        [(8, 0.1, 0.01), (3, 0.0, 0.002), (1, 0.3, 0.1), (1000, 0.05, 0.0)]
    {
        let matching = Matching { peaks_per_grain, least_correlation, spacing_s, ..Matching::default() };
        assert!(check(&matching, &grains, &recording) > 4);
        check(&matching, &grains, &other);
    }
}

#[test]
fn many_blocks_are_searched_as_one() {
    // A click every thousand samples: each is a peak, whichever block it is in and wherever their borders are.
    let grain = noise(3, 100);
    let mut recording = vec![0.0; 60_000];
    for start in (0..59_900).step_by(997) {
        for (to, from) in recording[start..].iter_mut().zip(&grain) {
            *to = *from;
        }
    }
    let matching = Matching { peaks_per_grain: 100, least_correlation: 0.9, ..Matching::default() };
    let mut starts: Vec<u64> = pattern(&matching, &[&grain], &recording).iter().map(|p| p.start).collect();
    starts.sort_unstable();
    assert_eq!(starts, (0..59_900).step_by(997).collect::<Vec<u64>>());
}

#[test]
fn a_grain_is_found_where_it_was_cut() {
    let recording = rattle(4, 40_000);
    let grains: Vec<&[f32]> = (0..30).map(|i| &recording[1300 * i..1300 * i + 400 + 20 * i]).collect();
    let found = pattern(&Matching { peaks_per_grain: 1, ..Matching::default() }, &grains, &recording);
    assert_eq!(found.len(), 30);
    for (i, peak) in found.iter().enumerate() {
        assert_eq!((peak.grain, peak.start), (i as u32, 1300 * i as u64));
        assert!((peak.correlation - 1.0).abs() < 1e-6);
    }
}

#[test]
fn the_correlation_of_two_sines_is_the_cosine_of_their_phases() {
    let hz = 441.0;
    let sine = |phase: f64, length: usize| -> Vec<f32> {
        (0..length).map(|i| (TAU * hz * i as f64 / f64::from(RATE_HZ) + phase).sin() as f32).collect()
    };
    // Ten whole periods; a quarter of one is 25 samples.
    let grain = sine(0.0, 1000);
    let recording = sine(-TAU / 4.0, 1060);
    let matching = Matching { spacing_s: 0.0, ..Matching::default() };
    let found = pattern(&matching, &[&grain], &recording);
    assert_eq!(found.iter().map(|p| p.start).collect::<Vec<_>>(), [25]);
    assert!((found[0].correlation - 1.0).abs() < 1e-6);
    // At the end of the recording, a turn by an eighth of a period is the best there is.
    let found = pattern(&matching, &[&grain], &sine(-TAU / 8.0, 1000));
    assert!((f64::from(found[0].correlation) - (TAU / 8.0).cos()).abs() < 1e-5);
}

#[test]
fn gains_leave_the_pattern_and_a_shift_shifts_it() {
    let recording = rattle(5, 20_000);
    let grains: [&[f32]; 3] = [&recording[4000..4700], &recording[9000..9999], &recording[15_000..16_234]];
    let plain = pattern(&Matching::default(), &grains, &recording);
    assert!(plain.len() > 3);
    let louder: Vec<f32> = recording.iter().map(|v| v * 32.0).collect();
    let quiet: Vec<Vec<f32>> = grains.iter().map(|g| g.iter().map(|v| v / 8.0).collect()).collect();
    let quiet: Vec<&[f32]> = quiet.iter().map(Vec::as_slice).collect();
    assert_eq!(plain, pattern(&Matching::default(), &quiet, &louder));
    let later = [vec![0.0; 12_345], recording.clone(), vec![0.0; 777]].concat();
    // Windows that hang over the edges are new ones; those within are as before.
    let shifted = pattern(&Matching { least_correlation: 0.9, ..Matching::default() }, &grains, &later);
    assert_eq!(shifted.iter().map(|p| p.start - 12_345).collect::<Vec<_>>(), [4000, 9000, 15_000]);
}

#[test]
fn no_order_of_grains_and_no_number_of_threads_changes_the_bytes() {
    let recording = rattle(6, 30_000);
    let other = rattle(7, 30_000);
    let grains: Vec<&[f32]> = (0..41).map(|i| &other[600 * i..600 * i + 310 + 77 * i]).collect();
    let found = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            pattern(&Matching { least_correlation: 0.05, ..Matching::default() }, &grains, &recording)
        })
    };
    let alone = found(1);
    assert!(alone.len() > 100);
    assert_eq!(alone, found(4));
    let reversed: Vec<&[f32]> = grains.iter().rev().copied().collect();
    let matching = Matching { least_correlation: 0.05, ..Matching::default() };
    let mut back = pattern(&matching, &reversed, &recording);
    back.iter_mut().for_each(|peak| peak.grain = 40 - peak.grain);
    back.sort_by_key(|peak| peak.grain);
    assert_eq!(alone.len(), back.len());
    for (a, b) in alone.iter().zip(&back) {
        assert_eq!((a.grain, a.start), (b.grain, b.start));
        assert_eq!(a.correlation, b.correlation);
    }
}

#[test]
fn odd_sounds_and_settings() {
    let hiss = noise(8, 1000);
    let silence = vec![0.0; 5000];
    let all = Matching { least_correlation: 0.0, ..Matching::default() };
    assert_eq!(pattern(&all, &[&hiss], &silence), []);
    assert_eq!(pattern(&all, &[&silence[..100]], &hiss), []);
    assert_eq!(pattern(&all, &[&hiss], &hiss[..999]), []);
    assert_eq!(pattern(&all, &[], &hiss), []);
    assert_eq!(pattern(&Matching { peaks_per_grain: 0, ..all.clone() }, &[&hiss], &hiss), []);
    assert_eq!(pattern(&all, &[&[0.5]], &[0.25]), [Peak { grain: 0, start: 0, correlation: 1.0 }]);
    assert_eq!(pattern(&all, &[&[0.5]], &[-0.25]), []);
    let constant = pattern(&all, &[&[0.5; 700]], &[0.25; 9000]);
    assert!(!constant.is_empty() && constant.iter().all(|p| (p.correlation - 1.0).abs() < 1e-6));
    let new =
        |matching: Matching, grains: Vec<&'static [f32]>| Matcher::new(matching, grains, RATE_HZ).map(|_| ());
    let message = |r: Result<()>| r.unwrap_err().to_string();
    assert_eq!(message(new(all.clone(), vec![&[1.0], &[]])), "grain 1: expected sound, found 0 samples");
    assert!(message(new(all.clone(), vec![&[f32::NAN]])).contains("grain 0: sample 0: the sample is NaN"));
    assert!(
        message(new(Matching { least_correlation: 2.0, ..all.clone() }, vec![]))
            .contains("least_correlation is 2")
    );
    assert!(message(new(Matching { spacing_s: f64::NAN, ..all.clone() }, vec![])).contains("spacing_s"));
    assert!(message(new(Matching { quietest_db: -200.0, ..all.clone() }, vec![])).contains("quietest_db"));
    let matcher = Matcher::new(all, vec![&[1.0]], RATE_HZ).unwrap();
    assert!(matcher.pattern(&[0.0, f32::NAN]).unwrap_err().to_string().contains("sample 1"));
    assert!(matcher.pattern(&[]).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn any_grain_of_any_length_has_the_peaks_of_the_definition(
        seed in any::<u64>(),
        length in 1usize..3000,
        // Of a few samples the correlation is ±1 nearly everywhere, and rounding decides which place is the best.
        cuts in prop::collection::vec((0usize..3000, 8usize..1500), 1..6),
        peaks_per_grain in 1usize..6,
    ) {
        let recording = rattle(seed, length);
        let other = rattle(seed ^ 1, 4500);
        let grains: Vec<&[f32]> = cuts.iter().map(|&(from, length)| &other[from..from + length]).collect();
        let matching = Matching { peaks_per_grain, least_correlation: 0.02, spacing_s: 0.004, ..Matching::default() };
        check(&matching, &grains, &recording);
    }
}

#[test]
fn what_is_found_of_a_grain_depends_on_its_group_alone() {
    let recording = noise(31, 9000);
    let pieces: Vec<Vec<f32>> = (0..9).map(|i| noise(40 + i, 300 + 131 * i as usize)).collect();
    let matching = Matching { least_correlation: 0.0, ..Matching::default() };
    let found = |numbers: &[usize]| -> Vec<(usize, Peak)> {
        let grains = numbers.iter().map(|&n| &*pieces[n]).collect();
        let groups = numbers.iter().map(|n| n / 3).collect();
        let matcher = Matcher::new(matching.clone(), grains, 44_100).unwrap().grouped(groups);
        let peaks = matcher.pattern(&recording).unwrap();
        peaks.into_iter().map(|peak| (numbers[peak.grain as usize], Peak { grain: 0, ..peak })).collect()
    };
    let all = found(&[0, 1, 2, 3, 4, 5, 6, 7, 8]);
    assert!(all.len() > 30);
    for group in 0..3 {
        let alone = found(&[3 * group, 3 * group + 1, 3 * group + 2]);
        let within: Vec<_> = all.iter().filter(|(number, _)| number / 3 == group).copied().collect();
        assert_eq!(alone, within);
    }
}
