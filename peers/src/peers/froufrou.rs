//! Froufrou itself: the mixer of a score in channel space, driven as the renderer of files drives it.
//!
//! A score says where its threads are before they sound, so ticks are lines of a score that the mixer reads as
//! far ahead as it needs. What reading them costs, the filters of a head among it, is measured with the rest.

use std::path::{Path, PathBuf};

use froufrou::render::live::{self, Player, Settings, Supply};
use froufrou::score::{Arrival, ChannelLine, Header, Order, Output, Start, Statement, Verb};
use froufrou::space::head::Head;
use froufrou::synth::bus::Ringing;
use froufrou::synth::mixer::Mixer;
use froufrou::synth::receivers::{Receiver, load};
use froufrou::synth::sinc::Kernel;
use froufrou::synth::voice::Prototype;

use super::{Kind, Peer, Rendering, Result};
use crate::measure::WARM_UP_S;
use crate::plain::{Plain, PlainVoice};
use crate::world::{RATE_HZ, SPEED_OF_SOUND, Sound, TICKS_HZ, Voice, World};

/// Who hears a score. Another kind of receiver is a variant here, with its name, its receivers and what arrives at
/// them, and an entry in [`all`]; `--only` then chooses it.
#[derive(Clone)]
enum Hearing {
    /// Two microphones where the ears are, with nothing between them.
    Stereo,
    /// A sphere of the size of a head.
    Sphere,
    /// A measured head.
    Head(PathBuf),
    /// The same head, which all voices share by way of a sound field of order 3.
    Shared(PathBuf),
}

/// The rows of froufrou.
pub fn all(head: Option<&Path>, absent: &mut Vec<String>) -> Vec<Box<dyn Peer>> {
    let mut rows: Vec<Box<dyn Peer>> = Vec::new();
    match head {
        Some(file) => {
            rows.push(Box::new(Froufrou(Hearing::Head(file.into()))));
            rows.push(Box::new(Froufrou(Hearing::Shared(file.into()))));
        }
        None => absent.push("froufrou-head: no measured head; name a SOFA file with --head".into()),
    }
    rows.push(Box::new(Froufrou(Hearing::Sphere)));
    rows.push(Box::new(Froufrou(Hearing::Stereo)));
    rows
}

struct Froufrou(Hearing);

impl Hearing {
    fn receivers(&self) -> Result<Vec<Receiver>> {
        let head = |head: Option<&Path>, shared: bool| {
            let head = head.map(|file| file.to_string_lossy().into_owned());
            let output = Output::Head { ears: ["left".into(), "right".into()], head, shared };
            load(&Header::new(Order::Time, vec![output]), Path::new(""), RATE_HZ)
                .map_err(|error| error.to_string())
        };
        match self {
            Hearing::Stereo => Ok(Receiver::plain(2)),
            Hearing::Sphere => head(None, false),
            Hearing::Head(file) => head(Some(file), false),
            Hearing::Shared(file) => head(Some(file), true),
        }
    }

    fn arrivals(&self, from: [f64; 3]) -> Vec<Arrival> {
        match self {
            Hearing::Stereo => vec![ear(from, -1.0), ear(from, 1.0)],
            Hearing::Sphere | Hearing::Head(_) | Hearing::Shared(_) => {
                let distance = length(from);
                let arrival = Arrival::new(1.0 / distance, distance / SPEED_OF_SOUND);
                vec![Arrival { from_m: Some(from), ..arrival }]
            }
        }
    }
}

/// What a microphone hears that is rather open to its side, 8.75 cm beside the centre.
fn ear([x, y, z]: [f64; 3], side: f64) -> Arrival {
    let from = [x - 0.0875 * side, y, z];
    let distance = length(from);
    let openness = 0.7 + 0.3 * side * from[0] / distance;
    Arrival::new(openness / distance, distance / SPEED_OF_SOUND)
}

fn length(of: [f64; 3]) -> f64 {
    of.iter().map(|c| c * c).sum::<f64>().sqrt()
}

impl Peer for Froufrou {
    fn name(&self) -> String {
        match self.0 {
            Hearing::Stereo => "froufrou-stereo",
            Hearing::Sphere => "froufrou-sphere",
            Hearing::Head(_) => "froufrou-head",
            Hearing::Shared(_) => "froufrou-shared",
        }
        .into()
    }

    fn details(&self) -> String {
        let rate_hz = f64::from(RATE_HZ);
        let head = match &self.0 {
            Hearing::Stereo => None,
            Hearing::Sphere => Some(Ok(Head::spherical(rate_hz))),
            Hearing::Head(file) => Some(Head::open(file, rate_hz)),
            Hearing::Shared(_) => return "a sound field of order 3 to the same head, short kernel".into(),
        };
        let taps = match head {
            None => return "two microphones a head apart".into(),
            Some(Ok(head)) => head.taps(),
            Some(Err(error)) => return error.to_string(),
        };
        let of = if matches!(self.0, Hearing::Head(_)) { "measured head" } else { "rigid sphere" };
        format!("{of}, {taps} taps an ear")
    }

    fn kind(&self) -> Kind {
        if matches!(self.0, Hearing::Stereo) { Kind::Stereo } else { Kind::Binaural }
    }

    fn start(&self, world: &World) -> Result<Box<dyn Rendering>> {
        let hearing = self.0.clone();
        let receivers = hearing.receivers()?;
        let prototype = |samples: &Sound| -> Prototype {
            Prototype { samples: samples.clone(), rate_hz: f64::from(RATE_HZ), looped: true }
        };
        let sounds = world.sounds.iter().enumerate();
        let sounds = sounds.map(|(index, samples)| (index.to_string(), prototype(samples).into()));
        let lines = Lines { hearing, voices: world.voices.clone(), next: 0 };
        let mixer = Mixer::new(RATE_HZ, receivers, sounds, lines).map_err(|error| error.to_string())?;
        let ringing = mixer.voices().buses().map(|bus| Ringing::new(bus, 0)).collect();
        Ok(Box::new(Playing { mixer, ringing, frame: 0 }))
    }
}

/// The lines of a score without end: what each voice is told at each tick.
struct Lines {
    hearing: Hearing,
    voices: Vec<Voice>,
    next: u64,
}

impl Iterator for Lines {
    type Item = froufrou::Result<ChannelLine>;

    fn next(&mut self) -> Option<Self::Item> {
        let count = self.voices.len() as u64;
        let (tick, thread) = (self.next / count, self.next % count);
        self.next += 1;
        let (voice, time_s) = (&self.voices[thread as usize], tick as f64 / f64::from(TICKS_HZ));
        let verb = match tick {
            0 => Verb::Start(Start {
                offset_s: voice.offset as f64 / f64::from(RATE_HZ),
                ..Start::new(voice.sound.to_string())
            }),
            _ => Verb::Key,
        };
        let value = self.hearing.arrivals(voice.motion.position(time_s));
        Some(Ok(ChannelLine::Thread(Statement { thread, path: 0, time_s, verb, value })))
    }
}

struct Playing {
    mixer: Mixer<Lines>,
    /// What is under way through each bus.
    ringing: Vec<Ringing>,
    frame: u64,
}

impl Rendering for Playing {
    fn tick(&mut self, _: f64) -> Result<()> {
        // The lines say it.
        Ok(())
    }

    fn render(&mut self, block: &mut [[f32; 2]]) -> Result<()> {
        let end = self.frame + block.len() as u64;
        self.mixer.read_to(end).map_err(|error| error.to_string())?;
        let voices = self.mixer.voices();
        let mut mix = voices.render(self.frame, block.len(), false).mix;
        for (index, (bus, ringing)) in voices.buses().zip(&mut self.ringing).enumerate() {
            // What is read ahead comes out before the first frame.
            let ahead = (self.frame + bus.lead() as u64 - ringing.frame()) as usize;
            if ahead > 0 {
                let lanes = voices.render_lanes(index, ringing.frame(), ahead, false);
                let fed = ringing.process(&lanes.mix, ahead, &mut vec![0.0; 2 * ahead]);
                fed.map_err(|error| error.to_string())?;
            }
            let lanes = voices.render_lanes(index, ringing.frame(), block.len(), false);
            ringing.process(&lanes.mix, block.len(), &mut mix).map_err(|error| error.to_string())?;
        }
        let (left, right) = mix.split_at(block.len());
        for ((frame, left), right) in block.iter_mut().zip(left).zip(right) {
            *frame = [*left as f32, *right as f32];
        }
        self.mixer.release(end);
        self.frame = end;
        Ok(())
    }
}

/// When the worker of a live player does its work.
#[derive(Clone, Copy)]
pub enum Worker {
    /// Before every block, on the same thread, in slices of so many frames.
    Beside(usize),
    /// Before the clock runs, so that the audio thread is measured alone.
    Before,
}

/// A live player, and the worker that supplies it.
pub fn plain(plain: &Plain, kernel: Kernel, worker: Worker) -> Result<Box<dyn Rendering>> {
    let thread = |(thread, voice): (usize, &PlainVoice)| {
        let value = voice.gains().map(|gain| Arrival::new(gain, 0.0)).to_vec();
        let offset_s = voice.offset as f64 / f64::from(plain.rate_hz);
        let start = Start { offset_s, speed: plain.speed, ..Start::new("sound") };
        let line = |time_s: f64, verb: Verb| {
            let value = value.clone();
            let line = Statement { thread: thread as u64, path: 0, time_s, verb, value };
            Ok::<_, froufrou::Error>(ChannelLine::Thread(line))
        };
        [line(0.0, Verb::Start(start)), line(ENDS_S, Verb::End)]
    };
    let (starts, ends): (Vec<_>, Vec<_>) =
        plain.voices.iter().enumerate().map(thread).map(|[start, end]| (start, end)).unzip();
    let sound = Prototype { samples: plain.sound.clone(), rate_hz: f64::from(plain.rate_hz), looped: true };
    let lines = starts.into_iter().chain(ends);
    let sounds = [("sound".to_owned(), sound.into())];
    let mixer = Mixer::new(RATE_HZ, Receiver::plain(2), sounds, lines).map_err(|error| error.to_string())?;
    let settings = match worker {
        Worker::Beside(slice_frames) => Settings { slice_frames, ..Settings::default() },
        Worker::Before => Settings { ahead_s: plain.lasts_s.max(WARM_UP_S) + 0.1, ..Settings::default() },
    };
    let (supply, player) =
        live::part(mixer.with_kernel(kernel), settings).map_err(|error| error.to_string())?;
    Ok(Box::new(LivePlaying { supply, player, worker, samples: Vec::new() }))
}

/// Plain voices sound for so long, in seconds.
const ENDS_S: f64 = 3600.0;

struct LivePlaying<L> {
    supply: Supply<L>,
    player: Player,
    worker: Worker,
    samples: Vec<f32>,
}

impl<L: Iterator<Item = froufrou::Result<ChannelLine>>> Rendering for LivePlaying<L> {
    fn tick(&mut self, _: f64) -> Result<()> {
        Ok(())
    }

    fn prepare(&mut self) -> Result<()> {
        self.supply.go_on().map(drop).map_err(|error| error.to_string())
    }

    fn render(&mut self, block: &mut [[f32; 2]]) -> Result<()> {
        if let Worker::Beside(_) = self.worker {
            self.supply.go_on().map_err(|error| error.to_string())?;
        }
        self.samples.resize(2 * block.len(), 0.0);
        self.player.fill(&mut self.samples);
        for (frame, samples) in block.iter_mut().zip(self.samples.chunks_exact(2)) {
            *frame = [samples[0], samples[1]];
        }
        Ok(())
    }
}
