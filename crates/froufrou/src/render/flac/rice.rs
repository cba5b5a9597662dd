//! What a prediction left over, in Rice codes: short words for small numbers.
//!
//! A block is cut into equal partitions, as many as pay, each with a word length of its own.

use super::bits::Bits;

/// The most partitions: two to this power, as the streamable subset of FLAC has it.
const MAX_ORDER: u32 = 8;

/// The longest parameter of the short form.
const SHORT_MAX: u32 = 14;

/// The longest parameter of the long form; 31 means another thing.
const LONG_MAX: u32 = 30;

/// How a residual is to be coded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Rice {
    /// The parameter of each partition.
    parameters: Vec<u32>,
    /// How many bits it takes, to within half a bit a number.
    pub(super) bits: u64,
}

/// Folds the sign into the lowest bit.
fn fold(number: i32) -> u32 {
    (number << 1 ^ number >> 31) as u32
}

/// The best parameter for numbers of a sum, and the bits that they take with it.
fn parameter(sum: u64, count: u64) -> (u32, u64) {
    let mean = sum / count.max(1);
    let near = (u64::BITS - mean.leading_zeros()).saturating_sub(1);
    let bits = |k: u32| count * u64::from(k + 1) + (sum >> k);
    let candidates = near.saturating_sub(1)..=near + 1;
    let best = candidates.map(|k| k.min(LONG_MAX)).map(|k| (bits(k), k)).min().unwrap_or((bits(0), 0));
    (best.1, best.0)
}

impl Rice {
    /// Plans for the numbers of a block of `length` samples, of which the first `order` are not
    /// predicted.
    pub(super) fn plan(residual: &[i32], order: usize) -> Self {
        let length = residual.len() + order;
        let mut finest = length.trailing_zeros().min(MAX_ORDER);
        while finest > 0 && length >> finest <= order {
            finest -= 1;
        }
        let size = length >> finest;
        let mut sums = vec![0u64; 1 << finest];
        let mut at = 0;
        for (partition, sum) in sums.iter_mut().enumerate() {
            let end = ((partition + 1) * size).saturating_sub(order).min(residual.len());
            *sum = residual[at..end].iter().map(|number| u64::from(fold(*number))).sum();
            at = end;
        }
        let mut best: Option<Self> = None;
        loop {
            let size = length / sums.len();
            let mut bits = 6;
            let mut parameters = Vec::with_capacity(sums.len());
            for (partition, sum) in sums.iter().enumerate() {
                let count = size - if partition == 0 { order.min(size) } else { 0 };
                let (k, cost) = parameter(*sum, count as u64);
                parameters.push(k);
                bits += cost;
            }
            bits += parameters.len() as u64 * u64::from(width(&parameters));
            if best.as_ref().is_none_or(|best| bits < best.bits) {
                best = Some(Self { parameters, bits });
            }
            if sums.len() == 1 {
                return best.unwrap_or(Self { parameters: vec![0], bits });
            }
            sums = sums.chunks(2).map(|pair| pair.iter().sum()).collect();
        }
    }

    /// Writes the numbers as planned.
    pub(super) fn write(&self, residual: &[i32], order: usize, to: &mut Bits) {
        let width = width(&self.parameters);
        to.put(u64::from(width == 5), 2);
        to.put(u64::from(self.parameters.len().trailing_zeros()), 4);
        let size = (residual.len() + order) / self.parameters.len();
        let mut at = 0;
        for (partition, k) in self.parameters.iter().enumerate() {
            to.put(u64::from(*k), width);
            let end = ((partition + 1) * size).saturating_sub(order).min(residual.len());
            for number in &residual[at..end] {
                let folded = fold(*number);
                let (quotient, rest) = (folded >> k, u64::from(folded) & ((1 << k) - 1));
                if quotient <= 31 - k {
                    to.put(1 << k | rest, quotient + 1 + k);
                } else {
                    to.put_unary(quotient);
                    to.put(rest, *k);
                }
            }
            at = end;
        }
    }
}

/// Bits of each parameter.
fn width(parameters: &[u32]) -> u32 {
    if parameters.iter().all(|k| *k <= SHORT_MAX) { 4 } else { 5 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_are_folded() {
        assert_eq!([0, -1, 1, -2, i32::MAX, i32::MIN].map(fold), [0, 1, 2, 3, u32::MAX - 1, u32::MAX]);
    }

    #[test]
    fn the_plan_is_about_as_long_as_the_code() {
        let random = crate::random::Random::new(3, 0);
        for (scale, length, order) in
            [(1.0, 4096, 0), (9e3, 4096, 12), (2e9, 1000, 4), (300.0, 77, 2), (0.0, 5, 4)]
        {
            // Loud in the second half only, so that partitions pay.
            let loudness = |i: usize| if i > length / 2 { scale } else { scale / 50.0 };
            let residual: Vec<i32> =
                (order..length).map(|i| ((random.uniform(i as u64) - 0.5) * loudness(i)) as i32).collect();
            let plan = Rice::plan(&residual, order);
            let mut bits = Bits::default();
            plan.write(&residual, order, &mut bits);
            let written = bits.into_bytes().len() as u64 * 8;
            assert!(
                written <= plan.bits + 8 && plan.bits <= written + length as u64,
                "{written} {}",
                plan.bits
            );
        }
    }
}
