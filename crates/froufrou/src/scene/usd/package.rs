//! Packages (`.usdz`): ZIP archives whose parts are stored as they are, so that they can be read in
//! place. The first part is the root layer.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use super::fault::Damage;
use crate::{Error, Result};

/// A part of a package.
#[derive(Debug, PartialEq)]
pub(super) struct Entry {
    pub(super) name: String,
    pub(super) start: u64,
    pub(super) size: u64,
}

/// The end of the directory, and the longest comment after it.
const END_SIZE: u64 = 22;
const LONGEST_COMMENT: u64 = 0xffff;

/// The parts of a package, the root layer first. There is at least one.
///
/// # Errors
/// A file that cannot be read or is no such archive; parts that are compressed or lie beyond the file.
pub(super) fn entries(path: &Path) -> Result<Vec<Entry>> {
    let mut file = File::open(path).map_err(|fault| Error::io("open", path, fault))?;
    let length = file.metadata().map_err(|fault| Error::io("read", path, fault))?.len();
    read(&mut file, length).map_err(|damage| damage.in_file(path))
}

fn read(file: &mut (impl Read + Seek), length: u64) -> std::result::Result<Vec<Entry>, Damage> {
    let mut bytes = |at: u64, size: u64| {
        let fault = || Damage::new(at, format!("the package ends before {size} bytes that belong here"));
        if at.checked_add(size).is_none_or(|end| end > length) {
            return Err(fault());
        }
        let mut bytes = vec![0; size as usize];
        file.seek(SeekFrom::Start(at)).and_then(|_| file.read_exact(&mut bytes)).map_err(|_| fault())?;
        Ok(bytes)
    };
    let tail_size = length.min(END_SIZE + LONGEST_COMMENT);
    let tail = bytes(length - tail_size, tail_size)?;
    let end = tail.windows(END_SIZE as usize).rposition(|window| window.starts_with(b"PK\x05\x06"));
    let end = end.ok_or_else(|| Damage::new(length, "the package has no directory at its end"))?;
    let end = &tail[end..];
    let (count, size, start) = (u16_at(end, 10), u32_at(end, 12), u32_at(end, 16));
    if start == u32::MAX || count == u16::MAX {
        return Err(Damage::plain("the package is larger than 4 GiB, which is not read"));
    }
    let directory = bytes(u64::from(start), u64::from(size))?;
    let mut rest = directory.as_slice();
    let mut entries = Vec::new();
    for _ in 0..count {
        let at = u64::from(start) + (directory.len() - rest.len()) as u64;
        let short = || Damage::new(at, "the package's directory ends too early");
        let (head, others) = rest.split_at_checked(46).ok_or_else(short)?;
        if !head.starts_with(b"PK\x01\x02") {
            return Err(Damage::new(at, "no entry of a directory"));
        }
        let (name, others) = others.split_at_checked(usize::from(u16_at(head, 28))).ok_or_else(short)?;
        let extra = usize::from(u16_at(head, 30)) + usize::from(u16_at(head, 32));
        rest = others.split_at_checked(extra).ok_or_else(short)?.1;
        let name = String::from_utf8_lossy(name).into_owned();
        if name.ends_with('/') {
            continue;
        }
        if u16_at(head, 10) != 0 {
            return Err(Damage::new(at, format!("`{name}` is compressed, which a package must not be")));
        }
        let (size, local) = (u64::from(u32_at(head, 24)), u64::from(u32_at(head, 42)));
        let head = bytes(local, 30)?;
        let data = local + 30 + u64::from(u16_at(&head, 26)) + u64::from(u16_at(&head, 28));
        if data + size > length {
            return Err(Damage::new(at, format!("`{name}` ends beyond the package")));
        }
        entries.push(Entry { name, start: data, size });
    }
    if entries.is_empty() {
        return Err(Damage::plain("the package is empty"));
    }
    Ok(entries)
}

/// `bytes` are long enough wherever this is called.
fn u16_at(bytes: &[u8], at: usize) -> u16 {
    bytes.get(at..at + 2).map_or(0, |b| u16::from_le_bytes([b[0], b[1]]))
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from(u16_at(bytes, at)) | u32::from(u16_at(bytes, at + 2)) << 16
}
