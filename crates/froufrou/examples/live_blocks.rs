//! How long the audio thread takes for a block, in a great many blocks: the median, and how far the worst are from it.
//!
//!     cargo run --release -p froufrou --example live_blocks -- --blocks 1000000 --frames 128 --voices 100
//!
//! Beside every block a loop runs that takes as long and does nothing but count: what it takes too long at times is due to
//! the machine. On Linux, blocks during which the thread was put aside for others are told apart, too. The worker's steps
//! lie between the blocks, on the same thread, and are not measured.

use std::collections::VecDeque;
use std::hint::black_box;
use std::time::Instant;

use froufrou::render::live::{self, Settings};
use froufrou::score::{Arrival, ChannelLine, Header, Order, Output, Start, Statement, Verb};
use froufrou::synth::mixer::Mixer;
use froufrou::synth::receivers;
use froufrou::synth::voice::Prototype;
use froufrou::{Error, Result};

const RATE_HZ: u32 = 48_000;

/// Keys a second.
const KEYS_HZ: f64 = 60.0;

const HELP: &str =
    "live_blocks [--blocks N] [--frames N] [--voices N] [--output head|mono] [--still] [--budget PART]";

struct Options {
    blocks: usize,
    frames: usize,
    voices: u64,
    output: Output,
    moves: bool,
    budget: f32,
}

impl Options {
    fn read(mut words: impl Iterator<Item = String>) -> Result<Self> {
        let head = Output::Head { ears: ["left".to_owned(), "right".to_owned()], head: None, shared: true };
        let mut options = Self {
            blocks: 20_000,
            frames: 128,
            voices: 100,
            output: head,
            moves: true,
            budget: f32::INFINITY,
        };
        while let Some(word) = words.next() {
            let mut value = || words.next().ok_or_else(|| Error::new(format!("{word} what?")).help(HELP));
            let number = |text: String| {
                let number = text.parse::<u64>().ok().filter(|number| *number > 0);
                number.ok_or_else(|| Error::new(format!("{text} is no number above 0")).help(HELP))
            };
            match word.as_str() {
                "--blocks" => options.blocks = number(value()?)? as usize,
                "--frames" => options.frames = number(value()?)? as usize,
                "--voices" => options.voices = number(value()?)?,
                "--budget" => {
                    let text = value()?;
                    options.budget = text.parse().map_err(|_| Error::new(format!("{text} is no number")))?;
                }
                "--output" => match value()?.as_str() {
                    "head" => {}
                    "mono" => options.output = Output::Channel("microphone".to_owned()),
                    other => return Err(Error::new(format!("no output {other}")).help(HELP)),
                },
                "--still" => options.moves = false,
                _ => return Err(Error::new(format!("{word}?")).help(HELP)),
            }
        }
        Ok(options)
    }
}

/// The lines of voices that circle without end, as they are asked for.
struct Circling {
    voices: u64,
    has_places: bool,
    moves: bool,
    key: u64,
    coming: VecDeque<ChannelLine>,
}

impl Iterator for Circling {
    type Item = Result<ChannelLine>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.coming.is_empty() {
            let time_s = self.key as f64 / KEYS_HZ;
            let moved_s = if self.moves { time_s } else { 0.0 };
            for thread in 0..self.voices {
                let phase = thread as f64 * 0.37;
                let angle = phase + moved_s * (0.3 + (thread % 7) as f64);
                let distance_m = 3.0 + 2.0 * (phase * 1.7 + moved_s).sin();
                let from_m = [distance_m * angle.sin(), (phase * 2.3).sin(), distance_m * angle.cos()];
                let verb = match self.key {
                    0 => Verb::Start(Start { offset_s: thread as f64 * 0.001, ..Start::new("noise") }),
                    _ => Verb::Key,
                };
                let arrival = Arrival::new(0.001 / distance_m, distance_m / 343.0);
                let value = vec![Arrival { from_m: self.has_places.then_some(from_m), ..arrival }];
                self.coming.push_back(ChannelLine::Thread(Statement {
                    thread,
                    path: 0,
                    time_s,
                    verb,
                    value,
                }));
            }
            self.key += 1;
        }
        self.coming.pop_front().map(Ok)
    }
}

/// How often this thread has been put aside for others; `None` where the system does not say.
fn switches() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/thread-self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("nonvoluntary_ctxt_switches:"))?;
    line.trim().parse().ok()
}

/// A loop that only counts.
fn count(times: u64) -> u64 {
    (0..times).fold(1, |sum, n| black_box(sum ^ n).rotate_left(7))
}

/// Median, quantiles and the worst, in microseconds.
fn tell(what: &str, times_s: &mut [f32]) {
    times_s.sort_unstable_by(f32::total_cmp);
    let at = |part: f64| {
        let index = (part * times_s.len() as f64) as usize;
        times_s.get(index.min(times_s.len().saturating_sub(1))).map_or(f64::NAN, |s| f64::from(*s) * 1e6)
    };
    let cells: Vec<String> =
        [0.1, 0.5, 0.9, 0.99, 0.999, 0.9999, 1.0].map(|part| format!("{:.1}", at(part))).to_vec();
    println!("| {what} | {} | {} |", times_s.len(), cells.join(" | "));
}

fn main() -> Result<()> {
    let options = Options::read(std::env::args().skip(1))?;
    let Options { blocks, frames, voices, output, moves, budget } = options;
    let random = froufrou::random::Random::new(1, 0);
    let samples = (0..96_000).map(|i| (random.uniform(i) * 2.0 - 1.0) as f32).collect();
    let noise = Prototype { samples, rate_hz: f64::from(RATE_HZ), looped: true };
    let has_places = matches!(output, Output::Head { .. });
    let header = Header::new(Order::Time, vec![output]);
    let receivers = receivers::load(&header, std::path::Path::new(""), RATE_HZ)?;
    let lines = Circling { voices, has_places, moves, key: 0, coming: VecDeque::new() };
    let mixer = Mixer::new(RATE_HZ, receivers, [("noise".to_owned(), noise.into())], lines)?;
    let ahead_s = 0.1f64.max(2.0 * frames as f64 / f64::from(RATE_HZ));
    let settings = Settings { ahead_s, budget, ..Settings::default() };
    let (mut supply, mut player) = live::part(mixer.looking_ahead(0.005), settings)?;
    let mut block = vec![0.0; frames * player.channels()];

    let mut taken_s = |supply: &mut live::Supply<Circling>| {
        // Nobody asks what has begun.
        supply.take_begun();
        supply.go_on()?;
        let begun = Instant::now();
        player.fill(black_box(&mut block));
        Ok::<f64, Error>(begun.elapsed().as_secs_f64())
    };
    let mut first_s = Vec::new();
    for _ in 0..200 {
        first_s.push(taken_s(&mut supply)?);
    }
    first_s.sort_unstable_by(f64::total_cmp);
    // So many times does the loop count in as long a time.
    let begun = Instant::now();
    black_box(count(1 << 20));
    let counts = (first_s[100] / begun.elapsed().as_secs_f64() * f64::from(1 << 20)) as u64;

    let (mut fills_s, mut undisturbed_s, mut empty_s) = (Vec::new(), Vec::new(), Vec::new());
    fills_s.reserve(blocks);
    empty_s.reserve(blocks);
    let before = supply.statistics();
    for _ in 0..blocks {
        let switched = switches();
        let fill_s = taken_s(&mut supply)? as f32;
        if switched.is_some() && switches() == switched {
            undisturbed_s.push(fill_s);
        }
        fills_s.push(fill_s);
        let begun = Instant::now();
        black_box(count(black_box(counts)));
        empty_s.push(begun.elapsed().as_secs_f32());
    }
    let late_us = 1e6 * frames as f64 / f64::from(RATE_HZ);
    println!(
        "{voices} voices, {blocks} blocks of {frames} frames, which last {late_us:.1} µs each; in µs:\n"
    );
    println!("| | blocks | 10 % | median | 90 % | 99 % | 99.9 % | 99.99 % | worst |");
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    tell("rendered", &mut fills_s);
    if !undisturbed_s.is_empty() {
        tell("of these, not put aside for others", &mut undisturbed_s);
    }
    tell("counted only", &mut empty_s);
    let statistics = supply.statistics();
    println!(
        "\nlate blocks: {}, voices released: {}, {} now",
        statistics.late_blocks - before.late_blocks,
        statistics.stolen,
        statistics.released
    );
    Ok(())
}
