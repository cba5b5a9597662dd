//! Bits into bytes, the first one highest, and the checksums of FLAC.

/// Bytes that grow bit by bit.
#[derive(Default)]
pub(super) struct Bits {
    bytes: Vec<u8>,
    /// The bits that do not fill a byte yet, lowest last.
    pending: u64,
    count: u32,
}

impl Bits {
    /// Adds the low bits of a number, at most 32.
    pub(super) fn put(&mut self, value: u64, bits: u32) {
        self.pending = self.pending << bits | (value & ((1 << bits) - 1));
        self.count += bits;
        if self.count >= 32 {
            self.count -= 32;
            self.bytes.extend_from_slice(&((self.pending >> self.count) as u32).to_be_bytes());
        }
    }

    /// Adds a signed number in two's complement.
    pub(super) fn put_signed(&mut self, value: i32, bits: u32) {
        self.put(value as u64, bits);
    }

    /// Adds so many zeros and a one.
    pub(super) fn put_unary(&mut self, mut zeros: u32) {
        while zeros >= 31 {
            self.put(0, 31);
            zeros -= 31;
        }
        self.put(1, zeros + 1);
    }

    /// The bytes, the last one filled up with zeros.
    pub(super) fn into_bytes(mut self) -> Vec<u8> {
        self.align();
        self.bytes
    }

    /// The bytes so far, the last one filled up with zeros.
    pub(super) fn align(&mut self) -> &[u8] {
        let fill = self.count.wrapping_neg() % 8;
        self.put(0, fill);
        while self.count > 0 {
            self.count -= 8;
            self.bytes.push((self.pending >> self.count) as u8);
        }
        &self.bytes
    }
}

/// The checksum of a frame's header: x⁸ + x² + x + 1.
pub(super) fn crc8(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |crc, byte| {
        (0..8).fold(crc ^ byte, |crc: u8, _| crc << 1 ^ if crc & 0x80 != 0 { 0x07 } else { 0 })
    })
}

/// The checksums of single bytes, for [`crc16`].
const CRC16: [u16; 256] = {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = (byte as u16) << 8;
        let mut bit = 0;
        while bit < 8 {
            crc = if crc & 0x8000 != 0 { crc << 1 ^ 0x8005 } else { crc << 1 };
            bit += 1;
        }
        table[byte] = crc;
        byte += 1;
    }
    table
};

/// The checksum of a frame: x¹⁶ + x¹⁵ + x² + 1.
pub(super) fn crc16(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |crc, byte| crc << 8 ^ CRC16[usize::from((crc >> 8) as u8 ^ byte)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_stand_one_after_another() {
        let mut bits = Bits::default();
        bits.put(0b101, 3);
        bits.put_unary(2);
        bits.put_signed(-1, 5);
        bits.put(0xdead_beef, 32);
        bits.put_unary(40);
        let text: String = bits.into_bytes().iter().map(|byte| format!("{byte:08b}")).collect();
        let expected = format!("101001{}{:032b}{}1", "11111", 0xdead_beef_u32, "0".repeat(40));
        assert_eq!(text.trim_end_matches('0'), expected);
        assert_eq!(text.len() % 8, 0);
    }

    #[test]
    fn checksums_are_the_known_ones() {
        // The check values of CRC-8/SMBUS and CRC-16/UMTS.
        assert_eq!((crc8(b"123456789"), crc16(b"123456789")), (0xf4, 0xfee8));
    }
}
