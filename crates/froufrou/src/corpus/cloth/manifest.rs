//! `corpus.toml` of a cloth: which recordings of its folder are friction and at what speeds, and which hold pops.
//!
//! Each section stands by itself; what others read, such as `[units]`, is left to them.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::clips::Gathering;
use super::motion::Seams;
use super::preset;
use crate::corpus::dictionary::manifest::{FILE_NAME, line};
use crate::corpus::files::{check_inside, has_section, manifest_text};
use crate::error::{Error, Place, Result};

/// The only version so far.
const VERSION: u32 = 1;

/// The most recordings of a section.
const MOST_RECORDINGS: usize = 10_000;

/// What to do where the file is not as it should be.
const HELP: &str = "docs/cloth.md tells what stands in the corpus.toml of a cloth";

/// All of the file that is read here.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Of the format.
    pub version: u32,
    /// What the cloth is called; left out, as its folder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// How it rubs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction: Option<FrictionSection>,
    /// How it pops.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pops: Option<PopsSection>,
    /// What is read by others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub units: Option<toml::Value>,
    /// What is read by [`paper`](crate::corpus::paper).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub paper: Option<toml::Value>,
}

/// `[friction]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FrictionSection {
    /// How much cloth rubbed while it was recorded.
    pub area_m2: f64,
    /// Bins of speed for takes whose speed changes.
    pub bins: usize,
    /// A bin of fewer clips is left out.
    pub least_clips: usize,
    /// Slower clips of takes whose speed changes are left out.
    pub slowest_mps: f64,
    /// The takes.
    pub take: Vec<TakeEntry>,
}

impl Default for FrictionSection {
    fn default() -> Self {
        let Gathering { bins, least_clips, slowest_mps } = Gathering::default();
        Self { area_m2: 0.01, bins, least_clips, slowest_mps, take: Vec::new() }
    }
}

impl FrictionSection {
    /// How its takes become spectra.
    pub fn gathering(&self) -> Gathering {
        Gathering { bins: self.bins, least_clips: self.least_clips, slowest_mps: self.slowest_mps }
    }
}

/// `[[friction.take]]`: a recording, and how fast the cloth moved: one of `speed_mps`, `speeds` and `encoder`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TakeEntry {
    /// The file, from the folder.
    pub recording: String,
    /// The channel that is heard, from 0; left out, all are averaged but the encoder's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub channel: Option<usize>,
    /// The speed of the whole take; 0 for the noise of the room.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed_mps: Option<f64>,
    /// A CSV file of times and speeds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speeds: Option<String>,
    /// Pulses on another channel.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub encoder: Option<Encoder>,
    /// When seams pass, in seconds.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub seams_s: Vec<[f64; 2]>,
    /// Where seams are, in metres of the way.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub seams_m: Vec<[f64; 2]>,
    /// After how many metres the same places come again; 0 for never.
    #[serde(default)]
    pub round_m: f64,
}

impl TakeEntry {
    /// What is left out of it.
    pub fn seams(&self) -> Seams {
        Seams { times_s: self.seams_s.clone(), places_m: self.seams_m.clone(), round_m: self.round_m }
    }
}

/// An encoder's pulses.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Encoder {
    /// The channel that they are on, from 0.
    pub channel: usize,
    /// How many there are a metre.
    pub pulses_per_m: f64,
}

/// `[pops]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PopsSection {
    /// The files, from the folder.
    pub recordings: Vec<String>,
    /// The channel that is heard, from 0; left out, all are averaged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub channel: Option<usize>,
    /// The energy over 20 ms above which there is a pop; left out, 10 dB above what half of a recording is quieter than.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub threshold: Option<Threshold>,
}

/// A threshold of pops.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Threshold {
    /// As a number.
    Energy(f64),
    /// That of a cloth of the paper.
    Cloth(String),
}

impl PopsSection {
    /// The threshold, where it does not follow from each recording.
    ///
    /// # Errors
    /// A cloth that is not in the paper, or a number that is not above 0.
    pub fn energy(&self) -> Result<Option<f64>> {
        let at = || Place::Part("pops.threshold".to_owned());
        match &self.threshold {
            None => Ok(None),
            Some(Threshold::Energy(energy)) if *energy > 0.0 && energy.is_finite() => Ok(Some(*energy)),
            Some(Threshold::Energy(energy)) => {
                Err(Error::new(format!("the threshold is {energy}, expected a number above 0")).at(at()))
            }
            Some(Threshold::Cloth(cloth)) => preset::pop_threshold(cloth).map(Some).ok_or_else(|| {
                let known: Vec<&str> = preset::POPS.iter().map(|preset| preset.cloth).collect();
                Error::new(format!("there is no threshold for `{cloth}`"))
                    .at(at())
                    .help(format!("there are those of {}; or a number", known.join(", ")))
            }),
        }
    }
}

impl Manifest {
    /// Whether the `corpus.toml` of a folder is that of a cloth: it has sections of friction or pops.
    pub fn is_cloth(corpus: &Path) -> bool {
        has_section(corpus, &["friction", "pops"])
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
        let manifest: Self = toml::from_str(text).map_err(|fault| {
            let error = Error::new(fault.message().to_owned()).in_file(path).help(HELP);
            match fault.span().map(|span| line(text, span.start)) {
                Some(place) => error.at(place),
                None => error,
            }
        })?;
        manifest.check().map_err(|e| e.in_file(path))?;
        Ok(manifest)
    }

    fn check(&self) -> Result<()> {
        let fault = |key: String, what: String| Err(Error::new(what).at(Place::Part(key)).help(HELP));
        if self.version != VERSION {
            return fault("version".to_owned(), format!("version is {}, expected {VERSION}", self.version));
        }
        if let Some(friction) = &self.friction {
            friction.gathering().check()?;
            if !(1e-9..=1e6).contains(&friction.area_m2) {
                let what = format!("the area is {} m², expected more than 0", friction.area_m2);
                return fault("friction.area_m2".to_owned(), what);
            }
            if friction.take.is_empty() || friction.take.len() > MOST_RECORDINGS {
                let what = format!("expected 1 to {MOST_RECORDINGS} takes, found {}", friction.take.len());
                return fault("friction.take".to_owned(), what);
            }
            for (number, take) in friction.take.iter().enumerate() {
                let key = format!("friction.take {} ({})", number + 1, take.recording);
                let said = usize::from(take.speed_mps.is_some())
                    + usize::from(take.speeds.is_some())
                    + usize::from(take.encoder.is_some());
                if said != 1 {
                    let what = format!("expected one of speed_mps, speeds and encoder, found {said} of them");
                    return fault(key, what);
                }
                if let Some(speed) = take.speed_mps.filter(|speed| !(0.0..=1e3).contains(speed)) {
                    return fault(key, format!("the speed is {speed} m/s, expected 0 to 1000"));
                }
                take.seams().check().map_err(|e| e.at(Place::Part(key)))?;
            }
        }
        if let Some(pops) = &self.pops {
            pops.energy()?;
            if pops.recordings.is_empty() || pops.recordings.len() > MOST_RECORDINGS {
                let what =
                    format!("expected 1 to {MOST_RECORDINGS} recordings, found {}", pops.recordings.len());
                return fault("pops.recordings".to_owned(), what);
            }
        }
        for file in self.files() {
            check_inside(file)?;
        }
        Ok(())
    }

    /// The files that friction and pops are measured in, each once.
    pub fn files(&self) -> Vec<&str> {
        let mut files: Vec<&str> = Vec::new();
        for take in self.friction.iter().flat_map(|friction| &friction.take) {
            files.push(&take.recording);
            files.extend(take.speeds.as_deref());
        }
        files.extend(self.pops.iter().flat_map(|pops| &pops.recordings).map(String::as_str));
        files.sort_unstable();
        files.dedup();
        files
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHOLE: &str = r#"
version = 1
name = "windbreaker"

[friction]
bins = 6
area_m2 = 0.02

[[friction.take]]
recording = "slow.wav"
speed_mps = 0.1
seams_s = [[1.0, 1.2]]

[[friction.take]]
recording = "drum.wav"
channel = 0
encoder = { channel = 1, pulses_per_m = 500 }
seams_m = [[0.1, 0.12]]
round_m = 0.6

[[friction.take]]
recording = "ramp.wav"
speeds = "ramp.csv"

[pops]
recordings = ["crumple.wav", "slow.wav"]
threshold = "windbreaker"

[units]
anything = [1, 2, 3]
"#;

    #[test]
    fn a_manifest_is_read_and_others_sections_are_left_alone() {
        let manifest = Manifest::parse(WHOLE, Path::new("corpus.toml")).unwrap();
        let friction = manifest.friction.as_ref().unwrap();
        assert_eq!((friction.bins, friction.least_clips, friction.take.len()), (6, 4, 3));
        assert_eq!(friction.take[1].seams().round_m, 0.6);
        assert_eq!(manifest.pops.as_ref().unwrap().energy().unwrap(), Some(0.025));
        assert_eq!(manifest.files(), ["crumple.wav", "drum.wav", "ramp.csv", "ramp.wav", "slow.wav"]);
        let text = toml::to_string(&manifest).unwrap();
        assert_eq!(Manifest::parse(&text, Path::new("corpus.toml")).unwrap(), manifest);
    }

    #[test]
    fn faults_are_placed() {
        for (from, to, what) in [
            ("version = 1", "version = 2", "version is 2"),
            ("bins = 6", "bims = 6", "corpus.toml:6:1: unknown field `bims`"),
            ("bins = 6", "bins = 0", "0 bins"),
            ("area_m2 = 0.02", "area_m2 = -1", "the area is -1"),
            ("speed_mps = 0.1", "", "take 1 (slow.wav)"),
            ("speed_mps = 0.1", "speed_mps = 0.1\nspeeds = \"a.csv\"", "found 2 of them"),
            ("speed_mps = 0.1", "speed_mps = nan", "the speed is NaN"),
            ("[[1.0, 1.2]]", "[[1.0, 0.2]]", "from 1 to 0.2"),
            ("ramp.csv", "../ramp.csv", "within the corpus"),
            ("crumple.wav", "/etc/passwd", "within the corpus"),
            ("\"windbreaker\"\n\n[units]", "\"silk\"\n\n[units]", "no threshold for `silk`"),
            ("\"windbreaker\"\n\n[units]", "-1.0\n\n[units]", "the threshold is -1"),
            ("[\"crumple.wav\", \"slow.wav\"]", "[]", "expected 1 to 10000 recordings"),
            ("[units]", "[unites]", "unknown field `unites`"),
        ] {
            assert!(WHOLE.contains(from), "{from}");
            let bad = WHOLE.replacen(from, to, 1);
            let error = Manifest::parse(&bad, Path::new("corpus.toml")).unwrap_err().to_string();
            assert!(error.contains(what), "{to}: {error}");
        }
    }

    #[test]
    fn damage_is_told_and_never_more() {
        let check = |text: &str| {
            if let Ok(manifest) = Manifest::parse(text, Path::new("corpus.toml")) {
                // What is taken is as it has to be.
                assert!(manifest.check().is_ok());
                assert!(manifest.friction.iter().all(|friction| friction.bins <= 1000));
            }
        };
        for at in 0..WHOLE.len() {
            check(&WHOLE[..at]);
            for byte in [b'0', b'9', b'-', b'"', b'[', b'\n', b'e', b'='] {
                let mut damaged = WHOLE.as_bytes().to_vec();
                damaged[at] = byte;
                check(std::str::from_utf8(&damaged).unwrap());
            }
        }
        for absurd in ["bins = 18446744073709551615", "bins = -6", "bins = 1e9", "bins = 6\nleast_clips = 0"]
        {
            assert!(Manifest::parse(&WHOLE.replace("bins = 6", absurd), Path::new("corpus.toml")).is_err());
        }
    }
}
