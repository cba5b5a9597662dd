//! The files that a stage is made of: found, kept within the folder and checked before they are
//! decoded.

use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use openusd::ar::{Asset, ResolvedPath, Resolver};

use super::fault::{Budget, Damage};
use super::{crate_check, package};
use crate::{Error, Place, Result};

/// More brackets within each other than any layer has.
const MOST_BRACKETS: usize = 256;

/// The library takes every path that ends so for a layer whose kind its first bytes tell.
const ANY: &str = ".usd";

/// What happened while layers were looked for.
#[derive(Default)]
pub(super) struct Log {
    faults: Mutex<Vec<Error>>,
    /// The length of each, by the file it is in and where it begins there.
    lengths: Mutex<BTreeMap<(PathBuf, u64), u64>>,
}

impl Log {
    /// The first thing that went wrong.
    pub(super) fn first_fault(&self) -> Option<Error> {
        let mut faults = self.faults.lock().unwrap_or_else(PoisonError::into_inner);
        (!faults.is_empty()).then(|| faults.remove(0))
    }

    /// How long the layers are together.
    pub(super) fn bytes(&self) -> u64 {
        self.lengths.lock().unwrap_or_else(PoisonError::into_inner).values().sum()
    }

    fn add(&self, fault: Error) {
        self.faults.lock().unwrap_or_else(PoisonError::into_inner).push(fault);
    }
}

/// Where layers may come from.
enum Source {
    /// Files in a folder, and below it.
    Folder(PathBuf),
    /// Parts of one package, by name: where they begin and how long they are.
    Package(HashMap<String, (u64, u64)>),
}

/// Finds and opens layers.
pub(super) struct Layers {
    file: PathBuf,
    source: Source,
    log: Arc<Log>,
}

impl Layers {
    /// For a stage whose root is `file`; and the name of its root layer.
    ///
    /// # Errors
    /// A file that cannot be opened, or a package that cannot be read.
    pub(super) fn new(file: &Path, is_package: bool, log: Arc<Log>) -> Result<(Self, String)> {
        let (source, root) = if is_package {
            let entries = package::entries(file)?;
            let root = format!("/{}", entries[0].name);
            let parts = entries.into_iter().map(|entry| (entry.name, (entry.start, entry.size)));
            (Source::Package(parts.collect()), root)
        } else {
            let whole = file.canonicalize().map_err(|fault| Error::io("open", file, fault))?;
            let folder = whole.parent().map(Path::to_owned).unwrap_or_default();
            let Some(root) = whole.to_str() else {
                return Err(Error::new("the path is not Unicode").in_file(file).help("rename it"));
            };
            (Source::Folder(folder), root.to_owned())
        };
        Ok((Self { file: file.to_owned(), source, log }, root))
    }

    fn fault(&self, layer: &str, what: &str, help: &str) {
        let error = Error::new(format!("the layer `{layer}`, which the stage is made of, {what}"));
        let error = error.in_file(&self.file).at(Place::Part(layer.to_owned())).help(help);
        self.log.add(error);
    }

    /// The place of a layer, if it may be read.
    fn find(&self, layer: &str) -> Option<()> {
        if layer.contains("://") {
            self.fault(layer, "is on the network, where nothing is read", "save it beside the file");
            return None;
        }
        match &self.source {
            Source::Package(parts) => {
                if !parts.contains_key(layer.trim_start_matches('/')) {
                    self.fault(layer, "is not in the package", "export the package again");
                    return None;
                }
            }
            Source::Folder(folder) => match Path::new(layer).canonicalize() {
                Ok(path) if !path.starts_with(folder) => {
                    let help = "only files beside it or in folders below are read: copy it there";
                    self.fault(layer, "is outside of the file's folder", help);
                    return None;
                }
                Ok(path) if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("usdz")) => {
                    self.fault(layer, "is a package, which only a scene can name", "unpack it");
                    return None;
                }
                Ok(_) => {}
                Err(fault) => {
                    self.fault(
                        layer,
                        &format!("cannot be opened: {fault}"),
                        "put it where the file expects it",
                    );
                    return None;
                }
            },
        }
        Some(())
    }
}

/// A path without `.` and `..`, as far as that can be said without looking.
fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for component in path.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir => {
                plain.pop();
            }
            other => plain.push(other),
        }
    }
    plain
}

impl Resolver for Layers {
    fn create_identifier(&self, asset_path: &str, anchor: Option<&ResolvedPath>) -> String {
        let path = Path::new(asset_path);
        match anchor.and_then(|anchor| anchor.parent()) {
            Some(folder) if path.is_relative() && !asset_path.is_empty() && !asset_path.contains("://") => {
                plain(&folder.join(path)).to_string_lossy().into_owned()
            }
            _ => asset_path.to_owned(),
        }
    }

    fn resolve(&self, asset_path: &str) -> Option<ResolvedPath> {
        self.find(asset_path)?;
        Some(ResolvedPath::new(format!("{asset_path}{ANY}")))
    }

    fn resolve_for_new_asset(&self, _: &str) -> Option<ResolvedPath> {
        None
    }

    fn open_asset(&self, resolved_path: &ResolvedPath) -> io::Result<Box<dyn Asset>> {
        let name = resolved_path.to_string_lossy();
        let layer = name.strip_suffix(ANY).unwrap_or(&name);
        let (file, start, size) = match &self.source {
            Source::Folder(_) => {
                let file = File::open(layer)?;
                let size = file.metadata()?.len();
                (file, 0, size)
            }
            Source::Package(parts) => {
                let part = parts.get(layer.trim_start_matches('/'));
                let &(start, size) = part.ok_or(io::ErrorKind::NotFound)?;
                (File::open(&self.file)?, start, size)
            }
        };
        let path = match &self.source {
            Source::Folder(_) => PathBuf::from(layer),
            Source::Package(_) => self.file.clone(),
        };
        Ok(Box::new(Layer { file, start, size, position: 0, path, log: Arc::clone(&self.log) }))
    }
}

/// A file, or a part of a package.
struct Layer {
    file: File,
    start: u64,
    size: u64,
    position: u64,
    path: PathBuf,
    log: Arc<Log>,
}

impl Read for Layer {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.file.seek(SeekFrom::Start(self.start + self.position))?;
        let left = self.size.saturating_sub(self.position);
        let read = (&mut self.file).take(left).read(buffer)?;
        self.position += read as u64;
        Ok(read)
    }
}

impl Seek for Layer {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let position = match to {
            SeekFrom::Start(position) => Some(position),
            SeekFrom::End(offset) => self.size.checked_add_signed(offset),
            SeekFrom::Current(offset) => self.position.checked_add_signed(offset),
        };
        self.position = position.ok_or(io::ErrorKind::InvalidInput)?;
        Ok(self.position)
    }
}

impl Asset for Layer {
    fn size(&self) -> io::Result<u64> {
        Ok(self.size)
    }

    fn read_all(&mut self) -> io::Result<Vec<u8>> {
        self.file.seek(SeekFrom::Start(self.start))?;
        let mut bytes = Vec::new();
        (&mut self.file).take(self.size).read_to_end(&mut bytes)?;
        let checked = if bytes.starts_with(b"PXR-USDC") {
            crate_check::check(&bytes, &mut Budget::of(bytes.len() as u64))
        } else {
            check_text(&bytes)
        };
        if let Err(damage) = checked {
            let error = damage.in_file(&self.path);
            let message = error.to_string();
            self.log.add(error);
            return Err(io::Error::other(message));
        }
        let mut lengths = self.log.lengths.lock().unwrap_or_else(PoisonError::into_inner);
        lengths.insert((self.path.clone(), self.start), bytes.len() as u64);
        drop(lengths);
        Ok(bytes)
    }
}

/// Whether every brace of a path closes one before it: the library looks for ever for one that is not there.
pub(super) fn has_paired_braces(path: &[u8]) -> bool {
    let mut open = 0_usize;
    for byte in path {
        match byte {
            b'{' => open += 1,
            b'}' if open == 0 => return false,
            b'}' => open -= 1,
            _ => {}
        }
    }
    open == 0
}

/// Whether what is quoted before this is the name of a variant: `"name" {`, `"name" (…) {`.
fn names_a_variant(behind: Option<&[u8]>) -> bool {
    matches!(behind.map(<[u8]>::trim_ascii_start), Some([b'{' | b'(', ..]))
}

/// The reader of text calls itself for every bracket within brackets; and paths and names must be such that
/// the library can take them apart.
fn check_text(bytes: &[u8]) -> std::result::Result<(), Damage> {
    let (mut depth, mut at) = (0_usize, 0);
    // The last words: `def "name"` and `over Mesh "name"` name prims.
    let mut words: [&[u8]; 2] = [b"", b""];
    while let Some(&byte) = bytes.get(at) {
        let rest = &bytes[at..];
        let until = |end: &[u8]| rest.windows(end.len()).position(|window| window == end);
        match byte {
            b'(' | b'[' | b'{' => depth += 1,
            b')' | b']' | b'}' => depth = depth.saturating_sub(1),
            b'"' | b'\'' | b'@' => {
                let (quoted, quote) = (at, [byte; 3]);
                let quote = if rest.starts_with(&quote) { &quote[..] } else { &quote[..1] };
                at += quote.len();
                while at < bytes.len() && !bytes[at..].starts_with(quote) {
                    at += if bytes[at] == b'\\' && byte != b'@' { 2 } else { 1 };
                }
                let end = at.min(bytes.len());
                let is_prim = words.iter().any(|word| matches!(*word, b"def" | b"over" | b"class"));
                let is_name = byte != b'@' && (is_prim || names_a_variant(bytes.get(end + 1..)));
                if is_name && !has_paired_braces(&bytes[quoted..end]) {
                    return Err(Damage::new(quoted as u64, "a name whose braces are not in pairs"));
                }
                at += quote.len() - 1;
                words = [b"", b""];
            }
            b'<' => {
                let length = until(b">").unwrap_or(0);
                if !has_paired_braces(&rest[..length]) {
                    return Err(Damage::new(at as u64, "a path whose braces are not in pairs"));
                }
                at += length;
            }
            b'#' => at += until(b"\n").unwrap_or(rest.len() - 1),
            _ if is_of_word(byte) => {
                let length = rest.iter().position(|byte| !is_of_word(*byte)).unwrap_or(rest.len());
                words = [words[1], &rest[..length]];
                at += length - 1;
            }
            _ => {}
        }
        if depth > MOST_BRACKETS {
            return Err(Damage::new(
                at as u64,
                format!("more than {MOST_BRACKETS} brackets within each other"),
            ));
        }
        at += 1;
    }
    Ok(())
}

fn is_of_word(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_'
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brackets_are_counted_outside_of_text() {
        let nested = |open: &str, times: usize| open.repeat(times).into_bytes();
        assert!(check_text(&nested("{", MOST_BRACKETS)).is_ok());
        assert!(check_text(&nested("({[", MOST_BRACKETS)).is_err());
        assert!(check_text(&nested("[]", 10_000)).is_ok());
        let quoted = format!("\"\"\"{} \" \"\"\" '{}'", "{".repeat(1000), "(".repeat(1000));
        assert!(check_text(quoted.as_bytes()).is_ok());
        assert!(check_text(format!("\"\\\"\" {}", "{".repeat(1000)).as_bytes()).is_err());
    }

    #[test]
    fn braces_of_names_and_paths_are_in_pairs() {
        for sound in [
            "def Mesh \"a\" { doc = \"a } in text\" }",
            "rel x = </a{v=one}b>",
            "variantSet \"v\" = { \"one\" { } }",
            "references = @a } b.usda@</c>",
            "# def \"a}b\" { \n '}'",
            "",
            "<",
        ] {
            assert!(check_text(sound.as_bytes()).is_ok(), "{sound}");
        }
        for wrong in [
            "rel x = </a}b>",
            "references = </a{v=one>",
            "def \"a}b\" {}",
            "over  Mesh\n'a{'",
            "\"a}b\" {",
            "\"a}b\" (",
            "class \"}",
        ] {
            assert!(check_text(wrong.as_bytes()).is_err(), "{wrong}");
        }
    }

    #[test]
    fn paths_are_tidied() {
        assert_eq!(plain(Path::new("/a/./b/../c/d.usda")), Path::new("/a/c/d.usda"));
    }
}
