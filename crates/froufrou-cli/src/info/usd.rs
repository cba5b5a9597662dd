//! What is in a USD file: its unit and axes, and its objects.

use std::path::Path;

use froufrou::Result;
use froufrou::scene::usd::Usd;
use serde::Serialize;

use super::Findings;
use super::objects::Objects;
use super::sheet::{Sheet, number};

#[derive(Serialize)]
pub struct UsdFindings {
    comment: Option<String>,
    up: &'static str,
    metres_per_unit: f64,
    /// False where the file does not say and USD's rule holds.
    unit_is_written: bool,
    time_codes_per_second: f64,
    frames_per_second: Option<f64>,
    #[serde(flatten)]
    objects: Objects,
}

/// Reads a file and the first mesh of every object.
pub fn read(file: &Path) -> Result<UsdFindings> {
    let usd = Usd::open(file)?;
    let facts = usd.facts();
    Ok(UsdFindings {
        comment: facts.comment.clone(),
        up: if facts.z_up { "Z" } else { "Y" },
        metres_per_unit: facts.metres_per_unit,
        unit_is_written: facts.unit_is_written,
        time_codes_per_second: facts.codes_per_second,
        frames_per_second: facts.frames_per_second,
        objects: Objects::read(&usd)?,
    })
}

impl Findings for UsdFindings {
    const KIND: &'static str = "usd";

    fn sheet(&self) -> Sheet {
        let mut sheet = Sheet::default();
        let unit = number(self.metres_per_unit);
        let by_rule = if self.unit_is_written { "" } else { " (not written; USD's rule)" };
        sheet
            .fact("kind", "Universal Scene Description")
            .fact_if("comment", self.comment.as_ref())
            .fact("up", format!("+{}", self.up))
            .fact("unit", format!("{unit} m{by_rule}"))
            .fact("time codes a second", number(self.time_codes_per_second))
            .fact_if("frames a second", self.frames_per_second.map(number));
        self.objects.tell(&mut sheet);
        sheet
    }
}
