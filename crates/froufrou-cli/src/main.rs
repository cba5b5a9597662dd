//! The command `froufrou`: animations in, soundtracks out.

mod file_kind;
mod info;
mod plot;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Turns animation into sound.
#[derive(Debug, Parser)]
#[command(version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Info(info::Info),
    Plot(plot::Plot),
}

fn main() -> ExitCode {
    let done = match Cli::parse().command {
        Command::Info(info) => info.run(),
        Command::Plot(plot) => plot.run(),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
