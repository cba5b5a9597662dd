//! A sound file of either kind, told by its name.

use std::path::Path;

use super::flac::FlacWriter;
use super::format::{SoundFormat, Written};
use super::labels::Labels;
use super::meter::Report;
use super::wav::WavWriter;
use crate::error::{Error, Result};

/// What a sound is wrapped in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Container {
    /// WAV, or RF64 where that is too small.
    Wav,
    /// FLAC: the same samples in about half the bytes.
    Flac,
}

impl Container {
    /// By the ending of a file's name, in capitals or not.
    ///
    /// ```
    /// use froufrou::render::sound_file::Container;
    /// assert_eq!(Container::of("out.FLAC")?, Container::Flac);
    /// assert!(Container::of("out.mp3").is_err());
    /// # Ok::<(), froufrou::Error>(())
    /// ```
    ///
    /// # Errors
    /// Any other ending than `.wav` and `.flac`, or none; a folder.
    pub fn of(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        if path.is_dir() {
            return Err(Error::new("expected the name of a file to write, found a folder").in_file(path));
        }
        let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        match ending.as_str() {
            "wav" | "wave" => Ok(Self::Wav),
            "flac" => Ok(Self::Flac),
            "" => Err(Error::new(
                "a sound file's name tells its format, expected one that ends in `.wav` or `.flac`",
            )
            .in_file(path)),
            _ => Err(Error::new(format!("sound is written as `.wav` or `.flac`, not as `.{ending}`"))
                .in_file(path)),
        }
    }

    /// How names of its files end.
    pub fn ending(self) -> &'static str {
        match self {
            Self::Wav => "wav",
            Self::Flac => "flac",
        }
    }
}

/// Writes one sound file, block by block. It is seen under its name when it is complete.
pub enum SoundWriter {
    /// Of WAV.
    Wav(Box<WavWriter>),
    /// Of FLAC.
    Flac(Box<FlacWriter>),
}

impl SoundWriter {
    /// Begins a file.
    ///
    /// # Errors
    /// Those of [`WavWriter::labelled`] and [`FlacWriter::labelled`].
    pub fn create(container: Container, path: &Path, format: SoundFormat, labels: Labels) -> Result<Self> {
        Ok(match container {
            Container::Wav => Self::Wav(Box::new(WavWriter::labelled(path, format, labels)?)),
            Container::Flac => Self::Flac(Box::new(FlacWriter::labelled(path, format, labels)?)),
        })
    }

    /// Writes the next frames, their channels interleaved.
    ///
    /// # Errors
    /// Where the length is not a multiple of the channels or the disk is full.
    pub fn write(&mut self, interleaved: &[f32]) -> Result<()> {
        match self {
            Self::Wav(writer) => writer.write(interleaved),
            Self::Flac(writer) => writer.write(interleaved),
        }
    }

    /// Takes what the sound measures into what the file says of itself.
    pub fn measured(&mut self, report: &Report) {
        match self {
            Self::Wav(writer) => writer.measured(report),
            Self::Flac(writer) => writer.measured(report),
        }
    }

    /// Completes the file and gives it its name, in place of an earlier one.
    ///
    /// # Errors
    /// Where the disk is full or the name has become impossible; then the earlier file is untouched.
    pub fn finish(self) -> Result<Written> {
        match self {
            Self::Wav(writer) => writer.finish(),
            Self::Flac(writer) => writer.finish(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_tells_the_container() {
        assert_eq!(Container::of("a/b.wav").unwrap(), Container::Wav);
        assert_eq!(Container::of("b.flac.WAV").unwrap(), Container::Wav);
        let error = Container::of("out.mp3").unwrap_err().to_string();
        assert_eq!(error, "out.mp3: sound is written as `.wav` or `.flac`, not as `.mp3`");
        for name in ["out", ".wav", "wav"] {
            let error = Container::of(name).unwrap_err().to_string();
            assert!(error.contains("ends in `.wav` or `.flac`"), "{error}");
        }
    }
}
