//! Test data that are not part of the repository: sought in `$FROUFROU_DATA`, else in `../shared/data` beside it, and what is
//! missing is skipped aloud.

use std::path::{Path, PathBuf};

/// A file or folder of the test data, where it is there.
pub fn data(name: &str) -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let path = std::env::var_os("FROUFROU_DATA").map_or_else(beside, PathBuf::from).join(name);
    if path.exists() {
        return Some(path);
    }
    eprintln!("SKIPPED: there is no {} (set FROUFROU_DATA to the folder of test data)", path.display());
    None
}
