//! The comments of a score, which go where their line goes.

/// The comments around a line.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Note {
    above: Vec<String>,
    beside: Option<String>,
}

impl Note {
    /// The comment lines and empty lines right above the line. A comment begins with its `#`.
    pub fn above(&self) -> &[String] {
        &self.above
    }

    /// The comment that ends the line, from its `#`.
    pub fn beside(&self) -> Option<&str> {
        self.beside.as_deref()
    }

    pub(super) fn push_above(&mut self, comment: Option<&str>) {
        self.above.push(comment.unwrap_or_default().into());
    }

    pub(super) fn set_beside(&mut self, comment: Option<&str>) {
        self.beside = comment.map(Into::into);
    }

    /// All comments, from top to bottom.
    pub(super) fn all(&self) -> impl Iterator<Item = &str> {
        self.above.iter().map(String::as_str).chain(self.beside())
    }
}

/// A line and the comments around it, which go where it goes.
#[derive(Debug, Clone, PartialEq)]
pub struct Noted<L> {
    /// The comments.
    pub note: Note,
    /// The line.
    pub line: L,
}

impl<L> From<L> for Noted<L> {
    /// A line without comments.
    fn from(line: L) -> Self {
        Self { note: Note::default(), line }
    }
}

/// A line of the header.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Declared {
    FirstLine,
    Order,
    SpeedOfSound,
    Duration,
    Seed,
    Surroundings,
    /// From which receiver on.
    Receiver(usize),
    Pattern(usize),
    Sound(usize),
    /// A mode of a sound.
    Mode(usize, usize),
}
