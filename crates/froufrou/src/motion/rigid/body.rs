//! A rigid body: what it is, and how it has moved so far.

use glam::{DMat3, DVec3};

use super::pose::Pose;
use super::shape::Shape;
use super::trajectory::{Piece, Track};
use crate::scene::animation::{Mesh, Transform};
use crate::{Error, Place, Result};

/// How much the sizes of a body may change, as a part of themselves.
const SAME_SIZE: f64 = 0.01;

/// A rigid body whose motion is told.
#[derive(Debug, Clone)]
pub struct Body {
    pub(super) name: String,
    pub(super) shape: Shape,
    pub(super) mass_kg: f64,
    /// False for what never moves, whose mass does not matter.
    pub(super) moves: bool,
    /// What its transform makes of the axes beside turning them.
    pub(super) sizes: DMat3,
}

impl Body {
    /// A body from its mesh in world space, as an animation gives it, and its transform at that time. It weighs its
    /// volume times the density in kg/m³; what has holes weighs what its hull does.
    ///
    /// # Errors
    /// A transform that is not finite or flattens; a mesh without faces or with vertices at no finite place.
    pub fn from_mesh(name: &str, mesh: &Mesh, transform: &Transform, density: f64) -> Result<Self> {
        let (pose, sizes) = pose(name, transform)?;
        let points: Vec<DVec3> =
            mesh.positions.iter().map(|p| pose.local(DVec3::from(p.map(f64::from)))).collect();
        let shape = Shape::from_mesh(&points, &mesh.face_vertices, &mesh.face_sizes)
            .map_err(|fault| fault.at(Place::Part(name.to_owned())))?;
        Ok(Self { mass_kg: density * shape.volume_m3(), name: name.to_owned(), shape, moves: true, sizes })
    }

    /// A body of a simple shape about the origin of its frame, which is not scaled.
    pub fn new(name: &str, shape: Shape, density: f64) -> Self {
        let mass_kg = density * shape.volume_m3();
        Self { name: name.to_owned(), shape, mass_kg, moves: true, sizes: DMat3::IDENTITY }
    }

    /// The same body, with a mass in kilograms, above 0.
    #[must_use]
    pub fn weighing(self, mass_kg: f64) -> Self {
        Self { mass_kg, ..self }
    }

    /// The same body, which never moves.
    #[must_use]
    pub fn fixed(self) -> Self {
        Self { moves: false, ..self }
    }

    /// What it is called.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its shape.
    pub fn shape(&self) -> &Shape {
        &self.shape
    }

    /// False for what never moves.
    pub fn moves(&self) -> bool {
        self.moves
    }

    /// In kilograms.
    pub fn mass_kg(&self) -> f64 {
        self.mass_kg
    }

    /// Where its centre is at a transform.
    pub(super) fn centre_pose(&self, transform: &Transform, time_s: f64) -> Result<Pose> {
        let at_time = |fault: Error| fault.at(Place::Part(self.name.clone()));
        let (pose, sizes) = Pose::of(transform).ok_or_else(|| {
            at_time(Error::new(format!("its transform at {time_s} s is not finite, or flattens it")))
        })?;
        let greatest = |m: DMat3| m.to_cols_array().iter().fold(0.0, |most: f64, c| most.max(c.abs()));
        if greatest(sizes - self.sizes) > SAME_SIZE * greatest(self.sizes) {
            let what = format!("it changes its size at {time_s} s; a rigid body keeps its own");
            return Err(at_time(Error::new(what)).help("leave it out of `bodies`"));
        }
        Ok(Pose { at: pose.out(self.shape.centre()), turn: pose.turn })
    }
}

fn pose(name: &str, transform: &Transform) -> Result<(Pose, DMat3)> {
    Pose::of(transform).ok_or_else(|| {
        Error::new("its transform is not finite, or flattens it").at(Place::Part(name.to_owned()))
    })
}

/// A body with its motion so far.
#[derive(Debug, Clone)]
pub(super) struct Mover {
    pub body: Body,
    /// 1/kg; 0 where it cannot be moved.
    pub inverse_mass: f64,
    inverse_inertia: DMat3,
    pub track: Track,
    /// Where it went on to after it was hit in the last step: velocity and spin at its end.
    pub leaves: Option<(DVec3, DVec3)>,
    /// The directions in which what it rests on pushes it, now and one and two frames ago.
    pub supports: [Vec<DVec3>; 3],
    /// How it moves on from where it was last hit or last seen.
    pub piece: Piece,
    /// Whether the frames before tell of that.
    pub is_known: bool,
    /// The pieces before it in this step, if it was hit.
    pub hit: Option<Hit>,
    /// If it stood still and something that it touches was hit in this step: when.
    pub wakes_s: Option<f64>,
}

/// That a body was hit within a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hit {
    pub first_s: f64,
    pub last_s: f64,
    /// Before the first.
    pub before: Piece,
    /// The normal of the last.
    pub normal: DVec3,
}

impl Mover {
    pub fn new(body: Body) -> Self {
        let has_mass = body.mass_kg.is_finite() && body.mass_kg > 0.0;
        let (inverse_mass, inverse_inertia) = if body.moves && has_mass {
            (1.0 / body.mass_kg, body.shape.inverse_inertia(body.mass_kg))
        } else {
            (0.0, DMat3::ZERO)
        };
        let still = Piece {
            from_s: 0.0,
            at: DVec3::ZERO,
            velocity: DVec3::ZERO,
            acceleration: DVec3::ZERO,
            turn: glam::DQuat::IDENTITY,
            spin: DVec3::ZERO,
        };
        Self {
            body,
            inverse_mass,
            inverse_inertia,
            track: Track::default(),
            leaves: None,
            supports: Default::default(),
            piece: still,
            is_known: false,
            hit: None,
            wakes_s: None,
        }
    }

    /// The pose of its centre at a frame.
    pub fn pose(&self, frame: usize) -> Option<&Pose> {
        self.track.pose(if self.body.moves { frame } else { 0 })
    }

    /// What a push of 1 N s at a place turns it by, in radians a second.
    pub fn turned_by(&self, push: DVec3, place: DVec3, time_s: f64) -> DVec3 {
        let pose = self.piece.pose(time_s);
        let moment = pose.turn.conjugate() * (place - pose.at).cross(push);
        pose.turn * (self.inverse_inertia * moment)
    }

    /// Begins the step from a frame: how it moves on, by what is known of it until then.
    pub fn begin(&mut self, frame: usize, time_s: f64, gravity: DVec3) {
        self.hit = None;
        self.wakes_s = None;
        let Some(pose) = self.pose(frame).copied() else { return };
        let before = frame.checked_sub(1).and_then(|before| self.track.step(before)).copied();
        let still = DVec3::ZERO;
        self.piece = Piece {
            from_s: time_s,
            at: pose.at,
            velocity: still,
            acceleration: still,
            turn: pose.turn,
            spin: still,
        };
        self.is_known = !self.body.moves;
        if !self.body.moves {
            return;
        }
        let Some(before) = before.filter(|_| !self.track.jumps(frame)) else {
            // Nothing tells how it came here; it is taken to go where it goes.
            if let Some(step) = self.track.step(frame) {
                (self.piece.velocity, self.piece.spin) = (step.velocity, step.spin);
            }
            return;
        };
        self.is_known = true;
        let is_held = |supports: &Vec<DVec3>| !supports.is_empty();
        let steady = self.supports.iter().all(is_held) || !self.supports.iter().any(is_held);
        let smooth = frame.checked_sub(1).and_then(|frame| self.track.smooth_acceleration(frame));
        let acceleration = match smooth {
            Some(acceleration) if steady => acceleration,
            _ => held(gravity, &self.supports[0]),
        };
        self.piece.acceleration = acceleration;
        (self.piece.velocity, self.piece.spin) = self
            .leaves
            .take()
            .unwrap_or((before.velocity + acceleration * (0.5 * before.lasts_s), before.spin));
    }
}

/// What is left of an acceleration for a body that rests on things.
pub(super) fn held(acceleration: DVec3, supports: &[DVec3]) -> DVec3 {
    supports.iter().fold(acceleration, |left, push| left - *push * left.dot(*push).min(0.0))
}
