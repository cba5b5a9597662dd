//! Spectra of friction from recordings whose speed is known (An, James & Marschner 2012): clips of 50 ms under a
//! triangular window, gathered by their speeds.
//!
//! Clips begin every 25 ms. A take of one steady speed gives one spectrum; the clips of takes whose speed changes are
//! gathered in bins that are evenly wide on a logarithmic scale. In a bin the powers are averaged, so the more clips there are the
//! smoother the spectrum is, and so are speeds. Takes in which nothing moves tell the noise of the room, whose
//! power is taken off.

use realfft::RealFftPlanner;
use serde::{Deserialize, Serialize};

use super::motion::{Motion, Seams};
use super::spectra::{FrictionSpectra, SPACING_HZ, Spectrum};
use crate::error::{Error, Place, Result};

/// The length of a clip.
pub const CLIP_S: f64 = 0.05;

/// What lies between the beginnings of two clips.
pub const HOP_S: f64 = 0.025;

/// How takes become spectra.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Gathering {
    /// Bins of speed between the slowest and the fastest clip, for takes whose speed changes.
    pub bins: usize,
    /// A bin of fewer clips is left out.
    pub least_clips: usize,
    /// Clips slower than this are left out of takes whose speed changes.
    pub slowest_mps: f64,
}

impl Default for Gathering {
    fn default() -> Self {
        Self { bins: 8, least_clips: 4, slowest_mps: 0.005 }
    }
}

impl Gathering {
    /// Refuses settings that make no sense.
    ///
    /// # Errors
    /// A setting out of its range.
    pub fn check(&self) -> Result<()> {
        let fault = |key: &str, what: String| Err(Error::new(what).at(Place::Part(key.to_owned())));
        if !(1..=1000).contains(&self.bins) {
            return fault("bins", format!("there are {} bins of speed, expected 1 to 1000", self.bins));
        }
        if self.least_clips == 0 {
            return fault("least_clips", "a bin of no clips has no spectrum".to_owned());
        }
        if !(1e-6..=1e3).contains(&self.slowest_mps) {
            return fault("slowest_mps", format!("it is {} m/s, expected more than 0", self.slowest_mps));
        }
        Ok(())
    }
}

/// A recording of friction in memory.
#[derive(Debug, Clone)]
pub struct Take {
    /// What it is called, for errors.
    pub name: String,
    /// One channel, nominally within ±1.
    pub samples: Vec<f32>,
    /// Samples a second.
    pub rate_hz: f64,
    /// How fast the cloth moved.
    pub motion: Motion,
    /// What is left out.
    pub seams: Seams,
}

/// What a take came to.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Counts {
    /// Clips that were used.
    pub clips: usize,
    /// Clips that were left out for a seam.
    pub seams: usize,
    /// Clips that were left out for being too slow, or beyond the end of the track.
    pub unknown: usize,
}

/// A clip by its place in a take, and how fast it is.
struct Clip {
    take: usize,
    first: usize,
    speed_mps: f64,
}

/// Measures spectra.
///
/// # Errors
/// Takes of which no spectrum can be made, a take shorter than a clip, or a rate below 2 kHz.
pub fn measure(takes: &[Take], gathering: &Gathering) -> Result<(FrictionSpectra, Vec<Counts>)> {
    gathering.check()?;
    let named = |take: &Take, what: String| Err(Error::new(what).at(Place::Part(take.name.clone())));
    for take in takes {
        if !(2e3..=1e6).contains(&take.rate_hz) {
            return named(take, format!("the rate is {} Hz, expected 2000 to 1000000 Hz", take.rate_hz));
        }
        if take.samples.len() < clip_samples(take.rate_hz) {
            return named(take, format!("the take is shorter than a clip of {CLIP_S} s"));
        }
        take.seams.check().map_err(|e| e.at(Place::Part(take.name.clone())))?;
    }
    if takes.is_empty() {
        return Err(Error::new("there are no takes of friction"));
    }
    let mut counts = vec![Counts::default(); takes.len()];
    let (mut steady, mut moving, mut still): (Vec<Clip>, Vec<Clip>, Vec<Clip>) = Default::default();
    for (index, take) in takes.iter().enumerate() {
        let count = &mut counts[index];
        let is_steady = matches!(take.motion, Motion::Steady(_));
        for clip in clips(index, take, count) {
            if is_steady && clip.speed_mps == 0.0 {
                still.push(clip);
            } else if is_steady {
                steady.push(clip);
            } else if clip.speed_mps >= gathering.slowest_mps {
                moving.push(clip);
            } else {
                count.unknown += 1;
                continue;
            }
            count.clips += 1;
        }
    }
    // As far up as all takes reach.
    let lowest_hz = takes.iter().map(|take| take.rate_hz).fold(f64::INFINITY, f64::min);
    let values = ((lowest_hz / 2.0 / SPACING_HZ).ceil() as usize).saturating_sub(1);
    let mut planner = RealFftPlanner::new();
    let mut mean = |clips: &[&Clip]| mean_power(clips, takes, values, &mut planner);
    let noise = match still.as_slice() {
        [] => vec![0.0; values],
        clips => mean(&clips.iter().collect::<Vec<_>>()),
    };
    let mut spectra: Vec<Spectrum> = Vec::new();
    for bin in gathered(&steady, &moving, gathering) {
        let first_mps = bin[0].speed_mps;
        // About the first, so that a speed that all have is not rounded.
        let off = bin.iter().map(|clip| clip.speed_mps - first_mps).sum::<f64>() / bin.len() as f64;
        let speed_mps = first_mps + off;
        let heard = mean(&bin);
        let density =
            heard.iter().zip(&noise).map(|(power, noise)| (power - noise).max(0.0).sqrt()).collect();
        spectra.push(Spectrum { speed_mps, density });
    }
    if spectra.is_empty() {
        return Err(Error::new("no clip of friction is fast enough, known and free of seams").help(
            "each bin needs `least_clips` clips of at least `slowest_mps`; a take has a speed, a track or an encoder",
        ));
    }
    Ok((FrictionSpectra::new(SPACING_HZ, spectra)?, counts))
}

/// Clips by bins: one for each speed of steady takes, and those of moving takes between their slowest and fastest. A bin of
/// moving takes whose mean is that of a steady one joins it.
fn gathered<'a>(steady: &'a [Clip], moving: &'a [Clip], gathering: &Gathering) -> Vec<Vec<&'a Clip>> {
    let mut bins: Vec<Vec<&Clip>> = Vec::new();
    for clip in steady {
        match bins.iter_mut().find(|bin| bin[0].speed_mps == clip.speed_mps) {
            Some(bin) => bin.push(clip),
            None => bins.push(vec![clip]),
        }
    }
    let speeds = || moving.iter().map(|clip| clip.speed_mps);
    let (slowest, fastest) = (speeds().fold(f64::INFINITY, f64::min), speeds().fold(0.0, f64::max));
    let octaves = (fastest / slowest).log2();
    let mut own: Vec<Vec<&Clip>> = vec![Vec::new(); gathering.bins];
    for clip in moving {
        let place = (clip.speed_mps / slowest).log2() / octaves * gathering.bins as f64;
        // All of one speed: NaN, which becomes 0.
        own[(place as usize).min(gathering.bins - 1)].push(clip);
    }
    for bin in own.into_iter().filter(|bin| bin.len() >= gathering.least_clips) {
        let mean = bin.iter().map(|clip| clip.speed_mps).sum::<f64>() / bin.len() as f64;
        let same = |other: &&mut Vec<&Clip>| (other[0].speed_mps / mean - 1.0).abs() < 0.01;
        match bins.iter_mut().find(same) {
            Some(steady) => steady.extend(bin),
            None => bins.push(bin),
        }
    }
    bins
}

fn clip_samples(rate_hz: f64) -> usize {
    (rate_hz * CLIP_S).round() as usize
}

/// The clips of a take of which speed is known and that no seam disturbs.
fn clips(index: usize, take: &Take, counts: &mut Counts) -> Vec<Clip> {
    let length = clip_samples(take.rate_hz);
    let mut clips = Vec::new();
    for number in 0u32.. {
        let first = (f64::from(number) * HOP_S * take.rate_hz).round() as usize;
        let end = first + length;
        if end > take.samples.len() {
            break;
        }
        let time_s = [first, end].map(|n| n as f64 / take.rate_hz);
        let (Some(from_m), Some(to_m)) =
            (take.motion.distance_m(time_s[0]), take.motion.distance_m(time_s[1]))
        else {
            counts.unknown += 1;
            continue;
        };
        if take.seams.pass(time_s, [from_m, to_m]) {
            counts.seams += 1;
            continue;
        }
        let speed_mps = match take.motion {
            Motion::Steady(speed_mps) => speed_mps.abs(),
            Motion::Track(_) => (to_m - from_m) / (time_s[1] - time_s[0]),
        };
        clips.push(Clip { take: index, first, speed_mps });
    }
    clips
}

/// The mean power density of clips, at multiples of the spacing.
fn mean_power(clips: &[&Clip], takes: &[Take], values: usize, planner: &mut RealFftPlanner<f64>) -> Vec<f64> {
    let mut mean = vec![0.0; values];
    for clip in clips {
        let take = &takes[clip.take];
        let length = clip_samples(take.rate_hz);
        let forward = planner.plan_fft_forward(length);
        let mut input = forward.make_input_vec();
        let mut output = forward.make_output_vec();
        let mut squares = 0.0;
        for (n, value) in input.iter_mut().enumerate() {
            let window = 1.0 - ((2 * n + 1) as f64 / length as f64 - 1.0).abs();
            squares += window * window;
            *value = window * f64::from(take.samples[clip.first + n]);
        }
        // The lengths are those that the transform asked for.
        if forward.process(&mut input, &mut output).is_err() {
            continue;
        }
        let scale = 2.0 / (take.rate_hz * squares * clips.len() as f64);
        let own_hz = take.rate_hz / length as f64;
        for (k, mean) in mean.iter_mut().enumerate() {
            // A clip of a whole number of samples is hardly ever exactly 50 ms long.
            let place = (k + 1) as f64 * SPACING_HZ / own_hz;
            let low = (place + 1e-9).floor();
            let along = (place - low).max(0.0);
            let power = |bin: f64| output.get(bin as usize).map_or(0.0, |value| value.norm_sqr());
            *mean += scale * (power(low) * (1.0 - along) + power(low + 1.0) * along);
        }
    }
    mean
}

#[cfg(test)]
mod tests;
