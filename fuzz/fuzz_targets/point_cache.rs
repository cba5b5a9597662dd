//! Point caches in both formats, with and without a file of faces.
#![no_main]

use std::path::Path;

use froufrou::scene::conventions::{Conventions, UpAxis};
use froufrou::scene::point_cache::PointCache;
use froufrou_fuzz::{target, walk_animation, with_file};

/// The faces of the seeds.
const FACES: &str =
    concat!(env!("CARGO_MANIFEST_DIR"), "/../crates/froufrou/tests/fixtures/point_cache/cloth.obj");

target!(|bytes| {
    let extension = if bytes.starts_with(b"POINTCACHE2") { "pc2" } else { "mdd" };
    with_file(bytes, extension, |path| {
        let faces = Some(Path::new(FACES).to_owned());
        let other = Conventions {
            up: Some(UpAxis::Z),
            unit_m: Some(0.01),
            frame_rate_hz: Some(30.0),
            faces,
            ..Conventions::default()
        };
        for conventions in [Conventions::default(), other] {
            let Ok(animation) = PointCache::open(path, &conventions) else { continue };
            walk_animation(&animation);
        }
    });
});
