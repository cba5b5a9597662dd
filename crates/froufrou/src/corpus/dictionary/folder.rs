//! Reading a corpus: a folder with its `corpus.toml`.

use std::path::Path;

use rayon::prelude::*;

use super::assemble::{Cut, Sound};
use super::index::{self, Item};
use super::manifest::{AGAIN, FILE_NAME, Listed, Manifest, Storage};
use super::{Dictionary, audio, packed, prepare, sinusoids};
use crate::corpus::grains::Contact;
use crate::corpus::grains::patterns::Peak;
use crate::error::{Error, Result};

impl Dictionary {
    /// Opens a corpus: its folder. Splits of continuous recordings that are not in its cache are made anew; nothing is
    /// written.
    ///
    /// # Errors
    /// Where there is no corpus, a file of it is missing or damaged, or they do not belong together.
    pub fn open(folder: &Path) -> Result<Self> {
        let manifest = Manifest::open(folder)?;
        Self::of(folder, &manifest)
    }

    /// Opens a corpus whose `corpus.toml` is known.
    ///
    /// # Errors
    /// Those of [`Dictionary::open`].
    pub fn of(folder: &Path, manifest: &Manifest) -> Result<Self> {
        let items = items(folder, manifest)?;
        let sounds: Vec<Result<Vec<f32>>> =
            manifest.recording.par_iter().map(|listed| sound(folder, manifest, listed)).collect();
        let sounds = sounds.into_iter().collect::<Result<Vec<_>>>()?;
        let sounds = filled(folder, manifest, &items, sounds)?;
        let (rate_hz, settings) = (manifest.rate_hz, &manifest.settings);
        let parts: Vec<Result<_>> = sounds
            .into_par_iter()
            .zip(&manifest.recording)
            .map(|(samples, listed)| sinusoids::parts(folder, samples, rate_hz, listed.contact, settings))
            .collect();
        let mut cut = Vec::with_capacity(items.len());
        let mut peaks: Vec<Vec<Peak>> = Vec::with_capacity(items.len());
        for ((parts, item), listed) in parts.into_iter().zip(items).zip(&manifest.recording) {
            let Listed { name, contact, action, .. } = listed.clone();
            let parts = parts.map_err(|e| e.in_file(folder.join(FILE_NAME)))?;
            cut.push(Sound { name, contact, action, parts, segments: item.segments });
            peaks.push(item.peaks);
        }
        Ok(Cut::new(rate_hz, settings, cut).assemble(&peaks))
    }
}

/// The file of grains and patterns.
pub(super) fn items(folder: &Path, manifest: &Manifest) -> Result<Vec<Item>> {
    let name = format!("{}.grains", manifest.patterns);
    let path = audio::path(folder, &name);
    let bytes = audio::read(folder, &name)?;
    let contacts: Vec<Contact> = manifest.recording.iter().map(|listed| listed.contact).collect();
    let told = |e: Error| e.in_file(&path).help(AGAIN);
    let items = index::read(&bytes, &contacts).map_err(told)?;
    match items.iter().zip(&manifest.recording).find(|(item, listed)| item.audio != listed.audio) {
        Some((_, listed)) => {
            Err(told(Error::new(format!("the grains of {} are those of other sound", listed.name))))
        }
        None => Ok(items),
    }
}

/// The stored sound of one recording, or that of its own file.
fn sound(folder: &Path, manifest: &Manifest, listed: &Listed) -> Result<Vec<f32>> {
    if manifest.storage != Storage::None {
        let mut sound = audio::decode(folder, &listed.audio, manifest.storage, manifest.rate_hz)?;
        prepare::double(&mut sound, listed.halvings);
        return Ok(sound);
    }
    let path = manifest.source(folder, listed);
    let bytes = std::fs::read(&path).map_err(|e| {
        Error::io("open", &path, e)
            .help("this corpus has no sound of its own; build it with `--store flac` or `--store vorbis`")
    })?;
    if packed::hash(&[&bytes]) != listed.hash {
        return Err(Error::new("the recording is not what the corpus was built from")
            .in_file(path)
            .help(AGAIN));
    }
    Ok(prepare::recording(&bytes, &path, manifest.rate_hz, &manifest.settings)?.sound())
}

/// Sounds with what they share with one another.
fn filled(
    folder: &Path,
    manifest: &Manifest,
    items: &[Item],
    mut sounds: Vec<Vec<f32>>,
) -> Result<Vec<Vec<f32>>> {
    for (number, (item, listed)) in items.iter().zip(&manifest.recording).enumerate() {
        let fault = |what: String| {
            let file = audio::name(&listed.audio, manifest.storage).unwrap_or_default();
            Error::new(what).in_file(audio::path(folder, &file)).help(AGAIN)
        };
        if sounds[number].len() != item.length {
            return Err(fault(format!("expected {} samples, found {}", item.length, sounds[number].len())));
        }
        fill(number, item, &mut sounds).map_err(|e| fault(e.to_string()))?;
    }
    Ok(sounds)
}

/// Fills one recording's shared stretches from what comes before.
pub(super) fn fill(number: usize, item: &Item, sounds: &mut [Vec<f32>]) -> Result<()> {
    for share in &item.shares {
        let there = share.from.checked_add(share.length).and_then(|end| {
            let source = sounds.get(share.recording)?;
            source.get(share.from..end).map(<[f32]>::to_vec)
        });
        let Some(there) = there else {
            return Err(Error::new("a shared stretch reaches beyond its recording"));
        };
        for (to, from) in sounds[number][share.start..][..share.length].iter_mut().zip(there) {
            *to = share.gain * from;
        }
    }
    Ok(())
}
