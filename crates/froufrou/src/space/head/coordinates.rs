//! From the coordinates of a SOFA file to the listener's own frame of this project: the only place that
//! knows both.
//!
//! In SOFA (AES69) a listener at `ListenerPosition` looks along `ListenerView` with `ListenerUp` above; what
//! is spherical is azimuth, counter-clockwise from +X, elevation and radius. Here ahead is −Z, right is +X and
//! up is +Y.

use super::grid::{Vector, cross, dot};

/// How the three numbers of a place are meant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Coordinates {
    /// x, y and z in metres.
    Cartesian,
    /// Azimuth, elevation and radius; the angles in units of so many radians.
    Spherical { angle_rad: f64 },
}

impl Coordinates {
    /// What `Type` and `Units` say, where they are there, or else a `default`; in an error what is wrong
    /// with them.
    pub(super) fn new(kind: Option<&str>, units: Option<&str>, default: Self) -> Result<Self, String> {
        let units: Vec<String> = units
            .unwrap_or("")
            .split(|c: char| c == ',' || c == ';' || c.is_whitespace())
            .filter(|unit| !unit.is_empty())
            .map(str::to_lowercase)
            .collect();
        let angle = units.iter().find_map(|unit| match unit.as_str() {
            "degree" | "degrees" | "deg" | "°" => Some(1.0_f64.to_radians()),
            "radian" | "radians" | "rad" => Some(1.0),
            _ => None,
        });
        for unit in &units {
            let known = ["degree", "degrees", "deg", "°", "radian", "radians", "rad"]
                .contains(&unit.as_str())
                || ["metre", "metres", "meter", "meters", "m"].contains(&unit.as_str());
            if !known {
                return Err(format!("the unit `{unit}`, expected degree, radian or metre"));
            }
        }
        let spherical = || Self::Spherical { angle_rad: angle.unwrap_or(1.0_f64.to_radians()) };
        match kind.map(|kind| kind.trim().to_lowercase()).as_deref() {
            Some("cartesian") if angle.is_some() => Err("cartesian coordinates in units of angles".into()),
            Some("cartesian") => Ok(Self::Cartesian),
            Some("spherical") => Ok(spherical()),
            Some(other) => Err(format!("coordinates of type `{other}`, expected cartesian or spherical")),
            None if angle.is_some() => Ok(spherical()),
            None if !units.is_empty() => Ok(Self::Cartesian),
            None => Ok(default),
        }
    }

    /// A place as x, y and z of SOFA.
    pub(super) fn place(self, [a, b, c]: Vector) -> Vector {
        match self {
            Self::Cartesian => [a, b, c],
            Self::Spherical { angle_rad } => {
                let (sine, cosine) = (b * angle_rad).sin_cos();
                let (left, ahead) = (a * angle_rad).sin_cos();
                [c * cosine * ahead, c * cosine * left, c * sine]
            }
        }
    }

    /// A place as a direction of length 1 and a distance, which is 0 where the file leaves a radius open.
    pub(super) fn direction(self, place: Vector) -> Option<(Vector, f64)> {
        let (towards, distance_m) = match self {
            Self::Cartesian => (place, length(place)),
            Self::Spherical { .. } => (self.place([place[0], place[1], 1.0]), place[2]),
        };
        Some((unit(towards)?, distance_m))
    }
}

/// A listener as SOFA places one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Listener {
    ahead: Vector,
    left: Vector,
    up: Vector,
}

impl Listener {
    /// A listener with this view and up, which need neither length nor right angle; none where they leave
    /// the orientation open.
    pub(super) fn new(view: Vector, up: Vector) -> Option<Self> {
        let ahead = unit(view)?;
        let left = unit(cross(unit(up)?, ahead))?;
        Some(Self { ahead, left, up: cross(ahead, left) })
    }

    /// A vector of the file in the listener's own frame of this project.
    pub(super) fn own(&self, vector: Vector) -> Vector {
        [-dot(vector, self.left), dot(vector, self.up), -dot(vector, self.ahead)]
    }
}

pub(super) fn length(vector: Vector) -> f64 {
    dot(vector, vector).sqrt()
}

/// A vector at length 1.
pub(super) fn unit(vector: Vector) -> Option<Vector> {
    // First to a size whose square neither overflows nor vanishes.
    let size = vector.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
    if !(size > 0.0 && vector.iter().all(|x| x.is_finite())) {
        return None;
    }
    let vector = vector.map(|x| x / size);
    let length = length(vector);
    (length > 1e-6).then(|| vector.map(|x| x / length))
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEGREES: Coordinates = Coordinates::Spherical { angle_rad: std::f64::consts::PI / 180.0 };

    fn near(found: Vector, expected: Vector) {
        assert!((0..3).all(|k| (found[k] - expected[k]).abs() < 1e-12), "{found:?}, expected {expected:?}");
    }

    #[test]
    fn left_ahead_and_up_are_where_they_should_be() {
        let usual = Listener::new([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]).expect("a listener");
        near(usual.own(DEGREES.place([0.0, 0.0, 2.0])), [0.0, 0.0, -2.0]);
        near(usual.own(DEGREES.place([90.0, 0.0, 2.0])), [-2.0, 0.0, 0.0]);
        near(usual.own(DEGREES.place([0.0, 90.0, 2.0])), [0.0, 2.0, 0.0]);
        // One who lies on the back and looks up, the head towards -X.
        let lying = Listener::new([0.0, 0.0, 7.0], [-3.0, 0.0, 0.5]).expect("a listener");
        near(lying.own([0.0, 0.0, 1.0]), [0.0, 0.0, -1.0]);
        near(lying.own([-1.0, 0.0, 0.0]), [0.0, 1.0, 0.0]);
        near(lying.own([0.0, 1.0, 0.0]), [-1.0, 0.0, 0.0]);
        assert!(Listener::new([0.0; 3], [0.0, 0.0, 1.0]).is_none());
        assert!(Listener::new([0.0, 0.0, 1.0], [0.0, 0.0, 2.0]).is_none());
    }

    #[test]
    fn types_and_units_are_read_as_files_have_them() {
        let new = |kind, units| Coordinates::new(kind, units, DEGREES);
        assert_eq!(new(Some("spherical"), Some("degree, degree, metre")), Ok(DEGREES));
        assert_eq!(new(Some("Spherical "), Some("degrees degrees meters")), Ok(DEGREES));
        let radians = Coordinates::Spherical { angle_rad: 1.0 };
        assert_eq!(new(Some("spherical"), Some("radian, radian, metre")), Ok(radians));
        assert_eq!(new(Some("cartesian"), Some("metre")), Ok(Coordinates::Cartesian));
        assert_eq!(new(None, Some("meter")), Ok(Coordinates::Cartesian));
        assert_eq!(new(None, None), Ok(DEGREES));
        assert!(new(Some("cartesian"), Some("degree, degree, metre")).is_err());
        assert!(
            new(Some("spherical"), Some("degree, degree, feet")).is_err_and(|what| what.contains("feet"))
        );
        assert!(new(Some("cylindrical"), None).is_err_and(|what| what.contains("cylindrical")));
    }
}
