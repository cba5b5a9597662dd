//! What it costs to follow paper: a bowed sheet that is slid along a table, and one that flips.
//!
//! A triangle and frame is the unit; a frame's work is that by the number of triangles.

use divan::Bencher;
use divan::counter::ItemsCount;
use froufrou::motion::paper::{Analyser, PaperSettings, Participant};
use froufrou::scene::animation::Mesh;

const FRAMES: usize = 8;
/// Columns and rows of cells, each of two triangles: 180, 448, 1326, 10 050 and 100 800 triangles.
const CELLS: [[usize; 2]; 5] = [[10, 9], [16, 14], [39, 17], [75, 67], [240, 210]];

fn main() {
    divan::main();
}

/// A sheet of A4 of so many cells.
fn sheet([columns, rows]: [usize; 2], place: impl Fn(f32, f32) -> [f32; 3]) -> Mesh {
    let at = |index: usize| (index % (columns + 1), index / (columns + 1));
    let vertices = (0..(columns + 1) * (rows + 1)).map(at);
    let positions = vertices.map(|(i, j)| place(i as f32 / columns as f32, j as f32 / rows as f32)).collect();
    let cell = |index: usize| {
        let a = (index / columns * (columns + 1) + index % columns) as u32;
        let above = a + columns as u32 + 1;
        [a, a + 1, above + 1, a, above + 1, above]
    };
    let cells = columns * rows;
    Mesh { positions, face_vertices: (0..cells).flat_map(cell).collect(), face_sizes: vec![3; 2 * cells] }
}

fn table() -> Mesh {
    sheet([1, 1], |u, v| [4.0 * u - 2.0, 0.0, 2.0 - 4.0 * v])
}

/// A sheet bowed by a height, moved along; its ends are 2 mm above the table.
fn bowed(cells: [usize; 2], height_m: f32, moved_m: f32) -> Mesh {
    sheet(cells, |u, v| {
        let bow = height_m * (std::f32::consts::PI * u).sin();
        [0.297 * u + moved_m, 0.002 + bow, -0.21 * v]
    })
}

fn follow(bencher: Bencher<'_, '_>, frames: &[[Mesh; 2]]) {
    let participants = [("sheet", Some(PaperSettings::default())), ("table", None)]
        .map(|(name, paper)| Participant { name: name.to_owned(), paper });
    let mut analyser = Analyser::new(participants.to_vec());
    let mut time_s = 0.0;
    let triangles = frames[0][0].face_sizes.len();
    bencher.counter(ItemsCount::new(triangles * frames.len())).bench_local(|| {
        let mut found = 0;
        for meshes in frames {
            time_s += 1.0 / 60.0;
            analyser.feed(time_s, meshes).expect("sound frames");
            found += std::iter::from_fn(|| analyser.next_event()).count();
        }
        found
    });
}

/// Both feet rub along the table in every frame.
#[divan::bench(args = CELLS)]
fn sliding(bencher: Bencher<'_, '_>, cells: [usize; 2]) {
    let frames: Vec<_> =
        (0..FRAMES).map(|frame| [bowed(cells, 0.05, 0.01 * frame as f32), table()]).collect();
    follow(bencher, &frames);
}

/// The bow goes from one side to the other and back, and nothing is touched.
#[divan::bench(args = CELLS)]
fn flipping(bencher: Bencher<'_, '_>, cells: [usize; 2]) {
    let height_m = |frame: usize| 0.05 * (frame as f32 / FRAMES as f32 * std::f32::consts::TAU).cos();
    let lifted = |mut mesh: Mesh| {
        mesh.positions.iter_mut().for_each(|p| p[1] += 0.5);
        mesh
    };
    let frames: Vec<_> =
        (0..FRAMES).map(|frame| [lifted(bowed(cells, height_m(frame), 0.0)), table()]).collect();
    follow(bencher, &frames);
}
