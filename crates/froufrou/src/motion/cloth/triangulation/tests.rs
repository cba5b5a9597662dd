use super::*;
use crate::motion::cloth::shapes;
use proptest::prelude::*;

fn mesh(positions: &[[f32; 3]], faces: &[&[u32]]) -> Mesh {
    Mesh {
        positions: positions.to_vec(),
        face_vertices: faces.concat(),
        face_sizes: faces.iter().map(|face| face.len() as u32).collect(),
    }
}

#[test]
fn a_closed_surface_has_no_boundary_and_goes_on_all_around() -> Result<()> {
    for mesh in [shapes::sphere(1.0, 2), shapes::torus(1.0, 0.3, 24, 12)] {
        let made = Triangulation::new(&mesh)?;
        assert_eq!((made.boundary_edges(), made.non_manifold_edges()), (0, 0));
        let used = (0..made.vertex_count() as u32).filter(|&v| !made.fan(v).is_empty());
        assert!(used.clone().all(|v| made.inner()[v as usize] && made.ring(v).len() == made.fan(v).len()));
        // Euler's formula: vertices − edges + faces is 2 for a sphere and 0 for a torus.
        let edges: usize = used.clone().map(|v| made.ring(v).len()).sum::<usize>() / 2;
        let characteristic = used.count() as i64 - edges as i64 + made.triangles().len() as i64;
        assert!(characteristic == 2 || characteristic == 0, "{characteristic}");
    }
    Ok(())
}

#[test]
fn a_seam_is_welded_and_its_ends_are_boundary() -> Result<()> {
    let made = Triangulation::new(&shapes::tube(1.0, 2.0, 16, 8))?;
    assert_eq!(made.boundary_edges(), 2 * 16);
    let inner = made.inner().iter().filter(|inner| **inner).count();
    assert_eq!(inner, 16 * 7);
    assert_eq!(made.welded(16), Some(0));
    assert!(made.fan(16).is_empty() && made.ring(16).is_empty() && !made.inner()[16]);
    Ok(())
}

#[test]
fn a_seam_that_opens_is_torn() -> Result<()> {
    let mut mesh = shapes::tube(1.0, 2.0, 16, 8);
    let made = Triangulation::new(&mesh)?;
    assert_eq!(made.torn(&mesh.positions, 1e-3), None);
    mesh.positions[16 + 17][1] -= 0.01;
    assert_eq!(made.torn(&mesh.positions, 1e-3), Some([33, 17]));
    // Welded anew there is a slit.
    let again = Triangulation::new(&mesh)?;
    assert_eq!(again.boundary_edges(), 2 * 16 + 4);
    Ok(())
}

#[test]
fn triangles_that_wind_otherwise_are_turned() -> Result<()> {
    let sound = shapes::sphere(1.0, 2);
    let mut odd = sound.clone();
    for (t, corners) in odd.face_vertices.as_chunks_mut::<3>().0.iter_mut().enumerate() {
        if t % 3 == 1 {
            corners.swap(0, 1);
        }
    }
    let (sound, odd) = (Triangulation::new(&sound)?, Triangulation::new(&odd)?);
    assert_eq!(odd.inner(), sound.inner());
    let turned = |corners: &[u32; 3]| {
        let least = corners.iter().min().copied().unwrap_or_default();
        let first = corners.iter().position(|v| *v == least).unwrap_or_default();
        [corners[first], corners[(first + 1) % 3], corners[(first + 2) % 3]]
    };
    let all = |made: &Triangulation| made.triangles().iter().map(turned).collect::<Vec<_>>();
    assert_eq!(all(&odd), all(&sound));
    Ok(())
}

#[test]
fn what_cannot_be_turned_alike_has_no_curvature_there_alone() -> Result<()> {
    // A Möbius strip of 24 × 2 cells.
    let (around, across) = (24u32, 2u32);
    let mut strip = shapes::sheet(around, across, |u, v| {
        let (angle, width) = (std::f64::consts::TAU * u, 0.3 * (v - 0.5));
        let out = 1.0 + width * (0.5 * angle).cos();
        [out * angle.cos(), out * angle.sin(), width * (0.5 * angle).sin()]
    });
    // The last column is the first, upside down.
    for row in 0..=across {
        let from = ((across - row) * (around + 1)) as usize;
        strip.positions[(row * (around + 1) + around) as usize] = strip.positions[from];
    }
    let made = Triangulation::new(&strip)?;
    let inner = made.inner().iter().filter(|inner| **inner).count();
    assert!((20..24).contains(&inner), "{inner} of the 24 vertices in the middle");
    Ok(())
}

#[test]
fn edges_of_three_triangles_and_pinched_vertices_are_known() -> Result<()> {
    let fin = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]];
    let made = Triangulation::new(&mesh(&fin, &[&[0, 1, 2], &[1, 0, 3], &[0, 1, 4]]))?;
    assert_eq!((made.non_manifold_edges(), made.boundary_edges()), (1, 6));
    // Two tetrahedra that share a corner alone: each fan closes, but they are two.
    let mut points = vec![[0.0f32; 3]];
    let mut faces: Vec<Vec<u32>> = Vec::new();
    for side in [1.0f32, -1.0] {
        let first = points.len() as u32;
        points.extend([[1.0, 0.0, side], [-0.5, 0.8, side], [-0.5, -0.8, side]]);
        let [a, b, c] = [first, first + 1, first + 2];
        faces.extend([vec![0, a, b], vec![0, b, c], vec![0, c, a], vec![a, c, b]]);
    }
    let faces: Vec<&[u32]> = faces.iter().map(Vec::as_slice).collect();
    let made = Triangulation::new(&mesh(&points, &faces))?;
    assert_eq!(made.inner(), [false, true, true, true, true, true, true]);
    Ok(())
}

#[test]
fn quadrangles_are_cut_along_the_shorter_diagonal_and_lines_are_none() -> Result<()> {
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [3.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.5, 2.0, 0.0]];
    let made = Triangulation::new(&mesh(&corners, &[&[0, 1, 2, 3], &[0, 1], &[4, 4, 3], &[]]))?;
    assert_eq!(made.triangles(), [[0, 1, 3], [1, 2, 3]]);
    let made = Triangulation::new(&mesh(&corners, &[&[0, 1, 2, 4, 3]]))?;
    assert_eq!(made.triangles(), [[0, 1, 2], [0, 2, 4], [0, 4, 3]]);
    let none = Triangulation::new(&Mesh::default())?;
    assert_eq!((none.vertex_count(), none.triangles().len()), (0, 0));
    Ok(())
}

#[test]
fn what_is_no_mesh_is_told() {
    let corners = [[0.0f32; 3]; 3];
    let fault =
        |mesh: Mesh| Triangulation::new(&mesh).map(|_| String::new()).unwrap_or_else(|e| e.to_string());
    let told = fault(mesh(&corners, &[&[0, 1, 3]]));
    assert_eq!(told, "a face has vertex 3, but the mesh has 3");
    let odd = Mesh { face_sizes: vec![3, 3], ..mesh(&corners, &[&[0, 1, 2]]) };
    assert_eq!(fault(odd), "the faces have 6 vertices by their sizes, but 3 are listed");
    let absurd = Mesh { face_sizes: vec![u32::MAX; 3], ..mesh(&corners, &[&[0, 1, 2]]) };
    assert!(fault(absurd).starts_with("the faces have 12884901885 vertices"));
}

proptest! {
    /// Whatever the faces are, the triangulation is one: neighbours are mutual, lists ascend, and nothing panics.
    #[test]
    fn any_faces_give_lists_that_agree(
        faces in prop::collection::vec(prop::collection::vec(0u32..12, 0..6), 0..20),
        places in prop::collection::vec(prop::array::uniform3(0u8..3), 12),
    ) {
        let positions: Vec<[f32; 3]> = places.iter().map(|p| p.map(f32::from)).collect();
        let faces: Vec<&[u32]> = faces.iter().map(Vec::as_slice).collect();
        let made = Triangulation::new(&mesh(&positions, &faces))?;
        for v in 0..12u32 {
            prop_assert!(made.ring(v).is_sorted_by(|a, b| a < b));
            for &w in made.ring(v) {
                prop_assert!(made.ring(w).contains(&v));
            }
            for &t in made.fan(v) {
                prop_assert!(made.triangles()[t as usize].contains(&v));
            }
        }
        let corners = (0..12).map(|v| made.fan(v).len()).sum::<usize>();
        prop_assert_eq!(corners, 3 * made.triangles().len());
    }
}
