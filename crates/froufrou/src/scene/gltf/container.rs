//! The file itself: JSON alone, or the chunks of a `.glb`.

use std::path::Path;
use std::sync::Arc;

use super::document::Document;
use super::fault::DAMAGED;
use crate::scene::positioned_file::PositionedFile;
use crate::{Error, Place, Result};

/// What a binary file begins with.
pub(super) const MAGIC: &[u8; 4] = b"glTF";

/// Size of the header of a binary file: magic, version, length.
const HEADER: u64 = 12;

/// Size of the header of a chunk: length, type.
const CHUNK_HEADER: u64 = 8;

/// An open file and its document.
pub(super) struct Container {
    pub(super) document: Document,
    pub(super) file: Arc<PositionedFile>,
    /// Where the binary chunk lies, and its length.
    pub(super) binary: Option<(u64, u64)>,
}

impl Container {
    /// Opens a file and reads its document.
    ///
    /// # Errors
    /// A file that cannot be read or is not glTF 2.0.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let advice = "name a glTF file (.gltf or .glb) that can be read";
        let file = PositionedFile::open(path).map_err(|fault| Error::io("open", path, fault).help(advice))?;
        let length = file.length();
        let start = bytes(&file, 0, length.min(4))?;
        let (json, binary) = if start == MAGIC { chunks(&file)? } else { ((0, length), None) };
        let text = bytes(&file, json.0, json.1)?;
        if binary.is_none()
            && json.0 == 0
            && text.trim_ascii_start().first().is_none_or(|&b| b != b'{' && b != 0xef)
        {
            return Err(Error::new("the file is neither binary glTF nor JSON")
                .at(Place::Byte(0))
                .help("read are glTF 2.0 files (.gltf, .glb)"));
        }
        let in_chunk = json.0 > 0;
        let document = Document::parse(&text, |line, column| match in_chunk {
            true => Place::Part(format!("JSON chunk {line}:{column}")),
            false => Place::Line { line, column },
        })?;
        Ok(Self { document, file: Arc::new(file), binary })
    }
}

/// Where something lies, and its length.
type Span = (u64, u64);

/// Where the JSON of a binary file is, and its binary chunk.
fn chunks(file: &PositionedFile) -> Result<(Span, Option<Span>)> {
    let fault = |offset, what: String| Err(Error::new(what).at(Place::Byte(offset)).help(DAMAGED));
    if file.length() < HEADER + CHUNK_HEADER {
        return fault(file.length(), "the file ends within its header".into());
    }
    let version = number(file, 4)?;
    if version != 2 {
        return Err(Error::new(format!("binary glTF of version {version}; version 2 is read"))
            .at(Place::Byte(4))
            .help("export it again as glTF 2.0"));
    }
    let claimed = u64::from(number(file, 8)?);
    if claimed > file.length() {
        return fault(8, format!("the file should be {claimed} bytes long and has {}", file.length()));
    }
    let mut offset = HEADER;
    let (mut json, mut binary) = (None, None);
    // The first chunk is the JSON, the second may be binary; those after them are others' own.
    while offset + CHUNK_HEADER <= claimed && binary.is_none() {
        let (length, kind) = (u64::from(number(file, offset)?), number(file, offset + 4)?.to_le_bytes());
        let start = offset + CHUNK_HEADER;
        if length > claimed - start {
            return fault(offset, format!("a chunk claims {length} bytes, and {} are left", claimed - start));
        }
        match &kind {
            b"JSON" if json.is_none() => json = Some((start, length)),
            b"BIN\0" if json.is_some() => binary = Some((start, length)),
            _ if json.is_none() => return fault(offset, "the first chunk is not JSON".into()),
            _ => {}
        }
        offset = start + length;
    }
    match json {
        Some(json) => Ok((json, binary)),
        None => fault(HEADER, "there is no JSON chunk".into()),
    }
}

fn number(file: &PositionedFile, offset: u64) -> Result<u32> {
    let bytes = bytes(file, offset, 4)?;
    Ok(bytes.iter().rev().fold(0, |number, byte| number << 8 | u32::from(*byte)))
}

fn bytes(file: &PositionedFile, offset: u64, length: u64) -> Result<Vec<u8>> {
    let fault = |what: String| Error::new(what).at(Place::Byte(offset)).help(DAMAGED);
    let size = usize::try_from(length).map_err(|_| fault(format!("{length} bytes of JSON are too many")))?;
    let mut bytes = vec![0; size];
    file.read_exact_at(&mut bytes, offset)
        .map_err(|source| fault(format!("cannot read {length} bytes: {source}")).because(source))?;
    Ok(bytes)
}
