//! The flat and curved regions of a sheet.
//!
//! A face is flat while its curvature is small beside that of something as large as the sheet, with a margin below and
//! above, so that it does not go to and fro. What lies together and is of one kind is a region; a fold parts regions,
//! whether or not it stops what vibrates. Regions that are too small to be one belong to what lies about them.

use glam::DVec3;

use super::bending::Bending;
use super::sheet::{Lie, NONE, Sheet};

/// A face becomes curved or flat when it is so by this factor.
pub(super) const MARGIN: f64 = 1.25;
/// What is less than this part of the sheet is no region of its own, where it has a neighbour.
pub(super) const LEAST_PART: f64 = 0.01;

/// What was curved so many seconds ago is so still, for what flips through being flat.
const REMEMBERED_S: f64 = 0.25;

/// The direction of the first side of a face, and that across it.
fn frame(sheet: &Sheet, lie: &Lie, face: usize) -> (DVec3, DVec3) {
    let [a, b, _] = sheet.triangles[face].map(|v| lie.points[v as usize]);
    let first = (b - a).normalize_or_zero();
    (first, lie.normals[face].cross(first))
}

/// A part of a sheet that is flat, or curved along rulings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// Its number, which stays with it from frame to frame.
    pub id: u32,
    /// Whether it is curved.
    pub is_curved: bool,
    /// Its area, in square metres.
    pub area_m2: f64,
}

/// A face that was curved.
#[derive(Debug, Clone, Copy)]
struct Bent {
    /// When.
    time_s: f64,
    /// Its ruling, along its first side and across.
    along: f64,
    across: f64,
    curvature: f64,
}

/// How a sheet falls into regions in one frame.
#[derive(Debug, Clone, Default)]
pub struct Regions {
    /// The regions.
    pub regions: Vec<Region>,
    /// The place among them of the region of each triangle.
    pub of: Vec<u32>,
    /// The direction of the ruling at each triangle, of length 1; of no meaning where it is flat.
    pub rulings: Vec<DVec3>,
    /// The curvature across it, in 1/m.
    pub curvatures: Vec<f64>,
    /// Whether each face is curved, before what is too small is given up.
    is_curved: Option<Vec<bool>>,
    kinds: Vec<bool>,
    /// How each face was last when it was curved.
    bent: Vec<Bent>,
    last: Vec<u32>,
    next_id: u32,
}

impl Regions {
    /// Finds the regions of a sheet as it lies now.
    pub(super) fn find(&mut self, time_s: f64, sheet: &Sheet, lie: &Lie, bending: &Bending, flat_rad: f64) {
        let flat_per_m = flat_rad / lie.size_m();
        match &mut self.is_curved {
            Some(is_curved) => {
                for (is_curved, curvature) in is_curved.iter_mut().zip(&bending.curvatures) {
                    let bound = if *is_curved { flat_per_m / MARGIN } else { flat_per_m * MARGIN };
                    *is_curved = curvature.abs() > bound;
                }
            }
            None => {
                self.is_curved = Some(bending.curvatures.iter().map(|c| c.abs() > flat_per_m).collect());
            }
        }
        self.kinds.clear();
        self.kinds.extend_from_slice(self.is_curved.as_deref().unwrap_or_default());
        let never = Bent { time_s: f64::NEG_INFINITY, along: 0.0, across: 0.0, curvature: 0.0 };
        self.bent.resize(self.kinds.len(), never);
        for (face, bent) in self.bent.iter_mut().enumerate() {
            if self.kinds[face] {
                let (first, second) = frame(sheet, lie, face);
                let (ruling, curvature) = (bending.rulings[face], bending.curvatures[face]);
                *bent = Bent { time_s, along: ruling.dot(first), across: ruling.dot(second), curvature };
            } else if time_s - bent.time_s > REMEMBERED_S {
                bent.time_s = f64::NEG_INFINITY;
            }
        }
        self.settle(sheet, lie, bending);
        self.rulings.clone_from(&bending.rulings);
        self.curvatures.clone_from(&bending.curvatures);
        let areas = self.part(sheet, lie, bending);
        self.name(&areas, lie);
    }

    /// The regions of a sheet as it was last when it was bent, within a quarter of a second.
    pub(super) fn bent(&self, sheet: &Sheet, lie: &Lie, bending: &Bending) -> Self {
        let mut regions = self.clone();
        for (face, bent) in self.bent.iter().enumerate() {
            let was_bent = bent.time_s > f64::NEG_INFINITY;
            regions.kinds[face] = was_bent;
            if was_bent {
                let (first, second) = frame(sheet, lie, face);
                regions.rulings[face] = bent.along * first + bent.across * second;
                regions.curvatures[face] = bent.curvature;
            }
        }
        regions.settle(sheet, lie, bending);
        let areas = regions.part(sheet, lie, bending);
        regions.name(&areas, lie);
        regions
    }

    /// Gives up what is too small.
    fn settle(&mut self, sheet: &Sheet, lie: &Lie, bending: &Bending) {
        // What is too small goes over to the other kind, the curved first.
        for _ in 0..2 {
            let areas = self.part(sheet, lie, bending);
            let least_m2 = LEAST_PART * lie.area_m2;
            let mut has_other = vec![false; areas.len()];
            for (index, edge) in sheet.edges.iter().enumerate() {
                if let Some([a, b]) = edge.inner().filter(|_| !bending.is_crease[index])
                    && self.kinds[a] != self.kinds[b]
                {
                    has_other[self.of[a] as usize] = true;
                    has_other[self.of[b] as usize] = true;
                }
            }
            let goes = |part: u32| has_other[part as usize] && areas[part as usize] < least_m2;
            if !self.of.iter().any(|&part| goes(part)) {
                break;
            }
            for (kind, &part) in self.kinds.iter_mut().zip(&self.of) {
                *kind ^= goes(part);
            }
        }
    }

    /// Takes regions that are known: that of each face, whether each is curved, and rulings of all faces.
    pub(super) fn take(
        &mut self,
        lie: &Lie,
        bending: &Bending,
        of: &[u32],
        is_curved: &[bool],
        rulings: &[DVec3],
    ) {
        self.of.clear();
        self.of.extend_from_slice(of);
        self.kinds.clear();
        self.kinds.extend(of.iter().map(|&region| is_curved[region as usize]));
        self.rulings.clear();
        self.rulings.extend_from_slice(rulings);
        self.curvatures.clone_from(&bending.curvatures);
        let mut areas = vec![0.0; is_curved.len()];
        for (face, &region) in of.iter().enumerate() {
            areas[region as usize] += lie.areas[face];
        }
        self.name(&areas, lie);
    }

    /// Parts the sheet by kinds and creases; gives the areas.
    fn part(&mut self, sheet: &Sheet, lie: &Lie, bending: &Bending) -> Vec<f64> {
        let kinds = &self.kinds;
        let joined = |index: usize, edge: &super::sheet::Edge| {
            !bending.is_crease[index] && edge.inner().is_some_and(|[a, b]| kinds[a] == kinds[b])
        };
        let count = sheet.parts(joined, &mut self.of);
        let mut areas = vec![0.0; count];
        for (face, &part) in self.of.iter().enumerate() {
            areas[part as usize] += lie.areas[face];
        }
        areas
    }

    /// Gives regions the numbers of those that they were, by what they share: the most first, each number once.
    fn name(&mut self, areas: &[f64], lie: &Lie) {
        let mut kinds = vec![false; areas.len()];
        let mut shared: Vec<(u32, u32, f64)> = Vec::with_capacity(self.of.len());
        for (face, &region) in self.of.iter().enumerate() {
            kinds[region as usize] = self.kinds[face];
            if let Some(&before) = self.last.get(face) {
                match shared.last_mut() {
                    Some(last) if (last.0, last.1) == (region, before) => last.2 += lie.areas[face],
                    _ => shared.push((region, before, lie.areas[face])),
                }
            }
        }
        shared.sort_unstable_by_key(|&(region, before, _)| (region, before));
        shared.dedup_by(|from, into| {
            let same = (from.0, from.1) == (into.0, into.1);
            into.2 += if same { from.2 } else { 0.0 };
            same
        });
        shared.sort_by(|a, b| b.2.total_cmp(&a.2).then((a.0, a.1).cmp(&(b.0, b.1))));
        let mut ids = vec![NONE; areas.len()];
        let mut taken = std::collections::HashSet::new();
        for (region, before, _) in shared {
            if ids[region as usize] == NONE && taken.insert(before) {
                ids[region as usize] = before;
            }
        }
        for id in ids.iter_mut().filter(|id| **id == NONE) {
            *id = self.next_id;
            self.next_id = self.next_id.wrapping_add(1);
        }
        self.regions.clear();
        let regions = ids.iter().zip(&kinds).zip(areas);
        self.regions.extend(regions.map(|((&id, &is_curved), &area_m2)| Region { id, is_curved, area_m2 }));
        self.last.clear();
        self.last.extend(self.of.iter().map(|&region| ids[region as usize]));
    }
}
