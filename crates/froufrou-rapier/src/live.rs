//! A simulation that is heard while it runs.

use std::collections::HashMap;
use std::ops::ControlFlow;

use froufrou::Result;
use froufrou::render::live::{self, BodyId, EngineSettings, Handle, MoverId, Player, Refused};
use froufrou::scene::Scene;
use froufrou::scene::fed::FedPose;
use rapier3d::prelude::{ColliderHandle, ColliderSet, NarrowPhase, RigidBodyHandle, RigidBodySet};

use crate::contacts::{Contacts, Who, state};

/// After so many steps, names of what is no longer in the simulation are forgotten.
const SWEEP_STEPS: u64 = 1024;

/// What a live engine knows a body by.
#[derive(Debug, Default)]
struct Known {
    name: Option<String>,
    body: Option<BodyId>,
    /// Where the engine moves it, and the pose that it was told last.
    mover: Option<MoverId>,
    pose: Option<FedPose>,
}

/// Tells a live engine what happens in a simulation: who touches and how, and where named bodies are that the engine was started
/// with as [movers](EngineSettings::movers).
///
/// Bodies and colliders may come and go; those that touch should each have a name of their own. The engine wants to know the
/// time as well, once all of a frame is told: [`Live::handle`] and [`Handle::advance`].
///
/// ```no_run
/// use froufrou::render::live::EngineSettings;
/// use froufrou::scene::Scene;
/// use froufrou_rapier::Live;
/// use rapier3d::prelude::*;
///
/// let mut world = PhysicsWorld::new();
/// let ball = world.bodies.insert(RigidBodyBuilder::dynamic().translation(Vector::new(0.0, 1.0, 0.0)));
/// world.colliders.insert_with_parent(ColliderBuilder::ball(0.05), ball, &mut world.bodies);
///
/// let settings = EngineSettings { movers: vec!["ball".into()], ..EngineSettings::default() };
/// let (mut live, player) = Live::start(Scene::open("scene.toml", false)?, settings)?;
/// // The callback of a device owns the player.
/// # drop(player);
/// live.name_body(ball, "ball");
/// for step in 1..=600 {
///     world.step();
///     let time_s = f64::from(step) / 60.0;
///     live.feed(time_s, &world.narrow_phase, &world.bodies, &world.colliders)?;
///     live.handle().advance(time_s)?;
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Live {
    handle: Handle,
    teller: Teller,
}

/// Tells a handle what happens in a simulation, as [`Live`] does: for one that is had otherwise, as from
/// [`live::replay`].
pub struct Teller {
    contacts: Contacts,
    known: HashMap<Who, Known>,
}

impl Live {
    /// Starts an engine for a simulation whose steps are [`EngineSettings::contact_step_s`] long.
    ///
    /// # Errors
    /// As [`live::start`].
    pub fn start(scene: Scene, settings: EngineSettings) -> Result<(Self, Player)> {
        let teller = Teller::new(settings.contact_step_s);
        let (handle, player) = live::start(scene, settings)?;
        Ok((Self { handle, teller }, player))
    }

    /// The engine, to be told of the listener, of what else happens, and how far time has come.
    pub fn handle(&mut self) -> &mut Handle {
        &mut self.handle
    }

    /// Names a body, as objects of the scene have it. One that nobody names is `body` and the index of its handle.
    pub fn name_body(&mut self, body: RigidBodyHandle, name: impl Into<String>) {
        self.teller.name_body(&self.handle, body, name);
    }

    /// Names a collider that has no body, such as a floor. One that nobody names is `collider` and the index of its
    /// handle.
    pub fn name_collider(&mut self, collider: ColliderHandle, name: impl Into<String>) {
        self.teller.name_collider(collider, name);
    }

    /// Tells what the step that ended at a time has solved, and where all is.
    ///
    /// # Errors
    /// Why something was left out, if something was: the first of it. All is counted in [`Handle::left_out`].
    pub fn feed(
        &mut self,
        time_s: f64,
        narrow_phase: &NarrowPhase,
        bodies: &RigidBodySet,
        colliders: &ColliderSet,
    ) -> Result<(), Refused> {
        self.teller.feed(&mut self.handle, time_s, narrow_phase, bodies, colliders)
    }
}

impl Teller {
    /// For a simulation with steps of this length in seconds.
    pub fn new(step_s: f64) -> Self {
        Self { contacts: Contacts::new(step_s), known: HashMap::new() }
    }

    /// Names a body, as objects of the scene have it; the handle knows whether it is moved.
    pub fn name_body(&mut self, handle: &Handle, body: RigidBodyHandle, name: impl Into<String>) {
        let name = name.into();
        let mover = handle.object(&name);
        self.known.insert(Who::Body(body), Known { name: Some(name), mover, ..Known::default() });
    }

    /// Names a collider that has no body.
    pub fn name_collider(&mut self, collider: ColliderHandle, name: impl Into<String>) {
        let known = Known { name: Some(name.into()), ..Known::default() };
        self.known.insert(Who::Collider(collider), known);
    }

    /// Tells what the step that ended at a time has solved, and where all is.
    ///
    /// # Errors
    /// As [`Live::feed`].
    pub fn feed(
        &mut self,
        handle: &mut Handle,
        time_s: f64,
        narrow_phase: &NarrowPhase,
        bodies: &RigidBodySet,
        colliders: &ColliderSet,
    ) -> Result<(), Refused> {
        let Self { contacts, known } = self;
        let mut first = Ok(());
        let _ = contacts.step(time_s, narrow_phase, bodies, colliders, |who, touch| {
            let numbers = who.map(|who| {
                let known = known.entry(who).or_default();
                let named = match (known.body, &known.name) {
                    (Some(body), _) => Ok(body),
                    (None, Some(name)) => handle.body(name),
                    (None, None) => handle.body(&who.name()),
                };
                named.inspect(|body| known.body = Some(*body))
            });
            let told = match numbers {
                [Ok(a), Ok(b)] => handle.touch([a, b], &touch),
                [Err(why), _] | [_, Err(why)] => Err(why),
            };
            first = first.and(told);
            ControlFlow::<()>::Continue(())
        });
        for (who, known) in known.iter_mut() {
            let (Who::Body(body), Some(mover)) = (who, known.mover) else { continue };
            let Some(body) = bodies.get(*body) else { continue };
            let now = state(body);
            let pose = FedPose { position_m: now.position_m, rotation: now.rotation };
            // What rests is not told again and again.
            if known.pose != Some(pose) {
                let told = handle.transform(mover, time_s, pose);
                known.pose = told.is_ok().then_some(pose);
                first = first.and(told);
            }
        }
        if contacts.steps().is_multiple_of(SWEEP_STEPS) {
            known.retain(|who, _| who.is_in(bodies, colliders));
        }
        first
    }
}
