//! A whole score in memory with its comments: to edit, sort and write it again.

use std::collections::BTreeMap;
use std::io::{BufRead, Write};
use std::path::Path;

use super::note::{Declared, Note, Noted};
use super::read::{Reader, open_file};
use super::sort::compare;
use super::space::{ChannelSpace, ObjectSpace, Space};
use super::write::Writer;
use super::{Header, Order};
use crate::{Error, Result};

/// A whole score in memory, comments and all.
///
/// Writing it gives its canonical form: one space between words, every value spelled out, the
/// declarations in a fixed order, the comments where they were. What is in canonical form already
/// comes out byte for byte.
///
/// ```
/// use froufrou::score::{ChannelDocument, Order};
///
/// let text = r#"froufrou-score 1 channel
/// channels main
/// sound drip "drip.wav"
///
/// start 1 2.5 drip  0.5 0.01   # the second drop
/// start 2 0.5 drip  0.5 0.01   # the first drop
/// "#;
/// let mut score = ChannelDocument::read(text.as_bytes())?;
/// score.sort(Order::Time);
/// assert_eq!(score.to_text()?, r#"froufrou-score 1 channel
/// order time
/// speed-of-sound 343
/// channels main
/// sound drip "drip.wav"
/// start 2 0.5 drip 0.5 0.01 # the first drop
///
/// start 1 2.5 drip 0.5 0.01 # the second drop
/// "#);
/// # Ok::<(), froufrou::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Document<S: Space> {
    /// What the lines rest on.
    pub header: Header<S::Receiver>,
    /// The lines, each with its comments.
    pub lines: Vec<Noted<S::Line>>,
    header_notes: BTreeMap<Declared, Note>,
    /// The comments after the last line.
    tail: Note,
}

/// A whole score in object space.
pub type ObjectDocument = Document<ObjectSpace>;

/// A whole score in channel space.
pub type ChannelDocument = Document<ChannelSpace>;

impl<S: Space> Document<S> {
    /// A score without comments.
    pub fn new(header: Header<S::Receiver>, lines: impl IntoIterator<Item = S::Line>) -> Self {
        let lines = lines.into_iter().map(Noted::from).collect();
        Self { header, lines, header_notes: BTreeMap::new(), tail: Note::default() }
    }

    /// Reads a whole score.
    ///
    /// # Errors
    /// Where the text is no score in this space, or is faulty.
    pub fn read(read: impl BufRead) -> Result<Self> {
        Self::collect(Reader::with_notes(read, None)?)
    }

    /// Reads a file; errors name it.
    ///
    /// # Errors
    /// Where the file cannot be read, is no score in this space, or is faulty.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let (read, path) = open_file(path.as_ref())?;
        Self::collect(Reader::with_notes(read, Some(path))?)
    }

    pub(super) fn collect(mut reader: Reader<S, impl BufRead>) -> Result<Self> {
        let header_notes = reader.take_header_notes();
        let mut lines = Vec::new();
        while let Some(line) = reader.next() {
            lines.push(Noted { line: line?, note: reader.take_note() });
        }
        let tail = reader.take_note();
        Ok(Self { header: reader.header().clone(), lines, header_notes, tail })
    }

    /// Sorts the lines and says so in the header. The comments above and beside a line go with it;
    /// lines that may stand in either order stay as they are (see [`compare`]). With
    /// [`Order::Free`] the lines stay and the header no longer promises an order.
    pub fn sort(&mut self, order: Order) {
        self.lines.sort_by(|a, b| compare::<S>(&a.line, &b.line, order));
        self.header.order = order;
    }

    /// Writes the score in its canonical form, and gives back what was written to.
    ///
    /// # Errors
    /// Where writing fails or the score breaks a rule.
    pub fn write<W: Write>(&self, write: W) -> Result<W> {
        let mut writer = Writer::<S, W>::begin(write, None, &self.header, &self.header_notes)?;
        for Noted { note, line } in &self.lines {
            writer.write_with(note, line)?;
        }
        for comment in self.tail.all() {
            writer.put_comment(comment)?;
        }
        writer.finish()
    }

    /// The score's text in its canonical form.
    ///
    /// # Errors
    /// Where the score breaks a rule.
    pub fn to_text(&self) -> Result<String> {
        String::from_utf8(self.write(Vec::new())?)
            .map_err(|error| Error::new("the score is not text").because(error))
    }
}
