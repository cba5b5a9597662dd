//! Directions in a listener's or an object's own frame: as vectors, as angles, and as AmbiX has them.
//!
//! In that frame ahead is −Z, right is +X and up is +Y. Azimuths run counter-clockwise seen from above, as in
//! SOFA and AmbiX files: 0° is ahead, 90° left. Elevations run up: 90° is overhead.

/// The unit vector of an azimuth and an elevation in degrees.
///
/// ```
/// use froufrou::space::direction::from_angles_deg;
/// let left = from_angles_deg(90.0, 0.0);
/// assert!((left[0] + 1.0).abs() < 1e-15);
/// assert_eq!(from_angles_deg(0.0, 0.0), [0.0, 0.0, -1.0]);
/// ```
pub fn from_angles_deg(azimuth_deg: f64, elevation_deg: f64) -> [f64; 3] {
    let (azimuth_sin, azimuth_cos) = azimuth_deg.to_radians().sin_cos();
    let (elevation_sin, elevation_cos) = elevation_deg.to_radians().sin_cos();
    [0.0 - azimuth_sin * elevation_cos, elevation_sin, -azimuth_cos * elevation_cos]
}

/// The azimuth, in (−180, 180], and the elevation of a vector of any length, in degrees.
pub fn to_angles_deg([x, y, z]: [f64; 3]) -> (f64, f64) {
    let azimuth_deg = (0.0 - x).atan2(0.0 - z).to_degrees();
    (azimuth_deg, y.atan2(x.hypot(z)).to_degrees())
}

/// A vector with the axes of AmbiX, which [`harmonics`](super::directivity::harmonics) asks for: ahead, left, up.
pub fn ahead_left_up([x, y, z]: [f64; 3]) -> [f64; 3] {
    [-z, -x, y]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_and_vectors_are_two_ways_to_say_one_thing() {
        for azimuth in [-179.0, -90.0, -30.0, 0.0, 45.0, 110.0, 180.0] {
            for elevation in [-80.0, -30.0, 0.0, 15.0, 89.0] {
                let vector = from_angles_deg(azimuth, elevation);
                let (a, e) = to_angles_deg(vector.map(|c| 3.0 * c));
                assert!((a - azimuth).abs() < 1e-10 && (e - elevation).abs() < 1e-10, "{a} {e}");
                let [ahead, left, up] = ahead_left_up(vector);
                assert!((left.atan2(ahead).to_degrees() - azimuth).abs() < 1e-10);
                assert!((up.asin().to_degrees() - elevation).abs() < 1e-10);
            }
        }
        assert_eq!(to_angles_deg([0.0, 1.0, 0.0]).1, 90.0);
    }
}
