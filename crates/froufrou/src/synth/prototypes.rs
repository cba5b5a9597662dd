//! The prototype sounds of a score: its recordings, read and made ready to be played.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use rayon::prelude::*;

use super::voice::Prototype;
use crate::corpus::looping::seamless_loop;
use crate::corpus::recording::Recording;
use crate::score::{Repeat, Sound};
use crate::{Error, Result};

/// Reads the recordings of a score, each file once and on all cores. `folder` is that of the score.
/// The order is that of the sounds.
///
/// # Errors
/// A recording that cannot be read, or one without the channel that a sound asks for.
pub fn load(sounds: &[Sound], folder: &Path) -> Result<Vec<(String, Prototype)>> {
    let mut files: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (index, sound) in sounds.iter().enumerate() {
        files.entry(&sound.recording).or_default().push(index);
    }
    let files: Vec<(&str, Vec<usize>)> = files.into_iter().collect();
    let loaded: Vec<Vec<(usize, Prototype)>> = files
        .par_iter()
        .map(|(name, users)| {
            let path = folder.join(name);
            let recording = Recording::open(&path)?;
            users.iter().map(|&index| Ok((index, prototype(&recording, &sounds[index], &path)?))).collect()
        })
        .collect::<Result<_>>()?;
    let mut prototypes: Vec<(usize, Prototype)> = loaded.into_iter().flatten().collect();
    prototypes.sort_by_key(|&(index, _)| index);
    Ok(prototypes.into_iter().map(|(index, prototype)| (sounds[index].name.clone(), prototype)).collect())
}

fn prototype(recording: &Recording, sound: &Sound, path: &Path) -> Result<Prototype> {
    let samples = match sound.channel {
        None => recording.mono(),
        Some(channel) => recording.channel(channel).map(<[f32]>::to_vec).ok_or_else(|| {
            let count = recording.channels.len();
            Error::new(format!("there is no channel {channel}: the recording has {count}"))
                .in_file(path)
                .help("channels are counted from 0")
        })?,
    };
    let looped = sound.repeat != Repeat::Once;
    let samples = if looped { seamless_loop(&samples, recording.rate_hz, sound.repeat) } else { samples };
    Ok(Prototype { samples: Arc::from(samples), rate_hz: f64::from(recording.rate_hz), looped })
}
