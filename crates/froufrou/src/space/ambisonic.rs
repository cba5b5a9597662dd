//! Ambisonics of order 1 to 3: encoding directions, turning, and decoding to loudspeakers.
//!
//! Signals are in the convention of AmbiX files (Nachbar et al. 2011): channels in ACN order, harmonics in SN3D, as
//! [`directivity::harmonics`](super::directivity::harmonics) has them. Directions are in the listener's frame: ahead
//! −Z, right +X, up +Y.
//!
//! A decoder is a matrix from harmonics to loudspeakers:
//!
//! - **Mode matching** finds the loudspeaker signals whose harmonics are those of the source: the
//!   pseudo-inverse of the loudspeakers' harmonics (Poletti 2005). It is for layouts that surround the listener
//!   evenly.
//! - **AllRAD** (Zotter & Frank 2012, "All-round ambisonic panning and decoding", J. Audio Eng. Soc. 60(10)) plays
//!   the field to many virtual loudspeakers spread evenly, and pans each of these to the real ones. It is for any
//!   layout.
//!
//! Either weighs the orders n of N by aₙ ([`Weights`]), which trades how sharp a source is against what is heard
//! on the opposite side. Over an even layout a source has the velocity vector (Σ g l / Σ g) and the energy vector
//! (Σ g² l / Σ g²) of these lengths, both towards the source:
//!
//! | weights | aₙ | velocity | energy |
//! | --- | --- | --- | --- |
//! | basic | 1 | 1 | N / (N + 1) |
//! | max-rE | Pₙ(r), r the largest root of P₍N+1₎ | r | r: 0.577, 0.775, 0.861 |
//! | in-phase | N! (N + 1)! / ((N + n + 1)! (N − n)!) | N / (N + 2) | N / (N + 1) |

use super::direction::ahead_left_up;
use super::directivity::{HARMONICS, ORDERS, harmonics};
use super::layout::check;
use super::panning::Panner;
use super::sphere::{dot, unit};
use crate::score::Loudspeaker;
use crate::{Error, Result};

/// The highest order.
pub const MOST_ORDER: usize = 3;

/// The usual names of the harmonics, in ACN order.
pub const CHANNEL_NAMES: [&str; HARMONICS] =
    ["W", "Y", "Z", "X", "V", "T", "R", "S", "U", "Q", "O", "M", "K", "L", "N", "P"];

/// The number of channels of an order: (order + 1)².
pub const fn channels(order: usize) -> usize {
    (order + 1) * (order + 1)
}

/// The gains of the channels for a source in a direction of any length; a source without a direction (no length,
/// not finite) is in the first channel alone. `out` has as many places as there are channels; places beyond order
/// 3 become 0.
///
/// ```
/// let mut ahead = [0.0; 4];
/// froufrou::space::ambisonic::encode([0.0, 0.0, -2.0], &mut ahead);
/// assert_eq!(ahead, [1.0, 0.0, 0.0, 1.0]);
/// ```
pub fn encode(direction: [f64; 3], out: &mut [f64]) {
    let values = match dot(direction, direction) {
        square if square > 0.0 && square.is_finite() => harmonics(ahead_left_up(unit(direction))),
        _ => std::array::from_fn(|i| if i == 0 { 1.0 } else { 0.0 }),
    };
    out.iter_mut()
        .zip(values.into_iter().chain(std::iter::repeat(0.0)))
        .for_each(|(out, value)| *out = value);
}

/// How much of each order a decoder plays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Weights {
    /// All of them alike: right for low frequencies at the middle of the loudspeakers.
    Basic,
    /// As sharp as the energy of a source can be (Gerzon 1992; Daniel 2000): for high frequencies, and all.
    #[default]
    MaxRe,
    /// Nothing on the opposite side of a source: for large audiences.
    InPhase,
}

impl Weights {
    /// The weight of each order n from 0 to `order`; 0 beyond it. There are none for orders above 3.
    pub fn of(self, order: usize) -> [f64; MOST_ORDER + 1] {
        let factorial = |n: usize| (1..=n).map(|i| i as f64).product::<f64>();
        let sharpest = [0.0, (1.0f64 / 3.0).sqrt(), 0.6f64.sqrt(), 0.861_136_311_594_052_6];
        std::array::from_fn(|n| match self {
            _ if n > order || order > MOST_ORDER => 0.0,
            Weights::Basic => 1.0,
            Weights::MaxRe => {
                let r = sharpest[order];
                [1.0, r, 0.5 * (3.0 * r * r - 1.0), 0.5 * r * (5.0 * r * r - 3.0)][n]
            }
            Weights::InPhase => {
                factorial(order) * factorial(order + 1) / (factorial(order + n + 1) * factorial(order - n))
            }
        })
    }
}

/// What a decoder keeps, on average over all directions of a source.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Level {
    /// The energy, Σ g² = 1, as a [`Panner`] does.
    #[default]
    Energy,
    /// The pressure where all loudspeakers sum, Σ g = 1.
    Pressure,
}

/// A matrix from harmonics to loudspeakers.
#[derive(Debug, Clone, PartialEq)]
pub struct Decoder {
    /// A row of gains for each loudspeaker.
    rows: Vec<Vec<f64>>,
}

/// Directions of loudspeakers whose singular values are smaller than this part of the largest are not
/// inverted: a ring has nothing to say about up and down.
const CUTOFF: f64 = 0.01;

impl Decoder {
    /// A decoder that matches the modes of loudspeakers that surround the listener evenly. Loudspeakers for
    /// low frequencies get nothing.
    ///
    /// What the loudspeakers cannot tell apart (singular values below 1 % of the largest) is left out.
    ///
    /// # Errors
    /// An order other than 1, 2 and 3, or loudspeakers that are no layout (see
    /// [`Layout::new`](super::layout::Layout::new)).
    pub fn mode_matching(
        speakers: &[Loudspeaker],
        order: usize,
        weights: Weights,
        level: Level,
    ) -> Result<Self> {
        check(speakers)?;
        check_order(order)?;
        let count = channels(order);
        let columns: Vec<Option<[f64; HARMONICS]>> = speakers
            .iter()
            .map(|speaker| (!speaker.is_lfe).then(|| orthonormal(speaker.direction())))
            .collect();
        let mut gram = vec![vec![0.0; count]; count];
        for column in columns.iter().flatten() {
            for (row, a) in gram.iter_mut().zip(column) {
                row.iter_mut().zip(column).for_each(|(sum, b)| *sum += a * b);
            }
        }
        // Y⁺ = Yᵀ (Y Yᵀ)⁺
        let inverse = pseudo_inverse(gram, CUTOFF * CUTOFF);
        let row = |column: &Option<[f64; HARMONICS]>| match column {
            Some(column) => {
                inverse.iter().map(|row| row.iter().zip(column).map(|(a, b)| a * b).sum()).collect()
            }
            None => vec![0.0; count],
        };
        Self { rows: columns.iter().map(row).collect() }.weighed(order, weights, level)
    }

    /// A decoder by way of many virtual loudspeakers, for any layout. Loudspeakers for low frequencies get nothing.
    ///
    /// ```
    /// use froufrou::space::ambisonic::{Decoder, Level, Weights, encode};
    /// use froufrou::space::layout::Layout;
    /// let layout = Layout::named("7.1.4")?;
    /// let decoder = Decoder::all_rad(layout.speakers(), 3, Weights::MaxRe, Level::Energy)?;
    /// let (mut signals, mut gains) = ([0.0; 16], [0.0; 12]);
    /// encode([0.0, 0.0, -1.0], &mut signals);
    /// decoder.decode(&signals, &mut gains);
    /// let loudest = (0..12).max_by(|&a, &b| gains[a].total_cmp(&gains[b])).unwrap();
    /// assert_eq!(layout.speakers()[loudest].name, "center");
    /// # Ok::<(), froufrou::Error>(())
    /// ```
    ///
    /// # Errors
    /// An order other than 1, 2 and 3, or loudspeakers that cannot be panned to (see [`Panner::new`]).
    pub fn all_rad(speakers: &[Loudspeaker], order: usize, weights: Weights, level: Level) -> Result<Self> {
        check_order(order)?;
        let panner = Panner::new(speakers)?;
        let mut rows = vec![vec![0.0; channels(order)]; speakers.len()];
        let mut gains = vec![0.0; speakers.len()];
        for (up, share) in gauss_legendre(RINGS) {
            let around = (1.0 - up * up).sqrt();
            for step in 0..2 * RINGS {
                // Alike to the left and the right, in front and behind.
                let (sin, cos) = (std::f64::consts::PI * (step as f64 + 0.5) / RINGS as f64).sin_cos();
                let direction = [around * sin, up, around * cos];
                panner.gains(direction, &mut gains);
                let values = orthonormal(direction);
                for (row, gain) in rows.iter_mut().zip(&gains) {
                    let part = gain * share / (4 * RINGS) as f64;
                    row.iter_mut().zip(values).for_each(|(sum, value)| *sum += part * value);
                }
            }
        }
        Self { rows }.weighed(order, weights, level)
    }

    /// Takes SN3D for the orthonormal harmonics, weighs their orders, and brings the whole to its level.
    fn weighed(mut self, order: usize, weights: Weights, level: Level) -> Result<Self> {
        let weights = weights.of(order);
        for row in &mut self.rows {
            for (gain, n) in row.iter_mut().zip(ORDERS) {
                *gain *= weights[n] * ((2 * n + 1) as f64).sqrt();
            }
        }
        // Means over the sphere: of a harmonic nothing but the first, of its square 1 / (2n + 1).
        let kept = match level {
            Level::Pressure => self.rows.iter().map(|row| row[0]).sum::<f64>(),
            Level::Energy => {
                let squares = self.rows.iter().flat_map(|row| row.iter().zip(ORDERS));
                squares.map(|(gain, n)| gain * gain / (2 * n + 1) as f64).sum::<f64>().sqrt()
            }
        };
        if !kept.is_finite() || kept <= 0.0 {
            return Err(Error::new("the loudspeakers stand so that ambisonics cannot be decoded to them")
                .help("decode by AllRAD, or keep the energy"));
        }
        self.rows.iter_mut().flatten().for_each(|gain| *gain /= kept);
        Ok(self)
    }

    /// The gains of a loudspeaker from each harmonic.
    pub fn rows(&self) -> &[Vec<f64>] {
        &self.rows
    }

    /// Loudspeaker signals of ambisonic ones, for one moment. Further places of `out` are left as they are.
    pub fn decode(&self, signals: &[f64], out: &mut [f64]) {
        for (out, row) in out.iter_mut().zip(&self.rows) {
            *out = row.iter().zip(signals).map(|(gain, signal)| gain * signal).sum();
        }
    }
}

fn check_order(order: usize) -> Result<()> {
    if (1..=MOST_ORDER).contains(&order) {
        return Ok(());
    }
    Err(Error::new(format!("ambisonics of order {order}, expected 1, 2 or 3")))
}

/// The harmonics with the norm N3D, so that their mean square over the sphere is 1.
fn orthonormal(direction: [f64; 3]) -> [f64; HARMONICS] {
    let values = harmonics(ahead_left_up(direction));
    std::array::from_fn(|i| values[i] * ((2 * ORDERS[i] + 1) as f64).sqrt())
}

/// Rings of virtual loudspeakers; each has twice as many.
const RINGS: usize = 60;

/// The nodes and weights that integrate polynomials of degree 2 count − 1 over [−1, 1] exactly: the roots of the
/// Legendre polynomial, by Newton's method.
pub(super) fn gauss_legendre(count: usize) -> impl Iterator<Item = (f64, f64)> {
    let n = count as f64;
    (0..count).map(move |i| {
        let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (n + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..8 {
            let (mut before, mut value) = (1.0, x);
            for k in 2..=count {
                let k = k as f64;
                (before, value) = (value, ((2.0 * k - 1.0) * x * value - (k - 1.0) * before) / k);
            }
            slope = n * (x * value - before) / (x * x - 1.0);
            x -= value / slope;
        }
        (x, 2.0 / ((1.0 - x * x) * slope * slope))
    })
}

/// The pseudo-inverse of a symmetric matrix; eigenvalues below a part of the largest count as nothing. Jacobi's
/// method, as these matrices are small.
fn pseudo_inverse(mut a: Vec<Vec<f64>>, cutoff: f64) -> Vec<Vec<f64>> {
    let n = a.len();
    let mut vectors: Vec<Vec<f64>> =
        (0..n).map(|i| (0..n).map(|k| f64::from(u8::from(i == k))).collect()).collect();
    for _ in 0..60 {
        let off: f64 = (0..n).flat_map(|i| (0..i).map(move |k| (i, k))).map(|(i, k)| a[i][k] * a[i][k]).sum();
        let whole: f64 = (0..n).map(|i| a[i][i] * a[i][i]).sum();
        if off <= 1e-32 * whole {
            break;
        }
        for p in 0..n {
            for q in p + 1..n {
                if a[p][q] == 0.0 {
                    continue;
                }
                let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
                let c = 1.0 / t.hypot(1.0);
                let s = t * c;
                let turn = |x: f64, y: f64| (c * x - s * y, s * x + c * y);
                for row in a.iter_mut().chain(&mut vectors) {
                    (row[p], row[q]) = turn(row[p], row[q]);
                }
                let (before, from_q) = a.split_at_mut(q);
                for (x, y) in before[p].iter_mut().zip(&mut from_q[0]) {
                    (*x, *y) = turn(*x, *y);
                }
            }
        }
    }
    let largest = (0..n).map(|i| a[i][i]).fold(0.0, f64::max);
    let inverse = |i: usize| if a[i][i] > cutoff * largest { 1.0 / a[i][i] } else { 0.0 };
    let entry = |i: usize, k: usize| (0..n).map(|e| vectors[i][e] * inverse(e) * vectors[k][e]).sum();
    (0..n).map(|i| (0..n).map(|k| entry(i, k)).collect()).collect()
}

/// What a turn of all directions does to ambisonic signals up to order 3.
///
/// ```
/// use froufrou::space::ambisonic::{Rotation, encode};
/// // A quarter to the left: what was ahead is left.
/// let turn = Rotation::new([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]);
/// let (mut signals, mut left) = ([0.0; 16], [0.0; 16]);
/// encode([0.0, 0.0, -1.0], &mut signals);
/// turn.apply(&mut signals);
/// encode([-1.0, 0.0, 0.0], &mut left);
/// assert!(signals.iter().zip(left).all(|(a, b)| (a - b).abs() < 1e-12));
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Rotation {
    /// A row for each harmonic; it reads those of its own order alone.
    rows: [[f64; 2 * MOST_ORDER + 1]; HARMONICS],
}

/// The corner, all places positive, of a snub cube whose 24 corners are a spherical 7-design (McLaren 1963; Hardin &
/// Sloane 1996): x², y², z² are the roots of t³ − t² + t/5 − 1/105. The mean over them is that over the sphere for
/// every polynomial of degree 7.
const DESIGN: [f64; 3] = [0.266_635_401_516_704_7, 0.422_518_653_761_111_5, 0.866_246_818_107_820_6];

/// The corners of that snub cube: all turns of a cube, applied to the first of them.
fn design() -> impl Iterator<Item = [f64; 3]> {
    (0..48).filter_map(|i| {
        let order = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [1, 0, 2], [0, 2, 1], [2, 1, 0]][i / 8];
        let signs = [0, 1, 2].map(|bit| if i >> bit & 1 == 0 { 1.0 } else { -1.0 });
        let is_turn = (signs[0] * signs[1] * signs[2] > 0.0) == (i / 8 < 3);
        is_turn.then(|| [0, 1, 2].map(|axis| signs[axis] * DESIGN[order[axis]]))
    })
}

impl Rotation {
    /// The rotation that takes each direction d of the listener's frame to `matrix` d (rows first).
    ///
    /// The harmonics of an order turn among themselves, Y(R d) = M Y(d), so that M = (2n + 1) ⟨Y(R d) Y(d)ᵀ⟩ in
    /// SN3D; the mean over a spherical design is exact. A matrix that is none of a rotation leads to no rotation.
    pub fn new(matrix: [[f64; 3]; 3]) -> Self {
        let mut rows = [[0.0; 2 * MOST_ORDER + 1]; HARMONICS];
        for direction in design() {
            let from = harmonics(ahead_left_up(direction));
            let to = harmonics(ahead_left_up(matrix.map(|row| dot(row, direction))));
            for (i, row) in rows.iter_mut().enumerate() {
                let n = ORDERS[i];
                let own = &from[n * n..(n + 1) * (n + 1)];
                let part = (2 * n + 1) as f64 / 24.0 * to[i];
                row.iter_mut().zip(own).for_each(|(sum, from)| *sum += part * from);
            }
        }
        Self { rows }
    }

    /// Turns the signals of one moment, of any order up to 3.
    pub fn apply(&self, signals: &mut [f64]) {
        let mut before = [0.0; HARMONICS];
        before.iter_mut().zip(signals.iter()).for_each(|(before, signal)| *before = *signal);
        for (i, (signal, row)) in signals.iter_mut().zip(&self.rows).enumerate() {
            let n = ORDERS[i];
            *signal = row.iter().zip(&before[n * n..(n + 1) * (n + 1)]).map(|(a, b)| a * b).sum();
        }
    }
}

#[cfg(test)]
mod tests;
