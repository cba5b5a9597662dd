//! What the signal is: threads in, samples out, block by block.

pub mod bus;
pub mod cloth;
mod filter;
pub mod friction;
mod gate;
pub mod grains;
pub mod instrument;
pub(crate) mod kernel;
pub mod membrane;
pub mod mixer;
pub mod modal;
pub mod needle;
pub mod paper;
pub mod path;
pub mod procedure;
pub mod prototypes;
pub mod receivers;
mod short;
pub mod sinc;
mod source;
mod spectrum;
pub mod stick_slip;
mod stretch;
mod tails;
mod tiny;
pub mod turbulence;
pub mod voice;
