//! The driver: pulls blocks through all stages into files.

pub mod broadcast;
mod buses;
pub mod flac;
pub mod format;
pub mod labels;
pub mod live;
pub mod meter;
pub mod offline;
pub mod production;
mod quantize;
pub mod reaper;
pub mod sound_file;
pub mod soundtrack;
pub mod speakers;
pub mod timecode;
pub mod wav;
