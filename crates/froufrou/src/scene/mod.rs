//! What is in the world: files in; objects, tracks, materials and listeners out, moment by moment.

pub mod alembic;
pub mod animation;
pub mod asset;
mod between;
mod bracket;
pub mod carrier;
pub mod contact_log;
pub mod conventions;
mod converted;
pub mod fed;
pub mod file;
pub mod format;
pub mod gltf;
pub mod listener;
mod log_table;
pub mod obj;
pub mod point_cache;
pub mod pose_log;
pub(crate) mod positioned_file;
pub(crate) mod presence;
mod read;
mod sample_cache;
pub(crate) mod toml;
pub mod track;
#[cfg(feature = "usd")]
pub mod usd;
mod wander;
pub mod wind;
pub mod world;

pub use file::Scene;
