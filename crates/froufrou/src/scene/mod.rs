//! What is in the world: files in; objects, tracks, materials and listeners out, moment by moment.

pub mod alembic;
pub mod animation;
mod positioned_file;
