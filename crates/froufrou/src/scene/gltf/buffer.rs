//! The buffers that a document names: regions of its own file, files beside it, or text within it.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::document::Document;
use super::fault::{DAMAGED, damage};
use crate::scene::asset::Folder;
use crate::scene::positioned_file::PositionedFile;
use crate::{Error, Place, Result};

/// Bytes that can be read at any place.
#[derive(Debug)]
pub(super) struct Buffer {
    source: Source,
    /// How many bytes there are, as claimed by the document and checked against the source.
    pub(super) length: u64,
}

#[derive(Debug)]
enum Source {
    File {
        file: Arc<PositionedFile>,
        path: Option<PathBuf>,
        start: u64,
    },
    Memory(Vec<u8>),
    /// There is none: its data are to come from an extension.
    Missing,
}

/// Opens all buffers of a document whose own file is `file`. Texts are taken out of the document.
///
/// # Errors
/// A buffer that is not there, leads out of the folder or is shorter than claimed.
pub(super) fn open(
    path: &Path,
    document: &mut Document,
    file: &Arc<PositionedFile>,
    binary: Option<(u64, u64)>,
) -> Result<Vec<Buffer>> {
    let mut beside: HashMap<PathBuf, Arc<PositionedFile>> = HashMap::new();
    let mut buffers = Vec::with_capacity(document.buffers.len());
    for (index, written) in document.buffers.iter_mut().enumerate() {
        let part = || format!("buffers[{index}]");
        let (source, available) = match (written.uri.take(), binary) {
            (None, Some((start, length))) if index == 0 => {
                (Source::File { file: Arc::clone(file), path: None, start }, length)
            }
            (None, _) => (Source::Missing, written.byte_length),
            (Some(uri), _) => match uri.strip_prefix("data:") {
                Some(data) => {
                    let bytes = data_uri(data).map_err(|what| damage(part(), what))?;
                    let length = bytes.len() as u64;
                    (Source::Memory(bytes), length)
                }
                None => {
                    let found = locate(path, &uri).map_err(|fault| fault.at(Place::Part(part())))?;
                    let file = match beside.get(&found) {
                        Some(file) => Arc::clone(file),
                        None => {
                            let opened = PositionedFile::open(&found).map_err(|source| {
                                Error::new(format!("cannot open {uri:?}: {source}"))
                                    .at(Place::Part(part()))
                                    .help("the buffer belongs beside the glTF file")
                                    .because(source)
                            })?;
                            Arc::clone(beside.entry(found.clone()).or_insert(Arc::new(opened)))
                        }
                    };
                    let length = file.length();
                    (Source::File { file, path: Some(found), start: 0 }, length)
                }
            },
        };
        if written.byte_length > available {
            return Err(damage(
                part(),
                format!("the buffer should have {} bytes and has {available}", written.byte_length),
            ));
        }
        buffers.push(Buffer { source, length: written.byte_length });
    }
    Ok(buffers)
}

impl Buffer {
    /// True where only an extension knows the data.
    pub(super) fn is_missing(&self) -> bool {
        matches!(self.source, Source::Missing)
    }

    /// How many bytes of files or memory stand behind it.
    pub(super) fn backed(&self) -> u64 {
        if self.is_missing() { 0 } else { self.length }
    }

    /// Fills `bytes` from `offset` on.
    ///
    /// # Errors
    /// Bytes beyond the end, or that the system cannot read.
    pub(super) fn read(&self, offset: u64, bytes: &mut [u8]) -> Result<()> {
        let end = offset.checked_add(bytes.len() as u64).filter(|&end| end <= self.length);
        let beyond = || Error::new("the buffer ends before the bytes that belong here").help(DAMAGED);
        if end.is_none() {
            return Err(beyond());
        }
        match &self.source {
            Source::Missing => Err(Error::new("the buffer has no data").help(DAMAGED)),
            Source::Memory(all) => {
                let start = usize::try_from(offset).map_err(|_| beyond())?;
                let found = all.get(start..).and_then(|rest| rest.get(..bytes.len())).ok_or_else(beyond)?;
                bytes.copy_from_slice(found);
                Ok(())
            }
            Source::File { file, path, start } => {
                file.read_exact_at(bytes, start + offset).map_err(|source| {
                    let error = Error::new(format!("cannot read {} bytes: {source}", bytes.len()))
                        .help("the file has been cut short or its disk is gone: copy it again")
                        .because(source);
                    match path {
                        Some(path) => error.in_file(path),
                        None => error,
                    }
                })
            }
        }
    }
}

/// The file that a relative address means, inside the folder of the glTF file.
fn locate(gltf: &Path, uri: &str) -> Result<PathBuf> {
    let scheme = uri.split(['/', '?', '#']).next().and_then(|first| first.split_once(':'));
    if let Some((scheme, _)) = scheme {
        return Err(Error::new(format!("the buffer lies at an address of the kind `{scheme}:`"))
            .help("save the buffer beside the glTF file and name it there by its file name"));
    }
    let advice = "the buffer belongs beside the glTF file or in a folder there";
    let name = percent_decoded(uri)
        .and_then(|bytes| String::from_utf8(bytes).ok())
        .ok_or_else(|| Error::new(format!("{uri:?} is not a file name in percent encoding")).help(DAMAGED))?;
    let folder = Folder::new(gltf.parent().unwrap_or(Path::new("")), false).map_err(|e| e.help(advice))?;
    let found = folder.file(&name).map_err(|fault| {
        let what = format!("the buffer {name:?} is no file in the folder of the glTF file");
        Error::new(what).help(advice).because(fault)
    })?;
    Ok(found.path)
}

/// The bytes of a `data:` address, from behind the colon.
fn data_uri(data: &str) -> Result<Vec<u8>, String> {
    let (kind, payload) = data.split_once(',').ok_or("the data address has no comma before its data")?;
    if kind.to_ascii_lowercase().ends_with(";base64") {
        return base64(payload.as_bytes());
    }
    percent_decoded(payload).ok_or_else(|| "the data address has a faulty percent sign".to_owned())
}

fn percent_decoded(text: &str) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((&byte, after)) = rest.split_first() {
        rest = after;
        if byte != b'%' {
            bytes.push(byte);
            continue;
        }
        let (digits, after) = rest.split_at_checked(2)?;
        let digit = |byte: u8| char::from(byte).to_digit(16).and_then(|digit| u8::try_from(digit).ok());
        bytes.push(digit(digits[0])? << 4 | digit(digits[1])?);
        rest = after;
    }
    Some(bytes)
}

/// RFC 4648, section 4; the padding may be missing.
fn base64(text: &[u8]) -> Result<Vec<u8>, String> {
    let padding = text.iter().rev().take_while(|&&byte| byte == b'=').count().min(2);
    let digits = &text[..text.len() - padding];
    let mut bytes = Vec::with_capacity(digits.len() / 4 * 3 + 2);
    for (group, four) in digits.chunks(4).enumerate() {
        let mut bits = 0_u32;
        for (place, &byte) in four.iter().enumerate() {
            let digit = match byte {
                b'A'..=b'Z' => byte - b'A',
                b'a'..=b'z' => byte - b'a' + 26,
                b'0'..=b'9' => byte - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                _ => {
                    let (found, place) = (char::from(byte), group * 4 + place);
                    return Err(format!("{found:?} at place {place} of the data is not base64"));
                }
            };
            bits |= u32::from(digit) << (18 - 6 * place);
        }
        let [_, three @ ..] = bits.to_be_bytes();
        match four.len() {
            4 => bytes.extend(three),
            3 => bytes.extend(&three[..2]),
            2 => bytes.push(three[0]),
            _ => return Err("the base64 data end within a byte".into()),
        }
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_the_standard() {
        // RFC 4648, section 10.
        for (text, bytes) in [
            ("", ""),
            ("Zg==", "f"),
            ("Zm8=", "fo"),
            ("Zm9v", "foo"),
            ("Zm9vYg==", "foob"),
            ("Zm9vYmE=", "fooba"),
            ("Zm9vYmFy", "foobar"),
            ("Zg", "f"),
        ] {
            assert_eq!(base64(text.as_bytes()).as_deref(), Ok(bytes.as_bytes()), "{text}");
        }
        assert_eq!(base64(b"+/+/").as_deref(), Ok(&[0xfb, 0xff, 0xbf][..]));
        assert!(base64(b"Zm9vY").is_err() && base64(b"Zm 9").unwrap_err().contains("place 2"));
        assert_eq!(data_uri("application/octet-stream;base64,Zm8=").as_deref(), Ok(&b"fo"[..]));
        assert_eq!(data_uri(",a%20b").as_deref(), Ok(&b"a b"[..]));
        assert!(data_uri("nothing").is_err() && data_uri(",%2").is_err());
    }

    #[test]
    fn only_files_inside_the_folder_are_found() -> std::io::Result<()> {
        let room = tempfile::tempdir()?;
        let folder = room.path().join("a folder");
        std::fs::create_dir_all(folder.join("data"))?;
        std::fs::write(room.path().join("outside.bin"), "")?;
        std::fs::write(folder.join("data/b c.bin"), "")?;
        let gltf = folder.join("file.gltf");
        assert_eq!(locate(&gltf, "data/b%20c.bin").ok(), Some(folder.join("data/b c.bin")));
        assert!(locate(&gltf, "data/../data/b c.bin").is_ok());
        let absolute = folder.join("data/b c.bin").display().to_string();
        for uri in ["../outside.bin", "%2e%2e/outside.bin", "data/../../outside.bin", &absolute] {
            let error = locate(&gltf, uri).expect_err(uri).to_string();
            assert!(error.contains("beside the glTF file"), "{error}");
        }
        for uri in ["http://example.org/a.bin", "file:///etc/passwd", "C:/a.bin"] {
            assert!(locate(&gltf, uri).expect_err(uri).to_string().contains("address of the kind"), "{uri}");
        }
        assert!(locate(&gltf, "none.bin").is_err() && locate(&gltf, "%zz.bin").is_err());
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(room.path().join("outside.bin"), folder.join("link.bin"))?;
            assert!(locate(&gltf, "link.bin").is_err());
        }
        Ok(())
    }
}
