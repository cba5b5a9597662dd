//! Voices that pass long filters: whichever part of a soundtrack is asked for, in whatever blocks and on however
//! many cores, it has the same bits; and they are what convolution by definition gives.

mod data;
mod studio;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use data::data;
use froufrou::random::Random;
use froufrou::render::offline::{self, Extent};
use froufrou::score::{Action, Arrival, ChannelLine, Cue, Header, Order, Output, Start, Statement, Verb};
use froufrou::space::bands::{BandFilters, Bands};
use froufrou::space::head::Head;
use froufrou::synth::bus::{Bus, Feed};
use froufrou::synth::mixer::{Mixer, Sounding};
use froufrou::synth::receivers::{Receiver, load};
use froufrou::synth::turbulence::Turbulence;
use froufrou::synth::voice::Prototype;
use studio::noise;

const RATE_HZ: u32 = 48_000;

/// The measured head of the test data, or a small set of our own.
fn measured() -> PathBuf {
    let own = || Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/head/sphere.sofa");
    data("hrtf/MIT_KEMAR_normal_pinna.sofa").unwrap_or_else(own)
}

fn head(file: Option<PathBuf>) -> Receiver {
    let ears = ["left".to_owned(), "right".to_owned()];
    let head = file.map(|file| file.to_string_lossy().into_owned());
    let output = Output::Head { ears, head, shared: false };
    load(&Header::new(Order::Time, vec![output]), Path::new(""), RATE_HZ).unwrap().remove(0)
}

/// Two channels that mostly differ in gains alone, two heads, and a bus.
fn receivers() -> Vec<Receiver> {
    let bus = Bus::new(Feed::Even, &[vec![(0, noise(700, 8)), (1, noise(90, 9))]], 30).unwrap();
    vec![Receiver::Channel, Receiver::Channel, head(Some(measured())), head(None), Receiver::Bus(bus)]
}

fn start(sound: &str, thread: u64) -> Verb {
    Verb::Start(Start {
        offset_s: if sound == "wind" { 0.0 } else { thread as f64 * 0.013 },
        object: format!("object {}", thread % 2),
        ..Start::new(sound)
    })
}

/// Threads that come and go, jump and stand still, with keys now dense and now far between, some with the colours of
/// a room and one more path each.
fn lines() -> Vec<ChannelLine> {
    let random = Random::new(3, 1);
    let mut lines = Vec::new();
    for thread in 0..5u64 {
        let (mut time_s, sound) =
            (0.01 + 0.11 * thread as f64, ["noise", "hit", "wind"][thread as usize % 3]);
        for key in 0..14u64 {
            let chance = |n: u64| random.uniform(100 * (20 * thread + key) + n);
            for path in 0..2u32 {
                let phase = thread as f64 + time_s * (3.0 + f64::from(path));
                let far_m = 2.0 + f64::from(path) + 0.5 * phase.sin();
                let has_colours = chance(1) < 0.7;
                let value = (0..5).map(|output| {
                    let plain = Arrival::new(0.3 + 0.1 * (phase + f64::from(output)).sin(), far_m / 343.0);
                    let bands: Bands = std::array::from_fn(|band| (0.95 - 0.1 * chance(2)).powi(band as i32));
                    let is_head = (2..4).contains(&output);
                    Arrival {
                        from_m: is_head.then(|| [far_m * phase.sin(), 0.3, far_m * phase.cos()]),
                        bands: has_colours.then_some(bands),
                        ..plain
                    }
                });
                let verb = match (key, path) {
                    (0, 0) => start(sound, thread),
                    (0, _) => Verb::Path,
                    (13, _) => Verb::End,
                    (6, _) if thread % 2 == 0 => Verb::Jump,
                    _ => Verb::Key,
                };
                let value = value.collect();
                lines.push(ChannelLine::Thread(Statement { thread, path, time_s, verb, value }));
            }
            if sound == "wind" && key < 13 {
                let action = Action::Set(vec![("speed".to_owned(), 10.0 * chance(3))]);
                lines.push(ChannelLine::Cue(Cue { thread, time_s, action, cause: String::new() }));
            }
            time_s += if chance(4) < 0.6 { 1.0 / 60.0 } else { 0.2 * chance(5) + 0.001 };
        }
    }
    lines.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
    lines
}

type Lines = std::vec::IntoIter<froufrou::Result<ChannelLine>>;

fn mixer(receivers: Vec<Receiver>, lines: &[ChannelLine]) -> Mixer<Lines> {
    let prototype = |count, seed, looped| -> Sounding {
        Prototype { samples: noise(count, seed).into(), rate_hz: f64::from(RATE_HZ), looped }.into()
    };
    let sounds = [
        ("noise".to_owned(), prototype(7001, 1, true)),
        ("hit".to_owned(), prototype(9000, 2, false)),
        ("wind".to_owned(), Sounding::Instrument(Arc::new(Turbulence::new(&[]).unwrap()))),
    ];
    let lines: Vec<froufrou::Result<ChannelLine>> = lines.iter().cloned().map(Ok).collect();
    Mixer::new(RATE_HZ, receivers, sounds, lines.into_iter()).unwrap()
}

/// All frames of a mix and of each stem, interleaved.
fn render(lines: &[ChannelLine], range: Option<[u64; 2]>, cores: usize) -> Vec<Vec<f32>> {
    let receivers = receivers();
    let channels: usize = receivers.iter().map(Receiver::channels).sum();
    let mut mixer = mixer(receivers, lines);
    let [from, to] =
        range.map_or([None; 2], |range| range.map(|frame| Some(frame as f64 / f64::from(RATE_HZ))));
    let extent = Extent { rate_hz: RATE_HZ, from_s: from.unwrap_or(0.0), to_s: to, duration_s: None };
    let mut sound = vec![Vec::new(); 3];
    let pool = rayon::ThreadPoolBuilder::new().num_threads(cores).build().unwrap();
    pool.install(|| {
        offline::render(&mut mixer, channels, &extent, true, |piece| {
            sound[0].extend_from_slice(piece.mix);
            for (object, samples) in piece.stems {
                let stem: &mut Vec<f32> = &mut sound[1 + object];
                stem.resize(sound_length(piece.frames.start, from, channels), 0.0);
                stem.extend_from_slice(samples);
            }
            Ok(())
        })
    })
    .unwrap();
    let whole = sound[0].len();
    sound.iter_mut().for_each(|part| part.resize(whole, 0.0));
    sound
}

/// How many samples come before a frame.
fn sound_length(frame: u64, from_s: Option<f64>, channels: usize) -> usize {
    let from = (from_s.unwrap_or(0.0) * f64::from(RATE_HZ)).round() as u64;
    (frame - from) as usize * channels
}

#[test]
fn any_range_and_any_number_of_cores_give_the_same_bits() {
    let lines = lines();
    let whole = render(&lines, None, 1);
    let frames = whole[0].len() / 6;
    assert!(frames > 60_000 && whole.iter().all(|part| part.iter().any(|sample| *sample != 0.0)));
    assert!(whole == render(&lines, None, 4));
    let random = Random::new(9, 2);
    for trial in 0..12 {
        let from = (random.uniform(2 * trial) * frames as f64) as u64;
        let count = (20.0 * 1000f64.powf(random.uniform(2 * trial + 1))) as u64;
        let to = (from + count).min(frames as u64);
        let part = render(&lines, Some([from, to]), 1 + trial as usize % 3);
        for (part, whole) in part.iter().zip(&whole) {
            assert!(part[..] == whole[from as usize * 6..to as usize * 6], "{from} to {to}");
        }
    }
}

#[test]
fn blocks_of_any_length_in_any_order_give_the_same_bits() {
    let lines = lines();
    let receivers = receivers();
    let mut mixer = mixer(receivers, &lines);
    const FRAMES: usize = 12_000;
    mixer.read_to(FRAMES as u64).unwrap();
    let channels = 6;
    let whole = mixer.voices().render(0, FRAMES, false).mix;
    for length in [1999, 1024, 513, 7] {
        let mut starts: Vec<usize> = (0..FRAMES).step_by(length).collect();
        if length == 7 {
            starts.retain(|start| start % 602 == 0);
        }
        // From the end, and each twice.
        for start in starts.into_iter().rev() {
            let count = length.min(FRAMES - start);
            for _ in 0..2 {
                let block = mixer.voices().render(start as u64, count, false).mix;
                for channel in 0..channels {
                    let at = channel * FRAMES + start;
                    assert!(
                        block[channel * count..(channel + 1) * count] == whole[at..at + count],
                        "{length} {start} {channel}"
                    );
                }
            }
        }
    }
}

/// What `filters` at two times, between which they fade, make of a loop that arrives with a delay in whole frames.
fn faded(
    signal: &[f32],
    delay: usize,
    gain: f64,
    filters: [&[f32]; 2],
    lead: usize,
    frames: usize,
) -> Vec<f64> {
    let mut out = vec![0.0; frames];
    for n in 0..frames + lead {
        let along = n as f64 / frames as f64;
        let sample = gain * f64::from(signal[n % signal.len()]);
        for (filter, weight) in filters.iter().zip([1.0 - along, along]) {
            for (k, tap) in filter.iter().enumerate() {
                if let Some(out) = (n + delay + k).checked_sub(lead).and_then(|at| out.get_mut(at)) {
                    *out += sample * weight.max(0.0) * f64::from(*tap);
                }
            }
        }
    }
    out
}

fn through(output: Output, arrivals: [Arrival; 2], end_s: f64) -> Vec<Vec<f64>> {
    let receivers = load(&Header::new(Order::Time, vec![output]), Path::new(""), RATE_HZ).unwrap();
    let channels = receivers[0].channels();
    let [first, last] = arrivals.map(|arrival| vec![arrival]);
    let line =
        |time_s, verb, value| ChannelLine::Thread(Statement { thread: 0, path: 0, time_s, verb, value });
    let lines = [line(0.0, start("noise", 0), first), line(end_s, Verb::End, last)];
    let mut mixer = mixer(receivers, &lines);
    let frames = (end_s * f64::from(RATE_HZ)).round() as usize;
    mixer.read_to(frames as u64).unwrap();
    let mix = mixer.voices().render(0, frames, false).mix;
    (0..channels).map(|channel| mix[channel * frames..(channel + 1) * frames].to_vec()).collect()
}

/// How far below the root mean square of what was expected the error's is, from where the loop is in all taps.
fn error_db(found: &[f64], expected: &[f64], from: usize) -> f64 {
    let square = |samples: &mut dyn Iterator<Item = f64>| samples.map(|s| s * s).sum::<f64>();
    let error = square(&mut found.iter().zip(expected).skip(from).map(|(f, e)| f - e));
    let all = square(&mut expected[..found.len()].iter().skip(from).copied());
    10.0 * (error / all).log10()
}

#[test]
fn a_colour_that_changes_is_what_convolution_by_definition_gives() {
    let all: [Bands; 2] =
        [[1.0, 0.9, 0.8, 0.7, 0.5, 0.4, 0.3, 0.1], [0.3, 0.3, 0.5, 0.6, 0.8, 0.8, 0.9, 0.9]];
    let bands = BandFilters::new(f64::from(RATE_HZ)).unwrap();
    let taps = all.map(|gains| {
        let mut taps = vec![0.0; bands.taps()];
        bands.fill(&gains, &mut taps);
        taps
    });
    // Some pieces, and many.
    for frames in [5000, 12_000] {
        let delay = 480;
        let arrivals = all.map(|bands| Arrival { bands: Some(bands), ..Arrival::new(0.5, 0.01) });
        let end_s = frames as f64 / f64::from(RATE_HZ);
        let found = through(Output::Channel("one".into()), arrivals, end_s);
        // It fades over arrival time, which is that of emission and a delay that stays.
        let expected = faded(&noise(7001, 1), delay, 0.5, [&taps[0], &taps[1]], bands.centre(), frames);
        // A loop fades in at its beginning.
        let error_db = error_db(&found[0], &expected, 500 + delay + bands.taps());
        println!("{frames} frames: {error_db:.1} dB");
        assert!(error_db < -125.0, "{frames}: {error_db}");
    }
}

#[test]
fn a_head_at_rest_is_what_convolution_by_definition_gives() {
    let file = measured();
    let head = Head::open(&file, f64::from(RATE_HZ)).unwrap();
    let from_m = [1.2, 0.4, -0.7];
    let (mut left, mut right) = (vec![0.0; head.taps()], vec![0.0; head.taps()]);
    let heard = head.hear(from_m, [&mut left, &mut right]);
    let frames = 9000;
    // Delays that are whole frames at both ears: one after the other.
    for (ear, taps) in [(0, left), (1, right)] {
        let delay = 600;
        let delay_s = f64::from(delay) / f64::from(RATE_HZ) - heard[ear].delay_s;
        let arrival = Arrival { from_m: Some(from_m), ..Arrival::new(0.5, delay_s) };
        let ears = ["left".to_owned(), "right".to_owned()];
        let output = Output::Head { ears, head: Some(file.to_string_lossy().into_owned()), shared: false };
        let found = through(output, [arrival; 2], frames as f64 / f64::from(RATE_HZ));
        let gain = 0.5 * heard[ear].gain;
        let expected = faded(&noise(7001, 1), delay as usize, gain, [&taps, &taps], head.lead(), frames);
        let error_db = error_db(&found[ear], &expected, 500 + delay as usize + taps.len());
        println!("ear {ear}, {} taps: {error_db:.1} dB", taps.len());
        assert!(error_db < -125.0, "{ear}: {error_db}");
    }
}
