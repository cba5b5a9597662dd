//! What cloth sounds like (An, James & Marschner 2012): spectra of its friction over speed and the pops of its
//! crumpling, from recordings or from models. Nothing here knows of meshes.
//!
//! | part | what it is |
//! | --- | --- |
//! | [`spectra`] | the spectrum of friction at any speed, between those that were measured |
//! | [`clips`] | measures them in recordings whose speed is known by a [`motion`] |
//! | [`pops`] | cuts pops out of recordings |
//! | [`playback`] | chooses a pop for each buckling of an animation |
//! | [`ClothSound`] | both together, of one cloth |
//! | [`manifest`], [`folder`] | a corpus on disk: its `corpus.toml`, and what is computed of its recordings |
//! | [`synthetic`] | cloths that sound with no recordings |
//! | [`preset`] | the numbers of the paper |

pub mod clips;
pub mod folder;
pub mod manifest;
pub mod motion;
pub mod playback;
pub mod pops;
pub mod preset;
pub mod spectra;
pub mod synthetic;

use std::path::Path;

use self::spectra::FrictionSpectra;
use self::synthetic::Cloth;
use super::dictionary::prepare;
use crate::error::Result;

/// The friction of a cloth.
#[derive(Debug, Clone, PartialEq)]
pub struct Friction {
    /// Its spectra, as loud as they were recorded.
    pub spectra: FrictionSpectra,
    /// How much cloth rubbed in the recording: a vertex of an area has that part of it as its weight.
    pub area_m2: f64,
}

/// A pop, without its samples.
#[derive(Debug, Clone, PartialEq)]
pub struct PopEntry {
    /// The recording that it is from, or the model.
    pub from: String,
    /// When it begins there, in seconds.
    pub begin_s: f64,
    /// How long it is.
    pub length_s: f64,
    /// Squares of full scale times seconds.
    pub energy: f64,
    /// From its beginning to the middle of its energy: it begins so much before its event.
    pub lead_s: f64,
}

/// Where the samples of pops come from.
#[derive(Debug, Clone, PartialEq)]
enum PopSource {
    /// From recordings: the rate of each pop, and its samples.
    Recorded(Vec<(u32, Vec<f32>)>),
    /// From a model, at any rate.
    Synthetic(Cloth),
}

/// The sound of one cloth.
#[derive(Debug, Clone, PartialEq)]
pub struct ClothSound {
    name: String,
    friction: Option<Friction>,
    pops: Vec<PopEntry>,
    source: PopSource,
}

impl ClothSound {
    /// The sound of a corpus by its name: `synthetic/cotton` and other [models](synthetic), else a folder as seen from another.
    ///
    /// # Errors
    /// A model that there is not, or a corpus that cannot be read.
    pub fn named(name: &str, folder: &Path) -> Result<Self> {
        match Cloth::named(name) {
            Some(cloth) => Ok(cloth?.sound()),
            None => Self::open(&folder.join(name)),
        }
    }

    /// What it is called.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// How it rubs, if that is known.
    pub fn friction(&self) -> Option<&Friction> {
        self.friction.as_ref()
    }

    /// Its pops; none where it only rubs.
    pub fn pops(&self) -> &[PopEntry] {
        &self.pops
    }

    /// The samples of all pops, in their order, at a rate.
    ///
    /// # Errors
    /// A rate that is not one of sound.
    pub fn pop_samples(&self, rate_hz: u32) -> Result<Vec<Vec<f32>>> {
        match &self.source {
            PopSource::Recorded(pops) => {
                pops.iter().map(|(own_hz, pop)| prepare::at_rate(pop.clone(), *own_hz, rate_hz)).collect()
            }
            PopSource::Synthetic(cloth) => {
                super::spectral::check_sound(&[0.0], rate_hz)?;
                Ok(cloth.pops(f64::from(rate_hz)))
            }
        }
    }
}
