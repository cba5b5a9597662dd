//! How fast a cloth was moved while it was recorded: said once for a take, told by a track of speeds, or by the
//! pulses of an encoder on a channel of the recording.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Place, Result};

/// The most rows of a track.
const MOST_ROWS: usize = 10_000_000;

/// The most bytes of the file of a track.
const MOST_BYTES: u64 = 1 << 30;

/// How far a cloth has moved over a recording.
#[derive(Debug, Clone, PartialEq)]
pub enum Motion {
    /// At one speed throughout, in m/s.
    Steady(f64),
    /// By how far it has come at times: seconds from the beginning of the recording, and metres.
    Track(Vec<[f64; 2]>),
}

impl Motion {
    /// From times in seconds and speeds in m/s, which change evenly between them. The sign of a speed does not matter.
    ///
    /// # Errors
    /// Fewer than two rows, times that do not rise, or numbers that are not finite.
    pub fn from_speeds(rows: &[[f64; 2]]) -> Result<Self> {
        if rows.len() < 2 {
            return Err(Error::new(format!(
                "expected at least 2 rows of times and speeds, found {}",
                rows.len()
            )));
        }
        let mut track = Vec::with_capacity(rows.len());
        let mut distance_m = 0.0;
        for (index, [time_s, speed_mps]) in rows.iter().enumerate() {
            let row = || Place::Part(format!("row {}", index + 1));
            if !time_s.is_finite() || !speed_mps.is_finite() || speed_mps.abs() > 1e4 {
                return Err(
                    Error::new(format!("the row holds {time_s}, {speed_mps}: no time and speed")).at(row())
                );
            }
            if let Some([last_s, last_mps]) = index.checked_sub(1).map(|last| rows[last]) {
                if *time_s <= last_s {
                    return Err(Error::new(format!("the time is {time_s} s, after {last_s} s")).at(row()));
                }
                distance_m += (time_s - last_s) * (speed_mps.abs() + last_mps.abs()) / 2.0;
            }
            track.push([*time_s, distance_m]);
        }
        Ok(Self::Track(track))
    }

    /// From a CSV file with the columns `time_s` and `speed_mps`, in any order and among others.
    ///
    /// # Errors
    /// A file that cannot be read, without these columns, or those of [`Motion::from_speeds`].
    pub fn open(path: &Path) -> Result<Self> {
        let metadata = std::fs::metadata(path).map_err(|e| Error::io("open", path, e))?;
        if metadata.len() > MOST_BYTES {
            return Err(Error::new(format!("the file has more than {MOST_BYTES} bytes")).in_file(path));
        }
        let text = std::fs::read(path).map_err(|e| Error::io("read", path, e))?;
        Self::parse(&text).map_err(|e| e.in_file(path))
    }

    /// From the text of such a file.
    ///
    /// # Errors
    /// Those of [`Motion::open`].
    pub fn parse(text: &[u8]) -> Result<Self> {
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(text);
        let fault = |e: csv::Error| {
            let line = e.position().map(|at| at.line() as usize);
            let error = Error::new(format!("cannot read the row: {e}")).because(e);
            match line {
                Some(line) => error.at(Place::Line { line, column: 0 }),
                None => error,
            }
        };
        let headers = reader.headers().map_err(fault)?.clone();
        let column = |name: &str| {
            headers.iter().position(|header| header == name).ok_or_else(|| {
                Error::new(format!("there is no column `{name}`"))
                    .at(Place::Line { line: 1, column: 0 })
                    .help("the columns are time_s,speed_mps")
            })
        };
        let columns = [column("time_s")?, column("speed_mps")?];
        let mut rows = Vec::new();
        for record in reader.records() {
            let record = record.map_err(fault)?;
            let line = record.position().map_or(0, |at| at.line() as usize);
            let mut row = [0.0; 2];
            for (value, column) in row.iter_mut().zip(columns) {
                let text = record.get(column).unwrap_or_default();
                *value = text.parse().map_err(|_| {
                    Error::new(format!("expected a number, found {text:?}"))
                        .at(Place::Line { line, column: 0 })
                })?;
            }
            if rows.len() == MOST_ROWS {
                return Err(Error::new(format!("more than {MOST_ROWS} rows")));
            }
            rows.push(row);
        }
        Self::from_speeds(&rows)
    }

    /// From a channel on which an encoder gives a pulse for each part of a metre: the moments at which the signal
    /// rises through the middle of its range, with a hysteresis of a quarter of it.
    ///
    /// # Errors
    /// Fewer than two pulses, or no pulses a metre.
    pub fn from_pulses(samples: &[f32], rate_hz: f64, pulses_per_m: f64) -> Result<Self> {
        if !(1e-3..=1e9).contains(&pulses_per_m) {
            return Err(Error::new(format!("an encoder has {pulses_per_m} pulses a metre"))
                .at(Place::Part("pulses_per_m".to_owned())));
        }
        let least = samples.iter().copied().fold(f32::INFINITY, f32::min);
        let greatest = samples.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let middle = (least + greatest) / 2.0;
        let low = middle - (greatest - least) / 8.0;
        let high = middle + (greatest - least) / 8.0;
        let mut track: Vec<[f64; 2]> = Vec::new();
        let (mut armed, mut rose) = (false, None);
        for (n, pair) in samples.windows(2).enumerate() {
            let [a, b] = [pair[0], pair[1]];
            if a <= low {
                armed = true;
            }
            if armed && a < middle && b >= middle {
                // The last time through the middle, between two samples.
                rose = Some((n as f64 + f64::from((middle - a) / (b - a))) / rate_hz);
            }
            if armed && b >= high {
                if let Some(time_s) = rose.take() {
                    track.push([time_s, track.len() as f64 / pulses_per_m]);
                }
                armed = false;
            }
        }
        if track.len() < 2 {
            return Err(Error::new(format!("the encoder's channel holds {} pulses", track.len()))
                .help("is it the right channel? They count from 0"));
        }
        Ok(Self::Track(track))
    }

    /// How far it has come at a time since the track began; none where the track does not tell.
    pub fn distance_m(&self, time_s: f64) -> Option<f64> {
        match self {
            Self::Steady(speed_mps) => Some(speed_mps.abs() * time_s),
            Self::Track(track) => {
                let after = track.partition_point(|[at_s, _]| *at_s <= time_s);
                match (after.checked_sub(1).and_then(|before| track.get(before)), track.get(after)) {
                    (Some([from_s, from_m]), Some([to_s, to_m])) => {
                        Some(from_m + (to_m - from_m) * (time_s - from_s) / (to_s - from_s))
                    }
                    (Some([at_s, at_m]), None) if *at_s == time_s => Some(*at_m),
                    _ => None,
                }
            }
        }
    }
}

/// Where a seam passes, and what is heard is not the cloth.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Seams {
    /// From when to when, in seconds.
    pub times_s: Vec<[f64; 2]>,
    /// From where to where, in metres that the cloth has come.
    pub places_m: Vec<[f64; 2]>,
    /// After how many metres the same places come again, as on a drum; 0 for never.
    pub round_m: f64,
}

impl Seams {
    /// Refuses what are no stretches.
    ///
    /// # Errors
    /// A stretch that ends before it begins, or numbers that are not finite.
    pub fn check(&self) -> Result<()> {
        for [from, to] in self.times_s.iter().chain(&self.places_m) {
            if !(from.is_finite() && to.is_finite() && from <= to) {
                return Err(Error::new(format!("a seam passes from {from} to {to}")));
            }
        }
        if !(self.round_m.is_finite() && self.round_m >= 0.0) {
            return Err(Error::new(format!("the cloth goes round in {} m", self.round_m)));
        }
        Ok(())
    }

    /// Whether a seam passes within a time in which the cloth moves from one place to another.
    pub fn pass(&self, time_s: [f64; 2], place_m: [f64; 2]) -> bool {
        let meet = |a: [f64; 2], b: [f64; 2]| a[0] <= b[1] && b[0] <= a[1];
        if self.times_s.iter().any(|seam| meet(*seam, time_s)) {
            return true;
        }
        if self.round_m <= 0.0 {
            return self.places_m.iter().any(|seam| meet(*seam, place_m));
        }
        self.places_m.iter().any(|[from, to]| {
            // The first time round on which the seam's end is not before the stretch.
            let turn = ((place_m[0] - to) / self.round_m).ceil() * self.round_m;
            meet([from + turn, to + turn], place_m)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_and_pulses_tell_the_same_way() {
        // From rest to 1 m/s in 2 s: t² / 4 metres.
        let rows: Vec<[f64; 2]> = (0..=200).map(|n| [0.01 * f64::from(n), 0.005 * f64::from(n)]).collect();
        let by_speed = Motion::from_speeds(&rows).unwrap();
        let rate_hz = 48_000.0;
        let pulses: Vec<f32> = (0..96_000)
            .map(|n| {
                let metres = (f64::from(n) / rate_hz).powi(2) / 4.0;
                if (metres * 500.0).fract() < 0.5 { 0.8 } else { -0.7 }
            })
            .collect();
        let by_pulse = Motion::from_pulses(&pulses, rate_hz, 500.0).unwrap();
        for (from_s, to_s) in [(0.5, 0.55), (1.0, 1.05), (1.9, 1.95)] {
            let way = |motion: &Motion| motion.distance_m(to_s).unwrap() - motion.distance_m(from_s).unwrap();
            let expected = (to_s * to_s - from_s * from_s) / 4.0;
            assert!((way(&by_speed) - expected).abs() < 1e-4, "{}", way(&by_speed));
            assert!((way(&by_pulse) - expected).abs() < 1e-4, "{}", way(&by_pulse));
        }
        assert_eq!(by_speed.distance_m(2.1), None);
        assert_eq!(by_pulse.distance_m(-0.1), None);
        assert_eq!(Motion::Steady(-0.5).distance_m(3.0), Some(1.5));
    }

    #[test]
    fn noise_on_the_encoder_gives_no_pulses() {
        let random = crate::random::Random::new(2, 2);
        let pulse = |n: u32| if (n / 100).is_multiple_of(2) { 0.0 } else { 1.0 };
        let noisy: Vec<f32> =
            (0..48_000).map(|n| pulse(n) + 0.1 * (random.uniform(u64::from(n)) as f32 - 0.5)).collect();
        let Motion::Track(track) = Motion::from_pulses(&noisy, 48_000.0, 100.0).unwrap() else { panic!() };
        assert_eq!(track.len(), 240);
        assert!(Motion::from_pulses(&[0.0; 100], 48_000.0, 100.0).is_err());
        assert!(Motion::from_pulses(&noisy, 48_000.0, 0.0).is_err());
    }

    #[test]
    fn tracks_are_read_and_faults_are_placed() {
        let text = "frame, speed_mps, time_s\n1, 0.5, 0\n2, 0.5, 1\n";
        let Motion::Track(track) = Motion::parse(text.as_bytes()).unwrap() else { panic!() };
        assert_eq!(track, [[0.0, 0.0], [1.0, 0.5]]);
        for (bad, what) in [
            ("time_s,speed\n0,1\n", "speed_mps"),
            ("time_s,speed_mps\n0,1\n", "at least 2"),
            ("time_s,speed_mps\n0,1\n0,1\n", "row 2"),
            ("time_s,speed_mps\n0,1\n1,fast\n", "3: expected a number, found \"fast\""),
            ("time_s,speed_mps\n0,1\n1,inf\n", "no time and speed"),
            ("time_s,speed_mps\n0,1\n1\n", "3: "),
            ("", "time_s"),
        ] {
            let error = Motion::parse(bad.as_bytes()).unwrap_err().to_string();
            assert!(error.contains(what), "{error}");
        }
    }

    #[test]
    fn seams_come_round_again() {
        let seams = Seams { times_s: vec![[1.0, 1.1]], places_m: vec![[0.5, 0.52]], round_m: 0.0 };
        assert!(seams.pass([1.05, 1.2], [9.0, 9.1]));
        assert!(seams.pass([0.0, 0.1], [0.51, 0.6]));
        assert!(!seams.pass([0.0, 0.1], [0.6, 1.6]));
        let drum = Seams { round_m: 1.0, ..seams };
        for turn in [0.0, 1.0, 7.0] {
            assert!(drum.pass([0.0, 0.1], [turn + 0.45, turn + 0.505]));
            assert!(drum.pass([0.0, 0.1], [turn + 0.515, turn + 0.6]));
            assert!(!drum.pass([0.0, 0.1], [turn + 0.53, turn + 1.49]));
            assert!(drum.pass([0.0, 0.1], [turn + 0.53, turn + 1.51]));
        }
        assert!(Seams { times_s: vec![[2.0, 1.0]], ..Seams::default() }.check().is_err());
    }

    #[test]
    fn damaged_tracks_are_told_or_go_forwards() {
        let text = "time_s,speed_mps\n0,0.5\n0.5,1.5e-1\n1,-2\n2.25,0\n".as_bytes();
        let check = |text: &[u8]| {
            if let Ok(Motion::Track(track)) = Motion::parse(text) {
                assert!(track.iter().flatten().all(|number| number.is_finite()));
                assert!(track.windows(2).all(|pair| pair[0][0] < pair[1][0] && pair[0][1] <= pair[1][1]));
            }
        };
        for at in 0..text.len() {
            check(&text[..at]);
            for byte in 0..=255 {
                let mut damaged = text.to_vec();
                damaged[at] = byte;
                check(&damaged);
            }
        }
    }
}
