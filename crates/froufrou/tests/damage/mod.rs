//! What tests of damaged files share: the most memory that was ever held, and a file whose bytes are
//! anything.

#[path = "../allocation/mod.rs"]
mod allocation;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

pub use allocation::{most_held, turn};
use froufrou::Error;

/// A folder for one file after another.
pub struct Scratch {
    pub folder: tempfile::TempDir,
    name: &'static str,
    /// Opens the file and reads everything; how many objects there are.
    read: fn(&Path) -> Result<usize, Error>,
}

impl Scratch {
    pub fn new(name: &'static str, read: fn(&Path) -> Result<usize, Error>) -> Self {
        Self { folder: tempfile::tempdir().expect("a folder"), name, read }
    }

    pub fn path(&self) -> PathBuf {
        self.folder.path().join(self.name)
    }

    /// What reading gives, after checking that time, memory and the error are in order.
    pub fn try_bytes(&self, bytes: &[u8]) -> Result<usize, Error> {
        std::fs::write(self.path(), bytes).expect("a file");
        let begin = Instant::now();
        let (result, most) = most_held(|| (self.read)(&self.path()));
        assert!(begin.elapsed() < Duration::from_secs(5), "it took {:?}", begin.elapsed());
        assert!(most < (48 << 20) + 64 * bytes.len(), "{most} bytes for a file of {}", bytes.len());
        if let Err(error) = &result {
            assert!(error.file().is_some() && error.place().is_some(), "{error}");
            assert!(error.to_string().ends_with(')'), "no advice: {error}");
        }
        result
    }

    pub fn error(&self, bytes: &[u8]) -> String {
        self.try_bytes(bytes).expect_err("this cannot be read").to_string()
    }
}
