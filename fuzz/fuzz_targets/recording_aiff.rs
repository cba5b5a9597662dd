//! AIFF and AIFF-C.
#![no_main]

froufrou_fuzz::target!(|bytes| {
    froufrou_fuzz::walk_recording(bytes, "x.aiff");
});
