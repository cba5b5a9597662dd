//! A dictionary of grains: what a folder of recordings of one material becomes, and what contacts are voiced from.
//!
//! | part | what it is |
//! | --- | --- |
//! | [`Recording`] | an example sound with its label, its grains and its pattern |
//! | [`Entry`] | a grain: a windowed piece of a recording, or of one of its two parts |
//! | [`Placed`] | a place of a recording at which a grain fits, with how well and how loud |
//!
//! A grain's window reaches beyond its two cuts by half its taper, so that the windows of neighbours cross over at the
//! cut and add up to 1 there. Cuts themselves do not overlap: no two grains hold the same sound.
//!
//! The pattern of Picard, Tsingos & Faure (2009, section 3.3) has the highest peaks of every grain. Of those, a
//! [`Recording`] keeps what a walk through it may choose from: each of its own grains at its own place, and in each
//! [slot](Settings::slot_s) of time the best [candidates](Settings::candidates) of other recordings and half as many
//! of its own. So patterns grow with the length of the sound, not with its square.
//!
//! Sinusoidal grains are matched with the sinusoids of recordings, all other grains with residuals and impulsive
//! recordings.

mod assemble;
mod audio;
pub mod builder;
mod folder;
mod index;
pub mod manifest;
mod matching;
pub(crate) mod packed;
pub(crate) mod prepare;
mod resampled;
mod sinusoids;
#[cfg(test)]
mod tests;

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::grains::patterns::Matching;
use super::grains::{Contact, Extraction, GrainKind};
use super::spectral::SpectralModel;
use crate::error::{Error, Place, Result};

/// What the bodies of a recording do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Action {
    /// They hit one another, once or several times.
    Hit,
    /// They break.
    Break,
    /// One slides on the other.
    Slide,
    /// One rolls on the other.
    Roll,
}

impl Action {
    /// How bodies touch that do this.
    pub fn contact(self) -> Contact {
        match self {
            Self::Hit | Self::Break => Contact::Impulsive,
            Self::Slide | Self::Roll => Contact::Continuous,
        }
    }
}

/// How recordings become grains and patterns.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// What rustles and what rings.
    pub spectral: SpectralModel,
    /// Where to cut.
    pub extraction: Extraction,
    /// Which peaks of correlation to look for.
    pub matching: Matching,
    /// The length of a slot of time, in seconds; about half a grain.
    pub slot_s: f64,
    /// How many grains of other recordings are kept in a slot.
    pub candidates: usize,
    /// In a corpus on disk, a grain of a hit or a break that correlates at least so well with an earlier sound is that sound,
    /// made louder or softer; above 1 for none. The error is 1 less the square of it.
    pub share_from: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            spectral: SpectralModel::default(),
            extraction: Extraction::default(),
            matching: Matching::default(),
            slot_s: 0.01,
            candidates: 4,
            share_from: 0.999,
        }
    }
}

impl Settings {
    fn check(&self) -> Result<()> {
        self.spectral.check()?;
        self.extraction.check()?;
        if !(1e-4..=10.0).contains(&self.slot_s) {
            return Err(Error::new(format!("slot_s is {}, expected 0.0001 to 10 seconds", self.slot_s)));
        }
        if !(0.5..=2.0).contains(&self.share_from) {
            return Err(Error::new(format!("share_from is {}, expected 0.5 to 2", self.share_from)));
        }
        Ok(())
    }
}

/// An example sound in memory, one channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Example {
    /// What it is called.
    pub name: String,
    /// Nominally within ±1.
    pub samples: Vec<f32>,
    /// Of these samples.
    pub rate_hz: u32,
    /// How the bodies touch.
    pub contact: Contact,
    /// What they do.
    pub action: Action,
}

/// A recording of a dictionary.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// What it is called.
    pub name: String,
    /// How the bodies touch.
    pub contact: Contact,
    /// What they do.
    pub action: Action,
    /// In samples.
    pub length: usize,
    /// Where grains fit, in order of start.
    pub pattern: Vec<Placed>,
    /// The numbers of its own grains.
    pub grains: Range<usize>,
}

/// A grain, without its samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Entry {
    /// The recording it was cut from.
    pub recording: usize,
    /// The part of the recording it was cut from.
    pub kind: GrainKind,
    /// Its first sample there, the window's first.
    pub start: usize,
    /// Of the window, in samples.
    pub length: usize,
    /// How long the window rises at its beginning and falls at its end, in samples.
    pub tapers: [usize; 2],
    /// The sum of squares of the piece, without the window.
    pub energy: f64,
    /// The mean frequency of the windowed piece, weighted by magnitude.
    pub centroid_hz: f64,
}

/// A place of a recording at which a grain fits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    /// The number of the grain in the dictionary.
    pub grain: u32,
    /// The sample of the recording at which the grain begins.
    pub start: u64,
    /// The normalised cross-correlation of the grain with what the recording (or its part of the grain's kind) has
    /// there, −1 to 1.
    pub correlation: f32,
    /// What gives the windowed grain the power that the recording (or its part) has there under the same window: so
    /// a recording's own grains add up to itself.
    pub gain: f32,
}

/// The part of a recording that grains of some kind are cut from and matched with.
#[derive(Debug, Clone, PartialEq)]
struct Part {
    kind: GrainKind,
    samples: Vec<f32>,
}

/// The grains of some recordings, and where they fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Dictionary {
    rate_hz: u32,
    settings: Settings,
    recordings: Vec<Recording>,
    /// Of each recording.
    parts: Vec<Vec<Part>>,
    grains: Vec<Entry>,
    /// All grains' samples, end to end, and where each begins; one more for the end.
    samples: Vec<f32>,
    begins: Vec<usize>,
}

impl Dictionary {
    /// Makes a dictionary of sounds in memory, at one rate: the given one, or that of most of them (of the higher
    /// rates, where two have as many). The numbers of recordings are in the order given.
    ///
    /// ```
    /// use froufrou::corpus::dictionary::{Action, Dictionary, Example, Settings};
    /// use froufrou::corpus::grains::Contact;
    /// let knock = |hz: f32| Example {
    ///     name: format!("knock {hz}"),
    ///     samples: (0..8000).map(|i| (i as f32 * hz / 7000.0).sin() * (-0.002 * i as f32).exp()).collect(),
    ///     rate_hz: 44_100,
    ///     contact: Contact::Impulsive,
    ///     action: Action::Hit,
    /// };
    /// let dictionary = Dictionary::build([knock(900.0), knock(1300.0)], None, &Settings::default())?;
    /// assert_eq!(dictionary.recordings().len(), 2);
    /// assert!(dictionary.grains().len() > 2);
    /// # Ok::<(), froufrou::Error>(())
    /// ```
    ///
    /// # Errors
    /// Where a sound is empty or not finite, a rate is not one of sound or too far from the dictionary's, or a
    /// setting makes no sense.
    pub fn build(
        examples: impl IntoIterator<Item = Example>,
        rate_hz: Option<u32>,
        settings: &Settings,
    ) -> Result<Self> {
        settings.check()?;
        let examples: Vec<Example> = examples.into_iter().collect();
        let rates = examples.iter().map(|example| example.rate_hz);
        let rate_hz = rate_hz.or_else(|| prepare::commonest(rates)).unwrap_or(48_000);
        let mut sounds = Vec::with_capacity(examples.len());
        for example in examples {
            let named = |e: Error| Error::new(e.to_string()).at(Place::Part(example.name.clone()));
            let samples = prepare::at_rate(example.samples, example.rate_hz, rate_hz).map_err(named)?;
            let parts = prepare::parts(samples, rate_hz, example.contact, settings).map_err(named)?;
            let segments = prepare::segments(&parts, rate_hz, settings).map_err(named)?;
            let Example { name, contact, action, .. } = example;
            sounds.push(assemble::Sound { name, contact, action, parts, segments });
        }
        let cut = assemble::Cut::new(rate_hz, settings, sounds);
        let peaks = matching::all(&cut, settings)?;
        Ok(cut.assemble(&peaks))
    }

    /// Samples a second of everything in it.
    pub fn rate_hz(&self) -> u32 {
        self.rate_hz
    }

    /// How it was made.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The recordings, in their order.
    pub fn recordings(&self) -> &[Recording] {
        &self.recordings
    }

    /// The grains, in the order of recordings, then of parts (sinusoids before the residual), then of time.
    pub fn grains(&self) -> &[Entry] {
        &self.grains
    }

    /// A grain under its window, whose mean square is 1; empty where there is no such grain.
    pub fn samples(&self, grain: usize) -> &[f32] {
        match (self.begins.get(grain), self.begins.get(grain + 1)) {
            (Some(&from), Some(&to)) => &self.samples[from..to],
            _ => &[],
        }
    }

    /// The sinusoids of a recording, or what is not sinusoidal in it; empty where there is no such part.
    pub fn part(&self, recording: usize, is_sinusoidal: bool) -> &[f32] {
        let parts = self.parts.get(recording).map_or(&[][..], Vec::as_slice);
        let part = parts.iter().find(|part| (part.kind == GrainKind::Sinusoidal) == is_sinusoidal);
        part.map_or(&[], |part| &part.samples)
    }

    /// What a recording sounds like: the sum of its parts; empty where there is no such recording.
    pub fn sound(&self, recording: usize) -> Vec<f32> {
        match self.parts.get(recording).map(Vec::as_slice) {
            Some([one]) => one.samples.clone(),
            Some([one, other]) => one.samples.iter().zip(&other.samples).map(|(a, b)| a + b).collect(),
            _ => Vec::new(),
        }
    }
}

/// True where grains of one kind are matched with parts of the other.
fn fits(grain: GrainKind, part: GrainKind) -> bool {
    (grain == GrainKind::Sinusoidal) == (part == GrainKind::Sinusoidal)
}
