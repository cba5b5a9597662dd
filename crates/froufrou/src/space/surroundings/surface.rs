//! What `space` asks of the things around: where they are and what mesh they have.

use crate::Result;
use crate::scene::animation::{Mesh, Topology, Transform};
use crate::scene::carrier::Carrier;

/// Something that moves and perhaps has a mesh. Times are those of the soundtrack, in seconds.
pub trait Surface: Send + Sync {
    /// How its mesh changes; [`Topology::None`] where it has none.
    fn topology(&self) -> Topology;

    /// Its local-to-world transform at a time.
    ///
    /// # Errors
    /// A sample that cannot be read.
    fn frame(&self, time_s: f64) -> Result<Transform>;

    /// Its mesh at a time, in world space, into a buffer that is reused between calls.
    ///
    /// # Errors
    /// No mesh, or a sample that cannot be read.
    fn mesh(&self, time_s: f64, mesh: &mut Mesh) -> Result<()>;

    /// The next time after `time_s` at which its motion has a key, if any.
    fn next_key_s(&self, time_s: f64) -> Option<f64>;

    /// What an error calls it.
    fn name(&self) -> String;
}

impl Surface for Carrier {
    fn topology(&self) -> Topology {
        Carrier::topology(self)
    }

    fn frame(&self, time_s: f64) -> Result<Transform> {
        Carrier::frame(self, time_s)
    }

    fn mesh(&self, time_s: f64, mesh: &mut Mesh) -> Result<()> {
        Carrier::mesh(self, time_s, mesh)
    }

    fn next_key_s(&self, time_s: f64) -> Option<f64> {
        Carrier::next_key_s(self, time_s)
    }

    fn name(&self) -> String {
        Carrier::name(self)
    }
}
