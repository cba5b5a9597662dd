//! Which bodies are near each other, how near, and where.

use glam::DVec3;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy};
use parry3d_f64::query::{
    ContactManifold, ContactManifoldsWorkspace, DefaultQueryDispatcher, PersistentQueryDispatcher,
    QueryDispatcher,
};

use super::pose::Pose;
use super::shape::{Shape, from_vector, parry_pose, vector};

/// Contact points so much farther apart than the nearest are no part of the contact, in metres.
const SKIN_M: f64 = 5e-4;
/// Contact points whose normals differ by more than this cosine are of another contact.
const SAME_WAY: f64 = 0.9;

/// Where two bodies touch, or are nearest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Touch {
    /// How far they are apart, in metres; below 0 how deep they are in each other.
    pub gap_m: f64,
    /// The place between them.
    pub point: DVec3,
    /// From the first to the second, of length 1.
    pub normal: DVec3,
}

/// Finds where bodies touch; keeps the memory that it needs.
#[derive(Default)]
pub(super) struct Prober {
    manifolds: Vec<ContactManifold<(), ()>>,
}

/// Two bodies, where their centres are.
#[derive(Clone, Copy)]
pub(super) struct Two<'a> {
    pub shapes: [&'a Shape; 2],
    pub poses: [&'a Pose; 2],
}

impl Prober {
    /// The nearest points of two bodies, if they are nearer than some metres. It does not matter which comes first, but
    /// for the sign of the normal.
    pub fn nearest(&mut self, two: Two<'_>, within_m: f64) -> Option<Touch> {
        let [a, b] = two.poses.map(parry_pose);
        let between = a.inv_mul(&b);
        let (one, other) = (two.shapes[0].against(two.shapes[1]), two.shapes[1].against(two.shapes[0]));
        let contact = DefaultQueryDispatcher.contact(&between, &**one, &**other, within_m).ok()??;
        let out = |local| two.poses[0].out(from_vector(local));
        let touch = Touch {
            gap_m: contact.dist,
            point: 0.5 * (out(contact.point1) + two.poses[1].out(from_vector(contact.point2))),
            normal: two.poses[0].turn * from_vector(contact.normal1),
        };
        touch.is_sound().then_some(touch)
    }

    /// The middle of all places where they touch, if they are nearer than some metres.
    pub fn touch(&mut self, two: Two<'_>, within_m: f64) -> Option<Touch> {
        if two.shapes.iter().any(|shape| shape.radius_m().is_some()) {
            return self.nearest(two, within_m);
        }
        let [a, b] = two.poses.map(parry_pose);
        let between = a.inv_mul(&b);
        let (one, other) = (two.shapes[0].against(two.shapes[1]), two.shapes[1].against(two.shapes[0]));
        self.manifolds.clear();
        let mut workspace: Option<ContactManifoldsWorkspace> = None;
        DefaultQueryDispatcher
            .contact_manifolds(&between, &**one, &**other, within_m, &mut self.manifolds, &mut workspace)
            .ok()?;
        let mut points: Vec<(f64, DVec3, DVec3)> = Vec::new();
        for manifold in &self.manifolds {
            let normal =
                manifold.subshape_pos1().map_or(manifold.local_n1, |pose| pose.rotation * manifold.local_n1);
            for point in &manifold.points {
                let local = manifold
                    .subshape_pos1()
                    .map_or(point.local_p1, |pose| pose.transform_point(point.local_p1));
                // Midway between the two surfaces.
                points.push((
                    point.dist,
                    from_vector(local + normal * (0.5 * point.dist)),
                    from_vector(normal),
                ));
            }
        }
        let nearest = points.iter().min_by(|a, b| a.0.total_cmp(&b.0)).copied()?;
        if nearest.0 > within_m {
            return None;
        }
        let part = points
            .iter()
            .filter(|(gap_m, _, normal)| *gap_m <= nearest.0 + SKIN_M && normal.dot(nearest.2) >= SAME_WAY);
        let (mut middle, mut weights) = (DVec3::ZERO, 0.0);
        for (gap_m, point, _) in part {
            // What is farther by a skin counts no more, so that the middle does not leap.
            let weight = 1.0 - 0.999 * (gap_m - nearest.0) / SKIN_M;
            middle += *point * weight;
            weights += weight;
        }
        let touch = Touch {
            gap_m: nearest.0,
            point: two.poses[0].out(middle / weights),
            normal: two.poses[0].turn * nearest.2,
        };
        touch.is_sound().then_some(touch)
    }
}

impl Touch {
    fn is_sound(&self) -> bool {
        self.gap_m.is_finite() && self.point.is_finite() && (self.normal.length() - 1.0).abs() < 1e-6
    }
}

/// The pairs of bodies whose boxes overlap, of which at least one moves, in order.
pub(super) fn pairs(bounds: &[[DVec3; 2]], moves: &[bool]) -> Vec<[u32; 2]> {
    let boxes: Vec<Aabb> = bounds.iter().map(|[low, high]| Aabb::new(vector(*low), vector(*high))).collect();
    let tree = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
    let mut pairs = Vec::new();
    for (body, aabb) in boxes.iter().enumerate().filter(|(body, _)| moves[*body]) {
        for other in tree.intersect_aabb(aabb) {
            let body = body as u32;
            // Two that move find each other.
            if other != body && (!moves[other as usize] || body < other) {
                pairs.push([body.min(other), body.max(other)]);
            }
        }
    }
    pairs.sort_unstable();
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;
    use proptest::prelude::*;

    fn at(x: f64, y: f64, z: f64) -> Pose {
        Pose { at: DVec3::new(x, y, z), turn: DQuat::IDENTITY }
    }

    #[test]
    fn a_ball_and_a_box_touch_where_they_should() {
        let (ball, floor) = (Shape::sphere(0.5), Shape::cuboid([2.0, 0.1, 2.0]));
        for height in [0.62, 0.6, 0.59] {
            let (high, low) = (at(0.3, height, 0.2), at(0.0, 0.0, 0.0));
            let two = Two { shapes: [&ball, &floor], poses: [&high, &low] };
            let touch = Prober::default().touch(two, 0.05).unwrap();
            assert!((touch.gap_m - (height - 0.6)).abs() < 1e-9, "{touch:?}");
            assert!((touch.normal - DVec3::NEG_Y).length() < 1e-9);
            assert!((touch.point - DVec3::new(0.3, 0.1 + touch.gap_m / 2.0, 0.2)).length() < 1e-9);
        }
        let (high, low) = (at(0.3, 0.7, 0.2), at(0.0, 0.0, 0.0));
        assert!(
            Prober::default().touch(Two { shapes: [&ball, &floor], poses: [&high, &low] }, 0.05).is_none()
        );
    }

    #[test]
    fn a_block_on_a_floor_touches_in_the_middle_of_its_face() {
        let (block, floor) = (Shape::cuboid([0.2, 0.1, 0.3]), Shape::cuboid([2.0, 0.1, 2.0]));
        let turned = Pose { turn: DQuat::from_rotation_y(0.7), ..at(0.5, 0.2, -0.4) };
        for (a, b, sign) in [(&turned, &at(0.0, 0.0, 0.0), -1.0), (&at(0.0, 0.0, 0.0), &turned, 1.0)] {
            let shapes = if sign < 0.0 { [&block, &floor] } else { [&floor, &block] };
            let touch = Prober::default().touch(Two { shapes, poses: [a, b] }, 0.01).unwrap();
            assert!((touch.point - DVec3::new(0.5, 0.1, -0.4)).length() < 1e-6, "{touch:?}");
            assert!((touch.normal - DVec3::Y * sign).length() < 1e-6 && touch.gap_m.abs() < 1e-9);
        }
    }

    proptest! {
        #[test]
        fn pairs_are_those_that_overlap(
            boxes in prop::collection::vec((prop::array::uniform3(-3.0..3.0f64), 0.0..1.0f64, any::<bool>()), 0..40),
        ) {
            let bounds: Vec<[DVec3; 2]> = boxes.iter().map(|(at, size, _)| {
                [DVec3::from(*at), DVec3::from(*at) + DVec3::splat(*size)]
            }).collect();
            let moves: Vec<bool> = boxes.iter().map(|b| b.2).collect();
            let mut expected = Vec::new();
            for a in 0..boxes.len() {
                for b in a + 1..boxes.len() {
                    let overlap = bounds[a][0].cmple(bounds[b][1]).all() && bounds[b][0].cmple(bounds[a][1]).all();
                    if overlap && (moves[a] || moves[b]) {
                        expected.push([a as u32, b as u32]);
                    }
                }
            }
            prop_assert_eq!(pairs(&bounds, &moves), expected);
        }
    }
}
