//! One block of all channels as a frame.

use super::bits::{Bits, crc8, crc16};
use super::predict::Subframe;

/// Codes of the rates that have one, from 1 on.
const RATES_HZ: [u32; 11] =
    [88_200, 176_400, 192_000, 8_000, 16_000, 22_050, 24_000, 32_000, 44_100, 48_000, 96_000];

/// Encodes interleaved samples, at least one frame of them.
pub(super) fn encode(interleaved: &[i32], channels: usize, bits: u32, rate_hz: u32, number: u64) -> Vec<u8> {
    let plane =
        |channel: usize| interleaved.iter().skip(channel).step_by(channels).copied().collect::<Vec<i32>>();
    let (assignment, subframes) = if channels == 2 {
        stereo(plane(0), plane(1), bits)
    } else {
        ((channels - 1) as u64, (0..channels).map(|channel| Subframe::new(plane(channel), bits)).collect())
    };
    let frames = interleaved.len() / channels;
    let mut to = Bits::default();
    to.put(0xfff8, 16);
    // A size that has a code is one of 256 times a power of two.
    let size_code = match frames {
        4096 => 12,
        _ => 7,
    };
    to.put(size_code, 4);
    let rate_code = RATES_HZ.iter().position(|rate| *rate == rate_hz).map(|index| index as u64 + 1);
    let (rate_code, rate, rate_bits) = match rate_code {
        Some(code) => (code, 0, 0),
        None if rate_hz.is_multiple_of(1000) && rate_hz / 1000 < 1 << 8 => (12, rate_hz / 1000, 8),
        None if rate_hz < 1 << 16 => (13, rate_hz, 16),
        None if rate_hz.is_multiple_of(10) && rate_hz / 10 < 1 << 16 => (14, rate_hz / 10, 16),
        // Only the beginning of the file tells it.
        None => (0, 0, 0),
    };
    to.put(rate_code, 4);
    to.put(assignment, 4);
    to.put(if bits == 16 { 4 } else { 6 } << 1, 4);
    put_number(number, &mut to);
    if size_code == 7 {
        to.put(frames as u64 - 1, 16);
    }
    to.put(u64::from(rate), rate_bits);
    let check = crc8(to.align());
    to.put(u64::from(check), 8);
    subframes.iter().for_each(|subframe| subframe.write(&mut to));
    let mut bytes = to.into_bytes();
    let check = crc16(&bytes);
    bytes.extend_from_slice(&check.to_be_bytes());
    bytes
}

/// Two channels as they are, or one of them, or their mean, with their difference.
fn stereo(left: Vec<i32>, right: Vec<i32>, bits: u32) -> (u64, Vec<Subframe>) {
    let side: Vec<i32> = left.iter().zip(&right).map(|(l, r)| l - r).collect();
    let mid: Vec<i32> = left.iter().zip(&right).map(|(l, r)| (l + r) >> 1).collect();
    let [left, right, mid] = [left, right, mid].map(|samples| Subframe::new(samples, bits));
    let side = Subframe::new(side, bits + 1);
    let choices =
        [left.bits + right.bits, left.bits + side.bits, right.bits + side.bits, mid.bits + side.bits];
    let least = (0..4).min_by_key(|choice| choices[*choice]).unwrap_or(0);
    match least {
        1 => (8, vec![left, side]),
        2 => (9, vec![side, right]),
        3 => (10, vec![mid, side]),
        _ => (1, vec![left, right]),
    }
}

/// Writes a number of up to 36 bits as UTF-8 would, were it to go that far.
fn put_number(number: u64, to: &mut Bits) {
    if number < 0x80 {
        return to.put(number, 8);
    }
    // Each byte after the first holds 6 bits; the first one less for each of them.
    let more = (1..=6u32).find(|more| number < 1 << (5 * more + 6)).unwrap_or(6);
    let mark = 0xffu64 << (7 - more) & 0xff;
    to.put(mark & 0xff | number >> (6 * more), 8);
    for index in (0..more).rev() {
        to.put(0x80 | (number >> (6 * index) & 0x3f), 8);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_as_utf_8() {
        for number in [0, 0x7f, 0x80, 0x7ff, 0x800, 0xd7ff, 0xffff, 0x1_0000, 0x10_ffff] {
            let mut bits = Bits::default();
            put_number(number, &mut bits);
            let character = char::from_u32(number as u32).unwrap_or('?');
            assert_eq!(bits.into_bytes(), character.to_string().as_bytes(), "{number:x}");
        }
        let mut bits = Bits::default();
        put_number(0x7fff_ffff, &mut bits);
        assert_eq!(bits.into_bytes(), [0xfd, 0xbf, 0xbf, 0xbf, 0xbf, 0xbf]);
    }
}
