//! `froufrou grains`: from recordings to a corpus of grains, and from grains to sound.

mod build;
mod resynth;
mod shape;

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use froufrou::corpus::dictionary::Dictionary;
use froufrou::corpus::naming;
use froufrou::corpus::resynthesis::{Own, Sequence};
use froufrou::render::format::{SampleFormat, SoundFormat};
use froufrou::render::labels::Labels;
use froufrou::render::sound_file::{Container, SoundWriter};
use froufrou::render::speakers;
use froufrou::{Error, Result};
use serde::Serialize;

use crate::info::sheet::Sheet;

/// Make a corpus of grains from recordings, and sound from its grains
#[derive(Args)]
#[command(after_help = "\
Examples:
  froufrou grains build recordings -o stone          a corpus of a folder; again after any change
  froufrou grains resynth stone                      how well its grains make its recordings again
  froufrou grains vary stone hit_3 --seed 5 -o a.wav")]
pub struct Grains {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Build(build::Build),
    Resynth(resynth::Resynth),
    Stretch(shape::Stretch),
    Vary(shape::Vary),
    Rhythm(shape::Rhythm),
}

impl Grains {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        match self.command {
            Command::Build(command) => command.run(),
            Command::Resynth(command) => command.run(),
            Command::Stretch(command) => command.run(),
            Command::Vary(command) => command.run(),
            Command::Rhythm(command) => command.run(),
        }
    }
}

/// What every command takes that makes a sound.
#[derive(Args)]
struct Sounding {
    /// The sound file to write: WAV or FLAC by its ending
    #[arg(short, long, value_name = "OUT.wav|OUT.flac")]
    output: PathBuf,

    /// Sample format: 16 (dithered), 24 or 32f bits; 32f only of WAV
    #[arg(long, value_name = "BITS", default_value = "24", value_parser = format)]
    format: SampleFormat,

    /// Write one JSON object, for programs to read
    #[arg(long)]
    json: bool,
}

pub fn format(text: &str) -> Result<SampleFormat, String> {
    text.parse().map_err(|error: Error| error.to_string())
}

/// Which grains may sound.
#[derive(Args)]
struct Allowed {
    /// Leave out the grains of the recording itself
    #[arg(long)]
    without_own: bool,
}

impl Allowed {
    fn own(&self) -> Own {
        if self.without_own { Own::Without } else { Own::With }
    }
}

/// What was written.
#[derive(Serialize)]
struct Written {
    output: String,
    recording: String,
    rate_hz: u32,
    duration_s: f64,
    grains: usize,
    /// How many samples were beyond full scale.
    clipped: u64,
}

impl Sounding {
    /// Writes the sound of a sequence; how many samples were beyond full scale.
    fn save(&self, dictionary: &Dictionary, sequence: &Sequence) -> Result<u64> {
        let container = Container::of(&self.output)?;
        let rate_hz = dictionary.rate_hz();
        let format = SoundFormat { rate_hz, channels: 1, samples: self.format, seed: 0, first_frame: 0 };
        let labels = Labels { channel_mask: speakers::usual_mask(1), broadcast: None };
        let mut writer = SoundWriter::create(container, &self.output, format, labels)?;
        writer.write(&sequence.render(dictionary))?;
        Ok(writer.finish()?.clipped)
    }

    /// Writes the sound of a sequence and tells of it.
    fn write(&self, dictionary: &Dictionary, recording: usize, sequence: &Sequence) -> Result<()> {
        let clipped = self.save(dictionary, sequence)?;
        let rate_hz = dictionary.rate_hz();
        let written = Written {
            output: self.output.to_string_lossy().into_owned(),
            recording: dictionary.recordings()[recording].name.clone(),
            rate_hz,
            duration_s: sequence.length as f64 / f64::from(rate_hz),
            grains: sequence.chosen.len(),
            clipped,
        };
        let mut sheet = Sheet::default();
        sheet
            .fact("recording", &written.recording)
            .fact("written", &written.output)
            .fact("length", format!("{:.3} s at {rate_hz} Hz", written.duration_s))
            .fact("grains", written.grains)
            .fact_if(
                "beyond full scale",
                (written.clipped > 0).then(|| format!("{} samples", written.clipped)),
            );
        tell(&written, &sheet, self.json)
    }
}

/// Writes what was found to the standard output.
pub fn tell(value: &impl Serialize, sheet: &Sheet, json: bool) -> Result<()> {
    let text = if json {
        let text = serde_json::to_string_pretty(value);
        text.map_err(|fault| Error::new(format!("cannot write JSON: {fault}")).because(fault))? + "\n"
    } else {
        sheet.to_string()
    };
    std::io::stdout().lock().write_all(text.as_bytes()).map_err(|fault| Error::io("write", "-", fault))
}

/// The recording of a corpus that is called so.
fn find(dictionary: &Dictionary, corpus: &Path, wanted: &str) -> Result<usize> {
    let names: Vec<&str> = dictionary.recordings().iter().map(|recording| &*recording.name).collect();
    naming::find(&names, wanted).map_err(|fault| fault.in_file(corpus))
}
