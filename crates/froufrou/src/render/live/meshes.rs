//! Meshes that are told frame by frame, and the cloths and sheets of paper among them.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use crate::motion::event::Event;
use crate::motion::moving_cloth::{self, MovingCloth};
use crate::motion::moving_meshes::{WithMesh, with_meshes};
use crate::motion::moving_paper::{self, MovingPaper};
use crate::scene::Scene;
use crate::scene::animation::Topology;
use crate::scene::carrier::Carrier;
use crate::scene::fed::{Fed, FedPose};
use crate::scene::world::World;
use crate::{Error, Result};

/// What is known of what has a mesh, and what looks at it.
///
/// Where the meshes of objects of the scene are told, all its cloths and papers are looked at in the frames that are told;
/// else those of the scene go by the frames of their files, and only what appeared is looked at here. After something
/// appeared, vanished or became of another material, looking begins anew.
pub(super) struct Meshes {
    scene: Arc<Scene>,
    world: Arc<World>,
    /// Keys of what is told to move are so far apart, in seconds.
    step_s: f64,
    /// Whether the meshes of objects of the scene are told.
    has_own: bool,
    /// What appeared, by its name: the object of the scene that it is as, what carries it, and whether it has a mesh of which a
    /// frame was told.
    appeared: BTreeMap<String, (usize, Arc<Fed>, bool)>,
    gone: BTreeSet<String>,
    /// Materials that are not those of the scene, by the name of what is of them.
    materials: BTreeMap<String, usize>,
    cloths: Option<MovingCloth>,
    papers: Option<MovingPaper>,
    is_stale: bool,
    /// Times of frames that were told and not looked at, ascending.
    frames_s: Vec<f64>,
    last_s: f64,
}

impl Meshes {
    pub fn new(scene: Arc<Scene>, world: Arc<World>, step_s: f64) -> Self {
        let is_fed = |carrier: &Carrier| carrier.is_fed() && carrier.topology() != Topology::None;
        let has_own = world.objects.iter().flatten().any(|body| body.carrier.as_ref().is_some_and(is_fed));
        Self {
            scene,
            world,
            step_s,
            has_own,
            appeared: BTreeMap::new(),
            gone: BTreeSet::new(),
            materials: BTreeMap::new(),
            cloths: None,
            papers: None,
            is_stale: true,
            frames_s: Vec::new(),
            last_s: f64::NEG_INFINITY,
        }
    }

    /// A frame of a mesh was told.
    pub fn told(&mut self, fed: &Arc<Fed>, time_s: f64) {
        if let Some((.., is_told)) = self.appeared.values_mut().find(|(_, own, _)| Arc::ptr_eq(own, fed)) {
            self.is_stale |= !std::mem::replace(is_told, true);
        }
        if time_s > self.last_s
            && let Err(at) = self.frames_s.binary_search_by(|frame_s| frame_s.total_cmp(&time_s))
        {
            self.frames_s.insert(at, time_s);
        }
    }

    /// Something appears that is as an object of the scene. Until it is told otherwise it stands in a pose.
    ///
    /// # Errors
    /// No such object; a mesh of it that cannot be read.
    pub fn appear(&mut self, name: &str, kind: &str, pose: FedPose) -> Result<Arc<Fed>> {
        let kind_of = |object: &crate::scene::file::Object| object.name == kind;
        let Some(index) = self.scene.objects.iter().position(kind_of) else {
            return Err(Error::new(format!("there is no object `{kind}` to be as")).in_file(&self.scene.file));
        };
        let body = self.world.objects.get(index).and_then(|bodies| bodies.first());
        let carrier = body.and_then(|body| body.carrier.as_ref());
        let fed = match carrier.filter(|carrier| carrier.topology() != Topology::None) {
            Some(carrier) => {
                let mut rest = crate::scene::animation::Mesh::default();
                carrier.mesh(0.0, &mut rest)?;
                Fed::with_mesh(pose, rest)?
            }
            None => Fed::new(pose),
        };
        let fed = Arc::new(fed);
        self.gone.remove(name);
        self.is_stale |= carrier.is_some_and(|carrier| carrier.topology() != Topology::None);
        self.appeared.insert(name.to_owned(), (index, fed.clone(), false));
        Ok(fed)
    }

    /// Something vanishes.
    pub fn vanish(&mut self, name: &str) {
        let has_mesh = self.appeared.remove(name).map(|(_, fed, _)| fed.has_mesh());
        self.materials.remove(name);
        if has_mesh.is_none() && self.is_of_scene(name) {
            self.gone.insert(name.to_owned());
        }
        self.is_stale |= has_mesh.unwrap_or(true);
    }

    /// Something becomes of another material.
    pub fn material(&mut self, name: &str, material: &str) {
        if let Some(index) = self.scene.materials.iter().position(|known| known.name == material) {
            self.materials.insert(name.to_owned(), index);
            self.is_stale = true;
        }
    }

    fn is_of_scene(&self, name: &str) -> bool {
        self.world.objects.iter().flatten().any(|body| body.name == name)
    }

    /// What there is now with a mesh.
    fn present(&self) -> Result<Vec<WithMesh<'_>>> {
        let Self { scene, world, step_s, has_own, appeared, gone, materials, .. } = self;
        let own = with_meshes(scene, world, "", |_| false)?;
        let own =
            own.into_iter().filter(|body| !gone.contains(body.name) && !appeared.contains_key(body.name));
        let own = own.map(|body| {
            let other = materials.get(body.name).and_then(|&index| scene.materials.get(index));
            WithMesh { material: other.or(body.material).filter(|_| *has_own), ..body }
        });
        let told = appeared.iter().filter(|(_, (_, _, is_told))| *is_told);
        let told = told.map(|(name, (index, fed, _))| {
            let of = materials.get(name).copied().or(scene.objects[*index].material);
            let material = of.and_then(|index| scene.materials.get(index));
            WithMesh { name, carrier: Carrier::fed(fed.clone(), *step_s), material }
        });
        Ok(own.chain(told).collect())
    }

    /// Looks at the frames that were told up to a time.
    ///
    /// # Errors
    /// A mesh that is none; looking begins anew then.
    pub fn look(&mut self, time_s: f64) -> Result<()> {
        let due = self.frames_s.partition_point(|frame_s| *frame_s <= time_s);
        let frames: Vec<f64> = self.frames_s.drain(..due).collect();
        for frame_s in frames {
            self.last_s = frame_s;
            if std::mem::take(&mut self.is_stale) {
                self.cloths = moving_cloth::told(&self.scene, self.present()?)?;
                self.papers = moving_paper::told(&self.scene, self.present()?)?;
            }
            let cloths = self.cloths.as_mut().map_or(Ok(()), |cloths| cloths.frame(frame_s));
            let papers = self.papers.as_mut().map_or(Ok(()), |papers| papers.frame(frame_s));
            if let Err(fault) = cloths.and(papers) {
                self.is_stale = true;
                return Err(fault);
            }
        }
        Ok(())
    }

    /// What happened in those frames, and whether it is cloth that tells it.
    pub fn event(&mut self) -> Option<(Event, bool)> {
        let cloth = self.cloths.as_mut().and_then(MovingCloth::event).map(|event| (event, true));
        cloth.or_else(|| Some((self.papers.as_mut()?.event()?, false)))
    }
}
