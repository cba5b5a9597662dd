//! A progress bar on a terminal, silence in a pipe.

use std::io::IsTerminal;

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
