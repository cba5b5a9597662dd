//! Files that a scene refers to: found, kept inside its folder, and matched by pattern.

use std::fs;
use std::path::{Component, Path, PathBuf};

use globset::{GlobBuilder, GlobMatcher};

use crate::{Error, Result};

/// The most entries of folders that one pattern may look at.
const MOST_ENTRIES: usize = 100_000;

/// A file that a scene refers to.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Asset {
    /// The path as the scene names it, relative to the scene's folder, with `/` between parts.
    pub name: String,
    /// The path to open.
    pub path: PathBuf,
}

/// A name, or a pattern with `*`, `?`, `[…]` and `{…}`, that names are compared with.
///
/// What is written always matches itself, so that names that contain brackets can be written
/// plainly.
///
/// ```
/// use froufrou::scene::asset::NamePattern;
/// let boxes = NamePattern::new("brick*").unwrap();
/// assert!(boxes.matches("brick0") && !boxes.matches("ball"));
/// assert!(NamePattern::new("Cube[1]").unwrap().matches("Cube[1]"));
/// ```
#[derive(Debug, Clone)]
pub struct NamePattern {
    text: String,
    matcher: Option<GlobMatcher>,
}

impl NamePattern {
    /// Compiles a pattern.
    ///
    /// # Errors
    /// A pattern that cannot be understood, such as one with a bracket left open.
    pub fn new(text: &str) -> Result<Self> {
        Ok(Self { text: text.to_owned(), matcher: Some(compile(text, false)?) })
    }

    /// A pattern that matches one name alone, whatever characters it has.
    pub fn literal(text: &str) -> Self {
        Self { text: text.to_owned(), matcher: None }
    }

    /// What was written.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Whether a name is meant.
    pub fn matches(&self, name: &str) -> bool {
        self.text == name || self.matcher.as_ref().is_some_and(|m| m.is_match(name))
    }
}

impl PartialEq for NamePattern {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text && self.matcher.is_some() == other.matcher.is_some()
    }
}

fn compile(text: &str, separate: bool) -> Result<GlobMatcher> {
    // Patterns become regular expressions; a book of alternatives would make a huge one.
    if text.len() > 1000 {
        return Err(Error::new(format!("a pattern of {} bytes: at most 1000 are allowed", text.len())));
    }
    let glob = GlobBuilder::new(text).literal_separator(separate).backslash_escape(true).build();
    Ok(glob
        .map_err(|fault| Error::new(format!("not a valid pattern: {}", fault.kind())).because(fault))?
        .compile_matcher())
}

/// The folder that a scene's paths start from, and whether they may leave it.
#[derive(Debug, Clone)]
pub(crate) struct Folder {
    path: PathBuf,
    canonical: PathBuf,
    allow_outside: bool,
}

impl Folder {
    pub(crate) fn new(path: &Path, allow_outside: bool) -> Result<Self> {
        // The parent of "scene.toml" is the empty path, which stands for the working folder.
        let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
        let canonical = fs::canonicalize(path).map_err(|fault| Error::io("open", path, fault))?;
        Ok(Self { path: path.to_owned(), canonical, allow_outside })
    }

    /// The folder.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// One file by its name.
    pub(crate) fn file(&self, name: &str) -> Result<Asset> {
        let asset = self.entry(name, "file")?;
        if asset.path.is_file() { Ok(asset) } else { Err(Error::new(format!("{name:?} is not a file"))) }
    }

    /// One folder in it by its name.
    pub(crate) fn folder(&self, name: &str) -> Result<Asset> {
        let asset = self.entry(name, "folder")?;
        if asset.path.is_dir() { Ok(asset) } else { Err(Error::new(format!("{name:?} is not a folder"))) }
    }

    /// A file or folder by its name; `kind` is what is expected.
    fn entry(&self, name: &str, kind: &str) -> Result<Asset> {
        self.check_name(name)?;
        let path = self.path.join(name);
        let canonical = fs::canonicalize(&path).map_err(|fault| match fault.kind() {
            std::io::ErrorKind::NotFound => Error::new(format!("there is no {kind} {name:?}")).because(fault),
            _ => Error::new(format!("cannot open {name:?}: {fault}")).because(fault),
        })?;
        if !self.allow_outside && !canonical.starts_with(&self.canonical) {
            return Err(outside(&format!("{name:?} is a link that leads out of the scene's folder")));
        }
        Ok(Asset { name: name.to_owned(), path })
    }

    /// All files that a pattern matches, sorted by name; a file of exactly that name comes first of
    /// all, as itself.
    pub(crate) fn files(&self, pattern: &str) -> Result<Vec<Asset>> {
        self.check_name(pattern)?;
        let special = |part: &str| part.contains(['*', '?', '[', '{']);
        if !special(pattern) || self.path.join(pattern).is_file() {
            return Ok(vec![self.file(pattern)?]);
        }
        let parts: Vec<&str> = pattern.split('/').collect();
        let plain = parts.iter().take_while(|part| !special(part)).count().min(parts.len() - 1);
        let base = parts[..plain].join("/");
        // Braces may hide slashes, so that the number of parts says the depth only without them.
        let deepest = if pattern.contains("**") || pattern.contains('{') { 64 } else { parts.len() - plain };
        let matcher = compile(pattern, true)?;
        let mut names = Vec::new();
        let mut looked_at = 0;
        self.walk(&base, deepest, &mut looked_at, &mut |name| {
            if matcher.is_match(name) {
                names.push(name.to_owned());
            }
        })?;
        if names.is_empty() {
            return Err(Error::new(format!("no file matches {pattern:?}")));
        }
        names.sort();
        names.iter().map(|name| self.file(name)).collect()
    }

    /// Gives the name of every file below a folder.
    fn walk(
        &self,
        base: &str,
        deepest: usize,
        looked_at: &mut usize,
        give: &mut impl FnMut(&str),
    ) -> Result<()> {
        let folder = self.path.join(base);
        let Ok(entries) = fs::read_dir(&folder) else { return Ok(()) };
        for entry in entries.flatten() {
            *looked_at += 1;
            if *looked_at > MOST_ENTRIES {
                return Err(Error::new(format!("the pattern looks at more than {MOST_ENTRIES} files")));
            }
            // A name that is not Unicode cannot be written in a scene either.
            let Ok(file_name) = entry.file_name().into_string() else { continue };
            let name = match base {
                "" => file_name,
                "/" => format!("/{file_name}"),
                _ => format!("{base}/{file_name}"),
            };
            let Ok(kind) = fs::metadata(entry.path()) else { continue };
            if kind.is_file() {
                give(&name);
            } else if kind.is_dir() && deepest > 1 {
                self.walk(&name, deepest - 1, looked_at, give)?;
            }
        }
        Ok(())
    }

    /// Refuses names that leave the folder by their very spelling.
    fn check_name(&self, name: &str) -> Result<()> {
        if self.allow_outside {
            return Ok(());
        }
        let mut depth = 0i64;
        for part in Path::new(name).components() {
            depth += match part {
                Component::Normal(_) => 1,
                Component::CurDir => 0,
                Component::ParentDir => -1,
                Component::RootDir | Component::Prefix(_) => {
                    return Err(outside(&format!("{name:?} is an absolute path")));
                }
            };
            if depth < 0 {
                return Err(outside(&format!("{name:?} leaves the scene's folder")));
            }
        }
        Ok(())
    }
}

fn outside(what: &str) -> Error {
    Error::new(what).help("a scene may use files outside its folder only with --allow-outside")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(result: Result<impl Sized>) -> String {
        result.err().map(|e| e.to_string()).unwrap_or_default()
    }

    #[test]
    fn patterns_give_files_sorted_by_name() -> std::io::Result<()> {
        let room = tempfile::tempdir()?;
        fs::create_dir_all(room.path().join("hits/deep"))?;
        for name in ["hits/b.wav", "hits/a.wav", "hits/c.flac", "hits/deep/d.wav", "hits/e[1].wav"] {
            fs::write(room.path().join(name), "")?;
        }
        let folder = Folder::new(room.path(), false).map_err(std::io::Error::other)?;
        let names = |pattern: &str| -> Vec<String> {
            folder.files(pattern).map(|f| f.into_iter().map(|a| a.name).collect()).unwrap_or_default()
        };
        assert_eq!(names("hits/*.wav"), ["hits/a.wav", "hits/b.wav", "hits/e[1].wav"]);
        assert_eq!(names("hits/**/*.wav"), ["hits/a.wav", "hits/b.wav", "hits/deep/d.wav", "hits/e[1].wav"]);
        assert_eq!(names("*/?.{wav,flac}"), ["hits/a.wav", "hits/b.wav", "hits/c.flac"]);
        assert_eq!(names("hits/e[1].wav"), ["hits/e[1].wav"]);
        assert_eq!(text(folder.files("hits/*.ogg")), "no file matches \"hits/*.ogg\"");
        assert_eq!(text(folder.files("nowhere/*.ogg")), "no file matches \"nowhere/*.ogg\"");
        assert!(text(folder.files("hits/[a.wav")).contains("not a valid pattern"));
        assert_eq!(text(folder.file("hits")), "\"hits\" is not a file");
        assert_eq!(text(folder.file("hits/z.wav")), "there is no file \"hits/z.wav\"");
        Ok(())
    }

    #[test]
    fn nothing_outside_the_folder_is_reached_without_leave() -> std::io::Result<()> {
        let room = tempfile::tempdir()?;
        let inside = room.path().join("scene");
        fs::create_dir_all(inside.join("a"))?;
        fs::write(room.path().join("secret.wav"), "")?;
        fs::write(inside.join("fine.wav"), "")?;
        let strict = Folder::new(&inside, false).map_err(std::io::Error::other)?;
        assert!(strict.file("a/../fine.wav").is_ok());
        let absolute = room.path().join("secret.wav").display().to_string();
        for name in ["../secret.wav", "a/../../secret.wav", "../scene/fine.wav", &absolute] {
            assert!(text(strict.file(name)).contains("--allow-outside"), "{name}");
            assert!(text(strict.files(name)).contains("--allow-outside"), "{name}");
        }
        assert!(text(strict.files("../*.wav")).contains("--allow-outside"));
        let free = Folder::new(&inside, true).map_err(std::io::Error::other)?;
        assert!(free.file("../secret.wav").is_ok());
        assert!(free.files("../*.wav").is_ok());
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(room.path().join("secret.wav"), inside.join("link.wav"))?;
            std::os::unix::fs::symlink(&inside, inside.join("a/loop"))?;
            assert!(text(strict.file("link.wav")).contains("--allow-outside"));
            assert!(text(strict.files("l*.wav")).contains("--allow-outside"));
            assert!(free.file("link.wav").is_ok());
            // A folder that contains itself ends at a depth, not never.
            assert!(strict.files("a/**/fine.wav").is_ok());
        }
        Ok(())
    }
}
