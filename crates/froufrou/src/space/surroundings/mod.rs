//! What stands about a source and a microphone: bodies that reflect sound and bodies that are in its way
//! (sound tracing, Takala & Hahn 1992, §5.4).
//!
//! Wavelengths are as long as things are large. So each surface is a small number of *patches*, which
//! ride on its mesh and are sources of their own, and a path that is partly covered is partly heard.
//! A path goes directly or by one patch; each patch is one path for the whole time, silent where it
//! reflects nothing.

mod beam;
mod body;
mod cluster;
mod form;
mod patch;
mod surface;
mod tree;

use std::sync::Arc;

use glam::DVec3;

use crate::Result;
use beam::Beam;
use body::Posed;
pub(in crate::space) use body::{affine, simple};
pub use surface::Surface;

/// What a body does to sound.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// The part of the energy that is not reflected, 0 to 1.
    pub absorption: f64,
    /// The part of the reflected energy that goes evenly to all sides (Lambert), 0 to 1; the rest goes in a lobe
    /// about the mirror direction.
    pub diffuse: f64,
    /// The exponent n of the lobe cosⁿ φ, 1 to 1e6: 10 is soft, 1000 all but a mirror.
    pub sharpness: f64,
    /// The part of the pressure that is left behind a body that covers all of a path, 0 to 1: what goes through it
    /// and, by diffraction, around it.
    pub transmission: f64,
}

impl Default for Material {
    /// A hard wall that is not smooth; −20 dB behind it.
    fn default() -> Self {
        Self { absorption: 0.1, diffuse: 0.5, sharpness: 10.0, transmission: 0.1 }
    }
}

/// The shape of a body in its local frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// That of the mesh of its [`Surface`].
    Mesh,
    /// An upright rectangle about the origin: width along X, height along Y. Its front is where it faces, −Z.
    Rectangle {
        /// Metres along X.
        width_m: f64,
        /// Metres along Y.
        height_m: f64,
    },
    /// A box about the origin.
    Box {
        /// Metres along X, Y and Z.
        size_m: [f64; 3],
    },
}

/// Which sides of a surface reflect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Sides {
    /// The front alone where the shape is closed, as a box or a ball is, and else both.
    #[default]
    Auto,
    /// The side from which faces are seen counter-clockwise.
    Front,
    /// Front and back.
    Both,
}

/// A body among the surroundings.
#[derive(Clone)]
pub struct Body {
    /// Where it is, and its mesh.
    pub surface: Arc<dyn Surface>,
    /// Its shape.
    pub shape: Shape,
    /// What it does to sound.
    pub material: Material,
    /// Which sides reflect.
    pub sides: Sides,
    /// Patches at most that reflect; 0 for a body that does not.
    pub patches: usize,
    /// True where it is in the way of sound.
    pub occludes: bool,
    /// The thing that it belongs to: it neither hides nor reflects the sounds that this thing carries, nor
    /// what a microphone hears that it carries.
    pub thing: Option<u64>,
}

/// How sound is traced.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// The wavelength in metres whose first Fresnel zone is the width of a path: speed of sound / 500 Hz
    /// is what speech and most noises are about.
    pub wavelength_m: f64,
    /// Patches at most of all bodies together; the largest are taken.
    pub patches: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self { wavelength_m: 343.0 / 500.0, patches: 64 }
    }
}

/// One end of a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct End {
    /// World position in metres.
    pub position_m: [f64; 3],
    /// The thing that carries it, see [`Body::thing`].
    pub thing: Option<u64>,
}

/// A path by way of a patch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounce {
    /// Where it is reflected, in metres: what the directivities of source and microphone are asked about.
    pub point_m: [f64; 3],
    /// Length of the way from the source over the point to the microphone, in metres.
    pub length_m: f64,
    /// The pressure gain of both distances and the reflection, from a pressure of 1 at 1 m. It takes the place of
    /// 1 / distance; the directivities come on top.
    pub gain: f64,
    /// The part of the pressure that occlusion leaves on both halves of the way, 0 to 1; 1 where the gain is next to
    /// nothing.
    pub share: f64,
}

impl Bounce {
    /// The gain of what is heard: of the whole way, with what occlusion leaves.
    pub fn heard(&self) -> f64 {
        self.gain * self.share
    }
}

/// What reaches a microphone from a source.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Paths {
    /// The part of the pressure of the direct sound that occlusion leaves, 0 to 1; distance and directivities
    /// come on top.
    pub direct: f64,
    /// The paths by way of each patch, always all of them and in the same order.
    pub bounces: Vec<Bounce>,
}

/// A path fainter than this is not traced further: 120 dB below 1 m.
const FAINT: f64 = 1e-6;

/// The bodies about, as they are at one time.
pub struct Surroundings {
    settings: Settings,
    bodies: Vec<Posed>,
    /// Body and patch of each path.
    patches: Vec<(usize, usize)>,
    time_s: Option<f64>,
    beam: Beam,
}

impl Surroundings {
    /// Takes up bodies, and finds their patches on their first frames.
    ///
    /// # Errors
    /// A mesh that cannot be read, or that is asked for where there is none; a size or a property that is not
    /// what it must be.
    pub fn new(settings: Settings, bodies: Vec<Body>) -> Result<Self> {
        let bodies: Vec<Posed> = bodies.into_iter().map(Posed::new).collect::<Result<_>>()?;
        let mut patches: Vec<(usize, usize, f64)> = Vec::new();
        for (number, body) in bodies.iter().enumerate() {
            patches.extend(body.areas_m2().enumerate().map(|(patch, area_m2)| (number, patch, area_m2)));
        }
        // A stable sort: of equal ones the first.
        patches.sort_by(|a, b| b.2.total_cmp(&a.2));
        patches.truncate(settings.patches);
        let mut patches: Vec<(usize, usize)> = patches.into_iter().map(|(b, p, _)| (b, p)).collect();
        patches.sort_unstable();
        Ok(Self { settings, bodies, patches, time_s: None, beam: Beam::new() })
    }

    /// How many patches there are, and so paths besides the direct one.
    pub fn patches(&self) -> usize {
        self.patches.len()
    }

    /// What reaches a microphone from a source when all stand as they do at a time. Asked for times in
    /// ascending order it is fastest; the answer is a function of the time alone.
    ///
    /// # Errors
    /// A sample of a body's motion that cannot be read.
    pub fn paths(&mut self, time_s: f64, source: End, microphone: End, paths: &mut Paths) -> Result<()> {
        self.pose(time_s)?;
        let (from, to) = (DVec3::from(source.position_m), DVec3::from(microphone.position_m));
        let things = [source.thing, microphone.thing];
        paths.bounces.clear();
        paths.direct = self.passes(from, to, things, None);
        for number in 0..self.patches.len() {
            let (body, patch) = self.patches[number];
            let found = self.bodies[body].reflect(patch, from, to);
            let gain = if self.bodies[body].belongs_to(things) { 0.0 } else { found.gain };
            let mut share = 1.0;
            if gain > FAINT {
                share = self.passes(from, found.point, things, Some((body, patch)));
            }
            if gain * share > FAINT {
                share *= self.passes(found.point, to, things, Some((body, patch)));
            }
            let (point_m, length_m) = (found.point.to_array(), found.length_m);
            paths.bounces.push(Bounce { point_m, length_m, gain, share });
        }
        Ok(())
    }

    /// Whether nothing is there.
    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty()
    }

    /// The part of the pressure that occlusion leaves on the straight way from one end to another.
    ///
    /// # Errors
    /// A sample of a body's motion that cannot be read.
    pub fn share(&mut self, time_s: f64, from: End, to: End) -> Result<f64> {
        self.pose(time_s)?;
        let things = [from.thing, to.thing];
        Ok(self.passes(from.position_m.into(), to.position_m.into(), things, None))
    }

    /// The next time after `time_s` at which the motion of any body has a key.
    pub fn next_key_s(&self, time_s: f64) -> Option<f64> {
        self.bodies.iter().filter_map(|body| body.next_key_s(time_s)).reduce(f64::min)
    }

    /// How fast any corner of any body moves about a time, in metres a second: with it goes how far apart in
    /// time paths must be asked for. It is measured over the millisecond that follows.
    ///
    /// # Errors
    /// A sample of a body's motion that cannot be read.
    pub fn speed_mps(&mut self, time_s: f64) -> Result<f64> {
        const STEP_S: f64 = 1e-3;
        self.pose(time_s)?;
        let before: Vec<_> = self.bodies.iter().map(Posed::corners).collect();
        self.pose(time_s + STEP_S)?;
        let pairs = before.iter().zip(self.bodies.iter().map(Posed::corners));
        let moved = pairs.flat_map(|(a, b)| a.iter().zip(b).map(|(a, b)| a.distance(b)).collect::<Vec<_>>());
        let fastest = moved.filter(|d| d.is_finite()).fold(0.0, f64::max) / STEP_S;
        self.pose(time_s)?;
        Ok(fastest)
    }

    fn pose(&mut self, time_s: f64) -> Result<()> {
        if self.time_s == Some(time_s) {
            return Ok(());
        }
        self.time_s = None;
        for body in &mut self.bodies {
            body.pose(time_s)?;
        }
        self.time_s = Some(time_s);
        Ok(())
    }

    /// The part of the pressure that passes from one point to another.
    fn passes(
        &mut self,
        from: DVec3,
        to: DVec3,
        things: [Option<u64>; 2],
        but: Option<(usize, usize)>,
    ) -> f64 {
        if !self.beam.aim(from, to, self.settings.wavelength_m) {
            return 1.0;
        }
        for (number, body) in self.bodies.iter().enumerate() {
            if body.occludes() && !body.belongs_to(things) {
                let patch = but.filter(|(body, _)| *body == number).map(|(_, patch)| patch);
                body.cover(&mut self.beam, patch);
            }
        }
        self.beam.gain()
    }
}

#[cfg(test)]
pub(super) mod meshes;
#[cfg(test)]
mod tests;
