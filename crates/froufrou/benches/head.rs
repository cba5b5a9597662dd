//! What a head costs on one core.
//!
//! ```text
//! cargo bench -p froufrou --bench head
//! ```
//!
//! `hear` counts directions: filters, delays and gains of both ears, for the sphere and for sets. `FROUFROU_DATA`
//! names the folder of test data; where a set is not there, a small one of our own is asked. `open` reads a set
//! and makes its filters at 48 kHz.

use std::path::{Path, PathBuf};

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use froufrou::space::head::Head;

fn main() {
    divan::main();
}

const RATE_HZ: f64 = 48_000.0;
const SETS: [&str; 2] = ["MIT_KEMAR_normal_pinna", "FHK_HRIR_L2354"];

fn path(name: &str) -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let data =
        std::env::var_os("FROUFROU_DATA").map_or_else(|| here.join("../../../shared/data"), PathBuf::from);
    let path = data.join("hrtf").join(name).with_extension("sofa");
    if path.exists() { path } else { here.join("tests/fixtures/head/sphere.sofa") }
}

fn hear(bencher: Bencher, head: &Head) {
    let mut taps = [vec![0.0; head.taps()], vec![0.0; head.taps()]];
    let mut step = 0_u32;
    bencher.counter(ItemsCount::new(1_u32)).bench_local(|| {
        // A source that circles and bobs, as triangles change now and then.
        step += 1;
        let (angle, height) = (f64::from(step) * 0.003, f64::from(step) * 0.0007);
        let [left, right] = &mut taps;
        black_box(head.hear([2.0 * angle.sin(), height.sin(), 2.0 * angle.cos()], [left, right]))
    });
}

#[divan::bench]
fn hear_sphere(bencher: Bencher) {
    hear(bencher, &Head::spherical(RATE_HZ));
}

#[divan::bench(args = SETS)]
fn hear_set(bencher: Bencher, name: &str) {
    hear(bencher, &Head::open(&path(name), RATE_HZ).expect("a set"));
}

#[divan::bench(args = SETS, sample_count = 3)]
fn open(bencher: Bencher, name: &str) {
    let path = path(name);
    bencher.bench_local(|| Head::open(&path, RATE_HZ).expect("a set").taps());
}
