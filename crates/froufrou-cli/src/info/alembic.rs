//! What is in an Alembic archive: who wrote it, and its objects, when they change and how big they
//! are.

use std::path::Path;

use froufrou::Result;
use froufrou::scene::alembic::Alembic;
use serde::Serialize;

use super::Findings;
use super::objects::Objects;
use super::sheet::Sheet;

#[derive(Serialize)]
pub struct AlembicFindings {
    application: Option<String>,
    date_written: Option<String>,
    alembic_version: Option<String>,
    description: Option<String>,
    frames_per_second: Option<String>,
    #[serde(flatten)]
    objects: Objects,
}

/// Reads the index of an archive and the first mesh of every object, one at a time.
pub fn read(file: &Path) -> Result<AlembicFindings> {
    let archive = Alembic::open(file)?;
    let metadata = |key: &str| archive.metadata(key).filter(|value| !value.is_empty()).map(str::to_owned);
    Ok(AlembicFindings {
        application: metadata("_ai_Application"),
        date_written: metadata("_ai_DateWritten"),
        alembic_version: metadata("_ai_AlembicVersion"),
        description: metadata("_ai_Description").or_else(|| metadata("description")),
        frames_per_second: metadata("FramesPerTimeUnit"),
        objects: Objects::read(&archive)?,
    })
}

impl Findings for AlembicFindings {
    const KIND: &'static str = "alembic";

    fn sheet(&self) -> Sheet {
        let mut sheet = Sheet::default();
        sheet
            .fact("kind", "Alembic archive")
            .fact_if("written by", self.application.as_ref())
            .fact_if("on", self.date_written.as_ref())
            .fact_if("library", self.alembic_version.as_ref())
            .fact_if("description", self.description.as_ref())
            .fact_if("frames a second", self.frames_per_second.as_ref());
        self.objects.tell(&mut sheet);
        sheet
    }
}
