//! `froufrou demo`: a scene from within the command, rendered to a folder.

use std::path::{Path, PathBuf};

use clap::{Args, FromArgMatches};
use froufrou::corpus::recording::Recording;
use froufrou::{Error, Result};

use crate::files;
use crate::plot::{self, PictureSize, Soundtrack};
use crate::render::Render;
use crate::score::Score;

/// The files of the scene, as they lie in `examples/demo`.
macro_rules! embedded {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_bytes!(concat!("../../../examples/demo/", $name)).as_slice())),*]
    };
}

const FILES: &[(&str, &[u8])] = embedded![
    "README.md",
    "contacts.csv",
    "recordings/coin1.flac",
    "recordings/coin2.flac",
    "recordings/coin3.flac",
    "recordings/coin4.flac",
    "recordings/coin5.flac",
    "recordings/coin6.flac",
    "recordings/rubber1.flac",
    "recordings/rubber2.flac",
    "recordings/rubber3.flac",
    "recordings/rubber4.flac",
    "recordings/rubber5.flac",
    "recordings/rubber6.flac",
    "recordings/siren.flac",
    "recordings/wood1.flac",
    "recordings/wood2.flac",
    "recordings/wood3.flac",
    "recordings/wood4.flac",
    "recordings/wood5.flac",
    "recordings/wood6.flac",
    "scene.toml",
];

/// Render a scene that the command brings along, to see and hear what it does
#[derive(Args)]
#[command(after_help = "\
Example:
  froufrou demo -o demo      then play demo/soundtrack.wav and look at demo/soundtrack.png")]
pub struct Demo {
    /// The folder to write to; what it has of the demo is written anew
    #[arg(short, long, value_name = "DIR", default_value = "froufrou-demo")]
    output: PathBuf,
}

impl Demo {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let folder = &self.output;
        for (name, content) in FILES {
            let path = folder.join(name);
            let parent = path.parent().unwrap_or(folder);
            std::fs::create_dir_all(parent).map_err(|fault| Error::io("make the folder", parent, fault))?;
            files::write(&path, content)?;
        }
        let scene = folder.join("scene.toml");
        let (sound, picture) = (folder.join("soundtrack.wav"), folder.join("soundtrack.png"));
        let (score, log) = (folder.join("soundtrack.score"), folder.join("soundtrack.jsonl"));
        // The very commands that a user would give.
        command::<Render>("render", &[&scene, "-o".as_ref(), &sound, "--log".as_ref(), &log])?.run()?;
        command::<Score>("score", &[&scene, "-o".as_ref(), &score])?.run()?;
        draw(&sound, &log, &picture)?;
        println!("{}: the scene, to be changed and rendered again", scene.display());
        println!("{}: its score, to be changed and mixed again", score.display());
        println!("{}: what made which sound", log.display());
        println!("{}: a picture of the soundtrack", picture.display());
        Ok(())
    }
}

/// A command as from a command line.
fn command<T: Args + FromArgMatches>(name: &'static str, arguments: &[&Path]) -> Result<T> {
    let command = T::augment_args(clap::Command::new(name).no_binary_name(true));
    let matches = command.try_get_matches_from(arguments.iter().map(|path| path.as_os_str()));
    let parsed = matches.and_then(|matches| T::from_arg_matches(&matches));
    parsed.map_err(|fault| Error::new(format!("cannot {name} the demo")).because(fault))
}

/// Draws the soundtrack, every sound of its log marked where it is first heard.
fn draw(sound: &Path, log: &Path, picture: &Path) -> Result<()> {
    let recording = Recording::open(sound)?;
    let text = std::fs::read_to_string(log).map_err(|fault| Error::io("read", log, fault))?;
    let marks = text.lines().filter_map(|line| {
        let line: serde_json::Value = serde_json::from_str(line).ok()?;
        Some((line["arrival_s"].as_f64()?, line["object"].as_str()?.to_owned()))
    });
    let soundtrack = Soundtrack {
        title: "froufrou demo",
        rate_hz: recording.rate_hz,
        channels: &recording.channels,
        span_s: None,
        marks: &marks.collect::<Vec<_>>(),
    };
    plot::soundtrack(picture, &soundtrack, PictureSize::default())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn the_whole_example_is_brought_along() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/demo");
        let mut found = BTreeSet::new();
        for part in ["", "recordings"] {
            for entry in std::fs::read_dir(folder.join(part)).unwrap() {
                let path = entry.unwrap().path();
                if path.is_file() {
                    let name = path.strip_prefix(&folder).unwrap().to_string_lossy().replace('\\', "/");
                    found.insert(name);
                }
            }
        }
        let embedded: BTreeSet<String> = FILES.iter().map(|(name, _)| (*name).to_owned()).collect();
        assert_eq!(embedded, found);
    }
}
