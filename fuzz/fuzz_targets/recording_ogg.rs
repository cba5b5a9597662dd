//! Ogg Vorbis, with its checksums made right.
#![no_main]

froufrou_fuzz::target!(|bytes| {
    froufrou_fuzz::walk_recording(&froufrou_fuzz::mend_ogg(bytes), "x.ogg");
});
