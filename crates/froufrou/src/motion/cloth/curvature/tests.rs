use super::*;
use crate::motion::cloth::shapes;
use crate::scene::animation::Mesh;
use glam::DQuat;
use proptest::prelude::*;

fn measured(mesh: &Mesh) -> (Triangulation, Curvature) {
    let surface = Triangulation::new(mesh).expect("a sound mesh");
    let mut curvature = Curvature::default();
    curvature.measure(&surface, &mesh.positions);
    (surface, curvature)
}

fn worst(mesh: &Mesh, expected: impl Fn([f32; 3]) -> f64, scale: f64) -> f64 {
    let (surface, curvature) = measured(mesh);
    let all = curvature.mean_per_m().iter().zip(&mesh.positions).zip(surface.inner());
    all.filter(|(_, inner)| **inner)
        .map(|((found, position), _)| (found - expected(*position)).abs() / scale)
        .fold(0.0, f64::max)
}

#[test]
fn spheres_tubes_and_tori_are_met_within_a_percent() {
    let sphere = worst(&shapes::sphere(0.5, 4), |_| 2.0, 2.0);
    let tube = worst(&shapes::tube(0.2, 1.0, 96, 80), |_| 2.5, 2.5);
    let torus = |p| shapes::torus_curvature(1.0, 0.3, p);
    let torus = worst(&shapes::torus(1.0, 0.3, 192, 64), torus, 0.5 / 0.3);
    println!("worst relative errors: sphere {sphere:.1e}, tube {tube:.1e}, torus {torus:.1e}");
    assert!(sphere < 0.01 && tube < 0.01 && torus < 0.01, "{sphere} {tube} {torus}");
}

#[derive(serde::Deserialize)]
struct Golden {
    positions: Vec<[f32; 3]>,
    corners: Vec<[u32; 3]>,
    mean_per_m: Vec<f64>,
    area_m2: Vec<f64>,
}

/// Against libigl; written by `oracles/curvature_golden.py`.
#[test]
fn crumpled_meshes_are_bent_as_libigl_says() {
    let text = include_str!("../../../../tests/fixtures/cloth/curvature.json");
    let meshes: Vec<Golden> = serde_json::from_str(text).expect("golden numbers");
    assert_eq!(meshes.len(), 3);
    for Golden { positions, corners, mean_per_m, area_m2 } in meshes {
        let face_sizes = vec![3; corners.len()];
        let (_, ours) = measured(&Mesh { positions, face_vertices: corners.concat(), face_sizes });
        for (ours, theirs) in ours.mean_per_m().iter().zip(&mean_per_m) {
            assert!((ours - theirs).abs() < 1e-9 * (1.0 + theirs.abs()), "{ours} {theirs}");
        }
        for (ours, theirs) in ours.area_m2().iter().zip(&area_m2) {
            assert!((ours - theirs).abs() < 1e-12, "{ours} {theirs}");
        }
    }
}

#[test]
fn seen_from_inside_the_sign_is_the_other() {
    let mut inside = shapes::sphere(1.0, 2);
    inside.face_vertices.as_chunks_mut::<3>().0.iter_mut().for_each(|corners| corners.swap(0, 1));
    assert!(measured(&inside).1.mean_per_m().iter().all(|h| (h + 1.0).abs() < 0.02));
}

#[test]
fn areas_add_up_and_a_plane_is_flat() {
    let slanted = shapes::sheet(20, 15, |u, v| [u + 0.8 * v, 0.5 * v, 0.2 * u]);
    let (surface, curvature) = measured(&slanted);
    let area: f64 = curvature.area_m2().iter().sum();
    let expected = DVec3::new(1.0, 0.0, 0.2).cross(DVec3::new(0.8, 0.5, 0.0)).length();
    assert!((area - expected).abs() < 1e-6 * expected, "{area} {expected}");
    let most = curvature.mean_per_m().iter().fold(0.0f64, |most, h| most.max(h.abs()));
    assert!(most < 1e-4, "{most}: no more than single precision gives");
    assert_eq!(surface.inner().iter().filter(|i| **i).count(), 19 * 14);
}

#[test]
fn triangles_without_area_do_not_matter() {
    let mut mesh = shapes::sphere(1.0, 3);
    let before = measured(&mesh).1;
    // A triangle that is a line between three vertices in a row, and one that is far too thin.
    let from = mesh.positions.len() as u32;
    mesh.positions.extend([[2.0, 0.0, 0.0], [3.0, 0.0, 0.0], [4.0, 0.0, 0.0], [3.0, 1e-9, 0.0]]);
    mesh.face_vertices.extend([from, from + 1, from + 2, from, from + 2, from + 3]);
    mesh.face_sizes.extend([3, 3]);
    let (_, after) = measured(&mesh);
    assert_eq!(after.mean_per_m()[..from as usize], before.mean_per_m()[..]);
    assert!(after.mean_per_m()[from as usize..].iter().all(|h| *h == 0.0));
    assert!(after.area_m2().iter().all(|a| a.is_finite()));
}

#[test]
fn a_vertex_squeezed_to_nothing_has_no_curvature() {
    let mesh = shapes::sheet(8, 8, |_, _| [0.0; 3]);
    let (surface, mut curvature) = measured(&shapes::sheet(8, 8, |u, v| [u, v, 0.0]));
    curvature.measure(&surface, &mesh.positions);
    assert!(curvature.mean_per_m().iter().chain(curvature.area_m2()).all(|x| *x == 0.0));
}

#[test]
fn obtuse_triangles_keep_the_sign() {
    // Sheared so far that all triangles are obtuse, though cut along the shorter diagonal, and bent to a cylinder.
    let cells = 60u32;
    let bend = |u: f64, v: f64| [(u + 1.6 * v).cos(), (u + 1.6 * v).sin(), v];
    let corner = |i: u32, j: u32| j * (cells + 1) + i;
    let cell = |k: u32| {
        let (i, j) = (k % cells, k / cells);
        [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)]
    };
    let bent = Mesh {
        positions: shapes::sheet(cells, cells, bend).positions,
        face_vertices: (0..cells * cells).flat_map(cell).collect(),
        face_sizes: vec![4; (cells * cells) as usize],
    };
    let (surface, curvature) = measured(&bent);
    let inner = curvature.mean_per_m().iter().zip(surface.inner()).filter(|(_, inner)| **inner);
    let found: Vec<f64> = inner.map(|(h, _)| *h).collect();
    let (least, most) = found.iter().fold((f64::MAX, f64::MIN), |(a, b), h| (a.min(*h), b.max(*h)));
    println!("mean curvature from {least} to {most}, of 0.5");
    assert!(least > 0.25 && most < 1.0, "{least} to {most}");
}

proptest! {
    #[test]
    fn turning_moving_and_scaling_change_no_sign(
        turn in prop::array::uniform3(-3.0..3.0f64),
        moved in prop::array::uniform3(-2.0..2.0f64),
        scale in 0.01..100.0f64,
    ) {
        let mesh = shapes::torus(1.0, 0.4, 40, 20);
        let turn = DQuat::from_scaled_axis(DVec3::from(turn));
        let placed = shapes::placed(&mesh, turn, scale, scale * DVec3::from(moved));
        let (before, after) = (measured(&mesh).1, measured(&placed).1);
        for (a, b) in before.mean_per_m().iter().zip(after.mean_per_m()) {
            prop_assert!((a - b * scale).abs() < 1e-3 * (1.0 + a.abs()), "{a} {}", b * scale);
        }
        for (a, b) in before.area_m2().iter().zip(after.area_m2()) {
            prop_assert!((a * scale * scale - b).abs() <= 1e-4 * b.abs() + 1e-12);
        }
    }
}
