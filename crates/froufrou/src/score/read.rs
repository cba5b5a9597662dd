//! Reading a score: the header first, then its lines one by one, in little memory.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use super::document::{Declared, Note};
use super::lexer::{Lines, Words, shown};
use super::rules::{Fault, Rules, Step};
use super::space::{self, ChannelSpace, LineRef, ObjectSpace, Space, once, rank};
use super::{Header, MicrophoneKey, Order, Repeat, Sound, Start, Statement, Verb, quantity};
use crate::{Error, Place, Result};

/// The version of the text that this library writes, and the newest that it reads.
pub const VERSION: u32 = 1;

const MAGIC: &str = "froufrou-score";
const SPACES: [&str; 2] = [ObjectSpace::NAME, ChannelSpace::NAME];
const DECLARATIONS: [&str; 4] = ["order", "speed-of-sound", "duration", "sound"];
const THREAD_VERBS: [&str; 4] = ["start", "key", "jump", "end"];
const START_CLAUSES: [&str; 4] = ["speed", "offset", "object", "cause"];

/// Reads a score line by line: an iterator over the lines after the header, in the order of the
/// text.
///
/// It checks the score as it reads. Memory is taken for the header and for the threads that have
/// started and not ended, however long the score is. After an error it gives nothing more.
///
/// ```
/// use froufrou::score::{ObjectLine, ObjectReader};
///
/// let text = r#"froufrou-score 1 object
/// sound drip "drip.wav"
/// microphone main omni
/// hear main 0 at 0 1.6 0
/// start 1 0.5 drip at 2 0 -3
/// "#;
/// let reader = ObjectReader::new(text.as_bytes())?;
/// assert_eq!(reader.header().speed_of_sound_mps, 343.0);
/// let lines: Vec<ObjectLine> = reader.collect::<froufrou::Result<_>>()?;
/// let ObjectLine::Thread(start) = &lines[1] else { panic!("a thread's line") };
/// assert_eq!((start.thread, start.time_s, start.value.gain), (1, 0.5, 1.0));
/// # Ok::<(), froufrou::Error>(())
/// ```
#[derive(Debug)]
pub struct Reader<S: Space, R> {
    lines: Lines<R>,
    file: Option<PathBuf>,
    header: Header<S::Receiver>,
    rules: Rules<S::Value>,
    /// The comments around the next line, where somebody wants them.
    note: Option<Note>,
    header_notes: BTreeMap<Declared, Note>,
    done: bool,
}

/// Reads a score in object space.
pub type ObjectReader<R> = Reader<ObjectSpace, R>;

/// Reads a score in channel space.
pub type ChannelReader<R> = Reader<ChannelSpace, R>;

impl<S: Space> Reader<S, BufReader<File>> {
    /// Opens a file and reads its header; errors will name the file.
    ///
    /// # Errors
    /// Where the file cannot be read or is no score in this space.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let (read, path) = open(path.as_ref())?;
        Self::begin(First::read(read, Some(path), false)?)
    }
}

fn open(path: &Path) -> Result<(BufReader<File>, PathBuf)> {
    let file = File::open(path).map_err(|error| Error::io("open", path, error))?;
    Ok((BufReader::new(file), path.into()))
}

impl<S: Space, R: BufRead> Reader<S, R> {
    /// Reads the header.
    ///
    /// # Errors
    /// Where the text is no score in this space, or its header is faulty.
    pub fn new(read: R) -> Result<Self> {
        Self::begin(First::read(read, None, false)?)
    }

    /// Reads the header and keeps comments.
    pub(super) fn with_notes(read: R, file: Option<PathBuf>) -> Result<Self> {
        Self::begin(First::read(read, file, true)?)
    }

    fn begin(first: First<R>) -> Result<Self> {
        if first.space != S::NAME {
            let what = format!("this score is in {} space, expected one in {} space", first.space, S::NAME);
            let error = Error::new(what).at(Place::Line { line: 1, column: 0 });
            return Err(in_file(error, first.file.as_deref()));
        }
        let mut reader = Self {
            lines: first.lines,
            file: first.file,
            header: Header {
                speed_of_sound_mps: 343.0,
                duration_s: None,
                order: Order::Free,
                sounds: Vec::new(),
                receivers: Vec::new(),
            },
            rules: Rules::new(!S::RECEIVER_VERBS.is_empty()),
            note: first.note.as_ref().map(|_| Note::default()),
            header_notes: first.note.into_iter().map(|note| (Declared::FirstLine, note)).collect(),
            done: false,
        };
        match reader.read_header() {
            Ok(()) => Ok(reader),
            Err(error) => Err(in_file(error, reader.file.as_deref())),
        }
    }

    /// What the lines rest on.
    pub fn header(&self) -> &Header<S::Receiver> {
        &self.header
    }

    /// The number of the line that was read last, from 1.
    pub fn line_number(&self) -> usize {
        self.lines.number()
    }

    /// The lines sorted by time, as a mixer wants them.
    ///
    /// A score with `order time` is read as it is needed, in bounded memory. Any other is read whole
    /// and sorted first, which takes memory in proportion to its length.
    ///
    /// # Errors
    /// Where a score that has to be read whole is faulty.
    ///
    /// ```
    /// use froufrou::score::ChannelReader;
    ///
    /// let text = r#"froufrou-score 1 channel
    /// channels main
    /// sound drip "drip.wav"
    /// start 1 2.5 drip 0.5 0.01
    /// start 2 0.5 drip 0.5 0.01
    /// "#;
    /// let lines = ChannelReader::new(text.as_bytes())?.by_time()?;
    /// let threads: Vec<u64> = lines.map(|line| line.map(|line| line.thread)).collect::<Result<_, _>>()?;
    /// assert_eq!(threads, [2, 1]);
    /// # Ok::<(), froufrou::Error>(())
    /// ```
    pub fn by_time(mut self) -> Result<ByTime<S, R>> {
        let mut header = self.header.clone();
        if header.order == Order::Time {
            return Ok(ByTime { header, lines: LinesByTime::Streamed(Box::new(self)) });
        }
        let mut lines = self.by_ref().collect::<Result<Vec<_>>>()?;
        lines.sort_by(|a, b| compare::<S>(a, b, Order::Time));
        header.order = Order::Time;
        Ok(ByTime { header, lines: LinesByTime::Sorted(lines.into_iter()) })
    }

    /// Takes the comments around the line read last.
    pub(super) fn take_note(&mut self) -> Note {
        self.note.as_mut().map(std::mem::take).unwrap_or_default()
    }

    pub(super) fn take_header_notes(&mut self) -> BTreeMap<Declared, Note> {
        std::mem::take(&mut self.header_notes)
    }

    fn read_header(&mut self) -> Result<()> {
        let Self { lines, header, rules, note, header_notes, .. } = self;
        let mut given = Given::default();
        loop {
            let Some(mut words) = lines.next()? else { break };
            let Some(keyword) = words.keyword("a keyword")? else {
                keep_above(note, &mut words);
                continue;
            };
            let declared = match keyword {
                "order" => {
                    let expected = "`time` or `thread`";
                    let order = match words.keyword_here(expected)? {
                        "time" => Order::Time,
                        "thread" => Order::Thread,
                        other => {
                            return Err(words.unknown("order", other, ["time", "thread"], expected));
                        }
                    };
                    once(&mut given.order, keyword, &words, order)?;
                    Declared::Order
                }
                "speed-of-sound" => {
                    let speed_mps = words.number_of(quantity::SPEED_OF_SOUND)?;
                    once(&mut given.speed_of_sound_mps, keyword, &words, speed_mps)?;
                    Declared::SpeedOfSound
                }
                "duration" => {
                    let duration_s = words.number_of(quantity::DURATION)?;
                    once(&mut header.duration_s, keyword, &words, duration_s)?;
                    Declared::Duration
                }
                "sound" => {
                    let sound = read_sound(&mut words)?;
                    rules.declare_sound(&sound).map_err(|fault| place(&words, fault))?;
                    header.sounds.push(sound);
                    Declared::Sound(header.sounds.len() - 1)
                }
                _ if keyword == S::RECEIVER_KEYWORD => {
                    let index = header.receivers.len();
                    S::read_receivers(&mut words, &mut header.receivers)?;
                    for receiver in header.receivers.iter().skip(index) {
                        rules
                            .declare_receiver(S::receiver_name(receiver))
                            .map_err(|fault| place(&words, fault))?;
                    }
                    Declared::Receiver(index)
                }
                _ if is_verb::<S>(keyword) => {
                    lines.give_again();
                    break;
                }
                _ => return Err(unknown_keyword::<S>(&words, keyword)),
            };
            words.end()?;
            if let Some(note) = note {
                note.set_beside(words.comment());
                header_notes.insert(declared, std::mem::take(note));
            }
        }
        header.order = given.order.unwrap_or(Order::Free);
        header.speed_of_sound_mps = given.speed_of_sound_mps.unwrap_or(header.speed_of_sound_mps);
        let place = Place::Line { line: lines.number(), column: 0 };
        rules.begin(header.order, header.duration_s.is_some()).map_err(|fault| fault.error.at(place))
    }

    fn read_line(&mut self) -> Result<Option<S::Line>> {
        let Self { lines, header, rules, note, .. } = self;
        loop {
            let Some(mut words) = lines.next()? else {
                rules.finish().map_err(|fault| *fault.error)?;
                return Ok(None);
            };
            let Some(keyword) = words.keyword("a keyword")? else {
                keep_above(note, &mut words);
                continue;
            };
            let line = if THREAD_VERBS.contains(&keyword) {
                read_statement::<S>(keyword, &mut words, header, rules)?
            } else if S::RECEIVER_VERBS.contains(&keyword) {
                let key = read_microphone_key(keyword == "cut", &mut words, rules)?;
                // Only spaces whose receivers have verbs come here, and those have such lines.
                S::microphone_line(key).ok_or_else(|| unknown_keyword::<S>(&words, keyword))?
            } else {
                return Err(unknown_keyword::<S>(&words, keyword));
            };
            if let Some(note) = note {
                note.set_beside(words.comment());
            }
            return Ok(Some(line));
        }
    }
}

impl<S: Space, R: BufRead> Iterator for Reader<S, R> {
    type Item = Result<S::Line>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.done {
            return None;
        }
        let line = self.read_line().map_err(|error| in_file(error, self.file.as_deref())).transpose();
        self.done = !matches!(line, Some(Ok(_)));
        line
    }
}

/// What the header says at most once and that has a default.
#[derive(Default)]
struct Given {
    order: Option<Order>,
    speed_of_sound_mps: Option<f64>,
}

/// The order of two lines in a sorted score; lines that compare equal keep theirs. It lets a
/// producer sort what it is about to write.
///
/// By time, a microphone's line comes before a thread's of the same time, and a thread's line before
/// that of a thread with a higher number. By thread, the microphones come first, in the order of
/// their declaration. With [`Order::Free`] all are equal.
///
/// ```
/// use froufrou::score::{ChannelSpace, Order, Statement, Verb, compare};
///
/// let line = |thread, time_s| Statement { thread, time_s, verb: Verb::Key, value: vec![] };
/// let mut lines = [line(2, 1.0), line(1, 1.0), line(3, 0.5)];
/// lines.sort_by(|a, b| compare::<ChannelSpace>(a, b, Order::Time));
/// assert_eq!(lines.map(|line| line.thread), [3, 1, 2]);
/// ```
pub fn compare<S: Space>(a: &S::Line, b: &S::Line, order: Order) -> std::cmp::Ordering {
    rank::<S>(a).cmp(&rank::<S>(b), order)
}

/// The lines of a score sorted by time: see [`Reader::by_time`].
#[derive(Debug)]
pub struct ByTime<S: Space, R> {
    header: Header<S::Receiver>,
    lines: LinesByTime<S, R>,
}

#[derive(Debug)]
enum LinesByTime<S: Space, R> {
    Streamed(Box<Reader<S, R>>),
    Sorted(std::vec::IntoIter<S::Line>),
}

impl<S: Space, R> ByTime<S, R> {
    /// What the lines rest on; its order is [`Order::Time`], whatever the text says.
    pub fn header(&self) -> &Header<S::Receiver> {
        &self.header
    }
}

impl<S: Space, R: BufRead> Iterator for ByTime<S, R> {
    type Item = Result<S::Line>;

    fn next(&mut self) -> Option<Self::Item> {
        match &mut self.lines {
            LinesByTime::Streamed(reader) => reader.next(),
            LinesByTime::Sorted(lines) => lines.next().map(Ok),
        }
    }
}

/// Something in either of the two spaces.
#[derive(Debug, Clone, PartialEq)]
pub enum AnySpace<O, C> {
    /// It is in object space.
    Object(O),
    /// It is in channel space.
    Channel(C),
}

/// A reader of a score whose first line tells its space.
///
/// ```
/// use froufrou::score::{AnyReader, AnySpace};
///
/// let text = "froufrou-score 1 channel\nchannels left right\n";
/// match AnyReader::new(text.as_bytes())? {
///     AnySpace::Channel(reader) => assert_eq!(reader.header().receivers, ["left", "right"]),
///     AnySpace::Object(_) => unreachable!("the first line says otherwise"),
/// }
/// # Ok::<(), froufrou::Error>(())
/// ```
pub type AnyReader<R> = AnySpace<ObjectReader<R>, ChannelReader<R>>;

impl AnyReader<BufReader<File>> {
    /// Opens a file and reads its header; errors will name the file.
    ///
    /// # Errors
    /// Where the file cannot be read or is no score.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let (read, path) = open(path.as_ref())?;
        Self::begin(First::read(read, Some(path), false)?)
    }
}

impl<R: BufRead> AnyReader<R> {
    /// Reads the header.
    ///
    /// # Errors
    /// Where the text is no score, or its header is faulty.
    pub fn new(read: R) -> Result<Self> {
        Self::begin(First::read(read, None, false)?)
    }

    pub(super) fn with_notes(read: R, file: Option<PathBuf>) -> Result<Self> {
        Self::begin(First::read(read, file, true)?)
    }

    fn begin(first: First<R>) -> Result<Self> {
        Ok(match first.space == ObjectSpace::NAME {
            true => Self::Object(Reader::begin(first)?),
            false => Self::Channel(Reader::begin(first)?),
        })
    }
}

/// A score of which the first line is read.
struct First<R> {
    lines: Lines<R>,
    file: Option<PathBuf>,
    space: &'static str,
    note: Option<Note>,
}

impl<R: BufRead> First<R> {
    fn read(read: R, file: Option<PathBuf>, notes: bool) -> Result<Self> {
        let mut lines = Lines::new(read);
        let mut note = notes.then(Note::default);
        match read_first_line(&mut lines, &mut note) {
            Ok(space) => Ok(Self { lines, file, space, note }),
            Err(error) => Err(in_file(error, file.as_deref())),
        }
    }
}

fn read_first_line<R: BufRead>(lines: &mut Lines<R>, note: &mut Option<Note>) -> Result<&'static str> {
    let no_score = "this is no froufrou score";
    let help = format!("its first line must be `{MAGIC} {VERSION} object` or `{MAGIC} {VERSION} channel`");
    let Some(mut words) = lines.next()? else {
        let place = Place::Line { line: 1, column: 0 };
        return Err(Error::new(format!("{no_score}, it is empty")).at(place).help(help));
    };
    match words.keyword(MAGIC)? {
        Some(MAGIC) => {}
        Some(other) => {
            return Err(words.fault(format!("{no_score}, it begins with {}", shown(other))).help(help));
        }
        None => return Err(words.fault(no_score).help(help)),
    }
    let version: u32 = words.whole("the version")?;
    if version != VERSION {
        let newer = if version > VERSION { ": a newer froufrou wrote it" } else { "" };
        return Err(words.fault(format!("found a score of version {version}, expected {VERSION}{newer}")));
    }
    let expected = "`object` or `channel`";
    let found = words.keyword_here(expected)?;
    let space = SPACES
        .into_iter()
        .find(|&space| space == found)
        .ok_or_else(|| words.unknown("space", found, SPACES, expected))?;
    words.end()?;
    if let Some(note) = note {
        note.set_beside(words.comment());
    }
    Ok(space)
}

/// Keeps a line that holds a comment or nothing.
fn keep_above(note: &mut Option<Note>, words: &mut Words<'_>) {
    if let Some(note) = note {
        note.push_above(words.comment());
    }
}

fn in_file(error: Error, file: Option<&Path>) -> Error {
    match file {
        Some(file) => error.in_file(file),
        None => error,
    }
}

fn place(words: &Words<'_>, fault: Fault) -> Error {
    words.place_at_word(fault.word, *fault.error)
}

fn is_verb<S: Space>(keyword: &str) -> bool {
    THREAD_VERBS.contains(&keyword) || S::RECEIVER_VERBS.contains(&keyword)
}

/// A line begins with a word that cannot begin one here.
fn unknown_keyword<S: Space>(words: &Words<'_>, keyword: &str) -> Error {
    if DECLARATIONS.contains(&keyword) || keyword == S::RECEIVER_KEYWORD {
        return words
            .fault(format!("`{keyword}` stands after the first line of a thread or microphone"))
            .help("move it up into the header, before all those lines");
    }
    let in_object =
        ObjectSpace::RECEIVER_KEYWORD == keyword || ObjectSpace::RECEIVER_VERBS.contains(&keyword);
    for (belongs, space) in
        [(in_object, ObjectSpace::NAME), (keyword == ChannelSpace::RECEIVER_KEYWORD, ChannelSpace::NAME)]
    {
        if belongs {
            let what = format!(
                "`{keyword}` belongs into a score in {space} space, this one is in {} space",
                S::NAME
            );
            return words.fault(what);
        }
    }
    let known = [S::RECEIVER_KEYWORD].into_iter().chain(DECLARATIONS).chain(THREAD_VERBS);
    let known = known.chain(S::RECEIVER_VERBS.iter().copied());
    words.unknown("keyword", keyword, known, "a declaration or a line of a thread")
}

/// Reads what follows `sound`.
fn read_sound(words: &mut Words<'_>) -> Result<Sound> {
    let name = words.name("the sound's name")?.into_owned();
    let recording = words.name("the path of the recording")?.into_owned();
    let (mut repeat, mut channel) = (None, None);
    let expected = "`once`, `loop`, `loop exact` or `channel N`";
    let mut may_be_exact = false;
    while let Some(keyword) = words.keyword(expected)? {
        match keyword {
            "exact" if may_be_exact => repeat = Some(Repeat::ExactLoop),
            "once" => once(&mut repeat, "once or loop", words, Repeat::Once)?,
            "loop" => once(&mut repeat, "once or loop", words, Repeat::Loop)?,
            "channel" => {
                let index = words.whole("the channel of the recording")?;
                once(&mut channel, keyword, words, index)?;
            }
            other => {
                return Err(words.unknown("word", other, ["once", "loop", "channel"], expected));
            }
        }
        may_be_exact = keyword == "loop";
    }
    Ok(Sound { name, recording, repeat: repeat.unwrap_or(Repeat::Once), channel })
}

/// Reads what follows the verb of a thread's line.
fn read_statement<S: Space>(
    verb: &str,
    words: &mut Words<'_>,
    header: &Header<S::Receiver>,
    rules: &mut Rules<S::Value>,
) -> Result<S::Line> {
    let thread = words.whole("the thread's number")?;
    let time_s = words.number_of(quantity::TIME)?;
    let sound = match verb {
        "start" => words.name("the sound's name")?,
        _ => Cow::Borrowed(""),
    };
    let step = match verb {
        "start" => Step::Start { sound: &sound },
        "jump" => Step::Jump,
        "end" => Step::End,
        _ => Step::Key,
    };
    let slot = rules.thread(step, thread, time_s, words.number()).map_err(|fault| place(words, fault))?;

    let mut draft = S::Draft::default();
    S::read_plain(words, &header.receivers, &mut draft)?;
    let starts = matches!(step, Step::Start { .. });
    let (mut speed, mut offset_s, mut object, mut cause) = (None, None, None, None);
    while let Some(keyword) = words.keyword("a keyword")? {
        match keyword {
            "speed" if starts => {
                let number = words.number_of(quantity::PLAYBACK_SPEED)?;
                once(&mut speed, keyword, words, number)?;
            }
            "offset" if starts => {
                let number = words.number_of(quantity::OFFSET)?;
                once(&mut offset_s, keyword, words, number)?;
            }
            "object" if starts => {
                let name = words.name("the object's name")?;
                once(&mut object, keyword, words, name)?;
            }
            "cause" if starts => {
                let text = words.name("the cause, in quotes")?;
                once(&mut cause, keyword, words, text)?;
            }
            _ if START_CLAUSES.contains(&keyword) => {
                return Err(words.fault(format!("`{keyword}` belongs on the thread's `start` line")));
            }
            _ if S::read_clause(keyword, words, &mut draft)? => {}
            _ => {
                let more: &[&str] = if starts { &START_CLAUSES } else { &[] };
                let known = S::CLAUSES.iter().chain(more);
                let expected: Vec<String> = known.clone().map(|word| format!("`{word}`")).collect();
                let expected = match expected.as_slice() {
                    [] => "the end of the line".into(),
                    [before @ .., last] if !before.is_empty() => {
                        format!("{} or {last}", before.join(", "))
                    }
                    only => only.concat(),
                };
                return Err(words.unknown("word", keyword, known.copied(), &expected));
            }
        }
    }
    let value = S::value(draft, slot.before()).map_err(|error| words.place(error))?;
    slot.keep(&value);
    let verb = match step {
        Step::Start { .. } => Verb::Start(Start {
            sound: sound.into_owned(),
            speed: speed.unwrap_or(1.0),
            offset_s: offset_s.unwrap_or(0.0),
            object: object.unwrap_or_default().into_owned(),
            cause: cause.unwrap_or_default().into_owned(),
        }),
        Step::Key => Verb::Key,
        Step::Jump => Verb::Jump,
        Step::End => Verb::End,
    };
    Ok(S::thread_line(Statement { thread, time_s, verb, value }))
}

/// Reads what follows `hear` or `cut`.
fn read_microphone_key<V>(cut: bool, words: &mut Words<'_>, rules: &mut Rules<V>) -> Result<MicrophoneKey> {
    let name = words.name("the microphone's name")?;
    let time_s = words.number_of(quantity::TIME)?;
    let microphone = rules.microphone(&name).map_err(|fault| place(words, fault))?;
    let heard = rules.hear(microphone, time_s, cut).map_err(|fault| place(words, fault))?;
    let (position_m, facing) = space::read_whereabouts(words, heard.last.as_ref())?;
    let key = MicrophoneKey { microphone, time_s, position_m, facing, cut };
    heard.last = Some(key);
    Ok(key)
}

/// The rules' view of a line that is in memory already.
pub(super) fn check_line<S: Space>(line: &S::Line, rules: &mut Rules<()>, number: usize) -> Result<()> {
    let unplaced = |fault: Fault| *fault.error;
    match S::of_line(line) {
        LineRef::Thread(statement) => {
            let step = match &statement.verb {
                Verb::Start(start) => Step::Start { sound: &start.sound },
                Verb::Key => Step::Key,
                Verb::Jump => Step::Jump,
                Verb::End => Step::End,
            };
            let slot = rules.thread(step, statement.thread, statement.time_s, number).map_err(unplaced)?;
            slot.keep(&());
        }
        LineRef::Microphone(key) => {
            let heard = rules.hear(key.microphone, key.time_s, key.cut).map_err(unplaced)?;
            heard.last = Some(*key);
        }
    }
    Ok(())
}
