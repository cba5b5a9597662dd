//! Walking along a pattern.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::ops::Range;

use super::Chosen;
use crate::corpus::dictionary::Dictionary;
use crate::corpus::grains::GrainKind;

/// A place at which a grain fits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    pub grain: usize,
    pub start: usize,
    pub end: usize,
    /// How long the grain's window rises and falls.
    pub tapers: [usize; 2],
    pub correlation: f64,
    pub gain: f32,
}

/// How much worse it is that nothing sounds than that something does which has nothing to do with what should.
const GAP: f64 = 2.0;

/// So many samples more may grains overlap, for what rounding does to their ends.
const SLACK: usize = 4;

/// All places of one part of a recording.
#[derive(Debug)]
pub(super) struct Trail {
    /// In order of start.
    places: Vec<Place>,
    /// The energy of the part up to each sample.
    energies: Vec<f64>,
    /// Half the median length of grains.
    reach: usize,
    taper: f64,
    is_sinusoidal: bool,
}

impl Trail {
    /// Takes places in order of start.
    pub fn new(dictionary: &Dictionary, recording: usize, is_sinusoidal: bool, places: Vec<Place>) -> Self {
        let mut energies = vec![0.0];
        energies.extend(dictionary.part(recording, is_sinusoidal).iter().scan(0.0, |sum, v| {
            *sum += f64::from(*v).powi(2);
            Some(*sum)
        }));
        let kind = |kind: GrainKind| (kind == GrainKind::Sinusoidal) == is_sinusoidal;
        let mut lengths: Vec<usize> =
            dictionary.grains().iter().filter(|e| kind(e.kind)).map(|e| e.length).collect();
        lengths.sort_unstable();
        let reach = lengths.get(lengths.len() / 2).map_or(1, |median| median / 2).max(1);
        let taper = dictionary.settings().extraction.taper;
        Self { places, energies, reach, taper, is_sinusoidal }
    }

    /// The places that begin within a range.
    fn between(&self, from: usize, to: usize) -> &[Place] {
        let first = self.places.partition_point(|place| place.start < from);
        let last = self.places.partition_point(|place| place.start <= to);
        &self.places[first..last.max(first)]
    }

    fn energy(&self, from: usize, to: usize) -> f64 {
        let at = |i: usize| self.energies[i.min(self.energies.len() - 1)];
        at(to.max(from)) - at(from)
    }

    /// How far the taper of a grain reaches into the next, and that of the next into it.
    fn overlap(&self, length: usize) -> usize {
        (self.taper * length as f64 / 2.0).round() as usize
    }

    /// The way from the beginning to the end by which the least is lost; `weight` makes places less welcome.
    ///
    /// What is lost on a way is the sum of what is lost under its grains and of what lies between them. So the best way
    /// to a place is the best way to one of those before it, and that one is the same for all that begin later.
    pub fn way(&self, weight: impl Fn(&Place) -> f64) -> Vec<Chosen> {
        // Between the middles of a grain's tapers, which is where neighbours cross over.
        let from = |place: &Place| place.start + place.tapers[0] / 2;
        let to = |place: &Place| place.end - place.tapers[1].div_ceil(2);
        let mut order: Vec<usize> = (0..self.places.len()).collect();
        order.sort_by_key(|&index| (from(&self.places[index]), index));
        // Of each place the loss up to its end, and the place before.
        let mut lost: Vec<(f64, Option<usize>)> = vec![(0.0, None); self.places.len()];
        let mut ahead: BinaryHeap<Reverse<(usize, usize)>> = BinaryHeap::new();
        // What is lost up to the best place behind, less what would be if nothing sounded.
        let mut behind: (f64, Option<usize>) = (0.0, None);
        let silence = |at: usize| -> f64 { GAP * self.energy(0, at) };
        for index in order {
            let place = &self.places[index];
            while let Some(&Reverse((end, passed))) = ahead.peek() {
                if end > from(place) + SLACK {
                    break;
                }
                ahead.pop();
                let value: f64 = lost[passed].0 - silence(end);
                if value < behind.0 {
                    behind = (value, Some(passed));
                }
            }
            let wrong = self.energy(from(place), to(place)) * (1.0 - place.correlation.powi(2));
            lost[index] = (behind.0 + silence(from(place)) + wrong * weight(place), behind.1);
            ahead.push(Reverse((to(place), index)));
        }
        while let Some(Reverse((end, passed))) = ahead.pop() {
            let value = lost[passed].0 - silence(end);
            if value < behind.0 {
                behind = (value, Some(passed));
            }
        }
        let mut chosen = Vec::new();
        while let Some(index) = behind.1 {
            let Place { grain, start, gain, .. } = self.places[index];
            chosen.push(Chosen { grain, start, gain });
            behind = lost[index];
        }
        chosen.reverse();
        chosen
    }

    /// One grain after another, each that whose power is nearest to the recording's there; not those of the recording.
    pub fn by_power(&self, dictionary: &Dictionary, recording: usize) -> Vec<Chosen> {
        self.by_power_within(dictionary, recording, 0..self.energies.len() - 1)
    }

    /// The same within a range, and beyond its end by no more than a taper unless it is all there is.
    fn by_power_within(&self, dictionary: &Dictionary, recording: usize, range: Range<usize>) -> Vec<Chosen> {
        let power = |samples: &[f32]| {
            samples.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / samples.len().max(1) as f64
        };
        let is_whole = range == (0..self.energies.len() - 1);
        let grains: Vec<(usize, usize, f64)> = dictionary
            .grains()
            .iter()
            .enumerate()
            .filter(|(_, e)| {
                e.recording != recording && (e.kind == GrainKind::Sinusoidal) == self.is_sinusoidal
            })
            .map(|(number, e)| (number, e.length, power(dictionary.samples(number))))
            .collect();
        let mut chosen = Vec::new();
        let mut position = range.start;
        while position < range.end {
            let there = |&(_, grain_length, _): &(usize, usize, f64)| {
                self.energy(position, position + grain_length) / grain_length as f64
            };
            let off = |grain: &(usize, usize, f64)| (grain.2.sqrt() - there(grain).sqrt()).abs();
            let fits = |&&(_, length, _): &&(usize, usize, f64)| {
                is_whole || position + length <= range.end + self.overlap(length)
            };
            let nearest = grains.iter().filter(fits).min_by(|a, b| off(a).total_cmp(&off(b)));
            let Some(nearest) = nearest else { break };
            let &(grain, grain_length, is) = nearest;
            let gain = if is > 0.0 { (there(nearest) / is).sqrt() as f32 } else { 0.0 };
            if gain > 0.0 {
                chosen.push(Chosen { grain, start: position, gain });
            }
            position += (grain_length - self.overlap(grain_length)).max(1);
        }
        chosen
    }

    /// A way without gaps: where the pattern has nothing, grains of the power that is there.
    pub fn filled(&self, dictionary: &Dictionary, recording: usize, way: Vec<Chosen>) -> Vec<Chosen> {
        let length = self.energies.len() - 1;
        let mut filled = Vec::with_capacity(way.len());
        let mut behind = 0;
        for chosen in way {
            filled.extend(self.by_power_within(dictionary, recording, behind..chosen.start.max(behind)));
            let grain = dictionary.samples(chosen.grain).len();
            behind = (chosen.start + grain - self.overlap(grain).min(grain)).min(length);
            filled.push(chosen);
        }
        filled.extend(self.by_power_within(dictionary, recording, behind..length));
        filled
    }

    /// Grains moved apart by a factor, and what opens between them filled; moved together, the strongest stay.
    pub fn spread(&self, dictionary: &Dictionary, anchors: &[Chosen], factor: f64) -> Vec<Chosen> {
        let end_of = |chosen: &Chosen| chosen.start + dictionary.samples(chosen.grain).len();
        let mut order: Vec<&Chosen> = anchors.iter().collect();
        let energy = |chosen: &Chosen| self.energy(chosen.start, end_of(chosen));
        order.sort_by(|a, b| energy(b).total_cmp(&energy(a)).then(a.start.cmp(&b.start)));
        let mut moved: Vec<Chosen> = Vec::new();
        for anchor in order {
            let start = (anchor.start as f64 * factor).round() as usize;
            let anchor = Chosen { start, ..*anchor };
            let place = moved.partition_point(|m| m.start < start);
            let overlap = |length: usize| self.overlap(length) + self.overlap(2 * self.reach);
            let is_clear = |first: &Chosen, second: &Chosen| {
                end_of(first) <= second.start + overlap(end_of(first) - first.start)
            };
            let before = place.checked_sub(1).is_none_or(|i| is_clear(&moved[i], &anchor));
            if before && moved.get(place).is_none_or(|after| is_clear(&anchor, after)) {
                moved.insert(place, anchor);
            }
        }
        let mut all: Vec<Chosen> = Vec::new();
        let length = ((self.energies.len() - 1) as f64 * factor).round() as usize;
        for (index, anchor) in moved.iter().enumerate() {
            all.push(*anchor);
            let until = moved.get(index + 1).map_or(length, |next| next.start);
            let mut position = end_of(anchor);
            let mut last = [usize::MAX, anchor.grain];
            while position < until {
                let gap = until - position;
                let fits = |place: &&Place| {
                    place.end - place.start <= gap + self.overlap(place.end - place.start)
                        && !last.contains(&place.grain)
                };
                let there = (position as f64 / factor).round() as usize;
                let near = self.between(there.saturating_sub(self.reach), there + self.reach);
                let best =
                    near.iter().filter(fits).reduce(|a, b| if b.correlation > a.correlation { b } else { a });
                let Some(place) = best else { break };
                let start = position - self.overlap(place.end - place.start).min(position);
                all.push(Chosen { grain: place.grain, start, gain: place.gain });
                position = (start + place.end - place.start).max(position + 1);
                last = [last[1], place.grain];
            }
        }
        all
    }

    /// One grain after another, each that which fits best where the recording is at that time.
    pub fn scan(&self, length: usize, factor: f64) -> Vec<Chosen> {
        let mut chosen = Vec::new();
        let mut position = 0usize;
        let mut last = [usize::MAX; 2];
        while position < length {
            let there = (position as f64 / factor).round() as usize;
            let near = self.between(there.saturating_sub(self.reach), there + self.reach);
            let fresh = near.iter().filter(|place| !last.contains(&place.grain));
            let best = fresh.reduce(|a, b| if b.correlation > a.correlation { b } else { a });
            // Of few, the same once more.
            let Some(place) =
                best.or_else(|| near.iter().find(|place| place.grain != last[1])).or(near.first())
            else {
                position += self.reach;
                continue;
            };
            let grain_length = place.end - place.start;
            let start = position.saturating_sub(self.overlap(grain_length));
            chosen.push(Chosen { grain: place.grain, start, gain: place.gain });
            position = (start + grain_length).max(position + 1);
            last = [last[1], place.grain];
        }
        chosen
    }
}
