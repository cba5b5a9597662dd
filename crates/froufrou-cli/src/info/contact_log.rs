//! What is in a contact log, before anybody has said what its columns mean.

use std::cell::Cell;
use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::rc::Rc;

use flate2::bufread::MultiGzDecoder;
use froufrou::scene::contact_log::{LONGEST_RECORD_BYTES, step_of_times};
use froufrou::{Error, Place, Result};
use serde::Serialize;

use super::sheet::{Sheet, number};
use super::{Findings, Range};

/// The times that the step is found from: the first so many that differ.
const MOST_TIMES: usize = 100_000;

/// The most names of bodies that are kept.
const MOST_BODIES: usize = 10_000;

#[derive(Serialize)]
pub struct LogFindings {
    compressed: bool,
    columns: Vec<String>,
    rows: u64,
    /// The column that was taken for the time.
    time_column: Option<String>,
    times_s: Option<Range>,
    step_s: Option<f64>,
    /// The columns that were taken for the bodies.
    body_columns: Vec<String>,
    /// Their names, sorted; of very many, the first ones met.
    bodies: Vec<String>,
    /// True where there are more.
    more_bodies: bool,
}

/// Counts what is read, and stops where a record never ends.
struct Bounded<R> {
    inner: R,
    unread_bytes: Rc<Cell<u64>>,
}

impl<R: Read> Read for Bounded<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        if self.unread_bytes.get() > LONGEST_RECORD_BYTES {
            let what = format!("a record longer than {LONGEST_RECORD_BYTES} bytes; is a quote left open?");
            return Err(std::io::Error::other(what));
        }
        let count = self.inner.read(buffer)?;
        self.unread_bytes.set(self.unread_bytes.get() + count as u64);
        Ok(count)
    }
}

/// Reads a log row by row, in the memory of its bodies.
pub fn read(file: &Path) -> Result<LogFindings> {
    let open = File::open(file).map_err(|fault| Error::io("open", file, fault))?;
    let mut reader = BufReader::new(open);
    let start = reader.fill_buf().map_err(|fault| Error::io("read", file, fault))?;
    let compressed = start.starts_with(&[0x1f, 0x8b]);
    let inner: Box<dyn Read> =
        if compressed { Box::new(MultiGzDecoder::new(reader)) } else { Box::new(reader) };
    let unread_bytes = Rc::new(Cell::new(0));
    let bounded = Bounded { inner, unread_bytes: Rc::clone(&unread_bytes) };
    let mut reader =
        csv::ReaderBuilder::new().trim(csv::Trim::All).buffer_capacity(1 << 16).from_reader(bounded);
    let failed = |fault: csv::Error| {
        let line = fault.position().map(csv::Position::line);
        let what = match fault.kind() {
            csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
                format!("expected {expected_len} fields, as in the header, found {len}")
            }
            csv::ErrorKind::Io(fault) => format!("cannot read the log: {fault}"),
            _ => format!("cannot read the log: {fault}"),
        };
        let error = Error::new(what).in_file(file).because(fault);
        match line {
            Some(line) => error.at(at_line(line)),
            None => error,
        }
    };
    let header = reader.byte_headers().map_err(failed)?;
    let columns: Vec<String> = header.iter().map(|name| String::from_utf8_lossy(name).into_owned()).collect();
    let named = |names: &[&str]| {
        columns
            .iter()
            .position(|column| names.contains(&column.to_lowercase().replace([' ', '_'], "").as_str()))
    };
    let time = named(&["t", "time", "times", "timestamp"]);
    let bodies: Vec<usize> = [named(&["bodya", "a", "body1", "one"]), named(&["bodyb", "b", "body2", "two"])]
        .into_iter()
        .flatten()
        .collect();

    let (mut rows, mut times_s, mut times) = (0, None, Vec::new());
    let mut names: BTreeSet<Vec<u8>> = BTreeSet::new();
    let mut more_bodies = false;
    let mut record = csv::ByteRecord::new();
    loop {
        unread_bytes.set(0);
        if !reader.read_byte_record(&mut record).map_err(failed)? {
            break;
        }
        rows += 1;
        if let Some(time) = time {
            let field = record.get(time).unwrap_or_default();
            let number = std::str::from_utf8(field).ok().and_then(|text| text.parse::<f64>().ok());
            let Some(time_s) = number.filter(|number| number.is_finite()) else {
                let what = format!(
                    "column `{}`: expected a time, found {:?}",
                    columns[time],
                    String::from_utf8_lossy(field)
                );
                return Err(Error::new(what)
                    .in_file(file)
                    .at(at_line(record.position().map_or(0, csv::Position::line))));
            };
            Range::widen(&mut times_s, time_s);
            if times.len() < MOST_TIMES && times.last() != Some(&time_s) {
                times.push(time_s);
            }
        }
        for &column in &bodies {
            let name = record.get(column).unwrap_or_default();
            if !names.contains(name) {
                if names.len() < MOST_BODIES {
                    names.insert(name.to_vec());
                } else {
                    more_bodies = true;
                }
            }
        }
    }
    Ok(LogFindings {
        compressed,
        rows,
        time_column: time.map(|column| columns[column].clone()),
        times_s,
        step_s: step_of_times(times),
        body_columns: bodies.iter().map(|&column| columns[column].clone()).collect(),
        bodies: names.iter().map(|name| String::from_utf8_lossy(name).into_owned()).collect(),
        more_bodies,
        columns,
    })
}

fn at_line(line: u64) -> Place {
    Place::Line { line: usize::try_from(line).unwrap_or(usize::MAX), column: 0 }
}

impl Findings for LogFindings {
    const KIND: &'static str = "contact_log";

    fn sheet(&self) -> Sheet {
        let mut sheet = Sheet::default();
        sheet
            .fact("kind", if self.compressed { "contact log, CSV, gzipped" } else { "contact log, CSV" })
            .fact("columns", self.columns.join(", "))
            .fact("rows", self.rows);
        if let (Some(column), Some(times)) = (&self.time_column, &self.times_s) {
            sheet.fact(
                "times",
                format!("{} to {} s, by column `{column}`", number(times.from), number(times.to)),
            );
        }
        sheet.fact_if("step", self.step_s.map(|s| format!("{} s, {} Hz", number(s), number(1.0 / s))));
        if !self.body_columns.is_empty() {
            let more = if self.more_bodies { "more than " } else { "" };
            let columns = self.body_columns.iter().map(|column| format!("`{column}`")).collect::<Vec<_>>();
            sheet.fact("bodies", format!("{more}{}, by {}", self.bodies.len(), columns.join(" and ")));
            sheet.table(&["body"], self.bodies.iter().map(|name| vec![name.clone()]));
        }
        sheet
    }
}
