//! How many lines of a score are read and written in a second, beside what the numbers in them cost
//! alone.
//!
//! Run with `cargo bench -p froufrou --bench score`.

use std::hint::black_box;

use divan::Bencher;
use divan::counter::{BytesCount, ItemsCount};
use froufrou::score::{
    Arrival, ChannelDocument, ChannelLine, ChannelSpace, Document, Header, Microphone, MicrophoneKey,
    MicrophoneShape, ObjectLine, ObjectSpace, Order, Output, Pickup, Placement, Pose, Reader, Repeat, Sound,
    Space, Start, Statement, Verb, Writer,
};

/// Threads that sound at once, with a key each at every frame of an animation.
const THREADS: u64 = 100;
const FRAMES: u32 = 200;

fn main() {
    divan::main();
}

fn header<R>(receivers: Vec<R>) -> Header<R> {
    let sounds = vec![Sound::recording("siren", "siren.wav", Repeat::Loop, None)];
    Header { sounds, ..Header::new(Order::Time, receivers) }
}

/// What a thread does at a frame.
fn statement<V>(thread: u64, frame: u32, value: V) -> Statement<V> {
    let start =
        Start { object: "ambulance".into(), cause: "runs through the scene".into(), ..Start::new("siren") };
    let verb = match frame {
        0 => Verb::Start(start),
        frame if frame == FRAMES - 1 => Verb::End,
        _ => Verb::Key,
    };
    Statement { thread, path: 0, time_s: f64::from(frame) / 30.0, verb, value }
}

/// A number with all its digits, as a simulation gives it.
fn number(thread: u64, frame: u32) -> f64 {
    (thread as f64 * 1.7 + f64::from(frame) * 0.13).sin().abs()
}

fn channel_score() -> ChannelDocument {
    let lines = (0..FRAMES).flat_map(|frame| {
        (0..THREADS).map(move |thread| {
            let gain = number(thread, frame);
            ChannelLine::Thread(statement(thread, frame, vec![Arrival::new(gain, gain / 7.0); 2]))
        })
    });
    Document::new(header(["left", "right"].map(|name| Output::Channel(name.into())).to_vec()), lines)
}

fn object_score() -> Document<ObjectSpace> {
    let shape = MicrophoneShape { c: 0.0, k: 1.0 };
    let ear = MicrophoneKey {
        microphone: 0,
        time_s: 0.0,
        pose: Pose::upright([0.0, 1.6, 0.0], [0.0, 0.0, -1.0]),
        cut: false,
    };
    let threads = (0..FRAMES).flat_map(|frame| {
        (0..THREADS).map(move |thread| {
            let x = number(thread, frame);
            ObjectLine::Thread(statement(thread, frame, Placement::at([x, x / 3.0, x / 7.0], x / 11.0)))
        })
    });
    let lines = std::iter::once(ObjectLine::Microphone(ear)).chain(threads);
    Document::new(
        header(vec![Microphone { name: "main".into(), pickup: Pickup::Shape(shape), fixed: None }]),
        lines,
    )
}

trait Example: Space {
    fn score() -> Document<Self>;
}

impl Example for ObjectSpace {
    fn score() -> Document<Self> {
        object_score()
    }
}

impl Example for ChannelSpace {
    fn score() -> Document<Self> {
        channel_score()
    }
}

#[divan::bench(types = [ObjectSpace, ChannelSpace])]
fn read<S: Example>(bencher: Bencher<'_, '_>) {
    let text = S::score().to_text().expect("the example keeps the rules");
    bencher.counter(ItemsCount::new(text.lines().count())).counter(BytesCount::new(text.len())).bench(|| {
        let reader = Reader::<S, _>::new(black_box(text.as_bytes())).expect("it was written so");
        reader.filter(|line| black_box(line).is_ok()).count()
    });
}

/// The floor under reading: the same words split and their numbers read, nothing kept or checked.
#[divan::bench(types = [ObjectSpace, ChannelSpace])]
fn read_numbers_alone<S: Example>(bencher: Bencher<'_, '_>) {
    let text = S::score().to_text().expect("the example keeps the rules");
    bencher.counter(ItemsCount::new(text.lines().count())).counter(BytesCount::new(text.len())).bench(|| {
        let words = black_box(&text).lines().flat_map(str::split_whitespace);
        words.filter_map(|word| word.parse::<f64>().ok()).sum::<f64>()
    });
}

#[divan::bench(types = [ObjectSpace, ChannelSpace])]
fn write<S: Example>(bencher: Bencher<'_, '_>) {
    let score = S::score();
    let length = score.to_text().expect("the example keeps the rules").len();
    bencher.counter(ItemsCount::new(score.lines.len())).counter(BytesCount::new(length)).bench(|| {
        let sink = Vec::with_capacity(length);
        let mut writer = Writer::<S, _>::new(sink, &score.header).expect("the header is fine");
        for noted in &score.lines {
            writer.write(black_box(&noted.line)).expect("the line is fine");
        }
        writer.finish().expect("the score is fine")
    });
}
