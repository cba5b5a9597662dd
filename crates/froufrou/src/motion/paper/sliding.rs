//! What of a sheet slides along something in one frame: vertices that hang together.

use super::super::cloth::gather::Speeds;
use super::holding::Holding;
use super::sheet::{Lie, Sheet};
use crate::motion::event::{Cause, Friction, Moved, Resonator};

/// A part of a sheet that slides along one object.
#[derive(Debug, Clone)]
pub(super) struct Slid {
    pub other: u32,
    pub vertices: Vec<u32>,
    area_m2: f64,
    speed_mps: f64,
    position_m: [f64; 3],
    speeds: Vec<[f64; 2]>,
}

/// The parts that slide faster than a threshold.
pub(super) fn friction(sheet: &Sheet, lie: &Lie, holding: &Holding, threshold_mps: f64) -> Vec<Slid> {
    let mut slides: Vec<Option<(f64, u32)>> = vec![None; sheet.vertex_count];
    for (&vertex, slid) in holding.vertices().iter().zip(&holding.slid) {
        slides[vertex as usize] = slid.filter(|&(speed_mps, _)| speed_mps > threshold_mps);
    }
    let mut found = Vec::new();
    for &seed in holding.vertices() {
        let Some((_, other)) = slides[seed as usize] else { continue };
        let (mut vertices, mut stack) = (Vec::new(), vec![seed]);
        let (mut area, mut speed) = (0.0, 0.0);
        let (mut position, mut speeds) = ([0.0; 3], Speeds::default());
        while let Some(vertex) = stack.pop() {
            let Some((own_mps, _)) = slides[vertex as usize].filter(|&(_, touched)| touched == other) else {
                continue;
            };
            slides[vertex as usize] = None;
            vertices.push(vertex);
            let own_m2 = lie.vertex_areas[vertex as usize];
            area += own_m2;
            speed += own_m2 * own_mps;
            for (sum, c) in position.iter_mut().zip(lie.points[vertex as usize].to_array()) {
                *sum += own_m2 * own_mps * c;
            }
            speeds.add(own_mps, own_m2);
            stack.extend(sheet.edges_at(vertex).iter().flat_map(|&edge| sheet.edges[edge as usize].ends));
        }
        if area > 0.0 && speed > 0.0 {
            vertices.sort_unstable();
            found.push(Slid {
                other,
                vertices,
                area_m2: area,
                speed_mps: speed / area,
                position_m: position.map(|c| c / speed),
                speeds: speeds.steps(),
            });
        }
    }
    found
}

impl Slid {
    /// The event of it: it slid since a time, for as long as a frame.
    pub fn event(
        self,
        time_s: f64,
        lasts_s: f64,
        cloth: String,
        other: String,
        resonators: Vec<Resonator>,
    ) -> Friction {
        Friction {
            force_n: None,
            time_s,
            lasts_s,
            cloth,
            patch: 0,
            other,
            position_m: self.position_m,
            area_m2: self.area_m2,
            speed_mps: self.speed_mps,
            speeds: self.speeds,
            resonators,
            cause: Cause::Motion(Moved { from_s: time_s, to_s: time_s + lasts_s }),
        }
    }
}
