//! What a SOFA file of the convention SimpleFreeFieldHRIR (AES69) says, turned into this project's frame.

use std::path::Path;

use super::coordinates::{Coordinates, Listener};
use super::grid::Vector;
use super::hdf::{File, Variable};
use super::sphere::RADIUS_M;
use crate::Result;

/// What is measured in most rooms, on a grid of half a degree.
const MOST_DIRECTIONS: usize = 260_000;

/// A response that lasts longer, in seconds, is that of a room.
const LONGEST_S: f64 = 2.0;

/// Sampling rates that a file may have, in hertz.
const RATES_HZ: std::ops::RangeInclusive<f64> = 8_000.0..=1_000_000.0;

/// The responses of a head's ears, as measured.
pub(super) struct Measurements {
    pub(super) rate_hz: f64,
    /// Length of each response.
    pub(super) samples: usize,
    /// Directions in the listener's own frame, of length 1, in the order of the file.
    pub(super) directions: Vec<Vector>,
    /// Distance of each from the head's centre in metres, 0 where it is not known.
    pub(super) distances_m: Vec<f64>,
    /// For each direction the left and the right ear's response.
    pub(super) responses: Vec<f64>,
    /// By how many samples each response is to be delayed.
    pub(super) delays: Vec<[f64; 2]>,
    /// Half the distance of the ears, in metres.
    pub(super) radius_m: f64,
    /// Whether `ReceiverPosition` has the ears the other way round than the responses.
    pub(super) contradictory: bool,
}

/// Reads a file.
pub(super) fn read(path: &Path) -> Result<Measurements> {
    let file = File::open(path)?;
    check_convention(&file)?;
    let responses = need(&file, "Data.IR")?;
    let [directions, 2, samples] = responses.shape[..] else {
        return Err(file.fault(
            "Data.IR",
            format!("its shape is {:?}, expected [measurements, 2 ears, samples]", responses.shape),
            "name a set measured at two ears",
        ));
    };
    let rate_hz = rate(&file)?;
    if directions == 0 || samples == 0 || directions > MOST_DIRECTIONS || samples as f64 > LONGEST_S * rate_hz
    {
        return Err(file.fault(
            "Data.IR",
            format!(
                "{directions} measurements of {samples} samples at {rate_hz} Hz, expected 1 to {MOST_DIRECTIONS} \
                 of at most {LONGEST_S} s"
            ),
            "name a set of head-related impulse responses",
        ));
    }
    finite(&file, &responses)?;

    let (places, distances_m) = directions_of(&file, directions)?;
    let delays = delays(&file, directions, rate_hz)?;
    let (receivers, radius_m) = receivers(&file)?;
    let mut measurements = Measurements {
        rate_hz,
        samples,
        directions: places,
        distances_m,
        responses: responses.values,
        delays,
        radius_m,
        contradictory: false,
    };
    // The responses themselves say which ear is which: a head shades the far one. Files are about whose
    // `ReceiverPosition` has the ears exchanged; where the responses are clear, they are believed.
    let heard = measurements.first_is_left();
    let swap = !heard.or(receivers).unwrap_or(true);
    measurements.contradictory = matches!((heard, receivers), (Some(heard), Some(said)) if heard != said);
    if swap {
        for both in measurements.responses.chunks_exact_mut(2 * samples) {
            let (first, second) = both.split_at_mut(samples);
            first.swap_with_slice(second);
        }
        measurements.delays.iter_mut().for_each(|delays| delays.swap(0, 1));
    }
    if measurements.responses.iter().all(|x| *x == 0.0) {
        return Err(file.fault("Data.IR", "all responses are silent", "name a set that sounds"));
    }
    Ok(measurements)
}

impl Measurements {
    /// Both ears' responses of a measurement.
    pub(super) fn response(&self, measurement: usize) -> [&[f64]; 2] {
        let begin = 2 * measurement * self.samples;
        let (left, right) = self.responses[begin..begin + 2 * self.samples].split_at(self.samples);
        [left, right]
    }

    /// Whether the first receiver is louder for what comes from the left; none where neither is clearly.
    fn first_is_left(&self) -> Option<bool> {
        let (mut together, mut sides, mut levels) = (0.0, 0.0, 0.0);
        for (n, direction) in self.directions.iter().enumerate() {
            let [first, second] =
                self.response(n).map(|response| response.iter().map(|x| x * x).sum::<f64>());
            if first > 0.0 && second > 0.0 {
                let (side, level) = (-direction[0], (first / second).ln());
                together += side * level;
                sides += side * side;
                levels += level * level;
            }
        }
        let likeness = together / (sides * levels).sqrt();
        (likeness.abs() > 0.5).then_some(likeness > 0.0)
    }
}

/// Holds what a file says of its convention against what can be read.
fn check_convention(file: &File) -> Result<()> {
    let help = "name a set of the convention SimpleFreeFieldHRIR";
    if let Some(other) = file.attribute("Conventions")?.filter(|found| found != "SOFA") {
        let what = format!("the file follows the conventions `{other}`, expected `SOFA`");
        return Err(file.fault("Conventions", what, help));
    }
    match file.attribute("SOFAConventions")? {
        Some(found) if found == "SimpleFreeFieldHRIR" => {}
        Some(other) => {
            let what = format!("the convention is `{other}`, expected `SimpleFreeFieldHRIR`");
            return Err(file.fault("SOFAConventions", what, help));
        }
        None => {
            let what = "the file does not say which SOFA convention it follows";
            return Err(file.fault("SOFAConventions", what, help));
        }
    }
    if let Some(other) = file.attribute("DataType")?.filter(|found| found != "FIR") {
        let what = format!("the data are of type `{other}`, expected `FIR`");
        return Err(file.fault("DataType", what, help));
    }
    Ok(())
}

fn need(file: &File, name: &'static str) -> Result<Variable> {
    file.variable(name)?.ok_or_else(|| {
        file.fault(
            name,
            "this variable is missing, which every set of the convention SimpleFreeFieldHRIR has",
            "write the file anew",
        )
    })
}

fn finite(file: &File, variable: &Variable) -> Result<()> {
    match variable.values.iter().position(|value| value.is_nan() || value.abs() > 1e30) {
        None => Ok(()),
        Some(index) => Err(file.fault(
            variable.name,
            format!("value {index} is {}, expected a finite number", variable.values[index]),
            "measure or write this set anew",
        )),
    }
}

fn rate(file: &File) -> Result<f64> {
    let variable = need(file, "Data.SamplingRate")?;
    let help = "all responses of a set must have one rate in hertz";
    let fault = |what: String| Err(file.fault(variable.name, what, help));
    if let Some(units) = variable
        .units
        .as_deref()
        .filter(|units| !["hertz", "hz"].contains(&units.trim().to_lowercase().as_str()) && !units.is_empty())
    {
        return fault(format!("the unit is `{units}`, expected hertz"));
    }
    match variable.values[..] {
        [first, ref others @ ..] if others.iter().all(|other| *other == first) => {
            if RATES_HZ.contains(&first) {
                Ok(first)
            } else {
                fault(format!("the rate is {first} Hz, expected {} to {}", RATES_HZ.start(), RATES_HZ.end()))
            }
        }
        [] => fault("there is no rate".into()),
        _ => fault("there are several rates, expected one".into()),
    }
}

/// The rows of a variable of shape [1 or `count`, 3], perhaps with a third dimension of length 1.
fn rows(file: &File, variable: &Variable, count: usize) -> Result<Vec<Vector>> {
    finite(file, variable)?;
    let rows = match variable.shape[..] {
        [rows, 3] | [rows, 3, 1] if rows == 1 || rows == count => rows,
        // A row for each measurement, as receivers and emitters have them.
        [1, 3, rows] if rows == count => {
            let at = |n: usize, k: usize| variable.values[k * rows + n];
            return Ok((0..rows).map(|n| [at(n, 0), at(n, 1), at(n, 2)]).collect());
        }
        _ => {
            return Err(file.fault(
                variable.name,
                format!("its shape is {:?}, expected [1 or {count}, 3]", variable.shape),
                "write the file anew",
            ));
        }
    };
    let all: Vec<Vector> = variable.values.chunks_exact(3).map(|row| [row[0], row[1], row[2]]).collect();
    Ok(if rows == count { all } else { vec![all[0]; count] })
}

fn coordinates(file: &File, variable: &Variable, default: Coordinates) -> Result<Coordinates> {
    Coordinates::new(variable.kind.as_deref(), variable.units.as_deref(), default).map_err(|what| {
        file.fault(variable.name, what, "give the variable the attributes Type and Units of SOFA")
    })
}

/// Where each measurement's sound came from in the listener's own frame, and from how far.
fn directions_of(file: &File, count: usize) -> Result<(Vec<Vector>, Vec<f64>)> {
    let sources = need(file, "SourcePosition")?;
    let degrees = Coordinates::Spherical { angle_rad: 1.0_f64.to_radians() };
    let source_coordinates = coordinates(file, &sources, degrees)?;
    let places = rows(file, &sources, count)?;
    let vectors = |name, or: Vector, kind: Option<Coordinates>| -> Result<(Vec<Vector>, Coordinates)> {
        let default = kind.unwrap_or(Coordinates::Cartesian);
        match file.variable(name)? {
            None => Ok((vec![or; count], Coordinates::Cartesian)),
            Some(variable) => {
                let kind = coordinates(file, &variable, default)?;
                let rows = rows(file, &variable, count)?;
                Ok((rows.into_iter().map(|row| kind.place(row)).collect(), kind))
            }
        }
    };
    let (origins, _) = vectors("ListenerPosition", [0.0; 3], None)?;
    let (views, view_kind) = vectors("ListenerView", [1.0, 0.0, 0.0], None)?;
    // What is above has the coordinates of the view, unless it says so itself.
    let (ups, _) = vectors("ListenerUp", [0.0, 0.0, 1.0], Some(view_kind))?;

    let mut directions = Vec::with_capacity(count);
    let mut distances_m = Vec::with_capacity(count);
    for (n, place) in places.into_iter().enumerate() {
        let listener = Listener::new(views[n], ups[n]).ok_or_else(|| {
            let what =
                format!("view {:?} and up {:?} leave open how the listener is turned", views[n], ups[n]);
            file.fault("ListenerView", what, "the view must not be 0 nor point along ListenerUp")
        })?;
        let seen = if origins[n] == [0.0; 3] {
            source_coordinates.direction(place)
        } else {
            let place = source_coordinates.place(place);
            Coordinates::Cartesian.direction(std::array::from_fn(|k| place[k] - origins[n][k]))
        };
        let Some((direction, distance_m)) = seen else {
            let what = format!("measurement {n} comes from the head's centre, expected a direction");
            return Err(file.fault("SourcePosition", what, "a source must lie outside the head"));
        };
        directions.push(listener.own(direction));
        distances_m.push(distance_m.max(0.0));
    }
    Ok((directions, distances_m))
}

/// What the file delays each response by, in samples.
fn delays(file: &File, count: usize, rate_hz: f64) -> Result<Vec<[f64; 2]>> {
    let Some(variable) = file.variable("Data.Delay")? else { return Ok(vec![[0.0; 2]; count]) };
    finite(file, &variable)?;
    let fault = |what: String| {
        file.fault(variable.name, what, "give one row of samples for all measurements, or one for each")
    };
    let rows: Vec<[f64; 2]> = match variable.shape[..] {
        [rows, 2] if rows == 1 || rows == count => {
            variable.values.chunks_exact(2).map(|row| [row[0], row[1]]).collect()
        }
        _ => return Err(fault(format!("its shape is {:?}, expected [1 or {count}, 2]", variable.shape))),
    };
    let least = rows.as_flattened().iter().fold(f64::INFINITY, |least, delay| least.min(*delay));
    let most = rows.as_flattened().iter().fold(0.0_f64, |most, delay| most.max(*delay));
    if most > LONGEST_S * rate_hz || least < 0.0 {
        let worst = if least < 0.0 { least } else { most };
        return Err(fault(format!("a delay of {worst} samples, expected 0 to {}", LONGEST_S * rate_hz)));
    }
    Ok(if rows.len() == count { rows } else { vec![rows[0]; count] })
}

/// Whether the first receiver is said to be the left one, and half the distance of both in metres.
fn receivers(file: &File) -> Result<(Option<bool>, f64)> {
    let Some(variable) = file.variable("ReceiverPosition")? else { return Ok((None, RADIUS_M)) };
    let kind = coordinates(file, &variable, Coordinates::Cartesian)?;
    // [2 receivers, 3 coordinates, 1 or a place for each measurement]; the first is taken.
    let (row, step) = match variable.shape[..] {
        [2, 3] => (3, 1),
        [2, 3, places] if places > 0 => (3 * places, places),
        _ => {
            let what = format!("its shape is {:?}, expected [2 ears, 3, 1]", variable.shape);
            return Err(file.fault(variable.name, what, "name a set measured at two ears"));
        }
    };
    finite(file, &variable)?;
    let left = [0, 1].map(|ear| {
        let at = |k: usize| variable.values[ear * row + k * step];
        kind.place([at(0), at(1), at(2)])[1]
    });
    let radius_m = (left[0] - left[1]).abs() / 2.0;
    let first = if left[0] == left[1] { None } else { Some(left[0] > left[1]) };
    Ok((first, if (0.04..=0.15).contains(&radius_m) { radius_m } else { RADIUS_M }))
}
