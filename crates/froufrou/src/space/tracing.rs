//! The surroundings of a scene: which of its objects reflect and hide sound.

use std::collections::HashMap;
use std::sync::Arc;

use super::surroundings::{Body, Material, Settings, Shape, Sides, Surroundings};
use crate::scene::animation::Topology;
use crate::scene::file::{Scene, Size};
use crate::scene::world::World;
use crate::{Error, Result};

/// The surroundings of a scene, and which thread belongs to which of its things.
pub struct Tracing {
    /// What reflects and hides.
    pub surroundings: Surroundings,
    /// The number of each thing by the name of its object.
    things: HashMap<String, u64>,
}

/// The frequency in hertz whose first Fresnel zone is the width of a path.
const WIDTH_HZ: f64 = 500.0;

impl Tracing {
    /// The surroundings of a scene; nothing for one without.
    ///
    /// # Errors
    /// An object that is to reflect or hide and has neither a mesh nor a size, or whose mesh cannot be
    /// read.
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
                let shape = match object.size {
                    Some(Size::Rectangle([width_m, height_m])) => Shape::Rectangle { width_m, height_m },
                    Some(Size::Box(size_m)) => Shape::Box { size_m },
                    None if carrier.topology() != Topology::None => Shape::Mesh,
                    None => {
                        let what =
                            format!("the object `{}` reflects or hides sound, and has no mesh", body.name);
                        return Err(Error::new(what)
                            .in_file(&scene.file)
                            .help("give it a `size`, or a `source` that is a mesh"));
                    }
                };
                let thing = things.len() as u64;
                things.insert(body.name.clone(), thing);
                let plain = Material::default();
                let reflect = acoustics.reflect;
                bodies.push(Body {
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
        if bodies.is_empty() {
            return Ok(None);
        }
        let settings = Settings { wavelength_m: scene.speed_of_sound_mps / WIDTH_HZ, ..Settings::default() };
        let surroundings = Surroundings::new(settings, bodies).map_err(|fault| fault.in_file(&scene.file))?;
        Ok(Some(Self { surroundings, things }))
    }

    /// The thing that a thread of an object belongs to.
    pub(super) fn thing(&self, object: &str) -> Option<u64> {
        self.things.get(object).copied()
    }
}
