//! What happens: frames in, events out.

pub mod body;
pub mod cloth;
pub mod contacts;
pub mod event;
pub mod impact;
pub mod lives;
mod momentum;
pub mod moving;
pub mod moving_cloth;
pub(crate) mod moving_meshes;
pub mod moving_paper;
pub mod paper;
pub mod rigid;
pub mod rub;
pub mod slide;

pub use event::Event;
