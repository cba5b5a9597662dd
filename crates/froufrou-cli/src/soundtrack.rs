//! What `render` and `mix` share: from lines in channel space to the files of a soundtrack.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use froufrou::render::broadcast::Description;
use froufrou::render::format::SampleFormat;
use froufrou::render::offline::Extent;
use froufrou::render::soundtrack::{self, Output, Summary};
use froufrou::render::timecode::{Origination, Timecode};
use froufrou::score::{ChannelHeader, ChannelLine};
use froufrou::synth::mixer::{Begun, Mixer};
use froufrou::synth::prototypes::Soundings;
use froufrou::synth::receivers;
use froufrou::{Error, Result};
use serde_json::json;

use crate::files;
use crate::progress::Progress;
use crate::reaper;
use crate::usage;

/// Where the soundtrack goes and how.
#[derive(Args, Clone)]
pub struct Options {
    /// The soundtrack to write, WAV or FLAC by its ending; beyond 4 GiB a WAV file is RF64
    #[arg(short, long, value_name = "OUT.wav|OUT.flac")]
    pub output: PathBuf,

    /// Sample rate in hertz, 8000 to 192000
    #[arg(long, value_name = "HZ", value_parser = clap::value_parser!(u32).range(8_000..=192_000))]
    pub rate: Option<u32>,

    /// Render from this time on, in seconds: exactly that part of the whole
    #[arg(long, value_name = "SECONDS", value_parser = seconds, default_value = "0")]
    pub from: f64,

    /// Render up to this time, in seconds
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub to: Option<f64>,

    /// A folder for a soundtrack of each object, in the same format
    #[arg(long, value_name = "DIR")]
    pub stems: Option<PathBuf>,

    /// Sample format: 16 (dithered), 24 or 32f bits; 32f only of WAV
    #[arg(long, value_name = "BITS", default_value = "24", value_parser = sample_format)]
    pub format: SampleFormat,

    /// Gain of everything in decibels
    #[arg(long, value_name = "DB", value_parser = decibels, default_value = "0", allow_negative_numbers = true)]
    pub gain: f64,

    /// Bring the true peak of the mix to this level, -1 dBTP if none is given; stems follow
    #[arg(long, value_name = "DBTP", value_parser = decibels, num_args = 0..=1, default_missing_value = "-1",
          allow_negative_numbers = true, require_equals = true)]
    pub normalize: Option<f64>,

    /// A log of every sound: when, what, where and why, one JSON object a line
    #[arg(long, value_name = "LOG.jsonl")]
    pub log: Option<PathBuf>,

    /// A Reaper project with a track for each stem, the mix beside them and a marker for each sound;
    /// without `--stems` they are put in a folder beside it
    #[arg(long, value_name = "PROJECT.rpp")]
    pub reaper: Option<PathBuf>,

    /// What the soundtrack is, in words, for its `bext` chunk or FLAC tags
    #[arg(long, value_name = "TEXT")]
    pub description: Option<String>,

    /// When time 0 is, since midnight: samples, HH:MM:SS, HH:MM:SS.mmm or HH:MM:SS:FF@RATE
    #[arg(long, value_name = "TIMECODE", value_parser = timecode)]
    pub time_reference: Option<Timecode>,

    /// When it was made, YYYY-MM-DD or YYYY-MM-DDTHH:MM:SS; not told unless it is given
    #[arg(long, value_name = "DATE", value_parser = origination)]
    pub origination: Option<Origination>,

    /// Where a script fails while it plays, let its sound fall silent and go on
    #[arg(long)]
    pub keep_going: bool,

    /// Threads to use; the sound does not depend on it [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,

    /// Report as JSON
    #[arg(long)]
    pub json: bool,
}

fn finite(text: &str, what: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(format!("expected {what}")),
    }
}

pub fn seconds(text: &str) -> Result<f64, String> {
    match finite(text, "a number of seconds")? {
        number if number >= 0.0 => Ok(number),
        _ => Err("expected a number of seconds from 0 on".into()),
    }
}

fn decibels(text: &str) -> Result<f64, String> {
    match finite(text, "a number of decibels")? {
        number if number.abs() <= 200.0 => Ok(number),
        _ => Err("expected a number of decibels from -200 to 200".into()),
    }
}

pub fn sample_format(text: &str) -> Result<SampleFormat, String> {
    text.parse().map_err(|error: Error| error.to_string())
}

fn timecode(text: &str) -> Result<Timecode, String> {
    text.parse().map_err(|error: Error| error.to_string())
}

fn origination(text: &str) -> Result<Origination, String> {
    text.parse().map_err(|error: Error| error.to_string())
}

/// Renders lines to files, with a progress bar and a report. `folder` is that of the score.
pub fn write<L>(
    options: &Options,
    rate_hz: u32,
    header: &ChannelHeader,
    folder: &Path,
    prototypes: Soundings,
    lines: L,
) -> Result<Summary>
where
    L: Iterator<Item = Result<ChannelLine>> + Send,
{
    if options.to.is_some_and(|to| to <= options.from) {
        usage("`--to` must be later than `--from`");
    }
    let channel_names = header.channels();
    let channels = channel_names.len();
    let receivers = receivers::load(header, folder, rate_hz)?;
    let extent = Extent { rate_hz, from_s: options.from, to_s: options.to, duration_s: header.duration_s };
    let mut project = options.reaper.as_deref().map(reaper::Session::new).transpose()?;
    let stems = options.stems.clone().or_else(|| project.as_ref().map(reaper::Session::stems_folder));
    let description = Description {
        text: options.description.clone().unwrap_or_default(),
        origination: options.origination.clone(),
        start: options.time_reference.unwrap_or_default(),
    };
    let output = Output {
        path: options.output.clone(),
        stems,
        samples: options.format,
        seed: header.seed,
        gain_db: options.gain,
        normalize_dbtp: options.normalize,
        channel_names,
        description,
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(options.threads.map_or(0, usize::from)).build();
    let pool = pool.map_err(|fault| Error::new("cannot start threads").because(fault))?;
    let recordings: Vec<(String, String)> = header
        .sounds
        .iter()
        .map(|s| (s.name.clone(), s.make.file().unwrap_or(s.make.kind()).to_owned()))
        .collect();
    let mut log = options.log.as_deref().map(files::Output::create).transpose()?;
    let mut mixer = Mixer::new(rate_hz, receivers, prototypes, lines)?.with_seed(header.seed);
    mixer = mixer.keeping_going(options.keep_going);
    let (first, end) = extent.frames();
    let progress = Progress::new(rate_hz, end.map(|end| end.saturating_sub(first)));
    let summary = pool.install(|| {
        soundtrack::write(
            &mut mixer,
            channels,
            &extent,
            &output,
            &mut |frames| progress.at(frames),
            &mut |begun| {
                if let Some(project) = &mut project {
                    project.mark(begun);
                }
                log.as_mut().map_or(Ok(()), |log| log_line(log, begun, &recordings))
            },
        )
    })?;
    drop(progress);
    log.map_or(Ok(()), files::Output::finish)?;
    for fault in &summary.faults {
        eprintln!("froufrou: warning: a sound fell silent: {fault}");
    }
    if summary.silenced > summary.faults.len() as u64 {
        let more = summary.silenced - summary.faults.len() as u64;
        eprintln!("froufrou: warning: {more} more sounds fell silent");
    }
    if let Some(project) = project {
        let start = options.time_reference.unwrap_or_default().samples(rate_hz).saturating_add(first);
        project.write(&options.output, &summary, rate_hz, channels, first, start)?;
    }
    report(options, rate_hz, channels, &summary)?;
    Ok(summary)
}

/// One line of the log: which cause made which sound.
fn log_line(log: &mut files::Output, begun: &Begun, recordings: &[(String, String)]) -> Result<()> {
    let recording = recordings.iter().find(|(name, _)| *name == begun.start.sound).map(|(_, file)| file);
    let line = json!({
        "thread": begun.thread,
        "time_s": begun.time_s,
        "arrival_s": begun.arrival_s,
        "object": begun.start.object,
        "cause": begun.start.cause,
        "sound": begun.start.sound,
        "recording": recording,
        "speed": begun.start.speed,
        "gain": begun.gain,
    });
    writeln!(log, "{line}").map_err(|fault| Error::io("write", "the log", fault))
}

fn report(options: &Options, rate_hz: u32, channels: usize, summary: &Summary) -> Result<()> {
    let mut text = String::new();
    let seconds = summary.report.frames as f64 / f64::from(rate_hz);
    if options.json {
        let stems: Vec<_> =
            summary.stems.iter().map(|(object, path)| json!({ "object": object, "file": path })).collect();
        let report = json!({
            "file": options.output,
            "rate_hz": rate_hz,
            "channels": channels,
            "duration_s": seconds,
            "sounds": summary.threads,
            "gain_db": summary.gain_db,
            "clipped_samples": summary.clipped,
            "silenced_sounds": summary.silenced,
            "measured": summary.report,
            "stems": stems,
        });
        text = format!("{report}\n");
    } else {
        let sounds =
            if summary.threads == 1 { "1 sound".into() } else { format!("{} sounds", summary.threads) };
        text += &format!("{}: {seconds:.2} s, {sounds}, {}\n", options.output.display(), summary.report);
        for (object, path) in &summary.stems {
            let object = if object.is_empty() { "no object" } else { object };
            text += &format!("  {}: {object}\n", path.display());
        }
    }
    if summary.clipped > 0 {
        let over = summary.report.peak_dbfs.unwrap_or(0.0);
        eprintln!(
            "froufrou: warning: {} samples were too loud and are clipped; use `--normalize`, `--gain {:.1}` or `--format 32f`",
            summary.clipped,
            summary.gain_db - over - 0.1
        );
    }
    // Not by `println!`, which panics where nobody reads.
    let mut output = std::io::stdout().lock();
    let written = output.write_all(text.as_bytes()).and_then(|()| output.flush());
    written.map_err(|fault| Error::io("write", "standard output", fault))
}
