//! A flat patch of a surface as a secondary source (Takala & Hahn 1992, §5.4).
//!
//! A source of pressure 1 at 1 m gives a point of the patch the intensity 1 / d₁², and so a piece of area dA the
//! power cos θ₁ dA / d₁². What is not absorbed leaves again, in part evenly after Lambert's law,
//! in part in a lobe about the mirror direction: the share that goes to a solid angle is
//!
//! f = diffuse · cos θ₂ / π + (1 − diffuse) · (n + 2) / 2π · cosⁿ φ · cos θ₂ / max(cos θ₁, cos θ₂),
//!
//! where φ is the angle to the mirror direction and n the sharpness, 1 at least (Phong's lobe with the
//! foreshortening of Neumann & Neumann, which keeps a mirror seen aslant as bright as one seen straight).
//! Over the hemisphere f integrates to 1 at most, and to 1 where the lobe stands upright, so that no
//! more leaves than came. The pressure gain is the root of the intensity at the microphone,
//!
//! g² = (1 − absorption) ∫ cos θ₁ / d₁² · f / d₂² dA.
//!
//! A patch that stands for a bent piece has a wider lobe and a soft horizon: cos θ₁ and cos θ₂ are means of
//! max(0, cos θ) over normals spread as those of the piece.
//!
//! A patch small against its distances has the area times the integrand. For a wide one and a sharp
//! lobe g comes to √(1 − absorption) / (d₁ + d₂), the image source. Distances are softened by
//! [`NEAR_M`], d² → d² + NEAR², so that a patch which passes through source or microphone fades there.

use std::f64::consts::{FRAC_1_PI, TAU};

use glam::{DAffine3, DVec2, DVec3};

use super::Material;
use crate::space::microphone::NEAR_M;

/// A rectangle that stands for a piece of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Patch {
    pub centre: DVec3,
    /// From the centre to the middle of one side, and at right angles to it to that of another; its front is
    /// where `half_u` × `half_v` points to.
    pub half_u: DVec3,
    pub half_v: DVec3,
    /// How much the surface bends: the mean square angle, in one direction, by which a mirrored ray strays.
    pub bend: f64,
}

/// What a patch does to a sound.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Reflection {
    pub point: DVec3,
    pub length_m: f64,
    pub gain: f64,
}

impl Patch {
    pub const NONE: Self = Self { centre: DVec3::ZERO, half_u: DVec3::ZERO, half_v: DVec3::ZERO, bend: 0.0 };

    pub fn area_m2(&self) -> f64 {
        4.0 * self.half_u.cross(self.half_v).length()
    }

    pub fn posed(&self, to_world: &DAffine3) -> Self {
        Self {
            centre: to_world.transform_point3(self.centre),
            half_u: to_world.transform_vector3(self.half_u),
            half_v: to_world.transform_vector3(self.half_v),
            bend: self.bend,
        }
    }

    /// Part of the way to another patch.
    pub fn toward(&self, other: &Self, part: f64) -> Self {
        Self {
            centre: self.centre.lerp(other.centre, part),
            half_u: self.half_u.lerp(other.half_u, part),
            half_v: self.half_v.lerp(other.half_v, part),
            bend: self.bend + (other.bend - self.bend) * part,
        }
    }

    /// What goes from a source over the patch to a microphone. The path goes by the point of the patch with the
    /// shortest way, the mirror point where that lies on it: so its delay is that of the image
    /// source there, and never changes faster than what moves.
    ///
    /// Only where both are on one side of the patch's plane, on its front unless `both_sides`, does
    /// anything arrive.
    pub fn reflect(
        &self,
        material: &Material,
        both_sides: bool,
        source: DVec3,
        microphone: DVec3,
    ) -> Reflection {
        let normal = self.half_u.cross(self.half_v);
        let (area, long) = (normal.length(), self.half_u.length());
        if !(area > 0.0 && area.is_finite() && self.centre.is_finite()) {
            let point = if self.centre.is_finite() { self.centre } else { source };
            let length_m = source.distance(point) + point.distance(microphone);
            return Reflection { point, length_m, gain: 0.0 };
        }
        let (normal, along) = (normal / area, self.half_u / long);
        let across = normal.cross(along);
        let half = DVec2::new(long, area / long);
        let local = |p: DVec3| {
            let p = p - self.centre;
            (DVec2::new(p.dot(along), p.dot(across)), p.dot(normal))
        };
        let ((s, s_high), (m, m_high)) = (local(source), local(microphone));
        let corner = shortest(half, (s, s_high.abs()), (m, m_high.abs()));
        let point = self.centre + along * corner.x + across * corner.y;
        let lobes = Lobes::new(material, self.bend);
        let from = |side: f64| {
            if lobes.horizon == 0.0 && !(side * s_high > 0.0 && side * m_high > 0.0) {
                return 0.0;
            }
            transfer(half, (s, side * s_high), (m, side * m_high), corner, &lobes)
        };
        let energy = (1.0 - material.absorption) * (from(1.0) + if both_sides { from(-1.0) } else { 0.0 });
        Reflection {
            point,
            length_m: source.distance(point) + point.distance(microphone),
            gain: energy.max(0.0).sqrt(),
        }
    }
}

/// How much of what a point receives it sends which way.
pub(crate) struct Lobes {
    even: f64,
    peak: f64,
    sharpness: f64,
    /// How far behind its mean plane a bent patch still faces a source, as a cosine.
    horizon: f64,
}

impl Lobes {
    /// Those of a material on a patch that bends: the lobe is wider by what mirrored rays stray.
    pub fn new(material: &Material, bend: f64) -> Self {
        let sharpness = (1.0 / (1.0 / material.sharpness + bend)).max(1.0);
        // Normals stray by half of what rays do; that of the mean of max(0, cos θ) over them is met at θ = 90°.
        let horizon = (0.8 * bend.sqrt()).min(1.0);
        // The soft horizon adds to the hemisphere; so that no more leaves than came.
        let less = 1.0 / (1.0 + horizon * horizon / 3.0);
        let diffuse = material.diffuse;
        Self {
            even: less * diffuse * FRAC_1_PI,
            peak: less * (1.0 - diffuse) * (sharpness + 2.0) / TAU,
            sharpness,
            horizon,
        }
    }

    /// The cosine at which the patch is seen: max(0, cos θ), softened about 0 where it bends.
    fn facing(&self, cos: f64) -> f64 {
        if cos >= self.horizon {
            cos
        } else if cos <= -self.horizon {
            0.0
        } else {
            (cos + self.horizon).powi(2) / (4.0 * self.horizon)
        }
    }

    /// cos θ₁ f: what comes in at a cosine and goes into a unit of solid angle at another, given cos φ too.
    pub fn passed(&self, cos_in: f64, cos_out: f64, cos_mirror: f64) -> f64 {
        let (cos_in, cos_out) = (self.facing(cos_in), self.facing(cos_out));
        let both = cos_in * cos_out;
        if both == 0.0 {
            return 0.0;
        }
        let lobe = if self.peak > 0.0 && cos_mirror > 0.0 {
            self.peak * (self.sharpness * cos_mirror.min(1.0).ln()).exp() / cos_in.max(cos_out)
        } else {
            0.0
        };
        both * (self.even + lobe)
    }
}

/// The point of a rectangle about the origin with the shortest way from `s` over it to `m`, each
/// given by its foot and its height.
fn shortest(half: DVec2, (s, s_high): (DVec2, f64), (m, m_high): (DVec2, f64)) -> DVec2 {
    let between = |a: f64, b: f64| if a + b > 0.0 { a / (a + b) } else { 0.5 };
    let mirror = s.lerp(m, between(s_high, m_high));
    if mirror.abs().cmple(half).all() {
        return mirror;
    }
    // The way is a convex function of the point: where its least is outside, it is least on a side. Unfolded
    // about that side, the shortest way is straight.
    let (mut best, mut least) = (mirror.clamp(-half, half), f64::INFINITY);
    for side in [half.x, -half.x, half.y, -half.y].into_iter().enumerate() {
        let (fixed, free) = if side.0 < 2 { (0, 1) } else { (1, 0) };
        let (a, b) = (s_high.hypot(s[fixed] - side.1), m_high.hypot(m[fixed] - side.1));
        let at = (s[free] + (m[free] - s[free]) * between(a, b)).clamp(-half[free], half[free]);
        let way = a.hypot(at - s[free]) + b.hypot(at - m[free]);
        if way < least {
            least = way;
            best[fixed] = side.1;
            best[free] = at;
        }
    }
    best
}

/// Nodes and weights of Gauss and Legendre's quadrature over [0, 1].
const GAUSS: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_9, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];

/// A piece of an axis is cut into strips of this length on the scale of arsinh, and into so many at most.
const STRIP: f64 = 2.0;
const STRIPS: usize = 6;

/// Nodes of one axis at most: six pieces. Few walls need more than a quarter of them.
const NODES: usize = 6 * STRIPS * GAUSS.len();

/// The integral over the rectangle. Its integrand peaks at the feet of source and microphone and at the mirror
/// point; so each axis is cut there, and each piece is sampled evenly on the scale of arsinh.
fn transfer(half: DVec2, s: (DVec2, f64), m: (DVec2, f64), at: DVec2, lobes: &Lobes) -> f64 {
    let soft = NEAR_M * NEAR_M;
    let (s2, m2) = (s.1 * s.1 + soft, m.1 * m.1 + soft);
    let (d1, d2) = (((at - s.0).length_squared() + s2).sqrt(), ((at - m.0).length_squared() + m2).sqrt());
    let foot = (2.0 / lobes.sharpness).sqrt().min(1.0) * d1 * d2 / (d1 + d2);
    let axis = |i: usize| Nodes::new(half[i], [(s.0[i], s2.sqrt()), (at[i], foot), (m.0[i], m2.sqrt())]);
    let (xs, ys) = (axis(0), axis(1));
    let mut sum = 0.0;
    for &(x, x_weight) in xs.all() {
        let (sx, mx) = (x - s.0.x, m.0.x - x);
        for &(y, y_weight) in ys.all() {
            let (sy, my) = (y - s.0.y, m.0.y - y);
            let (near, far) = (sx * sx + sy * sy + s2, mx * mx + my * my + m2);
            let (d1, d2) = (near.sqrt(), far.sqrt());
            // Angles are true ones: softened, a mirror would never be met.
            let true_m2 = ((near - soft) * (far - soft)).max(f64::MIN_POSITIVE);
            let mirror = (sx * mx + sy * my + s.1 * m.1) / true_m2.sqrt();
            sum += x_weight * y_weight * lobes.passed(s.1 / d1, m.1 / d2, mirror) / (near * far);
        }
    }
    sum
}

/// Where one axis is sampled, and the weights.
struct Nodes {
    nodes: [(f64, f64); NODES],
    count: usize,
}

impl Nodes {
    /// Over [−half, half], with peaks at some places of some width each.
    fn new(half: f64, mut peaks: [(f64, f64); 3]) -> Self {
        peaks.iter_mut().for_each(|peak| peak.0 = peak.0.clamp(-half, half));
        // A narrow peak near by makes a wide one as steep.
        let narrow =
            |at: f64| peaks.iter().map(|&(p, width)| width.hypot(p - at)).fold(f64::INFINITY, f64::min);
        let mut peaks = peaks.map(|(at, _)| (at, narrow(at)));
        peaks.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut nodes = Self { nodes: [(0.0, 0.0); NODES], count: 0 };
        nodes.piece(peaks[0], -half);
        for [a, b] in [[peaks[0], peaks[1]], [peaks[1], peaks[2]]] {
            let middle = 0.5 * (a.0 + b.0);
            nodes.piece(a, middle);
            nodes.piece(b, middle);
        }
        nodes.piece(peaks[2], half);
        nodes
    }

    fn all(&self) -> &[(f64, f64)] {
        &self.nodes[..self.count]
    }

    fn piece(&mut self, (peak, width): (f64, f64), end: f64) {
        if end == peak {
            return;
        }
        let length = ((end - peak) / width).asinh();
        let strips = (length.abs() / STRIP).ceil().clamp(1.0, STRIPS as f64);
        let strip = length / strips;
        for number in 0..strips as usize {
            for (part, weight) in GAUSS {
                let u = (number as f64 + part) * strip;
                self.nodes[self.count] = (peak + width * u.sinh(), (weight * strip * width * u.cosh()).abs());
                self.count += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use crate::space::surroundings::{form::Form, meshes};

    const MIRROR: Material =
        Material { absorption: 0.0, diffuse: 0.0, sharpness: 20_000.0, transmission: 0.1 };
    const MATT: Material = Material { absorption: 0.0, diffuse: 1.0, sharpness: 10.0, transmission: 0.1 };

    /// An upright wall of a width and height about a centre, its front facing +Z.
    fn wall(width: f64, height: f64) -> Patch {
        Patch {
            centre: DVec3::ZERO,
            half_u: DVec3::X * width / 2.0,
            half_v: DVec3::Y * height / 2.0,
            bend: 0.0,
        }
    }

    fn db(ratio: f64) -> f64 {
        20.0 * ratio.log10()
    }

    #[test]
    fn no_more_leaves_than_came() {
        // Lobes over the hemisphere, for every incidence: midpoints in cos θ and angle.
        for diffuse in [0.0, 0.3, 1.0] {
            for sharpness in [1.0, 2.0, 10.0, 60.0] {
                let lobes = Lobes::new(&Material { diffuse, sharpness, ..MATT }, 0.0);
                let mut upright = 0.0;
                for tilt in [0.0, 0.5, 1.0, 1.5f64] {
                    let mirror = DVec3::new(tilt.sin(), 0.0, tilt.cos());
                    let (rings, spokes) = (400, 400);
                    let mut sum = 0.0;
                    for ring in 0..rings {
                        let z = (f64::from(ring) + 0.5) / f64::from(rings);
                        for spoke in 0..spokes {
                            let angle = f64::from(spoke) / f64::from(spokes) * TAU;
                            let r = (1.0 - z * z).sqrt();
                            let out = DVec3::new(r * angle.cos(), r * angle.sin(), z);
                            sum += lobes.passed(tilt.cos(), z, out.dot(mirror)) / tilt.cos();
                        }
                    }
                    let total = sum * TAU / f64::from(rings * spokes);
                    assert!(total < 1.0 + 5e-4, "{diffuse} {sharpness} {tilt}: {total}");
                    upright = if tilt == 0.0 { total } else { upright };
                }
                assert!((upright - 1.0).abs() < 1e-3, "{diffuse} {sharpness}: {upright}");
            }
        }
    }

    #[test]
    fn a_ball_scatters_what_its_triangles_do() {
        // Against the formula of a point source summed over thousands of triangles that face both; matt, in and
        // out of the ball's shadow.
        let mesh = meshes::ball(1.0, 60);
        let triangles = Form::new(&mesh, 1);
        let form = Form::new(&mesh, 8);
        let (mut low, mut high) = (0.0f64, 0.0f64);
        for angle in [0.0, 0.5, 1.0, 1.5, 2.0f64] {
            for tilt in [0.0, 0.7] {
                let s = DVec3::new(6.0 * f64::cos(tilt), 6.0 * f64::sin(tilt), 0.0);
                let m = DVec3::new(9.0 * angle.cos(), 0.0, 9.0 * angle.sin());
                let mut expected = 0.0;
                for i in 0..mesh.face_sizes.len() * 2 {
                    let [a, b, c] = triangles.corners(i);
                    let (at, normal) = ((a + b + c) / 3.0, 0.5 * (b - a).cross(c - a));
                    let (to_s, to_m) = (s - at, m - at);
                    let (d1, d2) = (to_s.length(), to_m.length());
                    let cos_out = to_m.dot(normal.normalize_or_zero()).max(0.0) / d2;
                    let power = to_s.dot(normal).max(0.0) / d1.powi(3);
                    expected += power * cos_out * FRAC_1_PI / d2.powi(2);
                }
                let reflect = |p: &Patch| p.reflect(&MATT, false, s, m).gain.powi(2);
                let error_db = 0.5 * db(form.patches.iter().map(reflect).sum::<f64>() / expected);
                (low, high) = (low.min(error_db), high.max(error_db));
            }
        }
        println!("ball of eight patches: {low:.2} to {high:.2} dB");
        assert!(low > -2.5 && high < 2.5, "{low} {high} dB");
    }

    #[test]
    fn a_wide_mirror_is_the_image_source() {
        let wide = wall(300.0, 300.0);
        let mut worst = (0.0f64, 0.0f64);
        for (s, m) in [
            (DVec3::new(0.0, 0.0, 2.0), DVec3::new(0.0, 0.0, 5.0)),
            (DVec3::new(-4.0, 1.0, 3.0), DVec3::new(6.0, -2.0, 4.0)),
            (DVec3::new(3.0, 0.0, 1.0), DVec3::new(-3.0, 0.5, 9.0)),
        ] {
            let image = (s * DVec3::new(1.0, 1.0, -1.0)).distance(m);
            let found = wide.reflect(&MIRROR, false, s, m);
            worst.0 = worst.0.max((found.length_m - image).abs());
            worst.1 = worst.1.max(db(found.gain * image).abs());
        }
        println!("image source: {:e} m, {:.3} dB", worst.0, worst.1);
        assert!(worst.0 < 1e-12 && worst.1 < 0.15, "{worst:?}");
    }

    #[test]
    fn a_wide_matt_wall_has_its_closed_form() {
        // Source and microphone in one place before it: ∫ h² / π d⁶ dA = 1 / 2 h².
        for h in [2.0, 7.0] {
            let at = DVec3::Z * h;
            let found = wall(400.0, 400.0).reflect(&MATT, false, at, at);
            let soft = h * h + NEAR_M * NEAR_M;
            let error_db = db(found.gain * 2.0f64.sqrt() * soft / h);
            println!("{h} m: {error_db:.4} dB");
            assert!(error_db.abs() < 0.05, "{h}: {error_db}");
        }
    }

    #[test]
    fn a_small_wall_counts_by_its_area_and_cosines() {
        let (s, m) = (DVec3::new(-3.0, 0.0, 4.0), DVec3::new(0.0, 6.0, 8.0));
        let found = wall(0.02, 0.01).reflect(&MATT, false, s, m);
        let (d1, d2) = (25.0 + NEAR_M * NEAR_M, 100.0 + NEAR_M * NEAR_M);
        let expected = 0.0002 * (4.0 / d1.sqrt()) / d1 * (8.0 / d2.sqrt()) * FRAC_1_PI / d2;
        assert!((found.gain * found.gain / expected - 1.0).abs() < 1e-4);
        let half = Material { absorption: 0.75, ..MATT };
        assert!((wall(0.02, 0.01).reflect(&half, false, s, m).gain / found.gain - 0.5).abs() < 1e-12);
    }

    #[test]
    fn the_quadrature_agrees_with_a_fine_grid() {
        let random = Random::new(3, 1);
        let mut worst = 0.0f64;
        for i in 0..40 {
            let v = |k: u64| random.uniform(16 * i + k);
            let half = DVec2::new(0.2 * 30.0f64.powf(v(0)), 0.2 * 30.0f64.powf(v(1)));
            let foot = |k: u64| (DVec2::new(2.4 * v(k) - 1.2, 2.4 * v(k + 1) - 1.2)) * half;
            let (s, m) = ((foot(2), 0.3 + 3.0 * v(4)), (foot(5), 0.3 + 3.0 * v(7)));
            let lobes = Lobes::new(&Material { diffuse: 0.5, sharpness: 2.0 + 20.0 * v(8), ..MATT }, 0.0);
            let found = transfer(half, s, m, shortest(half, s, m), &lobes);
            let n = 600;
            let soft = NEAR_M * NEAR_M;
            let mut sum = 0.0;
            for a in 0..n {
                for b in 0..n {
                    let mid = |i: i32| 2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0;
                    let p = DVec2::new(mid(a), mid(b)) * half;
                    let (to_s, to_m) = ((s.0 - p).extend(s.1), (m.0 - p).extend(m.1));
                    let (d1, d2) = (to_s.length_squared() + soft, to_m.length_squared() + soft);
                    let mirror = to_s * DVec3::new(-1.0, -1.0, 1.0);
                    let cos_mirror = mirror.normalize().dot(to_m.normalize());
                    sum += lobes.passed(s.1 / d1.sqrt(), m.1 / d2.sqrt(), cos_mirror) / (d1 * d2);
                }
            }
            let expected = sum * 4.0 * half.x * half.y / f64::from(n * n);
            worst = worst.max(0.5 * db(found / expected).abs());
        }
        println!("quadrature: {worst:.3} dB");
        assert!(worst < 0.15, "{worst} dB");
    }

    #[test]
    fn the_way_is_the_shortest_there_is() {
        let random = Random::new(4, 1);
        for i in 0..200 {
            let v = |k: u64| 6.0 * random.uniform(16 * i + k) - 3.0;
            let half = DVec2::new(v(0).abs(), v(1).abs());
            let (s, m) = ((DVec2::new(v(2), v(3)), v(4).abs()), (DVec2::new(v(5), v(6)), v(7).abs()));
            let way = |p: DVec2| (p - s.0).length().hypot(s.1) + (p - m.0).length().hypot(m.1);
            let found = way(shortest(half, s, m));
            for k in 0..100 {
                let u = |n: u64| 2.0 * random.uniform(10_000 + 300 * i + 2 * k + n) - 1.0;
                assert!(found <= way(DVec2::new(u(0), u(1)) * half) + 1e-12);
            }
        }
    }

    #[test]
    fn one_side_hears_and_odd_patches_are_silent() {
        let (s, m) = (DVec3::new(0.0, 0.0, 2.0), DVec3::new(1.0, 0.0, 3.0));
        let flip = DVec3::new(1.0, 1.0, -1.0);
        let gain = |both, s, m| wall(2.0, 2.0).reflect(&MATT, both, s, m).gain;
        assert!(gain(false, s, m) > 0.01);
        assert_eq!(gain(false, s * flip, m * flip), 0.0);
        assert_eq!(gain(true, s * flip, m * flip), gain(false, s, m));
        assert_eq!(gain(true, s * flip, m), 0.0);
        for odd in [DVec3::ZERO, DVec3::NAN, DVec3::INFINITY, DVec3::Y] {
            let patch = Patch { half_u: odd, ..wall(2.0, 2.0) };
            let found = patch.reflect(&MATT, true, s, m);
            assert!(found.gain == 0.0 && found.length_m.is_finite(), "{odd}");
        }
        let nowhere = Patch { centre: DVec3::NAN, ..wall(2.0, 2.0) };
        assert!(nowhere.reflect(&MATT, true, s, m).length_m.is_finite());
    }

    #[test]
    fn source_and_microphone_are_exchangeable() {
        // Reciprocity: the formula has no favourite end.
        let (s, m) = (DVec3::new(-1.0, 0.4, 2.0), DVec3::new(2.0, 0.0, 0.7));
        let material = Material { diffuse: 0.4, ..MATT };
        let (a, b) =
            (wall(3.0, 2.0).reflect(&material, false, s, m), wall(3.0, 2.0).reflect(&material, false, m, s));
        assert!((a.gain / b.gain - 1.0).abs() < 1e-12 && (a.length_m - b.length_m).abs() < 1e-12);
    }
}
