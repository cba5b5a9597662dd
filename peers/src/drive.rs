//! Ticks and blocks, in the order in which a game would make them.

use crate::peers::{Peer, Rendering, Result};
use crate::world::{RATE_HZ, TICK_FRAMES, World};

/// A world that sounds, and how far it has.
pub struct Drive {
    rendering: Box<dyn Rendering>,
    block: Vec<[f32; 2]>,
    frame: u64,
    next_tick: u64,
}

impl Drive {
    pub fn start(peer: &dyn Peer, world: &World) -> Result<Self> {
        let rendering = peer.start(world)?;
        Ok(Self { rendering, block: vec![[0.0; 2]; world.block], frame: 0, next_tick: 0 })
    }

    /// The next block, told before of all ticks up to its beginning.
    pub fn next(&mut self) -> Result<&[[f32; 2]]> {
        while self.next_tick * TICK_FRAMES <= self.frame {
            self.rendering.tick((self.next_tick * TICK_FRAMES) as f64 / f64::from(RATE_HZ))?;
            self.next_tick += 1;
        }
        self.rendering.render(&mut self.block)?;
        self.frame += self.block.len() as u64;
        Ok(&self.block)
    }

    /// What is heard from the beginning on: so many frames, both ears apart.
    pub fn hear(mut self, frames: usize) -> Result<[Vec<f64>; 2]> {
        let mut ears = [Vec::new(), Vec::new()];
        while ears[0].len() < frames {
            for frame in self.next()? {
                for (ear, sample) in ears.iter_mut().zip(frame) {
                    ear.push(f64::from(*sample));
                }
            }
        }
        for ear in &mut ears {
            ear.truncate(frames);
            if ear.iter().any(|sample| !sample.is_finite()) {
                return Err("it renders what is no number".into());
            }
        }
        Ok(ears)
    }
}
