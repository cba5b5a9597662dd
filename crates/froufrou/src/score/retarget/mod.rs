//! From contacts to grains (Picard, Tsingos & Faure 2009, section 4): which grains of a corpus play for an impact, and
//! which one after the other for as long as bodies slide or roll.
//!
//! | contact | what plays |
//! | --- | --- |
//! | impact | a [`Hit`]: an onset of an impulsive recording and all that rings after it, one of those that were recorded about as strong, never the same twice running |
//! | slide, roll | a [`Stream`] of grains for each part of the sound, along the pattern of a recording of that kind, without gaps |
//!
//! A [`Repertoire`] says what there is to choose from. None of them knows of scenes or of time in the world: who
//! drives them gives the strength of an impact, or the speed and load of a contact, and places what comes out.

mod hit;
mod repertoire;
mod shader;
mod stream;
#[cfg(test)]
mod tests;

pub use hit::{Hit, LONGEST_LEAD_S};
pub use repertoire::Repertoire;
pub use shader::{Shader, Struck};
pub use stream::{Course, Stream};

use super::Grain;

/// A grain, and when it begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Play {
    /// In seconds: of a hit since its onset, and below 0 before it; of a stream since its beginning.
    pub time_s: f64,
    /// The grain, and how it is played.
    pub grain: Grain,
}
