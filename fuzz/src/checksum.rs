//! Making checksums right again, so that damage reaches the decoders behind them.

/// The CRC of `bits` bits and this polynomial, not reflected, from 0.
fn crc(bytes: impl IntoIterator<Item = u8>, bits: u32, polynomial: u32) -> u32 {
    let top = 1u32 << (bits - 1);
    let sum = bytes.into_iter().fold(0u32, |sum, byte| {
        (0..8).fold(sum ^ u32::from(byte) << (bits - 8), |sum, _| {
            if sum & top != 0 { sum << 1 ^ polynomial } else { sum << 1 }
        })
    });
    if bits == 32 { sum } else { sum & ((1 << bits) - 1) }
}

/// An Ogg file with the checksum of every page made right.
pub fn mend_ogg(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let mut position = 0;
    while let Some(found) = bytes.get(position..).and_then(|rest| rest.windows(4).position(|w| w == b"OggS"))
    {
        let from = position + found;
        if bytes.len() < from + 27 {
            break;
        }
        let segments = usize::from(bytes[from + 26]);
        let body: usize =
            bytes.iter().skip(from + 27).take(segments).map(|length| usize::from(*length)).sum();
        let end = (from + 27 + segments + body).min(bytes.len());
        bytes[from + 22..from + 26].fill(0);
        let sum = crc(bytes[from..end].iter().copied(), 32, 0x04c1_1db7);
        bytes[from + 22..from + 26].copy_from_slice(&sum.to_le_bytes());
        position = end;
    }
    bytes
}

/// A FLAC file with the checksums of what look like frames made right, and without its MD5.
pub fn mend_flac(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    // The stream info, where it is the first block: its last 16 bytes.
    if let Some(md5) = bytes.get_mut(26..42) {
        md5.fill(0);
    }
    let mut frame = None;
    let mut position = 42;
    while position + 6 < bytes.len() {
        let Some(header) = flac_header_bytes(&bytes[position..]) else {
            position += 1;
            continue;
        };
        mend_flac_frame(&mut bytes, frame.replace(position), position);
        let end = position + header;
        let sum = crc(bytes[position..end].iter().copied(), 8, 0x07);
        bytes[end] = sum as u8;
        position = end + 1;
    }
    let length = bytes.len();
    mend_flac_frame(&mut bytes, frame, length);
    bytes
}

/// Sets the last two bytes of a frame.
fn mend_flac_frame(bytes: &mut [u8], frame: Option<usize>, end: usize) {
    if let Some(frame) = frame.filter(|frame| frame + 2 < end) {
        let sum = crc(bytes[frame..end - 2].iter().copied(), 16, 0x8005);
        bytes[end - 2..end].copy_from_slice(&(sum as u16).to_be_bytes());
    }
}

/// The length of a frame's header before its checksum, where one begins here and is whole.
fn flac_header_bytes(bytes: &[u8]) -> Option<usize> {
    let &[0xff, 0xf8 | 0xf9, sizes, channels, number, ..] = bytes else { return None };
    if sizes >> 4 == 0 || sizes & 15 == 15 || channels & 1 != 0 {
        return None;
    }
    let number_bytes = match number.leading_ones() {
        0 => 1,
        1 | 8 => return None,
        ones => ones as usize,
    };
    let block_bytes = match sizes >> 4 {
        6 => 1,
        7 => 2,
        _ => 0,
    };
    let rate_bytes = match sizes & 15 {
        12 => 1,
        13 | 14 => 2,
        _ => 0,
    };
    let length = 4 + number_bytes + block_bytes + rate_bytes;
    (length < bytes.len()).then_some(length)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fixtures(extension: &str) -> Vec<Vec<u8>> {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../crates/froufrou/tests/fixtures/audio");
        let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let files = files.filter(|path| path.extension().is_some_and(|found| found == extension));
        files.map(|path| std::fs::read(path).unwrap()).collect()
    }

    #[test]
    fn what_is_right_stays_as_it_is() {
        let files = fixtures("ogg");
        assert!(!files.is_empty());
        assert!(files.iter().all(|file| mend_ogg(file) == *file));
        let files = fixtures("flac");
        assert!(!files.is_empty());
        for file in files {
            let mended = mend_flac(&file);
            // All but the MD5.
            assert!(mended[..26] == file[..26] && mended[42..] == file[42..]);
        }
    }
}
