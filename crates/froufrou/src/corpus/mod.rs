//! What it can sound like: recordings in; signals that can be played out.

pub mod looping;
pub mod recording;
