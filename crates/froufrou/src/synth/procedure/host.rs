//! What a running script reaches of its voice.
//!
//! The engine and the compiled script are shared by all voices. A voice lends its host to the thread
//! while it is in a call, and the functions of the language find it there.

use std::cell::RefCell;
use std::sync::{Arc, Mutex, PoisonError};

use rhai::{Dynamic, EvalAltResult, Position};

use super::graph::{Graph, Plug};
use super::limits;
use super::unit::{Event, Kind};
use super::wave::Wave;
use crate::random::Random;
use crate::synth::instrument::Ramp;

/// A unit, as a script holds it.
#[derive(Debug, Clone, Copy)]
pub(super) struct UnitHandle(pub usize);

/// A buffer, as a script holds it.
#[derive(Debug, Clone, Copy)]
pub(super) struct BufferHandle(pub usize);

/// A parameter that a script declares.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Parameter {
    pub name: String,
    pub default: f64,
    pub least: f64,
    pub most: f64,
    /// Its value in the call that runs.
    pub value: f64,
}

/// What the functions of the language give: a value, or what is wrong.
pub(crate) type Told<T> = Result<T, Box<EvalAltResult>>;

/// A fault that the engine completes with the place of the call.
pub(crate) fn wrong<T>(what: impl Into<String>) -> Told<T> {
    let what: String = what.into();
    Err(EvalAltResult::ErrorRuntime(what.into(), Position::NONE).into())
}

#[derive(Debug)]
pub(super) struct Host {
    pub graph: Graph,
    pub parameters: Vec<Parameter>,
    /// What functions see of the top of the script, wherever they are called: constants and handles.
    pub constants: Vec<(String, Dynamic)>,
    pub buffers: Vec<Vec<f64>>,
    /// The moment of the call that runs, in samples since the thread began.
    pub at_samples: f64,
    pub rate_hz: f64,
    /// Is the top of the script running?
    pub building: bool,
    pub ring_s: Option<f64>,
    pub printed: Vec<String>,
    /// Parameters as the user gives them.
    given: Vec<(String, f64)>,
    random: Random,
    drawn: u64,
    delays_s: f64,
    waves: Waves,
}

/// The waves that the voices of one script have made, for all of them. A script with ever new waves has as
/// many of its own as it has units.
#[derive(Debug, Clone, Default)]
pub(super) struct Waves(Arc<Mutex<Vec<Known>>>);

/// The bits of a wave's amplitudes, and the wave.
type Known = (Vec<u64>, Arc<Wave>);

impl Waves {
    fn get(&self, harmonics: &[f64]) -> Arc<Wave> {
        let key: Vec<u64> = harmonics.iter().map(|amplitude| amplitude.to_bits()).collect();
        let mut waves = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, wave)) = waves.iter().find(|(known, _)| *known == key) {
            return wave.clone();
        }
        let wave = Arc::new(Wave::new(harmonics));
        if waves.len() < limits::SHARED_WAVES {
            waves.push((key, wave.clone()));
        }
        wave
    }
}

thread_local! {
    static HOST: RefCell<Option<Box<Host>>> = const { RefCell::new(None) };
}

/// Runs a call with a host lent to this thread.
pub(super) fn lend<T>(host: Box<Host>, call: impl FnOnce() -> T) -> (Option<Box<Host>>, T) {
    HOST.replace(Some(host));
    let result = call();
    (HOST.take(), result)
}

/// Reaches the host of the call that runs.
pub(super) fn with<T>(reach: impl FnOnce(&mut Host) -> Told<T>) -> Told<T> {
    HOST.with_borrow_mut(|host| match host {
        Some(host) => reach(host),
        None => wrong("there is no voice to speak of"),
    })
}

impl Host {
    pub(super) fn new(given: &[(String, f64)], rate_hz: f64, random: Random, waves: Waves) -> Box<Self> {
        Box::new(Self {
            graph: Graph::default(),
            parameters: Vec::new(),
            constants: Vec::new(),
            buffers: Vec::new(),
            at_samples: 0.0,
            rate_hz,
            building: true,
            ring_s: None,
            printed: Vec::new(),
            given: given.to_vec(),
            random,
            drawn: 0,
            delays_s: 0.0,
            waves,
        })
    }

    /// The value of a name that the script does not define itself.
    pub(super) fn named(&self, name: &str) -> Option<Dynamic> {
        match name {
            "time" => return Some((self.at_samples / self.rate_hz).into()),
            "sample_rate" => return Some(self.rate_hz.into()),
            "PI" => return Some(std::f64::consts::PI.into()),
            "TAU" => return Some(std::f64::consts::TAU.into()),
            _ => (),
        }
        if let Some(parameter) = self.parameters.iter().find(|parameter| parameter.name == name) {
            return Some(parameter.value.into());
        }
        self.constants.iter().find(|(known, _)| known == name).map(|(_, value)| value.clone())
    }

    /// Only the top of a script makes things.
    pub(super) fn building(&self) -> Told<()> {
        if self.building {
            Ok(())
        } else {
            wrong("units are made at the top of the script, not in its functions")
        }
    }

    pub(super) fn declare(&mut self, name: &str, default: f64, least: f64, most: f64) -> Told<()> {
        if !self.building {
            return wrong("parameters are declared at the top of the script");
        }
        if !rhai::is_valid_identifier(name) || self.named(name).is_some() {
            return wrong(format!("a parameter cannot be called `{name}`"));
        }
        if self.parameters.len() == limits::PARAMETERS {
            return wrong(format!("more than {} parameters", limits::PARAMETERS));
        }
        if !(least..=most).contains(&default) {
            return wrong(format!("`{name}` is {default}, not from {least} to {most}"));
        }
        let given = self.given.iter().find(|(given, _)| given == name).map(|&(_, value)| value);
        let value = given.unwrap_or(default);
        if !(least..=most).contains(&value) {
            return wrong(format!("`{name}` is set to {value}, not from {least} to {most}"));
        }
        self.parameters.push(Parameter { name: name.to_owned(), default: value, least, most, value });
        Ok(())
    }

    /// Sets the parameters to what the controls are at a part of their stretch.
    pub(super) fn follow(&mut self, controls: &[Ramp], part: f64) {
        for (parameter, ramp) in self.parameters.iter_mut().zip(controls) {
            parameter.value = ramp.from + (ramp.to - ramp.from) * part;
        }
    }

    /// The next random number from 0 to 1.
    pub(super) fn draw(&mut self) -> f64 {
        self.drawn += 1;
        self.random.uniform(self.drawn)
    }

    /// Random numbers of a unit's own.
    pub(super) fn unit_random(&self) -> Random {
        // The script's own numbers count up from 1; a unit's key comes from the other end.
        Random::new(self.random.bits(u64::MAX - self.graph.len() as u64), 1)
    }

    pub(super) fn unit(&mut self, kind: Kind, plugs: &[Plug], position: Position) -> Told<UnitHandle> {
        self.building()?;
        let spot = (position.line().unwrap_or(0), position.position().unwrap_or(0));
        self.graph.add(kind, plugs, spot).map(UnitHandle).or_else(wrong)
    }

    pub(super) fn delay(
        &mut self,
        input: Plug,
        seconds: Plug,
        longest_s: f64,
        position: Position,
    ) -> Told<UnitHandle> {
        if !(0.0..=limits::DELAYS_S).contains(&longest_s) || self.delays_s + longest_s > limits::DELAYS_S {
            return wrong(format!("all delays together are longer than {} s", limits::DELAYS_S));
        }
        self.delays_s += longest_s;
        let kind = Kind::delay(longest_s * self.rate_hz);
        self.unit(kind, &[input, seconds, Plug::Number(0.0)], position)
    }

    pub(super) fn wave(&self, harmonics: &[f64]) -> Arc<Wave> {
        self.waves.get(harmonics)
    }

    pub(super) fn buffer(&mut self, length: i64) -> Told<BufferHandle> {
        self.building()?;
        let held: usize = self.buffers.iter().map(Vec::len).sum();
        let length = usize::try_from(length).unwrap_or(0);
        if length == 0 || length > limits::BUFFERS - held || self.buffers.len() == limits::UNITS {
            return wrong(format!(
                "a buffer holds at least 1 number, and all together at most {}",
                limits::BUFFERS
            ));
        }
        self.buffers.push(vec![0.0; length]);
        Ok(BufferHandle(self.buffers.len() - 1))
    }

    pub(super) fn happen(&mut self, unit: UnitHandle, event: Event) -> Told<()> {
        self.graph.happen(unit.0, self.at_samples, event).or_else(wrong)
    }

    pub(super) fn print(&mut self, line: &str) {
        if self.printed.len() < limits::PRINTED {
            self.printed.push(line.to_owned());
        }
    }
}
