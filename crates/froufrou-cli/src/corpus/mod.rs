//! `froufrou corpus`: corpora of cloth, from recordings to spectra of friction and pops.

mod build;
pub mod info;

use clap::{Args, Subcommand};
use froufrou::Result;

/// Make a corpus of cloth from recordings, and tell what is in one
#[derive(Args)]
#[command(after_help = "\
Examples:
  froufrou corpus build takes -o cotton       a corpus of a folder with a corpus.toml
  froufrou corpus info cotton --plot a.png    its spectra and pops, as figures and as a picture
  froufrou corpus info synthetic/windbreaker")]
pub struct Corpus {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Build(build::Build),
    Info(info::Info),
}

impl Corpus {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        match self.command {
            Command::Build(command) => command.run(),
            Command::Info(command) => command.run(),
        }
    }
}
