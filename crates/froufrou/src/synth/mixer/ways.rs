//! From what arrives at receivers to the keys of their paths.

use super::super::filter::{ChannelPassage, Filters, Passage};
use super::super::path::{PathKey, UNFILTERED, UNSPREAD};
use super::super::receivers::{self, Receiver};
use crate::score::{Arrival, LONGEST_DELAY_S};
use crate::space::bands::{BandFilters, Bands};

/// Says what an arrival has that cannot be mixed.
pub(super) fn check_arrival(arrival: &Arrival, receiver: &Receiver) -> Result<(), String> {
    if !arrival.gain.is_finite() {
        return Err(format!("a gain of {}", arrival.gain));
    }
    match (receiver.has_places(), arrival.from_m) {
        (false, None) => {}
        (true, Some(from_m)) if from_m.iter().all(|c| c.is_finite()) => {}
        (false, Some(_)) => return Err("a place from where it comes to a channel".into()),
        (true, _) => return Err("no place from where it comes to a head".into()),
    }
    if let Some(gain) = arrival.bands.iter().flatten().find(|gain| !(gain.is_finite() && **gain >= 0.0)) {
        return Err(format!("a gain of {gain} of an octave band"));
    }
    if !(0.0..=LONGEST_DELAY_S).contains(&arrival.delay_s) {
        return Err(format!("a delay of {} s, not 0 to {LONGEST_DELAY_S} s,", arrival.delay_s));
    }
    Ok(())
}

/// How what arrives at receivers becomes the keys of their paths.
pub(super) struct Ways<'a> {
    pub receivers: &'a [Receiver],
    pub colours: Option<&'a BandFilters>,
}

/// All plain channels are one receiver, as far as their filters go: what has one colour in several of them passes
/// one filter.
const CHANNELS: usize = usize::MAX;

impl Ways<'_> {
    /// The keys of all paths for what arrives at the receivers.
    pub fn keys(&self, filters: &mut Filters, emission_s: f64, value: &[Arrival]) -> Vec<PathKey> {
        let mut keys = Vec::with_capacity(value.len());
        for (index, (receiver, arrival)) in self.receivers.iter().zip(value).enumerate() {
            let &Arrival { mut gain, delay_s, from_m, mut bands } = arrival;
            // Where all bands are alike there is no colour.
            if let Some(all) = bands.filter(|all| all.iter().all(|band| *band == all[0])) {
                (gain, bands) = (gain * all[0], None);
            }
            let plain = PathKey { emission_s, delay_s, gain, filter: UNFILTERED, spread: UNSPREAD };
            let plain = match receiver {
                Receiver::Bus(bus) => bus.key(plain, from_m, filters),
                _ => plain,
            };
            let (number, count) = match receiver {
                Receiver::Channel | Receiver::Bus(_) if bands.is_none() => {
                    keys.push(plain);
                    continue;
                }
                // One colour is one filter, from wherever it comes.
                Receiver::Channel | Receiver::Bus(_) => (CHANNELS, 1),
                Receiver::Head(_) => (index, 2),
            };
            let from_m = from_m.filter(|_| count == 2);
            let passages = filters.last(number, from_m, bands).or_else(|| {
                let channels = self.passages(receiver, from_m, bands, filters)?;
                filters.remember(number, Passage { from_m, bands, channels });
                Some(channels)
            });
            // No colour comes here without filters: see `follow`.
            let passages =
                passages.unwrap_or([ChannelPassage { delay_s: 0.0, gain: 1.0, filter: UNFILTERED }; 2]);
            keys.extend(passages.iter().take(count).map(|passage| PathKey {
                delay_s: (delay_s + passage.delay_s).clamp(0.0, LONGEST_DELAY_S),
                gain: gain * passage.gain,
                filter: passage.filter,
                ..plain
            }));
        }
        keys
    }

    fn passages(
        &self,
        receiver: &Receiver,
        from_m: Option<[f64; 3]>,
        bands: Option<Bands>,
        filters: &mut Filters,
    ) -> Option<[ChannelPassage; 2]> {
        match (receiver, from_m) {
            (Receiver::Head(head), Some(from_m)) => Some(head.ears(from_m, bands, self.colours, filters)),
            _ => {
                let filter = filters.push(receivers::colour(&bands?, self.colours?));
                Some([ChannelPassage { delay_s: 0.0, gain: 1.0, filter }; 2])
            }
        }
    }
}
