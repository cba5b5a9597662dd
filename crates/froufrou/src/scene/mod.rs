//! What is in the world: files in; objects, tracks, materials and listeners out, moment by moment.

pub mod alembic;
pub mod animation;
pub mod asset;
mod between;
pub mod contact_log;
pub mod file;
pub mod listener;
mod positioned_file;
mod read;
mod toml;
pub mod track;
#[cfg(feature = "usd")]
pub mod usd;
pub mod world;

pub use file::Scene;
