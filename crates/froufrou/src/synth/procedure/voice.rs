//! One thread's voice of a procedure.

use std::sync::Arc;

use rhai::{CallFnOptions, Dynamic, FuncArgs, Scope};

use super::Program;
use super::graph::{Given, Spot};
use super::host::{self, BufferHandle, Host, UnitHandle};
use super::{fault, language, limits, numbers};
use crate::random::Random;
use crate::synth::instrument::{Generator, Ramp, Stretch, stretch_samples};
use crate::{Error, Place, Result};

pub(super) struct Voice {
    program: Arc<Program>,
    scope: Scope<'static>,
    /// Away only while a call runs.
    host: Option<Box<Host>>,
    purse: limits::Purse,
    begun: bool,
    controls: Vec<Ramp>,
    sampled: Vec<f64>,
}

impl Voice {
    /// Runs the top of a script.
    pub(super) fn new(program: Arc<Program>, rate_hz: f64, random: Random) -> Result<Self> {
        let host = Host::new(&program.given, rate_hz, random, program.waves.clone());
        let mut scope = Scope::new();
        limits::begin(limits::TOP_OPERATIONS, 0);
        let (host, result) = host::lend(host, || program.engine.run_ast_with_scope(&mut scope, &program.ast));
        let inside = |error: Error| error.in_file(&program.file);
        result.map_err(|error| inside(fault::of_running(*error)))?;
        let mut host = host.ok_or_else(|| inside(Error::new("the script is lost")))?;
        host.building = false;
        if let Some((name, _)) =
            program.given.iter().find(|(name, _)| !host.parameters.iter().any(|known| known.name == *name))
        {
            let known: Vec<&str> = host.parameters.iter().map(|known| known.name.as_str()).collect();
            let error = Error::new(format!("there is no parameter `{name}`")).at(Place::Part(name.clone()));
            return Err(inside(match known.as_slice() {
                [] => error.help("the script declares none"),
                known => error.help(format!("there are {}", known.join(", "))),
            }));
        }
        if !host.graph.is_played() && !program.has_sample {
            return Err(inside(Error::new("nothing is played").help("write `play(unit)` or `fn sample()`")));
        }
        if host.graph.takes_samples() && !program.has_sample {
            return Err(inside(Error::new("`sampled()` is used, but there is no `fn sample()`")));
        }
        host.graph.finish(stretch_samples(rate_hz)).map_err(|spot| {
            inside(
                at_spot(Error::new("units are plugged into each other in a circle"), spot)
                    .help("only a delay's feedback goes round"),
            )
        })?;
        for (name, constant, value) in scope.iter() {
            if constant || value.is::<UnitHandle>() || value.is::<BufferHandle>() {
                host.constants.push((name.to_owned(), value));
            }
        }
        let controls = vec![Ramp::still(0.0); host.parameters.len()];
        let sampled = vec![0.0; if program.has_sample { stretch_samples(rate_hz) } else { 0 }];
        Ok(Self {
            program,
            scope,
            host: Some(host),
            purse: limits::Purse::new(),
            begun: false,
            controls,
            sampled,
        })
    }

    /// What the script reached while it ran.
    pub(super) fn host(&self) -> Option<&Host> {
        self.host.as_deref()
    }

    /// Calls a function of the script at a moment, in samples, which is a part of the stretch.
    fn call(&mut self, name: &str, arguments: impl FuncArgs, at_samples: f64, part: f64) -> Result<Dynamic> {
        let Some(mut host) = self.host.take() else {
            return Err(Error::new("a voice that failed is asked for more").in_file(&self.program.file));
        };
        host.at_samples = at_samples;
        host.follow(&self.controls, part);
        let rate_hz = host.rate_hz;
        let most = self.purse.begin_call();
        let options = CallFnOptions::new().eval_ast(false);
        let (program, scope) = (&self.program, &mut self.scope);
        let (host, result) = host::lend(host, || {
            program.engine.call_fn_with_options::<Dynamic>(options, scope, &program.ast, name, arguments)
        });
        self.host = host;
        let used = self.purse.end_call();
        result.map_err(|error| {
            let stopped = used > most && most < limits::CALL_OPERATIONS;
            let mut error = fault::of_running(*error);
            if stopped {
                let second = limits::per_second(rate_hz);
                let what = format!("the script is stopped: it takes more than {second} operations a second");
                error = Error::new(what).help(fault::LIMITS);
            }
            // What breaks a limit is told without its place: it is then at least in this function.
            if let Some(place) = language::line_of(&self.program.ast, name) {
                error = error.at(place);
            }
            error.in_file(&self.program.file)
        })
    }

    /// Calls `fn control`, whatever it gives.
    fn control(&mut self, at_samples: f64, part: f64) -> Result<()> {
        self.call("control", (), at_samples, part).map(drop)
    }

    /// Calls `fn sample` and takes the number it gives.
    fn sample(&mut self, first: u64, index: usize, count: usize) -> Result<f64> {
        let number = self.call("sample", (), (first + index as u64) as f64, index as f64 / count as f64)?;
        numbers::number(&number).map_err(|_| {
            let what = if number.is_float() {
                format!("`fn sample` gives {} at sample {}", number, first + index as u64)
            } else {
                format!("`fn sample` gives {}, not a number", number.type_name())
            };
            let error = Error::new(what).in_file(&self.program.file);
            match language::line_of(&self.program.ast, "sample") {
                Some(place) => error.at(place),
                None => error,
            }
        })
    }
}

fn at_spot(error: Error, (line, column): Spot) -> Error {
    if line == 0 { error } else { error.at(Place::Line { line, column }) }
}

impl Generator for Voice {
    fn generate(&mut self, stretch: &Stretch<'_>, out: &mut [f32]) -> Result<()> {
        let (first, count, rate_hz) = (stretch.first, out.len(), stretch.rate_hz);
        let program = self.program.clone();
        let bounds = self.host.as_ref().map_or(&[][..], |host| &host.parameters);
        if stretch.controls.len() != bounds.len() {
            let what = format!("{} controls, not {}", stretch.controls.len(), bounds.len());
            return Err(Error::new(what).in_file(&program.file));
        }
        for ((ramp, given), bound) in self.controls.iter_mut().zip(stretch.controls).zip(bounds) {
            let within = |value: f64| {
                // What is no number changes nothing.
                if value.is_nan() { bound.default } else { value.clamp(bound.least, bound.most) }
            };
            *ramp = Ramp { from: within(given.from), to: within(given.to) };
        }
        self.purse.earn(count);
        if !self.begun {
            self.begun = true;
            if program.has_control {
                self.control(first as f64, 0.0)?;
            }
        }
        if let Some(host) = &mut self.host {
            host.graph.begin_stretch();
        }
        // The calls come in the order of their times: strikes and samples, and at the end the control.
        let mut strikes = stretch.strikes.iter().peekable();
        let mut strike_before = |voice: &mut Self, end: f64| -> Result<()> {
            while let Some(strike) = strikes.next_if(|strike| strike.time_s * rate_hz <= end) {
                if program.has_strike {
                    let at = strike.time_s * rate_hz;
                    let part = ((at - first as f64) / count as f64).clamp(0.0, 1.0);
                    let arguments = (strike.impulse_ns, strike.place, strike.contact_s);
                    voice.call("strike", arguments, at, part).map(drop)?;
                }
            }
            Ok(())
        };
        if program.has_sample {
            for index in 0..count {
                strike_before(self, (first + index as u64) as f64)?;
                self.sampled[index] = self.sample(first, index, count)?;
            }
        }
        strike_before(self, f64::INFINITY)?;
        if program.has_control {
            self.control((first + count as u64) as f64, 1.0)?;
        }
        let Some(host) = &mut self.host else {
            return Err(Error::new("a voice that failed is asked for more").in_file(&program.file));
        };
        let sampled = if program.has_sample { &self.sampled[..count] } else { &[] };
        let given = Given { first, rate_hz, controls: &self.controls, sampled };
        host.graph.run(&given, out).map_err(|unheard| {
            let sample = first + unheard.sample as u64;
            let what = format!("{} at sample {sample}, {:.6} s", unheard.what, sample as f64 / rate_hz);
            at_spot(Error::new(what), unheard.spot).in_file(&program.file)
        })
    }
}
