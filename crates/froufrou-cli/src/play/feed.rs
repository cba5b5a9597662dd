//! A scene in which another program tells what happens, one JSON object a line.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use clap::Args;
use froufrou::render::format::{SampleFormat, SoundFormat};
use froufrou::render::labels::Labels;
use froufrou::render::live::lines::{Line, Lines};
use froufrou::render::live::{self, Capture, EngineSettings, Handle, Left, Refused};
use froufrou::render::sound_file::{Container, SoundWriter};
use froufrou::scene::Scene;
use froufrou::{Error, Place, Result};

use super::Play;
use crate::soundtrack::{sample_format, seconds};

/// What is told before time first goes on says what moves; of so many lines at most.
const MOST_OPENING: usize = 4096;
/// So many faults are told; then they are counted.
const MOST_FAULTS: u64 = 10;
/// There is to be room for what one line tells.
const ROOM: usize = 8;
/// Where nothing is told time goes on in steps of no more than this, in seconds.
const LONGEST_STEP_S: f64 = 0.5;
/// Behind the stream's end time goes on in such steps, in seconds,
const REST_STEP_S: f64 = 0.01;
/// until nothing has been louder than this
const SILENCE: f32 = 1e-5;
/// for so long, in seconds.
const SILENT_S: f64 = 0.5;
/// The end of a file is faded out over so long, in seconds.
const FADE_S: f64 = 0.01;

/// What is told, and what becomes of it.
#[derive(Args)]
pub struct FeedOptions {
    /// Play what another program says that happens, one JSON object a line (docs/live.md): a file, or - for standard input
    #[arg(long, value_name = "FILE")]
    feed: Option<PathBuf>,

    /// An object that the feed moves; not needed for what it moves before its first `advance`
    #[arg(long = "moves", value_name = "OBJECT", requires = "feed")]
    moves: Vec<String>,

    /// The feed moves the listener; not needed where it does so before its first `advance`
    #[arg(long, requires = "feed")]
    moves_listener: bool,

    /// The step of the simulation whose contacts are told, in seconds
    #[arg(long, value_name = "SECONDS", default_value = "0.016666666666666666", value_parser = seconds)]
    step: f64,

    /// How far apart two `advance` of the feed may be, in seconds: sound is so much later
    #[arg(long, value_name = "SECONDS", default_value = "0.05", value_parser = seconds)]
    ahead: f64,

    /// Behind the end of the feed go on until all is silent, but no longer than this, in seconds
    #[arg(long, value_name = "SECONDS", default_value = "3", value_parser = seconds)]
    rest: f64,

    /// Write a file instead of playing, as fast as can be
    #[arg(short, long, value_name = "OUT.wav|OUT.flac", requires = "feed")]
    output: Option<PathBuf>,

    /// The file's sample format: 16 (dithered), 24 or 32f bits; 32f only of WAV
    #[arg(long, value_name = "BITS", default_value = "24", value_parser = sample_format)]
    format: SampleFormat,
}

impl FeedOptions {
    /// The feed, if there is one.
    #[cfg(feature = "device")]
    pub fn input(&self) -> Option<&Path> {
        self.feed.as_deref()
    }

    /// The feed and the file that is made of it, if one is.
    pub fn file(&self) -> Option<(&Path, &Path)> {
        self.feed.as_deref().zip(self.output.as_deref())
    }
}

/// Lines as they come, and where they were read.
type Read = (Place, Result<Line>);

/// A feed that has been read up to where time first goes on.
struct Feed {
    name: PathBuf,
    lines: Lines<Box<dyn BufRead + Send>>,
    opening: Vec<Read>,
    /// Lines that were left out.
    faults: u64,
}

impl Feed {
    fn open(path: &Path) -> Result<Self> {
        let (name, reader): (_, Box<dyn BufRead + Send>) = if path == Path::new("-") {
            (Path::new("<stdin>"), Box::new(BufReader::new(std::io::stdin())))
        } else {
            let file = File::open(path).map_err(|fault| Error::io("open", path, fault))?;
            (path, Box::new(BufReader::new(file)))
        };
        let (lines, opening) = (Lines::new(reader, name), Vec::new());
        let mut feed = Self { name: name.to_owned(), lines, opening, faults: 0 };
        while feed.opening.len() < MOST_OPENING {
            let Some(read) = feed.read() else { break };
            let goes_on = matches!(read.1, Ok(Line::Advance(_)));
            feed.opening.push(read);
            if goes_on {
                break;
            }
        }
        Ok(feed)
    }

    fn read(&mut self) -> Option<Read> {
        let line = self.lines.next()?;
        Some((self.lines.place(), line))
    }

    /// How an engine is to run that is told this.
    fn settings(&self, play: &Play, scene: &Scene, rate_hz: u32) -> EngineSettings {
        let told = self.opening.iter().filter_map(|(_, line)| line.as_ref().ok());
        // What the scene does not have is a fault of that line.
        let is_there = |name: &&String| scene.objects.iter().any(|object| object.name == **name);
        let named = told.clone().filter_map(|line| match line {
            Line::Object { name, .. } => Some(name).filter(is_there),
            _ => None,
        });
        let meshes = told.clone().filter_map(|line| match line {
            Line::Mesh { name, .. } => Some(name).filter(is_there),
            _ => None,
        });
        let [movers, meshes] =
            [named.chain(&play.feed.moves).collect(), meshes.collect()].map(|mut names: Vec<&String>| {
                names.sort();
                names.dedup();
                names.into_iter().cloned().collect::<Vec<_>>()
            });
        EngineSettings {
            rate_hz,
            contact_step_s: play.feed.step,
            ahead_s: play.feed.ahead,
            movers,
            meshes,
            moves_listener: play.feed.moves_listener
                || told.clone().any(|line| matches!(line, Line::Listener { .. })),
            ..EngineSettings::default()
        }
    }

    fn fault(&mut self, fault: &Error) {
        self.faults += 1;
        match self.faults {
            1..=MOST_FAULTS => eprintln!("froufrou: {fault}"),
            n if n == MOST_FAULTS + 1 => eprintln!("froufrou: and more, which are counted"),
            _ => {}
        }
    }
}

/// Who hears it.
trait Ear {
    /// Waits until a handle has room for a line, where whoever tells can wait.
    fn make_room(&mut self, handle: &Handle) -> Result<()>;

    /// Waits until time is to go on to this, in seconds, where whoever tells can wait.
    fn await_time(&mut self, handle: &Handle, time_s: f64);

    /// Hears what there is.
    fn hear(&mut self, handle: &Handle) -> Result<()>;

    /// Nobody tells any more: from now on there is time to wait.
    fn calm_down(&mut self);
}

/// Lets time go on to one that is told, in steps where no contact was told since. Gives why it cannot.
fn go_on(
    handle: &mut Handle,
    ear: &mut impl Ear,
    [from_s, contact_s, to_s]: [f64; 3],
) -> Result<Option<Refused>> {
    let steps = ((to_s - from_s) / LONGEST_STEP_S).ceil().clamp(1.0, 1e9) as u64;
    let between =
        (1..steps).map(|n| from_s + n as f64 * LONGEST_STEP_S).filter(|time_s| *time_s >= contact_s);
    for time_s in between.chain([to_s]) {
        ear.await_time(handle, time_s);
        if let Err(why) = handle.advance(time_s) {
            return Ok(Some(why));
        }
        ear.hear(handle)?;
        if !handle.is_running() {
            break;
        }
    }
    Ok(None)
}

/// Tells an engine all lines, and then that time goes on until all is silent.
fn tell(mut feed: Feed, handle: &mut Handle, ear: &mut impl Ear, rest_s: f64, rate_hz: f64) -> Result<Feed> {
    let mut opening = std::mem::take(&mut feed.opening).into_iter();
    let (mut told_s, mut contact_s, mut time_s) = (0.0f64, 0.0f64, 0.0f64);
    while handle.is_running() {
        let Some((place, line)) = opening.next().or_else(|| feed.read()) else { break };
        ear.make_room(handle)?;
        let fault = match &line {
            Ok(Line::Advance(to_s)) => match go_on(handle, ear, [time_s, contact_s, *to_s])? {
                Some(why) => Some(why.fault()),
                None => {
                    time_s = *to_s;
                    None
                }
            },
            Ok(line) => match line.tell(handle) {
                Ok(()) => {
                    told_s = told_s.max(line.time_s());
                    if let Line::Contact { row, .. } = line {
                        contact_s = row.time_s;
                    }
                    None
                }
                Err(fault) => Some(fault),
            },
            Err(_) => line.err(),
        };
        if let Some(fault) = fault {
            feed.fault(&fault.in_file(feed.name.clone()).at(place));
        }
    }
    if time_s < told_s {
        eprintln!("froufrou: the feed ends {:.3} s behind its last `advance`", told_s - time_s);
    }
    ear.calm_down();
    let end_s = told_s.max(time_s);
    let (mut now_s, mut loud_s) = (end_s, end_s);
    while handle.is_running() {
        if let Some(why) = go_on(handle, ear, [now_s - REST_STEP_S, contact_s, now_s])? {
            return Err(why.fault());
        }
        let statistics = handle.statistics();
        let played_s = statistics.played_frame as f64 / rate_hz;
        if statistics.peak > SILENCE {
            loud_s = loud_s.max(played_s);
        }
        if played_s > (loud_s + SILENT_S).min(end_s + rest_s) {
            break;
        }
        now_s += REST_STEP_S;
    }
    match handle.take_fault() {
        Some(fault) if !handle.is_running() => Err(fault),
        Some(fault) => {
            eprintln!("froufrou: {fault}");
            Ok(feed)
        }
        None => Ok(feed),
    }
}

/// What was left out, and what the audio thread says.
fn report(feed: &Feed, handle: &Handle, rate_hz: f64) {
    let Left { not_finite, earlier, full, unknown, ahead } = handle.left_out();
    let reasons = [
        (not_finite, "with numbers that are none"),
        (earlier, "earlier than what was told before"),
        (full, "for which there was no room"),
        (unknown, "of what is not there"),
        (ahead, "more than a second ahead of the last `advance`"),
    ];
    if feed.faults > 0 {
        let counted: u64 = reasons.iter().map(|(count, _)| count).sum();
        let unread = (feed.faults.saturating_sub(counted), "that could not be read");
        let all = reasons.iter().chain([&unread]).filter(|(count, _)| *count > 0);
        let all: Vec<String> = all.map(|(count, why)| format!("{count} {why}")).collect();
        eprintln!("{} lines were left out: {}", feed.faults, all.join(", "));
    }
    let statistics = handle.statistics();
    if statistics.skipped_frames > 0 {
        let skipped_s = statistics.skipped_frames as f64 / rate_hz;
        eprintln!("{skipped_s:.2} s were left out, because they were told faster than time passes");
    }
    super::report(&statistics, rate_hz);
}

/// A file that is written as fast as can be.
struct Writing {
    capture: Capture,
    writer: SoundWriter,
    /// The last frames, which may have to fade.
    last: Vec<f32>,
    kept: usize,
}

impl Writing {
    fn finish(mut self) -> Result<()> {
        let channels = self.capture.channels();
        let frames = (self.last.len() / channels).max(1) as f32;
        for (n, frame) in self.last.chunks_exact_mut(channels).enumerate() {
            frame.iter_mut().for_each(|sample| *sample *= 1.0 - (n + 1) as f32 / frames);
        }
        self.writer.write(&self.last)?;
        self.writer.finish().map(|_| ())
    }
}

impl Ear for Writing {
    fn make_room(&mut self, handle: &Handle) -> Result<()> {
        if handle.room() < ROOM { self.hear(handle) } else { Ok(()) }
    }

    fn await_time(&mut self, _: &Handle, _: f64) {}

    fn calm_down(&mut self) {}

    fn hear(&mut self, handle: &Handle) -> Result<()> {
        let Self { capture, writer, last, kept } = self;
        capture.take(handle, |frames| {
            last.extend_from_slice(frames);
            let ready = last.len().saturating_sub(*kept);
            writer.write(&last[..ready])?;
            last.drain(..ready);
            Ok(())
        })
    }
}

/// Writes what a feed tells into a file.
///
/// # Errors
/// A scene, feed or file that cannot be.
pub fn to_file(play: &Play, input: &Path, output: &Path) -> Result<()> {
    let container = Container::of(output)?;
    let feed = Feed::open(input)?;
    let scene = play.scene.open()?;
    let (rate_hz, seed) = (play.rate.unwrap_or(scene.rate_hz), scene.seed);
    let settings = Capture::unhurried(feed.settings(play, &scene, rate_hz));
    let (mut handle, player) = live::start(scene, settings)?;
    let channels = player.channels();
    let format = SoundFormat { rate_hz, channels, samples: play.feed.format, seed, first_frame: 0 };
    let writer = SoundWriter::create(container, output, format, Labels::default())?;
    let kept = (FADE_S * f64::from(rate_hz)) as usize * channels;
    let mut ear = Writing { capture: Capture::new(player), writer, last: Vec::new(), kept };
    let feed = tell(feed, &mut handle, &mut ear, play.feed.rest, f64::from(rate_hz))?;
    ear.finish()?;
    report(&feed, &handle, f64::from(rate_hz));
    Ok(())
}

#[cfg(feature = "device")]
pub use at_device::on_device;

#[cfg(feature = "device")]
mod at_device {
    use std::time::{Duration, Instant};

    use froufrou::render::live::{Player, deck};

    use super::super::device::Output;
    use super::super::speaker::{LAST, LOOK_FOR_DEVICE, Speaker};
    use super::*;

    /// Whoever waits looks again after so long.
    const NAP: Duration = Duration::from_millis(1);

    /// A device. What comes from a file waits for it; what happens while it is told does not.
    struct Listening {
        waits: bool,
        rate_hz: f64,
        /// How far time may be ahead of what is played, in seconds.
        lead_s: f64,
    }

    impl Ear for Listening {
        fn make_room(&mut self, handle: &Handle) -> Result<()> {
            while self.waits && handle.room() < ROOM && handle.is_running() {
                std::thread::sleep(NAP);
            }
            Ok(())
        }

        fn await_time(&mut self, handle: &Handle, time_s: f64) {
            let played_s = || handle.statistics().played_frame as f64 / self.rate_hz;
            while self.waits && time_s - played_s() > self.lead_s && handle.is_running() {
                std::thread::sleep(NAP);
            }
        }

        fn hear(&mut self, _: &Handle) -> Result<()> {
            Ok(())
        }

        fn calm_down(&mut self) {
            self.waits = true;
        }
    }

    /// Starts an engine at the rate of a device that can play what it makes.
    fn start(play: &Play, feed: &Feed) -> Result<(Handle, Player, Output)> {
        let mut rate_hz = play.rate;
        loop {
            let scene = play.scene.open()?;
            let asked_hz = rate_hz.unwrap_or(scene.rate_hz);
            let settings = feed.settings(play, &scene, asked_hz);
            let (handle, player) = live::start(scene, settings)?;
            let options = &play.device;
            let output = Output::find(options.device.clone(), player.channels(), asked_hz, options.block)?;
            if output.rate_hz() == asked_hz {
                return Ok((handle, player, output));
            }
            rate_hz = Some(output.rate_hz());
        }
    }

    /// Plays what a feed tells.
    ///
    /// # Errors
    /// A scene, feed or device that cannot be.
    pub fn on_device(play: &Play, input: &Path) -> Result<()> {
        let feed = Feed::open(input)?;
        let (mut handle, player, output) = start(play, &feed)?;
        let (rate_hz, channels) = (f64::from(output.rate_hz()), player.channels());
        eprintln!("{}, {rate_hz} Hz, {channels} channels", output.name());
        let (deck, mut changer) = deck::new(channels);
        if changer.play(player).is_err() {
            return Err(Error::new("what plays has failed"));
        }
        let mut speaker = Speaker::new(output, deck);
        speaker.begin()?;
        let waits = input != Path::new("-");
        let lead_s = handle.latency().all_s + 0.5 * play.feed.ahead;
        let mut ear = Listening { waits, rate_hz, lead_s };
        let rest_s = play.feed.rest;
        let told = std::thread::spawn(move || {
            let told = tell(feed, &mut handle, &mut ear, rest_s, rate_hz);
            (told, handle)
        });
        let mut looked = Instant::now();
        while !told.is_finished() {
            std::thread::sleep(Duration::from_millis(20));
            if looked.elapsed() >= LOOK_FOR_DEVICE {
                looked = Instant::now();
                if let Some(said) = speaker.look_after() {
                    eprintln!("{said}");
                }
            }
        }
        // What is not silent fades before the engine goes.
        changer.pause(true);
        std::thread::sleep(LAST);
        let hiccups = speaker.hiccups();
        drop(speaker);
        let Ok((feed, handle)) = told.join() else { return Err(Error::new("playing has failed")) };
        report(&feed?, &handle, rate_hz);
        if hiccups > 0 {
            eprintln!("{hiccups} times the device had nothing to play in time");
        }
        Ok(())
    }
}
