//! Who is compared.

pub mod froufrou;
pub mod kira;
pub mod oddio;
pub mod openal;
pub mod steam_audio;

use std::path::Path;

use crate::world::World;

pub type Result<T, E = String> = std::result::Result<T, E>;

/// What is heard of a peer, which is what it is compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Two ears of a head: filters that depend on direction.
    Binaural,
    /// Two channels without filters.
    Stereo,
}

/// A way to render a world.
pub trait Peer {
    /// A short name for tables and `--only`.
    fn name(&self) -> String;

    /// With what: versions, resampler, length of the filters.
    fn details(&self) -> String;

    fn kind(&self) -> Kind;

    /// Makes all voices of a world sound.
    fn start(&self, world: &World) -> Result<Box<dyn Rendering>>;
}

/// A world that sounds.
pub trait Rendering {
    /// Tells each voice where it is at a tick.
    fn tick(&mut self, time_s: f64) -> Result<()>;

    /// Does beforehand what is no work of the thread that renders.
    fn prepare(&mut self) -> Result<()> {
        Ok(())
    }

    /// Renders the next block: left and right.
    fn render(&mut self, block: &mut [[f32; 2]]) -> Result<()>;
}

/// All peers that can be had here, and why not the others. `head` is a SOFA file.
pub fn all(head: Option<&Path>) -> (Vec<Box<dyn Peer>>, Vec<String>) {
    let (mut peers, mut absent): (Vec<Box<dyn Peer>>, _) = (Vec::new(), Vec::new());
    peers.extend(froufrou::all(head, &mut absent));
    peers.extend(openal::all(&mut absent));
    peers.extend(steam_audio::all(head, &mut absent));
    peers.push(Box::new(oddio::Oddio));
    peers.push(Box::new(kira::Kira));
    (peers, absent)
}
