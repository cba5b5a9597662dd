//! `froufrou completions` and `froufrou man`: help where shells and readers look for it.

use std::io::Write;
use std::path::PathBuf;

use clap::{Args, CommandFactory};
use clap_complete::Shell;
use froufrou::{Error, Result};

use crate::{Cli, files};

/// Print what lets a shell complete commands and options with the tab key
#[derive(Args)]
#[command(after_help = "\
Example:
  froufrou completions bash > ~/.local/share/bash-completion/completions/froufrou")]
pub struct Completions {
    /// The shell: bash, zsh, fish, powershell or elvish
    #[arg(value_name = "SHELL")]
    shell: Shell,
}

impl Completions {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut Cli::command(), "froufrou", &mut script);
        let mut output = std::io::stdout().lock();
        let written = output.write_all(&script).and_then(|()| output.flush());
        written.map_err(|fault| Error::io("write", "standard output", fault))
    }
}

/// Write manual pages, one for each command, to a folder
#[derive(Args)]
#[command(after_help = "\
Example:
  froufrou man ~/.local/share/man/man1")]
pub struct Man {
    /// The folder; it is made if need be
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

impl Man {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        std::fs::create_dir_all(&self.folder)
            .map_err(|fault| Error::io("make the folder", &self.folder, fault))?;
        let mut command = Cli::command();
        // Gives the subcommands their full names, `froufrou-render` and so on.
        command.build();
        let subcommands = command.get_subcommands().filter(|subcommand| subcommand.get_name() != "help");
        for command in std::iter::once(&command).chain(subcommands) {
            let name = command.get_display_name().unwrap_or(command.get_name());
            let path = self.folder.join(format!("{name}.1"));
            let mut page = Vec::new();
            let rendered = clap_mangen::Man::new(command.clone()).render(&mut page);
            rendered.map_err(|fault| Error::io("write", &path, fault))?;
            files::write(&path, &page)?;
        }
        Ok(())
    }
}
