//! What an analyser finds, and the file of it: `events.jsonl`, one JSON object a line.

use std::fmt;
use std::io::{BufRead, Write};
use std::path::Path;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::rub::Rubbing;
use crate::Result;
use crate::json_lines::JsonLines;
use crate::scene::fed::Fed;

/// The longest line of an event file that is read, in bytes.
pub const LONGEST_LINE_BYTES: usize = 1 << 20;

/// Something that happened in the world and may be heard.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Event {
    /// Two bodies hit each other.
    Impact(Impact),
    /// Two bodies slide along each other for a moment.
    Slide(Rub),
    /// One body rolls along the other for a moment.
    Roll(Rub),
    /// A part of a cloth buckles.
    Buckle(Buckle),
    /// A cloth slides along something, or along itself, for a moment.
    Friction(Friction),
    /// A patch of a cloth is taut and beats the air for a moment.
    Flap(Flap),
    /// A sheet tears.
    Tear(Tear),
    /// Nothing more happens before this time, in seconds: told where events are told as they happen, never in a file.
    #[serde(skip)]
    Quiet(f64),
    /// An object appears, vanishes or becomes of something else: told as it happens, never in a file.
    #[serde(skip)]
    Change(Change),
}

/// What becomes of an object while others are told what happens.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// When, in seconds.
    pub time_s: f64,
    /// The object, by its name.
    pub name: String,
    /// What becomes of it.
    pub what: Becomes,
}

/// What an object becomes.
#[derive(Debug, Clone, PartialEq)]
pub enum Becomes {
    /// It is there from now on, and is as an object of the scene.
    There {
        /// The name of that.
        kind: String,
        /// Where it is.
        fed: Arc<Fed>,
    },
    /// It is no more.
    Gone,
    /// It is of this material from now on.
    Of(String),
}

/// A part of a sheet of paper that an event makes vibrate (Schreck et al. 2016, section 4): one flat or curved region,
/// cut off by ridges and by what is held or touched.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Resonator {
    /// The mean length of its rulings, l_r, in metres; of a flat region, which has none, the root of its area.
    pub ruling_m: f64,
    /// The total length of its free curved borders, l_c, in metres; 0 where it is constrained.
    pub border_m: f64,
    /// Its area, in square metres.
    pub area_m2: f64,
    /// Its centre, in metres.
    pub position_m: [f64; 3],
    /// Its mean normal, of length 1.
    pub normal: [f64; 3],
}

impl Resonator {
    /// Whether it has a free border: a crumpling is a *flap* then, and a *clac* where it has none.
    pub fn is_unconstrained(&self) -> bool {
        self.border_m > 0.0
    }

    fn numbers(&self) -> impl Iterator<Item = f64> + use<> {
        [self.ruling_m, self.border_m, self.area_m2].into_iter().chain(self.position_m).chain(self.normal)
    }
}

/// A sheet tears: what was one there is two, or has a hole.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tear {
    /// When, in seconds: the frame in which it is torn.
    pub time_s: f64,
    /// The sheet.
    pub sheet: String,
    /// The middle of what is torn, in metres.
    pub position_m: [f64; 3],
    /// How much further it is torn than in the frame before, in metres.
    pub length_m: f64,
    /// What it was told by.
    pub cause: Cause,
}

/// A part of a cloth buckles: its mean curvature changes sign.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Buckle {
    /// When, in seconds: the mean over its vertices.
    pub time_s: f64,
    /// How long it takes from its first vertex to its last, in seconds.
    pub lasts_s: f64,
    /// The cloth.
    pub cloth: String,
    /// Where its middle is, in metres.
    pub position_m: [f64; 3],
    /// The patch of the cloth that it is in, from 0.
    pub patch: u32,
    /// Where the middle of that is, in metres.
    pub patch_m: [f64; 3],
    /// Σ A·|dH/dt| over its vertices, in metres a second: how large it is, and how fast its curvature changes.
    pub energy_mps: f64,
    /// Whether its mean curvature goes from below 0 to above it: it becomes convex, seen from outside.
    pub positive: bool,
    /// How many vertices it has.
    pub vertices: u32,
    /// What it makes vibrate, where it is of paper.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub resonators: Vec<Resonator>,
    /// What it was told by.
    pub cause: Cause,
}

/// A cloth slides along something for a moment: all of its vertices that do, together. What goes on for longer is one
/// such event after the other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Friction {
    /// The beginning of the moment, in seconds: a frame.
    pub time_s: f64,
    /// How long it is until the next frame, in seconds.
    pub lasts_s: f64,
    /// The cloth.
    pub cloth: String,
    /// The patch of it that does, from 0.
    pub patch: u32,
    /// What it slides along; the cloth itself where it does so.
    pub other: String,
    /// The middle of what slides, weighted by area and speed, in metres.
    pub position_m: [f64; 3],
    /// The area that slides, in square metres. Where it is known how hard it presses, the area that would press as hard in
    /// the recordings of its corpus.
    pub area_m2: f64,
    /// How hard it presses, in newtons; where a simulation says it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force_n: Option<f64>,
    /// Its mean speed along the other, weighted by area, in metres a second.
    pub speed_mps: f64,
    /// How much slides how fast: speeds in metres a second, each with its area in square metres, from slow to fast.
    pub speeds: Vec<[f64; 2]>,
    /// What it makes vibrate, where it is of paper.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub resonators: Vec<Resonator>,
    /// What it was told by.
    pub cause: Cause,
}

/// A patch of a cloth is taut and beats the air for a moment. What goes on for longer is one such event after the other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Flap {
    /// The beginning of the moment, in seconds: a frame.
    pub time_s: f64,
    /// How long it is until the next frame, in seconds.
    pub lasts_s: f64,
    /// The cloth.
    pub cloth: String,
    /// The patch of it, from 0.
    pub patch: u32,
    /// The middle of that, in metres.
    pub position_m: [f64; 3],
    /// How taut it is, in newtons a metre.
    pub tension_n_per_m: f64,
    /// How fast it moves across its surface, the root mean square over its area, in metres a second.
    pub speed_mps: f64,
    /// How hard it snaps, in newton seconds, where it does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub impulse_ns: Option<f64>,
    /// What it was told by.
    pub cause: Cause,
}

/// Two bodies slide or roll along each other for a moment. What goes on for longer is one such event after
/// the other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rub {
    /// The middle of the moment, in seconds.
    pub time_s: f64,
    /// How long it is, in seconds.
    pub lasts_s: f64,
    /// One body; its name is not after that of `b`.
    pub a: String,
    /// The other.
    pub b: String,
    /// Where they touch, in metres.
    pub position_m: [f64; 3],
    /// Where that is on `a` and on `b`, each in the frame of the body, in metres; where their poses are known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub on_m: Option<[[f64; 3]; 2]>,
    /// In metres a second: of a slide the speed of their surfaces along each other, of a roll the speed at which
    /// the place where they touch moves along both.
    pub speed_mps: f64,
    /// How hard they press against each other, in newtons.
    pub force_n: f64,
    /// What it was told by.
    pub cause: Cause,
}

/// Two bodies hit each other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Impact {
    /// When, in seconds.
    pub time_s: f64,
    /// One body; its name is not after that of `b`.
    pub a: String,
    /// The other.
    pub b: String,
    /// Where, in metres.
    pub position_m: [f64; 3],
    /// Where that is on `a` and on `b`, each in the frame of the body, in metres; where their poses are known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub on_m: Option<[[f64; 3]; 2]>,
    /// The impulse they exchanged beyond that of their resting on each other, in newton seconds.
    pub impulse_ns: f64,
    /// The mean contact normal, of length 1, with the sign that the log gives it for a row that
    /// names `a` first; where the log has normals.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal: Option<[f64; 3]>,
    /// The greatest relative speed along the normal in metres a second; where the log has it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed_mps: Option<f64>,
    /// The relative speed across the normal at that moment, in metres a second; where it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tangential_mps: Option<f64>,
    /// What it was told by.
    pub cause: Cause,
}

/// What tells of an event.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "the `log` with its `first_line` and `last_line`, or the motion `from_s` and `to_s`"
)]
pub enum Cause {
    /// Rows of a contact log.
    Log(LogRows),
    /// How the bodies move.
    Motion(Moved),
}

/// The time in which the motion of two bodies tells of an event.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Moved {
    /// The time of the last frame before it, in seconds.
    pub from_s: f64,
    /// The time of the first frame after it, in seconds.
    pub to_s: f64,
}

/// The rows of a contact log that tell of an event.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LogRows {
    /// The log as the scene names it.
    pub log: String,
    /// The first line, from 1.
    pub first_line: u64,
    /// The last line; rows of other bodies may lie between.
    pub last_line: u64,
}

impl fmt::Display for Cause {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Cause::Log(LogRows { log, first_line, last_line }) => {
                write!(to, "{log}:{first_line}-{last_line}")
            }
            Cause::Motion(Moved { from_s, to_s }) => write!(to, "motion from {from_s:.4} to {to_s:.4} s"),
        }
    }
}

impl Cause {
    fn numbers(&self) -> impl Iterator<Item = f64> {
        let times = match self {
            Cause::Log(_) => [0.0; 2],
            Cause::Motion(Moved { from_s, to_s }) => [*from_s, *to_s],
        };
        times.into_iter()
    }
}

impl Event {
    /// The impact, if it is one.
    pub fn impact(&self) -> Option<&Impact> {
        match self {
            Event::Impact(impact) => Some(impact),
            _ => None,
        }
    }

    /// The buckle, if it is one.
    pub fn buckle(&self) -> Option<&Buckle> {
        match self {
            Event::Buckle(buckle) => Some(buckle),
            _ => None,
        }
    }

    /// The moment of friction, if it is one.
    pub fn friction(&self) -> Option<&Friction> {
        match self {
            Event::Friction(friction) => Some(friction),
            _ => None,
        }
    }

    /// The tear, if it is one.
    pub fn tear(&self) -> Option<&Tear> {
        match self {
            Event::Tear(tear) => Some(tear),
            _ => None,
        }
    }

    /// Two bodies that slide or roll along each other.
    pub fn rubbing(how: Rubbing, rub: Rub) -> Self {
        match how {
            Rubbing::Slide => Event::Slide(rub),
            Rubbing::Roll => Event::Roll(rub),
        }
    }

    /// How two bodies rub along each other, sliding or rolling, if they do.
    pub fn rub(&self) -> Option<(Rubbing, &Rub)> {
        match self {
            Event::Slide(rub) => Some((Rubbing::Slide, rub)),
            Event::Roll(rub) => Some((Rubbing::Roll, rub)),
            _ => None,
        }
    }

    /// The same at another time.
    #[must_use]
    pub fn at(mut self, time_s: f64) -> Self {
        *match &mut self {
            Event::Impact(impact) => &mut impact.time_s,
            Event::Slide(rub) | Event::Roll(rub) => &mut rub.time_s,
            Event::Buckle(buckle) => &mut buckle.time_s,
            Event::Friction(friction) => &mut friction.time_s,
            Event::Flap(flap) => &mut flap.time_s,
            Event::Tear(tear) => &mut tear.time_s,
            Event::Quiet(quiet_s) => quiet_s,
            Event::Change(change) => &mut change.time_s,
        } = time_s;
        self
    }

    /// When it happens, in seconds.
    pub fn time_s(&self) -> f64 {
        match self {
            Event::Impact(impact) => impact.time_s,
            Event::Slide(rub) | Event::Roll(rub) => rub.time_s,
            Event::Buckle(buckle) => buckle.time_s,
            Event::Friction(friction) => friction.time_s,
            Event::Flap(flap) => flap.time_s,
            Event::Tear(tear) => tear.time_s,
            Event::Quiet(time_s) => *time_s,
            Event::Change(change) => change.time_s,
        }
    }
}

/// Writes one event as a line.
///
/// # Errors
/// What the writer refuses. A number that is not finite has no place in JSON and is refused too.
pub fn write(to: &mut impl Write, event: &Event) -> std::io::Result<()> {
    let numbers: Vec<f64> = match event {
        Event::Impact(impact) => {
            let numbers = [impact.time_s, impact.impulse_ns].into_iter().chain(impact.position_m);
            let speeds = impact.speed_mps.into_iter().chain(impact.tangential_mps);
            let places =
                impact.on_m.into_iter().flatten().flatten().chain(impact.normal.into_iter().flatten());
            numbers.chain(speeds).chain(places).chain(impact.cause.numbers()).collect()
        }
        Event::Slide(rub) | Event::Roll(rub) => {
            let numbers = [rub.time_s, rub.lasts_s, rub.speed_mps, rub.force_n].into_iter();
            let places = rub.position_m.into_iter().chain(rub.on_m.into_iter().flatten().flatten());
            numbers.chain(places).chain(rub.cause.numbers()).collect()
        }
        Event::Flap(Flap {
            time_s,
            lasts_s,
            position_m,
            tension_n_per_m,
            speed_mps,
            impulse_ns,
            cause,
            ..
        }) => {
            let numbers = [*time_s, *lasts_s, *tension_n_per_m, *speed_mps].into_iter();
            numbers.chain(*impulse_ns).chain(*position_m).chain(cause.numbers()).collect()
        }
        Event::Buckle(Buckle {
            time_s, lasts_s, position_m, patch_m, energy_mps, resonators, cause, ..
        }) => {
            let numbers = [*time_s, *lasts_s, *energy_mps].into_iter();
            let numbers = numbers.chain(resonators.iter().flat_map(Resonator::numbers));
            numbers.chain(*patch_m).chain(*position_m).chain(cause.numbers()).collect()
        }
        Event::Quiet(_) | Event::Change(_) => return Ok(()),
        Event::Tear(Tear { time_s, position_m, length_m, cause, .. }) => {
            [*time_s, *length_m].into_iter().chain(*position_m).chain(cause.numbers()).collect()
        }
        Event::Friction(Friction {
            time_s,
            lasts_s,
            position_m,
            area_m2,
            force_n,
            speed_mps,
            speeds,
            resonators,
            cause,
            ..
        }) => {
            let numbers = [*time_s, *lasts_s, *area_m2, *speed_mps].into_iter().chain(*force_n);
            numbers
                .chain(speeds.iter().flatten().copied())
                .chain(resonators.iter().flat_map(Resonator::numbers))
                .chain(*position_m)
                .chain(cause.numbers())
                .collect()
        }
    };
    if !numbers.into_iter().all(f64::is_finite) {
        return Err(std::io::Error::other(format!("an event with a number that is not finite: {event:?}")));
    }
    serde_json::to_writer(&mut *to, event)?;
    to.write_all(b"\n")
}

/// Reads events line by line, in the memory of one line. It ends after its first error.
///
/// ```
/// use froufrou::motion::event::{Event, Reader};
/// let text = r#"{"kind":"impact","time_s":0.5,"a":"ball","b":"floor","position_m":[0,0,0],
/// "impulse_ns":0.1,"cause":{"log":"c.csv","first_line":2,"last_line":3}}"#.replace('\n', "");
/// let events: Vec<Event> = Reader::new(text.as_bytes(), "events.jsonl").collect::<Result<_, _>>()?;
/// assert_eq!(events[0].time_s(), 0.5);
/// # Ok::<(), froufrou::Error>(())
/// ```
#[derive(Debug)]
pub struct Reader<R>(JsonLines<R, Event>);

impl<R: BufRead> Reader<R> {
    /// Reads from anywhere; `file` is the name in messages.
    pub fn new(inner: R, file: impl AsRef<Path>) -> Self {
        Self(JsonLines::new(inner, file.as_ref(), "an event", LONGEST_LINE_BYTES))
    }
}

impl<R: BufRead> Iterator for Reader<R> {
    type Item = Result<Event>;

    fn next(&mut self) -> Option<Self::Item> {
        self.0.next()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn event(time_s: f64, impulse_ns: f64, name: &str, normal: Option<[f64; 3]>) -> Event {
        Event::Impact(Impact {
            time_s,
            a: name.to_owned(),
            b: "floor".to_owned(),
            position_m: [0.1 + 0.2, -1.0 / 3.0, 1e-300],
            impulse_ns,
            normal,
            speed_mps: normal.map(|n| n[0].abs()),
            on_m: normal.map(|n| [n, n.map(|c| c / 3.0)]),
            tangential_mps: normal.map(|n| n[1]),
            cause: if name.len().is_multiple_of(2) {
                Cause::Log(LogRows { log: "contacts.csv.gz".to_owned(), first_line: 2, last_line: u64::MAX })
            } else {
                Cause::Motion(Moved { from_s: time_s, to_s: impulse_ns })
            },
        })
    }

    fn fault(text: &str) -> String {
        let found: Result<Vec<Event>> = Reader::new(text.as_bytes(), "e.jsonl").collect();
        found.err().map(|e| e.to_string()).unwrap_or_default()
    }

    fn of_sheets(numbers: [f64; 8], name: &str) -> [Event; 3] {
        let [time_s, lasts_s, x, y, z, a, b, from_s] = numbers;
        // One of them names no resonators, which is how cloth is written.
        let resonator =
            Resonator { ruling_m: x, border_m: y, area_m2: z, position_m: [b; 3], normal: [x, y, a] };
        let resonators = vec![resonator; name.len() % 3];
        let cause = Cause::Motion(Moved { from_s, to_s: time_s });
        let buckle = Buckle {
            time_s,
            lasts_s,
            cloth: name.to_owned(),
            position_m: [x, y, z],
            patch: name.len() as u32,
            patch_m: [y, z, x],
            energy_mps: a,
            positive: a > b,
            vertices: name.len() as u32,
            resonators: resonators.clone(),
            cause: cause.clone(),
        };
        let friction = Friction {
            force_n: Some(1.5),
            time_s,
            lasts_s,
            cloth: "skirt".to_owned(),
            other: name.to_owned(),
            position_m: [z, x, y],
            area_m2: a,
            speed_mps: b,
            patch: name.len() as u32,
            speeds: vec![[b, a], [a, x]],
            resonators,
            cause: cause.clone(),
        };
        let tear = Tear {
            time_s,
            sheet: name.to_owned(),
            position_m: [y, x, z],
            length_m: a.min(b).min(lasts_s),
            cause,
        };
        [Event::Buckle(buckle), Event::Friction(friction), Event::Tear(tear)]
    }

    #[test]
    fn faults_name_the_line() -> std::io::Result<()> {
        let mut good = Vec::new();
        write(&mut good, &event(1.0, 2.0, "ball", None))?;
        let good = String::from_utf8(good).map_err(std::io::Error::other)?;
        assert!(fault(&format!("{good}\n{{")).starts_with("e.jsonl:3:1: not an event: EOF while parsing"));
        let unknown = good.replace("\"impulse_ns\"", "\"impulse\"");
        assert!(fault(&unknown).starts_with("e.jsonl:1:"), "{}", fault(&unknown));
        assert!(fault(&unknown).contains("unknown field `impulse`"), "{}", fault(&unknown));
        assert!(fault(&good.replace("impact", "crash")).contains("unknown variant `crash`"));
        assert!(fault(&"x".repeat(LONGEST_LINE_BYTES + 1)).contains("a line longer than"));
        assert!(write(&mut Vec::new(), &event(f64::NAN, 1.0, "x", None)).is_err());
        let place = good.replace("\"cause\":{", "\"cause\":{\"of\":1,");
        assert!(
            fault(&place).contains("expected the `log`") || fault(&place).contains("the `log` with"),
            "{}",
            fault(&place)
        );
        Ok(())
    }

    #[test]
    fn what_sheets_do_has_no_numbers_that_are_none() {
        for at in 0..8 {
            let mut numbers = [1.0; 8];
            numbers[at] = f64::NEG_INFINITY;
            for event in of_sheets(numbers, "xyz") {
                // Of a buckle the seventh number is its sign alone.
                let is_told = write(&mut Vec::new(), &event).is_ok();
                assert_eq!(is_told, at == 6 && matches!(event, Event::Buckle(_)), "{event:?}");
            }
        }
        let resonator =
            Resonator { ruling_m: 1.0, border_m: 1.0, area_m2: 1.0, position_m: [1.0; 3], normal: [1.0; 3] };
        let none = f64::NAN;
        for resonator in [
            Resonator { ruling_m: none, ..resonator },
            Resonator { border_m: none, ..resonator },
            Resonator { area_m2: none, ..resonator },
            Resonator { position_m: [1.0, none, 1.0], ..resonator },
            Resonator { normal: [1.0, 1.0, none], ..resonator },
        ] {
            for mut event in of_sheets([1.0; 8], "xyz") {
                match &mut event {
                    Event::Buckle(Buckle { resonators, .. })
                    | Event::Friction(Friction { resonators, .. }) => {
                        resonators.push(resonator);
                    }
                    _ => continue,
                }
                assert!(write(&mut Vec::new(), &event).is_err(), "{event:?}");
            }
        }
    }

    #[test]
    fn cloth_is_written_without_resonators() -> std::io::Result<()> {
        for event in of_sheets([1.0; 8], "xyz") {
            let mut bytes = Vec::new();
            write(&mut bytes, &event)?;
            assert!(!String::from_utf8_lossy(&bytes).contains("resonators"));
        }
        Ok(())
    }

    proptest! {
        #[test]
        fn what_sheets_do_comes_back_exactly(
            numbers in prop::array::uniform8(any::<f64>().prop_filter("finite", |x| x.is_finite())),
            name in any::<String>(),
        ) {
            let events = of_sheets(numbers, &name);
            let mut bytes = Vec::new();
            for event in &events {
                write(&mut bytes, event)?;
            }
            let back: Vec<Event> = Reader::new(bytes.as_slice(), "e.jsonl").collect::<Result<_>>()?;
            prop_assert_eq!(back, events);
        }

        #[test]
        fn every_number_and_name_comes_back_exactly(
            time_s in any::<f64>().prop_filter("finite", |x| x.is_finite()),
            impulse_ns in any::<f64>().prop_filter("finite", |x| x.is_finite()),
            name in any::<String>(),
            x in proptest::option::of(-1.0f64..1.0),
        ) {
            let event = event(time_s, impulse_ns, &name, x.map(|x| [x, 0.1, 0.2]));
            let mut bytes = Vec::new();
            write(&mut bytes, &event)?;
            prop_assert_eq!(bytes.iter().filter(|b| **b == b'\n').count(), 1);
            let back: Vec<Event> = Reader::new(bytes.as_slice(), "e.jsonl").collect::<Result<_>>()?;
            prop_assert_eq!(back, vec![event]);
        }
    }
}
