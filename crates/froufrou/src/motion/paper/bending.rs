//! How a sheet is bent: its folds, the direction and size of its curvature, and the mean curvature of its vertices.
//!
//! The integral of the curvature tensor over a part of a mesh is Σ β·|e|·ē⊗ē over its edges, with the angle β by which
//! the sheet turns across an edge e of the direction ē (Cohen-Steiner and Morvan 2003, the normal cycle). On a
//! developable surface the eigenvector of its largest eigenvalue lies along the rulings, and the eigenvalue over the
//! area is the curvature across them. Both are averaged over a length, so that noise and the way in which the sheet is
//! cut into triangles do not count.
//!
//! A fold is not averaged: an edge where much more turns than about it leaves out what lies beyond. So either side of
//! it stays as flat, or as curved, as it is.

use glam::DVec3;
use rayon::prelude::*;

use super::sheet::{Edge, Lie, Sheet};
use crate::motion::cloth::triangulation::Triangulation;

/// An edge that turns by less than this, in radians, is no crease.
const CREASE: f64 = 0.15;
/// About a crease nothing turns by more than this part of it.
const APART: f64 = 0.7;
/// What was a crease or a ridge before stays one down to this part of the threshold.
const STAYS: f64 = 0.85;
/// A fold goes on where the next edge turns by less than 45°, as its cosine.
const STRAIGHT: f64 = 0.7;
/// A vertex and its neighbours average with this part of their squared distance as their variance.
const RING: f64 = 3.0 / 7.0;
/// More often than this nothing is averaged, however fine the mesh is.
const MOST_ROUNDS: f64 = 24.0;
/// Less often neither: one vertex alone knows little of its rulings.
const LEAST_ROUNDS: f64 = 2.0;

/// How the sheet is bent about a vertex, in 1/m.
#[derive(Debug, Clone, Copy, Default)]
struct Bent {
    /// The upper half of a symmetric tensor: xx, yy, zz, xy, xz, yz.
    tensor: [f32; 6],
    mean_per_m: f32,
    /// 0 at a crease, else 1.
    free: f32,
}

/// How a sheet is bent in one frame.
#[derive(Debug, Clone, Default)]
pub(super) struct Bending {
    rounds: u32,
    /// Of each edge: whether it is a ridge, which stops what vibrates, and whether it parts what is flat or curved.
    pub is_ridge: Vec<bool>,
    pub is_crease: Vec<bool>,
    candidates: Vec<bool>,
    /// Whether each vertex is at a crease.
    at_crease: Vec<bool>,
    at: Vec<Bent>,
    room: Vec<Bent>,
    /// Of each vertex: the mean curvature, in 1/m, above 0 where the sheet is convex.
    pub mean_per_m: Vec<f64>,
    /// Of each face: the direction of its ruling, of length 1 or 0, and the curvature across it in 1/m.
    pub rulings: Vec<DVec3>,
    pub curvatures: Vec<f64>,
}

impl Bending {
    /// Begins with a sheet as it lies now; curvature is averaged over a length, the standard deviation along either
    /// axis.
    pub fn new(sheet: &Sheet, lie: &Lie, average_m: f64) -> Self {
        let mean_edge_m = lie.lengths.iter().sum::<f64>() / lie.lengths.len().max(1) as f64;
        let rounds = (average_m / mean_edge_m).powi(2) / RING;
        // A mesh of nothing has no edges.
        let rounds = if rounds.is_nan() { LEAST_ROUNDS } else { rounds.clamp(LEAST_ROUNDS, MOST_ROUNDS) };
        let rounds = rounds.round() as u32;
        Self {
            rounds,
            is_ridge: vec![false; sheet.edges.len()],
            is_crease: vec![false; sheet.edges.len()],
            candidates: vec![false; sheet.edges.len()],
            ..Self::default()
        }
    }

    /// Measures a sheet as it lies now.
    pub fn measure(&mut self, sheet: &Sheet, surface: &Triangulation, lie: &Lie, ridge_rad: f64) {
        self.find_creases(sheet, lie, ridge_rad);
        self.gather(sheet, lie);
        self.average(surface, lie);
        self.decompose(sheet, lie);
    }

    fn find_creases(&mut self, sheet: &Sheet, lie: &Lie, ridge_rad: f64) {
        for (is_ridge, angle) in self.is_ridge.iter_mut().zip(&lie.angles) {
            *is_ridge = angle.abs() > if *is_ridge { STAYS * ridge_rad } else { ridge_rad };
        }
        for (index, edge) in sheet.edges.iter().enumerate() {
            let (angle, was) = (lie.angles[index].abs(), self.is_crease[index]);
            let (least, apart) = if was { (STAYS * CREASE, APART / STAYS) } else { (CREASE, APART) };
            self.candidates[index] = self.is_ridge[index]
                || angle > least
                    && edge.faces.iter().all(|&face| {
                        let corners = sheet.triangles[face as usize];
                        let opposite = corners.into_iter().find(|v| !edge.ends.contains(v));
                        let beyond = opposite.map_or(&[][..], |v| sheet.edges_at(v));
                        beyond.iter().all(|&other| lie.angles[other as usize].abs() < apart * angle)
                    });
        }
        self.at_crease.clear();
        self.at_crease.resize(sheet.vertex_count, false);
        let candidates = &self.candidates;
        let along = |edge: &Edge| lie.points[edge.ends[1] as usize] - lie.points[edge.ends[0] as usize];
        for (index, edge) in sheet.edges.iter().enumerate() {
            if !candidates[index] {
                self.is_crease[index] = false;
                self.is_ridge[index] = false;
                continue;
            }
            let own = along(edge).normalize_or_zero();
            // A fold goes on at either end, or meets the border; one edge alone is noise.
            let goes_on = |&v: &u32| {
                sheet.edges_at(v).iter().map(|&other| other as usize).filter(|&other| other != index).any(
                    |other| {
                        let edge = &sheet.edges[other];
                        let straight = || along(edge).normalize_or_zero().dot(own).abs() > STRAIGHT;
                        edge.is_border || candidates[other] && straight()
                    },
                )
            };
            let is_fold = edge.ends.iter().all(goes_on);
            self.is_crease[index] = is_fold;
            self.is_ridge[index] &= is_fold;
            if is_fold {
                edge.ends.iter().for_each(|&v| self.at_crease[v as usize] = true);
            }
        }
    }

    /// Gives each vertex the half of what turns at its edges.
    fn gather(&mut self, sheet: &Sheet, lie: &Lie) {
        self.at.clear();
        let begin = |&at_crease: &bool| Bent { free: if at_crease { 0.0 } else { 1.0 }, ..Bent::default() };
        self.at.extend(self.at_crease.iter().map(begin));
        for (index, edge) in sheet.edges.iter().enumerate() {
            let (angle, length) = (lie.angles[index], lie.lengths[index]);
            if angle == 0.0 || length == 0.0 {
                continue;
            }
            let turned = 0.5 * angle * length;
            let along = (lie.points[edge.ends[1] as usize] - lie.points[edge.ends[0] as usize]) / length;
            let [x, y, z] = along.to_array();
            let weight = if self.is_crease[index] { 0.0 } else { turned };
            let tensor = [x * x, y * y, z * z, x * y, x * z, y * z].map(|c| (c * weight) as f32);
            for &v in &edge.ends {
                let bent = &mut self.at[v as usize];
                bent.mean_per_m += (0.5 * turned) as f32;
                for (sum, c) in bent.tensor.iter_mut().zip(tensor) {
                    *sum += c;
                }
            }
        }
        for (bent, &area) in self.at.iter_mut().zip(&lie.vertex_areas) {
            let per_area = if area > 0.0 { (1.0 / area) as f32 } else { 0.0 };
            bent.mean_per_m *= per_area;
            bent.tensor = bent.tensor.map(|c| c * per_area);
        }
    }

    /// The mean over a vertex and its neighbours, by area, again and again.
    fn average(&mut self, surface: &Triangulation, lie: &Lie) {
        let areas: Vec<f32> = lie.vertex_areas.iter().map(|&area| area as f32).collect();
        for _ in 0..self.rounds {
            let (at, areas) = (&self.at, &areas);
            let mean = |vertex: usize| {
                let own = areas[vertex];
                let mut sum = at[vertex].tensor.map(|c| c * own);
                let (mut mean, mut area, mut free_area) = (own * at[vertex].mean_per_m, own, own);
                for &other in surface.ring(vertex as u32) {
                    let (other, part) = (&at[other as usize], areas[other as usize]);
                    mean += part * other.mean_per_m;
                    area += part;
                    // What lies at a crease belongs to both of its sides.
                    let part = part * other.free;
                    free_area += part;
                    for (sum, c) in sum.iter_mut().zip(&other.tensor) {
                        *sum += part * c;
                    }
                }
                let per = |area: f32| if area > 0.0 { 1.0 / area } else { 0.0 };
                let per_free = per(free_area);
                Bent {
                    tensor: sum.map(|c| c * per_free),
                    mean_per_m: mean * per(area),
                    free: at[vertex].free,
                }
            };
            (0..at.len()).into_par_iter().with_min_len(4096).map(mean).collect_into_vec(&mut self.room);
            std::mem::swap(&mut self.at, &mut self.room);
        }
        self.mean_per_m.clear();
        self.mean_per_m.extend(self.at.iter().map(|bent| f64::from(bent.mean_per_m)));
    }

    /// Finds the rulings of all faces.
    fn decompose(&mut self, sheet: &Sheet, lie: &Lie) {
        self.rulings.clear();
        self.curvatures.clear();
        for (face, corners) in sheet.triangles.iter().enumerate() {
            let free = corners.iter().filter(|v| !self.at_crease[**v as usize]).count();
            let mut tensor = [0.0; 6];
            for &v in corners {
                if free > 0 && self.at_crease[v as usize] {
                    continue;
                }
                for (sum, &c) in tensor.iter_mut().zip(&self.at[v as usize].tensor) {
                    *sum += f64::from(c) / if free > 0 { free as f64 } else { 3.0 };
                }
            }
            let (ruling, curvature) = across(tensor, lie.normals[face]);
            self.rulings.push(ruling);
            self.curvatures.push(curvature);
        }
    }
}

/// The direction in a plane in which a tensor is largest, and how large it is there.
fn across(tensor: [f64; 6], normal: DVec3) -> (DVec3, f64) {
    if normal == DVec3::ZERO {
        return (DVec3::ZERO, 0.0);
    }
    let (u, v) = normal.any_orthonormal_pair();
    let [xx, yy, zz, xy, xz, yz] = tensor;
    let times = |d: DVec3| {
        DVec3::new(
            xx * d.x + xy * d.y + xz * d.z,
            xy * d.x + yy * d.y + yz * d.z,
            xz * d.x + yz * d.y + zz * d.z,
        )
    };
    let (tu, tv) = (times(u), times(v));
    let (a, b, c) = (u.dot(tu), u.dot(tv), v.dot(tv));
    let (middle, half) = (0.5 * (a + c), 0.5 * (a - c));
    let radius = half.hypot(b);
    let largest = if middle >= 0.0 { middle + radius } else { middle - radius };
    // Twice the angle of the eigenvector of the larger eigenvalue; of the smaller one it lies across.
    let angle = 0.5 * b.atan2(half) + if middle >= 0.0 { 0.0 } else { std::f64::consts::FRAC_PI_2 };
    (angle.cos() * u + angle.sin() * v, largest)
}
