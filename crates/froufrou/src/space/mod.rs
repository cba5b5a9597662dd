//! What reaches each microphone: positions in, gains and delays out.

pub mod air;
pub mod ambisonic;
pub mod bands;
pub mod convolution;
pub mod dipole;
pub mod direction;
pub mod directivity;
pub mod enclosure;
pub mod extended;
pub mod head;
pub mod layout;
pub mod microphone;
pub mod panning;
mod pickup;
pub mod propagation;
pub mod reverberation;
pub mod room;
pub(crate) mod sphere;
pub mod spread;
pub mod surroundings;
pub mod tracing;
mod track;
