//! What can be wrong inside an archive, before it is known which file and which object it befell.

use std::io;
use std::path::Path;

use crate::{Error, Place};

/// What the reader's inner functions return.
pub(super) type Outcome<T> = Result<T, Fault>;

/// The advice for every kind of damage.
const DAMAGED: &str = "the file is damaged or was cut short: copy it again or export it again";

/// A fault at a byte of the file; `in_object` makes it an [`Error`].
#[derive(Debug)]
pub(super) struct Fault {
    what: String,
    offset: Option<u64>,
    help: String,
    source: Option<io::Error>,
}

impl Fault {
    /// Bytes that cannot be what a sound file has at this offset.
    pub(super) fn damage(offset: u64, what: impl Into<String>) -> Self {
        Self { what: what.into(), offset: Some(offset), help: DAMAGED.into(), source: None }
    }

    /// A fault with advice of its own.
    pub(super) fn new(what: impl Into<String>, help: impl Into<String>) -> Self {
        Self { what: what.into(), offset: None, help: help.into(), source: None }
    }

    /// A read that failed.
    pub(super) fn io(offset: u64, size: u64, source: io::Error) -> Self {
        if source.kind() == io::ErrorKind::UnexpectedEof {
            return Self::damage(offset, format!("the file ends before {size} bytes that belong here"));
        }
        Self {
            what: format!("cannot read {size} bytes: {source}"),
            offset: Some(offset),
            help: "check the disk or the network drive the file is on".into(),
            source: Some(source),
        }
    }

    /// Names the byte, unless an inner function already has.
    pub(super) fn at(mut self, offset: u64) -> Self {
        self.offset.get_or_insert(offset);
        self
    }

    /// The error of the whole file.
    pub(super) fn in_file(self, file: &Path) -> Error {
        let place = self.offset.map(Place::Byte);
        self.into_error(file, place)
    }

    /// The error of one object, named by its path in the archive.
    pub(super) fn in_object(self, file: &Path, object: &str) -> Error {
        let part = match self.offset {
            Some(offset) => format!("{object} (byte {offset})"),
            None => object.to_owned(),
        };
        self.into_error(file, Some(Place::Part(part)))
    }

    fn into_error(self, file: &Path, place: Option<Place>) -> Error {
        let mut error = Error::new(self.what).in_file(file).help(self.help);
        if let Some(place) = place {
            error = error.at(place);
        }
        if let Some(source) = self.source {
            error = error.because(source);
        }
        error
    }
}

/// How much more of something a file may make us do or hold. A damaged file can claim any number
/// and can let a thousand groups share one child; every loop over what it claims pays from here.
#[derive(Debug)]
pub(super) struct Allowance {
    left: u64,
    whole: u64,
    what: &'static str,
}

impl Allowance {
    pub(super) fn new(whole: u64, what: &'static str) -> Self {
        Self { left: whole, whole, what }
    }

    /// Takes `amount` away.
    ///
    /// # Errors
    /// A fault when less than that is left.
    pub(super) fn charge(&mut self, amount: u64) -> Outcome<()> {
        match self.left.checked_sub(amount) {
            Some(left) => {
                self.left = left;
                Ok(())
            }
            None => Err(Fault::new(
                format!(
                    "the objects take more than {} bytes of {}, too much for the file's size",
                    self.whole, self.what
                ),
                "the file is damaged, or its instances nest absurdly: export it again without instances",
            )),
        }
    }
}
