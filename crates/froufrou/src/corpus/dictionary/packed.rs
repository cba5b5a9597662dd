//! Numbers as few bytes, and files that tell when they are damaged.

use std::io::{Read, Write};

use flate2::Compression;
use flate2::read::DeflateDecoder;
use flate2::write::DeflateEncoder;
use md5::{Digest, Md5};

use crate::error::{Error, Place, Result};

/// No file unpacks to more than so many times its bytes.
const MOST_RATIO: u64 = 64;

/// Numbers on their way into a file.
#[derive(Debug, Default)]
pub(crate) struct Writer {
    pub bytes: Vec<u8>,
}

impl Writer {
    /// Seven bits a byte, the lowest first.
    pub fn number(&mut self, mut number: u64) {
        while number >= 0x80 {
            self.bytes.push(number as u8 | 0x80);
            number >>= 7;
        }
        self.bytes.push(number as u8);
    }

    pub fn float(&mut self, value: f32) {
        self.bytes.extend_from_slice(&value.to_le_bytes());
    }
}

/// Numbers as they come from a file.
#[derive(Debug)]
pub(crate) struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    pub fn fault(&self, what: impl Into<String>) -> Error {
        Error::new(what).at(Place::Part(format!("unpacked byte {}", self.at)))
    }

    pub fn take(&mut self, count: usize) -> Result<&'a [u8]> {
        let piece = self.at.checked_add(count).and_then(|end| self.bytes.get(self.at..end));
        let piece = piece.ok_or_else(|| self.fault("the file ends too early"))?;
        self.at += count;
        Ok(piece)
    }

    pub fn byte(&mut self) -> Result<u8> {
        Ok(self.take(1)?[0])
    }

    pub fn number(&mut self) -> Result<u64> {
        let mut number = 0u64;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            let bits = u64::from(byte & 0x7f);
            if shift == 63 && bits > 1 {
                break;
            }
            number |= bits << shift;
            if byte < 0x80 {
                return Ok(number);
            }
        }
        Err(self.fault("a number is larger than 64 bits"))
    }

    /// A number of things, each of which takes at least so many bytes.
    pub fn count(&mut self, least_bytes: usize) -> Result<usize> {
        let number = self.number()?;
        let left = (self.bytes.len() - self.at) / least_bytes.max(1);
        match usize::try_from(number) {
            Ok(count) if count <= left => Ok(count),
            _ => Err(self.fault(format!("{number} things are announced, there is room for {left}"))),
        }
    }

    /// A number below a limit.
    pub fn below(&mut self, limit: usize, what: &str) -> Result<usize> {
        let number = self.number()?;
        match usize::try_from(number) {
            Ok(index) if index < limit => Ok(index),
            _ => Err(self.fault(format!("{what} is {number}, expected less than {limit}"))),
        }
    }

    pub fn float(&mut self) -> Result<f32> {
        let bytes = self.take(4)?;
        let value = f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
        if value.is_finite() { Ok(value) } else { Err(self.fault(format!("a number is {value}"))) }
    }

    pub fn end(&self) -> Result<()> {
        match self.bytes.len() - self.at {
            0 => Ok(()),
            left => Err(self.fault(format!("{left} bytes too many"))),
        }
    }
}

/// Sixteen bytes that no other content has, as text.
pub(crate) fn hash(pieces: &[&[u8]]) -> String {
    let mut digest = Md5::new();
    for piece in pieces {
        digest.update((piece.len() as u64).to_le_bytes());
        digest.update(piece);
    }
    digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Content under a first line that says what it is, with a checksum; packed or as it is.
pub(crate) fn seal(kind: &str, content: &[u8], pack: bool) -> Result<Vec<u8>> {
    let packed;
    let body = if pack {
        let mut encoder = DeflateEncoder::new(Vec::new(), Compression::best());
        let written = encoder.write_all(content).and_then(|()| encoder.finish());
        packed = written.map_err(|fault| Error::new(format!("cannot pack: {fault}")).because(fault))?;
        &packed[..]
    } else {
        content
    };
    Ok([kind.as_bytes(), b"\n", &Md5::digest(body)[..], body].concat())
}

/// What was sealed.
pub(crate) fn open(kind: &str, bytes: &[u8], packed: bool) -> Result<Vec<u8>> {
    let rest = bytes.strip_prefix(kind.as_bytes()).and_then(|rest| rest.strip_prefix(b"\n"));
    let Some((sum, body)) = rest.and_then(|rest| rest.split_at_checked(16)) else {
        return Err(Error::new(format!("expected a file that begins with `{kind}`")).at(Place::Byte(0)));
    };
    if Md5::digest(body)[..] != *sum {
        return Err(Error::new("the file fails its checksum: it is damaged or cut short"));
    }
    if !packed {
        return Ok(body.to_vec());
    }
    let limit = MOST_RATIO * bytes.len() as u64 + 4096;
    let mut content = Vec::new();
    let read = DeflateDecoder::new(body).take(limit + 1).read_to_end(&mut content);
    read.map_err(|fault| Error::new(format!("cannot unpack: {fault}")).because(fault))?;
    if content.len() as u64 > limit {
        return Err(Error::new(format!("the file unpacks to more than {MOST_RATIO} times its size")));
    }
    Ok(content)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back() {
        let numbers = [0, 1, 127, 128, 300, 1 << 20, u64::from(u32::MAX), u64::MAX];
        let mut writer = Writer::default();
        numbers.iter().for_each(|n| writer.number(*n));
        writer.float(-1.5);
        let mut reader = Reader::new(&writer.bytes);
        assert_eq!(numbers.map(|_| reader.number().unwrap()), numbers);
        assert_eq!(reader.float().unwrap(), -1.5);
        reader.end().unwrap();
        assert!(Reader::new(&[0xff; 12]).number().is_err());
        assert!(Reader::new(&[0xff; 3]).number().is_err());
        assert!(Reader::new(&[200, 1, 0]).count(1).unwrap_err().to_string().contains("room for 1"));
    }

    #[test]
    fn sealed_content_comes_back_or_tells_its_damage() {
        let content: Vec<u8> = (0..5000u32).map(|i| ((i * i) >> 7) as u8).collect();
        for pack in [true, false] {
            let sealed = seal("kind 1", &content, pack).unwrap();
            assert_eq!(open("kind 1", &sealed, pack).unwrap(), content);
            assert!(open("kind 2", &sealed, pack).is_err());
            for at in (0..sealed.len()).step_by(97) {
                let mut damaged = sealed.clone();
                damaged[at] ^= 4;
                assert!(open("kind 1", &damaged, pack).is_err());
                assert!(open("kind 1", &sealed[..at], pack).is_err());
            }
        }
        // A file that unpacks to gigabytes.
        let bomb = seal("kind 1", &vec![0; 1 << 24], true).unwrap();
        assert!(open("kind 1", &bomb, true).unwrap_err().to_string().contains("64 times"));
    }
}
