//! What mixing costs: moving stereo voices at 48 kHz on one core, and how that grows.
//!
//! ```text
//! cargo bench -p froufrou --bench mixing
//! ```
//!
//! Each row renders one second of sound. `items/s` counts voice-seconds: with 256 voices, more than
//! 256 of them a second is faster than real time. `copy` is the floor: the same voices read by
//! linear interpolation along the same paths, with no filter.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use froufrou::score::{Arrival, ChannelLine, Start, Statement, Verb};
use froufrou::synth::mixer::Mixer;
use froufrou::synth::path::{Fades, Segment, UNFILTERED, UNSPREAD};
use froufrou::synth::receivers::Receiver;
use froufrou::synth::voice::{Playback, Prototype, add_segment};
use rubato::audioadapter_buffers::direct::InterleavedSlice;
use rubato::{
    Async, FixedAsync, Resampler, SincInterpolationParameters, SincInterpolationType, WindowFunction,
};

fn main() {
    divan::main();
}

const RATE_HZ: u32 = 48_000;

fn noise() -> Prototype {
    let random = froufrou::random::Random::new(1, 0);
    let samples = (0..96_000).map(|i| (random.uniform(i) * 2.0 - 1.0) as f32).collect();
    Prototype { samples, rate_hz: f64::from(RATE_HZ), looped: true }
}

/// Threads that swing to and fro, a quarter of them always approaching, in two channels, with a key
/// every 60th of a second.
fn lines(voices: u64, still: bool) -> Vec<froufrou::Result<ChannelLine>> {
    let mut lines = Vec::new();
    for frame in 0..=72u64 {
        for thread in 0..voices {
            let time_s = frame as f64 / 60.0;
            let phase = thread as f64 * 0.37 + if still { 0.0 } else { time_s * (2.0 + (thread % 7) as f64) };
            let ear = |side: f64| Arrival::new(0.3, 0.05 + 0.01 * (phase + side).sin());
            let verb = match frame {
                0 => Verb::Start(Start { offset_s: thread as f64 * 0.01, ..Start::new("noise") }),
                72 => Verb::End,
                _ => Verb::Key,
            };
            let value = vec![ear(0.0), ear(0.2)];
            lines.push(Ok(ChannelLine::Thread(Statement { thread, path: 0, time_s, verb, value })));
        }
    }
    lines
}

fn render(bencher: Bencher, voices: u64, still: bool) {
    let lines = lines(voices, still);
    let lines = || lines.iter().map(|l| Ok(l.as_ref().unwrap().clone())).collect::<Vec<_>>();
    bencher.counter(ItemsCount::new(voices)).bench(|| {
        let mut mixer = Mixer::new(
            RATE_HZ,
            Receiver::plain(2),
            [("noise".to_string(), noise().into())],
            lines().into_iter(),
        )
        .expect("a score");
        mixer.read_to(52_800).expect("lines");
        for block in 0..47 {
            black_box(mixer.voices().render(4_000 + block * 1024, 1024, false));
        }
    });
}

#[divan::bench(args = [16, 64, 256], sample_count = 5)]
fn moving_stereo_voices(bencher: Bencher, voices: u64) {
    render(bencher, voices, false);
}

#[divan::bench(args = [256], sample_count = 5)]
fn still_stereo_voices(bencher: Bencher, voices: u64) {
    render(bencher, voices, true);
}

/// One second of one mono voice: reading alone, at a steady ratio.
#[divan::bench(args = [0.9, 1.0, 1.03, 2.0], sample_count = 20)]
fn reading(bencher: Bencher, ratio: f64) {
    let prototype = noise();
    let segment = Segment {
        begin_s: 0.0,
        end_s: 1.0,
        delay_s: [0.0, 1.0 - ratio],
        slope: [1.0 - ratio; 2],
        gain: [1.0; 2],
        filter: [UNFILTERED; 2],
        spread: [UNSPREAD; 2],
        fades: Fades::NONE,
    };
    let playback = Playback { start_s: -0.01, speed: 1.0, offset_s: 0.0 };
    let (mut block, mut window) = (vec![0.0; 48_000], Vec::new());
    bencher.counter(ItemsCount::new(48_000u64)).bench_local(|| {
        add_segment(prototype.signal(), &playback, &segment, f64::from(RATE_HZ), 0, &mut block, &mut window)
    });
}

/// The same by rubato's sinc resampler, with as many taps, as many tabulated phases and the same cubic
/// interpolation between them. It reads at one steady ratio; ours may change with every sample.
#[divan::bench(args = [0.9, 1.03, 2.0], sample_count = 20)]
fn reading_by_rubato(bencher: Bencher, ratio: f64) {
    let prototype = noise();
    let parameters = SincInterpolationParameters {
        sinc_len: (80.0 * ratio.max(1.0)) as usize,
        f_cutoff: None,
        oversampling_factor: 32,
        interpolation: SincInterpolationType::Cubic,
        window: WindowFunction::BlackmanHarris2,
    };
    let frames = 1024;
    let mut resampler = Async::<f32>::new_sinc(1.0 / ratio, 1.1, &parameters, frames, 1, FixedAsync::Output)
        .expect("a resampler");
    let mut output = vec![0.0f32; frames];
    bencher.counter(ItemsCount::new(48_000u64)).bench_local(|| {
        let (mut read, mut made) = (0, 0);
        while made < 48_000 {
            let needed = resampler.input_frames_next();
            // The noise is two seconds long; begin again where it would run out.
            read = if read + needed > prototype.samples.len() { 0 } else { read };
            let input = &prototype.samples[read..read + needed];
            let input = InterleavedSlice::new(input, 1, needed).expect("frames");
            let mut output = InterleavedSlice::new_mut(&mut output, 1, frames).expect("frames");
            let (used, given) = resampler.process_into_buffer(&input, &mut output, None).expect("frames");
            read += used;
            made += given;
        }
        black_box(&output);
    });
}

/// The floor for 256 moving stereo voices: their paths evaluated, two samples blended.
#[divan::bench(sample_count = 5)]
fn copy(bencher: Bencher) {
    let prototype = noise();
    let segment = Segment {
        begin_s: 0.0,
        end_s: 1.0 / 60.0,
        delay_s: [0.05, 0.0501],
        slope: [0.003, 0.004],
        gain: [0.3, 0.4],
        filter: [UNFILTERED; 2],
        spread: [UNSPREAD; 2],
        fades: Fades::NONE,
    };
    bencher.counter(ItemsCount::new(256u64)).bench(|| {
        let mut sum = 0.0;
        for _ in 0..512 {
            for n in 0..48_000u32 {
                let moment = segment.at(f64::from(n % 800) / 48_000.0);
                let position = (1.0 + f64::from(n) / 48_000.0 - moment.delay_s) * 48_000.0;
                let (index, fraction) = (position as usize, position.fract() as f32);
                let (a, b) = (prototype.samples[index], prototype.samples[index + 1]);
                sum += f64::from(a + fraction * (b - a)) * moment.gain;
            }
        }
        sum
    });
}
