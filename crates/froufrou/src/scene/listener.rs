//! A listener: a head with microphones on it, with ears, or amid loudspeakers.

use std::fmt;
use std::str::FromStr;

use super::asset::Asset;
use super::file::{Microphone, Motion};
use super::track::facing_frame;
use crate::score::{Loudspeaker, MicrophoneShape, Pickup};
use crate::space::layout;
use crate::space::panning::Panner;
use crate::{Error, Result};

/// Hears alike from all sides.
pub const OMNI: MicrophoneShape = MicrophoneShape { c: 0.0, k: 0.0 };

/// Hears all in front and nothing behind.
pub const CARDIOID: MicrophoneShape = MicrophoneShape { c: 0.0, k: 1.0 };

/// The names of layouts that are microphones.
const MICROPHONES: [&str; 2] = ["mono", "stereo"];

/// The names of sound fields, by their order.
const AMBISONIC: [&str; 3] = ["ambisonic-1", "ambisonic-2", "ambisonic-3"];

/// How a listener hears.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Layout {
    /// One microphone that hears all around.
    Mono,
    /// Two cardioid microphones that face away from each other (Takala & Hahn 1992, §5.3).
    #[default]
    Stereo,
    /// With two ears, for headphones.
    Binaural,
    /// The sound field in spherical harmonics up to an order from 1 to 3, as in AmbiX files.
    Ambisonic(usize),
    /// What loudspeakers about it have to play.
    Loudspeakers(Vec<Loudspeaker>),
}

impl Layout {
    /// The words for all that have one: `mono`, `stereo`, `binaural`, `ambisonic-1` to `-3`, and `quad` to `7.1.4`
    /// for loudspeakers ([`layout`]).
    pub fn names() -> impl Iterator<Item = &'static str> {
        // Mono and stereo are microphones here, as in the paper, not loudspeakers.
        let loudspeakers = layout::Layout::names().filter(|name| !MICROPHONES.contains(name));
        MICROPHONES.into_iter().chain(["binaural"]).chain(AMBISONIC).chain(loudspeakers)
    }

    /// The layout of a name.
    pub fn named(name: &str) -> Option<Self> {
        if let Some(order) = AMBISONIC.iter().position(|known| *known == name) {
            return Some(Layout::Ambisonic(order + 1));
        }
        match name {
            "mono" => Some(Layout::Mono),
            "stereo" => Some(Layout::Stereo),
            "binaural" => Some(Layout::Binaural),
            _ => Some(Layout::Loudspeakers(layout::Layout::named(name).ok()?.speakers().to_vec())),
        }
    }

    /// Finds out whether sounds can be spread over its loudspeakers.
    ///
    /// # Errors
    /// Loudspeakers that no sound could come from.
    pub fn check(&self) -> Result<()> {
        match self {
            Layout::Loudspeakers(all) => Panner::new(all).map(drop),
            _ => Ok(()),
        }
    }
}

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::names().find(|name| Self::named(name).as_ref() == Some(self));
        f.write_str(name.unwrap_or("loudspeakers"))
    }
}

impl FromStr for Layout {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Self::named(text).ok_or_else(|| {
            let names: Vec<String> = Self::names().map(|name| format!("`{name}`")).collect();
            Error::new(format!("unknown layout `{text}`, expected one of {}", names.join(", ")))
        })
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
    /// How it hears.
    pub layout: Layout,
    /// Distance between two microphones in metres.
    pub spacing_m: f64,
    /// The file that says what its head does to sound; `None`: a sphere.
    pub head: Option<Asset>,
    /// Whether all voices share one head.
    pub shared: bool,
}

impl Listener {
    /// Gives it another layout. What the other has no use for is left aside.
    ///
    /// # Errors
    /// As [`Layout::check`].
    pub fn set_layout(&mut self, layout: Layout) -> Result<()> {
        layout.check()?;
        self.layout = layout;
        Ok(())
    }

    /// Its microphones. The two of a stereo listener, `left` and `right`, sum to one that hears all
    /// around.
    pub fn microphones(&self) -> Vec<Microphone> {
        let microphone = |name: &str, pickup, local_offset_m, local_facing| Microphone {
            name: name.to_owned(),
            pickup,
            motion: self.motion.clone(),
            local_offset_m,
            local_facing,
        };
        let one = |name, pickup| vec![microphone(name, pickup, self.local_offset_m, self.local_facing)];
        match &self.layout {
            Layout::Mono => one("mono", Pickup::Shape(OMNI)),
            Layout::Stereo => {
                // The axis between them in the carrier's frame: right = facing × up.
                let frame = facing_frame([0.0; 3], self.local_facing);
                let right = [frame[0][0], frame[1][0], frame[2][0]];
                let ear = |name, side: f64| {
                    let along = side * self.spacing_m / 2.0;
                    let offset = std::array::from_fn(|n| self.local_offset_m[n] + right[n] * along);
                    microphone(name, Pickup::Shape(CARDIOID), offset, right.map(|c| c * side))
                };
                vec![ear("left", -1.0), ear("right", 1.0)]
            }
            Layout::Binaural => {
                let head = self.head.as_ref().map(|head| head.name.clone());
                one("listener", Pickup::Binaural { head, shared: self.shared })
            }
            Layout::Ambisonic(order) => one("listener", Pickup::Ambisonic { order: *order }),
            Layout::Loudspeakers(all) => one("listener", Pickup::Loudspeakers(all.clone())),
        }
    }
}
