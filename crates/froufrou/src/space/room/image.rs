//! A mirror image of a source: what a wall adds to a sound is what a source behind it would.

use super::super::bands::{BAND_COUNT, Bands};
use crate::{Error, Result};

/// No more images than this are made at once: an order of 19 in a room.
pub const MOST_IMAGES: usize = 10_000;

/// How many walls there can be.
pub const WALLS: usize = 6;

/// One image: where it is and how it is turned, wherever the source is, and what the walls leave of it.
///
/// An image is the source put through a mapping m(x) = M x + t that keeps all lengths. So it moves as the source
/// does, mirrored, and delays and Doppler follow from its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Image {
    /// What the walls leave of the pressure of each band.
    pub gains: Bands,
    /// How many times each wall reflects it: left, right, floor, ceiling, front and back of a room, or planes in
    /// their order.
    pub walls: [u8; WALLS],
    mirror: [[f64; 3]; 3],
    offset_m: [f64; 3],
}

impl Image {
    /// The source itself.
    pub const SOURCE: Self = Self {
        gains: [1.0; BAND_COUNT],
        walls: [0; WALLS],
        mirror: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        offset_m: [0.0; 3],
    };

    pub(super) fn new(gains: Bands, walls: [u8; WALLS], mirror: [[f64; 3]; 3], offset_m: [f64; 3]) -> Self {
        Self { gains, walls, mirror, offset_m }
    }

    /// How many reflections make it.
    pub fn order(&self) -> usize {
        self.walls.iter().map(|hits| usize::from(*hits)).sum()
    }

    /// Where the image of a source is.
    pub fn position_m(&self, source_m: [f64; 3]) -> [f64; 3] {
        let turned = self.turned(source_m);
        std::array::from_fn(|row| turned[row] + self.offset_m[row])
    }

    /// The image of a direction or velocity of the source: M v.
    pub fn turned(&self, vector: [f64; 3]) -> [f64; 3] {
        self.mirror.map(|row| dot(row, vector))
    }

    /// Which way sound leaves the source itself that leaves its image along `toward_m`: Mᵀ v. A directional source
    /// is heard by way of the walls as it is heard directly that way.
    pub fn leaves(&self, toward_m: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|column| (0..3).map(|row| self.mirror[row][column] * toward_m[row]).sum())
    }

    /// The image of this image in a plane.
    pub(super) fn reflected(&self, normal: [f64; 3], height_m: f64, gains: &Bands, wall: usize) -> Self {
        let mut image = *self;
        let away =
            |vector: [f64; 3], along: f64| std::array::from_fn(|i| vector[i] - 2.0 * along * normal[i]);
        for column in 0..3 {
            let vector: [f64; 3] = std::array::from_fn(|row| self.mirror[row][column]);
            let vector: [f64; 3] = away(vector, dot(vector, normal));
            (0..3).for_each(|row| image.mirror[row][column] = vector[row]);
        }
        image.offset_m = away(self.offset_m, dot(self.offset_m, normal) - height_m);
        image.gains.iter_mut().zip(gains).for_each(|(gain, wall)| *gain *= wall);
        if let Some(hits) = image.walls.get_mut(wall) {
            *hits += 1;
        }
        image
    }
}

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

/// What a wall that absorbs a part of the energy leaves of the pressure, in each band.
pub(super) fn reflection(absorption: &Bands) -> Bands {
    absorption.map(|absorbed| (1.0 - absorbed).sqrt())
}

/// Sees to it that a part of the energy is one.
pub(super) fn check_absorption(wall: &str, absorption: &Bands) -> Result<()> {
    match absorption.iter().position(|absorbed| !(0.0..=1.0).contains(absorbed)) {
        None => Ok(()),
        Some(band) => {
            let name = ["63 Hz", "125 Hz", "250 Hz", "500 Hz", "1 kHz", "2 kHz", "4 kHz", "8 kHz"][band];
            Err(Error::new(format!("{wall} absorbs {} of the energy at {name}", absorption[band]))
                .help("give a part, from 0 for none to 1 for all"))
        }
    }
}

/// The error of an order that has too many images.
pub(super) fn too_many(order: usize) -> Error {
    Error::new(format!("reflections up to order {order} have more than {MOST_IMAGES} images"))
        .help("lower the order; the tail of the reverberation follows what it leaves out")
}
