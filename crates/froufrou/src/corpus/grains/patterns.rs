//! Correlation patterns: where in a recording each grain fits, and how well (Picard, Tsingos & Faure 2009, section 3.3).
//!
//! The normalised cross-correlation of a grain g of L samples with a recording x at sample t is
//!
//! ```text
//! ρ(t) = Σᵢ x[t + i] g[i] / (‖x[t .. t + L]‖ ‖g‖),   −1 ≤ ρ ≤ 1
//! ```
//!
//! for every t at which the grain lies within the recording. Where the recording is [much quieter](Matching::quietest_db)
//! than at its loudest, and outside of it, ρ is 0. A peak is a sample whose ρ is above that of the sample before and not below
//! that after; it counts if no peak [near it](Matching::spacing_s) is higher, and if it is high, the earlier one.
//! The [highest](Matching::peaks_per_grain) of those that count are the grain's part of the pattern.
//!
//! | step | cost |
//! | --- | --- |
//! | spectra of the recording | an FFT a block, once for each size of block that grains ask for |
//! | spectra of the grains | an FFT two grains |
//! | their product, and back | an FFT a block and two grains, which are the real and the imaginary part of one signal |
//! | peaks | a comparison a sample, with the lowest peak kept so far times the least energy nearby; few go beyond it |
//! | the values of the peaks that were kept | one sum each, in double precision |
//!
//! The FFTs are in single precision. Pairs of grains share all cores; each writes what is its own, so that the result
//! does not depend on the number of threads. Memory: 8 bytes a sample for running energies, at most 64 MiB for spectra
//! of the recording, and the peaks that are kept.

mod blocks;
mod energy;
mod picker;
#[cfg(test)]
mod tests;

use serde::{Deserialize, Serialize};

use crate::corpus::spectral::check_sound;
use crate::error::{Error, Place, Result};

/// The longest grain, in samples: what a block of FFT is sized by.
const LONGEST: usize = 1 << 20;

/// Which peaks to keep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Matching {
    /// The most peaks that one grain has in one recording: k.
    pub peaks_per_grain: usize,
    /// Lower peaks are not kept; 0 to 1.
    pub least_correlation: f64,
    /// Of two peaks of one grain nearer than this, the higher is kept.
    pub spacing_s: f64,
    /// Where a recording's power over a grain's length is lower than this below its highest over that length, nothing
    /// correlates; −60 to 0, as single precision knows no more.
    pub quietest_db: f64,
}

impl Default for Matching {
    fn default() -> Self {
        Self { peaks_per_grain: 8, least_correlation: 0.3, spacing_s: 0.01, quietest_db: -50.0 }
    }
}

/// A place where a grain fits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak {
    /// Which grain, counted from 0.
    pub grain: u32,
    /// The sample of the recording at which the grain begins.
    pub start: u64,
    /// The normalised cross-correlation.
    pub correlation: f32,
}

/// All grains of a dictionary, ready to be matched with recordings.
#[derive(Debug, Clone)]
pub struct Matcher<'a> {
    matching: Matching,
    grains: Vec<&'a [f32]>,
    /// Of each grain; none where all are of one.
    groups: Vec<usize>,
    rate_hz: u32,
}

impl<'a> Matcher<'a> {
    /// Takes the samples of grains at a rate. A silent grain fits nowhere.
    ///
    /// # Errors
    /// Where a grain is empty, longer than 2²⁰ samples or not finite, or a setting makes no sense.
    pub fn new(matching: Matching, grains: Vec<&'a [f32]>, rate_hz: u32) -> Result<Self> {
        let in_range = [
            ("least_correlation", matching.least_correlation, 0.0..=1.0),
            ("spacing_s", matching.spacing_s, 0.0..=100.0),
            ("quietest_db", matching.quietest_db, -60.0..=0.0),
        ];
        if let Some((name, value, range)) = in_range.into_iter().find(|(_, v, range)| !range.contains(v)) {
            let (from, to) = range.into_inner();
            return Err(Error::new(format!("{name} is {value}, expected {from} to {to}")));
        }
        if u32::try_from(grains.len()).is_err() {
            return Err(Error::new(format!("expected fewer than 2³² grains, found {}", grains.len())));
        }
        for (number, grain) in grains.iter().enumerate() {
            let place = || Place::Part(format!("grain {number}"));
            check_sound(grain, rate_hz).map_err(|e| Error::new(e.to_string()).at(place()))?;
            if grain.len() > LONGEST {
                return Err(Error::new(format!("expected at most {LONGEST} samples, found {}", grain.len()))
                    .at(place()));
            }
        }
        Ok(Self { matching, grains, groups: Vec::new(), rate_hz })
    }

    /// Says which grains belong together, by a number for each. What is found of a grain then depends on those of its
    /// group alone, to the last bit; groups of a few grains cost a little more.
    #[must_use]
    pub fn grouped(self, groups: Vec<usize>) -> Self {
        Self { groups, ..self }
    }

    /// Where the grains fit in one channel of a recording: the peaks in order of grains, each grain's by falling
    /// correlation.
    ///
    /// ```
    /// use froufrou::corpus::grains::patterns::{Matcher, Matching};
    /// let recording: Vec<f32> = (0..9000).map(|i| ((i * i) as f32 * 1e-5).sin()).collect();
    /// let matcher = Matcher::new(Matching::default(), vec![&recording[3000..4000]], 44_100)?;
    /// let pattern = matcher.pattern(&recording)?;
    /// assert_eq!(pattern[0].start, 3000);
    /// assert!((pattern[0].correlation - 1.0).abs() < 1e-6);
    /// # Ok::<(), froufrou::Error>(())
    /// ```
    ///
    /// # Errors
    /// Where there is no sample or one is not a finite number.
    pub fn pattern(&self, recording: &[f32]) -> Result<Vec<Peak>> {
        check_sound(recording, self.rate_hz)?;
        if self.matching.peaks_per_grain == 0 {
            return Ok(Vec::new());
        }
        Ok(blocks::pattern(&self.matching, &self.grains, &self.groups, self.rate_hz, recording))
    }
}
