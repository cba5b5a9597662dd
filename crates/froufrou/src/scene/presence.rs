//! What there is beside what a scene has from the beginning, and what of that is no more or of something else.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::fed::Fed;
use super::file::{Material, Scene};

/// What has changed since a scene was opened, by the names of what did.
#[derive(Default)]
pub(crate) struct Presence {
    appeared: BTreeMap<String, Appeared>,
    /// Objects of the scene that are no more.
    gone: BTreeSet<String>,
    /// Indices of materials that are not those of the scene.
    materials: BTreeMap<String, usize>,
    births: u64,
}

/// Something that appeared.
pub(crate) struct Appeared {
    /// The object that it is as.
    pub kind: usize,
    /// How it moves.
    pub fed: Arc<Fed>,
    /// How many appeared before it.
    pub number: u64,
}

impl Presence {
    /// Something appears that is as an object of the scene.
    pub fn appear(&mut self, name: &str, kind: usize, fed: Arc<Fed>) {
        let appeared = Appeared { kind, fed, number: self.births };
        self.births += 1;
        self.appeared.insert(name.to_owned(), appeared);
    }

    /// Something is no more: what appeared, or else what the scene has by that name.
    pub fn vanish(&mut self, name: &str, is_of_scene: bool) {
        self.materials.remove(name);
        if self.appeared.remove(name).is_none() && is_of_scene {
            self.gone.insert(name.to_owned());
        }
    }

    /// Something becomes of the material of an index.
    pub fn become_of(&mut self, name: &str, material: usize) {
        self.materials.insert(name.to_owned(), material);
    }

    /// What appeared by a name.
    pub fn appeared(&self, name: &str) -> Option<&Appeared> {
        self.appeared.get(name)
    }

    /// All that appeared, in order of its names.
    pub fn all_appeared(&self) -> impl Iterator<Item = (&str, &Appeared)> {
        self.appeared.iter().map(|(name, appeared)| (name.as_str(), appeared))
    }

    /// Whether what the scene has by a name is no more. Something else may have appeared by it.
    pub fn is_gone(&self, name: &str) -> bool {
        self.gone.contains(name)
    }

    /// What something is of, by the object of the scene that it is or is as.
    pub fn material<'s>(&self, name: &str, scene: &'s Scene, object: usize) -> Option<&'s Material> {
        let of = self.materials.get(name).copied();
        scene.materials.get(of.or(scene.objects.get(object)?.material)?)
    }
}
