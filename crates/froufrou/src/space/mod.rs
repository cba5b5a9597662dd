//! What reaches each microphone: positions in, gains and delays out.

pub mod ambisonic;
pub mod dipole;
pub mod direction;
pub mod directivity;
pub mod extended;
pub mod layout;
pub mod head;
pub mod microphone;
pub mod panning;
pub mod propagation;
mod sphere;
pub mod surroundings;
pub mod tracing;
mod track;
