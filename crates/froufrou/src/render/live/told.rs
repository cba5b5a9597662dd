//! What a handle tells its engine.

use std::sync::Arc;

use crate::motion::lives::Touch;
use crate::scene::fed::{Faces, FedPose};

/// One thing that is told.
pub(super) enum Told {
    /// The body of a number has this name.
    Body(u32, Arc<str>),
    Contact(Box<Touch>),
    Pose {
        slot: u32,
        time_s: f64,
        pose: FedPose,
    },
    Mesh {
        slot: u32,
        time_s: f64,
        positions: Arc<[[f32; 3]]>,
        faces: Option<Arc<Faces>>,
    },
    Appear {
        slot: u32,
        name: Arc<str>,
        kind: Arc<str>,
        time_s: f64,
        pose: FedPose,
    },
    /// Something that appeared, by its slot, or an object of the scene.
    Vanish {
        slot: Option<u32>,
        name: Arc<str>,
        time_s: f64,
    },
    Material {
        name: Arc<str>,
        material: Arc<str>,
        time_s: f64,
    },
    /// All that happens until then has been told.
    Advance(f64),
}
