//! A scene in which another program tells what happens, one JSON object a line.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use clap::Args;
use froufrou::render::format::{SampleFormat, SoundFormat};
use froufrou::render::labels::Labels;
use froufrou::render::live::lines::{Line, Lines};
use froufrou::render::live::{self, Capture, EngineSettings, Handle, Left, Player, Refused};
use froufrou::render::sound_file::{Container, SoundWriter};
use froufrou::scene::Scene;
use froufrou::scene::world::World;
use froufrou::score::LATEST_S;
use froufrou::{Error, Place, Result};

use super::Play;
use crate::soundtrack::{sample_format, seconds};

/// What is told before time first goes on says what moves; of so many lines at most.
const MOST_OPENING: usize = 4096;
/// So many faults are told; then they are counted.
const MOST_FAULTS: u64 = 10;
/// What happens is no further ahead of the last `advance`, in seconds: more is a mistake, such as milliseconds or a clock's date.
const LONGEST_LEAP_S: f64 = 3600.0;
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
    #[arg(long, value_name = "SECONDS", default_value = "0.016666666666666666", value_parser = seconds,
          requires = "feed")]
    step: f64,

    /// How far apart two `advance` of the feed may be, in seconds: sound is so much later
    #[cfg(feature = "device")]
    #[arg(long, value_name = "SECONDS", default_value = "0.05", value_parser = seconds, requires = "feed",
          conflicts_with = "output")]
    ahead: f64,

    /// Behind the end of the feed go on until all is silent, but no longer than this, in seconds
    #[arg(long, value_name = "SECONDS", default_value = "3", value_parser = seconds, requires = "feed")]
    rest: f64,

    /// Write a file instead of playing, as fast as can be
    #[arg(short, long, value_name = "OUT.wav|OUT.flac", requires = "feed")]
    output: Option<PathBuf>,

    /// The file's sample format: 16 (dithered), 24 or 32f bits; 32f only of WAV
    #[arg(long, value_name = "BITS", default_value = "24", value_parser = sample_format, requires = "output")]
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
    moves_listener: bool,
    /// Lines that were left out, and those of them that were too far ahead.
    faults: u64,
    leaps: u64,
    met: Met,
}

/// An object that is told to move, and the line that says so first.
struct Moved<'a> {
    name: &'a str,
    has_mesh: bool,
    place: Option<&'a Place>,
}

impl Feed {
    fn open(path: &Path, options: &FeedOptions) -> Result<Self> {
        let (name, reader): (_, Box<dyn BufRead + Send>) = if path == Path::new("-") {
            (Path::new("<stdin>"), Box::new(BufReader::new(std::io::stdin())))
        } else {
            let file = File::open(path).map_err(|fault| Error::io("open", path, fault))?;
            (path, Box::new(BufReader::new(file)))
        };
        let mut feed = Self {
            name: name.to_owned(),
            lines: Lines::new(reader, name),
            opening: Vec::new(),
            moves_listener: options.moves_listener,
            faults: 0,
            leaps: 0,
            met: Met::default(),
        };
        while feed.opening.len() < MOST_OPENING {
            let Some(read) = feed.read() else { break };
            let goes_on = matches!(read.1, Ok(Line::Advance(_)));
            feed.moves_listener |= matches!(read.1, Ok(Line::Listener { .. }));
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

    /// The objects that are told to move, each once.
    fn movers<'a>(&'a self, play: &'a Play, scene: &Scene) -> Vec<Moved<'a>> {
        let told = self.opening.iter().filter_map(|(place, line)| match line {
            Ok(Line::Object { name, .. }) => Some(Moved { name, has_mesh: false, place: Some(place) }),
            Ok(Line::Mesh { name, .. }) => Some(Moved { name, has_mesh: true, place: Some(place) }),
            _ => None,
        });
        // What the scene does not have is a fault of that line.
        let told = told.filter(|moved| scene.objects.iter().any(|object| object.name == moved.name));
        let named = play.feed.moves.iter().map(|name| Moved { name, has_mesh: false, place: None });
        let mut movers: Vec<Moved<'_>> = told.chain(named).collect();
        movers.sort_by_key(|moved| (moved.name, !moved.has_mesh));
        movers.dedup_by_key(|moved| moved.name);
        movers
    }

    /// How an engine is to run that is told this.
    fn settings(&self, play: &Play, scene: &Scene, rate_hz: u32) -> EngineSettings {
        let (meshes, movers): (Vec<_>, Vec<_>) =
            self.movers(play, scene).into_iter().partition(|moved| moved.has_mesh);
        let names = |moved: Vec<Moved<'_>>| moved.iter().map(|moved| moved.name.to_owned()).collect();
        EngineSettings {
            rate_hz,
            contact_step_s: play.feed.step,
            #[cfg(feature = "device")]
            ahead_s: play.feed.ahead,
            movers: names(movers),
            meshes: names(meshes),
            moves_listener: self.moves_listener,
            ..EngineSettings::default()
        }
    }

    /// Starts an engine that is told this.
    ///
    /// # Errors
    /// As [`live::start`]; where an object cannot be told what is told of it, its name and the line.
    fn start(&self, play: &Play, scene: Scene, settings: EngineSettings) -> Result<(Handle, Player)> {
        let key_step_s = settings.key_step_s;
        live::start(scene, settings).map_err(|fault| self.blamed(play, key_step_s).unwrap_or(fault))
    }

    /// Why an engine cannot be started, if it is for an object that is told to move.
    fn blamed(&self, play: &Play, key_step_s: f64) -> Option<Error> {
        let scene = play.scene.open().ok()?;
        let mut world = World::open(&scene).ok()?;
        self.movers(play, &scene).into_iter().find_map(|Moved { name, has_mesh, place }| {
            let index = scene.objects.iter().position(|object| object.name == name)?;
            let why = world.feed_object(index, key_step_s, has_mesh).err()?;
            let fault = Error::new(format!("object `{name}`: {why}")).because(why);
            Some(match place {
                Some(place) => fault.in_file(&self.name).at(place.clone()),
                None => fault,
            })
        })
    }

    /// What is to be done about a line that tells of what does not move.
    fn help(&self, line: &Line, handle: &Handle) -> Option<String> {
        let otherwise = match line {
            Line::Object { name, .. } if handle.object(name).is_none() => ", or named by `--moves`",
            Line::Mesh { name, .. } if handle.object(name).is_none() => "",
            Line::Listener { .. } if !self.moves_listener => ", or said by `--moves-listener`",
            _ => return None,
        };
        let opening = format!("within the first {MOST_OPENING} lines and before the first `advance`");
        Some(format!("what moves is told {opening}{otherwise}"))
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

/// Faults that an engine has met and goes on after: the first of each kind is told, and all are counted.
#[derive(Default)]
struct Met {
    told: BTreeSet<String>,
    count: u64,
    last: Option<Error>,
}

impl Met {
    /// Looks whether an engine has met some. It keeps a few until somebody looks.
    fn look(&mut self, handle: &mut Handle) {
        while let Some(fault) = handle.take_fault() {
            self.fault(fault);
        }
    }

    fn fault(&mut self, fault: Error) {
        self.count += 1;
        let text = fault.to_string();
        if (self.told.len() as u64) < MOST_FAULTS && !self.told.contains(&text) {
            eprintln!("froufrou: {text}");
            self.told.insert(text);
        }
        self.last = Some(fault);
    }
}

/// Why nothing can happen at a time after another, or so late, if it cannot.
fn leap(from_s: f64, to_s: f64, latest_s: f64) -> Option<Error> {
    let help = "times are seconds since what happens began";
    if to_s > latest_s {
        let what = format!("{to_s} s is too late, {latest_s} s is the latest");
        return Some(Error::new(what).help(help));
    }
    (to_s - from_s > LONGEST_LEAP_S).then(|| {
        let what =
            format!("{to_s} s is more than {LONGEST_LEAP_S} s ahead of the last `advance`, at {from_s} s");
        Error::new(what).help(help)
    })
}

/// Who hears it.
trait Ear {
    /// Waits until a handle has room for a line, where whoever tells can wait.
    fn make_room(&mut self, handle: &mut Handle) -> Result<()>;

    /// Waits until time is to go on to this, in seconds, where whoever tells can wait.
    fn await_time(&mut self, handle: &Handle, time_s: f64);

    /// Hears what there is.
    fn hear(&mut self, handle: &mut Handle) -> Result<()>;

    /// Nobody tells any more: from now on there is time to wait.
    fn calm_down(&mut self);

    /// Whether who tells cannot wait: time goes on as it is told, by whatever clock.
    fn is_live(&self) -> bool {
        false
    }
}

/// What is played, by the clock of who tells, in seconds.
fn played_s(handle: &Handle, rate_hz: f64) -> f64 {
    handle.statistics().played_frame as f64 / rate_hz + handle.skipped_s()
}

/// Lets time go on to one that is told, in steps where no contact was told since. Gives why it cannot.
fn go_on(
    handle: &mut Handle,
    ear: &mut impl Ear,
    met: &mut Met,
    [from_s, contact_s, to_s]: [f64; 3],
) -> Result<Option<Refused>> {
    let steps = if ear.is_live() { 1 } else { ((to_s - from_s) / LONGEST_STEP_S).ceil().max(1.0) as u64 };
    let between =
        (1..steps).map(|n| from_s + n as f64 * LONGEST_STEP_S).filter(|time_s| *time_s >= contact_s);
    for time_s in between.chain([to_s]) {
        ear.await_time(handle, time_s);
        if let Err(why) = handle.advance(time_s) {
            return Ok(Some(why));
        }
        ear.hear(handle)?;
        met.look(handle);
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
    let mut has_begun = false;
    while handle.is_running() {
        let Some((place, line)) = opening.next().or_else(|| feed.read()) else { break };
        ear.make_room(handle)?;
        let begins = ear.is_live() && !has_begun;
        let latest_s = LATEST_S + handle.skipped_s();
        let checked = line.as_ref().ok().filter(|_| !begins);
        let leap = checked.and_then(|line| leap(time_s, line.time_s(), latest_s));
        feed.leaps += u64::from(leap.is_some());
        let fault = match &line {
            Ok(_) if leap.is_some() => leap,
            Ok(Line::Advance(to_s)) => match go_on(handle, ear, &mut feed.met, [time_s, contact_s, *to_s])? {
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
                Err(fault) => Some(match feed.help(line, handle) {
                    Some(help) => fault.help(help),
                    None => fault,
                }),
            },
            Err(_) => None,
        };
        match (fault, line) {
            (None, Err(fault)) | (Some(fault), _) => feed.fault(&fault.in_file(feed.name.clone()).at(place)),
            (None, Ok(line)) if begins => (has_begun, time_s) = (true, time_s.max(line.time_s())),
            _ => {}
        }
        feed.met.look(handle);
    }
    if time_s < told_s {
        eprintln!("froufrou: the feed ends {:.3} s behind its last `advance`", told_s - time_s);
    }
    ear.calm_down();
    let end_s = told_s.max(time_s);
    let (mut now_s, mut loud_s) = (end_s, end_s);
    while handle.is_running() {
        if let Some(why) = go_on(handle, ear, &mut feed.met, [now_s - REST_STEP_S, contact_s, now_s])? {
            return Err(why.fault());
        }
        let played_s = played_s(handle, rate_hz);
        if handle.statistics().peak > SILENCE {
            loud_s = loud_s.max(played_s);
        }
        if played_s > (loud_s + SILENT_S).min(end_s + rest_s) {
            break;
        }
        now_s += REST_STEP_S;
    }
    // What ends an engine is the last that it tells.
    if !handle.is_running() {
        let last = handle.take_fault().or(feed.met.last);
        return Err(last.unwrap_or_else(|| Error::new("what plays has failed")));
    }
    Ok(feed)
}

/// Says what was left out, and which faults there were.
fn report(feed: &Feed, handle: &Handle) {
    let Left { not_finite, earlier, full, unknown, ahead } = handle.left_out();
    let reasons = [
        (not_finite, "with numbers that are none"),
        (earlier, "earlier than what was told before"),
        (full, "for which there was no room"),
        (unknown, "of what is not there"),
        (ahead, "more than a second ahead of the last `advance`"),
        (feed.leaps, "at times that cannot be"),
    ];
    if feed.faults > 0 {
        let counted: u64 = reasons.iter().map(|(count, _)| count).sum();
        let unread = (feed.faults.saturating_sub(counted), "that could not be read");
        let all = reasons.iter().chain([&unread]).filter(|(count, _)| *count > 0);
        let all: Vec<String> = all.map(|(count, why)| format!("{count} {why}")).collect();
        eprintln!("{} lines were left out: {}", feed.faults, all.join(", "));
    }
    let Met { told, count, .. } = &feed.met;
    if *count > told.len() as u64 {
        eprintln!("at least {count} faults while it sounded, of which the first of each kind was told");
    }
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
    fn make_room(&mut self, handle: &mut Handle) -> Result<()> {
        if handle.room() < ROOM { self.hear(handle) } else { Ok(()) }
    }

    fn await_time(&mut self, _: &Handle, _: f64) {}

    fn calm_down(&mut self) {}

    fn hear(&mut self, handle: &mut Handle) -> Result<()> {
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
    let feed = Feed::open(input, &play.feed)?;
    let scene = play.scene.open()?;
    let (rate_hz, seed) = (play.rate.unwrap_or(scene.rate_hz), scene.seed);
    let settings = Capture::unhurried(feed.settings(play, &scene, rate_hz));
    let (mut handle, player) = feed.start(play, scene, settings)?;
    let channels = player.channels();
    let format = SoundFormat { rate_hz, channels, samples: play.feed.format, seed, first_frame: 0 };
    let writer = SoundWriter::create(container, output, format, Labels::default())?;
    let kept = (FADE_S * f64::from(rate_hz)) as usize * channels;
    let mut ear = Writing { capture: Capture::new(player), writer, last: Vec::new(), kept };
    let feed = tell(feed, &mut handle, &mut ear, play.feed.rest, f64::from(rate_hz))?;
    ear.finish()?;
    report(&feed, &handle);
    super::report_limited(&handle.statistics());
    Ok(())
}

#[cfg(feature = "device")]
pub use at_device::on_device;

#[cfg(feature = "device")]
mod at_device {
    use std::time::{Duration, Instant};

    use froufrou::render::live::deck;

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
        fn make_room(&mut self, handle: &mut Handle) -> Result<()> {
            while self.waits && handle.room() < ROOM && handle.is_running() {
                std::thread::sleep(NAP);
            }
            Ok(())
        }

        fn await_time(&mut self, handle: &Handle, time_s: f64) {
            while self.waits && time_s - played_s(handle, self.rate_hz) > self.lead_s && handle.is_running() {
                std::thread::sleep(NAP);
            }
        }

        fn hear(&mut self, _: &mut Handle) -> Result<()> {
            Ok(())
        }

        fn calm_down(&mut self) {
            self.waits = true;
        }

        fn is_live(&self) -> bool {
            !self.waits
        }
    }

    /// Starts an engine at the rate of a device that can play what it makes.
    fn start(play: &Play, feed: &Feed) -> Result<(Handle, Player, Output)> {
        let mut rate_hz = play.rate;
        loop {
            let scene = play.scene.open()?;
            let asked_hz = rate_hz.unwrap_or(scene.rate_hz);
            let settings = feed.settings(play, &scene, asked_hz);
            let (handle, player) = feed.start(play, scene, settings)?;
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
        let feed = Feed::open(input, &play.feed)?;
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
        report(&feed?, &handle);
        let statistics = handle.statistics();
        if statistics.skipped_frames > 0 {
            let skipped_s = statistics.skipped_frames as f64 / rate_hz;
            eprintln!("{skipped_s:.2} s were left out, because they were told faster than time passes");
        }
        super::super::report(&statistics, rate_hz);
        if hiccups > 0 {
            eprintln!("{hiccups} times the device had nothing to play in time");
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        play: Play,
    }

    /// Who hears what is told, as it is told by any clock or from the beginning on.
    struct Hearing {
        capture: Capture,
        is_live: bool,
        /// The first frame that is heard, of those that there are.
        first: Option<usize>,
        frames: usize,
    }

    impl Ear for Hearing {
        fn make_room(&mut self, _: &mut Handle) -> Result<()> {
            Ok(())
        }

        fn await_time(&mut self, _: &Handle, _: f64) {}

        fn hear(&mut self, handle: &mut Handle) -> Result<()> {
            let Self { capture, first, frames, .. } = self;
            let channels = capture.channels();
            capture.take(handle, |piece| {
                let loud = piece.iter().position(|sample| sample.abs() > 1e-6);
                *first = first.or(loud.map(|at| *frames + at / channels));
                *frames += piece.len() / channels;
                Ok(())
            })
        }

        fn calm_down(&mut self) {}

        fn is_live(&self) -> bool {
            self.is_live
        }
    }

    /// A stone slides from half a second behind the first time on. Gives how many lines were left out, the first frame that is
    /// heard, and how many there are.
    fn slid(begin_s: f64, is_live: bool) -> (u64, Option<usize>, usize) {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let scene = file(
            "scene.toml",
            "[listener]\nposition = [0, 1, 1]\nlayout = 'mono'\n[instrument]\nsqueak = { kind = 'stick-slip' }\n\
             [material.stone]\nslide = { instrument = 'squeak' }\n[[object]]\nname = 'stone'\nmaterial = 'stone'\n",
        );
        let mut text = format!("{{\"advance\":{begin_s}}}\n");
        for frame in 1..=60u32 {
            let time_s = begin_s + f64::from(frame) / 60.0;
            let contact = "\"contact\":[\"stone\",\"floor\"],\"force\":5,\"normal\":[0,1,0],\"sliding\":0.4";
            if frame > 30 {
                let x = 0.4 * f64::from(frame) / 60.0;
                text += &format!("{{\"t\":{time_s},{contact},\"position\":[{x},0,0]}}\n");
            }
            text += &format!("{{\"advance\":{time_s}}}\n");
        }
        let feed = file("feed.jsonl", &text);
        let line = ["play".as_ref(), scene.as_os_str(), "--feed".as_ref(), feed.as_os_str()];
        let Command { play } = Command::parse_from(line);
        let scene = play.scene.open().unwrap();
        let feed = Feed::open(&feed, &play.feed).unwrap();
        let settings = Capture::unhurried(feed.settings(&play, &scene, 48_000));
        let begins_s = settings.begins_s.filter(|_| !is_live);
        let (mut handle, player) = feed.start(&play, scene, EngineSettings { begins_s, ..settings }).unwrap();
        let mut ear = Hearing { capture: Capture::new(player), is_live, first: None, frames: 0 };
        let feed = tell(feed, &mut handle, &mut ear, 1.0, 48_000.0).unwrap();
        (feed.faults, ear.first, ear.frames)
    }

    #[test]
    fn who_tells_as_it_happens_may_have_any_clock() {
        let (faults, first, frames) = slid(0.0, true);
        let first = first.unwrap();
        assert!(faults == 0 && (24_000..27_000).contains(&first) && frames < 120_000, "{first} {frames}");
        for begin_s in [0.9, 300.0, 3e6, 1.8e9] {
            let (faults, found, frames) = slid(begin_s, true);
            // Where it begins within the first second the scene began before.
            let late = if begin_s < 1.0 { (begin_s * 48_000.0) as usize } else { 0 };
            assert!(faults == 0 && found.is_some(), "{begin_s}: {faults} faults, {found:?} of {frames}");
            let found = found.unwrap();
            // A moment of what slides begins with a whole number of them.
            assert!(found.abs_diff(first + late) < 1_000, "{begin_s}: {found}, not {first}");
            assert!(faults == 0 && frames < late + 120_000, "{begin_s}: {frames} frames");
        }
    }

    #[test]
    fn a_file_begins_at_time_0() {
        let (faults, first, frames) = slid(20.0, false);
        assert!(faults == 0 && (984_000..987_000).contains(&first.unwrap()), "{first:?}");
        assert!(frames > 1_000_000);
    }

    #[test]
    fn of_each_kind_of_fault_the_first_is_told_and_no_more_than_a_few() {
        let mut met = Met::default();
        for n in 0..1000u64 {
            met.fault(Error::new(format!("kind {}", n % 40)));
        }
        assert_eq!((met.count, met.told.len() as u64), (1000, MOST_FAULTS));
        assert!(met.told.contains("kind 0") && met.last.is_some_and(|last| last.to_string() == "kind 39"));
    }
}
