//! Writing a score: the header, then its lines one by one, each complete in itself.

use std::collections::BTreeMap;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use super::lexer::MAX_LINE_BYTES;
use super::note::{Declared, Note};
use super::rules::{Fault, Rules, Step};
use super::space::{ChannelSpace, LineRef, ObjectSpace, Space};
use super::syntax::{cue_verb, header_lines, push_line};
use super::{Header, Verb};
use crate::{Error, Result, WholeFile};

/// Writes a score line by line, in its canonical form.
///
/// It checks what it writes by the same rules as a [`Reader`](super::Reader), so that what was
/// written without an error reads back, and reads back the same. Memory is taken for the header and
/// for the threads that have started and not ended. Call [`finish`](Self::finish) at the end.
///
/// ```
/// use froufrou::score::{
///     Arrival, ChannelLine, ChannelWriter, Header, Order, Output, Repeat, Sound, Start, Statement, Verb,
/// };
///
/// let header = Header {
///     sounds: vec![Sound::recording("drip", "drip.wav", Repeat::Once, None)],
///     ..Header::new(Order::Time, ["left", "right"].map(|name| Output::Channel(name.into())).to_vec())
/// };
/// let start = Start { cause: "a leak".into(), ..Start::new("drip") };
/// let arrival = Arrival::new;
///
/// let mut writer = ChannelWriter::new(Vec::new(), &header)?;
/// writer.write(&ChannelLine::Thread(Statement {
///     thread: 1,
///     path: 0,
///     time_s: 0.5,
///     verb: Verb::Start(start),
///     value: vec![arrival(0.5, 0.01), arrival(0.25, 0.011)],
/// }))?;
/// let text = String::from_utf8(writer.finish()?)?;
/// assert_eq!(text, r#"froufrou-score 1 channel
/// order time
/// speed-of-sound 343
/// channels left right
/// sound drip "drip.wav"
/// start 1 0.5 drip 0.5 0.01 0.25 0.011 cause "a leak"
/// "#);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Writer<S: Space, W> {
    write: W,
    file: Option<PathBuf>,
    receivers: Vec<S::Receiver>,
    rules: Rules<()>,
    /// The line at hand.
    text: String,
    /// How many lines are written.
    number: usize,
}

/// Writes a score in object space.
pub type ObjectWriter<W> = Writer<ObjectSpace, W>;

/// Writes a score in channel space.
pub type ChannelWriter<W> = Writer<ChannelSpace, W>;

impl<S: Space> Writer<S, BufWriter<WholeFile>> {
    /// Begins a file, which appears with [`Writer::save`], and writes the header; errors will name it.
    ///
    /// # Errors
    /// Where the file cannot be written or the header breaks a rule of the score.
    pub fn create(path: impl AsRef<Path>, header: &Header<S::Receiver>) -> Result<Self> {
        let path = path.as_ref();
        let file = WholeFile::create(path)?;
        Self::begin(BufWriter::new(file), Some(path.into()), header, &BTreeMap::new())
    }

    /// Finishes the score and puts the file in its place.
    ///
    /// # Errors
    /// As [`Writer::finish`], and where the file cannot be put there.
    pub fn save(self) -> Result<()> {
        let path = self.file.clone().unwrap_or_default();
        let file = self.finish()?.into_inner();
        file.map_err(|fault| Error::io("write", &path, fault.into_error()))?.finish()
    }
}

impl<S: Space, W: Write> Writer<S, W> {
    /// Writes the header. Many small pieces are written: give it something with a buffer.
    ///
    /// # Errors
    /// Where writing fails or the header breaks a rule of the score.
    pub fn new(write: W, header: &Header<S::Receiver>) -> Result<Self> {
        Self::begin(write, None, header, &BTreeMap::new())
    }

    /// Writes the header and the comments in it.
    pub(super) fn begin(
        write: W,
        file: Option<PathBuf>,
        header: &Header<S::Receiver>,
        notes: &BTreeMap<Declared, Note>,
    ) -> Result<Self> {
        let mut writer = Self {
            write,
            file,
            receivers: header.receivers.clone(),
            rules: Rules::new(!S::RECEIVER_VERBS.is_empty()),
            text: String::new(),
            number: 0,
        };
        match writer.write_header(header, notes) {
            Ok(()) => Ok(writer),
            Err(error) => Err(writer.in_file(error)),
        }
    }

    fn write_header(&mut self, header: &Header<S::Receiver>, notes: &BTreeMap<Declared, Note>) -> Result<()> {
        let unplaced = |fault: Fault| *fault.error;
        for sound in &header.sounds {
            self.rules.declare_sound(sound).map_err(unplaced)?;
        }
        for pattern in &header.patterns {
            self.rules.declare_pattern(pattern).map_err(unplaced)?;
        }
        for receiver in &header.receivers {
            let stands = S::receiver_stands(receiver);
            for name in S::receiver_names(receiver) {
                self.rules.declare_receiver(0, name, stands).map_err(unplaced)?;
            }
        }
        self.rules.begin(header.order, header.duration_s.is_some()).map_err(unplaced)?;

        let mut notes = notes.clone();
        for (declared, text) in header_lines::<S>(header)? {
            self.text = text;
            self.put(&notes.remove(&declared).unwrap_or_default())?;
        }
        // Comments on what the header no longer has.
        for note in notes.into_values() {
            for comment in note.all() {
                self.put_comment(comment)?;
            }
        }
        Ok(())
    }

    /// Writes a line.
    ///
    /// # Errors
    /// Where writing fails or the line breaks a rule of the score; of a line refused nothing is
    /// written, but the score cannot go on after it.
    pub fn write(&mut self, line: &S::Line) -> Result<()> {
        self.write_with(&Note::default(), line)
    }

    /// Writes a line and the comments around it.
    pub(super) fn write_with(&mut self, note: &Note, line: &S::Line) -> Result<()> {
        self.put_line(note, line).map_err(|error| self.in_file(error))
    }

    fn put_line(&mut self, note: &Note, line: &S::Line) -> Result<()> {
        check_line::<S>(line, &mut self.rules, self.number + note.above().len() + 1)?;
        self.text.clear();
        push_line::<S>(&mut self.text, line, &self.receivers)?;
        self.put(note)
    }

    /// Writes a comment of one or more lines.
    ///
    /// # Errors
    /// Where writing fails or a line is too long.
    ///
    /// ```
    /// # use froufrou::score::{ChannelWriter, Header, Order, Output};
    /// # let header = Header::new(Order::Time, vec![Output::Channel("main".into())]);
    /// let mut writer = ChannelWriter::new(Vec::new(), &header)?;
    /// writer.comment("the second scene")?;
    /// assert!(writer.finish()?.ends_with(b"\n# the second scene\n"));
    /// # Ok::<(), froufrou::Error>(())
    /// ```
    pub fn comment(&mut self, text: &str) -> Result<()> {
        for line in text.lines() {
            let comment = format!("# {line}");
            self.put_comment(comment.trim_end()).map_err(|error| self.in_file(error))?;
        }
        Ok(())
    }

    /// Writes a line that is a comment or empty.
    pub(super) fn put_comment(&mut self, comment: &str) -> Result<()> {
        self.text.clear();
        self.text.push_str(comment);
        self.put_text()
    }

    /// Ends the score, flushes and gives back what was written to.
    ///
    /// # Errors
    /// Where writing fails or the score breaks a rule as a whole, such as a loop that never ends.
    pub fn finish(mut self) -> Result<W> {
        match self.rules.finish() {
            Ok(()) => {}
            Err(fault) => return Err(self.in_file(*fault.error)),
        }
        match self.write.flush() {
            Ok(()) => Ok(self.write),
            Err(error) => Err(self.in_file(cannot_write(error))),
        }
    }

    /// Writes the line at hand with the comments around it.
    fn put(&mut self, note: &Note) -> Result<()> {
        let text = std::mem::take(&mut self.text);
        for comment in note.above() {
            self.put_comment(comment)?;
        }
        self.text = text;
        if let Some(comment) = note.beside() {
            self.text.push(' ');
            self.text.push_str(comment);
        }
        self.put_text()
    }

    /// Writes the line at hand.
    fn put_text(&mut self) -> Result<()> {
        if self.text.len() > MAX_LINE_BYTES {
            return Err(Error::new(format!(
                "a line of {} bytes is longer than {MAX_LINE_BYTES}, the most a score may have",
                self.text.len()
            )));
        }
        self.text.push('\n');
        self.number += 1;
        self.write.write_all(self.text.as_bytes()).map_err(cannot_write)
    }

    fn in_file(&self, error: Error) -> Error {
        match &self.file {
            Some(file) => error.in_file(file),
            None => error,
        }
    }
}

fn cannot_write(error: std::io::Error) -> Error {
    Error::new(format!("cannot write the score: {error}")).because(error)
}

/// The rules' view of a line that is in memory already.
fn check_line<S: Space>(line: &S::Line, rules: &mut Rules<()>, number: usize) -> Result<()> {
    let unplaced = |fault: Fault| *fault.error;
    match S::of_line(line) {
        LineRef::Thread(statement) => {
            let step = match &statement.verb {
                Verb::Start(start) => Step::Start { sound: &start.sound },
                Verb::Path => Step::Path,
                Verb::Key => Step::Key,
                Verb::Jump => Step::Jump,
                Verb::End => Step::End,
            };
            let of = (statement.thread, statement.path);
            let slot = rules.thread(step, of, statement.time_s, number).map_err(unplaced)?;
            if let Verb::Start(start) = &statement.verb {
                slot.has_pattern(&start.pattern)?;
                if start.speed != 1.0 || start.offset_s.to_bits() != 0 {
                    slot.plays_recording(if start.speed == 1.0 { "offset" } else { "speed" })?;
                }
            }
            slot.keep(&());
        }
        LineRef::Cue(cue) => rules.cue(cue_verb(&cue.action), cue.thread, cue.time_s).map_err(unplaced)?,
        LineRef::Microphone(key) => {
            let heard = rules.hear(key.microphone, key.time_s, key.cut).map_err(unplaced)?;
            heard.last = Some(*key);
        }
    }
    Ok(())
}
