//! Where a rigid body is and how it moves at one time.

use glam::{DQuat, DVec3};

/// A rigid body at one time, in metres, seconds and radians, Y up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BodyState {
    /// Where its origin is.
    pub position_m: [f64; 3],
    /// How it is turned, from its own frame into the world: a quaternion x, y, z, w of length 1.
    pub rotation: [f64; 4],
    /// The velocity of its origin.
    pub velocity_mps: [f64; 3],
    /// Its angular velocity, in the world's axes.
    pub angular_velocity_rps: [f64; 3],
}

impl BodyState {
    /// What stands still at the origin, unturned: the world itself.
    pub const STILL: Self = Self {
        position_m: [0.0; 3],
        rotation: [0.0, 0.0, 0.0, 1.0],
        velocity_mps: [0.0; 3],
        angular_velocity_rps: [0.0; 3],
    };

    /// The velocity of its material at a point of the world: v + ω × r.
    ///
    /// ```
    /// use froufrou::motion::body::BodyState;
    /// let wheel = BodyState { angular_velocity_rps: [0.0, 0.0, -2.0], ..BodyState::STILL };
    /// assert_eq!(wheel.velocity_at([0.0, -0.5, 0.0]), [-1.0, 0.0, 0.0]);
    /// ```
    pub fn velocity_at(&self, point_m: [f64; 3]) -> [f64; 3] {
        let arm = DVec3::from(point_m) - DVec3::from(self.position_m);
        (DVec3::from(self.velocity_mps) + DVec3::from(self.angular_velocity_rps).cross(arm)).to_array()
    }

    /// A point of the world in its own frame, in metres.
    pub fn local_m(&self, point_m: [f64; 3]) -> [f64; 3] {
        let arm = DVec3::from(point_m) - DVec3::from(self.position_m);
        (DQuat::from_array(self.rotation).conjugate() * arm).to_array()
    }

    /// A point of its own frame in the world, in metres.
    pub fn world_m(&self, local_m: [f64; 3]) -> [f64; 3] {
        let turned = DQuat::from_array(self.rotation) * DVec3::from(local_m);
        (turned + DVec3::from(self.position_m)).to_array()
    }

    /// How fast it moves from one pose to another in a time, from the poses alone. The velocities of both are
    /// left out.
    pub(crate) fn velocities_between(before: &Self, after: &Self, span_s: f64) -> [[f64; 3]; 2] {
        let (from, to) = (DQuat::from_array(before.rotation), DQuat::from_array(after.rotation));
        let turn = to * from.conjugate();
        // The shorter way round.
        let turn = if turn.w < 0.0 { -turn } else { turn };
        let moved = DVec3::from(after.position_m) - DVec3::from(before.position_m);
        [(moved / span_s).to_array(), (turn.to_scaled_axis() / span_s).to_array()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn velocities_between_two_poses_lead_from_one_to_the_other(
            axis in prop::array::uniform3(-1.0..1.0f64),
            moved in prop::array::uniform3(-5.0..5.0f64),
            turned in prop::array::uniform3(-3.0..3.0f64),
        ) {
            let from = DQuat::from_scaled_axis(DVec3::from(turned));
            let rate = DVec3::from(axis) * 1.5;
            let before = BodyState { rotation: from.to_array(), ..BodyState::STILL };
            let after = BodyState {
                position_m: moved,
                rotation: (DQuat::from_scaled_axis(rate * 0.1) * from).to_array(),
                ..BodyState::STILL
            };
            let [linear, angular] = BodyState::velocities_between(&before, &after, 0.1);
            prop_assert!((DVec3::from(angular) - rate).length() < 1e-6, "{angular:?} {rate}");
            prop_assert!((DVec3::from(linear) * 0.1 - DVec3::from(moved)).length() < 1e-9);
        }

        #[test]
        fn a_point_of_a_body_stays_where_it_is_on_it(
            turned in prop::array::uniform3(-3.0..3.0f64),
            place in prop::array::uniform3(-5.0..5.0f64),
            point in prop::array::uniform3(-5.0..5.0f64),
        ) {
            let rotation = DQuat::from_scaled_axis(DVec3::from(turned));
            let body = BodyState { position_m: place, rotation: rotation.to_array(), ..BodyState::STILL };
            let world = rotation * DVec3::from(point) + DVec3::from(place);
            prop_assert!((DVec3::from(body.local_m(world.to_array())) - DVec3::from(point)).length() < 1e-9);
            prop_assert!((DVec3::from(body.world_m(point)) - world).length() < 1e-9);
        }
    }
}
