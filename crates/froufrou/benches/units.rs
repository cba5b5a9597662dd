//! What concatenative synthesis costs.
//!
//! ```text
//! cargo bench -p froufrou --bench units
//! ```
//!
//! `features` makes those of a minute at 96 kHz on all cores; `items/s` counts samples. `select` chooses 2000 units greedily
//! among those of 3:47 minutes (54 000 units of 4.2 ms) and of two hours (1 700 000) of one kind of sound, which has no
//! silence and never repeats; `index` makes the index for it; `items/s` counts units. `fit` fits a warp to so many points, `warp` carries 1000 units by one of so many;
//! `items/s` counts points, and units. `optimal` is the best selection for 500 units; `join` makes sound of units that all
//! jump; `items/s` counts units.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use froufrou::corpus::units::concatenation::{Concatenation, InMemory};
use froufrou::corpus::units::features::{Extractor, Features};
use froufrou::corpus::units::optimal::optimal;
use froufrou::corpus::units::selection::{Index, greedy};
use froufrou::corpus::units::smoothing::smooth;
use froufrou::corpus::units::warp::Warp;
use froufrou::corpus::units::{FeatureSettings, SelectionSettings};
use froufrou::random::Random;

fn main() {
    divan::main();
}

/// Features as noise has them: levels that go up and down slowly, and a little noise of each unit.
fn wandering(seed: u64, units: usize) -> Features {
    let random = Random::new(seed, 0);
    let numbers = 3 * units as u64;
    let slow = Features::new(3, (0..numbers).map(|i| 12.0 * random.normal(i) as f32).collect());
    let slow = smooth(&slow, &[120.0; 3]);
    let quick = Random::new(seed, 1);
    let noisy = slow.values().iter().zip(0..).map(|(v, i)| v + 0.3 * quick.normal(i) as f32).collect();
    smooth(&Features::new(3, noisy), &[20.0, 50.0, 10.0])
}

fn flat(features: &Features) -> Vec<f64> {
    features.values().iter().map(|v| f64::from(*v)).collect()
}

#[divan::bench(sample_count = 5)]
fn features(bencher: Bencher) {
    let random = Random::new(1, 0);
    let sound: Vec<f32> = (0..60 * 96_000).map(|i| random.uniform(i) as f32 - 0.5).collect();
    let extractor = Extractor::new(&FeatureSettings::default(), 96_000).unwrap();
    bencher.counter(ItemsCount::new(sound.len())).bench_local(|| extractor.features(black_box(&sound)));
}

#[divan::bench(args = [54_000, 1_700_000], sample_count = 3)]
fn index(bencher: Bencher, units: usize) {
    let source = wandering(2, units);
    bencher
        .counter(ItemsCount::new(units))
        .bench_local(|| Index::new(black_box(&source), &[units], 5).unwrap());
}

#[divan::bench(args = [54_000, 1_700_000], sample_count = 5)]
fn select(bencher: Bencher, units: usize) {
    let index = Index::new(&wandering(2, units), &[units], 5).unwrap();
    let target = flat(&wandering(3, 2000));
    let settings = SelectionSettings::default();
    bencher
        .counter(ItemsCount::new(2000usize))
        .bench_local(|| greedy(&index, black_box(&target), &settings).unwrap());
}

#[divan::bench(sample_count = 3)]
fn optimal_500(bencher: Bencher) {
    let index = Index::new(&wandering(2, 54_000), &[54_000], 5).unwrap();
    let target = flat(&wandering(3, 500));
    let settings = SelectionSettings::default();
    bencher
        .counter(ItemsCount::new(500usize))
        .bench_local(|| optimal(&index, black_box(&target), &settings).unwrap());
}

#[divan::bench(args = [100, 400, 1000], sample_count = 5)]
fn fit(bencher: Bencher, points: usize) {
    let (from, to) = (flat(&wandering(4, 10 * points)), flat(&wandering(5, 10 * points)));
    let thin = |rows: &[f64]| -> Vec<f64> { rows.chunks(3).step_by(10).flatten().copied().collect() };
    let (from, to) = (thin(&from), thin(&to));
    bencher
        .counter(ItemsCount::new(points))
        .bench_local(|| Warp::fit(3, black_box(&from), &to, 100.0).unwrap());
}

#[divan::bench(args = [100, 400, 1000], sample_count = 5)]
fn warp(bencher: Bencher, points: usize) {
    let (from, to) = (flat(&wandering(4, points)), flat(&wandering(5, points)));
    let warp = Warp::fit(3, &from, &to, 100.0).unwrap();
    let target = wandering(6, 1000);
    bencher.counter(ItemsCount::new(1000usize)).bench_local(|| warp.apply_all(black_box(&target)).unwrap());
}

#[divan::bench(sample_count = 5)]
fn join(bencher: Bencher) {
    let random = Random::new(7, 0);
    let memory = InMemory::new(vec![(0..1_000_000).map(|i| random.uniform(i) as f32 - 0.5).collect()], 403);
    let chosen: Vec<usize> = (0..5000).map(|i| random.below(i, 2400)).collect();
    let concatenation = Concatenation::new(&memory, 403, 96_000);
    let frames = 5000 * 403;
    bencher
        .counter(ItemsCount::new(chosen.len()))
        .bench_local(|| concatenation.render(black_box(&chosen), 0, frames, 0..frames).unwrap());
}
