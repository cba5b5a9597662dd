//! Large arrays on large pages.
//!
//! A search asks for places all over tens of megabytes. On pages of 4 kB each of them is somewhere the processor has to
//! look up, which makes the search of hours some 5 % slower; so Linux is asked for pages of 2 MB. Where it has none, and on
//! other systems, all is the same but for that.

use std::ops::Deref;

use pulp::bytemuck::Pod;

/// Smaller arrays stay where they are, in bytes.
#[cfg(target_os = "linux")]
const LARGE: usize = 4 << 20;

/// An array that does not change.
pub(super) enum Paged<T> {
    /// As any other.
    Own(Vec<T>),
    /// On large pages, and of so many items.
    #[cfg(target_os = "linux")]
    Mapped(memmap2::Mmap, usize),
}

impl<T: Pod> Paged<T> {
    /// Takes an array.
    pub fn new(values: Vec<T>) -> Self {
        #[cfg(target_os = "linux")]
        if let Some(mapped) = Self::mapped(&values) {
            return mapped;
        }
        Self::Own(values)
    }

    #[cfg(target_os = "linux")]
    fn mapped(values: &[T]) -> Option<Self> {
        let bytes: &[u8] = pulp::bytemuck::cast_slice(values);
        if bytes.len() < LARGE {
            return None;
        }
        let mut mapped = memmap2::MmapMut::map_anon(bytes.len()).ok()?;
        mapped.advise(memmap2::Advice::HugePage).ok()?;
        mapped.copy_from_slice(bytes);
        Some(Self::Mapped(mapped.make_read_only().ok()?, values.len()))
    }
}

impl<T: Pod> Deref for Paged<T> {
    type Target = [T];

    #[inline(always)]
    fn deref(&self) -> &[T] {
        match self {
            Self::Own(values) => values,
            #[cfg(target_os = "linux")]
            Self::Mapped(mapped, count) => &pulp::bytemuck::cast_slice(mapped)[..*count],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_what_was_taken() {
        for count in [0, 1, 1000, 1_048_575, 1_048_576, 1_048_577, 3_000_001] {
            let values: Vec<f32> = (0..count).map(|i| i as f32 * 0.5).collect();
            let paged = Paged::new(values.clone());
            assert!(*paged == *values, "{count}");
        }
        assert!(*Paged::new(vec![7u8; 5 << 20]) == vec![7u8; 5 << 20]);
    }
}
