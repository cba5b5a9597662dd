//! Contact logs: what a rigid-body simulation says about who touches whom, a CSV table with a row
//! for every contact point and time step, gzipped or not.
//!
//! A log is read as a stream: memory goes with the number of bodies, not with the length.

use std::io::Read;
use std::path::Path;
use std::sync::Arc;

pub use super::conventions::UpAxis;
use super::log_table::{BodyNames, LogTable, at_line, upright};
pub use super::log_table::{LARGEST_NUMBER, LONGEST_NAME_BYTES, LONGEST_RECORD_BYTES, MOST_BODIES};
use crate::{Error, Result};

/// How hard two bodies press on each other, in newtons or in newton seconds: both engines that log
/// one and engines that log the other are read. As part of [`ContactColumns`] it holds the column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Push<T> {
    /// The normal force of the step in newtons.
    Force(T),
    /// The normal impulse of the step in newton seconds.
    Impulse(T),
}

/// Which columns of a log hold what, and in which units.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactColumns {
    /// Time in seconds.
    pub time: String,
    /// One body.
    pub a: String,
    /// The other.
    pub b: String,
    /// The contact point.
    pub position: [String; 3],
    /// The normal force or impulse.
    pub push: Push<String>,
    /// The contact normal.
    pub normal: Option<[String; 3]>,
    /// The relative velocity along the normal, in units a second.
    pub normal_velocity: Option<String>,
    /// The parts of the velocity at which the bodies slide along each other, in directions at right
    /// angles, in units a second: one, two or three; none where the log does not tell.
    pub sliding_velocity: Vec<String>,
    /// The axis that points up.
    pub up: UpAxis,
    /// Metres in the log's unit of length.
    pub unit_m: f64,
    /// Seconds added to the log's times.
    pub time_offset_s: f64,
}

/// One contact point at one time, in metres, seconds, Y up.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactRow {
    /// The end of the simulation's step that the row tells of, in seconds.
    pub time_s: f64,
    /// One body: an index into [`ContactLog::bodies`].
    pub a: u32,
    /// The other.
    pub b: u32,
    /// World position in metres.
    pub position_m: [f64; 3],
    /// The force over the step, or its impulse.
    pub push: Push<f64>,
    /// The contact normal as the log has it, where it does.
    pub normal: Option<[f64; 3]>,
    /// The relative velocity along the normal in metres a second, where the log has it.
    pub normal_velocity_mps: Option<f64>,
    /// How fast the bodies slide along each other in metres a second, where the log has it.
    pub sliding_mps: Option<f64>,
    /// The line of the log, from 1.
    pub line: u64,
}

/// An open contact log: an iterator of rows in order of time. It ends after its first error.
///
/// ```
/// use froufrou::scene::contact_log::{ContactColumns, ContactLog, Push, UpAxis};
/// let text = "t,one,two,x,y,z,Fn\n0.001,ball,ground,1,2,3,40\n";
/// let columns = ContactColumns {
///     time: "t".into(), a: "one".into(), b: "two".into(),
///     position: ["x".into(), "y".into(), "z".into()],
///     push: Push::Force("Fn".into()), normal: None, normal_velocity: None,
///     sliding_velocity: vec![], up: UpAxis::Z, unit_m: 1.0, time_offset_s: 0.0,
/// };
/// let mut log = ContactLog::new(text.as_bytes(), "contacts.csv", &columns)?;
/// let row = log.next().unwrap()?;
/// assert_eq!(row.position_m, [1.0, 3.0, -2.0]);
/// assert_eq!((row.push, row.line), (Push::Force(40.0), 2));
/// assert_eq!(&*log.bodies()[row.a as usize], "ball");
/// # Ok::<(), froufrou::Error>(())
/// ```
pub struct ContactLog {
    table: LogTable,
    columns: Indices,
    up: UpAxis,
    unit_m: f64,
    time_offset_s: f64,
    last_time_s: f64,
    bodies: BodyNames,
    over: bool,
}

impl std::fmt::Debug for ContactLog {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (file, header) = (self.table.file(), self.table.header());
        f.debug_struct("ContactLog").field("file", &file).field("header", &header).finish()
    }
}

/// The columns' places in the header.
#[derive(Debug)]
struct Indices {
    time: usize,
    bodies: [usize; 2],
    position: [usize; 3],
    push: Push<usize>,
    normal: Option<[usize; 3]>,
    normal_velocity: Option<usize>,
    sliding_velocity: Vec<usize>,
}

impl ContactLog {
    /// Opens a log; gzip is told by its first bytes, not by its name.
    ///
    /// # Errors
    /// A file that cannot be read, or a header without the columns.
    pub fn open(path: impl AsRef<Path>, columns: &ContactColumns) -> Result<Self> {
        Self::of(LogTable::open(path.as_ref())?, columns)
    }

    /// Reads a log from anywhere; `file` is its name in messages.
    ///
    /// # Errors
    /// As [`ContactLog::open`].
    pub fn new(
        reader: impl Read + Send + 'static,
        file: impl AsRef<Path>,
        columns: &ContactColumns,
    ) -> Result<Self> {
        Self::of(LogTable::new(reader, file.as_ref())?, columns)
    }

    fn of(table: LogTable, columns: &ContactColumns) -> Result<Self> {
        Ok(Self {
            columns: Indices::find(columns, &table)?,
            table,
            up: columns.up,
            unit_m: columns.unit_m,
            time_offset_s: columns.time_offset_s,
            last_time_s: f64::NEG_INFINITY,
            bodies: BodyNames::default(),
            over: false,
        })
    }

    /// The names of the bodies met so far.
    pub fn bodies(&self) -> &[Arc<str>] {
        self.bodies.names()
    }

    /// The file's name.
    pub fn file(&self) -> &Path {
        self.table.file()
    }

    fn read_row(&mut self) -> Result<Option<ContactRow>> {
        let Some(line) = self.table.advance()? else { return Ok(None) };
        self.convert(line).map(Some).map_err(|fault| fault.at(at_line(line)))
    }

    fn convert(&mut self, line: u64) -> Result<ContactRow> {
        let table = &self.table;
        let time_s = table.number(self.columns.time)? + self.time_offset_s;
        if time_s < self.last_time_s {
            return Err(Error::new(format!(
                "time goes backwards: {} follows {}",
                time_s - self.time_offset_s,
                self.last_time_s - self.time_offset_s
            ))
            .help("sort the log by time"));
        }
        self.last_time_s = time_s;
        let position = table.numbers(self.columns.position)?;
        let push = match self.columns.push {
            Push::Force(column) => Push::Force(table.number(column)?),
            Push::Impulse(column) => Push::Impulse(table.number(column)?),
        };
        let normal = self.columns.normal.map(|columns| table.numbers(columns)).transpose()?;
        let velocity = self.columns.normal_velocity.map(|column| table.number(column)).transpose()?;
        let mut square = None;
        for &column in &self.columns.sliding_velocity {
            let part = table.number(column)?;
            square = Some(square.unwrap_or(0.0) + part * part);
        }
        let [a, b] = self.columns.bodies;
        Ok(ContactRow {
            time_s,
            a: table.body(a, &mut self.bodies)?,
            b: table.body(b, &mut self.bodies)?,
            position_m: upright(self.up, position).map(|c| c * self.unit_m),
            push,
            normal: normal.map(|n| upright(self.up, n)),
            normal_velocity_mps: velocity.map(|v| v * self.unit_m),
            sliding_mps: square.map(|square| square.sqrt() * self.unit_m),
            line,
        })
    }
}

impl Iterator for ContactLog {
    type Item = Result<ContactRow>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.over {
            return None;
        }
        let row = self.read_row().map_err(|fault| fault.in_file(self.table.file())).transpose();
        self.over = !matches!(row, Some(Ok(_)));
        row
    }
}

impl Indices {
    fn find(columns: &ContactColumns, table: &LogTable) -> Result<Self> {
        Ok(Self {
            time: table.column(&columns.time)?,
            bodies: [table.column(&columns.a)?, table.column(&columns.b)?],
            position: table.columns(&columns.position)?,
            push: match &columns.push {
                Push::Force(name) => Push::Force(table.column(name)?),
                Push::Impulse(name) => Push::Impulse(table.column(name)?),
            },
            normal: columns.normal.as_ref().map(|names| table.columns(names)).transpose()?,
            normal_velocity: columns.normal_velocity.as_ref().map(|name| table.column(name)).transpose()?,
            sliding_velocity: columns
                .sliding_velocity
                .iter()
                .map(|name| table.column(name))
                .collect::<Result<_>>()?,
        })
    }
}

/// Finds the simulation's step from times in ascending order, equal times allowed: the smallest
/// distance between two that is met again and again (1 in 50 may be smaller), averaged over those
/// up to half as long again, so that times rounded to too few digits do no harm.
///
/// `None` where there are no two different times.
///
/// ```
/// use froufrou::scene::contact_log::step_of_times;
/// // 240 Hz rounded to milliseconds, with a pause in which nothing touched.
/// let times = [0.004, 0.008, 0.008, 0.012, 0.017, 0.021, 0.025, 0.5, 0.504];
/// assert!((step_of_times(times).unwrap() - 1.0 / 240.0).abs() < 1e-4);
/// ```
pub fn step_of_times(times_s: impl IntoIterator<Item = f64>) -> Option<f64> {
    let mut times = times_s.into_iter();
    let mut last = times.next()?;
    let mut distances = Vec::new();
    for time in times {
        if time > last {
            distances.push(time - last);
            last = time;
        }
    }
    distances.sort_by(f64::total_cmp);
    let smallest = *distances.get(distances.len() / 50)?;
    let alike: Vec<f64> = distances.into_iter().filter(|d| (smallest..=1.5 * smallest).contains(d)).collect();
    Some(alike.iter().sum::<f64>() / alike.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::{Compression, write::GzEncoder};
    use proptest::prelude::*;
    use std::io::Write;

    fn columns() -> ContactColumns {
        ContactColumns {
            time: "t".into(),
            a: "bodyA".into(),
            b: "bodyB".into(),
            position: ["px".into(), "py".into(), "pz".into()],
            push: Push::Force("Fn".into()),
            normal: None,
            normal_velocity: None,
            sliding_velocity: Vec::new(),
            up: UpAxis::Y,
            unit_m: 1.0,
            time_offset_s: 0.0,
        }
    }

    const HEADER: &str = "t,bodyA,bodyB,px,py,pz,Fn,J,nx,ny,nz,v\n";

    fn read_with(text: impl Into<Vec<u8>>, columns: &ContactColumns) -> Result<Vec<ContactRow>> {
        ContactLog::new(std::io::Cursor::new(text.into()), "log.csv", columns)?.collect()
    }

    fn fault(text: impl Into<Vec<u8>>) -> String {
        read_with(text, &columns()).err().map(|e| e.to_string()).unwrap_or_default()
    }

    fn row(fields: &str) -> String {
        format!("{HEADER}{fields}\n")
    }

    #[test]
    fn units_axes_and_offsets_are_converted() -> Result<()> {
        let mut columns = columns();
        columns.up = UpAxis::Z;
        columns.unit_m = 0.01;
        columns.time_offset_s = 10.0;
        columns.push = Push::Impulse("J".into());
        columns.normal = Some(["nx".into(), "ny".into(), "nz".into()]);
        columns.normal_velocity = Some("v".into());
        let rows = read_with(row("0.5,ball,ground,1,2,3,40,0.25,0,0,1,-50"), &columns)?;
        let expected = ContactRow {
            time_s: 10.5,
            a: 0,
            b: 1,
            position_m: [0.01, 0.03, -0.02],
            push: Push::Impulse(0.25),
            normal: Some([0.0, 1.0, -0.0]),
            normal_velocity_mps: Some(-0.5),
            sliding_mps: None,
            line: 2,
        };
        assert_eq!(rows, [expected]);
        Ok(())
    }

    #[test]
    fn gzip_is_told_by_its_bytes_and_may_have_several_members() -> std::io::Result<()> {
        let pack = |text: &str| -> std::io::Result<Vec<u8>> {
            let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
            encoder.write_all(text.as_bytes())?;
            encoder.finish()
        };
        let mut bytes = pack(&row("0.001,a,b,1,2,3,4,0,0,0,1,0"))?;
        bytes.extend(pack("0.002,a,b,1,2,3,4,0,0,0,1,0\n")?);
        let rows = read_with(bytes.clone(), &columns()).map_err(std::io::Error::other)?;
        assert_eq!(rows.len(), 2);
        bytes.truncate(bytes.len() - 12);
        assert!(fault(bytes).contains("cannot read the log"));
        Ok(())
    }

    #[test]
    fn odd_names_are_kept_as_they_are() -> Result<()> {
        let text = row("0,\"a, \"\"quoted\"\"\nname\",Würfel.001 *[1],1,2,3,4,0,0,0,1,0");
        let mut log = ContactLog::new(std::io::Cursor::new(text), "log.csv", &columns())?;
        let _ = log.next().transpose()?;
        let names: Vec<&str> = log.bodies().iter().map(|n| &**n).collect();
        assert_eq!(names, ["a, \"quoted\"\nname", "Würfel.001 *[1]"]);
        Ok(())
    }

    #[test]
    fn faults_name_line_column_and_what_was_expected() {
        let good = "0.5,a,b,1,2,3,4,0,0,0,1,0";
        for (field, wrong) in [("px", "x"), ("py", "nan"), ("pz", "inf"), ("Fn", ""), ("t", "1e31")] {
            let names: Vec<&str> = HEADER.trim().split(',').collect();
            let mut fields: Vec<&str> = good.split(',').collect();
            if let Some(index) = names.iter().position(|n| *n == field) {
                fields[index] = wrong;
            }
            let text = format!("{HEADER}{good}\n{}\n", fields.join(","));
            let expected =
                format!("log.csv:3: column `{field}`: expected a number within ±1e30, found {wrong:?}");
            assert_eq!(fault(text), expected);
        }
        let back = format!("{HEADER}{good}\n{good}\n{}\n", good.replace("0.5", "0.4"));
        assert_eq!(fault(back), "log.csv:4: time goes backwards: 0.4 follows 0.5 (sort the log by time)");
        assert_eq!(fault(row("0,a")), "log.csv:2: expected 12 fields, as in the header, found 2");
        assert!(fault(row("0,,b,1,2,3,4,0,0,0,1,0")).starts_with("log.csv:2: column `bodyA`: expected the"));
        assert!(fault("").contains("there is no column `t` (the log is empty)"));
        assert_eq!(
            fault("t,bodyA,bodyC,x\n"),
            "log.csv:1: there is no column `bodyB` (did you mean `bodyA`? \
             there are `t`, `bodyA`, `bodyC` and `x`)"
        );
        assert_eq!(fault(HEADER.replace("py", "px")), "log.csv:1: there are two columns `px`");
        let bytes = [HEADER.as_bytes(), b"0,\xff,b,1,2,3,4,0,0,0,1,0\n"].concat();
        assert!(fault(bytes).contains("not UTF-8"));
    }

    #[test]
    fn an_endless_record_is_stopped() {
        let endless = std::io::repeat(b'x');
        let start = std::io::Cursor::new(format!("{HEADER}0,\""));
        let log = ContactLog::new(start.chain(endless), "log.csv", &columns());
        let found = log.and_then(|log| log.collect::<Result<Vec<_>>>());
        let text = found.err().map(|e| e.to_string()).unwrap_or_default();
        assert!(text.contains("record longer than"), "{text}");
        let header = ContactLog::new(std::io::repeat(b'x'), "log.csv", &columns());
        assert!(header.is_err_and(|e| e.to_string().contains("record longer than")));
    }

    #[test]
    fn the_step_is_found_in_spite_of_pauses_and_oddities() {
        let near = |found: Option<f64>, step: f64| found.is_some_and(|f| (f / step - 1.0).abs() < 0.02);
        for rate_hz in [1000.0, 240.0, 60.0, 30.0] {
            // In contact for three steps out of every seven.
            let times = (0..1000).filter(|i| i % 7 < 3).map(|i| f64::from(i) / rate_hz);
            assert!(near(step_of_times(times), 1.0 / rate_hz), "{rate_hz}");
        }
        // One tiny step at the end of a movement is not the step.
        let mut times: Vec<f64> = (0..200).map(|i| f64::from(i) / 60.0).collect();
        times.push(199.0 / 60.0 + 1e-9);
        assert!(near(step_of_times(times), 1.0 / 60.0));
        assert_eq!(step_of_times([1.0, 1.0]), None);
        assert_eq!(step_of_times([]), None);
    }

    proptest! {
        #[test]
        fn damaged_logs_are_told_not_crashed_on(cut in 0usize..400, at in 0usize..400, byte: u8, packed: bool) {
            let good = format!("{HEADER}{}", "0.5,a,\"b\",1,2,3,4,0,0,0,1,0\n".repeat(8));
            let mut bytes = good.into_bytes();
            if packed {
                let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
                encoder.write_all(&bytes).ok();
                bytes = encoder.finish().unwrap_or_default();
            }
            if let Some(place) = bytes.get_mut(at) { *place = byte; }
            bytes.truncate(cut);
            if let Ok(rows) = read_with(bytes, &columns()) {
                prop_assert!(rows.iter().all(|r| r.time_s.is_finite()));
            }
        }
    }
}
