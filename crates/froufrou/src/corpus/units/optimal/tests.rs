use proptest::prelude::*;

use super::*;
use crate::corpus::units::features::Features;
use crate::corpus::units::selection::tests::wandering;

fn warped(features: &Features) -> Vec<f64> {
    features.values().iter().map(|v| f64::from(*v)).collect()
}

/// The least cost of all sequences, by trying each.
fn enumerate(index: &Index, target: &[f64], settings: &SelectionSettings) -> Cost {
    let units = target.len() / index.dimensions();
    let mut best: Option<Cost> = None;
    let mut sequence = Vec::new();
    descend(index, target, settings, units, &mut sequence, Cost::default(), &mut best);
    best.unwrap()
}

fn descend(
    index: &Index,
    target: &[f64],
    settings: &SelectionSettings,
    units: usize,
    sequence: &mut Vec<usize>,
    cost: Cost,
    best: &mut Option<Cost>,
) {
    let i = sequence.len();
    if i == units {
        if best.is_none_or(|best| cost.compare(&best).is_lt()) {
            *best = Some(cost);
        }
        return;
    }
    let from = i.saturating_sub(settings.cool_off);
    for unit in 0..index.units() {
        if sequence[from..].contains(&unit) {
            continue;
        }
        let d = index.dimensions();
        let window = &target[i * d..((i + settings.look_ahead + 1) * d).min(target.len())];
        let chosen = weigh(index, window, unit, settings.d_max);
        let jumps = i > 0 && !index.follows(sequence[i - 1], unit);
        let cost = cost.plus(&chosen, jumps, settings);
        sequence.push(unit);
        descend(index, target, settings, units, sequence, cost, best);
        sequence.pop();
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn small_ones_are_the_best_of_all(
        seed in 0u64..1_000_000,
        split in 1usize..6,
        target in 1usize..6,
        look_ahead in 0usize..3,
        cool_off in 0usize..4,
        d_max in prop_oneof![Just(0.5), Just(3.0), Just(f64::INFINITY)],
        jump_cost in prop_oneof![Just(0.0), 0.0f64..4.0],
    ) {
        let source = wandering(seed, 7, 2, 0.0, 1.0);
        let index = Index::new(&source, &[split, 7 - split], look_ahead).unwrap();
        let target = warped(&wandering(seed + 1, target, 2, 0.0, 1.0));
        let settings =
            SelectionSettings { look_ahead, d_max, cool_off, jump_cost, candidates: 7 };
        let found = optimal_with(&index, &target, &settings, 100_000).unwrap();
        prop_assert!(found.is_best);
        let wanted = enumerate(&index, &target, &settings);
        prop_assert_eq!(found.cost.beyond, wanted.beyond);
        prop_assert!((found.cost.sum - wanted.sum).abs() < 1e-9, "{:?} {:?}", found.cost, wanted);
        // With few ways it is said whether something was left out, and if not, it is as good.
        let narrow = optimal_with(&index, &target, &settings, 1).unwrap();
        if narrow.is_best {
            prop_assert!((narrow.cost.sum - wanted.sum).abs() < 1e-9 && narrow.cost.beyond == wanted.beyond);
        }
    }

    #[test]
    fn it_never_costs_more_than_the_greedy_one(
        seed in 0u64..1_000_000,
        width in 0.0f64..20.0,
        d_max in 0.2f64..6.0,
        cool_off in 0usize..21,
        candidates in 1usize..12,
        jump_cost in 0.0f64..5.0,
    ) {
        let source = wandering(seed, 200, 3, width, 0.0);
        let index = Index::new(&source, &[150, 50], 4).unwrap();
        let target = warped(&wandering(seed + 1, 60, 3, width, 0.0));
        let settings = SelectionSettings { look_ahead: 4, d_max, cool_off, jump_cost, candidates };
        let found = optimal(&index, &target, &settings).unwrap();
        let greedy = greedy(&index, &target, &settings).unwrap();
        prop_assert_eq!(found.greedy_cost, cost(&index, &greedy, &settings));
        prop_assert_eq!(found.cost, cost(&index, &found.chosen, &settings));
        prop_assert!(!found.cost.compare(&found.greedy_cost).is_gt());
        prop_assert_eq!(found.chosen.len(), 60);
        for (i, chosen) in found.chosen.iter().enumerate() {
            let later = &found.chosen[i + 1..];
            prop_assert!(later.iter().take(cool_off).all(|later| later.unit != chosen.unit));
            // What it says of each is so.
            let window = &target[i * 3..((i + 5) * 3).min(target.len())];
            prop_assert_eq!(*chosen, weigh(&index, window, chosen.unit, d_max));
        }
    }
}

/// Where jumps cost much, runs are long.
#[test]
fn dear_jumps_are_rare() {
    let source = wandering(3, 3000, 3, 8.0, 0.0);
    let index = Index::new(&source, &[3000], 5).unwrap();
    let target = warped(&wandering(4, 400, 3, 8.0, 0.0));
    let jumps = |jump_cost: f64| {
        let settings = SelectionSettings { jump_cost, d_max: 8.0, ..SelectionSettings::default() };
        let found = optimal(&index, &target, &settings).unwrap();
        let pairs = found.chosen.windows(2);
        (
            pairs.filter(|pair| !index.follows(pair[0].unit, pair[1].unit)).count(),
            found.cost,
            found.greedy_cost,
        )
    };
    let (few, cost, greedy_cost) = jumps(20.0);
    let (many, ..) = jumps(0.0);
    assert!(2 * few < many, "{few} {many}");
    assert!(cost.sum < 0.95 * greedy_cost.sum, "{cost:?} {greedy_cost:?}");
}
