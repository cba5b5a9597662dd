//! A corpus of units on disk: a folder whose `corpus.toml` has a table `[units]`.
//!
//! ```toml
//! version = 1
//!
//! [units]
//! recordings = ["takes"]      # files, and folders of them, from here
//! widths = [20, 50, 10]
//! lambda = 100
//! ```
//!
//! Other tables of the file are left to others: a corpus of grains or of cloth may have units as well. What is computed
//! from a recording is kept in `cache`, named by what it was computed from: its features, and its sound at the corpus's
//! rate after the high-pass, from which units are read as they are needed. So opening a corpus again takes no decoding,
//! and the sound of hours takes no memory. The cache may be deleted.

mod cache;
mod manifest;
mod survey;

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use self::cache::{Cached, Stamps};
use super::concatenation::{Sound, UnitPlace, place_of};
use super::correspondences::Correspondence;
use super::features::{Extractor, Features};
use super::high_pass::HighPass;
use super::optimal::{self, Optimum, optimal};
use super::selection::{Index, greedy};
use super::settings::{Channels, Settings};
use super::smoothing::smooth;
use super::warp::{Basis, Clip, Warp};
use crate::corpus::dictionary::prepare;
use crate::corpus::naming::find;
use crate::corpus::recording::Recording;
use crate::error::{Error, Place, Result};

pub use manifest::{create, is_of_units_alone, settings};
pub use survey::{Survey, Surveyed, survey};

/// A corpus that is open: features in memory, sound on disk.
pub struct Corpus {
    settings: Settings,
    rate_hz: u32,
    recordings: Vec<Cached>,
    streams: Vec<Stream>,
    /// The number of each stream's first unit, and of all.
    starts: Vec<usize>,
    features: Features,
}

/// A channel of a recording, or all of its channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Stream {
    recording: usize,
    /// None for all at once.
    channel: Option<usize>,
}

/// What a corpus is busy with while it opens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress<'a> {
    /// The recording.
    pub name: &'a str,
    /// How many are done, and of how many.
    pub done: usize,
    /// See `done`.
    pub total: usize,
    /// True where it has to be computed.
    pub is_new: bool,
}

/// A target as it is compared with a corpus.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// Smoothed features, for each channel or for all at once.
    pub lanes: Vec<Features>,
    /// Samples at the corpus's rate.
    pub frames: usize,
    /// How many channels it has.
    pub channels: usize,
}

/// What was chosen for a lane of a target.
#[derive(Debug, Clone, PartialEq)]
pub struct Selected {
    /// A unit for each of the lane, and what they cost. Of the greedy selection nothing is proved.
    pub found: Optimum,
    /// How many do not follow the one before.
    pub jumps: usize,
}

impl Corpus {
    /// Opens a corpus, and computes what its cache lacks.
    ///
    /// # Errors
    /// Where there is no corpus of units, a recording cannot be read, or the cache cannot be written.
    pub fn open(folder: &Path, progress: &mut dyn FnMut(Progress)) -> Result<Self> {
        let settings = settings(folder)?;
        let names = manifest::names(folder, &settings)?;
        let mut stamps = Stamps::open(folder);
        let mut hashes = Vec::with_capacity(names.len());
        for name in &names {
            hashes.push(stamps.of(folder, name)?);
        }
        let rates = || hashes.iter().map(|stamp| stamp.rate_hz);
        let rate_hz = match settings.rate_hz.or_else(|| prepare::commonest(rates())) {
            Some(rate_hz) => rate_hz,
            None => return Err(Error::new("the corpus has no recordings").in_file(folder)),
        };
        let extractor = Extractor::new(&settings.features, rate_hz)?;
        let (mut recordings, mut plain) = (Vec::with_capacity(names.len()), Vec::new());
        for (done, (name, stamp)) in names.iter().zip(&hashes).enumerate() {
            let mut told = |is_new: bool| progress(Progress { name, done, total: names.len(), is_new });
            let (cached, features) =
                cache::load(folder, name, stamp, &settings, rate_hz, &extractor, &mut told)?;
            recordings.push(cached);
            plain.push(features);
        }
        stamps.write(folder)?;
        Self::assemble(settings, rate_hz, recordings, plain)
    }

    fn assemble(
        settings: Settings,
        rate_hz: u32,
        recordings: Vec<Cached>,
        plain: Vec<Vec<Features>>,
    ) -> Result<Self> {
        let (mut streams, mut starts, mut values, mut dimensions) = (Vec::new(), vec![0], Vec::new(), 0);
        for (recording, channels) in plain.into_iter().enumerate() {
            let lanes = match settings.features.channels {
                Channels::Separate => channels,
                Channels::Joint => vec![Features::side_by_side(&channels)],
            };
            for (channel, lane) in lanes.into_iter().enumerate() {
                if dimensions != 0 && dimensions != lane.dimensions() {
                    let count = |recording: &Cached| recording.channels;
                    return Err(Error::new(format!(
                        "the recording has {} channels, expected {} as the others have",
                        count(&recordings[recording]),
                        count(&recordings[0])
                    ))
                    .in_file(&recordings[recording].path)
                    .help("channels that belong together must be as many in all recordings"));
                }
                dimensions = lane.dimensions();
                // Nothing is smoothed across the ends of recordings.
                values.extend_from_slice(smooth(&lane, &settings.widths).values());
                let is_joint = settings.features.channels == Channels::Joint;
                streams.push(Stream { recording, channel: (!is_joint).then_some(channel) });
                starts.push(values.len() / dimensions);
            }
        }
        Ok(Self {
            settings,
            rate_hz,
            recordings,
            streams,
            starts,
            features: Features::new(dimensions, values),
        })
    }

    /// Its table `[units]`.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Samples a second.
    pub fn rate_hz(&self) -> u32 {
        self.rate_hz
    }

    /// Samples of a unit.
    pub fn unit_samples(&self) -> usize {
        self.settings.features.unit_samples(self.rate_hz)
    }

    /// Length of a unit, of whole samples.
    pub fn unit_s(&self) -> f64 {
        self.unit_samples() as f64 / f64::from(self.rate_hz)
    }

    /// Smoothed features of all units.
    pub fn features(&self) -> &Features {
        &self.features
    }

    /// How many units each stream has.
    pub fn stream_units(&self) -> Vec<usize> {
        self.starts.windows(2).map(|pair| pair[1] - pair[0]).collect()
    }

    /// Recordings, by their names, with their lengths in seconds.
    pub fn recordings(&self) -> impl Iterator<Item = (&str, f64)> {
        self.recordings.iter().map(|r| (r.name.as_str(), r.frames as f64 / f64::from(self.rate_hz)))
    }

    /// What a warp of this corpus is of.
    pub fn basis(&self) -> Basis {
        Basis::of(&self.settings, self.rate_hz)
    }

    /// An index of all units.
    ///
    /// # Errors
    /// Those of [`Index::new`].
    pub fn index(&self) -> Result<Index> {
        Index::new(&self.features, &self.stream_units(), self.settings.selection.look_ahead)
    }

    /// The recording, channel from 0 and seconds at which a unit begins.
    pub fn at(&self, unit: usize) -> (&str, usize, f64) {
        let place = self.place(unit);
        let stream = self.streams[place.stream];
        let name = self.recordings[stream.recording].name.as_str();
        (name, stream.channel.unwrap_or(0), place.start as f64 / f64::from(self.rate_hz))
    }

    /// A recording as what a corpus is compared with.
    ///
    /// # Errors
    /// A rate from which it cannot be resampled, or where channels belong together, as many as the corpus does not have.
    pub fn target(&self, recording: Recording) -> Result<Target> {
        let channels = recording.channels.len();
        let own = self.recordings.first().map_or(0, |recording| recording.channels);
        if self.settings.features.channels == Channels::Joint && channels != own {
            return Err(Error::new(format!(
                "the target has {channels} channels, the corpus's recordings have {own}"
            ))
            .help("the corpus has channels that belong together, as for two ears"));
        }
        let extractor = Extractor::new(&self.settings.features, self.rate_hz)?;
        let mut frames = 0;
        let mut lanes = Vec::with_capacity(channels);
        for channel in recording.channels {
            let sound =
                prepared(channel, recording.rate_hz, self.rate_hz, self.settings.features.high_pass_hz)?;
            frames = sound.len();
            lanes.push(extractor.features(&sound));
        }
        if self.settings.features.channels == Channels::Joint {
            lanes = vec![Features::side_by_side(&lanes)];
        }
        let lanes = lanes.iter().map(|lane| smooth(lane, &self.settings.widths)).collect();
        Ok(Target { lanes, frames, channels })
    }

    /// The features of the units that correspondences pair.
    ///
    /// # Errors
    /// Clips that reach beyond their sound and recordings that the corpus does not have, with the line.
    pub fn clips(&self, target: &Target, correspondences: &[Correspondence]) -> Result<Vec<Clip>> {
        correspondences.iter().map(|pair| self.clip(target, pair)).collect()
    }

    fn clip(&self, target: &Target, pair: &Correspondence) -> Result<Clip> {
        let at = |what: String| Error::new(what).at(Place::Line { line: pair.line, column: 0 });
        let unit_s = self.unit_s();
        let count = ((pair.duration_s / unit_s).round() as usize).max(1);
        let first = |seconds: f64| (seconds / unit_s).round() as usize;
        let is_joint = self.settings.features.channels == Channels::Joint;
        let lane = target.lanes.get(if is_joint { 0 } else { pair.target_channel });
        let lane = lane.ok_or_else(|| {
            at(format!("target_channel is {}, the target has {}", pair.target_channel + 1, target.channels))
        })?;
        let rows = |features: &Features, from: usize| -> Vec<Vec<f64>> {
            (from..from + count).map(|i| features.row(i).iter().map(|v| f64::from(*v)).collect()).collect()
        };
        let beyond = |what: &str, from_s: f64, units: usize| {
            let (to_s, length_s) = (from_s + pair.duration_s, units as f64 * unit_s);
            at(format!(
                "the clip from {from_s} to {to_s} s is not within {what}, which lasts {length_s:.3} s"
            ))
        };
        let from = first(pair.target_s);
        if from.saturating_add(count) > lane.len() {
            return Err(beyond("the target", pair.target_s, lane.len()));
        }
        let names: Vec<&str> = self.recordings.iter().map(|recording| &*recording.name).collect();
        let recording =
            find(&names, &pair.recording).map_err(|e| e.at(Place::Line { line: pair.line, column: 0 }))?;
        let wanted = Stream { recording, channel: (!is_joint).then_some(pair.source_channel) };
        let stream = self.streams.iter().position(|stream| *stream == wanted).ok_or_else(|| {
            let channels = self.recordings[recording].channels;
            at(format!("source_channel is {}, {} has {channels}", pair.source_channel + 1, pair.recording))
        })?;
        let (start, units) = (self.starts[stream], self.starts[stream + 1] - self.starts[stream]);
        let to = first(pair.source_s);
        if to.saturating_add(count) > units {
            return Err(beyond(&pair.recording, pair.source_s, units));
        }
        Ok(Clip {
            target_s: pair.target_s,
            recording: self.recordings[recording].name.clone(),
            source_s: pair.source_s,
            duration_s: pair.duration_s,
            from: rows(lane, from),
            to: rows(&self.features, start + to),
        })
    }

    /// Chooses units for a target, for each of its lanes. Without a warp, features are compared as they are.
    ///
    /// # Errors
    /// Those of [`greedy`], and a warp of other dimensions.
    pub fn select(&self, target: &Target, warp: Option<&Warp>, best: bool) -> Result<Vec<Selected>> {
        let index = self.index()?;
        let identity = Warp::identity(self.features.dimensions());
        let warp = warp.unwrap_or(&identity);
        let selection = &self.settings.selection;
        let lanes: Vec<Result<Selected>> = target
            .lanes
            .par_iter()
            .map(|lane| {
                let warped = warp.apply_all(lane)?;
                let found = match best {
                    true => optimal(&index, &warped, selection)?,
                    false => {
                        let chosen = greedy(&index, &warped, selection)?;
                        let cost = optimal::cost(&index, &chosen, selection);
                        Optimum {
                            chosen,
                            cost,
                            greedy_cost: cost,
                            is_best_of_candidates: false,
                            is_best: false,
                        }
                    }
                };
                let pairs = found.chosen.windows(2);
                let jumps = pairs.filter(|pair| !index.follows(pair[0].unit, pair[1].unit)).count();
                Ok(Selected { found, jumps })
            })
            .collect();
        lanes.into_iter().collect()
    }

    /// Whether a warp is of features such as this corpus has.
    ///
    /// # Errors
    /// Names the first difference.
    pub fn check_basis(&self, basis: &Basis) -> Result<()> {
        let own = self.basis();
        let differs = if own.rate_hz != basis.rate_hz {
            format!("a rate of {} Hz, the corpus has {} Hz", basis.rate_hz, own.rate_hz)
        } else if own.widths != basis.widths {
            format!("widths {:?}, the corpus has {:?}", basis.widths, own.widths)
        } else if own.features != basis.features {
            "units and features that are not those of the corpus".to_owned()
        } else {
            return Ok(());
        };
        Err(Error::new(format!("the warp was fitted to {differs}")).help("fit it again with this corpus"))
    }
}

impl Sound for Corpus {
    fn place(&self, unit: usize) -> UnitPlace {
        place_of(&self.starts, unit, self.unit_samples())
    }

    fn frames(&self, stream: usize) -> usize {
        self.recordings[self.streams[stream].recording].frames
    }

    fn read(&self, stream: usize, channel: usize, from: i64, samples: &mut [f32]) -> Result<()> {
        let Stream { recording, channel: own } = self.streams[stream];
        self.recordings[recording].read(own.unwrap_or(channel), from, samples)
    }

    fn largest_step(&self, stream: usize, channel: usize) -> f32 {
        let Stream { recording, channel: own } = self.streams[stream];
        self.recordings[recording].largest_step(own.unwrap_or(channel))
    }
}

/// A folder as it is called from a corpus, which need not be there yet.
///
/// # Errors
/// Where the working folder cannot be told.
pub fn relative(folder: &Path, corpus: &Path) -> Result<String> {
    crate::corpus::dictionary::builder::scan::relative(folder, corpus)
}

/// One channel at a rate, after the high-pass.
fn prepared(channel: Vec<f32>, from_hz: u32, to_hz: u32, high_pass_hz: f64) -> Result<Vec<f32>> {
    let mut sound = prepare::at_rate(channel, from_hz, to_hz)?;
    HighPass::new(high_pass_hz, to_hz)?.process(&mut sound);
    Ok(sound)
}

/// Where a recording lies.
fn path_of(folder: &Path, name: &str) -> PathBuf {
    folder.join(name)
}

#[cfg(test)]
mod tests;
