//! The point of a triangle that is closest to another point.

use glam::DVec3;

/// A triangle that is lower than this part of its longest side is taken as its sides.
const FLATTEST: f64 = 1e-7;

/// The closest point of a triangle, as weights of its corners that add up to 1, and how far it is, squared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Nearest {
    pub weights: [f64; 3],
    pub squared_m2: f64,
}

/// The point of a triangle that is closest to `point`. With a corner that is no number it is nowhere: the distance is
/// no number either.
#[inline]
pub(super) fn nearest(point: DVec3, [a, b, c]: [DVec3; 3]) -> Nearest {
    let (ab, ac, ap) = (b - a, c - a, point - a);
    let (bb, bc, cc) = (ab.length_squared(), ab.dot(ac), ac.length_squared());
    // How far the point is ahead along both sides, seen from a; from b and c it is as far less.
    let (along_b, along_c) = (ab.dot(ap), ac.dot(ap));
    let (b_along_b, b_along_c) = (along_b - bb, along_c - bc);
    let (c_along_b, c_along_c) = (along_b - bc, along_c - cc);
    let at = |v: f64, w: f64| {
        let foot = ap - v * ab - w * ac;
        Nearest { weights: [1.0 - v - w, v, w], squared_m2: foot.length_squared() }
    };
    if along_b <= 0.0 && along_c <= 0.0 {
        return at(0.0, 0.0);
    }
    if b_along_b >= 0.0 && b_along_c <= b_along_b {
        return at(1.0, 0.0);
    }
    if c_along_c >= 0.0 && c_along_b <= c_along_c {
        return at(0.0, 1.0);
    }
    // The weights of c, b and a at the foot of the perpendicular, times the squared doubled area.
    let for_c = along_b * b_along_c - b_along_b * along_c;
    if for_c <= 0.0 && along_b >= 0.0 && b_along_b <= 0.0 {
        return at(along_b / bb, 0.0);
    }
    let for_b = c_along_b * along_c - along_b * c_along_c;
    if for_b <= 0.0 && along_c >= 0.0 && c_along_c <= 0.0 {
        return at(0.0, along_c / cc);
    }
    let for_a = b_along_b * c_along_c - c_along_b * b_along_c;
    let (from_b, from_c) = (b_along_c - b_along_b, c_along_b - c_along_c);
    if for_a <= 0.0 && from_b >= 0.0 && from_c >= 0.0 {
        let w = from_b / (from_b + from_c);
        return at(1.0 - w, w);
    }
    let doubled = bb * cc - bc * bc;
    if doubled > (FLATTEST * bb.max(cc)).powi(2) {
        return at((cc * along_b - bc * along_c) / doubled, (bb * along_c - bc * along_b) / doubled);
    }
    sides(point, [a, b, c])
}

/// The closest point of the sides alone.
#[cold]
fn sides(point: DVec3, [a, b, c]: [DVec3; 3]) -> Nearest {
    let on = |from: DVec3, to: DVec3| {
        let (side, away) = (to - from, point - from);
        let square = side.length_squared();
        let along = if square > 0.0 { (side.dot(away) / square).clamp(0.0, 1.0) } else { 0.0 };
        (along, (away - along * side).length_squared())
    };
    let (ab, bc, ca) = (on(a, b), on(b, c), on(c, a));
    let found = [
        Nearest { weights: [1.0 - ab.0, ab.0, 0.0], squared_m2: ab.1 },
        Nearest { weights: [0.0, 1.0 - bc.0, bc.0], squared_m2: bc.1 },
        Nearest { weights: [ca.0, 0.0, 1.0 - ca.0], squared_m2: ca.1 },
    ];
    let nearer = |a: Nearest, b: Nearest| if b.squared_m2 < a.squared_m2 { b } else { a };
    nearer(nearer(found[0], found[1]), found[2])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(corners: [DVec3; 3], weights: [f64; 3]) -> DVec3 {
        weights[0] * corners[0] + weights[1] * corners[1] + weights[2] * corners[2]
    }

    fn points() -> impl Strategy<Value = [DVec3; 4]> {
        let coordinate = prop_oneof![4 => -2.0..2.0f64, 1 => Just(0.0), 1 => Just(1.0)];
        let point = prop::array::uniform3(coordinate).prop_map(DVec3::from);
        prop::array::uniform4(point)
    }

    proptest! {
        /// The closest point of a convex set is where no other of its points lies ahead towards the point.
        #[test]
        fn nothing_of_the_triangle_lies_nearer([a, b, c, point] in points()) {
            let found = nearest(point, [a, b, c]);
            prop_assert!(found.weights.iter().all(|w| (-1e-12..=1.0 + 1e-12).contains(w)), "{found:?}");
            prop_assert!((found.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            let foot = at([a, b, c], found.weights);
            prop_assert!((foot.distance_squared(point) - found.squared_m2).abs() < 1e-12 * (1.0 + found.squared_m2));
            for corner in [a, b, c] {
                prop_assert!((corner - foot).dot(point - foot) < 1e-9, "{found:?} {corner}");
            }
        }

        #[test]
        fn a_triangle_that_is_a_line_or_a_point_is_met([a, b, _, point] in points(), t in -0.5..1.5f64) {
            let c = a + t * (b - a);
            let found = nearest(point, [a, b, c]);
            let line = |p: DVec3, q: DVec3| {
                let along = (point - p).dot(q - p) / (q - p).length_squared().max(1e-300);
                (p + along.clamp(0.0, 1.0) * (q - p)).distance_squared(point)
            };
            let expected = line(a, b).min(line(a, c)).min(line(b, c));
            prop_assert!((found.squared_m2 - expected).abs() < 1e-9, "{found:?} {expected}");
        }
    }

    #[test]
    fn what_is_no_number_is_nowhere() {
        let found = nearest(DVec3::ZERO, [DVec3::NAN, DVec3::X, DVec3::Y]);
        assert!(found.squared_m2.is_nan(), "{found:?}");
    }
}
