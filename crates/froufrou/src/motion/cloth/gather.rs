//! What slides in one frame, gathered by what it slides along and by the patch of the cloth that it is in.

use std::collections::BTreeMap;

use super::super::event::{Cause, Friction, Moved};
use super::patches::Patches;
use super::sliding::Sliding;

/// Speeds that lie between the same two powers of this are gathered.
const STEP: f64 = std::f64::consts::SQRT_2;

/// Speeds are gathered from this on, in metres a second: what is slower is so slow.
const SLOWEST_MPS: f64 = 1e-3;

/// How much slides how fast, by step of speed: the area, and the speed weighted by it.
#[derive(Debug, Clone, Default)]
pub(in crate::motion) struct Speeds(BTreeMap<i32, [f64; 2]>);

impl Speeds {
    pub fn add(&mut self, speed_mps: f64, area_m2: f64) {
        let step = (speed_mps.max(SLOWEST_MPS).ln() / STEP.ln()).floor() as i32;
        let [area, speed] = self.0.entry(step).or_default();
        *area += area_m2;
        *speed += area_m2 * speed_mps;
    }

    /// The mean speed of each step in metres a second, and its area in square metres, from slow to fast.
    pub fn steps(&self) -> Vec<[f64; 2]> {
        self.0.values().map(|[area, speed]| [speed / area, *area]).collect()
    }
}

#[derive(Debug, Clone, Default)]
struct Sum {
    area_m2: f64,
    /// Weighted by area.
    speed: f64,
    /// Weighted by area and speed.
    position: [f64; 3],
    speeds: Speeds,
}

/// An event for each object that something slides along, and each patch that does.
pub(super) fn events(sliding: &Sliding, patches: &Patches, name: impl Fn(u32) -> String) -> Vec<Friction> {
    let mut sums: BTreeMap<(u32, u32), Sum> = BTreeMap::new();
    for index in 0..sliding.vertex.len() {
        let (speed, area) = (sliding.speed_mps[index], sliding.area_m2[index]);
        // What begins to slide is there for its slope.
        if speed <= 0.0 || area <= 0.0 {
            continue;
        }
        let patch = patches.of(sliding.vertex[index]);
        let sum = sums.entry((sliding.other[index], patch)).or_default();
        sum.area_m2 += area;
        sum.speed += area * speed;
        for (sum, c) in sum.position.iter_mut().zip(sliding.position_m[index]) {
            *sum += area * speed * f64::from(c);
        }
        sum.speeds.add(speed, area);
    }
    let event = |((other, patch), sum): ((u32, u32), Sum)| Friction {
        time_s: sliding.time_s,
        lasts_s: sliding.lasts_s,
        cloth: name(sliding.cloth),
        patch,
        other: name(other),
        position_m: sum.position.map(|c| c / sum.speed),
        area_m2: sum.area_m2,
        speed_mps: sum.speed / sum.area_m2,
        force_n: sliding.pressure_pa.map(|pressure_pa| pressure_pa * sum.area_m2),
        speeds: sum.speeds.steps(),
        resonators: Vec::new(),
        cause: Cause::Motion(Moved { from_s: sliding.time_s, to_s: sliding.time_s + sliding.lasts_s }),
    };
    sums.into_iter().map(event).collect()
}
