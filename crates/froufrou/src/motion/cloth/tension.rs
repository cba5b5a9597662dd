//! How taut a cloth is and how fast it beats the air, patch by patch: what a membrane is told.
//!
//! Tension is what an edge is longer by than in the first frame, as a part of its length, times the stiffness of the cloth
//! in N/m; of a patch it is the mean over its edges, weighted by their lengths, of those that are not slack. The speed is
//! the root mean square, over the area, of the velocity across the surface. A patch *snaps* as that velocity changes
//! fastest, as a whip does: the impulse is the density of the cloth times ∫ |Δv| dA from one frame to the next.

use glam::DVec3;

use super::patches::Patches;
use super::proximity::Touchable;

/// What a cloth is made of, as far as it is stretched and moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TensionSettings {
    /// Newtons a metre of width that double its length, if it were to hold.
    pub stiffness_n_per_m: f64,
    /// Kilograms a square metre.
    pub density_kg_per_m2: f64,
    /// A patch snaps where its velocity changes by more than this from one frame to the next, in metres a second.
    pub snap_mps: f64,
}

/// A patch in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Beat {
    pub time_s: f64,
    pub lasts_s: f64,
    pub patch: u32,
    pub middle_m: DVec3,
    pub tension_n_per_m: f64,
    pub speed_mps: f64,
    /// Where it snaps.
    pub impulse_ns: Option<f64>,
}

/// Follows one cloth.
#[derive(Debug, Clone)]
pub(super) struct Tension {
    settings: TensionSettings,
    /// The ends of each edge, and its length in the first frame.
    edges: Vec<([u32; 2], f64)>,
    /// The frame before: its time, and where its vertices were.
    before: Option<(f64, Vec<[f32; 3]>)>,
    /// Velocities across the surface from the frame before that to it.
    velocities: Vec<f64>,
    /// Of each patch, how much they changed in the last steps: of area, and of impulse.
    changes: Vec<[Change; 2]>,
    /// What is not told yet, as the next frame decides whether it snaps.
    held: Vec<Beat>,
}

/// How much the velocity of a patch changed from frame to frame.
#[derive(Debug, Clone, Copy, Default)]
struct Change {
    mean_mps: f64,
    impulse_ns: f64,
}

/// Sums over a patch.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    rest_m: f64,
    stretched_m: f64,
    area_m2: f64,
    squares: f64,
    changes: f64,
}

impl Tension {
    pub fn new(settings: TensionSettings, mesh: &Touchable) -> Self {
        let (surface, positions) = (mesh.surface(), mesh.positions());
        let at = |vertex: u32| DVec3::from(positions[vertex as usize].map(f64::from));
        let mut edges: Vec<[u32; 2]> = surface
            .triangles()
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
            .map(|[a, b]| [a.min(b), a.max(b)])
            .collect();
        edges.sort_unstable();
        edges.dedup();
        let long = |[a, b]: [u32; 2]| ([a, b], at(a).distance(at(b)));
        let edges = edges.into_iter().map(long).filter(|(_, length_m)| *length_m > 0.0).collect();
        Self { settings, edges, before: None, velocities: Vec::new(), changes: Vec::new(), held: Vec::new() }
    }

    /// Takes the next frame; gives what is known of the one before the last.
    pub fn feed(&mut self, time_s: f64, mesh: &Touchable, area_m2: &[f64], patches: &Patches) -> Vec<Beat> {
        let positions = mesh.positions();
        let Some((before_s, before)) = self.before.replace((time_s, positions.to_vec())) else {
            return Vec::new();
        };
        let step_s = time_s - before_s;
        let at = |positions: &[[f32; 3]], vertex: u32| DVec3::from(positions[vertex as usize].map(f64::from));
        let mut sums = vec![Sum::default(); patches.count()];
        for &([a, b], rest_m) in &self.edges {
            let sum = &mut sums[patches.of(a) as usize];
            sum.rest_m += rest_m;
            sum.stretched_m += (at(&before, a).distance(at(&before, b)) - rest_m).max(0.0);
        }
        let mut normals = vec![DVec3::ZERO; positions.len()];
        for triangle in mesh.surface().triangles() {
            let [a, b, c] = triangle.map(|vertex| at(&before, vertex));
            let normal = (b - a).cross(c - a);
            triangle.iter().for_each(|vertex| normals[*vertex as usize] += normal);
        }
        let across = |vertex: usize| {
            let moved = at(positions, vertex as u32) - at(&before, vertex as u32);
            moved.dot(normals[vertex].normalize_or_zero()) / step_s
        };
        let velocities: Vec<f64> = (0..positions.len()).map(across).collect();
        for (vertex, velocity) in velocities.iter().enumerate() {
            let area_m2 = area_m2.get(vertex).copied().unwrap_or_default();
            let sum = &mut sums[patches.of(vertex as u32) as usize];
            sum.area_m2 += area_m2;
            sum.squares += area_m2 * velocity * velocity;
            let earlier = self.velocities.get(vertex).unwrap_or(velocity);
            sum.changes += area_m2 * (velocity - earlier).abs();
        }
        self.velocities = velocities;
        let middles = patches.middles(&before);
        self.changes.resize(sums.len(), [Change::default(); 2]);
        let told = self.settle(&sums);
        self.held = sums
            .iter()
            .zip(&middles)
            .enumerate()
            .map(|(patch, (sum, middle))| Beat {
                time_s: before_s,
                lasts_s: step_s,
                patch: patch as u32,
                middle_m: *middle,
                tension_n_per_m: self.settings.stiffness_n_per_m * sum.stretched_m / sum.rest_m.max(1e-12),
                speed_mps: (sum.squares / sum.area_m2.max(1e-12)).sqrt(),
                impulse_ns: None,
            })
            .collect();
        told
    }

    /// What is held, with its snaps: a change is one where it is greater than the one before and no less than the one after.
    fn settle(&mut self, sums: &[Sum]) -> Vec<Beat> {
        let mut told = std::mem::take(&mut self.held);
        for (patch, (sum, changes)) in sums.iter().zip(&mut self.changes).enumerate() {
            let [before, last] = *changes;
            let next = Change {
                mean_mps: sum.changes / sum.area_m2.max(1e-12),
                impulse_ns: self.settings.density_kg_per_m2 * sum.changes,
            };
            let is_peak = last.mean_mps > before.mean_mps && last.mean_mps >= next.mean_mps;
            if let Some(beat) =
                told.get_mut(patch).filter(|_| is_peak && last.mean_mps > self.settings.snap_mps)
            {
                beat.impulse_ns = Some(last.impulse_ns);
            }
            *changes = [last, next];
        }
        told
    }

    /// What is left at the end.
    pub fn finish(&mut self) -> Vec<Beat> {
        let none = vec![Sum::default(); self.changes.len()];
        self.settle(&none)
    }
}

#[cfg(test)]
mod tests {
    use super::super::shapes::sheet;
    use super::super::{Analyser, ClothSettings, Participant};
    use super::*;
    use crate::motion::event::{Event, Flap};

    const SETTINGS: TensionSettings =
        TensionSettings { stiffness_n_per_m: 300.0, density_kg_per_m2: 0.2, snap_mps: 1.0 };

    /// What a square metre does at 50 frames a second, for a second.
    fn flaps(cells: u32, patches: usize, place: impl Fn(f64, [f64; 2]) -> [f64; 3]) -> Vec<Flap> {
        let settings = ClothSettings { tension: Some(SETTINGS), patches, ..ClothSettings::default() };
        let mut analyser = Analyser::new(vec![Participant { name: "sail".into(), cloth: Some(settings) }]);
        for frame in 0..50 {
            let time_s = f64::from(frame) / 50.0;
            analyser.feed(time_s, &[sheet(cells, cells, |x, y| place(time_s, [x, y]))]).unwrap();
        }
        analyser.finish();
        let events = std::iter::from_fn(|| analyser.next_event());
        events.filter_map(|event| if let Event::Flap(flap) = event { Some(flap) } else { None }).collect()
    }

    #[test]
    fn what_is_longer_is_taut_and_what_is_shorter_is_slack() {
        for cells in [6, 12] {
            let found = flaps(cells, 3, |time_s, [x, y]| {
                let longer = 1.0 + 0.02 * (4.0 * (time_s * 2.0).sin()).clamp(-1.0, 1.0);
                [longer * x, longer * y, 0.0]
            });
            assert!(found.len() >= 3 * 48);
            for flap in found {
                let strain = 0.02 * (4.0 * (flap.time_s * 2.0).sin()).clamp(-1.0, 1.0);
                let wanted = 300.0 * strain.max(0.0);
                assert!((flap.tension_n_per_m - wanted).abs() < 0.01, "{flap:?}, {wanted}");
            }
        }
    }

    #[test]
    fn it_is_as_fast_as_it_moves_across_itself_and_snaps_where_that_turns() {
        // To and fro across itself at 2 m/s, turning at 0.5 s; and on along itself, which stirs nothing.
        let turns = |time_s: f64, [x, y]: [f64; 2]| [x + 3.0 * time_s, y, 2.0 * (0.5 - (time_s - 0.5).abs())];
        for (cells, patches) in [(8, 1), (16, 1), (16, 4)] {
            let found = flaps(cells, patches, turns);
            let middle = |flap: &&Flap| (0.04..0.96).contains(&flap.time_s);
            assert!(found.iter().filter(middle).all(|flap| (flap.speed_mps - 2.0).abs() < 1e-3));
            let snaps: Vec<&Flap> = found.iter().filter(|flap| flap.impulse_ns.is_some()).collect();
            assert!(
                snaps.len() == patches && snaps.iter().all(|s| (s.time_s - 0.5).abs() < 1e-9),
                "{snaps:?}"
            );
            // 0.2 kg/m², 4 m/s and what of a square metre the patches have.
            let whole: f64 = snaps.iter().filter_map(|snap| snap.impulse_ns).sum();
            assert!((whole / 0.8 - 1.0).abs() < 0.2, "{whole}");
        }
        assert!(flaps(8, 2, |_, [x, y]| [x, y, 0.0]).iter().all(|flap| flap.speed_mps == 0.0));
    }
}
