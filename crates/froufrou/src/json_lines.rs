//! Files with one JSON object a line.

use std::io::BufRead;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use crate::{Error, Place, Result};

/// Reads objects line by line, in the memory of one line; lines of nothing are passed over. It ends after its first error,
/// or goes on behind a line that is wrong.
#[derive(Debug)]
pub(crate) struct JsonLines<R, T> {
    inner: R,
    file: PathBuf,
    /// What a line is, for messages, and how many bytes it has at most.
    what: &'static str,
    longest_bytes: usize,
    line: usize,
    buffer: Vec<u8>,
    goes_on: bool,
    over: bool,
    read: PhantomData<T>,
}

impl<R: BufRead, T: DeserializeOwned> JsonLines<R, T> {
    /// Reads from anywhere; `file` is the name in messages.
    pub fn new(inner: R, file: &Path, what: &'static str, longest_bytes: usize) -> Self {
        let (file, buffer) = (file.to_owned(), Vec::new());
        let (line, goes_on, over) = (0, false, false);
        Self { inner, file, what, longest_bytes, line, buffer, goes_on, over, read: PhantomData }
    }

    /// The same, but what is wrong in one line does not end it.
    pub fn going_on(self) -> Self {
        Self { goes_on: true, ..self }
    }

    /// The line that was read last, from 1.
    pub fn line(&self) -> usize {
        self.line
    }

    /// What is wrong with the line that was read last; nothing is read after it, but where
    /// it goes on.
    pub fn refuse(&mut self, fault: Error) -> Error {
        self.over |= !self.goes_on;
        fault.in_file(self.file.clone()).at(Place::Line { line: self.line, column: 0 })
    }

    fn read(&mut self) -> Result<Option<T>> {
        loop {
            self.line += 1;
            self.buffer.clear();
            let mut bounded = std::io::Read::take(&mut self.inner, self.longest_bytes as u64 + 1);
            let count = bounded.read_until(b'\n', &mut self.buffer).map_err(|fault| {
                self.over = true;
                Error::new(format!("cannot read: {fault}")).because(fault)
            })?;
            if count == 0 {
                return Ok(None);
            }
            if count > self.longest_bytes {
                if self.goes_on && self.buffer.last() != Some(&b'\n') {
                    self.over |= self.inner.skip_until(b'\n').is_err();
                }
                return Err(Error::new(format!("a line longer than {} bytes", self.longest_bytes)));
            }
            if self.buffer.iter().all(u8::is_ascii_whitespace) {
                continue;
            }
            return serde_json::from_slice(&self.buffer).map(Some).map_err(|fault| {
                let place = Place::Line { line: self.line, column: fault.column() };
                // The place that serde gives counts lines of this line.
                let what = fault.to_string();
                let what = what.rsplit_once(" at line ").map_or(what.as_str(), |(what, _)| what);
                Error::new(format!("not {}: {what}", self.what)).at(place).because(fault)
            });
        }
    }
}

impl<R: BufRead, T: DeserializeOwned> Iterator for JsonLines<R, T> {
    type Item = Result<T>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.over {
            return None;
        }
        let read = match self.read() {
            Ok(read) => read.map(Ok),
            Err(fault) => Some(Err(self.refuse(fault))),
        };
        self.over |= read.is_none();
        read
    }
}
