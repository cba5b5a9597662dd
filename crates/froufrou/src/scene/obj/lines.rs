//! The lines of a text file, one at a time, with those that a backslash continues joined.

use std::path::Path;

use crate::scene::positioned_file::PositionedFile;
use crate::{Error, Place, Result};

/// What is read in one go.
const BLOCK_BYTES: usize = 1 << 16;

/// The longest line, with what continues it: a polygon of a hundred thousand corners.
const LONGEST_LINE_BYTES: usize = 4 << 20;

/// Reads lines.
pub(super) struct Lines<'f> {
    path: &'f Path,
    file: PositionedFile,
    /// Where in the file the block ends.
    read_to: u64,
    block: Vec<u8>,
    /// Where in the block the next line begins.
    next: usize,
    /// A line that is longer than what is left of a block, or that is continued.
    joined: Vec<u8>,
    /// The number of the last line, from 1.
    number: usize,
}

impl<'f> Lines<'f> {
    /// # Errors
    /// A file that cannot be opened.
    pub(super) fn open(path: &'f Path) -> Result<Self> {
        let file = PositionedFile::open(path).map_err(|fault| Error::io("open", path, fault))?;
        Ok(Self { path, file, read_to: 0, block: Vec::new(), next: 0, joined: Vec::new(), number: 0 })
    }

    /// The next line, without its end, and the number of its first row from 1; nothing after the last.
    ///
    /// # Errors
    /// A file that cannot be read, or a line that is too long.
    pub(super) fn next(&mut self) -> Result<Option<(usize, &[u8])>> {
        self.joined.clear();
        let mut first = 0;
        // True while the rest of the line that has been begun is to come.
        let mut begun = false;
        loop {
            if self.next == self.block.len() && !self.fill()? {
                return Ok(begun.then_some((first, self.joined.as_slice())));
            }
            if first == 0 {
                first = self.number + 1;
            }
            let rest = &self.block[self.next..];
            let Some(length) = rest.iter().position(|byte| *byte == b'\n') else {
                self.joined.extend_from_slice(rest);
                self.next = self.block.len();
                begun = true;
                self.check_length(first)?;
                continue;
            };
            let from = self.next;
            self.next += length + 1;
            self.number += 1;
            if !begun && !is_continued(&self.block[from..from + length]) {
                return Ok(Some((first, &self.block[from..from + length])));
            }
            self.joined.extend_from_slice(&self.block[from..from + length]);
            self.check_length(first)?;
            if !is_continued(&self.joined) {
                return Ok(Some((first, &self.joined)));
            }
            while self.joined.pop_if(|last| *last != b'\\').is_some() {}
            if let Some(last) = self.joined.last_mut() {
                *last = b' ';
            }
            begun = true;
        }
    }

    /// Fills the block; false at the end of the file.
    fn fill(&mut self) -> Result<bool> {
        let left = self.file.length().saturating_sub(self.read_to);
        let size = usize::try_from(left).unwrap_or(usize::MAX).min(BLOCK_BYTES);
        self.block.resize(size, 0);
        self.next = 0;
        if size == 0 {
            return Ok(false);
        }
        self.file.read_exact_at(&mut self.block, self.read_to).map_err(|fault| {
            let place = Place::Line { line: self.number + 1, column: 0 };
            Error::io("read", self.path, fault).at(place).help("was the file changed while it was read?")
        })?;
        self.read_to += size as u64;
        Ok(true)
    }

    fn check_length(&self, line: usize) -> Result<()> {
        if self.joined.len() <= LONGEST_LINE_BYTES {
            return Ok(());
        }
        Err(Error::new(format!("a line longer than {LONGEST_LINE_BYTES} bytes"))
            .in_file(self.path)
            .at(Place::Line { line, column: 0 })
            .help("this is no OBJ file, or it is damaged: export it again"))
    }
}

/// True for a line that goes on in the next. A comment does not: it may end in the path of a folder.
fn is_continued(line: &[u8]) -> bool {
    line.trim_ascii_end().ends_with(b"\\") && !line.trim_ascii_start().starts_with(b"#")
}
