//! What is in a file of a head: how many directions were measured, at which rate, and what the head does.

use std::path::Path;

use froufrou::Result;
use froufrou::space::head::Measured;
use serde::Serialize;

use super::Findings;
use super::sheet::{Sheet, number};

#[derive(Serialize)]
pub struct HeadFindings {
    directions: usize,
    rate_hz: f64,
    /// The length of the longest response, delays included.
    samples: usize,
    /// From the lowest measured direction to the highest, in degrees above the horizon.
    elevations_deg: [f64; 2],
    /// How much later a sound from the right arrives at the left ear than at the right one.
    interaural_delay_s: f64,
    /// The file says that its first receiver is the other ear than its responses show.
    ears_exchanged: bool,
}

/// Reads the whole set.
pub fn read(file: &Path) -> Result<HeadFindings> {
    let head = Measured::open(file)?;
    let elevations = head.directions().iter().map(|[_, up, _]| up.clamp(-1.0, 1.0).asin().to_degrees());
    let right = [1.0, 0.0, 0.0];
    let ready = head.head(head.rate_hz());
    let mut filters = [vec![0.0; ready.taps()], vec![0.0; ready.taps()]];
    let [left, other] = &mut filters;
    let ears = ready.hear(right.map(|c: f64| c * 10.0), [left, other]);
    Ok(HeadFindings {
        directions: head.directions().len(),
        rate_hz: head.rate_hz(),
        samples: head.hrir(right).iter().map(Vec::len).max().unwrap_or(0),
        elevations_deg: [
            elevations.clone().fold(f64::INFINITY, f64::min),
            elevations.fold(f64::NEG_INFINITY, f64::max),
        ],
        interaural_delay_s: ears[0].delay_s - ears[1].delay_s,
        ears_exchanged: head.has_ears_exchanged(),
    })
}

impl Findings for HeadFindings {
    const KIND: &'static str = "head";

    fn sheet(&self) -> Sheet {
        let mut sheet = Sheet::default();
        let [lowest, highest] = self.elevations_deg.map(|degrees| number(degrees.round()));
        sheet
            .fact("kind", "head, SOFA")
            .fact("directions", self.directions)
            .fact("elevations", format!("{lowest} to {highest} degrees"))
            .fact("rate", format!("{} Hz", number(self.rate_hz)))
            .fact("responses", format!("{} samples", self.samples))
            .fact("from the right", format!("{:.0} µs later at the left ear", 1e6 * self.interaural_delay_s))
            .fact_if(
                "ears",
                self.ears_exchanged.then_some("the file names them the other way round than they hear"),
            );
        sheet
    }
}
