//! What a handle tells, as events of a scene in order of time.

use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::Ordering::{Acquire, Release};
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::Thread;
use std::time::Duration;

use rtrb::Consumer;

use super::meshes::Meshes;
use super::told::Told;
use crate::motion::event::{Becomes, Cause, Change, Event, LogRows};
use crate::motion::impact::{Settings, Step};
use crate::motion::lives::{Found, Lives, Touch};
use crate::motion::moving_cloth;
use crate::scene::fed::Fed;
use crate::time::Time;
use crate::{Error, Result};

/// So long the worker sleeps at most where nothing is told.
const NAP: Duration = Duration::from_micros(500);

/// The events of what is told. An iterator that waits until there is one, or until it is known that there is none before
/// a time; it ends when it is stopped and all that was told is taken.
///
/// Impacts are passed on at their times. What is found out later than that comes later by a steady time, so that nothing else
/// waits for it: see [`Delays`].
pub(super) struct Feed {
    told: Consumer<Told>,
    bodies: Vec<Arc<str>>,
    lives: Lives,
    movers: Vec<Option<Arc<Fed>>>,
    meshes: Meshes,
    delays: Delays,
    /// Events that are known and not passed on yet, by their time and how many were known before.
    pending: BTreeMap<(Time, u64), Event>,
    count: u64,
    /// What appeared of late, and when.
    appeared: Vec<(Arc<str>, f64)>,
    /// What was told last to be known, and what of it has been passed on.
    known_s: f64,
    passed_s: f64,
    wires: Wires,
    /// How much was taken of what was told.
    taken: u64,
    step_s: f64,
}

/// What a worker and a handle have in common.
#[derive(Clone, Default)]
pub(super) struct Wires {
    /// Whether it is all over.
    pub stop: Arc<AtomicBool>,
    /// How much was taken of what was told, once the worker waits for more.
    pub taken: Arc<AtomicU64>,
    /// Whether the worker waits for what is told next.
    pub rests: Arc<AtomicBool>,
    /// Who works.
    pub worker: Arc<OnceLock<Thread>>,
    /// How many sounds are loaded, of how many.
    pub loaded: Arc<[AtomicU64; 2]>,
    pub faults: Faults,
}

/// By how much later than it happens what is told is passed on, in seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Delays {
    /// What slides and rolls: two moments tell which of it it is.
    pub rubbing_s: f64,
    /// What cloth does: where it buckles is known once it has.
    pub cloth_s: f64,
}

impl Delays {
    fn new(lives: &Lives) -> Self {
        Self { rubbing_s: lives.rubs_behind_s(), cloth_s: moving_cloth::prompt_behind_s() }
    }

    /// Those of contacts that are told in steps of so many seconds.
    pub(super) fn of(step_s: f64) -> Self {
        Self::new(&Lives::new(Settings::prompt(Step::Fixed(step_s))))
    }
}

/// Faults that do not end a worker. The first ones are kept until somebody asks.
#[derive(Clone, Default)]
pub(super) struct Faults(Arc<Mutex<VecDeque<Error>>>);

/// So many faults are kept.
const MOST_FAULTS: usize = 16;

impl Faults {
    fn all(&self) -> MutexGuard<'_, VecDeque<Error>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub fn tell(&self, fault: Error) {
        let mut all = self.all();
        if all.len() < MOST_FAULTS {
            all.push_back(fault);
        }
    }

    /// The last word.
    pub fn end(&self, fault: Error) {
        self.all().push_back(fault);
    }

    pub fn take(&self) -> Option<Error> {
        self.all().pop_front()
    }
}

impl Wires {
    /// Wakes the worker, where it sleeps.
    pub fn wake(&self) {
        self.worker.get().into_iter().for_each(Thread::unpark);
    }
}

impl Feed {
    /// A feed for contacts in steps of so many seconds; `movers` are what is told to move from the beginning.
    pub fn new(
        told: Consumer<Told>,
        step_s: f64,
        movers: Vec<Arc<Fed>>,
        meshes: Meshes,
        wires: Wires,
    ) -> Self {
        let lives = Lives::new(Settings::prompt(Step::Fixed(step_s)));
        Self {
            told,
            bodies: Vec::new(),
            delays: Delays::new(&lives),
            lives,
            movers: movers.into_iter().map(Some).collect(),
            meshes,
            pending: BTreeMap::new(),
            count: 0,
            appeared: Vec::new(),
            known_s: 0.0,
            passed_s: 0.0,
            wires,
            taken: 0,
            step_s,
        }
    }

    fn mover(&self, slot: u32) -> Option<&Arc<Fed>> {
        self.movers.get(slot as usize)?.as_ref()
    }

    /// Passes what was found of contacts on, but not before its bodies have appeared: a blow lies within its step, and what
    /// is hit as it appears does so at its end.
    fn pass_on(&mut self, found: Found, later_s: f64) {
        let bodies = found.bodies().map(|body| self.bodies.get(body as usize));
        let appeared = self.appeared.iter().filter(|(name, _)| bodies.contains(&Some(name)));
        let least_s = appeared.fold(0.0, |least_s: f64, (_, time_s)| least_s.max(*time_s));
        let event = self.found(found);
        let time_s = event.time_s().max(least_s);
        self.push(event.at(time_s), later_s);
    }

    /// Passes an event on when its time has come, and not before what was passed on.
    fn push(&mut self, event: Event, later_s: f64) {
        let time_s = (event.time_s() + later_s).max(self.passed_s);
        self.count += 1;
        self.pending.insert((Time(time_s), self.count), event.at(time_s));
    }

    fn take(&mut self, told: Told) -> Result<()> {
        match told {
            Told::Body(number, name) => {
                let number = number as usize;
                if self.bodies.len() <= number {
                    self.bodies.resize(number + 1, "".into());
                }
                self.bodies[number] = name;
            }
            Told::Contact(contact) => {
                // Within its step, whoever told it.
                let end_s = contact.row.time_s;
                let at_s = contact.at_s.map(|at_s| at_s.clamp(end_s - self.step_s, end_s));
                self.lives.touch(&Touch { at_s, ..*contact })?;
            }
            Told::Pose { slot, time_s, pose } => {
                if let Some(fed) = self.mover(slot) {
                    fed.push(time_s, pose);
                }
            }
            Told::Mesh { slot, time_s, positions, faces } => {
                if let Some(fed) = self.mover(slot).cloned()
                    && let Err(fault) = self.meshes.tell(&fed, time_s, positions, faces)
                {
                    self.wires.faults.tell(fault);
                }
            }
            Told::Appear { slot, name, kind, time_s, pose } => {
                match self.meshes.appear(&name, &kind, time_s, pose) {
                    Ok(fed) => {
                        let slot = slot as usize;
                        if self.movers.len() <= slot {
                            self.movers.resize(slot + 1, None);
                        }
                        self.movers[slot] = Some(fed.clone());
                        self.appeared.push((name.clone(), time_s));
                        self.change(time_s, &name, Becomes::There { kind: kind.to_string(), fed });
                    }
                    Err(fault) => self.wires.faults.tell(fault),
                }
            }
            Told::Vanish { slot, name, time_s } => {
                self.look_before(time_s, &name);
                self.meshes.vanish(&name);
                if let Some(mover) = slot.and_then(|slot| self.movers.get_mut(slot as usize)) {
                    *mover = None;
                }
                self.change(time_s, &name, Becomes::Gone);
            }
            Told::Material { name, material, time_s } => {
                self.look_before(time_s, &name);
                self.meshes.material(&name, &material);
                self.change(time_s, &name, Becomes::Of(material.to_string()));
            }
            Told::Advance(time_s) => {
                self.lives.complete(time_s)?;
                while let Some(blow) = self.lives.next_blow() {
                    self.pass_on(Found::Blow(blow), 0.0);
                }
                while let Some(rubbed) = self.lives.next_rubbed() {
                    self.pass_on(Found::Rubbed(rubbed), self.delays.rubbing_s);
                }
                self.appeared.retain(|(_, at_s)| *at_s > time_s - self.step_s);
                self.movers.iter().flatten().for_each(|fed| fed.stand(time_s));
                self.look(time_s);
                self.known_s = time_s;
            }
        }
        Ok(())
    }

    fn change(&mut self, time_s: f64, name: &str, what: Becomes) {
        self.push(Event::Change(Change { time_s, name: name.to_owned(), what }), 0.0);
    }

    /// Looks at the frames before a time at which something changes that takes part in them. Those of that time may not all
    /// be told yet.
    fn look_before(&mut self, time_s: f64, name: &str) {
        if self.meshes.takes_part(name) {
            self.look(time_s.next_down());
        }
    }

    /// Looks at the frames of meshes that were told up to a time.
    fn look(&mut self, time_s: f64) {
        if let Err(fault) = self.meshes.look(time_s) {
            self.wires.faults.tell(fault);
        }
        while let Some((event, is_cloth)) = self.meshes.event() {
            self.push(event, if is_cloth { self.delays.cloth_s } else { 0.0 });
        }
    }

    fn found(&self, found: Found) -> Event {
        let names = found.bodies().map(|body| self.bodies.get(body as usize).map_or("", |name| name));
        let [first_line, last_line] = found.lines();
        let rows = LogRows { log: "told".to_owned(), first_line, last_line };
        found.event(names, Cause::Log(rows))
    }
}

impl Iterator for Feed {
    type Item = Result<Event>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(next) = self.pending.first_entry().filter(|next| next.key().0.0 <= self.known_s) {
                return Some(Ok(next.remove()));
            }
            if self.known_s > self.passed_s {
                self.passed_s = self.known_s;
                return Some(Ok(Event::Quiet(self.known_s)));
            }
            match self.told.pop() {
                Ok(told) => {
                    self.taken += 1;
                    self.wires.rests.store(false, Release);
                    if let Err(fault) = self.take(told) {
                        return Some(Err(fault));
                    }
                }
                // What was told before it was stopped is in the ring by now.
                Err(_) if self.wires.stop.load(Acquire) && self.told.is_empty() => return None,
                Err(_) => {
                    self.wires.taken.store(self.taken, Release);
                    self.wires.rests.store(true, Release);
                    std::thread::park_timeout(NAP);
                }
            }
        }
    }
}
