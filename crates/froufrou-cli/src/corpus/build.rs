//! `froufrou corpus build`.

use std::path::{Path, PathBuf};

use clap::Args;
use froufrou::Result;
use froufrou::corpus::cloth::folder::{self, Built};
use froufrou::corpus::paper::manifest::Manifest;
use froufrou::corpus::{cloth, paper};
use serde::Serialize;

use super::info::Findings;
use super::paper::PaperFindings;
use crate::grains::tell;
use crate::info::sheet::Sheet;

/// Measure the friction and find the pops or clips of a folder of recordings, as its corpus.toml says
#[derive(Args)]
#[command(after_help = "\
The corpus.toml beside the recordings says which are friction, at what speeds, and which hold pops; docs/cloth.md
tells how. Its section [paper] says which are clips and friction of paper, and of what size: see docs/paper-sounds.md. What is measured is kept in the folder `cache` of the corpus, and done again only where something changed.

Example:
  froufrou corpus build takes -o cotton")]
pub struct Build {
    /// The folder of recordings, with a corpus.toml
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,

    /// The folder of the corpus, into which recordings are copied; left out, it is FOLDER itself
    #[arg(short, long, value_name = "CORPUS")]
    output: Option<PathBuf>,

    /// Write one JSON object, for programs to read
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct ToldOfPaper {
    corpus: String,
    #[serde(flatten)]
    built: paper::folder::Built,
    #[serde(flatten)]
    findings: PaperFindings,
}

#[derive(Serialize)]
struct Told {
    corpus: String,
    #[serde(flatten)]
    built: Built,
    #[serde(flatten)]
    findings: Findings,
}

impl Build {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let corpus = self.output.clone().unwrap_or_else(|| self.folder.clone());
        if Manifest::is_paper(&self.folder) {
            self.paper(&corpus)?;
            // A corpus may be of cloth as well.
            if !cloth::manifest::Manifest::is_cloth(&self.folder) {
                return Ok(());
            }
        }
        let (sound, built) = folder::build(&self.folder, &corpus)?;
        let told =
            Told { corpus: corpus.to_string_lossy().into_owned(), findings: Findings::of(&sound), built };
        let mut sheet = Sheet::default();
        let computed = match told.built.computed.as_slice() {
            [] => "nothing new".to_owned(),
            sections => sections.join(", "),
        };
        sheet
            .fact("corpus", &told.corpus)
            .fact("copied", format!("{} files", told.built.copied.len()))
            .fact("computed", computed);
        told.findings.facts(&mut sheet);
        let heads = ["take", "clips", "left out for seams", "too slow or unknown"];
        let rows = told.built.takes.iter().map(|(name, counts)| {
            let [clips, seams, unknown] = [counts.clips, counts.seams, counts.unknown].map(|n| n.to_string());
            vec![name.clone(), clips, seams, unknown]
        });
        sheet.table(&heads, rows);
        tell(&told, &sheet, self.json)
    }

    /// Makes what is of paper.
    fn paper(&self, corpus: &Path) -> Result<()> {
        let (sound, built) = paper::folder::build(&self.folder, corpus)?;
        let told = ToldOfPaper {
            corpus: corpus.to_string_lossy().into_owned(),
            findings: PaperFindings::of(&sound),
            built,
        };
        let mut sheet = Sheet::default();
        sheet
            .fact("corpus", &told.corpus)
            .fact("copied", format!("{} files", told.built.copied.len()))
            .fact("computed", if told.built.computed { "clips and spectra" } else { "nothing new" });
        told.findings.facts(&mut sheet);
        tell(&told, &sheet, self.json)
    }
}
