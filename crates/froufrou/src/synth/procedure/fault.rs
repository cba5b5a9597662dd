//! What went wrong in a script, as the user is told it.

use rhai::{EvalAltResult, Position};

use super::words;
use crate::{Error, Place};

/// What helps when a script breaks a limit.
pub(super) const LIMITS: &str = "docs/procedures.md lists the limits";

/// A position in a script as the place of an error.
pub(super) fn place(position: Position) -> Option<Place> {
    let line = position.line()?;
    Some(Place::Line { line, column: position.position().unwrap_or(0) })
}

/// A fault of a script while it is read.
pub(super) fn of_reading(error: &rhai::ParseError) -> Error {
    let mut fault = Error::new(error.err_type().to_string());
    if let Some(place) = place(error.position()) {
        fault = fault.at(place);
    }
    fault
}

/// A fault of a script while it runs. The innermost function is the one at fault.
pub(super) fn of_running(mut error: EvalAltResult) -> Error {
    let mut outer = Position::NONE;
    while let EvalAltResult::ErrorInFunctionCall(_, _, inner, position) = error {
        outer = position;
        error = *inner;
    }
    let inner = error.take_position();
    let position = if inner.is_none() { outer } else { inner };
    let (what, help) = told(&error);
    let mut fault = Error::new(what);
    if let Some(place) = place(position) {
        fault = fault.at(place);
    }
    match help {
        Some(help) => fault.help(help),
        None => fault,
    }
}

fn told(error: &EvalAltResult) -> (String, Option<String>) {
    match error {
        EvalAltResult::ErrorTerminated(reason, _) => {
            (format!("the script is stopped: {reason}"), Some(LIMITS.to_owned()))
        }
        EvalAltResult::ErrorRuntime(thrown, _) => (thrown.to_string(), None),
        EvalAltResult::ErrorFunctionNotFound(signature, _) => {
            let name = signature.split([' ', '(']).next().unwrap_or_default();
            let help = if words::is_known(name) {
                Some(format!("`{name}` is used in another way: {}", words::usage(name)))
            } else {
                words::nearest(name).map(|word| format!("did you mean `{word}`?"))
            };
            (format!("there is no function {signature}"), help)
        }
        EvalAltResult::ErrorVariableNotFound(name, _) => {
            let help = "a function that the script itself calls sees its arguments, and of the top of the \
                        script only constants, units, buffers and parameters";
            (format!("there is no variable `{name}`"), Some(help.to_owned()))
        }
        EvalAltResult::ErrorDataTooLarge(what, _) => {
            (format!("the script is stopped: {} is too large", what.to_lowercase()), Some(LIMITS.to_owned()))
        }
        EvalAltResult::ErrorTooManyVariables(_) => {
            (format!("more than {} variables", super::limits::VARIABLES), Some(LIMITS.to_owned()))
        }
        EvalAltResult::ErrorStackOverflow(_) => {
            (format!("functions call each other more than {} deep", super::limits::CALL_DEPTH), None)
        }
        other => (other.to_string(), None),
    }
}
