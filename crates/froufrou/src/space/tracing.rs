//! The surroundings of a scene: which of its objects reflect and hide sound, its walls and its air.

use std::collections::HashMap;
use std::sync::Arc;

use super::bands::Bands;
use super::enclosure::{self, Enclosure};
use super::spread::SoundingSurface;
use super::surroundings::{self, Material, Settings, Shape, Sides, Surface, Surroundings};
use crate::scene::animation::Topology;
use crate::scene::carrier::Carrier;
use crate::scene::file::{Emitter, Enclosing, MovingPlane, Object, Scene, Size};
use crate::scene::world::{Body, World};
use crate::score::Radiation;
use crate::{Error, Result};

/// The surroundings of a scene, and which thread belongs to which of its things.
pub struct Tracing {
    /// What reflects and hides.
    pub surroundings: Surroundings,
    /// The walls of a room, or planes.
    pub enclosure: Option<Enclosure>,
    /// Whether that reverberates, and each microphone has a tail.
    pub reverberates: bool,
    /// What air takes from each octave band in each metre, in decibels, where it does.
    pub absorption_db_per_m: Option<Bands>,
    /// The number of each thing by the name of its object.
    things: HashMap<String, u64>,
    /// The surfaces that sound, by the names of their objects.
    surfaces: HashMap<String, SoundingSurface>,
}

/// The frequency in hertz whose first Fresnel zone is the width of a path.
const WIDTH_HZ: f64 = 500.0;

impl Tracing {
    /// The surroundings of a scene; nothing for one without.
    ///
    /// # Errors
    /// An object that is to reflect or hide and has neither a mesh nor a size, or whose mesh cannot be
    /// read; a plane on several bodies.
    pub fn of(scene: &Scene, world: &World) -> Result<Option<Self>> {
        let mut bodies = Vec::new();
        let mut things = HashMap::new();
        for (object, carried) in scene.objects.iter().zip(&world.objects) {
            let material = object.material.and_then(|index| scene.materials.get(index));
            let Some(acoustics) = material.map(|material| material.acoustics) else { continue };
            if acoustics == Default::default() {
                continue;
            }
            for body in carried {
                let Some(carrier) = &body.carrier else { continue };
                let shape = shape(scene, object, body, carrier, "reflects or hides sound")?;
                let thing = things.len() as u64;
                things.insert(body.name.clone(), thing);
                let plain = Material::default();
                let reflect = acoustics.reflect;
                bodies.push(surroundings::Body {
                    surface: Arc::new(carrier.clone()),
                    shape,
                    material: Material {
                        absorption: reflect.map_or(plain.absorption, |reflect| reflect.absorption),
                        diffuse: reflect.map_or(plain.diffuse, |reflect| reflect.diffuse),
                        sharpness: reflect.map_or(plain.sharpness, |reflect| reflect.sharpness),
                        transmission: acoustics.transmission.unwrap_or(plain.transmission),
                    },
                    sides: match reflect.and_then(|reflect| reflect.both_sides) {
                        None => Sides::Auto,
                        Some(false) => Sides::Front,
                        Some(true) => Sides::Both,
                    },
                    patches: reflect.map_or(0, |reflect| reflect.paths),
                    occludes: acoustics.transmission.is_some(),
                    thing: Some(thing),
                });
            }
        }
        let surfaces = surfaces(scene, world)?;
        let enclosure = enclosure(scene, world)?;
        let absorption_db_per_m = scene.air.map(|air| air.band_absorption_db_per_m());
        let is_open = enclosure.is_none() && absorption_db_per_m.is_none();
        if bodies.is_empty() && surfaces.is_empty() && is_open {
            return Ok(None);
        }
        let settings = Settings { wavelength_m: scene.speed_of_sound_mps / WIDTH_HZ, ..Settings::default() };
        let surroundings = Surroundings::new(settings, bodies).map_err(|fault| fault.in_file(&scene.file))?;
        let reverberates = scene.reverberates();
        Ok(Some(Self { surroundings, enclosure, reverberates, absorption_db_per_m, things, surfaces }))
    }

    /// Surroundings of which no thread is a part.
    #[cfg(test)]
    pub(super) fn about(surroundings: Surroundings) -> Self {
        let (things, surfaces) = (HashMap::new(), HashMap::new());
        Self {
            surroundings,
            enclosure: None,
            reverberates: false,
            absorption_db_per_m: None,
            things,
            surfaces,
        }
    }

    /// The surface of an object, from all over which a thread sounds.
    pub(super) fn surface(&self, object: &str) -> Option<&SoundingSurface> {
        self.surfaces.get(object)
    }

    /// The thing that a thread of an object belongs to.
    pub(super) fn thing(&self, object: &str) -> Option<u64> {
        self.things.get(object).copied()
    }
}

/// The shape of a body of an object that does something.
fn shape(scene: &Scene, object: &Object, body: &Body, carrier: &Carrier, does: &str) -> Result<Shape> {
    match object.size {
        Some(Size::Rectangle([width_m, height_m])) => Ok(Shape::Rectangle { width_m, height_m }),
        Some(Size::Box(size_m)) => Ok(Shape::Box { size_m }),
        None if carrier.topology() != Topology::None => Ok(Shape::Mesh),
        None => Err(Error::new(format!("the object `{}` {does}, and has no mesh", body.name))
            .in_file(&scene.file)
            .help("give it a `size`, or a `source` that is a mesh")),
    }
}

/// The surfaces from all over which sounds come.
fn surfaces(scene: &Scene, world: &World) -> Result<HashMap<String, SoundingSurface>> {
    let mut surfaces = HashMap::new();
    for sound in scene.sounds.iter().filter(|sound| sound.pattern == Some(Radiation::Surface)) {
        let Emitter::Object(index) = sound.emitter else { continue };
        for body in &world.objects[index] {
            let Some(carrier) = &body.carrier else { continue };
            let shape =
                shape(scene, &scene.objects[index], body, carrier, "sounds from all over its surface")?;
            let surface = SoundingSurface { surface: Arc::new(carrier.clone()), shape };
            surfaces.insert(body.name.clone(), surface);
        }
    }
    Ok(surfaces)
}

/// The walls of a scene.
fn enclosure(scene: &Scene, world: &World) -> Result<Option<Enclosure>> {
    let made = match &scene.enclosing {
        None => return Ok(None),
        Some(Enclosing::Room(about)) => Enclosure::room(&about.room, about.order),
        Some(Enclosing::Planes(planes)) => {
            let carried = |plane: &MovingPlane| -> Result<enclosure::MovingPlane> {
                let surface = plane.object.map(|index| carrier(scene, world, index)).transpose()?;
                let &MovingPlane { point_m, normal, absorption, .. } = plane;
                Ok(enclosure::MovingPlane { surface, point_m, normal, absorption })
            };
            planes.iter().map(carried).collect::<Result<_>>().and_then(Enclosure::planes)
        }
    };
    made.map(Some).map_err(|fault| if fault.file().is_some() { fault } else { fault.in_file(&scene.file) })
}

/// What carries the plane of an object: its only body.
fn carrier(scene: &Scene, world: &World, object: usize) -> Result<Arc<dyn Surface>> {
    let bodies = &world.objects[object];
    match bodies.as_slice() {
        [only] if only.carrier.is_some() => only.carrier.clone().map(|c| Arc::new(c) as Arc<dyn Surface>),
        _ => None,
    }
    .ok_or_else(|| {
        let (name, count) = (&scene.objects[object].name, bodies.len());
        Error::new(format!("the object `{name}`, which carries a plane, is {count} bodies; expected one"))
            .in_file(&scene.file)
            .help("name one object of the file")
    })
}
