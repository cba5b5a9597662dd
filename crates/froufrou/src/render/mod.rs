//! The driver: pulls blocks through all stages into files.

pub mod meter;
pub mod offline;
pub mod production;
pub mod soundtrack;
pub mod wav;
