//! Files that appear whole or not at all.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::{Error, Result};

/// A file that is written beside its place and put there when it is finished. Until then, and if it
/// never is, what was there stays as it was.
///
/// ```
/// use std::io::Write;
/// use froufrou::WholeFile;
/// let folder = tempfile::tempdir().unwrap();
/// let path = folder.path().join("notes.txt");
/// let mut file = WholeFile::create(&path)?;
/// file.write_all(b"a rustle").unwrap();
/// assert!(!path.exists());
/// file.finish()?;
/// assert!(path.exists());
/// # Ok::<(), froufrou::Error>(())
/// ```
#[derive(Debug)]
pub struct WholeFile {
    path: PathBuf,
    file: NamedTempFile,
}

impl WholeFile {
    /// Begins a file. Behind a symbolic link it is the file that the link leads to.
    ///
    /// # Errors
    /// Where the folder is missing or cannot be written to, or something that is not a file lies
    /// under the name.
    pub fn create(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let destination = destination(path)?;
        let folder = destination.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let mut builder = tempfile::Builder::new();
        builder.prefix(".froufrou-");
        #[cfg(unix)]
        {
            // As any new file; a temporary one is its owner's alone.
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        let file = builder.tempfile_in(folder).map_err(|fault| Error::io("create", path, fault))?;
        Ok(Self { path: destination, file })
    }

    /// Another handle to what is written so far.
    ///
    /// # Errors
    /// Where the system has no more handles.
    pub fn handle(&self) -> Result<File> {
        self.file.as_file().try_clone().map_err(|fault| Error::io("write", &self.path, fault))
    }

    /// Where it is to lie.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Puts the file in its place.
    ///
    /// # Errors
    /// Where the disk is full or the name has become impossible; then what was there is untouched.
    pub fn finish(self) -> Result<()> {
        let fail = |fault| Error::io("write", &self.path, fault);
        // Before the name: else a power cut could leave the name without the content.
        self.file.as_file().sync_all().map_err(fail)?;
        self.file.persist(&self.path).map_err(|fault| fail(fault.error))?;
        Ok(())
    }
}

impl Write for WholeFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for WholeFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

/// Where the file is to lie: behind a symbolic link, if the name is one, so that the link stays.
fn destination(path: &Path) -> Result<PathBuf> {
    match std::fs::metadata(path) {
        Ok(metadata) if metadata.is_file() => path.canonicalize().map_err(|e| Error::io("open", path, e)),
        Ok(metadata) if metadata.is_dir() => {
            Err(Error::new("expected the name of a file to write, found a folder").in_file(path))
        }
        Ok(_) => {
            Err(Error::new("expected the name of a file to write, found a pipe or a device").in_file(path))
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(path.to_path_buf()),
        Err(error) => Err(Error::io("open", path, error)),
    }
}
