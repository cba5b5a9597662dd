//! What a microphone makes of a sound that comes from somewhere: so much in one channel, or its share in each
//! of several.

use super::ambisonic;
use super::direction::ahead_left_up;
use super::directivity::harmonics;
use super::layout::MOST_LOUDSPEAKERS;
use super::microphone::{NEAR_M, directivity, length};
use super::panning::Panner;
use crate::Result;
use crate::score::{Arrival, MicrophoneShape, Pickup, Pose};

/// Where something is for a microphone.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Toward {
    /// In the microphone's own frame (ahead −Z, right +X, up +Y), in metres.
    pub local_m: [f64; 3],
    /// How far it is.
    pub distance_m: f64,
}

impl Toward {
    /// Where a place is for a microphone.
    pub fn new(microphone: &Pose, from_m: [f64; 3]) -> Self {
        let to: [f64; 3] = std::array::from_fn(|i| from_m[i] - microphone.position_m[i]);
        let [right, up, ahead] = frame(microphone);
        Self { local_m: [dot(right, to), dot(up, to), -dot(ahead, to)], distance_m: length(to) }
    }
}

/// Unit vectors to the right of a microphone, up and ahead.
fn frame(microphone: &Pose) -> [[f64; 3]; 3] {
    let Some(ahead) = unit(microphone.facing) else {
        // Between two opposite directions, it faces nowhere.
        return [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]];
    };
    // What looks along its own up turns about no axis in particular.
    let across = |up| unit(cross(ahead, up)).filter(|_| length(cross(ahead, up)) > 1e-9 * length(up));
    let right = across(microphone.up).or_else(|| across([0.0, 0.0, 1.0])).unwrap_or([1.0, 0.0, 0.0]);
    [right, cross(right, ahead), ahead]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(vector: [f64; 3]) -> Option<[f64; 3]> {
    let long = length(vector);
    (long > 0.0 && long.is_finite()).then(|| vector.map(|c| c / long))
}

/// How loud each channel of a microphone hears what comes from all sides alike, against one that hears all around: the
/// root of its mean square. What ears hear is for the head to say.
pub(crate) fn diffuse(pickup: &Pickup) -> Vec<f64> {
    match pickup {
        Pickup::Shape(shape) => {
            // The mean over the sphere is that over cos μ, by Simpson's rule.
            let steps = 2000;
            let at = |n: usize| directivity(*shape, 2.0 * n as f64 / steps as f64 - 1.0).powi(2);
            let inner: f64 = (1..steps).map(|n| at(n) * if n % 2 == 1 { 4.0 } else { 2.0 }).sum();
            vec![((at(0) + inner + at(steps)) / (3.0 * steps as f64)).sqrt()]
        }
        Pickup::Binaural { .. } => vec![1.0; 2],
        Pickup::Ambisonic { order } => {
            (0..ambisonic::channels(*order)).map(|n| (1.0 / (2 * n.isqrt() + 1) as f64).sqrt()).collect()
        }
        Pickup::Loudspeakers(all) => {
            let playing = all.iter().filter(|loudspeaker| !loudspeaker.is_lfe).count() as f64;
            let level = |is_lfe| if is_lfe { 0.0 } else { (1.0 / playing).sqrt() };
            all.iter().map(|loudspeaker| level(loudspeaker.is_lfe)).collect()
        }
    }
}

/// A microphone made ready to be asked.
pub(crate) enum Receiving {
    Shape(MicrophoneShape),
    Ears,
    Ambisonic {
        harmonics: usize,
    },
    Loudspeakers {
        panner: Panner,
        /// Which of them play more than low effects.
        playing: Vec<bool>,
    },
}

impl Receiving {
    /// Makes what a microphone picks up ready.
    ///
    /// # Errors
    /// Loudspeakers over which no sound can be spread.
    pub fn new(pickup: &Pickup) -> Result<Self> {
        Ok(match pickup {
            Pickup::Shape(shape) => Receiving::Shape(*shape),
            Pickup::Binaural { .. } => Receiving::Ears,
            Pickup::Ambisonic { order } => Receiving::Ambisonic { harmonics: ambisonic::channels(*order) },
            Pickup::Loudspeakers(all) => Receiving::Loudspeakers {
                panner: Panner::new(all)?,
                playing: all.iter().map(|loudspeaker| !loudspeaker.is_lfe).collect(),
            },
        })
    }

    /// Whether what it hears depends on how it is turned so much that keys must follow that.
    pub fn is_turned(&self) -> bool {
        !matches!(self, Receiving::Shape(_))
    }

    /// Adds what arrives from somewhere by a path of a length, with a pressure gain.
    pub fn hear(&self, from: Toward, length_m: f64, gain: f64, delay_s: f64, values: &mut Vec<Arrival>) {
        // Very near, the direction fades away, so that a source may pass through.
        let near = (from.distance_m / NEAR_M).min(1.0);
        let local = unit(from.local_m).unwrap_or([0.0, 0.0, -1.0]);
        match self {
            Receiving::Shape(shape) => {
                values.push(Arrival::new(gain * directivity(*shape, -local[2] * near), delay_s));
            }
            Receiving::Ears => {
                let place = if from.distance_m > 0.0 { local.map(|c| c * length_m) } else { [0.0; 3] };
                values.push(Arrival { from_m: Some(place), ..Arrival::new(gain, delay_s) });
            }
            Receiving::Ambisonic { harmonics: count } => {
                let all = harmonics(ahead_left_up(local));
                // Solid harmonics r^n Y are smooth through the centre.
                let fade = [1.0, near, near * near, near * near * near];
                let weighted = all.iter().enumerate().take(*count);
                values.extend(weighted.map(|(n, y)| Arrival::new(gain * fade[n.isqrt()] * y, delay_s)));
            }
            Receiving::Loudspeakers { panner, playing } => {
                let mut shares = [0.0; MOST_LOUDSPEAKERS];
                let shares = &mut shares[..playing.len()];
                panner.gains(local, shares);
                if near < 1.0 {
                    let even = (1.0 / playing.iter().filter(|plays| **plays).count() as f64).sqrt();
                    for (share, _) in shares.iter_mut().zip(playing).filter(|(_, plays)| **plays) {
                        *share = even + near * (*share - even);
                    }
                    let energy: f64 = shares.iter().map(|share| share * share).sum();
                    shares.iter_mut().for_each(|share| *share /= energy.sqrt());
                }
                values.extend(shares.iter().map(|share| Arrival::new(gain * share, delay_s)));
            }
        }
    }

    /// Adds what sounds all around it, with a gain.
    pub fn around(&self, gain: f64, values: &mut Vec<Arrival>) {
        let centre = Toward { local_m: [0.0; 3], distance_m: 0.0 };
        match self {
            Receiving::Shape(_) => values.push(Arrival::new(gain, 0.0)),
            _ => self.hear(centre, 0.0, gain, 0.0, values),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::Loudspeaker;

    fn heard(pickup: &Pickup, microphone: &Pose, source_m: [f64; 3]) -> Vec<Arrival> {
        let from = Toward::new(microphone, source_m);
        let mut values = Vec::new();
        let gain = 1.0 / from.distance_m.max(NEAR_M);
        Receiving::new(pickup).unwrap().hear(from, from.distance_m, gain, 0.1, &mut values);
        values
    }

    const fn shape(c: f64, k: f64) -> Pickup {
        Pickup::Shape(MicrophoneShape { c, k })
    }

    #[test]
    fn gain_is_the_product_of_distance_and_direction() {
        let microphone = Pose::upright([1.0, 2.0, 3.0], [0.0, 0.0, -7.0]);
        let gain = |pickup, source_m| heard(&pickup, &microphone, source_m)[0].gain;
        assert_eq!(gain(shape(0.0, 0.0), [1.0, 2.0, 8.0]), 0.2);
        assert_eq!(gain(shape(0.0, 1.0), [1.0, 2.0, 8.0]), 0.0);
        assert_eq!(gain(shape(0.0, 1.0), [1.0, 2.0, -1.0]), 0.25);
        let side = gain(shape(1.0, 2.0), [5.0, 2.0, 3.0]);
        assert!((side - 0.25 * (1.0 + 0.25) / 2.0).abs() < 1e-15);
    }

    #[test]
    fn what_comes_from_all_sides_has_its_mean_square() {
        // The mean of ((1 + x) / 2)² over x from −1 to 1 is 1/3.
        let level = |pickup| diffuse(&pickup)[0];
        assert!((level(shape(0.0, 1.0)) - (1.0f64 / 3.0).sqrt()).abs() < 1e-12);
        assert!((level(shape(0.0, 0.0)) - 1.0).abs() < 1e-12);
        // And of ((1 + (1 + x) / 2) / 2)² it is (1 + 1 + 1/3) / 4.
        assert!((level(shape(1.0, 1.0)) - (7.0f64 / 12.0).sqrt()).abs() < 1e-12);
        // The channels of a sound field, each over all directions.
        let levels = diffuse(&Pickup::Ambisonic { order: 3 });
        let upright = Pose::upright([0.0; 3], [0.0, 0.0, -1.0]);
        let mut sums = [0.0; 16];
        for direction in super::super::sphere::even_directions(4000) {
            let values = heard(&Pickup::Ambisonic { order: 3 }, &upright, direction);
            sums.iter_mut().zip(&values).for_each(|(sum, value)| *sum += value.gain.powi(2) / 4000.0);
        }
        for (sum, level) in sums.iter().zip(&levels) {
            assert!((sum - level * level).abs() < 1e-3, "{sum} {level}");
        }
    }

    #[test]
    fn a_source_passes_through_a_microphone_smoothly() {
        let microphone = Pose::upright([0.0; 3], [1.0, 0.0, 0.0]);
        let loudspeaker = |name: &str, azimuth_deg| Loudspeaker {
            name: name.into(),
            azimuth_deg,
            elevation_deg: 0.0,
            is_lfe: false,
        };
        let quad = [45.0, -45.0, 135.0, -135.0].map(|azimuth| loudspeaker(&azimuth.to_string(), azimuth));
        let pickups = [shape(0.0, 1.0), Pickup::Ambisonic { order: 3 }, Pickup::Loudspeakers(quad.to_vec())];
        for pickup in &pickups {
            let way: Vec<_> = (-1000..=1000)
                .map(|i| heard(pickup, &microphone, [f64::from(i) * 1e-3, 2e-4, 1e-4]))
                .collect();
            for pair in way.windows(2) {
                for (a, b) in pair[0].iter().zip(&pair[1]) {
                    assert!(a.gain.is_finite() && a.gain.abs() <= 10.001, "{pickup:?} {a:?}");
                    assert!((a.gain - b.gain).abs() < 0.35, "{pickup:?}: {a:?} {b:?}");
                }
            }
        }
    }

    #[test]
    fn directions_are_those_of_the_microphone() {
        // It faces +X and lies on its side: its up is +Z, so its right, ahead × up, is −Y.
        let lying = Pose { up: [0.0, 0.0, 2.0], ..Pose::upright([1.0, 1.0, 1.0], [3.0, 0.0, 0.0]) };
        let near = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(near(Toward::new(&lying, [6.0, 1.0, 1.0]).local_m, [0.0, 0.0, -5.0]));
        assert!(near(Toward::new(&lying, [1.0, 1.0, 3.0]).local_m, [0.0, 2.0, 0.0]));
        assert!(near(Toward::new(&lying, [1.0, -2.0, 1.0]).local_m, [3.0, 0.0, 0.0]));
        // Up need not be at right angles, and a gaze along it does no harm.
        let tilted = Pose { up: [1.0, 1.0, 0.0], ..Pose::upright([0.0; 3], [1.0, 0.0, 0.0]) };
        assert!(near(Toward::new(&tilted, [0.0, 2.0, 0.0]).local_m, [0.0, 2.0, 0.0]));
        let along = Pose::upright([0.0; 3], [0.0, 1.0, 0.0]);
        assert!(near(Toward::new(&along, [0.0, 4.0, 0.0]).local_m, [0.0, 0.0, -4.0]));
        // First order: W, Y, Z, X of what is 2 m to the left of one who faces −Z.
        let gains: Vec<f64> = heard(
            &Pickup::Ambisonic { order: 1 },
            &Pose::upright([0.0; 3], [0.0, 0.0, -1.0]),
            [-2.0, 0.0, 0.0],
        )
        .iter()
        .map(|arrival| arrival.gain)
        .collect();
        assert!(gains.iter().zip([0.5, 0.5, 0.0, 0.0]).all(|(a, b)| (a - b).abs() < 1e-15), "{gains:?}");
    }

    #[test]
    fn an_ambience_has_no_direction() {
        let around = |pickup: &Pickup| {
            let mut values = Vec::new();
            Receiving::new(pickup).unwrap().around(0.5, &mut values);
            values.iter().map(|arrival| arrival.gain).collect::<Vec<_>>()
        };
        assert_eq!(around(&shape(0.0, 1.0)), [0.5]);
        assert_eq!(around(&Pickup::Ambisonic { order: 1 }), [0.5, 0.0, 0.0, 0.0]);
        assert_eq!(around(&Pickup::Binaural { head: None, shared: false }), [0.5]);
        let lfe = Loudspeaker { name: "lfe".into(), azimuth_deg: 0.0, elevation_deg: 0.0, is_lfe: true };
        let side = |azimuth_deg| Loudspeaker {
            name: format!("{azimuth_deg}"),
            azimuth_deg,
            is_lfe: false,
            ..lfe.clone()
        };
        let all = Pickup::Loudspeakers(vec![side(30.0), side(-30.0), lfe.clone()]);
        let gains = around(&all);
        assert!((gains[0] - 0.5f64 * 0.5f64.sqrt()).abs() < 1e-12 && gains[0] == gains[1] && gains[2] == 0.0);
    }
}
