//! Poses between two poses.

use glam::{DMat3, DMat4, DQuat};

/// The transform a share of the way from one to another: translation linear, rotation spherical,
/// scale and shear linear. Where one of them has no inverse or they mirror differently, there is no
/// rotation from one to the other, and the matrices are mixed.
pub(super) fn between(before: DMat4, after: DMat4, fraction: f64) -> DMat4 {
    let linear = |a: DMat4, b: DMat4| a * (1.0 - fraction) + b * fraction;
    if before == after {
        return before;
    }
    let (Some(a), Some(b)) = (Polar::new(before), Polar::new(after)) else { return linear(before, after) };
    if a.mirror != b.mirror {
        return linear(before, after);
    }
    let rotation = DMat3::from_quat(a.rotation.slerp(b.rotation, fraction));
    let stretch = a.stretch * (1.0 - fraction) + b.stretch * fraction;
    let linear_part = rotation * stretch * a.mirror;
    let translation = before.w_axis.lerp(after.w_axis, fraction);
    let mut mixed = DMat4::from_mat3(linear_part);
    mixed.w_axis = translation;
    mixed
}

/// A linear map as a rotation after a symmetric stretch, times −1 where it mirrors: M = ±R S.
/// For a rotation after a scale, that is what S is.
struct Polar {
    rotation: DQuat,
    stretch: DMat3,
    mirror: f64,
}

impl Polar {
    fn new(matrix: DMat4) -> Option<Self> {
        let linear = DMat3::from_mat4(matrix);
        let determinant = linear.determinant();
        let size = linear.x_axis.length().max(linear.y_axis.length()).max(linear.z_axis.length());
        // False for a NaN too.
        let has_inverse = determinant.abs() > 1e-12 * size.powi(3);
        if !has_inverse {
            return None;
        }
        let mirror = determinant.signum();
        let upright = linear * mirror;
        // Higham 1986: X ← (g X + X⁻ᵀ / g) / 2 tends to the nearest rotation; g = √(|X⁻¹| / |X|).
        let mut rotation = upright;
        for _ in 0..64 {
            let inverse_transposed = rotation.inverse().transpose();
            let gain = (frobenius(inverse_transposed) / frobenius(rotation)).sqrt();
            let next = (rotation * gain + inverse_transposed * (1.0 / gain)) * 0.5;
            let change = frobenius(next - rotation);
            rotation = next;
            if change < 1e-13 {
                break;
            }
        }
        let stretch = rotation.transpose() * upright;
        let rotation = DQuat::from_mat3(&rotation).normalize();
        (rotation.is_finite() && stretch.is_finite()).then_some(Self { rotation, stretch, mirror })
    }
}

fn frobenius(matrix: DMat3) -> f64 {
    (matrix.x_axis.length_squared() + matrix.y_axis.length_squared() + matrix.z_axis.length_squared()).sqrt()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn close(a: DMat4, b: DMat4) -> bool {
        a.to_cols_array().iter().zip(b.to_cols_array()).all(|(a, b)| (a - b).abs() < 1e-12)
    }

    #[test]
    fn between_two_rigid_poses_the_rotation_is_spherical() {
        let pose = |degrees: f64, x: f64, scale: DVec3| {
            DMat4::from_scale_rotation_translation(
                scale,
                DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -1.0).normalize(), degrees.to_radians()),
                DVec3::new(x, -2.0 * x, 3.0),
            )
        };
        let (from, to) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(3.0, 2.0, 1.0));
        for mirror in [1.0, -1.0] {
            for step in 0..=10 {
                let share = f64::from(step) / 10.0;
                let expected = pose(20.0 + 150.0 * share, 5.0 * share, from.lerp(to, share) * mirror);
                let found = between(pose(20.0, 0.0, from * mirror), pose(170.0, 5.0, to * mirror), share);
                assert!(close(found, expected), "{mirror} {share}: {found} {expected}");
            }
        }
    }

    #[test]
    fn a_flat_or_broken_matrix_is_mixed_and_ends_at_its_ends() {
        let flat = DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0));
        let turned = DMat4::from_rotation_y(1.0);
        let mirrored = DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        for other in [flat, mirrored] {
            assert!(close(between(other, turned, 0.0), other));
            assert!(close(between(other, turned, 0.5), (other + turned) * 0.5));
        }
        let broken = DMat4::from_scale(DVec3::new(f64::NAN, 1.0, f64::INFINITY));
        assert!(between(broken, turned, 0.5).is_nan());
    }

    #[test]
    fn a_sheared_matrix_is_put_together_again() {
        let sheared = DMat4::from_cols_array(&[
            1.0, 0.2, 0.0, 0.0, 0.7, 2.0, 0.3, 0.0, -0.4, 0.1, 1e-3, 0.0, 1.0, 2.0, 3.0, 1.0,
        ]);
        let polar = Polar::new(sheared).expect("it has an inverse");
        let again = DMat3::from_quat(polar.rotation) * polar.stretch * polar.mirror;
        assert!((again - DMat3::from_mat4(sheared)).to_cols_array().iter().all(|e| e.abs() < 1e-12));
        assert!((polar.stretch - polar.stretch.transpose()).to_cols_array().iter().all(|e| e.abs() < 1e-12));
    }
}
