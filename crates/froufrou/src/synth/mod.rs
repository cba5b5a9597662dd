//! What the signal is: threads in, samples out, block by block.

pub mod instrument;
pub mod mixer;
pub mod path;
pub mod procedure;
pub mod prototypes;
pub mod sinc;
pub mod voice;
