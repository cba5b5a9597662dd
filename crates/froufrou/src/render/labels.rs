//! What a sound file says of itself besides the sound: its container, its loudspeakers, what it is
//! called. Read from the beginning of the file, without the sound.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use serde::Serialize;

use super::broadcast::Broadcast;
use super::speakers;
use crate::error::{Error, Place, Result};

/// The most bytes of a chunk or block that is looked into.
const MAX_BYTES: u64 = 1 << 24;

/// The most chunks before the sound.
const MAX_CHUNKS: usize = 10_000;

/// What a file is to say, or says, of its sound.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Labels {
    /// The loudspeakers that its channels are for, see [`speakers`].
    pub channel_mask: u32,
    /// What it is.
    pub broadcast: Option<Broadcast>,
}

/// What was found in a file.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Found {
    /// Bits of a sample.
    pub bits: u16,
    /// Whether its samples are floats.
    pub is_float: bool,
    /// The loudspeakers of its channels; `None`: it does not say.
    pub channel_mask: Option<u32>,
    /// The `bext` chunk of a WAV file.
    pub broadcast: Option<Broadcast>,
    /// The tags of a FLAC file, names and values.
    pub tags: Vec<(String, String)>,
}

/// Looks into a WAV, RF64 or FLAC file; `None` for a file of any other kind.
///
/// # Errors
/// A file that cannot be read, or ends before its sound begins.
pub fn read(path: impl AsRef<Path>) -> Result<Option<Found>> {
    let path = path.as_ref();
    let file = File::open(path).map_err(|fault| Error::io("open", path, fault))?;
    let length = file.metadata().map_err(|fault| Error::io("read", path, fault))?.len();
    let mut source = Source { file: BufReader::new(file), at: 0, length };
    let found = match source.bytes(4).as_deref() {
        Ok(b"fLaC") => source.flac().map(Some),
        Ok(b"RIFF" | b"RF64" | b"BW64") => source.wav(),
        _ => Ok(None),
    };
    found.map_err(|fault| fault.in_file(path))
}

struct Source {
    file: BufReader<File>,
    at: u64,
    length: u64,
}

impl Source {
    /// The next bytes; memory is taken only for what is there.
    fn bytes(&mut self, count: u64) -> Result<Vec<u8>> {
        if count > self.length.saturating_sub(self.at) {
            return Err(Error::new(format!("the file is cut short: {count} bytes were to follow"))
                .at(Place::Byte(self.at))
                .help("copy or export it again"));
        }
        let mut bytes = vec![0; count as usize];
        let fail = |at| {
            move |fault| {
                Error::new(format!("cannot read the file: {fault}")).at(Place::Byte(at)).because(fault)
            }
        };
        self.file.read_exact(&mut bytes).map_err(fail(self.at))?;
        self.at += count;
        Ok(bytes)
    }

    fn skip(&mut self, count: u64) -> Result<()> {
        self.at = self.at.saturating_add(count).min(self.length);
        let at = self.at;
        self.file.seek(SeekFrom::Start(at)).map_err(|fault| {
            Error::new(format!("cannot read the file: {fault}")).at(Place::Byte(at)).because(fault)
        })?;
        Ok(())
    }

    fn wav(&mut self) -> Result<Option<Found>> {
        if self.bytes(8)?[4..] != *b"WAVE" {
            return Ok(None);
        }
        let mut found = Found::default();
        for _ in 0..MAX_CHUNKS {
            let header = self.bytes(8)?;
            let size = u64::from(u32::from_le_bytes([header[4], header[5], header[6], header[7]]));
            match &header[..4] {
                b"data" => return Ok(Some(found)),
                b"fmt " => {
                    let chunk = self.bytes(size.min(40))?;
                    self.skip(size + size % 2 - chunk.len() as u64)?;
                    let number =
                        |at: usize| chunk.get(at..at + 2).map_or(0, |b| u16::from_le_bytes([b[0], b[1]]));
                    let is_extensible = number(0) == 0xfffe;
                    found.bits = number(14);
                    found.is_float = if is_extensible { number(24) == 3 } else { number(0) == 3 };
                    found.channel_mask = if is_extensible && chunk.len() >= 24 {
                        Some(u32::from(number(20)) | u32::from(number(22)) << 16)
                    } else {
                        Some(speakers::usual_mask(number(2).into())).filter(|mask| *mask != 0)
                    };
                }
                b"bext" if size <= MAX_BYTES => {
                    let chunk = self.bytes(size)?;
                    self.skip(size % 2)?;
                    found.broadcast = Broadcast::from_chunk(&chunk);
                }
                _ => self.skip(size + size % 2)?,
            }
        }
        Err(Error::new(format!("no sound follows after {MAX_CHUNKS} chunks")).at(Place::Byte(self.at)))
    }

    fn flac(&mut self) -> Result<Found> {
        let mut found = Found::default();
        loop {
            let header = self.bytes(4)?;
            let size = u64::from(u32::from_be_bytes([0, header[1], header[2], header[3]]));
            match header[0] & 0x7f {
                0 => {
                    let info = self.bytes(size)?;
                    if let Some([high, low]) = info.get(12..14) {
                        found.bits = (u16::from(high & 1) << 4 | u16::from(low >> 4)) + 1;
                        found.channel_mask = Some(speakers::flac_mask(usize::from(high >> 1 & 7) + 1));
                    }
                }
                4 => found.tags = comments(&self.bytes(size)?),
                _ => self.skip(size)?,
            }
            if header[0] & 0x80 != 0 {
                break;
            }
        }
        let mask = found.tags.iter().find(|(name, _)| name == "WAVEFORMATEXTENSIBLE_CHANNEL_MASK");
        if let Some(mask) =
            mask.and_then(|(_, mask)| u32::from_str_radix(mask.trim_start_matches("0x"), 16).ok())
        {
            found.channel_mask = Some(mask);
        }
        Ok(found)
    }
}

/// The Vorbis comments of a block, as far as it is whole.
fn comments(block: &[u8]) -> Vec<(String, String)> {
    let mut rest = block;
    // The name of the program, then a count, which is not needed: they go on to the end of the block.
    if text(&mut rest).is_none() || rest.split_off(..4).is_none() {
        return Vec::new();
    }
    let mut tags = Vec::new();
    while let Some(text) = text(&mut rest) {
        if let Some((name, value)) = String::from_utf8_lossy(text).split_once('=') {
            tags.push((name.to_uppercase(), value.to_owned()));
        }
    }
    tags
}

/// Takes a text off that begins with its length.
fn text<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let size = rest.split_off(..4)?.try_into().map(u32::from_le_bytes).ok()?;
    rest.split_off(..size as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::broadcast::Description;
    use crate::render::format::{SampleFormat, SoundFormat};
    use crate::render::sound_file::{Container, SoundWriter};

    /// The bytes of a labelled file of six channels.
    fn file(container: Container, samples: SampleFormat, channel_mask: u32) -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x");
        let format = SoundFormat { rate_hz: 48_000, channels: 6, samples, seed: 0, first_frame: 7 };
        let text = "a rustle".into();
        let description = Description { text, start: "00:00:01".parse().unwrap(), ..Description::default() };
        let broadcast = Some(Broadcast::new(&description, &format).unwrap());
        let labels = Labels { channel_mask, broadcast };
        let mut writer = SoundWriter::create(container, &path, format, labels).unwrap();
        writer.write(&[0.5; 600]).unwrap();
        writer.finish().unwrap();
        std::fs::read(&path).unwrap()
    }

    fn found(bytes: &[u8]) -> Result<Option<Found>> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x");
        std::fs::write(&path, bytes).unwrap();
        read(&path)
    }

    #[test]
    fn what_is_written_is_found() {
        for (samples, mask) in
            [(SampleFormat::Int16, 0x3f), (SampleFormat::Int24, 0), (SampleFormat::Float32, 0x60f)]
        {
            let found = found(&file(Container::Wav, samples, mask)).unwrap().unwrap();
            assert_eq!((found.bits, found.channel_mask), (samples.bits(), Some(mask)));
            assert_eq!(found.is_float, samples == SampleFormat::Float32);
            let broadcast = found.broadcast.unwrap();
            assert_eq!((broadcast.description.as_str(), broadcast.time_reference), ("a rustle", 48_007));
        }
        for (samples, mask) in
            [(SampleFormat::Int16, 0x3f), (SampleFormat::Int24, 0), (SampleFormat::Int24, 0x60f)]
        {
            let found = found(&file(Container::Flac, samples, mask)).unwrap().unwrap();
            assert_eq!((found.bits, found.channel_mask), (samples.bits(), Some(mask)));
            assert!(found.tags.contains(&("DESCRIPTION".into(), "a rustle".into())));
            assert!(found.tags.contains(&("TIMEREFERENCE".into(), "48007".into())));
            assert_eq!(found.tags.iter().any(|(name, _)| name.contains("MASK")), mask != 0x3f);
        }
    }

    #[test]
    fn damage_does_no_harm() {
        for container in [Container::Wav, Container::Flac] {
            let whole = file(container, SampleFormat::Int16, 0);
            let head = 760.min(whole.len());
            for length in 0..head {
                // An error that names a place, or as much as there is: never a panic.
                if let Err(fault) = found(&whole[..length]) {
                    assert!(fault.file().is_some() && fault.place().is_some(), "{fault}");
                }
            }
            for at in 0..head {
                let mut broken = whole.clone();
                broken[at] ^= 0xff;
                let _ = found(&broken);
            }
            for at in (0..head).step_by(2) {
                let mut broken = whole.clone();
                broken[at..at + 4].fill(0xff);
                let _ = found(&broken);
            }
        }
        assert_eq!(found(b"OggS").unwrap(), None);
        assert!(found(b"fLaC\0\xff\xff\xff").unwrap_err().to_string().contains("cut short: 16777215 bytes"));
    }
}
