//! Procedures: sounds that a sound designer writes as a script.
//!
//! A script plugs unit generators together (oscillators, noise, filters, resonators, envelopes) and
//! moves their parameters 500 times a second, or makes every sample itself. It runs in a sandbox and is
//! held to limits. `docs/procedures.md` is the language's reference.
//!
//! ```
//! use froufrou::random::Random;
//! use froufrou::synth::instrument::{Instrument, Ramp, Stretch};
//! use froufrou::synth::procedure::Procedure;
//!
//! let script = r#"
//!     param("pitch", 700.0);
//!     let tone = sine(pitch);
//!     play(tone);
//!     fn control() { tone.frequency = pitch; }
//! "#;
//! let procedure = Procedure::new("tone.rhai", script, &[("pitch".to_owned(), 500.0)])?;
//! let mut voice = procedure.generator(48_000.0, Random::new(7, 1))?;
//! let mut samples = [0.0; 96];
//! let stretch = Stretch { first: 0, rate_hz: 48_000.0, controls: &[Ramp::still(500.0)], strikes: &[], grains: &[] };
//! voice.generate(&stretch, &mut samples)?;
//! # Ok::<(), froufrou::Error>(())
//! ```

mod fault;
mod flight;
mod graph;
mod host;
mod language;
mod limits;
mod numbers;
pub(crate) mod script;
mod unit;
mod voice;
mod wave;
mod words;

#[cfg(test)]
mod tests;

pub use self::flight::Flight;

use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::random::Random;
use crate::synth::instrument::{Control, Generator, Instrument, Ramp, Stretch, Strike, stretch_samples};
use crate::{Error, Result};

/// The rates that a script can be played at, in hertz.
const RATES_HZ: std::ops::RangeInclusive<f64> = 1000.0..=768_000.0;

/// The rate at which a script is tried when it is opened.
const TRIAL_HZ: f64 = 48_000.0;

/// A script that has been read, which all its voices share.
struct Program {
    file: PathBuf,
    engine: rhai::Engine,
    ast: rhai::AST,
    given: Vec<(String, f64)>,
    waves: host::Waves,
    has_control: bool,
    has_sample: bool,
    has_strike: bool,
}

/// Reads the text of a script.
fn read_source(file: &Path) -> Result<String> {
    let mut source = Vec::new();
    std::fs::File::open(file)
        .map_err(|error| Error::io("open", file, error))?
        .take(limits::SOURCE_BYTES + 1)
        .read_to_end(&mut source)
        .map_err(|error| Error::io("read", file, error))?;
    check_length(source.len() as u64).map_err(|error| error.in_file(file))?;
    String::from_utf8(source).map_err(|error| {
        let at = crate::Place::Byte(error.utf8_error().valid_up_to() as u64);
        Error::new("a script is UTF-8 text; here it is not").in_file(file).at(at)
    })
}

fn check_length(bytes: u64) -> Result<()> {
    if bytes <= limits::SOURCE_BYTES {
        return Ok(());
    }
    Err(Error::new(format!("a script is at most {} bytes long", limits::SOURCE_BYTES)))
}

/// A sound made by a script.
pub struct Procedure {
    program: Arc<Program>,
    controls: Vec<Control>,
    ring_s: Option<f64>,
    printed: Vec<String>,
}

impl std::fmt::Debug for Procedure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Procedure")
            .field("file", &self.program.file)
            .field("controls", &self.controls)
            .finish()
    }
}

impl Procedure {
    /// Reads a script from a file, with parameters as the user gives them, and tries it.
    ///
    /// # Errors
    /// A file that cannot be read, and what [`Procedure::new`] refuses.
    pub fn open(file: impl AsRef<Path>, given: &[(String, f64)]) -> Result<Self> {
        let file = file.as_ref();
        Self::new(file, &read_source(file)?, given)
    }

    /// Reads a script from text. `file` is its name in messages; `given` are the initial values of its
    /// parameters. To find faults early, two stretches of it are made, with a strike if it takes any.
    ///
    /// # Errors
    /// A script that is too long, wrong, breaks a limit or plays nothing, and parameters that it does
    /// not have or allow.
    pub fn new(file: impl Into<PathBuf>, source: &str, given: &[(String, f64)]) -> Result<Self> {
        let file = file.into();
        let inside = |error: Error| error.in_file(&file);
        check_length(source.len() as u64).map_err(inside)?;
        for (index, (name, _)) in given.iter().enumerate() {
            if given[..index].iter().any(|(before, _)| before == name) {
                let fault = Error::new(format!("`{name}` is given twice"));
                return Err(inside(fault.at(crate::Place::Part(name.clone()))));
            }
        }
        let engine = language::engine();
        let ast = language::compile(&engine, source).map_err(inside)?;
        let has = |name| language::has(&ast, name);
        let (has_control, has_sample, has_strike) = (has("control"), has("sample"), has("strike"));
        let (given, waves) = (given.to_vec(), host::Waves::default());
        let program = Program { file, engine, ast, given, waves, has_control, has_sample, has_strike };
        Self::try_out(Arc::new(program))
    }

    /// Plays two stretches of a script.
    fn try_out(program: Arc<Program>) -> Result<Self> {
        let mut voice = voice::Voice::new(program.clone(), TRIAL_HZ, Random::new(0, 0))?;
        let (parameters, ring_s) =
            voice.host().map(|host| (host.parameters.clone(), host.ring_s)).unwrap_or_default();
        let controls: Vec<Control> = parameters
            .into_iter()
            .map(|parameter| Control { name: parameter.name, default: parameter.default })
            .collect();
        let ramps: Vec<Ramp> = controls.iter().map(|control| Ramp::still(control.default)).collect();
        let samples = stretch_samples(TRIAL_HZ);
        let strikes = [Strike { time_s: 1e-4, impulse_ns: 1.0, place: 0.3, contact_s: 1e-3 }];
        for number in 0..2 {
            let strikes = if number == 0 { &strikes[..] } else { &[] };
            let first = number * samples as u64;
            let stretch = Stretch { first, rate_hz: TRIAL_HZ, controls: &ramps, strikes, grains: &[] };
            voice.generate(&stretch, &mut vec![0.0; samples])?;
        }
        let printed = voice.host().map(|host| host.printed.clone()).unwrap_or_default();
        Ok(Self { program, controls, ring_s, printed })
    }

    /// What the script printed while it was tried: its first 100 lines.
    pub fn printed(&self) -> &[String] {
        &self.printed
    }

    /// Does the script take strikes? They are lost on one that does not.
    pub fn takes_strikes(&self) -> bool {
        self.program.has_strike
    }
}

impl Instrument for Procedure {
    fn controls(&self) -> &[Control] {
        &self.controls
    }

    fn ring_s(&self) -> Option<f64> {
        self.ring_s
    }

    fn generator(&self, rate_hz: f64, random: Random) -> Result<Box<dyn Generator>> {
        if !RATES_HZ.contains(&rate_hz) {
            let what = format!("a script cannot sound at {rate_hz} Hz");
            let help = format!("from {:?} to {:?} Hz", RATES_HZ.start(), RATES_HZ.end());
            return Err(Error::new(what).help(help).in_file(&self.program.file));
        }
        Ok(Box::new(voice::Voice::new(self.program.clone(), rate_hz, random)?))
    }
}
