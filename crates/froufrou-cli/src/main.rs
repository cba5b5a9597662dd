//! The `froufrou` command: animations in, soundtracks out.

mod completions;
mod concatenate;
mod corpus;
mod demo;
mod events;
mod features;
mod file_kind;
mod files;
mod grains;
mod info;
mod mix;
mod play;
mod plot;
mod progress;
mod reaper;
mod render;
mod score;
mod soundtrack;
mod warp;

use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{CommandFactory, Parser, Subcommand};

/// A sound engine that turns motion into sound.
#[derive(Parser)]
#[command(
    name = "froufrou",
    version,
    arg_required_else_help = true,
    after_help = "\
Example:
  froufrou demo                             see and hear what it does
  froufrou render scene.toml -o out.wav     give an animation its soundtrack"
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Demo(demo::Demo),
    Render(render::Render),
    Events(events::Events),
    Score(score::Score),
    Mix(mix::Mix),
    Play(play::Play),
    #[cfg(feature = "device")]
    Devices(play::Devices),
    Info(info::Info),
    Plot(plot::Plot),
    Grains(grains::Grains),
    Corpus(corpus::Corpus),
    Features(features::Features),
    Warp(warp::Warp),
    Concatenate(concatenate::Concatenate),
    Completions(completions::Completions),
    Man(completions::Man),
}

fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Demo(command) => command.run(),
        Command::Render(command) => command.run(),
        Command::Events(command) => command.run(),
        Command::Score(command) => command.run(),
        Command::Mix(command) => command.run(),
        Command::Play(command) => command.run(),
        #[cfg(feature = "device")]
        Command::Devices(command) => command.run(),
        Command::Info(command) => command.run(),
        Command::Plot(command) => command.run(),
        Command::Grains(command) => command.run(),
        Command::Corpus(command) => command.run(),
        Command::Features(command) => command.run(),
        Command::Warp(command) => command.run(),
        Command::Concatenate(command) => command.run(),
        Command::Completions(command) => command.run(),
        Command::Man(command) => command.run(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        // Whoever read our output has seen enough.
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("froufrou: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Ends the command where what was asked for makes no sense, as clap does.
fn usage(message: &str) -> ! {
    Cli::command().error(ErrorKind::ArgumentConflict, message).exit()
}

fn is_broken_pipe(error: &froufrou::Error) -> bool {
    let mut source = std::error::Error::source(error);
    while let Some(error) = source {
        if let Some(error) = error.downcast_ref::<std::io::Error>() {
            return error.kind() == std::io::ErrorKind::BrokenPipe;
        }
        source = error.source();
    }
    false
}
