//! Accessors: typed arrays in buffers, every range of which is checked before it is read.

use super::buffer::Buffer;
use super::document::{Accessor, BufferView, Kind, Sparse, compressed};
use super::fault::damage;
use crate::{Error, Place, Result};

/// What an accessor without bytes of its own, all zeros, may take even in a small file.
const SMALL: u64 = 16 << 20;

/// How many bytes are read at a time: values that lie among others are taken out of them.
const BLOCK_BYTES: u64 = 1 << 18;

/// A component type, by its number in OpenGL.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn new(code: u32) -> Option<Self> {
        use Component::*;
        Some(match code {
            5120 => I8,
            5121 => U8,
            5122 => I16,
            5123 => U16,
            5125 => U32,
            5126 => F32,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Component::I8 | Component::U8 => 1,
            Component::I16 | Component::U16 => 2,
            Component::U32 | Component::F32 => 4,
        }
    }

    /// The value of its bytes, little-endian, as many as its size.
    fn float(self, bytes: &[u8], normalized: bool) -> f32 {
        let integer = |most: f32, value: f32| if normalized { (value / most).max(-1.0) } else { value };
        match (self, bytes) {
            (Component::I8, &[a]) => integer(127.0, f32::from(a.cast_signed())),
            (Component::U8, &[a]) => integer(255.0, f32::from(a)),
            (Component::I16, &[a, b]) => integer(32767.0, f32::from(i16::from_le_bytes([a, b]))),
            (Component::U16, &[a, b]) => integer(65535.0, f32::from(u16::from_le_bytes([a, b]))),
            (Component::U32, &[a, b, c, d]) => u32::from_le_bytes([a, b, c, d]) as f32,
            (Component::F32, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]),
            _ => 0.0,
        }
    }

    /// The value of the bytes of an unsigned type.
    fn index(bytes: &[u8]) -> u32 {
        bytes.iter().rev().fold(0, |value, byte| value << 8 | u32::from(*byte))
    }
}

impl Kind {
    fn components(self) -> usize {
        match self {
            Kind::Scalar => 1,
            Kind::Vec2 => 2,
            Kind::Vec3 => 3,
            Kind::Vec4 | Kind::Mat2 => 4,
            Kind::Mat3 => 9,
            Kind::Mat4 => 16,
        }
    }
}

/// What integers mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Integers {
    /// What the accessor says: themselves, or parts of the greatest.
    AsWritten,
    /// Always parts of the greatest.
    Normalized,
    /// They are not allowed.
    Refused,
}

/// All arrays of a file.
#[derive(Debug)]
pub(super) struct Data {
    pub(super) accessors: Vec<Accessor>,
    pub(super) views: Vec<BufferView>,
    pub(super) buffers: Vec<Buffer>,
    /// The extension by which data may be compressed.
    pub(super) compression: Option<String>,
}

impl Data {
    /// How many bytes stand behind all buffers.
    pub(super) fn backed(&self) -> u64 {
        self.buffers.iter().map(Buffer::backed).fold(0, u64::saturating_add)
    }

    /// How many elements an accessor has; `of` says what refers to it.
    ///
    /// # Errors
    /// An accessor that is not there.
    pub(super) fn count(&self, accessor: usize, of: &dyn Fn() -> String) -> Result<usize> {
        let count = self.accessor(accessor, of)?.count;
        usize::try_from(count).map_err(|_| damage(part(accessor), format!("{count} elements are too many")))
    }

    /// The components of all elements, one after another.
    ///
    /// # Errors
    /// An accessor that is not there, is of another kind, or reaches beyond its buffer.
    pub(super) fn floats(
        &self,
        accessor: usize,
        kind: Kind,
        integers: Integers,
        of: &dyn Fn() -> String,
    ) -> Result<Vec<f32>> {
        let written = self.accessor(accessor, of)?;
        let component = component(accessor, written.component_type)?;
        let refused =
            component == Component::U32 || (integers == Integers::Refused && component != Component::F32);
        if written.kind != kind || refused {
            return Err(self.wrong_type(accessor, kind, "numbers", of));
        }
        let normalized = written.normalized || integers == Integers::Normalized;
        self.components(accessor, written, component, |bytes| component.float(bytes, normalized))
    }

    /// Whole numbers from 0, the components of all elements one after another.
    ///
    /// # Errors
    /// An accessor that is not there, is of another kind, or reaches beyond its buffer.
    pub(super) fn indices(&self, accessor: usize, kind: Kind, of: &dyn Fn() -> String) -> Result<Vec<u32>> {
        let written = self.accessor(accessor, of)?;
        let component = component(accessor, written.component_type)?;
        let unsigned = matches!(component, Component::U8 | Component::U16 | Component::U32);
        if written.kind != kind || !unsigned || written.normalized {
            return Err(self.wrong_type(accessor, kind, "whole numbers from 0", of));
        }
        self.components(accessor, written, component, Component::index)
    }

    fn accessor(&self, accessor: usize, of: &dyn Fn() -> String) -> Result<&Accessor> {
        self.accessors.get(accessor).ok_or_else(|| {
            damage(of(), format!("there is no accessor {accessor}; there are {}", self.accessors.len()))
        })
    }

    fn wrong_type(&self, accessor: usize, kind: Kind, what: &str, of: &dyn Fn() -> String) -> Error {
        let found = &self.accessors[accessor];
        damage(
            part(accessor),
            format!(
                "{} needs {what} of the type {kind:?}; the accessor has the type {:?} and components {}",
                of(),
                found.kind,
                found.component_type
            ),
        )
    }

    fn components<T: Copy + Default>(
        &self,
        accessor: usize,
        written: &Accessor,
        component: Component,
        decode: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>> {
        let width = written.kind.components();
        let element = (width * component.size()) as u64;
        let total = written.count.saturating_mul(width as u64);
        let mut values = Vec::new();
        match written.buffer_view {
            Some(view) => {
                let array = Array { view, offset: written.byte_offset, element, count: written.count };
                self.read(accessor, &array, component, |bytes, count| {
                    // Now it is known that the buffer has as much.
                    if values.capacity() == 0 {
                        values.reserve_exact(count.saturating_mul(width));
                    }
                    values.push(decode(bytes));
                })?;
            }
            None => {
                if let (Some(name), None) = (&self.compression, &written.sparse) {
                    return Err(compressed(name).at(Place::Part(part(accessor))));
                }
                if total > (SMALL + 4 * self.backed()) / 4 {
                    return Err(damage(
                        part(accessor),
                        format!("{total} zeros are too many for the file's size"),
                    ));
                }
                values.resize(total as usize, T::default());
            }
        }
        if let Some(sparse) = &written.sparse {
            self.overwrite(accessor, written.count, sparse, component, width, &decode, &mut values)?;
        }
        Ok(values)
    }

    /// Puts the elements of a sparse list in their places.
    #[expect(clippy::too_many_arguments, reason = "they belong to one accessor")]
    fn overwrite<T: Copy>(
        &self,
        accessor: usize,
        count: u64,
        sparse: &Sparse,
        component: Component,
        width: usize,
        decode: &impl Fn(&[u8]) -> T,
        values: &mut [T],
    ) -> Result<()> {
        let kind = self::component(accessor, sparse.indices.component_type)?;
        if !matches!(kind, Component::U8 | Component::U16 | Component::U32) {
            return Err(damage(
                part(accessor),
                "the places of a sparse accessor must be whole numbers from 0",
            ));
        }
        let places = Array {
            view: sparse.indices.buffer_view,
            offset: sparse.indices.byte_offset,
            element: kind.size() as u64,
            count: sparse.count,
        };
        let mut at = Vec::new();
        self.read(accessor, &places, kind, |bytes, _| at.push(Component::index(bytes)))?;
        if let Some(&place) = at.iter().find(|&&place| u64::from(place) >= count) {
            let what = format!("its sparse list names element {place}; there are {count}");
            return Err(damage(part(accessor), what));
        }
        let element = (width * component.size()) as u64;
        let array = Array {
            view: sparse.values.buffer_view,
            offset: sparse.values.byte_offset,
            element,
            count: sparse.count,
        };
        let mut next = at.iter().flat_map(|&place| {
            let first = place as usize * width;
            first..first + width
        });
        self.read(accessor, &array, component, |bytes, _| {
            if let Some(value) = next.next().and_then(|index| values.get_mut(index)) {
                *value = decode(bytes);
            }
        })
    }

    /// Gives the bytes of every component of an array, and how many elements there are.
    fn read(
        &self,
        accessor: usize,
        array: &Array,
        component: Component,
        mut give: impl FnMut(&[u8], usize),
    ) -> Result<()> {
        let &Array { view, offset, element, count } = array;
        let fault = |what: String| damage(part(accessor), what);
        let Some(view) = self.views.get(view) else {
            return Err(fault(format!("there is no buffer view {view}; there are {}", self.views.len())));
        };
        let Some(buffer) = self.buffers.get(view.buffer) else {
            return Err(fault(format!(
                "there is no buffer {}; there are {}",
                view.buffer,
                self.buffers.len()
            )));
        };
        if view.byte_offset.checked_add(view.byte_length).is_none_or(|end| end > buffer.length) {
            return Err(fault(format!(
                "its buffer view has {} bytes from {} on, and the buffer ends at {}",
                view.byte_length, view.byte_offset, buffer.length
            )));
        }
        let stride = view.byte_stride.filter(|&stride| stride > 0).unwrap_or(element);
        if stride < element {
            return Err(fault(format!("its elements of {element} bytes are {stride} bytes apart")));
        }
        if count == 0 {
            return Ok(());
        }
        let end = (count - 1).checked_mul(stride).and_then(|last| last.checked_add(element));
        if end.and_then(|size| size.checked_add(offset)).is_none_or(|end| end > view.byte_length) {
            return Err(fault(format!(
                "{count} elements, {stride} bytes apart from byte {offset} on, do not fit the {} bytes of its \
                 buffer view",
                view.byte_length
            )));
        }
        if buffer.is_missing() {
            return Err(match &self.compression {
                Some(name) => compressed(name).at(Place::Part(part(accessor))),
                None => fault(format!("the buffer {} has no data", view.buffer)),
            });
        }
        let start = view.byte_offset + offset;
        let in_a_block = (BLOCK_BYTES / stride).max(1);
        let mut block = Vec::new();
        let mut first = 0;
        while first < count {
            let taken = in_a_block.min(count - first);
            block.resize(((taken - 1) * stride + element) as usize, 0);
            buffer
                .read(start + first * stride, &mut block)
                .map_err(|error| error.at(Place::Part(part(accessor))))?;
            for bytes in block.chunks(stride as usize) {
                for bytes in bytes[..element as usize].chunks_exact(component.size()) {
                    give(bytes, count as usize);
                }
            }
            first += taken;
        }
        Ok(())
    }
}

/// Elements of so many bytes, in a buffer view from an offset on.
struct Array {
    view: usize,
    offset: u64,
    element: u64,
    count: u64,
}

fn part(accessor: usize) -> String {
    format!("accessors[{accessor}]")
}

fn component(accessor: usize, code: u32) -> Result<Component> {
    Component::new(code).ok_or_else(|| damage(part(accessor), format!("there is no component type {code}")))
}
