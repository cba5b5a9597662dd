//! Cameras: what the lens sees; where it is, its transform says.

use super::archive::{Archive, Compound};
use super::fault::{Allowance, Fault, Outcome};
use super::ogawa::Ogawa;
use super::property::Property;
use crate::scene::animation::KeyTimes;

/// How wide a camera sees. It looks along its local −Z with +Y up; overscan, offsets of the film,
/// depth of field and clipping are not read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// Focal length in millimetres.
    pub focal_length_mm: f64,
    /// Width of the film or sensor in millimetres.
    pub horizontal_aperture_mm: f64,
    /// Height of the film or sensor in millimetres.
    pub vertical_aperture_mm: f64,
}

impl Lens {
    /// The angle between the left and the right edge of the picture in radians.
    pub fn horizontal_field_of_view_rad(&self) -> f64 {
        2.0 * (self.horizontal_aperture_mm / (2.0 * self.focal_length_mm)).atan()
    }

    /// The angle between the lower and the upper edge of the picture in radians.
    pub fn vertical_field_of_view_rad(&self) -> f64 {
        2.0 * (self.vertical_aperture_mm / (2.0 * self.focal_length_mm)).atan()
    }
}

/// A camera whose lens may change.
#[derive(Debug)]
pub(super) struct Camera {
    /// Sixteen numbers: focal length in millimetres, horizontal aperture in centimetres, its
    /// offset, vertical aperture in centimetres, and twelve more.
    core: Option<Property>,
}

impl Camera {
    /// From its schema's compound.
    ///
    /// # Errors
    /// Damage.
    pub(super) fn new(compound: &Compound, archive: &Archive) -> Outcome<Self> {
        Ok(Self { core: compound.property(".core", archive)?.filter(|property| !property.is_empty()) })
    }

    /// When the lens changes.
    ///
    /// # Errors
    /// Times too many for the allowance.
    pub(super) fn key_times(&self, memory: &mut Allowance) -> Outcome<KeyTimes> {
        self.core.as_ref().map_or(Ok(KeyTimes::Static), |core| core.key_times(memory))
    }

    /// The lens at a time.
    ///
    /// # Errors
    /// A sample that cannot be read.
    pub(super) fn lens(&self, time_s: f64, ogawa: &Ogawa) -> Outcome<Option<Lens>> {
        let Some(core) = &self.core else { return Ok(None) };
        let bracket = core.bracket(time_s);
        let before = self.sample(core, bracket.floor, ogawa)?;
        let after = self.sample(core, bracket.ceiling, ogawa)?;
        let mix = |a: f64, b: f64| a * (1.0 - bracket.fraction) + b * bracket.fraction;
        Ok(Some(Lens {
            focal_length_mm: mix(before.focal_length_mm, after.focal_length_mm),
            horizontal_aperture_mm: mix(before.horizontal_aperture_mm, after.horizontal_aperture_mm),
            vertical_aperture_mm: mix(before.vertical_aperture_mm, after.vertical_aperture_mm),
        }))
    }

    fn sample(&self, core: &Property, index: u32, ogawa: &Ogawa) -> Outcome<Lens> {
        match core.f64s(core.stored(index), ogawa)?.as_slice() {
            [focal_length_mm, horizontal_cm, _, vertical_cm, ..] => Ok(Lens {
                focal_length_mm: *focal_length_mm,
                horizontal_aperture_mm: horizontal_cm * 10.0,
                vertical_aperture_mm: vertical_cm * 10.0,
            }),
            values => Err(Fault::new(
                format!("the camera has {} of its 16 numbers", values.len()),
                "the file is damaged: export it again",
            )),
        }
    }
}
