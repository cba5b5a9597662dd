//! What is in a corpus of cloth: its friction and its pops.

use std::path::Path;

use froufrou::Result;
use froufrou::corpus::cloth::ClothSound;

use super::sheet::Sheet;
use crate::corpus::info::Findings;

/// Reads all of it.
pub fn read(folder: &Path) -> Result<Findings> {
    Ok(Findings::of(&ClothSound::open(folder)?))
}

impl super::Findings for Findings {
    const KIND: &'static str = "cloth";

    fn sheet(&self) -> Sheet {
        let mut sheet = Sheet::default();
        self.facts(&mut sheet);
        sheet
    }
}
