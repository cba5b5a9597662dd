//! A score whose space is not known before its first line is read.

use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

use super::Order;
use super::document::{ChannelDocument, Document, ObjectDocument};
use super::read::{ChannelReader, First, ObjectReader, Reader, open_file};
use super::space::{ObjectSpace, Space};
use crate::Result;

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
///     AnySpace::Channel(reader) => assert_eq!(reader.header().channels(), ["left", "right"]),
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
        let (read, path) = open_file(path.as_ref())?;
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

/// A whole score of which the first line tells the space.
///
/// ```
/// use froufrou::score::{AnyDocument, Order};
///
/// let text = "froufrou-score 1 object\nmicrophone main\n";
/// let mut score = AnyDocument::read(text.as_bytes())?;
/// score.sort(Order::Thread);
/// assert_eq!(
///     score.to_text()?,
///     "froufrou-score 1 object\norder thread\nspeed-of-sound 343\nmicrophone main omni\n"
/// );
/// # Ok::<(), froufrou::Error>(())
/// ```
pub type AnyDocument = AnySpace<ObjectDocument, ChannelDocument>;

impl AnyDocument {
    /// Reads a whole score.
    ///
    /// # Errors
    /// Where the text is no score, or is faulty.
    pub fn read(read: impl BufRead) -> Result<Self> {
        Self::collect(AnyReader::with_notes(read, None)?)
    }

    /// Reads a file; errors name it.
    ///
    /// # Errors
    /// Where the file cannot be read, is no score, or is faulty.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let (read, path) = open_file(path.as_ref())?;
        Self::collect(AnyReader::with_notes(read, Some(path))?)
    }

    fn collect(reader: AnyReader<impl BufRead>) -> Result<Self> {
        Ok(match reader {
            AnySpace::Object(reader) => Self::Object(Document::collect(reader)?),
            AnySpace::Channel(reader) => Self::Channel(Document::collect(reader)?),
        })
    }

    /// Sorts the lines, as [`Document::sort`].
    pub fn sort(&mut self, order: Order) {
        match self {
            Self::Object(score) => score.sort(order),
            Self::Channel(score) => score.sort(order),
        }
    }

    /// Writes the score, as [`Document::write`].
    ///
    /// # Errors
    /// Where writing fails or the score breaks a rule.
    pub fn write<W: Write>(&self, write: W) -> Result<W> {
        match self {
            Self::Object(score) => score.write(write),
            Self::Channel(score) => score.write(write),
        }
    }

    /// The score's text, as [`Document::to_text`].
    ///
    /// # Errors
    /// Where the score breaks a rule.
    pub fn to_text(&self) -> Result<String> {
        match self {
            Self::Object(score) => score.to_text(),
            Self::Channel(score) => score.to_text(),
        }
    }
}
