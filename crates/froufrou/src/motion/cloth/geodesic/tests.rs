use super::*;
use crate::motion::cloth::shapes;

/// All shortest ways along edges, by Floyd and Warshall.
fn all_ways(surface: &Triangulation, positions: &[[f32; 3]]) -> Vec<Vec<f64>> {
    let count = surface.vertex_count();
    let place = |v: usize| DVec3::from(positions[v].map(f64::from));
    let mut ways = vec![vec![f64::INFINITY; count]; count];
    for (v, row) in ways.iter_mut().enumerate() {
        row[v] = 0.0;
        for &w in surface.ring(v as u32) {
            row[w as usize] = place(v).distance(place(w as usize));
        }
    }
    for middle in 0..count {
        let from_middle = ways[middle].clone();
        for row in &mut ways {
            let to_middle = row[middle];
            for (way, rest) in row.iter_mut().zip(&from_middle) {
                *way = way.min(to_middle + rest);
            }
        }
    }
    ways
}

#[test]
fn ways_are_the_shortest_and_surroundings_are_as_large_as_said() -> crate::Result<()> {
    for mesh in [
        shapes::sheet(16, 16, |u, v| [u, v, 0.1 * (9.0 * u).sin()]),
        shapes::sphere(0.4, 2),
        shapes::tube(0.2, 1.0, 14, 12),
    ] {
        let surface = Triangulation::new(&mesh)?;
        let expected = all_ways(&surface, &mesh.positions);
        let mut ways = Ways::new(&surface, &mesh.positions);
        for seed in (0..surface.vertex_count() as u32).step_by(37) {
            let found = ways.within(&[seed], 0.45);
            assert!(found.is_sorted_by(|a, b| a.1 <= b.1));
            let near = expected[seed as usize].iter().filter(|way| **way <= 0.45).count();
            assert_eq!(found.len(), near);
            assert!(found.iter().all(|&(v, way)| (way - expected[seed as usize][v as usize]).abs() < 1e-12));
        }
        let numbers: Vec<u32> = (0..surface.triangles().len() as u32).collect();
        for radius_m in [0.0, 0.2, 0.8] {
            let surroundings = Surroundings::new(&surface, &mesh.positions, radius_m, &numbers);
            for vertex in (0..surface.vertex_count() as u32).filter(|&v| !surface.fan(v).is_empty()) {
                let intervals = surroundings.of(vertex);
                assert!(intervals.is_sorted_by(|a, b| a[1] < b[0]));
                for (t, corners) in surface.triangles().iter().enumerate() {
                    let way = corners.iter().map(|&c| expected[vertex as usize][c as usize]);
                    let way = way.fold(f64::INFINITY, f64::min);
                    let left_out = holds(intervals, t as u32, t as u32 + 1);
                    assert!(left_out || way > radius_m, "{vertex} {t}: {way}");
                    assert!(!left_out || way <= 1.25 * radius_m + 1e-12, "{vertex} {t}: {way}");
                }
            }
        }
    }
    Ok(())
}

#[test]
fn intervals_hold_what_lies_within_one_of_them() {
    let intervals = [[2, 5], [7, 8], [10, 20]];
    let inside = |first, end| intervals.iter().any(|[a, b]| *a <= first && end <= *b);
    for first in 0..22 {
        for end in first + 1..23 {
            assert_eq!(holds(&intervals, first, end), inside(first, end), "{first} {end}");
        }
    }
    assert!(!holds(&[], 0, 1));
}
