//! Numbers that are too small to be heard and large enough to cost time.
//!
//! A subnormal number takes some processors a hundred times as long as another. So nothing that small goes into
//! kernels and sums: what is below −300 dB is taken to be 0 where recordings and signals come in, where gains are made and
//! where what was read goes to lanes. Products of what is left are normal numbers.

use std::sync::Arc;

/// What is smaller is 0: −300 dB, where no format in whole numbers reaches.
pub(crate) const TINY: f32 = 1e-15;

/// A sample or gain, or 0 where it is too small.
#[inline(always)]
pub(crate) fn flushed(sample: f32) -> f32 {
    if sample.abs() < TINY { 0.0 } else { sample }
}

/// Samples without any that are too small.
pub(crate) fn flush(samples: &mut [f32]) {
    samples.iter_mut().for_each(|sample| *sample = flushed(*sample));
}

/// The same samples, where none of them is too small.
pub(crate) fn without(samples: Arc<[f32]>) -> Arc<[f32]> {
    let is_tiny = |sample: &f32| *sample != 0.0 && sample.abs() < TINY;
    if samples.iter().any(is_tiny) {
        samples.iter().map(|sample| flushed(*sample)).collect()
    } else {
        samples
    }
}
