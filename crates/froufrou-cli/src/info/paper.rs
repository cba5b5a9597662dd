//! What is in a database of paper: its clips and spectra by size.

use std::path::Path;

use froufrou::Result;
use froufrou::corpus::paper::PaperSound;

use super::sheet::Sheet;
use crate::corpus::paper::PaperFindings;

/// Reads all of it.
pub fn read(folder: &Path) -> Result<PaperFindings> {
    Ok(PaperFindings::of(&PaperSound::open(folder)?))
}

impl super::Findings for PaperFindings {
    const KIND: &'static str = "paper";

    fn sheet(&self) -> Sheet {
        let mut sheet = Sheet::default();
        self.facts(&mut sheet);
        sheet
    }
}
