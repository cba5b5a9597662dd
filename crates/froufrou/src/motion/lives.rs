//! The life of contacts: impacts, slides and rolls of all pairs of bodies, in order of time, whoever tells of
//! their contacts.

use glam::DVec3;

use super::body::BodyState;
use super::event::{Cause, Event, Impact, Rub};
use super::impact::{self, Blow, Settings};
use super::slide::{self, Rubbed};
use crate::Result;
use crate::scene::contact_log::ContactRow;

/// What was found about two bodies that are known by number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Found {
    /// They hit each other.
    Blow(Blow),
    /// They slide or roll along each other for a moment.
    Rubbed(Rubbed),
}

impl Found {
    /// When, in seconds.
    pub fn time_s(&self) -> f64 {
        match self {
            Found::Blow(blow) => blow.time_s,
            Found::Rubbed(rubbed) => rubbed.time_s,
        }
    }

    /// The bodies, the smaller number first.
    pub fn bodies(&self) -> [u32; 2] {
        match self {
            Found::Blow(blow) => blow.bodies,
            Found::Rubbed(rubbed) => rubbed.bodies,
        }
    }

    /// The lines of a log that tell of it, first and last.
    pub fn lines(&self) -> [u64; 2] {
        match self {
            Found::Blow(blow) => blow.lines,
            Found::Rubbed(rubbed) => rubbed.lines,
        }
    }

    /// The same as an event, with the names of the bodies in the order of [`Found::bodies`]. An event names the
    /// lesser name first, for numbers depend on who is met first.
    pub fn event(self, [a, b]: [&str; 2], cause: Cause) -> Event {
        let swapped = a > b;
        let (a, b) = if swapped { (b.to_owned(), a.to_owned()) } else { (a.to_owned(), b.to_owned()) };
        let in_order = |on: [[f64; 3]; 2]| if swapped { [on[1], on[0]] } else { on };
        match self {
            Found::Blow(blow) => Event::Impact(Impact {
                time_s: blow.time_s,
                a,
                b,
                position_m: blow.position_m,
                on_m: blow.on_m.map(in_order),
                impulse_ns: blow.impulse_ns,
                normal: blow.normal.map(|n| if swapped { n.map(|c| -c) } else { n }),
                speed_mps: blow.speed_mps,
                tangential_mps: blow.sliding_mps,
                cause,
            }),
            Found::Rubbed(found) => {
                let rub = Rub {
                    time_s: found.time_s,
                    lasts_s: found.lasts_s,
                    a,
                    b,
                    position_m: found.position_m,
                    on_m: found.on_m.map(in_order),
                    speed_mps: found.speed_mps,
                    force_n: found.force_n,
                    cause,
                };
                Event::rubbing(found.how, rub)
            }
        }
    }
}

impl Blow {
    /// Takes the speeds at which the bodies came together from how they moved shortly before, where that is
    /// more than the contacts told: what is logged after a step has lost most of it.
    pub fn approach(&mut self, before: [BodyState; 2]) {
        let (Some(normal), Some(arms_m)) = (self.normal.map(DVec3::from), self.arms_m) else { return };
        let velocity = |body: usize| {
            let turn = DVec3::from(before[body].angular_velocity_rps);
            DVec3::from(before[body].velocity_mps) + turn.cross(arms_m[body].into())
        };
        let (a, b) = (velocity(0), velocity(1));
        let speed = |told: Option<f64>, moved: f64| Some(told.map_or(moved, |told| told.max(moved)));
        self.speed_mps = speed(self.speed_mps, (a - b).dot(normal).abs());
        self.sliding_mps = speed(self.sliding_mps, (a - b).reject_from(normal).length());
    }
}

/// A contact point of a step of a simulation that runs, and what is known of its two bodies.
#[derive(Debug, Clone, PartialEq)]
pub struct Touch {
    /// What the step says of it. Its velocities are those with which they came into the step.
    pub row: ContactRow,
    /// How the bodies of the row move behind the step, as far as that is known: who is not known stands still if the other
    /// one is.
    pub states: [Option<BodyState>; 2],
    /// When in its step they touch, in seconds, where that is known.
    pub at_s: Option<f64>,
}

impl From<ContactRow> for Touch {
    /// Nothing else is known.
    fn from(row: ContactRow) -> Self {
        Self { row, states: [None; 2], at_s: None }
    }
}

/// Rows of contacts in, what they tell of out.
#[derive(Debug)]
pub struct Lives {
    impacts: impact::Analyser,
    rubs: slide::Analyser,
    /// The blow that comes next, held back until no slide can come before it.
    blow: Option<Blow>,
    over: bool,
}

impl Lives {
    /// Begins with nothing known.
    pub fn new(settings: Settings) -> Self {
        Self {
            impacts: impact::Analyser::new(settings),
            rubs: slide::Analyser::new(settings.step),
            blow: None,
            over: false,
        }
    }

    /// What counts as an impact here.
    pub fn settings(&self) -> &Settings {
        self.impacts.settings()
    }

    /// Takes the next row, and how its two bodies move as far as that is known; see
    /// [`slide::Analyser::feed`].
    ///
    /// # Errors
    /// A row that is earlier than the one before it.
    pub fn feed(&mut self, row: &ContactRow, states: [Option<BodyState>; 2]) -> Result<()> {
        self.feed_impact(row, states, None)?;
        self.feed_rub(row, states)
    }

    /// Takes the next contact point of a simulation that runs.
    ///
    /// # Errors
    /// As [`Lives::feed`].
    pub fn touch(&mut self, touch: &Touch) -> Result<()> {
        let Touch { row, states, at_s } = touch;
        self.feed_impact(row, *states, *at_s)?;
        if *states == [None; 2] {
            return self.feed_rub(row, *states);
        }
        // How they slide now follows from how they move now.
        self.feed_rub(&ContactRow { sliding_mps: None, ..row.clone() }, *states)
    }

    /// Takes a row that tells of impacts alone, and when in its step it acts, where that is known.
    ///
    /// # Errors
    /// As [`Lives::feed`].
    pub fn feed_impact(
        &mut self,
        row: &ContactRow,
        states: [Option<BodyState>; 2],
        at_s: Option<f64>,
    ) -> Result<()> {
        self.rubs.advance(row.time_s);
        self.impacts.feed_at(row, states, at_s)
    }

    /// Takes a row that tells of sliding and rolling alone.
    ///
    /// # Errors
    /// As [`Lives::feed`].
    pub fn feed_rub(&mut self, row: &ContactRow, states: [Option<BodyState>; 2]) -> Result<()> {
        self.impacts.advance(row.time_s)?;
        self.rubs.feed(row, states);
        Ok(())
    }

    /// Says that time has come this far, for worlds in which nothing may touch for long.
    ///
    /// # Errors
    /// A time that is earlier than the one before it.
    pub fn advance(&mut self, time_s: f64) -> Result<()> {
        self.rubs.advance(time_s);
        self.impacts.advance(time_s)
    }

    /// Says that time has come this far, and that all rows up to then, and of then, were told.
    ///
    /// # Errors
    /// As [`Lives::advance`].
    pub fn complete(&mut self, time_s: f64) -> Result<()> {
        self.rubs.complete(time_s);
        self.impacts.complete(time_s)
    }

    /// The next impact that was found, for who does not need to know what rubs before it: instead of [`Lives::pop`].
    pub fn next_blow(&mut self) -> Option<Blow> {
        self.impacts.next_blow()
    }

    /// The next moment that was found in which something slides or rolls, likewise.
    pub fn next_rubbed(&mut self) -> Option<Rubbed> {
        self.rubs.pop()
    }

    /// By how long what slides and rolls is told later than it happens, at most, in seconds, where all rows of a time are
    /// told [together](Lives::complete).
    pub fn rubs_behind_s(&self) -> f64 {
        let (impact::Step::Fixed(step_s) | impact::Step::Stamped(step_s)) = self.settings().step;
        // The middle of a moment, the one behind it, and what of a step lies beyond its end.
        1.5 * self.rubs.moment_s() + step_s
    }

    /// Says that nothing follows.
    pub fn finish(&mut self) {
        self.over = true;
        self.rubs.finish();
        self.impacts.finish();
    }

    /// Nothing is still to be found that happens before this, in seconds.
    pub fn settled_s(&self) -> f64 {
        let found_s = self.blow.map_or(f64::INFINITY, |blow| blow.time_s);
        found_s.min(self.impacts.settled_s()).min(self.rubs.settled_s())
    }

    /// The next that was found, in order of time, if nothing can come before it any more.
    pub fn pop(&mut self) -> Option<Found> {
        if self.blow.is_none() {
            self.blow = self.impacts.next_blow();
        }
        let blow_s = self.blow.map_or(f64::INFINITY, |blow| blow.time_s);
        let rubbed_s = self.rubs.next_s().unwrap_or(f64::INFINITY);
        if rubbed_s <= blow_s.min(self.impacts.settled_s()) {
            return self.rubs.pop().map(Found::Rubbed);
        }
        // What rubs now is told at the end of its moment.
        if blow_s < rubbed_s.min(self.rubs.settled_s()) || self.over {
            return self.blow.take().map(Found::Blow);
        }
        None
    }
}
