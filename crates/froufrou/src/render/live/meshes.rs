//! Meshes that are told frame by frame, and the cloths and sheets of paper among them.

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;

use crate::motion::event::Event;
use crate::motion::moving_cloth::{self, MovingCloth};
use crate::motion::moving_meshes::{WithMesh, with_meshes};
use crate::motion::moving_paper::{self, MovingPaper};
use crate::scene::Scene;
use crate::scene::carrier::Carrier;
use crate::scene::fed::{Faces, Fed, FedPose};
use crate::scene::file::Material;
use crate::scene::presence::{Appeared, Presence};
use crate::scene::world::World;
use crate::{Error, Result};

/// What is known of what has a mesh, and what looks at it.
///
/// Where the meshes of objects of the scene are told, all its cloths and papers are looked at in the frames that are told;
/// else those of the scene go by the frames of their files, and only what appeared is looked at here, from the first frame
/// of its mesh that is told. After something that takes part appeared, vanished or became of another material, looking begins
/// anew.
pub(super) struct Meshes {
    scene: Arc<Scene>,
    world: Arc<World>,
    /// Keys of what is told to move are so far apart, in seconds.
    step_s: f64,
    /// The names of what has a mesh in the scene.
    own: BTreeSet<String>,
    /// Whether the meshes of objects of the scene are told.
    has_own: bool,
    presence: Presence,
    cloths: Option<MovingCloth>,
    papers: Option<MovingPaper>,
    is_stale: bool,
    /// Times of frames that were told and not looked at, ascending.
    frames_s: Vec<f64>,
    last_s: f64,
    /// What was found, and whether it is cloth that told it, until somebody asks.
    found: VecDeque<(Event, bool)>,
}

impl Meshes {
    /// Begins with nothing looked at.
    ///
    /// # Errors
    /// Those of [`with_meshes`].
    pub fn new(scene: Arc<Scene>, world: Arc<World>, step_s: f64) -> Result<Self> {
        let meshes = with_meshes(&scene, &world, "", |_| false)?;
        let has_own = meshes.iter().any(|body| body.carrier.is_fed());
        let own = meshes.into_iter().map(|body| body.name.to_owned()).collect();
        Ok(Self {
            scene,
            world,
            step_s,
            own,
            has_own,
            presence: Presence::default(),
            cloths: None,
            papers: None,
            is_stale: true,
            frames_s: Vec::new(),
            last_s: f64::NEG_INFINITY,
            found: VecDeque::new(),
        })
    }

    /// A frame of a mesh is told.
    ///
    /// # Errors
    /// Those of [`Fed::push_mesh`].
    pub fn tell(
        &mut self,
        fed: &Arc<Fed>,
        time_s: f64,
        positions: Arc<[[f32; 3]]>,
        faces: Option<Arc<Faces>>,
    ) -> Result<()> {
        let is_first = !fed.is_mesh_told();
        fed.push_mesh(time_s, positions, faces)?;
        let is_it = |(_, appeared): (&str, &Appeared)| Arc::ptr_eq(&appeared.fed, fed);
        self.is_stale |= is_first && self.presence.all_appeared().any(is_it);
        if time_s > self.last_s
            && let Err(at) = self.frames_s.binary_search_by(|frame_s| frame_s.total_cmp(&time_s))
        {
            self.frames_s.insert(at, time_s);
        }
        Ok(())
    }

    /// Something appears that is as an object of the scene. Until it is told otherwise it stands in a pose.
    ///
    /// # Errors
    /// No such object; a mesh of it that cannot be read.
    pub fn appear(&mut self, name: &str, kind: &str, time_s: f64, pose: FedPose) -> Result<Arc<Fed>> {
        let Some(index) = self.scene.objects.iter().position(|object| object.name == kind) else {
            return Err(Error::new(format!("there is no object `{kind}` to be as")).in_file(&self.scene.file));
        };
        let body = self.world.objects.get(index).and_then(|bodies| bodies.first());
        let carrier = body.and_then(|body| body.carrier.clone());
        let fed = Arc::new(carrier.unwrap_or_else(|| Carrier::still([0.0; 3])).appearing(time_s, pose)?);
        self.presence.appear(name, index, fed.clone());
        Ok(fed)
    }

    /// Something vanishes.
    pub fn vanish(&mut self, name: &str) {
        self.is_stale |= self.takes_part(name);
        self.presence.vanish(name, self.index_of(name).is_some());
    }

    /// Something becomes of another material.
    pub fn material(&mut self, name: &str, material: &str) {
        let Some(index) = self.scene.materials.iter().position(|known| known.name == material) else {
            return;
        };
        // What is of neither is something that they touch, whatever it is of.
        let is_looked_at = |meshes: &Self| {
            let of = meshes.index_of(name).and_then(|object| meshes.material_of(name, object));
            of.is_some_and(|material| material.cloth.is_some() || material.paper.is_some())
        };
        let was_looked_at = is_looked_at(self);
        self.presence.become_of(name, index);
        self.is_stale |= self.takes_part(name) && (was_looked_at || is_looked_at(self));
    }

    /// Whether something takes part: it has a mesh that cloth and paper may touch, or is of them.
    pub fn takes_part(&self, name: &str) -> bool {
        match self.presence.appeared(name) {
            Some(appeared) => appeared.fed.is_mesh_told(),
            None => self.own.contains(name) && !self.presence.is_gone(name),
        }
    }

    /// The object of the scene that something is, or is as.
    fn index_of(&self, name: &str) -> Option<usize> {
        let of_scene =
            || self.world.objects.iter().position(|bodies| bodies.iter().any(|body| body.name == name));
        self.presence.appeared(name).map(|appeared| appeared.kind).or_else(of_scene)
    }

    /// What something is of, as far as it is looked at here.
    fn material_of(&self, name: &str, object: usize) -> Option<&Material> {
        let is_here = self.has_own || self.presence.appeared(name).is_some();
        self.presence.material(name, &self.scene, object).filter(|_| is_here)
    }

    /// What there is now with a mesh.
    fn present(&self) -> Result<Vec<WithMesh<'_>>> {
        let own = with_meshes(&self.scene, &self.world, "", |_| false)?.into_iter();
        let own =
            own.filter(|body| self.presence.appeared(body.name).is_none() && self.takes_part(body.name));
        let own = own.map(|body| {
            let object = self.index_of(body.name);
            WithMesh { material: object.and_then(|object| self.material_of(body.name, object)), ..body }
        });
        let told = self.presence.all_appeared().filter(|(_, appeared)| appeared.fed.is_mesh_told());
        let told = told.map(|(name, appeared)| {
            let carrier = Carrier::fed(appeared.fed.clone(), self.step_s);
            WithMesh { name, carrier, material: self.material_of(name, appeared.kind) }
        });
        Ok(own.chain(told).collect())
    }

    /// Looks at the frames that were told up to a time.
    ///
    /// # Errors
    /// A mesh that is none; looking begins anew with the next frame then.
    pub fn look(&mut self, time_s: f64) -> Result<()> {
        let due = self.frames_s.partition_point(|frame_s| *frame_s <= time_s);
        let frames: Vec<f64> = self.frames_s.drain(..due).collect();
        let mut looked = Ok(());
        for frame_s in frames {
            self.last_s = frame_s;
            let frame = self.frame(frame_s);
            self.is_stale |= frame.is_err();
            looked = looked.and(frame);
        }
        looked
    }

    fn frame(&mut self, time_s: f64) -> Result<()> {
        if self.is_stale {
            self.begin_anew()?;
            self.is_stale = false;
        }
        let cloths = self.cloths.as_mut().map_or(Ok(()), |cloths| cloths.frame(time_s));
        let papers = self.papers.as_mut().map_or(Ok(()), |papers| papers.frame(time_s));
        while let Some(found) = self.next() {
            self.found.push_back(found);
        }
        cloths.and(papers)
    }

    /// Begins to look at what there is now. What was seen before and is not settled is told.
    fn begin_anew(&mut self) -> Result<()> {
        self.cloths.iter_mut().for_each(MovingCloth::finish);
        while let Some(found) = self.next() {
            self.found.push_back(found);
        }
        (self.cloths, self.papers) = (None, None);
        let cloths = moving_cloth::told(&self.scene, self.present()?)?;
        let papers = moving_paper::told(&self.scene, self.present()?)?;
        (self.cloths, self.papers) = (cloths, papers);
        Ok(())
    }

    fn next(&mut self) -> Option<(Event, bool)> {
        let cloth = self.cloths.as_mut().and_then(MovingCloth::event).map(|event| (event, true));
        cloth.or_else(|| Some((self.papers.as_mut()?.event()?, false)))
    }

    /// What happened in the frames that were looked at, and whether it is cloth that tells it.
    pub fn event(&mut self) -> Option<(Event, bool)> {
        self.found.pop_front()
    }
}
