//! What happens in a contact log: its impacts and slides, in order of time.

use super::event::{Cause, Event, Impact, LogRows, Rub};
use super::impact::{Analyser, Blow, Settings, Step};
use super::slide;
use crate::scene::contact_log::{ContactLog, step_of_times};
use crate::scene::file::Contacts;
use crate::{Error, Place, Result};

/// How many rows at the beginning of a log tell its step.
const ROWS_FOR_STEP: usize = 100_000;
/// The slowest simulation that is believed without being told: a tenth of a second a step.
const LONGEST_STEP_S: f64 = 0.1;

/// What happens in a contact log, in order of time. It ends after its first error.
#[derive(Debug)]
pub struct LogEvents {
    log: ContactLog,
    name: String,
    impacts: Analyser,
    slides: slide::Analyser,
    /// The blow that comes next, held back until no slide can come before it.
    blow: Option<Blow>,
    over: bool,
}

impl LogEvents {
    /// Opens a log. Where the scene does not say the length of the simulation's step, the beginning
    /// of the log is read twice to find it.
    ///
    /// # Errors
    /// A log that cannot be read, or whose step cannot be told.
    pub fn open(contacts: &Contacts) -> Result<Self> {
        let step = match contacts.step_s {
            Some(step_s) => Step::Fixed(step_s),
            None => Step::Stamped(find_step(contacts)?),
        };
        Ok(Self {
            log: ContactLog::open(&contacts.log.path, &contacts.columns)?,
            name: contacts.log.name.clone(),
            impacts: Analyser::new(Settings::new(step)),
            slides: slide::Analyser::new(step),
            blow: None,
            over: false,
        })
    }

    /// What counts as an impact here.
    pub fn settings(&self) -> &Settings {
        self.impacts.settings()
    }

    /// Two bodies by name and not by number, for numbers depend on who is met first; and the sign of a
    /// normal in this order.
    fn names(&self, bodies: [u32; 2]) -> (String, String, f64) {
        let name = |body: u32| self.log.bodies().get(body as usize).map_or("", |name| name).to_owned();
        let [a, b] = bodies.map(name);
        if a <= b { (a, b, 1.0) } else { (b, a, -1.0) }
    }

    fn cause(&self, [first_line, last_line]: [u64; 2]) -> Cause {
        Cause::Log(LogRows { log: self.name.clone(), first_line, last_line })
    }

    fn impact(&self, blow: Blow) -> Event {
        let (a, b, sign) = self.names(blow.bodies);
        Event::Impact(Impact {
            time_s: blow.time_s,
            a,
            b,
            position_m: blow.position_m,
            on_m: None,
            impulse_ns: blow.impulse_ns,
            normal: blow.normal.map(|n| n.map(|c| c * sign)),
            speed_mps: blow.speed_mps,
            tangential_mps: None,
            cause: self.cause(blow.lines),
        })
    }

    fn slide(&self, found: slide::Sliding) -> Event {
        let (a, b, _) = self.names(found.bodies);
        Event::Slide(Rub {
            time_s: found.time_s,
            lasts_s: found.lasts_s,
            a,
            b,
            position_m: found.position_m,
            on_m: None,
            speed_mps: found.speed_mps,
            force_n: found.force_n,
            cause: self.cause(found.lines),
        })
    }

    /// The next event, if nothing can come before it any more.
    fn settled(&mut self) -> Option<Event> {
        if self.blow.is_none() {
            self.blow = self.impacts.next_blow();
        }
        let blow_s = self.blow.map_or(f64::INFINITY, |blow| blow.time_s);
        let slide_s = self.slides.next_s().unwrap_or(f64::INFINITY);
        if slide_s <= blow_s.min(self.impacts.settled_s()) {
            return self.slides.pop().map(|found| self.slide(found));
        }
        // What slides now is told at the end of its moment.
        if blow_s < slide_s.min(self.slides.settled_s()) || self.over {
            return self.blow.take().map(|blow| self.impact(blow));
        }
        None
    }
}

impl Iterator for LogEvents {
    type Item = Result<Event>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(event) = self.settled() {
                return Some(Ok(event));
            }
            if self.over {
                return None;
            }
            let fed = match self.log.next() {
                Some(row) => row.and_then(|row| {
                    self.slides.feed(&row);
                    self.impacts.feed(&row)
                }),
                None => {
                    self.over = true;
                    self.slides.finish();
                    self.impacts.finish();
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
