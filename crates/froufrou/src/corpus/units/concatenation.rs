//! Chosen units become sound.
//!
//! Units that follow one another in their recording are left as they are. Elsewhere both neighbours reach beyond the
//! place where they meet, each to a zero crossing, and are cross-faded between the two: so nothing begins or ends away
//! from zero, and every unit keeps its length. With g from 0 to 1 along half a cosine and ρ how the two correlate there,
//! they have gains (1 − g) / n and g / n with n² = g² + (1 − g)² + 2 ρ g (1 − g). What is alike is added so that amplitudes
//! stay, what is not so that energies do.
//!
//! A reach is at least 0.5 ms, and at most 5 ms (half a period at 100 Hz, where recordings are high-passed) or half a unit.
//! So a sample depends on its unit and on the neighbours of that alone: any stretch can be made by itself, and sound can
//! be made as units come, one behind.
//!
//! No sample of a fade is farther from the one before than S, the farthest that two samples of the recordings on either
//! side are apart, silence before and after these included. A fade that would be steeper somewhere is held within S there
//! and within what still reaches the other side in steps of S. That can always be done unless the two sides of a fade of
//! N samples are more than (N + 1) S apart; then the fade is as long as it may be, and if that does not help, its steps
//! are all alike. (Sound of frequency f steps by up to 2π f / rate of its amplitude, so that this takes recordings that are
//! nowhere above about 100 Hz.) The beginning and the end of all are fades from and to silence.

use std::f64::consts::PI;
use std::ops::Range;

use rayon::prelude::*;

use crate::error::Result;

/// The least and the most that a unit reaches beyond its ends.
const LEAST_S: f64 = 0.0005;
const MOST_S: f64 = 0.005;

/// Where a unit lies in what is recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UnitPlace {
    /// The number of its stream.
    pub stream: usize,
    /// Its first sample there.
    pub start: usize,
}

/// Recorded sound that units are read from.
pub trait Sound: Sync {
    /// Where a unit lies.
    fn place(&self, unit: usize) -> UnitPlace;

    /// How many samples a stream has.
    fn frames(&self, stream: usize) -> usize;

    /// Fills a buffer with a stream's samples from a place on; silence before its beginning and after its end.
    ///
    /// # Errors
    /// Where the sound cannot be read.
    fn read(&self, stream: usize, channel: usize, from: i64, samples: &mut [f32]) -> Result<()>;

    /// The farthest that two samples of a stream are apart that follow one another, as [`largest_step`] has it.
    fn largest_step(&self, stream: usize, channel: usize) -> f32;
}

/// The farthest that two samples that follow one another are apart, of sound before and after which it is silent.
pub fn largest_step(sound: &[f32]) -> f32 {
    let ends = sound.first().into_iter().chain(sound.last()).map(|edge| edge.abs());
    sound.windows(2).map(|pair| (pair[1] - pair[0]).abs()).chain(ends).fold(0.0, f32::max)
}

/// Makes sound of units.
pub struct Concatenation<'a> {
    sound: &'a dyn Sound,
    unit: usize,
    least: usize,
    most: usize,
}

/// What becomes of two neighbours where they meet.
struct Join {
    /// From the reach of the one after to that of the one before.
    samples: Vec<f32>,
    /// How many of them lie before the place where they meet.
    before: usize,
}

impl<'a> Concatenation<'a> {
    /// Units of so many samples.
    pub fn new(sound: &'a dyn Sound, unit_samples: usize, rate_hz: u32) -> Self {
        let samples = |seconds: f64| (seconds * f64::from(rate_hz)).round() as usize;
        // A sample at least is left between two fades.
        let most = samples(MOST_S).min(unit_samples.saturating_sub(1) / 2);
        Self { sound, unit: unit_samples, least: samples(LEAST_S).max(1).min(most), most }
    }

    /// One channel of a range of frames of the sound that units make, which has so many frames in all.
    ///
    /// # Errors
    /// Where recordings cannot be read.
    pub fn render(
        &self,
        chosen: &[usize],
        channel: usize,
        frames: usize,
        range: Range<usize>,
    ) -> Result<Vec<f32>> {
        let frames = frames.min(chosen.len() * self.unit);
        let range = range.start.min(frames)..range.end.min(frames).max(range.start.min(frames));
        // The end is a fade of its own, which looks at one sample before it.
        let end = frames - self.most.min(frames);
        let has_end = range.end > end;
        let from = if has_end { range.start.min(end.saturating_sub(1)) } else { range.start };
        let to = if has_end { frames } else { range.end };
        let first = from / self.unit;
        let units: Vec<Result<Vec<f32>>> = (first..to.div_ceil(self.unit).max(first))
            .into_par_iter()
            .map(|i| {
                let before = i.checked_sub(1).map(|before| chosen[before]);
                self.unit(before, chosen[i], chosen.get(i + 1).copied(), channel)
            })
            .collect();
        let mut out = Vec::with_capacity(units.len() * self.unit);
        for unit in units {
            out.extend(unit?);
        }
        let start = first * self.unit;
        out.truncate(to - start);
        if has_end {
            self.end(chosen, channel, &mut out, end - start);
        }
        out.drain(..range.start - start);
        out.truncate(range.len());
        Ok(out)
    }

    /// One channel of a unit between two others, or at the beginning or the end.
    ///
    /// # Errors
    /// Where recordings cannot be read.
    pub fn unit(
        &self,
        before: Option<usize>,
        this: usize,
        after: Option<usize>,
        channel: usize,
    ) -> Result<Vec<f32>> {
        let place = self.sound.place(this);
        let mut samples = vec![0.0; self.unit];
        self.sound.read(place.stream, channel, place.start as i64, &mut samples)?;
        match before {
            Some(before) if !self.follows(before, this) => {
                let join = self.join(before, this, channel)?;
                samples.iter_mut().zip(&join.samples[join.before..]).for_each(|(to, from)| *to = *from);
            }
            None if place.start > 0 => {
                let step = self.sound.largest_step(place.stream, channel);
                let edge = self.edge(&samples[self.least..], step);
                let (fading, after) = samples.split_at_mut(edge);
                let length = fading.len();
                fading.iter_mut().enumerate().for_each(|(i, v)| *v *= half_cosine(i, length) as f32);
                hold(fading, 0.0, after.first().copied().unwrap_or_default(), step);
            }
            _ => {}
        }
        if let Some(after) = after.filter(|after| !self.follows(this, *after)) {
            let join = self.join(this, after, channel)?;
            let from = self.unit - join.before;
            samples[from..].copy_from_slice(&join.samples[..join.before]);
        }
        Ok(samples)
    }

    /// Fades the end of all from a sample on at the earliest, unless the recording ends there too and nothing is joined to
    /// that end.
    fn end(&self, chosen: &[usize], channel: usize, samples: &mut [f32], earliest: usize) {
        let Some((&unit, rest)) = chosen.split_last() else { return };
        let place = self.sound.place(unit);
        let last = (samples.len() - 1) % self.unit + 1;
        let is_joined = rest.last().is_some_and(|before| !self.follows(*before, unit));
        if place.start + last >= self.sound.frames(place.stream) && !is_joined {
            return;
        }
        // The fade may begin in the unit before.
        let steps = rest.last().into_iter().chain([&unit]);
        let step = steps.map(|unit| self.sound.largest_step(self.sound.place(*unit).stream, channel));
        let step = step.fold(0.0, f32::max);
        let most = samples.len() - earliest;
        let least = self.least.min(most);
        let edge = samples[..samples.len() - least].last().copied().unwrap_or_default();
        let length = if self.is_near(edge, step) { least } else { most };
        let (before, fading) = samples.split_at_mut(samples.len() - length);
        fading.iter_mut().rev().enumerate().for_each(|(i, v)| *v *= half_cosine(i, length) as f32);
        hold(fading, before.last().copied().unwrap_or_default(), 0.0, step);
    }

    /// How long a fade from silence is to what comes after the shortest.
    fn edge(&self, after: &[f32], step: f32) -> usize {
        let is_near = self.is_near(after.first().copied().unwrap_or_default(), step);
        if is_near { self.least } else { self.most }
    }

    /// True where the shortest fade gets from silence to a sample.
    fn is_near(&self, sample: f32, step: f32) -> bool {
        sample.abs() <= (self.least + 1) as f32 * step
    }

    fn follows(&self, first: usize, second: usize) -> bool {
        let (a, b) = (self.sound.place(first), self.sound.place(second));
        a.stream == b.stream && a.start + self.unit == b.start
    }

    fn join(&self, first: usize, second: usize, channel: usize) -> Result<Join> {
        let (a, b) = (self.sound.place(first), self.sound.place(second));
        // As far either side as any of them may reach, and a sample more.
        let room = 2 * self.most + 2;
        let (mut left, mut right) = (vec![0.0; room], vec![0.0; room]);
        let meet = self.most + 1;
        self.sound.read(a.stream, channel, (a.start + self.unit) as i64 - meet as i64, &mut left)?;
        self.sound.read(b.stream, channel, b.start as i64 - meet as i64, &mut right)?;
        let step = self.sound.largest_step(a.stream, channel).max(self.sound.largest_step(b.stream, channel));
        let crosses = |x: f32, y: f32| (x <= 0.0) != (y <= 0.0) || y == 0.0;
        let reach = |crosses: &dyn Fn(usize) -> bool| {
            (self.least..=self.most).find(|&reach| crosses(reach)).unwrap_or(self.most)
        };
        let mut after = reach(&|k| crosses(left[meet + k - 1], left[meet + k]));
        let mut before = reach(&|k| crosses(right[meet - k], right[meet - k - 1]));
        let reaches = |before: usize, after: usize| {
            let apart = f64::from((right[meet + after] - left[meet - before - 1]).abs());
            apart <= (before + after + 1) as f64 * f64::from(step)
        };
        if !reaches(before, after) {
            (before, after) = (self.most, self.most);
        }
        let part = meet - before..meet + after;
        let mut samples = cross_fade(&left[part.clone()], &right[part.clone()]);
        hold(&mut samples, left[part.start - 1], right[part.end], step);
        Ok(Join { samples, before })
    }
}

/// From 0 to 1, along half a cosine.
fn half_cosine(at: usize, length: usize) -> f64 {
    0.5 - 0.5 * (PI * (at as f64 + 0.5) / length as f64).cos()
}

/// From one to the other, as the module has it.
fn cross_fade(left: &[f32], right: &[f32]) -> Vec<f32> {
    let product =
        |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum::<f64>();
    let power = product(left, left) * product(right, right);
    let correlation = if power > 0.0 { product(left, right) / power.sqrt() } else { 0.0 }.clamp(0.0, 1.0);
    let length = left.len();
    let sample = |(at, (left, right)): (usize, (&f32, &f32))| {
        let g = half_cosine(at, length);
        let h = 1.0 - g;
        let norm = (g * g + h * h + 2.0 * correlation * g * h).sqrt();
        ((h * f64::from(*left) + g * f64::from(*right)) / norm) as f32
    };
    left.iter().zip(right).enumerate().map(sample).collect()
}

/// Holds samples between two others within steps of so much from one to the next, or of what it takes to get from one side
/// to the other at all.
fn hold(samples: &mut [f32], before: f32, after: f32, step: f32) {
    // A little less, so that rounding does not make it more.
    let peak = samples.iter().fold(before.abs().max(after.abs()), |peak, sample| peak.max(sample.abs()));
    let step = (f64::from(step) - 2.0 * f64::from(f32::EPSILON * peak)).max(0.0);
    let (mut last, after) = (f64::from(before), f64::from(after));
    let mut left = samples.len() as f64;
    for sample in samples {
        let (least, most) = ((last - step).max(after - left * step), (last + step).min(after + left * step));
        let held = match least <= most {
            true => f64::from(*sample).clamp(least, most),
            false => last + (after - last) / (left + 1.0),
        };
        *sample = held as f32;
        last = f64::from(*sample);
        left -= 1.0;
    }
}

/// Streams of one channel each that are in memory.
#[derive(Debug, Clone, PartialEq)]
pub struct InMemory {
    streams: Vec<Vec<f32>>,
    unit: usize,
    /// The number of each stream's first unit.
    starts: Vec<usize>,
    steps: Vec<f32>,
}

impl InMemory {
    /// Streams and the length of their units.
    pub fn new(streams: Vec<Vec<f32>>, unit_samples: usize) -> Self {
        let mut starts = vec![0];
        for stream in &streams {
            starts.push(starts[starts.len() - 1] + stream.len().div_ceil(unit_samples));
        }
        let steps = streams.iter().map(|stream| largest_step(stream)).collect();
        Self { streams, unit: unit_samples, starts, steps }
    }

    /// How many units each stream has.
    pub fn units(&self) -> Vec<usize> {
        self.starts.windows(2).map(|pair| pair[1] - pair[0]).collect()
    }
}

/// Which stream a unit is of, by the first unit of each, and its first sample there.
pub(super) fn place_of(starts: &[usize], unit: usize, unit_samples: usize) -> UnitPlace {
    let stream = starts.partition_point(|start| *start <= unit).saturating_sub(1);
    UnitPlace { stream, start: (unit - starts[stream]) * unit_samples }
}

/// Copies what there is of samples from a place on.
pub(super) fn copy(from: &[f32], start: i64, to: &mut [f32]) {
    to.fill(0.0);
    let skipped = usize::try_from(-start).unwrap_or(0).min(to.len());
    let part = from.get(usize::try_from(start).unwrap_or(0)..).unwrap_or_default();
    to[skipped..].iter_mut().zip(part).for_each(|(to, from)| *to = *from);
}

impl Sound for InMemory {
    fn place(&self, unit: usize) -> UnitPlace {
        place_of(&self.starts, unit, self.unit)
    }

    fn frames(&self, stream: usize) -> usize {
        self.streams[stream].len()
    }

    fn read(&self, stream: usize, _: usize, from: i64, samples: &mut [f32]) -> Result<()> {
        copy(&self.streams[stream], from, samples);
        Ok(())
    }

    fn largest_step(&self, stream: usize, _: usize) -> f32 {
        self.steps[stream]
    }
}

#[cfg(test)]
mod tests;
