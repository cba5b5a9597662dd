//! From an Ogg file to its packets, which weigh less, and back.

use super::checksum;
#[cfg(feature = "vorbis")]
use super::read_page;
#[cfg(feature = "vorbis")]
use crate::error::{Error, Result};

/// The most segments of a page.
const SEGMENTS: usize = 255;

/// The packets of the one stream of a file, and its last granule position.
///
/// # Errors
/// Where a page is damaged.
#[cfg(feature = "vorbis")]
pub(crate) fn packets(bytes: &[u8]) -> Result<(Vec<Vec<u8>>, u64)> {
    let (mut packets, mut packet, mut position, mut last) = (Vec::new(), Vec::new(), 0, None);
    while let Some(page) = read_page(bytes, position)? {
        position = page.end;
        last = page.granule.or(last);
        let mut body = page.body;
        for &length in page.lacing {
            let (segment, rest) = body.split_at(usize::from(length).min(body.len()));
            body = rest;
            packet.extend_from_slice(segment);
            if length < 255 {
                packets.push(std::mem::take(&mut packet));
            }
        }
    }
    let length = last.and_then(|granule| u64::try_from(granule).ok());
    Ok((packets, length.ok_or_else(|| Error::new("the stream does not tell its length"))?))
}

/// An Ogg file of packets, the first of which has a page of its own. Positions are told on the last page alone: the
/// stream begins with its first sample and ends after so many.
pub(crate) fn pages(packets: &[&[u8]], length: u64) -> Vec<u8> {
    let mut file = Vec::new();
    let mut number = 0u32;
    let mut page = |lacing: &[u8], body: &[u8], is_continued: bool, is_last: bool| {
        let granule = if is_last { length } else { u64::MAX };
        let flags = u8::from(is_continued) | u8::from(number == 0) << 1 | u8::from(is_last) << 2;
        let head = [b"OggS\0", &[flags][..], &granule.to_le_bytes(), &0u32.to_le_bytes()].concat();
        let tail = [&number.to_le_bytes()[..], &[0; 4], &[lacing.len() as u8], lacing].concat();
        let mut bytes = [&head[..], &tail, body].concat();
        let sum = checksum(&bytes).to_le_bytes();
        bytes[22..26].copy_from_slice(&sum);
        file.extend_from_slice(&bytes);
        number += 1;
    };
    let Some((first, others)) = packets.split_first() else { return Vec::new() };
    page(&lacing(first), first, false, others.is_empty());
    let all: Vec<u8> = others.iter().flat_map(|packet| lacing(packet)).collect();
    let mut body = others.concat();
    let mut is_continued = false;
    for (index, lacing) in all.chunks(SEGMENTS).enumerate() {
        let rest = body.split_off(lacing.iter().map(|l| usize::from(*l)).sum());
        page(lacing, &body, is_continued, (index + 1) * SEGMENTS >= all.len());
        is_continued = lacing.last() == Some(&255);
        body = rest;
    }
    file
}

/// How a packet is cut into segments: it ends with the first that is shorter than 255.
fn lacing(packet: &[u8]) -> Vec<u8> {
    let mut lacing = vec![255; packet.len() / 255];
    lacing.push((packet.len() % 255) as u8);
    lacing
}
