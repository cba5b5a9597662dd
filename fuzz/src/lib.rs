//! What the fuzz targets share.
//!
//! A target is one file:
//!
//! ```ignore
//! #![no_main]
//! froufrou_fuzz::target!(|bytes| {
//!     froufrou_fuzz::with_file(bytes, "abc", |path| {
//!         let Ok(animation) = Alembic::open(path) else { return };
//!         froufrou_fuzz::walk_animation(&animation);
//!     });
//! });
//! ```
//!
//! with a `[[bin]]` in `Cargo.toml`, and seeds in `seeds/NAME` or a line in `run` that says which of
//! the tests' fixtures are seeds.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod animation;
mod checksum;
mod guard;

use std::io::Write;
use std::path::Path;

pub use animation::walk_animation;
pub use checksum::{mend_flac, mend_ogg};
pub use guard::{begin, guarded};
#[doc(hidden)]
pub use libfuzzer_sys::fuzz_target;

use froufrou::corpus::recording::Recording;
use froufrou::motion::event::{self, Event};

/// Makes the entry point of a target from a closure of `&[u8]`.
#[macro_export]
macro_rules! target {
    (|$bytes:ident| $body:block) => {
        $crate::fuzz_target!(init: { $crate::begin() }, |data: &[u8]| {
            let $bytes: &[u8] = data;
            $crate::guarded(|| $body)
        });
    };
}

/// Runs something with a file of these bytes, which is gone when it returns. It lies in `TMPDIR`,
/// which `run` keeps in memory.
pub fn with_file<T>(bytes: &[u8], extension: &str, run: impl FnOnce(&Path) -> T) -> T {
    let mut file = tempfile::Builder::new()
        .prefix("froufrou-fuzz-")
        .suffix(&format!(".{extension}"))
        .tempfile()
        .expect("a temporary file");
    file.write_all(bytes).expect("room for a temporary file");
    run(file.path())
}

/// Checks of events that they come in order of time and can be written, up to the first fault.
pub fn walk_events(events: impl Iterator<Item = froufrou::Result<Event>>) {
    let mut last_s = f64::NEG_INFINITY;
    for found in events.map_while(Result::ok) {
        assert!(found.time_s() >= last_s, "{found:?} goes back from {last_s}");
        last_s = found.time_s();
        event::write(&mut std::io::sink(), &found).expect("an event that can be written");
    }
}

/// Decodes an audio file and checks what every recording promises.
pub fn walk_recording(bytes: &[u8], name: &str) {
    let Ok(recording) = Recording::decode(bytes, name) else { return };
    let frames = recording.frames();
    assert!(frames > 0 && !recording.channels.is_empty(), "an empty recording");
    assert!(recording.rate_hz > 0 && recording.duration_s().is_finite());
    for channel in &recording.channels {
        assert_eq!(channel.len(), frames, "channels of unequal length");
        assert!(channel.iter().all(|sample| sample.is_finite()), "a sample that is not finite");
    }
}
