//! What reaches each microphone: positions in, gains and delays out.

pub mod directivity;
pub mod microphone;
pub mod propagation;
mod track;
