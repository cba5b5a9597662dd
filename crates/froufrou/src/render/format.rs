//! What a sound file is to be like, whatever its container.

use std::fmt;
use std::str::FromStr;

use crate::error::{Error, Result};

/// How samples are stored.
///
/// ```
/// use froufrou::render::format::SampleFormat;
/// assert_eq!("24".parse::<SampleFormat>()?, SampleFormat::Int24);
/// assert_eq!(SampleFormat::Float32.to_string(), "32f");
/// assert!("20".parse::<SampleFormat>().is_err());
/// # Ok::<(), froufrou::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SampleFormat {
    /// Integers of 16 bits, with triangular dither of ±1 step.
    Int16,
    /// Integers of 24 bits, rounded.
    Int24,
    /// Floats of 32 bits, as they are.
    Float32,
}

impl SampleFormat {
    /// Bits that one sample takes.
    pub fn bits(self) -> u16 {
        match self {
            Self::Int16 => 16,
            Self::Int24 => 24,
            Self::Float32 => 32,
        }
    }

    /// Bytes that one sample takes.
    pub fn bytes(self) -> usize {
        usize::from(self.bits() / 8)
    }
}

impl FromStr for SampleFormat {
    type Err = Error;

    /// Reads "16", "24" or "32f".
    fn from_str(text: &str) -> Result<Self> {
        match text {
            "16" => Ok(Self::Int16),
            "24" => Ok(Self::Int24),
            "32f" => Ok(Self::Float32),
            _ => Err(Error::new(format!("unknown sample format `{text}`, expected `16`, `24` or `32f`"))),
        }
    }
}

impl fmt::Display for SampleFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Int16 => "16",
            Self::Int24 => "24",
            Self::Float32 => "32f",
        })
    }
}

/// What a sound file is to be like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SoundFormat {
    /// Frames a second.
    pub rate_hz: u32,
    /// Channels: 1 to 64 of a WAV file, 1 to 8 of a FLAC file.
    pub channels: usize,
    /// How samples are stored.
    pub samples: SampleFormat,
    /// The seed of the dither.
    pub seed: u64,
    /// The index, in the whole soundtrack, of the first frame of this file. The dither of a frame
    /// depends on its index in the soundtrack: a range rendered alone has the same samples as that
    /// range of the whole.
    pub first_frame: u64,
}

/// What was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Written {
    /// Frames.
    pub frames: u64,
    /// Samples, over all channels, beyond what integers hold ([−1, 1) once rounded): they were clamped.
    /// Floats are never clamped and this is 0.
    pub clipped: u64,
    /// Samples that were not a number, written as silence to integers and as they are to floats.
    pub not_a_number: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_have_names() {
        for format in [SampleFormat::Int16, SampleFormat::Int24, SampleFormat::Float32] {
            assert_eq!(format.to_string().parse::<SampleFormat>().unwrap(), format);
        }
        let error = "32".parse::<SampleFormat>().unwrap_err().to_string();
        assert_eq!(error, "unknown sample format `32`, expected `16`, `24` or `32f`");
    }
}
