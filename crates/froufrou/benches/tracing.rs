//! What it costs to ask for the paths between a source and a microphone.

use std::sync::Arc;

use divan::Bencher;
use froufrou::Result;
use froufrou::scene::animation::{Mesh, Topology, Transform};
use froufrou::scene::carrier::Carrier;
use froufrou::space::surroundings::{
    Body, End, Material, Paths, Settings, Shape, Sides, Surface, Surroundings,
};

fn main() {
    divan::main();
}

/// A ball of 2 × rows² triangles, 1 m in radius, that bends where it is said to.
struct Ball {
    mesh: Mesh,
    topology: Topology,
}

impl Ball {
    fn new(rows: u32, topology: Topology) -> Self {
        let mut mesh = Mesh::default();
        for i in 0..=rows {
            for k in 0..=rows {
                let (a, b) = (k as f32 / rows as f32, i as f32 / rows as f32);
                let ((sa, ca), (sb, cb)) =
                    ((a * std::f32::consts::TAU).sin_cos(), (b * std::f32::consts::PI).sin_cos());
                mesh.positions.push([-sb * ca, -cb, sb * sa]);
            }
        }
        for i in 0..rows {
            for k in 0..rows {
                let a = i * (rows + 1) + k;
                mesh.face_vertices.extend([a, a + 1, a + rows + 2, a + rows + 1]);
                mesh.face_sizes.push(4);
            }
        }
        Self { mesh, topology }
    }
}

impl Surface for Ball {
    fn topology(&self) -> Topology {
        self.topology
    }

    fn frame(&self, _: f64) -> Result<Transform> {
        Ok([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    }

    fn mesh(&self, _: f64, mesh: &mut Mesh) -> Result<()> {
        mesh.clone_from(&self.mesh);
        Ok(())
    }

    fn next_key_s(&self, _: f64) -> Option<f64> {
        None
    }

    fn name(&self) -> String {
        "ball".into()
    }
}

fn body(surface: impl Surface + 'static, shape: Shape, patches: usize, occludes: bool) -> Body {
    let material = Material::default();
    Body { surface: Arc::new(surface), shape, material, sides: Sides::Auto, patches, occludes, thing: None }
}

fn about(bodies: Vec<Body>) -> Surroundings {
    Surroundings::new(Settings::default(), bodies).expect("sound bodies")
}

fn ask(bencher: Bencher, mut surroundings: Surroundings, z: f64) {
    let end = |x: f64, z: f64| End { position_m: [x, 0.3, z], thing: None };
    let mut paths = Paths::default();
    bencher.bench_local(|| {
        surroundings.paths(0.0, end(-5.0, z), end(5.0, z), &mut paths).expect("paths");
        paths.direct
    });
}

const WALL: Shape = Shape::Rectangle { width_m: 8.0, height_m: 4.0 };

/// One reflection, nothing in the way: the integral over one patch.
#[divan::bench]
fn one_patch(bencher: Bencher) {
    ask(bencher, about(vec![body(Carrier::still([0.0; 3]), WALL, 8, false)]), -4.0);
}

/// The direct path, past a body that is not near it.
#[divan::bench]
fn nothing_in_the_way(bencher: Bencher) {
    ask(bencher, about(vec![body(Ball::new(100, Topology::Constant), Shape::Mesh, 0, true)]), 40.0);
}

/// The direct path, past a wall of two triangles that covers a part of it.
#[divan::bench]
fn behind_a_wall(bencher: Bencher) {
    let wall = body(Carrier::still([0.0, 2.0, 0.0]), Shape::Box { size_m: [1.0, 4.0, 4.0] }, 0, true);
    ask(bencher, about(vec![wall]), 0.0);
}

/// The direct path, through a mesh of so many triangles.
#[divan::bench(args = [1_000, 20_000, 200_000])]
fn behind_a_mesh(bencher: Bencher, triangles: u32) {
    let rows = f64::from(triangles / 2).sqrt() as u32;
    ask(bencher, about(vec![body(Ball::new(rows, Topology::Constant), Shape::Mesh, 0, true)]), 0.3);
}

/// Eight reflections of a mesh of so many triangles that also hides.
#[divan::bench(args = [1_000, 20_000])]
fn eight_patches(bencher: Bencher, triangles: u32) {
    let rows = f64::from(triangles / 2).sqrt() as u32;
    ask(bencher, about(vec![body(Ball::new(rows, Topology::Constant), Shape::Mesh, 8, true)]), 3.0);
}

/// A new time of a mesh that bends: it is read, measured and its tree refitted.
#[divan::bench(args = [1_000, 20_000])]
fn bending(bencher: Bencher, triangles: u32) {
    let rows = f64::from(triangles / 2).sqrt() as u32;
    let mut one = about(vec![body(Ball::new(rows, Topology::Homogeneous), Shape::Mesh, 8, true)]);
    let end = |x: f64| End { position_m: [x, 0.0, 40.0], thing: None };
    let (mut paths, mut time_s) = (Paths::default(), 0.0);
    bencher.bench_local(|| {
        time_s += 1e-3;
        one.paths(time_s, end(-1.0), end(1.0), &mut paths).expect("paths");
    });
}

/// Patches found, tree built.
#[divan::bench(args = [1_000, 20_000])]
fn taking_up(bencher: Bencher, triangles: u32) {
    let rows = f64::from(triangles / 2).sqrt() as u32;
    bencher
        .with_inputs(|| vec![body(Ball::new(rows, Topology::Constant), Shape::Mesh, 8, true)])
        .bench_local_values(about);
}
