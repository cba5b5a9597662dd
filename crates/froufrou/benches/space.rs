//! What it costs to pan, to encode and decode ambisonics, to gather an extended source, and to mirror a dipole.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use froufrou::random::Random;
use froufrou::score::Loudspeaker;
use froufrou::space::ambisonic::{Decoder, Level, Rotation, Weights, encode};
use froufrou::space::dipole::{Arrival, Disk, Plane, factors};
use froufrou::space::extended::Gathering;
use froufrou::space::layout::Layout;
use froufrou::space::panning::Panner;
use realfft::num_complex::Complex;

fn main() {
    divan::main();
}

/// Directions all about, none of length 1.
fn directions(count: u64) -> Vec<[f64; 3]> {
    let random = Random::new(1, 1);
    (0..count).map(|i| [0, 1, 2].map(|k| 2.0 * random.uniform(3 * i + k) - 1.0)).collect()
}

fn pan(bencher: Bencher, speakers: &[Loudspeaker]) {
    let panner = Panner::new(speakers).expect("a layout");
    let directions = directions(1000);
    let mut gains = vec![0.0; speakers.len()];
    bencher.counter(ItemsCount::new(directions.len())).bench_local(|| {
        for &direction in &directions {
            panner.gains(black_box(direction), &mut gains);
            black_box(&gains);
        }
    });
}

/// The gains of a layout for 1000 directions.
#[divan::bench(args = ["mono", "stereo", "5.1", "7.1.4"])]
fn panning(bencher: Bencher, name: &str) {
    pan(bencher, Layout::named(name).expect("a name").speakers());
}

fn dome() -> Vec<Loudspeaker> {
    let place = |i: u32| (f64::from(i) * 137.5, f64::from(i).mul_add(2.7, -85.0));
    (0..64).map(place).enumerate().map(|(i, (a, e))| Loudspeaker::new(format!("s{i}"), a, e)).collect()
}

/// The gains of 64 loudspeakers for 1000 directions.
#[divan::bench]
fn panning_to_64(bencher: Bencher) {
    pan(bencher, &dome());
}

/// The gains of a layout for 1000 wide sources.
#[divan::bench]
fn panning_wide_sources(bencher: Bencher) {
    let panner = Panner::new(Layout::named("7.1.4").expect("a name").speakers()).expect("a layout");
    let directions = directions(1000);
    let mut gains = [0.0; 12];
    bencher.counter(ItemsCount::new(directions.len())).bench_local(|| {
        for &direction in &directions {
            panner.spread_gains(black_box(direction), 40.0, &mut gains);
            black_box(&gains);
        }
    });
}

/// A panner is made.
#[divan::bench(args = ["stereo", "7.1.4"])]
fn making_a_panner(name: &str) -> Panner {
    Panner::new(Layout::named(name).expect("a name").speakers()).expect("a layout")
}

/// A panner to 64 loudspeakers is made.
#[divan::bench]
fn making_a_panner_to_64(bencher: Bencher) {
    let speakers = dome();
    bencher.bench_local(|| Panner::new(&speakers).expect("a layout"));
}

/// 1000 directions, to third order.
#[divan::bench]
fn encoding(bencher: Bencher) {
    let directions = directions(1000);
    let mut signals = [0.0; 16];
    bencher.counter(ItemsCount::new(directions.len())).bench_local(|| {
        for &direction in &directions {
            encode(black_box(direction), &mut signals);
            black_box(&signals);
        }
    });
}

/// A rotation of third order is made, and one moment turned.
#[divan::bench]
fn turning(bencher: Bencher) {
    let matrix = [[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]];
    let mut signals = [0.5; 16];
    bencher.bench_local(|| {
        Rotation::new(black_box(matrix)).apply(&mut signals);
        signals
    });
}

/// A decoder of third order by way of virtual loudspeakers is made.
#[divan::bench]
fn making_a_decoder(bencher: Bencher) {
    let layout = Layout::named("7.1.4").expect("a name");
    bencher.bench_local(|| Decoder::all_rad(layout.speakers(), 3, Weights::MaxRe, Level::Energy));
}

/// Points of a cloud about a listener gathered in 32 bins.
#[divan::bench(args = [1_000, 100_000])]
fn gathering(bencher: Bencher, count: u64) {
    let points: Vec<([f64; 3], f64)> = directions(count).into_iter().map(|at| (at, 1.0)).collect();
    let mut gathering = Gathering::new(32).expect("a number of bins");
    bencher
        .counter(ItemsCount::new(count))
        .bench_local(|| gathering.gather(black_box([0.1, 0.2, 0.3]), points.iter().copied())[0]);
}

/// Points of a sheet, one beside the other, gathered in 32 bins.
#[divan::bench(args = [1_000, 100_000])]
fn gathering_a_sheet(bencher: Bencher, count: u32) {
    let rows = f64::from(count).sqrt().ceil() as u32;
    let place =
        |i: u32| [f64::from(i % rows) / f64::from(rows), 0.0, -1.0 - f64::from(i / rows) / f64::from(rows)];
    let points: Vec<([f64; 3], f64)> = (0..count).map(|i| (place(i), 1.0)).collect();
    let mut gathering = Gathering::new(32).expect("a number of bins");
    bencher
        .counter(ItemsCount::new(count))
        .bench_local(|| gathering.gather(black_box([0.1, 0.2, 0.3]), points.iter().copied())[0]);
}

const DISK: Disk = Disk { position_m: [0.0, 0.3, 0.0], normal: [0.0, 1.0, 0.0], radius_m: 0.05 };
const FLOOR: Plane = Plane { point_m: [0.0; 3], normal: [0.0, 1.0, 0.0] };

/// A dipole over a plane, for a clip.
#[divan::bench]
fn mirroring(bencher: Bencher) {
    bencher.bench_local(|| {
        black_box(DISK).arrivals(&[FLOOR], black_box([1.0, 1.5, 2.0]), 340.0).map(|way| way.gain).sum::<f64>()
    });
}

/// A dipole over a plane, for a spectrum of 1025 bins.
#[divan::bench]
fn spectrum_over_a_plane(bencher: Bencher) {
    let arrivals: Vec<Arrival> = DISK.arrivals(&[FLOOR], [1.0, 1.5, 2.0], 340.0).collect();
    let mut spectrum = vec![Complex::new(0.0, 0.0); 1025];
    bencher.counter(ItemsCount::new(1025usize)).bench_local(|| {
        factors(black_box(&arrivals), 44_100.0 / 2048.0, &mut spectrum);
        spectrum[7]
    });
}
