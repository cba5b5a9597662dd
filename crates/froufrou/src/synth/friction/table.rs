//! Powers over speed, and how much of a cloth moves how fast.

use crate::corpus::cloth::spectra::FrictionSpectra;

/// By how many octaves quantiles may lie apart in neighbouring spectra of the table. What lies between is
/// cross-faded, and so narrow that it is heard as one.
const STEP_OCTAVES: f64 = 1.0 / 24.0;

/// The most steps between two measured spectra.
const MOST_STEPS: usize = 96;

/// The most values of a table, over all its speeds.
const MOST_VALUES: usize = 1 << 24;

/// Cells of the index that finds speeds, for each entry of the table.
const CELLS: usize = 4;

/// A² over speed, finely enough that what lies between two entries may be mixed.
#[derive(Debug, Clone, PartialEq)]
pub struct FrictionTable {
    spacing_hz: f64,
    values: usize,
    speeds_mps: Vec<f64>,
    /// One spectrum after the other.
    powers: Vec<f64>,
    /// The whole of each spectrum, ∫ A² df.
    wholes: Vec<f64>,
    /// The entry at or below the beginning of each cell, which are evenly wide in the logarithm of speed.
    cells: Vec<usize>,
    /// Cells for each unit of the natural logarithm.
    cells_per_ln: f64,
}

impl FrictionTable {
    /// The table of some spectra.
    pub fn new(spectra: &FrictionSpectra) -> Self {
        let values = spectra.values();
        let measured = spectra.measured();
        let most = (MOST_VALUES / values.max(1) / measured.len().max(1)).clamp(1, MOST_STEPS);
        let mut speeds_mps = Vec::new();
        for (index, low) in measured.iter().enumerate() {
            speeds_mps.push(low.speed_mps);
            if let Some(high) = measured.get(index + 1) {
                let steps = (spectra.slide_octaves(index) / STEP_OCTAVES).ceil();
                // Levels differ too, by 1 dB a step at most.
                let levels = (low.total(1.0) / high.total(1.0)).log10().abs() * 20.0;
                let steps =
                    (steps.max(if levels.is_finite() { levels } else { 0.0 }) as usize).clamp(1, most);
                let ratio = high.speed_mps / low.speed_mps;
                let between = (1..steps).map(|k| low.speed_mps * ratio.powf(k as f64 / steps as f64));
                speeds_mps.extend(between);
            }
        }
        let powers: Vec<f64> =
            speeds_mps.iter().flat_map(|speed| spectra.at(*speed).into_iter().map(|a| a * a)).collect();
        let spacing_hz = spectra.spacing_hz();
        let wholes =
            powers.chunks(values.max(1)).map(|power| power.iter().sum::<f64>() * spacing_hz).collect();
        let [slowest, fastest] = spectra.speeds_mps();
        let count = CELLS * speeds_mps.len();
        let cells_per_ln = if fastest > slowest { count as f64 / (fastest / slowest).ln() } else { 0.0 };
        let begins = (0..count).map(|cell| slowest * (cell as f64 / cells_per_ln.max(1e-300)).exp());
        let cells =
            begins.map(|begin| speeds_mps.partition_point(|s| *s <= begin).saturating_sub(1)).collect();
        Self { spacing_hz, values, speeds_mps, powers, wholes, cells, cells_per_ln }
    }

    /// What lies between two values of a spectrum.
    pub fn spacing_hz(&self) -> f64 {
        self.spacing_hz
    }

    /// How many values a spectrum has; they stand at 1, 2, 3 … times the spacing.
    pub fn values(&self) -> usize {
        self.values
    }

    /// The speeds of its entries.
    pub fn speeds_mps(&self) -> &[f64] {
        &self.speeds_mps
    }

    /// A² of an entry; empty where there is no such entry.
    pub fn power(&self, entry: usize) -> &[f64] {
        self.powers.get(entry * self.values..(entry + 1) * self.values).unwrap_or_default()
    }

    /// Which two entries make up a speed, and with what weights: A² of that speed is their sum.
    pub fn place(&self, speed_mps: f64) -> [(usize, f64); 2] {
        let last = self.speeds_mps.len() - 1;
        let (slowest, fastest) = (self.speeds_mps[0], self.speeds_mps[last]);
        if speed_mps >= fastest {
            return [(last, 1.0), (last, 0.0)];
        }
        if speed_mps > slowest {
            let cell = ((speed_mps / slowest).ln() * self.cells_per_ln) as usize;
            let mut entry = self.cells.get(cell).copied().unwrap_or(0).min(last - 1);
            while entry + 1 < last && self.speeds_mps[entry + 1] <= speed_mps {
                entry += 1;
            }
            while entry > 0 && self.speeds_mps[entry] > speed_mps {
                entry -= 1;
            }
            let [low, high] = [self.speeds_mps[entry], self.speeds_mps[entry + 1]];
            let along = (speed_mps - low) / (high - low);
            return [(entry, 1.0 - along), (entry + 1, along)];
        }
        // A falls with the square of speed, so its square with the fourth power; what is no number is at rest.
        let part = (speed_mps / slowest).powi(4);
        [(0, if part > 0.0 { part } else { 0.0 }), (0, 0.0)]
    }

    /// The power of a point of weight 1 at a speed, ∫ A² df.
    pub fn whole(&self, speed_mps: f64) -> f64 {
        self.place(speed_mps).iter().map(|&(entry, weight)| weight * self.wholes[entry]).sum()
    }
}

/// A part of a cloth that moves at nearly one speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    /// Its speed in m/s.
    pub speed_mps: f64,
    /// Its amplitude: the root of its weight.
    pub level: f64,
    /// By how much its points stray from that speed: the standard deviation of its natural logarithm.
    pub spread: f64,
}

/// Standard deviations between two of the speeds that a spread part is made of, and how many there are on a side.
const SPREAD_STEP: f64 = 0.5;
const SPREAD_SIDE: i32 = 6;

/// How much of a cloth moves how fast: weights of the entries of a table.
///
/// ```
/// use froufrou::corpus::cloth::spectra::{FrictionSpectra, Spectrum};
/// use froufrou::synth::friction::{FrictionTable, SpeedHistogram};
/// let measured = vec![Spectrum { speed_mps: 0.1, density: vec![0.01; 500] }];
/// let table = FrictionTable::new(&FrictionSpectra::new(20.0, measured)?);
/// let mut histogram = SpeedHistogram::new(&table);
/// for vertex in 0..1000 {
///     histogram.add(&table, 0.1, 0.001);
/// }
/// // A thousand points of a thousandth of the weight are as loud as one.
/// let parts = histogram.parts(&table, 1);
/// assert!((parts[0].level - 1.0).abs() < 1e-9);
/// # Ok::<(), froufrou::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct SpeedHistogram {
    weights: Vec<f64>,
}

impl SpeedHistogram {
    /// Nothing moves.
    pub fn new(table: &FrictionTable) -> Self {
        Self { weights: vec![0.0; table.speeds_mps.len()] }
    }

    /// Nothing moves any more.
    pub fn clear(&mut self) {
        self.weights.fill(0.0);
    }

    /// A point that moves at a speed joins, with a weight of 0 or more. The table must be that of
    /// [`SpeedHistogram::new`].
    pub fn add(&mut self, table: &FrictionTable, speed_mps: f64, weight: f64) {
        if !(weight > 0.0 && weight.is_finite()) {
            return;
        }
        for (entry, part) in table.place(speed_mps.abs()) {
            if let Some(sum) = self.weights.get_mut(entry) {
                *sum += weight * part;
            }
        }
    }

    /// All points of a part join.
    pub fn add_part(&mut self, table: &FrictionTable, part: &Part) {
        let weight = part.level * part.level;
        if part.spread.is_nan() || part.spread <= 0.0 {
            self.add(table, part.speed_mps, weight);
            return;
        }
        let density = |step: i32| (-0.5 * (f64::from(step) * SPREAD_STEP).powi(2)).exp();
        let whole: f64 = (-SPREAD_SIDE..=SPREAD_SIDE).map(density).sum();
        for step in -SPREAD_SIDE..=SPREAD_SIDE {
            let speed = part.speed_mps * (f64::from(step) * SPREAD_STEP * part.spread.min(8.0)).exp();
            self.add(table, speed, weight * density(step) / whole);
        }
    }

    /// The weights of the entries of the table.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// The power of all that moves, ∫ A² df.
    pub fn power(&self, table: &FrictionTable) -> f64 {
        self.weights.iter().zip(&table.wholes).map(|(weight, whole)| weight * whole).sum()
    }

    /// Fills `out` with A² of all that moves.
    pub fn spectrum(&self, table: &FrictionTable, out: &mut Vec<f64>) {
        out.clear();
        out.resize(table.values, 0.0);
        for (entry, weight) in self.weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
            for (sum, power) in out.iter_mut().zip(table.power(entry)) {
                *sum += weight * power;
            }
        }
    }

    /// Splits what moves into at most `count` parts that sound equally loud, from slow to fast. Together they have the power
    /// of the whole; speed and spread of each are those of its points. Nothing where nothing is heard.
    pub fn parts(&self, table: &FrictionTable, count: usize) -> Vec<Part> {
        let whole = self.power(table);
        if whole.is_nan() || whole <= 0.0 || count == 0 {
            return Vec::new();
        }
        let share = whole / count as f64;
        let mut groups = vec![Group::default(); count];
        let (mut group, mut room) = (0, share);
        for (entry, weight) in self.weights.iter().enumerate() {
            let (mut weight, loudness) = (*weight, table.wholes[entry]);
            let ln = table.speeds_mps[entry].ln();
            while weight * loudness > room && group + 1 < count {
                groups[group].add(ln, room / loudness, loudness);
                weight -= room / loudness;
                group += 1;
                room = share;
            }
            room -= weight * loudness;
            groups[group].add(ln, weight, loudness);
        }
        groups.iter().filter_map(|group| group.part(table)).collect()
    }
}

/// What a group of points sums up to.
#[derive(Debug, Clone, Copy, Default)]
struct Group {
    weight: f64,
    sum: f64,
    squares: f64,
    power: f64,
}

impl Group {
    fn add(&mut self, ln: f64, weight: f64, loudness: f64) {
        self.weight += weight;
        self.sum += weight * ln;
        self.squares += weight * ln * ln;
        self.power += weight * loudness;
    }

    fn part(&self, table: &FrictionTable) -> Option<Part> {
        if !(self.weight > 0.0 && self.power > 0.0) {
            return None;
        }
        let mean = self.sum / self.weight;
        let spread = (self.squares / self.weight - mean * mean).max(0.0).sqrt();
        // Less is rounding.
        let spread = if spread < 1e-6 { 0.0 } else { spread };
        let mut part = Part { speed_mps: mean.exp(), level: 1.0, spread };
        let mut one = SpeedHistogram::new(table);
        one.add_part(table, &part);
        part.level = (self.power / one.power(table)).sqrt();
        part.level.is_finite().then_some(part)
    }
}
