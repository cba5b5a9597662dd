//! One error for everything a user can get wrong: which file, where in it, what was found and
//! expected, and what to do about it.

use std::fmt;
use std::path::{Path, PathBuf};

/// What every fallible function of this crate returns.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Where in a file a fault lies, in the terms of that file's own kind.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Place {
    /// A line of text, both counted from 1.
    Line {
        /// Line number from 1.
        line: usize,
        /// Column in characters from 1; 0 where only the line is known.
        column: usize,
    },
    /// An offset in bytes from the start of a binary file.
    Byte(u64),
    /// A named part: an object's path, a property, a record.
    Part(String),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::Line { line, column: 0 } => write!(f, "{line}"),
            Place::Line { line, column } => write!(f, "{line}:{column}"),
            Place::Byte(offset) => write!(f, "byte {offset}"),
            Place::Part(part) => write!(f, "{part}"),
        }
    }
}

/// A fault in the input or in reaching it.
///
/// ```
/// use froufrou::{Error, Place};
/// let error = Error::new("unknown key `rat`")
///     .in_file("scene.toml")
///     .at(Place::Line { line: 3, column: 1 })
///     .help("did you mean `rate`?");
/// assert_eq!(error.to_string(), "scene.toml:3:1: unknown key `rat` (did you mean `rate`?)");
/// ```
#[derive(Debug, thiserror::Error)]
pub struct Error {
    what: String,
    file: Option<PathBuf>,
    place: Option<Place>,
    help: Option<String>,
    #[source]
    source: Option<Box<dyn std::error::Error + Send + Sync>>,
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            write!(f, "{}:", file.display())?;
        }
        if let Some(place) = &self.place {
            write!(f, "{place}:")?;
        }
        if self.file.is_some() || self.place.is_some() {
            write!(f, " ")?;
        }
        write!(f, "{}", self.what)?;
        if let Some(help) = &self.help {
            write!(f, " ({help})")?;
        }
        Ok(())
    }
}

impl Error {
    /// An error saying what was found and what was expected, in one sentence without a full stop.
    pub fn new(what: impl Into<String>) -> Self {
        Self { what: what.into(), file: None, place: None, help: None, source: None }
    }

    /// An operation of the operating system that failed on a file; `doing` is an infinitive
    /// ("open", "write").
    pub fn io(doing: &str, file: impl AsRef<Path>, source: std::io::Error) -> Self {
        Self::new(format!("cannot {doing} the file: {source}")).in_file(file.as_ref()).because(source)
    }

    /// Names the file, unless an inner function already has.
    #[must_use]
    pub fn in_file(mut self, file: impl Into<PathBuf>) -> Self {
        self.file.get_or_insert(file.into());
        self
    }

    /// Names the place in the file, unless an inner function already has.
    #[must_use]
    pub fn at(mut self, place: Place) -> Self {
        self.place.get_or_insert(place);
        self
    }

    /// Says what the user can do.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// Keeps the error underneath.
    #[must_use]
    pub fn because(mut self, source: impl std::error::Error + Send + Sync + 'static) -> Self {
        self.source = Some(Box::new(source));
        self
    }

    /// The file at fault, where one is.
    pub fn file(&self) -> Option<&Path> {
        self.file.as_deref()
    }

    /// The place in the file, where known.
    pub fn place(&self) -> Option<&Place> {
        self.place.as_ref()
    }
}
