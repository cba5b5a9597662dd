//! Objects that appear and vanish while others sound, or become of something else: what of them begins and ends to sound.

use super::{Composer, Planned, line_at};
use crate::Result;
use crate::motion::event::{Becomes, Change, Event};
use crate::scene::carrier::Carrier;
use crate::scene::file::{Emitter, Material};
use crate::scene::presence::Appeared;
use crate::score::LATEST_S;

impl<'s, E: Iterator<Item = Result<Event>>> Composer<'s, E> {
    /// What something is of, by its name and the object that it is or is as.
    pub(super) fn material_of(&self, name: &str, index: usize) -> Option<&'s Material> {
        self.presence.material(name, self.scene, index)
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
                self.presence.appear(name, kind, fed.clone());
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
                self.presence.vanish(name, self.index_of(name).is_some());
                self.starts.retain(|start| start.of.as_ref() != Some(name));
                self.waiting.retain(|start| start.of.as_ref() != Some(name));
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
                self.presence.become_of(name, index);
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
