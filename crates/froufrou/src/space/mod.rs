//! What reaches each microphone: positions in, gains and delays out.

pub mod ambisonic;
pub mod dipole;
pub mod direction;
pub mod air;
pub mod bands;
pub mod convolution;
pub mod directivity;
pub mod extended;
pub mod layout;
pub mod head;
pub mod microphone;
pub mod panning;
pub mod propagation;
mod sphere;
pub mod reverberation;
pub mod room;
pub mod surroundings;
pub mod tracing;
mod track;
