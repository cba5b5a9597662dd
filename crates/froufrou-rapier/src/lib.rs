//! What happens in a running [rapier3d](https://rapier.rs) simulation, as [events](froufrou::motion::Event): impacts with
//! times within the step, slides and rolls.
//!
//! After each `PhysicsPipeline::step` one call of [`Listener::feed`] takes the contacts that the step solved; what has
//! settled comes out of [`Listener::pop`].
//!
//! ```
//! use froufrou_rapier::Listener;
//! use rapier3d::prelude::*;
//!
//! let mut world = PhysicsWorld::new();
//! world.integration_parameters.dt = 1.0 / 240.0;
//! let ball = world.bodies.insert(RigidBodyBuilder::dynamic().translation(Vector::new(0.0, 0.55, 0.0)));
//! world.colliders.insert_with_parent(ColliderBuilder::ball(0.05).restitution(0.5), ball, &mut world.bodies);
//! let ground = ColliderBuilder::cuboid(5.0, 0.1, 5.0).translation(Vector::new(0.0, -0.1, 0.0)).restitution(0.5);
//! let floor = world.colliders.insert(ground);
//!
//! let mut listener = Listener::new(1.0 / 240.0);
//! listener.name_body(ball, "ball");
//! listener.name_collider(floor, "floor");
//! let mut events = Vec::new();
//! for step in 1..=480 {
//!     world.step();
//!     listener.feed(f64::from(step) / 240.0, &world.narrow_phase, &world.bodies, &world.colliders)?;
//!     events.extend(std::iter::from_fn(|| listener.pop()));
//! }
//! // It falls half a metre.
//! assert!((events[0].time_s() - (2.0 * 0.5_f64 / 9.81).sqrt()).abs() < 1.0 / 240.0);
//! # Ok::<(), froufrou::Error>(())
//! ```
//!
//! # How impulses are read
//!
//! From the manifolds that the solver saw (`ContactPair::solver_manifolds`, the clusters where contacts were
//! clustered), each `SolverContact`'s own point has in `ContactData::impulse` the normal impulse of the whole step: the
//! solver divides a step into `num_solver_iterations` parts and adds up what it applied in each, warm starts apart.
//! Points that the solver did not see keep old impulses and are left out, and so are pairs that are asleep. Where
//! `max_ccd_substeps` is above 1 and a step was divided for fast bodies, only its last part's impulses are there: leave it at 1.
//! Friction is not needed, so that any friction model will do. Soft bodies are left out.
//!
//! # Times
//!
//! `time_s` is the end of the step. Bodies that come together touch when the gap that they had as the step began is closed
//! at the speed they had; an impact is told at that time, held within its step. Its speeds are those before the step, and
//! places are those of the step's beginning.
//!
//! # Cost
//!
//! A call goes through all bodies and all contact points once and allocates nothing for a contact; an event has two names
//! of its own. What is remembered goes with the bodies that ever touched.

#![forbid(unsafe_code)]
#![warn(missing_docs)]

use std::collections::HashMap;

use froufrou::motion::Event;
use froufrou::motion::body::BodyState;
use froufrou::motion::event::{Cause, Moved};
use froufrou::motion::impact::{Settings, Step};
use froufrou::motion::lives::{Found, Lives};
use froufrou::scene::contact_log::{ContactRow, Push};
use froufrou::{Error, Result};
use rapier3d::geometry::{ContactPair, NEW_CONTACT_BIT};
use rapier3d::prelude::{
    ColliderHandle, ColliderSet, NarrowPhase, RigidBody, RigidBodyHandle, RigidBodySet, Vector,
};

/// So many steps back the causes of events may lie.
const STEPS: usize = 512;

/// Who touches: a body, or a collider without one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Who {
    Body(RigidBodyHandle),
    Collider(ColliderHandle),
}

/// Where a body is, and where it was before the step.
#[derive(Debug, Clone, Copy)]
struct Moving {
    handle: RigidBodyHandle,
    before: BodyState,
    now: BodyState,
}

/// Follows the contacts of a simulation.
#[derive(Debug)]
pub struct Listener {
    lives: Lives,
    numbers: HashMap<Who, u32>,
    names: Vec<String>,
    /// By the index of the handle.
    moving: Vec<Option<Moving>>,
    step_s: f64,
    /// The ends of the last steps, by their number modulo [`STEPS`].
    ends_s: Vec<f64>,
    steps: u64,
}

fn vector(v: Vector) -> [f64; 3] {
    [v.x, v.y, v.z].map(f64::from)
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

/// How a body moves; its origin is that of rapier's, not its centre of mass.
fn state(body: &RigidBody) -> BodyState {
    let rotation = body.rotation();
    let origin = body.translation();
    BodyState {
        position_m: vector(origin),
        rotation: [rotation.x, rotation.y, rotation.z, rotation.w].map(f64::from),
        velocity_mps: vector(body.velocity_at_point(origin)),
        angular_velocity_rps: vector(body.angvel()),
    }
}

impl Listener {
    /// Listens to a simulation with steps of this length in seconds.
    pub fn new(step_s: f64) -> Self {
        Self {
            lives: Lives::new(Settings::new(Step::Fixed(step_s))),
            numbers: HashMap::new(),
            names: Vec::new(),
            moving: Vec::new(),
            step_s,
            ends_s: vec![0.0; STEPS],
            steps: 0,
        }
    }

    /// Names a body in events. One that nobody names is `body` and the index of its handle.
    pub fn name_body(&mut self, body: RigidBodyHandle, name: impl Into<String>) {
        self.rename(Who::Body(body), name.into());
    }

    /// Names a collider that has no body, such as a floor. One that nobody names is `collider` and the index of its
    /// handle.
    pub fn name_collider(&mut self, collider: ColliderHandle, name: impl Into<String>) {
        self.rename(Who::Collider(collider), name.into());
    }

    fn rename(&mut self, who: Who, name: String) {
        let number = self.number(who) as usize;
        if let Some(old) = self.names.get_mut(number) {
            *old = name;
        }
    }

    fn number(&mut self, who: Who) -> u32 {
        let names = &mut self.names;
        *self.numbers.entry(who).or_insert_with(|| {
            names.push(match who {
                Who::Body(body) => format!("body {}", body.into_raw_parts().0),
                Who::Collider(collider) => format!("collider {}", collider.into_raw_parts().0),
            });
            names.len() as u32 - 1
        })
    }

    /// Takes what the step that ended at a time has solved.
    ///
    /// # Errors
    /// A time that is not a number or earlier than the one before.
    pub fn feed(
        &mut self,
        time_s: f64,
        narrow_phase: &NarrowPhase,
        bodies: &RigidBodySet,
        colliders: &ColliderSet,
    ) -> Result<()> {
        if !time_s.is_finite() {
            return Err(Error::new(format!("the time of a step is {time_s}")));
        }
        self.lives.advance(time_s)?;
        self.steps += 1;
        self.ends_s[self.steps as usize % STEPS] = time_s;
        for (handle, body) in bodies.iter() {
            let index = handle.into_raw_parts().0 as usize;
            if index >= self.moving.len() {
                self.moving.resize(index + 1, None);
            }
            let now = state(body);
            let before = self.moving[index].filter(|moving| moving.handle == handle);
            let before = before.map_or(now, |moving| moving.now);
            self.moving[index] = Some(Moving { handle, before, now });
        }
        for pair in narrow_phase.contact_pairs() {
            self.take(time_s, pair, bodies, colliders)?;
        }
        Ok(())
    }

    fn take(
        &mut self,
        time_s: f64,
        pair: &ContactPair,
        bodies: &RigidBodySet,
        colliders: &ColliderSet,
    ) -> Result<()> {
        let handles = [pair.collider1, pair.collider2];
        let parents = handles.map(|handle| colliders.get(handle).and_then(|collider| collider.parent()));
        // What sleeps has the impulses of the step in which it fell asleep.
        let awake =
            |body: &RigidBodyHandle| bodies.get(*body).is_some_and(|b| b.is_dynamic() && !b.is_sleeping());
        if !parents.iter().flatten().any(awake) || parents[0] == parents[1] {
            return Ok(());
        }
        let mut touches = false;
        for manifold in pair.solver_manifolds() {
            touches |= !manifold.data.solver_contacts.is_empty();
        }
        if !touches {
            return Ok(());
        }
        let who = |i: usize| parents[i].map_or(Who::Collider(handles[i]), Who::Body);
        let [a, b] = [self.number(who(0)), self.number(who(1))];
        let moving = parents.map(|body| {
            let handle = body?;
            self.moving.get(handle.into_raw_parts().0 as usize).copied().flatten()
        });
        // Contacts are those of the step's beginning, and how bodies move then is how they go on.
        let states = moving.map(|moving| {
            moving.map(|Moving { before, now, .. }| BodyState {
                velocity_mps: now.velocity_mps,
                angular_velocity_rps: now.angular_velocity_rps,
                ..before
            })
        });
        let before = moving.map(|moving| moving.map_or(BodyState::STILL, |moving| moving.before));
        for manifold in pair.solver_manifolds() {
            // From the first collider to the second.
            let normal = vector(manifold.data.normal);
            for contact in &manifold.data.solver_contacts {
                let id = (contact.contact_id[0] & !NEW_CONTACT_BIT) as usize;
                let Some(point) = manifold.points.get(id) else { continue };
                let impulse_ns = f64::from(point.data.impulse);
                if impulse_ns <= 0.0 {
                    continue;
                }
                // The anchors ride on the bodies from the step's beginning, but for those in the world.
                let dominance = manifold.data.relative_dominance;
                let anchors = [(contact.anchor1, dominance > 0), (contact.anchor2, dominance < 0)];
                let on: [[f64; 3]; 2] = std::array::from_fn(|i| {
                    let (anchor, in_world) = anchors[i];
                    let body = parents[i].filter(|_| !in_world).and_then(|body| bodies.get(body));
                    body.map_or(vector(anchor), |body| {
                        before[i].world_m(vector(body.mass_properties().local_mprops.local_com + anchor))
                    })
                });
                let position_m: [f64; 3] = std::array::from_fn(|i| 0.5 * (on[0][i] + on[1][i]));
                let [va, vb] = before.map(|state| state.velocity_at(position_m));
                let between: [f64; 3] = std::array::from_fn(|i| vb[i] - va[i]);
                let apart_mps = dot(between, normal);
                let along: [f64; 3] = std::array::from_fn(|i| between[i] - apart_mps * normal[i]);
                let at_s = (apart_mps < 0.0).then(|| {
                    let closed_s = f64::from(contact.dist) / -apart_mps;
                    (time_s - self.step_s + closed_s).clamp(time_s - self.step_s, time_s)
                });
                let row = ContactRow {
                    time_s,
                    a,
                    b,
                    position_m,
                    push: Push::Impulse(impulse_ns),
                    normal: Some(normal),
                    normal_velocity_mps: Some(apart_mps),
                    sliding_mps: Some(dot(along, along).sqrt()),
                    line: self.steps,
                };
                self.lives.feed_impact(&row, states, at_s)?;
                // How they slide now follows from how they move now.
                self.lives.feed_rub(&ContactRow { sliding_mps: None, ..row }, states)?;
            }
        }
        Ok(())
    }

    /// Says that no step follows; all events can then be taken.
    pub fn finish(&mut self) {
        self.lives.finish();
    }

    /// The next event in order of time, once nothing can come before it any more: some hundredths of a second after it
    /// happened.
    pub fn pop(&mut self) -> Option<Event> {
        let found = self.lives.pop()?;
        Some(self.event(found))
    }

    fn event(&self, found: Found) -> Event {
        let [first, last] = found.lines();
        let known = |step: u64| self.steps.saturating_sub(step) < STEPS as u64;
        let end_s = |step: u64| self.ends_s[step as usize % STEPS];
        let moved = if known(first) && known(last) {
            Moved { from_s: end_s(first) - self.step_s, to_s: end_s(last) }
        } else {
            Moved { from_s: found.time_s() - self.step_s, to_s: found.time_s() }
        };
        let names = found.bodies().map(|body| self.names.get(body as usize).map_or("", String::as_str));
        found.event(names, Cause::Motion(moved))
    }
}
