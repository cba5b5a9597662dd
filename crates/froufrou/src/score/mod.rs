//! The score: what sounds when, where and how loud. It is the hinge of the pipeline: every analyser
//! ends in one, every synthesiser starts from one, and a person can read, edit and mix it again.
//!
//! A score is a header and a list of lines. It comes in two spaces that share all but the value of
//! their keys: in *object space* a key places a thread on a point in the world, in *channel space*
//! (the sound script of Takala & Hahn 1992, §6.1) it gives the gain and delay of the thread in every
//! channel.
//!
//! A *thread* is one sounding instance: it starts, has keys and ends. All times of a thread are in
//! the time of its source (when the sound leaves, not when it arrives), in seconds. A thread without
//! an `end` goes on as at its last line until its recording is over or, where that loops, until the
//! score's duration.
//!
//! A score is also a text, described in `docs/score.md`, which says exactly what is in memory: a
//! [`Reader`] takes it in line by line, a [`Writer`] puts it out line by line, and a [`Document`]
//! holds it whole with its comments.

mod any;
mod document;
mod lexer;
mod note;
mod quantity;
mod read;
mod rules;
mod sort;
mod space;
mod syntax;
mod write;

pub use any::{AnyDocument, AnyReader, AnySpace};
pub use document::{ChannelDocument, Document, ObjectDocument};
pub use lexer::MAX_LINE_BYTES;
pub use note::{Note, Noted};
pub use read::{ChannelReader, ObjectReader, Reader};
pub use sort::{ByTime, compare};
pub use space::{ChannelSpace, ObjectSpace, Space};
pub use syntax::VERSION;
pub use write::{ChannelWriter, ObjectWriter, Writer};

pub mod compose;
pub mod ending;

/// The latest time, in seconds, that is mixed: some thirty years. A double still tells samples apart
/// there.
pub const LATEST_S: f64 = 1e9;

/// The longest time, in seconds, that a sound may be under way. Who mixes has to hold what is under
/// way in memory; and what comes from more than an hour away is 120 dB fainter than 1 m away.
pub const LONGEST_DELAY_S: f64 = 3600.0;

/// What a thread plays.
#[derive(Debug, Clone, PartialEq)]
pub struct Sound {
    /// The name that `start` lines use.
    pub name: String,
    /// The recording's path, relative to the folder of the score, with `/` between parts.
    pub recording: String,
    /// How it repeats.
    pub repeat: Repeat,
    /// The channel of the recording that is played, from 0; all of them averaged where `None`.
    pub channel: Option<usize>,
}

/// How a recording goes on at its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Repeat {
    /// It plays once.
    Once,
    /// It is made into a seamless loop: its end is cross-faded into its beginning.
    Loop,
    /// It is a loop already, from its first to its last sample.
    ExactLoop,
}

/// What all lines of a score rest on.
#[derive(Debug, Clone, PartialEq)]
pub struct Header<R> {
    /// Speed of sound in metres a second.
    pub speed_of_sound_mps: f64,
    /// Length of the soundtrack in seconds; `None`: until the last thread has ended and arrived.
    pub duration_s: Option<f64>,
    /// How the lines are sorted.
    pub order: Order,
    /// What the threads play.
    pub sounds: Vec<Sound>,
    /// Who receives: microphones in object space, channel names in channel space; one output
    /// channel each, in order.
    pub receivers: Vec<R>,
}

/// How the lines of a score are sorted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// By time, then thread: a score of any length can be mixed as it is read.
    Time,
    /// By thread, then time: easier to read and edit.
    Thread,
    /// As a person wrote it.
    Free,
}

/// The directivity of a microphone, `s(μ) = c + ((1 + cos μ) / 2)^k`, scaled to 1 at μ = 0, where μ
/// is the angle between the facing direction and the direction to the source (Takala & Hahn 1992,
/// §5.3). `k = 0` hears all around, `c = 0, k = 1` is a cardioid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MicrophoneShape {
    /// The part heard from everywhere, 0 or above.
    pub c: f64,
    /// The sharpness of the lobe, 0 or above.
    pub k: f64,
}

/// A microphone of an object-space score. It stands where the header places it, or else moves as its
/// `hear` lines say.
#[derive(Debug, Clone, PartialEq)]
pub struct Microphone {
    /// The name that `hear` lines use and that the output channel bears.
    pub name: String,
    /// What it hears from which side.
    pub shape: MicrophoneShape,
    /// Where it stands, if it never moves.
    pub fixed: Option<Pose>,
}

/// Where a microphone is and which way it faces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// World position in metres.
    pub position_m: [f64; 3],
    /// The direction it faces: a vector of any length above zero, kept as it was given, so that the
    /// text of a score says exactly what is in memory. Who computes with it normalises it.
    pub facing: [f64; 3],
}

/// The value of a key in object space: where the source is and how loud it is 1 m away.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// World position in metres.
    pub position_m: [f64; 3],
    /// Pressure gain at a distance of 1 m, 0 or above.
    pub gain: f64,
}

/// The value of a key in channel space, for one channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arrival {
    /// Pressure gain, 0 or above.
    pub gain: f64,
    /// Seconds from leaving the source to arriving, 0 or above.
    pub delay_s: f64,
}

/// What starts with a thread.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    /// The name of a [`Sound`] of the header.
    pub sound: String,
    /// Playback speed: 2 is an octave up in half the time.
    pub speed: f64,
    /// Seconds into the recording at which playing begins.
    pub offset_s: f64,
    /// The object it belongs to: threads of one object share a stem. Empty: none.
    pub object: String,
    /// Why it sounds, in a few words for the log. Empty: not said.
    pub cause: String,
}

/// What a line does with its thread.
#[derive(Debug, Clone, PartialEq)]
pub enum Verb {
    /// The thread begins.
    Start(Start),
    /// It passes through a value.
    Key,
    /// It is suddenly elsewhere: what led here fades out while what follows fades in.
    Jump,
    /// It ends.
    End,
}

/// One line of a thread.
#[derive(Debug, Clone, PartialEq)]
pub struct Statement<V> {
    /// The thread's number.
    pub thread: u64,
    /// When, in seconds of the source's time.
    pub time_s: f64,
    /// What it does.
    pub verb: Verb,
    /// Where or how loud.
    pub value: V,
}

/// Where a microphone is at a time: a `hear` line, or a `cut` line where it jumps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MicrophoneKey {
    /// Index into the header's receivers.
    pub microphone: usize,
    /// When, in seconds.
    pub time_s: f64,
    /// Where it is.
    pub pose: Pose,
    /// True where the microphone is suddenly here (a camera cut).
    pub cut: bool,
}

/// A line of a score in object space.
#[derive(Debug, Clone, PartialEq)]
pub enum ObjectLine {
    /// A line of a sounding thread.
    Thread(Statement<Placement>),
    /// A line of a microphone.
    Microphone(MicrophoneKey),
}

/// A line of a score in channel space: one [`Arrival`] for every channel.
pub type ChannelLine = Statement<Vec<Arrival>>;

/// The header of a score in object space.
pub type ObjectHeader = Header<Microphone>;

/// The header of a score in channel space: the receivers are the names of the channels.
pub type ChannelHeader = Header<String>;
