//! The WAV container (RIFF, RIFX, RF64 and BW64): finds the format and the data in the chunks.

use super::pcm::{self, ByteOrder, Encoding};
use super::{CONVERT, Recording, check_header, cut_short};
use crate::error::{Error, Place, Result};

/// The last 14 bytes of an extensible format's identifier, after the format tag: that of Microsoft and
/// that of ambisonic B-format.
const SUBFORMATS: [[u8; 14]; 2] = [
    [0, 0, 0, 0, 0x10, 0, 0x80, 0, 0, 0xaa, 0, 0x38, 0x9b, 0x71],
    [0, 0, 0x21, 7, 0xd3, 0x11, 0x86, 0x44, 0xc8, 0xc1, 0xca, 0, 0, 0],
];

/// A program that writes to a pipe cannot come back to fill in the size of the data: it leaves 0, or
/// the largest number there is (ffmpeg), or the largest signed one (SoX), less a header.
const STREAMED_BYTES: [std::ops::RangeInclusive<u64>; 2] =
    [0x7fff_f000..=0x7fff_ffff, 0xffff_f000..=0xffff_ffff];

/// What the format chunk says.
struct Format {
    rate_hz: u32,
    channels: usize,
    encoding: Encoding,
}

/// Reads a whole WAV file, whose first 12 bytes have been checked.
pub(super) fn decode(bytes: &[u8]) -> Result<Recording> {
    let order = if bytes.starts_with(b"RIFX") { ByteOrder::Big } else { ByteOrder::Little };
    let mut format = None;
    let mut long_data_bytes = None;
    let mut position = 12usize;
    loop {
        let Some(header) = bytes.get(position..position.saturating_add(8)) else {
            let what = if format.is_some() { "sound (`data` chunk)" } else { "format (`fmt ` chunk)" };
            return Err(cut_short(&format!("no {what} was found"), bytes));
        };
        let start = position + 8;
        let size = order.number(&header[4..]);
        if &header[..4] == b"data" {
            let Some(Format { rate_hz, channels, encoding }) = format else {
                return Err(Error::new("the sound comes before its format: expected a `fmt ` chunk first")
                    .at(Place::Byte(position as u64)));
            };
            let size = long_data_bytes.filter(|_| size == 0xffff_ffff).unwrap_or(size);
            let rest = &bytes[start..];
            let is_streamed = match size {
                // The size of the whole tells a recording without sound from one that was streamed.
                0 => (order.number(&bytes[4..8]) + 8).abs_diff(bytes.len() as u64) > 1,
                _ => STREAMED_BYTES.iter().any(|sizes| sizes.contains(&size)) && size > rest.len() as u64,
            };
            let data =
                if is_streamed { Some(rest) } else { rest.get(..size.try_into().unwrap_or(usize::MAX)) };
            let Some(data) = data else {
                let promised = format!("{size} bytes of sound from byte {start} on were announced");
                return Err(cut_short(&promised, bytes));
            };
            return pcm::decode(data, rate_hz, channels, encoding, order);
        }
        let size = usize::try_from(size).unwrap_or(usize::MAX);
        let Some(chunk) = bytes.get(start..start.saturating_add(size)) else {
            let name = String::from_utf8_lossy(&header[..4]).into_owned();
            return Err(cut_short(&format!("chunk `{name}` at byte {position} has {size} bytes"), bytes));
        };
        match &header[..4] {
            b"fmt " => {
                let place = Place::Byte(position as u64);
                format = Some(read_format(chunk, order).map_err(|e| e.at(place))?);
            }
            // RF64 and BW64: size of the file, size of the data, count of frames, each of 64 bits.
            b"ds64" => long_data_bytes = chunk.get(8..16).map(|size| order.number(size)),
            _ => {}
        }
        // Chunks begin at even offsets.
        position = start + size + (size & 1);
    }
}

/// Reads the format chunk.
fn read_format(chunk: &[u8], order: ByteOrder) -> Result<Format> {
    if chunk.len() < 16 {
        return Err(Error::new(format!("the format has {} bytes, expected at least 16", chunk.len())));
    }
    let number = |from: usize, to: usize| order.number(&chunk[from..to]);
    let mut tag = number(0, 2);
    let channels = number(2, 4) as usize;
    let rate_hz = check_header(number(4, 8) as f64, channels)?;
    let frame_bytes = number(12, 14) as usize;
    let bits = number(14, 16) as usize;
    if tag == 0xfffe {
        let Some(subformat) = chunk.get(24..40) else {
            return Err(Error::new(format!(
                "the extensible format has {} bytes, expected at least 40",
                chunk.len()
            )));
        };
        if !SUBFORMATS.iter().any(|tail| subformat[2..] == *tail) {
            return Err(Error::new("the sound is in an unknown extensible format").help(CONVERT));
        }
        tag = order.number(&subformat[..2]);
    }
    let encoding = match (tag, bits) {
        (1, 1..=8) => Encoding::Unsigned8,
        (1, 9..=32) => Encoding::Signed { bytes: bits.div_ceil(8) },
        (3, 32) => Encoding::Float32,
        (3, 64) => Encoding::Float64,
        (6, 8) => Encoding::ALaw,
        (7, 8) => Encoding::MuLaw,
        _ => {
            let codec = match tag {
                1 => "integer samples".to_string(),
                2 => "Microsoft ADPCM".to_string(),
                3 => "float samples".to_string(),
                6 => "A-law".to_string(),
                7 => "µ-law".to_string(),
                0x11 => "IMA ADPCM".to_string(),
                0x31 => "GSM 6.10".to_string(),
                0x50 => "MPEG audio".to_string(),
                0x55 => "MP3".to_string(),
                _ => format!("a codec numbered {tag:#06x}"),
            };
            return Err(
                Error::new(format!("{codec} of {bits} bits in a WAV file is not read here")).help(CONVERT)
            );
        }
    };
    let expected = encoding.bytes() * channels;
    if frame_bytes != expected {
        return Err(Error::new(format!(
            "the header gives {frame_bytes} bytes a frame, expected {expected} for {channels} channels of {bits} bits"
        )));
    }
    Ok(Format { rate_hz, channels, encoding })
}
