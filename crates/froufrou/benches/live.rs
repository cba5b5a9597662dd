//! What an audio thread spends on voices: `cargo bench -p froufrou --bench live`.
//!
//! A bench is a fifth of a second of sound; the unit is a voice. Below 200 ms the voices fit on one core.

use std::path::Path;
use std::sync::Arc;

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use froufrou::render::live::{self, Player, Settings};
use froufrou::score::{Arrival, ChannelLine, Header, Order, Output, Start, Statement, Verb};
use froufrou::synth::mixer::{Mixer, Sounding};
use froufrou::synth::receivers;
use froufrou::synth::stick_slip::StickSlip;
use froufrou::synth::voice::Prototype;

const RATE_HZ: u32 = 48_000;

fn main() {
    divan::main();
}

/// Voices that circle, with 60 keys a second; still ones have keys, too.
fn lines(voices: u64, output: &Output, moves: bool, is_recorded: bool) -> Vec<ChannelLine> {
    let has_places = matches!(output, Output::Head { .. });
    let mut lines = Vec::new();
    for key in 0..=90u64 {
        for thread in 0..voices {
            let time_s = key as f64 / 60.0;
            let moved_s = if moves { time_s } else { 0.0 };
            let phase = thread as f64 * 0.37;
            let angle = phase + moved_s * (0.3 + (thread % 7) as f64);
            let distance_m = 3.0 + 2.0 * (phase * 1.7 + moved_s).sin();
            let from_m = [distance_m * angle.sin(), (phase * 2.3).sin(), distance_m * angle.cos()];
            // What is synthesised has no beginning to be away from.
            let offset_s = if is_recorded { thread as f64 * 0.001 } else { 0.0 };
            let verb = match key {
                0 => Verb::Start(Start { offset_s, ..Start::new("noise") }),
                90 => Verb::End,
                _ => Verb::Key,
            };
            let arrival = Arrival::new(0.001 / distance_m, distance_m / 343.0);
            let value = vec![Arrival { from_m: has_places.then_some(from_m), ..arrival }];
            lines.push(ChannelLine::Thread(Statement { thread, path: 0, time_s, verb, value }));
        }
    }
    lines
}

/// What all voices play.
fn recording() -> Sounding {
    let random = froufrou::random::Random::new(1, 0);
    let samples = (0..96_000).map(|i| (random.uniform(i) * 2.0 - 1.0) as f32).collect();
    Prototype { samples, rate_hz: f64::from(RATE_HZ), looped: true }.into()
}

/// The same where a worker synthesises it: what that sounds like makes no difference here.
fn instrument() -> Sounding {
    Sounding::Instrument(Arc::new(StickSlip::new(&[]).expect("no parameters")))
}

/// A player that has half a second before it, past the beginning.
fn player(output: &Output, lines: &[ChannelLine], sound: Sounding) -> Player {
    let header = Header::new(Order::Time, vec![output.clone()]);
    let receivers = receivers::load(&header, Path::new(""), RATE_HZ).expect("a head");
    let lines = lines.iter().cloned().map(Ok::<_, froufrou::Error>);
    let mixer = Mixer::new(RATE_HZ, receivers, [("noise".to_owned(), sound)], lines).expect("a score");
    let settings = Settings { ahead_s: 0.5, ..Settings::default() };
    let (mut supply, mut player) = live::part(mixer, settings).expect("a player");
    let mut block = vec![0.0; 128 * player.channels()];
    for _ in 0..40 {
        supply.go_on().expect("lines");
        player.fill(&mut block);
    }
    supply.go_on().expect("lines");
    player
}

fn fill(bencher: Bencher, voices: u64, output: Output, moves: bool, block: usize) {
    play(bencher, recording(), voices, output, moves, block);
}

fn play(bencher: Bencher, sound: Sounding, voices: u64, output: Output, moves: bool, block: usize) {
    let lines = lines(voices, &output, moves, matches!(sound, Sounding::Recording(_)));
    let inputs = || player(&output, &lines, sound.clone());
    bencher.counter(ItemsCount::new(voices)).with_inputs(inputs).bench_local_values(|mut player| {
        let mut samples = vec![0.0; block * player.channels()];
        for _ in 0..RATE_HZ as usize / 5 / block {
            player.fill(black_box(&mut samples));
        }
        player
    });
}

fn head() -> Output {
    Output::Head { ears: ["left".to_owned(), "right".to_owned()], head: None, shared: true }
}

fn microphone() -> Output {
    Output::Channel("microphone".to_owned())
}

#[divan::bench(args = [1, 256, 1000], sample_count = 5, sample_size = 1)]
fn shared_head(bencher: Bencher, voices: u64) {
    fill(bencher, voices, head(), true, 128);
}

#[divan::bench(args = [32, 4096], sample_count = 5, sample_size = 1)]
fn shared_head_of_1000_by_block(bencher: Bencher, block: usize) {
    fill(bencher, 1000, head(), true, block);
}

#[divan::bench(args = [1, 256, 1000], sample_count = 5, sample_size = 1)]
fn moving_microphone(bencher: Bencher, voices: u64) {
    fill(bencher, voices, microphone(), true, 128);
}

#[divan::bench(args = [1, 256, 1000], sample_count = 5, sample_size = 1)]
fn still_microphone(bencher: Bencher, voices: u64) {
    fill(bencher, voices, microphone(), false, 128);
}

#[divan::bench(args = [1, 256, 1000], sample_count = 5, sample_size = 1)]
fn synthesised_by_moving_microphone(bencher: Bencher, voices: u64) {
    play(bencher, instrument(), voices, microphone(), true, 128);
}
