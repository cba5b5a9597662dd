//! What it costs to follow cloth: a sheet that waves above a bumpy floor.
//!
//! A vertex-frame is the unit: of curvature and buckles, of contacts with another mesh and with itself, and of the
//! whole analyser.

use divan::Bencher;
use divan::counter::ItemsCount;
use froufrou::motion::cloth::buckles::{BuckleSettings, Buckles};
use froufrou::motion::cloth::curvature::Curvature;
use froufrou::motion::cloth::proximity::{Proximity, Touchable};
use froufrou::motion::cloth::{Analyser, ClothSettings, Participant};
use froufrou::scene::animation::Mesh;

const FRAMES: usize = 8;
const SIZES: [usize; 3] = [33, 100, 200];

fn main() {
    divan::main();
}

/// A sheet of a square metre with so many vertices along each side.
fn sheet(side: usize, place: impl Fn(f32, f32) -> [f32; 3]) -> Mesh {
    let at = |index: usize| (index % side, index / side);
    let part = |index: usize| index as f32 / (side - 1) as f32;
    let positions = (0..side * side).map(at).map(|(i, j)| place(part(i), part(j))).collect();
    let cell = |index: usize| {
        let a = (index / (side - 1) * side + index % (side - 1)) as u32;
        let above = a + side as u32;
        [a, a + 1, above + 1, above]
    };
    let cells = (side - 1) * (side - 1);
    Mesh { positions, face_vertices: (0..cells).flat_map(cell).collect(), face_sizes: vec![4; cells] }
}

fn frames(side: usize) -> Vec<[Mesh; 2]> {
    let frame = |frame: usize| {
        let time = 0.3 * frame as f32;
        let cloth = sheet(side, |u, v| {
            [u + 0.01 * time, 0.03 + 0.02 * (20.0 * u + time).sin() * (17.0 * v).cos(), v]
        });
        [
            cloth,
            sheet(side, |u, v| [2.0 * u - 0.5, 0.01 * (30.0 * u).sin() * (25.0 * v).sin(), 2.0 * v - 0.5]),
        ]
    };
    (0..FRAMES).map(frame).collect()
}

fn count(side: usize) -> ItemsCount {
    ItemsCount::new(side * side * FRAMES)
}

#[divan::bench(args = SIZES)]
fn curvature(bencher: Bencher<'_, '_>, side: usize) {
    let frames = frames(side);
    let cloth = Touchable::new(&frames[0][0]).expect("a sound mesh");
    let mut curvature = Curvature::default();
    bencher.counter(count(side)).bench_local(|| {
        frames.iter().for_each(|[mesh, _]| curvature.measure(cloth.surface(), &mesh.positions));
    });
}

#[divan::bench(args = SIZES)]
fn curvature_and_buckles(bencher: Bencher<'_, '_>, side: usize) {
    let frames = frames(side);
    let cloth = Touchable::new(&frames[0][0]).expect("a sound mesh");
    let mut curvature = Curvature::default();
    bencher.counter(count(side)).bench_local(|| {
        let mut buckles = Buckles::new(BuckleSettings::default());
        let mut found = 0;
        for (frame, [mesh, _]) in frames.iter().enumerate() {
            curvature.measure(cloth.surface(), &mesh.positions);
            found += buckles.feed(frame as f64 / 60.0, cloth.surface(), &curvature, &mesh.positions).len();
        }
        found + buckles.finish().len()
    });
}

fn contacts(bencher: Bencher<'_, '_>, side: usize, surroundings_m: f64) {
    let frames = frames(side);
    let mut objects = frames[0].each_ref().map(|mesh| Touchable::new(mesh).expect("a sound mesh"));
    let mut proximity = Proximity::new(0, &objects[0], 0.05, surroundings_m);
    bencher.counter(count(side)).bench_local(|| {
        let mut found = 0;
        for meshes in &frames {
            for (object, mesh) in objects.iter_mut().zip(meshes) {
                object.follow(&mesh.positions).expect("as many vertices");
            }
            found += proximity.contacts(&objects).iter().flatten().count();
        }
        found
    });
}

#[divan::bench(args = SIZES)]
fn contacts_with_another(bencher: Bencher<'_, '_>, side: usize) {
    contacts(bencher, side, f64::INFINITY);
}

#[divan::bench(args = SIZES)]
fn contacts_with_another_and_itself(bencher: Bencher<'_, '_>, side: usize) {
    contacts(bencher, side, 0.1);
}

#[divan::bench(args = SIZES)]
fn taking_up(bencher: Bencher<'_, '_>, side: usize) {
    let frames = frames(side);
    bencher.counter(ItemsCount::new(side * side)).bench_local(|| {
        let cloth = Touchable::new(&frames[0][0]).expect("a sound mesh");
        Proximity::new(0, &cloth, 0.05, 0.1)
    });
}

#[divan::bench(args = SIZES)]
fn all(bencher: Bencher<'_, '_>, side: usize) {
    let frames = frames(side);
    let participants = [("cloth", Some(ClothSettings::default())), ("floor", None)]
        .map(|(name, cloth)| Participant { name: name.to_owned(), cloth });
    let mut analyser = Analyser::new(participants.to_vec());
    let mut time_s = 0.0;
    bencher.counter(count(side)).bench_local(|| {
        let mut found = 0;
        for meshes in &frames {
            time_s += 1.0 / 60.0;
            analyser.feed(time_s, meshes).expect("sound frames");
            found += std::iter::from_fn(|| analyser.next_event()).count();
            found += std::iter::from_fn(|| analyser.next_sliding()).count();
        }
        found
    });
}
