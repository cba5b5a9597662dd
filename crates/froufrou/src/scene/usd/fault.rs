//! What can be wrong within a layer, and how much a file may make us hold.

use std::path::Path;

use crate::{Error, Place};

/// The advice for every kind of damage.
pub(super) const DAMAGED: &str = "the file is damaged or was cut short: copy it again or export it again";

/// Bytes that cannot be what a sound layer has.
#[derive(Debug)]
pub(super) struct Damage {
    offset: Option<u64>,
    what: String,
}

impl Damage {
    pub(super) fn new(offset: u64, what: impl Into<String>) -> Self {
        Self { offset: Some(offset), what: what.into() }
    }

    /// A fault that lies at no one byte.
    pub(super) fn plain(what: impl Into<String>) -> Self {
        Self { offset: None, what: what.into() }
    }

    /// The error of a file.
    pub(super) fn in_file(self, file: &Path) -> Error {
        let error = Error::new(self.what).in_file(file).help(DAMAGED);
        match self.offset {
            Some(offset) => error.at(Place::Byte(offset)),
            None => error.at(Place::Part("the whole layer".into())),
        }
    }

    /// The error of a prim, named by its path.
    pub(super) fn in_prim(self, file: &Path, prim: &str) -> Error {
        Error::new(self.what).in_file(file).at(Place::Part(prim.to_owned())).help(DAMAGED)
    }
}

/// How much more memory a file may make us take.
#[derive(Debug)]
pub(super) struct Budget {
    used: u64,
    whole: u64,
}

impl Budget {
    /// For layers of so many bytes: binary ones hold constant lists in next to nothing.
    pub(super) fn of(length: u64) -> Self {
        let mut budget = Self { used: 0, whole: 0 };
        budget.widen(length);
        budget
    }

    /// The layers turned out to be of so many bytes.
    pub(super) fn widen(&mut self, length: u64) {
        self.whole = length.saturating_mul(64).saturating_add(32 << 20);
    }

    /// Takes `amount` away.
    ///
    /// # Errors
    /// When less than that is left.
    pub(super) fn charge(&mut self, amount: u64) -> Result<(), Damage> {
        self.used = self.used.saturating_add(amount);
        if self.used > self.whole {
            return Err(Damage::plain(format!(
                "its values take more than {} bytes, too much for the file's size",
                self.whole
            )));
        }
        Ok(())
    }
}
