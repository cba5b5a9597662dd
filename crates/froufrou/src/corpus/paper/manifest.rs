//! `[paper]` of a `corpus.toml`: which parts of recordings are clips of crumpling, which are friction, and of what size.
//!
//! Other sections of the file, such as `[friction]` of cloth, are left to others.

use std::path::Path;

use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::synthetic::{PREFIX, Paper};
use crate::corpus::dictionary::manifest::{FILE_NAME, line};
use crate::corpus::files::{check_inside, has_section, manifest_text};
use crate::error::{Error, Place, Result};

/// The only version so far.
const VERSION: u32 = 1;

/// The most clips, and the most takes of friction.
const MOST_ENTRIES: usize = 20_000;

/// The longest ruling or border, in metres.
const LONGEST_M: f64 = 100.0;

/// The highest corner of the high-pass: well below half of any rate.
const HIGHEST_PASS_HZ: f64 = 400.0;

/// What to do where the file is not as it should be.
const HELP: &str = "docs/paper-sounds.md tells what stands in the corpus.toml of a paper";

/// All of the file that is read here.
#[derive(Debug, Clone, PartialEq, Deserialize)]
struct Whole {
    version: u32,
    name: Option<String>,
    paper: Option<Section>,
}

/// What is read of the file of a paper.
#[derive(Debug, Clone, PartialEq)]
pub struct Manifest {
    /// What the paper is called; where nothing, as its folder.
    pub name: Option<String>,
    /// `[paper]`.
    pub paper: Section,
}

/// `[paper]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Section {
    /// Below this there is the rumble of the room, which is taken out; 0 leaves it in.
    pub high_pass_hz: f64,
    /// The model that its tears are like: `printer`.
    pub tears_like: String,
    /// Clips of crumpling.
    pub clip: Vec<Spanned<Entry>>,
    /// Takes of friction.
    pub friction: Vec<Spanned<Entry>>,
}

impl Default for Section {
    fn default() -> Self {
        let tears_like = Paper::printer().name().trim_start_matches(PREFIX).to_owned();
        Self { high_pass_hz: 60.0, tears_like, clip: Vec::new(), friction: Vec::new() }
    }
}

/// `[[paper.clip]]` or `[[paper.friction]]`: a part of a recording, and the size of the resonator that it is of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// The file, from the folder.
    pub recording: String,
    /// The channel that is heard, from 0; left out, all are averaged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub channel: Option<usize>,
    /// Where it begins; left out, with the recording.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from_s: Option<f64>,
    /// Where it ends; left out, with the recording.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_s: Option<f64>,
    /// l_r.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ruling_m: Option<f64>,
    /// l_c.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub border_m: Option<f64>,
    /// It had no free border: l_r and l_c are 0.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub constrained: bool,
    /// How fast the paper slid, of friction alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed_mps: Option<f64>,
}

impl Entry {
    /// (l_r, l_c), in metres; zeros where it was constrained.
    pub fn size_m(&self) -> (f64, f64) {
        (self.ruling_m.unwrap_or(0.0), self.border_m.unwrap_or(0.0))
    }

    fn check(&self, is_friction: bool) -> Result<()> {
        check_inside(&self.recording)?;
        let (ruling_m, border_m) = self.size_m();
        for (name, length_m) in [("ruling_m", ruling_m), ("border_m", border_m)] {
            if !(0.0..=LONGEST_M).contains(&length_m) {
                return Err(Error::new(format!("{name} is {length_m} m, expected 0 to {LONGEST_M}")));
            }
        }
        let is_nothing = ruling_m == 0.0 && border_m == 0.0;
        let is_said = self.ruling_m.is_some() && self.border_m.is_some();
        if self.constrained && !is_nothing {
            return Err(Error::new("it is constrained, and has a size as well").help(
                "what is constrained has no free border, so that it has no ruling_m and border_m, or zeros",
            ));
        }
        if !self.constrained && (!is_said || (!is_nothing && (ruling_m == 0.0 || border_m == 0.0))) {
            return Err(Error::new(
                "expected ruling_m and border_m, both above 0 or both 0, or constrained = true",
            ));
        }
        let from_s = self.from_s.unwrap_or(0.0);
        let to_s = self.to_s.unwrap_or(f64::INFINITY);
        if !(from_s >= 0.0 && from_s.is_finite() && to_s > from_s) {
            return Err(Error::new(format!("it goes from {from_s} s to {to_s} s")));
        }
        match self.speed_mps {
            Some(_) if !is_friction => Err(Error::new("speed_mps is of friction, and this is a clip")),
            None if is_friction => Err(Error::new("speed_mps is missing: how fast the paper slid")),
            Some(speed) if !(1e-4..=1e3).contains(&speed) => {
                Err(Error::new(format!("the speed is {speed} m/s, expected 0.0001 to 1000")))
            }
            _ => Ok(()),
        }
    }
}

impl Manifest {
    /// Whether the `corpus.toml` of a folder has a section `[paper]`.
    pub fn is_paper(corpus: &Path) -> bool {
        has_section(corpus, &["paper"])
    }

    /// Reads the file of a corpus.
    ///
    /// # Errors
    /// Where there is no corpus, or the file is not such a file.
    pub fn open(corpus: &Path) -> Result<Self> {
        let text = manifest_text(corpus, HELP)?;
        Self::parse(&text, &corpus.join(FILE_NAME))
    }

    /// Reads the text of such a file.
    ///
    /// # Errors
    /// Those of [`Manifest::open`].
    pub fn parse(text: &str, path: &Path) -> Result<Self> {
        let whole: Whole = toml::from_str(text).map_err(|fault| {
            let error = Error::new(fault.message().to_owned()).in_file(path).help(HELP);
            match fault.span().map(|span| line(text, span.start)) {
                Some(place) => error.at(place),
                None => error,
            }
        })?;
        let fault = |key: &str, what: String| Error::new(what).in_file(path).at(Place::Part(key.to_owned()));
        if whole.version != VERSION {
            let what = format!("version is {}, expected {VERSION}", whole.version);
            return Err(fault("version", what).help(HELP));
        }
        let paper = whole.paper.ok_or_else(|| fault("paper", "there is no [paper]".to_owned()).help(HELP))?;
        if !(0.0..=HIGHEST_PASS_HZ).contains(&paper.high_pass_hz) {
            let what =
                format!("the high-pass is at {} Hz, expected 0 to {HIGHEST_PASS_HZ}", paper.high_pass_hz);
            return Err(fault("paper.high_pass_hz", what));
        }
        paper.tears().map_err(|e| e.in_file(path).at(Place::Part("paper.tears_like".to_owned())))?;
        let [clips, takes] = [paper.clip.len(), paper.friction.len()];
        if clips + takes == 0 || clips > MOST_ENTRIES || takes > MOST_ENTRIES {
            let what = format!(
                "found {clips} of [[paper.clip]] and {takes} of [[paper.friction]], expected 1 to {MOST_ENTRIES}"
            );
            return Err(fault("paper", what).help(HELP));
        }
        for (entries, is_friction) in [(&paper.clip, false), (&paper.friction, true)] {
            for entry in entries {
                let place = line(text, entry.span().start);
                entry.get_ref().check(is_friction).map_err(|e| e.in_file(path).at(place))?;
            }
        }
        Ok(Self { name: whole.name, paper })
    }

    /// The recordings, each once.
    pub fn files(&self) -> Vec<&str> {
        let all = self.paper.clip.iter().chain(&self.paper.friction);
        let mut files: Vec<&str> = all.map(|entry| entry.get_ref().recording.as_str()).collect();
        files.sort_unstable();
        files.dedup();
        files
    }
}

impl Section {
    /// The model that its tears are like.
    ///
    /// # Errors
    /// One that there is not.
    pub fn tears(&self) -> Result<Paper> {
        let name = format!("{PREFIX}{}", self.tears_like.trim_start_matches(PREFIX));
        Paper::named(&name).unwrap_or_else(|| Ok(Paper::printer()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHOLE: &str = r#"version = 1
name = "kraft"

[paper]
high_pass_hz = 80
tears_like = "tracing"

[[paper.clip]]
recording = "flaps.wav"
ruling_m = 0.1
border_m = 0.2
from_s = 1.0
to_s = 1.5

[[paper.clip]]
recording = "clacs.wav"
constrained = true

[[paper.friction]]
recording = "table.wav"
channel = 0
speed_mps = 0.2
ruling_m = 0
border_m = 0

[friction]
left = "to others"
"#;

    fn parse(text: &str) -> Result<Manifest> {
        Manifest::parse(text, Path::new("corpus.toml"))
    }

    #[test]
    fn a_manifest_is_read_and_others_sections_are_left_alone() {
        let manifest = parse(WHOLE).unwrap();
        assert_eq!(manifest.name.as_deref(), Some("kraft"));
        let paper = &manifest.paper;
        assert_eq!((paper.high_pass_hz, paper.clip.len(), paper.friction.len()), (80.0, 2, 1));
        assert_eq!(paper.tears().unwrap().name(), "synthetic/tracing");
        assert_eq!(paper.clip[0].get_ref().size_m(), (0.1, 0.2));
        assert_eq!(paper.clip[1].get_ref().size_m(), (0.0, 0.0));
        assert_eq!(manifest.files(), ["clacs.wav", "flaps.wav", "table.wav"]);
        let defaults = parse("version = 1\n[paper]\n[[paper.clip]]\nrecording = \"a\"\nconstrained = true\n");
        assert_eq!(defaults.unwrap().paper.tears().unwrap().name(), "synthetic/printer");
    }

    #[test]
    fn faults_are_placed() {
        for (from, to, what) in [
            ("version = 1", "version = 2", "version is 2"),
            ("high_pass_hz = 80", "high_pass = 80", "corpus.toml:5:1: unknown field `high_pass`"),
            ("high_pass_hz = 80", "high_pass_hz = 4000", "the high-pass is at 4000"),
            ("\"tracing\"", "\"silk\"", "no synthetic paper `silk`"),
            ("ruling_m = 0.1", "", "corpus.toml:8:"),
            ("ruling_m = 0.1", "ruling_m = 0", "both above 0 or both 0"),
            ("ruling_m = 0.1", "ruling_m = nan", "ruling_m is NaN"),
            ("border_m = 0.2", "border_m = -0.2", "border_m is -0.2"),
            ("to_s = 1.5", "to_s = 0.5", "from 1 s to 0.5 s"),
            ("constrained = true", "constrained = true\nborder_m = 1", "has a size as well"),
            ("constrained = true", "", "corpus.toml:15:"),
            ("speed_mps = 0.2", "", "speed_mps is missing"),
            ("speed_mps = 0.2", "speed_mps = 0", "the speed is 0 m/s"),
            ("constrained = true", "constrained = true\nspeed_mps = 1", "this is a clip"),
            ("clacs.wav", "../clacs.wav", "within the corpus"),
            ("[[paper.clip]]", "[[paper.clips]]", "unknown field `clips`"),
        ] {
            assert!(WHOLE.contains(from), "{from}");
            let error = parse(&WHOLE.replacen(from, to, 1)).unwrap_err().to_string();
            assert!(error.contains(what), "{to}: {error}");
        }
        assert!(parse("version = 1\n").unwrap_err().to_string().contains("no [paper]"));
        assert!(parse("version = 1\n[paper]\n").unwrap_err().to_string().contains("found 0"));
    }

    #[test]
    fn damage_is_told_and_never_more() {
        for at in 0..WHOLE.len() {
            let _ = parse(&WHOLE[..at]);
            for byte in [b'0', b'9', b'-', b'"', b'[', b'\n', b'e', b'='] {
                let mut damaged = WHOLE.as_bytes().to_vec();
                damaged[at] = byte;
                if let Ok(manifest) = parse(std::str::from_utf8(&damaged).unwrap()) {
                    let entries = manifest.paper.clip.iter().map(|e| (e, false));
                    let entries = entries.chain(manifest.paper.friction.iter().map(|e| (e, true)));
                    entries.for_each(|(entry, is_friction)| entry.get_ref().check(is_friction).unwrap());
                }
            }
        }
    }
}
