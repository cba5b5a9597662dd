//! Alembic archives: open, list, and read every object.
#![no_main]

use froufrou::scene::alembic::Alembic;
use froufrou::scene::animation::Animation;
use froufrou_fuzz::{target, walk_animation, with_file};

target!(|bytes| {
    with_file(bytes, "abc", |path| {
        let Ok(animation) = Alembic::open(path) else { return };
        walk_animation(&animation);
        for object in 0..animation.objects().len().min(32) {
            let _ = animation.lens(object, 0.5);
        }
    });
});
