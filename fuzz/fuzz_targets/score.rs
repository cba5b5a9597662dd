//! The text of scores in both spaces: what is read is written in its canonical form, which reads back
//! the same and is written the same again, in any order of lines.
#![no_main]

use std::fmt::Debug;
use std::io::BufRead;

use froufrou::score::{AnyDocument, AnyReader, AnySpace, Document, Order, Reader, Space};
use froufrou_fuzz::target;

/// The reader that streams gives the lines that the one that keeps comments gave.
fn same_lines<S: Space, R: BufRead>(document: &Document<S>, reader: Reader<S, R>)
where
    S::Line: PartialEq + Debug,
{
    let lines: Vec<S::Line> = reader.map(|line| line.expect("a line that was read before")).collect();
    let kept = document.lines.iter().map(|noted| &noted.line);
    assert!(kept.eq(lines.iter()), "{lines:?}");
}

target!(|bytes| {
    let Ok(mut score) = AnyDocument::read(bytes) else { return };
    match (&score, AnyReader::new(bytes).expect("a header that was read before")) {
        (AnySpace::Object(document), AnySpace::Object(reader)) => same_lines(document, reader),
        (AnySpace::Channel(document), AnySpace::Channel(reader)) => same_lines(document, reader),
        _ => panic!("the readers differ about the space"),
    }
    for order in [None, Some(Order::Time), Some(Order::Thread), Some(Order::Free)] {
        if let Some(order) = order {
            score.sort(order);
        }
        let text = score.to_text().expect("a score that can be written");
        let again = AnyDocument::read(text.as_bytes()).expect("a score that can be read back");
        assert_eq!(again.to_text().expect("a score that can be written again"), text);
    }
});
