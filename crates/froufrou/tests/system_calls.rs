//! The audio thread makes no system call: it fills blocks in a process that would be killed by one.
#![cfg(all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64")))]

use std::collections::BTreeMap;
use std::os::unix::process::ExitStatusExt;
use std::process::{Command, ExitStatus};

use froufrou::render::live::{self, Settings};
use froufrou::score::{Arrival, ChannelLine, Header, Order, Output, Start, Statement, Verb};
use froufrou::synth::mixer::Mixer;
use froufrou::synth::receivers;
use froufrou::synth::voice::Prototype;
use seccompiler::{BpfProgram, SeccompAction, SeccompFilter};

const RATE_HZ: u32 = 48_000;

/// Names what the process is to do that this program starts of itself.
const WORK: &str = "FROUFROU_SYSTEM_CALLS";

/// What a process ends with that has done all its work.
const DONE: i32 = 42;

/// Lets this thread make no system call but those that end the process, and the one by which systems tell the
/// time that cannot do so without.
fn forbid() {
    let allowed = [libc::SYS_exit_group, libc::SYS_exit, libc::SYS_clock_gettime];
    let rules: BTreeMap<_, _> = allowed.into_iter().map(|call| (call, Vec::new())).collect();
    let arch = std::env::consts::ARCH.try_into().unwrap();
    let filter = SeccompFilter::new(rules, SeccompAction::KillProcess, SeccompAction::Allow, arch).unwrap();
    let program: BpfProgram = filter.try_into().unwrap();
    seccompiler::apply_filter(&program).unwrap();
}

/// Ends the process at once: what the standard library tidies up behind a program takes system calls of its own.
fn end(with: i32) -> ! {
    // SAFETY: nothing runs behind it that could depend on anything.
    unsafe { libc::_exit(with) }
}

/// Voices that move, of which one ends and another begins.
fn lines(has_places: bool) -> Vec<froufrou::Result<ChannelLine>> {
    let mut lines = Vec::new();
    for key in 0..=60u32 {
        for thread in 0..8u64 {
            let time_s = f64::from(key) / 60.0;
            let verb = match (key, thread) {
                (0, 0..6) | (20, 6..) => Verb::Start(Start::new("noise")),
                (0..20, 6..) | (41.., 0) => continue,
                (40, 0) | (60, _) => Verb::End,
                _ => Verb::Key,
            };
            let from_m = [time_s, 0.2 * thread as f64, 2.0];
            let arrival = Arrival::new(0.02, 0.01 + 0.002 * time_s);
            let value = vec![Arrival { from_m: has_places.then_some(from_m), ..arrival }];
            lines.push(Ok(ChannelLine::Thread(Statement { thread, path: 0, time_s, verb, value })));
        }
    }
    lines
}

/// Plays more than there is, so that sounds are held, fade and end in silence.
fn play(output: Output) -> ! {
    let noise = froufrou::random::Random::new(1, 0);
    let samples = (0..9_600).map(|n| (noise.uniform(n) * 2.0 - 1.0) as f32).collect();
    let sound = Prototype { samples, rate_hz: 44_100.0, looped: true };
    let has_places = matches!(output, Output::Head { .. });
    let header = Header::new(Order::Time, vec![output]);
    let receivers = receivers::load(&header, std::path::Path::new(""), RATE_HZ).unwrap();
    let lines = lines(has_places).into_iter();
    let mixer = Mixer::new(RATE_HZ, receivers, [("noise".to_owned(), sound.into())], lines).unwrap();
    let settings = Settings { ahead_s: 0.8, budget: 0.8, ..Settings::default() };
    let (mut supply, mut player) = live::part(mixer, settings).unwrap();
    supply.go_on().unwrap();
    let mut block = vec![0.0; 480 * player.channels()];
    let audio = std::thread::spawn(move || {
        forbid();
        let mut peak = 0.0f32;
        for frames in (0..400).map(|n| 1 + (n * 37) % 480) {
            let block = &mut block[..frames * player.channels()];
            player.fill(block);
            peak = block.iter().fold(peak, |peak, sample| peak.max(sample.abs()));
        }
        let statistics = player.statistics();
        let was_late = statistics.held > 0 && statistics.silent_frames > 0;
        end(if peak > 0.001 && was_late { DONE } else { 1 })
    });
    let _ = audio.join();
    end(2)
}

/// Is run in a process of its own; there is nothing to do where nobody asks for it.
#[test]
fn work() {
    match std::env::var(WORK).as_deref() {
        Ok("mono") => play(Output::Channel("microphone".to_owned())),
        Ok("head") => {
            let ears = ["left".to_owned(), "right".to_owned()];
            play(Output::Head { ears, head: None, shared: true })
        }
        Ok("yield") => {
            forbid();
            std::thread::yield_now();
            end(DONE)
        }
        _ => {}
    }
}

fn ended(work: &str) -> ExitStatus {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", "work", "--nocapture"]).env(WORK, work).output().unwrap().status
}

#[test]
fn the_audio_thread_makes_no_system_call() {
    for work in ["mono", "head"] {
        let status = ended(work);
        assert_eq!(status.code(), Some(DONE), "{work}: {status}");
    }
    // A thread that makes one is killed.
    assert_eq!(ended("yield").signal(), Some(libc::SIGSYS));
}
