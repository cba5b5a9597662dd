//! Buses from threads to samples: what comes out is the convolution of what went in, whichever part of it is
//! asked for and on however many cores it is made.

mod studio;

use std::collections::BTreeMap;

use froufrou::Result;
use froufrou::render::offline::{self, Extent};
use froufrou::score::{Arrival, ChannelLine, Start, Statement, Verb};
use froufrou::synth::bus::{Bus, FIELD_LANES, Feed, LaneBlock, Ringing};
use froufrou::synth::mixer::Mixer;
use froufrou::synth::receivers::Receiver;
use froufrou::synth::voice::Prototype;
use studio::noise;

const RATE_HZ: u32 = 8000;

/// Threads of three objects that come and go and move, with so many outputs; each stands still at times.
fn lines(outputs: usize) -> Vec<ChannelLine> {
    let mut lines = Vec::new();
    for thread in 0..7u64 {
        let start_s = 0.013 + 0.31 * thread as f64;
        for key in 0..=20u64 {
            let time_s = start_s + key as f64 * 0.05;
            let phase = thread as f64 + key.min(12) as f64 * 0.4;
            let arrival = |output: usize| {
                let gain = 0.2 + 0.1 * (phase + output as f64).sin();
                Arrival::new(gain, 0.05 + 0.01 * (phase + 0.2 * output as f64).sin())
            };
            let verb = match key {
                0 => Verb::Start(Start {
                    offset_s: thread as f64 * 0.01,
                    object: format!("object {}", thread % 3),
                    ..Start::new("noise")
                }),
                10 if thread == 2 => Verb::Jump,
                20 => Verb::End,
                _ => Verb::Key,
            };
            let value = (0..outputs).map(arrival).collect();
            lines.push(ChannelLine::Thread(Statement { thread, path: 0, time_s, verb, value }));
        }
    }
    lines.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
    lines
}

/// All channels of a mix, each apart, and those of each object.
struct Sound {
    mix: Vec<Vec<f32>>,
    stems: BTreeMap<usize, Vec<Vec<f32>>>,
}

fn render(receivers: Vec<Receiver>, lines: &[ChannelLine], range: [Option<f64>; 2], cores: usize) -> Sound {
    let channels = receivers.iter().map(Receiver::channels).sum();
    let signal = Prototype { samples: noise(6000, 4).into(), rate_hz: f64::from(RATE_HZ), looped: true };
    let lines = lines.iter().cloned().map(Ok);
    let mut mixer = Mixer::new(RATE_HZ, receivers, [("noise".to_owned(), signal.into())], lines).unwrap();
    let extent =
        Extent { rate_hz: RATE_HZ, from_s: range[0].unwrap_or(0.0), to_s: range[1], duration_s: None };
    let mut sound = Sound { mix: vec![Vec::new(); channels], stems: BTreeMap::new() };
    let append = |to: &mut [Vec<f32>], from: &[f32]| {
        for (channel, to) in to.iter_mut().enumerate() {
            to.extend(from.iter().skip(channel).step_by(channels));
        }
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(cores).build().unwrap();
    pool.install(|| {
        offline::render(&mut mixer, channels, &extent, true, |piece| {
            let before = sound.mix[0].len();
            append(&mut sound.mix, piece.mix);
            for (object, samples) in piece.stems {
                let stem = sound.stems.entry(*object).or_insert_with(|| vec![vec![0.0; before]; channels]);
                append(stem, samples);
            }
            let frames = sound.mix[0].len();
            sound.stems.values_mut().flatten().for_each(|stem| stem.resize(frames, 0.0));
            Ok(())
        })
    })
    .unwrap();
    sound
}

/// A response of so many taps that fades.
fn response(seed: u64, taps: usize) -> Vec<f32> {
    let fade = |n: usize| (-5.0 * n as f32 / taps as f32).exp() / (taps as f32).sqrt();
    noise(taps, seed).into_iter().enumerate().map(|(n, tap)| tap * fade(n)).collect()
}

const LEAD: usize = 300;

/// A channel, a bus into both channels, a channel, and a bus of two lanes into the first.
fn outputs() -> Vec<Receiver> {
    let bus =
        |lanes: &[Vec<(usize, Vec<f32>)>], lead| Receiver::Bus(Bus::new(Feed::Even, lanes, lead).unwrap());
    vec![
        Receiver::Channel,
        bus(&[vec![(0, response(1, 20_000)), (1, response(2, 700))]], LEAD),
        Receiver::Channel,
        bus(&[vec![(0, response(3, 90))], vec![(0, response(4, 1200))]], 0),
    ]
}

fn convolved(input: &[f32], response: &[f32], lead: usize, frame: usize) -> f64 {
    let taps = response.iter().enumerate().filter_map(|(tap, h)| {
        let at = (frame + lead).checked_sub(tap)?;
        Some(f64::from(*h) * f64::from(*input.get(at)?))
    });
    taps.sum()
}

#[test]
fn what_comes_out_is_what_went_in_convolved() {
    let lines = lines(4);
    let sound = render(outputs(), &lines, [None; 2], 2);
    let plain = render(Receiver::plain(4), &lines, [None; 2], 2);
    // It rings out: the last arrives before 2.94 s and the response is 2.4625 s behind its time.
    let (frames, arrived) = (sound.mix[0].len(), plain.mix[0].len());
    assert!((19_600..=19_800).contains(&(frames - arrived)), "{frames} {arrived}");
    let last: f32 = sound.mix[0][frames - 500..].iter().fold(0.0, |m, s| m.max(s.abs()));
    assert!(last > 0.0);
    for frame in (0..frames).step_by(37) {
        let direct = |channel: usize| f64::from(plain.mix[channel].get(frame).copied().unwrap_or(0.0));
        let first = direct(0)
            + convolved(&plain.mix[1], &response(1, 20_000), LEAD, frame)
            + convolved(&plain.mix[3], &response(3, 90), 0, frame)
            + convolved(&plain.mix[3], &response(4, 1200), 0, frame);
        let second = direct(2) + convolved(&plain.mix[1], &response(2, 700), LEAD, frame);
        for (channel, expected) in [first, second].into_iter().enumerate() {
            let found = f64::from(sound.mix[channel][frame]);
            assert!((found - expected).abs() < 1e-6, "{frame} {channel}: {found} {expected}");
        }
    }
}

#[test]
fn any_range_and_any_number_of_cores_give_the_same_bits() {
    let lines = lines(4);
    let whole = render(outputs(), &lines, [None; 2], 1);
    let again = render(outputs(), &lines, [None; 2], 4);
    assert_eq!(whole.mix, again.mix);
    assert_eq!(whole.stems, again.stems);
    // Within the first part, across the grid, with threads before, and where nothing but tails are left.
    for (from, to) in [(0, 100), (1, 9000), (8000, 8003), (16_380, 25_000), (30_000, 33_000), (0, 40_000)] {
        let at = |frame: i32| Some(f64::from(frame) / f64::from(RATE_HZ));
        let part = render(outputs(), &lines, [at(from), at(to)], 3);
        for (channel, part) in part.mix.iter().enumerate() {
            let range = from as usize..(to as usize);
            assert_eq!(part.len(), range.len());
            assert_eq!(part[..], whole.mix[channel][range.clone()], "{from} to {to}");
        }
        for (object, part) in &part.stems {
            // Objects are numbered as they begin, and all have begun in a score that is read from its start.
            for (channel, part) in part.iter().enumerate() {
                assert_eq!(
                    part[..],
                    whole.stems[object][channel][from as usize..to as usize],
                    "{from} to {to}"
                );
            }
        }
    }
}

#[test]
fn stems_sum_to_the_mix() {
    let sound = render(outputs(), &lines(4), [None; 2], 2);
    assert_eq!(sound.stems.len(), 3);
    for (channel, mix) in sound.mix.iter().enumerate() {
        for (frame, mix) in mix.iter().enumerate() {
            let sum: f64 = sound.stems.values().map(|stem| f64::from(stem[channel][frame])).sum();
            assert!((sum - f64::from(*mix)).abs() < 1e-6, "{channel} {frame}: {sum} {mix}");
        }
    }
    // And each is that of its threads alone.
    let own = |line: &ChannelLine| line.thread() % 3 == 1;
    let alone: Vec<ChannelLine> = lines(4).into_iter().filter(own).collect();
    let alone = render(outputs(), &alone, [None; 2], 2);
    for (channel, stem) in sound.stems[&1].iter().enumerate() {
        assert!(alone.mix[channel][..] == stem[..alone.mix[channel].len()]);
        assert!(stem[alone.mix[channel].len()..].iter().all(|sample| sample.abs() < 1e-7));
    }
}

#[test]
fn a_bus_that_nothing_arrives_at_is_silent_and_changes_nothing() {
    let mut lines = lines(2);
    for line in &mut lines {
        if let ChannelLine::Thread(statement) = line {
            statement.value[1].gain = 0.0;
        }
    }
    let bus = Bus::new(Feed::Even, &[vec![(0, response(1, 9000))]], 50).unwrap();
    let sound = render(vec![Receiver::Channel, Receiver::Bus(bus)], &lines, [None; 2], 2);
    let plain = render(Receiver::plain(2), &lines, [None; 2], 2);
    assert_eq!(sound.mix[0].len(), plain.mix[0].len());
    assert_eq!(sound.mix[0], plain.mix[0]);
}

#[test]
fn blocks_of_a_live_listener_are_those_of_the_whole() {
    let mut state = noise(64 * 480, 8);
    state[64 * 200..64 * 400].fill(0.0);
    let lanes: Vec<_> = (0..20).map(|n| vec![(n % 2, response(n as u64, 150 + 40 * n))]).collect();
    let bus = Bus::new(Feed::Even, &lanes, 0).unwrap();
    let run = |frames: usize| {
        let mut ringing = Ringing::new(&bus, 0);
        let mut heard = [Vec::new(), Vec::new()];
        let input = &state[..20 * 960];
        for begin in (0..960).step_by(frames) {
            let length = frames.min(960 - begin);
            // Banks of 16 and 4 lanes.
            let mut block = vec![0.0; 20 * length];
            for frame in 0..length {
                for lane in 0..20 {
                    let at = if lane < 16 { frame * 16 + lane } else { 16 * length + frame * 4 + lane - 16 };
                    block[at] = input[(begin + frame) * 20 + lane];
                }
            }
            let mut out = vec![0.0; 2 * length];
            ringing.process(&block, length, &mut out).unwrap();
            heard.iter_mut().zip(out.chunks(length)).for_each(|(heard, out)| heard.extend_from_slice(out));
        }
        assert_eq!(ringing.frame(), 960);
        (heard, input.to_vec())
    };
    let (whole, input) = run(960);
    for frames in [1, 64, 100, 128, 441] {
        assert_eq!(run(frames).0, whole);
    }
    for (channel, heard) in whole.iter().enumerate() {
        for frame in (0..960).step_by(11) {
            let lane = |lane: usize| input.iter().skip(lane).step_by(20).copied().collect::<Vec<f32>>();
            let sum = |n: usize| convolved(&lane(n), &lanes[n][0].1, 0, frame);
            let expected: f64 = (0..20).filter(|n| n % 2 == channel).map(sum).sum();
            assert!((heard[frame] - expected).abs() < 2e-6, "{frame}: {} {expected}", heard[frame]);
        }
    }
    let mut ringing = Ringing::new(&bus, 0);
    assert!(ringing.process(&[], 10, &mut [0.0; 10]).is_ok(), "silence needs no room");
    assert!(ringing.process(&[1.0; 200], 10, &mut [0.0; 10]).is_err(), "no second channel");
    assert!(!LaneBlock::default().stems.contains_key(&0));
}

#[test]
fn what_is_no_bus_is_refused() -> Result<()> {
    let lane = || vec![(0, vec![1.0])];
    for (feed, lanes) in
        [(Feed::Even, vec![]), (Feed::Even, vec![lane(); 65]), (Feed::Field, vec![lane(); 16])]
    {
        assert!(Bus::new(feed, &lanes, 0).is_err());
    }
    assert!(Bus::new(Feed::Even, &[vec![(0, vec![f32::NAN])]], 0).is_err());
    let bus = Bus::new(Feed::Field, &vec![vec![(4, vec![1.0])]; FIELD_LANES], 0)?;
    let mixer = Mixer::new(8000, vec![Receiver::Channel, Receiver::Bus(bus)], [], std::iter::empty());
    assert_eq!(mixer.err().unwrap().to_string(), "a bus plays into channel 5; there are 1");
    Ok(())
}
