//! Where a rigid body is, and how a transform of an animation says so.

use glam::{DMat3, DQuat, DVec3};

use crate::scene::animation::Transform;

/// Where a body is and how it is turned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pose {
    /// The place of its frame, in metres.
    pub at: DVec3,
    /// From its frame to the world; of length 1.
    pub turn: DQuat,
}

impl Pose {
    /// The pose of a transform and the sizes that are left of it: what its scales and shears make of the axes. A
    /// mirrored transform is a turned one of a mirrored shape. Nothing where it is not finite or flattens.
    pub fn of(transform: &Transform) -> Option<(Self, DMat3)> {
        let column = |k: usize| DVec3::new(transform[0][k], transform[1][k], transform[2][k]);
        let (linear, at) = (DMat3::from_cols(column(0), column(1), column(2)), column(3));
        if !linear.is_finite() || !at.is_finite() {
            return None;
        }
        // The rotation nearest to it, by Newton's iteration for the polar decomposition.
        let size = linear.determinant().abs().cbrt();
        if size < 1e-9 {
            return None;
        }
        let mut turned = linear * (1.0 / size);
        for _ in 0..60 {
            let next = (turned + turned.inverse().transpose()) * 0.5;
            let change = (next - turned).to_cols_array().iter().fold(0.0, |most: f64, c| most.max(c.abs()));
            turned = next;
            if change < 1e-14 {
                break;
            }
        }
        if turned.determinant() < 0.0 {
            turned *= -1.0;
        }
        let turn = DQuat::from_mat3(&turned).normalize();
        let sizes = DMat3::from_quat(turn.conjugate()) * linear;
        (turn.is_finite() && sizes.is_finite()).then_some((Self { at, turn }, sizes))
    }

    /// A place of its frame, in the world.
    pub fn out(&self, local: DVec3) -> DVec3 {
        self.at + self.turn * local
    }

    /// A place of the world, in its frame.
    pub fn local(&self, world: DVec3) -> DVec3 {
        self.turn.conjugate() * (world - self.at)
    }
}

/// The turn from one orientation to another as an axis times an angle of at most half a turn, in the world.
pub(super) fn turned(from: DQuat, to: DQuat) -> DVec3 {
    let mut way = to * from.conjugate();
    if way.w < 0.0 {
        way = -way;
    }
    let axis = DVec3::new(way.x, way.y, way.z);
    let sine = axis.length();
    if sine < 1e-12 { 2.0 * axis } else { axis * (2.0 * sine.atan2(way.w) / sine) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn transform(linear: DMat3, at: DVec3) -> Transform {
        let c = linear.to_cols_array_2d();
        let row = |i: usize| [c[0][i], c[1][i], c[2][i], at[i]];
        [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
    }

    proptest! {
        #[test]
        fn scales_and_mirrors_come_off(
            axis in prop::array::uniform3(-1.0..1.0f64), angle in -3.0..3.0f64,
            scale in prop::array::uniform3(0.01..50.0f64), mirror: bool,
        ) {
            let turn = DQuat::from_axis_angle(DVec3::from(axis).try_normalize().unwrap_or(DVec3::X), angle);
            let sign = if mirror { -1.0 } else { 1.0 };
            let sizes = DMat3::from_diagonal(DVec3::from(scale) * sign);
            let at = DVec3::new(1.0, -2.0, 3.0);
            let (pose, left) = Pose::of(&transform(DMat3::from_quat(turn) * sizes, at)).unwrap();
            prop_assert!(pose.turn.dot(turn).abs() > 1.0 - 1e-9);
            prop_assert!((left - sizes).to_cols_array().iter().all(|c| c.abs() < 1e-6));
            prop_assert!((pose.out(pose.local(DVec3::ONE)) - DVec3::ONE).length() < 1e-12);
        }
    }

    #[test]
    fn what_is_nowhere_has_no_pose() {
        assert_eq!(Pose::of(&transform(DMat3::IDENTITY * f64::NAN, DVec3::ZERO)), None);
        assert_eq!(Pose::of(&transform(DMat3::IDENTITY, DVec3::X * f64::INFINITY)), None);
        assert_eq!(Pose::of(&[[0.0; 4]; 4]), None);
        assert_eq!(Pose::of(&transform(DMat3::from_diagonal(DVec3::new(1.0, 0.0, 1.0)), DVec3::ZERO)), None);
    }

    #[test]
    fn turns_are_told_to_half_a_turn() {
        for angle in [0.0, 1e-9, 0.5, 3.1, -3.1] {
            let to = DQuat::from_rotation_y(angle) * DQuat::from_rotation_x(1.0);
            let way = turned(DQuat::from_rotation_x(1.0), to);
            assert!((way - DVec3::Y * angle).length() < 1e-9, "{angle} {way}");
        }
        // More than half a turn is less the other way.
        let way = turned(DQuat::IDENTITY, DQuat::from_rotation_z(4.0));
        assert!((way - DVec3::Z * (4.0 - std::f64::consts::TAU)).length() < 1e-9);
    }
}
