//! Files that are seen only when they are whole.

use std::io::{BufWriter, Write};
use std::path::Path;

use froufrou::{Error, Result, WholeFile};

/// A file that is seen when it is whole; `-` is standard output.
pub enum Output {
    /// On its way to its place.
    File(BufWriter<WholeFile>),
    /// Standard output.
    Standard(BufWriter<std::io::Stdout>),
}

impl Output {
    /// Begins a file. What is there stays until [`Output::finish`].
    pub fn create(path: &Path) -> Result<Self> {
        if path == Path::new("-") {
            return Ok(Self::Standard(BufWriter::new(std::io::stdout())));
        }
        Ok(Self::File(BufWriter::new(WholeFile::create(path)?)))
    }

    /// Puts the file in its place.
    pub fn finish(self) -> Result<()> {
        match self {
            Self::Standard(mut output) => output.flush().map_err(|fault| Error::io("write", "-", fault)),
            Self::File(output) => {
                let path = output.get_ref().path().to_owned();
                let file = output.into_inner();
                file.map_err(|fault| Error::io("write", path, fault.into_error()))?.finish()
            }
        }
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        match self {
            Self::File(output) => output.write(bytes),
            Self::Standard(output) => output.write(bytes),
        }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        match self {
            Self::File(output) => output.flush(),
            Self::Standard(output) => output.flush(),
        }
    }
}

/// Writes text as a whole file.
pub fn write(path: &Path, content: &[u8]) -> Result<()> {
    let mut output = Output::create(path)?;
    output.write_all(content).map_err(|fault| Error::io("write", path, fault))?;
    output.finish()
}
