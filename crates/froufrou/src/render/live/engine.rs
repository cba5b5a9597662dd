//! An engine: a scene, a worker that turns what is told into sound, and the two ends of it.

use std::collections::BTreeMap;
use std::sync::atomic::Ordering::{AcqRel, Acquire, Release};
use std::sync::{Arc, mpsc};
use std::time::Duration;

use super::feed::{Delays, Feed, Wires};
use super::handle::{Bodies, Handle, Latency, Left, MoverId, Movers};
use super::meshes::Meshes;
use super::supply::Handed;
use super::told::Told;
use super::{Player, Settings, Supply};
use crate::render::production::{ChannelLines, Loading, PULSE, Production};
use crate::scene::Scene;
use crate::scene::fed::Fed;
use crate::scene::world::World;
use crate::score::ChannelHeader;
use crate::synth::mixer::{Mixer, Sounding};
use crate::synth::path::Foresight;
use crate::synth::receivers;
use crate::synth::sinc::Kernel;
use crate::synth::source::prompt_s;
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
    /// goes with this.
    pub key_step_s: f64,
    /// So much is handed to the audio thread before it begins, in seconds: the longest time between two calls of
    /// [`Handle::advance`], and what the worker may be late.
    pub ahead_s: f64,
    /// It is handed over in slices of so many frames.
    pub slice_frames: usize,
    /// How well sounds are read that go to channels directly: see [`Mixer::with_kernel`].
    pub kernel: Kernel,
    /// See [`Settings::budget`]: 0.8 by default, for an engine plays through a device.
    pub budget: f32,
    /// See [`Settings::catches_up`]: it does by default, so that the latency stays as it is said.
    pub catches_up: bool,
    /// So much can be told before the worker takes it: contacts, poses, meshes and times. 16 or more.
    pub room: usize,
    /// The objects that are moved by the handle, by their names.
    pub movers: Vec<String>,
    /// The objects whose meshes are told by the handle, by their names: such as cloth and paper.
    pub meshes: Vec<String>,
    /// Whether the listener is moved.
    pub moves_listener: bool,
    /// What the game's clock says when the scene begins, in seconds. `None`: the first time that is told, or 0 where that is
    /// within the first second.
    pub begins_s: Option<f64>,
    /// Whether recordings and corpora are loaded while the engine runs, on a thread of their own: it begins at once, and what is
    /// not there yet is silent. Without that all is there when it begins.
    pub loads_behind: bool,
}

impl Default for EngineSettings {
    fn default() -> Self {
        Self {
            rate_hz: 48_000,
            contact_step_s: 1.0 / 60.0,
            key_step_s: 0.005,
            ahead_s: 0.025,
            slice_frames: 128,
            kernel: Kernel::Long,
            budget: 0.8,
            catches_up: true,
            room: 1 << 14,
            movers: Vec::new(),
            meshes: Vec::new(),
            moves_listener: false,
            begins_s: None,
            loads_behind: false,
        }
    }
}

/// The worker sleeps so long where all that is known has been handed over.
const NAP: Duration = Duration::from_millis(1);

/// Opens a scene and begins to turn what the handle is told into what the player plays. What happens in the scene by itself
/// (tracks, contact logs, sounds at set times) is heard as well, by the time that is told.
///
/// # Errors
/// Settings that cannot be; a scene that cannot be opened; an object to be moved that it does not have.
pub fn start(scene: Scene, settings: EngineSettings) -> Result<(Handle, Player)> {
    settings.check()?;
    let (told, coming) = settings.ring();
    let wires = Wires::default();
    let (ready, opened) = mpsc::sync_channel(1);
    let spawned = {
        let (wires, settings) = (wires.clone(), settings.clone());
        std::thread::Builder::new().name("froufrou".into()).spawn(move || {
            let run = team().and_then(|team| team.install(|| work(scene, &settings, coming, &wires, ready)));
            if let Err(error) = run {
                wires.faults.end(error);
            }
        })
    };
    let worker = spawned.map_err(|error| Error::new("there is no thread for the worker").because(error))?;
    let Ok((ends, player)) = opened.recv() else {
        // It ended before it was ready, and said why. Nothing more need be loaded.
        wires.stop.store(true, Release);
        let _ = worker.join();
        return Err(wires.faults.take().unwrap_or_else(|| Error::new("the worker ended")));
    };
    let mut handle = handle(told, ends, wires, settings.begins_s);
    (handle.worker, handle.counters) = (Some(worker), player.counters.clone());
    Ok((handle, player))
}

/// Renders what a handle is told, as an engine would play it, but as fast as it goes: `tell` tells it, on a thread of its own,
/// and waits where there is no room; `render` is given the mixer of the score that comes of it and the score's header. It ends
/// where no more is told and all has sounded; what is told once `render` has ended is taken by nobody. All sounds are loaded
/// before it begins.
///
/// ```no_run
/// use froufrou::render::live::{self, EngineSettings};
/// use froufrou::render::offline::{self, Extent};
/// use froufrou::scene::Scene;
/// let scene = Scene::open("scene.toml", false)?;
/// let mut mix = Vec::new();
/// live::replay(
///     scene,
///     EngineSettings::default(),
///     |handle| {
///         for frame in 1..=600 {
///             handle.advance(f64::from(frame) / 60.0).map_err(live::Refused::fault)?;
///         }
///         Ok(())
///     },
///     |mixer, header| {
///         let extent = Extent { rate_hz: 48_000, from_s: 0.0, to_s: None, duration_s: None };
///         offline::render(mixer, header.channels().len(), &extent, false, |piece| {
///             mix.extend_from_slice(piece.mix);
///             Ok(())
///         })
///     },
/// )?;
/// # Ok::<(), froufrou::Error>(())
/// ```
///
/// # Errors
/// As [`start`]; what `tell` and `render` return, the latter first.
pub fn replay<T>(
    scene: Scene,
    settings: EngineSettings,
    tell: impl FnOnce(&mut Handle) -> Result<()> + Send,
    render: impl FnOnce(&mut Mixer<ChannelLines<'_>>, &ChannelHeader) -> Result<T>,
) -> Result<T> {
    settings.check()?;
    let settings = EngineSettings { loads_behind: false, ..settings };
    let (told, coming) = settings.ring();
    let wires = Wires::default();
    let chain = Chain::open(scene, &settings)?;
    let (mut mixer, header, ends) = chain.mixer(&settings, coming, &wires)?;
    let mut handle = handle(told, ends, wires.clone(), settings.begins_s);
    handle.waits = true;
    std::thread::scope(|scope| {
        // Its end, with the handle, is that of what is told.
        let told = scope.spawn(move || {
            let told = tell(&mut handle);
            drop(handle);
            told
        });
        let rendered = render(&mut mixer, &header);
        // Where it was given up nobody waits for room.
        drop(mixer);
        let told = told.join().unwrap_or_else(|_| Err(Error::new("what tells has failed")));
        let rendered = rendered?;
        told?;
        wires.faults.take().map_or(Ok(rendered), Err)
    })
}

impl EngineSettings {
    fn check(&self) -> Result<()> {
        for (name, value, [least, most]) in [
            ("rate_hz", f64::from(self.rate_hz), [8_000.0, 192_000.0]),
            ("contact_step_s", self.contact_step_s, [1e-4, 1.0]),
            ("key_step_s", self.key_step_s, [1e-4, 1.0]),
            ("room", self.room as f64, [16.0, f64::from(1 << 24)]),
            ("begins_s", self.begins_s.unwrap_or(0.0), [-1e12, 1e12]),
        ] {
            if !(least..=most).contains(&value) {
                return Err(Error::new(format!("`{name}` is {value}, expected {least} to {most}")));
            }
        }
        Ok(())
    }

    fn ring(&self) -> (rtrb::Producer<Told>, rtrb::Consumer<Told>) {
        rtrb::RingBuffer::new(self.room)
    }
}

/// What a handle has to know of an opened scene.
struct Ends {
    movers: Movers,
    listener: Option<MoverId>,
    objects: Vec<String>,
    materials: Vec<String>,
    latency: Latency,
}

fn handle(told: rtrb::Producer<Told>, ends: Ends, wires: Wires, begins_s: Option<f64>) -> Handle {
    let Ends { movers, listener, objects, materials, latency } = ends;
    Handle {
        told,
        count: 0,
        waits: false,
        bodies: Bodies::default(),
        movers,
        listener,
        objects: objects.into_iter().collect(),
        materials: materials.into_iter().collect(),
        known_s: None,
        contact_s: 0.0,
        may_begin_late: begins_s.is_none(),
        skipped_s: begins_s.unwrap_or(0.0),
        leapt_from_s: None,
        owed_s: None,
        rows: 0,
        left: Left::default(),
        wires,
        worker: None,
        counters: Arc::default(),
        latency,
    }
}

/// A scene that is told what happens in it.
struct Chain {
    production: Production,
    fed: Vec<Arc<Fed>>,
    movers: BTreeMap<String, MoverId>,
    listener: Option<MoverId>,
}

impl Chain {
    fn open(scene: Scene, settings: &EngineSettings) -> Result<Self> {
        let mut fed: Vec<Arc<Fed>> = Vec::new();
        let (mut movers, mut listener) = (BTreeMap::new(), None);
        let change = |scene: &Scene, world: &mut World| {
            let moved = settings.movers.iter().map(|name| (name, false));
            for (name, has_mesh) in settings.meshes.iter().map(|name| (name, true)).chain(moved) {
                let Some(index) = scene.objects.iter().position(|object| object.name == *name) else {
                    return Err(
                        Error::new(format!("there is no object `{name}` to be moved")).in_file(&scene.file)
                    );
                };
                if movers.contains_key(name) {
                    continue;
                }
                movers.insert(name.clone(), MoverId::first(fed.len()));
                fed.push(world.feed_object(index, settings.key_step_s, has_mesh)?);
            }
            if settings.moves_listener {
                listener = Some(MoverId::first(fed.len()));
                fed.push(world.feed_listener(settings.key_step_s)?);
            }
            Ok(())
        };
        let production = if settings.loads_behind {
            Production::open_unheard(scene, change)?
        } else {
            Production::open_with(scene, change)?
        };
        Ok(Self { production, fed, movers, listener })
    }

    /// The mixer of what it is told.
    fn mixer(
        &self,
        settings: &EngineSettings,
        told: rtrb::Consumer<Told>,
        wires: &Wires,
    ) -> Result<(Mixer<ChannelLines<'_>>, ChannelHeader, Ends)> {
        let Self { production, fed, movers, listener } = self;
        let Production { scene, world, .. } = production;
        let meshes = Meshes::new(scene.clone(), world.clone(), settings.key_step_s)?;
        let step_s = settings.contact_step_s;
        let feed = Feed::new(told, step_s, fed.clone(), meshes, wires.clone());
        let header = production.channel_header();
        let receivers = receivers::load(&header, &scene.folder, settings.rate_hz)?;
        let rate_hz = f64::from(settings.rate_hz);
        let pulse = Prototype { samples: Arc::new([]), rate_hz, looped: false };
        let pulse = (PULSE.to_owned(), Sounding::from(pulse));
        let sounds = production.prototypes.clone().into_iter().chain([pulse]);
        let (later, learning, loading) = if settings.loads_behind {
            let (later, learning, loading) = production.loading();
            (later, Some(learning), Some(loading))
        } else {
            (Vec::new(), None, None)
        };
        let lines = production.told_lines(feed, settings.key_step_s, learning)?;
        let has_colours =
            header.receivers.len() != header.channels().len() || production.header.surroundings.is_some();
        let mixer = Mixer::idle(settings.rate_hz, receivers, sounds, lines)?;
        let mixer = mixer.with_seed(header.seed).keeping_going(true).looking_ahead(prompt_s(rate_hz));
        let mixer = mixer.with_foresight(Foresight::None).with_later(later).with_kernel(settings.kernel);
        let mixer = if has_colours { mixer } else { mixer.uncoloured() };
        // A way is known up to its last key, and that is no older than the pulse's next one.
        let known_s = settings.key_step_s + mixer.look_ahead() as f64 / rate_hz;
        let latency = Latency { all_s: known_s, ahead_s: settings.ahead_s, delays: Delays::of(step_s) };
        let names = |objects: &mut dyn Iterator<Item = &String>| objects.cloned().collect::<Vec<_>>();
        let ends = Ends {
            movers: Movers::new(movers.clone(), fed.len()),
            listener: *listener,
            objects: names(&mut scene.objects.iter().map(|object| &object.name)),
            materials: names(&mut scene.materials.iter().map(|material| &material.name)),
            latency,
        };
        if let Some(loading) = loading {
            load(loading, wires)?;
        }
        Ok((mixer, header, ends))
    }
}

/// Loads sounds on a thread of their own, which ends with the engine, or behind the sound that it loads then.
fn load(loading: Loading, wires: &Wires) -> Result<()> {
    let wires = wires.clone();
    wires.loaded[1].store(loading.count() as u64, Release);
    let run = move || {
        loading.run(|count, loaded| {
            if let Err(fault) = loaded {
                wires.faults.tell(fault);
            }
            wires.loaded[0].fetch_add(count as u64, AcqRel);
            !wires.stop.load(Acquire)
        });
    };
    let spawned = std::thread::Builder::new().name("froufrou loads".into()).spawn(run);
    spawned.map(drop).map_err(|error| Error::new("there is no thread to load sounds").because(error))
}

/// The worker and those who help it. They are of its own: where it waited for those of all the program it would wait for
/// whatever else these do, such as looking at a mesh.
fn team() -> Result<rayon::ThreadPool> {
    let threads = rayon::ThreadPoolBuilder::new().thread_name(|_| "froufrou".into());
    threads.build().map_err(|error| Error::new("there are no threads for the worker").because(error))
}

fn work(
    scene: Scene,
    settings: &EngineSettings,
    told: rtrb::Consumer<Told>,
    wires: &Wires,
    ready: mpsc::SyncSender<(Ends, Player)>,
) -> Result<()> {
    // Nobody else has set it.
    let _ = wires.worker.set(std::thread::current());
    let chain = Chain::open(scene, settings)?;
    let (mixer, _, mut ends) = chain.mixer(settings, told, wires)?;
    let part = Settings {
        ahead_s: settings.ahead_s,
        slice_frames: settings.slice_frames,
        // Two frames of a game may come at once.
        slack_s: settings.ahead_s,
        catches_up: settings.catches_up,
        budget: settings.budget,
        ..Settings::default()
    };
    let (supply, mut player) = super::part(mixer, part)?;
    player.rests = settings.catches_up.then(|| wires.rests.clone());
    let rate_hz = f64::from(settings.rate_hz);
    ends.latency.ahead_s = player.ahead_frames() as f64 / rate_hz;
    ends.latency.all_s += ends.latency.ahead_s + player.limiter_latency() as f64 / rate_hz;
    let mut supply: Supply<ChannelLines<'_>> = supply.following();
    if ready.send((ends, player)).is_err() {
        return Ok(());
    }
    while !wires.stop.load(Acquire) {
        let handed = supply.hand_over()?;
        // Nobody asks what has begun; it would grow.
        supply.take_begun();
        supply.take_faults().1.into_iter().for_each(|silenced| wires.faults.tell(silenced));
        if !matches!(handed, Handed::Slice) {
            std::thread::park_timeout(NAP);
        }
    }
    Ok(())
}
