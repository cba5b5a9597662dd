//! `froufrou score`: from a scene to its score, or from one form of a score to another.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use froufrou::Result;
use froufrou::render::production::Production;
use froufrou::score::{AnyDocument, ChannelWriter, Header, ObjectLine, ObjectWriter, Order, Receives};

use crate::files;
use crate::progress::Count;
use crate::render::SceneOptions;
use crate::usage;

/// Write the score of a scene, to be read, edited and mixed; or sort one that there is
#[derive(Args)]
#[command(after_help = "\
Examples:
  froufrou score scene.toml -o out.score                   threads on moving points
  froufrou score scene.toml --space channel -o out.score   gains and delays per channel
  froufrou score out.score --sort thread -o sorted.score")]
pub struct Score {
    #[command(flatten)]
    scene: SceneOptions,

    /// The score to write; `-` is standard output
    #[arg(short, long, value_name = "OUT.score", default_value = "-")]
    output: PathBuf,

    /// The space of the score
    #[arg(long, value_enum)]
    space: Option<SpaceName>,

    /// How its lines are sorted; by thread needs memory for all of them
    #[arg(long, value_enum)]
    sort: Option<Sort>,
}

/// The space of a score.
#[derive(Clone, Copy, ValueEnum)]
enum SpaceName {
    /// Threads on moving points
    Object,
    /// Gains and delays per channel
    Channel,
}

/// The order of a score.
#[derive(Clone, Copy, ValueEnum)]
enum Sort {
    /// By time, then thread
    Time,
    /// By thread, then time
    Thread,
}

impl Score {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        if self.scene.file.path.extension().is_some_and(|e| e == "score") {
            return self.sort_score();
        }
        if matches!(self.sort, Some(Sort::Thread)) && self.output == Path::new("-") {
            usage(
                "a scene's score on standard output is in order of time; `-o FILE` has it sorted by thread",
            );
        }
        let production = Production::open(self.scene.open()?)?;
        let folder = &production.scene.folder;
        let mut text = files::Output::create(&self.output)?;
        let mut count = Count::new("lines", &self.output);
        match self.space.unwrap_or(SpaceName::Object) {
            SpaceName::Object => {
                let header = relocated(&production.header, folder, &self.output);
                let mut writer = ObjectWriter::new(&mut text, &header)?;
                for line in production.object_lines()? {
                    let line = line?;
                    writer.write(&line)?;
                    count.one(match &line {
                        ObjectLine::Thread(line) => line.time_s,
                        ObjectLine::Cue(cue) => cue.time_s,
                        ObjectLine::Microphone(key) => key.time_s,
                    });
                }
                writer.finish()?;
            }
            SpaceName::Channel => {
                let header = relocated(&production.channel_header(), folder, &self.output);
                let mut writer = ChannelWriter::new(&mut text, &header)?;
                for line in production.channel_lines()? {
                    let line = line?;
                    writer.write(&line)?;
                    count.one(line.time_s());
                }
                writer.finish()?;
            }
        }
        text.finish()?;
        match self.sort {
            Some(Sort::Thread) => self.sorted(&self.output),
            _ => Ok(()),
        }
    }

    /// Rewrites a score in another order.
    fn sort_score(&self) -> Result<()> {
        let SceneOptions { file, seed, layout } = &self.scene;
        if self.space.is_some() || seed.is_some() || layout.is_some() || file.allow_outside {
            usage(
                "`--space`, `--seed`, `--layout` and `--allow-outside` are for scenes; a score can be given another order with `--sort`",
            );
        }
        self.sorted(&self.scene.file.path)
    }

    fn sorted(&self, path: &Path) -> Result<()> {
        let mut document = AnyDocument::open(path)?;
        document.sort(match self.sort {
            Some(Sort::Thread) => Order::Thread,
            Some(Sort::Time) | None => Order::Time,
        });
        files::write(&self.output, document.to_text()?.as_bytes())
    }
}

/// A header whose files are named from the folder of the score instead of that of the scene.
fn relocated<R: Clone + Receives>(header: &Header<R>, folder: &Path, output: &Path) -> Header<R> {
    let from = output.parent().unwrap_or(Path::new(""));
    let mut header = header.clone();
    for file in header.files_mut() {
        *file = files::relative(&folder.join(&*file), from);
    }
    header
}
