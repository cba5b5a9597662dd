//! What there is: objects that appear and vanish while others sound, and what they are of.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::{Composer, Planned, line_at};
use crate::Result;
use crate::motion::event::{Becomes, Change, Event};
use crate::scene::carrier::Carrier;
use crate::scene::fed::Fed;
use crate::scene::file::{Emitter, Material};
use crate::score::LATEST_S;

/// What has changed since the scene was opened.
#[derive(Default)]
pub(super) struct Presence {
    appeared: BTreeMap<String, Appeared>,
    /// Objects of the scene that are no more.
    gone: BTreeSet<String>,
    /// Indices of materials that are not those of the scene.
    materials: BTreeMap<String, usize>,
    births: u64,
}

/// Something that appeared.
pub(super) struct Appeared {
    /// The object that it is as.
    pub kind: usize,
    fed: Arc<Fed>,
    /// How many appeared before it.
    pub number: u64,
}

impl Presence {
    pub fn appeared(&self, name: &str) -> Option<&Appeared> {
        self.appeared.get(name)
    }

    pub fn is_gone(&self, name: &str) -> bool {
        self.gone.contains(name)
    }
}

impl<'s, E: Iterator<Item = Result<Event>>> Composer<'s, E> {
    /// What something is of, by its name and the object that it is or is as.
    pub(super) fn material_of(&self, name: &str, index: usize) -> Option<&'s Material> {
        let other = self.presence.materials.get(name).copied();
        self.scene.materials.get(other.or(self.scene.objects[index].material)?)
    }

    /// What carries something that appeared.
    pub(super) fn carrier_of(&self, name: &str) -> Option<Carrier> {
        let Appeared { kind, fed, .. } = self.presence.appeared(name)?;
        Some(Carrier::fed(fed.clone(), self.beat_s).from_point(self.scene.objects[*kind].point))
    }

    /// Something appears, vanishes or becomes of something else.
    pub(super) fn change(&mut self, change: &Change) -> Result<()> {
        let Change { time_s, name, what } = change;
        match what {
            Becomes::There { kind, fed } => {
                let Some(kind) = self.scene.objects.iter().position(|object| object.name == *kind) else {
                    return Ok(());
                };
                let number = self.presence.births;
                self.presence.births += 1;
                let appeared = Appeared { kind, fed: fed.clone(), number };
                self.presence.appeared.insert(name.clone(), appeared);
                self.presence.gone.remove(name);
                for sound in 0..self.scene.sounds.len() {
                    if matches!(self.scene.sounds[sound].emitter, Emitter::Object(object) if object == kind) {
                        for start in self.starts_of(sound, 0, Some((name, *time_s)))? {
                            let at = self.starts.partition_point(|other| other.time_s <= start.time_s);
                            self.starts.insert(at, start);
                        }
                    }
                }
            }
            Becomes::Gone => {
                self.presence.materials.remove(name);
                if self.presence.appeared.remove(name).is_none() && self.index_of(name).is_some() {
                    self.presence.gone.insert(name.clone());
                }
                self.starts.retain(|start| start.of.as_ref() != Some(name));
                self.wardrobe.forget(name);
                self.papers.forget(name);
                self.quiet_until_s.retain(|(body, other, _), _| body != name && other != name);
                let all = self.voices.iter().filter(|(_, voice)| voice.of == *name);
                let all: Vec<u64> = all.map(|(&id, _)| id).collect();
                self.end_all(&all, *time_s);
            }
            Becomes::Of(material) => {
                let Some(index) = self.scene.materials.iter().position(|known| known.name == *material)
                else {
                    return Ok(());
                };
                self.presence.materials.insert(name.clone(), index);
                // What was struck rings on as what it was.
                let rubs = self.rubbing.iter().filter(|((body, ..), _)| body == name).map(|(_, &id)| id);
                let goes_on = self.going.iter().filter(|(going, _)| going.object == *name);
                let all: Vec<u64> = rubs.chain(goes_on.map(|(_, &id)| id)).collect();
                self.end_all(&all, *time_s);
                self.rubbing.retain(|(body, ..), _| body != name);
                self.going.retain(|going, _| going.object != *name);
            }
        }
        Ok(())
    }

    /// Ends threads at a time.
    fn end_all(&mut self, threads: &[u64], time_s: f64) {
        for id in threads {
            let Some(voice) = self.voices.get_mut(id).filter(|voice| voice.end_s > time_s) else { continue };
            voice.end_s = time_s;
            voice.cues.retain(|cue| cue.time_s < time_s);
            voice.due_s = time_s.max(voice.passed_s);
            self.due.push(line_at(voice.due_s, *id));
        }
    }

    /// Nothing more is told: what would go on for ever ends with what was told last.
    pub(super) fn close(&mut self) {
        self.pulses = false;
        self.starts.retain(|start: &Planned| start.time_s <= self.told_s);
        self.end_s = self.told_s;
        let endless = self.voices.iter().filter(|(_, voice)| voice.end_s >= LATEST_S);
        let endless: Vec<u64> = endless.map(|(&id, _)| id).collect();
        self.end_all(&endless, self.told_s);
    }
}
