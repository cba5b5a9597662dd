//! Envelopes: the least, the greatest and the effective value of a waveform in each column of a
//! picture.

use std::ops::Range;

/// A waveform's values in one column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Column {
    /// The least value.
    pub least: f32,
    /// The greatest value.
    pub greatest: f32,
    /// The root of the mean square, where the column holds enough samples to speak of one.
    pub rms: Option<f32>,
}

/// Fewer samples than this have no effective value to speak of.
const FEWEST_FOR_RMS: usize = 8;

/// The columns of a range of samples. Between samples the waveform is taken to be straight, so that
/// columns of less than a sample join, too.
pub fn columns(samples: &[f32], range: Range<usize>, count: usize) -> Vec<Column> {
    let width = range.len() as f64 / count.max(1) as f64;
    let Some(last) = range.end.min(samples.len()).checked_sub(1) else { return Vec::new() };
    let at = |place: f64| {
        let place = place.clamp(0.0, last as f64);
        let index = place as usize;
        let u = (place - index as f64) as f32;
        samples[index] * (1.0 - u) + samples[(index + 1).min(last)] * u
    };
    (0..count)
        .map(|column| {
            let (from, to) = (
                range.start as f64 + column as f64 * width,
                range.start as f64 + (column + 1) as f64 * width,
            );
            let (a, b) = (at(from), at(to));
            let first = (from.ceil() as usize).min(last + 1);
            let inside = &samples[first..(to.ceil() as usize).clamp(first, last + 1)];
            let least = inside.iter().copied().fold(a.min(b), f32::min);
            let greatest = inside.iter().copied().fold(a.max(b), f32::max);
            let square: f64 = inside.iter().map(|s| f64::from(*s).powi(2)).sum();
            let rms = (square / inside.len().max(1) as f64).sqrt() as f32;
            Column { least, greatest, rms: (inside.len() >= FEWEST_FOR_RMS).then_some(rms) }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_samples_in_a_column() {
        let samples: Vec<f32> = (0..100).map(|i| if i % 2 == 0 { 0.5 } else { -0.5 }).collect();
        let columns = columns(&samples, 0..100, 4);
        assert_eq!(columns.len(), 4);
        for column in columns {
            assert_eq!(column, Column { least: -0.5, greatest: 0.5, rms: Some(0.5) });
        }
    }

    #[test]
    fn no_sample_is_lost() {
        for count in [1, 3, 7, 64, 1000] {
            for place in 0..90 {
                let mut samples = [0.0f32; 90];
                samples[place] = 1.0;
                let columns = columns(&samples, 0..90, count);
                assert!(columns.iter().any(|c| c.greatest > 0.4), "{place} in {count}");
                if count <= 90 {
                    assert!(columns.iter().any(|c| c.greatest == 1.0), "{place} in {count}");
                }
            }
        }
    }

    #[test]
    fn columns_between_samples_are_straight_and_join() {
        let columns = columns(&[0.0, 1.0, 0.0], 0..3, 30);
        assert!(columns.windows(2).all(|pair| pair[0].greatest >= pair[1].least));
        assert!((columns[4].least - 0.4).abs() < 1e-6 && (columns[4].greatest - 0.5).abs() < 1e-6);
        assert_eq!(columns[25].rms, None);
    }

    #[test]
    fn one_sample_fills_the_picture() {
        let columns = columns(&[0.25], 0..1, 5);
        assert_eq!(columns.len(), 5);
        assert!(columns.iter().all(|c| c.least == 0.25 && c.greatest == 0.25));
    }
}
