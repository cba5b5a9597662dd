//! The prototype sounds of a score: its recordings, read and made ready to be played, and its
//! synthesised sounds.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use rayon::prelude::*;

use super::cloth::Cloth;
use super::grains::Grains;
use super::instrument::{Instrument, Parameters};
use super::membrane::Membrane;
use super::mixer::Sounding;
use super::modal::bar::Ends;
use super::modal::{self, Modes, Shape};
use super::needle::Needle;
use super::paper::Paper;
use super::procedure::Procedure;
use super::stick_slip::StickSlip;
use super::turbulence::Turbulence;
use super::voice::Prototype;
use crate::corpus::cloth::ClothSound;
use crate::corpus::dictionary::Dictionary;
use crate::corpus::looping::seamless_loop;
use crate::corpus::paper::PaperSound;
use crate::corpus::recording::Recording;
use crate::score::{Held, Make, Repeat, Sound};
use crate::{Error, Place, Result};

/// The sounds of a score, by name and ready to be played.
pub type Soundings = Vec<(String, Sounding)>;

/// Reads the recordings of a score, each file once and on all cores, and prepares its synthesised
/// sounds. `folder` is that of the score. The order is that of the sounds.
///
/// # Errors
/// A recording that cannot be read, or one without the channel that a sound asks for; a synthesised
/// sound with numbers that it cannot have.
pub fn load(sounds: &[Sound], folder: &Path) -> Result<Soundings> {
    let mut files: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    let mut made = Vec::new();
    for (index, sound) in sounds.iter().enumerate() {
        match &sound.make {
            Make::Recording { path, .. } => files.entry(path).or_default().push(index),
            make => made.push((index, Sounding::Instrument(instrument(sound, make, folder)?))),
        }
    }
    let files: Vec<(&str, Vec<usize>)> = files.into_iter().collect();
    let loaded: Vec<Vec<(usize, Sounding)>> = files
        .par_iter()
        .map(|(name, users)| {
            let path = folder.join(name);
            let recording = Recording::open(&path)?;
            let soundings =
                users.iter().map(|&index| Ok((index, prototype(&recording, &sounds[index], &path)?.into())));
            soundings.collect()
        })
        .collect::<Result<_>>()?;
    made.extend(loaded.into_iter().flatten());
    made.sort_by_key(|&(index, _)| index);
    Ok(made.into_iter().map(|(index, sounding)| (sounds[index].name.clone(), sounding)).collect())
}

/// A synthesised sound, ready to be played.
fn instrument(sound: &Sound, make: &Make, folder: &Path) -> Result<Arc<dyn Instrument>> {
    let named = |fault: Error| {
        // A file's fault says more by its own place.
        if fault.file().is_some() { fault } else { fault.at(Place::Part(format!("sound {}", sound.name))) }
    };
    let bar = |ends| modal::bar::modes(ends, &sound.with);
    let made: Result<Arc<dyn Instrument>> = match make {
        Make::String => modal::string::modes(&sound.with).map(|modes| Arc::new(modes) as _),
        Make::Bar(Held::Supported) => bar(Ends::Supported).map(|modes| Arc::new(modes) as _),
        Make::Bar(Held::Free) => bar(Ends::Free).map(|modes| Arc::new(modes) as _),
        Make::Bar(Held::Clamped) => bar(Ends::Clamped).map(|modes| Arc::new(modes) as _),
        Make::Modes { table, modes } => {
            Parameters::new(&sound.with).finish().and_then(|()| body(table.as_deref(), modes, folder))
        }
        Make::Needle => Needle::new(&sound.with).map(|needle| Arc::new(needle) as _),
        Make::StickSlip => StickSlip::new(&sound.with).map(|body| Arc::new(body) as _),
        Make::Membrane => Membrane::new(&sound.with).map(|sheet| Arc::new(sheet) as _),
        Make::Turbulence => Turbulence::new(&sound.with).map(|air| Arc::new(air) as _),
        Make::Procedure { script } => {
            Procedure::open(folder.join(script), &sound.with).map(|procedure| Arc::new(procedure) as _)
        }
        Make::Grains { corpus } => Parameters::new(&sound.with)
            .finish()
            .and_then(|()| Dictionary::open(&folder.join(corpus)))
            .map(|dictionary| Arc::new(Grains::new(Arc::new(dictionary))) as _),
        Make::Cloth { corpus } => ClothSound::named(corpus, folder)
            .and_then(|cloth| Cloth::new(Arc::new(cloth), &sound.with))
            .map(|cloth| Arc::new(cloth) as _),
        Make::Paper { corpus } => PaperSound::named(corpus, folder)
            .and_then(|paper| Paper::new(Arc::new(paper), &sound.with))
            .map(|paper| Arc::new(paper) as _),
        Make::Recording { .. } => Err(Error::new("a recording is no instrument")),
    };
    made.map_err(named)
}

/// A body from a table of modes, from modes that stand in the score, or from both.
fn body(table: Option<&str>, modes: &[crate::score::Mode], folder: &Path) -> Result<Arc<dyn Instrument>> {
    let mut all = match table {
        Some(table) => modal::table::open(folder.join(table))?.modes().to_vec(),
        None => Vec::new(),
    };
    all.extend(modes.iter().map(|mode| modal::Mode {
        frequency_hz: mode.frequency_hz,
        decay_per_s: mode.decay_per_s,
        gain: mode.gain,
        shape: if mode.points.is_empty() { Shape::Everywhere } else { Shape::Points(mode.points.clone()) },
    }));
    Ok(Arc::new(Modes::new(all)?))
}

fn prototype(recording: &Recording, sound: &Sound, path: &Path) -> Result<Prototype> {
    let Make::Recording { repeat, channel, .. } = sound.make else {
        return Err(Error::new(format!("the sound {} is no recording", sound.name)));
    };
    let samples = match channel {
        None => recording.mono(),
        Some(channel) => recording.channel(channel).map(<[f32]>::to_vec).ok_or_else(|| {
            let count = recording.channels.len();
            Error::new(format!("there is no channel {channel}: the recording has {count}"))
                .in_file(path)
                .help("channels are counted from 0")
        })?,
    };
    let looped = repeat != Repeat::Once;
    let samples = if looped { seamless_loop(&samples, recording.rate_hz, repeat) } else { samples };
    Ok(Prototype { samples: Arc::from(samples), rate_hz: f64::from(recording.rate_hz), looped })
}
