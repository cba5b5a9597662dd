//! Running the command, and the small files that it is run on.
#![allow(dead_code)] // Each test program uses a part of it.

use std::f64::consts::TAU;
use std::path::Path;
use std::process::{Command, Output};

use froufrou::render::wav::{SampleFormat, WavFormat, WavWriter};

/// Runs the command.
pub fn froufrou<A: AsRef<std::ffi::OsStr>>(arguments: impl IntoIterator<Item = A>) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_froufrou"));
    command.args(arguments).output().expect("the command runs")
}

/// What it wrote to the standard error.
pub fn message(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Fails unless it ended well.
pub fn good(output: &Output) {
    assert!(output.status.success(), "{}", message(output));
}

/// What it tells a program, where it ends well.
pub fn told(arguments: &[&str]) -> serde_json::Value {
    let output = froufrou(arguments.iter().copied().chain(["--json"]));
    good(&output);
    serde_json::from_slice(&output.stdout).expect("JSON")
}

/// Writes a WAV file of interleaved samples.
pub fn wav(path: &Path, rate_hz: u32, channels: usize, samples: &[f32]) {
    let format = WavFormat { rate_hz, channels, samples: SampleFormat::Float32, seed: 0, first_frame: 0 };
    let mut writer = WavWriter::create(path, format).expect("a WAV file");
    writer.write(samples).expect("room for it");
    writer.finish().expect("room for it");
}

/// A sine.
pub fn sine(rate_hz: u32, hz: f64, amplitude: f64, frames: usize) -> Vec<f32> {
    let step = TAU * hz / f64::from(rate_hz);
    (0..frames).map(|i| (amplitude * (step * i as f64).sin()) as f32).collect()
}

/// An impact as a line of an event file.
pub fn impact(time_s: f64, a: &str, b: &str, impulse_ns: f64) -> String {
    format!(
        r#"{{"kind":"impact","time_s":{time_s},"a":"{a}","b":"{b}","position_m":[0,0,0],"impulse_ns":{impulse_ns},"cause":{{"log":"c.csv","first_line":2,"last_line":3}}}}"#
    ) + "\n"
}
