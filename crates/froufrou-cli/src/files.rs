//! Files that are seen only when they are whole.

use std::io::{BufWriter, Write};
use std::path::{Component, Path, PathBuf};

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

/// A path as it is called from a folder.
pub fn relative(path: &Path, folder: &Path) -> String {
    let absolute = |p: &Path| {
        let p = if p.as_os_str().is_empty() { Path::new(".") } else { p };
        p.canonicalize().unwrap_or_else(|_| p.to_owned())
    };
    let (path, folder) = (absolute(path), absolute(folder));
    let shared = path.components().zip(folder.components()).take_while(|(a, b)| a == b).count();
    let up = folder.components().skip(shared).map(|_| Component::ParentDir);
    let relative: PathBuf = up.chain(path.components().skip(shared)).collect();
    relative.components().map(|c| c.as_os_str().to_string_lossy()).collect::<Vec<_>>().join("/")
}
