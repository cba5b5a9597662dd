//! `froufrou warp`: what carries the features of a target to where recordings have theirs.

mod plot;

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use froufrou::corpus::recording::Recording;
use froufrou::corpus::units::correspondences::{self, Correspondence};
use froufrou::corpus::units::folder::{Corpus, Target};
use froufrou::corpus::units::suggestion::{Suggestion, suggest};
use froufrou::corpus::units::warp::{Clip, WarpFile};
use froufrou::{Error, Result};
use serde::Serialize;

use crate::features::open;
use crate::grains::tell;
use crate::info::sheet::Sheet;

/// Fit, suggest and draw what carries a target's features to those of recordings
#[derive(Args)]
#[command(after_help = "\
Examples:
  froufrou warp suggest target.wav cotton -o pairs.csv          a beginning, to be edited
  froufrou warp fit target.wav cotton --pairs pairs.csv -o warp.toml
  froufrou warp suggest target.wav cotton --auto -o warp.toml   without naming anything
  froufrou warp plot warp.toml cotton -o warp.png")]
pub struct Warp {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Fit(Fit),
    Suggest(Suggest),
    Plot(plot::PlotWarp),
}

impl Warp {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        match self.command {
            Command::Fit(command) => command.run(),
            Command::Suggest(command) => command.run(),
            Command::Plot(command) => command.run(),
        }
    }
}

/// Fit a warp to correspondences
#[derive(Args)]
#[command(after_help = "\
pairs.csv has the columns target_s, recording, source_s, duration_s, and may have target_channel and source_channel.

Example:
  froufrou warp fit target.wav cotton --pairs pairs.csv -o warp.toml")]
struct Fit {
    /// The sound that is to be made again
    target: PathBuf,

    /// The corpus of units
    corpus: PathBuf,

    /// Which clips of the target should sound like which of the recordings
    #[arg(long, value_name = "CSV")]
    pairs: PathBuf,

    /// How stiff the warp is; 0 goes through all correspondences [default: that of the corpus]
    #[arg(long, value_name = "NUMBER")]
    lambda: Option<f64>,

    /// The warp to write
    #[arg(short, long, value_name = "TOML")]
    output: PathBuf,

    /// Write one JSON object, for programs to read
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Told {
    output: String,
    clips: usize,
    units: usize,
    lambda: f64,
    /// The mean distance of paired units before and after.
    distance_before: f64,
    distance_after: f64,
}

impl Fit {
    fn run(self) -> Result<()> {
        let (corpus, target) = both(&self.corpus, &self.target)?;
        let file = fitted(&corpus, &target, &self.pairs, self.lambda)?;
        save(&file, &self.output, self.json)
    }
}

/// Suggest correspondences from how features are distributed, or a warp without any
#[derive(Args)]
#[command(after_help = "\
Clusters of the target's features are matched with those of the recordings by optimal transport. With --auto a warp is
fitted to the clusters themselves; else each becomes a pair of clips, as a table to be heard and edited.

Examples:
  froufrou warp suggest target.wav cotton -o pairs.csv
  froufrou warp suggest target.wav cotton --auto -o warp.toml")]
struct Suggest {
    /// The sound that is to be made again
    target: PathBuf,

    /// The corpus of units
    corpus: PathBuf,

    /// How many correspondences [default: 8; with --auto 24]
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(1..=256))]
    count: Option<u32>,

    /// Length of a clip in seconds
    #[arg(long, value_name = "SECONDS", default_value = "0.15")]
    clip: f64,

    /// Write a warp that is fitted to the clusters
    #[arg(long)]
    auto: bool,

    /// How stiff the warp is, with --auto
    #[arg(long, value_name = "NUMBER", default_value = "1", requires = "auto")]
    lambda: f64,

    /// The correspondences to write, or with --auto the warp
    #[arg(short, long, value_name = "CSV|TOML")]
    output: PathBuf,

    /// Write one JSON object, for programs to read
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Suggested {
    output: String,
    pairs: Vec<Pair>,
}

#[derive(Serialize)]
struct Pair {
    target_s: f64,
    target_channel: usize,
    recording: String,
    source_s: f64,
    source_channel: usize,
    /// How much of the target is like this.
    share: f64,
}

impl Suggest {
    fn run(self) -> Result<()> {
        if !(self.clip > 0.0 && self.clip <= 60.0) {
            return Err(Error::new(format!(
                "--clip is {}, expected more than 0 and at most 60 seconds",
                self.clip
            )));
        }
        let (corpus, target) = both(&self.corpus, &self.target)?;
        let count = self.count.unwrap_or(if self.auto { 24 } else { 8 }) as usize;
        let units = ((self.clip / corpus.unit_s()).round() as usize).max(1);
        let found = suggest(&target.lanes, corpus.features(), &corpus.stream_units(), count, units)?;
        let pair = |suggestion: &Suggestion| {
            let (recording, source_channel, source_s) = corpus.at(suggestion.source);
            Correspondence {
                target_s: round(suggestion.target.1 as f64 * corpus.unit_s()),
                target_channel: suggestion.target.0,
                recording: recording.to_owned(),
                source_channel,
                source_s: round(source_s),
                duration_s: round(units as f64 * corpus.unit_s()),
                line: 0,
            }
        };
        let pairs: Vec<Correspondence> = found.iter().map(pair).collect();
        if self.auto {
            let clip = |(suggestion, pair): (&Suggestion, &Correspondence)| Clip {
                target_s: pair.target_s,
                recording: pair.recording.clone(),
                source_s: pair.source_s,
                duration_s: pair.duration_s,
                from: vec![suggestion.from.clone()],
                to: vec![suggestion.to.clone()],
            };
            let clips = found.iter().zip(&pairs).map(clip).collect();
            let file = WarpFile::fit(corpus.basis(), corpus.features().dimensions(), clips, self.lambda)?;
            return save(&file, &self.output, self.json);
        }
        crate::files::write(&self.output, correspondences::text(&pairs)?.as_bytes())?;
        let told: Vec<Pair> = pairs
            .iter()
            .zip(&found)
            .map(|(pair, suggestion)| Pair {
                target_s: pair.target_s,
                target_channel: pair.target_channel + 1,
                recording: pair.recording.clone(),
                source_s: pair.source_s,
                source_channel: pair.source_channel + 1,
                share: suggestion.share,
            })
            .collect();
        let mut sheet = Sheet::default();
        sheet.fact("written", self.output.to_string_lossy()).table(
            &["target", "recording", "at", "share"],
            told.iter().map(|pair| {
                let (target_s, source_s) =
                    (format!("{:.3} s", pair.target_s), format!("{:.3} s", pair.source_s));
                vec![target_s, pair.recording.clone(), source_s, format!("{:.0} %", 100.0 * pair.share)]
            }),
        );
        tell(
            &Suggested { output: self.output.to_string_lossy().into_owned(), pairs: told },
            &sheet,
            self.json,
        )
    }
}

/// To the microsecond.
fn round(seconds: f64) -> f64 {
    (seconds * 1e6).round() / 1e6
}

fn both(corpus: &Path, target: &Path) -> Result<(Corpus, Target)> {
    let (corpus, _) = open(corpus)?;
    let features = corpus.target(Recording::open(target)?).map_err(|e| e.in_file(target))?;
    Ok((corpus, features))
}

/// A warp fitted to a file of correspondences.
pub fn fitted(corpus: &Corpus, target: &Target, pairs: &Path, lambda: Option<f64>) -> Result<WarpFile> {
    let named = correspondences::read(pairs)?;
    if named.is_empty() {
        return Err(Error::new("the file names no correspondences").in_file(pairs));
    }
    let clips = corpus.clips(target, &named).map_err(|e| e.in_file(pairs))?;
    let lambda = lambda.unwrap_or(corpus.settings().lambda);
    WarpFile::fit(corpus.basis(), corpus.features().dimensions(), clips, lambda).map_err(|e| e.in_file(pairs))
}

/// Writes a warp and tells of it.
fn save(file: &WarpFile, output: &Path, json: bool) -> Result<()> {
    crate::files::write(output, file.text()?.as_bytes())?;
    let rows = || file.clips.iter().flat_map(|clip| clip.from.iter().zip(&clip.to));
    let distance = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    let units = rows().count();
    let mean = |of: &dyn Fn(&[f64], &[f64]) -> f64| {
        rows().map(|(from, to)| of(from, to)).sum::<f64>() / units.max(1) as f64
    };
    let told = Told {
        output: output.to_string_lossy().into_owned(),
        clips: file.clips.len(),
        units,
        lambda: file.lambda,
        distance_before: mean(&distance),
        distance_after: mean(&|from, to| {
            let mut warped = vec![0.0; from.len()];
            file.warp.apply(from, &mut warped);
            distance(&warped, to)
        }),
    };
    let mut sheet = Sheet::default();
    sheet
        .fact("written", &told.output)
        .fact("correspondences", format!("{} clips, {} units", told.clips, told.units))
        .fact("lambda", told.lambda)
        .fact(
            "mean distance",
            format!("{:.3} before, {:.3} after", told.distance_before, told.distance_after),
        );
    if output == Path::new("-") {
        return Ok(());
    }
    tell(&told, &sheet, json)
}
