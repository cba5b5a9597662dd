//! Which panics count as found.
//!
//! libFuzzer's own hook aborts on every panic. Here a decoder that is not ours may panic where our
//! code contains it and makes an error of it. So a panic counts where nothing catches it, and where
//! it began in our own code, whether something catches it or not.

use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind, set_hook};
use std::sync::{Mutex, PoisonError};

/// What the last panic said, and from where.
static LAST: Mutex<String> = Mutex::new(String::new());

/// Replaces libFuzzer's panic hook, and keeps all work on the one thread whose coverage is followed.
pub fn begin() {
    set_hook(Box::new(remember));
    // A pool that was built before is one of several targets in a process: there are none.
    let _ = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global();
}

fn remember(panic: &PanicHookInfo<'_>) {
    let ours = panic.location().is_some_and(|at| at.file().contains("crates/froufrou/"));
    let said = format!("{panic}\n{}", std::backtrace::Backtrace::force_capture());
    if ours {
        eprintln!("{said}");
        std::process::abort();
    }
    *LAST.lock().unwrap_or_else(PoisonError::into_inner) = said;
}

/// Runs one input; a panic that comes out of it ends the process, which libFuzzer takes as found.
pub fn guarded(run: impl FnOnce()) {
    if catch_unwind(AssertUnwindSafe(run)).is_err() {
        eprintln!("{}", LAST.lock().unwrap_or_else(PoisonError::into_inner));
        std::process::abort();
    }
}
