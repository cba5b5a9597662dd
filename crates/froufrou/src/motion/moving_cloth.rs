//! What the cloths of a scene do, told by how their meshes and those of what they touch move.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::cloth::buckles::BuckleSettings;
use super::cloth::sliding::{Sliding, SlidingSettings};
use super::cloth::tension::TensionSettings;
use super::cloth::{Analyser, ClothSettings, Participant, Restart};
use super::event::Event;
use super::moving_meshes::{Analyse, Force, MovingMeshes, Step, WithMesh, are_told, with_meshes};
use crate::Result;
use crate::scene::Scene;
use crate::scene::animation::Mesh;
use crate::scene::carrier::Carrier;
use crate::scene::file::Cloth;
use crate::scene::world::World;

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
pub struct MovingCloth(MovingMeshes<Cloths>);

/// An analyser that is told of forces.
struct Cloths {
    analyser: Analyser,
    forces: Vec<Force>,
    force_n: Vec<f32>,
}

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
        let cloths =
            Cloths { analyser: Analyser::new(participants), forces: Vec::new(), force_n: Vec::new() };
        MovingMeshes::new(cloths, carriers, &objects, file.into(), "cloth").map(Self)
    }

    /// Takes how hard a cloth presses from its file, which has a number in newtons, or a vector, for each vertex by a
    /// name. An object that there is not is as if nothing was said.
    pub fn pressed(mut self, object: u32, attribute: &str) -> Self {
        self.press(object, attribute);
        self
    }

    fn press(&mut self, object: u32, attribute: &str) {
        if let Some(carrier) = self.0.carriers.get(object as usize).cloned() {
            self.0.analyser.forces.push(Force { object, attribute: attribute.to_owned(), carrier });
        }
    }

    /// The objects, in the order of their numbers.
    pub fn participants(&self) -> &[Participant] {
        self.0.analyser.analyser.participants()
    }

    /// Takes a frame of all meshes as they are at a time, for who does not ask for what is told by their own frames.
    ///
    /// # Errors
    /// A mesh that cannot be read, or is none.
    pub(crate) fn frame(&mut self, time_s: f64) -> Result<()> {
        self.0.frame(time_s)
    }

    /// Something else takes the place of an object, or comes behind the last. Of others nothing is forgotten but that they
    /// touched it.
    pub(crate) fn replace(&mut self, object: usize, body: WithMesh<'_>) {
        let Cloths { analyser, forces, .. } = &mut self.0.analyser;
        let cloth = cloth_of(&body).map(prompt_settings);
        analyser.replace(object, Participant { name: body.name.to_owned(), cloth });
        forces.retain(|force| force.object as usize != object);
        let force = force_of(&body);
        self.0.replace(object, body.carrier);
        force.into_iter().for_each(|force| self.press(object as u32, force));
    }

    /// Whether there is anything to look at.
    pub(crate) fn is_any(&self) -> bool {
        self.participants().iter().any(|participant| participant.cloth.is_some())
    }

    /// No frame is to come: what was not settled is told.
    pub(crate) fn finish(&mut self) {
        self.0.analyser.finish();
    }

    /// What happened in those frames, as far as it is known.
    pub(crate) fn event(&mut self) -> Option<Event> {
        loop {
            if let Told::Event(event) = self.0.analyser.told()? {
                return Some(event);
            }
        }
    }
}

impl Analyse for Cloths {
    type Told = Told;

    fn feed(&mut self, time_s: f64, meshes: &[Mesh]) -> Result<()> {
        for force in &self.forces {
            force.read(time_s, &mut self.force_n)?;
            self.analyser.press(force.object, &self.force_n)?;
        }
        self.analyser.feed(time_s, meshes)
    }

    fn told(&mut self) -> Option<Told> {
        let event = self.analyser.next_event().map(Told::Event);
        let sliding = || self.analyser.next_sliding().map(Told::Sliding);
        event.or_else(sliding).or_else(|| self.analyser.next_restart().map(Told::Restart))
    }

    fn settled_s(&self) -> f64 {
        self.analyser.settled_s()
    }

    fn finish(&mut self) {
        self.analyser.finish();
    }
}

/// How the cloth of a scene is looked at.
fn settings(cloth: &Cloth) -> ClothSettings {
    ClothSettings {
        buckles: BuckleSettings {
            least_energy_mps: cloth.least_energy_mps,
            blur_m: cloth.blur_m,
            ..BuckleSettings::default()
        },
        sliding: SlidingSettings {
            radius_m: cloth.radius_m,
            threshold_mps: cloth.floor_speed_mps,
            scale_mps: cloth.speed_scale_mps,
            exponent: cloth.speed_exponent,
            pressure_pa: cloth.pressure_pa,
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

/// The same where it is told as it moves, and nobody can wait for long.
fn prompt_settings(cloth: &Cloth) -> ClothSettings {
    let all = settings(cloth);
    let sliding = SlidingSettings { look_ahead_s: 0.0, ..all.sliding };
    ClothSettings { buckles: all.buckles.prompt(), sliding, ..all }
}

/// By how long what cloths do is told later than it happens where they are told as they move, in seconds, and a frame.
pub(crate) fn prompt_behind_s() -> f64 {
    BuckleSettings::default().prompt().behind_s()
}

/// The cloths among what is told as it moves, if there are any.
///
/// # Errors
/// As [`MovingCloth::new`].
pub(crate) fn told(scene: &Scene, bodies: Vec<WithMesh<'_>>) -> Result<Option<MovingCloth>> {
    cloths_among(scene, bodies, true, prompt_settings)
}

/// The cloths of a scene, by their materials; what else has a mesh takes part where `others` is true.
fn cloths_of(
    scene: &Scene,
    world: &World,
    others: bool,
    settings: impl Fn(&Cloth) -> ClothSettings,
) -> Result<Option<MovingCloth>> {
    let bodies = with_meshes(scene, world, "cloth", |material| material.cloth.is_some())?;
    if are_told(&bodies) {
        return Ok(None);
    }
    cloths_among(scene, bodies, others, settings)
}

/// The cloth that something is of.
fn cloth_of<'a>(body: &WithMesh<'a>) -> Option<&'a Cloth> {
    body.material?.cloth.as_ref()
}

/// What its file calls the force with which it presses. What is told has no file.
fn force_of<'a>(body: &WithMesh<'a>) -> Option<&'a String> {
    cloth_of(body).filter(|_| !body.carrier.is_fed())?.force.as_ref()
}

fn cloths_among(
    scene: &Scene,
    with_meshes: Vec<WithMesh<'_>>,
    others: bool,
    settings: impl Fn(&Cloth) -> ClothSettings,
) -> Result<Option<MovingCloth>> {
    let (mut bodies, mut forces) = (Vec::new(), Vec::new());
    for body in with_meshes {
        let cloth = cloth_of(&body);
        if others || cloth.is_some() {
            let force = force_of(&body).filter(|_| others);
            forces.extend(force.map(|force| (bodies.len() as u32, force)));
            bodies.push((
                Participant { name: body.name.to_owned(), cloth: cloth.map(&settings) },
                body.carrier,
            ));
        }
    }
    if bodies.iter().all(|(participant, _)| participant.cloth.is_none()) {
        return Ok(None);
    }
    let cloths = MovingCloth::new(bodies, &scene.file)?;
    Ok(Some(forces.into_iter().fold(cloths, |cloths, (object, name)| cloths.pressed(object, name))))
}

/// What the cloths of a scene do, in order of time: the objects whose materials have a `cloth`, along all that have a
/// mesh. Swarms are left out. Where meshes are told as they move there are none: a feed looks at those. After each frame
/// [`Event::Quiet`] says how far all is told.
///
/// # Errors
/// An object of cloth without a mesh; what cannot be read, later on.
pub fn events(scene: &Scene, world: &World) -> Result<impl Iterator<Item = Result<Event>> + Send + use<>> {
    let mut cloths = cloths_of(scene, world, true, settings)?;
    let steps = std::iter::from_fn(move || cloths.as_mut()?.0.next_step());
    Ok(steps.filter_map(|step| match step {
        Ok(Step::Told(Told::Event(event))) => Some(Ok(event)),
        Ok(Step::Told(Told::Sliding(_) | Told::Restart(_))) => None,
        Ok(Step::Settled(time_s)) => Some(Ok(Event::Quiet(time_s))),
        Err(fault) => Some(Err(fault)),
    }))
}

/// Of a cloth that buckles more often than this only a part of its energies is kept.
const MOST_ENERGIES: usize = 1 << 16;

/// Energies as they come in: all of them, and of very many every so manieth, the least and the greatest.
#[derive(Debug, Clone, Default)]
struct Energies {
    kept: Vec<f64>,
    count: u64,
    /// One in 2 to the power of this is kept.
    thinned: u32,
    extremes: Option<[f64; 2]>,
}

impl Energies {
    fn push(&mut self, energy_mps: f64) {
        let [least, greatest] = self.extremes.unwrap_or([energy_mps; 2]);
        self.extremes = Some([least.min(energy_mps), greatest.max(energy_mps)]);
        if self.kept.len() == MOST_ENERGIES {
            let mut index = 0;
            self.kept.retain(|_| {
                index += 1;
                index % 2 == 1
            });
            self.thinned += 1;
        }
        if self.count.is_multiple_of(1 << self.thinned) {
            self.kept.push(energy_mps);
        }
        self.count += 1;
    }

    fn finish(mut self) -> Vec<f64> {
        if self.thinned > 0 {
            self.kept.extend(self.extremes.into_iter().flatten());
        }
        self.kept
    }
}

/// The energies of the buckles of each cloth of a scene, by its name: what those of recorded pops are held against. Of
/// very many it is a part that is spread as they are.
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
    let mut energies: BTreeMap<String, Energies> = BTreeMap::new();
    for told in cloths_of(scene, world, false, buckles_alone)?.into_iter().flatten() {
        if let Told::Event(Event::Buckle(buckle)) = told? {
            energies.entry(buckle.cloth).or_default().push(buckle.energy_mps);
        }
    }
    Ok(energies.into_iter().map(|(cloth, energies)| (cloth, energies.finish())).collect())
}

impl Iterator for MovingCloth {
    type Item = Result<Told>;

    fn next(&mut self) -> Option<Self::Item> {
        self.0.next()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn very_many_energies_are_thinned_and_spread_as_before() {
        let energy = |i: u64| ((i * 7919) % 1_000_003) as f64;
        let run = |count: u64| {
            let mut energies = Energies::default();
            (0..count).for_each(|i| energies.push(energy(i)));
            energies.finish()
        };
        assert_eq!(run(1000), (0..1000).map(energy).collect::<Vec<_>>());
        let mut kept = run(1_000_003);
        assert!(kept.len() <= MOST_ENERGIES + 2 && kept.len() > MOST_ENERGIES / 2);
        kept.sort_by(f64::total_cmp);
        assert_eq!((kept[0], kept[kept.len() - 1]), (0.0, 1_000_002.0));
        for part in [0.1, 0.5, 0.9] {
            let found = kept[(part * kept.len() as f64) as usize];
            assert!((found / 1_000_003.0 - part).abs() < 0.01, "{part}: {found}");
        }
    }
}
