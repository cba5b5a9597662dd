//! How hard bodies that rest on each other press.
//!
//! The contacts of a body together give it the force m(a − g). How much of that each gives is told by least squares:
//! forces along the normals, none of which pulls, that leave as little as can be of it unexplained. They are found by
//! projected Gauss–Seidel from those of the moment before, so that what rests is told ever better.

use glam::DVec3;

/// Sweeps over all contacts in one frame.
const SWEEPS: usize = 24;

/// Two bodies that touch.
#[derive(Debug, Clone, Copy)]
pub(super) struct Joint {
    pub bodies: [usize; 2],
    /// From the first to the second, of length 1.
    pub normal: DVec3,
    /// The force; what it was a moment ago.
    pub force_n: f64,
}

/// What a body asks of its contacts.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Need {
    /// 1/kg; 0 where it cannot be moved.
    pub inverse_mass: f64,
    /// m(a − g), in newtons.
    pub force: DVec3,
}

/// Shares forces among contacts; deterministic, as it goes through them in their order.
pub(super) fn share(joints: &mut [Joint], needs: &mut [Need]) {
    for joint in joints.iter() {
        let [a, b] = joint.bodies;
        needs[a].force += joint.normal * joint.force_n;
        needs[b].force -= joint.normal * joint.force_n;
    }
    for _ in 0..SWEEPS {
        for joint in joints.iter_mut() {
            let [a, b] = joint.bodies;
            let (wa, wb) = (needs[a].inverse_mass, needs[b].inverse_mass);
            if wa + wb <= 0.0 {
                continue;
            }
            let lacks = wb * needs[b].force.dot(joint.normal) - wa * needs[a].force.dot(joint.normal);
            let force_n = (joint.force_n + lacks / (wa + wb)).max(0.0);
            let more = joint.normal * (force_n - joint.force_n);
            needs[a].force += more;
            needs[b].force -= more;
            joint.force_n = force_n;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const G: f64 = 9.81;

    fn need(mass: f64) -> Need {
        Need { inverse_mass: 1.0 / mass, force: DVec3::Y * (mass * G) }
    }

    fn on(below: usize, above: usize) -> Joint {
        Joint { bodies: [below, above], normal: DVec3::Y, force_n: 0.0 }
    }

    #[test]
    fn the_lowest_of_a_tower_bears_all() {
        let mut joints: Vec<Joint> = (0..5).map(|i| on(i, i + 1)).collect();
        // As frames go by.
        for _ in 0..40 {
            let mut needs = vec![Need::default()];
            needs.extend([1.0, 2.0, 3.0, 4.0, 5.0].map(need));
            share(&mut joints, &mut needs);
        }
        for (joint, mass) in joints.iter().zip([15.0, 14.0, 12.0, 9.0, 5.0]) {
            assert!((joint.force_n - mass * G).abs() < 1e-3 * mass * G, "{joint:?}");
        }
    }

    #[test]
    fn on_a_slope_it_presses_by_the_cosine_and_two_legs_share() {
        let tilt = 0.4_f64;
        let normal = DVec3::new(tilt.sin(), tilt.cos(), 0.0);
        // It slides down without friction: a is along the slope.
        let down = DVec3::new(tilt.cos(), -tilt.sin(), 0.0) * (G * tilt.sin());
        let mut needs = [Need::default(), Need { inverse_mass: 0.5, force: (down + DVec3::Y * G) * 2.0 }];
        let mut joints = [Joint { bodies: [0, 1], normal, force_n: 0.0 }];
        share(&mut joints, &mut needs);
        assert!((joints[0].force_n - 2.0 * G * tilt.cos()).abs() < 1e-9);
        // Freely falling, it presses on nothing; moved down faster, nothing pulls it.
        for acceleration in [-G, -2.0 * G] {
            let mut needs =
                [Need::default(), Need { inverse_mass: 1.0, force: DVec3::Y * (acceleration + G) }];
            let mut joints = [on(0, 1)];
            share(&mut joints, &mut needs);
            assert_eq!(joints[0].force_n, 0.0);
        }
        let mut joints = [on(0, 2), on(1, 2)];
        share(&mut joints, &mut [Need::default(), Need::default(), need(3.0)]);
        assert!((joints[0].force_n + joints[1].force_n - 3.0 * G).abs() < 1e-9);
    }
}
