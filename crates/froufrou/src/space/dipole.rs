//! A small rigid disk that moves as a whole: a dipole, and what rigid planes near it make of it (Schreck et
//! al. 2016, "Real-time sound synthesis for paper material based on geometric analysis", §6).
//!
//! A disk with radius a and unit normal n at y is heard at x as
//!
//! ```text
//! p(x, t) ≈ a³ (cos θ / R) A(t − R/c),   R = |x − y|,   cos θ = (x − y)·n / R
//! ```
//!
//! A rigid plane adds an image of it: its place ỹ and its normal ñ are mirrored. The two sum to a comb whose
//! teeth move as the disk nears the plane. With the gains g = a³ cos θ / R, for clips and for spectra alike,
//!
//! ```text
//! P(t) = g A(t − R/c) + g̃ A(t − R̃/c),   P(ω) = (g e^{iωR/c} + g̃ e^{iωR̃/c}) A(ω)
//! ```
//!
//! Gains have signs: where g and g̃ have the same (the disk stands upright on the plane, ñ = n), notches lie at the
//! odd multiples of c / (2 (R̃ − R)); where they differ (the disk lies on the plane, ñ = −n), at all multiples of
//! c / (R̃ − R), 0 among them.

use std::f64::consts::TAU;

use realfft::num_complex::Complex;

use super::direction::ahead_left_up;
use super::directivity::{Directivity, HARMONICS};
use super::microphone::NEAR_M;
use super::sphere::{dot, minus, unit};

/// A small disk.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disk {
    /// Its middle in the world, in metres.
    pub position_m: [f64; 3],
    /// The direction in which it moves, at right angles to it; of any length. Without a length it is silent.
    pub normal: [f64; 3],
    /// Its radius in metres.
    pub radius_m: f64,
}

/// A rigid plane without an end. Both sides of it reflect, whoever is behind it: what is in the way is for others to
/// say. So a sheet may touch it, and dip into it by rounding, without a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// A point on it, in metres.
    pub point_m: [f64; 3],
    /// A vector of any length at right angles to it. Without a length it reflects nothing.
    pub normal: [f64; 3],
}

/// One way by which sound arrives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arrival {
    /// The gain a³ cos θ / R, in square metres; below 0 where the pressure has the opposite sign.
    pub gain: f64,
    /// The length of the way in metres.
    pub distance_m: f64,
    /// The time that sound takes for it, in seconds.
    pub delay_s: f64,
}

impl Disk {
    /// Its image behind a plane; none where the plane has no normal.
    pub fn mirrored(&self, plane: &Plane) -> Option<Self> {
        let normal = unit(plane.normal);
        let square = dot(normal, normal);
        (square > 0.5 && square.is_finite()).then(|| {
            let mirror = |v: [f64; 3], height: f64| minus(v, normal.map(|c| 2.0 * height * c));
            Self {
                position_m: mirror(self.position_m, dot(minus(self.position_m, plane.point_m), normal)),
                normal: mirror(self.normal, dot(self.normal, normal)),
                radius_m: self.radius_m,
            }
        })
    }

    /// How it is heard at a point on the straight way. Within [`NEAR_M`] of it the gain grows no more and fades to
    /// 0 at the disk, where its sign changes, so that it may pass through a listener.
    pub fn arrival(&self, listener_m: [f64; 3], speed_of_sound_mps: f64) -> Arrival {
        let way = minus(listener_m, self.position_m);
        let distance_m = dot(way, way).sqrt();
        let reach = distance_m.max(NEAR_M);
        let gain = self.radius_m.powi(3) * dot(way, unit(self.normal)) / (reach * reach);
        Arrival { gain, distance_m, delay_s: distance_m / speed_of_sound_mps }
    }

    /// The straight way, and then one by way of each plane. A sound reflected by two planes is not among them.
    pub fn arrivals<'a>(
        &'a self,
        planes: &'a [Plane],
        listener_m: [f64; 3],
        speed_of_sound_mps: f64,
    ) -> impl Iterator<Item = Arrival> + 'a {
        let images = planes.iter().filter_map(|plane| self.mirrored(plane));
        std::iter::once(*self).chain(images).map(move |disk| disk.arrival(listener_m, speed_of_sound_mps))
    }
}

/// The factor by which a spectrum is multiplied at a frequency: Σ gain e^{iω delay}. As in the paper, time runs as
/// e^{−iωt}; the transforms of `realfft` have e^{+iωt}, for which the factor is to be conjugated.
pub fn factor(arrivals: &[Arrival], frequency_hz: f64) -> Complex<f64> {
    let way = |way: &Arrival| Complex::from_polar(way.gain, TAU * frequency_hz * way.delay_s);
    arrivals.iter().map(way).sum()
}

/// Bins between which the phase is worked out anew, so that rounding does not add up.
const STRIDE: usize = 64;

/// The factors of the bins 0, 1, 2 … of a spectrum, which lie `bin_hz` apart. They equal [`factor`] up to rounding
/// and take a complex product a bin and way.
pub fn factors(arrivals: &[Arrival], bin_hz: f64, out: &mut [Complex<f64>]) {
    out.fill(Complex::new(0.0, 0.0));
    for way in arrivals {
        let turn = TAU * bin_hz * way.delay_s;
        let step = Complex::from_polar(1.0, turn);
        for (i, bins) in out.chunks_mut(STRIDE).enumerate() {
            let mut now = Complex::from_polar(way.gain, turn * (i * STRIDE) as f64);
            for bin in bins {
                *bin += now;
                now *= step;
            }
        }
    }
}

/// The directivity of a disk that is carried by an object: a dipole along an axis in the object's frame (ahead −Z, right
/// +X, up +Y), of any length; silent if it has none.
///
/// ```
/// use froufrou::space::{dipole::directivity, directivity::Directivity};
/// assert_eq!(directivity([0.0, 0.0, -3.0]), Directivity::DIPOLE);
/// ```
pub fn directivity(axis: [f64; 3]) -> Directivity {
    let [ahead, left, up] = ahead_left_up(unit(axis)).map(|c| c + 0.0);
    let mut coefficients = [0.0; HARMONICS];
    [coefficients[1], coefficients[2], coefficients[3]] = [left, up, ahead];
    Directivity { coefficients }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use realfft::RealFftPlanner;

    const C: f64 = 340.0;
    const RATE_HZ: f64 = 48_000.0;
    const LENGTH: usize = 1 << 14;
    const BIN_HZ: f64 = RATE_HZ / LENGTH as f64;

    const FLOOR: Plane = Plane { point_m: [0.0; 3], normal: [0.0, 1.0, 0.0] };

    /// A disk at a height over the floor, lying on it or standing upright, and a listener.
    fn cases() -> impl Iterator<Item = (Disk, [f64; 3])> {
        let heights = [0.02, 0.1, 0.35, 1.2];
        let listeners = [[0.4, 0.9, 0.0], [1.5, 1.6, -1.0], [-2.0, 0.5, 3.0], [0.3, 2.5, 0.1]];
        let normals = [[0.0, 1.0, 0.0], [0.0, -2.0, 0.0], [0.6, 0.0, 0.8], [-1.0, 0.0, 0.3]];
        heights.into_iter().flat_map(move |height| {
            listeners.into_iter().flat_map(move |listener| {
                normals.map(move |normal| {
                    (Disk { position_m: [0.1, height, -0.2], normal, radius_m: 0.05 }, listener)
                })
            })
        })
    }

    /// The magnitudes of an impulse that arrives by these ways: each a band-limited impulse with its delay, a
    /// sinc with a Kaiser window of 400 samples.
    fn rendered(arrivals: &[Arrival]) -> Vec<f64> {
        let bessel = |x: f64| {
            let term = |(sum, term): (f64, f64), k: i32| {
                let term = term * (x / (2.0 * f64::from(k))).powi(2);
                (sum + term, term)
            };
            (1..60).fold((1.0, 1.0), term).0
        };
        let (half, beta) = (200.0, 12.0);
        let mut clip = vec![0.0; LENGTH];
        for way in arrivals {
            let at = way.delay_s * RATE_HZ + 2.0 * half;
            let first = (at - half).ceil() as usize;
            for (n, sample) in clip.iter_mut().enumerate().skip(first).take(2 * half as usize) {
                let x = n as f64 - at;
                let sinc = if x.abs() < 1e-9 {
                    1.0
                } else {
                    (std::f64::consts::PI * x).sin() / (std::f64::consts::PI * x)
                };
                let window = bessel(beta * (1.0 - (x / half).powi(2)).max(0.0).sqrt()) / bessel(beta);
                *sample += way.gain * sinc * window;
            }
        }
        let fft = RealFftPlanner::<f64>::new().plan_fft_forward(LENGTH);
        let mut spectrum = fft.make_output_vec();
        fft.process(&mut clip, &mut spectrum).unwrap();
        spectrum.iter().map(|bin| bin.norm()).collect()
    }

    /// The bins that are less than both neighbours.
    fn notches(magnitudes: &[f64]) -> Vec<usize> {
        let inner = 1..magnitudes.len() - 1;
        inner.filter(|&i| magnitudes[i] < magnitudes[i - 1] && magnitudes[i] <= magnitudes[i + 1]).collect()
    }

    #[test]
    fn the_comb_over_a_plane_is_that_of_the_closed_form() {
        let mut checked = [0; 2];
        for (disk, listener) in cases() {
            let arrivals: Vec<Arrival> = disk.arrivals(&[FLOOR], listener, C).collect();
            // The closed form: the image is as far below the floor.
            let [x, y, z] = minus(listener, disk.position_m);
            let [near, far] = [y, y + 2.0 * disk.position_m[1]].map(|y| (x * x + y * y + z * z).sqrt());
            let lies = disk.normal[1] != 0.0;
            assert_eq!(arrivals[0].gain.signum() * arrivals[1].gain.signum() < 0.0, lies && y > 0.0);
            let opposite = arrivals[0].gain * arrivals[1].gain < 0.0;
            let tooth_hz = C / (far - near);

            let clip = rendered(&arrivals);
            let mut spectrum = vec![Complex::new(0.0, 0.0); LENGTH / 2 + 1];
            factors(&arrivals, BIN_HZ, &mut spectrum);
            let spectrum: Vec<f64> = spectrum.iter().map(|bin| bin.norm()).collect();
            let (top_hz, loudest) = (20_000.0, spectrum.iter().copied().fold(0.0, f64::max));
            let top = (top_hz / BIN_HZ) as usize;
            for (i, (a, b)) in clip.iter().zip(&spectrum).enumerate().take(top) {
                assert!((a - b).abs() < 1e-4 * loudest, "bin {i}: {a} {b}");
            }
            let expected: Vec<f64> = (if opposite { 1 } else { 0 }..)
                .map(|k| f64::from(k) + if opposite { 0.0 } else { 0.5 })
                .map(|k| k * tooth_hz)
                .take_while(|hz| *hz < top_hz - 2.0 * BIN_HZ)
                .collect();
            for found in [notches(&clip[..top]), notches(&spectrum[..top])] {
                assert_eq!(found.len(), expected.len(), "{disk:?} {listener:?}");
                for (found, expected) in found.iter().zip(&expected) {
                    let off = (*found as f64 * BIN_HZ - expected).abs() / BIN_HZ;
                    assert!(off <= 1.0, "{disk:?} {listener:?}: off by {off} bins");
                }
            }
            // At 0 Hz gains of opposite signs cancel as far as they are alike.
            let sum = arrivals[0].gain + arrivals[1].gain;
            assert!((spectrum[0] - sum.abs()).abs() < 1e-12 * loudest);
            checked[usize::from(opposite)] += expected.len();
        }
        assert!(checked.iter().all(|&count| count > 300), "{checked:?}");
    }

    #[test]
    fn gains_are_those_of_the_formula() {
        let disk = Disk { position_m: [1.0, 2.0, 3.0], normal: [0.0, 0.0, 5.0], radius_m: 0.1 };
        let ahead = disk.arrival([1.0, 2.0, 5.0], C);
        assert!((ahead.gain - 0.001 / 2.0).abs() < 1e-18);
        assert_eq!((ahead.distance_m, ahead.delay_s), (2.0, 2.0 / C));
        assert_eq!(disk.arrival([1.0, 2.0, 1.0], C).gain, -ahead.gain);
        assert_eq!(disk.arrival([1.0, 9.0, 3.0], C).gain, 0.0);
        let aside = disk.arrival([4.0, 2.0, 7.0], C).gain;
        assert!((aside - 0.001 * 0.8 / 5.0).abs() < 1e-18);
    }

    #[test]
    fn an_image_is_mirrored_by_any_plane() {
        let random = Random::new(2, 2);
        let vector = |i: u64| [0, 1, 2].map(|k| 2.0 * random.uniform(3 * i + k) - 1.0);
        for i in 0..50 {
            let plane = Plane { point_m: vector(4 * i), normal: vector(4 * i + 1) };
            let disk = Disk { position_m: vector(4 * i + 2), normal: vector(4 * i + 3), radius_m: 0.1 };
            let image = disk.mirrored(&plane).unwrap();
            // Points on the plane are as far from one as from the other, and hear both alike.
            let off = vector(1000 + i);
            let normal = unit(plane.normal);
            let on: [f64; 3] =
                std::array::from_fn(|k| plane.point_m[k] + off[k] - normal[k] * dot(off, normal));
            let (a, b) = (disk.arrival(on, C), image.arrival(on, C));
            assert!((a.distance_m - b.distance_m).abs() < 1e-12 && (a.gain - b.gain).abs() < 1e-12);
            let back = image.mirrored(&plane).unwrap();
            assert!(minus(back.position_m, disk.position_m).iter().all(|c| c.abs() < 1e-12));
        }
        let disk = Disk { position_m: [0.0; 3], normal: [1.0, 0.0, 0.0], radius_m: 0.1 };
        for normal in [[0.0; 3], [f64::NAN; 3]] {
            assert_eq!(disk.mirrored(&Plane { point_m: [0.0; 3], normal }), None);
        }
        // Several planes: one way each.
        let wall = Plane { point_m: [2.0, 0.0, 0.0], normal: [-1.0, 0.0, 0.0] };
        let all: Vec<Arrival> = disk.arrivals(&[FLOOR, wall], [1.0, 0.0, 0.0], C).collect();
        assert_eq!(all.iter().map(|way| way.distance_m).collect::<Vec<_>>(), [1.0, 1.0, 3.0]);
    }

    #[test]
    fn factors_of_all_bins_are_those_of_each() {
        let arrivals = [(0.3, 0.0171), (-0.2, 0.0333), (0.01, 1.9)];
        let arrivals = arrivals.map(|(gain, delay_s)| Arrival { gain, distance_m: C * delay_s, delay_s });
        let mut all = vec![Complex::new(7.0, 7.0); 2049];
        factors(&arrivals, 22_050.0 / 2048.0, &mut all);
        for (i, bin) in all.iter().enumerate() {
            let one = factor(&arrivals, i as f64 * 22_050.0 / 2048.0);
            assert!((one - bin).norm() < 1e-11, "{i}");
        }
    }

    #[test]
    fn the_directivity_is_the_cosine() {
        let random = Random::new(3, 3);
        for i in 0..50 {
            let vector = |n: u64| [0, 1, 2].map(|k| 2.0 * random.uniform(10 * i + 3 * n + k) - 1.0);
            let (axis, toward) = (vector(0), unit(vector(1)));
            let disk = Disk { position_m: [0.0; 3], normal: axis, radius_m: 1.0 };
            let found = directivity(axis).pressure(ahead_left_up(toward));
            assert!((found - disk.arrival(toward, C).gain).abs() < 1e-12);
        }
        assert_eq!(directivity([0.0; 3]).coefficients, [0.0; HARMONICS]);
    }

    #[test]
    fn a_disk_passes_through_a_listener_without_a_step() {
        let at = |x: f64| Disk { position_m: [x, 0.0, 0.0], normal: [1.0, 0.0, 0.0], radius_m: 0.1 };
        let gains: Vec<f64> =
            (-1000..=1000).map(|i| at(f64::from(i) * 1e-3).arrival([0.0; 3], C).gain).collect();
        assert!(gains.windows(2).all(|w| (w[1] - w[0]).abs() < 2e-4), "of 0.01 at most");
        assert_eq!(gains[1000], 0.0);
    }
}
