//! Transforms: a list of operations whose numbers change, and whether what is above is inherited.
//!
//! The operations are written outermost first: with column vectors, `local = op0 * op1 * …`. The
//! hints by which programs recognise their own operations (pivots, orders of rotation) change
//! nothing about where things are and are not read.

use std::mem::size_of;
use std::sync::Arc;

use glam::{DMat4, DVec3};

use super::archive::{Archive, Compound};
use super::fault::{Allowance, Fault, Outcome};
use super::ogawa::Ogawa;
use super::property::{Pod, Property};
use super::time_sampling::union;
use crate::scene::animation::KeyTimes;
use crate::scene::between::between;
use crate::scene::sample_cache::{Ledger, SampleCache};

/// One step of a transform, and so many of the sample's numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Operation {
    /// Factors along x, y, z.
    Scale,
    /// A displacement.
    Translate,
    /// An axis and an angle in degrees.
    Rotate,
    /// Sixteen numbers, row by row for row vectors.
    Matrix,
    /// An angle in degrees about x.
    RotateX,
    /// An angle in degrees about y.
    RotateY,
    /// An angle in degrees about z.
    RotateZ,
}

impl Operation {
    /// The upper half of the byte is the operation, the lower half its hint.
    fn new(code: u8) -> Option<Self> {
        use Operation::*;
        [Scale, Translate, Rotate, Matrix, RotateX, RotateY, RotateZ].get(usize::from(code >> 4)).copied()
    }

    fn channels(self) -> usize {
        match self {
            Operation::Scale | Operation::Translate => 3,
            Operation::Rotate => 4,
            Operation::Matrix => 16,
            Operation::RotateX | Operation::RotateY | Operation::RotateZ => 1,
        }
    }

    /// Its matrix from as many values as it has channels.
    fn matrix(self, values: &[f64]) -> DMat4 {
        let value = |index: usize| values.get(index).copied().unwrap_or_default();
        let vector = DVec3::new(value(0), value(1), value(2));
        match self {
            Operation::Scale => DMat4::from_scale(vector),
            Operation::Translate => DMat4::from_translation(vector),
            // About no axis there is no rotation.
            Operation::Rotate => match vector.try_normalize() {
                Some(axis) => DMat4::from_axis_angle(axis, value(3).to_radians()),
                None => DMat4::IDENTITY,
            },
            // Rows for row vectors are columns for column vectors.
            Operation::Matrix => {
                values.try_into().map_or(DMat4::IDENTITY, |values| DMat4::from_cols_array(&values))
            }
            Operation::RotateX => DMat4::from_rotation_x(value(0).to_radians()),
            Operation::RotateY => DMat4::from_rotation_y(value(0).to_radians()),
            Operation::RotateZ => DMat4::from_rotation_z(value(0).to_radians()),
        }
    }
}

/// Whether the transforms above apply.
#[derive(Debug)]
enum Inherits {
    Always(bool),
    Sampled(Property),
}

/// A transform that may move.
#[derive(Debug)]
pub(super) struct Xform {
    operations: Vec<Operation>,
    /// The numbers of all operations; none where nothing was ever written.
    values: Option<Property>,
    inherits: Inherits,
    cache: SampleCache<u32, DMat4>,
}

impl Xform {
    /// From its schema's compound.
    ///
    /// # Errors
    /// Damage.
    pub(super) fn new(
        compound: &Compound,
        archive: &Archive,
        ledger: &Arc<Ledger>,
        memory: &mut Allowance,
    ) -> Outcome<Self> {
        let ogawa = &archive.ogawa;
        let operations = match compound.property(".ops", archive)? {
            Some(property) if !property.is_empty() => {
                if property.pod() != Pod::U8 {
                    return Err(property.wrong_type("bytes that name operations"));
                }
                // An element is all operations of a scalar property, at most 255, or one of an array.
                memory.charge(property.elements(0, ogawa)?.saturating_mul(255))?;
                let codes = property.bytes(0, ogawa)?;
                let operation = |code: &u8| {
                    Operation::new(*code).ok_or_else(|| {
                        Fault::new(
                            format!("the transform has an unknown operation {code:#04x}"),
                            "export it again with matrices",
                        )
                    })
                };
                codes.iter().map(operation).collect::<Outcome<Vec<_>>>()?
            }
            _ => Vec::new(),
        };
        let values = compound.property(".vals", archive)?.filter(|property| !property.is_empty());
        let inherits = match compound.property(".inherits", archive)? {
            Some(property) if property.is_empty() => Inherits::Always(true),
            Some(property) if property.is_constant() => Inherits::Always(flag(&property, 0, ogawa)?),
            Some(property) => Inherits::Sampled(property),
            None => Inherits::Always(true),
        };
        Ok(Self { operations, values, inherits, cache: SampleCache::new(ledger) })
    }

    /// When it changes.
    ///
    /// # Errors
    /// Times too many for the allowance.
    pub(super) fn key_times(&self, memory: &mut Allowance) -> Outcome<KeyTimes> {
        let values = self.values.as_ref().map_or(Ok(KeyTimes::Static), |values| values.key_times(memory))?;
        match &self.inherits {
            Inherits::Always(_) => Ok(values),
            Inherits::Sampled(property) => union(&values, &property.key_times(memory)?, memory),
        }
    }

    /// The local matrix at a time.
    ///
    /// # Errors
    /// A sample that cannot be read.
    pub(super) fn local(&self, time_s: f64, ogawa: &Ogawa) -> Outcome<DMat4> {
        let Some(values) = &self.values else { return Ok(DMat4::IDENTITY) };
        let bracket = values.bracket(time_s);
        let (floor, ceiling) = (values.stored(bracket.floor), values.stored(bracket.ceiling));
        let before = self.sample(values, floor, ogawa)?;
        if floor == ceiling {
            return Ok(before);
        }
        Ok(between(before, self.sample(values, ceiling, ogawa)?, bracket.fraction))
    }

    /// Whether the transforms above apply at a time.
    ///
    /// # Errors
    /// A sample that cannot be read.
    pub(super) fn inherits(&self, time_s: f64, ogawa: &Ogawa) -> Outcome<bool> {
        match &self.inherits {
            Inherits::Always(inherits) => Ok(*inherits),
            Inherits::Sampled(property) => {
                flag(property, property.stored(property.bracket(time_s).floor), ogawa)
            }
        }
    }

    fn sample(&self, values: &Property, stored: u32, ogawa: &Ogawa) -> Outcome<DMat4> {
        let read = || {
            let values = values.f64s(stored, ogawa)?;
            let mut rest = values.as_slice();
            let mut local = DMat4::IDENTITY;
            for operation in &self.operations {
                let Some((own, others)) = rest.split_at_checked(operation.channels()) else {
                    let needed: usize = self.operations.iter().map(|operation| operation.channels()).sum();
                    return Err(Fault::new(
                        format!(
                            "the transform's operations take {needed} numbers, but a sample has {}",
                            values.len()
                        ),
                        "the file is damaged: export it again",
                    ));
                };
                local *= operation.matrix(own);
                rest = others;
            }
            Ok(local)
        };
        self.cache.get(stored, read, |_| size_of::<DMat4>() as u64).map(|matrix| *matrix)
    }
}

fn flag(property: &Property, stored: u32, ogawa: &Ogawa) -> Outcome<bool> {
    if property.pod() != Pod::Bool || property.elements(stored, ogawa)? > 1 {
        return Err(property.wrong_type("a single flag"));
    }
    Ok(property.bytes(stored, ogawa)?.first().is_none_or(|byte| *byte != 0))
}
