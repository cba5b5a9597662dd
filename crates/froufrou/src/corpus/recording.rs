//! Reading recordings: any ordinary audio file in, its samples out.
//!
//! | format | what is read | how its length is known |
//! | --- | --- | --- |
//! | WAV, RF64 | integers of 8 to 32 bits, floats of 32 and 64 bits, A-law, µ-law; plain and extensible headers | the data chunk's size; a streamed file (size 0 or the largest there is) goes on to its end |
//! | AIFF, AIFF-C | the same, in either byte order | the common chunk's frame count |
//! | FLAC | all | the stream info's frame count; the decoded sound is checked against its MD5 |
//! | Ogg Vorbis | all; channels in the order of WAV | the granule position of the last page; a stream without a last page is read as far as its pages are whole |
//! | MP3 | MPEG 1, 2 and 2.5, layer III | the encoder's delay and padding are cut off where a LAME tag tells them |
//!
//! A file that promises more sound than it holds is an error that names the byte where it ends, never
//! a shorter recording. So is a sample that is not a finite number. No count in a header is trusted
//! with memory: what is allocated grows with what has been decoded.

mod aiff;
mod compressed;
pub(crate) mod ogg;
mod pcm;
mod wav;

use std::path::Path;

use crate::error::{Error, Place, Result};

/// The most sample values, over all channels, that one recording may hold: 8 GiB of them.
const MAX_VALUES: usize = 1 << 31;

/// The most bytes a file may have: the longest recording, stored in the widest samples.
const MAX_FILE_BYTES: u64 = 8 * MAX_VALUES as u64 + (1 << 20);

/// The most channels a recording may have.
const MAX_CHANNELS: usize = 64;

/// Sampling rates outside of this are taken for a corrupt header.
const RATES_HZ: std::ops::RangeInclusive<u32> = 1_000..=768_000;

/// What to do with a file that cannot be read, where nothing better is known.
const CONVERT: &str = "convert it, for instance with `ffmpeg -i in -c:a pcm_s24le out.wav`";

/// A recorded sound: what a microphone heard, as numbers.
///
/// ```
/// use froufrou::corpus::recording::Recording;
/// // A WAV file of two frames of 16 bits, mono, at 8 kHz.
/// let mut bytes = b"RIFF\x28\0\0\0WAVEfmt \x10\0\0\0\x01\0\x01\0".to_vec();
/// bytes.extend_from_slice(b"\x40\x1f\0\0\x80\x3e\0\0\x02\0\x10\0data\x04\0\0\0\0\x40\0\xc0");
/// let recording = Recording::decode(&bytes, "click.wav")?;
/// assert_eq!(recording.rate_hz, 8000);
/// assert_eq!(recording.channels, [[0.5, -0.5]]);
/// # Ok::<(), froufrou::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// Frames a second.
    pub rate_hz: u32,
    /// The samples of every channel, nominally within ±1 (lossy formats and floats may go beyond),
    /// all finite and all channels equally long. Channels are in the order of the file; those of
    /// Vorbis in the order of WAV (left, right, centre, low frequency, back, side).
    pub channels: Vec<Vec<f32>>,
}

impl Recording {
    /// Reads an audio file; its kind is told by its content, not by its name.
    ///
    /// # Errors
    /// Where the file is missing, a folder, empty, not audio, of a kind not read here (the error says
    /// which and what to convert it to), cut short, corrupt, larger than 2³¹ sample values, or holds
    /// no sound.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let metadata = std::fs::metadata(path).map_err(|e| Error::io("open", path, e))?;
        if metadata.is_dir() {
            return Err(Error::new("expected an audio file, found a folder").in_file(path));
        }
        if !metadata.is_file() {
            return Err(Error::new("expected an audio file, found a pipe or a device").in_file(path));
        }
        if metadata.len() > MAX_FILE_BYTES {
            return Err(too_long().in_file(path));
        }
        let bytes = std::fs::read(path).map_err(|e| Error::io("read", path, e))?;
        Self::decode(&bytes, &path.to_string_lossy())
    }

    /// Reads an audio file that is in memory already. The name stands in errors, and where it ends in
    /// `.mp3` the content may begin with bytes that are not audio.
    ///
    /// # Errors
    /// Those of [`Recording::open`].
    pub fn decode(bytes: &[u8], name: &str) -> Result<Self> {
        decode_any(bytes, name).and_then(Self::checked).map_err(|e| e.in_file(name))
    }

    /// The number of frames: samples of one channel.
    pub fn frames(&self) -> usize {
        self.channels.first().map_or(0, Vec::len)
    }

    /// Length in seconds.
    pub fn duration_s(&self) -> f64 {
        self.frames() as f64 / f64::from(self.rate_hz)
    }

    /// The average of all channels.
    pub fn mono(&self) -> Vec<f32> {
        match self.channels.as_slice() {
            [one] => one.clone(),
            channels => {
                let scale = 1.0 / channels.len().max(1) as f64;
                (0..self.frames())
                    .map(|i| (channels.iter().map(|c| f64::from(c[i])).sum::<f64>() * scale) as f32)
                    .collect()
            }
        }
    }

    /// The samples of one channel, counted from 0; `None` where there is no such channel.
    pub fn channel(&self, index: usize) -> Option<&[f32]> {
        self.channels.get(index).map(Vec::as_slice)
    }

    /// What holds for every recording, however it was coded.
    fn checked(self) -> Result<Self> {
        if self.frames() == 0 {
            return Err(Error::new("the file holds no sound: 0 frames"));
        }
        for (number, channel) in self.channels.iter().enumerate() {
            if let Some(frame) = channel.iter().position(|v| !v.is_finite()) {
                let value = channel[frame];
                return Err(Error::new(format!("the sample is {value}, expected a finite number"))
                    .at(Place::Part(format!("frame {frame}, channel {number}"))));
            }
        }
        Ok(self)
    }
}

/// Finds the reader by the first bytes.
fn decode_any(bytes: &[u8], name: &str) -> Result<Recording> {
    if bytes.is_empty() {
        return Err(Error::new("expected an audio file, found an empty one"));
    }
    let (bytes, skipped) = compressed::after_id3v2(bytes)?;
    let form = bytes.get(8..12).unwrap_or_default();
    let unsupported = |what: &str| Err(Error::new(format!("{what} is not read here")).help(CONVERT));
    match bytes {
        [b'R', b'I', b'F', b'F' | b'X', ..] | [b'R', b'F', b'6', b'4', ..] if form == b"WAVE" => {
            wav::decode(bytes)
        }
        [b'B', b'W', b'6', b'4', ..] if form == b"WAVE" => wav::decode(bytes),
        [b'F', b'O', b'R', b'M', ..] if form == b"AIFF" || form == b"AIFC" => aiff::decode(bytes),
        [b'f', b'L', b'a', b'C', ..] => compressed::decode_flac(bytes),
        [b'O', b'g', b'g', b'S', ..] => ogg::decode(bytes),
        [0xff, second, ..] if second & 0xe0 == 0xe0 => match second >> 1 & 3 {
            0b01 => compressed::decode_mp3(bytes),
            0b10 => unsupported("MPEG audio layer II (MP2)"),
            0b11 => unsupported("MPEG audio layer I (MP1)"),
            _ => unsupported("AAC"),
        },
        [b'c', b'a', b'f', b'f', ..] => unsupported("CAF"),
        [b'r', b'i', b'f', b'f', ..] => unsupported("Wave64"),
        [b'w', b'v', b'p', b'k', ..] => unsupported("WavPack"),
        [b'M', b'A', b'C', b' ', ..] => unsupported("Monkey's Audio"),
        [b'.', b's', b'n', b'd', ..] => unsupported("AU"),
        [0x1a, 0x45, 0xdf, 0xa3, ..] => unsupported("Matroska or WebM"),
        [_, _, _, _, b'f', b't', b'y', b'p', ..] => unsupported("MP4 (AAC or ALAC)"),
        _ if skipped > 0 || name.to_ascii_lowercase().ends_with(".mp3") => compressed::decode_mp3(bytes),
        _ => {
            Err(Error::new("this is not audio that can be read: expected WAV, AIFF, FLAC, Ogg Vorbis or MP3")
                .at(Place::Byte(skipped as u64))
                .help(CONVERT))
        }
    }
}

/// Checks what a header says of the rate and the channels; gives the channel count to use.
fn check_header(rate_hz: f64, channels: usize) -> Result<u32> {
    let rate = rate_hz.round();
    if !(f64::from(*RATES_HZ.start())..=f64::from(*RATES_HZ.end())).contains(&rate) {
        return Err(Error::new(format!(
            "the header gives a sampling rate of {rate_hz} Hz, expected {} to {} Hz",
            RATES_HZ.start(),
            RATES_HZ.end()
        )));
    }
    if !(1..=MAX_CHANNELS).contains(&channels) {
        return Err(Error::new(format!(
            "the header gives {channels} channels, expected 1 to {MAX_CHANNELS}"
        )));
    }
    Ok(rate as u32)
}

/// The error of a file whose header promises more than there is.
fn cut_short(promised: &str, bytes: &[u8]) -> Error {
    Error::new(format!("the file is cut short: {promised}, but the file ends here"))
        .at(Place::Byte(bytes.len() as u64))
        .help("copy or export it again")
}

/// The error of a recording beyond the cap.
fn too_long() -> Error {
    Error::new(format!("the recording is longer than {MAX_VALUES} sample values"))
        .help("cut it into shorter files")
}

/// Adds a block of decoded samples, one slice for each channel, unless the recording gets too long.
fn append(channels: &mut [Vec<f32>], block: &[Vec<f32>]) -> Result<()> {
    let values: usize = channels.iter().zip(block).map(|(c, b)| c.len().saturating_add(b.len())).sum();
    if values > MAX_VALUES {
        return Err(too_long());
    }
    for (channel, block) in channels.iter_mut().zip(block) {
        channel.extend_from_slice(block);
    }
    Ok(())
}

/// Runs a decoder that is not ours. They return errors for nearly all corrupt files, but some make
/// them panic (of 20 000 damaged Vorbis files, with their checksums set right, one overflowed a sum
/// in `lewton`). That is an error like any other, after the message that a panic prints; a program
/// built to abort on panics ends there.
fn contained<T>(decoder: &str, decode: impl FnOnce() -> Result<T>) -> Result<T> {
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(decode)).unwrap_or_else(|_| {
        Err(Error::new(format!("the file is corrupt: its {decoder} data does not decode")))
    })
}
