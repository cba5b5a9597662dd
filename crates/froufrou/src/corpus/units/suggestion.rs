//! Correspondences where nobody named any: from how the features of target and recordings are distributed.
//!
//! Both are gathered into as many clusters (k-means, begun with units far from one another), each in the scale of its own
//! mean and spread. Clusters are then transported onto one another at the least cost: the squared distance times the
//! share of units that goes from one to the other (entropic optimal transport, by Sinkhorn's iteration). Where a cluster
//! of the target goes is the mean of what its share goes to. So loudness that is usual in the target goes to what is usual
//! in the recordings, and what is rare to what is rare, whatever the numbers are.
//!
//! A suggestion is also a pair of clips: those of a given length that keep nearest to the cluster and to where it goes.

use rayon::prelude::*;

use super::features::Features;
use crate::error::{Error, Result};

/// How many units of many are looked at, how often clusters are moved, and how often transport is balanced.
const MOST_UNITS: usize = 8192;
const ROUNDS: usize = 40;
const BALANCES: usize = 500;

/// How soft transport is, as a share of the mean cost.
const SOFTNESS: f64 = 0.02;

/// What stands for a cluster of the target.
#[derive(Debug, Clone, PartialEq)]
pub struct Suggestion {
    /// Where the cluster is.
    pub from: Vec<f64>,
    /// Where it should go.
    pub to: Vec<f64>,
    /// The share of the target's units that it has.
    pub share: f64,
    /// The lane of the target and the first unit there of a clip that is near to the cluster.
    pub target: (usize, usize),
    /// The first unit of a clip of the recordings that is near to where it goes.
    pub source: usize,
}

/// Suggests so many correspondences of clips of so many units, those of the most units first.
///
/// # Errors
/// Where there are no units, or lanes that have not as many dimensions as the recordings.
pub fn suggest(
    target: &[Features],
    source: &Features,
    streams: &[usize],
    count: usize,
    clip_units: usize,
) -> Result<Vec<Suggestion>> {
    let d = source.dimensions();
    if let Some(lane) = target.iter().find(|lane| lane.dimensions() != d) {
        let what =
            format!("the target's features have {} dimensions, the recordings' {d}", lane.dimensions());
        return Err(Error::new(what));
    }
    let all: Vec<&[f32]> = target.iter().flat_map(Features::rows).collect();
    let theirs: Vec<&[f32]> = source.rows().collect();
    if all.is_empty() || theirs.is_empty() || count == 0 {
        return Err(Error::new("there is nothing to suggest correspondences for"));
    }
    let (ours, recorded) = (Clusters::of(&all, d, count), Clusters::of(&theirs, d, count));
    let goes = transport(&ours, &recorded, d);
    let suggestions: Vec<Suggestion> = ours
        .centres
        .chunks_exact(d)
        .zip(goes.chunks_exact(d))
        .zip(&ours.shares)
        .filter(|(_, share)| **share > 0.0)
        .map(|((from, to), &share)| Suggestion {
            from: ours.plain(from),
            to: recorded.plain(to),
            share,
            target: (0, 0),
            source: 0,
        })
        .collect();
    let mut suggestions: Vec<Suggestion> = suggestions
        .into_par_iter()
        .map(|suggestion| {
            let clips = target.iter().enumerate().map(|(lane, features)| {
                let lengths = [features.len()];
                let (unit, distance) = clip(features, &lengths, clip_units, &suggestion.from, &ours.spread);
                (distance, lane, unit)
            });
            let nearest = clips.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default();
            let (unit, _) = clip(source, streams, clip_units, &suggestion.to, &recorded.spread);
            Suggestion { target: (nearest.1, nearest.2), source: unit, ..suggestion }
        })
        .collect();
    suggestions.sort_by(|a, b| b.share.total_cmp(&a.share).then(a.target.cmp(&b.target)));
    Ok(suggestions)
}

/// Clusters in the scale of a mean and a spread.
struct Clusters {
    mean: Vec<f64>,
    spread: Vec<f64>,
    /// Row by row, in that scale.
    centres: Vec<f64>,
    shares: Vec<f64>,
}

impl Clusters {
    fn of(rows: &[&[f32]], d: usize, count: usize) -> Self {
        let step = rows.len().div_ceil(MOST_UNITS);
        let some: Vec<&&[f32]> = rows.iter().step_by(step).collect();
        let n = some.len() as f64;
        let mean: Vec<f64> =
            (0..d).map(|k| some.iter().map(|row| f64::from(row[k])).sum::<f64>() / n).collect();
        let spread: Vec<f64> = (0..d)
            .map(|k| {
                let squares: f64 = some.iter().map(|row| (f64::from(row[k]) - mean[k]).powi(2)).sum();
                Some((squares / n).sqrt()).filter(|spread| *spread > 1e-9).unwrap_or(1.0)
            })
            .collect();
        let scaled: Vec<f64> = some
            .iter()
            .flat_map(|row| (0..d).map(|k| (f64::from(row[k]) - mean[k]) / spread[k]).collect::<Vec<_>>())
            .collect();
        let mut centres = far_apart(&scaled, d, count);
        let mut counts = Vec::new();
        for _ in 0..ROUNDS {
            let nearest: Vec<usize> =
                scaled.par_chunks_exact(d).map(|row| nearest(&centres, row).0).collect();
            let mut sums = vec![0.0; centres.len()];
            counts = vec![0.0; centres.len() / d];
            for (row, &cluster) in scaled.chunks_exact(d).zip(&nearest) {
                counts[cluster] += 1.0;
                sums[cluster * d..][..d].iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
            }
            let before = centres.clone();
            for (cluster, count) in counts.iter().enumerate().filter(|(_, count)| **count > 0.0) {
                let centre = centres[cluster * d..][..d].iter_mut();
                centre.zip(&sums[cluster * d..]).for_each(|(centre, sum)| *centre = sum / count);
            }
            if before == centres {
                break;
            }
        }
        let shares = counts.iter().map(|count| count / n).collect();
        Self { mean, spread, centres, shares }
    }

    /// In the scale of features.
    fn plain(&self, row: &[f64]) -> Vec<f64> {
        row.iter().zip(&self.spread).zip(&self.mean).map(|((v, spread), mean)| v * spread + mean).collect()
    }
}

fn squared(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

fn nearest(centres: &[f64], row: &[f64]) -> (usize, f64) {
    let distances = centres.chunks_exact(row.len()).map(|centre| squared(centre, row)).enumerate();
    distances.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, 0.0))
}

/// Rows of which each is the one farthest from those before; the first is the one nearest to the mean.
fn far_apart(rows: &[f64], d: usize, count: usize) -> Vec<f64> {
    let (first, _) = nearest(rows, &vec![0.0; d]);
    let mut chosen = rows[first * d..][..d].to_vec();
    let mut distances = vec![f64::INFINITY; rows.len() / d];
    while chosen.len() < count * d {
        let last = chosen[chosen.len() - d..].to_vec();
        for (distance, row) in distances.iter_mut().zip(rows.chunks_exact(d)) {
            *distance = distance.min(squared(row, &last));
        }
        let farthest = distances.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1).then(b.0.cmp(&a.0)));
        match farthest.filter(|(_, distance)| **distance > 0.0) {
            Some((unit, _)) => chosen.extend_from_slice(&rows[unit * d..][..d]),
            None => break,
        }
    }
    chosen
}

/// Where clusters go, row by row.
fn transport(ours: &Clusters, theirs: &Clusters, d: usize) -> Vec<f64> {
    let costs: Vec<Vec<f64>> = ours
        .centres
        .chunks_exact(d)
        .map(|a| theirs.centres.chunks_exact(d).map(|b| squared(a, b)).collect())
        .collect();
    let mean = costs.iter().flatten().sum::<f64>() / costs.iter().map(Vec::len).sum::<usize>().max(1) as f64;
    let soft = (SOFTNESS * mean).max(1e-12);
    let (rows, columns) = (ours.shares.len(), theirs.shares.len());
    // In logarithms: shares of far clusters are smaller than numbers go.
    let log_sum = |values: &mut dyn Iterator<Item = f64>| {
        let values: Vec<f64> = values.collect();
        let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if most.is_finite() { most + values.iter().map(|v| (v - most).exp()).sum::<f64>().ln() } else { most }
    };
    let log = |share: &f64| if *share > 0.0 { share.ln() } else { -1e9 };
    let (mut a, mut b) = (vec![0.0; rows], vec![0.0; columns]);
    for _ in 0..BALANCES {
        for (i, a) in a.iter_mut().enumerate() {
            *a = log(&ours.shares[i]) - log_sum(&mut (0..columns).map(|j| b[j] - costs[i][j] / soft));
        }
        for (j, b) in b.iter_mut().enumerate() {
            *b = log(&theirs.shares[j]) - log_sum(&mut (0..rows).map(|i| a[i] - costs[i][j] / soft));
        }
    }
    let mut goes = Vec::with_capacity(rows * d);
    for (i, costs) in costs.iter().enumerate() {
        let logs: Vec<f64> = (0..columns).map(|j| a[i] + b[j] - costs[j] / soft).collect();
        let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<f64> = logs.iter().map(|log| (log - most).exp()).collect();
        let sum: f64 = weights.iter().sum();
        for k in 0..d {
            let part = weights.iter().zip(theirs.centres.chunks_exact(d)).map(|(w, centre)| w * centre[k]);
            goes.push(part.sum::<f64>() / sum);
        }
    }
    goes
}

/// The first unit of the clip that keeps nearest to a place, and its mean squared distance, in units of the spread.
fn clip(features: &Features, streams: &[usize], units: usize, place: &[f64], spread: &[f64]) -> (usize, f64) {
    let distance = |row: &[f32]| -> f64 {
        let parts = row.iter().zip(place).zip(spread);
        parts.map(|((value, place), spread)| ((f64::from(*value) - place) / spread).powi(2)).sum()
    };
    let distances: Vec<f64> = features.rows().map(distance).collect();
    let (mut start, mut best) = (0, (0, f64::INFINITY));
    for &length in streams {
        let here = &distances[start..start + length];
        let units = units.clamp(1, length.max(1));
        // Sums are made anew every so often, so that rounding does not pile up.
        for block in (0..(length + 1).saturating_sub(units)).step_by(256) {
            let mut sum: f64 = here[block..block + units].iter().sum();
            for first in block..(block + 256).min(length + 1 - units) {
                if first > block {
                    sum += here[first + units - 1] - here[first - 1];
                }
                let mean = sum / units as f64;
                if mean < best.1 {
                    best = (start + first, mean);
                }
            }
        }
        start += length;
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::corpus::units::selection::tests::wandering;
    use crate::corpus::units::warp::Warp;

    fn moments(rows: &[f64], d: usize) -> Vec<(f64, f64)> {
        let n = (rows.len() / d) as f64;
        (0..d)
            .map(|k| {
                let mean = rows.iter().skip(k).step_by(d).sum::<f64>() / n;
                let squares: f64 = rows.iter().skip(k).step_by(d).map(|v| (v - mean).powi(2)).sum();
                (mean, (squares / n).sqrt())
            })
            .collect()
    }

    /// A target of the same kind, but elsewhere and of another size, is carried to the recordings.
    #[test]
    fn a_warp_of_suggestions_brings_the_distributions_together() {
        let source = wandering(1, 6000, 3, 12.0, 0.0);
        let other = wandering(2, 3000, 3, 12.0, 0.0);
        let moved = |v: &f32, k: usize| [0.3, 2.0, 1.0][k] * v + [-8.0, 4.0, 0.5][k];
        let values = other.values().iter().enumerate().map(|(i, v)| moved(v, i % 3)).collect();
        let target = Features::new(3, values);
        let found = suggest(std::slice::from_ref(&target), &source, &[6000], 24, 30).unwrap();
        assert!((found.iter().map(|s| s.share).sum::<f64>() - 1.0).abs() < 1e-9);
        let flat = |of: &dyn Fn(&Suggestion) -> &Vec<f64>| {
            found.iter().flat_map(|s| of(s).clone()).collect::<Vec<_>>()
        };
        let warp = Warp::fit(3, &flat(&|s| &s.from), &flat(&|s| &s.to), 1.0).unwrap();
        let warped = warp.apply_all(&target).unwrap();
        let plain: Vec<f64> = source.values().iter().map(|v| f64::from(*v)).collect();
        for ((mean, spread), (wanted, wanted_spread)) in moments(&warped, 3).iter().zip(moments(&plain, 3)) {
            assert!((mean - wanted).abs() < 0.25 * wanted_spread, "{mean} {wanted}");
            assert!((0.6..1.4).contains(&(spread / wanted_spread)), "{spread} {wanted_spread}");
        }
        // Clips keep near to what they stand for.
        for suggestion in found.iter().take(5) {
            let (lane, unit) = suggestion.target;
            assert!(lane == 0 && unit + 30 <= 3000 && suggestion.source + 30 <= 6000);
        }
        assert_eq!(found, suggest(&[target], &source, &[6000], 24, 30).unwrap());
    }

    #[test]
    fn clips_stay_within_streams_and_few_units_are_enough() {
        let source = wandering(3, 40, 2, 0.0, 0.0);
        for suggestion in suggest(std::slice::from_ref(&source), &source, &[25, 15], 6, 10).unwrap() {
            let start = suggestion.source;
            assert!(start + 10 <= 25 || (25..=30).contains(&start), "{start}");
        }
        let one = Features::new(2, vec![1.0, 2.0]);
        let found = suggest(std::slice::from_ref(&one), &source, &[40], 5, 30).unwrap();
        assert_eq!((found.len(), &found[0].from), (1, &vec![1.0, 2.0]));
        assert!(suggest(&[], &source, &[40], 5, 30).is_err());
        assert!(suggest(&[Features::new(3, vec![0.0; 3])], &source, &[40], 5, 30).is_err());
        assert!(found[0].to.iter().all(|v| v.is_finite()));
    }
}
