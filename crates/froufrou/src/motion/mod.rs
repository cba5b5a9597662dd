//! What happens: frames in, events out.
