//! Tables of modes in all three layouts: what is read can be struck.
#![no_main]

use froufrou::random::Random;
use froufrou::synth::instrument::{Instrument, Stretch, Strike, stretch_samples};
use froufrou::synth::modal::table;
use froufrou_fuzz::target;

const RATE_HZ: f64 = 8_000.0;

target!(|bytes| {
    let Ok(modes) = table::read(bytes) else { return };
    assert!(!modes.modes().is_empty());
    assert!(modes.ring_s().is_some_and(|ring_s| ring_s >= 0.0 && ring_s.is_finite()));
    let Ok(mut voice) = modes.generator(RATE_HZ, Random::new(1, 2)) else { return };
    let mut out = vec![0.0; stretch_samples(RATE_HZ)];
    let strikes = [
        Strike { time_s: 0.0, impulse_ns: 1e-3, place: 0.3, contact_s: 0.0 },
        Strike { time_s: 1e-4, impulse_ns: 1e-3, place: 1.7, contact_s: 0.01 },
    ];
    for number in 0..3_u64 {
        let strikes = if number == 0 { &strikes[..] } else { &[] };
        let first = number * out.len() as u64;
        let stretch = Stretch { first, rate_hz: RATE_HZ, controls: &[], strikes, grains: &[] };
        if voice.generate(&stretch, &mut out).is_err() {
            return;
        }
        // Gains are any that are finite; no number holds their sum for sure.
        let most = modes.modes().iter().map(|mode| mode.gain.abs()).sum::<f64>();
        assert!(most > 1e30 || out.iter().all(|sample| sample.is_finite()), "{out:?}");
    }
});
