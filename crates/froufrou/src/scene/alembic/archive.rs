//! The archive within the container: its version, time samplings and metadata, and the headers by
//! which objects and properties are known.
//!
//! ```text
//! root         0 format version, 1 library version, 2 the top object, 3 metadata of the archive,
//!              4 time samplings, 5 metadata that many objects and properties share
//! object       0 its properties (a compound), then one group per child object,
//!              last a block: the headers of the child objects and two hashes
//! compound     one group per property, last a block: the headers of the properties
//! ```

use std::path::Path;
use std::sync::Arc;

use super::fault::{Allowance, Fault, Outcome};
use super::ogawa::{Block, Child, Group, Ogawa};
use super::property::{Pod, Property};
use super::time_sampling::TimeSampling;
use crate::Result;

/// In a header, metadata that is not among the shared ones and follows in full.
const OWN_METADATA: usize = 0xff;

/// The hashes after the headers of child objects.
const HASHES_SIZE: usize = 32;

/// `key=value` pairs separated by `;`.
#[derive(Debug, Clone, Default)]
pub(super) struct Metadata(Arc<str>);

impl Metadata {
    fn new(bytes: &[u8]) -> Self {
        Self(String::from_utf8_lossy(bytes).into())
    }

    /// The value of a key, or nothing.
    pub(super) fn get(&self, key: &str) -> Option<&str> {
        self.0
            .split(';')
            .find_map(|pair| pair.split_once('=').filter(|(name, _)| *name == key))
            .map(|pair| pair.1)
    }
}

/// An open archive.
#[derive(Debug)]
pub(super) struct Archive {
    pub(super) ogawa: Ogawa,
    pub(super) metadata: Metadata,
    /// The group of the object that holds all others.
    pub(super) top: Group,
    time_samplings: Vec<Arc<TimeSampling>>,
    shared_metadata: Vec<Metadata>,
}

/// An object as its parent knows it.
#[derive(Debug)]
pub(super) struct ObjectHeader {
    pub(super) name: String,
    pub(super) metadata: Metadata,
}

/// A property as its compound knows it.
#[derive(Debug)]
struct PropertyHeader {
    name: String,
    kind: PropertyKind,
}

#[derive(Debug)]
enum PropertyKind {
    Compound,
    Values {
        pod: Pod,
        extent: u8,
        is_array: bool,
        samples: u32,
        changes: (u32, u32),
        time: Arc<TimeSampling>,
    },
}

/// A compound property: an index of named properties.
#[derive(Debug)]
pub(super) struct Compound {
    position: u64,
    children: Vec<Child>,
    headers: Vec<PropertyHeader>,
}

impl Archive {
    /// Opens an archive, reading all but its objects.
    ///
    /// # Errors
    /// A file that is not a finished Ogawa archive of a version that is known.
    pub(super) fn open(path: &Path, reading: &mut Allowance) -> Result<Self> {
        let (ogawa, root) = Ogawa::open(path)?;
        Self::index(ogawa, root, reading).map_err(|fault| fault.in_file(path))
    }

    fn index(ogawa: Ogawa, root: Group, reading: &mut Allowance) -> Outcome<Self> {
        // Bytes 16 on hold what was written first; a root without six children is not an archive.
        let mut block = |index| ogawa.read(ogawa.child_block(root, index)?, reading);
        let known_version = |bytes: &[u8]| Some(i32::from_le_bytes(bytes.try_into().ok()?));
        let format = known_version(&block(0)?);
        if format != Some(0) {
            return Err(Fault::new(
                format!("the archive is of format {}; format 0 is read", format.unwrap_or(-1)),
                "export it again with a current Alembic",
            )
            .at(root.position));
        }
        let library = known_version(&block(1)?);
        if library.is_none_or(|version| version < 9999) {
            return Err(Fault::new(
                "the archive does not name the Alembic version that wrote it",
                "export it again with a current Alembic",
            )
            .at(root.position));
        }
        let metadata = Metadata::new(&block(3)?);
        let time_samplings = time_samplings(&block(4)?, root.position)?;
        let shared_metadata = shared_metadata(&block(5)?, root.position)?;
        let top = match ogawa.child(root, 2)? {
            Child::Group(position) => ogawa.group(position)?,
            Child::Block(_) => {
                return Err(Fault::damage(root.position, "the top object should be a group"));
            }
        };
        Ok(Self { ogawa, metadata, top, time_samplings, shared_metadata })
    }

    /// The headers of an object's children, and its children: its properties first, then theirs.
    ///
    /// # Errors
    /// Damage, or an allowance that is used up.
    pub(super) fn object(
        &self,
        group: Group,
        reading: &mut Allowance,
    ) -> Outcome<(Vec<Child>, Vec<ObjectHeader>)> {
        let children = self.ogawa.children(group, reading)?;
        let headers = match children.last() {
            Some(&Child::Block(position)) => {
                let block = self.ogawa.block(position)?;
                let bytes = self.ogawa.read(block, reading)?;
                self.object_headers(&bytes[..bytes.len().saturating_sub(HASHES_SIZE)], block)?
            }
            _ => Vec::new(),
        };
        // The properties come before the children and the headers after them.
        if !headers.is_empty() && children.len() < headers.len() + 2 {
            return Err(Fault::damage(
                group.position,
                format!(
                    "{} objects have headers, but the group has {} children",
                    headers.len(),
                    children.len()
                ),
            ));
        }
        Ok((children, headers))
    }

    fn object_headers(&self, bytes: &[u8], block: Block) -> Outcome<Vec<ObjectHeader>> {
        let mut cursor = Cursor { bytes, taken: 0, start: block.position, what: "headers of objects" };
        let mut headers = Vec::new();
        while !cursor.is_empty() {
            let name_size = cursor.u32()?;
            let name = cursor.name(name_size)?;
            let metadata = match usize::from(cursor.u8()?) {
                OWN_METADATA => {
                    let size = cursor.u32()?;
                    Metadata::new(cursor.take(size as usize)?)
                }
                index => self.shared(index, &cursor)?,
            };
            headers.push(ObjectHeader { name, metadata });
        }
        Ok(headers)
    }

    /// The compound at a group's position.
    ///
    /// # Errors
    /// Damage, or an allowance that is used up.
    pub(super) fn compound(&self, position: u64, reading: &mut Allowance) -> Outcome<Compound> {
        let children = self.ogawa.children(self.ogawa.group(position)?, reading)?;
        let headers = match children.last() {
            Some(&Child::Block(position)) => {
                let block = self.ogawa.block(position)?;
                self.property_headers(&self.ogawa.read(block, reading)?, block)?
            }
            _ => Vec::new(),
        };
        Ok(Compound { position, children, headers })
    }

    fn property_headers(&self, bytes: &[u8], block: Block) -> Outcome<Vec<PropertyHeader>> {
        let mut cursor = Cursor { bytes, taken: 0, start: block.position, what: "headers of properties" };
        let mut headers = Vec::new();
        while !cursor.is_empty() {
            // bits 0–1    0 compound, 1 scalar, 2 or 3 array
            //      2–3    size of the integers that follow: 1, 2 or 4 bytes
            //      4–7    type of the values
            //      8      a time sampling is named; else it is number 0
            //      9      the first and last changed samples are named
            //      11     all samples are alike
            //      12–19  values per element
            //      20–27  metadata
            let info = cursor.u32()?;
            let size = match info >> 2 & 3 {
                0 => 1,
                1 => 2,
                2 => 4,
                _ => return Err(cursor.fault("name integers of an unknown size")),
            };
            let kind = if info & 3 == 0 {
                PropertyKind::Compound
            } else {
                let pod = Pod::new(info >> 4 & 15).ok_or_else(|| cursor.fault("name an unknown type"))?;
                let extent = (info >> 12 & 0xff) as u8;
                let samples = cursor.integer(size)?;
                let changes = if info & 0x200 != 0 {
                    (cursor.integer(size)?, cursor.integer(size)?)
                } else if info & 0x800 != 0 {
                    (0, 0)
                } else {
                    (1, samples.saturating_sub(1))
                };
                let index = if info & 0x100 != 0 { cursor.integer(size)? } else { 0 };
                let time = self.time_samplings.get(index as usize).cloned();
                let time = time.ok_or_else(|| cursor.fault("name a time sampling that is not there"))?;
                PropertyKind::Values { pod, extent, is_array: info & 2 != 0, samples, changes, time }
            };
            let name_size = cursor.integer(size)?;
            let name = cursor.name(name_size)?;
            // Metadata of properties is skipped: the schemas say all that is needed.
            if (info >> 20 & 0xff) as usize == OWN_METADATA {
                let size = cursor.integer(size)?;
                cursor.take(size as usize)?;
            }
            headers.push(PropertyHeader { name, kind });
        }
        Ok(headers)
    }

    fn shared(&self, index: usize, cursor: &Cursor<'_>) -> Outcome<Metadata> {
        let metadata = self.shared_metadata.get(index).cloned();
        metadata.ok_or_else(|| cursor.fault("name metadata that is not there"))
    }
}

impl Compound {
    /// The names of what is in it.
    pub(super) fn names(&self) -> Vec<&str> {
        self.headers.iter().map(|header| header.name.as_str()).collect()
    }

    fn find(&self, name: &str) -> Option<(&PropertyHeader, Child)> {
        let index = self.headers.iter().position(|header| header.name == name)?;
        // A header without a child is found to be damage where the property is read.
        Some((&self.headers[index], self.children.get(index).copied().unwrap_or(Child::Block(0))))
    }

    fn group_of(&self, name: &str, child: Child) -> Outcome<u64> {
        match child {
            Child::Group(position) => Ok(position),
            Child::Block(_) => {
                Err(Fault::damage(self.position, format!("the property `{name}` should be a group")))
            }
        }
    }

    /// The compound of a name within this one.
    ///
    /// # Errors
    /// Damage, or an allowance that is used up.
    pub(super) fn compound(
        &self,
        name: &str,
        archive: &Archive,
        reading: &mut Allowance,
    ) -> Outcome<Option<Compound>> {
        match self.find(name) {
            Some((PropertyHeader { kind: PropertyKind::Compound, .. }, child)) => {
                archive.compound(self.group_of(name, child)?, reading).map(Some)
            }
            _ => Ok(None),
        }
    }

    /// The scalar or array property of a name within this compound.
    ///
    /// # Errors
    /// Damage: samples that are not there or have no times.
    pub(super) fn property(&self, name: &str, archive: &Archive) -> Outcome<Option<Property>> {
        let Some((PropertyHeader { kind, .. }, child)) = self.find(name) else { return Ok(None) };
        let PropertyKind::Values { pod, extent, is_array, samples, changes, time } = kind else {
            return Ok(None);
        };
        let group = archive.ogawa.group(self.group_of(name, child)?)?;
        Property::new(name, *pod, *extent, *is_array, (*samples, *changes), Arc::clone(time), group).map(Some)
    }
}

/// Per sampling: the most samples (4 bytes), seconds per cycle (8), number of times (4), the times.
fn time_samplings(bytes: &[u8], offset: u64) -> Outcome<Vec<Arc<TimeSampling>>> {
    let mut cursor = Cursor { bytes, taken: 0, start: offset, what: "time samplings" };
    let mut samplings = Vec::new();
    while !cursor.is_empty() {
        cursor.u32()?;
        let time_per_cycle = cursor.f64()?;
        let count = cursor.u32()? as usize;
        let times = cursor.take(count.saturating_mul(8))?;
        let times: Vec<f64> =
            times.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
        samplings.push(Arc::new(TimeSampling::new(time_per_cycle, &times, offset)?));
    }
    Ok(samplings)
}

/// Number 0 is empty; then a length of one byte before each.
fn shared_metadata(bytes: &[u8], offset: u64) -> Outcome<Vec<Metadata>> {
    let mut cursor = Cursor { bytes, taken: 0, start: offset, what: "shared metadata" };
    let mut all = vec![Metadata::default()];
    while !cursor.is_empty() {
        let size = cursor.u8()?;
        all.push(Metadata::new(cursor.take(usize::from(size))?));
    }
    Ok(all)
}

/// Takes apart a block that is in memory.
struct Cursor<'a> {
    bytes: &'a [u8],
    taken: u64,
    /// Where the block begins in the file, for errors.
    start: u64,
    what: &'static str,
}

impl<'a> Cursor<'a> {
    fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    fn fault(&self, what: &str) -> Fault {
        Fault::damage(self.start + self.taken, format!("the {} {what}", self.what))
    }

    fn take(&mut self, size: usize) -> Outcome<&'a [u8]> {
        let (taken, rest) = self.bytes.split_at_checked(size).ok_or_else(|| self.fault("end too early"))?;
        self.bytes = rest;
        self.taken += size as u64;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Outcome<[u8; N]> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
    }

    fn u8(&mut self) -> Outcome<u8> {
        Ok(u8::from_le_bytes(self.array()?))
    }

    fn u32(&mut self) -> Outcome<u32> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    fn f64(&mut self) -> Outcome<f64> {
        Ok(f64::from_le_bytes(self.array()?))
    }

    /// An unsigned integer of 1, 2 or 4 bytes.
    fn integer(&mut self, size: usize) -> Outcome<u32> {
        Ok(self.take(size)?.iter().rev().fold(0, |sum, byte| sum << 8 | u32::from(*byte)))
    }

    fn name(&mut self, size: u32) -> Outcome<String> {
        if size == 0 {
            return Err(self.fault("hold an empty name"));
        }
        Ok(String::from_utf8_lossy(self.take(size as usize)?).into_owned())
    }
}
