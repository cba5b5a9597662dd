//! What a device plays from: one player after another, without a click, and with a pause.
//!
//! Seeking, looping and loading a scene anew all make another [`Player`], which takes a while. It is handed to the deck
//! when it is ready, and what was played is faded into it. Players that are done with go back to whoever made them, so that
//! the audio thread frees nothing.
//!
//! ```
//! use froufrou::render::live::deck;
//! let (mut deck, mut changer) = deck::new(2);
//! let mut block = [1.0f32; 256];
//! deck.fill(&mut block);
//! assert!(block.iter().all(|sample| *sample == 0.0), "nothing is there to be played yet");
//! changer.pause(true);
//! assert!(changer.is_paused());
//! ```

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use rtrb::{Consumer, Producer, RingBuffer};

use super::Player;
use super::player::{JOIN_S, PIECE_FRAMES};

/// So many players may wait to be played or freed.
const ROOM: usize = 8;

/// The audio thread's half.
pub struct Deck {
    channels: usize,
    playing: Option<Box<Player>>,
    leaving: Option<Box<Player>>,
    next: Consumer<Box<Player>>,
    back: Producer<Box<Player>>,
    is_paused: Arc<AtomicBool>,
    /// How loud it all is: 0 while it is paused.
    level: f32,
    /// How loud what comes in is, beside what leaves.
    share: f32,
    room: Vec<f32>,
}

/// The other half.
pub struct Changer {
    channels: usize,
    next: Producer<Box<Player>>,
    back: Consumer<Box<Player>>,
    is_paused: Arc<AtomicBool>,
}

/// A deck for players of so many channels.
pub fn new(channels: usize) -> (Deck, Changer) {
    let (next, coming) = RingBuffer::new(ROOM);
    // Those that wait, the one that plays and the one that leaves.
    let (back, left) = RingBuffer::new(ROOM + 2);
    let is_paused = Arc::new(AtomicBool::new(false));
    let deck = Deck {
        channels: channels.max(1),
        playing: None,
        leaving: None,
        next: coming,
        back,
        is_paused: is_paused.clone(),
        level: 1.0,
        share: 1.0,
        room: vec![0.0; PIECE_FRAMES * channels.max(1)],
    };
    (deck, Changer { channels: channels.max(1), next, back: left, is_paused })
}

impl Changer {
    /// Lets a player be played from now on. It is given back where it has other channels, or where too many wait.
    ///
    /// # Errors
    /// The player.
    pub fn play(&mut self, player: Player) -> Result<(), Box<Player>> {
        self.tidy();
        let player = Box::new(player);
        if player.channels() != self.channels {
            return Err(player);
        }
        self.next.push(player).map_err(|rtrb::PushError::Full(player)| player)
    }

    /// Frees what is played no more.
    pub fn tidy(&mut self) {
        while self.back.pop().is_ok() {}
    }

    /// Lets time stand still, or go on.
    pub fn pause(&self, is_paused: bool) {
        self.is_paused.store(is_paused, Relaxed);
    }

    /// Whether time stands still.
    pub fn is_paused(&self) -> bool {
        self.is_paused.load(Relaxed)
    }
}

impl Deck {
    /// How many channels there are.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Fills a block of any length with interleaved frames. Samples behind the last whole frame are silent.
    pub fn fill(&mut self, block: &mut [f32]) {
        let frames = block.len() / self.channels;
        let (whole, rest) = block.split_at_mut(frames * self.channels);
        rest.fill(0.0);
        for piece in whole.chunks_mut(PIECE_FRAMES * self.channels) {
            self.piece(piece);
        }
    }

    fn piece(&mut self, out: &mut [f32]) {
        if self.leaving.is_none()
            && let Ok(next) = self.next.pop()
        {
            self.leaving = self.playing.replace(next);
            self.share = if self.leaving.is_some() { 0.0 } else { 1.0 };
        }
        let is_paused = self.is_paused.load(Relaxed);
        if is_paused && self.level == 0.0 {
            // Nobody would hear it fade.
            self.share = 1.0;
            self.let_go();
            return out.fill(0.0);
        }
        match &mut self.playing {
            Some(playing) => playing.fill(out),
            None => out.fill(0.0),
        }
        let rate_hz = self.playing.as_ref().map_or(48_000.0, |playing| playing.rate_hz());
        let step = (1.0 / (JOIN_S * rate_hz)) as f32;
        if let Some(leaving) = &mut self.leaving {
            let room = &mut self.room[..out.len()];
            leaving.fill(room);
            for (out, old) in out.chunks_exact_mut(self.channels).zip(room.chunks_exact(self.channels)) {
                self.share = (self.share + step).min(1.0);
                for (out, old) in out.iter_mut().zip(old) {
                    *out = self.share * *out + (1.0 - self.share) * old;
                }
            }
            if self.share >= 1.0 {
                self.let_go();
            }
        }
        let target = if is_paused { 0.0 } else { 1.0 };
        if self.level != target {
            for frame in out.chunks_exact_mut(self.channels) {
                self.level =
                    if is_paused { (self.level - step).max(0.0) } else { (self.level + step).min(1.0) };
                frame.iter_mut().for_each(|sample| *sample *= self.level);
            }
        }
    }

    /// Lets what has left be freed.
    fn let_go(&mut self) {
        if let Some(leaving) = self.leaving.take()
            && let Err(rtrb::PushError::Full(leaving)) = self.back.push(leaving)
        {
            // Whoever frees is late; what leaves goes on to wait, and is silent.
            self.leaving = Some(leaving);
        }
    }
}
