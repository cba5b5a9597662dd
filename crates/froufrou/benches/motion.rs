//! What it costs to find contacts in bare motion: boxes that lie about on a floor, a third of which fall and
//! bounce, so that each has a few neighbours.
//!
//! A body-frame that rests on the floor, and a pair that is near, are the units.

use divan::Bencher;
use divan::counter::ItemsCount;
use froufrou::motion::rigid::{Analyser, Body, Shape};
use froufrou::scene::animation::Transform;

const FRAMES: usize = 24;

fn main() {
    divan::main();
}

fn at(x: f64, y: f64, z: f64) -> Transform {
    [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, y], [0.0, 0.0, 1.0, z], [0.0, 0.0, 0.0, 1.0]]
}

/// Bodies on a square grid; some of them bounce.
fn frames(count: usize, apart_m: f64) -> Vec<Vec<Transform>> {
    let side = (count as f64).sqrt().ceil() as usize;
    let height = |body: usize, time_s: f64| {
        if !body.is_multiple_of(3) {
            return 0.0;
        }
        // Up and down within a second.
        let phase = (time_s + 0.1 * (body % 10) as f64).rem_euclid(0.8);
        4.905 * phase * (0.8 - phase)
    };
    let frame = |frame: usize| {
        let time_s = frame as f64 / 24.0;
        let mut all = vec![at(0.0, -0.5, 0.0)];
        all.extend((0..count).map(|body| {
            let (x, z) = ((body % side) as f64 * apart_m, (body / side) as f64 * apart_m);
            at(x, 0.1 + height(body, time_s), z)
        }));
        all
    };
    (0..FRAMES).map(frame).collect()
}

fn run(bencher: Bencher<'_, '_>, count: usize, apart_m: f64, shape: &Shape) {
    let frames = frames(count, apart_m);
    let bodies = || {
        let floor = Body::new("floor", Shape::cuboid([1000.0, 0.5, 1000.0]), 1000.0).fixed();
        let others = (0..count).map(|body| Body::new(&format!("body{body}"), shape.clone(), 500.0));
        std::iter::once(floor).chain(others).collect::<Vec<_>>()
    };
    bencher
        .counter(ItemsCount::new(count * FRAMES))
        .with_inputs(|| Analyser::new(bodies(), [0.0, -9.81, 0.0]))
        .bench_values(|mut analyser| {
            let mut events = 0;
            for (frame, transforms) in frames.iter().enumerate() {
                analyser.feed(frame as f64 / 24.0, transforms).expect("sound frames");
                events += std::iter::from_fn(|| analyser.next_event()).count();
            }
            analyser.finish();
            (events, analyser.near_pairs())
        });
}

/// Balls that are far from each other: each is near the floor alone.
#[divan::bench(args = [10, 100, 1000])]
fn balls_apart(bencher: Bencher<'_, '_>, count: usize) {
    run(bencher, count, 1.0, &Shape::sphere(0.1));
}

/// Boxes that are far from each other.
#[divan::bench(args = [10, 100, 1000])]
fn boxes_apart(bencher: Bencher<'_, '_>, count: usize) {
    run(bencher, count, 1.0, &Shape::cuboid([0.1; 3]));
}

/// Boxes side by side, each near four others and the floor.
#[divan::bench(args = [10, 100, 1000])]
fn boxes_side_by_side(bencher: Bencher<'_, '_>, count: usize) {
    run(bencher, count, 0.2005, &Shape::cuboid([0.1; 3]));
}
