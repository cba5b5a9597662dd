//! Properties that hold values: where their samples are, and the values of one.

use std::sync::Arc;

use super::fault::{Allowance, Fault, Outcome};
use super::ogawa::{Block, Group, Ogawa};
use super::time_sampling::TimeSampling;
use crate::scene::animation::KeyTimes;
use crate::scene::bracket::Bracket;

/// The hash of its values that begins the block of a sample.
const KEY_SIZE: u64 = 16;

/// The type of a single value; strings are a byte with an end, wide strings are not read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Pod {
    Bool,
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F16,
    F32,
    F64,
    String,
    WideString,
}

impl Pod {
    /// By the number it has in the file.
    pub(super) fn new(number: u32) -> Option<Self> {
        use Pod::*;
        let all = [Bool, U8, I8, U16, I16, U32, I32, U64, I64, F16, F32, F64, String, WideString];
        all.get(number as usize).copied()
    }

    fn size(self) -> u64 {
        match self {
            Pod::Bool | Pod::U8 | Pod::I8 | Pod::String => 1,
            Pod::U16 | Pod::I16 | Pod::F16 => 2,
            Pod::U32 | Pod::I32 | Pod::F32 | Pod::WideString => 4,
            Pod::U64 | Pod::I64 | Pod::F64 => 8,
        }
    }
}

/// A scalar or array property.
#[derive(Debug)]
pub(super) struct Property {
    name: String,
    pod: Pod,
    extent: u8,
    is_array: bool,
    samples: u32,
    /// The first sample that differs from sample 0, and the last that differs from the one before
    /// it; both 0 if none does. Only sample 0 and those from first to last are in the file.
    changes: (u32, u32),
    time: Arc<TimeSampling>,
    group: Group,
}

impl Property {
    /// From its header, which is held against the samples that are there.
    ///
    /// # Errors
    /// A header that contradicts itself or the file.
    pub(super) fn new(
        name: &str,
        pod: Pod,
        extent: u8,
        is_array: bool,
        (samples, changes): (u32, (u32, u32)),
        time: Arc<TimeSampling>,
        group: Group,
    ) -> Outcome<Self> {
        let property = Self { name: name.to_owned(), pod, extent, is_array, samples, changes, time, group };
        let (first, last) = changes;
        let stored = if samples == 0 {
            0
        } else if property.is_constant() {
            1
        } else if 1 <= first && first <= last && last < samples {
            u64::from(last - first) + 2
        } else {
            return Err(property.damage(format!(
                "has {samples} samples, of which {first} to {last} should be those that change"
            )));
        };
        // An array's sample is two blocks: its values and its dimensions.
        let blocks = if is_array { stored * 2 } else { stored };
        if group.children < blocks {
            return Err(property.damage(format!("needs {blocks} blocks but has {}", group.children)));
        }
        if !property.is_constant() && u64::from(samples) > property.time.most_samples() {
            return Err(property
                .damage(format!("has {samples} samples but only {} times", property.time.most_samples())));
        }
        Ok(property)
    }

    fn damage(&self, what: String) -> Fault {
        Fault::damage(self.group.position, format!("the property `{}` {what}", self.name))
    }

    /// True if it has no sample at all.
    pub(super) fn is_empty(&self) -> bool {
        self.samples == 0
    }

    /// True if all samples are alike.
    pub(super) fn is_constant(&self) -> bool {
        self.samples <= 1 || self.changes == (0, 0)
    }

    /// The type of its values.
    pub(super) fn pod(&self) -> Pod {
        self.pod
    }

    /// The samples around a time.
    pub(super) fn bracket(&self, time_s: f64) -> Bracket {
        if self.is_constant() { Bracket::at(0) } else { self.time.bracket(time_s, self.samples) }
    }

    /// The time of a sample in seconds.
    pub(super) fn time_s(&self, index: u32) -> f64 {
        self.time.time_s(index)
    }

    /// When it changes.
    ///
    /// # Errors
    /// Times too many for the allowance.
    pub(super) fn key_times(&self, memory: &mut Allowance) -> Outcome<KeyTimes> {
        if self.is_constant() {
            return Ok(KeyTimes::Static);
        }
        self.time.key_times(self.samples, memory).map_err(|fault| fault.at(self.group.position))
    }

    /// Which of the samples in the file stands for sample `index`: equal numbers, equal values.
    pub(super) fn stored(&self, index: u32) -> u32 {
        let (first, last) = self.changes;
        if self.is_constant() || index < first { 0 } else { index.min(last) - first + 1 }
    }

    /// The block of a stored sample.
    fn block(&self, stored: u32, ogawa: &Ogawa) -> Outcome<Block> {
        // Of an array's two blocks the second, its dimensions, tells nothing that a list of known
        // element type does not tell by its size.
        let index = if self.is_array { u64::from(stored) * 2 } else { u64::from(stored) };
        let block = ogawa.child_block(self.group, index)?;
        if block.size != 0 && block.size < KEY_SIZE {
            return Err(Fault::damage(
                block.position,
                format!("a sample of `{}` has {} bytes, fewer than its key", self.name, block.size),
            ));
        }
        Ok(block)
    }

    /// The number of elements of a stored sample, without reading them.
    ///
    /// # Errors
    /// Damage.
    pub(super) fn elements(&self, stored: u32, ogawa: &Ogawa) -> Outcome<u64> {
        let block = self.block(stored, ogawa)?;
        let bytes = block.size.saturating_sub(KEY_SIZE);
        let element = self.pod.size() * u64::from(self.extent);
        if element == 0 || !bytes.is_multiple_of(element) {
            return Err(Fault::damage(
                block.position,
                format!("a sample of `{}` has {bytes} bytes, not a multiple of {element}", self.name),
            ));
        }
        let elements = bytes / element;
        // A string's elements are its bytes.
        if !self.is_array && elements > 1 && !matches!(self.pod, Pod::String | Pod::WideString) {
            return Err(Fault::damage(
                block.position,
                format!("a sample of the scalar `{}` has {elements} elements", self.name),
            ));
        }
        Ok(elements)
    }

    /// The bytes of a stored sample: a whole number of elements.
    ///
    /// # Errors
    /// Damage, or a read that fails.
    pub(super) fn bytes(&self, stored: u32, ogawa: &Ogawa) -> Outcome<Vec<u8>> {
        self.elements(stored, ogawa)?;
        ogawa.read_from(self.block(stored, ogawa)?, KEY_SIZE)
    }

    /// A stored sample as floating-point numbers.
    ///
    /// # Errors
    /// Damage, or another type.
    pub(super) fn f64s(&self, stored: u32, ogawa: &Ogawa) -> Outcome<Vec<f64>> {
        let bytes = self.bytes(stored, ogawa)?;
        match self.pod {
            Pod::F64 => Ok(bytes.as_chunks().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect()),
            Pod::F32 => {
                Ok(bytes.as_chunks().0.iter().map(|bytes| f64::from(f32::from_le_bytes(*bytes))).collect())
            }
            _ => Err(self.wrong_type("floating-point numbers")),
        }
    }

    /// A stored sample as one number an element: its value, or the length of several.
    ///
    /// # Errors
    /// Damage, or another type.
    pub(super) fn lengths(&self, stored: u32, ogawa: &Ogawa) -> Outcome<Vec<f32>> {
        let numbers = self.f64s(stored, ogawa)?;
        let length = |element: &[f64]| match element {
            [value] => *value as f32,
            values => values.iter().map(|v| v * v).sum::<f64>().sqrt() as f32,
        };
        Ok(numbers.chunks_exact(usize::from(self.extent).max(1)).map(length).collect())
    }

    /// A stored sample as points.
    ///
    /// # Errors
    /// Damage, or another type.
    pub(super) fn points(&self, stored: u32, ogawa: &Ogawa) -> Outcome<Vec<[f32; 3]>> {
        if self.extent != 3 || !matches!(self.pod, Pod::F32 | Pod::F64) {
            return Err(self.wrong_type("points of three floating-point numbers"));
        }
        let bytes = self.bytes(stored, ogawa)?;
        if self.pod == Pod::F64 {
            let value = |bytes: [u8; 8]| f64::from_le_bytes(bytes) as f32;
            let points = bytes.as_chunks::<8>().0.as_chunks::<3>().0;
            return Ok(points.iter().map(|point| point.map(value)).collect());
        }
        let points = bytes.as_chunks::<4>().0.as_chunks::<3>().0;
        Ok(points.iter().map(|point| point.map(f32::from_le_bytes)).collect())
    }

    /// A stored sample as indices or counts, none of them negative.
    ///
    /// # Errors
    /// Damage, or another type.
    pub(super) fn indices(&self, stored: u32, ogawa: &Ogawa) -> Outcome<Vec<u32>> {
        if self.extent != 1 || !matches!(self.pod, Pod::I32 | Pod::U32) {
            return Err(self.wrong_type("integers of 32 bits"));
        }
        let bytes = self.bytes(stored, ogawa)?;
        let indices: Vec<u32> = bytes.as_chunks().0.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect();
        if indices.iter().any(|&index| index > i32::MAX as u32) {
            return Err(self.damage("holds a negative number".into()));
        }
        Ok(indices)
    }

    /// A property that cannot be what its schema says.
    pub(super) fn wrong_type(&self, expected: &str) -> Fault {
        self.damage(format!("holds {} values of type {:?}; {expected} were expected", self.extent, self.pod))
    }
}
