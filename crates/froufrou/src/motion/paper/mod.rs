//! What a sheet of paper does while it moves (Schreck et al. 2016): where it crumples, how fast it slides along what it
//! touches, where it tears, and which parts of it each of these makes vibrate.
//!
//! Meshes come in frame by frame, whatever made them. `sheet` is what stays of a mesh, `bending` how it is bent;
//! `regions` are its flat and curved parts, or `ready_made` where an animator has them; `holding` is what is held and
//! touched, `resonators` what vibrates at an event. `crumpling`, `sliding` and `tearing` find events. The
//! [`Analyser`] feeds them all.
//!
//! Nothing looks ahead: what a frame shows is told when it is fed, at times since the frame before.

mod bending;
mod bridge;
mod course;
mod crumpling;
mod holding;
pub mod ready_made;
pub mod regions;
mod resonators;
mod sheet;
mod sliding;
mod tearing;

use std::collections::VecDeque;

use self::bending::Bending;
use self::bridge::Frame;
use self::crumpling::Crumpling;
use self::holding::{Holding, LET_GO};
use self::ready_made::Partition;
use self::regions::Regions;
use self::resonators::{Seen, Spreading};
use self::sheet::{Lie, Sheet};
use self::tearing::Known;
use super::cloth::Restart;
use super::cloth::meshes::{Change, Meshes};
use super::cloth::pressing::Pressing;
use super::cloth::proximity::{Proximity, Touchable};
use super::event::{Buckle, Cause, Event, Friction, Moved, Resonator, Tear};
use crate::scene::animation::Mesh;
use crate::{Error, Place, Result};

/// How a sheet of paper is looked at.
#[derive(Debug, Clone, PartialEq)]
pub struct PaperSettings {
    /// Vibration stops at an edge where the sheet turns by more than this, in radians (a_max).
    pub ridge_rad: f64,
    /// What would turn by less than this over a way as long as the sheet is wide (the root of its area), in radians, is
    /// flat (ε_a).
    pub flat_rad: f64,
    /// Curvature is averaged over this length, in metres: the standard deviation along either axis; without it a
    /// twentieth of the root of the sheet's area.
    pub average_m: Option<f64>,
    /// How near is touching, in metres; 0: nothing touches.
    pub radius_m: f64,
    /// What is as near along the sheet itself does not count, in metres; without it twice the radius
    /// and the longest edge. With an infinite one the sheet never touches itself.
    pub surroundings_m: Option<f64>,
    /// What slides slower than this, in metres a second, is silent.
    pub threshold_mps: f64,
    /// A crumpling of less energy is none, in metres a second.
    pub least_energy_mps: f64,
    /// Vertices that are held whatever they do; others are held while they stay in their places.
    pub held: Vec<u32>,
}

impl Default for PaperSettings {
    /// Ridges as in the paper; flat is what is bent by less than 15° from end to end.
    fn default() -> Self {
        Self {
            ridge_rad: 0.5,
            flat_rad: 0.25,
            average_m: None,
            radius_m: 0.005,
            surroundings_m: None,
            threshold_mps: 0.03,
            least_energy_mps: 0.1,
            held: Vec::new(),
        }
    }
}

/// A mesh that takes part: a sheet of paper, or what paper may touch.
#[derive(Debug, Clone, PartialEq)]
pub struct Participant {
    /// Its name.
    pub name: String,
    /// How it is looked at, if it is a sheet.
    pub paper: Option<PaperSettings>,
}

/// Meshes in, what paper does out. It is never behind: what a frame shows is ready when it was fed.
///
/// ```
/// use froufrou::motion::paper::{Analyser, PaperSettings, Participant};
/// use froufrou::motion::Event;
/// use froufrou::scene::animation::Mesh;
/// // A strip of eight cells whose bow snaps through from one side to the other.
/// let frame = |bow: f32| Mesh {
///     positions: (0..18u8)
///         .map(|i| (f32::from(i / 2) / 8.0, f32::from(i % 2)))
///         .map(|(u, v)| [0.2 * u, bow * (u * std::f32::consts::PI).sin(), -0.1 * v])
///         .collect(),
///     face_vertices: (0..8u32).flat_map(|i| [2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1]).collect(),
///     face_sizes: vec![4; 8],
/// };
/// let strip = Participant { name: "strip".to_owned(), paper: Some(PaperSettings::default()) };
/// let mut analyser = Analyser::new(vec![strip]);
/// for time_s in [0.0, 0.02] {
///     analyser.feed(time_s, &[frame(-0.03)])?;
/// }
/// analyser.feed(0.04, &[frame(0.03)])?;
/// let Some(Event::Buckle(flap)) = analyser.next_event() else { panic!("it flaps") };
/// assert!((flap.time_s - 0.03).abs() < 1e-6 && flap.resonators[0].is_unconstrained());
/// # Ok::<(), froufrou::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Analyser {
    participants: Vec<Participant>,
    meshes: Meshes,
    sheets: Vec<Page>,
    /// What is known of sheets in the frame that comes next.
    given: Vec<Option<Partition>>,
    /// What presses in the frame that comes next.
    pressing: Pressing,
    ready: VecDeque<Event>,
    restarts: VecDeque<Restart>,
}

/// One of the sheets.
#[derive(Debug, Clone)]
struct Page {
    object: u32,
    settings: PaperSettings,
    sheet: Sheet,
    lie: Lie,
    bending: Bending,
    regions: Regions,
    proximity: Proximity,
    holding: Holding,
    crumpling: Crumpling,
    spreading: Spreading,
    /// Among which resonators each vertex is.
    pools: Vec<u32>,
}

impl Page {
    fn new(time_s: f64, object: u32, settings: PaperSettings, mesh: &Touchable) -> Self {
        let surface = mesh.surface();
        let sheet = Sheet::new(surface);
        let mut lie = Lie::default();
        lie.measure(&sheet, mesh.positions());
        let size_m = lie.size_m();
        let bending = Bending::new(&sheet, &lie, settings.average_m.unwrap_or(0.05 * size_m));
        let radius_m = LET_GO * settings.radius_m;
        // The way along edges is longer than the straight one, by an edge at most.
        let longest_m = lie.lengths.iter().fold(0.0, |longest: f64, &length| longest.max(length));
        let surroundings_m = settings.surroundings_m.unwrap_or(2.0 * radius_m + longest_m);
        let proximity = Proximity::new(object, mesh, radius_m, surroundings_m);
        let mut named = vec![false; sheet.vertex_count];
        for vertex in settings.held.iter().filter_map(|&vertex| surface.welded(vertex)) {
            named[vertex as usize] = true;
        }
        let holding =
            Holding::new(time_s, sheet.vertex_count, proximity.vertices(), named, settings.radius_m);
        // The mean of two curvatures, one of which is 0.
        let flat_per_m = 0.5 * settings.flat_rad / size_m;
        let crumpling = Crumpling::new(sheet.vertex_count, flat_per_m, settings.least_energy_mps);
        Self {
            object,
            settings,
            sheet,
            lie,
            bending,
            regions: Regions::default(),
            proximity,
            holding,
            crumpling,
            spreading: Spreading::default(),
            pools: Vec::new(),
        }
    }

    /// Takes the next frame, and tells what the sheet does in it.
    fn feed(
        &mut self,
        time_s: f64,
        step_s: f64,
        meshes: &Meshes,
        given: Option<&Partition>,
        pressing: &Pressing,
    ) -> Result<Vec<Event>> {
        let objects = meshes.objects();
        let Some(own) = objects.get(self.object as usize) else { return Ok(Vec::new()) };
        let Self {
            object,
            settings,
            sheet,
            lie,
            bending,
            regions,
            proximity,
            holding,
            crumpling,
            spreading,
            pools,
        } = self;
        let bend = || {
            lie.measure(sheet, own.positions());
            bending.measure(sheet, own.surface(), lie, settings.ridge_rad);
        };
        let ((), contacts) = rayon::join(bend, || proximity.contacts(objects));
        holding.feed(time_s, step_s, *object, contacts, objects, lie);
        let known = given.map(|partition| {
            let faces = meshes.faces(*object).map_or(0, |faces| faces.sizes.len());
            partition.given(faces, sheet, own.surface(), lie)
        });
        let known = known.transpose()?.flatten();
        match &known {
            Some(known) => regions.take(lie, bending, &known.of, &known.is_curved, &known.rulings),
            None => regions.find(time_s, sheet, lie, bending, settings.flat_rad),
        }
        if let Some(partition) = given {
            holding.name(own.surface(), partition.held.as_deref(), partition.touching.as_deref());
        }
        let seen = Seen::new(sheet, lie, regions, bending, holding, settings.flat_rad);
        spreading.part(seen);
        let name = |object: u32| meshes.name(object);
        let mut events = Vec::new();
        if let Some(partition) = given.filter(|_| step_s > 0.0) {
            let told = tearing::told(&partition.torn, own.surface(), own.positions());
            events.extend(told.iter().map(|torn| torn_apart(torn, name(*object), time_s, step_s)));
        }
        if step_s > 0.0 {
            let before_s = time_s - step_s;
            let pressing_n = pressing.of(*object, own.surface());
            for found in sliding::friction(sheet, lie, holding, settings.threshold_mps) {
                let resonators = spreading.resonators(seen, found.vertices.iter().copied());
                let other = name(found.other);
                let force = |force_n: &Vec<f64>| found.vertices.iter().map(|&v| force_n[v as usize]).sum();
                let force_n = pressing_n.as_ref().map(force);
                let friction = found.event(before_s, step_s, name(*object), other, resonators);
                events.push(Event::Friction(Friction { force_n, ..friction }));
            }
        }
        spreading.pools(seen, own.surface(), pools);
        let frame = Frame {
            time_s,
            sheet,
            surface: own.surface(),
            positions: own.positions(),
            lie,
            mean_per_m: &bending.mean_per_m,
            holds: &holding.holds,
            pools,
        };
        let flips = crumpling.feed(frame);
        if flips.is_empty() {
            return Ok(events);
        }
        // As it flips a sheet may be flat for a moment; it vibrates as what it was and will be.
        let bent;
        let seen = if known.is_none() {
            bent = regions.bent(sheet, lie, bending);
            let seen = Seen { regions: &bent, ..seen };
            spreading.part(seen);
            seen
        } else {
            seen
        };
        for flip in flips {
            let resonators = spreading.beside(seen, &flip.vertices);
            events.push(Event::Buckle(crumpled(flip, name(*object), resonators, time_s - step_s, time_s)));
        }
        Ok(events)
    }
}

fn torn_apart(torn: &tearing::Torn, sheet: String, time_s: f64, step_s: f64) -> Event {
    Event::Tear(Tear {
        time_s,
        sheet,
        position_m: torn.position.to_array(),
        length_m: torn.length_m,
        cause: Cause::Motion(Moved { from_s: time_s - step_s, to_s: time_s }),
    })
}

fn crumpled(
    flip: crumpling::Flip,
    name: String,
    resonators: Vec<Resonator>,
    from_s: f64,
    to_s: f64,
) -> Buckle {
    let largest = resonators.first().map_or(flip.position.to_array(), |resonator| resonator.position_m);
    Buckle {
        time_s: flip.time_s,
        lasts_s: flip.time_s - flip.first_s,
        cloth: name,
        position_m: flip.position.to_array(),
        patch: 0,
        patch_m: largest,
        energy_mps: flip.energy_mps,
        positive: flip.positive,
        vertices: flip.vertices.len() as u32,
        resonators,
        cause: Cause::Motion(Moved { from_s, to_s }),
    }
}

impl Analyser {
    /// Begins with nothing known of some objects.
    pub fn new(participants: Vec<Participant>) -> Self {
        let names = participants.iter().map(|participant| participant.name.clone()).collect();
        Self {
            given: vec![None; participants.len()],
            pressing: Pressing::default(),
            participants,
            meshes: Meshes::new(names),
            sheets: Vec::new(),
            ready: VecDeque::new(),
            restarts: VecDeque::new(),
        }
    }

    /// The objects, as they were given.
    pub fn participants(&self) -> &[Participant] {
        &self.participants
    }

    /// Another object takes the place of one, or comes behind the last. Of others nothing is forgotten but that they touched
    /// it.
    pub(in crate::motion) fn replace(&mut self, object: usize, participant: Participant) {
        self.sheets.retain(|page| page.object as usize != object);
        self.meshes.replace(object, participant.name.clone());
        match self.participants.get_mut(object) {
            Some(known) => (*known, self.given[object]) = (participant, None),
            None => {
                self.participants.push(participant);
                self.given.push(None);
            }
        }
    }

    /// Says what is known of a sheet in the frame that is fed next: its regions, what is held, what tears.
    ///
    /// # Errors
    /// An object that is no sheet.
    pub fn give(&mut self, object: usize, partition: Partition) -> Result<()> {
        let is_sheet = self.participants.get(object).is_some_and(|participant| participant.paper.is_some());
        match self.given.get_mut(object).filter(|_| is_sheet) {
            Some(given) => {
                *given = Some(partition);
                Ok(())
            }
            None => Err(Error::new(format!("regions for object {object}, which is no sheet"))),
        }
    }

    /// Says how hard each vertex of a sheet presses against what it touches in the frame that is fed next, in newtons,
    /// where a simulation knows it.
    ///
    /// # Errors
    /// What is no sheet; a force that is negative or no number.
    pub fn press(&mut self, object: u32, force_n: &[f32]) -> Result<()> {
        match self.participants.get(object as usize).filter(|participant| participant.paper.is_some()) {
            Some(participant) => self.pressing.say(object, &participant.name, force_n),
            None => Err(Error::new(format!("forces for object {object}, which is no sheet"))),
        }
    }

    /// Takes the next frame: its time, and the mesh of each object in their order.
    ///
    /// # Errors
    /// Another number of meshes than of objects; a time that is no number or not after that of the frame before; a
    /// position that is no number; faces that are none; a held vertex that is not there; regions that are not of the
    /// mesh. What was found before is still there then.
    pub fn feed(&mut self, time_s: f64, meshes: &[Mesh]) -> Result<()> {
        // The threads that share the work are woken once a frame: for a small mesh that takes longer than all the rest.
        rayon::scope(|_| self.take_frame(time_s, meshes))
    }

    fn take_frame(&mut self, time_s: f64, meshes: &[Mesh]) -> Result<()> {
        let pressing = std::mem::take(&mut self.pressing);
        let changes = self.meshes.look(time_s, meshes)?;
        pressing.check(time_s, meshes, |object| self.meshes.name(object))?;
        self.check_held(meshes)?;
        let step_s = self.meshes.last_s().map_or(0.0, |last_s| time_s - last_s);
        let is_first = self.meshes.objects().is_empty();
        let restarts = self.meshes.restarts(time_s, &changes);
        let mut events = Vec::new();
        for &Restart { object, .. } in &restarts {
            if let Some(change) = changes.get(object as usize).and_then(Option::as_ref) {
                let is_told =
                    self.given[object as usize].as_ref().is_some_and(|given| !given.torn.is_empty());
                if !is_told {
                    events.extend(self.tears(time_s, step_s, object, change, &meshes[object as usize]));
                }
            }
        }
        self.meshes.follow(time_s, meshes, changes)?;
        if is_first {
            let objects = self.meshes.objects();
            let page = |(object, participant): (usize, &Participant)| {
                Some(Page::new(time_s, object as u32, participant.paper.clone()?, objects.get(object)?))
            };
            self.sheets = self.participants.iter().enumerate().filter_map(page).collect();
        }
        for &Restart { object, .. } in &restarts {
            for page in self.sheets.iter_mut().filter(|page| page.object != object) {
                page.holding.lose(object);
                page.proximity.forget();
            }
            let Some(settings) = self.participants[object as usize].paper.clone() else { continue };
            let page = Page::new(time_s, object, settings, &self.meshes.objects()[object as usize]);
            match self.sheets.binary_search_by_key(&object, |known| known.object) {
                Ok(at) => self.sheets[at] = page,
                Err(at) => self.sheets.insert(at, page),
            }
        }
        self.restarts.extend(restarts);
        for page in &mut self.sheets {
            let object = page.object as usize;
            let given = self.given[object].take();
            let found = page.feed(time_s, step_s, &self.meshes, given.as_ref(), &pressing);
            events.extend(found.map_err(|fault| fault.at(Place::Part(self.meshes.name(page.object))))?);
        }
        events.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
        self.ready.extend(events);
        Ok(())
    }

    /// The next event, in order of time.
    pub fn next_event(&mut self) -> Option<Event> {
        self.ready.pop_front()
    }

    /// Nothing that is still to be told happens before this, in seconds: the time of the last frame, −∞ before the
    /// first.
    pub fn settled_s(&self) -> f64 {
        self.meshes.last_s().unwrap_or(f64::NEG_INFINITY)
    }

    /// The next object of which all was forgotten.
    pub fn next_restart(&mut self) -> Option<Restart> {
        self.restarts.pop_front()
    }

    /// The regions of an object in the last frame, if it is a sheet.
    pub fn regions(&self, object: usize) -> Option<&Regions> {
        self.sheets.iter().find(|page| page.object as usize == object).map(|page| &page.regions)
    }

    /// The resonators of something that happens at some vertices of a sheet in the last frame; none for what is no
    /// sheet.
    pub fn resonators_at(&mut self, object: usize, vertices: &[u32]) -> Vec<Resonator> {
        let Some(page) = self.sheets.iter_mut().find(|page| page.object as usize == object) else {
            return Vec::new();
        };
        let Page { settings, sheet, lie, bending, regions, holding, spreading, .. } = page;
        let seen = Seen::new(sheet, lie, regions, bending, holding, settings.flat_rad);
        let own = self.meshes.objects().get(object);
        let welded = vertices.iter().filter_map(|&vertex| own?.surface().welded(vertex));
        spreading.resonators(seen, welded)
    }

    /// A named vertex that is not there is a mistake of whoever named it.
    fn check_held(&self, meshes: &[Mesh]) -> Result<()> {
        for (participant, mesh) in self.participants.iter().zip(meshes) {
            let held = participant.paper.iter().flat_map(|paper| &paper.held);
            if let Some(vertex) = held.copied().find(|&vertex| vertex as usize >= mesh.positions.len()) {
                let what = format!("vertex {vertex} is held, but the mesh has {}", mesh.positions.len());
                return Err(Error::new(what)
                    .at(Place::Part(participant.name.clone()))
                    .help("vertices are counted from 0"));
            }
        }
        Ok(())
    }

    /// What tears as an object changes its faces.
    fn tears(&self, time_s: f64, step_s: f64, object: u32, change: &Change, mesh: &Mesh) -> Vec<Event> {
        let page = self.sheets.iter().find(|page| page.object == object);
        let known = self.meshes.objects().get(object as usize).zip(self.meshes.faces(object));
        let Some((page, (own, faces))) = page.zip(known) else { return Vec::new() };
        let old = Known {
            sheet: &page.sheet,
            surface: own.surface(),
            positions: own.positions(),
            face_vertices: &faces.vertices,
            face_sizes: &faces.sizes,
        };
        let sheet = Sheet::new(change.object.surface());
        let found = tearing::torn(old, Known::of(&sheet, change.object.surface(), mesh));
        found.iter().map(|torn| torn_apart(torn, self.meshes.name(object), time_s, step_s)).collect()
    }
}

#[cfg(test)]
mod tests;
