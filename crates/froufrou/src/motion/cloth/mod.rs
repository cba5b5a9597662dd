//! What cloth does while it moves: where it buckles, and how fast it slides along what it touches (An, James and
//! Marschner 2012). Meshes come in frame by frame, whatever made them; nothing of a simulation is asked for.
//!
//! `triangulation` is what stays of a mesh, `curvature` how it is bent; `buckles` follows the places where that
//! changes its sign. `geodesic` is what belongs to a vertex's own surroundings, `proximity` what it touches beyond them
//! (by the `tree` of each mesh, its `leaf`s and the point of a `triangle`); `sliding` how fast it moves along that. The
//! [`Analyser`] feeds them all.
//!
//! # The energies of An et al.
//!
//! They sum |H(t) − H(t−1)| over the vertices that change sign in a frame. That grows with the number of vertices and
//! falls with the frame rate, so that each of their animations has a threshold of its own. Here a vertex counts by its
//! area and by its rate: E = Σ A·|dH/dt|, in m²·1/m/s = m/s. With vertices of the mean area *a* and frames Δt apart, a
//! threshold `E_min` of theirs is E = `E_min`·a/Δt of ours, if their unit of length is the metre.

pub mod buckles;
pub mod curvature;
pub(super) mod gather;
pub(in crate::motion) mod geodesic;
mod leaf;
pub(super) mod meshes;
mod patches;
pub(in crate::motion) mod pressing;
pub mod proximity;
#[cfg(test)]
pub(super) mod shapes;
pub mod sliding;
pub mod tension;
mod tree;
mod triangle;
pub mod triangulation;

use std::collections::VecDeque;

use glam::DVec3;

use self::buckles::{BuckleSettings, Buckled, Buckles};
use self::curvature::Curvature;
use self::meshes::Meshes;
use self::patches::Patches;
use self::pressing::Pressing;
use self::proximity::{Proximity, Touchable};
use self::sliding::{Slides, Sliding, SlidingSettings};
use self::tension::{Beat, Tension, TensionSettings};
use super::event::{Buckle, Cause, Event, Flap, Moved};
use crate::scene::animation::Mesh;
use crate::{Error, Place, Result};

/// How a cloth is looked at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClothSettings {
    /// What counts as a buckle.
    pub buckles: BuckleSettings,
    /// What counts as sliding.
    pub sliding: SlidingSettings,
    /// How taut it is and how it beats the air, where that is asked for.
    pub tension: Option<TensionSettings>,
    /// In how many patches what it does is told.
    pub patches: usize,
}

impl Default for ClothSettings {
    /// The cloth is told as a whole.
    fn default() -> Self {
        Self {
            buckles: BuckleSettings::default(),
            sliding: SlidingSettings::default(),
            tension: None,
            patches: 1,
        }
    }
}

/// A mesh that takes part: a cloth, or what cloth may touch.
#[derive(Debug, Clone, PartialEq)]
pub struct Participant {
    /// Its name.
    pub name: String,
    /// How it is looked at, if it is a cloth.
    pub cloth: Option<ClothSettings>,
}

/// Why what is known of an object is forgotten from a frame on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Why {
    /// Its vertices or faces are others.
    Faces,
    /// Vertices that were in one place are apart: a seam opens, and from now on is a boundary.
    Seam,
}

/// What is known of an object is forgotten, and begins anew with a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Restart {
    /// The time of the frame, in seconds.
    pub time_s: f64,
    /// The object, by its number.
    pub object: u32,
    /// Why.
    pub why: Why,
}

/// Meshes in, what cloth does out.
///
/// It is some frames behind: sliding by its look-ahead and two frames, buckles by a quarter of a second at most (the
/// gap, the longest and a tenth of a second of their settings together).
///
/// ```
/// use froufrou::motion::cloth::{Analyser, ClothSettings, Participant};
/// use froufrou::motion::Event;
/// use froufrou::scene::animation::Mesh;
/// // A sheet of four cells whose middle snaps through from one side to the other.
/// let frame = |height: f32| Mesh {
///     positions: (0..9u8).map(|i| [f32::from(i % 3), f32::from(i / 3), if i == 4 { height } else { 0.0 }]).collect(),
///     face_vertices: vec![0, 1, 4, 3, 1, 2, 5, 4, 3, 4, 7, 6, 4, 5, 8, 7],
///     face_sizes: vec![4; 4],
/// };
/// let sheet = Participant { name: "sheet".to_owned(), cloth: Some(ClothSettings::default()) };
/// let mut analyser = Analyser::new(vec![sheet]);
/// analyser.feed(0.0, &[frame(-0.2)])?;
/// analyser.feed(0.1, &[frame(0.2)])?;
/// analyser.finish();
/// let Some(Event::Buckle(buckle)) = analyser.next_event() else { panic!("it buckles") };
/// assert!((buckle.time_s - 0.05).abs() < 1e-9 && buckle.positive);
/// # Ok::<(), froufrou::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Analyser {
    participants: Vec<Participant>,
    meshes: Meshes,
    cloths: Vec<Cloth>,
    step_s: f64,
    events: Vec<Event>,
    ready: VecDeque<Event>,
    slidings: VecDeque<Sliding>,
    restarts: VecDeque<Restart>,
    /// What presses in the frame to come.
    pressing: Pressing,
}

/// One of the cloths.
#[derive(Debug, Clone)]
struct Cloth {
    object: u32,
    settings: ClothSettings,
    curvature: Curvature,
    buckles: Buckles,
    proximity: Proximity,
    slides: Slides,
    patches: Patches,
    tension: Option<Tension>,
    /// In the frame to come, the area that would press as hard as each vertex does; where forces are known.
    pressing_m2: Option<Vec<f64>>,
    /// What is not told yet.
    beats: Vec<Beat>,
}

impl Cloth {
    fn new(object: u32, settings: ClothSettings, mesh: &Touchable) -> Self {
        let SlidingSettings { radius_m, surroundings_m, .. } = settings.sliding;
        let proximity = Proximity::new(object, mesh, radius_m, surroundings_m.unwrap_or(2.0 * radius_m));
        let slides = Slides::new(settings.sliding, object, proximity.vertices());
        Self {
            object,
            settings,
            curvature: Curvature::default(),
            buckles: Buckles::new(settings.buckles),
            proximity,
            slides,
            patches: Patches::new(mesh.positions(), settings.patches),
            tension: settings.tension.map(|settings| Tension::new(settings, mesh)),
            pressing_m2: None,
            beats: Vec::new(),
        }
    }

    fn feed(&mut self, time_s: f64, objects: &[Touchable]) -> Vec<Buckled> {
        let Self { object, curvature, buckles, proximity, slides, .. } = self;
        let Some(own) = objects.get(*object as usize) else { return Vec::new() };
        let bend = || {
            curvature.measure(own.surface(), own.positions());
            buckles.feed(time_s, own.surface(), curvature, own.positions())
        };
        let (buckled, contacts) = rayon::join(bend, || proximity.contacts(objects));
        let pressing_m2 = self.pressing_m2.take();
        let area_m2 = pressing_m2.as_deref().unwrap_or(curvature.area_m2());
        slides.feed(time_s, contacts, objects, area_m2, pressing_m2.is_some());
        if let Some(tension) = &mut self.tension {
            self.beats.extend(tension.feed(time_s, own, curvature.area_m2(), &self.patches));
        }
        buckled
    }

    fn settled_s(&self) -> f64 {
        self.buckles.settled_s().min(self.slides.settled_s())
    }
}

impl Analyser {
    /// Begins with nothing known of some objects.
    pub fn new(participants: Vec<Participant>) -> Self {
        let names = participants.iter().map(|participant| participant.name.clone()).collect();
        Self {
            participants,
            meshes: Meshes::new(names),
            cloths: Vec::new(),
            step_s: 0.0,
            events: Vec::new(),
            ready: VecDeque::new(),
            slidings: VecDeque::new(),
            restarts: VecDeque::new(),
            pressing: Pressing::default(),
        }
    }

    /// The objects, as they were given.
    pub fn participants(&self) -> &[Participant] {
        &self.participants
    }

    /// Another object takes the place of one, or comes behind the last. What was known of the one before is told; of others
    /// nothing is forgotten but that they touched it.
    pub(in crate::motion) fn replace(&mut self, object: usize, participant: Participant) {
        if let Some(at) = self.cloths.iter().position(|cloth| cloth.object as usize == object) {
            self.end(at);
            self.cloths.remove(at);
        }
        self.meshes.replace(object, participant.name.clone());
        match self.participants.get_mut(object) {
            Some(known) => *known = participant,
            None => self.participants.push(participant),
        }
    }

    /// Says how hard each vertex of a cloth presses against what it touches in the frame to come, in newtons, where a
    /// simulation knows it. What it touches is found as ever.
    ///
    /// # Errors
    /// What is no cloth; a force that is negative or no number.
    pub fn press(&mut self, object: u32, force_n: &[f32]) -> Result<()> {
        let Some(participant) = self.participants.get(object as usize) else {
            return Err(Error::new(format!("there is no object {object}")));
        };
        if participant.cloth.is_none() {
            return Err(Error::new("forces are those of a cloth, and it is none")
                .at(Place::Part(participant.name.clone())));
        }
        self.pressing.say(object, &participant.name, force_n)
    }

    /// Takes the next frame: its time, and the mesh of each object in their order.
    ///
    /// # Errors
    /// Another number of meshes than of objects; a time that is no number or not after that of the frame before; a
    /// position that is no number; faces that are none. What was found before is still there then.
    pub fn feed(&mut self, time_s: f64, meshes: &[Mesh]) -> Result<()> {
        // The threads that share the work are woken once a frame: for a small mesh that takes longer than all the rest.
        rayon::scope(|_| self.take_frame(time_s, meshes))
    }

    fn take_frame(&mut self, time_s: f64, meshes: &[Mesh]) -> Result<()> {
        let pressing = std::mem::take(&mut self.pressing);
        let changes = self.meshes.look(time_s, meshes)?;
        pressing.check(time_s, meshes, |object| self.meshes.name(object))?;
        let restarts = self.meshes.restarts(time_s, &changes);
        let is_first = self.meshes.objects().is_empty();
        for &Restart { object, .. } in &restarts {
            for at in 0..self.cloths.len() {
                if self.cloths[at].object == object {
                    self.end(at);
                } else {
                    self.cloths[at].slides.lose(object);
                    self.cloths[at].proximity.forget();
                }
            }
        }
        self.step_s = self.meshes.last_s().map_or(0.0, |last_s| time_s - last_s);
        self.meshes.follow(time_s, meshes, changes)?;
        if is_first {
            self.begin();
        }
        for &Restart { object, .. } in &restarts {
            let Some(settings) = self.participants[object as usize].cloth else { continue };
            let cloth = Cloth::new(object, settings, &self.meshes.objects()[object as usize]);
            match self.cloths.binary_search_by_key(&object, |known| known.object) {
                Ok(at) => self.cloths[at] = cloth,
                Err(at) => self.cloths.insert(at, cloth),
            }
        }
        self.restarts.extend(restarts);
        let objects = self.meshes.objects();
        for cloth in &mut self.cloths {
            let pressing_n = pressing.of(cloth.object, objects[cloth.object as usize].surface());
            let pressure_pa = cloth.settings.sliding.pressure_pa;
            cloth.pressing_m2 = pressing_n.map(|all| all.into_iter().map(|n| n / pressure_pa).collect());
        }
        for at in 0..self.cloths.len() {
            let buckled = self.cloths[at].feed(time_s, self.meshes.objects());
            self.tell(at, buckled);
        }
        self.release(self.settled_s());
        Ok(())
    }

    /// Nothing that is still to be told of the cloths that are looked at happens before this, in seconds; −∞ where nothing of one
    /// is settled yet, ∞ where none is looked at, as before the first frame.
    pub fn settled_s(&self) -> f64 {
        self.cloths.iter().map(Cloth::settled_s).fold(f64::INFINITY, f64::min)
    }

    /// Ends it: what was not settled is ready then.
    pub fn finish(&mut self) {
        for at in 0..self.cloths.len() {
            self.end(at);
        }
        self.cloths.clear();
        self.meshes.clear();
        self.release(f64::INFINITY);
    }

    /// The next event, in order of time.
    pub fn next_event(&mut self) -> Option<Event> {
        self.ready.pop_front()
    }

    /// The next frame of a cloth that slides, or does not; of each cloth in order of time.
    pub fn next_sliding(&mut self) -> Option<Sliding> {
        self.slidings.pop_front()
    }

    /// The next object of which all was forgotten.
    pub fn next_restart(&mut self) -> Option<Restart> {
        self.restarts.pop_front()
    }

    fn begin(&mut self) {
        let objects = self.meshes.objects();
        let cloth = |(object, participant): (usize, &Participant)| {
            Some(Cloth::new(object as u32, participant.cloth?, &objects[object]))
        };
        self.cloths = self.participants.iter().enumerate().filter_map(cloth).collect();
    }

    /// Ends one cloth, and tells what is left.
    fn end(&mut self, at: usize) {
        let cloth = &mut self.cloths[at];
        cloth.slides.finish(self.meshes.objects());
        let buckled = cloth.buckles.finish();
        cloth.beats.extend(cloth.tension.iter_mut().flat_map(Tension::finish));
        self.tell(at, buckled);
    }

    /// Makes events of what a cloth did.
    fn tell(&mut self, at: usize, buckled: Vec<Buckled>) {
        let cloth = &mut self.cloths[at];
        let name = |object: u32| self.meshes.name(object);
        let positions =
            self.meshes.objects().get(cloth.object as usize).map_or(&[][..], |object| object.positions());
        let middles = if buckled.is_empty() { Vec::new() } else { cloth.patches.middles(positions) };
        let nearest = |position_m: [f64; 3]| {
            let away = |middle: &DVec3| middle.distance_squared(DVec3::from(position_m));
            let nearest = middles.iter().enumerate().min_by(|a, b| away(a.1).total_cmp(&away(b.1)));
            nearest.map_or((0, position_m), |(patch, middle)| (patch as u32, middle.to_array()))
        };
        let buckles = buckled.into_iter().map(|buckled| {
            let Buckled { time_s, span_s, position_m, energy_mps, positive, vertices } = buckled;
            let (patch, patch_m) = nearest(position_m);
            Event::Buckle(Buckle {
                time_s,
                lasts_s: span_s[1] - span_s[0],
                cloth: name(cloth.object),
                position_m,
                patch,
                patch_m,
                energy_mps,
                positive,
                vertices,
                resonators: Vec::new(),
                cause: Cause::Motion(Moved {
                    from_s: span_s[0] - self.step_s,
                    to_s: span_s[1] + self.step_s,
                }),
            })
        });
        self.events.extend(buckles);
        let flaps = cloth.beats.drain(..).map(|beat| {
            Event::Flap(Flap {
                time_s: beat.time_s,
                lasts_s: beat.lasts_s,
                cloth: name(cloth.object),
                patch: beat.patch,
                position_m: beat.middle_m.to_array(),
                tension_n_per_m: beat.tension_n_per_m,
                speed_mps: beat.speed_mps,
                impulse_ns: beat.impulse_ns,
                cause: Cause::Motion(Moved { from_s: beat.time_s, to_s: beat.time_s + beat.lasts_s }),
            })
        });
        self.events.extend(flaps);
        while let Some(sliding) = cloth.slides.next_sliding() {
            self.events
                .extend(gather::events(&sliding, &cloth.patches, name).into_iter().map(Event::Friction));
            self.slidings.push_back(sliding);
        }
    }

    /// Lets go the events before a time.
    fn release(&mut self, settled_s: f64) {
        self.events.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
        let ready = self.events.partition_point(|event| event.time_s() < settled_s);
        self.ready.extend(self.events.drain(..ready));
    }
}

#[cfg(test)]
mod tests;
