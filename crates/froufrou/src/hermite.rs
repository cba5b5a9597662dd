//! Cubic Hermite interpolation between unevenly spaced keys, its slopes taken from the parabola
//! through three of them: exact for parabolas, smooth in its first derivative everywhere.

/// Slope at a key between two others, from the distances to and the secants towards either.
pub(crate) fn middle_slope(left: f64, right: f64, secant_left: f64, secant_right: f64) -> f64 {
    (secant_left * right + secant_right * left) / (left + right)
}

/// Slope at the first of three keys, from the distances between them and the secants.
pub(crate) fn end_slope(near: f64, far: f64, secant_near: f64, secant_far: f64) -> f64 {
    secant_near + (secant_near - secant_far) * near / (near + far)
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
