//! What a handle tells, as events of a scene in order of time.

use std::sync::Arc;
use std::sync::atomic::Ordering::{Acquire, Release};
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::time::Duration;

use rtrb::Consumer;

use super::handle::MoverId;
use crate::Result;
use crate::motion::event::{Cause, Event, LogRows};
use crate::motion::impact::{Settings, Step};
use crate::motion::lives::{Lives, Touch};
use crate::scene::fed::{Fed, FedPose};

/// What a handle tells.
#[allow(clippy::large_enum_variant)] // Contacts are most of it, and a game thread takes no memory for them.
pub(super) enum Told {
    /// The next body has this name.
    Body(Arc<str>),
    Contact(Touch),
    Pose(MoverId, f64, FedPose),
    /// All that happens before has been told.
    Advance(f64),
}

/// So long the worker sleeps at most where nothing is told.
const NAP: Duration = Duration::from_micros(500);

/// The events of what is told. An iterator that waits until there is one, or until it is known that there is none before
/// a time; it ends when it is stopped.
pub(super) struct Feed {
    told: Consumer<Told>,
    names: Vec<Arc<str>>,
    lives: Lives,
    step_s: f64,
    movers: Vec<Arc<Fed>>,
    /// What was told last to be known, and what of it has been passed on.
    known_s: f64,
    passed_s: f64,
    stop: Arc<AtomicBool>,
    /// How much was taken of what was told, known to the handle once there is no more.
    taken: Arc<AtomicU64>,
    count: u64,
}

impl Feed {
    pub fn new(
        told: Consumer<Told>,
        step_s: f64,
        movers: Vec<Arc<Fed>>,
        stop: Arc<AtomicBool>,
        taken: Arc<AtomicU64>,
    ) -> Self {
        let (lives, names) = (Lives::new(Settings::new(Step::Fixed(step_s))), Vec::new());
        let (known_s, passed_s, count) = (0.0, 0.0, 0);
        Self { told, names, lives, step_s, movers, known_s, passed_s, stop, taken, count }
    }

    fn take(&mut self, told: Told) -> Result<()> {
        match told {
            Told::Body(name) => self.names.push(name),
            Told::Contact(touch) => {
                // Within its step, whoever told it.
                let end_s = touch.row.time_s;
                let at_s = touch.at_s.map(|at_s| at_s.clamp(end_s - self.step_s, end_s));
                self.lives.touch(&Touch { at_s, ..touch })?;
            }
            Told::Pose(mover, time_s, pose) => {
                if let Some(fed) = self.movers.get(mover.0) {
                    fed.push(time_s, pose);
                }
            }
            Told::Advance(time_s) => {
                self.lives.advance(time_s)?;
                self.movers.iter().for_each(|fed| fed.stand(time_s));
                self.known_s = time_s;
            }
        }
        Ok(())
    }
}

impl Iterator for Feed {
    type Item = Result<Event>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(found) = self.lives.pop() {
                let names = found.bodies().map(|body| self.names.get(body as usize).map_or("", |name| name));
                let [first_line, last_line] = found.lines();
                let rows = LogRows { log: "told".to_owned(), first_line, last_line };
                return Some(Ok(found.event(names, Cause::Log(rows))));
            }
            let quiet_s = self.known_s.min(self.lives.settled_s());
            if quiet_s > self.passed_s {
                self.passed_s = quiet_s;
                return Some(Ok(Event::Quiet(quiet_s)));
            }
            match self.told.pop() {
                Ok(told) => {
                    self.count += 1;
                    if let Err(fault) = self.take(told) {
                        return Some(Err(fault));
                    }
                }
                Err(_) if self.stop.load(Acquire) => return None,
                Err(_) => {
                    self.taken.store(self.count, Release);
                    std::thread::park_timeout(NAP);
                }
            }
        }
    }
}
