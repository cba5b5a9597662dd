use super::*;
use crate::synth::instrument::{Ramp, stretch_samples};
use proptest::prelude::*;

fn given(values: &[(&str, f64)]) -> Vec<(String, f64)> {
    values.iter().map(|&(name, value)| (name.to_owned(), value)).collect()
}

/// The sound for some seconds, with the controls as functions of time.
fn sound(
    parameters: &[(&str, f64)],
    rate_hz: f64,
    length_s: f64,
    controls: [&dyn Fn(f64) -> f64; 2],
    strikes: &[Strike],
) -> Vec<f32> {
    let sheet = Membrane::new(&given(parameters)).unwrap();
    let mut generator = sheet.generator(rate_hz, Random::new(3, 1)).unwrap();
    let count = stretch_samples(rate_hz);
    let mut all = Vec::new();
    for first in (0..(length_s * rate_hz) as u64).step_by(count) {
        let [from_s, to_s] = [first, first + count as u64].map(|frame| frame as f64 / rate_hz);
        let ramps = controls.map(|control| Ramp { from: control(from_s), to: control(to_s) });
        let strikes: Vec<Strike> =
            strikes.iter().filter(|s| (from_s..to_s).contains(&s.time_s)).copied().collect();
        let stretch = Stretch { first, rate_hz, controls: &ramps, strikes: &strikes, grains: &[] };
        let mut out = vec![0.0; count];
        generator.generate(&stretch, &mut out).unwrap();
        all.extend(out);
    }
    all
}

fn rms(samples: &[f32]) -> f64 {
    (samples.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / samples.len() as f64).sqrt()
}

/// A sheet of 0.8 by 0.5 m and 0.2 kg/m² under 90 N/m, struck after 1 ms: the sum of its damped sines.
#[test]
fn a_blow_rings_as_the_closed_form_says() {
    let (a, b, density, damping, tension) = (0.8, 0.5, 0.2, 0.02, 90.0);
    let parameters =
        [("width", a), ("height", b), ("density", density), ("damping", damping), ("modes", 9.0)];
    let strike = Strike { time_s: 0.00103, impulse_ns: 0.01, place: 0.3, contact_s: 0.0 };
    for rate_hz in [44_100.0, 96_000.0] {
        let made = sound(&parameters, rate_hz, 0.3, [&|_| tension, &|_| 0.0], &[strike]);
        let mut frequencies = Vec::new();
        for m in [1.0, 3.0, 5.0, 7.0, 9.0, 11.0] {
            for n in [1.0, 3.0, 5.0, 7.0, 9.0f64] {
                let f: f64 = 0.5 * (tension / density * ((m / a).powi(2) + (n / b).powi(2)) as f64).sqrt();
                frequencies.push((f, m, n));
            }
        }
        frequencies.sort_by(|x, y| x.0.total_cmp(&y.0));
        frequencies.truncate(9);
        let wanted = |frame: usize| {
            let age_s = frame as f64 / rate_hz - strike.time_s;
            if age_s < 0.0 {
                return 0.0;
            }
            let of = |&(f, m, n): &(f64, f64, f64)| {
                let shape = (m * PI * strike.place).sin() * (n * PI * strike.place).sin();
                let velocity = strike.impulse_ns * shape / (density * a * b / 4.0);
                let volume = 4.0 * a * b / (PI * PI * m * n);
                let decay = damping * TAU * f + SLACK_PER_S;
                -1.2 / TAU * volume * velocity * TAU * f * (TAU * f * age_s).sin() * (-decay * age_s).exp()
            };
            frequencies.iter().map(of).sum::<f64>()
        };
        let loudest = (0..made.len()).map(|n| wanted(n).abs()).fold(0.0, f64::max);
        let off = made.iter().enumerate().map(|(n, v)| (f64::from(*v) - wanted(n)).abs()).fold(0.0, f64::max);
        assert!(loudest > 0.1 && off < 1e-6 * loudest, "{rate_hz} Hz: {off} of {loudest}");
    }
}

/// The mean square that the formula of the module says, summed over the modes.
#[test]
fn air_stirs_it_as_loud_as_the_model_says() {
    let (a, b, density, damping) = (1.2, 0.7, 0.1, 0.1);
    let parameters = [("width", a), ("height", b), ("density", density), ("damping", damping)];
    for (tension, speed) in [(200.0, 8.0), (800.0, 8.0), (200.0, 16.0)] {
        let mut modes = Vec::new();
        for m in (1..60).step_by(2).map(f64::from) {
            for n in (1..60).step_by(2).map(f64::from) {
                let f: f64 = 0.5 * (tension / density * ((m / a).powi(2) + (n / b).powi(2)) as f64).sqrt();
                modes.push((f, m * n));
            }
        }
        modes.sort_by(|x, y| x.0.total_cmp(&y.0));
        let area: f64 = a * b;
        let middle = 0.2 * speed / area.sqrt();
        let of = |&(f, mn): &(f64, f64)| {
            let pressure = 0.1 * 0.5 * 1.2 * speed * speed;
            let spectrum = pressure * pressure * 2.0 / (PI * middle * (1.0 + (f / middle).powi(2)));
            let force = spectrum * 0.01 * area * area / 4.0;
            let (decay, mass) = (damping * TAU * f + SLACK_PER_S, density * area / 4.0);
            let velocity = force / (8.0 * decay * mass * mass);
            (1.2 / TAU * 4.0 * area / (PI * PI * mn) * TAU * f).powi(2) * velocity
        };
        let wanted = modes[..24].iter().map(of).sum::<f64>().sqrt();
        for rate_hz in [24_000.0, 48_000.0] {
            let made = sound(&parameters, rate_hz, 20.0, [&|_| tension, &|_| speed], &[]);
            let off_db = 20.0 * (rms(&made[made.len() / 10..]) / wanted).log10();
            assert!(off_db.abs() < 0.5, "{tension} N/m, {speed} m/s, {rate_hz} Hz: {off_db} dB");
        }
    }
}

#[test]
fn still_air_is_silent_and_what_goes_slack_falls_silent() {
    let still = sound(&[], 48_000.0, 0.5, [&|_| 300.0, &|_| 0.0], &[]);
    assert!(still.iter().all(|v| *v == 0.0));
    let slackens = |time_s: f64| if time_s < 0.5 { 300.0 } else { 0.0 };
    let strike = Strike { time_s: 0.45, impulse_ns: 0.1, place: 0.5, contact_s: 0.0 };
    let made = sound(&[("damping", 0.001)], 48_000.0, 1.0, [&slackens, &|_| 0.0], &[strike]);
    assert!(rms(&made[22_000..24_000]) > 0.1);
    assert!(rms(&made[43_000..]) < 1e-4 * rms(&made[22_000..24_000]));
}

/// A tension that rises as one over time makes the pitch glide: between two still ones no frequency is left out, and no
/// sample leaps further than the loudest sine of the highest frequency does.
#[test]
fn a_pitch_glides_with_the_tension() {
    let rises = |time_s: f64| (100.0 + 1500.0 * time_s).min(400.0);
    let parameters = [("modes", 1.0), ("damping", 0.002)];
    let strike = Strike { time_s: 0.0, impulse_ns: 0.1, place: 0.5, contact_s: 0.0 };
    let rate_hz = 48_000.0;
    let made = sound(&parameters, rate_hz, 0.2, [&rises, &|_| 0.0], &[strike]);
    let frequency = |tension: f64| 0.5 * (2.0 * tension / 0.15).sqrt();
    let periods: Vec<f64> = made
        .windows(2)
        .enumerate()
        .filter(|(_, pair)| pair[0] < 0.0 && pair[1] >= 0.0)
        .map(|(n, pair)| n as f64 + f64::from(pair[0] / (pair[0] - pair[1])))
        .collect();
    assert!(periods.len() > 5);
    for pair in periods.windows(2) {
        let (period_s, middle_s) = ((pair[1] - pair[0]) / rate_hz, (pair[0] + pair[1]) / 2.0 / rate_hz);
        let wanted_hz = frequency(rises(middle_s));
        assert!(
            (1.0 / period_s / wanted_hz - 1.0).abs() < 0.02,
            "{middle_s}: {} {wanted_hz}",
            1.0 / period_s
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]
    #[test]
    fn whatever_it_is_told_it_stays_finite(
        tensions in prop::collection::vec(prop_oneof![0.0..1e4f64, Just(f64::NAN), Just(f64::INFINITY), Just(-5.0)], 4),
        speeds in prop::collection::vec(prop_oneof![0.0..100.0f64, Just(f64::NAN), Just(1e300)], 4),
        impulse_ns in prop_oneof![-1.0..1.0f64, Just(1e300), Just(f64::NAN)],
        rate_hz in prop_oneof![Just(8_000.0), Just(48_000.0), Just(192_000.0)],
    ) {
        let at = |values: &[f64], time_s: f64| values[((time_s / 0.01) as usize).min(3)];
        let strike = Strike { time_s: 0.011, impulse_ns, place: 0.2, contact_s: 0.001 };
        let made = sound(&[], rate_hz, 0.05, [&|t| at(&tensions, t), &|t| at(&speeds, t)], &[strike]);
        prop_assert!(made.iter().all(|v| v.is_finite()));
    }
}
