//! `froufrou info`: what is in any file that froufrou reads.

mod alembic;
mod animation;
mod cloth;
mod contact_log;
pub mod corpus;
mod events;
mod gltf;
mod head;
mod paper;
mod recording;
mod scene;
mod score;
pub mod sheet;
mod units;
#[cfg(feature = "usd")]
mod usd;

use std::io::{ErrorKind, Write};
use std::path::PathBuf;

use froufrou::corpus::cloth::manifest::Manifest;
use froufrou::corpus::units::folder as units_folder;
use froufrou::{Error, Result};
use serde::Serialize;

use self::sheet::Sheet;
use crate::file_kind::FileKind;

/// What is read.
const READABLE: &str = "scenes (.toml), animations (.abc, .usd, .usda, .usdc, .usdz, .gltf, .glb, .pc2, .mdd, \
                        .obj), audio (WAV, RF64, AIFF, FLAC, Ogg Vorbis, MP3), heads (.sofa), corpora of grains, of cloth, of paper and of units (folders), scores, events (.jsonl), contact logs and pose logs (.csv, .csv.gz)";

/// Tells what is in a file: a scene, an animation, audio, a head, a corpus, a score, events or a contact log.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  froufrou info shot.abc             its objects, frame rate and length
  froufrou info 'sim/cloth_*.obj'    the same of a sequence of files
  froufrou info out.wav --json       level and loudness, for a machine")]
pub struct Info {
    /// The file; what it is is told by its content.
    file: PathBuf,
    /// Writes one JSON object, for programs to read.
    #[arg(long)]
    json: bool,
    /// Lets a scene use files outside of its folder.
    #[arg(long)]
    allow_outside: bool,
}

/// What was found in a file: as it is serialised, for programs; as a sheet, for people.
trait Findings: Serialize {
    /// The word for this kind of file in the JSON.
    const KIND: &'static str;

    /// What people are told.
    fn sheet(&self) -> Sheet;
}

#[derive(Serialize)]
struct Labelled<'a, F> {
    file: String,
    kind: &'static str,
    #[serde(flatten)]
    findings: &'a F,
}

/// The first and the last of some values.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Range {
    from: f64,
    to: f64,
}

impl Range {
    /// Makes a range wide enough for a value.
    fn widen(range: &mut Option<Range>, value: f64) {
        let Range { from, to } = range.unwrap_or(Range { from: value, to: value });
        *range = Some(Range { from: from.min(value), to: to.max(value) });
    }
}

impl Info {
    /// Reads the file and writes to the standard output what is in it.
    ///
    /// # Errors
    /// A file that cannot be read or has a fault.
    pub fn run(self) -> Result<()> {
        let file = self.file.as_path();
        if let Some(folder) = corpus::folder(file) {
            if crate::corpus::paper::is_paper(&folder) {
                return self.tell(&paper::read(&folder)?);
            }
            if Manifest::is_cloth(&folder) {
                return self.tell(&cloth::read(&folder)?);
            }
            if units_folder::is_of_units_alone(&folder) {
                return self.tell(&units_folder::survey(&folder)?);
            }
            return self.tell(&corpus::read(&folder)?);
        }
        match FileKind::of(file, READABLE)? {
            FileKind::Scene => self.tell(&scene::read(file, self.allow_outside)?),
            FileKind::Animation(format) => self.tell(&animation::read(file, format)?),
            FileKind::Recording(format) => self.tell(&recording::read(file, format)?),
            FileKind::Head => self.tell(&head::read(file)?),
            FileKind::Score => self.tell(&score::read(file)?),
            FileKind::Events => self.tell(&events::read(file)?),
            FileKind::ContactLog => self.tell(&contact_log::read(file)?),
        }
    }

    fn tell<F: Findings>(&self, findings: &F) -> Result<()> {
        let text = if self.json {
            let file = self.file.to_string_lossy().into_owned();
            let labelled = Labelled { file, kind: F::KIND, findings };
            let json = serde_json::to_string_pretty(&labelled);
            json.map_err(|fault| Error::new(format!("cannot write JSON: {fault}")).because(fault))? + "\n"
        } else {
            findings.sheet().to_string()
        };
        match std::io::stdout().lock().write_all(text.as_bytes()) {
            // Who reads may stop when enough is read.
            Err(fault) if fault.kind() != ErrorKind::BrokenPipe => {
                Err(Error::new(format!("cannot write to the standard output: {fault}")).because(fault))
            }
            _ => Ok(()),
        }
    }
}
