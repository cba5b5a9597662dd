//! Some triangles that lie side by side, measured at once.

use super::tree::{Lanes, WIDTH};

/// What is squared and rounded is off by less than this part of the squares of all that it was made of.
const ROUNDING: f32 = 1e-4;
/// The plane of a triangle is of use where the sine of the angle at its first corner, squared, is larger.
const THINNEST: f32 = 0.01;

/// Corners of as many triangles as a node of the tree has children: first, second and third, each as x, y and z.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Leaf([[Lanes; 3]; 3]);

impl Leaf {
    /// Takes up where a triangle is.
    pub fn set(&mut self, lane: usize, corners: [[f32; 3]; 3]) {
        for (lanes, coordinate) in self.0.as_flattened_mut().iter_mut().zip(corners.as_flattened()) {
            lanes[lane] = *coordinate;
        }
    }

    /// Which of the triangles may be within a distance, squared, of a point, a bit for each; of those that are not, few.
    // No closures here, nor functions of the standard library: what is not inlined knows nothing of vector units.
    #[inline(always)]
    pub fn may_be_within(&self, point: [f32; 3], squared_m2: f32) -> u32 {
        let Self([a, b, c]) = self;
        let mut near = [0u32; WIDTH];
        for (lane, near) in near.iter_mut().enumerate() {
            let (a, b, c) = (at(a, lane), at(b, lane), at(c, lane));
            let (ab, ac, bc) = (minus(b, a), minus(c, a), minus(c, b));
            let (ap, bp) = (minus(point, a), minus(point, b));
            let (bb, cc) = (dot(ab, ab), dot(ac, ac));
            let (along_b, along_c) = (dot(ab, ap), dot(ac, ap));
            let sides = lesser(
                lesser(beyond(ap, ab, along_b / bb), beyond(ap, ac, along_c / cc)),
                beyond(bp, bc, dot(bc, bp) / dot(bc, bc)),
            );
            let normal = cross(ab, ac);
            // The doubled area, squared, and as parts of it the weights of b and c.
            let (square, between) = (dot(normal, normal), dot(ab, ac));
            let (for_b, for_c) = (cc * along_b - between * along_c, bb * along_c - between * along_b);
            let is_over = (for_b > 0.0) & (for_c > 0.0) & (for_b + for_c < square);
            let above = dot(normal, ap);
            let found = if is_over { above * above / square } else { sides };
            let is_plain = square > THINNEST * bb * cc;
            let least = found - ROUNDING * (dot(ap, ap) + bb + cc);
            // What is no number may be anywhere.
            *near = u32::from(!is_plain | (least <= squared_m2) | least.is_nan());
        }
        let mut bits = 0;
        for (lane, near) in near.iter().enumerate() {
            bits |= near << lane;
        }
        bits
    }
}

type Vector = [f32; 3];

#[inline(always)]
fn at(lanes: &[Lanes; 3], lane: usize) -> Vector {
    [lanes[0][lane], lanes[1][lane], lanes[2][lane]]
}

#[inline(always)]
fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn dot(a: Vector, b: Vector) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// How far, squared, a point is from a part of a side, both from where the side begins; of a part that is not on it,
/// from its end.
#[inline(always)]
fn beyond(point: Vector, side: Vector, part: f32) -> f32 {
    let part = lesser(greater(part, 0.0), 1.0);
    let away = [point[0] - part * side[0], point[1] - part * side[1], point[2] - part * side[2]];
    dot(away, away)
}

// Other than those of the standard library these need not heed what is no number.
#[inline(always)]
pub(super) fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
pub(super) fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::super::triangle::nearest;
    use super::*;
    use glam::DVec3;
    use proptest::prelude::*;

    fn exact(point: [f32; 3], corners: [[f32; 3]; 3]) -> f64 {
        let wide = |p: [f32; 3]| DVec3::from(p.map(f64::from));
        nearest(wide(point), corners.map(wide)).squared_m2
    }

    fn asked(point: [f32; 3], corners: [[f32; 3]; 3], squared_m2: f32) -> bool {
        let mut leaf = Leaf::default();
        // Far from it are the others.
        (0..WIDTH).for_each(|lane| leaf.set(lane, [[9e5, 8e5, 7e5], [9e5, 9e5, 7e5], [8e5, 9e5, 7e5]]));
        leaf.set(5, corners);
        let found = leaf.may_be_within(point, squared_m2);
        assert!(found & !(1 << 5) == 0 || point.iter().any(|x| x.is_nan()), "the others are far");
        found >> 5 & 1 == 1
    }

    fn place() -> impl Strategy<Value = [f32; 3]> {
        let coordinate = prop_oneof![4 => -2.0..2.0f32, 1 => Just(0.0f32), 1 => Just(1.0f32)];
        prop::array::uniform3(coordinate)
    }

    proptest! {
        #[test]
        fn none_is_missed([a, b, c, point] in prop::array::uniform4(place()), thin in 0..7i32, wide in -4..5i32, t in -0.5..1.5f32) {
            // Down to needles, and to a line and a point; as small as a grain of sand or as large as a town.
            let towards = |from: f32, to: f32, part: f32| -> f32 { from + part * (to - from) };
            let thinness = 10.0f32.powi(-thin) * if thin == 6 { 0.0 } else { 1.0 };
            let c: [f32; 3] = std::array::from_fn(|i: usize| towards(towards(a[i], b[i], t), c[i], thinness));
            let size = 10.0f32.powi(wide);
            let [a, b, c, point] = [a, b, c, point].map(|p: [f32; 3]| p.map(|x| x * size));
            let squared = exact(point, [a, b, c]);
            prop_assert!(asked(point, [a, b, c], squared as f32 * (1.0 + 1e-6)));
        }

        #[test]
        fn few_are_asked_in_vain([a, b, c, point] in prop::array::uniform4(place())) {
            let wide = |p: [f32; 3]| DVec3::from(p.map(f64::from));
            let (ab, ac) = (wide(b) - wide(a), wide(c) - wide(a));
            prop_assume!(ab.cross(ac).length() > 0.2 * ab.length() * ac.length());
            let squared = exact(point, [a, b, c]);
            let around = wide(point).distance_squared(wide(a)) + ab.length_squared() + ac.length_squared();
            prop_assume!(squared > 3e-4 * around);
            prop_assert!(!asked(point, [a, b, c], (squared - 2e-4 * around) as f32));
        }
    }

    #[test]
    fn what_is_no_number_is_asked() {
        assert!(asked([f32::NAN, 0.0, 0.0], [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 1.0, 0.0]], 1e-6));
        assert!(asked([0.0; 3], [[f32::NAN; 3], [2.0, 0.0, 0.0], [1.0, 1.0, 0.0]], 1e-6));
        assert!(asked([0.0; 3], [[1e30, 0.0, 0.0], [1.1e30, 0.0, 0.0], [1e30, 1e29, 0.0]], 1.0));
    }
}
