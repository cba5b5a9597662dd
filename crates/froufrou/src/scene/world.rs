//! A scene with its animations opened: where everything is at any moment.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use super::alembic::Alembic;
use super::animation::{Animation, Mesh, ObjectKind, Transform};
use super::asset::NamePattern;
use super::carrier::{Carrier, Stray, Way, fed_carrier, into_local, into_world, track_carrier};
use super::conventions::Conventions;
use super::converted::Converted;
use super::fed::Fed;
use super::file::{Microphone, Motion, Point, Scene, Source, Swarm};
use super::format::AnimationFormat;
use super::gltf::Gltf;
use super::obj::Obj;
use super::point_cache::PointCache;
use super::pose_log::PoseLog;
use super::track::facing_frame;
use super::wander::Wander;
use super::wind::WindField;
use crate::random::Random;
use crate::score::Pose;
use crate::synth::procedure::Flight;
use crate::{Error, Place, Result};

/// Opens an animation file of any format that is known, told apart by its content. A pattern in the
/// last part of the path, such as `sim/cloth_*.obj`, is a sequence of OBJ files.
///
/// # Errors
/// A file that cannot be read, or whose format is not known.
pub fn open_animation(path: impl AsRef<Path>) -> Result<Arc<dyn Animation>> {
    open_animation_as(path, &Conventions::default())
}

/// Opens an animation file as [`open_animation`] does, with what is known of it besides. What it
/// gives is in metres and Y up.
///
/// # Errors
/// As there; and conventions that this format has no use for.
pub fn open_animation_as(path: impl AsRef<Path>, conventions: &Conventions) -> Result<Arc<dyn Animation>> {
    let path = path.as_ref();
    conventions.check().map_err(|fault| fault.in_file(path))?;
    let format = AnimationFormat::of(path)?;
    let useless = |key: &str, why: &str| {
        Err(Error::new(format!("`{key}` means nothing for this {}: {why}", format.name()))
            .in_file(path)
            .help(format!("leave `{key}` out")))
    };
    if conventions.frame_rate_hz.is_some() && !format.counts_frames() {
        return useless("frame_rate", "it does not count frames");
    }
    if conventions.faces.is_some() && !format.has_no_faces() {
        return useless("faces", "it has faces of its own");
    }
    if conventions.clip.is_some() && !format.has_clips() {
        return useless("clip", "it is one clip");
    }
    if conventions.columns.is_some() && !format.has_columns() {
        return useless("columns", "it is no table");
    }
    let animation: Arc<dyn Animation> = match format {
        #[cfg(feature = "usd")]
        AnimationFormat::Usd => Arc::new(super::usd::Usd::open(path)?),
        #[cfg(not(feature = "usd"))]
        AnimationFormat::Usd => {
            return Err(Error::new("the file is USD, which this froufrou was built without")
                .in_file(path)
                .help("build it with the feature `usd`"));
        }
        AnimationFormat::Gltf => Arc::new(Gltf::open_clip(path, conventions.clip.as_deref())?),
        AnimationFormat::Alembic => Arc::new(Alembic::open(path)?),
        AnimationFormat::Pc2 | AnimationFormat::Mdd => Arc::new(PointCache::open(path, conventions)?),
        AnimationFormat::Obj => Arc::new(Obj::open(path)?),
        AnimationFormat::ObjSequence => Arc::new(Obj::open_sequence(path, conventions)?),
        AnimationFormat::PoseLog => {
            Arc::new(PoseLog::open(path, &conventions.columns.clone().unwrap_or_default())?)
        }
    };
    Ok(Converted::wrap(animation, conventions))
}

/// The mean speed in space of what has a standard deviation of 1 along each axis: √(8/π).
const MEAN_SPEED: f64 = 1.595_769_121_605_731;

/// Keeps the random numbers of swarms apart from others of the same seed.
const SWARMS: u64 = 0x5a72_0000_0000_0000;

/// An object of the world: what the scene calls one name may be several objects of a file.
pub struct Body {
    /// The name that its stem bears.
    pub name: String,
    /// What carries it; `None` for what is known from contact logs alone.
    pub carrier: Option<Carrier>,
}

/// Which of the bodies of an object is the one of a name in a log: the one at the end of whose path the name stands,
/// and the only one there is whatever it is called.
pub fn body_named<'b>(bodies: &'b [Body], object: &str, name: &str) -> Option<&'b Body> {
    let whole = |body: &&Body| {
        let path = body.name.strip_prefix(object).and_then(|path| path.strip_prefix('/'));
        path == Some(name)
    };
    let last = |body: &&Body| body.name.rsplit('/').next() == Some(name);
    let only = || if let [only] = bodies { Some(only) } else { None };
    bodies.iter().find(whole).or_else(|| bodies.iter().find(last)).or_else(only)
}

/// The objects of a scene as rigid bodies that logs name, as far as files say how they move.
#[derive(Clone, Default)]
pub struct RigidBodies {
    objects: Vec<RigidObject>,
}

/// An object of a scene, whose bodies logs name.
#[derive(Clone)]
struct RigidObject {
    /// The names of its bodies in the logs.
    named: NamePattern,
    name: String,
    bodies: Arc<[Body]>,
    mass_kg: Option<f64>,
}

impl RigidBodies {
    /// The objects that have a `source`.
    pub fn of(scene: &Scene, world: &World) -> Self {
        let objects = scene.objects.iter().zip(&world.objects);
        let moving = objects.filter(|(object, _)| matches!(object.motion, Some(Motion::Source(_))));
        let objects = moving.map(|(object, bodies)| {
            let copy = |body: &Body| Body { name: body.name.clone(), carrier: body.carrier.clone() };
            RigidObject {
                named: object.body.clone(),
                name: object.name.clone(),
                bodies: bodies.iter().map(copy).collect(),
                mass_kg: object.mass_kg,
            }
        });
        Self { objects: objects.collect() }
    }

    /// True where no object has a `source`.
    pub fn is_empty(&self) -> bool {
        self.objects.is_empty()
    }

    /// The mass that the scene gives the body of a name, in kilograms.
    pub fn mass_kg(&self, name: &str) -> Option<f64> {
        self.objects.iter().find(|object| object.named.matches(name))?.mass_kg
    }

    /// What carries the body of a name; nothing where no file does.
    pub fn carrier(&self, name: &str) -> Option<&Carrier> {
        let object = self.objects.iter().find(|object| object.named.matches(name))?;
        body_named(&object.bodies, &object.name, name)?
            .carrier
            .as_ref()
            .filter(|carrier| matches!(carrier.way, Way::Animated { .. }))
    }
}

/// A microphone in the world.
pub struct Ear {
    carrier: Carrier,
    offset_m: [f64; 3],
    facing: [f64; 3],
    /// The direction that is up for it, where that matters.
    up: Option<[f64; 3]>,
}

impl Ear {
    /// Where it is and which way it faces at a time of the soundtrack.
    ///
    /// # Errors
    /// A sample that cannot be read, or a position that is not a number.
    pub fn pose(&self, time_s: f64) -> Result<Pose> {
        let frame = self.carrier.frame(time_s)?;
        let position_m = into_world(&frame, self.offset_m);
        let turned = |local: [f64; 3]| {
            let world: [f64; 3] = std::array::from_fn(|i| (0..3).map(|k| frame[i][k] * local[k]).sum());
            let length = world.iter().map(|c| c * c).sum::<f64>().sqrt();
            (length.is_finite() && length > 0.0).then(|| world.map(|c| c / length))
        };
        let nowhere = || self.carrier.fault(format!("is at no place to hear from at {time_s} s"));
        let facing = turned(self.facing).ok_or_else(nowhere)?;
        if !position_m.iter().all(|c| c.is_finite()) {
            return Err(nowhere());
        }
        let up = self.up.map(|up| turned(up).ok_or_else(nowhere)).transpose()?;
        // Rounded far below what is heard, so that a score is good to read.
        let tidy = |c: f64| (c * 1e9).round() / 1e9 + 0.0;
        let level = Pose::upright(position_m.map(tidy), facing.map(tidy));
        Ok(match up {
            Some(up) if !is_upright(facing, up) => Pose { up: up.map(tidy), ..level },
            _ => level,
        })
    }

    /// What carries it.
    pub fn carrier(&self) -> &Carrier {
        &self.carrier
    }

    /// Takes its place and its directions at time 0 as they lie in another frame, so that what is there may carry it.
    fn sit_on(&mut self, other: &Transform) -> Result<()> {
        let own = self.carrier.frame(0.0)?;
        let nowhere = || self.carrier.fault("is at no place to hear from at 0 s".to_owned());
        let place = |own: &Transform, other: &Transform, local: [f64; 3]| {
            into_local(other, into_world(own, local)).ok_or_else(nowhere)
        };
        let turned = |local| place(&unmoved(&own), &unmoved(other), local);
        let (offset_m, facing) = (place(&own, other, self.offset_m)?, turned(self.facing)?);
        let up = self.up.map(turned).transpose()?;
        (self.offset_m, self.facing, self.up) = (offset_m, facing, up);
        Ok(())
    }
}

/// A transform that turns and scales as another one, and moves nothing.
fn unmoved(frame: &Transform) -> Transform {
    let mut unmoved = *frame;
    unmoved[..3].iter_mut().for_each(|row| row[3] = 0.0);
    unmoved
}

/// True where a head that faces a direction and holds itself upright has this direction up, and is far from
/// looking straight up or down. Both are unit vectors.
fn is_upright(facing: [f64; 3], up: [f64; 3]) -> bool {
    let frame = facing_frame([0.0; 3], facing);
    let along: f64 = (0..3).map(|row| frame[row][1] * up[row]).sum();
    facing[1].abs() < 0.99 && along > 1.0 - 1e-12
}

/// A scene with its animations opened.
pub struct World {
    /// The bodies of each object of the scene, in its order.
    pub objects: Vec<Vec<Body>>,
    /// The microphones of the scene, in its order.
    pub ears: Vec<Ear>,
    /// The wind that blows through it.
    pub wind: Option<WindField>,
}

impl World {
    /// Opens the animations of a scene and finds its objects in them.
    ///
    /// # Errors
    /// An animation that cannot be read, or an object that is not in it.
    pub fn open(scene: &Scene) -> Result<Self> {
        let mut files = Files::open(scene)?;
        let frame_rate_hz = scene.frame_rate_hz;
        let mut objects = Vec::with_capacity(scene.objects.len());
        for (index, object) in scene.objects.iter().enumerate() {
            let carriers: Vec<(Option<String>, Option<Carrier>)> = match &object.motion {
                None => vec![(None, None)],
                Some(Motion::Track(track)) => {
                    vec![(None, Some(track_carrier(track, object.point, frame_rate_hz)))]
                }
                Some(Motion::Source(source)) => {
                    let found = files.find(source)?;
                    let several = found.len() > 1;
                    let carriers = found.into_iter().map(|(path, way, origin_s)| {
                        let carrier = Carrier { way, point: object.point, origin_s, frame_rate_hz };
                        (several.then_some(path), Some(carrier))
                    });
                    carriers.collect()
                }
            };
            let bodies = carriers.into_iter().map(|(path, carrier)| {
                let name = path.map_or_else(|| object.name.clone(), |path| format!("{}{path}", object.name));
                Body { name, carrier }
            });
            objects.push(match &object.swarm {
                None => bodies.collect(),
                Some(swarm) => {
                    let random = Random::new(scene.seed, SWARMS + index as u64);
                    let flight = swarm.script.as_ref().map(|script| Flight::open(&script.path, random));
                    let flight = flight.transpose()?;
                    bodies.flat_map(|body| members(swarm, body, random, flight.as_ref())).collect()
                }
            });
        }
        let ears = scene.microphones.iter().map(|microphone| files.ear(microphone, frame_rate_hz));
        let wind = scene.wind.map(|wind| WindField::new(wind, scene.seed));
        Ok(Self { ears: ears.collect::<Result<_>>()?, objects, wind })
    }

    /// Lets an object be told to move, with a key every `step_s` seconds, and its mesh too where that `has_mesh`. Until then
    /// it stands where it is at time 0, with the mesh that it has then; that of which no place is known, at the origin.
    ///
    /// # Errors
    /// An object that is not one body; a place or a mesh that cannot be read.
    pub fn feed_object(&mut self, index: usize, step_s: f64, has_mesh: bool) -> Result<Arc<Fed>> {
        let bodies = self.objects.get_mut(index).map(Vec::as_mut_slice);
        let Some([body]) = bodies else {
            let count = bodies.map_or(0, |bodies| bodies.len());
            return Err(
                Error::new(format!("an object of {count} bodies is to be moved")).help("move one body")
            );
        };
        let (carrier, fed) = fed_carrier(body.carrier.as_ref(), step_s, has_mesh)?;
        body.carrier = Some(carrier);
        Ok(fed)
    }

    /// Lets the listener be told to move, and all microphones with it, likewise. It begins where what carries the first of them
    /// is at time 0, and all sit on it as they lie to that then.
    ///
    /// # Errors
    /// A place that cannot be read.
    pub fn feed_listener(&mut self, step_s: f64) -> Result<Arc<Fed>> {
        let (carrier, fed) = fed_carrier(self.ears.first().map(|ear| &ear.carrier), step_s, false)?;
        let listener = fed.frame(0.0);
        for ear in &mut self.ears {
            ear.sit_on(&listener)?;
            ear.carrier = Carrier { point: Point::Offset(ear.offset_m), ..carrier.clone() };
        }
        Ok(fed)
    }

    /// The last time at which anything moves, in seconds of the soundtrack.
    pub fn end_s(&self) -> f64 {
        let bodies = self.objects.iter().flatten().filter_map(|body| body.carrier.as_ref());
        bodies.chain(self.ears.iter().map(|ear| &ear.carrier)).map(Carrier::end_s).fold(0.0, f64::max)
    }
}

/// The members of a swarm about a body.
fn members(swarm: &Swarm, body: Body, random: Random, flight: Option<&Flight>) -> Vec<Body> {
    let Some(middle) = body.carrier.map(Arc::new) else { return Vec::new() };
    let rate = swarm.speed_mps / (MEAN_SPEED * swarm.radius_m);
    let member = |number: usize| {
        let wander = |axis: usize| Wander::new(random, (3 * number + axis) as u64, rate);
        let stray = match flight {
            Some(flight) => Stray::Scripted(flight.clone(), number),
            None => Stray::Wander(Arc::new(std::array::from_fn(wander)), swarm.radius_m),
        };
        let carrier = Carrier {
            way: Way::Member { middle: Arc::clone(&middle), stray },
            point: Point::Offset([0.0; 3]),
            origin_s: 0.0,
            frame_rate_hz: middle.frame_rate_hz,
        };
        Body { name: format!("{}/{}", body.name, number + 1), carrier: Some(carrier) }
    };
    (0..swarm.count).map(member).collect()
}

/// A file, by the conventions that it was opened with.
type Opening = (Conventions, Arc<dyn Animation>);

/// Opened files; more than once where they are taken to mean different things.
#[derive(Default)]
struct Opened(BTreeMap<PathBuf, Vec<Opening>>);

impl Opened {
    fn of(&self, source: &Source) -> Option<&Arc<dyn Animation>> {
        let mut opened = self.0.get(&source.file.path)?.iter();
        opened.find(|(conventions, _)| *conventions == source.conventions).map(|(_, animation)| animation)
    }
}

/// The animation files of a scene, each opened once for each of the conventions it is read by.
struct Files {
    opened: Opened,
    /// The time in the files' clock at which the soundtrack begins.
    start_s: f64,
}

impl Files {
    fn open(scene: &Scene) -> Result<Self> {
        let motions = scene.objects.iter().filter_map(|o| o.motion.as_ref());
        let mut opened = Opened::default();
        for motion in motions.chain(scene.microphones.iter().map(|m| &m.motion)) {
            if let Motion::Source(source) = motion
                && opened.of(source).is_none()
            {
                let animation = open_animation_as(&source.file.path, &source.conventions)?;
                opened
                    .0
                    .entry(source.file.path.clone())
                    .or_default()
                    .push((source.conventions.clone(), animation));
            }
        }
        // Logs are on the soundtrack's clock, wherever they begin.
        let first = |animation: &Arc<dyn Animation>| {
            if animation.is_log() {
                return f64::INFINITY;
            }
            let starts = animation.objects().iter().filter_map(|o| o.key_times.span_s());
            starts.map(|(start, _)| start).fold(f64::INFINITY, f64::min)
        };
        let earliest =
            opened.0.values().flatten().map(|(_, animation)| first(animation)).fold(f64::INFINITY, f64::min);
        let start_s = scene.start_s.unwrap_or(if earliest.is_finite() { earliest } else { 0.0 });
        Ok(Self { opened, start_s })
    }

    /// The objects that a source names: their path, their way and the time their soundtrack begins.
    fn find(&mut self, source: &Source) -> Result<Vec<(String, Way, f64)>> {
        let Some(animation) = self.opened.of(source) else {
            return Err(Error::new("the animation was not opened").in_file(&source.file.path));
        };
        let all = animation.objects();
        let mut found: Vec<usize> = (0..all.len()).filter(|&i| source.object.matches(&all[i].path)).collect();
        // Exporters put a mesh or camera under a transform of its name. Where both match, or the
        // transform alone was named, one of them is the object.
        let is_parent = |parent: usize, child: usize| {
            all[child].path.strip_prefix(&all[parent].path).is_some_and(|rest| rest.starts_with('/'))
        };
        let shapes: Vec<usize> =
            found.iter().copied().filter(|&i| all[i].kind != ObjectKind::Transform).collect();
        let parents: Vec<usize> =
            found.iter().copied().filter(|&i| shapes.iter().any(|&shape| is_parent(i, shape))).collect();
        found.retain(|i| !parents.contains(i));
        // It goes by the name of the transform that is its own.
        let named = |object: usize| {
            let own =
                |&p: &usize| is_parent(p, object) && shapes.iter().filter(|&&s| is_parent(p, s)).count() == 1;
            parents.iter().copied().find(own).unwrap_or(object)
        };
        let mut found: Vec<(usize, usize)> = found.iter().map(|&object| (object, named(object))).collect();
        for (object, _) in &mut found {
            let children: Vec<usize> = (0..all.len()).filter(|&c| is_parent(*object, c)).collect();
            if let [only] = children[..]
                && all[*object].kind == ObjectKind::Transform
                && all[only].kind != ObjectKind::Transform
            {
                *object = only;
            }
        }
        if found.is_empty() {
            let names = all.iter().map(|o| o.path.as_str());
            let help = match nearest(source.object.text(), names) {
                Some(near) => format!("did you mean `{near}`?"),
                None => "`froufrou info` on the file lists its objects".to_owned(),
            };
            return Err(Error::new("no object of the file has this path")
                .in_file(&source.file.path)
                .at(Place::Part(source.object.text().to_owned()))
                .help(help));
        }
        let start_s = if animation.is_log() { 0.0 } else { self.start_s };
        let ways = found.into_iter().map(|(object, named)| {
            let mesh = Arc::new(Mutex::new(Mesh::default()));
            let way = Way::Animated { animation: Arc::clone(animation), object, mesh };
            (all[named].path.clone(), way, start_s - source.time_offset_s)
        });
        Ok(ways.collect())
    }

    fn ear(&mut self, microphone: &Microphone, frame_rate_hz: f64) -> Result<Ear> {
        let point = Point::Offset(microphone.local_offset_m);
        let carrier = match &microphone.motion {
            Motion::Track(track) => track_carrier(track, point, frame_rate_hz),
            Motion::Source(source) => {
                let mut found = self.find(source)?;
                if found.len() > 1 {
                    return Err(Error::new(format!(
                        "{} objects match; a microphone rides on one",
                        found.len()
                    ))
                    .in_file(&source.file.path)
                    .at(Place::Part(source.object.text().to_owned()))
                    .help("name it without `*`"));
                }
                let (_, way, origin_s) = found.remove(0);
                Carrier { way, point, origin_s, frame_rate_hz }
            }
        };
        let facing = microphone.local_facing;
        let up = microphone.pickup.is_turned().then(|| {
            let frame = facing_frame([0.0; 3], facing);
            [frame[0][1], frame[1][1], frame[2][1]]
        });
        Ok(Ear { carrier, offset_m: microphone.local_offset_m, facing, up })
    }
}

fn nearest<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let distance = |known: &str| strsim::normalized_damerau_levenshtein(name, known);
    known
        .map(|k| (distance(k), k))
        .filter(|&(d, _)| d > 0.5)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, k)| k)
}
