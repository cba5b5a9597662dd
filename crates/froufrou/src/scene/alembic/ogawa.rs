//! Ogawa, the container: a tree of groups whose leaves are blocks of bytes.
//!
//! ```text
//! byte 0   "Ogawa"
//!      5   0xff once the writer has finished ("frozen")
//!      6   version, big-endian: 1
//!      8   position of the root group
//!
//! group    number of children, then one position of 8 bytes for each;
//!          its top bit tells blocks from groups; position 0 is an empty group or block
//! block    size, then that many bytes
//! ```
//! All integers but the version are little-endian. Nothing here trusts the file: every count and
//! every size is held against the file's length before anything is allocated.

use std::path::Path;

use super::fault::{Allowance, Fault, Outcome};
use crate::scene::positioned_file::PositionedFile;
use crate::{Error, Place, Result};

/// Set in a child's position when it is a block.
const BLOCK_BIT: u64 = 1 << 63;

/// Bytes before the first group or block.
const HEADER_SIZE: u64 = 16;

/// A group whose number of children is known and fits into the file; the children themselves stay
/// there until they are asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Group {
    /// Where it begins; 0 for the empty group.
    pub(super) position: u64,
    /// The number of its children.
    pub(super) children: u64,
}

/// A block of bytes that lies within the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Block {
    /// Where its bytes begin.
    pub(super) position: u64,
    /// The number of its bytes.
    pub(super) size: u64,
}

/// A child of a group, by its unchecked position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Child {
    /// A group begins at this byte, or is empty if 0.
    Group(u64),
    /// A block begins at this byte, or is empty if 0.
    Block(u64),
}

/// An open container.
#[derive(Debug)]
pub(super) struct Ogawa {
    file: PositionedFile,
}

impl Ogawa {
    /// Opens a container and gives its root group.
    ///
    /// # Errors
    /// A file that cannot be opened, that is of another kind, or that its writer has not finished.
    pub(super) fn open(path: &Path) -> Result<(Self, Group)> {
        let file = PositionedFile::open(path).map_err(|error| Error::io("open", path, error))?;
        let wrong_kind =
            |what: &str, help: &str| Err(Error::new(what).in_file(path).at(Place::Byte(0)).help(help));
        let mut header = [0_u8; HEADER_SIZE as usize];
        let known = header.len().min(usize::try_from(file.length()).unwrap_or(usize::MAX));
        file.read_exact_at(&mut header[..known], 0).map_err(|error| Error::io("read", path, error))?;
        if header.starts_with(b"\x89HDF") {
            return wrong_kind(
                "this Alembic archive is of the old HDF5 kind, which is not read",
                "export it again as Ogawa, the default since Alembic 1.5, or run `abcconvert -toOgawa in.abc out.abc`",
            );
        }
        if known == 0 {
            return wrong_kind("the file is empty; an Alembic archive was expected", "export it again");
        }
        if !header.starts_with(b"Ogawa") {
            return wrong_kind(
                "this is not an Alembic archive: it does not begin with `Ogawa`",
                "give an .abc file",
            );
        }
        let ogawa = Self { file };
        let root = ogawa.root(&header, known).map_err(|fault| fault.in_file(path))?;
        Ok((ogawa, root))
    }

    fn root(&self, header: &[u8; HEADER_SIZE as usize], known: usize) -> Outcome<Group> {
        if known < header.len() {
            return Err(Fault::damage(known as u64, "the file ends within its first 16 bytes"));
        }
        if header[5] != 0xff {
            return Err(Fault::new(
                "the archive was never finished: the program that wrote it stopped or is still writing",
                "wait for the export to end, or export it again",
            )
            .at(5));
        }
        let version = u16::from_be_bytes([header[6], header[7]]);
        if version != 1 {
            return Err(Fault::new(
                format!("the container is of version {version}; version 1 is read"),
                "export it again with a current Alembic",
            )
            .at(6));
        }
        self.group(little_endian_u64(&header[8..16]))
    }

    /// The file's length in bytes.
    pub(super) fn length(&self) -> u64 {
        self.file.length()
    }

    /// The group at a position.
    ///
    /// # Errors
    /// One that does not lie within the file.
    pub(super) fn group(&self, position: u64) -> Outcome<Group> {
        if position == 0 {
            return Ok(Group { position, children: 0 });
        }
        let after = self.room_after(position, "a group")?;
        let children = self.read_u64(position)?;
        if children > after / 8 {
            return Err(Fault::damage(
                position,
                format!("a group claims {children} children, but only {after} bytes follow"),
            ));
        }
        Ok(Group { position, children })
    }

    /// One child of a group, read alone, so that long lists of samples stay in the file.
    ///
    /// # Errors
    /// An index beyond the children, or a read that fails.
    pub(super) fn child(&self, group: Group, index: u64) -> Outcome<Child> {
        if index >= group.children {
            return Err(Fault::damage(
                group.position,
                format!("a group has {} children, but child {} is needed", group.children, index + 1),
            ));
        }
        Ok(child_at(self.read_u64(group.position + 8 + 8 * index)?))
    }

    /// All children of a group.
    ///
    /// # Errors
    /// A read that fails, or an allowance that is used up.
    pub(super) fn children(&self, group: Group, allowance: &mut Allowance) -> Outcome<Vec<Child>> {
        let bytes = self.read(Block { position: group.position + 8, size: group.children * 8 }, allowance)?;
        Ok(bytes.chunks_exact(8).map(|bytes| child_at(little_endian_u64(bytes))).collect())
    }

    /// The block at a position.
    ///
    /// # Errors
    /// One that does not lie within the file.
    pub(super) fn block(&self, position: u64) -> Outcome<Block> {
        if position == 0 {
            return Ok(Block { position, size: 0 });
        }
        let after = self.room_after(position, "a block")?;
        let size = self.read_u64(position)?;
        if size > after {
            return Err(Fault::damage(
                position,
                format!("a block claims {size} bytes, but only {after} follow"),
            ));
        }
        Ok(Block { position: position + 8, size })
    }

    /// One child of a group that must be a block.
    ///
    /// # Errors
    /// A group in its place, or what `child` and `block` find.
    pub(super) fn child_block(&self, group: Group, index: u64) -> Outcome<Block> {
        match self.child(group, index)? {
            Child::Block(position) => self.block(position),
            Child::Group(_) => {
                Err(Fault::damage(group.position, format!("child {} should be a block of bytes", index + 1)))
            }
        }
    }

    /// All bytes of a block, paid for from an allowance.
    ///
    /// # Errors
    /// A read that fails, or an allowance that is used up.
    pub(super) fn read(&self, block: Block, allowance: &mut Allowance) -> Outcome<Vec<u8>> {
        allowance.charge(block.size).map_err(|fault| fault.at(block.position))?;
        self.read_from(block, 0)
    }

    /// The bytes of a block from `skip` on; none if it is shorter than that.
    ///
    /// # Errors
    /// A read that fails.
    pub(super) fn read_from(&self, block: Block, skip: u64) -> Outcome<Vec<u8>> {
        let size = block.size.saturating_sub(skip);
        let too_big = || Fault::damage(block.position, format!("{size} bytes do not fit into memory"));
        let mut bytes = vec![0; usize::try_from(size).map_err(|_| too_big())?];
        if !bytes.is_empty() {
            let offset = block.position + skip;
            self.file.read_exact_at(&mut bytes, offset).map_err(|error| Fault::io(offset, size, error))?;
        }
        Ok(bytes)
    }

    /// The bytes between the 8-byte count at a position and the end of the file.
    fn room_after(&self, position: u64, what: &str) -> Outcome<u64> {
        if position < HEADER_SIZE {
            return Err(Fault::damage(position, format!("{what} cannot lie within the first 16 bytes")));
        }
        position.checked_add(8).and_then(|start| self.length().checked_sub(start)).ok_or_else(|| {
            Fault::damage(
                self.length(),
                format!("the file ends here, but {what} should be at byte {position}"),
            )
        })
    }

    fn read_u64(&self, position: u64) -> Outcome<u64> {
        let mut bytes = [0; 8];
        self.file.read_exact_at(&mut bytes, position).map_err(|error| Fault::io(position, 8, error))?;
        Ok(u64::from_le_bytes(bytes))
    }
}

fn child_at(position: u64) -> Child {
    if position & BLOCK_BIT == 0 { Child::Group(position) } else { Child::Block(position & !BLOCK_BIT) }
}

/// The first eight bytes as an integer; absent bytes are 0.
fn little_endian_u64(bytes: &[u8]) -> u64 {
    bytes.iter().take(8).rev().fold(0, |sum, byte| sum << 8 | u64::from(*byte))
}
