//! The spectrum of friction at any speed, between those that were measured.
//!
//! A [`Spectrum`] is an amplitude density A(f): its square is the power a hertz of one side, so white noise of
//! variance 1 at 48 kHz has A = 1/√24000 throughout. Its values stand at whole multiples of a spacing, and each is that of a band as
//! wide as the spacing about its frequency. There is no band about 0 Hz.
//!
//! Between two measured speeds the inverses of the cumulative distributions are mixed, not the spectra: with
//! c(f) = ∫₀^f A divided by the whole, c⁻¹ = (1 − α) cᵢ⁻¹ + α cⱼ⁻¹ for α = (s − sᵢ) / (sⱼ − sᵢ), and A(f, s) is dc/df
//! times a total that is interpolated alongside. So what is heard slides from one pitch to the other. Below the
//! slowest measured speed A(f, s) = (s/s₀)² A₀(f); above the fastest it stays.

use crate::error::{Error, Result};

/// The spacing of measured spectra: that of clips of 50 ms.
pub const SPACING_HZ: f64 = 20.0;

/// The most values that a spectrum may have: up to 384 kHz.
const MOST_VALUES: usize = 19_200;

/// The most spectra.
const MOST_SPECTRA: usize = 4096;

/// What friction sounds like at one speed.
#[derive(Debug, Clone, PartialEq)]
pub struct Spectrum {
    /// The speed, above 0.
    pub speed_mps: f64,
    /// Amplitude densities in full scale a root hertz, 0 or above, at 1, 2, 3 … times the spacing.
    pub density: Vec<f64>,
}

impl Spectrum {
    /// The sum of all densities times the spacing, ∫A df.
    pub fn total(&self, spacing_hz: f64) -> f64 {
        self.density.iter().sum::<f64>() * spacing_hz
    }
}

/// The mean of ∫ A² df, in squares of full scale.
pub fn power(density: &[f64], spacing_hz: f64) -> f64 {
    density.iter().map(|a| a * a).sum::<f64>() * spacing_hz
}

/// The mean frequency of a spectrum, weighted by amplitude; 0 for silence.
pub fn centroid_hz(density: &[f64], spacing_hz: f64) -> f64 {
    let whole: f64 = density.iter().sum();
    let moment: f64 = density.iter().zip(1u32..).map(|(a, k)| a * f64::from(k)).sum();
    if whole > 0.0 { spacing_hz * moment / whole } else { 0.0 }
}

/// The spectra of one pair of materials over speed.
///
/// ```
/// use froufrou::corpus::cloth::spectra::{FrictionSpectra, Spectrum, centroid_hz};
/// let line = |speed_mps, at: usize| {
///     let mut density = vec![0.0; 400];
///     density[at - 1] = 0.01;
///     Spectrum { speed_mps, density }
/// };
/// let spectra = FrictionSpectra::new(20.0, vec![line(0.1, 50), line(0.3, 150)])?;
/// // Half way between 1 and 3 kHz there is one sound at 2 kHz, not both.
/// let between = spectra.at(0.2);
/// assert!((centroid_hz(&between, 20.0) - 2000.0).abs() < 1e-6);
/// assert_eq!(between[49], 0.0);
/// # Ok::<(), froufrou::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct FrictionSpectra {
    spacing_hz: f64,
    spectra: Vec<Spectrum>,
}

impl FrictionSpectra {
    /// Spectra in any order, all of one length.
    ///
    /// # Errors
    /// None at all, two of one speed, lengths that differ, or a number that is negative or not finite.
    pub fn new(spacing_hz: f64, mut spectra: Vec<Spectrum>) -> Result<Self> {
        if !(spacing_hz > 0.0 && spacing_hz.is_finite()) {
            return Err(Error::new(format!("the spacing of spectra is {spacing_hz} Hz")));
        }
        spectra.sort_by(|a, b| a.speed_mps.total_cmp(&b.speed_mps));
        let Some(first) = spectra.first() else {
            return Err(Error::new("there is no spectrum of friction at all"));
        };
        let length = first.density.len();
        if spectra.len() > MOST_SPECTRA || length == 0 || length > MOST_VALUES {
            return Err(Error::new(format!(
                "expected 1 to {MOST_SPECTRA} spectra of 1 to {MOST_VALUES} values, found {} of {length}",
                spectra.len()
            )));
        }
        for spectrum in &spectra {
            let speed = spectrum.speed_mps;
            if !(1e-9..=1e9).contains(&speed) {
                return Err(Error::new(format!(
                    "the speed of a spectrum is {speed} m/s, expected more than 0"
                )));
            }
            if spectrum.density.len() != length {
                let found = spectrum.density.len();
                return Err(Error::new(format!("a spectrum has {found} values, another {length}")));
            }
            if let Some(bad) = spectrum.density.iter().find(|a| !(0.0..=1e12).contains(*a)) {
                return Err(Error::new(format!("the spectrum at {speed} m/s holds {bad}")));
            }
        }
        if let Some(pair) = spectra.windows(2).find(|pair| pair[0].speed_mps == pair[1].speed_mps) {
            return Err(Error::new(format!("there are two spectra at {} m/s", pair[0].speed_mps)));
        }
        Ok(Self { spacing_hz, spectra })
    }

    /// What lies between two neighbouring values.
    pub fn spacing_hz(&self) -> f64 {
        self.spacing_hz
    }

    /// What was measured, in order of speed; at least one.
    pub fn measured(&self) -> &[Spectrum] {
        &self.spectra
    }

    /// How many values a spectrum has.
    pub fn values(&self) -> usize {
        self.spectra.first().map_or(0, |spectrum| spectrum.density.len())
    }

    /// The slowest and the fastest measured speed.
    pub fn speeds_mps(&self) -> [f64; 2] {
        let speed = |spectrum: Option<&Spectrum>| spectrum.map_or(1.0, |spectrum| spectrum.speed_mps);
        [speed(self.spectra.first()), speed(self.spectra.last())]
    }

    /// The amplitude density A(f, s) at a speed; its sign does not matter.
    pub fn at(&self, speed_mps: f64) -> Vec<f64> {
        let speed = speed_mps.abs();
        let after = self.spectra.partition_point(|spectrum| spectrum.speed_mps < speed);
        let (Some(last), Some(first)) = (self.spectra.last(), self.spectra.first()) else {
            return Vec::new();
        };
        if speed.is_nan() {
            return vec![0.0; first.density.len()];
        }
        let Some(high) = self.spectra.get(after) else { return last.density.clone() };
        if high.speed_mps == speed {
            return high.density.clone();
        }
        let Some(low) = after.checked_sub(1).and_then(|before| self.spectra.get(before)) else {
            let part = (speed / first.speed_mps).powi(2);
            return first.density.iter().map(|a| a * part).collect();
        };
        let along = (speed - low.speed_mps) / (high.speed_mps - low.speed_mps);
        between(&low.density, &high.density, along)
    }

    /// By what ratio the quantiles of one measured spectrum lie off those of the next, at most, as far as they are heard:
    /// from 2 % to 98 % of the whole, in octaves. How far the pitch slides between the two.
    pub fn slide_octaves(&self, index: usize) -> f64 {
        let (Some(low), Some(high)) = (self.spectra.get(index), self.spectra.get(index + 1)) else {
            return 0.0;
        };
        let (low, high) = (quantiles(&low.density), quantiles(&high.density));
        low.iter().zip(&high).map(|(a, b)| (b / a).log2().abs()).fold(0.0, f64::max)
    }
}

/// Where in units of the spacing 2, 4, … 98 % of a spectrum lie below.
fn quantiles(density: &[f64]) -> Vec<f64> {
    let mut bands = Bands::new(density);
    (0..49).map(|_| bands.take(0.02)[1]).collect()
}

/// A spectrum as a distribution, walked from low to high.
struct Bands<'a> {
    density: &'a [f64],
    whole: f64,
    /// The band that is walked through, and how much of it has been.
    band: usize,
    walked: f64,
}

impl<'a> Bands<'a> {
    fn new(density: &'a [f64]) -> Self {
        let mut bands = Self { density, whole: density.iter().sum(), band: 0, walked: 0.0 };
        bands.skip();
        bands
    }

    /// Passes bands in which there is nothing.
    fn skip(&mut self) {
        while self.density.get(self.band).is_some_and(|a| *a <= 0.0) {
            self.band += 1;
        }
    }

    /// Where in the spectrum it is, in units of the spacing.
    fn place(&self) -> f64 {
        let part = self.density.get(self.band).map_or(0.0, |a| self.walked / a);
        self.band as f64 + 0.5 + part.min(1.0)
    }

    /// The share of the whole that is left in this band; infinite beyond the last.
    fn left(&self) -> f64 {
        self.density.get(self.band).map_or(f64::INFINITY, |a| (a - self.walked) / self.whole)
    }

    /// Walks on by a share; from where to where.
    fn take(&mut self, share: f64) -> [f64; 2] {
        let from = self.place();
        let mut to = from;
        let mut rest = share * self.whole;
        while let Some(a) = self.density.get(self.band) {
            let left = a - self.walked;
            if rest < left {
                self.walked += rest;
                return [from, self.place()];
            }
            rest -= left;
            to = self.band as f64 + 1.5;
            self.band += 1;
            self.walked = 0.0;
            self.skip();
            if rest <= 0.0 {
                break;
            }
        }
        [from, to]
    }
}

/// What lies between two spectra, `along` from 0 to 1.
fn between(low: &[f64], high: &[f64], along: f64) -> Vec<f64> {
    let (mut lows, mut highs) = (Bands::new(low), Bands::new(high));
    let whole = lows.whole + (highs.whole - lows.whole) * along;
    // Silence has no shape: there the other's stays.
    if lows.whole <= 0.0 || highs.whole <= 0.0 {
        let (shape, of) = if lows.whole > 0.0 { (low, lows.whole) } else { (high, highs.whole) };
        let scale = if of > 0.0 { whole / of } else { 0.0 };
        return shape.iter().map(|a| a * scale).collect();
    }
    let mut out = vec![0.0; low.len()];
    while lows.band < low.len() && highs.band < high.len() {
        // To the end of whichever band ends first: up to there both are even.
        let share = lows.left().min(highs.left());
        let ([a, b], [c, d]) = (step(&mut lows, share), step(&mut highs, share));
        let mix = |x: f64, y: f64| x + (y - x) * along;
        spread(&mut out, mix(a, c), mix(b, d), share * whole);
    }
    out
}

/// Walks on within one band, to its end where that is all that is left.
fn step(bands: &mut Bands<'_>, share: f64) -> [f64; 2] {
    if share < bands.left() {
        return bands.take(share);
    }
    let from = bands.place();
    let to = bands.band as f64 + 1.5;
    bands.band += 1;
    bands.walked = 0.0;
    bands.skip();
    [from, to]
}

/// Adds an amount, spread evenly from one place to another, to the bands in which it lies.
fn spread(out: &mut [f64], from: f64, to: f64, amount: f64) {
    let last = out.len().saturating_sub(1);
    // Band `k` goes from k + 1/2 to k + 3/2.
    let band = |place: f64| ((place - 0.5).max(0.0) as usize).min(last);
    let (first, end) = (band(from), band(to));
    if first == end || to <= from {
        out[first] += amount;
        return;
    }
    let per_band = amount / (to - from);
    out[first] += per_band * (first as f64 + 1.5 - from);
    out[first + 1..end].iter_mut().for_each(|a| *a += per_band);
    out[end] += per_band * (to - (end as f64 + 0.5));
}

#[cfg(test)]
mod tests;
