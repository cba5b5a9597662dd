//! Points on the unit sphere about a listener: their convex hull, and which triangle a direction lies in.

use std::collections::BTreeSet;

/// Points this near to a plane lie in it.
const FLAT: f64 = 1e-7;

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(super) fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// A vector with length 1; one without length stays as it is.
pub(super) fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = dot(v, v).sqrt();
    if length > 0.0 { v.map(|c| c / length) } else { v }
}

/// A face of a convex hull.
#[derive(Debug, Clone)]
pub(super) struct Face {
    /// Its corners, three or more, counter-clockwise seen from outside.
    pub corners: Vec<usize>,
    /// Unit vector that points out of the hull.
    pub normal: [f64; 3],
    /// The distance of its plane from the origin; below 0 where the origin lies outside of it.
    pub distance: f64,
}

/// The convex hull of three or more points on the unit sphere, no two of them in one place. Points in
/// one plane make a face with as many corners; if all of them do, the hull is that face from both sides.
///
/// Gift wrapping (Chand & Kapur 1970): about each edge of a face, the next face is the one that leaves no point
/// outside. Takes a time of points × edges.
pub(super) fn hull(points: &[[f64; 3]]) -> Vec<Face> {
    // On a sphere the two points nearest to each other are an edge.
    let pairs = (0..points.len()).flat_map(|i| (0..i).map(move |k| (k, i)));
    let apart = |&(i, k): &(usize, usize)| dot(minus(points[i], points[k]), minus(points[i], points[k]));
    let Some(start) = pairs.min_by(|a, b| apart(a).total_cmp(&apart(b))) else { return Vec::new() };
    let (mut faces, mut done) = (Vec::new(), BTreeSet::new());
    let mut open = vec![start];
    while let Some((a, b)) = open.pop() {
        if done.contains(&(a, b)) {
            continue;
        }
        let Some(face) = face_left_of(points, a, b) else { continue };
        for (i, &corner) in face.corners.iter().enumerate() {
            let next = face.corners[(i + 1) % face.corners.len()];
            done.insert((corner, next));
            open.push((next, corner));
        }
        // Points so nearly in one plane that rounding decides could lead on for ever.
        if faces.len() > 4 * points.len() {
            break;
        }
        faces.push(face);
    }
    faces
}

/// The face that has the edge from `a` to `b`.
fn face_left_of(points: &[[f64; 3]], a: usize, b: usize) -> Option<Face> {
    let (origin, along) = (points[a], minus(points[b], points[a]));
    let normal_of = |c: usize| unit(cross(along, minus(points[c], origin)));
    let mut others = (0..points.len()).filter(|&i| i != a && i != b);
    let mut normal = normal_of(others.next()?);
    for i in others {
        if dot(normal, minus(points[i], origin)) > FLAT * 0.01 {
            normal = normal_of(i);
        }
    }
    let mut corners: Vec<usize> =
        (0..points.len()).filter(|&i| dot(normal, minus(points[i], origin)).abs() <= FLAT).collect();
    // About the middle of the circle they lie on, from `a` on.
    let distance = dot(normal, origin);
    let ahead = minus(origin, normal.map(|c| c * distance));
    let left = cross(normal, ahead);
    let angle = |i: usize| {
        let turn = dot(points[i], left).atan2(dot(points[i], ahead));
        if i == a { 0.0 } else { turn.rem_euclid(std::f64::consts::TAU) }
    };
    corners.sort_by(|&i, &k| angle(i).total_cmp(&angle(k)));
    Some(Face { corners, normal, distance })
}

/// Cells along each edge of the cube that directions are sorted by.
const CELLS: usize = 8;

/// Triangles that cover the sphere, and which of them may lie in which direction.
#[derive(Debug, Clone)]
pub(super) struct Triangulation {
    triangles: Vec<Triangle>,
    /// Where the candidates of each cell begin.
    begins: Vec<u32>,
    candidates: Vec<u16>,
}

#[derive(Debug, Clone)]
struct Triangle {
    corners: [u16; 3],
    /// The inverse of the matrix whose columns are its corners.
    inverse: [[f64; 3]; 3],
}

impl Triangulation {
    /// Triangles by the numbers of their corners; at most 65536 of each. Those that the origin lies in the
    /// plane of are left out.
    pub fn new(points: &[[f64; 3]], triangles: impl IntoIterator<Item = [usize; 3]>) -> Self {
        let triangle = |corners: [usize; 3]| {
            let [a, b, c] = corners.map(|i| points[i]);
            let volume = dot(a, cross(b, c));
            let rows = [cross(b, c), cross(c, a), cross(a, b)];
            let inverse = rows.map(|row| row.map(|v| v / volume));
            (volume.abs() > 1e-9).then(|| Triangle { corners: corners.map(|i| i as u16), inverse })
        };
        let triangles: Vec<Triangle> = triangles.into_iter().filter_map(triangle).collect();
        let (mut begins, mut candidates) = (vec![0], Vec::new());
        for cell in 0..6 * CELLS * CELLS {
            let (middle, radius) = cell_cap(cell);
            let reach = radius.sin() + 1e-9;
            for (i, triangle) in triangles.iter().enumerate() {
                if triangle.inverse.iter().all(|&row| dot(unit(row), middle) >= -reach) {
                    candidates.push(i as u16);
                }
            }
            begins.push(candidates.len() as u32);
        }
        Self { triangles, begins, candidates }
    }

    /// The corners of the triangle that a direction lies in, and the weights g, none below 0, with
    /// Σ g · corner = direction. The direction may have any length but 0.
    pub fn find(&self, direction: [f64; 3]) -> ([usize; 3], [f64; 3]) {
        let cell = cell_of(direction);
        let range = self.begins[cell] as usize..self.begins[cell + 1] as usize;
        let (mut best, mut found) = (f64::NEG_INFINITY, ([0; 3], [0.0; 3]));
        for &i in &self.candidates[range] {
            let triangle = &self.triangles[usize::from(i)];
            let weights = triangle.inverse.map(|row| dot(row, direction));
            let least = weights[0].min(weights[1]).min(weights[2]);
            if least > best {
                best = least;
                found = (triangle.corners.map(usize::from), weights);
                if least >= 0.0 {
                    break;
                }
            }
        }
        (found.0, found.1.map(|g| g.max(0.0)))
    }
}

/// The cell of a direction on a cube about the origin.
fn cell_of([x, y, z]: [f64; 3]) -> usize {
    let (ax, ay, az) = (x.abs(), y.abs(), z.abs());
    let (side, most, u, v) = if ax >= ay && ax >= az {
        (usize::from(x < 0.0), ax, y, z)
    } else if ay >= az {
        (2 + usize::from(y < 0.0), ay, z, x)
    } else {
        (4 + usize::from(z < 0.0), az, x, y)
    };
    // Numbers out of range, and none, are brought into it by the conversion.
    let place = |c: f64| (((c / most + 1.0) * (0.5 * CELLS as f64)) as usize).min(CELLS - 1);
    (side * CELLS + place(u)) * CELLS + place(v)
}

/// The middle of a cell, and the angle from there to its furthest corner.
fn cell_cap(cell: usize) -> ([f64; 3], f64) {
    let (side, u, v) = (cell / (CELLS * CELLS), cell / CELLS % CELLS, cell % CELLS);
    let point = |du: f64, dv: f64| {
        let at = |place: usize, d: f64| 2.0 * (place as f64 + d) / CELLS as f64 - 1.0;
        let (u, v) = (at(u, du), at(v, dv));
        let most = if side % 2 == 0 { 1.0 } else { -1.0 };
        unit(match side / 2 {
            0 => [most, u, v],
            1 => [v, most, u],
            _ => [u, v, most],
        })
    };
    let middle = point(0.5, 0.5);
    let corners = [point(0.0, 0.0), point(0.0, 1.0), point(1.0, 0.0), point(1.0, 1.0)];
    let nearest = corners.iter().map(|&corner| dot(corner, middle)).fold(1.0, f64::min);
    (middle, nearest.acos())
}

/// `count` directions spread nearly evenly over the sphere, each with nearly the same share of it: a
/// spiral turned by the golden angle (González 2010), pole up.
pub(crate) fn even_directions(count: usize) -> impl Iterator<Item = [f64; 3]> {
    let golden_angle = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..count).map(move |i| {
        let up = 1.0 - (2 * i + 1) as f64 / count as f64;
        let (sin, cos) = (i as f64 * golden_angle).sin_cos();
        let around = (1.0 - up * up).sqrt();
        [around * sin, up, -around * cos]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn directions(seed: u64, count: u64) -> Vec<[f64; 3]> {
        let random = Random::new(seed, 0);
        let point = |i: u64| {
            let z = 2.0 * random.uniform(2 * i) - 1.0;
            let (sin, cos) = (std::f64::consts::TAU * random.uniform(2 * i + 1)).sin_cos();
            let r = (1.0 - z * z).sqrt();
            [r * cos, r * sin, z]
        };
        (0..count).map(point).collect()
    }

    fn check(points: &[[f64; 3]], faces: &[Face]) {
        let mut edges = BTreeSet::new();
        for face in faces {
            for &point in points {
                assert!(dot(face.normal, point) <= face.distance + 1.1 * FLAT);
            }
            for (i, &a) in face.corners.iter().enumerate() {
                let b = face.corners[(i + 1) % face.corners.len()];
                assert!(edges.insert((a, b)), "each edge once");
                let middle: [f64; 3] = std::array::from_fn(|k| {
                    face.corners.iter().map(|&c| points[c][k]).sum::<f64>() / face.corners.len() as f64
                });
                let turn = cross(minus(points[b], points[a]), minus(middle, points[a]));
                assert!(dot(turn, face.normal) > 0.0, "counter-clockwise");
            }
        }
        assert!(edges.iter().all(|&(a, b)| edges.contains(&(b, a))), "closed");
        // Euler: corners − edges + faces = 2; all points of a sphere are corners.
        assert_eq!(points.len() + faces.len(), edges.len() / 2 + 2);
    }

    #[test]
    fn hulls_are_closed_convex_and_hold_all_points() {
        for (seed, count) in [(1, 4), (2, 5), (3, 7), (4, 20), (5, 64), (6, 300)] {
            let points = directions(seed, count);
            check(&points, &hull(&points));
        }
        for count in [4, 8, 32, 100, 256] {
            let points: Vec<_> = even_directions(count).collect();
            check(&points, &hull(&points));
        }
    }

    #[test]
    fn points_in_one_plane_make_one_face() {
        let cube: Vec<[f64; 3]> =
            (0..8).map(|i| unit([0, 1, 2].map(|axis| if i >> axis & 1 == 0 { 1.0 } else { -1.0 }))).collect();
        let faces = hull(&cube);
        check(&cube, &faces);
        assert_eq!(faces.len(), 6);
        assert!(faces.iter().all(|face| (face.distance - 1.0 / 3f64.sqrt()).abs() < 1e-12));
        // A ring is a face from both sides.
        let ring: Vec<[f64; 3]> =
            (0..7).map(|i| (f64::from(i * i)).sin_cos()).map(|(x, z)| [x, 0.0, z]).collect();
        let faces = hull(&ring);
        assert_eq!(faces.len(), 2);
        check(&ring, &faces);
        assert!((faces[0].normal[1] + faces[1].normal[1]).abs() < 1e-12);
    }

    #[test]
    fn every_direction_lies_in_the_triangle_found() {
        for count in [4, 12, 32, 200] {
            let points: Vec<_> = even_directions(count).collect();
            let triangles: Vec<[usize; 3]> = hull(&points)
                .iter()
                .flat_map(|face| {
                    (2..face.corners.len())
                        .map(|i| [face.corners[0], face.corners[i - 1], face.corners[i]])
                        .collect::<Vec<_>>()
                })
                .collect();
            let all = Triangulation::new(&points, triangles);
            for mut direction in directions(9, 5000).into_iter().chain(points.iter().copied()) {
                direction = direction.map(|c| 3.0 * c);
                let (corners, weights) = all.find(direction);
                let sum: [f64; 3] =
                    std::array::from_fn(|k| (0..3).map(|i| weights[i] * points[corners[i]][k]).sum());
                assert!(minus(sum, direction).iter().all(|c| c.abs() < 1e-9), "{direction:?} {sum:?}");
                assert!(weights.iter().all(|&w| w >= 0.0));
            }
        }
    }

    #[test]
    fn points_nearly_in_one_plane_leave_no_hole() {
        // Towers of rings, of which many fours are in one plane, shaken by more and less than what counts as flat.
        for shake in 0..120 {
            let random = Random::new(shake, 3);
            let size = 10f64.powi(-(shake as i32 % 12) - 1);
            let points: Vec<[f64; 3]> = (0..30)
                .map(|i: u64| {
                    let up = [-0.9f64, -0.4, 0.0, 0.5, 0.8][i as usize / 6];
                    let (sin, cos) = (std::f64::consts::TAU * (i % 6) as f64 / 6.0).sin_cos();
                    let around = (1.0 - up * up).sqrt();
                    let at = [around * sin, up, around * cos];
                    unit([0, 1, 2].map(|k| at[k] + size * (random.uniform(3 * i + k as u64) - 0.5)))
                })
                .collect();
            let triangles = hull(&points).into_iter().flat_map(|face| {
                let corners = face.corners;
                (2..corners.len()).map(move |i| [corners[0], corners[i - 1], corners[i]])
            });
            let all = Triangulation::new(&points, triangles);
            for direction in directions(shake, 2000).into_iter().chain(points.iter().copied()) {
                let (corners, weights) = all.find(direction);
                let sum: [f64; 3] =
                    std::array::from_fn(|k| (0..3).map(|i| weights[i] * points[corners[i]][k]).sum());
                assert!(
                    minus(sum, direction).iter().all(|c| c.abs() < 1e-5),
                    "{shake}: {direction:?} {sum:?}"
                );
            }
        }
    }

    #[test]
    fn a_direction_that_is_none_is_no_panic() {
        let points: Vec<_> = even_directions(12).collect();
        let all = Triangulation::new(
            &points,
            hull(&points).iter().map(|f| [f.corners[0], f.corners[1], f.corners[2]]),
        );
        for odd in [[0.0; 3], [f64::NAN; 3], [f64::INFINITY, 0.0, 0.0], [1e300, -1e300, 1e-300]] {
            all.find(odd);
        }
    }
}
