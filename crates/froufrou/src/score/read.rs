//! Reading a score: the header first, then its lines one by one, in little memory.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use super::lexer::{Lines, Words};
use super::note::{Declared, Note};
use super::rules::Rules;
use super::space::{ChannelSpace, ObjectSpace, Space, once};
use super::syntax::{
    is_cue_verb, is_thread_verb, is_verb, place, read_cue, read_first_line, read_microphone_key, read_mode,
    read_pattern, read_sound, read_statement, unknown_keyword,
};
use super::{Header, Make, Order, quantity};
use crate::{Error, Place, Result};

/// Reads a score line by line: an iterator over the lines after the header, in the order of the
/// text.
///
/// It checks the score as it reads. Memory is taken for the header and for the threads that have
/// started and not ended, however long the score is, as long as the threads' numbers count up without
/// gaps (each gap takes a little). After an error it gives nothing more.
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
        let (read, path) = open_file(path.as_ref())?;
        Self::begin(First::read(read, Some(path), false)?)
    }
}

pub(super) fn open_file(path: &Path) -> Result<(BufReader<File>, PathBuf)> {
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

    pub(super) fn begin(first: First<R>) -> Result<Self> {
        if first.space != S::NAME {
            let what = format!("this score is in {} space, expected one in {} space", first.space, S::NAME);
            let error = Error::new(what).at(Place::Line { line: 1, column: 0 });
            return Err(in_file(error, first.file.as_deref()));
        }
        let mut reader = Self {
            lines: first.lines,
            file: first.file,
            header: Header::new(Order::Free, Vec::new()),
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
                "mode" => {
                    let (name, mode) = read_mode(&mut words)?;
                    let index = header.sounds.iter().position(|sound| sound.name == name);
                    let made = index.and_then(|index| Some((index, &mut header.sounds.get_mut(index)?.make)));
                    let Some((index, Make::Modes { modes, .. })) = made else {
                        let what = format!("a mode of `{name}`, which is no sound of `modes` declared above");
                        return Err(words.place_at_word(1, Error::new(what)));
                    };
                    modes.push(mode);
                    Declared::Mode(index, modes.len() - 1)
                }
                "seed" => {
                    let seed = words.whole("the seed")?;
                    once(&mut given.seed, keyword, &words, seed)?;
                    Declared::Seed
                }
                "surroundings" if S::HAS_PLACES => {
                    let scene = words.name("the path of the scene")?.into_owned();
                    once(&mut header.surroundings, keyword, &words, scene)?;
                    Declared::Surroundings
                }
                "pattern" if S::HAS_PLACES => {
                    let pattern = read_pattern(&mut words)?;
                    rules.declare_pattern(&pattern).map_err(|fault| place(&words, fault))?;
                    header.patterns.push(pattern);
                    Declared::Pattern(header.patterns.len() - 1)
                }
                _ if S::RECEIVER_KEYWORDS.contains(&keyword) => {
                    let index = header.receivers.len();
                    S::read_receivers(keyword, &mut words, &mut header.receivers)?;
                    let new = header.receivers.iter().skip(index);
                    let names = new.flat_map(|receiver| {
                        let stands = S::receiver_stands(receiver);
                        S::receiver_names(receiver).iter().map(move |name| (name, stands))
                    });
                    for (number, (name, stands)) in names.enumerate() {
                        rules.declare_receiver(number, name, stands).map_err(|fault| place(&words, fault))?;
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
        header.seed = given.seed.unwrap_or(0);
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
            let line = if is_thread_verb(keyword) {
                read_statement::<S>(keyword, &mut words, header, rules)?
            } else if is_cue_verb(keyword) {
                S::cue_line(read_cue(keyword, &mut words, rules)?)
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
    seed: Option<u64>,
}

/// A score of which the first line is read.
pub(super) struct First<R> {
    lines: Lines<R>,
    file: Option<PathBuf>,
    pub(super) space: &'static str,
    note: Option<Note>,
}

impl<R: BufRead> First<R> {
    pub(super) fn read(read: R, file: Option<PathBuf>, notes: bool) -> Result<Self> {
        let mut lines = Lines::new(read);
        let mut note = notes.then(Note::default);
        match read_first_line(&mut lines, &mut note) {
            Ok(space) => Ok(Self { lines, file, space, note }),
            Err(error) => Err(in_file(error, file.as_deref())),
        }
    }
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
