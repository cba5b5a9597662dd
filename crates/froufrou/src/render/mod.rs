//! The driver: pulls blocks through all stages into files.

pub mod meter;
pub mod wav;
