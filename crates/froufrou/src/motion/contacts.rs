//! What happens in a contact log: its impacts, slides and rolls, in order of time.

use super::body::BodyState;
use super::event::{Cause, Event, LogRows};
use super::impact::{Settings, Step};
use super::lives::{Found, Lives};
use crate::scene::contact_log::{ContactLog, ContactRow, step_of_times};
use crate::scene::file::Contacts;
use crate::scene::world::{Carrier, RigidBodies};
use crate::{Error, Place, Result};

/// How many rows at the beginning of a log tell its step.
const ROWS_FOR_STEP: usize = 100_000;
/// The slowest simulation that is believed without being told: a tenth of a second a step.
const LONGEST_STEP_S: f64 = 0.1;

/// What happens in a contact log, in order of time. It ends after its first error.
pub struct LogEvents {
    log: ContactLog,
    name: String,
    lives: Lives,
    poses: Poses,
    over: bool,
}

/// How the bodies of a log move, by their numbers there.
struct Poses {
    bodies: RigidBodies,
    /// What carries each body that was met, and its state at the time that was last asked for.
    met: Vec<Option<Posed>>,
}

struct Posed {
    carrier: Carrier,
    time_s: f64,
    state: Option<BodyState>,
}

impl Poses {
    /// Looks for the bodies that a log has named anew.
    fn meet(&mut self, log: &ContactLog) {
        for name in &log.bodies()[self.met.len()..] {
            let carrier = self.bodies.carrier(name).cloned();
            self.met.push(carrier.map(|carrier| Posed { carrier, time_s: f64::NAN, state: None }));
        }
    }

    fn state(&mut self, body: u32, time_s: f64) -> Result<Option<BodyState>> {
        let Some(Some(posed)) = self.met.get_mut(body as usize) else { return Ok(None) };
        if posed.time_s != time_s {
            posed.state = posed.carrier.state(time_s)?;
            posed.time_s = time_s;
        }
        Ok(posed.state)
    }

    /// How two bodies moved at their last samples before a time; nothing where neither is known.
    fn before(&self, bodies: [u32; 2], time_s: f64) -> Result<Option<[BodyState; 2]>> {
        let mut found = [None; 2];
        for (state, body) in found.iter_mut().zip(bodies) {
            let Some(Some(posed)) = self.met.get(body as usize) else { continue };
            let Some(sample_s) = posed.carrier.sample_before_s(time_s) else { continue };
            *state = posed.carrier.state(sample_s)?;
        }
        let known = found != [None; 2];
        Ok(known.then(|| found.map(|state| state.unwrap_or(BodyState::STILL))))
    }
}

impl LogEvents {
    /// Opens a log, whose bodies move as those of a scene do, as far as it has them. Where the scene does not say the
    /// length of the simulation's step, the beginning of the log is read twice to find it.
    ///
    /// # Errors
    /// A log that cannot be read, or whose step cannot be told.
    pub fn open(contacts: &Contacts, bodies: RigidBodies) -> Result<Self> {
        let step = match contacts.step_s {
            Some(step_s) => Step::Fixed(step_s),
            None => Step::Stamped(find_step(contacts)?),
        };
        Ok(Self {
            log: ContactLog::open(&contacts.log.path, &contacts.columns)?,
            name: contacts.log.name.clone(),
            lives: Lives::new(Settings::new(step)),
            poses: Poses { bodies, met: Vec::new() },
            over: false,
        })
    }

    /// What counts as an impact here.
    pub fn settings(&self) -> &Settings {
        self.lives.settings()
    }

    fn event(&self, mut found: Found) -> Result<Event> {
        if let Found::Blow(blow) = &mut found
            && let Some(before) = self.poses.before(blow.bodies, blow.time_s - self.step_s())?
        {
            blow.approach(before);
        }
        let names = found.bodies().map(|body| self.log.bodies().get(body as usize).map_or("", |name| name));
        let [first_line, last_line] = found.lines();
        Ok(found.event(names, Cause::Log(LogRows { log: self.name.clone(), first_line, last_line })))
    }

    fn step_s(&self) -> f64 {
        let (Step::Fixed(step_s) | Step::Stamped(step_s)) = self.settings().step;
        step_s
    }

    fn feed(&mut self, row: &ContactRow) -> Result<()> {
        self.poses.meet(&self.log);
        let states = [self.poses.state(row.a, row.time_s)?, self.poses.state(row.b, row.time_s)?];
        self.lives.feed(row, states)
    }
}

impl Iterator for LogEvents {
    type Item = Result<Event>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(found) = self.lives.pop() {
                return Some(self.event(found));
            }
            if self.over {
                return None;
            }
            let fed = match self.log.next() {
                Some(row) => row.and_then(|row| self.feed(&row)),
                None => {
                    self.over = true;
                    self.lives.finish();
                    Ok(())
                }
            };
            if let Err(fault) = fed {
                self.over = true;
                return Some(Err(fault));
            }
        }
    }
}

/// The length of a log's step in seconds, from its beginning.
fn find_step(contacts: &Contacts) -> Result<f64> {
    let mut rows = 0;
    let mut times = Vec::new();
    for row in ContactLog::open(&contacts.log.path, &contacts.columns)?.take(ROWS_FOR_STEP) {
        let row = row?;
        rows += 1;
        if times.last() != Some(&row.time_s) {
            times.push(row.time_s);
        }
    }
    let fail = |what: String| {
        Err(Error::new(what)
            .in_file(contacts.log.path.clone())
            .at(Place::Part("time stamps".to_owned()))
            .help("say the length of the simulation's step with `step` in the scene's `[[contacts]]`"))
    };
    match step_of_times(times) {
        Some(step_s) if step_s <= LONGEST_STEP_S => Ok(step_s),
        Some(step_s) => fail(format!("no two are closer than {step_s} s: cannot tell the step from them")),
        // Without rows there is nothing to be wrong about.
        None if rows == 0 => Ok(LONGEST_STEP_S),
        None => fail("they are all the same: cannot tell the step from them".to_owned()),
    }
}
