//! Meshes that an engine is told, and what else is told beside them: nothing that is told is lost, what stands stands, and
//! what has nothing to do with cloth and paper leaves them alone.

mod studio;

use std::sync::Arc;

use froufrou::motion::event::{Becomes, Buckle, Cause, Change, Event, Moved};
use froufrou::render::live::{self, Capture, EngineSettings, Handle, Refused};
use froufrou::render::production::Production;
use froufrou::scene::Scene;
use froufrou::scene::animation::Mesh;
use froufrou::scene::fed::{Fed, FedPose};
use froufrou::score::{Action, ChannelLine, Verb};
use studio::sheets::{CELLS, letter, linen, vertices};
use studio::{Studio, Take, noise};

const RATE_HZ: u32 = 48_000;

const EAR: &str = "[[microphone]]\nname = 'm'\nposition = [0, 1, 1]\n";

/// A cloth on a floor, a sheet of paper, and a block; `material` is what they are of.
fn scene(studio: &Studio, material: &str) -> Scene {
    studio.recording("hit.wav", RATE_HZ, &noise(4_800, 2).iter().map(|s| 0.05 * s).collect::<Vec<_>>());
    studio.sheet("linen", CELLS, (2, 60.0), |_, corner| linen(0.0, corner));
    studio.sheet("letter", CELLS, (2, 60.0), |_, corner| letter(0.0, corner));
    studio.file("floor.obj", "v -4 0 -4\nv -4 0 4\nv 4 0 4\nv 4 0 -4\nf 1 2 3 4\n");
    let text = format!(
        "duration = 2\nseed = 3\n{EAR}{material}\n\
         [material.tin]\nimpact = {{ recordings = ['hit.wav'] }}\n[material.oak]\nimpact = {{ recordings = ['hit.wav'] }}\n\
         [[object]]\nname = 'block'\nmaterial = 'tin'\nbody = 'block*'\n\
         [[object]]\nname = 'bell'\nposition = [2, 1, -1]\nsound = {{ recording = 'hit.wav', at = [0.8] }}\n\
         [[object]]\nname = 'sheet'\nsource = 'linen.obj#/*'\nmaterial = 'linen'\n\
         [[object]]\nname = 'letter'\nsource = 'letter.obj#/*'\nmaterial = 'paper'\n\
         [[object]]\nname = 'floor'\nsource = 'floor.obj#/*'\nmaterial = 'oak'\n"
    );
    Scene::open(studio.file("told.toml", &text), false).unwrap()
}

const LINEN: &str =
    "[material.linen]\ncloth = { corpus = 'synthetic/cotton', floor_speed = 0.1, least_energy = 0 }\n";
const PAPER: &str = "[material.paper]\npaper = 'synthetic/printer'\n";

fn settings(meshes: &[&str]) -> EngineSettings {
    let meshes = meshes.iter().map(|name| (*name).to_owned()).collect();
    EngineSettings { budget: f32::INFINITY, meshes, ..EngineSettings::default() }
}

fn drag(handle: &mut Handle, time_s: f64) {
    let sheet = handle.object("sheet").unwrap();
    handle.mesh(sheet, time_s, &vertices(time_s, linen)).unwrap();
}

fn crumple(handle: &mut Handle, time_s: f64) {
    let page = handle.object("letter").unwrap();
    handle.mesh(page, time_s, &vertices(time_s, letter)).unwrap();
}

fn power(sound: &[f32], from_s: f64, to_s: f64) -> f64 {
    let at = |time_s: f64| (time_s * f64::from(RATE_HZ)) as usize;
    let piece = &sound[at(from_s)..at(to_s).min(sound.len())];
    piece.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / piece.len() as f64
}

/// How far two sounds are from each other, beside the louder peak.
fn distance(a: &[f32], b: &[f32]) -> f32 {
    assert!(a.len().min(b.len()) > 40_000);
    let peak = b.iter().fold(0.0f32, |peak, sample| sample.abs().max(peak));
    assert!(peak > 1e-6, "{peak}");
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) / peak
}

#[test]
fn frames_are_looked_at_however_many_come_before_time_goes_on() {
    let studio = Studio::new();
    let sound = |per_advance: u32| {
        studio::replayed(scene(&studio, &(LINEN.to_owned() + PAPER)), settings(&["sheet"]), |handle| {
            handle.vanish("bell", 1e-3).unwrap();
            for frame in 1..=360u32 {
                let time_s = f64::from(frame) / 240.0;
                drag(handle, time_s);
                if frame % per_advance == 0 {
                    handle.advance(time_s).unwrap();
                }
            }
        })
    };
    let expected = sound(1);
    for per_advance in [4, 12, 60] {
        assert_eq!(distance(&sound(per_advance), &expected), 0.0, "{per_advance} frames at once");
    }
    assert!(power(&expected, 0.3, 1.4) > 1e-12);
}

#[test]
fn what_only_a_file_knows_is_not_asked_of_what_is_told() {
    let studio = Studio::new();
    let sound = |materials: &str| {
        studio::replayed(scene(&studio, materials), settings(&["sheet", "letter"]), |handle| {
            for frame in 1..=60u32 {
                let time_s = f64::from(frame) / 60.0;
                drag(handle, time_s);
                crumple(handle, time_s);
                handle.advance(time_s).unwrap();
            }
        })
    };
    let pressing = LINEN.replace("least_energy", "force = 'pressing', least_energy")
        + PAPER
            .replace("'synthetic/printer'", "{ corpus = 'synthetic/printer', force = 'pressing' }")
            .as_str();
    assert_eq!(distance(&sound(&pressing), &sound(&(LINEN.to_owned() + PAPER))), 0.0);
}

#[test]
fn cloth_and_paper_go_on_while_other_things_come_and_go() {
    let studio = Studio::new();
    let sound = |disturbed: bool| {
        studio::replayed(
            scene(&studio, &(LINEN.to_owned() + PAPER)),
            settings(&["sheet", "letter"]),
            |handle| {
                for frame in 1..=60u32 {
                    let time_s = f64::from(frame) / 60.0;
                    // In the midst of the frame's meshes: nothing of it is looked at before all of it is told.
                    crumple(handle, time_s);
                    if disturbed {
                        let name = format!("block {frame}");
                        handle.body(&name).unwrap();
                        handle.material(&name, "oak", time_s).unwrap();
                        handle.vanish(&name, time_s).unwrap();
                        // As a thing with a mesh, but of which none is told.
                        handle.appear("floor", &name, time_s, FedPose::at([0.0; 3])).unwrap();
                        handle.vanish(&name, time_s).unwrap();
                        handle.material("floor", ["oak", "tin"][frame as usize % 2], time_s).unwrap();
                        handle.material("block", ["oak", "tin"][frame as usize % 2], time_s).unwrap();
                    }
                    drag(handle, time_s);
                    handle.advance(time_s).unwrap();
                }
            },
        )
    };
    let expected = sound(false);
    assert!(power(&expected, 0.5, 1.0) > 1e-12);
    assert_eq!(distance(&sound(true), &expected), 0.0);
}

/// Nothing that moves, far away from all else.
fn tell_still(handle: &mut Handle, name: &str, time_s: f64) {
    let mesh = handle.object(name).unwrap();
    handle.mesh(mesh, time_s, &vertices(0.0, |_, [x, z]| [x + 50.0, 3.0, z])).unwrap();
}

#[test]
fn cloth_and_paper_go_on_while_others_come_and_go() {
    let studio = Studio::new();
    let materials = LINEN.to_owned() + PAPER;
    let sound = |disturbed: bool| {
        studio::replayed(scene(&studio, &materials), settings(&["sheet", "letter"]), |handle| {
            for frame in 1..=90u32 {
                let time_s = f64::from(frame) / 60.0;
                crumple(handle, time_s);
                // Two that live for some frames, now of cloth and now of paper; the next has another name.
                for (begin, kind) in [(0, "sheet"), (3, "letter")] {
                    let (number, age) = ((frame + begin) / 7, (frame + begin) % 7);
                    let name = format!("{kind} {number}");
                    match age {
                        _ if !disturbed || number == 0 => continue,
                        0 => drop(handle.appear(kind, &name, time_s, FedPose::at([0.0; 3])).unwrap()),
                        3 => handle.material(&name, "paper", time_s).unwrap(),
                        4 => handle.material(&name, "oak", time_s).unwrap(),
                        5 => handle.material(&name, "linen", time_s).unwrap(),
                        _ => {}
                    }
                    match age {
                        6 => handle.vanish(&name, time_s).unwrap(),
                        _ => tell_still(handle, &name, time_s),
                    }
                }
                drag(handle, time_s);
                handle.advance(time_s).unwrap();
            }
        })
    };
    let expected = sound(false);
    assert!(power(&expected, 0.5, 1.5) > 1e-12);
    assert_eq!(distance(&sound(true), &expected), 0.0);
}

/// Whoever is there or was there before: what appears is looked at as if it was alone.
#[test]
fn what_joins_others_sounds_as_it_does_alone() {
    let studio = Studio::new();
    let materials = LINEN.to_owned() + PAPER;
    for (kind, place) in [("sheet", linen as fn(f64, [f64; 2]) -> [f64; 3]), ("letter", letter)] {
        let sound = |others: bool| {
            studio::replayed(scene(&studio, &materials), settings(&["sheet", "letter"]), |handle| {
                for frame in 1..=90u32 {
                    let time_s = f64::from(frame) / 60.0;
                    // Whoever is there without a mesh that is told takes no part.
                    let born = match frame {
                        5 => Some(("sheet", "a")),
                        20 => Some((kind, "it")),
                        _ => None,
                    };
                    if let Some((kind, name)) = born {
                        handle.appear(kind, name, time_s, FedPose::at([0.0; 3])).unwrap();
                    }
                    match frame {
                        1 => handle.vanish("bell", time_s).unwrap(),
                        15 => handle.vanish("a", time_s).unwrap(),
                        _ => {}
                    }
                    let told = ["sheet", "letter", "a"].iter().take(if others { 3 } else { 0 });
                    for name in told.filter(|name| **name != "a" || (5..15).contains(&frame)) {
                        tell_still(handle, name, time_s);
                    }
                    if frame >= 20 {
                        let it = handle.object("it").unwrap();
                        handle.mesh(it, time_s, &vertices(time_s, place)).unwrap();
                    }
                    if frame == 1 && !others {
                        let _ = ["sheet", "letter"].map(|name| handle.vanish(name, time_s).unwrap());
                    }
                    handle.advance(time_s).unwrap();
                }
            })
        };
        let expected = sound(false);
        assert_eq!(power(&expected, 0.0, 0.3), 0.0);
        assert!(power(&expected, 0.5, 1.5) > 1e-12, "{kind}");
        assert_eq!(distance(&sound(true), &expected), 0.0, "{kind}");
    }
}

#[test]
fn what_could_not_be_looked_at_is_tried_again() {
    let studio = Studio::new();
    let side = CELLS + 1;
    let lines = (1..8).map(|i| {
        let edge = [side * 3 + i, side * 3 + i + 1];
        format!("{{\"time_s\":{},\"torn\":[{edge:?}]}}\n", 0.6 + 0.03 * i as f64)
    });
    let lines: String = lines.collect();
    studio.file("letter.jsonl", &lines);
    let given = "[material.given]\npaper = { corpus = 'synthetic/printer', regions = 'letter.jsonl' }\n";
    let scene = scene(&studio, &(LINEN.to_owned() + PAPER + given));
    std::fs::remove_file(studio.path("letter.jsonl")).unwrap();
    let settings = Capture::unhurried(settings(&["letter"]));
    let (mut handle, player) = live::start(scene, settings).unwrap();
    let (mut capture, mut sound) = (Capture::new(player), Vec::new());
    handle.vanish("bell", 1e-3).unwrap();
    let flat = vertices(0.0, |_, [x, z]| [x, 1.0, z]);
    let mut faults = Vec::new();
    for frame in 1..=150u32 {
        let time_s = f64::from(frame) / 60.0;
        match frame {
            10 => handle.material("letter", "given", time_s).unwrap(),
            20 => drop(studio.file("letter.jsonl", &lines)),
            _ => {}
        }
        let page = handle.object("letter").unwrap();
        handle.mesh(page, time_s, &flat).unwrap();
        handle.advance(time_s).unwrap();
        let each = |frames: &[f32]| {
            sound.extend_from_slice(frames);
            Ok(())
        };
        capture.take(&mut handle, each).unwrap();
        faults.extend(handle.take_fault().map(|_| frame));
    }
    assert_eq!(faults, (10..20).collect::<Vec<_>>(), "each frame is tried");
    assert!(power(&sound, 0.6, 0.9) > 0.0, "it is heard to tear");
}

#[test]
fn what_is_told_to_be_earlier_than_before_is_refused() {
    let studio = Studio::new();
    let scene = scene(&studio, &(LINEN.to_owned() + PAPER));
    let settings = EngineSettings { movers: vec!["bell".to_owned()], ..settings(&["sheet"]) };
    let (mut handle, _player) = live::start(scene, settings).unwrap();
    let [bell, sheet] = ["bell", "sheet"].map(|name| handle.object(name).unwrap());
    for (time_s, is_later) in [(0.3, true), (0.5, true), (0.2, false), (0.5, true)] {
        let told = [
            handle.transform(bell, time_s, FedPose::at([time_s, 0.0, 0.0])),
            handle.mesh(sheet, time_s, &vertices(time_s, linen)),
        ];
        let expected = if is_later { Ok(()) } else { Err(Refused::Earlier) };
        assert_eq!(told, [expected; 2], "{time_s}");
    }
    assert_eq!(handle.left_out().earlier, 2);
    // Who takes over a place is not held to what was told of who had it.
    handle.vanish("bell", 0.5).unwrap();
    let other = handle.appear("bell", "other", 0.1, FedPose::at([0.0; 3])).unwrap();
    handle.transform(other, 0.2, FedPose::at([0.0; 3])).unwrap();
}

#[test]
fn where_time_is_told_to_go_back_what_was_told_of_later_is_forgotten() {
    let at = |x: f64| [[x as f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let rest = Mesh { positions: at(0.0).to_vec(), face_vertices: vec![0, 1, 2], face_sizes: vec![3] };
    let fed = Fed::with_mesh(FedPose::at([0.0; 3]), rest).unwrap();
    for (time_s, x) in [(1.3, 13.0), (1.5, 15.0), (1.2, 6.0)] {
        fed.push(time_s, FedPose::at([x, 0.0, 0.0]));
        fed.push_mesh(time_s, at(x).into(), None).unwrap();
    }
    for n in 0..30 {
        let time_s = 0.1 * f64::from(n);
        let expected = 5.0 * time_s.min(1.2);
        let [pose, vertex] = [fed.frame(time_s)[0][3], fed.vertex_m(0, time_s).unwrap()[0]];
        assert!(
            (pose - expected).abs() < 1e-9 && (vertex - expected).abs() < 1e-5,
            "{time_s}: {pose} {vertex}"
        );
    }
}

#[test]
fn a_mesh_that_is_not_told_stands() {
    let at = |x: f32| [[x, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let rest = Mesh { positions: at(0.0).to_vec(), face_vertices: vec![0, 1, 2], face_sizes: vec![3] };
    let fed = Fed::with_mesh(FedPose::at([0.0; 3]), rest).unwrap();
    let place = |time_s: f64| fed.vertex_m(0, time_s).unwrap()[0];
    fed.push_mesh(1.0, at(2.0).into(), None).unwrap();
    (1..=300).for_each(|frame| fed.stand(1.0 + f64::from(frame) / 60.0));
    fed.push_mesh(6.5, at(4.0).into(), None).unwrap();
    for (time_s, expected) in [(5.9, 2.0), (6.0, 2.0), (6.25, 3.0), (6.5, 4.0), (9.0, 4.0)] {
        assert!((place(time_s) - expected).abs() < 1e-6, "{time_s}: {}", place(time_s));
    }
    // However many frames come before time goes on, there is a bound, and it goes evenly all the same.
    (1..=5_000)
        .for_each(|n| fed.push_mesh(7.0 + 1e-3 * f64::from(n), at(4.0 + n as f32).into(), None).unwrap());
    for (time_s, expected) in [(7.1, 104.0), (11.999, 5_003.0), (12.0, 5_004.0)] {
        assert!((place(time_s) - expected).abs() < 1e-2, "{time_s}: {}", place(time_s));
    }
}

/// A sound from a vertex of something that appears is where that appears.
#[test]
fn what_appears_has_its_mesh_where_it_appears() {
    let studio = Studio::new();
    studio.tone("tone.wav");
    studio.file("sail.obj", "v -4 0 -3\nv -4 0 4\nv 4 0 4\nf 1 2 3\n");
    let text = format!(
        "duration = 2\n{EAR}\
         [[object]]\nname = 'buzz'\nposition = [90, 0, 0]\nsound = {{ recording = 'tone.wav', loop = true }}\n\
         [[object]]\nname = 'sail'\nsource = 'sail.obj#/*'\npoint = {{ vertex = 0 }}\n\
         sound = {{ recording = 'tone.wav', loop = true }}\n"
    );
    let sound = |kind: &'static str, pose: FedPose, meshes: &[&str]| {
        let scene = Scene::open(studio.file("told.toml", &text), false).unwrap();
        studio::replayed(scene, settings(meshes), |handle| {
            let _ = ["buzz", "sail"].map(|name| handle.vanish(name, 1e-3).unwrap());
            for frame in 1..=90u32 {
                let time_s = f64::from(frame) / 60.0;
                if frame == 10 {
                    handle.appear(kind, "it", time_s, pose).unwrap();
                }
                handle.advance(time_s).unwrap();
            }
        })
    };
    // A quarter turn to the left: what is ahead is at −X then, what is to the left at +Z.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let pose = FedPose { position_m: [5.0, 0.5, -2.0], rotation: [0.0, half, 0.0, half] };
    let expected = sound("buzz", FedPose::at([5.0 - 3.0, 0.5, -2.0 + 4.0]), &[]);
    for meshes in [&["sail"][..], &[]] {
        assert!(distance(&sound("sail", pose, meshes), &expected) < 1e-4, "{meshes:?}");
    }
}

#[test]
fn what_appears_stands_there_from_when_it_appears() {
    let studio = Studio::new();
    studio.tone("tone.wav");
    let text = format!(
        "duration = 2\n{EAR}[[object]]\nname = 'fly'\nposition = [0, 0, 0]\n\
         sound = {{ recording = 'tone.wav', loop = true }}\n"
    );
    let sound = |says_so: bool| {
        let scene = Scene::open(studio.file("told.toml", &text), false).unwrap();
        studio::replayed(scene, settings(&[]), |handle| {
            handle.vanish("fly", 1e-3).unwrap();
            for frame in 1..=60u32 {
                let time_s = f64::from(frame) / 60.0;
                if frame == 20 {
                    let born_s = time_s - 0.01;
                    let here = FedPose::at([0.0, 1.0, 0.0]);
                    let wasp = handle.appear("fly", "wasp", born_s, here).unwrap();
                    if says_so {
                        handle.transform(wasp, born_s, here).unwrap();
                    }
                    handle.transform(wasp, time_s, FedPose::at([0.5, 1.0, 0.0])).unwrap();
                }
                handle.advance(time_s).unwrap();
            }
        })
    };
    assert_eq!(distance(&sound(false), &sound(true)), 0.0);
}

#[test]
fn what_has_vanished_from_the_scene_does_not_come_back_with_its_name() {
    let studio = Studio::new();
    let scene = scene(&studio, &(LINEN.to_owned() + PAPER));
    let sound = studio::replayed(scene, settings(&[]), |handle| {
        handle.vanish("bell", 0.1).unwrap();
        handle.appear("block", "bell", 0.2, FedPose::at([0.0; 3])).unwrap();
        handle.vanish("bell", 0.3).unwrap();
        (1..=90u32).for_each(|frame| handle.advance(0.5 + f64::from(frame) / 60.0).unwrap());
    });
    assert_eq!(power(&sound, 0.0, 1.5), 0.0);
}

/// What is told, as lines of a score; `before` is called before an event is passed on.
fn lines(
    production: &Production,
    told: Vec<Event>,
    learning: Option<froufrou::render::production::Learning>,
    mut before: impl FnMut(&Event) + Send + 'static,
) -> Vec<ChannelLine> {
    let told = told.into_iter().map(move |event| {
        before(&event);
        Ok(event)
    });
    let last_s = 30.0;
    let lines = production.told_lines(told, 0.1, learning).unwrap().map(|line| line.unwrap());
    lines.take_while(|line| line.time_s() < last_s).collect()
}

fn there(time_s: f64, name: &str, kind: &str) -> Event {
    let fed = Arc::new(Fed::new(FedPose::at([0.0; 3])));
    Event::Change(Change {
        time_s,
        name: name.to_owned(),
        what: Becomes::There { kind: kind.to_owned(), fed },
    })
}

fn gone(time_s: f64, name: &str) -> Event {
    Event::Change(Change { time_s, name: name.to_owned(), what: Becomes::Gone })
}

fn buckle(time_s: f64, cloth: &str, energy_mps: f64) -> Event {
    Event::Buckle(Buckle {
        time_s,
        lasts_s: 0.01,
        cloth: cloth.to_owned(),
        position_m: [0.0; 3],
        patch: 0,
        patch_m: [0.0; 3],
        energy_mps,
        positive: true,
        vertices: 3,
        resonators: Vec::new(),
        cause: Cause::Motion(Moved { from_s: time_s, to_s: time_s }),
    })
}

#[test]
fn no_two_cloths_have_the_same_random_numbers() {
    let studio = Studio::new();
    let linen = LINEN.replace("least_energy", "jitter = 0.03, least_energy");
    let production = Production::open(scene(&studio, &(linen + PAPER))).unwrap();
    let buckles = |from_s: f64, cloth: &str| -> Vec<Event> {
        let each = |k: u32| buckle(from_s + f64::from(k), cloth, 0.1 + f64::from(k * 7 % 5));
        (0..10).map(each).collect()
    };
    let mut told = vec![there(0.1, "a", "sheet"), there(0.1, "b", "sheet")];
    told.extend((0..10).flat_map(|k| [buckles(0.5, "a")[k].clone(), buckles(0.5, "b")[k].clone()]));
    told.extend([gone(10.0, "a"), there(10.0, "c", "sheet")]);
    told.extend(buckles(10.5, "c"));
    told.push(Event::Quiet(40.0));
    let lines = lines(&production, told, None, |_| {});
    // How much later than its buckle each pop is, of one cloth.
    let late = |cloth: &str, from_s: f64| -> Vec<u64> {
        let cues = lines.iter().filter_map(|line| match line {
            ChannelLine::Cue(cue) if cue.cause.starts_with(&format!("{cloth} buckles")) => Some(cue),
            _ => None,
        });
        let late = cues.filter(|cue| matches!(cue.action, Action::Grain(_)));
        late.map(|cue| ((cue.time_s - from_s).rem_euclid(1.0) * 1e6).round() as u64).collect()
    };
    let [a, b, c] = [late("a", 0.5), late("b", 0.5), late("c", 10.5)];
    eprintln!("{a:?} {b:?} {c:?}");
    assert!(a.len() == 10 && a.iter().collect::<std::collections::BTreeSet<_>>().len() > 5, "{a:?}");
    for (one, other) in [(&a, &b), (&a, &c), (&b, &c)] {
        assert!(one.len() == other.len() && one != other);
    }
}

#[test]
fn what_appears_again_before_its_sound_is_loaded_sounds_once() {
    let studio = Studio::new();
    studio.tone("tone.wav");
    let text = format!(
        "duration = 2\n{EAR}[[object]]\nname = 'fly'\nposition = [0, 0, 0]\n\
         sound = {{ recording = 'tone.wav', loop = true }}\n"
    );
    let scene = Scene::open(studio.file("told.toml", &text), false).unwrap();
    let production = Production::open_unheard(scene, |_, _| Ok(())).unwrap();
    let (_, learning, loading) = production.loading();
    let told = vec![
        gone(0.05, "fly"),
        there(0.1, "wasp", "fly"),
        Event::Quiet(0.2),
        gone(0.3, "wasp"),
        there(0.4, "wasp", "fly"),
        Event::Quiet(0.5),
        Event::Quiet(0.6),
        Event::Quiet(40.0),
    ];
    let mut loading = Some(loading);
    let lines = lines(&production, told, Some(learning), move |event| {
        if *event == Event::Quiet(0.6)
            && let Some(loading) = loading.take()
        {
            loading.run(|_, loaded| loaded.is_ok());
        }
    });
    let starts = lines.iter().filter_map(|line| match line {
        ChannelLine::Thread(statement) => match &statement.verb {
            Verb::Start(start) if start.object == "wasp" => Some(statement.time_s),
            _ => None,
        },
        ChannelLine::Cue(_) => None,
    });
    let starts: Vec<f64> = starts.collect();
    assert!(starts.len() == 1 && starts[0] >= 0.5, "{starts:?}");
}

/// A listener that is told to be where it is anyway changes nothing.
#[test]
fn microphones_of_their_own_keep_their_places_to_each_other() {
    let studio = Studio::new();
    let mut click = vec![0.0f32; 480];
    click[0] = 0.5;
    studio.recording("click.wav", RATE_HZ, &click);
    let text = "duration = 1.5\n\
         [[microphone]]\nname = 'left'\nposition = [-0.2, 1, 2]\nfacing = [-1, 0, 0]\n\
         [[microphone]]\nname = 'right'\nshape = 'cardioid'\nposition = [0.2, 1, 2]\nfacing = [1, 0, -1]\n\
         [[object]]\nname = 'bell'\nposition = [3, 1, 1]\nsound = { recording = 'click.wav', at = [0.2, 0.9] }\n";
    let open = || Scene::open(studio.file("told.toml", text), false).unwrap();
    let still = studio.scene(text, Take::at(RATE_HZ)).unwrap().mix;
    // The first of them faces to the left: unturned it looks along −Z, to which +X is right.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let left = [0.0, half, 0.0, half];
    let sound = |pose: Option<FedPose>| {
        let settings = EngineSettings { moves_listener: true, ..settings(&[]) };
        studio::replayed(open(), settings, move |handle| {
            for frame in 1..=90u32 {
                if let Some(pose) = pose.filter(|_| frame == 1) {
                    handle.listener(0.0, pose).unwrap();
                }
                handle.advance(f64::from(frame) / 60.0).unwrap();
            }
        })
    };
    let at_rest = FedPose { position_m: [-0.2, 1.0, 2.0], rotation: left };
    for pose in [None, Some(at_rest)] {
        let found = distance(&sound(pose), &still);
        eprintln!("{pose:?}: {found} of the peak away");
        assert!(found < 1e-4, "{pose:?}: {found}");
    }
    // All is turned about the first one by half a turn: the other is at its other side.
    let turned = sound(Some(FedPose { rotation: [0.0, -half, 0.0, half], ..at_rest }));
    let first = |channel: usize| {
        let samples: Vec<f32> = turned.iter().skip(channel).step_by(2).copied().collect();
        let peak = samples[..36_000].iter().fold(0.0f32, |peak, s| peak.max(s.abs()));
        samples.iter().position(|s| s.abs() > 0.5 * peak).unwrap() as f64 / f64::from(RATE_HZ)
    };
    let away = |x: f64| (3.0 - x).hypot(1.0 - 2.0);
    let expected_s = (away(-0.6) - away(-0.2)) / 340.0;
    assert!((first(1) - first(0) - expected_s).abs() < 1.5 / f64::from(RATE_HZ), "{expected_s}");
}
