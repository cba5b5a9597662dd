//! Floors and walls without end, which may move.
//!
//! A plane has air on the side that its normal points to. Several planes reflect what the others reflect. Where they
//! meet at other angles than right ones, not every image is heard everywhere: [`Reflections::heard`] tells.

use super::super::bands::Bands;
use super::super::microphone::length;
use super::image::{Image, MOST_IMAGES, WALLS, check_absorption, dot, reflection, too_many};
use crate::{Error, Result};

/// Planes whose normals differ from right angles by less than this stand at right angles.
const RIGHT: f64 = 1e-9;

/// A plane at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    normal: [f64; 3],
    /// Its distance from the origin along the normal.
    height_m: f64,
    gains: Bands,
}

impl Plane {
    /// The plane through a point, with air where the normal points to, which absorbs a part of the energy of each
    /// octave band: 0 for a rigid one.
    pub fn new(point_m: [f64; 3], normal: [f64; 3], absorption: &Bands) -> Result<Self> {
        if !point_m.iter().all(|c| c.abs() <= 1e9) {
            let [x, y, z] = point_m;
            return Err(
                Error::new(format!("a plane goes through {x} {y} {z}")).help("give a place in metres")
            );
        }
        let size = length(normal);
        if !(1e-9..=1e9).contains(&size) {
            let [x, y, z] = normal;
            return Err(Error::new(format!("a plane has the normal {x} {y} {z}"))
                .help("give a direction, such as 0 1 0 for a floor"));
        }
        check_absorption("a plane", absorption)?;
        let normal = normal.map(|c| c / size);
        Ok(Self { normal, height_m: dot(point_m, normal), gains: reflection(absorption) })
    }

    /// With a unit normal, and what it leaves of the pressure.
    pub(super) fn of(normal: [f64; 3], height_m: f64, gains: Bands) -> Self {
        Self { normal, height_m, gains }
    }

    /// How far in front of it a point is, in metres; below 0 behind it.
    pub fn distance_m(&self, point_m: [f64; 3]) -> f64 {
        dot(point_m, self.normal) - self.height_m
    }
}

/// The reflections among some planes up to an order, numbered. A number means the same planes in the same sequence
/// however these move.
#[derive(Debug, Clone)]
pub struct Reflections {
    planes: usize,
    /// The planes that each reflection meets, from the source on.
    words: Vec<Vec<u8>>,
}

impl Reflections {
    /// Reflections among 0 to 6 planes; number 0 is the source itself. They come by their order, and numbers stay
    /// the same when the highest order is raised.
    pub fn new(planes: usize, order: usize) -> Result<Self> {
        if planes > WALLS {
            return Err(Error::new(format!("{planes} planes reflect each other; {WALLS} can")));
        }
        let (mut words, mut from) = (vec![Vec::new()], 0);
        for _ in 0..order {
            let to = words.len();
            for before in from..to {
                for plane in 0..planes as u8 {
                    if words[before].last() != Some(&plane) {
                        if words.len() == MOST_IMAGES {
                            return Err(too_many(order));
                        }
                        let word = words[before].iter().copied().chain([plane]).collect();
                        words.push(word);
                    }
                }
            }
            if words.len() == to {
                break;
            }
            from = to;
        }
        Ok(Self { planes, words })
    }

    /// How many there are.
    #[expect(clippy::len_without_is_empty, reason = "the source itself is always there")]
    pub fn len(&self) -> usize {
        self.words.len()
    }

    /// Puts the images that the planes make at one time into `out`, by their numbers.
    pub fn images(&self, planes: &[Plane], out: &mut Vec<Image>) -> Result<()> {
        if planes.len() != self.planes {
            let (found, expected) = (planes.len(), self.planes);
            return Err(Error::new(format!("{found} planes; the reflections are those of {expected}")));
        }
        out.clear();
        for word in &self.words {
            out.push(word.iter().fold(Image::SOURCE, |image, wall| {
                let plane = &planes[usize::from(*wall)];
                image.reflected(plane.normal, plane.height_m, &plane.gains, usize::from(*wall))
            }));
        }
        Ok(())
    }

    /// True where a listener hears a source by way of a reflection. Nothing is heard where one of both is behind a
    /// plane, not even directly. Where planes stand at right angles several numbers would be the same
    /// reflection; the first of them is heard.
    pub fn heard(&self, number: usize, planes: &[Plane], source_m: [f64; 3], listener_m: [f64; 3]) -> bool {
        let Some(word) = self.words.get(number).filter(|_| planes.len() == self.planes) else { return false };
        let inside = |point| planes.iter().all(|plane| plane.distance_m(point) > 0.0);
        if !inside(source_m) || !inside(listener_m) || normal_form(word, planes) != *word {
            return false;
        }
        let image_m = word.iter().fold(source_m, |m, wall| mirrored(&planes[usize::from(*wall)], m));
        let mut met = Vec::with_capacity(word.len());
        let all = trace(planes, listener_m, image_m, word.len(), |wall, _| met.push(wall as u8));
        met.reverse();
        all && normal_form(&met, planes) == *word
    }
}

/// Follows a sound back from the listener, towards where its image seems to be, and tells which planes it meets and
/// where; false where they are more than so many.
pub(in crate::space) fn trace(
    planes: &[Plane],
    listener_m: [f64; 3],
    image_m: [f64; 3],
    most: usize,
    mut meets: impl FnMut(usize, [f64; 3]),
) -> bool {
    let (mut from, mut to, mut last, mut count) = (listener_m, image_m, None, 0);
    loop {
        let crossing = planes
            .iter()
            .enumerate()
            .filter(|(wall, plane)| last != Some(*wall) && plane.distance_m(to) < 0.0)
            .map(|(wall, plane)| {
                let (near, far) = (plane.distance_m(from).max(0.0), plane.distance_m(to));
                (wall, near / (near - far))
            })
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((wall, part)) = crossing else { return true };
        if count == most {
            return false;
        }
        (last, count) = (Some(wall), count + 1);
        from = std::array::from_fn(|i| from[i] + part * (to[i] - from[i]));
        to = mirrored(&planes[wall], to);
        meets(wall, from);
    }
}

fn mirrored(plane: &Plane, point_m: [f64; 3]) -> [f64; 3] {
    let away = 2.0 * plane.distance_m(point_m);
    std::array::from_fn(|i| point_m[i] - away * plane.normal[i])
}

/// The first in order of the sequences that differ only by swaps of planes at right angles, whose reflections may be
/// made in either order.
fn normal_form(word: &[u8], planes: &[Plane]) -> Vec<u8> {
    let swap = |a: u8, b: u8| dot(planes[usize::from(a)].normal, planes[usize::from(b)].normal).abs() < RIGHT;
    let (mut rest, mut form) = (word.to_vec(), Vec::with_capacity(word.len()));
    while let Some((index, wall)) = (0..rest.len())
        .filter(|index| rest[..*index].iter().all(|before| swap(*before, rest[*index])))
        .map(|index| (index, rest[index]))
        .min_by_key(|(_, wall)| *wall)
    {
        form.push(wall);
        rest.remove(index);
    }
    form
}

#[cfg(test)]
mod tests {
    use super::super::{Room, Walls};
    use super::*;
    use crate::random::Random;

    fn close(a: [f64; 3], b: [f64; 3]) -> bool {
        (0..3).all(|i| (a[i] - b[i]).abs() < 1e-9)
    }

    fn images(reflections: &Reflections, planes: &[Plane]) -> Vec<Image> {
        let mut out = Vec::new();
        reflections.images(planes, &mut out).unwrap();
        out
    }

    #[test]
    fn a_floor_mirrors_what_is_above_it() {
        let floor = Plane::new([3.0, 0.5, -7.0], [0.0, 2.0, 0.0], &[0.75; 8]).unwrap();
        let reflections = Reflections::new(1, 5).unwrap();
        assert_eq!(reflections.len(), 2, "a plane does not reflect itself");
        let images = images(&reflections, &[floor]);
        assert_eq!(images[0], Image::SOURCE);
        assert!(close(images[1].position_m([1.0, 2.0, 3.0]), [1.0, -1.0, 3.0]));
        assert!(close(images[1].turned([1.0, 2.0, 3.0]), [1.0, -2.0, 3.0]));
        assert_eq!((images[1].gains, images[1].order()), ([0.5; 8], 1));
        let heard = |source, listener| reflections.heard(1, &[floor], source, listener);
        assert!(heard([0.0, 1.0, 0.0], [100.0, 0.6, 0.0]));
        assert!(!heard([0.0, 0.4, 0.0], [100.0, 0.6, 0.0]) && !heard([0.0, 1.0, 0.0], [100.0, 0.4, 0.0]));
        assert!(!reflections.heard(0, &[floor], [0.0, 0.4, 0.0], [100.0, 0.6, 0.0]));
    }

    #[test]
    fn two_parallel_walls_reflect_each_other_without_end() {
        let left = Plane::new([-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], &[0.19; 8]).unwrap();
        let right = Plane::new([2.0, 0.0, 0.0], [-1.0, 0.0, 0.0], &[0.36; 8]).unwrap();
        let planes = [left, right];
        let reflections = Reflections::new(2, 40).unwrap();
        let (source, listener) = ([0.5, 1.0, 0.0], [1.5, 0.0, 9.0]);
        let mut places: Vec<(f64, f64)> = images(&reflections, &planes)
            .iter()
            .map(|image| (image.position_m(source)[0], image.gains[3]))
            .collect();
        assert!((0..reflections.len()).all(|n| reflections.heard(n, &planes, source, listener)));
        places.sort_by(|a, b| a.0.total_cmp(&b.0));
        // 3 m apart: at 6 k + 0.5 and 6 k − 2.5.
        assert_eq!(places.len(), 81);
        for (k, pair) in places.windows(2).enumerate() {
            let gap = pair[1].0 - pair[0].0;
            assert!((gap - 3.0).abs() < 1e-9, "{k} {gap}");
        }
        let gain = |x: f64| places.iter().find(|place| (place.0 - x).abs() < 1e-6).unwrap().1;
        assert!((gain(-2.5) - 0.9).abs() < 1e-12 && (gain(3.5) - 0.8).abs() < 1e-12);
        assert!((gain(6.5) - 0.72).abs() < 1e-12 && (gain(-8.5) - 0.9 * 0.72).abs() < 1e-12);
    }

    #[test]
    fn the_six_planes_of_a_room_make_the_images_of_the_room() {
        let part = |wall: u32| [0.05 * f64::from(wall + 1); 8];
        let walls = Walls {
            left: part(0),
            right: part(1),
            floor: part(2),
            ceiling: part(3),
            front: part(4),
            back: part(5),
        };
        let (corner, size) = ([1.0, -2.0, 3.0], [4.0, 3.0, 5.5]);
        let room = Room::new(corner, size, 0.0, &walls).unwrap();
        let planes: Vec<Plane> = (0..6)
            .map(|wall: u32| {
                let (axis, high) = (wall as usize / 2, wall % 2 == 1);
                let (mut point, mut normal) = (corner, [0.0; 3]);
                point[axis] += if high { size[axis] } else { 0.0 };
                normal[axis] = if high { -1.0 } else { 1.0 };
                Plane::new(point, normal, &part(wall)).unwrap()
            })
            .collect();
        let reflections = Reflections::new(6, 3).unwrap();
        let expected = room.images(3).unwrap();
        let random = Random::new(5, 5);
        for trial in 0..20 {
            let place = |which: u64| {
                std::array::from_fn(|i| corner[i] + size[i] * random.uniform(6 * trial + which + i as u64))
            };
            let (source, listener) = (place(0), place(3));
            let found: Vec<Image> = images(&reflections, &planes)
                .into_iter()
                .enumerate()
                .filter(|(number, _)| reflections.heard(*number, &planes, source, listener))
                .map(|(_, image)| image)
                .collect();
            assert_eq!(found.len(), expected.len());
            for image in &expected {
                let same = found.iter().find(|found| {
                    found.walls == image.walls && close(found.position_m(source), image.position_m(source))
                });
                let same = same.unwrap();
                assert!((same.gains[0] - image.gains[0]).abs() < 1e-12);
                assert!(close(same.leaves([1.0, 2.0, 3.0]), image.leaves([1.0, 2.0, 3.0])));
            }
        }
    }

    #[test]
    fn a_path_by_way_of_two_planes_meets_both_and_obeys_the_mirror() {
        // A wedge of 50 degrees, everywhere within it: what is heard is a path of mirrors whose legs add up to the
        // distance of the image, and what is not heard has none.
        let angle = 50f64.to_radians();
        let floor = Plane::new([0.0; 3], [0.0, 1.0, 0.0], &[0.0; 8]).unwrap();
        let slope = Plane::new([0.0; 3], [angle.sin(), -angle.cos(), 0.0], &[0.0; 8]).unwrap();
        let planes = [floor, slope];
        let reflections = Reflections::new(2, 4).unwrap();
        let at = |degrees: f64, r: f64| [r * degrees.to_radians().cos(), r * degrees.to_radians().sin(), 0.0];
        let mut counts = [0; 5];
        for (source, listener) in (1..50).flat_map(|a| (1..50).map(move |b| (f64::from(a), f64::from(b)))) {
            for number in 0..reflections.len() {
                // The images of a wedge lie on a circle: an image at an angle φ is heard by a listener at ψ where
                // they are less than half a turn apart, seen through as many copies of the wedge.
                let image = &images(&reflections, &planes)[number];
                let word = &reflections.words[number];
                let unfolded = match (word.first(), word.len() % 2) {
                    (None, _) => source,
                    // By the floor last, down; by the slope last, up.
                    _ if word.last() == Some(&0) => {
                        let k = word.len() as f64;
                        if word.len() % 2 == 1 { -source - 50.0 * (k - 1.0) } else { source - 50.0 * k }
                    }
                    _ => {
                        let k = word.len() as f64;
                        if word.len() % 2 == 1 { 50.0 * (k + 1.0) - source } else { source + 50.0 * k }
                    }
                };
                let p = image.position_m(at(source, 2.0));
                assert!(close(p, at(unfolded, 2.0)), "{source} {word:?}");
                let expected = (unfolded - listener).abs() < 180.0;
                let found = reflections.heard(number, &planes, at(source, 2.0), at(listener, 3.0));
                if ((unfolded - listener).abs() - 180.0).abs() > 1e-6 {
                    assert_eq!(found, expected, "{source} {listener} {word:?}");
                }
                counts[word.len()] += usize::from(found);
            }
        }
        assert!(counts.iter().all(|count| *count > 0), "{counts:?}");
    }

    #[test]
    fn odd_planes_and_orders_are_refused() {
        let none = [0.0; 8];
        assert!(Plane::new([f64::NAN, 0.0, 0.0], [0.0, 1.0, 0.0], &none).is_err());
        assert!(Plane::new([0.0; 3], [0.0; 3], &none).is_err());
        assert!(Plane::new([0.0; 3], [f64::INFINITY, 0.0, 0.0], &none).is_err());
        let error = Plane::new([0.0; 3], [0.0, 1.0, 0.0], &[1.5; 8]).unwrap_err().to_string();
        assert!(error.starts_with("a plane absorbs 1.5 of the energy at 63 Hz"), "{error}");
        assert!(Reflections::new(7, 1).is_err() && Reflections::new(2, usize::MAX).is_err());
        assert!(Reflections::new(6, 6).is_err(), "23 437 of them");
        assert_eq!(Reflections::new(6, 5).unwrap().len(), 4687);
        assert_eq!(Reflections::new(0, usize::MAX).unwrap().len(), 1);
        let floor = Plane::new([0.0; 3], [0.0, 1.0, 0.0], &none).unwrap();
        let two = Reflections::new(2, 2).unwrap();
        assert!(two.images(&[floor], &mut Vec::new()).is_err());
        assert!(!two.heard(1, &[floor], [0.0, 1.0, 0.0], [0.0, 2.0, 0.0]));
        assert!(!two.heard(99, &[floor, floor], [0.0, 1.0, 0.0], [0.0, 2.0, 0.0]));
    }
}
