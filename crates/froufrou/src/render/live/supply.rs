//! The worker's half: reads a mixer just ahead of what is played, and hands slices over.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};

use rtrb::{Consumer, Producer};

use super::counters::{Counters, Statistics};
use crate::score::ChannelLine;
use crate::synth::mixer::{Begun, Cutter, Mixer, Slice};
use crate::synth::voice::first_frame;
use crate::{Error, Result};

/// What was handed over.
pub(super) enum Handed {
    Slice,
    /// Nothing: there is enough already.
    Nothing,
    /// All that there is.
    All,
}

/// What a worker does with a mixer, so that a [`Player`](super::Player) has something to play.
pub struct Supply<L> {
    pub(super) mixer: Mixer<L>,
    pub(super) cutter: Cutter,
    pub(super) slices: Producer<Box<Slice>>,
    /// What has been played comes back to be filled again.
    pub(super) used: Consumer<Box<Slice>>,
    pub(super) spare: VecDeque<Box<Slice>>,
    /// How many slices are with the player or on the way to it or back, and how many may be.
    pub(super) under_way: usize,
    pub(super) most_under_way: usize,
    pub(super) slice_frames: u64,
    /// So far ahead of what is played it stays; `None`: as far as lines come.
    pub(super) ahead_frames: Option<u64>,
    pub(super) rate_hz: f64,
    pub(super) duration_s: Option<f64>,
    pub(super) counters: Arc<Counters>,
}

impl<L: Iterator<Item = Result<ChannelLine>>> Supply<L> {
    /// The same, for lines that come as things happen: what is known is handed over, as far as there is room.
    #[must_use]
    pub fn following(self) -> Self {
        Self { ahead_frames: None, ..self }
    }

    /// Hands over what is to be played next, as far ahead as the latency asks for; true once all is handed over. It
    /// waits where the lines of the score do.
    ///
    /// # Errors
    /// As [`Mixer::read_to`]. What has been handed over until then is played.
    pub fn go_on(&mut self) -> Result<bool> {
        loop {
            match self.hand_over()? {
                Handed::Slice => {}
                Handed::Nothing => return Ok(false),
                Handed::All => return Ok(true),
            }
        }
    }

    /// Hands over the next slice, if it is time for that.
    pub(super) fn hand_over(&mut self) -> Result<Handed> {
        while let Ok(slice) = self.used.pop() {
            self.under_way -= 1;
            self.spare.push_back(slice);
        }
        let at = self.cutter.frame();
        if self.end().is_some_and(|end| at >= end) {
            self.counters.end.store(at + 1, Release);
            return Ok(Handed::All);
        }
        let played = self.counters.played.load(Acquire);
        let is_ahead = self.ahead_frames.is_some_and(|ahead| at >= played + ahead);
        if is_ahead || self.under_way >= self.most_under_way {
            return Ok(Handed::Nothing);
        }
        let to = at + self.slice_frames;
        self.mixer.read_to(to)?;
        let to = self.end().map_or(to, |end| end.clamp(at, to));
        let mut slice = self.spare.pop_front().unwrap_or_default();
        self.cutter.cut(self.mixer.voices(), to, &mut slice);
        self.mixer.release(to);
        if self.slices.push(slice).is_err() {
            return Err(Error::new("there is no room for another slice of time"));
        }
        self.under_way += 1;
        Ok(Handed::Slice)
    }

    /// The frame at which all is over, once it is known.
    fn end(&self) -> Option<u64> {
        let given = self.duration_s.map(|duration_s| first_frame(duration_s, self.rate_hz));
        given.or_else(|| {
            let last_s = self.mixer.is_read().then(|| self.mixer.last_arrival_s());
            last_s.map(|last_s| first_frame(last_s, self.rate_hz))
        })
    }

    /// The threads that have begun since this was last asked.
    pub fn take_begun(&mut self) -> Vec<Begun> {
        self.mixer.take_begun()
    }

    /// How many synthesised sounds have failed since this was last asked, and the faults of the first: see
    /// [`Mixer::keeping_going`].
    pub fn take_faults(&mut self) -> (u64, Vec<Error>) {
        self.mixer.take_faults()
    }

    /// What has happened on the audio thread.
    pub fn statistics(&self) -> Statistics {
        self.counters.statistics()
    }

    /// Whether the last of it has been played.
    pub fn is_over(&self) -> bool {
        self.counters.is_over.load(Relaxed)
    }
}
