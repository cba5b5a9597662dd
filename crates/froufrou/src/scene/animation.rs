//! What every reader of animation files gives: objects that have a transform, and perhaps a mesh or
//! a camera, at any time that is asked for.
//!
//! Readers hold the index of a file in memory and fetch samples as they are asked for, so that a
//! file of any length is read in the memory of a few frames.

use super::bracket::Bracket;
use super::conventions::UpAxis;
use crate::{Error, Place, Result};

/// A local-to-world transform, row-major, for column vectors: `world = m * [x, y, z, 1]`, so that
/// the translation is `m[0][3], m[1][3], m[2][3]`, in metres.
pub type Transform = [[f64; 4]; 4];

/// The transform of what stands at the origin, unturned.
pub(crate) const IDENTITY: Transform =
    [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];

/// Appends positions a fraction of the way from some to others.
pub(crate) fn mix_positions(before: &[[f32; 3]], after: &[[f32; 3]], fraction: f64, to: &mut Vec<[f32; 3]>) {
    let mix = |a: f32, b: f32| (f64::from(a) * (1.0 - fraction) + f64::from(b) * fraction) as f32;
    to.extend(before.iter().zip(after).map(|(a, b)| [mix(a[0], b[0]), mix(a[1], b[1]), mix(a[2], b[2])]));
}

/// A polygon mesh at one moment, in world space, metres, Y up, its faces counter-clockwise seen from
/// outside. Positions are as the file has them: a NaN there is a NaN here.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions in metres.
    pub positions: Vec<[f32; 3]>,
    /// The vertex indices of all faces, one face after another.
    pub face_vertices: Vec<u32>,
    /// The number of vertices of each face.
    pub face_sizes: Vec<u32>,
}

/// How big a mesh is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct MeshSize {
    /// Number of vertices.
    pub vertices: usize,
    /// Number of faces.
    pub faces: usize,
}

/// What an object of an animation is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ObjectKind {
    /// A transform alone: an empty, a group, a locator.
    Transform,
    /// A polygon mesh.
    Mesh,
    /// A camera: it looks along its local −Z, its up is +Y.
    Camera,
    /// Anything else (curves, points, lights); only its transform can be asked for.
    Other,
}

/// How an object's mesh changes in time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Topology {
    /// No mesh.
    None,
    /// Nothing changes but the transform.
    Constant,
    /// Vertices move, faces stay.
    Homogeneous,
    /// Faces and vertex counts may change.
    Heterogeneous,
}

/// The times at which something has samples, ascending, in seconds.
#[derive(Debug, Clone, PartialEq)]
pub enum KeyTimes {
    /// It never changes.
    Static,
    /// `count` samples from `start_s`, `step_s` apart.
    Uniform {
        /// Time of the first sample.
        start_s: f64,
        /// Distance between samples, above 0.
        step_s: f64,
        /// Number of samples, at least 2.
        count: usize,
    },
    /// Listed one by one.
    Listed(std::sync::Arc<[f64]>),
}

impl KeyTimes {
    /// The number of samples; 0 for what never changes.
    pub fn len(&self) -> usize {
        match self {
            KeyTimes::Static => 0,
            KeyTimes::Uniform { count, .. } => *count,
            KeyTimes::Listed(times) => times.len(),
        }
    }

    /// True for what never changes.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The time of sample `index` in seconds, for `index < len()`.
    pub fn get(&self, index: usize) -> Option<f64> {
        match self {
            KeyTimes::Static => None,
            KeyTimes::Uniform { start_s, step_s, count } => {
                (index < *count).then(|| start_s + index as f64 * step_s)
            }
            KeyTimes::Listed(times) => times.get(index).copied(),
        }
    }

    /// Samples per second, where they are equally spaced.
    pub fn rate_hz(&self) -> Option<f64> {
        match self {
            KeyTimes::Uniform { step_s, .. } => Some(1.0 / step_s),
            KeyTimes::Static | KeyTimes::Listed(_) => None,
        }
    }

    /// Equally spaced times where these are, to within `tolerance_s`; else the list of them. One time
    /// alone, and none, is that of what never changes.
    pub(crate) fn from_times(times_s: Vec<f64>, tolerance_s: f64) -> Self {
        let (Some(&first), Some(&last)) = (times_s.first(), times_s.last()) else { return KeyTimes::Static };
        if times_s.len() < 2 {
            return KeyTimes::Static;
        }
        let step_s = (last - first) / (times_s.len() - 1) as f64;
        let near = |(i, t): (usize, &f64)| (first + i as f64 * step_s - t).abs() <= tolerance_s;
        if times_s.iter().enumerate().all(near) {
            return KeyTimes::Uniform { start_s: first, step_s, count: times_s.len() };
        }
        KeyTimes::Listed(times_s.into())
    }

    /// The samples around a time.
    pub(crate) fn bracket(&self, time_s: f64) -> Bracket {
        // No reader counts more samples than this.
        let count = u32::try_from(self.len()).unwrap_or(u32::MAX);
        if count == 0 {
            return Bracket::at(0);
        }
        Bracket::around(time_s, count, |index| self.get(index as usize).unwrap_or(f64::INFINITY))
    }

    /// First and last time, where there are samples.
    pub fn span_s(&self) -> Option<(f64, f64)> {
        Some((self.get(0)?, self.get(self.len().checked_sub(1)?)?))
    }
}

/// One object of an animation.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectInfo {
    /// Its path in the file, such as `/Armature/Body`.
    pub path: String,
    /// What it is.
    pub kind: ObjectKind,
    /// How its mesh changes.
    pub topology: Topology,
    /// When it has samples: those of its own and of every transform above it together.
    pub key_times: KeyTimes,
}

/// What a file states of its own axes and unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stated {
    /// The axis that points up.
    pub up: UpAxis,
    /// Metres in its unit of length.
    pub unit_m: f64,
}

impl Default for Stated {
    /// Y up and metres: what is taken where a file states nothing.
    fn default() -> Self {
        Self { up: UpAxis::Y, unit_m: 1.0 }
    }
}

/// How fast an object moves, as far as its file states that, in metres and radians a second.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StatedVelocity {
    /// The velocity of its origin.
    pub linear_mps: Option<[f64; 3]>,
    /// Its angular velocity, in the world's axes.
    pub angular_rps: Option<[f64; 3]>,
}

/// An opened animation file of any format.
///
/// Times are the file's own clock in seconds. Before the first and after the last sample the world
/// stands still. Between samples positions are interpolated linearly and rotations of transforms
/// spherically.
pub trait Animation: Send + Sync {
    /// Every object, parents before children.
    fn objects(&self) -> &[ObjectInfo];

    /// Where an object is at a time.
    ///
    /// # Errors
    /// A sample that cannot be read.
    fn transform(&self, object: usize, time_s: f64) -> Result<Transform>;

    /// An object's mesh at a time, in world space, into a buffer that is reused between calls.
    /// Between two samples of differing topology the earlier one is given.
    ///
    /// # Errors
    /// An object without a mesh, or a sample that cannot be read.
    fn mesh(&self, object: usize, time_s: f64, mesh: &mut Mesh) -> Result<()>;

    /// A number for each vertex of an object's mesh at a time, which its file has by a name: what a simulation wrote
    /// beside its points, such as forces. Of what has several numbers a vertex, as vectors have, it is their length.
    /// Between two samples of as many numbers it is interpolated.
    ///
    /// # Errors
    /// An object without a mesh, a name that it does not know, or a sample that cannot be read.
    fn vertex_values(&self, object: usize, name: &str, _time_s: f64, _values: &mut Vec<f32>) -> Result<()> {
        let path = self.objects().get(object).map_or("", |object| object.path.as_str());
        Err(Error::new(format!("{name:?} cannot be known of its vertices: of the formats that are read, Alembic alone has numbers beside points"))
            .at(Place::Part(path.to_owned()))
            .help("export the simulation as Alembic, with its attributes"))
    }

    /// How big an object's mesh is at its first sample; nothing for an object without a mesh.
    ///
    /// # Errors
    /// An object that is not there, or a sample that cannot be read.
    fn mesh_size(&self, object: usize) -> Result<Option<MeshSize>> {
        let Some(info) = self.objects().get(object) else {
            return Err(Error::new(format!(
                "there is no object {object}; there are {}",
                self.objects().len()
            )));
        };
        if info.kind != ObjectKind::Mesh {
            return Ok(None);
        }
        let mut mesh = Mesh::default();
        self.mesh(object, info.key_times.get(0).unwrap_or_default(), &mut mesh)?;
        Ok(Some(MeshSize { vertices: mesh.positions.len(), faces: mesh.face_sizes.len() }))
    }

    /// How fast an object moves at a time, as the file states it besides its samples; most state nothing.
    ///
    /// # Errors
    /// An object that is not there, or a sample that cannot be read.
    fn velocity(&self, _object: usize, _time_s: f64) -> Result<StatedVelocity> {
        Ok(StatedVelocity::default())
    }

    /// True for the log of a simulation, whose times are those of the soundtrack as they stand.
    fn is_log(&self) -> bool {
        false
    }

    /// What the file states of its axes and unit, which a reader that knows it has applied already;
    /// the default for formats that state nothing. A scene that says otherwise is right, and this is
    /// what is undone for it.
    fn stated(&self) -> Stated {
        Stated::default()
    }
}
