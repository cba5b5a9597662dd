//! A loaded live engine through a real sound server, held against what the server played.
//!
//!     live_server play FOLDER --seconds 30 --block 128
//!     live_server watch FOLDER/watch-0.csv
//!     live_server compare FOLDER
//!
//! `play` lets 300 contacts, a cloth of 5041 vertices and a sheet of paper sound at once through the default device, and writes what
//! the device was given (`given.f32`), and when (`blocks.csv`). Beside it `watch`, on a core of its own and more urgent than all
//! else, writes when that core stood still. `compare` looks for what was given in a recording of the same device
//! (`recorded.f32`) and tells where that has gaps, and why. `oracles/live_server.sh` starts a server, records it and runs all.

#[allow(dead_code)] // The command uses more of it.
#[path = "../../src/play/device.rs"]
mod device;

mod compare;
mod load;
mod watch;

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use clap::{Parser, Subcommand};
use device::{Fill, Home, Output};
use froufrou::render::live::{self, EngineSettings, Player, Refused};
use froufrou::scene::Scene;
use froufrou::{Error, Result};

#[derive(Parser)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Play, and write what was played
    Play {
        folder: PathBuf,
        #[arg(long, default_value_t = 30.0)]
        seconds: f64,
        #[arg(long, default_value_t = 128)]
        block: u32,
        #[arg(long, default_value_t = 300)]
        contacts: usize,
        /// How far the engine is ahead of the device, in seconds
        #[arg(long, default_value_t = 0.05)]
        ahead: f64,
    },
    /// Write when the core that it runs on stands still, until it is stopped
    Watch { file: PathBuf },
    /// Hold a recording against it
    Compare { folder: PathBuf },
}

const RATE_HZ: u32 = 48_000;
const CHANNELS: usize = 2;

/// A block that the device asked for.
#[derive(Clone, Copy)]
struct Block {
    /// When, from the beginning on.
    asked: Duration,
    took: Duration,
    frames: u32,
}

/// Passes on what a player gives, and copies it.
struct Tap {
    player: Player,
    begun: Instant,
    samples: rtrb::Producer<f32>,
    blocks: rtrb::Producer<Block>,
    is_over: Arc<AtomicBool>,
}

impl Fill for Tap {
    fn fill(&mut self, block: &mut [f32]) {
        let asked = self.begun.elapsed();
        if self.is_over.load(Relaxed) {
            return block.fill(0.0);
        }
        self.player.fill(block);
        let took = self.begun.elapsed() - asked;
        // There is room for seconds; the other side says where it was not enough.
        if let Ok(room) = self.samples.write_chunk_uninit(block.len()) {
            room.fill_from_iter(block.iter().copied());
        }
        let _ = self.blocks.push(Block { asked, took, frames: (block.len() / CHANNELS) as u32 });
    }
}

fn main() -> Result<()> {
    match Cli::parse().command {
        Command::Play { folder, seconds, block, contacts, ahead } => {
            play(&folder, seconds, block, contacts, ahead)
        }
        Command::Watch { file } => watch::watch(&file),
        Command::Compare { folder } => compare::compare(&folder),
    }
}

fn play(folder: &Path, seconds: f64, block_frames: u32, contacts: usize, ahead_s: f64) -> Result<()> {
    load::write(folder, seconds, contacts)?;
    let scene = Scene::open(folder.join("scene.toml"), false)?;
    let settings = EngineSettings { rate_hz: RATE_HZ, ahead_s, ..EngineSettings::default() };
    let (mut handle, player) = live::start(scene, settings)?;
    let output = Output::find(None, player.channels(), RATE_HZ, block_frames)?;
    println!(
        "{}: {} Hz, blocks of {block_frames} frames, {contacts} contacts",
        output.name(),
        output.rate_hz()
    );
    println!("latency of the engine {:.1} ms", 1000.0 * handle.latency().all_s);
    let (samples, given) = rtrb::RingBuffer::new(RATE_HZ as usize * CHANNELS * 4);
    let (blocks, asked) = rtrb::RingBuffer::new(1 << 14);
    let is_over = Arc::new(AtomicBool::new(false));
    let (opened, epoch) = (Instant::now(), watch::now()?);
    let writer = {
        let (folder, is_over) = (folder.to_owned(), is_over.clone());
        std::thread::spawn(move || write(&folder, given, asked, epoch, &is_over))
    };
    let home = Home::new();
    let playing =
        output.play(Tap { player, begun: opened, samples, blocks, is_over: is_over.clone() }, &home)?;
    let pairs = load::Pairs::new(&mut handle, contacts)?;
    // A device takes a while to begin.
    while handle.statistics().blocks == 0 && opened.elapsed() < Duration::from_secs(10) {
        std::thread::sleep(Duration::from_millis(1));
    }
    let begun = Instant::now();
    let frames = (seconds * 60.0) as u32;
    let (mut last, mut most_load, mut threads) = (handle.statistics(), 0.0f64, Vec::new());
    for frame in 1..=frames {
        let time_s = f64::from(frame) / 60.0;
        pairs.tell(&mut handle, time_s);
        handle.advance(time_s).map_err(Refused::fault)?;
        if let Some(fault) = handle.take_fault() {
            return Err(fault);
        }
        let now = handle.statistics();
        most_load = most_load.max(f64::from(now.load));
        threads.push(now.threads);
        if now.held != last.held || now.skipped_frames != last.skipped_frames {
            println!(
                "at {time_s:.2} s of the score: held {} times, {} frames; {} frames left out",
                now.held - last.held,
                now.held_frames - last.held_frames,
                now.skipped_frames - last.skipped_frames
            );
        }
        last = now;
        std::thread::sleep(
            (begun + Duration::from_secs_f64(time_s)).saturating_duration_since(Instant::now()),
        );
    }
    let (statistics, left) = (handle.statistics(), handle.left_out());
    // What is still on its way is not compared.
    is_over.store(true, Relaxed);
    std::thread::sleep(Duration::from_millis(300));
    println!("real-time priority: {:?}", playing.is_urgent());
    println!("the device says that it had nothing in time: {} times", playing.hiccups());
    drop(playing);
    writer.join().map_err(|_| Error::new("writing has failed"))??;
    println!("{statistics:?}\n{left:?}");
    threads.sort_unstable();
    let part = |part: usize| threads.get(part * threads.len() / 100).copied().unwrap_or(0);
    println!(
        "threads at once: {} at most, {} in the median, {} in one of twenty moments at most; {} of {} blocks took longer than they \
         sound, the slowest {:.2} times as long, {:.0} % on average at most",
        threads.last().copied().unwrap_or(0),
        part(50),
        part(5),
        statistics.late_blocks,
        statistics.blocks,
        statistics.peak_load,
        100.0 * most_load
    );
    Ok(())
}

/// Writes what the device was given, and when, until all is over.
fn write(
    folder: &Path,
    mut given: rtrb::Consumer<f32>,
    mut asked: rtrb::Consumer<Block>,
    epoch: Duration,
    is_over: &AtomicBool,
) -> Result<()> {
    let create = |name: &str| {
        let path = folder.join(name);
        File::create(&path).map(BufWriter::new).map_err(|fault| Error::io("create", &path, fault))
    };
    let failed = |fault: std::io::Error| Error::new(format!("cannot write: {fault}"));
    let (mut sound, mut blocks) = (create("given.f32")?, create("blocks.csv")?);
    writeln!(blocks, "asked_us,took_us,frames").map_err(failed)?;
    let (mut samples, mut frames) = (0u64, 0u64);
    loop {
        let ends = is_over.load(Relaxed);
        while let Ok(sample) = given.pop() {
            sound.write_all(&sample.to_le_bytes()).map_err(failed)?;
            samples += 1;
        }
        while let Ok(Block { asked, took, frames: count }) = asked.pop() {
            frames += u64::from(count);
            let asked = epoch + asked;
            writeln!(blocks, "{},{},{count}", asked.as_micros(), took.as_micros()).map_err(failed)?;
        }
        if ends {
            break;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    if samples != frames * CHANNELS as u64 {
        return Err(Error::new(format!(
            "{samples} samples of {frames} frames were written: the disk is too slow"
        )));
    }
    sound.flush().and_then(|()| blocks.flush()).map_err(failed)
}
