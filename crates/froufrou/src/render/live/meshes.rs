//! Meshes that are told frame by frame, and the cloths and sheets of paper among them.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
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

/// What looks at the frames of meshes that are told.
///
/// Where the meshes of objects of the scene are told, all its cloths and papers are looked at in the frames that are told;
/// else those of the scene go by the frames of their files, and only what appeared is looked at here, from the first frame
/// of its mesh that is told. What comes, goes or becomes of another material is looked at anew, and nothing else.
pub(super) struct Meshes {
    there: There,
    cloths: Option<MovingCloth>,
    papers: Option<MovingPaper>,
    /// What takes part, by the number that it has for both; none where it does no more.
    numbered: Vec<Option<String>>,
    /// What takes part since the last frame, does no more, or is of another material.
    changed: BTreeSet<String>,
    /// Whether looking begins anew with the next frame.
    is_stale: bool,
    /// Times of frames that were told and not looked at, ascending.
    frames_s: Vec<f64>,
    last_s: f64,
    /// What was found, and whether it is cloth that told it, until somebody asks.
    found: VecDeque<(Event, bool)>,
}

/// What there is.
struct There {
    scene: Arc<Scene>,
    world: Arc<World>,
    /// Keys of what is told to move are so far apart, in seconds.
    step_s: f64,
    /// The names of what has a mesh in the scene.
    own: BTreeSet<String>,
    /// Whether the meshes of objects of the scene are told.
    has_own: bool,
    presence: Presence,
}

impl There {
    /// Whether something takes part: it has a mesh that cloth and paper may touch, or is of them.
    fn takes_part(&self, name: &str) -> bool {
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
    fn material_of(&self, name: &str) -> Option<&Material> {
        let is_here = self.has_own || self.presence.appeared(name).is_some();
        let object = self.index_of(name).filter(|_| is_here)?;
        self.presence.material(name, &self.scene, object)
    }

    /// Whether something is of cloth or paper; what is of neither is there to be touched, whatever it is of.
    fn is_looked_at(&self, name: &str) -> bool {
        self.material_of(name).is_some_and(|material| material.cloth.is_some() || material.paper.is_some())
    }

    /// All that takes part, by name.
    fn parts(&self) -> Result<BTreeMap<&str, WithMesh<'_>>> {
        let own = with_meshes(&self.scene, &self.world, "", |_| false)?.into_iter();
        let own =
            own.filter(|body| self.presence.appeared(body.name).is_none() && self.takes_part(body.name));
        let own = own.map(|body| (body.name, body.carrier));
        let told = self.presence.all_appeared().filter(|(_, appeared)| appeared.fed.is_mesh_told());
        let told = told.map(|(name, appeared)| (name, Carrier::fed(appeared.fed.clone(), self.step_s)));
        let part = |(name, carrier)| (name, WithMesh { name, carrier, material: self.material_of(name) });
        Ok(own.chain(told).map(part).collect())
    }
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
            there: There { scene, world, step_s, own, has_own, presence: Presence::default() },
            cloths: None,
            papers: None,
            numbered: Vec::new(),
            changed: BTreeSet::new(),
            is_stale: true,
            frames_s: Vec::new(),
            last_s: f64::NEG_INFINITY,
            found: VecDeque::new(),
        })
    }

    /// Whether something takes part, by its name: it has a mesh that cloth and paper may touch, or is of them.
    pub fn takes_part(&self, name: &str) -> bool {
        self.there.takes_part(name)
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
        if is_first {
            let is_it = |(_, appeared): &(&str, &Appeared)| Arc::ptr_eq(&appeared.fed, fed);
            let appeared = self.there.presence.all_appeared().find(is_it);
            self.changed.extend(appeared.map(|(name, _)| name.to_owned()));
        }
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
        let There { scene, world, presence, .. } = &mut self.there;
        let Some(index) = scene.objects.iter().position(|object| object.name == kind) else {
            return Err(Error::new(format!("there is no object `{kind}` to be as")).in_file(&scene.file));
        };
        let body = world.objects.get(index).and_then(|bodies| bodies.first());
        let carrier = body.and_then(|body| body.carrier.clone());
        let fed = Arc::new(carrier.unwrap_or_else(|| Carrier::still([0.0; 3])).appearing(time_s, pose)?);
        presence.appear(name, index, fed.clone());
        Ok(fed)
    }

    /// Something vanishes.
    pub fn vanish(&mut self, name: &str) {
        if self.there.takes_part(name) {
            self.changed.insert(name.to_owned());
        }
        let is_of_scene = self.there.index_of(name).is_some();
        self.there.presence.vanish(name, is_of_scene);
    }

    /// Something becomes of another material.
    pub fn material(&mut self, name: &str, material: &str) {
        let known = self.there.scene.materials.iter().position(|known| known.name == material);
        let Some(index) = known else { return };
        let was_looked_at = self.there.is_looked_at(name);
        self.there.presence.become_of(name, index);
        if self.there.takes_part(name) && (was_looked_at || self.there.is_looked_at(name)) {
            self.changed.insert(name.to_owned());
        }
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
        if std::mem::take(&mut self.is_stale) {
            self.begin_anew();
        }
        let changed = std::mem::take(&mut self.changed);
        if !changed.is_empty() {
            self.follow(changed)?;
        }
        let cloths = self.cloths.as_mut().map_or(Ok(()), |cloths| cloths.frame(time_s));
        let papers = self.papers.as_mut().map_or(Ok(()), |papers| papers.frame(time_s));
        self.take_found();
        cloths.and(papers)
    }

    /// Forgets all that was seen; what was not settled of it is told.
    fn begin_anew(&mut self) {
        self.cloths.iter_mut().for_each(MovingCloth::finish);
        self.take_found();
        (self.cloths, self.papers) = (None, None);
        self.numbered.clear();
        let There { own, presence, .. } = &self.there;
        self.changed = own.iter().cloned().collect();
        self.changed.extend(presence.all_appeared().map(|(name, _)| name.to_owned()));
    }

    /// Looks at what takes part from now on, and no more at what does not: others are followed as before.
    fn follow(&mut self, changed: BTreeSet<String>) -> Result<()> {
        let parts = self.there.parts()?;
        for name in changed {
            let part = parts.get(name.as_str());
            let known = self.numbered.iter().position(|known| known.as_ref() == Some(&name));
            let vacant = || self.numbered.iter().position(Option::is_none);
            let number = match (known, part) {
                (Some(number), _) => number,
                (None, Some(_)) => vacant().unwrap_or(self.numbered.len()),
                (None, None) => continue,
            };
            self.numbered.resize(self.numbered.len().max(number + 1), None);
            self.numbered[number] = part.is_some().then_some(name);
            let body = || part.cloned().map_or_else(WithMesh::nothing, Ok);
            if let Some(cloths) = &mut self.cloths {
                cloths.replace(number, body()?);
            }
            if let Some(papers) = &mut self.papers {
                papers.replace(number, body()?)?;
            }
        }
        let bodies = || {
            let body = |name: &Option<String>| match name.as_ref().and_then(|name| parts.get(name.as_str())) {
                Some(body) => Ok(body.clone()),
                None => WithMesh::nothing(),
            };
            self.numbered.iter().map(body).collect::<Result<Vec<_>>>()
        };
        // Where nothing is of them, or was until now.
        if self.cloths.as_ref().is_none_or(|cloths| !cloths.is_any()) {
            self.cloths = moving_cloth::told(&self.there.scene, bodies()?)?;
        }
        if self.papers.as_ref().is_none_or(|papers| !papers.is_any()) {
            self.papers = moving_paper::told(&self.there.scene, bodies()?)?;
        }
        Ok(())
    }

    fn take_found(&mut self) {
        let cloth = std::iter::from_fn(|| self.cloths.as_mut()?.event());
        self.found.extend(cloth.map(|event| (event, true)));
        let paper = std::iter::from_fn(|| self.papers.as_mut()?.event());
        self.found.extend(paper.map(|event| (event, false)));
    }

    /// What happened in the frames that were looked at, and whether it is cloth that tells it.
    pub fn event(&mut self) -> Option<(Event, bool)> {
        self.found.pop_front()
    }
}
