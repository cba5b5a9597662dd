//! `froufrou corpus`: corpora of cloth and of paper, from recordings to spectra of friction, pops and clips.

mod build;
mod harvest;
pub mod info;
pub mod paper;

use clap::{Args, Subcommand};
use froufrou::Result;

/// Make a corpus of cloth or paper from recordings, and tell what is in one
#[derive(Args)]
#[command(after_help = "\
Examples:
  froufrou corpus build takes -o cotton       a corpus of a folder with a corpus.toml
  froufrou corpus info cotton --plot a.png    its spectra and pops, as figures and as a picture
  froufrou corpus info synthetic/windbreaker
  froufrou corpus harvest crumple.wav -o kraft     clips of paper out of one recording of crumpling
  froufrou corpus info synthetic/printer      the sizes of paper that it has sounds of")]
pub struct Corpus {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Build(build::Build),
    Harvest(harvest::Harvest),
    Info(info::Info),
}

impl Corpus {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        match self.command {
            Command::Build(command) => command.run(),
            Command::Harvest(command) => command.run(),
            Command::Info(command) => command.run(),
        }
    }
}
