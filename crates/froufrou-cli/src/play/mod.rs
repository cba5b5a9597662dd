//! `froufrou play`: a scene through the machine's sound device, by itself or as another program tells what happens.

#[cfg(feature = "device")]
mod desk;
#[cfg(feature = "device")]
mod device;
mod feed;
#[cfg(feature = "device")]
mod session;
#[cfg(feature = "device")]
mod speaker;

use clap::Args;
use froufrou::render::live::Statistics;
use froufrou::{Error, Result};

use crate::render::SceneOptions;

#[cfg(feature = "device")]
const ABOUT: &str = "Play a scene through the sound device, or as another program tells what happens";
#[cfg(feature = "device")]
const AFTER_HELP: &str = "\
Keys: space pauses, ← and → seek by 5 s, 0 goes to the beginning, l loops, r loads again, q ends.
The scene is loaded again when it or a script beside it is saved. With --feed there are no keys.

Examples:
  froufrou play scene.toml --from 12 --loop
  my-game | froufrou play scene.toml --feed -
  froufrou play scene.toml --feed happened.jsonl --output out.wav";

#[cfg(not(feature = "device"))]
const ABOUT: &str = "Write a file of a scene as another program tells what happens";
#[cfg(not(feature = "device"))]
const AFTER_HELP: &str = "\
This froufrou plays to no sound device; one that is built with `--features device` does.

Examples:
  my-game | froufrou play scene.toml --feed - --output out.wav
  froufrou play scene.toml --feed happened.jsonl --output out.wav";

/// The command `froufrou play`
#[derive(Args)]
#[command(about = ABOUT, after_help = AFTER_HELP)]
pub struct Play {
    #[command(flatten)]
    scene: SceneOptions,

    /// Frames a second, instead of the scene's; where a device cannot, those that it prefers
    #[arg(long, value_name = "HZ", value_parser = clap::value_parser!(u32).range(8_000..=192_000))]
    rate: Option<u32>,

    #[cfg(feature = "device")]
    #[command(flatten)]
    device: DeviceOptions,

    #[command(flatten)]
    feed: feed::FeedOptions,
}

/// What only a device asks for.
#[cfg(feature = "device")]
#[derive(Args)]
struct DeviceOptions {
    /// Where to begin, in seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0, conflicts_with = "feed")]
    from: f64,

    /// Begin again at the end
    #[arg(long = "loop", conflicts_with = "feed")]
    is_looped: bool,

    /// The device, by a part of its name
    #[arg(long, value_name = "NAME", conflicts_with = "output")]
    device: Option<String>,

    /// Ask the device for blocks of so many frames: fewer are heard sooner, and are late more easily
    #[arg(long, value_name = "FRAMES", default_value_t = 1024, conflicts_with = "output",
          value_parser = clap::value_parser!(u32).range(16..=65536))]
    block: u32,
}

/// The command `froufrou devices`
#[cfg(feature = "device")]
#[derive(Args)]
#[command(
    about = "Name the devices that `froufrou play` can use",
    after_help = "\
Example:
  froufrou devices"
)]
pub struct Devices {}

#[cfg(feature = "device")]
impl Devices {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let names = device::names();
        if names.is_empty() {
            return Err(Error::new("this machine has no device to play to"));
        }
        for name in names {
            println!("{name}");
        }
        Ok(())
    }
}

impl Play {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        if let Some((input, output)) = self.feed.file() {
            return feed::to_file(&self, input, output);
        }
        self.on_device()
    }

    #[cfg(feature = "device")]
    fn on_device(self) -> Result<()> {
        match self.feed.input() {
            Some(input) => feed::on_device(&self, input),
            None => desk::run(&self),
        }
    }

    #[cfg(not(feature = "device"))]
    fn on_device(self) -> Result<()> {
        let help = "build it with `--features device`, or give `--feed` and `--output`";
        Err(Error::new("this froufrou plays to no sound device").help(help))
    }
}

/// Says what the audio thread of a device has to say for itself.
#[cfg(feature = "device")]
fn report(statistics: &Statistics, rate_hz: f64) {
    let seconds = |frames: u64| frames as f64 / rate_hz;
    if statistics.held > 0 {
        let late_s = seconds(statistics.held_frames);
        eprintln!("{} times what came next was late, {late_s:.2} s in all", statistics.held);
    }
    if statistics.late_blocks > 0 {
        let (slow, most) = (statistics.late_blocks, statistics.peak_load);
        eprintln!("{slow} blocks took longer than they sound, the slowest {most:.1} times as long");
    }
    report_limited(statistics);
}

/// Says what was too loud.
fn report_limited(statistics: &Statistics) {
    if statistics.limited_frames > 0 {
        eprintln!("{} frames were beyond full scale, and made softer", statistics.limited_frames);
    }
}
