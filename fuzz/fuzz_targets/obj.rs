//! OBJ files, alone and as a sequence of two: what stands before and after the first NUL.
#![no_main]

use froufrou::scene::conventions::Conventions;
use froufrou::scene::obj::Obj;
use froufrou_fuzz::{target, walk_animation};

target!(|bytes| {
    let folder = tempfile::tempdir().expect("a folder");
    let [first, second] = ["f_1.obj", "f_2.obj"].map(|name| folder.path().join(name));
    let cut = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    std::fs::write(&first, &bytes[..cut]).expect("room for a file");
    if let Ok(animation) = Obj::open(&first) {
        walk_animation(&animation);
    }
    if cut < bytes.len() {
        std::fs::write(&second, &bytes[cut + 1..]).expect("room for a file");
        if let Ok(animation) = Obj::open_sequence(folder.path().join("f_*.obj"), &Conventions::default()) {
            walk_animation(&animation);
        }
    }
});
