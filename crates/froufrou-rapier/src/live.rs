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
#[derive(Debug)]
struct Known {
    name: String,
    /// Whether somebody gave it that name: such may be moved.
    is_named: bool,
    /// Its number in the step in which it was asked for: by the next it may have vanished.
    body: Option<(u64, BodyId)>,
    /// What was told last to be moved, and where to.
    told: Option<(MoverId, FedPose)>,
}

impl Known {
    fn new(name: String, is_named: bool) -> Self {
        Self { name, is_named, body: None, told: None }
    }
}

/// Tells a live engine what happens in a simulation: who touches and how, and where named bodies are that the engine was started
/// with as [movers](EngineSettings::movers).
///
/// Bodies and colliders may come and go, and what the engine knows by their names may vanish and appear again; those that touch
/// should each have a name of their own. The engine wants to know the time as well, once all of a frame is told:
/// [`Live::handle`] and [`Handle::advance`].
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
        let step_s = settings.contact_step_s;
        let (handle, player) = live::start(scene, settings)?;
        Ok((Self { handle, teller: Teller::new(step_s)? }, player))
    }

    /// The engine, to be told of the listener, of what else happens, and how far time has come.
    pub fn handle(&mut self) -> &mut Handle {
        &mut self.handle
    }

    /// Names a body, as objects of the scene have it. One that nobody names is `body` and the index of its handle.
    pub fn name_body(&mut self, body: RigidBodyHandle, name: impl Into<String>) {
        self.teller.name_body(body, name);
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
    ///
    /// # Errors
    /// A length that is not a number above 0.
    pub fn new(step_s: f64) -> Result<Self> {
        Ok(Self { contacts: Contacts::new(step_s)?, known: HashMap::new() })
    }

    /// Names a body, as objects of the scene have it.
    pub fn name_body(&mut self, body: RigidBodyHandle, name: impl Into<String>) {
        self.known.insert(Who::Body(body), Known::new(name.into(), true));
    }

    /// Names a collider that has no body.
    pub fn name_collider(&mut self, collider: ColliderHandle, name: impl Into<String>) {
        self.known.insert(Who::Collider(collider), Known::new(name.into(), true));
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
        let (mut first, step) = (Ok(()), contacts.steps());
        let _ = contacts.step(time_s, narrow_phase, bodies, colliders, |who, touch| {
            let numbers = who.map(|who| {
                let known = known.entry(who).or_insert_with(|| Known::new(who.name(), false));
                if let Some((_, body)) = known.body.filter(|(asked, _)| *asked == step) {
                    return Ok(body);
                }
                handle.body(&known.name).inspect(|body| known.body = Some((step, *body)))
            });
            let told = match numbers {
                [Ok(a), Ok(b)] => handle.touch([a, b], &touch),
                [Err(why), _] | [_, Err(why)] => Err(why),
            };
            first = first.and(told);
            ControlFlow::<()>::Continue(())
        });
        for (who, known) in known.iter_mut() {
            let Who::Body(body) = who else { continue };
            let Some(body) = bodies.get(*body).filter(|_| known.is_named) else { continue };
            // What vanished and appeared again is another.
            let Some(mover) = handle.object(&known.name) else { continue };
            let now = state(body);
            let pose = FedPose { position_m: now.position_m, rotation: now.rotation };
            // What rests is not told again and again.
            if known.told != Some((mover, pose)) {
                let told = handle.transform(mover, time_s, pose);
                known.told = told.is_ok().then_some((mover, pose));
                first = first.and(told);
            }
        }
        if contacts.steps().is_multiple_of(SWEEP_STEPS) {
            known.retain(|who, _| who.is_in(bodies, colliders));
        }
        first
    }
}
