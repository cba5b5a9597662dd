//! Sounds that become known while others are heard already.

use std::sync::Arc;
use std::sync::mpsc::TryRecvError;

use super::{Composer, Learning, Planned};
use crate::Result;
use crate::motion::event::Event;
use crate::scene::file::Timing;
use crate::score::retarget::Repertoire;

impl<E: Iterator<Item = Result<Event>>> Composer<'_, E> {
    /// The same, which learns of sounds as they are loaded. What plays a sound that is not known yet is silent; one that runs
    /// through the scene begins once it is.
    #[must_use]
    pub fn learning(self, learning: Option<Learning>) -> Self {
        Self { learns: learning.is_some(), learning, ..self }
    }

    /// Takes in what has become known.
    pub(super) fn learn(&mut self) {
        let Some(learning) = &self.learning else { return };
        let mut known = Vec::new();
        let is_over = loop {
            match learning.try_recv() {
                Ok(sound) => known.push(sound),
                Err(TryRecvError::Empty) => break false,
                Err(TryRecvError::Disconnected) => break true,
            }
        };
        if is_over {
            self.learning = None;
        }
        if known.is_empty() {
            return;
        }
        for (name, facts) in known {
            if let Some(dictionary) = &facts.grains {
                self.repertoires.insert(name.clone(), Arc::new(Repertoire::new(dictionary.clone())));
            }
            if let Some(cloth) = &facts.cloth {
                self.wardrobe.learn(&name, cloth);
            }
            if let Some(paper) = &facts.paper {
                self.papers.learn(&name, paper);
            }
            self.facts.insert(name, facts);
        }
        for start in std::mem::take(&mut self.waiting) {
            // What was to be struck or played at a moment is past.
            if matches!(self.scene.sounds[start.sound].timing, Timing::Span { .. }) {
                let start = Planned { time_s: start.time_s.max(self.told_s), ..start };
                let at = self.starts.partition_point(|other| other.time_s <= start.time_s);
                self.starts.insert(at, start);
            }
        }
    }
}
