use std::f64::consts::PI;

use glam::{DQuat, DVec3};

use super::*;
use crate::motion::cloth::shapes;
use crate::motion::event::Friction;
use crate::random::Random;

mod ready;
mod shape;
mod time;

/// A4, its long side along u.
const LONG_M: f64 = 0.297;
const SHORT_M: f64 = 0.21;

/// Columns and rows of cells: coarse, medium and fine, and with cells three times as long as wide.
const CELLS: [[u32; 2]; 4] = [[15, 10], [28, 20], [56, 40], [20, 42]];

/// A sheet whose inner vertices lie anywhere about their places, and whose cells are cut either way.
fn irregular(columns: u32, rows: u32, place: impl Fn(f64, f64) -> [f64; 3]) -> Mesh {
    let random = Random::new(7, 1);
    let mut count = 0;
    // As far in either direction as the shorter side of a cell allows.
    let cell_m = (LONG_M / f64::from(columns)).min(SHORT_M / f64::from(rows));
    let mut jitter = |at: u32, of: u32, length_m: f64, is_border: bool| {
        count += 1;
        let moved_m = if is_border { 0.0 } else { (0.6 * random.uniform(count) - 0.3) * cell_m };
        f64::from(at) / f64::from(of) + moved_m / length_m
    };
    let mut jittered = |i: u32, j: u32| {
        let is_border = i == 0 || i == columns || j == 0 || j == rows;
        (jitter(i, columns, LONG_M, is_border), jitter(j, rows, SHORT_M, is_border))
    };
    let grid: Vec<(u32, u32)> = (0..=rows).flat_map(|j| (0..=columns).map(move |i| (i, j))).collect();
    let positions = grid.iter().map(|&(i, j)| {
        let (u, v) = jittered(i, j);
        place(u, v).map(|c| c as f32)
    });
    let positions = positions.collect();
    let mut corners = Vec::new();
    for j in 0..rows {
        for i in 0..columns {
            let a = j * (columns + 1) + i;
            let (b, c, d) = (a + 1, a + columns + 2, a + columns + 1);
            let is_up = random.uniform(1_000_000 + u64::from(a)) < 0.5;
            corners.extend(if is_up { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] });
        }
    }
    let face_sizes = vec![3; corners.len()];
    Mesh { positions, face_vertices: corners.concat(), face_sizes }
}

/// The same sheet in all ways in which it may come: of three sizes of cells and long ones, orderly and not.
fn meshes(place: impl Fn(f64, f64) -> [f64; 3] + Copy) -> Vec<Mesh> {
    let all = CELLS.into_iter();
    all.flat_map(|[columns, rows]| [shapes::sheet(columns, rows, place), irregular(columns, rows, place)])
        .collect()
}

/// Vertices are moved by so much, anyhow.
fn shaken(mesh: &Mesh, by_m: f64, seed: u64) -> Mesh {
    let random = Random::new(seed, 3);
    let shake = |(index, p): (usize, &[f32; 3])| {
        let mut at = 3 * index as u64;
        p.map(|c| {
            at += 1;
            // A sum of uniform numbers is about normal, of the variance 1/12 each.
            let sum: f64 = (0..4).map(|k| random.uniform(at * 8 + k) - 0.5).sum();
            c + (by_m * sum * 3.0_f64.sqrt()) as f32
        })
    };
    Mesh { positions: mesh.positions.iter().enumerate().map(shake).collect(), ..mesh.clone() }
}

fn paper(settings: PaperSettings) -> Participant {
    Participant { name: "paper".to_owned(), paper: Some(settings) }
}

fn other(name: &str) -> Participant {
    Participant { name: name.to_owned(), paper: None }
}

/// An analyser that has seen one frame of a sheet.
fn seen(mesh: &Mesh, settings: PaperSettings) -> Analyser {
    let mut analyser = Analyser::new(vec![paper(settings)]);
    analyser.feed(0.0, std::slice::from_ref(mesh)).expect("a sound frame");
    analyser
}

fn events(analyser: &mut Analyser) -> Vec<Event> {
    std::iter::from_fn(|| analyser.next_event()).collect()
}

/// The vertices nearest to a place of the unit square, of a sheet of [`meshes`].
fn near(mesh: &Mesh, place: [f64; 3]) -> Vec<u32> {
    let away = |p: &[f32; 3]| DVec3::from(p.map(f64::from)).distance(DVec3::from(place));
    let nearest = (0..mesh.positions.len())
        .min_by(|&a, &b| away(&mesh.positions[a]).total_cmp(&away(&mesh.positions[b])));
    nearest.map(|v| v as u32).into_iter().collect()
}

/// The areas of all faces.
fn areas(mesh: &Mesh) -> Vec<f64> {
    let place = |v: u32| DVec3::from(mesh.positions[v as usize].map(f64::from));
    let area = |c: &[u32]| 0.5 * (place(c[1]) - place(c[0])).cross(place(c[2]) - place(c[0])).length();
    mesh.face_vertices.chunks(3).map(area).collect()
}

fn middle(mesh: &Mesh, face: usize) -> DVec3 {
    let corners = &mesh.face_vertices[3 * face..3 * face + 3];
    corners.iter().map(|&v| DVec3::from(mesh.positions[v as usize].map(f64::from))).sum::<DVec3>() / 3.0
}
