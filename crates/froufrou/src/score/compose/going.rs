//! Threads of what goes on: there is one for what an object does at one place, for as long as it does so.

use super::Composer;
use super::voice::Voice;
use crate::Result;
use crate::motion::event::Event;
use crate::score::Start;

/// What there is a thread for.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Going {
    /// The object.
    pub object: String,
    /// Which patch of it.
    pub patch: u32,
    /// What that does.
    pub does: Does,
}

impl Going {
    /// A patch of an object does something.
    pub fn new(object: &str, patch: u32, does: Does) -> Self {
        Self { object: object.to_owned(), patch, does }
    }
}

/// What a patch of a cloth or a sheet of paper does.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Does {
    /// It rubs: along something, or with a sound.
    Rub(String),
    /// It buckles.
    Pop,
    /// It beats the air.
    Flap,
    /// It tears.
    Tear,
}

impl<E: Iterator<Item = Result<Event>>> Composer<'_, E> {
    /// The thread of what goes on: the one that there is, or a new one.
    pub(super) fn thread(
        &mut self,
        going: Going,
        time_s: f64,
        position_m: [f64; 3],
        begins: impl FnOnce() -> Start,
    ) -> u64 {
        let known = self.going.get(&going).copied();
        if let Some(id) = known.filter(|id| self.voices.contains_key(id)) {
            return id;
        }
        let start = Start { object: going.object.clone(), ..begins() };
        let voices = &self.voices;
        self.going.retain(|_, id| voices.contains_key(id));
        let id = self.begin(time_s, Voice::at(start, position_m, time_s));
        self.going.insert(going, id);
        id
    }
}
