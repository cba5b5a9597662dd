//! What happens, and when.

use super::*;

/// Frames of a rate until a time, by what each object is at a time.
fn run(
    participants: Vec<Participant>,
    rate_hz: f64,
    until_s: f64,
    meshes: impl Fn(f64) -> Vec<Mesh>,
) -> Vec<Event> {
    let mut analyser = Analyser::new(participants);
    let mut told = Vec::new();
    let mut last_s = f64::NEG_INFINITY;
    for frame in 0..=(until_s * rate_hz).round() as u32 {
        let time_s = f64::from(frame) / rate_hz;
        analyser.feed(time_s, &meshes(time_s)).expect("a sound frame");
        for event in events(&mut analyser) {
            // Nothing is told late, and nothing before it happens.
            assert!(event.time_s() >= last_s && event.time_s() <= time_s, "{event:?} at {time_s}");
            told.push(event);
        }
        last_s = time_s;
    }
    assert!(told.is_sorted_by(|a, b| a.time_s() <= b.time_s()));
    told
}

fn buckles(events: &[Event]) -> Vec<&Buckle> {
    events.iter().filter_map(Event::buckle).collect()
}

fn frictions(events: &[Event]) -> Vec<&Friction> {
    events.iter().filter_map(Event::friction).collect()
}

/// A sheet bowed by a height in its middle, up or down.
fn bowed(height_m: f64) -> impl Fn(f64, f64) -> [f64; 3] + Copy {
    move |u, v| [u * LONG_M, height_m * (PI * u).sin(), -v * SHORT_M]
}

/// From one side to the other about a time, within some time.
fn step(time_s: f64, at_s: f64, within_s: f64) -> f64 {
    (2.0 * (time_s - at_s) / within_s).clamp(-1.0, 1.0)
}

#[test]
fn a_bow_that_flips_is_one_flap_when_it_does() {
    for rate_hz in [24.0, 60.0, 240.0] {
        for within_s in [0.004, 0.05, 0.15] {
            for (columns, rows) in [(15, 10), (28, 20)] {
                let found = run(vec![paper(PaperSettings::default())], rate_hz, 1.0, |t| {
                    vec![irregular(columns, rows, bowed(-0.03 * step(t, 0.503, within_s)))]
                });
                let found = buckles(&found);
                let [flap] = found[..] else { panic!("one at {rate_hz} Hz in {within_s} s: {found:?}") };
                assert!((flap.time_s - 0.503).abs() < 1e-3_f64.max(0.5 / rate_hz), "{rate_hz} {flap:?}");
                assert!(!flap.positive || flap.energy_mps > 0.0);
                assert!(flap.resonators[0].is_unconstrained(), "{flap:?}");
                // What turns is the slope from end to end, twice: from one side to the other.
                let turned = 2.0 * 2.0 * (0.03 * PI / LONG_M).atan() * SHORT_M / 2.0;
                let expected = turned / within_s.max(2.0 / 15.0);
                let part = flap.energy_mps / expected;
                let least = if rate_hz < 30.0 { 0.4 } else { 0.6 };
                assert!((least..1.4).contains(&part), "{rate_hz} Hz, {within_s} s: {part} {flap:?}");
            }
        }
    }
}

/// The vertices of the first and the last so many columns.
fn columns_held(columns: u32, rows: u32, first: u32, last: u32) -> Vec<u32> {
    let side = columns + 1;
    let is_held = |vertex: &u32| vertex % side < first || vertex % side >= side - last;
    (0..side * (rows + 1)).filter(is_held).collect()
}

#[test]
fn what_is_held_flips_when_its_middle_comes_through() {
    // The ends are turned about 0.4 s; at 0.8 s the sheet begins to go over.
    let wave = |t: f64| -0.006 - 0.006 * step(t, 0.4, 0.3);
    let height = |t: f64| -0.02 * step(t, 0.9, 0.2);
    let place = |t: f64| {
        move |u: f64, v: f64| {
            let [x, y, z] = bowed(height(t))(u, v);
            [x, y + wave(t) * (3.0 * PI * u).sin(), z]
        }
    };
    // In the middle it is as high as the one less the other; what is a little beside it counts as well.
    let expected_s = 0.9 + 0.1 * 0.012 / 0.02;
    let turned = |t: f64| SHORT_M * (PI * (height(t) + 3.0 * wave(t)) / LONG_M).atan();
    let rate = |t: f64| -(turned(t) - turned(t - 1.0 / 15.0)) * 15.0;
    let greatest = (0..50).map(|i| rate(expected_s - 0.01 * f64::from(i))).fold(0.0, f64::max);
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, -2.0, 0.5).normalize(), 2.1);
    for rate_hz in [24.0, 60.0, 240.0] {
        for (columns, rows) in [(15, 10), (28, 20)] {
            for held in [vec![], columns_held(columns, rows, 1, 1), columns_held(columns, rows, 0, 0)] {
                // Without a name what stays in its place is found to be held.
                let settings = PaperSettings { held, ..PaperSettings::default() };
                let found = run(vec![paper(settings)], rate_hz, 1.4, |t| {
                    let mesh = irregular(columns, rows, place(t));
                    vec![shapes::placed(&mesh, turn, 1.0, DVec3::new(0.3, 0.2, -0.5))]
                });
                let found = buckles(&found);
                let [flap] = found[..] else { panic!("one at {rate_hz} Hz: {found:?}") };
                assert!((flap.time_s - expected_s).abs() < 4e-3 + 0.1 / rate_hz, "{rate_hz} {flap:?}");
                let part = flap.energy_mps / greatest;
                assert!((0.7..1.2).contains(&part), "{rate_hz} Hz: {part} {flap:?}");
                // As what is not held does that goes the same way.
                let free = run(vec![paper(PaperSettings::default())], 60.0, 1.0, |t| {
                    vec![shapes::sheet(28, 20, |u, v| bowed(-0.02 * step(t, 0.5, 0.03))(u, v))]
                });
                assert_eq!(flap.positive, buckles(&free)[0].positive);
            }
        }
    }
}

#[test]
fn what_is_held_at_one_end_flips_by_its_curvature() {
    // It is curled up and then down, and slopes so that its end is never level with what holds it.
    let curl = |t: f64| -0.12 * step(t, 0.6, 0.05);
    for (columns, rows) in [(15, 10), (28, 20)] {
        let held = columns_held(columns, rows, 2, 0);
        let settings = PaperSettings { held, ..PaperSettings::default() };
        let found = run(vec![paper(settings)], 60.0, 1.2, |t| {
            vec![shapes::sheet(columns, rows, |u, v| [u * LONG_M, curl(t) * u * u + 0.14 * u, -v * SHORT_M])]
        });
        let found = buckles(&found);
        let [flap] = found[..] else { panic!("one: {found:?}") };
        assert!((flap.time_s - 0.6).abs() < 0.01, "{flap:?}");
    }
}

#[test]
fn what_drifts_over_or_trembles_makes_no_sound() {
    let slow = run(vec![paper(PaperSettings::default())], 60.0, 3.0, |t| {
        vec![shapes::sheet(28, 20, bowed(0.02 - 0.04 * t / 3.0))]
    });
    assert!(slow.is_empty(), "{slow:?}");
    let trembling = run(vec![paper(PaperSettings::default())], 60.0, 1.0, |t| {
        vec![shapes::sheet(28, 20, bowed(0.0002 * (170.0 * t).sin()))]
    });
    assert!(trembling.is_empty(), "{trembling:?}");
}

#[test]
fn a_dent_that_springs_in_a_bow_is_one_clap_of_its_own() {
    // A dent of 2 cm that springs within 20 ms, in a bow that stays.
    let place = |t: f64| {
        move |u: f64, v: f64| {
            let [x, y, z] = bowed(0.02)(u, v);
            let away = DVec3::new(x - 0.1, 0.0, z + 0.1).length_squared() / (0.02 * 0.02);
            [x, y - 0.006 * 0.5 * (1.0 + step(t, 0.5, 0.02)) * (-away).exp(), z]
        }
    };
    let settings = PaperSettings { average_m: Some(0.005), ..PaperSettings::default() };
    let found = run(vec![paper(settings)], 120.0, 1.0, |t| vec![shapes::sheet(56, 40, place(t))]);
    let found = buckles(&found);
    assert!(!found.is_empty(), "it is heard");
    let loudest = found.iter().max_by(|a, b| a.energy_mps.total_cmp(&b.energy_mps)).expect("one");
    assert!((loudest.time_s - 0.5).abs() < 0.015, "{loudest:?}");
    assert!(DVec3::from(loudest.position_m).distance(DVec3::new(0.1, 0.02, -0.1)) < 0.03, "{loudest:?}");
    assert!(found.iter().all(|b| (b.time_s - 0.5).abs() < 0.02), "{found:?}");
}

/// A table.
fn table() -> Mesh {
    shapes::sheet(2, 2, |u, v| [4.0 * u - 2.0, 0.0, 2.0 - 4.0 * v])
}

fn on_table() -> Vec<Participant> {
    vec![paper(PaperSettings::default()), other("table")]
}

#[test]
fn a_flat_sheet_on_a_table_rubs_constrained_while_it_is_pulled() {
    let found = run(on_table(), 60.0, 2.0, |t| {
        let pulled = 0.2 * t.clamp(0.5, 1.5);
        vec![shapes::sheet(28, 20, |u, v| [u * LONG_M + pulled, 0.002, -v * SHORT_M]), table()]
    });
    let found = frictions(&found);
    assert_eq!(found.len(), 60, "one a frame while it is pulled");
    for friction in &found {
        assert!(friction.time_s > 0.48 && friction.time_s < 1.5, "{friction:?}");
        assert!((friction.speed_mps - 0.2).abs() < 1e-3 && friction.other == "table", "{friction:?}");
        assert!((friction.area_m2 - LONG_M * SHORT_M).abs() < 1e-4, "{friction:?}");
        assert!(friction.resonators.len() == 1 && !friction.resonators[0].is_unconstrained(), "{friction:?}");
    }
}

#[test]
fn a_bowed_sheet_on_a_table_rubs_unconstrained_at_either_foot() {
    let found = run(on_table(), 60.0, 1.0, |t| {
        let mesh = shapes::sheet(28, 20, |u, v| {
            let [x, y, z] = bowed(0.05)(u, v);
            [x + 0.1 * t, y + 0.001, z]
        });
        vec![mesh, table()]
    });
    let found = frictions(&found);
    assert_eq!(found.len(), 120, "one a frame and foot");
    for friction in found {
        assert!((friction.speed_mps - 0.1).abs() < 1e-3, "{friction:?}");
        let largest = friction.resonators[0];
        assert!(largest.is_unconstrained() && (largest.ruling_m / SHORT_M - 1.0).abs() < 0.05, "{largest:?}");
    }
}

#[test]
fn what_moves_with_what_it_touches_does_not_slide() {
    let found = run(on_table(), 60.0, 1.0, |t| {
        let turn = DQuat::from_rotation_y(t);
        let sheet = shapes::sheet(15, 10, |u, v| [u * LONG_M, 0.002, -v * SHORT_M]);
        let move_by = DVec3::new(0.5 * t, 0.1 * t, 0.0);
        vec![shapes::placed(&sheet, turn, 1.0, move_by), shapes::placed(&table(), turn, 1.0, move_by)]
    });
    assert!(found.is_empty(), "{found:?}");
}

#[test]
fn a_sheet_that_comes_back_to_itself_rubs_itself() {
    // Two halves above each other, joined by a half of a tube; the upper one is pushed to and fro.
    let place = |t: f64| {
        move |u: f64, v: f64| {
            let (r, way) = (0.003, (u - 0.5) * 0.3);
            let bend = 0.5 * PI * r;
            let pushed = 0.05 * t * ((way - bend) / 0.05).clamp(0.0, 1.0);
            if way < -bend {
                [way + bend, -r, -v * 0.1]
            } else if way > bend {
                [-(way - bend) + pushed, r, -v * 0.1]
            } else {
                let angle = way / r;
                [r * angle.cos(), r * angle.sin(), -v * 0.1]
            }
        }
    };
    let settings = PaperSettings { radius_m: 0.008, surroundings_m: Some(0.05), ..PaperSettings::default() };
    let found = run(vec![paper(settings)], 60.0, 1.0, |t| vec![shapes::sheet(90, 20, place(t))]);
    let found = frictions(&found);
    assert!(found.len() > 50 && found.iter().all(|f| f.other == "paper"), "{}", found.len());
    assert!(found.iter().any(|f| (f.speed_mps - 0.05).abs() < 0.005), "{:?}", found.first());
}

#[test]
fn what_stays_while_the_sheet_moves_is_held() {
    // Held at one side, and waved.
    let place = |t: f64| {
        move |u: f64, v: f64| {
            let free = (u - 0.1).max(0.0);
            [u * LONG_M, 0.1 * free * free * (9.0 * t).sin(), -v * SHORT_M]
        }
    };
    let mut analyser = Analyser::new(vec![paper(PaperSettings::default())]);
    for frame in 0..60u32 {
        let time_s = f64::from(frame) / 60.0;
        analyser.feed(time_s, &[shapes::sheet(28, 20, place(time_s))]).expect("a sound frame");
    }
    let mesh = shapes::sheet(28, 20, place(1.0));
    let holds = &analyser.sheets[0].holding.holds;
    for (hold, p) in holds.iter().zip(&mesh.positions) {
        if p[0] < 0.03 {
            assert!(hold.is_held, "{p:?}");
        } else if p[0] > 0.12 {
            assert!(!hold.is_held, "{p:?}");
        }
    }
}

#[test]
fn a_sheet_tears_where_vertices_become_two_and_where_seams_open() {
    // Eight cells in a row, cut between the fourth and the fifth from one side to the middle, then all through.
    let whole = shapes::sheet(8, 4, |u, v| [u * 0.2, 0.0, -v * 0.1]);
    let cut = |rows: u32| {
        let mut mesh = whole.clone();
        let mut twin = std::collections::BTreeMap::new();
        for row in 0..rows {
            let vertex = row * 9 + 4;
            twin.insert(vertex, mesh.positions.len() as u32);
            let [x, y, z] = mesh.positions[vertex as usize];
            mesh.positions.push([x + 0.002, y, z]);
        }
        for face in mesh.face_vertices.chunks_mut(3) {
            let right = face.iter().map(|&v| v % 9).sum::<u32>() > 12 && face.iter().any(|v| v % 9 > 4);
            for vertex in face.iter_mut().filter(|_| right) {
                *vertex = twin.get(vertex).copied().unwrap_or(*vertex);
            }
        }
        mesh
    };
    let mut analyser = Analyser::new(vec![paper(PaperSettings::default())]);
    let mut tears = Vec::new();
    for (frame, mesh) in [whole.clone(), cut(2), cut(2), cut(5)].into_iter().enumerate() {
        analyser.feed(frame as f64, &[mesh]).expect("a sound frame");
        tears.extend(events(&mut analyser).into_iter().filter_map(|event| event.tear().cloned()));
    }
    assert_eq!(tears.len(), 2, "{tears:?}");
    assert!((tears[0].length_m - 0.05).abs() < 1e-6 && tears[0].time_s == 1.0, "{tears:?}");
    assert!(DVec3::from(tears[0].position_m).distance(DVec3::new(0.1, 0.0, -0.025)) < 0.003, "{tears:?}");
    assert!((tears[1].length_m - 0.05).abs() < 1e-3 && tears[1].time_s == 3.0, "{tears:?}");
    // A seam: all vertices of the cut are two from the beginning, and part.
    let halves = |apart: f32| {
        let mut mesh = cut(5);
        for vertex in 45..50 {
            mesh.positions[vertex][0] = 0.1 + apart;
        }
        mesh
    };
    let mut analyser = Analyser::new(vec![paper(PaperSettings::default())]);
    for (frame, apart) in [0.0, 0.0, 0.01, 0.02].into_iter().enumerate() {
        analyser.feed(frame as f64, &[halves(apart)]).expect("a sound frame");
    }
    let tears: Vec<Event> = events(&mut analyser);
    let [Event::Tear(tear)] = &tears[..] else { panic!("one tear: {tears:?}") };
    assert!((tear.length_m - 0.1).abs() < 1e-6 && tear.time_s == 2.0, "{tear:?}");
}

#[test]
fn a_mesh_made_anew_tears_where_it_has_new_borders() {
    let whole = shapes::sheet(40, 20, |u, v| [u * 0.2, 0.0, -v * 0.1]);
    // Finer cells: the same borders.
    let finer = shapes::sheet(50, 30, |u, v| [u * 0.2, 0.0, -v * 0.1]);
    // A slit from one side to the middle: a column of faces is gone.
    let slit = |mesh: &Mesh| {
        let mut slit = Mesh { positions: mesh.positions.clone(), ..Mesh::default() };
        for (number, face) in mesh.face_vertices.chunks(3).enumerate() {
            let at = middle(mesh, number);
            if !((at.x - 0.1).abs() < 0.0024 && at.z > -0.05) {
                slit.face_vertices.extend(face);
                slit.face_sizes.push(3);
            }
        }
        slit
    };
    let mut analyser = Analyser::new(vec![paper(PaperSettings::default())]);
    for (frame, mesh) in [whole.clone(), finer, slit(&whole)].into_iter().enumerate() {
        analyser.feed(frame as f64, &[mesh]).expect("a sound frame");
    }
    let found = events(&mut analyser);
    let [Event::Tear(tear)] = &found[..] else { panic!("one tear: {found:?}") };
    assert!((tear.length_m - 0.05).abs() < 0.015, "{tear:?}");
    assert!(DVec3::from(tear.position_m).distance(DVec3::new(0.1, 0.0, -0.025)) < 0.01, "{tear:?}");
    assert_eq!(std::iter::from_fn(|| analyser.next_restart()).count(), 2);
}

#[test]
fn wrong_frames_are_refused_and_change_nothing() {
    let mesh = shapes::sheet(4, 4, bowed(0.01));
    let mut analyser = Analyser::new(vec![paper(PaperSettings::default())]);
    analyser.feed(1.0, std::slice::from_ref(&mesh)).expect("a sound frame");
    let fault = |found: Result<()>| found.expect_err("refused").to_string();
    assert!(fault(analyser.feed(1.0, std::slice::from_ref(&mesh))).contains("frames come in order of time"));
    assert!(fault(analyser.feed(f64::NAN, std::slice::from_ref(&mesh))).contains("NaN"));
    assert!(fault(analyser.feed(2.0, &[])).contains("a frame of 0 meshes, of 1 objects"));
    let mut nowhere = mesh.clone();
    nowhere.positions[3][1] = f32::NAN;
    assert!(fault(analyser.feed(2.0, &[nowhere])).starts_with("paper: vertex 3 is at no place"));
    let mut broken = mesh.clone();
    broken.face_vertices[0] = 1_000_000;
    assert!(fault(analyser.feed(2.0, &[broken])).contains("a face has vertex 1000000"));
    analyser.feed(2.0, std::slice::from_ref(&mesh)).expect("it goes on");
    let settings = PaperSettings { held: vec![0, 25], ..PaperSettings::default() };
    let found = Analyser::new(vec![paper(settings)]).feed(0.0, std::slice::from_ref(&mesh));
    assert!(fault(found).contains("vertex 25 is held, but the mesh has 25"));
}

#[test]
fn any_number_of_threads_tells_the_same() {
    let told = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| {
            run(on_table(), 60.0, 0.5, |t| {
                let mesh = irregular(28, 20, |u, v| {
                    let [x, y, z] = bowed(0.03 * (20.0 * t).cos())(u, v);
                    [x + 0.1 * t, y.max(-0.002) + 0.004, z]
                });
                vec![mesh, table()]
            })
        })
    };
    let one = told(1);
    assert!(!one.is_empty());
    assert_eq!(one, told(3));
}
