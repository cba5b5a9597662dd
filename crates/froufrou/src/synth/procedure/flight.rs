//! Scripts that say where the members of a swarm are.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use rhai::{CallFnOptions, Dynamic, Scope};

use super::host::{self, Host, Waves};
use super::{fault, language, limits, numbers};
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
    program: Arc<Program>,
    random: Random,
}

struct Program {
    file: PathBuf,
    engine: rhai::Engine,
    ast: rhai::AST,
    constants: Vec<(String, Dynamic)>,
}

impl Flight {
    /// Reads a script and tries it. All that is random in it follows from `random`.
    ///
    /// # Errors
    /// A file that cannot be read; a script that is wrong, breaks a limit or has no function `place`.
    pub fn open(file: impl AsRef<Path>, random: Random) -> Result<Self> {
        let file = file.as_ref();
        let source = super::read_source(file)?;
        let inside = |error: Error| error.in_file(file);
        let engine = language::engine();
        let ast = language::compile(&engine, &source).map_err(inside)?;
        let fits =
            |function: rhai::ScriptFnMetadata<'_>| function.name == "place" && function.params.len() == 2;
        if !ast.iter_functions().any(fits) {
            return Err(inside(
                Error::new("the script says nowhere where the members are").help(format!("write `{USAGE}`")),
            ));
        }
        let mut scope = Scope::new();
        limits::begin(limits::TOP_OPERATIONS, 0);
        let host = Host::new(&[], 1.0, random, Waves::default());
        let (_, run) = host::lend(host, || engine.run_ast_with_scope(&mut scope, &ast));
        run.map_err(|error| inside(fault::of_running(*error)))?;
        let constants = scope.iter().filter(|(_, constant, _)| *constant);
        let constants = constants.map(|(name, _, value)| (name.to_owned(), value)).collect();
        let flight =
            Self { program: Arc::new(Program { file: file.to_owned(), engine, ast, constants }), random };
        flight.position_m(0, 0.0)?;
        Ok(flight)
    }

    /// Where a member is about the middle at a time, in metres.
    ///
    /// # Errors
    /// A script that fails, breaks a limit or gives something else than three numbers.
    pub fn position_m(&self, member: usize, time_s: f64) -> Result<[f64; 3]> {
        let Program { file, engine, ast, constants } = self.program.as_ref();
        // At one sample a second the time of the call is its sample.
        let mut host = Host::new(&[], 1.0, Random::new(self.random.bits(member as u64), 0), Waves::default());
        host.building = false;
        host.at_samples = time_s;
        host.constants.clone_from(constants);
        limits::begin(limits::CALL_OPERATIONS, 0);
        let options = CallFnOptions::new().eval_ast(false);
        let arguments = (member as i64, time_s);
        let (_, placed) = host::lend(host, || {
            engine.call_fn_with_options::<Dynamic>(options, &mut Scope::new(), ast, "place", arguments)
        });
        let placed = placed.map_err(|error| {
            let error = fault::of_running(*error);
            // What breaks a limit is told without its place.
            let error = match language::line_of(ast, "place") {
                Some(place) => error.at(place),
                None => error,
            };
            error.in_file(file)
        })?;
        let wrong = || {
            let error = Error::new(format!("`place` gives {}, not three numbers", placed.type_name()));
            let error = match language::line_of(ast, "place") {
                Some(place) => error.at(place),
                None => error,
            };
            error.in_file(file).help("end it with `[x, y, z]`, in metres")
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
