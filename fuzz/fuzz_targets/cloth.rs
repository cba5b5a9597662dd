//! The `corpus.toml` of a cloth and tracks of speed: files lie within the corpus, and a track goes
//! forwards.
#![no_main]

use std::path::Path;

use froufrou::corpus::cloth::manifest::Manifest;
use froufrou::corpus::cloth::motion::Motion;
use froufrou_fuzz::target;

target!(|bytes| {
    if let Ok(Motion::Track(track)) = Motion::parse(bytes) {
        assert!(track.windows(2).all(|pair| pair[0][0] < pair[1][0] && pair[0][1] <= pair[1][1]), "{track:?}");
    }
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(manifest) = Manifest::parse(text, Path::new("corpus.toml")) else { return };
    assert!(manifest.files().iter().all(|file| !file.is_empty() && !file.starts_with("../")));
});
