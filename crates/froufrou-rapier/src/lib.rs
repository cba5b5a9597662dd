//! What happens in a running [rapier3d](https://rapier.rs) simulation, to be heard at once ([`Live`]) or as
//! [events](froufrou::motion::Event) ([`Listener`]): impacts with times within the step, slides and rolls. Both take the
//! same from a step and find the same in it.
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
//! let mut listener = Listener::new(1.0 / 240.0)?;
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

mod contacts;
mod live;

use std::collections::HashMap;
use std::ops::ControlFlow;

pub use live::{Live, Teller};

use froufrou::motion::Event;
use froufrou::motion::event::{Cause, Moved};
use froufrou::motion::impact::{Settings, Step};
use froufrou::motion::lives::{Found, Lives, Touch};
use froufrou::scene::contact_log::ContactRow;
use froufrou::{Error, Result};
use rapier3d::prelude::{ColliderHandle, ColliderSet, NarrowPhase, RigidBodyHandle, RigidBodySet};

use contacts::{Contacts, Who};

/// So many steps back the causes of events may lie.
const STEPS: usize = 512;

/// Follows the contacts of a simulation.
#[derive(Debug)]
pub struct Listener {
    lives: Lives,
    contacts: Contacts,
    numbers: HashMap<Who, u32>,
    names: Vec<String>,
    /// The ends of the last steps, by their number modulo [`STEPS`].
    ends_s: Vec<f64>,
}

/// The number of one that touches; the first time it gets one, and a name.
fn number(numbers: &mut HashMap<Who, u32>, names: &mut Vec<String>, who: Who) -> u32 {
    *numbers.entry(who).or_insert_with(|| {
        names.push(who.name());
        names.len() as u32 - 1
    })
}

impl Listener {
    /// Listens to a simulation with steps of this length in seconds.
    ///
    /// # Errors
    /// A length that is not a number above 0.
    pub fn new(step_s: f64) -> Result<Self> {
        Ok(Self {
            contacts: Contacts::new(step_s)?,
            lives: Lives::new(Settings::new(Step::Fixed(step_s))),
            numbers: HashMap::new(),
            names: Vec::new(),
            ends_s: vec![0.0; STEPS],
        })
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
        let number = number(&mut self.numbers, &mut self.names, who) as usize;
        if let Some(old) = self.names.get_mut(number) {
            *old = name;
        }
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
        let Self { lives, contacts, numbers, names, ends_s } = self;
        let told = contacts.step(time_s, narrow_phase, bodies, colliders, |who, touch| {
            let [a, b] = who.map(|who| number(numbers, names, who));
            let row = ContactRow { a, b, ..touch.row };
            match lives.touch(&Touch { row, ..touch }) {
                Ok(()) => ControlFlow::Continue(()),
                Err(fault) => ControlFlow::Break(fault),
            }
        });
        ends_s[contacts.steps() as usize % STEPS] = time_s;
        told.break_value().map_or(Ok(()), Err)
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
        let known = |step: u64| self.contacts.steps().saturating_sub(step) < STEPS as u64;
        let end_s = |step: u64| self.ends_s[step as usize % STEPS];
        let moved = if known(first) && known(last) {
            Moved { from_s: end_s(first) - self.contacts.step_s(), to_s: end_s(last) }
        } else {
            Moved { from_s: found.time_s() - self.contacts.step_s(), to_s: found.time_s() }
        };
        let names = found.bodies().map(|body| self.names.get(body as usize).map_or("", String::as_str));
        found.event(names, Cause::Motion(moved))
    }
}
