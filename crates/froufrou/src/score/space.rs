//! The two spaces of a score. A [`Space`] says what a key's value and a receiver are and how they
//! stand in the text; all the rest of reading and writing is the same for both.

use std::fmt::Debug;

use super::lexer::{Words, push_name, push_quoted};
use super::quantity::{self, check_facing, check_turn, check_up};
use super::rules::Rank;
use super::{
    Arrival, ChannelLine, Cue, Loudspeaker, Microphone, MicrophoneKey, MicrophoneShape, ObjectLine, Output,
    Pickup, Placement, Pose, Statement, Whereabouts,
};
use crate::space::bands::{BAND_COUNT, Bands};
use crate::{Error, Result};

mod sealed {
    pub trait Sealed {}
    impl Sealed for super::ObjectSpace {}
    impl Sealed for super::ChannelSpace {}
}

/// What differs between a score in object space and one in channel space.
///
/// It is implemented by [`ObjectSpace`] and [`ChannelSpace`] alone.
pub trait Space: sealed::Sealed + Sized + Send + Sync + 'static {
    /// The word on a score's first line.
    const NAME: &'static str;
    /// Who receives.
    type Receiver: Debug + Clone + PartialEq + Send + Sync + 'static;
    /// What a thread's line says beside what it does and when.
    type Value: Debug + Clone + PartialEq + Send + Sync + 'static;
    /// A line after the header.
    type Line: Debug + Clone + PartialEq + Send + Sync + 'static;

    /// Whether threads are somewhere, so that they may radiate and be reflected.
    #[doc(hidden)]
    const HAS_PLACES: bool;
    /// The keywords that declare receivers.
    #[doc(hidden)]
    const RECEIVER_KEYWORDS: &'static [&'static str];
    /// The verbs of receivers, which have a place.
    #[doc(hidden)]
    const RECEIVER_VERBS: &'static [&'static str];
    /// The keywords of a value's parts.
    #[doc(hidden)]
    const CLAUSES: &'static [&'static str];
    /// A value while it is read.
    #[doc(hidden)]
    type Draft: Default;

    #[doc(hidden)]
    fn read_receivers(
        keyword: &str,
        words: &mut Words<'_>,
        receivers: &mut Vec<Self::Receiver>,
    ) -> Result<()>;
    /// The lines that declare all receivers, each with the index of its first.
    #[doc(hidden)]
    fn receiver_lines(receivers: &[Self::Receiver]) -> Result<Vec<(usize, String)>>;
    /// The names that a receiver takes.
    #[doc(hidden)]
    fn receiver_names(receiver: &Self::Receiver) -> &[String];
    /// Whether a receiver has its place where it is declared.
    #[doc(hidden)]
    fn receiver_stands(receiver: &Self::Receiver) -> bool;
    /// Reads the part of a value that has no keywords.
    #[doc(hidden)]
    fn read_plain(words: &mut Words<'_>, receivers: &[Self::Receiver], draft: &mut Self::Draft)
    -> Result<()>;
    /// Reads the part of a value that this keyword begins; false where it begins none.
    #[doc(hidden)]
    fn read_clause(
        keyword: &str,
        words: &mut Words<'_>,
        receivers: &[Self::Receiver],
        draft: &mut Self::Draft,
    ) -> Result<bool>;
    /// The value; what was left out is as it was before.
    #[doc(hidden)]
    fn value(draft: Self::Draft, before: Option<&Self::Value>) -> Result<Self::Value>;
    #[doc(hidden)]
    fn push_value(text: &mut String, value: &Self::Value, receivers: &[Self::Receiver]) -> Result<()>;
    #[doc(hidden)]
    fn thread_line(statement: Statement<Self::Value>) -> Self::Line;
    #[doc(hidden)]
    fn cue_line(cue: Cue) -> Self::Line;
    /// A line of a receiver, where it can have any.
    #[doc(hidden)]
    fn microphone_line(key: MicrophoneKey) -> Option<Self::Line>;
    #[doc(hidden)]
    fn of_line(line: &Self::Line) -> LineRef<'_, Self::Value>;
}

/// Whose line it is.
#[doc(hidden)]
pub enum LineRef<'a, V> {
    Thread(&'a Statement<V>),
    Cue(&'a Cue),
    Microphone(&'a MicrophoneKey),
}

/// Where a line stands among the sorted ones.
pub fn rank<S: Space>(line: &S::Line) -> Rank {
    match S::of_line(line) {
        LineRef::Thread(of) => Rank { thread: true, id: of.thread, time_s: of.time_s },
        LineRef::Cue(of) => Rank { thread: true, id: of.thread, time_s: of.time_s },
        LineRef::Microphone(of) => Rank { thread: false, id: of.microphone as u64, time_s: of.time_s },
    }
}

/// Fills a part of a line that may be given once.
pub fn once<T>(part: &mut Option<T>, keyword: &str, words: &Words<'_>, value: T) -> Result<()> {
    match part.replace(value) {
        None => Ok(()),
        Some(_) => Err(words.fault(format!("`{keyword}` is given twice"))),
    }
}

/// The space of a score whose keys place threads in the world: see [`ObjectLine`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ObjectSpace;

/// A [`Placement`] while it is read.
#[doc(hidden)]
#[derive(Debug, Default)]
pub struct PlacementDraft {
    whereabouts: Option<Whereabouts>,
    gain: Option<f64>,
    turn: Option<[f64; 4]>,
}

const OMNI: MicrophoneShape = MicrophoneShape { c: 0.0, k: 0.0 };
const CARDIOID: MicrophoneShape = MicrophoneShape { c: 0.0, k: 1.0 };

/// Whether two shapes have the same bits, so that the word may stand for the numbers.
fn same_shape(a: MicrophoneShape, b: MicrophoneShape) -> bool {
    a.c.to_bits() == b.c.to_bits() && a.k.to_bits() == b.k.to_bits()
}

impl Space for ObjectSpace {
    const NAME: &'static str = "object";
    type Receiver = Microphone;
    type Value = Placement;
    type Line = ObjectLine;

    const HAS_PLACES: bool = true;
    const RECEIVER_KEYWORDS: &'static [&'static str] = &["microphone"];
    const RECEIVER_VERBS: &'static [&'static str] = &["hear", "cut"];
    const CLAUSES: &'static [&'static str] = &["at", "around", "gain", "turn"];
    type Draft = PlacementDraft;

    fn read_receivers(_: &str, words: &mut Words<'_>, receivers: &mut Vec<Microphone>) -> Result<()> {
        let name = words.name("the microphone's name")?.into_owned();
        let pickup = read_pickup(words)?;
        let fixed = match words.peek() {
            None | Some(b'#') => None,
            Some(_) => Some(read_whereabouts(words, None)?),
        };
        receivers.push(Microphone { name, pickup, fixed });
        Ok(())
    }

    fn receiver_lines(receivers: &[Microphone]) -> Result<Vec<(usize, String)>> {
        let line = |(index, Microphone { name, pickup, fixed }): (usize, &Microphone)| {
            let mut text = String::from("microphone ");
            push_name(&mut text, name);
            push_pickup(&mut text, pickup)?;
            if let Some(pose) = fixed {
                push_whereabouts(&mut text, pose)?;
            }
            Ok((index, text))
        };
        receivers.iter().enumerate().map(line).collect()
    }

    fn receiver_names(receiver: &Microphone) -> &[String] {
        std::slice::from_ref(&receiver.name)
    }

    fn receiver_stands(receiver: &Microphone) -> bool {
        receiver.fixed.is_some()
    }

    fn read_plain(_: &mut Words<'_>, _: &[Microphone], _: &mut PlacementDraft) -> Result<()> {
        Ok(())
    }

    fn read_clause(
        keyword: &str,
        words: &mut Words<'_>,
        receivers: &[Microphone],
        draft: &mut PlacementDraft,
    ) -> Result<bool> {
        match keyword {
            "at" => {
                let position_m = words.numbers_of(quantity::POSITION)?;
                once(&mut draft.whereabouts, "at or around", words, Whereabouts::At(position_m))?;
            }
            "around" => {
                let name = words.name("the microphone's name")?;
                let known = receivers.iter().map(|receiver| receiver.name.as_str());
                let index = receivers
                    .iter()
                    .position(|receiver| receiver.name == name)
                    .ok_or_else(|| words.unknown("microphone", &name, known, "one that is declared"))?;
                once(&mut draft.whereabouts, "at or around", words, Whereabouts::Around(index))?;
            }
            "turn" => {
                let mut turn = [0.0; 4];
                for part in &mut turn {
                    *part = words.number_of(quantity::TURN)?;
                }
                let turn = check_turn(turn).map_err(|error| words.place(error))?;
                once(&mut draft.turn, keyword, words, turn)?;
            }
            "gain" => {
                let gain = words.number_of(quantity::GAIN)?;
                once(&mut draft.gain, keyword, words, gain)?;
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    fn value(draft: PlacementDraft, before: Option<&Placement>) -> Result<Placement> {
        let whereabouts = match (draft.whereabouts, before.map(|before| before.whereabouts)) {
            (Some(Whereabouts::At(_)), Some(Whereabouts::Around(_)))
            | (Some(Whereabouts::Around(_)), Some(Whereabouts::At(_))) => {
                return Err(Error::new(
                    "a thread is at places or around microphones, not one after the other",
                )
                .help("end it and start another"));
            }
            (Some(Whereabouts::Around(here)), Some(Whereabouts::Around(before))) if here != before => {
                return Err(Error::new("a thread that is around one microphone stays there")
                    .help("end it and start another"));
            }
            (here, before) => here.or(before).ok_or_else(|| {
                Error::new("the thread starts nowhere").help("add where, in metres, as `at X Y Z`")
            })?,
        };
        let gain = draft.gain.or(before.map(|before| before.gain)).unwrap_or(1.0);
        Ok(Placement { whereabouts, gain, turn: draft.turn.or(before.and_then(|before| before.turn)) })
    }

    fn push_value(text: &mut String, value: &Placement, receivers: &[Microphone]) -> Result<()> {
        match value.whereabouts {
            Whereabouts::At(position_m) => push_vector(text, " at", quantity::POSITION, position_m)?,
            Whereabouts::Around(index) => {
                let receiver = receivers
                    .get(index)
                    .ok_or_else(|| Error::new(format!("there is no microphone with index {index}")))?;
                text.push_str(" around ");
                push_name(text, &receiver.name);
            }
        }
        text.push_str(" gain ");
        quantity::GAIN.push(text, value.gain)?;
        if let Some(turn) = value.turn {
            text.push_str(" turn");
            for part in check_turn(turn)? {
                text.push(' ');
                quantity::TURN.push(text, part)?;
            }
        }
        Ok(())
    }

    fn thread_line(statement: Statement<Placement>) -> ObjectLine {
        ObjectLine::Thread(statement)
    }

    fn cue_line(cue: Cue) -> ObjectLine {
        ObjectLine::Cue(cue)
    }

    fn microphone_line(key: MicrophoneKey) -> Option<ObjectLine> {
        Some(ObjectLine::Microphone(key))
    }

    fn of_line(line: &ObjectLine) -> LineRef<'_, Placement> {
        match line {
            ObjectLine::Thread(statement) => LineRef::Thread(statement),
            ObjectLine::Cue(cue) => LineRef::Cue(cue),
            ObjectLine::Microphone(key) => LineRef::Microphone(key),
        }
    }
}

/// The word for a head that all voices share.
const SHARED: &str = "shared";

/// Writes the file of a head, if it has one, and whether it is shared.
fn push_head(text: &mut String, head: Option<&str>, shared: bool) {
    if let Some(path) = head {
        text.push(' ');
        push_quoted(text, path);
    }
    if shared {
        text.push(' ');
        text.push_str(SHARED);
    }
}

/// Reads what a microphone picks up.
fn read_pickup(words: &mut Words<'_>) -> Result<Pickup> {
    const KINDS: [&str; 6] = ["omni", "cardioid", "shape", "binaural", "ambisonic", "loudspeakers"];
    let expected = "`omni`, `cardioid`, `shape C K`, `binaural`, `ambisonic ORDER` or `loudspeakers`";
    match words.keyword(expected)? {
        None | Some("omni") => Ok(Pickup::Shape(OMNI)),
        Some("cardioid") => Ok(Pickup::Shape(CARDIOID)),
        Some("shape") => Ok(Pickup::Shape(MicrophoneShape {
            c: words.number_of(quantity::SHAPE_C)?,
            k: words.number_of(quantity::SHAPE_K)?,
        })),
        Some("binaural") => {
            let file = words.peek() == Some(b'"');
            let head = file.then(|| words.name("the file of a head")).transpose()?;
            let shared = words.takes(SHARED);
            Ok(Pickup::Binaural { head: head.map(|path| path.into_owned()), shared })
        }
        Some("ambisonic") => match words.whole("the order, from 1 to 3")? {
            order @ 1..=3 => Ok(Pickup::Ambisonic { order: order as usize }),
            order => Err(words.fault(format!("expected an order from 1 to 3, found {order}"))),
        },
        Some("loudspeakers") => {
            let mut all: Vec<Loudspeaker> = Vec::new();
            // Each begins with its name in quotes, which no keyword does.
            while words.peek() == Some(b'"') {
                let name = words.name("the name of a loudspeaker")?.into_owned();
                if all.iter().any(|other| other.name == name) {
                    return Err(words.fault(format!("there are two loudspeakers `{name}`")));
                }
                let (mut azimuth_deg, mut elevation_deg) = (0.0, 0.0);
                let is_lfe = !words.next_is_number();
                if is_lfe {
                    let expected = "its azimuth and elevation, or `lfe`";
                    match words.keyword_here(expected)? {
                        "lfe" => {}
                        other => return Err(words.unknown("word", other, ["lfe"], expected)),
                    }
                } else {
                    azimuth_deg = words.number_of(quantity::AZIMUTH)?;
                    elevation_deg = words.number_of(quantity::ELEVATION)?;
                }
                all.push(Loudspeaker { name, azimuth_deg, elevation_deg, is_lfe });
            }
            if all.is_empty() {
                return Err(words
                    .fault("there are no loudspeakers")
                    .help("name each with its direction, as `\"left\" 30 0 \"right\" -30 0 \"lfe\" lfe`"));
            }
            Ok(Pickup::Loudspeakers(all))
        }
        Some(other) => Err(words.unknown("microphone shape", other, KINDS, expected)),
    }
}

fn push_pickup(text: &mut String, pickup: &Pickup) -> Result<()> {
    match pickup {
        Pickup::Shape(shape) if same_shape(*shape, OMNI) => text.push_str(" omni"),
        Pickup::Shape(shape) if same_shape(*shape, CARDIOID) => text.push_str(" cardioid"),
        Pickup::Shape(shape) => {
            text.push_str(" shape ");
            quantity::SHAPE_C.push(text, shape.c)?;
            text.push(' ');
            quantity::SHAPE_K.push(text, shape.k)?;
        }
        Pickup::Binaural { head, shared } => {
            text.push_str(" binaural");
            push_head(text, head.as_deref(), *shared);
        }
        Pickup::Ambisonic { order: order @ 1..=3 } => {
            text.push_str(" ambisonic ");
            text.push_str(&order.to_string());
        }
        Pickup::Ambisonic { order } => {
            return Err(Error::new(format!("the order of ambisonics is {order}, not from 1 to 3")));
        }
        Pickup::Loudspeakers(all) => {
            text.push_str(" loudspeakers");
            for (index, Loudspeaker { name, azimuth_deg, elevation_deg, is_lfe }) in all.iter().enumerate() {
                if all[..index].iter().any(|other| other.name == *name) {
                    return Err(Error::new(format!("there are two loudspeakers `{name}`")));
                }
                text.push(' ');
                push_quoted(text, name);
                text.push(' ');
                if *is_lfe {
                    text.push_str("lfe");
                } else {
                    quantity::AZIMUTH.push(text, *azimuth_deg)?;
                    text.push(' ');
                    quantity::ELEVATION.push(text, *elevation_deg)?;
                }
            }
            if all.is_empty() {
                return Err(Error::new("there are no loudspeakers"));
            }
        }
    }
    Ok(())
}

/// Reads what follows the time of a `hear` or `cut` line, or the shape of a microphone that stands
/// still; what is left out is as it was before.
pub fn read_whereabouts(words: &mut Words<'_>, before: Option<&MicrophoneKey>) -> Result<Pose> {
    const KEYWORDS: [&str; 3] = ["at", "facing", "up"];
    let expected = "`at X Y Z`, `facing X Y Z` or `up X Y Z`";
    let (mut position_m, mut facing, mut up) = (None, None, None);
    while let Some(keyword) = words.keyword(expected)? {
        match keyword {
            "at" => {
                let vector = words.numbers_of(quantity::POSITION)?;
                once(&mut position_m, keyword, words, vector)?;
            }
            "facing" => {
                let vector = words.numbers_of(quantity::FACING)?;
                let vector = check_facing(vector).map_err(|error| words.place(error))?;
                once(&mut facing, keyword, words, vector)?;
            }
            "up" => {
                let vector = words.numbers_of(quantity::UP)?;
                let vector = check_up(vector).map_err(|error| words.place(error))?;
                once(&mut up, keyword, words, vector)?;
            }
            other => return Err(words.unknown("word", other, KEYWORDS, expected)),
        }
    }
    let position_m = position_m.or(before.map(|before| before.pose.position_m)).ok_or_else(|| {
        words.fault("the microphone is nowhere yet").help("add where, in metres, as `at X Y Z`")
    })?;
    // Without a word on it a microphone faces where a camera does.
    let facing = facing.or(before.map(|before| before.pose.facing)).unwrap_or([0.0, 0.0, -1.0]);
    let up = up.unwrap_or(UPRIGHT);
    Ok(Pose { position_m, facing, up })
}

/// What is up where a line does not say otherwise.
const UPRIGHT: [f64; 3] = [0.0, 1.0, 0.0];

/// Appends what follows the time of a `hear` or `cut` line.
pub fn push_whereabouts(text: &mut String, pose: &Pose) -> Result<()> {
    push_vector(text, " at", quantity::POSITION, pose.position_m)?;
    push_vector(text, " facing", quantity::FACING, check_facing(pose.facing)?)?;
    if pose.up.map(f64::to_bits) == UPRIGHT.map(f64::to_bits) {
        return Ok(());
    }
    push_vector(text, " up", quantity::UP, check_up(pose.up)?)
}

fn push_vector(
    text: &mut String,
    keyword: &str,
    quantities: [quantity::Quantity; 3],
    vector: [f64; 3],
) -> Result<()> {
    text.push_str(keyword);
    for (quantity, number) in quantities.into_iter().zip(vector) {
        text.push(' ');
        quantity.push(text, number)?;
    }
    Ok(())
}

/// The space of a score whose keys give the gain and delay of threads in every channel: see
/// [`ChannelLine`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChannelSpace;

/// What arrives, while it is read.
#[doc(hidden)]
#[derive(Debug, Default)]
pub struct ArrivalsDraft {
    arrivals: Vec<Arrival>,
    /// One for each output.
    bands: Option<Vec<Bands>>,
}

impl Space for ChannelSpace {
    const NAME: &'static str = "channel";
    type Receiver = Output;
    type Value = Vec<Arrival>;
    type Line = ChannelLine;

    const HAS_PLACES: bool = false;
    const RECEIVER_KEYWORDS: &'static [&'static str] = &["channels", "head", "tail"];
    const RECEIVER_VERBS: &'static [&'static str] = &[];
    const CLAUSES: &'static [&'static str] = &["bands"];
    type Draft = ArrivalsDraft;

    fn read_receivers(keyword: &str, words: &mut Words<'_>, receivers: &mut Vec<Output>) -> Result<()> {
        let channel = |words: &mut Words<'_>| Ok(words.name("the name of a channel")?.into_owned());
        if keyword == "head" {
            let ears = [channel(words)?, channel(words)?];
            let mut shared = words.takes(SHARED);
            let file = !shared && words.peek().is_some();
            let head = file.then(|| words.name("the file of a head")).transpose()?;
            shared = shared || words.takes(SHARED);
            receivers.push(Output::Head { ears, head: head.map(|path| path.into_owned()), shared });
            return Ok(());
        }
        if keyword == "tail" {
            return read_tail(words, receivers);
        }
        if matches!(receivers.last(), Some(Output::Channel(_))) {
            return Err(words
                .fault("`channels` is given twice")
                .help("name all channels on one line, as `channels left right`"));
        }
        loop {
            receivers.push(Output::Channel(channel(words)?));
            if words.peek().is_none() {
                return Ok(());
            }
        }
    }

    fn receiver_lines(receivers: &[Output]) -> Result<Vec<(usize, String)>> {
        let mut lines: Vec<(usize, String)> = Vec::new();
        let mut joins = false;
        for (index, output) in receivers.iter().enumerate() {
            match output {
                Output::Channel(name) => {
                    // Channels that follow one another stand on one line.
                    if !joins {
                        lines.push((index, "channels".into()));
                    }
                    if let Some((_, line)) = lines.last_mut() {
                        line.push(' ');
                        push_name(line, name);
                    }
                }
                Output::Head { ears, head, shared } => {
                    let mut line = String::from("head");
                    for ear in ears {
                        line.push(' ');
                        push_name(&mut line, ear);
                    }
                    push_head(&mut line, head.as_deref(), *shared);
                    lines.push((index, line));
                }
                Output::Tail { scene, channels } => {
                    let mut line = String::from("tail ");
                    push_quoted(&mut line, scene);
                    if channels.is_empty() {
                        return Err(Error::new("a tail sounds in no channel"));
                    }
                    for (name, level) in channels {
                        line.push(' ');
                        push_name(&mut line, name);
                        line.push(' ');
                        quantity::LEVEL.push(&mut line, *level)?;
                    }
                    lines.push((index, line));
                }
            }
            joins = matches!(output, Output::Channel(_));
        }
        Ok(lines)
    }

    fn receiver_names(receiver: &Output) -> &[String] {
        receiver.channels()
    }

    fn receiver_stands(_: &Output) -> bool {
        false
    }

    fn read_plain(words: &mut Words<'_>, receivers: &[Output], draft: &mut ArrivalsDraft) -> Result<()> {
        let draft = &mut draft.arrivals;
        while words.next_is_number() {
            let Some(output) = receivers.get(draft.len()) else {
                // Take the word, so that the error points at it.
                words.next()?;
                return Err(words.fault(count_of_arrivals(receivers, "more")));
            };
            if draft.is_empty() {
                draft.reserve_exact(receivers.len());
            }
            let mut arrival =
                Arrival::new(words.number_of(quantity::SIGNED_GAIN)?, words.number_of(quantity::DELAY)?);
            if matches!(output, Output::Head { .. }) {
                arrival.from_m = Some(words.numbers_of(quantity::FROM)?);
            }
            draft.push(arrival);
        }
        if draft.is_empty() || draft.len() == receivers.len() {
            return Ok(());
        }
        words.next()?;
        Err(words.fault(count_of_arrivals(receivers, &draft.len().to_string())))
    }

    fn read_clause(
        keyword: &str,
        words: &mut Words<'_>,
        receivers: &[Output],
        draft: &mut ArrivalsDraft,
    ) -> Result<bool> {
        if keyword != "bands" {
            return Ok(false);
        }
        let mut all: Vec<Bands> = vec![read_bands(words)?];
        if words.next_is_number() {
            while all.len() < receivers.len() {
                all.push(read_bands(words)?);
            }
        }
        all.resize(receivers.len(), all[0]);
        once(&mut draft.bands, keyword, words, all)?;
        Ok(true)
    }

    fn value(draft: ArrivalsDraft, before: Option<&Vec<Arrival>>) -> Result<Vec<Arrival>> {
        let mut arrivals = match before {
            _ if !draft.arrivals.is_empty() => draft.arrivals,
            Some(before) => before.clone(),
            None => {
                return Err(Error::new("the thread starts without a gain and a delay")
                    .help("add `GAIN DELAY` for every channel after the sound"));
            }
        };
        for (arrival, bands) in arrivals.iter_mut().zip(draft.bands.into_iter().flatten()) {
            arrival.bands = Some(bands);
        }
        Ok(arrivals)
    }

    fn push_value(text: &mut String, value: &Vec<Arrival>, receivers: &[Output]) -> Result<()> {
        if value.len() != receivers.len() {
            return Err(Error::new(count_of_arrivals(receivers, &value.len().to_string())));
        }
        for (Arrival { gain, delay_s, from_m, .. }, output) in value.iter().zip(receivers) {
            text.push(' ');
            quantity::SIGNED_GAIN.push(text, *gain)?;
            text.push(' ');
            quantity::DELAY.push(text, *delay_s)?;
            match (output, from_m) {
                (Output::Channel(_) | Output::Tail { .. }, None) => {}
                (Output::Tail { .. }, Some(_)) => {
                    return Err(Error::new("what arrives at a tail has a place"));
                }
                (Output::Head { .. }, Some(from_m)) => push_vector(text, "", quantity::FROM, *from_m)?,
                (Output::Channel(name), Some(_)) => {
                    return Err(Error::new(format!("what arrives in the channel `{name}` has a place")));
                }
                (Output::Head { ears: [left, right], .. }, None) => {
                    let what = format!("what arrives at the head `{left}` `{right}` comes from nowhere");
                    return Err(Error::new(what));
                }
            }
        }
        push_all_bands(text, value)
    }

    fn thread_line(statement: Statement<Vec<Arrival>>) -> ChannelLine {
        ChannelLine::Thread(statement)
    }

    fn cue_line(cue: Cue) -> ChannelLine {
        ChannelLine::Cue(cue)
    }

    fn microphone_line(_: MicrophoneKey) -> Option<ChannelLine> {
        None
    }

    fn of_line(line: &ChannelLine) -> LineRef<'_, Vec<Arrival>> {
        match line {
            ChannelLine::Thread(statement) => LineRef::Thread(statement),
            ChannelLine::Cue(cue) => LineRef::Cue(cue),
        }
    }
}

/// Reads what follows `tail`.
fn read_tail(words: &mut Words<'_>, receivers: &mut Vec<Output>) -> Result<()> {
    let scene = words.name("the file of a scene")?.into_owned();
    let mut channels: Vec<(String, f64)> = Vec::new();
    while channels.is_empty() || words.peek().is_some_and(|next| next != b'#') {
        let name = words.name("the name of a channel that is declared above")?;
        let known = || receivers.iter().flat_map(Output::channels).map(String::as_str);
        if !known().any(|known| known == name) {
            return Err(words.unknown("channel", &name, known(), "one that is declared above"));
        }
        let name = name.into_owned();
        channels.push((name, words.number_of(quantity::LEVEL)?));
    }
    receivers.push(Output::Tail { scene, channels });
    Ok(())
}

/// Reads the gains of all octave bands.
fn read_bands(words: &mut Words<'_>) -> Result<Bands> {
    let mut bands = [0.0; BAND_COUNT];
    for gain in &mut bands {
        *gain = words.number_of(quantity::BAND_GAIN)?;
    }
    Ok(bands)
}

/// Appends the gains of octave bands, if anything that arrives has such: once where all outputs have the same.
fn push_all_bands(text: &mut String, value: &[Arrival]) -> Result<()> {
    if value.iter().all(|arrival| arrival.bands.is_none()) {
        return Ok(());
    }
    let bits = |arrival: &Arrival| arrival.bands.map(|bands| bands.map(f64::to_bits));
    let different = value.iter().any(|arrival| bits(arrival) != bits(&value[0]));
    text.push_str(" bands");
    for arrival in value.iter().take(if different { value.len() } else { 1 }) {
        for gain in arrival.bands.unwrap_or([1.0; BAND_COUNT]) {
            text.push(' ');
            quantity::BAND_GAIN.push(text, gain)?;
        }
    }
    Ok(())
}

fn count_of_arrivals(receivers: &[Output], found: &str) -> String {
    let count = receivers.len();
    let s = if count == 1 { "" } else { "s" };
    if receivers.iter().any(|output| matches!(output, Output::Head { .. })) {
        return format!(
            "expected {count} group{s} of numbers, gain and delay for each channel and gain, delay and place for \
             each head, found {found}"
        );
    }
    format!("expected {count} pair{s} of gain and delay, one for each channel, found {found}")
}
