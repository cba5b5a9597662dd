//! A thread that sounds: what it rides on, how loud it is and what it is told, over time.

use std::collections::VecDeque;

use super::super::{Action, Placement, Start, Whereabouts};
use crate::Result;
use crate::scene::animation::Transform;
use crate::scene::carrier::Carrier;
use crate::scene::wind::WindField;

/// A thread that sounds.
pub(super) struct Voice {
    /// What it starts with, until it has.
    pub start: Option<Start>,
    /// What it is of: the name of an object or a body, with which it vanishes.
    pub of: String,
    pub place: Place,
    /// Whether it says how it is turned.
    pub turns: bool,
    /// Gain at 1 m over time: breakpoints, linear between.
    pub gain: Vec<(f64, f64)>,
    pub end_s: f64,
    pub passed_s: f64,
    /// When it has its next line.
    pub due_s: f64,
    /// Its lines are no closer for the mere passing of time, in seconds.
    pub beat_s: f64,
    /// What it is still told.
    pub cues: VecDeque<Telling>,
    /// What its control `speed` follows by itself.
    pub speed: Option<Follows>,
}

/// What a thread is told.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Telling {
    /// When, in seconds.
    pub time_s: f64,
    pub action: Action,
    /// Why, where it is for a cause of its own.
    pub cause: String,
}

impl From<(f64, Action)> for Telling {
    fn from((time_s, action): (f64, Action)) -> Self {
        Self { time_s, action, cause: String::new() }
    }
}

/// Where a thread is.
pub(super) enum Place {
    Carrier(Carrier),
    Around(usize),
}

/// What a control of speed follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Follows {
    /// The speed through the air of what carries the thread.
    Air,
    /// The speed of the wind.
    Wind,
}

impl Voice {
    /// One that begins somewhere, without a gain, and is over at once until it is told otherwise.
    pub fn at(start: Start, position_m: [f64; 3], time_s: f64) -> Self {
        Self {
            // What radiates by a pattern says how it is turned.
            turns: !start.pattern.is_empty(),
            of: start.object.clone(),
            start: Some(start),
            place: Place::Carrier(Carrier::still(position_m)),
            gain: Vec::new(),
            end_s: time_s,
            passed_s: time_s,
            due_s: time_s,
            beat_s: 0.0,
            cues: VecDeque::new(),
            speed: None,
        }
    }

    /// One about the first microphone that is silent and never over.
    pub fn pulse(start: Start) -> Self {
        let mut voice = Self::at(start, [0.0; 3], 0.0);
        (voice.place, voice.end_s) = (Place::Around(0), f64::INFINITY);
        voice
    }

    /// Tells it something at a time, after all that it is told before and then.
    pub fn tell(&mut self, telling: Telling) {
        let at = self.cues.partition_point(|before| before.time_s <= telling.time_s);
        self.cues.insert(at, telling);
    }

    /// Where it is and how loud, at a time.
    pub fn placement(&self, time_s: f64, gain: f64) -> Result<Placement> {
        Ok(match &self.place {
            Place::Around(microphone) => {
                Placement { whereabouts: Whereabouts::Around(*microphone), gain, turn: None }
            }
            Place::Carrier(carrier) => Placement {
                turn: if self.turns { Some(turn_of(&carrier.frame(time_s)?)) } else { None },
                ..Placement::at(carrier.position_m(time_s)?, gain)
            },
        })
    }

    pub fn gain_at(&self, time_s: f64) -> f64 {
        let points = &self.gain;
        let after = points.partition_point(|&(t, _)| t <= time_s);
        match (after.checked_sub(1).map(|i| points[i]), points.get(after)) {
            (Some((t0, g0)), Some(&(t1, g1))) => g0 + (g1 - g0) * (time_s - t0) / (t1 - t0),
            (Some((_, g)), None) | (None, Some(&(_, g))) => g,
            (None, None) => 0.0,
        }
    }

    pub fn jumps_at(&self, time_s: f64, before_s: f64) -> Result<bool> {
        match &self.place {
            Place::Carrier(carrier) => carrier.jumps_at(time_s, before_s),
            Place::Around(_) => Ok(false),
        }
    }

    pub fn next_key_s(&self, time_s: f64) -> Option<f64> {
        match &self.place {
            Place::Carrier(carrier) => carrier.next_key_s(time_s),
            Place::Around(_) => None,
        }
    }

    /// The speed that its control follows, in metres a second.
    pub fn speed_mps(&self, time_s: f64, wind: Option<&WindField>) -> Result<Option<f64>> {
        let wind = wind.map_or([0.0; 3], |wind| wind.velocity_mps(time_s));
        let velocity = match (self.speed, &self.place) {
            (None, _) => return Ok(None),
            (Some(Follows::Air), Place::Carrier(carrier)) => carrier.velocity_mps(time_s)?,
            _ => [0.0; 3],
        };
        let square: f64 = velocity.iter().zip(wind).map(|(v, w)| (v - w).powi(2)).sum();
        Ok(Some(square.sqrt()))
    }
}

/// The rotation of a frame, as a quaternion x, y, z, w; none where it is squashed flat.
fn turn_of(frame: &Transform) -> [f64; 4] {
    let column = |k: usize| glam::DVec3::new(frame[0][k], frame[1][k], frame[2][k]).normalize_or_zero();
    // Made square again: scaled and sheared frames turn as their ahead and up do.
    let back = column(2);
    let right = column(1).cross(back).normalize_or_zero();
    let up = back.cross(right);
    if right == glam::DVec3::ZERO || back == glam::DVec3::ZERO {
        return [0.0, 0.0, 0.0, 1.0];
    }
    let turn = glam::DQuat::from_mat3(&glam::DMat3::from_cols(right, up, back)).normalize();
    // Rounded far below what is heard, so that a score is good to read.
    turn.to_array().map(|part| (part * 1e9).round() / 1e9 + 0.0)
}

/// The gain over time of a sound that fades in and out.
pub(super) fn faded(gain: f64, start_s: f64, end_s: f64, fade_in_s: f64, fade_out_s: f64) -> Vec<(f64, f64)> {
    let fades_s = fade_in_s + fade_out_s;
    // Where the sound is shorter than its fades they share it.
    let share = if fades_s > 0.0 { ((end_s - start_s) / fades_s).min(1.0) } else { 1.0 };
    let mut points = Vec::new();
    if fade_in_s > 0.0 {
        points.push((start_s, 0.0));
    }
    points.push((start_s + fade_in_s * share, gain));
    if fade_out_s > 0.0 {
        points.push((end_s - fade_out_s * share, gain));
        points.push((end_s, 0.0));
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_takes_the_source_ahead_where_its_frame_does() {
        let turn = glam::DQuat::from_euler(glam::EulerRot::YXZ, 0.7, -0.3, 1.9);
        let matrix = glam::DMat3::from_quat(turn) * 2.5;
        let mut frame = [[0.0; 4]; 4];
        (0..3).for_each(|i| (0..3).for_each(|k| frame[i][k] = matrix.col(k)[i]));
        let [x, y, z, w] = turn_of(&frame);
        let found = glam::DQuat::from_xyzw(x, y, z, w);
        assert!(found.angle_between(turn) < 1e-6);
        assert_eq!(turn_of(&[[0.0; 4]; 4]), [0.0, 0.0, 0.0, 1.0]);
    }
}
