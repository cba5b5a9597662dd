//! Keys of one animated value, and what lies between them.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DQuat, DVec3};

use super::accessor::{Data, Integers};
use super::document::{Kind, Sampler};
use super::fault::{Budget, damage};
use crate::Result;

/// What lies between two keys.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Interpolation {
    /// On the straight way; rotations on the shorter arc.
    Linear,
    /// The key before.
    Step,
    /// A cubic with a slope at either key.
    CubicSpline,
}

/// A value with `width` components at ascending times.
#[derive(Debug, Clone)]
pub(super) struct Track {
    pub(super) times_s: Arc<[f64]>,
    /// For each key its components; of a cubic the slopes before, the components, the slopes after.
    values: Arc<[f32]>,
    interpolation: Interpolation,
    width: usize,
}

/// The arrays of a clip, each read once however many tracks share it.
pub(super) struct Keys<'a> {
    pub(super) data: &'a Data,
    times: HashMap<usize, Arc<[f64]>>,
    values: HashMap<usize, Arc<[f32]>>,
}

impl<'a> Keys<'a> {
    pub(super) fn new(data: &'a Data) -> Self {
        Self { data, times: HashMap::new(), values: HashMap::new() }
    }

    /// The times of an accessor.
    ///
    /// # Errors
    /// Times that are no numbers or that go back.
    pub(super) fn times(
        &mut self,
        accessor: usize,
        budget: &mut Budget,
        of: &dyn Fn() -> String,
    ) -> Result<Arc<[f64]>> {
        if let Some(times) = self.times.get(&accessor) {
            return Ok(Arc::clone(times));
        }
        budget.charge((self.data.count(accessor, of)? as u64).saturating_mul(8), of)?;
        let times = self.data.floats(accessor, Kind::Scalar, Integers::Refused, of)?;
        if let Some(time) = times.iter().find(|time| !time.is_finite()) {
            return Err(damage(of(), format!("a key lies at the time {time}")));
        }
        if let Some(pair) = times.windows(2).find(|pair| pair[1] < pair[0]) {
            return Err(damage(of(), format!("its keys go back from {} s to {} s", pair[0], pair[1])));
        }
        let times: Arc<[f64]> = times.into_iter().map(f64::from).collect();
        self.times.insert(accessor, Arc::clone(&times));
        Ok(times)
    }

    /// The track of a sampler. `width` is how many scalars a value has where that is not said by
    /// `kind`.
    ///
    /// # Errors
    /// Times or values that cannot be read or do not belong together.
    pub(super) fn track(
        &mut self,
        sampler: &Sampler,
        kind: Kind,
        width: usize,
        budget: &mut Budget,
        of: &dyn Fn() -> String,
    ) -> Result<Track> {
        let interpolation = match sampler.interpolation.as_deref() {
            None | Some("LINEAR") => Interpolation::Linear,
            Some("STEP") => Interpolation::Step,
            Some("CUBICSPLINE") => Interpolation::CubicSpline,
            Some(other) => return Err(damage(of(), format!("there is no interpolation {other:?}"))),
        };
        let times_s = self.times(sampler.input, budget, of)?;
        let values = match self.values.get(&sampler.output) {
            Some(values) => Arc::clone(values),
            None => {
                let count = self.data.count(sampler.output, of)? as u64;
                budget.charge(count.saturating_mul(4 * width as u64), of)?;
                // Where the standard allows integers they are parts of the greatest.
                let integers = if kind == Kind::Vec3 { Integers::Refused } else { Integers::Normalized };
                let values = self.data.floats(sampler.output, kind, integers, of)?;
                let values: Arc<[f32]> = values.into();
                self.values.insert(sampler.output, Arc::clone(&values));
                values
            }
        };
        let parts = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        if times_s.is_empty() || Some(values.len()) != times_s.len().checked_mul(parts * width) {
            return Err(damage(
                of(),
                format!(
                    "{} keys of {} numbers should have {} values and have {}",
                    times_s.len(),
                    parts * width,
                    times_s.len().saturating_mul(parts * width),
                    values.len()
                ),
            ));
        }
        Ok(Track { times_s, values, interpolation, width })
    }
}

/// Where a time lies among the keys.
struct Place {
    before: usize,
    after: usize,
    /// How far from one to the other, 0 to 1.
    fraction: f64,
    /// Seconds from one to the other.
    length_s: f64,
}

impl Track {
    fn place(&self, time_s: f64) -> Place {
        let after = self.times_s.partition_point(|&time| time <= time_s);
        let at = |key| Place { before: key, after: key, fraction: 0.0, length_s: 0.0 };
        if after == 0 {
            return at(0);
        }
        let Some(&end_s) = self.times_s.get(after) else { return at(self.times_s.len() - 1) };
        let before = after - 1;
        let length_s = end_s - self.times_s[before];
        let rest_s = end_s - time_s;
        match self.interpolation {
            // Times of keys are told with the rounding of their 32 bits, evened out: just before
            // a step is on it.
            Interpolation::Step if rest_s <= nearly(end_s) => at(after),
            Interpolation::Step => at(before),
            _ => Place { before, after, fraction: (time_s - self.times_s[before]) / length_s, length_s },
        }
    }

    /// One of the parts of a key: of a cubic 0 is the slope before, 1 the value, 2 the slope after.
    fn key(&self, key: usize, part: usize) -> &[f32] {
        let (parts, part) = if self.interpolation == Interpolation::CubicSpline { (3, part) } else { (1, 0) };
        let first = (key * parts + part) * self.width;
        &self.values[first..first + self.width]
    }

    fn component(&self, place: &Place, index: usize) -> f64 {
        let at = |key, part| f64::from(self.key(key, part)[index]);
        let (from, to, t) = (at(place.before, 1), at(place.after, 1), place.fraction);
        if place.before == place.after {
            return from;
        }
        if self.interpolation != Interpolation::CubicSpline {
            return from + (to - from) * t;
        }
        // glTF 2.0, appendix C.5; slopes are per second.
        let (slope_from, slope_to) = (at(place.before, 2), at(place.after, 0));
        let (t2, t3) = (t * t, t * t * t);
        (2.0 * t3 - 3.0 * t2 + 1.0) * from
            + place.length_s * (t3 - 2.0 * t2 + t) * slope_from
            + (3.0 * t2 - 2.0 * t3) * to
            + place.length_s * (t3 - t2) * slope_to
    }

    /// The value of a track of vectors.
    pub(super) fn vector(&self, time_s: f64) -> DVec3 {
        let place = self.place(time_s);
        DVec3::from_array(std::array::from_fn(|index| self.component(&place, index)))
    }

    /// The value of a track of rotations.
    pub(super) fn rotation(&self, time_s: f64) -> DQuat {
        let place = self.place(time_s);
        let whole = |key| {
            let key = self.key(key, 1);
            unit(std::array::from_fn(|index| f64::from(key[index])))
        };
        if self.interpolation == Interpolation::Linear && place.before != place.after {
            return whole(place.before).slerp(whole(place.after), place.fraction);
        }
        unit(std::array::from_fn(|index| self.component(&place, index)))
    }

    /// The values of a track of weights, in place of those in `weights`.
    pub(super) fn weights(&self, time_s: f64, weights: &mut Vec<f64>) {
        let place = self.place(time_s);
        weights.clear();
        weights.extend((0..self.width).map(|index| self.component(&place, index)));
    }
}

/// How far two readings of the same key's time may be apart.
pub(super) fn nearly(time_s: f64) -> f64 {
    1e-9 + 2.0 * f64::from(f32::EPSILON) * time_s.abs()
}

/// A rotation from x, y, z, w of about length 1; of length 0, none.
pub(super) fn unit(components: [f64; 4]) -> DQuat {
    let rotation = DQuat::from_array(components);
    if rotation.length_squared() == 0.0 { DQuat::IDENTITY } else { rotation.normalize() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(interpolation: Interpolation, width: usize, times_s: &[f64], values: &[f32]) -> Track {
        Track { times_s: times_s.into(), values: values.into(), interpolation, width }
    }

    #[test]
    fn a_cubic_with_its_own_slopes_is_met_exactly() {
        let (f, df) = (|t: f64| t * t * t - 2.0 * t, |t: f64| 3.0 * t * t - 2.0);
        let times = [0.5, 2.0, 2.5];
        let values: Vec<f32> = times
            .iter()
            .flat_map(|&t| [df(t), df(t), df(t), f(t), -f(t), 0.0, df(t), -df(t), 0.0].map(|v| v as f32))
            .collect();
        // The slopes before are those after but for the sign of the second component.
        let mut values = values;
        for key in values.chunks_mut(9) {
            key[1] = -key[1];
            key[2] = 0.0;
        }
        let track = track(Interpolation::CubicSpline, 3, &times, &values);
        for step in 0..=20 {
            let t = 0.5 + 0.1 * f64::from(step);
            let found = track.vector(t);
            assert!((found - DVec3::new(f(t), -f(t), 0.0)).length() < 1e-12, "{t} {found}");
        }
        assert_eq!((track.vector(-7.0), track.vector(9.0)), (track.vector(0.5), track.vector(2.5)));
    }

    #[test]
    fn rotations_take_the_shorter_way() {
        let about_y = |degrees: f64| DQuat::from_rotation_y(degrees.to_radians());
        let keys = [about_y(10.0), -about_y(70.0)];
        let values: Vec<f32> = keys.iter().flat_map(|q| q.to_array().map(|c| c as f32)).collect();
        let track = track(Interpolation::Linear, 4, &[0.0, 1.0], &values);
        for step in 0..=10 {
            let t = f64::from(step) / 10.0;
            assert!(track.rotation(t).angle_between(about_y(10.0 + 60.0 * t)) < 1e-6, "{t}");
        }
    }

    #[test]
    fn steps_hold_until_the_next_key_and_equal_times_do_no_harm() {
        let track = track(Interpolation::Step, 1, &[0.0, 1.0, 1.0, 2.0], &[1.0, 2.0, 3.0, 4.0]);
        let mut weights = vec![7.0, 8.0];
        let values = [-1.0, 0.0, 0.999, 1.0 - 1e-9, 1.0, 1.5, 2.0, 3.0].map(|t| {
            track.weights(t, &mut weights);
            weights[0]
        });
        assert_eq!(values, [1.0, 1.0, 1.0, 2.0, 3.0, 3.0, 4.0, 4.0]);
    }
}
