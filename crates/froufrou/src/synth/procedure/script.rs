//! A script that is called function by function and keeps nothing from call to call.

use std::path::{Path, PathBuf};

use rhai::{CallFnOptions, Dynamic, Engine, FuncArgs, Scope};

use super::host::{self, Host, Waves};
pub(crate) use super::host::{Told, wrong};
pub(crate) use super::numbers::number;
use super::{fault, language, limits};
use crate::random::Random;
use crate::{Error, Result};

/// A script in the sandbox of procedures.
pub(crate) struct Script {
    file: PathBuf,
    engine: Engine,
    ast: rhai::AST,
    constants: Vec<(String, Dynamic)>,
}

impl Script {
    /// Reads a script and runs its top. `teach` gives the language further words; all that is random at the top follows
    /// from `random`.
    ///
    /// # Errors
    /// A file that cannot be read; a script that is wrong or breaks a limit.
    pub(crate) fn open(file: &Path, random: Random, teach: impl FnOnce(&mut Engine)) -> Result<Self> {
        let source = super::read_source(file)?;
        let inside = |error: Error| error.in_file(file);
        let mut engine = language::engine();
        teach(&mut engine);
        let ast = language::compile(&engine, &source).map_err(inside)?;
        let mut scope = Scope::new();
        limits::begin(limits::TOP_OPERATIONS, 0);
        let host = Host::new(&[], 1.0, random, Waves::default());
        let (_, run) = host::lend(host, || engine.run_ast_with_scope(&mut scope, &ast));
        run.map_err(|error| inside(fault::of_running(*error)))?;
        let constants = scope.iter().filter(|(_, constant, _)| *constant);
        let constants = constants.map(|(name, _, value)| (name.to_owned(), value)).collect();
        Ok(Self { file: file.to_owned(), engine, ast, constants })
    }

    /// Whether it has a function of a name with so many arguments.
    pub(crate) fn has(&self, name: &str, arguments: usize) -> bool {
        self.ast.iter_functions().any(|known| known.name == name && known.params.len() == arguments)
    }

    /// The names of its functions.
    pub(crate) fn functions(&self) -> impl Iterator<Item = &str> {
        self.ast.iter_functions().map(|function| function.name)
    }

    /// Calls a function at a time in seconds; what it draws at random follows from `random`.
    ///
    /// # Errors
    /// A script that fails or breaks a limit.
    pub(crate) fn call(
        &self,
        name: &str,
        arguments: impl FuncArgs,
        random: Random,
        time_s: f64,
    ) -> Result<Dynamic> {
        // At one sample a second the time of the call is its sample.
        let mut host = Host::new(&[], 1.0, random, Waves::default());
        host.building = false;
        host.at_samples = time_s;
        host.constants.clone_from(&self.constants);
        limits::begin(limits::CALL_OPERATIONS, 0);
        let options = CallFnOptions::new().eval_ast(false);
        let (_, result) = host::lend(host, || {
            self.engine.call_fn_with_options::<Dynamic>(
                options,
                &mut Scope::new(),
                &self.ast,
                name,
                arguments,
            )
        });
        // What breaks a limit is told without its place.
        result.map_err(|error| self.placed(name, fault::of_running(*error)))
    }

    /// A fault of a function, in its file and, where it has no place of its own, at its line.
    pub(crate) fn placed(&self, name: &str, error: Error) -> Error {
        let error = match language::line_of(&self.ast, name) {
            Some(place) => error.at(place),
            None => error,
        };
        error.in_file(&self.file)
    }

    /// The file.
    pub(crate) fn file(&self) -> &Path {
        &self.file
    }
}
