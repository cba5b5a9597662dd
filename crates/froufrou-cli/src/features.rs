//! `froufrou features`: corpora of units, and what units sound like as numbers.

use std::fmt::Write;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use froufrou::corpus::recording::Recording;
use froufrou::corpus::units::folder::{self, Corpus};
use froufrou::corpus::units::{Channels, Settings};
use froufrou::{Error, Result};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use crate::grains::tell;
use crate::info::sheet::Sheet;

/// Make a corpus of units from recordings, and write features of sounds
#[derive(Args)]
#[command(after_help = "\
Examples:
  froufrou features build recordings -o cotton --preset cotton
  froufrou features write target.wav cotton -o features.csv")]
pub struct Features {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Build(Build),
    Write(WriteFeatures),
}

impl Features {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        match self.command {
            Command::Build(command) => command.run(),
            Command::Write(command) => command.run(),
        }
    }
}

/// Make a corpus of units of all recordings in a folder, or give one that is there other settings
#[derive(Args)]
#[command(after_help = "\
Presets are cotton, polyester, windbreaker, \"windbreaker first-person\" and corduroy, with the values of An, James &
Marschner (2012). All settings stand in the table [units] of corpus.toml, which may be edited.

Example:
  froufrou features build recordings -o cotton --preset cotton")]
struct Build {
    /// The folder of recordings: WAV, AIFF, FLAC, Ogg Vorbis, MP3
    #[arg(value_name = "FOLDER")]
    recordings: PathBuf,

    /// The folder of the corpus; its other tables stay
    #[arg(short, long, value_name = "CORPUS")]
    output: PathBuf,

    /// Settings for a kind of cloth [default: those that are there, or cotton's]
    #[arg(long, value_name = "NAME")]
    preset: Option<String>,

    /// Sampling rate in hertz [default: that of most recordings]
    #[arg(long, value_name = "HZ", value_parser = clap::value_parser!(u32).range(8_000..=192_000))]
    rate: Option<u32>,

    /// Length of a unit in milliseconds
    #[arg(long, value_name = "MS")]
    unit_ms: Option<f64>,

    /// Take all channels of a recording as one, as for two ears
    #[arg(long)]
    joint: bool,

    /// Write one JSON object, for programs to read
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Told {
    corpus: String,
    rate_hz: u32,
    unit_samples: usize,
    units: usize,
    /// Recordings whose features were computed, not read from the cache.
    computed: usize,
    recordings: Vec<Length>,
    settings: Settings,
}

#[derive(Serialize)]
struct Length {
    name: String,
    duration_s: f64,
}

impl Build {
    fn run(self) -> Result<()> {
        let mut settings = match &self.preset {
            Some(name) => Settings::preset(name).ok_or_else(|| {
                Error::new(format!("there is no preset `{name}`"))
                    .help(format!("there are {}", Settings::PRESETS.join(", ")))
            })?,
            None => {
                folder::settings(&self.output).ok().or_else(|| Settings::preset("cotton")).unwrap_or_default()
            }
        };
        settings.recordings = vec![folder::relative(&self.recordings, &self.output)?];
        settings.rate_hz = self.rate.or(settings.rate_hz);
        if let Some(unit_ms) = self.unit_ms {
            settings.features.unit_s = unit_ms / 1000.0;
        }
        if self.joint {
            settings.features.channels = Channels::Joint;
        }
        if !self.recordings.is_dir() {
            return Err(Error::new("expected a folder of recordings").in_file(&self.recordings));
        }
        folder::create(&self.output, &settings)?;
        let (corpus, computed) = open(&self.output)?;
        let recordings = corpus.recordings();
        let length = |(name, duration_s): (&str, f64)| Length { name: name.to_owned(), duration_s };
        let told = Told {
            corpus: self.output.to_string_lossy().into_owned(),
            rate_hz: corpus.rate_hz(),
            unit_samples: corpus.unit_samples(),
            units: corpus.features().len(),
            computed,
            recordings: recordings.map(length).collect(),
            settings,
        };
        let mut sheet = Sheet::default();
        sheet
            .fact("corpus", &told.corpus)
            .fact("rate", format!("{} Hz", told.rate_hz))
            .fact("units", format!("{} of {} samples", told.units, told.unit_samples))
            .fact("computed", format!("{computed} of {} recordings", told.recordings.len()))
            .table(
                &["recording", "length"],
                told.recordings.iter().map(|r| vec![r.name.clone(), format!("{:.2} s", r.duration_s)]),
            );
        tell(&told, &sheet, self.json)
    }
}

/// Write the smoothed features of a sound, as a corpus compares them, as CSV
#[derive(Args)]
#[command(after_help = "\
Columns are the channel from 1, the time of the unit's beginning, and its coefficients.

Example:
  froufrou features write target.wav cotton -o features.csv")]
struct WriteFeatures {
    /// The sound
    sound: PathBuf,

    /// The corpus whose settings are taken
    corpus: PathBuf,

    /// The CSV file to write; - for standard output
    #[arg(short, long, value_name = "CSV", default_value = "-")]
    output: PathBuf,
}

impl WriteFeatures {
    fn run(self) -> Result<()> {
        let (corpus, _) = open(&self.corpus)?;
        let target = corpus.target(Recording::open(&self.sound)?).map_err(|e| e.in_file(&self.sound))?;
        let mut text = "channel,time_s".to_owned();
        for k in 0..corpus.features().dimensions() {
            let _ = write!(text, ",c{k}");
        }
        text.push('\n');
        for (channel, lane) in target.lanes.iter().enumerate() {
            for (unit, row) in lane.rows().enumerate() {
                let _ = write!(text, "{},{}", channel + 1, unit as f64 * corpus.unit_s());
                row.iter().for_each(|value| {
                    let _ = write!(text, ",{value}");
                });
                text.push('\n');
            }
        }
        crate::files::write(&self.output, text.as_bytes())
    }
}

/// Opens a corpus with a bar on a terminal; how many recordings had to be computed.
pub fn open(folder: &Path) -> Result<(Corpus, usize)> {
    let bar = match std::io::stderr().is_terminal() {
        true => ProgressBar::new(0),
        false => ProgressBar::hidden(),
    };
    if let Ok(style) = ProgressStyle::with_template("{bar:40.cyan/black} {percent:>3} %  {msg}") {
        bar.set_style(style);
    }
    let mut computed = 0;
    let corpus = Corpus::open(folder, &mut |progress| {
        computed += usize::from(progress.is_new);
        bar.set_length(progress.total as u64);
        bar.set_position(progress.done as u64);
        bar.set_message(progress.name.to_owned());
    });
    bar.finish_and_clear();
    Ok((corpus?, computed))
}
