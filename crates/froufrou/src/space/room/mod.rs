//! Rooms of six walls, and single walls: what they reflect, as images of the source (Allen & Berkley 1979).

mod image;
mod plane;

pub use image::{Image, MOST_IMAGES, WALLS};
pub(in crate::space) use plane::trace;
pub use plane::{Plane, Reflections};

use super::bands::{BAND_COUNT, Bands};
use crate::{Error, Result};
use image::{check_absorption, dot, reflection, too_many};

/// No room is longer than this in metres.
const LONGEST_M: f64 = 10_000.0;

/// No room is shorter than this in metres.
const SHORTEST_M: f64 = 0.01;

/// The part of the energy that each wall absorbs in each octave band.
///
/// They are named as in the room's own frame, where ahead is −Z: left is −X, the front is −Z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Walls {
    /// At the corner, −X.
    pub left: Bands,
    /// At the other end of the width, +X.
    pub right: Bands,
    /// At the corner, −Y.
    pub floor: Bands,
    /// At the other end of the height, +Y.
    pub ceiling: Bands,
    /// At the corner, −Z.
    pub front: Bands,
    /// At the other end of the depth, +Z.
    pub back: Bands,
}

impl Walls {
    /// All six alike.
    pub const fn all(absorption: Bands) -> Self {
        let a = absorption;
        Self { left: a, right: a, floor: a, ceiling: a, front: a, back: a }
    }

    /// In the order of [`Image::walls`].
    pub fn in_order(&self) -> [Bands; WALLS] {
        [self.left, self.right, self.floor, self.ceiling, self.front, self.back]
    }
}

/// A room: a box that stands upright in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Room {
    corner_m: [f64; 3],
    size_m: [f64; 3],
    /// The directions of its width, height and depth in the world.
    axes: [[f64; 3]; 3],
    absorption: [Bands; WALLS],
}

impl Room {
    /// A room whose left lower front corner lies at a place in the world, and whose width (X), height (Y) and depth (Z)
    /// are given in metres; then it is turned about the vertical through that corner, counter-clockwise seen
    /// from above.
    ///
    /// ```
    /// use froufrou::space::room::{Room, Walls};
    /// let room = Room::new([0.0, 0.0, 0.0], [5.0, 3.0, 4.0], 0.0, &Walls::all([0.2; 8]))?;
    /// let images = room.images(2)?;
    /// assert_eq!(images.len(), 25);
    /// // The first is the source itself, the next come by way of one wall, the left one first.
    /// assert_eq!(images[1].position_m([1.0, 1.0, 1.0]), [-1.0, 1.0, 1.0]);
    /// # Ok::<(), froufrou::Error>(())
    /// ```
    pub fn new(corner_m: [f64; 3], size_m: [f64; 3], turn_degrees: f64, walls: &Walls) -> Result<Self> {
        if !corner_m.iter().all(|c| c.abs() <= 1e9) {
            let [x, y, z] = corner_m;
            return Err(Error::new(format!("the corner of the room is at {x} {y} {z}"))
                .help("give a place in metres, within 1e9 of the origin"));
        }
        if !size_m.iter().all(|size| (SHORTEST_M..=LONGEST_M).contains(size)) {
            let [x, y, z] = size_m;
            return Err(Error::new(format!("the size of the room is {x} by {y} by {z} m"))
                .help(format!("give width, height and depth, each from {SHORTEST_M} to {LONGEST_M}")));
        }
        if !(-36_000.0..=36_000.0).contains(&turn_degrees) {
            return Err(Error::new(format!("the room is turned by {turn_degrees} degrees"))
                .help("give an angle, counter-clockwise seen from above"));
        }
        let absorption = walls.in_order();
        let names = [
            "the left wall",
            "the right wall",
            "the floor",
            "the ceiling",
            "the front wall",
            "the back wall",
        ];
        for (name, absorption) in names.iter().zip(&absorption) {
            check_absorption(name, absorption)?;
        }
        let (sin, cos) = quarter_exact(turn_degrees);
        let axes = [[cos, 0.0, -sin], [0.0, 1.0, 0.0], [sin, 0.0, cos]];
        Ok(Self { corner_m, size_m, axes, absorption })
    }

    /// True for a place within its walls. Outside there are no reflections of it: what is heard there of a source
    /// within, or there within of a source outside, is for the caller to say.
    pub fn contains(&self, point_m: [f64; 3]) -> bool {
        let local = self.local(point_m);
        (0..3).all(|axis| local[axis] > 0.0 && local[axis] < self.size_m[axis])
    }

    /// Width, height and depth.
    pub fn size_m(&self) -> [f64; 3] {
        self.size_m
    }

    /// Its volume.
    pub fn volume_m3(&self) -> f64 {
        self.size_m.iter().product()
    }

    /// The areas of its walls, in the order of [`Image::walls`].
    pub fn areas_m2(&self) -> [f64; WALLS] {
        let [x, y, z] = self.size_m;
        [y * z, y * z, x * z, x * z, x * y, x * y]
    }

    /// The part of the energy that each wall absorbs, in the order of [`Image::walls`].
    pub fn absorption(&self) -> &[Bands; WALLS] {
        &self.absorption
    }

    /// Its walls as planes, in the order of [`Image::walls`], with air within.
    pub fn planes(&self) -> [Plane; WALLS] {
        std::array::from_fn(|wall| {
            let axis = self.axes[wall / 2];
            let near = dot(self.corner_m, axis);
            let (normal, height_m) = match wall % 2 {
                0 => (axis, near),
                _ => (axis.map(|c| -c), -(near + self.size_m[wall / 2])),
            };
            Plane::of(normal, height_m, reflection(&self.absorption[wall]))
        })
    }

    /// The images of a source up to an order of reflections, the source itself first. They come by their order, and
    /// numbers stay the same when the highest order is raised.
    ///
    /// An image holds for a source anywhere within the room and is heard everywhere within it. So a room's
    /// images are made once, and [`Image::position_m`] tells where they are as the source moves. It is for
    /// the caller to see that source and listener are within ([`Room::contains`]).
    pub fn images(&self, order: usize) -> Result<Vec<Image>> {
        let count =
            image_count(order).filter(|count| *count <= MOST_IMAGES).ok_or_else(|| too_many(order))?;
        let reflections = self.absorption.map(|absorption| reflection(&absorption));
        let mut images = Vec::with_capacity(count);
        for reflected in 0..=order as i32 {
            for x in -reflected..=reflected {
                let rest = reflected - x.abs();
                for y in -rest..=rest {
                    let z = rest - y.abs();
                    // There is one cell where z is 0, not two.
                    for z in &[-z, z][usize::from(z == 0)..] {
                        images.push(self.image([x, y, *z], &reflections));
                    }
                }
            }
        }
        Ok(images)
    }

    /// The image in a cell of the lattice of mirrored rooms.
    fn image(&self, cell: [i32; 3], reflections: &[Bands; WALLS]) -> Image {
        let walls: [u8; WALLS] = std::array::from_fn(|wall| {
            let hits = if wall % 2 == 0 { -cell[wall / 2] } else { cell[wall / 2] };
            // Of an odd number, one more falls to the wall on whose side the image is.
            (if hits > 0 { (hits + 1) / 2 } else { -hits / 2 }) as u8
        });
        let gains: Bands = std::array::from_fn(|band| {
            (0..WALLS).map(|wall| reflections[wall][band].powi(i32::from(walls[wall]))).product()
        });
        // In the room's frame: n L + x where n is even, (n + 1) L − x where it is odd.
        let odd = cell.map(|n| n.rem_euclid(2));
        let sign = odd.map(|odd| f64::from(1 - 2 * odd));
        let offset: [f64; 3] =
            std::array::from_fn(|axis| f64::from(cell[axis] + odd[axis]) * self.size_m[axis]);
        let world = |local: [f64; 3]| -> [f64; 3] {
            std::array::from_fn(|row| (0..3).map(|axis| self.axes[axis][row] * local[axis]).sum())
        };
        let mut mirror = [[0.0; 3]; 3];
        for (column, _) in self.axes.iter().enumerate() {
            let local: [f64; 3] = std::array::from_fn(|axis| sign[axis] * self.axes[axis][column]);
            let column_of = world(local);
            (0..3).for_each(|row| mirror[row][column] = column_of[row]);
        }
        let (shift, corner) = (world(offset), mirror.map(|row| dot(row, self.corner_m)));
        let offset_m = std::array::from_fn(|i| self.corner_m[i] - corner[i] + shift[i]);
        Image::new(gains, walls, mirror, offset_m)
    }

    fn local(&self, point_m: [f64; 3]) -> [f64; 3] {
        let from_corner = std::array::from_fn(|i| point_m[i] - self.corner_m[i]);
        self.axes.map(|axis| dot(axis, from_corner))
    }
}

/// How many images there are up to an order: the cells of a lattice within an octahedron.
fn image_count(order: usize) -> Option<usize> {
    let twice = order.checked_mul(2)?;
    let square = order.checked_mul(twice)?.checked_add(twice)?.checked_add(3)?;
    Some(twice.checked_add(1)?.checked_mul(square)? / 3)
}

/// Sine and cosine, exact at quarter turns.
fn quarter_exact(degrees: f64) -> (f64, f64) {
    let quarters = (degrees / 90.0).round();
    let (sin, cos) = (degrees - 90.0 * quarters).to_radians().sin_cos();
    match quarters.rem_euclid(4.0) as u8 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// The absorption of each band averaged over the walls by their areas.
pub(super) fn mean_absorption(room: &Room) -> Bands {
    let areas = room.areas_m2();
    let total: f64 = areas.iter().sum();
    let mut mean = [0.0; BAND_COUNT];
    for (area, absorption) in areas.iter().zip(&room.absorption) {
        mean.iter_mut().zip(absorption).for_each(|(mean, absorbed)| *mean += absorbed * area);
    }
    // Divided last, so that it is 1 where all walls absorb everything.
    mean.map(|sum| sum / total)
}

#[cfg(test)]
mod tests;
