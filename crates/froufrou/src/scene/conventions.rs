//! What a file does not say of itself, or says wrongly: its up axis, its unit of length, its frame
//! rate, where its faces are, and which of its clips is meant.

use std::path::PathBuf;

use super::pose_log::PoseColumns;
use crate::{Error, Result};

/// The frame rate that is taken where neither the file nor the scene says one, in hertz: that of
/// film.
pub const DEFAULT_FRAME_RATE_HZ: f64 = 24.0;

/// The axis that points up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum UpAxis {
    /// Y, as in this crate.
    #[default]
    Y,
    /// Z: (x, y, z) becomes (x, z, −y).
    Z,
}

/// How the numbers of an animation file are meant; what is not set is as the file says.
///
/// ```
/// use froufrou::scene::conventions::{Conventions, UpAxis};
/// // Centimetres, Z up.
/// let maya = Conventions { up: Some(UpAxis::Z), unit_m: Some(0.01), ..Conventions::default() };
/// assert_ne!(maya, Conventions::default());
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Conventions {
    /// The axis that points up in the file; Y where the file does not say.
    pub up: Option<UpAxis>,
    /// Metres in the file's unit of length, above 0; 1 where the file does not say.
    pub unit_m: Option<f64>,
    /// Frames a second, above 0, of files that count frames: PC2 and sequences of OBJ files;
    /// [`DEFAULT_FRAME_RATE_HZ`] where nothing is set. Files in seconds have no use for it.
    pub frame_rate_hz: Option<f64>,
    /// The file with the faces of a point cache; where nothing is set, the OBJ file of the same name
    /// beside it, if there is one.
    pub faces: Option<PathBuf>,
    /// The clip that is played, by its name, of files that hold several; the first where nothing is
    /// set.
    pub clip: Option<String>,
    /// Which columns of a pose log hold what; found by their usual names where nothing is set.
    pub columns: Option<PoseColumns>,
}

impl Conventions {
    /// Frames a second of a file that counts frames.
    pub(crate) fn frame_rate_hz(&self) -> f64 {
        self.frame_rate_hz.unwrap_or(DEFAULT_FRAME_RATE_HZ)
    }

    /// Refuses numbers that mean nothing.
    ///
    /// # Errors
    /// A unit or frame rate that is not a finite number above 0.
    pub(crate) fn check(&self) -> Result<()> {
        let sound = |value: Option<f64>| value.is_none_or(|v| v.is_finite() && v > 0.0);
        for (what, value) in [("a unit of", self.unit_m), ("a frame rate of", self.frame_rate_hz)] {
            if let Some(number) = value.filter(|_| !sound(value)) {
                return Err(Error::new(format!("{what} {number}")).help("give a finite number above 0"));
            }
        }
        Ok(())
    }
}
