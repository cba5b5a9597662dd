//! Directions as the corners of triangles upon the unit sphere: which three lie about any other, and how much
//! each of them counts there.
//!
//! The triangles are those of Delaunay, which upon a sphere are the faces of the convex hull. Directions of
//! one ring lie in one plane, where the hull could be cut into triangles in several ways: a radius that
//! differs by some parts in 10⁸ decides which, and is forgotten afterwards.

use crate::random::Random;

/// A vector, or a direction of length 1.
pub(super) type Vector = [f64; 3];

pub(super) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// The determinant of three vectors; positive where they turn as seen from outside.
fn determinant(a: Vector, b: Vector, c: Vector) -> f64 {
    dot(a, cross(b, c))
}

/// A direction so near to a corner counts as that corner.
const SAME: f64 = 1e-9;

/// How much the radii differ while triangles are made. It must be less than a chord of the closest
/// directions (0.05°) lies below its arc, 4 · 10⁻⁷.
const UNEVENNESS: f64 = 1e-8;

/// Triangles upon the unit sphere.
#[derive(Debug)]
pub(super) struct Grid {
    corners: Vec<Vector>,
    triangles: Vec<[u32; 3]>,
    /// For each corner of a triangle the triangle across the side that it is not on.
    neighbours: Vec<[u32; 3]>,
    /// For each cell of a cube about the sphere a triangle there, from which a search begins.
    cells: Vec<u32>,
    /// Cells along a side of the cube.
    cells_per_side: usize,
}

impl Grid {
    /// Joins directions, of which there must be one within 30° of each half axis, and none closer than
    /// 0.05° to another.
    pub(super) fn new(corners: Vec<Vector>) -> Option<Self> {
        let mut hull = Hull::begin(&corners)?;
        let mut order: Vec<u32> = (0..corners.len() as u32).filter(|v| !hull.first.contains(v)).collect();
        // In a random order few triangles are made in vain.
        let random = Random::new(0, 0);
        order.sort_by(|a, b| random.uniform(u64::from(*a)).total_cmp(&random.uniform(u64::from(*b))));
        for corner in order {
            hull.insert(corner)?;
        }
        let (triangles, neighbours) = hull.finish(&corners)?;
        let cells_per_side = ((corners.len() as f64 / 3.0).sqrt().ceil() as usize).clamp(1, 256);
        let mut grid = Self { corners, triangles, neighbours, cells: Vec::new(), cells_per_side };
        let mut last = 0;
        let middle = |cell: usize| 2.0 * (cell as f64 + 0.5) / cells_per_side as f64 - 1.0;
        let mut cells = Vec::with_capacity(6 * cells_per_side * cells_per_side);
        for side in 0..6 {
            for row in 0..cells_per_side {
                for column in 0..cells_per_side {
                    let mut towards = [0.0; 3];
                    towards[side / 2] = if side % 2 == 0 { 1.0 } else { -1.0 };
                    towards[(side / 2 + 1) % 3] = middle(column);
                    towards[(side / 2 + 2) % 3] = middle(row);
                    last = grid.find(towards, last).0;
                    cells.push(last as u32);
                }
            }
        }
        grid.cells = cells;
        Some(grid)
    }

    /// The corners about a direction, which need not have length 1, and their weights, which are continuous in
    /// the direction, add up to 1, and are 1 for a corner itself.
    pub(super) fn weights(&self, towards: Vector) -> ([usize; 3], [f64; 3]) {
        let (triangle, mut weights) = self.find(towards, self.cells[self.cell(towards)] as usize);
        let corners = self.triangles[triangle].map(|corner| corner as usize);
        weights = weights.map(|weight| weight.max(0.0));
        let sum: f64 = weights.iter().sum();
        if sum > 0.0 {
            weights = weights.map(|weight| weight / sum);
        } else {
            weights = [1.0, 0.0, 0.0];
        }
        if let Some(corner) = weights.iter().position(|weight| *weight > 1.0 - SAME) {
            weights = std::array::from_fn(|k| if k == corner { 1.0 } else { 0.0 });
        }
        (corners, weights)
    }

    fn cell(&self, towards: Vector) -> usize {
        let size = towards.map(f64::abs);
        let axis = if size[0] >= size[1] && size[0] >= size[2] {
            0
        } else if size[1] >= size[2] {
            1
        } else {
            2
        };
        let side = 2 * axis + usize::from(towards[axis] < 0.0);
        let place = |axis: usize| {
            let along = (towards[axis] / size[side / 2] + 1.0) / 2.0 * self.cells_per_side as f64;
            (along as usize).min(self.cells_per_side - 1)
        };
        (side * self.cells_per_side + place((axis + 2) % 3)) * self.cells_per_side + place((axis + 1) % 3)
    }

    /// The triangle about a direction, and its corners' weights, not yet of sum 1.
    fn find(&self, towards: Vector, begin: usize) -> (usize, [f64; 3]) {
        walk(&self.corners, &self.triangles, &self.neighbours, towards, begin)
    }
}

/// The weights of a triangle's corners for a direction, up to a factor: negative beyond a side.
fn barycentric(corners: &[Vector], triangle: [u32; 3], towards: Vector) -> [f64; 3] {
    let [a, b, c] = triangle.map(|corner| corners[corner as usize]);
    [determinant(towards, b, c), determinant(towards, c, a), determinant(towards, a, b)]
}

/// From triangle to triangle, each time across the side that the direction is furthest beyond.
fn walk(
    corners: &[Vector],
    triangles: &[[u32; 3]],
    neighbours: &[[u32; 3]],
    towards: Vector,
    begin: usize,
) -> (usize, [f64; 3]) {
    let mut at = begin;
    for _ in 0..1000 {
        let weights = barycentric(corners, triangles[at], towards);
        let side = (0..3).fold(0, |least, k| if weights[k] < weights[least] { k } else { least });
        if weights[side] >= 0.0 {
            return (at, weights);
        }
        let next = neighbours[at][side] as usize;
        // Upon a side rounding may send it to and fro.
        if neighbours[next].contains(&(at as u32)) {
            let back = barycentric(corners, triangles[next], towards);
            let other = (0..3).fold(0, |least, k| if back[k] < back[least] { k } else { least });
            if neighbours[next][other] as usize == at && back[other] < 0.0 {
                return if back[other] > weights[side] { (next, back) } else { (at, weights) };
            }
        }
        at = next;
    }
    // Where that leads round in circles every triangle is asked.
    let mut best = (begin, [f64::NEG_INFINITY; 3]);
    let least = |weights: [f64; 3]| weights.into_iter().fold(f64::INFINITY, f64::min);
    // (One that is no more has one corner three times.)
    for (index, triangle) in triangles.iter().enumerate().filter(|(_, triangle)| triangle[0] != triangle[1]) {
        let weights = barycentric(corners, *triangle, towards);
        if least(weights) > least(best.1) {
            best = (index, weights);
        }
    }
    best
}

/// Triangles, and for each corner of each the triangle across.
type Joined = (Vec<[u32; 3]>, Vec<[u32; 3]>);

/// A convex hull that grows corner by corner.
struct Hull {
    /// The six corners that it began with.
    first: Vec<u32>,
    /// Directions, at radii that differ a little.
    points: Vec<Vector>,
    triangles: Vec<[u32; 3]>,
    neighbours: Vec<[u32; 3]>,
    dead: Vec<bool>,
    /// Where triangles were that are no more.
    free: Vec<usize>,
    /// By its first corner, a triangle just made.
    by_corner: Vec<u32>,
    last: usize,
}

impl Hull {
    fn begin(corners: &[Vector]) -> Option<Self> {
        let random = Random::new(0, 1);
        let uneven =
            |(n, corner): (usize, &Vector)| corner.map(|x| x * (1.0 + UNEVENNESS * random.uniform(n as u64)));
        let points: Vec<Vector> = corners.iter().enumerate().map(uneven).collect();
        // The corners nearest to the half axes: the origin lies between them.
        let mut first = Vec::with_capacity(6);
        for axis in 0..6 {
            let along = |corner: &Vector| corner[axis / 2] * if axis % 2 == 0 { 1.0 } else { -1.0 };
            let nearest =
                (0..corners.len()).max_by(|a, b| along(&corners[*a]).total_cmp(&along(&corners[*b])))?;
            if along(&corners[nearest]) < 0.86 || first.contains(&(nearest as u32)) {
                return None;
            }
            first.push(nearest as u32);
        }
        // Of all triangles between them those that have no corner outside.
        let mut triangles = Vec::new();
        for i in 0..6 {
            for j in i + 1..6 {
                for k in j + 1..6 {
                    let mut triangle = [first[i], first[j], first[k]];
                    let [a, b, c] = triangle.map(|corner| points[corner as usize]);
                    if determinant(a, b, c) < 0.0 {
                        triangle.swap(1, 2);
                    }
                    let others = first.iter().filter(|corner| !triangle.contains(corner));
                    if others.into_iter().all(|other| height(&points, triangle, *other) < 0.0) {
                        triangles.push(triangle);
                    }
                }
            }
        }
        if triangles.len() != 8 {
            return None;
        }
        let across = |triangle: &[u32; 3], side: usize| {
            let (from, to) = (triangle[(side + 1) % 3], triangle[(side + 2) % 3]);
            let shares = |other: &[u32; 3]| (0..3).any(|k| other[k] == to && other[(k + 1) % 3] == from);
            triangles.iter().position(shares).map(|index| index as u32)
        };
        let neighbours = triangles
            .iter()
            .map(|triangle| Some([across(triangle, 0)?, across(triangle, 1)?, across(triangle, 2)?]))
            .collect::<Option<Vec<_>>>()?;
        let dead = vec![false; triangles.len()];
        let by_corner = vec![0; corners.len()];
        Some(Self { first, points, triangles, neighbours, dead, free: Vec::new(), by_corner, last: 0 })
    }

    fn insert(&mut self, corner: u32) -> Option<()> {
        let point = self.points[corner as usize];
        let (below, _) = walk(&self.points, &self.triangles, &self.neighbours, point, self.last);
        if self.dead[below] {
            return None;
        }
        // All triangles that the new corner sees go; the sides about them are joined with it.
        let mut stack = vec![below];
        let mut gone = vec![below];
        self.dead[below] = true;
        let mut rim = Vec::new();
        while let Some(at) = stack.pop() {
            for side in 0..3 {
                let next = self.neighbours[at][side] as usize;
                if self.dead[next] {
                    continue;
                }
                if height(&self.points, self.triangles[next], corner) > 0.0 {
                    self.dead[next] = true;
                    gone.push(next);
                    stack.push(next);
                }
            }
        }
        for &at in &gone {
            for side in 0..3 {
                let next = self.neighbours[at][side];
                if !self.dead[next as usize] {
                    let triangle = self.triangles[at];
                    rim.push((triangle[(side + 1) % 3], triangle[(side + 2) % 3], next));
                }
            }
        }
        let mut made = Vec::with_capacity(rim.len());
        for &(from, to, beyond) in &rim {
            let index = self.free.pop().unwrap_or(self.triangles.len());
            if index == self.triangles.len() {
                self.triangles.push([0; 3]);
                self.neighbours.push([0; 3]);
                self.dead.push(false);
            }
            self.triangles[index] = [from, to, corner];
            self.neighbours[index] = [u32::MAX, u32::MAX, beyond];
            self.dead[index] = false;
            self.by_corner[from as usize] = index as u32;
            // The side between them, as the one beyond has it.
            let side = (0..3).find(|k| {
                let other = self.triangles[beyond as usize];
                other[(k + 1) % 3] == to && other[(k + 2) % 3] == from
            });
            self.neighbours[beyond as usize][side?] = index as u32;
            made.push(index);
        }
        for &index in &made {
            let [_, to, _] = self.triangles[index];
            let next = self.by_corner[to as usize];
            // Across the side from `to` to the new corner lies the triangle that begins with `to`.
            if self.triangles[next as usize][0] != to || self.triangles[next as usize][2] != corner {
                return None;
            }
            self.neighbours[index][0] = next;
            self.neighbours[next as usize][1] = index as u32;
        }
        for &at in &gone {
            self.triangles[at] = [corner; 3];
        }
        self.free.append(&mut gone);
        self.last = *made.last()?;
        Some(())
    }

    /// The triangles that are left, as long as they are what they should be.
    fn finish(self, corners: &[Vector]) -> Option<Joined> {
        let mut number = vec![u32::MAX; self.triangles.len()];
        let alive: Vec<usize> = (0..self.triangles.len()).filter(|index| !self.dead[*index]).collect();
        for (n, index) in alive.iter().enumerate() {
            number[*index] = n as u32;
        }
        let triangles: Vec<[u32; 3]> = alive.iter().map(|index| self.triangles[*index]).collect();
        let neighbours: Vec<[u32; 3]> =
            alive.iter().map(|index| self.neighbours[*index].map(|n| number[n as usize])).collect();
        let sound = triangles.len() == 2 * corners.len() - 4
            && neighbours.as_flattened().iter().all(|n| *n != u32::MAX)
            && triangles.iter().all(|triangle| {
                let [a, b, c] = triangle.map(|corner| corners[corner as usize]);
                determinant(a, b, c) > 0.0
            });
        sound.then_some((triangles, neighbours))
    }
}

/// How far a corner lies above the plane of a triangle, up to a factor.
fn height(points: &[Vector], triangle: [u32; 3], corner: u32) -> f64 {
    let [a, b, c] = triangle.map(|corner| points[corner as usize]);
    dot(cross(minus(b, a), minus(c, a)), minus(points[corner as usize], a))
}
