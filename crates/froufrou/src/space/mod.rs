//! What reaches each microphone: positions in, gains and delays out.

pub mod directivity;
pub mod head;
pub mod microphone;
pub mod propagation;
pub mod surroundings;
pub mod tracing;
mod track;
