//! `--reaper`: the soundtrack as a project of Reaper.

use std::path::{Path, PathBuf};

use froufrou::render::reaper::{Marker, Project, Track, colour_of};
use froufrou::render::soundtrack::Summary;
use froufrou::synth::mixer::Begun;
use froufrou::{Error, Result};

use crate::files;

/// A project that fills while a soundtrack is rendered.
pub struct Session {
    path: PathBuf,
    /// When each sound is first heard, with its object and its cause.
    sounds: Vec<(f64, String, String)>,
}

impl Session {
    /// Begins a project.
    pub fn new(path: &Path) -> Result<Self> {
        if !path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("rpp")) {
            return Err(
                Error::new("expected the name of a Reaper project, which ends in `.rpp`").in_file(path)
            );
        }
        Ok(Self { path: path.to_owned(), sounds: Vec::new() })
    }

    /// Where the stems go where nothing else is said: beside the project.
    pub fn stems_folder(&self) -> PathBuf {
        let name = self.path.file_stem().unwrap_or_default().to_string_lossy();
        self.path.with_file_name(format!("{name} stems"))
    }

    /// Notes a sound.
    pub fn mark(&mut self, begun: &Begun) {
        self.sounds.push((begun.arrival_s, begun.start.object.clone(), begun.start.cause.clone()));
    }

    /// Writes the project. `first` is the first frame that was rendered, `start` its place on the
    /// ruler, in frames since midnight.
    pub fn write(
        mut self,
        mix: &Path,
        summary: &Summary,
        rate_hz: u32,
        channels: usize,
        first: u64,
        start: u64,
    ) -> Result<()> {
        let seconds = |frames: u64| frames as f64 / f64::from(rate_hz);
        let folder = self.path.parent().unwrap_or(Path::new("")).to_owned();
        let file = |path: &Path| files::relative(path, &folder);
        let name = |object: &str| if object.is_empty() { "no object".to_owned() } else { object.to_owned() };
        let mix = Track { name: "Mix".into(), file: file(mix), channels, is_muted: true, colour: None };
        let stems = summary.stems.iter().map(|(object, path)| Track {
            name: name(object),
            file: file(path),
            channels,
            is_muted: false,
            colour: Some(colour_of(object)),
        });
        let length_s = seconds(summary.report.frames);
        // Sounds are noted as they leave their source; markers stand where they arrive.
        self.sounds.sort_by(|a, b| a.0.total_cmp(&b.0));
        let markers = self.sounds.iter().map(|(arrival_s, object, cause)| Marker {
            time_s: arrival_s - seconds(first),
            name: if cause.is_empty() { name(object) } else { format!("{}: {cause}", name(object)) },
            colour: Some(colour_of(object)),
        });
        let project = Project {
            rate_hz,
            length_s,
            offset_s: seconds(start),
            tracks: std::iter::once(mix).chain(stems).collect(),
            markers: markers.filter(|marker| (0.0..=length_s).contains(&marker.time_s)).collect(),
        };
        let mut output = files::Output::create(&self.path)?;
        project.write(&mut output).map_err(|fault| Error::io("write", &self.path, fault))?;
        output.finish()
    }
}
