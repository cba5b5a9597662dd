//! `froufrou grains build`.

use std::io::IsTerminal;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use froufrou::Result;
use froufrou::corpus::dictionary::Settings;
use froufrou::corpus::dictionary::builder::{self, Built, LABELS_FILE_NAME, Options, Stage};
use froufrou::corpus::dictionary::manifest::{LabelledBy, Manifest, Storage};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use crate::info::corpus;
use crate::info::sheet::Sheet;

/// Make a corpus of all recordings in a folder, or bring one up to date
#[derive(Args)]
#[command(after_help = "\
Bodies hit, break, slide or roll: folders called so say it, or lines in labels.toml beside the recordings, such as
  \"gravel/*\" = \"slide\"
or words in names; what nobody says is guessed from the sound, and told.

Example:
  froufrou grains build recordings -o stone --store vorbis")]
pub struct Build {
    /// The folder of recordings: WAV, AIFF, FLAC, Ogg Vorbis, MP3
    #[arg(value_name = "FOLDER")]
    recordings: PathBuf,

    /// The folder of the corpus; what is there already is not made again
    #[arg(short, long, value_name = "CORPUS")]
    output: PathBuf,

    /// Sampling rate in hertz [default: that of most recordings]
    #[arg(long, value_name = "HZ", value_parser = clap::value_parser!(u32).range(8_000..=192_000))]
    rate: Option<u32>,

    /// How the sound is kept: as FLAC, as Vorbis, or not at all [default: flac]
    #[arg(long, value_name = "HOW")]
    store: Option<Store>,

    /// Quality of Vorbis, -0.2 to 1 [default: 0.2]
    #[arg(long, value_name = "NUMBER", allow_negative_numbers = true)]
    quality: Option<f64>,

    /// How many grains of other recordings are kept as fitting, each hundredth of a second [default: 4]
    #[arg(long, value_name = "NUMBER")]
    candidates: Option<usize>,

    /// Correlation from which a grain shares the sound of another; 2 for never [default: 0.999]
    #[arg(long, value_name = "NUMBER")]
    share_from: Option<f64>,

    /// Write one JSON object, for programs to read
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum Store {
    Flac,
    Vorbis,
    None,
}

#[derive(Serialize)]
struct Told<'a> {
    corpus: String,
    cut: usize,
    matched: usize,
    removed: &'a [String],
    #[serde(flatten)]
    manifest: &'a Manifest,
}

impl Build {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let storage = self.store.map(|store| match store {
            Store::Flac => Storage::Flac,
            Store::Vorbis => Storage::Vorbis,
            Store::None => Storage::None,
        });
        let mut options =
            Options { rate_hz: self.rate, storage, quality: self.quality, ..Options::default() };
        if self.candidates.is_some() || self.share_from.is_some() {
            // On top of what the corpus is made with.
            let before = Manifest::open(&self.output).ok().map(|manifest| manifest.settings);
            let mut settings: Settings = before.unwrap_or_default();
            settings.candidates = self.candidates.unwrap_or(settings.candidates);
            settings.share_from = self.share_from.unwrap_or(settings.share_from);
            options.settings = Some(settings);
        }
        let bar = Bar::new();
        let built =
            builder::build(&self.recordings, &self.output, &options, &mut |progress| bar.at(progress));
        drop(bar);
        let built = built?;
        let told = Told {
            corpus: self.output.to_string_lossy().into_owned(),
            cut: built.cut,
            matched: built.matched,
            removed: &built.removed,
            manifest: &built.manifest,
        };
        super::tell(&told, &sheet(&built), self.json)
    }
}

fn sheet(built: &Built) -> Sheet {
    let mut sheet = Sheet::default();
    let Built { manifest, cut, matched, removed } = built;
    corpus::facts(manifest, &mut sheet);
    let is_new = *cut > 0 || *matched > 0 || !removed.is_empty();
    sheet.fact(
        "computed",
        match is_new {
            true => format!("{cut} recordings cut, {matched} matched with the grains of another or itself"),
            false => "nothing: all was there".to_owned(),
        },
    );
    sheet.fact_if("gone", (!removed.is_empty()).then(|| removed.join(", ")));
    let guessed: Vec<Vec<String>> = manifest
        .recording
        .iter()
        .filter(|listed| listed.labelled_by == LabelledBy::Guess)
        .map(|listed| vec![listed.name.clone(), format!("{:?}", listed.action).to_lowercase()])
        .collect();
    if !guessed.is_empty() {
        sheet.fact(
            "guessed",
            format!("what bodies do in {}; say it in {LABELS_FILE_NAME} or corpus.toml", guessed.len()),
        );
    }
    sheet.table(&["guessed recording", "action"], guessed);
    sheet
}

/// The bar on a terminal.
struct Bar(ProgressBar);

impl Bar {
    fn new() -> Self {
        let bar = match std::io::stderr().is_terminal() {
            true => ProgressBar::new(0),
            false => ProgressBar::hidden(),
        };
        if let Ok(style) =
            ProgressStyle::with_template("{prefix:10} {bar:40.cyan/black} {percent:>3} %  {msg}  {eta} left")
        {
            bar.set_style(style);
        }
        Self(bar)
    }

    fn at(&self, progress: builder::Progress) {
        let stage = match progress.stage {
            Stage::Reading => "reading",
            Stage::Cutting => "cutting",
            Stage::Matching => "matching",
            Stage::Storing => "storing",
        };
        if self.0.prefix() != stage {
            self.0.set_prefix(stage);
            self.0.reset_eta();
        }
        self.0.set_length(progress.total);
        self.0.set_position(progress.done);
        self.0.set_message(progress.name.to_owned());
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
