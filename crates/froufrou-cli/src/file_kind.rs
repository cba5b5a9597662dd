//! Tells what a file is by its content; by its name only where the content could be anything.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use froufrou::scene::format::AnimationFormat;
use froufrou::scene::pose_log::PoseLog;
use froufrou::{Error, Result};

/// Enough to get past the comments that stand above the first line of most text files.
const HEAD_BYTES: u64 = 16 << 10;

/// A kind of file that froufrou reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// A scene: TOML.
    Scene,
    /// An animation, in its format.
    Animation(AnimationFormat),
    /// An audio file; the name of its format.
    Recording(&'static str),
    /// What a head does to sound: SOFA, which is HDF5.
    Head,
    /// A score in either space.
    Score,
    /// Events, one JSON object a line.
    Events,
    /// A contact log: CSV, gzipped or not.
    ContactLog,
}

impl FileKind {
    /// Looks at the beginning of a file.
    ///
    /// # Errors
    /// A file that cannot be read, or that is of no kind known; `readable` names those that the
    /// caller reads.
    pub fn of(path: &Path, readable: &str) -> Result<Self> {
        if let Some(format) = AnimationFormat::of_pattern(path) {
            return Ok(Self::Animation(format));
        }
        let metadata = std::fs::metadata(path).map_err(|fault| Error::io("open", path, fault))?;
        if !metadata.is_file() {
            let found = if metadata.is_dir() { "a folder" } else { "a pipe or a device" };
            return Err(Error::new(format!("expected a file, found {found}")).in_file(path));
        }
        let file = File::open(path).map_err(|fault| Error::io("open", path, fault))?;
        let mut head = Vec::new();
        file.take(HEAD_BYTES).read_to_end(&mut head).map_err(|fault| Error::io("read", path, fault))?;
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
        let kind = Self::of_head(&head, &name, metadata.len()).ok_or_else(|| {
            let what = if head.is_empty() { "the file is empty" } else { "the file is of no known kind" };
            Error::new(what).in_file(path).help(format!("read are {readable}"))
        })?;
        // Both logs are tables, which their columns tell apart.
        Ok(match kind {
            Self::ContactLog if PoseLog::recognises(path) => Self::Animation(AnimationFormat::PoseLog),
            kind => kind,
        })
    }

    /// What a file of `length` bytes is that begins with these and has this name, in lower case.
    fn of_head(head: &[u8], name: &str, length: u64) -> Option<Self> {
        let animation = || AnimationFormat::of_head(head, name, length).map(Self::Animation);
        // glTF is JSON as events are, and is told apart before them.
        let json = head.trim_ascii_start().starts_with(b"{");
        let gltf = || animation().filter(|kind| json && *kind == Self::Animation(AnimationFormat::Gltf));
        // Old Alembic files are HDF5 as well.
        let hdf =
            || (head.starts_with(b"\x89HDF\r\n\x1a\n") && !name.ends_with(".abc")).then_some(Self::Head);
        let magic = Self::of_magic(head).or_else(hdf).or_else(gltf).or_else(|| Self::of_text(head, name));
        magic.or_else(animation).or_else(|| Self::of_name(name))
    }

    fn of_magic(head: &[u8]) -> Option<Self> {
        let form = head.get(8..12).unwrap_or_default();
        Some(match head {
            [0x1f, 0x8b, ..] => Self::ContactLog,
            [b'R', b'I', b'F', b'F' | b'X', ..] if form == b"WAVE" => Self::Recording("WAV"),
            [b'R', b'F', b'6', b'4', ..] | [b'B', b'W', b'6', b'4', ..] if form == b"WAVE" => {
                Self::Recording("RF64")
            }
            [b'F', b'O', b'R', b'M', ..] if form == b"AIFF" => Self::Recording("AIFF"),
            [b'F', b'O', b'R', b'M', ..] if form == b"AIFC" => Self::Recording("AIFF-C"),
            [b'f', b'L', b'a', b'C', ..] => Self::Recording("FLAC"),
            [b'O', b'g', b'g', b'S', ..] => Self::Recording("Ogg Vorbis"),
            [b'I', b'D', b'3', ..] => Self::Recording("MP3"),
            [0xff, second, ..] if second & 0xe0 == 0xe0 => Self::Recording("MP3"),
            // Those that the reader of recordings knows by name and tells what to do with.
            [b'c', b'a', b'f', b'f', ..] => Self::Recording("CAF"),
            [b'r', b'i', b'f', b'f', ..] => Self::Recording("Wave64"),
            [b'w', b'v', b'p', b'k', ..] => Self::Recording("WavPack"),
            [b'M', b'A', b'C', b' ', ..] => Self::Recording("Monkey's Audio"),
            [b'.', b's', b'n', b'd', ..] => Self::Recording("AU"),
            [0x1a, 0x45, 0xdf, 0xa3, ..] => Self::Recording("Matroska"),
            [_, _, _, _, b'f', b't', b'y', b'p', ..] => Self::Recording("MP4"),
            _ => return None,
        })
    }

    /// Tells the kinds of text apart by their first line that says something.
    fn of_text(head: &[u8], name: &str) -> Option<Self> {
        // A character may be cut in two at the end of what was read.
        let text = match std::str::from_utf8(head) {
            Ok(text) => text,
            Err(fault) if fault.error_len().is_none() => {
                std::str::from_utf8(&head[..fault.valid_up_to()]).ok()?
            }
            Err(_) => return None,
        };
        if text.contains('\0') {
            return None;
        }
        let text = text.trim_start_matches('\u{feff}');
        let line = text.lines().map(str::trim).find(|line| !line.is_empty() && !line.starts_with('#'))?;
        if line.split_whitespace().next() == Some("froufrou-score") {
            return Some(Self::Score);
        }
        // What is named as one of the kinds is taken as such, so that its reader says what is wrong.
        if let Some(named) = Self::of_name(name).filter(|kind| !matches!(kind, Self::Recording(_))) {
            return Some(named);
        }
        let key = line.split_once('=').map(|(key, _)| key.trim());
        let is_key = |key: &str| key.chars().all(|c| c.is_alphanumeric() || "_-.\"' ".contains(c));
        if line.starts_with('{') {
            Some(Self::Events)
        } else if line.starts_with('[') || key.is_some_and(is_key) {
            Some(Self::Scene)
        } else if line.split(',').count() > 2 {
            Some(Self::ContactLog)
        } else {
            None
        }
    }

    fn of_name(name: &str) -> Option<Self> {
        let kinds = [
            (".toml", Self::Scene),
            (".jsonl", Self::Events),
            (".score", Self::Score),
            (".csv", Self::ContactLog),
            (".mp3", Self::Recording("MP3")),
            (".sofa", Self::Head),
        ];
        kinds.into_iter().find(|(ending, _)| name.ends_with(ending)).map(|(_, kind)| kind)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_goes_before_the_name() {
        let cases: [(&[u8], &str, Option<FileKind>); 20] = [
            (b"RIFF\0\0\0\0WAVEfmt ", "a.mp3", Some(FileKind::Recording("WAV"))),
            (b"Ogawa\xff", "a.bin", Some(FileKind::Animation(AnimationFormat::Alembic))),
            (b"\x89HDF\r\n\x1a\n\0", "a", Some(FileKind::Head)),
            (b"\x89HDF\r\n\x1a\n\0", "a.abc", Some(FileKind::Animation(AnimationFormat::Alembic))),
            (b"POINTCACHE2\0", "a", Some(FileKind::Animation(AnimationFormat::Pc2))),
            (b"# 8, a, b\nv 0 0 0\n", "a", Some(FileKind::Animation(AnimationFormat::Obj))),
            (b"o block\n", "a.csv", Some(FileKind::ContactLog)),
            (b"glTF\x02\0\0\0", "a.abc", Some(FileKind::Animation(AnimationFormat::Gltf))),
            (b"{\n \"asset\" : {", "a.jsonl", Some(FileKind::Animation(AnimationFormat::Gltf))),
            (b"{\"other\":1}", "a.gltf", Some(FileKind::Animation(AnimationFormat::Gltf))),
            (b"\x1f\x8b\x08", "a", Some(FileKind::ContactLog)),
            (b"\n# by hand\nfroufrou-score 1 object\n", "a.toml", Some(FileKind::Score)),
            (b"{\"kind\":\"impact\"}", "a.txt", Some(FileKind::Events)),
            (b"# a scene\n[listener]\n", "a", Some(FileKind::Scene)),
            (b"rate = 48000\n", "a", Some(FileKind::Scene)),
            (b"t,a,b,x,y,z\n", "a", Some(FileKind::ContactLog)),
            (b"", "empty.toml", Some(FileKind::Scene)),
            (b"", "empty", None),
            (b"Dear all, hello\n", "letter.txt", None),
            (b"\0\x01\x02\x03\xfe", "a.bin", None),
        ];
        for (head, name, kind) in cases {
            assert_eq!(
                FileKind::of_head(head, name, head.len() as u64),
                kind,
                "{name}: {:?}",
                String::from_utf8_lossy(head)
            );
        }
    }

    #[test]
    fn a_character_cut_in_two_does_no_harm() {
        let head = "[listener] # für".as_bytes();
        assert_eq!(FileKind::of_head(&head[..head.len() - 2], "a", 1000), Some(FileKind::Scene));
    }
}
