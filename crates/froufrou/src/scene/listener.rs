//! A listener: a head with one or two microphones on it.

use std::fmt;
use std::str::FromStr;

use super::file::{Microphone, Motion};
use super::track::facing_frame;
use crate::score::MicrophoneShape;
use crate::{Error, Result};

/// Hears alike from all sides.
pub const OMNI: MicrophoneShape = MicrophoneShape { c: 0.0, k: 0.0 };

/// Hears all in front and nothing behind.
pub const CARDIOID: MicrophoneShape = MicrophoneShape { c: 0.0, k: 1.0 };

/// How many ears a listener has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Layout {
    /// One microphone that hears all around.
    Mono,
    /// Two cardioid microphones that face away from each other (Takala & Hahn 1992, §5.3).
    #[default]
    Stereo,
}

impl Layout {
    /// All of them.
    pub const ALL: [Layout; 2] = [Layout::Mono, Layout::Stereo];

    /// The word for it.
    pub fn name(self) -> &'static str {
        match self {
            Layout::Mono => "mono",
            Layout::Stereo => "stereo",
        }
    }
}

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Layout {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let known = Self::ALL.into_iter().find(|layout| layout.name() == text);
        known.ok_or_else(|| Error::new(format!("unknown layout `{text}`, expected `mono` or `stereo`")))
    }
}

/// A listener as the scene has it.
#[derive(Debug, Clone, PartialEq)]
pub struct Listener {
    /// What carries it.
    pub motion: Motion,
    /// Where it sits in the local frame of what carries it, in metres.
    pub local_offset_m: [f64; 3],
    /// Unit vector of its facing direction in that frame.
    pub local_facing: [f64; 3],
    /// How many ears it has.
    pub layout: Layout,
    /// Distance between two ears in metres.
    pub spacing_m: f64,
}

impl Listener {
    /// Its microphones. The two of a stereo listener, `left` and `right`, sum to one that hears all
    /// around.
    pub fn microphones(&self) -> Vec<Microphone> {
        let microphone = |name: &str, shape, local_offset_m, local_facing| Microphone {
            name: name.to_owned(),
            shape,
            motion: self.motion.clone(),
            local_offset_m,
            local_facing,
        };
        let head = self.local_offset_m;
        if self.layout == Layout::Mono {
            return vec![microphone("mono", OMNI, head, self.local_facing)];
        }
        // The ears' axis in the carrier's frame: right = facing × up.
        let frame = facing_frame([0.0; 3], self.local_facing);
        let right = [frame[0][0], frame[1][0], frame[2][0]];
        let ear = |name, side: f64| {
            let offset = std::array::from_fn(|n| head[n] + right[n] * side * self.spacing_m / 2.0);
            microphone(name, CARDIOID, offset, right.map(|c| c * side))
        };
        vec![ear("left", -1.0), ear("right", 1.0)]
    }
}
