//! What reaches each microphone: positions in, gains and delays out.

pub mod air;
pub mod bands;
pub mod convolution;
pub mod directivity;
pub mod microphone;
pub mod propagation;
pub mod reverberation;
pub mod room;
pub mod surroundings;
pub mod tracing;
mod track;
