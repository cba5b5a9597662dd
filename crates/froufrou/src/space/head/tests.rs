//! Heads against the sets in `$FROUFROU_DATA/hrtf` (else `../shared/data/hrtf` beside the repository), which
//! are not in the repository and are skipped aloud where they are missing. What needs no file, or small ones
//! of our own, is in `tests/head.rs`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use realfft::num_complex::Complex;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};

use super::grid::{Grid, Vector, cross, dot};
use super::*;
use crate::random::Random;

pub(super) const SETS: [&str; 2] = ["MIT_KEMAR_normal_pinna.sofa", "FHK_HRIR_L2354.sofa"];

pub(super) fn set(name: &str) -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let data = std::env::var_os("FROUFROU_DATA").map_or_else(beside, PathBuf::from);
    let path = data.join("hrtf").join(name);
    if !path.exists() {
        eprintln!("skipped: there is no {} (set FROUFROU_DATA to the folder of test data)", path.display());
        return None;
    }
    Some(path)
}

const SIZE: usize = 2048;

/// The spectrum of a response, later by so many samples.
pub(super) fn spectrum(response: impl IntoIterator<Item = f64>, delay: f64) -> Vec<Complex<f64>> {
    thread_local! {
        static FORWARD: Arc<dyn RealToComplex<f64>> = RealFftPlanner::new().plan_fft_forward(SIZE);
    }
    let forward = FORWARD.with(Arc::clone);
    let mut time = forward.make_input_vec();
    time.iter_mut().zip(response).for_each(|(time, x)| *time = x);
    let mut spectrum = forward.make_output_vec();
    forward.process(&mut time, &mut spectrum).expect("sizes agree");
    for (k, value) in spectrum.iter_mut().enumerate() {
        *value *= Complex::from_polar(1.0, -std::f64::consts::TAU * k as f64 / SIZE as f64 * delay);
    }
    spectrum
}

fn heard(head: &Head, from_m: Vector) -> ([Vec<f32>; 2], [EarArrival; 2]) {
    let mut taps = [vec![0.0; head.taps()], vec![0.0; head.taps()]];
    let [left, right] = &mut taps;
    let arrivals = head.hear(from_m, [left, right]);
    (taps, arrivals)
}

/// The spectra of both ears at the head's rate, with their delays, later by a millisecond.
pub(super) fn spectra(head: &Head, from_m: Vector) -> [Vec<Complex<f64>>; 2] {
    let (taps, arrivals) = heard(head, from_m);
    [0, 1].map(|ear| {
        let delay = (arrivals[ear].delay_s + 0.001) * head.rate_hz() - head.lead() as f64;
        let gain = arrivals[ear].gain;
        spectrum(taps[ear].iter().map(|tap| gain * f64::from(*tap)), delay)
    })
}

/// The interaural time difference in seconds, left later than right: the top of the correlation of both ears'
/// responses below 3 kHz, to a sixteenth of a sample and by a parabola beyond.
fn difference_s(ears: &[Vec<Complex<f64>>; 2], rate_hz: f64) -> f64 {
    const FINER: usize = 16;
    thread_local! {
        static INVERSE: Arc<dyn ComplexToReal<f64>> = RealFftPlanner::new().plan_fft_inverse(SIZE * FINER);
    }
    let inverse = INVERSE.with(Arc::clone);
    let mut product = inverse.make_input_vec();
    for k in 1..SIZE / 2 {
        let frequency_hz = k as f64 * rate_hz / SIZE as f64;
        product[k] = ears[0][k] * ears[1][k].conj() / (1.0 + (frequency_hz / 3000.0).powi(8));
    }
    let mut time = inverse.make_output_vec();
    inverse.process(&mut product, &mut time).expect("sizes agree");
    let most = (0.0011 * rate_hz * FINER as f64) as i64;
    let at = |lag: i64| time[lag.rem_euclid((SIZE * FINER) as i64) as usize];
    let best = (-most..=most).max_by(|a, b| at(*a).total_cmp(&at(*b))).expect("lags");
    let (before, here, behind) = (at(best - 1), at(best), at(best + 1));
    (best as f64 + 0.5 * (before - behind) / (before - 2.0 * here + behind)) / FINER as f64 / rate_hz
}

/// Levels in decibels: of all up to 18 kHz, and of thirds of an octave from 200 Hz to 16 kHz.
fn levels_db(ear: &[Complex<f64>], rate_hz: f64) -> Vec<f64> {
    let energy = |from_hz: f64, to_hz: f64| {
        let within = |k: &usize| (from_hz..to_hz).contains(&(*k as f64 * rate_hz / SIZE as f64));
        10.0 * (0..ear.len()).filter(within).map(|k| ear[k].norm_sqr()).sum::<f64>().log10()
    };
    let mut levels = vec![energy(20.0, 18_000.0)];
    for third in -7..=12 {
        let middle_hz = 1000.0 * 2.0_f64.powf(f64::from(third) / 3.0);
        levels.push(energy(middle_hz * 2.0_f64.powf(-1.0 / 6.0), middle_hz * 2.0_f64.powf(1.0 / 6.0)));
    }
    levels
}

fn quantile(values: &mut [f64], part: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * part) as usize]
}

/// Every direction that is held out, against what the others give there.
fn hold_out(name: &str, folds: usize) {
    let Some(path) = set(name) else { return };
    let whole = Measured::open(&path).expect("a set");
    let rate_hz = whole.rate_hz();
    let (mut times_us, mut levels, mut thirds) = (Vec::new(), Vec::new(), Vec::new());
    for fold in 0..folds {
        let head = whole.only(|n| n % folds != fold).head(rate_hz);
        for n in (fold..whole.directions().len()).step_by(folds) {
            let found = spectra(&head, whole.directions()[n].map(|x| x * whole.corners.distance_m));
            let expected = [0, 1].map(|ear| spectrum(whole.response(n, ear).iter().copied(), 0.0));
            let error_s = difference_s(&found, rate_hz) - difference_s(&expected, rate_hz);
            times_us.push(1e6 * error_s.abs());
            for ear in 0..2 {
                let (found, expected) = (levels_db(&found[ear], rate_hz), levels_db(&expected[ear], rate_hz));
                levels.push((found[0] - expected[0]).abs());
                thirds.extend(found[1..].iter().zip(&expected[1..]).map(|(a, b)| (a - b).abs()));
            }
        }
    }
    let figures = |what: &str, values: &mut Vec<f64>| {
        let (median, most) = (quantile(values, 0.5), quantile(values, 0.95));
        eprintln!("{name}, 1 of {folds} held out: {what}: median {median:.3}, 95 % {most:.3}");
        median
    };
    assert!(figures("time difference in microseconds", &mut times_us) < 10.0);
    assert!(figures("level in dB", &mut levels) < 1.0);
    assert!(figures("level of a third of an octave in dB", &mut thirds) < 1.0);
}

#[test]
fn what_is_held_out_is_met() {
    for name in SETS {
        hold_out(name, 10);
        hold_out(name, 2);
    }
}

/// For each set, of the left and the right ear: the sum of all values times their sample's number from 1, and the
/// sum of their squares times their measurement's number from 1, as h5py and NumPy have them.
const SUMS: [[[f64; 2]; 2]; 2] = [
    [[-7421.8656311, 236_580.007_99], [-7421.8656311, 254_229.275_943]],
    [[78_977.646_121_5, 1_107_168.238_9], [77_563.834_372_3, 2_545_627.806_57]],
];

#[test]
fn measured_directions_give_the_file_to_the_bit() {
    for (name, sums) in SETS.iter().zip(SUMS) {
        let Some(path) = set(name) else { continue };
        let measured = Measured::open(&path).expect("a set");
        for (ear, expected) in sums.iter().enumerate() {
            let (mut first, mut second) = (0.0, 0.0);
            for n in 0..measured.directions().len() {
                for (k, x) in measured.response(n, ear).iter().enumerate() {
                    first += x * (k + 1) as f64;
                    second += x * x * (n + 1) as f64;
                }
            }
            assert!((first - expected[0]).abs() < 1e-9 * expected[0].abs(), "{name}: {first}");
            assert!((second - expected[1]).abs() < 1e-9 * expected[1].abs(), "{name}: {second}");
        }
        // Its `ReceiverPosition` has the right ear first, its responses the left.
        assert_eq!(measured.has_ears_exchanged(), name.starts_with("FHK"));
        for (n, direction) in measured.directions().iter().enumerate() {
            // Slightly off, as another way to the same direction is.
            let hrir = measured.hrir(direction.map(|x| x * 1.7 + 1e-15));
            assert_eq!(hrir[0], measured.response(n, 0));
            assert_eq!(hrir[1], measured.response(n, 1));
        }
    }
}

#[test]
fn delays_and_taps_are_the_measured_response_together() {
    for name in SETS {
        let Some(path) = set(name) else { continue };
        let measured = Measured::open(&path).expect("a set");
        let (rate_hz, head) = (measured.rate_hz(), measured.head(measured.rate_hz()));
        let mut worst = f64::NEG_INFINITY;
        let mut shift = None;
        for (n, direction) in measured.directions().iter().enumerate() {
            let found = spectra(&head, direction.map(|x| x * measured.corners.distance_m));
            for ear in 0..2 {
                let (_, arrivals) = heard(&head, direction.map(|x| x * measured.corners.distance_m));
                // One shift for the whole set: where the file's time begins.
                let own = measured.onsets[n][ear] / rate_hz - arrivals[ear].delay_s;
                let shift = *shift.get_or_insert(own);
                assert!((own - shift).abs() < 1e-12);
                let expected = spectrum(measured.response(n, ear).iter().copied(), (0.001 - shift) * rate_hz);
                let (mut error, mut energy) = (0.0, 0.0);
                for k in 0..(18_000.0 / rate_hz * SIZE as f64) as usize {
                    error += (found[ear][k] - expected[k]).norm_sqr();
                    energy += expected[k].norm_sqr();
                }
                worst = worst.max(10.0 * (error / energy).log10());
            }
        }
        eprintln!("{name}: {} taps, {} before the onset, worst {worst:.1} dB", head.taps(), head.lead());
        assert!(worst < -60.0, "{name}: {worst} dB");
    }
}

#[test]
fn level_and_timing_are_those_of_every_rate() {
    let check = |name: &str, at: &dyn Fn(f64) -> Head, top_hz: f64| {
        let heads = [44_100.0, 48_000.0, 96_000.0, 192_000.0].map(at);
        let random = Random::new(5, 5);
        let mut worst_db = 0.0_f64;
        for n in 0..40 {
            let from_m = [0, 1, 2].map(|k| random.uniform(3 * n + k) - 0.5);
            let ears: Vec<_> = heads.iter().map(|head| heard(head, from_m)).collect();
            for ear in 0..2 {
                let delays: Vec<f64> = ears.iter().map(|(_, arrivals)| arrivals[ear].delay_s).collect();
                assert!(delays.iter().all(|delay| (delay - delays[0]).abs() < 1e-9));
                let response = |index: usize, frequency_hz: f64| {
                    let (taps, head) = (&ears[index].0[ear], &heads[index]);
                    let turn = std::f64::consts::TAU * frequency_hz / head.rate_hz();
                    let part = |(k, tap): (usize, &f32)| {
                        Complex::from_polar(f64::from(*tap), -turn * (k as f64 - head.lead() as f64))
                    };
                    taps.iter().enumerate().map(part).sum::<Complex<f64>>()
                };
                let peak = (1..36).map(|k| response(0, f64::from(k) * 500.0).norm()).fold(0.0, f64::max);
                for frequency_hz in [100.0, 400.0, 1000.0, 3000.0, 5000.0, 8000.0, 12_000.0, 15_000.0, top_hz]
                {
                    let first = response(0, frequency_hz);
                    // In a notch a little is much.
                    if first.norm() < 0.03 * peak {
                        continue;
                    }
                    for index in 1..4 {
                        let other = response(index, frequency_hz) / first;
                        worst_db = worst_db.max((20.0 * other.norm().log10()).abs());
                        let late = other.arg().abs() / std::f64::consts::TAU / frequency_hz;
                        assert!(late < 0.1 / 44_100.0, "{name}, {frequency_hz} Hz: {late} s");
                    }
                }
            }
        }
        eprintln!("{name}: levels at 44.1 to 192 kHz differ by at most {worst_db:.4} dB up to {top_hz} Hz");
        assert!(worst_db < 0.1, "{name}: {worst_db} dB");
    };
    check("sphere", &Head::spherical, 18_000.0);
    for name in SETS {
        let Some(path) = set(name) else { continue };
        let measured = Measured::open(&path).expect("a set");
        check(name, &|rate_hz| measured.head(rate_hz), 18_000.0);
    }
}

/// A source that circles at an elevation: no time difference jumps, no response either.
#[test]
fn nothing_jumps_while_a_source_circles() {
    let check = |name: &str, head: &Head, tolerance: f32| {
        for elevation_deg in [-75.0_f64, -42.0, 0.0, 33.0, 88.0] {
            let mut last: Option<([Vec<f32>; 2], [EarArrival; 2])> = None;
            for step in 0..=7200 {
                let azimuth = (f64::from(step) / 20.0).to_radians();
                let (height, flat) = elevation_deg.to_radians().sin_cos();
                let now = heard(head, [-flat * azimuth.sin(), height, -flat * azimuth.cos()]);
                if let Some((taps, arrivals)) = &last {
                    for ear in 0..2 {
                        let jump = (now.1[ear].delay_s - arrivals[ear].delay_s).abs();
                        // A twentieth of a degree about a sphere takes 0.4 us; between outliers it may be more.
                        assert!(jump < 4e-6, "{name}, {elevation_deg}, {step}: {jump} s");
                        let change: f32 = (0..head.taps())
                            .map(|k| (now.0[ear][k] - taps[ear][k]).powi(2))
                            .sum::<f32>()
                            .sqrt();
                        let size = taps[ear].iter().map(|x| x * x).sum::<f32>().sqrt();
                        assert!(
                            change < tolerance * size,
                            "{name}, {elevation_deg}, {step}: {}",
                            change / size
                        );
                    }
                }
                last = Some(now);
            }
        }
    };
    check("sphere", &Head::spherical(48_000.0), 0.004);
    for name in SETS {
        let Some(path) = set(name) else { continue };
        check(name, &Head::open(&path, 48_000.0).expect("a set"), 0.06);
    }
}

/// Both ears' time difference about the horizon is that of Woodworth, within what real heads differ from it.
#[test]
fn a_measured_head_is_timed_as_a_sphere() {
    for name in SETS {
        let Some(path) = set(name) else { continue };
        let head = Head::open(&path, 48_000.0).expect("a set");
        let sphere = Head::spherical(48_000.0);
        for azimuth_deg in (0..360).step_by(5) {
            let azimuth = f64::from(azimuth_deg).to_radians();
            let from_m = [-3.0 * azimuth.sin(), 0.0, -3.0 * azimuth.cos()];
            let (found, expected) = (heard(&head, from_m).1, heard(&sphere, from_m).1);
            for ear in 0..2 {
                let error = found[ear].delay_s - expected[ear].delay_s;
                // Below 3 kHz the shadow itself delays by some 100 us, which here is in the delay.
                assert!(error.abs() < 160e-6, "{name}, {azimuth_deg} degrees, ear {ear}: {error} s");
            }
        }
    }
}

/// Random directions: in the triangle that is found they lie, and it is one of Delaunay.
#[test]
fn triangles_are_those_of_delaunay() {
    let random = Random::new(9, 1);
    let direction =
        |n: u64| coordinates::unit([0, 1, 2].map(|k| random.uniform(3 * n + k) - 0.5)).expect("a direction");
    let mut corners: Vec<Vector> = (0..600).map(direction).collect();
    corners.extend((0..6).map(|axis| {
        let mut corner = [0.0; 3];
        corner[axis / 2] = if axis % 2 == 0 { 1.0 } else { -1.0 };
        corner
    }));
    let grid = Grid::new(corners.clone()).expect("a grid");
    for n in 0..3000 {
        let towards = direction(10_000 + n);
        let (found, weights) = grid.weights(towards);
        let sum: Vector = std::array::from_fn(|k| (0..3).map(|c| weights[c] * corners[found[c]][k]).sum());
        let along = coordinates::unit(sum).expect("a direction");
        assert!((0..3).all(|k| (along[k] - towards[k]).abs() < 1e-9), "{along:?} {towards:?}");
        // No other corner lies within the circle about the three.
        let [a, b, c] = found.map(|corner| corners[corner]);
        let minus = |a: Vector, b: Vector| -> Vector { std::array::from_fn(|k| a[k] - b[k]) };
        let normal = cross(minus(b, a), minus(c, a));
        for other in &corners {
            assert!(dot(normal, minus(*other, a)) < 1e-9, "{other:?} lies above {found:?}");
        }
    }
    for (n, corner) in corners.iter().enumerate() {
        let (found, weights) = grid.weights(corner.map(|x| 3.0 * x));
        let at = (0..3).find(|k| weights[*k] == 1.0).expect("one corner alone");
        assert_eq!(found[at], n);
    }
}
