use super::*;
use crate::motion::event::{Buckle, Friction};
use glam::{DQuat, DVec3};

fn participants(names: &[(&str, bool)]) -> Vec<Participant> {
    let one = |&(name, is_cloth): &(&str, bool)| Participant {
        name: name.to_owned(),
        cloth: is_cloth.then(ClothSettings::default),
    };
    names.iter().map(one).collect()
}

#[derive(Debug, PartialEq)]
struct Told {
    events: Vec<Event>,
    slidings: Vec<Sliding>,
    restarts: Vec<Restart>,
}

/// Feeds frames, and takes what is ready after each.
fn run(names: &[(&str, bool)], frames: impl IntoIterator<Item = (f64, Vec<Mesh>)>) -> Told {
    let mut analyser = Analyser::new(participants(names));
    let mut told = Told { events: Vec::new(), slidings: Vec::new(), restarts: Vec::new() };
    let mut take = |analyser: &mut Analyser| {
        told.events.extend(std::iter::from_fn(|| analyser.next_event()));
        told.slidings.extend(std::iter::from_fn(|| analyser.next_sliding()));
        told.restarts.extend(std::iter::from_fn(|| analyser.next_restart()));
    };
    for (time_s, meshes) in frames {
        analyser.feed(time_s, &meshes).expect("a sound frame");
        take(&mut analyser);
    }
    analyser.finish();
    take(&mut analyser);
    assert!(told.events.is_sorted_by(|a, b| a.time_s() <= b.time_s()), "events are in order of time");
    told
}

fn buckles(told: &Told) -> Vec<&Buckle> {
    told.events.iter().filter_map(Event::buckle).collect()
}

fn frictions(told: &Told) -> Vec<&Friction> {
    told.events.iter().filter_map(Event::friction).collect()
}

/// A sheet that waves up and down over a floor, comes down on it after 1 s and is pulled along it, `cells` wide.
fn scene(time_s: f64, cells: u32) -> Vec<Mesh> {
    let wave = (time_s.min(1.0) * 9.0).cos() * 0.25;
    let along = 0.8 * (time_s - 1.2).max(0.0);
    let height = 0.3 * (1.0 - time_s).max(0.0) + 0.01;
    let place = |u: f64, v: f64| {
        let bow = wave * (std::f64::consts::PI * u).sin() * (1.0 - time_s).max(0.0);
        [u + along, height + bow, v]
    };
    vec![shapes::sheet(cells, cells, place), shapes::sheet(2, 2, |u, v| [8.0 * u - 4.0, 0.0, 8.0 * v - 4.0])]
}

const NAMES: [(&str, bool); 2] = [("sheet", true), ("floor", false)];

fn times(rate_hz: f64, seconds: f64) -> impl Iterator<Item = f64> {
    (0..=(seconds * rate_hz) as u32).map(move |frame| f64::from(frame) / rate_hz)
}

#[test]
fn a_sheet_buckles_in_the_air_and_slides_on_the_floor() {
    let told = run(&NAMES, times(60.0, 2.0).map(|t| (t, scene(t, 16))));
    let found = buckles(&told);
    // cos 9t is 0 at 0.175, 0.524 and 0.873 s.
    let strong: Vec<f64> =
        found.iter().filter(|b| b.energy_mps > 0.05).map(|b| (b.time_s * 1e3).round() / 1e3).collect();
    let expected = [0.175, 0.524, 0.873];
    let near = |(a, b): (&f64, &f64)| (a - b).abs() < 0.005;
    assert!(strong.len() == 3 && strong.iter().zip(&expected).all(near), "{strong:?}");
    assert!(found.iter().all(|b| b.cloth == "sheet" && b.time_s < 1.0));
    let slid = frictions(&told);
    assert!(slid.iter().all(|f| f.cloth == "sheet" && f.other == "floor" && f.time_s >= 1.2 - 0.02));
    let steady: Vec<_> = slid.iter().filter(|f| f.time_s > 1.25).collect();
    assert!(steady.len() > 40);
    for friction in steady {
        assert!(
            (friction.speed_mps - 0.8).abs() < 1e-3 && (friction.area_m2 - 1.0).abs() < 1e-3,
            "{friction:?}"
        );
        let [x, _, z] = friction.position_m;
        assert!((x - 0.5 - 0.8 * (friction.time_s - 1.2)).abs() < 1e-3 && (z - 0.5).abs() < 1e-3);
    }
    assert_eq!(told.slidings.len(), 121);
    assert_eq!(told.restarts, []);
}

#[test]
fn twice_the_resolution_and_rate_tell_the_same() {
    let all: Vec<Told> = [(16, 60.0), (32, 60.0), (16, 120.0), (32, 120.0)]
        .iter()
        .map(|&(cells, rate_hz)| run(&NAMES, times(rate_hz, 2.0).map(|t| (t, scene(t, cells)))))
        .collect();
    let energy = |told: &Told| buckles(told).iter().map(|b| b.energy_mps).sum::<f64>();
    let strong = |told: &Told| buckles(told).iter().filter(|b| b.energy_mps > 0.05).count();
    // ∫ area · speed dt.
    let slid = |told: &Told| frictions(told).iter().map(|f| f.area_m2 * f.speed_mps * f.lasts_s).sum::<f64>();
    for told in &all[1..] {
        assert_eq!(strong(told), strong(&all[0]));
        assert!((energy(told) / energy(&all[0]) - 1.0).abs() < 0.2, "{} {}", energy(told), energy(&all[0]));
        assert!((slid(told) / slid(&all[0]) - 1.0).abs() < 0.05, "{} {}", slid(told), slid(&all[0]));
    }
}

#[test]
fn a_shift_of_time_and_another_order_of_objects_change_nothing_else() {
    let first = run(&NAMES, times(60.0, 1.6).map(|t| (t, scene(t, 12))));
    let swap = |t: f64| scene(t, 12).into_iter().rev().collect::<Vec<_>>();
    let swapped = run(&[NAMES[1], NAMES[0]], times(60.0, 1.6).map(|t| (t, swap(t))));
    assert_eq!(swapped.events, first.events);
    let later = run(&NAMES, times(64.0, 1.6).map(|t| (t + 100.0, scene(t, 12))));
    let sooner = run(&NAMES, times(64.0, 1.6).map(|t| (t, scene(t, 12))));
    assert_eq!(later.events.len(), sooner.events.len());
    assert!(
        later.events.iter().zip(&sooner.events).all(|(a, b)| (a.time_s() - b.time_s() - 100.0).abs() < 1e-9)
    );
}

#[test]
fn threads_change_no_bit() -> Result<(), rayon::ThreadPoolBuildError> {
    let run = || run(&NAMES, times(60.0, 1.5).map(|t| (t, scene(t, 40))));
    let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let alone = pool(1)?.install(run);
    assert!(!alone.events.is_empty());
    assert!(pool(4)?.install(run) == alone);
    Ok(())
}

#[test]
fn other_faces_begin_anew_and_that_is_told() {
    // From 0.5 s on the sheet has other faces, and from 1.4 s on the floor.
    let frame = |t: f64| {
        let mut meshes = scene(t, if t < 0.5 { 12 } else { 16 });
        if t >= 1.4 {
            meshes[1] = shapes::sheet(3, 2, |u, v| [8.0 * u - 4.0, 0.0, 8.0 * v - 4.0]);
        }
        meshes
    };
    let told = run(&NAMES, times(60.0, 2.0).map(|t| (t, frame(t))));
    let restarts: Vec<_> =
        told.restarts.iter().map(|r| (r.object, r.why, (r.time_s * 60.0).round())).collect();
    assert_eq!(restarts, [(0, Why::Faces, 30.0), (1, Why::Faces, 84.0)]);
    // Buckles at 0.175 and 0.873 s are as ever; that of 0.524 s is seen by the new faces.
    let whole = run(&NAMES, times(60.0, 2.0).map(|t| (t, scene(t, 16))));
    let strong = |told: &Told| buckles(told).iter().filter(|b| b.energy_mps > 0.05).count();
    assert_eq!(strong(&told), strong(&whole));
    for friction in frictions(&told) {
        assert!(friction.speed_mps < 0.81, "{friction:?}");
    }
    // In the frame before the floor changes nobody knows how it slides.
    let at = |time_s: f64| frictions(&told).iter().filter(|f| (f.time_s - time_s).abs() < 1e-6).count();
    assert_eq!((at(82.0 / 60.0), at(83.0 / 60.0), at(84.0 / 60.0)), (1, 0, 1));
}

#[test]
fn a_seam_that_opens_begins_anew() {
    let frame = |t: f64| {
        let mut tube = shapes::tube(0.2, 1.0, 16, 8);
        if t > 0.45 {
            tube.positions[16 + 17][1] -= 0.05;
        }
        vec![tube]
    };
    let told = run(&[("sleeve", true)], times(20.0, 1.0).map(|t| (t, frame(t))));
    assert_eq!(told.restarts, [Restart { time_s: 0.5, object: 0, why: Why::Seam }]);
    assert_eq!(buckles(&told), Vec::<&Buckle>::new());
}

#[test]
fn what_is_no_frame_is_told_and_nothing_is_lost() {
    let mut analyser = Analyser::new(participants(&NAMES));
    let fault = |analyser: &mut Analyser, t: f64, meshes: &[Mesh]| {
        analyser.feed(t, meshes).err().map(|e| e.to_string()).unwrap_or_default()
    };
    assert_eq!(fault(&mut analyser, 0.0, &scene(0.0, 8)), "");
    assert_eq!(fault(&mut analyser, 0.1, &scene(0.1, 8)[..1]), "a frame of 1 meshes, of 2 objects");
    let told = fault(&mut analyser, 0.0, &scene(0.0, 8));
    assert_eq!(told, "a frame at 0 s after one at 0 s (frames come in order of time)");
    assert!(fault(&mut analyser, f64::NAN, &scene(0.0, 8)).starts_with("a frame at NaN s"));
    let mut broken = scene(0.1, 8);
    broken[0].positions[7] = [0.0, f32::NAN, 1.0];
    let told = fault(&mut analyser, 0.1, &broken);
    assert_eq!(told, "sheet: vertex 7 is at no place at 0.1 s: (0, NaN, 1)");
    let mut odd = scene(0.1, 8);
    odd[1].face_vertices[3] = 99;
    assert_eq!(fault(&mut analyser, 0.1, &odd), "floor: a face has vertex 99, but the mesh has 9");
    for frame in 1..30 {
        let t = f64::from(frame) / 60.0;
        assert_eq!(fault(&mut analyser, t, &scene(t, 8)), "");
    }
    analyser.finish();
    assert!(analyser.next_event().is_some() && analyser.next_restart().is_none());
}

#[test]
fn empty_meshes_and_single_frames_do_nothing() {
    let empty = || vec![Mesh::default(), Mesh::default()];
    let told = run(&NAMES, [(0.0, empty()), (1.0, empty()), (2.0, scene(0.0, 4)), (3.0, empty())]);
    assert_eq!(told.events, []);
    assert_eq!(told.restarts.len(), 4);
    let told = run(&NAMES, [(0.0, scene(0.0, 4))]);
    assert_eq!((told.events.len(), told.slidings.len()), (0, 0));
    let none = run(&[], [(0.0, vec![]), (1.0, vec![])]);
    assert_eq!(none.events, []);
    // A cloth of points alone, and one whose faces are lines.
    let points = Mesh { face_vertices: vec![0, 1], face_sizes: vec![2], ..scene(0.0, 4)[0].clone() };
    let told = run(&NAMES[..1], [(0.0, vec![points.clone()]), (1.0, vec![points])]);
    assert_eq!(told.events, []);
}

#[test]
fn turned_and_moved_everything_is_the_same() {
    let turn = DQuat::from_scaled_axis(DVec3::new(0.4, 2.0, -0.3));
    let moved = DVec3::new(1.0, -0.5, 2.0);
    let place = |mesh: &Mesh| shapes::placed(mesh, turn, 1.0, moved);
    let first = run(&NAMES, times(60.0, 1.8).map(|t| (t, scene(t, 12))));
    let other = run(&NAMES, times(60.0, 1.8).map(|t| (t, scene(t, 12).iter().map(place).collect())));
    let strong = |told: &Told| -> Vec<(f64, f64)> {
        buckles(told).iter().filter(|b| b.energy_mps > 0.05).map(|b| (b.time_s, b.energy_mps)).collect()
    };
    for (a, b) in strong(&first).iter().zip(strong(&other)) {
        assert!((a.0 - b.0).abs() < 1e-3 && (a.1 / b.1 - 1.0).abs() < 0.02, "{a:?} {b:?}");
    }
    assert_eq!(strong(&first).len(), strong(&other).len());
    let moving = |told: &Told| -> Vec<[f64; 3]> {
        let all = frictions(told).into_iter().filter(|f| f.speed_mps > 1e-3);
        all.map(|f| [f.time_s, f.speed_mps, f.area_m2]).collect()
    };
    assert_eq!(moving(&first).len(), moving(&other).len());
    for (a, b) in moving(&first).iter().zip(moving(&other)) {
        assert!((0..3).all(|i| (a[i] - b[i]).abs() < 1e-3), "{a:?} {b:?}");
    }
}

/// A sheet that is pulled along a floor, told how hard each vertex presses.
fn pressed(force_n: impl Fn(f64, usize) -> f32) -> Vec<Friction> {
    let mut analyser = Analyser::new(participants(&NAMES));
    for frame in 0..20 {
        let time_s = f64::from(frame) / 24.0;
        let sheet = shapes::sheet(4, 4, |u, v| [u + 0.5 * time_s, 0.01, v]);
        let floor = shapes::sheet(2, 2, |u, v| [8.0 * u - 4.0, 0.0, 8.0 * v - 4.0]);
        let forces: Vec<f32> = (0..sheet.positions.len()).map(|i| force_n(time_s, i)).collect();
        analyser.press(0, &forces).unwrap();
        analyser.feed(time_s, &[sheet, floor]).unwrap();
    }
    analyser.finish();
    std::iter::from_fn(|| analyser.next_event()).filter_map(|event| event.friction().cloned()).collect()
}

#[test]
fn what_presses_harder_counts_for_more() {
    let even = pressed(|_, _| 0.2);
    assert!(even.len() > 15);
    for friction in &even {
        // 25 vertices of 0.2 N, under 100 Pa.
        assert!((friction.force_n.unwrap() - 5.0).abs() < 1e-6, "{friction:?}");
        assert!(
            (friction.area_m2 - 0.05).abs() < 1e-8 && (friction.speed_mps - 0.5).abs() < 1e-4,
            "{friction:?}"
        );
    }
    let half = pressed(|time_s, i| if time_s < 0.4 && i < 5 { 0.4 } else { 0.0 });
    assert!(!half.is_empty());
    for friction in &half {
        // The first row alone presses, and nothing later on.
        assert!((friction.force_n.unwrap() - 2.0).abs() < 1e-6 && friction.time_s < 0.4, "{friction:?}");
        assert!(friction.position_m[2].abs() < 1e-6, "{friction:?}");
    }
}

#[test]
fn forces_that_cannot_be_are_told() {
    let mut analyser = Analyser::new(participants(&NAMES));
    assert!(analyser.press(1, &[0.0]).unwrap_err().to_string().contains("it is none"));
    assert!(analyser.press(2, &[0.0]).unwrap_err().to_string().contains("no object 2"));
    assert!(analyser.press(0, &[1.0, -1.0]).unwrap_err().to_string().contains("vertex 1 presses with -1 N"));
    assert!(analyser.press(0, &[f32::NAN]).is_err());
    analyser.press(0, &[1.0; 3]).unwrap();
    let fault = analyser.feed(0.0, &scene(0.0, 4)).unwrap_err();
    assert!(fault.to_string().contains("3 forces, and 25 vertices"), "{fault}");
    // What was wrong in one frame is not held against the next.
    analyser.feed(0.0, &scene(0.0, 4)).unwrap();
}
