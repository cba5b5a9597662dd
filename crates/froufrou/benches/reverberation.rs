//! What rooms cost on one core.
//!
//! ```text
//! cargo bench -p froufrou --bench reverberation
//! ```
//!
//! `convolver` sends one sound at 48 kHz through tails of a second of several channels; `items/s` counts the samples
//! that come out of all channels. Its peers are the crate fft-convolver with parts of 512 samples, which is a
//! convolver for one channel each, and a plain overlap-save with one FFT four times as long as the tail, which answers
//! late. `images` counts images made; `tail` samples; `filters` taps.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use froufrou::random::Random;
use froufrou::space::air::Medium;
use froufrou::space::bands::BandFilters;
use froufrou::space::convolution::Convolver;
use froufrou::space::reverberation::Reverberation;
use froufrou::space::room::{Room, Walls};
use realfft::RealFftPlanner;

fn main() {
    divan::main();
}

const TAIL: usize = 48_000;
const BLOCK: usize = 4096;

fn noise(seed: u64, count: usize) -> Vec<f32> {
    let random = Random::new(seed, 1);
    (0..count as u64).map(|i| 2.0 * random.uniform(i) as f32 - 1.0).collect()
}

/// The tail of a channel, which begins 30 ms late as tails do.
fn tail(channel: usize) -> Vec<f32> {
    let mut tail = noise(channel as u64, TAIL);
    tail[..1440].fill(0.0);
    tail
}

#[divan::bench(args = [1, 2, 6])]
fn convolver(bencher: Bencher, channels: usize) {
    let tails: Vec<Vec<f32>> = (0..channels).map(tail).collect();
    let mut convolver = Convolver::new(&tails.iter().map(Vec::as_slice).collect::<Vec<_>>()).unwrap();
    let input = noise(99, 16 * BLOCK);
    let mut out = vec![0.0; BLOCK * channels];
    bencher.counter(ItemsCount::new(input.len() * channels)).bench_local(|| {
        for block in input.chunks(BLOCK) {
            convolver.process(black_box(block), &mut out).unwrap();
        }
        out[0]
    });
}

#[divan::bench]
fn skip(bencher: Bencher) {
    let mut convolver = Convolver::new(&[&tail(0)]).unwrap();
    let input = noise(99, 16 * BLOCK);
    bencher.counter(ItemsCount::new(input.len())).bench_local(|| convolver.skip(black_box(&input)).unwrap());
}

#[divan::bench(args = [512, 4096])]
fn peer_fft_convolver(bencher: Bencher, part: usize) {
    let mut convolver = fft_convolver::FFTConvolver::default();
    convolver.init(part, &tail(0)).unwrap();
    let input = noise(99, 16 * BLOCK);
    let mut out = vec![0.0; BLOCK];
    bencher.counter(ItemsCount::new(input.len())).bench_local(|| {
        for block in input.chunks(BLOCK) {
            convolver.process(black_box(block), &mut out).unwrap();
        }
        out[0]
    });
}

#[divan::bench]
fn peer_one_fft(bencher: Bencher) {
    let length = 4 * TAIL;
    let mut planner = RealFftPlanner::<f32>::new();
    let (forward, inverse) = (planner.plan_fft_forward(length), planner.plan_fft_inverse(length));
    let mut response = forward.make_input_vec();
    response[..TAIL].copy_from_slice(&tail(0));
    let mut spectrum = forward.make_output_vec();
    forward.process(&mut response, &mut spectrum).unwrap();
    let input = noise(99, length);
    let mut bins = forward.make_output_vec();
    let mut samples = forward.make_input_vec();
    bencher.counter(ItemsCount::new(length - TAIL)).bench_local(|| {
        samples.copy_from_slice(black_box(&input));
        forward.process(&mut samples, &mut bins).unwrap();
        bins.iter_mut().zip(&spectrum).for_each(|(a, b)| *a *= b);
        inverse.process(&mut bins, &mut samples).unwrap();
        samples[0]
    });
}

fn hall() -> Room {
    Room::new([0.0; 3], [18.0, 11.0, 25.0], 30.0, &Walls::all([0.3; 8])).unwrap()
}

#[divan::bench(args = [3, 19])]
fn images(bencher: Bencher, order: usize) {
    let room = hall();
    let count = room.images(order).unwrap().len();
    bencher.counter(ItemsCount::new(count)).bench_local(|| black_box(&room).images(order).unwrap());
}

#[divan::bench]
fn reverberation(bencher: Bencher) {
    bencher.bench_local(|| Reverberation::new(black_box(&hall()), &Medium::default(), 3).unwrap());
}

#[divan::bench(args = [48_000, 96_000])]
fn tail_of_a_hall(bencher: Bencher, rate_hz: u32) {
    let reverberation = Reverberation::new(&hall(), &Medium::default(), 3).unwrap();
    let count = reverberation.tail(f64::from(rate_hz), 1, 1).unwrap().len();
    bencher
        .counter(ItemsCount::new(count))
        .bench_local(|| reverberation.tail(black_box(f64::from(rate_hz)), 1, 1).unwrap());
}

#[divan::bench(args = [48_000, 96_000])]
fn filters(bencher: Bencher, rate_hz: u32) {
    let filters = BandFilters::new(f64::from(rate_hz)).unwrap();
    let mut out = vec![0.0; filters.taps()];
    let gains = [0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2];
    bencher
        .counter(ItemsCount::new(out.len()))
        .bench_local(|| filters.fill(black_box(&gains), black_box(&mut out)));
}
