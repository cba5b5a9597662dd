//! What happens: frames in, events out.

pub mod event;
pub mod impact;

pub use event::Event;
