//! Sound traced past the simulated test animations: whatever they hold, paths stay finite and move smoothly.
//!
//! They are sought as in `alembic_data.rs`, and what is missing is skipped aloud.

mod data;

use std::sync::Arc;

use data::data;
use froufrou::Result;
use froufrou::scene::animation::{Animation, Mesh, ObjectKind, Topology, Transform};
use froufrou::scene::world::open_animation;
use froufrou::space::surroundings::{
    Body, End, Material, Paths, Settings, Shape, Sides, Surface, Surroundings,
};

struct Object {
    animation: Arc<dyn Animation>,
    object: usize,
}

impl Surface for Object {
    fn topology(&self) -> Topology {
        self.animation.objects()[self.object].topology
    }

    fn frame(&self, time_s: f64) -> Result<Transform> {
        self.animation.transform(self.object, time_s)
    }

    fn mesh(&self, time_s: f64, mesh: &mut Mesh) -> Result<()> {
        self.animation.mesh(self.object, time_s, mesh)
    }

    fn next_key_s(&self, time_s: f64) -> Option<f64> {
        let times = &self.animation.objects()[self.object].key_times;
        (0..times.len()).filter_map(|i| times.get(i)).find(|&t| t > time_s)
    }

    fn name(&self) -> String {
        self.animation.objects()[self.object].path.clone()
    }
}

fn trace(name: &str) {
    let Some(path) = data(&format!("anim/{name}.abc")) else { return };
    let animation = open_animation(&path).expect("a sound archive");
    let objects = animation.objects();
    let meshes: Vec<usize> = (0..objects.len()).filter(|&i| objects[i].kind == ObjectKind::Mesh).collect();
    let kinds: Vec<Topology> = meshes.iter().map(|&i| objects[i].topology).collect();
    let bodies = meshes.iter().map(|&object| Body {
        surface: Arc::new(Object { animation: Arc::clone(&animation), object }),
        shape: Shape::Mesh,
        material: Material::default(),
        sides: Sides::Auto,
        patches: 8,
        occludes: true,
        thing: None,
    });
    let mut about = Surroundings::new(Settings::default(), bodies.collect()).expect("sound meshes");
    assert!(about.patches() > 0);
    let end = |position_m| End { position_m, thing: None };
    // The middle of the first mesh, and a path that goes through it from side to side.
    let mut mesh = Mesh::default();
    let first_s = objects[meshes[0]].key_times.get(0).unwrap_or(0.0);
    animation.mesh(meshes[0], first_s, &mut mesh).expect("a mesh");
    let count = mesh.positions.len() as f64;
    let middle: [f64; 3] =
        std::array::from_fn(|i| mesh.positions.iter().map(|p| f64::from(p[i])).sum::<f64>() / count);
    let (from, to) = (
        [middle[0] - 2.0, middle[1] + 1.0, middle[2] - 0.5],
        [middle[0] + 2.5, middle[1] + 0.5, middle[2] + 1.0],
    );
    let (mut paths, mut last) = (Paths::default(), Paths::default());
    let (mut heard, mut hidden) = (0.0f64, 1.0f64);
    let (mut leap_m, mut step) = (0.0f64, 0.0f64);
    for tick in 0..240 {
        let time_s = first_s + f64::from(tick) * 0.005;
        about.paths(time_s, end(from), end(to), &mut paths).expect("paths");
        assert!((0.0..=1.0).contains(&paths.direct));
        hidden = hidden.min(paths.direct);
        for bounce in &paths.bounces {
            assert!(bounce.gain.is_finite() && bounce.gain >= 0.0 && bounce.length_m.is_finite());
            heard = heard.max(bounce.gain);
        }
        if tick > 0 {
            step = step.max((20.0 * (paths.direct / last.direct).log10()).abs());
            for (a, b) in paths.bounces.iter().zip(&last.bounces) {
                leap_m = leap_m.max((a.length_m - b.length_m).abs());
            }
        }
        std::mem::swap(&mut paths, &mut last);
    }
    println!(
        "{name}: {} meshes {:?}, {} patches; loudest bounce {heard:.4}, direct least {hidden:.3}; in 5 ms at most {step:.2} dB and {leap_m:.4} m",
        meshes.len(),
        kinds[0],
        about.patches()
    );
    assert!(heard > 0.0, "something is reflected");
    assert!(hidden < 0.999, "something is hidden");
    // Nothing in them is nearly as fast as sound: 1.7 m in 5 ms.
    assert!(leap_m < 1.7, "{leap_m}");
}

#[test]
fn a_flag() {
    trace("flag");
}

#[test]
fn a_sheet() {
    trace("sheet");
}

#[test]
fn a_tower() {
    trace("tower");
}

#[test]
fn paper_that_is_turned() {
    trace("paper_flip");
}

#[test]
fn cloth_over_a_ball() {
    trace("cloth_over_sphere_120fps");
}
