//! The meshes of all objects, frame by frame: whether a frame can be taken, and what of it changes its faces.

use std::collections::BTreeSet;

use rayon::prelude::*;

use super::proximity::Touchable;
use super::{Restart, Why};
use crate::scene::animation::Mesh;
use crate::{Error, Place, Result};

/// A welded seam that opens by this part of an edge is one no more.
const TORN: f64 = 0.01;

/// The objects of an analyser as they lie now.
#[derive(Debug, Clone)]
pub(in crate::motion) struct Meshes {
    names: Vec<String>,
    /// Empty before the first frame.
    objects: Vec<Touchable>,
    faces: Vec<Faces>,
    /// Which of them are others from the next frame on.
    replaced: BTreeSet<usize>,
    last_s: Option<f64>,
}

/// The faces of a mesh as they were given, to know when they change.
#[derive(Debug, Clone, Default)]
pub(in crate::motion) struct Faces {
    pub vertices: Vec<u32>,
    pub sizes: Vec<u32>,
    torn_m: f64,
}

/// An object whose faces change, as it is from now on.
#[derive(Debug)]
pub(in crate::motion) struct Change {
    pub why: Why,
    pub object: Touchable,
    faces: Faces,
}

impl Meshes {
    /// Begins with nothing known of objects of these names.
    pub fn new(names: Vec<String>) -> Self {
        Self { names, objects: Vec::new(), faces: Vec::new(), replaced: BTreeSet::new(), last_s: None }
    }

    /// Another object takes the place of one, or comes behind the last: it changes its faces with the next frame, whatever
    /// they are.
    pub fn replace(&mut self, object: usize, name: String) {
        match self.names.get_mut(object) {
            Some(known) => *known = name,
            None => self.names.push(name),
        }
        self.replaced.insert(object);
    }

    /// The objects as they lie now; none before the first frame.
    pub fn objects(&self) -> &[Touchable] {
        &self.objects
    }

    /// The faces of an object as they were given.
    pub fn faces(&self, object: u32) -> Option<&Faces> {
        self.faces.get(object as usize)
    }

    /// The name of an object.
    pub fn name(&self, object: u32) -> String {
        self.names[object as usize].clone()
    }

    /// The time of the last frame, in seconds.
    pub fn last_s(&self) -> Option<f64> {
        self.last_s
    }

    /// Forgets all frames.
    pub fn clear(&mut self) {
        self.objects.clear();
        self.faces.clear();
        self.last_s = None;
    }

    /// Looks at the next frame and changes nothing: which of the objects change their faces, if there was a frame
    /// before.
    ///
    /// # Errors
    /// Another number of meshes than of objects; a time that is no number or not after that of the frame before; a
    /// position that is no number; faces that are none.
    pub fn look(&self, time_s: f64, meshes: &[Mesh]) -> Result<Vec<Option<Change>>> {
        self.check(time_s, meshes)?;
        let why = |object: usize| {
            let (Some(faces), Some(known)) = (self.faces.get(object), self.objects.get(object)) else {
                return Some(Why::Faces);
            };
            let mesh = &meshes[object];
            if self.replaced.contains(&object)
                || mesh.positions.len() != known.positions().len()
                || mesh.face_vertices != faces.vertices
                || mesh.face_sizes != faces.sizes
            {
                return Some(Why::Faces);
            }
            known.surface().torn(&mesh.positions, faces.torn_m).map(|_| Why::Seam)
        };
        let take = |object: usize| why(object).map(|why| self.take(object, &meshes[object], why)).transpose();
        (0..meshes.len()).into_par_iter().map(take).collect()
    }

    /// Takes the frame that was looked at.
    ///
    /// # Errors
    /// None, if the changes are those of the frame.
    pub fn follow(&mut self, time_s: f64, meshes: &[Mesh], changes: Vec<Option<Change>>) -> Result<()> {
        self.last_s = Some(time_s);
        self.replaced.clear();
        let objects = self.objects.par_iter_mut().zip(meshes).zip(&changes);
        objects
            .filter(|(_, change)| change.is_none())
            .try_for_each(|((object, mesh), _)| object.follow(&mesh.positions))?;
        for (object, change) in changes.into_iter().enumerate() {
            let Some(Change { object: touchable, faces, .. }) = change else { continue };
            if object < self.objects.len() {
                (self.objects[object], self.faces[object]) = (touchable, faces);
            } else {
                self.objects.push(touchable);
                self.faces.push(faces);
            }
        }
        Ok(())
    }

    /// What is told of changes.
    pub fn restarts(&self, time_s: f64, changes: &[Option<Change>]) -> Vec<Restart> {
        if self.objects.is_empty() {
            return Vec::new();
        }
        let all = changes.iter().enumerate();
        all.filter_map(|(object, change)| {
            change.as_ref().map(|change| Restart { time_s, object: object as u32, why: change.why })
        })
        .collect()
    }

    fn check(&self, time_s: f64, meshes: &[Mesh]) -> Result<()> {
        if meshes.len() != self.names.len() {
            let (given, expected) = (meshes.len(), self.names.len());
            return Err(Error::new(format!("a frame of {given} meshes, of {expected} objects")));
        }
        if !time_s.is_finite() || self.last_s.is_some_and(|last_s| time_s <= last_s) {
            let last = self.last_s.map_or_else(String::new, |last_s| format!(" after one at {last_s} s"));
            return Err(
                Error::new(format!("a frame at {time_s} s{last}")).help("frames come in order of time")
            );
        }
        let finite = |(mesh, name): (&Mesh, &String)| {
            let Some(vertex) = mesh.positions.iter().position(|p| !p.iter().all(|c| c.is_finite())) else {
                return Ok(());
            };
            let [x, y, z] = mesh.positions[vertex];
            Err(Error::new(format!("vertex {vertex} is at no place at {time_s} s: ({x}, {y}, {z})"))
                .at(Place::Part(name.clone())))
        };
        meshes.par_iter().zip(&self.names).map(finite).collect()
    }

    /// Takes up an object as it lies in a frame.
    fn take(&self, object: usize, mesh: &Mesh, why: Why) -> Result<Change> {
        let at_object = |fault: Error| fault.at(Place::Part(self.names[object].clone()));
        let touchable = Touchable::new(mesh).map_err(at_object)?;
        let torn_m = TORN * touchable.surface().mean_edge_m(&mesh.positions);
        let faces = Faces { vertices: mesh.face_vertices.clone(), sizes: mesh.face_sizes.clone(), torn_m };
        Ok(Change { why, object: touchable, faces })
    }
}
