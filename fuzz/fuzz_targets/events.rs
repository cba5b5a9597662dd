//! Event files: what is read can be written and comes back the same.
#![no_main]

use froufrou::motion::event::{Event, Reader, write};
use froufrou_fuzz::target;

target!(|bytes| {
    let read = |bytes: &[u8]| -> Vec<Event> { Reader::new(bytes, "e.jsonl").map_while(Result::ok).collect() };
    let events = read(bytes);
    let mut text = Vec::new();
    for event in &events {
        write(&mut text, event).expect("what was read can be written");
    }
    assert_eq!(read(&text), events);
});
