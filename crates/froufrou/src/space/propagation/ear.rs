//! A microphone on its ways.

use std::collections::VecDeque;

use super::super::pickup::Receiving;
use super::super::track::Track;
use crate::Result;
use crate::score::{Microphone, MicrophoneKey, Pose};
use crate::synth::path::FADE_S;

/// A microphone and its ways, one after each cut.
pub(super) struct Ear {
    pub(super) receiving: Receiving,
    /// Position, facing and up; a new take begins at each cut.
    pub(super) takes: VecDeque<Track<9>>,
    /// The number of the first take that is still held.
    pub(super) first_take: usize,
    pub(super) moves: bool,
}

impl Ear {
    pub(super) fn new(microphone: &Microphone) -> Result<Self> {
        let fixed = microphone.fixed.map(|pose| Track::still(pose_values(&pose)));
        Ok(Self {
            receiving: Receiving::new(&microphone.pickup)?,
            moves: fixed.is_none(),
            takes: fixed.into_iter().collect(),
            first_take: 0,
        })
    }

    pub(super) fn take(&self, take: usize) -> Option<&Track<9>> {
        self.takes.get(take.saturating_sub(self.first_take))
    }

    /// When the take after this one begins.
    pub(super) fn cut_s(&self, take: usize) -> Option<f64> {
        self.takes.get((take + 1).saturating_sub(self.first_take)).map(Track::first_s)
    }

    pub(super) fn hear(&mut self, key: &MicrophoneKey) {
        let values = pose_values(&key.pose);
        match self.takes.back_mut() {
            Some(take) if !key.cut => take.push(key.time_s, values),
            before => {
                before.into_iter().for_each(|take| take.closed = true);
                self.takes.push_back(Track::new(key.time_s, values));
            }
        }
    }

    pub(super) fn forget(&mut self, time_s: f64) {
        while self.takes.get(1).is_some_and(|take| take.first_s() + 2.0 * FADE_S < time_s) {
            self.takes.pop_front();
            self.first_take += 1;
        }
        if let Some(take) = self.takes.front_mut() {
            take.forget(time_s);
        }
    }
}

fn pose_values(pose: &Pose) -> [f64; 9] {
    let ([x, y, z], [fx, fy, fz], [ux, uy, uz]) = (pose.position_m, pose.facing, pose.up);
    [x, y, z, fx, fy, fz, ux, uy, uz]
}
