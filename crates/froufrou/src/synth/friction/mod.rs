//! Friction of many points at once, for what no number of points costs more than one.
//!
//! Noises of points that rub are independent, so their powers add: the points that are heard from one direction, at speeds
//! s_v and with weights w_v (an area times the square of a gain), sound together as one noise of the amplitude
//! density √Σ w_v A(f, s_v)². So no point has a signal of its own. A [`SpeedHistogram`] gathers how much of the
//! cloth moves how fast, which takes the time of an addition a point; a [`FrictionTable`] has A² over speed, so a
//! spectrum is the table times the histogram; and one [`voice`] makes one noise of it.
//!
//! A score tells a thread a few [`Part`]s of the histogram, each a speed with a level and a spread.

pub(crate) mod noise;
mod table;
pub mod voice;

pub use table::{FrictionTable, Part, SpeedHistogram};

/// How many parts a thread can be told.
pub const PARTS: usize = 4;

#[cfg(test)]
mod tests;
