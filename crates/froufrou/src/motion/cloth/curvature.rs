//! Mean curvature and area at each vertex of a triangle mesh.
//!
//! The cotangent operator with mixed areas (Meyer, Desbrun, Schröder and Barr 2003): the mean curvature normal at
//! vertex i is K = 1/(2A) Σⱼ (cot α + cot β)(xᵢ − xⱼ), over the edges to its neighbours j and the angles opposite of
//! them, and H = ½ K·n. A is the Voronoi area, but where a triangle is obtuse half of its area goes to that corner and
//! a quarter to either other. n is the mean normal of the triangles about, by area.

use glam::DVec3;

use super::triangulation::Triangulation;

/// A triangle that is lower than this part of its longest side has no angles to speak of.
const FLATTEST: f64 = 1e-7;

/// The curvature and area of every vertex, in arrays that are used again from frame to frame.
#[derive(Debug, Clone, Default)]
pub struct Curvature {
    sums: Vec<Sums>,
    mean_per_m: Vec<f64>,
    area_m2: Vec<f64>,
}

/// What the triangles at a vertex add up to.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    /// Σ (cot α + cot β)(xᵢ − xⱼ).
    pull: DVec3,
    /// Σ of the triangles' normals, each twice as long as its area.
    normal: DVec3,
    area: f64,
}

impl Curvature {
    /// Measures a mesh as it lies now. The work is some 60 products and sums a triangle.
    ///
    /// # Panics
    /// Fewer positions than the triangulation has vertices.
    pub fn measure(&mut self, surface: &Triangulation, positions: &[[f32; 3]]) {
        let count = surface.vertex_count();
        self.sums.clear();
        self.sums.resize(count, Sums::default());
        let place = |vertex: u32| DVec3::from(positions[vertex as usize].map(f64::from));
        for &[i, j, k] in surface.triangles() {
            let (a, b, c) = (place(i), place(j), place(k));
            // Each side lies opposite of the corner of its name.
            let (side_a, side_b, side_c) = (c - b, a - c, b - a);
            let normal = side_a.cross(side_b);
            let doubled = normal.length();
            let squares = [side_a.length_squared(), side_b.length_squared(), side_c.length_squared()];
            // Sums of what is no number would stay so; the least height is the doubled area by the longest side.
            let is_flat = doubled <= FLATTEST * squares[0].max(squares[1]).max(squares[2]);
            if is_flat {
                continue;
            }
            let dots = [-side_b.dot(side_c), -side_c.dot(side_a), -side_a.dot(side_b)];
            let cotangents = dots.map(|dot| dot / doubled);
            let (pull_a, pull_b, pull_c) =
                (cotangents[0] * side_a, cotangents[1] * side_b, cotangents[2] * side_c);
            let areas = mixed(doubled, squares, dots, cotangents);
            for (vertex, pull, area) in [
                (i, pull_b - pull_c, areas[0]),
                (j, pull_c - pull_a, areas[1]),
                (k, pull_a - pull_b, areas[2]),
            ] {
                let sums = &mut self.sums[vertex as usize];
                sums.pull += pull;
                sums.normal += normal;
                sums.area += area;
            }
        }
        self.area_m2.clear();
        self.area_m2.extend(self.sums.iter().map(|sums| sums.area));
        self.mean_per_m.clear();
        let curvature = |(sums, &inner): (&Sums, &bool)| {
            let length = sums.normal.length();
            // (4 A) is twice the 2 A of K and the half of H.
            let found = sums.pull.dot(sums.normal) / (4.0 * sums.area * length);
            if inner && found.is_finite() { found } else { 0.0 }
        };
        self.mean_per_m.extend(self.sums.iter().zip(surface.inner()).map(curvature));
    }

    /// The mean curvature H of every vertex in 1/m, above 0 where the surface is convex seen from where its triangles
    /// wind counter-clockwise: 1/R on a sphere seen from outside. Vertices without a closed fan of triangles (at
    /// boundaries, on edges of three triangles, in none) have 0.
    pub fn mean_per_m(&self) -> &[f64] {
        &self.mean_per_m
    }

    /// The mixed area of every vertex in square metres; all add up to that of the mesh.
    pub fn area_m2(&self) -> &[f64] {
        &self.area_m2
    }
}

/// What of a triangle's area is that of each corner.
fn mixed(doubled: f64, squares: [f64; 3], dots: [f64; 3], cotangents: [f64; 3]) -> [f64; 3] {
    match dots.iter().position(|&dot| dot < 0.0) {
        Some(obtuse) => {
            let mut areas = [0.125 * doubled; 3];
            areas[obtuse] = 0.25 * doubled;
            areas
        }
        None => {
            let part = |side: usize| squares[side] * cotangents[side] / 8.0;
            [part(1) + part(2), part(2) + part(0), part(0) + part(1)]
        }
    }
}

#[cfg(test)]
mod tests;
