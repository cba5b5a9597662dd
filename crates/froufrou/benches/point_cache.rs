//! How fast point caches and OBJ files are read, in vertices and frames: `cargo bench --bench point_cache`.

use std::fmt::Write;
use std::path::PathBuf;

use divan::Bencher;
use divan::counter::ItemsCount;
use froufrou::scene::animation::Mesh;
use froufrou::scene::world::open_animation;

const FRAMES: u32 = 50;
const POINTS: u32 = 100_000;

fn main() {
    divan::main();
}

/// A folder with a file of that many frames and vertices.
fn file(name: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    let numbers = (0..FRAMES * POINTS * 3).map(|n| (n % 1000) as f32 / 7.0);
    let bytes: Vec<u8> = if name.ends_with(".pc2") {
        let head = [1_i32.to_le_bytes(), POINTS.to_le_bytes(), 0_f32.to_le_bytes(), 1_f32.to_le_bytes()];
        let head = [&b"POINTCACHE2\0"[..], &head.concat(), &FRAMES.to_le_bytes()].concat();
        head.into_iter().chain(numbers.flat_map(f32::to_le_bytes)).collect()
    } else {
        let times = (0..FRAMES).flat_map(|frame| (frame as f32 / 24.0).to_be_bytes());
        let head = [FRAMES.to_be_bytes(), POINTS.to_be_bytes()].concat();
        head.into_iter().chain(times).chain(numbers.flat_map(f32::to_be_bytes)).collect()
    };
    std::fs::write(&path, bytes).expect("a file");
    (folder, path)
}

/// Every frame, and as many between two as make the density.
fn read(path: &PathBuf, density: u32) -> f32 {
    let animation = open_animation(path).expect("a sound file");
    let mut mesh = Mesh::default();
    let mut sum = 0.0;
    for step in 0..FRAMES * density {
        animation.mesh(0, f64::from(step) / f64::from(density) / 24.0, &mut mesh).expect("a sound sample");
        sum += mesh.positions[0][0];
    }
    sum
}

#[divan::bench(args = ["cache.pc2", "cache.mdd"])]
fn all_frames(bencher: Bencher, name: &str) {
    let (_folder, path) = file(name);
    bencher.counter(ItemsCount::new(FRAMES * POINTS)).bench(|| read(&path, 1));
}

#[divan::bench(args = ["cache.pc2", "cache.mdd"])]
fn all_frames_four_times_as_dense(bencher: Bencher, name: &str) {
    let (_folder, path) = file(name);
    bencher.counter(ItemsCount::new(4 * FRAMES * POINTS)).bench(|| read(&path, 4));
}

/// One file of text, with as many quadrilaterals as vertices, nearly.
#[divan::bench]
fn obj(bencher: Bencher) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("grid.obj");
    let (columns, mut text) = (400, String::from("o grid\n"));
    for point in 0..POINTS {
        let (x, z) = (f64::from(point % columns) / 37.0, f64::from(point / columns) / 37.0);
        writeln!(text, "v {x:.6} {:.6} {z:.6}", (x * z).sin()).expect("room");
    }
    for row in 0..POINTS / columns - 1 {
        for a in (1..columns).map(|column| row * columns + column) {
            writeln!(
                text,
                "f {a}/{a}/{a} {0}/{0}/{0} {1}/{1}/{1} {2}/{2}/{2}",
                a + columns,
                a + columns + 1,
                a + 1
            )
            .expect("room");
        }
    }
    std::fs::write(&path, text).expect("a file");
    bencher
        .counter(ItemsCount::new(POINTS))
        .bench(|| open_animation(&path).expect("a sound file").objects().len());
}
