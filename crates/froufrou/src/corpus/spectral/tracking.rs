//! Peaks of neighbouring frames become partials.

use super::{Key, Partial, SpectralModel};

/// Joins the peaks of all frames, each frame's by falling amplitude. The loudest peak goes first to the partial that is
/// nearest in frequency and not yet taken; what finds none is born, what is not found dies.
pub(super) fn follow(model: &SpectralModel, frames: &[Vec<Key>], hop_s: f64) -> Vec<Partial> {
    let mut done: Vec<Partial> = Vec::new();
    // Those that sound, by rising frequency of their last key.
    let mut alive: Vec<Partial> = Vec::new();
    for (frame, peaks) in frames.iter().enumerate() {
        let mut taken = vec![false; alive.len()];
        let mut next: Vec<Partial> = Vec::with_capacity(peaks.len());
        let frequencies: Vec<f64> = alive.iter().map(last_hz).collect();
        for key in peaks {
            let reach = model.deviation_hz + model.deviation_slope * key.frequency_hz;
            match nearest_free(&frequencies, &taken, key.frequency_hz, reach) {
                Some(index) => {
                    taken[index] = true;
                    let keys = std::mem::take(&mut alive[index].keys);
                    next.push(Partial { first_frame: alive[index].first_frame, keys });
                    if let Some(partial) = next.last_mut() {
                        partial.keys.push(*key);
                    }
                }
                None => next.push(Partial { first_frame: frame, keys: vec![*key] }),
            }
        }
        done.extend(alive.into_iter().zip(taken).filter(|(_, taken)| !taken).map(|(partial, _)| partial));
        next.sort_by(|a, b| last_hz(a).total_cmp(&last_hz(b)));
        alive = next;
    }
    done.append(&mut alive);
    let shortest = (model.shortest_s / hop_s).ceil() as usize;
    done.retain(|partial| partial.keys.len() >= shortest.min(frames.len()));
    done.sort_by(|a, b| {
        let key = |p: &Partial| (p.first_frame, p.keys.first().map_or(0.0, |k| k.frequency_hz));
        let ((fa, ha), (fb, hb)) = (key(a), key(b));
        fa.cmp(&fb).then(ha.total_cmp(&hb))
    });
    done
}

fn last_hz(partial: &Partial) -> f64 {
    partial.keys.last().map_or(0.0, |key| key.frequency_hz)
}

/// The nearest frequency that is free and within reach, of frequencies that rise.
fn nearest_free(frequencies: &[f64], taken: &[bool], wanted: f64, reach: f64) -> Option<usize> {
    let middle = frequencies.partition_point(|&f| f < wanted);
    let below = (0..middle).rev().find(|&i| !taken[i] || wanted - frequencies[i] > reach);
    let above = (middle..frequencies.len()).find(|&i| !taken[i] || frequencies[i] - wanted > reach);
    [below, above]
        .into_iter()
        .flatten()
        .map(|i| ((frequencies[i] - wanted).abs(), i))
        .filter(|&(distance, i)| distance <= reach && !taken[i])
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, i)| i)
}
