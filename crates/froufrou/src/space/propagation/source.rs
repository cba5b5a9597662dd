//! A thread on its way.

use std::collections::BTreeSet;

use super::super::directivity::{Directivity, HARMONICS};
use super::super::extended::USUAL_BINS;
use super::super::spread::Spread;
use super::super::track::Track;
use super::shadow::Shadows;

/// A thread on its way.
pub(super) struct Source {
    /// The microphone that it is all around, if it is.
    pub(super) around: Option<usize>,
    /// How it radiates, if not evenly, and how it is turned.
    pub(super) pattern: Option<(Directivity, Track<4>)>,
    /// The surface that it comes from all over, if it does.
    pub(super) spread: Option<Spread>,
    /// The thing of the surroundings that it belongs to.
    pub(super) thing: Option<u64>,
    /// Which of its further paths are heard, by their number.
    pub(super) heard: BTreeSet<u32>,
    /// Its motion since the start or the last jump.
    pub(super) track: Track<3>,
    /// Time and gain of the line last passed.
    pub(super) passed: (f64, f64),
    /// The take of each microphone that the sound reaches.
    pub(super) takes: Vec<usize>,
    /// When it leaves what meets a microphone just as it cuts, if that is what it is due for.
    pub(super) cut_s: Option<f64>,
    /// What is in the way of each path.
    pub(super) shadows: Shadows,
}

/// A source that is not turned.
pub(super) const UNTURNED: [f64; 4] = [0.0, 0.0, 0.0, 1.0];

/// A turn of length 1.
pub(super) fn unit(turn: [f64; 4]) -> [f64; 4] {
    let length = turn.iter().map(|part| part * part).sum::<f64>().sqrt();
    turn.map(|part| part / length)
}

/// The weights of a pattern; what it leaves out is 0.
pub(super) fn weights(harmonics: &[f64]) -> Directivity {
    let mut coefficients = [0.0; HARMONICS];
    coefficients.iter_mut().zip(harmonics).for_each(|(weight, harmonic)| *weight = *harmonic);
    Directivity { coefficients }
}

impl Source {
    /// Its gain towards all sides together: the root of the mean of its square over the sphere.
    pub(super) fn diffuse(&self) -> f64 {
        self.pattern.as_ref().map_or(1.0, |(pattern, _)| pattern.diffuse())
    }

    /// How many threads of channel space its direct sound is: one, or one for each direction.
    pub(super) fn voices(&self) -> usize {
        if self.spread.is_some() { USUAL_BINS } else { 1 }
    }

    /// Takes in how it is turned, by the shorter way from how it was before.
    pub(super) fn turn(&mut self, time_s: f64, turn: Option<[f64; 4]>) {
        let (Some((_, turned)), Some(turn)) = (&mut self.pattern, turn.map(unit)) else { return };
        let before = turned.last();
        let same: f64 = before.iter().zip(turn).map(|(a, b)| a * b).sum();
        turned.push(time_s, if same < 0.0 { turn.map(|part| -part) } else { turn });
        turned.forget(self.passed.0);
    }

    /// Its gain towards what lies in a direction, in metres from it.
    pub(super) fn radiation(&self, time_s: f64) -> impl Fn([f64; 3]) -> f64 + use<> {
        let pattern = self.pattern.as_ref().map(|(pattern, turned)| {
            let [x, y, z, w] = unit(turned.at(time_s).0);
            let columns = glam::DMat3::from_quat(glam::DQuat::from_xyzw(x, y, z, w)).to_cols_array_2d();
            let mut frame = [[0.0; 4]; 4];
            (0..3).for_each(|row| (0..3).for_each(|column| frame[row][column] = columns[column][row]));
            frame[3][3] = 1.0;
            (*pattern, frame)
        });
        move |toward_m| pattern.as_ref().map_or(1.0, |(pattern, frame)| pattern.gain(frame, toward_m))
    }
}
