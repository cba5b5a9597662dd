//! A scene with its animations opened: where everything is at any moment.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use super::alembic::Alembic;
use super::animation::{Animation, KeyTimes, Mesh, ObjectKind, Topology, Transform};
use super::asset::NamePattern;
use super::conventions::Conventions;
use super::converted::Converted;
use super::fed::{Fed, FedPose};
use super::file::{Microphone, Motion, Point, Scene, Source, Swarm};
use super::format::AnimationFormat;
use super::gltf::Gltf;
use super::obj::Obj;
use super::point_cache::PointCache;
use super::pose_log::PoseLog;
use super::track::{Interpolation, Track, facing_frame};
use super::wander::Wander;
use super::wind::WindField;
use crate::motion::body::BodyState;
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

/// Something that is somewhere at every moment.
#[derive(Clone)]
pub struct Carrier {
    way: Way,
    /// Where its sounds come from.
    point: Point,
    /// Seconds that the soundtrack's time 0 comes after that of the way.
    origin_s: f64,
    /// How often a hand-set track is sampled.
    frame_rate_hz: f64,
}

#[derive(Clone)]
enum Way {
    Track(Arc<Track>),
    Animated {
        animation: Arc<dyn Animation>,
        object: usize,
        mesh: Arc<Mutex<Mesh>>,
    },
    /// What is told to move while it does.
    Fed(Arc<Fed>),
    /// A member of a swarm, which strays about what carries the swarm.
    Member {
        middle: Arc<Carrier>,
        stray: Stray,
    },
}

/// How a member of a swarm is away from its middle, in metres.
#[derive(Clone)]
enum Stray {
    /// It wanders, so far from the middle.
    Wander(Arc<[Wander; 3]>, f64),
    /// A script says where, by the number of the member.
    Scripted(Flight, usize),
}

impl Stray {
    fn at(&self, time_s: f64) -> Result<[f64; 3]> {
        match self {
            Stray::Wander(axes, radius_m) => Ok(std::array::from_fn(|axis| radius_m * axes[axis].at(time_s))),
            Stray::Scripted(flight, member) => flight.position_m(*member, time_s),
        }
    }
}

/// The mean speed in space of what has a standard deviation of 1 along each axis: √(8/π).
const MEAN_SPEED: f64 = 1.595_769_121_605_731;

/// Keeps the random numbers of swarms apart from others of the same seed.
const SWARMS: u64 = 0x5a72_0000_0000_0000;

impl Carrier {
    /// Something that stands still.
    pub fn still(position_m: [f64; 3]) -> Self {
        Self::still_facing(position_m, [0.0, 0.0, -1.0])
    }

    /// Something that stands still and faces some direction, a unit vector.
    pub fn still_facing(position_m: [f64; 3], facing: [f64; 3]) -> Self {
        let key = super::track::TrackKey { time_s: 0.0, position_m, facing };
        let track = Track { keys: vec![key], interpolation: Interpolation::Linear };
        let way = Way::Track(Arc::new(track));
        Self { way, point: Point::Offset([0.0; 3]), origin_s: 0.0, frame_rate_hz: 1.0 }
    }

    /// The same carrier, with another point of it: a world position that is fixed to it from a
    /// moment on, such as where it was hit.
    ///
    /// # Errors
    /// A sample that cannot be read.
    pub fn holding(&self, position_m: [f64; 3], time_s: f64) -> Result<Self> {
        let local = match into_local(&self.frame(time_s)?, position_m) {
            Some(local) => Point::Offset(local),
            // Scaled to nothing: there is no place on it but its own.
            None => Point::Offset([0.0; 3]),
        };
        Ok(Self { point: local, ..self.clone() })
    }

    /// The local-to-world transform at a time of the soundtrack.
    ///
    /// # Errors
    /// A sample that cannot be read.
    pub fn frame(&self, time_s: f64) -> Result<Transform> {
        match &self.way {
            Way::Track(track) => Ok(track.frame(time_s + self.origin_s)),
            Way::Fed(fed) => Ok(fed.frame(time_s)),
            Way::Animated { animation, object, .. } => animation.transform(*object, time_s + self.origin_s),
            Way::Member { middle, stray } => {
                let mut frame = middle.frame(time_s)?;
                let (at, away) = (middle.position_m(time_s)?, stray.at(time_s)?);
                (0..3).for_each(|i| frame[i][3] = at[i] + away[i]);
                Ok(frame)
            }
        }
    }

    /// Where it is as a rigid body at a time of the soundtrack and how it moves, if it is animated by a file. Where the
    /// file does not state velocities they are the mean ones since the sample before.
    ///
    /// # Errors
    /// A sample that cannot be read.
    pub fn state(&self, time_s: f64) -> Result<Option<BodyState>> {
        let Way::Animated { animation, object, .. } = &self.way else { return Ok(None) };
        let file_s = time_s + self.origin_s;
        let mut state = rigid(&animation.transform(*object, file_s)?);
        let stated = animation.velocity(*object, file_s)?;
        let mut velocities = [[0.0; 3]; 2];
        if (stated.linear_mps.is_none() || stated.angular_rps.is_none())
            && let Some(times) = animation.objects().get(*object).map(|object| &object.key_times)
        {
            let at = times.bracket(file_s);
            let (from, to) = if at.ceiling > at.floor {
                (at.floor as usize, at.ceiling as usize)
            } else {
                (at.floor.saturating_sub(1) as usize, at.floor as usize)
            };
            if let (Some(from_s), Some(to_s)) = (times.get(from), times.get(to))
                && to_s > from_s
                && (from_s..=to_s + 1e-3 * (to_s - from_s)).contains(&file_s)
            {
                let before = rigid(&animation.transform(*object, from_s)?);
                let after = rigid(&animation.transform(*object, to_s)?);
                velocities = BodyState::velocities_between(&before, &after, to_s - from_s);
            }
        }
        state.velocity_mps = stated.linear_mps.unwrap_or(velocities[0]);
        state.angular_velocity_rps = stated.angular_rps.unwrap_or(velocities[1]);
        let finite = [state.position_m, state.velocity_mps, state.angular_velocity_rps].concat();
        if finite.iter().chain(&state.rotation).all(|c| c.is_finite()) {
            Ok(Some(state))
        } else {
            Err(self.fault(format!("is at no finite position at {time_s} s")))
        }
    }

    /// Whether its file states how fast it moves.
    pub fn states_velocity(&self) -> bool {
        let Way::Animated { animation, object, .. } = &self.way else { return false };
        let first_s = animation.objects().get(*object).and_then(|object| object.key_times.get(0));
        animation
            .velocity(*object, first_s.unwrap_or_default())
            .is_ok_and(|velocity| velocity.linear_mps.is_some())
    }

    /// The time of its last sample at or before a time of the soundtrack, if it is animated by a file.
    pub fn sample_before_s(&self, time_s: f64) -> Option<f64> {
        let Way::Animated { animation, object, .. } = &self.way else { return None };
        let times = &animation.objects().get(*object)?.key_times;
        let sample_s = times.get(times.bracket(time_s + self.origin_s).floor as usize)?;
        (sample_s <= time_s + self.origin_s).then_some(sample_s - self.origin_s)
    }

    /// How fast it moves at a time of the soundtrack, in metres a second. Where it jumps, that is not
    /// counted as motion.
    ///
    /// # Errors
    /// As [`Carrier::position_m`].
    pub fn velocity_mps(&self, time_s: f64) -> Result<[f64; 3]> {
        let (before, here, after) = (
            self.position_m(time_s - VELOCITY_STEP_S)?,
            self.position_m(time_s)?,
            self.position_m(time_s + VELOCITY_STEP_S)?,
        );
        let speed = |a: [f64; 3], b: [f64; 3]| -> [f64; 3] {
            std::array::from_fn(|i| (b[i] - a[i]) / VELOCITY_STEP_S)
        };
        let length = |v: [f64; 3]| v.iter().map(|c| c * c).sum::<f64>().sqrt();
        let (come, go) = (speed(before, here), speed(here, after));
        let (slow, fast) = if length(come) < length(go) { (come, go) } else { (go, come) };
        if length(fast) > JUMP_MPS && length(fast) > JUMP_RATIO * length(slow) {
            return Ok(slow);
        }
        Ok(std::array::from_fn(|i| 0.5 * (come[i] + go[i])))
    }

    /// Where its sounds come from at a time of the soundtrack, in metres.
    ///
    /// # Errors
    /// A sample that cannot be read; a vertex that the mesh does not have; a position that is not a
    /// number.
    pub fn position_m(&self, time_s: f64) -> Result<[f64; 3]> {
        let position = match (&self.way, self.point) {
            (Way::Track(track), Point::Offset([0.0, 0.0, 0.0])) => track.position_m(time_s + self.origin_s),
            (Way::Animated { animation, object, mesh }, Point::Vertex(vertex)) => {
                let mut mesh = mesh.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                animation.mesh(*object, time_s + self.origin_s, &mut mesh)?;
                let position = mesh.positions.get(vertex).ok_or_else(|| {
                    self.fault(format!(
                        "has no vertex {vertex} at {time_s} s: its mesh has {}",
                        mesh.positions.len()
                    ))
                    .help("they are counted from 0")
                })?;
                position.map(f64::from)
            }
            (_, Point::Offset(offset)) => into_world(&self.frame(time_s)?, offset),
            (Way::Track(track), Point::Vertex(_)) => track.position_m(time_s + self.origin_s),
            (Way::Member { .. } | Way::Fed(_), Point::Vertex(_)) => {
                into_world(&self.frame(time_s)?, [0.0; 3])
            }
        };
        if position.iter().all(|c| c.is_finite()) {
            Ok(position)
        } else {
            Err(self.fault(format!("is at no finite position at {time_s} s")))
        }
    }

    /// How its mesh changes; [`Topology::None`] where it has none.
    pub fn topology(&self) -> Topology {
        match &self.way {
            Way::Track(_) | Way::Fed(_) | Way::Member { .. } => Topology::None,
            Way::Animated { animation, object, .. } => {
                animation.objects().get(*object).map_or(Topology::None, |o| o.topology)
            }
        }
    }

    /// Its mesh at a time of the soundtrack, in world space, into a buffer that is reused between calls.
    ///
    /// # Errors
    /// No mesh, or a sample that cannot be read.
    pub fn mesh(&self, time_s: f64, mesh: &mut Mesh) -> Result<()> {
        match &self.way {
            Way::Track(_) | Way::Fed(_) | Way::Member { .. } => Err(self.fault("has no mesh".to_owned())),
            Way::Animated { animation, object, .. } => animation.mesh(*object, time_s + self.origin_s, mesh),
        }
    }

    /// A number for each vertex of its mesh at a time, which its file has by a name.
    ///
    /// # Errors
    /// A carrier without a mesh, a name that its file does not know, or a sample that cannot be read.
    pub fn vertex_values(&self, name: &str, time_s: f64, values: &mut Vec<f32>) -> Result<()> {
        match &self.way {
            Way::Track(_) | Way::Fed(_) | Way::Member { .. } => Err(self.fault("has no mesh".to_owned())),
            Way::Animated { animation, object, .. } => {
                animation.vertex_values(*object, name, time_s + self.origin_s, values)
            }
        }
    }

    /// The path of the object in its file; `track` for a hand-set track.
    pub fn name(&self) -> String {
        match &self.way {
            Way::Track(_) => "track".to_owned(),
            Way::Fed(_) => "what is told".to_owned(),
            Way::Member { middle, .. } => format!("{} of a swarm", middle.name()),
            Way::Animated { animation, object, .. } => {
                animation.objects().get(*object).map_or_else(String::new, |o| o.path.clone())
            }
        }
    }

    fn fault(&self, what: String) -> Error {
        match &self.way {
            Way::Track(_) => Error::new(format!("the track {what}")),
            Way::Fed(_) => Error::new(format!("what is told to move {what}")),
            Way::Member { .. } => Error::new(format!("a member of a swarm {what}")),
            Way::Animated { animation, object, .. } => {
                let path = animation.objects().get(*object).map_or("", |o| &o.path);
                Error::new(what).at(Place::Part(path.to_owned()))
            }
        }
    }

    /// The next time after `time_s` at which its motion has a key, if any. A hand-set track has keys
    /// on a grid of its frame rate besides its own.
    pub fn next_key_s(&self, time_s: f64) -> Option<f64> {
        let time = time_s + self.origin_s;
        // The small part keeps a grid time from being followed by itself.
        let on_grid = |time: f64| ((time * self.frame_rate_hz + 1e-6).floor() + 1.0) / self.frame_rate_hz;
        let next = match &self.way {
            // It may be told to move for as long as somebody asks.
            Way::Fed(_) => return Some(if time_s < 0.0 { 0.0 } else { on_grid(time_s) }),
            Way::Member { middle, .. } => {
                // It flies for as long as somebody asks.
                let next_s = on_grid(time_s);
                return Some(middle.next_key_s(time_s).map_or(next_s, |key_s| key_s.min(next_s)));
            }
            Way::Track(track) => {
                let (first, last) = (track.keys.first()?.time_s, track.keys.last()?.time_s);
                if time >= last || first == last {
                    return None;
                }
                let own = track.keys[track.keys.partition_point(|key| key.time_s <= time)].time_s;
                let grid = match track.interpolation {
                    Interpolation::Step => own,
                    _ if time < first => first,
                    _ => on_grid(time),
                };
                own.min(grid)
            }
            Way::Animated { animation, object, .. } => {
                let times = &animation.objects().get(*object)?.key_times;
                let next = match times {
                    KeyTimes::Static => return None,
                    KeyTimes::Uniform { start_s, step_s, .. } => {
                        ((time - start_s) / step_s + 1e-6).floor().max(-1.0) as usize + 1
                    }
                    KeyTimes::Listed(times) => times.partition_point(|&t| t <= time),
                };
                // A floor of −1 is the key before the first.
                let next = if times.get(0)? > time { 0 } else { next };
                times.get(next)?
            }
        };
        Some(next - self.origin_s).filter(|&next_s| next_s > time_s)
    }

    /// How many keys its motion has, from a file; those of a hand-set track count as none.
    pub fn key_count(&self) -> usize {
        match &self.way {
            Way::Track(_) | Way::Fed(_) | Way::Member { .. } => 0,
            Way::Animated { animation, object, .. } => {
                animation.objects().get(*object).map_or(0, |object| object.key_times.len())
            }
        }
    }

    /// True where it is suddenly elsewhere at a time, not on its way there from `before_s`.
    ///
    /// A track in steps says so. An animation does not: there a jump is a frame in which the object
    /// is more than eight times as fast as in the frames before and after, and faster than 20 m/s.
    ///
    /// # Errors
    /// A sample that cannot be read.
    pub fn jumps_at(&self, time_s: f64, before_s: f64) -> Result<bool> {
        if self.next_key_s(before_s).is_none_or(|key_s| key_s > time_s) {
            return Ok(false);
        }
        match &self.way {
            Way::Track(track) => Ok(track.interpolation == Interpolation::Step),
            Way::Member { middle, .. } => middle.jumps_at(time_s, before_s),
            // What no motion joins is found on the way to the microphones.
            Way::Fed(_) => Ok(false),
            Way::Animated { .. } => {
                let step_s = time_s - before_s;
                let speed = |a: f64, b: f64| -> Result<f64> {
                    let (p, q) = (self.position_m(a)?, self.position_m(b)?);
                    Ok((0..3).map(|i| (q[i] - p[i]).powi(2)).sum::<f64>().sqrt() / step_s)
                };
                let here = speed(before_s, time_s)?;
                if here < JUMP_MPS {
                    return Ok(false);
                }
                let around = speed(before_s - step_s, before_s)?.max(speed(time_s, time_s + step_s)?);
                Ok(here > JUMP_RATIO * around)
            }
        }
    }

    /// The last time at which it moves, in seconds of the soundtrack.
    pub fn end_s(&self) -> f64 {
        let end = match &self.way {
            Way::Track(track) if track.keys.len() > 1 => track.keys.last().map(|key| key.time_s),
            Way::Track(_) | Way::Fed(_) => None,
            Way::Member { middle, .. } => return middle.end_s(),
            Way::Animated { animation, object, .. } => {
                animation.objects().get(*object).and_then(|o| o.key_times.span_s()).map(|(_, end)| end)
            }
        };
        end.map_or(0.0, |end| end - self.origin_s)
    }
}

/// Slower than this, in metres a second, nothing is taken to have jumped.
const JUMP_MPS: f64 = 20.0;

/// Positions so many seconds apart tell the velocity.
const VELOCITY_STEP_S: f64 = 0.005;

/// How much faster than the frames around it a jump is.
const JUMP_RATIO: f64 = 8.0;

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

    /// Lets an object be told to move, with a key every `step_s` seconds. Until then it stands where it is at time 0; that
    /// of which no place is known, at the origin.
    ///
    /// # Errors
    /// An object that is not one body; a place that cannot be read.
    pub fn feed_object(&mut self, index: usize, step_s: f64) -> Result<Arc<Fed>> {
        let bodies = self.objects.get_mut(index).map(Vec::as_mut_slice);
        let Some([body]) = bodies else {
            let count = bodies.map_or(0, |bodies| bodies.len());
            return Err(
                Error::new(format!("an object of {count} bodies is to be moved")).help("move one body")
            );
        };
        let (carrier, fed) = fed_carrier(body.carrier.as_ref(), step_s)?;
        body.carrier = Some(carrier);
        Ok(fed)
    }

    /// Lets the listener be told to move, and all microphones with it, likewise: they sit on it as they do in the scene.
    ///
    /// # Errors
    /// A place that cannot be read.
    pub fn feed_listener(&mut self, step_s: f64) -> Result<Arc<Fed>> {
        let (carrier, fed) = fed_carrier(self.ears.first().map(|ear| &ear.carrier), step_s)?;
        for ear in &mut self.ears {
            ear.carrier = Carrier { point: ear.carrier.point, ..carrier.clone() };
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

/// What carries something that is told to move, and stands until then as another carrier does at time 0.
fn fed_carrier(before: Option<&Carrier>, step_s: f64) -> Result<(Carrier, Arc<Fed>)> {
    let pose = match before {
        None => FedPose::at([0.0; 3]),
        Some(before) => {
            let state = rigid(&before.frame(0.0)?);
            FedPose { position_m: state.position_m, rotation: state.rotation }
        }
    };
    let fed = Arc::new(Fed::new(pose));
    let point = before.map_or(Point::Offset([0.0; 3]), |before| before.point);
    let way = Way::Fed(fed.clone());
    Ok((Carrier { way, point, origin_s: 0.0, frame_rate_hz: 1.0 / step_s }, fed))
}

fn track_carrier(track: &Track, point: Point, frame_rate_hz: f64) -> Carrier {
    Carrier { way: Way::Track(Arc::new(track.clone())), point, origin_s: 0.0, frame_rate_hz }
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

fn into_world(frame: &Transform, [x, y, z]: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| frame[i][0] * x + frame[i][1] * y + frame[i][2] * z + frame[i][3])
}

/// Where a transform puts its body and how it turns it; what it scales is left out.
fn rigid(frame: &Transform) -> BodyState {
    let column = |k: usize| glam::DVec3::new(frame[0][k], frame[1][k], frame[2][k]);
    let x = column(0).try_normalize().unwrap_or(glam::DVec3::X);
    let y = column(1).reject_from_normalized(x).try_normalize().unwrap_or(x.any_orthonormal_vector());
    let rotation = glam::DQuat::from_mat3(&glam::DMat3::from_cols(x, y, x.cross(y)));
    BodyState { position_m: column(3).to_array(), rotation: rotation.to_array(), ..BodyState::STILL }
}

/// The local coordinates of a world position, if the transform can be inverted.
fn into_local(frame: &Transform, position: [f64; 3]) -> Option<[f64; 3]> {
    let column = |k: usize| glam::DVec3::new(frame[0][k], frame[1][k], frame[2][k]);
    let matrix = glam::DMat3::from_cols(column(0), column(1), column(2));
    let local = matrix.inverse() * (glam::DVec3::from(position) - column(3));
    local.is_finite().then(|| local.to_array())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::track::TrackKey;

    fn key(time_s: f64, x: f64) -> TrackKey {
        TrackKey { time_s, position_m: [x, 0.0, 0.0], facing: [1.0, 0.0, 0.0] }
    }

    #[test]
    fn a_track_is_sampled_at_its_keys_and_on_the_grid() {
        let track = Track {
            keys: vec![key(0.05, 0.0), key(0.23, 1.0), key(0.3, 2.0)],
            interpolation: Interpolation::Linear,
        };
        let carrier = track_carrier(&track, Point::Offset([0.0; 3]), 10.0);
        let mut times = vec![];
        let mut time = 0.0;
        while let Some(next) = carrier.next_key_s(time) {
            times.push(next);
            time = next;
        }
        assert_eq!(times, [0.05, 0.1, 0.2, 0.23, 0.3]);
        assert!(carrier.next_key_s(7.0).is_none() && Carrier::still([1.0; 3]).next_key_s(-1.0).is_none());
    }

    #[test]
    fn what_was_hit_carries_the_place_along() {
        let track = Track { keys: vec![key(0.0, 0.0), key(1.0, 10.0)], interpolation: Interpolation::Linear };
        let carrier = track_carrier(&track, Point::Offset([0.0; 3]), 10.0);
        let hit = carrier.holding([2.0, 3.0, 4.0], 0.2).unwrap();
        let there = hit.position_m(0.7).unwrap();
        assert!((0..3).all(|i| (there[i] - [7.0, 3.0, 4.0][i]).abs() < 1e-12), "{there:?}");
    }

    #[test]
    fn local_and_world_are_inverse() {
        let frame = facing_frame([1.0, 2.0, 3.0], [0.6, 0.0, 0.8]);
        let local = into_local(&frame, [4.0, -1.0, 0.5]).unwrap();
        let world = into_world(&frame, local);
        assert!((0..3).all(|i| (world[i] - [4.0, -1.0, 0.5][i]).abs() < 1e-12));
        assert_eq!(into_local(&[[0.0; 4]; 4], [1.0; 3]), None);
    }
}
