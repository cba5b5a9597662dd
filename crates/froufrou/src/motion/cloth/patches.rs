//! A cloth in patches, each of which is heard from a place of its own.

use glam::DVec3;

/// The patches of a cloth.
#[derive(Debug, Clone, Default)]
pub(super) struct Patches {
    /// That of every vertex.
    of: Vec<u32>,
    /// How many there are.
    count: usize,
}

impl Patches {
    /// Each vertex belongs to the nearest of some vertices that are as far apart as can be.
    pub fn new(positions: &[[f32; 3]], count: usize) -> Self {
        let of = patches(positions, count);
        let count = of.iter().max().map_or(0, |last| *last as usize + 1);
        Self { of, count }
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.count
    }

    /// That of a vertex.
    pub fn of(&self, vertex: u32) -> u32 {
        self.of.get(vertex as usize).copied().unwrap_or_default()
    }

    /// The middles of all of them, as their vertices lie now.
    pub fn middles(&self, positions: &[[f32; 3]]) -> Vec<DVec3> {
        let mut sums = vec![(DVec3::ZERO, 0.0f64); self.count];
        for (&patch, position) in self.of.iter().zip(positions) {
            let sum = &mut sums[patch as usize];
            sum.0 += DVec3::from(position.map(f64::from));
            sum.1 += 1.0;
        }
        sums.into_iter().map(|(sum, count)| sum / count.max(1.0)).collect()
    }
}

/// The patch of every vertex.
fn patches(positions: &[[f32; 3]], count: usize) -> Vec<u32> {
    let at = |index: usize| DVec3::from(positions[index].map(f64::from));
    let mut nearest = vec![(f64::INFINITY, 0); positions.len()];
    // The first is that which is farthest from the middle: a corner, as a rule.
    let middle = (0..positions.len()).map(at).sum::<DVec3>() / positions.len().max(1) as f64;
    let farthest = |distance: &dyn Fn(usize) -> f64| {
        // Of those that are as far the first.
        (0..positions.len()).rev().max_by(|&a, &b| distance(a).total_cmp(&distance(b)))
    };
    let mut seed = farthest(&|index| at(index).distance_squared(middle));
    for patch in 0..count.max(1) {
        let Some(place) = seed.map(at) else { break };
        for (index, (squared_m2, of)) in nearest.iter_mut().enumerate() {
            let here_m2 = at(index).distance_squared(place);
            if here_m2 < *squared_m2 {
                (*squared_m2, *of) = (here_m2, patch as u32);
            }
        }
        seed = farthest(&|index| nearest[index].0).filter(|&index| nearest[index].0 > 0.0);
    }
    nearest.into_iter().map(|(_, of)| of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_cover_a_sheet_about_evenly() {
        let positions: Vec<[f32; 3]> = (0..400).map(|i| [(i % 20) as f32, (i / 20) as f32, 0.0]).collect();
        let found = patches(&positions, 16);
        let counts: Vec<usize> = (0..16).map(|patch| found.iter().filter(|p| **p == patch).count()).collect();
        assert!(counts.iter().all(|count| (8..60).contains(count)), "{counts:?}");
        // Nobody is farther from the middle of its patch than a quarter of the sheet.
        for patch in 0..16 {
            let members: Vec<DVec3> = (0..400)
                .filter(|&i| found[i] == patch)
                .map(|i| DVec3::from(positions[i].map(f64::from)))
                .collect();
            let middle = members.iter().sum::<DVec3>() / members.len() as f64;
            assert!(members.iter().all(|p| p.distance(middle) < 5.0));
        }
    }

    #[test]
    fn there_are_no_more_patches_than_places() {
        assert!(patches(&[], 4).is_empty());
        assert_eq!(patches(&[[1.0; 3]; 5], 4), [0; 5]);
        let two = patches(&[[0.0; 3], [1.0; 3], [0.0; 3]], 4);
        assert!(two[0] == two[2] && two[0] != two[1]);
    }
}
