//! What the cloths of a scene do, told by how their meshes and those of what they touch move.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::cloth::buckles::BuckleSettings;
use super::cloth::sliding::{Sliding, SlidingSettings};
use super::cloth::tension::TensionSettings;
use super::cloth::{Analyser, ClothSettings, Participant, Restart};
use super::event::Event;
use super::moving_meshes::{Analyse, MovingMeshes};
use crate::scene::Scene;
use crate::scene::animation::{Mesh, Topology};
use crate::scene::file::Cloth;
use crate::scene::world::{Carrier, World};
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
/// let scene = Scene::open("scene.toml", false)?;
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
pub struct MovingCloth(MovingMeshes<Analyser>);

impl MovingCloth {
    /// Begins with some objects and what carries their meshes; `file` is the scene, which messages name.
    ///
    /// # Errors
    /// An object without a mesh.
    pub fn new(bodies: Vec<(Participant, Carrier)>, file: impl Into<PathBuf>) -> Result<Self> {
        let (participants, carriers): (Vec<Participant>, Vec<Carrier>) = bodies.into_iter().unzip();
        let objects =
            participants.iter().map(|participant| (participant.name.clone(), participant.cloth.is_some()));
        let objects: Vec<_> = objects.collect();
        MovingMeshes::new(Analyser::new(participants), carriers, &objects, file.into(), "cloth").map(Self)
    }

    /// The objects, in the order of their numbers.
    pub fn participants(&self) -> &[Participant] {
        self.0.analyser.participants()
    }
}

impl Analyse for Analyser {
    type Told = Told;

    fn feed(&mut self, time_s: f64, meshes: &[Mesh]) -> Result<()> {
        self.feed(time_s, meshes)
    }

    fn told(&mut self) -> Option<Told> {
        let event = self.next_event().map(Told::Event);
        let sliding = || self.next_sliding().map(Told::Sliding);
        event.or_else(sliding).or_else(|| self.next_restart().map(Told::Restart))
    }

    fn finish(&mut self) {
        self.finish();
    }
}

/// How the cloth of a scene is looked at.
fn settings(cloth: &Cloth) -> ClothSettings {
    ClothSettings {
        buckles: BuckleSettings { least_energy_mps: cloth.least_energy_mps, ..BuckleSettings::default() },
        sliding: SlidingSettings {
            radius_m: cloth.radius_m,
            threshold_mps: cloth.floor_speed_mps,
            scale_mps: cloth.speed_scale_mps,
            exponent: cloth.speed_exponent,
            ..SlidingSettings::default()
        },
        tension: cloth.membrane.map(|sheet| TensionSettings {
            stiffness_n_per_m: sheet.stiffness_n_per_m,
            density_kg_per_m2: sheet.density_kg_per_m2,
            snap_mps: sheet.snap_mps,
        }),
        patches: cloth.patches,
    }
}

/// The cloths of a scene, by their materials; what else has a mesh takes part where `others` is true.
fn cloths_of(
    scene: &Scene,
    world: &World,
    others: bool,
    settings: impl Fn(&Cloth) -> ClothSettings,
) -> Result<Option<MovingCloth>> {
    let mut bodies = Vec::new();
    for (object, members) in scene.objects.iter().zip(&world.objects) {
        let material = object.material.and_then(|index| scene.materials.get(index));
        let cloth = material.and_then(|material| material.cloth.as_ref()).map(&settings);
        for member in members {
            let carrier = member.carrier.as_ref().filter(|_| object.swarm.is_none());
            let has_mesh = carrier.is_some_and(|carrier| carrier.topology() != Topology::None);
            if cloth.is_some() && !has_mesh {
                return Err(Error::new("it is of cloth and has no mesh")
                    .at(Place::Part(member.name.clone()))
                    .in_file(&scene.file)
                    .help("give it a `source` that names a mesh"));
            }
            if let Some(carrier) = carrier.filter(|_| has_mesh && (others || cloth.is_some())) {
                bodies.push((Participant { name: member.name.clone(), cloth }, carrier.clone()));
            }
        }
    }
    if bodies.iter().all(|(participant, _)| participant.cloth.is_none()) {
        return Ok(None);
    }
    MovingCloth::new(bodies, &scene.file).map(Some)
}

/// What the cloths of a scene do, in order of time: the objects whose materials have a `cloth`, along all that have a
/// mesh. Swarms are left out.
///
/// # Errors
/// An object of cloth without a mesh; what cannot be read, later on.
pub fn events(scene: &Scene, world: &World) -> Result<impl Iterator<Item = Result<Event>> + Send + use<>> {
    let cloths = cloths_of(scene, world, true, settings)?;
    Ok(cloths.into_iter().flatten().filter_map(|told| match told {
        Ok(Told::Event(event)) => Some(Ok(event)),
        Ok(Told::Sliding(_) | Told::Restart(_)) => None,
        Err(fault) => Some(Err(fault)),
    }))
}

/// The energies of all buckles of each cloth of a scene, by its name: what those of recorded pops are held against.
///
/// # Errors
/// Those of [`events`].
pub fn buckle_energies(scene: &Scene, world: &World) -> Result<BTreeMap<String, Vec<f64>>> {
    let buckles_alone = |cloth: &Cloth| ClothSettings {
        // Nothing touches.
        sliding: SlidingSettings { radius_m: 0.0, surroundings_m: Some(0.0), ..SlidingSettings::default() },
        tension: None,
        patches: 1,
        ..settings(cloth)
    };
    let mut energies: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for told in cloths_of(scene, world, false, buckles_alone)?.into_iter().flatten() {
        if let Told::Event(Event::Buckle(buckle)) = told? {
            energies.entry(buckle.cloth).or_default().push(buckle.energy_mps);
        }
    }
    Ok(energies)
}

impl Iterator for MovingCloth {
    type Item = Result<Told>;

    fn next(&mut self) -> Option<Self::Item> {
        self.0.next()
    }
}
