//! Which format an animation file has, told by its content; by its name only where the content could
//! be anything.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::gltf::Gltf;
use super::obj;
use crate::{Error, Result};

/// Enough to get past the comments that stand above the first statement of most text files.
const HEAD_BYTES: u64 = 16 << 10;

/// A format of animation files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AnimationFormat {
    /// An Alembic archive.
    Alembic,
    /// A glTF file, binary or JSON.
    Gltf,
    /// A USD file: text, binary or a package.
    Usd,
    /// A point cache in the format PC2.
    Pc2,
    /// A point cache in the format MDD.
    Mdd,
    /// A Wavefront OBJ file: a mesh that stands still.
    Obj,
    /// A pattern that the OBJ files of a sequence match, one file a frame.
    ObjSequence,
    /// The poses of the bodies of a simulation, CSV, gzipped or not.
    PoseLog,
}

impl AnimationFormat {
    /// The format of a file, or of the files that a pattern in the path's last part matches.
    ///
    /// # Errors
    /// A file that cannot be read, or whose format is not known.
    pub fn of(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        if let Some(format) = Self::of_pattern(path) {
            return Ok(format);
        }
        let metadata = std::fs::metadata(path).map_err(|fault| Error::io("open", path, fault))?;
        // Asked before opening: to open a named pipe without a writer would wait for ever.
        if !metadata.is_file() {
            return Err(Error::new("it is not an ordinary file").in_file(path));
        }
        let file = File::open(path).map_err(|fault| Error::io("open", path, fault))?;
        let mut head = Vec::new();
        file.take(HEAD_BYTES).read_to_end(&mut head).map_err(|fault| Error::io("read", path, fault))?;
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
        Self::of_head(&head, &name, metadata.len()).ok_or_else(|| {
            Error::new(if head.is_empty() { "the file is empty" } else { "no animation file that is known" })
                .in_file(path)
                .at(crate::Place::Byte(0))
                .help("read are Alembic (.abc), USD (.usd, .usda, .usdc, .usdz), glTF (.gltf, .glb), point caches (.pc2, .mdd), OBJ (.obj) and pose logs (.csv, .csv.gz)")
        })
    }

    /// The format of what a pattern stands for, if the path is one and no file.
    pub fn of_pattern(path: &Path) -> Option<Self> {
        obj::is_pattern(path).then_some(Self::ObjSequence)
    }

    /// The format of a file of `length` bytes that begins with these and has this name, in lower
    /// case.
    pub fn of_head(head: &[u8], name: &str, length: u64) -> Option<Self> {
        if head.starts_with(b"Ogawa") || head.starts_with(b"\x89HDF") {
            Some(Self::Alembic)
        } else if Gltf::recognises(head) {
            Some(Self::Gltf)
        } else if [b"PXR-USDC".as_slice(), b"#usda", b"PK\x03\x04"]
            .iter()
            .any(|magic| head.starts_with(magic))
        {
            Some(Self::Usd)
        } else if head.starts_with(b"POINTCACHE2\0") {
            Some(Self::Pc2)
        } else if head_is_obj(head) {
            Some(Self::Obj)
        } else if is_mdd(head, length) {
            Some(Self::Mdd)
        } else if head.starts_with(&[0x1f, 0x8b]) {
            // No other format is gzipped.
            Some(Self::PoseLog)
        } else {
            // What bears the name is taken as such, so that its reader says what is wrong.
            let endings = [
                (".abc", Self::Alembic),
                (".gltf", Self::Gltf),
                (".glb", Self::Gltf),
                (".usd", Self::Usd),
                (".usda", Self::Usd),
                (".usdc", Self::Usd),
                (".usdz", Self::Usd),
                (".pc2", Self::Pc2),
                (".mdd", Self::Mdd),
                (".obj", Self::Obj),
                (".csv", Self::PoseLog),
                (".csv.gz", Self::PoseLog),
            ];
            endings.into_iter().find(|(ending, _)| name.ends_with(ending)).map(|(_, format)| format)
        }
    }

    /// What people call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Alembic => "Alembic archive",
            Self::Gltf => "glTF file",
            Self::Usd => "USD file",
            Self::Pc2 => "PC2 point cache",
            Self::Mdd => "MDD point cache",
            Self::Obj => "OBJ file",
            Self::ObjSequence => "OBJ sequence",
            Self::PoseLog => "pose log",
        }
    }

    /// True for what counts frames, so that seconds need a frame rate.
    pub(crate) fn counts_frames(self) -> bool {
        matches!(self, Self::Pc2 | Self::ObjSequence)
    }

    /// True for what may hold several clips, of which one is played.
    pub(crate) fn has_clips(self) -> bool {
        self == Self::Gltf
    }

    /// True for what is a table whose columns can be named.
    pub(crate) fn has_columns(self) -> bool {
        self == Self::PoseLog
    }

    /// True for what has vertices and no faces.
    pub(crate) fn has_no_faces(self) -> bool {
        matches!(self, Self::Pc2 | Self::Mdd)
    }
}

/// MDD has no signature; but its counts say how long the file is, to the byte.
fn is_mdd(head: &[u8], length: u64) -> bool {
    let Some([frames, points]) = head.first_chunk::<8>().map(|bytes| {
        let (a, b) = bytes.split_at(4);
        [a, b].map(|part| part.iter().fold(0_u64, |n, byte| n << 8 | u64::from(*byte)))
    }) else {
        return false;
    };
    // Both are below 2³², so that nothing overflows 128 bits.
    let expected = 8 + 4 * u128::from(frames) + 12 * u128::from(frames) * u128::from(points);
    frames > 0 && expected == u128::from(length)
}

/// Text whose first statement is one of those that OBJ files begin with.
fn head_is_obj(head: &[u8]) -> bool {
    if head.contains(&0) {
        return false;
    }
    let mut lines = head.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii);
    let Some(line) = lines.find(|line| !line.is_empty() && !line.starts_with(b"#")) else { return false };
    let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    let (first, second) = (words.next().unwrap_or_default(), words.next());
    let number =
        || second.and_then(|w| std::str::from_utf8(w).ok()).is_some_and(|w| w.parse::<f32>().is_ok());
    match first {
        b"v" | b"vn" | b"vt" => number(),
        b"mtllib" | b"o" | b"g" | b"usemtl" => second.is_some_and(|word| !word.starts_with(b"=")),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_goes_before_the_name() {
        let mdd = [0, 0, 0, 2, 0, 0, 0, 1, 9];
        let cases: [(&[u8], &str, u64, Option<AnimationFormat>); 19] = [
            (b"Ogawa\xff", "a.obj", 6, Some(AnimationFormat::Alembic)),
            (b"glTF\x02\0\0\0", "a.abc", 8, Some(AnimationFormat::Gltf)),
            (b"{\n \"asset\" : {", "a", 14, Some(AnimationFormat::Gltf)),
            (b"PXR-USDC\0\x08", "a.abc", 10, Some(AnimationFormat::Usd)),
            (b"#usda 1.0\n(\n)\n", "a", 14, Some(AnimationFormat::Usd)),
            (b"POINTCACHE2\0", "a.mdd", 12, Some(AnimationFormat::Pc2)),
            (&mdd, "a", 8 + 8 + 24, Some(AnimationFormat::Mdd)),
            (&mdd, "a", 8 + 8 + 25, None),
            (&mdd, "a.mdd", 8 + 8 + 25, Some(AnimationFormat::Mdd)),
            (b"# made\r\n\r\nmtllib a.mtl\r\n", "a", 24, Some(AnimationFormat::Obj)),
            (b"v 0 1 2", "a.abc", 7, Some(AnimationFormat::Obj)),
            (b"v, a, b\n", "a", 7, None),
            (b"o = 1\n", "a", 6, None),
            (b"", "a.obj", 0, Some(AnimationFormat::Obj)),
            (b"", "a", 0, None),
            (b"\x1f\x8b\x08", "a.abc", 3, Some(AnimationFormat::PoseLog)),
            (b"t,body,x,y,z\n", "a.csv", 13, Some(AnimationFormat::PoseLog)),
            (b"v 0 1 2", "a.csv", 7, Some(AnimationFormat::Obj)),
            (&[0; 8], "a", 8, None),
        ];
        for (head, name, length, format) in cases {
            assert_eq!(AnimationFormat::of_head(head, name, length), format, "{name} {head:?}");
        }
    }
}
