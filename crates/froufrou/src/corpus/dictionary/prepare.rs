//! From a sound to its parts and where they are cut.

use std::collections::BTreeMap;

use super::{Part, Settings};
use crate::corpus::grains::{Contact, GrainKind, Segment};
use crate::corpus::spectral::check_sound;
use crate::error::{Error, Result};
use crate::synth::sinc;

/// The rate of most; of rates that are as frequent, the highest.
pub(super) fn commonest(rates: impl IntoIterator<Item = u32>) -> Option<u32> {
    let mut counts: BTreeMap<u32, usize> = BTreeMap::new();
    rates.into_iter().for_each(|rate| *counts.entry(rate).or_default() += 1);
    counts.into_iter().max_by_key(|&(rate, count)| (count, rate)).map(|(rate, _)| rate)
}

/// The sound at another rate; sample 0 stays where it is.
pub(super) fn at_rate(samples: Vec<f32>, from_hz: u32, to_hz: u32) -> Result<Vec<f32>> {
    check_sound(&samples, from_hz)?;
    check_sound(&samples, to_hz)?;
    if from_hz == to_hz {
        return Ok(samples);
    }
    let ratio = f64::from(from_hz) / f64::from(to_hz);
    if ratio > sinc::MAX_RATIO {
        return Err(Error::new(format!("a sound of {from_hz} Hz cannot be brought to {to_hz} Hz")));
    }
    let length = (samples.len() as u64 * u64::from(to_hz)).div_ceil(u64::from(from_hz));
    let mut out = vec![0.0; length as usize];
    sinc::resample(&samples, 0.0, ratio, &mut out);
    Ok(out)
}

/// What grains are cut from: an impulsive sound itself, the sinusoids and the residual of a continuous one.
pub(super) fn parts(
    samples: Vec<f32>,
    rate_hz: u32,
    contact: Contact,
    settings: &Settings,
) -> Result<Vec<Part>> {
    Ok(match contact {
        Contact::Impulsive => vec![Part { kind: GrainKind::Impulsive, samples }],
        Contact::Continuous => {
            let split = settings.spectral.split(&samples, rate_hz)?;
            vec![
                Part { kind: GrainKind::Sinusoidal, samples: split.sinusoids },
                Part { kind: GrainKind::Transient, samples: split.residual },
            ]
        }
    })
}

/// What lies between the cuts, as far as it is loud enough, with what its window reaches beyond them.
pub(super) fn segments(parts: &[Part], rate_hz: u32, settings: &Settings) -> Result<Vec<Segment>> {
    let extraction = &settings.extraction;
    let cut: Vec<(&[f32], GrainKind)> = parts.iter().map(|part| (&*part.samples, part.kind)).collect();
    let mut segments = extraction.segments(&cut, rate_hz)?;
    let length = parts.first().map_or(0, |part| part.samples.len());
    for segment in &mut segments {
        // A taper is r/2 of the window's length w, and half of it lies beyond the cut: w = l + 2 · r w / 4.
        let beyond = extraction.taper * segment.length as f64 / (4.0 - 2.0 * extraction.taper);
        let beyond = beyond.round() as usize;
        let start = segment.start.saturating_sub(beyond);
        segment.length = (segment.start + segment.length + beyond).min(length) - start;
        segment.start = start;
    }
    Ok(segments)
}
