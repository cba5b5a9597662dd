//! Chosen units become sound.
//!
//! Units that follow one another in their recording are left as they are. Elsewhere both neighbours reach beyond the
//! place where they meet, each to a zero crossing, and are cross-faded between the two: so nothing begins or ends away
//! from zero, and every unit keeps its length. With g from 0 to 1 along half a cosine and ρ how the two correlate there,
//! they have gains (1 − g) / n and g / n with n² = g² + (1 − g)² + 2 ρ g (1 − g). What is alike is added so that amplitudes
//! stay, what is not so that energies do.
//!
//! A reach is at least 0.5 ms, in which nothing jumps, and at most 5 ms (half a period at 100 Hz, where recordings are
//! high-passed) or half a unit. So a sample depends on its unit and on the neighbours of that alone: any stretch can be
//! made by itself, and sound can be made as units come, one behind.

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
}

/// Makes sound of units.
pub struct Concatenation<'a> {
    sound: &'a dyn Sound,
    unit: usize,
    least: usize,
    most: usize,
}

/// What two neighbours have where they meet: `before` and `after` reach it.
struct Join {
    /// The end of the unit before, and what comes after that.
    left: Vec<f32>,
    /// What comes before the unit after, and its beginning.
    right: Vec<f32>,
    /// How many samples lie before the place where they meet.
    before: usize,
    correlation: f64,
}

impl Join {
    fn len(&self) -> usize {
        self.left.len()
    }

    fn sample(&self, at: usize) -> f32 {
        let g = 0.5 - 0.5 * (PI * (at as f64 + 0.5) / self.len() as f64).cos();
        let h = 1.0 - g;
        let norm = (g * g + h * h + 2.0 * self.correlation * g * h).sqrt();
        ((h * f64::from(self.left[at]) + g * f64::from(self.right[at])) / norm) as f32
    }
}

impl<'a> Concatenation<'a> {
    /// Units of so many samples.
    pub fn new(sound: &'a dyn Sound, unit_samples: usize, rate_hz: u32) -> Self {
        let samples = |seconds: f64| (seconds * f64::from(rate_hz)).round() as usize;
        let most = samples(MOST_S).min(unit_samples / 2);
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
        let range = range.start..range.end.min(frames).min(chosen.len() * self.unit).max(range.start);
        let first = range.start / self.unit;
        let last = range.end.div_ceil(self.unit).min(chosen.len());
        let units: Vec<Result<Vec<f32>>> = (first..last.max(first))
            .into_par_iter()
            .map(|i| {
                let before = i.checked_sub(1).map(|before| chosen[before]);
                let mut samples = self.unit(before, chosen[i], chosen.get(i + 1).copied(), channel)?;
                self.end(chosen[i], frames.min(chosen.len() * self.unit), i, &mut samples);
                Ok(samples)
            })
            .collect();
        let mut out = Vec::with_capacity(units.len() * self.unit);
        for unit in units {
            out.extend(unit?);
        }
        out.drain(..(range.start - first * self.unit).min(out.len()));
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
                for (at, sample) in (join.before..join.len()).zip(&mut samples) {
                    *sample = join.sample(at);
                }
            }
            None if place.start > 0 => {
                samples.iter_mut().enumerate().take(self.least).for_each(|(i, v)| *v *= self.fade(i));
            }
            _ => {}
        }
        if let Some(after) = after.filter(|after| !self.follows(this, *after)) {
            let join = self.join(this, after, channel)?;
            let from = self.unit - join.before;
            for (at, sample) in samples[from..].iter_mut().enumerate() {
                *sample = join.sample(at);
            }
        }
        Ok(samples)
    }

    /// Fades the end of all, unless the recording ends there too.
    fn end(&self, unit: usize, frames: usize, number: usize, samples: &mut [f32]) {
        let place = self.sound.place(unit);
        let start = number * self.unit;
        let last = frames.saturating_sub(start);
        if place.start + last >= self.sound.frames(place.stream) {
            return;
        }
        for (i, sample) in samples.iter_mut().enumerate() {
            if start + i < frames && frames - start - i <= self.least {
                *sample *= self.fade(frames - start - i - 1);
            }
        }
    }

    fn fade(&self, at: usize) -> f32 {
        (0.5 - 0.5 * (PI * (at as f64 + 0.5) / self.least as f64).cos()) as f32
    }

    fn follows(&self, first: usize, second: usize) -> bool {
        let (a, b) = (self.sound.place(first), self.sound.place(second));
        a.stream == b.stream && a.start + self.unit == b.start
    }

    fn join(&self, first: usize, second: usize, channel: usize) -> Result<Join> {
        let (a, b) = (self.sound.place(first), self.sound.place(second));
        // As far either side as any of them may reach.
        let mut left = vec![0.0; 2 * self.most + 1];
        let mut right = vec![0.0; 2 * self.most + 1];
        let most = self.most as i64;
        self.sound.read(a.stream, channel, (a.start + self.unit) as i64 - most, &mut left)?;
        self.sound.read(b.stream, channel, b.start as i64 - most, &mut right)?;
        let crosses = |x: f32, y: f32| (x <= 0.0) != (y <= 0.0) || y == 0.0;
        let reach = |crosses: &dyn Fn(usize) -> bool| {
            (self.least..=self.most).find(|&reach| crosses(reach)).unwrap_or(self.most)
        };
        let after = reach(&|k| crosses(left[self.most + k - 1], left[self.most + k]));
        let before = reach(&|k| k < self.most && crosses(right[self.most - k], right[self.most - k - 1]));
        let part = |v: &[f32]| v[self.most - before..self.most + after].to_vec();
        let (left, right) = (part(&left), part(&right));
        let product =
            |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum::<f64>();
        let power = product(&left, &left) * product(&right, &right);
        let correlation = if power > 0.0 { product(&left, &right) / power.sqrt() } else { 0.0 };
        Ok(Join { left, right, before, correlation: correlation.clamp(0.0, 1.0) })
    }
}

/// Streams of one channel each that are in memory.
#[derive(Debug, Clone, PartialEq)]
pub struct InMemory {
    streams: Vec<Vec<f32>>,
    unit: usize,
    /// The number of each stream's first unit.
    starts: Vec<usize>,
}

impl InMemory {
    /// Streams and the length of their units.
    pub fn new(streams: Vec<Vec<f32>>, unit_samples: usize) -> Self {
        let mut starts = vec![0];
        for stream in &streams {
            starts.push(starts[starts.len() - 1] + stream.len().div_ceil(unit_samples));
        }
        Self { streams, unit: unit_samples, starts }
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
}

#[cfg(test)]
mod tests;
