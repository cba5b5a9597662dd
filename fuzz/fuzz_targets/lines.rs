//! Lines that tell a live engine what happens: one that is wrong does not end the others.
#![no_main]

use froufrou::render::live::lines::{Line, Lines};
use froufrou_fuzz::target;

target!(|bytes| {
    let read = |bytes: &[u8]| -> Vec<Option<Line>> { Lines::new(bytes, "feed").map(Result::ok).collect() };
    let lines = read(bytes);
    let told = bytes.split(|byte| *byte == b'\n').filter(|line| !line.iter().all(u8::is_ascii_whitespace));
    assert_eq!(lines.len(), told.count());
    let mut followed = bytes.to_vec();
    followed.extend(b"\n{\"advance\":1}\n");
    assert_eq!(read(&followed).last(), Some(&Some(Line::Advance(1.0))));
});
