//! How much of a path's cross-section is covered (Takala & Hahn 1992, §5.4: "attenuation is approximated
//! with a form factor proportional to the amount of occlusion").
//!
//! A path is as wide as the first Fresnel zone of one frequency: an ellipsoid of revolution that
//! touches source and microphone, of radius ½ √(λ d) in the middle. Its cross-section is swept by rays,
//! the curves of constant angle α and constant part ρ of the radius, each of which is whole or hit. What covers
//! a triangle is exact along ρ: for each of 64 angles its cut with the half-plane through the path's
//! axis is a segment, and the rays that it hits are an interval of ρ whose ends have closed forms.
//! So the covered share moves continuously with every vertex.

use glam::{DAffine3, DMat3, DVec3};

use super::tree::Bounds;

/// Half-planes about the path's axis.
pub(crate) const ANGLES: usize = 64;

/// Rings of equal area. What one triangle covers of a ring is exact; where several share one, such as
/// the front and the back of a body at its edge, their parts add up to the ring at most.
const RINGS: usize = 16;

/// Boxes of a tree smaller than this part of the path's radius are taken whole, as a disc of somewhat more
/// than their area. It bounds the cost of a mesh however fine it is.
const FINE: f64 = 1.0 / 20.0;

/// The path is taken to end this part of its length before source and microphone.
const END: f64 = 1e-6;

/// What is left of each ray of a path after the bodies so far, and what the next one covers.
pub(crate) struct Beam {
    /// The part of the pressure left, for each angle and ring.
    passed: Vec<f64>,
    /// What the body at hand hides, and what the shape of it at hand covers; both nothing between bodies.
    hidden: Vec<f64>,
    covered: Vec<f64>,
    touched: bool,
    folded: bool,
    begin: DVec3,
    /// World to beam: along the path from 0 to 1, and across it in units of the diameter in the middle.
    into: DMat3,
    spokes: [(f64, f64); ANGLES],
}

impl Beam {
    pub fn new() -> Self {
        let spokes = std::array::from_fn(|i| {
            // Half a step off, so that a wall that is level or upright meets no two of them at once.
            let angle = (i as f64 + 0.25) * std::f64::consts::TAU / ANGLES as f64;
            (angle.cos(), angle.sin())
        });
        Self {
            passed: vec![1.0; ANGLES * RINGS],
            hidden: vec![0.0; ANGLES * RINGS],
            covered: vec![0.0; ANGLES * RINGS],
            touched: false,
            folded: false,
            begin: DVec3::ZERO,
            into: DMat3::IDENTITY,
            spokes,
        }
    }

    /// Aims it along a path, of the Fresnel zone of a wavelength; false where there is no path, its
    /// ends being in one place.
    pub fn aim(&mut self, from: DVec3, to: DVec3, wavelength_m: f64) -> bool {
        self.passed.fill(1.0);
        let along = to - from;
        let length = along.length();
        if !(length.is_finite() && length > 1e-6) {
            return false;
        }
        let axis = along / length;
        let (right, up) = axis.any_orthonormal_pair();
        let width_m = (wavelength_m * length).sqrt();
        self.begin = from;
        self.into = DMat3::from_cols(axis / length, right / width_m, up / width_m).transpose();
        true
    }

    /// From a body's coordinates to those of the beam.
    pub fn local_map(&self, to_world: &DAffine3) -> DAffine3 {
        let matrix = self.into * to_world.matrix3;
        DAffine3 { matrix3: matrix, translation: self.into * (to_world.translation - self.begin) }
    }

    /// How the path meets a box, given by its bounds in a body's coordinates.
    pub fn meet(&self, from_local: &DAffine3, bounds: &Bounds) -> Meeting {
        if bounds.is_empty() {
            return Meeting::Misses;
        }
        let centre = from_local.transform_point3(0.5 * (bounds.low + bounds.high));
        let half = 0.5 * (bounds.high - bounds.low);
        let m = &from_local.matrix3;
        let reach = m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z;
        let (first, last) = ((centre.x - reach.x).max(0.0), (centre.x + reach.x).min(1.0));
        // Said so that what is no number misses.
        let within = first < last;
        if !within {
            return Meeting::Misses;
        }
        let widest = 0.5f64.clamp(first, last);
        let away = |c: f64, r: f64| (c.abs() - r).max(0.0).powi(2);
        if away(centre.y, reach.y) + away(centre.z, reach.z) >= widest * (1.0 - widest) {
            return Meeting::Misses;
        }
        let room = centre.x.min(1.0 - centre.x);
        let (radius, local) = (reach.y.hypot(reach.z), centre.x * (1.0 - centre.x));
        if room > 0.0 && reach.x < 0.1 * room && radius * radius < FINE * FINE * local {
            let scale = 1.0 / local.sqrt();
            let disc = 1.2 * (reach.y * reach.z).sqrt();
            return Meeting::Fine { y: centre.y * scale, z: centre.z * scale, radius: disc * scale };
        }
        Meeting::Crosses
    }

    /// Covers what a triangle hides, its corners in coordinates of the beam. Corners that are no
    /// numbers hide nothing.
    pub fn cover_triangle(&mut self, corners: [DVec3; 3]) {
        if !corners.iter().all(|c| c.is_finite()) {
            return;
        }
        let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
        let radius =
            corners.iter().map(|c| (c.y - centre.y).hypot(c.z - centre.z)).fold(0.0, f64::max) * 1.000_001;
        let (first, count) = spokes_over(centre.y, centre.z, radius);
        for i in 0..count {
            let spoke = (first + i) % ANGLES;
            let (cos, sin) = self.spokes[spoke];
            // Distance from the half-plane's plane, and along the spoke.
            let off = corners.map(|c| c.z * cos - c.y * sin);
            let mut crossings = [(0.0, 0.0); 3];
            let mut found = 0;
            for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                if (off[a] < 0.0) != (off[b] < 0.0) {
                    let t = off[a] / (off[a] - off[b]);
                    let c = corners[a] + (corners[b] - corners[a]) * t;
                    crossings[found] = (c.x, c.y * cos + c.z * sin);
                    found += 1;
                }
            }
            if found == 2
                && let Some((low, high)) = interval(crossings[0], crossings[1])
            {
                self.cover(spoke, low, high);
            }
        }
    }

    /// Covers what a small disc hides, given in parts of the local radius.
    pub fn cover_disc(&mut self, y: f64, z: f64, radius: f64) {
        let (first, count) = spokes_over(y, z, radius);
        for i in 0..count {
            let spoke = (first + i) % ANGLES;
            let (cos, sin) = self.spokes[spoke];
            let (along, off) = (y * cos + z * sin, z * cos - y * sin);
            let half = (radius * radius - off * off).max(0.0).sqrt();
            let (low, high) = ((along - half).max(0.0), (along + half).clamp(0.0, 1.0));
            if low < high {
                self.cover(spoke, low * low, high * high);
            }
        }
    }

    /// Covers the rays of an angle between two values of ρ².
    fn cover(&mut self, spoke: usize, low: f64, high: f64) {
        self.touched = true;
        let (low, high) = (low * RINGS as f64, high * RINGS as f64);
        let rings = &mut self.covered[spoke * RINGS..(spoke + 1) * RINGS];
        let last = (high.ceil() as usize).min(RINGS);
        for (ring, covered) in rings.iter_mut().enumerate().take(last).skip(low as usize) {
            let part = high.min(ring as f64 + 1.0) - low.max(ring as f64);
            *covered += part.max(0.0);
        }
    }

    /// Ends a shape of a body, which stands for a part of it: all where it has but one.
    pub fn fold(&mut self, part: f64) {
        if !std::mem::take(&mut self.touched) {
            return;
        }
        for (hidden, covered) in self.hidden.iter_mut().zip(&mut self.covered) {
            *hidden += part * covered.min(1.0);
            *covered = 0.0;
        }
        self.folded = true;
    }

    /// Ends a body: of the rays that it hides the part `transmission` of the pressure goes on.
    pub fn pass(&mut self, transmission: f64) {
        if !std::mem::take(&mut self.folded) {
            return;
        }
        for (passed, hidden) in self.passed.iter_mut().zip(&mut self.hidden) {
            *passed *= 1.0 - (1.0 - transmission) * hidden.min(1.0);
            *hidden = 0.0;
        }
    }

    /// The mean over the rays of what is left of the pressure.
    pub fn gain(&self) -> f64 {
        self.passed.iter().sum::<f64>() / self.passed.len() as f64
    }
}

/// How a path meets a box.
pub(crate) enum Meeting {
    Misses,
    Crosses,
    /// It is so small that it can be taken for a disc.
    Fine {
        y: f64,
        z: f64,
        radius: f64,
    },
}

/// The spokes that can meet a disc: the first and how many.
fn spokes_over(y: f64, z: f64, radius: f64) -> (usize, usize) {
    let away = y.hypot(z);
    let beside = away > radius;
    if !beside {
        return (0, ANGLES);
    }
    let step = std::f64::consts::TAU / ANGLES as f64;
    let (angle, half) = (z.atan2(y).rem_euclid(std::f64::consts::TAU), (radius / away).asin());
    let first = ((angle - half) / step - 0.25).ceil();
    let count = (((angle + half) / step - 0.25).floor() - first + 1.0).max(0.0);
    (first.rem_euclid(ANGLES as f64) as usize, (count as usize).min(ANGLES))
}

/// The interval of ρ² that a segment covers, given by its ends (s, r): how far along the path and, in
/// diameters, from its axis. ρ² = r² / (4 R² s (1 − s)) with the diameter 2 R as unit.
fn interval(a: (f64, f64), b: (f64, f64)) -> Option<(f64, f64)> {
    let (mut t0, mut t1) = (0.0f64, 1.0f64);
    let (ds, dr) = (b.0 - a.0, b.1 - a.1);
    // Cut to s within the path and r ≥ 0.
    for (value, slope) in [(a.0 - END, ds), (1.0 - END - a.0, -ds), (a.1, dr)] {
        let root = -value / slope;
        match (value >= 0.0, value + slope >= 0.0) {
            (false, false) => return None,
            (true, false) => t1 = t1.min(root),
            (false, true) => t0 = t0.max(root),
            (true, true) => {}
        }
    }
    let within = t0 < t1;
    if !within {
        return None;
    }
    let squared = |t: f64| {
        let (s, r) = ((a.0 + ds * t).clamp(END, 1.0 - END), (a.1 + dr * t).max(0.0));
        r * r / (s * (1.0 - s))
    };
    let (begin, end) = (squared(t0), squared(t1));
    // r² / (s (1 − s)) is quasi-convex along a line; its derivative has one other zero than r = 0.
    let tilt = 1.0 - 2.0 * a.0;
    let bottom = (a.1 * ds * tilt - 2.0 * dr * a.0 * (1.0 - a.0)) / (ds * (dr * tilt + 2.0 * a.1 * ds));
    let mut low = begin.min(end);
    if bottom > t0 && bottom < t1 {
        low = low.min(squared(bottom));
    }
    let high = begin.max(end).min(1.0);
    (low < high).then_some((low, high))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// The gain past triangles in the world, on a path of 4 m along x whose radius is 1 m in the middle.
    fn gain(triangles: &[[DVec3; 3]]) -> f64 {
        let mut beam = Beam::new();
        assert!(beam.aim(DVec3::ZERO, DVec3::X * 4.0, 1.0));
        let into = beam.local_map(&DAffine3::IDENTITY);
        for t in triangles {
            beam.cover_triangle(t.map(|c| into.transform_point3(c)));
        }
        beam.fold(1.0);
        beam.pass(0.0);
        beam.gain()
    }

    /// A screen across the path at x that reaches from y up and to all sides, turned about the axis.
    fn screen(x: f64, y: f64, turn: f64) -> [[DVec3; 3]; 2] {
        let (sin, cos) = turn.sin_cos();
        let at = |y: f64, z: f64| DVec3::new(x, y * cos - z * sin, y * sin + z * cos);
        let (low, high) = (-50.0, 50.0);
        [[at(y, low), at(high, low), at(high, high)], [at(y, low), at(high, high), at(y, high)]]
    }

    #[test]
    fn a_screen_covers_the_segment_of_a_disc() {
        // At x the radius is ½ √(x (4 − x)); a chord at p of it leaves 1 − (acos p − p √(1 − p²)) / π.
        let mut worst = 0.0f64;
        for x in [0.5, 2.0, 3.2f64] {
            let radius = 0.5 * (x * (4.0 - x)).sqrt();
            for turn in [0.0, 0.3, 1.5, 4.0] {
                for step in -12..=12 {
                    let p = f64::from(step) / 10.0;
                    let q = p.clamp(-1.0, 1.0);
                    let covered = (q.acos() - q * (1.0 - q * q).sqrt()) / std::f64::consts::PI;
                    let found = gain(&screen(x, p * radius, turn));
                    worst = worst.max((found - (1.0 - covered)).abs());
                }
            }
        }
        assert!(worst < 0.009, "{worst}");
    }

    #[test]
    fn slanted_triangles_cover_what_rays_find() {
        // Against rays along ρ = const, walked in small steps; triangles at any slant, also along the path.
        let random = Random::new(5, 6);
        let mut worst = 0.0f64;
        for round in 0..12 {
            let value = |i: u64| random.uniform(round * 9 + i);
            let t: [DVec3; 3] = std::array::from_fn(|i| {
                let i = 3 * i as u64;
                DVec3::new(4.0 * value(i), 3.0 * value(i + 1) - 1.5, 3.0 * value(i + 2) - 1.5)
            });
            let normal = (t[1] - t[0]).cross(t[2] - t[0]);
            let inside =
                |p: DVec3| (0..3).all(|i| (t[(i + 1) % 3] - t[i]).cross(p - t[i]).dot(normal) >= 0.0);
            let (mut hit, mut all) = (0, 0);
            for ring in 0..24 {
                for spoke in 0..96 {
                    let rho = ((f64::from(ring) + 0.5) / 24.0).sqrt();
                    let angle = f64::from(spoke) / 96.0 * std::f64::consts::TAU;
                    let point = |s: f64| {
                        let r = 2.0 * rho * (s * (1.0 - s)).sqrt();
                        DVec3::new(4.0 * s, r * angle.cos(), r * angle.sin())
                    };
                    let side = |s: f64| (point(s) - t[0]).dot(normal);
                    let steps = 400;
                    all += 1;
                    for i in 0..steps {
                        let s = [i, i + 1].map(|i| f64::from(i) / f64::from(steps));
                        let (a, b) = (side(s[0]), side(s[1]));
                        if (a < 0.0) != (b < 0.0) && inside(point(s[0]).lerp(point(s[1]), a / (a - b))) {
                            hit += 1;
                            break;
                        }
                    }
                }
            }
            let share = f64::from(hit) / f64::from(all);
            worst = worst.max((1.0 - gain(&[t]) - share).abs());
        }
        assert!(worst < 0.02, "{worst}");
    }

    #[test]
    fn more_covers_no_less() {
        let random = Random::new(8, 9);
        let mut triangles = Vec::new();
        let mut last = 1.0;
        for i in 0..40 {
            let corner = |k: u64| {
                let v = |n: u64| random.uniform(i * 9 + k * 3 + n);
                DVec3::new(4.0 * v(0), 2.0 * v(1) - 1.0, 2.0 * v(2) - 1.0)
            };
            triangles.push([corner(0), corner(1), corner(2)]);
            let now = gain(&triangles);
            assert!((0.0..=last + 1e-12).contains(&now));
            last = now;
        }
        assert!(last < 0.2);
    }

    #[test]
    fn what_is_no_triangle_hides_nothing() {
        let p = DVec3::new(2.0, 0.1, 0.2);
        for t in [
            [p, p, p],
            [p, p + DVec3::Y, p + DVec3::Y * 2.0],
            [p, DVec3::NAN, p + DVec3::Y],
            [p, DVec3::INFINITY, p + DVec3::Z],
        ] {
            assert!(gain(&[t]) > 0.999, "{t:?}");
        }
        let mut beam = Beam::new();
        assert!(!beam.aim(p, p, 1.0) && !beam.aim(p, DVec3::NAN, 1.0));
    }
}
