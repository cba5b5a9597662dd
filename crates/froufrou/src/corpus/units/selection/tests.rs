use proptest::prelude::*;

use super::*;
use crate::corpus::units::features::Features;
use crate::corpus::units::smoothing::smooth;
use crate::random::Random;

/// D1, as it stands in the paper.
fn d1(source: &Features, j: usize, wanted: &[f64]) -> f64 {
    let mut sum = 0.0;
    for (f, w) in source.row(j).iter().zip(wanted) {
        sum += (f64::from(*f) - w) * (f64::from(*f) - w);
    }
    sum.sqrt()
}

/// Algorithm 1, every unit with every other.
pub fn brute_force(
    source: &Features,
    streams: &[usize],
    target: &[Vec<f64>],
    settings: &SelectionSettings,
) -> Vec<Chosen> {
    let mut ends = Vec::new();
    for length in streams {
        let end = ends.len() + length;
        ends.extend(std::iter::repeat_n(end, *length));
    }
    let mut chosen: Vec<Chosen> = Vec::new();
    for i in 0..target.len() {
        let from = chosen.len().saturating_sub(settings.cool_off);
        let free: Vec<usize> =
            (0..source.len()).filter(|j| chosen[from..].iter().all(|c| c.unit != *j)).collect();
        let mut best = Chosen { unit: 0, distance: f64::INFINITY, is_within: true };
        for &j in &free {
            if d1(source, j, &target[i]) <= settings.d_max {
                let mut d2 = 0.0;
                for k in 0..=settings.look_ahead {
                    if i + k < target.len() {
                        d2 += d1(source, (j + k).min(ends[j] - 1), &target[i + k]);
                    }
                }
                if d2 < best.distance {
                    best = Chosen { unit: j, distance: d2, is_within: true };
                }
            }
        }
        if best.distance == f64::INFINITY {
            for &j in &free {
                let d1 = d1(source, j, &target[i]);
                if d1 < best.distance {
                    best = Chosen { unit: j, distance: d1, is_within: false };
                }
            }
        }
        chosen.push(best);
    }
    chosen
}

/// Noise under a Gaussian, in steps that make some units equal.
pub fn wandering(seed: u64, units: usize, dimensions: usize, width: f64, step: f64) -> Features {
    let random = Random::new(seed, 0);
    let count = (units * dimensions) as u64;
    let noise = Features::new(dimensions, (0..count).map(|i| 4.0 * random.normal(i) as f32).collect());
    let smooth = smooth(&noise, &vec![width; dimensions]);
    let stepped = |v: &f32| if step > 0.0 { (f64::from(*v) / step).round() * step } else { f64::from(*v) };
    Features::new(dimensions, smooth.values().iter().map(|v| stepped(v) as f32).collect())
}

fn rows(features: &Features) -> Vec<Vec<f64>> {
    features.rows().map(|row| row.iter().map(|v| f64::from(*v)).collect()).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn equals_brute_force_unit_for_unit(
        seed in 0u64..1_000_000,
        streams in proptest::collection::vec(0usize..120, 1..5),
        target in 1usize..60,
        dimensions in 1usize..8,
        look_ahead in 0usize..12,
        cool_off in 0usize..8,
        width in 0.0f64..30.0,
        step in prop_oneof![Just(0.0), Just(0.5)],
        d_max in prop_oneof![Just(0.0), 0.0f64..6.0, Just(f64::INFINITY)],
        offset in prop_oneof![Just(0.0), Just(3.0), Just(1e4)],
    ) {
        let units: usize = streams.iter().sum();
        prop_assume!(units > cool_off);
        let source = wandering(seed, units, dimensions, width, step);
        let mut target = rows(&wandering(seed + 1, target, dimensions, width, step));
        target.iter_mut().for_each(|row| row[0] += offset);
        let settings = SelectionSettings { look_ahead, d_max, cool_off, ..SelectionSettings::default() };
        let index = Index::new(&source, &streams, look_ahead).unwrap();
        let ours = greedy(&index, &target.concat(), &settings).unwrap();
        prop_assert_eq!(ours, brute_force(&source, &streams, &target, &settings));
    }

    #[test]
    fn several_nearest_are_those_of_a_sorted_list(
        seed in 0u64..1_000_000,
        count in 1usize..50,
        d_max in 0.5f64..8.0,
    ) {
        let source = wandering(seed, 300, 3, 9.0, 0.25);
        let index = Index::new(&source, &[100, 200], 4).unwrap();
        let window = rows(&wandering(seed + 7, 5, 3, 9.0, 0.25)).concat();
        let mut all: Vec<Found> = (0..300)
            .filter(|&j| j != 7 && d1(&source, j, &window[..3]) <= d_max)
            .map(|j| {
                let end = if j < 100 { 99 } else { 299 };
                let d2 = (0..5).map(|k| d1(&source, (j + k).min(end), &window[3 * k..3 * k + 3])).sum();
                Found { unit: j, distance: d2 }
            })
            .collect();
        all.sort_by(|a, b| a.distance.total_cmp(&b.distance).then(a.unit.cmp(&b.unit)));
        all.truncate(count);
        let mut search = index.search();
        prop_assert_eq!(search.nearest(&window, d_max, count, &[7], Some(12)), &all[..]);
    }
}

/// In a tree of some levels: near, far and in between, and with more features than vector units are made for.
#[test]
fn deep_trees_equal_brute_force() {
    for (seed, dimensions, units, width, d_max) in [
        (21, 3, 9000, 20.0, 2.0),
        (22, 3, 5000, 0.0, 2.0),
        (23, 6, 5000, 20.0, 1.0),
        (24, 13, 2500, 8.0, 3.0),
    ] {
        let source = wandering(seed, units, dimensions, width, 0.0);
        let streams = [units / 3, 0, units - units / 3];
        for (offset, scale) in [(0.0, 1.0), (0.7, 1.0), (0.0, 3.0), (-40.0, 1.0)] {
            let mut target = rows(&wandering(seed + 100, 14, dimensions, width, 0.0));
            target.iter_mut().flatten().for_each(|value| *value = scale * *value + offset);
            let settings = SelectionSettings { d_max, cool_off: 4, ..SelectionSettings::default() };
            let index = Index::new(&source, &streams, settings.look_ahead).unwrap();
            let ours = greedy(&index, &target.concat(), &settings).unwrap();
            assert_eq!(ours, brute_force(&source, &streams, &target, &settings), "{seed} {offset} {scale}");
        }
    }
}

/// Sound far from everything else makes steps of bytes large, and changes nothing.
#[test]
fn an_outlier_changes_nothing() {
    let mut values = wandering(31, 3000, 3, 12.0, 0.0).values().to_vec();
    values[3 * 1234..3 * 1240].fill(9.9e14);
    let source = Features::new(3, values);
    let target = rows(&wandering(32, 20, 3, 12.0, 0.0));
    let settings = SelectionSettings { cool_off: 3, ..SelectionSettings::default() };
    let index = Index::new(&source, &[3000], settings.look_ahead).unwrap();
    let ours = greedy(&index, &target.concat(), &settings).unwrap();
    assert_eq!(ours, brute_force(&source, &[3000], &target, &settings));
    assert!(index.search().nearest(&target.concat(), 2.0, 0, &[], Some(3)).is_empty());
}

/// A target that is the recording is the recording.
#[test]
fn a_recording_is_made_of_itself() {
    let source = wandering(5, 5000, 3, 20.0, 0.0);
    let index = Index::new(&source, &[5000], 5).unwrap();
    let chosen = greedy(&index, &rows(&source).concat(), &SelectionSettings::default()).unwrap();
    assert!(chosen.iter().enumerate().all(|(i, c)| c.unit == i && c.distance == 0.0 && c.is_within));
}

#[test]
fn no_unit_comes_again_too_soon() {
    let source = wandering(6, 400, 2, 5.0, 0.0);
    let index = Index::new(&source, &[400], 3).unwrap();
    let still = vec![0.1; 2 * 500];
    let settings = SelectionSettings { look_ahead: 3, ..SelectionSettings::default() };
    let chosen = greedy(&index, &still, &settings).unwrap();
    for (i, c) in chosen.iter().enumerate() {
        assert!(chosen[i + 1..].iter().take(settings.cool_off).all(|later| later.unit != c.unit));
    }
}

#[test]
fn units_and_rows_are_told_apart_at_the_ends_of_streams() {
    let source = wandering(7, 60, 1, 0.0, 0.0);
    let index = Index::new(&source, &[10, 0, 1, 49], 4).unwrap();
    for unit in 0..60 {
        assert_eq!(index.unit_of(index.row_of(unit)), unit);
        assert_eq!(index.window(unit)[0], source.row(unit)[0]);
    }
    assert_eq!(index.window(8)[1..], [source.row(9)[0]; 4]);
    assert!(index.follows(0, 1) && !index.follows(9, 10) && !index.follows(10, 11) && !index.follows(5, 7));
}

#[test]
fn what_does_not_fit_is_an_error() {
    let source = wandering(8, 30, 3, 0.0, 0.0);
    assert!(Index::new(&source, &[29], 5).is_err());
    assert!(Index::new(&Features::new(3, Vec::new()), &[], 5).is_err());
    for value in [f32::NAN, f32::INFINITY, -2e15] {
        assert!(Index::new(&Features::new(1, vec![value]), &[1], 5).is_err());
    }
    let index = Index::new(&source, &[30], 5).unwrap();
    let settings = SelectionSettings::default();
    assert!(Greedy::new(&index, &SelectionSettings { look_ahead: 4, ..settings.clone() }).is_err());
    assert!(Greedy::new(&index, &SelectionSettings { cool_off: 30, ..settings.clone() }).is_err());
    let mut greedy = Greedy::new(&index, &settings).unwrap();
    assert!(greedy.push(&[0.0; 2]).is_err() && greedy.push(&[0.0, f64::NAN, 0.0]).is_err());
    assert!(greedy.push(&[0.0, 1e16, 0.0]).is_err());
}

/// Of much silence, the first units are taken, and as quickly as others.
#[test]
fn silence_is_taken_in_order() {
    let sound = wandering(9, 300, 3, 10.0, 0.0);
    let silence = vec![-40.0f32; 3 * 5000];
    let values = [sound.values(), &silence, sound.values(), &silence].concat();
    let source = Features::new(3, values);
    let streams = [5300, 5300];
    let index = Index::new(&source, &streams, 4).unwrap();
    let target: Vec<Vec<f64>> = (0..70).map(|i| vec![if i < 50 { -40.0 } else { -39.5 }; 3]).collect();
    let settings = SelectionSettings { look_ahead: 4, cool_off: 9, ..SelectionSettings::default() };
    let ours = greedy(&index, &target.concat(), &settings).unwrap();
    assert_eq!(ours, brute_force(&source, &streams, &target, &settings));
}

/// Sound that comes block by block makes the choices of sound that is there at once, at the delay that is told.
#[test]
fn live_choices_are_those_of_the_whole() {
    use crate::corpus::units::FeatureSettings;
    use crate::corpus::units::features::Extractor;
    use crate::corpus::units::high_pass::HighPass;
    use crate::corpus::units::smoothing::Smoother;
    let noise = |seed: u64, samples: u64| -> Vec<f32> {
        let random = Random::new(seed, 0);
        let swell = |i: u64| (1.5 * (i as f64 / 7000.0 + seed as f64).sin() - 2.0).exp();
        (0..samples).map(|i| (swell(i) * random.normal(i)) as f32).collect()
    };
    let widths = [20.0, 50.0, 10.0];
    let extractor = Extractor::new(&FeatureSettings::default(), 48_000).unwrap();
    let whole = |mut sound: Vec<f32>| {
        HighPass::new(100.0, 48_000).unwrap().process(&mut sound);
        smooth(&extractor.features(&sound), &widths)
    };
    let source = whole(noise(1, 300_000));
    let index = Index::new(&source, &[source.len()], 5).unwrap();
    let target = noise(2, 60_000);
    let settings = SelectionSettings::default();
    let wanted = greedy(&index, &rows(&whole(target.clone())).concat(), &settings).unwrap();

    let mut high_pass = HighPass::new(100.0, 48_000).unwrap();
    let mut analysis = extractor.stream();
    let mut smoother = Smoother::new(3, &widths);
    let mut live = Greedy::new(&index, &settings).unwrap();
    let mut chosen = Vec::new();
    for (block, samples) in target.chunks(100).enumerate() {
        let mut samples = samples.to_vec();
        high_pass.process(&mut samples);
        for row in analysis.push(&samples).rows() {
            if let Some(row) = smoother.push(row).unwrap() {
                chosen.extend(live.push(&row).unwrap());
            }
        }
        let whole_units = (100 * (block + 1)).min(target.len()) / extractor.unit_samples();
        assert_eq!(chosen.len(), whole_units.saturating_sub(smoother.delay() + settings.look_ahead));
    }
    let mut rest: Vec<Vec<f64>> = Vec::new();
    for row in analysis.finish().rows() {
        rest.extend(smoother.push(row).unwrap());
    }
    for row in rest.into_iter().chain(smoother.finish()) {
        chosen.extend(live.push(&row).unwrap());
    }
    chosen.extend(live.finish());
    assert_eq!(chosen, wanted);
}
