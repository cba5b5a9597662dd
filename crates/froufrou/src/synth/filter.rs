//! What a path does to the colour of a sound: a filter that may change along the path.
//!
//! A filter is applied to what goes in: the sample that arrives at a moment is spread over the samples from
//! there on by the filter of that moment. So the filter may change from sample to sample, and pieces of a path
//! add up however they are cut, but for rounding; [`stretch`](super::stretch) cuts them where no block matters.
//!
//! Short filters are multiplied tap by tap, long ones by FFT:
//!
//! | quantity | value |
//! | --- | --- |
//! | error of the FFT | below −130 dB of the output's root mean square |
//! | cost | `cargo bench -p froufrou --bench head` |
//! | memory | 4 bytes a tap, and while it sounds 4 bytes a sample of each size of FFT that it is used with |

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};

use rustfft::num_complex::Complex32;

use super::path::UNFILTERED;
use super::spectrum::{self, Transform, add_product};
use crate::space::bands::Bands;

/// A finite impulse response.
#[derive(Debug)]
pub struct Filter {
    taps: Box<[f32]>,
    lead: usize,
    /// What it is for the sizes of FFT that were asked for.
    spectra: Mutex<Vec<(usize, Arc<[Complex32]>)>>,
}

impl Filter {
    /// A filter of these samples, `lead` of which come before the moment of arrival.
    pub(crate) fn new(taps: impl Into<Box<[f32]>>, lead: usize) -> Self {
        Self { taps: taps.into(), lead, spectra: Mutex::default() }
    }

    /// The filter that changes nothing.
    pub(crate) fn identity() -> Self {
        Self::new([1.0], 0)
    }

    /// The filter that does what this one does and then another.
    pub(crate) fn then(&self, other: &Filter) -> Self {
        let taps = convolve(&[(&self.taps, other)], &mut Memory::default());
        Self::new(taps, self.lead + other.lead)
    }

    /// Its spectrum for a size of FFT, found once; what the way back multiplies by is divided out.
    fn spectrum(&self, size: usize, memory: &mut spectrum::Memory) -> Arc<[Complex32]> {
        let known = || self.spectra.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, bins)) = known().iter().find(|(known, _)| *known == size) {
            return bins.clone();
        }
        let transform = Transform::of(size);
        let mut samples = vec![0.0; transform.samples()];
        let scale = 2.0 / samples.len() as f32;
        let (before, behind) = self.taps.split_at(self.lead.min(self.taps.len()));
        samples.iter_mut().zip(behind).for_each(|(sample, tap)| *sample = tap * scale);
        // Before the beginning is at the end with the sign changed.
        let end = samples.len() - self.lead;
        samples[end..].iter_mut().zip(before).for_each(|(sample, tap)| *sample = -tap * scale);
        let mut bins = Vec::new();
        transform.forward(&samples, &mut bins, memory);
        let bins: Arc<[Complex32]> = bins.into();
        let mut known = known();
        // Others may have found the same meanwhile.
        if !known.iter().any(|(known, _)| *known == size) {
            known.push((size, bins.clone()));
        }
        bins
    }

    /// How many frames it makes what arrives heard before and behind its time.
    pub(crate) fn reach(&self) -> [usize; 2] {
        [self.lead, self.taps.len().saturating_sub(self.lead)]
    }
}

/// The filters of a path, and how it is spread over the lanes of a bus, by numbers.
#[derive(Debug, Default)]
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

    /// Whether there are neither filters nor spreads.
    pub fn is_empty(&self) -> bool {
        self.filters.kept.is_empty() && self.spreads.kept.is_empty()
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
#[derive(Debug)]
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

/// Filters and inputs shorter than this are multiplied tap by tap. Both ways cost the same at 16 taps and many
/// frames, and at 60 taps and as many frames.
const DIRECT: usize = 32;

/// Into pieces of at most so many frames what passes short filters is cut.
const DIRECT_PIECE: usize = 1024;

/// No FFT of a piece is shorter than this where a longer one costs less.
const LONGEST_OF_SHORT: usize = 1024;

/// Into pieces of how many frames so many are cut that pass filters which together reach so far: the last may be
/// shorter. It is what costs least.
pub(super) fn piece(count: u64, reach: usize) -> usize {
    if reach < DIRECT {
        return DIRECT_PIECE;
    }
    let cost = |samples: usize| {
        let pieces = count.max(1).div_ceil((samples + 1 - reach) as u64);
        // The FFTs, and what goes with each sample.
        let cost = pieces as f64 * samples as f64 * (f64::from(samples as u32).log2() + 4.0);
        (cost, count.max(1).div_ceil(pieces) as usize)
    };
    let costs = spectrum::sizes(reach, longest(reach)).map(|(_, samples)| cost(samples));
    costs.min_by(|(a, _), (b, _)| a.total_cmp(b)).map_or(DIRECT_PIECE, |(_, length)| length)
}

/// No piece of what passes filters that reach so far is longer.
pub(super) fn longest(reach: usize) -> usize {
    (2 * reach).next_power_of_two().max(LONGEST_OF_SHORT)
}

/// Memory that filters use again and again.
#[derive(Default)]
pub(crate) struct Memory {
    bins: Vec<Complex32>,
    sum: Vec<Complex32>,
    samples: Vec<f32>,
    fft: spectrum::Memory,
}

/// All that filters make of inputs, one each and all of one length, added up. It begins before the inputs by the
/// longest lead, and is longer than they are by one less than the longest lead and the longest rest together.
///
/// It depends on the inputs and filters alone, not on what the memory was used for.
pub(crate) fn convolve(passing: &[(&[f32], &Filter)], memory: &mut Memory) -> Vec<f32> {
    let count = passing.first().map_or(0, |(input, _)| input.len());
    let [lead, tail] = reach(passing.iter().map(|(_, filter)| *filter));
    let mut out = vec![0.0; (count + lead + tail).saturating_sub(1)];
    let by_fft = count.min(lead + tail) >= DIRECT;
    match by_fft.then(|| spectrum::sizes(out.len(), usize::MAX).next()).flatten() {
        Some((size, _)) => transformed(passing, size, lead, &mut out, memory),
        None => spread_all(passing, lead, &mut out),
    }
    out
}

/// Whether anything is to be heard of an input.
fn sounds((input, _): &&(&[f32], &Filter)) -> bool {
    input.iter().any(|sample| *sample != 0.0)
}

/// Tap by tap.
fn spread_all(passing: &[(&[f32], &Filter)], lead: usize, out: &mut [f32]) {
    for (input, filter) in passing.iter().filter(sounds) {
        let begin = lead - filter.lead;
        let end = begin + (input.len() + filter.taps.len()).saturating_sub(1);
        // The vector unit of the machine is chosen here; each sum is made in one fixed order.
        pulp::Arch::new().dispatch(Spreading { input, taps: &filter.taps, out: &mut out[begin..end] });
    }
}

/// By FFT of a size for at least as many samples as come out.
fn transformed(
    passing: &[(&[f32], &Filter)],
    size: usize,
    lead: usize,
    out: &mut [f32],
    memory: &mut Memory,
) {
    let Memory { bins, sum, samples, fft } = memory;
    let transform = Transform::of(size);
    sum.clear();
    sum.resize(transform.samples() / 2, Complex32::new(0.0, 0.0));
    for (input, filter) in passing.iter().filter(sounds) {
        transform.forward(input, bins, fft);
        add_product(sum, bins, &filter.spectrum(size, fft));
    }
    transform.inverse(sum, samples, fft);
    let (before, behind) = out.split_at_mut(lead);
    let end = samples.len() - lead;
    before.iter_mut().zip(&samples[end..]).for_each(|(out, sample)| *out = -sample);
    behind.iter_mut().zip(&*samples).for_each(|(out, sample)| *out = *sample);
}

/// How many frames filters together make what arrives heard before and behind its time.
pub(super) fn reach<'a>(filters: impl Iterator<Item = &'a Filter>) -> [usize; 2] {
    filters.map(Filter::reach).fold([0; 2], |[a, b], [lead, tail]| [a.max(lead), b.max(tail)])
}

/// Adds a filter's taps for each sample of the input, the first of them first to each sum.
struct Spreading<'a> {
    input: &'a [f32],
    taps: &'a [f32],
    out: &'a mut [f32],
}

/// Samples of the input that are spread at a time.
const TOGETHER: usize = 8;

impl pulp::WithSimd for Spreading<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { input, taps, out } = self;
        let mut at = 0;
        while at < input.len() {
            match input[at..].first_chunk::<TOGETHER>() {
                Some(samples) if taps.len() >= TOGETHER => {
                    spread_together(*samples, taps, &mut out[at..at + taps.len() + TOGETHER - 1]);
                    at += TOGETHER;
                }
                _ => {
                    spread(input[at], taps, &mut out[at..at + taps.len()]);
                    at += 1;
                }
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

    /// What filters make of inputs, by definition, and how loud its loudest sample is.
    fn expected(passing: &[(&[f32], &Filter)]) -> Vec<f64> {
        let [lead, tail] = reach(passing.iter().map(|(_, filter)| *filter));
        let mut out = vec![0.0; passing[0].0.len() + lead + tail - 1];
        for (input, filter) in passing {
            for (n, sample) in input.iter().enumerate() {
                for (k, tap) in filter.taps.iter().enumerate() {
                    out[lead - filter.lead + n + k] += f64::from(*sample) * f64::from(*tap);
                }
            }
        }
        out
    }

    /// How far below the root mean square of the output the greatest error is, in decibels.
    fn error_db(found: &[f32], expected: &[f64]) -> f64 {
        assert_eq!(found.len(), expected.len());
        let square: f64 = expected.iter().map(|e| e * e).sum::<f64>() / expected.len() as f64;
        let worst = found.iter().zip(expected).map(|(f, e)| (f64::from(*f) - e).abs()).fold(0.0, f64::max);
        20.0 * (worst / square.sqrt()).log10()
    }

    #[test]
    fn it_is_a_convolution() {
        let mut memory = Memory::default();
        for (taps, lead) in
            [(1, 0), (5, 2), (8, 0), (31, 9), (32, 0), (97, 40), (200, 0), (603, 24), (961, 480), (5000, 7)]
        {
            for count in [1, 7, 8, 31, 32, 300, 934, 1446] {
                let filter = Filter::new(noise(1, taps), lead);
                let input = noise(2, count);
                let found = convolve(&[(&input, &filter)], &mut memory);
                let error_db = error_db(&found, &expected(&[(&input, &filter)]));
                assert!(error_db < -115.0, "{taps} {lead} {count}: {error_db}");
            }
        }
    }

    #[test]
    fn two_inputs_through_two_filters_are_added() {
        let mut memory = Memory::default();
        for [(a, a_lead), (b, b_lead)] in [
            [(1, 0), (5, 2)],
            [(1, 0), (603, 24)],
            [(603, 24), (603, 24)],
            [(1563, 504), (603, 24)],
            [(80, 3), (961, 480)],
        ] {
            let (first, second) = (Filter::new(noise(1, a), a_lead), Filter::new(noise(2, b), b_lead));
            for count in [1, 100, 800] {
                let (fading, rising) = (noise(3, count), noise(4, count));
                let passing = [(&fading[..], &first), (&rising[..], &second)];
                let found = convolve(&passing, &mut memory);
                let error_db = error_db(&found, &expected(&passing));
                assert!(error_db < -115.0, "{a} {b} {count}: {error_db}");
                // What the memory was used for before does not matter.
                assert_eq!(found, convolve(&passing, &mut Memory::default()));
            }
        }
    }

    #[test]
    fn a_fall_from_loud_to_soft_is_right_to_110_db() {
        // A head's response: noise that falls by 80 dB, heard from a sound that does so too.
        let decay = |thread, count: usize| -> Vec<f32> {
            let fall = |n: usize| 10f32.powf(-4.0 * n as f32 / count as f32);
            noise(thread, count).iter().enumerate().map(|(n, sample)| sample * fall(n)).collect()
        };
        let (filter, input) = (Filter::new(decay(1, 603), 24), decay(2, 900));
        let passing = [(&input[..], &filter)];
        let (found, expected) = (convolve(&passing, &mut Memory::default()), expected(&passing));
        let [error, all] = [true, false].map(|is_error| {
            let squares =
                found.iter().zip(&expected).map(|(f, e)| if is_error { f64::from(*f) - e } else { *e });
            squares.map(|e| e * e).sum::<f64>()
        });
        assert!(10.0 * (error / all).log10() < -125.0, "{}", 10.0 * (error / all).log10());
    }

    #[test]
    fn silence_stays_silent_to_the_last_bit() {
        let filter = Filter::new(noise(1, 603), 24);
        assert!(convolve(&[(&[0.0; 900], &filter)], &mut Memory::default()).iter().all(|s| *s == 0.0));
        assert!(convolve(&[], &mut Memory::default()).is_empty());
    }

    #[test]
    fn pieces_fit_what_is_cut_and_cost_the_least() {
        for reach in [1, 31, 32, 109, 603, 961, 1563, 20_000] {
            for count in [1, 100, 479, 800, 1920, 48_000, 1 << 40] {
                let length = piece(count, reach);
                assert!((1..=longest(reach)).contains(&length), "{reach} {count}: {length}");
            }
        }
        // Keys sixty times a second are one piece each.
        assert_eq!(piece(800, 603), 800);
        // A whole number of pieces, none much shorter than the others.
        assert!(4 * piece(4800, 603) >= 4800);
    }

    #[test]
    fn two_filters_make_one() {
        let (first, second) = (Filter::new(noise(1, 61), 7), Filter::new(noise(2, 200), 90));
        let input = noise(3, 300);
        let through = |input: &[f32], filter: &Filter| convolve(&[(input, filter)], &mut Memory::default());
        let between = through(&input, &first);
        let twice = through(&between, &second);
        for both in [first.then(&second), second.then(&first)] {
            assert_eq!((both.taps.len(), both.lead), (260, 97));
            let once = through(&input, &both);
            assert_eq!(once.len(), twice.len());
            assert!(once.iter().zip(&twice).all(|(a, b)| (a - b).abs() < 1e-3), "of about 30");
        }
        assert_eq!(first.then(&Filter::identity()).taps, first.taps);
    }

    #[test]
    fn filters_are_kept_as_long_as_they_are_needed() {
        let mut filters = Filters::default();
        let filter = |value: f32| Filter::new([value], 0);
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
