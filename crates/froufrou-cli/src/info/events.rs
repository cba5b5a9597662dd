//! What is in an event file: how many events of which kind, between whom, when and how hard.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use froufrou::motion::event::{Event, Reader};
use froufrou::{Error, Result};
use serde::Serialize;

use super::sheet::{Sheet, number};
use super::{Findings, Range};

#[derive(Serialize)]
pub struct EventFindings {
    events: u64,
    kinds: BTreeMap<&'static str, u64>,
    /// In seconds.
    times_s: Option<Range>,
    impulses_ns: Option<Range>,
    /// How fast bodies slide along each other.
    slides_mps: Option<Range>,
    /// How fast they roll.
    rolls_mps: Option<Range>,
    /// The energy with which cloth buckles.
    buckles_mps: Option<Range>,
    /// How fast cloth slides along something.
    friction_mps: Option<Range>,
    /// Greatest count first.
    pairs: Vec<Pair>,
}

#[derive(Serialize)]
struct Pair {
    a: String,
    b: String,
    events: u64,
    impulses_ns: Option<Range>,
}

/// Reads events one by one, in the memory of their pairs of bodies.
pub fn read(file: &Path) -> Result<EventFindings> {
    let open = File::open(file).map_err(|fault| Error::io("open", file, fault))?;
    let mut found = EventFindings {
        events: 0,
        kinds: BTreeMap::new(),
        times_s: None,
        impulses_ns: None,
        slides_mps: None,
        rolls_mps: None,
        buckles_mps: None,
        friction_mps: None,
        pairs: Vec::new(),
    };
    let mut pairs: BTreeMap<(String, String), (u64, Option<Range>)> = BTreeMap::new();
    for event in Reader::new(BufReader::new(open), file) {
        let event = event?;
        found.events += 1;
        Range::widen(&mut found.times_s, event.time_s());
        match event {
            Event::Quiet(_) | Event::Change(_) => {}
            Event::Impact(impact) => {
                *found.kinds.entry("impact").or_default() += 1;
                Range::widen(&mut found.impulses_ns, impact.impulse_ns);
                let (count, impulses) = pairs.entry((impact.a, impact.b)).or_default();
                *count += 1;
                Range::widen(impulses, impact.impulse_ns);
            }
            Event::Slide(slide) => {
                *found.kinds.entry("moment of sliding").or_default() += 1;
                Range::widen(&mut found.slides_mps, slide.speed_mps);
                pairs.entry((slide.a, slide.b)).or_default().0 += 1;
            }
            Event::Roll(roll) => {
                *found.kinds.entry("moment of rolling").or_default() += 1;
                Range::widen(&mut found.rolls_mps, roll.speed_mps);
                pairs.entry((roll.a, roll.b)).or_default().0 += 1;
            }
            Event::Buckle(buckle) => {
                *found.kinds.entry("buckle").or_default() += 1;
                Range::widen(&mut found.buckles_mps, buckle.energy_mps);
                pairs.entry((buckle.cloth.clone(), buckle.cloth)).or_default().0 += 1;
            }
            Event::Flap(flap) => {
                *found.kinds.entry("moment of beating the air").or_default() += 1;
                pairs.entry((flap.cloth.clone(), flap.cloth)).or_default().0 += 1;
            }
            Event::Tear(tear) => {
                *found.kinds.entry("tear").or_default() += 1;
                pairs.entry((tear.sheet.clone(), tear.sheet)).or_default().0 += 1;
            }
            Event::Friction(friction) => {
                *found.kinds.entry("moment of friction").or_default() += 1;
                Range::widen(&mut found.friction_mps, friction.speed_mps);
                pairs.entry((friction.cloth, friction.other)).or_default().0 += 1;
            }
        }
    }
    found.pairs =
        pairs.into_iter().map(|((a, b), (events, impulses_ns))| Pair { a, b, events, impulses_ns }).collect();
    // Stable: pairs of the same count stay in the order of their names.
    found.pairs.sort_by_key(|pair| std::cmp::Reverse(pair.events));
    Ok(found)
}

impl Findings for EventFindings {
    const KIND: &'static str = "events";

    fn sheet(&self) -> Sheet {
        let mut sheet = Sheet::default();
        let range = |range: &Range| format!("{} to {}", number(range.from), number(range.to));
        let kinds: Vec<String> = self.kinds.iter().map(|(kind, count)| format!("{kind} {count}")).collect();
        sheet
            .fact("kind", "events")
            .fact("events", if kinds.is_empty() { "none".to_owned() } else { kinds.join(", ") })
            .fact_if("times", self.times_s.as_ref().map(|r| format!("{} s", range(r))))
            .fact_if("impulses", self.impulses_ns.as_ref().map(|r| format!("{} N s", range(r))))
            .fact_if("sliding", self.slides_mps.as_ref().map(|r| format!("{} m/s", range(r))))
            .fact_if("rolling", self.rolls_mps.as_ref().map(|r| format!("{} m/s", range(r))))
            .fact_if("buckles", self.buckles_mps.as_ref().map(|r| format!("{} m/s", range(r))))
            .fact_if("friction", self.friction_mps.as_ref().map(|r| format!("{} m/s", range(r))))
            .fact("pairs", self.pairs.len());
        let rows = self.pairs.iter().map(|pair| {
            let impulses = pair.impulses_ns.as_ref().map(range).unwrap_or_default();
            vec![pair.a.clone(), pair.b.clone(), pair.events.to_string(), impulses]
        });
        sheet.table(&["body", "other body", "events", "impulses (N s)"], rows);
        sheet
    }
}
