//! The language that scripts are written in, and what is left out of it.

use rhai::packages::{ArithmeticPackage, BasicIteratorPackage, BasicStringPackage, LogicPackage, Package};
use rhai::{AST, ASTNode, Engine, Expr, OptimizationLevel, Position, Stmt};

use super::{host, limits, words};
use crate::{Error, Place, Result};

/// An engine for scripts. It has no files, network, clock, modules, evaluation of text or function
/// pointers, and all that it does is counted.
pub(super) fn engine() -> Engine {
    let mut engine = Engine::new_raw();
    ArithmeticPackage::new().register_into_engine(&mut engine);
    LogicPackage::new().register_into_engine(&mut engine);
    BasicIteratorPackage::new().register_into_engine(&mut engine);
    BasicStringPackage::new().register_into_engine(&mut engine);
    // Function pointers can hold ever more in their arguments, which no limit sees.
    // And maps are not held to any limit when a new key is set.
    for symbol in ["eval", "Fn", "call", "curry", "#{"] {
        engine.disable_symbol(symbol);
    }
    engine.set_optimization_level(OptimizationLevel::Simple);
    engine.set_max_call_levels(limits::CALL_DEPTH);
    engine.set_max_expr_depths(limits::EXPRESSION_DEPTH, limits::EXPRESSION_DEPTH);
    engine.set_max_functions(limits::FUNCTIONS);
    engine.set_max_variables(limits::VARIABLES);
    engine.set_max_array_size(limits::ARRAY);
    engine.set_max_string_size(limits::STRING);
    engine.on_progress(limits::tick);
    engine.on_print(|line| {
        let _ = host::with(|host| {
            host.print(line);
            Ok(())
        });
    });
    engine.on_debug(|line, _, _| {
        let _ = host::with(|host| {
            host.print(line);
            Ok(())
        });
    });
    // The engine marks these two as ones that may change with its next version.
    #[expect(deprecated)]
    engine.on_var(|name, index, context| {
        limits::weigh(context.scope())?;
        // A variable of the function itself has a number, and is not ours.
        if index != 0 { Ok(None) } else { host::with(|host| Ok(host.named(name))) }
    });
    #[expect(deprecated)]
    engine.on_def_var(|running, definition, _| {
        // At the top, a name has one meaning only.
        let name = definition.name();
        Ok(!running || definition.nesting_level() > 0 || !words::NAMES.contains(&name))
    });
    words::register(&mut engine);
    engine
}

/// The functions that a voice calls, and how many arguments each takes.
pub(super) const CALLED: [(&str, usize, &str); 3] = [
    ("control", 0, "fn control()"),
    ("sample", 0, "fn sample()"),
    ("strike", 3, "fn strike(impulse, place, contact)"),
];

/// Reads a script.
pub(super) fn compile(engine: &Engine, source: &str) -> Result<AST> {
    let ast = engine.compile(source).map_err(|error| super::fault::of_reading(&error))?;
    let mut fault = None;
    ast.walk(&mut |path: &[ASTNode]| {
        let (count, position) = match path.last() {
            Some(ASTNode::Expr(Expr::FnCall(call, at) | Expr::MethodCall(call, at))) => {
                (call.args.len(), *at)
            }
            Some(ASTNode::Stmt(Stmt::FnCall(call, at))) => (call.args.len(), *at),
            _ => (0, Position::NONE),
        };
        if count > limits::ARGUMENTS {
            fault =
                Some((format!("a call with {count} arguments, not up to {}", limits::ARGUMENTS), position));
        }
        fault.is_none()
    });
    if let Some((what, position)) = fault {
        let error = Error::new(what);
        return Err(match super::fault::place(position) {
            Some(place) => error.at(place),
            None => error,
        });
    }
    for (name, arguments, usage) in CALLED {
        let wrong = ast.iter_functions().find(|known| known.name == name && known.params.len() != arguments);
        if wrong.is_some() {
            let error =
                Error::new(format!("`{name}` takes {arguments} arguments")).help(format!("write `{usage}`"));
            return Err(match line_of(&ast, name) {
                Some(place) => error.at(place),
                None => error,
            });
        }
    }
    Ok(ast)
}

/// Does a script have a function that a voice calls?
pub(super) fn has(ast: &AST, name: &str) -> bool {
    ast.iter_functions().any(|known| known.name == name)
}

/// Where a function of a script begins.
pub(super) fn line_of(ast: &AST, name: &str) -> Option<Place> {
    let function = ast.iter_fn_def().find(|function| function.name == name)?;
    super::fault::place(function.body.start_position())
}
