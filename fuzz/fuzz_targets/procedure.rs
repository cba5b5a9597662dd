//! Scripts of sounds and of swarms: what they make is finite, or there is an error.
#![no_main]

use froufrou::random::Random;
use froufrou::synth::instrument::{Instrument, Ramp, Stretch, Strike, stretch_samples};
use froufrou::synth::procedure::{Flight, Procedure};
use froufrou_fuzz::{target, with_file};

const RATE_HZ: f64 = 8_000.0;

fn sound(procedure: &Procedure) {
    let Ok(mut voice) = procedure.generator(RATE_HZ, Random::new(1, 2)) else { return };
    let mut out = vec![0.0; stretch_samples(RATE_HZ)];
    let strikes = [Strike { time_s: 0.0, impulse_ns: 2.0, place: 1.0, contact_s: 0.001 }];
    for number in 0..4_u64 {
        // From the default to where a score may take it.
        let controls: Vec<Ramp> = procedure
            .controls()
            .iter()
            .map(|control| Ramp { from: control.default, to: control.default * number as f64 })
            .collect();
        let strikes = if number == 0 { &strikes[..] } else { &[] };
        let first = number * out.len() as u64;
        let stretch = Stretch { first, rate_hz: RATE_HZ, controls: &controls, strikes, grains: &[] };
        if voice.generate(&stretch, &mut out).is_err() {
            return;
        }
        assert!(out.iter().all(|sample| sample.is_finite()), "{out:?}");
    }
}

target!(|bytes| {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if let Ok(procedure) = Procedure::new("sound.rhai", text, &[]) {
        sound(&procedure);
    }
    if !text.contains("place") {
        return;
    }
    with_file(bytes, "rhai", |path| {
        let Ok(flight) = Flight::open(path, Random::new(1, 2)) else { return };
        for (member, time_s) in [(0, 0.0), (1, 0.25), (9_999, 1e6), (0, 0.0)] {
            let Ok(place) = flight.position_m(member, time_s) else { continue };
            assert!(place.iter().all(|number| number.is_finite()), "{place:?}");
            assert_eq!(flight.position_m(member, time_s).expect("what was a place before"), place);
        }
    });
});
