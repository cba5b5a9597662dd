//! Meshes that are bent by the bones of a skeleton and by blend shapes (UsdSkel).
//!
//! A point p of a mesh that is bound goes to
//!
//! ```text
//! Σ wⱼ · Jⱼ(t) · Bⱼ⁻¹ · G · p
//! ```
//!
//! in the space of the skeleton: G is the mesh's geomBindTransform, Bⱼ where joint j was when the
//! mesh was bound and Jⱼ where it is, both in that space. The weights are taken as they are.

use std::sync::Arc;

use glam::{DMat4, DQuat, DVec3};

use super::fault::Damage;
use super::samples::{Samples, merged};

/// Joints that move, and how far blend shapes are on.
#[derive(Debug, Default)]
pub(super) struct Animation {
    pub(super) joints: Vec<String>,
    pub(super) translations: Option<Samples<Vec<[f32; 3]>>>,
    pub(super) rotations: Option<Samples<Vec<DQuat>>>,
    pub(super) scales: Option<Samples<Vec<[f32; 3]>>>,
    pub(super) shapes: Vec<String>,
    pub(super) shape_weights: Option<Samples<Vec<f32>>>,
}

impl Animation {
    fn times_s(&self) -> Vec<f64> {
        fn of<T>(samples: &Option<Samples<T>>) -> &[f64] {
            samples.as_ref().map_or(&[], Samples::times_s)
        }
        merged([of(&self.translations), of(&self.rotations), of(&self.scales), of(&self.shape_weights)])
    }

    /// A joint against the one above it; what is not animated is as it is at rest.
    fn local(&self, joint: usize, rest: DMat4, time_s: f64) -> DMat4 {
        let (rest_scale, rest_rotation, rest_translation) = rest.to_scale_rotation_translation();
        let vector = |samples: &Option<Samples<Vec<[f32; 3]>>>, rest: DVec3| {
            let Some(samples) = samples else { return rest };
            let (before, after, fraction) = samples.around(time_s);
            match (before.get(joint), after.get(joint)) {
                (Some(a), Some(b)) => {
                    DVec3::from(a.map(f64::from)).lerp(DVec3::from(b.map(f64::from)), fraction)
                }
                _ => rest,
            }
        };
        let rotation = self.rotations.as_ref().and_then(|samples| {
            let (before, after, fraction) = samples.around(time_s);
            let (a, b) = (before.get(joint)?, after.get(joint)?);
            Some(if fraction > 0.0 { a.slerp(*b, fraction) } else { *a })
        });
        DMat4::from_scale_rotation_translation(
            vector(&self.scales, rest_scale),
            rotation.unwrap_or(rest_rotation),
            vector(&self.translations, rest_translation),
        )
    }
}

/// A tree of joints.
#[derive(Debug)]
pub(super) struct Skeleton {
    pub(super) joints: Vec<String>,
    /// The joint above each, of lower index.
    parents: Vec<Option<usize>>,
    binding: Vec<DMat4>,
    rest: Vec<DMat4>,
    animation: Option<Animation>,
    /// Where in the animation each joint is.
    animated: Vec<Option<usize>>,
    /// The object that the skeleton is.
    pub(super) object: usize,
}

impl Skeleton {
    /// # Errors
    /// Lists of differing length; a joint that comes before the one above it.
    pub(super) fn new(
        joints: Vec<String>,
        binding: Vec<DMat4>,
        rest: Vec<DMat4>,
        animation: Option<Animation>,
        object: usize,
    ) -> Result<Self, Damage> {
        for (what, list) in [("bindTransforms", &binding), ("restTransforms", &rest)] {
            if !list.is_empty() && list.len() != joints.len() {
                return Err(Damage::plain(format!(
                    "the skeleton has {} joints, but {} {what}",
                    joints.len(),
                    list.len()
                )));
            }
        }
        let index: std::collections::HashMap<&str, usize> =
            joints.iter().enumerate().map(|(index, joint)| (joint.as_str(), index)).collect();
        let mut parents = Vec::with_capacity(joints.len());
        for (own, joint) in joints.iter().enumerate() {
            // A joint may be left out; then the next one above it carries those below.
            let mut above = joint.as_str();
            let parent = loop {
                let Some((rest, _)) = above.rsplit_once('/') else { break None };
                above = rest;
                if let Some(&parent) = index.get(above) {
                    break Some(parent);
                }
            };
            if parent.is_some_and(|parent| parent >= own) {
                return Err(Damage::plain(format!("the joint {joint} comes before the one above it")));
            }
            parents.push(parent);
        }
        let animated = joints
            .iter()
            .map(|joint| animation.as_ref()?.joints.iter().position(|animated| animated == joint))
            .collect();
        Ok(Self { joints, parents, binding, rest, animation, animated, object })
    }

    /// Which of the animation's weights a blend shape follows.
    pub(super) fn shape(&self, name: &str) -> Option<usize> {
        self.animation.as_ref()?.shapes.iter().position(|shape| shape == name)
    }

    /// From where each joint was when meshes were bound to where it is, in the skeleton's space.
    fn bones(&self, time_s: f64) -> Vec<DMat4> {
        let mut now: Vec<DMat4> = Vec::with_capacity(self.joints.len());
        for (joint, parent) in self.parents.iter().enumerate() {
            let rest = self.rest.get(joint).copied().unwrap_or(DMat4::IDENTITY);
            let local = match (&self.animation, self.animated[joint]) {
                (Some(animation), Some(index)) => animation.local(index, rest, time_s),
                _ => rest,
            };
            now.push(parent.map_or(local, |parent| now[parent] * local));
        }
        for (joint, now) in now.iter_mut().enumerate() {
            *now *= self.binding.get(joint).copied().unwrap_or(DMat4::IDENTITY).inverse();
        }
        now
    }
}

/// A shape that a mesh takes on in part.
#[derive(Debug)]
pub(super) struct BlendShape {
    /// Which of the animation's weights it follows.
    pub(super) weight: usize,
    /// Which points it moves; all, where none are listed.
    pub(super) points: Vec<u32>,
    /// How far, at weights in ascending order: the shapes in between and the whole at 1.
    pub(super) steps: Vec<(f64, Vec<[f32; 3]>)>,
}

impl BlendShape {
    fn add(&self, weight: f64, points: &mut [DVec3]) -> Result<(), Damage> {
        // The shape at weight 0 moves nothing. Beyond the ends the outermost part goes on.
        let at = |index: usize| match index.checked_sub(1) {
            None => (0.0, None),
            Some(step) => (self.steps[step].0, Some(self.steps[step].1.as_slice())),
        };
        let last = self.steps.len();
        let upper = (1..=last).find(|&index| weight <= at(index).0).unwrap_or(last);
        let Some(lower) = upper.checked_sub(1) else { return Ok(()) };
        let ((from, before), (to, after)) = (at(lower), at(upper));
        let share = (weight - from) / (to - from);
        for (offsets, factor) in [(before, 1.0 - share), (after, share)] {
            let Some(offsets) = offsets else { continue };
            if factor == 0.0 {
                continue;
            }
            for (index, offset) in offsets.iter().enumerate() {
                let point = if self.points.is_empty() {
                    Some(index)
                } else {
                    self.points.get(index).map(|i| *i as usize)
                };
                let Some(moved) = point.and_then(|point| points.get_mut(point)) else {
                    return Err(Damage::plain("a blend shape moves points that the mesh does not have"));
                };
                *moved += DVec3::from(offset.map(f64::from)) * factor;
            }
        }
        Ok(())
    }
}

/// How a mesh hangs on a skeleton.
#[derive(Debug)]
pub(super) struct Skin {
    pub(super) skeleton: Arc<Skeleton>,
    /// The mesh's own order of joints, as indices of the skeleton's; empty where it is the same.
    pub(super) joints: Vec<usize>,
    pub(super) indices: Vec<u32>,
    pub(super) weights: Vec<f32>,
    /// Joints to a point.
    pub(super) per_point: usize,
    /// The same joints move all points.
    pub(super) rigid: bool,
    pub(super) bind: DMat4,
    pub(super) shapes: Vec<BlendShape>,
}

impl Skin {
    /// True where it moves with time.
    pub(super) fn moves(&self) -> bool {
        !self.times_s().is_empty()
    }

    /// When it moves.
    pub(super) fn times_s(&self) -> Vec<f64> {
        self.skeleton.animation.as_ref().map(Animation::times_s).unwrap_or_default()
    }

    /// Moves points. True where bones did, so that the points are in the skeleton's space then.
    ///
    /// # Errors
    /// Weights or shapes that do not fit the points.
    pub(super) fn bend(&self, time_s: f64, points: &mut [DVec3]) -> Result<bool, Damage> {
        if let Some(weights) = self.skeleton.animation.as_ref().and_then(|a| a.shape_weights.as_ref()) {
            let (before, after, fraction) = weights.around(time_s);
            for shape in &self.shapes {
                let (Some(a), Some(b)) = (before.get(shape.weight), after.get(shape.weight)) else {
                    continue;
                };
                shape.add(f64::from(*a) * (1.0 - fraction) + f64::from(*b) * fraction, points)?;
            }
        }
        if self.indices.is_empty() {
            return Ok(false);
        }
        let expected = if self.rigid { self.per_point } else { self.per_point * points.len() };
        if self.indices.len() != expected || self.weights.len() != expected {
            return Err(Damage::plain(format!(
                "{} joints and {} weights for {} points with {} each",
                self.indices.len(),
                self.weights.len(),
                points.len(),
                self.per_point
            )));
        }
        let bones: Vec<DMat4> =
            self.skeleton.bones(time_s).into_iter().map(|bone| bone * self.bind).collect();
        for (index, point) in points.iter_mut().enumerate() {
            let first = if self.rigid { 0 } else { index * self.per_point };
            let own = first..first + self.per_point;
            let mut moved = DVec3::ZERO;
            for (&joint, &weight) in self.indices[own.clone()].iter().zip(&self.weights[own]) {
                if weight == 0.0 {
                    continue;
                }
                let joint = joint as usize;
                let joint = if self.joints.is_empty() { Some(&joint) } else { self.joints.get(joint) };
                let Some(bone) = joint.and_then(|&joint| bones.get(joint)) else {
                    return Err(Damage::plain("a point hangs on a joint that the skeleton does not have"));
                };
                moved += bone.transform_point3(*point) * f64::from(weight);
            }
            *point = moved;
        }
        Ok(true)
    }
}
