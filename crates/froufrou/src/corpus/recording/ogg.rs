//! Ogg Vorbis: pages to packets here, packets to sound by `lewton`.
//!
//! The pages are read here for three reasons: a page's checksum and number tell that something is
//! missing, the granule positions tell which frames at both ends are the encoder's own, and the setup
//! header must be weighed before a decoder is asked to make room for what it announces.

mod repack;

use lewton::audio::{PreviousWindowRight, read_audio_packet_generic};
use lewton::header::{IdentHeader, SetupHeader, read_header_ident, read_header_setup};

use super::{CONVERT, Recording, append, check_header, contained, cut_short};
use crate::error::{Error, Place, Result};

#[cfg(feature = "vorbis")]
pub(crate) use repack::packets;
pub(crate) use repack::pages;

/// One page of an Ogg file (RFC 3533, section 6).
struct Page<'a> {
    /// Where it begins in the file.
    position: usize,
    /// Where the next one begins.
    end: usize,
    is_continued: bool,
    is_first: bool,
    is_last: bool,
    /// The number of frames that are complete with this page; `None` where no packet ends on it.
    granule: Option<i64>,
    stream: u32,
    number: u32,
    /// The length of each segment; a packet ends with the first segment shorter than 255.
    lacing: &'a [u8],
    body: &'a [u8],
}

/// Reads the page at a position; `None` at the end of the file.
fn read_page(bytes: &[u8], position: usize) -> Result<Option<Page<'_>>> {
    let rest = bytes.get(position..).unwrap_or_default();
    if rest.is_empty() {
        return Ok(None);
    }
    let short = || cut_short(&format!("the page at byte {position} goes on"), bytes);
    if !rest.starts_with(&b"OggS"[..rest.len().min(4)]) {
        return Err(Error::new("expected a page of Ogg").at(Place::Byte(position as u64)));
    }
    let header = rest.get(..27).ok_or_else(short)?;
    let number =
        |from: usize, to: usize| header[from..to].iter().rev().fold(0u64, |n, b| n << 8 | u64::from(*b));
    let segments = usize::from(header[26]);
    let lacing = rest.get(27..27 + segments).ok_or_else(short)?;
    let length = 27 + segments + lacing.iter().map(|l| usize::from(*l)).sum::<usize>();
    let page = rest.get(..length).ok_or_else(short)?;
    if checksum(page) != number(22, 26) as u32 {
        return Err(Error::new("a page of Ogg fails its checksum: the file is corrupt")
            .at(Place::Byte(position as u64)));
    }
    let granule = number(6, 14) as i64;
    Ok(Some(Page {
        position,
        end: position + length,
        is_continued: header[5] & 1 != 0,
        is_first: header[5] & 2 != 0,
        is_last: header[5] & 4 != 0,
        granule: (granule != -1).then_some(granule),
        stream: number(14, 18) as u32,
        number: number(18, 22) as u32,
        lacing,
        body: &page[27 + segments..],
    }))
}

/// The checksum of a page, taken with its own four bytes as 0: a CRC of polynomial 0x04c11db7, not
/// reflected, from 0.
fn checksum(page: &[u8]) -> u32 {
    const TABLE: [u32; 256] = {
        let mut table = [0u32; 256];
        let mut index = 0;
        while index < 256 {
            let mut crc = (index as u32) << 24;
            let mut bit = 0;
            while bit < 8 {
                crc = if crc >> 31 == 1 { crc << 1 ^ 0x04c1_1db7 } else { crc << 1 };
                bit += 1;
            }
            table[index] = crc;
            index += 1;
        }
        table
    };
    page.iter().enumerate().fold(0, |crc, (index, byte)| {
        let byte = if (22..26).contains(&index) { 0 } else { *byte };
        crc << 8 ^ TABLE[usize::from((crc >> 24) as u8 ^ byte)]
    })
}

/// One Vorbis stream while it is read.
struct Stream {
    serial: u32,
    next_page: u32,
    /// The beginning of a packet that goes on with the next page.
    packet: Vec<u8>,
    identification: Option<IdentHeader>,
    has_comments: bool,
    setup: Option<SetupHeader>,
    window: PreviousWindowRight,
    /// For every mode whether its blocks are long; none where the setup header hides it.
    modes: Vec<bool>,
    /// The size of the last block.
    block: Option<i64>,
    /// Frames from the centre of the first block to that of the last. Granule positions count these;
    /// the decoder gives some frames sooner, where a short block is to follow a long one.
    decoded: i64,
    /// Frames of the recording that were there before this stream (of a chain) began.
    before: usize,
    /// The granule position at which the sound begins, and the frames decoded before that.
    begins: Option<(i64, i64)>,
}

/// Reads a whole Ogg file.
pub(super) fn decode(bytes: &[u8]) -> Result<Recording> {
    let mut stream: Option<Stream> = None;
    let mut recording: Option<Recording> = None;
    let mut others = Vec::new();
    let mut position = 0;
    let mut has_ended = false;
    while position < bytes.len() {
        let page = match read_page(bytes, position) {
            Ok(Some(page)) => page,
            Ok(None) => break,
            // What follows the last page is a tag or padding, not ours to judge.
            Err(_) if has_ended => break,
            Err(error) => return Err(error),
        };
        position = page.end;
        if page.is_first && (stream.is_none() || has_ended) {
            if page.body.starts_with(b"\x01vorbis") {
                let before = recording.as_ref().map_or(0, Recording::frames);
                stream = Some(Stream {
                    serial: page.stream,
                    next_page: page.number,
                    packet: Vec::new(),
                    identification: None,
                    has_comments: false,
                    setup: None,
                    window: PreviousWindowRight::new(),
                    modes: Vec::new(),
                    block: None,
                    decoded: 0,
                    before,
                    begins: None,
                });
                has_ended = false;
            } else {
                others.push(codec_name(page.body));
            }
        }
        let Some(stream) = stream.as_mut().filter(|s| s.serial == page.stream && !has_ended) else {
            continue;
        };
        let place = Place::Byte(page.position as u64);
        stream.read(&page, &mut recording).map_err(|e| e.at(place))?;
        has_ended = page.is_last;
    }
    match (recording, stream) {
        (Some(recording), _) => Ok(recording),
        (None, Some(_)) => Err(cut_short("no sound follows the headers of Vorbis", bytes)),
        (None, None) => {
            let found = others.first().copied().unwrap_or("nothing");
            Err(Error::new(format!("expected Vorbis in the Ogg file, found {found}")).help(CONVERT))
        }
    }
}

/// What a stream's first packet says it is.
fn codec_name(packet: &[u8]) -> &'static str {
    let known: [(&[u8], &str); 6] = [
        (b"OpusHead", "Opus"),
        (b"\x7fFLAC", "FLAC"),
        (b"Speex   ", "Speex"),
        (b"\x80theora", "Theora video"),
        (b"fishead", "a skeleton"),
        (b"PCM     ", "PCM"),
    ];
    known.iter().find(|(magic, _)| packet.starts_with(magic)).map_or("an unknown codec", |(_, name)| name)
}

impl Stream {
    /// Takes one page: decodes the packets that end on it, then cuts off what its position tells.
    fn read(&mut self, page: &Page, recording: &mut Option<Recording>) -> Result<()> {
        if page.number != self.next_page {
            return Err(Error::new(format!(
                "expected page {} of the Ogg stream, found page {}: some are missing",
                self.next_page, page.number
            )));
        }
        self.next_page = page.number.wrapping_add(1);
        if page.is_continued == self.packet.is_empty() && self.has_comments {
            return Err(Error::new("a packet of Ogg breaks off between two pages"));
        }
        let mut body = page.body;
        for &length in page.lacing {
            let (segment, rest) = body.split_at(usize::from(length).min(body.len()));
            body = rest;
            self.packet.extend_from_slice(segment);
            if length < 255 {
                let packet = std::mem::take(&mut self.packet);
                contained("Vorbis", || self.decode(&packet, recording))?;
            }
        }
        let (Some(granule), Some(recording)) = (page.granule, recording.as_mut()) else {
            return Ok(());
        };
        let frames = recording.frames();
        match self.begins {
            // The first page of sound: what is decoded beyond its position was before the beginning,
            // unless the page is the last too, where it is after the end. A position beyond what is
            // decoded is that of a stream recorded from its middle on.
            None if self.decoded > 0 && !page.is_last => {
                let surplus = self.decoded.saturating_sub(granule).clamp(0, self.decoded);
                for channel in &mut recording.channels {
                    channel.drain(self.before..frames.min(self.before + surplus as usize));
                }
                self.begins = Some((granule.saturating_sub(self.decoded).max(0), surplus));
            }
            _ => {}
        }
        if page.is_last {
            let (first, surplus) = self.begins.unwrap_or((0, 0));
            let length = granule.saturating_sub(first).clamp(0, self.decoded - surplus) as usize;
            for channel in &mut recording.channels {
                channel.truncate(self.before.saturating_add(length));
            }
        }
        Ok(())
    }

    /// Decodes one packet: the three headers, then sound.
    fn decode(&mut self, packet: &[u8], recording: &mut Option<Recording>) -> Result<()> {
        let corrupt = |what: &str, error: &dyn std::fmt::Display| {
            Error::new(format!("the {what} of Vorbis is corrupt: {error}"))
        };
        let Some(identification) = &self.identification else {
            let header = read_header_ident(packet).map_err(|e| corrupt("first header", &e))?;
            let channels = usize::from(header.audio_channels);
            let rate_hz = check_header(f64::from(header.audio_sample_rate), channels)?;
            if let Some(recording) = recording
                && (recording.rate_hz, recording.channels.len()) != (rate_hz, channels)
            {
                return Err(
                    Error::new("the rate or the channels change in the middle of the file").help(CONVERT)
                );
            }
            self.identification = Some(header);
            return Ok(());
        };
        if !self.has_comments {
            // Titles and names: not read at all, for their lengths are not to be trusted.
            self.has_comments = true;
            return Ok(());
        }
        let Some(setup) = &self.setup else {
            weigh_codebooks(packet)?;
            let blocks = (identification.blocksize_0, identification.blocksize_1);
            let setup = read_header_setup(packet, identification.audio_channels, blocks)
                .map_err(|e| corrupt("setup header", &e))?;
            self.setup = Some(setup);
            self.modes = long_modes(packet);
            return Ok(());
        };
        // An empty packet is silence that was left out, by some encoders at the very end.
        if packet.is_empty() {
            return Ok(());
        }
        let block: Vec<Vec<f32>> = read_audio_packet_generic(identification, setup, packet, &mut self.window)
            .map_err(|e| corrupt("sound", &e))?;
        let order = wav_order(block.len());
        let block: Vec<Vec<f32>> = match order {
            Some(order) => order.iter().map(|&from| block[from].clone()).collect(),
            None => block,
        };
        let recording = recording.get_or_insert_with(|| Recording {
            rate_hz: identification.audio_sample_rate,
            channels: vec![Vec::new(); usize::from(identification.audio_channels)],
        });
        append(&mut recording.channels, &block)?;
        let mode_bits = usize::BITS - self.modes.len().saturating_sub(1).leading_zeros();
        let mode = usize::from(packet[0] >> 1) & ((1 << mode_bits) - 1);
        let Some(is_long) = self.modes.get(mode) else {
            self.decoded += block.first().map_or(0, Vec::len) as i64;
            return Ok(());
        };
        let size = 1i64 << if *is_long { identification.blocksize_1 } else { identification.blocksize_0 };
        self.decoded += self.block.map_or(0, |last| (last + size) / 4);
        self.block = Some(size);
        Ok(())
    }
}

/// Which of Vorbis's channels (Vorbis I specification, section 4.3.9) comes first, second … in WAV;
/// `None` where the order is the same.
fn wav_order(channels: usize) -> Option<&'static [usize]> {
    match channels {
        3 => Some(&[0, 2, 1]),
        5 => Some(&[0, 2, 1, 3, 4]),
        6 => Some(&[0, 2, 1, 5, 3, 4]),
        7 => Some(&[0, 2, 1, 6, 5, 3, 4]),
        8 => Some(&[0, 2, 1, 7, 5, 6, 3, 4]),
        _ => None,
    }
}

/// The most entries, and the most numbers, that all codebooks of a stream may have together. Those of
/// the reference encoder have some tens of thousands.
const MAX_CODEBOOK_NUMBERS: u64 = 1 << 21;

/// Walks the codebooks of a setup header (Vorbis I specification, section 3.2.1) for their sizes alone:
/// two numbers in the header would make a decoder allocate terabytes.
fn weigh_codebooks(packet: &[u8]) -> Result<()> {
    let mut bits = Bits { bytes: packet, position: 7 * 8 };
    let mut weight = 0u64;
    for _ in 0..=bits.take(8)? {
        if bits.take(24)? != 0x56_4342 {
            return Err(Error::new("the setup header of Vorbis is corrupt: expected a codebook"));
        }
        let (dimensions, entries) = (bits.take(16)?, bits.take(24)?);
        weight += entries.max(entries * dimensions);
        if dimensions == 0 || weight > MAX_CODEBOOK_NUMBERS {
            return Err(Error::new(format!(
                "the setup header of Vorbis is corrupt: a codebook of {entries} entries by {dimensions}"
            )));
        }
        if bits.take(1)? == 1 {
            bits.take(5)?;
            let mut known = 0;
            while known < entries {
                known += bits.take(u64::BITS - (entries - known).leading_zeros())?;
            }
        } else {
            let is_sparse = bits.take(1)? == 1;
            for _ in 0..entries {
                if !is_sparse || bits.take(1)? == 1 {
                    bits.take(5)?;
                }
            }
        }
        let lookup = bits.take(4)?;
        if lookup == 1 || lookup == 2 {
            bits.skip(64)?;
            let width = bits.take(4)? + 1;
            bits.skip(1)?;
            let values = if lookup == 2 { entries * dimensions } else { grid_side(entries, dimensions) };
            bits.skip(values * width)?;
        }
    }
    Ok(())
}

/// Which modes of a setup header have long blocks (Vorbis I specification, section 4.2.4, "modes").
///
/// They are the last thing in it, and what precedes them has no length of its own; so they are read
/// from the end: each is a flag, 32 bits of 0 and 8 bits, and their count less 1 in 6 bits precedes
/// them. Where the count agrees with more than one number of modes, the largest is right.
fn long_modes(packet: &[u8]) -> Vec<bool> {
    let bit = |at: usize| packet[at / 8] >> (at % 8) & 1 == 1;
    // A flag of 1 ends the header, then padding to the byte.
    let Some(mut at) = (0..8 * packet.len()).rev().find(|at| bit(*at)) else {
        return Vec::new();
    };
    let (mut flags, mut agreed) = (Vec::new(), Vec::new());
    while at >= 41 + 6 && flags.len() < 64 && !(at - 40..at - 8).any(bit) {
        at -= 41;
        flags.insert(0, bit(at));
        let count = (at - 6..at).rev().fold(0, |number, at| number << 1 | usize::from(bit(at))) + 1;
        if count == flags.len() {
            agreed.clone_from(&flags);
        }
    }
    agreed
}

/// The largest number whose power of so many dimensions is at most the entries.
fn grid_side(entries: u64, dimensions: u64) -> u64 {
    let fits = |side: u64| side.checked_pow(dimensions as u32).is_some_and(|volume| volume <= entries);
    (1..=entries).take_while(|&side| fits(side)).last().unwrap_or(0)
}

/// Bits of a packet, the least significant of each byte first.
struct Bits<'a> {
    bytes: &'a [u8],
    position: u64,
}

impl Bits<'_> {
    fn take(&mut self, count: u32) -> Result<u64> {
        let from = self.position;
        self.skip(u64::from(count))?;
        Ok((from..self.position)
            .rev()
            .fold(0, |number, at| number << 1 | u64::from(self.bytes[(at / 8) as usize] >> (at % 8) & 1)))
    }

    fn skip(&mut self, count: u64) -> Result<()> {
        let end = self.position.saturating_add(count);
        if end > 8 * self.bytes.len() as u64 {
            return Err(Error::new("the setup header of Vorbis is cut short"));
        }
        self.position = end;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn fixture(name: &str) -> Vec<u8> {
        std::fs::read(format!("{}/tests/fixtures/audio/{name}", env!("CARGO_MANIFEST_DIR"))).unwrap()
    }

    /// The third packet of a file: on the second page, and perhaps the third, after the comments.
    fn setup_packet(bytes: &[u8]) -> Vec<u8> {
        let mut position = read_page(bytes, 0).unwrap().unwrap().end;
        let mut packets = vec![Vec::new()];
        while packets.len() < 3 {
            let page = read_page(bytes, position).unwrap().unwrap();
            let mut body = page.body;
            for &length in page.lacing {
                let (segment, rest) = body.split_at(usize::from(length));
                body = rest;
                packets.last_mut().unwrap().extend_from_slice(segment);
                if length < 255 {
                    packets.push(Vec::new());
                }
            }
            position = page.end;
        }
        packets.swap_remove(1)
    }

    #[test]
    fn the_checksum_is_that_of_ogg() {
        let bytes = fixture("stereo_44100_vorbis.ogg");
        let page = read_page(&bytes, 0).unwrap().unwrap();
        assert!(page.is_first && !page.is_last && page.body.starts_with(b"\x01vorbis"));
    }

    #[test]
    fn the_modes_are_found_at_the_end_of_the_setup_header() {
        // The reference encoder has one mode of short blocks and one of long ones; at low rates the
        // first alone.
        let modes = |name: &str| long_modes(&setup_packet(&fixture(name)));
        assert_eq!(modes("stereo_44100_vorbis.ogg"), [false, true]);
        assert_eq!(modes("six_48000_vorbis.ogg"), [false, true]);
        assert_eq!(modes("mono_8000_vorbis.ogg"), [false]);
        assert!(long_modes(&[]).is_empty() && long_modes(&[0; 40]).is_empty());
    }

    #[test]
    fn a_grid_is_as_wide_as_its_entries_allow() {
        assert_eq!([grid_side(1025, 10), grid_side(1024, 10), grid_side(1023, 10)], [2, 2, 1]);
        assert_eq!([grid_side(3126, 5), grid_side(3124, 5), grid_side(0, 15), grid_side(7, 1)], [5, 4, 0, 7]);
    }

    #[test]
    fn a_codebook_of_terabytes_is_refused() {
        let mut setup = setup_packet(&fixture("stereo_44100_vorbis.ogg"));
        assert!(setup.starts_with(b"\x05vorbis"));
        assert!(weigh_codebooks(&setup).is_ok());
        // Dimensions and entries of the first codebook, after the count and the sync word.
        setup[11..16].fill(0xff);
        let error = weigh_codebooks(&setup).unwrap_err();
        assert!(error.to_string().contains("by 65535"), "{error}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]
        /// The checksum hides most damage from the decoder: here it is made right again.
        #[test]
        fn damage_under_a_right_checksum_neither_panics_nor_hangs(
            file in 0usize..3,
            flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        ) {
            let names = ["mono_8000_vorbis.ogg", "stereo_44100_vorbis.ogg", "six_48000_vorbis.ogg"];
            let mut bytes = fixture(names[file]);
            let length = bytes.len();
            for (index, value) in flips {
                bytes[index.index(length)] ^= value;
            }
            let mut position = 0;
            while let Some(found) = bytes[position..].windows(4).position(|w| w == b"OggS") {
                let from = position + found;
                let Some(header) = bytes.get(from..from + 27) else { break };
                let segments = usize::from(header[26]);
                let body: usize = bytes.iter().skip(from + 27).take(segments).map(|l| usize::from(*l)).sum();
                let end = (from + 27 + segments + body).min(bytes.len());
                let crc = checksum(&bytes[from..end]).to_le_bytes();
                bytes[from + 22..from + 26].copy_from_slice(&crc);
                position = end;
            }
            if let Ok(recording) = decode(&bytes) {
                let frames = recording.frames();
                prop_assert!(recording.channels.iter().all(|c| c.len() == frames));
            }
        }
    }
}
