//! What a room costs: keys of all images of a moving source, and hearing them.
//!
//! ```text
//! cargo bench -p froufrou --bench rooms
//! ```
//!
//! Each row is a second of a source that walks through a room, heard by a listener on one core. `items/s` counts
//! image-seconds: a room of order 1 has 7 images, the source among them, of order 2 25, of order 3 63.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use froufrou::render::offline::{self, Extent};
use froufrou::render::production::Production;
use froufrou::scene::Scene;
use froufrou::synth::mixer::Mixer;
use froufrou::synth::receivers;

fn main() {
    divan::main();
}

const IMAGES: [usize; 4] = [1, 7, 25, 63];

fn production(order: usize, layout: &str, walls: &str, tail: bool) -> Production {
    let text = format!(
        "duration = 1\n[room]\nsize = [9, 4, 7]\norder = {order}\nabsorption = {walls}\ntail = {tail}\n\
         [listener]\nlayout = '{layout}'\nposition = [5, 1.7, 4]\n[instrument.wind]\nkind = 'turbulence'\n\
         [[object]]\nname = 'walker'\ntrack = [{{ t = 0, position = [1, 1, 1] }}, {{ t = 1, position = [2.4, 1, 1] }}]\n\
         sound = {{ instrument = 'wind', set = [{{ t = 0, speed = 5 }}] }}\n"
    );
    let file = std::env::temp_dir().join(format!("froufrou-room-{order}-{layout}-{tail}.toml"));
    std::fs::write(&file, &text).expect("a scene");
    Production::open(Scene::open(&file, false).expect("a scene")).expect("a production")
}

/// Walls that absorb each band differently, and all alike.
const COLOURED: &str = "[0.1, 0.1, 0.2, 0.2, 0.3, 0.3, 0.4, 0.5]";
const PLAIN: &str = "0.2";

/// From places to the gains, delays and colours of every image.
#[divan::bench(args = [1, 2, 3], sample_count = 20)]
fn keys(bencher: Bencher, order: usize) {
    let production = production(order, "mono", COLOURED, false);
    bencher.counter(ItemsCount::new(IMAGES[order])).bench_local(|| {
        production.channel_lines().expect("lines").for_each(|line| {
            black_box(line.expect("a line"));
        });
    });
}

fn hear(bencher: Bencher, order: usize, production: &Production) {
    let header = production.channel_header();
    let receivers = receivers::load(&header, &production.scene.folder, 48_000).expect("receivers");
    let lines: Vec<_> =
        production.channel_lines().expect("lines").map(|line| line.expect("a line")).collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let extent = Extent { rate_hz: 48_000, from_s: 0.0, to_s: Some(1.0), duration_s: None };
    let channels = header.channels().len();
    bencher.counter(ItemsCount::new(IMAGES[order])).with_inputs(|| lines.clone()).bench_local_values(
        |lines| {
            let lines = lines.into_iter().map(Ok);
            let mut mixer =
                Mixer::new(48_000, receivers.clone(), production.prototypes.clone(), lines).expect("a score");
            pool.install(|| {
                offline::render(&mut mixer, channels, &extent, false, |piece| {
                    black_box(piece.mix);
                    Ok(())
                })
            })
        },
    );
}

/// One microphone, walls without colour.
#[divan::bench(args = [0, 1, 2, 3], sample_count = 5)]
fn plain_walls(bencher: Bencher, order: usize) {
    hear(bencher, order, &production(order, "mono", PLAIN, false));
}

/// One microphone, a filter of octave bands for each image.
#[divan::bench(args = [0, 1, 2, 3], sample_count = 5)]
fn coloured_walls(bencher: Bencher, order: usize) {
    hear(bencher, order, &production(order, "mono", COLOURED, false));
}

/// Two ears: the filters of the head and of the walls.
#[divan::bench(args = [0, 1, 2, 3], sample_count = 5)]
fn coloured_walls_two_ears(bencher: Bencher, order: usize) {
    hear(bencher, order, &production(order, "binaural", COLOURED, false));
}

/// One microphone and the tail behind the source alone.
#[divan::bench(args = [0], sample_count = 5)]
fn tail(bencher: Bencher, order: usize) {
    hear(bencher, order, &production(order, "mono", COLOURED, true));
}
