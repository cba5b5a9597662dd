//! `froufrou events`: what happens in a scene.

use std::path::PathBuf;

use clap::Args;
use froufrou::motion::event;
use froufrou::scene::world::World;
use froufrou::score::compose;
use froufrou::{Error, Result};

use crate::files;
use crate::progress::Count;
use crate::render::SceneFile;

/// Find what happens in a scene: impacts, slides and rolls, one JSON object a line
#[derive(Args)]
#[command(after_help = "\
Example:
  froufrou events scene.toml -o events.jsonl")]
pub struct Events {
    #[command(flatten)]
    scene: SceneFile,

    /// The file to write; `-` is standard output
    #[arg(short, long, value_name = "EVENTS.jsonl", default_value = "-")]
    output: PathBuf,
}

impl Events {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let scene = self.scene.open()?;
        let world = World::open(&scene)?;
        let mut output = files::Output::create(&self.output)?;
        let mut count = Count::new("events", &self.output);
        for event in compose::Events::open(&scene, &world)? {
            let event = event?;
            event::write(&mut output, &event).map_err(|fault| Error::io("write", &self.output, fault))?;
            count.one(event.time_s());
        }
        output.finish()
    }
}
