//! What sheets of paper do in simulated animations, against what is known to happen in them.

mod data;

use std::path::Path;
use std::time::Instant;

use data::data;
use froufrou::motion::event::{Buckle, Event, Friction};
use froufrou::motion::moving_paper::{Body, MovingPaper, Told};
use froufrou::motion::paper::PaperSettings;
use froufrou::scene::Scene;
use froufrou::scene::animation::{Mesh, Topology};
use froufrou::scene::carrier::Carrier;
use froufrou::scene::world::World;

/// What the file's objects are carried by, each with its name.
fn carriers(path: &Path) -> Vec<(String, Carrier)> {
    let file = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let text = format!("[[object]]\nname = 'it'\nsource = '{file}#/**'\n");
    let scene = Scene::parse(&text, path.with_file_name("scene.toml"), false).expect("a sound scene");
    let world = World::open(&scene).expect("a sound archive");
    let bodies = world.objects.iter().flatten();
    let carried = bodies.filter_map(|body| Some((body.name.clone(), body.carrier.clone()?)));
    carried.filter(|(_, carrier)| carrier.topology() != Topology::None).collect()
}

/// What the sheet whose name has `Paper` in it does.
fn told(path: &Path, settings: &PaperSettings) -> (Vec<Buckle>, Vec<Friction>) {
    let started = Instant::now();
    let bodies = carriers(path).into_iter().map(|(name, carrier)| {
        let is_paper = name.contains("Paper");
        Body { name, paper: is_paper.then(|| settings.clone()), regions: None, force: None, carrier }
    });
    let (mut buckles, mut frictions) = (Vec::new(), Vec::new());
    let mut last_s = f64::NEG_INFINITY;
    for told in MovingPaper::new(bodies.collect(), path).expect("meshes") {
        match told.expect("a sound frame") {
            Told::Event(event) => {
                assert!(event.time_s() >= last_s, "events come in order of time");
                last_s = event.time_s();
                match *event {
                    Event::Buckle(buckle) => buckles.push(buckle),
                    Event::Friction(friction) => frictions.push(friction),
                    other => panic!("{other:?}"),
                }
            }
            Told::Restart(restart) => panic!("{restart:?}"),
        }
    }
    println!(
        "{}: {} crumplings, {} moments of friction in {:.2} s",
        path.display(),
        buckles.len(),
        frictions.len(),
        started.elapsed().as_secs_f64()
    );
    (buckles, frictions)
}

/// When the bow of `paper_flip` changes its sign: its middle is as high as the edges that are held.
fn flips(path: &Path) -> Vec<f64> {
    let (_, carrier) =
        carriers(path).into_iter().find(|(name, _)| name.contains("Paper")).expect("the sheet");
    let mut mesh = Mesh::default();
    let mut bow_m = |time_s: f64| {
        carrier.mesh(time_s, &mut mesh).expect("a sound frame");
        // 29 vertices a row, 21 rows.
        let height_m = |row: usize, column: usize| f64::from(mesh.positions[row * 29 + column][1]);
        height_m(10, 14) - 0.5 * (height_m(10, 0) + height_m(10, 28))
    };
    let mut found = Vec::new();
    let mut last: Option<(f64, f64)> = None;
    let mut next_s = carrier.next_key_s(f64::MIN);
    while let Some(time_s) = next_s {
        let now = bow_m(time_s);
        if let Some((before_s, before)) = last
            && (before < 0.0) != (now < 0.0)
            && time_s > 0.9
        {
            found.push(before_s + (time_s - before_s) * before / (before - now));
        }
        last = Some((time_s, now));
        next_s = carrier.next_key_s(time_s);
    }
    found
}

#[test]
fn a_bow_that_flips_five_times_flaps_five_times() {
    let Some(path) = data("anim/paper_flip.abc") else { return };
    let settings = PaperSettings { least_energy_mps: 0.0, ..PaperSettings::default() };
    let (buckles, frictions) = told(&path, &settings);
    let expected = flips(&path);
    assert_eq!(expected.len(), 5, "{expected:?}");
    let greatest = buckles.iter().map(|b| b.energy_mps).fold(0.0, f64::max);
    let strong: Vec<&Buckle> = buckles.iter().filter(|b| b.energy_mps > 0.5 * greatest).collect();
    let rest = buckles.iter().filter(|b| b.energy_mps <= 0.5 * greatest);
    let loudest_rest = rest.map(|b| b.energy_mps).fold(0.0, f64::max);
    assert_eq!(strong.len(), 5, "{strong:?}");
    for (flap, expected_s) in strong.iter().zip(&expected) {
        println!("{:.4} s, flips at {expected_s:.4} s, {:.2} m/s", flap.time_s, flap.energy_mps);
        assert!((flap.time_s - expected_s).abs() < 0.02, "{flap:?} at {expected_s}");
        assert!(flap.resonators[0].is_unconstrained() && flap.resonators[0].area_m2 > 0.05, "{flap:?}");
        assert!(loudest_rest < 0.1 * flap.energy_mps, "{loudest_rest}");
    }
    // To and fro.
    assert!(strong.windows(2).all(|pair| pair[0].positive != pair[1].positive));
    println!("loudest of the rest: {loudest_rest:.3} m/s");
    assert!(frictions.is_empty(), "it touches nothing: {frictions:?}");
}

#[test]
fn a_sheet_on_a_table_rubs_constrained_while_flat_and_unconstrained_once_bowed() {
    let Some(path) = data("anim/paper_slide.abc") else { return };
    // The simulator keeps them 4 mm apart.
    let (_, frictions) = told(&path, &PaperSettings { radius_m: 0.008, ..PaperSettings::default() });
    let within =
        |from_s: f64, to_s: f64| frictions.iter().filter(move |f| (from_s..to_s).contains(&f.time_s));
    let unconstrained = |f: &Friction| f.resonators.iter().any(|one| one.is_unconstrained());
    assert!(frictions.iter().all(|f| f.other != f.cloth), "along the table alone");
    // It is pulled by 0.3 m in 1.5 s, slowly at first and in the end.
    let flat: Vec<&Friction> = within(0.05, 1.45).collect();
    assert!(flat.len() > 80, "{}", flat.len());
    assert!(flat.iter().all(|f| !unconstrained(f)), "constrained while flat");
    let slid_m: f64 = within(0.0, 1.5).filter(|f| f.area_m2 > 0.05).map(|f| f.speed_mps * f.lasts_s).sum();
    assert!((slid_m - 0.3).abs() < 0.015, "{slid_m}");
    let bowed: Vec<&Friction> = within(3.0, 4.45).collect();
    assert!(bowed.len() > 80, "{}", bowed.len());
    let fast: Vec<&&Friction> = bowed.iter().filter(|f| f.speed_mps > 0.05).collect();
    assert!(fast.iter().all(|f| unconstrained(f)), "unconstrained once bowed");
    assert_eq!(within(4.52, 9.0).count(), 0, "none when still");
}
