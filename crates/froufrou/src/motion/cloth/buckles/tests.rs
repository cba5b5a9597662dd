use super::*;
use crate::motion::cloth::shapes;
use crate::scene::animation::Mesh;
use std::f64::consts::TAU;

/// The buckles of a sheet that moves, at a resolution and frame rate.
fn buckles(
    cells: [u32; 2],
    rate_hz: f64,
    seconds: f64,
    settings: BuckleSettings,
    place: impl Fn(f64, f64, f64) -> [f64; 3],
) -> Vec<Buckled> {
    let at = |time_s: f64| shapes::sheet(cells[0], cells[1], |u, v| place(time_s, u, v));
    let surface = Triangulation::new(&at(0.0)).expect("a sound mesh");
    let mut found = Buckles::new(settings);
    let mut curvature = Curvature::default();
    let mut all = Vec::new();
    for frame in 0..=(seconds * rate_hz).round() as u32 {
        let time_s = f64::from(frame) / rate_hz;
        let Mesh { positions, .. } = at(time_s);
        curvature.measure(&surface, &positions);
        let given = found.feed(time_s, &surface, &curvature, &positions);
        assert!(given.iter().all(|buckled| buckled.time_s < found.settled_s()));
        all.extend(given);
    }
    all.extend(found.finish());
    assert!(all.is_sorted_by(|a, b| a.time_s <= b.time_s));
    all
}

fn close(a: f64, b: f64, part: f64) -> bool {
    (a - b).abs() <= part * a.abs().max(b.abs())
}

/// A sheet of 40 cm with one half wave that swings from one side to the other and back, each way within a while.
fn standing(time_s: f64, u: f64, v: f64) -> [f64; 3] {
    let bow = 0.02 * (std::f64::consts::PI * u).sin() * (TAU * time_s / 0.8).cos();
    [0.4 * u, 0.4 * v, bow]
}

#[test]
fn a_fold_that_flips_is_one_buckle_each_time() {
    // It is flat at 0.2, 0.6, 1.0 … s.
    let (a, w, k) = (0.02, TAU / 0.8, std::f64::consts::PI / 0.4);
    // H = −z″/2 for small slopes, so that ∫|dH/dt| dA = ½ a k² ω · ∫ sin(kx) dx · 0.4 m.
    let exact = 0.5 * a * k * k * w * (2.0 / k) * 0.4;
    for (cells, rate_hz) in [(16, 60.0), (32, 60.0), (32, 30.0), (32, 120.0), (64, 240.0)] {
        let found = buckles([cells; 2], rate_hz, 2.4, BuckleSettings::default(), standing);
        let summary: Vec<_> = found.iter().map(|b| (b.time_s, b.positive, b.energy_mps)).collect();
        assert_eq!(found.len(), 6, "{cells} cells at {rate_hz} Hz: {summary:?}");
        for (number, buckled) in found.iter().enumerate() {
            let time_s = 0.2 + 0.4 * number as f64;
            assert!((buckled.time_s - time_s).abs() < 0.003, "{buckled:?} {time_s}");
            // Bowed up it is convex, H above 0.
            assert_eq!(buckled.positive, number % 2 == 1);
            assert!(
                close(buckled.energy_mps, exact, 0.15),
                "{cells} {rate_hz}: {} {exact}",
                buckled.energy_mps
            );
            let [x, y, z] = buckled.position_m;
            assert!((x - 0.2).abs() < 1e-3 && (y - 0.2).abs() < 1e-3 && z.abs() < 1e-4, "{buckled:?}");
        }
    }
}

/// A fold of 5 cm that runs along a sheet of a metre within a second, from −20 to 120 cm.
fn travelling(time_s: f64, u: f64, v: f64) -> [f64; 3] {
    let away = (u - (1.4 * time_s - 0.2)) / 0.05;
    [u, 0.3 * v, 0.03 / away.cosh().powi(2)]
}

#[test]
fn a_fold_that_travels_is_as_many_buckles_at_any_rate_and_resolution() {
    let run = |cells: u32, rate_hz: f64| {
        let settings = BuckleSettings { least_energy_mps: 1e-3, ..BuckleSettings::default() };
        buckles([cells, cells / 4], rate_hz, 1.0, settings, travelling)
    };
    let sum = |found: &[Buckled]| found.iter().map(|b| b.energy_mps).sum::<f64>();
    let runs = [(80, 60.0), (160, 60.0), (80, 120.0), (160, 120.0), (160, 240.0)];
    let all: Vec<Vec<Buckled>> = runs.iter().map(|&(cells, rate_hz)| run(cells, rate_hz)).collect();
    for (&(cells, rate_hz), found) in runs.iter().zip(&all) {
        println!("{cells} cells at {rate_hz} Hz: {} buckles, energy {:.4}", found.len(), sum(found));
    }
    for found in &all[1..] {
        assert!(close(found.len() as f64, all[0].len() as f64, 0.2), "{} {}", found.len(), all[0].len());
        assert!(close(sum(found), sum(&all[0]), 0.2), "{} {}", sum(found), sum(&all[0]));
        let mean = |found: &[Buckled]| sum(found) / found.len() as f64;
        assert!(close(mean(found), mean(&all[0]), 0.2));
        let middle =
            |found: &[Buckled]| found.iter().map(|b| b.time_s * b.energy_mps).sum::<f64>() / sum(found);
        assert!((middle(found) - middle(&all[0])).abs() < 0.02, "{} {}", middle(found), middle(&all[0]));
    }
    // A buckle lies on one of the two flanks of the fold, some 3 cm from its middle, when it is told to.
    for buckled in all.iter().flatten() {
        let middle_m = 1.4 * buckled.time_s - 0.2;
        assert!((buckled.position_m[0] - middle_m).abs() < 0.06, "{buckled:?} {middle_m}");
    }
    // Both signs as often.
    let positive = all[0].iter().filter(|b| b.positive).count();
    assert!(close(positive as f64, (all[0].len() - positive) as f64, 0.2), "{positive} of {}", all[0].len());
}

#[test]
fn two_folds_far_from_each_other_are_two_buckles() {
    let place = |time_s: f64, u: f64, v: f64| {
        let bump = |at: f64| 0.02 * (-((u - at) / 0.08).powi(2)).exp();
        [u, v, (bump(0.25) + bump(0.75)) * (TAU * time_s).cos()]
    };
    let settings = BuckleSettings { least_energy_mps: 0.02, ..BuckleSettings::default() };
    let found = buckles([80, 20], 60.0, 0.5, settings, place);
    // The middle of each bends one way and its flanks the other.
    let middles = found.iter().filter(|b| !b.positive);
    let places: Vec<f64> = middles.map(|b| b.position_m[0]).collect();
    assert_eq!(places.len(), 2, "{found:?}");
    assert!((places[0] - 0.25).abs() < 0.01 && (places[1] - 0.75).abs() < 0.01, "{places:?}");
    assert!(found.iter().all(|b| (b.time_s - 0.25).abs() < 0.005));
}

#[test]
fn what_lies_flat_does_not_chatter() {
    let random = crate::random::Random::new(3, 1);
    let shaken = |time_s: f64, u: f64, v: f64| {
        let at = ((time_s * 60.0).round() * 1e4 + (u * 24.0).round() * 100.0 + (v * 24.0).round()) as u64;
        [1.2 * u, 1.2 * v, 2e-6 * random.uniform(at)]
    };
    assert_eq!(buckles([24; 2], 60.0, 1.0, BuckleSettings::default(), shaken), []);
    // Without the band it would.
    let settings = BuckleSettings { flat_per_m: Some(1e-9), blur_m: 0.0, ..BuckleSettings::default() };
    assert!(buckles([24; 2], 60.0, 1.0, settings, shaken).len() > 20);
}

#[test]
fn trembling_finer_than_the_blur_hides_no_fold() {
    // Each vertex of a fine mesh trembles by 20 µm while the sheet swings.
    let random = crate::random::Random::new(3, 2);
    let trembling = |time_s: f64, u: f64, v: f64| {
        let [x, y, z] = standing(time_s, u, v);
        let at = ((time_s * 60.0).round() * 1e4 + (u * 64.0).round() * 100.0 + (v * 64.0).round()) as u64;
        [x, y, z + 2e-5 * (random.uniform(at) - 0.5)]
    };
    let strong = |blur_m: f64| {
        let settings = BuckleSettings { blur_m, least_energy_mps: 0.2, ..BuckleSettings::default() };
        let found = buckles([64; 2], 60.0, 1.4, settings, trembling);
        found.iter().map(|b| (b.time_s, b.energy_mps)).collect::<Vec<_>>()
    };
    let (with, without) = (strong(0.02), strong(0.0));
    let whole = buckles([32; 2], 60.0, 1.4, BuckleSettings::default(), standing);
    assert_eq!(with.len(), whole.len(), "{with:?}");
    for ((time_s, energy_mps), expected) in with.iter().zip(&whole) {
        assert!(
            (time_s - expected.time_s).abs() < 0.01 && close(*energy_mps, expected.energy_mps, 0.3),
            "{with:?}"
        );
    }
    assert_ne!(without.len(), whole.len(), "{without:?}");
}

#[test]
fn turning_and_moving_change_nothing_but_the_place_and_scaling_scales() {
    let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -1.1, 2.0);
    let moved = glam::DVec3::new(0.2, 1.0, -0.5);
    for scale in [1.0, 3.0] {
        let place = |time_s: f64, u: f64, v: f64| {
            (turn * (scale * glam::DVec3::from(standing(time_s, u, v))) + scale * moved).to_array()
        };
        let before = buckles([20; 2], 60.0, 1.6, BuckleSettings::default(), standing);
        let after = buckles([20; 2], 60.0, 1.6, BuckleSettings::default(), place);
        assert_eq!(before.len(), after.len());
        for (a, b) in before.iter().zip(&after) {
            assert!((a.time_s - b.time_s).abs() < 1e-4 && a.positive == b.positive, "{a:?} {b:?}");
            assert!(close(scale * a.energy_mps, b.energy_mps, 1e-2), "{a:?} {b:?}");
            let expected = turn * (scale * glam::DVec3::from(a.position_m)) + scale * moved;
            assert!(expected.distance(b.position_m.into()) < 1e-3, "{a:?} {b:?}");
        }
    }
}

#[test]
fn weak_buckles_are_left_out_and_fast_ones_have_more_energy() {
    let slowed = |time_s: f64, u: f64, v: f64| standing(0.5 * time_s, u, v);
    let settings = BuckleSettings { least_energy_mps: 0.03, ..BuckleSettings::default() };
    let [fast, slow] =
        [buckles([20; 2], 60.0, 0.7, settings, standing), buckles([20; 2], 60.0, 1.4, settings, slowed)];
    assert_eq!((fast.len(), slow.len()), (2, 2));
    assert!(close(fast[0].energy_mps, 2.0 * slow[0].energy_mps, 0.1), "{fast:?} {slow:?}");
    let between = 0.5 * (fast[0].energy_mps + slow[0].energy_mps);
    let settings = BuckleSettings { least_energy_mps: between, ..BuckleSettings::default() };
    assert_eq!(buckles([20; 2], 60.0, 1.4, settings, slowed), []);
}

#[test]
fn nothing_of_a_long_animation_is_kept() {
    let surface =
        Triangulation::new(&shapes::sheet(20, 20, |u, v| standing(0.0, u, v))).expect("a sound mesh");
    let mut found = Buckles::new(BuckleSettings::default());
    let mut curvature = Curvature::default();
    for frame in 0..2000 {
        let time_s = f64::from(frame) / 60.0;
        let mesh = shapes::sheet(20, 20, |u, v| standing(time_s, u, v));
        curvature.measure(&surface, &mesh.positions);
        found.feed(time_s, &surface, &curvature, &mesh.positions);
        assert!(
            found.buckles.len() < 500 && found.found.len() < 10,
            "{} {}",
            found.buckles.len(),
            found.found.len()
        );
    }
}
