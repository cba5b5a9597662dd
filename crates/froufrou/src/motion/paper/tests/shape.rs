//! Regions, rulings and resonators of surfaces that are known.

use super::*;

/// A cylinder of a radius whose rulings are at an angle to the short side of the sheet.
fn cylinder(radius_m: f64, angle: f64) -> impl Fn(f64, f64) -> [f64; 3] + Copy {
    move |u, v| {
        let (x, y) = ((u - 0.5) * LONG_M, (v - 0.5) * SHORT_M);
        let (across, along) = (x * angle.cos() + y * angle.sin(), y * angle.cos() - x * angle.sin());
        let turn = across / radius_m;
        [radius_m * turn.sin(), radius_m * (turn.cos() - 1.0), -along]
    }
}

/// A part of a cone between two distances from its apex, which is at the origin: `opening` is the angle of the part as
/// it lies flat, `slope` the sine of that between rulings and axis.
fn cone([near_m, far_m]: [f64; 2], opening: f64, slope: f64) -> impl Fn(f64, f64) -> [f64; 3] + Copy {
    move |u, v| {
        let way = near_m + v * (far_m - near_m);
        let turn = (u - 0.5) * opening / slope;
        [way * slope * turn.sin(), way * slope * turn.cos(), way * (1.0 - slope * slope).sqrt()]
    }
}

/// Two planes that meet at the middle of the long side.
fn fold(angle: f64) -> impl Fn(f64, f64) -> [f64; 3] + Copy {
    move |u, v| {
        let x = (u - 0.5) * LONG_M;
        [x * (0.5 * angle).cos(), -x.abs() * (0.5 * angle).sin(), -v * SHORT_M]
    }
}

/// A sheet of an even number of columns, so that there is an edge where it is folded.
fn folded(place: impl Fn(f64, f64) -> [f64; 3] + Copy) -> Vec<Mesh> {
    let mut meshes = Vec::new();
    for [columns, rows] in CELLS {
        let columns = columns + columns % 2;
        meshes.push(shapes::sheet(columns, rows, place));
        // The vertices in the middle stay there.
        let half = columns / 2;
        let left = irregular(half, rows, |u, v| place(0.5 * u, v));
        let right = irregular(half, rows, |u, v| place(0.5 + 0.5 * u, v));
        meshes.push(joined(&left, &right));
    }
    meshes
}

/// Two meshes in one; what lies in one place is welded later.
fn joined(a: &Mesh, b: &Mesh) -> Mesh {
    let mut mesh = a.clone();
    let count = a.positions.len() as u32;
    mesh.positions.extend(&b.positions);
    mesh.face_vertices.extend(b.face_vertices.iter().map(|v| v + count));
    mesh.face_sizes.extend(&b.face_sizes);
    mesh
}

/// The part of a sheet's area that is in one curved region with the ruling that it should have to within some degrees.
fn right_part(mesh: &Mesh, analyser: &Analyser, ruling: impl Fn(DVec3) -> DVec3) -> f64 {
    let regions = analyser.regions(0).expect("a sheet");
    let largest = (0..regions.regions.len())
        .max_by(|&a, &b| regions.regions[a].area_m2.total_cmp(&regions.regions[b].area_m2))
        .expect("a region") as u32;
    let areas = areas(mesh);
    let is_right = |&face: &usize| {
        let known = ruling(middle(mesh, face)).normalize();
        regions.of[face] == largest
            && regions.regions[largest as usize].is_curved
            && regions.rulings[face].dot(known).abs() > 15_f64.to_radians().cos()
    };
    (0..areas.len()).filter(is_right).map(|face| areas[face]).sum::<f64>() / areas.iter().sum::<f64>()
}

fn close(found: f64, expected: f64, part: f64) -> bool {
    (found - expected).abs() <= part * expected
}

#[test]
fn a_cylinder_is_one_region_with_parallel_rulings() {
    for radius_m in [0.08, 0.3] {
        for mesh in meshes(cylinder(radius_m, 0.0)) {
            let mut analyser = seen(&mesh, PaperSettings::default());
            let right = right_part(&mesh, &analyser, |_| DVec3::Z);
            assert!(right >= 0.95, "{radius_m} {} {right}", mesh.positions.len());
            let found = analyser.resonators_at(0, &[0]);
            let [one] = found[..] else { panic!("one resonator: {found:?}") };
            assert!(
                close(one.ruling_m, SHORT_M, 0.05),
                "{} {} {one:?}",
                mesh.positions.len(),
                mesh.face_vertices[2]
            );
            assert!(close(one.border_m, 2.0 * LONG_M, 0.05), "{one:?}");
            assert!(close(one.area_m2, LONG_M * SHORT_M, 0.01) && one.is_unconstrained());
            assert!(DVec3::from(one.normal).dot(DVec3::Y).abs() > 0.999, "{one:?}");
        }
    }
}

#[test]
fn a_slanted_cylinder_has_rulings_of_many_lengths() {
    let angle = 30_f64.to_radians();
    // The mean over rulings is the area by the width that they lie across.
    let expected = LONG_M * SHORT_M / (LONG_M * angle.cos() + SHORT_M * angle.sin());
    for mesh in meshes(cylinder(0.1, angle)) {
        let mut analyser = seen(&mesh, PaperSettings::default());
        let right = right_part(&mesh, &analyser, |_| DVec3::Z);
        assert!(right >= 0.95, "{} {right}", mesh.positions.len());
        let found = analyser.resonators_at(0, &[0]);
        assert!(found.len() == 1 && close(found[0].ruling_m, expected, 0.05), "{found:?}, not {expected}");
        assert!(close(found[0].border_m, 2.0 * (LONG_M + SHORT_M), 0.05), "{found:?}");
    }
}

#[test]
fn the_rulings_of_a_cone_meet_in_its_apex() {
    for [near_m, far_m] in [[0.05, 0.25], [0.2, 0.4]] {
        let opening = 0.9;
        for mesh in meshes(cone([near_m, far_m], opening, 0.5)) {
            let mut analyser = seen(&mesh, PaperSettings::default());
            let right = right_part(&mesh, &analyser, |p| p);
            assert!(right >= 0.95, "{near_m} {} {right}", mesh.positions.len());
            let found = analyser.resonators_at(0, &[0]);
            assert!(
                found.len() == 1 && close(found[0].ruling_m, far_m - near_m, 0.05),
                "{} {} {found:?}",
                mesh.positions.len(),
                mesh.face_vertices[2]
            );
            // Its straight sides are rulings, and do not vibrate.
            assert!(close(found[0].border_m, opening * (near_m + far_m), 0.05), "{near_m} {found:?}");
        }
    }
}

#[test]
fn a_flat_sheet_is_one_flat_region_that_is_constrained() {
    for mesh in meshes(|u, v| [u * LONG_M, 0.3 * v * SHORT_M, v * SHORT_M]) {
        let mut analyser = seen(&mesh, PaperSettings::default());
        let found = analyser.resonators_at(0, &[0]);
        assert!(found.len() == 1 && found[0].border_m == 0.0, "{found:?}");
        assert!(analyser.regions(0).expect("a sheet").regions.iter().all(|region| !region.is_curved));
    }
}

#[test]
fn a_fold_parts_regions_and_stops_vibration_if_it_is_sharp() {
    for (angle, count) in [(0.3, 2), (-0.3, 2), (0.7, 1), (-0.7, 1)] {
        for mesh in folded(fold(angle)) {
            let mut analyser = seen(&mesh, PaperSettings::default());
            let areas = areas(&mesh);
            let regions = analyser.regions(0).expect("a sheet");
            // The region of either half that has most of it, and how much that is.
            let mut right = 0.0;
            for side in [-1.0, 1.0] {
                let mut sums = vec![0.0; regions.regions.len()];
                for (face, area) in areas.iter().enumerate() {
                    let region = regions.of[face] as usize;
                    if middle(&mesh, face).x * side > 0.0 && !regions.regions[region].is_curved {
                        sums[region] += area;
                    }
                }
                right += sums.into_iter().fold(0.0, f64::max);
            }
            right /= areas.iter().sum::<f64>();
            assert!(right >= 0.95, "{angle} {} {right}", mesh.positions.len());
            let start = near(&mesh, fold(angle)(0.2, 0.5));
            let found = analyser.resonators_at(0, &start);
            assert_eq!(found.len(), count, "{angle} {found:?}");
            assert!(found.iter().all(|one| close(one.area_m2, 0.5 * LONG_M * SHORT_M, 0.02)), "{found:?}");
            assert!(found.iter().any(|one| one.position_m[0] < 0.0), "where it happens");
        }
    }
}

/// Two cylinders that meet at an angle at the middle of the long side.
fn ridge(radius_m: f64, angle: f64) -> impl Fn(f64, f64) -> [f64; 3] + Copy {
    move |u, v| {
        let x = (u - 0.5) * LONG_M;
        let (turn, side) = (x.abs() / radius_m, x.signum());
        let (sine, cosine) = (0.5 * angle).sin_cos();
        let (out, down) = (radius_m * turn.sin(), radius_m * (1.0 - turn.cos()));
        [side * (out * cosine - down * sine), -(down * cosine + out * sine), -v * SHORT_M]
    }
}

#[test]
fn a_ridge_within_what_is_curved_cuts_it() {
    for radius_m in [0.1, 0.2, 0.4] {
        for (angle, part) in [(0.3, 1.0), (-0.3, 1.0), (0.8, 0.5), (-0.8, 0.5)] {
            let place = ridge(radius_m, angle);
            for mesh in folded(place) {
                let mut analyser = seen(&mesh, PaperSettings::default());
                let found = analyser.resonators_at(0, &near(&mesh, place(0.2, 0.5)));
                let sum = |of: fn(&Resonator) -> f64| found.iter().map(of).sum::<f64>();
                assert!(close(sum(|one| one.area_m2), part * LONG_M * SHORT_M, 0.02), "{angle} {found:?}");
                assert!(
                    close(sum(|one| one.border_m), part * 2.0 * LONG_M, 0.05),
                    "{radius_m} {angle} {found:?}"
                );
                assert!(found.iter().all(|one| close(one.ruling_m, SHORT_M, 0.05)), "{angle} {found:?}");
            }
        }
    }
}

#[test]
fn a_fold_across_rulings_does_not_hide_behind_noise() {
    for seed in 0..4 {
        for [columns, rows] in &CELLS[..2] {
            let columns = columns + columns % 2;
            let mesh = shaken(&shapes::sheet(columns, *rows, fold(0.7)), 1e-4, seed);
            let mut analyser = seen(&mesh, PaperSettings::default());
            let found = analyser.resonators_at(0, &near(&mesh, fold(0.7)(0.2, 0.5)));
            assert!(found.len() == 1 && close(found[0].area_m2, 0.5 * LONG_M * SHORT_M, 0.03), "{found:?}");
        }
    }
}

#[test]
fn what_is_held_all_along_is_constrained() {
    let place = cylinder(0.1, 0.0);
    for mesh in meshes(place) {
        let ends = |v: &u32| {
            let z = mesh.positions[*v as usize][2].abs();
            f64::from(z) > 0.499 * SHORT_M
        };
        let held: Vec<u32> = (0..mesh.positions.len() as u32).filter(ends).collect();
        let settings = PaperSettings { held: held.clone(), ..PaperSettings::default() };
        let mut analyser = seen(&mesh, settings);
        let found = analyser.resonators_at(0, &near(&mesh, place(0.5, 0.5)));
        assert!(found.len() == 1 && found[0].border_m == 0.0, "{found:?}");
        // Held on one side alone it has the border of the other.
        let one_side = held.into_iter().filter(|&v| mesh.positions[v as usize][2] > 0.0).collect();
        let settings = PaperSettings { held: one_side, ..PaperSettings::default() };
        let mut analyser = seen(&mesh, settings);
        let found = analyser.resonators_at(0, &near(&mesh, place(0.5, 0.5)));
        assert!(found.len() == 1 && close(found[0].border_m, LONG_M, 0.05), "{found:?}");
    }
}

#[test]
fn turning_and_scaling_change_nothing_but_lengths() {
    // A small sheet does not touch itself.
    let settings = PaperSettings { radius_m: 0.0, ..PaperSettings::default() };
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, -2.0, 0.5).normalize(), 2.1);
    for mesh in [shapes::sheet(28, 20, cylinder(0.1, 0.4)), irregular(28, 20, cone([0.05, 0.25], 0.9, 0.5))] {
        let one = seen(&mesh, settings.clone()).resonators_at(0, &[0])[0];
        for scale in [0.2, 5.0] {
            let moved = DVec3::new(0.3, -0.2, 0.4) * scale;
            let other = shapes::placed(&mesh, turn, scale, moved);
            let found = seen(&other, settings.clone()).resonators_at(0, &[0]);
            assert_eq!(found.len(), 1);
            assert!(close(found[0].ruling_m, scale * one.ruling_m, 1e-2), "{one:?} {found:?}");
            assert!(close(found[0].border_m, scale * one.border_m, 1e-3), "{one:?} {found:?}");
            assert!(close(found[0].area_m2, scale * scale * one.area_m2, 1e-3));
            let expected = turn * DVec3::from(one.position_m) * scale + moved;
            assert!(expected.distance(DVec3::from(found[0].position_m)) < 1e-3 * scale);
            assert!((turn * DVec3::from(one.normal)).dot(DVec3::from(found[0].normal)) > 0.9999);
        }
    }
}

#[test]
fn noise_leaves_regions_as_they_are() {
    for place in [cylinder(0.15, 0.0), cylinder(0.1, 0.5)] {
        for mesh in meshes(place).into_iter().take(6) {
            let mut analyser = Analyser::new(vec![paper(PaperSettings::default())]);
            let mut ids = std::collections::BTreeSet::new();
            for frame in 0..8u32 {
                let now = shaken(&mesh, 1e-4, u64::from(frame));
                analyser.feed(f64::from(frame) / 60.0, std::slice::from_ref(&now)).expect("a sound frame");
                let right = right_part(&now, &analyser, |_| DVec3::Z);
                assert!(right >= 0.95, "{} {right}", mesh.positions.len());
                let regions = &analyser.regions(0).expect("a sheet").regions;
                ids.extend(regions.iter().filter(|r| r.area_m2 > 0.01).map(|r| r.id));
            }
            assert_eq!(ids.len(), 1, "its region is the same all the time");
            assert!(events(&mut analyser).is_empty(), "and nothing happens");
        }
    }
    for mesh in meshes(|u, v| [u * LONG_M, 0.0, -v * SHORT_M]).into_iter().take(6) {
        let mut analyser = Analyser::new(vec![paper(PaperSettings::default())]);
        for frame in 0..30u32 {
            let now = shaken(&mesh, 1e-4, u64::from(frame));
            analyser.feed(f64::from(frame) / 60.0, std::slice::from_ref(&now)).expect("a sound frame");
            let flat = analyser.regions(0).expect("a sheet").regions.iter().filter(|r| !r.is_curved);
            let flat_m2: f64 = flat.map(|r| r.area_m2).sum();
            assert!(flat_m2 > 0.95 * LONG_M * SHORT_M, "{} {flat_m2}", mesh.positions.len());
        }
        let found = events(&mut analyser);
        assert!(found.is_empty(), "{} {found:?}", mesh.positions.len());
    }
}

#[test]
fn seams_and_faces_of_no_area_are_borne() {
    let place = cylinder(0.1, 0.0);
    let whole = shapes::sheet(28, 20, place);
    let expected = seen(&whole, PaperSettings::default()).resonators_at(0, &[0])[0];
    // Cut in two halves with vertices of their own, turned the other way round, with faces of no area and one twice.
    let mut mesh = joined(
        &shapes::sheet(14, 20, |u, v| place(0.5 * u, v)),
        &shapes::sheet(14, 20, |u, v| place(0.5 + 0.5 * u, v)),
    );
    for face in mesh.face_vertices.chunks_mut(3).skip(560) {
        face.swap(0, 1);
    }
    mesh.face_vertices.extend([0, 0, 1, 3, 4, 3]);
    mesh.face_sizes.extend([3, 3]);
    let found = seen(&mesh, PaperSettings::default()).resonators_at(0, &[0]);
    assert_eq!(found.len(), 1);
    assert!(
        close(found[0].ruling_m, expected.ruling_m, 0.01)
            && close(found[0].border_m, expected.border_m, 0.01)
    );
}

#[test]
fn meshes_of_nothing_are_borne() {
    let point = Mesh { positions: vec![[0.0; 3]; 3], face_vertices: vec![0, 1, 2], face_sizes: vec![3] };
    let line = Mesh {
        positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]],
        face_vertices: vec![0, 1, 2],
        face_sizes: vec![3],
    };
    for mesh in [Mesh::default(), point, line] {
        let mut analyser = seen(&mesh, PaperSettings::default());
        analyser.feed(1.0, std::slice::from_ref(&mesh)).expect("a sound frame");
        assert!(events(&mut analyser).is_empty());
        analyser.resonators_at(0, &[0]);
    }
}
