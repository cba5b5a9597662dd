//! The game thread's half: what happens, told as it happens.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering::{Acquire, Release};
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::thread::JoinHandle;

use rtrb::Producer;

use super::counters::{Counters, Statistics};
use super::feed::Told;
use crate::motion::lives::Touch;
use crate::scene::contact_log::{ContactRow, Push};
use crate::scene::fed::FedPose;
use crate::score::LATEST_S;
use crate::{Error, Result};

/// A body that contacts name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct BodyId(pub(super) u32);

/// An object of the scene, or its listener, that is moved by a handle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct MoverId(pub(super) usize);

/// Why something that was told is left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Refused {
    /// One of its numbers is none: the one of this name.
    #[error("`{0}` is no finite number, or beyond all bounds")]
    NotFinite(&'static str),
    /// It comes before what was told already.
    #[error("it is earlier than what was told before")]
    Earlier,
    /// There is no room: more is told than the worker takes.
    #[error("there is no room for it: more is told than is taken")]
    Full,
    /// There is no such body.
    #[error("there is no body of this number")]
    Unknown,
}

/// How much was left out, and why.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Left {
    /// Numbers that are none.
    pub not_finite: u64,
    /// What came before what was told already.
    pub earlier: u64,
    /// What there was no room for.
    pub full: u64,
    /// Bodies that there are not.
    pub unknown: u64,
}

/// Through this an engine is told contacts, as rows of a log have them, and the poses of what moves. No call waits for the
/// worker or the audio thread. When it is dropped the worker ends, and what sounds fades.
///
/// ```no_run
/// use froufrou::render::live::{self, EngineSettings};
/// use froufrou::scene::Scene;
/// use froufrou::scene::contact_log::{ContactRow, Push};
///
/// let settings = EngineSettings { moves_listener: true, ..EngineSettings::default() };
/// let (mut handle, mut player) = live::start(Scene::open("scene.toml", false)?, settings)?;
/// // The callback of a device owns the player: `player.fill(block)`.
/// # let mut block = [0.0; 256];
/// # player.fill(&mut block);
/// let bodies = [handle.body("ball")?, handle.body("floor")?];
/// for frame in 1..=600 {
///     let time_s = f64::from(frame) / 60.0;
///     let row = ContactRow {
///         time_s, a: 0, b: 0, position_m: [0.0; 3], push: Push::Impulse(0.2), normal: None,
///         normal_velocity_mps: None, sliding_mps: None, line: 0,
///     };
///     if frame % 60 == 0 {
///         handle.contact(bodies, &row)?;
///     }
///     handle.advance(time_s)?;
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Handle {
    pub(super) told: Producer<Told>,
    /// How much was told, and how much of it the worker had taken when it last waited for more.
    pub(super) count: u64,
    pub(super) taken: Arc<AtomicU64>,
    pub(super) bodies: BTreeMap<String, BodyId>,
    pub(super) movers: BTreeMap<String, MoverId>,
    pub(super) listener: Option<MoverId>,
    /// Nothing may be told that is earlier.
    pub(super) known_s: f64,
    pub(super) contact_s: f64,
    /// A time that there was no room for.
    pub(super) owed_s: Option<f64>,
    pub(super) rows: u64,
    pub(super) left: Left,
    pub(super) stop: Arc<AtomicBool>,
    pub(super) fault: Arc<std::sync::Mutex<Option<Error>>>,
    pub(super) worker: Option<JoinHandle<()>>,
    pub(super) counters: Arc<Counters>,
    pub(super) latency_s: f64,
}

/// So many bodies may have names.
const MOST_BODIES: usize = 1 << 20;

impl Handle {
    /// A body of a name, as contacts have it; the scene's objects say by their `body` whose it is.
    ///
    /// # Errors
    /// More bodies than can be, or no room.
    pub fn body(&mut self, name: &str) -> Result<BodyId, Refused> {
        if let Some(body) = self.bodies.get(name) {
            return Ok(*body);
        }
        if self.bodies.len() >= MOST_BODIES {
            return self.leave(Refused::Unknown);
        }
        let body = BodyId(self.bodies.len() as u32);
        self.tell(Told::Body(name.into()))?;
        self.bodies.insert(name.to_owned(), body);
        Ok(body)
    }

    /// The object of a name, where the engine was started with it as one that moves.
    pub fn object(&self, name: &str) -> Option<MoverId> {
        self.movers.get(name).copied()
    }

    /// Tells of a contact of two bodies in a step of a simulation, in order of time: the numbers of the row are those of
    /// [`Handle::body`], its line is not looked at.
    ///
    /// # Errors
    /// What is told is left out, and counted.
    pub fn contact(&mut self, bodies: [BodyId; 2], row: &ContactRow) -> Result<(), Refused> {
        self.touch(bodies, &Touch::from(row.clone()))
    }

    /// The same, with what is known of how the bodies move: so what rolls is told apart from what slides, and where on both they
    /// touch. A time within the step lets an impact be where it belongs.
    ///
    /// # Errors
    /// What is told is left out, and counted.
    pub fn touch(&mut self, [a, b]: [BodyId; 2], touch: &Touch) -> Result<(), Refused> {
        let Touch { row, states, at_s } = touch;
        let (Push::Force(push) | Push::Impulse(push)) = row.push;
        let named = [("time_s", row.time_s), ("push", push)].into_iter();
        let named = named.chain(row.position_m.map(|c| ("position_m", c)));
        let named = named.chain(row.normal.into_iter().flatten().map(|c| ("normal", c)));
        let named = named.chain(row.normal_velocity_mps.map(|v| ("normal_velocity_mps", v)));
        let named = named.chain(row.sliding_mps.map(|v| ("sliding_mps", v)));
        let named = named.chain(at_s.map(|at_s| ("at_s", at_s)));
        let moving = states.iter().flatten().flat_map(|state| {
            let place = state.position_m.map(|c| ("position_m", c)).into_iter();
            let place = place.chain(state.rotation.map(|c| ("rotation", c)));
            let place = place.chain(state.velocity_mps.map(|c| ("velocity_mps", c)));
            place.chain(state.angular_velocity_rps.map(|c| ("angular_velocity_rps", c)))
        });
        let mut named = named.chain(moving);
        if let Some((name, _)) = named.find(|(_, number)| number.abs() > FARTHEST || number.is_nan()) {
            return self.leave(Refused::NotFinite(name));
        }
        let turns = states.iter().flatten().map(|state| state.rotation.iter().map(|c| c * c).sum::<f64>());
        if turns.into_iter().any(|square| (square - 1.0).abs() > MOST_STRETCHED) {
            return self.leave(Refused::NotFinite("rotation"));
        }
        if !(0.0..=LATEST_S).contains(&row.time_s) || row.time_s < self.known_s.max(self.contact_s) {
            return self.leave(Refused::Earlier);
        }
        if [a, b].iter().any(|body| body.0 as usize >= self.bodies.len()) {
            return self.leave(Refused::Unknown);
        }
        let row = ContactRow { a: a.0, b: b.0, line: self.rows + 1, ..row.clone() };
        let time_s = row.time_s;
        self.tell(Told::Contact(Touch { row, ..touch.clone() }))?;
        (self.contact_s, self.rows) = (time_s, self.rows + 1);
        Ok(())
    }

    /// Tells where an object is at a time.
    ///
    /// # Errors
    /// What is told is left out, and counted.
    pub fn transform(&mut self, object: MoverId, time_s: f64, pose: FedPose) -> Result<(), Refused> {
        let numbers = [("time_s", time_s)].into_iter().chain(pose.position_m.map(|c| ("position_m", c)));
        let mut numbers = numbers.chain(pose.rotation.map(|c| ("rotation", c)));
        if let Some((name, _)) = numbers.find(|(_, number)| number.abs() > FARTHEST || number.is_nan()) {
            return self.leave(Refused::NotFinite(name));
        }
        if pose.rotation.iter().map(|c| c * c).sum::<f64>() < 1e-12 {
            return self.leave(Refused::NotFinite("rotation"));
        }
        if !(0.0..=LATEST_S).contains(&time_s) || time_s < self.known_s {
            return self.leave(Refused::Earlier);
        }
        self.tell(Told::Pose(object, time_s, pose))
    }

    /// Tells where the listener is, where the engine was started with one that moves.
    ///
    /// # Errors
    /// As [`Handle::transform`]; a listener that does not move.
    pub fn listener(&mut self, time_s: f64, pose: FedPose) -> Result<(), Refused> {
        match self.listener {
            Some(listener) => self.transform(listener, time_s, pose),
            None => self.leave(Refused::Unknown),
        }
    }

    /// Says that all that happens before a time has been told, which is not before that of the last contact. What was not
    /// told to move since has stood still.
    ///
    /// # Errors
    /// A time that is earlier than before, or is none. Where there is no room it is said again with the next.
    pub fn advance(&mut self, time_s: f64) -> Result<(), Refused> {
        if !time_s.is_finite() {
            return self.leave(Refused::NotFinite("time_s"));
        }
        if !(0.0..=LATEST_S).contains(&time_s) || time_s < self.known_s.max(self.contact_s) {
            return self.leave(Refused::Earlier);
        }
        self.known_s = time_s;
        self.owed_s = Some(time_s);
        self.pay();
        if let Some(worker) = &self.worker {
            worker.thread().unpark();
        }
        Ok(())
    }

    /// Says a time that there was no room for, if there is now.
    fn pay(&mut self) {
        if let Some(time_s) = self.owed_s
            && self.told.push(Told::Advance(time_s)).is_ok()
        {
            self.owed_s = None;
            self.count += 1;
        }
    }

    fn tell(&mut self, told: Told) -> Result<(), Refused> {
        self.pay();
        if self.owed_s.is_some() || self.told.push(told).is_err() {
            return self.leave(Refused::Full);
        }
        self.count += 1;
        Ok(())
    }

    /// How much more can be told before the worker takes some.
    pub fn room(&self) -> usize {
        self.told.slots()
    }

    /// Whether the worker has made all that it can of what was told, and waits for more.
    pub fn is_waiting(&self) -> bool {
        self.taken.load(Acquire) == self.count
    }

    pub(super) fn leave<T>(&mut self, why: Refused) -> Result<T, Refused> {
        match why {
            Refused::NotFinite(_) => self.left.not_finite += 1,
            Refused::Earlier => self.left.earlier += 1,
            Refused::Full => self.left.full += 1,
            Refused::Unknown => self.left.unknown += 1,
        }
        Err(why)
    }

    /// What was left out so far.
    pub fn left_out(&self) -> Left {
        self.left
    }

    /// What happened on the audio thread.
    pub fn statistics(&self) -> Statistics {
        self.counters.statistics()
    }

    /// How long it takes at most, beside the way through the air, from a time that is told until it is due at the device, if
    /// time is told as it passes. Where the listener moves, the way through the air of what is farthest comes on top, for all that
    /// sounds: where it will be when that arrives must be known first.
    pub fn latency_s(&self) -> f64 {
        self.latency_s
    }

    /// Whether the worker goes on. Where it does not, [`Handle::take_fault`] may say why.
    pub fn is_running(&self) -> bool {
        self.worker.as_ref().is_some_and(|worker| !worker.is_finished())
    }

    /// What went wrong in the worker, if something did; it is told once. A synthesised sound that fails falls silent; all else
    /// ends the worker.
    pub fn take_fault(&mut self) -> Option<Error> {
        self.fault.lock().unwrap_or_else(std::sync::PoisonError::into_inner).take()
    }
}

impl Drop for Handle {
    fn drop(&mut self) {
        self.stop.store(true, Release);
        if let Some(worker) = self.worker.take() {
            worker.thread().unpark();
            // It has told its fault, if it had one.
            let _ = worker.join();
        }
    }
}

/// The square of the length of a body's rotation is no further from 1.
const MOST_STRETCHED: f64 = 0.01;

/// No number that is told may be further from 0.
const FARTHEST: f64 = 1e12;
