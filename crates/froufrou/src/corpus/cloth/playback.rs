//! Which pop sounds for which buckling, and when.
//!
//! Energies of bucklings are not those of sound. They are matched by their histograms: a buckling as strong as p % of
//! all bucklings gets a pop as strong as p % of all pops, E_s = c_s⁻¹(c_e(E_e)). Both distributions have
//! [`BINS`] bins, between whose edges they are straight (An, James & Marschner 2012). They are those of the
//! animation itself where all its events are known, and of a calibration where sounds have to be made as it goes.

use crate::error::{Error, Result};
use crate::random::Random;

/// How many bins a histogram has.
pub const BINS: usize = 20;

/// The most by which a pop may come later than its buckling: a frame of an animation at 30 frames a second.
pub const MOST_JITTER_S: f64 = 1.0 / 30.0;

/// The distribution of some energies: a histogram between the least and the greatest, summed up.
#[derive(Debug, Clone, PartialEq)]
pub struct Distribution {
    least: f64,
    greatest: f64,
    /// The share below each edge, from 0 to 1; one more than there are bins.
    below: Vec<f64>,
}

impl Distribution {
    /// Of at least one energy, none of them negative.
    ///
    /// # Errors
    /// No energy, or one that is negative or not finite.
    pub fn new(energies: &[f64]) -> Result<Self> {
        if let Some(bad) = energies.iter().find(|e| !(e.is_finite() && **e >= 0.0)) {
            return Err(Error::new(format!("an energy is {bad}, expected 0 or more")));
        }
        if energies.is_empty() {
            return Err(Error::new("there are no energies to make a histogram of"));
        }
        let least = energies.iter().copied().fold(f64::INFINITY, f64::min);
        let greatest = energies.iter().copied().fold(0.0, f64::max);
        let mut counts = [0u64; BINS];
        for energy in energies {
            let place = (energy - least) / (greatest - least) * BINS as f64;
            // All the same: NaN, which becomes 0.
            counts[(place as usize).min(BINS - 1)] += 1;
        }
        let mut sum = 0;
        let mut below = vec![0.0];
        for count in counts {
            sum += count;
            below.push(sum as f64 / energies.len() as f64);
        }
        Ok(Self { least, greatest, below })
    }

    fn edge(&self, index: usize) -> f64 {
        self.least + (self.greatest - self.least) * index as f64 / BINS as f64
    }

    /// The share that lies below an energy. Where all energies are the same, half of them lie below them.
    pub fn share(&self, energy: f64) -> f64 {
        if self.greatest <= self.least {
            return if energy < self.least {
                0.0
            } else if energy > self.least {
                1.0
            } else {
                0.5
            };
        }
        let place =
            ((energy - self.least) / (self.greatest - self.least) * BINS as f64).clamp(0.0, BINS as f64);
        let bin = (place as usize).min(BINS - 1);
        let along = place - bin as f64;
        self.below[bin] + (self.below[bin + 1] - self.below[bin]) * along
    }

    /// The energy below which a share lies: the least such.
    pub fn energy(&self, share: f64) -> f64 {
        let share = share.clamp(0.0, 1.0);
        let bin = self.below.partition_point(|below| *below < share).clamp(1, BINS) - 1;
        let [from, to] = [self.below[bin], self.below[bin + 1]];
        let along = if to > from { ((share - from) / (to - from)).clamp(0.0, 1.0) } else { 0.0 };
        self.edge(bin) + (self.edge(bin + 1) - self.edge(bin)) * along
    }
}

/// A pop that is to sound.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chosen {
    /// Its number, in the order that its energies were given in.
    pub pop: usize,
    /// When the middle of its energy is to be heard at its source, in seconds.
    pub time_s: f64,
    /// The energy that was looked for.
    pub energy: f64,
}

/// Chooses pops for bucklings.
///
/// ```
/// use froufrou::corpus::cloth::playback::Playback;
/// use froufrou::random::Random;
/// let pops = [1e-5, 4e-5, 9e-5];
/// let bucklings = [100.0, 250.0, 900.0];
/// let playback = Playback::new(&pops, &bucklings, 0.0, Random::new(7, 0))?;
/// assert_eq!(playback.choose(0, 2.5, 100.0).pop, 0);
/// assert_eq!(playback.choose(1, 2.6, 900.0).pop, 2);
/// # Ok::<(), froufrou::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Playback {
    /// Energies and numbers of pops, in order of energy.
    pops: Vec<(f64, usize)>,
    sounds: Distribution,
    events: Distribution,
    jitter_s: f64,
    random: Random,
}

impl Playback {
    /// From the energies of all pops and of the bucklings of the animation, or of a calibration. Each pop comes later than its buckling by
    /// up to `jitter_s`, at random.
    ///
    /// # Errors
    /// No pops or no bucklings, energies that are negative or not finite, or a jitter outside 0 to 1/30 s.
    pub fn new(pops: &[f64], bucklings: &[f64], jitter_s: f64, random: Random) -> Result<Self> {
        if !(0.0..=MOST_JITTER_S + 1e-9).contains(&jitter_s) {
            return Err(Error::new(format!("the jitter is {jitter_s} s, expected 0 to 1/30 s")));
        }
        let sounds = Distribution::new(pops)?;
        let events = Distribution::new(bucklings)?;
        let mut pops: Vec<(f64, usize)> = pops.iter().copied().zip(0..).collect();
        pops.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        Ok(Self { pops, sounds, events, jitter_s, random })
    }

    /// The pop for the buckling of a number, at a time, of an energy. The number addresses what is random.
    pub fn choose(&self, number: u64, time_s: f64, energy: f64) -> Chosen {
        let wanted = self.sounds.energy(self.events.share(energy));
        let after = self.pops.partition_point(|pop| pop.0 < wanted);
        let near = [after.checked_sub(1), Some(after)].into_iter().flatten().filter_map(|k| self.pops.get(k));
        let nearest = near.min_by(|a, b| (a.0 - wanted).abs().total_cmp(&(b.0 - wanted).abs()));
        let time_s = time_s + self.jitter_s * self.random.uniform(number);
        Chosen { pop: nearest.map_or(0, |pop| pop.1), time_s, energy: wanted }
    }
}

/// So many energies are remembered.
const REMEMBERED: usize = 1024;

/// Chooses pops for bucklings that are not known beforehand: by the distribution of those that have been.
///
/// ```
/// use froufrou::corpus::cloth::playback::Learning;
/// use froufrou::random::Random;
/// let pops = [1e-5, 4e-5, 9e-5];
/// let mut learning = Learning::new(&pops, 0.0, Random::new(7, 0));
/// (0..200u32).for_each(|k| drop(learning.choose(0.1 * f64::from(k), f64::from(1 + k * 37 % 100))));
/// assert_eq!(learning.choose(20.0, 1.0)?.pop, 0);
/// assert_eq!(learning.choose(20.1, 100.0)?.pop, 2);
/// # Ok::<(), froufrou::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Learning {
    pops: Vec<f64>,
    jitter_s: f64,
    random: Random,
    /// A fair share of all energies so far.
    energies: Vec<f64>,
    count: u64,
    playback: Option<Playback>,
}

impl Learning {
    /// From the energies of all pops; see [`Playback::new`].
    pub fn new(pops: &[f64], jitter_s: f64, random: Random) -> Self {
        Self { pops: pops.to_vec(), jitter_s, random, energies: Vec::new(), count: 0, playback: None }
    }

    /// The pop for the next buckling, at a time, of an energy.
    ///
    /// # Errors
    /// As [`Playback::new`].
    pub fn choose(&mut self, time_s: f64, energy: f64) -> Result<Chosen> {
        let number = self.count;
        self.count += 1;
        // Each that has been is remembered as likely as any other (Vitter 1985, algorithm R).
        if self.energies.len() < REMEMBERED {
            self.energies.push(energy);
        } else {
            let at = self.random.below(2 * number, usize::try_from(self.count).unwrap_or(usize::MAX));
            if let Some(energies) = self.energies.get_mut(at) {
                *energies = energy;
            }
        }
        // The distribution changes less and less.
        let is_due = self.count.is_power_of_two() || self.count.is_multiple_of(REMEMBERED as u64 / 4);
        let playback = match self.playback.take().filter(|_| !is_due) {
            Some(playback) => playback,
            None => Playback::new(&self.pops, &self.energies, self.jitter_s, self.random)?,
        };
        let chosen = playback.choose(2 * number + 1, time_s, energy);
        self.playback = Some(playback);
        Ok(chosen)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(serde::Deserialize)]
    struct Golden {
        samples: Vec<f64>,
        events: Vec<f64>,
        asked: Vec<f64>,
        matched: Vec<f64>,
    }

    fn golden() -> Golden {
        let text = std::fs::read_to_string("tests/fixtures/cloth/pops.json").unwrap();
        serde_json::from_str(&text).unwrap()
    }

    #[test]
    fn histograms_are_matched_as_numpy_matches_them() {
        let golden = golden();
        let playback = Playback::new(&golden.samples, &golden.events, 0.0, Random::new(0, 0)).unwrap();
        assert_eq!(golden.asked.len(), 8);
        for (asked, matched) in golden.asked.iter().zip(&golden.matched) {
            let chosen = playback.choose(0, 0.0, *asked);
            assert!((chosen.energy - matched).abs() < 1e-9 * matched.max(1.0), "{chosen:?}, {matched}");
            let nearest = golden.samples.iter().map(|e| (e - matched).abs()).fold(f64::INFINITY, f64::min);
            assert!((golden.samples[chosen.pop] - matched).abs() <= nearest + 1e-9);
        }
    }

    #[test]
    fn chosen_energies_are_distributed_as_the_pops_are() {
        let golden = golden();
        let playback = Playback::new(&golden.samples, &golden.events, 0.0, Random::new(0, 0)).unwrap();
        let mut chosen: Vec<f64> =
            golden.events.iter().map(|e| golden.samples[playback.choose(0, 0.0, *e).pop]).collect();
        let mut pops = golden.samples.clone();
        chosen.sort_by(f64::total_cmp);
        pops.sort_by(f64::total_cmp);
        // Their quartiles, to within the width of a bin.
        let width = pops[pops.len() - 1] / BINS as f64;
        for part in [0.25, 0.5, 0.75, 0.95] {
            let at = |values: &[f64]| values[(part * values.len() as f64) as usize];
            assert!((at(&chosen) - at(&pops)).abs() < width, "{part}: {} {}", at(&chosen), at(&pops));
        }
        // Stronger bucklings never get weaker pops.
        let energy = |e: f64| playback.choose(0, 0.0, e).energy;
        assert!((0..500).all(|k| energy(20.0 * f64::from(k)) <= energy(20.0 * f64::from(k + 1))));
    }

    #[test]
    fn what_is_learnt_comes_to_be_what_is_known() {
        let golden = golden();
        let known = Playback::new(&golden.samples, &golden.events, 0.0, Random::new(0, 0)).unwrap();
        let mut learning = Learning::new(&golden.samples, 0.0, Random::new(3, 0));
        // Much longer than it remembers.
        for round in 0..3000 / golden.events.len() + 40 {
            for (k, energy) in golden.events.iter().enumerate() {
                learning.choose((round * 1000 + k) as f64, *energy).unwrap();
            }
        }
        assert!(learning.energies.len() <= REMEMBERED);
        let greatest = golden.samples.iter().copied().fold(0.0, f64::max);
        for asked in &golden.asked {
            let (found, expected) =
                (learning.choose(0.0, *asked).unwrap().energy, known.choose(0, 0.0, *asked).energy);
            assert!((found - expected).abs() < 0.1 * greatest, "{asked}: {found}, {expected}");
        }
        let mut first = Learning::new(&[1.0, 2.0], 0.0, Random::new(0, 0));
        assert!(first.choose(0.0, 5.0).is_ok() && first.choose(0.0, f64::NAN).is_err());
        assert!(Learning::new(&[], 0.0, Random::new(0, 0)).choose(0.0, 1.0).is_err());
    }

    #[test]
    fn a_histogram_and_its_inverse_undo_one_another() {
        let golden = golden();
        let distribution = Distribution::new(&golden.events).unwrap();
        for energy in golden.asked {
            let share = distribution.share(energy);
            let back = distribution.energy(share);
            assert!((distribution.share(back) - share).abs() < 1e-12);
        }
        assert_eq!(distribution.share(-1.0), 0.0);
        assert_eq!(distribution.share(1e30), 1.0);
        let same = Distribution::new(&[3.0, 3.0]).unwrap();
        assert_eq!((same.share(3.0), same.energy(0.4)), (0.5, 3.0));
        assert!(Distribution::new(&[]).is_err());
        assert!(Distribution::new(&[1.0, f64::NAN]).is_err());
    }

    #[test]
    fn jitter_is_addressed_and_bounded() {
        let playback = |jitter_s| Playback::new(&[1.0], &[1.0], jitter_s, Random::new(3, 1)).unwrap();
        let times: Vec<f64> = (0..1000).map(|n| playback(MOST_JITTER_S).choose(n, 1.0, 1.0).time_s).collect();
        assert!(times.iter().all(|t| (1.0..1.0 + MOST_JITTER_S).contains(t)));
        let mean = times.iter().sum::<f64>() / 1000.0 - 1.0;
        assert!((mean - MOST_JITTER_S / 2.0).abs() < 0.001, "{mean}");
        assert_eq!(playback(MOST_JITTER_S).choose(7, 1.0, 1.0).time_s, times[7]);
        assert_eq!(playback(0.0).choose(7, 1.0, 1.0).time_s, 1.0);
        assert!(Playback::new(&[1.0], &[1.0], 0.1, Random::new(0, 0)).is_err());
    }
}
