//! The header of PC2: a signature, then version, number of vertices, first frame, frames per sample
//! and number of samples, each of four bytes, little-endian.

use std::path::Path;

use super::{Layout, check_length, damage, read};
use crate::scene::animation::KeyTimes;
use crate::scene::positioned_file::PositionedFile;
use crate::{Error, Place, Result};

/// What every PC2 file begins with.
pub(super) const SIGNATURE: &[u8; 12] = b"POINTCACHE2\0";

/// The length of the header.
const HEAD_BYTES: u64 = 32;

/// Reads the header.
///
/// # Errors
/// Another version, numbers that mean nothing, or a length that is not what they claim.
pub(super) fn layout(path: &Path, file: &PositionedFile, frame_rate_hz: f64) -> Result<Layout> {
    let mut fields = [0; 20];
    read(path, file, &mut fields, SIGNATURE.len() as u64)?;
    let (words, _) = fields.as_chunks::<4>();
    let word = |index: usize| words.get(index).copied().unwrap_or_default();
    let count = |index: usize, what: &str| {
        let number = i32::from_le_bytes(word(index));
        u32::try_from(number).map_err(|_| damage(path, 12 + 4 * index as u64, format!("{number} {what}")))
    };
    let version = i32::from_le_bytes(word(0));
    if version != 1 {
        return Err(Error::new(format!("PC2 of version {version}; only version 1 is known"))
            .in_file(path)
            .at(Place::Byte(12))
            .help("export it again as PC2, or as MDD or Alembic"));
    }
    let (points, samples) = (count(1, "vertices")?, count(4, "samples")?);
    let (start, step) = (f32::from_le_bytes(word(2)), f32::from_le_bytes(word(3)));
    if samples == 0 {
        return Err(damage(path, 28, "there are no samples"));
    }
    check_length(path, file, "samples", samples, points, HEAD_BYTES)?;
    // Of a mesh without vertices any number of samples takes no bytes, and says nothing.
    let key_times = if samples < 2 || points == 0 {
        KeyTimes::Static
    } else {
        let (start_s, step_s) = (f64::from(start) / frame_rate_hz, f64::from(step) / frame_rate_hz);
        let last_s = start_s + step_s * f64::from(samples - 1);
        // A step that is lost in the sum is none.
        if !(step > 0.0 && last_s.is_finite() && start_s < start_s + step_s && last_s - step_s < last_s) {
            return Err(damage(path, 20, format!("a sample every {step} frames from frame {start} on")));
        }
        KeyTimes::Uniform { start_s, step_s, count: samples as usize }
    };
    Ok(Layout { points, key_times, frames: None, data_at: HEAD_BYTES, decode: f32::from_le_bytes })
}
