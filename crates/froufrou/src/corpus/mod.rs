//! What it can sound like: recordings in; signals that can be played out.

pub mod cloth;
pub mod dictionary;
pub mod distance;
mod files;
pub mod grains;
pub mod looping;
pub mod naming;
pub mod paper;
pub mod recording;
pub mod resynthesis;
pub mod spectral;
pub mod units;
