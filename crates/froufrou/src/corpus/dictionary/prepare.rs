//! From a sound to its parts and where they are cut.

use std::collections::BTreeMap;
use std::path::Path;

use super::{Part, Settings};
use crate::corpus::grains::{Contact, GrainKind, Segment, energy};
use crate::corpus::recording::Recording;
use crate::corpus::spectral::check_sound;
use crate::error::{Error, Result};
use crate::synth::sinc;

/// The rate of most; of rates that are as frequent, the highest.
pub(crate) fn commonest(rates: impl IntoIterator<Item = u32>) -> Option<u32> {
    let mut counts: BTreeMap<u32, usize> = BTreeMap::new();
    rates.into_iter().for_each(|rate| *counts.entry(rate).or_default() += 1);
    counts.into_iter().max_by_key(|&(rate, count)| (count, rate)).map(|(rate, _)| rate)
}

/// The sound at another rate; sample 0 stays where it is.
pub(in crate::corpus) fn at_rate(samples: Vec<f32>, from_hz: u32, to_hz: u32) -> Result<Vec<f32>> {
    check_sound(&samples, from_hz)?;
    check_sound(&samples, to_hz)?;
    if from_hz == to_hz {
        return Ok(samples);
    }
    let ratio = f64::from(from_hz) / f64::from(to_hz);
    if ratio > sinc::MAX_RATIO {
        return Err(Error::new(format!("a sound of {from_hz} Hz cannot be brought to {to_hz} Hz")));
    }
    let mut out = vec![0.0; length_at_rate(samples.len(), from_hz, to_hz)];
    sinc::resample(&samples, 0.0, ratio, &mut out);
    Ok(out)
}

/// How many samples a sound has at another rate.
pub(in crate::corpus) fn length_at_rate(samples: usize, from_hz: u32, to_hz: u32) -> usize {
    (samples as u64 * u64::from(to_hz)).div_ceil(u64::from(from_hz)) as usize
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
    // A taper is r/2 of the window's length w, and half of it lies beyond the cut: w = l + 2 · r w / 4. Neighbours have the
    // same at their cut, that of the shorter one.
    let shares = extraction.taper / (4.0 - 2.0 * extraction.taper);
    let beyond = |length: usize| ((shares * length as f64).round() as usize).max(1);
    let mut before: Option<Segment> = None;
    for index in 0..segments.len() {
        let own = segments[index];
        let is_next =
            |to: &Segment, from: &Segment| to.kind == from.kind && to.start == from.start + from.length;
        let left =
            before.filter(|before| is_next(&own, before)).map_or(own.length, |b| b.length.min(own.length));
        let after = segments.get(index + 1).filter(|after| is_next(after, &own));
        let right = after.map_or(own.length, |after| after.length.min(own.length));
        let start = own.start.saturating_sub(beyond(left));
        let end = (own.start + own.length + beyond(right)).min(length);
        segments[index] = Segment { start, length: end - start, ..own };
        before = Some(own);
    }
    Ok(segments)
}

/// A recording as grains are cut from it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Prepared {
    /// One channel at the corpus's rate, in steps of 16 bits.
    pub samples: Vec<i16>,
    /// How often it was halved to fit into them.
    pub halvings: u32,
    /// The bytes of 16-bit samples of all its channels at its own rate.
    pub original_bytes: u64,
    /// The sum of squares of what was heard, and of what was lost.
    pub energy: f64,
    pub lost: f64,
}

/// How far what is kept reaches beyond what is loud enough, fading, in seconds.
const FADE_S: f64 = 0.002;

/// How much below the threshold of grains sound is still kept: what is quiet as a whole may have a part that is not.
const MARGIN_DB: f64 = 6.0;

/// Reads an audio file's content: the mean of its channels, at a rate, in 16 bits, and silence where no grain would be
/// loud enough.
pub(super) fn recording(bytes: &[u8], path: &Path, rate_hz: u32, settings: &Settings) -> Result<Prepared> {
    let recording = Recording::decode(bytes, &path.to_string_lossy())?;
    let in_file = |e: Error| e.in_file(path);
    let original_bytes = 2 * (recording.frames() * recording.channels.len()) as u64;
    let sound = at_rate(recording.mono(), recording.rate_hz, rate_hz).map_err(in_file)?;
    let gains = gate(&sound, rate_hz, settings).map_err(in_file)?;
    let mut prepared = Prepared {
        samples: Vec::with_capacity(sound.len()),
        halvings: halvings(&sound),
        original_bytes,
        energy: energy(&sound),
        lost: 0.0,
    };
    let step = FULL_SCALE.recip() * 2f64.powi(prepared.halvings as i32);
    for (value, gain) in sound.iter().zip(gains) {
        let steps = (f64::from(*value) * f64::from(gain) / step).round().clamp(-FULL_SCALE, FULL_SCALE - 1.0);
        prepared.samples.push(steps as i16);
        prepared.lost += (steps * step - f64::from(*value)).powi(2);
    }
    Ok(prepared)
}

/// The steps of 16 bits from 0 to full scale.
const FULL_SCALE: f64 = 32_768.0;

/// How often sound has to be halved to lie within ±1. What lossy files hold often reaches beyond.
fn halvings(sound: &[f32]) -> u32 {
    let peak = sound.iter().fold(0.0f32, |peak, v| peak.max(v.abs()));
    // Down to the last step below full scale nothing that is heard is lost.
    peak.log2().ceil().max(0.0) as u32
}

impl Prepared {
    /// The sound as it was before it was halved.
    pub fn sound(&self) -> Vec<f32> {
        let mut sound = self.samples.iter().map(|v| f32::from(*v) / FULL_SCALE as f32).collect::<Vec<f32>>();
        double(&mut sound, self.halvings);
        sound
    }
}

/// Undoes halving.
pub(super) fn double(sound: &mut [f32], times: u32) {
    if times > 0 {
        let gain = 2f32.powi(times as i32);
        sound.iter_mut().for_each(|v| *v *= gain);
    }
}

/// 1 where something is loud enough, and 0 where nothing is.
fn gate(sound: &[f32], rate_hz: u32, settings: &Settings) -> Result<Vec<f32>> {
    let mut extraction = settings.extraction.clone();
    extraction.threshold_db -= MARGIN_DB;
    let fade = ((FADE_S * f64::from(rate_hz)).round() as usize).max(1);
    let mut gains = vec![0.0f32; sound.len()];
    for segment in extraction.segments(&[(sound, GrainKind::Impulsive)], rate_hz)? {
        let end = segment.start + segment.length;
        gains[segment.start..end].fill(1.0);
        let ramp = |i: usize| 1.0 - (i + 1) as f32 / (fade + 1) as f32;
        for i in 0..fade {
            if let Some(gain) = gains.get_mut(end + i) {
                *gain = gain.max(ramp(i));
            }
            if let Some(gain) = segment.start.checked_sub(i + 1).and_then(|at| gains.get_mut(at)) {
                *gain = gain.max(ramp(i));
            }
        }
    }
    Ok(gains)
}
