//! The AIFF and AIFF-C containers: finds the common chunk and the sound chunk.

use super::pcm::{self, ByteOrder, Encoding};
use super::{CONVERT, Recording, check_header, cut_short};
use crate::error::{Error, Place, Result};

/// What the common chunk says.
struct Common {
    rate_hz: u32,
    channels: usize,
    frames: usize,
    encoding: Encoding,
    order: ByteOrder,
}

/// Reads a whole AIFF or AIFF-C file, whose first 12 bytes have been checked.
pub(super) fn decode(bytes: &[u8]) -> Result<Recording> {
    let is_compressed_form = &bytes[8..12] == b"AIFC";
    let mut common: Option<Common> = None;
    let mut sound = None;
    let mut position = 12usize;
    // The two chunks may come in either order, with others between.
    while let Some(header) = bytes.get(position..position.saturating_add(8)) {
        let start = position + 8;
        let size = ByteOrder::Big.number(&header[4..]) as usize;
        let end = start.saturating_add(size);
        match &header[..4] {
            b"COMM" => {
                let Some(chunk) = bytes.get(start..end) else {
                    return Err(cut_short(
                        &format!("chunk `COMM` at byte {position} has {size} bytes"),
                        bytes,
                    ));
                };
                let place = Place::Byte(position as u64);
                common = Some(read_common(chunk, is_compressed_form).map_err(|e| e.at(place))?);
            }
            // An offset to the first sample and a block size precede the samples.
            b"SSND" if size >= 8 => {
                let Some(offset) = bytes.get(start..start + 4) else {
                    return Err(cut_short(
                        &format!("chunk `SSND` at byte {position} has {size} bytes"),
                        bytes,
                    ));
                };
                let offset = ByteOrder::Big.number(offset) as usize;
                sound = Some((start + 8).saturating_add(offset)..end);
            }
            _ => {}
        }
        if common.is_some() && sound.is_some() {
            break;
        }
        position = end.saturating_add(size & 1);
    }
    let Some(Common { rate_hz, channels, frames, encoding, order }) = common else {
        return Err(cut_short("no format (`COMM` chunk) was found", bytes));
    };
    if frames == 0 {
        return Err(Error::new("the file holds no sound: 0 frames"));
    }
    let Some(sound) = sound else {
        return Err(cut_short(
            &format!("{frames} frames were announced and no `SSND` chunk was found"),
            bytes,
        ));
    };
    let needed = frames.saturating_mul(encoding.bytes() * channels);
    let data_end = sound.start.saturating_add(needed);
    match bytes.get(sound.start..data_end) {
        Some(data) if data_end <= sound.end => pcm::decode(data, rate_hz, channels, encoding, order),
        Some(_) => Err(Error::new(format!(
            "{frames} frames of {} bytes were announced, the sound chunk has but {} bytes",
            encoding.bytes() * channels,
            sound.len()
        ))
        .at(Place::Byte(sound.start as u64))),
        None => {
            Err(cut_short(&format!("{frames} frames from byte {} on were announced", sound.start), bytes))
        }
    }
}

/// Reads the common chunk: channels, frames, bits, rate and, in AIFF-C, the compression.
fn read_common(chunk: &[u8], is_compressed_form: bool) -> Result<Common> {
    let least = if is_compressed_form { 22 } else { 18 };
    if chunk.len() < least {
        return Err(Error::new(format!("the format has {} bytes, expected at least {least}", chunk.len())));
    }
    let number = |from: usize, to: usize| ByteOrder::Big.number(&chunk[from..to]);
    let channels = number(0, 2) as usize;
    let frames = number(2, 6) as usize;
    let bits = number(6, 8) as usize;
    let rate_hz = check_header(extended(number(8, 10) as u16, number(10, 18)), channels)?;
    let compression = if is_compressed_form { &chunk[18..22] } else { b"NONE" };
    let integer = Encoding::Signed { bytes: bits.div_ceil(8) };
    let (encoding, order) = match compression {
        b"NONE" | b"twos" if (1..=32).contains(&bits) => (integer, ByteOrder::Big),
        b"sowt" if (1..=32).contains(&bits) => (integer, ByteOrder::Little),
        b"raw " if (1..=8).contains(&bits) => (Encoding::Unsigned8, ByteOrder::Big),
        b"in16" => (Encoding::Signed { bytes: 2 }, ByteOrder::Big),
        b"in24" => (Encoding::Signed { bytes: 3 }, ByteOrder::Big),
        b"in32" => (Encoding::Signed { bytes: 4 }, ByteOrder::Big),
        b"42ni" => (Encoding::Signed { bytes: 3 }, ByteOrder::Little),
        b"23ni" => (Encoding::Signed { bytes: 4 }, ByteOrder::Little),
        b"fl32" | b"FL32" => (Encoding::Float32, ByteOrder::Big),
        b"fl64" | b"FL64" => (Encoding::Float64, ByteOrder::Big),
        b"alaw" | b"ALAW" => (Encoding::ALaw, ByteOrder::Big),
        b"ulaw" | b"ULAW" => (Encoding::MuLaw, ByteOrder::Big),
        other => {
            let codec = String::from_utf8_lossy(other).into_owned();
            return Err(Error::new(format!("`{codec}` of {bits} bits in an AIFF file is not read here"))
                .help(CONVERT));
        }
    };
    Ok(Common { rate_hz, channels, frames, encoding, order })
}

/// A number in the 80-bit format of the 68881: sign and exponent, then 64 bits of mantissa with the
/// leading 1 written out.
fn extended(sign_and_exponent: u16, mantissa: u64) -> f64 {
    let exponent = i32::from(sign_and_exponent & 0x7fff) - 16383 - 63;
    let magnitude = mantissa as f64 * 2f64.powi(exponent);
    if sign_and_exponent & 0x8000 == 0 { magnitude } else { -magnitude }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extended_numbers_are_read() {
        assert_eq!(extended(0x400e, 0xac44_0000_0000_0000), 44_100.0);
        assert_eq!(extended(0x400b, 0xfa00_0000_0000_0000), 8_000.0);
        assert_eq!(extended(0xbfff, 1 << 63), -1.0);
        assert!(!extended(0x7fff, u64::MAX).is_nan());
    }
}
