//! What a step of a simulation says of who touches whom.

use std::ops::ControlFlow;

use froufrou::motion::body::BodyState;
use froufrou::motion::lives::Touch;
use froufrou::scene::contact_log::{ContactRow, Push};
use froufrou::{Error, Result};
use rapier3d::geometry::{ContactPair, NEW_CONTACT_BIT};
use rapier3d::prelude::{
    ColliderHandle, ColliderSet, NarrowPhase, RigidBody, RigidBodyHandle, RigidBodySet, Vector,
};

/// Who touches: a body, or a collider without one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Who {
    Body(RigidBodyHandle),
    Collider(ColliderHandle),
}

impl Who {
    /// The name of one that nobody names.
    pub fn name(self) -> String {
        match self {
            Self::Body(body) => format!("body {}", body.into_raw_parts().0),
            Self::Collider(collider) => format!("collider {}", collider.into_raw_parts().0),
        }
    }

    /// Whether it is in the simulation.
    pub fn is_in(self, bodies: &RigidBodySet, colliders: &ColliderSet) -> bool {
        match self {
            Self::Body(body) => bodies.contains(body),
            Self::Collider(collider) => colliders.contains(collider),
        }
    }
}

/// Where a body is, and where it was before the step.
#[derive(Debug, Clone, Copy)]
struct Moving {
    handle: RigidBodyHandle,
    before: BodyState,
    now: BodyState,
}

/// Follows how bodies move from step to step, and tells how they touch.
#[derive(Debug)]
pub struct Contacts {
    /// By the index of the handle.
    moving: Vec<Option<Moving>>,
    step_s: f64,
    steps: u64,
}

fn vector(v: Vector) -> [f64; 3] {
    [v.x, v.y, v.z].map(f64::from)
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

/// How a body moves; its origin is that of rapier's, not its centre of mass.
pub fn state(body: &RigidBody) -> BodyState {
    let rotation = body.rotation();
    let origin = body.translation();
    BodyState {
        position_m: vector(origin),
        rotation: [rotation.x, rotation.y, rotation.z, rotation.w].map(f64::from),
        velocity_mps: vector(body.velocity_at_point(origin)),
        angular_velocity_rps: vector(body.angvel()),
    }
}

impl Contacts {
    /// Follows a simulation with steps of this length in seconds.
    ///
    /// # Errors
    /// A length that is none.
    pub fn new(step_s: f64) -> Result<Self> {
        if !(step_s > 0.0 && step_s.is_finite()) {
            return Err(Error::new(format!("a step of the simulation is {step_s} s, expected more than 0")));
        }
        Ok(Self { moving: Vec::new(), step_s, steps: 0 })
    }

    /// The length of a step, in seconds.
    pub fn step_s(&self) -> f64 {
        self.step_s
    }

    /// How many steps there were.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Goes through all contact points of the step that ended at a time, and tells who touches and how, until it is told to
    /// stop. The numbers of the rows' bodies are not set; their line is the number of the step.
    pub fn step<B>(
        &mut self,
        time_s: f64,
        narrow_phase: &NarrowPhase,
        bodies: &RigidBodySet,
        colliders: &ColliderSet,
        mut tell: impl FnMut([Who; 2], Touch) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        self.steps += 1;
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
            self.pair(time_s, pair, bodies, colliders, &mut tell)?;
        }
        ControlFlow::Continue(())
    }

    fn pair<B>(
        &self,
        time_s: f64,
        pair: &ContactPair,
        bodies: &RigidBodySet,
        colliders: &ColliderSet,
        tell: &mut impl FnMut([Who; 2], Touch) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        let handles = [pair.collider1, pair.collider2];
        let parents = handles.map(|handle| colliders.get(handle).and_then(|collider| collider.parent()));
        // What sleeps has the impulses of the step in which it fell asleep.
        let awake =
            |body: &RigidBodyHandle| bodies.get(*body).is_some_and(|b| b.is_dynamic() && !b.is_sleeping());
        if !parents.iter().flatten().any(awake) || parents[0] == parents[1] {
            return ControlFlow::Continue(());
        }
        let who = [0, 1].map(|i| parents[i].map_or(Who::Collider(handles[i]), Who::Body));
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
                    // The time may be none, which is refused by whoever is told.
                    (time_s - self.step_s + closed_s).max(time_s - self.step_s).min(time_s)
                });
                let row = ContactRow {
                    time_s,
                    a: 0,
                    b: 0,
                    position_m,
                    push: Push::Impulse(impulse_ns),
                    normal: Some(normal),
                    normal_velocity_mps: Some(apart_mps),
                    sliding_mps: Some(dot(along, along).sqrt()),
                    line: self.steps,
                };
                tell(who, Touch { row, states, at_s })?;
            }
        }
        ControlFlow::Continue(())
    }
}
