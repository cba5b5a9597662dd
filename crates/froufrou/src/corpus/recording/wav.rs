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
            let rest = &bytes[start..];
            let whole = order.number(&bytes[4..8]) + 8;
            let size = data_size(size, long_data_bytes, rest.len() as u64, whole, bytes.len() as u64);
            let Some(data) = rest.get(..usize::try_from(size).unwrap_or(usize::MAX)) else {
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

/// The bytes of sound, which may be more than there are: by the 32 bits of the data chunk, by the 64
/// bits of RF64 where there are any, or all that there are where the file was streamed. `whole` is
/// what the file's header gives as its length.
fn data_size(short: u64, long: Option<u64>, rest: u64, whole: u64, file: u64) -> u64 {
    match (short, long) {
        // A program that writes RF64 to a pipe leaves these at 0 too.
        (0xffff_ffff, Some(long)) if long > 0 => long,
        // Without longer sizes this one never was one.
        (0xffff_ffff, _) => rest,
        // The size of the whole tells a recording without sound from one that was streamed.
        (0, _) if whole.abs_diff(file) > 1 => rest,
        _ if short > rest && STREAMED_BYTES.iter().any(|sizes| sizes.contains(&short)) => rest,
        _ => short,
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_beyond_32_bits_are_those_of_rf64() {
        const GIB: u64 = 1 << 30;
        let max = 0xffff_ffff;
        let size = |short, long, rest| data_size(short, long, rest, max + 8, rest + 80);
        assert_eq!(size(max, Some(5 * GIB), 5 * GIB), 5 * GIB);
        // One that promises more is cut short, also where it promises what a stream would.
        assert_eq!(size(max, Some(5 * GIB), 4 * GIB), 5 * GIB);
        assert_eq!(size(max, Some(0xffff_fff0), GIB), 0xffff_fff0);
        // Something may follow after the sound.
        assert_eq!(size(max, Some(5 * GIB), 6 * GIB), 5 * GIB);
        // A stream that went on beyond 4 GiB, whether it was to be RF64 or not.
        assert_eq!(size(max, Some(0), 6 * GIB), 6 * GIB);
        assert_eq!(size(max, None, 6 * GIB), 6 * GIB);
        assert_eq!(size(max, None, GIB), GIB);
        assert_eq!(size(0xffff_f000, None, GIB), GIB);
        assert_eq!(size(0, None, GIB), GIB);
        // A small sound in a file that could be long.
        assert_eq!(size(1000, Some(1000), 1000), 1000);
        assert_eq!(data_size(0, None, 0, 44, 44), 0);
    }
}
