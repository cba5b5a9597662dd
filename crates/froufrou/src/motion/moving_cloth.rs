//! What the cloths of a scene do, told by how their meshes and those of what they touch move.

use std::path::PathBuf;

use rayon::prelude::*;

use super::cloth::sliding::Sliding;
use super::cloth::{Analyser, Participant, Restart};
use super::event::Event;
use crate::scene::animation::{Mesh, Topology};
use crate::scene::world::Carrier;
use crate::{Error, Place, Result};

/// What is told of cloths.
#[derive(Debug, Clone, PartialEq)]
pub enum Told {
    /// Something happened; in order of time.
    Event(Event),
    /// How the vertices of a cloth slide in one frame; of each cloth in order of time.
    Sliding(Sliding),
    /// What was known of an object is forgotten.
    Restart(Restart),
}

/// What cloths do, frame by frame. It ends after its first error.
///
/// Frames are those of the cloth with the most of them; other meshes are asked where they are then. It holds what its
/// analyser holds, and one frame of all meshes.
///
/// ```no_run
/// # fn main() -> froufrou::Result<()> {
/// use froufrou::motion::cloth::{ClothSettings, Participant};
/// use froufrou::motion::moving_cloth::{MovingCloth, Told};
/// use froufrou::scene::{Scene, world::World};
/// let scene = Scene::open("scene.toml")?;
/// let world = World::open(&scene)?;
/// let mut bodies = Vec::new();
/// for body in world.objects.iter().flatten() {
///     let cloth = (body.name == "skirt").then(ClothSettings::default);
///     if let Some(carrier) = &body.carrier {
///         bodies.push((Participant { name: body.name.clone(), cloth }, carrier.clone()));
///     }
/// }
/// for told in MovingCloth::new(bodies, &scene.file)? {
///     if let Told::Event(event) = told? {
///         println!("{event:?}");
///     }
/// }
/// # Ok(()) }
/// ```
pub struct MovingCloth {
    analyser: Analyser,
    carriers: Vec<Carrier>,
    /// The carrier whose frames are taken.
    leading: usize,
    next_s: Option<f64>,
    meshes: Vec<Mesh>,
    file: PathBuf,
    over: bool,
}

impl MovingCloth {
    /// Begins with some objects and what carries their meshes; `file` is the scene, which messages name.
    ///
    /// # Errors
    /// An object without a mesh.
    pub fn new(bodies: Vec<(Participant, Carrier)>, file: impl Into<PathBuf>) -> Result<Self> {
        let file = file.into();
        if let Some((participant, _)) =
            bodies.iter().find(|(_, carrier)| carrier.topology() == Topology::None)
        {
            return Err(Error::new("cloth cannot touch it: it has no mesh")
                .at(Place::Part(participant.name.clone()))
                .in_file(file));
        }
        let cloths = bodies.iter().enumerate().filter(|(_, (participant, _))| participant.cloth.is_some());
        let counts = cloths.map(|(index, (_, carrier))| (index, carrier.key_count()));
        // Of those with as many the first.
        let leading = counts.max_by_key(|&(index, count)| (count, std::cmp::Reverse(index)));
        let leading = leading.map(|(index, _)| index);
        let (participants, carriers): (Vec<_>, Vec<Carrier>) = bodies.into_iter().unzip();
        let first = |index: usize| carriers.get(index)?.next_key_s(f64::MIN);
        Ok(Self {
            next_s: leading.and_then(first),
            leading: leading.unwrap_or_default(),
            meshes: vec![Mesh::default(); carriers.len()],
            analyser: Analyser::new(participants),
            carriers,
            file,
            over: false,
        })
    }

    /// The objects, in the order of their numbers.
    pub fn participants(&self) -> &[Participant] {
        self.analyser.participants()
    }

    fn told(&mut self) -> Option<Told> {
        let event = self.analyser.next_event().map(Told::Event);
        let sliding = || self.analyser.next_sliding().map(Told::Sliding);
        event.or_else(sliding).or_else(|| self.analyser.next_restart().map(Told::Restart))
    }

    /// Feeds the next frame.
    fn step(&mut self) -> Result<()> {
        let Some(time_s) = self.next_s else {
            self.over = true;
            self.analyser.finish();
            return Ok(());
        };
        let read = |(carrier, mesh): (&Carrier, &mut Mesh)| carrier.mesh(time_s, mesh);
        let read: Vec<Result<()>> = self.carriers.par_iter().zip(&mut self.meshes).map(read).collect();
        read.into_iter().collect::<Result<()>>()?;
        self.analyser.feed(time_s, &self.meshes)?;
        self.next_s = self.carriers[self.leading].next_key_s(time_s);
        Ok(())
    }
}

impl Iterator for MovingCloth {
    type Item = Result<Told>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(told) = self.told() {
                return Some(Ok(told));
            }
            if self.over {
                return None;
            }
            if let Err(fault) = self.step() {
                self.over = true;
                return Some(Err(fault.in_file(self.file.clone())));
            }
        }
    }
}
