//! Walls and floors without end about a scene: a room, or planes that may move.
//!
//! Each image of a source is heard by a path of its own. Where bodies hide sound, it is hidden on each stretch of
//! its way from wall to wall.

use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::bands::Bands;
use super::room::{Image, Plane, Reflections, Room};
use super::surroundings::{Surface, affine};
use crate::{Error, Result};

/// Reflections among planes are followed up to this order.
const PLANE_ORDER: usize = 3;

/// A plane that rides on something.
#[derive(Clone)]
pub struct MovingPlane {
    /// What carries it; `None` where it stands still in the world.
    pub surface: Option<Arc<dyn Surface>>,
    /// A point on it, in metres in the frame of what carries it.
    pub point_m: [f64; 3],
    /// The direction in which there is air, in that frame.
    pub normal: [f64; 3],
    /// The part of the energy that it absorbs in each octave band.
    pub absorption: Bands,
}

/// A room, or planes, as they are at one time.
pub struct Enclosure {
    kind: Kind,
    /// The walls now.
    planes: Vec<Plane>,
    /// The images that they make, the source itself first.
    images: Vec<Image>,
    time_s: Option<f64>,
}

enum Kind {
    Room,
    Planes { moving: Vec<MovingPlane>, reflections: Reflections },
}

impl Enclosure {
    /// A room with images up to an order.
    ///
    /// # Errors
    /// More images than can be.
    pub fn room(room: &Room, order: usize) -> Result<Self> {
        let images = room.images(order)?;
        Ok(Self { kind: Kind::Room, planes: room.planes().to_vec(), images, time_s: None })
    }

    /// Planes, six at most.
    ///
    /// # Errors
    /// More planes than can be; one that is none at first.
    pub fn planes(moving: Vec<MovingPlane>) -> Result<Self> {
        let reflections = Reflections::new(moving.len(), PLANE_ORDER)?;
        let kind = Kind::Planes { moving, reflections };
        let mut enclosure = Self { kind, planes: Vec::new(), images: Vec::new(), time_s: None };
        enclosure.pose(0.0)?;
        Ok(enclosure)
    }

    /// How many images there are besides the source itself.
    pub fn images(&self) -> usize {
        self.images.len() - 1
    }

    /// Brings it to a time.
    ///
    /// # Errors
    /// A sample of a motion that cannot be read, or that leaves a plane without a direction.
    pub fn pose(&mut self, time_s: f64) -> Result<()> {
        let Kind::Planes { moving, reflections } = &self.kind else { return Ok(()) };
        if self.time_s == Some(time_s) {
            return Ok(());
        }
        self.time_s = None;
        self.planes.clear();
        for plane in moving {
            self.planes.push(plane.at(time_s)?);
        }
        reflections.images(&self.planes, &mut self.images)?;
        self.time_s = Some(time_s);
        Ok(())
    }

    /// The image of a number, from 1, if a listener hears a source by way of it.
    pub fn image(&self, number: usize, source_m: [f64; 3], listener_m: [f64; 3]) -> Option<&Image> {
        let image = self.images.get(number)?;
        let is_heard = match &self.kind {
            Kind::Room => self.contains(source_m) && self.contains(listener_m),
            Kind::Planes { reflections, .. } => reflections.heard(number, &self.planes, source_m, listener_m),
        };
        is_heard.then_some(image)
    }

    /// Whether a place is on the side of all walls where there is air.
    pub fn contains(&self, point_m: [f64; 3]) -> bool {
        self.planes.iter().all(|plane| plane.distance_m(point_m) > 0.0)
    }

    /// The places at which sound meets walls on its way from an image to a listener, from the listener on.
    pub fn way(&self, image: &Image, image_m: [f64; 3], listener_m: [f64; 3], out: &mut Vec<[f64; 3]>) {
        out.clear();
        super::room::trace(&self.planes, listener_m, image_m, image.order(), |_, met_m| out.push(met_m));
    }

    /// The next time after `time_s` at which the motion of any plane has a key.
    pub fn next_key_s(&self, time_s: f64) -> Option<f64> {
        self.surfaces().filter_map(|(surface, _)| surface.next_key_s(time_s)).reduce(f64::min)
    }

    /// How fast planes move about a time where a source or listener is, in metres a second, measured over the
    /// millisecond that follows.
    ///
    /// # Errors
    /// A sample of a motion that cannot be read.
    pub fn speed_mps(&self, time_s: f64, near_m: [f64; 3]) -> Result<f64> {
        const STEP_S: f64 = 1e-3;
        let mut fastest = 0.0f64;
        for (_, plane) in self.surfaces() {
            let [now, then] = [time_s, time_s + STEP_S].map(|at_s| plane.at(at_s));
            let moved_m = (now?.distance_m(near_m) - then?.distance_m(near_m)).abs();
            fastest = fastest.max(moved_m / STEP_S);
        }
        Ok(fastest)
    }

    fn surfaces(&self) -> impl Iterator<Item = (&Arc<dyn Surface>, &MovingPlane)> {
        let moving: &[MovingPlane] = match &self.kind {
            Kind::Room => &[],
            Kind::Planes { moving, .. } => moving,
        };
        moving.iter().filter_map(|plane| Some((plane.surface.as_ref()?, plane)))
    }
}

impl MovingPlane {
    /// Where it is at a time.
    fn at(&self, time_s: f64) -> Result<Plane> {
        let Some(surface) = &self.surface else {
            return Plane::new(self.point_m, self.normal, &self.absorption);
        };
        let to_world = affine(&surface.frame(time_s)?);
        let point_m = to_world.transform_point3(self.point_m.into()).to_array();
        // Normals stay at right angles to their plane under any scaling.
        let [x, y, z] = [to_world.matrix3.x_axis, to_world.matrix3.y_axis, to_world.matrix3.z_axis];
        let cofactors = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
        let side = to_world.matrix3.determinant().signum();
        let normal = (cofactors * DVec3::from(self.normal) * side).to_array();
        Plane::new(point_m, normal, &self.absorption).map_err(|fault| {
            let name = surface.name();
            Error::new(format!("the plane on `{name}` has no direction at {time_s} s")).because(fault)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::room::Walls;
    use super::super::surroundings::meshes::Moved;
    use super::*;
    use crate::scene::animation::Mesh;
    use glam::DAffine3;

    const SOURCE: [f64; 3] = [1.0, 1.2, 0.8];
    const LISTENER: [f64; 3] = [3.5, 1.7, 2.6];

    #[test]
    fn ways_by_walls_are_as_long_as_their_images_are_far() {
        for turn in [0.0, 30.0, 200.0] {
            let room = Room::new([-0.5, 0.0, 0.2], [5.0, 3.0, 4.0], turn, &Walls::all([0.2; 8])).unwrap();
            let enclosure = Enclosure::room(&room, 4).unwrap();
            let within = |local: [f64; 3]| room.images(0).unwrap()[0].position_m(local);
            let place = |m: [f64; 3]| {
                let (sin, cos) = f64::to_radians(turn).sin_cos();
                let [x, y, z] = within(m);
                [-0.5 + cos * x + sin * z, y, 0.2 - sin * x + cos * z]
            };
            let (source, listener) = (place(SOURCE), place(LISTENER));
            assert!(room.contains(source) && enclosure.contains(listener));
            let mut met = Vec::new();
            for number in 1..=enclosure.images() {
                let image = enclosure.image(number, source, listener).unwrap();
                let image_m = image.position_m(source);
                enclosure.way(image, image_m, listener, &mut met);
                assert_eq!(met.len(), image.order(), "{number}");
                let mut at = DVec3::from(listener);
                let mut length = 0.0;
                for point in met.iter().chain([&source]) {
                    length += at.distance(DVec3::from(*point));
                    at = DVec3::from(*point);
                }
                let straight = DVec3::from(image_m).distance(DVec3::from(listener));
                assert!((length - straight).abs() < 1e-9, "{number}: {length} {straight}");
                for point in &met {
                    assert!(room.planes().iter().any(|plane| plane.distance_m(*point).abs() < 1e-9));
                }
            }
            assert!(enclosure.image(1, [100.0; 3], listener).is_none());
            assert!(enclosure.image(1, source, [100.0; 3]).is_none());
        }
    }

    #[test]
    fn planes_ride_on_what_carries_them() {
        // A table top, 0.7 m above the origin of a table that rises by 1 m/s, is scaled and tilts.
        let lifted = |t: f64| {
            DAffine3::from_translation(DVec3::new(5.0, t, 0.0))
                * DAffine3::from_rotation_z(0.5 * t)
                * DAffine3::from_scale(DVec3::new(2.0, 1.0, 3.0))
        };
        let plane = MovingPlane {
            surface: Some(Arc::new(Moved::rigid(Mesh::default(), lifted))),
            point_m: [0.0, 0.7, 0.0],
            normal: [0.0, 1.0, 0.0],
            absorption: [0.0; 8],
        };
        let mut enclosure = Enclosure::planes(vec![plane]).unwrap();
        assert_eq!(enclosure.images(), 1);
        for time_s in [0.0f64, 0.3, 1.0] {
            enclosure.pose(time_s).unwrap();
            let to_world = lifted(time_s);
            let on = |x: f64, z: f64| to_world.transform_point3(DVec3::new(x, 0.7, z)).to_array();
            for point in [on(0.0, 0.0), on(1.0, -2.0), on(-3.0, 1.0)] {
                assert!(enclosure.planes[0].distance_m(point).abs() < 1e-12);
            }
            let above = to_world.transform_point3(DVec3::new(0.1, 1.5, 0.2)).to_array();
            let other = to_world.transform_point3(DVec3::new(1.0, 2.5, 0.2)).to_array();
            let image = enclosure.image(1, above, other).unwrap();
            let middle: [f64; 3] = std::array::from_fn(|i| 0.5 * (image.position_m(above)[i] + above[i]));
            assert!(enclosure.planes[0].distance_m(middle).abs() < 1e-12);
            assert!(enclosure.image(1, on(0.0, 0.0).map(|c| c - 3.0), other).is_none(), "from below");
        }
        // At the origin it rises by 1 m/s and the tilt carries it along.
        let speed = enclosure.speed_mps(0.0, [5.0, 1.0, 0.0]).unwrap();
        assert!((speed - 1.0).abs() < 0.01, "{speed}");
        assert!(Enclosure::planes(vec![]).is_ok_and(|none| none.images() == 0));
    }
}
