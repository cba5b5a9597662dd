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
//! score's duration. A synthesised sound is told by *cues* what happens to it, and in channel space
//! the sound of one thread may arrive by several *paths*.
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
pub mod retarget;

use crate::corpus::cloth::synthetic;
use crate::space::ambisonic::{self, CHANNEL_NAMES};
use crate::space::bands::Bands;

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
    /// What makes it.
    pub make: Make,
    /// Numbers that a synthesised sound is made with, by name: what its kind understands is in
    /// [`synth`](crate::synth). None for a recording.
    pub with: Vec<(String, f64)>,
}

impl Sound {
    /// A recording that is played.
    pub fn recording(
        name: impl Into<String>,
        path: impl Into<String>,
        repeat: Repeat,
        channel: Option<usize>,
    ) -> Self {
        Self { name: name.into(), make: Make::Recording { path: path.into(), repeat, channel }, with: vec![] }
    }

    /// True where it goes on until its thread ends, not by itself.
    pub fn is_endless(&self) -> bool {
        !matches!(&self.make, Make::Recording { repeat: Repeat::Once, .. })
    }
}

/// What makes a sound. Paths are relative to the folder of the score, with `/` between parts.
#[derive(Debug, Clone, PartialEq)]
pub enum Make {
    /// A recording.
    Recording {
        /// The file.
        path: String,
        /// How it repeats.
        repeat: Repeat,
        /// The channel of the recording that is played, from 0; all of them averaged where `None`.
        channel: Option<usize>,
    },
    /// A string that is plucked or struck.
    String,
    /// A bar that is struck.
    Bar(Held),
    /// Any body that is struck, by its modes.
    Modes {
        /// A file with a table of them.
        table: Option<String>,
        /// Those that stand in the score itself.
        modes: Vec<Mode>,
    },
    /// A needle that follows a rough surface.
    Needle,
    /// Something that sticks and slips.
    StickSlip,
    /// Air that is stirred.
    Turbulence,
    /// A sheet that is stretched, blown at and whipped.
    Membrane,
    /// A procedure that a script describes.
    Procedure {
        /// The script.
        script: String,
    },
    /// Grains of real recordings, one after the other as they are told.
    Grains {
        /// The folder of the corpus.
        corpus: String,
    },
    /// Cloth that rubs at speeds and pops as it is told.
    Cloth {
        /// The folder of its corpus, or the name of a model: `synthetic/cotton`.
        corpus: String,
    },
    /// Paper that rubs by the spectra of a database, tears, and crumples by its clips.
    Paper {
        /// The folder of the database, or the name of a model: `synthetic/printer`.
        corpus: String,
    },
}

/// The words for instruments, in scenes and in scores.
pub(crate) const INSTRUMENTS: &[&str] = &[
    "string",
    "bar",
    "free-bar",
    "clamped-bar",
    "modes",
    "needle",
    "stick-slip",
    "turbulence",
    "membrane",
    "procedure",
    "cloth",
    "paper",
];

impl Make {
    /// The instrument of which a word says all; none where more has to be said.
    pub(crate) fn of_word(word: &str) -> Option<Self> {
        Some(match word {
            "string" => Make::String,
            "bar" => Make::Bar(Held::Supported),
            "free-bar" => Make::Bar(Held::Free),
            "clamped-bar" => Make::Bar(Held::Clamped),
            "needle" => Make::Needle,
            "stick-slip" => Make::StickSlip,
            "turbulence" => Make::Turbulence,
            "membrane" => Make::Membrane,
            _ => return None,
        })
    }

    /// The path of the file that it needs, if it needs one.
    pub fn file(&self) -> Option<&str> {
        match self {
            Make::Recording { path: file, .. }
            | Make::Modes { table: Some(file), .. }
            | Make::Procedure { script: file }
            | Make::Grains { corpus: file } => Some(file),
            Make::Cloth { corpus } | Make::Paper { corpus } if !corpus.starts_with(synthetic::PREFIX) => {
                Some(corpus)
            }
            _ => None,
        }
    }

    fn file_mut(&mut self) -> Option<&mut String> {
        match self {
            Make::Recording { path: file, .. }
            | Make::Modes { table: Some(file), .. }
            | Make::Procedure { script: file }
            | Make::Grains { corpus: file } => Some(file),
            Make::Cloth { corpus } | Make::Paper { corpus } if !corpus.starts_with(synthetic::PREFIX) => {
                Some(corpus)
            }
            _ => None,
        }
    }

    /// What it is called.
    pub fn kind(&self) -> &'static str {
        match self {
            Make::Recording { .. } => "recording",
            Make::String => "string",
            Make::Bar(Held::Supported) => "bar",
            Make::Bar(Held::Free) => "free-bar",
            Make::Bar(Held::Clamped) => "clamped-bar",
            Make::Modes { .. } => "modes",
            Make::Needle => "needle",
            Make::StickSlip => "stick-slip",
            Make::Turbulence => "turbulence",
            Make::Membrane => "membrane",
            Make::Procedure { .. } => "procedure",
            Make::Grains { .. } => "grains",
            Make::Cloth { .. } => "cloth",
            Make::Paper { .. } => "paper",
        }
    }
}

/// How a bar is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Held {
    /// Both ends lie on something.
    Supported,
    /// It hangs freely.
    Free,
    /// One end is held fast.
    Clamped,
}

/// One way in which a body rings.
#[derive(Debug, Clone, PartialEq)]
pub struct Mode {
    /// In hertz.
    pub frequency_hz: f64,
    /// How fast it dies away: the amplitude falls as e^(−d t).
    pub decay_per_s: f64,
    /// Its amplitude after a strike of 1 N s.
    pub gain: f64,
    /// Factors on the gain by where the body is struck, one for each of its points; none where it is
    /// all the same.
    pub points: Vec<f64>,
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
    /// What all that is random in synthesised sounds follows from.
    pub seed: u64,
    /// Object space: the scene whose bodies, walls and air do something to sounds, as a path relative to the folder
    /// of the score.
    pub surroundings: Option<String>,
    /// Object space: how sources radiate into different directions.
    pub patterns: Vec<Pattern>,
    /// How the lines are sorted.
    pub order: Order,
    /// What the threads play.
    pub sounds: Vec<Sound>,
    /// Who receives: microphones in object space, outputs in channel space, of one channel or more each, in
    /// order.
    pub receivers: Vec<R>,
}

impl<R> Header<R> {
    /// A header that says nothing but who receives.
    pub fn new(order: Order, receivers: Vec<R>) -> Self {
        Self {
            speed_of_sound_mps: 343.0,
            duration_s: None,
            seed: 0,
            surroundings: None,
            patterns: Vec::new(),
            order,
            sounds: Vec::new(),
            receivers,
        }
    }

    /// The paths of all files that the score needs.
    pub fn files_mut(&mut self) -> impl Iterator<Item = &mut String>
    where
        R: Receives,
    {
        let sounds = self.sounds.iter_mut().filter_map(|sound| sound.make.file_mut());
        let receivers = self.receivers.iter_mut().filter_map(Receives::file_mut);
        sounds.chain(self.surroundings.as_mut()).chain(receivers)
    }
}

impl Header<Output> {
    /// The names of the channels of the soundtrack.
    pub fn channels(&self) -> Vec<String> {
        self.receivers.iter().flat_map(Output::channels).cloned().collect()
    }

    /// What arrives in channels by itself, not by way of a tail.
    pub fn heard<'a>(&'a self, value: &'a [Arrival]) -> impl Iterator<Item = &'a Arrival> {
        let plain = |(_, output): &(&Arrival, &Output)| !matches!(output, Output::Tail { .. });
        value.iter().zip(&self.receivers).filter(plain).map(|(arrival, _)| arrival)
    }
}

/// Who receives in either space.
pub trait Receives {
    /// The path of the file that it needs, if it needs one.
    fn file_mut(&mut self) -> Option<&mut String>;
}

impl Receives for Microphone {
    fn file_mut(&mut self) -> Option<&mut String> {
        match &mut self.pickup {
            Pickup::Binaural { head, .. } => head.as_mut(),
            _ => None,
        }
    }
}

impl Receives for Output {
    fn file_mut(&mut self) -> Option<&mut String> {
        match self {
            Output::Head { head, .. } => head.as_mut(),
            Output::Tail { scene, .. } => Some(scene),
            Output::Channel(_) => None,
        }
    }
}

/// How a source radiates into different directions.
#[derive(Debug, Clone, PartialEq)]
pub struct Pattern {
    /// The name that `start` lines use.
    pub name: String,
    /// How it does.
    pub radiation: Radiation,
}

/// How a source radiates.
#[derive(Debug, Clone, PartialEq)]
pub enum Radiation {
    /// From one place, into different directions: spherical harmonics, 1, 4, 9 or 16 of them, see
    /// [`space::directivity`](crate::space::directivity).
    Harmonics(Vec<f64>),
    /// From all over the surface of its object, evenly.
    Surface,
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
    /// The name that `hear` lines use.
    pub name: String,
    /// What it picks up.
    pub pickup: Pickup,
    /// Where it stands, if it never moves.
    pub fixed: Option<Pose>,
}

/// What a microphone picks up, and into which channels.
#[derive(Debug, Clone, PartialEq)]
pub enum Pickup {
    /// One channel, which hears so much from each side.
    Shape(MicrophoneShape),
    /// Both ears of a head, for headphones.
    Binaural {
        /// The file that says what the head does to sound, as a path relative to the folder of the score;
        /// `None`: a sphere of the size of a head.
        head: Option<String>,
        /// Whether all voices share one head: see [`Output::Head`].
        shared: bool,
    },
    /// The sound field about a point, in real spherical harmonics up to an order from 1 to 3: ACN order, SN3D
    /// scaling, as in AmbiX files.
    Ambisonic {
        /// The highest order.
        order: usize,
    },
    /// What loudspeakers about a listener have to play.
    Loudspeakers(Vec<Loudspeaker>),
}

impl Pickup {
    /// The names of its channels.
    pub fn channels(&self) -> Vec<String> {
        match self {
            Pickup::Shape(_) => vec!["mono".to_owned()],
            Pickup::Binaural { .. } => vec!["left".to_owned(), "right".to_owned()],
            Pickup::Ambisonic { order } => {
                let names = CHANNEL_NAMES.iter().take(ambisonic::channels(*order));
                names.map(|name| (*name).to_owned()).collect()
            }
            Pickup::Loudspeakers(all) => all.iter().map(|loudspeaker| loudspeaker.name.clone()).collect(),
        }
    }

    /// Whether it matters how the microphone is turned about the direction that it faces.
    pub fn is_turned(&self) -> bool {
        !matches!(self, Pickup::Shape(_))
    }
}

/// One of several loudspeakers about a listener.
#[derive(Debug, Clone, PartialEq)]
pub struct Loudspeaker {
    /// The name that its channel bears.
    pub name: String,
    /// Its direction, in degrees from ahead to the left.
    pub azimuth_deg: f64,
    /// How far above the horizon it is, in degrees.
    pub elevation_deg: f64,
    /// True for one that plays low effects only, which come from nowhere.
    pub is_lfe: bool,
}

/// Where a microphone is and which way it faces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// World position in metres.
    pub position_m: [f64; 3],
    /// The direction it faces: a vector of any length above zero, kept as it was given, so that the
    /// text of a score says exactly what is in memory. Who computes with it normalises it.
    pub facing: [f64; 3],
    /// The direction that is up for it, of any length above zero; it need not be at right angles to where it faces.
    pub up: [f64; 3],
}

impl Pose {
    /// Upright at a place, facing a direction.
    pub const fn upright(position_m: [f64; 3], facing: [f64; 3]) -> Self {
        Self { position_m, facing, up: [0.0, 1.0, 0.0] }
    }
}

/// The value of a key in object space: where the source is and how loud it is 1 m away.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Where it is.
    pub whereabouts: Whereabouts,
    /// Pressure gain at a distance of 1 m, 0 or above; in a microphone's ambience that at the
    /// microphone.
    pub gain: f64,
    /// How the source is turned, as a quaternion x, y, z, w from its own directions to those of the
    /// world, for those that do not radiate evenly. `None`: not at all.
    pub turn: Option<[f64; 4]>,
}

/// Where a source is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Whereabouts {
    /// A place in the world, in metres.
    At([f64; 3]),
    /// All around a microphone, by its index: an ambience that only it hears.
    Around(usize),
}

impl Placement {
    /// A source at a place.
    pub fn at(position_m: [f64; 3], gain: f64) -> Self {
        Self { whereabouts: Whereabouts::At(position_m), gain, turn: None }
    }
}

/// The value of a key in channel space, for one output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arrival {
    /// Pressure gain; below 0 where it arrives with the opposite sign.
    pub gain: f64,
    /// Seconds from leaving the source to arriving, 0 or above.
    pub delay_s: f64,
    /// At a head: where it comes from in the head's own frame (ahead −Z, right +X, up +Y), in metres; nowhere
    /// where it sounds within the head. `None` for a channel.
    pub from_m: Option<[f64; 3]>,
    /// What walls and air leave of each octave band, as further gains of pressure; `None`: all of it. Where one output
    /// of a line has such, the others are written with gains of 1.
    pub bands: Option<Bands>,
}

impl Arrival {
    /// What arrives in a channel.
    pub const fn new(gain: f64, delay_s: f64) -> Self {
        Self { gain, delay_s, from_m: None, bands: None }
    }
}

/// Who receives in a score in channel space.
#[derive(Debug, Clone, PartialEq)]
pub enum Output {
    /// One channel, by its name.
    Channel(String),
    /// A head, whose ears are two channels.
    Head {
        /// The names of the channels of the left and of the right ear.
        ears: [String; 2],
        /// The file that says what the head does to sound, as a path relative to the folder of the score;
        /// `None`: a sphere of the size of a head.
        head: Option<String>,
        /// Whether all voices share one head. Else each passes filters of its own, which is exact and costs more;
        /// shared, their sound field of order 3 passes those of a
        /// [head that hears a field](crate::space::head::FieldResponses).
        shared: bool,
    },
    /// The reverberation of a room behind its first reflections: what arrives here sounds on in channels of other
    /// outputs.
    Tail {
        /// The scene whose room it is, as a path relative to the folder of the score.
        scene: String,
        /// The channels in which it sounds, by their names, and how loud in each.
        channels: Vec<(String, f64)>,
    },
}

impl Output {
    /// The names of its channels.
    pub fn channels(&self) -> &[String] {
        match self {
            Output::Tail { .. } => &[],
            Output::Channel(name) => std::slice::from_ref(name),
            Output::Head { ears, .. } => ears,
        }
    }
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
    /// Object space: the name of the [`Pattern`] by which it radiates. Empty: evenly.
    pub pattern: String,
}

impl Start {
    /// A sound as it is, from its beginning, that belongs to nothing.
    pub fn new(sound: impl Into<String>) -> Self {
        Self {
            sound: sound.into(),
            speed: 1.0,
            offset_s: 0.0,
            object: String::new(),
            cause: String::new(),
            pattern: String::new(),
        }
    }
}

/// What a line does with its thread.
#[derive(Debug, Clone, PartialEq)]
pub enum Verb {
    /// The thread begins.
    Start(Start),
    /// Channel space: another path of the thread's sound begins, such as by a wall.
    Path,
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
    /// The path: 0 is the direct one, and the only one there is in object space.
    pub path: u32,
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

/// Something that is said to a synthesised sound.
#[derive(Debug, Clone, PartialEq)]
pub struct Cue {
    /// The number of its thread, which has started.
    pub thread: u64,
    /// When, in seconds of the source's time.
    pub time_s: f64,
    /// What is said.
    pub action: Action,
    /// Why a grain or a strike is, in a few words for the log. Empty: not said.
    pub cause: String,
}

/// What is said to a synthesised sound.
#[derive(Debug, Clone, PartialEq)]
pub enum Action {
    /// Controls have these values now; between two such lines a control changes evenly.
    Set(Vec<(String, f64)>),
    /// It is struck.
    Strike(Blow),
    /// A grain begins.
    Grain(Grain),
}

/// A grain of a corpus, as it is played.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grain {
    /// Its number in the corpus, from 0.
    pub number: u32,
    /// Its gain.
    pub gain: f64,
    /// Seconds of it that are played in a second: at 2 it is an octave higher and half as long.
    pub speed: f64,
    /// How far its speed strays at random, as the standard deviation of its logarithm: its partials become bands as
    /// wide as this part of their frequency.
    pub spread: f64,
}

/// What strikes a synthesised sound.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blow {
    /// How hard, in newton seconds.
    pub impulse_ns: f64,
    /// Where: along a string or bar from 0 to 1, else the number of a point, from 0.
    pub place: f64,
    /// How long the striker touches, in seconds; 0 where it is as hard as can be.
    pub contact_s: f64,
}

/// A line of a score in object space.
#[derive(Debug, Clone, PartialEq)]
pub enum ObjectLine {
    /// A line of a sounding thread.
    Thread(Statement<Placement>),
    /// Something said to a synthesised sound.
    Cue(Cue),
    /// A line of a microphone.
    Microphone(MicrophoneKey),
}

/// A line of a score in channel space.
#[derive(Debug, Clone, PartialEq)]
pub enum ChannelLine {
    /// A line of a path of a sounding thread: one [`Arrival`] for every output.
    Thread(Statement<Vec<Arrival>>),
    /// Something said to a synthesised sound.
    Cue(Cue),
}

impl ChannelLine {
    /// When, in seconds of the source's time.
    pub fn time_s(&self) -> f64 {
        match self {
            ChannelLine::Thread(statement) => statement.time_s,
            ChannelLine::Cue(cue) => cue.time_s,
        }
    }

    /// The number of its thread.
    pub fn thread(&self) -> u64 {
        match self {
            ChannelLine::Thread(statement) => statement.thread,
            ChannelLine::Cue(cue) => cue.thread,
        }
    }

    /// What it says of a thread's way, if it does.
    pub fn statement(&self) -> Option<&Statement<Vec<Arrival>>> {
        match self {
            ChannelLine::Thread(statement) => Some(statement),
            ChannelLine::Cue(_) => None,
        }
    }
}

/// The header of a score in object space.
pub type ObjectHeader = Header<Microphone>;

/// The header of a score in channel space.
pub type ChannelHeader = Header<Output>;
