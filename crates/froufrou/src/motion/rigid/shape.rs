//! The shape of a rigid body as far as it touches others: found from its mesh.
//!
//! A faceted ball is taken as the sphere it stands for, so that it rolls as one; a mesh whose faces look in three
//! directions at right angles and fill their box is that box; what is convex is its hull. Anything else stays a
//! triangle mesh, and is its hull only against another such.

use std::fmt;

use glam::{DMat3, DVec3};
use parry3d_f64::math::{Pose as ParryPose, Rotation, Vector};
use parry3d_f64::shape::{ConvexPolyhedron, Shape as _, SharedShape};

use super::pose::Pose;
use crate::{Error, Result};

/// A mesh is a sphere if its vertices are as far from its middle as each other, to this part of the radius, ...
const ROUND: f64 = 0.01;
/// ... no face comes nearer to the middle than this part, so that dice are no spheres, ...
const SHALLOW: f64 = 0.93;
/// ... and it has so many vertices.
const LEAST_ROUND: usize = 20;
/// A closed mesh that fills this part of its hull is taken as convex.
const CONVEX: f64 = 0.99;

/// What kind of shape was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// A ball of this radius in metres.
    Sphere(f64),
    /// A box of these half lengths in metres.
    Box([f64; 3]),
    /// A convex hull.
    Hull,
    /// Triangles, such as a floor, a bowl or a landscape.
    Triangles,
}

/// The shape of a rigid body, about its centre of mass.
#[derive(Clone)]
pub struct Shape {
    kind: Kind,
    /// About the centre.
    exact: SharedShape,
    /// What stands for triangles against other triangles.
    hull: Option<SharedShape>,
    /// The centre of mass in the frame of the body.
    centre: DVec3,
    volume_m3: f64,
    /// The moments of inertia about the centre at a density of 1, in the frame of the body.
    inertia: DMat3,
    /// The greatest distance of any of its points from the centre.
    reach_m: f64,
}

impl fmt::Debug for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Shape")
            .field("kind", &self.kind)
            .field("centre", &self.centre)
            .field("volume_m3", &self.volume_m3)
            .finish_non_exhaustive()
    }
}

pub(super) fn vector(v: DVec3) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

pub(super) fn from_vector(v: Vector) -> DVec3 {
    DVec3::new(v.x, v.y, v.z)
}

pub(super) fn parry_pose(pose: &Pose) -> ParryPose {
    let [x, y, z, w] = pose.turn.to_array();
    ParryPose::from_parts(vector(pose.at), Rotation::from_xyzw(x, y, z, w))
}

impl Shape {
    /// A ball about the origin of its frame; the radius in metres, above 0.
    pub fn sphere(radius_m: f64) -> Self {
        let volume_m3 = 4.0 / 3.0 * std::f64::consts::PI * radius_m.powi(3);
        Self {
            kind: Kind::Sphere(radius_m),
            exact: SharedShape::ball(radius_m),
            hull: None,
            centre: DVec3::ZERO,
            volume_m3,
            inertia: DMat3::from_diagonal(DVec3::splat(0.4 * volume_m3 * radius_m * radius_m)),
            reach_m: radius_m,
        }
    }

    /// A box about the origin of its frame; its half lengths in metres, above 0.
    pub fn cuboid(half_m: [f64; 3]) -> Self {
        let [x, y, z] = half_m;
        let volume_m3 = 8.0 * x * y * z;
        let moments = DVec3::new(y * y + z * z, x * x + z * z, x * x + y * y) * (volume_m3 / 3.0);
        Self {
            kind: Kind::Box(half_m),
            exact: SharedShape::cuboid(x, y, z),
            hull: None,
            centre: DVec3::ZERO,
            volume_m3,
            inertia: DMat3::from_diagonal(moments),
            reach_m: DVec3::from(half_m).length(),
        }
    }

    /// A flat face about the origin of its frame, by its corners in metres.
    ///
    /// # Errors
    /// Corners that are no face.
    pub fn flat(corners: &[[f64; 3]]) -> Result<Self> {
        let positions: Vec<DVec3> = corners.iter().map(|corner| DVec3::from(*corner)).collect();
        let numbers: Vec<u32> = (0..corners.len() as u32).collect();
        Self::from_mesh(&positions, &numbers, &[corners.len() as u32])
    }

    /// The shape of a mesh in the frame of its body, in metres.
    ///
    /// # Errors
    /// A mesh without faces, with faces of vertices that are not there, with positions that are not numbers, or
    /// without any extent.
    pub(super) fn from_mesh(positions: &[DVec3], face_vertices: &[u32], face_sizes: &[u32]) -> Result<Self> {
        if let Some(index) = positions.iter().position(|p| !p.is_finite()) {
            return Err(Error::new(format!("vertex {index} of its mesh is at no finite place")));
        }
        let triangles = triangles(positions.len(), face_vertices, face_sizes)?;
        // What is of no face touches nothing, and of one place one vertex is enough.
        let (points, triangles) = welded(positions, &triangles);
        if triangles.is_empty() {
            return Err(Error::new("its mesh has no face with an area").help("leave it out of `bodies`"));
        }
        if let Some((centre, radius_m)) = as_sphere(&points, &triangles) {
            return Ok(Self { centre, ..Self::sphere(radius_m) });
        }
        let (volume_m3, centroid) = volume(&points, &triangles);
        let hull = hull(&points);
        let hull_volume = hull.as_ref().map_or(0.0, |(shape, _)| hull_volume(shape));
        let is_closed = volume_m3 > 1e-12 * extent(&points).powi(3) && is_closed(&triangles);
        let is_convex = is_closed && volume_m3 >= CONVEX * hull_volume;
        if is_convex && let Some((centre, half_m)) = as_box(&points, &triangles, volume_m3) {
            return Ok(Self { centre, ..Self::cuboid(half_m) });
        }
        let centre = if is_closed { centroid } else { middle(&points) };
        let about = |points: &[DVec3]| points.iter().map(|p| vector(*p - centre)).collect::<Vec<_>>();
        let reach_m = points.iter().map(|p| p.distance(centre)).fold(0.0, f64::max);
        let hull = hull.and_then(|(_, points)| SharedShape::convex_hull(&about(&points)));
        // Of an open mesh nobody can tell the mass; that of its hull is something like it.
        let volume_m3 = if is_closed { volume_m3 } else { hull_volume };
        let inertia = match &hull {
            Some(hull) => {
                let properties = hull.mass_properties(1.0);
                let matrix = properties.reconstruct_inertia_matrix();
                let columns = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(from_vector);
                let matrix = DMat3::from_cols(columns[0], columns[1], columns[2]);
                matrix * if hull_volume > 0.0 { volume_m3 / hull_volume } else { 1.0 }
            }
            None => DMat3::ZERO,
        };
        if is_convex && let Some(exact) = hull.clone() {
            return Ok(Self { kind: Kind::Hull, exact, hull: None, centre, volume_m3, inertia, reach_m });
        }
        let exact = SharedShape::trimesh(about(&points), triangles)
            .map_err(|fault| Error::new(format!("its mesh cannot be searched: {fault}")))?;
        Ok(Self { kind: Kind::Triangles, exact, hull, centre, volume_m3, inertia, reach_m })
    }

    /// What kind of shape it is.
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// In cubic metres; of a mesh with holes that of its hull.
    pub fn volume_m3(&self) -> f64 {
        self.volume_m3
    }

    /// The centre of mass in the frame of the body.
    pub(super) fn centre(&self) -> DVec3 {
        self.centre
    }

    /// The greatest distance of any of its points from the centre, in metres.
    pub(super) fn reach_m(&self) -> f64 {
        self.reach_m
    }

    /// The radius of a ball.
    pub(super) fn radius_m(&self) -> Option<f64> {
        match self.kind {
            Kind::Sphere(radius_m) => Some(radius_m),
            _ => None,
        }
    }

    /// The inverse of its moments of inertia at a mass, in its frame; 0 where it cannot be turned.
    pub(super) fn inverse_inertia(&self, mass_kg: f64) -> DMat3 {
        let inertia = self.inertia * (mass_kg / self.volume_m3);
        let inverse = inertia.inverse();
        if inverse.is_finite() { inverse } else { DMat3::ZERO }
    }

    /// The shape that is held against another.
    pub(super) fn against(&self, other: &Shape) -> &SharedShape {
        match &self.hull {
            Some(hull) if other.hull.is_some() && self.volume_m3 <= other.volume_m3 => hull,
            _ => &self.exact,
        }
    }

    /// True where it has no few corners: it may roll.
    pub(super) fn is_round(&self) -> bool {
        match self.kind {
            Kind::Sphere(_) => true,
            Kind::Box(_) | Kind::Triangles => false,
            Kind::Hull => {
                self.exact.as_convex_polyhedron().is_some_and(|hull| hull.points().len() >= LEAST_ROUND)
            }
        }
    }

    /// A box that holds it, given where its centre is; the least one, but for hulls of many corners.
    pub(super) fn bounds(&self, pose: &Pose) -> [DVec3; 2] {
        if self.kind == Kind::Hull {
            return [pose.at - self.reach_m, pose.at + self.reach_m];
        }
        let bounds = self.exact.compute_aabb(&parry_pose(pose));
        [from_vector(bounds.mins), from_vector(bounds.maxs)]
    }
}

/// Cuts faces into triangles.
fn triangles(count: usize, face_vertices: &[u32], face_sizes: &[u32]) -> Result<Vec<[u32; 3]>> {
    let mut triangles = Vec::new();
    let mut rest = face_vertices;
    for (face, &size) in face_sizes.iter().enumerate() {
        let Some((corners, behind)) = rest.split_at_checked(size as usize) else {
            return Err(Error::new(format!("face {face} of its mesh has fewer vertices than it says")));
        };
        if let Some(vertex) = corners.iter().find(|&&vertex| vertex as usize >= count) {
            let what = format!("face {face} of its mesh has a vertex {vertex}, and there are {count}");
            return Err(Error::new(what).help("they are counted from 0"));
        }
        triangles.extend(corners.windows(2).skip(1).map(|two| [corners[0], two[0], two[1]]));
        rest = behind;
    }
    Ok(triangles)
}

/// Makes one of all vertices of one place, and leaves out triangles without an area.
fn welded(positions: &[DVec3], triangles: &[[u32; 3]]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let grain = 1e-6 * extent(positions).max(1e-9);
    let place = |p: DVec3| (p / grain).round().to_array().map(|c| c as i64);
    let mut numbers = std::collections::HashMap::new();
    let mut points = Vec::new();
    let mut kept = Vec::new();
    for triangle in triangles {
        let [a, b, c] = triangle.map(|vertex| positions[vertex as usize]);
        if (b - a).cross(c - a).length() <= 2.0 * grain * grain {
            continue;
        }
        kept.push(triangle.map(|vertex| {
            let position = positions[vertex as usize];
            *numbers.entry(place(position)).or_insert_with(|| {
                points.push(position);
                points.len() as u32 - 1
            })
        }));
    }
    (points, kept)
}

fn middle(points: &[DVec3]) -> DVec3 {
    let low = points.iter().fold(DVec3::INFINITY, |low, p| low.min(*p));
    let high = points.iter().fold(DVec3::NEG_INFINITY, |high, p| high.max(*p));
    0.5 * (low + high)
}

fn extent(points: &[DVec3]) -> f64 {
    let low = points.iter().fold(DVec3::INFINITY, |low, p| low.min(*p));
    let high = points.iter().fold(DVec3::NEG_INFINITY, |high, p| high.max(*p));
    if points.is_empty() { 0.0 } else { (high - low).max_element() }
}

/// The centre and radius of the ball that a mesh stands for.
fn as_sphere(points: &[DVec3], triangles: &[[u32; 3]]) -> Option<(DVec3, f64)> {
    if points.len() < LEAST_ROUND || !is_closed(triangles) {
        return None;
    }
    let centre = middle(points);
    let radius_m = points.iter().map(|p| p.distance(centre)).sum::<f64>() / points.len() as f64;
    let round = points.iter().all(|p| (p.distance(centre) - radius_m).abs() <= ROUND * radius_m);
    let shallow = triangles.iter().all(|t| {
        let [a, b, c] = t.map(|vertex| points[vertex as usize] - centre);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        normal.dot(a).abs() >= SHALLOW * radius_m
    });
    (round && shallow).then_some((centre, radius_m))
}

/// The centre and half lengths of the box that a convex mesh is, if it lies along the axes of its frame.
fn as_box(points: &[DVec3], triangles: &[[u32; 3]], volume_m3: f64) -> Option<(DVec3, [f64; 3])> {
    let along = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|vertex| points[vertex as usize]);
        (b - a).cross(c - a).normalize_or_zero().abs().max_element() > 1.0 - 1e-6
    };
    let centre = middle(points);
    let half = points.iter().fold(DVec3::ZERO, |half, p| half.max((*p - centre).abs()));
    let filled = (8.0 * half.element_product() - volume_m3).abs() <= 1e-3 * volume_m3;
    (triangles.iter().all(along) && filled).then_some((centre, half.to_array()))
}

/// True where every edge is of two triangles that go along it in opposite directions.
fn is_closed(triangles: &[[u32; 3]]) -> bool {
    let mut edges = std::collections::HashMap::new();
    for t in triangles {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            *edges.entry((a.min(b), a.max(b))).or_insert(0i32) += if a < b { 1 } else { -1 };
        }
    }
    edges.values().all(|&balance| balance == 0)
}

/// The volume within closed triangles and its centre of mass.
fn volume(points: &[DVec3], triangles: &[[u32; 3]]) -> (f64, DVec3) {
    let origin = middle(points);
    let (mut volume, mut moment) = (0.0, DVec3::ZERO);
    for t in triangles {
        let [a, b, c] = t.map(|vertex| points[vertex as usize] - origin);
        let part = a.dot(b.cross(c)) / 6.0;
        volume += part;
        moment += part * (a + b + c) / 4.0;
    }
    // Turned inside out it is the same body.
    (volume.abs(), if volume == 0.0 { origin } else { origin + moment / volume })
}

/// The convex hull, with its corners; nothing where all lies in a plane.
fn hull(points: &[DVec3]) -> Option<(ConvexPolyhedron, Vec<DVec3>)> {
    let origin = middle(points);
    let size = extent(points);
    let spread = points.iter().map(|p| p.distance(origin)).fold(0.0, f64::max);
    // Flatness is asked for first: the search for a hull is not made for it.
    let far = *points.iter().max_by(|a, b| a.distance(origin).total_cmp(&b.distance(origin)))?;
    let line = (far - origin).try_normalize()?;
    let off = |p: &DVec3| (*p - origin).reject_from_normalized(line);
    let wide = points.iter().max_by(|a, b| off(a).length().total_cmp(&off(b).length()))?;
    let normal = line.cross(off(wide).try_normalize()?);
    let thick = points.iter().map(|p| (*p - far).dot(normal).abs()).fold(0.0, f64::max);
    if thick < 1e-6 * size || spread <= 0.0 {
        return None;
    }
    let vectors: Vec<Vector> = points.iter().map(|p| vector(*p)).collect();
    let (corners, _) = parry3d_f64::transformation::try_convex_hull(&vectors).ok()?;
    let shape = ConvexPolyhedron::from_convex_hull(&corners)?;
    Some((shape, corners.into_iter().map(from_vector).collect()))
}

fn hull_volume(shape: &ConvexPolyhedron) -> f64 {
    shape.mass_properties(1.0).mass()
}
