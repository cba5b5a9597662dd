//! Scripts that say where the members of a swarm are.

use std::path::Path;
use std::sync::Arc;

use rhai::Dynamic;

use super::numbers;
use super::script::Script;
use crate::random::Random;
use crate::{Error, Result};

/// The function that such a script has.
const USAGE: &str = "fn place(member, time)";

/// A script with a function `place(member, time)`, which gives where a member of a swarm is about the middle
/// of it, as `[x, y, z]` in metres. It runs in the sandbox of procedures, and keeps nothing from call to call: it is a
/// function of the member, counted from 0, and of the time in seconds. `random()` gives each member numbers of
/// its own, at every time the same.
#[derive(Clone)]
pub struct Flight {
    script: Arc<Script>,
    random: Random,
}

impl Flight {
    /// Reads a script and tries it. All that is random in it follows from `random`.
    ///
    /// # Errors
    /// A file that cannot be read; a script that is wrong, breaks a limit or has no function `place`.
    pub fn open(file: impl AsRef<Path>, random: Random) -> Result<Self> {
        let script = Script::open(file.as_ref(), random, |_| {})?;
        if !script.has("place", 2) {
            let what = "the script says nowhere where the members are";
            return Err(Error::new(what).help(format!("write `{USAGE}`")).in_file(script.file()));
        }
        let flight = Self { script: Arc::new(script), random };
        flight.position_m(0, 0.0)?;
        Ok(flight)
    }

    /// Where a member is about the middle at a time, in metres.
    ///
    /// # Errors
    /// A script that fails, breaks a limit or gives something else than three numbers.
    pub fn position_m(&self, member: usize, time_s: f64) -> Result<[f64; 3]> {
        let random = Random::new(self.random.bits(member as u64), 0);
        let placed = self.script.call("place", (member as i64, time_s), random, time_s)?;
        let wrong = || {
            let error = Error::new(format!("`place` gives {}, not three numbers", placed.type_name()));
            self.script.placed("place", error).help("end it with `[x, y, z]`, in metres")
        };
        let list = placed.as_array_ref().map_err(|_| wrong())?;
        let [x, y, z] = list.as_slice() else { return Err(wrong()) };
        let number = |value: &Dynamic| numbers::number(value).map_err(|_| wrong());
        Ok([number(x)?, number(y)?, number(z)?])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn open(source: &str) -> Result<Flight> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("flight.rhai");
        std::fs::write(&file, source).unwrap();
        Flight::open(&file, Random::new(5, 6))
    }

    #[test]
    fn members_are_where_the_script_says_in_any_order() {
        let flight =
            open("const R = 2.0;\nfn place(m, t) { let p = TAU * random(); [R * sin(t + p), m, time] }")
                .unwrap();
        let at = |member, time| flight.position_m(member, time).unwrap();
        let (first, later) = (at(0, 1.0), at(0, 1.5));
        assert_eq!(at(0, 1.0), first, "a function of time");
        assert_eq!((first[1], at(3, 1.0)[1], later[2]), (0.0, 3.0, 1.5));
        assert_ne!(first[0], at(1, 1.0)[0], "members differ");
        let phase = (first[0] / 2.0).asin();
        let phases = [phase - 1.0, std::f64::consts::PI - phase - 1.0];
        assert!(phases.iter().any(|p| (2.0 * (1.5 + p).sin() - later[0]).abs() < 1e-9));
    }

    #[test]
    fn faults_name_their_line() {
        for (source, expected) in [
            ("fn where(m, t) { [0, 0, 0] }", "where the members are (write `fn place(member, time)`)"),
            ("fn place(m, t) {\n  [0, sine2(t), 0]\n}", "flight.rhai:2:"),
            ("fn place(m, t) { loop { } }", "the script is stopped"),
            ("\nfn place(m, t) { [1, 2] }", "flight.rhai:2:"),
            ("fn place(m, t) { 1.0 / 0.0 }", "not three numbers"),
        ] {
            let error = open(source).map(|_| ()).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
    }
}
