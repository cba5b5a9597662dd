//! FLAC and MP3: the files are taken out of their wrapping here and decoded by `symphonia`.

use std::io::Cursor;

use symphonia::core::codecs::audio::{AudioDecoder, AudioDecoderOptions};
use symphonia::core::errors::Error as DecodeError;
use symphonia::core::formats::{FormatOptions, FormatReader};
use symphonia::core::io::MediaSourceStream;
use symphonia::default::codecs::{FlacDecoder, MpaDecoder};
use symphonia::default::formats::{FlacReader, MpaReader};

use super::pcm::ByteOrder;
use super::{Recording, append, check_header, contained, cut_short};
use crate::error::{Error, Place, Result};

/// The file without the ID3v2 tags at its beginning, and their length in bytes.
pub(super) fn after_id3v2(bytes: &[u8]) -> Result<(&[u8], usize)> {
    let mut rest = bytes;
    while let [b'I', b'D', b'3', _, _, flags, size @ ..] = rest
        && let Some(size) = size.get(..4)
    {
        // Four times 7 bits, then a footer as long as the header where a flag says so.
        let size = size.iter().fold(0usize, |sum, byte| sum << 7 | usize::from(byte & 0x7f));
        let footer = if flags & 0x10 != 0 { 10 } else { 0 };
        rest = match rest.get(10 + size + footer..) {
            Some(rest) if !rest.is_empty() => rest,
            _ => return Err(cut_short(&format!("nothing follows the ID3 tag of {size} bytes"), bytes)),
        };
    }
    Ok((rest, bytes.len() - rest.len()))
}

/// Reads a whole FLAC file that begins with its magic word.
pub(super) fn decode_flac(bytes: &[u8]) -> Result<Recording> {
    // Pictures, tags and tables are left out before the decoder sees them: they are nothing to hear,
    // and their lengths are not to be trusted.
    let mut stream_info = None;
    let mut position = 4usize;
    loop {
        let header = bytes
            .get(position..position.saturating_add(4))
            .ok_or_else(|| cut_short("a block of metadata was to follow", bytes))?;
        let size = ByteOrder::Big.number(&header[1..]) as usize;
        let block = bytes.get(position + 4..position + 4 + size).ok_or_else(|| {
            cut_short(&format!("the block of metadata at byte {position} has {size} bytes"), bytes)
        })?;
        if header[0] & 0x7f == 0 {
            stream_info = Some(block);
        }
        position += 4 + size;
        if header[0] & 0x80 != 0 {
            break;
        }
    }
    let stream_info = stream_info
        .filter(|block| block.len() == 34)
        .ok_or_else(|| Error::new("expected the stream info of FLAC, 34 bytes").at(Place::Byte(4)))?;
    // 20 bits of rate, 3 of channels less 1, 5 of bits less 1, 36 of frames.
    let packed = ByteOrder::Big.number(&stream_info[10..18]);
    let channels = (packed >> 41 & 7) as usize + 1;
    let rate_hz = check_header((packed >> 44) as f64, channels)?;
    let frames = packed & 0xf_ffff_ffff;

    let mut bare = Vec::with_capacity(42 + bytes.len() - position);
    bare.extend_from_slice(b"fLaC\x80\0\0\x22");
    bare.extend_from_slice(stream_info);
    bare.extend_from_slice(&bytes[position..]);
    if bare.len() == 42 {
        return Err(if frames == 0 {
            Error::new("the file holds no sound: 0 frames")
        } else {
            cut_short(&format!("{frames} frames were announced"), bytes)
        });
    }
    contained("FLAC", || {
        let reader = FlacReader::try_new(stream(bare), FormatOptions::default()).map_err(corrupt("FLAC"))?;
        let parameters = reader.tracks().first().and_then(|track| track.codec_params.as_ref());
        let parameters = parameters
            .and_then(|parameters| parameters.audio())
            .ok_or_else(|| Error::new("no sound was found in the FLAC file"))?
            .clone();
        let mut decoder = FlacDecoder::try_new(&parameters, &AudioDecoderOptions::default().verify(true))
            .map_err(corrupt("FLAC"))?;
        let planes = drain(reader, &mut decoder, channels, "FLAC")?;
        let found = planes.first().map_or(0, Vec::len) as u64;
        // A stream of unknown length announces 0 frames.
        if frames != 0 && found < frames {
            return Err(cut_short(&format!("{frames} frames were announced, {found} found"), bytes));
        }
        if frames != 0 && found > frames {
            return Err(Error::new(format!("{frames} frames were announced, {found} found")));
        }
        if decoder.finalize().verify_ok == Some(false) {
            return Err(Error::new("the FLAC file is corrupt: its sound does not match its checksum"));
        }
        Ok(Recording { rate_hz, channels: planes })
    })
}

/// Reads a whole MP3 file, without the ID3v2 tags at its beginning.
pub(super) fn decode_mp3(bytes: &[u8]) -> Result<Recording> {
    // An ID3v1 tag is the last 128 bytes.
    let end = bytes.len();
    let bytes = match end.checked_sub(128) {
        Some(tag) if bytes[tag..].starts_with(b"TAG") => &bytes[..tag],
        _ => bytes,
    };
    contained("MP3", || {
        let reader = MpaReader::try_new(stream(bytes.to_vec()), FormatOptions::default())
            .map_err(|e| Error::new(format!("no sound was found that could be MP3: {e}")))?;
        let track = reader.tracks().first();
        let parameters = track.and_then(|track| track.codec_params.as_ref()).and_then(|p| p.audio());
        let (Some(track), Some(parameters)) = (track, parameters) else {
            return Err(Error::new("no sound was found in the MP3 file"));
        };
        let (Some(rate_hz), Some(layout)) = (parameters.sample_rate, parameters.channels.as_ref()) else {
            return Err(Error::new("the MP3 file does not tell its rate and channels"));
        };
        let channels = layout.count();
        let rate_hz = check_header(f64::from(rate_hz), channels)?;
        // Only a LAME tag tells where the sound begins and ends. Without one the reader estimates a
        // length from the bit rate: nothing to cut a recording by. So the cutting is done here.
        let ends = track
            .delay
            .zip(track.padding)
            .map(|(delay, padding)| (delay as usize, padding as usize, track.num_frames.unwrap_or(0)));
        let parameters = parameters.clone();
        let mut decoder = MpaDecoder::try_new(&parameters, &AudioDecoderOptions::default().gapless(false))
            .map_err(corrupt("MP3"))?;
        let mut planes = drain(reader, &mut decoder, channels, "MP3")?;
        if let Some((delay, padding, frames)) = ends {
            let found = planes.first().map_or(0, Vec::len);
            let length = found.saturating_sub(delay).saturating_sub(padding);
            if (length as u64) < frames {
                return Err(cut_short(&format!("{frames} frames were announced, {length} found"), bytes));
            }
            for plane in &mut planes {
                plane.drain(..delay.min(found));
                plane.truncate(length);
            }
        }
        Ok(Recording { rate_hz, channels: planes })
    })
}

/// A source in memory.
fn stream(bytes: Vec<u8>) -> MediaSourceStream<'static> {
    MediaSourceStream::new(Box::new(Cursor::new(bytes)), Default::default())
}

/// Says of a decoder's error which format it was.
fn corrupt(format: &str) -> impl Fn(DecodeError) -> Error {
    move |error| Error::new(format!("the {format} file is corrupt: {error}"))
}

/// Decodes every packet; gives the samples of each channel.
fn drain(
    mut reader: impl FormatReader,
    decoder: &mut impl AudioDecoder,
    channels: usize,
    format: &str,
) -> Result<Vec<Vec<f32>>> {
    let mut planes = vec![Vec::new(); channels];
    let mut block: Vec<Vec<f32>> = Vec::new();
    loop {
        let at_frame = |error| {
            let frame = planes.first().map_or(0, Vec::len);
            corrupt(format)(error).at(Place::Part(format!("frame {frame}")))
        };
        let packet = match reader.next_packet() {
            Ok(Some(packet)) => packet,
            Ok(None) => return Ok(planes),
            // A packet that the file does not hold to its end; the caller compares the lengths.
            Err(DecodeError::IoError(error)) if error.kind() == std::io::ErrorKind::UnexpectedEof => {
                return Ok(planes);
            }
            Err(error) => return Err(at_frame(error)),
        };
        let decoded = decoder.decode(&packet).map_err(at_frame)?;
        if decoded.num_planes() != channels {
            return Err(Error::new(format!(
                "the channels change from {channels} to {} in the middle of the file",
                decoded.num_planes()
            )));
        }
        decoded.copy_to_vecs_planar(&mut block);
        append(&mut planes, &block)?;
    }
}
