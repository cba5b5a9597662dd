//! Reading a file at any place without a shared cursor, so that many threads can read one open file
//! and nothing but the bytes asked for is ever in memory.

use std::fs::File;
use std::io;
use std::path::Path;

/// A file that is open for reading at given offsets, and its length when it was opened.
#[derive(Debug)]
pub(crate) struct PositionedFile {
    file: File,
    length: u64,
}

impl PositionedFile {
    /// Opens an ordinary file.
    ///
    /// # Errors
    /// What the operating system says; a folder or a pipe, whose bytes have no positions.
    pub(crate) fn open(path: &Path) -> io::Result<Self> {
        // Asked before opening: to open a named pipe without a writer would wait for ever.
        if !std::fs::metadata(path)?.is_file() {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "it is not an ordinary file"));
        }
        let file = File::open(path)?;
        let length = file.metadata()?.len();
        Ok(Self { file, length })
    }

    /// The length in bytes when the file was opened.
    pub(crate) fn length(&self) -> u64 {
        self.length
    }

    /// Fills `buffer` with the bytes from `offset` on.
    ///
    /// # Errors
    /// What the operating system says; `UnexpectedEof` where the file is too short.
    #[cfg(not(windows))]
    pub(crate) fn read_exact_at(&self, buffer: &mut [u8], offset: u64) -> io::Result<()> {
        std::os::unix::fs::FileExt::read_exact_at(&self.file, buffer, offset)
    }

    /// Fills `buffer` with the bytes from `offset` on.
    ///
    /// # Errors
    /// What the operating system says; `UnexpectedEof` where the file is too short.
    #[cfg(windows)]
    pub(crate) fn read_exact_at(&self, mut buffer: &mut [u8], mut offset: u64) -> io::Result<()> {
        use std::os::windows::fs::FileExt;
        while !buffer.is_empty() {
            match self.file.seek_read(buffer, offset) {
                Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
                Ok(count) => {
                    buffer = &mut buffer[count..];
                    offset += count as u64;
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}
