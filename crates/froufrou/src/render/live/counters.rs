//! What the audio thread tells of itself, by numbers that any thread may read.

use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering::Relaxed};

/// Numbers that the audio thread writes.
#[derive(Default)]
pub(super) struct Counters {
    /// The next frame of the score that is played.
    pub played: AtomicU64,
    /// Where the score ends, one more than the frame; 0 while nobody knows.
    pub end: AtomicU64,
    pub is_over: AtomicBool,
    pub blocks: AtomicU64,
    pub late_blocks: AtomicU64,
    pub stolen: AtomicU64,
    pub released: AtomicU32,
    pub threads: AtomicU32,
    pub readings: AtomicU32,
    pub held: AtomicU64,
    pub held_frames: AtomicU64,
    pub silent_frames: AtomicU64,
    pub skipped_frames: AtomicU64,
    pub limited_frames: AtomicU64,
    pub not_numbers: AtomicU64,
    /// In thousandths.
    pub load: AtomicU32,
    pub peak_load: AtomicU32,
    /// The bits of a number.
    pub peak: AtomicU32,
}

/// What has happened on the audio thread since it began.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Statistics {
    /// The next frame of the score that is played.
    pub played_frame: u64,
    /// Blocks that a device asked for.
    pub blocks: u64,
    /// Blocks among them that took longer than they last.
    pub late_blocks: u64,
    /// How often a voice has been released because there was no time for all: see [`Settings::budget`](super::Settings::budget).
    pub stolen: u64,
    /// Voices that are silent now because of that, or fade.
    pub released: u32,
    /// Threads that sounded last.
    pub threads: u32,
    /// Readings of their signals, for channels and buses, that were made last.
    pub readings: u32,
    /// How often what comes next was not there in time.
    pub held: u64,
    /// Frames in which sounds went on as they were, because of that.
    pub held_frames: u64,
    /// Frames of silence before the beginning, behind the end and where sounds had gone on for too long.
    pub silent_frames: u64,
    /// Frames of the score that were left out, because too much of it was there.
    pub skipped_frames: u64,
    /// Frames that the limiter made softer.
    pub limited_frames: u64,
    /// Samples that were no finite number.
    pub not_numbers: u64,
    /// What part of the time that there was the last blocks took, on average.
    pub load: f32,
    /// And the slowest block so far.
    pub peak_load: f32,
    /// The loudest sample of the last block, 1 being full scale.
    pub peak: f32,
}

impl Counters {
    pub fn statistics(&self) -> Statistics {
        let thousandths = |of: &AtomicU32| of.load(Relaxed) as f32 / 1000.0;
        Statistics {
            played_frame: self.played.load(Relaxed),
            blocks: self.blocks.load(Relaxed),
            late_blocks: self.late_blocks.load(Relaxed),
            stolen: self.stolen.load(Relaxed),
            released: self.released.load(Relaxed),
            threads: self.threads.load(Relaxed),
            readings: self.readings.load(Relaxed),
            held: self.held.load(Relaxed),
            held_frames: self.held_frames.load(Relaxed),
            silent_frames: self.silent_frames.load(Relaxed),
            skipped_frames: self.skipped_frames.load(Relaxed),
            limited_frames: self.limited_frames.load(Relaxed),
            not_numbers: self.not_numbers.load(Relaxed),
            load: thousandths(&self.load),
            peak_load: thousandths(&self.peak_load),
            peak: f32::from_bits(self.peak.load(Relaxed)),
        }
    }
}
