//! Samples stored one by one: bytes in, numbers within ±1 out.

use super::{MAX_VALUES, Recording, too_long};
use crate::error::Result;

/// How one sample is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    /// 8 bits, silence at 128.
    Unsigned8,
    /// A two's complement integer of 1 to 4 bytes, its valid bits at the top.
    Signed { bytes: usize },
    /// An IEEE 754 number of 32 bits.
    Float32,
    /// An IEEE 754 number of 64 bits.
    Float64,
    /// ITU-T G.711, European.
    ALaw,
    /// ITU-T G.711, American and Japanese.
    MuLaw,
}

impl Encoding {
    /// Bytes that one sample takes.
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::Unsigned8 | Self::ALaw | Self::MuLaw => 1,
            Self::Signed { bytes } => bytes,
            Self::Float32 => 4,
            Self::Float64 => 8,
        }
    }
}

/// Which byte of a number comes first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ByteOrder {
    /// The least significant.
    Little,
    /// The most significant.
    Big,
}

impl ByteOrder {
    /// The unsigned number in at most 8 bytes.
    pub(super) fn number(self, bytes: &[u8]) -> u64 {
        let push = |sum: u64, byte: &u8| sum << 8 | u64::from(*byte);
        match self {
            Self::Little => bytes.iter().rev().fold(0, push),
            Self::Big => bytes.iter().fold(0, push),
        }
    }
}

/// Decodes interleaved samples; an incomplete frame at the end is left out.
pub(super) fn decode(
    data: &[u8],
    rate_hz: u32,
    channels: usize,
    encoding: Encoding,
    order: ByteOrder,
) -> Result<Recording> {
    let width = encoding.bytes();
    let frames = data.len() / (width * channels);
    if frames.saturating_mul(channels) > MAX_VALUES {
        return Err(too_long());
    }
    let mut planes = vec![Vec::with_capacity(frames); channels];
    for frame in data.chunks_exact(width * channels) {
        for (plane, bytes) in planes.iter_mut().zip(frame.chunks_exact(width)) {
            plane.push(sample(encoding, order.number(bytes)));
        }
    }
    Ok(Recording { rate_hz, channels: planes })
}

/// One sample from its bits.
fn sample(encoding: Encoding, bits: u64) -> f32 {
    match encoding {
        Encoding::Unsigned8 => (bits as f32 - 128.0) / 128.0,
        Encoding::Signed { bytes } => {
            // Shifted to the top of 32 bits, so that the sign is in place; f64 rounds but once.
            let top = (bits << (8 * (4 - bytes.clamp(1, 4)))) as u32 as i32;
            (f64::from(top) / f64::from(1u32 << 31)) as f32
        }
        Encoding::Float32 => f32::from_bits(bits as u32),
        Encoding::Float64 => f64::from_bits(bits) as f32,
        Encoding::ALaw => f32::from(a_law(bits as u8)) / 32768.0,
        Encoding::MuLaw => f32::from(mu_law(bits as u8)) / 32768.0,
    }
}

/// G.711 A-law to 16 bits: sign, 3 bits of exponent, 4 bits of mantissa, every other bit inverted.
fn a_law(code: u8) -> i16 {
    let code = code ^ 0x55;
    let mantissa = i16::from(code & 0x0f) << 4;
    let magnitude = match code >> 4 & 7 {
        0 => mantissa + 8,
        exponent => (mantissa + 0x108) << (exponent - 1),
    };
    if code & 0x80 != 0 { magnitude } else { -magnitude }
}

/// G.711 µ-law to 16 bits: sign, 3 bits of exponent, 4 bits of mantissa, all inverted, biased by 132.
fn mu_law(code: u8) -> i16 {
    let code = !code;
    let magnitude = (((i16::from(code & 0x0f) << 3) + 132) << (code >> 4 & 7)) - 132;
    if code & 0x80 != 0 { -magnitude } else { magnitude }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_scale_is_one_in_every_width() {
        for bytes in 1..=4 {
            let lowest = 1u64 << (8 * bytes - 1);
            let encoding = Encoding::Signed { bytes };
            assert_eq!(sample(encoding, lowest), -1.0);
            assert_eq!(sample(encoding, lowest >> 1), 0.5);
            assert_eq!(sample(encoding, 0), 0.0);
        }
        assert_eq!(sample(Encoding::Unsigned8, 0), -1.0);
        assert_eq!(sample(Encoding::Unsigned8, 192), 0.5);
    }

    #[test]
    fn companded_samples_are_those_of_g_711() {
        // Values of the tables of G.711, scaled from 13 and 14 bits to 16.
        assert_eq!([a_law(0xd5), a_law(0x55), a_law(0xaa), a_law(0x2a)], [8, -8, 32256, -32256]);
        assert_eq!([mu_law(0xff), mu_law(0x7f), mu_law(0x80), mu_law(0x00)], [0, 0, 32124, -32124]);
        let rising: Vec<i16> = (0x80..=0xffu8).rev().map(mu_law).collect();
        assert!(rising.is_sorted(), "{rising:?}");
    }

    #[test]
    fn frames_are_taken_apart_and_a_partial_one_is_left_out() {
        let data = [0, 64, 0, 192, 0, 32, 0, 0, 9];
        let recording = decode(&data, 8000, 2, Encoding::Signed { bytes: 2 }, ByteOrder::Little).unwrap();
        assert_eq!(recording.channels, [[0.5, 0.25], [-0.5, 0.0]]);
        let swapped = [64, 0, 192, 0];
        let recording = decode(&swapped, 8000, 2, Encoding::Signed { bytes: 2 }, ByteOrder::Big).unwrap();
        assert_eq!(recording.channels, [[0.5], [-0.5]]);
    }
}
