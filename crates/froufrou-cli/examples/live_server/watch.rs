//! When a core stands still: for those who take it may be of another machine, which no count of this one tells.

use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant, SystemTime};

use froufrou::{Error, Result};

/// It sleeps for so long at a time.
const NAP: Duration = Duration::from_millis(1);
/// What is this much later is written down.
const LEAST: Duration = Duration::from_micros(200);

/// The time since the epoch of the system's clock, which is the same for all who run.
///
/// # Errors
/// A clock that is set to before it.
pub fn now() -> Result<Duration> {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    since.map_err(|fault| Error::new(format!("the clock of the system is wrong: {fault}")))
}

/// Sleeps and wakes, and writes each time that it woke late: from when on it should have run, and since when it did.
///
/// # Errors
/// A file that cannot be written.
pub fn watch(path: &Path) -> Result<()> {
    let failed = |fault: std::io::Error| Error::io("write", path, fault);
    let mut file = File::create(path).map_err(failed)?;
    writeln!(file, "from_us,to_us").map_err(failed)?;
    let (begun, epoch) = (Instant::now(), now()?);
    let mut due = NAP;
    loop {
        std::thread::sleep(due.saturating_sub(begun.elapsed()));
        let woke = begun.elapsed();
        if woke > due + LEAST {
            let [from, to] = [due, woke].map(|time| (epoch + time).as_micros());
            writeln!(file, "{from},{to}").map_err(failed)?;
        }
        due = begun.elapsed() + NAP;
    }
}
