//! What a voice costs.

use std::time::Duration;

use crate::drive::Drive;
use crate::peers::{Peer, Rendering, Result};
use crate::world::{RATE_HZ, World};

/// Seconds that sound before the clock runs: tables are made and first fades are over by then.
pub const WARM_UP_S: f64 = 0.5;

/// How a measurement is made.
#[derive(Debug, Clone, Copy)]
pub struct Plan {
    pub block: usize,
    pub seconds: f64,
    pub repeats: usize,
}

/// Nanoseconds for each voice and sample.
#[derive(Debug, Clone, Copy)]
pub struct Cost {
    pub median_ns: f64,
    pub least_ns: f64,
    pub most_ns: f64,
}

/// Measures all peers with so many voices, in turns, so that what else the machine does falls on
/// all of them.
pub fn measure(peers: &[Box<dyn Peer>], voices: usize, plan: Plan) -> Result<Vec<Cost>> {
    let world = World::circling(voices, plan.block);
    let mut drives = Vec::with_capacity(peers.len());
    for peer in peers {
        let named = |error| format!("{}: {error}", peer.name());
        let mut drive = Drive::start(&**peer, &world).map_err(named)?;
        for _ in 0..blocks(WARM_UP_S, plan.block) {
            drive.next().map_err(named)?;
        }
        drives.push(drive);
    }
    let count = blocks(plan.seconds, plan.block);
    let mut all_ns = vec![Vec::with_capacity(plan.repeats); peers.len()];
    for _ in 0..plan.repeats {
        for (drive, all_ns) in drives.iter_mut().zip(&mut all_ns) {
            let begun = now();
            for _ in 0..count {
                std::hint::black_box(drive.next()?);
            }
            all_ns.push(per_voice_sample(begun, count * plan.block * voices));
        }
    }
    Ok(all_ns.into_iter().map(cost).collect())
}

/// The same of voices that are told nothing while they sound.
pub fn plain(mut renderings: Vec<Box<dyn Rendering>>, voices: usize, plan: Plan) -> Result<Vec<Cost>> {
    let mut block = vec![[0.0; 2]; plan.block];
    let mut all_ns = vec![Vec::with_capacity(plan.repeats); renderings.len()];
    for repeat in 0..=plan.repeats {
        for (rendering, all_ns) in renderings.iter_mut().zip(&mut all_ns) {
            let seconds = if repeat == 0 { WARM_UP_S } else { plan.seconds };
            let count = blocks(seconds, plan.block);
            rendering.prepare()?;
            let begun = now();
            for _ in 0..count {
                rendering.render(&mut block)?;
                std::hint::black_box(&block);
            }
            if repeat > 0 {
                all_ns.push(per_voice_sample(begun, count * plan.block * voices));
            }
        }
    }
    Ok(all_ns.into_iter().map(cost).collect())
}

fn blocks(seconds: f64, block: usize) -> usize {
    (seconds * f64::from(RATE_HZ) / block as f64).ceil() as usize
}

/// Nanoseconds since then, for each of so many samples of voices.
fn per_voice_sample(begun: Duration, samples: usize) -> f64 {
    (now() - begun).as_nanos() as f64 / samples as f64
}

/// The time that this thread has run, where it can be told; so what else the machine does counts for less.
#[cfg(target_os = "linux")]
fn now() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Duration::new(time.tv_sec.unsigned_abs(), u32::try_from(time.tv_nsec).unwrap_or(0))
}

/// The time that has passed.
#[cfg(not(target_os = "linux"))]
fn now() -> Duration {
    use std::sync::OnceLock;
    use std::time::Instant;
    static BEGUN: OnceLock<Instant> = OnceLock::new();
    BEGUN.get_or_init(Instant::now).elapsed()
}

fn cost(mut all_ns: Vec<f64>) -> Cost {
    all_ns.sort_by(f64::total_cmp);
    let (least_ns, most_ns) = (all_ns[0], all_ns[all_ns.len() - 1]);
    let median_ns = f64::midpoint(all_ns[(all_ns.len() - 1) / 2], all_ns[all_ns.len() / 2]);
    Cost { median_ns, least_ns, most_ns }
}
