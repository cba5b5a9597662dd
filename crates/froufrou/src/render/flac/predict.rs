//! One channel of a block: what predicts its samples best, and how that is written.
//!
//! Sums are made in the same order everywhere, and of numbers that `f64` holds exactly where they
//! must be exact: the same samples give the same bytes.

use super::bits::Bits;
use super::rice::Rice;

/// The highest order of a predictor made for the block; the streamable subset allows 12 at 48 kHz.
const MAX_ORDER: usize = 12;

/// Lags that are summed at once, for vector units.
const LAGS: usize = 16;

/// Bits of a coefficient, with its sign.
const PRECISION: u32 = 14;

/// Shorter blocks are not worth a predictor of their own.
const MIN_SAMPLES: usize = 64;

/// How the samples of one channel are stored.
pub(super) struct Subframe {
    samples: Vec<i32>,
    /// Bits of a sample, without those that are always zero.
    sample_bits: u32,
    /// Low bits that are zero in every sample.
    wasted: u32,
    method: Method,
    /// Bits that it takes, about.
    pub(super) bits: u64,
}

enum Method {
    Constant,
    Verbatim,
    /// A difference of that order, 0 to 4.
    Fixed {
        order: usize,
        residual: Vec<i32>,
        rice: Rice,
    },
    /// A predictor made for the block.
    Linear {
        predictor: Predictor,
        residual: Vec<i32>,
        rice: Rice,
    },
}

/// A linear predictor: the sum of coefficients times the samples before, shifted down.
struct Predictor {
    coefficients: Vec<i32>,
    shift: u32,
}

impl Subframe {
    /// Finds the shortest way to store samples of so many bits, at most 25.
    pub(super) fn new(mut samples: Vec<i32>, bits: u32) -> Self {
        let first = samples.first().copied().unwrap_or(0);
        if samples.iter().all(|sample| *sample == first) {
            return Self {
                samples,
                sample_bits: bits,
                wasted: 0,
                method: Method::Constant,
                bits: 8 + u64::from(bits),
            };
        }
        let wasted = samples.iter().fold(0, |all, sample| all | sample).trailing_zeros();
        samples.iter_mut().for_each(|sample| *sample >>= wasted);
        let sample_bits = bits - wasted;
        let mut best = (samples.len() as u64 * u64::from(sample_bits), Method::Verbatim);
        let mut offer = |bits: u64, method: Method| {
            if bits < best.0 {
                best = (bits, method);
            }
        };
        let (order, residual) = fixed(&samples);
        let rice = Rice::plan(&residual, order);
        offer(rice.bits + order as u64 * u64::from(sample_bits), Method::Fixed { order, residual, rice });
        if samples.len() >= MIN_SAMPLES
            && let Some(predictor) = Predictor::of(&samples, sample_bits)
            && let Some(residual) = predictor.residual(&samples)
        {
            let order = predictor.coefficients.len();
            let rice = Rice::plan(&residual, order);
            let extra = 9 + order as u64 * u64::from(sample_bits + PRECISION);
            offer(rice.bits + extra, Method::Linear { predictor, residual, rice });
        }
        let (bits, method) = best;
        Self { samples, sample_bits, wasted, method, bits: bits + 8 + u64::from(wasted) }
    }

    /// Writes it.
    pub(super) fn write(&self, to: &mut Bits) {
        let kind = match &self.method {
            Method::Constant => 0,
            Method::Verbatim => 1,
            Method::Fixed { order, .. } => 8 | *order as u64,
            Method::Linear { predictor, .. } => 32 | (predictor.coefficients.len() - 1) as u64,
        };
        to.put(kind << 1 | u64::from(self.wasted > 0), 8);
        if self.wasted > 0 {
            to.put_unary(self.wasted - 1);
        }
        let put = |samples: &[i32], to: &mut Bits| {
            samples.iter().for_each(|sample| to.put_signed(*sample, self.sample_bits));
        };
        match &self.method {
            Method::Constant => put(self.samples.get(..1).unwrap_or(&[0]), to),
            Method::Verbatim => put(&self.samples, to),
            Method::Fixed { order, residual, rice } => {
                put(&self.samples[..*order], to);
                rice.write(residual, *order, to);
            }
            Method::Linear { predictor, residual, rice } => {
                let order = predictor.coefficients.len();
                put(&self.samples[..order], to);
                to.put(u64::from(PRECISION - 1), 4);
                to.put(u64::from(predictor.shift), 5);
                predictor.coefficients.iter().for_each(|c| to.put_signed(*c, PRECISION));
                rice.write(residual, order, to);
            }
        }
    }
}

/// The difference, of order 0 to 4, that is the smallest; and its order.
fn fixed(samples: &[i32]) -> (usize, Vec<i32>) {
    let mut sums = [0u64; 5];
    // The differences of every order that end before the sample.
    let mut before = [0i32; 4];
    for (index, sample) in samples.iter().enumerate() {
        let mut difference = *sample;
        for order in 0..5 {
            if index >= 4 {
                sums[order] += u64::from(difference.unsigned_abs());
            }
            if order < 4 {
                let next = difference.wrapping_sub(before[order]);
                before[order] = difference;
                difference = next;
            }
        }
    }
    let most = samples.len().saturating_sub(1).min(4);
    let order = (0..=most).min_by_key(|order| sums[*order]).unwrap_or(0);
    let mut residual = samples.to_vec();
    for pass in 0..order {
        for index in (pass + 1..residual.len()).rev() {
            residual[index] = residual[index].wrapping_sub(residual[index - 1]);
        }
    }
    residual.drain(..order);
    (order, residual)
}

impl Predictor {
    /// By the autocorrelation of the samples, for the order that should take the fewest bits.
    fn of(samples: &[i32], sample_bits: u32) -> Option<Self> {
        let correlation = autocorrelation(samples);
        let (mut error, mut coefficients) = (correlation[0], Vec::<f64>::new());
        if error <= 0.0 {
            return None;
        }
        let mut best: Option<(f64, Vec<f64>)> = None;
        for order in 1..=MAX_ORDER {
            // Levinson and Durbin's recursion.
            let so_far = coefficients.iter().enumerate().map(|(k, c)| c * correlation[order - 1 - k]);
            let reflection = (correlation[order] - so_far.sum::<f64>()) / error;
            let reversed: Vec<f64> = coefficients.iter().rev().copied().collect();
            coefficients.iter_mut().zip(reversed).for_each(|(c, r)| *c -= reflection * r);
            coefficients.push(reflection);
            error *= 1.0 - reflection * reflection;
            if !(error > 0.0 && error.is_finite()) {
                break;
            }
            // What Rice codes of numbers of that power take, were they distributed as Laplace has it.
            let count = samples.len() as f64;
            let each = (0.5 * (0.5 * error / count).log2() + 1.0).max(0.5);
            let bits = each * (count - order as f64) + order as f64 * f64::from(sample_bits + PRECISION);
            if best.as_ref().is_none_or(|(least, _)| bits < *least) {
                best = Some((bits, coefficients.clone()));
            }
        }
        Self::quantized(&best?.1)
    }

    /// The nearest integers, all scaled by the same power of two.
    fn quantized(coefficients: &[f64]) -> Option<Self> {
        let largest = coefficients.iter().fold(0f64, |largest, c| largest.max(c.abs()));
        if !(largest > 0.0 && largest.is_finite()) {
            return None;
        }
        let limit = f64::from(1 << (PRECISION - 1));
        let shift = (0..=15).rev().find(|shift| largest * f64::from(1 << shift) < limit - 1.0)?;
        let mut rest = 0.0;
        let round = |c: &f64| {
            // What rounding left over goes to the next one.
            rest += c * f64::from(1 << shift);
            let rounded = rest.round().clamp(-limit, limit - 1.0);
            rest -= rounded;
            rounded as i32
        };
        Some(Self { coefficients: coefficients.iter().map(round).collect(), shift })
    }

    /// What it leaves over; `None` where that does not fit in 32 bits.
    fn residual(&self, samples: &[i32]) -> Option<Vec<i32>> {
        let order = self.coefficients.len();
        let numbers: Vec<f64> = samples.iter().map(|sample| f64::from(*sample)).collect();
        let mut residual = Vec::with_capacity(samples.len() - order);
        let mut sums = [0f64; 256];
        for start in (order..samples.len()).step_by(sums.len()) {
            let count = sums.len().min(samples.len() - start);
            let sums = &mut sums[..count];
            sums.fill(0.0);
            for (lag, coefficient) in self.coefficients.iter().enumerate() {
                let (coefficient, from) = (f64::from(*coefficient), start - 1 - lag);
                // Whole numbers below 2⁵³: exact in any order.
                let terms = sums.iter_mut().zip(&numbers[from..from + count]);
                terms.for_each(|(sum, number)| *sum += coefficient * number);
            }
            for (sum, sample) in sums.iter().zip(&samples[start..]) {
                let left = i64::from(*sample) - (*sum as i64 >> self.shift);
                // Of the 32 bits the lowest number is not allowed.
                residual.push(i32::try_from(left).ok().filter(|left| *left != i32::MIN)?);
            }
        }
        Some(residual)
    }
}

/// Sums of products of the samples with those some samples before, faded in and out.
fn autocorrelation(samples: &[i32]) -> [f64; LAGS] {
    let length = samples.len();
    let fade = length / 4;
    let mut faded = vec![0.0; LAGS - 1 + length];
    for (index, sample) in samples.iter().enumerate() {
        let edge = (index + 1).min(length - index);
        let gain = if edge <= fade {
            let x = edge as f64 / (fade + 1) as f64;
            x * x * (3.0 - 2.0 * x)
        } else {
            1.0
        };
        faded[LAGS - 1 + index] = gain * f64::from(*sample);
    }
    let mut sums = [0.0; LAGS];
    for window in faded.windows(LAGS) {
        let last = window[LAGS - 1];
        for (sum, number) in sums.iter_mut().zip(window) {
            *sum += last * number;
        }
    }
    sums.reverse();
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_predict_polynomials() {
        for order in 0..5u32 {
            let samples: Vec<i32> = (0..100i32)
                .map(
                    |i| if order == 0 { [0, 1, -1][i as usize % 3] } else { (i - 50).pow(order - 1) * 3 + i },
                )
                .collect();
            let (found, residual) = fixed(&samples);
            assert_eq!(residual.len(), 100 - found);
            if order > 1 {
                assert!(residual.iter().all(|r| r.abs() <= 500), "{order} {found} {residual:?}");
            }
        }
        assert_eq!(fixed(&[5]), (0, vec![5]));
    }

    #[test]
    fn a_resonance_is_predicted_by_its_own_recursion() {
        // A decaying sine obeys x(n) = 2 r cos(w) x(n−1) − r² x(n−2) up to rounding.
        let (r, w) = (0.9999f64, 0.1f64);
        let samples: Vec<i32> =
            (0..4096).map(|n| (8e6 * r.powi(n) * (w * f64::from(n)).sin()) as i32).collect();
        let predictor = Predictor::of(&samples, 24).unwrap();
        let residual = predictor.residual(&samples).unwrap();
        let power = |x: &[i32]| x.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / x.len() as f64;
        assert!(power(&residual).sqrt() < 3e-3 * power(&samples).sqrt());
    }
}
