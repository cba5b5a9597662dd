//! `froufrou render`: from a scene to its soundtrack.

use std::path::PathBuf;

use clap::Args;
use froufrou::Result;
use froufrou::render::production::Production;
use froufrou::scene::Scene;
use froufrou::scene::listener::Layout;

use crate::soundtrack;

/// Render a scene to its soundtrack
#[derive(Args)]
#[command(after_help = "\
Example:
  froufrou render scene.toml -o out.wav --stems stems --log out.jsonl")]
pub struct Render {
    #[command(flatten)]
    scene: SceneOptions,

    #[command(flatten)]
    soundtrack: soundtrack::Options,
}

/// What every command takes that reads a scene.
#[derive(Args, Clone)]
pub struct SceneFile {
    /// The scene
    #[arg(value_name = "SCENE.toml")]
    pub path: PathBuf,

    /// Let the scene use files outside its folder
    #[arg(long)]
    pub allow_outside: bool,
}

impl SceneFile {
    /// Reads the scene.
    pub fn open(&self) -> Result<Scene> {
        Scene::open(&self.path, self.allow_outside)
    }
}

/// What every command takes that makes a scene sound.
#[derive(Args, Clone)]
pub struct SceneOptions {
    #[command(flatten)]
    pub file: SceneFile,

    /// What all random choices follow from, instead of the scene's seed
    #[arg(long, value_name = "NUMBER")]
    pub seed: Option<u64>,

    /// How the listener hears, instead of the scene's layout: mono, stereo, binaural, ambisonic-3, 5.1, 7.1.4, …
    #[arg(long, value_name = "LAYOUT", value_parser = layout)]
    pub layout: Option<Layout>,
}

fn layout(text: &str) -> Result<Layout, String> {
    text.parse().map_err(|error: froufrou::Error| error.to_string())
}

impl SceneOptions {
    /// Reads the scene as asked for.
    pub fn open(&self) -> Result<Scene> {
        let mut scene = self.file.open()?;
        if let Some(seed) = self.seed {
            scene.seed = seed;
        }
        if let Some(layout) = &self.layout {
            scene.set_layout(layout.clone())?;
        }
        Ok(scene)
    }
}

impl Render {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let scene = self.scene.open()?;
        let production = Production::open(scene)?;
        let rate_hz = self.soundtrack.rate.unwrap_or(production.scene.rate_hz);
        soundtrack::write(
            &self.soundtrack,
            rate_hz,
            &production.channel_header(),
            &production.scene.folder,
            production.prototypes.clone(),
            production.channel_lines()?,
        )?;
        Ok(())
    }
}
