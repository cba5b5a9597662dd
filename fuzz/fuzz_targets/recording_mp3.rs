//! MP3.
#![no_main]

froufrou_fuzz::target!(|bytes| {
    froufrou_fuzz::walk_recording(bytes, "x.mp3");
});
