//! What tests of damaged files share: the most memory that was ever held, and a file whose bytes are
//! anything.

use std::alloc::{GlobalAlloc, Layout, System};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use froufrou::Error;

/// The system's allocator, which remembers how much was ever held at once.
struct Counting;

pub static HELD: AtomicUsize = AtomicUsize::new(0);
pub static MOST: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call goes on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let held = HELD.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
        MOST.fetch_max(held, Ordering::Relaxed);
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Memory is counted for the whole process, so these tests take turns.
pub fn turn() -> MutexGuard<'static, ()> {
    static TURN: Mutex<()> = Mutex::new(());
    TURN.lock().unwrap_or_else(PoisonError::into_inner)
}

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
        let (begin, before) = (Instant::now(), HELD.load(Ordering::Relaxed));
        MOST.store(before, Ordering::Relaxed);
        let result = (self.read)(&self.path());
        let most = MOST.load(Ordering::Relaxed).saturating_sub(before);
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
