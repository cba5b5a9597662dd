//! Meshes with closed forms, for tests.

use std::f64::consts::TAU;

use crate::scene::animation::Mesh;

fn single(positions: impl IntoIterator<Item = [f64; 3]>) -> Vec<[f32; 3]> {
    positions.into_iter().map(|p| p.map(|c| c as f32)).collect()
}

fn triangles(positions: Vec<[f32; 3]>, corners: Vec<[u32; 3]>) -> Mesh {
    let face_sizes = vec![3; corners.len()];
    Mesh { positions, face_vertices: corners.concat(), face_sizes }
}

/// A sheet of `columns` × `rows` cells, each cut in two, whose diagonals alternate; `place` bends the unit square.
pub fn sheet(columns: u32, rows: u32, place: impl Fn(f64, f64) -> [f64; 3]) -> Mesh {
    let positions = (0..=rows).flat_map(|j| (0..=columns).map(move |i| (i, j)));
    let positions = single(
        positions.map(|(i, j)| place(f64::from(i) / f64::from(columns), f64::from(j) / f64::from(rows))),
    );
    let mut corners = Vec::new();
    for j in 0..rows {
        for i in 0..columns {
            let a = j * (columns + 1) + i;
            let (b, c, d) = (a + 1, a + columns + 2, a + columns + 1);
            corners.extend(if (i + j) % 2 == 0 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] });
        }
    }
    triangles(positions, corners)
}

/// An icosahedron, cut in four again and again, on a sphere about the origin; convex seen from outside.
pub fn sphere(radius_m: f64, cuts: u32) -> Mesh {
    let g = 0.5 + 1.25_f64.sqrt();
    let mut points: Vec<[f64; 3]> = Vec::new();
    for (a, b) in [(1.0, g), (-1.0, g), (1.0, -g), (-1.0, -g)] {
        points.extend([[0.0, a, b], [a, b, 0.0], [b, 0.0, a]]);
    }
    let distance = |p: [f64; 3], q: [f64; 3]| (0..3).map(|i| (p[i] - q[i]).powi(2)).sum::<f64>().sqrt();
    let mut corners: Vec<[u32; 3]> = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let [p, q, r] = [points[a], points[b], points[c]];
                if [(p, q), (q, r), (r, p)].iter().all(|&(s, t)| distance(s, t) < 2.1) {
                    let volume = p[0] * (q[1] * r[2] - q[2] * r[1])
                        + p[1] * (q[2] * r[0] - q[0] * r[2])
                        + p[2] * (q[0] * r[1] - q[1] * r[0]);
                    let [b, c] = if volume > 0.0 { [b, c] } else { [c, b] };
                    corners.push([a as u32, b as u32, c as u32]);
                }
            }
        }
    }
    for _ in 0..cuts {
        let mut middles = std::collections::HashMap::new();
        let mut finer = Vec::new();
        for [a, b, c] in corners {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q)| {
                *middles.entry((p.min(q), p.max(q))).or_insert_with(|| {
                    let (p, q) = (points[p as usize], points[q as usize]);
                    points.push([p[0] + q[0], p[1] + q[1], p[2] + q[2]].map(|c| 0.5 * c));
                    points.len() as u32 - 1
                })
            });
            finer.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        corners = finer;
    }
    let scaled = points.into_iter().map(|p| p.map(|c| c * radius_m / distance(p, [0.0; 3])));
    triangles(single(scaled), corners)
}

/// An open tube about Z, with vertices of their own on either side of its seam; convex seen from outside.
pub fn tube(radius_m: f64, length_m: f64, around: u32, along: u32) -> Mesh {
    sheet(around, along, |u, v| {
        // The last column lies exactly where the first does.
        let angle = TAU * (u % 1.0);
        [radius_m * angle.cos(), radius_m * angle.sin(), (v - 0.5) * length_m]
    })
}

/// A torus about Z, closed by two seams; convex seen from outside.
pub fn torus(large_m: f64, small_m: f64, around: u32, about: u32) -> Mesh {
    sheet(around, about, |u, v| {
        let (angle, tilt) = (TAU * (u % 1.0), TAU * (v % 1.0));
        let out = large_m + small_m * tilt.cos();
        [out * angle.cos(), out * angle.sin(), small_m * tilt.sin()]
    })
}

/// The mean curvature of a torus at a point of it.
pub fn torus_curvature(large_m: f64, small_m: f64, position: [f32; 3]) -> f64 {
    let [x, y, _] = position.map(f64::from);
    let out = x.hypot(y);
    let cosine = (out - large_m) / small_m;
    (large_m + 2.0 * small_m * cosine) / (2.0 * small_m * (large_m + small_m * cosine))
}

/// A mesh that is turned, scaled and moved.
pub fn placed(mesh: &Mesh, turn: glam::DQuat, scale: f64, moved: glam::DVec3) -> Mesh {
    let place = |p: &[f32; 3]| (turn * (scale * glam::DVec3::from(p.map(f64::from))) + moved).to_array();
    Mesh { positions: single(mesh.positions.iter().map(place)), ..mesh.clone() }
}
