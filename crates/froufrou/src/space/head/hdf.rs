//! The variables and attributes of a netCDF-4 file, which is HDF5 within.
//!
//! HDF5 is read by the crate hdf5-reader: it is written in Rust alone, knows both generations of superblocks
//! and groups and all chunk indexes, and holds what a file declares against limits that are set here. sofar,
//! which reads SOFA itself, keeps its reader of HDF5 to itself, chooses what it does with it (it brings sets
//! to another level and rate at once) and allocates what a file declares.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use hdf5_reader::{ByteOrder, Datatype, Hdf5File, OpenOptions};

use crate::{Error, Place, Result};

/// A larger file is no set of responses of a head.
const LARGEST_BYTES: u64 = 2 << 30;

/// Numbers and their names: what can be read is bounded by this much,
const FREE_BYTES: u64 = 8 << 20;

/// and so many times the file's length. (Deflate packs silence a thousandfold, but no measurement.)
const EXPANSION: u64 = 24;

/// A variable's numbers, the last index fastest.
pub(super) struct Variable {
    pub(super) name: &'static str,
    pub(super) shape: Vec<usize>,
    pub(super) values: Vec<f64>,
    /// Its attributes `Type` and `Units`.
    pub(super) kind: Option<String>,
    pub(super) units: Option<String>,
}

/// An open file.
pub(super) struct File {
    path: PathBuf,
    file: Hdf5File,
    /// What a variable may have of numbers.
    most_numbers: u64,
}

impl File {
    pub(super) fn open(path: &Path) -> Result<Self> {
        let io = |fault| {
            Error::io("read", path, fault).at(Place::Byte(0)).help("the file must be there and readable")
        };
        let length = std::fs::metadata(path).map_err(io)?.len();
        let fault = |what: String, help: &str| Error::new(what).in_file(path).at(Place::Byte(0)).help(help);
        if length > LARGEST_BYTES {
            return Err(fault(
                format!("the file has {length} bytes, expected a SOFA file of at most {LARGEST_BYTES}"),
                "choose a set of fewer directions",
            ));
        }
        let bytes = std::fs::read(path).map_err(io)?;
        if bytes.is_empty() {
            return Err(fault("the file is empty, expected a SOFA file".into(), "copy or download it again"));
        }
        if !bytes.starts_with(b"\x89HDF\r\n\x1a\n") {
            return Err(fault(
                "this is not a SOFA file, which begins as HDF5 does".into(),
                "name a .sofa file of the convention SimpleFreeFieldHRIR",
            ));
        }
        let most = (FREE_BYTES + EXPANSION * bytes.len() as u64) as usize;
        let options = OpenOptions {
            chunk_cache_bytes: 0,
            chunk_cache_slots: 0,
            max_chunk_bytes: most,
            max_read_bytes: most,
            max_object_header_bytes: bytes.len().min(8 << 20),
            ..OpenOptions::default()
        };
        let file = contained(path, "the file", || Hdf5File::from_vec_with_options(bytes, options))?;
        Ok(Self { path: path.to_path_buf(), file, most_numbers: most as u64 / 8 })
    }

    /// An error about a variable or an attribute of the file.
    pub(super) fn fault(&self, part: &str, what: impl Into<String>, help: &str) -> Error {
        Error::new(what).in_file(&self.path).at(Place::Part(part.to_owned())).help(help)
    }

    /// An attribute of the whole file, where it is a text.
    pub(super) fn attribute(&self, name: &str) -> Result<Option<String>> {
        contained(&self.path, name, || {
            let attributes = self.file.root_group()?.attributes()?;
            Ok(attributes.iter().find(|attribute| attribute.name == name).and_then(text))
        })
    }

    /// A variable, where it is there; one that holds anything but numbers is an error.
    pub(super) fn variable(&self, name: &'static str) -> Result<Option<Variable>> {
        let dataset = match catch_unwind(AssertUnwindSafe(|| self.file.dataset(name))) {
            Ok(Err(fault)) if is_missing(&fault) => return Ok(None),
            Ok(found) => found.map_err(|fault| damaged(&self.path, name, &fault.to_string()))?,
            Err(_) => return Err(damaged(&self.path, name, "its description makes no sense")),
        };
        let numbers = dataset.shape().iter().try_fold(1_u64, |product, n| product.checked_mul(*n));
        if numbers.is_none_or(|numbers| numbers > self.most_numbers) {
            return Err(self.fault(
                name,
                format!("the shape {:?} is too large for the length of the file", dataset.shape()),
                "the file is damaged: copy or download it again",
            ));
        }
        let bytes = contained(&self.path, name, || dataset.read_raw_bytes())?;
        let values = decode(&bytes, dataset.dtype()).ok_or_else(|| {
            self.fault(
                name,
                format!("values of type {:?}, expected numbers", dataset.dtype()),
                "store them as numbers of 32 or 64 bits",
            )
        })?;
        let shape: Vec<usize> = dataset.shape().iter().map(|n| *n as usize).collect();
        if numbers != Some(values.len() as u64) {
            return Err(damaged(&self.path, name, "there are fewer values than its shape says"));
        }
        let attribute = |name| {
            catch_unwind(AssertUnwindSafe(|| dataset.attribute(name).ok().as_ref().and_then(text)))
                .unwrap_or(None)
        };
        let (kind, units) = (attribute("Type"), attribute("Units"));
        Ok(Some(Variable { name, shape, values, kind, units }))
    }
}

/// Runs what a library does with bytes of the file. It is written to give errors; a panic of its own becomes
/// one as well.
fn contained<T>(path: &Path, part: &str, run: impl FnOnce() -> hdf5_reader::error::Result<T>) -> Result<T> {
    match catch_unwind(AssertUnwindSafe(run)) {
        Ok(result) => result.map_err(|fault| damaged(path, part, &fault.to_string())),
        Err(_) => Err(damaged(path, part, "its description makes no sense")),
    }
}

/// Whether a library's error says that there is no such variable.
fn is_missing(fault: &hdf5_reader::error::Error) -> bool {
    match fault {
        hdf5_reader::error::Error::DatasetNotFound(_) => true,
        hdf5_reader::error::Error::Context { source, .. } => is_missing(source),
        _ => false,
    }
}

fn damaged(path: &Path, part: &str, what: &str) -> Error {
    Error::new(format!("it cannot be read as HDF5: {what}"))
        .in_file(path)
        .at(Place::Part(part.to_owned()))
        .help("the file is damaged or cut short: copy or download it again")
}

/// An attribute's text, without the zeros that pad it.
fn text(attribute: &hdf5_reader::Attribute) -> Option<String> {
    let text = attribute.read_string().ok()?;
    Some(text.trim_matches(|c: char| c == '\0' || c.is_whitespace()).to_owned())
}

/// Numbers as they lie in the file.
fn decode(bytes: &[u8], datatype: &Datatype) -> Option<Vec<f64>> {
    fn numbers<const N: usize>(bytes: &[u8], order: ByteOrder, read: fn([u8; N]) -> f64) -> Vec<f64> {
        let ordered = |chunk: &[u8]| {
            let mut number = [0; N];
            number.copy_from_slice(chunk);
            if order == ByteOrder::BigEndian {
                number.reverse();
            }
            read(number)
        };
        bytes.chunks_exact(N).map(ordered).collect()
    }
    Some(match *datatype {
        Datatype::FloatingPoint { size: 4, byte_order } => {
            numbers(bytes, byte_order, |number| f64::from(f32::from_le_bytes(number)))
        }
        Datatype::FloatingPoint { size: 8, byte_order } => numbers(bytes, byte_order, f64::from_le_bytes),
        Datatype::FixedPoint { size: 1, signed: true, byte_order } => {
            numbers(bytes, byte_order, |number| f64::from(i8::from_le_bytes(number)))
        }
        Datatype::FixedPoint { size: 2, signed: true, byte_order } => {
            numbers(bytes, byte_order, |number| f64::from(i16::from_le_bytes(number)))
        }
        Datatype::FixedPoint { size: 4, signed: true, byte_order } => {
            numbers(bytes, byte_order, |number| f64::from(i32::from_le_bytes(number)))
        }
        Datatype::FixedPoint { size: 8, signed: true, byte_order } => {
            numbers(bytes, byte_order, |number| i64::from_le_bytes(number) as f64)
        }
        _ => return None,
    })
}
