//! `froufrou mix`: from a score to its soundtrack.

use std::path::{Path, PathBuf};

use clap::Args;
use froufrou::Result;
use froufrou::render::production::open_score;

use crate::soundtrack;

/// Rate of a soundtrack from a score, which has none of its own.
const RATE_HZ: u32 = 48_000;

/// Mix a score, in object or channel space, to its soundtrack
#[derive(Args)]
#[command(after_help = "\
Example:
  froufrou score scene.toml -o out.score
  froufrou mix out.score -o out.wav")]
pub struct Mix {
    /// The score
    #[arg(value_name = "FILE.score")]
    path: PathBuf,

    /// What synthesised sounds and the dither of 16-bit files follow from, instead of the score's own
    #[arg(long, value_name = "NUMBER")]
    seed: Option<u64>,

    #[command(flatten)]
    soundtrack: soundtrack::Options,
}

impl Mix {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let (mut header, prototypes, lines) = open_score(&self.path)?;
        header.seed = self.seed.unwrap_or(header.seed);
        let rate_hz = self.soundtrack.rate.unwrap_or(RATE_HZ);
        let folder = self.path.parent().unwrap_or(Path::new(""));
        soundtrack::write(&self.soundtrack, rate_hz, &header, folder, prototypes, lines)?;
        Ok(())
    }
}
