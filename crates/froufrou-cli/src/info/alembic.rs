//! What an Alembic archive says of who wrote it.

use froufrou::scene::alembic::Alembic;

use super::animation::Facts;

/// The facts that an archive has of itself.
pub fn facts(archive: &Alembic) -> Facts {
    let keys = [
        ("written by", "_ai_Application"),
        ("written on", "_ai_DateWritten"),
        ("library", "_ai_AlembicVersion"),
        ("description", "description"),
        // Where both are there, the one that the library names counts.
        ("description", "_ai_Description"),
        ("frames a second", "FramesPerTimeUnit"),
    ];
    let value = |key: &str| archive.metadata(key).filter(|value| !value.is_empty()).map(str::to_owned);
    keys.into_iter().filter_map(|(label, key)| Some((label, value(key)?))).collect()
}
