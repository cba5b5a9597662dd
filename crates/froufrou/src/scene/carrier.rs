//! What carries things: where something is at any moment, by a track, an animation, a swarm, or as it is told.

use std::sync::{Arc, Mutex};

use super::animation::{Animation, KeyTimes, Mesh, Topology, Transform};
use super::fed::{Fed, FedPose};
use super::file::Point;
use super::track::{Interpolation, Track};
use super::wander::Wander;
use crate::motion::body::BodyState;
use crate::synth::procedure::Flight;
use crate::{Error, Place, Result};

/// Something that is somewhere at every moment.
#[derive(Clone)]
pub struct Carrier {
    pub(super) way: Way,
    /// Where its sounds come from.
    pub(super) point: Point,
    /// Seconds that the soundtrack's time 0 comes after that of the way.
    pub(super) origin_s: f64,
    /// How often a hand-set track is sampled.
    pub(super) frame_rate_hz: f64,
}

/// By what it moves.
#[derive(Clone)]
pub(super) enum Way {
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
pub(super) enum Stray {
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

    /// Something that is told where it is, with a key every `step_s` seconds.
    pub fn fed(fed: Arc<Fed>, step_s: f64) -> Self {
        Self {
            way: Way::Fed(fed),
            point: Point::Offset([0.0; 3]),
            origin_s: 0.0,
            frame_rate_hz: 1.0 / step_s,
        }
    }

    /// The same carrier, with another point of it that sounds come from.
    pub fn from_point(self, point: Point) -> Self {
        Self { point, ..self }
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

    /// What goes evenly from where this one is at a time to where another one is at a later time, and stands there, with
    /// a key every `step_s` seconds. What cannot be asked where it is stands there at once.
    pub fn passing_to(&self, other: &Self, [from_s, to_s]: [f64; 2], step_s: f64) -> Self {
        let key = |carrier: &Self, time_s: f64| {
            let frame = carrier.frame(time_s).ok()?;
            let position_m = carrier.position_m(time_s).ok()?;
            let facing = glam::DVec3::new(-frame[0][2], -frame[1][2], -frame[2][2]).try_normalize()?;
            Some(super::track::TrackKey { time_s, position_m, facing: facing.to_array() })
        };
        match (key(self, from_s), key(other, to_s)) {
            (Some(from), Some(to)) if to_s > from_s => {
                let track = Track { keys: vec![from, to], interpolation: Interpolation::Linear };
                track_carrier(&track, Point::Offset([0.0; 3]), 1.0 / step_s)
            }
            _ => other.clone(),
        }
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
        if self.is_fed() {
            // Nobody knows where it will be.
            let (before, here) = (self.position_m(time_s - VELOCITY_STEP_S)?, self.position_m(time_s)?);
            return Ok(std::array::from_fn(|i| (here[i] - before[i]) / VELOCITY_STEP_S));
        }
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

    /// Whether it is told where it is, as it moves.
    pub fn is_fed(&self) -> bool {
        match &self.way {
            Way::Fed(_) => true,
            Way::Member { middle, .. } => middle.is_fed(),
            Way::Track(_) | Way::Animated { .. } => false,
        }
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
            (Way::Fed(fed), Point::Vertex(vertex)) if fed.has_mesh() => match fed.vertex_m(vertex, time_s) {
                Some(position_m) => position_m,
                None => into_world(&self.frame(time_s)?, [0.0; 3]),
            },
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
            Way::Fed(fed) if fed.has_mesh() => Topology::Heterogeneous,
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
            Way::Fed(fed) if fed.mesh(time_s, mesh) => Ok(()),
            Way::Track(_) | Way::Fed(_) | Way::Member { .. } => Err(self.fault("has no mesh".to_owned())),
            Way::Animated { animation, object, .. } => animation.mesh(*object, time_s + self.origin_s, mesh),
        }
    }

    /// Where it is at time 0 and how it is turned, whatever it was told since.
    fn first_pose(&self) -> Result<FedPose> {
        if let Way::Fed(fed) = &self.way {
            return Ok(fed.first_pose());
        }
        let state = rigid(&self.frame(0.0)?);
        Ok(FedPose { position_m: state.position_m, rotation: state.rotation })
    }

    /// Its mesh then.
    fn first_mesh(&self) -> Result<Mesh> {
        if let Way::Fed(fed) = &self.way {
            return fed.first_mesh().ok_or_else(|| self.fault("has no mesh".to_owned()));
        }
        let mut mesh = Mesh::default();
        self.mesh(0.0, &mut mesh)?;
        Ok(mesh)
    }

    /// Something that appears at a time and stands in a pose. Its mesh, where this one has one, is what this one has at time
    /// 0, and lies to the pose as that does to this one.
    ///
    /// # Errors
    /// A sample that cannot be read.
    pub fn appearing(&self, time_s: f64, pose: FedPose) -> Result<Fed> {
        let fed = if self.topology() == Topology::None {
            Fed::new(pose)
        } else {
            let mut mesh = self.first_mesh()?;
            self.first_pose()?.move_to(&pose, &mut mesh.positions);
            Fed::with_mesh(pose, mesh)?
        };
        fed.stand(time_s);
        Ok(fed)
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

    pub(super) fn fault(&self, what: String) -> Error {
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

/// What carries something that is told to move, and stands until then as another carrier does at time 0; its mesh too,
/// where it is one that is told.
pub(super) fn fed_carrier(
    before: Option<&Carrier>,
    step_s: f64,
    has_mesh: bool,
) -> Result<(Carrier, Arc<Fed>)> {
    let pose = before.map_or(Ok(FedPose::at([0.0; 3])), Carrier::first_pose)?;
    let fed = match before.filter(|_| has_mesh) {
        Some(before) => {
            let rest = before.first_mesh()?;
            Fed::with_mesh(pose, rest).map_err(|fault| before.fault(fault.to_string()))?
        }
        None if has_mesh => Fed::with_mesh(pose, Mesh::default())?,
        None => Fed::new(pose),
    };
    let fed = Arc::new(fed);
    let point = before.map_or(Point::Offset([0.0; 3]), |before| before.point);
    Ok((Carrier { point, ..Carrier::fed(fed.clone(), step_s) }, fed))
}

pub(super) fn track_carrier(track: &Track, point: Point, frame_rate_hz: f64) -> Carrier {
    Carrier { way: Way::Track(Arc::new(track.clone())), point, origin_s: 0.0, frame_rate_hz }
}

pub(super) fn into_world(frame: &Transform, [x, y, z]: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| frame[i][0] * x + frame[i][1] * y + frame[i][2] * z + frame[i][3])
}

/// Where a transform puts its body and how it turns it; what it scales is left out.
pub(super) fn rigid(frame: &Transform) -> BodyState {
    let column = |k: usize| glam::DVec3::new(frame[0][k], frame[1][k], frame[2][k]);
    let x = column(0).try_normalize().unwrap_or(glam::DVec3::X);
    let y = column(1).reject_from_normalized(x).try_normalize().unwrap_or(x.any_orthonormal_vector());
    let rotation = glam::DQuat::from_mat3(&glam::DMat3::from_cols(x, y, x.cross(y)));
    BodyState { position_m: column(3).to_array(), rotation: rotation.to_array(), ..BodyState::STILL }
}

/// The local coordinates of a world position, if the transform can be inverted.
pub(super) fn into_local(frame: &Transform, position: [f64; 3]) -> Option<[f64; 3]> {
    let column = |k: usize| glam::DVec3::new(frame[0][k], frame[1][k], frame[2][k]);
    let matrix = glam::DMat3::from_cols(column(0), column(1), column(2));
    let local = matrix.inverse() * (glam::DVec3::from(position) - column(3));
    local.is_finite().then(|| local.to_array())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::track::{TrackKey, facing_frame};

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
