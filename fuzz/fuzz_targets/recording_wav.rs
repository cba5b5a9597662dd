//! WAV, RF64 and BW64.
#![no_main]

froufrou_fuzz::target!(|bytes| {
    froufrou_fuzz::walk_recording(bytes, "x.wav");
});
