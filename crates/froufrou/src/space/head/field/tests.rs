//! What a field of order 3 gives up of a head, in figures.

use super::super::tests::{SETS, set, spectra, spectrum};
use super::*;

/// Directions that lie evenly about the head, other than those that were fitted.
fn even(count: usize) -> Vec<Vector> {
    let golden = PI * (3.0 - 5.0f64.sqrt());
    let direction = |n: usize| {
        let height = 1.0 - 2.0 * (n as f64 + 0.5) / count as f64;
        let (wide, angle) = ((1.0 - height * height).sqrt(), golden * n as f64);
        [wide * angle.sin(), height, -wide * angle.cos()]
    };
    (0..count).map(direction).collect()
}

/// The spectra of both ears by way of the field, as [`spectra`] has those of the head.
fn field_spectra(field: &FieldResponses, rate_hz: f64, towards: Vector) -> [Vec<Complex<f64>>; 2] {
    let gains = harmonics(ahead_left_up(towards));
    [0, 1].map(|ear| {
        let taps = field.responses[0][ear].len();
        let sum = (0..taps)
            .map(|n| gains.iter().zip(&field.responses).map(|(g, both)| g * f64::from(both[ear][n])).sum());
        spectrum(sum, 0.001 * rate_hz - field.lead as f64)
    })
}

/// The energy between two frequencies.
fn energy(spectrum: &[Complex<f64>], rate_hz: f64, range_hz: [f64; 2]) -> f64 {
    let bin_hz = rate_hz / (2 * (spectrum.len() - 1)) as f64;
    let inside = |k: &usize| (range_hz[0]..range_hz[1]).contains(&(*k as f64 * bin_hz));
    (0..spectrum.len()).filter(inside).map(|k| spectrum[k].norm_sqr()).sum()
}

/// By how much the left ear hears something later than the right, in microseconds: where the correlation of both
/// is greatest, between 100 Hz and 1.5 kHz.
fn later_us(both: &[Vec<Complex<f64>>; 2], rate_hz: f64) -> f64 {
    let bin_hz = rate_hz / (2 * (both[0].len() - 1)) as f64;
    let cross: Vec<(f64, Complex<f64>)> = (0..both[0].len())
        .map(|k| (k as f64 * bin_hz * 2.0 * PI, both[0][k] * both[1][k].conj()))
        .filter(|(omega, _)| (100.0 * 2.0 * PI..1500.0 * 2.0 * PI).contains(omega))
        .collect();
    let alike = |late_us: f64| -> f64 {
        cross.iter().map(|(omega, c)| (c * Complex::from_polar(1.0, omega * late_us * 1e-6)).re).sum()
    };
    let best = |from: f64, to: f64, step: f64| {
        let count = ((to - from) / step) as usize;
        let all = (0..=count).map(|n| from + n as f64 * step);
        all.max_by(|a, b| alike(*a).total_cmp(&alike(*b))).unwrap()
    };
    let coarse = best(-1000.0, 1000.0, 20.0);
    best(coarse - 20.0, coarse + 20.0, 1.0)
}

/// The median and what 95 % lie within.
fn figures(mut values: Vec<f64>) -> [f64; 2] {
    values.iter_mut().for_each(|value| *value = value.abs());
    values.sort_by(f64::total_cmp);
    [values[values.len() / 2], values[values.len() * 95 / 100]]
}

const OCTAVES_HZ: [f64; 7] = [250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0, 16_000.0];

/// Errors of level between the ears and of time below 1.5 kHz, and of the spectrum in thirds of octaves.
struct Errors {
    level_db: [[f64; 2]; 7],
    spectrum_db: [[f64; 2]; 7],
    time_us: [f64; 2],
}

fn errors(head: &Head, field: &FieldResponses) -> Errors {
    let rate_hz = head.rate_hz();
    let db = |ratio: f64| 10.0 * ratio.log10();
    let (mut level, mut thirds, mut times) = (vec![Vec::new(); 7], vec![Vec::new(); 7], Vec::new());
    for towards in even(300) {
        let asked = spectra(head, towards.map(|c| c * FAR_M));
        let found = field_spectra(field, rate_hz, towards);
        times.push(later_us(&found, rate_hz) - later_us(&asked, rate_hz));
        for (octave, centre_hz) in OCTAVES_HZ.into_iter().enumerate() {
            let level_of = |both: &[Vec<Complex<f64>>; 2]| {
                let range_hz = [centre_hz / 2f64.sqrt(), centre_hz * 2f64.sqrt()];
                db(energy(&both[0], rate_hz, range_hz) / energy(&both[1], rate_hz, range_hz))
            };
            level[octave].push(level_of(&found) - level_of(&asked));
            for third in [-1.0, 0.0, 1.0] {
                let edge = |side: f64| centre_hz * 2f64.powf((third + side) / 3.0);
                let range_hz = [edge(-0.5), edge(0.5)];
                for (found, asked) in found.iter().zip(&asked) {
                    let [found, asked] = [found, asked].map(|s| energy(s, rate_hz, range_hz));
                    thirds[octave].push(db(found / asked));
                }
            }
        }
    }
    let all = |values: Vec<Vec<f64>>| -> [[f64; 2]; 7] {
        let mut values = values.into_iter().map(figures);
        std::array::from_fn(|_| values.next().unwrap())
    };
    Errors { level_db: all(level), spectrum_db: all(thirds), time_us: figures(times) }
}

#[test]
fn what_is_given_up() {
    for name in [None, Some(SETS[0]), Some(SETS[1])] {
        let head = match name {
            None => Head::spherical(48_000.0),
            Some(name) => match set(name) {
                Some(path) => Head::open(&path, 48_000.0).unwrap(),
                None => continue,
            },
        };
        let begin = std::time::Instant::now();
        let field = head.field().unwrap();
        eprintln!("{} in {:?}", name.unwrap_or("sphere"), begin.elapsed());
        let errors = errors(&head, &field);
        let line = |what: &str, values: [[f64; 2]; 7]| {
            let text: Vec<String> = OCTAVES_HZ
                .iter()
                .zip(values)
                .map(|(hz, [median, most])| format!("{hz} Hz {median:.1} / {most:.1}"))
                .collect();
            eprintln!("  {what}, dB, median / 95 %: {}", text.join(", "));
        };
        line("level between the ears", errors.level_db);
        line("thirds of octaves", errors.spectrum_db);
        eprintln!("  time between the ears, us: {:.0} / {:.0}", errors.time_us[0], errors.time_us[1]);
        // What the module says.
        let limits: [[f64; 7]; 2] = match name {
            None => [[0.1, 0.1, 0.1, 0.3, 0.2, 0.2, 0.2], [0.2, 0.2, 0.9, 1.1, 0.4, 0.5, 0.7]],
            Some(_) => [[0.5, 0.4, 0.7, 0.7, 0.8, 1.2, 2.2], [1.5, 1.4, 2.5, 2.9, 3.2, 4.8, 7.0]],
        };
        for values in [errors.level_db, errors.spectrum_db] {
            for (octave, found) in values.into_iter().enumerate() {
                let most = [limits[0][octave] + 0.05, limits[1][octave] + 0.05];
                assert!(found[0] <= most[0] && found[1] <= most[1], "{} Hz: {found:?}", OCTAVES_HZ[octave]);
            }
        }
        let most_us = if name.is_none() { [10.0, 25.0] } else { [20.0, 55.0] };
        assert!(errors.time_us[0] < most_us[0] && errors.time_us[1] < most_us[1], "{:?}", errors.time_us);
    }
}

/// What one ear hears the other hears of the mirrored field: harmonics that change their sign from left to right
/// do so.
#[test]
fn the_ears_of_a_sphere_are_mirrored_at_every_rate() {
    for rate_hz in [8000.0, 44_100.0, 192_000.0] {
        let field = Head::spherical(rate_hz).field().unwrap();
        let (here, there) = (harmonics([0.3, 0.5, 0.2]), harmonics([0.3, -0.5, 0.2]));
        for (n, [left, right]) in field.responses.iter().enumerate() {
            assert!(left.len() > field.lead && left.len() == right.len());
            assert!(left.iter().chain(right).all(|tap| tap.is_finite() && tap.abs() < 2.0));
            let sign = if here[n] == there[n] { 1.0 } else { -1.0 };
            let most = left.iter().zip(right).map(|(l, r)| (l - sign * r).abs()).fold(0.0, f32::max);
            assert!(most < 1e-6, "{rate_hz} Hz, harmonic {n}: {most}");
        }
    }
}
