//! An engine: a scene, a worker that turns what is told into sound, and the two ends of it.

use std::collections::BTreeMap;
use std::sync::atomic::Ordering::Acquire;
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::time::Duration;

use super::feed::{Feed, Told};
use super::handle::{Handle, Left, MoverId};
use super::{Player, Settings, Supply};
use crate::motion::{impact, slide};
use crate::render::production::{ChannelLines, PULSE, Production};
use crate::scene::Scene;
use crate::scene::fed::Fed;
use crate::synth::mixer::{Mixer, Sounding};
use crate::synth::receivers;
use crate::synth::voice::Prototype;
use crate::{Error, Result};

/// How an engine runs.
#[derive(Debug, Clone, PartialEq)]
pub struct EngineSettings {
    /// Frames a second.
    pub rate_hz: u32,
    /// The step of the simulation whose contacts are told, in seconds.
    pub contact_step_s: f64,
    /// Keys of all that sounds are so far apart, in seconds, and what is told to move moves evenly between them. The latency
    /// goes with this: a way is known once four more keys are.
    pub key_step_s: f64,
    /// So much is handed to the audio thread before it begins, in seconds: the longest time between two calls of
    /// [`Handle::advance`], and what the worker may be late.
    pub ahead_s: f64,
    /// It is handed over in slices of so many frames.
    pub slice_frames: usize,
    /// So much can be told before the worker takes it: contacts, poses and times.
    pub room: usize,
    /// The objects that are moved by the handle, by their names.
    pub movers: Vec<String>,
    /// Whether the listener is.
    pub moves_listener: bool,
}

impl Default for EngineSettings {
    fn default() -> Self {
        Self {
            rate_hz: 48_000,
            contact_step_s: 1.0 / 60.0,
            key_step_s: 0.005,
            ahead_s: 0.025,
            slice_frames: 128,
            room: 1 << 14,
            movers: Vec::new(),
            moves_listener: false,
        }
    }
}

/// What is looked ahead for onsets, in seconds, beside keys.
const ONSET_S: f64 = 0.004;

/// The worker sleeps so long where all that is known has been handed over.
const NAP: Duration = Duration::from_millis(1);

/// Opens a scene and begins to turn what the handle is told into what the player plays. What happens in the scene by itself
/// (tracks, contact logs, sounds at set times) is heard as well, by the time that is told.
///
/// # Errors
/// Settings that cannot be; a scene that cannot be opened; an object to be moved that it does not have.
pub fn start(scene: Scene, settings: EngineSettings) -> Result<(Handle, Player)> {
    for (name, value, most) in
        [("contact_step_s", settings.contact_step_s, 1.0), ("key_step_s", settings.key_step_s, 1.0)]
    {
        if !(1e-4..=most).contains(&value) {
            return Err(Error::new(format!("`{name}` is {value}, expected 0.0001 to {most}")));
        }
    }
    let (told, coming) = rtrb::RingBuffer::new(settings.room.clamp(16, 1 << 24));
    let stop = Arc::new(AtomicBool::new(false));
    let taken = Arc::new(AtomicU64::new(0));
    let fault = Arc::new(Mutex::new(None));
    let (ready, opened) = mpsc::sync_channel(1);
    let spawned = {
        let (stop, fault, taken) = (stop.clone(), fault.clone(), taken.clone());
        std::thread::Builder::new().name("froufrou".into()).spawn(move || {
            let run = work(scene, &settings, (coming, taken), &stop, &fault, &ready);
            if let Err(error) = run {
                *fault.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
            }
        })
    };
    let worker = spawned.map_err(|error| Error::new("there is no thread for the worker").because(error))?;
    let Ok(Opened { player, movers, listener, latency_s }) = opened.recv() else {
        // It ended before it was ready, and said why.
        let _ = worker.join();
        let found = fault.lock().unwrap_or_else(PoisonError::into_inner).take();
        return Err(found.unwrap_or_else(|| Error::new("the worker ended")));
    };
    let handle = Handle {
        told,
        count: 0,
        taken,
        bodies: BTreeMap::new(),
        movers,
        listener,
        known_s: 0.0,
        contact_s: 0.0,
        owed_s: None,
        rows: 0,
        left: Left::default(),
        stop,
        fault,
        worker: Some(worker),
        counters: player.counters.clone(),
        latency_s,
    };
    Ok((handle, player))
}

/// What a worker has made ready.
struct Opened {
    player: Player,
    movers: BTreeMap<String, MoverId>,
    listener: Option<MoverId>,
    latency_s: f64,
}

fn work(
    scene: Scene,
    settings: &EngineSettings,
    (told, taken): (rtrb::Consumer<Told>, Arc<AtomicU64>),
    stop: &Arc<AtomicBool>,
    fault: &Mutex<Option<Error>>,
    ready: &mpsc::SyncSender<Opened>,
) -> Result<()> {
    let mut fed: Vec<Arc<Fed>> = Vec::new();
    let (mut movers, mut listener) = (BTreeMap::new(), None);
    let production = Production::open_with(scene, |scene, world| {
        for name in &settings.movers {
            let Some(index) = scene.objects.iter().position(|object| object.name == *name) else {
                return Err(
                    Error::new(format!("there is no object `{name}` to be moved")).in_file(&scene.file)
                );
            };
            movers.insert(name.clone(), MoverId(fed.len()));
            fed.push(world.feed_object(index, settings.key_step_s)?);
        }
        if settings.moves_listener {
            listener = Some(MoverId(fed.len()));
            fed.push(world.feed_listener(settings.key_step_s)?);
        }
        Ok(())
    })?;
    let feed = Feed::new(told, settings.contact_step_s, fed, stop.clone(), taken);
    let header = production.channel_header();
    let receivers = receivers::load(&header, &production.scene.folder, settings.rate_hz)?;
    let rate_hz = f64::from(settings.rate_hz);
    let pulse = Prototype { samples: Arc::new([]), rate_hz, looped: false };
    let sounds = production.prototypes.clone().into_iter().chain([(PULSE.to_owned(), Sounding::from(pulse))]);
    let (lines, behind_s) = production.told_lines(feed, settings.key_step_s)?;
    let has_colours =
        header.receivers.len() != header.channels().len() || production.header.surroundings.is_some();
    let mixer = Mixer::idle(settings.rate_hz, receivers, sounds, lines)?;
    let mixer = mixer.with_seed(header.seed).keeping_going(true).looking_ahead(ONSET_S);
    let mixer = if has_colours { mixer } else { mixer.uncoloured() };
    let analysed_s = impact::Settings::new(impact::Step::Fixed(settings.contact_step_s)).behind_s();
    // What slides has a key a moment.
    let key_s = settings.key_step_s.max(slide::MOMENT_S).max(settings.contact_step_s);
    let known_s = behind_s + analysed_s + 5.0 * key_s + mixer.look_ahead() as f64 / rate_hz;
    let part = Settings {
        ahead_s: settings.ahead_s,
        slice_frames: settings.slice_frames,
        slack_s: settings.ahead_s + known_s,
        from_s: 0.0,
        duration_s: None,
    };
    let (supply, player) = super::part(mixer, part)?;
    let latency_s = known_s + settings.ahead_s + player.limiter_latency() as f64 / rate_hz;
    let mut supply: Supply<ChannelLines<'_>> = supply.following();
    if ready.send(Opened { player, movers, listener, latency_s }).is_err() {
        return Ok(());
    }
    while !stop.load(Acquire) {
        supply.go_on()?;
        // Nobody asks what has begun; it would grow.
        supply.take_begun();
        if let Some(silenced) = supply.take_faults().1.into_iter().next() {
            fault.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(silenced);
        }
        std::thread::park_timeout(NAP);
    }
    Ok(())
}
