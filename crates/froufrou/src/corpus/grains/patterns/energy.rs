//! How much energy there is between two samples.

/// Sums of squares of a recording from its start.
pub(super) struct Energies {
    sums: Vec<f64>,
}

impl Energies {
    pub fn new(samples: &[f32]) -> Self {
        let mut sums = Vec::with_capacity(samples.len() + 1);
        sums.push(0.0);
        sums.extend(samples.iter().scan(0.0, |sum, &v| {
            *sum += f64::from(v).powi(2);
            Some(*sum)
        }));
        Self { sums }
    }

    /// The energy of a length from a sample on; both within the recording.
    pub fn of(&self, start: usize, length: usize) -> f64 {
        self.sums[start + length] - self.sums[start]
    }

    /// No stretch of a length that starts from `first` to `last` has less: the samples that are in all of them.
    pub fn least(&self, first: usize, last: usize, length: usize) -> f64 {
        if last - first >= length { 0.0 } else { self.sums[first + length] - self.sums[last] }
    }

    /// The most that a stretch of a length has.
    pub fn highest(&self, length: usize) -> f64 {
        let pairs = self.sums.iter().zip(self.sums.iter().skip(length));
        pairs.map(|(from, to)| to - from).fold(0.0, f64::max)
    }
}
