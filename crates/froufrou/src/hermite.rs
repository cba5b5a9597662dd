//! Cubic Hermite interpolation between unevenly spaced keys, smooth in its first derivative everywhere. Its slopes are
//! taken from the parabola through three keys, so that it is exact for parabolas; or they are monotone, so that it
//! passes no key's value on its way to another.

/// Slope at a key between two others, from the distances to and the secants towards either.
pub(crate) fn middle_slope(left: f64, right: f64, secant_left: f64, secant_right: f64) -> f64 {
    (secant_left * right + secant_right * left) / (left + right)
}

/// Slope at the first of three keys, from the distances between them and the secants.
pub(crate) fn end_slope(near: f64, far: f64, secant_near: f64, secant_far: f64) -> f64 {
    secant_near + (secant_near - secant_far) * near / (near + far)
}

/// Slope at a key between two others such that between keys nothing rises or falls beyond them (Fritsch and Butland
/// 1984: a weighted harmonic mean of the secants, and 0 at a turn).
pub(crate) fn monotone_slope(left: f64, right: f64, secant_left: f64, secant_right: f64) -> f64 {
    let goes_on = (secant_left > 0.0 && secant_right > 0.0) || (secant_left < 0.0 && secant_right < 0.0);
    if !goes_on {
        return 0.0;
    }
    let (from_left, from_right) = (2.0 * right + left, right + 2.0 * left);
    (from_left + from_right) / (from_left / secant_left + from_right / secant_right)
}

/// Such a slope at the first of three keys, or, with distances and secants in the reverse order, at the last.
pub(crate) fn monotone_end_slope(near: f64, far: f64, secant_near: f64, secant_far: f64) -> f64 {
    let slope = end_slope(near, far, secant_near, secant_far);
    let against = |a: f64, b: f64| a == 0.0 || b == 0.0 || (a > 0.0) != (b > 0.0);
    if against(slope, secant_near) {
        0.0
    } else if against(secant_near, secant_far) && slope.abs() > 3.0 * secant_near.abs() {
        3.0 * secant_near
    } else {
        slope
    }
}

/// Value and derivative of the cubic with the given values and slopes at 0 and `length`.
#[inline(always)]
pub(crate) fn cubic(x: f64, length: f64, value: [f64; 2], slope: [f64; 2]) -> (f64, f64) {
    let u = x / length;
    let rise = value[1] - value[0];
    let (m0, m1) = (slope[0] * length, slope[1] * length);
    let (c2, c3) = (3.0 * rise - 2.0 * m0 - m1, m0 + m1 - 2.0 * rise);
    // Horner's form, so that equal values and no slopes give that value exactly.
    (value[0] + u * (m0 + u * (c2 + u * c3)), (m0 + u * (2.0 * c2 + u * 3.0 * c3)) / length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(serde::Deserialize)]
    struct Case {
        keys: Vec<f64>,
        values: Vec<f64>,
        slopes: Vec<f64>,
        at: Vec<f64>,
        expected: Vec<f64>,
    }

    /// Against scipy.interpolate.PchipInterpolator; written by `oracles/pchip_fixtures.py`.
    #[test]
    fn monotone_slopes_are_those_of_scipy() {
        let cases: Vec<Case> =
            serde_json::from_str(include_str!("../tests/fixtures/cloth/pchip.json")).expect("fixtures");
        assert!(cases.len() > 10);
        for Case { keys, values, slopes, at, expected } in cases {
            let length = |i: usize| keys[i + 1] - keys[i];
            let secant = |i: usize| (values[i + 1] - values[i]) / length(i);
            let last = keys.len() - 1;
            let ours: Vec<f64> = (0..=last)
                .map(|i| match i {
                    0 => monotone_end_slope(length(0), length(1), secant(0), secant(1)),
                    i if i == last => {
                        let (near, far) = (last - 1, last - 2);
                        monotone_end_slope(length(near), length(far), secant(near), secant(far))
                    }
                    i => monotone_slope(length(i - 1), length(i), secant(i - 1), secant(i)),
                })
                .collect();
            for (ours, theirs) in ours.iter().zip(&slopes) {
                assert!((ours - theirs).abs() < 1e-10 * (1.0 + theirs.abs()), "{ours} {theirs}");
            }
            for (&x, theirs) in at.iter().zip(&expected) {
                let i = keys.partition_point(|key| *key <= x).clamp(1, last) - 1;
                let (value, _) =
                    cubic(x - keys[i], length(i), [values[i], values[i + 1]], [ours[i], ours[i + 1]]);
                assert!((value - theirs).abs() < 1e-10 * (1.0 + theirs.abs()), "{value} {theirs}");
            }
        }
    }

    #[test]
    fn parabolas_are_met_exactly() {
        let (f, df) = (|x: f64| 3.0 - 2.0 * x + 0.7 * x * x, |x: f64| -2.0 + 1.4 * x);
        let (a, b, c) = (1.0, 1.3, 2.9);
        let secant = |p: f64, q: f64| (f(q) - f(p)) / (q - p);
        let at_a = end_slope(b - a, c - b, secant(a, b), secant(b, c));
        let at_b = middle_slope(b - a, c - b, secant(a, b), secant(b, c));
        assert!((at_a - df(a)).abs() < 1e-12 && (at_b - df(b)).abs() < 1e-12);
        for x in [a, 1.1, 1.25, b] {
            let (value, slope) = cubic(x - a, b - a, [f(a), f(b)], [at_a, at_b]);
            assert!((value - f(x)).abs() < 1e-12 && (slope - df(x)).abs() < 1e-12);
        }
    }
}
