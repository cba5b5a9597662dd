//! What a script may take: time, memory, depth. Every script is held to the same limits, which no
//! ordinary one meets (`docs/procedures.md` lists them).

use std::cell::Cell;
use std::time::{Duration, Instant};

use rhai::{Dynamic, EvalAltResult, Position, Scope};

/// Longest script, in bytes.
pub(super) const SOURCE_BYTES: u64 = 64 << 10;
/// Most operations of what stands at the top of a script.
pub(super) const TOP_OPERATIONS: u64 = 500_000;
/// Most operations of one call of a function.
pub(super) const CALL_OPERATIONS: u64 = 100_000;
/// Operations that each stretch may take on average…
pub(super) const STRETCH_OPERATIONS: u64 = 10_000;
/// …and for each of its samples beside that.
pub(super) const SAMPLE_OPERATIONS: u64 = 300;
/// Operations that may be saved up for a busy moment.
pub(super) const SAVED_OPERATIONS: u64 = 1_000_000;
/// Longest that one call may take by the clock. An operation takes some 50 ns, so only a script that
/// does heavy things again and again can come here before it has spent its operations.
pub(super) const CALL_TIME: Duration = Duration::from_millis(800);
/// How many operations go by between two looks at the clock.
const CLOCK_EVERY: u64 = 32;

/// Deepest calls of functions within functions.
pub(super) const CALL_DEPTH: usize = 12;
/// Deepest nesting of expressions and blocks.
pub(super) const EXPRESSION_DEPTH: usize = 32;
/// Most arguments of a call.
pub(super) const ARGUMENTS: usize = 8;
/// Most functions of a script.
pub(super) const FUNCTIONS: usize = 64;
/// Most variables at one time.
pub(super) const VARIABLES: usize = 64;
/// Most numbers in an array, with all that is in it.
pub(super) const ARRAY: usize = 1024;
/// Most values in all variables that a function sees at one time. An array within an array is not held
/// to the limit of the outer one when it is put there by its index, so this is.
pub(super) const VALUES: usize = 1 << 14;
/// So many values cost nothing. Each beyond costs two operations whenever the variables are weighed, as
/// whatever looks at a long list may copy it.
const FREE_VALUES: usize = 256;
/// How many variables are looked at between two times that they are weighed.
const WEIGH_EVERY: u64 = 64;
/// Longest string, in bytes.
pub(super) const STRING: usize = 256;
/// Most parameters.
pub(super) const PARAMETERS: usize = 32;
/// Most unit generators.
pub(super) const UNITS: usize = 256;
/// Most harmonics of a wave.
pub(super) const HARMONICS: usize = 256;
/// Waves that the voices of a script share.
pub(super) const SHARED_WAVES: usize = 64;
/// Seconds of all delays of a script together.
pub(super) const DELAYS_S: f64 = 10.0;
/// Numbers of all buffers of a script together.
pub(super) const BUFFERS: usize = 1 << 18;
/// Most events (hits, lines, envelopes) that wait to be heard.
pub(super) const EVENTS: usize = 4096;
/// Lines of `print` that are kept.
pub(super) const PRINTED: usize = 100;

thread_local! {
    static METER: Meter = const {
        Meter {
            used: Cell::new(0),
            extra: Cell::new(0),
            most: Cell::new(0),
            until: Cell::new(None),
            looks: Cell::new(0),
        }
    };
}

/// Counts what the call that this thread is in has taken.
struct Meter {
    used: Cell<u64>,
    /// Operations charged for copying long lists.
    extra: Cell<u64>,
    most: Cell<u64>,
    until: Cell<Option<Instant>>,
    /// Variables that this voice has looked at, in all its calls.
    looks: Cell<u64>,
}

/// Starts a call that may take so many operations, of a voice that has looked at so many variables.
pub(super) fn begin(most: u64, looks: u64) {
    METER.with(|meter| {
        meter.used.set(0);
        meter.extra.set(0);
        meter.looks.set(looks);
        meter.most.set(most);
        meter.until.set(Some(Instant::now() + CALL_TIME));
    });
}

/// The operations of the last call, and the variables that its voice has looked at by now.
fn used() -> (u64, u64) {
    METER.with(|meter| (meter.used.get(), meter.looks.get()))
}

/// Is asked at every operation, and stops the call with a reason.
pub(super) fn tick(operations: u64) -> Option<Dynamic> {
    METER.with(|meter| {
        let used = operations + meter.extra.get();
        meter.used.set(used);
        if used > meter.most.get() {
            return Some(format!("it takes more than {} operations", meter.most.get()).into());
        }
        let late = || meter.until.get().is_some_and(|until| Instant::now() > until);
        if operations.is_multiple_of(CLOCK_EVERY) && late() {
            return Some(format!("it takes longer than {} s", CALL_TIME.as_secs_f64()).into());
        }
        None
    })
}

/// Is asked whenever a variable is looked at, and stops a call whose variables hold too much.
pub(super) fn weigh(scope: &Scope<'_>) -> Result<(), Box<EvalAltResult>> {
    let looks = METER.with(|meter| {
        meter.looks.set(meter.looks.get() + 1);
        meter.looks.get()
    });
    if !looks.is_multiple_of(WEIGH_EVERY) {
        return Ok(());
    }
    let mut left = VALUES;
    for (_, _, value) in scope.iter_raw() {
        let Some(rest) = left.checked_sub(values(value, left)) else {
            // Not one that a script can catch.
            let reason = format!("its variables hold more than {VALUES} values");
            return Err(EvalAltResult::ErrorTerminated(reason.into(), Position::NONE).into());
        };
        left = rest;
    }
    let charged = ((VALUES - left).saturating_sub(FREE_VALUES) * 2) as u64;
    METER.with(|meter| meter.extra.set(meter.extra.get() + charged));
    Ok(())
}

/// How many values there are in one, as far as it matters: when there are more than enough the rest is
/// not counted.
fn values(value: &Dynamic, enough: usize) -> usize {
    let Ok(array) = value.as_array_ref() else { return 1 };
    let mut count = 1;
    for value in array.iter() {
        if count > enough {
            break;
        }
        count += values(value, enough);
    }
    count
}

/// What a generator has to spend: so much a stretch, some of which may be saved.
#[derive(Debug)]
pub(super) struct Purse {
    operations: u64,
    /// Variables that the voice has looked at.
    looks: u64,
}

impl Purse {
    pub(super) fn new() -> Self {
        Self { operations: SAVED_OPERATIONS, looks: 0 }
    }

    /// What a stretch of so many samples brings.
    pub(super) fn earn(&mut self, samples: usize) {
        let earned = STRETCH_OPERATIONS + SAMPLE_OPERATIONS * samples as u64;
        self.operations = (self.operations + earned).min(SAVED_OPERATIONS);
    }

    /// Starts a call, and gives the operations that it may take.
    pub(super) fn begin_call(&self) -> u64 {
        let most = self.operations.min(CALL_OPERATIONS);
        begin(most, self.looks);
        most
    }

    /// Pays for the call that was started last, and gives the operations that it has taken.
    pub(super) fn end_call(&mut self) -> u64 {
        let (used, looks) = used();
        self.operations = self.operations.saturating_sub(used);
        self.looks = looks;
        used
    }
}

/// What a script may take on average, in operations a second.
pub(super) fn per_second(rate_hz: f64) -> u64 {
    let samples = crate::synth::instrument::stretch_samples(rate_hz);
    let stretch = STRETCH_OPERATIONS + SAMPLE_OPERATIONS * samples as u64;
    (stretch as f64 * rate_hz / samples as f64) as u64
}
