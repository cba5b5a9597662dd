//! The way of one body: its poses at the frames that are remembered, and pieces of motion between them.

use std::collections::VecDeque;

use glam::{DQuat, DVec3};

use super::pose::{Pose, turned};

/// What is slower than this between two frames, in metres a second, has not been moved by hand.
const JUMP_MPS: f64 = 5.0;
/// A jump is so many times faster than what is before and after it.
const JUMP_RATIO: f64 = 8.0;
/// How many frames are remembered: three up to the one that an interval begins with, and three behind it.
pub(super) const REMEMBERED: usize = 6;

/// A piece of motion: a parabola of the centre and an even spin.
#[derive(Debug, Clone, Copy)]
pub(super) struct Piece {
    pub from_s: f64,
    pub at: DVec3,
    pub velocity: DVec3,
    pub acceleration: DVec3,
    pub turn: DQuat,
    /// Axis times radians a second, in the world.
    pub spin: DVec3,
}

impl Piece {
    /// The pose of the centre.
    pub fn pose(&self, time_s: f64) -> Pose {
        let s = time_s - self.from_s;
        let at = self.at + self.velocity * s + self.acceleration * (0.5 * s * s);
        let turn = if self.spin == DVec3::ZERO {
            self.turn
        } else {
            (DQuat::from_scaled_axis(self.spin * s) * self.turn).normalize()
        };
        Pose { at, turn }
    }

    pub fn velocity(&self, time_s: f64) -> DVec3 {
        self.velocity + self.acceleration * (time_s - self.from_s)
    }

    /// How fast the material at a place of the world moves.
    pub fn velocity_of(&self, place: DVec3, time_s: f64) -> DVec3 {
        self.velocity(time_s) + self.spin.cross(place - self.pose(time_s).at)
    }

    /// The same motion, told from a later moment on.
    pub fn from(&self, time_s: f64) -> Self {
        let pose = self.pose(time_s);
        Self { from_s: time_s, at: pose.at, velocity: self.velocity(time_s), turn: pose.turn, ..*self }
    }
}

/// From one frame to the next.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step {
    pub lasts_s: f64,
    pub velocity: DVec3,
    pub spin: DVec3,
    /// When it was last hit within, if it was.
    pub broke_s: Option<f64>,
}

/// The poses of a body at the last frames.
#[derive(Debug, Clone, Default)]
pub(super) struct Track {
    poses: VecDeque<Pose>,
    steps: VecDeque<Step>,
    /// The number of the first frame that is remembered.
    first: usize,
}

impl Track {
    /// Takes the next frame. `rolls` says that the body is a ball, whose spin may be more than half a turn a frame.
    pub fn push(&mut self, pose: Pose, since_s: f64, rolls: bool) {
        if let Some(last) = self.poses.back() {
            let way = turned(last.turn, pose.turn);
            let mut spin = way / since_s;
            // Turns beyond half a turn a frame are told by the frames before.
            if rolls
                && let Some(before) = self.steps.back()
                && let Some(axis) = way.try_normalize()
            {
                let turns =
                    ((before.spin.dot(axis) * since_s - way.length()) / std::f64::consts::TAU).round();
                let other = axis * ((way.length() + turns * std::f64::consts::TAU) / since_s);
                if turns != 0.0 && (other - before.spin).length() * since_s < 0.5 {
                    spin = other;
                }
            }
            let velocity = (pose.at - last.at) / since_s;
            self.steps.push_back(Step { lasts_s: since_s, velocity, spin, broke_s: None });
        }
        self.poses.push_back(pose);
        if self.poses.len() > REMEMBERED {
            self.poses.pop_front();
            self.steps.pop_front();
            self.first += 1;
        }
    }

    /// The pose of the centre at a frame.
    pub fn pose(&self, frame: usize) -> Option<&Pose> {
        self.poses.get(frame.checked_sub(self.first)?)
    }

    /// The step from a frame to the next, unless it jumps there.
    pub fn step(&self, frame: usize) -> Option<&Step> {
        if self.jumps(frame) { None } else { self.raw_step(frame) }
    }

    fn raw_step(&self, frame: usize) -> Option<&Step> {
        self.steps.get(frame.checked_sub(self.first)?)
    }

    /// Says that it was hit in the step from a frame.
    pub fn break_at(&mut self, frame: usize, time_s: f64) {
        if let Some(step) = frame.checked_sub(self.first).and_then(|index| self.steps.get_mut(index)) {
            step.broke_s = Some(time_s);
        }
    }

    /// True where it goes from one frame to the next by no motion.
    pub fn jumps(&self, frame: usize) -> bool {
        let speed = |frame: Option<usize>| {
            frame.and_then(|frame| self.raw_step(frame)).map(|step| step.velocity.length())
        };
        let Some(here) = speed(Some(frame)) else { return false };
        let around = [speed(frame.checked_sub(1)), speed(Some(frame + 1))];
        let fastest = around.into_iter().flatten().reduce(f64::max);
        fastest.is_some_and(|fastest| here > JUMP_MPS && here > JUMP_RATIO * fastest)
    }

    /// The acceleration at a frame, from the steps that meet there.
    pub fn acceleration(&self, frame: usize) -> Option<DVec3> {
        let (come, go) = (self.step(frame.checked_sub(1)?)?, self.step(frame)?);
        Some((go.velocity - come.velocity) * (2.0 / (come.lasts_s + go.lasts_s)))
    }

    /// The same where it was not hit in either step.
    pub fn smooth_acceleration(&self, frame: usize) -> Option<DVec3> {
        let whole = |frame| self.step(frame).is_some_and(|step| step.broke_s.is_none());
        (whole(frame.checked_sub(1)?) && whole(frame)).then(|| self.acceleration(frame))?
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(poses: impl IntoIterator<Item = (f64, f64)>, rolls: bool) -> Track {
        let mut track = Track::default();
        for (x, angle) in poses {
            let pose = Pose { at: DVec3::X * x, turn: DQuat::from_rotation_z(angle) };
            track.push(pose, 0.04, rolls);
        }
        track
    }

    #[test]
    fn a_parabola_is_told_to_the_last_bit_but_one() {
        let track = track((0..6).map(|i| (0.3 * f64::from(i).powi(2) * 0.0016, 0.0)), false);
        assert!((track.acceleration(2).unwrap() - DVec3::X * 0.6).length() < 1e-12);
        assert!((track.step(2).unwrap().velocity.x - 0.3 * 5.0 * 0.04).abs() < 1e-12);
        assert!(track.acceleration(0).is_none() && track.step(5).is_none());
    }

    #[test]
    fn a_ball_that_spins_up_is_followed_beyond_half_a_turn_a_frame() {
        // 20 rad/s more in every frame, up to 100 rad/s: 4 rad a frame.
        let angles = [0.0, 0.8, 2.4, 4.8, 8.0, 12.0];
        let spins = |rolls| track(angles.map(|angle| (0.0, angle)), rolls).step(4).unwrap().spin.z;
        // The last steps are 3.2 and 4 rad, which look like −3.1 and −2.3.
        assert!((spins(false) - (4.0 - std::f64::consts::TAU) / 0.04).abs() < 1e-9);
        let slow = [0.0, 2.6, 5.4, 8.4, 11.6, 15.0];
        let spin = track(slow.map(|angle| (0.0, angle)), true).step(4).unwrap().spin.z;
        assert!((spin - 85.0).abs() < 1e-9, "{spin}");
    }

    #[test]
    fn jumps_are_not_motion() {
        let there = track([0.0, 0.01, 0.02, 2.03, 2.04, 2.05].map(|x| (x, 0.0)), false);
        assert!(there.jumps(2) && !there.jumps(1) && !there.jumps(3));
        assert!(there.step(2).is_none() && there.acceleration(3).is_none());
        // What has been hit and goes on is none, and neither is what falls.
        assert!(!track([0.0, 0.0, 0.0, 1.0, 2.0, 3.0].map(|x| (x, 0.0)), false).jumps(2));
    }

    #[test]
    fn pieces_go_on_from_any_moment() {
        let piece = Piece {
            from_s: 1.0,
            at: DVec3::Y,
            velocity: DVec3::X,
            acceleration: DVec3::NEG_Y * 9.81,
            turn: DQuat::IDENTITY,
            spin: DVec3::Z * 3.0,
        };
        let later = piece.from(1.25);
        let (a, b) = (piece.pose(2.0), later.pose(2.0));
        assert!((a.at - b.at).length() < 1e-12 && a.turn.dot(b.turn).abs() > 1.0 - 1e-12);
        assert!((piece.velocity(2.0) - later.velocity(2.0)).length() < 1e-12);
    }
}
