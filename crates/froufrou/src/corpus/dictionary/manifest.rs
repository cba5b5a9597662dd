//! `corpus.toml`: what a corpus is made of, for people to read.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::{Action, Settings};
use crate::corpus::grains::Contact;
use crate::error::{Error, Place, Result};

/// The name of the file.
pub const FILE_NAME: &str = "corpus.toml";

/// What to do where the files of a corpus do not belong together.
pub(super) const AGAIN: &str = "build the corpus again with `froufrou grains build`, without its corpus.toml if \
                                that is damaged";

/// The only version so far.
const VERSION: u32 = 1;

/// The most bytes of the file.
const MOST_BYTES: u64 = 64 << 20;

/// What the first lines of the file say.
const HEADING: &str = "\
# A corpus of grains, as `froufrou grains build` wrote it. docs/grains.md tells what stands here.
# A label that was set right by hand stays when labelled_by is \"hand\".

";

/// How the sound of a corpus is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Storage {
    /// As FLAC of 16 bits: nothing but what is too quiet is lost.
    Flac,
    /// As Vorbis.
    Vorbis,
    /// Not at all: the recordings are read where they lie.
    None,
}

/// Who said what a recording is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LabelledBy {
    /// The name of a folder it lies in.
    Folder,
    /// `labels.toml` beside the recordings.
    Manifest,
    /// A word of its own name.
    Name,
    /// Its sound.
    Guess,
    /// Somebody who edited `corpus.toml`.
    Hand,
}

/// What a corpus weighs, and what is lost.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Weight {
    /// The recordings as 16-bit samples, with all their channels, at their own rates.
    pub originals_bytes: u64,
    /// The same in one channel at the rate of the corpus.
    pub mono_bytes: u64,
    /// Stored sound.
    pub audio_bytes: u64,
    /// Grains and patterns.
    pub patterns_bytes: u64,
    /// Grains.
    pub grains: usize,
    /// Grains whose sound is another's.
    pub shared_grains: usize,
    /// What is lost, against what is heard, in decibels; none where nothing is lost.
    pub error_db: Option<f64>,
}

fn never(times: &u32) -> bool {
    *times == 0
}

/// One recording of a corpus.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Listed {
    /// Its path from the folder of recordings.
    pub name: String,
    /// How the bodies touch.
    pub contact: Contact,
    /// What they do.
    pub action: Action,
    /// Who said so.
    pub labelled_by: LabelledBy,
    /// What its file's content hashes to.
    pub hash: String,
    /// What its stored sound hashes to, which is the name of its file.
    pub audio: String,
    /// How often its stored sound was halved, as it reached beyond full scale.
    #[serde(default, skip_serializing_if = "never")]
    pub halvings: u32,
}

/// All of `corpus.toml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Of the format.
    pub version: u32,
    /// Where the recordings lie, from the corpus.
    pub recordings: String,
    /// Samples a second.
    pub rate_hz: u32,
    /// How sound is kept.
    pub storage: Storage,
    /// Of Vorbis, −0.2 to 1.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub quality: Option<f64>,
    /// What the file of grains and patterns hashes to, which is its name.
    pub patterns: String,
    /// How recordings become grains.
    pub settings: Settings,
    /// What it weighs.
    pub weight: Weight,
    /// The recordings, in order.
    #[serde(default)]
    pub recording: Vec<Listed>,
    /// How the same recordings become units, which `corpus::units` reads.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub units: Option<toml::Value>,
}

impl Manifest {
    /// The version that is written.
    pub(super) const VERSION: u32 = VERSION;

    /// Reads the file of a corpus.
    ///
    /// # Errors
    /// Where there is no corpus, or the file is not such a file.
    pub fn open(corpus: &Path) -> Result<Self> {
        let path = corpus.join(FILE_NAME);
        let advise = |e: Error| e.help("a corpus is made by `froufrou grains build RECORDINGS -o CORPUS`");
        let metadata = std::fs::metadata(&path).map_err(|e| advise(Error::io("open", &path, e)))?;
        if metadata.len() > MOST_BYTES {
            return Err(Error::new(format!("the file has more than {MOST_BYTES} bytes"))
                .in_file(path)
                .help(AGAIN));
        }
        let bytes = std::fs::read(&path).map_err(|e| Error::io("read", &path, e))?;
        let text = String::from_utf8(bytes).map_err(|e| {
            let at = Place::Byte(e.utf8_error().valid_up_to() as u64);
            Error::new("expected text in UTF-8").in_file(&path).at(at).help(AGAIN)
        })?;
        Self::parse(&text, &path)
    }

    /// Reads the text of such a file.
    ///
    /// # Errors
    /// Those of [`Manifest::open`].
    pub fn parse(text: &str, path: &Path) -> Result<Self> {
        let manifest: Self = toml::from_str(text).map_err(|fault| {
            let place = fault.span().map(|span| line(text, span.start));
            let error = Error::new(fault.message().to_owned()).in_file(path).help(AGAIN);
            match place {
                Some(place) => error.at(place),
                None => error,
            }
        })?;
        manifest.check().map_err(|e| e.in_file(path).help(AGAIN))?;
        Ok(manifest)
    }

    fn check(&self) -> Result<()> {
        let at = |key: &str| Place::Part(key.to_owned());
        if self.version != VERSION {
            return Err(
                Error::new(format!("version is {}, expected {VERSION}", self.version)).at(at("version"))
            );
        }
        if !super::super::spectral::RATES_HZ.contains(&self.rate_hz) {
            return Err(Error::new(format!("the rate is {} Hz, expected 1000 to 768000 Hz", self.rate_hz))
                .at(at("rate_hz")));
        }
        self.settings.check().map_err(|e| e.at(at("settings")))?;
        // A name leads to a file below the folder of recordings.
        let is_inside = |name: &str| {
            Path::new(name).components().all(|part| matches!(part, std::path::Component::Normal(_)))
        };
        if let Some(listed) = self.recording.iter().find(|listed| !is_inside(&listed.name)) {
            return Err(Error::new(format!("{:?} is not the name of a recording", listed.name)));
        }
        let hashes = self.recording.iter().flat_map(|r| [&r.hash, &r.audio]).chain([&self.patterns]);
        for hash in hashes {
            if hash.len() != 32 || !hash.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f')) {
                return Err(Error::new(format!("expected 32 hexadecimal digits, found {hash:?}")));
            }
        }
        Ok(())
    }

    /// The text of the file.
    ///
    /// # Errors
    /// Where a value cannot be written as TOML.
    pub fn text(&self) -> Result<String> {
        let text = toml::to_string(self);
        let text = text.map_err(|e| Error::new(format!("cannot write TOML: {e}")).because(e))?;
        Ok(format!("{HEADING}{text}"))
    }

    /// Where the file of a recording lies.
    pub(super) fn source(&self, corpus: &Path, listed: &Listed) -> PathBuf {
        corpus.join(&self.recordings).join(&listed.name)
    }
}

/// Where in a text a byte is.
pub(crate) fn line(text: &str, offset: usize) -> Place {
    let before = text.get(..offset.min(text.len())).unwrap_or(text);
    let start = before.rfind('\n').map_or(0, |i| i + 1);
    Place::Line {
        line: before.bytes().filter(|b| *b == b'\n').count() + 1,
        column: before[start..].chars().count() + 1,
    }
}
