//! Pose logs: where the bodies of a rigid-body simulation are, a CSV table with a row for every body and
//! time, gzipped or not. What is seen in a renderer comes from such a log, and so does what is heard.
//!
//! Each body is an object `/NAME` that has a transform and no mesh. Times are those of the soundtrack, as those
//! of contact logs are, because the same simulation writes both: a log that begins late does not bring the
//! soundtrack's beginning with it. Between two rows positions go straight and rotations turn evenly.
//!
//! # Columns
//! A scene names them, or they are found by the names that are usual, whatever the case: `t` or `time`;
//! `body`, `name`, `object` or `link`; `x`, `px` or `pos_x` and so on; `qx` … `qw`; `vx` …; `wx` …. A log needs a
//! time, a body and a position. Without a rotation bodies do not turn. Velocities are those of the simulation at the
//! time of the row, in the world's axes; where they are not told they follow from the poses.
//!
//! All poses are held in memory, 80 bytes each at most, and there may be [`MOST_POSES`].

use std::path::{Path, PathBuf};

use glam::{DMat3, DQuat, DVec3};

use super::animation::{
    Animation, IDENTITY, KeyTimes, Mesh, ObjectInfo, ObjectKind, StatedVelocity, Topology, Transform,
};
use super::log_table::{BodyNames, LogTable, at_line, columns_there};
use crate::{Error, Place, Result};

/// The most poses that a log may have.
pub const MOST_POSES: usize = 10_000_000;

/// Times that are this near to equally spaced ones, in seconds, are taken as such: logs are rounded.
const TIME_TOLERANCE_S: f64 = 1e-6;

/// Which columns of a pose log hold what; what is not said is found by its usual name.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PoseColumns {
    /// Time in seconds.
    pub time: Option<String>,
    /// The name of the body.
    pub body: Option<String>,
    /// The place of its origin, which is its centre of mass in most simulations.
    pub position: Option<[String; 3]>,
    /// Its rotation as a quaternion x, y, z, w.
    pub rotation: Option<[String; 4]>,
    /// The velocity of its origin, in units of length a second.
    pub velocity: Option<[String; 3]>,
    /// Its angular velocity in radians a second.
    pub angular_velocity: Option<[String; 3]>,
}

/// An open pose log.
pub struct PoseLog {
    path: PathBuf,
    objects: Vec<ObjectInfo>,
    bodies: Vec<Body>,
}

/// The poses of one body, one for each of its times.
#[derive(Debug, Default)]
struct Body {
    times_s: Vec<f64>,
    positions: Vec<[f64; 3]>,
    /// None of them where the log has none; so for what follows.
    rotations: Vec<[f32; 4]>,
    velocities: Vec<[f32; 3]>,
    angular: Vec<[f32; 3]>,
}

impl Body {
    fn forget_last(&mut self) {
        self.times_s.pop();
        self.positions.pop();
        self.rotations.pop();
        self.velocities.pop();
        self.angular.pop();
    }
}

/// The columns' places in the header.
struct Indices {
    time: usize,
    body: usize,
    position: [usize; 3],
    rotation: Option<[usize; 4]>,
    velocity: Option<[usize; 3]>,
    angular: Option<[usize; 3]>,
}

const TIMES: &[&str] = &["t", "time", "times", "timestamp", "seconds"];
const BODIES: &[&str] = &["body", "name", "object", "link", "bodyname"];
const POSITIONS: &[&str] = &["", "p", "pos", "position", "t", "translation", "com"];
const ROTATIONS: &[&str] = &["q", "quat", "quaternion", "rot", "rotation", "orn", "orientation"];
const VELOCITIES: &[&str] = &["v", "vel", "velocity", "linvel", "linearvelocity"];
const ANGULAR: &[&str] = &["w", "omega", "angvel", "angularvelocity"];

/// A name of a column as far as it tells what the column is.
fn plain(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

/// The place of the column that has one of these names.
fn usual(header: &[String], names: &[&str]) -> Option<usize> {
    names.iter().find_map(|name| header.iter().position(|column| plain(column) == *name))
}

/// The places of columns that are named alike but for the axis.
fn usual_axes<const N: usize>(header: &[String], names: &[&str], axes: [&str; N]) -> Option<[usize; N]> {
    names.iter().find_map(|name| {
        let mut found = [0; N];
        for (place, axis) in found.iter_mut().zip(axes) {
            *place = header.iter().position(|column| plain(column) == format!("{name}{axis}"))?;
        }
        Some(found)
    })
}

const XYZ: [&str; 3] = ["x", "y", "z"];

impl Indices {
    fn find(columns: &PoseColumns, table: &LogTable) -> Result<Self> {
        let header = table.header();
        let one = |name: &Option<String>, names: &[&str]| match name {
            Some(name) => table.column(name).map(Some),
            None => Ok(usual(header, names)),
        };
        let three = |given: &Option<[String; 3]>, names: &[&str]| match given {
            Some(given) => table.columns(given).map(Some),
            None => Ok(usual_axes(header, names, XYZ)),
        };
        let missing = |key: &str, what: &str| {
            let help = format!("name it with `{key}` in `columns`; {}", columns_there(header));
            table.in_header(Error::new(format!("there is no column for {what}")).help(help))
        };
        Ok(Self {
            time: one(&columns.time, TIMES)?.ok_or_else(|| missing("t", "the time"))?,
            body: one(&columns.body, BODIES)?.ok_or_else(|| missing("body", "the name of the body"))?,
            position: three(&columns.position, POSITIONS)?
                .ok_or_else(|| missing("position", "the position"))?,
            rotation: match &columns.rotation {
                Some(given) => Some(table.columns(given)?),
                None => usual_axes(header, ROTATIONS, ["x", "y", "z", "w"]),
            },
            velocity: three(&columns.velocity, VELOCITIES)?,
            angular: three(&columns.angular_velocity, ANGULAR)?,
        })
    }
}

impl PoseLog {
    /// Reads a log; gzip is told by its first bytes, not by its name.
    ///
    /// # Errors
    /// A file that cannot be read, a header without the columns, or a row that is no pose.
    pub fn open(path: impl AsRef<Path>, columns: &PoseColumns) -> Result<Self> {
        Self::read(LogTable::open(path.as_ref())?, columns)
    }

    /// Reads a log from anywhere; `file` is its name in messages.
    ///
    /// # Errors
    /// As [`PoseLog::open`].
    ///
    /// ```
    /// use froufrou::scene::animation::Animation;
    /// use froufrou::scene::pose_log::{PoseColumns, PoseLog};
    /// let text = "time,body,x,y,z\n0,ball,0,1,0\n0.5,ball,2,1,0\n";
    /// let log = PoseLog::new(text.as_bytes(), "poses.csv", &PoseColumns::default())?;
    /// assert_eq!(log.objects()[0].path, "/ball");
    /// assert_eq!(log.transform(0, 0.25)?[0][3], 1.0);
    /// # Ok::<(), froufrou::Error>(())
    /// ```
    pub fn new(
        reader: impl std::io::Read + Send + 'static,
        file: impl AsRef<Path>,
        columns: &PoseColumns,
    ) -> Result<Self> {
        Self::read(LogTable::new(reader, file.as_ref())?, columns)
    }

    /// True for a file whose header is that of a pose log whose columns have their usual names.
    pub fn recognises(path: impl AsRef<Path>) -> bool {
        LogTable::open(path.as_ref()).is_ok_and(|table| {
            let bodies = table.header().iter().filter(|name| plain(name).starts_with("body")).count();
            bodies <= 1 && Indices::find(&PoseColumns::default(), &table).is_ok()
        })
    }

    fn read(mut table: LogTable, columns: &PoseColumns) -> Result<Self> {
        let indices = Indices::find(columns, &table)?;
        let mut names = BodyNames::default();
        let mut bodies: Vec<Body> = Vec::new();
        let (mut last_s, mut count) = (f64::NEG_INFINITY, 0);
        loop {
            let Some(line) = table.advance().map_err(|fault| fault.in_file(table.file()))? else { break };
            count += 1;
            let row = if count > MOST_POSES {
                let what = format!("more than {MOST_POSES} poses");
                Err(Error::new(what).help("leave bodies or times out of the log"))
            } else {
                take(&table, &indices, &mut names, &mut bodies, &mut last_s)
            };
            row.map_err(|fault| fault.in_file(table.file()).at(at_line(line)))?;
        }
        let mut objects = Vec::with_capacity(bodies.len());
        for (name, body) in names.names().iter().zip(&mut bodies) {
            objects.push(ObjectInfo {
                path: format!("/{name}"),
                kind: ObjectKind::Transform,
                topology: Topology::None,
                key_times: KeyTimes::from_times(std::mem::take(&mut body.times_s), TIME_TOLERANCE_S),
            });
        }
        Ok(Self { path: table.file().to_owned(), objects, bodies })
    }

    fn object(&self, object: usize) -> Result<(&ObjectInfo, &Body)> {
        self.objects.get(object).zip(self.bodies.get(object)).ok_or_else(|| {
            Error::new(format!("there is no object {object}; there are {}", self.objects.len()))
                .in_file(&self.path)
        })
    }
}

/// Takes a record.
fn take(
    table: &LogTable,
    indices: &Indices,
    names: &mut BodyNames,
    bodies: &mut Vec<Body>,
    last_s: &mut f64,
) -> Result<()> {
    let time_s = table.number(indices.time)?;
    if time_s < *last_s {
        return Err(Error::new(format!("time goes backwards: {time_s} follows {last_s}"))
            .help("sort the log by time"));
    }
    *last_s = time_s;
    let number = table.body(indices.body, names)? as usize;
    if number == bodies.len() {
        bodies.push(Body::default());
    }
    let Some(body) = bodies.get_mut(number) else { return Ok(()) };
    let position = table.numbers(indices.position)?;
    let rotation = indices.rotation.map(|columns| table.numbers(columns)).transpose()?;
    let velocity = indices.velocity.map(|columns| table.numbers(columns)).transpose()?;
    let angular = indices.angular.map(|columns| table.numbers(columns)).transpose()?;
    // Of two rows for one time the last counts.
    if body.times_s.last() == Some(&time_s) {
        body.forget_last();
    }
    body.times_s.push(time_s);
    body.positions.push(position);
    if let Some(rotation) = rotation {
        let length = rotation.iter().map(|c| c * c).sum::<f64>().sqrt();
        if !(1e-6..=1e6).contains(&length) {
            return Err(Error::new(format!(
                "expected a rotation as a quaternion x, y, z, w of length 1, found {rotation:?}"
            )));
        }
        body.rotations.push(rotation.map(|c| (c / length) as f32));
    }
    body.velocities.extend(velocity.map(|v| v.map(|c| c as f32)));
    body.angular.extend(angular.map(|w| w.map(|c| c as f32)));
    Ok(())
}

/// A rotation, of length 1 as nearly as 64 bits have it.
fn quaternion(rotation: [f32; 4]) -> DQuat {
    DQuat::from_array(rotation.map(f64::from)).normalize()
}

impl Animation for PoseLog {
    fn objects(&self) -> &[ObjectInfo] {
        &self.objects
    }

    fn transform(&self, object: usize, time_s: f64) -> Result<Transform> {
        let (info, body) = self.object(object)?;
        let at = info.key_times.bracket(time_s);
        let (floor, ceiling) = (at.floor as usize, at.ceiling as usize);
        let (Some(a), Some(b)) = (body.positions.get(floor), body.positions.get(ceiling)) else {
            return Ok(IDENTITY);
        };
        let place = DVec3::from(*a).lerp(DVec3::from(*b), at.fraction);
        let turn = match (body.rotations.get(floor), body.rotations.get(ceiling)) {
            (Some(&a), Some(&b)) => quaternion(a).slerp(quaternion(b), at.fraction),
            _ => DQuat::IDENTITY,
        };
        let columns = DMat3::from_quat(turn);
        Ok(std::array::from_fn(|row| match row {
            3 => IDENTITY[3],
            _ => [columns.x_axis[row], columns.y_axis[row], columns.z_axis[row], place[row]],
        }))
    }

    fn mesh(&self, object: usize, _: f64, _: &mut Mesh) -> Result<()> {
        let (info, _) = self.object(object)?;
        Err(Error::new("a body of a pose log has no mesh")
            .in_file(&self.path)
            .at(Place::Part(info.path.clone())))
    }

    fn velocity(&self, object: usize, time_s: f64) -> Result<StatedVelocity> {
        let (info, body) = self.object(object)?;
        let at = info.key_times.bracket(time_s);
        let stands = info.key_times.span_s().is_some_and(|(first_s, last_s)| {
            time_s < first_s - TIME_TOLERANCE_S || time_s > last_s + TIME_TOLERANCE_S
        });
        let mixed = |of: &[[f32; 3]]| {
            let (a, b) = (of.get(at.floor as usize)?, of.get(at.ceiling as usize)?);
            let mix = |i: usize| f64::from(a[i]) + (f64::from(b[i]) - f64::from(a[i])) * at.fraction;
            Some(if stands { [0.0; 3] } else { std::array::from_fn(mix) })
        };
        Ok(StatedVelocity { linear_mps: mixed(&body.velocities), angular_rps: mixed(&body.angular) })
    }

    fn is_log(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests;
