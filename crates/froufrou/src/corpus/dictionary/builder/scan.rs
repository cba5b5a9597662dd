//! The recordings of a folder.

use std::path::{Component, Path, PathBuf};

use super::{Progress, Stage};
use crate::corpus::dictionary::manifest::FILE_NAME;
use crate::corpus::dictionary::packed;
use crate::error::{Error, Result};

/// How names of recordings end, in capitals or not.
const ENDINGS: [&str; 8] = ["wav", "wave", "aif", "aiff", "aifc", "flac", "ogg", "mp3"];

/// The most recordings of a corpus.
const MOST: usize = 100_000;

/// A recording that lies in the folder.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Found {
    /// Its path from the folder, with slashes.
    pub name: String,
    pub path: PathBuf,
    /// What its content hashes to.
    pub hash: String,
}

/// All recordings in a folder and those within it, in order of their names. Hidden files and folders, links to folders and corpora are left out.
pub(super) fn scan(
    recordings: &Path,
    corpus: &Path,
    progress: &mut dyn FnMut(Progress),
) -> Result<Vec<Found>> {
    let names = names(recordings, corpus)?;
    let total = names.len() as u64;
    let mut found = Vec::with_capacity(names.len());
    for (number, name) in names.into_iter().enumerate() {
        progress(Progress { stage: Stage::Reading, name: &name, done: number as u64, total });
        let path = recordings.join(&name);
        let bytes = std::fs::read(&path).map_err(|e| Error::io("read", &path, e))?;
        found.push(Found { name, path, hash: packed::hash(&[&bytes]) });
    }
    Ok(found)
}

/// Their paths from the folder, with slashes.
pub(crate) fn names(recordings: &Path, corpus: &Path) -> Result<Vec<String>> {
    let metadata = std::fs::metadata(recordings).map_err(|e| Error::io("open", recordings, e))?;
    if !metadata.is_dir() {
        return Err(Error::new("expected a folder of recordings, found a file").in_file(recordings));
    }
    let mut names = Vec::new();
    walk(recordings, &mut String::new(), corpus.canonicalize().ok().as_deref(), &mut names)?;
    names.sort();
    if names.is_empty() {
        return Err(Error::new("the folder holds no recordings")
            .in_file(recordings)
            .help(format!("read are files that end in .{}", ENDINGS.join(", ."))));
    }
    Ok(names)
}

fn walk(folder: &Path, below: &mut String, corpus: Option<&Path>, names: &mut Vec<String>) -> Result<()> {
    let fault = |e| Error::io("read", folder, e);
    for entry in std::fs::read_dir(folder).map_err(fault)? {
        let entry = entry.map_err(fault)?;
        let path = entry.path();
        let Some(name) = entry.file_name().to_str().map(str::to_owned) else {
            return Err(Error::new("expected a name in UTF-8").in_file(path));
        };
        if name.starts_with('.') {
            continue;
        }
        let kind = entry.file_type().map_err(fault)?;
        let length = below.len();
        if kind.is_dir() {
            let is_corpus = path.join(FILE_NAME).exists()
                || corpus.is_some_and(|corpus| path.canonicalize().is_ok_and(|path| path == corpus));
            if !is_corpus {
                below.push_str(&name);
                below.push('/');
                walk(&path, below, corpus, names)?;
                below.truncate(length);
            }
            continue;
        }
        let ending = name.rsplit_once('.').map(|(_, ending)| ending.to_lowercase());
        let is_sound = ending.is_some_and(|ending| ENDINGS.contains(&&*ending));
        if is_sound && std::fs::metadata(&path).is_ok_and(|metadata| metadata.is_file()) {
            names.push(format!("{below}{name}"));
            if names.len() > MOST {
                return Err(Error::new(format!("expected at most {MOST} recordings")).in_file(folder));
            }
        }
    }
    Ok(())
}

/// A folder as it is called from a corpus, which need not be there yet.
pub(crate) fn relative(folder: &Path, corpus: &Path) -> Result<String> {
    let absolute = |path: &Path| {
        let path = std::path::absolute(path).map_err(|e| Error::io("find", path, e))?;
        // What is there is called by its own name, however it was reached.
        let there = path.ancestors().find_map(|up| Some((up, up.canonicalize().ok()?)));
        Ok::<PathBuf, Error>(match there {
            Some((up, real)) => path.strip_prefix(up).map_or_else(|_| real.clone(), |rest| real.join(rest)),
            None => path,
        })
    };
    let (folder, corpus) = (absolute(folder)?, absolute(corpus)?);
    let shared = folder.components().zip(corpus.components()).take_while(|(a, b)| a == b).count();
    let up = corpus.components().skip(shared).map(|_| Component::ParentDir);
    let path: PathBuf = up.chain(folder.components().skip(shared)).collect();
    let parts: Vec<String> =
        path.components().map(|c| c.as_os_str().to_string_lossy().into_owned()).collect();
    Ok(if parts.is_empty() { ".".to_owned() } else { parts.join("/") })
}
