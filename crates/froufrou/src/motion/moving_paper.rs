//! What the sheets of paper of a scene do, told by how their meshes and those of what they touch move.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use super::cloth::Restart;
use super::event::Event;
use super::moving_meshes::{Analyse, Force, MovingMeshes, Step, WithMesh, are_told, with_meshes};
use super::paper::ready_made::{Partition, Reader};
use super::paper::{Analyser, PaperSettings, Participant};
use crate::scene::Scene;
use crate::scene::animation::Mesh;
use crate::scene::carrier::Carrier;
use crate::scene::file::Paper;
use crate::scene::world::World;
use crate::{Error, Place, Result};

/// Regions that are as early as this before a frame, in seconds, are those of it.
const EARLY_S: f64 = 1e-6;

/// What is told of sheets.
#[derive(Debug, Clone, PartialEq)]
pub enum Told {
    /// Something happened; in order of time.
    Event(Box<Event>),
    /// What was known of an object is forgotten.
    Restart(Restart),
}

/// An object with a mesh: a sheet, or what sheets may touch.
pub struct Body {
    /// Its name.
    pub name: String,
    /// How it is looked at, if it is a sheet.
    pub paper: Option<PaperSettings>,
    /// A file of its regions, where whatever animates it has them; see [`super::paper::ready_made`].
    pub regions: Option<PathBuf>,
    /// What its file calls the force with which each vertex presses, in newtons, where it has that.
    pub force: Option<String>,
    /// What carries its mesh.
    pub carrier: Carrier,
}

/// What sheets do, frame by frame. It ends after its first error.
///
/// Frames are those of the sheet with the most of them; other meshes are asked where they are then. Of a file of
/// regions a frame takes the last ones that are not later; before the first they are found. It holds one frame of all
/// meshes and what its analyser holds.
///
/// ```no_run
/// # fn main() -> froufrou::Result<()> {
/// use froufrou::motion::moving_paper::{Body, MovingPaper, Told};
/// use froufrou::motion::paper::PaperSettings;
/// use froufrou::scene::{Scene, world::World};
/// let scene = Scene::open("scene.toml", false)?;
/// let world = World::open(&scene)?;
/// let mut bodies = Vec::new();
/// for body in world.objects.iter().flatten() {
///     let paper = (body.name == "letter").then(PaperSettings::default);
///     if let Some(carrier) = body.carrier.clone() {
///         bodies.push(Body { name: body.name.clone(), paper, regions: None, force: None, carrier });
///     }
/// }
/// for told in MovingPaper::new(bodies, &scene.file)? {
///     if let Told::Event(event) = told? {
///         println!("{event:?}");
///     }
/// }
/// # Ok(()) }
/// ```
pub struct MovingPaper(MovingMeshes<Sheets>);

/// An analyser that is given the regions of files.
struct Sheets {
    analyser: Analyser,
    files: Vec<Option<Regions>>,
    forces: Vec<Force>,
    force_n: Vec<f32>,
}

/// A file of regions that is read along.
struct Regions {
    file: PathBuf,
    reader: Reader<BufReader<File>>,
    /// Those that hold now, and those that come next, each with its line.
    now: Option<(usize, Partition)>,
    next: Option<(usize, Partition)>,
    /// What was torn since the last frame.
    torn: Vec<[u32; 2]>,
}

impl Regions {
    fn open(file: &Path) -> Result<Self> {
        let open = File::open(file).map_err(|fault| Error::io("open", file, fault))?;
        let mut reader = Reader::new(BufReader::new(open), file);
        let next = Self::read(&mut reader)?;
        Ok(Self { file: file.to_owned(), reader, now: None, next, torn: Vec::new() })
    }

    fn read(reader: &mut Reader<BufReader<File>>) -> Result<Option<(usize, Partition)>> {
        let read = reader.next().transpose()?;
        Ok(read.map(|partition| (reader.line(), partition)))
    }

    /// Those that hold at a time for a mesh, and what is torn since the last time.
    fn at(&mut self, time_s: f64, mesh: &Mesh) -> Result<Option<Partition>> {
        self.torn.clear();
        while let Some((line, mut next)) = self.next.take_if(|(_, next)| next.time_s <= time_s + EARLY_S) {
            // What lies between two frames may be of a mesh that is never seen: it tells nothing of this one.
            if next.check(mesh).is_ok() {
                self.torn.append(&mut next.torn);
            }
            self.now = Some((line, next));
            self.next = Self::read(&mut self.reader)?;
        }
        let Some((line, now)) = &self.now else { return Ok(None) };
        let place = Place::Line { line: *line, column: 0 };
        now.check(mesh).map_err(|fault| fault.in_file(self.file.clone()).at(place))?;
        Ok(Some(Partition { torn: self.torn.clone(), ..now.clone() }))
    }
}

impl MovingPaper {
    /// Begins with some objects; `scene` is the file that messages name.
    ///
    /// # Errors
    /// An object without a mesh; a file of regions that cannot be read, or of what is no sheet.
    pub fn new(bodies: Vec<Body>, scene: impl Into<PathBuf>) -> Result<Self> {
        let scene = scene.into();
        if let Some(body) = bodies.iter().find(|body| body.regions.is_some() && body.paper.is_none()) {
            return Err(Error::new("it has regions and is no paper")
                .at(Place::Part(body.name.clone()))
                .in_file(scene));
        }
        let objects: Vec<_> = bodies.iter().map(|body| (body.name.clone(), body.paper.is_some())).collect();
        let files = bodies.iter().map(|body| body.regions.as_deref().map(Regions::open).transpose());
        let files = files.collect::<Result<_>>()?;
        let forces = bodies.iter().zip(0..).filter_map(|(body, object)| {
            let attribute = body.force.clone()?;
            Some(Force { object, attribute, carrier: body.carrier.clone() })
        });
        let forces = forces.collect();
        let split = |body: Body| (Participant { name: body.name, paper: body.paper }, body.carrier);
        let (participants, carriers): (Vec<_>, Vec<Carrier>) = bodies.into_iter().map(split).unzip();
        let sheets = Sheets { analyser: Analyser::new(participants), files, forces, force_n: Vec::new() };
        MovingMeshes::new(sheets, carriers, &objects, scene, "paper").map(Self)
    }

    /// The objects, in the order of their numbers.
    pub fn participants(&self) -> &[Participant] {
        self.0.analyser.analyser.participants()
    }

    /// Something else takes the place of an object, or comes behind the last. Of others nothing is forgotten but that they
    /// touched it.
    ///
    /// # Errors
    /// A file of regions that cannot be read.
    pub(crate) fn replace(&mut self, object: usize, with_mesh: WithMesh<'_>) -> Result<()> {
        let Body { name, paper, regions, force, carrier } = body(with_mesh);
        let regions = regions.as_deref().map(Regions::open).transpose()?;
        let Sheets { analyser, files, forces, .. } = &mut self.0.analyser;
        analyser.replace(object, Participant { name, paper });
        match files.get_mut(object) {
            Some(known) => *known = regions,
            None => files.push(regions),
        }
        forces.retain(|force| force.object as usize != object);
        let carrier_of = |attribute| Force { object: object as u32, attribute, carrier: carrier.clone() };
        forces.extend(force.map(carrier_of));
        self.0.replace(object, carrier);
        Ok(())
    }

    /// Whether there is anything to look at.
    pub(crate) fn is_any(&self) -> bool {
        self.participants().iter().any(|participant| participant.paper.is_some())
    }

    /// Takes a frame of all meshes as they are at a time, for who does not ask for what is told by their own frames.
    ///
    /// # Errors
    /// A mesh that cannot be read, or is none.
    pub(crate) fn frame(&mut self, time_s: f64) -> Result<()> {
        self.0.frame(time_s)
    }

    /// What happened in those frames, as far as it is known.
    pub(crate) fn event(&mut self) -> Option<Event> {
        loop {
            if let Told::Event(event) = self.0.analyser.told()? {
                return Some(*event);
            }
        }
    }
}

impl Analyse for Sheets {
    type Told = Told;

    fn feed(&mut self, time_s: f64, meshes: &[Mesh]) -> Result<()> {
        for (object, file) in self.files.iter_mut().enumerate() {
            if let (Some(file), Some(mesh)) = (file, meshes.get(object))
                && let Some(partition) = file.at(time_s, mesh)?
            {
                self.analyser.give(object, partition)?;
            }
        }
        for force in &self.forces {
            force.read(time_s, &mut self.force_n)?;
            self.analyser.press(force.object, &self.force_n)?;
        }
        self.analyser.feed(time_s, meshes)
    }

    fn told(&mut self) -> Option<Told> {
        let event = self.analyser.next_event().map(|event| Told::Event(Box::new(event)));
        event.or_else(|| self.analyser.next_restart().map(Told::Restart))
    }

    fn settled_s(&self) -> f64 {
        self.analyser.settled_s()
    }

    /// Nothing is left.
    fn finish(&mut self) {}
}

impl Iterator for MovingPaper {
    type Item = Result<Told>;

    fn next(&mut self) -> Option<Self::Item> {
        self.0.next()
    }
}

/// How the paper of a scene is looked at.
fn settings(paper: &Paper) -> PaperSettings {
    PaperSettings {
        ridge_rad: paper.ridge_rad,
        flat_rad: paper.flat_rad,
        average_m: paper.average_m,
        radius_m: paper.radius_m,
        threshold_mps: paper.floor_speed_mps,
        least_energy_mps: paper.least_energy_mps,
        held: paper.held.clone(),
        ..PaperSettings::default()
    }
}

/// What the sheets of paper of a scene do, in order of time: the objects whose materials have a `paper`, along all that
/// have a mesh. Swarms are left out. Where meshes are told as they move there are none: a feed looks at those. After each
/// frame [`Event::Quiet`] says how far all is told.
///
/// # Errors
/// An object of paper without a mesh, regions that cannot be read; what cannot be read, later on.
pub fn events(scene: &Scene, world: &World) -> Result<impl Iterator<Item = Result<Event>> + Send + use<>> {
    let bodies = with_meshes(scene, world, "paper", |material| material.paper.is_some())?;
    let mut sheets = if are_told(&bodies) { None } else { told(scene, bodies)? };
    let steps = std::iter::from_fn(move || sheets.as_mut()?.0.next_step());
    Ok(steps.filter_map(|step| match step {
        Ok(Step::Told(Told::Event(event))) => Some(Ok(*event)),
        Ok(Step::Told(Told::Restart(_))) => None,
        Ok(Step::Settled(time_s)) => Some(Ok(Event::Quiet(time_s))),
        Err(fault) => Some(Err(fault)),
    }))
}

/// How something with a mesh is looked at.
fn body(with_mesh: WithMesh<'_>) -> Body {
    let WithMesh { name, carrier, material } = with_mesh;
    let paper = material.and_then(|material| material.paper.as_ref());
    let regions = paper.and_then(|paper| Some(paper.regions.as_ref()?.path.clone()));
    // What is told has no file that knows forces.
    let force = paper.and_then(|paper| paper.force.clone()).filter(|_| !carrier.is_fed());
    Body { name: name.to_owned(), paper: paper.map(settings), regions, force, carrier }
}

/// The sheets of paper among what has a mesh, if there are any.
///
/// # Errors
/// As [`MovingPaper::new`].
pub(crate) fn told(scene: &Scene, with_meshes: Vec<WithMesh<'_>>) -> Result<Option<MovingPaper>> {
    let bodies: Vec<Body> = with_meshes.into_iter().map(body).collect();
    let any = bodies.iter().any(|body| body.paper.is_some());
    if any { MovingPaper::new(bodies, &scene.file).map(Some) } else { Ok(None) }
}
