//! What grains cost, on all cores.
//!
//! ```text
//! cargo bench -p froufrou --bench grains
//! ```
//!
//! `split` makes sinusoids and residual of ten seconds at 44.1 kHz, `extract` cuts them; `items/s` counts samples.
//! `build` makes a dictionary of recordings of two seconds, one in three of which slides; `resynthesise_all` makes all of them
//! again of others' grains; `items/s` counts samples. `patterns` matches five recordings of two seconds with grains of a thousand samples; `items/s` counts correlations: a
//! sample and grain. `direct` is what a sum for each would do, on one core.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use froufrou::corpus::dictionary::{Action, Dictionary, Example, Settings};
use froufrou::corpus::grains::patterns::{Matcher, Matching};
use froufrou::corpus::grains::{Extraction, GrainKind};
use froufrou::corpus::resynthesis::{Own, resynthesise};
use froufrou::corpus::spectral::SpectralModel;
use froufrou::random::Random;

fn main() {
    divan::main();
}

const RATE_HZ: u32 = 44_100;
const GRAIN: usize = 1000;

/// Noise under hits that fade, over a hum.
fn rattle(seed: u64, length: usize) -> Vec<f32> {
    let random = Random::new(seed, 0);
    (0..length as u64)
        .map(|i| {
            let fade = (-((i % 3000) as f32) / 500.0).exp();
            fade * (random.uniform(i) as f32 - 0.5) + 0.1 * (i as f32 * 0.05).sin()
        })
        .collect()
}

#[divan::bench(sample_count = 5)]
fn split(bencher: Bencher) {
    let sound = rattle(1, 441_000);
    let model = SpectralModel::default();
    bencher
        .counter(ItemsCount::new(sound.len()))
        .bench_local(|| model.split(black_box(&sound), RATE_HZ).unwrap());
}

#[divan::bench(sample_count = 5)]
fn extract(bencher: Bencher) {
    let sound = rattle(2, 441_000);
    let extraction = Extraction::default();
    bencher
        .counter(ItemsCount::new(sound.len()))
        .bench_local(|| extraction.extract(&[(black_box(&sound), GrainKind::Impulsive)], RATE_HZ).unwrap());
}

fn examples(count: u64) -> Vec<Example> {
    let example = |seed| {
        let action = if seed % 3 == 2 { Action::Slide } else { Action::Hit };
        Example {
            name: format!("{seed}"),
            samples: rattle(seed, 88_200),
            rate_hz: RATE_HZ,
            contact: action.contact(),
            action,
        }
    };
    (0..count).map(example).collect()
}

#[divan::bench(args = [3, 12], sample_count = 3)]
fn build(bencher: Bencher, count: u64) {
    let settings = Settings::default();
    bencher
        .counter(ItemsCount::new(88_200 * count))
        .with_inputs(|| examples(count))
        .bench_local_values(|examples| Dictionary::build(examples, None, &settings).unwrap());
}

#[divan::bench(sample_count = 5)]
fn resynthesise_all(bencher: Bencher) {
    let dictionary = Dictionary::build(examples(12), None, &Settings::default()).unwrap();
    bencher.counter(ItemsCount::new(88_200u64 * 12)).bench_local(|| {
        (0..12)
            .map(|number| resynthesise(&dictionary, number, Own::Without).unwrap().render(&dictionary).len())
            .sum::<usize>()
    });
}

#[divan::bench(args = [10, 200], sample_count = 5)]
fn patterns(bencher: Bencher, count: usize) {
    let recordings: Vec<Vec<f32>> = (0..5).map(|seed| rattle(seed, 88_200)).collect();
    let source = rattle(9, count * GRAIN);
    let matcher = Matcher::new(Matching::default(), source.chunks(GRAIN).collect(), RATE_HZ).unwrap();
    bencher
        .counter(ItemsCount::new(5 * count * (88_200 - GRAIN + 1)))
        .bench_local(|| recordings.iter().map(|r| matcher.pattern(r).unwrap().len()).sum::<usize>());
}

#[divan::bench(sample_count = 5)]
fn direct(bencher: Bencher) {
    let recording = rattle(1, 20_000);
    let grain = rattle(9, GRAIN);
    bencher.counter(ItemsCount::new(20_000 - GRAIN + 1)).bench_local(|| {
        let product = |w: &[f32]| w.iter().zip(black_box(&grain)).map(|(a, b)| a * b).sum::<f32>();
        recording.windows(GRAIN).map(product).fold(0.0, f32::max)
    });
}
