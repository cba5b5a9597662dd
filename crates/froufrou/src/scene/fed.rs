//! How something moves that is told while it does.

use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};

use super::animation::Transform;

/// Poses are kept for so long behind the last, in seconds.
const KEPT_S: f64 = 4.0;

/// Where something is and how it is turned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FedPose {
    /// In metres.
    pub position_m: [f64; 3],
    /// A quaternion x, y, z, w of any length above 0. Unturned, it looks along −Z and its up is +Y.
    pub rotation: [f64; 4],
}

impl FedPose {
    /// At a place, unturned.
    pub fn at(position_m: [f64; 3]) -> Self {
        Self { position_m, rotation: [0.0, 0.0, 0.0, 1.0] }
    }
}

/// The poses of something, as they are told. Between two it goes evenly from one to the other; before the first and
/// behind the last it stands.
#[derive(Debug)]
pub struct Fed {
    poses: Mutex<VecDeque<(f64, FedPose)>>,
}

impl Fed {
    /// Something that stands until it is told otherwise.
    pub fn new(pose: FedPose) -> Self {
        Self { poses: Mutex::new(VecDeque::from([(0.0, pose)])) }
    }

    /// It has a pose at a time, which is not before that of the last. One of the same time takes its place.
    pub fn push(&self, time_s: f64, pose: FedPose) {
        let mut poses = self.poses.lock().unwrap_or_else(PoisonError::into_inner);
        if poses.back().is_some_and(|(last_s, _)| *last_s >= time_s) {
            poses.pop_back();
        }
        poses.push_back((time_s, pose));
        while poses.get(1).is_some_and(|(next_s, _)| *next_s < time_s - KEPT_S) {
            poses.pop_front();
        }
    }

    /// Until a time it has stood where it was last.
    pub fn stand(&self, time_s: f64) {
        let last = self.poses.lock().unwrap_or_else(PoisonError::into_inner).back().copied();
        if let Some((last_s, pose)) = last
            && last_s < time_s
        {
            self.push(time_s, pose);
        }
    }

    /// Its local-to-world transform at a time.
    pub fn frame(&self, time_s: f64) -> Transform {
        let poses = self.poses.lock().unwrap_or_else(PoisonError::into_inner);
        let after = poses.partition_point(|(pose_s, _)| *pose_s <= time_s);
        let before = after.checked_sub(1).and_then(|index| poses.get(index)).or(poses.front());
        let Some(&(from_s, from)) = before else { return super::animation::IDENTITY };
        let turn = |pose: FedPose| glam::DQuat::from_array(pose.rotation).normalize();
        let (at, turned) = match poses.get(after) {
            Some(&(to_s, to)) if to_s > from_s && time_s > from_s => {
                let along = (time_s - from_s) / (to_s - from_s);
                let at = |i: usize| from.position_m[i] + along * (to.position_m[i] - from.position_m[i]);
                (std::array::from_fn(at), turn(from).slerp(turn(to), along))
            }
            _ => (from.position_m, turn(from)),
        };
        let columns = glam::DMat3::from_quat(turned).to_cols_array_2d();
        let row = |i: usize| [columns[0][i], columns[1][i], columns[2][i], at[i]];
        [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_goes_evenly_and_stands_where_it_is_told_nothing() {
        let fed = Fed::new(FedPose::at([1.0, 2.0, 3.0]));
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let place = |time_s: f64| fed.frame(time_s).map(|row| row[3]);
        assert_eq!((place(-1.0), place(9.0)), ([1.0, 2.0, 3.0, 1.0], [1.0, 2.0, 3.0, 1.0]));
        fed.stand(2.0);
        // To the left by a quarter turn: what was ahead is at −X.
        fed.push(4.0, FedPose { position_m: [3.0, 2.0, 3.0], rotation: [0.0, 2.0 * half, 0.0, 2.0 * half] });
        assert_eq!((place(2.0)[0], place(3.0)[0], place(5.0)[0]), (1.0, 2.0, 3.0));
        let ahead = |time_s: f64| fed.frame(time_s).map(|row| -row[2]);
        let near = |a: [f64; 4], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(near(ahead(4.0), [-1.0, 0.0, 0.0]));
        assert!(near(ahead(3.0), [-half, 0.0, -half]), "half way, half turned");
        (0..10_000).for_each(|n| fed.push(4.0 + f64::from(n) * 0.01, FedPose::at([0.0; 3])));
        assert!(fed.poses.lock().unwrap().len() < 500);
    }
}
