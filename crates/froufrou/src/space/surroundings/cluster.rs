//! Which faces of a mesh make one patch.
//!
//! Faces in one plane belong together, so that a wall is one patch however finely it is cut. The
//! rest is halved where it is least flat, by 2-means over places and normals, until all is nearly flat
//! or there are enough patches. No random numbers are drawn: one mesh has one clustering.

use glam::DVec3;

/// A face, or several in one plane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Face {
    pub centre: DVec3,
    /// Its area times its unit normal.
    pub normal_m2: DVec3,
    pub area_m2: f64,
}

/// Planes that are sought at most; a mesh with more is no set of walls.
const PLANES: usize = 64;

/// A part of the surface is flat enough when its unevenness is this part of the whole.
const FLAT: f64 = 0.01;

/// Passes of 2-means; few are needed, and where it stands is good enough.
const PASSES: usize = 12;

/// The cluster of each face, numbered from 0, and how many there are: `most` at most, and 1 at least.
pub(crate) fn cluster(faces: &[Face], most: usize) -> (Vec<u16>, usize) {
    let whole: f64 = faces.iter().map(|f| f.area_m2).sum();
    let size = whole.sqrt();
    let (plane_of, planes) = match coplanar(faces, size) {
        Some(found) => found,
        None => ((0..faces.len()).collect(), faces.to_vec()),
    };
    let mut clusters: Vec<Vec<usize>> = vec![(0..planes.len()).collect()];
    let mut costs = vec![unevenness(&planes, &clusters[0])];
    while clusters.len() < most.max(1) {
        let mut worst = 0;
        for (i, &cost) in costs.iter().enumerate() {
            if cost > costs[worst] {
                worst = i;
            }
        }
        if costs[worst] <= FLAT * whole {
            break;
        }
        let Some((a, b)) = halves(&planes, &clusters[worst], size) else {
            costs[worst] = 0.0;
            continue;
        };
        costs[worst] = unevenness(&planes, &a);
        costs.push(unevenness(&planes, &b));
        clusters[worst] = a;
        clusters.push(b);
    }
    let area = |cluster: &[usize]| cluster.iter().map(|&i| planes[i].area_m2).sum::<f64>();
    clusters.sort_by(|a, b| area(b).total_cmp(&area(a)));
    let mut of_plane = vec![0u16; planes.len()];
    for (number, cluster) in clusters.iter().enumerate() {
        cluster.iter().for_each(|&i| of_plane[i] = number as u16);
    }
    (plane_of.into_iter().map(|plane| of_plane[plane]).collect(), clusters.len())
}

/// The plane of each face and what lies in it, where there are few.
fn coplanar(faces: &[Face], size: f64) -> Option<(Vec<usize>, Vec<Face>)> {
    let mut planes: Vec<Face> = Vec::new();
    let mut plane_of = Vec::with_capacity(faces.len());
    for face in faces {
        let normal = face.normal_m2.normalize_or_zero();
        let same = |plane: &Face| {
            let of_plane = plane.normal_m2.normalize_or_zero();
            normal.dot(of_plane) > 0.9999 && of_plane.dot(face.centre - plane.centre).abs() < 1e-3 * size
        };
        // A face without area lies in any plane.
        let found = planes.iter().position(|plane| face.area_m2 == 0.0 || same(plane));
        if let Some(found) = found {
            let plane = &mut planes[found];
            let area = plane.area_m2 + face.area_m2;
            if area > 0.0 {
                plane.centre = plane.centre.lerp(face.centre, face.area_m2 / area);
            }
            plane.normal_m2 += face.normal_m2;
            plane.area_m2 = area;
        } else if planes.len() == PLANES {
            return None;
        } else {
            planes.push(*face);
        }
        plane_of.push(found.unwrap_or(planes.len() - 1));
    }
    Some((plane_of, planes))
}

/// How far a cluster is from a flat patch, in square metres: by what its normals differ and by how
/// far it lies outside one plane.
fn unevenness(faces: &[Face], cluster: &[usize]) -> f64 {
    let (mut area, mut normal, mut centre) = (0.0, DVec3::ZERO, DVec3::ZERO);
    for &i in cluster {
        area += faces[i].area_m2;
        normal += faces[i].normal_m2;
        centre += faces[i].centre * faces[i].area_m2;
    }
    if area <= 0.0 {
        return 0.0;
    }
    centre /= area;
    let away = normal.normalize_or_zero();
    let variance: f64 =
        cluster.iter().map(|&i| faces[i].area_m2 * away.dot(faces[i].centre - centre).powi(2)).sum();
    (area - normal.length()) + area.sqrt() * (variance / area).sqrt()
}

/// Two halves of a cluster, by 2-means from a pair far apart.
fn halves(faces: &[Face], cluster: &[usize], size: f64) -> Option<(Vec<usize>, Vec<usize>)> {
    let place = |i: usize| [faces[i].centre, faces[i].normal_m2.normalize_or_zero() * size];
    let apart = |a: [DVec3; 2], b: [DVec3; 2]| a[0].distance_squared(b[0]) + a[1].distance_squared(b[1]);
    let farthest = |from: [DVec3; 2]| {
        let mut best = (0.0, None);
        for &i in cluster.iter().filter(|&&i| faces[i].area_m2 > 0.0) {
            let d = apart(from, place(i));
            if d > best.0 {
                best = (d, Some(place(i)));
            }
        }
        best.1
    };
    let mean = |of: &[usize]| {
        let (mut sum, mut area) = ([DVec3::ZERO; 2], 0.0);
        for &i in of {
            let weight = faces[i].area_m2;
            let at = place(i);
            sum = [sum[0] + at[0] * weight, sum[1] + at[1] * weight];
            area += weight;
        }
        (area > 0.0).then(|| sum.map(|s| s / area))
    };
    let first = farthest(mean(cluster)?)?;
    let mut means = [first, farthest(first)?];
    let mut parts = (Vec::new(), Vec::new());
    for _ in 0..PASSES {
        let nearer_first = |&i: &usize| apart(place(i), means[0]) <= apart(place(i), means[1]);
        let now: (Vec<usize>, Vec<usize>) = cluster.iter().copied().partition(nearer_first);
        let (Some(a), Some(b)) = (mean(&now.0), mean(&now.1)) else { break };
        means = [a, b];
        let stands = now == parts;
        parts = now;
        if stands {
            break;
        }
    }
    (!parts.0.is_empty() && !parts.1.is_empty()).then_some(parts)
}
