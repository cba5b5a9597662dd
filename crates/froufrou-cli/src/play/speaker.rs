//! A device that plays a deck, also after it was lost.

use std::time::Duration;

use froufrou::render::live::deck::Deck;
use froufrou::{Error, Result};

use super::device::{Home, Output, Playing};

/// A lost device is looked for so often: sound servers complain each time.
pub const LOOK_FOR_DEVICE: Duration = Duration::from_secs(1);
/// What has left the program is heard after so long at the latest.
pub const LAST: Duration = Duration::from_millis(400);

/// What is said where the system does not let the audio thread go before others.
const NOT_URGENT: &str = "the audio thread has no real-time priority, so that other programs may make it late; \
                          the system's limit `rtprio` would allow it";

/// A device and what it plays.
pub struct Speaker {
    pub output: Output,
    home: Home<Deck>,
    playing: Option<Playing>,
    is_told: bool,
    /// At home while nothing plays it.
    deck: Option<Deck>,
}

impl Speaker {
    /// A device that does not play yet.
    pub fn new(output: Output, deck: Deck) -> Self {
        Self { output, home: Home::new(), playing: None, is_told: false, deck: Some(deck) }
    }

    /// Lets the device play.
    ///
    /// # Errors
    /// What the device says.
    pub fn begin(&mut self) -> Result<()> {
        let Some(deck) = self.deck.take().or_else(|| self.home.take()) else {
            return Err(Error::new("the device does not let go of what it played"));
        };
        match self.output.play(deck, &self.home) {
            Ok(playing) => {
                self.playing = Some(playing);
                Ok(())
            }
            Err(fault) => {
                self.deck = self.home.take();
                Err(fault)
            }
        }
    }

    /// Plays on once a lost device is there again; meanwhile time stands still. Gives what there is to be said of it.
    pub fn look_after(&mut self) -> Option<String> {
        let is_lost = self.playing.as_ref().is_some_and(Playing::is_lost);
        if is_lost {
            self.playing = None;
            self.deck = self.home.take();
        }
        if self.playing.is_none() && self.output.find_again().is_ok() && self.begin().is_ok() {
            return Some(format!("on {}", self.output.name()));
        }
        if !self.is_told && self.playing.as_ref().and_then(Playing::is_urgent) == Some(false) {
            self.is_told = true;
            return Some(NOT_URGENT.to_owned());
        }
        is_lost.then(|| "the device is lost; it goes on when there is one again".to_owned())
    }

    /// How often the device says that it had nothing to play in time, since it plays.
    pub fn hiccups(&self) -> u64 {
        self.playing.as_ref().map_or(0, Playing::hiccups)
    }
}
