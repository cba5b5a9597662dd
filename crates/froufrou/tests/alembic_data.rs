//! The simulated test animations against samples of what the C++ library reads from them, kept in
//! `fixtures/alembic/data` (written by `oracles/alembic_golden.py`).
//!
//! The animations themselves are not in the repository. Every vertex of every frame is compared by `oracles/alembic_compare.py`.

mod data;

use std::path::{Path, PathBuf};

use data::data;

use froufrou::scene::alembic::Alembic;
use froufrou::scene::animation::{Animation, Mesh, ObjectKind, Topology};
use serde::Deserialize;

const TOLERANCE: f64 = 1e-6;

#[derive(Deserialize)]
struct Golden {
    paths: Vec<String>,
    key_times: Vec<usize>,
    /// Object, time, three rows of its matrix.
    transforms: Vec<(usize, f64, [f64; 12])>,
    /// Object, time, vertex, position.
    vertices: Vec<(usize, f64, usize, [f64; 3])>,
    /// Object, time, number of vertices, sum of their positions.
    sums: Vec<(usize, f64, usize, [f64; 3])>,
}

/// The test animation of a name, where the data are.
fn archive(name: &str) -> Option<PathBuf> {
    data(&format!("anim/{name}.abc"))
}

fn compare(name: &str) {
    let Some(path) = archive(name) else { return };
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/alembic/data");
    let text = std::fs::read_to_string(folder.join(name).with_extension("json")).expect("golden numbers");
    let golden: Golden = serde_json::from_str(&text).expect("golden numbers");
    let animation = Alembic::open(&path).expect("a sound archive");
    let objects = animation.objects();
    assert_eq!(
        objects.iter().map(|object| &object.path).collect::<Vec<_>>(),
        golden.paths.iter().collect::<Vec<_>>()
    );
    assert_eq!(objects.iter().map(|object| object.key_times.len()).collect::<Vec<_>>(), golden.key_times);

    let mut mesh = Mesh::default();
    let mut worst = [0.0_f64; 3];
    for &(object, time_s, expected) in &golden.transforms {
        let found = animation.transform(object, time_s).expect("a sound sample");
        for (found, expected) in found.as_flattened().iter().zip(expected) {
            assert!((found - expected).abs() < 1e-9, "{} at {time_s}", golden.paths[object]);
            worst[0] = worst[0].max((found - expected).abs());
        }
    }
    for &(object, time_s, vertex, expected) in &golden.vertices {
        animation.mesh(object, time_s, &mut mesh).expect("a sound sample");
        for (found, expected) in mesh.positions[vertex].into_iter().zip(expected) {
            let difference = (f64::from(found) - expected).abs();
            assert!(difference < TOLERANCE, "{} vertex {vertex} at {time_s}", golden.paths[object]);
            worst[1] = worst[1].max(difference);
        }
    }
    for &(object, time_s, count, expected) in &golden.sums {
        animation.mesh(object, time_s, &mut mesh).expect("a sound sample");
        assert_eq!(mesh.positions.len(), count);
        for (axis, expected) in expected.into_iter().enumerate() {
            let sum: f64 = mesh.positions.iter().map(|position| f64::from(position[axis])).sum();
            let difference = (sum - expected).abs() / count as f64;
            assert!(difference < TOLERANCE, "{} centre at {time_s}", golden.paths[object]);
            worst[2] = worst[2].max(difference);
        }
    }
    let [matrix, vertex, centre] = worst;
    println!(
        "{name}: off by {matrix:.1e} in a matrix, {vertex:.1e} m in a vertex, {centre:.1e} m in a centre"
    );
}

macro_rules! golden {
    ($($name:ident),*) => { $(
        #[test]
        fn $name() {
            compare(stringify!($name));
        }
    )* };
}

golden!(cloth_over_sphere_120fps, flag, paper_flip, paper_slide, rumba_dress, sheet, tower);

/// What `froufrou info` would print of the tower.
#[test]
fn the_tower_is_ten_boxes_a_ball_and_what_they_stand_on() {
    let Some(path) = archive("tower") else { return };
    let animation = Alembic::open(path).expect("a sound archive");
    assert_eq!(animation.metadata("_ai_Application"), Some("Blender"));
    let mut boxes = 0;
    for (index, object) in animation.objects().iter().enumerate() {
        if object.kind == ObjectKind::Mesh && object.path.starts_with("/Box") {
            boxes += 1;
            assert_eq!(object.topology, Topology::Constant);
            assert!((object.key_times.rate_hz().expect("uniform") - 24.0).abs() < 1e-9);
            assert_eq!(object.key_times.len(), 120);
            let size = animation.mesh_size(index).expect("an object").expect("a mesh");
            assert_eq!((size.vertices, size.faces), (8, 6));
        }
    }
    assert_eq!(boxes, 10);
}

/// Floors face up and solids face outward, so that contacts have the side they should have.
#[test]
fn faces_are_counter_clockwise_from_outside() {
    for (name, ends, outward) in
        [("sheet", "/Floor/Plane", None), ("tower", "/Ground/Cube", Some([0.0, -0.1, 0.0]))]
    {
        let Some(path) = archive(name) else { return };
        let animation = Alembic::open(path).expect("a sound archive");
        let object =
            animation.objects().iter().position(|object| object.path.ends_with(ends)).expect("the object");
        let mut mesh = Mesh::default();
        animation.mesh(object, 0.0, &mut mesh).expect("a sound sample");
        let mut first = 0;
        for &size in &mesh.face_sizes {
            let corner = |i: usize| mesh.positions[mesh.face_vertices[first + i] as usize].map(f64::from);
            let [a, b, c] = [corner(0), corner(1), corner(2)];
            let (u, v) = ([0, 1, 2].map(|i| b[i] - a[i]), [0, 1, 2].map(|i| c[i] - a[i]));
            let normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            let away =
                outward.map_or([0.0, 1.0, 0.0], |centre: [f64; 3]| [0, 1, 2].map(|i| a[i] - centre[i]));
            assert!((0..3).map(|i| normal[i] * away[i]).sum::<f64>() > 0.0, "{name}{ends}: {normal:?}");
            first += size as usize;
        }
    }
}
