//! What it can sound like: recordings in; signals that can be played out.
