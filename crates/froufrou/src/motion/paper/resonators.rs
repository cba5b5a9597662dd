//! What an event makes vibrate (Schreck et al. 2016, sections 4 and 5).
//!
//! Vibration goes from region to region, and stops where the sheet ends, at ridges, at edges with a point that is held
//! and at edges that touch something. Within a curved region such an edge cuts it, and only the part beside the event
//! vibrates; a flat region vibrates as a whole. All faces are parted twice: into *pieces*, each of which is a region or
//! what was cut from one, and into *pools* of pieces among which vibration spreads. The resonators of an event are the
//! pieces of its pools.

use glam::DVec3;

use super::bending::Bending;
use super::holding::Holding;
use super::regions::{LEAST_PART, Regions};
use super::sheet::{Edge, Lie, NONE, Sheet};
use crate::motion::cloth::triangulation::Triangulation;
use crate::motion::event::Resonator;

/// So many rulings of a piece are measured at most.
const RULINGS: usize = 48;
/// A border that goes along the rulings to within this angle is not curved: 15°, as its sine.
const ALONG: f64 = 0.26;

/// How far beside a border it goes on, in parts of an edge.
const BESIDE: f64 = 1e-4;

/// What vertices of a sheet are hindered by.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Hold {
    pub is_held: bool,
    pub touches: bool,
}

/// The parts among which vibration spreads, in one frame.
#[derive(Debug, Clone, Default)]
pub(super) struct Spreading {
    /// Of each edge, whether vibration stops there.
    stops: Vec<bool>,
    piece_of: Vec<u32>,
    pool_of: Vec<u32>,
    /// The faces of each piece, one piece after the other, and where each begins.
    faces: Vec<u32>,
    starts: Vec<u32>,
    /// Of each piece: its pool and area.
    pools: Vec<u32>,
    areas: Vec<f64>,
    pool_areas: Vec<f64>,
    /// What is known of a piece already.
    resonators: Vec<Option<Resonator>>,
}

/// All that is known of a sheet in one frame.
#[derive(Clone, Copy)]
pub(super) struct Seen<'a> {
    pub sheet: &'a Sheet,
    pub lie: &'a Lie,
    pub regions: &'a Regions,
    pub is_ridge: &'a [bool],
    pub holds: &'a [Hold],
    pub flat_rad: f64,
}

impl<'a> Seen<'a> {
    /// A sheet as it lies, is bent and is held now; what turns by less than `flat_rad` over its size is flat.
    pub fn new(
        sheet: &'a Sheet,
        lie: &'a Lie,
        regions: &'a Regions,
        bending: &'a Bending,
        holding: &'a Holding,
        flat_rad: f64,
    ) -> Self {
        Self { sheet, lie, regions, is_ridge: &bending.is_ridge, holds: &holding.holds, flat_rad }
    }

    fn hold(&self, vertex: u32) -> Hold {
        self.holds.get(vertex as usize).copied().unwrap_or_default()
    }

    fn all(&self, face: usize, is: impl Fn(Hold) -> bool) -> bool {
        self.sheet.triangles[face].iter().all(|&v| is(self.hold(v)))
    }

    /// Whether what is held or touched stops vibration at an edge. What lies on something with all of it hangs
    /// together.
    fn stops(&self, edge: &Edge) -> bool {
        let Some(faces) = edge.inner() else { return true };
        let held = edge.ends.iter().any(|&v| self.hold(v).is_held);
        let touching = edge.ends.iter().all(|&v| self.hold(v).touches);
        let both = |is: fn(Hold) -> bool| faces.iter().all(|&face| self.all(face, is));
        held && !both(|hold| hold.is_held) || touching && !both(|hold| hold.touches)
    }

    fn is_curved(&self, face: usize) -> bool {
        let region = self.regions.of[face] as usize;
        self.regions.regions[region].is_curved
    }
}

impl Spreading {
    /// Parts a sheet as it is now.
    pub fn part(&mut self, seen: Seen<'_>) {
        let Seen { sheet, lie, regions, is_ridge, .. } = seen;
        self.stops.clear();
        self.stops
            .extend(sheet.edges.iter().zip(is_ridge).map(|(edge, is_ridge)| *is_ridge || seen.stops(edge)));
        let stops = &self.stops;
        let same = |edge: &Edge| {
            edge.inner().filter(|[a, b]| regions.of[*a] == regions.of[*b]).map(|[face, _]| face)
        };
        let is_whole = |index: usize, face: usize| !is_ridge[index] && !seen.is_curved(face);
        let count = sheet.parts(
            |index, edge| same(edge).is_some_and(|face| !stops[index] || is_whole(index, face)),
            &mut self.piece_of,
        );
        let pool_count = sheet.parts(
            |index, edge| !stops[index] || same(edge).is_some_and(|face| is_whole(index, face)),
            &mut self.pool_of,
        );
        self.areas.clear();
        self.areas.resize(count, 0.0);
        self.pools.clear();
        self.pools.resize(count, 0);
        self.pool_areas.clear();
        self.pool_areas.resize(pool_count, 0.0);
        self.starts.clear();
        self.starts.resize(count + 1, 0);
        for (face, &piece) in self.piece_of.iter().enumerate() {
            self.areas[piece as usize] += lie.areas[face];
            self.pools[piece as usize] = self.pool_of[face];
            self.pool_areas[self.pool_of[face] as usize] += lie.areas[face];
            self.starts[piece as usize + 1] += 1;
        }
        for piece in 0..count {
            self.starts[piece + 1] += self.starts[piece];
        }
        let mut next = self.starts.clone();
        self.faces.clear();
        self.faces.resize(self.piece_of.len(), 0);
        for (face, &piece) in self.piece_of.iter().enumerate() {
            self.faces[next[piece as usize] as usize] = face as u32;
            next[piece as usize] += 1;
        }
        self.resonators.clear();
        self.resonators.resize(count, None);
    }

    /// The pool to which a vertex belongs: the largest about it; none where there are only scraps.
    pub fn pool_of(&self, seen: Seen<'_>, vertex: u32) -> Option<u32> {
        let area = |pool: u32| self.pool_areas[pool as usize];
        let pools = seen.sheet.faces_at(vertex).iter().map(|&face| self.pool_of[face as usize]);
        let largest = pools.max_by(|&a, &b| area(a).total_cmp(&area(b)).then(b.cmp(&a)));
        largest.filter(|&pool| area(pool) >= LEAST_PART * seen.lie.area_m2)
    }

    /// The pools to which all vertices belong. What is held, or beside what is, belongs to what it holds.
    pub fn pools(&self, seen: Seen<'_>, surface: &Triangulation, pools: &mut Vec<u32>) {
        let count = seen.sheet.vertex_count;
        pools.clear();
        pools.extend((0..count as u32).map(|vertex| self.pool_of(seen, vertex).unwrap_or(NONE)));
        let area = |pool: u32| self.pool_areas[pool as usize];
        let beside = |vertex: u32| {
            let around = surface.ring(vertex).iter().chain([&vertex]).map(|&other| pools[other as usize]);
            around.filter(|&pool| pool != NONE).max_by(|&a, &b| area(a).total_cmp(&area(b)).then(b.cmp(&a)))
        };
        let is_scrap = |&vertex: &u32| seen.hold(vertex).is_held || pools[vertex as usize] == NONE;
        let found: Vec<(u32, u32)> =
            (0..count as u32).filter(is_scrap).filter_map(|vertex| Some((vertex, beside(vertex)?))).collect();
        for (vertex, pool) in found {
            pools[vertex as usize] = pool;
        }
    }

    /// The resonators of an event at some vertices: all pieces of the pools about them, the largest first. Scraps
    /// beside what is held or touched are left out, if there is anything else.
    pub fn resonators(&mut self, seen: Seen<'_>, vertices: impl Iterator<Item = u32>) -> Vec<Resonator> {
        let mut is_in = vec![false; self.pool_areas.len()];
        for vertex in vertices {
            for &face in seen.sheet.faces_at(vertex) {
                is_in[self.pool_of[face as usize] as usize] = true;
            }
        }
        self.pieces(seen, &is_in)
    }

    fn pieces(&mut self, seen: Seen<'_>, is_in: &[bool]) -> Vec<Resonator> {
        let mut pieces: Vec<usize> =
            (0..self.pools.len()).filter(|&p| is_in[self.pools[p] as usize]).collect();
        pieces.sort_by(|&a, &b| self.areas[b].total_cmp(&self.areas[a]).then(a.cmp(&b)));
        let least_m2 = LEAST_PART * seen.lie.area_m2;
        let count = pieces.iter().filter(|&&piece| self.areas[piece] >= least_m2).count();
        pieces.truncate(count.max(1));
        pieces.retain(|&piece| self.areas[piece] > 0.0);
        pieces.into_iter().map(|piece| self.resonator(seen, piece)).collect()
    }

    /// The resonators of a crumpling of some vertices: those of the pools to which these belong.
    pub fn beside(&mut self, seen: Seen<'_>, vertices: &[u32]) -> Vec<Resonator> {
        let mut is_in = vec![false; self.pool_areas.len()];
        for pool in vertices.iter().filter_map(|&vertex| self.pool_of(seen, vertex)) {
            is_in[pool as usize] = true;
        }
        self.pieces(seen, &is_in)
    }

    fn resonator(&mut self, seen: Seen<'_>, piece: usize) -> Resonator {
        if let Some(known) = self.resonators[piece] {
            return known;
        }
        let Seen { sheet, lie, .. } = seen;
        let faces = &self.faces[self.starts[piece] as usize..self.starts[piece + 1] as usize];
        let area_m2 = self.areas[piece];
        let (mut centre, mut normal) = (DVec3::ZERO, DVec3::ZERO);
        for &face in faces {
            let (face, area) = (face as usize, lie.areas[face as usize]);
            centre += area * lie.middle(sheet, face);
            normal += area * lie.normals[face];
        }
        let any = || faces.iter().map(|&face| lie.normals[face as usize]).find(|n| *n != DVec3::ZERO);
        let normal = normal.try_normalize().or_else(any).unwrap_or(DVec3::Y);
        let is_curved = faces.first().is_some_and(|&face| seen.is_curved(face as usize));
        let (ruling_m, border_m) = if is_curved {
            (self.ruling_m(seen, faces, area_m2), border_m(seen, faces))
        } else {
            (area_m2.sqrt(), 0.0)
        };
        let position_m = (centre / area_m2).to_array();
        let found = Resonator { ruling_m, border_m, area_m2, position_m, normal: normal.to_array() };
        self.resonators[piece] = Some(found);
        found
    }

    /// The mean length of the rulings of a piece, each by the width between it and the next. They are followed from
    /// their ends, which lie evenly where vibration stops.
    fn ruling_m(&self, seen: Seen<'_>, faces: &[u32], area_m2: f64) -> f64 {
        let Seen { sheet, lie, regions, .. } = seen;
        // The ends: a face, its side, the ruling there, and the width across rulings.
        let mut ends = Vec::new();
        let mut width = 0.0;
        for &face in faces {
            let face = face as usize;
            let ruling = regions.rulings[face].reject_from_normalized(lie.normals[face]).normalize_or_zero();
            for (side, &edge) in sheet.face_edges[face].iter().enumerate() {
                if !self.stops[edge as usize] || ruling == DVec3::ZERO {
                    continue;
                }
                let [a, b] = [side, (side + 1) % 3].map(|at| lie.points[sheet.triangles[face][at] as usize]);
                let inward = lie.normals[face].cross(b - a);
                let across = ruling.dot(inward);
                // Borders along rulings are not ends of any.
                if across.abs() <= ALONG * inward.length() {
                    continue;
                }
                width += across.abs();
                ends.push((width, face, edge, 0.5 * (a + b), if across < 0.0 { -ruling } else { ruling }));
            }
        }
        let (mut sum, mut count) = (0.0, 0.0);
        let mut next = 0;
        for (passed, face, edge, middle, direction) in ends {
            let due = (passed / width * RULINGS as f64 + 0.5).floor();
            if due > f64::from(next) {
                let weight = due - f64::from(next);
                next = due as u32;
                sum += weight * self.walk_m(sheet, lie, face, edge, middle, direction);
                count += weight;
            }
        }
        if sum > 0.0 { sum / count } else { area_m2.sqrt() }
    }

    /// How far it is straight on from a point of an edge into a face, along the surface, to where vibration stops.
    fn walk_m(&self, sheet: &Sheet, lie: &Lie, face: usize, edge: u32, from: DVec3, direction: DVec3) -> f64 {
        let (mut face, mut entered, mut at, mut ahead) = (face, edge, from, direction);
        let mut way = 0.0;
        for _ in 0..sheet.triangles.len() {
            let (corners, normal) = (sheet.triangles[face], lie.normals[face]);
            if normal == DVec3::ZERO {
                return way;
            }
            let mut best: Option<(f64, usize)> = None;
            for side in 0..3 {
                if sheet.face_edges[face][side] == entered {
                    continue;
                }
                let [a, b] = [corners[side], corners[(side + 1) % 3]].map(|v| lie.points[v as usize]);
                let outward = (b - a).cross(normal);
                let speed = ahead.dot(outward);
                if speed > 0.0 {
                    let time = ((a - at).dot(outward) / speed).max(0.0);
                    if best.is_none_or(|(soonest, _)| time < soonest) {
                        best = Some((time, side));
                    }
                }
            }
            let Some((time, side)) = best else { return way };
            way += time;
            at += time * ahead;
            let edge = sheet.face_edges[face][side];
            let [a, b] = [corners[side], corners[(side + 1) % 3]].map(|v| lie.points[v as usize]);
            let along = (b - a).normalize_or_zero();
            let next = sheet.across(face, edge).filter(|_| !self.stops[edge as usize]);
            let Some(next) = next else {
                // Where rulings go along a border, one that is a little askew goes on beside it.
                let part = ahead.dot(along);
                if along == DVec3::ZERO || part * part < 1.0 - ALONG * ALONG {
                    return way;
                }
                ahead = along * part.signum();
                at += normal.cross(along) * (BESIDE * a.distance(b));
                entered = NONE;
                continue;
            };
            // Straight on over the edge: what goes along it stays, what goes across is turned into the next face.
            // Neighbours wind alike, so that their edge lies the other way round in the next.
            let inward = along.cross(lie.normals[next])
                * if winds_alike(sheet, next, edge, corners[side]) { 1.0 } else { -1.0 };
            let part = ahead.dot(along).clamp(-1.0, 1.0);
            ahead = (part * along + (1.0 - part * part).sqrt() * inward).normalize_or_zero();
            (face, entered) = (next, edge);
        }
        way
    }
}

/// Whether a face passes an edge towards a vertex, as the neighbour of a face does that passes it from there.
fn winds_alike(sheet: &Sheet, face: usize, edge: u32, towards: u32) -> bool {
    let side = sheet.face_edges[face].iter().position(|&e| e == edge).unwrap_or_default();
    sheet.triangles[face][(side + 1) % 3] == towards
}

/// The length of the free curved borders of a piece.
fn border_m(seen: Seen<'_>, faces: &[u32]) -> f64 {
    let Seen { sheet, lie, regions, flat_rad, .. } = seen;
    let flat_per_m = flat_rad / lie.size_m();
    let mut sum = 0.0;
    for &face in faces {
        let face = face as usize;
        for index in sheet.face_edges[face] {
            let (edge, length) = (&sheet.edges[index as usize], lie.lengths[index as usize]);
            let holds = edge.ends.map(|v| seen.hold(v));
            if !edge.is_border || length == 0.0 || holds.iter().any(|hold| hold.is_held) {
                continue;
            }
            let along = (lie.points[edge.ends[1] as usize] - lie.points[edge.ends[0] as usize]) / length;
            let sine_squared = 1.0 - regions.rulings[face].dot(along).powi(2);
            let is_curved = sine_squared > ALONG * ALONG
                && regions.curvatures[face].abs() * sine_squared > flat_per_m / super::regions::MARGIN;
            if is_curved {
                // Where it comes to lie on something one of its ends does.
                sum += length * 0.5 * holds.iter().filter(|hold| !hold.touches).count() as f64;
            }
        }
    }
    sum
}
