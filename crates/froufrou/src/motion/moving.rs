//! What happens between the rigid objects of a scene, told by how they move alone.

use super::event::Event;
use super::rigid::{Analyser, Body, Shape};
use crate::scene::animation::{Mesh, Topology, Transform};
use crate::scene::asset::NamePattern;
use crate::scene::carrier::Carrier;
use crate::scene::file::{Motion, Object, Scene, Size, Touching};
use crate::scene::world::{Body as WorldBody, World};
use crate::{Error, Place, Result};

/// What is between two transforms of a body that stands still.
const STILL: f64 = 1e-9;

/// What happens between the rigid objects of a scene, in order of time. It ends after its first error.
///
/// Frames are those of the object with the most of them; others are asked where they are then.
pub struct MovingBodies {
    analyser: Analyser,
    carriers: Vec<Carrier>,
    /// The carrier whose frames are taken.
    leading: usize,
    next_s: Option<f64>,
    transforms: Vec<Transform>,
    file: std::path::PathBuf,
    /// Whether a frame was taken since it was said how far all is told.
    is_new: bool,
    over: bool,
}

impl MovingBodies {
    /// Looks at the objects that are named.
    ///
    /// # Errors
    /// A name that no object has; an object that is named without a pattern and deforms or has no shape; a mesh that
    /// cannot be read or has no faces.
    pub fn open(scene: &Scene, world: &World, touching: &Touching) -> Result<Self> {
        let mut bodies = Vec::new();
        let mut carriers: Vec<Carrier> = Vec::new();
        let mut met = vec![false; touching.bodies.len()];
        for (object, members) in scene.objects.iter().zip(&world.objects) {
            for member in members {
                let names = [object.name.as_str(), member.name.as_str()];
                let wanted = |pattern: &NamePattern| names.iter().any(|name| pattern.matches(name));
                let matching = touching.bodies.iter().enumerate().filter(|(_, pattern)| wanted(pattern));
                let matching: Vec<usize> = matching.map(|(index, _)| index).collect();
                if matching.is_empty() {
                    continue;
                }
                if member.carrier.as_ref().is_some_and(Carrier::is_fed) {
                    // Where it will be nobody knows: who tells where it is tells its contacts too.
                    matching.iter().for_each(|&index| met[index] = true);
                    continue;
                }
                let is_named = matching.iter().any(|&index| names.contains(&touching.bodies[index].text()));
                let in_scene = |fault: Error| fault.in_file(&scene.file);
                match rigid(scene, object, member).map_err(in_scene)? {
                    Ok((body, carrier)) => {
                        matching.iter().for_each(|&index| met[index] = true);
                        bodies.push(body);
                        carriers.push(carrier);
                    }
                    Err(why) if is_named => {
                        return Err(in_scene(
                            Error::new(format!("it is no rigid body: {why}"))
                                .at(Place::Part(member.name.clone())),
                        ));
                    }
                    // A pattern leaves out what is none.
                    Err(_) => matching.iter().for_each(|&index| met[index] = true),
                }
            }
        }
        if let Some(index) = met.iter().position(|met| !met) {
            let name = touching.bodies[index].text();
            let names: Vec<&str> = scene.objects.iter().map(|object| object.name.as_str()).collect();
            return Err(Error::new(format!(
                "`bodies` of `[[contacts]]` names {name:?}, which no object is called"
            ))
            .in_file(&scene.file)
            .help(format!("there are {}", names.join(", "))));
        }
        let counts = carriers.iter().map(Carrier::key_count).enumerate();
        // Of those with as many the first.
        let leading = counts.max_by_key(|&(index, count)| (count, std::cmp::Reverse(index)));
        let leading = leading.map_or(0, |(index, _)| index);
        let mut events = Self {
            analyser: Analyser::new(Vec::new(), touching.gravity_mps2),
            carriers,
            leading,
            next_s: None,
            transforms: Vec::new(),
            file: scene.file.clone(),
            is_new: false,
            over: false,
        };
        events.next_s = events.after(f64::MIN);
        for (index, body) in bodies.iter_mut().enumerate() {
            if events.stands_still(index).map_err(|fault| fault.in_file(&scene.file))? {
                *body = body.clone().fixed();
            }
        }
        events.analyser = Analyser::new(bodies, touching.gravity_mps2);
        Ok(events)
    }

    /// The bodies that were found.
    pub fn bodies(&self) -> impl ExactSizeIterator<Item = &Body> {
        self.analyser.bodies()
    }

    /// The time of the frame after a time: that of the leading object; before its first and after its last those of
    /// any other.
    fn after(&self, time_s: f64) -> Option<f64> {
        let others =
            || self.carriers.iter().filter_map(|carrier| carrier.next_key_s(time_s)).reduce(f64::min);
        let leading = self.carriers.get(self.leading)?;
        let next_s = leading.next_key_s(time_s);
        if next_s.is_some() && leading.next_key_s(f64::MIN).is_some_and(|first_s| first_s <= time_s) {
            return next_s;
        }
        others()
    }

    /// Whether a body never moves; asked up to its first motion.
    fn stands_still(&self, index: usize) -> Result<bool> {
        let Some(carrier) = self.carriers.get(index) else { return Ok(true) };
        let Some(mut time_s) = carrier.next_key_s(f64::MIN) else { return Ok(true) };
        let first = carrier.frame(time_s)?;
        while let Some(next_s) = carrier.next_key_s(time_s) {
            time_s = next_s;
            let now = carrier.frame(time_s)?;
            // A frame that is no number does not stand still: it is told when it comes.
            let differs = |(a, b): (&f64, &f64)| (a - b).abs() > STILL || (a - b).is_nan();
            if first.as_flattened().iter().zip(now.as_flattened()).any(differs) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Feeds the next frame.
    fn step(&mut self) -> Result<()> {
        let Some(time_s) = self.next_s else {
            self.over = true;
            self.analyser.finish();
            return Ok(());
        };
        self.transforms.clear();
        for carrier in &self.carriers {
            self.transforms.push(carrier.frame(time_s)?);
        }
        self.analyser.feed(time_s, &self.transforms)?;
        self.next_s = self.after(time_s);
        self.is_new = true;
        Ok(())
    }

    /// The next event, and after each frame [`Event::Quiet`], which says how far all is told.
    pub(crate) fn next_step(&mut self) -> Option<Result<Event>> {
        loop {
            if let Some(event) = self.analyser.next_event() {
                return Some(Ok(event));
            }
            if self.over {
                return None;
            }
            if std::mem::take(&mut self.is_new) {
                return Some(Ok(Event::Quiet(self.analyser.settled_s())));
            }
            if let Err(fault) = self.step() {
                self.over = true;
                return Some(Err(fault.in_file(self.file.clone())));
            }
        }
    }
}

impl Iterator for MovingBodies {
    type Item = Result<Event>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let step = self.next_step()?;
            if !matches!(step, Ok(Event::Quiet(_))) {
                return Some(step);
            }
        }
    }
}

/// The body of an object, or why it is none.
fn rigid(
    scene: &Scene,
    object: &Object,
    member: &WorldBody,
) -> Result<std::result::Result<(Body, Carrier), &'static str>> {
    let Some(carrier) = &member.carrier else {
        return Ok(Err("it has no `source`, `position` or `track`"));
    };
    if object.swarm.is_some() {
        return Ok(Err("it is a swarm"));
    }
    let material = object.material.and_then(|index| scene.materials.get(index));
    let density = material.map_or(1000.0, |material| material.density);
    let body = match (carrier.topology(), object.size) {
        (Topology::Homogeneous | Topology::Heterogeneous, _) => return Ok(Err("its mesh changes its shape")),
        (Topology::Constant, _) => {
            let time_s = carrier.next_key_s(f64::MIN).unwrap_or(0.0);
            let mut mesh = Mesh::default();
            carrier.mesh(time_s, &mut mesh)?;
            Body::from_mesh(&member.name, &mesh, &carrier.frame(time_s)?, density).map_err(|fault| {
                match &object.motion {
                    Some(Motion::Source(source)) => fault.in_file(source.file.path.clone()),
                    _ => fault,
                }
            })?
        }
        (Topology::None, Some(Size::Box(lengths))) => {
            Body::new(&member.name, Shape::cuboid(lengths.map(|length| 0.5 * length)), density)
        }
        (Topology::None, Some(Size::Rectangle([width, height]))) => {
            let (x, y) = (0.5 * width, 0.5 * height);
            let corners = [[-x, -y, 0.0], [-x, y, 0.0], [x, y, 0.0], [x, -y, 0.0]];
            Body::new(&member.name, Shape::flat(&corners)?, density)
        }
        (Topology::None, None) => return Ok(Err("it has no mesh and no `size`")),
    };
    let body = match object.mass_kg {
        Some(mass_kg) => body.weighing(mass_kg),
        None => body,
    };
    Ok(Ok((body, carrier.clone())))
}
