//! `froufrou plot`: pictures of sounds, events and scores.

mod axis;
mod canvas;
pub mod cloth;
mod clouds;
mod colour;
mod envelope;
mod events;
mod panel;
pub mod paper;
mod score;
mod soundtrack;
mod spectrogram;
mod threads;

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use froufrou::corpus::cloth::ClothSound;
use froufrou::corpus::cloth::manifest::Manifest;
use froufrou::corpus::cloth::synthetic::Cloth;
use froufrou::corpus::paper::PaperSound;
use froufrou::corpus::recording::Recording;
use froufrou::motion::event;
use froufrou::{Error, Result};

use self::canvas::Canvas;
pub use self::clouds::{Cloud, clouds};
pub use self::panel::PictureSize;
pub use self::soundtrack::Soundtrack;
use crate::file_kind::FileKind;

/// What can be drawn.
const READABLE: &str = "audio (WAV, RF64, AIFF, FLAC, Ogg Vorbis, MP3), events (.jsonl), scores, and corpora of cloth and paper (folders)";

/// Draws a picture of a sound, of events, of a score or of a corpus.
///
/// A sound is drawn as the waveform of every channel above a spectrogram, events by their impulse
/// over time, a score by the threads of every object over time and, in object space, from above.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  froufrou plot out.wav -o picture.png
  froufrou plot synthetic/printer -o printer.png
  froufrou plot out.wav --events events.jsonl --from 1 --to 2 -o second.png")]
pub struct Plot {
    /// An audio file, an event file or a score, told by its content; or the folder of a corpus of cloth or paper.
    file: PathBuf,
    /// The picture, a PNG file; left out, it lies beside FILE with the ending `.png`.
    #[arg(short, long, value_name = "PNG")]
    output: Option<PathBuf>,
    #[command(flatten)]
    size: PictureSize,
    /// The first second that is shown.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    from: Option<f64>,
    /// The last second that is shown.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    to: Option<f64>,
    /// Events to be marked in the picture of a sound.
    #[arg(long, value_name = "JSONL")]
    events: Option<PathBuf>,
}

/// Reads a time of the command line.
fn seconds(text: &str) -> std::result::Result<f64, String> {
    match text.parse::<f64>() {
        Ok(time_s) if time_s.is_finite() => Ok(time_s),
        _ => Err("expected a number of seconds".to_owned()),
    }
}

impl Plot {
    /// Draws and writes the picture.
    ///
    /// # Errors
    /// A file that cannot be read or drawn, a time range that it does not have, or a picture that
    /// cannot be written.
    pub fn run(self) -> Result<()> {
        if let Some(canvas) = self.corpus()? {
            let output = self.output.unwrap_or_else(|| self.file.with_extension("png"));
            return canvas.save(&output);
        }
        let kind = FileKind::of(&self.file, READABLE)?;
        let size = self.size;
        let title = self.file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let asked = Span { from_s: self.from, to_s: self.to };
        asked.check()?;
        if self.events.is_some() && !matches!(kind, FileKind::Recording(_)) {
            return Err(Error::new("events are marked in pictures of sounds alone")
                .in_file(&self.file)
                .help("leave out --events"));
        }
        let output = self.output.unwrap_or_else(|| self.file.with_extension("png"));
        // A slip of the pen must not cost a recording.
        let same = |other: &Path| std::fs::canonicalize(other).ok() == std::fs::canonicalize(&self.file).ok();
        if output.exists() && same(&output) {
            return Err(Error::new("the picture would replace the file that it is of").in_file(&output));
        }
        let canvas = match kind {
            FileKind::Recording(_) => {
                let recording = Recording::open(&self.file)?;
                let span_s = asked.within(0.0, recording.duration_s()).map_err(|e| e.in_file(&self.file))?;
                let marks = match &self.events {
                    Some(events) => marks(events, span_s)?,
                    None => Vec::new(),
                };
                let (rate_hz, channels) = (recording.rate_hz, &recording.channels);
                let sound =
                    Soundtrack { title: &title, rate_hz, channels, span_s: Some(span_s), marks: &marks };
                return soundtrack(&output, &sound, size);
            }
            FileKind::Events => events::draw(&self.file, &title, asked, size)?,
            FileKind::Score => score::draw(&self.file, &title, asked, size)?,
            FileKind::Scene | FileKind::Animation(_) | FileKind::Head | FileKind::ContactLog => {
                let what = match kind {
                    FileKind::Scene => "a scene",
                    FileKind::Animation(_) => "an animation",
                    FileKind::Head => "a head",
                    _ => "a contact log",
                };
                return Err(Error::new(format!("{what} cannot be drawn"))
                    .in_file(&self.file)
                    .help(format!("drawn are {READABLE}; `froufrou info` tells what is in it")));
            }
        };
        canvas.save(&output)
    }
}

impl Plot {
    /// The picture of a corpus of cloth or paper, where the file is one or names a model.
    fn corpus(&self) -> Result<Option<Canvas>> {
        let is_paper = crate::corpus::paper::is_paper(&self.file);
        let name = self.file.to_string_lossy();
        let is_cloth = Manifest::is_cloth(&self.file) || Cloth::names().any(|model| *model == *name);
        if !is_paper && !is_cloth {
            return Ok(None);
        }
        if self.events.is_some() || self.from.is_some() || self.to.is_some() {
            return Err(Error::new("a corpus has no times")
                .in_file(&self.file)
                .help("leave out --events, --from and --to"));
        }
        Ok(Some(match is_paper {
            true => paper::draw(&PaperSound::named(&name, Path::new(""))?, self.size)?,
            false => cloth::draw(&ClothSound::named(&name, Path::new(""))?, self.size)?,
        }))
    }
}

/// Writes the picture of a sound that is in memory: its waveforms, a spectrogram, and marks at given
/// times.
///
/// # Errors
/// Where the picture cannot be written.
pub fn soundtrack(png: &Path, sound: &Soundtrack, size: PictureSize) -> Result<()> {
    sound.draw(size)?.save(png)
}

/// The times asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Span {
    from_s: Option<f64>,
    to_s: Option<f64>,
}

impl Span {
    fn check(&self) -> Result<()> {
        match (self.from_s, self.to_s) {
            (Some(from_s), Some(to_s)) if from_s >= to_s => {
                let what = format!("--from {from_s} is not before --to {to_s}");
                Err(Error::new(what).help("both are in seconds"))
            }
            _ => Ok(()),
        }
    }

    /// Whether a time is shown.
    fn holds(&self, time_s: f64) -> bool {
        self.from_s.is_none_or(|from_s| from_s <= time_s) && self.to_s.is_none_or(|to_s| time_s <= to_s)
    }

    /// What of a file's time is shown.
    fn within(&self, start_s: f64, end_s: f64) -> Result<(f64, f64)> {
        let from_s = self.from_s.unwrap_or(start_s).max(start_s);
        let to_s = self.to_s.unwrap_or(end_s).min(end_s);
        if from_s > to_s || (from_s == to_s && start_s < end_s) {
            let what = format!("nothing to show: it lasts from {start_s} s to {end_s} s");
            return Err(Error::new(what).help("see --from and --to"));
        }
        Ok((from_s, to_s))
    }
}

/// The events of a file within a span, as marks.
fn marks(file: &Path, span_s: (f64, f64)) -> Result<Vec<(f64, String)>> {
    let mut marks = Vec::new();
    let open = File::open(file).map_err(|fault| Error::io("open", file, fault))?;
    for event in event::Reader::new(BufReader::new(open), file) {
        // What slides does so for long: only blows are moments.
        let event::Event::Impact(impact) = event? else { continue };
        if (span_s.0..=span_s.1).contains(&impact.time_s) {
            marks.push((impact.time_s, format!("{} – {}", impact.a, impact.b)));
        }
    }
    Ok(marks)
}

/// A length for a person to read.
pub fn length(length_s: f64) -> String {
    let whole = length_s.round() as u64;
    match length_s {
        s if s < 0.1 => format!("{} ms", axis::number(s * 1e3, 0.01)),
        s if s < 120.0 => format!("{} s", axis::number(s, 0.01)),
        s if s < 3600.0 => format!("{}:{:02} min", whole / 60, whole % 60),
        _ => format!("{}:{:02}:{:02} h", whole / 3600, whole / 60 % 60, whole % 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_are_cut_to_what_there_is() {
        let span = |from_s, to_s| Span { from_s, to_s };
        assert_eq!(span(None, None).within(0.0, 3.0).ok(), Some((0.0, 3.0)));
        assert_eq!(span(Some(1.0), Some(9.0)).within(0.0, 3.0).ok(), Some((1.0, 3.0)));
        assert!(span(Some(3.0), None).within(0.0, 3.0).is_err());
        assert!(span(Some(2.0), Some(1.0)).check().is_err());
        // One event has no length, and is shown.
        assert_eq!(span(None, None).within(2.0, 2.0).ok(), Some((2.0, 2.0)));
    }

    #[test]
    fn lengths_are_told_in_the_unit_that_suits_them() {
        let told = [0.0125, 3.5, 125.0, 3725.0].map(length);
        assert_eq!(told, ["12.50 ms", "3.50 s", "2:05 min", "1:02:05 h"]);
    }
}
