//! The modal bank against the sum of its damped sines, and the closed forms of strings and bars.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use froufrou::random::Random;
use froufrou::synth::instrument::{Instrument, Stretch, Strike, stretch_samples};
use froufrou::synth::modal::bank::{Bank, Rotations};
use froufrou::synth::modal::bar::Ends;
use froufrou::synth::modal::{Mode, Modes, Shape, bar, contact_spectrum, string};
use proptest::prelude::*;

fn render(modes: &Modes, rate_hz: f64, seconds: f64, strikes: &[Strike]) -> Vec<f32> {
    let mut generator = modes.generator(rate_hz, Random::new(0, 0)).unwrap();
    let count = stretch_samples(rate_hz);
    let mut out = vec![f32::NAN; (seconds * rate_hz) as usize / count * count];
    let mut next = 0;
    for (index, out) in out.chunks_mut(count).enumerate() {
        let first = (index * count) as u64;
        let end_s = (first + count as u64) as f64 / rate_hz;
        let end = next + strikes[next..].iter().take_while(|strike| strike.time_s < end_s).count();
        let stretch = Stretch { first, rate_hz, controls: &[], strikes: &strikes[next..end], grains: &[] };
        generator.generate(&stretch, out).unwrap();
        next = end;
    }
    out
}

/// The sum of the damped sines, as it is defined.
fn sines(modes: &[Mode], rate_hz: f64, count: usize, strikes: &[Strike]) -> Vec<f64> {
    let mut sum = vec![0.0; count];
    for strike in strikes {
        for mode in modes.iter().filter(|mode| mode.frequency_hz < rate_hz / 2.0) {
            let x = 2.0 * mode.frequency_hz * strike.contact_s;
            let soft = if x == 0.0 { 1.0 } else { ((PI * x / 2.0).cos() / (1.0 - x * x)).abs() };
            let amplitude = strike.impulse_ns * mode.gain * mode.shape.at(strike.place) * soft;
            for (n, sum) in sum.iter_mut().enumerate() {
                let age_s = n as f64 / rate_hz - strike.time_s;
                if age_s >= 0.0 {
                    *sum += amplitude
                        * (TAU * mode.frequency_hz * age_s).sin()
                        * (-mode.decay_per_s * age_s).exp();
                }
            }
        }
    }
    sum
}

/// The greatest error in decibels, relative to the greatest of what was expected.
fn error_db(out: &[f32], expected: &[f64]) -> f64 {
    let peak = expected.iter().fold(0.0f64, |a, b| a.max(b.abs()));
    let error = out.iter().zip(expected).fold(0.0f64, |a, (&x, y)| a.max((f64::from(x) - y).abs()));
    20.0 * (error / peak).max(1e-30).log10()
}

fn strike(time_s: f64) -> Strike {
    Strike { time_s, impulse_ns: 1.0, place: 0.0, contact_s: 0.0 }
}

fn mode(frequency_hz: f64, decay_per_s: f64) -> Mode {
    Mode { frequency_hz, decay_per_s, gain: 1.0, shape: Shape::Everywhere }
}

#[test]
fn every_mode_is_its_damped_sine_for_seconds() {
    let mut worst = f64::NEG_INFINITY;
    for rate_hz in [8_000.0, 11_025.0, 44_100.0, 48_000.0, 192_000.0] {
        for part in [0.0, 0.2, 0.5, 0.8, 0.99, 1.0] {
            let frequency_hz = 20.0 * (rate_hz * 0.4999 / 20.0f64).powf(part);
            for decay in [0.01, 3.0, 800.0] {
                let strikes = [strike(0.000_123_4)];
                let modes = Modes::new(vec![mode(frequency_hz, decay)]).unwrap();
                let seconds = if rate_hz > 100_000.0 { 1.0 } else { 6.0 };
                let out = render(&modes, rate_hz, seconds, &strikes);
                let error = error_db(&out, &sines(modes.modes(), rate_hz, out.len(), &strikes));
                assert!(error < -120.0, "{rate_hz} Hz, {frequency_hz} Hz, {decay}/s: {error} dB");
                worst = worst.max(error);
            }
        }
    }
    println!("one mode against its damped sine: {worst:.1} dB");
}

#[test]
fn many_modes_struck_often_are_the_sum_of_their_sines() {
    let random = Random::new(5, 5);
    let modes: Vec<Mode> = (0..500u64)
        .map(|n| Mode {
            frequency_hz: 20.0 * 1500.0f64.powf(random.uniform(4 * n)),
            decay_per_s: 0.2 * 3000.0f64.powf(random.uniform(4 * n + 1)),
            gain: random.uniform(4 * n + 2) - 0.5,
            shape: Shape::Points((0..4).map(|k| random.uniform(9000 + 4 * n + k) - 0.3).collect()),
        })
        .collect();
    let modes = Modes::new(modes).unwrap();
    // Some in one stretch, some between two samples, two at once, one late when fast modes rest.
    let times = [0.0, 0.000_01, 0.001, 0.001, 0.001_37, 0.0123, 0.099_999, 1.3, 1.300_005];
    let strikes: Vec<Strike> = times
        .iter()
        .enumerate()
        .map(|(n, &time_s)| Strike {
            time_s,
            impulse_ns: [1.0, -0.3, 0.01][n % 3],
            place: n as f64 * 0.45 - 0.3,
            contact_s: [0.0, 0.0007, 0.002][n % 3],
        })
        .collect();
    for rate_hz in [8_000.0, 44_100.0] {
        let out = render(&modes, rate_hz, 2.0, &strikes);
        let error = error_db(&out, &sines(modes.modes(), rate_hz, out.len(), &strikes));
        println!("500 modes, 9 strikes at {rate_hz} Hz: {error:.1} dB");
        assert!(error < -110.0, "{rate_hz} Hz: {error} dB");
    }
}

#[test]
fn what_has_died_away_rests_and_can_be_struck_again() {
    let modes =
        Modes::new((1..80).map(|n| mode(100.0 * f64::from(n), 100.0 * f64::from(n))).collect()).unwrap();
    assert!((modes.ring_s().unwrap() - 1e6f64.ln() / 100.0).abs() < 1e-12);
    let strikes = [strike(0.01), Strike { impulse_ns: 1e-6, ..strike(0.5) }];
    let out = render(&modes, 48_000.0, 1.0, &strikes);
    // −160 dB after twenty natural lifetimes of the slowest.
    assert!(out[..480].iter().chain(&out[11_000..24_000]).chain(&out[36_000..]).all(|&x| x == 0.0));
    let expected = sines(modes.modes(), 48_000.0, out.len(), &strikes);
    assert!(error_db(&out, &expected) < -110.0);
    // The soft strike is as exact as the loud one.
    assert!(error_db(&out[24_000..], &expected[24_000..]) < -110.0);
}

#[test]
fn modes_from_nyquist_on_are_left_out() {
    let modes = Modes::new(vec![mode(24_000.0, 1.0), mode(30_000.0, 1.0), mode(1e12, 1.0)]).unwrap();
    assert!(render(&modes, 48_000.0, 0.1, &[strike(0.0)]).iter().all(|&x| x == 0.0));
    assert!(render(&modes, 192_000.0, 0.1, &[strike(0.0)]).iter().any(|&x| x != 0.0));
}

#[test]
fn ringing_ends_120_db_below_the_loudest() {
    let loud = Mode { gain: 10.0, ..mode(300.0, 40.0) };
    let soft = Mode { gain: 0.01, shape: Shape::Points(vec![0.5, -1.0]), ..mode(500.0, 3.0) };
    let modes = Modes::new(vec![loud, soft]).unwrap();
    let ring_s = modes.ring_s().unwrap();
    assert!((0.01 * (-3.0 * ring_s).exp() / 10e-6 - 1.0).abs() < 1e-9);
}

#[test]
fn a_soft_contact_is_half_a_sine_of_force() {
    // The force itself, in thousands of small impulses, upon a mode that hardly dies away.
    for part in [0.1, 0.5, 0.77, 1.2, 1.5, 1.9, 2.7] {
        let (frequency_hz, contact_s) = (part * 1000.0, 0.001);
        let (mut re, mut im) = (0.0, 0.0);
        let steps = 20_000;
        for n in 0..steps {
            let x = (f64::from(n) + 0.5) / f64::from(steps);
            let force = (PI * x).sin() * PI / 2.0 / f64::from(steps);
            let (sin, cos) = (TAU * frequency_hz * contact_s * x).sin_cos();
            re += force * cos;
            im += force * sin;
        }
        let expected = re.hypot(im);
        assert!((contact_spectrum(frequency_hz, contact_s) - expected).abs() < 1e-7, "{part}");
    }
    assert_eq!(contact_spectrum(1000.0, 0.0), 1.0);
    assert!((contact_spectrum(500.0, 0.001) - PI / 4.0).abs() < 1e-12);
    for x in [0.5 - 2e-4, 0.5 - 3e-5, 0.5 + 3e-5, 0.5 + 2e-4] {
        assert!((contact_spectrum(x, 1.0) - (PI * x).cos() / (1.0 - 4.0 * x * x)).abs() < 1e-8, "{x}");
    }
    assert_eq!(contact_spectrum(1e300, 1e300), 0.0);
}

fn parameters(given: &[(&str, f64)]) -> Vec<(String, f64)> {
    given.iter().map(|&(name, value)| (name.to_owned(), value)).collect()
}

#[test]
fn a_plucked_string_runs_through_its_triangle() {
    for place in [0.5, 0.23, 0.9] {
        let given = parameters(&[("frequency", 100.0), ("damping", 1e-6), ("modes", 2000.0)]);
        let string = string::modes(&given).unwrap();
        let pluck = Strike { place, ..strike(0.0) };
        let out = render(&string, 400_000.0, 0.01, &[pluck]);
        for (n, &sample) in out.iter().enumerate() {
            let x = n as f64 / 400_000.0 * 200.0 % 2.0;
            let (x, sign) = if x < 1.0 { (x, 1.0) } else { (2.0 - x, -1.0) };
            let triangle = sign * if x < place { x / place } else { (1.0 - x) / (1.0 - place) };
            assert!((f64::from(sample) - triangle).abs() < 0.003, "{place} {n}: {sample} {triangle}");
        }
    }
}

#[test]
fn strings_have_the_partials_of_the_paper() {
    let string = string::modes(&parameters(&[("frequency", 110.0), ("damping", 0.002)])).unwrap();
    assert_eq!(string.modes().len(), 181);
    for (n, mode) in (1..).zip(string.modes()) {
        let n = f64::from(n);
        assert!((mode.frequency_hz - 110.0 * n).abs() < 1e-9);
        assert!((mode.decay_per_s - 0.002 * 110.0 * n).abs() < 1e-9);
        let place: f64 = 0.31;
        let weight = 2.0 * (n * PI * place).sin() / (n * n * PI * PI * place * (1.0 - place));
        assert!((mode.shape.at(place) - weight).abs() < 1e-12);
        // The ends are limits, not poles.
        assert!((mode.shape.at(0.0) - mode.shape.at(1e-7)).abs() < 1e-4);
        assert!((mode.shape.at(1.0) - mode.shape.at(1.0 - 1e-7)).abs() < 1e-4);
    }
    let struck = string::modes(&parameters(&[("pluck", 0.0), ("modes", 9.0)])).unwrap();
    assert!((struck.modes()[2].shape.at(0.2) - (0.6 * PI).sin() / 3.0).abs() < 1e-12);
    let stiff = string::modes(&parameters(&[("frequency", 50.0), ("stiffness", 0.01)])).unwrap();
    assert!((stiff.modes()[4].frequency_hz - 250.0 * 1.25f64.sqrt()).abs() < 1e-9);
    for bad in [("modes", 2.5), ("modes", 0.0), ("frequency", 0.0), ("tension", 1.0)] {
        string::modes(&parameters(&[bad])).unwrap_err();
    }
}

/// The wave numbers and shapes that `oracles/bar_modes.py` found with scipy: ends, mode, wave number,
/// then the shape at eleven places.
fn oracle() -> Vec<(Ends, usize, f64, Vec<f64>)> {
    let row = |line: &str| {
        let fields: Vec<&str> = line.split('\t').collect();
        let ends = match fields[0] {
            "free" => Ends::Free,
            "clamped" => Ends::Clamped,
            other => panic!("{other}"),
        };
        let numbers: Vec<f64> = fields[2..].iter().map(|field| field.parse().unwrap()).collect();
        (ends, fields[1].parse().unwrap(), numbers[0], numbers[1..].to_vec())
    };
    include_str!("fixtures/bar_modes.tsv").lines().filter(|line| !line.starts_with('#')).map(row).collect()
}

#[test]
fn bars_have_the_modes_of_the_beam_equation() {
    let rows = oracle();
    assert!(rows.len() > 20);
    for (ends, n, wave_number, shape) in rows {
        let k = ends.wave_number(n);
        assert!((k - wave_number).abs() < 1e-11 * wave_number, "{ends:?} {n}: {k} {wave_number}");
        for (step, value) in shape.into_iter().enumerate() {
            let found = ends.shape(k, step as f64 / 10.0);
            assert!((found - value).abs() < 1e-9, "{ends:?} {n} at {step}: {found} {value}");
        }
    }
    // The conditions at the ends, far beyond where hyperbolic functions overflow.
    for n in [1, 2, 7, 100, 5000] {
        let k = Ends::Free.wave_number(n);
        assert!((Ends::Free.shape(k, 0.0) - 1.0).abs() < 1e-9);
        assert!((Ends::Free.shape(k, 1.0).abs() - 1.0).abs() < 1e-9);
        let k = Ends::Clamped.wave_number(n);
        assert!(Ends::Clamped.shape(k, 0.0).abs() < 1e-9);
        assert!((Ends::Clamped.shape(k, 1.0).abs() - 1.0).abs() < 1e-9);
        let x = 0.37;
        assert!(
            (Ends::Supported.shape(Ends::Supported.wave_number(n), x) - (n as f64 * PI * x).sin()).abs()
                < 1e-9
        );
    }
    let ratios: Vec<f64> =
        bar::modes(Ends::Free, &[]).unwrap().modes().iter().map(|mode| mode.frequency_hz / 440.0).collect();
    assert_eq!(ratios.len(), 9);
    assert!(
        (ratios[1] - 2.756_538_507).abs() < 1e-6 && (ratios[2] - 5.403_917_632).abs() < 1e-6,
        "{ratios:?}"
    );
    let paper = bar::modes(Ends::Supported, &parameters(&[("modes", 4.0)])).unwrap();
    assert!(
        paper
            .modes()
            .iter()
            .zip([1.0, 4.0, 9.0, 16.0])
            .all(|(m, r)| (m.frequency_hz - 440.0 * r).abs() < 1e-9)
    );
}

#[test]
fn a_strike_at_the_best_place_peaks_near_one() {
    let peak = |modes: &Modes, place: f64| {
        let out = render(modes, 48_000.0, 0.1, &[Strike { place, ..strike(0.0) }]);
        out.iter().fold(0.0f32, |a, b| a.max(b.abs()))
    };
    let struck = parameters(&[("pluck", 0.0)]);
    for (name, modes, place) in [
        ("plucked string", string::modes(&[]).unwrap(), 0.5),
        ("struck string", string::modes(&struck).unwrap(), 0.5),
        ("supported bar", bar::modes(Ends::Supported, &[]).unwrap(), 0.5),
        ("free bar", bar::modes(Ends::Free, &[]).unwrap(), 0.0),
        ("clamped bar", bar::modes(Ends::Clamped, &[]).unwrap(), 1.0),
    ] {
        let peak = peak(&modes, place);
        println!("{name}: peak {peak:.2}");
        assert!((0.8..3.0).contains(&peak), "{name}: {peak}");
    }
}

#[test]
fn bad_modes_are_refused_by_number() {
    let good = || mode(440.0, 1.0);
    for bad in [
        mode(0.0, 1.0),
        mode(-1.0, 1.0),
        mode(f64::NAN, 1.0),
        mode(f64::INFINITY, 1.0),
        mode(440.0, 0.0),
        mode(440.0, f64::NAN),
        Mode { gain: f64::NAN, ..good() },
        Mode { shape: Shape::Points(vec![1.0, f64::INFINITY]), ..good() },
    ] {
        let error = Modes::new(vec![good(), bad.clone()]).unwrap_err().to_string();
        assert!(error.starts_with("mode 2: "), "{bad:?}: {error}");
    }
    assert!(Modes::new(Vec::new()).is_err());
    assert!(Modes::new(vec![good(); 100_001]).is_err());
}

/// How much of a bank's work the strikes are must not change what it makes: one voice made alone and
/// one made after others of its instrument are the same.
#[test]
fn generators_share_nothing_that_can_be_heard() {
    let modes = string::modes(&[]).unwrap();
    let alone = render(&modes, 48_000.0, 0.2, &[strike(0.001)]);
    render(&modes, 44_100.0, 0.1, &[Strike { place: 0.3, ..strike(0.0) }]);
    assert_eq!(render(&modes, 48_000.0, 0.2, &[strike(0.001)]), alone);
    let shared: Arc<[Mode]> = modes.modes().into();
    Bank::new(shared.clone(), Arc::new(Rotations::new(&shared, 48_000.0)));
}

fn any_size() -> impl Strategy<Value = f64> {
    prop_oneof![
        Just(0.0),
        Just(f64::MAX),
        Just(f64::MIN_POSITIVE),
        Just(f64::NAN),
        Just(f64::INFINITY),
        (-300i32..300).prop_map(|e| 10f64.powi(e)),
        -2.0..2.0f64,
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn a_bank_is_finite_whatever_strikes_it(
        rate_hz in prop::sample::select(vec![8_000.0, 11_025.0, 48_000.0, 192_000.0]),
        modes in prop::collection::vec((1e-3..1e6f64, 1e-3..1e9f64, any_size()), 1..70),
        strikes in prop::collection::vec((0.0..0.05f64, any_size(), any_size(), any_size()), 0..20),
    ) {
        let modes = modes
            .into_iter()
            .map(|(frequency_hz, decay_per_s, gain)| Mode {
                gain: if gain.is_finite() { gain } else { 1.0 },
                shape: Shape::Points(vec![1.0, -1.0, 0.5]),
                ..mode(frequency_hz, decay_per_s)
            })
            .collect();
        let mut strikes: Vec<Strike> = strikes
            .into_iter()
            .map(|(time_s, impulse_ns, place, contact_s)| Strike { time_s, impulse_ns, place, contact_s })
            .collect();
        strikes.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        let modes = Modes::new(modes).unwrap();
        prop_assert!(modes.ring_s().unwrap().is_finite());
        prop_assert!(render(&modes, rate_hz, 0.06, &strikes).iter().all(|x| x.is_finite()));
    }

    #[test]
    fn strings_and_bars_are_finite_with_all_parameters(
        frequency in 1.0..20_000.0f64, damping in 1e-6..1.0f64, stiffness in 0.0..1.0f64,
        pluck in 0.0..1.0f64, count in 1u32..400, place in any_size(),
    ) {
        let given = |more: &[(&str, f64)]| {
            let all = [("frequency", frequency), ("damping", damping), ("modes", f64::from(count))];
            parameters(&[&all[..], more].concat())
        };
        let string = string::modes(&given(&[("stiffness", stiffness), ("pluck", pluck)])).unwrap();
        let bars = [Ends::Supported, Ends::Free, Ends::Clamped].map(|ends| bar::modes(ends, &given(&[])).unwrap());
        for modes in bars.iter().chain([&string]) {
            let out = render(modes, 22_050.0, 0.02, &[Strike { place, ..strike(0.001) }]);
            prop_assert!(out.iter().all(|x| x.is_finite() && x.abs() < 20.0));
        }
    }
}
