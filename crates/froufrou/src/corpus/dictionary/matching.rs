//! Where grains fit, and which of those places are kept.

use std::collections::BTreeMap;

use super::assemble::Cut;
use super::index::stepped;
use super::{Dictionary, Part, Settings, fits};
use crate::corpus::grains::patterns::{Matcher, Peak};
use crate::error::{Error, Result};

/// The peaks that are kept, of all grains in each recording.
pub(super) fn all(cut: &Cut, settings: &Settings) -> Result<Vec<Vec<Peak>>> {
    let dictionary = cut.dictionary();
    let grains: Vec<usize> = (0..dictionary.grains().len()).collect();
    (0..dictionary.recordings().len())
        .map(|recording| {
            let peaks = peaks(dictionary, cut.parts(recording), &grains, settings)?;
            Ok(kept(dictionary, recording, peaks, settings))
        })
        .collect()
}

/// All peaks of some grains in the parts of one recording.
pub(super) fn peaks(
    dictionary: &Dictionary,
    parts: &[Part],
    grains: &[usize],
    settings: &Settings,
) -> Result<Vec<Peak>> {
    let count = dictionary.grains().len();
    if u32::try_from(count).is_err() {
        return Err(Error::new(format!("expected fewer than 2³² grains, found {count}")));
    }
    let mut found = Vec::new();
    for part in parts {
        let numbers: Vec<usize> =
            grains.iter().copied().filter(|&grain| fits(dictionary.grains[grain].kind, part.kind)).collect();
        let samples = numbers.iter().map(|&grain| dictionary.samples(grain)).collect();
        // So that a recording that comes later finds what it would have found at once.
        let groups = numbers.iter().map(|&grain| dictionary.grains[grain].recording).collect();
        let matcher = Matcher::new(settings.matching.clone(), samples, dictionary.rate_hz)?.grouped(groups);
        let peaks = matcher.pattern(&part.samples)?;
        // Numbers were held against 32 bits.
        found.extend(
            peaks.into_iter().map(|peak| Peak { grain: numbers[peak.grain as usize] as u32, ..peak }),
        );
    }
    Ok(found)
}

/// Of all peaks in a recording those that a walk may choose from: the best of each slot, of its own grains and of
/// others' apart. Its own grains about their own places are left out.
pub(super) fn kept(
    dictionary: &Dictionary,
    recording: usize,
    peaks: Vec<Peak>,
    settings: &Settings,
) -> Vec<Peak> {
    let rate = f64::from(dictionary.rate_hz);
    let slot = ((settings.slot_s * rate).round() as u64).max(1);
    let spacing = (settings.matching.spacing_s * rate).round() as u64;
    let own = &dictionary.recordings[recording].grains;
    let mut slots: BTreeMap<(u64, bool, bool), Vec<Peak>> = BTreeMap::new();
    for peak in peaks {
        let Some(entry) = dictionary.grains.get(peak.grain as usize) else { continue };
        let is_own = own.contains(&(peak.grain as usize));
        if is_own && peak.start.abs_diff(entry.start as u64) <= spacing {
            continue;
        }
        let is_sinusoidal = fits(entry.kind, super::GrainKind::Sinusoidal);
        slots.entry((peak.start / slot, is_sinusoidal, is_own)).or_default().push(peak);
    }
    let best = slots.into_iter().flat_map(|((_, _, is_own), mut peaks)| {
        peaks.sort_by(|a, b| {
            b.correlation.total_cmp(&a.correlation).then(a.start.cmp(&b.start)).then(a.grain.cmp(&b.grain))
        });
        peaks.truncate(if is_own { settings.candidates.div_ceil(2) } else { settings.candidates });
        peaks
    });
    let mut best: Vec<Peak> =
        best.map(|peak| Peak { correlation: stepped(peak.correlation), ..peak }).collect();
    best.sort_by_key(|peak| (peak.start, peak.grain));
    best
}
