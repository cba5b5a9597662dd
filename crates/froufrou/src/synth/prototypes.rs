//! The prototype sounds of a score: its recordings, read and made ready to be played, and its
//! synthesised sounds.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use rayon::prelude::*;

use super::instrument::Instrument;
use super::mixer::Sounding;
use super::voice::Prototype;
use crate::corpus::looping::seamless_loop;
use crate::corpus::recording::Recording;
use crate::score::{Make, Repeat, Sound};
use crate::{Error, Result};

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

fn instrument(sound: &Sound, make: &Make, folder: &Path) -> Result<Arc<dyn Instrument>> {
    let _ = (make, folder);
    Err(Error::new(format!("the sound {} cannot be made", sound.name)))
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
