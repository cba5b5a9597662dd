//! The meshes of a scene frame by frame, for what is found from how they move.

use std::cmp::Reverse;
use std::path::PathBuf;

use rayon::prelude::*;

use crate::scene::Scene;
use crate::scene::animation::{Mesh, Topology};
use crate::scene::file::Material;
use crate::scene::world::{Carrier, World};
use crate::{Error, Place, Result};

/// The meshes of some objects, frame by frame. Frames are those of the leading object with the most of them; other
/// meshes are asked where they are then.
#[derive(Clone)]
pub(super) struct MeshFrames {
    carriers: Vec<Carrier>,
    /// The carrier whose frames are taken.
    leading: usize,
    next_s: Option<f64>,
    meshes: Vec<Mesh>,
    /// The scene, which messages name.
    pub file: PathBuf,
}

impl MeshFrames {
    /// Of objects by their names, what carries them, and whether they may lead; `what` touches them all.
    ///
    /// # Errors
    /// An object without a mesh.
    pub fn new<'a>(
        what: &str,
        bodies: impl IntoIterator<Item = (&'a str, Carrier, bool)>,
        file: PathBuf,
    ) -> Result<Self> {
        let (mut carriers, mut leads) = (Vec::new(), Vec::new());
        for (name, carrier, may_lead) in bodies {
            if carrier.topology() == Topology::None {
                return Err(Error::new(format!("{what} cannot touch it: it has no mesh"))
                    .at(Place::Part(name.to_owned()))
                    .in_file(file));
            }
            // Of those with as many the first.
            leads.extend(may_lead.then(|| (carrier.key_count(), Reverse(carriers.len()))));
            carriers.push(carrier);
        }
        let leading = leads.iter().max().map(|(_, Reverse(index))| *index);
        let first = |index: usize| carriers[index].next_key_s(f64::MIN);
        Ok(Self {
            next_s: leading.and_then(first),
            leading: leading.unwrap_or_default(),
            meshes: vec![Mesh::default(); carriers.len()],
            carriers,
            file,
        })
    }

    /// Reads the next frame, and tells its time; nothing after the last.
    ///
    /// # Errors
    /// What cannot be read.
    pub fn advance(&mut self) -> Result<Option<f64>> {
        let Some(time_s) = self.next_s else { return Ok(None) };
        let read = |(carrier, mesh): (&Carrier, &mut Mesh)| carrier.mesh(time_s, mesh);
        let read: Vec<Result<()>> = self.carriers.par_iter().zip(&mut self.meshes).map(read).collect();
        read.into_iter().collect::<Result<()>>()?;
        self.next_s = self.carriers[self.leading].next_key_s(time_s);
        Ok(Some(time_s))
    }

    /// The meshes of the frame that was read last.
    pub fn meshes(&self) -> &[Mesh] {
        &self.meshes
    }

    /// What carries an object.
    pub fn carrier(&self, object: u32) -> &Carrier {
        &self.carriers[object as usize]
    }
}

/// Something in a scene that has a mesh.
pub(super) struct Body<'a> {
    pub name: &'a str,
    pub carrier: Carrier,
    pub material: Option<&'a Material>,
}

/// All that has a mesh in a scene; swarms are left out.
///
/// # Errors
/// An object whose material is `of` a kind that needs a mesh, and has none; `what` that is.
pub(super) fn bodies<'a>(
    scene: &'a Scene,
    world: &'a World,
    what: &str,
    of: impl Fn(&Material) -> bool,
) -> Result<Vec<Body<'a>>> {
    let mut bodies = Vec::new();
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
            let body = |carrier: &Carrier| Body { name: &member.name, carrier: carrier.clone(), material };
            bodies.extend(carrier.map(body));
        }
    }
    Ok(bodies)
}
