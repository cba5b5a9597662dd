//! What an engine plays, as fast as it makes it: in place of a device, for files and tests.

use std::time::Duration;

use super::{EngineSettings, Handle, Player};
use crate::Result;

/// So many frames are taken at once.
const FRAMES: usize = 256;

/// It looks again for what the worker makes so often.
const NAP: Duration = Duration::from_micros(100);

/// Takes all that an engine can make of what it was told. What is told, and in which steps, makes all the difference; how long
/// it takes makes none: the frames are those that a device would be given by a worker that is never late.
///
/// ```no_run
/// use froufrou::render::live::{self, Capture, EngineSettings};
/// use froufrou::scene::Scene;
///
/// let settings = Capture::unhurried(EngineSettings::default());
/// let (mut handle, player) = live::start(Scene::open("scene.toml", false)?, settings)?;
/// let (mut capture, mut sound) = (Capture::new(player), Vec::new());
/// for frame in 1..=600 {
///     handle.advance(f64::from(frame) / 60.0)?;
///     capture.take(&mut handle, |frames| Ok(sound.extend_from_slice(frames)))?;
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Capture {
    player: Player,
    block: Vec<f32>,
    /// Samples that the limiter is behind, which are left out.
    behind: usize,
}

impl Capture {
    /// Settings under which nothing is left out, as long as time is told once a second: all sounds are loaded before it
    /// begins, which is at time 0.
    #[must_use]
    pub fn unhurried(settings: EngineSettings) -> EngineSettings {
        EngineSettings {
            ahead_s: 1.0,
            budget: f32::INFINITY,
            catches_up: false,
            loads_behind: false,
            begins_s: Some(settings.begins_s.unwrap_or(0.0)),
            ..settings
        }
    }

    /// Begins with the first frame.
    pub fn new(player: Player) -> Self {
        let (channels, behind) = (player.channels(), player.limiter_latency());
        Self { player, block: vec![0.0; FRAMES * channels], behind: behind * channels }
    }

    /// How many channels there are.
    pub fn channels(&self) -> usize {
        self.player.channels()
    }

    /// The rate of frames.
    pub fn rate_hz(&self) -> f64 {
        self.player.rate_hz()
    }

    /// Waits until the worker has made all that it can of what was told, and passes that on, in some blocks of interleaved frames.
    /// Less than a block may be kept for the next time.
    ///
    /// # Errors
    /// Those of whoever takes the frames.
    pub fn take(&mut self, handle: &mut Handle, mut each: impl FnMut(&[f32]) -> Result<()>) -> Result<()> {
        loop {
            // In this order: what it makes before it waits is seen.
            let is_all = handle.settle_debt() && handle.is_waiting() || !handle.is_running();
            if self.player.ready_frames() >= FRAMES {
                self.player.fill(&mut self.block);
                let left_out = self.behind.min(self.block.len());
                self.behind -= left_out;
                each(&self.block[left_out..])?;
            } else if is_all {
                return Ok(());
            } else {
                std::thread::sleep(NAP);
            }
        }
    }
}
