//! What synthesised sounds cost on one core at 48 kHz.
//!
//! ```text
//! cargo bench -p froufrou --bench modal
//! ```
//!
//! `modes` and `recursion` each make one second of a body that rings with all its modes; `items/s`
//! counts modes: with 10 000 modes, more than 10 000 a second is faster than real time. `recursion` is
//! the peer: one two-pole recursion in double precision for each mode, one mode after another. `strikes`
//! is a hundred strikes a second upon 1000 modes. The sliding sounds count samples.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use froufrou::random::Random;
use froufrou::synth::instrument::{Generator, Instrument, Ramp, Stretch, Strike, stretch_samples};
use froufrou::synth::membrane::Membrane;
use froufrou::synth::modal::{Mode, Modes, Shape};
use froufrou::synth::needle::Needle;
use froufrou::synth::stick_slip::StickSlip;
use froufrou::synth::turbulence::Turbulence;

fn main() {
    divan::main();
}

const RATE_HZ: f64 = 48_000.0;

fn body(count: usize) -> Vec<Mode> {
    let random = Random::new(1, 1);
    let mode = |n: u64| Mode {
        frequency_hz: 20.0 * 1000.0f64.powf(random.uniform(2 * n)),
        // None rests within the second.
        decay_per_s: 0.5 + 3.0 * random.uniform(2 * n + 1),
        gain: 0.01,
        shape: Shape::Everywhere,
    };
    (0..count as u64).map(mode).collect()
}

/// A second of a generator, struck at times.
fn second(generator: &mut dyn Generator, controls: &[Ramp], strikes: &[Strike]) -> f32 {
    let count = stretch_samples(RATE_HZ);
    let mut out = vec![0.0; count];
    let (mut sum, mut next) = (0.0, 0);
    for first in (0..RATE_HZ as u64).step_by(count) {
        let end_s = (first + count as u64) as f64 / RATE_HZ;
        let end = next + strikes[next..].iter().take_while(|strike| strike.time_s < end_s).count();
        let stretch =
            Stretch { first, rate_hz: RATE_HZ, controls, strikes: &strikes[next..end], grains: &[] };
        next = end;
        generator.generate(&stretch, &mut out).expect("it plays");
        sum += out[0];
    }
    sum
}

fn strike(time_s: f64, place: f64) -> Strike {
    Strike { time_s, impulse_ns: 1.0, place, contact_s: 0.0 }
}

#[divan::bench(args = [100, 1000, 10_000])]
fn modes(bencher: Bencher, count: usize) {
    let modes = Modes::new(body(count)).expect("modes");
    let strikes = [strike(0.0, 0.0)];
    bencher
        .counter(ItemsCount::new(count))
        .with_inputs(|| modes.generator(RATE_HZ, Random::new(0, 0)).expect("a generator"))
        .bench_local_refs(|generator| black_box(second(generator.as_mut(), &[], &strikes)));
}

#[divan::bench(args = [100, 1000, 10_000], sample_count = 10)]
fn recursion(bencher: Bencher, count: usize) {
    let modes = body(count);
    bencher.counter(ItemsCount::new(count)).bench_local(|| {
        let mut sum = vec![0.0f64; RATE_HZ as usize];
        for mode in &modes {
            let angle = std::f64::consts::TAU * mode.frequency_hz / RATE_HZ;
            let radius = (-mode.decay_per_s / RATE_HZ).exp();
            let (a, b) = (2.0 * radius * angle.cos(), radius * radius);
            let (mut last, mut now) = (0.0, mode.gain * radius * angle.sin());
            for sum in &mut sum {
                *sum += last;
                (last, now) = (now, a * now - b * last);
            }
        }
        black_box(sum)
    });
}

#[divan::bench]
fn strikes(bencher: Bencher) {
    let modes = Modes::new(body(1000)).expect("modes");
    let strikes: Vec<Strike> = (0..100).map(|n| strike(f64::from(n) * 0.009_99, f64::from(n))).collect();
    bencher
        .counter(ItemsCount::new(strikes.len()))
        .with_inputs(|| modes.generator(RATE_HZ, Random::new(0, 0)).expect("a generator"))
        .bench_local_refs(|generator| black_box(second(generator.as_mut(), &[], &strikes)));
}

fn slide(bencher: Bencher, instrument: &dyn Instrument, speed: f64) {
    let controls = [Ramp::still(speed), Ramp::still(1.0)];
    let controls = &controls[..instrument.controls().len()];
    let mut generator = instrument.generator(RATE_HZ, Random::new(0, 0)).expect("a generator");
    bencher
        .counter(ItemsCount::new(RATE_HZ as usize))
        .bench_local(|| black_box(second(generator.as_mut(), controls, &[])));
}

#[divan::bench(args = [0.05, 0.5, 0.95])]
fn needle(bencher: Bencher, speed: f64) {
    slide(bencher, &Needle::new(&[]).expect("a needle"), speed);
}

#[divan::bench(args = [0.1, 1.0])]
fn stick_slip(bencher: Bencher, speed: f64) {
    slide(bencher, &StickSlip::new(&[]).expect("a body"), speed);
}

#[divan::bench(args = [8.0, 24.0])]
fn membrane(bencher: Bencher, modes: f64) {
    slide(bencher, &Membrane::new(&[("modes".to_owned(), modes)]).expect("a sheet"), 5.0);
}

#[divan::bench(args = [0.0, 0.1])]
fn turbulence(bencher: Bencher, size: f64) {
    slide(bencher, &Turbulence::new(&[("size".to_owned(), size)]).expect("air"), 5.0);
}
