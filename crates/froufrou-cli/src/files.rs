//! Files that are seen only when they are whole.

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use froufrou::{Error, Result};
use tempfile::NamedTempFile;

/// A file that is written beside its place and put there at the end; `-` is standard output.
pub enum Output {
    /// On its way to a place.
    File(BufWriter<NamedTempFile>, PathBuf),
    /// Standard output.
    Standard(BufWriter<std::io::Stdout>),
}

impl Output {
    /// Begins a file. What is there stays until [`Output::finish`].
    pub fn create(path: &Path) -> Result<Self> {
        if path == Path::new("-") {
            return Ok(Self::Standard(BufWriter::new(std::io::stdout())));
        }
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let file = NamedTempFile::new_in(folder).map_err(|fault| Error::io("write", path, fault))?;
        Ok(Self::File(BufWriter::new(file), path.to_owned()))
    }

    /// Puts the file in its place.
    pub fn finish(self) -> Result<()> {
        match self {
            Self::Standard(mut output) => output.flush().map_err(|fault| Error::io("write", "-", fault)),
            Self::File(output, path) => {
                let fail = |fault| Error::io("write", &path, fault);
                let file = output.into_inner().map_err(|fault| fail(fault.into_error()))?;
                #[cfg(unix)]
                {
                    use std::os::unix::fs::PermissionsExt;
                    // As any new file; a temporary one is for its owner alone.
                    file.as_file().set_permissions(std::fs::Permissions::from_mode(0o644)).map_err(fail)?;
                }
                file.persist(&path).map_err(|fault| fail(fault.error))?;
                Ok(())
            }
        }
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        match self {
            Self::File(output, _) => output.write(bytes),
            Self::Standard(output) => output.write(bytes),
        }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        match self {
            Self::File(output, _) => output.flush(),
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
