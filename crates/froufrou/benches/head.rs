//! What a head costs on one core.
//!
//! ```text
//! cargo bench -p froufrou --bench head
//! ```
//!
//! `hear` counts directions: filters, delays and gains of both ears, for the sphere and for sets. `FROUFROU_DATA`
//! names the folder of test data; where a set is not there, a small one of our own is asked. `open` reads a set
//! and makes its filters at 48 kHz.
//!
//! `shared_head`, `full_head`, `measured_head`, `coloured` and `coloured_head` count voice-seconds: moving voices that one head hears at 48 kHz, all the way from keys
//! to samples of both ears: by way of a shared bus, or with filters of their own that are the sphere's (109 taps), a
//! measured set's (603 taps), those of a room's octave bands into one channel (961 taps), and the set's with the
//! room's (1563 taps). 10⁹ / (48 000 × items/s) is
//! nanoseconds a voice and sample.

use std::path::{Path, PathBuf};

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use froufrou::render::offline::{self, Extent};
use froufrou::score::{Arrival, ChannelLine, Header, Order, Output, Start, Statement, Verb};
use froufrou::space::head::Head;
use froufrou::synth::mixer::Mixer;
use froufrou::synth::receivers;
use froufrou::synth::voice::Prototype;

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

/// A second of voices that circle the head at different speeds and distances, with 25 keys a second.
fn lines(voices: u64, has_places: bool, has_colours: bool) -> Vec<ChannelLine> {
    let mut lines = Vec::new();
    for key in 0..=30u64 {
        for thread in 0..voices {
            let time_s = key as f64 / 25.0;
            let (phase, turn) = (thread as f64 * 0.37, 0.3 + (thread % 7) as f64);
            let angle = phase + time_s * turn;
            let distance_m = 3.0 + 2.0 * (phase * 1.7 + time_s).sin();
            let from_m = [distance_m * angle.sin(), (phase * 2.3).sin(), distance_m * angle.cos()];
            let arrival = Arrival::new(0.3 / distance_m, distance_m / 343.0);
            let verb = match key {
                0 => Verb::Start(Start { offset_s: thread as f64 * 0.001, ..Start::new("noise") }),
                30 => Verb::End,
                _ => Verb::Key,
            };
            // As walls of plaster and air dull it, more and more.
            let bands = std::array::from_fn(|band| (0.9 - 0.001 * key as f64).powi(1 + band as i32));
            let bands = has_colours.then_some(bands);
            let value = vec![Arrival { from_m: has_places.then_some(from_m), bands, ..arrival }];
            lines.push(ChannelLine::Thread(Statement { thread, path: 0, time_s, verb, value }));
        }
    }
    lines
}

fn voices(bencher: Bencher, voices: u64, output: Output, has_colours: bool) {
    let random = froufrou::random::Random::new(1, 0);
    let samples = (0..96_000).map(|i| (random.uniform(i) * 2.0 - 1.0) as f32).collect();
    let noise = Prototype { samples, rate_hz: RATE_HZ, looped: true };
    let (has_places, channels) = (matches!(output, Output::Head { .. }), output.channels().len());
    let header = Header::new(Order::Time, vec![output]);
    let receivers = receivers::load(&header, Path::new(""), 48_000).expect("a head");
    let lines = lines(voices, has_places, has_colours);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let extent = Extent { rate_hz: 48_000, from_s: 0.0, to_s: Some(1.0), duration_s: None };
    bencher.counter(ItemsCount::new(voices)).with_inputs(|| lines.clone()).bench_local_values(|lines| {
        let sounds = [("noise".to_owned(), noise.clone().into())];
        let lines = lines.into_iter().map(Ok);
        let mut mixer = Mixer::new(48_000, receivers.clone(), sounds, lines).expect("a score");
        pool.install(|| {
            offline::render(&mut mixer, channels, &extent, false, |piece| {
                black_box(piece.mix);
                Ok(())
            })
        })
    });
}

fn head(measured: bool, shared: bool) -> Output {
    let file = measured.then(|| path(SETS[0]).to_string_lossy().into_owned());
    Output::Head { ears: ["left".to_owned(), "right".to_owned()], head: file, shared }
}

#[divan::bench(args = [16, 256, 1000], sample_count = 5)]
fn shared_head(bencher: Bencher, count: u64) {
    voices(bencher, count, head(false, true), false);
}

#[divan::bench(args = [16, 256, 1000], sample_count = 3)]
fn full_head(bencher: Bencher, count: u64) {
    voices(bencher, count, head(false, false), false);
}

#[divan::bench(args = [16, 256], sample_count = 3)]
fn measured_head(bencher: Bencher, count: u64) {
    voices(bencher, count, head(true, false), false);
}

#[divan::bench(args = [16, 256], sample_count = 3)]
fn coloured(bencher: Bencher, count: u64) {
    voices(bencher, count, Output::Channel("microphone".to_owned()), true);
}

#[divan::bench(args = [16, 64], sample_count = 3)]
fn coloured_head(bencher: Bencher, count: u64) {
    voices(bencher, count, head(true, false), true);
}
