//! Numbers that are too small to be heard, and slow to count with, are not counted with.

use std::num::FpCategory;
use std::sync::Arc;

use froufrou::score::{Arrival, ChannelLine, Header, Order, Output, Start, Statement, Verb};
use froufrou::synth::mixer::{Cutter, Desk, Mixer, Slice};
use froufrou::synth::receivers;
use froufrou::synth::voice::Prototype;

const RATE_HZ: u32 = 48_000;

/// A decay into nothing, silence, and noise of numbers of every size.
fn sounds() -> [(&'static str, Vec<f32>); 3] {
    let random = froufrou::random::Random::new(3, 1);
    let sign = |n: u32| if n.is_multiple_of(2) { 1.0 } else { -1.0 };
    let decay = (0..9_600u32).map(|n| sign(n) * 0.98f32.powi(n as i32)).collect();
    let subnormal = (0..9_600u32).map(|n| sign(n) * f32::from_bits(1 + n)).collect();
    let all = (0..9_600u32).map(|n| sign(n) * 10f64.powf(-45.0 * random.uniform(u64::from(n))) as f32);
    [("decay", decay), ("subnormal", subnormal), ("all", all.collect())]
}

fn is_subnormal(sample: &f32) -> bool {
    sample.classify() == FpCategory::Subnormal
}

/// Voices whose gains go to nearly nothing, in several steps.
fn lines(has_places: bool) -> Vec<froufrou::Result<ChannelLine>> {
    let mut lines = Vec::new();
    for key in 0..=20u32 {
        for thread in 0..6u64 {
            let time_s = f64::from(key) * 0.01;
            let verb = match key {
                0 => Verb::Start(Start::new(sounds()[(thread % 3) as usize].0)),
                20 => Verb::End,
                _ => Verb::Key,
            };
            let gain = if thread < 3 { 0.5 } else { 10f64.powi(-3 * key as i32) };
            let from_m = [f64::from(key) * 0.1 - 1.0, 1e-30, -1e-12];
            let arrival = Arrival::new(gain, 0.01 + 1e-4 * time_s);
            let value = vec![Arrival { from_m: has_places.then_some(from_m), ..arrival }];
            lines.push(Ok(ChannelLine::Thread(Statement { thread, path: 0, time_s, verb, value })));
        }
    }
    lines
}

#[test]
fn nothing_subnormal_leaves_the_desk() {
    assert!(sounds().iter().all(|(_, samples)| samples.iter().filter(|s| is_subnormal(s)).count() > 100));
    let head = Output::Head { ears: ["left".to_owned(), "right".to_owned()], head: None, shared: true };
    for output in [head, Output::Channel("microphone".to_owned())] {
        let has_places = matches!(output, Output::Head { .. });
        let header = Header::new(Order::Time, vec![output]);
        let receivers = receivers::load(&header, std::path::Path::new(""), RATE_HZ).unwrap();
        let sound = |(name, samples): (&str, Vec<f32>)| {
            let samples = Arc::from(samples);
            (name.to_owned(), Prototype { samples, rate_hz: 44_100.0, looped: false }.into())
        };
        let lines = lines(has_places).into_iter();
        let mut mixer = Mixer::new(RATE_HZ, receivers, sounds().map(sound), lines).unwrap();
        let mut desk = Desk::new(mixer.voices(), 128);
        let (mut cutter, mut slice) = (Cutter::new(mixer.voices(), 0), Slice::default());
        let (mut subnormal, mut other) = (0, 0);
        for end in (128..=9_600u64).step_by(128) {
            mixer.read_to(end).unwrap();
            cutter.cut(mixer.voices(), end, &mut slice);
            let mut channels = vec![0.0f64; 128 * mixer.voices().channels()];
            desk.add(&slice, slice.frames(), &mut channels, (128, 0));
            assert!(channels.iter().all(|sample| sample.classify() != FpCategory::Subnormal));
            other += channels.iter().filter(|sample| **sample != 0.0).count();
            for (number, bus) in mixer.voices().buses().enumerate() {
                let (lead, mut lanes) = (bus.lead() as u64, vec![0.0; 128 * bus.lanes()]);
                let frames = slice.frames().start + lead..slice.frames().end + lead;
                desk.add_lanes(&slice, number, frames, &mut lanes, (128, 0));
                subnormal += lanes.iter().filter(|sample| is_subnormal(sample)).count();
                other += lanes.iter().filter(|sample| **sample != 0.0).count();
            }
            mixer.release(end);
        }
        assert!(subnormal == 0 && other > 1000, "{subnormal} subnormal numbers beside {other} others");
    }
}
