//! What rigid bodies do to each other, told by how they move alone: impacts, slides and rolls.
//!
//! Animations tell poses, 24 times a second or so, and nothing of contacts. But between two contacts a body moves in a
//! way that is known, on a parabola with an even spin, and a pose is exact. So each interval between two frames is
//! followed through: every body goes on as the frames before say; where two would enter each other, they hit. When
//! they do is told by where they are then, what becomes of it by the frames behind. `rebound` is that decision,
//! `interval` the way through one interval, `trajectory` what frames say of motion, `proximity` who is near whom
//! and where, `load` how hard bodies press on each other, `shape` what they look like.
//!
//! It needs two frames behind an interval, and says nothing of the first one, of which nobody knows how it was
//! entered. The memory goes with the bodies and the pairs that are near each other.

mod body;
mod interval;
mod load;
mod pose;
mod proximity;
mod rebound;
mod rubbing;
mod shape;
mod trajectory;

use std::collections::{BTreeMap, VecDeque};

use glam::DVec3;

use self::body::Mover;
use self::interval::{Bounce, Pair};
use self::proximity::Prober;
use self::trajectory::REMEMBERED;
use super::event::Event;
use crate::scene::animation::Transform;
use crate::{Error, Result};

pub use self::body::Body;
pub use self::shape::{Kind, Shape};

/// Bodies that close more slowly than this, in metres a second, meet without a sound. That is a fall of an eighth of a
/// millimetre.
pub const LEAST_IMPACT_MPS: f64 = 0.05;

/// Is fed the transforms of all bodies frame by frame, and tells what they do to each other.
///
/// ```
/// use froufrou::motion::event::Event;
/// use froufrou::motion::rigid::{Analyser, Body, Shape};
/// let ball = Body::new("ball", Shape::sphere(0.1), 500.0);
/// let floor = Body::new("floor", Shape::cuboid([5.0, 0.5, 5.0]), 1000.0).fixed();
/// let mut analyser = Analyser::new(vec![ball, floor], [0.0, -9.81, 0.0]);
/// let at = |y: f64| [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, y], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
/// // It falls from 1 m above the floor for 0.4515 s, and stays.
/// for frame in 0..20 {
///     let time_s = f64::from(frame) / 24.0;
///     let height = (1.0 - 4.905 * time_s * time_s).max(0.0);
///     analyser.feed(time_s, &[at(0.1 + height), at(-0.5)])?;
/// }
/// analyser.finish();
/// let Some(Event::Impact(impact)) = analyser.next_event() else { panic!("it hits the floor") };
/// assert!((impact.time_s - (1.0f64 / 4.905).sqrt()).abs() < 1e-4);
/// assert!(analyser.next_event().is_none());
/// # Ok::<(), froufrou::Error>(())
/// ```
pub struct Analyser {
    gravity: DVec3,
    movers: Vec<Mover>,
    /// The times of the frames that are remembered.
    times: VecDeque<f64>,
    /// How many frames were fed.
    fed: usize,
    /// The frame that begins the interval that comes next.
    next: usize,
    pairs: BTreeMap<[u32; 2], Pair>,
    /// How pairs that may be apart again have bounced a moment ago.
    bounces: BTreeMap<[u32; 2], Bounce>,
    prober: Prober,
    found: VecDeque<Event>,
}

impl Analyser {
    /// Begins with bodies of which nothing is known yet, and gravity in m/s².
    pub fn new(bodies: Vec<Body>, gravity_mps2: [f64; 3]) -> Self {
        Self {
            gravity: DVec3::from(gravity_mps2),
            movers: bodies.into_iter().map(Mover::new).collect(),
            times: VecDeque::new(),
            fed: 0,
            next: 0,
            pairs: BTreeMap::new(),
            bounces: BTreeMap::new(),
            prober: Prober::default(),
            found: VecDeque::new(),
        }
    }

    /// The bodies, in the order of their transforms.
    pub fn bodies(&self) -> impl ExactSizeIterator<Item = &Body> {
        self.movers.iter().map(|mover| &mover.body)
    }

    /// How many pairs of bodies are near each other: what the memory goes with.
    pub fn near_pairs(&self) -> usize {
        self.pairs.len()
    }

    /// Takes the next frame: its time and the transforms of all bodies, from their frames to the world.
    ///
    /// # Errors
    /// Another number of transforms than of bodies; a time that is not after that of the frame before; a transform
    /// that is not finite, flattens its body or changes its size. They name the body and the time.
    pub fn feed(&mut self, time_s: f64, transforms: &[Transform]) -> Result<()> {
        if transforms.len() != self.movers.len() {
            let (found, expected) = (transforms.len(), self.movers.len());
            return Err(Error::new(format!(
                "a frame of {found} transforms, and there are {expected} bodies"
            )));
        }
        let since_s = self.times.back().map_or(f64::INFINITY, |last_s| time_s - last_s);
        if !time_s.is_finite() || since_s <= 0.0 {
            return Err(Error::new(format!("a frame at {time_s} s, which is not after the one before")));
        }
        for (mover, transform) in self.movers.iter_mut().zip(transforms) {
            // What never moves is asked once.
            if !mover.body.moves && self.fed > 0 {
                continue;
            }
            let pose = mover.body.centre_pose(transform, time_s)?;
            let rolls = mover.body.shape.radius_m().is_some();
            mover.track.push(pose, since_s, rolls);
        }
        self.times.push_back(time_s);
        if self.times.len() > REMEMBERED {
            self.times.pop_front();
        }
        self.fed += 1;
        if self.fed >= self.next + 4 {
            self.interval();
        }
        Ok(())
    }

    /// Says that no more frames follow.
    pub fn finish(&mut self) {
        while self.next + 1 < self.fed {
            self.interval();
        }
    }

    /// The next event, in order of time; until [`Analyser::finish`] those up to two frames ago.
    pub fn next_event(&mut self) -> Option<Event> {
        self.found.pop_front()
    }

    /// Nothing that is still to be told happens before this, in seconds: the time of a
    /// frame, −∞ before two intervals are followed through.
    pub fn settled_s(&self) -> f64 {
        self.next.checked_sub(1).and_then(|frame| self.time_s(frame)).unwrap_or(f64::NEG_INFINITY)
    }

    /// The time of a frame that is remembered.
    fn time_s(&self, frame: usize) -> Option<f64> {
        let first = self.fed - self.times.len();
        self.times.get(frame.checked_sub(first)?).copied()
    }
}

#[cfg(test)]
mod tests;
