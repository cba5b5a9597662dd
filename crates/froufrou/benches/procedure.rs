//! What procedures cost: a second of one voice at 48 kHz on one core.
//!
//! ```text
//! cargo bench -p froufrou --bench procedure
//! ```
//!
//! `items/s` counts seconds of a voice: so many of them sound in real time on one core. Divide the time of
//! a row by 48 000 for the cost of a sample.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use froufrou::random::Random;
use froufrou::synth::instrument::{Instrument, Ramp, Stretch, stretch_samples};
use froufrou::synth::procedure::Procedure;

fn main() {
    divan::main();
}

const RATE_HZ: f64 = 48_000.0;

fn second_of(bencher: Bencher, procedure: &Procedure) {
    let ramps: Vec<Ramp> = procedure.controls().iter().map(|control| Ramp::still(control.default)).collect();
    let count = stretch_samples(RATE_HZ);
    let mut out = vec![0.0; count];
    let mut voice = procedure.generator(RATE_HZ, Random::new(1, 1)).expect("a voice");
    let mut first = 0;
    bencher.counter(ItemsCount::new(1_usize)).bench_local(|| {
        for _ in 0..48_000 / count {
            let stretch = Stretch { first, rate_hz: RATE_HZ, controls: &ramps, strikes: &[], grains: &[] };
            voice.generate(&stretch, &mut out).expect("a sound");
            first += count as u64;
        }
        black_box(out[0])
    });
}

#[divan::bench(args = ["siren", "bees", "bell", "geiger", "plucked"])]
fn shipped(bencher: Bencher, name: &str) {
    let folder = if name == "bees" { "bees" } else { "procedures" };
    let file = format!("{}/../../examples/{folder}/{name}.rhai", env!("CARGO_MANIFEST_DIR"));
    second_of(bencher, &Procedure::open(file, &[]).expect("a script"));
}

/// One unit each, beside what a voice costs anyway (`value`).
#[divan::bench(args = [
    "value(1.0)", "sine(440.0)", "saw(440.0)", "white()", "pink()", "lowpass(value(1.0), 900.0)",
    "resonator(value(0.0), 440.0, 1.0)", "decay(1.0)", "delay(value(1.0), 0.01)", "value(1.0) * value(2.0)",
])]
fn unit(bencher: Bencher, unit: &str) {
    second_of(bencher, &Procedure::new("unit", &format!("play({unit});"), &[]).expect("a script"));
}

/// The least that `fn control` (500 calls) and `fn sample` (48 000 calls) cost.
#[divan::bench(args = ["play(value(1.0)); fn control() { }", "fn sample() { 0.0 }"])]
fn call(bencher: Bencher, source: &str) {
    second_of(bencher, &Procedure::new("call", source, &[]).expect("a script"));
}

/// Reading a script and trying it, and a voice of it more.
#[divan::bench]
fn open(bencher: Bencher) {
    let file = format!("{}/../../examples/bees/bees.rhai", env!("CARGO_MANIFEST_DIR"));
    bencher.bench(|| Procedure::open(&file, &[]).expect("a script"));
}

#[divan::bench]
fn voice(bencher: Bencher) {
    let file = format!("{}/../../examples/bees/bees.rhai", env!("CARGO_MANIFEST_DIR"));
    let procedure = Procedure::open(file, &[]).expect("a script");
    bencher.bench(|| procedure.generator(RATE_HZ, Random::new(1, 1)).expect("a voice"));
}
