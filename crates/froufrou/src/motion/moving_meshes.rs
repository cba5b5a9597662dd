//! Meshes of a scene, fed to an analyser frame by frame.

use std::path::PathBuf;
use std::sync::Arc;

use rayon::prelude::*;

use crate::scene::Scene;
use crate::scene::animation::{Mesh, Topology};
use crate::scene::carrier::Carrier;
use crate::scene::fed::{Fed, FedPose};
use crate::scene::file::Material;
use crate::scene::world::World;
use crate::{Error, Place, Result};

/// What looks at meshes.
pub(super) trait Analyse {
    /// What it tells.
    type Told;

    /// Takes the next frame: its time, and the mesh of each object in their order.
    fn feed(&mut self, time_s: f64, meshes: &[Mesh]) -> Result<()>;

    /// What is ready, one after the other.
    fn told(&mut self) -> Option<Self::Told>;

    /// Nothing that is still to be told happens before this, in seconds, once all that is ready has been told.
    fn settled_s(&self) -> f64;

    /// Ends it: what was not settled is ready then.
    fn finish(&mut self);
}

/// What is told, and how far all is told.
pub(super) enum Step<T> {
    /// This.
    Told(T),
    /// Nothing that is still to be told happens before this, in seconds.
    Settled(f64),
}

/// Frames of some objects. It ends after its first error.
///
/// Frames are those of the leading object with the most of them; other meshes are asked where they are then. It holds
/// what its analyser holds, and one frame of all meshes.
pub(super) struct MovingMeshes<A> {
    pub analyser: A,
    pub carriers: Vec<Carrier>,
    /// The carrier whose frames are taken.
    leading: usize,
    next_s: Option<f64>,
    meshes: Vec<Mesh>,
    file: PathBuf,
    /// Whether a frame was taken since it was said how far all is told.
    is_new: bool,
    over: bool,
}

impl<A: Analyse> MovingMeshes<A> {
    /// Begins with what carries the meshes of objects, each with its name and whether it may lead; `file` is the
    /// scene, which messages name, and `what` they are looked at for.
    ///
    /// # Errors
    /// An object without a mesh.
    pub fn new(
        analyser: A,
        carriers: Vec<Carrier>,
        objects: &[(String, bool)],
        file: PathBuf,
        what: &str,
    ) -> Result<Self> {
        let none = carriers.iter().position(|carrier| carrier.topology() == Topology::None);
        if let Some((name, _)) = none.and_then(|index| objects.get(index)) {
            return Err(Error::new(format!("{what} cannot touch it: it has no mesh"))
                .at(Place::Part(name.clone()))
                .in_file(file));
        }
        let may_lead = objects.iter().zip(&carriers).enumerate().filter(|(_, ((_, leads), _))| *leads);
        let counts = may_lead.map(|(index, (_, carrier))| (index, carrier.key_count()));
        // Of those with as many the first.
        let leading = counts.max_by_key(|&(index, count)| (count, std::cmp::Reverse(index)));
        let leading = leading.map(|(index, _)| index);
        let first = |index: usize| carriers.get(index)?.next_key_s(f64::MIN);
        Ok(Self {
            analyser,
            next_s: leading.and_then(first),
            leading: leading.unwrap_or_default(),
            meshes: vec![Mesh::default(); carriers.len()],
            carriers,
            file,
            is_new: false,
            over: false,
        })
    }

    /// Feeds a frame of all meshes as they are at a time, which is after that of the one before.
    ///
    /// # Errors
    /// A mesh that cannot be read, or that the analyser refuses.
    pub fn frame(&mut self, time_s: f64) -> Result<()> {
        let read = |(carrier, mesh): (&Carrier, &mut Mesh)| carrier.mesh(time_s, mesh);
        let read: Vec<Result<()>> = self.carriers.par_iter().zip(&mut self.meshes).map(read).collect();
        read.into_iter().collect::<Result<()>>()?;
        self.analyser.feed(time_s, &self.meshes)
    }

    /// Another carrier takes the place of that of an object, or comes behind the last.
    pub fn replace(&mut self, object: usize, carrier: Carrier) {
        match self.carriers.get_mut(object) {
            Some(known) => *known = carrier,
            None => {
                self.carriers.push(carrier);
                self.meshes.push(Mesh::default());
            }
        }
    }

    /// Feeds the next frame.
    fn step(&mut self) -> Result<()> {
        let Some(time_s) = self.next_s else {
            self.over = true;
            self.analyser.finish();
            return Ok(());
        };
        self.frame(time_s)?;
        self.next_s = self.carriers[self.leading].next_key_s(time_s);
        self.is_new = true;
        Ok(())
    }

    /// The next that is told, and after each frame how far all is told.
    pub fn next_step(&mut self) -> Option<Result<Step<A::Told>>> {
        loop {
            if let Some(told) = self.analyser.told() {
                return Some(Ok(Step::Told(told)));
            }
            if self.over {
                return None;
            }
            if std::mem::take(&mut self.is_new) {
                return Some(Ok(Step::Settled(self.analyser.settled_s())));
            }
            if let Err(fault) = self.step() {
                self.over = true;
                return Some(Err(fault.in_file(self.file.clone())));
            }
        }
    }
}

impl<A: Analyse> Iterator for MovingMeshes<A> {
    type Item = Result<A::Told>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            match self.next_step()? {
                Ok(Step::Told(told)) => return Some(Ok(told)),
                Ok(Step::Settled(_)) => {}
                Err(fault) => return Some(Err(fault)),
            }
        }
    }
}

/// How hard the vertices of an object press: what its file calls that.
pub(super) struct Force {
    pub object: u32,
    pub attribute: String,
    pub carrier: Carrier,
}

impl Force {
    /// The forces at a time, in newtons, one for each vertex.
    ///
    /// # Errors
    /// A file that has none by this name, or that cannot be read.
    pub fn read(&self, time_s: f64, force_n: &mut Vec<f32>) -> Result<()> {
        self.carrier.vertex_values(&self.attribute, time_s, force_n)
    }
}

/// Something in a scene that has a mesh.
#[derive(Clone)]
pub(crate) struct WithMesh<'a> {
    pub name: &'a str,
    pub carrier: Carrier,
    pub material: Option<&'a Material>,
}

impl WithMesh<'_> {
    /// What is not there: a mesh of nothing, which keeps its number.
    pub fn nothing() -> Result<Self> {
        let fed = Fed::with_mesh(FedPose::at([0.0; 3]), Mesh::default())?;
        Ok(Self { name: "", carrier: Carrier::fed(Arc::new(fed), 1.0), material: None })
    }
}

/// Whether any of the meshes is told as it moves: then all are looked at in the frames that are told.
pub(super) fn are_told(bodies: &[WithMesh<'_>]) -> bool {
    bodies.iter().any(|body| body.carrier.is_fed())
}

/// All that has a mesh in a scene; swarms are left out.
///
/// # Errors
/// An object whose material is `of` a kind that needs a mesh, and has none; `what` that is.
pub(crate) fn with_meshes<'a>(
    scene: &'a Scene,
    world: &'a World,
    what: &str,
    of: impl Fn(&Material) -> bool,
) -> Result<Vec<WithMesh<'a>>> {
    let mut found = Vec::new();
    for (object, members) in scene.objects.iter().zip(&world.objects) {
        let material = object.material.and_then(|index| scene.materials.get(index));
        for member in members {
            let carrier = member.carrier.as_ref().filter(|_| object.swarm.is_none());
            let carrier = carrier.filter(|carrier| carrier.topology() != Topology::None);
            if carrier.is_none() && material.is_some_and(&of) {
                return Err(Error::new(format!("it is of {what} and has no mesh"))
                    .at(Place::Part(member.name.clone()))
                    .in_file(&scene.file)
                    .help("give it a `source` that names a mesh"));
            }
            let body =
                |carrier: &Carrier| WithMesh { name: &member.name, carrier: carrier.clone(), material };
            found.extend(carrier.map(body));
        }
    }
    Ok(found)
}
