//! Hand-set tracks: positions and facings at a few times, and where that leads in between.

use super::animation::Transform;

/// How a track goes from one key to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Interpolation {
    /// Along a cubic curve through the keys, with a velocity that has no jumps.
    #[default]
    Smooth,
    /// Straight, at constant speed.
    Linear,
    /// It stays until the next key and then is suddenly there.
    Step,
}

/// A key of a track.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackKey {
    /// When, in seconds.
    pub time_s: f64,
    /// World position in metres.
    pub position_m: [f64; 3],
    /// Unit vector of the direction it faces; −Z where nothing was said.
    pub facing: [f64; 3],
}

/// A path through the world, set by hand. Before the first key and after the last it stands still.
///
/// ```
/// use froufrou::scene::track::{Interpolation, Track, TrackKey};
/// let key = |time_s, x| TrackKey { time_s, position_m: [x, 0.0, 0.0], facing: [0.0, 0.0, -1.0] };
/// let track = Track { keys: vec![key(0.0, 0.0), key(2.0, 4.0)], interpolation: Interpolation::Linear };
/// assert_eq!(track.position_m(0.5), [1.0, 0.0, 0.0]);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// At least one key, at ascending times.
    pub keys: Vec<TrackKey>,
    /// What happens between them.
    pub interpolation: Interpolation,
}

impl Track {
    /// World position in metres at a time; the origin for a track without keys.
    pub fn position_m(&self, time_s: f64) -> [f64; 3] {
        let Some((before, after, u)) = self.around(time_s) else { return [0.0; 3] };
        let (a, b) = (&self.keys[before], &self.keys[after]);
        match self.interpolation {
            Interpolation::Step => a.position_m,
            Interpolation::Linear => {
                std::array::from_fn(|n| a.position_m[n] + (b.position_m[n] - a.position_m[n]) * u)
            }
            Interpolation::Smooth => {
                // Cubic Hermite: p = h00 p0 + h10 Δt m0 + h01 p1 + h11 Δt m1, h00 = 1 − h01.
                let span_s = b.time_s - a.time_s;
                let (m0, m1) = (self.velocity_mps(before), self.velocity_mps(after));
                let h01 = u * u * (3.0 - 2.0 * u);
                let h10 = u * (u - 1.0) * (u - 1.0);
                let h11 = u * u * (u - 1.0);
                std::array::from_fn(|n| {
                    let straight = a.position_m[n] + (b.position_m[n] - a.position_m[n]) * h01;
                    straight + span_s * (m0[n] * h10 + m1[n] * h11)
                })
            }
        }
    }

    /// Unit vector of the facing direction at a time; −Z for a track without keys.
    ///
    /// Between keys it turns at constant speed about one axis; half a turn goes about the world's
    /// up, or about X where the directions are vertical.
    pub fn facing(&self, time_s: f64) -> [f64; 3] {
        let Some((before, after, u)) = self.around(time_s) else { return [0.0, 0.0, -1.0] };
        match self.interpolation {
            Interpolation::Step => self.keys[before].facing,
            _ => turned(self.keys[before].facing, self.keys[after].facing, u),
        }
    }

    /// The local-to-world transform at a time: local −Z is the facing direction (see
    /// [`facing_frame`]).
    pub fn frame(&self, time_s: f64) -> Transform {
        facing_frame(self.position_m(time_s), self.facing(time_s))
    }

    /// The keys before and after a time and the fraction of the way between them; the same key
    /// twice where the track stands still. `None` without keys.
    fn around(&self, time_s: f64) -> Option<(usize, usize, f64)> {
        let last = self.keys.len().checked_sub(1)?;
        let after = self.keys.partition_point(|key| key.time_s <= time_s);
        if after == 0 || after > last {
            let stands = after.min(last);
            return Some((stands, stands, 0.0));
        }
        let (a, b) = (&self.keys[after - 1], &self.keys[after]);
        Some((after - 1, after, (time_s - a.time_s) / (b.time_s - a.time_s)))
    }

    /// The velocity of the smooth curve at a key: that of the parabola through it and its two
    /// neighbours; at the ends that of the straight line to the one neighbour.
    fn velocity_mps(&self, key: usize) -> [f64; 3] {
        let slope = |a: &TrackKey, b: &TrackKey| -> [f64; 3] {
            std::array::from_fn(|n| (b.position_m[n] - a.position_m[n]) / (b.time_s - a.time_s))
        };
        let here = &self.keys[key];
        let before = key.checked_sub(1).and_then(|i| self.keys.get(i));
        match (before, self.keys.get(key + 1)) {
            (Some(before), Some(after)) => {
                let (left, right) = (slope(before, here), slope(here, after));
                let share = (here.time_s - before.time_s) / (after.time_s - before.time_s);
                std::array::from_fn(|n| left[n] * (1.0 - share) + right[n] * share)
            }
            (Some(before), None) => slope(before, here),
            (None, Some(after)) => slope(here, after),
            (None, None) => [0.0; 3],
        }
    }
}

/// The local-to-world transform of something at a position that faces along a unit vector: local −Z
/// points there, local +X to its right (facing × up, where up is the world's +Y) and local +Y up as
/// far as the facing allows. Where the facing is vertical, right is the world's +X.
///
/// ```
/// use froufrou::scene::track::facing_frame;
/// // Facing along +X, the right hand points to +Z.
/// let frame = facing_frame([1.0, 2.0, 3.0], [1.0, 0.0, 0.0]);
/// let right = [frame[0][0], frame[1][0], frame[2][0]];
/// assert_eq!(right, [0.0, 0.0, 1.0]);
/// assert_eq!([frame[0][3], frame[1][3], frame[2][3]], [1.0, 2.0, 3.0]);
/// ```
pub fn facing_frame(position_m: [f64; 3], facing: [f64; 3]) -> Transform {
    let [fx, fy, fz] = facing;
    // f × (0, 1, 0) = (−fz, 0, fx).
    let across = fx.hypot(fz);
    let right = if across < 1e-9 { [1.0, 0.0, 0.0] } else { [-fz / across, 0.0, fx / across] };
    let back = [-fx, -fy, -fz];
    let up = cross(back, right);
    let row = |n: usize| [right[n], up[n], back[n], position_m[n]];
    [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// A unit vector a fraction of the way from one to another along the great circle.
fn turned(from: [f64; 3], to: [f64; 3], fraction: f64) -> [f64; 3] {
    let dot: f64 = (0..3).map(|n| from[n] * to[n]).sum();
    let mut axis = cross(from, to);
    let sine = axis.iter().map(|c| c * c).sum::<f64>().sqrt();
    if sine < 1e-9 {
        if dot > 0.0 {
            return from;
        }
        let level = from[0].hypot(from[2]) > 1e-6;
        axis = if level { [0.0, 1.0, 0.0] } else { [1.0, 0.0, 0.0] };
        // Only the part at right angles to `from` turns it.
        let along: f64 = (0..3).map(|n| axis[n] * from[n]).sum();
        axis = std::array::from_fn(|n| axis[n] - along * from[n]);
        let length = axis.iter().map(|c| c * c).sum::<f64>().sqrt();
        axis = axis.map(|c| c / length);
    } else {
        axis = axis.map(|c| c / sine);
    }
    // Rodrigues' rotation of a vector at right angles to its axis.
    let angle = sine.atan2(dot) * fraction;
    let side = cross(axis, from);
    std::array::from_fn(|n| from[n] * angle.cos() + side[n] * angle.sin())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(time_s: f64, position_m: [f64; 3], facing: [f64; 3]) -> TrackKey {
        TrackKey { time_s, position_m, facing }
    }

    const NORTH: [f64; 3] = [0.0, 0.0, -1.0];

    fn parabola(interpolation: Interpolation) -> Track {
        let at = |t: f64| key(t, [t, t * t, 1.0], NORTH);
        Track { keys: [0.0, 0.5, 1.5, 2.0, 4.0].map(at).to_vec(), interpolation }
    }

    #[test]
    fn every_interpolation_passes_through_its_keys_and_holds_at_the_ends() {
        for interpolation in [Interpolation::Smooth, Interpolation::Linear, Interpolation::Step] {
            let track = parabola(interpolation);
            for key in &track.keys {
                let found = track.position_m(key.time_s);
                assert!((0..3).all(|n| (found[n] - key.position_m[n]).abs() < 1e-12), "{found:?}");
            }
            assert_eq!(track.position_m(-1.0), [0.0, 0.0, 1.0]);
            assert_eq!(track.position_m(99.0), [4.0, 16.0, 1.0]);
        }
    }

    #[test]
    fn smooth_is_exact_on_a_parabola_between_inner_keys_and_has_no_jump_of_velocity() {
        let track = parabola(Interpolation::Smooth);
        for t in [0.6, 1.0, 1.4, 1.7] {
            assert!((track.position_m(t)[1] - t * t).abs() < 1e-12, "{t}");
        }
        for key in &track.keys[1..4] {
            let h = 1e-6;
            let speed = |a: f64, b: f64| (track.position_m(b)[1] - track.position_m(a)[1]) / (b - a);
            let (left, right) = (speed(key.time_s - h, key.time_s), speed(key.time_s, key.time_s + h));
            assert!((left - right).abs() < 1e-4, "{left} {right}");
        }
    }

    #[test]
    fn linear_and_step_are_what_they_say() {
        assert_eq!(parabola(Interpolation::Linear).position_m(1.0)[1], 1.25);
        assert_eq!(parabola(Interpolation::Step).position_m(1.49)[1], 0.25);
    }

    #[test]
    fn facing_turns_evenly_even_through_half_a_turn() {
        let faces = |a, b| Track {
            keys: vec![key(0.0, [0.0; 3], a), key(1.0, [0.0; 3], b)],
            interpolation: Interpolation::Smooth,
        };
        let pairs = [([1.0, 0.0, 0.0], NORTH), (NORTH, [0.0, 0.0, 1.0]), ([0.0, 1.0, 0.0], [0.0, -1.0, 0.0])];
        for (a, b) in pairs {
            let track = faces(a, b);
            let dot = |x: [f64; 3], y: [f64; 3]| (0..3).map(|n| x[n] * y[n]).sum::<f64>().clamp(-1.0, 1.0);
            let whole = dot(a, b).acos();
            for u in [0.0, 0.25, 0.5, 0.75, 1.0] {
                let now = track.facing(u);
                assert!((dot(now, now) - 1.0).abs() < 1e-12);
                assert!((dot(a, now).acos() - u * whole).abs() < 1e-7, "{a:?} {b:?} {u}");
            }
        }
    }

    #[test]
    fn frames_are_right_handed_rotations_even_when_vertical() {
        let d = 0.5f64.sqrt();
        for f in [NORTH, [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [d, d, 0.0], [0.0, -0.6, 0.8]] {
            let m = facing_frame([0.0; 3], f);
            let column = |n: usize| [m[0][n], m[1][n], m[2][n]];
            let [x, y, z] = [column(0), column(1), column(2)];
            let near = |a: [f64; 3], b: [f64; 3]| (0..3).all(|n| (a[n] - b[n]).abs() < 1e-12);
            assert!(near(cross(x, y), z) && near(cross(y, z), x), "{f:?}");
            assert!(near(z.map(|c| -c), f));
            assert!(y[1] >= -1e-12, "its head is up: {f:?}");
        }
    }
}
