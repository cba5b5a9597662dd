//! `froufrou grains stretch`, `vary` and `rhythm`: other sounds of the same grains.

use std::path::PathBuf;

use clap::Args;
use froufrou::Result;
use froufrou::corpus::dictionary::Dictionary;
use froufrou::corpus::resynthesis::{rhythm, stretch, vary};

use super::{Allowed, Sounding, find};

/// Make a recording longer or shorter at its pitch
#[derive(Args)]
#[command(after_help = "\
Example:
  froufrou grains stretch stone rolling_2 --factor 1.5 -o longer.wav")]
pub struct Stretch {
    /// The corpus
    corpus: PathBuf,

    /// The recording, by its name or a part of it
    recording: String,

    /// How many times as long, 0.05 to 50
    #[arg(long, value_name = "NUMBER")]
    factor: f64,

    #[command(flatten)]
    allowed: Allowed,

    #[command(flatten)]
    sounding: Sounding,
}

impl Stretch {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let dictionary = Dictionary::open(&self.corpus)?;
        let recording = find(&dictionary, &self.corpus, &self.recording)?;
        let sequence = stretch(&dictionary, recording, self.allowed.own(), self.factor)?;
        self.sounding.write(&dictionary, recording, &sequence)
    }
}

/// Make a recording that is similar, but another
#[derive(Args)]
#[command(after_help = "\
Example:
  froufrou grains vary stone hit_3 --seed 5 -o another.wav")]
pub struct Vary {
    /// The corpus
    corpus: PathBuf,

    /// The recording, by its name or a part of it
    recording: String,

    /// What chance follows from
    #[arg(long, value_name = "NUMBER", default_value = "0")]
    seed: u64,

    #[command(flatten)]
    allowed: Allowed,

    #[command(flatten)]
    sounding: Sounding,
}

impl Vary {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let dictionary = Dictionary::open(&self.corpus)?;
        let recording = find(&dictionary, &self.corpus, &self.recording)?;
        let sequence = vary(&dictionary, recording, self.allowed.own(), self.seed)?;
        self.sounding.write(&dictionary, recording, &sequence)
    }
}

/// Play the grains of one recording in the rhythm of another
#[derive(Args)]
#[command(after_help = "\
Example:
  froufrou grains rhythm stone gravel footsteps -o walk.wav")]
pub struct Rhythm {
    /// The corpus
    corpus: PathBuf,

    /// The recording whose grains sound, by its name or a part of it
    #[arg(value_name = "GRAINS_OF")]
    grains: String,

    /// The recording whose rhythm they take
    #[arg(value_name = "RHYTHM_OF")]
    rhythm: String,

    #[command(flatten)]
    sounding: Sounding,
}

impl Rhythm {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let dictionary = Dictionary::open(&self.corpus)?;
        let grains = find(&dictionary, &self.corpus, &self.grains)?;
        let rhythm_of = find(&dictionary, &self.corpus, &self.rhythm)?;
        let sequence = rhythm(&dictionary, grains, rhythm_of)?;
        self.sounding.write(&dictionary, grains, &sequence)
    }
}
