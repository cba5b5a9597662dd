//! What contacts cost that sound like grains: choosing them, playing them, mixing them.
//!
//! ```text
//! cargo bench -p froufrou --bench retargeting
//! ```
//!
//! `items/s` counts impacts, or contact-seconds: with 1000 contacts, more than 1000 of them a second is faster than real
//! time. Mixing uses all cores, unless `DIVAN_THREADS` or `RAYON_NUM_THREADS` says otherwise.

use std::path::Path;
use std::sync::Arc;

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use froufrou::corpus::dictionary::{Action, Dictionary, Example, Settings};
use froufrou::corpus::grains::Contact;
use froufrou::random::Random;
use froufrou::render::offline::{self, Extent};
use froufrou::score::retarget::{Course, Play, Repertoire, Stream};
use froufrou::score::{self, Arrival, ChannelLine, Cue, Header, Order, Output, Start, Statement, Verb};
use froufrou::synth::grains::Grains;
use froufrou::synth::instrument::{GrainStart, Instrument, Stretch, stretch_samples};
use froufrou::synth::mixer::{Mixer, Sounding};
use froufrou::synth::receivers;

fn main() {
    divan::main();
}

const RATE_HZ: u32 = 48_000;

const COURSE: Course = Course { pitch: 1.0, spread: 0.0, force_n: 10.0, speed_mps: 1.0 };

/// Ten knocks that ring for half a second and four scrapes of three seconds, at a rate.
fn repertoire(rate_hz: u32) -> Arc<Repertoire> {
    let rate = f64::from(rate_hz);
    let noise = |n: u64, seed: u64| Random::new(seed, 5).normal(n);
    let knock = |number: u64| {
        let sample = |n: u64| {
            let age_s = n as f64 / rate;
            let ring = (std::f64::consts::TAU * (400.0 + 60.0 * number as f64) * age_s).sin();
            0.3 * (ring + 0.3 * noise(n, number) * (-200.0 * age_s).exp()) * (-14.0 * age_s).exp()
        };
        Example {
            name: format!("knock {number}"),
            samples: (0..rate_hz as u64 / 2).map(|n| sample(n) as f32).collect(),
            rate_hz,
            contact: Contact::Impulsive,
            action: Action::Hit,
        }
    };
    let scrape = |number: u64| {
        let mut low = 0.0;
        let mut sample = |n: u64| {
            low += 0.2 * (noise(n, 100 + number) - low);
            low + 0.1 * (n as f64 * (0.05 + 0.01 * number as f64)).sin()
        };
        Example {
            name: format!("scrape {number}"),
            samples: (0..3 * rate_hz as u64).map(|n| (0.2 * sample(n)) as f32).collect(),
            rate_hz,
            contact: Contact::Continuous,
            action: Action::Slide,
        }
    };
    let examples = (0..10).map(knock).chain((0..4).map(scrape));
    let dictionary = Dictionary::build(examples, Some(rate_hz), &Settings::default()).expect("a corpus");
    Arc::new(Repertoire::new(Arc::new(dictionary)))
}

/// All samples of one thread that is told of grains.
fn signal(grains: &Grains, plays: &[Play], lead_s: f64) -> f32 {
    let rate_hz = f64::from(RATE_HZ);
    let starts: Vec<GrainStart> =
        plays.iter().map(|play| GrainStart { time_s: play.time_s + lead_s, grain: play.grain }).collect();
    let mut player = grains.generator(rate_hz, Random::new(1, 1)).expect("grains");
    let count = stretch_samples(rate_hz);
    let (mut out, mut sum, mut next) = (vec![0.0; count], 0.0, 0);
    let end_s = starts.last().map_or(0.0, |start| start.time_s + 0.1);
    for first in (0..(end_s * rate_hz) as u64).step_by(count) {
        let until_s = (first + count as u64) as f64 / rate_hz;
        let due = starts[next..].iter().take_while(|start| start.time_s < until_s).count();
        let stretch =
            Stretch { first, rate_hz, controls: &[], strikes: &[], grains: &starts[next..next + due] };
        next += due;
        player.generate(&stretch, &mut out).expect("samples");
        sum += out[0];
    }
    sum
}

/// 100 impacts of one material: a hit is chosen for each, and all its samples are made.
#[divan::bench(args = [48_000, 44_100], sample_count = 20)]
fn hundred_impacts(bencher: Bencher, corpus_rate_hz: u32) {
    let repertoire = repertoire(corpus_rate_hz);
    let grains = Grains::new(repertoire.dictionary().clone());
    bencher.counter(ItemsCount::new(100u64)).bench(|| {
        let mut last = None;
        let mut sum = 0.0;
        for n in 0..100 {
            let hit = repertoire.hit(-0.2 * n as f64, Random::new(2, 2), n, last).expect("a hit");
            last = Some(hit);
            let hit = &repertoire.hits()[hit];
            sum += signal(&grains, &hit.plays, hit.lead_s());
        }
        black_box(sum)
    });
}

/// The grains of a contact that slides, for a second.
#[divan::bench(args = [1, 100, 1000], sample_count = 5)]
fn choosing_for_a_second(bencher: Bencher, contacts: u64) {
    let repertoire = repertoire(RATE_HZ);
    bencher.counter(ItemsCount::new(contacts)).bench(|| {
        for thread in 0..contacts {
            let mut stream = Stream::new(&repertoire, Action::Slide, Random::new(3, thread));
            for frame in 1..=60 {
                black_box(stream.until(f64::from(frame) / 60.0, COURSE, &repertoire, None).expect("grains"));
            }
        }
    });
}

/// Contacts that slide and move, told 60 times a second, mixed for a second as one head hears them, on all cores.
#[divan::bench(args = [100, 1000], sample_count = 3)]
fn mixing_contacts_for_a_second_on_a_head(bencher: Bencher, contacts: u64) {
    let ears = ["left".to_owned(), "right".to_owned()];
    mix(bencher, contacts, vec![Output::Head { ears, head: None, shared: true }]);
}

/// The same for two microphones.
#[divan::bench(args = [100, 1000], sample_count = 3)]
fn mixing_contacts_for_a_second_in_stereo(bencher: Bencher, contacts: u64) {
    mix(bencher, contacts, ["left", "right"].map(|name| Output::Channel(name.to_owned())).into());
}

fn mix(bencher: Bencher, contacts: u64, outputs: Vec<Output>) {
    let has_places = outputs.iter().any(|output| matches!(output, Output::Head { .. }));
    let repertoire = repertoire(RATE_HZ);
    let sound = Sounding::Instrument(Arc::new(Grains::new(repertoire.dictionary().clone())));
    let mut lines: Vec<(f64, u8, ChannelLine)> = Vec::new();
    for thread in 1..=contacts {
        let mut stream = Stream::new(&repertoire, Action::Slide, Random::new(4, thread));
        let mut cues: Vec<(f64, score::Action)> = Vec::new();
        for frame in 0..=72u32 {
            let time_s = f64::from(frame) / 60.0;
            let phase = thread as f64 * 0.37 + time_s * (2 + thread % 7) as f64;
            let arrive = |side: usize| {
                let distance_m = 10.0 + 1.7 * (phase + 0.2 * side as f64).sin();
                let from_m = [distance_m * phase.cos(), 0.0, distance_m * phase.sin()];
                Arrival {
                    from_m: has_places.then_some(from_m),
                    ..Arrival::new(0.1 / distance_m, distance_m / 343.0)
                }
            };
            let value: Vec<Arrival> = (0..outputs.len()).map(arrive).collect();
            let verb = match frame {
                0 => Verb::Start(Start::new("wood")),
                72 => Verb::End,
                _ => Verb::Key,
            };
            lines.push((time_s, 0, ChannelLine::Thread(Statement { thread, path: 0, time_s, verb, value })));
            let plays = stream.until(time_s.min(1.19), COURSE, &repertoire, None).expect("grains");
            cues.extend(plays.iter().map(|play| (play.time_s, score::Action::Grain(play.grain))));
        }
        let cues = cues.into_iter().map(|(time_s, action)| {
            (time_s, 1, ChannelLine::Cue(Cue { thread, time_s, action, cause: String::new() }))
        });
        lines.extend(cues);
    }
    lines.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.thread().cmp(&b.2.thread())).then(a.1.cmp(&b.1)));
    let lines: Vec<ChannelLine> = lines.into_iter().map(|(_, _, line)| line).collect();
    let header = Header::new(Order::Time, outputs);
    let channels = header.receivers.iter().map(|output| output.channels().len()).sum();
    let receivers = receivers::load(&header, Path::new(""), RATE_HZ).expect("receivers");
    let extent = Extent { rate_hz: RATE_HZ, from_s: 0.1, to_s: Some(1.1), duration_s: None };
    bencher.counter(ItemsCount::new(contacts)).with_inputs(|| lines.clone()).bench_local_values(|lines| {
        let sounds = [("wood".to_owned(), sound.clone())];
        let lines = lines.into_iter().map(Ok);
        let mut mixer = Mixer::new(RATE_HZ, receivers.clone(), sounds, lines).expect("a score");
        offline::render(&mut mixer, channels, &extent, false, |piece| {
            black_box(piece.mix);
            Ok(())
        })
        .expect("a second")
    });
}
