//! The shape of a body: its triangles, the tree over them and the patches that ride on them.

use glam::{DAffine3, DVec3};

use super::cluster::{Face, cluster};
use super::patch::Patch;
use super::tree::Tree;
use crate::scene::animation::Mesh;

/// Edges whose directions are tried for the sides of a patch's rectangle.
const DIRECTIONS: usize = 48;

/// Triangles, a tree and patches, in one system of coordinates.
#[derive(Debug, Clone, Default)]
pub(crate) struct Form {
    points: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    /// The patch that each triangle belongs to.
    patch_of: Vec<u16>,
    /// Weights of the corners of each triangle, whose sum over a patch's corners points along its `half_u`.
    grips: Vec<[f64; 3]>,
    pub tree: Tree,
    pub patches: Vec<Patch>,
    pub closed: bool,
}

impl Form {
    /// A mesh, with `most` patches at most. Faces that are no polygons of its points are left out.
    pub fn new(mesh: &Mesh, most: usize) -> Self {
        let mut form = Self::raw(mesh);
        let faces = form.faces();
        let (patch_of, count) = cluster(&faces, most.min(usize::from(u16::MAX)));
        form.patch_of = patch_of;
        form.hold(vec![None; count]);
        // What is closed has as much area facing any way as the other.
        let whole: f64 = faces.iter().map(|f| f.area_m2).sum();
        let open: DVec3 = faces.iter().map(|f| f.normal_m2).sum();
        form.closed = open.length() < 1e-3 * whole;
        form
    }

    /// A mesh of other faces that goes on from another: each triangle belongs to the patch it is nearest to.
    pub fn following(mesh: &Mesh, before: &Self) -> Self {
        let mut form = Self::raw(mesh);
        let faces = form.faces();
        let size = faces.iter().map(|f| f.area_m2).sum::<f64>().sqrt();
        let normals: Vec<DVec3> =
            before.patches.iter().map(|p| p.half_u.cross(p.half_v).normalize_or_zero()).collect();
        form.patch_of = faces
            .iter()
            .map(|face| {
                let normal = face.normal_m2.normalize_or_zero();
                let apart = |patch: usize| {
                    let turned = normal.distance_squared(normals[patch]) * size * size;
                    turned + face.centre.distance_squared(before.patches[patch].centre)
                };
                let nearest = (0..normals.len()).min_by(|&a, &b| apart(a).total_cmp(&apart(b)));
                nearest.unwrap_or(0) as u16
            })
            .collect();
        form.hold(before.patches.iter().map(|patch| Some(patch.half_u)).collect());
        form.closed = before.closed;
        form
    }

    /// Takes up where the points of the same mesh are now; false where its faces are not the same.
    pub fn refit(&mut self, mesh: &Mesh) -> bool {
        if mesh.positions.len() != self.points.len() || !self.triangles.iter().copied().eq(triangles(mesh)) {
            return false;
        }
        for (point, position) in self.points.iter_mut().zip(&mesh.positions) {
            *point = DVec3::from(position.map(f64::from));
        }
        self.measure();
        let (points, triangles) = (&self.points, &self.triangles);
        self.tree.refit(|i| triangles[i].map(|p| points[p as usize]));
        true
    }

    /// Brings it into other coordinates.
    pub fn transform(&mut self, by: &DAffine3) {
        self.points.iter_mut().for_each(|point| *point = by.transform_point3(*point));
        self.measure();
        let (points, triangles) = (&self.points, &self.triangles);
        self.tree.refit(|i| triangles[i].map(|p| points[p as usize]));
    }

    pub fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.triangles[triangle].map(|p| self.points[p as usize])
    }

    pub fn patch_of(&self, triangle: usize) -> usize {
        usize::from(self.patch_of[triangle])
    }

    fn raw(mesh: &Mesh) -> Self {
        let points: Vec<DVec3> = mesh.positions.iter().map(|p| DVec3::from(p.map(f64::from))).collect();
        let triangles: Vec<[u32; 3]> = triangles(mesh).collect();
        let tree = Tree::build(triangles.len(), |i| triangles[i].map(|p| points[p as usize]));
        Self { points, triangles, tree, ..Self::default() }
    }

    /// The triangles as faces; what has corners that are no numbers has no area.
    fn faces(&self) -> Vec<Face> {
        (0..self.triangles.len()).map(|i| face(self.corners(i))).collect()
    }

    /// Finds how each patch's rectangle lies on its triangles: along a given direction, or so that the
    /// rectangle is the smallest.
    fn hold(&mut self, along: Vec<Option<DVec3>>) {
        self.grips = vec![[0.0; 3]; self.triangles.len()];
        let mut members: Vec<Vec<usize>> = vec![Vec::new(); along.len()];
        for (i, &patch) in self.patch_of.iter().enumerate() {
            let face = face(self.corners(i));
            if face.area_m2 > 0.0 {
                members[usize::from(patch)].push(i);
            }
        }
        for (members, along) in members.iter().zip(&along) {
            self.grip(members, *along);
        }
        self.patches = vec![Patch::NONE; along.len()];
        self.measure();
    }

    fn grip(&mut self, members: &[usize], along: Option<DVec3>) {
        let (mut area, mut centre, mut normal) = (0.0, DVec3::ZERO, DVec3::ZERO);
        for &i in members {
            let face = face(self.corners(i));
            area += face.area_m2;
            centre += face.centre * face.area_m2;
            normal += face.normal_m2;
        }
        let Some(normal) = normal.try_normalize() else { return };
        let centre = centre / area;
        let flat = |v: DVec3| (v - normal * v.dot(normal)).try_normalize();
        let along = along.and_then(flat).or_else(|| self.smallest(members, centre, normal));
        let along = along.unwrap_or_else(|| normal.any_orthonormal_vector());
        let across = normal.cross(along);
        // Weights a w·(x − c) of all corners x, with w such that Σ a (w·(x − c)) (x − c) is `along`.
        let (mut uu, mut uv, mut vv) = (0.0, 0.0, 0.0);
        for &i in members {
            let weight = face(self.corners(i)).area_m2;
            for corner in self.corners(i) {
                let (u, v) = ((corner - centre).dot(along), (corner - centre).dot(across));
                uu += weight * u * u;
                uv += weight * u * v;
                vv += weight * v * v;
            }
        }
        let determinant = uu * vv - uv * uv;
        let spans = determinant > 0.0;
        if !spans {
            return;
        }
        let w = (along * vv - across * uv) / determinant;
        for &i in members {
            let weight = face(self.corners(i)).area_m2;
            self.grips[i] = self.corners(i).map(|corner| weight * w.dot(corner - centre));
        }
    }

    /// The direction of an edge along which the rectangle about some triangles is smallest.
    fn smallest(&self, members: &[usize], centre: DVec3, normal: DVec3) -> Option<DVec3> {
        let step = (3 * members.len()).div_ceil(DIRECTIONS).max(1);
        let edges = members.iter().flat_map(|&i| {
            let [a, b, c] = self.corners(i);
            [b - a, c - b, a - c]
        });
        let mut best = (f64::INFINITY, None);
        for edge in edges.step_by(step) {
            let Some(u) = (edge - normal * edge.dot(normal)).try_normalize() else { continue };
            let v = normal.cross(u);
            let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
            for corner in members.iter().flat_map(|&i| self.corners(i)) {
                for (n, axis) in [u, v].into_iter().enumerate() {
                    let at = (corner - centre).dot(axis);
                    low[n] = low[n].min(at);
                    high[n] = high[n].max(at);
                }
            }
            let area = (high[0] - low[0]) * (high[1] - low[1]);
            // Edges of equal sides differ in the last bits: the first of them stands.
            if area < best.0 * (1.0 - 1e-6) {
                best = (area, Some(u));
            }
        }
        best.1
    }

    /// Fits the rectangles to where the triangles are: the vector area, the centre and the second moments of
    /// a patch are those of its rectangle.
    fn measure(&mut self) {
        #[derive(Clone, Default)]
        struct Sums {
            area: f64,
            normal: DVec3,
            centre: DVec3,
            along: DVec3,
            grip: f64,
            moments: [f64; 2],
        }
        let mut all = vec![Sums::default(); self.patches.len()];
        for i in 0..self.triangles.len() {
            let corners = self.corners(i);
            let face = face(corners);
            let Some(sums) = all.get_mut(self.patch_of(i)).filter(|_| face.area_m2 > 0.0) else { continue };
            sums.area += face.area_m2;
            sums.normal += face.normal_m2;
            sums.centre += face.centre * face.area_m2;
            for (corner, grip) in corners.into_iter().zip(self.grips[i]) {
                sums.along += corner * grip;
                sums.grip += grip;
            }
        }
        let mut axes = Vec::with_capacity(all.len());
        for sums in &mut all {
            sums.centre /= if sums.area > 0.0 { sums.area } else { 1.0 };
            let normal = sums.normal.normalize_or_zero();
            let along = sums.along - sums.centre * sums.grip;
            let along = (along - normal * along.dot(normal)).normalize_or_zero();
            axes.push([along, normal.cross(along)]);
        }
        for i in 0..self.triangles.len() {
            let corners = self.corners(i);
            let area = face(corners).area_m2;
            let patch = self.patch_of(i);
            let Some(sums) = all.get_mut(patch).filter(|_| area > 0.0) else { continue };
            let centre = sums.centre;
            for (moment, axis) in sums.moments.iter_mut().zip(axes[patch]) {
                let [a, b, c] = corners.map(|corner| (corner - centre).dot(axis));
                // ∫ x² over a triangle.
                *moment += area / 6.0 * (a * a + b * b + c * c + a * b + b * c + c * a);
            }
        }
        for ((patch, sums), [along, across]) in self.patches.iter_mut().zip(&all).zip(axes) {
            let flat = sums.normal.length();
            let [u, v] = sums.moments.map(|m| (3.0 * m / sums.area.max(f64::MIN_POSITIVE)).sqrt());
            if !(u > 0.0 && v > 0.0 && flat > 0.0) {
                *patch = Patch { centre: sums.centre, ..Patch::NONE };
                continue;
            }
            let scale = (flat / (4.0 * u * v)).sqrt();
            // Normals about a mean, their resultant R: those of a von Mises–Fisher distribution of
            // concentration R (3 − R²) / (1 − R²). A mirrored ray strays by twice the angle of a normal.
            let resultant = (flat / sums.area).min(1.0);
            let square = resultant * resultant;
            // Rounding of positions alone bends nothing.
            let bends = resultant < 1.0 - 1e-6;
            let bend = if bends { 4.0 * (1.0 - square) / (resultant * (3.0 - square)) } else { 0.0 };
            *patch =
                Patch { centre: sums.centre, half_u: along * u * scale, half_v: across * v * scale, bend };
        }
    }
}

fn face([a, b, c]: [DVec3; 3]) -> Face {
    let normal_m2 = 0.5 * (b - a).cross(c - a);
    let (centre, area_m2) = ((a + b + c) / 3.0, normal_m2.length());
    if area_m2.is_finite() && centre.is_finite() {
        Face { centre, normal_m2, area_m2 }
    } else {
        Face { centre: DVec3::ZERO, normal_m2: DVec3::ZERO, area_m2: 0.0 }
    }
}

/// The faces of a mesh as fans of triangles; those with points that are not there are left out.
fn triangles(mesh: &Mesh) -> impl Iterator<Item = [u32; 3]> + '_ {
    let mut rest = &mesh.face_vertices[..];
    let faces = mesh.face_sizes.iter().map(move |&size| {
        let (face, after) = rest.split_at(rest.len().min(size as usize));
        rest = after;
        face
    });
    let fan = |face: &[u32]| {
        let first = face.first().copied().unwrap_or(0);
        face.windows(2).skip(1).map(|pair| [first, pair[0], pair[1]]).collect::<Vec<_>>()
    };
    let there = |t: &[u32; 3]| t.iter().all(|&p| (p as usize) < mesh.positions.len());
    faces.flat_map(fan).filter(there)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::space::surroundings::meshes;

    #[test]
    fn a_wall_is_one_patch_however_it_is_cut() {
        for (columns, rows) in [(1, 1), (7, 3), (60, 40)] {
            let form = Form::new(&meshes::wall(6.0, 2.5, columns, rows), 8);
            assert_eq!(form.patches.len(), 1, "{columns} × {rows}");
            let patch = form.patches[0];
            let (u, v) = (patch.half_u.length(), patch.half_v.length());
            assert!((u.max(v) - 3.0).abs() < 1e-5 && (u.min(v) - 1.25).abs() < 1e-5, "{patch:?}");
            assert!(patch.half_u.cross(patch.half_v).normalize().distance(DVec3::Z) < 1e-5);
            assert!(patch.bend < 1e-5 && patch.centre.length() < 1e-5 && !form.closed);
        }
    }

    #[test]
    fn a_box_has_its_six_sides() {
        for cuts in [1, 5] {
            let form = Form::new(&meshes::cuboid([2.0, 3.0, 4.0], cuts), 8);
            assert_eq!(form.patches.len(), 6);
            assert!(form.closed);
            let mut areas: Vec<f64> = form.patches.iter().map(Patch::area_m2).collect();
            areas.iter_mut().for_each(|a| *a = (*a * 1e4).round() / 1e4);
            assert_eq!(areas, [12.0, 12.0, 8.0, 8.0, 6.0, 6.0]);
            for patch in &form.patches {
                let outward = patch.half_u.cross(patch.half_v);
                assert!(outward.dot(patch.centre) > 0.0);
            }
        }
    }

    #[test]
    fn a_ball_has_patches_all_around_that_scatter() {
        let form = Form::new(&meshes::ball(1.0, 24), 8);
        assert_eq!(form.patches.len(), 8);
        assert!(form.closed);
        let sum: DVec3 = form.patches.iter().map(|p| p.half_u.cross(p.half_v)).sum();
        assert!(sum.length() < 1e-4, "its vector areas cancel: {sum}");
        assert!(form.patches.iter().all(|p| p.bend > 0.2 && p.area_m2() > 0.3), "{:?}", form.patches);
    }

    #[test]
    fn patches_ride_on_a_mesh_that_turns_and_bends() {
        let mut mesh = meshes::wall(4.0, 2.0, 10, 6);
        let mut form = Form::new(&mesh, 8);
        let rest = form.patches[0];
        let still = mesh.positions.clone();
        let mut last = rest;
        for step in 1..=400 {
            let turn = DAffine3::from_rotation_y(0.02 * f64::from(step));
            let by = DAffine3::from_translation(DVec3::Y) * turn;
            for (p, q) in mesh.positions.iter_mut().zip(&still) {
                *p = by.transform_point3(DVec3::from(q.map(f64::from))).as_vec3().into();
            }
            assert!(form.refit(&mesh));
            let (now, expected) = (form.patches[0], rest.posed(&by));
            assert!(now.centre.distance(expected.centre) < 1e-5);
            assert!(
                now.half_u.distance(expected.half_u) < 1e-4 && now.half_v.distance(expected.half_v) < 1e-4
            );
            assert!(now.half_u.distance(last.half_u) < 0.06, "no jump");
            last = now;
        }
        mesh.face_sizes.pop();
        assert!(!form.refit(&mesh), "another mesh");
    }

    #[test]
    fn odd_meshes_are_ordinary() {
        let mut odd = vec![Mesh::default()];
        let mut broken = meshes::ball(1.0, 8);
        broken.positions[3] = [f32::NAN; 3];
        broken.positions[5] = [f32::INFINITY, 0.0, 0.0];
        broken.face_vertices[7] = 4_000_000;
        broken.face_sizes[2] = u32::MAX;
        odd.push(broken);
        let mut flat = meshes::wall(1.0, 1.0, 2, 2);
        flat.positions.iter_mut().for_each(|p| *p = [1.0; 3]);
        odd.push(flat.clone());
        flat.face_sizes = vec![0, 1, 2, 500];
        odd.push(flat);
        for mesh in &odd {
            let mut form = Form::new(mesh, 8);
            assert!(form.refit(mesh));
            let after = Form::following(&meshes::ball(2.0, 6), &form);
            for patch in form.patches.iter().chain(&after.patches) {
                assert!(patch.centre.is_finite() && patch.area_m2().is_finite() && patch.bend >= 0.0);
            }
            assert_eq!(Form::following(mesh, &after).patches.len(), after.patches.len());
        }
    }
}
