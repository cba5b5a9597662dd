//! Froufrou turns motion into sound.
//!
//! The modules are the stages of one pipeline, named after what flows through it:
//!
//! ```text
//! scene ─► motion ─► score ─► synth ─► space ─► render
//!            corpus ──▲────────▲
//! ```
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod corpus;
pub mod error;
mod hermite;
mod json_lines;
pub mod motion;
pub mod random;
pub mod render;
pub mod scene;
pub mod score;
pub mod space;
pub mod synth;
mod time;
mod whole_file;

pub use error::{Error, Place, Result};
pub use whole_file::WholeFile;
