//! Local transforms: a list of operations, each of which may move.
//!
//! With column vectors the matrix is the product of the operations in the order in which
//! `xformOpOrder` lists them. Between two samples the whole matrix is taken apart as in Alembic, so
//! that rotations go the shorter way. Where an angle moves by half a turn or more from one sample to
//! the next there is no shorter way to be trusted, and each operation is interpolated for itself, as
//! USD does: so a wheel that is keyed once in ten turns makes ten turns.

use glam::{DMat4, DQuat, DVec3};

use super::samples::{Bracket, Samples, merged};
use super::value::quaternion;
use crate::scene::between::between;

/// What an operation does with its numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Translate,
    Scale,
    /// About the axes in this order, in degrees; the first is done first.
    Rotate(&'static [usize]),
    Orient,
    Transform,
    /// Along one axis alone.
    TranslateAlong(usize),
    ScaleAlong(usize),
}

impl Kind {
    /// By the part of the attribute's name after `xformOp:`, up to a suffix.
    pub(super) fn new(name: &str) -> Option<Self> {
        Some(match name {
            "translate" => Kind::Translate,
            "scale" => Kind::Scale,
            "orient" => Kind::Orient,
            "transform" => Kind::Transform,
            "rotateX" => Kind::Rotate(&[0]),
            "rotateY" => Kind::Rotate(&[1]),
            "rotateZ" => Kind::Rotate(&[2]),
            "rotateXYZ" => Kind::Rotate(&[0, 1, 2]),
            "rotateXZY" => Kind::Rotate(&[0, 2, 1]),
            "rotateYXZ" => Kind::Rotate(&[1, 0, 2]),
            "rotateYZX" => Kind::Rotate(&[1, 2, 0]),
            "rotateZXY" => Kind::Rotate(&[2, 0, 1]),
            "rotateZYX" => Kind::Rotate(&[2, 1, 0]),
            "translateX" => Kind::TranslateAlong(0),
            "translateY" => Kind::TranslateAlong(1),
            "translateZ" => Kind::TranslateAlong(2),
            "scaleX" => Kind::ScaleAlong(0),
            "scaleY" => Kind::ScaleAlong(1),
            "scaleZ" => Kind::ScaleAlong(2),
            _ => return None,
        })
    }

    /// How many numbers it takes.
    pub(super) fn numbers(self) -> usize {
        match self {
            Kind::Translate | Kind::Scale => 3,
            Kind::Rotate(axes) => axes.len(),
            Kind::Orient => 4,
            Kind::Transform => 16,
            Kind::TranslateAlong(_) | Kind::ScaleAlong(_) => 1,
        }
    }

    fn matrix(self, numbers: &[f64]) -> DMat4 {
        let number = |index: usize| numbers.get(index).copied().unwrap_or_default();
        let vector = DVec3::new(number(0), number(1), number(2));
        let along = |axis: usize, rest: f64| {
            let mut vector = DVec3::splat(rest);
            vector[axis] = number(0);
            vector
        };
        match self {
            Kind::Translate => DMat4::from_translation(vector),
            Kind::Scale => DMat4::from_scale(vector),
            Kind::Rotate(axes) => {
                let single = axes.len() == 1;
                axes.iter().fold(DMat4::IDENTITY, |done, &axis| {
                    let angle = number(if single { 0 } else { axis }).to_radians();
                    DMat4::from_quat(DQuat::from_axis_angle(DVec3::AXES[axis], angle)) * done
                })
            }
            Kind::Orient => DMat4::from_quat(quaternion([number(0), number(1), number(2), number(3)])),
            Kind::Transform => {
                let mut array = [0.0; 16];
                array.iter_mut().zip(numbers).for_each(|(to, from)| *to = *from);
                DMat4::from_cols_array(&array)
            }
            Kind::TranslateAlong(axis) => DMat4::from_translation(along(axis, 0.0)),
            Kind::ScaleAlong(axis) => DMat4::from_scale(along(axis, 1.0)),
        }
    }
}

/// One operation.
#[derive(Debug, Clone)]
pub(super) struct Operation {
    pub(super) kind: Kind,
    /// The operation undoes what it says, as the second half of a pivot does.
    pub(super) inverted: bool,
    pub(super) numbers: Samples<Vec<f64>>,
}

impl Operation {
    /// Its matrix, interpolated for itself.
    fn at(&self, time_s: f64) -> DMat4 {
        let (before, after, fraction) = self.numbers.around(time_s);
        let matrix = if self.kind == Kind::Orient && fraction > 0.0 {
            let of = |numbers: &[f64]| match numbers {
                &[w, x, y, z] => quaternion([w, x, y, z]),
                _ => DQuat::IDENTITY,
            };
            DMat4::from_quat(of(before).slerp(of(after), fraction))
        } else {
            let mix = |(a, b): (&f64, &f64)| a * (1.0 - fraction) + b * fraction;
            let numbers: Vec<f64> = before.iter().zip(after.iter()).map(mix).collect();
            self.kind.matrix(&numbers)
        };
        if self.inverted { matrix.inverse() } else { matrix }
    }

    /// True where an angle moves by half a turn or more between neighbouring samples.
    fn turns_far(&self) -> bool {
        if !matches!(self.kind, Kind::Rotate(_)) {
            return false;
        }
        let angles: Vec<_> = self.numbers.times_s().iter().map(|&time_s| self.numbers.held(time_s)).collect();
        let far = |(a, b): (&f64, &f64)| (a - b).abs() >= 180.0;
        angles.windows(2).any(|pair| pair[0].iter().zip(pair[1].iter()).any(far))
    }
}

/// The transform of a prim against what is above it.
#[derive(Debug, Default)]
pub(super) struct Xform {
    times_s: Vec<f64>,
    /// One per time, or just one, or none for no transform at all.
    matrices: Vec<DMat4>,
    /// Kept where each is interpolated for itself.
    operations: Vec<Operation>,
    /// What is above it does not move it.
    pub(super) resets: bool,
}

impl Xform {
    pub(super) fn new(operations: Vec<Operation>, resets: bool) -> Self {
        let times_s = merged(operations.iter().map(|operation| operation.numbers.times_s()));
        let at = |time_s| product(&operations, time_s);
        let matrices = match times_s.as_slice() {
            [] if operations.is_empty() => Vec::new(),
            [] => vec![at(0.0)],
            times_s => times_s.iter().map(|&time_s| at(time_s)).collect(),
        };
        let turns_far = operations.iter().any(Operation::turns_far);
        Self { times_s, matrices, operations: if turns_far { operations } else { Vec::new() }, resets }
    }

    pub(super) fn times_s(&self) -> &[f64] {
        &self.times_s
    }

    /// The local matrix at a time.
    pub(super) fn at(&self, time_s: f64) -> DMat4 {
        if !self.operations.is_empty() {
            return product(&self.operations, time_s);
        }
        let Bracket { floor, ceiling, fraction } = Bracket::of(&self.times_s, time_s);
        match (self.matrices.get(floor), self.matrices.get(ceiling)) {
            (Some(before), Some(after)) if floor != ceiling => between(*before, *after, fraction),
            (Some(matrix), _) => *matrix,
            _ => DMat4::IDENTITY,
        }
    }
}

fn product(operations: &[Operation], time_s: f64) -> DMat4 {
    operations.iter().fold(DMat4::IDENTITY, |product, operation| product * operation.at(time_s))
}
