//! A scene made ready to sound, and the way from it to a soundtrack, stage by stage:
//!
//! ```text
//! Production ─ object_lines ─► Composer ─► Propagation ─► Mixer ─► offline::render
//!      score file ───────────────▲             ▲
//! ```
//!
//! Each stage pulls from the one before, so that a scene of any length passes through in the memory
//! of a moment; and a score written to a file and mixed later passes through the very same stages.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{self, Sender};

use crate::motion::event::Event;
use crate::scene::Scene;
use crate::scene::contact_log::ContactLog;
use crate::scene::file::Timing;
use crate::scene::world::World;
pub use crate::score::compose::Learning;
pub use crate::score::compose::PULSE;
use crate::score::compose::{self, Composer, Events, SoundFacts};
use crate::score::ending::Ending;
use crate::score::{
    AnyReader, AnySpace, ChannelHeader, ChannelLine, ChannelSpace, LATEST_S, Make, ObjectHeader, ObjectLine,
    ObjectSpace, Sound,
};
use crate::space::propagation::{Propagation, channel_header};
use crate::space::tracing::Tracing;
use crate::synth::mixer::{Later, Sounding};
use crate::synth::path::Foresight;
use crate::synth::prototypes::{self, Soundings};
use crate::{Error, Result};

/// Lines of a score in channel space, in time order, as they are asked for.
pub type ChannelLines<'a> = Box<dyn Iterator<Item = Result<ChannelLine>> + Send + 'a>;

/// A scene with everything it needs opened.
pub struct Production {
    /// The scene.
    pub scene: Arc<Scene>,
    /// Where everything is.
    pub world: Arc<World>,
    /// The header of its score.
    pub header: ObjectHeader,
    /// What it plays.
    pub prototypes: Soundings,
    /// When it is over for sounds that run through it, in seconds.
    end_s: f64,
}

impl Production {
    /// Opens a scene's animations and recordings.
    ///
    /// # Errors
    /// A file that cannot be read, or an object that is not in its animation.
    pub fn open(scene: Scene) -> Result<Self> {
        Self::open_with(scene, |_, _| Ok(()))
    }

    /// The same, after something has been done to its world: such as to let objects [be told to
    /// move](World::feed_object).
    ///
    /// # Errors
    /// As there; what `change` returns.
    pub fn open_with(scene: Scene, change: impl FnOnce(&Scene, &mut World) -> Result<()>) -> Result<Self> {
        let production = Self::open_unheard(scene, change)?;
        let prototypes = prototypes::load(&production.header.sounds, &production.scene.folder)?;
        Ok(Self { prototypes, ..production })
    }

    /// The same without its sounds: they are [loaded](Production::loading) while others are heard already.
    ///
    /// # Errors
    /// An animation that cannot be read; what `change` returns.
    pub fn open_unheard(scene: Scene, change: impl FnOnce(&Scene, &mut World) -> Result<()>) -> Result<Self> {
        let mut world = World::open(&scene)?;
        change(&scene, &mut world)?;
        let header = compose::header(&scene, &world)?;
        let end_s = end_s(&scene, &world)?;
        Ok(Self {
            scene: Arc::new(scene),
            world: Arc::new(world),
            header,
            prototypes: Soundings::new(),
            end_s,
        })
    }

    /// What happens in it by itself: the contacts of its logs.
    ///
    /// # Errors
    /// A log that cannot be read.
    pub fn events(&self) -> Result<Events> {
        Events::open(&self.scene, &self.world)
    }

    /// The lines of its score in object space.
    ///
    /// # Errors
    /// A log that cannot be read; a scene that does not say how long it is where it must.
    pub fn object_lines(&self) -> Result<Composer<'_, Events>> {
        Composer::new(
            &self.scene,
            &self.world,
            &self.header,
            facts(&self.prototypes),
            self.end_s,
            self.events()?,
        )
    }

    /// The lines of its score in channel space.
    ///
    /// # Errors
    /// As [`Production::object_lines`].
    pub fn channel_lines(&self) -> Result<ChannelLines<'_>> {
        let tracing = Tracing::of(&self.scene, &self.world)?;
        Ok(Box::new(Propagation::new(&self.header, self.object_lines()?)?.among(tracing)))
    }

    /// The lines of its score in channel space where more happens than the scene knows by itself: `told`, in order of time. A
    /// line comes as soon as [`Event::Quiet`] or an event says that it can be known; keys are `key_step_s` apart, so that
    /// there is always a next one. What is still to be learnt of sounds comes by `learning`; until then they are silent.
    /// Nothing is foreseen ([`Foresight::None`]): a mixer should not either. The score has no
    /// end of its own; [`PULSE`] is among its sounds.
    ///
    /// # Errors
    /// As [`Production::object_lines`].
    pub fn told_lines(
        &self,
        told: impl Iterator<Item = Result<Event>> + Send + 'static,
        key_step_s: f64,
        learning: Option<Learning>,
    ) -> Result<ChannelLines<'_>> {
        let tracing = Tracing::of(&self.scene, &self.world)?;
        let events = Events::looking_ahead(&self.scene, &self.world)?.and(told);
        let (scene, world, header) = (&self.scene, &self.world, &self.header);
        let composer = Composer::new(scene, world, header, facts(&self.prototypes), LATEST_S, events)?;
        let propagation = Propagation::new(&self.header, composer.pulsing(key_step_s).learning(learning))?;
        Ok(Box::new(propagation.among(tracing).with_foresight(Foresight::None)))
    }

    /// Its sounds, to be loaded while others are heard already: a mixer is given them [for later](crate::synth::mixer::Mixer::with_later),
    /// [`told_lines`](Production::told_lines) what is learnt of them, and [`Loading::run`] is for another thread.
    pub fn loading(&self) -> (Vec<(String, Later)>, Learning, Loading) {
        let (learnt, learning) = mpsc::channel();
        let later: Vec<(String, Later)> =
            self.header.sounds.iter().map(|sound| (sound.name.clone(), Later::default())).collect();
        let folder = self.scene.folder.clone();
        let mut groups: BTreeMap<String, Vec<(Sound, Later)>> = BTreeMap::new();
        for (sound, (_, later)) in self.header.sounds.iter().zip(&later) {
            // What comes from one file is read at once.
            let group = match &sound.make {
                Make::Recording { path, .. } => path.clone(),
                _ => format!("\0{}", sound.name),
            };
            groups.entry(group).or_default().push((sound.clone(), later.clone()));
        }
        let (scene, uses) = (self.scene.clone(), compose::uses(&self.scene, &self.header));
        let loading = Loading { groups: groups.into_values().collect(), folder, scene, uses, learnt };
        (later, learning, loading)
    }

    /// The header of its score in channel space.
    pub fn channel_header(&self) -> ChannelHeader {
        channel_header(&self.header, self.scene.reverberates())
    }
}

/// Sounds that are to be loaded.
pub struct Loading {
    groups: Vec<Vec<(Sound, Later)>>,
    folder: PathBuf,
    /// What they are for: the sounds of the scene that play them, by their names.
    scene: Arc<Scene>,
    uses: BTreeMap<String, Vec<usize>>,
    learnt: Sender<(String, SoundFacts)>,
}

impl Loading {
    /// How many sounds there are.
    pub fn count(&self) -> usize {
        self.groups.iter().map(Vec::len).sum()
    }

    /// Loads them one after the other; `each` is told how many at once there were, or why they could not be loaded or are none
    /// that the scene can use, and says whether to go on.
    pub fn run(self, mut each: impl FnMut(usize, Result<()>) -> bool) {
        for group in self.groups {
            let sounds: Vec<Sound> = group.iter().map(|(sound, _)| sound.clone()).collect();
            let loaded = prototypes::load(&sounds, &self.folder).and_then(|loaded| {
                let known: Vec<_> = facts(&loaded).collect();
                for (name, facts) in &known {
                    for &index in self.uses.get(name).into_iter().flatten() {
                        compose::check_use(&self.scene, &self.scene.sounds[index], facts)?;
                    }
                }
                // What is learnt of a sound comes when it is there.
                for ((_, sounding), (_, later)) in loaded.iter().zip(&group) {
                    later.set(sounding.clone());
                }
                for known in known {
                    let _ = self.learnt.send(known);
                }
                Ok(())
            });
            if !each(group.len(), loaded) {
                return;
            }
        }
    }
}

/// When the sounds that run through a scene end: with its duration, or with the last that moves,
/// starts or is logged.
fn end_s(scene: &Scene, world: &World) -> Result<f64> {
    if let Some(duration_s) = scene.duration_s {
        return Ok(duration_s);
    }
    let mut end_s = world.end_s();
    let mut endless = false;
    for sound in &scene.sounds {
        match &sound.timing {
            Timing::Starts(keys) => keys.iter().for_each(|key| end_s = end_s.max(key.time_s)),
            Timing::Span { to_s: Some(to_s), .. } => end_s = end_s.max(*to_s),
            Timing::Strikes(strikes) => strikes.iter().for_each(|&(time_s, _)| end_s = end_s.max(time_s)),
            Timing::Span { to_s: None, .. } => endless |= sound.played.is_endless(),
        }
    }
    if endless {
        // Only then is the end of a log worth reading it through for.
        for contacts in &scene.contacts {
            for row in ContactLog::open(&contacts.log.path, &contacts.columns)? {
                end_s = end_s.max(row?.time_s);
            }
        }
    }
    Ok(end_s)
}

/// What a composer has to know of each sound.
fn facts(soundings: &Soundings) -> impl Iterator<Item = (String, SoundFacts)> + '_ {
    soundings.iter().map(|(name, sounding)| {
        let (mut grains, mut cloth, mut paper) = (None, None, None);
        let (period_s, ring_s, controls) = match sounding {
            Sounding::Recording(prototype) => {
                let period_s = prototype.samples.len() as f64 / prototype.rate_hz;
                (prototype.looped.then_some(period_s), None, Vec::new())
            }
            Sounding::Instrument(instrument) => {
                let controls = instrument.controls().iter().map(|control| control.name.clone());
                grains = instrument.corpus();
                cloth = instrument.cloth();
                paper = instrument.paper();
                (None, instrument.ring_s(), controls.collect())
            }
        };
        let length_s = sounding.duration_s();
        (name.clone(), SoundFacts { length_s, period_s, ring_s, controls, grains, cloth, paper })
    })
}

/// How long each sound lasts at speed 1, in seconds.
pub fn lengths_s(prototypes: &Soundings) -> impl Iterator<Item = (String, f64)> + '_ {
    prototypes.iter().map(|(name, sounding)| (name.clone(), sounding.duration_s()))
}

/// A score from a file, made ready to be mixed: its header in channel space, its sounds and its
/// lines.
///
/// A score in `order time` is read as it is mixed; any other is sorted in memory first.
///
/// # Errors
/// A score or recording that cannot be read.
pub fn open_score(path: &Path) -> Result<(ChannelHeader, Soundings, ChannelLines<'static>)> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let named = |fault: Error| fault.in_file(path);
    match AnyReader::open(path)? {
        AnySpace::Object(reader) => {
            let header = reader.header().clone();
            let prototypes = prototypes::load(&header.sounds, folder)?;
            let lengths = lengths_s(&prototypes).collect::<Vec<_>>();
            let lines = Ending::<ObjectSpace, _>::new(reader.by_time()?, lengths, header.duration_s);
            let path = path.to_owned();
            let lines = lines.map(move |line: Result<ObjectLine>| line.map_err(|fault| fault.in_file(&path)));
            let (tracing, reverberates) = match &header.surroundings {
                // A score may name any file, as it may any recording.
                Some(scene) => {
                    let scene = Scene::open(folder.join(scene), true)?;
                    (Tracing::of(&scene, &World::open(&scene)?)?, scene.reverberates())
                }
                None => (None, false),
            };
            let lines = Propagation::new(&header, lines)?.among(tracing);
            Ok((channel_header(&header, reverberates), prototypes, Box::new(lines)))
        }
        AnySpace::Channel(reader) => {
            let header = reader.header().clone();
            let prototypes = prototypes::load(&header.sounds, folder).map_err(named)?;
            let lengths = lengths_s(&prototypes).collect::<Vec<_>>();
            let lines = Ending::<ChannelSpace, _>::new(reader.by_time()?, lengths, header.duration_s);
            Ok((header, prototypes, Box::new(lines)))
        }
    }
}
