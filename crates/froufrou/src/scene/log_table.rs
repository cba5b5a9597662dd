//! Logs of simulations are CSV tables with a header, gzipped or not: how they are read record by record,
//! and how their faults are told.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use flate2::read::MultiGzDecoder;

use super::conventions::UpAxis;
use super::toml::{alternatives, nearest};
use crate::{Error, Place, Result};

/// The most bytes that one record may take, quotes and all.
pub const LONGEST_RECORD_BYTES: u64 = 1 << 20;
/// The most bodies that a log may name.
pub const MOST_BODIES: usize = 1_000_000;
/// The largest number that is taken as one: products of a few of them are finite.
pub const LARGEST_NUMBER: f64 = 1e30;
/// The longest name of a body in bytes.
pub const LONGEST_NAME_BYTES: usize = 1024;

/// Stops a record that never ends, such as after a quote that is never closed.
struct Watched<R> {
    inner: R,
    unread: Arc<AtomicU64>,
}

impl<R: Read> Read for Watched<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        if self.unread.load(Ordering::Relaxed) > LONGEST_RECORD_BYTES {
            let what = format!("a record longer than {LONGEST_RECORD_BYTES} bytes; is a quote left open?");
            return Err(std::io::Error::other(what));
        }
        let count = self.inner.read(buffer)?;
        self.unread.fetch_add(count as u64, Ordering::Relaxed);
        Ok(count)
    }
}

/// An open log, at one of its records.
pub(super) struct LogTable {
    file: PathBuf,
    reader: csv::Reader<Watched<Box<dyn Read + Send>>>,
    unread: Arc<AtomicU64>,
    record: csv::ByteRecord,
    header: Vec<String>,
    /// The line of the record.
    line: u64,
}

impl LogTable {
    /// Opens a log.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(|fault| Error::io("open", path, fault))?;
        Self::new(file, path)
    }

    /// Reads a log from anywhere; `file` is its name in messages. Gzip is told by its first bytes.
    pub(super) fn new(reader: impl Read + Send + 'static, file: &Path) -> Result<Self> {
        let file = file.to_owned();
        let mut reader = BufReader::with_capacity(1 << 16, reader);
        let start = reader.fill_buf().map_err(|fault| Error::io("read", &file, fault))?;
        let inner: Box<dyn Read + Send> = if start.starts_with(&[0x1f, 0x8b]) {
            Box::new(MultiGzDecoder::new(reader))
        } else {
            Box::new(reader)
        };
        let unread = Arc::new(AtomicU64::new(0));
        let watched = Watched { inner, unread: unread.clone() };
        let mut reader =
            csv::ReaderBuilder::new().trim(csv::Trim::All).buffer_capacity(1 << 16).from_reader(watched);
        let header: Vec<String> = match reader.byte_headers() {
            Ok(header) => header.iter().map(|name| String::from_utf8_lossy(name).into_owned()).collect(),
            Err(fault) => return Err(read_fault(fault).in_file(file).at(at_line(1))),
        };
        Ok(Self { file, reader, unread, record: csv::ByteRecord::new(), header, line: 1 })
    }

    /// The file's name.
    pub(super) fn file(&self) -> &Path {
        &self.file
    }

    /// The names of its columns.
    pub(super) fn header(&self) -> &[String] {
        &self.header
    }

    /// The place in the header of the column of a name.
    pub(super) fn column(&self, name: &str) -> Result<usize> {
        find_column(name, &self.header).map_err(|fault| self.in_header(fault))
    }

    /// The places of several columns.
    pub(super) fn columns<const N: usize>(&self, names: &[String; N]) -> Result<[usize; N]> {
        let mut found = [0; N];
        for (place, name) in found.iter_mut().zip(names) {
            *place = self.column(name)?;
        }
        Ok(found)
    }

    /// A fault of the header.
    pub(super) fn in_header(&self, fault: Error) -> Error {
        fault.in_file(self.file.clone()).at(Place::Line { line: 1, column: 0 })
    }

    /// Goes to the next record; its line, or nothing after the last.
    pub(super) fn advance(&mut self) -> Result<Option<u64>> {
        self.unread.store(0, Ordering::Relaxed);
        // What cannot be read stands somewhere after the record before.
        let after = |fault| read_fault(fault).at(at_line(self.line + 1));
        if !self.reader.read_byte_record(&mut self.record).map_err(after)? {
            return Ok(None);
        }
        self.line = self.record.position().map_or(0, csv::Position::line);
        Ok(Some(self.line))
    }

    /// Numbers of the record.
    pub(super) fn numbers<const N: usize>(&self, columns: [usize; N]) -> Result<[f64; N]> {
        let mut found = [0.0; N];
        for (number, column) in found.iter_mut().zip(columns) {
            *number = self.number(column)?;
        }
        Ok(found)
    }

    /// A number of the record.
    pub(super) fn number(&self, column: usize) -> Result<f64> {
        let field = self.record.get(column).unwrap_or_default();
        let number = std::str::from_utf8(field).ok().and_then(|text| text.parse::<f64>().ok());
        number.filter(|n| n.abs() <= LARGEST_NUMBER).ok_or_else(|| {
            let found: String = String::from_utf8_lossy(field).chars().take(60).collect();
            let name = self.header.get(column).map_or("", String::as_str);
            Error::new(format!(
                "column `{name}`: expected a number within ±{LARGEST_NUMBER:e}, found {found:?}"
            ))
        })
    }

    /// The number of a body of the record, a new one for a new name.
    pub(super) fn body(&self, column: usize, bodies: &mut BodyNames) -> Result<u32> {
        let fail = |what: String| {
            let name = self.header.get(column).map_or("", String::as_str);
            Error::new(format!("column `{name}`: {what}"))
        };
        let field = self.record.get(column).unwrap_or_default();
        let name = std::str::from_utf8(field)
            .map_err(|_| fail("expected the name of a body, found bytes that are not UTF-8".to_owned()))?;
        if let Some(&index) = bodies.indices.get(name) {
            return Ok(index);
        }
        if name.is_empty() || name.len() > LONGEST_NAME_BYTES {
            let what = format!("expected the name of a body of 1 to {LONGEST_NAME_BYTES} bytes");
            return Err(fail(format!("{what}, found {} bytes", name.len())));
        }
        if bodies.names.len() >= MOST_BODIES {
            return Err(fail(format!("more than {MOST_BODIES} different bodies; is this the right column?")));
        }
        let index = bodies.names.len() as u32;
        let name: Arc<str> = name.into();
        bodies.names.push(name.clone());
        bodies.indices.insert(name, index);
        Ok(index)
    }
}

/// The bodies that a log has named so far, by number.
#[derive(Debug, Default)]
pub(super) struct BodyNames {
    names: Vec<Arc<str>>,
    indices: HashMap<Arc<str>, u32>,
}

impl BodyNames {
    /// The names, in the order of their numbers.
    pub(super) fn names(&self) -> &[Arc<str>] {
        &self.names
    }
}

/// A vector of a log with Y up.
pub(super) fn upright(up: UpAxis, [x, y, z]: [f64; 3]) -> [f64; 3] {
    match up {
        UpAxis::Y => [x, y, z],
        UpAxis::Z => [x, z, -y],
    }
}

/// A line of a log, as a place.
pub(super) fn at_line(line: u64) -> Place {
    Place::Line { line: usize::try_from(line).unwrap_or(usize::MAX), column: 0 }
}

fn read_fault(fault: csv::Error) -> Error {
    let line = fault.position().map(csv::Position::line);
    let error = match fault.kind() {
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            Error::new(format!("expected {expected_len} fields, as in the header, found {len}"))
        }
        csv::ErrorKind::Io(fault) => Error::new(format!("cannot read the log: {fault}")),
        _ => Error::new(format!("cannot read the log: {fault}")),
    };
    let error = error.because(fault);
    match line {
        Some(line) => error.at(at_line(line)),
        None => error,
    }
}

fn find_column(name: &str, header: &[String]) -> Result<usize> {
    let mut found = header.iter().enumerate().filter(|(_, other)| *other == name).map(|(i, _)| i);
    match (found.next(), found.next()) {
        (Some(index), None) => Ok(index),
        (Some(_), Some(_)) => Err(Error::new(format!("there are two columns `{name}`"))),
        _ => {
            let there = columns_there(header);
            let help = match nearest(name, header.iter().map(String::as_str)) {
                Some(near) => format!("did you mean `{near}`? {there}"),
                None => there,
            };
            Err(Error::new(format!("there is no column `{name}`")).help(help))
        }
    }
}

/// "There are `t`, `x` and `y`".
pub(super) fn columns_there(header: &[String]) -> String {
    let shown = header.iter().take(50).map(String::as_str);
    match header.len() {
        0 => "the log is empty".to_owned(),
        _ => format!("there are {}", alternatives(shown).replace(" or ", " and ")),
    }
}
