//! Vector base amplitude panning (Pulkki 1997, "Virtual sound source positioning using vector base amplitude
//! panning", J. Audio Eng. Soc. 45(6)): how loud each loudspeaker plays a source in some direction.
//!
//! The loudspeakers' directions are the corners of triangles that cover the sphere, the faces of their convex
//! hull. A source in the direction p, within a triangle with the corners l₁, l₂, l₃, has the gains g with
//!
//! ```text
//! g₁ l₁ + g₂ l₂ + g₃ l₃ ∝ p,   Σ g² = 1
//! ```
//!
//! so that the velocity vector, Σ g l / Σ g, points at the source. On the edge between two loudspeakers only these
//! play, by the law of tangents; towards one, only that one.
//!
//! - A face with more than three corners (four loudspeakers that mirror each other always make one) is not cut along
//!   a diagonal, which would prefer one side. It has an imaginary loudspeaker amid it, in the direction of Σ l, whose
//!   gain all its corners take over alike. The velocity vector points at the source there too.
//! - Where the loudspeakers do not surround the listener, imaginary ones close the gap: straight out of each
//!   face of the hull that the listener is beyond, or nearly (for loudspeakers at ear height: above and below). Its
//!   neighbours take over its gain, their energies in proportion to the angle each fills of the round about it,
//!   the whole energy kept.
//! - A gap of 160° and more in the ring about the listener has two imaginary loudspeakers, at a third
//!   and two thirds of it, each played by the end nearer to it. So with stereo what is far to the left is heard on
//!   the left alone, and what is behind as if it were in front.
//!
//! Gains are continuous in the direction everywhere.

use super::layout::check;
use super::sphere::{Face, Triangulation, cross, dot, hull, minus, unit};
use crate::score::Loudspeaker;
use crate::{Error, Result};

/// A face nearer to the listener than this, as a part of the radius, counts as a gap: its circle is wider than 78°
/// each way.
const OPEN: f64 = 0.2;

/// A gap in a ring that is wider than this, in degrees, is too wide to pan across.
const GAP_DEG: f64 = 160.0;

/// Loudspeakers up to this elevation, in degrees, are part of the ring about the listener.
const RING_DEG: f64 = 10.0;

/// Loudspeakers closer together than this, in degrees, cannot be told apart.
const NEAR_DEG: f64 = 0.5;

/// Gains below this are rounding.
const SILENT: f64 = 1e-12;

/// The directions that stand for a wide source.
pub const POINTS: usize = 24;

/// Pans sources to loudspeakers.
#[derive(Debug, Clone)]
pub struct Panner {
    channels: usize,
    /// The channels that are not for low frequencies only.
    heard: Vec<usize>,
    /// Absent where there is but one loudspeaker.
    triangles: Option<Triangulation>,
    /// Which channels play each corner, and how loud.
    plays: Vec<Vec<(usize, f64)>>,
}

impl Panner {
    /// A panner to these loudspeakers.
    ///
    /// ```
    /// use froufrou::space::{layout::Layout, panning::Panner};
    /// let panner = Panner::new(Layout::named("stereo")?.speakers())?;
    /// let mut gains = [0.0; 2];
    /// panner.gains([0.0, 0.0, -1.0], &mut gains);
    /// assert!(gains.iter().all(|g| (g - 0.5f64.sqrt()).abs() < 1e-12));
    /// # Ok::<(), froufrou::Error>(())
    /// ```
    ///
    /// # Errors
    /// Loudspeakers that are no layout (see [`Layout::new`](super::layout::Layout::new)), or two of them within half
    /// a degree.
    pub fn new(speakers: &[Loudspeaker]) -> Result<Self> {
        check(speakers)?;
        let heard: Vec<usize> = (0..speakers.len()).filter(|&i| !speakers[i].is_lfe).collect();
        let directions: Vec<[f64; 3]> = heard.iter().map(|&i| speakers[i].direction()).collect();
        for (i, &a) in directions.iter().enumerate() {
            let near = NEAR_DEG.to_radians();
            if let Some(k) = directions[..i].iter().position(|&b| dot(minus(a, b), minus(a, b)) < near * near)
            {
                let [one, other] = [heard[k], heard[i]].map(|channel| &speakers[channel].name);
                let what = format!("the loudspeakers `{one}` and `{other}` stand in the same direction");
                return Err(Error::new(what).help("leave one of them out, or move it"));
            }
        }
        let mut corners: Vec<Corner> = directions
            .iter()
            .zip(&heard)
            .map(|(&direction, &channel)| Corner { direction, plays: vec![(channel, 1.0)] })
            .collect();
        let mut triangles = None;
        if corners.len() > 1 {
            let faces = surround(&mut corners)?;
            let all = cut(&mut corners, &faces);
            let directions: Vec<[f64; 3]> = corners.iter().map(|corner| corner.direction).collect();
            triangles = Some(Triangulation::new(&directions, all));
        }
        let plays = corners.into_iter().map(|corner| corner.plays).collect();
        Ok(Self { channels: speakers.len(), heard, triangles, plays })
    }

    /// The number of channels: as many as loudspeakers, those for low frequencies among them.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// The gain of each channel for a source in a direction in the listener's frame (ahead −Z, right +X, up +Y), of
    /// any length; their squares sum to 1, none is below 0. Channels for low frequencies get 0. A source
    /// without a direction (no length, not finite) is played by all alike.
    ///
    /// `out` has a place for each channel; what is missing there is left out, and further places become 0.
    pub fn gains(&self, direction: [f64; 3], out: &mut [f64]) {
        out.fill(0.0);
        self.add(direction, out);
        normalise(out);
    }

    /// The gains for a source that is as wide as a cone of so many degrees from side to side, 360° for all around:
    /// those of [`POINTS`] directions spread evenly over the cone are summed (Pulkki 1999, "Uniform spreading
    /// of amplitude panned virtual sources"). With 0° they are [`Panner::gains`]; else as that, and at that
    /// many times its cost. The velocity vector points at the source as it does there.
    pub fn spread_gains(&self, direction: [f64; 3], width_deg: f64, out: &mut [f64]) {
        let length = dot(direction, direction).sqrt();
        // Also false for what is no number.
        if !(width_deg > 0.0 && length > 0.0 && length.is_finite()) {
            return self.gains(direction, out);
        }
        out.fill(0.0);
        let ahead = direction.map(|c| c / length);
        let level = cross(ahead, [0.0, 1.0, 0.0]);
        let level = if dot(level, level) > 0.0 { unit(level) } else { [1.0, 0.0, 0.0] };
        let upright = cross(level, ahead);
        let height = 1.0 - (0.5 * width_deg.min(360.0)).to_radians().cos();
        for i in 0..POINTS / 4 {
            // Equal areas of the cone, and the golden ratio about it. Mirrored to all four sides, so that
            // a source on a plane of symmetry stays there, and one that passes overhead makes no step.
            let part = (i as f64 + 0.5) / (POINTS / 4) as f64;
            let near = 1.0 - height * part;
            let aside = (1.0 - near * near).max(0.0).sqrt();
            let turn = 0.5 * std::f64::consts::PI * ((i as f64 + 0.5) * 0.618_033_988_749_894_9).fract();
            let (sin, cos) = turn.sin_cos();
            for (a, b) in [(cos, sin), (-cos, sin), (cos, -sin), (-cos, -sin)] {
                let toward = |k: usize| near * ahead[k] + aside * (a * level[k] + b * upright[k]);
                self.add([toward(0), toward(1), toward(2)], out);
            }
        }
        normalise(out);
    }

    /// Adds the gains for a direction, which are not yet brought to an energy of 1.
    fn add(&self, direction: [f64; 3], out: &mut [f64]) {
        let length = dot(direction, direction).sqrt();
        let mut add = |channel: usize, gain: f64| {
            if let Some(place) = out.get_mut(channel) {
                *place += gain;
            }
        };
        match &self.triangles {
            Some(triangles) if length > 0.0 && length.is_finite() => {
                let (corners, weights) = triangles.find(direction.map(|c| c / length));
                for (corner, weight) in corners.into_iter().zip(weights) {
                    if weight > SILENT {
                        self.plays[corner].iter().for_each(|&(channel, gain)| add(channel, weight * gain));
                    }
                }
            }
            _ => self.heard.iter().for_each(|&channel| add(channel, 1.0)),
        }
    }
}

/// Brings gains to an energy of 1.
fn normalise(gains: &mut [f64]) {
    let energy: f64 = gains.iter().map(|g| g * g).sum();
    if energy > 0.0 {
        let scale = 1.0 / energy.sqrt();
        gains.iter_mut().for_each(|g| *g *= scale);
    }
}

/// A corner of the triangles: a loudspeaker, or an imaginary one.
#[derive(Debug)]
struct Corner {
    direction: [f64; 3],
    /// Which channels play it, and how loud; none as long as that is not known.
    plays: Vec<(usize, f64)>,
}

/// Adds imaginary loudspeakers until the hull has the listener well inside, and says what plays them.
fn surround(corners: &mut Vec<Corner>) -> Result<Vec<Face>> {
    fill_ring(corners);
    let most = 3 * corners.len() + 16;
    let mut faces;
    loop {
        faces = hull_of(corners);
        let Some(worst) = faces.iter().min_by(|a, b| a.distance.total_cmp(&b.distance)) else { break };
        if worst.distance >= OPEN {
            break;
        }
        if corners.len() >= most {
            // The best that can be had; more would only lie in the same planes.
            if worst.distance > 1e-3 {
                break;
            }
            return Err(Error::new("the loudspeakers stand so that sound cannot be panned between them"));
        }
        corners.push(Corner { direction: worst.normal, plays: Vec::new() });
    }
    fold(corners, &faces);
    Ok(faces)
}

fn hull_of(corners: &[Corner]) -> Vec<Face> {
    hull(&corners.iter().map(|corner| corner.direction).collect::<Vec<_>>())
}

/// Fills the wide gaps of the ring about the listener: of the plane that all loudspeakers stand in, or else of
/// the horizontal one.
fn fill_ring(corners: &mut Vec<Corner>) {
    let directions: Vec<[f64; 3]> = corners.iter().map(|corner| corner.direction).collect();
    let (axis, is_flat) = match common_plane(&directions) {
        Some(axis) => (axis, true),
        None => ([0.0, 1.0, 0.0], false),
    };
    let within = RING_DEG.to_radians().sin();
    let mut ring: Vec<usize> =
        (0..directions.len()).filter(|&i| is_flat || dot(directions[i], axis).abs() <= within).collect();
    let Some(&first) = ring.first() else { return };
    let ahead = unit(minus(directions[first], axis.map(|c| c * dot(axis, directions[first]))));
    let left = cross(axis, ahead);
    let angle = |i: usize| dot(directions[i], left).atan2(dot(directions[i], ahead));
    ring.sort_by(|&i, &k| angle(i).total_cmp(&angle(k)));
    let faces = if is_flat || ring.len() < 2 { Vec::new() } else { hull_of(corners) };
    for (i, &from) in ring.iter().enumerate().filter(|_| ring.len() > 1) {
        let to = ring[(i + 1) % ring.len()];
        let width = (angle(to) - angle(from)).rem_euclid(std::f64::consts::TAU);
        // A ring of loudspeakers has no gap of nothing; the difference to a whole round is rounding.
        if width < GAP_DEG.to_radians() - 1e-9 {
            continue;
        }
        for (part, end) in [(1.0 / 3.0, from), (2.0 / 3.0, to)] {
            let (sin, cos) = (angle(from) + width * part).sin_cos();
            let direction: [f64; 3] = std::array::from_fn(|k| cos * ahead[k] + sin * left[k]);
            if is_flat || is_uncovered(&faces, direction) {
                let plays = corners[end].plays.clone();
                corners.push(Corner { direction, plays });
            }
        }
    }
}

/// The normal of the plane through the listener that all loudspeakers stand in, where there is one: always for
/// two. For two opposite ones it is the plane nearest to the horizontal one.
fn common_plane(directions: &[[f64; 3]]) -> Option<[f64; 3]> {
    let normals =
        directions.iter().enumerate().flat_map(|(i, &a)| directions[..i].iter().map(move |&b| cross(a, b)));
    let widest = normals.max_by(|&a, &b| dot(a, a).total_cmp(&dot(b, b)))?;
    if dot(widest, widest) < 1e-6 {
        let axis = directions[0];
        let across = |v: [f64; 3]| minus(v, axis.map(|c| c * dot(axis, v)));
        let upright = across([0.0, 1.0, 0.0]);
        return Some(unit(if dot(upright, upright) > 0.01 { upright } else { across([1.0, 0.0, 0.0]) }));
    }
    let normal = unit(widest);
    directions.iter().all(|&d| dot(d, normal).abs() < 1e-6).then_some(normal)
}

/// True where the face that lies in a direction is one that counts as a gap.
fn is_uncovered(faces: &[Face], direction: [f64; 3]) -> bool {
    let beyond = faces.iter().any(|face| face.distance <= 0.0 && dot(face.normal, direction) > 1e-9);
    let reach = |face: &&Face| dot(face.normal, direction) / face.distance;
    let hit = faces.iter().filter(|f| f.distance > 0.0).max_by(|a, b| reach(a).total_cmp(&reach(b)));
    beyond || hit.is_none_or(|face| face.distance < OPEN)
}

/// Says what plays the imaginary loudspeakers of which it is not known yet: their neighbours, each with energy in
/// proportion to its share of the round about them. Those with none but imaginary neighbours wait for these.
fn fold(corners: &mut [Corner], faces: &[Face]) {
    let mut unknown: Vec<usize> = (0..corners.len()).filter(|&i| corners[i].plays.is_empty()).collect();
    while !unknown.is_empty() {
        let known: Vec<Option<Vec<(usize, f64)>>> =
            unknown.iter().map(|&corner| neighbours_play(corners, faces, corner)).collect();
        if known.iter().all(Option::is_none) {
            break;
        }
        for (&corner, plays) in unknown.iter().zip(known) {
            corners[corner].plays = plays.unwrap_or_default();
        }
        unknown.retain(|&corner| corners[corner].plays.is_empty());
    }
}

fn neighbours_play(corners: &[Corner], faces: &[Face], of: usize) -> Option<Vec<(usize, f64)>> {
    let middle = corners[of].direction;
    let mut plays = Vec::new();
    for face in faces {
        let Some(at) = face.corners.iter().position(|&corner| corner == of) else { continue };
        let count = face.corners.len();
        let ends = [face.corners[(at + count - 1) % count], face.corners[(at + 1) % count]];
        let [a, b] = ends.map(|end| unit(cross(middle, corners[end].direction)));
        let half_angle = 0.5 * dot(a, b).clamp(-1.0, 1.0).acos();
        for end in ends {
            // Each neighbour is an end of two faces.
            for &(channel, gain) in &corners[end].plays {
                add(&mut plays, channel, half_angle * gain * gain);
            }
        }
    }
    let energy: f64 = plays.iter().map(|(_, energy)| energy).sum();
    plays.iter_mut().for_each(|(_, part)| *part = (*part / energy).sqrt());
    (!plays.is_empty()).then_some(plays)
}

fn add(plays: &mut Vec<(usize, f64)>, channel: usize, amount: f64) {
    match plays.iter_mut().find(|(other, _)| *other == channel) {
        Some((_, sum)) => *sum += amount,
        None => plays.push((channel, amount)),
    }
}

/// The triangles of the faces; those with more corners are cut about an imaginary loudspeaker amid them.
fn cut(corners: &mut Vec<Corner>, faces: &[Face]) -> Vec<[usize; 3]> {
    let mut triangles = Vec::new();
    for face in faces {
        if let [a, b, c] = face.corners[..] {
            triangles.push([a, b, c]);
            continue;
        }
        let (mut sum, mut plays) = ([0.0; 3], Vec::new());
        for &corner in &face.corners {
            let Corner { direction, plays: of_corner } = &corners[corner];
            sum = std::array::from_fn(|k| sum[k] + direction[k]);
            of_corner.iter().for_each(|&(channel, gain)| add(&mut plays, channel, gain));
        }
        let length = dot(sum, sum).sqrt();
        plays.iter_mut().for_each(|(_, gain)| *gain /= length);
        let middle = corners.len();
        corners.push(Corner { direction: unit(sum), plays });
        for (i, &corner) in face.corners.iter().enumerate() {
            triangles.push([middle, corner, face.corners[(i + 1) % face.corners.len()]]);
        }
    }
    triangles
}

#[cfg(test)]
mod tests;
