//! Modes from files: of bodies that were measured, or computed elsewhere.
//!
//! JSON, a list of modes, counted from 1:
//!
//! ```json
//! [
//!   {"frequency_hz": 440.0, "rt60_s": 1.5, "gain": 0.8, "points": [0.0, 0.7, 1.0]},
//!   {"frequency_hz": 1213.5, "decay_per_s": 9.1, "gain_db": -12.0}
//! ]
//! ```
//!
//! | key | |
//! | --- | --- |
//! | `frequency_hz`, or `frequency` | hertz, above 0 |
//! | `decay_per_s` | the amplitude falls as e^(−decay · t); above 0 |
//! | or `rt60_s` | seconds in which it falls by 60 dB; above 0 |
//! | `gain` | amplitude after 1 N s; 1 if nothing is said |
//! | or `gain_db` | the same in decibels: 20 dB are a factor of ten |
//! | `points` | further gains at the numbered points of the body, from 0 |
//!
//! CSV: the same as columns under a header that names them, with `point_0`, `point_1` and so on.
//! Empty fields say nothing; lines that begin with `#` are passed over.
//!
//! JSON of the `material_data` of ThreeDWorld (TDW): an object of lists of equal length, `cf`
//! (frequencies in hertz), `op` (onset levels in decibels re 1, as amplitude 10^(op/20)) and `rt`
//! (seconds in which each falls by 60 dB), as its PyImpact reads them. All modes are taken as they are;
//! PyImpact itself takes the first ten, and varies them at random.

use std::collections::BTreeMap;
use std::fmt;
use std::fs::File;
use std::io::Read;
use std::marker::PhantomData;
use std::path::Path;

use serde::de::{Deserialize, Deserializer, SeqAccess, Visitor};

use super::{MOST_MODES, Mode, Modes, Shape, decay_of_rt60};
use crate::{Error, Place, Result};

/// The longest file that is read, in bytes.
pub const LONGEST_FILE_BYTES: u64 = 64 << 20;

/// Reads the modes of a file, JSON or CSV by what is in it.
///
/// # Errors
/// A file that cannot be read, is longer than [`LONGEST_FILE_BYTES`], or does not hold from 1 to
/// [`MOST_MODES`] modes; the error names the line or the number of the mode.
pub fn open(path: impl AsRef<Path>) -> Result<Modes> {
    let path = path.as_ref();
    let io = |doing: &str, fault| Error::io(doing, path, fault);
    let file = File::open(path).map_err(|fault| io("open", fault))?;
    let mut bytes = Vec::new();
    file.take(LONGEST_FILE_BYTES + 1).read_to_end(&mut bytes).map_err(|fault| io("read", fault))?;
    read(&bytes).map_err(|fault| fault.in_file(path))
}

/// Reads modes from the bytes of a file.
///
/// # Errors
/// As [`open`], without the file's name.
pub fn read(bytes: &[u8]) -> Result<Modes> {
    if bytes.len() as u64 > LONGEST_FILE_BYTES {
        return Err(Error::new(format!("the file is longer than {} MiB", LONGEST_FILE_BYTES >> 20)));
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    match bytes.iter().find(|byte| !byte.is_ascii_whitespace()) {
        None => Err(Error::new("the file is empty: expected modes as JSON or CSV")),
        Some(b'[') => {
            let Most(records) = serde_json::from_slice::<Most<Record>>(bytes).map_err(json_fault)?;
            let mode = |(index, record): (usize, Record)| {
                record.mode().map_err(|fault| fault.at(Place::Part(format!("mode {}", index + 1))))
            };
            Modes::new(records.into_iter().enumerate().map(mode).collect::<Result<_>>()?)
        }
        Some(b'{') => Modes::new(serde_json::from_slice::<Material>(bytes).map_err(json_fault)?.modes()?),
        Some(_) => csv_modes(bytes),
    }
}

fn json_fault(fault: serde_json::Error) -> Error {
    let place = Place::Line { line: fault.line(), column: fault.column() };
    let text = fault.to_string();
    // The place is said once, and in one way.
    let what = text.rsplit_once(" at line ").map_or(text.as_str(), |(what, _)| what);
    Error::new(what).at(place).because(fault)
}

/// A list that is not longer than [`MOST_MODES`].
#[derive(Debug)]
struct Most<T>(Vec<T>);

impl<T> Default for Most<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Most<T> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> std::result::Result<Self, D::Error> {
        struct List<T>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for List<T> {
            type Value = Most<T>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "a list of at most {MOST_MODES}")
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> std::result::Result<Most<T>, A::Error> {
                let mut values = Vec::new();
                while let Some(value) = list.next_element()? {
                    if values.len() == MOST_MODES {
                        return Err(serde::de::Error::custom(format!("a list is longer than {MOST_MODES}")));
                    }
                    values.push(value);
                }
                Ok(Most(values))
            }
        }
        from.deserialize_seq(List(PhantomData))
    }
}

/// A mode as a file says it.
#[derive(Debug, Default, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Record {
    frequency_hz: Option<f64>,
    frequency: Option<f64>,
    decay_per_s: Option<f64>,
    rt60_s: Option<f64>,
    gain: Option<f64>,
    gain_db: Option<f64>,
    points: Option<Most<f64>>,
}

impl Record {
    fn mode(self) -> Result<Mode> {
        let one = |names: [&str; 2], values: [Option<f64>; 2]| match values {
            [Some(_), Some(_)] => {
                Err(Error::new(format!("both `{}` and `{}` are given: expected one", names[0], names[1])))
            }
            [None, None] => Err(Error::new(format!("neither `{}` nor `{}` is given", names[0], names[1]))),
            [first, second] => Ok((first, second)),
        };
        let (hz, plain) = one(["frequency_hz", "frequency"], [self.frequency_hz, self.frequency])?;
        let (decay, rt60) = one(["decay_per_s", "rt60_s"], [self.decay_per_s, self.rt60_s])?;
        let gain = match (self.gain, self.gain_db) {
            (None, None) => 1.0,
            values => {
                let (gain, db) = one(["gain", "gain_db"], [values.0, values.1])?;
                gain.or(db.map(amplitude)).unwrap_or(1.0)
            }
        };
        let decay_per_s = match (decay, rt60) {
            (None, Some(rt60_s)) => rt60_decay("rt60_s", rt60_s)?,
            (decay, _) => decay.unwrap_or(0.0),
        };
        let mode = Mode {
            frequency_hz: hz.or(plain).unwrap_or(0.0),
            decay_per_s,
            gain,
            shape: match self.points {
                Some(Most(points)) if points.is_empty() => {
                    return Err(Error::new("`points` is empty: expected a gain for each point, or nothing"));
                }
                Some(Most(points)) => Shape::Points(points),
                None => Shape::Everywhere,
            },
        };
        mode.check()?;
        Ok(mode)
    }
}

/// An amplitude of a level in decibels.
fn amplitude(level_db: f64) -> f64 {
    10.0f64.powf(level_db / 20.0)
}

/// The decay of a time in a file.
fn rt60_decay(name: &str, rt60_s: f64) -> Result<f64> {
    let decay_per_s = decay_of_rt60(rt60_s);
    if rt60_s > 0.0 && decay_per_s > 0.0 && decay_per_s.is_finite() {
        return Ok(decay_per_s);
    }
    Err(Error::new(format!("`{name}` is {rt60_s}: expected seconds above 0")))
}

/// A material of TDW. Its other keys say how TDW itself uses it.
#[derive(Debug, serde::Deserialize)]
struct Material {
    cf: Most<f64>,
    op: Most<f64>,
    rt: Most<f64>,
}

impl Material {
    fn modes(self) -> Result<Vec<Mode>> {
        let [Most(cf), Most(op), Most(rt)] = [self.cf, self.op, self.rt];
        if cf.len() != op.len() || cf.len() != rt.len() {
            let (cf, op, rt) = (cf.len(), op.len(), rt.len());
            return Err(Error::new(format!(
                "`cf` has {cf} values, `op` {op} and `rt` {rt}: expected as many"
            )));
        }
        let mode = |(index, ((&frequency_hz, &level_db), &rt60_s)): (usize, ((&f64, &f64), &f64))| {
            let record = Record {
                frequency_hz: Some(frequency_hz),
                gain_db: Some(level_db),
                decay_per_s: Some(rt60_decay("rt", rt60_s).map_err(|fault| at_mode(fault, index))?),
                ..Record::default()
            };
            record.mode().map_err(|fault| at_mode(fault, index))
        };
        cf.iter().zip(&op).zip(&rt).enumerate().map(mode).collect()
    }
}

fn at_mode(fault: Error, index: usize) -> Error {
    fault.at(Place::Part(format!("mode {}", index + 1)))
}

/// What a column holds.
#[derive(Clone, Copy, PartialEq)]
enum Column {
    Frequency,
    Decay,
    Rt60,
    Gain,
    GainDb,
    Point(usize),
}

fn csv_modes(bytes: &[u8]) -> Result<Modes> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(bytes);
    let fault = |fault: csv::Error| {
        let line = fault.position().map_or(0, |position| line_of(bytes, position));
        let what = match fault.kind() {
            csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
                format!("the record has {len} fields, the header {expected_len}")
            }
            csv::ErrorKind::Utf8 { .. } => "the line is not UTF-8 text".to_owned(),
            _ => fault.to_string(),
        };
        Error::new(what).at(Place::Line { line, column: 0 }).because(fault)
    };
    let header = reader.headers().map_err(fault)?.clone();
    let header_line = header.position().map_or(1, |position| line_of(bytes, position));
    let columns = columns(&header).map_err(|f| f.at(Place::Line { line: header_line, column: 0 }))?;
    let mut modes = Vec::new();
    for record in reader.records() {
        let record = record.map_err(fault)?;
        let line = record.position().map_or(0, |position| line_of(bytes, position));
        let place = |fault: Error| fault.at(Place::Line { line, column: 0 });
        if modes.len() == MOST_MODES {
            return Err(place(Error::new(format!("there are more than {MOST_MODES} modes"))));
        }
        modes.push(csv_mode(&columns, &record).map_err(place)?);
    }
    Modes::new(modes)
}

/// The line of a record whose position is that of the empty lines and comments before it.
fn line_of(bytes: &[u8], position: &csv::Position) -> usize {
    let rest = bytes.get(position.byte() as usize..).unwrap_or_default();
    let passed_over = |line: &&[u8]| matches!(line, [] | [b'\r'] | [b'#', ..]);
    position.line() as usize + rest.split(|&byte| byte == b'\n').take_while(passed_over).count()
}

fn columns(header: &csv::StringRecord) -> Result<Vec<Column>> {
    let mut columns = Vec::new();
    for name in header {
        let column = match name {
            "frequency_hz" | "frequency" => Column::Frequency,
            "decay_per_s" => Column::Decay,
            "rt60_s" => Column::Rt60,
            "gain" => Column::Gain,
            "gain_db" => Column::GainDb,
            _ => match name.strip_prefix("point_").and_then(|number| number.parse().ok()) {
                Some(number) if number < header.len() => Column::Point(number),
                _ => {
                    let known =
                        "frequency_hz, decay_per_s or rt60_s, gain or gain_db, and point_0, point_1, …";
                    return Err(
                        Error::new(format!("unknown column `{name}`")).help(format!("there are {known}"))
                    );
                }
            },
        };
        if columns.contains(&column) {
            return Err(Error::new(format!("the column `{name}` is there twice")));
        }
        columns.push(column);
    }
    let points = columns.iter().filter(|column| matches!(column, Column::Point(_))).count();
    match (0..points).find(|&number| !columns.contains(&Column::Point(number))) {
        Some(missing) => Err(Error::new(format!("the column `point_{missing}` is missing"))
            .help("points are counted from 0 without gaps")),
        None => Ok(columns),
    }
}

fn csv_mode(columns: &[Column], record: &csv::StringRecord) -> Result<Mode> {
    let (mut mode, mut points) = (Record::default(), BTreeMap::new());
    let mut empty_point = None;
    for (&column, field) in columns.iter().zip(record) {
        if field.is_empty() {
            if let Column::Point(number) = column {
                empty_point = Some(number);
            }
            continue;
        }
        let fault = || Error::new(format!("expected a number, found {field:?}"));
        let value: f64 = field.parse().map_err(|_| fault())?;
        match column {
            Column::Frequency => mode.frequency_hz = Some(value),
            Column::Decay => mode.decay_per_s = Some(value),
            Column::Rt60 => mode.rt60_s = Some(value),
            Column::Gain => mode.gain = Some(value),
            Column::GainDb => mode.gain_db = Some(value),
            Column::Point(number) => drop(points.insert(number, value)),
        }
    }
    match empty_point {
        Some(number) if !points.is_empty() => {
            return Err(Error::new(format!(
                "`point_{number}` is empty: expected a gain for each point, or for none"
            )));
        }
        _ => mode.points = (!points.is_empty()).then(|| Most(points.into_values().collect())),
    }
    mode.mode()
}
