//! The scene file: one TOML file that says what is in the world, what it sounds like and who
//! listens. Its reference, with every key, is `docs/scene.md`.
//!
//! Reading gives plain data, checked as far as it can be without opening the files it refers to:
//! they are there, inside the scene's folder, and names that refer to each other exist.

use std::path::PathBuf;

use crate::score::{Blow, Make, Pickup, Radiation, Repeat};
use crate::space::air::{Air, Medium};
use crate::space::bands::Bands;
use crate::space::room::Room;
use crate::{Error, Result};

use super::asset::{Asset, NamePattern};
use super::contact_log::ContactColumns;
use super::conventions::Conventions;
use super::listener::{Layout, Listener};
use super::track::Track;

/// A scene as its author wrote it, with defaults filled in.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// The file it was read from.
    pub file: PathBuf,
    /// The folder that its paths start from.
    pub folder: PathBuf,
    /// Sample rate of the soundtrack in hertz.
    pub rate_hz: u32,
    /// What all random choices follow from.
    pub seed: u64,
    /// Length of the soundtrack in seconds; `None`: until everything has ended and arrived.
    pub duration_s: Option<f64>,
    /// The time in the clock of the animation files at which the soundtrack begins; `None`: at the
    /// earliest sample of any of them.
    pub start_s: Option<f64>,
    /// Speed of sound in metres a second.
    pub speed_of_sound_mps: f64,
    /// How often hand-set tracks are sampled, in hertz.
    pub frame_rate_hz: f64,
    /// Who listens, if that is a listener and not microphones of their own.
    pub listener: Option<Listener>,
    /// Its microphones, or those of the scene, in the order of their channels; at least one.
    pub microphones: Vec<Microphone>,
    /// The air, where sound is to lose to it.
    pub air: Option<Air>,
    /// The walls about it.
    pub enclosing: Option<Enclosing>,
    /// The wind that blows through all of it.
    pub wind: Option<Wind>,
    /// The sounds that are synthesised.
    pub instruments: Vec<Instrument>,
    /// What things are made of.
    pub materials: Vec<Material>,
    /// The things in the world.
    pub objects: Vec<Object>,
    /// Every sound that was written down, whether with an object or by itself.
    pub sounds: Vec<SceneSound>,
    /// The contact logs of simulations.
    pub contacts: Vec<Contacts>,
    /// Objects whose contacts are found from how they move.
    pub touching: Vec<Touching>,
}

/// Walls without gaps.
#[derive(Debug, Clone, PartialEq)]
pub enum Enclosing {
    /// Those of a room.
    Room(Box<RoomAbout>),
    /// Planes without end.
    Planes(Vec<MovingPlane>),
}

/// A room, and how it is heard.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomAbout {
    /// Its walls.
    pub room: Room,
    /// The order up to which reflections are heard one by one.
    pub order: usize,
    /// Whether it reverberates on behind them.
    pub has_tail: bool,
}

/// A plane that may ride on an object.
#[derive(Debug, Clone, PartialEq)]
pub struct MovingPlane {
    /// An index into [`Scene::objects`]; `None` where it stands still in the world.
    pub object: Option<usize>,
    /// A point on it, in metres in the frame of the object or the world.
    pub point_m: [f64; 3],
    /// The direction in which there is air, in that frame.
    pub normal: [f64; 3],
    /// The part of the energy that it absorbs in each octave band.
    pub absorption: Bands,
}

/// What carries an object or a microphone through the world.
#[derive(Debug, Clone, PartialEq)]
pub enum Motion {
    /// A track set by hand; one key where it stands still.
    Track(Track),
    /// Objects of an animation file.
    Source(Box<Source>),
}

/// Objects of an animation file.
#[derive(Debug, Clone, PartialEq)]
pub struct Source {
    /// The animation file; of a sequence the pattern that its files match.
    pub file: Asset,
    /// How its numbers are meant.
    pub conventions: Conventions,
    /// The path of the object in it, or a pattern that several match.
    pub object: NamePattern,
    /// Seconds added to the times of the file.
    pub time_offset_s: f64,
}

/// A microphone.
#[derive(Debug, Clone, PartialEq)]
pub struct Microphone {
    /// Its name, unlike all others.
    pub name: String,
    /// What it picks up.
    pub pickup: Pickup,
    /// What carries it. Of a hand-set track the carrier's frame is [`Track::frame`].
    pub motion: Motion,
    /// Where it sits in the local frame of what carries it, in metres.
    pub local_offset_m: [f64; 3],
    /// Unit vector of its facing direction in the local frame of what carries it; a carrier looks
    /// along its −Z, and +X is to its right.
    pub local_facing: [f64; 3],
}

/// What a thing is made of, as far as it is heard.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// The name that objects use.
    pub name: String,
    /// What it sounds like when hit.
    pub impact: Option<ImpactSound>,
    /// What it sounds like when something slides along it.
    pub slide: Option<RubSound>,
    /// What it sounds like when it rolls along something, or something along it.
    pub roll: Option<RubSound>,
    /// What it sounds like in every contact that has no sound of its own above.
    pub grains: Option<GrainSound>,
    /// What it sounds like as a cloth that rubs and crumples.
    pub cloth: Option<Cloth>,
    /// What it sounds like as a sheet of paper that crumples, rubs and tears.
    pub paper: Option<Paper>,
    /// What it sounds like when it moves through the air.
    pub air: Option<AirSound>,
    /// What it does to the sound of others.
    pub acoustics: Acoustics,
    /// In kilograms a cubic metre.
    pub density: f64,
}

/// What a material does to sound that meets it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Acoustics {
    /// How it reflects, if it does.
    pub reflect: Option<Reflect>,
    /// The part of the pressure that is left behind it, if it hides sound.
    pub transmission: Option<f64>,
}

/// How a material reflects sound.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reflect {
    /// The part of the energy that is not reflected, 0 to 1.
    pub absorption: f64,
    /// The part of the reflected energy that goes evenly to all sides, 0 to 1.
    pub diffuse: f64,
    /// The sharpness of the lobe in which the rest goes.
    pub sharpness: f64,
    /// Paths at most by way of each object of the material.
    pub paths: usize,
    /// Whether both sides reflect; `None`: as its shape asks for.
    pub both_sides: Option<bool>,
}

/// A sound that is synthesised.
#[derive(Debug, Clone, PartialEq)]
pub struct Instrument {
    /// The name that sounds use.
    pub name: String,
    /// What makes it; its file is named as the scene names it.
    pub make: Make,
    /// Numbers that it is made with.
    pub with: Vec<(String, f64)>,
}

/// What a sound plays.
#[derive(Debug, Clone, PartialEq)]
pub enum Played {
    /// Recordings.
    Recordings {
        /// One of these is picked at random for every start, never the same twice running; not empty.
        recordings: Vec<Asset>,
        /// How it repeats.
        repeat: Repeat,
        /// The channel of the recording that is played, from 0; all of them averaged where `None`.
        channel: Option<usize>,
    },
    /// A synthesised sound: an index into [`Scene::instruments`].
    Instrument(usize),
}

impl Played {
    /// True where it sounds until it is ended.
    pub fn is_endless(&self) -> bool {
        !matches!(self, Played::Recordings { repeat: Repeat::Once, .. })
    }
}

/// A wind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wind {
    /// Its mean velocity in metres a second.
    pub velocity_mps: [f64; 3],
    /// How much its speed varies, as a fraction of the mean: the standard deviation of its gusts.
    pub gusts: f64,
    /// Seconds from gust to gust.
    pub gust_period_s: f64,
}

/// What a material sounds like when hit.
#[derive(Debug, Clone, PartialEq)]
pub struct ImpactSound {
    /// What sounds at every impact.
    pub played: Played,
    /// Of a synthesised sound: where it is struck, at random between these two.
    pub place: [f64; 2],
    /// Of a synthesised sound: how long the striker touches, in seconds.
    pub contact_s: f64,
    /// Gain of an impact of the reference impulse, in decibels.
    pub gain_db: f64,
    /// The impulse that plays at `gain_db`, in newton seconds; pressure is proportional to impulse.
    pub reference_impulse_ns: f64,
    /// The impulse below which nothing sounds, in newton seconds.
    pub floor_impulse_ns: f64,
    /// Dead time of a pair of bodies after an impact that sounded, in seconds.
    pub retrigger_s: f64,
    /// The playback speed varies at random by up to this fraction to either side.
    pub speed_variation: f64,
    /// The distance at which it is heard at its own gain, in metres.
    pub reference_distance_m: f64,
}

/// What a material sounds like while something slides or rolls along it.
#[derive(Debug, Clone, PartialEq)]
pub struct RubSound {
    /// What sounds, while it is told the speed by its control `speed`.
    pub played: Played,
    /// Gain at the reference force, in decibels.
    pub gain_db: f64,
    /// The normal force that sounds at `gain_db`, in newtons; pressure is proportional to force.
    pub reference_force_n: f64,
    /// The speed below which nothing sounds, in metres a second.
    pub floor_speed_mps: f64,
    /// The distance at which it is heard at its own gain, in metres.
    pub reference_distance_m: f64,
}

/// A material that sounds like the grains of a corpus.
#[derive(Debug, Clone, PartialEq)]
pub struct GrainSound {
    /// The folder of the corpus.
    pub corpus: Asset,
    /// A script that says what contacts sound like.
    pub shader: Option<Asset>,
    /// Gain in decibels of an impact of the reference impulse and of contacts of the reference power, which sound as loud
    /// as the strongest recordings of the corpus.
    pub gain_db: f64,
    /// The impulse that plays at `gain_db`, in newton seconds; pressure is proportional to impulse.
    pub reference_impulse_ns: f64,
    /// The impulse below which nothing sounds, in newton seconds.
    pub floor_impulse_ns: f64,
    /// Dead time of a pair of bodies after an impact that sounded, in seconds.
    pub retrigger_s: f64,
    /// The product of force and speed that plays at `gain_db`, in watts; pressure is proportional to it.
    pub reference_power_w: f64,
    /// The speed below which what slides or rolls is silent, in metres a second.
    pub floor_speed_mps: f64,
    /// The speed at which tones have the pitch that was recorded, in metres a second.
    pub reference_speed_mps: f64,
    /// Pitch of tones is proportional to this power of the speed.
    pub pitch: f64,
    /// The force at which tones are spread by `spread`, in newtons; it is proportional to force.
    pub reference_force_n: f64,
    /// How far the pitch of tones strays at the reference force, as a part of it.
    pub spread: f64,
    /// The distance at which it is heard at its own gain, in metres.
    pub reference_distance_m: f64,
}

/// A material of cloth: objects of it are looked at for where they rub and buckle (An, James & Marschner 2012).
#[derive(Debug, Clone, PartialEq)]
pub struct Cloth {
    /// The folder of its corpus, or the name of a model such as `synthetic/cotton`.
    pub corpus: String,
    /// The corpora of its friction along other materials, by their names.
    pub against: Vec<(String, String)>,
    /// How near a vertex is to what it rubs on, in metres.
    pub radius_m: f64,
    /// A vertex that is slower is silent, in metres a second.
    pub floor_speed_mps: f64,
    /// Speeds are divided by this, in metres a second, …
    pub speed_scale_mps: f64,
    /// … and then raised to this power.
    pub speed_exponent: f64,
    /// What the animation calls the force with which each vertex presses, where it has that.
    pub force: Option<String>,
    /// How hard it was pressed in the recordings, in pascals.
    pub pressure_pa: f64,
    /// Its curvature is blurred over so many metres before buckles are looked for.
    pub blur_m: f64,
    /// Buckles of less energy are silent, in metres a second.
    pub least_energy_mps: f64,
    /// Pops come later than their buckles by up to this, at random, in seconds.
    pub jitter_s: f64,
    /// In how many patches it is heard from its surface.
    pub patches: usize,
    /// How it sounds as it is stretched and beats the air, if it does.
    pub membrane: Option<Sheet>,
    /// Gain of friction in decibels.
    pub friction_db: f64,
    /// Gain of pops in decibels.
    pub pops_db: f64,
    /// The distance at which it is heard at its own gain, in metres.
    pub reference_distance_m: f64,
}

/// A material of paper: objects of it are looked at for where they crumple, rub and tear, and for what vibrates then
/// (Schreck et al. 2016).
#[derive(Debug, Clone, PartialEq)]
pub struct Paper {
    /// The folder of its database, or the name of a model such as `synthetic/printer`.
    pub corpus: String,
    /// The databases of its friction along other materials, by their names.
    pub against: Vec<(String, String)>,
    /// A file of the regions of its sheet, where its animator has them.
    pub regions: Option<Asset>,
    /// Vertices that are held, by their numbers.
    pub held: Vec<u32>,
    /// What the animation calls the force with which each vertex presses, where it has that.
    pub force: Option<String>,
    /// The force at which it rubs as loud as in its database, in newtons; where forces are known.
    pub reference_force_n: f64,
    /// How near a vertex is to what it touches, in metres.
    pub radius_m: f64,
    /// What slides slower is silent, in metres a second.
    pub floor_speed_mps: f64,
    /// Vibration stops at edges that are bent by more than this, in radians.
    pub ridge_rad: f64,
    /// What bends by less than this over its width is flat, in radians.
    pub flat_rad: f64,
    /// Curvature is averaged over so many metres.
    pub average_m: Option<f64>,
    /// Crumplings of less energy are silent, in metres a second.
    pub least_energy_mps: f64,
    /// The energy at which clips are as loud as they were recorded, in metres a second.
    pub reference_energy_mps: f64,
    /// How loud stick–slip is as it begins to slide.
    pub slip: f64,
    /// How loud tears are.
    pub tearing: f64,
    /// Whether the spectra of what rubs at once add as magnitudes (1) or as powers (0).
    pub coherence: f64,
    /// Gain of crumpling in decibels.
    pub crumple_db: f64,
    /// Gain of friction and tears in decibels.
    pub friction_db: f64,
    /// The distance at which it is heard at its own gain, in metres.
    pub reference_distance_m: f64,
}

/// Cloth as a membrane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sheet {
    /// Newtons a metre of width that double its length, if it were to hold.
    pub stiffness_n_per_m: f64,
    /// Kilograms a square metre.
    pub density_kg_per_m2: f64,
    /// The part of the critical damping.
    pub damping: f64,
    /// The edge of the pieces that ring by themselves, in metres.
    pub size_m: f64,
    /// A patch snaps where its velocity changes by more than this from one frame to the next, in metres a second.
    pub snap_mps: f64,
    /// How long a snap lasts, in seconds.
    pub contact_s: f64,
    /// Gain in decibels; at 0 a sample of 1 is a pascal.
    pub gain_db: f64,
}

/// What a material sounds like when it moves through the air.
#[derive(Debug, Clone, PartialEq)]
pub struct AirSound {
    /// What sounds, while it is told the speed through the air by its control `speed`.
    pub played: Played,
    /// Gain in decibels.
    pub gain_db: f64,
    /// The distance at which it is heard at its own gain, in metres.
    pub reference_distance_m: f64,
}

/// A thing in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct Object {
    /// Its name, unlike all others.
    pub name: String,
    /// What carries it; `None` for what is known from contact logs alone.
    pub motion: Option<Motion>,
    /// Where it is a swarm about what carries it: each of its members is a body.
    pub swarm: Option<Swarm>,
    /// Its shape where it has no mesh, as far as it reflects and hides sound.
    pub size: Option<Size>,
    /// The point that sounds come from.
    pub point: Point,
    /// Index into [`Scene::materials`].
    pub material: Option<usize>,
    /// Which bodies of the contact logs it is.
    pub body: NamePattern,
    /// In kilograms, each of its bodies; what its volume weighs where `None`.
    pub mass_kg: Option<f64>,
}

/// A simple shape about the origin of the local frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Size {
    /// An upright rectangle that faces −Z: metres along X and Y.
    Rectangle([f64; 2]),
    /// A box: metres along X, Y and Z.
    Box([f64; 3]),
}

/// Many small things that fly about a place.
#[derive(Debug, Clone, PartialEq)]
pub struct Swarm {
    /// How many.
    pub count: usize,
    /// How far they stray from the middle, in metres: the standard deviation along each axis.
    pub radius_m: f64,
    /// How fast they fly about it, in metres a second, on average.
    pub speed_mps: f64,
    /// A script that says where each of them is about the middle, instead.
    pub script: Option<Asset>,
}

/// The point of an object that its sounds come from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Point {
    /// A place in its local frame, in metres; its origin where nothing was said.
    Offset([f64; 3]),
    /// A vertex of its mesh, from 0.
    Vertex(usize),
}

/// A sound that was written down.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneSound {
    /// Where it comes from.
    pub emitter: Emitter,
    /// What it plays.
    pub played: Played,
    /// What a synthesised sound is told, in order of time.
    pub set: Vec<SetKey>,
    /// How it radiates; evenly from one place where `None`.
    pub pattern: Option<Radiation>,
    /// Gain in decibels.
    pub gain_db: f64,
    /// Playback speed: 2 is an octave up in half the time.
    pub speed: f64,
    /// The speed of each start varies at random by up to this fraction to either side.
    pub speed_variation: f64,
    /// When it sounds.
    pub timing: Timing,
    /// Seconds over which each start fades in.
    pub fade_in_s: f64,
    /// Seconds over which it fades out before its end.
    pub fade_out_s: f64,
    /// The distance at which it is heard at its own gain, in metres.
    pub reference_distance_m: f64,
}

/// Where a sound comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Emitter {
    /// An object with a motion: an index into [`Scene::objects`].
    Object(usize),
    /// A fixed world position in metres.
    Position([f64; 3]),
    /// An ambience all around a microphone, by its index, or around every one for itself.
    Around(Option<usize>),
}

/// When a sound sounds.
#[derive(Debug, Clone, PartialEq)]
pub enum Timing {
    /// It plays once from every key, in ascending order of time; not empty, never of a loop.
    Starts(Vec<StartKey>),
    /// A synthesised sound is struck at times, in ascending order; not empty.
    Strikes(Vec<(f64, Blow)>),
    /// It sounds from one time to another, or to the end of the recording or scene where `None`.
    Span {
        /// The start in seconds.
        from_s: f64,
        /// The end in seconds, after the start.
        to_s: Option<f64>,
    },
}

/// A hand-set start of a sound.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StartKey {
    /// When, in seconds.
    pub time_s: f64,
    /// Gain in decibels on top of the sound's own.
    pub gain_db: f64,
    /// Factor on top of the sound's own speed.
    pub speed: f64,
}

/// What a synthesised sound is told at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct SetKey {
    /// When, in seconds.
    pub time_s: f64,
    /// The values of its controls, by name.
    pub values: Vec<(String, f64)>,
}

/// A contact log and how to read it.
#[derive(Debug, Clone, PartialEq)]
pub struct Contacts {
    /// The log.
    pub log: Asset,
    /// What its columns and units mean.
    pub columns: ContactColumns,
    /// Length of the simulation's step in seconds; `None`: found from the log's time stamps.
    pub step_s: Option<f64>,
    /// Gravity in metres a second squared, by which momentum tells what a thinned log does not.
    pub gravity_mps2: [f64; 3],
}

/// Objects whose contacts are found from how they move.
#[derive(Debug, Clone, PartialEq)]
pub struct Touching {
    /// Names of objects or of their bodies, or patterns; not empty.
    pub bodies: Vec<NamePattern>,
    /// What pulls them, in m/s².
    pub gravity_mps2: [f64; 3],
}

impl Scene {
    /// What sound goes through.
    pub fn medium(&self) -> Medium {
        // Where nothing is said of the air it takes nothing.
        Medium::new(self.speed_of_sound_mps, self.air.map_or([0.0; 8], |air| air.band_absorption_db_per_m()))
    }

    /// Whether it is in a room that reverberates behind the reflections that are heard one by one.
    pub fn reverberates(&self) -> bool {
        matches!(&self.enclosing, Some(Enclosing::Room(about)) if about.has_tail)
    }

    /// Gives the listener another layout than the scene does.
    ///
    /// # Errors
    /// A scene with microphones of its own.
    pub fn set_layout(&mut self, layout: Layout) -> Result<()> {
        let Some(listener) = &mut self.listener else {
            return Err(Error::new("the scene has microphones of its own, and a layout is for a listener")
                .in_file(&self.file)
                .help("leave the layout out, or give the scene a `[listener]` instead"));
        };
        listener.set_layout(layout).map_err(|fault| fault.in_file(&self.file))?;
        self.microphones = listener.microphones();
        Ok(())
    }
}
