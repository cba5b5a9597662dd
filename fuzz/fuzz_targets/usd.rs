//! USD stages, as text, binary or package by what is in them: open, list, and read every object.
#![no_main]

use froufrou::scene::usd::Usd;
use froufrou_fuzz::{target, walk_animation, with_file};

target!(|bytes| {
    with_file(bytes, "usd", |path| {
        let Ok(animation) = Usd::open(path) else { return };
        walk_animation(&animation);
    });
});
