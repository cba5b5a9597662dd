//! How fast the vertices of a cloth slide along what they touch.
//!
//! A contact is found in one frame and carried to the next: the vertex moves, and so does the point of the triangle
//! that was closest to it, with the vertex's height above it. What the vertex moves beyond that, along the triangle, by
//! the time between the frames, is its speed in the first of them; of the last frame it is that of the way to it. So
//! whatever moves as one body does not slide. Between frames the speed is a monotone cubic (PCHIP), and 0 in frames
//! without a contact.
//!
//! A frame is told two frames later: one to know the speed, one to know its slope; and it is held back for a while, to
//! know whether a vertex that slides slowly will be fast enough to be heard. So a vertex is silent until a while before
//! it first exceeds the threshold. Told offline, with all the future known, slower sliding before that would be heard
//! as well; it is below the threshold. A vertex that never exceeds it is silent in either.

use std::collections::VecDeque;

use glam::DVec3;
use rayon::prelude::*;

use super::proximity::{Contact, Touchable};
use crate::hermite;

/// What sliding is, and how it is heard.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlidingSettings {
    /// How near is touching, in metres.
    pub radius_m: f64,
    /// What is as near along the cloth itself does not count, in metres; without it twice the radius.
    pub surroundings_m: Option<f64>,
    /// A vertex that never slides faster than this, in metres a second, is silent.
    pub threshold_mps: f64,
    /// How long before it first slides faster than that it is heard, in seconds.
    pub look_ahead_s: f64,
    /// The speed that is told is 1 m/s · (speed / `scale_mps`)^`exponent`, for simulations that are too fast.
    pub scale_mps: f64,
    /// See there.
    pub exponent: f64,
    /// Where a simulation says how hard it presses, a vertex counts by the area that would press as hard under this, in
    /// pascals: what truly touches grows with the force, and so does the power of the sound.
    pub pressure_pa: f64,
}

impl Default for SlidingSettings {
    /// Five centimetres and two centimetres a second, as of cotton in An et al. (2012); speeds as they are. The pressure
    /// is that of a hand that strokes: 2 N on 200 cm².
    fn default() -> Self {
        Self {
            radius_m: 0.05,
            surroundings_m: None,
            threshold_mps: 0.02,
            look_ahead_s: 0.25,
            scale_mps: 1.0,
            exponent: 1.0,
            pressure_pa: 100.0,
        }
    }
}

impl SlidingSettings {
    fn heard_mps(&self, speed_mps: f64) -> f64 {
        if self.scale_mps == 1.0 && self.exponent == 1.0 {
            return speed_mps;
        }
        if speed_mps == 0.0 { 0.0 } else { (speed_mps / self.scale_mps).powf(self.exponent) }
    }
}

/// The vertices of a cloth that slide in one frame, in arrays of one length. A vertex that is not there neither
/// slides nor begins to.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sliding {
    /// The cloth, by its number among the objects.
    pub cloth: u32,
    /// The frame's time in seconds.
    pub time_s: f64,
    /// The time until the next frame in seconds; that since the one before in the last.
    pub lasts_s: f64,
    /// The pressure that its areas are under, in pascals, where forces are known.
    pub pressure_pa: Option<f64>,
    /// The vertices, ascending.
    pub vertex: Vec<u32>,
    /// What each slides along, by its number among the objects.
    pub other: Vec<u32>,
    /// Where it is, in metres.
    pub position_m: Vec<[f32; 3]>,
    /// Its area, in square metres; where forces are known, that of [`SlidingSettings::pressure_pa`].
    pub area_m2: Vec<f64>,
    /// How fast it slides, in metres a second.
    pub speed_mps: Vec<f64>,
    /// The slope of that at this time, in metres a second squared.
    pub slope_mps2: Vec<f64>,
}

impl Sliding {
    /// The speed and slope of a vertex; 0 and 0 of one that is not there.
    pub fn speed_of(&self, vertex: u32) -> (f64, f64) {
        match self.vertex.binary_search(&vertex) {
            Ok(at) => (self.speed_mps[at], self.slope_mps2[at]),
            Err(_) => (0.0, 0.0),
        }
    }

    /// How fast a vertex slides at a time between this frame and the next, in metres a second.
    pub fn speed_between(&self, next: &Sliding, vertex: u32, time_s: f64) -> f64 {
        let (a, b) = (self.speed_of(vertex), next.speed_of(vertex));
        let length_s = next.time_s - self.time_s;
        hermite::cubic(time_s - self.time_s, length_s, [a.0, b.0], [a.1, b.1]).0
    }

    fn push(&mut self, frame: &Frame, index: usize, vertex: u32, slope_mps2: f64) {
        self.vertex.push(vertex);
        self.other.push(frame.other[index]);
        self.position_m.push(frame.position_m[index]);
        self.area_m2.push(frame.area_m2[index]);
        self.speed_mps.push(frame.speed_mps[index]);
        self.slope_mps2.push(slope_mps2);
    }

    /// Leaves out vertices.
    fn retain(&mut self, keep: impl Fn(u32) -> bool) {
        let kept: Vec<bool> = self.vertex.iter().map(|&vertex| keep(vertex)).collect();
        fn thin<T>(items: &mut Vec<T>, kept: &[bool]) {
            let mut kept = kept.iter();
            items.retain(|_| kept.next().copied().unwrap_or_default());
        }
        thin(&mut self.vertex, &kept);
        thin(&mut self.other, &kept);
        thin(&mut self.position_m, &kept);
        thin(&mut self.area_m2, &kept);
        thin(&mut self.speed_mps, &kept);
        thin(&mut self.slope_mps2, &kept);
    }
}

/// A frame with all vertices that may touch something.
#[derive(Debug, Clone, Default)]
struct Frame {
    time_s: f64,
    /// Whether areas are those of forces.
    is_pressed: bool,
    other: Vec<u32>,
    position_m: Vec<[f32; 3]>,
    area_m2: Vec<f64>,
    /// As it is heard.
    speed_mps: Vec<f64>,
}

/// Follows the contacts of one cloth from frame to frame.
#[derive(Debug, Clone)]
pub struct Slides {
    settings: SlidingSettings,
    cloth: u32,
    vertices: Vec<u32>,
    /// What was touched in the last frame, and the frame, whose speeds are not known yet.
    contacts: Vec<Option<Contact>>,
    last: Option<Frame>,
    /// The last frames whose speeds are known, three at most. Of the last of them the slopes are not known; before the
    /// third comes, of none.
    known: VecDeque<Frame>,
    /// Whether each of the mesh's vertices was ever fast enough to be heard.
    heard: Vec<bool>,
    /// Frames that wait for it.
    held: VecDeque<Sliding>,
    ready: VecDeque<Sliding>,
}

impl Slides {
    /// Begins with nothing known of a cloth, given its number and the vertices that may touch something, ascending.
    pub fn new(settings: SlidingSettings, cloth: u32, vertices: &[u32]) -> Self {
        let count = vertices.last().map_or(0, |&last| last as usize + 1);
        Self {
            settings,
            cloth,
            vertices: vertices.to_vec(),
            contacts: vec![None; vertices.len()],
            last: None,
            known: VecDeque::new(),
            heard: vec![false; count],
            held: VecDeque::new(),
            ready: VecDeque::new(),
        }
    }

    /// Takes the next frame: what its vertices touch now, the objects as they have come to lie since the last frame,
    /// and the area of every vertex of the cloth, or where it `is_pressed` that which would press as hard. What is not
    /// given touches nothing and has no area.
    pub fn feed(
        &mut self,
        time_s: f64,
        contacts: &[Option<Contact>],
        objects: &[Touchable],
        area_m2: &[f64],
        is_pressed: bool,
    ) {
        if let Some(last) = self.last.take() {
            let step_s = time_s - last.time_s;
            self.know(last, step_s, objects);
        }
        self.contacts.clear();
        self.contacts.extend_from_slice(contacts);
        self.contacts.resize(self.vertices.len(), None);
        let own = objects.get(self.cloth as usize).map_or(&[][..], Touchable::positions);
        let mut frame = Frame { time_s, is_pressed, ..Frame::default() };
        let other = |contact: &Option<Contact>| contact.map_or(u32::MAX, |contact| contact.object);
        frame.other.extend(self.contacts.iter().map(other));
        for &vertex in &self.vertices {
            frame.position_m.push(own.get(vertex as usize).copied().unwrap_or_default());
            frame.area_m2.push(area_m2.get(vertex as usize).copied().unwrap_or_default());
        }
        self.last = Some(frame);
        self.release(time_s);
    }

    /// Tells that an object has changed its faces: what touched it before cannot be followed.
    pub fn lose(&mut self, object: u32) {
        for contact in &mut self.contacts {
            if contact.is_some_and(|contact| contact.object == object) {
                *contact = None;
            }
        }
    }

    /// Ends it; all that is left is ready then. `objects` are as they were given last. What comes next begins anew.
    pub fn finish(&mut self, objects: &[Touchable]) {
        // What was moved on the way to the last frame is the speed in it.
        if let (Some(last), Some(before)) = (self.last.take(), self.known.back()) {
            let step_s = last.time_s - before.time_s;
            self.know(last, step_s, objects);
        }
        match self.known.len() {
            2 => (0..2).for_each(|at| self.tell(at)),
            3 => self.tell(2),
            _ => {}
        }
        self.release(f64::INFINITY);
        let ready = std::mem::take(&mut self.ready);
        *self = Self { ready, ..Self::new(self.settings, self.cloth, &self.vertices) };
    }

    /// The next frame of which all is known.
    pub fn next_sliding(&mut self) -> Option<Sliding> {
        self.ready.pop_front()
    }

    /// No frame that is still to come is earlier than this.
    pub fn settled_s(&self) -> f64 {
        let told = self.ready.front().or(self.held.front()).map(|sliding| sliding.time_s);
        let known = if self.known.len() < 3 { self.known.front() } else { self.known.back() };
        let frame = known.or(self.last.as_ref()).map(|frame| frame.time_s);
        told.or(frame).unwrap_or(f64::NEG_INFINITY)
    }

    /// Finds the speeds in a frame from what has moved within a time.
    fn know(&mut self, mut frame: Frame, step_s: f64, objects: &[Touchable]) {
        let Self { settings, cloth, vertices, contacts, .. } = self;
        let own = objects.get(*cloth as usize);
        let speed = |(&vertex, contact): (&u32, &Option<Contact>)| {
            let moved = contact.and_then(|contact| {
                let object = objects.get(contact.object as usize)?;
                let triangle = object.carried(contact.triangle, contact.barycentric)?;
                Some(slid_m(own?.vertex(vertex)?, triangle))
            });
            moved.map_or(0.0, |moved| moved / step_s)
        };
        let speeds: Vec<f64> =
            vertices.par_iter().zip(contacts.par_iter()).with_min_len(1024).map(speed).collect();
        for (&vertex, &speed_mps) in vertices.iter().zip(&speeds) {
            self.heard[vertex as usize] |= speed_mps > settings.threshold_mps;
        }
        frame.speed_mps.extend(speeds.into_iter().map(|speed_mps| settings.heard_mps(speed_mps)));
        let is_first = self.known.len() < 3;
        if !is_first {
            self.known.pop_front();
        }
        self.known.push_back(frame);
        if self.known.len() == 3 {
            if is_first {
                self.tell(0);
            }
            self.tell(1);
        }
    }

    /// Tells one of the known frames, with the slopes that those beside it give it.
    fn tell(&mut self, at: usize) {
        let known = &self.known;
        let (Some(frame), Some(last)) = (known.get(at), known.len().checked_sub(1)) else { return };
        let lengths: Vec<f64> =
            known.iter().zip(known.iter().skip(1)).map(|(a, b)| b.time_s - a.time_s).collect();
        let mut told = Sliding {
            cloth: self.cloth,
            time_s: frame.time_s,
            lasts_s: lengths[at.min(last.saturating_sub(1))],
            pressure_pa: frame.is_pressed.then_some(self.settings.pressure_pa),
            ..Sliding::default()
        };
        for (index, &vertex) in self.vertices.iter().enumerate() {
            let speed = |at: usize| known[at].speed_mps[index];
            if (0..=last).all(|at| speed(at) == 0.0) {
                continue;
            }
            let secant = |at: usize| (speed(at + 1) - speed(at)) / lengths[at];
            let slope = match (at, last) {
                (_, 1) => secant(0),
                (0, _) => hermite::monotone_end_slope(lengths[0], lengths[1], secant(0), secant(1)),
                (1, _) => hermite::monotone_slope(lengths[0], lengths[1], secant(0), secant(1)),
                _ => hermite::monotone_end_slope(lengths[1], lengths[0], secant(1), secant(0)),
            };
            if speed(at) != 0.0 || slope != 0.0 {
                told.push(frame, index, vertex, slope);
            }
        }
        self.held.push_back(told);
    }

    /// Lets go what need not wait any longer at a time.
    fn release(&mut self, time_s: f64) {
        while self.held.front().is_some_and(|told| told.time_s + self.settings.look_ahead_s < time_s) {
            let Some(mut told) = self.held.pop_front() else { break };
            told.retain(|vertex| self.heard[vertex as usize]);
            self.ready.push_back(told);
        }
    }
}

/// How far a vertex slides along a triangle, in metres, given where it was and is, and where the point of the triangle
/// was and is, with the triangle's normal.
fn slid_m(vertex: [DVec3; 2], triangle: [(DVec3, DVec3); 2]) -> f64 {
    let [(_, normal), _] = triangle;
    moved_m(vertex, triangle).reject_from_normalized(normal.normalize_or_zero()).length()
}

/// How a vertex moves beside a triangle, in metres: beyond what it would if it stayed at its height above the point.
pub(in crate::motion) fn moved_m(
    [from, to]: [DVec3; 2],
    [(foot, normal), (foot_now, normal_now)]: [(DVec3, DVec3); 2],
) -> DVec3 {
    let (normal, normal_now) = (normal.normalize_or_zero(), normal_now.normalize_or_zero());
    let height_m = (from - foot).dot(normal);
    (to - from) - (foot_now + height_m * normal_now - foot - height_m * normal)
}

#[cfg(test)]
mod tests;
