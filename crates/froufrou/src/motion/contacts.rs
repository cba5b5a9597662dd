//! What happens in a contact log: its impacts, slides and rolls, in order of time.

use std::sync::Arc;

use super::body::BodyState;
use super::event::{Cause, Event, LogRows};
use super::impact::{Settings, Step};
use super::lives::{Found, Lives};
use super::momentum::{Momentum, Survey};
use crate::scene::carrier::Carrier;
use crate::scene::contact_log::{ContactLog, ContactRow, step_of_times};
use crate::scene::file::Contacts;
use crate::scene::world::RigidBodies;
use crate::{Error, Place, Result};

/// How many rows at the beginning of a log tell its step.
const ROWS_FOR_STEP: usize = 100_000;
/// The slowest simulation that is believed without being told: a tenth of a second a step.
const LONGEST_STEP_S: f64 = 0.1;
/// Where nobody says the step, rows that are further apart than this, in seconds, are a part of a simulation's alone: it
/// would hardly stand at so long a step.
const THINNED_S: f64 = 1.0 / 130.0;

/// What happens in a contact log, in order of time. It ends after its first error.
pub struct LogEvents {
    log: ContactLog,
    name: String,
    lives: Lives,
    poses: Poses,
    /// Where the log has not all steps of its simulation.
    thinned: Option<Thinned>,
    over: bool,
}

/// A log that is taken frame by frame, with what lies between them.
struct Thinned {
    momentum: Momentum,
    spacing_s: f64,
    time_s: f64,
    rows: Vec<ContactRow>,
}

/// How the bodies of a log move, by their numbers there.
#[derive(Default)]
pub(super) struct Poses {
    bodies: RigidBodies,
    /// What carries each body that was met, and its state at the time that was last asked for.
    met: Vec<Option<Posed>>,
    /// Their names, also of those whom a thinned log has not named yet when they do something.
    names: Vec<Arc<str>>,
}

struct Posed {
    carrier: Carrier,
    mass_kg: Option<f64>,
    time_s: f64,
    state: Option<BodyState>,
}

impl Poses {
    /// Looks for the bodies that a log has named anew.
    pub(super) fn meet(&mut self, log: &ContactLog) {
        for name in log.bodies().iter().skip(self.met.len()) {
            let carrier = self.bodies.carrier(name).cloned();
            let mass_kg = self.bodies.mass_kg(name);
            self.names.push(name.clone());
            self.met.push(carrier.map(|carrier| Posed { carrier, mass_kg, time_s: f64::NAN, state: None }));
        }
    }

    pub(super) fn state(&mut self, body: u32, time_s: f64) -> Result<Option<BodyState>> {
        let Some(Some(posed)) = self.met.get_mut(body as usize) else { return Ok(None) };
        if posed.time_s != time_s {
            posed.state = posed.carrier.state(time_s)?;
            posed.time_s = time_s;
        }
        Ok(posed.state)
    }

    /// The state of a body at any time, while that of the time last asked for is kept.
    pub(super) fn fresh_state(&self, body: u32, time_s: f64) -> Result<Option<BodyState>> {
        let Some(Some(posed)) = self.met.get(body as usize) else { return Ok(None) };
        posed.carrier.state(time_s)
    }

    /// The mass that the scene gives a body.
    pub(super) fn mass_kg(&self, body: usize) -> Option<f64> {
        self.met.get(body)?.as_ref()?.mass_kg
    }

    /// Whether the file of a body states how fast it moves.
    pub(super) fn states_velocity(&self, body: usize) -> bool {
        let posed = self.met.get(body).and_then(Option::as_ref);
        posed.is_some_and(|posed| posed.carrier.states_velocity())
    }

    /// The first sample of any body after a time.
    fn next_sample_s(&self, time_s: f64) -> Option<f64> {
        let times = self.met.iter().flatten().filter_map(|posed| posed.carrier.next_key_s(time_s));
        times.min_by(f64::total_cmp)
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
        let mut step = match contacts.step_s {
            Some(step_s) => Step::Fixed(step_s),
            None => Step::Stamped(find_step(contacts)?),
        };
        let mut poses = Poses { bodies, ..Poses::default() };
        let thinned = thinned(contacts, step, &mut poses)?;
        if let Some(thinned) = &thinned {
            step = Step::Stamped(thinned.spacing_s);
        }
        Ok(Self {
            log: ContactLog::open(&contacts.log.path, &contacts.columns)?,
            name: contacts.log.name.clone(),
            lives: Lives::new(Settings::new(step)),
            poses,
            thinned,
            over: false,
        })
    }

    /// Whether the log has not all steps of its simulation, so that momentum tells what happens between them.
    pub fn is_thinned(&self) -> bool {
        self.thinned.is_some()
    }

    /// What counts as an impact here.
    pub fn settings(&self) -> &Settings {
        self.lives.settings()
    }

    fn event(&self, mut found: Found) -> Result<Event> {
        if let Found::Blow(blow) = &mut found
            && let Some(before) = self.poses.before(blow.bodies, blow.time_s - self.blurred_s())?
        {
            blow.approach(before);
        }
        let names = found.bodies().map(|body| self.poses.names.get(body as usize).map_or("", |name| name));
        let [first_line, last_line] = found.lines();
        Ok(found.event(names, Cause::Log(LogRows { log: self.name.clone(), first_line, last_line })))
    }

    /// So long before the time of a blow it may have begun.
    fn blurred_s(&self) -> f64 {
        match (self.settings().step, &self.thinned) {
            (_, Some(_)) => 0.0,
            (Step::Fixed(step_s) | Step::Stamped(step_s), None) => step_s,
        }
    }

    fn feed(&mut self, row: ContactRow) -> Result<()> {
        self.poses.meet(&self.log);
        if let Some(thinned) = &mut self.thinned {
            if thinned.rows.is_empty() && row.time_s < thinned.time_s {
                thinned.time_s = row.time_s;
            }
            if row.time_s > thinned.time_s {
                thinned.end_frame(&mut self.lives, &mut self.poses)?;
                thinned.skip_to(row.time_s, &mut self.lives, &mut self.poses)?;
                thinned.time_s = row.time_s;
            }
            thinned.rows.push(row);
            return Ok(());
        }
        let states = [self.poses.state(row.a, row.time_s)?, self.poses.state(row.b, row.time_s)?];
        self.lives.feed(&row, states)
    }

    fn finish(&mut self) -> Result<()> {
        self.over = true;
        if let Some(thinned) = &mut self.thinned {
            thinned.end_frame(&mut self.lives, &mut self.poses)?;
            thinned.skip_to(f64::INFINITY, &mut self.lives, &mut self.poses)?;
        }
        self.lives.finish();
        Ok(())
    }
}

impl Thinned {
    /// Tells what happened up to a frame, all of whose rows are there.
    fn end_frame(&mut self, lives: &mut Lives, poses: &mut Poses) -> Result<()> {
        lives.advance(self.time_s)?;
        for impulse in self.momentum.frame(self.time_s, &self.rows, poses)? {
            let [a, b] = [impulse.row.a, impulse.row.b];
            let states = [poses.fresh_state(a, impulse.point_s)?, poses.fresh_state(b, impulse.point_s)?];
            lives.feed_impact(&impulse.row, states, impulse.at_s)?;
        }
        for row in self.rows.drain(..) {
            let states = [poses.state(row.a, row.time_s)?, poses.state(row.b, row.time_s)?];
            if self.momentum.knows(&row) {
                lives.feed_rub(&self.momentum.weighted(&row), states)?;
            } else {
                lives.feed(&row, states)?;
            }
        }
        Ok(())
    }

    /// Goes on through frames in which nothing touches.
    fn skip_to(&mut self, time_s: f64, lives: &mut Lives, poses: &mut Poses) -> Result<()> {
        while time_s - self.time_s > 1.5 * self.spacing_s {
            // Where nothing moves there is nothing to tell.
            let Some(sample_s) = poses.next_sample_s(self.time_s) else { break };
            let next_s = (self.time_s + self.spacing_s).max(sample_s);
            // Times beyond the reach of numbers would never go on.
            if next_s >= time_s || next_s <= self.time_s {
                break;
            }
            self.time_s = next_s;
            self.end_frame(lives, poses)?;
        }
        Ok(())
    }
}

/// Whether a log is thinned, and what it tells as a whole.
fn thinned(contacts: &Contacts, step: Step, poses: &mut Poses) -> Result<Option<Thinned>> {
    if poses.bodies.is_empty() || contacts.columns.normal.is_none() {
        return Ok(None);
    }
    let (spacing_s, longest_s) = match step {
        // A log of a single step has no spacing.
        Step::Fixed(step_s) => (find_step(contacts).unwrap_or(step_s), 1.5 * step_s),
        Step::Stamped(step_s) => (step_s, THINNED_S),
    };
    if spacing_s <= longest_s {
        return Ok(None);
    }
    let survey = Survey::of(contacts, poses, spacing_s)?;
    if !survey.knows_a_mass() {
        return Ok(None);
    }
    let momentum = Momentum::new(survey, contacts, spacing_s);
    let time_s = poses.next_sample_s(f64::MIN).unwrap_or(f64::MAX);
    Ok(Some(Thinned { momentum, spacing_s, time_s, rows: Vec::new() }))
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
                Some(row) => row.and_then(|row| self.feed(row)),
                None => self.finish(),
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
