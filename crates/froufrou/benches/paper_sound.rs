//! What paper costs on one core at 44.1 kHz.
//!
//! ```text
//! cargo bench -p froufrou --bench paper_sound
//! ```
//!
//! `friction` is 1024 samples of a thread with so many spectra that sound, which is one frame; `rest` the same of one that is silent,
//! `tear` of one that tears at half a metre a second. `model` is a database made on demand, without its clips; `clip` one of these,
//! and `all_clips` all. `choose` is a clip for an event, `distance` that of two spectra, `harvest` a second of a recording.

use std::path::Path;
use std::sync::Arc;

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use froufrou::corpus::paper::harvest::harvest;
use froufrou::corpus::paper::plate::Shape;
use froufrou::corpus::paper::synthetic::Paper as Model;
use froufrou::corpus::paper::{PaperSound, SPACING_HZ, quadratic_chi};
use froufrou::random::Random;
use froufrou::synth::instrument::{Generator, Instrument, Ramp, Stretch, stretch_samples};
use froufrou::synth::paper::Paper;

fn main() {
    divan::main();
}

const RATE_HZ: f64 = 44_100.0;
const HOP: usize = 1024;

fn sound() -> PaperSound {
    PaperSound::named("synthetic/printer", Path::new("")).expect("a model")
}

/// Samples of a thread, stretch by stretch.
struct Thread {
    generator: Box<dyn Generator>,
    controls: Vec<Ramp>,
    out: Vec<f32>,
    first: u64,
}

impl Thread {
    fn new(set: &[(usize, f64)]) -> Self {
        let paper = Paper::new(Arc::new(sound()), &[]).expect("a paper");
        let mut controls = vec![Ramp::still(0.0); paper.controls().len()];
        set.iter().for_each(|&(index, value)| controls[index] = Ramp::still(value));
        let generator = paper.generator(RATE_HZ, Random::new(1, 1)).expect("a generator");
        Self { generator, controls, out: vec![0.0; stretch_samples(RATE_HZ)], first: 0 }
    }

    fn hop(&mut self, end: u64) -> f32 {
        while self.first < end {
            let stretch = Stretch {
                first: self.first,
                rate_hz: RATE_HZ,
                controls: &self.controls,
                strikes: &[],
                grains: &[],
            };
            self.generator.generate(&stretch, &mut self.out).expect("a sound");
            self.first += self.out.len() as u64;
        }
        self.out[0]
    }
}

fn hops(bencher: Bencher, set: &[(usize, f64)]) {
    let mut thread = Thread::new(set);
    let mut end = 0;
    bencher.counter(ItemsCount::new(HOP)).bench_local(|| {
        end += HOP as u64;
        black_box(thread.hop(end))
    });
}

#[divan::bench(args = [1, 10, 40])]
fn friction(bencher: Bencher, spectra: usize) {
    let set: Vec<(usize, f64)> = (0..spectra).map(|n| (3 + 2 * n, 0.1)).collect();
    hops(bencher, &set);
}

#[divan::bench]
fn rest(bencher: Bencher) {
    hops(bencher, &[]);
}

#[divan::bench]
fn tear(bencher: Bencher) {
    hops(bencher, &[(84, 0.5)]);
}

#[divan::bench]
fn model(bencher: Bencher) {
    bencher.bench_local(|| black_box(sound()));
}

#[divan::bench(args = [0.05, 0.3])]
fn clip(bencher: Bencher, size_m: f64) {
    let shape = Shape::rectangle(size_m, size_m);
    bencher.bench_local(|| black_box(Model::printer().flap(&shape, 0, RATE_HZ)));
}

#[divan::bench(sample_count = 5)]
fn all_clips(bencher: Bencher) {
    let sound = sound();
    bencher.counter(ItemsCount::new(sound.clips().len())).bench_local(|| {
        (0..sound.clips().len()).map(|n| sound.clip_samples(n, 44_100).expect("a clip").len()).sum::<usize>()
    });
}

#[divan::bench]
fn choose(bencher: Bencher) {
    let sound = sound();
    let (mut last, mut index) = (None, 0);
    bencher.bench_local(|| {
        index += 1;
        last = sound.clip(0.11, 0.2, last, Random::new(1, 1), index);
        black_box(last)
    });
}

#[divan::bench]
fn distance(bencher: Bencher) {
    let sound = sound();
    let [a, b] = [10, 70].map(|n: usize| &sound.spectra()[n].density);
    bencher.bench_local(|| black_box(quadratic_chi::distance((a, SPACING_HZ), (b, SPACING_HZ))));
}

#[divan::bench(sample_count = 5)]
fn harvesting(bencher: Bencher) {
    let flap = Model::printer().flap(&Shape::rectangle(0.1, 0.1), 9, RATE_HZ);
    let mut recording: Vec<f32> = (0..44_100).map(|n| 1e-4 * Random::new(2, 2).normal(n) as f32).collect();
    for begin in [5_000, 22_000] {
        recording[begin..].iter_mut().zip(&flap).for_each(|(sum, sample)| *sum += sample);
    }
    bencher.counter(ItemsCount::new(recording.len())).bench_local(|| {
        black_box(harvest(&recording, 44_100, &Model::printer(), None).expect("pieces").len())
    });
}
