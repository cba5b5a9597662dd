//! What is in the world: files in; objects, tracks, materials and listeners out, moment by moment.

pub mod alembic;
pub mod animation;
<<<<<<< HEAD
pub mod asset;
pub mod contact_log;
pub mod file;
mod read;
mod toml;
pub mod track;

pub use file::Scene;
=======
mod positioned_file;
>>>>>>> alembic
