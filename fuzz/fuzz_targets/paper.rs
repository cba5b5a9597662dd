//! The `corpus.toml` of a paper: files lie within the corpus, and a size is either whole or nothing.
#![no_main]

use std::path::Path;

use froufrou::corpus::paper::manifest::Manifest;
use froufrou_fuzz::target;

target!(|bytes| {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(manifest) = Manifest::parse(text, Path::new("corpus.toml")) else { return };
    assert!(manifest.files().iter().all(|file| !file.is_empty() && !file.starts_with("../")));
    let entries = manifest.paper.clip.iter().chain(&manifest.paper.friction);
    for entry in entries {
        let (ruling_m, border_m) = entry.get_ref().size_m();
        assert!(ruling_m.is_finite() && border_m.is_finite() && (ruling_m > 0.0) == (border_m > 0.0));
    }
    assert!(manifest.paper.friction.iter().all(|entry| entry.get_ref().speed_mps.is_some_and(|v| v > 0.0)));
});
