//! What a path does to the colour of a sound: a short filter that may change along the path.
//!
//! A filter is applied to what goes in: the sample that arrives at a moment is spread over the samples from
//! there on by the filter of that moment. So the filter may change from sample to sample, pieces of a path
//! add up however they are cut, and no sample of the output depends on where a block begins.

use std::collections::{BTreeMap, VecDeque};

use super::path::UNFILTERED;
use crate::space::bands::Bands;

/// A finite impulse response.
#[derive(Debug, Clone)]
pub struct Filter {
    /// Its samples.
    pub taps: Box<[f32]>,
    /// How many of them come before the moment of arrival.
    pub lead: usize,
}

impl Filter {
    /// The filter that changes nothing.
    pub(crate) fn identity() -> Self {
        Self { taps: [1.0].into(), lead: 0 }
    }

    /// The filter that does what this one does and then another.
    pub(crate) fn then(&self, other: &Filter) -> Self {
        let mut taps = vec![0.0; self.taps.len() + other.taps.len() - 1];
        let (long, short) = if self.taps.len() < other.taps.len() { (other, self) } else { (self, other) };
        let long = Filter { taps: long.taps.clone(), lead: 0 };
        add_filtered(&short.taps, 0, &long, &mut taps, 0);
        Self { taps: taps.into(), lead: self.lead + other.lead }
    }

    /// How many frames it makes what arrives heard before and behind its time.
    pub(crate) fn reach(&self) -> [usize; 2] {
        [self.lead, self.taps.len().saturating_sub(self.lead)]
    }
}

/// The filters of a path, and how it is spread over the lanes of a bus, by numbers.
#[derive(Debug, Clone, Default)]
pub(crate) struct Filters {
    filters: Numbered<Filter>,
    spreads: Numbered<Box<[f32]>>,
    /// By what each receiver was last reached, so that what stays the same has one filter.
    last: BTreeMap<usize, Passage>,
}

/// What a sound passes on its last stretch to a receiver: from where it comes and with what colour, and what the
/// receiver makes of it in each of its channels, two at most.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Passage {
    pub from_m: Option<[f64; 3]>,
    pub bands: Option<Bands>,
    pub channels: [ChannelPassage; 2],
}

/// What comes on top in one channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ChannelPassage {
    pub delay_s: f64,
    pub gain: f64,
    pub filter: u32,
}

impl Filters {
    /// How a receiver was last reached, if it was so from there and with this colour.
    pub fn last(
        &self,
        receiver: usize,
        from_m: Option<[f64; 3]>,
        bands: Option<Bands>,
    ) -> Option<[ChannelPassage; 2]> {
        let last = self.last.get(&receiver).filter(|last| last.from_m == from_m && last.bands == bands)?;
        // Its filters may have been released since.
        let is_kept = |of: &ChannelPassage| self.get(of.filter).is_some();
        last.channels.iter().all(is_kept).then_some(last.channels)
    }

    /// Remembers how a receiver is reached.
    pub fn remember(&mut self, receiver: usize, passage: Passage) {
        self.last.insert(receiver, passage);
    }

    /// Adds a filter; its number.
    pub fn push(&mut self, filter: Filter) -> u32 {
        self.filters.push(filter)
    }

    pub fn get(&self, number: u32) -> Option<&Filter> {
        self.filters.get(number)
    }

    /// Adds the gains of all lanes; their number.
    pub fn push_spread(&mut self, gains: Box<[f32]>) -> u32 {
        self.spreads.push(gains)
    }

    pub fn spread(&self, number: u32) -> Option<&[f32]> {
        self.spreads.get(number).map(|gains| &**gains)
    }

    /// Forgets all that come before the first of these numbers, of filters and of spreads.
    pub fn release(&mut self, needed: impl Iterator<Item = [u32; 2]>) {
        let [filter, spread] =
            needed.fold([UNFILTERED; 2], |[a, b], [filter, spread]| [a.min(filter), b.min(spread)]);
        self.filters.release(filter);
        self.spreads.release(spread);
    }
}

/// Things whose numbers count up; those with low numbers are forgotten.
#[derive(Debug, Clone)]
struct Numbered<T> {
    first: u32,
    kept: VecDeque<T>,
}

impl<T> Default for Numbered<T> {
    fn default() -> Self {
        Self { first: 0, kept: VecDeque::new() }
    }
}

impl<T> Numbered<T> {
    fn push(&mut self, thing: T) -> u32 {
        self.kept.push_back(thing);
        self.first + (self.kept.len() - 1) as u32
    }

    fn get(&self, number: u32) -> Option<&T> {
        self.kept.get(number.checked_sub(self.first)? as usize)
    }

    /// Forgets what comes before a number, or everything.
    fn release(&mut self, needed: u32) {
        let next = self.first + self.kept.len() as u32;
        let keep = needed.clamp(self.first, next);
        self.kept.drain(..(keep - self.first) as usize);
        self.first = keep;
    }
}

/// Adds what a filter makes of samples to a block.
///
/// The first of `input` arrives at frame `input_frame`; `out` holds the frames from `out_frame` on. What falls
/// outside of it is left out. The samples of `input` come in the same order to every sample of the output.
pub(crate) fn add_filtered(
    input: &[f32],
    input_frame: u64,
    filter: &Filter,
    out: &mut [f32],
    out_frame: u64,
) {
    // The vector unit of the machine is chosen here; each sum is made in one fixed order.
    pulp::Arch::new().dispatch(Spreading { input, input_frame, filter, out, out_frame });
}

struct Spreading<'a> {
    input: &'a [f32],
    input_frame: u64,
    filter: &'a Filter,
    out: &'a mut [f32],
    out_frame: u64,
}

/// Samples of the input that are spread at a time.
const TOGETHER: usize = 8;

impl pulp::WithSimd for Spreading<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { input, input_frame, filter: Filter { taps, lead }, out, out_frame } = self;
        // Where in `out` the first tap of the first sample falls.
        let origin = input_frame as i64 - *lead as i64 - out_frame as i64;
        let length = taps.len() as i64;
        let mut at = 0;
        while at < input.len() {
            let begin = origin + at as i64;
            // Where several whole filters fall within the block they are added in one go.
            if at + TOGETHER <= input.len()
                && length >= TOGETHER as i64
                && begin >= 0
                && begin + length + TOGETHER as i64 - 1 <= out.len() as i64
            {
                let begin = begin as usize;
                let samples: [f32; TOGETHER] = std::array::from_fn(|n| input[at + n]);
                spread_together(samples, taps, &mut out[begin..begin + taps.len() + TOGETHER - 1]);
                at += TOGETHER;
            } else {
                let from = (-begin).clamp(0, length);
                let to = (out.len() as i64 - begin).clamp(from, length);
                let (first, last) = ((begin + from) as usize, (begin + to) as usize);
                if first < last {
                    spread(input[at], &taps[from as usize..to as usize], &mut out[first..last]);
                }
                at += 1;
            }
        }
    }
}

#[inline(always)]
fn spread(sample: f32, taps: &[f32], out: &mut [f32]) {
    for (out, tap) in out.iter_mut().zip(taps) {
        *out += sample * tap;
    }
}

/// Adds the filters of samples that follow one another, the first of them first to each sum.
#[inline(always)]
fn spread_together(samples: [f32; TOGETHER], taps: &[f32], out: &mut [f32]) {
    let last = TOGETHER - 1;
    // Before the last sample's filter begins, and behind the first one's end.
    for n in 0..last {
        for (m, sample) in samples.iter().enumerate().take(n + 1) {
            out[n] += sample * taps[n - m];
        }
    }
    let whole = taps.len() - last;
    let shifted: [&[f32]; TOGETHER] = std::array::from_fn(|m| &taps[last - m..last - m + whole]);
    let middle = &mut out[last..last + whole];
    for n in 0..whole {
        let mut sum = middle[n];
        for (sample, taps) in samples.iter().zip(&shifted) {
            sum += sample * taps[n];
        }
        middle[n] = sum;
    }
    for n in taps.len()..taps.len() + last {
        for m in n - taps.len() + 1..TOGETHER {
            out[n] += samples[m] * taps[n - m];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn noise(thread: u64, count: usize) -> Vec<f32> {
        let random = Random::new(5, thread);
        (0..count as u64).map(|n| random.uniform(n) as f32 - 0.5).collect()
    }

    #[test]
    fn it_is_a_convolution() {
        for (taps, lead) in [(1, 0), (5, 2), (8, 0), (97, 40), (200, 0)] {
            let filter = Filter { taps: noise(1, taps).into(), lead };
            let input = noise(2, 300);
            let mut out = vec![0.0; 600];
            add_filtered(&input, 100, &filter, &mut out, 0);
            for (n, &found) in out.iter().enumerate() {
                let sum: f64 = (0..taps)
                    .filter_map(|k| {
                        let m = (n + lead).checked_sub(k + 100)?;
                        Some(f64::from(*input.get(m)?) * f64::from(filter.taps[k]))
                    })
                    .sum();
                assert!((f64::from(found) - sum).abs() < 1e-5, "{taps} {lead} {n}: {found} {sum}");
            }
        }
    }

    #[test]
    fn a_part_alone_is_that_part_of_the_whole() {
        let filter = Filter { taps: noise(1, 61).into(), lead: 7 };
        let input = noise(2, 300);
        let mut whole = vec![0.0; 400];
        add_filtered(&input, 10, &filter, &mut whole, 0);
        for (from, to) in [(0, 400), (3, 4), (90, 131), (17, 350), (250, 400)] {
            let mut part = vec![0.0; to - from];
            // And with the input in two pieces.
            add_filtered(&input[..123], 10, &filter, &mut part, from as u64);
            add_filtered(&input[123..], 133, &filter, &mut part, from as u64);
            assert_eq!(part, whole[from..to]);
        }
    }

    #[test]
    fn two_filters_make_one() {
        let (first, second) =
            (Filter { taps: noise(1, 61).into(), lead: 7 }, Filter { taps: noise(2, 200).into(), lead: 90 });
        let input = noise(3, 300);
        let (mut between, mut twice, mut once) = (vec![0.0; 800], vec![0.0; 800], vec![0.0; 800]);
        add_filtered(&input, 200, &first, &mut between, 0);
        add_filtered(&between, 0, &second, &mut twice, 0);
        for both in [first.then(&second), second.then(&first)] {
            assert_eq!((both.taps.len(), both.lead), (260, 97));
            once.fill(0.0);
            add_filtered(&input, 200, &both, &mut once, 0);
            assert!(once.iter().zip(&twice).all(|(a, b)| (a - b).abs() < 1e-3), "of about 30");
        }
        assert_eq!(first.then(&Filter::identity()).taps, first.taps);
    }

    #[test]
    fn filters_are_kept_as_long_as_they_are_needed() {
        let mut filters = Filters::default();
        let filter = |value| Filter { taps: vec![value].into(), lead: 0 };
        let numbers: Vec<u32> = (0..5).map(|n| filters.push(filter(n as f32))).collect();
        assert_eq!(numbers, [0, 1, 2, 3, 4]);
        filters.release([UNFILTERED, 3, 4].into_iter().map(|filter| [filter, UNFILTERED]));
        assert!(filters.get(2).is_none() && filters.get(UNFILTERED).is_none());
        assert_eq!(filters.get(3).unwrap().taps[0], 3.0);
        filters.release(std::iter::empty());
        assert_eq!(filters.push(filter(9.0)), 5);
        assert_eq!(filters.get(5).unwrap().taps[0], 9.0);
    }
}
