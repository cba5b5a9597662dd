//! Correspondences and warps: what is read can be written, and reads back the same.
#![no_main]

use froufrou::corpus::units::correspondences;
use froufrou::corpus::units::warp::WarpFile;
use froufrou_fuzz::target;

target!(|bytes| {
    if let Ok(pairs) = correspondences::parse(bytes) {
        let text = correspondences::text(&pairs).expect("text");
        let again = correspondences::parse(text.as_bytes()).expect("what was written");
        assert_eq!(again.len(), pairs.len());
        assert!(again.iter().zip(&pairs).all(|(a, b)| a.recording == b.recording && a.target_s == b.target_s));
    }
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(file) = WarpFile::parse(text) else { return };
    let mut to = vec![0.0; file.warp.dimensions()];
    file.warp.apply(&vec![0.5; file.warp.dimensions()], &mut to);
    assert_eq!(WarpFile::parse(&file.text().expect("text")).expect("what was written"), file);
});
