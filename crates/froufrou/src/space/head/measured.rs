//! A head as it was measured: its responses, and what they give at any rate.

use std::collections::HashMap;
use std::path::Path;
use std::sync::{Arc, OnceLock};

use super::aligned::Aligned;
use super::grid::{Grid, Vector, dot};
use super::onset::Onsets;
use super::sofa::{Measurements, read};
use super::sphere::{SPEED_OF_SOUND_MPS, detour_m};
use super::{Head, Kind};
use crate::synth::sinc::resample;
use crate::{Error, Place, Result};
use rayon::prelude::*;

/// Directions closer to each other than this, as a chord, are one (0.05°).
const SAME: f64 = 8.7e-4;

/// Of several distances the farthest are taken, and what lies this much nearer.
const SHELL: f64 = 0.9;

/// Where no direction lies within 30° of a half axis, one is made up.
const COVERED: f64 = 0.866;

/// The responses of a head as a SOFA file has them, with all that does not depend on an output rate.
///
/// ```no_run
/// use froufrou::space::head::Measured;
/// let measured = Measured::open("head.sofa".as_ref())?;
/// let head = measured.head(48_000.0);
/// # Ok::<(), froufrou::Error>(())
/// ```
#[derive(Debug)]
pub struct Measured {
    pub(super) rate_hz: f64,
    pub(super) samples: usize,
    /// For each direction and ear a response.
    responses: Vec<f64>,
    /// For each direction and ear the delay that the file adds, in samples.
    delays: Vec<[f64; 2]>,
    pub(super) corners: Arc<Corners>,
    /// Onsets of the responses of each direction and ear, in samples, without the file's delays.
    pub(super) onsets: Vec<[f64; 2]>,
    contradictory: bool,
    /// The head at the file's own rate.
    own: OnceLock<Head>,
}

/// The directions about a head, and when sound from them arrives.
#[derive(Debug)]
pub(super) struct Corners {
    pub(super) grid: Grid,
    /// So many corners of the grid are measured, and come first.
    pub(super) measured: usize,
    pub(super) directions: Vec<Vector>,
    /// Each of the other corners, and last the head's centre, is a mixture of measured ones.
    pub(super) mixtures: Vec<Vec<(usize, f64)>>,
    /// By how much sound comes later than to where the centre would be, for each corner and ear, in seconds.
    pub(super) delays_s: Vec<[f64; 2]>,
    /// When sound would be at the centre, in the time of the file, in seconds.
    begin_s: f64,
    /// How far from the centre the measured sources were, in metres; infinite where that is not known.
    pub(super) distance_m: f64,
    pub(super) radius_m: f64,
}

impl Measured {
    /// Reads a SOFA file of the convention SimpleFreeFieldHRIR.
    ///
    /// # Errors
    /// Where the file cannot be read, is damaged, or holds something else.
    pub fn open(path: &Path) -> Result<Self> {
        Self::new(read(path)?).ok_or_else(|| {
            Error::new("the directions of the measurements make no sense")
                .in_file(path)
                .at(Place::Part("SourcePosition".into()))
                .help("write the file anew, with a direction for each measurement")
        })
    }

    pub(super) fn new(from: Measurements) -> Option<Self> {
        let chosen = choose(&from);
        let onsets_of = Onsets::new(from.samples, from.rate_hz);
        let found: Vec<[Option<f64>; 2]> =
            chosen.par_iter().map(|n| from.response(*n).map(|response| onsets_of.find(response))).collect();
        let all: Vec<f64> = found.as_flattened().iter().flatten().copied().collect();
        let mean = all.iter().sum::<f64>() / all.len().max(1) as f64;
        let onsets: Vec<[f64; 2]> =
            found.iter().map(|both| both.map(|onset| onset.unwrap_or(mean))).collect();

        let directions: Vec<Vector> = chosen.iter().map(|n| from.directions[*n]).collect();
        let known: Vec<f64> = chosen.iter().map(|n| from.distances_m[*n]).filter(|d| *d > 0.0).collect();
        let distance_m = match known.len() {
            0 => f64::INFINITY,
            n => (known.iter().sum::<f64>() / n as f64).max(1.2 * from.radius_m),
        };
        let delays: Vec<[f64; 2]> = chosen.iter().map(|n| from.delays[*n]).collect();
        let arrivals_s: Vec<[f64; 2]> = onsets
            .iter()
            .zip(&delays)
            .map(|(onsets, delays)| [0, 1].map(|ear| (onsets[ear] + delays[ear]) / from.rate_hz))
            .collect();
        let corners = Corners::new(directions, &arrivals_s, distance_m, from.radius_m)?;
        let responses = chosen.iter().flat_map(|n| from.response(*n)).flatten().copied().collect();
        Some(Self {
            rate_hz: from.rate_hz,
            samples: from.samples,
            responses,
            delays,
            corners: Arc::new(corners),
            onsets,
            contradictory: from.contradictory,
            own: OnceLock::new(),
        })
    }

    /// The head at an output rate, which must be positive.
    pub fn head(&self, rate_hz: f64) -> Head {
        let rate_hz = super::sane(rate_hz);
        Head { rate_hz, kind: Kind::Measured(Aligned::new(self, rate_hz)) }
    }

    /// The rate of the file in hertz.
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// The directions that are measured, of length 1, in the head's own frame: one for each that differs by
    /// 0.05° from those before, at the largest distance.
    pub fn directions(&self) -> &[[f64; 3]] {
        &self.corners.directions[..self.corners.measured]
    }

    /// True where the file says that its receivers are the other way round than its responses show; then the
    /// responses are believed.
    pub fn has_ears_exchanged(&self) -> bool {
        self.contradictory
    }

    /// A measured response of the left or the right ear, as it is in the file.
    pub(super) fn response(&self, corner: usize, ear: usize) -> &[f64] {
        let begin = (2 * corner + ear) * self.samples;
        &self.responses[begin..begin + self.samples]
    }

    /// The whole impulse responses of a direction, left and right, at the file's own rate, delays included.
    ///
    /// In a measured direction they are the file's own values to the bit, with as many zeros before them as
    /// its `Data.Delay` says (where that is not whole, they are moved by a band-limited filter).
    pub fn hrir(&self, towards: [f64; 3]) -> [Vec<f64>; 2] {
        let towards = super::coordinates::unit(towards).unwrap_or(super::AHEAD);
        let most = self.delays.as_flattened().iter().fold(0.0_f64, |most, delay| most.max(*delay));
        let length = self.samples + most.ceil() as usize;
        let (corners, weights) = self.corners.grid.weights(towards);
        let at =
            (0..3).find(|k| weights[*k] == 1.0 && corners[*k] < self.corners.measured).map(|k| corners[k]);
        if let Some(corner) = at {
            return [0, 1].map(|ear| {
                let (delay, response) = (self.delays[corner][ear], self.response(corner, ear));
                if delay.fract() == 0.0 {
                    let mut whole = vec![0.0; length];
                    whole[delay as usize..][..self.samples].copy_from_slice(response);
                    return whole;
                }
                let response: Vec<f32> = response.iter().map(|x| *x as f32).collect();
                moved(&response, delay, length)
            });
        }
        let head = self.own.get_or_init(|| self.head(self.rate_hz));
        let Kind::Measured(aligned) = &head.kind else { return [vec![0.0; length], vec![0.0; length]] };
        let mut taps = [vec![0.0; head.taps()], vec![0.0; head.taps()]];
        let [left, right] = &mut taps;
        let delays_s = aligned.mix(towards, 1.0, [left, right]);
        [0, 1].map(|ear| {
            let delay = (delays_s[ear] + self.corners.begin_s) * self.rate_hz - head.lead() as f64;
            moved(&taps[ear], delay, length)
        })
    }
}

/// Taps, later by so many samples.
fn moved(taps: &[f32], delay: f64, length: usize) -> Vec<f64> {
    let mut out = vec![0.0; length];
    resample(taps, -delay, 1.0, &mut out);
    out.into_iter().map(f64::from).collect()
}

/// The measurements that are used: of the farthest, one for each direction.
fn choose(from: &Measurements) -> Vec<usize> {
    let farthest = from.distances_m.iter().fold(0.0_f64, |most, distance| most.max(*distance));
    let mut order: Vec<usize> =
        (0..from.directions.len()).filter(|n| from.distances_m[*n] >= SHELL * farthest).collect();
    order.sort_by(|a, b| from.distances_m[*b].total_cmp(&from.distances_m[*a]));
    let cell = |direction: Vector| direction.map(|x| (x / SAME).floor() as i32);
    let mut cells: HashMap<[i32; 3], Vec<usize>> = HashMap::new();
    let mut chosen = Vec::new();
    for n in order {
        let direction = from.directions[n];
        let [x, y, z] = cell(direction);
        let near = (-1..=1).flat_map(|i| (-1..=1).flat_map(move |j| (-1..=1).map(move |k| (i, j, k))));
        let mut others = near.filter_map(|(i, j, k)| cells.get(&[x + i, y + j, z + k])).flatten();
        let same = |other: &usize| {
            let other = from.directions[*other];
            (0..3).map(|k| (direction[k] - other[k]).powi(2)).sum::<f64>() < SAME * SAME
        };
        if !others.any(same) {
            cells.entry([x, y, z]).or_default().push(n);
            chosen.push(n);
        }
    }
    chosen.sort_unstable();
    chosen
}

impl Corners {
    fn new(
        mut directions: Vec<Vector>,
        arrivals_s: &[[f64; 2]],
        distance_m: f64,
        radius_m: f64,
    ) -> Option<Self> {
        let measured = directions.len();
        // Sound would be at the centre when it is at the ears, but for the way about a sphere.
        let detour_s = |direction: Vector, ear: usize| {
            detour_m(distance_m, side(direction, ear), radius_m) / SPEED_OF_SOUND_MPS
        };
        let begin_s = directions
            .iter()
            .zip(arrivals_s)
            .map(|(direction, arrival_s)| {
                [0, 1].map(|ear| arrival_s[ear] - detour_s(*direction, ear)).iter().sum::<f64>() / 2.0
            })
            .sum::<f64>()
            / measured as f64;
        let mut delays_s: Vec<[f64; 2]> =
            arrivals_s.iter().map(|arrival_s| arrival_s.map(|arrival_s| arrival_s - begin_s)).collect();

        // Directions may leave holes, or all lie in one plane. With one near each half axis the head's centre
        // is among them; what is made up there is a mixture of those about the hole.
        let mut mixtures = Vec::new();
        for axis in 0..6 {
            let mut towards = [0.0; 3];
            towards[axis / 2] = if axis % 2 == 0 { 1.0 } else { -1.0 };
            if directions[..measured].iter().all(|direction| dot(*direction, towards) < COVERED) {
                let weight = |direction: &Vector| (1.0 - dot(*direction, towards)).powi(-4);
                let mixture = mixture(directions[..measured].iter().map(weight));
                directions.push(towards);
                delays_s.push(mixed(&delays_s, &mixture));
                mixtures.push(mixture);
            }
        }
        mixtures.push(mixture(directions[..measured].iter().map(|_| 1.0)));
        delays_s.push([0.0; 2]);
        let grid = Grid::new(directions.clone())?;
        Some(Self { grid, measured, directions, mixtures, delays_s, begin_s, distance_m, radius_m })
    }

    /// How many there are, with those made up and the centre.
    pub(super) fn count(&self) -> usize {
        self.delays_s.len()
    }
}

/// The cosine of the angle between a direction and the axis of an ear.
pub(super) fn side(direction: Vector, ear: usize) -> f64 {
    if ear == 0 { -direction[0] } else { direction[0] }
}

/// Weights of sum 1, without those that count for nothing.
fn mixture(weights: impl Iterator<Item = f64>) -> Vec<(usize, f64)> {
    let mut weights: Vec<(usize, f64)> = weights.enumerate().collect();
    let most = weights.iter().fold(0.0_f64, |most, (_, weight)| most.max(*weight));
    weights.retain(|(_, weight)| *weight >= 1e-3 * most);
    let sum: f64 = weights.iter().map(|(_, weight)| weight).sum();
    weights.iter_mut().for_each(|(_, weight)| *weight /= sum);
    weights
}

fn mixed(delays_s: &[[f64; 2]], mixture: &[(usize, f64)]) -> [f64; 2] {
    [0, 1].map(|ear| mixture.iter().map(|(corner, weight)| delays_s[*corner][ear] * weight).sum())
}

#[cfg(test)]
impl Measured {
    /// Some of the measurements alone, with those that are kept.
    pub(super) fn only(&self, keep: impl Fn(usize) -> bool) -> Self {
        let kept: Vec<usize> = (0..self.corners.measured).filter(|n| keep(*n)).collect();
        let from = Measurements {
            rate_hz: self.rate_hz,
            samples: self.samples,
            directions: kept.iter().map(|n| self.corners.directions[*n]).collect(),
            distances_m: vec![self.corners.distance_m; kept.len()],
            responses: kept
                .iter()
                .flat_map(|n| [self.response(*n, 0), self.response(*n, 1)])
                .flatten()
                .copied()
                .collect(),
            delays: kept.iter().map(|n| self.delays[*n]).collect(),
            radius_m: self.corners.radius_m,
            contradictory: false,
        };
        Self::new(from).expect("directions")
    }
}
