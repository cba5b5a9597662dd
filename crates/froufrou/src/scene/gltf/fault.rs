//! What is said of files that cannot be read, and how much they may make us do.

use crate::{Error, Place, Result};

/// The advice for every kind of damage.
pub(super) const DAMAGED: &str =
    "the file is damaged or its exporter is at fault: copy it or export it again";

/// A part of the file that cannot be as it is; `part` names it as the JSON does.
pub(super) fn damage(part: impl Into<String>, what: impl Into<String>) -> Error {
    Error::new(what).at(Place::Part(part.into())).help(DAMAGED)
}

/// How much more of something a file may make us hold or do. A small file can let a thousand parts
/// share one big one; every loop over what it claims pays from here.
#[derive(Debug)]
pub(super) struct Budget {
    left: u64,
    whole: u64,
}

impl Budget {
    pub(super) fn new(whole: u64) -> Self {
        Self { left: whole, whole }
    }

    /// Takes `amount` away; `part` is what needs it.
    ///
    /// # Errors
    /// When less than that is left.
    pub(super) fn charge(&mut self, amount: u64, part: impl Fn() -> String) -> Result<()> {
        match self.left.checked_sub(amount) {
            Some(left) => {
                self.left = left;
                Ok(())
            }
            None => Err(damage(
                part(),
                format!(
                    "the file's index takes more than {} bytes, too much for the file's size",
                    self.whole
                ),
            )),
        }
    }
}
