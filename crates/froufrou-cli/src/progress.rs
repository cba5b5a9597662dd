//! A progress bar on a terminal, silence in a pipe.

use std::io::IsTerminal;
use std::path::Path;

use indicatif::{ProgressBar, ProgressStyle};

/// The bar of a render, in seconds of sound; a counter where the length is not known beforehand.
pub struct Progress {
    bar: ProgressBar,
    rate_hz: u32,
}

impl Progress {
    /// Begins; `frames` is the length if it is known.
    pub fn new(rate_hz: u32, frames: Option<u64>) -> Self {
        if !std::io::stderr().is_terminal() {
            return Self { bar: ProgressBar::hidden(), rate_hz };
        }
        let milliseconds = |frames: u64| frames * 1000 / u64::from(rate_hz);
        let (bar, template) = match frames {
            Some(frames) => (
                ProgressBar::new(milliseconds(frames)),
                "{bar:40.cyan/black} {percent:>3} %  {msg}  {eta} left",
            ),
            None => (ProgressBar::no_length(), "{spinner} {msg}"),
        };
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        Self { bar, rate_hz }
    }

    /// So many frames are done.
    pub fn at(&self, frames: u64) {
        self.bar.set_position(frames * 1000 / u64::from(self.rate_hz));
        self.bar.set_message(format!("{:.1} s of sound", frames as f64 / f64::from(self.rate_hz)));
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// A counter of what is written where nobody knows how much there will be.
pub struct Count {
    bar: ProgressBar,
    what: &'static str,
    count: u64,
    to_s: f64,
}

/// What is counted between two looks at the terminal.
const EVERY: u64 = 1000;

impl Count {
    /// Begins to count; `what` in the plural. Where the output itself is on the terminal there is
    /// nothing to be seen of it.
    pub fn new(what: &'static str, output: &Path) -> Self {
        let hidden = output == Path::new("-") || !std::io::stderr().is_terminal();
        let bar = if hidden { ProgressBar::hidden() } else { ProgressBar::no_length() };
        if let Ok(style) = ProgressStyle::with_template("{spinner} {msg}") {
            bar.set_style(style);
        }
        Self { bar, what, count: 0, to_s: 0.0 }
    }

    /// One more, at a time of the scene in seconds.
    pub fn one(&mut self, time_s: f64) {
        self.count += 1;
        self.to_s = self.to_s.max(time_s);
        if self.count.is_multiple_of(EVERY) {
            self.bar.tick();
            self.bar.set_message(format!("{} {} up to {:.1} s", self.count, self.what, self.to_s));
        }
    }
}

impl Drop for Count {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
