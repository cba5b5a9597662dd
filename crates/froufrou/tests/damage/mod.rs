//! What tests of damaged files share: the most memory that was ever held, a file whose bytes are
//! anything, and a reading of all that is in it.
#![allow(dead_code)] // Each test program uses a part of it.

#[path = "../allocation/mod.rs"]
mod allocation;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

pub use allocation::{most_held, turn};
use froufrou::Error;
use froufrou::scene::animation::{Animation, Mesh, ObjectKind};
use proptest::prelude::*;

/// Reads everything at a few times; the first error ends it, or else gives how many objects there are.
pub fn read_all(animation: &dyn Animation) -> Result<usize, Error> {
    let mut mesh = Mesh::default();
    for (index, object) in animation.objects().iter().enumerate().take(100) {
        let (first_s, last_s) = object.key_times.span_s().unwrap_or((0.0, 0.0));
        for time_s in [first_s, first_s + 0.013, last_s] {
            animation.transform(index, time_s)?;
            if object.kind == ObjectKind::Mesh {
                animation.mesh(index, time_s, &mut mesh)?;
                // What uses a mesh trusts its indices.
                assert!(mesh.face_vertices.iter().all(|v| (*v as usize) < mesh.positions.len()));
                let corners: usize = mesh.face_sizes.iter().map(|size| *size as usize).sum();
                assert_eq!(corners, mesh.face_vertices.len());
            }
        }
    }
    Ok(animation.objects().len())
}

/// What reading a file may take.
#[derive(Clone, Copy)]
pub struct Bounds {
    pub time: Duration,
    /// So much memory, whatever the file.
    pub base_bytes: usize,
    /// And so much more for each byte of the file.
    pub per_byte: usize,
}

impl Default for Bounds {
    fn default() -> Self {
        Self { time: Duration::from_secs(5), base_bytes: 48 << 20, per_byte: 64 }
    }
}

/// A folder for one file after another.
pub struct Scratch {
    pub folder: tempfile::TempDir,
    name: &'static str,
    /// Opens the file and reads everything; how many objects there are.
    read: fn(&Path) -> Result<usize, Error>,
    bounds: Bounds,
}

impl Scratch {
    pub fn new(name: &'static str, read: fn(&Path) -> Result<usize, Error>) -> Self {
        Self { folder: tempfile::tempdir().expect("a folder"), name, read, bounds: Bounds::default() }
    }

    /// Held to these bounds.
    pub fn within(self, bounds: Bounds) -> Self {
        Self { bounds, ..self }
    }

    pub fn path(&self) -> PathBuf {
        self.folder.path().join(self.name)
    }

    /// What reading gives, after checking that time, memory and the error are in order.
    pub fn try_bytes(&self, bytes: &[u8]) -> Result<usize, Error> {
        std::fs::write(self.path(), bytes).expect("a file");
        let begin = Instant::now();
        let (result, most) = most_held(|| (self.read)(&self.path()));
        let Bounds { time, base_bytes, per_byte } = self.bounds;
        assert!(begin.elapsed() < time, "it took {:?}", begin.elapsed());
        assert!(most < base_bytes + per_byte * bytes.len(), "{most} bytes for a file of {}", bytes.len());
        if let Err(error) = &result {
            assert!(error.file().is_some() && error.place().is_some(), "{error}");
            assert!(error.to_string().ends_with(')'), "no advice: {error}");
        }
        result
    }

    pub fn error(&self, bytes: impl AsRef<[u8]>) -> String {
        self.try_bytes(bytes.as_ref()).expect_err("this cannot be read").to_string()
    }
}

/// One of some files with some bytes overwritten.
pub fn overwritten(
    names: &'static [&'static str],
    fixture: fn(&str) -> Vec<u8>,
) -> impl Strategy<Value = Vec<u8>> {
    let places = prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..20);
    (prop::sample::select(names), places).prop_map(move |(name, places)| {
        let mut bytes = fixture(name);
        for (place, value) in places {
            let index = place.index(bytes.len());
            bytes[index] = value;
        }
        bytes
    })
}

/// One of some files with a number of eight bytes overwritten, at a multiple of some bytes.
pub fn renumbered(
    names: &'static [&'static str],
    fixture: fn(&str) -> Vec<u8>,
    aligned: usize,
) -> impl Strategy<Value = Vec<u8>> {
    let value = prop_oneof![
        Just(0_u64),
        Just(1),
        Just(u64::MAX),
        Just(i64::MAX as u64),
        Just(1 << 63),
        Just((1 << 63) | 16),
        Just(u64::from(u32::MAX)),
        0_u64..20_000,
        (0_u64..20_000).prop_map(|low| low | 1 << 63),
        any::<u64>(),
    ];
    (prop::sample::select(names), any::<prop::sample::Index>(), value).prop_map(
        move |(name, place, value)| {
            let mut bytes = fixture(name);
            let index = place.index((bytes.len() - 8) / aligned) * aligned;
            bytes[index..index + 8].copy_from_slice(&value.to_le_bytes());
            bytes
        },
    )
}
