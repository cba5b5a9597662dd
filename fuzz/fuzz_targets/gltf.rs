//! glTF files, binary and JSON: open, list, and read every object of every clip.
#![no_main]

use froufrou::scene::gltf::Gltf;
use froufrou_fuzz::{target, walk_animation, with_file};

target!(|bytes| {
    with_file(bytes, if bytes.starts_with(b"glTF") { "glb" } else { "gltf" }, |path| {
        let Ok(animation) = Gltf::open(path) else { return };
        walk_animation(&animation);
        for clip in 1..animation.clips().len().min(4) {
            let Ok(animation) = Gltf::open_clip(path, Some(&clip.to_string())) else { continue };
            walk_animation(&animation);
        }
    });
});
