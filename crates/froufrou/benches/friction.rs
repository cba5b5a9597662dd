//! What the friction of cloth costs on one core at 48 kHz.
//!
//! ```text
//! cargo bench -p froufrou --bench friction
//! ```
//!
//! `second` is a second of a thread that is told one part or four spread ones, new ones all the time; `gather` puts a point into a
//! histogram, and `parts` is what a direction and frame costs beside, both of a histogram that is full. `at` is a spectrum between two measured ones, `table` is
//! made once a corpus, `measure` a second of a recording.

use std::path::Path;
use std::sync::Arc;

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use froufrou::corpus::cloth::ClothSound;
use froufrou::corpus::cloth::clips::{Gathering, Take, measure};
use froufrou::corpus::cloth::motion::{Motion, Seams};
use froufrou::random::Random;
use froufrou::synth::cloth::Cloth;
use froufrou::synth::friction::{FrictionTable, SpeedHistogram};
use froufrou::synth::instrument::{Instrument, Ramp, Stretch, stretch_samples};

fn main() {
    divan::main();
}

const RATE_HZ: f64 = 48_000.0;

fn sound() -> ClothSound {
    ClothSound::named("synthetic/cotton", Path::new("")).expect("a model")
}

fn table() -> FrictionTable {
    FrictionTable::new(&sound().friction().expect("friction").spectra)
}

#[divan::bench(args = [1, 4])]
fn second(bencher: Bencher, parts: usize) {
    let cloth = Cloth::new(Arc::new(sound()), &[]).expect("a cloth");
    let mut generator = cloth.generator(RATE_HZ, Random::new(1, 1)).expect("a generator");
    let count = stretch_samples(RATE_HZ);
    let mut out = vec![0.0f32; count];
    let mut controls: Vec<Ramp> = cloth.controls().iter().map(|c| Ramp::still(c.default)).collect();
    let mut first = 0;
    bencher.counter(ItemsCount::new(RATE_HZ as usize)).bench_local(|| {
        for _ in 0..(RATE_HZ as usize / count) {
            for part in 0..parts {
                let speed = 0.1 * (1.0 + part as f64) * (1.5 + (first as f64 * 1e-4).sin());
                controls[3 * part] = Ramp::still(speed);
                controls[3 * part + 1] = Ramp::still(0.5);
                controls[3 * part + 2] = Ramp::still(if parts == 1 { 0.0 } else { 0.3 });
            }
            let stretch = Stretch { first, rate_hz: RATE_HZ, controls: &controls, strikes: &[], grains: &[] };
            generator.generate(&stretch, &mut out).expect("a sound");
            first += count as u64;
        }
        black_box(out[0])
    });
}

#[divan::bench]
fn gather(bencher: Bencher) {
    let table = table();
    let random = Random::new(3, 3);
    let points: Vec<(f64, f64)> = (0..10_000)
        .map(|n| (0.001 * 5000.0f64.powf(random.uniform(2 * n)), random.uniform(2 * n + 1)))
        .collect();
    let mut histogram = SpeedHistogram::new(&table);
    bencher.counter(ItemsCount::new(points.len())).bench_local(|| {
        for &(speed, weight) in &points {
            histogram.add(&table, speed, weight);
        }
        black_box(histogram.weights()[0])
    });
}

#[divan::bench]
fn parts(bencher: Bencher) {
    let table = table();
    let random = Random::new(3, 3);
    let mut histogram = SpeedHistogram::new(&table);
    for n in 0..10_000 {
        histogram.add(&table, 0.001 * 5000.0f64.powf(random.uniform(n)), 1.0);
    }
    bencher.bench_local(|| black_box(histogram.parts(&table, 4)));
}

#[divan::bench]
fn at(bencher: Bencher) {
    let sound = sound();
    let spectra = &sound.friction().expect("friction").spectra;
    bencher.bench_local(|| black_box(spectra.at(black_box(0.15))));
}

#[divan::bench]
fn making_a_table(bencher: Bencher) {
    let sound = sound();
    let spectra = &sound.friction().expect("friction").spectra;
    bencher.bench_local(|| black_box(FrictionTable::new(spectra)));
}

#[divan::bench]
fn measuring(bencher: Bencher) {
    let random = Random::new(2, 2);
    let samples = (0..RATE_HZ as u64).map(|n| random.normal(n) as f32 * 0.01).collect();
    let motion = Motion::Steady(0.2);
    let take = [Take { name: "take".into(), samples, rate_hz: RATE_HZ, motion, seams: Seams::default() }];
    bencher
        .counter(ItemsCount::new(RATE_HZ as usize))
        .bench_local(|| black_box(measure(&take, &Gathering::default()).expect("spectra")));
}
