//! Checks a binary layer (a "crate", `.usdc`) before it is decoded.
//!
//! The library that decodes it believes every count and follows every offset: a damaged file could
//! make it take any amount of memory, run for ever or exhaust the stack, which no one can catch. So
//! the same structures are walked here first, and each count is held against the file's length.
//!
//! ```text
//! 0    "PXR-USDC", version, position of the table of contents
//! table: count, then per section its name (16 bytes), start and size
//! TOKENS     names, compressed              STRINGS   indices of tokens
//! FIELDS     (token, value) pairs           FIELDSETS lists of fields
//! PATHS      a tree of tokens               SPECS     (path, fieldset, type) triples
//! ```
//!
//! A value is eight bytes: a type, three flags and either the value itself or where it stands.

use super::fault::{Budget, Damage};
use super::layers::has_paired_braces;

type Outcome<T> = Result<T, Damage>;

/// The fastest growth that LZ4 can give.
const LZ4_RATIO: usize = 255;

/// More levels than any scene has.
const MOST_LEVELS: usize = 1000;

/// Dictionaries and time samples within each other.
const MOST_NESTED: usize = 32;

const ARRAY: u64 = 1 << 63;
const INLINED: u64 = 1 << 62;
const COMPRESSED: u64 = 1 << 61;

/// Types of values by their number in the file.
mod kind {
    pub const DICTIONARY: u64 = 31;
    pub const TIME_SAMPLES: u64 = 46;
    pub const UNREGISTERED_LIST: u64 = 54;
}

/// Checks a whole layer.
///
/// # Errors
/// What cannot be in a sound file.
pub(super) fn check(bytes: &[u8], budget: &mut Budget) -> Outcome<()> {
    let file = Bytes(bytes);
    let version = file.take(8, 3)?;
    let version = [version[0], version[1], version[2]];
    if version[0] != 0 || version[1] < 4 || version[1] > 12 {
        return Err(Damage::new(
            8,
            format!(
                "the binary layer is of version {}.{}.{}; 0.4 to 0.12 are read",
                version[0], version[1], version[2]
            ),
        ));
    }
    let toc = file.u64(16)?;
    let count = file.u64(toc)?;
    if count == 0 || count > 63 {
        return Err(Damage::new(toc, format!("{count} sections; there are six")));
    }
    let mut sections = Sections::default();
    for index in 0..count {
        let at = toc + 8 + 32 * index;
        let name = file.take(at, 16)?;
        let (start, size) = (file.u64(at + 16)?, file.u64(at + 24)?);
        if start.checked_add(size).is_none_or(|end| end > bytes.len() as u64) {
            return Err(Damage::new(at, "a section ends beyond the file"));
        }
        let name = name.split(|byte| *byte == 0).next().unwrap_or_default();
        let slot = match name {
            b"TOKENS" => &mut sections.tokens,
            b"STRINGS" => &mut sections.strings,
            b"FIELDS" => &mut sections.fields,
            b"FIELDSETS" => &mut sections.fieldsets,
            b"PATHS" => &mut sections.paths,
            b"SPECS" => &mut sections.specs,
            _ => continue,
        };
        // Where two sections have one name the first is read.
        slot.get_or_insert(start);
    }
    Check { file, version, budget }.sections(&sections)
}

#[derive(Default)]
struct Sections {
    tokens: Option<u64>,
    strings: Option<u64>,
    fields: Option<u64>,
    fieldsets: Option<u64>,
    paths: Option<u64>,
    specs: Option<u64>,
}

/// Reads within bounds.
#[derive(Clone, Copy)]
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take(self, at: u64, size: usize) -> Outcome<&'a [u8]> {
        let start = usize::try_from(at).ok();
        start
            .and_then(|start| self.0.get(start..start.checked_add(size)?))
            .ok_or_else(|| Damage::new(at, format!("the file ends before {size} bytes that belong here")))
    }

    fn array<const N: usize>(self, at: u64) -> Outcome<[u8; N]> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(at, N)?);
        Ok(array)
    }

    fn u32(self, at: u64) -> Outcome<u32> {
        Ok(u32::from_le_bytes(self.array(at)?))
    }

    fn u64(self, at: u64) -> Outcome<u64> {
        Ok(u64::from_le_bytes(self.array(at)?))
    }

    /// A count of things of at least `size` bytes each that follow it.
    fn count(self, at: u64, size: u64) -> Outcome<u64> {
        let count = self.u64(at)?;
        let left = (self.0.len() as u64).saturating_sub(at + 8);
        if count.checked_mul(size).is_none_or(|bytes| bytes > left) {
            return Err(Damage::new(at, format!("{count} things where {left} bytes are left")));
        }
        Ok(count)
    }
}

/// The checks, and what they may still allow to be taken.
struct Check<'a, 'b> {
    file: Bytes<'a>,
    version: [u8; 3],
    budget: &'b mut Budget,
}

impl Check<'_, '_> {
    fn sections(&mut self, sections: &Sections) -> Outcome<()> {
        let mut tokens = Vec::new();
        if let Some(at) = sections.tokens {
            let count = self.file.u64(at)?;
            let size = self.file.u64(at + 8)?;
            let (text, _) = self.decompress(at + 16, size)?;
            if text.last().is_some_and(|last| *last != 0) {
                return Err(Damage::new(at, "the names do not end"));
            }
            self.budget.charge(count.saturating_mul(24))?;
            tokens.extend(text.split(|byte| *byte == 0).map(|token| (token.len(), has_paired_braces(token))));
            tokens.pop();
            if tokens.len() as u64 != count {
                return Err(Damage::new(at, format!("{count} names are claimed, {} found", tokens.len())));
            }
        }
        if let Some(at) = sections.strings {
            let count = self.file.count(at, 4)?;
            self.budget.charge(8 * count)?;
            for index in 0..count {
                if self.file.u32(at + 8 + 4 * index)? as usize >= tokens.len() {
                    return Err(Damage::new(at + 8 + 4 * index, "a string is no known name"));
                }
            }
        }
        if let Some(at) = sections.paths {
            self.paths(at, &tokens)?;
        }
        if let Some(at) = sections.fieldsets {
            let count = self.file.u64(at)?;
            self.integers(at + 8, count)?;
        }
        if let Some(at) = sections.specs {
            let count = self.file.u64(at)?;
            self.budget.charge(count.saturating_mul(128))?;
            let (_, at) = self.integers(at + 8, count)?;
            let (_, at) = self.integers(at, count)?;
            self.integers(at, count)?;
        }
        if let Some(at) = sections.fields {
            let count = self.file.u64(at)?;
            let (_, at) = self.integers(at + 8, count)?;
            let (values, _) = self.decompress(at, count.saturating_mul(8))?;
            for value in values.chunks_exact(8) {
                let mut rep = [0; 8];
                rep.copy_from_slice(value);
                self.value(u64::from_le_bytes(rep), 0)?;
            }
        }
        Ok(())
    }

    /// The tree must be one: each entry reached once, not too deep, its names not too long together.
    fn paths(&mut self, at: u64, tokens: &[(usize, bool)]) -> Outcome<()> {
        let paths = self.file.u64(at)?;
        let count = self.file.u64(at + 8)?;
        self.budget.charge(paths.saturating_mul(32))?;
        let (indices, next) = self.integers(at + 16, count)?;
        let (names, next) = self.integers(next, count)?;
        let (jumps, _) = self.integers(next, count)?;
        let damage = |what: &str| Damage::new(at, format!("the tree of paths {what}"));
        let mut reached = vec![false; indices.len()];
        let mut open = if indices.is_empty() { Vec::new() } else { vec![(0_usize, 0_usize, 0_usize)] };
        while let Some((start, mut level, mut length)) = open.pop() {
            let mut current = start;
            loop {
                let (Some(&index), Some(&name), Some(&jump)) =
                    (indices.get(current), names.get(current), jumps.get(current))
                else {
                    return Err(damage("leads beyond its end"));
                };
                if std::mem::replace(&mut reached[current], true) {
                    return Err(damage("reaches an entry twice"));
                }
                if current > 0 && index as u32 as u64 >= paths {
                    return Err(damage("names a path that is not there"));
                }
                let own = match tokens.get(name.unsigned_abs() as usize) {
                    Some((_, false)) => return Err(damage("has a name whose braces are not in pairs")),
                    Some((own, true)) => own + 1,
                    None if current == 0 => 1,
                    None => return Err(damage("names a token that is not there")),
                };
                self.budget.charge((length + own) as u64)?;
                if level > MOST_LEVELS {
                    return Err(damage(&format!("is more than {MOST_LEVELS} levels deep")));
                }
                let (has_child, has_sibling) = (jump > 0 || jump == -1, jump >= 0);
                if has_child && has_sibling {
                    open.push((current + jump as usize, level, length));
                }
                if !has_child && !has_sibling {
                    break;
                }
                if has_child {
                    (level, length) = (level + 1, length + own);
                }
                current += 1;
            }
        }
        Ok(())
    }

    /// Compressed integers, of which there are `count`; and where what follows them begins.
    fn integers(&mut self, at: u64, count: u64) -> Outcome<(Vec<i32>, u64)> {
        if count == 0 {
            // Nothing is written but the size of nothing.
            let size = self.file.u64(at)?;
            return Ok((Vec::new(), at + 8 + size));
        }
        let most = count.saturating_mul(4).saturating_add(count.div_ceil(4)).saturating_add(4);
        let (data, next) = self.decompress(at, most)?;
        self.budget.charge(count.saturating_mul(4))?;
        let damage = || Damage::new(at, "a list of integers ends too early");
        let codes_end = 4 + usize::try_from(count.div_ceil(4)).map_err(|_| damage())?;
        if data.len() < codes_end {
            return Err(damage());
        }
        let number = |at: usize, size: usize| -> Outcome<i32> {
            Ok(match data.get(at..at + size).ok_or_else(damage)? {
                [a] => i32::from(*a as i8),
                [a, b] => i32::from(i16::from_le_bytes([*a, *b])),
                [a, b, c, d] => i32::from_le_bytes([*a, *b, *c, *d]),
                _ => 0,
            })
        };
        let common = number(0, 4)?;
        let (mut taken, mut last) = (codes_end, 0_i32);
        let mut integers = Vec::with_capacity(count as usize);
        for index in 0..count as usize {
            let size = match data[4 + index / 4] >> (2 * (index % 4)) & 3 {
                0 => 0,
                1 => 1,
                2 => 2,
                _ => 4,
            };
            let delta = if size == 0 { common } else { number(taken, size)? };
            taken += size;
            last = last.wrapping_add(delta);
            integers.push(last);
        }
        Ok((integers, next))
    }

    /// LZ4 blocks of at most `most` bytes decompressed; and where what follows them begins.
    fn decompress(&mut self, at: u64, most: u64) -> Outcome<(Vec<u8>, u64)> {
        let size = self.file.count(at, 1)?;
        let next = at + 8 + size;
        let input = self.file.take(at + 8, size as usize)?;
        // The decoder takes as much as is claimed, so the claim must be possible.
        if most > (input.len() as u64).saturating_mul(LZ4_RATIO as u64 * 4).saturating_add(64) {
            return Err(Damage::new(at, format!("{size} bytes cannot hold the {most} that are claimed")));
        }
        self.budget.charge(most)?;
        let damage = |_| Damage::new(at, "compressed data that does not decompress");
        let Some((&chunks, mut rest)) = input.split_first() else { return Ok((Vec::new(), next)) };
        let mut output = vec![0; most as usize];
        let mut written = 0;
        if chunks == 0 {
            written = lz4_flex::block::decompress_into(rest, &mut output).map_err(damage)?;
        }
        for _ in 0..chunks {
            let short = || Damage::new(at, "compressed data ends within a chunk");
            let (size, others) = rest.split_at_checked(4).ok_or_else(short)?;
            let size = u32::from_le_bytes([size[0], size[1], size[2], size[3]]) as usize;
            let (chunk, others) = others.split_at_checked(size).ok_or_else(short)?;
            written += lz4_flex::block::decompress_into(chunk, &mut output[written..]).map_err(damage)?;
            rest = others;
        }
        output.truncate(written);
        Ok((output, next))
    }

    fn value(&mut self, rep: u64, nested: usize) -> Outcome<()> {
        let (kind, at) = (rep >> 48 & 0xff, rep & ((1 << 48) - 1));
        if nested > MOST_NESTED {
            return Err(Damage::new(at, "values within values without end"));
        }
        self.budget.charge(16)?;
        if rep & INLINED != 0 {
            return Ok(());
        }
        match kind {
            kind::TIME_SAMPLES => self.time_samples(at, nested),
            kind::DICTIONARY => self.dictionary(at, nested),
            // Lists that are edited: tokens, strings, paths, numbers; references and payloads.
            32 | 33 | 34 | 36 | 38 | kind::UNREGISTERED_LIST => self.list_op(at, Item::Fixed(4)),
            37 | 39 => self.list_op(at, Item::Fixed(8)),
            35 => self.list_op(at, Item::Reference),
            55 => self.list_op(at, Item::Payload),
            // Vectors: paths, tokens, strings; selections of variants, relocations; offsets of layers.
            40 | 41 | 50 => self.vector(at, 4),
            45 | 58 => self.vector(at, 8),
            49 => self.vector(at, 16),
            _ if rep & ARRAY != 0 || kind == 48 => self.array(kind, rep & COMPRESSED != 0, at),
            _ => Ok(()),
        }
    }

    fn vector(&mut self, at: u64, size: u64) -> Outcome<()> {
        let count = self.file.count(at, size)?;
        self.budget.charge(count.saturating_mul(32))
    }

    fn time_samples(&mut self, at: u64, nested: usize) -> Outcome<()> {
        let times_at = self.jump(at)?;
        let times = self.file.u64(times_at)?;
        if !matches!(times >> 48 & 0xff, 9 | 48) || times & INLINED != 0 {
            return Err(Damage::new(times_at, "the times of samples are no numbers"));
        }
        self.value(times, nested + 1)?;
        let values_at = self.jump(times_at + 8)?;
        let count = self.file.count(values_at, 8)?;
        for index in 0..count {
            let rep = self.file.u64(values_at + 8 + 8 * index)?;
            if matches!(rep >> 48 & 0xff, kind::TIME_SAMPLES | kind::DICTIONARY) {
                return Err(Damage::new(values_at + 8 + 8 * index, "samples within samples"));
            }
            self.value(rep, nested + 1)?;
        }
        Ok(())
    }

    fn dictionary(&mut self, at: u64, nested: usize) -> Outcome<()> {
        let count = self.file.count(at, 20)?;
        let mut at = at + 8;
        for _ in 0..count {
            let value_at = self.jump(at + 4)?;
            self.value(self.file.u64(value_at)?, nested + 1)?;
            at = value_at + 8;
        }
        Ok(())
    }

    /// Where an offset leads, which is relative to itself.
    fn jump(&self, at: u64) -> Outcome<u64> {
        let offset = i64::from_le_bytes(self.file.array(at)?);
        at.checked_add_signed(offset).ok_or_else(|| Damage::new(at, "an offset leads before the file"))
    }

    fn list_op(&mut self, at: u64, item: Item) -> Outcome<()> {
        let flags = self.file.array::<1>(at)?[0];
        let mut at = at + 1;
        for flag in 1..7 {
            if flags >> flag & 1 == 0 {
                continue;
            }
            let size = match item {
                Item::Fixed(size) => size,
                Item::Payload if self.version[1] < 8 => 8,
                Item::Payload => 24,
                // With an empty dictionary.
                Item::Reference => 32,
            };
            let count = self.file.count(at, size)?;
            self.budget.charge(count.saturating_mul(128))?;
            at += 8;
            for _ in 0..count {
                if matches!(item, Item::Reference) && self.file.u64(at + 24)? != 0 {
                    return Err(Damage::new(at, "a reference with custom data, which is not read"));
                }
                at += size;
            }
        }
        Ok(())
    }

    fn array(&mut self, kind: u64, is_compressed: bool, at: u64) -> Outcome<()> {
        if at == 0 {
            return Ok(());
        }
        // Bytes of an element in the file, and in memory.
        let (size, memory) = match kind {
            1 | 2 => (1, 1),
            7 => (2, 2),
            3 | 4 | 8 | 21 => (4, 4),
            25 => (6, 6),
            5 | 6 | 9 | 18 | 20 | 22 | 29 | 48 | 56 => (8, 8),
            24 | 26 => (12, 12),
            17 | 19 | 28 | 30 => (16, 16),
            23 => (24, 24),
            13 | 16 | 27 => (32, 32),
            14 => (72, 72),
            15 => (128, 128),
            10..=12 | 57 => (4, 32),
            _ => return Err(Damage::new(at, format!("an array of type {kind}, which is not known"))),
        };
        // Strings and paths of assets and a vector of numbers have no shape and a long count.
        let strings = matches!(kind, 10 | 12 | 57);
        let at = if self.version[1] < 5 && !strings { at + 4 } else { at };
        let (count, data) = if self.version[1] < 7 && !strings {
            (u64::from(self.file.u32(at)?), at + 4)
        } else {
            (self.file.u64(at)?, at + 8)
        };
        self.budget.charge(count.saturating_mul(memory))?;
        let left = (self.file.0.len() as u64).saturating_sub(data);
        let can_be_compressed = count >= 4
            && is_compressed
            && match kind {
                3..=6 => self.version[1] >= 5,
                7..=9 | 48 | 56 => self.version[1] >= 6,
                _ => false,
            };
        if !can_be_compressed {
            if count.checked_mul(size).is_none_or(|bytes| bytes > left) {
                return Err(Damage::new(at, format!("{count} numbers where {left} bytes are left")));
            }
            return Ok(());
        }
        let mut data = data;
        if !matches!(kind, 3..=6) {
            // Numbers as integers, or as indices into a table.
            data += 1;
            if self.file.take(data - 1, 1)? == b"t" {
                let table = u64::from(self.file.u32(data)?);
                if table * size > left {
                    return Err(Damage::new(data, format!("a table of {table} where {left} bytes are left")));
                }
                data += 4 + table * size;
            }
        }
        let compressed = self.file.count(data, 1)?;
        // Four integers to a byte at most, after LZ4.
        if count > compressed.saturating_mul(4 * LZ4_RATIO as u64) {
            return Err(Damage::new(at, format!("{compressed} bytes cannot hold {count} numbers")));
        }
        self.budget.charge(count.saturating_mul(10))
    }
}

#[derive(Clone, Copy)]
enum Item {
    Fixed(u64),
    Reference,
    Payload,
}
