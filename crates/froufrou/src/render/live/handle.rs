//! The game thread's half: what happens, told as it happens.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use std::sync::atomic::Ordering::{Acquire, Release};
use std::thread::JoinHandle;
use std::time::Duration;

use rtrb::Producer;

use super::counters::{Counters, Statistics};
use super::feed::{Delays, Wires};
use super::told::Told;
use crate::motion::lives::Touch;
use crate::scene::contact_log::{ContactRow, Push};
use crate::scene::fed::{Faces, FedPose};
use crate::score::LATEST_S;
use crate::{Error, Result};

/// A body that contacts name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct BodyId(pub(super) u32);

/// Something that is moved by a handle: an object of the scene, its listener, or what appeared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct MoverId {
    slot: u32,
    /// What had the slot before is not meant.
    generation: u32,
}

impl MoverId {
    /// What is there from the beginning.
    pub(super) fn first(slot: usize) -> Self {
        Self { slot: slot as u32, generation: 0 }
    }
}

/// Why something that was told is left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Refused {
    /// One of its numbers is none: the one of this name.
    #[error("`{0}` is no finite number, or beyond all bounds")]
    NotFinite(&'static str),
    /// Its rotation is none: a quaternion of length 1 is expected.
    #[error("its rotation is none: a quaternion of length 1 is expected")]
    Unturned,
    /// It comes before what was told already.
    #[error("it is earlier than what was told before")]
    Earlier,
    /// There is no room: more is told than the worker takes.
    #[error("there is no room for it: more is told than is taken")]
    Full,
    /// There is no such body, object or material.
    #[error("there is no such body, object or material")]
    Unknown,
    /// It is far ahead of what is known: time has to be told to advance first.
    #[error("it is more than a second ahead of the time that was told last")]
    Ahead,
}

impl Refused {
    /// The same as an error.
    pub fn fault(self) -> Error {
        Error::new(self.to_string()).because(self)
    }
}

/// How much was left out, and why.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Left {
    /// Numbers and rotations that are none.
    pub not_finite: u64,
    /// What came before what was told already.
    pub earlier: u64,
    /// What there was no room for.
    pub full: u64,
    /// Bodies, objects and materials that there are not.
    pub unknown: u64,
    /// What was far ahead.
    pub ahead: u64,
}

/// Through this an engine is told what happens: contacts, as rows of a log have them, poses and meshes of what moves, what
/// appears and vanishes, and what becomes of another material. No call waits for the worker or the audio thread. When it is
/// dropped the worker ends, and what sounds fades.
///
/// Times are those of the game, in seconds. What is told comes in order of time, and is known to be complete up to a time by
/// [`Handle::advance`].
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
    /// How much was told.
    pub(super) count: u64,
    /// Whether it waits where there is no room, for what is not live.
    pub(super) waits: bool,
    pub(super) bodies: Bodies,
    pub(super) movers: Movers,
    pub(super) listener: Option<MoverId>,
    /// The names of the objects of the scene and of its materials.
    pub(super) objects: BTreeSet<String>,
    pub(super) materials: BTreeSet<String>,
    /// Nothing may be told that is not later.
    pub(super) known_s: Option<f64>,
    pub(super) contact_s: f64,
    /// Whether the first time that is told may be that with which the scene begins.
    pub(super) may_begin_late: bool,
    /// So much of the game's time was left out: see [`Handle::skipped_s`].
    pub(super) skipped_s: f64,
    /// What time the game had before its clock leapt last.
    pub(super) leapt_from_s: Option<f64>,
    /// A time that there was no room for.
    pub(super) owed_s: Option<f64>,
    pub(super) rows: u64,
    pub(super) left: Left,
    pub(super) wires: Wires,
    pub(super) worker: Option<JoinHandle<()>>,
    pub(super) counters: Arc<Counters>,
    pub(super) latency: Latency,
}

/// How long it takes from what is told until it is due at the device, in seconds, if time is told as it passes; beside the
/// way through the air.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Latency {
    /// All that sounds: what is told at a time is due so much later.
    pub all_s: f64,
    /// What of that is [`EngineSettings::ahead_s`](super::EngineSettings::ahead_s): the time between two calls of
    /// [`Handle::advance`] passes in it.
    pub ahead_s: f64,
    /// So much later than that is what has to be looked at for longer, and is heard later for it.
    pub delays: Delays,
}

/// The bodies that contacts name.
#[derive(Default)]
pub(super) struct Bodies {
    numbers: BTreeMap<String, BodyId>,
    /// The name of each number; none where it may be given away again.
    names: Vec<Option<String>>,
    free: VecDeque<u32>,
}

/// What is moved.
#[derive(Default)]
pub(super) struct Movers {
    names: BTreeMap<String, MoverId>,
    slots: Vec<Slot>,
    free: VecDeque<u32>,
}

/// A place of something that is moved.
#[derive(Clone, Copy, Default)]
struct Slot {
    /// Which generation has it.
    generation: u32,
    /// For when its pose was told last, and its mesh.
    told_s: [f64; 2],
}

/// What is told of something that is moved: both come in order of time.
#[derive(Clone, Copy)]
enum Moving {
    Pose,
    Mesh,
}

impl Movers {
    /// What is there from the beginning, in the order of its slots; a listener has a slot and no name.
    pub fn new(names: BTreeMap<String, MoverId>, slots: usize) -> Self {
        Self { names, slots: vec![Slot::default(); slots], free: VecDeque::new() }
    }

    fn slot(&mut self, id: MoverId) -> Option<&mut Slot> {
        self.slots.get_mut(id.slot as usize).filter(|slot| slot.generation == id.generation)
    }

    /// A place for something that appears at a time.
    fn take(&mut self, time_s: f64) -> Option<MoverId> {
        let number = match self.free.pop_front() {
            Some(number) => number,
            None if self.slots.len() < MOST_MOVERS => {
                self.slots.push(Slot::default());
                self.slots.len() as u32 - 1
            }
            None => return None,
        };
        let slot = &mut self.slots[number as usize];
        slot.told_s = [time_s; 2];
        Some(MoverId { slot: number, generation: slot.generation })
    }

    fn leave(&mut self, id: MoverId) {
        if let Some(slot) = self.slots.get_mut(id.slot as usize) {
            slot.generation = slot.generation.wrapping_add(1);
            self.free.push_back(id.slot);
        }
    }
}

/// So much may be moved at once.
const MOST_MOVERS: usize = 1 << 16;

/// A number of a body is given away again once so many others wait for that: by then nobody remembers the contacts of who had
/// it.
const RESTING: usize = 256;

/// What is told is no further ahead of what is known, in seconds, and time goes no further at once.
const FARTHEST_AHEAD_S: f64 = 1.0;

/// Where there is no room, who waits looks again after so long.
const NAP: Duration = Duration::from_micros(200);

/// So many bodies may have names.
const MOST_BODIES: usize = 1 << 20;

impl Handle {
    /// A body of a name, as contacts have it; the scene's objects say by their `body` whose it is.
    ///
    /// # Errors
    /// More bodies than can be, or no room.
    pub fn body(&mut self, name: &str) -> Result<BodyId, Refused> {
        if let Some(body) = self.bodies.numbers.get(name) {
            return Ok(*body);
        }
        let is_rested = self.bodies.free.len() > RESTING;
        let number = match self.bodies.free.front().filter(|_| is_rested) {
            Some(&number) => number,
            None if self.bodies.names.len() >= MOST_BODIES => return self.leave(Refused::Full),
            None => self.bodies.names.len() as u32,
        };
        self.tell(Told::Body(number, name.into()))?;
        if is_rested {
            self.bodies.free.pop_front();
        } else {
            self.bodies.names.push(None);
        }
        self.bodies.names[number as usize] = Some(name.to_owned());
        self.bodies.numbers.insert(name.to_owned(), BodyId(number));
        Ok(BodyId(number))
    }

    /// The object of a name that can be moved: one that the engine was started with as one that moves, or one that appeared.
    pub fn object(&self, name: &str) -> Option<MoverId> {
        self.movers.names.get(name).copied()
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
        self.check(named.chain(moving))?;
        let turns = states.iter().flatten().map(|state| state.rotation.iter().map(|c| c * c).sum::<f64>());
        if turns.into_iter().any(|square| (square - 1.0).abs() > MOST_STRETCHED) {
            return self.leave(Refused::Unturned);
        }
        let time_s = self.time(row.time_s)?;
        if time_s < self.contact_s {
            return self.leave(Refused::Earlier);
        }
        let is_there = |body: &BodyId| matches!(self.bodies.names.get(body.0 as usize), Some(Some(_)));
        if ![a, b].iter().all(is_there) {
            return self.leave(Refused::Unknown);
        }
        let row = ContactRow { a: a.0, b: b.0, line: self.rows + 1, time_s, ..row.clone() };
        let at_s = at_s.map(|at_s| at_s - self.skipped_s);
        self.tell(Told::Contact(Box::new(Touch { row, at_s, ..touch.clone() })))?;
        (self.contact_s, self.rows) = (time_s, self.rows + 1);
        Ok(())
    }

    /// Tells where an object is at a time.
    ///
    /// # Errors
    /// What is told is left out, and counted.
    pub fn transform(&mut self, object: MoverId, time_s: f64, pose: FedPose) -> Result<(), Refused> {
        self.check_pose(time_s, &pose)?;
        self.tell_of(object, Moving::Pose, time_s, |slot, time_s| Told::Pose { slot, time_s, pose })
    }

    /// Tells of something that is moved, which comes in order of time.
    fn tell_of(
        &mut self,
        object: MoverId,
        what: Moving,
        time_s: f64,
        told: impl FnOnce(u32, f64) -> Told,
    ) -> Result<(), Refused> {
        let time_s = self.time(time_s)?;
        match self.movers.slot(object).map(|slot| slot.told_s[what as usize]) {
            None => return self.leave(Refused::Unknown),
            Some(last_s) if time_s < last_s => return self.leave(Refused::Earlier),
            Some(_) => self.tell(told(object.slot, time_s))?,
        }
        if let Some(slot) = self.movers.slot(object) {
            slot.told_s[what as usize] = time_s;
        }
        Ok(())
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

    /// Tells where the vertices of an object are at a time, in the world and in metres: one of the
    /// [`EngineSettings::meshes`](super::EngineSettings::meshes), or what appeared as an object with a mesh. Its faces are those of
    /// that mesh, or those that were told last.
    ///
    /// # Errors
    /// What is told is left out, and counted. Vertices that the faces are not of are a fault: see [`Handle::take_fault`].
    pub fn mesh(&mut self, object: MoverId, time_s: f64, positions_m: &[[f32; 3]]) -> Result<(), Refused> {
        self.mesh_of(object, time_s, positions_m, None)
    }

    /// The same with faces: of a mesh that the scene does not know, or that has become another.
    ///
    /// # Errors
    /// As there.
    pub fn mesh_with_faces(
        &mut self,
        object: MoverId,
        time_s: f64,
        positions_m: &[[f32; 3]],
        faces: Arc<Faces>,
    ) -> Result<(), Refused> {
        self.mesh_of(object, time_s, positions_m, Some(faces))
    }

    fn mesh_of(
        &mut self,
        object: MoverId,
        time_s: f64,
        positions_m: &[[f32; 3]],
        faces: Option<Arc<Faces>>,
    ) -> Result<(), Refused> {
        self.check([("time_s", time_s)].into_iter())?;
        if !positions_m.as_flattened().iter().all(|c| f64::from(c.abs()) <= FARTHEST) {
            return self.leave(Refused::NotFinite("positions_m"));
        }
        self.tell_of(object, Moving::Mesh, time_s, |slot, time_s| {
            let positions = positions_m.into();
            Told::Mesh { slot, time_s, positions, faces }
        })
    }

    /// Something appears that is as an object of the scene, its kind: it has its sounds, which begin now, its material and its
    /// mesh, where that has one, and contacts may name it as a body. It stands where it appears until it is told to move. What
    /// has that name already is there no more, but for an object of the scene that vanished.
    ///
    /// # Errors
    /// What is told is left out, and counted; a kind that there is not; more than can be.
    pub fn appear(&mut self, kind: &str, name: &str, time_s: f64, pose: FedPose) -> Result<MoverId, Refused> {
        self.check_pose(time_s, &pose)?;
        let at_s = self.time(time_s)?;
        if !self.objects.contains(kind) {
            return self.leave(Refused::Unknown);
        }
        if self.movers.names.contains_key(name) || self.objects.contains(name) {
            self.vanish_mover(name, at_s)?;
        }
        let Some(id) = self.movers.take(at_s) else { return self.leave(Refused::Full) };
        let told = Told::Appear { slot: id.slot, name: name.into(), kind: kind.into(), time_s: at_s, pose };
        if let Err(refused) = self.tell(told) {
            self.movers.free.push_front(id.slot);
            return Err(refused);
        }
        self.movers.names.insert(name.to_owned(), id);
        Ok(id)
    }

    /// What appeared, or an object of the scene, is no more: what it sounds like fades within a hundredth of a second. A body of
    /// that name is none any more.
    ///
    /// # Errors
    /// What is told is left out, and counted.
    pub fn vanish(&mut self, name: &str, time_s: f64) -> Result<(), Refused> {
        self.check([("time_s", time_s)].into_iter())?;
        let time_s = self.time(time_s)?;
        let body = self.bodies.numbers.get(name).copied();
        if !self.movers.names.contains_key(name) && body.is_none() && !self.objects.contains(name) {
            return self.leave(Refused::Unknown);
        }
        self.vanish_mover(name, time_s)?;
        if let Some(body) = body {
            self.bodies.numbers.remove(name);
            self.bodies.names[body.0 as usize] = None;
            self.bodies.free.push_back(body.0);
        }
        Ok(())
    }

    fn vanish_mover(&mut self, name: &str, time_s: f64) -> Result<(), Refused> {
        let id = self.movers.names.get(name).copied();
        self.tell(Told::Vanish { slot: id.map(|id| id.slot), name: name.into(), time_s })?;
        if let Some(id) = id {
            self.movers.names.remove(name);
            self.movers.leave(id);
        }
        Ok(())
    }

    /// Something becomes of another material of the scene: an object, what appeared, or a body that contacts name.
    ///
    /// # Errors
    /// What is told is left out, and counted; a material that there is not.
    pub fn material(&mut self, name: &str, material: &str, time_s: f64) -> Result<(), Refused> {
        self.check([("time_s", time_s)].into_iter())?;
        let time_s = self.time(time_s)?;
        let is_there = self.objects.contains(name)
            || self.movers.names.contains_key(name)
            || self.bodies.numbers.contains_key(name);
        if !is_there || !self.materials.contains(material) {
            return self.leave(Refused::Unknown);
        }
        self.tell(Told::Material { name: name.into(), material: material.into(), time_s })
    }

    /// Says that all that happens up to a time has been told, which is not before that of the last contact. What was not
    /// told to move since has stood still. Where time leaps ahead by more than a second, what is more than that is left out: to
    /// the ear it is a second. A clock that leapt by mistake and comes back goes on. Where the first time that is told is beyond
    /// the first second, the scene begins with it, unless [`EngineSettings::begins_s`](super::EngineSettings::begins_s) says when.
    ///
    /// # Errors
    /// A time that is earlier than before, or is none. Where there is no room it is said again with the next.
    pub fn advance(&mut self, time_s: f64) -> Result<(), Refused> {
        self.check([("time_s", time_s)].into_iter())?;
        self.begin(time_s);
        let known_s = self.known_s.unwrap_or(0.0);
        let least_s = known_s.max(self.contact_s);
        let leap_s = (time_s - self.skipped_s - known_s - FARTHEST_AHEAD_S).max(0.0);
        let back = self.leapt_from_s.filter(|from_s| (*from_s..self.skipped_s + least_s).contains(&time_s));
        let skipped_s = match back {
            Some(_) => time_s - least_s,
            None => self.skipped_s + leap_s,
        };
        let engine_s = time_s - skipped_s;
        if engine_s > LATEST_S {
            return self.leave(Refused::NotFinite("time_s"));
        }
        if engine_s < least_s {
            return self.leave(Refused::Earlier);
        }
        if leap_s > 0.0 {
            self.leapt_from_s = Some(known_s + self.skipped_s);
        } else if back.is_some() {
            self.leapt_from_s = None;
        }
        self.skipped_s = skipped_s;
        let time_s = engine_s;
        self.known_s = Some(time_s);
        self.owed_s = Some(time_s);
        self.settle_debt();
        self.wires.wake();
        Ok(())
    }

    /// A clock need not begin at 0.
    fn begin(&mut self, time_s: f64) {
        if self.may_begin_late && self.known_s.is_none() && time_s > FARTHEST_AHEAD_S {
            self.may_begin_late = false;
            (self.skipped_s, self.leapt_from_s) = (time_s, Some(0.0));
        }
    }

    /// Tells the time that there was no room for; false where there is still none.
    pub(super) fn settle_debt(&mut self) -> bool {
        if let Some(time_s) = self.owed_s
            && self.push(Told::Advance(time_s)).is_ok()
        {
            self.owed_s = None;
        }
        self.owed_s.is_none()
    }

    fn push(&mut self, told: Told) -> Result<(), ()> {
        let mut told = told;
        loop {
            match self.told.push(told) {
                Ok(()) => {
                    self.count += 1;
                    return Ok(());
                }
                // Nobody listens any more.
                Err(_) if self.waits && self.told.is_abandoned() => return Ok(()),
                Err(rtrb::PushError::Full(back)) if self.waits => {
                    std::thread::sleep(NAP);
                    told = back;
                }
                Err(_) => return Err(()),
            }
        }
    }

    fn tell(&mut self, told: Told) -> Result<(), Refused> {
        if !self.settle_debt() || self.push(told).is_err() {
            return self.leave(Refused::Full);
        }
        Ok(())
    }

    /// Refuses numbers that are none.
    fn check(&mut self, mut named: impl Iterator<Item = (&'static str, f64)>) -> Result<(), Refused> {
        match named.find(|(_, number)| number.abs() > FARTHEST || number.is_nan()) {
            Some((name, _)) => self.leave(Refused::NotFinite(name)),
            None => Ok(()),
        }
    }

    fn check_pose(&mut self, time_s: f64, pose: &FedPose) -> Result<(), Refused> {
        let numbers = [("time_s", time_s)].into_iter().chain(pose.position_m.map(|c| ("position_m", c)));
        self.check(numbers.chain(pose.rotation.map(|c| ("rotation", c))))?;
        if pose.rotation.iter().map(|c| c * c).sum::<f64>() < 1e-12 {
            return self.leave(Refused::Unturned);
        }
        Ok(())
    }

    /// The engine's time of one that is told, where it may be told.
    fn time(&mut self, time_s: f64) -> Result<f64, Refused> {
        self.begin(time_s);
        let time_s = time_s - self.skipped_s;
        if time_s < 0.0 || self.known_s.is_some_and(|known_s| time_s <= known_s) {
            return self.leave(Refused::Earlier);
        }
        if time_s > LATEST_S.min(self.known_s.unwrap_or(0.0) + FARTHEST_AHEAD_S) {
            return self.leave(Refused::Ahead);
        }
        Ok(time_s)
    }

    pub(super) fn leave<T>(&mut self, why: Refused) -> Result<T, Refused> {
        match why {
            Refused::NotFinite(_) | Refused::Unturned => self.left.not_finite += 1,
            Refused::Earlier => self.left.earlier += 1,
            Refused::Full => self.left.full += 1,
            Refused::Unknown => self.left.unknown += 1,
            Refused::Ahead => self.left.ahead += 1,
        }
        Err(why)
    }

    /// How much more can be told before the worker takes some.
    pub fn room(&self) -> usize {
        self.told.slots()
    }

    /// By so many seconds the game's clock is ahead of the time of the scene, by which frames are counted: what it said when the
    /// scene began, and where it leapt since, what was left out of that.
    pub fn skipped_s(&self) -> f64 {
        self.skipped_s
    }

    /// Whether the worker has made all that it can of what was told, and waits for more.
    pub fn is_waiting(&self) -> bool {
        self.owed_s.is_none() && self.wires.taken.load(Acquire) == self.count
    }

    /// What was left out so far.
    pub fn left_out(&self) -> Left {
        self.left
    }

    /// What happened on the audio thread.
    pub fn statistics(&self) -> Statistics {
        self.counters.statistics()
    }

    /// How long it takes from what is told until it is due at the device.
    pub fn latency(&self) -> Latency {
        self.latency
    }

    /// How many sounds of the scene are loaded, and how many there are: see
    /// [`EngineSettings::loads_behind`](super::EngineSettings::loads_behind). One that could not be loaded counts as well, and is a
    /// fault.
    pub fn loaded(&self) -> [u64; 2] {
        [0, 1].map(|which| self.wires.loaded[which].load(Acquire))
    }

    /// Whether the worker goes on. Where it does not, [`Handle::take_fault`] may say why.
    pub fn is_running(&self) -> bool {
        self.worker.as_ref().is_some_and(|worker| !worker.is_finished())
    }

    /// What went wrong in the worker, if something did: the first fault of those that were not asked for yet, of which a few are
    /// kept. A synthesised sound that fails falls silent, and a mesh
    /// that is none is left out; all else ends the worker.
    pub fn take_fault(&mut self) -> Option<Error> {
        self.wires.faults.take()
    }
}

impl Drop for Handle {
    fn drop(&mut self) {
        self.wires.stop.store(true, Release);
        self.wires.wake();
        if let Some(worker) = self.worker.take() {
            // It has told its fault, if it had one.
            let _ = worker.join();
        }
    }
}

/// The square of the length of a body's rotation is no further from 1.
const MOST_STRETCHED: f64 = 0.01;

/// No number that is told may be further from 0.
const FARTHEST: f64 = 1e12;
