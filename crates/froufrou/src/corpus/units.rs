//! Concatenative synthesis: a target sound made again of units of recordings.
//!
//! After An, James & Marschner (2012, section 5): target and recordings are cut into units of a few milliseconds that do
//! not overlap, and each unit of the target is replaced by one of the recordings that is near to it.
//!
//! | step | what is done |
//! | --- | --- |
//! | [`features`] | each unit becomes a few numbers: the cepstrum of a few mel bands |
//! | [`smoothing`] | those numbers over time, under a Gaussian |
//! | [`correspondences`] | which clips of the target should sound like which clips of the recordings |
//! | [`warp`] | a thin-plate spline that carries features of the target to where the recordings have theirs |
//! | [`suggestion`] | correspondences, or a whole warp, where nobody named any |
//! | [`selection`] | the nearest unit, continuous over some units, and none again too soon |
//! | [`optimal`] | the same for whole sounds, by dynamic programming |
//! | [`concatenation`] | units become sound, joined where they cross zero |
//! | [`folder`] | a corpus on disk: recordings, `corpus.toml`, and a cache of what was computed from them |
//!
//! Units are counted from 0 over all streams of a corpus: a stream is a channel of a recording, or where channels belong
//! together, all of its channels.

pub mod concatenation;
pub mod correspondences;
pub mod features;
pub mod folder;
pub mod high_pass;
pub mod optimal;
pub mod selection;
pub mod smoothing;
pub mod suggestion;
pub mod warp;

mod settings;

pub use settings::{Channels, FeatureSettings, Logarithm, SelectionSettings, Settings, Window};
